"""Mutations as changes of the syntax tree, so that they outlive any formatting: named rules, and a
seeded sample."""
import ast
import copy
import os
import random
from typing import Iterator, List, NamedTuple, Optional, Sequence, Tuple


class Place(NamedTuple):
    """A field of a node, or the items ``start`` to ``end`` of a field that is a list."""

    node: ast.AST
    field: str
    start: Optional[int] = None
    end: Optional[int] = None


class Rule(NamedTuple):
    """A rule of the engine and how it is broken: in ``scope`` (``Class.method``) of ``file``,
    ``old`` becomes ``new``.

    Both are code: statements that follow each other, or an expression. An empty ``new`` takes
    ``old`` away.
    """

    text: str
    file: str
    scope: str
    old: str
    new: str


class Mutation(NamedTuple):
    """A change at one place of a module; ``old`` and ``new`` are the code of the smallest statement
    around it."""

    file: str
    scope: str
    line: int
    old: str
    new: str
    source: str  # of the whole module, changed at this place alone

    @property
    def key(self) -> Tuple[str, str, str, str]:
        """What identifies the mutation, even if its line has moved."""
        return self.file, self.scope, self.old, self.new

    def difference(self) -> str:
        """Return where ``old`` and ``new`` differ, and what is around it."""
        start = max(len(os.path.commonprefix([self.old, self.new])) - 40, 0)
        return "  ->  ".join(" ".join(code[start:start + 80].split())
                             for code in (self.old, self.new))


class Stale(Exception):
    """A rule's code is not in its scope, or is there several times."""


# -------------------------------------------------------------------------------------- named rules


def broken(source: str, rule: Rule) -> str:
    """Return ``source`` with the rule broken. Raises ``Stale``."""
    module = ast.parse(source)
    scope = _scope(module, rule.scope)
    old = ast.parse(rule.old).body
    places = list(_places(scope, old)) or list(_places(scope, _expression(old)))
    if len(places) != 1:
        raise Stale("the code stands in {} places of {}".format(len(places), rule.scope))
    _replace(places[0], ast.parse(rule.new).body)
    return ast.unparse(ast.fix_missing_locations(module))


def _scope(module: ast.Module, path: str) -> ast.AST:
    node: ast.AST = module
    for name in path.split(".") if path else ():
        inner = [
            child for child in ast.iter_child_nodes(node) if getattr(child, "name", None) == name]
        if len(inner) != 1:
            raise Stale("there is no scope {}".format(path))
        node = inner[0]
    return node


def _expression(code: List[ast.stmt]) -> List[ast.AST]:
    return [code[0].value] if len(code) == 1 and isinstance(code[0], ast.Expr) else []


def _places(scope: ast.AST, wanted: Sequence[ast.AST]) -> Iterator[Place]:
    """Yield every place of ``wanted``: consecutive statements, or one expression."""
    dumps = [ast.dump(node) for node in wanted]
    for node in ast.walk(scope) if dumps else ():
        for field, value in ast.iter_fields(node):
            if isinstance(value, list):
                there = [ast.dump(item) if isinstance(item, ast.AST) else "" for item in value]
                for start in range(len(there) - len(dumps) + 1):
                    if there[start:start + len(dumps)] == dumps:
                        yield Place(node, field, start, start + len(dumps))
            elif isinstance(value, ast.AST) and [ast.dump(value)] == dumps:
                yield Place(node, field)


def _replace(place: Place, new: List[ast.stmt]) -> None:
    old = getattr(place.node, place.field)
    if place.start is None:
        setattr(place.node, place.field, _expression(new)[0])
        return
    is_statement = isinstance(old[place.start], ast.stmt)
    old[place.start:place.end] = new if is_statement else _expression(new)
    if is_statement and not old:
        old.append(ast.Pass())


# --------------------------------------------------------------------------------------- the sample

_COMPARISONS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
_ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}


