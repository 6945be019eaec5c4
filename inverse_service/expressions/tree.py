"""Syntax trees of formulas: frozen data, exact numbers, no evaluation of text.

The parser (`reader.py`) builds trees, as does arithmetic: + - * / ** of trees and exact numbers, or
the functions `add`, `multiply`, `power` of this module. They flatten, fold numbers, and drop
neutral elements, but never expand. Names are plain data: the meaning of a `Symbol` (coordinate,
parameter, time `t`, the number `pi`) is known only to the system that holds the tree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from hashlib import blake2b
from operator import attrgetter
from types import UnionType
from typing import Any, TypeGuard, TypeVar, cast


@lru_cache(maxsize=4096)
def _code(text: str) -> int:
    """A number for a text, the same in all processes."""
    return int.from_bytes(
        blake2b(text.encode(errors="surrogatepass"), digest_size=8).digest(), "big"
    )


def _with_codes(part: object) -> object:
    """Fields with codes for their texts, 0 for None, and integers for fractions of the same hash,
    which Python computes slowly.
    """
    if isinstance(part, tuple):
        return tuple([one if isinstance(one, _Node) else _with_codes(one) for one in part])
    if isinstance(part, str):
        return _code(part)
    if type(part) is Fraction and part.denominator == 1:
        return part.numerator
    return 0 if part is None else part


class _Node:
    """A tree caches its hash: trees are keys of many tables, and hashing visits every node.

    The hash is the same in all processes, unlike that of a text. It decides the order of sets of
    trees, and with it which of several forms of one length an answer shows.
    """

    __slots__ = ("_hash", "_size")
    _hash: int
    _size: int

    def __init_subclass__(cls) -> None:
        """A dataclass keeps this hash instead of one of its own."""
        cls.__hash__ = _Node.__hash__  # type: ignore[method-assign]

    def __hash__(self) -> int:
        try:
            return self._hash
        except AttributeError:
            kind = type(self)
            fields = _FIELDS[kind](self)
            fields = fields if kind in _OF_NODES else _with_codes(fields)
            value = hash((_code(kind.__name__), fields))
            object.__setattr__(self, "_hash", value)
            return value

    def __add__(self, other: Operand) -> Expression:
        return add(_tree(self), _tree(other))

    def __radd__(self, other: int | Fraction) -> Expression:
        return add(_tree(other), _tree(self))

    def __sub__(self, other: Operand) -> Expression:
        return subtract(_tree(self), _tree(other))

    def __rsub__(self, other: int | Fraction) -> Expression:
        return subtract(_tree(other), _tree(self))

    def __mul__(self, other: Operand) -> Expression:
        return multiply(_tree(self), _tree(other))

    def __rmul__(self, other: int | Fraction) -> Expression:
        return multiply(_tree(other), _tree(self))

    def __truediv__(self, other: Operand) -> Expression:
        return divide(_tree(self), _tree(other))

    def __rtruediv__(self, other: int | Fraction) -> Expression:
        return divide(_tree(other), _tree(self))

    def __pow__(self, exponent: Operand) -> Expression:
        return power(_tree(self), _tree(exponent))

    def __neg__(self) -> Expression:
        return negate(_tree(self))


@dataclass(frozen=True, slots=True)
class Number(_Node):
    """An exact rational number."""

    value: Fraction

    def __eq__(self, other: object) -> bool:
        """The usual equality, written out because numbers are compared most often and Fraction's
        comparison is slow.
        """
        if self is other or type(other) is not Number:
            return self is other
        mine, its = self.value, other.value
        return mine.numerator == its.numerator and mine.denominator == its.denominator


@dataclass(frozen=True, slots=True)
class Symbol(_Node):
    """A coordinate, a parameter, the time `t`, or the number `pi`."""

    name: str


@dataclass(frozen=True, slots=True)
class Velocity(_Node):
    """The first time derivative of a coordinate."""

    coordinate: str


@dataclass(frozen=True, slots=True)
class Acceleration(_Node):
    """The second time derivative of a coordinate; occurs only in equations not yet solved for
    it.
    """

    coordinate: str


@dataclass(frozen=True, slots=True)
class Sum(_Node):
    """a + b + …, at least two terms, none a Sum, at most one a Number."""

    terms: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Product(_Node):
    """a b …, at least two factors, none a Product, at most one a Number and that one first."""

    factors: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Power(_Node):
    """base ^ exponent; sqrt(u) is Power(u, 1/2), u/w is a Product with Power(w, -1)."""

    base: Expression
    exponent: Expression


@dataclass(frozen=True, slots=True)
class Apply(_Node):
    """A function of one argument; its name is in the table of `functions.py`."""

    function: str
    argument: Expression


@dataclass(frozen=True, slots=True)
class Ordered(Apply):
    """A function of one argument and of a constant order: the Bessel function J_n(u)."""

    order: Expression


@dataclass(frozen=True, slots=True)
class Arbitrary(_Node):
    """A declared function or one of its partial derivatives: A'(u) has orders (1,)."""

    name: str
    arguments: tuple[Expression, ...]
    orders: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Integral(Arbitrary):
    """A function known only by its partial derivatives: F(t) with F' = f(t).

    `slopes[k]` is the derivative by `arguments[k]`, or None if it is unknown; `orders` are 0. Code
    that treats it as an arbitrary function remains correct. With a `letter` it is a function of one
    variable of this name, G(u) with G' = g(u), at any argument.
    """

    slopes: tuple[Expression | None, ...] = ()
    letter: str = ""

    @property
    def derivatives(self) -> tuple[Expression | None, ...]:
        """The derivatives at the arguments."""
        if not self.letter:
            return self.slopes
        at = {Symbol(self.letter): self.arguments[0]}
        return tuple(slope and substitute(slope, at) for slope in self.slopes)

    @property
    def integrand(self) -> tuple[Expression, Expression] | None:
        """(slope, argument) if exactly one derivative is known, and only there, else None."""
        if self.letter:
            return None
        known = [
            (slope, u)
            for slope, u in zip(self.slopes, self.arguments, strict=True)
            if slope is not None
        ]
        return known[0] if len(known) == 1 else None


