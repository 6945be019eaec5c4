"""Solvers for special kinds of systems, tried in their place on the ladder of families."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search import (
    constant_velocity,
    decoupled,
    other_coordinates,
    scalar_multiplier,
)
from inverse_service.inverse_problem.search.found import Ladder
from inverse_service.inverse_problem.search.holomorphic import (
    complex_logarithm_lagrangians,
    holomorphic_lagrangians,
    is_even,
    is_plural,
)
from inverse_service.inverse_problem.search.linear_systems.time_dependent import is_linear, linear_lagrangians
from inverse_service.inverse_problem.search.material import Material
from inverse_service.inverse_problem.search.one_coordinate import last_multiplier
from inverse_service.inverse_problem.search.uniform_damping import damped_lagrangians, is_damped


@dataclass(frozen=True, slots=True)
class Specialist:
    """A method for systems to which it applies.

    `propose(material, seed, ladder)` returns regular Lagrangians, the simplest first; none where it
    finds none; `ladder` searches for those of a smaller system. What is proposed is checked by the caller.
    `reason` is a sentence for people that says where such a Lagrangian comes from.
    """

    name: str
    cost: float
    applies: Callable[[Material], bool]
    propose: Callable[[Material, int, Ladder], Sequence[Expression]]
    reason: str = ""


def _alone(
    propose: Callable[[Material, int], Sequence[Expression]],
) -> Callable[[Material, int, Ladder], Sequence[Expression]]:
    """A method that needs no other search."""
    return lambda material, seed, ladder: propose(material, seed)


SPECIALISTS: tuple[Specialist, ...] = (
    Specialist(
        "one function times a constant matrix",
        0.5,
        lambda material: True,
        _alone(scalar_multiplier.propose),
        "The divergence of f is that of a multiplier g = phi(t, q) G with constant G: phi is an integral and G solves "
        "linear equations; then L = phi G_ij v_i v_j / 2 + A_i v_i - V, and A and V follow by integration.",
    ),
    Specialist(
        "linear systems, multipliers in t alone",
        1.5,
        is_linear,
        _alone(linear_lagrangians),
        "The system is linear: a g that depends on t alone has to solve g' = g N + (g N)^T and keep g Phi symmetric.",
    ),
    Specialist(
        "velocities carried by a constant one",
        2.5,
        constant_velocity.applies,
        _alone(constant_velocity.propose),
        "One velocity w' is constant and x'' = w' A x': then L = w'^2/2 + x'^T S(w) x'/(2 w') will do with S' = -S A.",
    ),
    Specialist(
        "velocities carried by a constant one, functions of its coordinate",
        2.6,
        constant_velocity.applies_with_functions,
        _alone(constant_velocity.propose),
        "One velocity w' is constant and x'' = w' W'(w) A x' in blocks: then L = w'^2/2 + x'^T S(W) x'/(2 w') will do "
        "with dS/dW = -S A.",
    ),
    Specialist(
        "real and imaginary parts of complex Lagrangians",
        3.6,
        is_even,
        holomorphic_lagrangians,
        "The system is one of fewer complex coordinates; part of a Lagrangian of that one is a Lagrangian of this.",
    ),
    Specialist(
        "decoupled blocks one by one",
        3.55,
        decoupled.applies,
        decoupled.propose,
        "The system falls apart into blocks; Lagrangians of the blocks are added up.",
    ),
    Specialist(
        "other coordinates",
        3.5,
        other_coordinates.applies,
        other_coordinates.propose,
        "In other coordinates f is shorter; a Lagrangian found there is carried back.",
    ),
    Specialist(
        "parts of z' log z', complex velocities",
        9.6,
        is_plural,
        _alone(complex_logarithm_lagrangians),
        "Two velocities are taken as one complex z'; the parts of z' log z' are completed by a potential.",
    ),
    Specialist(
        "uniform damping, e^(ct) L_0",
        1.8,
        is_damped,
        damped_lagrangians,
        "Without a common damping -c q' the system has a Lagrangian L_0; the factor e^(c t), for c(t) the exponential "
        "of its integral, brings the damping back.",
    ),
    Specialist(
        "one coordinate, products of Darboux factors",
        6.5,
        last_multiplier.applies,
        _alone(last_multiplier.propose),
        "For one coordinate g has to solve Gamma(g) + g df/dv = 0; a product of factors that Gamma takes to multiples "
        "of themselves solves it, and L is g integrated twice by v.",
    ),
)
REASONS = {specialist.name: specialist.reason for specialist in SPECIALISTS}
