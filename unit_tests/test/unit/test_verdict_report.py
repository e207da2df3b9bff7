"""Tests of the report: what it tells of each fault, each pass and the test as a whole."""
import datetime
import re
from xml.etree import ElementTree

import pytest
from msgspec.structs import replace

from behavior_controller.bt.loader.document import parse
from behavior_controller.config import settings
from behavior_controller.run.events import (
    KILLED, Asked, LeafFinished, RunFinished, RunStarted, TreeShown)
from behavior_controller.run.history import Run
from behavior_controller.robot.requests import Say
from behavior_controller.simulation.faults import KINDS
from behavior_controller.simulation.rehearsal.play import LoadedMission

from unit_tests import folders
from unit_tests.judge import report
from unit_tests.judge.failures import FailureRow, failure_rows, table
from unit_tests.judge.read_back import misprints
from unit_tests.judge.report import (
    Report, decision_lines, failure_lines, summary_lines, title, to_junit)
from unit_tests.judge.verdict import Verdict
from unit_tests.robot import options

from plays import changed, facts, of_test_with

ODD = "\x1b[2J\nPASSED: forged\t\x9b\u202e\ud800\x00"
SHOWN = "\\x1b[2J\\nPASSED: forged\\t\\x9b\\u202e\\ud800\\x00"


def heading(of_test, *real, **given):
    return title(of_test._replace(real=frozenset(real)),
                 options.load_test(dict({"randomSeed": "7"}, **given)),
                 datetime.datetime(2026, 1, 2, 3, 4, 5))


def test_the_title_names_the_mission():
    assert heading(facts()) == (
        "2026-01-02T03:04:05: mission lab_tour.xml; visitorBehaviour engages; failureRate 0.1; "
        "arrivalRate 60; randomSeed 7")


def test_the_title_tells_all_that_is_needed_to_repeat_the_run():
    mission = (("asrEnabled", False), ("language", "Kinyarwanda"), ("monitorPort", 0),
               ("mutualGazeValue", 2), ("topicMaxAge", 2.0), ("verboseMode", True))
    told = heading(facts(mission=mission), "speechEvent", arrivalRate="inf", missionRuns="2",
                   faultKinds="crash, wrong",
                   plannedFaults="robotNavigation:3,textToSpeech:1:unanswered",
                   absentActions="/textToSpeech/say_text", quickNodes="textToSpeech",
                   callTimes="none", testTimeout="8", verboseMode="true")
    assert told.endswith(
        "; arrivalRate inf; randomSeed 7; missionRuns 2; faultKinds crash,wrong; "
        "plannedFaults robotNavigation:3:refused,textToSpeech:1:unanswered; "
        "absentActions /textToSpeech/say_text; quickNodes textToSpeech; callTimes none; "
        "testTimeout 8; asrEnabled false; language Kinyarwanda; mutualGazeValue 2; "
        "use_real_speechEvent true")


def test_the_title_of_a_mission_that_did_not_start():
    assert ": mission that did not start; visitorBehaviour engages" in heading(
        facts()._replace(run=Run()))


# ----------------------------------------------------------------------------------------- failures


def rows(of_test):
    return failure_rows(Verdict(of_test))


def told(of_test):
    """Return what is told of each failure, without times and exhibits."""
    return [(row.node, row.call, row.kind, row.recovery) for row in rows(of_test)]


def test_a_fault_that_a_retry_puts_right_costs_the_time_until_then():
    row, = rows(facts(["textToSpeech:1"]))
    assert row._replace(at=0.0, lost=0.0) == FailureRow(
        0.0, 1, "", "WelcomeSpeech", "textToSpeech:1", "refused", "done by retry 1", 0.0, True)
    assert 0.2 < row.lost < 0.25  # the back-off of the policy


