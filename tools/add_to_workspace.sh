#!/usr/bin/env bash
# Puts both packages into a catkin workspace of your own: tools/add_to_workspace.sh ~/catkin_ws
# It links them into the workspace's src, and lays the Python packages that the workspace's Python lacks beside them, in
# src/cssr_system/python_packages, from where catkin_make takes them along. Root is not needed. Run it again at any time.
# tools/add_to_workspace.sh --remove ~/catkin_ws takes all of it out again, with what was built and installed of it.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/progress.sh"
. "$REPOSITORY/tools/links.sh"

main() {
  local removes=""
  [ "${1:-}" != --remove ] || { removes=yes; shift; }
  [ $# = 1 ] && [ -n "$1" ] && [ "${1#-}" = "$1" ] ||
    fail "usage: tools/add_to_workspace.sh [--remove] WORKSPACE   (the folder in which you call catkin_make)"
  [ -z "$removes" ] || [ -d "$1/src" ] || fail "$1 is no catkin workspace: it has no folder src"
  mkdir -p "$1/src"
  WORKSPACE="$(cd "$1" && pwd -P)"
  LOGS="$WORKSPACE/build/log/cssr_system"
  PACKAGE="$WORKSPACE/src/cssr_system"
  # a clone inside the workspace is the package cssr_system itself
  [[ "$REPOSITORY/" != "$WORKSPACE"/src/* ]] || PACKAGE="$REPOSITORY"
  refuse_another_package
  if [ -n "$removes" ]; then
    remove
  else
    [ "$PACKAGE" = "$REPOSITORY" ] || link_package "$PACKAGE"
    ln -sfn "$REPOSITORY/unit_tests" "$WORKSPACE/src/unit_tests" # catkin does not look for it inside of a package
    add_python_packages
    echo "Now, in $WORKSPACE: catkin_make$(python_option) && source devel/setup.bash"
  fi
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

# The Python that the workspace was, or will be, built with.
workspace_python() {
  local cache="$WORKSPACE/build/CMakeCache.txt" python=""
  [ ! -f "$cache" ] || python="$(sed -n '/^PYTHON_EXECUTABLE:/{s/^[^=]*=//p;q}' "$cache")"
  echo "${python:-/usr/bin/python3}"
}

# catkin_make would choose the first python3 on PATH, which may be one without ROS (of pyenv, conda).
python_option() {
  [ -f "$WORKSPACE/build/CMakeCache.txt" ] || [ "$(command -v python3)" -ef "$(workspace_python)" ] ||
    echo " -DPYTHON_EXECUTABLE=$(workspace_python)"
}

add_python_packages() {
  local python wanted="$LOGS/requirements.txt"
  python="$(workspace_python)"
  rm -rf "$PACKAGE/python_packages"
  mkdir -p "$LOGS"
  "$python" - "$REPOSITORY/tools/requirements.txt" "$wanted" "$LOGS/constraints.txt" <<'PYTHON'
import re
import sys
from importlib import metadata

OLDEST = {"py_trees": (2, 2)}  # Noetic's own is older
versions = {(package.metadata["Name"] or "").replace("-", "_"): package.version for package in metadata.distributions()}


def is_there(name):
    numbers = re.findall(r"\d+", versions.get(name, ""))[:2]
    return bool(numbers) and tuple(map(int, numbers)) >= OLDEST.get(name, ())


lines = open(sys.argv[1]).read().partition("# tests")[0].splitlines()
names = [re.match(r"[\w-]*", line).group() for line in lines]
with open(sys.argv[2], "w") as wanted:
    wanted.writelines(line + "\n" for name, line in zip(names, lines) if name and not is_there(name))
with open(sys.argv[3], "w") as constraints:  # what the system has stays as it is, also for its other programs
    constraints.writelines("{}=={}\n".format(*pair) for pair in versions.items()
                           if pair[0] not in names and re.fullmatch(r"\d+(\.\d+)*", pair[1]))
PYTHON
  [ -s "$wanted" ] || return 0
  step python_packages "adding Python packages ($(sed 's/[^A-Za-z_].*//' "$wanted" | sort -u | tr '\n' ' ' | sed 's/ $//'))" \
    install_packages "$python" "$PACKAGE/python_packages" "$wanted" "$LOGS/constraints.txt"
}

# In a virtual environment pip adds only what the system lacks.
install_packages() {
  local python="$1" folder="$2" wanted="$3" constraints="$4" environment packages
  environment="$(mktemp -d)"
  trap "rm -rf '$environment'" EXIT
  if "$python" -m pip --version; then
    "$python" -m venv --system-site-packages --without-pip "$environment"
  else # Debian's Python may have none
    "$python" -m venv --system-site-packages "$environment" || { echo "install python3-pip or python3-venv"; return 1; }
  fi
  packages="$(echo "$environment"/lib/python*/site-packages)"
  ls "$packages" >"$environment/before"
  "$environment/bin/python" -m pip install --disable-pip-version-check --no-input -r "$wanted" -c "$constraints"
  mkdir -p "$folder"
  ls "$packages" | grep -vxF -f "$environment/before" -e __pycache__ | while read -r name; do
    mv "$packages/$name" "$folder/"
  done
  find "$folder" -type f -exec chmod -x {} + # rosrun would offer them
}

# All that this command, catkin_make and catkin_make install left in the workspace.
remove() {
  local name python_packages
  python_packages="$(ls "$PACKAGE/python_packages" 2>/dev/null)" || true
  rm -rf "$PACKAGE/python_packages" "$LOGS"
  [ "$PACKAGE" = "$REPOSITORY" ] || rm -rf "$PACKAGE"
  rm -f "$WORKSPACE/src/unit_tests"
  for name in {cssr_system,unit_tests}{,.pc,'-*'} behavior_controller 60.cssr_system.bash 50.virtual_environment.sh; do
    remove_built -name "$name"
  done
  for name in $(cd "$REPOSITORY" && find src/behavior_controller unit_tests/nodes -maxdepth 1 -type f -perm /111 -printf '%f\n'); do
    remove_built -path "*/atomic_configure/$name" -o -path "*/bin/$name"
  done
  for name in $python_packages; do
    remove_built -path "*/dist-packages/$name"
  done
  rm -f "$WORKSPACE/devel/bin/cmake.lock"
  find "$WORKSPACE"/{build/log,devel,install} -type d -empty -delete 2>/dev/null || true
  echo "Both packages are out of $WORKSPACE. Now, in it: catkin_make"
}

# remove_built TEST…: what find finds by it in the folders that are built
remove_built() {
  find "$WORKSPACE"/{build,devel,install} \( "$@" \) -prune -exec rm -rf {} + 2>/dev/null || true
}

main "$@"
