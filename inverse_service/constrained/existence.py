"""Decide whether any Lagrangian has a given motion on constraints (the question of
`kinds.constrained`).

`certificate_of_lagrangian` and `of_finding` write certificates as in certificate/FORMAT.md; nothing
is judged here.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from flint import nmod_mat

from inverse_service.deadline import now
from inverse_service.decision import constrained
from inverse_service.decision.certify import head_of, inequality_texts, involution_data, near_of
from inverse_service.errors import IrreducibleAtoms
from inverse_service.expressions.calculus import NoRealValue, differentiate
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, substitute
from inverse_service.field import dense_series, tower as towers
from inverse_service.field.exact_field import TooLarge
from inverse_service.field.modular import Point, SingularPoint, Variable
from inverse_service.field.real_branch import (
    RealTable,
    find_real_point,
    is_defined,
    reduce_atoms,
    requirements,
)
from inverse_service.field.sign_cases import signed_factors
from inverse_service.linear_pde import equations, involution
from inverse_service.mechanics.second_order_system import ConstrainedMotion
from inverse_service.statements import reasons
from inverse_service.statements.questions import Question
from inverse_service.statements.stages import Progress, Stage

Integers = npt.NDArray[np.int64]
_HIGHEST_ORDER, _MOST_UNKNOWNS = 16, 120_000
_AT_ONCE = 5  # the order up to which a solution is found order by order
_FIRST_BRACKETS = 8  # brackets along a solution are first tried up to this j

_SEED = 3


@dataclass(frozen=True, slots=True)
class AnalyzedMotion:
    """w and F in kernels with the tower of their atoms, and a real point of D."""

    motion: ConstrainedMotion
    velocities: tuple[Expression, ...]
    forces: tuple[Expression, ...]
    tower: towers.Tower
    real_point: RealTable | None
    # Translated formulas, by degree.
    known: dict[int, AlongSolutions] = field(default_factory=dict, repr=False, compare=False)

    def along(self, degree: int) -> AlongSolutions:
        """V_alpha along solutions to this degree."""
        if degree not in self.known:
            self.known[degree] = AlongSolutions(self, degree)
        return self.known[degree]

    @property
    def names(self) -> tuple[str, ...]:
        """The coordinates, the free ones first."""
        return (*self.motion.free, *self.motion.dependent)

    @property
    def accelerations(self) -> tuple[Expression, ...]:
        """Everything that the motion is given by, velocities included."""
        return (*self.velocities, *self.forces)


def analyze_motion(
    motion: ConstrainedMotion, positive: Sequence[Expression] = ()
) -> AnalyzedMotion:
    """The motion where all of `positive` are > 0; IrreducibleAtoms if relations of atoms cannot be
    determined.
    """
    velocities, forces = (
        tuple(map(towers.to_kernels, motion.dependent_velocities)),
        tuple(map(towers.to_kernels, motion.free_accelerations)),
    )
    variables = variables_of(motion)
    table = find_real_point([*velocities, *forces], variables, 1, positive)
    return AnalyzedMotion(
        motion, velocities, forces, reduce_atoms([*velocities, *forces], variables, table), table
    )


def variables_of(motion: ConstrainedMotion) -> list[Variable]:
    """t, the coordinates, the free velocities, and the parameters."""
    coordinates, velocities = map(Symbol, motion.coordinates), map(Velocity, motion.free)
    return [TIME, *coordinates, *velocities, *map(Symbol, motion.parameters)]


class ConstrainedAt:
    """The equations for one motion, at random points or the points that `draw` returns."""

    __slots__ = ("_first", "_series", "_shape", "matrix", "others", "unknowns")

    def __init__(
        self,
        analyzed: AnalyzedMotion,
        question: Question,
        draw: Callable[[int], Point] | None = None,
    ) -> None:
        motion = analyzed.motion
        self._shape = shape = constrained.Shape(
            len(motion.free), len(motion.dependent), int(question.timed)
        )
        self.unknowns: equations.Unknowns = constrained.unknowns_of(shape)
        self.matrix: involution.Matrix = constrained.rank_matrix(shape)
        self.others: tuple[involution.Matrix, ...] = (constrained.regular_on_constraints(shape),)
        free: list[Expression] = [Velocity(name) for name in motion.free]
        variables: list[Variable] = [
            *[TIME] * question.timed,
            *map(Symbol, analyzed.names),
            *map(Velocity, motion.free),
        ]
        field = [*free, *analyzed.velocities, *analyzed.forces]
        self._first = 0

        def write(order: int) -> tuple[dense_series.SeriesProgram, Integers]:
            series = constrained.series_program(shape, variables, field, order)
            self._first = constrained.write_brackets(shape, series)
            return series, series.listed

        self._series = involution.Coefficients(
            write,
            draw or (lambda seed: towers.draw_point(analyzed.tower, seed)),
            lambda order: constrained.degree_for(shape, order),
        )

    def at(self, seed: int, order: int) -> equations.LocalEquations:
        """The local equations; TooLarge if the series would take too many words."""
        prime, registers = self._series.at(seed, order)
        own = constrained.compiled_equations(self._shape, prime, order, registers)
        given = (registers, self._first, self._shape.slope(0, 0))
        return replace(
            own,
            equations=(
                *constrained.equations(self._shape, self.unknowns, order, *given),
                *own.equations,
            ),
        )


def decide_motion(
    analyzed: AnalyzedMotion,
    question: Question,
    seed: int,
    deadline: float,
    progress: Progress,
    draw: Callable[[int], Point] | None = None,
) -> involution.Finding:
    """Decide whether a regular L(q, v), or L(t, q, v), has the motion on the constraints; two
    points must agree: random ones, or those that `draw` returns for a seed.
    """
    limits = involution.Limits(_HIGHEST_ORDER, deadline, _MOST_UNKNOWNS)
    try:
        refused = refused_along_a_solution(analyzed, question, seed, deadline, progress, draw)
        if refused is not None:
            return refused
        return involution.settle(ConstrainedAt(analyzed, question, draw), seed, limits, progress)
    except IrreducibleAtoms as problem:
        return involution.Finding(None, 0, reasons.irreducible(problem.detail))


def refused_along_a_solution(
    analyzed: AnalyzedMotion,
    question: Question,
    seed: int,
    deadline: float,
    progress: Progress,
    draw: Callable[[int], Point] | None = None,
) -> involution.Finding | None:
    """A no from the brackets along one solution, by power series in t only; None if a yes remains
    possible.

    The 2-form Omega of the bivectors is invariant under Gamma and vanishes on d/du^alpha ^
    d/du^beta. With Phi(t) the derivative of the flow and V_alpha(t) = Phi(t)^-1 d/du^alpha, so
    Omega(V_alpha(t), V_beta(t)) = 0 at the start, for all t: each coefficient is a linear equation
    for the values of Omega there. It is a no if every solution of those up to t^j has a vertical
    vector in its kernel, whether L may depend on t or not. Rows are named as those of `bivectors`.
    """
    free, size = len(analyzed.motion.free), len(analyzed.names) + len(analyzed.motion.free)
    if free < 2:
        return None
    progress(Stage("brackets along one solution"))
    seeds = (2 * seed, 2 * seed + 1)
    try:
        drawn_at = draw or (lambda drawn: towers.draw_point(analyzed.tower, drawn))
        points = list(map(drawn_at, seeds))
        lasts = {last_bracket(analyzed, point, deadline) for point in points}
    except (SingularPoint, TooLarge):
        return None
    last = lasts.pop()
    if lasts or last is None:
        return None
    pairs = itertools.product(range(last + 1), itertools.combinations(range(free), 2))
    rows = tuple(
        (f"B{j}_{alpha}", beta, (0,) * (size + question.timed)) for j, (alpha, beta) in pairs
    )
    used = tuple(
        {"prime": point.prime, "seed": drawn} for point, drawn in zip(points, seeds, strict=True)
    )
    return involution.Finding(False, 0, rows=rows, points=used, along=last)


class AlongSolutions:
    """V_alpha along solutions of a motion to a degree, with its formulas translated once.

    Psi = Phi^-1 solves Psi' = -Psi A with A = d Gamma/dx.
    """

    __slots__ = ("_degree", "_free", "_rates", "_slopes", "_start")

    def __init__(self, analyzed: AnalyzedMotion, degree: int) -> None:
        free = list(map(Velocity, analyzed.motion.free))
        own: list[Symbol | Velocity] = [*map(Symbol, analyzed.names), *free]
        rates = [*free, *analyzed.velocities, *analyzed.forces]
        self._degree, self._free, self._start = degree, len(free), own
        self._rates = _Coefficients(own, rates, degree)
        slopes = [differentiate(rate, x) for rate in rates for x in own]
        self._slopes = _Coefficients(own, slopes, degree)

    def at(self, point: Point) -> list[list[list[int]]]:
        """The coefficients of t^0, …, t^degree of each V_alpha on the solution from the point."""
        slopes, size, prime = self._slopes_at(point), len(self._start), point.prime
        one = nmod_mat(size, size, [int(x == y) for x in range(size) for y in range(size)], prime)
        inverse = [one]
        for k in range(self._degree):
            total = inverse[0] * slopes[k]
            for i in range(1, k + 1):
                total += inverse[i] * slopes[k - i]
            inverse.append(total * (-pow(k + 1, -1, prime) % prime))
        return [
            [[int(part[x, u]) for x in range(size)] for part in inverse]
            for u in range(size - self._free, size)
        ]

    def _slopes_at(self, point: Point) -> list[nmod_mat]:
        """The coefficients of d Gamma/dx along the solution x.

        Known to t^near, x goes on with the rest d by a step of Newton's, d' = Gamma(x) - x' + (d
        Gamma/dx) d, to t^(2 near + 2).
        """
        solution, prime = [[point.variable(name)] for name in self._start], point.prime
        rates, slopes, size = self._rates.begin(point), self._slopes.begin(point), len(solution)
        near = (self._degree - 1) // 2 if self._degree > _AT_ONCE else self._degree
        for k in range(near):
            for known, series in zip(solution, rates(solution, k), strict=True):
                known.append(series[k] * pow(k + 1, -1, prime) % prime)

        def matrices(to: int) -> list[nmod_mat]:
            entries = slopes(solution, to)
            return [
                nmod_mat(size, size, [entry[k] for entry in entries], prime) for k in range(to + 1)
            ]

        if near < self._degree:
            raised = [known + [0] * (self._degree - near - 1) for known in solution]
            field, bends = rates(raised, self._degree - 1), matrices(near)
            rest = [nmod_mat(size, 1, prime)] * (near + 1)
            for k in range(near, self._degree):
                total = nmod_mat(size, 1, [series[k] for series in field], prime)
                for before, bend in zip(reversed(rest), bends, strict=False):
                    total += bend * before
                rest.append(total * pow(k + 1, -1, prime))
            for z, known in enumerate(solution):
                known += [int(one[z, 0]) for one in rest[near + 1 :]]
        return matrices(max(self._degree - 1, 0))


class _Coefficients:
    """The coefficients in t of some trees along a solution, to a degree."""

    __slots__ = ("_places", "_series")

    def __init__(self, own: Sequence[Variable], trees: Sequence[Expression], degree: int) -> None:
        self._series = dense_series.SeriesProgram((TIME,), degree)
        self._series.known.update({name: self._series.register() for name in own})
        self._places = [self._series.expand(tree) for tree in trees]

    def begin(self, point: Point) -> Callable[[Sequence[Sequence[int]], int], list[list[int]]]:
        """At a point: the coefficients for a solution, to a degree."""
        listed, constants = self._series.listed, dense_series.constants_at(self._series, point)

        def found(solution: Sequence[Sequence[int]], degree: int) -> list[list[int]]:
            series = dense_series.run(
                self._series, listed, constants, point.prime, degree, solution
            )
            return [series.numbers(place) for place in self._places]

        return found


def last_bracket(analyzed: AnalyzedMotion, point: Point, deadline: float) -> int | None:
    """The j up to which the equations are needed for a no; None if later ones follow from earlier
    ones first.
    """
    size, free = len(analyzed.names) + len(analyzed.motion.free), len(analyzed.motion.free)
    rows, rank, done, degree = list[list[int]](), 0, -1, _FIRST_BRACKETS
    while now() < deadline and done < math.comb(size, 2):
        vectors = analyzed.along(degree).at(point)
        for j in range(done + 1, degree + 1):
            for alpha, beta in itertools.combinations(range(free), 2):
                rows.append(_bracket(vectors[alpha], vectors[beta], j, point.prime))
            before, matrix = rank, nmod_mat(rows, point.prime)
            rank = matrix.rank()
            if leaves_a_vertical_kernel(matrix, size, free):
                return j
            if rank == before:
                return None
        done, degree = degree, 2 * degree
    return None


def _bracket(
    left: Sequence[Sequence[int]], right: Sequence[Sequence[int]], j: int, prime: int
) -> list[int]:
    """The coefficient of t^j of V ^ V', by pairs of coordinates."""
    pairs = [(left[i], right[j - i]) for i in range(j + 1)]
    places = itertools.combinations(range(len(left[0])), 2)
    return [sum(a[x] * b[y] - a[y] * b[x] for a, b in pairs) % prime for x, y in places]


