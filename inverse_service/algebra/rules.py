"""How the value of each transcendental atom follows from free generators.

By the structure theorem (Risch 1979; Ax 1971) exponentials and logarithms are algebraically
independent over the functions below them unless their arguments, or logarithms, are linearly
dependent over Q; angles and arctangents likewise (they are the imaginary part). A rule states the
dependence found, or that there is none: then the atom is a free generator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from inverse_service.algebra.point import Point, constant_value, evaluate, number_value
from inverse_service.algebra.primes import positive_power
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import PI, Apply, Expression, Symbol, multiply, number

# cos and sin of k pi/12 are made from the positive roots of 2 and 3.
_TWELFTH = 12
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
        total = circle_twelfth(self.turns, prime)
        for angle, factor in self.angles:
            total = circle_product(total, self._scaled(point, angle, factor, scale), prime)
        if self.radians:
            total = circle_product(total, self._scaled(point, RADIAN, self.radians, scale), prime)
        for atom, factor in self.arctangents:
            total = circle_product(total, circle_power(_arctangent_turn(atom, point), int(factor), prime), prime)
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


Rule = ExponentialRule | LogarithmRule | AngleRule | ArctangentRule


def replay(rule: Rule, point: Point, scale: Scale) -> None:
    """Give the rule's atom its value at the point."""
    if isinstance(rule, AngleRule):
        cosine, sine = rule.value(point, scale)
        point.atoms[Apply("cos", rule.angle)] = cosine
        point.atoms[Apply("sin", rule.angle)] = sine
        if rule.free:
            point.atoms[half_angle(rule.angle, scale(rule.angle))] = point.draw_free(rule.angle)
        if rule.radians:
            point.atoms[half_angle(RADIAN, scale(RADIAN))] = point.draw_free(RADIAN)
    else:
        point.atoms[rule.atom] = rule.value(point, scale)


def half_angle(angle: Expression, scale: int) -> Expression:
    """tan(angle / (2 scale)), in which cos and sin of angle/scale are rational."""
    return Apply("tan", multiply(number(Fraction(1, 2 * scale)), angle))


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
    t = point.draw_free(angle)
    factor = pow(1 + t * t, -1, point.prime)
    return (1 - t * t) * factor % point.prime, 2 * t * factor % point.prime


def _arctangent_turn(atom: Expression, point: Point) -> tuple[int, int]:
    """(cos, sin) of atan(w) = (1, w)/sqrt(1 + w^2)."""
    assert isinstance(atom, Apply)
    w = evaluate(atom.argument, point)
    factor = positive_power((1 + w * w) % point.prime, Fraction(-1, 2), point.prime)
    return factor, w * factor % point.prime


@lru_cache(maxsize=1024)
def circle_twelfth(turns: Fraction, prime: int) -> tuple[int, int]:
    """(cos, sin) of pi * turns for multiples of pi/12."""
    steps = turns * _TWELFTH
    if steps.denominator != 1:
        raise IrreducibleAtoms(f"the angle {turns} pi is no multiple of pi/12; write its sine and cosine as roots")
    half = pow(2, -1, prime)
    root2, root3 = (positive_power(k, Fraction(1, 2), prime) for k in (2, 3))
    third = (half, root3 * half % prime)
    minus_quarter = (root2 * half % prime, -root2 * half % prime)
    return circle_power(circle_product(third, minus_quarter, prime), steps.numerator % (2 * _TWELFTH), prime)
