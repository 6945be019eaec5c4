"""A nonholonomic system in exact functions of (t, q): kinetic matrix, forces, constraints, frame.

    L = 1/2 g_ij v^i v^j + b_i v^i - V,     w^a = w^a_i v^i + c^a = 0,     v = B u + drift

with g, b, V, w, c functions of (t, q); u are the velocities of the free coordinates, the columns of
B span the distribution of the constraints.

A Lagrangian with constraints on the velocities, as data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

from inverse_service.deadline import now
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.field.exact_field import (
    Budget,
    Derivation,
    ExactRing,
    Quotient,
    TooLarge,
    exact_ring,
    quotient_tree,
    sum_of,
)
from inverse_service.field.matrices import determinant, reduced_rows, weight
from inverse_service.mechanics.second_order_system import Functions
from inverse_service.mechanics.writing import readable


@dataclass(frozen=True, slots=True)
class NonholonomicSystem:
    """L(t, q, v) with the constraints w(t, q, v) = 0, one tree each, linear in the velocities.

    Parameters are generic constants; those with values were substituted. That L is quadratic and the
    constraints are linear is seen where the equations of motion are made (`geometry`).
    """

    coordinates: tuple[str, ...]
    lagrangian: Expression
    constraints: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: Functions = ()
    name: str = ""


TERM_LIMIT = 20_000
TIME_LIMIT = 20.0
# Derivatives of arbitrary functions provided for: two for the motion, more for brackets of brackets.
ORDERS = 5
Matrix = tuple[tuple[Quotient, ...], ...]


@dataclass(frozen=True, slots=True)
class Geometry:
    """The parts of L and of the constraints over `ring`; variables of the ring are t, q, v in this order.

    `mass` is g (n x n), `linear` is b (n), `potential` is V; `rows` are w (k x n), `offsets` are c (k).
    """

    system: NonholonomicSystem
    ring: ExactRing
    mass: Matrix
    linear: tuple[Quotient, ...]
    potential: Quotient
    rows: Matrix
    offsets: tuple[Quotient, ...]

    @property
    def size(self) -> int:
        return len(self.system.coordinates)

    @property
    def zero(self) -> Quotient:
        return self.ring.constant(0)

    def velocity(self, place: int) -> Quotient:
        """The velocity of a coordinate as a generator."""
        return self.ring.atoms[Velocity(self.system.coordinates[place])]

    def by_coordinate(self, place: int, element: Quotient) -> Quotient:
        return self.ring.partial(1 + place)(element)

    def by_velocity(self, place: int, element: Quotient) -> Quotient:
        return self.ring.partial(1 + self.size + place)(element)

    def by_time(self, element: Quotient) -> Quotient:
        return self.ring.partial(0)(element)

    def depends_on_position(self, element: Quotient) -> bool:
        """Whether t or a coordinate enters."""
        return any(not self.ring.partial(k)(element).is_zero for k in range(1 + self.size))

    def tree(self, element: Quotient) -> Expression:
        """The element as a formula for people."""
        return readable(self.ring, element)


@dataclass(frozen=True, slots=True)
class Frame:
    """v = basis u + drift: u the velocities of the coordinates `free`; both index tuples ascend.

    `basis` has n rows and a column for each free coordinate, `drift` n entries (zero for constraints
    without a velocity-free term).
    """

    free: tuple[int, ...]
    dependent: tuple[int, ...]
    basis: Matrix
    drift: tuple[Quotient, ...]


def geometry(system: NonholonomicSystem, time_limit: float = TIME_LIMIT) -> Geometry:
    """The parts of a system; InputError where L is not quadratic or a constraint is not linear in the velocities.

    Dependent, contradicting and velocity-free constraints are refused too, each with its pointer.
    """
    try:
        return _geometry(system, Budget(TERM_LIMIT, now() + time_limit))
    except ZeroDivisionError:
        raise InputError("the Lagrangian or a constraint divides by zero: write it without that.") from None
    except TooLarge as error:
        raise too_large(error) from None


def too_large(error: TooLarge) -> LimitError:
    """The refusal of a document that needs too large expressions."""
    return LimitError(f"the equations of motion are too large to be written out, {error}: use fewer symbols.")


def _geometry(system: NonholonomicSystem, budget: Budget) -> Geometry:
    names = system.coordinates
    coordinates, velocities = [Symbol(name) for name in names], [Velocity(name) for name in names]
    trees = [system.lagrangian, *system.constraints]
    ring = exact_ring(trees, [TIME, *coordinates, *velocities], ORDERS, budget)
    mass, linear, potential = _lagrangian_parts(ring, ring.value(system.lagrangian), names)
    parts = [_constraint_parts(ring, tree, place, names) for place, tree in enumerate(system.constraints)]
    rows, offsets = tuple(row for row, _ in parts), tuple(offset for _, offset in parts)
    found = Geometry(system, ring, mass, linear, potential, rows, offsets)
    _refuse_dependent(found)
    return found


def _lagrangian_parts(
    ring: ExactRing, lagrangian: Quotient, names: Sequence[str]
) -> tuple[Matrix, tuple[Quotient, ...], Quotient]:
    """g, b, V; InputError where a third derivative in the velocities does not vanish."""
    n = len(names)
    by = [ring.partial(1 + n + place) for place in range(n)]
    momenta = [by[i](lagrangian) for i in range(n)]
    mass = tuple(tuple(by[j](momenta[i]) for j in range(n)) for i in range(n))
    for i in range(n):
        for j in range(n):
            if _holds_velocity(ring, mass[i][j], by):
                raise InputError(
                    f"the Lagrangian is not quadratic in the velocities ({names[i]}' enters otherwise): write a "
                    "kinetic energy of degree 2, terms linear in the velocities, and a potential.",
                    "/lagrangian",
                )
    speeds = [ring.atoms[Velocity(name)] for name in names]
    linear = tuple(
        _less(momentum, [entry * speed for entry, speed in zip(row, speeds, strict=True)])
        for momentum, row in zip(momenta, mass, strict=True)
    )
    half = [
        (entry * speeds[i] * speeds[j]).scaled(Fraction(1, 2))
        for i, row in enumerate(mass)
        for j, entry in enumerate(row)
    ]
    kinetic = sum_of(ring.constant(0), half)
    rest = _less(lagrangian, [b * speed for b, speed in zip(linear, speeds, strict=True)])
    return mass, linear, kinetic - rest


def _holds_velocity(ring: ExactRing, element: Quotient, by: Sequence[Derivation]) -> bool:
    """Whether a velocity enters, if only by its sign as in v/sqrt(v^2), whose derivative is zero."""
    if any(not derivative(element).is_zero for derivative in by):
        return True
    return any(isinstance(node, Velocity) for node in walk(quotient_tree(ring, element)))


def _less(first: Quotient, terms: Sequence[Quotient]) -> Quotient:
    for term in terms:
        first = first - term
    return first


def _constraint_parts(
    ring: ExactRing, tree: Expression, place: int, names: Sequence[str]
) -> tuple[tuple[Quotient, ...], Quotient]:
    """w_i and c of one constraint; InputError where it is not linear in the velocities, or has none."""
    n, pointer = len(names), f"/constraints/{place}"
    value = ring.value(tree)
    by = [ring.partial(1 + n + k) for k in range(n)]
    row = tuple(by[k](value) for k in range(n))
    for k, entry in enumerate(row):
        if _holds_velocity(ring, entry, by):
            raise InputError(
                f"constraint {place + 1} is not linear in the velocities ({names[k]}' enters otherwise): only "
                "constraints w_i(q) v^i + c(q) = 0 are accepted.",
                pointer,
            )
    offset = _less(value, [entry * ring.atoms[Velocity(name)] for entry, name in zip(row, names, strict=True)])
    if all(entry.is_zero for entry in row):
        if offset.is_zero:
            raise InputError(f"constraint {place + 1} is zero identically: leave it out.", pointer)
        raise InputError(
            f"constraint {place + 1} contains no velocity, it restricts the positions (a holonomic constraint): "
            "eliminate a coordinate, or write its derivative in time.",
            pointer,
        )
    return row, offset


def _refuse_dependent(parts: Geometry) -> None:
    """InputError for constraints that follow from or contradict the ones before them, and for too many."""
    n = parts.size
    for count in range(2, len(parts.rows) + 1):
        table = [[*row, offset] for row, offset in zip(parts.rows[:count], parts.offsets[:count], strict=True)]
        found = reduced_rows(table, range(n))
        if not found.dropped:
            continue
        left = found.dropped[0][1][n]
        pointer = f"/constraints/{count - 1}"
        if left.is_zero:
            raise InputError(
                f"constraint {count} is redundant, it follows from those before it: leave it out.", pointer
            )
        raise InputError(
            f"constraint {count} contradicts those before it, together they require "
            f"{to_text(parts.tree(left))} = 0: leave one of them out.",
            pointer,
        )
    if len(parts.rows) >= n:
        raise InputError(
            f"{len(parts.rows)} independent constraints leave {n} coordinates no freedom: give fewer constraints.",
            "/constraints",
        )


def frames(parts: Geometry) -> list[Frame]:
    """The frames of all choices of dependent coordinates, the most convenient one first.

    Preferred: coordinates that L does not contain, a minor of the constraints that is constant (no
    singular positions), short entries, later coordinates.
    """
    n, k = parts.size, len(parts.rows)
    one = parts.ring.constant(1)
    choices = []
    for dependent in combinations(range(n), k):
        minor = determinant([[row[column] for column in dependent] for row in parts.rows], one)
        if minor.is_zero:
            continue
        held = sum(_in_lagrangian(parts, place) for place in dependent)
        choices.append(((held, parts.depends_on_position(minor), weight(minor), [-d for d in dependent]), dependent))
    return [frame(parts, dependent) for _, dependent in sorted(choices)]


def _in_lagrangian(parts: Geometry, place: int) -> bool:
    elements = [*(entry for row in parts.mass for entry in row), *parts.linear, parts.potential]
    return any(not parts.by_coordinate(place, element).is_zero for element in elements)


def frame(parts: Geometry, dependent: tuple[int, ...]) -> Frame:
    """The frame with these dependent coordinates, whose minor must not vanish."""
    n = parts.size
    free = tuple(place for place in range(n) if place not in dependent)
    table = [[*row, offset] for row, offset in zip(parts.rows, parts.offsets, strict=True)]
    found = reduced_rows(table, dependent)
    solved = dict(zip(found.pivots, found.rows, strict=True))
    zero, one = parts.zero, parts.ring.constant(1)
    basis = tuple(
        tuple(-solved[place][column] for column in free)
        if place in solved
        else tuple(one if column == place else zero for column in free)
        for place in range(n)
    )
    drift = tuple(-solved[place][n] if place in solved else zero for place in range(n))
    return Frame(free, dependent, basis, drift)