def leaves_a_vertical_kernel(matrix: nmod_mat, size: int, free: int) -> bool:
    """Whether a random 2-form that satisfies the rows has a vertical vector in its kernel."""
    prime, (basis, nullity) = matrix.modulus(), matrix.nullspace()
    generator = random.Random(prime)
    weights = [generator.randrange(prime) for _ in range(nullity)]
    places = enumerate(itertools.combinations(range(size), 2))
    form = {
        pair: sum(int(basis[k, i]) * w for i, w in enumerate(weights)) % prime for k, pair in places
    }
    vertical = range(size - free, size)
    entries = [
        [(form.get((x, u), 0) - form.get((u, x), 0)) % prime for x in range(size)] for u in vertical
    ]
    rank: int = nmod_mat(entries, prime).rank()
    return rank < free


def certificate_of_lagrangian(
    analyzed: AnalyzedMotion, lagrangian: Expression, question: Question
) -> dict[str, Any]:
    """The certificate whose proof is L itself, near a point at which it is defined."""
    on = substitute(
        towers.to_kernels(lagrangian),
        dict(zip(map(Velocity, analyzed.motion.dependent), analyzed.velocities, strict=True)),
    )
    table = analyzed.real_point
    if table is not None and not is_defined([on], table):
        formulas = [*analyzed.velocities, *analyzed.forces, on]
        table = find_real_point(formulas, variables_of(analyzed.motion), _SEED) or table
    head = _head(replace(analyzed, real_point=table), question, "variational", "lagrangian")
    return head | {"lagrangian": to_text(lagrangian)}


