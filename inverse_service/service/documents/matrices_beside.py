"""Matrices that a result states beside its Lagrangian: are they the derivatives that they claim to
be?
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import mpmath

from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import writing
from inverse_service.reading import names as nm, reader

Finding = Literal["holds", "wrong", "open"]
# Digits of a value, and how far from 0 it has to be.
_DIGITS_AT_A_POINT, _FAR_FROM_ZERO = 30, 1e-6


def multiplier(
    rows: Sequence[Sequence[str]], lagrangian: str, names: nm.Names, near: Mapping[str, str]
) -> Finding:
    """Whether the entries are d2L/dv_i dv_j."""
    tree = reader.read_formula(lagrangian, names)
    velocities = [ex.Velocity(name) for name in names.coordinates]
    if [len(row) for row in rows] != [len(velocities)] * len(velocities):
        return "wrong"
    slopes = [calculus.differentiate(tree, velocity) for velocity in velocities]
    differences = [
        calculus.differentiate(slope, velocity) - reader.read_formula(entry, names)
        for slope, row in zip(slopes, rows, strict=True)
        for velocity, entry in zip(velocities, row, strict=True)
    ]
    return _all_zero(differences, near)


def mass_matrix(
    energy: dict[str, Any], lagrangian: str, names: nm.Names, near: Mapping[str, str]
) -> Finding:
    """Whether H = p^T M^-1 p/2 + V, where M are the slopes of p = M v, and V is -L without
    velocities.
    """
    rows, momenta = energy["mass_matrix"], list(energy["momenta"])
    velocities = [ex.Velocity(name.removeprefix("p_")) for name in momenta]
    p = [reader.read_formula(energy["momenta"][name], names) for name in momenta]
    at_rest = dict.fromkeys(velocities, ex.ZERO)
    differences = [
        calculus.differentiate(tree, velocity) - reader.read_formula(entry, names)
        for tree, row in zip(p, rows, strict=True)
        for velocity, entry in zip(velocities, row, strict=True)
    ]
    differences += [ex.substitute(tree, at_rest) for tree in p]
    whole = ex.substitute(reader.read_formula(lagrangian, names), at_rest)
    differences.append(whole + reader.read_formula(energy["potential"]["text"], names))
    return _all_zero(differences, near)


def _all_zero(differences: Iterable[ex.Expression], near: Mapping[str, str]) -> Finding:
    """`near` is a point where all is defined, and the sides of roots are those of the formulas."""
    left = [tree for tree in map(collecting.collect, differences) if tree != ex.ZERO]
    if any(_is_surely_nonzero(tree, near) for tree in left):
        return "wrong"
    short = (writing.quotient(tree, exact_field.Budget.short()) for tree in left)
    return "holds" if all(tree == ex.ZERO for tree in short) else "open"


def _is_surely_nonzero(tree: ex.Expression, near: Mapping[str, str]) -> bool:
    """Whether a formula is far from zero at a point; False says nothing."""
    named = {node for node in ex.walk(tree) if isinstance(node, ex.Symbol | ex.Velocity)}
    point = dict[ex.Expression, Any]()
    try:
        with mpmath.workdps(_DIGITS_AT_A_POINT):
            for place, leaf in enumerate(sorted(named - {ex.PI}, key=repr)):
                value = near.get(printing.to_text(leaf), f"{place + 3}/7")
                point[leaf] = mpmath.mpf(value)
            return bool(abs(calculus.evaluate(tree, point)) > _FAR_FROM_ZERO)
    except calculus.NoRealValue:
        return False
