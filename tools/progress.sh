# Shows long steps: one line each with its time; what a step prints goes to a log file. Sourced by the other scripts.

LOGS="$REPOSITORY/build/log"

# step NAME TITLE COMMAND…: run COMMAND; if it fails show the end of its log and leave with exit code 1
step() {
  local name="$1" title="$2" log="$LOGS/$1.log" start=$SECONDS
  shift 2
  mkdir -p "$LOGS"
  printf '%-56s ' "$title …"
  if "$@" >"$log" 2>&1 </dev/null; then
    printf '%4d s\n' $((SECONDS - start))
  else
    printf 'failed after %d s. The end of %s:\n' $((SECONDS - start)) "$log"
    tail -n 25 "$log" | sed 's/^/    /'
    exit 1
  fi
}

fail() {
  echo "$*" >&2
  exit 1
}
