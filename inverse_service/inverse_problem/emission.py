"""Entries of the prolonged rows, many products of a term and an unknown at a time, compiled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.echelon import Words
from inverse_service.algebra.monomials import MonomialKeys
from inverse_service.algebra.montgomery import compiled
from inverse_service.algebra.series import Series

Integers = npt.NDArray[np.int64]
Exponents = npt.NDArray[np.int8]
NO_DERIVATIVE = -1


@dataclass(frozen=True, slots=True)
class Term:
    """A summand series * g_ij, or series * d_a g_ij, of one equation."""

    i: int
    j: int
    derivative: int
    series: Series


@dataclass(frozen=True, slots=True)
class TermTable:
    """All Taylor coefficients of the terms of an equation: monomial keys, values, degrees, and v_i, v_j, d_a."""

    keys: Integers
    values: Words
    degrees: Integers
    first: Integers
    second: Integers
    derivatives: Integers


def term_table(terms: Sequence[Term], size: int, first_velocity: int) -> TermTable:
    """The terms over `size` displacements, those of the velocities from `first_velocity` on."""
    monomials = MonomialKeys(size)
    rows: list[tuple[int, int, int, int, int]] = []
    values: list[int] = []
    for term in terms:
        for degree, component in enumerate(term.series):
            for exponents, value in component.to_dict().items() if component else ():
                place = (first_velocity + term.i, first_velocity + term.j, term.derivative)
                rows.append((monomials.key(exponents), degree, *place))
                values.append(int(value))
    columns = np.array(rows, np.int64).reshape(-1, 5).T.copy()
    return TermTable(columns[0], np.array(values, np.uint64), columns[1], columns[2], columns[3], columns[4])


@dataclass(frozen=True, slots=True)
class Unknowns:
    """All unknown monomials in ascending degree; block d is starts[d] … starts[d + 1] - 1."""

    keys: Integers
    exponents: Exponents
    starts: Integers


@compiled
def emit(
    fill: bool, keys: Integers, exponents: Exponents, starts: Integers, term_keys: Integers, term_values: Words,
    degrees: Integers, first: Integers, second: Integers, derivatives: Integers, degree: int,
    row_keys: Integers, row_order: Integers, bits: int, prime: np.uint64,
    counts: Integers, columns: Integers, values: Words,
) -> None:
    """Entries of term * (d_a) g_ij in the rows of one degree, for all terms; counted or filled in."""
    for t in range(len(term_keys)):
        vi, vj, da = first[t], second[t], derivatives[t]
        wanted = degree - degrees[t] + (1 if da >= 0 else 0)
        if degrees[t] > degree or wanted >= len(starts) - 1:
            continue
        for m in range(starts[wanted], starts[wanted + 1]):
            ei = np.int64(exponents[m, vi])
            ej = np.int64(exponents[m, vj])
            factor = ei * (ej - 1) if vi == vj else ei * ej
            if factor <= 0:
                continue
            key = keys[m] - (np.int64(1) << (bits * vi)) - (np.int64(1) << (bits * vj))
            if da >= 0:
                ea = np.int64(exponents[m, da])
                if da == vi:
                    ea -= 1
                if da == vj:
                    ea -= 1
                if ea <= 0:
                    continue
                factor *= ea
                key -= np.int64(1) << (bits * da)
            place = np.searchsorted(row_keys, key + term_keys[t])
            if place >= len(row_keys) or row_keys[place] != key + term_keys[t]:
                continue
            row = row_order[place]
            if fill:
                columns[counts[row]] = m
                total = np.uint64(0)
                for _ in range(factor):  # factor is at most a few dozen
                    total += term_values[t]
                    if total >= prime:
                        total -= prime
                values[counts[row]] = total
            counts[row] += 1


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows in compressed form: starts, columns, values."""

    starts: Integers
    columns: Integers
    values: Words


def rows_of_degree(
    unknowns: Unknowns, table: TermTable, degree: int, row_keys: Integers, bits: int, prime: int
) -> Rows:
    """The coefficients of the monomials `row_keys` (all of one degree) of an equation."""
    order = np.argsort(row_keys)
    counts = np.zeros(len(row_keys) + 1, np.int64)
    terms = (table.keys, table.values, table.degrees, table.first, table.second, table.derivatives)
    head = (unknowns.keys, unknowns.exponents, unknowns.starts, *terms, degree, row_keys[order], order, bits)
    modulus = np.uint64(prime)
    emit(False, *head, modulus, counts, np.empty(0, np.int64), np.empty(0, np.uint64))
    starts = np.concatenate([[0], np.cumsum(counts[:-1])]).astype(np.int64)
    columns, values = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.uint64)
    emit(True, *head, modulus, starts.copy(), columns, values)
    return Rows(starts, columns, values)
