"""Measure how cost grows: time and memory against n, and against the order of prolongation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.decision_benchmark import read
from benchmarks.families import GROWING, Document
from benchmarks.isolated import measure
from inverse_service.decision.deciding import HelmholtzAt, analyze
from inverse_service.linear_pde.involution import prolonged
from inverse_service.statements.questions import PLAIN

Report = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class SizeRow:
    """One family at one n; `verdict` is None past the time limit."""

    family: str
    n: int
    verdict: str | None
    order: int
    seconds: float | None
    megabytes: float | None


@dataclass(frozen=True, slots=True)
class OrderRow:
    """One order at one point: unknown coefficients, and the seconds from the start up to this
    order.
    """

    name: str
    n: int
    order: int
    unknowns: int
    seconds: float


def against_size(largest: int, limit: float, report: Report) -> list[SizeRow]:
    """Measure each family for n = 1 to `largest`, each n in its own process; a family ends at its
    first timeout.
    """
    rows = []
    for family, make in GROWING.items():
        for n in range(1, largest + 1):
            report(f"{family}, n = {n}")
            row = _size_row(family, n, make(n), limit)
            rows.append(row)
            if row.verdict is None:
                break
    return rows


def _size_row(family: str, n: int, document: Document, limit: float) -> SizeRow:
    found = measure("benchmarks.ours", [], document, limit)
    if found is None:
        return SizeRow(family, n, None, 0, None, None)
    return SizeRow(
        family, n, found["verdict"], found["order"], found["seconds"], found["megabytes"]
    )


def against_order(document: Document, highest: int, limit: float, report: Report) -> list[OrderRow]:
    """Measure orders 0 to `highest`, even if a lower one decides; end after `limit` seconds."""
    analysis = analyze(read(document))
    rows: list[OrderRow] = []
    for order in range(highest + 1):
        report(f"{document['name']}, order {order}")
        began = time.perf_counter()
        prolongation = prolonged(HelmholtzAt(analysis, PLAIN), 1, order)
        seconds = time.perf_counter() - began
        n = len(analysis.system.coordinates)
        rows.append(OrderRow(document["name"], n, order, prolongation.width(order), seconds))
        if seconds > limit:
            break
    return rows
