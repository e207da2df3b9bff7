# How the package cssr_system gets into a workspace. Sourced by the other scripts.
# catkin does not look for a package inside a package, so each gets its own place in the workspace. One link to the
# whole repository would lead to a workspace below it again, and rosrun and roslib follow links: so each entry gets a link.

# link_package FOLDER: make the links in FOLDER, or renew those that are not right: running programs use the others
link_package() {
  local folder="$1" entries entry link
  mkdir -p "$folder"
  entries="$(package_entries)"
  while IFS= read -r entry; do
    [ "$(readlink "$folder/$entry")" = "$REPOSITORY/$entry" ] || ln -sfn "$REPOSITORY/$entry" "$folder/$entry"
  done <<<"$entries"
  find "$folder" -maxdepth 1 -type l -print0 | while IFS= read -rd '' link; do
    [[ "$(readlink "$link")" != "$REPOSITORY"/* ]] || grep -qxF "$(basename "$link")" <<<"$entries" || rm "$link"
  done
  # CMake would install the link itself, which leads nowhere from there
  cmp -s "$REPOSITORY/package.xml" "$folder/package.xml" ||
    cp --remove-destination "$REPOSITORY/package.xml" "$folder/package.xml"
}

# What git has of the package: a file that was left beside it is no part of it. Without git: all that is there.
package_entries() {
  local files
  files="$(git -C "$REPOSITORY" ls-files 2>/dev/null)" || true
  [ -n "$files" ] || files="$(ls "$REPOSITORY")"
  cut -d/ -f1 <<<"$files" | sort -u |
    grep -vx -e '\..*' -e build -e unit_tests -e python_packages -e package.xml
}
