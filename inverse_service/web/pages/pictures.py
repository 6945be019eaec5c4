"""Which picture shows a motion, and the sentence below it: chosen by what is known of the system.

A picture makes a statement, so it follows from L, from conserved quantities, from constraints or
from the form of the equations; names choose only what no formula says (r, phi as polar
coordinates). What is known is proven or is structure: a formula that is not of the expected form
gets the plainer picture, whose statement is weaker.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import mpmath

from inverse_service.expressions import calculus, collecting, printing, terms as tm, tree as ex
from inverse_service.mechanics import euler_lagrange, writing
from inverse_service.reading import names as nm
from inverse_service.service.documents import sheets

RADII = frozenset({"r", "rho", "R", "s"})
TURNS = frozenset({"phi", "theta", "varphi", "vartheta", "psi", "alpha", "beta"})
WALLED = frozenset({"tan", "cot", "sec", "csc"})
MOST_LINES = 10  # coordinates that have a line each
MOST_POINTS = 5  # whose paths are drawn in one plane
MOST_NODES = 3_000  # of the three conditions on g
LEAST = mpmath.mpf(10) ** -6  # of their determinant in parts of the lengths of its rows
FARTHEST = 1.5  # of a g that is drawn, from the middle of the circle on which det g = 0
Matrix = Sequence[Sequence[ex.Expression]]
Point = Mapping[ex.Expression, mpmath.mpf]


@dataclass(frozen=True, slots=True)
class Facts:
    """What is known of a motion: its formulas, L, conserved quantities with their names and texts,
    and its cases.

    `accelerations` are empty for a computed motion; `velocities` are those that the constraints
    give. `tensors` are Phi and nabla Phi of two coordinates, (2, 2), where L or that there is none
    is known. A case is the text of its condition with its trees, which are positive there.
    """

    names: nm.Names
    accelerations: tuple[ex.Expression, ...]
    angles: tuple[str, ...] = ()
    time: str = "t"
    values: Mapping[str, float] = field(default_factory=dict)
    lagrangian: ex.Expression | None = None
    integrals: tuple[tuple[str, str, ex.Expression], ...] = ()
    constraints: tuple[ex.Expression, ...] = ()
    velocities: Mapping[str, ex.Expression] = field(default_factory=dict)
    tensors: tuple[Matrix, Matrix] | None = None
    cases: tuple[tuple[str, tuple[ex.Expression, ...]], ...] = ()

    @property
    def coordinates(self) -> tuple[str, ...]:
        return self.names.coordinates

    def said(self, text: str) -> sheets.Formula:
        """A formula of a caption."""
        return sheets.Formula(text, self.names)

    def is_constant(self, tree: ex.Expression) -> bool:
        """Whether only parameters occur in a tree."""
        moving = {
            *map(ex.Symbol, (*self.coordinates, self.time)),
            *map(ex.Velocity, self.coordinates),
        }
        return not any(node in moving or isinstance(node, ex.Arbitrary) for node in ex.walk(tree))

    def is_positive(self, tree: ex.Expression) -> bool:
        """Whether a constant is positive for the values with which the picture begins."""
        return self.is_constant(tree) and self.value(tree, {}) > 0

    def value(self, tree: ex.Expression, point: Point) -> mpmath.mpf:
        """A tree at a point; nan where it has no value."""
        table: dict[ex.Expression, mpmath.mpf] = dict(point)
        table |= {ex.Symbol(name): mpmath.mpf(number) for name, number in self.values.items()}
        try:
            return calculus.evaluate(tree, table)
        except (calculus.NoRealValue, ArithmeticError, KeyError):
            return mpmath.nan


@dataclass(frozen=True, slots=True)
class Picture:
    """A kind of picture, the sentence below it, and the trees and names that its drawing needs."""

    kind: str
    caption: sheets.Sentence = ()
    trees: Mapping[str, Any] = field(default_factory=dict)


def picture_of(facts: Facts) -> Picture:
    """The picture of a motion."""
    if facts.constraints:
        return _of_constraints(facts)
    if len(facts.coordinates) == 1:
        return _of_one(facts)
    if len(facts.coordinates) == 2:
        return next(found for choose in _OF_TWO if (found := choose(facts)) is not None)
    return _of_many(facts)


def _collected(tree: ex.Expression) -> ex.Expression:
    return collecting.collect(tree)


def _is_zero(tree: ex.Expression) -> bool:
    """Whether a tree is seen to be zero: collected, simplified, or as terms, in which tanh is sinh / cosh."""
    return (
        _collected(tree) == ex.ZERO or writing.simplified(tree) == ex.ZERO or not tm.terms_of(tree)
    )


def natural_of(facts: Facts) -> tuple[euler_lagrange.Matrix, ex.Expression] | None:
    """M(q) and V(q) of L = v M v / 2 - V; None if L is of another form."""
    if facts.lagrangian is None or ex.holds(facts.lagrangian, ex.Symbol(facts.time)):
        return None
    rates = [ex.Velocity(name) for name in facts.coordinates]
    mass = euler_lagrange.hessian(facts.lagrangian, facts.coordinates)
    if any(ex.has(entry, ex.Velocity) for row in mass for entry in row):
        return None
    half = ex.number(Fraction(1, 2))
    kinetic = [
        half * entry * u * v
        for u, row in zip(rates, mass, strict=True)
        for v, entry in zip(rates, row, strict=True)
    ]
    rest = _collected(ex.subtract(facts.lagrangian, ex.add(*kinetic)))
    return None if ex.has(rest, ex.Velocity) else (mass, _collected(ex.negate(rest)))


# One coordinate.


def _of_one(facts: Facts) -> Picture:
    (name,) = facts.coordinates
    if not facts.accelerations:
        return Picture("pendulum" if name in facts.angles else "phase")
    (f,) = facts.accelerations
    q, v = facts.said(name), facts.said(f"{name}'")
    if ex.holds(f, ex.Symbol(facts.time)):
        return Picture(
            "history", (q, " over ", facts.said(facts.time), ", as the equation contains the time.")
        )
    if facts.cases:
        return _of_cases(facts)
    natural = natural_of(facts)
    # A rod passes each angle, and tan(x) has walls.
    is_angle = name in facts.angles and not any(
        isinstance(node, ex.Apply) and node.function in WALLED for node in ex.walk(f)
    )
    if natural and _falls(facts, natural) and not is_angle:
        trees = {"mass": natural[0][0][0], "potential": natural[1]}
        said: sheets.Sentence = (
            _L,
            " is ",
            _theory("T - V"),
            ": the point rolls on the graph of ",
            _theory("V"),
        )
        return Picture("well", (*said, ", as high as its energy ", _theory("E"), " allows."), trees)
    is_all = natural is not None and not is_angle and _is_all_of_it(facts, natural)
    if natural and is_all and (found := _rulers(facts, natural)) is not None:
        return found
    if natural and is_all and _turns_back(facts, natural[1]):
        trees = {"mass": natural[0][0][0], "potential": natural[1]}
        said = (_L, " is ", _theory("T - V"), ": the point is on the graph of ", _theory("V"))
        return Picture("well", (*said, ", as high as its energy ", _theory("E"), " allows."), trees)
    position, slope = (
        calculus.differentiate(f, ex.Symbol(name)),
        calculus.differentiate(f, ex.Velocity(name)),
    )
    position, slope = _collected(position), _collected(slope)
    rest = ex.subtract(f, ex.add(position * ex.Symbol(name), slope * ex.Velocity(name)))
    if facts.is_positive(ex.negate(position)) and facts.is_constant(slope) and _is_zero(rest):
        said = ("It moves as a mass on a spring does, above the plane of ", q, " and ", v)
        return Picture("spring", (*said, *_area(facts, slope)), _rate(facts, slope))
    if is_angle:
        said = ("A rod at the angle ", q, ", above the plane of ", q, " and ", v)
        return Picture("pendulum", (*said, *_area(facts, slope)), _rate(facts, slope))
    above: sheets.Sentence = ("Above, ", q, " over ", facts.said(facts.time))
    said = (*above, "; below, the arrows show where each ", q, " and ", v, " lead")
    return Picture("times", (*said, *_area(facts, slope)), _rate(facts, slope))


def _of_cases(facts: Facts) -> Picture:
    """The plane in parts: of q and v for one coordinate, of both coordinates for two."""
    own = "equation" if len(facts.coordinates) == 1 else "equations"
    told = [{"label": text, "sides": sides} for text, sides in facts.cases]
    said = f"Each part of the plane has its own {own} and its own formulas."
    return Picture("cases", (said,), {"cases": told})


_L = sheets.Formula("L", nm.Names(parameters=("L",)))


def _theory(text: str) -> sheets.Formula:
    """A formula of letters that are no names of the system."""
    return sheets.Formula(text, nm.Names(parameters=("T", "V", "E", "g", "L")))


def _area(facts: Facts, slope: ex.Expression) -> sheets.Sentence:
    """What a constant df/dv does to areas of starts, and the factor of L that makes up for it.

    L_vv f_v + d/dt L_vv = 0 for each L of one equation (Helmholtz, 1887), so L_vv times an area is
    constant.
    """
    if slope == ex.ZERO or not facts.is_constant(slope):
        return (".",)
    rate = ex.multiply(slope, ex.Symbol(facts.time))
    factor = facts.said(printing.to_text(ex.Apply("exp", rate)))
    said: sheets.Sentence = (". Each area in this plane changes by the factor ", factor)
    if facts.lagrangian is None:
        return (*said, ".")
    ((mass,),) = euler_lagrange.hessian(facts.lagrangian, facts.coordinates)
    kept = ex.Apply("exp", ex.negate(rate))
    if not facts.is_constant(_collected(mass * ex.Apply("exp", rate))):
        return (*said, ".")
    return (*said, ", which ", facts.said(printing.to_text(kept)), " in ", _L, " makes up for.")


def _rate(facts: Facts, slope: ex.Expression) -> dict[str, ex.Expression]:
    """The rate at which each area of starts grows, where it is a constant other than zero."""
    return {} if slope == ex.ZERO or not facts.is_constant(slope) else {"rate": slope}


def _rulers(facts: Facts, natural: tuple[euler_lagrange.Matrix, ex.Expression]) -> Picture | None:
    """Free motion, L = M(q) v^2 / 2: sqrt(M) v is constant, so s with ds = sqrt(M) dq is another ruler."""
    ((mass,),), potential = natural
    if not facts.is_constant(potential) or facts.is_constant(mass):
        return None
    (name,) = facts.coordinates
    speed = writing.simplified(ex.power(mass, ex.number(Fraction(1, 2))))
    said: sheets.Sentence = (
        "Free motion by another ruler: ", facts.said(printing.to_text(ex.multiply(speed, ex.Velocity(name)))),
        " is constant, so equal parts of the upper ruler are passed in equal times. Lines join it to the same ",
        facts.said(name), " below.",
    )  # fmt: skip
    return Picture("rulers", said, {"mass": mass})


def _is_all_of_it(facts: Facts, natural: tuple[euler_lagrange.Matrix, ex.Expression]) -> bool:
    """Whether M f + M' v^2 / 2 + V' = 0: besides L there is no force."""
    (name,), (f,), ((mass,),) = facts.coordinates, facts.accelerations, natural[0]
    slopes = [calculus.differentiate(one, ex.Symbol(name)) for one in (mass, natural[1])]
    turned = ex.number(Fraction(1, 2)) * slopes[0] * ex.power(ex.Velocity(name), 2)
    return _is_zero(ex.add(mass * f, turned, slopes[1]))


def _turns_back(facts: Facts, potential: ex.Expression) -> bool:
    """Whether V falls and rises within the reach of a picture; with a mass that depends on the place it says no more."""
    (name,) = facts.coordinates
    slope = calculus.differentiate(potential, ex.Symbol(name))
    slopes = [facts.value(slope, {ex.Symbol(name): mpmath.mpf(k) / 3}) for k in range(-7, 8)]
    return any(value < 0 for value in slopes) and any(value > 0 for value in slopes)


def _falls(facts: Facts, natural: tuple[euler_lagrange.Matrix, ex.Expression]) -> bool:
    """Whether M is diagonal, constant and positive, and M f = -dV/dq: no other force acts."""
    mass, potential = natural
    for i, (name, f) in enumerate(zip(facts.coordinates, facts.accelerations, strict=True)):
        others = (entry for j, entry in enumerate(mass[i]) if j != i)
        if not facts.is_positive(mass[i][i]) or any(entry != ex.ZERO for entry in others):
            return False
        if not _is_zero(ex.add(mass[i][i] * f, calculus.differentiate(potential, ex.Symbol(name)))):
            return False
    return True


# Two coordinates.


def _polar(facts: Facts) -> Picture | None:
    found = _radius_and_angle(facts)
    if found is None:
        return None
    r, phi = found
    u, rate = ex.Symbol(r), ex.Velocity(phi)
    places = [facts.coordinates.index(r), facts.coordinates.index(phi)]
    swept = ex.multiply(ex.power(u, 2), rate)
    polar: dict[str, Any] = {"polar": True, "round": places}
    said: sheets.Sentence = (facts.said(r), " and ", facts.said(phi), " as polar coordinates.")
    natural = natural_of(facts)
    if natural is not None and _hangs(facts, natural[1], (phi,), {u: mpmath.mpf(1)}):
        said = (*said[:-1], " as polar coordinates, ", facts.said(phi), " from below.")
        return Picture("central", said, {**polar, "hangs": True})
    if _is_kept(facts, lambda tree: facts.is_constant(_collected(ex.divide(tree, swept)))):
        rule = facts.said(printing.to_text(swept))
        said = (*said, " ", rule, " is constant: equal times sweep equal areas.")
        return Picture(
            "central", *_toward(facts, said, {**polar, "swept": swept}, _pull(facts, r, phi))
        )
    return Picture("central", said, polar)


def _radius_and_angle(facts: Facts) -> tuple[str, str] | None:
    """Which coordinates are those of a plane, by the kinetic energy, else by their names."""
    for r, phi in (facts.coordinates, facts.coordinates[::-1]):
        if (r in RADII and phi in TURNS) or _is_plane(facts, r, phi):
            return r, phi
    return None


def _pull(facts: Facts, r: str, phi: str) -> ex.Expression | None:
    """k of r'' = r phi'^2 - k/r^2."""
    if not facts.accelerations:
        return None
    u, f = ex.Symbol(r), facts.accelerations[facts.coordinates.index(r)]
    rest = ex.subtract(ex.multiply(u, ex.power(ex.Velocity(phi), 2)), f)
    return writing.simplified(ex.multiply(ex.power(u, 2), rest))


