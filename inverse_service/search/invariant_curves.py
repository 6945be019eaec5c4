"""Lagrangians for one coordinate x from a curve v = A(t, x) that the motion does not leave.

Then J = v - A has D(J) = K J along the motion, J is a Darboux factor, and M = E(t) x^s J^p is a
last multiplier if p K + s v/x + E'/E = -df/dv. There are two kinds of such curves:

- f is a polynomial in v with Laurent polynomials in x as coefficients, functions of t and constants
  being letters. A = a x^2 + b x + c has to satisfy A_t + A A_x = f(t, x, A), whose coefficients,
  from the highest power of x on, are algebraic equations for a, b, and c one after the other.
- f = h(t, x) J^r, where J = v - A has A_t + A A_x = 0 and A_x depends on t alone; p = -r, and
  (E'/E) = -r A_x.

With K_vv = M the Lagrangian is E x^s J^(p + 2)/((p + 1)(p + 2)) and a function of t and x. The
exponents may hold constants. Source: G. Darboux, 1878; for the quadratic A, "A partial
differential equation of Riccati", P. Painleve, E. L. Ince, 1926, chapter 14.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from inverse_service import bounds
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics import writing
from inverse_service.search import antiderivatives, material as mt, one_coordinate

# The coefficients of v^i x^k, functions of t and constants.
Laurent = dict[tuple[int, int], ex.Expression]
_HIGHEST = 2  # the degree of A in x


@dataclass(frozen=True, slots=True)
class Curve:
    """The multiplier exp(int rate dt) x^s (v - A)^p of x'' = f; `slope` is dU/dx over E x^s in L =
    K + U, where that is not 0.
    """

    curve: ex.Expression
    p: ex.Expression
    s: ex.Expression
    rate: ex.Expression
    slope: ex.Expression


def applies(material: mt.Material) -> bool:
    """Whether f is short, and L may contain t if f does."""
    system = material.analysis.system
    size = max(map(ex.node_count, system.accelerations))
    return one_coordinate.applies(material) and size <= bounds.SHOWN


def propose(material: mt.Material, seed: int) -> Sequence[ex.Expression]:
    """The Lagrangians of the first curve that has a multiplier."""
    with suppress(tm.TooManyTerms, exact_field.TooLarge, ZeroDivisionError):
        for curve in curves(material):
            found = _lagrangian_of(material, curve)
            if found is not None:
                return [found]
    return []


def curves(material: mt.Material) -> Iterator[Curve]:
    """The curves that have a multiplier."""
    yield from _from_a_power(material)
    yield from _from_polynomials(material)


def _simple(tree: ex.Expression) -> ex.Expression:
    """The quotient in lowest terms; 0 if it vanishes."""
    return writing.quotient(tree, exact_field.Budget.short())


# Powers of a linear form.


def _from_a_power(material: mt.Material) -> Iterator[Curve]:
    """f = h(t, x) J^r with a constant r that is no positive integer."""
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    match one_coordinate.moving_factors(material):
        case [(base, r)]:
            pass
        case _:
            return
    lead = calculus.differentiate(base, v)
    if ex.holds(r, ex.TIME, x, v) or ex.holds(lead, v):
        return
    curve = _simple(ex.negated(ex.substitute(base, {v: ex.ZERO})) / lead)
    along, in_time = (calculus.differentiate(curve, q) for q in (x, ex.TIME))
    rate = _simple(ex.negated(r) * along)
    if (
        ex.holds(rate, x)
        or not real_branch.vanishes(in_time + curve * along)
        or r in (ex.ONE, ex.number(2))
    ):
        return
    force = material.analysis.system.accelerations[0] / base**r * lead**r
    yield Curve(curve, ex.negated(r), ex.ZERO, rate, force)


# Polynomials.


def _from_polynomials(material: mt.Material) -> Iterator[Curve]:
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    f = _laurent_of(tm.tree_of(material.motion.forces[0]), x, v)
    if f is None or min(i for i, _ in f) < 0:
        return
    for curve in _curves(_tree_of(f, x, v), x, v):
        found = _multiplier(f, curve, x, v)
        if found is not None:
            yield found


def _laurent_of(tree: ex.Expression, x: ex.Expression, v: ex.Expression) -> Laurent | None:
    """The coefficients, if the tree is such a polynomial and is not 0."""
    found: dict[tuple[int, int], tm.Terms] = {}
    for key, value in tm.terms_of(tree).items():
        rest = frozenset((p, e) for p, e in key if p not in (x, v))
        i, k = tm.exponent_of(key, v), tm.exponent_of(key, x)
        if i.denominator > 1 or k.denominator > 1 or tm.depends_on([rest], x, v):
            return None
        part = found.setdefault((int(i), int(k)), {})
        part[rest] = part.get(rest, Fraction(0)) + value
    trees = {place: _simple(tm.tree_of(terms)) for place, terms in found.items()}
    return {place: c for place, c in trees.items() if c != ex.ZERO} or None


def _tree_of(
    terms: Mapping[tuple[int, int], ex.Expression], x: ex.Expression, v: ex.Expression
) -> ex.Expression:
    return ex.add(*(c * v**i * x**k for (i, k), c in terms.items()))


def _curves(f: ex.Expression, x: ex.Expression, v: ex.Expression) -> Iterator[ex.Expression]:
    """The A = a x^2 + b x + c, not 0, with A_t + A A_x = f(t, x, A) that algebra finds."""
    unknown = [ex.Symbol(f"_a{k}") for k in range(_HIGHEST + 1)]
    rates = [ex.Symbol(f"_b{k}") for k in range(_HIGHEST + 1)]

    def solved(known: Mapping[int, ex.Expression]) -> Iterator[ex.Expression]:
        parts = {k: known.get(k, unknown[k]) for k in range(_HIGHEST + 1)}
        curve = ex.add(*(c * x**k for k, c in parts.items()))
        moved = [
            calculus.differentiate(known[k], ex.TIME) if k in known else rates[k] for k in parts
        ]
        in_time = ex.add(*(c * x**k for k, c in enumerate(moved)))
        rest = in_time + curve * calculus.differentiate(curve, x) - ex.substitute(f, {v: curve})
        equations = _laurent_of(rest, x, v) or {}
        if not equations:
            yield ex.substitute(curve, dict.fromkeys(unknown, ex.ZERO))
            return
        first = equations[max(equations, key=lambda place: place[1])]
        held = [k for k in parts if ex.holds(first, unknown[k], rates[k])]
        if not held:
            return
        highest = max(held)
        values: list[ex.Expression] = [
            ex.ZERO
        ]  # of a differential equation the simplest solution alone is tried
        if len(held) == 1 and not ex.holds(first, *rates):
            values = _roots(first, unknown[highest])
        for value in values:
            yield from solved({**known, highest: value})

    for curve in dict.fromkeys(solved({})):
        if curve != ex.ZERO:
            yield curve


def _roots(tree: ex.Expression, unknown: ex.Symbol) -> list[ex.Expression]:
    """The roots of the linear factors of a polynomial, other than 0 first."""
    found = []
    for base, _ in ex.powers_of(antiderivatives.factored_tree(tree, [unknown])):
        slope = calculus.differentiate(base, unknown)
        if slope != ex.ZERO and not ex.holds(slope, unknown):
            found.append(_simple(ex.negated(ex.substitute(base, {unknown: ex.ZERO})) / slope))
    return sorted(dict.fromkeys(found), key=lambda root: root == ex.ZERO)


def _divided(f: Laurent, curve: ex.Expression, x: ex.Expression, v: ex.Expression) -> Laurent:
    """K = (f - A_t - v A_x)/(v - A), without the remainder, which is 0."""
    in_time, along = (calculus.differentiate(curve, q) for q in (ex.TIME, x))
    degree = max(1, *(i for i, _ in f))
    parts = [
        ex.add(*(c * x**k for (i, k), c in f.items() if i == power)) for power in range(degree + 1)
    ]
    parts[0], parts[1] = parts[0] - in_time, parts[1] - along
    total: ex.Expression = ex.ZERO
    last: ex.Expression = ex.ZERO
    for power in range(degree, 0, -1):
        last = parts[power] + curve * last
        total = total + last * v ** (power - 1)
    return _laurent_of(total, x, v) or {}


def _multiplier(
    f: Laurent, curve: ex.Expression, x: ex.Expression, v: ex.Expression
) -> Curve | None:
    """The exponents, if there are any."""
    cofactor = _divided(f, curve, x, v)
    slope = {(i - 1, k): ex.number(i) * c for (i, k), c in f.items() if i}
    free = {(0, 0), (1, -1)}
    wanted = [place for place in {**cofactor, **slope} if place not in free]
    if any(place not in cofactor for place in wanted):
        return None
    p: ex.Expression = ex.number(-2)
    for place in wanted[:1]:
        p = _simple(ex.negated(slope.get(place, ex.ZERO)) / cofactor[place])

    def left(place: tuple[int, int]) -> ex.Expression:
        return _simple(ex.negated(slope.get(place, ex.ZERO)) - p * cofactor.get(place, ex.ZERO))

    s, rate = left((1, -1)), left((0, 0))
    if (
        p == ex.ZERO
        or ex.holds(p, ex.TIME)
        or ex.holds(s, ex.TIME)
        or any(left(place) != ex.ZERO for place in wanted)
    ):
        return None
    force = _slope_of_potential(_tree_of(cofactor, x, v), curve, (p, s, rate), (x, v))
    return None if force is None else Curve(curve, p, s, rate, force)


def _slope_of_potential(
    cofactor: ex.Expression,
    curve: ex.Expression,
    exponents: tuple[ex.Expression, ex.Expression, ex.Expression],
    names: tuple[ex.Expression, ex.Expression],
) -> ex.Expression | None:
    """b(t, x) with dU/dx = E x^s b, since E_x(K) = E x^s J^(p + 1) B is free of v; None if it is
    not.

    B = K + (s v/x + E'/E + A_x - s J/(x (p + 2)))/(p + 1), without the last term if p = -2, where s
    = 0, and K + s J/x if p = -1.
    """
    (p, s, rate), (x, v) = exponents, names
    factor = v - curve
    if p == ex.number(-1):
        power, rest = 0, cofactor + s * factor / x
    else:
        inner = s * v / x + rate + calculus.differentiate(curve, x)
        if p != ex.number(-2):
            inner = inner - s * factor / (x * (p + 2))
        elif s != ex.ZERO:
            return None
        power, rest = -1, cofactor + inner / (p + 1)
    parts = _laurent_of(rest, x, v) or {}
    if power:
        if not parts:
            return ex.ZERO
        if not isinstance(p, ex.Number) or p.value.denominator > 1 or p.value >= 0:
            return None
        power = int(-p.value) - 1
    lead = ex.add(*(c * x**k for (i, k), c in parts.items() if i == power))
    remainder = _tree_of(parts, x, v) - lead * factor**power
    return lead if _laurent_of(remainder, x, v) is None else None


def _lagrangian_of(material: mt.Material, found: Curve) -> ex.Expression | None:
    """K + U with named integrals where others are not known; None if the multiplier holds t and L
    may not.
    """
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    system, point = material.analysis.system, material.analysis.real_point
    integrator = antiderivatives.Integrator(system, point, integral_signs=True)
    logarithm = integrator.function_of([ex.TIME], [tm.terms_of(found.rate)])
    if logarithm is None:
        return None
    factor = tm.tree_of(integrator.exponential(logarithm)) * x**found.s
    base, p, sign = v - found.curve, found.p, 1
    positive = mt.positive_form(base, point)
    if p == ex.number(-2):
        kinetic = ex.negated(factor * ex.Apply("log", positive))
    elif p == ex.number(-1):
        kinetic = factor * base * (ex.Apply("log", positive) - 1)
    else:
        kinetic = factor * positive ** (p + 2) / ((p + 1) * (p + 2))
        if positive != base and found.slope != ex.ZERO:
            if not isinstance(p, ex.Number) or p.value.denominator > 1:
                return None
            sign = 1 if p.value % 2 == 0 else -1
    whole = kinetic
    if found.slope != ex.ZERO:
        potential = integrator.function_of([x], [tm.terms_of(sign * factor * found.slope)])
        if potential is None:
            return None
        whole = kinetic + tm.tree_of(potential)
    return None if not material.motion.question.timed and ex.holds(whole, ex.TIME) else whole
