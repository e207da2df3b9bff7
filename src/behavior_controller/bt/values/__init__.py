"""Typed values: the results of a tick, how values become one another, and the blackboard that
holds them."""
