"""Measure what a scene costs against its size, next to SymPy with SciPy, heyoka, PyDy (links) and
REBOUND (bodies), each in a process of its own; a program that is not installed has no cells.

`python -m benchmarks size` writes the table of docs/records/simulation-size.md. A time is the
processor time of the whole process, imports and compiling included, with an empty store of machine
code. SymPy and SciPy are the twenty lines of `scene_by_sympy`, DOP853 with tolerances of 1e-12. The
error is the greatest distance from our positions at the end, ours is the one that the run
estimates.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.isolated import measure
from benchmarks.measured import conditions, put
from benchmarks.scene_families import FAMILIES
from benchmarks.tables import MISSING, table

SIZES = {"pendulum": (2, 3, 5, 10, 20, 40), "bodies": (3, 10, 30, 60), "FPUT": (16, 64, 256)}
PAGE = Path(__file__).parent.parent / "docs" / "records" / "simulation-size.md"
ROUTES = {
    "adaptive": "scene_by_us", "variational": "scene_by_us", "SymPy + SciPy": "scene_by_sympy",
    "heyoka": "scene_by_heyoka", "PyDy": "scene_by_pydy", "REBOUND": "scene_by_rebound",
}  # fmt: skip
PACKAGES = ("numpy", "llvmlite", "symengine", "sympy", "scipy", "heyoka", "pydy", "rebound")
Row = dict[str, Any]


def measured(
    family: str, size: int, limit: float, report: Callable[[str], None]
) -> dict[str, Row | str]:
    """For each route its row, or why it has none."""
    found: dict[str, Row | str] = {}
    for name, module in ROUTES.items():
        report(f"{family}, {size}: {name}")
        with tempfile.TemporaryDirectory() as folder:
            before = os.environ.get("INVERSE_SERVICE_CACHE")
            os.environ["INVERSE_SERVICE_CACHE"] = folder
            try:
                scene = FAMILIES[family](size) | {
                    "methods": [name if module == "scene_by_us" else "adaptive"]
                }
                found[name] = (
                    measure(f"benchmarks.peers.{module}", [], scene, limit) or f"> {limit:.0f} s"
                )
            except Exception as error:  # a peer that cannot do it
                found[name] = str(getattr(error, "stderr", error)).strip().splitlines()[-1][:80]
            finally:
                os.environ.pop("INVERSE_SERVICE_CACHE")
                if before is not None:
                    os.environ["INVERSE_SERVICE_CACHE"] = before
    return found


def _cell(row: Row | str, ours: Row | str) -> str:
    if isinstance(row, str):
        return row if row.startswith(">") else MISSING
    if row.get("outcome", "completed") != "completed":
        return f"{row['outcome'].replace('_', ' ')}, {row['seconds']:.1f} s"
    error = row.get("error")
    if error is None and not isinstance(ours, str):
        error = max(abs(a - b) for a, b in zip(row["end"], ours["end"], strict=True))
    return f"{row['seconds']:.1f} s, {row['run']:.2g} s, {error:.0e}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and write it into its page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks size", description=__doc__)
    parser.add_argument(
        "--limit",
        type=float,
        default=120.0,
        help="seconds of processor time for a run (default 120)",
    )
    parser.add_argument(
        "--family", choices=[*FAMILIES], action="append", help="only this one (may be repeated)"
    )
    parser.add_argument("--largest", type=int, default=256, help="only sizes up to this one")
    parser.add_argument(
        "--write", action="store_true", help="write the table into docs/records/simulation-size.md"
    )
    chosen = parser.parse_args(arguments)
    rows = []
    for family in chosen.family or FAMILIES:
        for size in (size for size in SIZES[family] if size <= chosen.largest):
            found = measured(
                family, size, chosen.limit, lambda line: print(line, file=sys.stderr, flush=True)
            )
            print(
                json.dumps({"family": family, "size": size, "found": found}),
                file=sys.stderr,
                flush=True,
            )
            rows.append(
                [f"{family} {size}", *(_cell(found[name], found["adaptive"]) for name in ROUTES)]
            )
    text = f"{conditions(*PACKAGES)}\n\n" + table(["scene", *ROUTES], rows)
    print(text)
    if chosen.write:
        put(PAGE, "table", text)
