"""BehaviorTree.CPP's scripting language: text to a closure that runs on a blackboard (BT.CPP
section 11).

Nothing of Python can be reached from a script. Reading one takes time in proportion to its length,
running one too.
"""
import functools
import re
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, NamedTuple, Set, Tuple

from behavior_controller.bt.script import operators
from behavior_controller.bt.values.blackboard import Blackboard
from behavior_controller.bt.script.operators import Evaluate, Rest, ScriptError
from behavior_controller.bt.values.values import Enums, ValueFault, shown, to_bool
from behavior_controller.errors import BehaviorControllerError
from behavior_controller.text import named_letters

__all__ = ["Script", "ScriptError", "ScriptSyntaxError", "compile_script", "to_bool"]

# expressions and operands within one another: each takes at most two of the 1,000 frames that
# Python allows, and a pair of parentheses takes two of these levels
MAX_SCRIPT_DEPTH = 200


class ScriptSyntaxError(BehaviorControllerError):
    """A script cannot be read; the text is the reason, positions count from 0 in the script."""

    def __init__(self, text: str, position: int = 0, hint: str = ""):
        super().__init__(text)
        self.position, self.hint = position, hint


class Operand(NamedTuple):
    """What the text of a script tells of a value: it is that of an entry, a text or a number, or ""
    (of any kind)."""

    kind: str  # "name", "text", "number" or ""
    word: str  # the name or literal
    position: int

    @property
    def name(self) -> str:
        """The name of the entry, if it is one."""
        return self.word if self.kind == "name" else ""


class Assignment(NamedTuple):
    """``name sign value`` in a script; ``is_own`` if the value is calculated from the entry itself.
    """

    name: str
    sign: str
    value: Operand
    position: int
    is_own: bool = False


class Operation(NamedTuple):
    """``left sign right`` in a script."""

    sign: str
    left: Operand
    right: Operand


class Statement(NamedTuple):
    """One statement of a script, with its value; ``assigns`` if there is an assignment in it,
    ``is_assignment`` if it is one."""

    position: int
    value: Operand
    is_assignment: bool
    assigns: bool


class ScriptFacts(NamedTuple):
    """What a script does, for checks that do not run it."""

    statements: List[Statement]
    assignments: List[Assignment]
    operations: List[Operation]
    prefixed: List[Tuple[str, Operand]]  # the signs before an operand, and that
    calls: Set[str]  # the names that a parenthesis follows: two statements
    read: Dict[str, int]  # the names that are read, and where first


# what it is ("name", "integer", "real", "text", "end", or the operator itself), its text, its
# position
Token = Tuple[str, str, int]

_TOKEN = re.compile(r"""
    (?P<blank>[ \t\r\n]+)
  | (?P<name>[A-Za-z_@][A-Za-z0-9_]*)
  | (?P<integer>(?:0[xX][0-9a-fA-F]+(?!\.)|[0-9]+)(?![A-Za-z0-9_@]|\.(?!\.)))
  | (?P<real>[0-9]+(?:\.[0-9]+(?:[eE][+-]?[0-9]+)?|[eE][+-]?[0-9]+)(?![A-Za-z0-9_@]))
  | (?P<text>'[^']*')
  | (?P<operator>\.\.|&&|\|\||==|!=|<=|>=|:=|\+=|-=|\*=|/=|[-+*/&|^~!<>=?:();])
  | (?P<wrong>'[^']*|[0-9][A-Za-z0-9_.]*(?:(?<=[eE])[+-])?|.)
""", re.VERBOSE | re.DOTALL)

_ASSIGNMENTS = frozenset((":=", "=", "+=", "-=", "*=", "/="))
_PREFIXES = frozenset("-~!")
# how tightly the operators with two operands bind; all are applied from the left
_BY_LEVEL = ("||", "&&", "== != < > <= >=", "| ^", "&", "+ - ..", "* /")
_LEVELS: Dict[str, int] = {
    sign: level for level, signs in enumerate(_BY_LEVEL) for sign in signs.split()}
_COMPARISON = _LEVELS["=="]


def _tokens(text: str) -> List[Token]:
    tokens: List[Token] = []
    for match in _TOKEN.finditer(text):
        kind, word = str(match.lastgroup), match.group()
        if kind == "blank":
            continue
        if kind == "operator":
            kind = word
        elif kind == "wrong":
            wrong = f"Invalid token '{shown(word)}' at position {match.start()}"
            raise ScriptSyntaxError(wrong, match.start(), _hint(text, match.start()))
        tokens.append((kind, word, match.start()))
    tokens.append(("end", "", len(text)))
    return tokens


