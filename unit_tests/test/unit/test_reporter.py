"""Where the report of a test is written, and which process shows it."""
import pathlib
import re
import shutil
import time
from types import SimpleNamespace

import pytest

pytest.importorskip("rosgraph", reason="needs ROS, which this interpreter does not have")

from behavior_controller.config import settings  # noqa: E402
from behavior_controller.simulation import configuration  # noqa: E402
from behavior_controller.simulation.rehearsal.play import LoadedMission  # noqa: E402

import plays  # noqa: E402
from unit_tests import folders  # noqa: E402
from unit_tests.judge.facts import Stall  # noqa: E402
from unit_tests.robot import options  # noqa: E402
from unit_tests.robot.options import Arguments, Options  # noqa: E402
from unit_tests.run import controller, test_node  # noqa: E402


@pytest.fixture
def share(monkeypatch, tmp_path):
    """Have the newest report below ``tmp_path``."""
    (tmp_path / "share" / "data").mkdir(parents=True)
    monkeypatch.setattr(folders, "share", lambda: str(tmp_path / "share"))
    return tmp_path / "share" / "data"


def save(text, folder, kind=folders.REPORT):
    """Save the report of a run and return its path."""
    given = dict(options.of_process().values, folder=str(folder))
    return test_node.save(text, Arguments([], given), kind)


FIRST, SECOND = ("# 2026-01-0{}T12:00:00: mission m\n".format(day) for day in (1, 2))
PAGE = ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="generator" content="runTest">\n')


def test_each_run_keeps_its_report_and_the_newest_is_in_the_package(given, share, tmp_path):
    for run, text in (("first", FIRST), ("second", SECOND)):
        (tmp_path / run).mkdir()
        assert save(text, tmp_path / run) == str(share / test_node.OUTPUT)
    assert (share / test_node.OUTPUT).read_text() == (tmp_path / "second" /
                                                      test_node.OUTPUT).read_text() == SECOND
    assert (tmp_path / "first" / test_node.OUTPUT).read_text() == FIRST


def test_a_package_that_cannot_be_written_has_its_newest_report_among_those_of_ros(
        given, share, tmp_path):
    share.rmdir()
    (tmp_path / "ros").mkdir()
    assert save(FIRST, tmp_path) == str(tmp_path / "ros" / test_node.OUTPUT)


