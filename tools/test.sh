#!/usr/bin/env bash
# Sets everything up and runs every test. Words choose suites by name: tools/test.sh rostest
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/environment.sh"

"$REPOSITORY/tools/setup.sh" --tests
use_workspace
exec "$BUILD/venv/bin/python" "$REPOSITORY/tools/test.py" "$@"
