"""All small changes of a source: a comparison shifted, a condition dropped, a number off by one, a
sign reversed. Annotations, decorators, docstrings, and messages stay unchanged, because they decide
nothing.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.FloorDiv: ast.Mult, ast.Mod: ast.Add,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.Pow: ast.Mult,
}  # fmt: skip
Change = Callable[[], None]
Site = tuple[ast.expr, str, Change]


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: its number in the source, its line, the original expression, and the change.

    `lines` are the first and the last line of the statement, or of its head if it has a body;
    `function` is the outermost function around it, "Class.method" or "function", empty if there is
    none.
    """

    number: int
    line: int
    before: str
    rule: str
    lines: tuple[int, int] = (0, 0)
    function: str = ""


def mutants(source: str) -> list[Mutant]:
    """Every mutant of the source, in the order of the text."""
    tree = ast.parse(source)
    places = dict(_places(tree, "", False, (0, 0)))
    return [
        Mutant(number, node.lineno, ast.unparse(node), rule, *places[node])
        for number, (node, rule, _) in enumerate(sites(tree))
    ]


def mutated(source: str, mutant: Mutant) -> ast.Module:
    """The source with this change; line numbers are unchanged."""
    tree = ast.parse(source)
    _, _, change = list(sites(tree))[mutant.number]
    change()
    return ast.fix_missing_locations(tree)


def _places(
    node: ast.AST, function: str, inside: bool, lines: tuple[int, int]
) -> Iterator[tuple[ast.AST, tuple[tuple[int, int], str]]]:
    """(node, (lines of its statement, the outermost function around it)) of all below the node."""
    named = isinstance(node, ast.FunctionDef | ast.ClassDef) and not inside
    name = f"{function}.{node.name}".lstrip(".") if named else function  # type: ignore[attr-defined]
    for field, value in ast.iter_fields(node):
        within = inside or (isinstance(node, ast.FunctionDef) and field == "body")
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                around = name if within or isinstance(node, ast.ClassDef) else function
                own = (
                    _head(child)
                    if isinstance(child, ast.stmt | ast.excepthandler | ast.match_case)
                    else lines
                )
                yield child, (own, around if within else "")
                yield from _places(child, around, within, own)


def _head(statement: ast.AST) -> tuple[int, int]:
    """The lines of a statement without those of its body."""
    places = [node for node in ast.walk(statement) if hasattr(node, "lineno")]
    first = min(node.lineno for node in places)
    body = getattr(statement, "body", None) or getattr(statement, "cases", None)
    last = max(node.end_lineno for node in places)
    return first, max(first, _head(body[0])[0] - 1) if body else last


def sites(tree: ast.AST) -> Iterator[Site]:
    """(expression, rule, change) of each mutant, in the order of the text."""
    for parent, name, index, node in expressions(tree):
        yield from _changes(node, lambda new, p=parent, k=name, i=index: put(p, k, i, new))  # type: ignore[misc]


def put(parent: ast.AST, name: str, index: int | None, new: ast.expr) -> None:
    """Replace the expression at this place of its parent."""
    if index is None:
        setattr(parent, name, new)
    else:
        getattr(parent, name)[index] = new


def expressions(node: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, ast.AST]]:
    """(parent, field, place in the field, node) of all that may be changed."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_comment", "format_spec"):
            continue
        for index, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if (
                not isinstance(child, ast.AST)
                or isinstance(child, ast.JoinedStr)
                or _is_docstring(child)
            ):
                continue
            yield node, name, index, child
            yield from expressions(child)


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _changes(node: ast.AST, put: Callable[[ast.expr], None]) -> Iterator[Site]:
    match node:
        case ast.Compare(ops=operators):
            for k, operator in enumerate(operators):
                new = OPERATORS[type(operator)]
                yield (
                    node,
                    _turned(operator, new),
                    lambda k=k, new=new: operators.__setitem__(k, new()),
                )  # type: ignore[misc]
        case ast.BoolOp(op=operator) | ast.BinOp(op=operator) if type(operator) in OPERATORS:
            new = OPERATORS[type(operator)]
            yield node, _turned(operator, new), lambda: setattr(node, "op", new())
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield (
                node,
                "dropped " + ("not" if isinstance(node.op, ast.Not) else "minus"),
                lambda: put(operand),
            )
        case ast.Constant(value=bool() as truth):
            yield node, f"{not truth}", lambda: put(ast.Constant(not truth))
        case ast.Constant(value=int() as number):
            yield node, f"{number + 1}", lambda: put(ast.Constant(number + 1))
        case ast.Call(func=ast.Name(id="require"), args=arguments):
            yield node, "condition dropped", lambda: arguments.__setitem__(0, ast.Constant(True))
        case ast.comprehension(ifs=conditions) if conditions:
            yield conditions[0], "condition dropped", lambda: conditions.clear()
        case ast.If(test=test) | ast.IfExp(test=test):
            yield test, "condition never", lambda: setattr(node, "test", ast.Constant(False))
            yield test, "condition always", lambda: setattr(node, "test", ast.Constant(True))


def _turned(old: ast.AST, new: type[ast.AST]) -> str:
    return f"{type(old).__name__} to {new.__name__}"
