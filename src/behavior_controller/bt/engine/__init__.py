"""Runs a mission: the declared node types, the tick pipeline, the built-in nodes, the tree, its
clock and its wake-up signal."""
