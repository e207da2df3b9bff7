"""Finds likely mistakes of a mission without running it."""
