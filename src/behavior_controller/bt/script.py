"""BehaviorTree.CPP's scripting language: text to a closure that runs on a blackboard (BT.CPP section 11).

Evaluating is plain: each grammar rule returns a function of (blackboard, enums). Nothing of Python can be reached.
"""
import operator
import re
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Set, Tuple

from behavior_controller.bt import values
from behavior_controller.bt.blackboard import Blackboard, Entry
from behavior_controller.bt.values import Enums, ValueFault, is_number, to_bool, to_real
from behavior_controller.errors import BehaviorControllerError

__all__ = ["Script", "ScriptError", "ScriptSyntaxError", "compile_script", "to_bool"]

Evaluate = Callable[[Blackboard, Enums], Any]
DEEPEST = 60  # levels of nesting; a parenthesis takes eleven Python frames when the script is read; 1,000 are allowed


class ScriptSyntaxError(BehaviorControllerError):
    """A script cannot be read; the text is the reason, positions count from 0 in the script."""


class ScriptError(BehaviorControllerError):
    """A script failed while it ran."""


class Token(NamedTuple):
    """One word of a script."""

    kind: str  # "integer", "real", "text", "name", "operator", "end"
    text: str
    position: int


_TOKEN = re.compile(r"""
    (?P<blank>[ \t\r\n]+)
  | (?P<real>\d+(?:\.\d+(?:[eE][+-]?\d+)?|[eE][+-]?\d+))
  | (?P<integer>0[xX][0-9a-fA-F]+|\d+)
  | (?P<text>'[^']*')
  | (?P<name>[A-Za-z_@][A-Za-z0-9_]*)
  | (?P<operator>\.\.|&&|\|\||==|!=|<=|>=|:=|\+=|-=|\*=|/=|[-+*/&|^~!<>=?:();])
""", re.VERBOSE)

_ASSIGNMENTS = (":=", "=", "+=", "-=", "*=", "/=")
_COMPARISONS = ("==", "!=", "<", ">", "<=", ">=")
# the left-associative levels, weakest first
_LEVELS: Tuple[Tuple[str, ...], ...] = (
    ("||",), ("&&",), _COMPARISONS, ("|", "^"), ("&",), ("+", "-", ".."), ("*", "/"))


def _tokens(text: str) -> List[Token]:
    found: List[Token] = []
    position = 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise ScriptSyntaxError("Invalid token '{}' at position {}".format(text[position], position))
        kind, end = str(match.lastgroup), match.end()
        if kind in ("real", "integer") and _number_goes_on(text, end):
            raise ScriptSyntaxError("Invalid token '{}' at position {}".format(text[position:end + 1], position))
        if kind != "blank":
            found.append(Token(kind, match.group(), position))
        position = end
    found.append(Token("end", "", len(text)))
    return found


def _number_goes_on(text: str, end: int) -> bool:
    """Return whether a number is followed by what cannot follow one: a letter, or a dot that is not ``..``."""
    following = text[end:end + 1]
    return (following.isalnum() and following.isascii()) or following in ("_", "@") and following != "" or (
        following == "." and text[end:end + 2] != "..")


# ------------------------------------------------------------------------------------------------------------ operators


def _both(left: Any, right: Any, sign: str) -> None:
    if left is None:
        raise ScriptError("The left operand of the operator [{}] is not initialized".format(sign))
    if right is None:
        raise ScriptError("The right operand of the operator [{}] is not initialized".format(sign))


def _divide(left: float, right: float) -> float:
    if right != 0.0:
        return left / right
    if left == 0.0 or left != left:
        return float("nan")
    negative = (left < 0.0) != (str(right)[0] == "-")
    return float("-inf") if negative else float("inf")


def _multiply(left: float, right: float) -> float:
    return left * right


_ARITHMETIC: Dict[str, Callable[[float, float], float]] = {
    "+": operator.add, "-": operator.sub, "*": _multiply, "/": _divide}
_BITWISE: Dict[str, Callable[[int, int], int]] = {"&": operator.and_, "|": operator.or_, "^": operator.xor}


