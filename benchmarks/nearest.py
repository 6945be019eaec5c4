"""How often the nearest systems are of the right kind, and their Lagrangians the true ones with
moved letters: thirty known systems with noise on their coefficients.

`python -m benchmarks.nearest [--write] [NOISE ...]` prints a row for each; `--write` puts the rows
of each noise into docs/records/nearest.md.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from benchmarks.known_letters import Letters, letters_of, member_of
from benchmarks.variational_systems import (
    SYSTEMS,
    Known,
    accelerations,
    parts_of,
    terms_of,
    text_of,
)
from inverse_service import solve
from inverse_service.service.documents import documents

Report = Callable[[str], None]
NOISES = (0.001, 0.01, 0.05)
RECORD = Path(__file__).parents[1] / "docs" / "records" / "nearest.md"


@dataclass(frozen=True, slots=True)
class Row:
    """A fit of a known system: the kind that came first, its distance in errors and degrees, the
    distances of the fit and of the first from the truth, and whether its L is the true one with
    other numbers.

    `seconds` of processor time.
    """

    name: str
    coefficients: int
    noise: float
    kind: str
    first: str
    distance: float
    degrees: int
    chance: float
    fit_to_truth: float
    member_to_truth: float
    letters: Letters
    seconds: float

    @property
    def is_right(self) -> bool:
        return self.first == self.kind


@dataclass(frozen=True, slots=True)
class Fit:
    """A document with fitted numbers and their errors; by name, the true and the fitted
    coefficients, and the equation and term of each.
    """

    document: dict[str, Any]
    truth: dict[str, float]
    fitted: dict[str, Fraction]
    terms: dict[str, tuple[int, Any]]


def fit_of(known: Known, noise: float, seed: int) -> Fit:
    """A fit of the known system with normal noise of a part of each coefficient."""
    names, right, further = accelerations(known)
    random = np.random.default_rng(seed)
    equations, errors, truth = dict[str, str](), dict[str, str](), dict[str, float]()
    fitted, terms = dict[str, Fraction](), dict[str, tuple[int, Any]]()
    for place, (name, f) in enumerate(zip(names, right, strict=True)):
        table = terms_of(f)
        middle = float(sp.Rational(sorted(map(abs, table.values()))[len(table) // 2]))
        for term in further:
            table.setdefault(term, sp.Rational(0))
        parts = list[str]()
        for term, value in table.items():
            size = noise * (abs(float(value)) or middle)
            text = text_of(term, names)
            number = Fraction(float(value) + size * random.normal()).limit_denominator(10**7)
            parts.append(f"({number})*({text})")
            # Written as the program names it.
            key = coefficient_name(name, text, names)
            errors[key], truth[key] = f"{size:.6g}", float(value)
            fitted[key], terms[key] = number, (place, term)
        equations[name] = " + ".join(parts)
    document = {"coordinates": names, "parameters": [], "equations": equations,
                "first_integrals": False, "nearest": {"errors": errors}}  # fmt: skip
    return Fit(document, truth, fitted, terms)


def coefficient_name(name: str, term: str, names: list[str]) -> str:
    """x'': x*y for a term in any order of its factors."""
    parsed = documents.parse_document(
        {"coordinates": names, "parameters": [], "equations": dict.fromkeys(names, term)}
    )
    return f"{name}'': {parsed['equations'][name]['text']}"


def measure(known: Known, noise: float, seed: int, limit: float) -> Row:
    fit = fit_of(known, noise, seed)
    begin = time.process_time()
    result = solve(fit.document, time_limit=limit)
    seconds = time.process_time() - begin
    errors = {name: float(text) for name, text in fit.document["nearest"]["errors"].items()}
    if not result["nearest"]:
        return Row(known.name, len(fit.truth), noise, known.kind, "none", np.inf, 0, 0.0, np.inf, np.inf,
                   Letters(False, np.inf), seconds)  # fmt: skip
    first: Any = result["nearest"][0]
    moved = fit.fitted | {name: Fraction(one["to"]) for name, one in first["moved"].items()}

    def to_truth(values: dict[str, Fraction]) -> float:
        away = ((float(values[name]) - value) / errors[name] for name, value in fit.truth.items())
        return float(np.linalg.norm(list(away)))

    parts = parts_of(known)
    member = member_of(fit.terms, moved, len(parts.names))
    return Row(
        known.name,
        len(fit.truth),
        noise,
        known.kind,
        first["kind"],
        first["distance"],
        first["degrees"],
        first["chance"] or 0.0,
        to_truth(fit.fitted),
        to_truth(moved),
        letters_of(parts, first["result"]["lagrangian"]["text"], member),
        seconds,
    )


def known_systems(limit: float, report: Report, noises: tuple[float, ...] = NOISES) -> list[Row]:
    rows = list[Row]()
    for place, known in enumerate(SYSTEMS):
        for noise in noises:
            rows.append(measure(known, noise, 100 * place + int(1000 * noise), limit))
            row = rows[-1]
            report(
                f"{row.name}, {noise}: {row.kind} {row.first} {row.distance:.3g} / {row.degrees} truth "
                f"{row.fit_to_truth:.3g} -> {row.member_to_truth:.3g} {row.letters} in {row.seconds:.1f} s"
            )
    return rows


def table(rows: Sequence[Row]) -> str:
    """A line for each fit, in Markdown."""
    head = (
        "| system | coefficients | kind | first found | chi-square / equations | fit to truth | "
        "nearest to truth | letters of L moved by | s |\n" + "| --- " * 9 + "|\n"
    )
    lines = (
        f"| {row.name} | {row.coefficients} | {row.kind} | {row.first} | "
        f"{row.distance**2:.1f} / {row.degrees} | {row.fit_to_truth:.2f} | {row.member_to_truth:.2f} | "
        f"{f'{100 * row.letters.moved:.2g} %' if row.letters.is_true else 'another L'} | {row.seconds:.1f} |\n"
        for row in rows
    )
    return head + "".join(lines)


def summary(rows: Sequence[Row]) -> str:
    """How many are right, in a sentence for one noise."""
    right = [row for row in rows if row.is_right]
    wrong = ", ".join(f"{row.name}: {row.first}" for row in rows if not row.is_right)
    true = [row for row in rows if row.letters.is_true]
    close = [row for row in true if row.letters.moved <= 5 * row.noise]
    nearer = [row for row in rows if row.member_to_truth <= row.fit_to_truth + 1e-3]
    return (
        f"The kind came first in {len(right)} of {len(rows)}{f' ({wrong})' if wrong else ''}. Its L has the form of\n"
        f"the true one in {len(true)}, and each number of it is within five times the noise in {len(close)}. It is\n"
        f"nearer to the truth than the fit, or as near, in {len(nearer)}.\n"
    )


def main() -> None:
    """Print the rows, or write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("noises", type=float, nargs="*", default=NOISES)
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    for noise in options.noises:
        rows = known_systems(60.0, lambda line: print(line, file=sys.stderr, flush=True), (noise,))
        part = f"\n{summary(rows)}\n{table(rows)}"
        print(part, flush=True)
        if options.write:
            RECORD.write_text(
                replaced(RECORD.read_text("utf-8"), f"{100 * noise:g} %", part), "utf-8"
            )


def replaced(text: str, name: str, part: str) -> str:
    """The text with another part between the marks of a name."""
    start, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    pattern = re.compile(f"{re.escape(start)}.*?{re.escape(end)}", re.DOTALL)
    return pattern.sub(lambda _: start + part + end, text)


if __name__ == "__main__":
    main()
