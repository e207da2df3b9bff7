#!/usr/bin/env bash
# Sets everything up and runs a command in the workspace's environment: tools/in_workspace.sh python3 -m …
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/environment.sh"

"$REPOSITORY/tools/setup.sh"
use_workspace
exec "$@"
