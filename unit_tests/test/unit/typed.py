"""Events of a record that tests write by hand as objects: only the fields that matter, with the
kind as ``event``."""
import msgspec

from behavior_controller.run.events import Line
from behavior_controller.run.history import Run

HANDLER = 900
"""The number of the first HandleFallBack of a record that shows no tree."""

REST = {"RunStarted": {"mission": "-", "leaves": [], "settings": {}, "sources": {}},
        "TreeShown": {"id": "T", "nodes": []},
        "HealthChanged": {"consequence": "", "kind": "service"},
        "LeafFinished": {"uid": 1, "failure": None}, "PassStarted": {"at": 0.0},
        "Tick": {"at": 0.0, "first": True}}
SOURCES = {"documents": [], "phrases": ["", ""], "policy": ["", ""], "interface": "D5.4.3"}


def run_of(events):
    """Return the run of these events."""
    handlers = {}  # path -> number
    return Run([_line(event, events[place + 1:], handlers) for place, event in enumerate(events)])


def _line(event, later, handlers):
    fields = dict(REST.get(event["event"], {}), **event)
    if "sources" in fields:
        fields["sources"] = dict(SOURCES, **fields["sources"])
    if event["event"] == "Recovered":
        ends = [other for other in later if _is_handler(other)]
        fields["uid"] = _number(ends[0], handlers) if ends else HANDLER
    elif _is_handler(event):
        fields["uid"] = _number(event, handlers)
    return msgspec.convert({"time": event["time"], "event": dict(fields, _type=event["event"])},
                           Line)


def _is_handler(event):
    return event["event"] == "LeafFinished" and event["node"] == "HandleFallBack"


def _number(event, handlers):
    """Return the number of a HandleFallBack; without a tree, each leaf has the number 1."""
    return event["uid"] if event.get("uid", 1) != 1 else handlers.setdefault(
        event["path"], HANDLER + len(handlers))
