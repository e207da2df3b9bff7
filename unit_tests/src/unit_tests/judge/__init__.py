"""Judges a test from the controller's record and the simulated nodes' journal."""
