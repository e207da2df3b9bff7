"""The reference of mission nodes and their data as the README has it: ``python3 -m behavior_controller.leaves.reference``."""
from typing import Iterable, Sequence, Tuple

from behavior_controller.bt.registry import Direction, Port
from behavior_controller.interface.robots import DEFAULT
from behavior_controller.leaves import SPECS, data
from behavior_controller.mission_spec import MissionSpec, whole_mission


def nodes(specs: Iterable[MissionSpec]) -> str:
    """Return a table of what each node does, calls, listens to, reads and writes."""
    return _table([("node", "does", "service or topic", "blackboard")] + [
        (spec.id, spec.description, _offers(spec), _uses(spec.ports)) for spec in specs])


def entries() -> str:
    """Return a table of the entries that the nodes share."""
    return _table([("entry", "type", "meaning")] + [
        ("`{}`".format(datum.name), datum.type, datum.meaning) for datum in data.ALL])


def _table(rows: Sequence[Tuple[str, ...]]) -> str:
    lines = ["| {} |".format(" | ".join(row)) for row in rows]
    return "\n".join(lines[:1] + ["|" + "---|" * len(rows[0])] + lines[1:])


def _offers(spec: MissionSpec) -> str:
    if spec.is_recovery:
        return "that of the failed node"
    return ", ".join([DEFAULT.service(request).name for request in spec.calls]
                     + [DEFAULT.evidence(sense).topic.name for sense in spec.listens]) or "–"


def _uses(ports: Iterable[Port]) -> str:
    read = [_shown(port) for port in ports if port.direction is not Direction.OUT]
    written = [_shown(port) for port in ports if port.direction is not Direction.IN]
    return "; ".join("{} {}".format(verb, ", ".join(names))
                     for verb, names in (("reads", read), ("writes", written)) if names) or "–"


def _shown(port: Port) -> str:
    """Return the entry of a port, and the port's name if it is another."""
    entry = (port.default or "").strip("{@}")
    return "`{}`".format(port.name) + (" (`{}`)".format(whole_mission(entry)) if entry not in ("", port.name) else "")


if __name__ == "__main__":
    print(nodes(SPECS), entries(), sep="\n\n")
