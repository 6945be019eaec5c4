"""What a nonholonomic motion keeps: an invariant measure with a density N(q), and scaled
velocities.

Distributions of vector fields on (t, q): brackets, Frobenius, and the equations X_k(phi) = h_k. A
row is the components of a field in the variables (t or not, then q), followed by the value h that a
function phi is to have along it; h = 0 where only the distribution matters.

Constraints on velocities may be constraints on positions in disguise (Frobenius). The distribution
of the constraints is closed under brackets; k constraints of which j survive as the annihilator of
the closure are j holonomic ones and k
- j nonholonomic ones. Constraints with a velocity-free term or with t are treated on (t, q), with
  the field d/dt +
drift.

The logarithm of N is a function with a given differential: a sum of logarithms and simple terms
(`potential`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations
from typing import Literal

import flint

from inverse_service import bounds
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions import calculus, tree as ex
from inverse_service.expressions.polynomials import as_fraction
from inverse_service.field import matrices, real_branch
from inverse_service.field.exact_field import ExactRing, Exponents, Quotient, sum_of
from inverse_service.mechanics.constrained_motion import EliminatedMotion, Frame, Geometry
from inverse_service.mechanics.first_integrals import FirstIntegral
from inverse_service.mechanics.writing import joined, readable, turned

Partial = Callable[[Quotient], Quotient]
Field = tuple[Quotient, ...]
Status = Literal["found", "does_not_exist", "not_found"]


@dataclass(frozen=True, slots=True)
class Potential:
    """phi = sum of coefficient * log(element) + rest, the coefficients constant."""

    logarithms: tuple[tuple[Quotient, Quotient], ...]
    rest: Quotient

    def exponential(self, ring: ExactRing) -> ex.Expression:
        """exp(phi) as a tree."""
        factors = [
            turned(readable(ring, element)) ** readable(ring, value)
            for value, element in self.logarithms
        ]
        if not self.rest.is_zero:
            factors.append(ex.Apply("exp", readable(ring, self.rest)))
        return joined(ex.multiply(*factors))

    def tree(self, ring: ExactRing) -> ex.Expression:
        """phi as a tree."""
        logs = [
            readable(ring, value) * ex.Apply("log", readable(ring, e))
            for value, e in self.logarithms
        ]
        return ex.add(*logs, readable(ring, self.rest))

    def plus_logarithm(self, factors: Sequence[tuple[Fraction, Quotient]]) -> Potential:
        """phi + sum of coefficient * log(element), equal elements put together."""
        table = list(self.logarithms)
        for exponent, element in factors:
            value = element.field.constant(exponent)
            for place, (known, other) in enumerate(table):
                if other.numerator == element.numerator:
                    table[place] = (known + value, other)
                    break
            else:
                table.append((value, element))
        return Potential(
            tuple((value, element) for value, element in table if not value.is_zero), self.rest
        )

    def made_positive(self, ring: ExactRing, table: real_branch.RealTable | None) -> Potential:
        """The same function up to a constant with positive arguments of the logarithms at a real
        point.
        """
        if table is None:
            return self
        pairs = ((c, readable(ring, element), element) for c, element in self.logarithms)
        kept = tuple(
            (c, -element if _is_negative(tree, table) else element) for c, tree, element in pairs
        )
        return Potential(kept, self.rest)


def _is_negative(tree: ex.Expression, table: real_branch.RealTable) -> bool:
    try:
        return real_branch.real_sign(tree, table) < 0
    except (calculus.NoRealValue, IrreducibleAtoms):
        return False


def potential(
    ring: ExactRing, variables: Sequence[int], form: Sequence[Quotient]
) -> Potential | None:
    """phi with d phi / d variables[i] = form[i], found among logarithms of denominators and simple
    terms.

    `variables` are indices of variables of the ring. None where no phi of this kind exists.
    """
    if all(slope.is_zero for slope in form):
        return Potential((), ring.constant(0))
    partials: list[Partial] = [ring.partial(index) for index in variables]
    places = sorted({index for slope in form for index, _ in slope.exponents})
    divisors = [Quotient(ring.field, ring.field.denominators[place], ()) for place in places]
    columns = [[partial(element) / element for partial in partials] for element in divisors]
    # Residues that contain symbols are searched among logarithms only: with all terms the
    # elimination would be long.
    simple: list[Quotient] = []
    found = _combination(ring, columns, form)
    if found is None:
        simple = _simple_terms(ring, variables, form)[: bounds.SMALL]
        found = _combination(
            ring, [*columns, *([partial(term) for partial in partials] for term in simple)], form
        )
    if found is None:
        return None
    logs = tuple(
        (value, element)
        for value, element in zip(found, divisors, strict=False)
        if not value.is_zero
    )
    rest = ring.constant(0)
    for value, term in zip(found[len(divisors) :], simple, strict=True):
        rest = rest + term * value
    return Potential(logs, rest)


def _simple_terms(
    ring: ExactRing, variables: Sequence[int], form: Sequence[Quotient]
) -> list[Quotient]:
    """For each term of each slope: itself, times the variable, and with one function changed for
    another.
    """
    functions = [
        index for index, tree in ring.trees.items() if isinstance(tree, ex.Apply | ex.Arbitrary)
    ]
    found: dict[tuple[tuple[int, ...], Exponents], Quotient] = {}
    for variable, slope in zip(variables, form, strict=True):
        own = next(
            index for index, known in ring.trees.items() if known == ring.variables[variable]
        )
        for exponents, _ in slope.numerator.terms():
            base = [int(e) for e in exponents]
            for key in itertools.product(
                map(tuple, _changes(ring, base, own, functions)), _lowered(slope.exponents)
            ):
                if key not in found:
                    numerator = ring.field.reduce(
                        ring.field.context.from_dict({key[0]: flint.fmpq(1)})
                    )
                    found[key] = ring.field.quotient(numerator, key[1])
    varying = [term for term in found.values() if term.constant_value is None]
    return [
        term
        for term in varying
        if not any(term.numerator.degrees()[index] for index in ring.undefined)
    ]


def _lowered(exponents: Exponents) -> list[Exponents]:
    """The exponents of a denominator, and those with one multiple factor less: 1/p^2 comes from
    1/p.
    """
    less = [
        tuple((place, power - (place == chosen)) for place, power in exponents)
        for chosen, multiple in exponents
        if multiple > 1
    ]
    return [exponents, *less]


def _changes(
    ring: ExactRing, base: list[int], own: int, functions: Sequence[int]
) -> list[list[int]]:
    changes = [list(base), [e + (k == own) for k, e in enumerate(base)]]
    for old in functions:
        if base[old]:
            others = [
                new
                for new in functions
                if new != old and _is_related(ring.trees[new], ring.trees[old])
            ]
            changes += [[e - (k == old) + (k == new) for k, e in enumerate(base)] for new in others]
    return changes


def _is_related(primitive: ex.Expression, slope: ex.Expression) -> bool:
    """Whether the one may be, up to a factor, a derivative of the other: sin and cos of one angle,
    A and A'.
    """
    match primitive, slope:
        case [ex.Apply(_, inner), ex.Apply(_, outer)]:
            return inner == outer
        case [ex.Arbitrary(name, arguments, low), ex.Arbitrary(other, others, high)]:
            return name == other and arguments == others and sum(low) + 1 == sum(high)
        case _:
            return False


def _combination(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]], target: Sequence[Quotient]
) -> list[Quotient] | None:
    """Constant c with sum c_k columns[k] = target, rational where that will do; None if there is
    none.
    """
    vector = next(rational_null_vectors(ring, [*columns, target]), None)
    if vector is not None and vector[-1]:
        return [ring.constant(-value) for value in vector[:-1]]
    return matrices.solution(ring, columns, target) if len(columns) <= bounds.COLUMNS else None


def rational_null_vectors(
    ring: ExactRing, columns: Sequence[Sequence[Quotient]]
) -> Iterator[list[Fraction]]:
    """A basis of the rational c with sum_k c_k columns[k] = 0, entry by entry.

    Each has a 1 in a column that depends on those before it, the last such column first, and 0 in
    the others of them.
    """
    rows: dict[tuple[int, tuple[int, ...]], dict[int, Fraction]] = {}
    for place, entries in enumerate(zip(*columns, strict=True)):
        for k, numerator in enumerate(matrices.numerators(ring, entries)):
            for exponents, coefficient in numerator.terms():
                rows.setdefault((place, tuple(int(e) for e in exponents)), {})[k] = as_fraction(
                    coefficient
                )
    table = [[row.get(k, Fraction(0)) for k in range(len(columns))] for row in rows.values()]
    yield from reversed(matrices.kernel(table, len(columns)))


def powers_of_factors(ring: ExactRing, element: Quotient) -> list[tuple[Fraction, Quotient]]:
    """(exponent, polynomial) with element = constant * product of polynomial^exponent."""
    _, powers = ring.field.denominator_powers(element.numerator)
    table: dict[int, Fraction] = {index: Fraction(exponent) for index, exponent in powers}
    for index, exponent in element.exponents:
        table[index] = table.get(index, Fraction(0)) - exponent
    pairs = [
        (e, Quotient(ring.field, ring.field.denominators[index], ()))
        for index, e in table.items()
        if e
    ]
    partials = [
        ring.partial(k) for k in range(len(ring.variables))
    ]  # a parameter is constant in t, q and v
    return [(e, element) for e, element in pairs if not all(by(element).is_zero for by in partials)]


@dataclass(frozen=True, slots=True)
class Closure:
    """The smallest involutive distribution that holds some fields.

    `rows` are its fields with a leading 1 in the columns `pivots`, each with its value last;
    `growth` are the ranks met; `consistent` is False where the brackets require a value of the zero
    field.
    """

    rows: tuple[Field, ...]
    pivots: tuple[int, ...]
    growth: tuple[int, ...]
    consistent: bool


def involutive_closure(partials: Sequence[Partial], fields: Sequence[Field]) -> Closure:
    """Brackets are added until nothing new appears, at most as many times as there are variables.

    With X(phi) = h and Y(phi) = k the bracket has the value X(k) - Y(h); where a combination of
    fields vanishes and its value does not, no phi exists (`consistent` False).
    """
    width = len(partials)
    found = matrices.reduced_rows(fields, range(width))
    growth = [len(found.rows)]
    consistent = all(row[width].is_zero for _, row in found.dropped)
    while True:
        # [X, Y], and X(k) - Y(h) as the last entry.
        brackets = [
            tuple(
                _along(partials, x, b) - _along(partials, y, a) for a, b in zip(x, y, strict=True)
            )
            for x, y in combinations(found.rows, 2)
        ]
        fresh = [row for row in brackets if not all(entry.is_zero for entry in row)]
        if not fresh:
            break
        found = matrices.reduced_rows([*found.rows, *fresh], range(width))
        consistent = consistent and all(row[width].is_zero for _, row in found.dropped)
        if len(found.rows) == growth[-1]:
            break
        growth.append(len(found.rows))
    return Closure(found.rows, found.pivots, tuple(growth), consistent)


def _along(partials: Sequence[Partial], field: Field, element: Quotient) -> Quotient:
    components = zip(field[:-1], partials, strict=True)
    terms = [
        component * partial(element) for component, partial in components if not component.is_zero
    ]
    return sum_of(element - element, terms)


def gradient(partials: Sequence[Partial], closure: Closure) -> tuple[Quotient, ...] | None:
    """The differential of one phi, a closed form, in all variables; None where none is seen.

    phi is taken not to depend on the variables in whose direction no field of the closure leads.
    """
    if not closure.consistent:
        return None
    width = len(partials)
    slopes = dict(zip(closure.pivots, (row[width] for row in closure.rows), strict=True))
    zero = next((row[0] - row[0] for row in closure.rows), None)
    if zero is None:
        return None
    form = tuple(slopes.get(place, zero) for place in range(width))
    for i, j in combinations(range(width), 2):
        if not (partials[i](form[j]) - partials[j](form[i])).is_zero:
            return None
    return form


@dataclass(frozen=True, slots=True)
class Integrability:
    """`integrable` of the `count` constraints are holonomic; `growth` are the ranks of the derived
    flag.

    `integrals` are functions of (t, q) that the constraints keep constant, those that were found in
    closed form; at most `integrable` of them.
    """

    count: int
    integrable: int
    growth: tuple[int, ...]
    integrals: tuple[ex.Expression, ...]

    @property
    def holonomic(self) -> bool:
        return self.integrable == self.count


def integrability(parts: Geometry, choice: Frame) -> Integrability:
    """The holonomic part of the constraints; TooLarge where brackets grow beyond the budget."""
    first = 0 if needs_time(parts, choice) else 1
    variables = list(range(first, 1 + parts.size))
    closure = involutive_closure(
        [parts.ring.partial(k) for k in variables], fields(parts, choice, first == 0)
    )
    lost = [place for place in range(len(variables)) if place not in closure.pivots]
    integrals = [_integral(parts, variables, closure, place) for place in lost]
    found = tuple(tree for tree in integrals if tree is not None)
    growth = tuple(rank - (1 - first) for rank in closure.growth)
    return Integrability(len(parts.rows), len(lost), growth, found)


def needs_time(parts: Geometry, choice: Frame) -> bool:
    """Whether the constraints move: a velocity-free term, or t in a coefficient."""
    entries = [*choice.drift, *(entry for row in choice.basis for entry in row)]
    return any(not drift.is_zero for drift in choice.drift) or any(
        not parts.by_time(e).is_zero for e in entries
    )


def fields(
    parts: Geometry, choice: Frame, timed: bool, values: Sequence[Quotient] = ()
) -> list[Field]:
    """The columns of the frame as rows of components, each with its value (0 where none is given).

    `timed` puts the component of d/dt first and adds the field d/dt + drift at the end; its
    value is the last one given.
    """
    zero, one = parts.zero, parts.ring.constant(1)
    given = [*values, *[zero] * (len(choice.free) + 1 - len(values))]
    columns = [tuple(row[j] for row in choice.basis) for j in range(len(choice.free))]
    head: tuple[Quotient, ...] = (zero,) if timed else ()
    found = [(*head, *column, value) for column, value in zip(columns, given, strict=False)]
    return [*found, (one, *choice.drift, given[-1])] if timed else found


def _integral(
    parts: Geometry, variables: Sequence[int], closure: Closure, lost: int
) -> ex.Expression | None:
    """The function whose differential is dx_lost - sum of row[lost] dx_pivot, if it is closed and
    simple.
    """
    slopes = {pivot: -row[lost] for pivot, row in zip(closure.pivots, closure.rows, strict=True)}
    slopes[lost] = parts.ring.constant(1)
    form = [slopes.get(place, parts.zero) for place in range(len(variables))]
    for scale in _scales(parts, form):
        found = potential(parts.ring, variables, [slope * scale for slope in form])
        if found is not None:
            return found.exponential(parts.ring) if found.rest.is_zero else found.tree(parts.ring)
    return None


def _scales(parts: Geometry, form: Sequence[Quotient]) -> list[Quotient]:
    """Integrating factors tried: 1, and powers of the factors of numerators and denominators."""
    ring = parts.ring
    scales = [ring.constant(1)]
    for slope in form:
        if not slope.is_zero:
            elements = [element for _, element in powers_of_factors(ring, slope)]
            scales += [
                other
                for element in elements
                for other in (element, element.inverse(), element * element)
            ]
    return scales[: 2 * bounds.CANDIDATES]


@dataclass(frozen=True, slots=True)
class MeasureDensity:
    """A function of q, up to a constant factor, that makes a volume invariant.

    `momenta` is the density N of the volume dq dp, p_j = dL_c/du_j the momenta of the free
    velocities (the paper's N); `velocities` is the density N det G of the volume dq du.
    """

    status: Status
    momenta: ex.Expression | None = None
    velocities: ex.Expression | None = None


def measure_density(motion: EliminatedMotion) -> MeasureDensity:
    """N(q) with div(N X) = 0 on the constraints: X_k(log N) = -(the part of div X linear in u_k).

    The equations are closed under brackets; a contradiction shows that no density N(q) exists.
    """
    parts, choice = motion.geometry, motion.frame
    # div X in the coordinates (q, u) of the constraint manifold
    terms = [parts.by_coordinate(k, motion.velocities[k]) for k in range(parts.size)]
    terms += [parts.by_velocity(k, motion.accelerations[k]) for k in choice.free]
    values, rest = _linear_parts(motion, sum_of(parts.zero, terms))
    if values is None:
        return MeasureDensity("not_found")
    timed = needs_time(parts, choice) or not rest.is_zero
    found = _solved(motion, [-value for value in values], -rest, timed)
    if isinstance(found, str):
        return MeasureDensity("does_not_exist" if found == "contradiction" else "not_found")
    inertia = matrices.determinant(motion.inertia, parts.ring.constant(1))
    less = [(-exponent, element) for exponent, element in powers_of_factors(parts.ring, inertia)]
    table = _real_point(motion)
    momenta, velocities = found.plus_logarithm(less).made_positive(parts.ring, table), found
    return MeasureDensity(
        "found",
        momenta.exponential(parts.ring),
        velocities.made_positive(parts.ring, table).exponential(parts.ring),
    )


def _real_point(motion: EliminatedMotion) -> real_branch.RealTable | None:
    """Where the motion is real."""
    parts = motion.geometry
    return parts.real_point([*map(parts.tree, (*motion.accelerations, *motion.velocities))])


def _linear_parts(
    motion: EliminatedMotion, element: Quotient
) -> tuple[list[Quotient] | None, Quotient]:
    """(d_k, d_0) with element = d_k(q) u_k + d_0(q); None where it is not of this form."""
    parts, free = motion.geometry, motion.frame.free
    slopes = [parts.by_velocity(k, element) for k in free]
    if any(not parts.by_velocity(k, slope).is_zero for slope in slopes for k in free):
        return None, element
    return slopes, element - matrices.dot(parts.zero, slopes, [parts.velocity(k) for k in free])


def _solved(
    motion: EliminatedMotion, values: Sequence[Quotient], last: Quotient, timed: bool
) -> Potential | Literal["contradiction", "unknown"]:
    """phi with X_k(phi) = values[k], and (d/dt + drift)(phi) = last where the constraints move."""
    parts = motion.geometry
    variables = list(range(0 if timed else 1, 1 + parts.size))
    partials = [parts.ring.partial(k) for k in variables]
    closure = involutive_closure(partials, fields(parts, motion.frame, timed, [*values, last]))
    if not closure.consistent:
        return "contradiction"
    form = gradient(partials, closure)
    found = None if form is None else potential(parts.ring, variables, form)
    return "unknown" if found is None else found


def scaled_velocities(motion: EliminatedMotion) -> Iterator[FirstIntegral]:
    """exp(phi(q)) u_j where u_j' = -u_j phi', for each free velocity that only stretches along the
    motion.
    """
    parts, choice = motion.geometry, motion.frame
    if needs_time(parts, choice):
        return
    for j, place in enumerate(choice.free):
        ratio = motion.accelerations[place] / parts.velocity(place)
        values, rest = _linear_parts(motion, ratio)
        if values is None or not rest.is_zero or _still_divides(motion, ratio):
            continue
        found = _solved(motion, [-value for value in values], parts.zero, False)
        if isinstance(found, str):
            continue
        name = parts.system.coordinates[choice.free[j]]
        factor = found.made_positive(parts.ring, _real_point(motion)).exponential(parts.ring)
        kind = "velocity" if factor == ex.ONE else "scaled velocity"
        yield FirstIntegral(f"{kind} of {name}", factor * ex.Velocity(name))


def _still_divides(motion: EliminatedMotion, ratio: Quotient) -> bool:
    """Whether a velocity is left in the denominator."""
    owner = motion.geometry.ring.field
    elements = [Quotient(owner, owner.denominators[index], ()) for index, _ in ratio.exponents]
    return any(
        not motion.geometry.by_velocity(k, e).is_zero for e in elements for k in motion.frame.free
    )
