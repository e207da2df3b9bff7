#!/usr/bin/env bash
# Puts both packages into a catkin workspace of your own: tools/add_to_workspace.sh ~/catkin_ws
# It links them into the workspace's src, and lays the Python packages that the workspace's Python lacks beside them, in
# src/cssr_system/python_packages, from where catkin_make takes them along. Root is not needed. Run it again at any time.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/progress.sh"
. "$REPOSITORY/tools/links.sh"

main() {
  [ $# = 1 ] && [ "${1#-}" = "$1" ] || fail "usage: tools/add_to_workspace.sh WORKSPACE   (the folder in which you call catkin_make)"
  mkdir -p "$1/src"
  WORKSPACE="$(cd "$1" && pwd -P)"
  LOGS="$WORKSPACE/build/log/cssr_system"
  PACKAGE="$WORKSPACE/src/cssr_system"
  refuse_another_package
  add_links
  add_python_packages
  echo "Now, in $WORKSPACE: catkin_make && source devel/setup.bash"
}

# The robot's own nodes may live in a package of the same name; one workspace can hold only one of them.
refuse_another_package() {
  local other
  for other in $(grep -lsE '<name>(cssr_system|unit_tests)</name>' "$WORKSPACE"/src/*/package.xml "$WORKSPACE"/src/*/*/package.xml); do
    other="$(dirname "$other")"
    case "$(readlink -f "$other/CMakeLists.txt")" in
      "$REPOSITORY"/*) ;;
      *) fail "$other is a package of the same name: put ours into a workspace of its own, and source that one last (see docs/developers_guide.md)" ;;
    esac
  done
}

# A clone inside the workspace is the package cssr_system itself; catkin does not look for unit_tests inside of it.
add_links() {
  case "$REPOSITORY/" in
    "$WORKSPACE"/src/*) PACKAGE="$REPOSITORY" ;;
    *) link_package "$PACKAGE" ;;
  esac
  ln -sfn "$REPOSITORY/unit_tests" "$WORKSPACE/src/unit_tests"
}

add_python_packages() {
  local python folder="$PACKAGE/python_packages" wanted="$LOGS/requirements.txt"
  python="$(sed -n "s/^PYTHON_EXECUTABLE:[A-Z]*=//p" "$WORKSPACE/build/CMakeCache.txt" 2>/dev/null || true)"
  python="${python:-/usr/bin/python3}"
  rm -rf "$folder"
  mkdir -p "$LOGS"
  "$python" - "$REPOSITORY/tools/requirements.txt" >"$wanted" <<'PYTHON'
import re
import sys
from importlib import metadata

OLDEST = {"py_trees": (2, 2)}  # Noetic's own is older

for line in open(sys.argv[1]):
    if line.startswith("# tests"):
        break
    name = re.match(r"[\w.-]*", line).group()
    try:
        found = tuple(int(number) for number in re.findall(r"\d+", metadata.version(name) if name else "")[:2])
    except metadata.PackageNotFoundError:
        found = ()
    if name and (not found or found < OLDEST.get(name, ())):
        print(line, end="")
PYTHON
  [ -s "$wanted" ] || return 0
  step python_packages "adding Python packages ($(sed 's/[^A-Za-z_].*//' "$wanted" | sort -u | tr '\n' ' ' | sed 's/ $//'))" \
    install_packages "$python" "$folder" "$wanted"
}

# Debian's Python may have no pip; then one in a virtual environment does it.
install_packages() {
  local python="$1" folder="$2" wanted="$3" temporary
  if ! "$python" -m pip --version; then
    temporary="$(mktemp -d)"
    trap 'rm -rf "$temporary"' EXIT
    "$python" -m venv "$temporary" || { echo "install python3-pip or python3-venv"; return 1; }
    python="$temporary/bin/python"
  fi
  "$python" -m pip install --disable-pip-version-check --no-input --target "$folder" -r "$wanted"
  rm -rf "$folder/bin" # not on anyone's PATH
  find "$folder" -type f -exec chmod -x {} +
}

main "$@"
