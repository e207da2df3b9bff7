"""Write what is derived from declarations: ``make derived`` writes each file that is not up to
date, and names it.

These are tables of the documents, the keys of both configurations, the arguments and nodes of the
launch files, all executables, and docs/faults.md. A derived part of a file
is below a line with ``derived: NAME`` and ends before ``derived: end``. A value that a
configuration file gives stays as it is.
"""
import contextlib
import importlib
import io
import os
import re
import sys
import textwrap
from typing import Callable, Dict, Iterable, List, Mapping, Sequence, Tuple
from xml.sax.saxutils import quoteattr

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [
    os.path.join(ROOT, folder) for folder in ("src", os.path.join("unit_tests", "src"), "tools")]

import fault_reference  # noqa: E402

from behavior_controller import leaves  # noqa: E402
from behavior_controller.config import recovery_policy, settings  # noqa: E402
from behavior_controller.bt.engine.registry import (  # noqa: E402
    Direction, Kind, NodeSpec, Port)
from behavior_controller.robot.declarations import Interface  # noqa: E402
from behavior_controller.robot.gateway import Cause  # noqa: E402
from behavior_controller.robot.interfaces import DEFAULT, INTERFACES  # noqa: E402
from behavior_controller.config.config_file import Key, REQUIRED, to_text  # noqa: E402
from behavior_controller.leaves import data  # noqa: E402
from behavior_controller.config.node_facts import MissionSpec, whole_mission  # noqa: E402

from behavior_controller.simulation import configuration  # noqa: E402
from behavior_controller.simulation.rehearsal import findings  # noqa: E402
from unit_tests.robot import options  # noqa: E402
from behavior_controller.simulation.behaviour import NODES  # noqa: E402

_OTHER_NAME = re.compile(r".*; another name of (\w+)")
_CAUSES = (Cause.REFUSED, Cause.NOT_REACHABLE, Cause.NO_ANSWER, Cause.CONNECTION_LOST,
           Cause.TYPE_MISMATCH)

Part = Callable[[str], str]
"""Returns a derived part; it is given the part as it is now."""

EXECUTABLE = """#!/usr/bin/env python3
\"\"\"{about}\"\"\"
import sys
from _signal import SIG_DFL, SIGINT, signal  # the module "signal" loads too slowly for this

if __name__ == "__main__":  # the processes that it starts read this file too
    signal(SIGINT, SIG_DFL)  # Ctrl-C ends it without a traceback
    try:
        from behavior_controller import command
    except (ImportError, SyntaxError) as error:  # no workspace, or another one's Python
        sys.exit("{name}: {{}}, for {{}}: build the workspace as the README says, "
                 "and source its setup.bash".format(error, sys.executable))
    command.{call}
"""

RENDER = "py-trees-render"
NODE_OPTIONS = ["--help", "--version"]

COMMANDS = {
    "src/behavior_controller/exportNodeModel": ("Print the palette of mission nodes for Groot2.",
                                                "behavior_controller.cli", "export_node_model"),
    "src/behavior_controller/missionStatus": (
        "Print the tree of the running mission.", "behavior_controller.viewer.status_tool",
        "main", True),
    "src/behavior_controller/missionViewer": (
        "Show a run on a page and in Groot2, now or later.", "behavior_controller.viewer.main"),
    "src/behavior_controller/" + RENDER: (
        "Draw a mission: py-trees-render behavior_controller.cli.create_tree.",
        "py_trees.programs.render", "main", True),
    "src/behavior_controller/replayMission": (
        "Run a recorded mission again, or write a report of it.",
        "behavior_controller.replay_cli"),
    "src/behavior_controller/tryRobot": (
        "Send the robot one request, and say what it answers.",
        "behavior_controller.ros.try_robot"),
    "src/behavior_controller/validateMission": (
        "Check robot missions without running them.", "behavior_controller.cli", "validate"),
    "src/behavior_controller/rehearseMission": (
        "Play a mission in virtual time, with each visitor and each fault.",
        "behavior_controller.simulation.rehearsal.cli", "main", True),
    "unit_tests/nodes/runTest": ("Test a mission with the simulated robot; the last line is the "
                                 "verdict.", "unit_tests.run.run_test")}
"""Path -> what the command does, and the arguments of ``command.run``."""

ROS_NODES = {"src/behavior_controller/behaviorController": (
    "The ROS node behaviorController: runs robot missions.", "behavior_controller.ros.node", "run"),
             "unit_tests/nodes/report": ("Wait for the end of the mission, write the report and "
                                         "give the verdict.", "unit_tests.run.test_node", "main"),
             "unit_tests/nodes/startController": ("The launch-prefix of the controller under test.",
                                                  "unit_tests.run.controller", "start")}
