"""Changes of coordinates that the right-hand sides themselves suggest.

new = W(old), old = psi(new), one or two coordinates at a time:
shear        X = x + g(y, …) where x + g, or its rate x' + g_y y' + …, stands in f as a sum
rotation     X = a x + b y, Y = a y - b x where a x + b y stands in f
exponential  X = e^x where e^x stands in f
polar        X = r cos u, Y = r sin u where u stands in f under sine and cosine only
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from inverse_service.algebra.kernels import to_kernels
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    Product,
    Sum,
    Symbol,
    Velocity,
    add,
    divide,
    multiply,
    number,
    power,
    square_root,
    substitute,
    subtract,
    walk,
)
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.terms import Monomial, Terms, TooManyTerms, terms_of, tree_of

_MOST_SHEARS = 4
# The terms of a function of position, a set so that equal ones can be counted.
Form = frozenset[tuple[Monomial, Fraction]]


@dataclass(frozen=True, slots=True)
class Change:
    """New coordinates named as the old ones: `new` is W, `old` is psi, for those that change.

    `functions` gives functions of the old coordinates in the new ones, where putting psi into them
    would leave them nested.
    """

    name: str
    new: Mapping[str, Expression]
    old: Mapping[str, Expression]
    functions: Mapping[Expression, Expression] = field(default_factory=dict)


def suggested(material: Material) -> list[Change]:
    """Changes worth a try, the most conspicuous first."""
    names = material.analysis.system.coordinates
    forms = [form for form, _ in _forms(material).most_common()]
    shears = list(dict.fromkeys(shear for form in forms for shear in _shears(form, names)))[:_MOST_SHEARS]
    rotations = dict.fromkeys(pair for form in forms for pair in _directions(form, names))
    return [
        *(_rotation(*pair) for pair in rotations),
        *(_shear(x, rest) for x, rest in shears if not _is_multiple(rest)),
        *_polar_changes(material),
        *_exponential_changes(material),
        *(_shear(x, rest) for x, rest in shears if _is_multiple(rest)),
    ]


def _forms(material: Material) -> Counter[Form]:
    """Functions of position w with w or w' a sum in f, each as a set of terms, with how often they stand there."""
    names = material.analysis.system.coordinates
    found: Counter[Form] = Counter()
    trees = [*material.analysis.system.accelerations, *material.position_letters]
    for tree in trees:
        for node in walk(tree):
            if isinstance(node, Sum):
                found.update(_primitives(node, names))
    return found


def _primitives(node: Sum, names: Iterable[str]) -> Iterator[Form]:
    """The sum itself without its constant, or the function of which it is the rate."""
    try:
        terms = terms_of(node)
    except TooManyTerms:
        return
    if all(isinstance(p, Symbol) and p.name in names for key in terms for p, _ in key if not _is_constant(p)):
        yield frozenset((key, value) for key, value in terms.items() if key)
    elif all(sum(isinstance(p, Velocity) for p, _ in key) == 1 for key in terms):
        whole = _integrated(terms)
        if whole is not None:
            yield frozenset(whole.items())


def _is_constant(letter: Expression) -> bool:
    return isinstance(letter, Number)


def _integrated(terms: Terms) -> Terms | None:
    """w with w' = sum c y^k y', or None where a term is of another kind."""
    found: Terms = {}
    for key, value in terms.items():
        ((velocity, degree),) = [(p, e) for p, e in key if isinstance(p, Velocity)]
        assert isinstance(velocity, Velocity)
        rest = dict(item for item in key if item[0] != velocity)
        y = Symbol(velocity.coordinate)
        exponent = rest.pop(y, Fraction(0))
        if rest or degree != 1 or exponent == -1:
            return None
        found[frozenset([(y, exponent + 1)])] = value / (exponent + 1)
    return found


