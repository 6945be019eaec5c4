"""Decide which motions of docs/questions/motions.ndjson can be given a Hamiltonian, for
docs/records/motions.md.

For each motion, the question about L(q, q') is decided by itself, for its order and dimensions.
Then `solve` solves it in full.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inverse_service.constrained.existence import analyze_motion, decide_motion
from inverse_service.decision.solutions import SolveOptions
from inverse_service.linear_pde.involution import Finding
from inverse_service.mechanics.constrained_motion import equations_of_motion
from inverse_service.service.documents.motion_documents import nonholonomic_of
from inverse_service.service.documents.nonholonomic_documents import solve_nonholonomic
from inverse_service.statements.questions import PLAIN

QUESTIONS = Path("docs/questions/motions.ndjson")
HEAD = (
    "motion",
    "can it be given a Hamiltonian?",
    "proof",
    "order",
    "dimensions",
    "freedom in L",
    "decision, s",
    "all, s",
)
_DEGREES = 3
_WORDS = {"variational": "**yes**", "not_variational": "no", "undetermined": "open"}


@dataclass(frozen=True, slots=True)
class Row:
    """The decision about L(q, q') and the result of `solve` for the motion, each with its processor
    seconds.
    """

    name: str
    found: Finding
    decision: float
    answer: Mapping[str, Any]
    seconds: float


def documents(chosen: str = "") -> Iterator[dict[str, Any]]:
    """The documents of the file whose names contain the text."""
    lines = QUESTIONS.read_text(encoding="utf-8").splitlines()
    return (document for document in map(json.loads, lines) if chosen in document["name"])


def measure(document: Mapping[str, Any], limit: float) -> Row:
    """Measure both, one after the other, each with a limit in processor seconds."""
    began = time.process_time()
    motion = equations_of_motion(nonholonomic_of(document))
    found = decide_motion(
        analyze_motion(motion), PLAIN, 1, time.thread_time() + limit, lambda _: None
    )
    decided = time.process_time()
    options = SolveOptions(time_limit=limit)
    answer = solve_nonholonomic({**document, "associated": "any"}, options)["any_associated"]
    return Row(document["name"], found, decided - began, answer, time.process_time() - decided)


def cells(row: Row) -> tuple[str, ...]:
    """The cells of the table. The proof is a Lagrangian, a list of rows, or the data of an
    existence proof.
    """
    last = row.found.history[-1] if row.found.history else ()
    return (
        row.name,
        said(row.answer),
        proof(row.answer),
        f"{'open at ' * (row.found.exists is None)}{row.found.order or ''}",
        ", ".join(map(str, last[:_DEGREES])),
        row.answer["freedom"] or "",
        f"{row.decision:.2g}",
        f"{row.seconds:.2g}",
    )


def said(answer: Mapping[str, Any]) -> str:
    """The verdict in one word, or in two if only an L(t, q, q') is known or excluded."""
    without, with_time = (_WORDS[answer[key]] for key in ("verdict", "verdict_with_time"))
    return without if without == with_time else f"{without}, L(t, q, q'): {with_time}"


def proof(answer: Mapping[str, Any]) -> str:
    """The type of the certificate. `solve` returns only certificates that the checker finds
    valid.
    """
    certificate = answer["certificate"] or {}
    if certificate.get("along"):
        return f"brackets to t^{certificate['along']}"
    if certificate.get("kind") == "nonexistence":
        return f"{len(certificate['rows'])} rows"
    of = {"lagrangian": "L", "existence": "existence"}
    return of.get(certificate.get("kind", ""), answer.get("reason") or "")


def table(rows: Sequence[Row]) -> str:
    lines = [HEAD, ("---",) * len(HEAD), *map(cells, rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.motions", description=__doc__)
    parser.add_argument("--only", default="", help="motions whose names contain this")
    parser.add_argument("--limit", type=float, default=120.0, help="processor seconds for each")
    options = parser.parse_args(arguments)
    measure(next(documents()), options.limit)  # loads the compiled kernels
    rows = []
    for document in documents(options.only):
        rows.append(measure(document, options.limit))
        print(" | ".join(cells(rows[-1])), file=sys.stderr, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
