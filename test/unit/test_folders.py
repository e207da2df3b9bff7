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


def test_a_mission_may_have_a_file_of_its_own(tmp_path):
    shared, own = str(tmp_path / "phrases.ini"), tmp_path / "reception_phrases.ini"
    assert folders.of_mission(shared, "reception") == shared
    own.write_text("")
    assert folders.of_mission(shared, "reception") == str(own)
    assert folders.of_mission(shared, "tour") == folders.of_mission(shared, "") == shared


def test_the_name_of_a_mission_is_that_of_its_file():
    assert folders.mission_name("/data/lab_tour.xml") == folders.mission_name("lab_tour")
    assert folders.mission_name("/data/lab_tour.xml") == "lab_tour"


@pytest.mark.parametrize("variables, records", [
    ({}, "/house/.ros/log"), ({"ROS_HOME": ""}, "/house/.ros/log"),
    ({"ROS_HOME": "/ros"}, "/ros/log"), ({"ROS_HOME": "/ros", "ROS_LOG_DIR": "/logs"}, "/logs")])
def test_records_are_among_the_logs_of_ros(monkeypatch, variables, records):
    for name in ("ROS_HOME", "ROS_LOG_DIR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in dict(variables, HOME="/house").items():
        monkeypatch.setenv(name, value)
    assert folders.records() == records + "/behaviorController_records"
