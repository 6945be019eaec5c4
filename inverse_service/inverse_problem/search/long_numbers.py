"""Numbers that are too long to be found again from a residue: letters take their place while L is searched for.

398600.4418 is 1993002209/5000, and a coefficient with more than some nine digits cannot be told from its residue modulo
one prime of 61 bits. A system with a letter instead has coefficients as short as its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    Expression,
    Number,
    Power,
    Symbol,
    multiply,
    number,
    power,
    rebuild,
    substitute,
)
from inverse_service.inverse_problem.decision.analysis import Analysis, analyse
from inverse_service.inverse_problem.search.protocol import Found

_LONGEST = 10**6
_MOST_LETTERS = 6


@dataclass(frozen=True, slots=True)
class Lettered:
    """The system with letters, and the positive numbers that they stand for."""

    analysis: Analysis
    numbers: dict[Expression, Expression]

    def put_back(self, tree: Expression) -> Expression:
        """A formula with the numbers again."""
        return substitute(tree, self.numbers) if self.numbers else tree

    def restored(self, found: Found | None) -> Found | None:
        """What a search found for the letters, with the numbers."""
        if found is None:
            return None
        trees, parts = (tuple(map(self.put_back, each)) for each in (found.lagrangians, found.parts))
        return replace(found, lagrangians=trees, parts=parts)


def views(analysis: Analysis) -> Iterator[Lettered]:
    """The system with letters for its long numbers, if there are such, and as it is."""
    lettered = with_letters(analysis)
    if lettered is not None:
        yield lettered
    yield Lettered(analysis, {})


def with_letters(analysis: Analysis) -> Lettered | None:
    """The analysis of the system with a letter for each long number; None where there is none, or too many."""
    system, found = analysis.system, dict[Expression, Symbol]()
    taken = {*system.coordinates, *system.parameters, *(function.name for function in system.functions)}
    names = (name for k in range(1, 10**6) if (name := f"number_{k}") not in taken)

    def letter(size: Number) -> Symbol:
        if size not in found:
            found[size] = Symbol(next(names))
        return found[size]

    forces = tuple(_rewritten(force, letter) for force in system.accelerations)
    if not found or len(found) > _MOST_LETTERS:
        return None
    letters = tuple(found.values())
    branch = system.branch and replace(system.branch, positive=(*system.branch.positive, *letters))
    parameters = (*system.parameters, *(symbol.name for symbol in letters))
    try:
        changed = analyse(replace(system, accelerations=forces, parameters=parameters, branch=branch))
    except IrreducibleAtoms:
        return None
    return Lettered(changed, {symbol: size for size, symbol in found.items()})


def _rewritten(tree: Expression, letter: Callable[[Number], Symbol]) -> Expression:
    """The tree with letters for long numbers that are no exponents."""
    match tree:
        case Number(value) if max(abs(value.numerator), value.denominator) > _LONGEST:
            return multiply(number(1 if value > 0 else -1), letter(number(abs(value))))
        case Power(base, exponent):
            return power(_rewritten(base, letter), exponent)
        case _:
            return rebuild(tree, lambda part: _rewritten(part, letter))
