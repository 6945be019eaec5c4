"""Whether constraints on velocities are constraints on positions in disguise (Frobenius).

The distribution of the constraints is closed under brackets; k constraints of which j survive as the
annihilator of the closure are j holonomic ones and k - j nonholonomic ones. Constraints with a
velocity-free term or with t are looked at on (t, q), with the field d/dt + drift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from inverse_service.algebra.rational_functions import Quotient
from inverse_service.expressions.tree import Expression
from inverse_service.mechanics.nonholonomic.geometry import Frame, Geometry
from inverse_service.mechanics.potential import factors_of, potential
from inverse_service.mechanics.vector_fields import Closure, Field, involutive_closure

MOST_FACTORS = 24


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
    return scales[:MOST_FACTORS]
