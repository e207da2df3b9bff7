"""The nodes of other packages, which have no row in the table: they do what the record says."""
import dataclasses

from behavior_controller import extensions
from behavior_controller.bt import (
    builtin_specs, Direction, Kind, NodeSpec, Registry, Result, IDLE, RUNNING, SKIPPED)
from behavior_controller.config import phrases
from behavior_controller.robot.gateway import Cause

from unit_tests.judge import reference


class Foreign(reference.ReferenceServiceAction):
    """A leaf without a row."""

    is_foreign = True

    def update(self) -> Result:
        letter, cause = self.course.of_record(self)
        for port in self.spec.ports:
            if port.direction is not Direction.IN:
                self.course.entries.copy(self, port.name)
        if letter == "R":
            return RUNNING
        if not letter:
            return SKIPPED if self.status is IDLE else self.status
        if letter == "S":
            return self.conclude(None)
        return self.conclude(cause or Cause.CONDITION_FALSE)

    def steps(self) -> reference.Steps:
        """Make its request, of which only the kind is known."""
        calls = getattr(self.spec, "calls", ())
        if calls:
            yield from reference.ask(self, calls[0], lambda _: calls[0])

    def on_halted(self) -> None:
        """It need not report that."""


_TYPES = {kind: kind for kind in reference.TYPES.values()}


def _foreign(spec: NodeSpec) -> NodeSpec:
    ports = tuple(port._replace(type=_TYPES.get(port.type, port.type)) for port in spec.ports)
    if spec.kind in (Kind.ACTION, Kind.CONDITION):
        spec = dataclasses.replace(spec, factory=Foreign)
    return dataclasses.replace(spec, ports=ports)


def registry() -> Registry:
    """Return all node types: the engine's, the reference's, and those of other packages."""
    node_types = Registry(builtin_specs() + list(reference.ROWS))
    for extension in extensions.exported("phrases"):
        for speech in extension.declared("SPEECHES", phrases.Speech):
            node_types.extend([
                reference.speech(speech.node, speech.node, speech.asks, speech.variables)])
    for extension in extensions.exported("leaves"):
        node_types.extend(map(_foreign, extension.declared("SPECS", NodeSpec)))
    return node_types
