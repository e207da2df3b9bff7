#!/usr/bin/env bash
# Prepares everything that running and testing need, and skips what is there: packages of the system, a virtual
# environment (build/venv) and the catkin workspace (build/devel, built from the links in build/src).
# With --tests also the packages that tests need, with --pythons those and a virtual environment for each other supported
# Python that is installed.
set -eo pipefail

# ROS 1 from Debian 12's own packages
DEBIAN_PACKAGES="
  catkin cmake make g++ graphviz
  libactionlib-msgs-dev libgeometry-msgs-dev libroscpp-dev librostest-dev libstd-msgs-dev
  python3-actionlib python3-actionlib-msgs python3-diagnostic-msgs python3-geometry-msgs python3-lxml python3-roslaunch
  python3-rosmsg python3-rosnode python3-rospy python3-rosservice python3-rostest python3-rostopic python3-std-msgs python3-std-srvs python3-tornado python3-venv python3-zmq
  ros-actionlib-msgs ros-core ros-geometry-msgs ros-message-generation ros-message-runtime ros-std-msgs rosbash"

# ROS Noetic on Ubuntu 20.04; its package source is set up where /opt/ros/noetic is
NOETIC_PACKAGES="
  cmake make g++ graphviz python3-lxml python3-tornado python3-venv python3-zmq
  ros-noetic-actionlib ros-noetic-actionlib-msgs ros-noetic-catkin ros-noetic-diagnostic-msgs ros-noetic-geometry-msgs
  ros-noetic-message-generation ros-noetic-message-runtime ros-noetic-rosbash ros-noetic-rosgraph
  ros-noetic-roslaunch ros-noetic-rosmsg ros-noetic-rosnode ros-noetic-rospy ros-noetic-rosservice ros-noetic-rostest ros-noetic-rostopic ros-noetic-std-msgs ros-noetic-std-srvs"

# for the tests: a browser that looks at the page; Ubuntu 20.04 has none as a package, and its tests are skipped there
TEST_PACKAGES="chromium chromium-driver fonts-dejavu-core python3-selenium"

# the interpreters of the two platforms
PYTHONS="3.8 3.11"

# what rospy and the tests of the ROS edge import
ROS_MODULES="
  actionlib actionlib_msgs catkin catkin_pkg diagnostic_msgs genmsg genpy geometry_msgs rosclean roscpp rosgraph rosgraph_msgs roslib rospkg rospy rostest
  rosunit std_msgs std_srvs"

REPOSITORY="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
. "$REPOSITORY/tools/progress.sh"
. "$REPOSITORY/tools/environment.sh"
. "$REPOSITORY/tools/links.sh"

main() {
  mkdir -p "$BUILD"
  exec 9>"$BUILD/lock"
  flock 9 # two set-ups at once would spoil each other's work
  install_packages "${1:-}"
  make_environment "$BUILD/venv" /usr/bin/python3 --system-site-packages
  build_workspace
  if [ "${1:-}" = --pythons ]; then
    make_other_environments
  fi
}

install_packages() {
  local wanted missing
  if [ -d /opt/ros/noetic ]; then
    wanted="$NOETIC_PACKAGES"
  else
    wanted="$DEBIAN_PACKAGES"
    [ -z "${1:-}" ] || wanted="$wanted $TEST_PACKAGES"
  fi
  command -v dpkg-query >/dev/null || fail "This needs Debian 12, or Ubuntu 20.04 with ROS Noetic."
  missing="$(missing_packages $wanted)"
  [ -n "$missing" ] || return 0
  if [ "$(id -u)" = 0 ]; then
    step packages "installing system packages ($(wc -w <<<"$missing"))" apt_install $missing
  elif command -v sudo >/dev/null; then
    sudo -v || fail "Root is needed to install packages. As root: apt-get install" $missing
    step packages "installing system packages ($(wc -w <<<"$missing"))" apt_install $missing
  else
    fail "System packages are missing. As root: apt-get install" $missing
  fi
}

