"""`python -m benchmarks simulation`: speed of the integrators as tables.

With `hard-cases` as the first word, run every hard case instead.
"""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from benchmarks import simulation_speed as speed
from benchmarks.handwritten import handwritten_row
from benchmarks.hard_cases import Judged, all_cases, judge
from benchmarks.tables import MISSING, table

HOW = """Made by `python -m benchmarks simulation`. The routes alternate in short rounds of one run; the
best round is the one that other work on the machine disturbed least. heyoka and our methods are timed warm,
the best of twenty in a row. Latencies by the clock suffer most from a busy machine; processor time suffers less."""
PARTS = ("routes", "latency", "ensembles", "effects", "long", "handwritten")


def report(line: str) -> None:
    """Print the name of the running measurement on standard error."""
    print(line, file=sys.stderr, flush=True)


def routes_section(rounds: int) -> str:
    rows = speed.route_rows(report, rounds)
    names = list(rows[0].routes)
    cells = [
        [row.case, *(f"{row.routes[n][0]:.3g} / {row.routes[n][1]:.3g}" for n in names),
         *(_ratio(row, n) for n in names if n != "ours")]
        for row in rows
    ]  # fmt: skip
    head = ["run", *(f"{name}, ns" for name in names), *(f"ours : {name}" for name in names if name != "ours")]
    return f"## A step, in nanoseconds (best / median)\n\n{table(head, cells)}"


def _ratio(row: speed.RouteRow, name: str) -> str:
    value = row.ratio(name)
    if value is None:
        return MISSING
    return f"{value:.2f}" if value > 0.1 else f"1 : {1 / value:.0f}"


def latency_section(rounds: int) -> str:
    rows = speed.latency_rows(report, min(rounds, 15))
    stages = list(rows[0].stages)
    cells = [
        [row.case, *(f"{row.stages[s]:.1f}" for s in stages),
         *(f"{total:.0f}" for total in (row.best, row.median, row.processor))]
        for row in rows
    ]  # fmt: skip
    head = ["new Lagrangian", *stages, "total, best", "total, median", "processor time"]
    return f"## From a new Lagrangian to its first 1,000 steps, in milliseconds\n\n{table(head, cells)}"


def ensembles_section(rounds: int) -> str:
    rows = speed.ensemble_rows(report, min(rounds, 9))
    cells = [[r.case, str(r.members), f"{r.core[0]:.1f}", f"{r.core[1]:.1f}", f"{r.wall:.1f}"] for r in rows]
    head = ["ensemble", "members", "processor time, best", "median", "by the clock, best"]
    return f"## Ensembles of 100 steps, nanoseconds per trajectory-step\n\n{table(head, cells)}"


def effects_section(rounds: int) -> str:
    cells = [[row.case, f"{row.nanoseconds:.1f}"] for row in speed.effect_rows(report, rounds)]
    return f"## What each effect adds to a step\n\n{table(['run', 'ns'], cells)}"


def long_section(rounds: int) -> str:
    cells = [
        [f"disk, {r.case}", f"{r.steps:,}", f"{r.seconds:.2f}", f"{r.growth:.1f}", *(f"{x:.1e}" for x in r.worst)]
        for r in speed.long_rows(report)
    ]
    head = ["run", "steps", "s", "memory added, MB", "max energy error", "max constraint"]
    return f"## Long runs, energy and constraints observed at every step\n\n{table(head, cells)}"


def handwritten_section(rounds: int) -> str:
    row = handwritten_row(rounds)
    other = "there is no gcc here"
    if row.by_hand is not None and row.apart is not None:
        other = (
            f"{row.by_hand:.0f} ns for the C program (gcc -O3 -march=native) without compensated sums, so ours takes "
            f"{row.ours / row.by_hand:.2f} times as long; after 20,000 steps they are {row.apart:.1e} apart"
        )
    text = f"{row.ours:.0f} ns for a step of 17 stages ({row.unwatched:.0f} ns with guard = false), {other}."
    return f"## Stormer and Verlet of order 8 beside a program written by hand\n\nHenon and Heiles: {text}\n"


SECTIONS: dict[str, Callable[[int], str]] = {
    "routes": routes_section, "latency": latency_section, "ensembles": ensembles_section,
    "effects": effects_section, "long": long_section, "handwritten": handwritten_section,
}  # fmt: skip


def machine() -> str:
    packages = ("llvmlite", "symengine", "numba", "scipy", "heyoka")
    return f"Python {platform.python_version()}, {platform.machine()}, " + ", ".join(
        f"{name} {version(name)}" for name in packages
    )


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks simulation", description=__doc__)
    parser.add_argument("--part", choices=PARTS, action="append", help="only this part (may be repeated)")
    parser.add_argument("--rounds", type=int, default=speed.ROUNDS, help=f"alternating rounds (default {speed.ROUNDS})")
    parser.add_argument("--output", type=Path, help="a Markdown file to write")
    options = parser.parse_args(arguments)
    sections = [SECTIONS[part](options.rounds) for part in options.part or PARTS]
    _hand_out("\n".join([f"# Simulation: speed\n\n{machine()}\n\n{HOW}\n", *sections]), options.output)


def hard_cases_main(arguments: Sequence[str]) -> None:
    """Print every hard case with its outcome as a page; exit 1 if one is wrong."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks hard-cases")
    parser.add_argument("--long", action="store_true", help="with the cases of 10^7 steps")
    parser.add_argument("--output", type=Path, help="a Markdown file to write")
    options = parser.parse_args(arguments)
    judged = [judge(case) for case in all_cases() if options.long or not case.long]
    _hand_out(hard_cases_page(judged), options.output)
    if not all(one.right for one in judged):
        raise SystemExit(1)


def hard_cases_page(judged: Sequence[Judged]) -> str:
    right = sum(one.right for one in judged)
    text = [
        "# Hard cases", "",
        "Made by `python -m benchmarks hard-cases --long --output docs/records/hard-cases.md`.", "",
        "Each case must end in a right answer or in a typed outcome that names step, time, the quantity and a remedy.",
        "`error` is the greatest difference from the true motion, relative where a coordinate is beyond 1.", "",
        f"{right} of {len(judged)} cases end as they must.", "",
    ]  # fmt: skip
    for group in dict.fromkeys(one.case.group for one in judged):
        rows = [_judged_cells(one) for one in judged if one.case.group == group]
        head = ["case", "outcome", "error", "at step", "quantity", "value", "remedy"]
        text += [f"## {group[0].upper()}{group[1:]}", "", table(head, rows)]
    return "\n".join(text)


def _judged_cells(one: Judged) -> list[str]:
    outcome = one.trajectory.outcome
    kind = outcome.kind if one.right else f"{outcome.kind} (WRONG)"
    error = MISSING if one.error is None else f"{one.error:.1e}"
    if outcome.completed:
        return [one.case.name, kind, error, MISSING, MISSING, MISSING, MISSING]
    value = MISSING if outcome.value is None else f"{outcome.value:.3g}"
    quantity = (outcome.quantity or MISSING).replace("|", "\\|")
    remedy = (outcome.remedy or MISSING).replace("|", "\\|")
    return [one.case.name, kind, error, str(outcome.step), quantity, value, remedy]


def _hand_out(text: str, path: Path | None) -> None:
    if path is None:
        print(text)
    else:
        path.write_text(text.rstrip() + "\n", encoding="utf-8")
