"""What pip installs from a source distribution: the engine, the commands, the missions. Built and
used outside of the tree."""
import importlib.metadata
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from xml.etree import ElementTree

import pytest

pytestmark = pytest.mark.slow

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PARTS = ("setup.py", "pyproject.toml", "MANIFEST.in", "package.xml", "README.md", "src", "config",
         "data", "examples")


def text_of(name):
    with open(os.path.join(ROOT, name), encoding="utf-8") as file:
        return file.read()


def requirements(text):
    """Return the requirements in a file's lines, comments and quotes left out."""
    lines = (line.split("#")[0].strip().strip(",").strip("\"'") for line in text.splitlines())
    return {re.sub(r"[\s\"']", "", line) for line in lines if line}


def test_pip_asks_for_what_the_environments_have():
    declared = requirements(
        re.search(r"^dependencies = \[(.*?)^\]", text_of("pyproject.toml"), re.M | re.S).group(1))
    assert len(declared) == 4 and declared <= requirements(
        text_of(os.path.join("tools", "requirements.txt")))


def test_pip_and_catkin_know_one_name():
    name = ElementTree.parse(os.path.join(ROOT, "package.xml")).findtext("name")
    assert 'name = "{}"'.format(name) in text_of("pyproject.toml").splitlines()


def can_build():
    """Return whether setuptools reads pyproject.toml (from 61 on) and can make a wheel (from 70.1
    on without help)."""
    if importlib.util.find_spec("setuptools") is None:
        return False
    version = tuple(map(int, importlib.metadata.version("setuptools").split(".")[:2]))
    return version >= (70, 1) or (version >= (61, 0) and
                                  importlib.util.find_spec("wheel") is not None)


@pytest.fixture(name="installed", scope="module")
def from_source_distribution(tmp_path_factory):
    """The folder that pip installed to, from a source distribution that was made of a copy of the
    tree."""
    if not can_build():
        pytest.skip("setuptools is too old to build a wheel with")
    scratch = tmp_path_factory.mktemp("pip")
    copy, target = scratch / "copy", scratch / "target"
    copy.mkdir()
    for part in PARTS:
        source = os.path.join(ROOT, part)
        if os.path.isdir(source):
            shutil.copytree(source, str(copy / part),
                            ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy(source, str(copy / part))
    run([sys.executable, "-c", "from setuptools import build_meta; build_meta.build_sdist('dist')"],
        copy)
    archive, = (copy / "dist").iterdir()
    run([sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps",
         "--no-build-isolation", "--disable-pip-version-check", "--target", str(target),
         str(archive)], scratch)
    shutil.rmtree(str(copy / "src"))
    return target


def run(command, folder, **environment):
    """Run a command in ``folder`` without ROS, and return what it prints."""
    kept = {
        key: value for key, value in os.environ.items() if not key.startswith(("ROS", "PYTHON"))}
    done = subprocess.run(command, cwd=str(folder), env=dict(kept,
                                                             **environment), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, encoding="utf-8", timeout=300)
    assert done.returncode == 0, done.stdout
    return done.stdout


def use(installed, tmp_path, *command):
    return run([sys.executable] + list(command), tmp_path, PYTHONPATH=str(installed))


def test_the_commands_are_there(installed, tmp_path):
    mission = os.path.join(str(installed), "share", "cssr_system", "data", "lab_tour.xml")
    told = use(installed, tmp_path, str(installed / "bin" / "validateMission"), mission)
    assert told.endswith("lab_tour.xml: can be run, 222 nodes, 0 warnings\n")
    version = ElementTree.parse(os.path.join(ROOT, "package.xml")).findtext("version")
    shown = use(installed, tmp_path, str(installed / "bin" / "validateMission"), "--version")
    assert shown == "validateMission {}\n".format(version)
    assert '<Action ID="Navigate">' in use(installed, tmp_path,
                                           str(installed / "bin" / "exportNodeModel"))


def test_the_installed_missions_configuration_and_pages_are_found(installed, tmp_path):
    code = ("import os; from behavior_controller import cli, viewer; from behavior_controller "
            "import folders; print(folders.share());"
            "print(len(list(cli.create_tree('lab_tour').iterate())));"
            "print(sorted(os.listdir(os.path.join(os.path.dirname(viewer.__file__), "
            "'page_files'))));"
            "from behavior_controller.simulation.rehearsal.html_report import to_html;"
            "print('Nothing was found' in to_html('', [], [], []));"
            "print(os.path.isfile(folders.config('recoveryPolicy.ini')))")
    share, nodes, pages, has_report, policy = use(installed, tmp_path, "-c", code).splitlines()
    assert os.path.realpath(share) == os.path.realpath(str(installed / "share" / "cssr_system"))
    assert (nodes, has_report, policy) == ("222", "True", "True") and "index.html" in pages


def test_the_examples_run_with_what_was_installed(installed, tmp_path):
    for name, last in (("plain_python", "SUCCESS {"), ("py_trees_tools", "SUCCESS Sleep")):
        path = os.path.join(ROOT, "examples", name)
        assert use(installed, tmp_path, path + ".py",
                   path + ".xml").splitlines()[-1].startswith(last)
