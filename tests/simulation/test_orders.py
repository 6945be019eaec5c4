"""Measured orders of convergence on nonlinear problems, above the round-off floor, and towards
the motion that the equations themselves have.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.hard_cases import contact_start, disk_start, particle_start
from benchmarks.problems import CONTACT, DISK, PARTICLE, PENDULUM, ROBOT, problem as problem_of
from inverse_service.expressions import arrays, calculus, tree as ex
from inverse_service.integrators.method_table import RUNGE_KUTTA
from inverse_service.mechanics import euler_lagrange
from inverse_service.service.scenes import simulating
from inverse_service.simulation import accelerations
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Problem, Start

ROBOT_START = Start((0.3, 0.5, 0.0, 0.0), (1.0, 0.3, 0.3 * math.cos(0.3), 0.3 * math.sin(0.3)))
PROBLEMS: dict[str, tuple[Problem, Start, dict[str, float]]] = {
    "disk": (DISK, disk_start(), {"c": 1.0}),
    "particle": (PARTICLE, particle_start(), {"c": 1.0}),
    "pendulum": (PENDULUM, Start((1.5,), (0.3,)), {"k": 1.0}),
    "robot": (ROBOT, ROBOT_START, {"k": 2.0}),
    "contact": (CONTACT, contact_start(), {"k": 0.3}),
}
# order: (span, steps of the coarsest run, allowed difference); long spans keep high orders above
# round-off.
COARSE = defaultdict(
    lambda: (4, 20, 0.1),
    {1: (4, 100, 0.1), 2: (4, 48, 0.1), 5: (4, 20, 0.15), 6: (4, 12, 0.1), 8: (40, 80, 0.5)},
)
IMPLICIT = [
    *(("variational", problem) for problem in ("disk", "particle", "pendulum")),
    *(("nonholonomic", problem) for problem in ("robot", "contact")),
    *(("modified", problem) for problem in ("disk", "particle")),
]


def measured_order(problem: str, choice: MethodChoice, order: int) -> float:
    """log2 of the ratio of the greatest errors at four times for h and h/2, the finest pair above
    round-off.
    """
    span, steps, _ = COARSE[order]
    what, start, values = PROBLEMS[problem]
    reference = run(
        what, MethodChoice("reference"), start, Grid(0.01, 100 * span, 25 * span), values
    )
    assert reference.outcome.completed
    errors: list[float] = []
    for count in (steps * 2**k for k in range(5)):
        found = run(what, choice, start, Grid(span / count, count, count // 4), values)
        assert found.outcome.completed, found.outcome
        error = float(np.abs(found.positions - reference.positions).max())
        if error < 2e-13:
            break
        errors.append(error)
    assert len(errors) > 1, "all at the round-off floor"
    return math.log2(errors[-2] / errors[-1])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "problem"), IMPLICIT)
@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_one_half_and_its_compositions(method: str, problem: str, order: int) -> None:
    choice = MethodChoice(method, 0.5, order=order)
    assert measured_order(problem, choice, order) == pytest.approx(order, abs=COARSE[order][2])


@pytest.mark.slow
@pytest.mark.parametrize(("method", "problem"), IMPLICIT)
@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
def test_other_alphas_have_order_one(method: str, problem: str, alpha: float) -> None:
    assert measured_order(problem, MethodChoice(method, alpha), 1) == pytest.approx(1, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "problem"), [("nonholonomic", "robot"), ("nonholonomic", "contact")]
)
@pytest.mark.parametrize("alpha", [0.0, 0.3, 1.0])
def test_symmetrised_has_order_two(method: str, problem: str, alpha: float) -> None:
    choice = MethodChoice(method, alpha, symmetrised=True)
    assert measured_order(problem, choice, 2) == pytest.approx(2, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["hamiltonian", "raw"])
@pytest.mark.parametrize("alpha", [0.0, 0.3])
def test_symmetrised_variational_has_order_two(form: str, alpha: float) -> None:
    choice = MethodChoice("variational", alpha, symmetrised=True, form=form)
    assert measured_order("pendulum", choice, 2) == pytest.approx(2, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["disk", "robot", "contact", "pendulum"])
@pytest.mark.parametrize("order", RUNGE_KUTTA)
def test_runge_kutta(problem: str, order: int) -> None:
    found = measured_order(problem, MethodChoice("runge_kutta", order=order), order)
    # On the pendulum's closed curve the leading term of DOP853 nearly cancels, so its measured
    # order is higher.
    assert order - COARSE[order][2] < found < order + (2 if order == 8 else COARSE[order][2])


# No coordinate is cyclic, no part is even in t, q, or q', the matrix of masses changes, and the
# constraint is not integrable; friction turns what is left of symmetry.
KINETIC = "(1 + x^2/4)*x'^2/2 + y'^2/2 + x'*y'/3 + 2/5*x*y'"
SCENES = {
    "driven": (f"{KINETIC} - x^4/4 - cos(y + t/2) - x*y^2/3", (), ()),
    "magnetic": (f"{KINETIC} - x^4/4 - cos(y) - x*y^2/3", (), ()),
    "rubbed": (f"{KINETIC} - x^4/4 - cos(y) - x*y^2/3", (), ("-x'/5 + y*y'/9", "-y'*(1 + x^2)/7")),
    "rolling": ("(1 + y^2/3)*x'^2/2 + y'^2/2 + z'^2/2 + x'*z'/4 - x^2*y/2 - cos(z)",
                ("z' - x*y' - sin(y)*x'/2",), ()),
}  # fmt: skip
ENDS, STARTS = 2.0, {"x": (0.7, 0.3), "y": (-0.4, 0.9), "z": (0.2, 0.0)}
MEASURED = [
    *(("driven", "variational", {"order": order}, order) for order in (2, 4, 6)),
    ("driven", "variational", {"alpha": 0.3}, 1),
    ("driven", "variational", {"form": "raw"}, 2),
    *(("driven", "runge_kutta", {"order": order}, order) for order in (4, 5, 8)),
    ("magnetic", "variational", {"alpha": 0.3, "symmetrised": True}, 2),
    ("magnetic", "variational", {"alpha": 0.8}, 1),
    ("rubbed", "variational", {"order": 2}, 2),
    ("rubbed", "nonholonomic", {"alpha": 0.3}, 1),
    *(("rolling", "nonholonomic", {"order": order}, order) for order in (2, 4, 6)),
    ("rolling", "nonholonomic", {"alpha": 0.3}, 1),
    ("rolling", "nonholonomic", {"alpha": 0.3, "symmetrised": True}, 2),
    ("rolling", "runge_kutta", {"order": 5}, 5),
]  # fmt: skip
STEPS = {1: 400, 2: 64, 4: 16, 5: 12, 6: 8, 8: 6}


def scene(name: str) -> tuple[Problem, Start]:
    """Both, with the velocity of z that the constraint asks for."""
    lagrangian, constraints, forces = SCENES[name]
    names = ("x", "y", "z") if constraints else ("x", "y")
    what = problem_of(
        " ".join(names), lagrangian, constraints, free="" if constraints else lagrangian
    )
    read = [problem_of(" ".join(names), text).lagrangian for text in forces]
    what = replace(what, forces=tuple(tree for tree in read if tree is not None))
    positions, velocities = zip(*map(STARTS.__getitem__, names), strict=True)
    if constraints:
        velocities = (0.3, 0.9, 0.7 * 0.9 + math.sin(-0.4) * 0.3 / 2)
    return what, Start(positions, velocities)


def motion(what: Problem, start: Start) -> np.ndarray:
    """Where M q'' = f + A^T lambda, A q'' = -A' q' ends, by a method of SciPy."""
    names, n = what.coordinates, len(what.coordinates)
    bends = [ex.Symbol(f"{name}_2") for name in names]
    zero = dict.fromkeys(bends, ex.ZERO)
    assert what.lagrangian is not None
    sums = euler_lagrange.euler_lagrange_sums(what.lagrangian, names, bends)
    applied = what.forces or (ex.ZERO,) * n
    rows = [*sums, *(calculus.time_derivative(one, zip(
        [*map(ex.Symbol, names), *map(ex.Velocity, names)], [*map(ex.Velocity, names), *bends], strict=True
    )) for one in what.constraints)]  # fmt: skip
    slopes = [calculus.differentiate(row, bend) for row in rows for bend in bends]
    rest = [ex.substitute(row, zero) for row in rows]
    states: list[ex.Expression] = [ex.TIME, *map(ex.Symbol, names), *map(ex.Velocity, names)]
    values = arrays.function_of([*slopes, *rest, *applied], states)
    m = len(what.constraints)

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        found = np.array(values((t, *state)))
        table = found[: (n + m) * n].reshape(n + m, n)
        left = found[(n + m) * n :]
        whole = np.block([[table[:n], -table[n:].T], [table[n:], np.zeros((m, m))]])
        right = np.concatenate([left[n + m :] - left[:n], -left[n : n + m]])
        return np.concatenate([state[n:], np.linalg.solve(whole, right)[:n]])

    begin = np.array([*start.positions, *start.velocities])
    return np.array(solve_ivp(rates, (0, ENDS), begin, "DOP853", rtol=1e-12, atol=1e-13).y[:n, -1])


@cache
def truth(name: str) -> np.ndarray:
    return motion(*scene(name))


@pytest.mark.parametrize(("name", "method", "choice", "order"), MEASURED)
def test_half_of_the_step_is_nearer_to_the_true_motion_by_the_order(
    name: str, method: str, choice: dict[str, Any], order: int
) -> None:
    what, start = scene(name)
    if method == "runge_kutta":
        what = replace(what, accelerations=accelerations.formulas_of(what)[0])
    errors = []
    for steps in (STEPS[order], 2 * STEPS[order]):
        found = run(what, MethodChoice(method, **choice), start, Grid(ENDS / steps, steps), {})
        assert found.outcome.completed, found.outcome
        errors.append(float(np.abs(found.positions[-1] - truth(name)).max()))
    assert errors[0] < 0.02
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3 if order < 5 else 2.6)


AT_THE_DOOR = [
    *(({"method": "runge-kutta", "order": order}, bound) for order, bound in ((4, 1e-8), (5, 1e-9), (8, 1e-11))),
    ({"method": "adaptive"}, 1e-11),
    ({"method": "stiff"}, 1e-8),
    ({"method": "reference"}, 1e-11),
    ({"method": "nonholonomic"}, 3e-4),
]  # fmt: skip


@pytest.mark.parametrize(("method", "bound"), AT_THE_DOOR)
@pytest.mark.parametrize("name", SCENES)
def test_a_document_of_a_scene_has_the_true_motion(
    name: str, method: dict[str, Any], bound: float
) -> None:
    """From L, constraints and forces as typed, whichever formulas the method solves."""
    what, start = scene(name)
    lagrangian, constraints, forces = SCENES[name]
    names = what.coordinates
    document = {
        "system": {"coordinates": [*names], "lagrangian": lagrangian}
        | ({"constraints": [*constraints]} if constraints else {}),
        "initial": {
            "positions": dict(zip(names, start.positions, strict=True)),
            "velocities": dict(zip(names, start.velocities, strict=True)),
        },
        "step": 0.02,
        "time": ENDS,
        "methods": [method],
    }
    document |= {"forces": dict(zip(names, forces, strict=True))} if forces else {}
    found = simulating.with_tables(simulating.run_document(document, None, 20))
    assert found["result"]["methods"][0]["outcome"] == "completed"
    (table,) = found["tables"].values()
    end = np.array([table[one][-1] for one in names])
    assert float(np.abs(end - truth(name)).max()) < bound
