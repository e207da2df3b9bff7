"""Write what is derived from declarations: ``make derived`` writes each file that is not up to date, and names it.

These are tables of the documents, the keys of both configurations, the arguments and nodes of the launch files, the
executables of the simulated nodes, and docs/faults.md. A derived part of a file is below a line with ``derived: NAME`` and
ends before ``derived: end``. A value that a configuration file gives stays as it is.
"""
import os
import re
import sys
import textwrap
from typing import Callable, Dict, Iterable, List, Sequence, Tuple

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path[:0] = [os.path.join(ROOT, "src"), os.path.join(ROOT, "unit_tests", "src")]

from behavior_controller import faults_page, leaves, settings  # noqa: E402
from behavior_controller.bt.registry import Direction, NodeSpec, Port  # noqa: E402
from behavior_controller.interface import Interface  # noqa: E402
from behavior_controller.interface.robots import DEFAULT, INTERFACES  # noqa: E402
from behavior_controller.keys import REQUIRED, Key, to_text  # noqa: E402
from behavior_controller.leaves import data  # noqa: E402
from behavior_controller.mission_spec import MissionSpec, whole_mission  # noqa: E402

from unit_tests import arguments, configuration, findings  # noqa: E402
from unit_tests.robot import NODES  # noqa: E402

Part = Callable[[str], str]
"""Returns a derived part; it is given the part as it is now."""

EXECUTABLES = {os.path.join("unit_tests", "nodes", node): """#!/usr/bin/env python3
\"\"\"The simulated {0} node.\"\"\"
from unit_tests.nodes import main

main("{0}")
""".format(node) for node in NODES}


# ---------------------------------------------------------------------------------------------------------- the documents


def keys_table(heading: str, keys: Iterable[Key]) -> str:
    """Return a table of the keys of a configuration."""
    return _table([(heading, "default", "meaning")] + [
        ("`{}`".format(key.name), key.default_text, key.meaning) for key in keys])


def offers() -> str:
    """Return a table of the services that are called, and one of the topics that are read."""
    rows = [("`{}`".format(offer.name), "`{}`".format(offer.type.replace("cssr_system/", "")), offer.absence)
            for offer in DEFAULT.offers]
    services = len(DEFAULT.services)
    return "\n\n".join((_table([("service called", "type", "without it")] + rows[:services]),
                        _table([("topic read", "type", "without it")] + rows[services:])))


def nodes() -> str:
    """Return a table of what each node does, calls, listens to, reads and writes."""
    return _table([("node", "does", "service or topic", "blackboard")] + [
        (spec.id, spec.summary, _resources(spec), _uses(spec.ports)) for spec in leaves.beyond_builtins()])


def entries() -> str:
    """Return a table of the entries that the nodes share."""
    return _table([("entry", "type", "meaning")] + [
        ("`{}`".format(datum.name), datum.type, datum.meaning) for datum in data.ALL])


def found_by_rehearsal() -> str:
    """Return a table of what a rehearsal can find."""
    return _table([("finding", "meaning")] + [
        ("`{}`".format(kind.name), kind.means) for kind in findings.BY_NAME.values()])


def _table(rows: Sequence[Tuple[str, ...]]) -> str:
    lines = ["| {} |".format(" | ".join(row)) for row in rows]
    return "\n".join(lines[:1] + ["|" + "---|" * len(rows[0])] + lines[1:])


def _resources(spec: NodeSpec) -> str:
    if spec.is_recovery:
        return "that of the failed node"
    names = [_robot(request).resource(request) for request in spec.calls] + [
        topic.name for topic in DEFAULT.used((), spec.listens)] if isinstance(spec, MissionSpec) else []
    return ", ".join(names) or "–"


def _robot(request: type) -> Interface:
    """Return the first robot that has a service for a kind of request; the default, which names what it lacks, if none has."""
    return next((robot for robot in INTERFACES.values() if robot.serves(request)), DEFAULT)


def _uses(ports: Iterable[Port]) -> str:
    read = [_shown(port) for port in ports if port.direction is not Direction.OUT]
    written = [_shown(port) for port in ports if port.direction is not Direction.IN]
    return "; ".join("{} {}".format(verb, ", ".join(names))
                     for verb, names in (("reads", read), ("writes", written)) if names) or "–"


def _shown(port: Port) -> str:
    """Return a port with its default, if that is not the entry of the same name."""
    is_own = (port.default or "") in ("", whole_mission(port.name))
    return "`{}`".format(port.name) + ("" if is_own else " (`{}`)".format(port.default))


# -------------------------------------------------------------------------------------- configurations and launch files