def _toward(
    facts: Facts, said: sheets.Sentence, known: dict[str, Any], pull: ex.Expression | None
) -> tuple[sheets.Sentence, dict[str, Any]]:
    """In a force k/r^2 to the center, v x (r x v)/k - r/|r| is conserved and points to the nearest point (Laplace)."""
    if pull is None or not facts.is_positive(pull):
        return said, known
    more = " The arrow is the conserved vector, which points to the nearest point of the orbit."
    return (*said, more), {**known, "pull": pull}


def _is_plane(facts: Facts, r: str, phi: str) -> bool:
    """Whether the kinetic energy is that of a point at the distance r from an axis, turned by phi
    about it: (M(r) r'^2 + c r^2 phi'^2) / 2.
    """
    natural = natural_of(facts)
    if natural is None:
        return False
    mass, _ = natural
    i, j = (facts.coordinates.index(name) for name in (r, phi))
    factor = _collected(ex.divide(mass[j][j], ex.power(ex.Symbol(r), 2)))
    is_free = not ex.holds(mass[i][i], ex.Symbol(phi))
    return facts.is_positive(factor) and mass[i][j] == ex.ZERO and is_free


def _is_kept(facts: Facts, is_this: Callable[[ex.Expression], bool]) -> bool:
    return any(is_this(tree) for _, _, tree in facts.integrals)


