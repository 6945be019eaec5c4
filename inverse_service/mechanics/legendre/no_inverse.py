"""A proof that p = dL/dv has no inverse in closed form: the group of an equation that it leads to is too large.

The families of this folder take a block to problems F(y) = p of one velocity whose solutions would follow from an
inverse of the whole. Where F is rational in a root of the velocity, `galois` decides.

Where dF/dy = R(y) is rational and F is not, F = r + sum_k c_k log(y - a_k), and y' = 1/R(y) for the derivative by p;
y is a root of v, an exponential or a logarithm, and log F = log p serves as well as F = p. Such a y is of these
formulas only where R = c z'/z for a rational z (Rosenlicht, Publ. Math. IHES 36, 1969; Singer, Pacific J. Math. 59,
1975): r is constant, and the residues c_k are rational multiples of one number. So r that is not constant is a proof,
and a quotient of the residues that is not the same at two points; both are seen modulo a prime.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from flint import nmod_mat, nmod_poly

from inverse_service import bounds
from inverse_service.algebra.elementary import to_kernels
from inverse_service.algebra.tower import draw_point
from inverse_service.algebra.truncated_series import SingularPoint
from inverse_service.deadline import now
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.collecting import expand
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    ZERO,
    Apply,
    Expression,
    Symbol,
    Velocity,
    substitute,
    walk,
)
from inverse_service.mechanics.euler_lagrange import momenta
from inverse_service.mechanics.legendre.blocks import Block, Branch, split
from inverse_service.mechanics.legendre.galois import FEW, Curve, Equation, NotAlgebraic, equation_of_root, generic
from inverse_service.mechanics.legendre.homogeneous import rays
from inverse_service.mechanics.legendre.linear import linear_branches, routh_branches
from inverse_service.mechanics.legendre.quadratic import form_matrix
from inverse_service.mechanics.legendre.radial import radial_branches, ratio_branches
from inverse_service.mechanics.legendre.scalar import LARGEST_BLOCK, last_equations
from inverse_service.mechanics.legendre.short_forms import quotient, simplified


@dataclass(frozen=True, slots=True)
class Integral:
    """What p = dL/dv leads to where F, or log F, is the integral of a rational function that is no c z'/z."""

    unsolvable = True
    reason = (
        "p = dL/dv has no inverse in closed form: for one velocity it leads to r(y) + c_1 log(y - a_1) + ... = p, "
        "where the left side is neither rational nor a multiple of the logarithm of a rational function, and no "
        "formula in radicals, exponentials, logarithms and integrals solves it (Rosenlicht)."
    )


def equation_of(blocks: Sequence[Block], seconds: float) -> Equation | Integral | None:
    """The first of a degree above 3 that is met, proofs before others; None where there is none that is known.

    A quadratic block has an inverse, and it is too long.
    """
    deadline, named = now() + seconds, None
    others = [block for block in blocks if form_matrix(expand(block.function), block.names) is None]
    for problem in (problem for block in others for problem in _problems(block, bounds.FEW)):
        if now() > deadline:
            break
        for reading in (equation_of_root, _integral):
            with suppress(NotAlgebraic, IrreducibleAtoms, SingularPoint, ValueError, ZeroDivisionError):
                found = reading(*problem)
                if found is not None and found.unsolvable:
                    return found
                named = named or found
    return named


# F and y of F(y) = p.
Problem = tuple[Expression, Velocity]


def _problems(block: Block, depth: int) -> Iterator[Problem]:
    """Each problem of one velocity to which the families take the block."""
    if len(block.names) == 1:
        rate = Velocity(block.names[0])
        yield differentiate(block.function, rate), rate
        return
    for ray in rays(block):
        yield ray.above / ray.below, Velocity(ray.other)
    if len(block.names) <= LARGEST_BLOCK:
        slopes = zip(block.names, momenta(block.function, block.names), strict=True)
        yield from last_equations([(block.momenta[name], simplified(slope)) for name, slope in slopes], block.names)
    smaller: list[Block] = []

    def noting(function: Expression, names: Sequence[str], momenta: Mapping[str, Symbol]) -> Iterator[Branch]:
        """Solves nothing: what comes of it goes nowhere."""
        smaller.extend(split(function, names, momenta).blocks)
        yield Branch((ZERO,) * len(names), ZERO)

    for family in (ratio_branches, radial_branches, routh_branches, linear_branches) if depth else ():
        for _ in family(block, noting):
            while smaller:
                yield from _problems(smaller.pop(), depth - 1)


