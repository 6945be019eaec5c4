"""Measure how often, and how fast, systems with a known Lagrangian get L and H in closed form.

python -m benchmarks lagrangians --count 200 --seed 1 [--disguised] [--shapes] [--start 100]

The systems are those of the test generator, so this runs from a checkout only. The time is that of
the whole solution in seconds of processor time, so other programs do not count: decision, search,
check by the independent checker, Legendre transform, explanation.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.tables import MISSING, table
from inverse_service.decision.solutions import SolveOptions, Statement
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.solving.solving import solve

EVERY = "all"


@dataclass(frozen=True, slots=True)
class Measured:
    """One system: `ansatz` is the family in which L was found, empty if none was."""

    name: str
    family: str
    n: int
    verdict: str
    ansatz: str
    closed_hamiltonian: bool
    seconds: float


@dataclass(frozen=True, slots=True)
class FamilyRow:
    """Shares and seconds of one family; None if nothing was found."""

    family: str
    systems: int
    found: float
    median: float | None
    percentile: float | None
    closed_hamiltonians: float | None


def generated(
    count: int, seed: int, disguised: bool, shapes: bool = False, start: int = 0
) -> list[Any]:
    """Systems of the test generator, with its less usual shapes or its usual ones.

    Raises ModuleNotFoundError outside a checkout.
    """
    generator = importlib.import_module("tests.generator")
    rooms = {True: ("shapes", "SHAPES"), False: ("families", "FAMILIES")}
    room, name = rooms[shapes]
    families = tuple(getattr(importlib.import_module(f"tests.generator.{room}"), name))
    systems = [
        generator.random_system(index, seed, families) for index in range(start, start + count)
    ]
    return [generator.disguised(system, seed) for system in systems] if disguised else list(systems)


def measure(given: Any, limit: float) -> Measured:
    """Solve the question that the known Lagrangian answers."""
    system = read_system(given.coordinates, given.equations, name=given.id)
    began = time.process_time()
    solution = solve(system, SolveOptions(time_dependent=given.time_dependent, time_limit=limit))
    seconds = time.process_time() - began
    answer = solution.main
    return Measured(
        given.id,
        given.family,
        given.n,
        answer.verdict,
        _ansatz(answer),
        _has_closed_hamiltonian(answer),
        seconds,
    )


def _ansatz(answer: Statement) -> str:
    return "" if answer.lagrangian is None else answer.lagrangian.family


def _has_closed_hamiltonian(answer: Statement) -> bool:
    return answer.hamiltonian is not None and not answer.hamiltonian.transform.implicit


def by_family(measured: Sequence[Measured]) -> list[FamilyRow]:
    """One row for each family of systems, and one for all."""
    families = list(dict.fromkeys(one.family for one in measured))
    rows = [_row(family, [one for one in measured if one.family == family]) for family in families]
    return [*rows, _row(EVERY, measured)]


def by_ansatz(measured: Iterable[Measured]) -> dict[str, int]:
    """The number of Lagrangians that each ansatz found, in descending order."""
    counts: dict[str, int] = {}
    for one in measured:
        if one.ansatz:
            counts[one.ansatz] = counts.get(one.ansatz, 0) + 1
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def _row(family: str, measured: Sequence[Measured]) -> FamilyRow:
    found = [one for one in measured if one.ansatz]
    seconds = sorted(one.seconds for one in found)
    return FamilyRow(
        family,
        len(measured),
        len(found) / len(measured),
        statistics.median(seconds) if seconds else None,
        percentile(seconds, 0.95) if seconds else None,
        sum(one.closed_hamiltonian for one in found) / len(found) if found else None,
    )


def percentile(ordered: Sequence[float], share: float) -> float:
    """The smallest number that at least this share of an ascending sequence does not exceed."""
    place = next(k for k in range(len(ordered)) if k + 1 >= share * len(ordered))
    return ordered[place]


def _number(value: float | None, form: str) -> str:
    return MISSING if value is None else format(value, form)


def markdown(measured: Sequence[Measured]) -> str:
    """The tables by family and by ansatz, and the systems without L."""
    head = ["family", "systems", "L found", "median, s", "95th percentile, s", "H in closed form"]
    cells = [
        [row.family, str(row.systems), _number(row.found, ".1%"), _number(row.median, ".2f"),
         _number(row.percentile, ".2f"), _number(row.closed_hamiltonians, ".1%")]
        for row in by_family(measured)
    ]  # fmt: skip
    ansatz = table(
        ["ansatz", "Lagrangians"],
        ([name, str(count)] for name, count in by_ansatz(measured).items()),
    )
    missing = [
        f"- {one.name} (n = {one.n}): {one.verdict}, {one.seconds:.1f} s"
        for one in measured
        if not one.ansatz
    ]
    return "\n".join(
        [table(head, cells), ansatz, "Without a closed form:\n", *(missing or ["- none"])]
    )


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks lagrangians", description=__doc__)
    parser.add_argument("--count", type=int, default=200, help="number of systems (default 200)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the generator (default 1)")
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds for one system (default 60)"
    )
    parser.add_argument(
        "--start", type=int, default=0, help="number of the first system (default 0)"
    )
    parser.add_argument(
        "--shapes",
        action="store_true",
        help="Finsler functions, logarithms, powers, products and so on",
    )
    parser.add_argument("--disguised", action="store_true", help="the systems in other coordinates")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None, report: Callable[[str], None] = print) -> None:
    chosen = options(arguments)
    measured: list[Measured] = []
    for index in range(chosen.start, chosen.start + chosen.count):
        (system,) = generated(1, chosen.seed, chosen.disguised, chosen.shapes, index)
        if not measured:
            measure(system, chosen.limit)  # loads the compiled kernels
        measured.append(measure(system, chosen.limit))
        last = measured[-1]
        said = f"{last.ansatz or 'no closed form'}{'' if last.closed_hamiltonian or not last.ansatz else ', no H'}"
        print(f"{last.name}: {said}, {last.seconds:.2f} s", file=sys.stderr, flush=True)
    report(markdown(measured))
