"""Controllers with one mistake each, generated from what the leaves of a mission ask, read, write
and answer.

A mistake is made in the running objects: in the leaf at one place of the tree, in a control's
children, or in a class. A sound play of the mission tells which requests each leaf makes; their
fields, the ports of the leaves and the rules of the recovery give the mistakes.
"""
import contextlib
import copy
import dataclasses
import functools
import itertools
import math
from typing import (
    Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple)
from unittest import mock

from msgspec.structs import fields, replace

from behavior_controller import leaves
from behavior_controller.bt.engine.controls import (
    Control, Fallback, ReactiveFallback, ReactiveSequence, Sequence as Sequence_)
from behavior_controller.bt.engine.tree import Tree
from behavior_controller.bt.engine.registry import Direction
from behavior_controller.bt.values.status import FAILURE, RUNNING, SUCCESS
from behavior_controller.config import phrases
from behavior_controller.config.phrases import Phrases
from behavior_controller.config.settings import Settings
from behavior_controller.config.recovery_policy import GIVE_UP, SKIP, Policy
from behavior_controller.run.events import (
    Answered, Asked, EntriesWritten, HealthChanged, LeafFinished, PassFinished, PassStarted,
    Recovered, Recovering, Retried, RunFinished, RunStarted, SafeStateReported, StepStarted,
    StopChanged, Suspended, Tick, TreeShown)
from behavior_controller.run.health import Health
from behavior_controller.run.observed_gateway import ObservedGateway
from behavior_controller.run.safe_state import SafeState
from behavior_controller.leaves import recovery as recovery_leaf
from behavior_controller.leaves import release_1_0
from behavior_controller.leaves.base import (
    InstantAction, InstantCondition, MissionContext, MissionLeaf, ServiceLeaf)
from behavior_controller.leaves.conditions import TopicCondition
from behavior_controller.leaves.knowledge import RetrieveListOfExhibits, SelectExhibit
from behavior_controller.leaves.recovery import HandleFallBack
from behavior_controller.missions.runner import RetryGate, Runner
from behavior_controller.robot.gateway import Call, Cause, Failure, Gateway
from behavior_controller.robot.requests import Answer, Request
from behavior_controller.simulation.rehearsal.play import LoadedMission

ON_PURPOSE = "broken on purpose"
"""The text of each exception that a breakage raises."""

LATE = 3.0
"""Seconds by which a leaf asks too late."""


class Place(NamedTuple):
    """A leaf of the tree, or the substitute that a HandleFallBack runs: its node type and path."""

    node: str
    path: str

    def needs(self, status: str = "") -> "Needs":
        """Return what a play needs to show a mistake of this leaf, with that result."""
        return self.node, self.path, status


Needs = Tuple[str, str, str]
"""Node type, path and result of a leaf; the last two may be empty."""


class Breakage(NamedTuple):
    """One mistake. ``names``: the node types one of which a verdict on it must name; ``needs``:
    what must happen in a sound play that can show it; None: any play may."""

    family: str
    what: str
    names: Tuple[str, ...]
    needs: Optional[Needs]
    broken: Callable[[], Any]  # a context in which the controller has the mistake

    def __str__(self) -> str:
        path = self.needs[1] if self.needs else ""
        return "{}: {}{}".format(self.family, self.what, " ({})".format(path) if path else "")


def place_of(leaf: Any) -> Place:
    return Place(leaf.registration_id, leaf.full_path)


# --------------------------------------------------------------------------------- how to break it


@contextlib.contextmanager
def in_trees(change: Callable[[Tree], None]) -> Iterator[None]:
    """Have ``change`` applied to each tree of a controller when it is set up."""
    setup = Tree.setup

    def broken_setup(tree: Tree, **kwargs: Any) -> None:
        setup(tree, **kwargs)
        if "mission" in kwargs:
            change(tree)

    with mock.patch.object(Tree, "setup", broken_setup):
        yield


@contextlib.contextmanager
def in_leaves(is_meant: Callable[[Any], bool], change: Callable[[Any], None]) -> Iterator[None]:
    """Have ``change`` applied to each leaf that is meant, substitutes included."""
    changed: Dict[int, Any] = {}  # keeps the leaves, so that no id is used twice

    def once(leaf: Any) -> None:
        if isinstance(leaf, MissionLeaf) and id(leaf) not in changed and is_meant(leaf):
            changed[id(leaf)] = leaf
            change(leaf)

    attempt = ServiceLeaf.try_once

    def broken_attempt(leaf: Any) -> Any:
        once(leaf)
        return attempt(leaf)

    def in_tree(tree: Tree) -> None:
        for node in tree.nodes:
            once(node)

    with in_trees(in_tree), mock.patch.object(ServiceLeaf, "try_once", broken_attempt):
        yield


def at(place: Place, change: Callable[[Any], None]) -> Callable[[], Any]:
    """Return the context in which the leaf at ``place`` is changed."""
    return lambda: in_leaves(lambda leaf: place_of(leaf) == place, change)


def wrapping(kind: type, name: str, around: Callable[..., Any]) -> Callable[[], Any]:
    """Return the context in which a method is ``around(method, self, …)``."""
    method = getattr(kind, name)
    return lambda: mock.patch.object(
        kind, name, lambda self, *given, **named: around(method, self, *given, **named))


# ------------------------------------------------------------------------------ what the leaves do


