"""What a Lagrangian in closed form would give besides, for a motion that has one without a formula.

Let F_1, …, F_k be integrals without t that determine the k free velocities. In (q, F) the motion is
q' = X(q, F), F' = 0, and the 2-form of L, l_u dr + lambda (ds - w_u dr) differentiated on the
constraints, is Omega = sum dF_a ^ P^a + G, with 1-forms P^a and a 2-form G in dq: no dF_a ^ dF_b,
since Omega vanishes on pairs of vertical vectors. The P^a are independent, because L has full rank.

Gamma in Omega is -dE. If the energy E is no function of F, it is a further integral. Otherwise
P^a(X) = dE/dF_a, and X annihilates and preserves G, which is closed in q. Where G = 0, dOmega = 0
makes the P^a closed in q: P^a = d f^a by quadratures, and (dE/dF_b) f^a - (dE/dF_a) f^b is
constant along the motion. If all of these are functions of F, too, the P^a are proportional, which
for k > 1 they are not; if dE = 0 the f^a are constant themselves. So there is a further integral
or such a G; and G = 0 where X has two components only.

If functions rho of position are integrals, as many as constraints, the constraints are their rates.
With coordinates r beside rho, l = L(r, rho, r', 0) has the equations of r for each rho, and l +
lambda rho' those of rho along the motion if Gamma(lambda) = dl/drho.
"""

from collections.abc import Sequence

from inverse_service.constrained import existence
from inverse_service.constrained.reduced import reduced_system, slopes_at_a_point
from inverse_service.decision.solutions import Step
from inverse_service.explanation.explaining import enumerated, said
from inverse_service.expressions.notation import row
from inverse_service.expressions.tree import (
    TIME,
    Expression,
    Symbol,
    Velocity,
    holds,
    substitute,
    walk,
)
from inverse_service.mechanics.second_order_system import ConstrainedMotion


def needed(motion: ConstrainedMotion, integrals: Sequence[Expression]) -> Step | None:
    """What a closed form would give, or would need; None if these integrals without t are not
    as many as the free velocities or do not determine them.

    The `integrals` are proven, and all that are known.
    """
    fixed = [one for one in integrals if not any(isinstance(x, Velocity) for x in walk(one))]
    fixed = [one for one in fixed if not holds(one, TIME)]
    if motion.dependent and len(fixed) == len(motion.dependent):
        places = enumerated([row(f"rho_{a} = ", tree) for a, tree in enumerate(fixed, 1)])
        return said(
            *places,
            " does not change along the motion, and the constraint is its rate"
            if len(fixed) == 1
            else " do not change along the motion, and the constraints are their rates",
            ". With coordinates `r` beside `rho` the given `L` is `l(r, rho, r')` on each level set, and `l + "
            "lambda_a rho_a'` is a Lagrangian of the motion if `lambda_a` changes at the rate `dl/drho_a`. No "
            "formula for such a function was found.",
        )
    on = [substitute(one, motion.on_constraints) for one in integrals if not holds(one, TIME)]
    if len(on) != len(motion.free) or len(on) < 2 or not _determine_velocities(motion, on):
        return None
    named = enumerated([row(f"F_{a} = ", tree) for a, tree in enumerate(on, 1)])
    others = [Symbol(name) for name in motion.dependent]
    closed = reduced_system(motion) is not None and not any(holds(tree, *others) for tree in on)
    if closed and len(motion.free) == 2:
        x, y = motion.free
        return said(
            *named,
            f" are constant along the motion and determine {x}' and {y}'. With a Lagrangian of {x} and {y} in "
            f"closed form, a quadrature would give a further integral without t, which is the general solution of "
            f"`d{y}/d{x} = {y}'/{x}'` for all values of F_1 and F_2. No such integral was found.",
        )
    listed = ", ".join(f"{name}'" for name in motion.free)
    return said(
        *named,
        f" are constant along the motion and determine {listed}, so that for each of their values the coordinates "
        "follow `q' = X(q)`. With a Lagrangian in closed form, quadratures would give a further integral without "
        "t, or for each of these values a closed 2-form of the coordinates that `X` preserves and annihilates. "
        "Neither was found.",
    )


def _determine_velocities(motion: ConstrainedMotion, trees: Sequence[Expression]) -> bool:
    """Whether the derivatives by the free velocities are independent, at a point modulo a prime."""
    free = list(map(Velocity, motion.free))
    slopes = slopes_at_a_point(trees, free, existence.variables_of(motion), 1)
    return slopes is not None and slopes.rank(slopes.rows) == len(free)
