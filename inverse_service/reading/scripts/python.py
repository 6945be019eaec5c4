"""Python and Sage, by Python's own grammar."""

from __future__ import annotations

import ast
import re
import textwrap
from fractions import Fraction

from inverse_service.reading.scripts import nodes as nd

_PROMPT = re.compile(r"^[ \t]*(?:>>>|\.\.\.\.:|\.\.\.|sage:|In ?\[\d*\]:)[ ]?", re.MULTILINE)
_OUTPUT = re.compile(r"^[ \t]*Out ?\[\d*\]:.*$", re.MULTILINE)
_SIGNS: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**", ast.MatMult: ".",
}  # fmt: skip


# Signs that pages and word processors write for those of programs, each one sign long
_SIGNS_OF_PAGES = {
    "\u00a0": " ",
    "\u2018": "'",
    "\u2019": "'",
    "\u201c": '"',
    "\u201d": '"',
    "\u2212": "-",
}
_OF_VECTORS = re.compile(r"\bvpython\b|\bfrom visual\b|\bGlowScript\b")
_SHAPES = frozenset(
    ("sphere", "simple_sphere", "box", "cylinder", "helix", "arrow", "cone", "ring", "ellipsoid")
)


def program(text: str, is_sage: bool) -> tuple[nd.Node, ...]:
    """The statements; NotRead for what is not Python."""
    for sign, plain_sign in _SIGNS_OF_PAGES.items():
        text = text.replace(sign, plain_sign)
    plain = _without_prompts(text)
    if is_sage:
        plain = plain.replace("^", "**")
    tree = _parsed(plain)
    if tree is None:
        first, _, others = plain.partition("\n")  # copied from the middle of its first line on
        plain = f"{first}\n{textwrap.dedent(others)}"
        tree = _parsed(plain)
    if tree is None:
        raise nd.NotRead("no program in Python")
    things = _things(tree) if _OF_VECTORS.search(plain) else None
    return tuple(_Reader(_places(text, plain), things).statements(tree.body))


def _parsed(plain: str) -> ast.Module | None:
    try:
        return ast.parse(plain)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None


