"""Every hard case ends in a correct result or in an outcome that names step, time, quantity, and
remedy.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from benchmarks.hard_cases import (
    ALPHAS,
    STEPS,
    HardCase,
    Judged,
    all_cases,
    crossings,
    crossings_of_others,
    disk_start,
    judge,
    knife_start,
    near_singular,
    slow_rates,
    starts,
    stiff,
)
from benchmarks.problems import DISK, KNIFE, PENDULUM
from inverse_service.integrators.trajectory import Outcome, Trajectory
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start

CASES = all_cases()
FAST = [case for case in CASES if case.choice.alpha in (0.0, 0.5) and case.grid.steps < 10**5]
OTHERS = [case for case in CASES if case not in FAST]


def complaint(case: HardCase) -> str:
    judged = judge(case)
    return (
        ""
        if judged.right
        else f"{judged.trajectory.outcome}, error {judged.error}, bound {case.bound}"
    )


@pytest.mark.slow
@pytest.mark.parametrize("case", FAST, ids=lambda case: f"{case.group}: {case.name}")
def test_hard_case(case: HardCase) -> None:
    assert complaint(case) == ""


@pytest.mark.slow
@pytest.mark.parametrize("case", OTHERS, ids=lambda case: f"{case.group}: {case.name}")
def test_hard_case_slow(case: HardCase) -> None:
    assert complaint(case) == ""


def test_the_groups_are_whole() -> None:
    """36 crossings of disk and knife edge, each in both forms, at all h and alpha."""
    counts = Counter(case.group for case in crossings())
    assert counts["crossing cos phi = 0 and sin phi = 0"] == 2 * len(ALPHAS) * len(STEPS) == 36
    assert counts["crossing cos phi = 0 and sin phi = 0, raw form"] == 36


@pytest.mark.slow
def test_singular_quantity_is_named() -> None:
    raw = [
        judge(case).trajectory.outcome
        for case in crossings()
        if "raw" in case.group and case.grid.step == 0.1
    ]
    assert {outcome.quantity for outcome in raw} <= {"cos(phi)", "sin(phi)", "x"}
    halted = [
        judge(case).trajectory.outcome for case in slow_rates() if case.allowed == ("off_domain",)
    ]
    assert {outcome.quantity for outcome in halted} == {"phi'"}
    assert all(
        "determinant" in (judge(case).trajectory.outcome.quantity or "") for case in near_singular()
    )


def test_the_modified_methods_own_singular_set_is_named() -> None:
    for case in near_singular():
        outcome = judge(case).trajectory.outcome
        assert (outcome.quantity or "").startswith("determinant of the discrete equations")
        assert outcome.value is not None
        assert "smaller free constants" in (outcome.remedy or "")


@pytest.mark.slow
def test_what_fails_between_the_places_of_a_mean_is_the_factor_that_passes_zero() -> None:
    cases = [case for case in crossings_of_others() if case.allowed == ("singular",)]
    assert len(cases) == 6
    for case in cases:
        outcome = judge(case).trajectory.outcome
        assert outcome.quantity == "cos(phi)"
        assert "alpha = 1/2" in (outcome.remedy or "")


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 1 / 3, 0.5, 1.0])
def test_on_the_knife_edge_the_modified_method_is_the_variational_one(alpha: float) -> None:
    """Its momenta conserve the discrete constraint, so both solve the same equations, also across
    cos phi = 0.
    """
    found = [
        run(KNIFE, MethodChoice(method, alpha), knife_start(), Grid(0.05, 200), {"c": 0.1})
        for method in ("modified", "variational")
    ]
    assert all(one.outcome.completed for one in found)
    np.testing.assert_allclose(found[0].positions, found[1].positions, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_a_start_on_the_singular_set_is_an_ordinary_start() -> None:
    assert {
        judge(case).trajectory.outcome.kind for case in starts() if case.choice.form != "raw"
    } == {"completed"}


def test_a_guard_gives_number_and_remedy() -> None:
    found = run(
        DISK, MethodChoice("variational", 0.5), disk_start(0.3, 0.1), Grid(0.1, 1000), {"c": 1.0}
    )
    outcome = found.outcome
    assert outcome.kind == "guard"
    assert outcome.value is not None
    assert outcome.value >= 1
    assert outcome.remedy is not None
    assert "free constants" in outcome.remedy


def test_the_judge_finds_wrong_answers() -> None:
    """It rejects a wrong trajectory, an outcome that is not allowed, and one without a named
    quantity.
    """
    case = next(iter(crossings()))
    good = judge(case)
    assert good.right
    assert not Judged(case, good.trajectory, 10 * case.bound).right
    assert not Judged(case, good.trajectory, float("nan")).right
    empty = np.zeros((1, 4))
    other = Trajectory(
        np.zeros(1),
        empty,
        None,
        None,
        Outcome("singular", 3, 0.3, "x", 0.0, "none"),
        0,
        0,
        0.0,
        0.0,
    )
    assert not Judged(case, other, None).right
    raw = next(case for case in crossings() if "raw" in case.group)
    nameless = Trajectory(
        np.zeros(1), empty, None, None, Outcome("singular", 3, 0.3), 0, 0, 0.0, 0.0
    )
    assert not Judged(raw, nameless, None).right


@pytest.mark.slow
def test_completed_runs_are_on_the_branch_of_small_steps() -> None:
    """For growing h the roots are those of the continuation from small h, up to the guard."""
    for constant in (1.0, 4.0, 10.0):
        for step in (0.05, 0.2, 0.4, 0.6, 0.8, 1.0):
            found = run(
                DISK, MethodChoice("variational", 0.5), disk_start(), Grid(step, 1), {"c": constant}
            )
            if not found.outcome.completed:
                assert found.outcome.kind == "guard"
                continue
            expected = continued_step(step, constant)
            assert found.positions[1, 0] - found.positions[0, 0] == pytest.approx(
                expected, rel=1e-12
            )


def continued_step(step: float, constant: float) -> float:
    """Delta phi of the midpoint step with L~2, followed from h = 0 in 400 small increases by
    Newton.
    """
    phi, p_x, p_y = 0.3, 0.5 * constant, 0.5 * constant

    def shape(angle: float) -> tuple[float, float, float]:
        c, s = np.cos(angle) / (2 * constant), np.sin(angle) / (2 * constant)
        return c * p_x**2 + s * p_y**2, c * p_y**2 - s * p_x**2, -c * p_x**2 - s * p_y**2

    momentum = 1.0 - shape(phi)[0]
    move = 0.0
    for h in np.linspace(0, step, 401)[1:]:
        for _ in range(20):
            value, slope, bend = shape(phi + move / 2)
            # d = h (p + e/2 + g), e = -d g': one equation for d.
            residual = move - h * (momentum - move * slope / 2 + value)
            move -= residual / (1 - h * (-slope / 2 - move * bend / 4 + slope / 2))
    return float(move)


@pytest.mark.slow
def test_stiff_potentials_beyond_the_step_are_refused() -> None:
    kinds = {case.name: judge(case).trajectory.outcome.kind for case in stiff()}
    assert set(kinds.values()) == {"completed", "guard"}
    assert all((kind == "guard") == ("h = 0.1" in name) for name, kind in kinds.items())


def test_a_start_at_rest_stays_at_rest() -> None:
    for method in ("variational", "nonholonomic"):
        found = run(
            PENDULUM, MethodChoice(method, 0.5), Start((0.0,), (0.0,)), Grid(0.1, 50), {"k": 1.0}
        )
        assert found.outcome.completed
        assert np.all(found.positions == 0)
