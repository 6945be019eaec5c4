"""Find Lagrangians whose flow on the constraints is a nonholonomic motion, with their 1-jets, own
equations, and H.

The ansatz finds such Lagrangians in closed form by linear algebra. The Euler-Lagrange expressions
of a term at a point of D, with the accelerations of the motion, are linear in its coefficient. The
terms are T and T s', with T a Laurent monomial in the free velocities times a product of functions
of position; they form l - lambda_a w^a and lambda_a. They are tried one degree at a time in the
scalings of the motion (`mechanics.grading`). Products of two constraints may be added: they change the
associated system but not the motion.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations, count, islice

import numpy as np

from inverse_service import bounds, errors
from inverse_service.constrained.reduced import in_sines, reduced_system, solve_once
from inverse_service.deadline import OutOfTime, check, left, now, until, within
from inverse_service.decision import deciding
from inverse_service.decision.solutions import Lagrangian, SolveOptions
from inverse_service.expressions import calculus, collecting, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, modular, tower
from inverse_service.field.echelon import Words
from inverse_service.field.modular import Field, compiled, minus, multiply, plus
from inverse_service.mechanics import constrained_motion, euler_lagrange, grading
from inverse_service.mechanics.constrained_motion import EquationsOfMotion
from inverse_service.mechanics.second_order_system import (
    ConstrainedMotion,
    SecondOrderSystem,
    system_of,
)
from inverse_service.search import ansatz, families, material as mt
from inverse_service.search.ansatz import best_members
from inverse_service.search.tidy import describe
from inverse_service.statements.questions import Question

# The products of all degrees together.
_MOST_PRODUCTS = 200_000
# Exponents of velocities in denominators: the inclined knife edge needs v^-3.
_LOWEST = -5
# The largest sums of the exponents of coordinates, velocities, constraints and constants in a term.
_LIMITS = {"coordinate": 2, "velocity": 2, "transverse": 1, "constant": 2, "time": 1}


@dataclass(frozen=True, slots=True)
class JetOnConstraints:
    """l and the lambda_a of L = l + lambda_a (s^a' - w^a) + … along the constraints."""

    on_constraints: ex.Expression
    transverse_momenta: tuple[ex.Expression, ...]


def jet_of(lagrangian: ex.Expression, motion: ConstrainedMotion) -> JetOnConstraints:
    """The 1-jet of any L on the tangent bundle."""
    rates = motion.on_constraints
    momenta = [calculus.differentiate(lagrangian, ex.Velocity(name)) for name in motion.dependent]
    on, *transverse = (_short(ex.substitute(tree, rates)) for tree in (lagrangian, *momenta))
    return JetOnConstraints(on, tuple(transverse))


def _short(tree: ex.Expression) -> ex.Expression:
    try:
        return tm.tree_of(tm.terms_of(tree))
    except tm.TooManyTerms:
        return collecting.collect(tree)


def own_system(
    lagrangian: ex.Expression, motion: ConstrainedMotion, deadline: float
) -> SecondOrderSystem | None:
    """The Euler-Lagrange equations of a regular L, solved for the accelerations; None if they are
    too large.
    """
    names = motion.coordinates
    matrix = euler_lagrange.hessian(lagrangian, names)
    right = [
        -tree
        for tree in euler_lagrange.euler_lagrange_sums(lagrangian, names, [ex.ZERO] * len(names))
    ]
    found = None
    with suppress(exact_field.TooLarge, ZeroDivisionError):
        found = _solved(
            matrix, right, _variables(names), exact_field.Budget(bounds.TERMS, deadline)
        )
    return (
        None
        if found is None
        else SecondOrderSystem(names, found, motion.parameters, motion.functions)
    )


def _variables(names: Sequence[str]) -> list[ex.Symbol | ex.Velocity]:
    return [ex.TIME, *map(ex.Symbol, names), *map(ex.Velocity, names)]


def _solved(
    matrix: Sequence[Sequence[ex.Expression]],
    right: Sequence[ex.Expression],
    variables: Sequence[ex.Symbol | ex.Velocity],
    budget: exact_field.Budget,
) -> tuple[ex.Expression, ...] | None:
    """The exact x with matrix x = right; None if the matrix is singular."""
    trees = [*right, *(entry for row in matrix for entry in row)]
    ring = exact_field.exact_ring(trees, variables, None, budget)
    values = [[ring.value(entry) for entry in row] for row in matrix]
    solved = matrices.solve_square(values, [ring.value(tree) for tree in right])
    return (
        None
        if solved is None
        else tuple(exact_field.quotient_tree(ring, entry) for entry in solved)
    )


@dataclass(frozen=True, slots=True)
class ClosedFunctions:
    """The system R'' = G(R, R') along the motion, for as many functions R(q) as free velocities,
    and each R.
    """

    system: SecondOrderSystem
    functions: Mapping[str, ex.Expression]


def closed_coordinates(motion: ConstrainedMotion) -> Iterator[ClosedFunctions]:
    """The free coordinates, if their equations contain no others."""
    system = reduced_system(motion)
    if system is not None:
        yield ClosedFunctions(system, {name: ex.Symbol(name) for name in motion.free})


def closed_functions(motion: ConstrainedMotion, deadline: float) -> Iterator[ClosedFunctions]:
    """Other coordinates with closed equations, or factors of the forces such as x cos(phi) + y
    sin(phi).
    """
    found = dict[str, ex.Expression]({name: ex.Symbol(name) for name in motion.coordinates})
    taken = {*motion.coordinates, *motion.parameters, *dict(motion.functions)}
    with suppress(exact_field.TooLarge, ZeroDivisionError, OutOfTime), until(deadline):
        for tree in _position_factors(motion, exact_field.Budget(bounds.TERMS, deadline))[
            : bounds.FEW
        ]:
            name = next(name for k in count(1) if (name := f"R_{k}") not in taken)
            taken.add(name)
            found[name] = tree
    for chosen in combinations(found, len(motion.free)):
        functions, system = {name: found[name] for name in chosen}, None
        with suppress(exact_field.TooLarge, ZeroDivisionError, OutOfTime), until(deadline):
            check()
            system = _system_of(motion, functions, exact_field.Budget(bounds.TERMS, deadline))
        if system is not None and chosen != motion.free:
            yield ClosedFunctions(system, functions)


def _position_factors(motion: ConstrainedMotion, budget: exact_field.Budget) -> list[ex.Expression]:
    """The factors, if sums, of the parts of the forces of each degree in the velocities."""
    velocities = [ex.Velocity(name) for name in motion.free]
    still = dict.fromkeys(velocities, ex.ZERO)
    slopes = [calculus.differentiate(f, v) for f in motion.free_accelerations for v in velocities]
    trees = [ex.substitute(f, still) for f in (*motion.free_accelerations, *slopes)]
    ring = exact_field.exact_ring(
        trees, [ex.Symbol(name) for name in motion.coordinates], None, budget
    )
    values = [value for tree in trees if not (value := ring.value(tree)).is_zero]
    factors = dict.fromkeys(
        part for value in values for part in exact_field.factor_trees(ring, value)
    )
    return [
        part
        for part in factors
        if isinstance(part, ex.Sum) and _solved_for(part, motion.coordinates)
    ]


def _solved_for(tree: ex.Expression, names: Sequence[str]) -> str | None:
    """A coordinate in which the tree is linear."""
    for name in names:
        slope = calculus.differentiate(tree, ex.Symbol(name))
        if slope != ex.ZERO and ex.Symbol(name) not in ex.walk(slope):
            return name
    return None


def _system_of(
    motion: ConstrainedMotion, functions: Mapping[str, ex.Expression], budget: exact_field.Budget
) -> SecondOrderSystem | None:
    """R'' = G(R, R') with R in place of coordinates; None if G contains other coordinates."""
    table: dict[ex.Expression, ex.Expression] = {}
    others = [name for name in motion.coordinates if name not in functions]
    for name, tree in functions.items():
        if name not in motion.coordinates:
            solved = _solved_for(tree, others)
            if solved is None:
                return None
            others.remove(solved)
            rest = ex.substitute(tree, {ex.Symbol(solved): ex.ZERO})
            table[ex.Symbol(solved)] = (ex.Symbol(name) - rest) / calculus.differentiate(
                tree, ex.Symbol(solved)
            )
    rates = [motion.rate(tree) for tree in functions.values()]
    speeds = _free_velocities(motion, rates, list(functions), budget)
    if speeds is None:
        return None
    forces = [ex.substitute(ex.substitute(motion.rate(rate), speeds), table) for rate in rates]
    return _without(motion, others, list(functions), forces, budget)


def _free_velocities(
    motion: ConstrainedMotion,
    rates: Sequence[ex.Expression],
    names: Sequence[str],
    budget: exact_field.Budget,
) -> dict[ex.Expression, ex.Expression] | None:
    """The free velocities in terms of those of the functions; None if these do not determine
    them.
    """
    free: list[ex.Symbol | ex.Velocity] = [ex.Velocity(name) for name in motion.free]
    matrix = [[calculus.differentiate(rate, u) for u in free] for rate in rates]
    still = dict.fromkeys(free, ex.ZERO)
    right = [
        ex.Velocity(name) - ex.substitute(rate, still)
        for name, rate in zip(names, rates, strict=True)
    ]
    solved = _solved(matrix, right, [ex.Symbol(name) for name in motion.coordinates], budget)
    return None if solved is None else dict(zip(free, solved, strict=True))


def _without(
    motion: ConstrainedMotion,
    others: Sequence[str],
    names: Sequence[str],
    forces: Sequence[ex.Expression],
    budget: exact_field.Budget,
) -> SecondOrderSystem | None:
    """The system, if its forces depend on no other coordinate."""
    ring = exact_field.exact_ring(forces, [ex.Symbol(name) for name in others], 1, budget)
    values = [ring.value(force) for force in forces]
    if not all(
        ring.partial(place)(value).is_zero for place in range(len(others)) for value in values
    ):
        return None
    nowhere = dict.fromkeys(map(ex.Symbol, others), ex.ZERO)
    plain = [ex.substitute(exact_field.quotient_tree(ring, value), nowhere) for value in values]
    return system_of(names, plain, motion.parameters, motion.functions)


def lagrangian_of_closed(
    motion: ConstrainedMotion,
    closed: Iterable[ClosedFunctions],
    question: Question,
    seed: int,
    time_limit: float,
) -> Lagrangian | None:
    """The Lagrangian of R'' = G(R, R') plus half the squares of the constraints.

    Its equations are satisfied whenever R follows its system. If R are free coordinates, l(R, R')
    with lambda = 0 satisfies the equations along the constraints. None if none of the first few
    systems has a Lagrangian in closed form.
    """
    end = now() + time_limit
    for one in islice(closed, bounds.FEW):
        solution = solve_once(one.system, SolveOptions(question.timed, seed, max(left(end), 0.1)))
        if solution.main.lagrangian is not None:
            return on_whole_motion(motion, one, solution.main.lagrangian)
    return None


def on_whole_motion(
    motion: ConstrainedMotion, closed: ClosedFunctions, lagrangian: Lagrangian
) -> Lagrangian:
    """L(R, R') plus half the squares of the constraints, which is regular and whose flow preserves
    the constraints.
    """
    table: dict[ex.Expression, ex.Expression] = {}
    for name, tree in closed.functions.items():
        slopes = [
            calculus.differentiate(tree, ex.Symbol(q)) * ex.Velocity(q) for q in motion.coordinates
        ]
        table |= {ex.Symbol(name): tree, ex.Velocity(name): ex.add(*slopes)}
    pairs = zip(motion.dependent, motion.dependent_velocities, strict=True)
    squares = [(ex.Velocity(name) - w) ** Fraction(2) for name, w in pairs]
    half = ex.Number(Fraction(1, 2))
    whole = ex.add(
        ex.substitute(lagrangian.expression, table), *(half * square for square in squares)
    )
    return replace(
        lagrangian,
        expression=whole,
        multiplier=euler_lagrange.hessian(whole, motion.coordinates),
        domain=lagrangian.domain.changed(lambda tree: ex.substitute(tree, table)),
    )


def of_free_motion(motion: ConstrainedMotion) -> Iterator[Lagrangian]:
    """The given L plus c/2 times the squares of the constraints, if the forces of constraint vanish
    along the motion.

    The Euler-Lagrange expressions of L, lambda_a d(mu^a)/dv, are then 0 on the constraints, as
    those of the squares are. Since L is regular on D, the determinant of the Hessian is a
    polynomial in c of degree k, for k constraints, that does not vanish: one of 1, …, k + 1 makes
    the sum regular.
    """
    if not isinstance(motion, EquationsOfMotion) or any(
        force != ex.ZERO for force in motion.multipliers
    ):
        return
    given = motion.system
    half = ex.Number(Fraction(1, 2))
    squares = ex.add(*(half * constraint ** Fraction(2) for constraint in given.constraints))
    for c in range(1, len(given.constraints) + 2):
        whole = given.lagrangian + ex.number(c) * squares
        form = euler_lagrange.hessian(whole, motion.coordinates)
        with suppress(exact_field.TooLarge, ZeroDivisionError):
            still = [ex.ZERO] * len(form)
            if (
                _solved(form, still, _variables(motion.coordinates), exact_field.Budget.long())
                is not None
            ):
                yield Lagrangian(whole, form, "the given L")
                return


def first_system(motion: ConstrainedMotion) -> SecondOrderSystem:
    """The accelerations of all coordinates as functions of the free velocities."""
    table = dict(zip(motion.free, motion.free_accelerations, strict=True))
    table |= {
        name: motion.rate(w)
        for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)
    }
    accelerations = tuple(table[name] for name in motion.coordinates)
    system = SecondOrderSystem(
        motion.coordinates, accelerations, motion.parameters, motion.functions
    )
    return replace(system, nonzero=motion.nonzero)


