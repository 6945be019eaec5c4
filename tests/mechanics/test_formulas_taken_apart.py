"""What a formula is taken apart into gives the formula back, for formulas drawn at random."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from fractions import Fraction
from functools import cache

import pytest
from mpmath import mp, mpf

from inverse_service.expressions import calculus, collecting, terms as tm, tree as ex
from inverse_service.expressions.printing import to_text
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics import inverses, square_forms, writing
from inverse_service.search import antiderivatives
from tests.mechanics.drawn_formulas import (
    DIGITS,
    LETTERS,
    POSITIONS,
    VELOCITIES,
    Drawn,
    agree,
    points,
    value,
)

SEEDS = range(60)
ENOUGH = 5  # formulas that are taken apart and have a value
FAILED = (tm.TooManyTerms, exact_field.TooLarge, ZeroDivisionError)


def _of_content(tree: ex.Expression) -> ex.Expression:
    number, common, primitive = tm.split_content(tm.terms_of(tree))
    return number * tm.monomial_tree(common) * primitive


def _power_of_factors(exponent: int) -> Callable[[ex.Expression], ex.Expression]:
    def again(tree: ex.Expression) -> ex.Expression:
        power = tm.power_of_factors(tm.terms_of(tree), Fraction(exponent))
        return tm.tree_of(power) / tree ** (exponent - 1)

    return again


def _of_terms(change: Callable[[tm.Terms], tm.Terms]) -> Callable[[ex.Expression], ex.Expression]:
    return lambda tree: tm.tree_of(change(tm.terms_of(tree)))


def _of_a_square(tree: ex.Expression) -> ex.Expression:
    outside, inside = antiderivatives.even_root(tree)
    return outside**2 * inside


def _of_laurent(tree: ex.Expression) -> ex.Expression:
    for leaf in VELOCITIES:
        if found := inverses.laurent_polynomial(tree, leaf):
            powers = found.coefficients.items()
            tree = ex.add(*(c * ex.power(found.generator, e) for e, c in powers))
    return tree


PARTS: dict[str, Callable[[ex.Expression], ex.Expression]] = {
    "content, common factor and primitive part": _of_content,
    "square of factors": _power_of_factors(2),
    "inverse of factors": _power_of_factors(-1),
    "multiple angles": _of_terms(tm.by_multiple_angles),
    "fewest terms in angles": _of_terms(tm.shortest_in_angles),
    "one of two squares": _of_terms(antiderivatives.in_one_square),
    "square and the rest": _of_a_square,
    "square root with factors outside": lambda tree: antiderivatives.extracted_root(tree) ** 2,
    "powers of one generator": _of_laurent,
    "inverse root upright": lambda tree: (
        writing.roots_upright(ex.power(tree, Fraction(-1, 2))) ** -2
    ),
}
# There sqrt(u^2) is u, wherever u is positive.
OF_POSITIVE_BASES = {*PARTS} - {"powers of one generator", "inverse root upright"}
OF_POSITIVE_FORMULAS = {"square root with factors outside", "inverse root upright"}


@cache
def drawn(seed: int) -> tuple[ex.Expression, list[tuple[dict[ex.Expression, mpf], mpf]]]:
    """A tree and its values where it has one, at two points."""
    tree = Drawn(10_000 + seed).tree()
    with mp.workdps(DIGITS):
        found = [(point, value(tree, dict(point))) for point in points(seed, 2)]
    return tree, [(point, one) for point, one in found if one is not None]


def _has_roots(tree: ex.Expression) -> bool:
    return any(
        isinstance(node, ex.Power) and not exact_field.is_integer_power(node)
        for node in ex.walk(tree)
    )


@pytest.mark.parametrize("name", PARTS)
def test_parts_give_the_formula_back(name: str) -> None:
    compared = 0
    for seed in SEEDS:
        tree, known = drawn(seed)
        if not known or (name in OF_POSITIVE_BASES and _has_roots(tree)):
            continue
        with suppress(*FAILED):
            found = PARTS[name](tree)
            if found == tree:
                continue
            with mp.workdps(DIGITS):
                for point, expected in known:
                    if name in OF_POSITIVE_FORMULAS and expected <= 0:
                        continue
                    seen = value(found, dict(point))
                    assert seen is not None, (seed, to_text(found))
                    assert agree(seen, expected), (seed, to_text(tree), to_text(found))
                    compared += 1
    assert compared >= ENOUGH


def test_a_part_with_the_sign_of_a_formula_has_it() -> None:
    shorter = 0
    for seed in SEEDS[:10]:
        tree, known = drawn(seed)
        with suppress(*FAILED):
            part = writing.sign_part(tree)
            shorter += part != tree
            with mp.workdps(DIGITS):
                for point, expected in known:
                    seen = value(part, dict(point))
                    assert seen is not None, (seed, to_text(part))
                    assert mp.sign(seen) == mp.sign(expected), (seed, to_text(tree), to_text(part))
    assert shorter >= ENOUGH


def test_what_is_proven_positive_is_positive_wherever_it_has_a_value() -> None:
    """Of formulas, their squares with something added, and what follows from positive letters."""
    proven = {False: 0, True: 0}
    letters = [ex.Symbol("a"), ex.Symbol("b"), ex.Symbol("m")]
    for seed in SEEDS[:15]:
        tree = Drawn(20_000 + seed).factor(0)
        forms = [tree, -tree, tree**2 + 1, tree**2 * letters[0] + letters[1], tree**2 - 1]
        for form in forms:
            for given in (False, True):
                if not real_branch.is_positive(form, letters if given else ()):
                    continue
                proven[given] += 1
                with mp.workdps(DIGITS):
                    for point in points(seed, 3):
                        if given and any(point[letter] <= 0 for letter in letters):
                            continue
                        seen = value(form, dict(point))
                        assert seen is None or seen > 0, (seed, to_text(form))
    assert proven[True] > proven[False] >= ENOUGH


def test_the_power_of_a_form_differs_from_it_by_a_constant_only() -> None:
    """Sums to powers, expanded, so that the form has to be found again."""
    for seed in SEEDS[:30]:
        source = Drawn(30_000 + seed)
        form, exponent, factor = source.linear() + 1, 2 + seed % 3, ex.number(seed % 5 - 7)
        tree = collecting.collect(factor * form**exponent)
        power = square_forms.power_of_form(tree)
        assert power is not None, to_text(tree)
        base, k = power
        assert k == exponent
        with mp.workdps(DIGITS):
            shares = []
            for point in points(seed, 3):
                table = dict(point)
                shares.append(calculus.evaluate(tree, table) / calculus.evaluate(base**k, table))
            assert all(agree(share, shares[0]) for share in shares), (seed, to_text(base))


def wrapped(seed: int, leaf: ex.Expression) -> ex.Expression:
    """A formula that holds the leaf once, in two or three operations."""
    source = Drawn(40_000 + seed)
    tree = leaf
    for _ in range(2 + seed % 2):
        c = source.monomial([*LETTERS, *POSITIONS])
        tree = source.source.choice([
            c * tree, tree + c, 1 / tree, tree**2, tree**3, ex.square_root(tree + 3), ex.power(tree, Fraction(2, 3)),
            *(ex.Apply(name, tree) for name in ("exp", "log", "sinh", "tanh", "atan", "asinh", "cosh")),
            ex.power(ex.number(2), tree), tree**-2,
        ])  # fmt: skip
    return tree


def test_what_is_isolated_solves_the_equation_and_no_solution_is_left_out() -> None:
    """Of tree = p with p the value of the tree at a velocity, which is a solution then."""
    p, leaf = ex.Symbol("p"), VELOCITIES[0]
    solved = 0
    for seed in SEEDS:
        tree = wrapped(seed, leaf)
        roots = [*inverses.isolate(tree, leaf, inverses.Root(p))]
        with mp.workdps(DIGITS):
            for point in points(seed, 2):
                target = value(tree, dict(point))
                if target is None or not roots:
                    continue
                found = []
                for root in roots:
                    at = {**point, p: target}
                    holds = [value(one, dict(at)) for one in root.conditions]
                    velocity = value(root.value, dict(at))
                    if velocity is None or any(one is None or one <= 0 for one in holds):
                        continue
                    again = value(tree, {**point, leaf: velocity})
                    assert again is not None, (seed, to_text(tree), to_text(root.value))
                    assert agree(again, target), (seed, to_text(tree), to_text(root.value))
                    found.append(velocity)
                assert any(agree(one, point[leaf]) for one in found), (seed, to_text(tree))
                solved += 1
    assert solved >= 30
