"""The system q'' = f(t, q, q') as data, the sets where it is one formula, and how it is read from a
document.

On each open set where its roots of squares are single formulas it is a branch. First-order pairs q'
= h(t, q, p), p' = F(t, q, p), h affine in p and solvable for it, are read as q'' = f(t, q, q'):
with p = p(t, q, q') from the first equations, f = dh/dt + dh/dq q' + dh/dp F. Hamilton's equations
of a regular H quadratic in the momenta are such pairs.
"""

import re
from collections import Counter
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, islice
from typing import TypeVar

from inverse_service import errors
from inverse_service.expressions import collecting, printing, refusals, tree as ex
from inverse_service.expressions.calculus import time_derivative
from inverse_service.field import modular, real_branch, sign_cases, tower
from inverse_service.mechanics import euler_lagrange, linear_equations
from inverse_service.reading import declarations, document_names, reader, time_derivatives
from inverse_service.reading.names import (
    GREEK_NAMES,
    Names,
    check_clashes,
    escaped,
    is_momentum,
    looks_like_a_coordinate,
    only_split,
)
from inverse_service.reading.tokens import Token, at, source, spelled, walk
from inverse_service.reading.typed_text import Typed

# Arbitrary functions, each with the names of the coordinates that it depends on.
Functions = tuple[tuple[str, tuple[str, ...]], ...]
MOST_BRANCHES = 8
# Counted no further.
MOST_COUNTED = 64
_SEED = 1
_Name = TypeVar("_Name", bound=Hashable)
MOST_PAIRS = 3  # of which every half is tried
NOT_PAIRS = (
    "these are first-order equations, and not pairs x' = h, p' = F with h affine in p and solvable for p "
    "(of such a pair x alone is a coordinate): write equations of second order such as x'' = -x."
)
Equations = Mapping[str, str] | Sequence[str] | str
_EQUAL = re.compile("(?<![<>])=")  # and not a condition of a piece
_Equation = tuple[ex.Expression, ex.Expression, str]  # left side, right side, pointer
_Others = tuple[tuple[str, ex.Expression], ...]
# y_xx, dxdt, dtheta: derivatives to the writer; delta and damping are names
_DERIVATIVE = re.compile(rf"_(\w)\1$|^dd?(?:[a-z]|{'|'.join(GREEK_NAMES)})_?\d*(?:dt)?$|^diff$")
_ACCELERATION = re.compile(
    r"([a-z]\w*?)_?(?:dd|pp)|dd([a-z]\w*)|[dD]2([a-z]\w*?)(?:dt2)?"
)  # xdd, ddx, d2x, d2xdt2
DEFINITION, HELD_FIXED = "a definition", "a coordinate that is held fixed"
ROOT = ", of the positive root"
_AS_VARIANT = re.compile(
    r"\\(phi|theta|rho|epsilon|kappa|sigma|pi)(?![a-z])"
)  # \varphi is read as phi
_DEFINES = re.compile(r"(:?==?|\\[a-z]+|.)")
_END_OF_TEXT = re.compile(
    r"\\(?:quad|qquad|text|mbox|[,;]).*$|[\s.,;$]*(?:\\(?:\]|\)|end\s*\{\w+\*?\})\s*)*[\s.,;$]*$",
    re.DOTALL,
)


class NotPairs(errors.InputError):
    """Equations of first order that are no pairs of x' = h and p' = F."""


@dataclass(frozen=True, slots=True)
class Branch:
    """Where the accelerations of a system are those of other formulas, `given`: where all of
    `positive` are > 0.

    Where they are `unsolved`, `given` are the equations E(t, q, q', q'') = 0 that determine them.
    `roots` pairs each root of them with what it is there; one within another comes before it.
    """

    given: tuple[ex.Expression, ...]
    positive: tuple[ex.Expression, ...] = ()
    roots: tuple[tuple[ex.Expression, ex.Expression], ...] = ()
    unsolved: bool = False