Expression = Number | Symbol | Velocity | Acceleration | Sum | Product | Power | Apply | Arbitrary
Operand = _Node | int | Fraction
Leaf = TypeVar("Leaf", bound=Expression)
_FIELDS: dict[type[_Node], Callable[[Any], object]] = {
    kind: attrgetter(*kind.__match_args__)
    for kind in (
        Number,
        Symbol,
        Velocity,
        Acceleration,
        Sum,
        Product,
        Power,
        Apply,
        Ordered,
        Arbitrary,
        Integral,
    )
}
# The direct parts of the kinds that have some.
_PARTS: dict[type[_Node], Callable[[Any], tuple[Expression, ...]]] = {
    Sum: attrgetter("terms"),
    Product: attrgetter("factors"),
    Power: attrgetter("base", "exponent"),
    Apply: lambda node: (node.argument,),
    Ordered: attrgetter("order", "argument"),
    Arbitrary: attrgetter("arguments"),
    Integral: attrgetter("arguments"),
}
# Those whose fields are trees alone, or one tuple of trees.
_OF_NODES = frozenset((Sum, Product, Power))

ZERO, ONE, TWO, MINUS_ONE, HALF = (Number(Fraction(k)) for k in ("0", "1", "2", "-1", "1/2"))
TIME = Symbol("t")
PI = Symbol("pi")


def number(value: int | Fraction | float | str) -> Number:
    """The exact number as a tree."""
    try:
        return ratio(value.numerator, value.denominator)  # type: ignore[union-attr]
    except AttributeError:  # texts and floats
        return number(Fraction(value))


@lru_cache(maxsize=1024)
def ratio(numerator: int, denominator: int) -> Number:
    """A number by integers, as Python computes the hash of a fraction slowly."""
    return Number(Fraction(numerator, denominator))


def _tree(operand: Operand) -> Expression:
    """The operand as a tree; TypeError unless it is a node or an exact number."""
    if isinstance(operand, _Node):
        return cast(Expression, operand)
    if not isinstance(operand, int | Fraction):
        raise TypeError(f"a tree cannot be combined with {type(operand).__name__}")
    return number(operand)


