#!/usr/bin/env bash
# Puts both packages into a catkin workspace of your own: tools/add_to_workspace.sh ~/catkin_ws
# It links them into the workspace's src, and lays the Python packages that the workspace's Python lacks beside them, in
# src/cssr_system/python_packages, from where catkin_make takes them along. Root is not needed. Run it again at any time.
# tools/add_to_workspace.sh --remove ~/catkin_ws takes all of it out again, with what was built and installed of it.
set -eo pipefail
REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/progress.sh"
. "$REPOSITORY/tools/links.sh"
export PYTHONPATH="" # what this shell has sourced is not what the system has

main() {
  local removes=""
  [ "${1:-}" != --remove ] || { removes=yes; shift; }
  [ $# = 1 ] && [ -n "$1" ] && [ "${1#-}" = "$1" ] ||
    fail "usage: tools/add_to_workspace.sh [--remove] WORKSPACE   (the folder in which you call catkin_make)"
  [ -z "$removes" ] || [ -d "$1/src" ] || fail "$1 is no catkin workspace: it has no folder src"
  WORKSPACE="$(realpath -m "$1")"
  SOURCE="$(realpath -m "$1/src")"
  LOGS="$WORKSPACE/build/log/cssr_system"
  PACKAGE="$SOURCE/cssr_system"
  # a clone inside the workspace is the package cssr_system itself
  [[ "$REPOSITORY/" != "$SOURCE"/* ]] || PACKAGE="$REPOSITORY"
  [ -n "$removes" ] || refuse_places "$1"
  refuse_what_is_not_ours
  refuse_another_package
  if [ -n "$removes" ]; then
    remove
  else
    mkdir -p "$SOURCE"
    [ "$PACKAGE" = "$REPOSITORY" ] || link_package "$PACKAGE"
    ln -sfn "$REPOSITORY/unit_tests" "$SOURCE/unit_tests" # catkin does not look for it inside of a package
    add_python_packages
    if [[ "$WORKSPACE" = *" "* ]]; then
      echo "Now, in $WORKSPACE: catkin_make$(python_option) install && source install/setup.bash (from devel, rosrun runs nothing below a path with a blank)"
    else
      echo "Now, in $WORKSPACE: catkin_make$(python_option) && source devel/setup.bash"
    fi
  fi
}

# Ends if catkin_make could not build there. A link to a path takes more characters than a workspace.
refuse_places() {
  local built="$WORKSPACE"
  [ "$PACKAGE" != "$REPOSITORY" ] || built="$WORKSPACE $PACKAGE"
  [[ "$built" != *[][\{\}\(\)\<\>\'\`\$\&:\#\|]* && "$1$WORKSPACE$REPOSITORY" != *[\"\\\;[:cntrl:]]* ]] ||
    fail "catkin_make cannot build ${REPOSITORY//[[:cntrl:]]/?} in ${WORKSPACE//[[:cntrl:]]/?}: a path has a quote, bracket, control character or one of \\ \$ & ; : # |"
  [[ "$SOURCE/" != "$REPOSITORY"/* ]] || fail "$SOURCE would be a part of this repository: name another workspace"
  [ -d "$SOURCE" ] || [ ! -e "$SOURCE" ] || fail "$SOURCE is not a folder"
}

# Ends unless this command made all that is in its places.
refuse_what_is_not_ours() {
  local place places=("$PACKAGE/python_packages")
  if [ "$PACKAGE" != "$REPOSITORY" ]; then
    [ ! -L "$PACKAGE" ] && { [ -d "$PACKAGE" ] || [ ! -e "$PACKAGE" ]; } || refuse "$PACKAGE"
    readarray -d '' places < <(find "$PACKAGE" -mindepth 1 -maxdepth 1 -print0 2>/dev/null)
  fi
  for place in "${places[@]}" "$SOURCE/unit_tests"; do
    is_ours "$place" || { [ ! -e "$place" ] && [ ! -L "$place" ]; } || refuse "$place"
  done
}

# is_ours PATH: a link to what has its name in the repository, the copy of package.xml, or packages that pip laid there
is_ours() {
  local name="${1##*/}"
  case "$name" in
    package.xml) [ -f "$1" ] && [ ! -L "$1" ] && { cmp -s "$1" "$REPOSITORY/$name" || is_ours "${1%/*}/CMakeLists.txt"; } ;;
    python_packages) [ -d "$1" ] && [ ! -L "$1" ] && is_of_pip "$1" ;;
    __pycache__) [ -d "$1" ] && [ ! -L "$1" ] && [ -z "$(find "$1" ! -type d ! -name '*.pyc')" ] ;; # of conftest.py
    *) [ -L "$1" ] && { [ "$(readlink "$1")" = "$REPOSITORY/$name" ] || [ "$1" -ef "$REPOSITORY/$name" ]; } ;;
  esac
}

