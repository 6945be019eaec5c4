"""Why a system is not variational, in steps for pencil and paper.

Conditions that are too long to write out are shown in numbers at one point.

A minor that is not zero there is not zero on an open dense set (f is analytic), so g = 0 at the point is g = 0
at every generic point. The same holds for values that no real point has but that satisfy all algebraic relations among
the functions: the minor is not the zero element of their field. If some g remain, all singular, the numbers show
how; `hierarchy` checked at random points that this is generic.

`rational_points` finds points at which variables and atoms of f have small rational values that respect all relations
among them. Coordinates, velocities, parameters and the free generators of f (tan of a half angle, the root of an
exponential, an arbitrary function and its derivatives) get small integers. Roots must come out rational, or the next
point is tried. Values are found modulo a prime and reconstructed as fractions (Wang 1981); a second prime confirms
them.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar, cast

from inverse_service import bounds, errors
from inverse_service.deadline import now
from inverse_service.decision.deciding import Analysis, LocalScalar, motion_of_series
from inverse_service.decision.solutions import Step
from inverse_service.explanation import hierarchy, wording
from inverse_service.expressions import notation, printing, tree as ex
from inverse_service.field import exact_field, matrices, modular, null_vectors, tower
from inverse_service.field.point import Point, SingularPoint, Variable, evaluate, number_value, variables_in
from inverse_service.mechanics.conditions import MotionInRing, Tensor11, Tensor12, motion_in_ring
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Tensors = Mapping[hierarchy.ConditionName, Tensor11[exact_field.Quotient] | Tensor12[exact_field.Quotient]]

TIME_LIMIT = 1.0
NUMBERS_LIMIT = 5.0
LARGEST_N = 5
# Characters of one step, beyond which numbers at one point are easier to follow.
LONGEST_SHOWN = 2_000

Row = tuple[Fraction, ...]

# Small numbers first; larger ones, where roots have to come out, later.
_SMALL, _LARGER, _PATIENCE = 5, 12, 20
_PLAIN = tuple(tuple(map(Fraction, values.split())) for values in ("0 0 1 2", "0 0 1 2", "0 0 1 -1", "0 0 1 2"))
_SPEEDS = tuple(map(Fraction, ("0", "3/5", "4/5", "-3/5")))
CHOSEN = modular.safe_prime(7_003)

Key = TypeVar("Key")


Values = Mapping[object, Fraction]


def explain_negative(
    analysis: Analysis,
    chosen: hierarchy.SufficientSet | None,
    with_time: bool = False,
    seed: int = 1,
    time_limit: float = TIME_LIMIT,
) -> wording.Explanation:
    """From the chosen conditions of the hierarchy to det g = 0; for None, the differential consequence.

    Where the expressions are too large for pencil and paper, or more than one direction is left, the conditions
    in numbers at one point, or else their ranks.
    `with_time` says that the question was for L(t, q, v).
    """
    system = analysis.system
    budget = exact_field.Budget(bounds.TERMS, now() + time_limit)
    summary = wording.differential_summary(system) if chosen is None else wording.summary_steps(system, chosen)
    found = None
    try:
        if chosen is None:
            found = _by_differentiation(analysis, with_time or system.depends_on_time, seed, budget)
        elif len(system.coordinates) <= LARGEST_N:
            found = _by_elimination(analysis, chosen, seed, budget)
    except (exact_field.TooLarge, ZeroDivisionError):
        pass
    if found is not None and _length(found.steps) <= LONGEST_SHOWN:
        return found
    steps = _in_numbers(analysis, chosen) if chosen is not None and len(system.coordinates) <= LARGEST_N else None
    if steps is None or (found is not None and _length(found.steps) <= _length(steps)):
        return found or wording.Explanation(summary, complete=False)
    return wording.Explanation(steps)


def _length(steps: Sequence[Step]) -> int:
    """Characters of the longest step: a step of thousands of characters is of no use to a reader."""
    return max(len(step.text) for step in steps)


def _in_numbers(analysis: Analysis, chosen: hierarchy.SufficientSet) -> tuple[Step, ...] | None:
    """The argument at one point; None if no suitable point was found in time."""
    numbers = numbers_at_a_point(analysis, chosen, now() + NUMBERS_LIMIT)
    if numbers is None:
        return None
    return steps_in_numbers(analysis.system, chosen, entry_symbols(analysis.system), numbers)


def _by_elimination(
    analysis: Analysis, chosen: hierarchy.SufficientSet, seed: int, budget: exact_field.Budget
) -> wording.Explanation:
    solved = solve_conditions(analysis, chosen, seed, budget)
    steps = [wording.opening(analysis.system, chosen), *solved.steps, _closing_step(solved)]
    return wording.Explanation(tuple(steps))


@dataclass(frozen=True, slots=True)
class SolvedConditions:
    """The exact elimination of a set of conditions, with its steps."""

    exact: MotionInRing
    symbols: Mapping[hierarchy.Unknown, ex.Symbol]
    result: hierarchy.Elimination
    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True)
class ExactRows:
    """The chosen equations with ring elements as coefficients, their tensors, and their values at a point."""

    exact: MotionInRing
    symbols: Mapping[hierarchy.Unknown, ex.Symbol]
    tensors: Tensors
    equations: Mapping[hierarchy.EquationName, hierarchy.Linear]
    table: hierarchy.PointwiseConditions


def exact_rows(
    analysis: Analysis, chosen: hierarchy.SufficientSet, seed: int, budget: exact_field.Budget, further_orders: int = 0
) -> ExactRows:
    """The rows of a set of conditions; the ring allows `further_orders` derivations of them.

    Raises TooLarge where the budget ends.
    """
    depth = max(condition.order for condition in chosen.conditions) - 2
    symbols = entry_symbols(analysis.system)
    exact = motion_in_ring(analysis.system, depth + 2 + further_orders, budget, tuple(symbols.values()))
    table = hierarchy.tensors_at(hierarchy.local_motion(analysis, seed, depth + 2), depth)
    tensors = hierarchy.tensors_to_depth(exact.motion, depth)
    return ExactRows(exact, symbols, tensors, exact_equations(exact, tensors, chosen.equations), table)


def solve_conditions(
    analysis: Analysis, chosen: hierarchy.SufficientSet, seed: int, budget: exact_field.Budget, further_orders: int = 0
) -> SolvedConditions:
    """Eliminate exactly; see `exact_rows`."""
    rows = exact_rows(analysis, chosen, seed, budget, further_orders)
    result = hierarchy.eliminate(rows.equations, rows.table)
    ring = rows.exact.ring
    steps = wording.tensor_steps(ring, [(condition, rows.tensors[condition]) for condition in chosen.conditions])
    steps += [_solved_step(ring, rows.symbols, step, analysis.system.parameters) for step in result.solved]
    return SolvedConditions(rows.exact, rows.symbols, result, tuple(steps))


def _by_differentiation(
    analysis: Analysis, with_time: bool, seed: int, budget: exact_field.Budget
) -> wording.Explanation:
    """The multiplier known up to a factor, and the equations for the factor that contradict each other."""
    chosen = hierarchy.unique_direction(analysis, seed) if len(analysis.system.coordinates) > 1 else None
    if chosen is None:
        raise exact_field.TooLarge("the algebraic conditions leave more than one direction")
    solved = solve_conditions(analysis, chosen, seed, budget, further_orders=3)
    ring, n = solved.exact.ring, solved.exact.motion.size
    direction = hierarchy.direction_matrix(solved.result, n, ring.constant(1))
    found = hierarchy.contradiction(analysis, solved.exact, direction, with_time, seed)
    steps = [
        wording.opening(analysis.system, chosen),
        *solved.steps,
        *wording.factor_steps(ring, analysis.system, direction, found),
    ]
    return wording.Explanation(tuple(steps))


def entry_symbols(system: SecondOrderSystem) -> dict[hierarchy.Unknown, ex.Symbol]:
    """Names g_11, g_12, … for the entries, with another letter if the system uses such names."""
    used = {node.name for f in system.accelerations for node in ex.walk(f) if isinstance(node, ex.Symbol)}
    used |= set(system.coordinates) | set(system.parameters)
    pairs = hierarchy.unknowns(len(system.coordinates))
    for letter in (notation.MULTIPLIER.get(), "g", "h", "m", "multiplier"):
        names = {(i, j): f"{letter}_{i + 1}{j + 1}" for i, j in pairs}
        if used.isdisjoint(names.values()):
            return {pair: ex.Symbol(name) for pair, name in names.items()}
    raise exact_field.TooLarge("the system uses every name for the entries of the multiplier")


def exact_equations(
    exact: MotionInRing, tensors: Tensors, names: Sequence[hierarchy.EquationName]
) -> dict[hierarchy.EquationName, hierarchy.Linear]:
    """The named equations with their coefficients as ring elements."""
    found: dict[hierarchy.EquationName, hierarchy.Linear] = {}
    for condition in dict.fromkeys(name.condition for name in names):
        for name, terms in hierarchy.equation_terms(condition, tensors[condition], exact.motion.size).items():
            found[name] = hierarchy.collected(
                (unknown, coefficient.scaled(sign)) for unknown, sign, coefficient in terms
            )
    return {name: found[name] for name in names}


def _solved_step(
    ring: exact_field.ExactRing,
    symbols: Mapping[hierarchy.Unknown, ex.Symbol],
    step: hierarchy.Solved,
    parameters: Collection[str],
) -> Step:
    original, reduced, result = (linear_tree(ring, symbols, row) for row in (step.original, step.reduced, step.value))
    divisors = [*exact_field.factor_trees(ring, step.content), *exact_field.factor_trees(ring, step.divisor)]
    return wording.equation_step(step.name, original, reduced, symbols[step.pivot], result, divisors, parameters)


def linear_tree(
    ring: exact_field.ExactRing, symbols: Mapping[hierarchy.Unknown, ex.Symbol], row: hierarchy.Linear
) -> ex.Expression:
    """The combination of the entries as a tree."""
    return ex.add(*(exact_field.quotient_tree(ring, row[unknown]) * symbols[unknown] for unknown in sorted(row)))


def _closing_step(solved: SolvedConditions) -> Step:
    """Explain why the remaining g are singular; raises TooLarge if this was not recognized."""
    n = solved.exact.motion.size
    block = hierarchy.vanishing_block(solved.result.values, n)
    if block is not None:
        return wording.block_sentence(solved.symbols, *block, n)
    ring = solved.exact.ring
    elements = {unknown: ring.atoms[symbol] for unknown, symbol in solved.symbols.items()}
    if not hierarchy.remaining_determinant(solved.result, n, elements, ring.constant(1)).is_zero:
        raise exact_field.TooLarge("the determinant of what remains was not recognized as zero")
    return _det_vanishes(solved)


def _det_vanishes(solved: SolvedConditions) -> Step:
    """The remaining multiplier, written out if it is short, and its determinant."""
    n, result = solved.exact.motion.size, solved.result
    one = solved.exact.ring.constant(1)
    end = "`det g` is zero for all values of the remaining entries. Hence no regular Lagrangian exists."
    rows = [
        [linear_tree(solved.exact.ring, solved.symbols, result.entry((min(i, j), max(i, j)), one)) for j in range(n)]
        for i in range(n)
    ]
    if sum(ex.node_count(entry) for line in rows for entry in line) > bounds.SHOWN:
        return wording.said(f"With these values {end}", shown=[wording.SINGULAR])
    return wording.said(
        "With these values ", notation.row("g = ", notation.matrix(rows)), f", and {end}", shown=[wording.SINGULAR]
    )


def steps_in_numbers(
    system: SecondOrderSystem,
    chosen: hierarchy.SufficientSet,
    symbols: Mapping[hierarchy.Unknown, ex.Symbol],
    numbers: NumbersAtAPoint,
) -> tuple[Step, ...]:
    """The point, the tensors there, the equations, their solution, and why it is singular."""
    size = len(system.coordinates)
    names = [symbols[pair] for pair in hierarchy.unknowns(size)]
    rows = {name: (*whole_multiple(dict(enumerate(row))).values(),) for name, row in numbers.rows.items()}
    solution = echelon(list(rows.values()))
    return (
        wording.opening(system, chosen),
        point_step("The conditions are too long to print", numbers.variables, numbers.atoms, numbers.real),
        *(_tensor_step(name, matrix) for name, matrix in numbers.tensors.items()),
        *(_equation_step(name, row, names) for name, row in rows.items()),
        solution_step(solution, names),
        _closing_step_at_point(solution, names),
    )


def echelon(rows: Sequence[Row]) -> list[tuple[int, Row]]:
    """The reduced echelon form, its pivots the last entries of the rows: (pivot column, row with 1 in the pivot)."""
    width = len(rows[0]) if rows else 0
    turned = matrices.echelon_of([line[::-1] for line in rows], width)
    return sorted((width - 1 - pivot, tuple(line[::-1])) for pivot, line in turned)


def point_step(
    why: str, variables: Mapping[Variable, Fraction], atoms: Mapping[ex.Expression, Fraction], real: bool
) -> Step:
    """The substituted values, and why they are admissible."""
    values = [*sorted(variables.items(), key=lambda pair: printing.to_text(pair[0])), *atoms.items()]
    listed = wording.separated([notation.row(name, " = ", ex.number(value)) for name, value in values])
    if not values:
        return wording.said("Take any point.")
    if real:
        return wording.said(f"{why}, so evaluate them at one point: ", *listed, ".")
    return wording.said(
        f"{why}, so substitute numbers for the functions: ", *listed, ". No real point need have these values, but "
        "they satisfy every algebraic relation among these functions and the variables.",
    )  # fmt: skip


def _tensor_step(condition: hierarchy.ConditionName, rows: tuple[Row, ...]) -> Step:
    entries = notation.matrix([[ex.number(entry) for entry in line] for line in rows])
    return wording.said("At this point ", notation.row(notation.theory(f"{condition.name} = "), entries), ".")


def combination(row: Row, names: Sequence[ex.Symbol]) -> ex.Expression:
    return ex.add(*(a * name for a, name in zip(row, names, strict=True) if a))


def _equation_step(name: hierarchy.EquationName, line: Row, names: Sequence[ex.Symbol]) -> Step:
    return wording.said(
        wording.equation_name(name), ", up to a constant factor: ", notation.row(combination(line, names), " = 0"), "."
    )


def solution_step(solution: Sequence[tuple[int, Row]], names: Sequence[ex.Symbol]) -> Step:
    lines = []
    for pivot, line in solution:
        rest = tuple(-a if k != pivot else Fraction(0) for k, a in enumerate(line))
        lines.append(notation.row(names[pivot], " = ", combination(rest, names)))
    return wording.said("These linear equations have the solution ", *wording.separated(lines), ".")


def left_free(solution: Sequence[tuple[int, Row]], names: Sequence[ex.Symbol]) -> list[wording.Piece]:
    """State what the solution implies for g."""
    free = unsolved(solution, names)
    if not free:
        return ["Hence `g = 0`"]
    return ["Hence `det g = 0` for all values of ", *wording.enumerated(free)]


def unsolved(solution: Sequence[tuple[int, Row]], names: Sequence[ex.Symbol]) -> list[ex.Symbol]:
    """The entries of g that the solution leaves free."""
    return [name for k, name in enumerate(names) if k not in {pivot for pivot, _ in solution}]


def _closing_step_at_point(solution: Sequence[tuple[int, Row]], names: Sequence[ex.Symbol]) -> Step:
    """A rank is generic where it is full; that a determinant vanishes might be an accident of one point."""
    minors = (
        "The same argument applies at every generic point, because a minor that is nonzero for these numbers vanishes "
        "at most on a set without interior points."
    )
    random = (
        "The choice of point does not matter: at random points, modulo large primes, the same equations also admit "
        "only singular `g`, so `det g = 0` at every generic point."
    )
    reason = random if unsolved(solution, names) else minors
    return wording.said(*left_free(solution, names), f". {reason} So there is no Lagrangian.", shown=[wording.SINGULAR])


@dataclass(slots=True)
class SmallPoint(Point):
    """A point whose free values are small integers, the same modulo every prime."""

    def draw(self, key: object) -> int:
        largest = _SMALL if self.seed < _PATIENCE else _LARGER
        return random.Random(f"{self.seed}|{key!r}").randint(1, largest)


@dataclass(slots=True)
class PlainPoint(Point):
    """A point where variables and tangents of half angles are 0 as often as not: fewer terms remain.

    Every fourth has velocities such as 3/5, at which roots like (1 - v^2)^(1/2) come out.
    """

    def draw(self, key: object) -> int:
        source = random.Random(f"{self.seed}|{key!r}")
        if not (isinstance(key, tuple) and isinstance(key[0], ex.Symbol | ex.Velocity | ex.Sum | ex.Product)):
            return source.randint(1, 2)
        fractions = isinstance(key[0], ex.Velocity) and self.seed % 4 == 3
        return number_value(source.choice(_SPEEDS if fractions else _PLAIN[self.seed % 4]), self.prime)


def has_points(analysis: Analysis) -> bool:
    """Whether values can be put for all atoms: not where numbers such as pi, sin(1) or exp(2) occur."""
    radians = any(isinstance(rule, tower.AngleRule) and rule.radians for rule in analysis.tower.rules)
    bare = bare_variables(analysis.accelerations)
    numbers = any(
        isinstance(atom, ex.Apply) and not variables_in(atom) for atom in tower.atoms_in_order(analysis.accelerations)
    )
    return not radians and ex.PI not in bare and not numbers


def is_real(analysis: Analysis) -> bool:
    """Whether the values drawn for variables and free generators are those of one real point.

    They are where each free generator is the exponential, sine or cosine of a rational combination of
    variables that occur nowhere else, and these combinations are independent: they can then be chosen to fit.
    Else they are values that the same algebraic relations allow.
    """
    bare = bare_variables(analysis.accelerations)
    arguments: list[Mapping[Variable, Fraction]] = []
    for rule in analysis.tower.rules:
        if isinstance(rule, tower.ExponentialRule) and rule.constant:
            return False  # e has its own value
        if not rule.free:
            continue
        found = _combination(rule.angle if isinstance(rule, tower.AngleRule) else rule.atom.argument)
        if found is None or not isinstance(rule, tower.AngleRule | tower.ExponentialRule) or bare & set(found):
            return False
        arguments.append(found)
    names = sorted({name for found in arguments for name in found}, key=repr)
    rows = [[found.get(name, Fraction(0)) for name in names] for found in arguments]
    return not names or len(matrices.echelon_of(rows, len(names))) == len(arguments)


def _combination(expression: ex.Expression) -> dict[Variable, Fraction] | None:
    """The coefficients of a rational combination of variables; None for another expression."""
    match expression:
        case ex.Symbol() | ex.Velocity():
            return {expression: Fraction(1)}
        case ex.Product((ex.Number(value), ex.Symbol() | ex.Velocity() as name)):
            return {name: value}
        case ex.Sum(terms):
            total: dict[Variable, Fraction] = {}
            for part in map(_combination, terms):
                if part is None:
                    return None
                for name, value in part.items():
                    total[name] = total.get(name, Fraction(0)) + value
            return total
    return None


def bare_variables(expressions: Iterable[ex.Expression]) -> set[Variable]:
    """Variables that occur outside transcendental atoms."""
    found: set[Variable] = set()
    for each in expressions:
        if isinstance(each, ex.Symbol | ex.Velocity):
            found.add(each)
        elif not isinstance(each, ex.Apply):
            found |= bare_variables(ex.children(each))
    return found


def atoms_and_jets(analysis: Analysis, further: int) -> list[ex.Expression]:
    """Transcendental atoms and roots in f, and arbitrary functions with `further` more derivatives than in f."""
    nodes = {node for f in analysis.accelerations for node in ex.walk(f) if isinstance(node, ex.Arbitrary)}
    functions: dict[tuple[str, tuple[ex.Expression, ...]], int] = {}
    for node in sorted(nodes, key=printing.to_text):
        place = (node.name, node.arguments)
        functions[place] = max(functions.get(place, 0), sum(node.orders) + further)
    derivatives = [
        ex.Arbitrary(name, arguments, orders)
        for (name, arguments), highest in functions.items()
        for orders in itertools.product(range(highest + 1), repeat=len(arguments))
        if sum(orders) <= highest
    ]
    return [*_with_partners(tower.atoms_in_order(analysis.accelerations)), *derivatives]


def _with_partners(atoms: Iterable[ex.Expression]) -> Iterator[ex.Expression]:
    """The atoms, with the sine of an angle its cosine too, which derivatives of f contain."""
    seen: set[ex.Expression] = set()
    for atom in atoms:
        both: list[ex.Expression] = [atom]
        if isinstance(atom, ex.Apply) and atom.function in ("sin", "cos"):
            both = [ex.Apply(name, atom.argument) for name in ("sin", "cos")]
        yield from (each for each in both if each not in seen)
        seen.update(both)


def placed(analysis: Analysis, point: Point) -> bool:
    """Give the atoms their values at the point; whether the point is one of the domain of f."""
    requirements = [*((radicand, 1) for radicand in analysis.tower.radicands), *analysis.tower.signs]
    try:
        for rule in analysis.tower.rules:
            tower.replay(rule, point, analysis.tower.scale)
        signs = [(modular.is_positive(evaluate(tree, point), point.prime), sign) for tree, sign in requirements]
    except (SingularPoint, ValueError, ZeroDivisionError, errors.IrreducibleAtoms):
        return False
    return all(positive == (sign > 0) for positive, sign in signs)


def in_fractions(analysis: Analysis, residues: Callable[[int], Mapping[Key, int] | None]) -> dict[Key, Fraction] | None:
    """`residues(prime)` as fractions of small numbers, from one prime and confirmed by another."""
    found = fractions_of_one_prime(analysis, residues)
    return found if found is not None and are_confirmed(analysis, residues, found) else None


def fractions_of_one_prime(
    analysis: Analysis, residues: Callable[[int], Mapping[Key, int] | None]
) -> dict[Key, Fraction] | None:
    """`residues(prime)` as fractions of small numbers, to be confirmed."""
    prime = modular.safe_prime(7_001, analysis.tower.residues)
    found: dict[Key, Fraction] = {}
    for key, residue in (residues(prime) or {}).items():
        value = modular.reconstruct(residue, prime, bounds.NUMBER)
        if value is None:
            return None
        found[key] = value
    return found or None


def are_confirmed(
    analysis: Analysis, residues: Callable[[int], Mapping[Key, int] | None], found: Mapping[Key, Fraction]
) -> bool:
    """Whether a second prime gives the same fractions."""
    prime = modular.safe_prime(7_002, analysis.tower.residues)
    values = residues(prime)
    return values is not None and not any(
        (fraction.numerator - values.get(key, 0) * fraction.denominator) % prime for key, fraction in found.items()
    )


def residues_at(
    analysis: Analysis, point: Point, atoms: Sequence[ex.Expression], further: Callable[[Point], Mapping[Any, int]]
) -> dict[Any, int] | None:
    """Values of variables, atoms and the `further` quantities; None if the point is singular."""
    if not placed(analysis, point):
        return None
    try:
        found: dict[Any, int] = {atom: evaluate(atom, point) for atom in atoms}
        return {**found, **further(point), **point.variables}
    except (SingularPoint, ValueError, ZeroDivisionError, errors.IrreducibleAtoms):
        return None


@dataclass(frozen=True, slots=True)
class NumbersAtAPoint:
    """Values of variables and atoms, of the tensors (n, n) and of the equations over `unknowns`.

    `real` says whether a real point has these values; else they only respect the algebraic relations.
    """

    variables: Mapping[Variable, Fraction]
    atoms: Mapping[ex.Expression, Fraction]
    tensors: Mapping[hierarchy.ConditionName, tuple[tuple[Fraction, ...], ...]]
    rows: Mapping[hierarchy.EquationName, tuple[Fraction, ...]]
    real: bool = True


def numbers_at_a_point(
    analysis: Analysis, chosen: hierarchy.SufficientSet, deadline: float = float("inf")
) -> NumbersAtAPoint | None:
    """The chosen equations at a point where they still leave only singular g.

    None where none was met before the deadline (`now`), or numbers such as pi have no value.
    """
    if not has_points(analysis):
        return None
    size = len(analysis.system.coordinates)
    for attempt in range(bounds.TRIES):
        if now() > deadline:
            break
        values = in_fractions(analysis, partial(_residues, analysis, chosen, attempt))
        if values is None:
            continue
        rows = {name: tuple(values[name, k] for k in range(len(hierarchy.unknowns(size)))) for name in chosen.equations}
        if leave_singular_only(rows.values(), size):
            return _collected(analysis, chosen, values, rows)
    return None


def matrices_left(rows: Iterable[Sequence[Fraction]], size: int) -> list[list[int]]:
    """A basis of the symmetric matrices that satisfy the rows, modulo a prime."""
    residues = [tuple(number_value(entry, CHOSEN) for entry in row) for row in rows]
    return null_vectors.null_rows(residues, len(hierarchy.unknowns(size)), CHOSEN)


def leave_singular_only(rows: Iterable[Sequence[Fraction]], size: int) -> bool:
    """Whether every symmetric matrix that satisfies the rows is singular."""
    return hierarchy.all_singular(matrices_left(rows, size), size, CHOSEN)


def whole_multiple(row: Mapping[Key, Fraction]) -> dict[Key, Fraction]:
    """The row times a number, its entries whole without a common divisor."""
    scale = math.lcm(*(value.denominator for value in row.values()))
    divisor = math.gcd(*(int(value * scale) for value in row.values())) or 1
    return {key: value * scale / divisor for key, value in row.items()}


def _collected(
    analysis: Analysis,
    chosen: hierarchy.SufficientSet,
    values: Values,
    rows: Mapping[hierarchy.EquationName, tuple[Fraction, ...]],
) -> NumbersAtAPoint:
    """The values, keyed by the expressions that have them."""
    size = range(len(analysis.system.coordinates))
    bare = bare_variables(analysis.accelerations)
    variables = {
        key: value for key, value in values.items() if isinstance(key, ex.Symbol | ex.Velocity) and key in bare
    }
    atoms = {atom: values[atom] for atom in _atoms(analysis, chosen)}
    tensors = {
        condition: tuple(tuple(values[condition, i, k] for k in size) for i in size)
        for condition in chosen.conditions
        if not condition.cyclic
    }
    return NumbersAtAPoint(variables, atoms, tensors, rows, is_real(analysis))


def _residues(
    analysis: Analysis, chosen: hierarchy.SufficientSet, attempt: int, prime: int
) -> dict[object, int] | None:
    """Everything at the point number `attempt`, modulo the prime; None where it is singular."""
    kind = PlainPoint if attempt % 2 else SmallPoint
    point = kind(prime, attempt // 2, dict(analysis.tower.real_signs))
    return residues_at(analysis, point, _atoms(analysis, chosen), lambda there: _conditions(analysis, chosen, there))


def _atoms(analysis: Analysis, chosen: hierarchy.SufficientSet) -> list[ex.Expression]:
    return atoms_and_jets(analysis, max(condition.order for condition in chosen.conditions) - 1)


def _conditions(analysis: Analysis, chosen: hierarchy.SufficientSet, point: Point) -> dict[object, int]:
    """The tensors' components and the rows of the equations at the point."""
    depth = max(condition.order for condition in chosen.conditions) - 2
    local = motion_of_series(*analysis.series(point, analysis.system.depends_on_time, depth + 2))
    tensors, rows = hierarchy.tensors_to_depth(local, depth), hierarchy.tensors_at(local, depth).rows
    found: dict[object, int] = {}
    for condition in chosen.conditions:
        if not condition.cyclic:
            plain = cast("Tensor11[LocalScalar]", tensors[condition])
            found |= {(condition, i, k): entry.value for i, row in enumerate(plain) for k, entry in enumerate(row)}
    for name in chosen.equations:
        found |= {(name, column): entry for column, entry in enumerate(rows[name])}
    return found
