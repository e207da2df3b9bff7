"""Plays a mission in virtual time with each visitor and fault, and reports what it finds."""
