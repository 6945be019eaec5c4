"""The quantities that every method conserves, and the effect of its settings."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from benchmarks.hard_cases import contact_start, disk_start, particle_start
from benchmarks.problems import (
    CHAIN,
    CONTACT,
    DISK,
    DISK_CONSTRAINTS,
    DISK_ENERGY,
    DISK_THIRD,
    DOUBLE_PENDULUM,
    PARTICLE,
    PARTICLE_THIRD,
    PENDULUM,
    problem,
)
from inverse_service.errors import InputError
from inverse_service.kernels.codegen.symengine_trees import symbol
from inverse_service.simulation import schemes
from inverse_service.simulation.execution import run
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observable, Problem, Start

C = {"c": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 0.2, 1 / 3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize(
    ("what", "start"), [(DISK, disk_start()), (PARTICLE, particle_start()), (DISK_THIRD, disk_start()),
                        (PARTICLE_THIRD, particle_start())], ids=["disk", "particle", "disk 3", "particle 3"],
)  # fmt: skip
@pytest.mark.parametrize("convention", ["momenta", "discrete_constraint"])
def test_raw_form_and_hamiltonian_form_agree(
    what: Problem, start: Start, alpha: float, convention: str
) -> None:
    begin = Start(start.positions, start.velocities, convention=convention)
    grid = Grid(0.02, 30 if what in (DISK, PARTICLE) else 2000)
    one = run(what, MethodChoice("variational", alpha), begin, grid, C)
    other = run(what, MethodChoice("variational", alpha, form="raw"), begin, grid, C)
    assert one.outcome.completed
    assert other.outcome.completed
    assert np.abs(one.positions - other.positions).max() < 1e-11
    assert one.momenta is not None
    assert other.momenta is not None
    assert np.abs(one.momenta - other.momenta).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("symmetrised", [False, True])
@pytest.mark.parametrize(
    ("what", "start"),
    [
        (DOUBLE_PENDULUM, Start((1.0, 1.5), (0.0, 0.3))),
        (CHAIN, Start((0.0, 0.1, 0.2, 0.3), (0.2, -0.2, 0.2, -0.2))),
    ],
    ids=["double pendulum", "chain"],
)
def test_without_constraints_all_methods_are_one(
    what: Problem, start: Start, alpha: float, symmetrised: bool
) -> None:
    """The raw, Hamiltonian, and nonholonomic forms agree for a system with L~ = L and no
    constraints.
    """
    grid = Grid(0.01, 300)
    choices = [
        MethodChoice("variational", alpha, symmetrised), MethodChoice("variational", alpha, symmetrised, form="raw"),
        MethodChoice("nonholonomic", alpha, symmetrised),
    ]  # fmt: skip
    found = [run(what, choice, start, grid, {}) for choice in choices]
    assert all(one.outcome.completed for one in found), [one.outcome for one in found]
    assert all(np.abs(one.positions - found[0].positions).max() < 1e-11 for one in found)


@pytest.mark.slow
def test_symmetrised_forms_agree() -> None:
    for alpha in (0.0, 0.3, 1.0):
        found = [
            run(
                DISK_THIRD,
                MethodChoice("variational", alpha, True, form=form),
                disk_start(),
                Grid(0.05, 400),
                C,
            )
            for form in ("hamiltonian", "raw")
        ]
        assert all(one.outcome.completed for one in found)
        assert np.abs(found[0].positions - found[1].positions).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("symmetrised", [False, True])
def test_raw_trajectories_solve_the_discrete_euler_lagrange_equations(
    alpha: float, symmetrised: bool
) -> None:
    """The literal equations D1 L_d + D2 L_d = 0, derivatives by complex steps."""
    choice = MethodChoice("variational", alpha, symmetrised, form="raw")
    h, found = 0.02, run(DISK, choice, disk_start(), Grid(0.02, 40), C)
    parts = (alpha, 1 - alpha) if symmetrised else (alpha,)

    def discrete(first: np.ndarray, second: np.ndarray) -> complex:
        velocity, total = (second - first) / h, 0j
        for part in parts:
            phi = (1 - part) * first[0] + part * second[0]
            kinetic = velocity[0] ** 2 + velocity[1] ** 2
            total += 0.5 * (
                kinetic
                + (velocity[2] ** 2 / np.cos(phi) + velocity[3] ** 2 / np.sin(phi)) / velocity[0]
            )
        return total / len(parts)

    q = found.positions
    for k in range(1, len(q) - 1):
        for place in range(4):
            shift = np.zeros(4, dtype=complex)
            shift[place] = 1e-30j
            slope = discrete(q[k] + shift, q[k + 1]).imag + discrete(q[k - 1], q[k] + shift).imag
            assert abs(slope) * 1e30 < 2e-11 / h


@pytest.mark.slow
@pytest.mark.parametrize("alpha", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("symmetrised", [False, True])
@pytest.mark.parametrize("method", ["nonholonomic", "modified"])
def test_discrete_constraints_are_kept(method: str, alpha: float, symmetrised: bool) -> None:
    choice = MethodChoice(method, alpha, symmetrised)
    start = Start((0.3, 0.0, 0.0, 0.0), (1.0, 0.2, 0.2 * math.cos(0.3), 0.2 * math.sin(0.3)))
    steps = 20 if symmetrised and method == "modified" else 300
    found = run(DISK, choice, start, Grid(0.05, steps), C, DISK_CONSTRAINTS)
    assert found.outcome.completed, found.outcome
    assert max(found.maxima.values()) < 1e-14


def test_momenta_of_cyclic_coordinates_never_change() -> None:
    found = run(DISK, MethodChoice("variational", 0.3), disk_start(), Grid(0.1, 1000), C)
    assert found.momenta is not None
    assert np.all(found.momenta[:, 1:] == found.momenta[0, 1:])


def test_third_type_keeps_its_constraint_exactly() -> None:
    """p_y = 0 (disk) and p_z = 0 (particle) are discrete Noether momenta, and the start gives them
    exactly.
    """
    for what, start, place in (
        (DISK_THIRD, disk_start(), 3),
        (PARTICLE_THIRD, particle_start(), 2),
    ):
        found = run(what, MethodChoice("variational", 0.5), start, Grid(0.05, 2000), C)
        assert found.momenta is not None
        assert np.abs(found.momenta[:, place]).max() < 1e-15


def test_energy_of_a_free_hamiltonian_does_not_drift() -> None:
    energy = Observable("energy", problem("u", lagrangian="1/2*u'^2 - cos(u)").lagrangian)  # type: ignore[arg-type]
    found = run(PENDULUM, MethodChoice("variational", 0.5), Start((2.0,), (0.3,)), Grid(0.1, 100_000, 100),
                {"k": 1.0}, (energy,))  # fmt: skip
    series = found.series["energy"]
    assert found.outcome.completed
    assert abs(series[-100:].mean() - series[:100].mean()) < 1e-3


def test_steps_back_return_to_the_start() -> None:
    for method, what, start, values in (
        ("variational", DISK, disk_start(), C), ("nonholonomic", CONTACT, contact_start(), {"k": 0.3}),
    ):  # fmt: skip
        for order in (2, 4):
            choice = MethodChoice(method, 0.5, order=order)
            there = run(what, choice, start, Grid(0.05, 200), values)
            assert there.momenta is not None
            turned = Start(there.positions[-1], start.velocities, momenta=there.momenta[-1])
            back = run(what, choice, turned, Grid(-0.05, 200), values)
            assert back.outcome.completed
            assert np.abs(back.positions[-1] - there.positions[0]).max() < 1e-11


def test_compensated_sums_keep_a_million_steps() -> None:
    """A uniform motion: increments that are not binary fractions add up without loss."""
    free = problem("u", free="1/2*u'^2", hamiltonian="1/2*p_u^2")
    found = run(
        free,
        MethodChoice("variational", 0.5),
        Start((0.0,), (1.0,)),
        Grid(0.1, 1_000_000, 250_000),
        {},
    )
    assert (
        np.abs(
            found.positions[:, 0] / np.array([1.0, 25e3, 5e4, 75e3, 1e5]) - [0, 1, 1, 1, 1]
        ).max()
        < 4e-16
    )


def test_records_are_decimated_and_the_last_step_is_always_there() -> None:
    every = run(DISK, MethodChoice("variational", 0.5), disk_start(), Grid(0.1, 1003), C)
    some = run(DISK, MethodChoice("variational", 0.5), disk_start(), Grid(0.1, 1003, 100), C)
    assert np.all(some.times == np.append(every.times[::100], every.times[-1]))
    assert np.all(some.positions == np.vstack([every.positions[::100], every.positions[-1:]]))
    assert some.times[-1] == pytest.approx(100.3)


def test_maxima_count_every_step() -> None:
    observed = (DISK_ENERGY,)
    every = run(DISK, MethodChoice("variational", 0.0), disk_start(), Grid(0.1, 500), C, observed)
    some = run(
        DISK, MethodChoice("variational", 0.0), disk_start(), Grid(0.1, 500, 499), C, observed
    )
    assert some.maxima["energy"] == every.maxima["energy"] == np.abs(every.series["energy"]).max()


@pytest.mark.parametrize("steps", [0, 1, 2, 3])
@pytest.mark.parametrize("every", [1, 2, 7])
def test_short_runs(steps: int, every: int) -> None:
    found = run(DISK, MethodChoice("variational", 0.5), disk_start(), Grid(0.1, steps, every), C)
    assert found.outcome.completed
    assert found.times[-1] == pytest.approx(0.1 * steps)
    assert found.momenta is not None
    assert len(found.times) == len(found.positions) == len(found.momenta)


def test_a_run_can_be_stopped() -> None:
    found = run(
        DISK,
        MethodChoice("variational", 0.5),
        disk_start(),
        Grid(1e-6, 10**9, 10**6),
        C,
        stop=lambda: True,
    )
    assert found.outcome.kind == "cancelled"


def test_what_a_problem_lacks_is_said() -> None:
    with pytest.raises(InputError, match="needs a free Lagrangian"):
        run(CONTACT, MethodChoice("variational"), contact_start(), Grid(0.1, 10), {"k": 1.0})
    without = problem("u", free="1/2*u'^2")
    with pytest.raises(InputError, match="by the raw form"):
        run(without, MethodChoice("variational"), Start((0.0,), (1.0,)), Grid(0.1, 10), {})
    raw = MethodChoice("variational", form="raw")
    assert run(without, raw, Start((0.0,), (1.0,)), Grid(0.1, 10), {}).outcome.completed


def test_the_guard_compares_with_the_determinant_of_short_steps() -> None:
    """Entries divided by h are multiplied out before h is 0: a row of the raw form of the disk's
    third L is 0 otherwise.
    """
    formulas = Formulas(DISK_THIRD)
    choice = MethodChoice("variational", 0.3, form="raw")
    (block,) = schemes.program_of(formulas, choice, ()).blocks
    step, rates = 1e-8, [0.7, 1.1, -0.4, 0.9]
    values = {f"d{k}": rate * step for k, rate in enumerate(rates)}
    values |= {"q0": 0.6, "q1": 0.2, "c0": 1.3, "a": 0.3, "h": step}
    table = {symbol(name): value for name, value in values.items()}
    for row, limit in zip(block.jacobian, block.limit, strict=True):
        own, others = ([float(one.subs(table)) for one in entries] for entries in (row, limit))
        assert others == pytest.approx(own, rel=1e-6)


def test_a_multiplier_that_is_zero_needs_no_iterations_beyond_round_off() -> None:
    """Along a straight line through the axis the constraint exerts no force at alpha = 1, where the
    equation of the multiplier alone is left, and is not linear.
    """
    what = problem(
        "x y z", lagrangian="(x'^2 + y'^2 + z'^2)/2 + cos(x)", constraints=("z' - y*x' + x*y'",)
    )
    start = Start((0.0, 0.0, 0.0), (1.0, 1.0, 0.0))
    found = run(what, MethodChoice("nonholonomic", 1.0), start, Grid(0.05, 50), {})
    assert found.outcome.completed
    assert found.newton_iterations < 4 * 50


def test_a_composition_of_a_step_that_is_not_symmetric_is_refused() -> None:
    with pytest.raises(InputError, match="symmetric"):
        run(DISK, MethodChoice("variational", 0.3, order=4), disk_start(), Grid(0.1, 1), C)


def test_a_redundant_constraint_is_refused() -> None:
    twice = problem(
        "x y",
        lagrangian="1/2*(x'^2 + y'^2)",
        constraints=("x' - y'", "2*x' - 2*y'"),
        free="x'^2 + y'^2",
    )
    with pytest.raises(InputError, match="not independent"):
        run(twice, MethodChoice("modified"), Start((0.0, 0.0), (1.0, 1.0)), Grid(0.1, 1), {})


class _Refused:
    """An importer that notes who asks for SymPy."""

    def __init__(self) -> None:
        self.asked = 0

    def find_spec(self, name: str, *_: object) -> None:
        self.asked += name == "sympy"
        if name == "sympy":
            raise ModuleNotFoundError(name, name=name)


@pytest.mark.parametrize(
    "choice",
    [
        MethodChoice("variational", 0.3),
        MethodChoice("variational", 0.3, True),
        MethodChoice("variational", 0.3, form="raw"),
        MethodChoice("nonholonomic", 0.3),
        MethodChoice("runge_kutta", order=4),
        *(MethodChoice(name) for name in ("adaptive", "reference", "stiff")),
    ],
    ids=lambda choice: f"{choice.method}, {choice.form}, {choice.symmetrised}",
)
def test_programs_of_steps_are_written_without_sympy(
    choice: MethodChoice, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SymEngine loads it for `number * array`, which takes longer than all else."""
    refused = _Refused()
    monkeypatch.setattr(sys, "meta_path", [refused, *sys.meta_path])
    monkeypatch.delitem(sys.modules, "sympy", raising=False)
    text = "x'^2/2 + x*cos(t)"
    driven = problem("x", lagrangian=text, free=text)
    for what in (DOUBLE_PENDULUM, DISK, driven):
        schemes.program_of(Formulas(what), choice, ())
    assert refused.asked == 0


