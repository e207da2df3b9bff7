"""What the operators of a script do with values (BT.CPP section 11.3), and the closures that apply
them.

A closure is a function of (blackboard, enums). Operators of one level are applied in a loop, so
that a long sum is not a deep one.
"""
import math
import operator
from typing import Any, Callable, Dict, List, Tuple

from behavior_controller.bt.values import values
from behavior_controller.bt.values.blackboard import Blackboard, Entry
from behavior_controller.bt.values.values import Enums, ValueFault, is_number, to_bool, to_real
from behavior_controller.errors import BehaviorControllerError

Evaluate = Callable[[Blackboard, Enums], Any]
Operate = Callable[[Any, Any], Any]
# the operators of one level after the first operand, each with its right operand
Rest = List[Tuple[str, Evaluate]]

# characters: a script that doubles a text at every tick must not take all memory
LONGEST_TEXT = 1_000_000


class ScriptError(BehaviorControllerError):
    """A script failed while it ran."""


def _not_empty(value: Any, side: str, sign: str) -> None:
    """Raise ScriptError if the operand of ``sign`` on this side is empty."""
    if value is None:
        raise ScriptError(f"The {side} operand of the operator [{sign}] is not initialized")


def _kind(value: Any) -> str:
    """Return what a message calls ``value``."""
    if isinstance(value, str):
        return "a text"
    return "a number" if is_number(value) else type(value).__name__


def _not_permitted(sign: str, left: Any, right: Any) -> ScriptError:
    _not_empty(left, "left", sign)
    _not_empty(right, "right", sign)
    return ScriptError(f"Operation not permitted: [{sign}] on {_kind(left)} and {_kind(right)}")


def _on_numbers(sign: str, apply: Operate, converted: Callable[[Any], Any] = to_real,
                refused: str = "") -> Operate:
    """Return an operator on numbers, which are ``converted`` first; if they cannot be, a message
    begins with ``refused``."""
    def operate(left: Any, right: Any) -> float:
        if not is_number(left) or not is_number(right):
            raise _not_permitted(sign, left, right)
        try:
            return float(apply(converted(left), converted(right)))
        except ValueFault as fault:
            raise ScriptError(f"{refused}{fault}") from fault
    return operate


_sum = _on_numbers("+", operator.add)


def _add(left: Any, right: Any) -> Any:
    are_texts = isinstance(left, str) and isinstance(right, str)
    return _joined(left, right) if are_texts else _sum(left, right)


def _joined(left: str, right: str) -> str:
    if len(left) + len(right) > LONGEST_TEXT:
        raise ScriptError(f"a text of more than {LONGEST_TEXT} characters would result")
    return left + right


def _quotient(left: float, right: float) -> float:
    if right != 0.0:
        return left / right
    if left == 0.0 or left != left:
        return math.nan
    # there is a zero of either sign
    return math.copysign(math.inf, left) * math.copysign(1.0, right)


def _concatenate(left: Any, right: Any) -> Any:
    if is_number(left) and is_number(right):
        return None  # as in the library: not even an error
    if all(is_number(side) or isinstance(side, str) for side in (left, right)):
        return _joined(values.to_text(left), values.to_text(right))
    raise _not_permitted("..", left, right)


def _bits(value: Any) -> int:
    return values.to_int(to_real(value))  # one that is no real is refused too


_NO_INTEGER = "Binary operators are not allowed if one of the operands is not an integer: "
_NO_TRUTH = "Logic operators are not allowed if one of the operands is not castable to bool: "
_OPERATE: Dict[str, Operate] = {
    "+": _add,
    "-": _on_numbers("-", operator.sub),
    "*": _on_numbers("*", operator.mul),
    "/": _on_numbers("/", _quotient),
    "..": _concatenate,
    "&": _on_numbers("&", operator.and_, _bits, _NO_INTEGER),
    "|": _on_numbers("|", operator.or_, _bits, _NO_INTEGER),
    "^": _on_numbers("^", operator.xor, _bits, _NO_INTEGER),
    "&&": _on_numbers("&&", operator.and_, to_bool, _NO_TRUTH),
    "||": _on_numbers("||", operator.or_, to_bool, _NO_TRUTH)}


def folded(first: Evaluate, rest: Rest) -> Evaluate:
    """Return the closure of a chain of operators of one level, which are applied from the left."""
    steps = [(_OPERATE[sign], operand) for sign, operand in rest]
    if len(steps) == 1:
        apply, second = steps[0]
        return lambda blackboard, enums: apply(first(blackboard, enums), second(blackboard, enums))

    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        value = first(blackboard, enums)
        for apply, operand in steps:
            value = apply(value, operand(blackboard, enums))
        return value
    return evaluate


# -------------------------------------------------------------------------------------- comparisons


def text_to_number(text: str, enums: Enums) -> float:
    """Return the number that a text means beside a number: a truth, an enumerator, or its start.
    Raises ValueFault."""
    if text in ("true", "false"):
        return float(text == "true")
    if text in enums:
        return float(enums[text])
    return values.real_from_text(text)


# for texts too: Python orders them by code point, which is the order of their UTF-8 bytes
_ORDER: Dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le,
    ">=": operator.ge}
_OF_NUMBERS = dict(_ORDER, **{
    "==": lambda left, right: abs(left - right) <= values.EPSILON,
    "!=": lambda left, right: not abs(left - right) <= values.EPSILON})


