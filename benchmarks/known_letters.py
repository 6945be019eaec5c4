"""Whether a found Lagrangian is the true one with moved letters, by SymPy and numpy alone.

For L = e^s (v G v/2 + A v - V) the letters are the entries of G, the rates of s, and the numbers in
A and V. A found L is compared in two steps: it gives the motion of the member (Euler and Lagrange's
equations at random points), and its Hessian is e^s G with some G and s. Then G, A and V with this s
are looked for among the terms of the true ones, and those whose slopes are further terms of the
fit: the nearest to the true numbers that give the motion of the member. They are the found L up to
a number and total derivatives, where the motion determines its multiplier.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.variational_systems import Parts, sp, terms_of

Floats = NDArray[np.float64]
POINTS = 40
SMALL = 1e-8  # of the sizes of the terms that cancel


@dataclass(frozen=True, slots=True)
class Letters:
    """`is_true`: the found L gives the motion of the member, and is the true L with other numbers.
    `moved`: by how much the letter changed that changed most, in parts of the greatest of its sort
    (G, rates, numbers of A and V).
    """

    is_true: bool
    moved: float


def letters_of(parts: Parts, lagrangian: str, member: list[Any]) -> Letters:
    """The letters of a found L for the member q'' = f of expressions."""
    q, v, n = parts.positions, parts.velocities, len(parts.names)
    found = read(lagrangian, parts)
    own = [parts.time, *q, *v]
    points = np.random.default_rng(1).uniform(-1.3, 1.3, (POINTS, len(own)))
    if not _gives(found, parts, member, points):
        return Letters(False, np.inf)
    # The Hessian is e^s G: its logarithmic derivatives are numbers, and e^-s times it is constant.
    hessian = sp.hessian(found, v)
    matrices = values_of(list(hessian), own, points).reshape(n, n, POINTS)
    place = np.unravel_index(np.abs(matrices[..., 0]).argmax(), (n, n))
    logarithms = np.log(matrices[place] / matrices[place][0])
    away = points[:, : 1 + n] - points[0, : 1 + n]
    rates = np.linalg.lstsq(away, logarithms, rcond=None)[0]
    scaled = matrices / np.exp(points[:, : 1 + n] @ rates)
    if np.abs(scaled - scaled[..., :1]).max() > SMALL * np.abs(scaled).max():
        return Letters(False, np.inf)
    moved = _moved(parts, rates, member, points)
    if moved is None:
        return Letters(False, np.inf)
    true = np.array(parts.rates, dtype=float)
    return Letters(
        True, max(moved, float(np.abs(rates - true).max() / (np.abs(true).max() or 1.0)))
    )


def read(text: str, parts: Parts) -> Any:
    """A Lagrangian as results write it."""
    table = {name: f"v{k}" for k, name in enumerate(parts.names, 1)}
    plain = re.sub(r"\b([xyz])'", lambda match: table[match[1]], text).replace("^", "**")
    known = {str(one): one for one in (parts.time, *parts.positions, *parts.velocities)}
    return sp.sympify(plain, locals=known, rational=True)


def values_of(trees: list[Any], names: list[Any], points: Floats) -> Floats:
    """(trees, points)."""
    rows = sp.lambdify(names, trees, "numpy")(*points.T)
    return np.array([np.broadcast_to(row, len(points)) for row in rows], dtype=float)


def _gives(lagrangian: Any, parts: Parts, member: list[Any], points: Floats) -> bool:
    """Whether Euler and Lagrange's equations of L hold where q'' = f."""
    q, v = parts.positions, parts.velocities
    for position, rate in zip(q, v, strict=True):
        momentum = sp.diff(lagrangian, rate)
        terms = [sp.diff(momentum, other) * f for other, f in zip(v, member, strict=True)]
        terms += [sp.diff(momentum, other) * one for other, one in zip(q, v, strict=True)]
        terms += [sp.diff(momentum, parts.time), -sp.diff(lagrangian, position)]
        values = values_of(terms, [parts.time, *q, *v], points)
        if np.any(np.abs(values.sum(0)) > SMALL * np.abs(values).sum(0).max()):
            return False
    return True


def _moved(parts: Parts, rates: Floats, member: list[Any], points: Floats) -> float | None:
    """The greatest change of a number of G, A and V in parts of the greatest of G, or of A and V;
    None where no numbers give the motion.
    """
    time, q, v = parts.time, parts.positions, parts.velocities
    exponent = sum((float(a) * b for a, b in zip(rates, [time, *q], strict=True)), sp.S(0))
    # The letters: those of V, with terms whose slopes are those of the fit, and those of A.
    potentials = dict(terms_of(parts.potential)) | {sp.S(1): sp.S(0)}
    linear = {
        one * rate: value
        for a, rate in zip(parts.vector, v, strict=True)
        for one, value in terms_of(a).items()
    }
    for f in member:
        for term in [*terms_of(f), *parts.further]:
            rate = next((one for one in v if term.has(one)), sp.S(1))
            plain = term / rate
            if plain.has(*v):
                continue
            table = potentials if rate == 1 else linear
            for one in (plain, *(sp.integrate(plain, position) for position in q)):
                for each in terms_of(one):
                    table.setdefault(each * rate, sp.S(0))
    entries = list(itertools.combinations_with_replacement(range(len(q)), 2))
    kinetic = [v[i] * v[j] / (1 + int(i == j)) for i, j in entries]
    columns = [*kinetic, *(-one for one in potentials), *linear]
    masses = [parts.matrix[place] for place in entries]
    truth = np.array([*masses, *potentials.values(), *linear.values()], dtype=float)
    # d/dt dL/dv_i - dL/dq_i = 0 with q'' = f, divided by e^s: linear in the letters.
    names = [time, *q, *v]

    def left(inner: Any) -> list[Any]:
        found = list[Any]()
        drift = sp.diff(exponent, time) + sum(
            sp.diff(exponent, a) * b for a, b in zip(q, v, strict=True)
        )
        for position, rate in zip(q, v, strict=True):
            p = sp.diff(inner, rate)
            along = sp.diff(p, time) + sum(sp.diff(p, a) * b for a, b in zip(q, v, strict=True))
            along += sum(sp.diff(p, a) * f for a, f in zip(v, member, strict=True))
            found.append(
                along + drift * p - sp.diff(inner, position) - sp.diff(exponent, position) * inner
            )
        return found

    slopes = np.array([values_of(left(one), names, points).ravel() for one in columns]).T
    change = -np.linalg.lstsq(slopes, slopes @ truth, rcond=1e-10)[0]
    found = truth + change
    if np.abs(slopes @ found).max() > 1e-6 * np.abs(slopes * found).sum(1).max():
        return None
    count = len(entries)
    sizes = [np.abs(part).max(initial=0.0) for part in (truth[:count], truth[count:])]
    moved = [np.abs(part).max(initial=0.0) for part in (change[:count], change[count:])]
    return float(max(a / (b or 1.0) for a, b in zip(moved, sizes, strict=True)))


def member_of(
    terms: Mapping[str, tuple[int, Any]], values: Mapping[str, Fraction], n: int
) -> list[Any]:
    """f of the coefficients by name."""
    found = [sp.S(0)] * n
    for name, (place, term) in terms.items():
        number = values[name]
        found[place] += sp.Rational(number.numerator, number.denominator) * term
    return found