def _shears(form: Form, names: Iterable[str]) -> Iterator[tuple[str, Expression]]:
    """(x, g) with the form a multiple of x + g, g without x."""
    table = dict(form)
    for name in names:
        single = frozenset([(Symbol(name), Fraction(1))])
        if single in table and len(table) > 1:
            rest = {key: value / table[single] for key, value in table.items() if key != single}
            if not any(node == Symbol(name) for node in walk(tree_of(rest))):
                yield name, tree_of(rest)


def _is_multiple(rest: Expression) -> bool:
    """Whether g is c y: such forms are taken as directions of a rotation first."""
    terms = terms_of(rest)
    return len(terms) == 1 and all(e == 1 for key in terms for _, e in key) and len(next(iter(terms))) == 1


def _shear(x: str, rest: Expression) -> Change:
    return Change("shear", {x: add(Symbol(x), rest)}, {x: subtract(Symbol(x), rest)})


def _directions(form: Form, names: tuple[str, ...]) -> Iterator[tuple[str, str, Fraction]]:
    """(x, y, c) for the part x + c y of a linear form, 0 < c up to a turn by a right angle."""
    single = {Symbol(name): name for name in names}
    linear = {single[p]: value for key, value in form for p, e in key if len(key) == 1 and e == 1 and p in single}
    chosen = sorted(linear, key=names.index)
    for k, x in enumerate(chosen):
        for y in chosen[k + 1 :]:
            c = linear[y] / linear[x]
            yield x, y, c if c > 0 else -1 / c


def _rotation(x: str, y: str, c: Fraction) -> Change:
    """X = a x + b y, Y = a y - b x with b/a = c, a and b whole."""
    a, b = number(c.denominator), number(c.numerator)
    length = number(c.denominator**2 + c.numerator**2)
    first, second = Symbol(x), Symbol(y)
    new = {x: add(multiply(a, first), multiply(b, second)), y: subtract(multiply(a, second), multiply(b, first))}
    old = {
        x: divide(subtract(multiply(a, first), multiply(b, second)), length),
        y: divide(add(multiply(b, first), multiply(a, second)), length),
    }
    return Change("rotation", new, old)


def _exponential_changes(material: Material) -> Iterator[Change]:
    """For each coordinate x with e^x or e^(k x) in f."""
    nodes = (node for f in material.analysis.system.accelerations for node in walk(f))
    arguments = dict.fromkeys(node.argument for node in nodes if isinstance(node, Apply) and node.function == "exp")
    multiples = [argument.factors for argument in arguments if isinstance(argument, Product)]
    bare = {factors[-1] for factors in multiples if len(factors) == 2 and isinstance(factors[0], Number)}
    for name in material.analysis.system.coordinates:
        if Symbol(name) in arguments or Symbol(name) in bare:
            yield Change("exponential", {name: Apply("exp", Symbol(name))}, {name: Apply("log", Symbol(name))})


def _polar_changes(material: Material) -> Iterator[Change]:
    """For each angle all other coordinates as radius."""
    names = material.analysis.system.coordinates
    trees = [to_kernels(f) for f in material.analysis.system.accelerations]
    for angle in names:
        circular: dict[Expression, Expression] = {
            Apply("sin", Symbol(angle)): Number(Fraction(3, 5)),
            Apply("cos", Symbol(angle)): Number(Fraction(4, 5)),
        }
        occurs = {node for tree in trees for node in walk(tree)} & set(circular)
        bare = any(node == Symbol(angle) for tree in trees for node in walk(substitute(tree, circular)))
        for radius in names if occurs and not bare else ():
            if radius != angle:
                yield _polar(radius, angle)


def _polar(radius: str, angle: str) -> Change:
    x, y = Symbol(radius), Symbol(angle)
    sine, cosine = Apply("sin", y), Apply("cos", y)
    length = square_root(add(power(x, 2), power(y, 2)))
    return Change(
        "polar",
        {radius: multiply(x, cosine), angle: multiply(x, sine)},
        {radius: length, angle: Apply("atan", divide(y, x))},
        {sine: divide(y, length), cosine: divide(x, length)},
    )
