"""Blocks of one velocity: F(v) = dL/dv = p is solved where v occurs in F once, or as a short polynomial.

Covers c v^m, c (v + u)^r, v log v, log v, exponentials, quadratics and cubics in powers of v or exp(v).
"""

from __future__ import annotations

from collections.abc import Iterator

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    Expression,
    Velocity,
    add,
    multiply,
    negate,
    substitute,
    subtract,
)
from inverse_service.mechanics.legendre_blocks import Block
from inverse_service.mechanics.legendre_branch import Branch
from inverse_service.mechanics.legendre_forms import quotient, shortest, simplified
from inverse_service.mechanics.legendre_isolation import Root, isolate, occurrences
from inverse_service.mechanics.legendre_polynomial import polynomial_roots


def scalar_branches(block: Block) -> Iterator[Branch]:
    """All branches found of a block of one velocity."""
    if len(block.names) != 1:
        return
    name = block.names[0]
    rate, momentum = Velocity(name), block.momenta[name]
    for root in _roots(differentiate(block.function, rate), rate, momentum):
        velocity = simplified(root.value)
        value = substitute(block.function, {rate: velocity})
        yield Branch((velocity,), simplified(subtract(multiply(momentum, velocity), value)), root.conditions)


def _roots(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    collected = collect(slope)
    forms = [collected, slope, quotient(collected)]
    once = [form for form in forms if occurrences(form, rate) == 1]
    if once:
        yield from isolate(shortest(once), rate, momentum)
    else:
        yield from polynomial_roots(collected, rate, momentum)
        yield from _balanced(collected, rate, momentum)


def _balanced(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """F = p where the factored F - c has v once, c being the part of F without v."""
    terms = slope.terms if hasattr(slope, "terms") else (slope,)
    fixed = [term for term in terms if not occurrences(term, rate)]
    rest = quotient(add(*(term for term in terms if occurrences(term, rate))))
    if fixed and occurrences(rest, rate) == 1:
        yield from isolate(rest, rate, add(momentum, negate(add(*fixed))))
