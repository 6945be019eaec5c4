"""The class L = (I_1 r1'^2 + I_2 r2'^2 + sum I_a s_a'^2)/2 - V, s_a' = -A_a(r1) r2', seen by its
structure.

With N = (I_2 + sum I_a A_a^2)^(-1/2) and K = sum I_a A_a A_a' its motion without V is r1'' = 0,
r2'' = -N^2 K r1' r2', and w = (r2', s_1', …, s_k') = c u(r1) with u = N (1, -A_1, …, -A_k) and c
constant.

Associated systems are second-order systems whose motion on the constraints is that one; forces
without velocities stay:

    first    the accelerations as they come, all velocities written by the free ones second   in
    s'', where s' = c(q) u_j with one free velocity u_j, each term with u_j has s'/c in its place
    third    w' = r1' M(r1) w with M skew for the masses, a rotation

Without a force the last two are variational. With D = diag(I_2, I_a), a symmetric regular S(r1)
with S u = constant, and F the places that are not coupled:

    w' = r1' M w, M = -S^-1 S',  L = I_1 r1'^2/2 + sum over F of I_i w_i^2/2 + w^T S w/(2 r1'),
    H = (p_r1 + p^T S^-1 p/2)^2/(2 I_1) + sum over F of p_i^2/(2 I_i).

    second   S = diag(1/u_i), F empty (L1 of Proposition 1), or F = {r2} where N is constant (L2)
    third    S a reflection in the metric D, F the constant entries of u; J are the others, e the
    first of J:
             two in J     S = ((I_e u_e, I_j u_j), (I_j u_j, -I_j u_e)), rational in u more in J
             S_ej = sqrt(I_e) I_j u_j, the others as in `_fill_space`; regular where
                          sqrt(I_e) u_e > -sqrt(rho)

rho = sum over J of I_i u_i^2 is constant, and S u = (rho, 0, …, 0) up to a constant, so that the
image of the constraints is linear in the momenta. With one in J, u would be constant too. These are
proposals: nothing is claimed of them until the checker has confirmed them. Source: T. Mestdag, A.
M. Bloch, O. E. Fernandez, Hamiltonization and geometric integration of nonholonomic mechanical
systems, 2009, Propositions 1 and 2; the rotation is derived here (for one constraint in T.
Mestdag's systems see docs/explanation/constrained-systems.md).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal, NamedTuple

from inverse_service.expressions import calculus, collecting
from inverse_service.expressions.tree import (
    HALF,
    ZERO,
    Expression,
    Number,
    Symbol,
    Velocity,
    add,
    number,
    square_root,
)
from inverse_service.field.exact_field import Quotient, TooLarge, sum_of
from inverse_service.mechanics import euler_lagrange, legendre, nonholonomic_integrals, writing
from inverse_service.mechanics.constrained_motion import (
    EliminatedMotion,
    Frame,
    Geometry,
    frames,
    open_places,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Matrix = list[list[Expression]]

Kind = Literal["first", "second", "third"]
KINDS: tuple[Kind, ...] = ("first", "second", "third")
_FIRST = "The accelerations as d'Alembert's principle gives them, with the dependent velocities written by the free ones."

_Rows = Sequence[Sequence[Expression]]


@dataclass(frozen=True, slots=True)
class PaperClass:
    """The roles of the coordinates (places in the system) and the functions of the class.

    `masses` are I_2, I_1', … of the coordinates `moving` = (r2, s_1, …); `slopes` are A_1, …, A_k.
    `has_force` says that V is not constant; `force_fits` that V depends on r2 at most.
    """

    geometry: Geometry
    frame: Frame
    r1: int
    r2: int
    mass_of_r1: Quotient
    masses: tuple[Quotient, ...]
    slopes: tuple[Quotient, ...]
    has_force: bool
    force_fits: bool

    @property
    def names(self) -> tuple[str, ...]:
        return self.geometry.system.coordinates

    @property
    def weights(self) -> list[Expression]:
        """The masses as formulas."""
        return list(map(self.geometry.tree, self.masses))

    @property
    def moving(self) -> tuple[int, ...]:
        """r2 and s_1, …, s_k."""
        return (self.r2, *self.frame.dependent)

    @property
    def directions(self) -> tuple[Quotient, ...]:
        """u / N = (1, -A_1, …, -A_k)."""
        return (self.geometry.ring.constant(1), *(-slope for slope in self.slopes))

    @property
    def inverse_square_density(self) -> Quotient:
        """1/N^2 = I_2 + sum I_a A_a^2."""
        terms = [
            mass * entry * entry for mass, entry in zip(self.masses, self.directions, strict=True)
        ]
        return sum_of(self.geometry.zero, terms)

    @property
    def density(self) -> Expression:
        """N up to a constant factor, in its simplest form: 1 where it is constant, cos(phi) for A =
        tan(phi).
        """
        ring, square = self.geometry.ring, self.inverse_square_density
        found = nonholonomic_integrals.potential(
            ring, [1 + self.r1], [-(self.slope_of_density / square)]
        )
        whole = self.geometry.tree(square) ** Fraction(-1, 2)
        if found is None:
            return whole
        return found.made_positive(ring, self.geometry.real_point([whole])).exponential(ring)

    @property
    def slope_of_density(self) -> Quotient:
        """K = sum I_a A_a A_a'."""
        terms = [
            mass * slope * self.by_r1(slope)
            for mass, slope in zip(self.masses[1:], self.slopes, strict=True)
        ]
        return sum_of(self.geometry.zero, terms)

    def by_r1(self, element: Quotient) -> Quotient:
        return self.geometry.by_coordinate(self.r1, element)


