"""Entries of the prolonged rows, many products of a term and an unknown at a time, compiled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from inverse_service.algebra.echelon import Words
from inverse_service.algebra.monomials import known_keys
from inverse_service.algebra.montgomery import compiled
from inverse_service.algebra.series import Series

Integers = npt.NDArray[np.int64]
Exponents = npt.NDArray[np.int8]
NO_DERIVATIVE = -1


@dataclass(frozen=True, slots=True)
class Term:
    """A summand of one equation: factor * series * g_ij, or factor * series * d_a g_ij, factor 1 or -1."""

    equation: int
    i: int
    j: int
    derivative: int
    series: Series
    negative: bool = False


@dataclass(frozen=True, slots=True)
class TermTable:
    """The terms of all equations of a kind.

    Series s has the Taylor coefficients starts[s] … starts[s + 1] - 1 (monomial keys, values, degrees);
    term t is equation, series, sign, v_i, v_j, d_a in the columns of `terms`, (terms, 6).
    """

    equations: int
    starts: Integers
    keys: Integers
    values: Words
    degrees: Integers
    terms: Integers


def term_table(terms: Sequence[Term], equations: int, size: int, first_velocity: int) -> TermTable:
    """The terms over `size` displacements, those of the velocities from `first_velocity` on."""
    key_of = known_keys(size)
    keys: list[int] = []
    values: list[int] = []
    degrees: list[int] = []
    starts, places = [0], dict[int, int]()
    rows = []
    for term in terms:
        if id(term.series) not in places:
            places[id(term.series)] = len(places)
            for degree, component in enumerate(term.series):
                for exponents, value in component.to_dict().items() if component else ():
                    keys.append(key_of[exponents])
                    values.append(int(value))
                    degrees.append(degree)
            starts.append(len(keys))
        first, second = first_velocity + term.i, first_velocity + term.j
        rows.append((term.equation, places[id(term.series)], term.negative, first, second, term.derivative))
    return TermTable(
        equations, np.array(starts, np.int64), np.array(keys, np.int64), np.array(values, np.uint64),
        np.array(degrees, np.int64), np.array(rows, np.int64).reshape(-1, 6),
    )


@dataclass(frozen=True, slots=True)
class Unknowns:
    """All unknown monomials in ascending degree; block d is starts[d] … starts[d + 1] - 1."""

    keys: Integers
    exponents: Exponents
    starts: Integers


@compiled
def _multiple(value: np.uint64, factor: np.int64, prime: np.uint64) -> np.uint64:
    """value * factor modulo the prime; the factor is at most a few dozen."""
    total = np.uint64(0)
    for _ in range(factor):
        total += value
        if total >= prime:
            total -= prime
    return total


@compiled
def emit(
    fill: bool, keys: Integers, exponents: Exponents, starts: Integers, series_starts: Integers, term_keys: Integers,
    term_values: Words, degrees: Integers, terms: Integers, degree: int,
    row_keys: Integers, row_order: Integers, bits: int, prime: np.uint64,
    counts: Integers, columns: Integers, values: Words,
) -> None:
    """Entries of term * (d_a) g_ij in the rows of one degree, for all terms; counted or filled in."""
    for t in range(len(terms)):
        vi, vj, da = terms[t, 3], terms[t, 4], terms[t, 5]
        first_row = terms[t, 0] * len(row_keys)
        for c in range(series_starts[terms[t, 1]], series_starts[terms[t, 1] + 1]):
            wanted = degree - degrees[c] + (1 if da >= 0 else 0)
            if degrees[c] > degree or wanted >= len(starts) - 1:
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
                place = np.searchsorted(row_keys, key + term_keys[c])
                if place >= len(row_keys) or row_keys[place] != key + term_keys[c]:
                    continue
                row = first_row + row_order[place]
                if fill:
                    value = prime - term_values[c] if terms[t, 2] else term_values[c]
                    columns[counts[row]] = m
                    values[counts[row]] = _multiple(value, factor, prime)
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
    """The coefficients of the monomials `row_keys` (all of one degree), equation after equation."""
    order = np.argsort(row_keys)
    counts = np.zeros(table.equations * len(row_keys) + 1, np.int64)
    terms = (table.starts, table.keys, table.values, table.degrees, table.terms)
    head = (unknowns.keys, unknowns.exponents, unknowns.starts, *terms, degree, row_keys[order], order, bits)
    modulus = np.uint64(prime)
    emit(False, *head, modulus, counts, np.empty(0, np.int64), np.empty(0, np.uint64))
    starts = np.concatenate([[0], np.cumsum(counts[:-1])]).astype(np.int64)
    columns, values = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.uint64)
    emit(True, *head, modulus, starts.copy(), columns, values)
    return Rows(starts, columns, values)