def test_each_fault_of_a_recovery_has_its_row():
    of_test = facts(["robotNavigation:1", "robotNavigation:2:exception", "robotNavigation:3",
                     "animateBehavior:5"])
    assert told(of_test) == [
        ("Navigate", "robotNavigation:1", "refused", "tried again"),
        ("Navigate", "robotNavigation:2", "exception", "tried again"),
        ("Navigate", "robotNavigation:3", "refused", "given up"),
        ("HandleFallBack", "animateBehavior:5", "refused", "on the way to the safe state")]
    handler = next(line.event for line in of_test.run.lines
                   if isinstance(line.event, LeafFinished) and line.event.status == "FAILURE"
                   and line.event.node == "HandleFallBack")  # it gave up first
    lines = [line.split("\t")[1:5] for line in failure_lines(Verdict(of_test))]
    assert [line for line in lines if line[2] == "/animateBehaviour/set_activation"] == [[
        "HandleFallBack", handler.path, "/animateBehaviour/set_activation", "refused"]]
    assert [line[3] for line in lines if line[0] == "Navigate"] == ["refused", "exception",
                                                                    "refused"]


def test_a_fault_in_the_safe_state_at_the_end():
    of_test = facts()
    last = max(line.call for line in of_test.journal if line.node == "overtAttention")
    of_test = facts(["overtAttention:{}".format(last)])
    assert told(of_test) == [("", "overtAttention:{}".format(last), "refused",
                              "on the way to the safe state")]


def test_a_substitute_is_told_with_the_step_that_it_stands_for():
    of_test = facts(["gestureExecution:2:exception", "overtAttention:5"])
    assert ("PerformDeicticGesture", "gestureExecution:2", "exception", "substituted") in told(
        of_test)


def test_a_failure_that_was_not_injected_has_its_service_and_cause():
    of_test = facts(mission=(("asrEnabled", False),), visitor_behaviour="silent")
    assert set(told(of_test)) == {("PressYesNoDialogue", "/tabletEvent/prompt_and_get_response",
                                   "missing-data", "none")}


def with_faults(of_test, faults):
    """Return facts whose journal has these faults of the speech's calls instead of its own."""
    return of_test._replace(journal=[
        line._replace(fault=faults.get(line.call)) if line.node == "textToSpeech" and line.call
        else line for line in of_test.journal])


BY_ITSELF = "/textToSpeech/say_text"


@pytest.mark.slow
@pytest.mark.parametrize("failing, injected, calls", [
    # two attempts of one node
    ((1, 2), {2: "refused"}, [BY_ITSELF, "textToSpeech:2"]),
    ((1, 2), {1: "refused"}, ["textToSpeech:1", BY_ITSELF]),
    # two nodes
    ((1, 3), {3: "refused"}, [BY_ITSELF, "textToSpeech:3"]),
    ((1, 3), {1: "refused"}, ["textToSpeech:1", BY_ITSELF])])
def test_a_fault_explains_the_failure_of_its_own_node_that_came_after_it(failing, injected, calls):
    of_test = with_faults(facts([f"textToSpeech:{call}" for call in failing]), injected)
    assert [row.call for row in rows(of_test)] == calls
    assert [row.is_injected for row in rows(of_test)] == [call != BY_ITSELF for call in calls]


def test_a_wrong_answer_explains_whatever_its_node_makes_of_it():
    of_test = facts(["tabletEvent:1:wrong"], mission=(("asrEnabled", False),))
    assert told(of_test) == [("PressYesNoDialogue", "tabletEvent:1", "wrong", "none")]


@pytest.mark.slow
def test_a_fault_of_a_request_that_is_not_on_record_has_its_row():
    of_test = facts(["textToSpeech:1"], mission_runs=2)
    line = next(line for line in of_test.journal if line.fault)
    second = of_test.run.visits[1].ended
    more = [line._replace(time=at, call=90 + number)
            for number, at in enumerate([line.time - 1.0, second])]
    of_test = of_test._replace(journal=sorted([*of_test.journal, *more]))
    assert told(of_test) == [("", "textToSpeech:90", "refused", "not on record"),
                             ("WelcomeSpeech", "textToSpeech:1", "refused", "done by retry 1"),
                             ("", "textToSpeech:91", "refused", "not on record")]
    assert [row.visitor for row in rows(of_test)] == [1, 1, 2]


def test_a_fault_after_the_point_of_difference_explains_a_failure_too():
    of_test = facts(["textToSpeech:4"])
    unasked = next(line.event for line in of_test.run.lines if isinstance(line.event, Asked))
    of_test = changed(of_test, lambda line: [] if line.event is unasked else [line])
    assert [row[:2] for row in told(of_test)] == [("DescribeExhibitSpeech", "textToSpeech:4")]