class Catalogue:
    """What the leaves of a mission do in sound plays: the requests of each place, the places of all
    leaves, and the neighbours in the tree."""

    def __init__(self) -> None:
        self.requests: Dict[Place, List[Request]] = {}
        self.leaves: Dict[Place, Any] = {}
        self.neighbours: List[Tuple[str, int, Tuple[str, ...]]] = []
        self.numbers: List[Tuple[str, str, Tuple[str, ...]]] = []
        self.controls: List[Tuple[str, type, List[List[str]]]] = []

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Take note of the plays in this context."""
        with in_leaves(lambda leaf: True, self._watch), in_trees(self._note_neighbours):
            yield

    def _watch(self, leaf: Any) -> None:
        self.leaves.setdefault(place_of(leaf), leaf)
        if not isinstance(leaf, ServiceLeaf):
            return
        request = leaf.request

        def noted() -> Any:
            wanted = request()
            asked = self.requests.setdefault(place_of(leaf), [])
            if isinstance(wanted, Request) and wanted not in asked:
                asked.append(wanted)
            return wanted

        leaf.request = noted  # type: ignore[method-assign]

    def _note_neighbours(self, tree: Tree) -> None:
        self.neighbours = [(node.full_path, index,
                            tuple(types(node.children[index:index + 2])) + tuple(
                                child.name for child in node.children[index:index + 2]
                                if child.name != child.registration_id)) for node in tree.nodes
                           if isinstance(node, Control) for index in range(len(node.children) - 1)
                           if all(types([child]) for child in node.children[index:index + 2])]
        self.controls = [(node.full_path, type(node), [types([child]) for child in node.children])
                         for node in tree.nodes if isinstance(node, Control)]
        self.numbers = [
            (node.full_path, name, (node.registration_id,) + tuple(types([node.parent.parent])))
            for node in tree.nodes if not isinstance(node, MissionLeaf)
            for name, text in node.attributes.items() if text.isdecimal()]

    def values(self, kind: type, field: str) -> List[Any]:
        """Return the values that the requests of one kind have in a field, in a fixed order."""
        seen = [getattr(request, field) for asked in self.requests.values() for request in asked
                if type(request) is kind]
        return sorted(set(seen), key=str)


def types(nodes: Sequence[Any]) -> List[str]:
    """Return the types of the mission leaves below some nodes."""
    return sorted({leaf.registration_id for node in nodes for leaf in node.iterate()
                   if isinstance(leaf, MissionLeaf) and not isinstance(leaf, HandleFallBack)})


# ------------------------------------------------------------------------------------ the requests


Changer = Callable[[Any], Any]


def changes(value: Any, others: Sequence[Any]) -> Iterator[Tuple[str, Changer]]:
    """Yield how a value of a field can be wrong, and the function that makes it so."""
    if isinstance(value, bool):
        yield "inverted", lambda given: not given
    elif isinstance(value, (int, float)):
        yield "larger", lambda given: given + type(given)(1)
        yield "a thousandth", lambda given: type(given)(given / 1000)
    elif isinstance(value, str):
        yield "that of another request", lambda given: next(
            (other for other in others if other != given), "other")
        yield "empty", lambda given: ""
        if " " in value:
            yield "without its last word", lambda given: given.rpartition(" ")[0]
            yield "said twice", lambda given: given + " " + given
    elif hasattr(value, "_fields"):
        for name in value._fields:
            yield name, lambda given, name=name: given._replace(
                **{name: getattr(given, name) + 0.25})
        yield "with x and y exchanged", lambda given: given._replace(x=given.y, y=given.x)
        yield "with another sign", lambda given: given._replace(x=-given.x, y=-given.y)
        if hasattr(value, "theta"):
            yield "with its angle in radians", lambda given: given._replace(
                theta=math.radians(given.theta))
            yield "with a half turn", lambda given: given._replace(theta=given.theta + 180)
    elif isinstance(value, tuple):
        yield "reversed", lambda given: given[::-1]
        yield "one short", lambda given: given[1:]


def with_request(change: Callable[[Request], Any]) -> Callable[[Any], None]:
    """Return the change of a leaf whose request is changed."""
    def spoil(leaf: Any) -> None:
        request = leaf.request

        def changed() -> Any:
            wanted = request()
            return change(wanted) if isinstance(wanted, Request) else wanted

        leaf.request = changed
    return spoil


def second(change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a change that is made when it is asked for the second time only."""
    numbers = itertools.count(1)

    def changed(request: Any) -> Any:
        return change(request) if next(numbers) == 2 else request

    return changed


def changed_requests(known: Catalogue) -> Iterator[Breakage]:
    """Yield each field of each leaf's requests, wrong in each way."""
    for place, asked in known.requests.items():
        for field in fields(type(asked[0])) if asked else ():
            name, kind = field.name, type(asked[0])
            for how, change in changes(getattr(asked[0], name), known.values(kind, name)):
                def altered(request: Any, name: str = name, change: Changer = change) -> Any:
                    return replace(request, **{name: change(getattr(request, name))})
                what = "{}.{} of {} is {}".format(kind.__name__, name, place.node, how)
                yield Breakage("request", what, (place.node,), place.needs(),
                               at(place, with_request(altered)))
                yield Breakage("request", what + " at its second use", (place.node,), place.needs(),
                               at(place, lambda leaf, altered=altered:
                                  with_request(second(altered))(leaf)))


def asks_twice_at_once(leaf: Any) -> None:
    try_once = leaf.try_once

    def twice() -> Any:
        wanted = leaf.request()
        if isinstance(wanted, Request):
            leaf.mission.gateway.start(wanted)
        return try_once()

    leaf.try_once = twice


def asks_again_after_the_answer(leaf: Any) -> None:
    accept = leaf.accept

    def again(answer: Answer) -> Any:
        wanted = leaf.request()
        if isinstance(wanted, Request):
            leaf.mission.gateway.start(wanted)
        return accept(answer)

    leaf.accept = again


def does_not_await_the_answer(leaf: Any) -> None:
    def start() -> Any:
        leaf.started_at = leaf.mission.clock.now()
        leaf.begun = leaf.try_once()  # kept: it would drop the request
        next(leaf.begun, None)
        return leaf.succeeded()

    leaf.on_start = start


def asks_late(leaf: Any) -> None:
    on_start, on_running, pause = leaf.on_start, leaf.on_running, []

    def start() -> Any:
        pause[:] = [leaf.mission.clock.call_after(LATE, leaf.wake)]
        return RUNNING

    def go_on() -> Any:
        if not pause:
            return on_running()
        if pause[0].callback is not None:
            return RUNNING
        pause.clear()
        return on_start()

    leaf.on_start, leaf.on_running = start, go_on


def hears_late(leaf: Any) -> None:
    try_once = leaf.try_once

    def attempt() -> Any:
        begun = try_once()
        try:
            next(begun)
        except StopIteration as over:  # at once
            return over.value
        call = begun.gi_frame.f_locals["call"]
        while getattr(call, "_inner", call).result is None:
            yield
        yield from leaf.pause(LATE)
        return (yield from begun)

    leaf.try_once = attempt


def asks_nothing(leaf: Any) -> None:
    leaf.request = lambda: None


ASKS: Tuple[Tuple[str, str, Callable[[Any], None]], ...] = (
    ("doubled", "{} asks twice at once", asks_twice_at_once),
    ("doubled", "{} asks again after the answer", asks_again_after_the_answer),
    ("not awaited", "{} does not await the answer", does_not_await_the_answer),
    ("late", "{} asks 3 s late", asks_late),
    ("late", "{} reads its answer 3 s late", hears_late),
    ("skipped", "{} succeeds without asking", asks_nothing))


def asked_otherwise(known: Catalogue) -> Iterator[Breakage]:
    """Yield each leaf that asks, asking at the wrong time, twice, or not at all."""
    for place, asked in known.requests.items():
        for family, what, change in ASKS if asked else ():
            yield Breakage(family, what.format(place.node), (place.node,), place.needs(),
                           at(place, change))