def _integral(slope: Expression, rate: Velocity) -> Integral | None:
    """Whether F = slope, or log F, is r(y) + sum_k c_k log(y - a_k) and is seen to be no rational z and no c log z."""
    derivative = simplified(differentiate(slope, rate))
    for each in (derivative, simplified(derivative / slope)):
        with suppress(NotAlgebraic):
            if _is_mixed(_in_one_letter(to_kernels(each), rate), rate):
                return Integral()
    return None


def _is_mixed(slope: Expression, rate: Velocity) -> bool:
    tree, k, tower = generic(slope, rate)
    known: list[tuple[int, ...]] = []
    for seed in range(1, FEW):
        point = draw_point(tower, seed, known[0][0] if known else None)
        a, b, c = Curve(rate, k, point).element(tree)
        ratios = None if b else _ratios_of_residues(a * nmod_poly([0] * (k - 1) + [1], point.prime), c)
        if ratios is None:
            return False
        known.append((point.prime, *ratios))
    return not known[0][1:] or len(set(known)) > 1


def _in_one_letter(slope: Expression, rate: Velocity) -> Expression:
    """A multiple of dF/dy for the slope dF/dv, y written v: y = e^(av + b) or log(av + b) where f holds no other."""
    match [node for node in dict.fromkeys(walk(slope)) if isinstance(node, Apply) and rate in set(walk(node))]:
        case []:
            return slope
        case [Apply("exp" | "log" as function, argument) as y] if rate not in set(walk(differentiate(argument, rate))):
            factor = _LETTER**-1 if function == "exp" else argument
            moved = quotient(substitute(slope, {y: _LETTER}) * factor)
            if rate not in set(walk(moved)):
                return substitute(moved, {_LETTER: rate})
    raise NotAlgebraic


# A space is in no name that a user can declare.
_LETTER = Symbol("a function of v")


def _ratios_of_residues(above: nmod_poly, below: nmod_poly) -> tuple[int, ...] | None:
    """Quotients of sums s_k of k-th powers of the residues, () where the rational part of the integral is not constant.

    None where the residues are 0, or s_2 is. After Ostrogradsky A/B = (C/G)' + E/D, with G = gcd(B, B') and D = B/G.
    """
    prime, common = above.modulus(), above.gcd(below)
    above, below = above // common, below // common
    whole, rest = divmod(above, below)
    repeated = below.gcd(below.derivative())
    simple = below // repeated
    turned = repeated.derivative() * simple // repeated
    units = [nmod_poly([0] * i + [1], prime) for i in range(max(repeated.degree(), simple.degree()))]
    columns = [u.derivative() * simple - u * turned for u in units[: max(repeated.degree(), 0)]]
    columns += [u * repeated for u in units[: simple.degree()]]
    size = below.degree()
    if not size:
        return None
    matrix = nmod_mat(size, size, [int(column[i]) for i in range(size) for column in columns], prime)
    solved = matrix.solve(nmod_mat(size, 1, [int(rest[i]) for i in range(size)], prime))
    parts = [int(solved[i, 0]) for i in range(size)]
    remainder = nmod_poly(parts[repeated.degree() :], prime)
    if not remainder:
        return None
    if whole or any(parts[: repeated.degree()]):
        return ()
    residue = remainder * simple.derivative().xgcd(simple)[1] % simple
    _, *(one, two, three, four) = (_trace(residue**k % simple, simple) for k in range(5))
    return (
        None
        if not two
        else tuple(int(x * pow(y, -1, prime) % prime) for x, y in ((one**2, two), (three**2, two**3), (four, two**2)))
    )


def _trace(element: nmod_poly, modulus: nmod_poly) -> int:
    """The sum of its values at the roots of the modulus."""
    y = nmod_poly([0, 1], modulus.modulus())
    total = 0
    for i in range(modulus.degree()):
        total += int((element * y**i % modulus)[i])
    return total % modulus.modulus()
