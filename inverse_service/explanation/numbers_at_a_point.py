"""The conditions of the hierarchy in numbers, at a point with rational values (`rational_points`).

Points at which variables and atoms of f have small rational values that respect all relations among them.

Coordinates, velocities, parameters and the free generators of f (tan of a half angle, the root of an
exponential, an arbitrary function and its derivatives) get small integers. Roots must come out
rational, or the next point is tried. Values are found modulo a prime and reconstructed as fractions
(Wang 1981); a second prime confirms them.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar, cast

from inverse_service import bounds
from inverse_service.deadline import now
from inverse_service.decision.analysis import Analysis
from inverse_service.decision.local_system import LocalScalar, motion_of_series
from inverse_service.errors import IrreducibleAtoms
from inverse_service.explanation.hierarchy import (
    ConditionName,
    EquationName,
    SufficientSet,
    all_singular,
    hierarchy,
    kernel,
    tensors_at,
    unknowns,
)
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import (
    PI,
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
from inverse_service.field.modular import is_positive, reconstruct, safe_prime
from inverse_service.field.point import Point, Variable, evaluate, number_value, variables_in
from inverse_service.field.rules import AngleRule, ExponentialRule, replay
from inverse_service.field.semidefinite import echelon_of
from inverse_service.field.tower import atoms_in_order
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.mechanics.conditions import Tensor11

# Small numbers first; larger ones, where roots have to come out, later.
_SMALL, _LARGER, _PATIENCE = 5, 12, 20
_PLAIN = tuple(tuple(map(Fraction, values.split())) for values in ("0 0 1 2", "0 0 1 2", "0 0 1 -1", "0 0 1 2"))
_SPEEDS = tuple(map(Fraction, ("0", "3/5", "4/5", "-3/5")))
CHOSEN = safe_prime(7_003)

Key = TypeVar("Key")


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
        if not (isinstance(key, tuple) and isinstance(key[0], Symbol | Velocity | Sum | Product)):
            return source.randint(1, 2)
        fractions = isinstance(key[0], Velocity) and self.seed % 4 == 3
        return number_value(source.choice(_SPEEDS if fractions else _PLAIN[self.seed % 4]), self.prime)


def has_points(analysis: Analysis) -> bool:
    """Whether values can be put for all atoms: not where numbers such as pi, sin(1) or exp(2) occur."""
    radians = any(isinstance(rule, AngleRule) and rule.radians for rule in analysis.tower.rules)
    bare = bare_variables(analysis.accelerations)
    numbers = any(isinstance(atom, Apply) and not variables_in(atom) for atom in atoms_in_order(analysis.accelerations))
    return not radians and PI not in bare and not numbers


def is_real(analysis: Analysis) -> bool:
    """Whether the values drawn for variables and free generators are those of one real point.

    They are where each free generator is the exponential, sine or cosine of a rational combination of
    variables that occur nowhere else, and these combinations are independent: they can then be chosen to fit.
    Else they are values that the same algebraic relations allow.
    """
    bare = bare_variables(analysis.accelerations)
    arguments: list[Mapping[Variable, Fraction]] = []
    for rule in analysis.tower.rules:
        if isinstance(rule, ExponentialRule) and rule.constant:
            return False  # e has a value of its own
        if not rule.free:
            continue
        found = _combination(rule.angle if isinstance(rule, AngleRule) else rule.atom.argument)
        if found is None or not isinstance(rule, AngleRule | ExponentialRule) or bare & set(found):
            return False
        arguments.append(found)
    names = sorted({name for found in arguments for name in found}, key=repr)
    rows = [[found.get(name, Fraction(0)) for name in names] for found in arguments]
    return not names or len(echelon_of(rows, len(names))) == len(arguments)


def _combination(expression: Expression) -> dict[Variable, Fraction] | None:
    """The coefficients of a rational combination of variables; None for another expression."""
    match expression:
        case Symbol() | Velocity():
            return {expression: Fraction(1)}
        case Product((Number(value), Symbol() | Velocity() as name)):
            return {name: value}
        case Sum(terms):
            total: dict[Variable, Fraction] = {}
            for part in map(_combination, terms):
                if part is None:
                    return None
                for name, value in part.items():
                    total[name] = total.get(name, Fraction(0)) + value
            return total
    return None


def bare_variables(expressions: Iterable[Expression]) -> set[Variable]:
    """Variables that occur outside transcendental atoms."""
    found: set[Variable] = set()
    for each in expressions:
        if isinstance(each, Symbol | Velocity):
            found.add(each)
        elif not isinstance(each, Apply):
            found |= bare_variables(children(each))
    return found


def atoms_and_jets(analysis: Analysis, further: int) -> list[Expression]:
    """Transcendental atoms and roots in f, and arbitrary functions with `further` derivatives more than in f."""
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
    return [*_with_partners(atoms_in_order(analysis.accelerations)), *derivatives]


def _with_partners(atoms: Iterable[Expression]) -> Iterator[Expression]:
    """The atoms, with the sine of an angle its cosine too, which derivatives of f contain."""
    seen: set[Expression] = set()
    for atom in atoms:
        both: list[Expression] = [atom]
        if isinstance(atom, Apply) and atom.function in ("sin", "cos"):
            both = [Apply(name, atom.argument) for name in ("sin", "cos")]
        yield from (each for each in both if each not in seen)
        seen.update(both)


def placed(analysis: Analysis, point: Point) -> bool:
    """Give the atoms their values at the point; whether the point is one of the domain of f."""
    requirements = [*((radicand, 1) for radicand in analysis.tower.radicands), *analysis.tower.signs]
    try:
        for rule in analysis.tower.rules:
            replay(rule, point, analysis.tower.scale)
        signs = [(is_positive(evaluate(tree, point), point.prime), sign) for tree, sign in requirements]
    except (SingularPoint, ValueError, ZeroDivisionError, IrreducibleAtoms):
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
    prime = safe_prime(7_001, analysis.tower.residues)
    found: dict[Key, Fraction] = {}
    for key, residue in (residues(prime) or {}).items():
        value = reconstruct(residue, prime, bounds.NUMBER)
        if value is None:
            return None
        found[key] = value
    return found or None


def are_confirmed(
    analysis: Analysis, residues: Callable[[int], Mapping[Key, int] | None], found: Mapping[Key, Fraction]
) -> bool:
    """Whether a second prime gives the same fractions."""
    prime = safe_prime(7_002, analysis.tower.residues)
    values = residues(prime)
    return values is not None and not any(
        (fraction.numerator - values.get(key, 0) * fraction.denominator) % prime for key, fraction in found.items()
    )


def residues_at(
    analysis: Analysis, point: Point, atoms: Sequence[Expression], further: Callable[[Point], Mapping[Any, int]]
) -> dict[Any, int] | None:
    """Values of variables, atoms and what is `further` there; None where the point is singular."""
    if not placed(analysis, point):
        return None
    try:
        found: dict[Any, int] = {atom: evaluate(atom, point) for atom in atoms}
        return {**found, **further(point), **point.variables}
    except (SingularPoint, ValueError, ZeroDivisionError, IrreducibleAtoms):
        return None


Values = Mapping[object, Fraction]


@dataclass(frozen=True, slots=True)
class NumbersAtAPoint:
    """Values of variables and atoms, of the tensors (n, n) and of the equations over `unknowns`.

    `real` says whether a real point has these values; else they only respect the algebraic relations.
    """

    variables: Mapping[Variable, Fraction]
    atoms: Mapping[Expression, Fraction]
    tensors: Mapping[ConditionName, tuple[tuple[Fraction, ...], ...]]
    rows: Mapping[EquationName, tuple[Fraction, ...]]
    real: bool = True


def numbers_at_a_point(
    analysis: Analysis, chosen: SufficientSet, deadline: float = float("inf")
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
        rows = {name: tuple(values[name, k] for k in range(len(unknowns(size)))) for name in chosen.equations}
        if leave_singular_only(rows.values(), size):
            return _collected(analysis, chosen, values, rows)
    return None


def matrices_left(rows: Iterable[Sequence[Fraction]], size: int) -> list[tuple[int, ...]]:
    """A basis of the symmetric matrices that satisfy the rows, modulo a prime."""
    residues = [tuple(number_value(entry, CHOSEN) for entry in row) for row in rows]
    return kernel(residues, len(unknowns(size)), CHOSEN)


def leave_singular_only(rows: Iterable[Sequence[Fraction]], size: int) -> bool:
    """Whether every symmetric matrix that satisfies the rows is singular."""
    return all_singular(matrices_left(rows, size), size, CHOSEN)


def whole_multiple(row: Mapping[Key, Fraction]) -> dict[Key, Fraction]:
    """The row times a number, its entries whole without a common divisor."""
    scale = math.lcm(*(value.denominator for value in row.values()))
    divisor = math.gcd(*(int(value * scale) for value in row.values())) or 1
    return {key: value * scale / divisor for key, value in row.items()}


def _collected(
    analysis: Analysis, chosen: SufficientSet, values: Values, rows: Mapping[EquationName, tuple[Fraction, ...]]
) -> NumbersAtAPoint:
    """The values by what they are values of."""
    size = range(len(analysis.system.coordinates))
    bare = bare_variables(analysis.accelerations)
    variables = {key: value for key, value in values.items() if isinstance(key, Symbol | Velocity) and key in bare}
    atoms = {atom: values[atom] for atom in _atoms(analysis, chosen)}
    tensors = {
        condition: tuple(tuple(values[condition, i, k] for k in size) for i in size)
        for condition in chosen.conditions
        if not condition.cyclic
    }
    return NumbersAtAPoint(variables, atoms, tensors, rows, is_real(analysis))


def _residues(analysis: Analysis, chosen: SufficientSet, attempt: int, prime: int) -> dict[object, int] | None:
    """Everything at the point number `attempt`, modulo the prime; None where it is singular."""
    kind = PlainPoint if attempt % 2 else SmallPoint
    point = kind(prime, attempt // 2, dict(analysis.tower.real_signs))
    return residues_at(analysis, point, _atoms(analysis, chosen), lambda there: _conditions(analysis, chosen, there))


def _atoms(analysis: Analysis, chosen: SufficientSet) -> list[Expression]:
    return atoms_and_jets(analysis, max(condition.order for condition in chosen.conditions) - 1)


def _conditions(analysis: Analysis, chosen: SufficientSet, point: Point) -> dict[object, int]:
    """The tensors' components and the rows of the equations at the point."""
    depth = max(condition.order for condition in chosen.conditions) - 2
    local = motion_of_series(*analysis.series(point, analysis.system.depends_on_time, depth + 2))
    tensors, rows = hierarchy(local, depth), tensors_at(local, depth).rows
    found: dict[object, int] = {}
    for condition in chosen.conditions:
        if not condition.cyclic:
            plain = cast("Tensor11[LocalScalar]", tensors[condition])
            found |= {(condition, i, k): entry.value for i, row in enumerate(plain) for k, entry in enumerate(row)}
    for name in chosen.equations:
        found |= {(name, column): entry for column, entry in enumerate(rows[name])}
    return found
