"""Identities factor * P = sum of cofactor * fact between polynomials over Q: P = 0 where the factor is not 0.

P and the facts are polynomials in generators that mean anything; relations of the generators are facts like others.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from flint import fmpq_mpoly, fmpq_mpoly_ctx

from inverse_service.certificate.formulas import MAX_MEMBERS, Ended, check_shape, require
from inverse_service.field.rational_functions import Budget, coefficients_of


@dataclass(frozen=True, slots=True)
class Fact:
    """`polynomial` = 0, under a name."""

    name: str
    polynomial: fmpq_mpoly


@dataclass(frozen=True, slots=True)
class Identity:
    """factor * gives = sum of cofactor * fact, all with integer coefficients."""

    gives: Fact
    factor: fmpq_mpoly
    terms: tuple[tuple[fmpq_mpoly, Fact], ...]

    @property
    def holds(self) -> bool:
        """Whether both sides are the same polynomial: exact, without any point."""
        left = self.factor * self.gives.polynomial
        return bool((left - sum((c * fact.polynomial for c, fact in self.terms), left * 0)).is_zero())


@dataclass(frozen=True, slots=True)
class Divisor:
    """A fact that replaces powers of generator `index` from its own on; its leading coefficient is not zero."""

    fact: Fact
    index: int


@dataclass(frozen=True, slots=True)
class Remainder:
    """multiplier * P = sum of cofactor * fact + rest."""

    multiplier: fmpq_mpoly
    terms: tuple[tuple[fmpq_mpoly, Fact], ...]
    rest: fmpq_mpoly


def divided(polynomial: fmpq_mpoly, divisors: Sequence[Divisor], budget: Budget) -> Remainder:
    """Pseudo-division by one divisor after the other."""
    multiplier, rest, cofactors = polynomial * 0 + 1, polynomial, dict[str, tuple[fmpq_mpoly, Fact]]()
    for divisor in divisors:
        scale, quotient, rest = _pseudo_division(rest, divisor, budget)
        if not scale.is_one():
            multiplier, cofactors = multiplier * scale, {k: (c * scale, f) for k, (c, f) in cofactors.items()}
        known = cofactors.get(divisor.fact.name, (polynomial * 0, divisor.fact))[0]
        cofactors[divisor.fact.name] = known + quotient, divisor.fact
    return Remainder(multiplier, tuple(term for term in cofactors.values() if not term[0].is_zero()), rest)


def _pseudo_division(rest: fmpq_mpoly, divisor: Divisor, budget: Budget) -> tuple[fmpq_mpoly, fmpq_mpoly, fmpq_mpoly]:
    """(scale, quotient, rest) with scale * P = quotient * divisor + rest, of lower degree in the generator."""
    by, index = divisor.fact.polynomial, divisor.index
    degree = by.degrees()[index]
    leading, scale, quotient = coefficient(by, index, degree), rest * 0 + 1, rest * 0
    while not rest.is_zero() and (top := rest.degrees()[index]) >= degree:
        head = coefficient(rest, index, top)
        common = leading if leading.is_constant() else leading.gcd(head)
        up, step = leading / common, head / common * rest.context().gen(index) ** (top - degree)
        budget.charge(len(rest) * len(up) + len(step) * len(by))
        scale, quotient, rest = scale * up, quotient * up + step, rest * up - step * by
    return scale, quotient, rest


def coefficient(polynomial: fmpq_mpoly, index: int, power: int) -> fmpq_mpoly:
    """The coefficient of that power of a generator, a polynomial in the others."""
    return coefficients_of(polynomial, [index]).get((power,), polynomial * 0)


def content(polynomial: fmpq_mpoly, unknowns: Iterable[int]) -> fmpq_mpoly:
    """The greatest common divisor of the coefficients of a polynomial that is linear in the unknowns."""
    parts = [coefficient(polynomial, index, 1) for index in unknowns]
    return functools.reduce(lambda a, b: a.gcd(b), parts)


def primitive(polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """A multiple by a rational number with coprime integer coefficients, the first one positive."""
    below = math.lcm(*(int(value.q) for value in polynomial.coeffs()))
    above = math.gcd(*(int((value * below).p) for value in polynomial.coeffs()))
    sign = -1 if polynomial.leading_coefficient() < 0 else 1
    return polynomial * (sign * below) / above if above else polynomial


def identity(gives: Fact, factor: fmpq_mpoly, terms: Sequence[tuple[fmpq_mpoly, Fact]]) -> Identity:
    """The identity, multiplied by a number so that no fraction is left; ArithmeticError where it does not hold."""
    listed = [(c, fact) for c, fact in terms if not c.is_zero()]
    below = math.lcm(*(int(value.q) for c in (factor, *(c for c, _ in listed)) for value in c.coeffs()))
    found = Identity(gives, factor * below, tuple((c * below, fact) for c, fact in listed))
    if not found.holds:
        raise ArithmeticError("an identity of a proof does not hold")
    return found


TEXT, WORD = r"(?s:.*)", r"[A-Za-z_][A-Za-z0-9_]*"
POWER = rf"(?:[0-9]+|{WORD}(?:\^[0-9]{{1,4}})?)"
MONOMIAL = re.compile(rf"\s*([+-]?)\s*({POWER}(?:\*{POWER})*)\s*")
STEP = {"name": WORD, "gives": TEXT, "factor": TEXT, "cofactors": {}}
THEOREM = {
    "theorem": WORD,
    "relations": {},
    "equations": {},
    "nonzero": [TEXT, MAX_MEMBERS],
    "steps": [STEP, MAX_MEMBERS],
}
MAX_PRODUCTS = 50_000_000  # of terms in an identity


def checked_identities(document: Any) -> list[str]:
    """One sentence for each theorem: relations and equations zero, its factors not, so the last `gives` is zero.

    Each step is factor * gives = sum of cofactor * (relation, equation or earlier step).
    """
    check_shape(document, {"theorems": [THEOREM, MAX_MEMBERS]}, "identities")
    if not document["theorems"]:
        raise Ended("incomplete", "There are no identities.")
    return [_checked(theorem) for theorem in document["theorems"]]


def _checked(theorem: dict[str, Any]) -> str:
    facts, steps = theorem["relations"] | theorem["equations"], theorem["steps"]
    texts = [*facts.values(), *theorem["nonzero"], *(step[key] for step in steps for key in ("gives", "factor"))]
    texts += [cofactor for step in steps for cofactor in step["cofactors"].values()]
    require(steps and all(isinstance(text, str) for text in texts), "A theorem has texts, and a step at least.")
    names = sorted({word for text in texts for word in re.findall(WORD, text)}) or ["x"]
    ring = fmpq_mpoly_ctx.get(names, "degrevlex")
    known = {name: _polynomial(text, ring) for name, text in facts.items()}
    nonzero = [_polynomial(text, ring) for text in theorem["nonzero"]]
    for step in steps:
        require({*step["cofactors"]} <= {*known}, f"Step {step['name']} uses what was not shown before.")
        pairs = [(_polynomial(text, ring), known[name]) for name, text in step["cofactors"].items()]
        gives, factor = (_polynomial(step[key], ring) for key in ("gives", "factor"))
        if sum(len(a) * len(b) for a, b in [*pairs, (gives, factor)]) > MAX_PRODUCTS:
            raise Ended("incomplete", f"Step {step['name']} is too long.")
        require(_splits(factor, nonzero), f"The factor of step {step['name']} may be zero.")
        rest = sum((a * b for a, b in pairs), gives * 0) - factor * gives
        require(rest.is_zero(), f"The identity of step {step['name']} does not hold.")
        require(step["name"] not in known, "A name is used twice.")
        known[step["name"]] = gives
    return f"{theorem['theorem']}: the identities hold over the rationals, so {steps[-1]['gives'][:200]} = 0."


def _splits(factor: fmpq_mpoly, nonzero: list[fmpq_mpoly]) -> bool:
    """Whether it is a number times powers of what is not zero."""
    for one in nonzero:
        while not one.is_constant() and not factor.is_zero() and (factor % one).is_zero():
            factor = factor / one
    return bool(factor.is_constant() and not factor.is_zero())


def _polynomial(text: str, ring: fmpq_mpoly_ctx) -> fmpq_mpoly:
    """3*x^2*y - 1: a sum of monomials with integer coefficients."""
    table, position, names = dict[tuple[int, ...], int](), 0, ring.names()
    while position < len(text) or not position:
        found = MONOMIAL.match(text, position)
        good = found and (found[1] or not position)
        require(good, f"What stands at column {position + 1} of {text[:40]}… is no monomial.")
        exponents, value = [0] * len(names), -1 if found and found[1] == "-" else 1
        for power in found[2].split("*") if found else ():
            name, _, exponent = power.partition("^")
            if name.isdigit():
                value *= int(name)
            else:
                exponents[names.index(name)] += int(exponent or 1)
        key, position = tuple(exponents), found.end() if found else len(text)
        table[key] = table.get(key, 0) + value
    return ring.from_dict({key: value for key, value in table.items() if value})
