"""Lists of leaves without those that repeat others."""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from fractions import Fraction

import pytest
from flint import fmpq_mpoly

from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import polynomials, tree as ex
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.solving import leaves, members, shorter_leaves
from inverse_service.solving.shorter_leaves import Row

NO, YES = ("not_variational",) * 2, ("variational",) * 2
EVER = float("inf")


@pytest.fixture(scope="module")
def work() -> members._Work:
    system = read_system(["x", "y"], {"x": "a*x + b*y", "y": "c*x"}, [*"abc"])
    return members._prepared(system, [*"abc"], [], SolveOptions(), EVER)


def ever() -> shorter_leaves.Allowance:
    return shorter_leaves.Allowance(EVER)


def letters(work: members._Work) -> list[fmpq_mpoly]:
    return [work.exact.ring.value(ex.Symbol(name)).numerator for name in "abc"]


def leaf(
    work: members._Work, *equations: fmpq_mpoly, nonzero: Sequence[fmpq_mpoly] = ()
) -> leaves.Leaf:
    (found,) = leaves.split_leaf(leaves.Leaf(work.unknowns, (), tuple(nonzero)), equations, EVER)
    return found


def verdicts_of(work: members._Work, rows: Sequence[Row], values: dict[int, int]) -> object:
    """Those of the last row that holds the member with these constants."""

    def value(polynomial: fmpq_mpoly) -> Fraction:
        total = Fraction(0)
        for exponents, coefficient in polynomial.terms():
            term = polynomials.as_fraction(coefficient)
            for place, power in enumerate(exponents):
                term *= Fraction(values.get(place, 1)) ** int(power)
            total += term
        return total

    found: object = None
    for row in rows:
        holds = not any(map(value, row.leaf.equations)) and all(map(value, row.leaf.nonzero))
        found = row.verdicts if holds else found
    return found


def test_a_leaf_in_another_with_its_verdicts_is_left_out(work: members._Work) -> None:
    a, b, _ = letters(work)
    rows = [Row(leaf(work), NO), Row(leaf(work, a), YES), Row(leaf(work, a, b), YES)]
    assert [*shorter_leaves.shorter(rows, [1, 2], work.draw, ever())] == [0, 1]


def test_a_leaf_stays_where_its_members_cross_one_with_another_verdict(
    work: members._Work,
) -> None:
    """c = b = 0 repeats c = 0 in general, not where a = 0, too."""
    a, b, c = letters(work)
    rows = [
        Row(leaf(work), NO),
        Row(leaf(work, c), YES),
        Row(leaf(work, a), NO),
        Row(leaf(work, b, c), YES),
    ]
    assert [*shorter_leaves.shorter(rows, [3], work.draw, ever())] == [0, 1, 2, 3]
    wider = [*rows, Row(leaf(work, a, c), YES)]
    assert [*shorter_leaves.shorter(wider, [3], work.draw, ever())] == [0, 1, 2, 4]


def test_two_leaves_become_one_without_an_inequation(work: members._Work) -> None:
    """a = 0 where b != 0, and a = b = 0, is a = 0, unless a = b = 0 is none where c = 0."""
    a, b, c = letters(work)
    parted = Row(leaf(work, a, nonzero=[b]), YES)
    rows = [Row(leaf(work), NO), parted, Row(leaf(work, a, b), YES)]
    kept = shorter_leaves.shorter(rows, [1, 2], work.draw, ever())
    assert {place: found.nonzero for place, found in kept.items()} == {0: (), 1: ()}
    holed = [*rows[:2], Row(leaf(work, a, b, nonzero=[c]), YES)]
    kept = shorter_leaves.shorter(holed, [1, 2], work.draw, ever())
    assert {place: found.nonzero for place, found in kept.items()} == {0: (), 1: (b,), 2: (c,)}


