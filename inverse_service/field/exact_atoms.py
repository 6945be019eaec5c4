"""Formulas into an exact ring: their functions become generators, level by level of nesting.

Within a level the arguments of exp, log and the trigonometric functions are first written in a basis over
Q, so that exp(x + y), exp(x) and exp(y) or sin(2x) and cos(x) share generators.

Arbitrary functions: each partial derivative of each one is a generator of its own.

Roots, and the inverse functions whose derivatives hold them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction

from inverse_service.expressions.tree import (
    Apply,
    Arbitrary,
    Expression,
    Integral,
    Number,
    Power,
    Symbol,
    Velocity,
    children,
    distinct_nodes,
    split_exponent,
)
from inverse_service.field.exact_ring import (
    ExactRing,
    add_symbols,
    generator_power,
    is_integer_power,
    polynomial_tree,
    quotient_tree,
    scaled_tree,
)
from inverse_service.field.exact_trigonometric import (
    HYPERBOLIC,
    TRIGONOMETRIC,
    adjoin_pairs,
    argument_basis,
    coordinates_of,
    factor_coordinates,
)
from inverse_service.field.rational_functions import Budget, Quotient, QuotientField

Family = tuple[str, tuple[Expression, ...]]


def adjoin_arbitrary(ring: ExactRing, nodes: Sequence[Arbitrary], further: int) -> None:
    """Generators for the functions in `nodes` and their derivatives of `further` more orders.

    Derivatives of the highest order have none in their turn and are marked undefined.
    """
    families: dict[Family, int] = {}
    for node in nodes:
        if isinstance(node, Integral):
            index = ring.new_generator(node)
            ring.atoms[node] = ring.generator(index)
            ring.undefined.add(index)
            continue
        family = (node.name, node.arguments)
        families[family] = max(families.get(family, 0), sum(node.orders))
    for (name, arguments), order in families.items():
        _adjoin_family(ring, name, arguments, order + further)


def _adjoin_family(ring: ExactRing, name: str, arguments: tuple[Expression, ...], highest: int) -> None:
    values = [ring.value(argument) for argument in arguments]
    indices: dict[tuple[int, ...], int] = {}
    # From the highest order down, so that lower derivatives are the greater generators.
    for orders in sorted(_orders(len(arguments), highest), key=lambda k: (-sum(k), k)):
        node = Arbitrary(name, arguments, orders)
        indices[orders] = ring.new_generator(node)
        ring.atoms[node] = ring.generator(indices[orders])
        if sum(orders) == highest:
            ring.undefined.add(indices[orders])
            continue
        slopes = [(_next(ring, indices, orders, place), value) for place, value in enumerate(values)]
        ring.set_slopes(indices[orders], slopes)


def _orders(length: int, highest: int) -> list[tuple[int, ...]]:
    return [k for k in itertools.product(range(highest + 1), repeat=length) if sum(k) <= highest]


def _next(ring: ExactRing, indices: dict[tuple[int, ...], int], orders: tuple[int, ...], place: int) -> Quotient:
    raised = tuple(order + (position == place) for position, order in enumerate(orders))
    return ring.generator(indices[raised])


# The derivative of each inverse function is sign / (constant + quadratic u^2)^exponent.
INVERSE: dict[str, tuple[int, int, int, Fraction]] = {
    "asin": (1, 1, -1, Fraction(1, 2)),
    "acos": (-1, 1, -1, Fraction(1, 2)),
    "atan": (1, 1, 1, Fraction(1)),
    "asinh": (1, 1, 1, Fraction(1, 2)),
    "acosh": (1, -1, 1, Fraction(1, 2)),
    "atanh": (1, 1, -1, Fraction(1)),
}


def adjoin_roots(ring: ExactRing, powers: Sequence[Power]) -> None:
    """Generators for rational powers; powers of one base share the root of the common denominator."""
    degrees: dict[Expression, int] = {}
    for node in powers:
        assert isinstance(node.exponent, Number)
        degrees[node.base] = math.lcm(degrees.get(node.base, 1), node.exponent.value.denominator)
    for base, degree in degrees.items():
        root = root_generator(ring, ring.value(base), base, degree)
        for node in powers:
            if node.base == base and isinstance(node.exponent, Number):
                ring.atoms[node] = root ** int(node.exponent.value * degree)


def root_generator(ring: ExactRing, radicand: Quotient, tree: Expression, degree: int) -> Quotient:
    """An element r with r^degree = radicand; the same radicand gives the same generator.

    For the radicand a/b the generator is b (a/b)^(1/degree), a root of the polynomial a b^(degree-1).
    """
    if radicand.is_zero:
        return radicand
    below = Quotient(ring.field, ring.field.expand(radicand.exponents), ())
    polynomial = (Quotient(ring.field, radicand.numerator, ()) * below ** (degree - 1)).numerator
    for relation in ring.field.relations.values():
        if relation.degree % degree == 0 and relation.right == polynomial and _is_root(ring, relation.generator):
            return ring.generator(relation.generator) ** (relation.degree // degree) / below
    root = tree ** Fraction(1, degree)
    index = ring.new_generator(polynomial_tree(ring, below.numerator) * root)
    ring.field.relate(index, degree, polynomial)
    whole = Quotient(ring.field, polynomial, ())
    ring.set_slopes(index, [(ring.generator(index) / whole.scaled(degree), whole)])
    return ring.generator(index) / below


def _is_root(ring: ExactRing, index: int) -> bool:
    """Whether the generator is a root, not a sine; sqrt(1 - cos^2) is sin up to a sign only."""
    return not isinstance(ring.trees[index], Apply)


def adjoin_inverse(ring: ExactRing, node: Apply) -> None:
    """A generator for asin, acos, atan, asinh, acosh or atanh of an argument."""
    sign, constant, quadratic, exponent = INVERSE[node.function]
    argument = ring.value(node.argument)
    below = ring.constant(constant) + (argument * argument).scaled(quadratic)
    if exponent.denominator == 2:
        square = node.argument**2
        tree = constant + quadratic * square
        below = root_generator(ring, below, tree, 2)
    index = ring.new_generator(node)
    ring.set_slopes(index, [(below.inverse().scaled(sign), argument)])
    ring.atoms[node] = ring.generator(index)


def exact_ring(
    trees: Sequence[Expression],
    variables: Sequence[Symbol | Velocity],
    orders: int,
    budget: Budget,
    further: Sequence[Symbol] = (),
    spare: bool = False,
    slopes: bool = True,
) -> ExactRing:
    """A ring that holds the trees and can differentiate them `orders` times by the variables.

    `further` are constants to be adjoined that do not occur in the trees. With `spare` the ring may keep
    generators without use, which saves making it again for work that is short; without `slopes` it cannot
    differentiate, which saves the derivatives of all generators. Raises TooLarge where the budget ends and
    ZeroDivisionError for a division by zero in a tree.
    """
    symbols = [*further, *_symbols(trees, variables)]
    size = len(symbols) + _generators_needed(trees, orders)
    generous = _build(trees, variables, symbols, orders, budget, size, slopes)
    used = len(generous.trees)
    if spare or generous.free == 0:
        return generous
    return _build(trees, variables, symbols, orders, budget, used, slopes)


def factored(trees: Sequence[Expression], symbols: Sequence[Symbol | Velocity], budget: Budget) -> list[Expression]:
    """The trees, each over its common denominator with numerator and denominator factored.

    TooLarge where the budget ends, ZeroDivisionError where a denominator vanishes, KeyError for an unknown atom.
    """
    ring = exact_ring(trees, symbols, 0, budget, spare=True, slopes=False)
    return [quotient_tree(ring, ring.value(tree)) for tree in trees]


def _build(
    trees: Sequence[Expression],
    variables: Sequence[Symbol | Velocity],
    symbols: Sequence[Symbol | Velocity],
    orders: int,
    budget: Budget,
    size: int,
    slopes: bool,
) -> ExactRing:
    ring = ExactRing(QuotientField.with_generators(size, budget), tuple(variables), size, slopes)
    add_symbols(ring, symbols)
    names = _occurring(trees)
    for level in _levels(trees):
        _adjoin_level(ring, level, orders, names)
    return ring


def _symbols(trees: Sequence[Expression], variables: Sequence[Symbol | Velocity]) -> list[Symbol | Velocity]:
    """Parameters and numbers such as pi last, so that they get the smallest place in the order."""
    found = dict.fromkeys(node for node in distinct_nodes(trees) if isinstance(node, Symbol | Velocity))
    constants = [symbol for symbol in found if symbol not in variables]
    return constants + list(reversed(variables))


def _occurring(trees: Sequence[Expression]) -> frozenset[str]:
    """Names of the functions in the trees, and "power" for a power with a symbolic exponent."""
    names = set()
    for node in distinct_nodes(trees):
        if isinstance(node, Apply):
            names.add(node.function)
        elif isinstance(node, Power) and not isinstance(node.exponent, Number):
            names.add("power")
    return frozenset(names)


def _is_function(node: Expression) -> bool:
    return isinstance(node, Apply | Arbitrary) or (isinstance(node, Power) and not is_integer_power(node))


def _generators_needed(trees: Sequence[Expression], orders: int) -> int:
    """An upper bound; exact counting would need the arguments' relations."""
    atoms = {node for node in distinct_nodes(trees) if _is_function(node)}
    total = 0
    for node in atoms:
        total += 4
        if isinstance(node, Arbitrary):
            total += math.comb(len(node.arguments) + sum(node.orders) + orders, len(node.arguments))
    return total


