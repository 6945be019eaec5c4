"""A Lagrangian with constraints on the velocities, written in exact functions of (t, q), and its
motion.

    L = 1/2 g_ij v^i v^j + b_i v^i - V,     w^a = w^a_i v^i + c^a = 0,     v = B u + drift

with g, b, V, w, c functions of (t, q); u are the velocities of the free coordinates, the columns of
B span the distribution of the constraints. The multipliers of d'Alembert's principle, d/dt(dL/dv) -
dL/dq = lambda_a w^a, are eliminated exactly: the free accelerations follow from

    B^T (g a - F) = 0,  a = B u' + (dB/dt) u + d(drift)/dt,

so that g needs to be regular on the distribution of the constraints only. Source: A. M. Bloch,
Nonholonomic Mechanics and Control, 2003, chapter 5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from typing import NamedTuple

from inverse_service.deadline import now
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions import collecting, tree as ex
from inverse_service.expressions.calculus import differentiate, differentiate_in_time
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    TIME,
    ZERO,
    Expression,
    Symbol,
    Velocity,
    substitute,
    walk,
)
from inverse_service.field import exact_field
from inverse_service.field.matrices import determinant, dot, reduced_rows, solve_square, weight
from inverse_service.field.real_branch import RealTable, first_real_point, is_nonzero
from inverse_service.mechanics import (
    linear_equations,
    second_order_system,
    short_angles,
    writing,
)
from inverse_service.mechanics.second_order_system import ConstrainedMotion
from inverse_service.reading import declarations, document_names, names as nm, reader

TERM_LIMIT = 20_000
TIME_LIMIT = 20.0
# Derivatives of arbitrary functions provided for: two for the motion, more for brackets of
# brackets.
ORDERS = 5
_HOLONOMIC = (
    "constraint {} contains no velocity, it restricts the positions (a holonomic constraint): eliminate a coordinate, "
    "or write its derivative in time."
)
Matrix = tuple[tuple[exact_field.Quotient, ...], ...]

# Coordinates of a system with constraints.
MOST_CONSTRAINED = 12
Minors = dict[tuple[int, ...], exact_field.Quotient]


@dataclass(frozen=True, slots=True)
class NonholonomicSystem:
    """L(t, q, v) with the constraints w(t, q, v) = 0, one tree each, linear in the velocities.

    Parameters are generic constants; those with values were substituted. That L is quadratic and
    the constraints are linear is seen where the equations of motion are made (`geometry`).
    """

    coordinates: tuple[str, ...]
    lagrangian: Expression
    constraints: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: second_order_system.Functions = ()
    name: str = ""


@dataclass(frozen=True, slots=True)
class Geometry:
    """The parts of L and of the constraints over `ring`; variables of the ring are t, q, v in this
    order.

    `mass` is g (n x n), `linear` is b (n), `potential` is V; `rows` are w (k x n), `offsets` are c
    (k).
    """

    system: NonholonomicSystem
    ring: exact_field.ExactRing
    mass: Matrix
    linear: tuple[exact_field.Quotient, ...]
    potential: exact_field.Quotient
    rows: Matrix
    offsets: tuple[exact_field.Quotient, ...]

    @property
    def size(self) -> int:
        return len(self.system.coordinates)

    @property
    def zero(self) -> exact_field.Quotient:
        return self.ring.constant(0)

    def velocity(self, place: int) -> exact_field.Quotient:
        """The velocity of a coordinate as a generator."""
        return self.ring.atoms[Velocity(self.system.coordinates[place])]

    def by_coordinate(self, place: int, element: exact_field.Quotient) -> exact_field.Quotient:
        return self.ring.partial(1 + place)(element)

    def by_velocity(self, place: int, element: exact_field.Quotient) -> exact_field.Quotient:
        return self.ring.partial(1 + self.size + place)(element)

    def by_time(self, element: exact_field.Quotient) -> exact_field.Quotient:
        return self.ring.partial(0)(element)

    def depends_on_position(self, element: exact_field.Quotient) -> bool:
        """Whether t or a coordinate enters."""
        return any(not self.ring.partial(k)(element).is_zero for k in range(1 + self.size))

    def tree(self, element: exact_field.Quotient) -> Expression:
        """The element as a formula for people."""
        return writing.readable(self.ring, element)

    def real_point(self, trees: Sequence[Expression]) -> RealTable | None:
        """A point at which these have real values, with positive parameters where there is one."""
        parameters = [*map(Symbol, self.system.parameters)]
        names = self.system.coordinates
        variables: list[Symbol | Velocity] = [
            TIME,
            *map(Symbol, names),
            *map(Velocity, names),
            *parameters,
        ]
        return first_real_point(trees, variables, (parameters, ()))


@dataclass(frozen=True, slots=True)
class Frame:
    """v = basis u + drift: u the velocities of the coordinates `free`; both index tuples ascend.

    `basis` has n rows and a column for each free coordinate, `drift` n entries (zero for
    constraints without a velocity-free term).
    """

    free: tuple[int, ...]
    dependent: tuple[int, ...]
    basis: Matrix
    drift: tuple[exact_field.Quotient, ...]


def geometry(system: NonholonomicSystem, time_limit: float = TIME_LIMIT) -> Geometry:
    """The parts of a system; InputError where L is not quadratic or a constraint is not linear in
    the velocities.

    Dependent, contradicting and velocity-free constraints are refused too, each with its pointer.
    """
    try:
        return _geometry(system, exact_field.Budget(TERM_LIMIT, now() + time_limit))
    except ZeroDivisionError:
        raise InputError(
            "the Lagrangian or a constraint divides by zero: remove the division."
        ) from None
    except exact_field.TooLarge as error:
        raise too_large(error) from None


def too_large(error: exact_field.TooLarge) -> LimitError:
    """The refusal of a document that needs too large expressions."""
    return LimitError(
        f"the equations of motion are too large to be written out, {error}: use fewer symbols."
    )


def _geometry(system: NonholonomicSystem, budget: exact_field.Budget) -> Geometry:
    trees = [system.lagrangian, *system.constraints]
    found = _parts(system, trees, budget)
    _refuse_dependent(found)
    elements = [*(entry for row in found.mass for entry in row), *found.linear, found.potential]
    elements += [minor for columns, minor in _minors(found).items() if found.size not in columns]
    shorter = short_angles.by_short_angles(trees, found.ring, elements)
    return found if shorter is None else _parts(system, shorter, budget)


def _parts(
    system: NonholonomicSystem, trees: Sequence[Expression], budget: exact_field.Budget
) -> Geometry:
    """Of L and the constraints, the trees."""
    names = system.coordinates
    ring = exact_field.exact_ring(
        trees, [TIME, *map(Symbol, names), *map(Velocity, names)], ORDERS, budget
    )
    mass, linear, potential = _lagrangian_parts(ring, ring.value(trees[0]), names)
    parts = [_constraint_parts(ring, tree, place, names) for place, tree in enumerate(trees[1:])]
    rows, offsets = tuple(row for row, _ in parts), tuple(offset for _, offset in parts)
    return Geometry(system, ring, mass, linear, potential, rows, offsets)


class LagrangianParts(NamedTuple):
    """L = g v v/2 + b v - V."""

    mass: Matrix
    linear: tuple[exact_field.Quotient, ...]
    potential: exact_field.Quotient


def _lagrangian_parts(
    ring: exact_field.ExactRing, lagrangian: exact_field.Quotient, names: Sequence[str]
) -> LagrangianParts:
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
    zero, speeds = ring.constant(0), [ring.atoms[Velocity(name)] for name in names]
    quadratic = [dot(zero, row, speeds) for row in mass]
    linear = tuple(momentum - part for momentum, part in zip(momenta, quadratic, strict=True))
    kinetic = dot(zero, quadratic, speeds).scaled(Fraction(1, 2))
    return LagrangianParts(mass, linear, kinetic + dot(zero, linear, speeds) - lagrangian)


def _holds_velocity(
    ring: exact_field.ExactRing, element: exact_field.Quotient, by: Sequence[exact_field.Derivation]
) -> bool:
    """Whether a velocity enters, if only by its sign as in v/sqrt(v^2), whose derivative is
    zero.
    """
    if any(not derivative(element).is_zero for derivative in by):
        return True
    return ex.has(exact_field.quotient_tree(ring, element), Velocity)


def _constraint_parts(
    ring: exact_field.ExactRing, tree: Expression, place: int, names: Sequence[str]
) -> tuple[tuple[exact_field.Quotient, ...], exact_field.Quotient]:
    """w_i and c of one constraint; InputError where it is not linear in the velocities, or has
    none.
    """
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
    offset = value - dot(ring.constant(0), row, [ring.atoms[Velocity(name)] for name in names])
    if all(entry.is_zero for entry in row):
        if offset.is_zero:
            raise InputError(f"constraint {place + 1} is identically zero: remove it.", pointer)
        raise InputError(_HOLONOMIC.format(place + 1), pointer)
    _refuse_factor(ring, value, place, names)
    return row, offset


def _refuse_factor(
    ring: exact_field.ExactRing, value: exact_field.Quotient, place: int, names: Sequence[str]
) -> None:
    """InputError for a constraint such as x (y' - z) = 0, which leaves the motion open where x =
    0.
    """
    moving = {TIME, *map(Symbol, names)}
    for tree in exact_field.factor_trees(ring, value):
        nodes = {*walk(tree)}
        if any(isinstance(node, Velocity) for node in nodes) or not nodes & moving:
            continue
        if not is_nonzero(tree):
            raise InputError(
                f"constraint {place + 1} has the factor {to_text(tree)}, and leaves the motion open where that is 0: "
                "divide by it.",
                f"/constraints/{place}",
            )


def _refuse_dependent(parts: Geometry) -> None:
    """InputError for constraints that follow from or contradict the ones before them, and for too
    many.
    """
    n = parts.size
    for count in range(2, len(parts.rows) + 1):
        table = [
            [*row, offset]
            for row, offset in zip(parts.rows[:count], parts.offsets[:count], strict=True)
        ]
        found = reduced_rows(table, range(n))
        if not found.dropped:
            continue
        left = found.dropped[0][1][n]
        pointer = f"/constraints/{count - 1}"
        if left.is_zero:
            raise InputError(
                f"constraint {count} is redundant, since it follows from those before it: remove it.",
                pointer,
            )
        raise InputError(
            f"constraint {count} contradicts those before it, together they require "
            f"{to_text(parts.tree(left))} = 0: leave one of them out.",
            pointer,
        )
    if len(parts.rows) >= n:
        detail = f"a system with {n} coordinate{'s' * (n != 1)} and as many independent constraints has no freedom"
        raise InputError(f"{detail}: give fewer constraints.", "/constraints")


def frames(parts: Geometry) -> list[Frame]:
    """The frames of all choices of dependent coordinates, the most convenient one first.

    Preferred: a minor of the constraints that is constant (no singular positions), coordinates that
    the equations of the free motion do not contain (a uniform field has none), a short minor, one
    of few coordinates, later coordinates.
    """
    places = range(parts.size)
    forces = [
        parts.by_coordinate(k, parts.potential) + parts.by_time(parts.linear[k]) for k in places
    ]
    turns = [
        parts.by_coordinate(j, parts.linear[k]) - parts.by_coordinate(k, parts.linear[j])
        for j, k in combinations(places, 2)
    ]
    elements = [*(entry for row in parts.mass for entry in row), *turns, *forces]
    held = [
        any(not parts.by_coordinate(k, element).is_zero for element in elements) for k in places
    ]
    minors = _minors(parts)
    choices = sorted(
        (
            parts.depends_on_position(minor),
            sum(held[d] for d in dependent),
            weight(minor),
            sum(not parts.by_coordinate(place, minor).is_zero for place in places),
            [-d for d in dependent],
        )
        for dependent, minor in minors.items()
        if parts.size not in dependent and not minor.is_zero
    )
    return [_frame(parts, minors, tuple(-d for d in turned)) for *_, turned in choices]


def _minors(parts: Geometry) -> Minors:
    """The determinants of the constraints by the velocities of as many coordinates; their offsets
    are column n.
    """
    one, table = (
        parts.ring.constant(1),
        [(*row, offset) for row, offset in zip(parts.rows, parts.offsets, strict=True)],
    )
    chosen = combinations(range(parts.size + 1), len(table))
    return {
        columns: determinant([[row[k] for k in columns] for row in table], one)
        for columns in chosen
    }


def _frame(parts: Geometry, minors: Minors, dependent: tuple[int, ...]) -> Frame:
    """The frame with these dependent coordinates, whose minor must not vanish, by Cramer's rule.

    Elimination would divide by pivots that the minor does not hold, and they do not always cancel:
    a numerator that is reduced by sin^2 + cos^2 = 1 need not be a multiple of them as a polynomial.
    """
    n = parts.size
    free = tuple(place for place in range(n) if place not in dependent)
    inverse, zero, one = minors[dependent].inverse(), parts.zero, parts.ring.constant(1)

    def solved(place: int, column: int) -> exact_field.Quotient:
        """-det(the minor with another column in the place of one)/minor."""
        columns = sorted([column, *(d for d in dependent if d != place)])
        swaps = columns.index(column) - dependent.index(place)
        value = minors[tuple(columns)] * inverse
        return value if swaps % 2 else -value

    basis = tuple(
        tuple(solved(place, column) for column in free)
        if place in dependent
        else tuple(one if column == place else zero for column in free)
        for place in range(n)
    )
    return Frame(
        free, dependent, basis, tuple(solved(k, n) if k in dependent else zero for k in range(n))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class EquationsOfMotion(ConstrainedMotion):
    """The motion of a Lagrangian, with its known properties.

    `accelerations` are those of all coordinates, in the order of the system, and `multipliers` the
    lambda_a, one for each constraint; both hold free velocities only.
    """

    system: NonholonomicSystem
    accelerations: tuple[Expression, ...]
    multipliers: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class EliminatedMotion:
    """The motion in exact functions: `velocities` v(t, q, u) and `accelerations` a(t, q, u), each
    n.

    `inertia` is the mass matrix G = B^T g B of the free velocities.
    """

    geometry: Geometry
    frame: Frame
    velocities: tuple[exact_field.Quotient, ...]
    accelerations: tuple[exact_field.Quotient, ...]
    inertia: tuple[tuple[exact_field.Quotient, ...], ...]
    multipliers: tuple[exact_field.Quotient, ...]


def equations_of_motion(system: NonholonomicSystem) -> EquationsOfMotion:
    """The equations of motion in the most convenient free coordinates; errors as in
    `eliminated`.
    """
    return motion_as_trees(eliminated(system))


def accelerations(system: NonholonomicSystem) -> tuple[Expression, ...]:
    """The accelerations of `equations_of_motion` alone, which need not wait for the multipliers to
    be written.
    """
    motion = eliminated(system)
    return tuple(map(motion.geometry.tree, motion.accelerations))


def eliminated(system: NonholonomicSystem) -> EliminatedMotion:
    """The motion in the most convenient free coordinates.

    InputError where L or a constraint is outside what `geometry` accepts, or where L is singular on
    the distribution of the constraints; LimitError where the equations are too large.
    """
    parts = geometry(system)
    try:
        return eliminate_multipliers(parts, frames(parts)[0])
    except exact_field.TooLarge as error:
        raise too_large(error) from None


def motion_as_trees(motion: EliminatedMotion) -> EquationsOfMotion:
    """The motion as trees."""
    parts, choice = motion.geometry, motion.frame
    names = parts.system.coordinates
    accelerations = tuple(parts.tree(element) for element in motion.accelerations)
    velocities = tuple(parts.tree(motion.velocities[k]) for k in choice.dependent)
    return EquationsOfMotion(
        names,
        tuple(names[k] for k in choice.free),
        tuple(names[k] for k in choice.dependent),
        velocities,
        tuple(accelerations[k] for k in choice.free),
        parts.system.parameters,
        parts.system.functions,
        open_places(parts, choice, (*accelerations, *velocities), motion.inertia),
        system=parts.system,
        accelerations=accelerations,
        multipliers=tuple(parts.tree(element) for element in motion.multipliers),
    )


def open_places(
    parts: Geometry, choice: Frame, formulas: Sequence[Expression], inertia: Matrix = ()
) -> tuple[Expression, ...]:
    """What the elimination divides by that the formulas of the motion do not show.

    With M = d2L/dv2 and the rows w these are factors of det (M, w^T; w, 0) = +- minor^2
    det(inertia).
    """
    moving, one = {TIME, *map(Symbol, parts.system.coordinates)}, parts.ring.constant(1)
    minor = determinant([[row[column] for column in choice.dependent] for row in parts.rows], one)
    whole = minor * minor * determinant(inertia, one)
    trees = [
        tree
        for tree in exact_field.factor_trees(parts.ring, whole)
        if not moving.isdisjoint(walk(tree))
    ]
    return linear_equations.unseen(trees, formulas)


def eliminate_multipliers(parts: Geometry, choice: Frame) -> EliminatedMotion:
    """The motion with a given frame; InputError where B^T g B is singular."""
    n, m = parts.size, len(choice.free)
    speeds = [parts.velocity(k) for k in choice.free]
    rows = list(zip(choice.basis, choice.drift, strict=True))
    velocities = tuple(dot(parts.zero, row, speeds) + drift for row, drift in rows)
    bias = tuple(
        dot(parts.zero, [_rate(parts, velocities, entry) for entry in row], speeds)
        + _rate(parts, velocities, drift)
        for row, drift in rows
    )
    force = _force(parts, velocities)
    columns = [[row[j] for row in choice.basis] for j in range(m)]
    lowered = [[dot(parts.zero, row, column) for row in parts.mass] for column in columns]
    inertia = tuple(
        tuple(dot(parts.zero, lowered[i], columns[j]) for j in range(m)) for i in range(m)
    )
    left = [force[i] - dot(parts.zero, parts.mass[i], bias) for i in range(n)]
    solved = solve_square(inertia, [dot(parts.zero, column, left) for column in columns])
    if solved is None:
        raise InputError(
            "the Lagrangian is singular on the constraints, its kinetic energy does not determine the accelerations of "
            f"{', '.join(parts.system.coordinates[k] for k in choice.free)}: give these motions a mass.",
            "/lagrangian",
        )
    accelerations = tuple(
        dot(parts.zero, row, solved) + extra for row, extra in zip(choice.basis, bias, strict=True)
    )
    multipliers = _multipliers(parts, choice, accelerations, force)
    return EliminatedMotion(parts, choice, velocities, accelerations, inertia, multipliers)


def _rate(
    parts: Geometry, velocities: Sequence[exact_field.Quotient], element: exact_field.Quotient
) -> exact_field.Quotient:
    """The derivative in time of a function of (t, q)."""
    terms = [velocities[k] * parts.by_coordinate(k, element) for k in range(parts.size)]
    return exact_field.sum_of(parts.zero, [parts.by_time(element), *terms])


def _force(
    parts: Geometry, velocities: Sequence[exact_field.Quotient]
) -> list[exact_field.Quotient]:
    """F with d/dt(dL/dv) - dL/dq = g a - F, after substituting the velocities."""
    n = parts.size
    half = Fraction(1, 2)
    found = []
    for i in range(n):
        terms = [
            -parts.by_coordinate(i, parts.potential),
            -_rate(parts, velocities, parts.linear[i]),
        ]
        for j in range(n):
            terms.append(velocities[j] * parts.by_coordinate(i, parts.linear[j]))
            terms.append(-(velocities[j] * _rate(parts, velocities, parts.mass[i][j])))
            slopes = [parts.by_coordinate(i, parts.mass[j][k]) for k in range(n)]
            terms.append((velocities[j] * dot(parts.zero, slopes, velocities)).scaled(half))
        found.append(exact_field.sum_of(parts.zero, terms))
    return found


def _multipliers(
    parts: Geometry,
    choice: Frame,
    accelerations: Sequence[exact_field.Quotient],
    force: Sequence[exact_field.Quotient],
) -> tuple[exact_field.Quotient, ...]:
    """lambda_a from the dependent rows of g a - F = lambda_a w^a."""
    matrix = [[row[place] for row in parts.rows] for place in choice.dependent]
    right = [dot(parts.zero, parts.mass[i], accelerations) - force[i] for i in choice.dependent]
    solved = solve_square(matrix, right)
    assert solved is not None, "the minor of the dependent coordinates does not vanish"
    return solved


def motion_on(
    system: NonholonomicSystem, accelerations: Mapping[str, Expression]
) -> ConstrainedMotion:
    """The motion with these accelerations of the free coordinates on the constraints of a system.

    InputError where the constraints do not give the velocities of the others by theirs.
    """
    names = system.coordinates
    parts = geometry(system)
    dependent = tuple(place for place, name in enumerate(names) if name not in accelerations)
    choice = next((found for found in frames(parts) if found.dependent == dependent), None)
    if choice is None:
        listed = ", ".join(names[place] for place in dependent)
        raise InputError(
            f"the constraints do not determine the velocities of {listed} from the others.",
            "/motion",
        )
    speeds = [parts.velocity(place) for place in choice.free]
    rates = [
        dot(parts.zero, choice.basis[place], speeds) + choice.drift[place] for place in dependent
    ]
    velocities = tuple(parts.tree(rate) for rate in rates)
    free, bound = (tuple(names[place] for place in places) for places in (choice.free, dependent))
    forces = tuple(accelerations[name] for name in free)
    places = open_places(parts, choice, velocities)
    found = ConstrainedMotion(
        names, free, bound, velocities, forces, system.parameters, system.functions, places
    )
    return replace(
        found, free_accelerations=tuple(substitute(force, found.on_constraints) for force in forces)
    )


def read_nonholonomic(
    declared: declarations.Declared,
    lagrangian: str,
    constraints: Sequence[str] | str,
    name: str = "",
) -> NonholonomicSystem:
    """The system of a document; a constraint is a formula that is zero, or an equation.

    `constraints` is a list, or one text with the constraints separated by semicolons. InputError
    with JSON pointer and column for anything that is wrong, LimitError for too many coordinates.
    """
    known = document_names.known_names(
        declared, {"/lagrangian": lagrangian, **_by_pointer(constraints)}, order=1
    )
    names = known.remaining()
    return NonholonomicSystem(
        coordinates=names.coordinates,
        lagrangian=known.put_in(read_lagrangian(lagrangian, known.names)),
        constraints=tuple(
            known.put_in(tree) for tree in _constraints(constraints, known.names, declared.most)
        ),
        parameters=names.parameters,
        functions=tuple(names.functions.items()),
        name=name,
    )


def read_typed(
    lagrangian: str, constraints: Sequence[str] | str, declared: declarations.Declared
) -> declarations.TypedLines:
    """L = ... and each constraint as typed: definitions and values are not put in; InputError for
    what cannot be read.
    """
    texts = _by_pointer(constraints)
    known = document_names.known_names(declared, {"/lagrangian": lagrangian, **texts}, order=1)
    with reader.placed_at("/lagrangian"):
        formula = reader.read_formula(lagrangian, replace(known.names, energy=True))
    sides: list[tuple[Expression, Expression]] = [(ex.Symbol("L"), formula)]
    for text in texts.values():
        sides += reader.read_equations(text, replace(known.names, forms=True))
    return declarations.TypedLines(known, tuple(sides))


def read_motion(
    declared: declarations.Declared, motion: Mapping[str, str], constraints: Sequence[str] | str
) -> ConstrainedMotion:
    """A motion given by the accelerations of the free coordinates on the constraints.

    InputError where the free coordinates are not as many as the constraints leave, or do not fix
    the others.
    """
    texts = {f"/motion/{name}": text for name, text in motion.items()}
    known = document_names.known_names(declared, texts | _by_pointer(constraints), order=1)
    names, trees = known.remaining(), _constraints(constraints, known.names, declared.most)
    free = {known.names.spelling(name): name for name in motion}
    strange = next((name for key, name in free.items() if key not in names.coordinates), None)
    if strange is not None:
        raise InputError(
            f"'motion' has an entry for '{strange}', which is not a coordinate.", "/motion"
        )
    if len(free) + len(trees) != len(names.coordinates):
        raise InputError(
            f"{len(names.coordinates)} coordinates with {len(trees)} constraints leave "
            f"{len(names.coordinates) - len(trees)} free velocities: give their accelerations, not {len(free)}.",
            "/motion",
        )
    system = NonholonomicSystem(
        names.coordinates,
        ZERO,
        tuple(map(known.put_in, trees)),
        names.parameters,
        tuple(names.functions.items()),
    )
    read = {
        key: known.put_in(
            _formula(motion[name], known.names, f"the acceleration of {name}", f"/motion/{name}")
        )
        for key, name in free.items()
    }
    return motion_on(system, read)


def _formula(text: str, names: nm.Names, what: str, pointer: str) -> Expression:
    with reader.placed_at(pointer):
        tree = substitute(reader.read_formula(text, names), dict(names.definitions))
    return reader.without_accelerations(tree, what, pointer)


def read_lagrangian(text: str, names: nm.Names) -> Expression:
    """L(t, q, q') of a text; InputError where an acceleration is in it, or no velocity."""
    pointer = "/lagrangian"
    tree = _formula(text, replace(names, energy=True), "the Lagrangian", pointer)
    if not ex.has(tree, Velocity):
        raise InputError(
            "the Lagrangian contains no velocity: write kinetic minus potential energy.", pointer
        )
    return _smooth(tree, pointer)


def _smooth(tree: Expression, pointer: str) -> Expression:
    """The tree; InputError where it is piecewise and its derivatives are looked for."""
    with reader.placed_at(pointer):
        for leaf in {node for node in walk(tree) if isinstance(node, Symbol | Velocity)}:
            differentiate(tree, leaf)
    return tree


def _constraints(constraints: Sequence[str] | str, names: nm.Names, most: int) -> list[Expression]:
    found: list[Expression] = []
    for pointer, text in _by_pointer(constraints).items():
        with reader.placed_at(pointer):
            pairs = reader.read_equations(text, replace(names, forms=True))
        for left, right in pairs:
            tree = substitute(left - right, dict(names.definitions))
            if len(pairs) == 1:
                _refuse_holonomic(tree, names, text, pointer, len(found) + 1)
            tree = reader.without_accelerations(
                _multiplied_out(tree), f"constraint {len(found) + 1}", pointer
            )
            found.append(_smooth(tree, pointer))
    if not found:
        raise InputError(
            "there are no constraints: give at least one, or send the equations of motion as a system.",
            "/constraints",
        )
    if len(found) > most:
        raise LimitError(
            f"there are {len(found)} constraints: the limit is {most}; write fewer.", "/constraints"
        )
    return found


def _refuse_holonomic(
    tree: Expression, names: nm.Names, text: str, pointer: str, number: int
) -> None:
    """InputError for a constraint of positions, which suggests its derivative in time instead."""
    nodes = {*walk(tree)}
    moving = nodes & {Symbol(name) for name in names.coordinates}
    if moving and not any(isinstance(node, Velocity | ex.Acceleration) for node in nodes):
        slope = f"{to_text(differentiate_in_time(tree, names.coordinates))} = 0"
        column = len(text) - len(text.lstrip()) + 1
        raise InputError(
            _HOLONOMIC.format(number), pointer, column, (slope,), (column, len(text.rstrip()) + 1)
        )


def _multiplied_out(tree: Expression) -> Expression:
    """The tree times the velocities that it divides by, y' - x' tan(theta) for y'/x' =
    tan(theta).
    """
    below: dict[Expression, None] = {}
    for node in walk(tree):
        match node:
            case ex.Power(base, ex.Number(exponent)) if exponent < 0 and ex.has(base, Velocity):
                below[base**-exponent] = None
    return collecting.collect(ex.multiply(tree, *below)) if below else tree


def _by_pointer(constraints: Sequence[str] | str) -> dict[str, str]:
    if isinstance(constraints, str):
        return {"/constraints": constraints}
    return {f"/constraints/{place}": text for place, text in enumerate(constraints)}