# is_of_pip FOLDER: whether each file belongs to a package that pip recorded there, and those that we need are among them
is_of_pip() {
  local files recorded
  files="$(find "$1" ! -type d ! -name '*.pyc' -printf '%P\n')"
  recorded="$(cat "$1"/*.dist-info/RECORD 2>/dev/null | sed 's/,[^,]*,[^,]*$//')"
  [ -z "$files" ] || { grep -qE '^(py_trees|msgspec)/' <<<"$recorded" && ! grep -qvxF -f <(echo "$recorded") <<<"$files"; }
}

refuse() {
  fail "${1//[[:cntrl:]]/?} was not made by this command, and nothing was changed: move it, or put ours into a workspace of its own, and source that one last (see docs/developers_guide.md)"
}

# The robot's own nodes may live in a package of the same name; one workspace can hold only one of them.
refuse_another_package() {
  local other
  other="$(/usr/bin/python3 - "$SOURCE" "$PACKAGE" "$REPOSITORY/unit_tests" <<'PYTHON'
import os
import sys
from xml.etree import ElementTree


def name_of(package):
    try:
        return (ElementTree.parse(os.path.join(package, "package.xml")).findtext("name") or "").strip()
    except (OSError, ElementTree.ParseError):
        return ""


seen = set()
for folder, folders, files in os.walk(sys.argv[1], followlinks=True):  # as catkin looks for packages
    place = os.path.realpath(folder)
    is_package = "package.xml" in files
    folders[:] = [name for name in folders if not is_package and not name.startswith(".")]
    if "CATKIN_IGNORE" in files or place in seen:
        folders[:] = []
    elif is_package and place not in sys.argv[2:] and name_of(folder) in ("cssr_system", "unit_tests"):
        os.write(1, os.fsencode(folder))
        break
    seen.add(place)
PYTHON
)"
  [ -z "$other" ] ||
    fail "${other//[[:cntrl:]]/?} is a package of the same name: put ours into a workspace of its own, and source that one last (see docs/developers_guide.md)"
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
  if [ ! -s "$wanted" ]; then
    rm -rf "$PACKAGE/python_packages"
    return
  fi
  step python_packages "adding Python packages ($(sed 's/[^A-Za-z_].*//' "$wanted" | sort -u | tr '\n' ' ' | sed 's/ $//'))" \
    install_packages "$python" "$PACKAGE/python_packages" "$wanted" "$LOGS/constraints.txt"
}

# In a virtual environment pip adds only what the system lacks. What was there is replaced when all of it is complete.
install_packages() {
  local python="$1" folder="$2" wanted="$3" constraints="$4" packages
  rm -rf "$LOGS"/environment.* # of a call that was killed
  ENVIRONMENT="$(mktemp -d "$LOGS/environment.XXXXXX")"
  trap 'rm -rf "$ENVIRONMENT"' EXIT
  if "$python" -m pip --version; then
    "$python" -m venv --system-site-packages --without-pip "$ENVIRONMENT"
  else # Debian's Python may have none
    "$python" -m venv --system-site-packages "$ENVIRONMENT" || { echo "install python3-pip or python3-venv"; return 1; }
  fi
  packages="$(echo "$ENVIRONMENT"/lib/python*/site-packages)"
  ls "$packages" >"$ENVIRONMENT/before"
  "$ENVIRONMENT/bin/python" -m pip install --disable-pip-version-check --no-input -r "$wanted" -c "$constraints" || return 1
  mkdir "$ENVIRONMENT/python_packages"
  ls "$packages" | grep -vxF -f "$ENVIRONMENT/before" -e __pycache__ | while read -r name; do
    mv "$packages/$name" "$ENVIRONMENT/python_packages/"
  done
  find "$ENVIRONMENT/python_packages" -type f -exec chmod -x {} + # rosrun would offer them
  [ ! -d "$folder" ] || mv "$folder" "$ENVIRONMENT/former" # a half of it would count as the user's
  mv "$ENVIRONMENT/python_packages" "$folder"
}

