"""A real point with rational values at which the conditions of the hierarchy become equations in numbers.

Coordinates, velocities, parameters and the free generators of f (tan of a half angle, the root of an
exponential, an arbitrary function and its derivatives) get small whole numbers. Roots must come out
rational, or the next point is tried. All values are found modulo a prime and reconstructed as fractions
(Wang 1981); a second prime confirms them.
"""

from __future__ import annotations

import itertools
import random
import time
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import cast

from inverse_service.algebra.point import Expansion, Point, Variable, evaluate, number_value, variables_in
from inverse_service.algebra.primes import is_positive, reconstruct, safe_prime
from inverse_service.algebra.rules import AngleRule, ExponentialRule, replay
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import atoms_in_order
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    PI,
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Product,
    Sum,
    Symbol,
    Velocity,
    children,
    walk,
)
from inverse_service.inverse_problem.analysis import Analysis
from inverse_service.inverse_problem.hierarchy import (
    ConditionName,
    EquationName,
    SufficientSet,
    all_singular,
    hierarchy,
    kernel,
    tensors_at,
    unknowns,
)
from inverse_service.inverse_problem.pointwise import LocalScalar, motion_of_series
from inverse_service.mechanics.curvature import Tensor11

_ATTEMPTS = 400
# Small numbers first; larger ones, where roots have to come out, later.
_SMALL, _LARGER, _PATIENCE = 5, 12, 20
# Numerators and denominators beyond this are no longer numbers for a person.
_BOUND = 10**7

Residues = Mapping[object, int]
Values = Mapping[object, Fraction]


@dataclass(slots=True)
class SmallPoint(Point):
    """A point whose free values are small whole numbers, the same modulo every prime."""

    def draw(self, key: object) -> int:
        largest = _SMALL if self.seed < _PATIENCE else _LARGER
        return random.Random(f"{self.seed}|{key!r}").randint(1, largest)


@dataclass(frozen=True, slots=True)
class NumbersAtAPoint:
    """Values of variables and atoms, of the tensors (n, n) and of the equations over `unknowns`."""

    variables: Mapping[Variable, Fraction]
    atoms: Mapping[Expression, Fraction]
    tensors: Mapping[ConditionName, tuple[tuple[Fraction, ...], ...]]
    rows: Mapping[EquationName, tuple[Fraction, ...]]


def numbers_at_a_point(
    analysis: Analysis, chosen: SufficientSet, deadline: float = float("inf")
) -> NumbersAtAPoint | None:
    """The chosen equations at a point where they still leave only singular g.

    None where none was met before the deadline (time.monotonic).
    """
    if not _is_real(analysis):
        return None
    size = len(analysis.system.coordinates)
    for attempt in range(_ATTEMPTS):
        if time.monotonic() > deadline:
            break
        values = _values(analysis, chosen, attempt)
        if values is None:
            continue
        rows = {name: tuple(values[name, k] for k in range(len(unknowns(size)))) for name in chosen.equations}
        if _leaves_singular_only(rows, size):
            return _collected(analysis, chosen, values, rows)
    return None


def _leaves_singular_only(rows: Mapping[EquationName, tuple[Fraction, ...]], size: int) -> bool:
    """Whether every symmetric matrix that fulfils the rows is singular."""
    prime = safe_prime(7_003)
    residues = [tuple(number_value(entry, prime) for entry in row) for row in rows.values()]
    return all_singular(kernel(residues, len(unknowns(size)), prime), size, prime)


def _collected(
    analysis: Analysis, chosen: SufficientSet, values: Values, rows: Mapping[EquationName, tuple[Fraction, ...]]
) -> NumbersAtAPoint:
    """The values by what they are values of."""
    size = range(len(analysis.system.coordinates))
    bare = {name for f in analysis.accelerations for name in _bare(f)}
    variables = {key: value for key, value in values.items() if isinstance(key, Symbol | Velocity) and key in bare}
    atoms = {atom: values[atom] for atom in _atoms(analysis, chosen)}
    tensors = {
        condition: tuple(tuple(values[condition, i, k] for k in size) for i in size)
        for condition in chosen.conditions
        if not condition.cyclic
    }
    return NumbersAtAPoint(variables, atoms, tensors, rows)


def _is_real(analysis: Analysis) -> bool:
    """Whether the values drawn for variables and free generators are those of one real point.

    They are where each free generator is the exponential, sine or cosine of a rational combination of
    variables that occur nowhere else: its argument can then be chosen to fit.
    """
    seen = {name for f in analysis.accelerations for name in _bare(f)}
    for rule in analysis.tower.rules:
        if isinstance(rule, AngleRule) and rule.radians:
            return False
        if not rule.free:
            continue
        place = rule.angle if isinstance(rule, AngleRule) else rule.atom.argument
        names = set(variables_in(place))
        if not isinstance(rule, AngleRule | ExponentialRule) or not _is_linear(place) or names & seen:
            return False
        seen |= names
    return PI not in seen and not any(_is_number(atom) for atom in atoms_in_order(analysis.accelerations))


