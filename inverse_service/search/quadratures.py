"""Exponentials of integrals and potentials, with an integral sign where no elementary antiderivative is found.

What is left under an integral sign is one function of one variable where that is possible, constant factors outside.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from fractions import Fraction
from itertools import count

from inverse_service import bounds
from inverse_service.certificate.checker import check_certificate
from inverse_service.deadline import end, left, now
from inverse_service.decision.certify import of_lagrangian
from inverse_service.decision.deciding import Analysis, analyze
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.collecting_trees import merge_powers
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import (
    HALF,
    PI,
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Integral,
    Number,
    Power,
    Product,
    Symbol,
    Velocity,
    add,
    holds,
    multiply,
    negated,
    rebuild,
    substitute,
    walk,
)
from inverse_service.field.exact_ring import ExactRing
from inverse_service.field.rational_functions import Quotient, TooLarge
from inverse_service.field.real_point import RealTable, is_defined, real_sign
from inverse_service.mechanics.potential import Potential
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.mechanics.writing import joined, readable
from inverse_service.search.completion import completed
from inverse_service.search.one_coordinate.algebra import shortest
from inverse_service.search.terms import Monomial, Terms, TooManyTerms, monomial_tree, terms_of, tree_of

_NAMES = ("F", "G", "H", "K", "P", "Q", "S", "U", "W", "Z")


def exponential(ring: ExactRing, logarithm: Potential, table: RealTable | None) -> Expression:
    """exp(phi) with bases that are positive at the real point; factors to the same power are one base."""
    bases: dict[Expression, Quotient] = {}
    for value, element in logarithm.logarithms:
        exponent = readable(ring, value)
        bases[exponent] = bases.get(exponent, ring.constant(1)) * element
    factors = []
    for exponent, element in bases.items():
        tree = shortest(readable(ring, element), [])
        factors.append((tree if table is None or real_sign(tree, table) > 0 else negated(tree)) ** exponent)
    rest = logarithm.rest
    return multiply(*factors, *([] if rest.is_zero else [Apply("exp", readable(ring, rest))]))


def exponential_of_integral(slope: Expression, variable: Expression, analysis: Analysis) -> Expression:
    """exp(int slope dx) for a slope that holds no other variable."""
    found = _elementary_factors(slope, variable, analysis)
    if found is not None:
        return multiply(*found)
    integral = Integral(next(fresh_names(analysis.system)), (variable,), (0,), (slope,))
    return Apply("exp", integral)


def _elementary_factors(slope: Expression, variable: Expression, analysis: Analysis) -> list[Expression] | None:
    """Factors of exp(int slope dx), powers for the logarithms; None where no elementary antiderivative is found."""
    found = antiderivative(analysis.system, slope, variable, analysis.real_point)
    if found is None:
        return None
    powers: dict[Expression, list[Expression]] = {}
    rest: Terms = {}
    for key, value in terms_of(found).items():
        logarithm = next((p for p, e in key if isinstance(p, Apply) and p.function == "log" and e == 1), None)
        others = key - {(logarithm, Fraction(1))} if logarithm else key
        if logarithm and not any(holds(p, variable) for p, _ in others):
            powers.setdefault(logarithm.argument, []).append(tree_of({others: value}))
        else:
            rest[key] = value
    table = analysis.real_point
    factors = [
        (base if table is None or real_sign(base, table) > 0 else negated(base)) ** add(*exponents)
        for base, exponents in powers.items()
    ]
    return [*factors, *([Apply("exp", tree_of(rest))] if rest else [])]


def antiderivative(
    system: SecondOrderSystem, slope: Expression, variable: Expression, table: RealTable | None
) -> Expression | None:
    """An elementary one of a formula in one variable; None where none is found. SymPy is asked last."""
    names = fresh_names(system, slope)
    letter, inner = Symbol(next(names)), Symbol(next(names))
    plain = joined(substitute(slope if table is None else real_form(slope, table), {variable: letter}))
    forms = [(plain, letter, letter), *((form, inner, w) for form, w in _substitutions(plain, letter, inner))]
    for form, name, meant in forms:
        with suppress(TooManyTerms, TooLarge, ZeroDivisionError):
            found = completed([name.name], [terms_of(form)])
            if found is not None:
                return -substitute(substitute(found, {name: meant}), {letter: variable})
    if not table or variable not in table:
        return None
    place = {**table, letter: table[variable]}
    for form, name, meant in reversed(forms):
        with suppress(NoRealValue):
            known = _by_sympy(form, name, {**place, name: evaluate(meant, place)})
            if known is not None:
                return substitute(substitute(known, {name: meant}), {letter: variable})
    return None


def _substitutions(slope: Expression, x: Symbol, inner: Symbol) -> Iterator[tuple[Expression, Expression]]:
    """(g, w) with slope = g(w(x)) w'(x) for w = x^2 and the functions of x that occur, g in the letter `inner`."""
    functions = dict.fromkeys(node for node in walk(slope) if isinstance(node, Apply) and x in walk(node))
    for w in (x**2, *functions):
        outer = merge_powers(slope / differentiate(w, x))
        table: dict[Expression, Expression] = {w: inner}
        if isinstance(w, Power):
            exponents = {
                node: node.exponent.value / 2
                for node in walk(outer)
                if isinstance(node, Power) and node.base == x and isinstance(node.exponent, Number)
            }
            table = {node: inner**half for node, half in exponents.items() if half.denominator == 1}
        form = substitute(outer, table)
        if x not in walk(form):
            yield form, w