missing_packages() {
  local installed
  installed="$(dpkg-query -W -f '${Package} ${db:Status-Status}\n' "$@" 2>/dev/null |
    sed -n 's/ installed$//p' | LC_ALL=C sort -u)" || true
  LC_ALL=C comm -13 <(echo "$installed") <(printf "%s\n" "$@" | LC_ALL=C sort -u) | tr '\n' ' ' | sed 's/ $//'
}

apt_install() {
  local root="env"
  [ "$(id -u)" = 0 ] || root="sudo env"
  $root apt-get -o DPkg::Lock::Timeout=300 update
  $root DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -y --no-install-recommends "$@"
}

# make_environment FOLDER PYTHON [OPTION…]: a virtual environment with what requirements.txt lists
make_environment() {
  local folder="$1" python="$2" version key
  shift 2
  version="$("$python" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])')"
  key="$folder $python $version $* $(sha256sum <"$REPOSITORY/tools/requirements.txt")"
  up_to_date "$folder.stamp" "$key" && [ -x "$folder/bin/python" ] && return 0
  rm -f "$folder.stamp"
  remove_unless_used "$folder"
  step "$(basename "$folder")" "making the Python ${version%.*} environment" fill_environment "$folder" "$python" "$@"
  echo "$key" >"$folder.stamp"
}

fill_environment() {
  local folder="$1" python="$2"
  shift 2
  "$python" -m venv "$@" "$folder" &&
    "$folder/bin/python" -m pip install --disable-pip-version-check --no-input -r "$REPOSITORY/tools/requirements.txt"
}

make_other_environments() {
  local version python
  for version in $PYTHONS; do
    if [ "$version" != "$(python_version "$BUILD/venv/bin/python")" ]; then
      python="$(find_python "$version")"
      [ -z "$python" ] || make_environment "$BUILD/venv-$version" "$python"
    fi
  done
  link_ros_modules
}

# ROS for an interpreter that is not the system's: rospy and what it imports are plain Python; other packages of the
# system are compiled for its own interpreter, and must not be found.
link_ros_modules() {
  local module
  rm -rf "$BUILD/ros_modules"
  mkdir "$BUILD/ros_modules"
  for module in $ROS_MODULES; do
    [ ! -d "/usr/lib/python3/dist-packages/$module" ] ||
      ln -s "/usr/lib/python3/dist-packages/$module" "$BUILD/ros_modules/$module"
  done
}

python_version() {
  "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || true
}

# find_python VERSION: an interpreter on PATH, or one of pyenv's
find_python() {
  local python
  for python in "/usr/bin/python$1" "$(command -v "python$1")" "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1".*/bin/python; do
    if [ -x "$python" ] && [ "$(python_version "$python")" = "$1" ]; then
      echo "$python"
      return
    fi
  done
}

build_workspace() {
  local key
  link_package "$BUILD/src/cssr_system"
  ln -sfn "$REPOSITORY/unit_tests" "$BUILD/src/unit_tests"
  key="$(workspace_key)"
  up_to_date "$BUILD/workspace.stamp" "$key" && [ -f "$BUILD/devel/setup.bash" ] && return 0
  rm -f "$BUILD/workspace.stamp"
  remove_unless_used "$BUILD/devel" "$BUILD/build"
  step workspace "building the catkin workspace" catkin_build
  echo "$key" >"$BUILD/workspace.stamp"
}

# What the workspace is built from; Python modules, configuration and data are used where they lie.
workspace_key() {
  cd "$REPOSITORY"
  echo "$BUILD $(cat "$BUILD/venv.stamp")"
  sha256sum {.,unit_tests}/{package.xml,CMakeLists.txt,setup.py} action/* srv/* msg/* env-hooks/* tools/{setup,links}.sh
  ls unit_tests/nodes test/rostest/*.test unit_tests/test/rostest/*.test 2>/dev/null || true
}

catkin_build() {
  use_ros
  # our nodes need the messages in Python alone
  export ROS_LANG_DISABLE=gencpp:geneus:genlisp:gennodejs
  cd "$BUILD" && catkin_make --force-cmake -DPYTHON_EXECUTABLE="$BUILD/venv/bin/python"
}

up_to_date() {
  [ -f "$1" ] && [ "$(cat "$1")" = "$2" ]
}

main "$@"