def sample(sources: Sequence[Tuple[str, str]], count: int, seed: int) -> List[Mutation]:
    """Return ``count`` mutations of ``sources`` (file, source), a random sample by ``seed`` of all
    that are possible."""
    places = [(file, source, number) for file, source in sources
              for number in range(len(_sites(ast.parse(source))))]
    drawn = random.Random(seed).sample(places, min(count, len(places)))
    return [_mutation(file, source, number) for file, source, number in sorted(drawn)]


def _mutation(file: str, source: str, number: int) -> Mutation:
    module = ast.parse(source)
    scope, statement, node = _sites(module)[number]
    old = _code(statement)
    start, end, code = _break(node, source.encode())
    changed = source.encode()[:start] + code.encode() + source.encode()[end:]
    return Mutation(file, scope, statement.lineno, old, _code(statement), changed.decode())


def _code(statement: ast.stmt) -> str:
    """Return a statement without the block below it."""
    bare = copy.copy(statement)
    for field in ("body", "orelse", "finalbody", "handlers"):
        if isinstance(getattr(bare, field, None), list):
            setattr(bare, field, [ast.Pass()] if field == "body" else [])
    return ast.unparse(bare)


def _sites(module: ast.Module) -> List[Tuple[str, ast.stmt, ast.AST]]:
    """Return (scope, statement, node) of everything that can be broken, in the order of the source.
    """
    found: List[Tuple[str, ast.stmt, ast.AST]] = []

    def visit(node: ast.AST, scope: str, statement: ast.stmt) -> None:
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "decorator_list", "bases", "type_comment"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if not isinstance(child, ast.AST) or isinstance(child,
                                                                (ast.Import, ast.ImportFrom)):
                    continue
                inner, at = scope, child if isinstance(child, ast.stmt) else statement
                if isinstance(child, (ast.FunctionDef, ast.ClassDef)):
                    inner = "{}.{}".format(scope, child.name).lstrip(".")
                if _can_break(child):
                    found.append((inner, at, child))
                visit(child, inner, at)

    visit(module, "", ast.Pass())
    return found


def _can_break(node: ast.AST) -> bool:
    if isinstance(node, ast.Compare):
        return len(node.ops) == 1 and type(node.ops[0]) in _COMPARISONS
    if isinstance(node, ast.BinOp):
        return type(node.op) in _ARITHMETIC and not isinstance(node.left, ast.Constant)
    if isinstance(node, ast.Constant):
        return isinstance(node.value, (bool, int)) and not isinstance(node.value, str)
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call)
    if isinstance(node, (ast.If, ast.IfExp)):
        return not _is_not(node.test)  # that is a separate place
    return isinstance(node, ast.BoolOp) or _is_not(node)


def _is_not(node: ast.AST) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)


def _break(node: ast.AST, source: bytes) -> Tuple[int, int, str]:
    """Change ``node`` in place. Return the bytes of the source to replace (start, end), and by
    which code."""
    changed: ast.AST = node
    if isinstance(node, (ast.If, ast.IfExp)):
        changed = node.test
    elif isinstance(node, ast.Expr):
        changed = node.value
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    start = starts[changed.lineno - 1] + changed.col_offset
    end = starts[changed.end_lineno - 1] + changed.end_col_offset
    if isinstance(node, ast.Compare):
        node.ops = [_COMPARISONS[type(node.ops[0])]()]
    elif isinstance(node, ast.BinOp):
        node.op = _ARITHMETIC[type(node.op)]()
    elif isinstance(node, ast.BoolOp):
        node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
    elif isinstance(node, ast.Constant):
        node.value = not node.value if isinstance(node.value, bool) else node.value + 1
    elif isinstance(node, ast.UnaryOp):
        node.operand = ast.UnaryOp(ast.Not(), node.operand)
    elif isinstance(node, ast.Expr):
        node.value = changed = ast.Constant(None)  # the call is left out
    elif isinstance(node, (ast.If, ast.IfExp)):
        node.test = changed = ast.UnaryOp(ast.Not(), node.test)
    return start, end, "({})".format(ast.unparse(changed))