class _TimeIsUp(BaseException):
    """No Exception, so that no handler between catches it."""


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    """Ends the calls within by _TimeIsUp, also those of a library that knows no deadlines."""
    moment, calls = min(now() + seconds, end()), count()

    def stop(*_: object) -> None:
        if next(calls) % _CALLS == 0 and now() > moment:
            raise _TimeIsUp

    before = sys.getprofile()
    sys.setprofile(stop)
    try:
        yield
    finally:
        sys.setprofile(before if callable(before) else None)  # that of cProfile cannot be set again


# For SymPy, in s of processor time: most integrals that it finds take a tenth of that. Higher numbers are not asked.
_SECONDS, _HIGHEST = 2.5, 12
_CALLS = 500  # between two looks at the time
# What was asked for the whole time in vain: parts of a potential come again and again in one search.
_VAIN: set[tuple[Expression, frozenset[tuple[Symbol, int]]]] = set()
_MOST_VAIN = 256


def _by_sympy(slope: Expression, variable: Symbol, table: RealTable) -> Expression | None:
    """SymPy's antiderivative where it is elementary, real at the point, and its derivative is the slope."""
    nodes = list(walk(slope))
    high = any(isinstance(node, Number) and abs(node.value) > _HIGHEST for node in nodes)
    if high or len(nodes) > bounds.NODES or any(isinstance(node, Arbitrary | Velocity) for node in nodes):
        return None
    from inverse_service.reading.sympy_trees import elementary_antiderivatives

    signs = {node: 1 if table[node] > 0 else -1 for node in nodes if isinstance(node, Symbol)}
    question, most = (slope, frozenset(signs.items())), end() - now()
    if question in _VAIN:
        return None
    found: list[Expression] = []
    with suppress(_TimeIsUp), _at_most(_SECONDS):
        for tree in elementary_antiderivatives(slope, variable, signs):
            found = [real for real in (real_form(tree, table),) if is_defined([real], table)]
            if found:
                break
    if not found and most > _SECONDS and len(_VAIN) < _MOST_VAIN:
        _VAIN.add(question)
    return next((tree for tree in found if _has_slope(tree, slope, variable, table)), None)