def _is_number(atom: Expression) -> bool:
    return isinstance(atom, Apply) and not variables_in(atom)


def _is_linear(expression: Expression) -> bool:
    """A rational combination of variables."""
    match expression:
        case Symbol() | Velocity():
            return True
        case Sum(terms):
            return all(map(_is_linear, terms))
        case Product((Number(), Symbol() | Velocity())):
            return True
    return False


def _bare(expression: Expression) -> set[Variable]:
    """Variables that occur outside transcendental atoms."""
    if isinstance(expression, Apply):
        return set()
    if isinstance(expression, Symbol | Velocity):
        return {expression}
    return {name for child in children(expression) for name in _bare(child)}


def _residues(analysis: Analysis, chosen: SufficientSet, attempt: int, prime: int) -> Residues | None:
    """Everything at the point number `attempt`, modulo the prime; None where it is singular."""
    point = SmallPoint(prime, attempt, dict(analysis.tower.real_signs))
    requirements = [*((radicand, 1) for radicand in analysis.tower.radicands), *analysis.tower.signs]
    try:
        for rule in analysis.tower.rules:
            replay(rule, point, analysis.tower.scale)
        if not all(is_positive(evaluate(tree, point), prime) == (sign > 0) for tree, sign in requirements):
            return None
        found: dict[object, int] = {atom: evaluate(atom, point) for atom in _atoms(analysis, chosen)}
        found |= _conditions(analysis, chosen, point)
    except (SingularPoint, ValueError, ZeroDivisionError, IrreducibleAtoms):
        return None
    return found | dict(point.variables)


def _atoms(analysis: Analysis, chosen: SufficientSet) -> list[Expression]:
    """Transcendental atoms and roots in f, and arbitrary functions with the derivatives that the tensors need."""
    further = max(condition.order for condition in chosen.conditions) - 1
    nodes = {node for f in analysis.accelerations for node in walk(f) if isinstance(node, Arbitrary)}
    functions: dict[tuple[str, tuple[Expression, ...]], int] = {}
    for node in sorted(nodes, key=to_text):
        place = (node.name, node.arguments)
        functions[place] = max(functions.get(place, 0), sum(node.orders) + further)
    derivatives = [
        Arbitrary(name, arguments, orders)
        for (name, arguments), highest in functions.items()
        for orders in itertools.product(range(highest + 1), repeat=len(arguments))
        if sum(orders) <= highest
    ]
    return [*atoms_in_order(analysis.accelerations), *derivatives]


def _conditions(analysis: Analysis, chosen: SufficientSet, point: Point) -> dict[object, int]:
    """The tensors' components and the rows of the equations at the point."""
    system = analysis.system
    depth = max(condition.order for condition in chosen.conditions) - 2
    moment: list[Variable] = [TIME] if system.depends_on_time else []
    positions: list[Variable] = [Symbol(name) for name in system.coordinates]
    velocities: list[Variable] = [Velocity(name) for name in system.coordinates]
    variables = [*moment, *positions, *velocities]
    expansion = Expansion(point, variables, depth + 2)
    forces = [expansion.expand(f) for f in analysis.accelerations]
    local = motion_of_series(expansion.ring, [expansion.expand(v) for v in velocities], forces)
    tensors, rows = hierarchy(local.motion, depth), tensors_at(local, depth).rows
    found: dict[object, int] = {}
    for condition in chosen.conditions:
        if not condition.cyclic:
            plain = cast("Tensor11[LocalScalar]", tensors[condition])
            found |= {(condition, i, k): entry.value for i, row in enumerate(plain) for k, entry in enumerate(row)}
    for name in chosen.equations:
        found |= {(name, column): entry for column, entry in enumerate(rows[name])}
    return found


def _values(analysis: Analysis, chosen: SufficientSet, attempt: int) -> Values | None:
    """All values at the point as fractions of small numbers, from one prime and confirmed by another."""
    first, second = (safe_prime(seed, analysis.tower.residues) for seed in (7_001, 7_002))
    residues = _residues(analysis, chosen, attempt, first)
    confirmation = _residues(analysis, chosen, attempt, second) if residues is not None else None
    if residues is None or confirmation is None:
        return None
    found: dict[object, Fraction] = {}
    for key, residue in residues.items():
        value = reconstruct(residue, first, _BOUND)
        if value is None or (value.numerator - confirmation[key] * value.denominator) % second:
            return None
        found[key] = value
    return found
