"""What a user has in a workspace stays as it is when our packages are added and removed."""
import os
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
MANIFEST = "<package>\n<name>\n  cssr_system\n</name>\n{}</package>\n"
ODD = "ä b, c*?d=e@f+g%h~i!j^k"
MORE = "l'm(n)o[p]q{r}s&t#u|v<w>x:y$z`"
"""Characters that a workspace takes, and more that the target of a link takes."""
BUILT = ("build/mine/unit_tests/test.o", "build/atomic_configure/report", "build/log/mine/log",
         "devel/bin/report", "devel/lib/mine/cssr_system", "devel/lib/cssr_system/speaker",
         "devel/lib/pkgconfig/cssr_system.pc", "devel/share/mine/behavior_controller/data",
         "devel/lib/python3/dist-packages/py_trees/__init__.py",
         "devel/lib/python3/dist-packages/behavior_controller/__init__.py",
         "devel/etc/catkin/profile.d/50.virtual_environment.sh", "install/bin/validateMission",
         "install/share/mine/unit_tests/data", "install/lib/mine/runTest")


@pytest.fixture(name="repository", params=["repository", ODD + MORE])
def small_repository(request, tmp_path):
    """A repository of few files, with the tools; it is no clone of git's."""
    return make_repository(tmp_path / request.param)