@dataclass(frozen=True, slots=True)
class SecondOrderSystem:
    """n explicit equations, `accelerations[i]` being f^i for `coordinates[i]`.

    Parameters are generic constants (those with values were substituted); no Acceleration node
    is left in `accelerations`. `branch` is None where roots of squares were not looked for.
    None of `nonzero` is 0: the equations as given say the same as q'' = f only there.
    `others` gives formulas for the names other than coordinates that first-order equations contain.
    """

    coordinates: tuple[str, ...]
    accelerations: tuple[ex.Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: Functions = ()
    name: str = ""
    branch: Branch | None = None
    others: tuple[tuple[str, ex.Expression], ...] = ()
    nonzero: tuple[ex.Expression, ...] = ()

    @property
    def names(self) -> Names:
        """What a formula about the system may contain."""
        return Names(self.coordinates, self.parameters, dict(self.functions))

    @property
    def variables(self) -> list[modular.Variable]:
        """t, the coordinates, and the velocities."""
        return [ex.TIME, *map(ex.Symbol, self.coordinates), *map(ex.Velocity, self.coordinates)]

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in f, also where it only says which formula holds."""
        return ex.TIME in ex.distinct_nodes((*self.accelerations, *self.given))

    @property
    def letters(self) -> tuple[ex.Symbol, ...]:
        """The accelerations where they are symbols, as in a system that is too long to be solved
        for them.
        """
        return (
            tuple(f for f in self.accelerations if isinstance(f, ex.Symbol))
            if self.is_unsolved
            else ()
        )

    @property
    def is_unsolved(self) -> bool:
        """Whether only the equations are known that determine the accelerations."""
        return self.branch is not None and self.branch.unsolved

    @property
    def positive(self) -> tuple[ex.Expression, ...]:
        """What is positive on the branch, squares of `nonzero` among them, of what names this
        system has.
        """
        names = {"t", "pi", *self.coordinates, *self.parameters}
        found = (
            *(() if self.branch is None else self.branch.positive),
            *(tree**2 for tree in self.nonzero),
        )
        return tuple(
            tree
            for tree in found
            if all(_name(node) in names for node in ex.walk(tree) if _name(node))
        )

    @property
    def given(self) -> tuple[ex.Expression, ...]:
        """f as it was given, before its roots of squares were rewritten."""
        return self.accelerations if self.branch is None else self.branch.given


@dataclass(frozen=True, slots=True)
class ConstrainedMotion:
    """The equations over (t, q, u): s' = w for the `dependent` coordinates, u' = F for the
    velocities u of the `free`.

    `dependent_velocities[i]` is the velocity of coordinate dependent[i] (first-order equations),
    `free_accelerations[i]` the acceleration of free[i] (second-order equations). None of `nonzero`
    is 0: elsewhere the constraints are dependent, or L is singular on them, and they leave the
    motion open.
    """

    coordinates: tuple[str, ...]
    free: tuple[str, ...]
    dependent: tuple[str, ...]
    dependent_velocities: tuple[ex.Expression, ...]
    free_accelerations: tuple[ex.Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: Functions = ()
    nonzero: tuple[ex.Expression, ...] = ()

    @property
    def depends_on_time(self) -> bool:
        trees = (*self.dependent_velocities, *self.free_accelerations)
        return any(ex.holds(tree, ex.TIME) for tree in trees)

    @property
    def on_constraints(self) -> dict[ex.Expression, ex.Expression]:
        """The dependent velocities by the free ones."""
        return {
            ex.Velocity(name): w
            for name, w in zip(self.dependent, self.dependent_velocities, strict=True)
        }

    def rate(self, tree: ex.Expression) -> ex.Expression:
        """The derivative along the motion of a function of t, q and the free velocities."""
        speeds = [
            (ex.Symbol(q), self.on_constraints.get(ex.Velocity(q), ex.Velocity(q)))
            for q in self.coordinates
        ]
        return time_derivative(
            tree, [*speeds, *zip(map(ex.Velocity, self.free), self.free_accelerations, strict=True)]
        )


def unsolved_system(
    names: Names, equations: Sequence[ex.Expression], name: str = ""
) -> SecondOrderSystem:
    """The system of E(t, q, q', q'') = 0, with symbols named like x'' as its accelerations."""
    letters = tuple(ex.Symbol(f"{coordinate}''") for coordinate in names.coordinates)
    branch = Branch(tuple(equations), unsolved=True)
    return SecondOrderSystem(
        names.coordinates, letters, names.parameters, tuple(names.functions.items()), name, branch
    )


def _name(node: ex.Expression) -> str:
    if isinstance(node, ex.Velocity):
        return node.coordinate
    return node.name if isinstance(node, ex.Symbol) else ""


def system_of(
    coordinates: Sequence[str],
    accelerations: Sequence[ex.Expression],
    parameters: Sequence[str],
    functions: Functions,
) -> SecondOrderSystem:
    """The system, with those of the functions that occur in it."""
    nodes = ex.distinct_nodes(accelerations)
    held = {node.name for node in nodes if isinstance(node, ex.Arbitrary)}
    kept = tuple(function for function in functions if function[0] in held)
    return SecondOrderSystem(tuple(coordinates), tuple(accelerations), tuple(parameters), kept)


def branches_of(system: SecondOrderSystem) -> tuple[SecondOrderSystem, ...]:
    """The system itself, where it has one formula everywhere, or one for each of the cases that
    have a real point.

    At most `MOST_COUNTED` are made.
    """
    if system.branch is not None:
        return (system,)
    found = tuple(one for one, reached in _cases(system) if reached)
    if not found or (
        len(found) > 1 and len({(one.accelerations, _squares(one)) for one in found}) == 1
    ):
        formulas = (
            found[0].accelerations if found else system.accelerations
        )  # |u|^2 is u^2 on both sides
        return (replace(system, accelerations=formulas, branch=Branch(system.accelerations)),)
    return _default_first(system, found) if len(found) > 1 else found


def _squares(system: SecondOrderSystem) -> tuple[ex.Expression, ...]:
    return tuple(collecting.collect(tree**2) for tree in system.nonzero)


def _default_first(
    system: SecondOrderSystem, branches: tuple[SecondOrderSystem, ...]
) -> tuple[SecondOrderSystem, ...]:
    """First comes the branch of a point with positive parameters, else of any, that one formula
    would be taken at.
    """
    kernels, parameters = (
        tuple(map(tower.to_kernels, system.accelerations)),
        [*map(ex.Symbol, system.parameters)],
    )
    table = real_branch.first_real_point(kernels, _variables(system), (parameters, ()))
    return tuple(
        sorted(
            branches,
            key=lambda one: table is None or not real_branch.are_positive(one.positive, table),
        )
    )


def with_values(
    system: SecondOrderSystem, values: Mapping[ex.Expression, ex.Expression]
) -> SecondOrderSystem:
    """The system with these values of its parameters, which may hold others."""
    forces = tuple(collecting.collect(ex.substitute(f, dict(values))) for f in system.given)
    left = tuple(name for name in system.parameters if ex.Symbol(name) not in values)
    return replace(system, accelerations=forces, parameters=left, branch=None)


def on_branch(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with the roots of the system replaced by their values on its branch."""
    for root, value in () if system.branch is None else system.branch.roots:
        tree = ex.substitute(tree, {root: value})
    return tree


def unreached(system: SecondOrderSystem) -> tuple[SecondOrderSystem, ...]:
    """The cases of signs that may have a real point, of which none was found."""
    return (
        ()
        if system.branch is not None
        else tuple(one for one, reached in _cases(system) if not reached)
    )


@lru_cache(maxsize=16)
def _cases(system: SecondOrderSystem) -> tuple[tuple[SecondOrderSystem, bool], ...]:
    """The system on each case of signs, and whether a real point of it is known; without those seen
    to be empty.

    Where one of `nonzero` is 0 all over a case, the equations as given leave a motion open there:
    it is no case.
    """
    found, number = [], len(system.accelerations)
    formulas = (*system.accelerations, *system.nonzero)
    cases: Iterable[sign_cases.Case] = [sign_cases.Case(formulas)]
    if tower.atoms_in_order(formulas):  # without functions and roots there is one case
        cases = sign_cases.sign_cases(formulas)
    for case in islice(cases, 4 * MOST_COUNTED):
        nonzero = tuple(map(collecting.collect, case.formulas[number:]))
        if ex.ZERO in nonzero:
            continue
        reached = not case.positive or _has_point(system, case)
        if reached or not sign_cases.is_empty(
            [*case.positive, *real_branch.own_requirements(case.formulas)]
        ):
            branch = Branch(system.accelerations, case.positive, case.roots)
            solved = (
                tuple(map(collecting.collect, case.formulas[:number]))
                if case.roots
                else system.accelerations
            )
            found.append(
                (replace(system, accelerations=solved, nonzero=nonzero, branch=branch), reached)
            )
        if sum(reached for _, reached in found) == MOST_COUNTED:
            break
    return tuple(found)


def on_side(
    system: SecondOrderSystem, positive: Sequence[ex.Expression]
) -> SecondOrderSystem | None:
    """A system where these trees are positive too; None where they are seen not to be so at
    once.
    """
    branch = system.branch or Branch(system.accelerations)
    whole = tuple(dict.fromkeys((*branch.positive, *positive)))
    if sign_cases.is_empty(
        [*system.positive, *positive, *real_branch.own_requirements(system.accelerations)]
    ):
        return None
    return replace(system, branch=replace(branch, positive=whole))


def _has_point(system: SecondOrderSystem, case: sign_cases.Case) -> bool:
    kernels = tuple(map(tower.to_kernels, case.formulas))
    return (
        real_branch.find_real_point(kernels, _variables(system), _SEED, case.positive) is not None
    )


def _variables(system: SecondOrderSystem) -> list[modular.Variable]:
    names = (*system.coordinates, *system.parameters)
    return [ex.TIME, *map(ex.Symbol, names), *map(ex.Velocity, system.coordinates)]


def connected(names: Sequence[_Name], links: Iterable[set[_Name]]) -> list[tuple[_Name, ...]]:
    """The names in groups so that each link lies in one of them, all in the order of `names`."""
    groups = [{name} for name in names]
    for link in links:
        joined = set().union(*(group for group in groups if group & link))
        groups = [*(group for group in groups if not group & link), joined]
    ordered = [tuple(name for name in names if name in group) for group in groups]
    return sorted(ordered, key=lambda group: names.index(group[0]))


@dataclass(frozen=True, slots=True)
class Pairs:
    """The coordinates, the acceleration of each, and what the other names are by the equations, p =
    p(t, q, q').
    """

    coordinates: tuple[str, ...]
    accelerations: tuple[ex.Expression, ...]
    others: tuple[tuple[str, ex.Expression], ...]


def from_pairs(
    equations: Sequence[tuple[ex.Expression, ex.Expression]],
    coordinates: Sequence[str],
    preferred: Sequence[str] = (),
) -> Pairs:
    """The second-order system of u' = …, one equation for each of `coordinates`; InputError where
    there is none.

    `preferred` are the names that are to be coordinates, where the writer said so; else they are
    those whose derivatives are momenta and nothing else (x' = v), else those that are called
    neither p nor v, else the first half in the order of the equations, else, where no name says
    what it is, another half: y of x' = y^2, y' = -x.
    """
    slopes = _slopes(equations, coordinates)
    order = tuple(slopes)
    half = len(order) // 2
    if len(order) != 2 * half or set(order) != set(coordinates):
        raise NotPairs(NOT_PAIRS, "/equations")
    plain = tuple(
        name
        for name in order
        if slopes[name] in {ex.Symbol(other) for other in order if other != name}
    )
    named = tuple(name for name in order if not is_momentum(name, order))
    halves = (
        combinations(order, half) if half <= MOST_PAIRS and len(named) != half else [order[:half]]
    )
    for chosen in (tuple(preferred), plain, named, *halves):
        if len(chosen) == half and set(chosen) <= set(order) and (found := _solved(slopes, chosen)):
            return found
        if chosen and chosen == tuple(preferred):
            break
    raise NotPairs(NOT_PAIRS, "/equations")


def _slopes(
    equations: Sequence[tuple[ex.Expression, ex.Expression]], coordinates: Sequence[str]
) -> dict[str, ex.Expression]:
    """What each derivative is, in the order of the equations; InputError for one that is not u' = …
    where the derivatives of the others are known, as in x' = v, v' = -x - c x'.
    """
    found: dict[int, tuple[str, ex.Expression]] = {}
    left = {place: left - right for place, (left, right) in enumerate(equations)}
    while left:
        known = {ex.Velocity(name): slope for name, slope in found.values()}
        count = len(left)
        for place, tree in [*left.items()]:
            parts = euler_lagrange.linear_parts(
                ex.substitute(tree, known) if known else tree, ex.Velocity
            )
            if isinstance(parts, tuple) and len(parts[0]) == 1 and ex.ZERO not in parts[0].values():
                ((rate, factor),), rest = parts[0].items(), parts[1]
                found[place] = rate.coordinate, -(rest if factor == ex.ONE else rest / factor)
                del left[place]
        if len(left) == count:
            found |= _solved_together(left, dict(found.values()))
            break
    return dict(found[place] for place in sorted(found))


def _solved_together(
    left: Mapping[int, ex.Expression], slopes: Mapping[str, ex.Expression]
) -> dict[int, tuple[str, ex.Expression]]:
    """What the remaining derivatives are, by the equations that are linear in several of them, as
    in 2 v' + w' cos(x) = -x; InputError where these do not give each of them.
    """
    known: dict[ex.Expression, ex.Expression] = {
        ex.Velocity(name): slope for name, slope in slopes.items()
    }
    trees = [ex.substitute(tree, known) if known else tree for tree in left.values()]
    names = list(
        dict.fromkeys(
            node.coordinate
            for tree in trees
            for node in ex.walk(tree)
            if isinstance(node, ex.Velocity)
        )
    )
    if len(names) != len(trees):
        raise NotPairs(NOT_PAIRS, "/equations")
    unknowns: dict[ex.Expression, ex.Expression] = {
        ex.Velocity(name): ex.Acceleration(name) for name in names
    }
    try:
        linear = [linear_equations.linear_equation(ex.substitute(tree, unknowns)) for tree in trees]
        values = linear_equations.solve_accelerations(linear, names)
    except errors.InputError:
        raise NotPairs(NOT_PAIRS, "/equations") from None
    return {place: (name, value) for place, name, value in zip(left, names, values, strict=True)}


def _solved(slopes: Mapping[str, ex.Expression], chosen: tuple[str, ...]) -> Pairs | None:
    """The system for these coordinates; None where their equations cannot be solved for the other
    names.
    """
    momenta = [name for name in slopes if name not in chosen]
    unknowns = {ex.Symbol(name): ex.Acceleration(name) for name in momenta}
    try:
        linear = [
            linear_equations.linear_equation(ex.substitute(slopes[q], unknowns) - ex.Velocity(q))
            for q in chosen
        ]
        values = linear_equations.solve_accelerations(linear, momenta)
    except errors.InputError:
        return None
    known = dict(zip(map(ex.Symbol, momenta), values, strict=True))
    rates = [
        (ex.Symbol(name), ex.Velocity(name) if name in chosen else slope)
        for name, slope in slopes.items()
    ]
    moving: list[ex.Expression] = [ex.TIME, *map(ex.Symbol, chosen), *map(ex.Velocity, chosen)]
    plain = (
        _cancelled(ex.substitute(time_derivative(slopes[q], rates), known), moving) for q in chosen
    )
    found = tuple(_divided(tree, moving) for tree in plain)
    return Pairs(chosen, found, tuple(zip(momenta, values, strict=True)))


def _cancelled(tree: ex.Expression, moving: Collection[ex.Expression]) -> ex.Expression:
    """The tree with each base once in a product: c x' for c m x'/m; a pole in what moves stays
    one.
    """
    inner = ex.rebuild(tree, lambda part: _cancelled(part, moving))
    above, below = dict[ex.Expression, Fraction](), dict[ex.Expression, Fraction]()
    for base, exponent in _powers(inner):
        side = below if exponent < 0 else above
        side[base] = side.get(base, Fraction(0)) + exponent
    for base in above.keys() & below.keys():
        total = above[base] + below[base]
        if total < 0 or not (ex.holds(base, *moving) or ex.has(base, ex.Arbitrary)):
            above[base], below[base] = max(total, Fraction(0)), min(total, Fraction(0))
    return ex.multiply(
        *(base**exponent for side in (above, below) for base, exponent in side.items() if exponent)
    )


def _divided(tree: ex.Expression, moving: Collection[ex.Expression]) -> ex.Expression:
    """c x'^2/m - g for (c x'^2 - m g)/m, where that is shorter."""
    factors = ex.factors_of(tree)
    sums = [factor for factor in factors if isinstance(factor, ex.Sum)]
    if len(sums) != 1:
        return tree
    outside = ex.multiply(*(factor for factor in factors if factor is not sums[0]))
    apart = ex.add(*(_cancelled(outside * term, moving) for term in sums[0].terms))
    return min(tree, apart, key=ex.node_count)


def _powers(tree: ex.Expression) -> Iterator[tuple[ex.Expression, Fraction]]:
    """The bases of a product with their integer exponents, those of nested products too."""
    for factor in ex.factors_of(tree):
        match factor:
            case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1:
                yield from ((part, power * exponent) for part, power in _powers(base))
            case _:
                yield factor, Fraction(1)


def read_system(
    coordinates: Sequence[str] | None,
    equations: Equations,
    parameters: declarations.Parameters = (),
    functions: Mapping[str, Sequence[str]] | None = None,
    name: str = "",
    where: Mapping[str, str] | None = None,
    most: int = refusals.LIMITS.coordinates,
) -> SecondOrderSystem:
    """The system q'' = f of a document.

    `coordinates` left out are the keys of `equations`, or the names with two primes in it, in their
    order. `equations` gives each acceleration, or whole equations (a list, or a text) that are
    solved for the accelerations; first-order pairs x' = h, p' = F are turned into such. Parameters
    with a value and names in `where` are replaced exactly. InputError with JSON pointer and column
    for anything that is wrong, LimitError for more than `most` coordinates.
    """
    declared = declarations.Declared(coordinates, parameters, functions or {}, where or {}, most)
    return solved_system(read_given(declared, equations), name)


@dataclass(frozen=True, slots=True)
class GivenEquations:
    """What a document says before anything is solved: its names, parameters with a value left out,
    and its equations.

    These are left and right side with their pointer; `others` are formulas for names that
    first-order pairs contain. `typed` are the lines before definitions and values are put in,
    where they are not first-order pairs.
    """

    names: Names
    equations: tuple[_Equation, ...]
    others: _Others = ()
    typed: declarations.TypedLines | None = None

    @property
    def residuals(self) -> tuple[ex.Expression, ...]:
        """E of E = 0."""
        return tuple(left - right for left, right, _ in self.equations)


def solved_system(given: GivenEquations, name: str = "") -> SecondOrderSystem:
    """The equations solved for the accelerations; InputError and LimitError as in `read_system`."""
    names, solved = given.names, _solved_for(given.equations, given.names.coordinates)
    return SecondOrderSystem(
        coordinates=names.coordinates,
        accelerations=solved.accelerations,
        nonzero=solved.nonzero,
        parameters=names.parameters,
        functions=tuple(names.functions.items()),
        name=name,
        others=given.others,
    )


def read_given(declared: declarations.Declared, equations: Equations) -> GivenEquations:
    """The equations of a document as given; InputError as in `read_system`."""
    if isinstance(equations, str):
        equations += _canonical_equations(equations)
    try:
        return _read_lines(declared, equations, False)
    except NotPairs:
        with suppress(errors.InputError):
            return _read_lines(declared, equations, True)
        raise


def _read_lines(
    declared: declarations.Declared, equations: Equations, rates: bool
) -> GivenEquations:
    """The same; with `rates`, p = m x' beside p' = -k x defines a name whose rate is that of its
    formula.
    """
    texts = _texts(equations)
    defined = {} if isinstance(equations, Mapping) else _definitions(texts, declared, rates)
    if rates and defined.keys() == _definitions(texts, declared).keys():
        raise NotPairs(NOT_PAIRS, "/equations")
    where = {name: formula.text for name, formula in defined.items()}
    try:
        return _read_with(
            replace(declared, where={**declared.where, **where}), texts, equations, rates
        )
    except errors.InputError as error:
        typed = {f"/where/{escaped(name)}": formula for name, formula in defined.items()}
        raise typed[error.pointer].error(error) if error.pointer in typed else error from None


def _read_with(
    declared: declarations.Declared, texts: Mapping[str, str], equations: Equations, rates: bool
) -> GivenEquations:
    """The same, the definitions among the declarations."""
    keys = tuple(equations) if isinstance(equations, Mapping) else ()
    pairs = not keys and not rates and _are_pairs(texts, declared)
    asked = replace(declared, coordinates=None) if pairs else declared
    known = document_names.known_names(asked, texts, 1 if pairs or rates else 2, keys, pairs)
    lines = _read(equations, texts, known.names, declared.most)
    found = [(known.put_in(left), known.put_in(right), pointer) for left, right, pointer in lines]
    names = known.remaining()
    if not pairs:
        typed = declarations.TypedLines(known, tuple((left, right) for left, right, _ in lines))
        return GivenEquations(names, tuple(found), typed=typed)
    system = from_pairs(
        [(left, right) for left, right, _ in found], names.coordinates, declared.coordinates or ()
    )
    names = replace(names, coordinates=system.coordinates)
    check_clashes(names)
    trees = zip(system.coordinates, system.accelerations, strict=True)
    solved = tuple((ex.Acceleration(name), tree, "/equations") for name, tree in trees)
    return GivenEquations(names, solved, system.others)


def _canonical_equations(text: str) -> str:
    """; x' = dH/dp; p' = -dH/dx for H = … alone, each momentum having its coordinate; else
    nothing.
    """
    named = document_names.HAMILTONIAN.match(reader.kept_text(text))
    tokens = reader.tokens_if_any(text, Names(guesses=True)) if named else []
    found = list(dict.fromkeys(token.text for token in walk(tokens) if token.kind == "name"))
    pairs = {
        name: _partner(name, found)
        for name in found
        if re.fullmatch(r"p(?:_\w+|\d)?", name) or (name[0] == "p" and name[1:] in found)
    }
    alone = sum(
        token.is_operator("=") for token in tokens
    ) == 1 and not time_derivatives.derivatives(tokens)
    if named is None or not (alone and all(pairs.values())):
        return ""
    equations = [pair for p, q in pairs.items() for pair in ((q, "", p), (p, "-", q))]
    if equations:
        shown = "; ".join(f"{name}' = {sign}dH/d{by}" for name, sign, by in equations)
        reader.note("H", f"the Hamiltonian, with {shown}")
    if not reader.is_latex(text):
        return "".join(f"; {name}' = {sign}dH/d{by}" for name, sign, by in equations)

    def write(name: str, accent: str = "") -> str:
        return _AS_VARIANT.sub(
            lambda found: f"\\var{found[1]}" if f"\\var{found[1]}" in text else found[0],
            printing.name_latex(name, accent),
        )

    return "".join(
        rf"; {write(name, 'dot')} = {sign}\frac{{\partial {named[1]}}}{{\partial {write(by)}}}"
        for name, sign, by in equations
    )


def _partner(momentum: str, names: Sequence[str]) -> str:
    """The coordinate of p_x, p_1 or p."""
    below = momentum[1:].removeprefix("_")
    if below and not below.isdigit():
        return below
    known = (
        ("q", "x", "r", "y", "theta", "phi")
        if not below
        else (f"q_{below}", f"q{below}", f"x_{below}", f"x{below}")
    )
    plain = next((name for name in known if name in names), "")
    splits = (
        name for name in known if any(name in only_split(word, Names((name,))) for word in names)
    )
    return plain or next(splits, "")  # the x of kx^2/2


def _definitions(
    texts: Mapping[str, str], declared: declarations.Declared, rates: bool = False
) -> dict[str, Typed]:
    """The names that equations such as omega = sqrt(k/m) define, which move nothing, each with its
    formula.

    InputError for a definition of a name that has its own equation, and for a second derivative
    spelled as a name.
    """
    names = Names(
        tuple(declared.coordinates or ()), tuple(declared.named_parameters()), guesses=True
    )
    found: dict[str, Typed] = {}
    for pointer, text in texts.items():
        typed = Typed.of(text, pointer)
        try:
            groups = reader.split_equations(text, names) if "=" in text else []
        except errors.InputError:
            continue  # its fault is reported where it is read
        times = Counter(
            name for group in groups for name in {token.text for token in walk(group.tokens)}
        )
        for group in groups:
            first, *rest = group.tokens
            _refuse_acceleration_as_name(first, rest, names, pointer)
            moves = names.role(first.text) or _DERIVATIVE.search(first.text)
            own = {token.text for token in walk(group.tokens)}
            elsewhere = {name for name in (first.text, "L") if times[name] > (name in own)}
            # r^2 = x^2 + y^2, where r is in another equation
            squared = _is_squared(group.tokens) * (first.text in elsewhere)
            called = _is_called(group.tokens)
            rest = rest[squared or called :]
            is_definition = (
                first.kind == "name"
                and not first.order
                and rest
                and rest[0].is_operator("=")
                and not moves
            )
            if not is_definition or time_derivatives.moving_names(rest, 2):  # F = m*x'' moves x
                continue
            rated = time_derivatives.moving_names(rest, 1) and any(
                _moves(each, first.text, 1) for each in texts.values()
            )
            if rated and not rates:
                continue  # p = m*x' next to p' = -k*x
            if not rated and first.text != "L" and not any(map(_moves, texts.values())):
                continue  # what is missing is the motion
            is_lagrangian = (
                first.text == "L" and not rated and "L" not in elsewhere
            )  # and no length
            if is_lagrangian or not _is_given_motion(first.text, rest[1:], texts, names):
                _refuse_definition(first, is_lagrangian, texts, pointer)
            if len(rest) > 1:
                before = text[first.column - 1 : rest[0].column - 1]
                right = reader.kept_part(typed, rest[0].column - 1, group.end_column - 1)
                sign = _DEFINES.match(right.text)
                formula = right[sign.end() if sign else 0 :]
                if end := _END_OF_TEXT.search(formula.text):
                    formula = formula[: end.start()]
                shown = f"{before}{sign[0] if sign else ''}{formula.text.rstrip()}"
                name = before.rstrip(" &") if called else first.text
                if called and not reader.is_latex(text):  # V[x_] := x^4, V := x -> x^4
                    name = source(group.tokens[:2])
                if squared:
                    opening, closing = ("\\sqrt{", "}") if reader.is_latex(text) else ("sqrt(", ")")
                    formula = formula.made(opening) + formula + formula.made(closing, -1)
                found[name.replace("\\left", "").replace("\\right", "")] = formula
                fixed = looks_like_a_coordinate(first.text) and [
                    token.kind for token in rest[1:]
                ] == ["number"]
                meant = HELD_FIXED if fixed else DEFINITION + ROOT * bool(squared)
                reader.note(shown, meant)
    return found


def _refuse_acceleration_as_name(
    first: Token, rest: Sequence[Token], names: Names, pointer: str
) -> None:
    """InputError for xdd = … or d2xdt2 = …, which mean x'' = …."""
    moved = _ACCELERATION.fullmatch(first.text)
    if (
        moved
        and not first.order
        and not names.role(first.text)
        and rest
        and rest[0].is_operator("=")
    ):
        meant = f"{next(filter(None, moved.groups()))}''"
        what, span = f"{first.text} is read as a name; it occurs", (first.column, rest[0].column)
        instead = f"write {meant} for a second derivative"
        raise refusals.refusal(what, first.column, instead, (meant,), span).at(pointer)


def _is_given_motion(
    name: str, formula: Sequence[Token], texts: Mapping[str, str], names: Names
) -> bool:
    """Whether y = a cos(w t) is the motion of a support, whose y'' other equations have: a formula of
    t and constants, without which there are as many equations as accelerations.
    """
    used = [token.text for token in walk(formula) if token.kind == "name"]
    timed = any(word == "t" or (len(word) == 2 and word[1] == "t") for word in used)  # of cos(wt)
    try:
        moving = {each for text in texts.values() for each in _moving(text, 1)}
        groups = [group for text in texts.values() for group in reader.split_equations(text, names)]
    except errors.InputError:
        return False  # its fault is reported where it is read
    if not timed or moving & {*used}:
        return False
    named = [time_derivatives.moving_names(group.tokens, 2) for group in groups]
    others = {each for found in named for each in found} - {name}
    return len(others) == sum(map(bool, named)) > 0


def _refuse_definition(
    name: Token, is_lagrangian: bool, texts: Mapping[str, str], pointer: str
) -> None:
    """InputError for a definition that belongs to another part of the document, or of a name with
    its own equation.
    """
    what, instead = f"{name.text} = … is a definition, not an equation of motion; it occurs", ""
    if is_lagrangian:
        instead = 'write it in the document as "lagrangian": "…"'
    elif any(
        _moves(each, name.text) for each in texts.values()
    ):  # a definition would leave its own equation
        instead = f"leave out the equation with {name.text}'' and put {name.text} into the others"
    if instead:
        raise refusals.refusal(what, name.column, instead).at(pointer)


def _is_squared(tokens: Sequence[Token]) -> int:
    """How many tokens after a name are its square, in r^2 = … and r^{2} = …; else 0."""
    return 2 * (spelled(tokens[1:4]).replace("(", "").replace(")", "") == "^2=")


def _is_called(tokens: Sequence[Token]) -> int:
    """How many tokens after a name are its arguments, in V(x, y) = …; else 0."""
    inside = at(tokens, 1).inside
    named = all(
        (token.kind == "name" and not token.order) or token.is_operator(",") for token in inside
    )
    return int(named and at(tokens, 1).is_bracket() and at(tokens, 2).is_operator("="))


def _moves(text: str, name: str = "", order: int = 2) -> bool:
    """Whether a name of the text has a derivative in time; with `name`, whether this has so
    many.
    """
    try:
        moving = _moving(text, order if name else 1)
        return name in moving if name else bool(moving)
    except errors.InputError:
        return not name


@lru_cache(maxsize=16)
def _moving(text: str, order: int) -> frozenset[str]:
    return frozenset(time_derivatives.moving_names(reader.read_tokens(text), order))


def _are_pairs(texts: Mapping[str, str], declared: declarations.Declared) -> bool:
    """Whether no name has two derivatives, and at least two have one."""
    named = (*declared.named_parameters(), *map(declarations.defined_name, declared.where))
    names = document_names.with_products(
        Names((), named, dict.fromkeys(declared.functions, ())), declared, texts
    )
    with suppress(errors.InputError):  # refused later, with the names that are declared
        moving = (name for text in texts.values() for name in _moving(text, 2))
        if any(names.role_meant(name) is None for name in moving):
            return False  # without reading all of a long text once more
    names = replace(
        names, guesses=True
    )  # al'' of declared coordinates is no product; others are refused later
    return (
        not time_derivatives.inferred_coordinates(texts, names, 2)
        and len(time_derivatives.inferred_coordinates(texts, names, 1)) > 1
    )


def _texts(equations: Equations) -> dict[str, str]:
    """The texts by their pointers; InputError for an entry that is none."""
    if isinstance(equations, str):
        return {"/equations": equations}
    keyed = isinstance(equations, Mapping)
    pairs = equations.items() if isinstance(equations, Mapping) else enumerate(equations)
    found = {f"/equations/{escaped(str(key))}": text for key, text in pairs}
    for pointer, text in found.items():
        if not isinstance(text, str) and (not keyed or type(text) is not int):
            detail = "an equation is not a text: write it in quotation marks, as in \"x'' = -x\"."
            raise errors.InputError(detail, pointer)
    return {pointer: str(text) for pointer, text in found.items()}


def _read(
    equations: Equations, texts: Mapping[str, str], names: Names, most: int
) -> list[_Equation]:
    if isinstance(equations, Mapping):
        return _keyed_equations(equations, texts, names)
    if not isinstance(equations, str):
        declarations.bounded(list(equations), "/equations", "equations", most)
    return [
        equation
        for pointer, text in texts.items()
        for equation in _whole_equations(text, names, pointer, most)
    ]


def _whole_equations(text: str, names: Names, pointer: str, most: int) -> list[_Equation]:
    with reader.placed_at(pointer):
        groups = reader.split_equations(text, names)
        if len(groups) > most:
            raise errors.LimitError(
                f"there are {len(groups)} equations: the limit is {most}; write fewer."
            )
        return [
            (*reader.read_equation(group, names), pointer)
            for group in groups
            if not _defines(group.tokens, names)
        ]


def _defines(tokens: Sequence[Token], names: Names) -> bool:
    """Whether the equation is the definition of a name for a formula."""
    equals = tokens[1 + (_is_squared(tokens) or _is_called(tokens)) :][:1]
    defined = (
        tokens[0].kind == "name"
        and not tokens[0].order
        and ex.Symbol(names.spelling(tokens[0].text)) in names.definitions
    )
    whole = any(token.is_operator("=") for token in equals)
    return (
        defined and whole and not time_derivatives.moving_names(tokens, 2)
    )  # F = m*x'' is an equation beside F = -k*x


def _keyed_equations(
    keys: Iterable[str], texts: Mapping[str, str], names: Names
) -> list[_Equation]:
    found: dict[str, _Equation] = {}
    for key, (pointer, text) in zip(keys, texts.items(), strict=True):
        coordinate = time_derivatives.key_coordinate(key, names, pointer)
        if coordinate in found:
            raise errors.InputError(
                f"there are two equations for {coordinate}: remove one.", pointer
            )
        found[coordinate] = (
            ex.Acceleration(coordinate),
            _right_side(text, coordinate, names, pointer),
            pointer,
        )
    for coordinate in names.coordinates:
        if coordinate not in found:
            raise errors.InputError(
                f"the equation of {coordinate} is missing: add {coordinate} with its acceleration, 0 if it has none.",
                "/equations",
            )
    return [found[coordinate] for coordinate in names.coordinates]


def _right_side(text: str, coordinate: str, names: Names, pointer: str) -> ex.Expression:
    with reader.placed_at(pointer):
        if not _EQUAL.search(text):
            tree = reader.read_formula(text, names)
            if ex.Acceleration(coordinate) in set(ex.walk(tree)):
                detail = f"{coordinate}'' occurs in what {coordinate}'' is: write whole equations with = in a list."
                raise errors.InputError(detail, column=1)
            return tree
        groups = reader.split_equations(text, names)
        if len(groups) != 1:
            raise errors.InputError(
                "several equations occur here: write only the acceleration.", column=1
            )
        left, right = reader.read_equation(groups[0], names)
        if left != ex.Acceleration(coordinate):
            raise errors.InputError(
                f"the left side is not {coordinate}'': write only the acceleration.", column=1
            )
        return right


def _solved_for(
    found: Sequence[_Equation], coordinates: tuple[str, ...]
) -> linear_equations.Solved:
    explicit = {
        left.coordinate: right for left, right, _ in found if isinstance(left, ex.Acceleration)
    }
    solved = not any(ex.has(right, ex.Acceleration) for right in explicit.values())
    if solved and len(explicit) == len(found) == len(coordinates):
        return linear_equations.Solved(tuple(explicit[coordinate] for coordinate in coordinates))
    residuals = [
        linear_equations.linear_equation(left - right, pointer) for left, right, pointer in found
    ]
    return linear_equations.solve_lines(residuals, coordinates)
