"""A program of its own that shows a run: reads its lines, and serves the page and Groot2's protocol.
"""
