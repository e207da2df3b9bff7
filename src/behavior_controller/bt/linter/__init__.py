"""Finds faults and likely mistakes of a mission without running it."""
