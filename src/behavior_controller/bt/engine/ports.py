"""Ports: what an attribute of a node means (a reference to an entry, or a literal), and how to read
and write it."""
from typing import Any, Dict, Iterable, List, Optional, Tuple

from behavior_controller.bt.values import values
from behavior_controller.bt.values.blackboard import Blackboard, Entry
from behavior_controller.bt.values.values import Enums, GENERIC, TYPES, ValueFault
from behavior_controller.bt.engine.registry import Port

_BLANKS = " \t\n\r"


class PortError(ValueFault):
    """A port cannot be read or written; the text says which and why."""


class NoValue(PortError):
    """The entry of an input port does not exist or is empty."""


class TypeClash(PortError):
    """A port refers to an entry of another type."""

    def __init__(self, key: str, entry: Entry, port: Port):
        own = f"the port [{port.name}] here has type [{port.type}]"
        super().__init__(f"the entry [{key}] has type [{entry.type}], and {own}")
        self.entry, self.port = entry, port


def reference(text: str, port_name: str) -> Optional[str]:
    """Return the entry that an attribute refers to (``{key}``; ``{=}`` and ``=`` mean the port's
    own name), or None."""
    if text == "=":
        return port_name
    if "{" not in text:  # as of almost every literal
        return None
    inner = text.strip(_BLANKS)
    if inner == "{=}":
        return port_name
    if len(inner) >= 3 and inner[0] == "{" and inner[-1] == "}":
        return inner[1:-1]
    return None


def defaults(declared: Iterable[Port]) -> Dict[str, str]:
    """Return the attributes that a node has without being given them: the defaults that are
    entries."""
    return {port.name: port.default for port in declared
            if port.default is not None and reference(port.default, port.name) is not None}


def literal_fault(text: str, port: Port, enums: Enums) -> Optional[str]:
    """Return what is wrong with the text of a port as the load-time check sees it, or None.

    That check takes for a reference only what has braces as its first and last character, so `` {k}
    `` is refused for an ``int`` port although reading it would work.
    """
    is_reference = len(text) >= 3 and text[0] == "{" and text[-1] == "}"
    try:
        if TYPES[port.type].checked_at_load and not is_reference:
            TYPES[port.type].from_text(text, enums)
    except ValueFault as fault:
        return str(fault)
    return None


def entry_value(text: str, port_name: str, blackboard: Blackboard) -> Any:
    """Return the value of the entry that ``text`` refers to. Raises PortError if there is none or
    it is empty."""
    key = reference(text, port_name)
    entry = blackboard.read(key or "")
    if entry is None:
        raise NoValue(f"port [{port_name}]: the blackboard has no entry [{key}]")
    if entry.value is None:
        raise NoValue(f"port [{port_name}]: the entry [{key}] is empty")
    return entry.value


def read(text: str, port: Port, blackboard: Blackboard, enums: Enums) -> Any:
    """Return the value of an input port whose attribute (or default) is ``text``. Raises PortError.
    """
    try:
        if reference(text, port.name) is None:
            return TYPES[port.type].from_text(text, enums)
        return values.convert(entry_value(text, port.name, blackboard), port.type, enums)
    except PortError:
        raise
    except ValueFault as fault:
        raise PortError(f"port [{port.name}]: {fault}") from fault


def write(text: str, port: Port, blackboard: Blackboard, value: Any) -> None:
    """Write through an output port whose attribute is ``text``. Raises PortError."""
    key = reference(text, port.name)
    if key is None:
        raise PortError(
            f"port [{port.name}] is the literal [{text}]; only an entry {{name}} can be written")
    try:
        blackboard.set(key, values.declared(value, port.type), port.type)
    except ValueFault as fault:
        raise PortError(f"port [{port.name}]: {fault}") from fault


def clear(text: str, port: Port, blackboard: Blackboard) -> None:
    """Empty the entry that an output port refers to, if there is one."""
    entry = blackboard.find(reference(text, port.name) or "")
    if entry is not None:
        entry.clear()


def declare(text: str, port: Port, blackboard: Blackboard) -> None:
    """Make the entry that an attribute refers to, empty and of the port's type. Raises TypeClash,
    or PortError."""
    key = reference(text, port.name)
    if key is None:
        return
    if key.count("@") > 1:
        raise PortError(f"Character '@' used multiple times in the key [{key}]")
    entry = blackboard.find(key)
    if entry is None:
        blackboard.create(key, port.type)
    elif (entry.type != port.type and entry.type not in GENERIC + (values.TEXT,)
          and port.type not in GENERIC):
        raise TypeClash(key, entry, port)


def subtree_reference(text: Optional[str], name: str) -> Optional[str]:
    """Return the entry that an attribute of a SubTree refers to, or None; there a sole ``=`` is a
    literal."""
    if text is None or text == "=":
        return None
    return reference(text, name)


def subtree_literal(text: str) -> Tuple[str, Any]:
    """Return the type and value that a literal attribute of a SubTree gets by its appearance
    (BT.CPP section 10)."""
    for name, bounds in (("int", values.INT), ("int64", values.INT64)):
        integer = values.whole_integer(text, *bounds)
        if integer is not None:
            return name, integer
    real = values.whole_real(text)
    if real is not None:
        return "double", real
    return values.TEXT, text


def loop_items(text: str, item_type: str) -> List[Any]:
    """Return the items of a Loop's queue, which ``;`` separates. Raises ValueFault."""
    return [TYPES[item_type].from_text(item, {}) for item in values.items_of(text)]


def same_text_or_number(left: str, right: str, enums: Enums) -> bool:
    """Return whether Switch holds two texts for equal: as text, as integers, or as reals; the name
    of an enum is its number."""
    if left == right:
        return True
    left, right = (str(int(enums[text])) if text in enums else text for text in (left, right))
    a, b = (values.whole_integer(text, *values.INT) for text in (left, right))
    if a is not None and b is not None:
        return a == b
    x, y = (values.whole_real(text) for text in (left, right))
    return x is not None and y is not None and abs(x - y) <= values.EPSILON
