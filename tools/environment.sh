# Where things are, and the shell that ROS needs. Sourced by the other scripts.

BUILD="$REPOSITORY/build"
export LC_ALL=C.UTF-8 PIP_USER=0

# The ROS of this machine, whatever the shell had sourced before.
use_ros() {
  unset CMAKE_PREFIX_PATH PYTHONPATH ROS_PACKAGE_PATH ROS_ROOT ROS_IP
  if [ -f /opt/ros/noetic/setup.bash ]; then
    . /opt/ros/noetic/setup.bash
  fi
}

# The built workspace, with its own master: it does not meet or disturb anything else that runs on the machine.
use_workspace() {
  use_ros
  . "$BUILD/devel/setup.bash"
  unset PYTHONDONTWRITEBYTECODE # or each of the many programs of a test compiles all modules again
  export ROS_HOME="$BUILD/ros" ROS_HOSTNAME=localhost PYTHONUNBUFFERED=1
  ROS_MASTER_URI="http://localhost:$(free_port)"
  export ROS_MASTER_URI
}

free_port() {
  "$BUILD/venv/bin/python" -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])'
}

# remove_unless_used FOLDER…: what running programs use stays, and is then brought up to date where it lies
remove_unless_used() {
  local commands
  commands="$(cat /proc/[0-9]*/cmdline 2>/dev/null | tr '\0' '\n')" || true
  [[ "$commands" == *"$1/"* ]] || rm -rf "$@"
}
