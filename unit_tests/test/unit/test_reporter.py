"""Where the report of a test is written, and which process shows it."""
import pytest

pytest.importorskip("rosgraph", reason="needs ROS, which this interpreter does not have")

from unit_tests import configuration, reporter  # noqa: E402


@pytest.fixture
def share(monkeypatch, tmp_path):
    """Have the newest report below ``tmp_path``."""
    (tmp_path / "share" / "data").mkdir(parents=True)
    monkeypatch.setattr(configuration, "share", lambda: str(tmp_path / "share"))
    return tmp_path / "share" / "data"


def test_each_run_keeps_its_report_and_the_newest_is_in_the_package(given, share, tmp_path):
    for run in ("first", "second"):
        (tmp_path / run).mkdir()
        assert reporter.save(run, str(tmp_path / run)) == str(share / reporter.OUTPUT)
    assert (share / reporter.OUTPUT).read_text() == (tmp_path / "second" / reporter.OUTPUT).read_text() == "second"
    assert (tmp_path / "first" / reporter.OUTPUT).read_text() == "first"


def test_a_package_that_cannot_be_written_has_its_newest_report_among_those_of_ros(given, share, tmp_path):
    share.rmdir()
    (tmp_path / "ros").mkdir()
    assert reporter.save("text", str(tmp_path)) == str(tmp_path / "ros" / reporter.OUTPUT)


def test_the_newest_report_is_where_the_user_wants_it(given, share, tmp_path):
    given("outputFile:={}".format(tmp_path / "mine"))
    assert reporter.save("text", str(tmp_path)) == str(tmp_path / "mine")
    given("outputFile:={}".format(tmp_path / "no" / "folder"))
    assert reporter.save("text", str(tmp_path)) == "nowhere: {}: No such file or directory".format(
        tmp_path / "no" / "folder")


@pytest.mark.parametrize("command, shown", (
    (["roslaunch", "unit_tests", "behaviorControllerTest.launch"], "\nthe report\n"),
    (["roslaunch", "unit_tests", "behaviorControllerTest.launch", "folder:=/run"], "")))
def test_under_run_test_the_report_waits_for_the_end_of_roslaunch(given, tmp_path, monkeypatch, capsys, command, shown):
    given("folder:={}".format(tmp_path / "run"))
    monkeypatch.setattr(reporter.arguments, "parent_command", lambda: command)
    assert reporter.finish(1, "the report") == 1
    assert capsys.readouterr().out == shown
    assert reporter.read_verdict(str(tmp_path / "run")) == (1, "the report")


def test_a_run_without_an_end_has_no_verdict(tmp_path):
    assert reporter.read_verdict(str(tmp_path)) is None
