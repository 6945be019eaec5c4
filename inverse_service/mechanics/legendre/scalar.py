"""Blocks of one velocity: F(v) = dL/dv = p is solved where v occurs in F once, or as a short polynomial.

Covers c v^m, c (v + u)^r, v log v, log v, exponentials, quadratics and cubics in powers of v or exp(v).
"""

from __future__ import annotations

from collections.abc import Iterator

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    ZERO,
    Expression,
    Sum,
    Velocity,
    add,
    divide,
    multiply,
    negate,
    number,
    substitute,
    subtract,
)
from inverse_service.mechanics.legendre.blocks import Block
from inverse_service.mechanics.legendre.branch import Branch, Solver
from inverse_service.mechanics.legendre.forms import quotient, shortest, simplified
from inverse_service.mechanics.legendre.isolation import Root, isolate, occurrences
from inverse_service.mechanics.legendre.polynomial import laurent_polynomial, polynomial_roots

_MOST_TERMS = 4


def scalar_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """All branches found of a block of one velocity."""
    if len(block.names) != 1:
        return
    shift = _centre(block)
    if shift != ZERO:
        yield from _about(block, shift, solve)
    rate, momentum = Velocity(block.names[0]), block.momenta[block.names[0]]
    energies = list(_energies(block, rate))
    for root in roots_for(differentiate(block.function, rate), rate, momentum):
        velocity = simplified(root.value)
        forms = [simplified(substitute(energy, {rate: velocity})) for energy in energies]
        yield Branch((velocity,), shortest(forms), root.conditions)


def _centre(block: Block) -> Expression:
    """h = c_(m-1)/(m c_m) of a polynomial of degree m > 2: in v + h it has no term of degree m - 1."""
    laurent = laurent_polynomial(block.function, Velocity(block.names[0]))
    if laurent is None or laurent.generator != Velocity(block.names[0]):
        return ZERO
    exponents = sorted(laurent.coefficients)
    if exponents[0] < 0 or exponents[-1] < 3 or any(exponent.denominator != 1 for exponent in exponents):
        return ZERO
    top = exponents[-1]
    next_coefficient = laurent.coefficients.get(top - 1, ZERO)
    return simplified(divide(next_coefficient, multiply(number(top), laurent.coefficients[top])))


def _about(block: Block, shift: Expression, solve: Solver) -> Iterator[Branch]:
    """The branches in u = v + h: v = u - h and H = H_u - p h."""
    name = block.names[0]
    moved = substitute(block.function, {Velocity(name): subtract(Velocity(name), shift)})
    back: dict[Expression, Expression] = {Velocity(name): add(Velocity(name), shift)}
    for branch in solve(collect(moved), block.names, block.momenta):
        yield Branch(
            (simplified(subtract(branch.velocities[0], shift)),),
            simplified(subtract(branch.hamiltonian, multiply(block.momenta[name], shift))),
            tuple(substitute(condition, back) for condition in branch.conditions),
        )


def _energies(block: Block, rate: Velocity) -> Iterator[Expression]:
    """H in v, then p v - L with one term T of L written by p: T = (p - (L - T)') T/T'."""
    function, momentum = block.function, block.momenta[block.names[0]]
    yield simplified(subtract(multiply(rate, differentiate(function, rate)), function))
    yield subtract(multiply(momentum, rate), function)
    terms = function.terms if isinstance(function, Sum) else (function,)
    for place, term in enumerate(terms[:_MOST_TERMS]):
        others = add(*terms[:place], *terms[place + 1 :])
        ratio = quotient(divide(term, differentiate(term, rate)))
        rest = multiply(subtract(momentum, differentiate(others, rate)), ratio)
        yield subtract(multiply(momentum, rate), add(others, rest))


def roots_for(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """The solutions of slope = momentum for the velocity that are found in closed form."""
    collected = collect(slope)
    once = [form for form in (collected, slope, quotient(collected)) if occurrences(form, rate) == 1]
    if once:
        yield from isolate(shortest(once), rate, momentum)
        return
    yield from polynomial_roots(collected, rate, momentum)
    yield from _balanced(collected, rate, momentum)


def _balanced(slope: Expression, rate: Velocity, momentum: Expression) -> Iterator[Root]:
    """F = p where the factored F - c has v once, c being the part of F without v."""
    terms = slope.terms if isinstance(slope, Sum) else (slope,)
    fixed = [term for term in terms if not occurrences(term, rate)]
    rest = quotient(add(*(term for term in terms if occurrences(term, rate))))
    if fixed and occurrences(rest, rate) == 1:
        yield from isolate(rest, rate, add(momentum, negate(add(*fixed))))