def test_a_file_of_the_users_is_no_newest_report(given, share, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("ROS_TEST_RESULTS_DIR", str(tmp_path))
    notes = [share / test_node.OUTPUT, tmp_path / "unit_tests" / test_node.JUNIT_FILE]
    for folder in (tmp_path / "ros", tmp_path / "unit_tests"):
        folder.mkdir()
    for note in notes:
        note.write_text("my notes")
    assert save(FIRST, tmp_path) == str(tmp_path / "ros" / test_node.OUTPUT)
    test_node._save_junit('<testsuite name="behaviorControllerTest" />')
    assert [note.read_text() for note in notes] == ["my notes"] * 2
    assert capsys.readouterr().out.count("\n") == 1
    notes[1].unlink()
    for tests in ("1", "2"):  # one of its own is replaced
        test_node._save_junit('<testsuite name="behaviorControllerTest" tests="{}"/>'.format(tests))
    assert 'tests="2"' in notes[1].read_text() and not capsys.readouterr().out


def test_the_newest_report_is_where_the_user_wants_it(given, share, tmp_path):
    given("outputFile:={}".format(tmp_path / "mine"))
    assert save(FIRST, tmp_path) == str(tmp_path / "mine")
    assert save(PAGE, tmp_path, folders.PAGE) == str(tmp_path / "mine.html")
    given("outputFile:={}".format(tmp_path / "mine.dat"))
    assert save(PAGE, tmp_path, folders.PAGE) == str(tmp_path / "mine.html")
    assert (tmp_path / "behaviorControllerTestOutput.html").read_text() == PAGE
    given("outputFile:={}".format(tmp_path / "no" / "folder"))
    assert save(FIRST, tmp_path) == "nowhere: {}: No such file or directory".format(
        tmp_path / "no" / "folder")


@pytest.mark.parametrize("is_by_run_test, shown", ((False, "\nthe report\n"), (True, "")))
def test_under_run_test_the_report_waits_for_the_end_of_roslaunch(tmp_path, capsys, is_by_run_test,
                                                                  shown):
    if is_by_run_test:
        (tmp_path / "run").mkdir()
        test_node.expect_verdict(str(tmp_path / "run"))
        assert test_node.read_verdict(str(tmp_path / "run")) is None
    arguments = Arguments([], {"folder": str(tmp_path / "run")})
    assert test_node.finish(1, "the report", arguments) == 1
    assert capsys.readouterr().out == shown
    assert test_node.read_verdict(str(tmp_path / "run")) == (1, "the report")


@pytest.mark.slow
@pytest.mark.parametrize("limit, is_short", [(120.0, True), (200.0, False)])
def test_the_time_that_a_test_needs_is_told_before_the_start(limit, is_short):
    """A silent visitor is asked four times, and has 10 s for an answer."""
    test = configuration.defaults(testTimeout=limit, missionRuns=3, visitorBehaviour="silent",
                                  arrivalRate=600.0, randomSeed=1)
    told = test_node.time_needed(LoadedMission(settings.defaults()), test)
    assert re.match(r"a visitor who is silent takes about 4\d\.\d s: for 3 and the start 1\d\d s "
                    f"are needed, and testTimeout is {limit:g} s", told)
    assert ("cut off; set testTimeout:=1" in told) is is_short


def test_visitors_who_never_leave_need_no_time_that_could_be_told():
    stage = SimpleNamespace(play=lambda test: SimpleNamespace(seconds=test.test_timeout))
    assert test_node.time_needed(stage, configuration.defaults(missionRuns=1)) == ""


def test_a_run_without_an_end_has_no_verdict(tmp_path):
    assert test_node.read_verdict(str(tmp_path)) is None


@pytest.mark.slow
def test_the_wait_for_the_end_measures_how_long_the_machine_stood_still(tmp_path, monkeypatch):
    def stand_still(*_):
        time.sleep(0.4)
        (tmp_path / controller.EXIT_CODE).write_text("0\n")

    monkeypatch.setattr(test_node, "show_progress", stand_still)
    monkeypatch.setattr(test_node, "PROGRESS_INTERVAL", 0.0)
    outcome = test_node.wait_for_end(Options(Arguments([], {"folder": str(tmp_path)}),
                                             configuration.defaults(testTimeout=60.0), None))
    assert outcome.exit_code == 0 and not outcome.cut_off and not outcome.has_timed_out
    assert max(stall.ends - stall.begins for stall in outcome.stalls) > 0.3


@pytest.mark.slow
@pytest.mark.parametrize("change, code, words", [
    ({}, 0, "PASSED"), ({"exit_code": 3}, 1, "FAILED"),
    ({"cut_off": "the time was over", "has_timed_out": True}, 3, "the time was over"),
    ({"stalls": (Stall(10.0, 10.2), Stall(20.0, 20.3), Stall(30.0, 30.9))}, 0,
     "this machine stood still 2 times, for up to 0.9 s"),
    ({"stalls": (Stall(10.0, 10.2),)}, 0, "PASSED")])
def test_the_report_of_a_test_is_written_shown_and_read_back(
        given, share, tmp_path, monkeypatch, capsys, change, code, words):
    of_test = plays.facts()._replace(**change)
    monkeypatch.setattr(test_node, "wait_for_end", lambda own, disturbance: of_test)
    monkeypatch.setattr(test_node.rospkg, "get_test_results_dir", lambda: str(tmp_path))
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copytree(str(pathlib.Path(__file__).parents[2] / "config"),
                    str(tmp_path / "share" / "config"))
    own = options.read(Arguments([], {"folder": str(folder), "randomSeed": "1"}))
    assert test_node._test(own) == code
    shown = capsys.readouterr().out
    assert words in shown and shown.startswith("randomSeed 1\n")
    assert ("stood still" in shown) is ("2 times" in words)
    report = (folder / test_node.OUTPUT).read_text(encoding="utf-8")
    assert words in report and (share / test_node.OUTPUT).read_text(encoding="utf-8") == report
    assert (tmp_path / "unit_tests" / test_node.JUNIT_FILE).exists()
