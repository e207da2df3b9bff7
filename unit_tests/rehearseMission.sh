#!/bin/sh
# The former place of the command: rosrun unit_tests rehearseMission
echo "rehearseMission has moved: rosrun cssr_system rehearseMission" >&2
exec rosrun cssr_system rehearseMission "$@"