class Recognized(NamedTuple):
    """The class of a motion, or None and why it has none."""

    found: PaperClass | None
    reason: str


def recognized(parts: Geometry) -> Recognized:
    """The system as a member of the class, or the reason why it is none.

    Every choice of dependent coordinates is tried, the most convenient one first; one in which V
    depends on r2 at most is preferred.
    """
    reason = _kinetic_fault(parts)
    if reason:
        return Recognized(None, reason)
    if parts.size - len(parts.rows) != 2:
        count = parts.size - len(parts.rows)
        return Recognized(
            None,
            f"the constraints leave {count} free velocit{'y' if count == 1 else 'ies'}, but the class has two",
        )
    found = [member for choice in frames(parts) for member in _members(parts, choice)]
    if not found:
        return Recognized(
            None,
            "the constraints are not of the form s' = -A(r1) r2' with one r1 and one r2 for all of them",
        )
    return Recognized(next((member for member in found if member.force_fits), found[0]), "")


def _kinetic_fault(parts: Geometry) -> str:
    """Why the Lagrangian or the constraints cannot be those of the class; nothing if they can."""
    n = parts.size
    if any(not parts.mass[i][j].is_zero for i in range(n) for j in range(n) if i != j):
        return "the kinetic energy has mixed terms, but the class requires a sum of squares of velocities"
    if any(parts.depends_on_position(parts.mass[i][i]) for i in range(n)):
        return "the kinetic energy depends on the position, but the class requires constant coefficients"
    if any(parts.mass[i][i].is_zero for i in range(n)):
        return "a velocity does not occur in the kinetic energy"
    if any(parts.depends_on_position(entry) for entry in parts.linear):
        return "the Lagrangian has terms linear in the velocities"
    if any(not offset.is_zero for offset in parts.offsets):
        return "a constraint has a velocity-free term"
    return ""


def _members(parts: Geometry, choice: Frame) -> list[PaperClass]:
    """The class with each of the two free coordinates as r1, where that fits."""
    found = []
    for place in (0, 1):
        r1, r2 = choice.free[place], choice.free[1 - place]
        column_r1 = [choice.basis[k][place] for k in choice.dependent]
        slopes = tuple(-choice.basis[k][1 - place] for k in choice.dependent)
        if any(not entry.is_zero for entry in column_r1) or not all(
            _only(parts, slope, r1) for slope in slopes
        ):
            continue
        masses = tuple(parts.mass[k][k] for k in (r2, *choice.dependent))
        force, fits = parts.depends_on_position(parts.potential), _only(parts, parts.potential, r2)
        found.append(
            PaperClass(parts, choice, r1, r2, parts.mass[r1][r1], masses, slopes, force, fits)
        )
    return found


