"""Tests of the report: what it tells of each fault, each pass and the test as a whole."""
import datetime
from xml.etree import ElementTree

from unit_tests import configuration, report
from unit_tests.fault_rows import Told, table
from unit_tests.junit import to_xml
from unit_tests.report import decision_lines, failure_lines, summary_lines, title, write

from test_verdict import ANIMATE, ATTEND, GO, SAY, Story, finished, without_tour


def heading(story, *real, **given):
    return title(story.facts()._replace(real=frozenset(real)), configuration.load(dict({"randomSeed": "7"}, **given)),
                 datetime.datetime(2026, 1, 2, 3, 4, 5))


def test_the_title_names_the_mission_wherever_its_start_stands_in_the_record():
    story = Story()
    story.events.insert(0, {"event": "Tree", "time": 100.0, "id": "LabTour", "nodes": []})
    assert heading(story) == ("2026-01-02T03:04:05: mission lab_tour.xml; visitorBehaviour engages; failureRate 0.1; "
                              "arrivalRate 60; randomSeed 7")


def test_the_title_tells_all_that_is_needed_to_repeat_the_run():
    story = Story()
    story.events[0]["settings"] = {"asrEnabled": False, "mutualGazeValue": 2, "language": "Kinyarwanda",
                                   "topicMaxAge": 2.0, "monitorPort": 0, "verboseMode": True}
    told = heading(story, "speechEvent", arrivalRate="inf", missionRuns="2", faultKinds="crash, wrong",
                   plannedFaults="robotNavigation:3,textToSpeech:1:unanswered", testTimeout="8")
    assert told.endswith("; arrivalRate inf; randomSeed 7; missionRuns 2; faultKinds crash,wrong; "
                         "plannedFaults robotNavigation:3:refused,textToSpeech:1:unanswered; asrEnabled false; "
                         "language Kinyarwanda; mutualGazeValue 2; use_real_speechEvent true")


def test_the_title_of_a_mission_that_did_not_start():
    story = Story()
    story.events = [{"event": "Tree", "time": 100.0}]
    assert ": mission that did not start; visitorBehaviour engages" in heading(story)


def test_every_failure_has_a_line_of_its_own():
    story = without_tour()
    for number in range(3):
        story.say("Hello", "refused")
        story.failed("WelcomeSpeech", SAY, "refused", "answer {}\n".format(number), "Tree::1/WelcomeSpeech::2")
    story.done("WelcomeSpeech", SAY)
    lines = [line.split("\t") for line in failure_lines(story.facts())]
    assert [line[1:] for line in lines] == [
        ["WelcomeSpeech", "Tree::1/WelcomeSpeech::2", SAY, "refused", "answer {}".format(number)]
        for number in range(3)]
    assert lines[0][0] < lines[1][0] < lines[2][0]


def test_failures_during_a_recovery_have_their_lines_too():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused", path="Tree::1/Navigate::2")
    story.go(1.0, "exception")
    story.retried("Navigate", GO, "exception", path="Tree::1/Navigate::2")
    story.call("animateBehavior", ANIMATE, "refused", state="disabled")
    story.recovered("Navigate", GO, 1, success=False, path="Tree::1/Navigate::2")
    lines = [line.split("\t")[1:5] for line in failure_lines(finished(story, "FAILURE").facts())]
    assert lines == [["Navigate", "Tree::1/Navigate::2", GO, "refused"],
                     ["Navigate", "Tree::1/Navigate::2", GO, "exception"],
                     ["Navigate", "Tree::1/Navigate::2", ANIMATE, "refused"]]


def test_the_summary_counts_every_node():
    story = without_tour()
    story.say("Hello", "refused")
    story.failed("WelcomeSpeech", SAY, "refused")
    story.say("Hello")
    story.recovered("WelcomeSpeech", SAY, 1)
    story.say("Follow me")
    story.done("FollowMeSpeech", SAY)
    counts = [line.split() for line in summary_lines(story.facts())]
    assert ["FollowMeSpeech", "1", "0"] in counts
    assert ["WelcomeSpeech", "1", "1"] in counts
    assert ["textToSpeech", "3", "1"] in counts
    assert ["robotNavigation", "0", "0"] in counts
    assert "recoveries: 1; 1 done" in summary_lines(story.facts())
    assert decision_lines(story.facts()) == ["  WelcomeSpeech: refused; policy: retry; 1 attempt: done"]


# ---------------------------------------------------------------------------------------------------------- fault rows


