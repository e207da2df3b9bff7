"""What the set-up links and removes, while nodes run from its workspace."""
import os
import subprocess
import sys

TOOLS = os.path.join(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))),
                     "tools")


def call(script, command, repository):
    """Call a function of one of the set-up's scripts, for another repository."""
    subprocess.run(["bash", "-ec", ". {}/{}; {}".format(TOOLS, script, command)], check=True,
                   env=dict(os.environ, REPOSITORY=str(repository)))


def links(folder):
    return {path.name: path.lstat().st_ino for path in folder.iterdir() if path.is_symlink()}


def test_what_is_linked_follows_from_git(tmp_path):
    repository, package = tmp_path / "clone", tmp_path / "src"
    for name in ("data/a.xml", "srv/a.srv", "unit_tests/b", "package.xml", ".gitignore"):
        (repository / name).parent.mkdir(parents=True, exist_ok=True)
        (repository / name).write_text("")
    for command in (["init", "-q"], ["add", "."]):
        subprocess.run(["git"] + command, cwd=str(repository), check=True)
    call("links.sh", "link_package " + str(package), repository)
    before = links(package)
    assert set(before) == {"data", "srv"} and (package / "package.xml").is_file()
    (repository / "palette.xml").write_text("left here by a user")
    (package / "stale").symlink_to(repository / "palette.xml")
    call("links.sh", "link_package " + str(package), repository)
    assert links(package) == before, "those that are right were not made again"


def test_a_folder_that_a_program_runs_from_stays(tmp_path):
    used, unused = tmp_path / "devel", tmp_path / "venv"
    for folder in (used, unused):
        folder.mkdir()
    (used / "node").write_text("print('up', flush=True); input()")
    with subprocess.Popen([sys.executable, str(used / "node")], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE) as node:
        node.stdout.readline()
        for folder in (used, unused):
            call("environment.sh", "remove_unless_used " + str(folder), tmp_path)
        assert used.exists() and not unused.exists()
        node.communicate(b"\n")
    call("environment.sh", "remove_unless_used " + str(used), tmp_path)
    assert not used.exists()
