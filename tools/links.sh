# How the package cssr_system gets into a workspace. Sourced by the other scripts.
# catkin does not look for a package inside a package, so each gets its own place in the workspace. One link to the
# whole repository would lead to a workspace below it again, and rosrun and roslib follow links: so each entry gets a link.

# link_package FOLDER: make or renew the links in FOLDER
link_package() {
  local folder="$1" entry
  mkdir -p "$folder"
  find "$folder" -maxdepth 1 -type l -delete
  package_entries | while read -r entry; do
    ln -s "$REPOSITORY/$entry" "$folder/$entry"
  done
  # CMake would install the link itself, which leads nowhere from there
  cp --remove-destination "$REPOSITORY/package.xml" "$folder/package.xml"
}

package_entries() {
  ls "$REPOSITORY" | grep -vx -e build -e unit_tests -e python_packages
}