def of_finding(
    analyzed: AnalyzedMotion, found: involution.Finding, question: Question
) -> dict[str, Any]:
    """The certificate with the rows used for a no, or the involution data of a yes."""
    if found.exists is None:
        raise ValueError("only what was settled has a certificate")
    if found.symbol is None:
        head = _head(analyzed, question, "not_variational", "nonexistence")
        if found.along is not None:
            return head | {"along": found.along}
        rows = [[*row[:-1], list(row[-1])] for row in found.rows if isinstance(row[-1], tuple)]
        return head | _bivectors(analyzed, question) | {"order": found.order, "rows": rows}
    head = _head(analyzed, question, "variational", "existence")
    return head | _bivectors(analyzed, question) | involution_data(found, found.symbol)


def _bivectors(analyzed: AnalyzedMotion, question: Question) -> dict[str, int]:
    last = constrained.last_of(
        constrained.Shape(
            len(analyzed.motion.free), len(analyzed.motion.dependent), int(question.timed)
        )
    )
    return {"bivectors": last} if last else {}


def _head(analyzed: AnalyzedMotion, question: Question, claim: str, kind: str) -> dict[str, Any]:
    motion = analyzed.motion
    symbols = map(Symbol, (*analyzed.names, "t", *motion.parameters))
    near = near_of(analyzed.real_point, [*symbols, *map(Velocity, motion.free)])
    return head_of(_system(analyzed), question, claim, kind, near, _squares(motion))