# ------------------------------------------------------------------------------------- the results


def skips(leaf: Any) -> None:
    leaf.update = lambda: SUCCESS


def does_not_act(leaf: Any) -> None:
    leaf.act = lambda: None


def fails_instead(leaf: Any) -> None:
    leaf.succeeded = lambda: leaf.failed(Failure(Cause.REFUSED, "broken", leaf.resource))


def succeeds_instead(leaf: Any) -> None:
    succeeded = leaf.succeeded
    leaf.failed = lambda failure: succeeded()


def returns(given: Any, instead: Any) -> Callable[[Any], None]:
    """Return the change of a leaf that returns another result than it reports."""
    def spoil(leaf: Any) -> None:
        update = leaf.update

        def other() -> Any:
            result = update()
            return instead if result is given else result

        leaf.update = other
    return spoil


def hangs(leaf: Any) -> None:
    leaf.on_start = leaf.on_running = lambda: RUNNING


def raises(name: str) -> Callable[[Any], None]:
    """Return the change of a leaf whose method raises an exception."""
    def spoil(leaf: Any) -> None:
        def fail(*_: Any) -> Any:
            raise RuntimeError(ON_PURPOSE)
        setattr(leaf, name, fail)
    return spoil


def holds(leaf: Any) -> None:
    leaf.update = leaf.succeeded


def does_not_hold(leaf: Any) -> None:
    failure = Failure(Cause.CONDITION_FALSE, leaf.otherwise, leaf.resource)
    leaf.update = lambda: leaf.failed(failure)


def uses_old_messages(leaf: Any) -> None:
    leaf.not_before = lambda: float("-inf")


def uses_any_message(leaf: Any) -> None:
    leaf.is_evidence = lambda value: True


RESULTS: Tuple[Tuple[type, str, str, str, Callable[[Any], None]], ...] = (
    (MissionLeaf, "skipped", "{} is not run", "", skips),
    (InstantAction, "skipped", "{} succeeds without acting", "", does_not_act),
    (MissionLeaf, "result", "{} reports FAILURE for SUCCESS", "SUCCESS", fails_instead),
    (MissionLeaf, "result", "{} reports SUCCESS for FAILURE", "FAILURE", succeeds_instead),
    (MissionLeaf, "result", "{} returns FAILURE for SUCCESS", "SUCCESS", returns(SUCCESS, FAILURE)),
    (MissionLeaf, "result", "{} returns SUCCESS for FAILURE", "FAILURE", returns(FAILURE, SUCCESS)),
    (ServiceLeaf, "hang", "{} never ends", "", hangs),
    (MissionLeaf, "exception", "{} raises in its tick", "", raises("update")),
    (ServiceLeaf, "exception", "{} raises in its request", "", raises("request")),
    (ServiceLeaf, "exception", "{} raises at its answer", "", raises("accept")),
    (InstantCondition, "condition", "{} always holds", "FAILURE", holds),
    (InstantCondition, "condition", "{} never holds", "SUCCESS", does_not_hold),
    (TopicCondition, "condition", "{} always holds", "FAILURE", holds),
    (TopicCondition, "condition", "{} never holds", "SUCCESS", does_not_hold),
    (TopicCondition, "condition", "{} uses messages from before", "", uses_old_messages),
    (TopicCondition, "condition", "{} takes any message for the sign", "", uses_any_message))


def wrong_results(known: Catalogue) -> Iterator[Breakage]:
    """Yield each leaf with each wrong result."""
    for place, leaf in known.leaves.items():
        names = (place.node,) if not isinstance(leaf, HandleFallBack) else (
            "HandleFallBack",) + tuple(types(leaf.parent.children))
        for kind, family, what, status, change in RESULTS:
            if isinstance(leaf, kind):
                yield Breakage(family, what.format(place.node), names, place.needs(status),
                               at(place, change))


# ------------------------------------------------------------------------------------- the entries


def other(value: Any) -> Any:
    """Return another value of that type."""
    opposite = {"yes": "no", "no": "yes"}
    if isinstance(value, str):
        return opposite.get(value, value + " or so")
    if isinstance(value, list):
        return value[::-1] or [0]
    if isinstance(value, tuple):
        return value._replace(**{value._fields[0]: value[0] + 0.25})  # type: ignore
    return value + 1


def readers(entry: str) -> Tuple[str, ...]:
    """Return the node types that read an entry by default."""
    return tuple(spec.id for spec in leaves.mission_specs() if any(
        port.default == entry and port.direction is not Direction.OUT for port in spec.ports))


def writes(port: str, change: Callable[[Callable[[str, Any], None], Any], None]
           ) -> Callable[[Any], None]:
    """Return the change of a leaf with ``change(write, value)`` for what it writes to ``port``."""
    def spoil(leaf: Any) -> None:
        set_output = leaf.set_output

        def changed(name: str, value: Any) -> None:
            if name == port:
                change(functools.partial(set_output, name), value)
            else:
                set_output(name, value)

        leaf.set_output = changed
    return spoil


WRITES: Tuple[Tuple[str, Callable[[Any, Any], None]], ...] = (
    ("{} does not write {}", lambda write, value: None),
    ("{} writes another value to {}", lambda write, value: write(other(value))),
    ("{} writes a value of another type to {}",
     lambda write, value: write([value] if isinstance(value, str) else str(value))),
    ("{} writes twice to {}, the second time another value",
     lambda write, value: (write(value), write(other(value)))))


def exchanges(one: str, another: str) -> Callable[[Any], None]:
    """Return the change of a leaf that writes two entries the wrong way round."""
    def spoil(leaf: Any) -> None:
        set_output, names = leaf.set_output, {one: another, another: one}
        leaf.set_output = lambda name, value: set_output(names.get(name, name), value)
    return spoil


def wrong_writes(known: Catalogue) -> Iterator[Breakage]:
    """Yield each leaf with each output port, not written or written wrongly."""
    for place, leaf in known.leaves.items():
        for port in leaf.spec.ports:
            for what, change in WRITES if port.direction is not Direction.IN else ():
                yield Breakage("entry", what.format(place.node, port.name),
                               (place.node,) + readers(port.default or ""), place.needs(),
                               at(place, writes(port.name, change)))
        outputs = [port for port in leaf.spec.ports if port.direction is not Direction.IN]
        for one, another in itertools.combinations(outputs, 2):
            if one.type == another.type:
                yield Breakage(
                    "entry", "{} exchanges {} and {}".format(place.node, one.name, another.name),
                    (place.node,) + readers(one.default or "") + readers(another.default or ""),
                    place.needs(), at(place, exchanges(one.name, another.name)))


# --------------------------------------------------------------------------------------- the order


