"""The list of runs: what each was, what they have in common, and how one finds a visit in it."""
import fcntl
import json
import os
import shutil
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

import pytest

from behavior_controller.replay_cli import main
from behavior_controller.run.events import KILLED
from behavior_controller.run.digest import Digest, EndedVisit, Outage
from behavior_controller.run.record.files import FILE_NAME
from behavior_controller.run.state import (
    BROKEN_OFF, COMPLETE, IN_PART, NO_REACTION, VISITOR_DECLINED, VISITOR_LEFT)
from behavior_controller.run.statistics import (
    Choice, FaultCount, NodeFigures, days_of, statistics)
from behavior_controller.viewer import web_page
from behavior_controller.viewer.board import Board
from behavior_controller.viewer.run_index import INDEX, RunIndex, all_runs
from browser import MODES, axe, findings
from free_ports import free_port
from page_rig import wait_until
from recorded_tours import KINDS, recorded_day

DRIVE = "/robotNavigation/set_goal: not reachable"
GESTURE = "/gestureExecution/perform_gesture: refused"
RESULT_OF = {"engages": COMPLETE, "declines": VISITOR_DECLINED, "silent": NO_REACTION,
             "no gaze": NO_REACTION, "leaves": VISITOR_LEFT, "drive dies": BROKEN_OFF}