def _hint(text: str, at: int) -> str:
    """Return what may be meant by the character there, which begins no token."""
    if text[at] == "," and _IN_CALL.search(text, 0, at):
        return NO_FUNCTIONS
    number = re.search(r"[0-9]+$", text[:at]), re.match("[0-9]+", text[at + 1:])
    if text[at] == "," and number[0] and number[1]:
        return f"a number has a point: write {number[0].group()}.{number[1].group()}"
    return _HINTS.get(text[at]) or named_letters(text[at])


NO_FUNCTIONS = "a script has no functions; condition ? value : other chooses a value"
_IN_CALL = re.compile(r"\w\([^()]*$")
_HINTS = {'"': "a text needs single quotes: 'yes'", "%": "scripts have no remainder",
          ",": "statements are separated by ;", "[": "scripts have no lists",
          ".": "a name has no dot, and a number digits on both sides of it",
          "#": "scripts have no remarks", "{": "a script names an entry without braces",
          "'": "the text has no closing quote",
          **dict.fromkeys("0123456789", "a number is followed by no unit")}
"""What may be meant by something that begins no token, by its first character."""


_MEANT = {":": "a value is assigned with :=", "=<": "write <=", "=>": "write >=",
          "===": "write ==", "!==": "write !=", "&&&": "write &&", "|||": "write ||",
          "<>": "write !=", **dict.fromkeys(("++", "-end", "-;"), "write a += 1 or a -= 1")}
"""What may be meant where an operand is missing, by the token there, and by that before it too."""


def _integer(text: str) -> int:
    digits, base = text.lstrip("0"), 10
    if digits[:1] in ("x", "X"):
        digits, base = digits[1:].lstrip("0"), 16
    # one that does not fit is 0, as in the library; Python takes long for very many digits, or
    # refuses them
    value = int(digits[:20] or "0", base)
    if value >= 2 ** 63:
        return 0
    return value


_LITERALS: Dict[str, Callable[[str], Any]] = {
    "integer": _integer, "real": float, "text": lambda text: text[1:-1],
    "name": lambda text: float(text == "true")}