def swapped(path: str, index: int) -> Callable[[], Any]:
    def swap(tree: Tree) -> None:
        children = next(node for node in tree.nodes if node.full_path == path).children
        children[index:index + 2] = children[index:index + 2][::-1]
    return lambda: in_trees(swap)


def wrong_order(known: Catalogue) -> Iterator[Breakage]:
    """Yield each two neighbours of the tree in reverse order."""
    for path, index, names in known.neighbours:
        yield Breakage("order", "children {} and {} of {} are reversed".format(
            index + 1, index + 2, path), names, None, swapped(path, index))


CONTROLS = {Sequence_: Fallback, Fallback: Sequence_, ReactiveSequence: Sequence_,
            ReactiveFallback: Fallback}
"""A control, and what it is taken for."""


def taken_for(path: str) -> Callable[[], Any]:
    def change(tree: Tree) -> None:
        node = next(node for node in tree.nodes if node.full_path == path)
        node.__class__ = CONTROLS[type(node)]
        vars(node).update({name: value for name, value in vars(
            CONTROLS[type(node)](node.name)).items() if name not in vars(node)})
    return lambda: in_trees(change)


def without_child(path: str, index: int) -> Callable[[], Any]:
    def leave_out(tree: Tree) -> None:
        del next(node for node in tree.nodes if node.full_path == path).children[index]
    return lambda: in_trees(leave_out)


def wrong_controls(known: Catalogue) -> Iterator[Breakage]:
    """Yield each control that is another, and each child that is left out."""
    for path, kind, below in known.controls:
        names = tuple(sorted({name for names in below for name in names}))
        if kind in CONTROLS:
            yield Breakage("control", "{} is a {}: {}".format(
                kind.__name__, CONTROLS[kind].__name__, path), names + (path,), None,
                taken_for(path))
        for index, name in enumerate(below if len(below) > 1 else ()):
            yield Breakage("control", "child {} of {} is left out".format(index + 1, path),
                           (tuple(name) or names) + (path,), None, without_child(path, index))


def with_exhibits(change: Callable[[Tuple[Any, ...]], Tuple[Any, ...]]) -> Callable[[Any], None]:
    def spoil(leaf: Any) -> None:
        accept = leaf.accept
        leaf.accept = lambda answer: accept(replace(answer, exhibits=change(answer.exhibits)))
    return spoil


def selects_twice(leaf: Any) -> None:
    act = leaf.act
    leaf.act = lambda: act() or act() and None


LISTS: Tuple[Tuple[str, Callable[[Any], Any]], ...] = (
    ("reversed", lambda exhibits: exhibits[::-1]),
    ("begun with the second", lambda exhibits: exhibits[1:] + exhibits[:1]),
    ("without the last", lambda exhibits: exhibits[:-1]),
    ("without the first", lambda exhibits: exhibits[1:]),
    ("with the first twice", lambda exhibits: exhibits[:1] + exhibits))


def wrong_exhibits(known: Catalogue) -> Iterator[Breakage]:
    """Yield the tour in another order."""
    for place, leaf in known.leaves.items():
        if isinstance(leaf, RetrieveListOfExhibits):
            for how, change in LISTS:
                yield Breakage("exhibits", "the list of exhibits is stored " + how,
                               (place.node, "SelectExhibit", "IsListWithExhibit", "Navigate"),
                               place.needs(), at(place, with_exhibits(change)))
        if isinstance(leaf, SelectExhibit):
            yield Breakage("exhibits", "every second exhibit is passed over",
                           (place.node, "Navigate"), place.needs(), at(place, selects_twice))


# ------------------------------------------------------------------------------------ the recovery


def by_rule(node: str, change: Callable[[Any], Any]) -> Callable[[], Any]:
    """Return the context in which recoveries from failures of ``node`` go by changed rules."""
    def changed(method: Any, self: Any, leaf: Any, cause: Cause) -> Any:
        rule = method(self, leaf, cause)
        return change(rule) if node in ("", leaf.spec.id) else rule
    return wrapping(HandleFallBack, "rule", changed)


RULES: Tuple[Tuple[str, Callable[[Any], Any]], ...] = (
    ("one retry too many", lambda rule: rule._replace(retries=rule.retries + 1)),
    ("one retry too few", lambda rule: rule._replace(retries=max(0, rule.retries - 1))),
    ("no retry", lambda rule: rule._replace(retries=0)),
    ("20 retries", lambda rule: rule._replace(retries=20)),
    ("a back-off twice as long", lambda rule: rule._replace(back_off=rule.back_off * 2)),
    ("half the back-off", lambda rule: rule._replace(back_off=rule.back_off / 2)),
    ("a back-off 5 s longer", lambda rule: rule._replace(back_off=rule.back_off + 5)),
    ("no back-off", lambda rule: rule._replace(back_off=0.0)),
    ("skip instead of give up", lambda rule: rule._replace(then=SKIP)),
    ("give up instead of skip", lambda rule: rule._replace(then=GIVE_UP)),
    ("no substitute", lambda rule: rule._replace(substitute=None)))


def wrong_rules(known: Catalogue) -> Iterator[Breakage]:
    """Yield each changed rule for each node type that can fail, and for all of them."""
    nodes = sorted({place.node for place, leaf in known.leaves.items()
                    if not isinstance(leaf, (HandleFallBack, InstantAction))})
    for node in [""] + nodes:
        for what, change in RULES:
            yield Breakage("recovery", "{}: {}".format(node or "all", what),
                           (node,) if node else ("HandleFallBack",) + tuple(nodes),
                           (node, "", "FAILURE") if node else None, by_rule(node, change))


def _affordable(method: Any, self: Any) -> bool:
    method(self)
    return True


def _unaffordable(method: Any, self: Any) -> bool:
    method(self)
    return False


def _never_redone(method: Any, self: Any, leaf: Any, cause: Cause) -> Any:
    return method(self, leaf, cause)._replace(retries=0, substitute=None)


def _not_left_out(method: Any, self: Any, steps: Any) -> bool:
    return True


def _as_refused(method: Any, self: Any, leaf: Any, cause: Cause) -> Any:
    return method(self, leaf, Cause.REFUSED)


RECOVERIES: Tuple[Tuple[str, type, str, Callable[..., Any]], ...] = (
    ("the budget is not kept", MissionContext, "afford_recovery", _affordable),
    ("the budget counts as spent", MissionContext, "afford_recovery", _unaffordable),
    ("no step is tried again", HandleFallBack, "rule", _never_redone),
    ("an exhibit that is left out is not noted", HandleFallBack, "leave_out", _not_left_out),
    ("every cause counts as refused", HandleFallBack, "rule", _as_refused))