def _levels(trees: Sequence[Expression]) -> list[list[Expression]]:
    """The functions in the trees by nesting: arguments of level k hold levels below k only."""
    depth: dict[Expression, int] = {}

    def measure(node: Expression) -> int:
        if node not in depth:
            inside = max(map(measure, children(node)), default=0)
            depth[node] = inside + 1 if _is_function(node) else inside
        return depth[node]

    top = max(map(measure, trees), default=0)
    found = [node for node in depth if _is_function(node)]
    return [[node for node in found if depth[node] == level] for level in range(1, top + 1)]


def _adjoin_level(ring: ExactRing, level: Sequence[Expression], orders: int, names: frozenset[str]) -> None:
    """Generators for all functions of one level."""
    adjoin_roots(ring, [node for node in level if isinstance(node, Power) and isinstance(node.exponent, Number)])
    symbolic = [node for node in level if isinstance(node, Power) and not isinstance(node.exponent, Number)]
    _adjoin_logarithms(ring, [*_applied(level, {"log"}), *(Apply("log", node.base) for node in symbolic)])
    hyperbolic = _applied(level, HYPERBOLIC)
    by_exponentials = bool(names & {"exp", "power"})
    exponentials = _applied(level, {"exp"}) + (hyperbolic if by_exponentials else [])
    _adjoin_exponentials(ring, exponentials, symbolic)
    adjoin_pairs(ring, _applied(level, TRIGONOMETRIC), -1)
    if not by_exponentials:
        adjoin_pairs(ring, hyperbolic, 1)
    for node in _applied(level, INVERSE):
        adjoin_inverse(ring, node)
    adjoin_arbitrary(ring, [node for node in level if isinstance(node, Arbitrary)], orders)