def add(*terms: Expression) -> Expression:
    """The sum, flattened, with numbers folded and zero dropped."""
    total = ZERO  # most sums have at most one number, and fractions are slow
    rest: list[Expression] = []
    for term in terms:
        for part in term.terms if type(term) is Sum else (term,):
            if type(part) is Number:
                total = part if total is ZERO else Number(total.value + part.value)
            else:
                rest.append(part)
    if total is not ZERO and total.value.numerator:
        rest.append(total)
    if not rest:
        return ZERO
    return rest[0] if len(rest) == 1 else Sum(tuple(rest))


def multiply(*factors: Expression) -> Expression:
    """The product, flattened, with numbers folded into one leading factor."""
    total = ONE
    rest: list[Expression] = []
    for factor in factors:
        for part in factor.factors if type(factor) is Product else (factor,):
            if type(part) is Number:
                total = part if total is ONE else Number(total.value * part.value)
            else:
                rest.append(part)
    if total is not ONE:  # comparisons of trees and fractions are slow
        if not total.value.numerator:
            return ZERO
        if total != ONE:
            rest.insert(0, total)
    if not rest:
        return ONE
    return rest[0] if len(rest) == 1 else Product(tuple(rest))


def power(base: Expression, exponent: Expression | int | Fraction) -> Expression:
    """base ^ exponent, exact for numbers with small integer exponents; 0 to a negative power is not
    evaluated.
    """
    if not isinstance(exponent, _Node):
        exponent = number(exponent)
    if not isinstance(exponent, Number):
        return base if base == ONE else Power(base, exponent)
    e = exponent.value
    if not e.numerator:
        return ONE
    if exponent is ONE or exponent == ONE:
        return base
    if isinstance(base, Number):
        if base == ONE:
            return base
        if base == ZERO and e.numerator > 0:
            return ZERO
    if e.denominator == 1:
        if isinstance(base, Number) and abs(e) <= 64 and (base.value or e > 0):
            return Number(base.value ** int(e))
        if (
            isinstance(base, Power)
            and isinstance(base.exponent, Number)
            and base.exponent.value.denominator == 1
        ):
            return power(base.base, base.exponent.value * e)
    return Power(base, exponent)


def split_exponent(exponent: Expression) -> tuple[Expression, int]:
    """(e, k) with exponent = e + k, where k is its integer term: a + 1 is (a, 1), -(a + 1) is (-a,
    -1).
    """
    match exponent:
        case Product((Number() as factor, Sum(terms))):
            exponent = add(*(multiply(factor, term) for term in terms))
    if not isinstance(exponent, Sum):
        return exponent, 0
    numbers = [term.value for term in exponent.terms if isinstance(term, Number)]
    whole = int(numbers[0]) if numbers and numbers[0].denominator == 1 else 0
    return add(exponent, Number(Fraction(-whole))), whole


def summands(tree: Expression) -> tuple[Expression, ...]:
    """The terms of a sum; the tree itself otherwise."""
    return tree.terms if isinstance(tree, Sum) else (tree,)


def negate(expression: Expression) -> Expression:
    return multiply(MINUS_ONE, expression)


def negated(tree: Expression) -> Expression:
    """-tree with the sign in each term of a sum."""
    return add(*map(negate, tree.terms)) if isinstance(tree, Sum) else -tree


def subtract(left: Expression, right: Expression) -> Expression:
    return add(left, negate(right))


def divide(left: Expression, right: Expression) -> Expression:
    return multiply(left, power(right, -1))


def square_root(expression: Expression) -> Expression:
    return power(expression, Fraction(1, 2))


def children(expression: Expression) -> tuple[Expression, ...]:
    """The direct parts of a node, by a table because most work is walking trees."""
    parts = _PARTS.get(type(expression))
    return parts(expression) if parts is not None else ()


def walk(expression: Expression) -> Iterator[Expression]:
    """Every node, the root first; not recursive, so the depth is not limited."""
    stack = [expression]
    while stack:
        node = stack.pop()
        yield node
        parts = _PARTS.get(type(node))
        if parts is not None:
            stack += parts(node)[::-1]


def factors_of(tree: Expression) -> tuple[Expression, ...]:
    """The factors of a product; otherwise the tree itself."""
    return tree.factors if isinstance(tree, Product) else (tree,)


def coefficient(term: Expression) -> Fraction:
    """The number in front of a term, 1 if there is none."""
    first = term.factors[0] if isinstance(term, Product) else term
    return first.value if isinstance(first, Number) else Fraction(1)