def wrong_recoveries(known: Catalogue) -> Iterator[Breakage]:
    """Yield the mistakes of the recovery as a whole."""
    nodes = ("HandleFallBack",) + tuple(place.node for place in known.leaves)
    for what, kind, method, around in RECOVERIES:
        yield Breakage("recovery", what, nodes, None, wrapping(kind, method, around))
    yield Breakage("recovery", "a retry does not wait for a node that is gone",
                   ("HandleFallBack", "Navigate", "LookUpHome", "LookUpEntrance",
                    "RetrieveListOfExhibits", "RetrieveInitialLocation"), None,
                   lambda: mock.patch.object(recovery_leaf, "RETURN_LIMIT", 0.0))


# ---------------------------------------------------------------------------------- the safe state


class _Proxy:
    """The context of a mission, with another way to ask for the safe state."""

    def __init__(self, mission: MissionContext, ask: Callable[[], SafeState]):
        vars(self).update(_mission=mission, ask_for_safe_state=ask)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._mission, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._mission, name, value)


def in_safe_state(change: Callable[[Tuple[Request, ...]], Tuple[Request, ...]],
                  at_end: bool) -> Callable[[], Any]:
    """Return the context in which the safe state is asked for with changed requests, after the last
    pass or when a recovery gives up."""
    def spoil(tree: Tree) -> None:
        handlers = [node for node in tree.nodes if isinstance(node, HandleFallBack)]
        mission: Any = handlers[0].mission
        other = copy.copy(mission.interface)
        other.safe_state = change(other.safe_state)
        ask = mission.ask_for_safe_state

        def changed() -> SafeState:
            return SafeState(mission.gateway, other, mission.offers, mission.clock.now)

        for leaf in handlers:
            leaf.mission = _Proxy(mission, ask if at_end else changed)  # type: ignore
        if at_end:
            mission.ask_for_safe_state = changed
    return lambda: in_trees(spoil)


SAFE: Tuple[Tuple[str, Callable[[Any], Any]], ...] = (
    ("nothing", lambda requests: ()),
    ("its first part only", lambda requests: requests[:1]),
    ("its last part only", lambda requests: requests[1:]),
    ("everything twice", lambda requests: requests + requests),
    ("lifelike movement on", lambda requests: tuple(
        replace(request, state="enabled") if request.switches == "lifelike movement" else request
        for request in requests)),
    ("attention to people", lambda requests: tuple(
        replace(request, state="social") if request.switches == "attention" else request
        for request in requests)))


def wrong_safe_states(known: Catalogue) -> Iterator[Breakage]:
    """Yield each wrong safe state, at the end and at giving up."""
    for at_end, when in ((True, "after the last pass"), (False, "at giving up")):
        for what, change in SAFE:
            yield Breakage("safe state", "{} {} is asked for".format(when, what),
                           ("safe state", "attention", "lifelike movement"), None,
                           in_safe_state(change, at_end))


# -------------------------------------------------------------------------------- the whole mission


def in_mission(change: Callable[[Any], None]) -> Callable[[], Any]:
    """Return the context in which the mission's context is changed after it was made."""
    def made(method: Any, self: Any, *given: Any, **named: Any) -> None:
        method(self, *given, **named)
        change(self)
    return wrapping(MissionContext, "__init__", made)


def speaks_kinyarwanda(mission: Any) -> None:
    mission.phrases = phrases.load("Kinyarwanda")
    if mission.knowledge is not None:
        mission.knowledge = dataclasses.replace(mission.knowledge, phrases={
            number: text + " nyabuneka" for number, text in mission.knowledge.phrases.items()})


def exchanges_phrases(mission: Any) -> None:
    speeches = mission.phrases.speeches
    names, texts = list(speeches), list(speeches.values())
    mission.phrases = dataclasses.replace(
        mission.phrases, speeches=dict(zip(names, texts[1:] + texts[:1])))
    if mission.knowledge is not None:
        numbers, texts = zip(*mission.knowledge.phrases.items())
        mission.knowledge = dataclasses.replace(
            mission.knowledge, phrases=dict(zip(numbers, texts[1:] + texts[:1])))


def names_kinyarwanda(mission: Any) -> None:
    mission.language = "Kinyarwanda"


def keeps_the_last_visitor(method: Any, self: Any, blackboard: Any, at: float) -> None:
    self.failures.begin_pass()


def runs(change: Callable[[int], int]) -> Callable[[], Any]:
    def made(method: Any, self: Any, running: Any, *given: Any) -> None:
        method(self, running._replace(runs=change(running.runs)), *given)
    return wrapping(Runner, "__init__", made)


def counts_twice(method: Any, self: Any) -> None:
    method(self)
    self._number += 1


class _Gateway(Gateway):
    """A gateway that handles its ``number``-th request in a way of its own."""

    def __init__(self, inner: Gateway, number: int, how: Callable[[Gateway, Request], Call]):
        self._inner, self._how = inner, how
        self._left = number

    def start(self, request: Request) -> Call:
        """Send the request, or do otherwise."""
        self._left -= 1
        return self._how(self._inner, request) if self._left == 0 else self._inner.start(request)


def sends_twice(gateway: Gateway, request: Request) -> Call:
    gateway.start(request)
    return gateway.start(request)


def sends_nothing(gateway: Gateway, request: Request) -> Call:
    call = Call(request, lambda: None)
    call.finish(Answer())
    return call


def sends_before(stray: Request) -> Callable[[Gateway, Request], Call]:
    def send(gateway: Gateway, request: Request) -> Call:
        gateway.start(stray)
        return gateway.start(request)
    return send


class _AfterFailure(Gateway):
    """A gateway that handles a request in a way of its own if the last one failed."""

    def __init__(self, inner: Gateway, how: Callable[[Gateway, Request], Call]):
        self._inner, self._how = inner, how
        self._last: Any = None

    def start(self, request: Request) -> Call:
        """Send the request, or do otherwise."""
        has_failed = self._last is not None and isinstance(self._last.result, Failure)
        self._last = None if has_failed else self._inner.start(request)
        return self._last or self._how(self._inner, request)


def with_nth_request(number: int, how: Callable[[Gateway, Request], Call]) -> Callable[[], Any]:
    def spoil(mission: Any) -> None:
        mission.gateway = _Gateway(mission.gateway, number, how)
    return in_mission(spoil)


class _Deaf(Gateway):
    """A gateway that sends nothing."""

    def start(self, request: Request) -> Call:
        return Call(request, lambda: None)


def observed(gateway: Any) -> ObservedGateway:
    """Return the gateway that records requests."""
    while not isinstance(gateway, ObservedGateway):
        gateway = gateway._inner
    return gateway