"""Path -> what the node does, and the arguments of ``command.run_node``."""


def executables() -> Dict[str, str]:
    """Return path -> text of each executable."""
    nodes = dict(ROS_NODES, **{"unit_tests/nodes/" + node: (
        f"The simulated {node} node.", "unit_tests.robot.ros_nodes", "main", node)
                               for node in NODES})
    nodes["unit_tests/nodes/" + options.CLOCK_NODE] = (
        "The node that publishes /clock.", "unit_tests.robot.ros_nodes", "main",
        options.CLOCK_NODE)
    texts = {path: _executable(path, "run", *words) for path, words in COMMANDS.items()}
    texts.update((path, _executable(path, "run_node", *words)) for path, words in nodes.items())
    return texts


def _executable(path: str, function: str, about: str, *words: object) -> str:
    name = os.path.basename(path)
    arguments = ", ".join(f"\"{word}\"" if isinstance(word, str) else "redraws=True"
                          for word in (name,) + words if (function, word) != ("run", "main"))
    return EXECUTABLE.format(about=about, name=name, call=f"{function}({arguments})")


# ------------------------------------------------------------------------------------- completion


def completion() -> str:
    """Return the cases of the words that a shell offers after rosrun, a package and a command."""
    keys = [key.name for key in settings.KEYS]
    words = {("cssr_system", "behaviorController"): NODE_OPTIONS + [f"_{key}:=" for key in keys],
             ("unit_tests", "runTest"): NODE_OPTIONS + [f"{name}:=" for name in options.NAMES]}
    for path, (_, module, *function) in COMMANDS.items():
        package = "unit_tests" if path.startswith("unit_tests") else "cssr_system"
        command = os.path.basename(path)
        if command not in ("runTest", RENDER):
            words[package, command] = _options(module, *function[:1])
    words["cssr_system", "rehearseMission"] += [f"{key}:=" for key in keys]
    node_words = NODE_OPTIONS + [f"_{key.name}:=" for key in configuration.KEYS]
    words.update((("unit_tests", node), node_words) for node in NODES)
    words["unit_tests", options.CLOCK_NODE] = NODE_OPTIONS + [f"_{options.SPEED.name}:="]
    for package in ("cssr_system", "unit_tests"):
        words[package, ""] = sorted(name for owner, name in words if owner == package)
    cases: Dict[str, List[str]] = {}  # words -> package and command
    for names in sorted(words):
        cases.setdefault(" ".join(words[names]), []).append('"{} {}"'.format(*names))
    return "\n".join(f"    {' | '.join(names)}) echo {offered} ;;"
                     for offered, names in cases.items())


def _options(module: str, function: str = "main") -> List[str]:
    """Return the options that a command's help lists."""
    help_text = io.StringIO()
    with contextlib.redirect_stdout(help_text), contextlib.suppress(SystemExit):
        getattr(importlib.import_module(module), function)(["--help"])
    return re.findall(r"^  (?:-\w, )?(--\w+)", help_text.getvalue(), re.MULTILINE)


# ------------------------------------------------------------------------------------ the documents


def keys_table(heading: str, keys: Iterable[Key]) -> str:
    """Return a table of the keys of a configuration; deadlines of one default share a row."""
    rows: Dict[Tuple[str, str], List[str]] = {}  # default and meaning -> keys
    for key in keys:
        is_deadline = key.name.endswith("Deadline")
        meaning = "seconds that a call of that node may take" if is_deadline else key.meaning
        rows.setdefault((key.default_text, meaning), []).append(f"`{key.name}`")
    return _table([(heading, "default", "meaning")] + [
        (", ".join(names), *cells) for cells, names in rows.items()])


def offers() -> str:
    """Return a table of the services that are called, and one of the topics that are read."""
    rows = [(f"`{offer.name}`", f"`{offer.type.replace('cssr_system/', '')}`")
            for offer in DEFAULT.offers]
    services = len(DEFAULT.services)
    return "\n\n".join((_table([("service called", "type")] + rows[:services]),
                        _table([("topic read", "type")] + rows[services:])))


def nodes(kind: Kind) -> str:
    """Return a list of the nodes of a kind for each service or topic: what they do, read and write.
    Another name of a node stands beside its first one."""
    lines: Dict[str, List[str]] = {}  # service or topic -> nodes
    names: Dict[str, List[str]] = {}
    specs = leaves.specs()
    for spec in specs:
        first = _OTHER_NAME.match(spec.summary)
        names.setdefault(first[1] if first else spec.id, []).append(spec.id)
    for spec in specs:
        if spec.kind is kind and spec.id in names:
            lines.setdefault(_resources(spec), []).append(
                f"* **{', '.join(names[spec.id])}**: {spec.summary}{_uses(spec.ports)}")
    return "\n\n".join("\n".join([f"{place}:", "", *lines[place]]) for place in sorted(lines))


