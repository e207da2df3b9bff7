"""A mission from its files to its end: loaded, checked, run, and paused between visitors."""
