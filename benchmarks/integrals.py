"""How many first integrals are found, and proven to be all: the systems of a file whose number to
degree 4 in the velocities is known from the literature.

`python -m benchmarks.integrals [FILE]` prints a row for each. Its number counts the products of
integrals, 1 among them, up to the degree to which a certificate proves that there are no others.
Each certificate is checked once more, and with one product less and one more, as are numbers that
are too small or too large by one: these are false.
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

from inverse_service.certificate import checker
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents.documents import solve_document

FILE = Path("tests/corpus/integrals.ndjson")
HEAD = ("system", "degree", "number", "proven", "first integrals", "s")
_SEED = 87


@dataclass(frozen=True, slots=True)
class Row:
    """What is known and what was found, with the seconds of processor time.

    `proven` is the degree and the number of the proof, None if there is none; `forged` is the
    number of false claims made of it, `taken` of those that the checker takes for true.
    """

    name: str
    known: tuple[int, int]
    proven: tuple[int, int] | None
    integrals: tuple[str, ...]
    forged: int
    taken: int
    seconds: float

    @property
    def is_whole(self) -> bool:
        return self.proven == self.known


def systems(file: Path) -> Iterator[dict[str, Any]]:
    """The lines of the file with the number of integrals."""
    lines = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return (line for line in lines if "complete" in line)


def measure(line: Mapping[str, Any]) -> Row:
    """Solve a system with the limits of every user, and check what is proven."""
    began = time.process_time()
    found = solve_document(line["document"], SolveOptions())
    seconds, complete = time.process_time() - began, found["first_integrals_complete"]
    proven, false = None, list[dict[str, Any]]()
    if complete is not None and is_proven(complete["certificate"]):
        proven, false = (complete["degree"], complete["number"]), forged(complete["certificate"])
    degree, number = line["complete"]
    names = tuple(one["name"] for one in found["first_integrals"])
    name = line["id"].removeprefix("integrals ")
    taken = sum(map(is_proven, false))
    return Row(name, (degree, number), proven, names, len(false), taken, seconds)


def is_proven(certificate: Mapping[str, Any]) -> bool:
    return checker.check_certificate(certificate, seed=_SEED).verdict == "valid"


def forged(certificate: Mapping[str, Any]) -> list[dict[str, Any]]:
    """False claims: one integral more, one less, and numbers that are not those of the products."""
    products, number = certificate["products"], certificate["number"]
    claims = [(products[:-1], number - 1), ([*products, products[-1]], number + 1)]
    claims += [(products, number - 1), (products, number + 1)]
    return [
        {**certificate, "products": chosen, "number": count} for chosen, count in claims if count
    ]


def cells(row: Row) -> tuple[str, ...]:
    degree, number = row.known
    proven = "none"
    if row.proven is not None:
        proven = str(row.proven[1]) + f" to degree {row.proven[0]}" * (row.proven[0] != degree)
    listed = ", ".join(row.integrals) or "none"
    return (row.name, str(degree), str(number), proven, listed, f"{row.seconds:.2g}")


def summary(rows: Sequence[Row]) -> str:
    """What the table says."""
    whole, false = sum(row.is_whole for row in rows), sum(row.forged for row in rows)
    taken = sum(row.taken for row in rows)
    return (
        f"Of {len(rows)} systems, {whole} have the known number of integrals, proven and with "
        f"formulas for all. The longest takes {max(row.seconds for row in rows):.2g} s. "
        f"Of {false} false claims, the checker takes {taken} for true."
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.integrals", description=__doc__)
    parser.add_argument("file", nargs="?", type=Path, default=FILE)
    lines = list(systems(parser.parse_args(arguments).file))
    measure(lines[0])  # loads the compiled kernels
    rows = []
    for line in lines:
        rows.append(measure(line))
        print(" | ".join(cells(rows[-1])), file=sys.stderr, flush=True)
    table = [HEAD, ("---",) * len(HEAD), *map(cells, rows)]
    print("\n".join("| " + " | ".join(line) + " |" for line in table))
    print(f"\n{summary(rows)}")


if __name__ == "__main__":
    main()
