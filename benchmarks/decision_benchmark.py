"""Compare our decision with the plain pipeline, alternately, on the paper's systems and on random
ones.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.families import Document, random_natural, random_quadratic
from benchmarks.isolated import measure
from benchmarks.plain import SIMPLIFICATIONS
from inverse_service import catalogue
from inverse_service.decision.deciding import decide
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.statements.questions import PLAIN

Report = Callable[[str], None]
REPEATS = 5


@dataclass(frozen=True, slots=True)
class Comparison:
    """One system: our median of processor seconds over fresh seeds, and the plain ones by
    simplification.

    A plain run past the limit is None.
    """

    name: str
    n: int
    expected: str
    verdict: str
    order: int
    seconds: float
    plain_seconds: dict[str, float | None]
    plain_verdicts: dict[str, str | None]

    def ratio(self, simplification: str) -> float | None:
        """Plain seconds over ours; None if the plain run was stopped or gave the wrong verdict."""
        plain = self.plain_seconds[simplification]
        if plain is None or self.plain_verdicts[simplification] != self.expected:
            return None
        return plain / self.seconds


@dataclass(frozen=True, slots=True)
class Medians:
    """All systems of one n: medians of our seconds and, per simplification, of the ratios that
    exist.

    `right`, `wrong` and `stopped` count the plain runs by their end.
    """

    n: int
    systems: int
    seconds: float
    slowest: float
    ratios: dict[str, float | None]
    right: dict[str, int]
    wrong: dict[str, int]
    stopped: dict[str, int]


def paper_systems() -> list[tuple[str, Document, str]]:
    """(name, document, expected verdict) of the paper's systems in the catalogue."""
    entries = [catalogue.entry(name) for name in catalogue.names()]
    paper = [entry for entry in entries if entry["group"] == "paper"]
    return [(entry["name"], entry["document"], entry["expected"]["verdict"]) for entry in paper]


def random_ones(each: int) -> list[tuple[str, Document, str]]:
    """For n = 2, 3, 4, `each` natural systems and as many random quadratic ones, with known
    verdicts.

    A quadratic draw that has a Lagrangian after all would make the decision disagree; none has one.
    """
    found = []
    for n in (2, 3, 4):
        for seed in range(1, each + 1):
            natural, quadratic = random_natural(n, seed), random_quadratic(n, seed)
            found.append((natural["name"], natural, "variational"))
            found.append((quadratic["name"], quadratic, "not_variational"))
    return found


def read(document: Document) -> SecondOrderSystem:
    """The system of a document, as the service parses it."""
    return read_system(
        document["coordinates"],
        document["equations"],
        document.get("parameters", ()),
        document.get("functions"),
    )


def compare(name: str, document: Document, expected: str, limit: float) -> Comparison:
    """Run our decision for L(q, v) at both points, with a new seed for each repeat; then the plain
    pipelines.
    """
    system = read(document)
    runs, seconds = [], []
    for seed in range(1, REPEATS + 1):
        began = time.process_time()
        runs.append(decide(system, PLAIN, seed=seed))
        seconds.append(time.process_time() - began)
    plain = {kind: measure("benchmarks.plain", [kind], document, limit) for kind in SIMPLIFICATIONS}
    return Comparison(
        name=name,
        n=len(system.coordinates),
        expected=expected,
        verdict=runs[0].verdict,
        order=runs[0].order,
        seconds=statistics.median(seconds),
        plain_seconds={kind: found["seconds"] if found else None for kind, found in plain.items()},
        plain_verdicts={kind: found["verdict"] if found else None for kind, found in plain.items()},
    )


def comparisons(each: int, limit: float, report: Report) -> list[Comparison]:
    """Compare all systems, alternating ours and the plain pipelines, so that both meet the same
    load of the machine.
    """
    decide(
        read(random_natural(2)), PLAIN
    )  # compiled kernels are loaded once: a warm worker has them
    found = []
    for name, document, expected in paper_systems() + random_ones(each):
        report(name)
        found.append(compare(name, document, expected, limit))
    return found


def medians(found: Sequence[Comparison]) -> list[Medians]:
    """One row for each n."""
    return [_medians_of(n, [c for c in found if c.n == n]) for n in sorted({c.n for c in found})]


def _medians_of(n: int, group: Sequence[Comparison]) -> Medians:
    seconds = [c.seconds for c in group]
    kinds = list(group[0].plain_seconds)
    ratios = {kind: [r for c in group if (r := c.ratio(kind)) is not None] for kind in kinds}
    stopped = {kind: sum(c.plain_seconds[kind] is None for c in group) for kind in kinds}
    right = {kind: len(found) for kind, found in ratios.items()}
    return Medians(
        n=n,
        systems=len(group),
        seconds=statistics.median(seconds),
        slowest=max(seconds),
        ratios={
            kind: statistics.median(found) if found else None for kind, found in ratios.items()
        },
        right=right,
        wrong={kind: len(group) - right[kind] - stopped[kind] for kind in kinds},
        stopped=stopped,
    )
