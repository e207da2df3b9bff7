"""Runs a test: its options, the controller under test, and the node that waits for the end."""