def test_an_inequation_stands_for_a_leaf_with_the_general_verdict(work: members._Work) -> None:
    """c = 0 has an L, not where a = 0: one row with a != 0, unless a = c = 0 has parts of its own."""
    a, b, c = letters(work)
    rows = [Row(leaf(work), NO), Row(leaf(work, c), YES), Row(leaf(work, a, c), NO)]
    kept = shorter_leaves.shorter(rows, [], work.draw, ever())
    assert {place: found.nonzero for place, found in kept.items()} == {0: (), 1: (a,)}
    inner = [*rows, Row(leaf(work, a, b, c), YES)]
    kept = shorter_leaves.shorter(inner, [], work.draw, ever())
    assert {place: found.nonzero for place, found in kept.items()} == {0: (), 1: (a,), 3: ()}
    smaller = [*rows[:2], Row(leaf(work, a, b, c), NO)]
    kept = shorter_leaves.shorter(smaller, [], work.draw, ever())
    assert {place: found.nonzero for place, found in kept.items()} == {0: (), 1: (), 2: ()}
    other = [*rows[:2], Row(leaf(work, a, c), (NO[0], YES[0]))]
    assert [*shorter_leaves.shorter(other, [], work.draw, ever())] == [0, 1, 2]


def test_nothing_is_left_out_without_time_or_cases(work: members._Work) -> None:
    a, b, _ = letters(work)
    rows = [Row(leaf(work), NO), Row(leaf(work, a), YES), Row(leaf(work, a, b), YES)]
    for nothing in (shorter_leaves.Allowance(-EVER), shorter_leaves.Allowance(EVER, 0)):
        assert [*shorter_leaves.shorter(rows, [1, 2], work.draw, nothing)] == [0, 1, 2]


def test_a_list_is_told_alike_however_long_it_takes(
    work: members._Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cases are counted: on a clock that runs a thousand times faster the same leaves stay."""
    a, b, c = letters(work)
    rows = [Row(leaf(work), NO), Row(leaf(work, a), YES), Row(leaf(work, a, b), YES)]
    rows += [Row(leaf(work, b - c), YES), Row(leaf(work, a, b, c), YES)]
    allowed = ever()
    kept = [*shorter_leaves.shorter(rows, [1, 2, 3, 4], work.draw, allowed)]
    assert kept == [0, 1, 3]
    assert allowed.cases < shorter_leaves.MOST_OF_LIST
    ticks = itertools.count(step=60.0)
    monkeypatch.setattr("inverse_service.deadline.now", lambda: next(ticks))
    late = shorter_leaves.Allowance(1e6)
    assert [*shorter_leaves.shorter(rows, [1, 2, 3, 4], work.draw, late)] == kept
    assert late.cases == allowed.cases


@pytest.mark.parametrize("seed", range(3))
def test_every_member_keeps_its_verdicts(work: members._Work, seed: int) -> None:
    """Random lists over a, b, c, and all members with constants from -1 to 1."""
    rng = random.Random(seed)
    a, b, c = letters(work)
    known = [a, b, c, a - b, a + c, b * c - a, a - 1, b + 1]
    rows = [Row(leaf(work), NO)]
    while len(rows) < 6:
        chosen = rng.sample(known, rng.randint(1, 2))
        nonzero = rng.sample([one for one in known if one not in chosen], rng.randint(0, 1))
        whole = leaves.Leaf(work.unknowns, (), tuple(nonzero))
        verdicts = rng.choice([NO, YES, YES])
        rows += [Row(one, verdicts) for one in leaves.split_leaf(whole, chosen, EVER)]
    kept = shorter_leaves.shorter(rows, range(1, len(rows)), work.draw, ever())
    assert 0 in kept
    assert len(kept) < len(rows)
    places = [next(k for k, degree in enumerate(one.degrees()) if degree) for one in (a, b, c)]
    for values in itertools.product(range(-1, 2), repeat=3):
        member = dict(zip(places, values, strict=True))
        shorter = [Row(found, rows[k].verdicts) for k, found in kept.items()]
        assert verdicts_of(work, shorter, member) == verdicts_of(work, rows, member)
