"""The search for linear relations among atoms, which makes the rules of a tower.

Atoms are taken innermost first. For each transcendental one the linear dependence over Q of its
argument (exp, angles) or its logarithmic differential (log, atan) on those before it is computed at
random points modulo a prime; rational coefficients are reconstructed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import HALF, PI, Apply, Expression, Number, Power, Product, distinct_nodes
from inverse_service.field.elementary import is_even_root, is_root
from inverse_service.field.modular import prime_factors, reconstruct
from inverse_service.field.point import Point, Variable, evaluate, number_value, variables_in
from inverse_service.field.rules import (
    RADIAN,
    AngleRule,
    ArctangentRule,
    Combination,
    ExponentialRule,
    LogarithmRule,
    Rule,
    replay,
)
from inverse_service.field.tower import IrrationalRatio, Samples, Tower, atoms_in_order, draw_point
from inverse_service.field.truncated_series import SingularPoint

_CONSTANT_BOUND = 10**8
_MOST_PARTS = 5040
# (atom, sum a_j u_j, constants) -> atom - sum at a real point, in pi and the constants.
Turns = Callable[[Expression, Combination, Sequence[Expression]], Combination | None]


def build_tower(
    expressions: Sequence[Expression],
    variables: Sequence[Variable],
    real_signs: Mapping[Variable, int],
    turns: Turns,
    known: Tower | None = None,
) -> Tower:
    """The tower of all atoms in `expressions` (in kernels); IrreducibleAtoms where it can't be settled.

    `known` is an earlier tower of the same expressions whose branches are fixed: its signs hold
    from the first point on at which they have a meaning.
    """
    names = (*variables, PI) if _needs_pi(expressions) else tuple(variables)
    tower = Tower(names, real_signs, residues=_root_primes(expressions), parts_of_pi=_parts_of_pi(expressions))
    samples = Samples(tower)
    if known is not None:
        tower.scales, tower.default_scale = dict(known.scales), 1
        samples.pending = [*known.signs, *((radicand, 1) for radicand in known.radicands)]
    try:
        for atom in atoms_in_order(expressions):
            samples.admit_pending()
            if is_root(atom):
                _admit_root(atom, tower, samples)
            else:
                _admit(atom, tower, samples, turns)
    except SingularPoint as problem:
        raise IrreducibleAtoms("a denominator inside a function vanishes at the points tried") from problem
    _finish_scales(tower)
    samples.admit_pending()
    if samples.pending or not all(tower.values_all(p) for p, _ in tower.signs):
        raise IrreducibleAtoms("the branches of roots and the relations among angles could not be settled together")
    return tower


def _needs_pi(expressions: Sequence[Expression]) -> bool:
    """Whether pi occurs, or may: two arctangents often differ by a part of pi."""
    nodes = distinct_nodes(expressions)
    return any(node == PI or (isinstance(node, Apply) and node.function == "atan") for node in nodes)


def _parts_of_pi(expressions: Sequence[Expression]) -> int:
    """The common denominator of the fractions of pi that are written."""
    found = [f.value.denominator for node in distinct_nodes(expressions) if isinstance(node, Product)
             and PI in node.factors for f in node.factors if isinstance(f, Number)]  # fmt: skip
    whole = math.lcm(*found)
    return whole if whole <= _MOST_PARTS else 1


def _root_primes(expressions: Sequence[Expression]) -> frozenset[int]:
    """The primes that occur in numbers under even roots."""
    found: set[int] = set()
    for node in distinct_nodes(expressions):
        if is_even_root(node) and isinstance(node, Power) and isinstance(node.base, Number):
            value = node.base.value
            if value > 0:
                found.update(ell for k in (value.numerator, value.denominator) for ell, _ in prime_factors(k))
    return frozenset(ell for ell in found if ell > 13)


def _admit_root(atom: Expression, tower: Tower, samples: Samples) -> None:
    assert isinstance(atom, Power)
    if not is_even_root(atom):
        return
    if isinstance(atom.base, Number) and atom.base.value <= 0:
        raise IrreducibleAtoms("an even root of a negative number is not real")
    if atom.base not in tower.radicands and not isinstance(atom.base, Number):
        tower.radicands.append(atom.base)
        samples.points.clear()


def _admit(atom: Expression, tower: Tower, samples: Samples, turns: Turns) -> None:
    assert isinstance(atom, Apply)
    if atom.function in ("sin", "cos") and any(
        isinstance(rule, AngleRule) and rule.angle == atom.argument for rule in tower.rules
    ):
        return
    samples.ensure(len(tower.rules) + 4)
    work = {"exp": _exponential_rule, "log": _logarithm_rule, "atan": _arctangent_rule}.get(atom.function, _angle_rule)
    try:
        rule = work(atom, tower, samples, turns)
    except IrrationalRatio:
        samples.flips = _square_roots(atom.argument, *(u for kind in _KINDS for u in _free(tower, kind)))
        if not samples.flips:
            raise
        samples.points.clear()
        samples.ensure(len(tower.rules) + 4)
        rule = work(atom, tower, samples, turns)
        samples.flips = ()
        samples.points.clear()
    samples.ensure(len(tower.rules) + 4)
    tower.rules.append(rule)
    if isinstance(rule, AngleRule) and any(a.denominator > 1 for _, a in rule.arctangents):
        samples.points.clear()  # not every angle has such a part
    for point in samples.points:
        replay(rule, point, tower.scale)


_KINDS: tuple[type[Rule], ...] = (ExponentialRule, LogarithmRule, AngleRule, ArctangentRule)


def _square_roots(*trees: Expression) -> tuple[int, ...]:
    """The primes under square roots of numbers, where no other roots of constants occur."""
    found: dict[int, None] = {}
    for node in distinct_nodes(trees):
        if not is_root(node) or not isinstance(node, Power) or variables_in(node):
            continue
        base, exponent = node.base, node.exponent
        if not (isinstance(base, Number) and isinstance(exponent, Number) and exponent.value.denominator == 2):
            return ()
        found |= {ell: None for k in base.value.as_integer_ratio() for ell, _ in prime_factors(k)}
    return tuple(found)[:3]


def _free(tower: Tower, kind: type[Rule]) -> list[Expression]:
    """The free atoms (for angles: the angles) of a kind."""
    return [
        rule.angle if isinstance(rule, AngleRule) else rule.atom
        for rule in tower.rules
        if isinstance(rule, kind) and rule.free
    ]


def _logarithm_primes(tower: Tower) -> list[int]:
    constants = [rule.constant for rule in tower.rules if isinstance(rule, LogarithmRule)]
    return sorted({ell for c in constants for k in (c.numerator, c.denominator) for ell, _ in prime_factors(k)})


def _exponential_rule(atom: Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    exponentials = _free(tower, ExponentialRule)
    logarithms = _free(tower, LogarithmRule)
    primes = _logarithm_primes(tower)
    samples.ensure(len(exponentials) + len(logarithms) + len(primes) + 1)
    columns = [samples.values(_argument(e)) for e in exponentials]
    columns += [samples.values(log) for log in logarithms]
    columns += [[point.draw(("log", ell)) for point in samples.points] for ell in primes]
    columns.append([1] * len(samples.points))
    solution = samples.solve(columns, samples.values(atom.argument))
    if solution is None:
        return ExponentialRule(atom, True)
    first, second = len(exponentials), len(exponentials) + len(logarithms)
    of_logs = tuple((_argument(log), c) for log, c in zip(logarithms, solution[first:second], strict=True) if c)
    for argument, c in of_logs:
        if c.denominator % 2 == 0:
            samples.require_positive(argument)
    return ExponentialRule(
        atom,
        False,
        tuple((e, a) for e, a in zip(exponentials, solution, strict=False) if a),
        of_logs,
        tuple((ell, a) for ell, a in zip(primes, solution[second:], strict=False) if a),
        solution[-1],
    )


def _logarithm_rule(atom: Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    if isinstance(atom.argument, Number):
        if atom.argument.value <= 0:
            raise IrreducibleAtoms("the logarithm of a number that is not positive is not real")
        return LogarithmRule(atom, False, (), atom.argument.value)
    basis = [_argument(e) for e in _free(tower, ExponentialRule)] + _free(tower, LogarithmRule)
    columns = [_flat(samples.gradients(u)) for u in basis]
    if not all(samples.values(atom.argument)):
        raise IrreducibleAtoms("the argument of a logarithm vanishes at the points tried")
    inverse = [pow(w, -1, samples.prime) for w in samples.values(atom.argument)]
    gradient = samples.gradients(atom.argument)
    target = [x * w % samples.prime for row, w in zip(gradient, inverse, strict=True) for x in row]
    solution = samples.solve(columns, target) if any(target) else [Fraction(0)] * len(columns)
    if solution is None:
        return LogarithmRule(atom, True)
    linear = tuple((u, a) for u, a in zip(basis, solution, strict=True) if a)
    constant, root = _constant_factor(atom, linear, samples)
    return LogarithmRule(atom, False, linear, constant, root)


def _constant_factor(
    atom: Apply, linear: Sequence[tuple[Expression, Fraction]], samples: Samples
) -> tuple[Fraction, int]:
    """kappa^root = w^root / prod (e^u_j)^(a_j root), a positive rational; else IrreducibleAtoms."""
    root = 2
    for _, a in linear:
        root *= a.denominator
    found = {
        reconstruct(_constant_power(atom, linear, root, point), point.prime, _CONSTANT_BOUND)
        for point in samples.points
    }
    constant = found.pop()
    # A second prime tells a rational number from another one that looks like it modulo the first.
    other = draw_point(samples.tower, 11)
    if found or constant is None or constant <= 0 or other.prime == samples.prime:
        raise IrreducibleAtoms("a logarithm of a constant that is no rational number cannot be reduced")
    if number_value(constant, other.prime) != _constant_power(atom, linear, root, other):
        raise IrreducibleAtoms("a logarithm of a constant that is no rational number cannot be reduced")
    return constant, root


def _constant_power(atom: Apply, linear: Sequence[tuple[Expression, Fraction]], root: int, point: Point) -> int:
    """w^root / prod (e^u_j)^(a_j root) at a point."""
    value = pow(evaluate(atom.argument, point), root, point.prime)
    for u, a in linear:
        base = point.atoms[Apply("exp", u)] if Apply("exp", u) in point.atoms else evaluate(_argument(u), point)
        value = value * pow(base, -int(a * root), point.prime) % point.prime
    return value


def _angle_rule(atom: Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    angles, arctangents = _free(tower, AngleRule), _free(tower, ArctangentRule)
    columns = [samples.values(u) for u in (*angles, *arctangents)]
    columns.append([1] * len(samples.points))
    if PI in tower.variables:
        columns.append(samples.values(PI))
    solution = samples.solve(columns, samples.values(atom.argument))
    if solution is None:
        return AngleRule(atom.argument, True)
    by_angle = tuple((u, a) for u, a in zip(angles, solution, strict=False) if a)
    rest = solution[len(angles) :]
    by_atan = tuple((u, a) for u, a in zip(arctangents, rest, strict=False) if a)
    for u, a in by_atan:
        for radicand in _radicands(_argument(u), a.denominator):
            samples.require_positive(radicand)
    turns_of_pi = rest[-1] if PI in tower.variables else Fraction(0)
    _refine_scales(tower, samples, (*by_angle, (RADIAN, rest[len(arctangents)])))
    return AngleRule(atom.argument, False, by_angle, by_atan, rest[len(arctangents)], turns_of_pi)


def _radicands(w: Expression, number: int) -> Iterator[Expression]:
    """What has a root where the number-th part of atan w is an angle: 1 + w^2, and for each half 1 + cos."""
    yield (square := 1 + w**2)
    cosine = square ** Fraction(-1, 2)
    while number % 2 == 0:
        yield (half := HALF * (1 + cosine))
        cosine, number = half ** Fraction(1, 2), number // 2


def _refine_scales(tower: Tower, samples: Samples, parts: Sequence[tuple[Expression, Fraction]]) -> None:
    """Free angles become fine enough to have these multiples; points with coarser ones are dropped."""
    for angle, factor in parts:
        scale = tower.scale(angle)
        if scale % factor.denominator:
            tower.scales[angle] = math.lcm(scale, factor.denominator)
            samples.points.clear()


def _arctangent_rule(atom: Apply, tower: Tower, samples: Samples, turns: Turns) -> Rule:
    columns = {u: _flat(samples.gradients(u)) for u in _free(tower, AngleRule) + _free(tower, ArctangentRule)}
    basis = [u for u, column in columns.items() if any(column)]
    constants = [u for u in _free(tower, ArctangentRule) if u not in basis]
    w = samples.values(atom.argument)
    factor = [pow(1 + x * x, -1, samples.prime) for x in w]
    gradient = samples.gradients(atom.argument)
    target = [x * k % samples.prime for row, k in zip(gradient, factor, strict=True) for x in row]
    solution = samples.solve([columns[u] for u in basis], target) if any(target) else [Fraction(0)] * len(basis)
    if solution is None:
        return ArctangentRule(atom, True)
    linear = tuple((u, a) for u, a in zip(basis, solution, strict=True) if a)
    rest = turns(atom, linear, constants)
    if rest is None and linear:
        raise IrreducibleAtoms(
            "an arctangent differs from others by a constant that is not known: write a letter for it"
        )
    if rest is None:
        return ArctangentRule(atom, True)  # a constant that no other one gives
    found = dict(rest)
    return ArctangentRule(atom, False, linear + tuple(p for p in rest if p[0] != PI), found.get(PI, Fraction(0)))


def _finish_scales(tower: Tower) -> None:
    """The coarsest free angles of which all others are whole multiples."""
    if tower.default_scale > 1:
        tower.scales.clear()
    for rule in tower.rules:
        if isinstance(rule, AngleRule):
            for angle, factor in rule.angles:
                tower.scales[angle] = math.lcm(tower.scales.get(angle, 1), factor.denominator)
            if rule.radians:
                tower.scales[RADIAN] = math.lcm(tower.scales.get(RADIAN, 1), rule.radians.denominator)
    tower.default_scale = 1


def _argument(atom: Expression) -> Expression:
    assert isinstance(atom, Apply)
    return atom.argument


def _flat(rows: Sequence[Sequence[int]]) -> list[int]:
    return [x for row in rows for x in row]
