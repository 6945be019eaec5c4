"""Reduce a system to blocks that share no coordinates or no sums of coordinates, or to one with a
coordinate as time.

In sums u = C q with constants C, a system decouples if the rows of C span left invariant subspaces
of all f_q and f_v. They are those of a constant P with two eigenvalues that commutes with all f_q
and f_v, which gives linear equations for P.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from itertools import chain, pairwise, product

import numpy as np
import numpy.typing as npt

from inverse_service import errors
from inverse_service.decision import certify
from inverse_service.expressions import calculus, collecting, terms as tm, tree as ex
from inverse_service.field import exact_field, flow, matrices, real_branch, tower
from inverse_service.mechanics import writing
from inverse_service.mechanics.second_order_system import SecondOrderSystem, connected
from inverse_service.search import (
    algebras,
    antiderivatives,
    interpolation,
    linear_systems,
    material as mt,
)
from inverse_service.statements.questions import PLAIN, TIMED, Question

Table = list[list[ex.Expression]]
Matrix = npt.NDArray[np.object_]
# The number of points at which matrices are compared, and the seed.
_POINTS, _SEED = 8, 1


@dataclass(frozen=True, slots=True)
class Smaller:
    """Systems whose Lagrangians L(q, q'), or L(t, q, q') as their questions say, yield Lagrangians
    of the given system.

    `lift` takes the Lagrangians of each system, simplest first. `numbers` says which numbers the
    coordinates of the systems are if not real ones; `forms` what they are if sums.
    """

    systems: tuple[SecondOrderSystem, ...]
    questions: tuple[Question, ...]
    lift: Callable[[Sequence[Sequence[ex.Expression]]], Sequence[ex.Expression]]
    numbers: str = ""
    forms: tuple[ex.Expression, ...] = ()


def decoupled_blocks(system: SecondOrderSystem) -> list[SecondOrderSystem]:
    """The blocks of the system: within a block, coordinates occur in each other's equations,
    directly or indirectly.
    """
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    links = ({name} | coordinates_in(f, system.coordinates) for name, f in pairs)
    return [block_of(system, group) for group in connected(system.coordinates, links)]


def coordinates_in(tree: ex.Expression, names: Sequence[str]) -> set[str]:
    held = set(ex.walk(tree))
    return {name for name in names if not held.isdisjoint((ex.Symbol(name), ex.Velocity(name)))}


def block_of(system: SecondOrderSystem, group: Collection[str]) -> SecondOrderSystem:
    kept = [k for k, name in enumerate(system.coordinates) if name in group]
    coordinates = tuple(system.coordinates[k] for k in kept)
    return replace(
        system, coordinates=coordinates, accelerations=tuple(system.accelerations[k] for k in kept)
    )


def _with_fewest_coordinates(material: mt.Material) -> SecondOrderSystem:
    """The system with f_i in factored form if fewer coordinates occur in that: (u x - v x)/(u - v)
    is x.
    """
    system = material.analysis.system
    pairs = zip(system.accelerations, map(tm.tree_of, material.motion.forces), strict=True)
    forces = tuple(
        min(pair, key=lambda tree: len(coordinates_in(tree, system.coordinates))) for pair in pairs
    )
    return replace(system, accelerations=forces)


def is_decoupled(material: mt.Material) -> bool:
    return len(decoupled_blocks(_with_fewest_coordinates(material))) > 1


def into_blocks(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """The blocks; the sum of their Lagrangians is a Lagrangian of the whole system."""
    blocks = tuple(decoupled_blocks(_with_fewest_coordinates(material)))
    system = material.analysis.system
    questions = (material.motion.question,) * len(blocks)
    yield Smaller(blocks, questions, lambda found: [_sum_of(system, [trees[0] for trees in found])])


def closures(system: SecondOrderSystem) -> dict[str, frozenset[str]]:
    """For each coordinate the smallest set that contains it and all coordinates in its equations."""
    needs = {
        name: coordinates_in(f, system.coordinates) | {name}
        for name, f in zip(system.coordinates, system.accelerations, strict=True)
    }
    found = dict[str, frozenset[str]]()
    for name in system.coordinates:
        group, before = set(needs[name]), set[str]()
        while group != before:
            before, group = set(group), group.union(*(needs[each] for each in group))
        found[name] = frozenset(group)
    return found


def _parts_over_common(system: SecondOrderSystem) -> list[frozenset[str]]:
    """The closed sets of coordinates that no larger one contains, for a system that is not one."""
    groups = dict.fromkeys(closures(system).values())
    return [group for group in groups if not any(group < other for other in groups)]


def has_common_coordinates(material: mt.Material) -> bool:
    return len(_parts_over_common(_with_fewest_coordinates(material))) > 1


def over_common(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """The largest closed parts: their Lagrangians satisfy the equations of the common coordinates,
    too, hence so do sums. Where that with factors 1 is not regular, that with 2 once often is.
    """
    system = _with_fewest_coordinates(material)
    parts = tuple(block_of(system, group) for group in _parts_over_common(system))
    questions = (material.motion.question,) * len(parts)

    def lift(found: Sequence[Sequence[ex.Expression]]) -> list[ex.Expression]:
        first, *others = (trees[0] for trees in found)
        whole = material.analysis.system
        return [_sum_of(whole, [factor * first, *others]) for factor in (ex.ONE, ex.number(2))]

    yield Smaller(parts, questions, lift)


def _sum_of(system: SecondOrderSystem, trees: Sequence[ex.Expression]) -> ex.Expression:
    """The sum of the Lagrangians of blocks, with integrals renamed because several blocks may have
    an F.
    """
    fresh, used, found = antiderivatives.fresh_names(system, *trees), set[str](), []
    for tree in trees:
        own = {node.name for node in certify.walk_integrals(tree)}
        names = {name: next(fresh) for name in sorted(own & used)}
        used |= own
        found.append(_renamed(tree, names) if names else tree)
    return ex.add(*found)


def _renamed(tree: ex.Expression, names: Mapping[str, str]) -> ex.Expression:
    named = (
        replace(tree, name=names.get(tree.name, tree.name))
        if isinstance(tree, ex.Integral)
        else tree
    )
    return ex.rebuild(named, lambda part: _renamed(part, names))


def has_sums(material: mt.Material) -> bool:
    """Whether the coordinates do not decouple without sums."""
    return not material.analysis.system.functions and not is_decoupled(material)


def _may_decouple(material: mt.Material) -> bool:
    """Whether matrices P other than multiples of 1 commute with f_q and f_v at points modulo a
    prime; cached.
    """
    proposals = material.analysis.proposals
    if "may decouple" not in proposals:
        proposals["may decouple"] = _commute_at_points(material)
    return bool(proposals["may decouple"])


def _commute_at_points(material: mt.Material) -> bool:
    system = material.analysis.system
    n = len(system.coordinates)
    forces, random = (
        tuple(map(tower.to_kernels, system.accelerations)),
        np.random.default_rng(_SEED),
    )
    fixed: dict[flow.Generator, int] = {
        ("variable", ex.Symbol(name)): int(random.integers(2, flow.PRIME))
        for name in system.parameters
    }
    points = flow.Points(system.coordinates, flow.Units.of(forces), _POINTS, random, fixed)
    jacobians = np.concatenate(
        [part[0][points.good] for part in flow.Flow(points, forces, 1).slopes()]
    )
    unit = np.eye(n, dtype=np.int64)
    # P J - J P, with P flattened by rows.
    rows = [np.kron(unit, j.T) - np.kron(j, unit) for j in jacobians]
    return bool(rows) and len(interpolation.null_basis(np.concatenate(rows) % flow.PRIME)) > 1


def _commuting(material: mt.Material) -> tuple[exact_field.ExactRing, list[Matrix]]:
    """A basis of the constant matrices P that commute with f_q and f_v at all points, over a ring;
    cached.
    """
    proposals = material.analysis.proposals
    if "commuting" not in proposals:
        system, n = material.analysis.system, material.motion.size
        variables = [kind(name) for kind in (ex.Symbol, ex.Velocity) for name in system.coordinates]
        slopes = [
            calculus.differentiate(f, variable)
            for f, variable in product(system.accelerations, variables)
        ]
        ring = exact_field.exact_ring(slopes, system.variables, 0, exact_field.Budget.long())
        jacobians = np.split(np.array(list(map(ring.value, slopes))).reshape(n, 2 * n), 2, axis=1)
        zero, one = ring.constant(0), ring.constant(1)
        units = [
            np.array([one if k == place else zero for k in range(n * n)]).reshape(n, n)
            for place in range(n * n)
        ]
        columns = [[entry for j in jacobians for entry in (e @ j - j @ e).flat] for e in units]
        proposals["commuting"] = (
            ring,
            [np.array(p).reshape(n, n) for p in matrices.null_vectors(ring, columns)],
        )
    found: tuple[exact_field.ExactRing, list[Matrix]] = proposals["commuting"]
    return found


def into_sums(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """The two parts of the system in sums of the coordinates; each sum is named after a
    coordinate.
    """
    if not _may_decouple(material):
        return
    given, found = _commuting(material)
    n = material.motion.size
    for p in found:
        trees = _trees(given, p.tolist())
        for value, spread in linear_systems.eigenvalues_of(trees):
            if not (isinstance(spread, ex.Number) and spread.value >= 0):
                continue  # complex, or real for some parameters only
            eigenvalue = value + tm.collected(spread ** Fraction(1, 2)) if spread.value else value
            entries = [entry for row in trees for entry in row]
            ring = exact_field.exact_ring(
                [*entries, eigenvalue], (), None, exact_field.Budget.long()
            )
            zero, one = ring.constant(0), ring.constant(1)
            identity = np.array([[one if i == j else zero for j in range(n)] for i in range(n)])
            matrix = np.array([[ring.value(entry) for entry in row] for row in trees])
            power = np.linalg.matrix_power(matrix - identity * ring.value(eigenvalue), n)
            own = matrices.null_space(power.T.tolist(), n, one).values()
            others = matrices.reduced_rows(power.tolist(), range(n)).rows
            if own and others:
                forms = [exact_field.primitive_vector(form) for form in (*own, *others)]
                solved = [matrices.solve_square(forms, row) or () for row in identity.tolist()]
                inverse = _trees(ring, list(zip(*solved, strict=True)))
                yield _in_forms(material, _trees(ring, forms), inverse, len(own))
                return


def over_numbers(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """The system as one of half as many complex or dual coordinates (`algebras`); L is a part of
    its Lagrangian.
    """
    if not _may_decouple(material):
        return
    system = material.analysis.system
    for p in _commuting(material)[1]:
        entries = [[entry.constant_value for entry in row] for row in p.tolist()]
        numbers = [[x for x in row if x is not None] for row in entries]
        structure = (
            algebras.structure_of(numbers) if all(len(row) == len(p) for row in numbers) else None
        )
        if structure is not None:
            yield _over(system, structure, material.motion.question)


def _over(system: SecondOrderSystem, structure: algebras.Structure, question: Question) -> Smaller:
    smaller, letter = algebras.system_over(structure, system)

    def lift(found: Sequence[Sequence[ex.Expression]]) -> list[ex.Expression]:
        return [
            tree for one in found[0] for tree in algebras.parts_of(structure, system, letter, one)
        ]

    numbers = "complex" if structure.unit.square < 0 else "dual"
    return Smaller((smaller,), (question,), lift, numbers)


def single_equations(material: mt.Material, seed: int) -> Smaller | None:
    """The system as equations of one coordinate each, in the coordinates, in sums of them, or of
    one complex or dual coordinate; None if it is not known to be such.
    """
    ways = (into_sums, over_numbers) if has_sums(material) else (into_blocks,)
    found = (smaller for way in ways for smaller in way(material, seed))
    return next(
        (one for one in found if all(len(each.coordinates) == 1 for each in one.systems)), None
    )


def with_constant_sums(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """The system in sums of the coordinates: those with constant velocities, and sums orthogonal to
    them.
    """
    forces, n = material.motion.forces, material.motion.size
    rows = [[f.get(key, Fraction(0)) for f in forces] for key in dict.fromkeys(chain(*forces))]
    constant = matrices.kernel(rows, n)
    if all(sum(map(bool, row)) == 1 for row in constant):
        return
    forms = [
        [c * math.lcm(*(each.denominator for each in row)) for c in row]
        for row in (*constant, *matrices.kernel(constant, n))
    ]
    beside = [row + [Fraction(i == k) for k in range(n)] for i, row in enumerate(forms)]
    inverse = [line[n:] for _, line in matrices.echelon_of(beside, 2 * n)]
    numbers, back = (
        [list[ex.Expression](map(ex.number, row)) for row in table] for table in (forms, inverse)
    )
    yield _in_forms(material, numbers, back, n)


def _trees(ring: exact_field.ExactRing, rows: Sequence[Sequence[exact_field.Quotient]]) -> Table:
    return [[exact_field.quotient_tree(ring, entry) for entry in row] for row in rows]


def _in_forms(material: mt.Material, forms: Table, inverse: Table, first: int) -> Smaller:
    """The blocks of the first forms and of the others, if any; each form is named after the
    coordinate in its place.
    """
    system, blocks = material.analysis.system, list[SecondOrderSystem]()
    names, places = system.coordinates, range(len(system.coordinates))
    forces = [ex.add(*map(ex.multiply, form, system.accelerations)) for form in forms]
    for chosen in filter(None, (places[:first], places[first:])):
        own = tuple(names[k] for k in chosen)
        table = _substitution(names, [[row[k] for k in chosen] for row in inverse], own)
        accelerations = tuple(
            tm.collected(
                collecting.collect(_with_short_roots(ex.substitute(forces[k], table), own))
            )
            for k in chosen
        )
        blocks.append(
            replace(system, coordinates=own, accelerations=accelerations, branch=None, nonzero=())
        )
    back, questions = _substitution(names, forms, names), (material.motion.question,) * len(blocks)
    return Smaller(
        tuple(blocks),
        questions,
        lambda found: [ex.substitute(_sum_of(system, [one[0] for one in found]), back)],
        forms=tuple(back[ex.Symbol(name)] for name in names),
    )


def _with_short_roots(tree: ex.Expression, names: Sequence[str]) -> ex.Expression:
    """The tree with the radicands of its roots over one denominator where that is shorter: then 1 -
    (m u'/(m + n) + n u'/(m + n))^2 is 1 - u'^2.
    """
    variables = [kind(name) for name in names for kind in (ex.Symbol, ex.Velocity)]

    def changed(part: ex.Expression) -> ex.Expression:
        match ex.rebuild(part, changed):
            case ex.Power(ex.Sum() as radicand, ex.Number(e)) as root if e.denominator > 1:
                with suppress(tm.TooManyTerms):
                    short = antiderivatives.factored_tree(radicand, variables)
                    if ex.node_count(short) < ex.node_count(radicand):
                        return short ** ex.number(e)
                return root
            case other:
                return other

    return changed(tree)


def _substitution(
    names: Sequence[str], forms: Table, others: Sequence[str]
) -> dict[ex.Expression, ex.Expression]:
    """The coordinates and velocities `names` as linear forms of those in `others`."""
    kinds: tuple[Callable[[str], ex.Expression], ...] = (ex.Symbol, ex.Velocity)
    return {
        kind(name): ex.add(*map(ex.multiply, form, map(kind, others)))
        for name, form in zip(names, forms, strict=True)
        for kind in kinds
    }


def has_coordinate_as_time(material: mt.Material) -> bool:
    """Whether the paths of the motion solve a system with one of the coordinates as time."""
    return any(True for _ in _along(material))


def is_rotational(material: mt.Material) -> bool:
    """Whether the rotations of the plane of two coordinates, or of the space of three, map motions
    to motions.
    """
    system = material.analysis.system
    names = system.coordinates
    if len(names) not in (2, 3) or system.functions or is_decoupled(material):
        return False
    turned, forces = [], dict(zip(names, system.accelerations, strict=True))
    for x, y in pairwise(names):
        slopes = {x: ex.negated(forces[y]), y: forces[x]}
        for name in names:
            moved = [
                calculus.differentiate(forces[name], kind(one)) * sign * kind(other)
                for kind in (ex.Symbol, ex.Velocity)
                for one, other, sign in ((y, x, 1), (x, y, -1))
            ]
            turned.append(ex.add(*moved, ex.negated(slopes.get(name, ex.ZERO))))
    with suppress(errors.InputError):
        return all(map(real_branch.vanishes, turned))
    return False


def into_polar(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """The equations of r and phi, which bear the names of x and y: those at y = 0, where x = r, x'
    = r', y' = r phi'.

    In space a motion that stays in a plane is that of the plane z = 0. An L(r, r', phi'^2) with r^4
    phi'^2 = |q x q'|^2 is one of the motion in space, too: E(L) lies in the plane of q and q',
    since L has the reflection at it.
    """
    system = material.analysis.system
    x, y, *across = map(ex.Symbol, system.coordinates)
    u, v, *out = map(ex.Velocity, system.coordinates)
    there: dict[ex.Expression, ex.Expression] = {y: ex.ZERO, v: x * v}
    there |= dict.fromkeys([*across, *out], ex.ZERO)
    along, aside, *others = (tm.collected(ex.substitute(f, there)) for f in system.accelerations)
    if others != [ex.ZERO] * len(others):
        return
    forces = tuple(map(tm.collected, (along + x * v**2, (aside - 2 * u * v) / x)))
    square, rate = ex.add(*(q**2 for q in (x, y, *across))), ex.dot((x, y, *across), (u, v, *out))
    spin = (x * v - y * u) / square
    if across:
        speed = ex.add(*(w**2 for w in (u, v, *out)))
        spin = (square * speed - rate**2) ** Fraction(1, 2) / square
    back: dict[ex.Expression, ex.Expression] = {
        x: square ** Fraction(1, 2),
        u: rate / square ** Fraction(1, 2),
        v: spin,
    }

    def lift(found: Sequence[Sequence[ex.Expression]]) -> list[ex.Expression]:
        return [
            tm.collected(ex.substitute(tree, back)) for tree in found[0] if not ex.holds(tree, y)
        ]

    plane = replace(
        system, coordinates=system.coordinates[:2], accelerations=forces, branch=None, nonzero=()
    )
    yield Smaller((plane,), (material.motion.question,), lift)


def along_a_coordinate(material: mt.Material, seed: int) -> Iterator[Smaller]:
    """With u as time, x'' = F(u, x, dx/du): L = u' M(u, x, x'/u') + S(u, u').

    u' M, homogeneous of degree 1, gives the equations of the paths alone (Noether's second theorem:
    the equation of u follows from those of x), and S is a Lagrangian of u, whose equation contains
    no other coordinate. L is regular if M and S are.
    """
    for u, paths, own in sorted(
        _along(material), key=lambda found: sum(map(ex.node_count, found[1].accelerations))
    ):
        question, lift = material.motion.question, partial(_homogeneous, u)
        if _may_be_quadratic(paths):
            yield Smaller((paths, own), (PLAIN, question), partial(_of_quadratic, lift))
        yield Smaller((paths, own), (TIMED, question), lift)


def _may_be_quadratic(system: SecondOrderSystem) -> bool:
    """Whether the forces are linear in the positions and velocities, with numbers as coefficients,
    and a Lagrangian without t may be quadratic in the velocities, which is short.

    Gamma(log det g) = -tr f_v, and its left side is linear in v for g(q): the trace is zero.
    """
    rates = [*map(ex.Velocity, system.coordinates)]
    plain = {tm.monomial(letter) for letter in (*map(ex.Symbol, system.coordinates), *rates)}
    rows = [tm.terms_of(force) for force in system.accelerations]
    trace = sum(row.get(tm.monomial(v), 0) for row, v in zip(rows, rates, strict=True))
    return not trace and all(key in plain for row in rows for key in row)


def _of_quadratic(
    lift: Callable[[Sequence[Sequence[ex.Expression]]], list[ex.Expression]],
    found: Sequence[Sequence[ex.Expression]],
) -> list[ex.Expression]:
    """What is lifted from Lagrangians of the first system that are quadratic in the velocities."""
    quadratic = [
        tree
        for tree in found[0]
        if all(
            isinstance(p, ex.Velocity) and e in (1, 2)
            for key in tm.terms_of(tree)
            for p, e in key
            if tm.has_velocity(p)
        )
    ]
    return lift([quadratic, *found[1:]])


def _along(material: mt.Material) -> Iterator[tuple[str, SecondOrderSystem, SecondOrderSystem]]:
    """(u, the system of dx/du, that of u) for each coordinate u with u'' = f_u(u, u') such that
    paths have no u'.
    """
    system = material.analysis.system
    names = system.coordinates
    if system.depends_on_time or is_decoupled(material):
        return
    for u, f in zip(names, system.accelerations, strict=True):
        rate, others = ex.Velocity(u), tuple(name for name in names if name != u)
        if not coordinates_in(f, names) <= {u}:
            continue
        table = {ex.Velocity(x): ex.Velocity(x) * rate for x in others}
        forces = []
        for x, force in zip(names, system.accelerations, strict=True):
            if x != u:
                along = collecting.collect(
                    (ex.substitute(force, table) - ex.Velocity(x) * f) / rate**2
                )
                is_free = not ex.holds(along, rate)
                forces.append(
                    along if is_free else writing.quotient(along, exact_field.Budget.short())
                )
        if not any(ex.holds(force, rate) for force in forces):
            timed = tuple(ex.substitute(force, {ex.Symbol(u): ex.TIME}) for force in forces)
            functions = tuple(
                (name, tuple("t" if x == u else x for x in held)) for name, held in system.functions
            )
            plain = replace(system, branch=None, nonzero=(), functions=functions)
            paths = replace(plain, coordinates=others, accelerations=timed)
            yield u, paths, replace(plain, coordinates=(u,), accelerations=(f,))


def _homogeneous(u: str, found: Sequence[Sequence[ex.Expression]]) -> list[ex.Expression]:
    """u' M(u, x, x'/u') + S for each M."""
    rate, lagrangians = ex.Velocity(u), []
    for tree in found[0]:
        velocities = [node for node in ex.walk(tree) if isinstance(node, ex.Velocity)]
        table = {v: v / rate for v in velocities}
        lagrangians.append(
            tm.collected(rate * ex.substitute(tree, {**table, ex.TIME: ex.Symbol(u)}))
        )
    return [one + found[1][0] for one in lagrangians]
