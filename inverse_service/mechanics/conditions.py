"""The tensors N, Phi, nabla Phi, R (and higher ones) of a system as exact expressions for people."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from inverse_service.algebra.exact_atoms import exact_ring
from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.exact_trees import quotient_tree
from inverse_service.algebra.rational_functions import Budget, Quotient, TooLarge
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity
from inverse_service.mechanics.curvature import (
    Motion,
    connection,
    curvature,
    jacobi_endomorphism,
    nabla,
    nabla_of_curvature,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Matrix = tuple[tuple[Expression, ...], ...]

# What a reader can still use, and what a warm worker can spare beside the decision.
TERM_LIMIT = 4_000
TIME_LIMIT = 2.0


@dataclass(frozen=True, slots=True)
class Tensors:
    """N, Phi, nabla_Phi, R (R[j][k][l] = R^j_kl); None where `reason` says why it was left out.

    `higher` holds by name what was asked for beyond these: "nabla^2 Phi", "R[nabla Phi]" (n x n x n),
    "nabla R" (n x n x n).
    """

    N: Matrix | None
    Phi: Matrix | None
    nabla_Phi: Matrix | None
    R: tuple[Matrix, ...] | None
    reason: str = ""
    higher: tuple[tuple[str, Matrix | tuple[Matrix, ...]], ...] = ()


@dataclass(frozen=True, slots=True)
class ExactMotion:
    """The ring of a system's formulas, and its motion over that ring."""

    ring: ExactRing
    motion: Motion[Quotient]


def exact_motion(
    system: SecondOrderSystem,
    orders: int,
    budget: Budget,
    further: Sequence[Symbol] = (),
    trees: Sequence[Expression] = (),
) -> ExactMotion:
    """The system over an exact ring that allows `orders` derivations of f.

    The ring also holds the constants `further` and the formulas `trees`. Raises TooLarge
    (with the reason) and ZeroDivisionError, as the ring does.
    """
    coordinates = [Symbol(name) for name in system.coordinates]
    velocities = [Velocity(name) for name in system.coordinates]
    n = len(coordinates)
    ring = exact_ring([*system.accelerations, *trees], [TIME, *coordinates, *velocities], orders, budget, further)
    accelerations = tuple(ring.value(f) for f in system.accelerations)
    along = ring.along([ring.constant(1), *(ring.atoms[v] for v in velocities), *accelerations])
    partials = tuple(ring.partial(index) for index in range(1, 2 * n + 1))
    motion = Motion(accelerations, partials[:n], partials[n:], along, ring.constant(0))
    return ExactMotion(ring, motion)


def conditions(
    system: SecondOrderSystem, depth: int = 1, term_limit: int = TERM_LIMIT, time_limit: float = TIME_LIMIT
) -> Tensors:
    """N, Phi, nabla Phi and R by the definitions of `curvature`, with their derivatives to `depth`.

    depth 1 gives the four; depth d also nabla^k Phi for k <= d, R[nabla^k Phi] and nabla^k R for
    k < d. A tensor with an entry of more than `term_limit` terms, and all after it, is left out.
    """
    budget = Budget(term_limit, time.monotonic() + time_limit)
    found: dict[str, Matrix | tuple[Matrix, ...]] = {}
    reason = ""
    try:
        exact = exact_motion(system, depth + 2, budget)
        _derive(exact, depth, found)
    except TooLarge as error:
        reason = f"{_first_missing(found)} and what follows is left out: {error}"
    except ZeroDivisionError as error:
        reason = f"the equations cannot be differentiated: {error}"
    return _packed(found, reason)


_NAMES = ("N", "Phi", "nabla Phi", "R")


def _first_missing(found: dict[str, Matrix | tuple[Matrix, ...]]) -> str:
    return next((name for name in _NAMES if name not in found), "a higher tensor")


def _derive(exact: ExactMotion, depth: int, found: dict[str, Matrix | tuple[Matrix, ...]]) -> None:
    """Fill the table by name, in the order of cost."""
    motion = exact.motion
    n = connection(motion)
    found["N"] = matrix_trees(exact.ring, n)
    tensor = jacobi_endomorphism(motion)
    found["Phi"] = matrix_trees(exact.ring, tensor)
    endomorphisms, bend = [tensor], None
    for order in range(1, depth + 1):
        endomorphisms.append(nabla(motion, n, endomorphisms[-1]))
        found[power_name("nabla", order, "Phi")] = matrix_trees(exact.ring, endomorphisms[-1])
        bend = curvature(motion, tensor) if bend is None else nabla_of_curvature(motion, n, bend)
        found[power_name("nabla", order - 1, "R")] = tuple(matrix_trees(exact.ring, part) for part in bend)
        if order > 1:
            other = curvature(motion, endomorphisms[order - 1])
            name = f"R[{power_name('nabla', order - 1, 'Phi')}]"
            found[name] = tuple(matrix_trees(exact.ring, part) for part in other)


def power_name(operator: str, exponent: int, operand: str) -> str:
    """ "Phi", "nabla Phi", "nabla^2 Phi"."""
    if exponent == 0:
        return operand
    return f"{operator} {operand}" if exponent == 1 else f"{operator}^{exponent} {operand}"


def matrix_trees(ring: ExactRing, matrix: tuple[tuple[Quotient, ...], ...]) -> Matrix:
    """Each entry as a tree."""
    return tuple(tuple(quotient_tree(ring, entry) for entry in row) for row in matrix)


def _packed(found: dict[str, Matrix | tuple[Matrix, ...]], reason: str) -> Tensors:
    higher = tuple((name, tensor) for name, tensor in found.items() if name not in _NAMES)
    n, phi, nabla_phi = (cast("Matrix | None", found.get(name)) for name in _NAMES[:3])
    return Tensors(n, phi, nabla_phi, cast("tuple[Matrix, ...] | None", found.get("R")), reason, higher)
