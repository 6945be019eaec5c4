"""piecewise((a, x > 0), (b, true)) as one formula: Heaviside(u) is 1 where u > 0 and 0 where u < 0.

A condition is a formula with the values 1 and 0, made of such steps of polynomials. What holds on a boundary, where a
polynomial is zero, is not said: answers are about open sets.
"""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.refusals import refusal
from inverse_service.expressions.tree import (
    ONE,
    ZERO,
    Acceleration,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    add,
    substitute,
    walk,
)

MOST_PIECES, MOST_BOUNDARIES = 8, 7
STEP = "Heaviside"


def step(u: Expression, column: int) -> Expression:
    """Heaviside(u) for a polynomial u; InputError for another one."""
    for node in walk(u):
        root = isinstance(node, Power) and not (isinstance(node.exponent, Number) and _is_natural(node.exponent))
        if root or isinstance(node, Apply | Arbitrary | Acceleration):
            wanted = "polynomials of t, coordinates, velocities and parameters, as in x^2 + y^2 < 1"
            raise refusal("a condition is not an inequality of polynomials", column, f"compare {wanted}")
    u = collect(u)
    if isinstance(u, Number):
        return ONE if u.value > 0 else ZERO
    other = collect(-u)
    shown, turned = to_text(u), to_text(other)
    if (len(turned), turned) < (len(shown), shown):
        return 1 - Apply(STEP, other)
    return Apply(STEP, u)


def _is_natural(exponent: Number) -> bool:
    return exponent.value.denominator == 1 and exponent.value > 0


def either(left: Expression, right: Expression) -> Expression:
    """One of two conditions holds."""
    return left + right - left * right


def piecewise(pieces: Sequence[tuple[Expression, Expression]], column: int) -> Expression:
    """The value that stands with the first condition that holds; InputError where none may hold."""
    if len(pieces) > MOST_PIECES:
        raise refusal(f"piecewise has {len(pieces)} pieces", column, f"write at most {MOST_PIECES}")
    left: Expression = ONE  # 1 where no condition holds so far
    terms = []
    for value, condition in pieces:
        terms.append(value * _multilinear(condition * left))
        left = _multilinear(left * (1 - condition))
    steps = dict.fromkeys(node for _, condition in pieces for node in walk(condition) if isinstance(node, Apply))
    if len(steps) > MOST_BOUNDARIES:
        most = f"at most {MOST_BOUNDARIES}, which make {MOST_BOUNDARIES + 1} cases"
        raise refusal(f"piecewise compares {len(steps)} polynomials with 0", column, f"write {most}")
    if left != ZERO:  # multilinear in its steps, it is zero only if it is for all values of them
        raise refusal("piecewise has no value where none of its conditions holds", column, "end it with (b, true)")
    return add(*terms)


def _multilinear(condition: Expression) -> Expression:
    """The condition expanded, with H for the powers of a step H."""
    found = collect(condition)
    powers = [node for node in walk(found) if isinstance(node, Power) and isinstance(node.base, Apply)]
    return collect(substitute(found, {node: node.base for node in powers}))
