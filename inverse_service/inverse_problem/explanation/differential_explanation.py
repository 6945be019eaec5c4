"""Why every multiplier is singular where no algebraic condition says so: differentiated equations in numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from inverse_service.algebra.point import Variable
from inverse_service.expressions.notation import Formula, of_tree, row, theory
from inverse_service.expressions.tree import Symbol
from inverse_service.inverse_problem.decision.analysis import Analysis
from inverse_service.inverse_problem.decision.local_system import RowName
from inverse_service.inverse_problem.explanation.differential_numbers import DifferentialNumbers, FractionRow, Sum
from inverse_service.inverse_problem.explanation.differentiated_equations import (
    DerivativeOfEntry,
    variables_of_question,
)
from inverse_service.inverse_problem.explanation.elimination import Unknown
from inverse_service.inverse_problem.explanation.hierarchy import unknowns
from inverse_service.inverse_problem.explanation.point_explanation import (
    combination,
    echelon,
    left_free,
    point_step,
    solution_step,
    unsolved,
)
from inverse_service.inverse_problem.explanation.steps import Piece, enumerated, said, separated
from inverse_service.inverse_problem.explanation.wording import SINGULAR, indices
from inverse_service.inverse_problem.outcome import Step


def steps_in_derivatives(
    analysis: Analysis, symbols: Mapping[Unknown, Symbol], numbers: DifferentialNumbers
) -> tuple[Step, ...]:
    """The point, the differentiated equations there, their sums, and why what they leave is singular."""
    size = len(analysis.system.coordinates)
    names = [symbols[pair] for pair in unknowns(size)]
    variables = variables_of_question(analysis, numbers.with_time)
    numbering = {name: place for place, name in enumerate(numbers.rows, 1)}
    solution = echelon([each.result for each in numbers.sums])
    return (
        _opening(analysis, numbers.with_time),
        point_step("The equations are long", numbers.variables, numbers.atoms, numbers.real),
        _notation(symbols[0, 0], variables),
        *(_equation(numbering[name], name, line, symbols, variables) for name, line in numbers.rows.items()),
        *(_sum(each, numbering, names) for each in numbers.sums),
        solution_step(solution, names),
        _closing(left_free(solution, names), bool(unsolved(solution, names)), numbers),
    )


def _opening(analysis: Analysis, with_time: bool) -> Step:
    moment = " + d/dt" if with_time or analysis.system.depends_on_time else ""
    return said(
        "Suppose that there is a Lagrangian. The algebraic conditions (`Phi`, `nabla Phi`, ..., `R`) leave a "
        "nonsingular `g`, but its Hessian `g` in the velocities satisfies (H2) `Gamma(g) = g N + (g N)^T` and (H3) "
        f"`g Phi = (g Phi)^T` identically, with `Gamma = v^i d/dq^i + f^i d/dv^i{moment}`; so their derivatives hold "
        "too (indices: ", *indices(analysis.system), ").",
        about=("multiplier",),
    )  # fmt: skip


def _notation(entry: Symbol, variables: Sequence[Variable]) -> Step:
    first, last = of_tree(variables[0]), of_tree(variables[-1])
    return said(
        "Write ", row(entry, "[", first, ", ", last, "]"), " for the derivative of ", entry, " by ", first, " and ",
        last, " at the point. By (H1) `dg_ij/dv^k` is symmetric in `i`, `j` and `k`; equal derivatives are written in "
        "one way.",
    )  # fmt: skip


def _by(exponents: Iterable[int], variables: Sequence[Variable]) -> list[Variable]:
    return [name for name, count in zip(variables, exponents, strict=True) for _ in range(count)]


def _equation(
    place: int, name: RowName, line: FractionRow, symbols: Mapping[Unknown, Symbol], variables: Sequence[Variable]
) -> Step:
    kind, i, j, alpha = name
    ordered = sorted(line.items(), key=lambda item: (item[0].degree, item[0]))
    terms = _signed([(value, _derivative(unknown, symbols, variables)) for unknown, value in ordered])
    by = _by(alpha, variables)
    differentiated: list[Piece] = [" differentiated by ", *enumerated(by)] if by else []
    return said(f"E{place}, ({kind})_{i + 1}{j + 1}", *differentiated, ", times a number: ", row(terms, " = 0"), ".")


def _derivative(
    unknown: DerivativeOfEntry, symbols: Mapping[Unknown, Symbol], variables: Sequence[Variable]
) -> Formula:
    by, entry = _by(unknown.by, variables), symbols[unknown.i, unknown.j]
    return row(entry, "[", *separated(by), "]") if by else of_tree(entry)


def _signed(terms: Sequence[tuple[Fraction, Formula]]) -> Formula:
    """The terms with their factors: 2*a - b."""
    pieces: list[Formula | str] = []
    for value, formula in terms:
        size = "" if abs(value) == 1 else f"{abs(value)}*"
        sign = ("-" if value < 0 else "") if not pieces else (" - " if value < 0 else " + ")
        pieces += [sign + size, formula]
    return row(*pieces)


def _sum(each: Sum, numbering: Mapping[RowName, int], names: Sequence[Symbol]) -> Step:
    terms = sorted((numbering[name], factor) for name, factor in each.factors.items())
    left = _signed([(factor, theory(f"E{place}")) for place, factor in terms])
    return said("In ", left, " all derivatives of `g` cancel: ", row(combination(each.result, names), " = 0"), ".")


def _closing(left: Sequence[Piece], is_free: bool, numbers: DifferentialNumbers) -> Step:
    """The kernel of a matrix whose rank is constant near a point depends on the point analytically.

    So does what the sums exclude; that det g vanishes on what they leave was found at the random point.
    """
    rest = "singular `g` only, as was computed there as well" if is_free else "no `g` but 0"
    return said(
        *left, f". The same holds at every generic point: these equations are among {numbers.considered} of their "
        f"kind, in which the coefficients of the derivatives of `g` have the rank {numbers.rank} here and, as was "
        "computed at a random point, generically too; so sums in which the derivatives cancel exist there as well, "
        f"and they leave {rest}. There is no Lagrangian.",
        shown=[SINGULAR],
    )  # fmt: skip