def _only(parts: Geometry, element: Quotient, place: int) -> bool:
    """Whether the element depends on this coordinate at most."""
    others = [parts.by_coordinate(k, element) for k in range(parts.size) if k != place]
    return all(slope.is_zero for slope in [*others, parts.by_time(element)])


@dataclass(frozen=True, slots=True)
class Rotation:
    """M, S, and its inverse over the coordinates `moving` of a member; `turning` are the places
    J.
    """

    turning: tuple[int, ...]
    generator: _Rows
    form: _Rows
    inverse: _Rows


def rotation(member: PaperClass) -> Rotation:
    """The rotation of a member of the class; the zero matrix where u is constant (integrable
    constraints).
    """
    r1, masses = Symbol(member.names[member.r1]), member.weights
    square = member.inverse_square_density
    entries = enumerate(member.directions)  # u_i = N (1, -A)_i is constant where (u_i^2)' = 0
    constant = [place for place, entry in entries if member.by_r1(entry * entry / square).is_zero]
    turning = tuple(place for place in range(len(masses)) if place not in constant)
    size = len(masses)
    generator, form = _zeros(size), _zeros(size)
    for place in constant:
        form[place][place] = masses[place]
    if turning:
        fill = _fill_plane if len(turning) == 2 else _fill_space
        fill(generator, form, turning, masses, _unit(member), r1)
    return Rotation(turning, generator, form, _inverse(form, turning, masses))


def _zeros(size: int) -> Matrix:
    return [[ZERO] * size for _ in range(size)]


def _unit(member: PaperClass) -> list[Expression]:
    """u up to a constant factor: N (1, -A)."""
    density = member.density
    return [
        writing.as_one_quotient(density * member.geometry.tree(entry))
        for entry in member.directions
    ]


def _fill_space(
    generator: Matrix, form: Matrix, turning: Sequence[int], masses: Sequence[Expression], u: Sequence[Expression],
    r1: Symbol,
) -> None:  # fmt: skip
    """M and S on the places J: a reflection that takes u to a multiple of the first unit vector of
    J.
    """
    first, others = turning[0], turning[1:]
    rho = writing.as_one_quotient(add(*(masses[k] * u[k] ** 2 for k in turning)))
    norm, root = (
        collecting.collect(square_root(rho)),
        collecting.collect(square_root(masses[first])),
    )
    height = root * u[first]
    below = norm + height
    for k in others:
        form[first][k] = form[k][first] = writing.as_one_quotient(root * masses[k] * u[k])
        for m in others:
            square = masses[k] * masses[m] * u[k] * u[m] / below
            form[k][m] = writing.as_one_quotient(square - norm * masses[k] if k == m else square)
    form[first][first] = writing.as_one_quotient(root * masses[first] * u[first])
    slopes = [calculus.differentiate(entry, r1) for entry in u]
    lifted = {k: u[k] for k in others} | {first: u[first] + norm / root}
    scale = (norm * below) ** -1
    for k in turning:
        for m in turning:
            wedge = slopes[k] * lifted[m] - lifted[k] * slopes[m]
            generator[k][m] = ZERO if k == m else writing.as_one_quotient(masses[m] * wedge * scale)


def _fill_plane(
    generator: Matrix, form: Matrix, turning: Sequence[int], masses: Sequence[Expression], u: Sequence[Expression],
    r1: Symbol,
) -> None:  # fmt: skip
    i, j = turning
    rho = masses[i] * u[i] ** 2 + masses[j] * u[j] ** 2
    wedge = calculus.differentiate(u[i], r1) * u[j] - calculus.differentiate(u[j], r1) * u[i]
    speed = wedge / rho
    generator[i][j] = writing.as_one_quotient(masses[j] * speed)
    generator[j][i] = writing.as_one_quotient(-(masses[i] * speed))
    form[i][i] = writing.as_one_quotient(masses[i] * u[i])
    form[i][j] = form[j][i] = writing.as_one_quotient(masses[j] * u[j])
    form[j][j] = writing.as_one_quotient(-(masses[j] * u[i]))


