#!/usr/bin/env bash
# Sets everything up and runs a mission, the lab tour if none is named, once against the nine simulated nodes, ten times as fast as
# on a robot. Arguments go to "rosrun unit_tests runTest", whose help explains them: tools/run.sh failureRate:=0.2 speed:=1
# The last lines are the verdict and the path of the report as a page. Exit code: 0 passed, 1 failed, 2 nothing was tested, 3 cut off.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/environment.sh"

given="$(printf '%s\n' "$@")"

# The second word is an argument, unless the user gave one of that name: the first word is the pattern of the name.
unless_given() {
  grep -qE "^($1):=" <<< "$given" || arguments+=("$2")
}

arguments=("$@")
unless_given 'mission|scenarioSpecification' scenarioSpecification:=lab_tour
unless_given 'missionRuns' missionRuns:=1
unless_given 'seed|randomSeed' randomSeed:=1
unless_given 'speed' speed:=10

[[ "${arguments[-1]}" != speed:=10 ]] ||
  echo "This runs the mission once on the simulated robot, in simulated time 10 times as fast as the computer's (a tour of four minutes in half a minute), after installing what is missing. ARGS=speed:=1 takes a robot's time."

"$REPOSITORY/tools/setup.sh"
use_workspace
exec rosrun unit_tests runTest "${arguments[@]}"