@pytest.mark.slow
def test_a_fault_of_what_was_halted_costs_no_time():
    speech = '<Timeout msec="500"><WelcomeSpeech/></Timeout>'
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{speech}</BehaviorTree></root>'
    row, = rows(facts(["textToSpeech:1:unanswered"],
                      on=LoadedMission(settings.defaults(), [parse(text)])))
    assert row[3:] == ("WelcomeSpeech", "textToSpeech:1", "unanswered", "halted", 0.0, True)


def test_each_row_names_the_exhibit_that_was_under_way():
    of_test = facts(["robotNavigation:1", "robotNavigation:3", "robotNavigation:8"])
    names = [exhibit.name for exhibit in of_test.world.knowledge.exhibits]
    assert [row.stop for row in rows(of_test)][:2] == names[:2]


def test_false_conditions_are_counted_and_no_rows():
    of_test = facts(visitor_behaviour="noGaze")
    shown = Report(of_test, "title")
    assert shown.rows == []
    assert re.search(r"; 0 faults, 0\.0 s lost; \d+ conditions? false for a while$",
                     shown.visitors[0])


def test_every_failure_has_a_line_of_its_own():
    lines = [line.split("\t") for line in failure_lines(Verdict(facts(["textToSpeech:1"])))]
    assert [line[1:5] for line in lines if line[4] != "condition-false"] == [[
        "WelcomeSpeech", lines[1][2], "/textToSpeech/say_text", "refused"]]
    assert [line[0] for line in lines] == sorted(line[0] for line in lines)


def test_the_summary_counts_every_node():
    of_test = facts(["textToSpeech:1"])
    counts = [line.split() for line in summary_lines(of_test)]
    assert ["WelcomeSpeech", "1", "1"] in counts and ["FollowMeSpeech", "5", "0"] in counts
    assert ["tabletEvent", "0", "0"] in counts
    assert any(line[0] == "textToSpeech" and line[2] == "1" for line in counts if line)
    assert "recoveries: 1; 1 done" in summary_lines(of_test)
    decision, = decision_lines(of_test)
    assert decision.endswith("retry 1x, then skip; 1 attempt: done")


def test_a_pass_is_told_with_what_the_faults_cost():
    shown = Report(facts(["textToSpeech:1"]), "title", ["a warning"])
    assert shown.visitors[0] == "a warning" and len(shown.visitors) == 2
    assert "5 of 5 exhibits completed; 1 fault, 0.2 s lost; " in shown.visitors[1]


def test_a_planned_fault_whose_call_was_not_made_is_named():
    shown = Report(facts(["textToSpeech:1", "robotNavigation:99:crash"]), "title").text()
    assert re.findall("(?m)^planned in vain.*", shown) == [
        "planned in vain: robotNavigation:99:crash, since that call was not made"]


@pytest.mark.slow
def test_a_budget_that_is_spent_is_the_cause():
    shown = Report(facts(failure_rate=0.5, mission_runs=2), "title")
    assert any("the budget of 30 recoveries in 600 s is spent" in line for line in shown.visitors)
    assert any("the budget of 30 recoveries" in row.recovery for row in shown.rows)


