"""Random points over one prime, drawn one after another, with what was computed at them.

The ansätze of a ladder ask for the same letters at the same points, each for some more of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from inverse_service.algebra.point import Expansion, Point, Variable, evaluate, variables_in
from inverse_service.algebra.real_point import RealTable
from inverse_service.algebra.series import SingularPoint
from inverse_service.algebra.tower import Tower, draw_point, moved_point
from inverse_service.expressions.tree import Expression, Symbol, Velocity, walk
from inverse_service.inverse_problem.search.deadline import check
from inverse_service.inverse_problem.search.letter_series import LetterValues, letter_values

# In units of the search (see `deadline`).
_WORK_OF_A_POINT, _WORK_OF_A_LETTER = 60, 10
Matrix = list[list[int]]


@dataclass(slots=True)
class _AtPoint:
    """What is known at one point; `drift` is (1, v, f), empty where f has no value."""

    point: Point
    drift: list[int]
    expansions: dict[tuple[tuple[int, ...], int], Expansion] = field(default_factory=dict)
    letters: dict[tuple[Expression, int], LetterValues | None] = field(default_factory=dict)
    tensors: tuple[Matrix, Matrix] | None = None


@dataclass(slots=True)
class SamplePoints:
    """The points of a tower that follow from a seed, on the constraints if any; `variables` are t, q, v.

    With `base` only v differs from there.
    """

    forces: Sequence[Expression]
    variables: Sequence[Symbol | Velocity]
    tower: Tower
    seed: int
    prime: int
    constrained: Mapping[Velocity, Expression] = field(default_factory=dict)
    base: Point | None = None
    places: list[_AtPoint] = field(default_factory=list)

    def point(self, k: int) -> Point:
        return self.place(k).point

    def place(self, k: int) -> _AtPoint:
        while len(self.places) <= k:
            check(_WORK_OF_A_POINT)
            point = self._drawn(len(self.places))
            self.places.append(_AtPoint(point, self._drift(point)))
        return self.places[k]

    def _drawn(self, k: int) -> Point:
        if self.base is None:
            return draw_point(self.tower, self.seed + 1 + k, self.prime)
        moving = [variable for variable in self.variables if isinstance(variable, Velocity)]
        return moved_point(self.tower, self.base, moving, k)

    def _drift(self, point: Point) -> list[int]:
        known: dict[Expression, int] = {}
        try:
            point.variables.update((v, evaluate(w, point, known)) for v, w in self.constrained.items())
            f = [evaluate(force, point, known) for force in self.forces]
        except (SingularPoint, ValueError):
            return []
        return [1, *(point.variable(v) for v in self.variables[1 + len(f) :]), *f]

    def letters(self, k: int, kernels: Sequence[Expression], order: int) -> list[LetterValues] | None:
        """The values of all letters at a point; None where one has none."""
        place = self.place(k)
        row = []
        for kernel in kernels if place.drift else ():
            key = kernel, 3 if (kernel, 3) in place.letters else order
            if key not in place.letters:
                check(_WORK_OF_A_LETTER + sum(1 for _ in walk(kernel)))
                place.letters[key] = self._letter(place, kernel, order)
            found = place.letters[key]
            if found is None:
                return None
            row.append(found)
        return row if place.drift else None

    def _letter(self, place: _AtPoint, kernel: Expression, order: int) -> LetterValues | None:
        # Only the variables of the letter are displaced: most letters have one.
        names: set[Variable] = set(variables_in(kernel))
        chosen = tuple(k for k, variable in enumerate(self.variables) if variable in names)
        key = chosen, order
        try:
            if key not in place.expansions:
                place.expansions[key] = Expansion(place.point, [self.variables[k] for k in chosen], order)
            return letter_values(place.expansions[key], chosen, kernel, place.drift)
        except (SingularPoint, ValueError):
            return None


@dataclass(frozen=True, slots=True)
class KnownTower:
    """A tower of the atoms of f and of an ansatz, on the branch of a real point, with its points by their seeds."""

    atoms: frozenset[Expression]
    real_point: RealTable
    tower: Tower
    points: dict[int, SamplePoints] = field(default_factory=dict)