def recovery() -> str:
    """Return a table of what the delivered policy does about the failures of each node."""
    specs = leaves.mission_specs()
    policy = recovery_policy.load(os.path.join(ROOT, "config", "recoveryPolicy.ini"), specs)
    rows: Dict[Tuple[str, ...], List[str]] = {}  # cells -> nodes
    for spec in specs:
        if spec.calls and spec.kind is Kind.ACTION or spec.is_indispensable:
            cells = tuple(_rule(policy.rule(spec, cause)) for cause in _CAUSES)
            rows.setdefault(cells, []).append(spec.id)
    return _table([("node", *(cause.value for cause in _CAUSES))] + [
        (", ".join(names), *cells) for cells, names in rows.items()])


def _rule(rule: recovery_policy.Rule) -> str:
    then = rule.substitute.id if rule.substitute else rule.then.replace("giveUp", "give up")
    return (f"{rule.retries}×, " if rule.retries else "") + then


def entries() -> str:
    """Return a table of the entries that the nodes share."""
    return _table([("entry", "type", "meaning")] + [
        (f"`{datum.name}`", datum.type, datum.meaning) for datum in data.ALL])


def rehearsal_findings() -> str:
    """Return a list of the findings of a rehearsal, with the first sentence of each meaning."""
    return "\n".join("* `{}`: {}".format(kind.name, re.split(r"(?<=\.) ", kind.means)[0])
                     for kind in findings.KIND_BY_NAME.values())


