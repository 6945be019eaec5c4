"""Why every multiplier is singular where no algebraic condition says so: differentiated equations in numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from inverse_service.algebra.point import Variable
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.printing_latex import to_latex
from inverse_service.expressions.tree import Symbol, number
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
)
from inverse_service.inverse_problem.outcome import Step

_LATEX = r"\Gamma(g) = gN + (gN)^{\mathsf T},\qquad g\Phi = (g\Phi)^{\mathsf T}"


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
        *(_equation(numbering[name], name, row, symbols, variables) for name, row in numbers.rows.items()),
        *(_sum(each, numbering, names) for each in numbers.sums),
        solution_step(solution, names),
        _closing(left_free(solution, names), numbers),
    )


def _opening(analysis: Analysis, with_time: bool) -> Step:
    numbering = ", ".join(f"{k + 1} for {name}" for k, name in enumerate(analysis.system.coordinates))
    moment = " + d/dt" if with_time or analysis.system.depends_on_time else ""
    text = (
        "Suppose that there is a Lagrangian. The algebraic conditions (Phi, nabla Phi, ..., R) leave a nonsingular g, "
        "but its Hessian g in the velocities fulfils (H2) Gamma(g) = g N + (g N)^T and (H3) g Phi = (g Phi)^T "
        f"identically, with Gamma = v^i d/dq^i + f^i d/dv^i{moment}; so their derivatives hold too "
        f"(indices: {numbering})."
    )
    return Step(text, _LATEX)


def _notation(entry: Symbol, variables: Sequence[Variable]) -> Step:
    first, last = to_text(variables[0]), to_text(variables[-1])
    text = (
        f"Write {entry.name}[{first}, {last}] for the derivative of {entry.name} by {first} and {last} at the point. "
        "By (H1) dg_ij/dv^k is symmetric in i, j and k; equal derivatives are written in one way."
    )
    return Step(text, r"\partial_{v^k} g_{ij} = \partial_{v^j} g_{ik}")


def _by(exponents: Iterable[int], variables: Sequence[Variable]) -> list[Variable]:
    return [name for name, count in zip(variables, exponents, strict=True) for _ in range(count)]


def _equation(
    place: int, name: RowName, row: FractionRow, symbols: Mapping[Unknown, Symbol], variables: Sequence[Variable]
) -> Step:
    kind, i, j, alpha = name
    by = " and ".join(map(to_text, _by(alpha, variables)))
    ordered = sorted(row.items(), key=lambda item: (item[0].degree, item[0]))
    text = _signed([(value, _text(unknown, symbols, variables)) for unknown, value in ordered], "*")
    latex = _signed([(value, _latex(unknown, symbols, variables)) for unknown, value in ordered], " ")
    what = f"({kind})_{i + 1}{j + 1}" + (f" differentiated by {by}" if by else "")
    return Step(f"E{place}, {what}, times a number: {text} = 0.", rf"E_{{{place}}}:\quad {latex} = 0")


def _text(unknown: DerivativeOfEntry, symbols: Mapping[Unknown, Symbol], variables: Sequence[Variable]) -> str:
    by = ", ".join(map(to_text, _by(unknown.by, variables)))
    return symbols[unknown.i, unknown.j].name + (f"[{by}]" if by else "")


def _latex(unknown: DerivativeOfEntry, symbols: Mapping[Unknown, Symbol], variables: Sequence[Variable]) -> str:
    by = "".join(rf"\partial_{{{to_latex(name)}}} " for name in _by(unknown.by, variables))
    return by + to_latex(symbols[unknown.i, unknown.j])


def _signed(terms: Sequence[tuple[Fraction, str]], times: str) -> str:
    """The terms with their factors: 2*a - b."""
    found = ""
    for value, word in terms:
        size = "" if abs(value) == 1 else f"{abs(value)}{times}"
        sign = ("-" if value < 0 else "") if not found else (" - " if value < 0 else " + ")
        found += f"{sign}{size}{word}"
    return found


def _sum(each: Sum, numbering: Mapping[RowName, int], names: Sequence[Symbol]) -> Step:
    terms = sorted((numbering[name], factor) for name, factor in each.factors.items())
    text = _signed([(factor, f"E{place}") for place, factor in terms], "*")
    latex = _signed([(factor, rf"E_{{{place}}}") for place, factor in terms], " ")
    tree = combination(each.result, names)
    line = f"In {text} all derivatives of g cancel: {to_text(tree)} = 0."
    return Step(line, rf"{latex}:\quad {to_latex(tree)} = {to_latex(number(0))}")


def _closing(left: str, numbers: DifferentialNumbers) -> Step:
    """The kernel of a matrix whose rank is constant near a point depends on the point analytically.

    So does what the sums exclude; that det g vanishes on what they leave was found at the random point.
    """
    nothing = left == "So g = 0"
    rest = "no g but 0" if nothing else "singular g only, as was computed there as well"
    text = (
        f"{left}. The same holds at every generic point: these equations are among {numbers.considered} of their kind, "
        f"in which the coefficients of the derivatives of g have the rank {numbers.rank} here and, as was computed at "
        "a random point, generically too; so sums in which the derivatives cancel exist there as well, and they leave "
        f"{rest}. There is no Lagrangian."
    )
    return Step(text, r"\det g = 0")
