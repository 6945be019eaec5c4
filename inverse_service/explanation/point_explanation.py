"""Why every admissible multiplier is singular, in numbers at one point: for conditions too long to write out.

A minor that is not zero at one point is not zero on an open dense set (f is analytic), so g = 0 at the point is g = 0
at every generic point. The same holds for values that no real point has but that satisfy all algebraic relations among
the functions: the minor is not the zero element of their field. Where some g are left, all singular, the numbers show
how; that it is so generically was found by `hierarchy` at random points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from inverse_service.decision.solutions import Step
from inverse_service.explanation.elimination import Unknown
from inverse_service.explanation.hierarchy import ConditionName, EquationName, SufficientSet, unknowns
from inverse_service.explanation.numbers_at_a_point import NumbersAtAPoint, whole_multiple
from inverse_service.explanation.wording import (
    SINGULAR,
    Piece,
    enumerated,
    equation_name,
    opening,
    said,
    separated,
)
from inverse_service.expressions.notation import matrix, row, theory
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Expression, Symbol, add, number
from inverse_service.field.point import Variable
from inverse_service.field.semidefinite import echelon_of
from inverse_service.mechanics.second_order_system import SecondOrderSystem

Row = tuple[Fraction, ...]


def steps_in_numbers(
    system: SecondOrderSystem, chosen: SufficientSet, symbols: Mapping[Unknown, Symbol], numbers: NumbersAtAPoint
) -> tuple[Step, ...]:
    """The point, the tensors there, the equations, their solution, and why it is singular."""
    size = len(system.coordinates)
    names = [symbols[pair] for pair in unknowns(size)]
    rows = {name: (*whole_multiple(dict(enumerate(row))).values(),) for name, row in numbers.rows.items()}
    solution = echelon(list(rows.values()))
    return (
        opening(system, chosen),
        point_step("The conditions are long", numbers.variables, numbers.atoms, numbers.real),
        *(_tensor_step(name, matrix) for name, matrix in numbers.tensors.items()),
        *(_equation_step(name, row, names) for name, row in rows.items()),
        solution_step(solution, names),
        _closing_step(solution, names),
    )


def echelon(rows: Sequence[Row]) -> list[tuple[int, Row]]:
    """The reduced echelon form, its pivots the last entries of the rows: (pivot column, row with 1 in the pivot)."""
    width = len(rows[0]) if rows else 0
    turned = echelon_of([line[::-1] for line in rows], width)
    return sorted((width - 1 - pivot, tuple(line[::-1])) for pivot, line in turned)


def point_step(
    why: str, variables: Mapping[Variable, Fraction], atoms: Mapping[Expression, Fraction], real: bool
) -> Step:
    """The values that are put in, and why they may be."""
    values = [*sorted(variables.items(), key=lambda pair: to_text(pair[0])), *atoms.items()]
    listed = separated([row(name, " = ", number(value)) for name, value in values])
    if not values:
        return said("Take any point.")
    if real:
        return said(f"{why}; take one point. There let ", *listed, ".")
    return said(
        f"{why}; put numbers for the functions in them: ", *listed, ". No real point need have these values, but they "
        "satisfy every algebraic relation that holds among these functions and the variables.",
    )  # fmt: skip


def _tensor_step(condition: ConditionName, rows: tuple[Row, ...]) -> Step:
    entries = matrix([[number(entry) for entry in line] for line in rows])
    return said("At this point ", row(theory(f"{condition.name} = "), entries), ".")


def combination(row: Row, names: Sequence[Symbol]) -> Expression:
    return add(*(a * name for a, name in zip(row, names, strict=True) if a))


def _equation_step(name: EquationName, line: Row, names: Sequence[Symbol]) -> Step:
    return said(equation_name(name), ", times a number: ", row(combination(line, names), " = 0"), ".")


def solution_step(solution: Sequence[tuple[int, Row]], names: Sequence[Symbol]) -> Step:
    lines = []
    for pivot, line in solution:
        rest = tuple(-a if k != pivot else Fraction(0) for k, a in enumerate(line))
        lines.append(row(names[pivot], " = ", combination(rest, names)))
    return said("These linear equations have the solution ", *separated(lines), ".")


def left_free(solution: Sequence[tuple[int, Row]], names: Sequence[Symbol]) -> list[Piece]:
    """What the solution makes of g."""
    free = unsolved(solution, names)
    if not free:
        return ["So `g = 0`"]
    return ["With these values `det g` is zero whatever ", *enumerated(free), " may be"]


def unsolved(solution: Sequence[tuple[int, Row]], names: Sequence[Symbol]) -> list[Symbol]:
    """The entries of g that the solution leaves free."""
    return [name for k, name in enumerate(names) if k not in {pivot for pivot, _ in solution}]


def _closing_step(solution: Sequence[tuple[int, Row]], names: Sequence[Symbol]) -> Step:
    """A rank is generic where it is full; that a determinant vanishes might be an accident of one point."""
    minors = (
        "What is excluded here is excluded at every generic point, because a minor that is not zero for these numbers "
        "vanishes at most on a set without interior."
    )
    random = (
        "This is no accident of the point: at random points, modulo large primes, the same equations were found to "
        "leave singular `g` only, so `det g` is zero at every generic point."
    )
    reason = random if unsolved(solution, names) else minors
    return said(*left_free(solution, names), f". {reason} There is no Lagrangian.", shown=[SINGULAR])
