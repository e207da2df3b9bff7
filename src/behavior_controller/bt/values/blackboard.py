"""The blackboard: typed entries by name, one storage for each tree instance, linked by remapping
(BT.CPP section 9)."""
from typing import Any, Dict, Iterator, Optional, Tuple

from behavior_controller.bt.values import values
from behavior_controller.bt.values.values import ANY, BT_ANY, GENERIC, TEXT, ValueFault


class Entry:
    """One entry. ``value`` None is empty; ``origin`` is the type the value had when it was first
    stored; ``root`` is the blackboard that counts the writes.

    ``is_read``: its value, or that there is none, was read since it was last written.
    """

    __slots__ = ("type", "value", "origin", "sequence", "is_read", "_root")

    def __init__(self, entry_type: str, root: "Blackboard"):
        self.type = entry_type
        self.value: Any = None
        self.origin = ""
        self.sequence = 0  # grows by 1 with every write, same value or not
        self.is_read = True  # a node may have looked for it in vain
        self._root = root

    def replace(self, value: Any, origin: str = "") -> None:
        """Store ``value`` unchanged; ``origin`` is its type if that differs from the value's own.
        """
        self.value = values.stored(value)
        self.origin = origin or values.origin_of(self.value)
        self._written()

    def update(self, value: Any, origin: str = "") -> None:
        """Store ``value`` in the kind of the stored value, or unchanged in an empty entry. Raises
        ValueFault."""
        if self.value is None:
            self.replace(value, origin)
        else:
            self.value = values.same_kind(values.stored(value), self.value)
            self._written()

    def clear(self) -> None:
        """Make the entry empty; its type stays."""
        self.value = None
        self._written()

    def _written(self) -> None:
        self.sequence += 1
        self._root.note_write(self)

    def from_text(self, text: str) -> Any:
        """Return ``text`` in the entry's type, or None if the type has no conversion. Raises
        ValueFault."""
        kind = values.find_type(self.type)
        if kind is None or self.type in GENERIC:
            return None
        return kind.from_text(text, {})


