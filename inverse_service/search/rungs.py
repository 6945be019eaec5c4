"""The rungs of the search, by cost: leaves, reductions, and the rows of the ansatz."""

from __future__ import annotations

from inverse_service import bounds
from inverse_service.search import (
    families,
    linear_systems,
    one_coordinate,
    one_matrix,
    other_coordinates,
    reductions,
    row_factors,
)
from inverse_service.search.families import Family
from inverse_service.search.protocol import Leaf, Reduction

Rung = Leaf | Reduction | Family

LEAVES = (
    Leaf(
        "each equation times a function",
        0.1,
        lambda material: True,
        row_factors.propose,
        "Each equation times a function of `t` and the coordinates, the equations are self-adjoint: then the matrix of "
        "their accelerations is the Hessian of `L`, which follows by integration.",
        exact=True,
    ),
    Leaf(
        "one matrix",
        0.4,
        one_matrix.accepts,
        one_matrix.propose,
        "The algebraic conditions leave one matrix `G(t, q)` up to a factor, which is computed from them; the "
        "derivatives of the factor, of `A` and of `V` in `L = phi G_ij v^i v^j/2 + A_i v^i - V` follow from it.",
    ),
    Leaf(
        "linear systems, multipliers in t alone",
        1.5,
        linear_systems.is_linear,
        linear_systems.linear_lagrangians,
        "The system is linear: a `g` that depends on `t` alone has to solve `g' = g N + (g N)^T` and keep `g Phi` "
        "symmetric.",
    ),
    Leaf(
        "one coordinate, products of Darboux factors",
        6.5,
        one_coordinate.applies,
        one_coordinate.propose,
        "For one coordinate `g` has to solve `Gamma(g) + g df/dv = 0`; a product of factors that `Gamma` takes to "
        "multiples of themselves solves it, and `L` is `g` integrated twice by `v`.",
    ),
    Leaf(
        "one coordinate, a function of the velocity",
        9.5,
        lambda material: material.motion.size == 1,
        one_coordinate.propose_function_of_velocity,
        "`f = F(v) (G(t, x) - A(t) P - B(x) Q)` has the multiplier `phi/F`, where `P' = 1/F`, `Q' = v/F`, "
        "`phi_t = A phi` and `phi_x = B phi`; what is not elementary stays under integral signs.",
        exact=True,
    ),
)
REDUCTIONS = (
    Reduction(
        "other coordinates",
        3.5,
        other_coordinates.applies,
        other_coordinates.in_shorter_coordinates,
        "In other coordinates `f` is shorter; a Lagrangian found there is carried back.",
        exact=True,
    ),
    Reduction(
        "decoupled blocks one by one",
        3.55,
        reductions.is_decoupled,
        reductions.into_blocks,
        "The system decouples; the Lagrangian is the sum over the blocks.",
        exact=True,
    ),
)
ANSATZ = (
    Family("quadratic in the velocities, short factors", 2, families.quadratic, bounds.SMALL),
    Family("functions of velocities as in f, short factors", 3.74, families.as_in_force, bounds.SMALL),
    Family("functions of velocities, constant coefficients", 3.75, families.of_velocities, 0),
    Family("ratios of velocities, short factors", 3.7, families.ratios, bounds.SMALL),
    Family("quadratic, roots of constant velocities", 3.8, families.roots_of_constants, bounds.SMALL),
    Family("functions of velocities, short factors", 4, families.functions, bounds.SMALL),
    Family("products of up to four velocities", 7, families.polynomials, bounds.LARGE),
    Family("logarithms and arctangents of two velocities", 9, families.complex_logarithms, bounds.SMALL),
)
RUNGS: tuple[Rung, ...] = (*LEAVES, *ANSATZ, *REDUCTIONS)
REASONS = {rung.name: rung.reason for rung in (*LEAVES, *REDUCTIONS)}
