"""Measure what a kind of Lagrangian costs next to the plain decision: the table in
docs/records/kinds.md.

`python -m benchmarks.kind_costs [--write]`: the systems of the catalogue with at most four
coordinates, processor time of one thread, one run each; no Lagrangian is passed, so each kind is
decided by itself.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.measured import conditions, put
from benchmarks.tables import table
from inverse_service import catalogue
from inverse_service.certificate import checker
from inverse_service.deadline import now
from inverse_service.decision import certify
from inverse_service.decision.deciding import analyze, decide
from inverse_service.decision.helmholtz import invariant, kind_named
from inverse_service.decision.solutions import Solution, SolveOptions, Statement
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import number
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.solving import kind_answers
from inverse_service.statements.questions import PLAIN

PAGE = Path(__file__).parents[1] / "docs" / "records" / "kinds.md"
KINDS = ("natural", "riemannian", "finsler", "invariant", "rayleigh", "positive_definite")
MOST, MOST_SECONDS = 4, 5.0


class Checks:
    """The processor time that the checker takes within an answer."""

    def __init__(self) -> None:
        self.seconds, self._checked = 0.0, checker.check_certificate
        checker.check_certificate = self.check  # type: ignore[assignment]

    def check(self, certificate: Any, **options: Any) -> Any:
        began = time.thread_time()
        found = self._checked(certificate, **options)
        self.seconds += time.thread_time() - began
        return found


def plain(system: SecondOrderSystem, seed: int) -> None:
    analysis = analyze(system)
    found = decide(system, PLAIN, seed, analysis=analysis)
    if found.verdict != "undetermined":
        checker.check_certificate(certify.of_decision(analysis, found))


def asked(name: str, system: SecondOrderSystem, seed: int) -> bool:
    """Decide a kind as if nothing else were known about the system; return whether the answer is
    definite.
    """
    names, end = system.coordinates, now() + MOST_SECONDS
    solution = Solution(system, (PLAIN,), (Statement(PLAIN, "undetermined"),), None)
    kind = (
        invariant([{names[0]: ("1", number(1))}], names)
        if name == "invariant"
        else kind_named(name, names)
    )
    return (
        kind_answers.answer_kind(solution, kind, {}, SolveOptions(seed=seed), end).certificate
        is not None
    )


def seconds(work: Callable[[], object], checks: Checks) -> tuple[object, float, float]:
    """The value of the work, and its processor time with and without the checks."""
    checks.seconds, began = 0.0, time.thread_time()
    found = work()
    whole = time.thread_time() - began
    return found, whole, whole - checks.seconds


def systems() -> dict[str, SecondOrderSystem]:
    found = {}
    for name in catalogue.names():
        one = catalogue.document(name)
        if "equations" in one and len(one["coordinates"]) <= MOST:
            found[name] = read_system(
                one["coordinates"],
                one["equations"],
                one.get("parameters", ()),
                one.get("functions"),
                name,
            )
    return found


def measured() -> str:
    checks, ratios = Checks(), {name: list[tuple[float, float]]() for name in KINDS}
    plains = []
    for name, system in systems().items():
        try:
            plain(system, 1)  # loads what is loaded once
            _, *beside = seconds(partial(plain, system, 2), checks)
        except IrreducibleAtoms:
            continue
        plains.append((beside[0], beside[1]))
        for kind, listed in ratios.items():
            definite, *own = seconds(partial(asked, kind, system, 2), checks)
            if not definite:
                continue
            listed.append((own[0] / beside[0], own[1] / beside[1]))
            print(f"{name} {kind}: {listed[-1][0]:.2f} {listed[-1][1]:.2f}", flush=True)
    head = ["kind", "answers", "median", "without the checks", "nine of ten below"]
    rows = [
        [kind, str(len(listed)), *(f"{x:.1f}" for x in _columns(listed))]
        for kind, listed in ratios.items()
    ]
    whole, alone = (1000 * statistics.median(column) for column in zip(*plains, strict=True))
    told = f"{len(plains)} systems; the plain decision takes {alone:.0f} ms at the median, with its check {whole:.0f} ms"
    return f"{table(head, rows)}\n{told} ({conditions()}).\n"


def _columns(listed: list[tuple[float, float]]) -> tuple[float, float, float]:
    whole, alone = (sorted(column) for column in zip(*listed, strict=True))
    return statistics.median(whole), statistics.median(alone), whole[len(whole) * 9 // 10]


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument(
        "--write", action="store_true", help="put the table in docs/records/kinds.md"
    )
    text = measured()
    print(text)
    if options.parse_args().write:
        put(PAGE, "costs", text)
