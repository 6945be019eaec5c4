"""Independent generators of all atoms of a system, and points at which all atoms have values.

A tower lists, innermost first, how the value of each transcendental atom follows from free
generators (`rules.py`; `relations.py` finds the rules). Roots need no rule (`primes.py`) but for the
branch: `signs` lists the quantities that must have the residue symbol that is their sign at a real
point of the domain (`branches.py` finds them).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from inverse_service.algebra.kernels import is_root
from inverse_service.algebra.point import Point, Variable, evaluate
from inverse_service.algebra.primes import is_positive, safe_prime
from inverse_service.algebra.rules import RADIAN, AngleRule, Rule, half_angle, replay
from inverse_service.algebra.series import SingularPoint
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import Apply, Expression, Number, Symbol, Velocity, children, walk

# In the search for relations an angle may be any of these fractions of a free one.
_SEARCH_SCALE = 2520
_DRAWS = 4_000
# A quantity and the sign of its residue symbol.
Requirement = tuple[Expression, int]


@dataclass(slots=True)
class Tower:
    """Rules in order, radicands that must be positive, further signs, scales of the free angles."""

    variables: tuple[Variable, ...]
    real_signs: Mapping[Variable, int] = field(default_factory=dict)
    rules: list[Rule] = field(default_factory=list)
    radicands: list[Expression] = field(default_factory=list)
    signs: list[Requirement] = field(default_factory=list)
    scales: dict[Expression, int] = field(default_factory=dict)
    default_scale: int = _SEARCH_SCALE
    residues: frozenset[int] = frozenset()

    def scale(self, angle: Expression) -> int:
        """The denominator of a free angle's generator."""
        return self.scales.get(angle, self.default_scale)

    def values_all(self, expression: Expression) -> bool:
        """Whether the rules give values to all atoms in a tree."""
        return all(self._values(node) for node in walk(expression) if isinstance(node, Apply))

    def _values(self, atom: Apply) -> bool:
        if isinstance(atom.argument, Number) and atom.function in ("exp", "log"):
            return True
        for rule in self.rules:
            if isinstance(rule, AngleRule):
                halves = [rule.angle] * rule.free + [RADIAN] * bool(rule.radians)
                if any(atom == half_angle(angle, self.scale(angle)) for angle in halves):
                    return True
                if atom.argument == rule.angle and atom.function in ("sin", "cos"):
                    return True
            elif rule.atom == atom:
                return True
        return False


def atoms_in_order(expressions: Iterable[Expression]) -> list[Expression]:
    """Transcendental atoms and roots of trees in kernels, each once, inner ones first."""
    found: dict[Expression, None] = {}
    for expression in expressions:
        _collect(expression, found)
    return list(found)


def _collect(expression: Expression, found: dict[Expression, None]) -> None:
    if expression in found:
        return
    for child in children(expression):
        _collect(child, found)
    if isinstance(expression, Apply) or is_root(expression):
        found[expression] = None


def draw_point(tower: Tower, seed: int, prime: int | None = None) -> Point:
    """A random point at which every atom has a value and every sign is as in the tower.

    The prime is chosen anew with the seed unless given. Requirements on different variables are met
    one after another. IrreducibleAtoms when no point is found.
    """
    groups = _requirement_groups(tower)
    for attempt in range(_DRAWS // 64):
        modulus = prime or safe_prime(seed * 1009 + attempt, tower.residues)
        point = _meet(tower, groups, modulus, seed * _DRAWS + attempt)
        if point is not None:
            return point
    raise IrreducibleAtoms("no point was found at which all roots exist together")


def _requirement_groups(tower: Tower) -> list[tuple[frozenset[Variable], list[Requirement]]]:
    """(variables, requirements) such that requirements of different groups share no variable."""
    groups: list[tuple[frozenset[Variable], list[Requirement]]] = []
    for requirement in [*((w, 1) for w in tower.radicands), *tower.signs]:
        names = frozenset(node for node in walk(requirement[0]) if isinstance(node, Symbol | Velocity))
        joined = [group for group in groups if group[0] & names]
        groups = [group for group in groups if not group[0] & names]
        together = [r for _, requirements in joined for r in requirements]
        groups.append((names.union(*(group[0] for group in joined)), [*together, requirement]))
    return groups


def _meet(
    tower: Tower, groups: Sequence[tuple[frozenset[Variable], list[Requirement]]], prime: int, seed: int
) -> Point | None:
    """A point with these numbers, the variables of each group drawn until its requirements hold."""
    salts: dict[Variable, int] = {}
    point = _replayed(tower, prime, seed, salts)
    for names, requirements in groups:
        for salt in range(64 << min(len(requirements), 6)):
            if salt:
                salts.update(dict.fromkeys(names, salt))
                point = _replayed(tower, prime, seed, salts)
            if point is not None and all(_holds(p, sign, point) for p, sign in requirements):
                break
            if not names:
                return None
        else:
            return None
    return point


def moved_point(tower: Tower, place: Point, moving: Sequence[Variable], number: int) -> Point:
    """A point at which all but the moving variables, and the atoms that hold these, are as at `place`.

    IrreducibleAtoms when no point is found.
    """
    for salt in range(_DRAWS // 64):
        salts = {**place.salts, **dict.fromkeys(moving, 1 + number * _DRAWS + salt)}
        point = _replayed(tower, place.prime, place.seed, salts)
        wanted = [*((w, 1) for w in tower.radicands), *tower.signs]
        if point is not None and all(_holds(p, sign, point) for p, sign in wanted):
            return point
    raise IrreducibleAtoms("no other point was found at which all roots exist together")


def _replayed(tower: Tower, prime: int, seed: int, salts: Mapping[Variable, int]) -> Point | None:
    """The point with all atoms valued, or None where one has no value."""
    point = Point(prime, seed, tower.real_signs, dict(salts))
    try:
        for rule in tower.rules:
            replay(rule, point, tower.scale)
    except (SingularPoint, ValueError, ZeroDivisionError):
        return None
    return point


def _holds(expression: Expression, sign: int, point: Point) -> bool:
    try:
        return is_positive(evaluate(expression, point), point.prime) == (sign > 0)
    except (SingularPoint, ValueError, ZeroDivisionError):
        return False