# All that this command, catkin_make and catkin_make install left in the workspace. A file of another package stays, also
# where its name is one of ours.
remove() {
  local modules
  cd "$WORKSPACE"
  for modules in {devel,install}/lib/python3*/*-packages; do
    remove_python_packages "$modules"
    ! grep -qsF -e "/cssr_system/src'" -e "$REPOSITORY/src'" -e 'PACKAGE = "cssr_system"' \
      "$modules"/behavior_controller/{__init__,ros_arguments}.py || remove_installed "${modules%%/*}" "$modules"
  done
  ! grep -qs behavior_controller build/cssr_system/catkin_generated/setup_py_interrogation.cmake ||
    take_out build/{cssr_system,unit_tests}
  remove_scripts build/atomic_configure
  take_out build/log/cssr_system/{constraints.txt,environment.*,python_packages.log,requirements.txt}
  rm -rf "$PACKAGE/python_packages" "$SOURCE/unit_tests"
  [ "$PACKAGE" = "$REPOSITORY" ] || rm -rf "$PACKAGE"
  echo "Both packages are out of $WORKSPACE. Now, in it: catkin_make"
}

# remove_installed SPACE MODULES: devel or install, and its folder of Python modules
remove_installed() {
  take_out "$1"/{include,lib,share,share/*/ros}/{cssr_system,unit_tests} "$1"/lib/pkgconfig/{cssr_system,unit_tests}.pc \
    "$2"/{cssr_system,unit_tests}{,-*.egg-info} "$2/behavior_controller"
  local hook
  for hook in "$1"/etc/catkin/profile.d/{60.cssr_system.bash,50.virtual_environment.sh}; do
    ! grep -qs cssr_system "$hook" || take_out "$hook"
  done
  remove_scripts "$1/bin"
  [ "$(ls -A "$1/bin" 2>/dev/null)" != cmake.lock ] || take_out "$1/bin/cmake.lock"
}

# remove_scripts FOLDER: our executables, and what catkin makes for them
remove_scripts() {
  local name
  (cd "$REPOSITORY" && find src/behavior_controller unit_tests/nodes -maxdepth 1 -type f -perm /111 -printf '%f\n') |
    while read -r name; do
      ! grep -qsE "(src/behavior_controller|unit_tests/nodes)/$name'|command\.run(_node)?\(\"$name\"," "$1/$name" ||
        take_out "$1/$name"
    done
}

# remove_python_packages MODULES: the copies of ours; a file that differs is another package's
remove_python_packages() {
  local name
  [ -d "$1" ] && [ -d "$PACKAGE/python_packages" ] || return 0
  find "$PACKAGE/python_packages" -type f -printf '%P\n' | while IFS= read -r name; do
    # RECORD has the checksum of a script that names the environment in which pip ran
    [[ "$name" != *.pyc && "$name" != */RECORD ]] && ! cmp -s "$PACKAGE/python_packages/$name" "$1/$name" || rm -f "$1/$name"
  done
  find "$PACKAGE/python_packages" -mindepth 1 -maxdepth 1 -type d -printf '%f\0' | while IFS= read -rd '' name; do
    find "$1/$name" \( -name '*.pyc' -o -type d -empty \) -delete 2>/dev/null || true
  done
  rmdir -p "$1" 2>/dev/null || true
}

# take_out PATH…: remove each, and the folders that get empty
take_out() {
  local path
  for path; do
    if [ -e "$path" ] || [ -L "$path" ]; then
      rm -rf "$path"
      rmdir -p "$(dirname "$path")" 2>/dev/null || true
    fi
  done
}

main "$@"
