"""Checks configuration, mission and texts of a run, for the list that is read before it."""
import os
import re
import time
from typing import Iterator

from behavior_controller.config.settings import defaults
from behavior_controller.missions.load import Mission
from behavior_controller.robot.declarations import Service
from behavior_controller.robot.requests import QueryKnowledge
from behavior_controller.run.events import DOUBTFUL, READY, Checked

_DRAFT = re.compile(r"^#.*\bdraft\b", re.IGNORECASE | re.MULTILINE)
"""The comment in a file whose texts nobody has reviewed; packages add their own files."""

_LEVELS = {False: READY, True: DOUBTFUL}
"""How a thing is, by whether a person should look at it."""


def checks(plan: Mission, configuration: str) -> Iterator[Checked]:
    """Yield what is so with a plan that was read from these files."""
    chosen = plan.settings
    yield Checked("configuration", configuration, READY, _changed(configuration))
    warnings = [warning for warning in plan.warnings if warning.file == plan.file]
    text = f"{len(plan.tree.nodes)} nodes, {_changed(plan.file)}"
    if warnings:
        text += f"; {len(warnings)} warnings: see the terminal, or validateMission"
    yield Checked("mission", plan.file, _LEVELS[bool(warnings)], text)
    yield Checked("robot", chosen.robot_interface, READY, "the interface that is set")
    yield Checked("language", plan.language, READY, "what the robot says")
    source = plan.phrases.source
    text, is_draft = _changed(source.file), _DRAFT.search(source.text) is not None
    if is_draft:
        text = "a draft: have a native speaker review it"
    yield Checked("phrases", source.file, _LEVELS[is_draft], text)
    yield from _exhibits(plan)
    heard = "speech" if chosen.asr_enabled else "the tablet"
    yield Checked("answers", heard, READY, "how visitors answer")


def _exhibits(plan: Mission) -> Iterator[Checked]:
    """Yield which texts of the exhibits may be in another language than the robot speaks."""
    known, language = plan.knowledge, plan.language
    if known is not None:
        silent = [place.name for place in known.tour
                  if not (place.description1 and place.description2)]
        text = f"all texts are in {language}"
        if silent:
            text = f"texts in {language} are missing for {', '.join(dict.fromkeys(silent))}"
        yield Checked("exhibits", "texts", _LEVELS[bool(silent)], text)
    elif any(offer.request is QueryKnowledge for offer in plan.offers
             if isinstance(offer, Service)):
        text, is_usual = "the knowledge base has the texts", language == defaults().language
        if not is_usual:
            text += f": hear whether they are in {language}"
        yield Checked("exhibits", "texts", _LEVELS[not is_usual], text)


def _changed(path: str) -> str:
    try:
        changed = time.localtime(os.stat(path).st_mtime)
    except OSError:
        return "its file is gone"
    return time.strftime("changed on %Y-%m-%d at %H:%M", changed)