def find_lagrangians(
    motion: ConstrainedMotion, question: Question, seed: int, deadline: float
) -> list[Lagrangian]:
    """Lagrangians that are sums of parts homogeneous in all scalings and reflections of the motion,
    simplest first.
    """
    try:
        with until(deadline), within(bounds.WORK):
            analysis = _analysis(motion, deadline)
            return _first_graded(motion, mt.gather_material(analysis, question), analysis, seed)
    except (*ansatz.NO_POINTS, tm.TooManyTerms, OutOfTime):
        return []


def with_forces_free(motion: ConstrainedMotion) -> Iterator[EquationsOfMotion]:
    """The same motion with other free coordinates, among which are more of those with a force of
    their own.

    A force along a dependent coordinate needs lambda_a that divide by more functions than f does.
    """
    if not isinstance(motion, EquationsOfMotion):
        return
    with suppress(exact_field.TooLarge, errors.InputError):
        parts = constrained_motion.geometry(motion.system)
        forces = {
            name
            for k, name in enumerate(motion.coordinates)
            if not parts.by_coordinate(k, parts.potential).is_zero
        }
        if forces.isdisjoint(motion.dependent):
            return

        def left_out(frame: constrained_motion.Frame) -> int:
            return sum(motion.coordinates[k] in forces for k in frame.dependent)

        best = min(constrained_motion.frames(parts), key=left_out)
        if left_out(best) < len(forces.intersection(motion.dependent)):
            other = constrained_motion.eliminate_multipliers(parts, best)
            yield constrained_motion.motion_as_trees(other)