def key_lines(keys: Iterable[Key]) -> Part:
    """Return the part of a configuration that has a line for each key that is not required."""
    def part(now: str) -> str:
        given = dict(re.findall(r"^(\w+)[ \t]*(.*?)[ \t]*(?:#.*)?$", now, re.MULTILINE))
        return "\n".join("{:<26}{:<12}# {}".format(
            key.name, given.get(key.name, to_text(key.default)), key.plain_meaning)
            for key in keys if key.default is not REQUIRED)
    return part


def launch_arguments(names: Iterable[str], defaults: Dict[str, str] = {}) -> List[str]:
    """Return a line for each argument of a launch file."""
    return ["  <arg name=\"{}\" default=\"{}\"/>".format(name, defaults.get(name, "")) for name in names]


def listed(names: Sequence[str]) -> str:
    """Return the line that has the names of all arguments which processes get."""
    text = " ".join(names)
    return textwrap.fill("<arg name=\"names\" value=\"{}\"/>".format(text), 120, initial_indent="  ", subsequent_indent=" " * 6)


def controller_launch() -> str:
    """Return the arguments of behaviorController.launch."""
    names = [key.name for key in settings.KEYS]
    return "\n".join(launch_arguments(names) + [listed(names)])


def whole_test_launch() -> str:
    """Return the arguments of behaviorControllerTest.launch."""
    names = list(dict.fromkeys(key.name for key in configuration.KEYS + settings.KEYS))
    short = {key: "$(arg {})".format(word) for word, key in arguments.SHORT.items()}
    return "\n".join(launch_arguments(arguments.SHORT) + launch_arguments(names, short) + [
        real_nodes(), listed(names + list(_real().values()))])


def real_nodes() -> str:
    """Return the arguments that leave simulated nodes out."""
    return "\n".join(launch_arguments(_real().values(), dict.fromkeys(_real().values(), "false")))


def _real() -> Dict[str, str]:
    return {node: arguments.USE_REAL + node for node in NODES}


def simulated_nodes() -> str:
    """Return the nodes of simulatedRobot.launch."""
    return "\n".join(
        "  <node unless=\"$(arg {1})\" name=\"{0}\" pkg=\"unit_tests\" type=\"{0}\"\n"
        "        args=\"$(arg arguments)\" output=\"screen\" respawn=\"true\" respawn_delay=\"1\"/>".format(node, real)
        for node, real in _real().items())


# ------------------------------------------------------------------------------------------------------------ the files


def _fixed(derive: Callable[[], str]) -> Part:
    return lambda now: derive()


PARTS: Dict[str, Dict[str, Part]] = {
    "README.md": {"keys": _fixed(lambda: keys_table("key", settings.KEYS))},
    "docs/authors_guide.md": {"findings": _fixed(found_by_rehearsal)},
    "docs/reference.md": {
        "keys": _fixed(lambda: keys_table("key", settings.KEYS)),
        "services and topics": _fixed(offers), "nodes": _fixed(nodes), "entries": _fixed(entries),
        "keys of a test": _fixed(lambda: keys_table("key", configuration.KEYS)),
    },
    "config/" + settings.FILE_NAME: {"keys": key_lines(settings.KEYS)},
    "unit_tests/config/" + configuration.FILE_NAME: {"keys": key_lines(configuration.KEYS)},
    "launch/behaviorController.launch": {"arguments": _fixed(controller_launch)},
    "unit_tests/launch/" + arguments.LAUNCH_FILE: {"arguments": _fixed(whole_test_launch)},
    "unit_tests/launch/simulatedRobot.launch": {"real nodes": _fixed(real_nodes), "nodes": _fixed(simulated_nodes)},
}


def with_parts(text: str, parts: Dict[str, Part]) -> str:
    """Return a text with its derived parts. Raises ValueError, which names a part that is not marked in it."""
    for name, part in parts.items():
        found = re.search(r"derived: {}(?: -->)?\n(.*?\n)[^\n]*derived: end".format(name), text, re.DOTALL)
        if found is None:
            raise ValueError("there is no part between the lines derived: {} and derived: end".format(name))
        text = text[:found.start(1)] + part(found.group(1)) + "\n" + text[found.end(1):]
    return text


def outdated() -> Dict[str, str]:
    """Return path -> text of each file that is not as it is derived."""
    wanted = {path: with_parts(_read(path), parts) for path, parts in PARTS.items()}
    wanted.update(EXECUTABLES)
    wanted[os.path.join("docs", "faults.md")] = faults_page.page()
    return {path: text for path, text in wanted.items() if _read(path) != text
            or path in EXECUTABLES and not os.access(os.path.join(ROOT, path), os.X_OK)}


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
        if path in EXECUTABLES:
            os.chmod(os.path.join(ROOT, path), 0o755)
        print("written: {}".format(path))


if __name__ == "__main__":
    main()