def _binary(sign: str, left: Any, right: Any) -> Any:
    """Return the value of ``left sign right`` for every operator but comparisons."""
    _both(left, right, sign)
    if sign in ("&&", "||"):
        return _logic(sign, left, right)
    if is_number(left) and is_number(right) and sign != "..":
        if sign in _ARITHMETIC:
            return _ARITHMETIC[sign](to_real(left), to_real(right))
        return float(_wrapped(_BITWISE[sign](values.to_int(left), values.to_int(right))))
    if isinstance(left, str) and isinstance(right, str) and sign in ("+", ".."):
        return left + right
    if sign == "..":
        return _concatenated(left, right)
    raise ScriptError("Operation not permitted: [{}] on {} and {}".format(sign, _kind(left), _kind(right)))


def _wrapped(value: int) -> int:
    return (value + 2 ** 63) % 2 ** 64 - 2 ** 63


def _concatenated(left: Any, right: Any) -> Any:
    if is_number(left) and is_number(right):
        return None
    if all(is_number(side) or isinstance(side, str) for side in (left, right)):
        return values.to_text(left) + values.to_text(right)
    raise ScriptError("Operation not permitted: [..] on {} and {}".format(_kind(left), _kind(right)))


def _logic(sign: str, left: Any, right: Any) -> float:
    try:
        truths = (to_bool(left), to_bool(right))
    except ValueFault as fault:
        raise ScriptError("Logic operators are not allowed if one of the operands is not castable to bool: {}".format(
            fault)) from fault
    return float(all(truths) if sign == "&&" else any(truths))


def _kind(value: Any) -> str:
    return "a text" if isinstance(value, str) else "a number" if is_number(value) else "something else"


def _text_to_number(text: str, enums: Enums) -> float:
    if text in ("true", "false"):
        return float(text == "true")
    if text in enums:
        return float(enums[text])
    try:
        return values.real_from_text(text)
    except ValueFault as fault:
        raise ScriptError("Any failed string to number conversion: {}".format(fault)) from fault


_COMPARE: Dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}


def _compare(sign: str, left: Any, right: Any, enums: Enums) -> bool:
    _both(left, right, sign)
    if isinstance(left, str) and isinstance(right, str):
        return _COMPARE[sign](left, right)
    if isinstance(left, str):
        left = _text_to_number(left, enums)
    if isinstance(right, str):
        right = _text_to_number(right, enums)
    if not is_number(left) or not is_number(right):
        raise ScriptError("Can't mix different types in Comparison. Left operand {}, right operand {}".format(
            _kind(left), _kind(right)))
    left, right = to_real(left), to_real(right)
    if sign in ("==", "!="):
        return (abs(left - right) <= values.EPSILON or left == right) is (sign == "==")
    return _COMPARE[sign](left, right)


# ----------------------------------------------------------------------------------------------------------- the parser


