"""What a nonholonomic motion keeps: an invariant measure with a density N(q), and scaled velocities.

Distributions of vector fields on (t, q): brackets, Frobenius, and the equations X_k(phi) = h_k. A row is the
components of a field in the variables (t or not, then q), followed by the value h that a function phi is to have along
it; h = 0 where only the distribution matters.

Constraints on velocities may be constraints on positions in disguise (Frobenius). The distribution of the constraints
is closed under brackets; k constraints of which j survive as the annihilator of the closure are j holonomic ones and k
- j nonholonomic ones. Constraints with a velocity-free term or with t are treated on (t, q), with the field d/dt +
drift.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

from inverse_service import bounds
from inverse_service.expressions.tree import ONE, Expression, Velocity
from inverse_service.field.exact_field import Quotient, sum_of
from inverse_service.field.matrices import determinant, dot, reduced_rows
from inverse_service.mechanics.constrained_motion import EliminatedMotion, Frame, Geometry
from inverse_service.mechanics.first_integrals import FirstIntegral
from inverse_service.mechanics.potential import Potential, factors_of, potential

Partial = Callable[[Quotient], Quotient]
Field = tuple[Quotient, ...]
Status = Literal["found", "does_not_exist", "not_found"]


@dataclass(frozen=True, slots=True)
class Closure:
    """The smallest involutive distribution that holds some fields.

    `rows` are its fields with a leading 1 in the columns `pivots`, each with its value last; `growth`
    are the ranks met; `consistent` is False where the brackets require a value of the zero field.
    """

    rows: tuple[Field, ...]
    pivots: tuple[int, ...]
    growth: tuple[int, ...]
    consistent: bool


def involutive_closure(partials: Sequence[Partial], fields: Sequence[Field]) -> Closure:
    """Brackets are added until nothing new appears, at most as many times as there are variables.

    With X(phi) = h and Y(phi) = k the bracket has the value X(k) - Y(h); where a combination of fields
    vanishes and its value does not, no phi exists (`consistent` False).
    """
    width = len(partials)
    found = reduced_rows(fields, range(width))
    growth = [len(found.rows)]
    consistent = all(row[width].is_zero for _, row in found.dropped)
    while True:
        # [X, Y], and X(k) - Y(h) as the last entry.
        brackets = [
            tuple(_along(partials, x, b) - _along(partials, y, a) for a, b in zip(x, y, strict=True))
            for x, y in combinations(found.rows, 2)
        ]
        fresh = [row for row in brackets if not all(entry.is_zero for entry in row)]
        if not fresh:
            break
        found = reduced_rows([*found.rows, *fresh], range(width))
        consistent = consistent and all(row[width].is_zero for _, row in found.dropped)
        if len(found.rows) == growth[-1]:
            break
        growth.append(len(found.rows))
    return Closure(found.rows, found.pivots, tuple(growth), consistent)


def _along(partials: Sequence[Partial], field: Field, element: Quotient) -> Quotient:
    components = zip(field[:-1], partials, strict=True)
    terms = [component * partial(element) for component, partial in components if not component.is_zero]
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
    """`integrable` of the `count` constraints are holonomic; `growth` are the ranks of the derived flag.

    `integrals` are functions of (t, q) that the constraints keep constant, those that were found in
    closed form; at most `integrable` of them.
    """

    count: int
    integrable: int
    growth: tuple[int, ...]
    integrals: tuple[Expression, ...]

    @property
    def holonomic(self) -> bool:
        return self.integrable == self.count


def integrability(parts: Geometry, choice: Frame) -> Integrability:
    """The holonomic part of the constraints; TooLarge where brackets grow beyond the budget."""
    first = 0 if needs_time(parts, choice) else 1
    variables = list(range(first, 1 + parts.size))
    closure = involutive_closure([parts.ring.partial(k) for k in variables], fields(parts, choice, first == 0))
    lost = [place for place in range(len(variables)) if place not in closure.pivots]
    integrals = [_integral(parts, variables, closure, place) for place in lost]
    found = tuple(tree for tree in integrals if tree is not None)
    growth = tuple(rank - (1 - first) for rank in closure.growth)
    return Integrability(len(parts.rows), len(lost), growth, found)


def needs_time(parts: Geometry, choice: Frame) -> bool:
    """Whether the constraints move: a velocity-free term, or t in a coefficient."""
    entries = [*choice.drift, *(entry for row in choice.basis for entry in row)]
    return any(not drift.is_zero for drift in choice.drift) or any(not parts.by_time(e).is_zero for e in entries)


def fields(parts: Geometry, choice: Frame, with_time: bool, values: Sequence[Quotient] = ()) -> list[Field]:
    """The columns of the frame as rows of components, each with its value (0 where none is given).

    `with_time` puts the component of d/dt first and adds the field d/dt + drift at the end; its value
    is the last one given.
    """
    zero, one = parts.zero, parts.ring.constant(1)
    given = [*values, *[zero] * (len(choice.free) + 1 - len(values))]
    columns = [tuple(row[j] for row in choice.basis) for j in range(len(choice.free))]
    head: tuple[Quotient, ...] = (zero,) if with_time else ()
    found = [(*head, *column, value) for column, value in zip(columns, given, strict=False)]
    return [*found, (one, *choice.drift, given[-1])] if with_time else found


def _integral(parts: Geometry, variables: Sequence[int], closure: Closure, lost: int) -> Expression | None:
    """The function whose differential is dx_lost - sum of row[lost] dx_pivot, if it is closed and simple."""
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
            elements = [element for _, element in factors_of(ring, slope)]
            scales += [other for element in elements for other in (element, element.inverse(), element * element)]
    return scales[: 2 * bounds.CANDIDATES]


@dataclass(frozen=True, slots=True)
class MeasureDensity:
    """A function of q, up to a constant factor, that makes a volume invariant.

    `momenta` is the density N of the volume dq dp, p_j = dL_c/du_j the momenta of the free velocities
    (the paper's N); `velocities` is the density N det G of the volume dq du.
    """

    status: Status
    momenta: Expression | None = None
    velocities: Expression | None = None


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
    with_time = needs_time(parts, choice) or not rest.is_zero
    found = _solved(motion, [-value for value in values], -rest, with_time)
    if isinstance(found, str):
        return MeasureDensity("does_not_exist" if found == "contradiction" else "not_found")
    inertia = determinant(motion.inertia, parts.ring.constant(1))
    less = [(-exponent, element) for exponent, element in factors_of(parts.ring, inertia)]
    table = parts.real_point([parts.tree(element) for element in (*motion.accelerations, *motion.velocities)])
    momenta, velocities = found.plus_logarithm(less).made_positive(parts.ring, table), found
    return MeasureDensity(
        "found", momenta.exponential(parts.ring), velocities.made_positive(parts.ring, table).exponential(parts.ring)
    )


def _linear_parts(motion: EliminatedMotion, element: Quotient) -> tuple[list[Quotient] | None, Quotient]:
    """(d_k, d_0) with element = d_k(q) u_k + d_0(q); None where it is not of this form."""
    parts, free = motion.geometry, motion.frame.free
    slopes = [parts.by_velocity(k, element) for k in free]
    if any(not parts.by_velocity(k, slope).is_zero for slope in slopes for k in free):
        return None, element
    return slopes, element - dot(parts.zero, slopes, [parts.velocity(k) for k in free])


def _solved(
    motion: EliminatedMotion, values: Sequence[Quotient], last: Quotient, with_time: bool
) -> Potential | Literal["contradiction", "unknown"]:
    """phi with X_k(phi) = values[k], and (d/dt + drift)(phi) = last where the constraints move."""
    parts = motion.geometry
    variables = list(range(0 if with_time else 1, 1 + parts.size))
    partials = [parts.ring.partial(k) for k in variables]
    closure = involutive_closure(partials, fields(parts, motion.frame, with_time, [*values, last]))
    if not closure.consistent:
        return "contradiction"
    form = gradient(partials, closure)
    found = None if form is None else potential(parts.ring, variables, form)
    return "unknown" if found is None else found


def scaled_velocities(motion: EliminatedMotion) -> Iterator[FirstIntegral]:
    """exp(phi(q)) u_j where u_j' = -u_j phi', for each free velocity that only stretches along the motion."""
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
        factor = found.exponential(parts.ring)
        kind = "velocity" if factor == ONE else "scaled velocity"
        yield FirstIntegral(f"{kind} of {name}", factor * Velocity(name))


def _still_divides(motion: EliminatedMotion, ratio: Quotient) -> bool:
    """Whether a velocity is left in the denominator."""
    owner = motion.geometry.ring.field
    elements = [Quotient(owner, owner.denominators[index], ()) for index, _ in ratio.exponents]
    return any(not motion.geometry.by_velocity(k, e).is_zero for e in elements for k in motion.frame.free)
