"""Run a benchmark and print its tables; --output also writes them as Markdown and JSON files.

Without a first word it measures the decision. The first word selects another benchmark:
`lagrangians` the search for closed forms, `collection` the same on a list of documents, `ablation`
the parts of the search, `moves` how formulas are shortened, `costs` by which cost, `bounds` its
bounds, `service` the service under load, `simulation` the integrators, `peers` the cost of an error
in other programs, `hard-cases` the hard cases. `python -m benchmarks.walk` counts the files that
one question touches, `python -m benchmarks.against` compares with a revision, `python -m
benchmarks.steps_against` the steps of simulations.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import platform
import statistics
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import (
    ablation,
    bounds,
    collection,
    families,
    formula_costs,
    lagrangians,
    measured,
    move_counts,
    tables,
)
from benchmarks.cold_start import cold_starts
from benchmarks.decision_benchmark import comparisons, medians
from benchmarks.growth import against_order, against_size
from benchmarks.peers_benchmark import against_peers, summary
from inverse_service import catalogue

PARTS = ("decision", "peers", "size", "order", "cold")
Section = tuple[str, list[Any]]  # Markdown, rows


def report(line: str) -> None:
    """Print the name of the running measurement on standard error."""
    print(line, file=sys.stderr, flush=True)


def decision_section(options: argparse.Namespace) -> Section:
    found = comparisons(options.random, options.limit, report)
    rows = medians(found)
    head = "## The decision next to a plain SymPy pipeline"
    return f"{head}\n\n{tables.medians_table(rows)}\n{tables.comparison_table(found)}", [
        *rows,
        *found,
    ]


def peers_section(options: argparse.Namespace) -> Section:
    rows = against_peers(options.limit, report)
    head = "## The decision next to tools that complete PDE systems"
    return f"{head}\n\n{summary(rows)}\n{tables.peers_table(rows)}", list(rows)


def size_section(options: argparse.Namespace) -> Section:
    rows = against_size(options.largest, options.limit, report)
    return f"## Time and memory against n\n\n{tables.size_table(rows)}", list(rows)


def order_section(options: argparse.Namespace) -> Section:
    against_order(families.cubic_chain(2), 2, options.limit, report)  # loads the compiled kernels
    rows = []
    for n in range(1, min(options.largest, 6) + 1):
        rows += against_order(families.cubic_chain(n), options.order, options.limit / 4, report)
    return f"## Time against the order of prolongation\n\n{tables.order_table(rows)}", list(rows)


def cold_section(options: argparse.Namespace) -> Section:
    names = [
        name
        for name in catalogue.names()
        if options.all or catalogue.entry(name)["group"] == "paper"
    ]
    rows = cold_starts(names, options.limit, report)
    seconds = [row.processor for row in rows if row.processor is not None]
    middle = ""
    if seconds:
        middle = f"median {statistics.median(seconds):.2f} s, slowest {max(seconds):.2f} s of processor time\n\n"
    return (
        f"## `inverse-service solve` from a cold start\n\n{middle}{tables.cold_table(rows)}",
        list(rows),
    )


SECTIONS: dict[str, Callable[[argparse.Namespace], Section]] = {
    "decision": decision_section,
    "peers": peers_section,
    "size": size_section,
    "order": order_section,
    "cold": cold_section,
}


def options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--part", choices=PARTS, action="append", help="only this part (may be repeated)"
    )
    parser.add_argument(
        "--random", type=int, default=5, help="random systems of each kind for each n (default 5)"
    )
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds for one measurement (default 60)"
    )
    parser.add_argument("--largest", type=int, default=8, help="largest n (default 8)")
    parser.add_argument(
        "--order", type=int, default=5, help="highest order of prolongation (default 5)"
    )
    parser.add_argument("--all", action="store_true", help="cold starts for the whole catalogue")
    parser.add_argument("--output", type=Path, help="folder for benchmark.md and benchmark.json")
    return parser.parse_args(arguments)


def machine() -> str:
    """Describe the machine of the measurement without naming it."""
    return f"{measured.commit()}, Python {platform.python_version()}, {platform.machine()}, {os.cpu_count()} cores"


def main(arguments: Sequence[str] | None = None) -> None:
    chosen = options(arguments)
    sections = {part: SECTIONS[part](chosen) for part in chosen.part or PARTS}
    text = "\n".join(
        [f"# Benchmark\n\n{machine()}\n", *(markdown for markdown, _ in sections.values())]
    )
    print(text)
    if chosen.output:
        chosen.output.mkdir(parents=True, exist_ok=True)
        data = {
            part: [dataclasses.asdict(row) for row in rows] for part, (_, rows) in sections.items()
        }
        (chosen.output / "benchmark.md").write_text(text, encoding="utf-8")
        (chosen.output / "benchmark.json").write_text(json.dumps(data, indent=1), encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["ablation"]:
        ablation.main(sys.argv[2:])
    elif sys.argv[1:2] == ["bounds"]:
        bounds.main(sys.argv[2:])
    elif sys.argv[1:2] == ["lagrangians"]:
        lagrangians.main(sys.argv[2:])
    elif sys.argv[1:2] == ["moves"]:
        move_counts.main(sys.argv[2:])
    elif sys.argv[1:2] == ["costs"]:
        formula_costs.main(sys.argv[2:])
    elif sys.argv[1:2] == ["collection"]:
        collection.main(sys.argv[2:])
    elif sys.argv[1:2] == ["service"]:
        from benchmarks import service

        service.main(sys.argv[2:])
    elif sys.argv[1:2] == ["simulation"]:
        from benchmarks import simulation

        simulation.main(sys.argv[2:])
    elif sys.argv[1:2] == ["peers"]:
        from benchmarks import simulation_peers

        simulation_peers.main(sys.argv[2:])
    elif sys.argv[1:2] == ["size"]:
        from benchmarks import scene_sizes

        scene_sizes.main(sys.argv[2:])
    elif sys.argv[1:2] == ["hard-cases"]:
        from benchmarks import simulation

        simulation.hard_cases_main(sys.argv[2:])
    elif sys.argv[1:2] == ["cluster"]:
        from benchmarks import cluster_benchmark

        cluster_benchmark.main(sys.argv[2:])
    else:
        main()
