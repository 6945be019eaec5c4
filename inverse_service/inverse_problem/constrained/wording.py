"""What was found about a motion on constraints, in words."""

from __future__ import annotations

from itertools import pairwise
from math import comb

from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.constrained.deciding import AnalysedMotion
from inverse_service.inverse_problem.constrained.lagrangian import JetOnConstraints
from inverse_service.inverse_problem.explanation.wording import said, separated
from inverse_service.inverse_problem.outcome import Step
from inverse_service.linear_pde.deciding import Finding

_QUESTION = {False: "L(q, q')", True: "L(t, q, q')"}


def finding_steps(analysed: AnalysedMotion, found: Finding, with_time: bool) -> tuple[Step, ...]:
    """What is asked, and why the answer is what it is."""
    k = len(analysed.motion.free)
    steps = [
        said(
            f"A regular {_QUESTION[with_time]} has this motion on the constraints exactly if `l` and `lambda_a`, in "
            "`L = l + lambda_a mu^a + ...` along the constraints, make its Euler-Lagrange expressions vanish there, a "
            f"linear system. The second derivatives of `l` by the free velocities and the first of `lambda_a` must "
            f"have rank {k} together."
        )
    ]
    if found.exists is False:
        steps += _bivector_steps(found)
        alone = "At a point, by power series along one solution"
        how = f"Prolonged to order {found.order}" if found.along is None else alone
        steps.append(
            said(
                f"{how}, {len(found.rows)} equations leave a rank below {k} in every solution: no associated system is "
                "variational.",
                about=("prolonged", "associated") if found.along is None else ("associated",),
            )
        )
    elif found.symbol is not None:
        steps.append(
            said(
                f"Prolonged to order {found.order} the system is involutive at degree {found.degree}, with solutions "
                f"of rank {found.ranks[0]}; the derivatives of l alone have rank {found.ranks[1]}. "
                "So there is such a Lagrangian near the generic point.",
                about=("prolonged", "involutive"),
            )
        )
    return tuple(steps)


def _bivector_steps(found: Finding) -> list[Step]:
    """Why the equations of the bivectors hold, where the proof uses them."""
    rows = [row for row in found.rows if str(row[0]).startswith("B")]
    orders = [int(str(name)[1:].partition("_")[0]) for name, *_ in rows]
    if not orders:
        return []
    # Without derivatives they are equations for the values of the 2-form, which are arbitrary but for these.
    alone = rows == list(found.rows) and not any(any(row[-1]) for row in rows if isinstance(row[-1], tuple))
    return [
        said(
            "The 2-form of such a Lagrangian vanishes on the Lie derivatives along the motion of the bivectors of the "
            f"free velocities: equations of first order, of which {len(orders)} are used, to order {max(orders)}."
            f"{' Each 2-form that does has a vertical vector in its kernel.' * alone}"
        )
    ]


def lagrangian_steps(lagrangian: Expression, jet: JetOnConstraints) -> tuple[Step, ...]:
    """L and its 1-jet along the constraints."""
    momenta = [row(f"lambda_{k} = ", tree) for k, tree in enumerate(jet.transverse_momenta, 1)]
    return (
        said("A Lagrangian, found by an ansatz or known for an associated system: ", shown=[row("L = ", lagrangian)]),
        said("Along the constraints it is ", row("l = ", jet.on_constraints), *separated(["", *momenta]), "."),
    )


def open_reason(found: Finding) -> str:
    """How far the decision came."""
    if not found.history:
        return found.reason
    dimensions = ", ".join(map(str, found.history[-1][:3]))
    return (
        f"{found.reason}: at order {found.order} rank {found.ranks[0] if found.ranks else 'unknown'} is possible, "
        f"dimensions {dimensions} in degrees 0, 1, 2"
    )


def freedom(found: Finding, n: int, with_time: bool) -> str:
    """On how many functions of how many variables L along the constraints depends, total derivatives not counted.

    The dimension of the symbol in degree d + j is sum alpha_k C(k - 1 + j, k - 1); `_gauge` says what F takes away.
    """
    if found.symbol is None:
        return ""
    characters, degree, variables = found.symbol.characters, found.degree, n + with_time

    def size(j: int) -> int:
        total = sum(a * comb(k - 1 + j, k - 1) for k, a in enumerate(characters, 1))
        return total - _gauge(degree + j, variables) + _gauge(degree + j - 1, variables)

    values, power, leading = [size(j) for j in range(len(characters) + 1)], -1, 0
    while any(values):
        power, leading = power + 1, values[0]
        values = [b - a for a, b in pairwise(values)]
    if power < 0:
        constants = found.history[found.order][degree] - _gauge(degree, variables)
        return f"{constants} constant{'s' * (constants != 1)}"
    return f"{leading} function{'s' * (leading != 1)} of {power + 1} variable{'s' * (power > 0)}"


def _gauge(degree: int, variables: int) -> int:
    """The dimension of l = Gamma(F), lambda_a = dF/ds^a, F of so many variables, in unknowns up to a degree.

    Those of F of degree up to d + 1, but for F = 1, and the derivatives along Gamma, in l, of those of degree d + 2.
    """
    return comb(variables + degree + 1, variables) - 1 + comb(variables + degree, variables - 1)
