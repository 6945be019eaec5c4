"""Find multipliers that depend on the velocities: g = phi G with a unique matrix G(t, q, v) allowed
by the conditions.

If the conditions for Phi, nabla Phi, … at one velocity allow one matrix up to a factor, but those
at several velocities over one (t, q) allow none, G is interpolated in the velocities as well. With
phi = phi_2(t, q) prod P_a^(e_a), P_a factors of f, of G and of det G, (H1) is linear in the
exponents:

    sum over a of e_a (G_ik d_j log P_a - G_ij d_k log P_a) = d_k G_ij - d_j G_ik,  d_j = d/dv_j,

and random points modulo a prime determine them. phi_2 is computed as for a matrix free of the
velocities (`one_matrix`). The momenta of L have the slopes g_i1, …, g_in in the velocities, and L
has the momenta as its slopes, so two integrations of closed forms give L.
"""

from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations, product

import numpy as np

from inverse_service import bounds
from inverse_service.expressions import calculus, collecting, terms as tm, tree as ex
from inverse_service.field import exact_field, modular
from inverse_service.field.flow import PRIME, Flow, inverses
from inverse_service.mechanics import writing
from inverse_service.search import (
    antiderivatives,
    families,
    interpolation,
    material as mt,
    one_matrix,
)

_POINTS = 8


def propose(material: mt.Material, seed: int) -> list[ex.Expression]:
    """The Lagrangian with this multiplier, which the caller must verify; empty if none exists or
    none is found.
    """
    search = one_matrix.OneMatrix.at_one_velocity(material.analysis.system, seed)
    found = None if search is None else _lagrangian(search, material)
    return [] if found is None else [found]


def _lagrangian(search: one_matrix.OneMatrix, material: mt.Material) -> ex.Expression | None:
    """L from G: the factors prod P_a^(e_a), then phi_2, then two integrations over the velocities,
    then A and V.
    """
    variables = search.variables("motion")
    matrix = interpolation.Interpolation(search.matrix_values, variables, search.units).terms()
    factor = _moving_factor(search, material, matrix)
    if factor is None:
        return None
    integrator = antiderivatives.Integrator(search.system, material.analysis.real_point)
    shaped = search.oriented([tm.multiply_terms(terms, factor) for terms in matrix], integrator)
    scale = search.scale(shaped, [v for v in variables if not tm.has_velocity(v[1])], integrator)
    kinetic = (
        None
        if scale is None
        else _multiple_of_root(search, shaped, factor)
        or integrator.with_hessian([*map(integrator.in_normal_form, shaped)])
    )
    if scale is None or kinetic is None:
        return None
    found = families.with_potential(material, tm.multiply_terms(scale, kinetic))
    return tm.tree_of(found) if found else None


def _multiple_of_root(
    search: one_matrix.OneMatrix, matrix: Sequence[tm.Terms], factor: tm.Terms
) -> tm.Terms | None:
    """L = c(t, q) P^(1/2) if phi = P^(-3/2), as for sqrt(1 - v^2); integration would be long.

    c is the quotient of one entry of phi G by that of the Hessian of P^(1/2); None if it contains
    velocities.
    """
    names = search.system.coordinates
    ((powers, _),) = factor.items()
    rooted: tm.Monomial = frozenset(
        (p, Fraction(2)) for p, e in powers if isinstance(p, ex.Sum) and e.denominator > 1
    )
    if not rooted:
        return None
    root = tm.monomial_tree(tm.times(powers, rooted))
    (i, j), wanted = next(
        (pair, terms) for pair, terms in zip(search.pairs, matrix, strict=True) if terms
    )
    bend = calculus.differentiate(
        calculus.differentiate(root, ex.Velocity(names[i])), ex.Velocity(names[j])
    )
    if bend == ex.ZERO:
        return None
    ratio = writing.quotient(
        tm.tree_of(wanted) / bend, exact_field.Budget.long(), search.system.variables
    )
    return (
        None if tm.has_velocity(ratio) else tm.multiply_terms(tm.terms_of(ratio), tm.terms_of(root))
    )


def _determinant(search: one_matrix.OneMatrix, matrix: Sequence[tm.Terms]) -> ex.Expression:
    """det G; 0 for more than a few coordinates, or if it has too many terms."""
    if len(search.forces) > bounds.FEW:
        return ex.ZERO
    entry = {
        pair: tm.tree_of(terms)
        for (i, j), terms in zip(search.pairs, matrix, strict=True)
        for pair in ((i, j), (j, i))
    }
    places = range(len(search.forces))
    try:
        whole = collecting.determinant([[entry[i, j] for j in places] for i in places])
        return tm.tree_of(tm.terms_of(whole))
    except tm.TooManyTerms:
        return ex.ZERO


def _moving_factor(
    search: one_matrix.OneMatrix, material: mt.Material, matrix: Sequence[tm.Terms]
) -> tm.Terms | None:
    """prod P_a^(e_a) with the exponents that satisfy (H1); the P_a are velocities, and factors of
    f, of G and of det G. For L = sqrt(P), P quadratic in the velocities, P is one of det G alone.
    """
    trees = [tm.tree_of(terms) for terms in matrix]
    real_point = material.analysis.real_point
    sums = [
        p
        for tree in (*trees, _determinant(search, matrix))
        if tree != ex.ZERO
        for p in tm.irreducible_factors(tree)
        if tm.has_velocity(p)
    ]
    letters = [
        *material.motion.velocities,
        *mt.moving_letters(material),
        *(mt.positive_form(p, real_point) for p in sums),
    ]
    factors = list(dict.fromkeys([*letters, *filter(ex.is_exponential, material.velocity_letters)]))
    points = search.points({}, 4 * _POINTS)
    flow, n = Flow(points, search.forces, 1), len(search.forces)
    slopes = {}
    for tree in (*trees, *factors):
        data = flow.tree(tree).data
        slopes[tree] = (data[0, 0], data[1 + n :, 0])
    good = np.flatnonzero(points.good)[:_POINTS]
    place = {pair: trees[k] for k, pair in enumerate(search.pairs)}
    rows = []
    for i, (j, k) in product(range(n), combinations(range(n), 2)):
        (g, by_g), (h, by_h) = (slopes[place[min(i, m), max(i, m)]] for m in (k, j))
        known = (slopes[factor] for factor in factors)
        row = [
            (g * slope[j] - h * slope[k] % PRIME) % PRIME * inverses(value) % PRIME
            for value, slope in known
        ]
        rows.append([*row, (by_h[k] - by_g[j]) % PRIME])
    table = np.array(rows).transpose(0, 2, 1)[:, good].reshape(-1, len(factors) + 1)
    for vector in interpolation.null_basis(table):
        if vector[-1]:
            unit = -pow(vector[-1], -1, PRIME)
            found = [modular.reconstruct(value * unit % PRIME, PRIME, 99) for value in vector[:-1]]
            if None not in found:
                powers = zip(factors, found, strict=True)
                return tm.terms_of(
                    ex.multiply(*(p ** ex.number(e or Fraction(0)) for p, e in powers))
                )
    return None
