"""Groot2's protocol: what it shows of a running tree, and its breakpoints."""