def rows(story, **others):
    """Return what is told of each failure, without its time."""
    return [(row.visitor, row.node, row.call, row.kind, row.recovery, row.lost)
            for row in Told(story.facts()._replace(**others)).rows()]


def recovered(story, *words, outcome=None, handler="HandleFallBack", **others):
    """Record a recovery, and the end of the HandleFallBack that made it."""
    story.recovered(*words, **others)
    story.events[-1]["outcome"] = outcome or story.events[-1]["outcome"]
    story.done("HandleFallBack")
    story.events[-1]["path"] = handler


def test_a_fault_that_a_retry_puts_right_costs_the_time_until_then():
    story = without_tour()
    story.say("Hello", "refused")  # each step takes a second
    story.failed("WelcomeSpeech", SAY, "refused")
    story.say("Hello")
    recovered(story, "WelcomeSpeech", SAY, 1)
    assert rows(finished(story)) == [(1, "WelcomeSpeech", "textToSpeech:1", "refused", "done by retry 1", 3.0)]
    told = write(story.facts(), "title")
    assert told.visitors == ["pass 1: SUCCESS; 1 fault, 3.0 s lost; 0 conditions false for a while"]
    assert told.began == story.events[0]["time"]
    decisions = told.text().split("# recoveries\n")[1].split("\n\n")[0]
    assert decisions == "  WelcomeSpeech: refused; policy: retry; 1 attempt: done"


def test_each_fault_of_a_recovery_has_its_row_and_no_second_is_counted_twice():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    story.go(1.0, "exception")
    story.retried("Navigate", GO, "exception")
    story.call("animateBehavior", ANIMATE, "refused", state="disabled")
    recovered(story, "Navigate", GO, 1, success=False, cause="exception")
    assert rows(finished(story, "FAILURE")) == [
        (1, "Navigate", "robotNavigation:1", "refused", "tried again", 2.0),
        (1, "Navigate", "robotNavigation:2", "exception", "given up", 3.0),
        (1, "Navigate", "animateBehavior:1", "refused", "on the way to the safe state", 0.0)]
    assert "; 3 faults, 5.0 s lost; " in write(story.facts(), "title").visitors[0]


def test_a_failure_has_the_row_of_a_fault_only_with_its_service_and_its_cause():
    story = without_tour()
    story.say("Hello", "exception")
    story.failed("WelcomeSpeech", SAY, "refused")
    story.go(1.0, "refused")
    story.failed("FollowMeSpeech", SAY, "refused")
    assert rows(finished(story)) == [
        (1, "", "textToSpeech:1", "exception", "not on record", 0.0), (1, "WelcomeSpeech", SAY, "refused", "none", 0.0),
        (1, "", "robotNavigation:1", "refused", "not on record", 0.0), (1, "FollowMeSpeech", SAY, "refused", "none", 0.0)]
    assert "; 2 faults, 0.0 s lost; " in write(story.facts(), "title").visitors[0]


def test_each_row_names_the_exhibit_that_was_under_way():
    story = without_tour()
    story.record("PassStarted", number=1, at=1.0)
    for number, (name, state) in enumerate((("", ""), ("Arm", "begun"), ("Base", "begun"), ("Base", "over"))):
        if name:
            story.record("TourAdvanced", uid=1, node="SelectExhibit", path="-", number=1 + (name == "Base"), of=2, name=name,
                         state=state)
        for _ in range(2):
            story.say("Hello", "refused")
            story.failed("WelcomeSpeech", SAY, "refused", path=str(number))
    told = Told(finished(story).facts()).rows()
    assert [row.exhibit for row in told] == ["", "", "Arm", "Arm", "Base", "Base", "", ""]
    assert table(told, 0.0, 200)[3].split()[:3] == ["{:.1f}".format(told[2].at), "1", "Arm"]


def test_a_budget_that_is_spent_is_the_cause():
    spent = "the budget of 30 recoveries in 600 s is spent"
    story = without_tour()
    story.end_pass()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    recovered(story, "Navigate", GO, 0, success=False, policy="give up: " + spent)
    facts = finished(story, "FAILURE").facts()._replace(runs=2)
    assert rows(story) == [(2, "Navigate", "robotNavigation:1", "refused", "given up: " + spent, 2.0)]
    assert write(facts, "title").visitors[1] == (
        "pass 2: FAILURE; {}; 1 fault, 2.0 s lost; 0 conditions false for a while"
        .format(spent))