def sends_and_forgets(gateway: Gateway, request: Request) -> Call:
    with mock.patch.object(observed(gateway), "_inner", _Deaf()):
        return gateway.start(request)


def sends_unrecorded(gateway: Gateway, request: Request) -> Call:
    observed(gateway)._inner.start(request)
    return gateway.start(request)


def answers_otherwise(gateway: Gateway, request: Request) -> Call:
    call = gateway.start(request)
    inner = getattr(call, "_inner", call)
    finish = inner.finish

    def other(result: Any) -> None:
        if isinstance(result, Answer):
            swapped = {"Yes": "No", "No": "Yes", "": "Yes"}.get(result.response, "")
            result = replace(result, exhibits=result.exhibits[::-1], response=swapped)
        finish(result)

    inner.finish = other
    return call


WAYS = (("is sent twice", sends_twice), ("is not sent", sends_nothing),
        ("is recorded and not sent", sends_and_forgets),
        ("is sent once more, unrecorded", sends_unrecorded),
        ("has another answer on record", answers_otherwise))


def wrong_gateway(known: Catalogue) -> Iterator[Breakage]:
    """Yield single requests of a run that are sent twice, not at all, or with another before."""
    nodes = tuple(place.node for place, asked in known.requests.items() if asked) + (
        "safe state",)  # whose requests are the last ones of the run
    strays = [asked[-1] for asked in known.requests.values() if asked]
    for what, how in WAYS:
        yield Breakage("gateway", "each request after one that failed " + what, nodes, None,
                       with_failures(how))
    for number in range(1, 90, 4):
        stray = strays[number % len(strays)]
        for what, how in (*WAYS, ("has a stray {} before it".format(type(stray).__name__),
                           sends_before(stray))):
            yield Breakage("gateway", "request {} of the run {}".format(number, what), nodes, None,
                           with_nth_request(number, how))


def with_failures(how: Callable[[Gateway, Request], Call]) -> Callable[[], Any]:
    def spoil(mission: Any) -> None:
        mission.gateway = _AfterFailure(mission.gateway, how)
    return in_mission(spoil)


@contextlib.contextmanager
def encoding(service: Any, change: Callable[[Tuple[Any, ...]], Tuple[Any, ...]]) -> Iterator[None]:
    """Have the requests to a service encoded with other values."""
    encode = service.fields
    object.__setattr__(service, "fields", lambda request: change(tuple(encode(request))))
    try:
        yield
    finally:
        object.__setattr__(service, "fields", encode)


def wrong_encodings(known: Catalogue) -> Iterator[Breakage]:
    """Yield each field of each service, encoded wrongly."""
    mission = next(iter(known.leaves.values())).mission
    for service in mission.interface.services:
        asking = [place.node for place, asked in known.requests.items()
                  if asked and type(asked[0]) is service.request]
        request = next((asked[0] for asked in known.requests.values()
                        if asked and type(asked[0]) is service.request), None)
        for index, value in enumerate(service.fields(request) if request is not None else ()):
            for how, change in changes(value, ("disabled", "location", "home", "deictic")):
                def changed(values: Any, index: int = index, change: Changer = change) -> Any:
                    return values[:index] + (change(values[index]),) + values[index + 1:]
                yield Breakage("encoding", "value {} of {} is {}".format(
                    index + 1, service.name, how), tuple(asking), None,
                    functools.partial(encoding, service, changed))


class _Settings:
    """The settings of a mission, of which the leaves read some otherwise than the record has them.
    """

    def __init__(self, inner: Settings, **values: Any):
        vars(self).update(values, _inner=inner)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


def of_settings(**values: Any) -> Callable[[], Any]:
    """Return the context in which the leaves go by other settings."""
    def change(mission: Any) -> None:
        mission.settings = _Settings(mission.settings, **values)
    return in_mission(change)


def wrong_times(known: Catalogue) -> Iterator[Breakage]:
    """Yield limits of time that are shorter or longer."""
    asking = tuple(place.node for place, asked in known.requests.items() if asked)
    conditions = tuple(place.node for place, leaf in known.leaves.items()
                       if isinstance(leaf, TopicCondition)) + ("GetVisitorResponse",)
    for what, factor in (("a quarter", 0.25), ("twice", 2.0)):
        yield Breakage("time", "each deadline is {} of what it was".format(what), asking, None,
                       wrapping(Settings, "deadline", lambda method, *given, factor=factor:
                                factor * method(*given)))
        yield Breakage("time", "release 1.0 waits {} as long for answers".format(what), conditions,
                       None, lambda factor=factor: mock.patch.object(
                           release_1_0, "ANSWER_WAIT", factor * release_1_0.ANSWER_WAIT))
    for seconds in (0.001, 1e6):
        yield Breakage("time", "messages count for {:g} s".format(seconds), conditions, None,
                       of_settings(topic_max_age=seconds))
    yield Breakage("time", "conditions wait for 3 s themselves", conditions, None,
                   of_settings(condition_wait=3.0))


def opposite(answer: Any) -> Any:
    return {"yes": "no", "no": "yes"}.get(answer, answer)


def wrong_answers(known: Catalogue) -> Iterator[Breakage]:
    """Yield the visitor's answers, understood wrongly."""
    nodes = ("IsYesNoUttered", "PressYesNoDialogue", "GetVisitorResponse", "IsVisitorResponseYes",
             "HasVisitorResponded")
    for name in ("spoken_answer", "pressed_answer"):
        yield Breakage("answer", "{} gives the opposite".format(name), nodes, None,
                       wrapping(Phrases, name, lambda method, *given: opposite(method(*given))))
        yield Breakage("answer", "{} always gives yes".format(name), nodes, None,
                       wrapping(Phrases, name, lambda method, *given: "yes"))
        yield Breakage("answer", "{} understands nothing".format(name), nodes, None,
                       wrapping(Phrases, name, lambda method, *given: None))
    yield Breakage("answer", "every utterance is an answer", nodes, None,
                   wrapping(Phrases, "is_answer", lambda method, *given: True))
    yield Breakage("answer", "no utterance is an answer", nodes, None,
                   wrapping(Phrases, "is_answer", lambda method, *given: False))


def with_attribute(path: str, name: str, change: Callable[[int], int]) -> Callable[[], Any]:
    def spoil(tree: Tree) -> None:
        node = next(node for node in tree.nodes if node.full_path == path)
        node.attributes = dict(node.attributes, **{name: str(change(int(node.attributes[name])))})
    return lambda: in_trees(spoil)


