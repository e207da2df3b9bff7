"""BehaviorTree.CPP's scripting language."""