def _inverse(form: Matrix, turning: Sequence[int], masses: Sequence[Expression]) -> Matrix:
    """S^-1 = c D^-1 S D^-1 on the places J, as S is a multiple of a reflection; 0 elsewhere."""
    found = _zeros(len(masses))
    if not turning:
        return found
    first = turning[0]
    # (S D^-1 S)_ee = S_ee / c
    square = add(*(form[first][k] ** 2 / masses[k] for k in turning))
    scale = writing.as_one_quotient(masses[first] / square)
    for i in turning:
        for j in turning:
            found[i][j] = writing.as_one_quotient(scale * form[i][j] / (masses[i] * masses[j]))
    return found


def _explanation(turning: Sequence[str], driver: str) -> str:
    if not turning:
        return "The direction of the velocities does not change: without forces all accelerations are zero."
    text = (
        f"The velocities of {', '.join(turning)} turn as a vector of constant length (in the masses) with "
        f"angular velocity proportional to {driver}'."
    )
    if len(turning) > 2:
        text += " The rotation is the one that takes the velocity to a fixed axis by a reflection."
    return text


# The two Lagrangians of Proposition 1, in the words of the class.
FIRST_FAMILY = "Lagrangian with all other velocities over r_1'"
SECOND_FAMILY = "Lagrangian with all other velocities but r_2' over r_1'"


@dataclass(frozen=True, slots=True)
class AssociatedSystem:
    """`system` is None where `explanation` says why this kind is not defined."""

    kind: str
    system: SecondOrderSystem | None
    explanation: str


def associated(
    motion: EliminatedMotion, member: PaperClass | None, reason: str, kind: Kind
) -> AssociatedSystem:
    """One associated system of the motion; `reason` says why the system is outside the class, if it
    is.
    """
    if kind == "first":
        return _defined(motion, kind, map(motion.geometry.tree, motion.accelerations), _FIRST)
    if kind == "second":
        return _second(motion, member)
    if member is None:
        return AssociatedSystem(
            kind,
            None,
            f"The third system is defined only in the class s' = -A(r_1) r_2': {reason}.",
        )
    return _third(motion, member)


def with_multiples(
    base: AssociatedSystem, multiples: Sequence[Expression], name: str
) -> AssociatedSystem:
    """f plus what a user adds to each acceleration; that it vanishes on the constraints is not
    tested here.
    """
    if base.system is None:
        return base
    system = base.system
    summed = tuple(f + extra for f, extra in zip(system.accelerations, multiples, strict=True))
    title = f"{system.name}, with multiples of the constraints"
    changed = replace(system, accelerations=summed, name=title)
    return AssociatedSystem(
        name, changed, f"{base.explanation} The given multiples of the constraints are added."
    )


def _defined(
    motion: EliminatedMotion, kind: str, trees: Iterable[Expression], explanation: str
) -> AssociatedSystem:
    """The associated system with these accelerations."""
    given, accelerations = motion.geometry.system, tuple(trees)
    title = f"{given.name}, {kind} associated system" if given.name else f"{kind} associated system"
    system = SecondOrderSystem(
        given.coordinates, accelerations, given.parameters, given.functions, title
    )
    places = open_places(motion.geometry, motion.frame, accelerations, motion.inertia)
    return AssociatedSystem(kind, replace(system, nonzero=places), explanation)


def _second(motion: EliminatedMotion, member: PaperClass | None) -> AssociatedSystem:
    parts, choice = motion.geometry, motion.frame
    names = parts.system.coordinates
    accelerations = list(motion.accelerations)
    for place in choice.dependent:
        row = choice.basis[place]
        columns = [j for j, entry in enumerate(row) if not entry.is_zero]
        if len(columns) > 1 or not choice.drift[place].is_zero:
            what = "several free velocities" if len(columns) > 1 else "a velocity-free term too"
            reason = f"the velocity of {names[place]} depends on {what}, so that no product is replaced in one way"
            return AssociatedSystem("second", None, f"The second system is not defined: {reason}.")
        if columns:
            free = choice.free[columns[0]]
            accelerations[place] = _replaced(
                motion, accelerations[place], free, place, row[columns[0]]
            )
    plain = (
        "In s'' = ... each term with the free velocity that s' is a multiple of has s' in its place"
    )
    rest = (
        " (the rule of the class s' = -A(r_1) r_2', used outside it)."
        if member is None
        else ": r1' r2' = -r1' s'/A."
    )
    return _defined(motion, "second", map(parts.tree, accelerations), plain + rest)


