"""piecewise((a, x > 0), (b, true)) as one formula: Heaviside(u) is 1 where u > 0 and 0 where u < 0.

A condition is a formula with the values 1 and 0, made of such steps of polynomials. The value on a
boundary, where a polynomial is zero, is unspecified because answers hold on open sets.
"""

from collections.abc import Sequence

from inverse_service.expressions import collecting, printing, tree as ex
from inverse_service.expressions.functions import STEP
from inverse_service.expressions.refusals import fault

MOST_PIECES, MOST_BOUNDARIES = 8, 7


def step(u: ex.Expression, column: int) -> ex.Expression:
    """Heaviside(u) for a polynomial u; InputError for any other u, and for 0."""
    for node in ex.walk(u):
        exponent = node.exponent if isinstance(node, ex.Power) else ex.ONE
        natural = (
            isinstance(exponent, ex.Number)
            and exponent.value.denominator == 1
            and exponent.value > 0
        )
        if not natural or isinstance(node, ex.Apply | ex.Arbitrary | ex.Acceleration):
            raise fault("condition", column)
    u = collecting.collect(u)
    if u == ex.ZERO:
        raise fault("boundary", column)
    if isinstance(u, ex.Number):
        return ex.ONE if u.value > 0 else ex.ZERO
    other = collecting.collect(-u)
    shown, turned = printing.to_text(u), printing.to_text(other)
    if (len(turned), turned) < (len(shown), shown):
        return 1 - ex.Apply(STEP, other)
    return ex.Apply(STEP, u)


def either(left: ex.Expression, right: ex.Expression) -> ex.Expression:
    """The disjunction of two conditions."""
    return left + right - left * right


def piecewise(pieces: Sequence[tuple[ex.Expression, ex.Expression]], column: int) -> ex.Expression:
    """The first piece with a true condition; InputError if all conditions may be false."""
    if len(pieces) > MOST_PIECES:
        raise fault("pieces", column, count=len(pieces), most=MOST_PIECES)
    left: ex.Expression = ex.ONE  # 1 where all conditions so far are false
    terms = []
    for value, condition in pieces:
        terms.append(value * _multilinear(condition * left))
        left = _multilinear(left * (1 - condition))
    steps = dict.fromkeys(
        node for _, condition in pieces for node in ex.walk(condition) if isinstance(node, ex.Apply)
    )
    if len(steps) > MOST_BOUNDARIES:
        raise fault(
            "boundaries", column, count=len(steps), most=MOST_BOUNDARIES, cases=MOST_BOUNDARIES + 1
        )
    if (
        left != ex.ZERO
    ):  # a formula multilinear in its steps is zero only if it is zero for all their values
        raise fault("no last piece", column)
    return ex.add(*terms)


def _multilinear(condition: ex.Expression) -> ex.Expression:
    """The condition expanded, with H for the powers of a step H."""
    found = collecting.collect(condition)
    powers = [
        node
        for node in ex.walk(found)
        if isinstance(node, ex.Power) and isinstance(node.base, ex.Apply)
    ]
    return collecting.collect(ex.substitute(found, {node: node.base for node in powers}))
