"""Answers about Lagrangians of one kind rest on a proof of their own, and friction on L and D."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import comb

import pytest

from inverse_service.deadline import now
from inverse_service.decision import deciding, helmholtz
from inverse_service.decision.solutions import Solution, SolveOptions, Statement
from inverse_service.expressions import calculus, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import conditions, euler_lagrange
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.solving import kind_answers, solving
from inverse_service.statements.questions import PLAIN


def system_of(**equations: str) -> SecondOrderSystem:
    return read_system([*equations], equations)


@cache
def solved() -> Solution:
    """x'' = x^2 + y^2, y'' = 0 has no Lagrangian (Douglas 1941)."""
    options = SolveOptions(time_dependent=False, time_limit=20, conditions=False)
    return solving.solve(system_of(x="x^2 + y^2", y="0"), options)


@pytest.mark.parametrize("name", ["natural", "riemannian"])
def test_what_was_not_proven_proves_nothing_about_a_kind(name: str) -> None:
    found = solved()
    kind = helmholtz.kind_named(name, found.system.coordinates)
    options = SolveOptions(time_limit=20)
    sure = kind_answers.answer_kind(found, kind, {}, options, now() + 20)
    assert (sure.verdict, sure.why) == ("not_variational", "no Lagrangian of any kind exists")
    doubted = replace(
        found, statements=tuple(replace(one, checked="incomplete") for one in found.statements)
    )
    answer = kind_answers.answer_kind(doubted, kind, {}, options, now() + 20)
    assert answer.checked == "valid" or answer.verdict == "undetermined"


def friction_of(system: SecondOrderSystem) -> Statement:
    return kind_answers.answer_rayleigh(deciding.analyze(system), (), 1, now() + 10)


@pytest.mark.parametrize(
    "system",
    [
        system_of(x="-x - x' + y'", y="-y - x' - y'"),
        system_of(x="-x - x' + y*y'", y="-y - y*x' - 2*y'"),
        system_of(x="-2*y' - x'", y="2*x' - y"),
    ],
    ids=lambda system: str(system.accelerations),
)
def test_forces_across_the_velocity_are_in_l_and_friction_is_in_d(
    system: SecondOrderSystem,
) -> None:
    """d/dt dL/dv_i - dL/dq_i = dD/dv_i along the motion."""
    found = friction_of(system)
    assert found.verdict == "variational"
    assert found.lagrangian is not None
    assert found.dissipation is not None
    sums = euler_lagrange.euler_lagrange_sums(
        found.lagrangian.expression, system.coordinates, system.accelerations
    )
    slopes = [calculus.differentiate(found.dissipation, ex.Velocity(q)) for q in system.coordinates]
    rest = [ex.subtract(*pair) for pair in zip(sums, slopes, strict=True)]
    assert real_branch.vanish(rest, list(system.variables), 1) is True


def test_a_yes_about_friction_has_its_l_and_d() -> None:
    """Forces across the velocity by B = (0, 0, z) have div B = 1, so they come from no L."""
    found = friction_of(system_of(x="-x + z*y'", y="-2*y - z*x'", z="-3*z"))
    assert found.verdict != "variational"


@pytest.mark.parametrize("names", ["xy", "xyz", "xyzw"])
def test_a_closed_form_of_forces_has_a_condition_for_each_three_coordinates(names: str) -> None:
    """What friction leaves of df/dv is d of a form: n (n - 1)/2 conditions for each velocity, and
    the components of a 3-form.
    """
    analysis = deciding.analyze(system_of(**{name: f"-{name} - {name}'" for name in names}))
    variables = deciding.moving_variables(analysis.system, PLAIN)
    given = conditions.tensor_series(variables, analysis.accelerations, 2)
    added = helmholtz.added_equations((helmholtz.ANY_FRICTION,), given)
    n = len(names)
    counts = [
        sum(len({term.equation for term in one.terms}) for one in added if one.kind[0] == letter)
        for letter in "CD"
    ]
    assert counts == [n * comb(n, 2), comb(n, 3)]


@pytest.mark.parametrize(
    "system",
    [
        system_of(x="x*(x' + y')", y="0"),  # G_12 = G_11
        system_of(x="y*x' + 2*y*y'", y="y*x'"),
        system_of(x="y'", y="-x' - z'", z="x'"),
        system_of(x="-x - x'", y="-y - 2*y'"),
    ],
    ids=lambda system: str(system.accelerations),
)
def test_a_constant_metric_makes_the_forces_of_the_velocities_symmetric(
    system: SecondOrderSystem,
) -> None:
    """g df/dv + b - b^T is symmetric for g = d2L/dv dv and b = d2L/dv dq, so that the rest of
    the force is a slope of D.
    """
    q, v = ([kind(name) for name in system.coordinates] for kind in (ex.Symbol, ex.Velocity))
    slope, found = calculus.differentiate, [*kind_answers.constant_metrics(system)]
    assert found
    for tree in found:
        momenta = [slope(tree, one) for one in v]
        rows = [
            [
                ex.add(
                    *(
                        slope(p, u) * slope(f, b)
                        for u, f in zip(v, system.accelerations, strict=True)
                    ),
                    slope(p, place) - slope(other, own),
                )
                for other, b, place in zip(momenta, v, q, strict=True)
            ]
            for p, own in zip(momenta, q, strict=True)
        ]
        rest = [rows[i][j] - rows[j][i] for i in range(len(q)) for j in range(i)]
        assert real_branch.vanish(rest, list(system.variables), 1) is True