class _ScriptParser:
    """Recursive descent over the tokens of one script. ``facts`` collect what it does."""

    def __init__(self, text: str):
        self.tokens = _tokens(text)
        self.at = self.depth = 0
        self.last: Operand  # the operand read last; a "name" is that and nothing more
        self.facts = ScriptFacts([], [], [], [], set(), {})
        self._is_assignment: bool  # the expression read last

    def script(self) -> List[Evaluate]:
        """Return one closure for each statement; the semicolon between statements is optional."""
        if self.tokens[0][0] == "end":
            raise ScriptSyntaxError("Empty Script")
        statements = []
        while self.tokens[self.at][0] != "end":
            before, position = len(self.facts.assignments), self.tokens[self.at][2]
            statements.append(self.expression())
            assigns = len(self.facts.assignments) > before
            self.facts.statements.append(
                Statement(position, self.last, self._is_assignment, assigns))
            while self.tokens[self.at][0] == ";":
                self.at += 1
        return statements

    def expression(self) -> Evaluate:
        """Return an assignment, or a choice, or what is neither."""
        self._enter()
        whole = self.operation(0)
        kind = self.tokens[self.at][0]
        if kind in _ASSIGNMENTS:
            whole = self._assignment()
        else:
            self._use()
            if kind == "?":
                whole = self._choice(whole)
        self._is_assignment = kind in _ASSIGNMENTS
        self.depth -= 1
        return whole

    def _enter(self) -> None:
        self.depth += 1
        if self.depth > MAX_SCRIPT_DEPTH:
            position = self.tokens[self.at][2]
            wrong = f"Nested too deeply at position {position}"
            raise ScriptSyntaxError(
                f"{wrong}: at most {MAX_SCRIPT_DEPTH} levels are allowed", position)

    def _assignment(self) -> Evaluate:
        target, known = self.last, len(self.facts.operations)
        sign = self._next()[0]
        right, value = self.expression(), self.last
        name = target.name
        is_own = any(name and name in (operation.left.word, operation.right.word)
                     for operation in self.facts.operations[known:])
        self.facts.assignments.append(Assignment(name, sign, value, target.position, is_own))
        if value.kind == "name":
            self.last = value._replace(kind="")
        if name and sign not in (":=", "="):
            self.facts.read.setdefault(name, target.position)
        return operators.assigned(name, sign, right, value.name)

    def _choice(self, condition: Evaluate) -> Evaluate:
        """Return ``condition ? expression : …``; what follows the colon may be such a choice, but
        not an assignment."""
        choices = []
        while self.tokens[self.at][0] == "?":
            self.at += 1
            choices.append((condition, self.expression()))
            self._expect(":", " in ternary expression")
            condition = self.operation(0)
            self._use()
        self.last = self.last._replace(kind="")
        return operators.chosen(choices, condition)

    def operation(self, weakest: int) -> Evaluate:
        """Return operands joined by operators that bind at least as tightly as level ``weakest``.
        """
        self._enter()
        left = self.prefix()
        level = _LEVELS.get(self.tokens[self.at][0], -1)
        while level >= weakest:
            left = self._chain(left, level)
            level = _LEVELS.get(self.tokens[self.at][0], -1)
        self.depth -= 1
        return left

    def _chain(self, first: Evaluate, level: int) -> Evaluate:
        self._use()
        rest: Rest = []
        whole = left = self.last
        while _LEVELS.get(self.tokens[self.at][0]) == level:
            sign = self._next()[0]
            rest.append((sign, self.operation(level + 1)))
            self._use()
            self.facts.operations.append(Operation(sign, left, self.last))
            whole = Operand(_kind(sign, left, self.last), "", whole.position)
            left = self.last if level == _COMPARISON else whole
        self.last = whole
        if level == _COMPARISON:
            return operators.compared(first, rest)
        return operators.folded(first, rest)

    def _use(self) -> None:
        """Note that the value of the operand read last is used; of a name it is an entry's."""
        if self.last.kind == "name":
            self.facts.read.setdefault(self.last.word, self.last.position)

    def prefix(self) -> Evaluate:
        """Return ``-x``, ``~x``, ``!x`` (which may be stacked), or an operand."""
        signs = []
        while self.tokens[self.at][0] in _PREFIXES:
            signs.append(self._next()[0])
        operand = self.operand()
        if not signs:
            return operand
        self._use()
        self.facts.prefixed.append(("".join(signs), self.last))
        word = ""
        if signs == ["-"] and self.last.kind == "number" and self.last.word:
            word = "-" + self.last.word
        self.last = Operand("number", word, self.last.position)
        return operators.prefixed(signs, operand)

    def operand(self) -> Evaluate:
        """Return a literal, a name, or an expression in parentheses."""
        kind, text, position = self._next()
        if kind == "name" and text not in ("true", "false"):
            self.last = Operand("name", text, position)
            if self.tokens[self.at][0] == "(":
                self.facts.calls.add(text)
            return operators.value_of(text)
        if kind in _LITERALS:
            value = _LITERALS[kind](text)
            self.last = Operand("text" if kind == "text" else "number", text, position)
            return lambda _blackboard, _enums: value
        if kind != "(":
            # the end was not passed; before the first token is the end
            before = self.tokens[self.at - (1 if kind == "end" else 2)][0]
            wrong = f"Expected operand at position {position} (got '{shown(text)}')"
            hint = _MEANT.get(before + kind) or _MEANT.get(kind, "")
            raise ScriptSyntaxError(wrong, position, hint)
        inner = self.expression()
        self._expect(")")
        return inner

    def _expect(self, sign: str, where: str = "") -> None:
        kind, text, position = self._next()
        if kind != sign:
            wrong = f"expected '{sign}'{where} (got '{shown(text)}')"
            raise ScriptSyntaxError(f"Parse error at position {position}: {wrong}", position)

    def _next(self) -> Token:
        token = self.tokens[self.at]
        if token[0] != "end":
            self.at += 1
        return token


def _kind(sign: str, left: Operand, right: Operand) -> str:
    """Return the kind of ``left sign right``, as far as the text tells."""
    if sign == "..":
        return "text"
    if sign != "+":
        return "number"
    if left.kind == right.kind != "name":
        return left.kind
    return ""


@dataclass(frozen=True)
class Script:
    """A script ready to run; ``facts`` are what it does. Nodes with the same text share it."""

    text: str
    statements: List[Evaluate]
    facts: ScriptFacts

    def run(self, blackboard: Blackboard, enums: Enums) -> Any:
        """Run every statement and return the last one's value, None for none. Raises ScriptError;
        nothing is undone."""
        if not self.statements:
            raise ScriptError("bad_function_call: the script is empty")
        value = None
        try:
            for statement in self.statements:
                value = statement(blackboard, enums)
        except (ScriptError, ValueFault) as error:
            raise ScriptError(f"Error in script [{shown(self.text)}]: {error}") from error
        return value


@functools.lru_cache(maxsize=1000)
def compile_script(text: str, allow_empty: bool = False) -> Script:
    """Return ``text`` as a Script. Raises ScriptSyntaxError. ``allow_empty``: an empty one fails
    when it runs."""
    if allow_empty and not text:
        return Script(text, [], ScriptFacts([], [], [], [], set(), {}))
    parser = _ScriptParser(text)
    return Script(text, parser.script(), parser.facts)