def _applied(level: Sequence[Expression], names: Iterable[str]) -> list[Apply]:
    wanted = frozenset(names)
    return [node for node in level if isinstance(node, Apply) and node.function in wanted]


def _adjoin_logarithms(ring: ExactRing, nodes: Sequence[Apply]) -> None:
    """log of products: a basis of the arguments' exponent vectors over Q."""
    nodes = list(dict.fromkeys(node for node in nodes if node not in ring.atoms))
    arguments = [ring.value(node.argument) for node in nodes]
    basis = argument_basis([factor_coordinates(argument) for argument in arguments])
    generators = []
    for place, scale in zip(basis.chosen, basis.scales, strict=True):
        index = ring.new_generator(scaled_tree(nodes[place], scale))
        slope = arguments[place].inverse().scaled(Fraction(1, scale))
        ring.set_slopes(index, [(slope, arguments[place])])
        generators.append(ring.generator(index))
    for node, row in zip(nodes, basis.coefficients, strict=True):
        total = ring.constant(0)
        for generator, coefficient in zip(generators, row, strict=True):
            total = total + generator.scaled(coefficient)
        ring.atoms[node] = total


def _adjoin_exponentials(ring: ExactRing, nodes: Sequence[Apply], powers: Sequence[Power]) -> None:
    """exp(u), u^e = exp(e log u), and hyperbolic functions through exp(u); u^(e + 1) is u u^e."""
    parts = [split_exponent(node.exponent) for node in powers]
    symbolic = [Power(node.base, rest) for node, (rest, _) in zip(powers, parts, strict=True)]
    arguments = [ring.value(node.argument) for node in nodes]
    arguments += [ring.value(node.exponent) * ring.value(Apply("log", node.base)) for node in symbolic]
    trees: list[Expression] = [Apply("exp", node.argument) for node in nodes]
    basis = argument_basis([coordinates_of(argument) for argument in arguments])
    generators = []
    for place, scale in zip(basis.chosen, basis.scales, strict=True):
        tree = (trees + symbolic)[place]
        index = ring.new_generator(generator_power(tree, Fraction(1, scale)))
        argument = arguments[place].scaled(Fraction(1, scale))
        ring.set_slopes(index, [(ring.generator(index), argument)])
        generators.append(ring.generator(index))
    functions: list[Apply | Power] = [*nodes, *powers]
    wholes = [*(0 for _ in nodes), *(whole for _, whole in parts)]
    for node, whole, row in zip(functions, wholes, basis.coefficients, strict=True):
        product = ring.constant(1)
        for generator, coefficient in zip(generators, row, strict=True):
            product = product * generator**coefficient
        ring.atoms[node] = (
            _of_exponential(node.function, product)
            if isinstance(node, Apply)
            else product * ring.value(node.base) ** whole
        )


def _of_exponential(function: str, e: Quotient) -> Quotient:
    """The hyperbolic function of u, given exp(u)."""
    other = e.inverse()
    sine, cosine = (e - other).scaled(Fraction(1, 2)), (e + other).scaled(Fraction(1, 2))
    table: dict[str, Callable[[], Quotient]] = {
        "exp": lambda: e,
        "sinh": lambda: sine,
        "cosh": lambda: cosine,
        "tanh": lambda: sine / cosine,
        "coth": lambda: cosine / sine,
        "sech": lambda: cosine.inverse(),
        "csch": lambda: sine.inverse(),
    }
    return table[function]()
