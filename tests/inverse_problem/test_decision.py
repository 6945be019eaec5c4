"""The decision: degenerate systems, limits, reasons, and independence of names and coordinates."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction

import pytest
from hypothesis import given, settings, strategies as st

from inverse_service.deadline import now
from inverse_service.decision.deciding import Decision, HelmholtzAt, analyze, decide
from inverse_service.expressions.tree import (
    Expression,
    Symbol,
    Velocity,
    add,
    multiply,
    number,
    substitute,
)
from inverse_service.linear_pde.involution import Limits, settle
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.statements.questions import PLAIN, TIMED, Question
from inverse_service.statements.stages import Stage


def system(
    equations: dict[str, str],
    parameters: Sequence[str] = (),
    functions: dict[str, list[str]] | None = None,
) -> SecondOrderSystem:
    return read_system(list(equations), equations, parameters, functions)


@pytest.mark.parametrize(
    "force", ["0", "-x", "-sin(x)-x'^3*x", "-x*t", "A(x)*x'^2+1/(1+x^2)", "sqrt(1+x'^2)"]
)
def test_the_theorem_for_one_coordinate_says_what_prolongation_finds(force: str) -> None:
    one = system({"x": force}, (), {"A": ["x"]} if "A" in force else None)
    for question in (PLAIN, TIMED):
        found = decide(one, question)
        card = HelmholtzAt(analyze(one), question.widened(one.depends_on_time))
        slow = settle(card, 1, Limits(), lambda _: None)
        assert slow.exists
        assert found.verdict == "variational"
        assert (found.order, found.symbol, found.degree, found.history) == (
            slow.order,
            slow.symbol,
            slow.degree,
            slow.history,
        )


def test_constants_only_are_as_free_motion() -> None:
    found = decide(system({"x": "3", "y": "-1/2"}), PLAIN)
    assert found.history == decide(system({"x": "0", "y": "0"}), PLAIN).history
    assert found.verdict == "variational"


@pytest.mark.slow
@pytest.mark.parametrize("n", [5, 8])
def test_a_random_quadratic_system_of_many_coordinates_is_refused_at_low_order_at_once(
    n: int,
) -> None:
    names, rng = list("abcdefgh")[:n], random.Random(1)
    equations = {
        name: "+".join(
            f"{rng.randint(1, 9)}*{rng.choice(names)}*{rng.choice(names)}'" for _ in range(3)
        )
        for name in names
    }
    found = decide(system(equations), PLAIN)
    assert found.verdict == "not_variational"
    assert found.order <= 2
    assert found.seconds < 10


def test_a_system_that_contains_time_is_asked_for_a_lagrangian_with_time() -> None:
    found = decide(system({"x": "-t*x", "y": "-t^2*y"}), PLAIN)
    assert found.question == TIMED
    assert found.verdict == "variational"
    assert found.history == decide(system({"x": "-t*x", "y": "-t^2*y"}), TIMED).history


@pytest.mark.parametrize(
    ("equations", "parameters", "functions", "verdict"),
    [
        ({"x": "x/k"}, ["k"], {}, "variational"),
        ({"x": "-x/k-y", "y": "-x-y/k^2"}, ["k"], {}, "variational"),
        ({"x": "-c*x'/k-y", "y": "-x-y'/c"}, ["k", "c"], {}, "not_variational"),
        ({"x": "A(x,y)", "y": "B(x,y)"}, [], {"A": ["x", "y"], "B": ["x", "y"]}, "not_variational"),
        ({"x": "diff(V(x,y),x)", "y": "diff(V(x,y),y)"}, [], {"V": ["x", "y"]}, "variational"),
        ({"x": "-diff(V(x,y),y)", "y": "diff(V(x,y),x)"}, [], {"V": ["x", "y"]}, "not_variational"),
        ({"x": "A(x)"}, [], {"A": ["x"]}, "variational"),
        ({"x": "A(x)*y'", "y": "-A(x)*x'"}, [], {"A": ["x"]}, "variational"),
        ({"x": "A(x)*x'", "y": "B(y)*x'"}, [], {"A": ["x"], "B": ["y"]}, "not_variational"),
    ],
)
def test_parameters_and_arbitrary_functions_are_generic(
    equations: dict[str, str], parameters: list[str], functions: dict[str, list[str]], verdict: str
) -> None:
    assert decide(system(equations, parameters, functions), PLAIN).verdict == verdict


@pytest.mark.slow
@pytest.mark.parametrize(
    "force",
    [
        "x/(k-k)",
        "1/(sin(x)^2+cos(x)^2-1)",
        "log(x-x)",
        "exp(1/(x-x))",
        "sqrt(-1-x^2)",
        "x^sqrt(y-y)/(x-x)",
    ],
)
def test_what_has_no_value_anywhere_is_undetermined_with_a_sentence(force: str) -> None:
    found = decide(system({"x": force, "y": "x"}, ["k"]), PLAIN)
    assert found.verdict == "undetermined"
    assert found.open is not None
    assert " " in found.open.words
    assert not found.rows
    assert found.space is None


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        (Limits(order=1), "not decided by order 1"),
        (Limits(deadline=0.0), "time limit"),
        (Limits(order=-1), "not decided"),
    ],
)
def test_a_limit_that_is_reached_is_named(limits: Limits, reason: str) -> None:
    found = decide(system({"x": "y", "y": "x"}), PLAIN, limits=limits)
    assert found.verdict == "undetermined"
    assert found.open is not None
    assert reason in found.open.words


def test_a_deadline_in_the_future_has_no_effect() -> None:
    assert (
        decide(system({"x": "y", "y": "x"}), PLAIN, limits=Limits(deadline=now() + 60)).order == 3
    )


def test_progress_is_reported_order_by_order() -> None:
    told: list[Stage] = []
    decide(system({"x": "y", "y": "x"}), PLAIN, progress=told.append)
    assert [stage.text for stage in told[:4]] == [
        f"prolongation to order {order}" for order in range(4)
    ]


def test_two_points_of_two_primes_confirm_the_verdict() -> None:
    points = decide(system({"x": "-x^3*y", "y": "x'"}), PLAIN).points
    assert len({point["prime"] for point in points}) == 2
    assert len({point["seed"] for point in points}) == 2


@pytest.mark.parametrize(
    "equations", [{"x": "-x-2*x*y", "y": "-y-x^2+y^2"}, {"x": "x*y'", "y": "y*x'^2"}]
)
def test_verdict_dimensions_and_rows_do_not_depend_on_the_seed(equations: dict[str, str]) -> None:
    found = [decide(system(equations), PLAIN, seed=seed) for seed in range(1, 6)]
    assert len({(d.verdict, d.history, d.rows) for d in found}) == 1
    assert len({d.points[0]["prime"] for d in found}) == 5


def test_a_negative_verdict_names_rows_of_the_order_and_a_positive_one_none() -> None:
    negative = decide(system({"x": "x*y'", "y": "y*x'^2"}), PLAIN)
    assert negative.rows
    assert all(sum(alpha) <= negative.order for _, _, _, alpha in negative.rows)
    assert decide(system({"x": "-x", "y": "-y"}), PLAIN).rows == ()


ATOMS = (
    "x",
    "y",
    "x'",
    "y'",
    "x*y",
    "x'*y'",
    "x'^2",
    "x^2",
    "y'^2",
    "sin(x)",
    "1/(2+y)",
    "x*y'",
    "exp(y)",
)
QUESTIONS = st.sampled_from((PLAIN, TIMED))
TERMS = st.lists(st.tuples(st.integers(-3, 3), st.sampled_from(ATOMS)), min_size=0, max_size=3)
MATRICES = st.lists(st.fractions(-3, 3, max_denominator=3), min_size=4, max_size=4).filter(
    lambda m: m[0] * m[3] != m[1] * m[2]
)


def plane_system(first: list[tuple[int, str]], second: list[tuple[int, str]]) -> SecondOrderSystem:
    texts = ["+".join(f"({k})*{atom}" for k, atom in terms) or "0" for terms in (first, second)]
    return system({"x": texts[0], "y": texts[1]})


def essence(found: Decision) -> tuple[str, tuple[tuple[int, ...], ...], tuple[int, ...]]:
    return found.verdict, found.history, found.symbol.characters if found.symbol else ()


def linear_change(given: SecondOrderSystem, matrix: list[Fraction]) -> SecondOrderSystem:
    """The system of Q where q = M Q: Q'' = M^-1 f(M Q, M Q'), with the same names."""
    a, b, c, d = matrix
    x, y = given.coordinates
    table: dict[Expression, Expression] = {}
    for kind in (Symbol, Velocity):
        table[kind(x)] = add(multiply(number(a), kind(x)), multiply(number(b), kind(y)))
        table[kind(y)] = add(multiply(number(c), kind(x)), multiply(number(d), kind(y)))
    f, g = (substitute(force, table) for force in given.accelerations)
    unit = 1 / (a * d - b * c)
    first = add(multiply(number(d * unit), f), multiply(number(-b * unit), g))
    second = add(multiply(number(-c * unit), f), multiply(number(a * unit), g))
    return SecondOrderSystem(given.coordinates, (first, second))


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(TERMS, TERMS, MATRICES, QUESTIONS)
def test_verdict_and_dimensions_survive_linear_changes_of_coordinates(
    first: list[tuple[int, str]],
    second: list[tuple[int, str]],
    matrix: list[Fraction],
    question: Question,
) -> None:
    given = plane_system(first, second)
    assert essence(decide(linear_change(given, matrix), question)) == essence(
        decide(given, question)
    )


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(TERMS, TERMS, st.fractions(Fraction(1, 9), 9, max_denominator=9), QUESTIONS)
def test_verdict_and_dimensions_survive_other_units(
    first: list[tuple[int, str]],
    second: list[tuple[int, str]],
    unit: Fraction,
    question: Question,
) -> None:
    given = plane_system(first, second)
    scaled = linear_change(given, [unit, Fraction(0), Fraction(0), -2 * unit])
    assert essence(decide(scaled, question)) == essence(decide(given, question))


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    TERMS,
    TERMS,
    st.sampled_from([("x", "y"), ("u", "v"), ("q1", "q2"), ("theta", "alpha"), ("y", "x")]),
)
def test_verdict_and_dimensions_survive_renaming_and_exchange(
    first: list[tuple[int, str]], second: list[tuple[int, str]], names: tuple[str, str]
) -> None:
    given = plane_system(first, second)
    table: dict[Expression, Expression] = {
        kind(old): kind(new)
        for kind in (Symbol, Velocity)
        for old, new in zip(given.coordinates, names, strict=True)
    }
    forces = tuple(substitute(force, table) for force in given.accelerations)
    renamed, exchanged = (
        SecondOrderSystem(names, forces),
        SecondOrderSystem(names[::-1], forces[::-1]),
    )
    expected = essence(decide(given, PLAIN))
    assert essence(decide(renamed, PLAIN)) == expected
    assert essence(decide(exchanged, PLAIN)) == expected