def _analysis(motion: ConstrainedMotion, deadline: float) -> deciding.Analysis:
    constrained = {
        v: tower.to_kernels(w)
        for v, w in motion.on_constraints.items()
        if isinstance(v, ex.Velocity)
    }
    return replace(
        deciding.analyze(in_sines(first_system(motion), deadline)), constrained=constrained
    )


def _first_graded(
    motion: ConstrainedMotion, material: mt.Material, analysis: deciding.Analysis, seed: int
) -> list[Lagrangian]:
    forces = dict(zip(motion.coordinates, material.motion.forces, strict=True))
    rates = {
        name: tm.terms_of(tower.to_kernels(w))
        for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)
    }
    equations = [grading.second_order(name, forces[name]) for name in motion.free]
    equations += [grading.first_order(name, terms) for name, terms in rates.items()]
    gradings = grading.gradings_of(equations)
    squares, known = _squares(motion), list[ansatz.Combination]()
    for inverted in _inverted(motion):
        blocks = _blocks(motion, material, rates, inverted)
        # One for all degrees, at whose points the roots in all of them exist.
        sampler = ansatz.sampler_of(
            analysis, (tm.times(tm.EMPTY, b.product, e) for b in blocks for e in b.exponents)
        )
        for candidates in grading.products_by_degree(
            blocks, gradings, _LIMITS, _MOST_PRODUCTS, bounds.LARGE
        ):
            space = _solve_ansatz(sampler, candidates, seed)
            if not space.combinations:
                continue
            known += space.combinations
            members = best_members(replace(space, combinations=(*known, *squares)), seed)
            if members:
                return [
                    describe(analysis, tm.tree_of(member.terms), "along the constraints")
                    for member in members
                ]
    return []


