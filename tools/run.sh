#!/usr/bin/env bash
# Sets everything up and runs the lab tour once against the nine simulated nodes. Arguments go to
# unit_tests/launch/behaviorControllerTest.launch: tools/run.sh failureRate:=0.2
# The last line is the verdict, and the exit code: 0 passed, 1 failed, 2 nothing was tested.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/environment.sh"

"$REPOSITORY/tools/setup.sh"
use_workspace
code=0
rosrun unit_tests runTest scenarioSpecification:=lab_tour missionRuns:=1 randomSeed:=1 "$@" 2>&1 | tee "$BUILD/log/run.log" || code=$?
echo
grep -E '^(PASSED|FAILED)' "$BUILD/log/run.log" | tail -n 1 || echo "nothing was tested"
exit "$code"