def _sphere(facts: Facts) -> Picture | None:
    """A point on a sphere, T = A (theta'^2 + sin(theta)^2 phi'^2)/2, with cos for an angle from the
    equator; or the axis of a top with two equal moments, T = A (theta'^2 + sin(theta)^2 phi'^2)/2 +
    C (psi' + cos(theta) phi')^2/2 (Lagrange).
    """
    natural = natural_of(facts)
    if natural is None:
        return None
    mass, potential = natural
    for tilt, turn, *spins in itertools.permutations(range(len(facts.coordinates))):
        angle = ex.Symbol(facts.coordinates[tilt])
        cos, sin = ex.Apply("cos", angle), ex.Apply("sin", angle)
        others = [mass[tilt][k] for k in (turn, *spins)]
        if not facts.is_positive(mass[tilt][tilt]) or any(part != ex.ZERO for part in others):
            continue
        rest = mass[turn][turn]
        for spin in spins:
            if not facts.is_positive(own := mass[spin][spin]):
                break
            if not _is_zero(ex.subtract(mass[turn][spin], own * cos)):
                break
            rest = ex.subtract(rest, own * ex.power(cos, 2))
        else:
            for wave in (sin, cos)[: 1 if spins else 2]:
                if _is_zero(ex.subtract(rest, mass[tilt][tilt] * ex.power(wave, 2))):
                    return _on_sphere(facts, tilt, turn, spins, potential, wave == cos)
    return None


