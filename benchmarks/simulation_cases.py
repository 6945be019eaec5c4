"""The runs whose speed is measured: disk and particle, one start each, three methods."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.hard_cases import disk_start, particle_start
from benchmarks.problems import DISK, PARTICLE
from inverse_service.kernels.codegen.program import Program
from inverse_service.simulation.execution import arguments_of, initial
from inverse_service.simulation.numeric_formulas import Formulas
from inverse_service.simulation.scene_data import Grid, MethodChoice, Observation, Problem, Start
from inverse_service.simulation.schemes import program_of

BARE: Observation = ()
STEP, CONSTANT = 0.01, 1e-2


@dataclass(frozen=True, slots=True)
class SpeedCase:
    """One problem with one method."""

    name: str
    problem: Problem
    choice: MethodChoice
    start: Start

    @property
    def label(self) -> str:
        return f"{self.name}, {self.choice.method}, alpha = {self.choice.alpha:g}"


CASES = [
    SpeedCase(name, problem, MethodChoice(method, alpha), start)
    for name, problem, start in (
        ("disk", DISK, disk_start()),
        ("particle", PARTICLE, particle_start()),
    )
    for method, alpha in (("variational", 0.0), ("variational", 0.5), ("nonholonomic", 0.5))
]


def program(case: SpeedCase) -> Program:
    return program_of(Formulas(case.problem), case.choice, BARE)


def lane(case: SpeedCase, step: float = STEP) -> dict[str, float]:
    """State, rates and arguments at the start."""
    values = dict.fromkeys(case.problem.parameters, CONSTANT)
    arguments = arguments_of(case.problem, case.choice, Grid(step, 1), values)
    begin = initial(Formulas(case.problem), case.choice, case.start, arguments)
    assert isinstance(begin, dict)
    return begin
