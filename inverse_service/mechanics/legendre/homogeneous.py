"""Blocks of two velocities that are homogeneous of a degree d in them, such as Finsler functions.

With u = w/v and L = v^d g(u), the momenta are p_w = v^(d-1) g'(u) and p_v = v^(d-1) (d g - u g'): their quotient
F(u) = g'/(d g - u g') = p_w/p_v is an equation for u alone. Then v^(d-1) = p_w/g'(u), and by Euler's theorem
d L = p_v v + p_w w, H = (d - 1) (p_v + p_w u) v/d.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions import derivative
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.legendre import blocks, isolation, scalar, short_forms


@dataclass(frozen=True, slots=True)
class Ray:
    """d, and as functions of u, the velocity of `other`: g' and d g - u g'."""

    pivot: str
    other: str
    degree: Fraction
    above: ex.Expression
    below: ex.Expression


def rays(block: blocks.Block) -> Iterator[Ray]:
    """For each velocity as v; none where the block is not of this kind."""
    degree = homogeneous_degree(block.function, block.names) if len(block.names) == 2 else None
    if degree is None or degree in (0, 1):
        return
    for pivot, other in (block.names, block.names[::-1]):
        u = ex.Velocity(other)
        along = short_forms.simplified(ex.substitute(block.function, {ex.Velocity(pivot): ex.ONE}))
        slope = short_forms.simplified(derivative.differentiate(along, u))
        below = short_forms.simplified(degree * along - u * slope)
        yield Ray(pivot, other, degree, slope, below)


def homogeneous_branches(block: blocks.Block, solve: blocks.Solver) -> Iterator[blocks.Branch]:
    """The branches, u and v found one after the other."""
    for ray in rays(block):
        u, v = ex.Velocity(ray.other), ex.Velocity(ray.pivot)
        p, q = block.momenta[ray.pivot], block.momenta[ray.other]
        equation = p * ray.above - q * ray.below
        for ratio in scalar.roots_for(equation, u, ex.ZERO):
            value = short_forms.simplified(ratio.value)
            raised = q / ex.substitute(ray.above, {u: value})
            for length in isolation.isolate(v ** (ray.degree - 1), v, raised):
                rate = short_forms.simplified(length.value)
                work = (p + q * value) * rate
                rates = {ray.pivot: rate, ray.other: short_forms.simplified(value * rate)}
                yield blocks.Branch(
                    tuple(rates[name] for name in block.names),
                    short_forms.simplified((ray.degree - 1) / ray.degree * work),
                    (*(ex.substitute(c, {u: u / v}) for c in ratio.conditions), *length.conditions),
                )


def homogeneous_degree(tree: ex.Expression, names: Sequence[str]) -> Fraction | None:
    """The degree in these velocities, None where the tree is not homogeneous in them."""
    match tree:
        case ex.Velocity(name) if name in names:
            return Fraction(1)
        case ex.Sum(terms):
            found = {homogeneous_degree(term, names) for term in terms}
            return found.pop() if len(found) == 1 else None
        case ex.Product(factors):
            degrees = [homogeneous_degree(factor, names) for factor in factors]
            return None if None in degrees else sum((d for d in degrees if d), Fraction(0))
        case ex.Power(base, ex.Number(exponent)):
            inner = homogeneous_degree(base, names)
            return None if inner is None else inner * exponent
        case _:
            return None if short_forms.velocities_in(tree, names) else Fraction(0)