def _on_sphere(
    facts: Facts,
    tilt: int,
    turn: int,
    spins: Sequence[int],
    potential: ex.Expression,
    from_equator: bool,
) -> Picture:
    names = facts.coordinates
    ends: list[mpmath.mpf] = []
    for value in (mpmath.mpf(0), +mpmath.pi):
        place: dict[ex.Expression, mpmath.mpf] = {ex.Symbol(name): mpmath.mpf(0) for name in names}
        place[ex.Symbol(names[tilt])] = value
        ends.append(facts.value(potential, place))
    hangs = not from_equator and bool(ends[0] < ends[1])
    pole = "equator" if from_equator else "lower pole" if hangs else "upper pole"
    angle, around = facts.said(names[tilt]), facts.said(names[turn])
    said: sheets.Sentence = (angle, f" from the {pole}, ", around, " around the axis of both poles")
    if spins:
        more: sheets.Sentence = ("; ", facts.said(names[spins[0]]), ", its own turn, is not drawn.")
        said = ("The tip of a top on a sphere: ", *said, *more)
    else:
        said = ("A point on a sphere: ", *said, ".")
    return Picture(
        "sphere", said, {"angles": [tilt, turn], "equator": from_equator, "hangs": hangs}
    )


def _central(facts: Facts) -> Picture | None:
    x, y = map(ex.Symbol, facts.coordinates)
    u, v = map(ex.Velocity, facts.coordinates)
    swept = ex.subtract(x * v, y * u)

    def is_swept(tree: ex.Expression) -> bool:
        factor = _collected(ex.divide(calculus.differentiate(tree, v), x))
        return (
            facts.is_constant(factor)
            and factor != ex.ZERO
            and _is_zero(ex.subtract(tree, factor * swept))
        )

    if facts.angles or not _is_kept(facts, is_swept):
        return None
    rule = facts.said(printing.to_text(swept))
    said: sheets.Sentence = (rule, " is constant: equal times sweep equal areas.")
    return Picture("central", *_toward(facts, said, {"swept": swept}, _pull_of_plane(facts)))


def _pull_of_plane(facts: Facts) -> ex.Expression | None:
    """k of x'' = -k x/r^3, y'' = -k y/r^3."""
    x, y = map(ex.Symbol, facts.coordinates)
    cube = ex.power(ex.add(ex.power(x, 2), ex.power(y, 2)), ex.number(Fraction(3, 2)))
    pulls = [
        writing.simplified(ex.negate(ex.divide(f * cube, place)))
        for place, f in zip((x, y), facts.accelerations, strict=False)
    ]
    return pulls[0] if len(pulls) == 2 and pulls[0] == pulls[1] else None


def _charge(facts: Facts) -> Picture | None:
    if not facts.accelerations:
        return None
    u, v = map(ex.Velocity, facts.coordinates)
    first, second = facts.accelerations
    strength = _collected(calculus.differentiate(first, v))
    if (
        facts.angles
        or strength == ex.ZERO
        or ex.has(strength, ex.Velocity)
        or ex.holds(strength, ex.Symbol(facts.time))
    ):
        return None
    if not (_is_zero(ex.subtract(first, strength * v)) and _is_zero(ex.add(second, strength * u))):
        return None
    x, y = (facts.said(name) for name in facts.coordinates)
    said = (
        "A charge in a field across the plane of ",
        x,
        " and ",
        y,
        ": dots are dense where it is strong. It turns the path",
    )
    return Picture("charge", (*said, " and leaves the speed as it is."), {"strength": strength})


def _rods(facts: Facts) -> Picture | None:
    """Rods, one hanging from the other."""
    names = facts.coordinates
    natural = natural_of(facts)
    if natural is None or set(facts.angles) != set(names):
        return None
    mass, potential = natural
    factors = _factors_of_rods(facts, mass, 0)
    if factors is None or not _hangs(facts, potential, names):
        return None
    lengths = [factors[k, len(names) - 1] for k in range(len(names))]
    said = (
        sheets.capitalized(_counted(len(names))),
        " from the vertical by ",
        *_enumerated(map(facts.said, names)),
        ".",
    )
    return Picture("rods", said, {"lengths": lengths})


def _counted(count: int) -> str:
    words = {1: "a rod", 2: "two rods", 3: "three rods", 4: "four rods", 5: "five rods"}
    return words.get(count, f"{count} rods")


def _factors_of_rods(
    facts: Facts, mass: Matrix, first: int
) -> dict[tuple[int, int], ex.Expression] | None:
    """c_ij, i <= j, if T = sum_ij c_ij cos(q_i - q_j) q_i' q_j' / 2 with c_ij = l_i l_j m_j, in
    which m_j is the mass from joint j on, for the coordinates from the first one on.
    """
    names, span = facts.coordinates, range(first, len(facts.coordinates))
    factors = {(k, k): mass[k][k] for k in span}
    for i, j in itertools.combinations(span, 2):
        a, b = ex.Symbol(names[i]), ex.Symbol(names[j])
        turns = (ex.Apply("cos", ex.subtract(a, b)), ex.Apply("cos", ex.subtract(b, a)))
        found = (_collected(ex.divide(mass[i][j], turn)) for turn in turns)
        factors[i, j] = next((one for one in found if facts.is_positive(one)), ex.ZERO)
    if not all(map(facts.is_positive, factors.values())):
        return None
    last = len(names) - 1
    is_chain = all(
        _is_zero(ex.subtract(factors[i, j] * factors[j, last], factors[j, j] * factors[i, last]))
        for i, j in factors
    )
    return factors if is_chain else None


def _enumerated(formulas: Iterable[sheets.Formula]) -> list[str | sheets.Formula]:
    """a, b and c."""
    *rest, last = formulas
    found: list[str | sheets.Formula] = []
    for formula in rest:
        found += [formula, ", "]
    return [*found[:-1], " and ", last] if rest else [last]