def powers_of(tree: Expression) -> list[tuple[Expression, Fraction]]:
    """(base, exponent) of each factor; a power with a symbolic exponent is a base with exponent 1,
    as is exp(u).
    """
    return [
        (f.base, f.exponent.value)
        if isinstance(f, Power) and isinstance(f.exponent, Number)
        else (f, Fraction(1))
        for f in factors_of(tree)
    ]


def dot(left: Iterable[Expression], right: Iterable[Expression]) -> Expression:
    """The sum of the products."""
    return add(*(a * b for a, b in zip(left, right, strict=True)))


def node_count(tree: Expression) -> int:
    """The number of nodes, which a tree caches."""
    try:
        return tree._size
    except AttributeError:
        size = 1 + sum(map(node_count, children(tree)))
        object.__setattr__(tree, "_size", size)
        return size


def holds(tree: Expression, *leaves: Expression) -> bool:
    """Whether one of the leaves occurs in the tree."""
    return not frozenset(leaves).isdisjoint(walk(tree))


def has(tree: Expression, kind: type[_Node] | UnionType) -> bool:
    """Whether a node of this kind occurs in the tree."""
    return any(isinstance(node, kind) for node in walk(tree))


def reading_class(tree: Expression, time: Expression) -> int:
    """0 for a polynomial in the velocities, 1 if it also contains t, 2 for a rational function of
    them, 3 otherwise.
    """
    kind = int(holds(tree, time))
    for node in walk(tree):
        if isinstance(node, Power | Apply | Arbitrary) and has(node, Velocity):
            exponent = node.exponent if isinstance(node, Power) else None
            if not isinstance(exponent, Number) or exponent.value.denominator != 1:
                return 3
            kind = max(kind, 2 if exponent.value < 0 else 0)
    return kind


def is_exponential(tree: Expression) -> TypeGuard[Apply]:
    return isinstance(tree, Apply) and tree.function == "exp"


def distinct_nodes(expressions: Iterable[Expression]) -> Iterator[Expression]:
    """Every node of the trees once, in the order of `walk`; parts already visited are skipped."""
    met: set[Expression] = set()
    count = 0
    for expression in expressions:
        stack = [expression]
        while stack:
            node = stack.pop()
            met.add(node)
            if len(met) > count:  # one hash takes as long as all else
                count += 1
                yield node
                parts = _PARTS.get(type(node))
                if parts is not None:
                    stack += parts(node)[::-1]


def nesting(trees: Iterable[Expression], counts: Callable[[Expression], bool]) -> int:
    """How many nodes of a kind lie in one another at most: f(g(x) + h(x)) has two functions."""
    known: dict[Expression, int] = {}

    def depth(node: Expression) -> int:
        if node not in known:
            known[node] = max(map(depth, children(node)), default=0) + counts(node)
        return known[node]

    return max(map(depth, trees), default=0)


def rebuild(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """The node with `change` applied to each direct part, rebuilt by the constructors."""
    match expression:
        case Sum(terms):
            return add(*map(change, terms))
        case Product(factors):
            return multiply(*map(change, factors))
        case Power(base, exponent):
            return power(change(base), change(exponent))
        case Ordered(function, argument, order):
            return Ordered(function, change(argument), change(order))
        case Apply(function, argument):
            return Apply(function, change(argument))
        case Integral(name, arguments, orders):
            slopes = tuple(slope and change(slope) for slope in expression.slopes)
            changed = tuple(map(change, arguments))
            return Integral(name, changed, orders, slopes, expression.letter)
        case Arbitrary(name, arguments, orders):
            return Arbitrary(name, tuple(map(change, arguments)), orders)
        case _:
            return expression


def substitute(expression: Expression, table: Mapping[Leaf, Expression]) -> Expression:
    """Every node that is a key of `table` replaced by its value, all at once."""
    values: Mapping[Any, Expression] = table
    known: dict[Expression, Expression] = {}

    def replaced(part: Expression) -> Expression:
        """The part with its replacements; shared parts are rebuilt only once."""
        if part in values:
            return values[part]
        if part not in known:
            known[part] = rebuild(part, replaced)
        return known[part]

    return replaced(expression)