def _holds(sign: str, left: Any, right: Any, enums: Enums) -> bool:
    if type(left) is float and type(right) is float:
        return _OF_NUMBERS[sign](left, right)
    _not_empty(left, "left", sign)
    _not_empty(right, "right", sign)
    if isinstance(left, str) and isinstance(right, str):
        return _ORDER[sign](left, right)
    if isinstance(left, str) and is_number(right):
        left = text_to_number(left, enums)
    elif isinstance(right, str) and is_number(left):
        right = text_to_number(right, enums)
    if not is_number(left) or not is_number(right):
        operands = f"Left operand {_kind(left)}, right operand {_kind(right)}"
        raise ScriptError(f"Can't mix different types in Comparison. {operands}")
    return _OF_NUMBERS[sign](to_real(left), to_real(right))


def compared(first: Evaluate, rest: Rest) -> Evaluate:
    """Return the closure of ``a < b < c``: false at the first link that does not hold; the rest is
    not evaluated."""
    def evaluate(blackboard: Blackboard, enums: Enums) -> float:
        left = first(blackboard, enums)
        for sign, operand in rest:
            right = operand(blackboard, enums)
            if not _holds(sign, left, right, enums):
                return 0.0
            left = right
        return 1.0
    return evaluate


# ----------------------------------------------------------------------------- signs and conditions


def _unary(sign: str, value: Any) -> float:
    _not_empty(value, "right", sign)
    if not is_number(value):
        raise ScriptError(f"Invalid operator [{sign}] for {_kind(value)}")
    real = to_real(value)
    if sign == "!":
        return float(real == 0.0)
    if sign == "-":
        return -real
    if not abs(real) < 2 ** 63:
        raise ScriptError("Number out of range for bitwise operation")
    return float(~int(real))


def prefixed(signs: List[str], operand: Evaluate) -> Evaluate:
    """Return the closure of an operand with one or more of ``- ~ !`` before it; the nearest is
    applied first."""
    from_nearest = signs[::-1]

    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        value = operand(blackboard, enums)
        for sign in from_nearest:
            value = _unary(sign, value)
        return value
    return evaluate


def _is_chosen(value: Any) -> bool:
    _not_empty(value, "left", "?")
    if isinstance(value, str):
        return values.real_from_text(value) != 0.0
    if not is_number(value):
        raise ScriptError(f"The condition of ?: must be a number, not {_kind(value)}")
    return to_real(value) != 0.0


def chosen(choices: List[Tuple[Evaluate, Evaluate]], otherwise: Evaluate) -> Evaluate:
    """Return the closure of ``condition ? value : condition ? value : … otherwise``; only one value
    is evaluated."""
    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        for condition, value in choices:
            if _is_chosen(condition(blackboard, enums)):
                return value(blackboard, enums)
        return otherwise(blackboard, enums)
    return evaluate


# -------------------------------------------------------------------------------------- assignments


def value_of(name: str) -> Evaluate:
    """Return the closure of a name: enumerators first, then entries."""
    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        if name in enums:
            return float(enums[name])
        entry = blackboard.read(name)
        if entry is None:
            raise ScriptError(f"Variable not found: {name}")
        return entry.value
    return evaluate


def assigned(name: str, sign: str, right: Evaluate, source: str) -> Evaluate:
    """Return the closure of ``name sign right``, whose value is what is stored then; ``name`` is
    empty if the left operand is no name.

    The first value decides an entry's kind permanently. ``source`` is the name that ``right`` is,
    if it is a bare one: a copy keeps the type that the value had there.
    """
    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        if not name:
            raise ScriptError("Assignment left operand not a blackboard entry")
        entry = blackboard.find(name)
        if entry is None and sign != ":=":
            hint = f"If you want to create a new one, use the operator [:=] instead of [{sign}]"
            raise ScriptError(f"The blackboard entry [{name}] doesn't exist, yet. {hint}")
        entry = entry or blackboard.create(name)
        value = right(blackboard, enums)
        _not_empty(value, "right", sign)
        if sign in (":=", "="):
            copied = None if not source or source in enums else blackboard.find(source)
            _store(name, entry, value, enums, "" if copied is None else copied.origin)
        else:
            entry.is_read = True
            entry.update(_combined(sign, entry.value, value))
        return entry.value
    return evaluate


def _combined(sign: str, stored: Any, value: Any) -> Any:
    are_texts = isinstance(stored, str) and isinstance(value, str)
    if is_number(stored) and is_number(value) or sign == "+=" and are_texts:
        return _OPERATE[sign[0]](stored, value)
    raise _not_permitted(sign, stored, value)


def _store(name: str, entry: Entry, value: Any, enums: Enums, origin: str) -> None:
    takes_anything = entry.value is None and entry.type == values.ANY
    try:
        if isinstance(value, str) and not isinstance(entry.value, str) and not takes_anything:
            _store_text(name, entry, value, enums)
        else:
            entry.update(value, origin)
    except ValueFault as fault:
        wrong = f"Error assigning a value to entry [{name}] with type [{entry.type}]"
        raise ScriptError(f"{wrong}: {fault}") from fault


def _store_text(name: str, entry: Entry, text: str, enums: Enums) -> None:
    converted = entry.from_text(text)
    if converted is not None:
        entry.replace(converted, entry.type)
    elif is_number(entry.value):
        entry.replace(text_to_number(text, enums))  # a real from now on
    else:
        raise ScriptError(f"Error assigning a text to entry [{name}] with type [{entry.type}]")
