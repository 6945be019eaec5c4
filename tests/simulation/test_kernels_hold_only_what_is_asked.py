"""What a scene does not name is not in the kernel."""

from __future__ import annotations

import pytest

from benchmarks.problems import DISK, DISK_CONSTRAINTS, DISK_ENERGY, ROBOT, problem
from benchmarks.scene_effects import operations, scene_of
from inverse_service.codegen.compiled import card_of, kernel_text
from inverse_service.simulation.callables import Formulas
from inverse_service.simulation.scene_data import MethodChoice, Observation, Problem
from inverse_service.simulation.schemes import program_of

BARE = Observation(momenta=True, velocities=False)
WITHOUT_POTENTIAL = problem(
    "theta psi x y",
    lagrangian="1/2*(x'^2 + y'^2 + theta'^2 + psi'^2)",
    constraints=("x' - cos(theta)*psi'", "y' - sin(theta)*psi'"),
    accelerations=("0", "0", "-sin(theta)*theta'*psi'", "cos(theta)*theta'*psi'"),
)
CHOICES = [
    MethodChoice("nonholonomic", 0.5), MethodChoice("nonholonomic", 0.0), MethodChoice("runge_kutta", order=4),
    MethodChoice("reference"),
]  # fmt: skip


def text_of(what: Problem, choice: MethodChoice, observation: Observation = BARE) -> str:
    return kernel_text(program_of(Formulas(what), choice, observation))


def pairs(text: str) -> int:
    return text.count("call {double, double} @sine_cosine(double")


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice.method)
def test_no_potential_no_potential_term(choice: MethodChoice) -> None:
    """psi enters through the potential alone: without one its sine is not there and its place is only added to."""
    with_it, without = (program_of(Formulas(what), choice, BARE) for what in (ROBOT, WITHOUT_POTENTIAL))

    def read(program: object) -> bool:
        """Whether the place of psi occurs in a formula, at the step's start or at a stage."""
        return any(name in str(program) for name in ("sin(q1", "q1 +", "+ q1", "name='x0_1'"))

    assert read(with_it)
    assert not read(without)
    assert "c0" in with_it.arguments
    assert "c0" not in without.arguments
    assert pairs(kernel_text(without)) < pairs(kernel_text(with_it))


@pytest.mark.parametrize("choice", [MethodChoice("variational", 0.5), MethodChoice("nonholonomic", 0.5)])
def test_an_unobserved_quantity_costs_no_instruction(choice: MethodChoice) -> None:
    bare = text_of(DISK, choice)
    observed = text_of(DISK, choice, Observation(velocities=False, observables=(DISK_ENERGY,)))
    both = text_of(DISK, choice, Observation(velocities=False, observables=(DISK_ENERGY, *DISK_CONSTRAINTS)))
    assert "seen_" not in bare
    assert "maximum_" not in bare
    assert "moved_" not in bare
    assert "maximum_0" in observed
    assert "maximum_1" not in observed
    assert len(bare.splitlines()) < len(observed.splitlines()) < len(both.splitlines())
    assert "moved_" in text_of(DISK, choice, Observation(velocities=True))


def test_columns_are_what_changes_and_what_is_observed() -> None:
    choice = MethodChoice("variational", 0.5)
    bare = card_of(program_of(Formulas(DISK), choice, BARE))
    assert bare.layout.columns == ("q0", "q1", "q2", "q3", "p0")
    seen = card_of(program_of(Formulas(DISK), choice, Observation(velocities=False, observables=(DISK_ENERGY,))))
    assert seen.layout.columns == (*bare.layout.columns, "observed_0")


def test_cyclic_coordinates_are_not_iterated() -> None:
    """Newton of the disk has two unknowns at alpha = 1/2, none at alpha = 0."""
    midpoint = card_of(program_of(Formulas(DISK), MethodChoice("variational", 0.5), BARE))
    assert midpoint.solves == (("d0", "e0"),)
    euler = program_of(Formulas(DISK), MethodChoice("variational", 0.0), BARE)
    assert [block.affine for block in euler.blocks] == [True]  # type: ignore[union-attr]
    explicit = card_of(program_of(Formulas(DISK), MethodChoice("nonholonomic", 0.3), BARE))
    assert all(len(names) == 1 for names in explicit.solves)


def test_every_effect_and_observed_quantity_has_its_price_in_operations() -> None:
    base = operations(scene_of(("constraints",), (), 10))
    added = {
        name: operations(scene_of(("constraints", name), (), 10)) - base for name in ("potential", "magnetic", "bumps")
    }
    observed = {name: operations(scene_of(("constraints",), (name,), 10)) - base for name in ("energy", "constraints")}
    assert operations(scene_of((), (), 10)) < base
    assert all(price > 0 for price in (*added.values(), *observed.values()))
    # Quantities made of the recorded points cost nothing in the kernel.
    assert operations(scene_of(("constraints",), ("trajectory", "matching_circle", "error", "phase"), 10)) == base
