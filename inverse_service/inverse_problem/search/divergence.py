"""The factor e^(ct) of a multiplier from the divergence of f.

(H2) gives Gamma(log det g) = 2 tr N = -div_v f. For g = e^(ct) g_0 with det g_0 a product of letters,
    -div_v f = n c + sum_j e_j Gamma(log p_j),
which is solved for the rational e_j, and for c as a rational multiple of a parameter monomial, at random
points modulo a prime; the constants come last, so that they are used only where they are needed.
"""

from __future__ import annotations

from fractions import Fraction

from flint import nmod_mat

from inverse_service.algebra.kernels import to_kernels
from inverse_service.algebra.point import evaluate
from inverse_service.algebra.primes import reconstruct
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import draw_point
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import TIME, Apply, Expression
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.multiplier_ansatz import connection_and_endomorphism, tensors_of
from inverse_service.inverse_problem.search.sampling import Sampler, letter_table, make_sampler
from inverse_service.inverse_problem.search.terms import Monomial, monomial_tree, times

_BOUND = 1_000
_MOST_CONSTANTS = 8


def divergence_factor(material: Material, seed: int) -> Monomial | None:
    """exp(ct) with c not 0, or None where the divergence asks for none or is no such combination."""
    letters: list[Expression] = [
        *material.motion.velocities,
        *material.position_letters,
        *material.velocity_letters,
    ]
    constants = [monomial_tree(key) for key in material.parameter_monomials[:_MOST_CONSTANTS]]
    try:
        solution = _solve(material, letters, constants, seed)
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return None
    if solution is None:
        return None
    found = [(k, c / material.motion.size) for k, c in enumerate(solution[len(letters) :]) if c]
    if len(found) != 1:
        return None
    k, c = found[0]
    rate = times(material.parameter_monomials[k], frozenset([(TIME, Fraction(1))]))
    return frozenset([(Apply("exp", monomial_tree(rate)), c)])


def is_free_of_divergence(analysis: Analysis, seed: int) -> bool:
    """Whether div_v f vanishes at a random point."""
    try:
        point = draw_point(analysis.tower, seed)
        connection, _ = connection_and_endomorphism(Sampler(analysis, analysis.tower, analysis.real_point), point)
    except (IrreducibleAtoms, SingularPoint, ValueError):
        return False
    return sum(row[i] for i, row in enumerate(connection)) % point.prime == 0


def _solve(
    material: Material, letters: list[Expression], constants: list[Expression], seed: int
) -> list[Fraction] | None:
    sampler = make_sampler(material.analysis, [(p, Fraction(1)) for p in (*letters, *constants)])
    width = len(letters) + len(constants)
    table = letter_table(sampler, letters, width + 6, seed)
    rows = []
    places = zip(table.points, table.along.tolist(), tensors_of(sampler, table), strict=True)
    for point, along, (connection, _) in places:
        trace = 2 * sum(connection[i][i] for i in range(material.motion.size))
        rows.append([*along, *(evaluate(to_kernels(c), point) for c in constants), trace % table.prime])
    reduced, rank = nmod_mat(len(rows), width + 1, [x for row in rows for x in row], table.prime).rref()
    solution = [Fraction(0)] * width
    for i in range(rank):
        pivot = next(k for k in range(width + 1) if int(reduced[i, k]))
        value = reconstruct(int(reduced[i, width]), table.prime, _BOUND)
        if pivot == width or value is None:
            return None
        solution[pivot] = value
    return solution