def _table(rows: Sequence[Tuple[str, ...]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines[:1] + ["|" + "---|" * len(rows[0])] + lines[1:])


def _resources(spec: NodeSpec) -> str:
    if spec.is_recovery:
        return "The service of the failed node"
    names = [_robot(request).resource(request)
             for request in spec.calls] + [topic.name for topic in DEFAULT.used((), spec.listens)
                                           ] if isinstance(spec, MissionSpec) else []
    return " or ".join(f"`{name}`" for name in names) or "No service or topic"


def _robot(request: type) -> Interface:
    """Return the first robot that has a service for a kind of request; the default, which names
    what it lacks, if none has."""
    return next((robot for robot in INTERFACES.values() if robot.serves(request)), DEFAULT)


def _uses(ports: Iterable[Port]) -> str:
    read = [_shown(port) for port in ports if port.direction is not Direction.OUT]
    written = [_shown(port) for port in ports if port.direction is not Direction.IN]
    return "".join(f" {verb} {', '.join(names)}."
                   for verb, names in (("Reads", read), ("Writes", written)) if names)


def _shown(port: Port) -> str:
    """Return a port with its default, if that is not the entry of the same name."""
    is_own = (port.default or "") in ("", whole_mission(port.name))
    return f"`{port.name}`" + ("" if is_own else f" (`{port.default}`)")


# ------------------------------------------------------------------ configurations and launch files


def key_lines(keys: Iterable[Key]) -> Part:
    """Return the part of a configuration that has a line for each key that is not required."""
    def part(now: str) -> str:
        given = dict(re.findall(r"^(\w+)[ \t]*(.*?)[ \t]*(?:#.*)?$", now, re.MULTILINE))
        return "\n".join(
            f"{key.name:<26}{given.get(key.name, to_text(key.default)):<11} # {key.plain_meaning}"
            for key in keys if key.default is not REQUIRED)
    return part


def launch_arguments(keys: Iterable[Key], defaults: Mapping[str, str] = {}) -> List[str]:
    """Return a line for each argument of a launch file, with the meaning that ``roslaunch
    --ros-args`` shows."""
    return [launch_argument(key.name, defaults.get(key.name, ""), key.plain_meaning)
            for key in keys]


def launch_argument(name: str, default: str, meaning: str) -> str:
    """Return the line of an argument. A blank is no value: roslaunch calls an argument required
    whose default is empty."""
    line = "  <arg name=\"{}\" default=\"{}\" doc={}/>"
    return line.format(name, default or " ", quoteattr(meaning))


def listed(keys: Iterable[Key], name: str = "names") -> str:
    """Return the line that has the names of arguments which processes get."""
    text = " ".join(key.name for key in keys)
    return textwrap.fill(f"<arg name=\"{name}\" value=\"{text}\"/>", 120,
                         initial_indent="  ", subsequent_indent=" " * 6)


def controller_launch() -> str:
    """Return the arguments of behaviorController.launch."""
    return "\n".join(launch_arguments(settings.KEYS) + [listed(settings.KEYS)])


def whole_test_launch() -> str:
    """Return the arguments of behaviorControllerTest.launch."""
    keys = list({key.name: key for key in settings.KEYS + configuration.KEYS}.values())
    short = [launch_argument(word, "", "short for " + key)
             for word, key in configuration.SHORT.items()]
    words = {key: f"$(arg {word})" for word, key in configuration.SHORT.items()}
    return "\n".join(short + launch_arguments(keys, words) + of_robot() + [
        listed(keys + robot_keys())])


def robot_launch() -> str:
    """Return the arguments of simulatedRobot.launch, and their names for the nodes."""
    keys = [key for key in configuration.KEYS + settings.KEYS if key.name in options.ROBOT]
    keys = list({key.name: key for key in reversed(keys)}.values())[::-1]
    return "\n".join(launch_arguments(keys) + of_robot() + [
        listed(keys + robot_keys(), "robot_names")])


def robot_keys() -> List[Key]:
    """Return the keys of the simulated robot as a whole: its speed, and which nodes are real."""
    return [key for key in options.OWN if key.name != "outputFile"]


def of_robot() -> List[str]:
    """Return their arguments."""
    return launch_arguments(robot_keys(), dict.fromkeys(options.USE_REAL.values(), "false"))


def simulated_nodes() -> str:
    """Return the nodes of simulatedRobot.launch."""
    nodes = "\n".join(
        f"    <node unless=\"$(arg {real})\" name=\"{node}\" pkg=\"unit_tests\" type=\"{node}\"\n"
        "          args=\"$(arg arguments)\" output=\"screen\" respawn=\"true\" "
        "respawn_delay=\"1\"/>"
         for node, real in options.USE_REAL.items())
    if_any = "\"$(eval namespace != '/')\""
    return "\n".join(f"  <group {place}>\n{nodes}\n  </group>" for place in (
        "unless=" + if_any, f"if={if_any} ns=\"$(arg namespace)\""))


# ---------------------------------------------------------------------------------------- the files


def _fixed(derive: Callable[[], str]) -> Part:
    return lambda now: derive()


PARTS: Dict[str, Dict[str, Part]] = {
    "env-hooks/60.cssr_system.bash": {"words": _fixed(completion)},
    "docs/reference.md": {
        "keys": _fixed(lambda: keys_table("key", settings.KEYS)),
        "services and topics": _fixed(offers), "entries": _fixed(entries),
        "actions": _fixed(lambda: nodes(Kind.ACTION)),
        "conditions": _fixed(lambda: nodes(Kind.CONDITION)), "recovery": _fixed(recovery),
        "findings": _fixed(rehearsal_findings),
        "keys of a test": _fixed(lambda: keys_table("key", configuration.KEYS))},
    "config/" + settings.FILE_NAME: {"keys": key_lines(settings.KEYS)},
    "unit_tests/config/" + options.FILE_NAME: {"keys": key_lines(configuration.KEYS)},
    "launch/behaviorController.launch": {"arguments": _fixed(controller_launch)},
    "unit_tests/launch/" + options.LAUNCH_FILE: {"arguments": _fixed(whole_test_launch)},
    "unit_tests/launch/simulatedRobot.launch": {
        "arguments": _fixed(robot_launch), "nodes": _fixed(simulated_nodes)}}


def with_parts(text: str, parts: Dict[str, Part]) -> str:
    """Return a text with its derived parts. Raises ValueError, which names a part that is not
    marked in it."""
    for name, part in parts.items():
        match = re.search(rf"derived: {name}(?: -->)?\n(.*?\n)[^\n]*derived: end", text, re.DOTALL)
        if match is None:
            raise ValueError(f"there is no part between the lines derived: {name} and derived: end")
        text = text[:match.start(1)] + part(match.group(1)) + "\n" + text[match.end(1):]
    return text


def outdated() -> Dict[str, str]:
    """Return path -> text of each file that is not as it is derived."""
    wanted = {path: with_parts(_read(path), parts) for path, parts in PARTS.items()}
    programs = executables()
    wanted.update(programs)
    wanted[os.path.join("docs", "faults.md")] = fault_reference.page()
    return {path: text for path, text in wanted.items() if _read(path) != text
            or path in programs and not os.access(os.path.join(ROOT, path), os.X_OK)}


def _read(path: str) -> str:
    if not os.path.exists(os.path.join(ROOT, path)):
        return ""
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        return file.read()


def main() -> None:
    """Write the files that are not up to date."""
    for path, text in outdated().items():
        with open(os.path.join(ROOT, path), "w", encoding="utf-8") as file:
            file.write(text)
        if path in executables():
            os.chmod(os.path.join(ROOT, path), 0o755)
        print(f"written: {path}")


if __name__ == "__main__":
    main()
