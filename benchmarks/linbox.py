"""Compare one elimination of the decision with LinBox: the same rows in SMS format, both ranks,
both processor times.

    python -m benchmarks.linbox [--order 5] [--keep FILE.sms]

Needs g++, pkg-config and Debian's liblinbox-dev, libntl-dev, libflint-dev, libiml-dev and
libfplll-dev.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.families import cubic_chain
from inverse_service.decision.deciding import HelmholtzAt, analyze
from inverse_service.linear_pde.equations import (
    LocalEquations,
    advance,
    rows_of_degree,
    start,
    width_below,
)
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import PLAIN

SOURCE = Path(__file__).with_name("linbox_rank.cpp")
FLAGS = ["-O3", "-fopenmp", "-w"]


def local_equations(n: int, order: int) -> LocalEquations:
    """The conditions for the cubic chain at a random point."""
    document = cubic_chain(n)
    system = read_system(document["coordinates"], document["equations"])
    return HelmholtzAt(analyze(system), PLAIN).at(2, order)


def ours(local: LocalEquations, order: int) -> tuple[int, float]:
    """The rank of all rows up to the order and the processor time of writing and eliminating
    them.
    """
    began, prolongation = time.process_time(), start(local)
    for _ in range(order + 1):
        advance(prolongation)
    return int(prolongation.echelon.count), time.process_time() - began


def write_sms(local: LocalEquations, order: int, path: Path) -> tuple[int, int, int]:
    """All rows up to the order, low orders first; rows, columns, entries. Numbers are all times one
    unit (2^64).
    """
    width, number, entries = width_below(local.unknowns, order + 1), 0, 0
    body = []
    for step in range(order + 1):
        for block in local.equations:
            if step < block.order or not block.indices:
                continue
            rows = rows_of_degree(block.table, step - block.order, local.prime).struct
            for first, last in zip(
                rows.starts[:-1].tolist(), rows.starts[1:].tolist(), strict=True
            ):
                number += 1
                columns, places = np.unique(rows.columns[first:last], return_inverse=True)
                values = [0] * len(columns)
                for place, value in zip(
                    places.tolist(), rows.values[first:last].tolist(), strict=True
                ):
                    values[place] = (values[place] + value) % local.prime
                kept = [(c, v) for c, v in zip(columns.tolist(), values, strict=True) if v]
                entries += len(kept)
                body += [f"{number} {column + 1} {value}" for column, value in kept]
    path.write_text("\n".join([f"{number} {width} M", *body, "0 0 0", ""]), encoding="ascii")
    return number, width, entries


def theirs(path: Path, prime: int, folder: Path) -> tuple[int, float]:
    """Rank and processor time by LinBox."""
    program = folder / "rank"
    libraries = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "linbox"], check=True, capture_output=True, text=True
    )
    subprocess.run(
        ["g++", str(SOURCE), "-o", str(program), *FLAGS, *libraries.stdout.split()], check=True
    )
    answer = subprocess.run(
        [str(program), str(path), str(prime)], check=True, capture_output=True, text=True
    ).stdout
    rank, seconds = answer.split()[-2:]
    return int(rank), float(seconds)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--n", type=int, default=6)
    parser.add_argument("--order", type=int, default=5)
    parser.add_argument("--keep", type=Path)
    asked = parser.parse_args()
    local = local_equations(asked.n, asked.order)
    ours(local_equations(asked.n, 1), 1)  # compiles
    with tempfile.TemporaryDirectory() as folder:
        path = asked.keep or Path(folder) / "rows.sms"
        sizes = write_sms(local, asked.order, path)
        mine, other = ours(local, asked.order), theirs(path, local.prime, Path(folder))
    print(
        "| order | rows | columns | entries | rank, ours | rank, LinBox | ours, s | LinBox, s | ours/LinBox |"
    )
    print(f"|{' ---: |' * 9}")
    counts = (asked.order, *sizes, mine[0], other[0])
    print(
        f"| {' | '.join(f'{one:,}' for one in counts)} | {mine[1]:.3f} | {other[1]:.2f} "
        f"| {mine[1] / other[1]:.2f} |"
    )


if __name__ == "__main__":
    main()
