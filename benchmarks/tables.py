"""Measurements as Markdown tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.cold_start import ColdStart
from benchmarks.decision_benchmark import Comparison, Medians
from benchmarks.growth import OrderRow, SizeRow
from benchmarks.peers_benchmark import PEERS, Answer, PeerRow
from benchmarks.plain import SIMPLIFICATIONS

MISSING = "-"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table with the first column left-aligned and the other columns right-aligned."""
    rule = ["---"] + ["---:"] * (len(head) - 1)
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (head, rule, *rows)) + "\n"


def milliseconds(seconds: float | None) -> str:
    return MISSING if seconds is None else f"{1000 * seconds:.3g}"


def times(ratio: float | None) -> str:
    return MISSING if ratio is None else f"{ratio:.3g}"


def comparison_table(found: Sequence[Comparison]) -> str:
    """One row per system: our time, then that of each plain pipeline and its ratio to ours."""
    plain = [cell for kind in SIMPLIFICATIONS for cell in (f"plain ({kind}), ms", "ratio")]
    return table(
        ["system", "n", "verdict", "order", "ours, ms", *plain], map(_comparison_cells, found)
    )


def _comparison_cells(c: Comparison) -> list[str]:
    verdict = c.verdict if c.verdict == c.expected else f"{c.verdict} (WRONG)"
    plain = [
        cell for kind in SIMPLIFICATIONS for cell in (_plain_cell(c, kind), times(c.ratio(kind)))
    ]
    return [c.name, str(c.n), verdict, str(c.order), milliseconds(c.seconds), *plain]


def _plain_cell(c: Comparison, kind: str) -> str:
    if c.plain_seconds[kind] is None:
        return "past the limit"
    wrong = "" if c.plain_verdicts[kind] == c.expected else " (wrong verdict)"
    return milliseconds(c.plain_seconds[kind]) + wrong


def medians_table(rows: Sequence[Medians]) -> str:
    """Medians for each n; plain runs as right / wrong / past the limit."""
    plain = [
        cell
        for kind in SIMPLIFICATIONS
        for cell in (f"plain ({kind}): right/wrong/stopped", "median ratio")
    ]
    return table(
        ["n", "systems", "ours: median, ms", "ours: slowest, ms", *plain], map(_medians_cells, rows)
    )


def _medians_cells(row: Medians) -> list[str]:
    ends = {
        kind: f"{row.right[kind]}/{row.wrong[kind]}/{row.stopped[kind]}" for kind in SIMPLIFICATIONS
    }
    plain = [cell for kind in SIMPLIFICATIONS for cell in (ends[kind], times(row.ratios[kind]))]
    return [
        str(row.n),
        str(row.systems),
        milliseconds(row.seconds),
        milliseconds(row.slowest),
        *plain,
    ]


def size_table(rows: Sequence[SizeRow]) -> str:
    """Time and memory against n."""
    return table(["family", "n", "verdict", "order", "ms", "peak MB"], map(_size_cells, rows))


def _size_cells(row: SizeRow) -> list[str]:
    if row.verdict is None:
        return [row.family, str(row.n), "past the limit", MISSING, MISSING, MISSING]
    peak = MISSING if row.megabytes is None else f"{row.megabytes:.0f}"
    return [row.family, str(row.n), row.verdict, str(row.order), milliseconds(row.seconds), peak]


def order_table(rows: Sequence[OrderRow]) -> str:
    """Time against the order of prolongation."""
    head = ["system", "n", "order", "unknowns", "ms"]
    return table(
        head,
        ([r.name, str(r.n), str(r.order), str(r.unknowns), milliseconds(r.seconds)] for r in rows),
    )


def cold_table(rows: Sequence[ColdStart]) -> str:
    """Cold starts, the most work first."""
    ordered = sorted(
        rows, key=lambda r: float("inf") if r.processor is None else r.processor, reverse=True
    )
    return table(["entry", "processor, s", "clock, s", "exit code"], map(_cold_cells, ordered))


def _cold_cells(row: ColdStart) -> list[str]:
    if row.seconds is None or row.processor is None:
        return [row.name, "past the limit", MISSING, MISSING]
    return [row.name, f"{row.processor:.2f}", f"{row.seconds:.2f}", str(row.exit_code)]


def peers_table(rows: Sequence[PeerRow]) -> str:
    """One row per system: our time and that of each peer in ms; a wrong verdict is marked."""
    head = [
        "system",
        "n",
        "verdict",
        "ours, ms",
        *(f"{name.replace('_', ' ')}, ms" for name in PEERS),
    ]
    return table(head, (_peer_cells(row) for row in rows))


def _peer_cells(row: PeerRow) -> list[str]:
    cells = [_answer_cell(answer, row.expected) for answer in (row.ours, *row.peers.values())]
    return [row.name, str(row.n), row.expected, *cells]


def _answer_cell(answer: Answer, expected: str) -> str:
    if answer.seconds is None:
        return answer.note
    wrong = "" if answer.verdict == expected else f" (says {answer.verdict})"
    return milliseconds(answer.seconds) + wrong
