"""A fitted system: q'' = f(c; t, q, q') with numbers c that were estimated, and the metric of their
errors.

The distance of coefficients c from the fitted c0 is |c - c0| with |x|^2 = x C^-1 x, C the
covariance. Without one, the errors are taken as the sizes |c0_k|, so that the distance is a
relative change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from inverse_service import errors
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Floats = NDArray[np.float64]
MOST_COEFFICIENTS = 240


@dataclass(frozen=True, slots=True)
class Metric:
    """The covariance (m, m) of the coefficients, exact. `are_errors`: it was given, so that squares
    of distances are chi-squares.
    """

    covariance: tuple[tuple[Fraction, ...], ...]
    are_errors: bool

    @property
    def spread(self) -> Floats:
        """Standard errors, (m,)."""
        return np.sqrt([float(row[k]) for k, row in enumerate(self.covariance)])

    @property
    def root(self) -> Floats:
        """Lower triangular L with C = L L^T, (m, m)."""
        return np.linalg.cholesky(np.array(self.covariance, dtype=float))


@dataclass(frozen=True, slots=True)
class FittedSystem:
    """`system` holds the coefficients as parameters `letters`; `values` are the fitted ones,
    `names` what people call them.

    Where f is linear in them, f_i = fixed_i + sum_k c_k columns[k][i]; else `columns` is None.
    """

    system: SecondOrderSystem
    letters: tuple[str, ...]
    names: tuple[str, ...]
    values: tuple[Fraction, ...]
    metric: Metric
    fixed: tuple[ex.Expression, ...] = ()
    columns: tuple[tuple[ex.Expression, ...], ...] | None = None

    @property
    def fitted(self) -> Floats:
        return np.array(self.values, dtype=float)

    def distance(self, coefficients: Sequence[Fraction]) -> float:
        """|c - c0| in the metric, from exact differences."""
        change = np.array([a - b for a, b in zip(coefficients, self.values, strict=True)], float)
        return float(np.linalg.norm(np.linalg.solve(self.metric.root, change)))

    def member(self, coefficients: Sequence[Fraction]) -> SecondOrderSystem:
        """The system with these coefficients."""
        values: dict[ex.Expression, ex.Expression] = {
            ex.Symbol(letter): ex.number(value)
            for letter, value in zip(self.letters, coefficients, strict=True)
        }
        return second_order_system.with_values(self.system, values)


def rational_matrix(rows: Sequence[Sequence[Fraction]]) -> fmpq_mat:
    """A rational matrix of FLINT."""
    width = len(rows[0]) if rows else 0
    return fmpq_mat(
        len(rows),
        width,
        [fmpq(value.numerator, value.denominator) for row in rows for value in row],
    )


def fraction_of(value: fmpq) -> Fraction:
    return Fraction(int(value.p), int(value.q))


def term_name(coordinate: str, monomial: ex.Expression) -> str:
    """What people call the coefficient of a term in an equation, such as x'': x*y."""
    return f"{coordinate}'': {printing.to_text(monomial)}"


def of_letters(system: SecondOrderSystem, values: Mapping[str, Fraction]) -> FittedSystem:
    """The fitted system whose coefficients are all parameters of a system; the metric is relative."""
    letters = tuple(values)
    columns = _columns(system, letters)
    fixed: tuple[ex.Expression, ...] = ()
    if columns is not None:
        none = dict.fromkeys(map(ex.Symbol, letters), ex.ZERO)
        fixed = tuple(collecting.collect(ex.substitute(f, none)) for f in system.accelerations)
    found = tuple(values.values())
    return FittedSystem(
        system, letters, letters, found, relative(found, [0] * len(found)), fixed, columns
    )


def _columns(
    system: SecondOrderSystem, letters: Sequence[str]
) -> tuple[tuple[ex.Expression, ...], ...] | None:
    """df_i/dc_k for each k; None where one of them holds a coefficient."""
    names = [ex.Symbol(letter) for letter in letters]
    columns = tuple(
        tuple(collecting.collect(calculus.differentiate(f, name)) for f in system.accelerations)
        for name in names
    )
    return None if any(ex.holds(tree, *names) for column in columns for tree in column) else columns


def of_terms(
    system: SecondOrderSystem, library: Mapping[str, Sequence[ex.Expression]]
) -> FittedSystem:
    """The fitted system whose coefficients are the numbers in f, each before a term.

    `library` has, for each coordinate, terms that may be used besides those in f. InputError where
    an equation has none or there are too many.
    """
    table = dict[tuple[int, ex.Expression], Fraction]()
    for place, f in enumerate(system.accelerations):
        for monomial, value in collecting.expand(f):
            table[place, collecting.monomial_tree(monomial)] = value
        for tree in library.get(system.coordinates[place], ()):
            terms = collecting.expand(tree)
            if len(terms) != 1:
                shown = printing.to_text(tree)
                raise errors.InputError(
                    f"`{shown}` is no single term: name each term of the library by itself.",
                    "/nearest/library",
                )
            table.setdefault((place, collecting.monomial_tree(terms[0][0])), Fraction(0))
    if len(table) > MOST_COEFFICIENTS:
        raise errors.InputError(
            f"The system has {len(table)} coefficients, and at most {MOST_COEFFICIENTS} are "
            "compared: leave out terms of the library.",
            "/nearest/library",
        )
    keys = sorted(table, key=lambda key: key[0])
    used = {*system.coordinates, *system.parameters, "t"}
    stem = next(one for one in ("c", "k", "C", "coefficient_") if f"{one}1" not in used)
    letters = tuple(f"{stem}{number}" for number in range(1, len(keys) + 1))
    zero = (ex.ZERO,) * len(system.coordinates)
    columns = tuple((*zero[:place], tree, *zero[place + 1 :]) for place, tree in keys)
    forces = [
        ex.add(
            *(
                ex.Symbol(letter) * tree
                for letter, (place, tree) in zip(letters, keys, strict=True)
                if place == own
            )
        )
        for own in range(len(zero))
    ]
    values = tuple(table[key] for key in keys)
    general = second_order_system.system_of(
        system.coordinates, forces, (*system.parameters, *letters), system.functions
    )
    return FittedSystem(
        general,
        letters,
        tuple(term_name(system.coordinates[place], tree) for place, tree in keys),
        values,
        relative(values, [place for place, _ in keys]),
        zero,
        columns,
    )


def relative(values: Sequence[Fraction], places: Sequence[int]) -> Metric:
    """The sizes of the coefficients as their errors.

    A coefficient that is zero has the middle size of those that are not, in the same equation.
    """
    sizes = dict[int, list[Fraction]]()
    for value, place in zip(values, places, strict=True):
        if value:
            sizes.setdefault(place, []).append(abs(value))
    everywhere = sorted(size for each in sizes.values() for size in each) or [Fraction(1)]
    middle = {place: sorted(each)[len(each) // 2] for place, each in sizes.items()}
    usual = everywhere[len(everywhere) // 2]
    return diagonal(
        [
            abs(value) or middle.get(place, usual)
            for value, place in zip(values, places, strict=True)
        ],
        False,
    )


def diagonal(spread: Sequence[Fraction], are_errors: bool) -> Metric:
    """Independent coefficients with these standard errors."""
    size = len(spread)
    rows = [[Fraction(0)] * size for _ in spread]
    for k, value in enumerate(spread):
        rows[k][k] = value**2
    return Metric(tuple(map(tuple, rows)), are_errors)
