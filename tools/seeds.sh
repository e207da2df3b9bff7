#!/usr/bin/env bash
# Runs the test once for each seed, and prints a line for each run and a sum: tools/seeds.sh 20 failureRate:=0.3
# The first word is how many seeds, from 1 on; the others are arguments of tools/run.sh. Exit code 0: all runs passed; 1: not
# all; 2: the arguments cannot be used. The report of a run that did not pass is shown.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"

seeds="${1:-20}"
shift || true
[[ "$seeds" =~ ^[1-9][0-9]*$ ]] || { echo "tools/seeds.sh: how many seeds? \"$seeds\" is not a number: tools/seeds.sh 20 failureRate:=0.3"; exit 2; }

# at this rate, as at the delivered one, messages come in time all but surely; a run takes less time
given="$(printf '%s\n' "$@")"
grep -q '^arrivalRate:=' <<< "$given" || set -- arrivalRate:=600 "$@"
grep -q '^callTimes:=' <<< "$given" || set -- callTimes:=none "$@"
output="$(mktemp)"
trap 'rm -f "$output"' EXIT

failed=()
for seed in $(seq "$seeds"); do
  began=$SECONDS code=0
  "$REPOSITORY/tools/run.sh" randomSeed:="$seed" "$@" > "$output" 2>&1 || code=$?
  if [ "$code" = 2 ]; then
    tail -n 20 "$output"
    exit 2
  fi
  echo "seed $seed, $((SECONDS - began)) s: $(grep -E '^(PASSED|FAILED|CUT OFF): ' "$output" | tail -n 1)"
  if [ "$code" != 0 ]; then
    failed+=("$seed")
    sed -n '/^# [0-9-]*T/,$p' "$output"
  fi
done
echo "$seeds runs, $((seeds - ${#failed[@]})) passed${failed:+; not passed: the seeds ${failed[*]}}"
[ ${#failed[@]} = 0 ]