class Blackboard:
    """The entries of one tree instance. A key that is remapped lives in the parent; ``@key`` lives
    in the root. ``path`` is that of the SubTree, "" at the root."""

    def __init__(self, parent: Optional["Blackboard"] = None, path: str = ""):
        self.parent, self.path = parent, path
        self.prefix = path and path + "/"  # of the paths of what is inside
        self.root: Blackboard = self if parent is None else parent.root
        # of the whole tree, at its root:
        self.write_count, self.is_stale = 0, False
        """An entry was written whose former value a node has read."""
        self.local: Dict[str, Entry] = {}
        self.remapping: Dict[str, str] = {}  # names here -> names in the parent
        self.autoremap = False

    @property
    def writes(self) -> int:
        """How often entries of this tree were written or removed so far: a tick that writes may
        change the effect of another tick."""
        return self.root.write_count

    def note_write(self, entry: Entry) -> None:
        """Note, at the root, that an entry was written or removed."""
        self.write_count += 1
        self.is_stale |= entry.is_read
        entry.is_read = False

    def read(self, key: str) -> Optional[Entry]:
        """Return the entry that ``key`` means here, or None, for a node that acts on its value."""
        entry = self.find(key)
        if entry is not None:
            entry.is_read = True
        return entry

    def find(self, key: str) -> Optional[Entry]:
        """Return the entry that ``key`` means here, or None."""
        entry = self.local.get(key)
        if entry is None:
            board, key = self.home(key)
            entry = board.local.get(key)
        return entry

    def home(self, key: str) -> Tuple["Blackboard", str]:
        """Return the blackboard that holds, or would hold, the entry that ``key`` means here, and
        its name there."""
        board = self
        if key[:1] == "@":
            board, key = self.root, key.lstrip("@")
        while board.parent is not None and key not in board.local:
            outer = board.remapping.get(key)
            if outer is None:
                if not board.autoremap or key[:1] == "_":
                    break
                outer = key
            board = board.parent
            if outer[:1] == "@":
                board, outer = board.root, outer.lstrip("@")
            key = outer
        return board, key

    def create(self, key: str, entry_type: str = ANY) -> Entry:
        """Return the entry; a new one is made at the end of the chain of remappings. Raises
        ValueFault on a type conflict."""
        board, key = self.home(key)
        entry = board.local.get(key)
        if entry is None:
            entry = board.local[key] = Entry(entry_type, self.root)
        elif entry.type != entry_type and {entry.type, entry_type}.isdisjoint(GENERIC):
            raise _changed_type(f"Blackboard entry [{key}]", entry, entry_type)
        return entry

    def get(self, key: str, default: Any = None) -> Any:
        """Return the value of ``key``, or ``default`` if it has none."""
        entry = self.read(key)
        return default if entry is None or entry.value is None else entry.value

    def __getitem__(self, key: str) -> Any:
        """Return the value of ``key``. Raises KeyError if it has none."""
        value = self.get(key)
        if value is None:
            raise KeyError(key)
        return value

    def __setitem__(self, key: str, value: Any) -> None:
        self.set(key, value)

    def __contains__(self, key: object) -> bool:
        return isinstance(key, str) and self.get(key) is not None

    def __iter__(self) -> Iterator[str]:
        """Yield the entries that live here and have a value."""
        return (key for key, entry in self.local.items() if entry.value is not None)

    def set(self, key: str, value: Any, value_type: Optional[str] = None) -> None:
        """Write as a port or the host does (BT.CPP ``Blackboard::set``). Raises ValueFault on a
        type clash.

        ``value_type`` is the type of the writer; without one, or a generic one, it follows from
        the value.
        """
        if key[:1] == "@":
            self.root.set(key[1:], value, value_type)
            return
        if value_type is None or value_type in GENERIC:
            value_type = _natural_type(value)
        entry = self.local.get(key)
        if entry is None:
            self.create(key, ANY if value_type == TEXT else value_type).replace(value, value_type)
        elif entry.type in GENERIC:
            entry.type = value_type
            entry.replace(value, value_type)
        else:
            entry.update(*_fitting(key, entry, value, value_type))

    def set_any(self, key: str, value: Any, origin: str) -> None:
        """Write a value whose type is known only now (BT.CPP ``Blackboard::set<Any>``). Raises
        ValueFault."""
        if key[:1] == "@":
            self.root.set_any(key[1:], value, origin)
            return
        entry = self.local.get(key)
        if entry is None:
            self.create(key, origin).replace(value, origin)
        else:
            if entry.type in GENERIC:
                entry.type = BT_ANY
            elif entry.type != origin:
                raise _changed_type(f"Blackboard::set({key})", entry, BT_ANY)
            entry.replace(value, origin)

    def unset(self, key: str) -> None:
        """Remove ``key`` from the storage here only; nothing happens if it does not exist."""
        entry = self.local.pop(key, None)
        if entry is not None:
            self.root.note_write(entry)


def _natural_type(value: Any) -> str:
    if isinstance(value, bool):
        return "bool"
    if isinstance(value, int) and values.INT[0] <= value <= values.INT[1]:
        return "int"
    return values.origin_of(value)


def _fitting(key: str, entry: Entry, value: Any, value_type: str) -> Tuple[Any, str]:
    """Return ``value``, and the type it has, as a typed entry takes it from a writer. Raises
    ValueFault."""
    if entry.type != value_type:
        if value_type == TEXT:
            converted = entry.from_text(value)
            if converted is not None:
                return converted, entry.type
        if not _fits(entry.type, value):
            raise _changed_type(f"Blackboard::set({key})", entry, value_type)
    return value, value_type


def _fits(entry_type: str, value: Any) -> bool:
    """Return whether ``value`` survives the way into a type of other size or kind and back, or has
    the right items.

    An entry that the host made without a type has the name of a Python class as its type.
    """
    target = values.find_type(entry_type)
    if target is None:
        return type(value).__name__ == entry_type
    if (values.is_vector(value, entry_type)
            or target.python is not None and isinstance(value, target.python)):
        return True
    try:
        if entry_type == "double":
            return int(values.to_real(value)) == value
        return target.limits is not None and values.to_int(value, *target.limits) == value
    except ValueFault:
        return False


def _changed_type(where: str, entry: Entry, value_type: str) -> ValueFault:
    types = f"Previously declared type [{entry.type}], current type [{value_type}]"
    return ValueFault(f"{where}: once declared, the type of a port shall not change. {types}")