def real_form(tree: Expression, table: RealTable) -> Expression:
    """The tree as it is real at the point: log(-u) for log(u) where u < 0, sqrt(-u)*sqrt(-w) for sqrt(u)*sqrt(w).

    The first changes it by a constant. In the second sqrt(u)*sqrt(w) stands for sqrt(u*w), whole powers of u beside.
    """
    if is_defined([tree], table):
        return tree
    with suppress(NoRealValue, IrreducibleAtoms):
        return _turned(tree, table)
    return tree


def _turned(tree: Expression, table: RealTable) -> Expression:
    tree = rebuild(tree, lambda part: _turned(part, table))
    if isinstance(tree, Integral):
        return replace(tree, slopes=tuple(slope and _turned(slope, table) for slope in tree.slopes))
    if isinstance(tree, Apply) and tree.function == "log" and real_sign(tree.argument, table) < 0:
        return Apply("log", negated(tree.argument))
    factors = tree.factors if isinstance(tree, Product) else ()
    halves: dict[Expression, Expression] = {
        factor: negated(factor.base) ** factor.exponent * (-1) ** (math.floor(factor.exponent.value) % 2)
        for factor in factors
        if isinstance(factor, Power)
        and isinstance(factor.exponent, Number)
        and factor.exponent.value.denominator == 2
        and real_sign(factor.base, table) < 0
    }
    is_real = halves and len(halves) % 2 == 0
    return multiply(*(halves.get(factor, factor) for factor in factors)) if is_real else tree


def _has_slope(tree: Expression, slope: Expression, x: Symbol, table: RealTable) -> bool:
    """Whether d tree/dx = slope about the point: the checker says that x'^2/2 + tree is a Lagrangian of x'' = slope."""
    velocity = Velocity(x.name)
    symbols = dict.fromkeys(node for node in walk(slope) if isinstance(node, Symbol))
    constants = (node.name for node in symbols if node not in (x, TIME, PI))
    system = SecondOrderSystem((x.name,), (slope,), tuple(constants))
    try:
        analysis = replace(analyze(system), real_point={TIME: table[x], **table, velocity: table[x]})
        certificate = of_lagrangian(analysis, HALF * velocity**2 + tree, with_time=True)
    except IrreducibleAtoms:
        return False
    return check_certificate(certificate, time_limit=left(end())).verdict == "valid"


def potential_with_integrals(
    system: SecondOrderSystem, phi: Expression, wanted: Terms, table: RealTable | None
) -> Expression | None:
    """-V(t, x) with dV/dx = wanted for one coordinate x; None where that holds a velocity."""
    x = Symbol(system.coordinates[0])
    if any(isinstance(node, Velocity) for key in wanted for letter, _ in key for node in walk(letter)):
        return None
    fresh = fresh_names(system, phi)
    groups: dict[Monomial, Terms] = {}
    for key, value in wanted.items():
        own: Monomial = frozenset(item for item in key if holds(item[0], x))
        groups.setdefault(own, {})[key - own] = value
    total: list[Expression] = []
    for own, outside in groups.items():
        rest = antiderivative(system, monomial_tree(own), x, table)
        if rest is None:
            rest = _integral(monomial_tree(own), x, next(fresh))
        total.append(tree_of(outside) * (-rest))
    return add(*total)


def _integral(slope: Expression, x: Symbol, name: str) -> Integral:
    """The integral over x of a formula that may also hold t, whose derivative by t is then left open."""
    if holds(slope, TIME):
        return Integral(name, (TIME, x), (0, 0), (None, slope))
    return Integral(name, (x,), (0,), (slope,))


def fresh_names(system: SecondOrderSystem, *trees: Expression) -> Iterator[str]:
    """Names of functions that nothing else bears."""
    used = {*system.coordinates, *system.parameters, *dict(system.functions)}
    used |= {node.name for tree in trees for node in walk(tree) if isinstance(node, Arbitrary)}
    yield from (name for name in _NAMES if name not in used)
    yield from (f"F_{k}" for k in range(1, 1_000) if f"F_{k}" not in used)