def _things(tree: ast.Module) -> frozenset[str]:
    """The names of what VPython draws, ball = sphere(...), or whose parts are set."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            shape = node.value.func
            if isinstance(shape, ast.Name) and shape.id in _SHAPES:
                found |= {one.id for one in node.targets if isinstance(one, ast.Name)}
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            found |= {node.value.id} if isinstance(node.value, ast.Name) else set()
    return frozenset(found - {"self", "scene"})


def _places(text: str, plain: str) -> list[tuple[int, bool]]:
    """Where each line begins in the text, and whether it is there as it is run."""
    starts = [(0, False)]
    lines = plain.splitlines() if text.count("\n") == plain.count("\n") else []
    for k, line in enumerate(text.splitlines(keepends=True)):
        begin = starts.pop()[0]
        same = k < len(lines) and line.rstrip("\r\n") == lines[k]
        starts += [(begin, same), (begin + len(line), False)]
    return starts


def _without_prompts(text: str) -> str:
    """The statements behind prompts; lines that go on are moved to the left with the first."""
    if not _PROMPT.search(text):
        return textwrap.dedent(text)
    plain = _OUTPUT.sub("", text)
    found: list[str] = []
    for line in plain.splitlines():
        mark = _PROMPT.match(line)
        if mark is None:
            found.append(line)
        else:
            found.append(line[mark.end() :])
    notebook = any(match[0].lstrip().startswith("In") for match in _PROMPT.finditer(plain))
    if notebook and any(line[:1] == " " for line in found):
        block: list[str] = []
        for line in found:
            opens = "".join(block).count("(") > "".join(block).count(")")
            body = block and block[-1].rstrip().endswith(":")
            block.append(line if opens or body or line[:1] != " " else line.lstrip())
        found = block
    return "\n".join(found)


class _Reader:
    def __init__(self, starts: list[tuple[int, bool]], things: frozenset[str] | None) -> None:
        self.starts = starts
        self.of_vectors, self.things = things is not None, things or frozenset()
        self.selves: list[bool] = []  # of each function, and of each class
        self.sets: list[set[str]] = []  # the names that each function around sets

    def at(self, node: ast.AST) -> int:
        line, column = getattr(node, "lineno", 1), getattr(node, "col_offset", 0)
        begin, same = self.starts[min(line, len(self.starts)) - 1]
        return begin + 1 + (int(column) if same else 0)

    def statements(self, body: list[ast.stmt]) -> list[nd.Node]:
        found: list[nd.Node] = []
        for one in body:
            found += self.statement(one)
        return found

    def statement(self, one: ast.stmt) -> list[nd.Node]:
        at = self.at(one)
        match one:
            case ast.Assign(targets=targets) if any(map(_has_star, targets)):
                return [nd.Stop(at, "a name for the rest of a list")]
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Call(keywords=parts)) if (
                name in self.things
            ):
                return [
                    nd.Assign(at, nd.Name(at, f"{name}_{part.arg}"), self.tree(part.value))
                    for part in parts
                    if part.arg is not None
                ]
            case ast.Assign(
                targets=[ast.Name(id=name)],
                value=ast.Attribute(value=ast.Name(id="self"), attr=same),
            ) if name == same:
                return []  # sp = self.sp
            case ast.Assign(targets=targets, value=value):
                last = self.tree(value)
                return [nd.Assign(at, self.tree(target), last) for target in reversed(targets)]
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                return [nd.Assign(at, self.tree(target), self.tree(value))]
            case ast.AugAssign(target=target, op=op, value=value) if type(op) in _SIGNS:
                return [nd.Assign(at, self.tree(target), self.tree(value), _SIGNS[type(op)])]
            case ast.Expr(value=value):
                return [self.tree(value)]
            case ast.FunctionDef(name=name, args=given, body=body):
                self.selves.append(any(one.arg == "self" for one in given.args))
                stored = (each for each in ast.walk(one) if isinstance(each, ast.Name))
                self.sets.append({each.id for each in stored if isinstance(each.ctx, ast.Store)})
                lines = tuple(self.statements(body))
                self.sets.pop()
                return [nd.Function(at, name, _names(given), lines, (), self.defaults(given))]
            case ast.Return(value=value):
                return [nd.Return(at, None if value is None else self.tree(value))]
            case ast.AugAssign(target=target):
                return [nd.Assign(at, self.tree(target), nd.Call(at, nd.Name(at, "<sign>"), ()))]
            case ast.For(body=body, orelse=others) | ast.While(body=body, orelse=others):
                over = one.target if isinstance(one, ast.For) else None
                counter = over.id if isinstance(over, ast.Name) else ""
                loop = nd.Block(at, tuple(self.statements(body)), True, counter)
                return [loop, nd.Block(at, tuple(self.statements(others)), False)]
            case ast.If(test=test, body=body, orelse=others):
                main = "__name__" in ast.dump(test)
                inside = self.statements(body)
                both = (*inside, *self.statements(others))
                return inside if main else [nd.Block(at, both, False)]
            case ast.Try(body=body, handlers=handlers, orelse=others):
                caught = [line for handler in handlers for line in handler.body]
                return [nd.Block(at, tuple(self.statements([*body, *caught, *others])), False)]
            case ast.With(body=body):
                return self.statements(body)
            case ast.ClassDef(body=body):
                return self.members(at, body)
            case ast.Global(names=names) | ast.Nonlocal(names=names):
                if self.sets and not {*names} & self.sets[-1]:
                    return []  # the names are only read
                return [nd.Stop(at, "a function that changes names around it", True)]
            case ast.Import() | ast.ImportFrom() | ast.Pass() | ast.Assert() | ast.AnnAssign():
                return []
            case ast.Break() | ast.Continue():  # of a loop, which is not run
                return []
        return [nd.Stop(at, f"the statement {type(one).__name__.lower()}")]

    def members(self, at: int, body: list[ast.stmt]) -> list[nd.Node]:
        """The functions and names of a class; self.k is k, where one class has such parts."""
        outside, self.selves = self.selves, []
        found = self.statements(body)
        outside.append(any(self.selves))
        self.selves = outside
        if sum(outside) > 1:
            raise nd.NotRead("parts of two things", at)
        return found

    def defaults(self, given: ast.arguments) -> tuple[nd.Node, ...]:
        extra = bool(given.vararg or given.kwonlyargs or given.kwarg)
        return () if extra else self.trees(given.defaults)

    def trees(self, given: list[ast.expr]) -> tuple[nd.Node, ...]:
        return tuple(map(self.tree, given))

    def tree(self, one: ast.expr) -> nd.Node:
        at = self.at(one)
        match one:
            case ast.Constant(value=bool() | None):
                return nd.Name(at, repr(one.value))
            case ast.Constant(value=int() as value):
                return nd.Constant(at, Fraction(value), True)
            case ast.Constant(value=float() as value):
                return nd.Constant(at, _fraction(value, at))
            case ast.Constant(value=str() as text):
                return nd.Constant(at, text)
            case ast.Name(id=name):
                return nd.Name(at, name)
            case ast.Attribute(value=ast.Name(id="self"), attr=name):
                return nd.Name(at, name)
            case ast.Attribute(value=ast.Name(id=thing), attr=name) if thing in self.things:
                return nd.Name(at, f"{thing}_{name}")
            case ast.Call(func=ast.Name(id="norm"), args=arguments) if self.of_vectors:
                return nd.Call(at, nd.Name(at, "hat"), self.trees(arguments))  # of VPython
            case ast.Attribute(value=value, attr=name):
                return nd.Member(at, self.tree(value), name)
            case ast.Call(func=function, args=arguments, keywords=keywords):
                named = tuple((key.arg or "**", self.tree(key.value)) for key in keywords)
                return nd.Call(at, self.tree(function), self.trees(arguments), named)
            case ast.Subscript(value=value, slice=ast.Tuple(elts=places)):
                kept = [one for one in places if not _is_every(one)]  # y[..., 0]
                return nd.Index(at, self.tree(value), self.trees(kept))
            case ast.Subscript(value=value, slice=place):
                return nd.Index(at, self.tree(value), (self.tree(place),))
            case ast.Slice(lower=lower, upper=upper, step=None):
                ends = [None if end is None else self.tree(end) for end in (lower, upper)]
                return nd.Slice(at, *ends)
            case ast.List(elts=items) | ast.Tuple(elts=items) | ast.Set(elts=items):
                return nd.Items(at, self.trees(items))
        return self.operation(one)

    def operation(self, one: ast.expr) -> nd.Node:
        at = self.at(one)
        match one:
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _SIGNS:
                return nd.Binary(at, _SIGNS[type(op)], self.tree(left), self.tree(right))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return nd.Unary(at, "-", self.tree(operand))
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.tree(operand)
            case ast.Compare(left=left, ops=[ast.Eq()], comparators=[right]):
                return nd.Binary(at, "==", self.tree(left), self.tree(right))
            case ast.Lambda(args=given, body=body):
                result = (nd.Return(at, self.tree(body)),)
                return nd.Function(at, "", _names(given), result, (), self.defaults(given))
            case ast.Dict(keys=keys, values=values):
                pairs = [
                    nd.Binary(at, "->", self.tree(key), self.tree(value))
                    for key, value in zip(keys, values, strict=True)
                    if key is not None
                ]
                return nd.Items(at, tuple(pairs))
        return nd.Call(at, nd.Name(at, f"<{type(one).__name__}>"), ())  # evaluated, not read


def _has_star(target: ast.expr) -> bool:
    return any(isinstance(node, ast.Starred) for node in ast.walk(target))


def _is_every(place: ast.expr) -> bool:
    return isinstance(place, ast.Constant) and place.value is Ellipsis


def _names(given: ast.arguments) -> tuple[str, ...]:
    """The parameters of a function, all kinds of them, without self."""
    others = [one for one in (given.vararg, *given.kwonlyargs, given.kwarg) if one is not None]
    named = [one.arg for one in (*given.posonlyargs, *given.args, *others)]
    return tuple(name for name in named if name != "self")


def _fraction(value: float, at: int) -> Fraction:
    try:
        return Fraction(repr(value))
    except ValueError:
        raise nd.NotRead("a number without a value", at) from None
