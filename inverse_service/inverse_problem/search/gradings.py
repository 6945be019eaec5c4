"""Terms of an ansatz sorted by how they behave under scalings and reflections that keep f.

A scaling multiplies every variable by its own power of one positive number; a reflection gives some of
them the other sign. Where q'' = f keeps its form, the Euler-Lagrange expressions of a term take up the
factor of the term, so a combination of terms of different factors is a Lagrangian only if each of its
parts is one: a large linear problem falls into small ones. log(u) counts as a number where u is
homogeneous: it gains a constant, and powers of a logarithm are independent of powers of the variable.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import reduce
from operator import xor
from types import MappingProxyType

from flint import nmod_mat

from inverse_service.algebra.point import number_value
from inverse_service.expressions.functions import FUNCTION
from inverse_service.expressions.tree import (
    PI,
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Product,
    Sum,
    Symbol,
    Velocity,
    walk,
)
from inverse_service.inverse_problem.search.terms import Monomial, TooManyTerms, terms_of
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# The logarithm of a factor, linear in those of the variables and of arbitrary functions (by name).
Form = dict[Symbol | str, Fraction]
# (exponent under a random scaling, signs under reflections as bits).
Factor = tuple[int, int]
# A coordinate, the order of its derivative by t, and that derivative.
Rate = tuple[Symbol, int, Expression]
_ONE = Fraction(1)
_PRIME = 2**61 - 1
# Below that many terms there is nothing to be gained.
_FEW = 8
_ODD = frozenset(name for name, row in FUNCTION.items() if row.parity < 0)
_EVEN = frozenset(name for name, row in FUNCTION.items() if row.parity > 0)


@dataclass(slots=True)
class _Measure:
    """The factors of trees under scalings or under reflections; `zero` holds the forms that have to vanish."""

    reflections: bool
    zero: list[Form] = field(default_factory=list)

    def tree(self, tree: Expression) -> Form:
        match tree:
            case Number():
                return {}
            case Symbol():
                return {} if tree == PI else {tree: _ONE}
            case Velocity(coordinate):
                return _sum([({Symbol(coordinate): _ONE}, _ONE), ({TIME: _ONE}, -_ONE)])
            case Sum(parts):
                return self.common(self.tree(part) for part in parts)
            case Product(factors):
                return _sum((self.tree(factor), _ONE) for factor in factors)
            case Power(base, Number(exponent)):
                return self._power(self.tree(base), exponent)
            case Apply(function, argument):
                return self._apply(function, self.tree(argument))
            case Arbitrary(name, arguments, _):
                self.zero += map(self.tree, arguments)
                return {name: _ONE}
        self.zero += [{node: _ONE} for node in walk(tree) if isinstance(node, Symbol)]
        return {}

    def monomial(self, key: Monomial) -> Form:
        return _sum((self._power(self.tree(letter), e), _ONE) for letter, e in key)

    def common(self, forms: Iterable[Form]) -> Form:
        """The factor that all parts of a sum must share."""
        first, *others = forms
        self.zero += [_sum([(other, _ONE), (first, -_ONE)]) for other in others]
        return first

    def _power(self, base: Form, exponent: Fraction) -> Form:
        if self.reflections and exponent.denominator > 1:
            self.zero.append(base)
            return {}
        return _sum([(base, exponent)])

    def _apply(self, function: str, argument: Form) -> Form:
        if self.reflections and function in _ODD:
            return argument
        if not (function in _EVEN if self.reflections else function == "log"):
            self.zero.append(argument)
        return {}


def _sum(parts: Iterable[tuple[Form, Fraction]]) -> Form:
    total: Form = {}
    for form, factor in parts:
        for name, value in form.items():
            more = value if factor == 1 else factor * value
            total[name] = total[name] + more if name in total else more
    return total


def graded(
    system: SecondOrderSystem, candidates: Sequence[Monomial], constrained: Mapping[Velocity, Expression] | None = None
) -> list[list[int]]:
    """The numbers of the candidates in groups of equal factors; each group is an ansatz of its own.

    What keeps the motion has to keep the constraints too, if any.
    """
    if len(candidates) < _FEW:
        return [list(range(len(candidates)))] if candidates else []
    return grouped(factors(system, candidates, constrained or {}))


def grouped(keys: Iterable[Factor]) -> list[list[int]]:
    """The places of equal factors together."""
    groups: dict[Factor, list[int]] = {}
    for k, key in enumerate(keys):
        groups.setdefault(key, []).append(k)
    return list(groups.values())


def factors(
    system: SecondOrderSystem,
    candidates: Sequence[Monomial],
    constrained: Mapping[Velocity, Expression] = MappingProxyType({}),
) -> list[Factor]:
    """What tells the factors of candidates apart; 1/t in their place stands for Gamma."""
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    equations: list[Rate] = [(Symbol(name), 2, f) for name, f in pairs]
    equations += [(Symbol(v.coordinate), 1, w) for v, w in constrained.items()]
    return list(zip(_scaled(equations, candidates), _reflected(equations, candidates), strict=True))


def by_degree(system: SecondOrderSystem, shapes: Sequence[Monomial]) -> list[list[Monomial]]:
    """Functions of the velocities by their degree in these, where f is homogeneous of degree 2; else all together.

    Slower motion on the same path is a motion then, so multipliers of different degrees do not mix.
    """
    measure = _Measure(reflections=False)
    _keep_motion(
        measure, [(Symbol(name), 2, f) for name, f in zip(system.coordinates, system.accelerations, strict=True)]
    )
    if system.depends_on_time or any(form.get(TIME) for form in measure.zero):
        return [list(shapes)]
    forms = [measure.monomial(shape) for shape in shapes]
    if any(form.get(TIME) for form in measure.zero):
        return [list(shapes)]
    groups: dict[Fraction, list[Monomial]] = {}
    for shape, form in zip(shapes, forms, strict=True):
        groups.setdefault(form.get(TIME, Fraction(0)), []).append(shape)
    return list(groups.values())


def _scaled(equations: Sequence[Rate], candidates: Sequence[Monomial]) -> list[int]:
    """The exponents with which the candidates scale, for a random scaling, modulo a prime."""
    forms, names, basis = _kept(equations, candidates, reflections=False)
    generator = random.Random(f"gradings {len(names)}")
    weights = [generator.randrange(_PRIME) for _ in basis]
    exponents = [sum(w * row[k] for w, row in zip(weights, basis, strict=True)) for k in range(len(names))]
    values = {
        p: sum(number_value(a, _PRIME) * exponents[names[name]] for name, a in f.items()) for p, f in forms.items()
    }
    return [sum(values[p] * number_value(e, _PRIME) for p, e in key) % _PRIME for key in candidates]


def _reflected(equations: Sequence[Rate], candidates: Sequence[Monomial]) -> list[int]:
    """The signs that the candidates get by independent reflections, as bits."""
    forms, names, basis = _kept(equations, candidates, reflections=True)
    signs = [sum(row[k] << place for place, row in enumerate(basis)) for k in range(len(names))]
    values = {p: _exclusive(signs[names[name]] for name, a in f.items() if a % 2) for p, f in forms.items()}
    return [_exclusive(values[p] for p, e in key if e.numerator % 2) for key in candidates]


def _exclusive(bits: Iterable[int]) -> int:
    return reduce(xor, bits, 0)


def _kept(
    equations: Sequence[Rate], candidates: Sequence[Monomial], reflections: bool
) -> tuple[dict[Expression, Form], dict[Symbol | str, int], list[list[int]]]:
    """(forms of the letters, places of the names, a basis of what keeps f and makes all letters homogeneous)."""
    measure = _Measure(reflections)
    _keep_motion(measure, equations)
    forms = {letter: measure.tree(letter) for letter in dict.fromkeys(p for key in candidates for p, _ in key)}
    if reflections:
        measure.zero += [forms[p] for p in {p for key in candidates for p, e in key if e.denominator > 1}]
    names = {name: k for k, name in enumerate(dict.fromkeys(n for f in (*forms.values(), *measure.zero) for n in f))}
    return forms, names, _null_vectors(measure.zero, names, 2 if reflections else _PRIME)


def _keep_motion(measure: _Measure, equations: Sequence[Rate]) -> None:
    """Each f has to scale as q/t^order."""
    for name, order, f in equations:
        rate = _sum([({name: _ONE}, _ONE), ({TIME: _ONE}, Fraction(-order))])
        try:
            measure.common([rate, *map(measure.monomial, terms_of(f))])
        except TooManyTerms:
            measure.common([rate, measure.tree(f)])


def _null_vectors(forms: Sequence[Form], names: Mapping[Symbol | str, int], prime: int) -> list[list[int]]:
    """A basis of the vectors on which all forms vanish."""
    rows = {tuple(sorted((names[name], number_value(a, prime)) for name, a in form.items())) for form in forms}
    matrix = nmod_mat(len(rows) + 1, len(names), prime)
    for i, row in enumerate(sorted(rows)):
        for k, a in row:
            matrix[i, k] = a
    basis, nullity = matrix.nullspace()
    return [[int(basis[k, place]) for k in range(len(names))] for place in range(nullity)]
