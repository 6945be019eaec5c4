"""Each rewriting of a formula keeps what it says that it keeps, for formulas drawn at random: its
value, or the equations of motion of a Lagrangian. Nothing is said of how short the result is.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from functools import cache

import pytest
from mpmath import mp, mpf

from inverse_service.expressions import collecting, terms as tm, tree as ex, typed_scale
from inverse_service.expressions.printing import to_text
from inverse_service.field import exact_field, tower
from inverse_service.mechanics import (
    book_forms,
    euler_lagrange,
    inverses,
    legendre,
    square_forms,
    writing,
)
from inverse_service.mechanics.moves import Form, Holds, Move
from inverse_service.mechanics.second_order_system import SecondOrderSystem, system_of
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.search import antiderivatives, tidy
from tests.mechanics.drawn_formulas import (
    CONSTANTS,
    COORDINATES,
    DIGITS,
    LETTERS,
    POSITIONS,
    VELOCITIES,
    Drawn,
    agree,
    points,
    value,
)

ENOUGH = 5  # changed trees that are compared at points where they have a value
SEEDS = range(150)
SYSTEM = system_of(COORDINATES, [ex.ZERO] * 2, CONSTANTS, ())
MOVING: list[ex.Symbol | ex.Velocity] = [*POSITIONS, *VELOCITIES]
ACCELERATIONS = [ex.Symbol("x2"), ex.Symbol("y2")]
MOMENTA = tuple(ex.Symbol(f"p_{name}") for name in COORDINATES)
FAILED = (tm.TooManyTerms, exact_field.TooLarge, ZeroDivisionError)
REWRITINGS: dict[str, Callable[[ex.Expression], ex.Expression | Iterable[ex.Expression]]] = {
    "collect": collecting.collect,
    "merge_powers": collecting.merge_powers,
    "collected": tm.collected,
    "joined": writing.joined,
    "quotient": lambda tree: writing.quotient(tree, exact_field.Budget.short()),
    "shorten": lambda tree: writing.shorten(tree, exact_field.Budget.short()),
    "collected_inside": writing.collected_inside,
    "as_one_quotient": writing.as_one_quotient,
    "one_square": writing.one_square,
    "turned": writing.turned,
    "minus_inside": writing.minus_inside,
    "numbers_outside": writing.numbers_outside,
    "with_sizes": writing.with_sizes,
    "plain_quotients": writing.plain_quotients,
    "separated": writing.separated,
    "opaque_quotient": writing.opaque_quotient,
    "simplified": writing.simplified,
    "exact_quotient": writing.exact_quotient,
    "exponentials_above": writing.exponentials_above,
    "inside": writing.inside,
    "trigonometric": writing.trigonometric,
    "with_shortest_sums": writing.with_shortest_sums,
    "with_cosines": writing.with_cosines,
    "with_products_in_order": lambda tree: writing.with_products_in_order(tree, LETTERS),
    "with_one_coefficient": lambda tree: writing.with_one_coefficient(tree, VELOCITIES),
    "short_forms": lambda tree: square_forms.short_forms(tree, VELOCITIES),
    "sums_of_squares": lambda tree: square_forms.sums_of_squares(
        collecting.collect(tree), (*POSITIONS, *VELOCITIES)
    ),
    "proper_quotients": lambda tree: square_forms.proper_quotients(tree, VELOCITIES, LETTERS),
    "shortest_form": lambda tree: square_forms.shortest_form(tree, VELOCITIES, POSITIONS),
    "with_common_constants": lambda tree: book_forms.with_common_constants(
        tree, VELOCITIES, LETTERS
    ),
    "with_joined_coefficients": lambda tree: book_forms.with_joined_coefficients(tree, LETTERS),
    "in_one_logarithm": book_forms.in_one_logarithm,
    "with_inverse_sines": book_forms.with_inverse_sines,
    "upright": book_forms.upright,
    "kinetic_first": tidy.kinetic_first,
    "factored_tree": lambda tree: antiderivatives.factored_tree(tree, MOVING),
    "lightest_form": lambda tree: antiderivatives.lightest_form(tree, MOVING),
    "factored_inside": inverses.factored_inside,
    "to_kernels": tower.to_kernels,
    "in_typed_scale": lambda tree: typed_scale.in_typed_scale(
        tree, frozenset([Fraction(1, 2), Fraction(3, 4)])
    ),
}
# Roots are powers of letters there: (u^2)^(1/2) is u, wherever u is positive.
OF_POSITIVE_BASES = ("collected", "with_shortest_sums")


@cache
def _drawn(seed: int) -> tuple[ex.Expression, list[tuple[dict[ex.Expression, mpf], mpf]]]:
    """A tree and its values where it has one, at two points."""
    tree = Drawn(seed).tree()
    with mp.workdps(DIGITS):
        found = [(point, value(tree, dict(point))) for point in points(seed, 2)]
    return tree, [(point, one) for point, one in found if one is not None]


def _has_roots_of_squares(tree: ex.Expression) -> bool:
    return any(
        isinstance(node, ex.Power)
        and isinstance(node.exponent, ex.Number)
        and node.exponent.value.denominator % 2 == 0
        and not isinstance(node.base, ex.Sum)
        for node in ex.walk(tree)
    )


@pytest.mark.parametrize("name", REWRITINGS)
def test_a_rewritten_formula_has_the_same_values(name: str) -> None:
    """At each point where the formula has one, the new one has it too."""
    compared = 0
    for seed in SEEDS:
        tree, known = _drawn(seed)
        if name in OF_POSITIVE_BASES and _has_roots_of_squares(tree):
            continue
        with suppress(*FAILED):
            found = REWRITINGS[name](tree)
            forms = [found] if isinstance(found, ex.Expression) else [*found]
            for form in [one for one in forms if one != tree][:3]:
                with mp.workdps(DIGITS):
                    for point, expected in known:
                        seen = value(form, dict(point))
                        assert seen is not None, (seed, to_text(form))
                        assert agree(seen, expected), (seed, to_text(form))
                compared += bool(known)
        if compared >= ENOUGH:
            return
    assert compared > 1


SQUARES = [
    ("a*sin(x)^2 + a*cos(x)^2", "a"),
    ("2*cosh(x)^2 - 2*sinh(x)^2", "2"),
    ("y/(b*cosh(x)^2 - b*sinh(x)^2)", "y/b"),
    ("a - a*cos(x)^2", "a*sin(x)^2"),
    ("a*cosh(x)^2 - a", "a*sinh(x)^2"),
    ("a + a*sinh(x)^2", "a*cosh(x)^2"),
    ("a*sin(x)^2 - a*cos(x)^2", "a*sin(x)^2 - a*cos(x)^2"),
    ("a*cosh(x)^2 + a*sinh(x)^2", "a*cosh(x)^2 + a*sinh(x)^2"),
    ("a*cosh(x)^2 - a*sinh(y)^2", "a*cosh(x)^2 - a*sinh(y)^2"),
]


@pytest.mark.parametrize(("text", "expected"), SQUARES)
def test_two_squares_of_one_argument_are_one_or_none(text: str, expected: str) -> None:
    names = Names(("x", "y"), ("a", "b"), {})
    assert writing.one_square(read_formula(text, names)) == read_formula(expected, names)


TABLES: tuple[Move[SecondOrderSystem] | Form[SecondOrderSystem], ...] = (
    *tidy.GAUGES,
    *tidy.FORMS,
    *tidy.STYLE,
)
# These change nothing without a system of their own, typed decimals, or the L of H beside them.
OF_THEIR_OWN = (
    "F(x) y' for -y B(x) x', F' = B",
    "no divisor of constants",
    "decimal numbers in their terms",
    "no quotient under a root in a denominator",
    "the potential of L",
)
KNOWN = {move.name: move for move in TABLES if move.name not in OF_THEIR_OWN}
ENERGY = [move for move in legendre.ENERGY if move.name not in OF_THEIR_OWN]
# What some moves look for is drawn too seldom.
PLANTED = {
    "asinh(u) for log(u + sqrt(u^2 + 1))": "y'*log(y' + sqrt(y'^2 + 1)) - sqrt(y'^2 + 1) + y + x'^2",
    "squares of velocities like those of coordinates": "x'^2/2 + y'^2/2 - m*(x^2 + y^2)",
    "one logarithm of a quotient": "a^2*log(x^2) - a^2*log(y^2)/2 + x'^2",
    "log(b/a) for -log(a/b)": "x'^2 - log(a^2/(x - b)^2)",
    "abs(u)^3 for (u^2)^(3/2)": "x'^2 + ((x + y)^2)^(3/2)",
}
NAMES = Names(COORDINATES, CONSTANTS)


def _lagrangians(name: str) -> Iterator[tuple[int, ex.Expression]]:
    """Drawn ones, or those with what the move looks for."""
    planted = read_formula(PLANTED[name], NAMES) if name in PLANTED else ex.ZERO
    for seed in range(3 if planted != ex.ZERO else 60):
        yield seed, planted if planted != ex.ZERO else Drawn(seed).lagrangian()


def _states(seed: int, count: int) -> Iterator[dict[ex.Expression, mpf]]:
    """Points with the same constants, and with accelerations."""
    source = random.Random(seed)
    point = dict[ex.Expression, mpf]((letter, mpf(source.uniform(-2, 2))) for letter in LETTERS)
    leaves: list[ex.Expression] = [ex.TIME, *MOVING, *ACCELERATIONS]
    for _ in range(count):
        for leaf in leaves:
            point[leaf] = mpf(source.uniform(-2, 2))
        yield dict(point)


def _pairs(before: ex.Expression, after: ex.Expression, seed: int) -> Iterator[tuple[mpf, mpf]]:
    """Their values where both have one."""
    for point in _states(seed, 3):
        one, other = value(before, dict(point)), value(after, dict(point))
        if one is not None and other is not None:
            yield one, other


def _residuals(before: ex.Expression, after: ex.Expression, seed: int) -> list[tuple[mpf, mpf]]:
    """Their Euler-Lagrange expressions along arbitrary accelerations."""
    both = (
        euler_lagrange.euler_lagrange_sums(tree, COORDINATES, ACCELERATIONS)
        for tree in (before, after)
    )
    return [pair for one, other in zip(*both, strict=True) for pair in _pairs(one, other, seed)]


def _has_kept(holds: Holds, before: ex.Expression, after: ex.Expression, seed: int) -> bool | None:
    """Whether the tree after a move agrees with that before it; None where nothing was compared."""
    with mp.workdps(DIGITS):
        if holds in (Holds.WHERE_DEFINED, Holds.CONSTANT):
            found = [*_pairs(before, after, seed)]
            shift = found[0][0] - found[0][1] if found and holds is Holds.CONSTANT else mpf(0)
        else:
            found, shift = _residuals(before, after, seed), mpf(0)
        if holds is Holds.FACTOR:
            ratio = next((other / one for one, other in found if one), mpf(0))
            found = [(ratio * one, other) for one, other in found]
        return all(agree(one - shift, other) for one, other in found) if found else None


@pytest.mark.parametrize("name", KNOWN)
def test_a_move_keeps_what_it_says_of_a_lagrangian(name: str) -> None:
    """Its value, up to a constant, its equations, or these up to a constant factor."""
    move, compared = KNOWN[name], 0
    for seed, tree in _lagrangians(name):
        with suppress(*FAILED):
            for before in (tree, collecting.collect(tree)):
                found = (
                    [*move.variants(SYSTEM, before)]
                    if isinstance(move, Form)
                    else [move.apply(SYSTEM, before)]
                )
                for after in [one for one in found if one != before][:3]:
                    kept = _has_kept(move.holds, before, after, seed)
                    assert kept is not False, (seed, to_text(before), to_text(after))
                    compared += kept is not None
        if compared >= 5:
            break
    assert compared


@pytest.mark.parametrize("move", ENERGY, ids=lambda move: move.name)
def test_a_move_keeps_the_value_of_a_hamiltonian(move: Move[legendre._Setting]) -> None:
    """H with momenta in place of velocities, and L as that whose words it takes."""
    compared = 0
    for seed, tree in _lagrangians(move.name):
        lagrangian = Drawn(seed + 1).lagrangian()
        table = dict(zip(VELOCITIES, MOMENTA, strict=True))
        before = ex.substitute(tree, table)
        setting = legendre._Setting(lagrangian, MOMENTA, COORDINATES)
        with suppress(*FAILED):
            after = move.apply(setting, before)
            if after != before:
                back = {momentum: velocity for velocity, momentum in table.items()}
                one, other = (ex.substitute(tree, back) for tree in (before, after))
                kept = _has_kept(move.holds, one, other, seed)
                assert kept is not False, (seed, to_text(before), to_text(after))
                compared += kept is not None
        if compared >= 5:
            break
    assert compared


def test_what_a_lagrangian_is_shortened_to_has_its_equations() -> None:
    """A constant may go from a bracket before which is a function of t, not one of a coordinate:
    (x'^2 - k (x - l)^2)/y is another Lagrangian than (x'^2 - k x^2 + 2 k l x)/y.
    """
    for seed in range(6):
        tree = Drawn(seed).lagrangian()
        x, y, k, length = (*POSITIONS, *LETTERS[:2])
        spring = VELOCITIES[0] ** 2 + VELOCITIES[1] ** 2 - k * x**2 + 2 * k * length * x
        for before in (tree, spring / y, spring / (x + y)):
            after = tidy.shorten_lagrangian(before, SYSTEM)
            assert _has_kept(Holds.FACTOR, before, after, seed) is not False, to_text(after)
