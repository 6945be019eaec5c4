"""Whether a found Lagrangian is the true one with moved letters, by SymPy and numpy alone.

For L = e^s (v G v/2 + A v - V) the letters are the entries of G, the rates of s, and the numbers in A and V. A found L is
compared in two steps: it gives the motion of the member (Euler and Lagrange's equations at random points), and its
Hessian is e^s G with some G and s; then A and V are those terms of the true ones, and of the further terms of the fit,
whose motion with this G and s is nearest to the member's: their letters moved, and nothing is left.
"""

from __future__ import annotations

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
    """`is_true`: the found L gives the motion of the member, and is the true L with other numbers. `moved`: by how much
    the letter changed that changed most, in parts of the greatest of its sort (G, rates, numbers of A and V).
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
    matrix, true = scaled[..., 0], np.array(parts.matrix, dtype=float)
    matrix *= (matrix * true).sum() / (matrix * matrix).sum()
    numbers = _numbers(parts, matrix, rates, member, points)
    if numbers is None:
        return Letters(False, np.inf)
    true_rates = np.array(parts.rates, dtype=float)
    moved = [np.abs(matrix - true).max() / np.abs(true).max(), numbers]
    if true_rates.any():
        moved.append(np.abs(rates - true_rates).max() / np.abs(true_rates).max())
    else:
        moved.append(np.abs(rates).max())
    return Letters(True, float(max(moved)))


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


def _numbers(
    parts: Parts, matrix: Floats, rates: Floats, member: list[Any], points: Floats
) -> float | None:
    """The greatest change of a number of A and V in parts of the greatest one; None where no numbers give the motion."""
    time, q, v = parts.time, parts.positions, parts.velocities
    exponent = sum((float(a) * b for a, b in zip(rates, [time, *q], strict=True)), sp.S(0))
    kinetic = (
        sum(float(matrix[i, j]) * v[i] * v[j] for i in range(len(q)) for j in range(len(q))) / 2
    )
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
    columns = [-one for one in potentials] + [*linear]
    truth = np.array([*potentials.values(), *linear.values()], dtype=float)
    # m_i = d/dt dL/dv_i - dL/dq_i - s' = 0 with q'' = f, divided by e^s: linear in the letters.
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

    right = -values_of(left(kinetic), names, points).ravel()
    slopes = np.array([values_of(left(one), names, points).ravel() for one in columns]).T
    change = np.linalg.lstsq(slopes, right - slopes @ truth, rcond=1e-10)[0]
    rest = slopes @ (truth + change) - right
    if np.abs(rest).max() > 1e-6 * np.abs(slopes * (np.abs(truth) + 1)).sum(1).max(initial=1.0):
        return None
    return float(np.abs(change).max(initial=0.0) / np.abs(truth).max(initial=1e-300))


def member_of(
    terms: Mapping[str, tuple[int, Any]], values: Mapping[str, Fraction], n: int
) -> list[Any]:
    """f of the coefficients by name."""
    found = [sp.S(0)] * n
    for name, (place, term) in terms.items():
        number = values[name]
        found[place] += sp.Rational(number.numerator, number.denominator) * term
    return found