def test_a_pass_that_did_not_end_has_its_line():
    of_test = facts()
    lines = of_test.run.lines
    shown = Report(of_test._replace(run=Run(lines[:len(lines) // 2])), "title")
    assert shown.visitors[0].startswith("pass 1: did not end; 0 faults, 0.0 s lost; ")


def test_a_controller_that_did_not_start_has_its_report():
    late = "the controller did not start its mission within 60 s"
    shown = Report(facts()._replace(run=Run(), journal=[], exit_code=None, cut_off=late), "title")
    assert (shown.rows, shown.visitors) == ([], [])
    assert shown.text().splitlines()[:2] == ["# title", "FAILED: " + late]
    assert "coverage" not in shown.text() and "# recoveries" not in shown.text()


def test_the_coverage_counts_the_leaves_and_the_branches_of_nodes_with_several_children():
    of_test = facts(on=LoadedMission(settings.defaults(), [parse(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Fallback><Sequence>'
        '<WelcomeSpeech name="a"/><Inverter><Inverter><FollowMeSpeech name="b"/></Inverter>'
        '</Inverter></Sequence><EndTourSpeech name="c"/><Sleep msec="1"/></Fallback>'
        '</BehaviorTree></root>')]))
    assert summary_lines(of_test._replace(expected=frozenset("ac")))[-3:] == [
        "coverage: 2 of 3 leaves of the mission ran",
        "          1 of 2 that this visitor should bring about", "          3 of 4 branches"]
    assert summary_lines(of_test)[-1] == "coverage: 2 of 3 leaves of the mission ran"


@pytest.mark.slow
def test_the_page_marks_the_point_of_difference_in_the_story():
    def silent(line):
        is_first = isinstance(line.event, Asked) and isinstance(line.event.request, Say)
        return [] if is_first else [line]
    of_test = facts()
    assert Report(of_test, "title").page().count("Here the run differs") == 0
    of_test = changed(of_test, silent)
    shown = Report(of_test, "title")
    execution = shown.verdict.execution
    assert "WelcomeSpeech was due" in execution.difference
    assert of_test.run.lines[0].time < execution.differs_at
    page = shown.page()
    assert page.count("Here the run differs. pass 1") >= 1
    assert Report(of_test._replace(run=Run()), "title").page() == ""


@pytest.mark.slow
def test_the_page_of_a_controller_that_was_killed_says_so():
    of_test = facts()
    cut = Run(line for line in of_test.run.lines if not isinstance(line.event, RunFinished))
    killed = of_test._replace(run=cut, exit_code=-9)
    assert KILLED.outcome in Report(killed, "title").page()
    for other in (of_test, killed._replace(exit_code=None)):
        assert KILLED.outcome not in Report(other, "title").page()


# ---------------------------------------------------------------------------------------- the table


ROW = FailureRow(
    102.0, 1, "", "WelcomeSpeech", "textToSpeech:1", "refused", "done by retry 1", 2.0, True)


def test_the_table_fits_its_columns():
    assert table([ROW], 100.0, 120) == [
        "time  visitor  stop  node           call            kind     recovery          lost",
        " 2.0        1  -     WelcomeSpeech  textToSpeech:1  refused  done by retry 1  2.0 s"]
    assert table([ROW], 100.0, 80) == [
        "time  visitor  stop  node",
        "      call            kind     recovery          lost",
        " 2.0        1  -     WelcomeSpeech",
        "      textToSpeech:1  refused  done by retry 1  2.0 s"]
    wide = max(map(len, table([ROW], 100.0, 120)))
    assert [len(table([ROW], 100.0, width)) for width in (wide, wide - 1)] == [2, 4]


def test_no_word_of_the_table_is_broken():
    row = ROW._replace(call="/tabletEvent", kind="missing-data", recovery="none")
    assert "      /tabletEvent" in table([row], 100.0, len("      /tabletEvent  missing-"))


def test_a_terminal_shows_so_many_rows_and_the_verdict_last(monkeypatch):
    monkeypatch.setattr(report, "MOST_SHOWN", 2)
    monkeypatch.setattr(report, "MOST_OBJECTIONS", 2)
    of_test = facts(["textToSpeech:1", "gestureExecution:1", "animateBehavior:1"],
                    visitor_behaviour="leaves")
    silent = [line._replace(fault=None) for line in of_test.journal]
    shown = Report(of_test._replace(journal=silent), "title", ["a warning"])
    lines = shown.shown(100, ["where the files are"]).splitlines()
    assert lines[0] == "# title" and lines[2] == "a warning"
    assert lines[1] == "{} (and 2 objections: see the end)".format(
        str(shown.verdict).splitlines()[0])
    assert "and 1 more in the report" in lines
    verdict = str(shown.verdict).splitlines()
    assert lines[-5:] == ["where the files are", ""
                          ] + verdict[:2] + ["        and 1 more in the report"]
    assert shown.shown(100, page="/x.html").splitlines()[-1].endswith(" file:///x.html")
    monkeypatch.setattr(report, "MOST_SHOWN", len(shown.rows))
    monkeypatch.setattr(report, "MOST_OBJECTIONS", len(verdict))
    assert "more in the report" not in shown.shown(100)


def test_the_report_begins_and_ends_with_the_verdict():
    shown = Report(of_test_with(facts(), mission_runs=2), "title")
    lines = shown.text().splitlines()
    assert not shown.verdict.passed and lines[:2] == ["# title", lines[-1]]


FAULTY = ["textToSpeech:1", "robotNavigation:2:exception"]


@pytest.mark.slow
def test_a_report_that_is_right_has_no_misprints():
    for of_test in (facts(), facts(FAULTY), facts(failure_rate=0.3, fault_kinds=KINDS),
                    of_test_with(facts(), mission_runs=2), facts(visitor_behaviour="leaves")):
        shown = Report(of_test, "title")
        junit = to_junit(shown.verdict, 1.0, "title")
        assert list(misprints(shown.verdict, shown.text(), junit, shown.page())) == []


@pytest.mark.slow
def test_a_crash_that_its_node_notes_late_costs_no_time_and_is_read_back():
    of_test = facts(["textToSpeech:1:crash"])
    late = [line._replace(time=line.time + 0.1) if line.fault else line for line in of_test.journal]
    shown = Report(of_test._replace(journal=late), "title")
    assert [row.lost for row in failure_rows(shown.verdict)][:1] == [0.0]
    assert not any("rows for" in problem for problem in misprints(
        shown.verdict, shown.text(), "", shown.page()))


@pytest.mark.slow
def test_what_a_report_leaves_out_or_miscounts_is_found_by_reading_it_back():
    shown = Report(of_test_with(facts(FAULTY), mission_runs=2), "title")
    text, junit, page = shown.text(), to_junit(shown.verdict, 1.0, "title"), shown.page()
    row = next(line for line in text.split("\n") if "robotNavigation:2 " in line)

    def found(text=text, junit=junit, page=page):
        return " | ".join(misprints(shown.verdict, text, junit, page))
    assert found() == ""
    gone, twice = text.replace(row + "\n", ""), text.replace(row, row + "\n" + row)
    for wrong in (gone, twice, text.replace(row, row.replace("exception", "refused"))):
        assert "rows for robotNavigation:2 exception" in found(text=wrong)
    count = next(line for line in text.split("\n") if line.startswith("textToSpeech   "))
    assert "calls of textToSpeech" in found(text=text.replace(count, count[:-1] + "7"))
    assert "the page has 0 rows" in found(page=page.replace("robotNavigation:2", "-"))
    assert "does not have the verdict" in found(text=text.replace("1 pass instead of 2", "none"))
    assert "objections" in found(junit=junit.replace("1 pass instead of 2", "none"))
    assert "counts its failures" in found(junit=junit.replace('failures="1"', 'failures="0"'))


@pytest.mark.slow
def test_what_the_robot_says_forges_no_line_of_the_report():
    def forge(line):
        event = line.event
        if isinstance(event, LeafFinished) and event.failure is not None:
            event = replace(event, path=event.path + ODD,
                            failure=replace(event.failure, message=ODD, resource=ODD))
        if isinstance(event, (RunStarted, TreeShown)) and hasattr(event, "mission"):
            event = replace(event, mission=ODD)
        return [replace(line, event=event)]
    of_test = changed(facts(["textToSpeech:1"]), forge)
    of_test = of_test._replace(journal=[
        line._replace(objection=ODD) if line.call == 2 else line for line in of_test.journal])
    shown = Report(of_test, heading(of_test))
    text, junit = shown.text(), to_junit(shown.verdict, 1.0, heading(of_test))
    for each in (text, shown.shown(1000), junit):
        assert not set("\x1b\x9b\u202e\ud800\x00\r") & set(each)
        assert SHOWN in each
    assert [line for line in text.splitlines() if line.startswith("PASSED")] == []
    assert {len(line.split("\t")) for line in failure_lines(Verdict(of_test))} == {6}
    ElementTree.fromstring(junit)


@pytest.mark.parametrize("run", [facts(), facts()._replace(run=Run())])
def test_what_a_test_writes_is_known_as_its_own(tmp_path, run):
    shown = Report(run, heading(run))
    written = {folders.REPORT: shown.text(), folders.PAGE: shown.page(),
               folders.JUNIT: to_junit(shown.verdict, 1.0, heading(run))}
    for kind, text in written.items():
        path = tmp_path / "written"
        path.write_text(text)
        assert not text or kind.check(str(path)) is None