def _squares(motion: ConstrainedMotion) -> list[Expression]:
    """Positive where the document determines the motion."""
    return [tree**2 for tree in motion.nonzero]


def on_one_side(
    analyzed: AnalyzedMotion, certificate: dict[str, Any], more: Sequence[Expression] = ()
) -> dict[str, Any]:
    """The certificate with the signs of all radicands at its point, for claims that depend on
    them.
    """
    motion, table = analyzed.motion, analyzed.real_point
    if table is None:
        return certificate
    placed = (substitute(tree, motion.on_constraints) for tree in more)
    formulas = [*motion.dependent_velocities, *motion.free_accelerations, *placed]
    with suppress(IrreducibleAtoms, NoRealValue):
        signs = signed_factors(requirements(formulas, table), table)
        return certificate | {"conditions": inequality_texts([*_squares(motion), *signs])}
    return certificate


def _system(analyzed: AnalyzedMotion) -> dict[str, Any]:
    """The system as for second-order systems, plus the velocities of the dependent coordinates."""
    motion = analyzed.motion
    return {
        "coordinates": list(analyzed.names),
        "equations": {
            name: to_text(f) for name, f in zip(motion.free, motion.free_accelerations, strict=True)
        },
        "velocities": {
            name: to_text(w)
            for name, w in zip(motion.dependent, motion.dependent_velocities, strict=True)
        },
        "parameters": list(motion.parameters),
        "functions": {name: list(arguments) for name, arguments in motion.functions},
    }