def _hangs(
    facts: Facts, potential: ex.Expression, angles: Sequence[str], place: Point | None = None
) -> bool:
    """Whether V is stationary at this place where the angles are 0, and grows with each of them."""
    zero: dict[ex.Expression, mpmath.mpf] = {
        ex.Symbol(name): mpmath.mpf(0) for name in facts.coordinates
    }
    zero |= place or {}
    for name in angles:
        slope = calculus.differentiate(potential, ex.Symbol(name))
        second = calculus.differentiate(slope, ex.Symbol(name))
        if facts.value(slope, zero) != 0 or not facts.value(second, zero) > 0:
            return False
    return True


def _cart(facts: Facts) -> Picture | None:
    """A slide from which rods hang: with its kinetic energy M x'^2 / 2 + sum_j m_j l_j cos(q_j) x' q_j'."""
    names = facts.coordinates
    natural = natural_of(facts)
    if natural is None or facts.angles != names[1:]:
        return None
    mass, potential = natural
    factors = _factors_of_rods(facts, mass, 1)
    if factors is None or not facts.is_positive(mass[0][0]):
        return None
    span, last = range(1, len(names)), len(names) - 1
    pushes = {
        k: _collected(ex.divide(mass[0][k], ex.Apply("cos", ex.Symbol(names[k])))) for k in span
    }
    if not (all(map(facts.is_positive, pushes.values())) and _hangs(facts, potential, names[1:])):
        return None
    if any(
        not _is_zero(ex.subtract(factors[k, k] * pushes[last], pushes[k] * factors[k, last]))
        for k in span
    ):
        return None
    lengths = [ex.divide(factors[k, last], pushes[last]) for k in span]
    x, *angles = (facts.said(name) for name in names)
    rods = _counted(len(angles))
    said = (
        "A slide at ",
        x,
        f" with {rods} at the angle{'s' * (len(angles) > 1)} ",
        *_enumerated(angles),
        ".",
    )
    return Picture("cart", said, {"lengths": lengths})


def _well_of_two(facts: Facts) -> Picture | None:
    natural = natural_of(facts)
    if natural is None or facts.angles:
        return None
    ((first, _), (_, second)), potential = natural
    if not facts.accelerations or facts.is_constant(potential) or not _falls(facts, natural):
        return None
    said = ("The path of ", *_point(facts), ". The point cannot leave the line ", _theory("V = E"))
    return Picture(
        "path",
        (*said, ", where it would be at rest."),
        {"potential": potential, "mass": {"first": first, "second": second}},
    )


def _none(facts: Facts) -> Picture | None:
    """Three lines without a common point, where there is no Lagrangian."""
    if facts.tensors is None or facts.lagrangian is not None:
        return None
    rows = _conditions(facts, facts.tensors)
    if _is_long(rows) or not _are_apart(facts, rows):
        return None
    said = (
        "Above, the path of ",
        *_point(facts),
        ". Below, each symmetric ",
        _theory("g"),
        " up to size is a point, and each of ",
    )
    return Picture(
        "none",
        (
            *said,
            "three conditions on it at this state is a line. Almost everywhere they have no point in ",
            "common: only ",
            _theory("g = 0"),
            " is left.",
        ),
        {"rows": rows},
    )


def agreement_of(facts: Facts) -> Picture | None:
    """The lines of the conditions beside a Lagrangian: each passes through its g_ij = d^2 L / dq_i' dq_j'."""
    if facts.tensors is None or facts.lagrangian is None:
        return None
    rows = _conditions(facts, facts.tensors)
    keys = [k for k, row in enumerate(rows) if any(part != ex.ZERO for part in row)]
    (first, between), (_, second) = euler_lagrange.hessian(facts.lagrangian, facts.coordinates)
    found = [first, between, second]
    if not keys or _is_long([*rows, found]) or not _is_near(facts, found):
        return None
    said: sheets.Sentence = (
        "Above, the path of ", *_point(facts), ". Below, each symmetric ", _theory("g"),
        " up to size is a point, within the circle if it is positive. Each condition on it at this state is a line, and each"
        " passes through the ", _theory("g"), " of ", _L, ", its second derivatives in the velocities.",
    )  # fmt: skip
    return Picture("agreement", said, {"rows": [rows[k] for k in keys], "keys": keys, "g": found})


def lines_of(facts: Facts) -> Picture | None:
    """The conditions on g as lines for each member of a family; None where they are too long, or
    each g satisfies them.
    """
    rows = [] if facts.tensors is None else _conditions(facts, facts.tensors)
    if not any(part != ex.ZERO for row in rows for part in row) or _is_long(rows):
        return None
    said: sheets.Sentence = (
        "Above, the path of ", *_point(facts), ". Below, each symmetric ", _theory("g"),
        " up to size is a point, within the circle if it is positive. Each condition on it at this state is a line; where"
        " there is a Lagrangian, its ", _theory("g"), " is on all of them.",
    )  # fmt: skip
    return Picture("none", said, {"rows": rows})


def _is_near(facts: Facts, g: Sequence[ex.Expression]) -> bool:
    """Whether the point of g, (g_11 - g_22, 2 g_12) / (g_11 + g_22), is near the unit circle at some state."""
    first, between, second = (facts.value(part, _some_state(facts)) for part in g)
    size, way = abs(first + second), mpmath.hypot(first - second, 2 * between)
    return bool(way < FARTHEST * size)  # neither of nan


def _some_state(facts: Facts) -> dict[ex.Expression, mpmath.mpf]:
    leaves: list[ex.Expression] = [
        *map(ex.Symbol, facts.coordinates),
        *map(ex.Velocity, facts.coordinates),
        ex.Symbol(facts.time),
    ]
    return {leaf: mpmath.mpf(k) / 7 + mpmath.mpf(1) / 3 for k, leaf in enumerate(leaves)}


def _conditions(facts: Facts, tensors: tuple[Matrix, Matrix]) -> list[list[ex.Expression]]:
    """The conditions of Phi, nabla Phi, nabla nabla Phi on g = [[g_11, g_12], [g_12, g_22]], (3, 3)."""
    return [
        [_collected(part) for part in (t[0][1], ex.subtract(t[1][1], t[0][0]), ex.negate(t[1][0]))]
        for t in (*tensors, _nabla(facts, tensors[1]))
    ]


