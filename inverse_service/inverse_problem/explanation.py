"""Why a system is not variational, and how to verify that it is, in steps for pencil and paper."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from inverse_service.algebra.exact_ring import ExactRing
from inverse_service.algebra.exact_trees import factor_trees, quotient_tree
from inverse_service.algebra.rational_functions import Budget, Quotient, TooLarge, sum_of
from inverse_service.expressions.tree import Expression, Symbol, add, multiply, walk
from inverse_service.inverse_problem.analysis import Analysis
from inverse_service.inverse_problem.elimination import (
    Elimination,
    Linear,
    Solved,
    Unknown,
    determinant,
    eliminate,
    vanishing_block,
)
from inverse_service.inverse_problem.hierarchy import (
    ConditionName,
    EquationName,
    SufficientSet,
    equation_terms,
    hierarchy,
    tensors_at,
    unknowns,
)
from inverse_service.inverse_problem.outcome import Step
from inverse_service.inverse_problem.pointwise import local_motion
from inverse_service.inverse_problem.wording import (
    block_sentence,
    equation_step,
    opening,
    summary_steps,
    tensor_steps,
)
from inverse_service.mechanics.conditions import ExactMotion, exact_motion
from inverse_service.mechanics.curvature import Tensor11, Tensor12
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Tensors = Mapping[ConditionName, Tensor11[Quotient] | Tensor12[Quotient]]

# An elimination with larger expressions than this is no longer followed by hand.
TERM_LIMIT = 400
TIME_LIMIT = 1.0
LARGEST_N = 4


@dataclass(frozen=True, slots=True)
class Explanation:
    """The steps, and the functions that were divided by and so must not vanish.

    `complete` says whether the steps carry the whole argument; where not, they state conditions and
    ranks.
    """

    steps: tuple[Step, ...]
    side_conditions: tuple[Expression, ...] = ()
    complete: bool = True


def explain_negative(
    analysis: Analysis, chosen: SufficientSet, seed: int = 1, time_limit: float = TIME_LIMIT
) -> Explanation:
    """From the chosen conditions of the hierarchy to det g = 0.

    Where the expressions are too large for pencil and paper, the conditions and their ranks.
    """
    system = analysis.system
    if len(system.coordinates) > LARGEST_N:
        return Explanation(summary_steps(system, chosen), complete=False)
    try:
        return _by_elimination(analysis, chosen, seed, Budget(TERM_LIMIT, time.monotonic() + time_limit))
    except (TooLarge, ZeroDivisionError):
        return Explanation(summary_steps(system, chosen), complete=False)


def _by_elimination(analysis: Analysis, chosen: SufficientSet, seed: int, budget: Budget) -> Explanation:
    system = analysis.system
    n = len(system.coordinates)
    depth = max(condition.order for condition in chosen.conditions) - 2
    symbols = entry_symbols(system)
    exact = exact_motion(system, depth + 2, budget, tuple(symbols.values()))
    table = tensors_at(local_motion(analysis, seed, depth + 2), depth)
    tensors = hierarchy(exact.motion, depth)
    equations = _exact_equations(exact, tensors, chosen.equations)
    one = exact.ring.constant(1)
    result = eliminate(equations, table, one)
    used = [(condition, tensors[condition]) for condition in chosen.conditions]
    steps = [opening(system, chosen), *tensor_steps(exact.ring, used)]
    steps += [_solved_step(exact.ring, symbols, step) for step in result.solved]
    steps.append(_closing_step(exact, symbols, result, n))
    return Explanation(tuple(steps), _side_conditions(exact.ring, result))


def entry_symbols(system: SecondOrderSystem) -> dict[Unknown, Symbol]:
    """Names g_11, g_12, … for the entries, with another letter where the system uses such names."""
    used = {node.name for f in system.accelerations for node in walk(f) if isinstance(node, Symbol)}
    used |= set(system.coordinates) | set(system.parameters)
    pairs = unknowns(len(system.coordinates))
    for letter in ("g", "h", "m", "multiplier"):
        names = {(i, j): f"{letter}_{i + 1}{j + 1}" for i, j in pairs}
        if used.isdisjoint(names.values()):
            return {pair: Symbol(name) for pair, name in names.items()}
    raise TooLarge("the system uses every name for the entries of the multiplier")


def _exact_equations(
    exact: ExactMotion, tensors: Tensors, names: Sequence[EquationName]
) -> dict[EquationName, Linear]:
    """The named equations with their coefficients as ring elements."""
    found: dict[EquationName, Linear] = {}
    for condition in dict.fromkeys(name.condition for name in names):
        for name, terms in equation_terms(condition, tensors[condition], exact.motion.size).items():
            found[name] = collected(exact.motion.zero, terms)
    return {name: found[name] for name in names}


def collected(zero: Quotient, terms: Sequence[tuple[Unknown, int, Quotient]]) -> Linear:
    """The terms of one equation by unknown, zero coefficients left out."""
    parts: dict[Unknown, list[Quotient]] = {}
    for unknown, sign, coefficient in terms:
        parts.setdefault(unknown, []).append(coefficient.scaled(sign))
    sums = {unknown: sum_of(zero, summands) for unknown, summands in parts.items()}
    return {unknown: total for unknown, total in sums.items() if not total.is_zero}


def _solved_step(ring: ExactRing, symbols: Mapping[Unknown, Symbol], step: Solved) -> Step:
    original, reduced, result = (
        linear_tree(ring, symbols, row) for row in (step.original, step.reduced, step.value)
    )
    divisors = [*factor_trees(ring, step.content), *factor_trees(ring, step.divisor)]
    return equation_step(step.name, original, reduced, symbols[step.pivot], result, divisors)


def linear_tree(ring: ExactRing, symbols: Mapping[Unknown, Symbol], row: Linear) -> Expression:
    """The combination of the entries as a tree."""
    return add(*(multiply(quotient_tree(ring, row[unknown]), symbols[unknown]) for unknown in sorted(row)))


def _closing_step(
    exact: ExactMotion, symbols: Mapping[Unknown, Symbol], result: Elimination, n: int
) -> Step:
    """Why what is left is singular."""
    block = vanishing_block(result.values, n)
    if block is not None:
        return block_sentence(symbols, *block, n)
    elements = {unknown: exact.ring.atoms[symbol] for unknown, symbol in symbols.items()}
    left = determinant(result, n, elements, exact.ring.constant(1))
    if not left.is_zero:
        raise TooLarge("the determinant of what remains was not recognised as zero")
    text = "With these values det g is identically zero in the entries that remain. There is no Lagrangian."
    return Step(text, r"\det g = 0")


def _side_conditions(ring: ExactRing, result: Elimination) -> tuple[Expression, ...]:
    found: dict[Expression, None] = {}
    for step in result.solved:
        for divisor in (step.content, step.divisor):
            found.update(dict.fromkeys(factor_trees(ring, divisor)))
    return tuple(found)