class _Parser:
    """Recursive descent over the tokens of one script. ``read`` and ``written`` collect the names used."""

    def __init__(self, text: str):
        self.tokens = _tokens(text)
        self.at = 0
        self.depth = 0
        self.read: Set[str] = set()
        self.written: Set[str] = set()

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def script(self) -> List[Evaluate]:
        """Return one closure for each statement; the semicolon between statements is optional."""
        if self.token.kind == "end":
            raise ScriptSyntaxError("Empty Script")
        statements = []
        while self.token.kind != "end":
            statements.append(self.expression())
            while self.token.text == ";" and self.token.kind == "operator":
                self.at += 1
        return statements

    def expression(self) -> Evaluate:
        """Return an assignment, or what a ternary gives."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise ScriptSyntaxError("Nested too deeply at position {}: at most {} levels are allowed".format(
                self.token.position, DEEPEST))
        start = self.token
        left = self.binary(0)
        if self._is_operator(_ASSIGNMENTS):
            sign = self._next().text
            name = start.text if self.tokens[self.at - 2] is start and _is_variable(start) else None
            left = self._assignment(name, sign, self.expression())
        elif self._is_operator(("?",)):
            left = self._ternary(left)
        self.depth -= 1
        return left

    def _assignment(self, name: Optional[str], sign: str, right: Evaluate) -> Evaluate:
        if name is None:
            return _no_entry
        self.written.add(name)
        if sign not in (":=", "="):
            self.read.add(name)
        return lambda blackboard, enums: _assign(name, sign, right, blackboard, enums)

    def _ternary(self, condition: Evaluate) -> Evaluate:
        """Return ``condition ? expression : …``; what follows the colon may be such a choice, no assignment."""
        choices = []
        while True:
            self._next()
            choices.append((condition, self.expression()))
            if not self._is_operator((":",)):
                raise ScriptSyntaxError("Parse error at position {}: expected ':' in ternary expression (got '{}')".format(
                    self.token.position, self.token.text))
            self._next()
            condition = self.binary(0)
            if not self._is_operator(("?",)):
                return _choice(choices, condition)

    def binary(self, level: int) -> Evaluate:
        """Return a chain of operators of one level, or what the next level gives."""
        if level == len(_LEVELS):
            return self.prefix()
        first = self.binary(level + 1)
        rest: List[Tuple[str, Evaluate]] = []
        while self._is_operator(_LEVELS[level]):
            sign = self._next().text
            rest.append((sign, self.binary(level + 1)))
        if not rest:
            return first
        return _comparison_chain(first, rest) if _LEVELS[level] is _COMPARISONS else _fold(first, rest)

    def prefix(self) -> Evaluate:
        """Return ``-x``, ``~x``, ``!x`` (which may be stacked), or an operand."""
        signs = []
        while self._is_operator(("-", "~", "!")):
            signs.append(self._next().text)
        operand = self.operand()
        if not signs:
            return operand
        signs.reverse()

        def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
            value = operand(blackboard, enums)
            for sign in signs:
                value = _unary(sign, value)
            return value
        return evaluate

    def operand(self) -> Evaluate:
        """Return a literal, a name, or an expression in parentheses."""
        token = self._next()
        if token.kind in _LITERALS:
            value = _LITERALS[token.kind](token.text)
            return lambda _blackboard, _enums: value
        if token.kind == "name":
            return self._name(token.text)
        if token.text == "(" and token.kind == "operator":
            inner = self.expression()
            if not self._is_operator((")",)):
                raise ScriptSyntaxError("Parse error at position {}: expected ')' (got '{}')".format(
                    self.token.position, self.token.text))
            self._next()
            return inner
        raise ScriptSyntaxError("Expected operand at position {} (got '{}')".format(token.position, token.text))

    def _name(self, name: str) -> Evaluate:
        if name in ("true", "false"):
            truth = float(name == "true")
            return lambda _blackboard, _enums: truth
        if not self._is_operator(_ASSIGNMENTS):
            self.read.add(name)
        return lambda blackboard, enums: _value_of(name, blackboard, enums)

    def _is_operator(self, signs: Tuple[str, ...]) -> bool:
        token = self.tokens[self.at]
        return token.kind == "operator" and token.text in signs

    def _next(self) -> Token:
        token = self.tokens[self.at]
        if token.kind != "end":
            self.at += 1
        return token


def _choice(choices: List[Tuple[Evaluate, Evaluate]], otherwise: Evaluate) -> Evaluate:
    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        for condition, chosen in choices:
            if _is_chosen(condition(blackboard, enums)):
                return chosen(blackboard, enums)
        return otherwise(blackboard, enums)
    return evaluate


def _is_variable(token: Token) -> bool:
    return token.kind == "name" and token.text not in ("true", "false")


def _integer(text: str) -> int:
    # an integer that does not fit is 0, as in the library; counting digits first keeps huge ones cheap
    if len(text) > 22:
        return 0
    value = int(text, 16) if text[:2] in ("0x", "0X") else int(text)
    return value if value < 2 ** 63 else 0


_LITERALS: Dict[str, Callable[[str], Any]] = {"integer": _integer, "real": float, "text": lambda text: text[1:-1]}


def _fold(first: Evaluate, rest: List[Tuple[str, Evaluate]]) -> Evaluate:
    def evaluate(blackboard: Blackboard, enums: Enums) -> Any:
        value = first(blackboard, enums)
        for sign, operand in rest:
            value = _binary(sign, value, operand(blackboard, enums))
        return value
    return evaluate


def _comparison_chain(first: Evaluate, rest: List[Tuple[str, Evaluate]]) -> Evaluate:
    def evaluate(blackboard: Blackboard, enums: Enums) -> float:
        left = first(blackboard, enums)
        for sign, operand in rest:
            right = operand(blackboard, enums)
            if not _compare(sign, left, right, enums):
                return 0.0
            left = right
        return 1.0
    return evaluate


def _unary(sign: str, value: Any) -> float:
    if value is None:
        raise ScriptError("The right operand of the operator [{}] is not initialized".format(sign))
    if not is_number(value):
        raise ScriptError("Invalid operator [{}] for {}".format(sign, _kind(value)))
    if sign == "!":
        return float(to_real(value) == 0.0)
    if sign == "-":
        return -to_real(value)
    real = to_real(value)
    return float(~int(real)) if abs(real) < 2 ** 63 else float(-2 ** 63)


def _is_chosen(value: Any) -> bool:
    if value is None:
        raise ScriptError("The left operand of the operator [?] is not initialized")
    if isinstance(value, str):
        try:
            return values.real_from_text(value) != 0.0
        except ValueFault as fault:
            raise ScriptError(str(fault)) from fault
    if not is_number(value):
        raise ScriptError("The condition of ?: must be a number, not {}".format(_kind(value)))
    return value != 0


def _value_of(name: str, blackboard: Blackboard, enums: Enums) -> Any:
    if name in enums:
        return float(enums[name])
    entry = blackboard.find(name)
    if entry is None:
        raise ScriptError("Variable not found: {}".format(name))
    return entry.value


def _no_entry(_blackboard: Blackboard, _enums: Enums) -> Any:
    raise ScriptError("Assignment left operand not a blackboard entry")


def _assign(name: str, sign: str, right: Evaluate, blackboard: Blackboard, enums: Enums) -> Any:
    """Assign as BT.CPP does: the first value decides an entry's kind for good."""
    entry = blackboard.find(name)
    if entry is None:
        if sign != ":=":
            raise ScriptError("The blackboard entry [{}] doesn't exist, yet. If you want to create a new one, "
                              "use the operator [:=] instead of [{}]".format(name, sign))
        entry = blackboard.create(name)
    value = right(blackboard, enums)
    if sign in (":=", "="):
        if value is None:
            raise ScriptError("The right operand of the operator [{}] is not initialized".format(sign))
        _store(name, entry, value, enums)
    else:
        _both(entry.value, value, sign)
        if not (is_number(entry.value) and is_number(value)) and not (
                sign == "+=" and isinstance(entry.value, str) and isinstance(value, str)):
            raise ScriptError("Operation not permitted: [{}] on {} and {}".format(
                sign, _kind(entry.value), _kind(value)))
        entry.update(_binary(sign[0], entry.value, value))
    return entry.value