def test_an_inner_and_an_outer_recovery_are_told_in_their_order():
    story = without_tour()
    story.go(1.0, "refused")
    story.failed("Navigate", GO, "refused")
    recovered(story, "Navigate", GO, 2, success=False)
    recovered(story, "Navigate", GO, 0, outcome="skipped")
    assert rows(finished(story)) == [(1, "Navigate", "robotNavigation:1", "refused", "given up, then skipped", 4.0)]


def test_what_no_recovery_dealt_with_is_told_as_such():
    story = without_tour()
    story.say("Hello", "refused")
    story.failed("WelcomeSpeech", SAY, "refused", path="a")
    story.say("Hello", "unanswered")
    story.failed("FollowMeSpeech", SAY, "-", path="b", status="IDLE")
    story.say("Hello", "refused")
    story.failed("PressYesNoDialogue", "/tabletEvent", "missing-data", "the visitor pressed nothing")
    assert rows(finished(story)) == [
        (1, "WelcomeSpeech", "textToSpeech:1", "refused", "none", 1.0),
        (1, "FollowMeSpeech", "textToSpeech:2", "unanswered", "halted", 1.0),
        (1, "", "textToSpeech:3", "refused", "not on record", 0.0),
        (1, "PressYesNoDialogue", "/tabletEvent", "missing-data", "none", 0.0)]


def test_the_failure_of_a_substitute_belongs_to_the_recovery_that_chose_it():
    story = without_tour()
    story.call("gestureExecution", "/gesture", "refused")
    story.failed("PerformDeicticGesture", "/gesture", "refused", path="t/Point")
    story.call("overtAttention", ATTEND, "refused", state="location")
    story.retried("LocationOvertAttentionMode", ATTEND, path="t/HandleFallBack")
    recovered(story, "PerformDeicticGesture", "/gesture", 0, path="t/Point", outcome="skipped", handler="t/HandleFallBack")
    assert rows(finished(story)) == [
        (1, "PerformDeicticGesture", "gestureExecution:1", "refused", "LocationOvertAttentionMode instead", 2.0),
        (1, "LocationOvertAttentionMode", "overtAttention:1", "refused", "skipped", 2.0)]


def test_a_pass_is_told_with_the_exhibits_that_were_left_out():
    story = without_tour()
    story.record("PassStarted", number=1, at=1.0)
    why = "the visitor did not look at the robot"
    for name, state in (("Arm", "begun"), ("Base", "begun"), ("Base", "omitted"), ("Desk", "begun"), ("Desk", "over")):
        story.record("TourAdvanced", uid=1, node="SelectExhibit", path="-", number=1 + "ABD".index(name[0]), of=3, name=name,
                     state=state)
        if state == "omitted":
            story.record("Recovered", uid=2, node="IsMutualGazeDiscovered", path="-", policy="skip", attempts=0, success=True,
                         outcome="skipped", reason="", failure={"cause": "condition-false", "message": why, "resource": "-"})
    told, = write(finished(story).facts(), "title").visitors
    assert told.split("; ")[1:] == ["Base left out: " + why, "0 faults, 0.0 s lost",
                                    "0 conditions false for a while"]
    assert "2 of 3 exhibits" in told.split("; ")[0]


def test_a_controller_that_did_not_start_has_its_report():
    story = without_tour()
    story.events, story.cut_off = [], "the controller did not start its mission within 60 s"
    told = write(story.facts(), "title")
    assert (told.rows, told.visitors, told.began) == ([], [], 0.0)
    assert told.text().splitlines()[:2] == ["# title", "FAILED: " + story.cut_off]
    assert "coverage" not in told.text() and "# recoveries" not in told.text()


def test_false_conditions_are_counted_and_no_rows():
    story = without_tour()
    for _ in range(3):
        story.failed("IsVisitorDiscovered", "/faceDetection/data", "condition-false", "no face")
    told = write(finished(story).facts(), "title")
    assert told.rows == []
    assert told.visitors == ["pass 1: SUCCESS; 0 faults, 0.0 s lost; 3 conditions false for a while"]


def test_a_pass_that_did_not_end_has_its_line():
    story = without_tour()
    story.end_pass()
    story.done("WelcomeSpeech", SAY)
    story.failed("IsVisitorDiscovered", "/faceDetection/data", "condition-false", "no face")
    assert write(story.facts(), "title").visitors[1:] == [
        "pass 2: did not end; 0 faults, 0.0 s lost; 1 condition false for a while"]


