"""Corrupt certificates so that their claims are false; the checker must never accept them.

Each corruption is false by construction: decision and checker confirmed the verdict of the system,
and the corrupted certificate claims another verdict, or another value of a unique number.
"""

from __future__ import annotations

import copy
import itertools
import random
from collections.abc import Callable, Iterator
from typing import Any

import sympy

from inverse_service.certificate.checker import check_certificate
from tests.generator import GeneratedSystem
from tests.generator.euler_lagrange import residual
from tests.generator.systems import text

Certificate = dict[str, Any]
Spoilt = tuple[str, Certificate]
TIME_LIMIT = 20.0


def corruptions(right: Certificate, other: Certificate, rng: random.Random) -> Iterator[Spoilt]:
    """Corrupted copies of a valid certificate; `other` is a valid one of the other verdict, in the
    same coordinates.
    """
    yield "claim turned round", _with(right, claim=_opposite(right["claim"]))
    yield (
        "the proof of another system",
        _with(other, system=right["system"], near=right.get("near"), series=None),
    )
    if right["kind"] == "nonexistence":
        yield "no rows", _with(right, rows=[])
        yield (
            "rows kept, order lowered",
            _with(right, order=0, rows=[row for row in right["rows"] if _degree(row) > 0]),
        )
        yield "a row twice", _with(right, rows=[*right["rows"], rng.choice(right["rows"])])
        yield (
            "an index out of range",
            _with(right, rows=[[kind, i, 9, alpha] for kind, i, _, alpha in right["rows"]]),
        )
    else:
        yield from _spoilt_numbers(right, rng)
        yield "every row of low order against it", _all_rows(right)
    if right.get("series"):
        yield "a series with g(p) = 0", _spoilt_series(right)


def spoilt_lagrangians(
    right: Certificate, system: GeneratedSystem, rng: random.Random
) -> Iterator[Spoilt]:
    """Certificates of kind lagrangian that are false: singular, another force, another
    coefficient.
    """
    head = {
        key: value
        for key, value in right.items()
        if key in ("format", "system", "question", "near")
    }
    head |= {"claim": "variational", "kind": "lagrangian"}
    good, q = system.lagrangian, rng.choice(system.coordinates)
    total = "+".join(f"{name}'" for name in system.coordinates)
    yield "a singular Lagrangian", head | {"lagrangian": f"({total})*{q}"}
    yield "a Lagrangian of nothing", head | {"lagrangian": "0"}
    yield "a force added", head | {"lagrangian": f"{good}+{rng.randint(2, 99)}*{q}"}
    yield "a spring added", head | {"lagrangian": f"{good}-({q}-{rng.randint(2, 9)})^2"}
    yield "claimed against", head | {"lagrangian": good, "claim": "not_variational"}
    terms = sympy.Add.make_args(sympy.expand(system.lagrangian_expression))
    altered = system.lagrangian_expression + rng.choice(
        (1, -2, sympy.Rational(1, 1000))
    ) * rng.choice(terms)
    if all(
        residual(altered, system.accelerations, system.space, seed)[0] > 1e-12 for seed in (1, 2)
    ):
        yield "a coefficient of the Lagrangian", head | {"lagrangian": text(altered)}


def found_valid(spoilt: Iterator[Spoilt]) -> tuple[dict[str, int], list[Spoilt]]:
    """How often the checker rejected (invalid) or could not judge (incomplete), and which ones it
    accepted.
    """
    counts: dict[str, int] = {}
    wrong = []
    for name, certificate in spoilt:
        verdict = check_certificate(certificate, time_limit=TIME_LIMIT).verdict
        counts[verdict] = counts.get(verdict, 0) + 1
        if verdict == "valid":
            wrong.append((name, certificate))
    return counts, wrong


def _opposite(claim: str) -> str:
    return "variational" if claim == "not_variational" else "not_variational"


def _with(certificate: Certificate, **changes: Any) -> Certificate:
    return copy.deepcopy(certificate) | changes


def _degree(row: list[Any]) -> int:
    return sum(row[3])


def _spoilt_numbers(right: Certificate, rng: random.Random) -> Iterator[Spoilt]:
    """Dimensions and characters are unique: any other number is false."""
    changes: tuple[tuple[str, Callable[[Certificate], None]], ...] = (
        ("a dimension", lambda c: _shift(c["dimensions"], rng)),
        ("the symbol's dimension", lambda c: _shift_key(c["symbol"], "dimension", rng)),
        ("the prolonged dimension", lambda c: _shift_key(c["symbol"], "prolonged", rng)),
        ("a character", lambda c: _shift(c["symbol"]["characters"], rng)),
        ("a dimension left out", lambda c: c["dimensions"].pop()),
    )
    for name, change in changes:
        spoilt = copy.deepcopy(right)
        change(spoilt)
        yield name, spoilt


def _shift(numbers: list[int], rng: random.Random) -> None:
    numbers[rng.randrange(len(numbers))] += rng.choice((-1, 1, 2))


def _shift_key(numbers: dict[str, int], key: str, rng: random.Random) -> None:
    numbers[key] += rng.choice((-1, 1, 2))


def _all_rows(right: Certificate, order: int = 2) -> Certificate:
    """A proof of nonexistence with all rows to an order, for a system that is variational."""
    n = len(right["system"]["coordinates"])
    size = 2 * n + (right["question"] == "time_dependent")
    rows: list[list[Any]] = []
    for kind, most in (("H2", order - 1), ("H3", order)):
        pairs = [(i, j) for i in range(n) for j in range(i, n) if kind == "H2" or i < j]
        indices = [
            list(a) for a in itertools.product(range(most + 1), repeat=size) if sum(a) <= most
        ]
        rows += [[kind, i, j, alpha] for i, j in pairs for alpha in indices]
    kept = {key: right[key] for key in ("format", "system", "question", "near") if key in right}
    return kept | {"claim": "not_variational", "kind": "nonexistence", "order": order, "rows": rows}


def _spoilt_series(right: Certificate) -> Certificate:
    """Without the coefficients of degree 0 in g, so that g(p) = 0 is singular."""
    spoilt = copy.deepcopy(right)
    spoilt["series"]["terms"] = [term for term in spoilt["series"]["terms"] if sum(term[0]) > 2]
    return spoilt