def _store(name: str, entry: Entry, value: Any, enums: Enums) -> None:
    if entry.value is None and entry.type == values.ANY:
        entry.replace(value)
    elif isinstance(value, str) and not isinstance(entry.value, str):
        converted = entry.from_text(value)
        if converted is None:
            if not is_number(entry.value):
                raise ScriptError("Error assigning a text to entry [{}] with type [{}]".format(name, entry.type))
            converted = _text_to_number(value, enums)
        entry.replace(converted, entry.origin)
    else:
        try:
            entry.update(value)
        except ValueFault as fault:
            raise ScriptError("Error assigning a value to entry [{}] with type [{}]: {}".format(
                name, entry.type, fault)) from fault


class Script:
    """A script ready to run. ``read`` and ``written`` are the names of entries that it uses."""

    def __init__(self, text: str, statements: List[Evaluate], read: Set[str], written: Set[str]):
        self.text = text
        self.read = read
        self.written = written
        self._statements = statements

    def run(self, blackboard: Blackboard, enums: Enums) -> Any:
        """Run every statement and return the last one's value. Raises ScriptError or ValueFault; nothing is undone."""
        if not self._statements:
            raise ScriptError("bad_function_call: the script is empty")
        value = None
        try:
            for statement in self._statements:
                value = statement(blackboard, enums)
        except ScriptError as error:
            raise ScriptError("Error in script [{}]: {}".format(self.text, error)) from error
        return value


def compile_script(text: str, allow_empty: bool = False) -> Script:
    """Return ``text`` as a Script. Raises ScriptSyntaxError. ``allow_empty``: an empty one fails when it runs."""
    if allow_empty and not text:
        return Script(text, [], set(), set())
    parser = _Parser(text)
    statements = parser.script()
    return Script(text, statements, parser.read, parser.written)