def _is_long(rows: Matrix) -> bool:
    return sum(ex.node_count(part) for row in rows for part in row) > MOST_NODES


def _nabla(facts: Facts, tensor: Matrix) -> Matrix:
    """Gamma(T) + N T - T N with N = -1/2 df/dv, (2, 2)."""
    rates: list[tuple[ex.Expression, ex.Expression]] = [(ex.Symbol(facts.time), ex.ONE)]
    for name, f in zip(facts.coordinates, facts.accelerations, strict=True):
        rates += [(ex.Symbol(name), ex.Velocity(name)), (ex.Velocity(name), f)]
    half = ex.number(Fraction(-1, 2))
    n = [
        [half * calculus.differentiate(f, ex.Velocity(name)) for name in facts.coordinates]
        for f in facts.accelerations
    ]

    def entry(i: int, j: int) -> ex.Expression:
        plus = [n[i][k] * tensor[k][j] for k in range(2)]
        minus = [ex.negate(tensor[i][k] * n[k][j]) for k in range(2)]
        return ex.add(calculus.time_derivative(tensor[i][j], rates), *plus, *minus)

    return [[entry(i, j) for j in range(2)] for i in range(2)]


def _are_apart(facts: Facts, rows: Matrix) -> bool:
    """Whether the rows are independent at a point, which they then are at almost every point."""
    point = _some_state(facts)
    a, b, c = ([facts.value(part, point) for part in row] for row in rows)
    crossed = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]]
    determinant = abs(
        sum((left * right for left, right in zip(a, crossed, strict=True)), mpmath.mpf(0))
    )
    size = mpmath.mpf(1)
    for row in (a, b, c):
        size *= mpmath.sqrt(sum((value**2 for value in row), mpmath.mpf(0)))
    return bool(size > 0 and determinant > LEAST * size)  # neither holds of nan


def _point(facts: Facts) -> Iterator[str | sheets.Formula]:
    first, second = facts.coordinates[:2]
    yield from ("(", facts.said(first), ", ", facts.said(second), ")")


def _cases(facts: Facts) -> Picture | None:
    return _of_cases(facts) if facts.cases else None


def _path(facts: Facts) -> Picture | None:
    return Picture("path", ("The path of ", *_point(facts), ".", *_of_kinetic_energy(facts)))


def _of_kinetic_energy(facts: Facts) -> tuple[str, ...]:
    """What T in L = T - V says of the path: a geodesic without V, without bound where T has both
    signs.
    """
    natural = natural_of(facts)
    if natural is None or facts.constraints or not facts.accelerations:
        return ()
    mass, potential = natural
    if facts.is_constant(potential):
        return (" L is kinetic energy alone: the path is a geodesic.",)
    if len(mass) > 2:
        return ()
    (first, mixed), (_, second) = mass
    sign = _collected(ex.subtract(ex.multiply(first, second), ex.power(mixed, 2)))
    if not (isinstance(sign, ex.Number) and sign.value < 0):
        return ()
    return (" The kinetic energy in L has both signs: its energy does not bound the path.",)


_OF_TWO: tuple[Callable[[Facts], Picture | None], ...] = (
    _cases, _polar, _sphere, _none, _central, _charge, _rods, _cart, _well_of_two, _path,
)  # fmt: skip


# More coordinates.


def _of_many(facts: Facts) -> Picture:
    if facts.coordinates == ("x", "y", "z"):
        return Picture(
            "space",
            (
                "The path in space; the dotted line goes down to the plane of ",
                facts.said("x"),
                " and ",
                facts.said("y"),
                ".",
                *_of_kinetic_energy(facts),
            ),
        )
    if len(facts.coordinates) == 3 and (found := _round(facts) or _sphere(facts)) is not None:
        return found
    if (found := _rods(facts) or _cart(facts) or _points(facts)) is not None:
        return found
    if len(facts.coordinates) <= MOST_LINES:
        return Picture(
            "lines",
            ("Each coordinate on its own line, to one scale, with its last second behind it.",),
        )
    if _are_numbered(facts.coordinates):
        places = sorted(facts.coordinates, key=lambda name: (len(name), name))
        first, last = (facts.said(name) for name in (places[0], places[-1]))
        said = ("Each dot is a coordinate, side by side from ", first, " to ", last, ".")
        return Picture("profile", said)
    return Picture("history", ("All coordinates over the time.",))


def _points(facts: Facts) -> Picture | None:
    """Several points of one plane, by coordinates x and y with the same ending."""
    names = facts.coordinates
    endings = [name[1:] for name in names if name[0] == "x"]
    pairs = [(f"x{ending}", f"y{ending}") for ending in endings]
    if not 2 <= len(pairs) <= MOST_POINTS or {*itertools.chain(*pairs)} != {*names}:
        return None
    if 2 * len(pairs) != len(names) or facts.angles:
        return None
    places = [[names.index(name) for name in pair] for pair in pairs]
    said: list[str | sheets.Formula] = []
    for k, (x, y) in enumerate(pairs):
        between = "" if not k else " and " if k == len(pairs) - 1 else ", "
        said += [f"{between}(", facts.said(x), ", ", facts.said(y), ")"]
    return Picture("points", ("The paths of ", *said, " in one plane."), {"pairs": places})


