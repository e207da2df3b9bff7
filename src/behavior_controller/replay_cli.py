"""The command ``replayMission``: runs a record again, writes its report or story, or lists runs."""
import sys
from typing import List, Optional

import msgspec

from behavior_controller import exit_codes, folders, ros_arguments
from behavior_controller.errors import BehaviorControllerError, MissionError
from behavior_controller.missions.replay import replay
from behavior_controller.viewer.report import COMMAND, story_lines, to_html
from behavior_controller.run.record.reader import (
    LATEST, find_record, folder_of, read_record, stream_record)
from behavior_controller.run.statistics import statistics
from behavior_controller.viewer.run_index import all_runs
from behavior_controller.viewer.runs_text import text_lines
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
    instead.add_argument("--mission", metavar="FILE", help="run this file, such as the edited "
                         "mission, instead of the mission in the record")
    instead.add_argument("--report", metavar="OUT.html", help="write a report of the recorded run "
                         "as a web page instead: a new file, or in place of an earlier report")
    instead.add_argument("--story", action="store_true",
                         help="print what happened instead, a line each")
    instead.add_argument("--runs", action="store_true", help="list the runs of the folder instead, "
                         "with their visits, the robot's faults and the days")
    parser.add_argument("--json", action="store_true", help="with --runs: all of it as JSON")
    chosen = ros_arguments.parse(parser, arguments)
    if chosen.json and not chosen.runs:
        parser.error("--json goes with --runs")
    try:
        if chosen.runs:
            return _list_runs(chosen.record, chosen.json)
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


def _list_runs(record: str, as_json: bool) -> int:
    """Print the runs below a folder."""
    listed = all_runs(folder_of(record))
    if not listed:
        raise MissionError.of(folder_of(record), "there is no record of a run below it",
                              f"name a folder of runs, or {LATEST}")
    if as_json:
        data = {"figures": statistics(each.digest for each in listed), "runs": listed}
        print(msgspec.json.format(msgspec.json.encode(msgspec.to_builtins(data))).decode())
    else:
        print("\n".join(text_lines(listed)))
    return exit_codes.SUCCESS
