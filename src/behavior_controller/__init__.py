"""Robot Mission Interpreter: runs a mission drawn in Groot2 on the CSSR4Africa robot.

docs/architecture.md says which folder uses which; reading starts with those that use no other.
"""
import sys

NOT_SET_UP = ("{}, for {}: build the workspace as the README says, and source its setup.bash; if "
              "that is done, `catkin_find cssr_system` says what else is wrong with the workspace")
"""What is missing, and for which Python."""

if sys.version_info < (3, 8):
    raise ImportError("Python 3.8 or newer is needed")
