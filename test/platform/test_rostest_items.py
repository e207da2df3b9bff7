"""The pytest plugin that runs rostest files."""
import os
import re
import subprocess
import sys

import pytest

from rostest_items import OTHER_PYTHON, REPOSITORY

BOTH = {"planted", "planted-" + OTHER_PYTHON}


def run(folder, *options):
    """Return the exit code and the output of pytest in a folder."""
    paths = "{}:{}".format(REPOSITORY / "tools", os.environ.get("PYTHONPATH", ""))
    done = subprocess.run([sys.executable, "-m", "pytest"] + list(options), cwd=str(folder),
                          env=dict(os.environ, PYTHONPATH=paths), stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, universal_newlines=True)
    return done.returncode, done.stdout


@pytest.mark.long
@pytest.mark.skipif("ROS_PACKAGE_PATH" not in os.environ, reason="needs ROS")
def test_what_fails_twice_is_named_with_its_first_line_and_the_place_of_the_output():
    code, text = run(REPOSITORY, "test/fixtures/rostest/planted.test", "-n", "1")
    assert code == 1 and "= 1 failed, 1 rerun in " in text, text
    assert "TestPlanted.test_that_fails: 1 != 2 : planted\n" in text
    assert "TestPlanted.test_that_passes" not in text and "nowhere.py" in text
    log = re.search("^the whole output: (.*)", text, re.MULTILINE).group(1)
    for path in (log, log.replace("/output.log", "-first/output.log")):
        assert "in two lines" in (REPOSITORY / path).read_text()


@pytest.mark.parametrize("comment, markers, names", [
    ("", "not long and not timing", {"planted"}), ("it runs on every Python", "not timing", BOTH),
    ("it runs on every Python", "not long", {"planted"}),
    ("it measures time, on every Python", "timing", BOTH),
    ("it takes long", "long", {"planted"}), ("it takes long", "not long", set())])
def test_what_the_comment_says(tmp_path, comment, markers, names):
    (tmp_path / "planted.test").write_text("<launch><!-- {} --></launch>".format(comment))
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = -p rostest_items\n")
    text = run(tmp_path, "--collect-only", "-q", "-m", markers)[1]
    assert {line.split("::")[1] for line in text.splitlines() if "::" in line} == names
