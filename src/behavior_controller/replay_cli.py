"""The command ``replayMission``: runs a record again, or writes its report or story."""
import sys
from typing import List, Optional

from behavior_controller import exit_codes, folders, ros_arguments
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.missions.replay import replay
from behavior_controller.viewer.report import COMMAND, story_lines, to_html
from behavior_controller.run.record.reader import (
    LATEST, find_record, read_record, stream_record)
from behavior_controller.output_files import is_standard_output, page_of
from behavior_controller.text import clean

_REPORT = page_of(COMMAND)
"""The page that ``--report`` writes."""


def main(arguments: Optional[List[str]] = None) -> int:
    """Return the exit code of ``replayMission``: 0 the same path, 3 another path, 2 the record
    cannot be replayed."""
    parser = ros_arguments.CommandParser(
        COMMAND, "Runs a recorded mission again and says whether it takes the same path.",
        "0 if it takes the same path or the report is written, 3 if it takes another one, "
        "2 if the record cannot be replayed or the call is wrong, 1 if there is no output")
    parser.add_argument("record", help="mission.jsonl of a run, its folder, a folder of runs (the "
                                       f"newest), or {LATEST}: the newest in {folders.records()}")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument(
        "--mission", metavar="FILE",
        help="run this file, such as the edited mission, instead of the mission in the record")
    instead.add_argument("--report", metavar="OUT.html",
                         help="write a report of the recorded run as a web page instead: a new "
                              "file, or in place of an earlier report")
    instead.add_argument("--story", action="store_true",
                         help="print what happened instead, a line each")
    chosen = ros_arguments.parse(parser, arguments)
    try:
        if chosen.report is not None:
            _REPORT.check(chosen.report)
        path = find_record(chosen.record)
        if chosen.report is not None:
            _REPORT.write(chosen.report, to_html(stream_record(path)))
            if not is_standard_output(chosen.report):
                print(f"{clean(chosen.report)}: the report of {clean(path)}")
            return exit_codes.SUCCESS
        if chosen.story:
            print("\n".join(story_lines(stream_record(path))))
            return exit_codes.SUCCESS
        outcome = replay(read_record(path), chosen.mission)
    except BehaviorControllerError as error:
        print(error, file=sys.stderr)
        return exit_codes.WRONG_INPUT
    print(outcome)
    return exit_codes.FAILURE if outcome.divergence else exit_codes.SUCCESS
