"""The newest lines of a run, as a reader gets them who comes late."""
import json

import pytest

from behavior_controller.run.history import Run
from behavior_controller.run.record.codec import Decoder
from behavior_controller.run.record.reader import read_record
from behavior_controller.run.state import State
from behavior_controller.viewer import backlog
from mission_rig import recorded, visitor_who


def read(texts):
    decoder = Decoder("the test")
    return Run(line for text in texts for line in decoder.read(text))


@pytest.mark.parametrize("kept", [300, 100_000])
def test_who_comes_late_gets_the_newest_lines_and_what_was_so_before(tmp_path, monkeypatch, kept):
    monkeypatch.setattr(backlog, "KEPT_LINES", kept)
    lines = read_record(recorded(tmp_path, visitor_who(says="yes")))
    shown, run = backlog.Backlog(), Run()
    for number, line in enumerate(lines, 1):
        shown.take(run.state, line)
        run.take(line)
        if number % 50 and number < len(lines):
            continue
        is_first, texts = shown.since(0)
        late = read(texts).state
        assert is_first and shown.count == number and late.lost == 0
        assert sum(b'"event"' in text for text in texts) <= 2 * kept + 1100
        for field in ("tree", "started", "letters", "entries", "finished", "visit_count", "steps"):
            assert getattr(late, field) == getattr(run.state, field), field


def test_who_has_read_so_far_gets_what_is_new_or_begins_anew(monkeypatch, tmp_path):
    monkeypatch.setattr(backlog, "KEPT_LINES", 10)
    lines = read_record(recorded(tmp_path, visitor_who(says="yes")))
    shown = backlog.Backlog()
    assert shown.since(0) == (False, [])
    for line in lines[:35]:
        shown.take(State(), line)
    assert shown.since(35) == (False, [])
    is_first, texts = shown.since(30)
    assert not is_first and [json.loads(text)["time"] for text in texts] == [
        line.time for line in lines[30:35]]
    assert len(shown.since(20)[1]) == 15 and shown.since(20)[0] is False
    is_first, texts = shown.since(19)  # it is not kept any more
    assert is_first and json.loads(texts[0])["format"] and read(texts).state.tree.nodes
