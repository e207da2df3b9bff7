"""Checks configuration, mission and texts of a run, for the list that is read before it."""
import os
import time
from typing import Iterator

from behavior_controller.missions.load import Mission
from behavior_controller.run.events import DOUBTFUL, READY, Checked

DRAFT = "draft"
"""The word in the first line of a file whose texts nobody has reviewed."""


def checks(plan: Mission, configuration: str) -> Iterator[Checked]:
    """Yield what is so with a plan that was read from these files."""
    chosen = plan.settings
    yield Checked("configuration", configuration, READY, _changed(configuration))
    warnings = [warning for warning in plan.warnings if warning.file == plan.file]
    text = f"{len(plan.tree.nodes)} nodes, {_changed(plan.file)}"
    if warnings:
        text += f"; {len(warnings)} warnings: see the terminal, or validateMission"
    yield Checked("mission", plan.file, DOUBTFUL if warnings else READY, text)
    yield Checked("robot", chosen.robot_interface, READY, "the interface that is set")
    yield Checked("language", plan.language, READY, "what the robot says")
    source = plan.phrases.source
    is_draft = DRAFT in source.text.partition("\n")[0].lower()
    yield Checked("phrases", source.file, DOUBTFUL if is_draft else READY,
                  "a draft: have a native speaker review it" if is_draft else _changed(source.file))
    heard = "speech" if chosen.asr_enabled else "the tablet"
    yield Checked("answers", heard, READY, "how visitors answer")


def _changed(path: str) -> str:
    try:
        changed = time.localtime(os.stat(path).st_mtime)
    except OSError:
        return "its file is gone"
    return time.strftime("changed on %Y-%m-%d at %H:%M", changed)