def _round(facts: Facts) -> Picture | None:
    """The path of a point of space: T = c (r'^2 + r^2 theta'^2 + r^2 sin(theta)^2 phi'^2)/2, with
    cos for an angle from the equator, or T = c (r'^2 + r^2 phi'^2 + z'^2)/2.
    """
    natural = natural_of(facts)
    if natural is None:
        return None
    mass, _ = natural
    if any(mass[i][j] != ex.ZERO for i in range(3) for j in range(i)):
        return None
    for order in itertools.permutations(range(3)):
        r, second = (ex.Symbol(facts.coordinates[k]) for k in order[:2])
        c, *found = (mass[k][k] for k in order)
        if not facts.is_positive(c):
            continue
        square = c * ex.power(r, 2)
        names = [facts.said(facts.coordinates[k]) for k in order]
        named: sheets.Sentence = (names[0], ", ", names[1], ", and ", names[2])
        if not _is_zero(ex.subtract(found[0], square)):
            continue
        if _is_zero(ex.subtract(found[1], c)):
            said = (*named, " as cylindrical coordinates, seen from the side.")
            return Picture("space", said, {"places": [*order], "form": "cylinder"})
        for form, wave in (("pole", "sin"), ("equator", "cos")):
            turned = square * ex.power(ex.Apply(wave, second), 2)
            if _is_zero(ex.subtract(found[1], turned)):
                said = (*named, " as spherical coordinates, ", names[1], f" from the {form}.")
                return Picture("space", said, {"places": [*order], "form": form})
    return None


def _are_numbered(names: Sequence[str]) -> bool:
    """Whether the names are one letter with the numbers 1, 2, 3, ... or 0, 1, 2, ..., in any order."""
    letter = names[0].rstrip("0123456789").rstrip("_")
    found = {name.removeprefix(letter).removeprefix("_") for name in names}
    return found in ({str(k + first) for k in range(len(names))} for first in (0, 1))


def _of_constraints(facts: Facts) -> Picture:
    """A body seen from above, where two coordinates move along a direction that is a third one."""
    for plane in _planes(facts):
        if (found := _body(facts, plane)) is not None:
            places = [facts.coordinates.index(name) for name in plane]
            return replace(found, trees={**found.trees, "plane": places})
    if facts.coordinates == ("x", "y", "z"):
        return _of_many(facts)
    if {"x", "y"} <= set(facts.coordinates) or len(facts.coordinates) == 2:
        place = ("x", "y") if {"x", "y"} <= set(facts.coordinates) else facts.coordinates
        more = " Other coordinates are not drawn." if len(facts.coordinates) > 2 else ""
        point = ("(", facts.said(place[0]), ", ", facts.said(place[1]), ")")
        return Picture("path", ("The path of ", *point, f" on the constraints.{more}"))
    return _of_many(facts)


def _planes(facts: Facts) -> Iterator[tuple[str, str]]:
    """Pairs of coordinates that may be a place in a plane: x and y, else any two that are no angles."""
    if {"x", "y"} <= set(facts.coordinates):
        yield "x", "y"
        return
    yield from itertools.permutations(
        [name for name in facts.coordinates if name not in facts.angles], 2
    )


def _body(facts: Facts, plane: tuple[str, str]) -> Picture | None:
    """The body whose place is this pair, by the velocities that the constraints leave it."""
    known = {ex.Velocity(name): tree for name, tree in facts.velocities.items()}
    if not any(ex.Velocity(name) in known for name in plane):
        known = _solved(facts, plane)
    others = [name for name in facts.coordinates if name not in plane]
    u, v = (known.get(ex.Velocity(name), ex.Velocity(name)) for name in plane)
    for name in others:
        cos, sin = ex.Apply("cos", ex.Symbol(name)), ex.Apply("sin", ex.Symbol(name))
        turns = _is_zero(ex.subtract(v * cos, u * sin)) and not (_is_zero(u) or _is_zero(v))
        if turns or _is_along(facts, plane, cos, sin):
            rest = [one for one in others if one != name]
            return _on_slope(facts, plane, _of_heading(facts, name, rest, u, cos))
        if (offset := _offset(facts, plane, name, cos, sin)) is not None:
            return _on_slope(facts, plane, _sleigh(facts, plane, name, offset))
    return _ball(facts, others, u, v)


def _on_slope(facts: Facts, plane: tuple[str, str], found: Picture) -> Picture:
    """The picture with the direction in which the potential falls, if there is one."""
    down = _slope(facts, plane)
    if not down or found.kind == "disk":
        return found
    more = " The potential falls along the arrow; on the dashed line it is as at the start."
    return replace(found, caption=(*found.caption, more), trees={**found.trees, "down": down})


def _sleigh(facts: Facts, plane: tuple[str, str], name: str, offset: ex.Expression) -> Picture:
    point = ("(", facts.said(plane[0]), ", ", facts.said(plane[1]), ")")
    said = (
        "Seen from above. The blade is not at ",
        *point,
        ", the dot; it has the direction ",
        facts.said(name),
        " and moves along itself alone, on the thin line.",
    )
    heading = facts.coordinates.index(name)
    return Picture("sleigh", said, {"heading": heading, "offset": offset})


def _slope(facts: Facts, plane: tuple[str, str]) -> list[ex.Expression]:
    """Where a potential of the place alone, with the same slope everywhere, falls; empty for another one or none."""
    natural = natural_of(facts)
    if natural is None:
        return []
    potential = natural[1]
    down = [ex.negate(calculus.differentiate(potential, ex.Symbol(name))) for name in plane]
    rest = ex.add(potential, *(f * ex.Symbol(name) for f, name in zip(down, plane, strict=True)))
    if not all(map(facts.is_constant, (*down, _collected(rest)))) or all(map(_is_zero, down)):
        return []
    return down


