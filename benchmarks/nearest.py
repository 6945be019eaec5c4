"""How often the nearest systems are of the right kind: thirty known systems with noise on their
coefficients.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp

from benchmarks.variational_systems import SYSTEMS, Known, accelerations, terms_of, text_of
from inverse_service import solve
from inverse_service.service.documents import documents

Report = Callable[[str], None]
NOISES = (0.001, 0.01, 0.05)


@dataclass(frozen=True, slots=True)
class Row:
    """A fit of a known system: the kind that came first, its distance in errors and degrees, and
    whether it has no greater distance from the truth than the fit.

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
    seconds: float

    @property
    def is_right(self) -> bool:
        return self.first == self.kind


def fit_of(known: Known, noise: float, seed: int) -> tuple[dict[str, Any], dict[str, float]]:
    """A document with fitted numbers and their errors, and the true coefficients by name."""
    names, right, further = accelerations(known)
    random = np.random.default_rng(seed)
    equations, errors, truth = dict[str, str](), dict[str, str](), dict[str, float]()
    for name, f in zip(names, right, strict=True):
        table = terms_of(f)
        middle = float(sp.Rational(sorted(map(abs, table.values()))[len(table) // 2]))
        for term in further:
            table.setdefault(term, sp.Rational(0))
        parts = list[str]()
        for term, value in table.items():
            size = noise * (abs(float(value)) or middle)
            text = text_of(term, names)
            parts.append(
                f"({Fraction(float(value) + size * random.normal()).limit_denominator(10**7)})*({text})"
            )
            # Written as the program names it.
            key = coefficient_name(name, text, names)
            errors[key], truth[key] = f"{size:.6g}", float(value)
        equations[name] = " + ".join(parts)
    document = {"coordinates": names, "parameters": [], "equations": equations,
                "first_integrals": False, "nearest": {"errors": errors}}  # fmt: skip
    return document, truth


def coefficient_name(name: str, term: str, names: list[str]) -> str:
    """x'': x*y for a term in any order of its factors."""
    parsed = documents.parse_document(
        {"coordinates": names, "parameters": [], "equations": dict.fromkeys(names, term)}
    )
    return f"{name}'': {parsed['equations'][name]['text']}"


def measure(known: Known, noise: float, seed: int, limit: float) -> Row:
    document, truth = fit_of(known, noise, seed)
    begin = time.process_time()
    result = solve(document, time_limit=limit)
    seconds = time.process_time() - begin
    found = result["nearest"]
    errors = {name: float(text) for name, text in document["nearest"]["errors"].items()}
    none = {"kind": "none", "distance": np.inf, "degrees": 0, "chance": 0, "moved": {}}
    first: Any = found[0] if found else none
    moved = {name: float(Fraction(one["to"])) for name, one in first["moved"].items()}
    fitted = dict[str, float]()
    for part in found:
        fitted |= {name: float(Fraction(one["from"])) for name, one in part["moved"].items()}
    from_fit = from_member = 0.0
    for name, value in truth.items():
        old = fitted.get(name)
        if old is None:
            continue  # nothing moved it
        from_fit += ((old - value) / errors[name]) ** 2
        from_member += ((moved.get(name, old) - value) / errors[name]) ** 2
    return Row(
        known.name,
        len(truth),
        noise,
        known.kind,
        first["kind"],
        first["distance"],
        first["degrees"],
        first["chance"] or 0.0,
        from_fit**0.5,
        from_member**0.5,
        seconds,
    )


def known_systems(limit: float, report: Report, noises: tuple[float, ...] = NOISES) -> list[Row]:
    rows = list[Row]()
    for place, known in enumerate(SYSTEMS):
        for noise in noises:
            rows.append(measure(known, noise, 100 * place + int(1000 * noise), limit))
            row = rows[-1]
            report(f"{row.name}, {noise}: {row.kind} {row.first} {row.distance:.3g} / {row.degrees} "
                   f"truth {row.fit_to_truth:.3g} -> {row.member_to_truth:.3g} in {row.seconds:.1f} s")  # fmt: skip
    return rows


def table(rows: Sequence[Row]) -> str:
    """A line for each fit, in Markdown."""
    head = (
        "| system | coefficients | noise | kind | first found | chi-square / equations | "
        "fit to truth | nearest to truth | s |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    lines = (
        f"| {row.name} | {row.coefficients} | {100 * row.noise:g} % | {row.kind} | {row.first} | "
        f"{row.distance**2:.2f} / {row.degrees} | {row.fit_to_truth:.2f} | {row.member_to_truth:.2f} | {row.seconds:.1f} |\n"
        for row in rows
    )
    return head + "".join(lines)


if __name__ == "__main__":
    chosen = tuple(float(text) for text in sys.argv[1:]) or NOISES
    print(table(known_systems(60.0, lambda line: print(line, file=sys.stderr, flush=True), chosen)))