def make_repository(place):
    shutil.copytree(os.path.join(ROOT, "tools"), str(place / "tools"),
                    ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("CMakeLists.txt", "package.xml", "unit_tests/package.xml",
                 "unit_tests/nodes/report", "src/behavior_controller/validateMission"):
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(os.path.join(ROOT, name), str(place / name))
    return place


def make_workspace(place):
    """Return a workspace with a package of the user's, whose Python has all that we need."""
    write(place / "src/mine/package.xml", "<package><name>mine</name></package>")
    write(place / "build/CMakeCache.txt", "PYTHON_EXECUTABLE:FILEPATH=" + sys.executable + "\n")
    return place


def write(path, text="mine"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def call(repository, *words):
    """Return the exit code of the command, and what it prints."""
    done = subprocess.run([str(repository / "tools/add_to_workspace.sh")] + list(map(str, words)),
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=60)
    return done.returncode, done.stdout.decode(errors="replace")


def tree(folder):
    """Return all that is below a folder: links with their targets, files with their content."""
    found = {}
    for place, folders, files in os.walk(str(folder)):
        for name in folders + files:
            path = os.path.join(place, name)
            if os.path.islink(path):
                found[path] = os.readlink(path)
            else:
                found[path] = os.path.isdir(path) or open(path, "rb").read()
    return found


def added(repository, workspace):
    """Return the links that were added, and all else of src."""
    links = {path: target for path, target in tree(workspace / "src").items()
             if isinstance(target, str)}
    expected = {str(workspace / "src/cssr_system" / name): str(repository / name)
                for name in ("tools", "CMakeLists.txt", "src")}
    expected[str(workspace / "src/unit_tests")] = str(repository / "unit_tests")
    assert links == expected
    assert (workspace / "src/cssr_system/package.xml").read_text() == (
        repository / "package.xml").read_text()


def test_adding_twice_and_removing_leave_what_was_there(repository, tmp_path):
    workspace = make_workspace(tmp_path / ("a " + ODD))
    for name in BUILT:
        write(workspace / name)
    (workspace / "install/share/mine/empty").mkdir()
    before = tree(workspace)
    assert call(repository, "--remove", workspace)[0] == 0 and tree(workspace) == before
    for _ in range(2):
        code, told = call(repository, workspace)
        assert code == 0, told
        added(repository, workspace)
        write(workspace / "src/cssr_system/__pycache__/conftest.cpython-311.pyc")  # a test ran
    code, told = call(repository, "--remove", workspace)
    assert code == 0 and told.count("\n") == 1, told
    assert tree(workspace) == before


def test_what_a_killed_call_left_goes_with_the_rest(tmp_path):
    repository = make_repository(tmp_path / "repository")
    workspace = make_workspace(tmp_path / "my ws")
    before = tree(workspace)
    assert call(repository, workspace)[0] == 0
    write(workspace / "build/log/cssr_system/environment.aB3x9Z/bin/python")
    assert call(repository, "--remove", workspace)[0] == 0 and tree(workspace) == before


def test_a_new_workspace_is_made(repository, tmp_path):
    workspace = tmp_path / "new" / "my ws"
    write(workspace / "build/CMakeCache.txt", "PYTHON_EXECUTABLE:FILEPATH=" + sys.executable)
    assert call(repository, workspace)[0] == 0
    added(repository, workspace)


def test_a_workspace_that_an_earlier_version_made_is_known_by_its_links(repository, tmp_path):
    workspace = make_workspace(tmp_path / "ws")
    before = tree(workspace)
    package = workspace / "src/cssr_system"
    package.mkdir()
    for name in ("CMakeLists.txt", "src", "renamed_since"):
        (package / name).symlink_to(repository / name)
    write(package / "package.xml", "of an earlier version")
    write(package / "python_packages/py_trees/__init__.py")
    write(package / "python_packages/py_trees-2.2.dist-info/RECORD",
          "py_trees/__init__.py,sha256=x,4\npy_trees-2.2.dist-info/RECORD,,\n")
    write(package / "python_packages/py_trees/__pycache__/__init__.cpython-38.pyc")
    write(workspace / "devel/lib/python3/dist-packages/py_trees/__init__.py")
    (workspace / "src/unit_tests").symlink_to(repository / "unit_tests")
    made = tree(workspace)
    assert call(repository, workspace)[0] == 0
    added(repository, workspace)
    assert call(repository, "--remove", workspace)[0] == 0
    left = tree(workspace)
    assert set(left) - set(before) == {path for path in made if "/devel" in path}  # a copy of none
    shutil.rmtree(str(workspace / "devel"))
    assert tree(workspace) == before


def lay_links(repository, workspace):
    code, told = call(repository, workspace)
    assert code == 0, told
    return workspace / "src/cssr_system"


def foreign_link(_, workspace, name):
    write(workspace.parent / "another" / "package.xml", "<package/>")
    (workspace / "src" / name).symlink_to(workspace.parent / "another")


FOREIGN = {
    "a folder without a manifest": lambda _, ws: write(ws / "src/cssr_system/README.md"),
    "a hidden folder": lambda _, ws: write(ws / "src/cssr_system/.git/config"),
    "a package": lambda _, ws: write(ws / "src/cssr_system/package.xml", MANIFEST.format("")),
    "a metapackage": lambda _, ws: write(ws / "src/cssr_system/package.xml", MANIFEST.format(
        "<export><metapackage/></export>")),
    "a file": lambda _, ws: write(ws / "src/cssr_system"),
    "a link to another checkout": lambda r, ws: foreign_link(r, ws, "cssr_system"),
    "a link to this repository": lambda r, ws: (ws / "src/cssr_system").symlink_to(r),
    "links of another checkout": lambda r, ws: lay_links(make_repository(r.parent / "other"), ws),
    "a file beside our links": lambda r, ws: write(lay_links(r, ws) / "calibration.yaml"),
    "a link beside our links": lambda r, ws: (lay_links(r, ws) / "mine").symlink_to(r / "src"),
    "Python packages of the user's": lambda r, ws: write(
        lay_links(r, ws) / "python_packages/mine.py"),
    "tests in a folder": lambda _, ws: write(ws / "src/unit_tests/test_mine.py"),
    "tests in an empty folder": lambda _, ws: (ws / "src/unit_tests").mkdir(),
    "tests in a file": lambda _, ws: write(ws / "src/unit_tests"),
    "a link to other tests": lambda r, ws: foreign_link(r, ws, "unit_tests"),
    "a link to nothing": lambda _, ws: (ws / "src/unit_tests").symlink_to("nothing"),
    "a package of our name": lambda _, ws: write(ws / "src/robot/nodes/deep/package.xml",
                                                 MANIFEST.format(""))}


@pytest.mark.parametrize("what", FOREIGN)
def test_what_is_the_users_is_refused_before_anything_changes(tmp_path, what):
    repository = make_repository(tmp_path / "repository")
    workspace = make_workspace(tmp_path / "my ws")
    FOREIGN[what](repository, workspace)
    before = tree(tmp_path)
    for words in ((), ("--remove", )):
        code, told = call(repository, *words, workspace)
        assert code == 1 and told.count("\n") == 1 and "my ws/src/" in told, words
        assert tree(tmp_path) == before, words


def test_a_clone_inside_the_workspace_keeps_the_users_python_packages(tmp_path):
    workspace = make_workspace(tmp_path / "ws")
    repository = make_repository(workspace / "src/nodes/interpreter")
    write(repository / "python_packages/mine.py")
    before = tree(workspace)
    for words in ((), ("--remove", )):
        code, told = call(repository, *words, workspace)
        assert code == 1 and told.count("\n") == 1 and tree(workspace) == before
    shutil.rmtree(str(repository / "python_packages"))
    before = tree(workspace)
    assert call(repository, workspace)[0] == 0
    assert set(tree(workspace)) - set(before) > {str(workspace / "src/unit_tests")}
    assert call(repository, "--remove", workspace)[0] == 0 and tree(workspace) == before


@pytest.mark.parametrize("whose, name", [
    *(("workspace", name) for name in "'`$&:#|<([{\";\\\n"),
    *(("repository", name) for name in '";\\\n')])
def test_a_path_that_catkin_cannot_use_is_one_line(tmp_path, name, whose):
    repository = make_repository(tmp_path / ("r{}r".format(name * (whose == "repository"))))
    workspace = make_workspace(tmp_path / ("w{}w".format(name * (whose == "workspace"))))
    before = tree(tmp_path)
    code, told = call(repository, workspace)
    assert code == 1 and told.count("\n") == 1 and "catkin_make" in told
    assert tree(tmp_path) == before


def test_a_workspace_in_the_repository_is_one_line(repository):
    before = tree(repository)
    for workspace in (repository, repository / "ws"):
        code, told = call(repository, workspace)
        assert code == 1 and told.count("\n") == 1 and tree(repository) == before
