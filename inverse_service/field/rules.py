"""How the value of each transcendental atom follows from free generators.

By the structure theorem (Risch 1979; Ax 1971) exponentials and logarithms are algebraically
independent over the functions below them unless their arguments, or logarithms, are linearly
dependent over Q; angles and arctangents likewise (they are the imaginary part). A rule states the
dependence found, or that there is none: then the atom is a free generator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    PI,
    ZERO,
    Apply,
    Expression,
    Symbol,
    add,
    apply,
    multiply,
    number,
)
from inverse_service.field.modular import is_positive, positive_power, prime_factors
from inverse_service.field.point import Point, constant_value, evaluate, number_value

# The angle of one radian, when constants such as cos(1) occur.
RADIAN = Symbol("radian")
Combination = tuple[tuple[Expression, Fraction], ...]
# The free generator of an angle is that angle divided by its scale.
Scale = Callable[[Expression], int]


@dataclass(frozen=True, slots=True)
class ExponentialRule:
    """exp(u) = e^constant prod exp_j^a_j prod w_k^c_k, or free (a random positive value)."""

    atom: Apply
    free: bool
    exponentials: Combination = ()
    arguments_of_logarithms: Combination = ()
    prime_powers: tuple[tuple[int, Fraction], ...] = ()
    constant: Fraction = Fraction(0)

    def value(self, point: Point, scale: Scale) -> int:
        if self.free:
            return pow(point.draw_free(self.atom), 2, point.prime)
        result = constant_value("exp", self.constant, point)
        for atom, exponent in self.exponentials:
            result *= positive_power(point.atoms[atom], exponent, point.prime)
        for argument, exponent in self.arguments_of_logarithms:
            result *= positive_power(evaluate(argument, point), exponent, point.prime)
        for ell, exponent in self.prime_powers:
            result *= positive_power(ell, exponent, point.prime)
        return result % point.prime

    @property
    def tree(self) -> Expression:
        """The product, where it is not free."""
        primes = (number(ell) ** exponent for ell, exponent in self.prime_powers)
        atoms = (tree**exponent for tree, exponent in (*self.exponentials, *self.arguments_of_logarithms))
        constant = [apply("exp", number(self.constant))] if self.constant else []
        return multiply(*constant, *primes, *atoms)


@dataclass(frozen=True, slots=True)
class LogarithmRule:
    """log(w) = sum a_j u_j + sum c_k log(w_k) + log(constant), or free."""

    atom: Apply
    free: bool
    linear: Combination = ()
    constant: Fraction = Fraction(1)
    root: int = 1

    def value(self, point: Point, scale: Scale) -> int:
        if self.free:
            return point.draw_free(self.atom)
        result = sum(evaluate(u, point) * number_value(a, point.prime) for u, a in self.linear)
        logarithm = constant_value("log", self.constant, point) * pow(self.root, -1, point.prime)
        return (result + logarithm) % point.prime

    @property
    def tree(self) -> Expression:
        """The sum, where it is not free."""
        logarithm = ZERO if self.constant == 1 else apply("log", number(self.constant))
        return _sum_tree(self.linear) + Fraction(1, self.root) * logarithm


@dataclass(frozen=True, slots=True)
class AngleRule:
    """phi = sum b_k phi_k + sum d_j atan(w_j) + radians + pi turns, or free."""

    angle: Expression
    free: bool
    angles: Combination = ()
    arctangents: Combination = ()
    radians: Fraction = Fraction(0)
    turns: Fraction = Fraction(0)

    def value(self, point: Point, scale: Scale) -> tuple[int, int]:
        """(cos phi, sin phi)."""
        prime = point.prime
        if self.free:
            return circle_power(_random_turn(point, self.angle), scale(self.angle), prime)
        total = circle_turn(self.turns, prime)
        for angle, factor in self.angles:
            total = circle_product(total, self._scaled(point, angle, factor, scale), prime)
        if self.radians:
            total = circle_product(total, self._scaled(point, RADIAN, self.radians, scale), prime)
        for atom, factor in self.arctangents:
            part = _circle_part(_arctangent_turn(atom, point), factor.denominator, prime)
            total = circle_product(total, circle_power(part, factor.numerator, prime), prime)
        return total

    @staticmethod
    def _scaled(point: Point, angle: Expression, factor: Fraction, scale: Scale) -> tuple[int, int]:
        steps = factor * scale(angle)
        if steps.denominator != 1:
            raise IrreducibleAtoms(f"two angles have the ratio {factor}, which is finer than can be reduced")
        return circle_power(_random_turn(point, angle), steps.numerator, point.prime)


@dataclass(frozen=True, slots=True)
class ArctangentRule:
    """atan(w) = sum b_k phi_k + sum d_j atan(w_j) + pi turns, or free."""

    atom: Apply
    free: bool
    linear: Combination = ()
    turns: Fraction = Fraction(0)

    def value(self, point: Point, scale: Scale) -> int:
        if self.free:
            return point.draw_free(self.atom)
        result = sum(evaluate(u, point) * number_value(a, point.prime) for u, a in self.linear)
        return (result + point.variable(PI) * number_value(self.turns, point.prime)) % point.prime

    @property
    def tree(self) -> Expression:
        """The sum, where it is not free."""
        return _sum_tree(self.linear) + self.turns * PI


def _sum_tree(linear: Combination) -> Expression:
    return add(*(a * u for u, a in linear))


Rule = ExponentialRule | LogarithmRule | AngleRule | ArctangentRule


def replay(rule: Rule, point: Point, scale: Scale) -> None:
    """Give the rule's atom its value at the point."""
    if isinstance(rule, AngleRule):
        cosine, sine = rule.value(point, scale)
        point.atoms[Apply("cos", rule.angle)] = cosine
        point.atoms[Apply("sin", rule.angle)] = sine
        if rule.free:
            point.atoms[half_angle(rule.angle, scale(rule.angle))] = _random_tangent(point, rule.angle)
        if rule.radians:
            point.atoms[half_angle(RADIAN, scale(RADIAN))] = _random_tangent(point, RADIAN)
    else:
        point.atoms[rule.atom] = rule.value(point, scale)