def _ball(
    facts: Facts, others: Sequence[str], u: ex.Expression, v: ex.Expression
) -> Picture | None:
    """A ball that rolls on the plane: (x', y') = r (w_y, -w_x), with the velocity of turning w_x =
    theta' cos(phi) + psi' sin(theta) sin(phi), w_y = theta' sin(phi) - psi' sin(theta) cos(phi) of
    Euler's angles (Rz(phi) Rx(theta) Rz(psi)).
    """
    if len(others) != 3:
        return None
    for names in itertools.permutations(others):
        phi, theta = (ex.Symbol(name) for name in names[:2])
        fall, spin = (ex.Velocity(name) for name in names[1:])
        cos, sin = ex.Apply("cos", phi), ex.Apply("sin", phi)
        radius = _collected(ex.divide(calculus.differentiate(u, fall), sin))
        if not facts.is_constant(radius) or radius == ex.ZERO:
            continue
        turned = ex.multiply(spin, ex.Apply("sin", theta))
        right = radius * ex.subtract(fall * sin, turned * cos)
        up = ex.negate(radius * ex.add(fall * cos, turned * sin))
        if _is_zero(ex.subtract(u, right)) and _is_zero(ex.subtract(v, up)):
            said = "A ball rolls without slipping, seen from above; the dots are painted on it."
            angles = [facts.coordinates.index(name) for name in names]
            return Picture("ball", (said,), {"angles": angles, "radius": radius})
    return None


def _solved(facts: Facts, plane: tuple[str, str]) -> dict[ex.Velocity, ex.Expression]:
    """The velocity of the place by the others, from the first two constraints that give it (Cramer's rule)."""
    x, y = map(ex.Velocity, plane)
    for first, second in itertools.combinations(facts.constraints, 2):
        a, b = (
            [_collected(calculus.differentiate(one, rate)) for rate in (x, y)]
            for one in (first, second)
        )
        determinant = _collected(ex.subtract(a[0] * b[1], a[1] * b[0]))
        if writing.simplified(determinant) == ex.ZERO:
            continue
        still: dict[ex.Velocity, ex.Expression] = {x: ex.ZERO, y: ex.ZERO}
        p, q = (ex.substitute(one, still) for one in (first, second))
        pairs = ((x, ex.subtract(a[1] * q, b[1] * p)), (y, ex.subtract(b[0] * p, a[0] * q)))
        return {rate: writing.simplified(ex.divide(top, determinant)) for rate, top in pairs}
    return {}


def _is_along(facts: Facts, plane: tuple[str, str], cos: ex.Expression, sin: ex.Expression) -> bool:
    """Whether a velocity along (cos, sin) without any other one keeps the only constraint, which has no other one."""
    if len(facts.constraints) != 1:
        return False
    rates: dict[ex.Velocity, ex.Expression] = {
        ex.Velocity(name): ex.ZERO for name in facts.coordinates
    }
    rates |= dict(zip(map(ex.Velocity, plane), (cos, sin), strict=True))
    (constraint,) = facts.constraints
    alone = all(
        ex.Velocity(name) not in set(ex.walk(constraint))
        for name in facts.coordinates
        if name not in plane
    )
    alone = alone and not _is_zero(constraint)
    return alone and _is_zero(ex.substitute(constraint, rates))


def _offset(
    facts: Facts, plane: tuple[str, str], name: str, cos: ex.Expression, sin: ex.Expression
) -> ex.Expression | None:
    """How far along the direction of an angle the blade is whose velocity across it vanishes; None
    where the only constraint says something else.

    The velocity across it at the distance s is cos y' - sin x' + s p'.
    """
    if len(facts.constraints) != 1:
        return None
    rates = [ex.Velocity(one) for one in facts.coordinates]
    slopes = {rate: calculus.differentiate(facts.constraints[0], rate) for rate in rates}
    left = ex.subtract(
        facts.constraints[0], ex.add(*(slope * rate for rate, slope in slopes.items()))
    )
    x, y, turn = (slopes.pop(ex.Velocity(one)) for one in (*plane, name))
    across = ex.subtract(y * cos, x * sin)
    others = (left, ex.add(x * cos, y * sin), *slopes.values())
    if _is_zero(across) or _is_zero(turn) or not all(map(_is_zero, others)):
        return None
    found = writing.simplified(ex.divide(turn, across))
    return found if facts.is_constant(found) else None


def _half_axle(
    facts: Facts, name: str, rest: Sequence[str], u: ex.Expression, cos: ex.Expression
) -> ex.Expression | None:
    """Half of the distance of two wheels with the velocities v + c w and v - c w, v along the
    heading and w = heading': (dv/dp') / (dw/dp') for the angle p of a wheel.
    """
    turn = facts.velocities.get(name)
    if turn is None:
        return None
    forward = ex.divide(u, cos)
    for wheel in map(ex.Velocity, rest):
        own, turning = (calculus.differentiate(tree, wheel) for tree in (forward, turn))
        if _is_zero(turning):
            continue
        half = writing.simplified(ex.divide(own, turning))
        if facts.is_constant(half) and half != ex.ZERO:
            return half
    return None


def _of_heading(
    facts: Facts, name: str, rest: Sequence[str], u: ex.Expression, cos: ex.Expression
) -> Picture:
    heading = facts.coordinates.index(name)
    angle = facts.said(name)
    if len(rest) == 1:
        (one,) = rest
        radius = _collected(ex.divide(u, cos * ex.Velocity(one)))
        if facts.is_constant(radius) and radius != ex.ZERO:
            said = (
                "Seen from above. The wheel rolls along ",
                angle,
                " without slipping: the marks on the ground are one turn apart.",
            )
            return Picture(
                "disk", said, {"heading": heading, "rolled": facts.coordinates.index(one)}
            )
    if len(rest) >= 2 and len(facts.constraints) >= 3:
        said = ("Seen from above. No wheel moves sideways: the path has the direction ", angle, ".")
        known: dict[str, Any] = {"heading": heading, "rolled": facts.coordinates.index(rest[0])}
        if (half := _half_axle(facts, name, rest, u, cos)) is not None:
            said = (*said[:-1], ". The thin lines are the tracks of both wheels.")
            known["half"] = half
        return Picture("carriage", said, known)
    if rest:
        said = (
            "Seen from above. The point moves along the direction ",
            angle,
            " alone; other coordinates are not drawn.",
        )
        return Picture("heading", said, {"heading": heading})
    return Picture(
        "knife-edge",
        ("Seen from above. The blade has the direction ", angle, " and moves along itself alone."),
        {"heading": heading},
    )