def _blocks(
    motion: ConstrainedMotion,
    material: mt.Material,
    rates: Mapping[str, tm.Terms],
    inverted: Sequence[ex.Velocity],
) -> list[grading.Block]:
    """The products of which the ansatz consists, with their exponents.

    A velocity is taken with its integrating factor, so that x'' = tan(phi) phi' x' is a constant
    x'/cos(phi).
    """
    factors = families.find_factors(material)
    forces = [material.motion.forces[motion.coordinates.index(name)] for name in motion.free]
    keys = [key for terms in (*forces, *rates.values()) for key in terms]
    blocks = []
    for name in motion.free:
        v, i = ex.Velocity(name), motion.coordinates.index(name)
        factor = tm.times(factors.along.get(i, tm.EMPTY), factors.across.get(i, tm.EMPTY))
        exponents, kind = (range(_LOWEST, 3), "") if v in inverted else (range(3), "velocity")
        blocks.append(grading.Block(tm.times(factor, tm.monomial(v)), exponents, kind, moves=True))
    across = [tm.monomial(ex.Velocity(name)) for name in motion.dependent]
    blocks += [grading.Block(v, range(2), "transverse", moves=True) for v in across]
    blocks += [grading.Block(key, range(3), "constant") for key in _constant_parts(motion, keys)]
    letters = dict.fromkeys([*material.position_letters, *(p for key in keys for p, _ in key)])
    divided = {p for key in keys for p, e in key if e < 0}
    inside = {
        node for p in letters if not isinstance(p, ex.Sum) for node in ex.walk(p) if node != p
    }
    names = [*map(ex.Symbol, motion.coordinates), *[ex.TIME] * material.motion.question.timed]
    for letter in letters:
        if (
            not tm.has_velocity(letter)
            and not isinstance(letter, ex.Symbol)
            and ex.holds(letter, *names)
        ):
            blocks.append(grading.Block(tm.monomial(letter), _exponents(letter, divided)))
    blocks += [
        grading.Block(tm.monomial(q), range(3), "coordinate") for q in names if q not in inside
    ]
    in_time = factors.in_time[1:] if material.motion.question.timed else ()
    return [*blocks, *(grading.Block(factor, range(2), "time") for factor in in_time)]