@lru_cache(maxsize=256)
def half_angle(angle: Expression, scale: int) -> Expression:
    """tan(angle / (2 scale)), in which cos and sin of angle/scale are rational."""
    return Apply("tan", Fraction(1, 2 * scale) * angle)


def circle_product(left: tuple[int, int], right: tuple[int, int], prime: int) -> tuple[int, int]:
    return (left[0] * right[0] - left[1] * right[1]) % prime, (left[0] * right[1] + left[1] * right[0]) % prime


def circle_power(turn: tuple[int, int], exponent: int, prime: int) -> tuple[int, int]:
    """(cos k phi, sin k phi)."""
    if exponent < 0:
        return circle_power((turn[0], -turn[1] % prime), -exponent, prime)
    result = (1, 0)
    for digit in bin(exponent)[2:]:
        result = circle_product(result, result, prime)
        if digit == "1":
            result = circle_product(result, turn, prime)
    return result


def _random_turn(point: Point, angle: Expression) -> tuple[int, int]:
    """A random point of the circle, by t -> ((1 - t^2)/(1 + t^2), 2t/(1 + t^2)); -1 is no square."""
    return _circle_point(_random_tangent(point, angle), point.prime)


def _random_tangent(point: Point, angle: Expression) -> int:
    """That of half the angle, in its scale: never the number that is drawn for an angle such as e^x or log x itself."""
    return point.draw_free(Apply("tan", angle))


def _circle_point(t: int, prime: int) -> tuple[int, int]:
    factor = pow(1 + t * t, -1, prime)
    return (1 - t * t) * factor % prime, 2 * t * factor % prime


def _arctangent_turn(atom: Expression, point: Point) -> tuple[int, int]:
    """(cos, sin) of atan(w) = (1, w)/sqrt(1 + w^2)."""
    assert isinstance(atom, Apply)
    w = evaluate(atom.argument, point)
    factor = positive_power((1 + w * w) % point.prime, Fraction(-1, 2), point.prime)
    return factor, w * factor % point.prime


def _circle_part(turn: tuple[int, int], number: int, prime: int) -> tuple[int, int]:
    """(cos, sin) of phi/number, |phi| < pi/2: halves by cos(phi/2) = sqrt((1 + cos phi)/2).

    Odd parts are in the group of the circle's elements of an order prime to the number, where they exist once.
    Raises ValueError where there is none.
    """
    while number % 2 == 0:
        square = (1 + turn[0]) * pow(2, -1, prime) % prime
        if not is_positive(square, prime):
            return 1, 0  # the point is refused for what is under its roots
        cosine = positive_power(square, Fraction(1, 2), prime)
        turn, number = (cosine, turn[1] * pow(2 * cosine, -1, prime) % prime), number // 2
    order = prime + 1
    while (common := math.gcd(order, number)) > 1:
        order //= common
    if number > 1 and circle_power(turn, order, prime) != (1, 0):
        raise ValueError("no part of this angle")
    return circle_power(turn, pow(number, -1, order), prime)


@lru_cache(maxsize=1024)
def circle_turn(turns: Fraction, prime: int) -> tuple[int, int]:
    """(cos, sin) of pi turns, where twice the denominator divides prime + 1, the order of the circle."""
    whole, total = 2 * turns.denominator, (1, 0)
    if (prime + 1) % whole:
        raise IrreducibleAtoms(f"the angle {turns} pi is too fine a part of pi: write a letter for its sine and cosine")
    for ell, k in prime_factors(whole):
        rest = whole // ell**k
        total = circle_product(
            total, circle_power(_unit(ell, k, prime), turns.numerator * pow(rest, -1, ell**k), prime), prime
        )
    return total


@lru_cache(maxsize=1024)
def _unit(ell: int, k: int, prime: int) -> tuple[int, int]:
    """(cos, sin) of 2 pi/ell^k, the ones for which the roots of 2, 3, 5, … that they give are the positive ones."""
    most = next(m for m in range(k, 64) if (prime + 1) % ell ** (m + 1))
    order = ell**most
    t = next(t for t in range(2, 999) if _order_is_multiple(t, ell, prime))
    start = circle_power(_circle_point(t, prime), (prime + 1) // order, prime)
    found = next(
        z for a in range(1, order) if a % ell and _is_principal(z := circle_power(start, a, prime), ell, order, prime)
    )
    return circle_power(found, ell ** (most - k), prime)


def _order_is_multiple(t: int, ell: int, prime: int) -> bool:
    return circle_power(_circle_point(t, prime), (prime + 1) // ell, prime) != (1, 0)


def _is_principal(turn: tuple[int, int], ell: int, order: int, prime: int) -> bool:
    """Whether sqrt(2)/2, sqrt(3)/2, or by Gauss the root of a larger prime, follows from a turn by 2 pi/order."""
    if ell == 2:
        half = positive_power(2, Fraction(-1, 2), prime)
        return circle_power(turn, order // 8, prime) == (half, half)
    powers = [circle_power(turn, order // ell * a, prime)[ell // 2 % 2] for a in range(1, ell)]
    total = sum(value * (1 if is_positive(a, ell) else -1) for a, value in enumerate(powers, 1))
    return total % prime == positive_power(ell, Fraction(1, 2), prime)