def test_the_table_fits_its_columns():
    story = without_tour()
    story.say("Hello", "refused")
    story.failed("WelcomeSpeech", SAY, "refused")
    recovered(story, "WelcomeSpeech", SAY, 1)
    told = Told(story.facts()).rows()
    assert table(told, 100.0, 120) == [
        "time  visitor  exhibit  node           call            kind     recovery          lost",
        " 2.0        1  -        WelcomeSpeech  textToSpeech:1  refused  done by retry 1  2.0 s"]
    assert table(told, 100.0, 80) == [
        "time  visitor  exhibit  node",
        "      call            kind     recovery          lost",
        " 2.0        1  -        WelcomeSpeech",
        "      textToSpeech:1  refused  done by retry 1  2.0 s"]
    wide = max(map(len, table(told, 100.0, 120)))
    assert [len(table(told, 100.0, width)) for width in (wide, wide - 1)] == [2, 4]


def test_no_word_of_the_table_is_broken():
    story = without_tour()
    story.failed("PressYesNoDialogue", "/tabletEvent", "missing-data")
    told = Told(story.facts()).rows()
    assert "      /tabletEvent" in table(told, 100.0, len("      /tabletEvent  missing-"))


def test_a_terminal_shows_so_many_rows_and_the_verdict_last(monkeypatch):
    monkeypatch.setattr(report, "MOST_SHOWN", 2)
    monkeypatch.setattr(report, "MOST_OBJECTIONS", 2)
    story = without_tour()
    for number in range(3):
        story.say("Hello", "refused")
        story.failed("WelcomeSpeech", SAY, "refused", path=str(number))
        story.failed("WelcomeSpeech", SAY, "refused", "nothing was injected", path=str(number))
    told = write(finished(story).facts(), "title", ["a warning"])
    shown = told.shown(100, ["where the files are"]).splitlines()
    assert shown[0] == "# title" and shown[2] == "a warning"
    assert shown[1] == "{} (and 2 objections: see the end)".format(str(told.verdict).splitlines()[0])
    assert "and 4 more in the report" in shown
    verdict = str(told.verdict).splitlines()
    assert shown[-5:] == ["where the files are", ""] + verdict[:2] + ["        and 1 more in the report"]
    assert len(verdict) == 3
    assert "textToSpeech:3" in told.text() and "textToSpeech:3" not in "\n".join(shown)
    monkeypatch.setattr(report, "MOST_SHOWN", len(told.rows))
    monkeypatch.setattr(report, "MOST_OBJECTIONS", len(verdict))
    assert "more in the report" not in told.shown(100)


# ------------------------------------------------------------------------------------------------------------ the whole


def test_the_report_ends_with_the_verdict():
    story = without_tour()
    story.failed("IsVisitorDiscovered", "/faceDetection/data", "condition-false", "no face")
    story.failed("WelcomeSpeech", SAY, "refused")
    told = write(finished(story).facts(), "title")
    lines = told.text().splitlines()
    assert not told.verdict.passed
    assert lines[:2] == ["# title", lines[-1]]
    assert [line.split("\t")[1] for line in lines if "\t" in line] == ["node", "IsVisitorDiscovered", "WelcomeSpeech"]
    assert lines[-1] == "FAILED: WelcomeSpeech failed and nothing was injected there: refused: -"


def test_what_the_robot_says_forges_no_line_of_the_report():
    odd = "\x1b[2J\nPASSED: forged\t\x9b\u202e\ud800\x00"
    story = without_tour()
    story.failed("Node" + odd, SAY + odd, "refused", odd, "Tree::1/" + odd)
    story.recovered("Node" + odd, SAY, 1, path=odd)
    story.events[0]["mission"] = odd
    story.call("textToSpeech", SAY, objection=odd, message=odd)
    facts = finished(story).facts()
    told = write(facts, heading(story))
    text, junit = told.text(), to_xml(told.verdict, 1.0, heading(story))
    for shown in (text, told.shown(1000), junit):
        assert not set("\x1b\x9b\u202e\ud800\x00\r") & set(shown)
        assert "\\x1b[2J\\nPASSED: forged\\t\\x9b\\u202e\\ud800\\x00" in shown
    assert [line for line in text.splitlines() if line.startswith("PASSED")] == []
    assert len(told.rows) == 1 and len(table(told.rows, 0.0, 1000)) == 2
    assert len(failure_lines(facts)[0].split("\t")) == 6
    ElementTree.fromstring(junit)