def _replaced(
    motion: EliminatedMotion, element: Quotient, free: int, place: int, ratio: Quotient
) -> Quotient:
    """One factor u_free of each term becomes s'/ratio."""
    parts = motion.geometry
    speed = parts.velocity(free)
    other = parts.velocity(place) / ratio
    terms = []
    for part in writing.velocity_parts(parts.ring, element):
        holds = not parts.by_velocity(free, part).is_zero
        terms.append(part / speed * other if holds else part)
    return sum_of(parts.zero, terms)


def _third(motion: EliminatedMotion, member: PaperClass) -> AssociatedSystem:
    parts = motion.geometry
    trees = [parts.tree(element) for element in motion.accelerations]
    forces = [parts.tree(_velocity_free(motion, element)) for element in motion.accelerations]
    turned = rotation(member)
    masses = member.weights
    if len(turned.turning) > 2 and any(
        isinstance(mass, Number) and mass.value < 0 for mass in masses
    ):
        text = "The third system is not defined: with three and more turning velocities all masses have to be positive."
        return AssociatedSystem("third", None, text)
    names = parts.system.coordinates
    rate, speeds = Velocity(names[member.r1]), [Velocity(names[place]) for place in member.moving]
    for place, row in zip(member.moving, turned.generator, strict=True):
        terms = (
            writing.as_one_quotient(entry * rate * speed)
            for entry, speed in zip(row, speeds, strict=True)
        )
        trees[place] = add(*terms) + forces[place]
    text = _explanation([names[member.moving[place]] for place in turned.turning], names[member.r1])
    return _defined(motion, "third", trees, text)


def _velocity_free(motion: EliminatedMotion, element: Quotient) -> Quotient:
    parts = motion.geometry
    held = [
        part
        for part in writing.velocity_parts(parts.ring, element)
        if all(parts.by_velocity(k, part).is_zero for k in motion.frame.free)
    ]
    return sum_of(parts.zero, held)


@dataclass(frozen=True, slots=True)
class Proposal:
    """The Legendre transform of a Lagrangian, the image of the constraints in phase space, and
    where it comes from.

    `images` is empty where u is constant and nothing is coupled, and for equations without
    constraints.
    """

    source: str
    transform: legendre.LegendreTransform
    images: tuple[Expression, ...]


def propose_lagrangians(member: PaperClass, kind: str) -> tuple[Proposal, ...]:
    """The proposals for one kind of associated system; none for the first, and none where there is
    a force.

    There are also none where they would be too large or where the time of the member's ring is
    over.
    """
    if member.has_force or kind not in ("second", "third"):
        return ()
    try:
        if kind == "second":
            return _of_second(member)
        turned = rotation(member)
        return (
            _proposal(
                member, "Lagrangian of the rotation", turned.form, turned.inverse, turned.turning
            ),
        )
    except (TooLarge, ZeroDivisionError):
        return ()


def _of_second(member: PaperClass) -> tuple[Proposal, ...]:
    directions = member.directions
    if any(entry.is_zero for entry in directions):
        return ()
    trees = [member.geometry.tree(entry) for entry in directions]
    size = len(trees)
    density, form, inverse = member.density, _zeros(size), _zeros(size)
    for place, tree in enumerate(trees):
        sign = number(1 if place == 0 else -1)
        form[place][place] = writing.as_one_quotient(sign / (density * tree))
        inverse[place][place] = writing.as_one_quotient(sign * density * tree)
    everything = tuple(range(size))
    first = _proposal(member, FIRST_FAMILY, form, inverse, everything)
    if not member.slope_of_density.is_zero:
        return (first,)
    return first, _proposal(member, SECOND_FAMILY, form, inverse, everything[1:])