def _exponents(letter: ex.Expression, divided: Set[ex.Expression]) -> Sequence[Fraction | int]:
    """The exponents of a generator of position, of which some occur in denominators; positive
    powers of a sum are sums of others.

    Of a sine and its cosine one has the exponents 0 and 1: the sine, unless it alone is divided by.
    """
    lowest = -2 if letter in divided else 0
    match letter:
        case ex.Apply("sin" | "sinh" as name, inside):
            other = ex.Apply("cos" + name[3:], inside)
            return range(-2, 3) if lowest and other not in divided else range(2)
        case ex.Apply("cos" | "cosh" as name, inside) if not lowest:
            return range(2) if ex.Apply("sin" + name[3:], inside) in divided else range(3)
        case ex.Sum():
            return [Fraction(k, 2) for k in range(-4, 2)]
        case ex.Apply("exp", _):
            return range(-2, 3)
    return range(lowest, 3)


def _solve_ansatz(
    sampler: ansatz.Sampler, candidates: Sequence[tm.Monomial], seed: int
) -> ansatz.LagrangianSpace:
    """The space of Lagrangians in the span of the candidates (simple ones first).

    The most complicated candidate of each basis element occurs in no other one. Combinations with
    coefficients other than small rationals are omitted; the checker confirms those chosen from the
    others.
    """
    letters, n = ansatz.letters_of(candidates), len(sampler.analysis.accelerations)

    def equations(begin: int, end: int) -> Words:
        table = ansatz.table_at(sampler.points(seed), letters, end, first=begin)
        return _euler_lagrange_matrix(table, letters, candidates)

    # Equations of cyclic coordinates can be trivial, so the first samples need not suffice.
    kernel = matrices.settled_kernel(len(candidates), equations, n, sampler.points(seed).prime)
    return ansatz.LagrangianSpace(sampler, tuple(ansatz.null_combinations(kernel, candidates)))