DISTANCE = problem("r", lagrangian="r'^2/2 + 1/r - 0.095/r^2")  # on an ellipse of eccentricity 0.9


def test_a_step_begins_its_iterations_where_the_steps_before_lead() -> None:
    """Newton's method from the last increments alone takes three iterations a step here, and the
    stages of Gauss and Legendre take five.
    """
    farthest, grid = Start((1.9,), (0.0,)), Grid(0.01, 60)
    for method in ("nonholonomic", "reference"):
        assert run(DISTANCE, MethodChoice(method), farthest, grid, {}).newton_iterations <= 2.5 * 60


def test_the_first_guess_changes_no_motion() -> None:
    """Through the nearest point of an ellipse, where guesses are far off: runs that go on from a
    step have its motion as those that begin there, without any step before.
    """
    choice, nearest = MethodChoice("reference"), Start((0.1,), (0.0,))
    for first in (1, 4, 9):
        begun, whole = (
            run(DISTANCE, choice, nearest, Grid(0.004, steps), {}) for steps in (first, first + 1)
        )
        middle = Start(tuple(begun.positions[-1]), tuple(begun.velocities[-1]))
        again = run(DISTANCE, choice, middle, Grid(0.004, 1), {})
        assert whole.outcome.completed
        assert np.abs(again.positions[-1] - whole.positions[-1]).max() < 1e-15


def test_what_stages_go_on_to_is_not_taken_beyond_a_jump_of_the_force() -> None:
    """It grows by factors of thousands there: the place would be where the force has no value."""
    driven = problem("x", accelerations=("sqrt(1 - x^2) + 10*(1 + tanh(4000*(t - 0.126)))",))
    found = run(driven, MethodChoice("reference"), Start((0.0,), (0.0,)), Grid(0.05, 6), {})
    assert found.outcome.completed
