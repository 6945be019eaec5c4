"""Solvers for special kinds of systems, tried in their place on the ladder of families."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.search import (
    constant_velocity,
    decoupled,
    other_coordinates,
    parameters,
)
from inverse_service.inverse_problem.search.found import Ladder
from inverse_service.inverse_problem.search.holomorphic import (
    complex_logarithm_lagrangians,
    holomorphic_lagrangians,
    is_even,
    is_plural,
)
from inverse_service.inverse_problem.search.linear_systems.autonomous import (
    is_autonomous_and_linear,
    separate_lagrangians,
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
    """

    name: str
    cost: float
    applies: Callable[[Material], bool]
    propose: Callable[[Material, int, Ladder], Sequence[Expression]]


def _alone(
    propose: Callable[[Material, int], Sequence[Expression]],
) -> Callable[[Material, int, Ladder], Sequence[Expression]]:
    """A method that needs no other search."""
    return lambda material, seed, ladder: propose(material, seed)


SPECIALISTS: tuple[Specialist, ...] = (
    Specialist("linear systems, multipliers in t alone", 1.5, is_linear, _alone(linear_lagrangians)),
    Specialist("linear systems, separate coordinates", 6.6, is_autonomous_and_linear, _alone(separate_lagrangians)),
    Specialist(
        "velocities carried by a constant one", 2.5, constant_velocity.applies, _alone(constant_velocity.propose)
    ),
    Specialist("real and imaginary parts of complex Lagrangians", 3.6, is_even, holomorphic_lagrangians),
    Specialist("decoupled blocks one by one", 3.7, decoupled.applies, decoupled.propose),
    Specialist("symbolic parameters by interpolation", 4.5, parameters.applies, parameters.propose),
    Specialist("other coordinates", 3.5, other_coordinates.applies, other_coordinates.propose),
    Specialist("parts of z' log z', complex velocities", 9.6, is_plural, _alone(complex_logarithm_lagrangians)),
    Specialist("uniform damping, e^(ct) L_0", 1.8, is_damped, damped_lagrangians),
    Specialist(
        "one coordinate, products of Darboux factors", 6.5, last_multiplier.applies, _alone(last_multiplier.propose)
    ),
)
