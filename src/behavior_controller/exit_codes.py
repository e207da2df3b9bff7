"""The exit codes of the node and of the tools; docs/reference.md explains them for each program."""

SUCCESS = 0
"""The last pass was a SUCCESS; a tool did its work."""

UNAVAILABLE = 1
"""Something required is missing: nodes of the robot, the master, a running mission, a Python
package, an output."""

WRONG_INPUT = 2
"""The configuration, a mission, a record or the command line is wrong."""

FAILURE = 3
"""The last pass was a FAILURE; a replay took another path."""

BROKEN = 4
"""The node could not go on: no memory, threads or files left, or an internal error."""

FINDINGS = 4
"""A rehearsal has findings."""
