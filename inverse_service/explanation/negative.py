"""Why a system is not variational, and how to verify that it is, in steps for pencil and paper."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from inverse_service import bounds
from inverse_service.deadline import now
from inverse_service.decision.analysis import Analysis
from inverse_service.decision.solutions import Step
from inverse_service.explanation.differential_obstruction import contradiction, direction_matrix
from inverse_service.explanation.elimination import (
    Elimination,
    Linear,
    Solved,
    Unknown,
    collected,
    eliminate,
    remaining_determinant,
    vanishing_block,
)
from inverse_service.explanation.hierarchy import (
    ConditionName,
    EquationName,
    PointwiseConditions,
    SufficientSet,
    equation_terms,
    hierarchy,
    local_motion,
    tensors_at,
    unique_direction,
    unknowns,
)
from inverse_service.explanation.numbers_at_a_point import numbers_at_a_point
from inverse_service.explanation.point_explanation import steps_in_numbers
from inverse_service.explanation.wording import (
    SINGULAR,
    Explanation,
    block_sentence,
    differential_summary,
    equation_step,
    factor_steps,
    opening,
    said,
    summary_steps,
    tensor_steps,
)
from inverse_service.expressions.notation import MULTIPLIER, matrix, row
from inverse_service.expressions.tree import Expression, Symbol, add, node_count, walk
from inverse_service.field.exact_ring import ExactRing, factor_trees, quotient_tree
from inverse_service.field.rational_functions import Budget, Quotient, TooLarge
from inverse_service.mechanics.conditions import MotionInRing, Tensor11, Tensor12, motion_in_ring
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Tensors = Mapping[ConditionName, Tensor11[Quotient] | Tensor12[Quotient]]

TIME_LIMIT = 1.0
NUMBERS_LIMIT = 5.0
LARGEST_N = 5
# Characters of one step, beyond which numbers at one point are easier to follow.
LONGEST_SHOWN = 2_000


def explain_negative(
    analysis: Analysis,
    chosen: SufficientSet | None,
    with_time: bool = False,
    seed: int = 1,
    time_limit: float = TIME_LIMIT,
) -> Explanation:
    """From the chosen conditions of the hierarchy to det g = 0; for None, the differential consequence.

    Where the expressions are too large for pencil and paper, or more than one direction is left, the conditions
    in numbers at one point, or else their ranks.
    `with_time` says that the question was for L(t, q, v).
    """
    system = analysis.system
    budget = Budget(bounds.TERMS, now() + time_limit)
    summary = differential_summary(system) if chosen is None else summary_steps(system, chosen)
    found = None
    try:
        if chosen is None:
            found = _by_differentiation(analysis, with_time or system.depends_on_time, seed, budget)
        elif len(system.coordinates) <= LARGEST_N:
            found = _by_elimination(analysis, chosen, seed, budget)
    except (TooLarge, ZeroDivisionError):
        pass
    if found is not None and _length(found.steps) <= LONGEST_SHOWN:
        return found
    steps = _in_numbers(analysis, chosen) if chosen is not None and len(system.coordinates) <= LARGEST_N else None
    if steps is None or (found is not None and _length(found.steps) <= _length(steps)):
        return found or Explanation(summary, complete=False)
    return Explanation(steps)


def _length(steps: Sequence[Step]) -> int:
    """Characters of the longest step: one of thousands is not read."""
    return max(len(step.text) for step in steps)


def _in_numbers(analysis: Analysis, chosen: SufficientSet) -> tuple[Step, ...] | None:
    """The argument at one point; None where none was met in time."""
    numbers = numbers_at_a_point(analysis, chosen, now() + NUMBERS_LIMIT)
    if numbers is None:
        return None
    return steps_in_numbers(analysis.system, chosen, entry_symbols(analysis.system), numbers)


def _by_elimination(analysis: Analysis, chosen: SufficientSet, seed: int, budget: Budget) -> Explanation:
    solved = solve_conditions(analysis, chosen, seed, budget)
    steps = [opening(analysis.system, chosen), *solved.steps, _closing_step(solved)]
    return Explanation(tuple(steps))


@dataclass(frozen=True, slots=True)
class SolvedConditions:
    """The exact elimination of a set of conditions, with its steps."""

    exact: MotionInRing
    symbols: Mapping[Unknown, Symbol]
    result: Elimination
    steps: tuple[Step, ...]


@dataclass(frozen=True, slots=True)
class ExactRows:
    """The chosen equations with ring elements as coefficients, their tensors, and their values at a point."""

    exact: MotionInRing
    symbols: Mapping[Unknown, Symbol]
    tensors: Tensors
    equations: Mapping[EquationName, Linear]
    table: PointwiseConditions


def exact_rows(
    analysis: Analysis, chosen: SufficientSet, seed: int, budget: Budget, further_orders: int = 0
) -> ExactRows:
    """The rows of a set of conditions; the ring allows `further_orders` derivations of them.

    Raises TooLarge where the budget ends.
    """
    depth = max(condition.order for condition in chosen.conditions) - 2
    symbols = entry_symbols(analysis.system)
    exact = motion_in_ring(analysis.system, depth + 2 + further_orders, budget, tuple(symbols.values()))
    table = tensors_at(local_motion(analysis, seed, depth + 2), depth)
    tensors = hierarchy(exact.motion, depth)
    return ExactRows(exact, symbols, tensors, exact_equations(exact, tensors, chosen.equations), table)


def solve_conditions(
    analysis: Analysis, chosen: SufficientSet, seed: int, budget: Budget, further_orders: int = 0
) -> SolvedConditions:
    """Eliminate exactly; see `exact_rows`."""
    rows = exact_rows(analysis, chosen, seed, budget, further_orders)
    result = eliminate(rows.equations, rows.table)
    ring = rows.exact.ring
    steps = tensor_steps(ring, [(condition, rows.tensors[condition]) for condition in chosen.conditions])
    steps += [_solved_step(ring, rows.symbols, step, analysis.system.parameters) for step in result.solved]
    return SolvedConditions(rows.exact, rows.symbols, result, tuple(steps))


def _by_differentiation(analysis: Analysis, with_time: bool, seed: int, budget: Budget) -> Explanation:
    """The multiplier known up to a factor, and the equations for the factor that contradict each other."""
    chosen = unique_direction(analysis, seed) if len(analysis.system.coordinates) > 1 else None
    if chosen is None:
        raise TooLarge("the algebraic conditions leave more than one direction")
    solved = solve_conditions(analysis, chosen, seed, budget, further_orders=3)
    ring, n = solved.exact.ring, solved.exact.motion.size
    direction = direction_matrix(solved.result, n, ring.constant(1))
    found = contradiction(analysis, solved.exact, direction, with_time, seed)
    steps = [opening(analysis.system, chosen), *solved.steps, *factor_steps(ring, analysis.system, direction, found)]
    return Explanation(tuple(steps))


def entry_symbols(system: SecondOrderSystem) -> dict[Unknown, Symbol]:
    """Names g_11, g_12, … for the entries, with another letter where the system uses such names."""
    used = {node.name for f in system.accelerations for node in walk(f) if isinstance(node, Symbol)}
    used |= set(system.coordinates) | set(system.parameters)
    pairs = unknowns(len(system.coordinates))
    for letter in (MULTIPLIER.get(), "g", "h", "m", "multiplier"):
        names = {(i, j): f"{letter}_{i + 1}{j + 1}" for i, j in pairs}
        if used.isdisjoint(names.values()):
            return {pair: Symbol(name) for pair, name in names.items()}
    raise TooLarge("the system uses every name for the entries of the multiplier")


def exact_equations(exact: MotionInRing, tensors: Tensors, names: Sequence[EquationName]) -> dict[EquationName, Linear]:
    """The named equations with their coefficients as ring elements."""
    found: dict[EquationName, Linear] = {}
    for condition in dict.fromkeys(name.condition for name in names):
        for name, terms in equation_terms(condition, tensors[condition], exact.motion.size).items():
            found[name] = collected((unknown, coefficient.scaled(sign)) for unknown, sign, coefficient in terms)
    return {name: found[name] for name in names}


def _solved_step(ring: ExactRing, symbols: Mapping[Unknown, Symbol], step: Solved, parameters: Collection[str]) -> Step:
    original, reduced, result = (linear_tree(ring, symbols, row) for row in (step.original, step.reduced, step.value))
    divisors = [*factor_trees(ring, step.content), *factor_trees(ring, step.divisor)]
    return equation_step(step.name, original, reduced, symbols[step.pivot], result, divisors, parameters)


def linear_tree(ring: ExactRing, symbols: Mapping[Unknown, Symbol], row: Linear) -> Expression:
    """The combination of the entries as a tree."""
    return add(*(quotient_tree(ring, row[unknown]) * symbols[unknown] for unknown in sorted(row)))


def _closing_step(solved: SolvedConditions) -> Step:
    """Why what is left is singular; TooLarge where that was not recognized."""
    n = solved.exact.motion.size
    block = vanishing_block(solved.result.values, n)
    if block is not None:
        return block_sentence(solved.symbols, *block, n)
    ring = solved.exact.ring
    elements = {unknown: ring.atoms[symbol] for unknown, symbol in solved.symbols.items()}
    if not remaining_determinant(solved.result, n, elements, ring.constant(1)).is_zero:
        raise TooLarge("the determinant of what remains was not recognized as zero")
    return _det_vanishes(solved)


def _det_vanishes(solved: SolvedConditions) -> Step:
    """The multiplier that is left, written out where it fits a page, and its determinant."""
    n, result = solved.exact.motion.size, solved.result
    one = solved.exact.ring.constant(1)
    end = "`det g` is identically zero in the entries that remain. There is no Lagrangian."
    rows = [
        [linear_tree(solved.exact.ring, solved.symbols, result.entry((min(i, j), max(i, j)), one)) for j in range(n)]
        for i in range(n)
    ]
    if sum(node_count(entry) for line in rows for entry in line) > bounds.SHOWN:
        return said(f"With these values {end}", shown=[SINGULAR])
    return said("With these values ", row("g = ", matrix(rows)), f", and {end}", shown=[SINGULAR])