def wrong_numbers(known: Catalogue) -> Iterator[Breakage]:
    """Yield each number of the mission's file, larger or smaller."""
    for path, name, names in known.numbers:
        for what, change in (("larger", lambda number: number + 1 + number // 2),
                             ("smaller", lambda number: max(1, number // 2))):
            yield Breakage("number", "{} of {} is {}".format(name, path, what), names, None,
                           with_attribute(path, name, change))


def after_ticks(number: int, then: Callable[[], bool]) -> Callable[[], Any]:
    """Return the context in which the controller is stopped after so many ticks if ``then()``."""
    def made(method: Any, self: Any, running: Any, is_stopped: Any, *given: Any) -> None:
        calls = itertools.count(1)
        method(self, running, lambda: next(calls) > number and then(), *given)
    return wrapping(Runner, "__init__", made)


def crash() -> bool:
    raise RuntimeError(ON_PURPOSE)


# -------------------------------------------------------------------------------------- the record


def tampered(kind: type, number: int, change: Callable[[Any], Any]) -> Callable[[], Any]:
    """Return the context in which the ``number``-th event of a kind in the record is changed, or
    left out."""
    def play(method: Any, self: Any, *given: Any, **named: Any) -> Any:
        played = method(self, *given, **named)
        count, events = itertools.count(1), []
        for at, event in played.events:
            is_meant = type(event) is kind and next(count) == number
            events += [(at, new) for new in (change(event) if is_meant else [event])]
        return played._replace(events=events)
    return wrapping(LoadedMission, "play", play)


def mistold(event: Any) -> List[Any]:
    return [_mistold(event)]


def _mistold(event: Any) -> Any:
    """Return an event with another result or another request."""
    if isinstance(event, Answered):
        failed = isinstance(event.result, Failure)
        return replace(event, result=Answer() if failed else Failure(Cause.REFUSED, "no"))
    if isinstance(event, Asked):
        name = event.request.__struct_fields__[0]
        value = getattr(event.request, name)
        _, change = next(changes(value, ("disabled", "home")))
        return replace(event, request=replace(event.request, **{name: change(value)}))
    opposite = {"SUCCESS": "FAILURE", "FAILURE": "SUCCESS"}
    if isinstance(event, PassFinished):
        return replace(event, outcome=opposite[event.outcome])
    if isinstance(event, PassStarted):
        return replace(event, number=event.number + 1)
    if isinstance(event, (Recovered, Recovering, Retried)):
        other = Cause.REFUSED if event.failure.cause is not Cause.REFUSED else Cause.NO_ANSWER
        return replace(event, failure=replace(event.failure, cause=other))
    if isinstance(event, SafeStateReported):
        failed = Failure(Cause.REFUSED, "no", event.parts[0].service)
        part = replace(event.parts[0], failure=None if event.parts[0].failure else failed)
        return replace(event, parts=(part,) + event.parts[1:])
    if isinstance(event, EntriesWritten):
        return replace(event, entries=[(name, text and text + "1") for name, text in event.entries])
    if isinstance(event, Tick):
        letters = {"S": "F", "F": "S"}
        return replace(event, changes=[(uid, letters.get(letter, letter))
                                       for uid, letter in event.changes])
    if isinstance(event, RunFinished):
        return replace(event, exit_code=event.exit_code + 1)
    if isinstance(event, RunStarted):
        sources = event.sources
        policy = sources.policy._replace(text=sources.policy.text + "# or so")
        return replace(event, sources=replace(sources, policy=policy))
    if isinstance(event, TreeShown):
        return replace(event, nodes=event.nodes[::-1])
    if isinstance(event, StepStarted):
        return replace(event, is_wait=not event.is_wait)
    if isinstance(event, StopChanged):
        return replace(event, number=event.number + 1)
    return replace(event, status=opposite.get(event.status, "SUCCESS"))


def mislabelled(event: Any) -> List[Any]:
    """Return an event that says the same of another thing."""
    if isinstance(event, RunStarted):
        return [replace(event, settings=dict(event.settings, language="Kinyarwanda"))]
    if isinstance(event, TreeShown):
        return [replace(event, nodes=event.nodes[:-1])]
    if isinstance(event, EntriesWritten):
        return [replace(event, entries=[(name + "x", text) for name, text in event.entries])]
    if isinstance(event, Tick):
        return [replace(event, changes=[(uid + 1, letter) for uid, letter in event.changes])]
    if isinstance(event, RunFinished):
        return [replace(event, outcome="stopped; last pass: none")]
    if isinstance(event, Recovered):
        return [replace(event, success=not event.success)]
    if isinstance(event, (PassStarted, PassFinished)):
        return [replace(event, number=event.number + 1)]
    if isinstance(event, Answered):
        return [replace(event, call=event.call + 1)]
    if isinstance(event, SafeStateReported):
        return [replace(event, parts=event.parts[1:])]
    if isinstance(event, Asked):
        return [replace(event, service=event.service + "x")]
    return [replace(event, path=event.path + "x")]


OF_A_RUN = (Asked, Answered, LeafFinished, Recovering, Recovered, Retried, SafeStateReported,
            PassStarted, PassFinished, EntriesWritten, Tick, RunFinished, RunStarted, TreeShown,
            StepStarted, StopChanged)
"""The events that say what was done."""


def wrong_records(known: Catalogue) -> Iterator[Breakage]:
    """Yield records that lack an event, or have it otherwise than it was."""
    nodes = tuple({place.node for place in known.leaves}) + (
        "record", "pass", "exit code", "controller")
    for what, change in (("is missing", lambda event: []), ("is another", mistold),
                         ("is there twice", lambda event: [event, event]),
                         ("is of another thing", mislabelled)):
        for kind, number in itertools.product(OF_A_RUN, (1, 2, 5, 13, 24)):
            yield Breakage("record", "{} {} on record {}".format(kind.__name__, number, what),
                           nodes, None, tampered(kind, number, change))


def early(number: int, seconds: float) -> Callable[[], Any]:
    """Return the context in which a request was sent so many seconds before it was due."""
    def play(method: Any, self: Any, *given: Any, **named: Any) -> Any:
        played = method(self, *given, **named)
        before, lines, events = 0.0, list(played.journal), []
        for at, event in played.events:
            if isinstance(event, Asked) and event.call == number and at - before > seconds:
                its = [line for line in lines if line.call and at <= line.time < at + 0.01]
                lines = [line._replace(time=line.time - seconds) if line in its else line
                         for line in lines]
                at -= seconds
            before = at if isinstance(event, Tick) else before
            events.append((at, event))
        lines.sort(key=lambda line: line.time)
        return played._replace(events=events, journal=lines)
    return wrapping(LoadedMission, "play", play)


def waits_before(kind: type, name: str, seconds: float, number: int = 1) -> Callable[[], Any]:
    """Return the context in which the ``number``-th call of a runner's method waits before."""
    def around(method: Any, self: Any, *given: Any) -> Any:
        count = vars(self).setdefault("_counted", itertools.count(1))
        if next(count) == number:
            self._pause(seconds)
        return method(self, *given)
    return wrapping(kind, name, around)


def ends_pass(result: Any, ticks: int) -> Callable[[], Any]:
    """Return the context in which a pass ends with that result after so many ticks."""
    def around(method: Any, self: Any) -> Any:
        found, count = method(self), vars(self).setdefault("_counted", itertools.count(1))
        if found is not RUNNING or next(count) != ticks:
            return found
        self.halt()
        return result
    return wrapping(Tree, "tick_once", around)


def _hangs(path: str) -> Callable[[], Any]:
    def change(tree: Tree) -> None:
        hangs(next(node for node in tree.nodes if node.full_path == path))
    return lambda: in_trees(change)


def _false_alarm(method: Any, self: Any, events: Any) -> None:
    method(self, events)
    if next(vars(self).setdefault("_counted", itertools.count(1))) == 20:
        events.emit(HealthChanged("service", "/robotNavigation/set_goal", "robotNavigation", False,
                                  "gone", "", "gone"))


def _suspends(method: Any, self: Any) -> Any:
    if next(vars(self).setdefault("_counted", itertools.count(1))) == 20:
        self.mission.events.emit(Suspended("an operator holds the run"))
        self._pause(100.0)
        self.mission.events.emit(Suspended(""))
    return method(self)


def _other_language_later(method: Any, self: Any, *given: Any) -> None:
    if next(vars(self).setdefault("_counted", itertools.count(1))) == 3:
        speaks_kinyarwanda(self)
    method(self, *given)


def wrong_course(known: Catalogue) -> Iterator[Breakage]:
    """Yield controllers that do the right things at the wrong time, and passes that end."""
    asking = tuple(place.node for place, asked in known.requests.items() if asked)
    anything = asking + tuple(place.node for place in known.leaves)
    for number in range(2, 60, 6):
        yield Breakage("course", "request {} of the run is sent 0.9 s early".format(number),
                       anything, None, early(number, 0.9))
    for name, when in (("_leave_safe", "before the safe state"), ("_pass",
                                                                  "before the first pass")):
        yield Breakage("course", "30 s are spent " + when, ("pass", "the end", "the run"), None,
                       waits_before(Runner, name, 30.0))
    yield Breakage("course", "30 s are spent before the second pass", ("pass",), None,
                   waits_before(Runner, "_pass", 30.0, 2))
    yield Breakage("course", "60 s are spent after a pass", ("pass", "the run"), None,
                   waits_before(Runner, "_await_cause", 60.0))
    for ticks in (5, 30, 80):
        for result in (SUCCESS, FAILURE):
            yield Breakage("course", "a pass ends with {} after {} ticks".format(
                result.name, ticks), ("pass",) + anything, None, ends_pass(result, ticks))
    for path, _, names in known.numbers:
        if "Sleep" in path:
            yield Breakage("course", "{} never ends".format(path), names + (path,), None,
                           _hangs(path))
    yield Breakage("course", "the loss of a node is never noticed", anything, None,
                   wrapping(Health, "report", lambda method, *given: None))
    yield Breakage("course", "a node that runs is taken for gone", ("/robotNavigation",), None,
                   wrapping(Health, "publish", _false_alarm))
    yield Breakage("course", "the run is held, and nobody asked for it", ("an operator",), None,
                   wrapping(Runner, "_tick", _suspends))
    yield Breakage("course", "the second visitor is spoken to in another language", asking, None,
                   wrapping(MissionContext, "begin_visit", _other_language_later))


def asks_after_the_end(method: Any, self: Any) -> Any:
    code = method(self)
    self.mission.gateway.start(self.mission.interface.safe_state[0])
    return code


PAUSES: Tuple[Tuple[str, Callable[..., float]], ...] = (
    ("half as long", lambda method, self, number: method(self, number) / 2),
    ("twice as long", lambda method, self, number: method(self, number) * 2),
    ("as long as the first one", lambda method, self, number: method(self, 0)))


def wrong_missions(known: Catalogue) -> Iterator[Breakage]:
    """Yield the mistakes of the mission as a whole."""
    speech = tuple(place.node for place, asked in known.requests.items()
                   if asked and hasattr(asked[0], "text"))
    yield Breakage("language", "the phrases are those of another language", speech, None,
                   in_mission(speaks_kinyarwanda))
    yield Breakage("language", "each phrase is that of the next node", speech, None,
                   in_mission(exchanges_phrases))
    yield Breakage("language", "the language is another", speech + ("StartOfTree",), None,
                   in_mission(names_kinyarwanda))
    yield Breakage("passes", "the last visitor's data are kept", ("pass",), None,
                   wrapping(MissionContext, "begin_visit", keeps_the_last_visitor))
    yield Breakage("passes", "one pass too many", ("pass",), None, runs(lambda number: number + 1))
    yield Breakage("passes", "one pass too few", ("pass",), None,
                   runs(lambda number: max(1, number - 1)))
    yield Breakage("passes", "each visitor counts twice", ("pass",), None,
                   wrapping(Runner, "_pass", counts_twice))
    yield Breakage("passes", "the exit code is another", ("exit code",), None,
                   wrapping(Runner, "run", lambda method, self: 3 - method(self)))
    yield Breakage("passes", "a request follows the end of the run", ("the end",), None,
                   wrapping(Runner, "run", asks_after_the_end))
    for ticks in (3, 40, 90):
        for what, then in (("ends by itself", lambda: True), ("crashes", crash)):
            yield Breakage("passes", "the controller {} after {} ticks".format(what, ticks),
                           ("the controller",), None, after_ticks(ticks, then))
    yield Breakage("passes", "no pause after a pass that failed for a cause that persists",
                   ("pause", "pass"), None,
                   wrapping(RetryGate, "cause", lambda method, *given: None))
    for what, change in PAUSES:
        yield Breakage("passes", "the pause after such a pass is " + what, ("pause", "pass"), None,
                       wrapping(Policy, "pause", change))


FAMILIES: Tuple[Callable[[Catalogue], Iterator[Breakage]], ...] = (
    changed_requests, asked_otherwise, wrong_results, wrong_writes, wrong_order, wrong_controls,
    wrong_exhibits, wrong_times, wrong_rules, wrong_recoveries, wrong_safe_states, wrong_answers,
    wrong_numbers, wrong_gateway, wrong_encodings, wrong_records, wrong_course, wrong_missions)


def breakages(known: Catalogue) -> List[Breakage]:
    """Return all mistakes that can be made in the mission."""
    return [breakage for family in FAMILIES for breakage in family(known)]
