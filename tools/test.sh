#!/usr/bin/env bash
# Sets everything up and runs the tests side by side, then one by one those that measure time.
# tools/test.sh [--unit|--long] [WORD…]: those with a word in their name.
# With --unit those that take a moment, without ROS. With --long those that take long: the sum includes the run without it.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/progress.sh"
. "$REPOSITORY/tools/environment.sh"
RESULTS="$BUILD/log/tests"

main() {
  # two for each core: a test with ROS nodes waits more than half of its time
  local tier="not long" words="" places="" setup=--tests share=worksteal processes=$(($(nproc) * 2))
  case "${1:-}" in
    --unit)
      tier="not long and not slow" places="test/unit unit_tests/test/unit" processes="$(nproc)"
      shift
      ;;
    # a process has all tests of a file, with what they share; a whole test takes more than a core
    --long) tier="long" setup=--pythons share=loadfile processes=$(($(nproc) * 3 / 2)); shift ;;
  esac
  [ $# = 0 ] || words="$(printf ' or %s' "$@")"
  "$REPOSITORY/tools/setup.sh" "$setup"
  exec 8>"$BUILD/tests.lock"
  flock --nonblock 8 ||
    fail "Another run of the tests writes to build/log/tests: wait until it ends."
  use_workspace
  cd "$REPOSITORY"
  [ "$tier" = long ] || rm -rf "$RESULTS"
  run_tests "$tier and not timing" "${words# or }" -n "$processes" --dist "$share" $places
  # of all the tests few measure time: their files alone are collected once more
  [ -n "$places" ] || run_tests "$tier and timing" "${words# or }" --reruns 2 \
    $(grep -rlE 'mark\.timing|measures time' --include='*.py' --include='*.test' test unit_tests/test)
  "$BUILD/venv/bin/python" tools/sum_results.py "$RESULTS"/*.xml
}

# run_tests MARKERS WORDS [OPTION…] [FILE…]: failures, and no test to run, are left to the sum
run_tests() {
  local markers="$1" words="$2" code=0
  shift 2
  "$BUILD/venv/bin/python" -m pytest -q -r fEsR -m "$markers" -k "$words" "$@" \
    --junit-xml "$RESULTS/${markers// /_}.xml" 8>&- || code=$? # what a test leaves has no lock
  case "$code" in
    0 | 1 | 5) ;;
    *) exit "$code" ;;
  esac
}

main "$@"
