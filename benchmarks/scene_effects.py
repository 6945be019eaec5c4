"""What each effect and each observed quantity of a scene costs: derive, compile, time a step.

`python -m benchmarks.scene_effects [--steps N] [--repeats N]`. The system is a rolling disk with a
spring, a field and a term of its own; each row adds one thing to the row it names. The times per
step are the best of several alternating measurements of all rows; compile times are those of an
empty cache. Operations are the floating-point instructions and calls in the text of the kernel:
they do not depend on the machine or its load.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inverse_service.expressions.tree import add
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.simulation.costs import operations as operations_of
from inverse_service.simulation.derivation import Derived, lagrangian_parts, problem_of
from inverse_service.simulation.observing import observed_problem
from inverse_service.simulation.running import MethodRun, run_method
from inverse_service.simulation.scene_data import (
    FreeLagrangian,
    Grid,
    MethodChoice,
    Requested,
    Scene,
    Unavailable,
)

COORDINATES = ("phi", "theta", "x", "y")
LAGRANGIAN = "(x'^2 + y'^2)/2 + theta'^2/4 + phi'^2/8 + B*(x*y' - y*x')/2 - k*(x^2 + y^2)/2"
CONSTRAINTS = ("x' - cos(phi)*theta'", "y' - sin(phi)*theta'")
TERMS = {"bumps": "-a*cos(x)*cos(y)"}
VALUES = {"B": 0.1, "k": 0.2, "a": 0.05}
METHOD = Requested("nonholonomic", MethodChoice("nonholonomic"), "0.5")
Named = tuple[str, ...]
# Row, effects, observed quantities. Each row adds one thing to the first row, or to the previous
# row with the same beginning.
ROWS: tuple[tuple[str, Named, Named], ...] = (
    ("kinetic energy alone", (), ()),
    ("+ constraints", ("constraints",), ()),
    ("+ constraints, potential", ("constraints", "potential"), ()),
    ("+ constraints, magnetic", ("constraints", "magnetic"), ()),
    ("+ constraints, bumps", ("constraints", "bumps"), ()),
    ("+ all effects", ("constraints", "potential", "magnetic", "bumps"), ()),
    ("+ constraints; energy observed", ("constraints",), ("energy",)),
    ("+ constraints; constraints observed", ("constraints",), ("constraints",)),
    ("+ constraints; both observed", ("constraints",), ("energy", "constraints")),
)


@dataclass(frozen=True, slots=True)
class Cost:
    """Seconds to derive and to compile, operations in the kernel, nanoseconds per step (best),
    seconds of observing.
    """

    row: str
    derive: float
    compile: float
    operations: int
    step: float
    observing: float


def scene_of(effects: Named, observe: Named, steps: int) -> Scene:
    """The disk with these effects and observed quantities, and nothing else."""
    names = Names(COORDINATES, tuple(VALUES))
    parts = lagrangian_parts(read_formula(LAGRANGIAN, names), COORDINATES)
    parts |= {name: read_formula(text, names) for name, text in TERMS.items()}
    lagrangian = add(*(tree for name, tree in parts.items() if name in ("kinetic", *effects)))
    constraints = (
        tuple(read_formula(text, names) for text in CONSTRAINTS) if "constraints" in effects else ()
    )
    return Scene(
        name="", coordinates=COORDINATES, values=VALUES, lagrangian=lagrangian,
        constraints=constraints, accelerations=None, effects=effects, positions=np.array([0.3, 0.0, 1.0, 0.0]),
        velocities=np.array([1.0, 0.5, 0.5 * np.cos(0.3), 0.5 * np.sin(0.3)]),
        grid=Grid(0.01, steps, max(1, steps // 10)), methods=(METHOD,), observe=observe, circle=(2, 3),
    )  # fmt: skip


def costs(steps: int, repeats: int) -> list[Cost]:
    """One Cost per row."""
    scenes = [scene_of(effects, observe, steps) for _, effects, observe in ROWS]
    firsts, derived_in = [], []
    for scene in scenes:
        begun = time.perf_counter()
        derived = Derived(scene, _no_free)
        problem_of(METHOD, derived)
        derived_in.append(time.perf_counter() - begun)
        firsts.append(run_method(derived.but(grid=Grid(0.01, 10)), METHOD))
    best = [float("inf")] * len(scenes)
    last: list[MethodRun] = list(firsts)
    for turn in range(repeats):
        order = range(len(scenes)) if turn % 2 == 0 else range(len(scenes) - 1, -1, -1)
        for k in order:
            last[k] = run_method(Derived(scenes[k], _no_free), METHOD)
            best[k] = min(best[k], last[k].seconds["run"])
    rows = zip(ROWS, derived_in, firsts, best, last, strict=True)
    return [
        Cost(
            row[0],
            seconds,
            first.seconds["compile"],
            operations(scene),
            1e9 * least / steps,
            _observing(run),
        )
        for scene, (row, seconds, first, least, run) in zip(scenes, rows, strict=True)
    ]


def operations(scene: Scene) -> int:
    """The operations of a step of the scene's method."""
    problem = problem_of(METHOD, Derived(scene, _no_free))
    return operations_of(*observed_problem(scene, problem, METHOD.choice), METHOD.choice).total


def _observing(run: MethodRun) -> float:
    return sum(value for name, value in run.seconds.items() if name not in ("compile", "run"))


def _no_free(*_: object) -> FreeLagrangian:
    raise Unavailable("not asked for")


def table(found: Sequence[Cost]) -> str:
    """Markdown."""
    heads = ("scene", "derive, ms", "compile, ms", "operations", "ns a step", "observing, ms")
    head = f"| {' | '.join(heads)} |\n| --- |{' ---: |' * (len(heads) - 1)}\n"
    rows = (
        (c.row, f"{1e3 * c.derive:.2f}", f"{1e3 * c.compile:.0f}", str(c.operations), f"{c.step:.0f}",
         f"{1e3 * c.observing:.2f}")
        for c in found
    )  # fmt: skip
    return head + "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def main() -> None:
    """Measure with an empty cache of kernels and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["INVERSE_SERVICE_CACHE"] = folder
        print(table(costs(options.steps, options.repeats)), end="")


if __name__ == "__main__":
    main()
