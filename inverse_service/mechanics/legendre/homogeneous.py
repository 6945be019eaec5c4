"""Blocks of two velocities that are homogeneous of a degree d in them, such as Finsler functions.

With u = w/v and L = v^d g(u), the momenta are p_w = v^(d-1) g'(u) and p_v = v^(d-1) (d g - u g'): their quotient
F(u) = g'/(d g - u g') = p_w/p_v is an equation for u alone. Then v^(d-1) = p_w/g'(u), and by Euler's theorem
d L = p_v v + p_w w, H = (d - 1) (p_v + p_w u) v/d.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import ONE, ZERO, Expression, Number, Power, Product, Sum, Velocity, substitute
from inverse_service.mechanics.legendre.blocks import Block, Branch, Solver
from inverse_service.mechanics.legendre.isolation import isolate
from inverse_service.mechanics.legendre.scalar import roots_for
from inverse_service.mechanics.legendre.short_forms import simplified, velocities_in


@dataclass(frozen=True, slots=True)
class Ray:
    """d, and as functions of u, the velocity of `other`: g' and d g - u g'."""

    pivot: str
    other: str
    degree: Fraction
    above: Expression
    below: Expression


def rays(block: Block) -> Iterator[Ray]:
    """For each velocity as v; none where the block is not of this kind."""
    degree = homogeneous_degree(block.function, block.names) if len(block.names) == 2 else None
    if degree is None or degree in (0, 1):
        return
    for pivot, other in (block.names, block.names[::-1]):
        u = Velocity(other)
        along = simplified(substitute(block.function, {Velocity(pivot): ONE}))
        slope = simplified(differentiate(along, u))
        below = simplified(degree * along - u * slope)
        yield Ray(pivot, other, degree, slope, below)


def homogeneous_branches(block: Block, solve: Solver) -> Iterator[Branch]:
    """The branches, u and v found one after the other."""
    for ray in rays(block):
        u, v = Velocity(ray.other), Velocity(ray.pivot)
        p, q = block.momenta[ray.pivot], block.momenta[ray.other]
        equation = p * ray.above - q * ray.below
        for ratio in roots_for(equation, u, ZERO):
            value = simplified(ratio.value)
            raised = q / substitute(ray.above, {u: value})
            for length in isolate(v ** (ray.degree - 1), v, raised):
                rate = simplified(length.value)
                work = (p + q * value) * rate
                rates = {ray.pivot: rate, ray.other: simplified(value * rate)}
                yield Branch(
                    tuple(rates[name] for name in block.names),
                    simplified((ray.degree - 1) / ray.degree * work),
                    (*(substitute(c, {u: u / v}) for c in ratio.conditions), *length.conditions),
                )


def homogeneous_degree(tree: Expression, names: Sequence[str]) -> Fraction | None:
    """The degree in these velocities, None where the tree is not homogeneous in them."""
    match tree:
        case Velocity(name) if name in names:
            return Fraction(1)
        case Sum(terms):
            found = {homogeneous_degree(term, names) for term in terms}
            return found.pop() if len(found) == 1 else None
        case Product(factors):
            degrees = [homogeneous_degree(factor, names) for factor in factors]
            return None if None in degrees else sum((d for d in degrees if d), Fraction(0))
        case Power(base, Number(exponent)):
            inner = homogeneous_degree(base, names)
            return None if inner is None else inner * exponent
        case _:
            return None if velocities_in(tree, names) else Fraction(0)
