"""Compare our decision with tools that complete linear PDE systems, on the same systems in one
run.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.decision_benchmark import read
from benchmarks.families import Document
from benchmarks.isolated import measure
from benchmarks.peers.systems import peer_systems
from inverse_service.decision.deciding import decide
from inverse_service.statements.questions import PLAIN

Report = Callable[[str], None]
REPEATS = 9
# The tools that complete the system, then the one that does only the algebraic part.
PEERS = ("differential_algebra", "singular", "maxima")


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer of one tool: its verdict and processor seconds, or why there are none."""

    verdict: str | None
    seconds: float | None
    note: str = ""


@dataclass(frozen=True, slots=True)
class PeerRow:
    """One system, the expected verdict, our answer and the peers'."""

    name: str
    n: int
    expected: str
    ours: Answer
    peers: dict[str, Answer]

    @property
    def fastest_complete(self) -> float | None:
        """The shortest time of a peer that completes the system and is right, in seconds."""
        complete = [self.peers[name] for name in PEERS[:2]]
        return min(
            (a.seconds for a in complete if a.seconds is not None and a.verdict == self.expected),
            default=None,
        )


def ours(document: Document) -> Answer:
    """The median over fresh seeds, both points and primes included."""
    system = read(document)
    decide(system, PLAIN)  # compiled kernels are loaded once: a warm worker has them
    seconds = []
    for seed in range(1, REPEATS + 1):
        began = time.process_time()
        decision = decide(system, PLAIN, seed=seed)
        seconds.append(time.process_time() - began)
    return Answer(decision.verdict, statistics.median(seconds))


def peer(name: str, document: Document, limit: float) -> Answer:
    """Run one peer in its own process; its start and our preparation of its input are not
    counted.
    """
    found = measure(f"benchmarks.peers.{name}", [], document, limit)
    if found is None or found.get("stopped"):
        return Answer(None, None, "past the limit")
    if found.get("missing"):
        return Answer(None, None, "not installed")
    return Answer(found["verdict"], found["seconds"])


def against_peers(limit: float, report: Report) -> list[PeerRow]:
    """Measure all systems, alternating the tools."""
    rows = []
    for document, expected in peer_systems():
        report(document["name"])
        answers = {name: peer(name, document, limit) for name in PEERS}
        rows.append(
            PeerRow(
                document["name"], len(document["coordinates"]), expected, ours(document), answers
            )
        )
    return rows


def summary(rows: Sequence[PeerRow]) -> str:
    """On how many systems we are right, and our time relative to the fastest peer that completes
    the system.
    """
    right = sum(row.ours.verdict == row.expected for row in rows)
    ratios = [
        (row.ours.seconds / fastest, row.name)
        for row in rows
        if row.ours.seconds is not None and (fastest := row.fastest_complete) is not None
    ]
    if not ratios:
        return f"Ours is right on {right} of {len(rows)}; no peer that completes the system is installed.\n"
    within = sum(ratio <= 2 for ratio, _ in ratios)
    worst, where = max(ratios)
    return (
        f"Ours is right on {right} of {len(rows)}. It is the fastest or within 2 times of the fastest on {within} of "
        f"the {len(ratios)} that some peer completes; the worst is {worst:.3g} times ({where}).\n"
    )