@pytest.fixture(name="place", scope="module")
def _place(tmp_path_factory):
    """Return a folder of three runs: one with each kind of visitor, one of two visitors, and one
    whose end was lost."""
    place = str(tmp_path_factory.mktemp("records"))
    with pytest.MonkeyPatch.context() as patch:
        recorded_day(place, patch, len(KINDS))
        recorded_day(place, patch, 2, ["drive dies", "declines"])
        cut = recorded_day(place, patch, 1, ["engages"])
    with open(cut, "rb") as file:
        lines = file.readlines()
    with open(cut, "wb") as file:  # as a kill -9 leaves it
        file.writelines(lines[:len(lines) // 2])
    return place


def listed_of(place):
    return [each.digest for each in all_runs(place)]


@pytest.mark.slow
def test_each_visit_has_the_result_of_its_visitor(place):
    visits = listed_of(place)[0].visits
    assert [visit.number for visit in visits] == list(range(1, len(KINDS) + 1))
    for kind, visit in zip(KINDS, visits):
        if kind == "robot refuses":  # whether a retry helped is drawn
            assert visit.result in (COMPLETE, IN_PART) and GESTURE in visit.faults
        else:
            assert visit.result == RESULT_OF[kind], kind
        assert (visit.decisive == DRIVE) == (kind == "drive dies")
        assert bool(visit.faults) == (kind in ("robot refuses", "drive dies"))


@pytest.mark.slow
def test_a_record_that_ends_in_a_visit_tells_of_it(place):
    killed = listed_of(place)[2]
    visit, = killed.visits
    assert killed.ending == visit.decisive == KILLED.outcome and killed.ending in visit.words
    assert visit.result == BROKEN_OFF
    assert visit.seconds == pytest.approx(killed.ended - visit.began, abs=0.06)  # from its arrival


@pytest.mark.slow
def test_a_node_that_died_is_an_outage_until_it_is_back(place):
    first, second, _ = listed_of(place)
    for digest, number in ((first, 8), (second, 1)):
        outage, = digest.outages
        visit = digest.visits[number - 1]
        assert (outage.node, outage.name) == ("/robotNavigation", "/robotNavigation/set_goal")
        assert visit.began < outage.began < visit.began + visit.seconds and outage.ended
        # in all of that time no visitor could be served
        assert any(begin <= outage.began and outage.ended <= end for begin, end in digest.unserved)


# --------------------------------------------------------------------------------------- statistics

DAY = 86400.0
NOON = time.mktime((2026, 5, 4, 12, 0, 0, 0, 0, -1))


def visit_at(at, result=COMPLETE, faults=(), decisive=""):
    return EndedVisit(1, at, 60.0, result, result, tuple(faults), decisive)


def test_the_share_of_a_day_counts_the_time_between_runs_and_what_was_not_served():
    morning = Digest("tour", {}, NOON - 7200, NOON - 3600, "ended", unserved=((NOON - 7200,
                                                                           NOON - 6300),))
    evening = Digest("tour", {}, NOON, NOON + 3600, "ended")
    day, = statistics([morning, evening]).days
    assert (day.day, day.runs) == ("2026-05-04", 2)
    assert day.served == pytest.approx((3600 - 900 + 3600) / 10800)


def test_a_run_over_midnight_belongs_to_both_days():
    night = Digest("tour", {}, NOON, NOON + DAY, "ended", (
        visit_at(NOON + 60), visit_at(NOON + DAY - 60, BROKEN_OFF)),
        unserved=((NOON + DAY / 2, NOON + DAY / 2 + 10800),))
    after, before = statistics([night]).days
    assert (after.day, after.visits, after.served) == ("2026-05-05", {BROKEN_OFF: 1},
                                                       pytest.approx(0.75))
    assert (before.day, before.visits, before.served) == ("2026-05-04", {COMPLETE: 1}, 1.0)


def test_two_robots_at_once_serve_no_more_than_all_of_the_day():
    runs = [Digest("tour", {"robot": name}, NOON, NOON + 3600, "ended") for name in "ab"]
    day, = statistics(runs).days
    assert (day.runs, day.served) == (2, 1.0)
    assert statistics(runs, Choice(robot="a")).runs == 1


def test_two_runs_of_one_robot_at_once_serve_no_more_than_all_of_the_day():
    first = Digest("tour", {}, NOON, NOON + 3600, "ended", unserved=((NOON, NOON + 900),))
    second = Digest("tour", {}, NOON + 600, NOON + 3000, "ended", unserved=((NOON + 600,
                                                                           NOON + 1200),))
    day, = statistics([first, second]).days
    assert (day.runs, day.served) == (2, pytest.approx(0.75))  # of the hour the first 15 minutes


def test_a_run_that_cannot_be_read_is_of_no_day():
    found = statistics([Digest(), Digest("tour", {}, NOON, NOON + 60, "ended")])
    assert found.runs == 1 and [day.day for day in found.days] == ["2026-05-04"]
    assert days_of([Digest()]) == []


def test_the_fault_that_ended_most_visits_comes_first():
    run = Digest("tour", {}, NOON, NOON + 3600, "ended", (
        visit_at(NOON, COMPLETE, ["a", "b"]), visit_at(NOON, COMPLETE, ["b"]),
        visit_at(NOON, BROKEN_OFF, ["c"], "c"), visit_at(NOON, BROKEN_OFF, [], "d")))
    assert statistics([run]).faults == [FaultCount("c", 1, 1), FaultCount("d", 1, 1),
                                        FaultCount("b", 2, 0), FaultCount("a", 1, 0)]


def test_times_between_failures_are_those_in_which_the_robot_was_used():
    outages = (Outage("/a", "/a/x", NOON, NOON + 10), Outage("/a", "/a/y", NOON + 20, NOON + 50),
               Outage("/b", "/b/x", NOON + 100))
    run = Digest("tour", {}, NOON, NOON + 3600, "ended", (), outages)
    idle = Digest("tour", {}, NOON + DAY, NOON + DAY + 400, "ended")
    assert statistics([run, idle]).nodes == [NodeFigures("/a", 2, 2000.0, 20.0, 30.0),
                                             NodeFigures("/b", 1, 4000.0, None, None)]


# -------------------------------------------------------------------------------------------- index


@pytest.fixture(name="copy")
def _copy(place, tmp_path):
    copied = str(tmp_path / "records")
    shutil.copytree(place, copied)
    if os.path.exists(os.path.join(copied, INDEX)):
        os.unlink(os.path.join(copied, INDEX))
    return copied


def marked(copy):
    """Put a mark into the index, by which one sees whether it is read."""
    path = os.path.join(copy, INDEX)
    text = Path(path).read_text()
    assert text.count('"mission":"lab_tour"') == 3
    Path(path).write_text(text.replace('"mission":"lab_tour"', '"mission":"of the index"'))


def missions(copy):
    return [digest.mission for digest in listed_of(copy)]


def test_a_run_with_a_line_that_cannot_be_read_is_not_called_killed(copy):
    path = os.path.join(copy, sorted(os.listdir(copy))[1], FILE_NAME)
    lines = Path(path).read_bytes().splitlines(True)
    place = next(number for number, line in enumerate(lines) if b'"GoTo"' in line)
    Path(path).write_bytes(b"".join(lines[:place] + [b"{}\n"] + lines[place:]))
    listed = all_runs(copy)[1]
    assert path in listed.trouble and listed.ending == listed.trouble
    assert KILLED.outcome not in str(listed.digest)


def test_a_run_is_read_once_and_again_when_it_has_grown(copy):
    before = listed_of(copy)
    assert listed_of(copy) == before
    marked(copy)
    assert missions(copy) == ["of the index"] * 3
    second = os.path.join(copy, sorted(os.listdir(copy))[1], FILE_NAME)
    with open(second, "ab") as file:
        file.write(b'{"a line": "that was torn')
    assert missions(copy) == ["of the index", "lab_tour", "of the index"]


@pytest.mark.slow
@pytest.mark.parametrize("text", ["", "{", '{"layout":"another","runs":[]}', '{"layout":7}', "[]"])
def test_an_index_of_another_kind_is_made_anew(copy, text):
    before = listed_of(copy)
    Path(os.path.join(copy, INDEX)).write_text(text)
    assert listed_of(copy) == before


def test_runs_that_were_removed_go_and_a_record_that_cannot_be_read_says_why(copy):
    listed_of(copy)
    first, second = sorted(os.listdir(copy))[:2]
    shutil.rmtree(os.path.join(copy, first))
    path = os.path.join(copy, second, FILE_NAME)
    with open(path, "rb") as file:
        lines = file.readlines()
    with open(path, "wb") as file:
        file.writelines(lines[:40] + [b"this is no line\n"] + lines[40:])
    runs = all_runs(copy)
    assert len(runs) == 2
    assert runs[0].trouble.startswith(path + ":41:1: ") and not runs[1].trouble


def test_a_folder_in_which_nothing_can_be_written_is_listed_all_the_same(copy, monkeypatch):
    def refuse(*arguments, **named):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("behavior_controller.output_files.tempfile.NamedTemporaryFile", refuse)
    assert len(listed_of(copy)) == 3 and not os.path.exists(os.path.join(copy, INDEX))


def test_a_run_under_way_grows_in_the_list(place, tmp_path):
    whole = os.path.join(place, sorted(os.listdir(place))[0], FILE_NAME)
    with open(whole, "rb") as file:
        lines = file.readlines()
    folder = tmp_path / "records" / "000001_20260101-000000_1"
    folder.mkdir(parents=True)
    index = RunIndex(str(tmp_path / "records"))
    with open(folder / FILE_NAME, "ab") as written:
        fcntl.flock(written, fcntl.LOCK_EX)
        numbers = []
        for part in range(4):
            size = len(lines) // 4 + 1
            written.writelines(lines[part * size:(part + 1) * size])
            written.flush()
            *_, runs = index.refresh()
            assert runs[0].goes_on
            numbers.append(len(runs[0].digest.visits))
    assert numbers == sorted(numbers) and numbers[0] < numbers[-1] == len(KINDS)
    *_, runs = index.refresh()
    assert not runs[0].goes_on and len(runs[0].digest.visits) == len(KINDS)


# -------------------------------------------------------------------------------------- the command


def test_the_command_lists_figures_and_runs(copy, capsys):
    assert main([copy, "--runs"]) == 0
    text = capsys.readouterr().out
    results = [visit.result for digest in listed_of(copy) for visit in digest.visits]
    head = text.partition("\n")[0]
    assert head.startswith("{} visits in 3 runs: ".format(len(results)))
    assert "{} broken off".format(results.count(BROKEN_OFF)) in head
    assert text.count("\n0000") == 3 and DRIVE in text
    assert main([copy, "--runs", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert sum(data["figures"]["visits"].values()) == len(results) and len(data["runs"]) == 3


def test_without_runs_the_command_says_where_it_looked(tmp_path, capsys):
    assert main([str(tmp_path), "--runs"]) == 2
    assert capsys.readouterr().err.startswith(str(tmp_path))


# ----------------------------------------------------------------------------------------- the page


@pytest.fixture(name="site")
def _site(copy):
    port = free_port()
    page = web_page.Page("127.0.0.1", port, Board(lambda: []), pytest.fail, copy)
    yield "http://127.0.0.1:{}/".format(port)
    page.close()


def fetched(address):
    with urllib.request.urlopen(address, timeout=60) as answer:
        return answer.read().decode()


def listed_on(site, **choice):
    """Return the list when all runs are read."""
    query = "runs?" + urllib.parse.urlencode(choice)
    found = []

    def is_read():
        found[:] = [json.loads(fetched(site + query))]
        return not found[0]["reading"] and found[0]["runs"]

    wait_until(is_read, 30)
    return found[0]


def test_the_list_is_filtered_by_result_and_fault(site, copy):
    everything = listed_on(site)
    visits = [visit for digest in listed_of(copy) for visit in digest.visits]
    assert len(everything["visits"]) == len(visits) and not everything["older"]
    assert everything["visits"][0]["run"] > everything["visits"][-1]["run"]
    for choice, number in [({"result": BROKEN_OFF}, 3), ({"fault": DRIVE}, 2),
                           ({"mission": "none"}, 0), ({"day": "1999-01-01"}, 0)]:
        assert len(listed_on_once(site, choice)["visits"]) == number, choice
    assert len(listed_on_once(site, {"first": len(visits) - 1})["visits"]) == 1


def listed_on_once(site, choice):
    return json.loads(fetched(site + "runs?" + urllib.parse.urlencode(choice)))


@pytest.mark.slow
def test_a_report_and_a_comparison_are_made_of_the_runs_in_the_list_alone(site, copy):
    runs = sorted(os.listdir(copy))
    os.rename(os.path.join(copy, runs[0]), os.path.join(copy, runs[0] + "_hall.robot1"))
    runs[0] += "_hall.robot1"  # of a robot in a namespace
    listed_on(site)
    report = fetched(site + "report/" + runs[0])
    assert report.startswith("<!DOCTYPE html>") and 'id="v8"' in report
    compared = json.loads(fetched("{0}compared/{1}/1/{1}/8".format(site, runs[0])))
    first = compared["first"]
    one, other = compared["one"], compared["other"]
    assert [(row["path"], row["letter"]) for row in one[:first]] == [
        (row["path"], row["letter"]) for row in other[:first]]
    assert (one[first]["letter"], other[first]["letter"]) == ("S", "F")
    assert one[first]["path"] == other[first]["path"] and "Navigate" in one[first]["name"]
    for wrong in ("report/none", "report/..%2f" + runs[0], "compared/none/1/none/2"):
        with pytest.raises(urllib.error.HTTPError) as error:
            fetched(site + wrong)
        assert error.value.code == 404, wrong


@pytest.fixture(name="listed")
def _listed(browser, site):
    """Return the browser with the list, when all runs are read."""
    listed_on(site)
    browser.get(site + "runs.html")
    wait_until(lambda: browser.find_elements("css selector", "#list time"), 20)
    return browser


def texts(browser, selector):
    return browser.execute_script(  # at once: the page makes the elements anew
        "return [...document.querySelectorAll(arguments[0])].map(one => one.innerText)", selector)


@pytest.mark.slow
def test_a_technician_finds_the_visits_that_failed_and_the_commonest_cause(listed, copy):
    digests = listed_of(copy)
    failed = [visit.words for digest in reversed(digests) for visit in reversed(digest.visits)
              if visit.result == BROKEN_OFF]
    assert texts(listed, "#figures") == ["11 visits in 3 runs"]
    # without a click: the fault that most visits met, and how many it ended
    assert texts(listed, "#faults tbody tr:first-child td") == [DRIVE, "2", "2"]
    chip = next(each for each in listed.find_elements("css selector", "#results button")
                if each.text.endswith(BROKEN_OFF))
    assert chip.text == "{} {}".format(len(failed), BROKEN_OFF)
    chip.click()
    wait_until(lambda: texts(listed, "#list a") == failed)
    link = listed.find_elements("css selector", "#list a")[-1]
    run = sorted(os.listdir(copy))[0]
    assert link.get_attribute("href").endswith("report/{}#v8".format(run))
    link.click()  # the second click: the visit in time travel, at its end
    wait_until(lambda: listed.find_elements("css selector", "#v8[open]"), 20)
    visit = next(visit for visit in digests[0].visits if visit.number == 8)
    at = float(listed.execute_script("return document.getElementById('scrub').value"))
    assert at == pytest.approx(visit.began + visit.seconds, abs=1.0)


@pytest.mark.slow
def test_two_visits_are_compared_at_the_node_where_they_part(listed):
    boxes = listed.find_elements("css selector", "#list input")
    numbers = [label.split(" ")[-1] for label in (box.get_attribute("aria-label") for box in boxes)]
    assert not listed.find_element("id", "compare").is_enabled()
    for place in (len(boxes) - 1, len(boxes) - 8):  # visitors 1 and 8 of the first run
        boxes[place].click()
    assert (numbers[-1], numbers[-8]) == ("1", "8")
    listed.find_element("id", "compare").click()
    wait_until(lambda: len(texts(listed, "#columns .parts")) == 2)
    done, failed = texts(listed, "#columns .parts")
    assert done.startswith("✔ Navigate") and failed.startswith("✘ Navigate")
    assert "not reachable" in failed


@pytest.mark.slow
def test_the_list_fits_every_screen_and_axe_finds_nothing(listed, screen):
    for width in (320, 400, 800, 1280):
        for mode in MODES:
            screen(width, 800, mode)
            # a phone widens its window for what does not fit
            is_whole = "return Math.max(document.documentElement.scrollWidth, innerWidth)"
            assert listed.execute_script(is_whole) == width
            assert findings(listed, axe()) == [], (width, mode)
