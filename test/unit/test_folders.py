"""Where configuration and missions are found: in the source tree, through a link to it, and when
installed."""
import os
import shutil
import subprocess
import sys

import pytest

from behavior_controller import folders

SAY_SHARE = "from behavior_controller import folders; print(folders.share())"


def share_of(python_path):
    """Return what a fresh interpreter that imports the package from there, started elsewhere, takes
    for the share."""
    environment = dict(os.environ, PYTHONPATH=str(python_path), PYTHONDONTWRITEBYTECODE="1")
    return subprocess.check_output([sys.executable, "-c", SAY_SHARE], env=environment, cwd="/",
                                   text=True).strip()


def put_package(place):
    package = place / "behavior_controller"
    package.mkdir(parents=True)
    for name in ("__init__.py", "folders.py"):
        shutil.copy(os.path.join(os.path.dirname(folders.__file__), name), str(package))


def put_files(place):
    for name in ("config", "data"):
        (place / name).mkdir(parents=True)


def test_in_the_source_tree(tmp_path):
    put_package(tmp_path / "package" / "src")
    put_files(tmp_path / "package")
    (tmp_path / "package" / "src" / "data").mkdir()  # something else: there is no config beside it
    assert share_of(tmp_path / "package" / "src") == str(tmp_path / "package")


def test_through_a_link(tmp_path):
    put_package(tmp_path / "package" / "src")
    put_files(tmp_path / "package")
    (tmp_path / "workspace").symlink_to(tmp_path / "package")
    assert share_of(tmp_path / "workspace" / "src") == str(tmp_path / "package")


@pytest.mark.parametrize("packages", ["lib/python3/dist-packages", "lib/python3.8/site-packages"])
def test_when_installed(tmp_path, packages):
    put_package(tmp_path / packages)
    put_files(tmp_path / "share" / "cssr_system")
    assert share_of(tmp_path / packages) == str(tmp_path / "share" / "cssr_system")


def test_a_mission_with_and_without_its_extension():
    assert folders.mission("lab_tour") == folders.mission("lab_tour.xml") == folders.data(
        "lab_tour.xml")
    assert os.path.isfile(folders.mission("lab_tour"))
    assert os.path.isfile(folders.config("recoveryPolicy.ini"))