def _euler_lagrange_matrix(
    table: ansatz.LetterTable, letters: Sequence[ex.Expression], candidates: Sequence[tm.Monomial]
) -> Words:
    """EL_i of each candidate at each sample, (samples * n, candidates)."""
    prime = table.prime
    values = ansatz.monomial_values(table.values, letters, candidates, prime)
    result = np.zeros((len(values) * table.size, len(candidates)), np.uint64)
    _fill(
        values,
        ansatz.exponents_of(letters, candidates, prime),
        table.derivatives,
        modular.field_of(prime),
        result,
    )
    return result


@compiled
def _fill(
    values: Words, candidates: ansatz.Exponents, d: ansatz.Derivatives, field: Field, result: Words
) -> None:
    """result[s n + i, c] = m_c (V_i G + H_i - Q_i) at sample s, from and to Montgomery form."""
    n = d.by_velocity.shape[2]
    for s in range(values.shape[0]):
        for c in range(values.shape[1]):
            first, last = candidates.starts[c], candidates.starts[c + 1]
            along = np.uint64(0)
            for k in range(first, last):
                along = plus(
                    along,
                    multiply(candidates.exponents[k], d.along[s, candidates.letters[k]], field),
                    field,
                )
            for i in range(n):
                velocity = rest = np.uint64(0)
                for k in range(first, last):
                    e, p = candidates.exponents[k], candidates.letters[k]
                    velocity = plus(velocity, multiply(e, d.by_velocity[s, p, i], field), field)
                    other = minus(d.mixed[s, p, i], d.by_position[s, p, i], field)
                    rest = plus(rest, multiply(e, other, field), field)
                total = plus(multiply(velocity, along, field), rest, field)
                result[s * n + i, c] = multiply(values[s, c], total, field)


def _squares(motion: ConstrainedMotion) -> list[dict[tm.Monomial, Fraction]]:
    """Half the square of each constraint, which contributes nothing to the equations on the
    constraints.
    """
    found = []
    for v, w in motion.on_constraints.items():
        constraint = v - w
        try:
            found.append(
                {key: value / 2 for key, value in tm.terms_of(constraint * constraint).items()}
            )
        except tm.TooManyTerms:
            continue
    return found


def _inverted(motion: ConstrainedMotion) -> list[tuple[ex.Velocity, ...]]:
    """The free velocities allowed in denominators: those with an independent motion, or those that
    keep their sign.
    """
    pairs = [
        (ex.Velocity(name), name, f)
        for name, f in zip(motion.free, motion.free_accelerations, strict=True)
    ]
    alone = tuple(v for v, name, f in pairs if _is_alone(motion, name, f))
    kept = tuple(
        v for v, _, f in pairs if collecting.collect(ex.substitute(f, {v: ex.ZERO})) == ex.ZERO
    )
    return list(
        dict.fromkeys(chosen if len(chosen) < len(pairs) else () for chosen in (alone, kept))
    )


def _is_alone(motion: ConstrainedMotion, name: str, f: ex.Expression) -> bool:
    """Whether the motion of a coordinate depends on no other coordinate."""
    every: list[ex.Expression] = [
        *map(ex.Symbol, motion.coordinates),
        *map(ex.Velocity, motion.free),
    ]
    return not ex.holds(
        f, *(leaf for leaf in every if leaf not in (ex.Symbol(name), ex.Velocity(name)))
    )


def _constant_parts(motion: ConstrainedMotion, keys: Iterable[tm.Monomial]) -> list[tm.Monomial]:
    """The parametric part of each term, such as g*sin(alpha)."""
    moving: list[ex.Expression] = [
        ex.TIME,
        *map(ex.Symbol, motion.coordinates),
        *map(ex.Velocity, motion.coordinates),
    ]
    parts = (
        frozenset(
            (p, e) for p, e in key if not isinstance(p, ex.Number) and not ex.holds(p, *moving)
        )
        for key in keys
    )
    return tm.distinct([part for part in parts if part])
