"""Independent generators of all atoms of a system, and points at which all atoms have values.

A tower lists, innermost first, how the value of each transcendental atom follows from free
generators (`rules.py`; `relations.py` finds them). Roots need no rule (`modular.py`) but for the
branch: `signs` lists the quantities that must have the residue symbol that is their sign at a real
point of the domain (`reduction.py` finds them).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache

from flint import nmod_mat

from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.tree import (
    Apply,
    Expression,
    Number,
    children,
    walk,
)
from inverse_service.field.elementary import is_root
from inverse_service.field.modular import is_positive, reconstruct, safe_prime
from inverse_service.field.point import (
    Expansion,
    Point,
    Variable,
    evaluate,
    variables_in,
)
from inverse_service.field.rules import (
    RADIAN,
    AngleRule,
    Rule,
    half_angle,
    replay,
)
from inverse_service.field.truncated_series import SingularPoint, gradient

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
    parts_of_pi: int = 1

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


def draw_point(tower: Tower, seed: int, prime: int | None = None, flipped: frozenset[int] = frozenset()) -> Point:
    """A random point at which every atom has a value and every sign is as in the tower.

    The prime is chosen again with each seed unless given. IrreducibleAtoms when no point is found.
    """
    stages = _stages(tower, tower.variables)
    for attempt in range(_DRAWS // 64):
        modulus = prime or safe_prime(seed * 1009 + attempt, tower.residues, 2 * tower.parts_of_pi)
        point = _meet(tower, stages, modulus, seed * _DRAWS + attempt, {}, 0, flipped)
        if point is not None:
            return point
    raise IrreducibleAtoms("no point was found at which all roots exist together")


@dataclass(frozen=True, slots=True)
class _Stage:
    """Variables that are drawn together until some requirements hold, which need no others but earlier ones.

    The rules are not needed to see whether those `without_atoms` hold.
    """

    names: frozenset[Variable]
    without_atoms: tuple[Requirement, ...]
    with_atoms: tuple[Requirement, ...]

    @property
    def draws(self) -> range:
        """A requirement holds at every other draw; without variables there is one."""
        return range(16 << min(len(self.without_atoms) + len(self.with_atoms), 8)) if self.names else range(1)


def _stages(tower: Tower, moving: Iterable[Variable]) -> list[_Stage]:
    """The requirements in an order in which each adds few of the moving variables to those before.

    k requirements of one variable each cost 2 k draws and not 2^k, and so do 1 - u^2, 1 - u^2 - v^2.
    """
    free = frozenset(moving)
    wanted = [*((w, 1) for w in tower.radicands), *tower.signs]
    open_ones = [(free.intersection(variables_in(requirement[0])), requirement) for requirement in wanted]
    drawn: frozenset[Variable] = frozenset()
    stages = []
    while open_ones:
        added = min((names - drawn for names, _ in open_ones), key=len)
        drawn |= added
        met = [requirement for names, requirement in open_ones if names <= drawn]
        parts = (tuple(one for one in met if _has_no_atoms(one[0]) is without) for without in (True, False))
        stages.append(_Stage(added, *parts))
        open_ones = [one for one in open_ones if not one[0] <= drawn]
    return stages


def _meet(
    tower: Tower,
    stages: Sequence[_Stage],
    prime: int,
    seed: int,
    given: Mapping[Variable, int],
    first: int,
    flipped: frozenset[int] = frozenset(),
) -> Point | None:
    """A point with these numbers, the variables of each stage drawn, from one salt on, until its requirements hold."""
    salts, open_names = dict(given), frozenset().union(*(stage.names for stage in stages))
    point, missing = Point(prime, seed, tower.real_signs, dict(salts), flipped), None
    for stage in stages:
        open_names -= stage.names
        for salt in stage.draws:
            if salt:
                salts.update(dict.fromkeys(stage.names, first + salt))
                point, missing = Point(prime, seed, tower.real_signs, dict(salts), flipped), None
            known: dict[Expression, int] = {}
            if not _hold(stage.without_atoms, point, known):
                continue
            missing = _replayed(tower, point) if missing is None else missing
            valued = not any(open_names.isdisjoint(names) for names in missing)
            if valued and _hold(stage.with_atoms, point, known):
                break
        else:
            return None
    missing = _replayed(tower, point) if missing is None else missing
    return None if missing else point


def moved_point(tower: Tower, place: Point, moving: Sequence[Variable], number: int) -> Point:
    """A point at which all but the moving variables, and the atoms that hold these, are as at `place`.

    IrreducibleAtoms when no point is found.
    """
    stages = _stages(tower, moving)
    for attempt in range(_DRAWS // 64):
        first = 1 + (number * _DRAWS + attempt) * _DRAWS
        salts = {**place.salts, **dict.fromkeys(moving, first)}
        point = _meet(tower, stages, place.prime, place.seed, salts, first)
        if point is not None:
            return point
    raise IrreducibleAtoms("no other point was found at which all roots exist together")


def _replayed(tower: Tower, point: Point) -> list[tuple[Variable, ...]]:
    """Give values to the atoms that have one at the point; the variables of each rule that gives none."""
    missing = []
    for rule in tower.rules:
        try:
            replay(rule, point, tower.scale)
        except (SingularPoint, ValueError, ZeroDivisionError, KeyError):
            missing.append(variables_in(rule.angle if isinstance(rule, AngleRule) else rule.atom))
    return missing


@lru_cache(maxsize=1024)
def _has_no_atoms(expression: Expression) -> bool:
    return not any(isinstance(node, Apply) for node in walk(expression))


def _hold(requirements: Iterable[Requirement], point: Point, known: dict[Expression, int]) -> bool:
    try:
        return all(is_positive(evaluate(p, point, known), point.prime) == (sign > 0) for p, sign in requirements)
    except (SingularPoint, ValueError, ZeroDivisionError, KeyError):
        return False


# A residue of 61 bits is a fraction below the bound by chance with probability 10^-6.
_COEFFICIENT_BOUND = 10**6


class IrrationalRatio(IrreducibleAtoms):
    """Some arguments have constant ratios modulo the prime."""


@dataclass(slots=True)
class Samples:
    """Points of one prime at which all rules of a tower hold, used to find linear relations.

    `pending` are signs of quantities some of whose atoms have no rule yet. Points have by turns conjugates of the
    square roots of the primes in `flips`: a relation with rational coefficients holds for all conjugates.
    """

    tower: Tower
    points: list[Point] = field(default_factory=list)
    pending: list[Requirement] = field(default_factory=list)
    flips: tuple[int, ...] = ()
    expansions: dict[int, Expansion] = field(default_factory=dict)  # by the id of their point, which they keep

    def values(self, expression: Expression) -> list[int]:
        return [evaluate(expression, point) for point in self.points]

    def gradients(self, expression: Expression) -> list[list[int]]:
        """Per point the partial derivatives with respect to all variables and parameters."""
        return [gradient(self._expansion(point).expand(expression)) for point in self.points]

    def _expansion(self, point: Point) -> Expansion:
        """What is expanded at the point already: each relation asks for all that came before."""
        if id(point) not in self.expansions:
            self.expansions[id(point)] = Expansion(point, self.tower.variables, 1)
        return self.expansions[id(point)]

    @property
    def prime(self) -> int:
        return self.points[0].prime

    def solve(self, columns: Sequence[Sequence[int]], target: Sequence[int]) -> list[Fraction] | None:
        """Rational a with sum a_j columns_j = target, or None; refuses what is not unique."""
        if not columns:
            return None if any(target) else []
        rows = [[*entries, b] for entries, b in zip(zip(*columns, strict=True), target, strict=True)]
        reduced, rank = nmod_mat(len(rows), len(rows[0]), [x for row in rows for x in row], self.prime).rref()
        pivots = [next(k for k in range(len(rows[0])) if int(reduced[i, k])) for i in range(rank)]
        if len(columns) in pivots:
            return None
        if rank < len(columns):
            raise IrrationalRatio("arguments of exponentials, logarithms or angles have irrational ratios")
        solution = [reconstruct(int(reduced[i, len(columns)]), self.prime, _COEFFICIENT_BOUND) for i in range(rank)]
        return None if any(a is None for a in solution) else [a for a in solution if a is not None]

    def ensure(self, columns: int) -> None:
        """Enough points for a linear system of so many unknowns, with all rules so far replayed."""
        prime = self.points[0].prime if self.points else draw_point(self.tower, 7).prime
        while len(self.points) < columns + 6:
            count = len(self.points)
            flipped = frozenset(ell for k, ell in enumerate(self.flips) if (count >> k) % 2)
            self.points.append(draw_point(self.tower, 1000 + count, prime, flipped))

    def admit_pending(self) -> None:
        """From now on the signs hold of those pending quantities that have a value by now."""
        ready = [requirement for requirement in self.pending if self.tower.values_all(requirement[0])]
        if ready:
            self.pending = [requirement for requirement in self.pending if requirement not in ready]
            self.tower.signs += [requirement for requirement in ready if requirement not in self.tower.signs]
            self.points.clear()

    def require_positive(self, radicand: Expression) -> None:
        """From now on only points at which the radicand has a root."""
        if radicand not in self.tower.radicands:
            self.tower.radicands.append(radicand)
            self.points[:] = [p for p in self.points if is_positive(evaluate(radicand, p), p.prime)]