def _proposal(
    member: PaperClass, label: str, form: _Rows, inverse: _Rows, coupled: Sequence[int]
) -> Proposal:
    moving, masses = [Velocity(member.names[place]) for place in member.moving], member.weights
    free = [place for place in range(len(moving)) if place not in coupled]
    rate = Velocity(member.names[member.r1])
    kinetic = [HALF * member.geometry.tree(member.mass_of_r1) * rate**2]
    kinetic += [HALF * masses[place] * moving[place] ** 2 for place in free]
    terms = [writing.as_one_quotient(term / rate) for term in _quadratic(form, moving, coupled)]
    lagrangian = add(*kinetic, *terms)
    transform = _transform(member, lagrangian, inverse, coupled)
    return Proposal(label, transform, _images(member, form, coupled, transform))


def _quadratic(
    matrix: _Rows, vector: Sequence[Expression], places: Sequence[int]
) -> list[Expression]:
    """The terms of x^T M x / 2 over some places."""
    terms = []
    for position, i in enumerate(places):
        terms.append(HALF * matrix[i][i] * vector[i] ** 2)
        terms += [matrix[i][j] * vector[i] * vector[j] for j in places[position + 1 :]]
    return [term for term in terms if term != ZERO]


def _transform(
    member: PaperClass, lagrangian: Expression, inverse: _Rows, coupled: Sequence[int]
) -> legendre.LegendreTransform:
    """H and v(q, p) written down; r1' = (p_r1 + p^T S^-1 p/2)/I_1, w = r1' S^-1 p, w_i = p_i/I_i on
    F.
    """
    symbols, note = legendre.momentum_symbols(lagrangian, member.names)
    p = [symbols[place] for place in member.moving]
    mass, masses = member.geometry.tree(member.mass_of_r1), member.weights
    inner = add(
        symbols[member.r1],
        *(writing.as_one_quotient(term) for term in _quadratic(inverse, p, coupled)),
    )
    rate = inner / mass
    velocities: dict[int, Expression] = {member.r1: rate}
    energies = [HALF * inner**2 / mass]
    for i, place in enumerate(member.moving):
        if i in coupled:
            turned = add(
                *(
                    writing.as_one_quotient(inverse[i][j] * p[j])
                    for j in coupled
                    if inverse[i][j] != ZERO
                )
            )
            velocities[place] = turned * rate
        else:
            velocities[place] = p[i] / masses[i]
            energies.append(HALF * p[i] ** 2 / masses[i])
    found = tuple(velocities[place] for place in range(len(member.names)))
    functions = tuple(
        map(writing.as_one_quotient, euler_lagrange.momenta(lagrangian, member.names))
    )
    return legendre.LegendreTransform(
        lagrangian, symbols, add(*energies), functions, found, False, note, found
    )


def _images(
    member: PaperClass, form: _Rows, coupled: Sequence[int], transform: legendre.LegendreTransform
) -> tuple[Expression, ...]:
    """The constraints in phase space: p_w is parallel to S u on the coupled places, p_i = I_i u_i c
    on the free ones.

    With e the first coupled place: p_i - (Su)_i/(Su)_e p_e, and I_1 p_i - I_i u_i/(Su)_e (p_r1 +
    ...) p_e.
    """
    p = [transform.symbols[place] for place in member.moving]
    if not coupled:
        return ()
    assert transform.velocities is not None
    directions = [member.geometry.tree(entry) for entry in member.directions]
    su = [add(*(row[j] * directions[j] for j in coupled if row[j] != ZERO)) for row in form]
    constants = [entry if i in coupled else ZERO for i, entry in enumerate(su)]
    first = coupled[0]
    ratios = [writing.as_one_quotient(constants[i] / constants[first]) for i in coupled[1:]]
    found = [p[i] - ratio * p[first] for i, ratio in zip(coupled[1:], ratios, strict=True)]
    rate = transform.velocities[member.r1]
    for i in range(len(p)):
        if i not in coupled:
            factor = writing.as_one_quotient(member.weights[i] * directions[i] / constants[first])
            found.append(p[i] - factor * p[first] * rate)
    return tuple(found)
