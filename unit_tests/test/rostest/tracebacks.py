"""Tells a traceback of ours from one of Python, which has its own for a node that roslaunch ends
before the first line of ours."""

FRAME = r'File "[^"]*/(unit_tests|behavior_controller)/[^"]*\.py"'
"""A frame in one of our modules, which every traceback of ours has."""
