"""BehaviorTree.CPP's scripting language and the typed values that it works on."""
