"""sin, cos and their hyperbolic likes: one pair of generators for each basis argument.

With sign = -1 for the trigonometric and +1 for the hyperbolic pair (s, c): ds = c du, dc = sign s du and
c^2 - sign s^2 = 1. Where only the tangent of an argument occurs it is the generator itself:
dT = (1 - sign T^2) du.

Linear relations over Q among the arguments of functions.

exp(2x) and exp(x), sin(a - b) and sin a, sin b are dependent because their arguments are. A basis of
the arguments, scaled so that every argument is an integer combination, gives independent generators.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flint import fmpz

from inverse_service.expressions.tree import PI, Apply, Expression
from inverse_service.field.exact_ring import ExactRing, quotient_tree, scaled_tree
from inverse_service.field.rational_functions import Quotient, TooLarge, as_fraction, factored

Coordinates = Mapping[Any, Fraction]
# Of a basis element; powers of a generator are expanded.
_LARGEST_MULTIPLE = 1_000


@dataclass(frozen=True, slots=True)
class ArgumentBasis:
    """Arguments u_k = sum_b coefficients[k][b] * u_(chosen[b]) / scales[b], coefficients integer."""

    chosen: tuple[int, ...]
    scales: tuple[int, ...]
    coefficients: tuple[tuple[int, ...], ...]


def coordinates_of(argument: Quotient) -> Coordinates:
    """The argument as a combination of monomials over its denominator."""
    terms = argument.numerator.terms()
    return {(argument.exponents, monomial): as_fraction(value) for monomial, value in terms}


def factor_coordinates(argument: Quotient) -> Coordinates:
    """The exponents of the prime numbers, irreducible numerator factors and denominators."""
    constant, factors = factored(argument.numerator)
    table: dict[Any, Fraction] = {(0, repr(factor)): Fraction(power) for factor, power in factors}
    table |= {(1, index): Fraction(-power) for index, power in argument.exponents}
    for sign, value in ((1, abs(constant.numerator)), (-1, constant.denominator)):
        table |= {(2, int(ell)): Fraction(sign * int(power)) for ell, power in fmpz(value).factor()}
    return table


def argument_basis(vectors: Sequence[Coordinates]) -> ArgumentBasis:
    """A basis taken from the vectors themselves, simplest first."""
    order = sorted(range(len(vectors)), key=lambda index: (_size(vectors[index]), index))
    chosen: list[int] = []
    expressed: dict[int, list[Fraction]] = {}
    for index in order:
        combination = _solve([vectors[other] for other in chosen], vectors[index])
        if combination is None:
            combination = [Fraction(0)] * len(chosen) + [Fraction(1)]
            chosen.append(index)
        expressed[index] = combination
    rows = [_padded(expressed[index], len(chosen)) for index in range(len(vectors))]
    scales = tuple(math.lcm(*(row[column].denominator for row in rows)) for column in range(len(chosen)))
    integers = tuple(tuple(int(c * m) for c, m in zip(row, scales, strict=True)) for row in rows)
    if any(abs(k) > _LARGEST_MULTIPLE for row in integers for k in row):
        raise TooLarge("the arguments of exponentials or angles are too large multiples of a common one")
    return ArgumentBasis(tuple(chosen), scales, integers)


def _size(vector: Coordinates) -> tuple[int, int]:
    return len(vector), sum(abs(c.numerator) + c.denominator for c in vector.values())


def _padded(row: list[Fraction], length: int) -> list[Fraction]:
    return row + [Fraction(0)] * (length - len(row))


def _solve(basis: Sequence[Coordinates], target: Coordinates) -> list[Fraction] | None:
    """Coefficients c with target = sum c_b basis_b for independent basis vectors, or None."""
    keys = sorted({key for vector in (*basis, target) for key in vector}, key=repr)
    rows = [[vector.get(key, Fraction(0)) for vector in (*basis, target)] for key in keys]
    for column in range(len(basis)):
        pivot = next(index for index in range(column, len(rows)) if rows[index][column])
        rows[column], rows[pivot] = rows[pivot], rows[column]
        lead = rows[column][column]
        rows[column] = [value / lead for value in rows[column]]
        for index, row in enumerate(rows):
            if index != column and row[column]:
                factor = row[column]
                rows[index] = [a - factor * b for a, b in zip(row, rows[column], strict=True)]
    if any(row[-1] for row in rows[len(basis) :]):
        return None
    return [rows[column][-1] for column in range(len(basis))]


TRIGONOMETRIC = frozenset(["sin", "cos", "tan", "cot", "sec", "csc"])
HYPERBOLIC = frozenset(["sinh", "cosh", "tanh", "coth", "sech", "csch"])

# sin(k x) is a polynomial of degree k in sin x and cos x.
LARGEST_MULTIPLE = 64


@dataclass(frozen=True, slots=True)
class Pair:
    """(sin u, cos u) or (sinh u, cosh u)."""

    sine: Quotient
    cosine: Quotient


def adjoin_pairs(ring: ExactRing, nodes: Sequence[Apply], sign: int) -> None:
    """Values of the trigonometric (sign -1) or hyperbolic (1) functions in `nodes`; TooLarge for large multiples."""
    arguments = [ring.value(node.argument) for node in nodes]
    turns = [_quarter_turns(ring, argument) if sign < 0 else 0 for argument in arguments]
    free = [argument - _quarters(ring, count) for argument, count in zip(arguments, turns, strict=True)]
    basis = argument_basis([coordinates_of(argument) for argument in free])
    if any(abs(coefficient) > LARGEST_MULTIPLE for row in basis.coefficients for coefficient in row):
        raise TooLarge(f"an angle is more than {LARGEST_MULTIPLE} times another one")
    pairs: list[Pair | None] = []
    for column, (place, scale) in enumerate(zip(basis.chosen, basis.scales, strict=True)):
        users = [index for index, row in enumerate(basis.coefficients) if row[column]]
        if _only_tangents(nodes, turns, basis, users):
            _adjoin_tangent(ring, [nodes[index] for index in users], free[place], sign)
            pairs.append(None)
        else:
            plain = nodes[place].argument if not turns[place] else None
            pairs.append(_new_pair(ring, plain, free[place], scale, sign))
    for node, count, row in zip(nodes, turns, basis.coefficients, strict=True):
        if node not in ring.atoms:
            ring.atoms[node] = _of_pair(node.function, _combined(ring, pairs, row, count, sign))


def _quarter_turns(ring: ExactRing, argument: Quotient) -> int:
    """k where the argument holds k pi/2, k an integer; otherwise 0."""
    if PI not in ring.atoms:
        return 0
    (key,) = coordinates_of(ring.atoms[PI])
    twice = 2 * coordinates_of(argument).get(key, Fraction(0))
    return int(twice) if twice.denominator == 1 else 0


def _quarters(ring: ExactRing, count: int) -> Quotient:
    return ring.atoms[PI].scaled(Fraction(count, 2)) if count else ring.constant(0)


def _only_tangents(nodes: Sequence[Apply], turns: Sequence[int], basis: ArgumentBasis, users: Sequence[int]) -> bool:
    """Whether a basis argument occurs alone and under tan and cot (tanh and coth) only."""
    return all(
        nodes[index].function in ("tan", "cot", "tanh", "coth")
        and not turns[index]
        and sorted(basis.coefficients[index])[-1] == 1 == sum(map(abs, basis.coefficients[index]))
        for index in users
    )


def _adjoin_tangent(ring: ExactRing, nodes: Sequence[Apply], argument: Quotient, sign: int) -> None:
    name = "tan" if sign < 0 else "tanh"
    index = ring.new_generator(Apply(name, nodes[0].argument))
    tangent = ring.generator(index)
    ring.set_slopes(index, [(ring.constant(1) - (tangent * tangent).scaled(sign), argument)])
    for node in nodes:
        ring.atoms[node] = tangent if node.function == name else tangent.inverse()


def _new_pair(ring: ExactRing, plain: Expression | None, argument: Quotient, scale: int, sign: int) -> Pair:
    """Generators for the argument divided by `scale`; the sine squared is the one that is reduced."""
    names = ("sin", "cos") if sign < 0 else ("sinh", "cosh")
    tree = scaled_tree(plain if plain is not None else quotient_tree(ring, argument), scale)
    below = argument.scaled(Fraction(1, scale))
    cosine_index = ring.new_generator(Apply(names[1], tree))
    sine_index = ring.new_generator(Apply(names[0], tree))
    pair = Pair(ring.generator(sine_index), ring.generator(cosine_index))
    square = (pair.cosine * pair.cosine - ring.constant(1)).scaled(sign)
    ring.field.relate(sine_index, 2, square.numerator)
    # Both slopes need no derivative of the other, so the order of these two lines does not matter.
    ring.set_slopes(sine_index, [(pair.cosine, below)])
    ring.set_slopes(cosine_index, [(pair.sine.scaled(sign), below)])
    return pair


def _combined(ring: ExactRing, pairs: Sequence[Pair | None], row: Sequence[int], turns: int, sign: int) -> Pair:
    """The pair of sum row[b] u_b + turns pi/2, by the addition theorems."""
    total = Pair(ring.constant(0), ring.constant(1))
    for _ in range(turns % 4):
        total = Pair(total.cosine, -total.sine)
    for pair, coefficient in zip(pairs, row, strict=True):
        if pair is None or not coefficient:
            continue
        step = pair if coefficient > 0 else Pair(-pair.sine, pair.cosine)
        for _ in range(abs(coefficient)):
            total = _added(total, step, sign)
    return total


def _added(left: Pair, right: Pair, sign: int) -> Pair:
    sine = left.sine * right.cosine + left.cosine * right.sine
    return Pair(sine, left.cosine * right.cosine + (left.sine * right.sine).scaled(sign))


def _of_pair(function: str, pair: Pair) -> Quotient:
    match function.removesuffix("h"):
        case "sin":
            return pair.sine
        case "cos":
            return pair.cosine
        case "tan":
            return pair.sine / pair.cosine
        case "cot":
            return pair.cosine / pair.sine
        case "sec":
            return pair.cosine.inverse()
        case "csc":
            return pair.sine.inverse()
    raise ValueError(f"{function} is not a trigonometric or hyperbolic function")
