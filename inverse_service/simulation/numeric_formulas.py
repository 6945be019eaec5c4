"""A problem in the names that kernels use: q0, v0, p0, c0, ... and the callables that the methods
take.

A wall is a formula whose zeros are poles, ends or kinks of another: u of 1/u, log(u), sqrt(u), and
u of sqrt(u^2); cos(u) of tan(u). Along a motion it keeps its sign, or the motion has left the
domain that it began in.

`array_value` is the value of a formula along a trajectory: one numpy operation for each node of the
tree.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from inverse_service import errors
from inverse_service.expressions import collecting, functions, printing, tree as ex
from inverse_service.integrators.trajectory import Array
from inverse_service.integrators.variational import Gradient, Vector
from inverse_service.kernels.codegen import symengine_trees as se
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation.scene_data import Problem

MOST_TERMS = 200
_MOST_EXPANDED = 4  # coordinates whose determinant is written out
# t in a kernel: the time at the start of the step, a state variable of systems that depend on it.
MOMENT = se.symbol("t")


def walls(tree: ex.Expression, names: Collection[str]) -> Iterator[ex.Expression]:
    """The walls of the tree that hold a velocity or one of the names, among them t where its poles
    count too.
    """
    moving = {*map(ex.Symbol, names)}
    for found in dict.fromkeys(
        wall for node in ex.distinct_nodes([tree]) for wall in _walls_of(node)
    ):
        if any(isinstance(leaf, ex.Velocity) or leaf in moving for leaf in ex.walk(found)):
            yield from _without_squares(found)


@lru_cache(maxsize=256)
def _without_squares(wall: ex.Expression) -> tuple[ex.Expression, ...]:
    """The factors of a sum that is no product of different ones: the sign of x^2 - 2 x + 1 shows no
    zero.
    """
    names = [
        node for node in dict.fromkeys(ex.walk(wall)) if isinstance(node, ex.Symbol | ex.Velocity)
    ]
    tree = wall
    if isinstance(wall, ex.Sum):
        from inverse_service.field import exact_field  # takes longer to load than a run

        with suppress(exact_field.TooLarge, ZeroDivisionError, KeyError):
            (tree,) = exact_field.factored([wall], names, exact_field.Budget(MOST_TERMS))
    parts = ex.factors_of(tree)
    squared = any(isinstance(part, ex.Power) and isinstance(part.base, ex.Sum) for part in parts)
    return tuple(_factors(tree)) if squared else (wall,)


def switching_functions(
    trees: Sequence[ex.Expression | None], coordinates: Sequence[str]
) -> tuple[ex.Expression, ...]:
    """The u of every sqrt(u^2) that changes along a motion, those that others contain first."""
    moving, found = [ex.TIME, *state_names(coordinates)], []
    for node in ex.distinct_nodes([tree for tree in trees if tree is not None]):
        for inner, root in ex.powers_of(node) if isinstance(node, ex.Power) else ():
            squares = (
                [u for u, power in ex.powers_of(inner) if power % 2 == 0]
                if root.denominator != 1
                else []
            )
            found += [u for u in squares if ex.holds(u, *moving)]
    return tuple(dict.fromkeys(reversed(found)))


def state_names(coordinates: Sequence[str]) -> list[ex.Expression]:
    """The coordinates and the velocities, (2 n,)."""
    return [*map(ex.Symbol, coordinates), *map(ex.Velocity, coordinates)]


def _walls_of(node: ex.Expression) -> Iterator[ex.Expression]:
    match node:
        case ex.Power(base, exponent):
            if not (
                isinstance(exponent, ex.Number)
                and exponent.value > 0
                and exponent.value.denominator == 1
            ):
                yield from _factors(base)
        case ex.Apply("log", argument):
            yield from _factors(argument)
        case ex.Apply(function) if function in functions.FUNCTION:
            row, inner = functions.FUNCTION[function], functions.arguments_of(node)
            for wall in (*row.poles(*inner), *(row.needs(*inner) if row.special else ())):
                yield from _factors(wall)


def _factors(base: ex.Expression) -> Iterator[ex.Expression]:
    if isinstance(base, ex.Product):
        for factor in base.factors:
            yield from _factors(factor)
    elif isinstance(base, ex.Power):
        yield from _factors(base.base)
    elif not isinstance(base, ex.Number):
        yield base


@dataclass(frozen=True, slots=True)
class Denominator:
    """What a formula divides by, or takes a logarithm or a root of: where it vanishes, the formula
    has a pole or an end.
    """

    formula: se.Formula
    text: str
    moves: bool  # whether velocities occur in it


@dataclass(frozen=True)
class Formulas:
    """The translated problem; each part is translated at first use."""

    problem: Problem

    @property
    def size(self) -> int:
        return len(self.problem.coordinates)

    @cached_property
    def depends_on_velocities(self) -> bool:
        """Whether an acceleration does."""
        if self.problem.accelerations is None:
            matrix, right = self.linear_motion
            return any(
                not part.free_symbols.isdisjoint(self.symbols("v"))
                for part in (*matrix.flat, *right)
            )
        return any(se.contains(force, v) for force in self.accelerations for v in self.symbols("v"))

    @cached_property
    def table(self) -> dict[ex.Expression, se.Formula]:
        return se.table_of_leaves(self.problem.coordinates, self.problem.parameters) | {
            ex.TIME: MOMENT
        }

    def symbols(self, letter: str) -> Vector:
        """The names with this letter, one for each coordinate."""
        return np.array([se.symbol(f"{letter}{k}") for k in range(self.size)])

    def point(self, moment: se.Formula, **places: Vector) -> dict[se.Formula, se.Formula]:
        """t and the names of these letters with what stands in their place."""
        names = np.concatenate([[MOMENT], *map(self.symbols, places)])
        return dict(zip(names, np.concatenate([[moment], *places.values()]), strict=True))

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(f"c{k}" for k in range(len(self.problem.parameters)))

    def of(self, tree: ex.Expression | None, what: str) -> se.Formula:
        """The tree, translated; InputError where the problem does not have it."""
        if tree is None:
            raise errors.InputError(
                f"This method needs {what}, which the system of this scene does not have."
            )
        return se.translate(tree, self.table)

    @cached_property
    def lagrangian(self) -> se.Formula:
        return self.of(self.problem.lagrangian, "a Lagrangian")

    @cached_property
    def energy(self) -> se.Formula:
        """v L_v - L."""
        return sum((v * self.lagrangian.diff(v) for v in self.symbols("v")), -self.lagrangian)

    @cached_property
    def free_lagrangian(self) -> se.Formula:
        return self.of(
            self.problem.free_lagrangian,
            "a free Lagrangian (that of a variational associated system)",
        )

    @cached_property
    def hamiltonian(self) -> se.Formula:
        what = "the Hamiltonian of a free Lagrangian in closed form (not needed by the raw form)"
        return self.of(self.problem.free_hamiltonian, what)

    @cached_property
    def accelerations(self) -> Vector:
        assert self.problem.accelerations is not None
        return self._translated(self.problem.accelerations)

    @cached_property
    def linear_motion(self) -> tuple[Vector, Vector]:
        """[[g, -w^T], [w, 0]] and (L_q - L_vq v - L_vt + Q, -w' v - c'): the matrix and the
        right-hand side of the linear equations for (q'', lambda), (n + m, n + m) and (n + m,);
        `pulls` of the problem in the place of w^T.
        """
        n, q, v = self.size, self.symbols("q"), self.symbols("v")
        momenta, rows = [self.lagrangian.diff(x) for x in v], self.forms
        matrix = np.full((n + len(rows), n + len(rows)), se.ZERO)
        matrix[:n, :n] = [[p.diff(x) for x in v] for p in momenta]
        pulls = [self._translated(pull) for pull in self.problem.pulls]
        matrix[n:, :n], matrix[:n, n:] = rows, -(np.array(pulls, dtype=object) if pulls else rows).T

        def drift(formula: se.Formula) -> se.Formula:
            """Its rate along q' = v at fixed v."""
            return sum(
                (formula.diff(x) * y for x, y in zip(q, v, strict=True)), formula.diff(MOMENT)
            )

        right = np.array(
            [self.lagrangian.diff(x) - drift(p) for x, p in zip(q, momenta, strict=True)]
        )
        right = right + self.forces if len(self.forces) else right
        return matrix, np.array(
            [*right, *(-drift(w) for w in self._translated(self.problem.constraints))]
        )

    @cached_property
    def forces(self) -> Vector:
        """The additional forces Q(t, q, v), empty if there are none."""
        return self._translated(self.problem.forces)

    def _translated(self, trees: Sequence[ex.Expression]) -> Vector:
        return np.array([se.translate(tree, self.table) for tree in trees], dtype=object)

    def pushed(self, slope_q: Gradient, moment: se.Formula) -> Gradient:
        """L_q + Q in the place of L_q: the discrete forces of Lagrange and d'Alembert at the same
        point.
        """
        if not len(self.forces):
            return slope_q
        return lambda q, v: slope_q(q, v) + put(self.forces, self.point(moment, q=q, v=v))

    def held(self, slope_q: Gradient, slope_p: Gradient, moment: se.Formula) -> Gradient:
        """H_q - Q at the velocity H_p in the place of H_q."""
        if not len(self.forces):
            return slope_q
        return lambda q, p: (
            slope_q(q, p) - put(self.forces, self.point(moment, q=q, v=slope_p(q, p)))
        )

    @cached_property
    def forms(self) -> Vector:
        """omega^a_i(q), one row for each constraint."""
        rows = [
            formula.diff(v)
            for formula in self._translated(self.problem.constraints)
            for v in self.symbols("v")
        ]
        return np.array(rows, dtype=object).reshape(-1, self.size)

    @cached_property
    def drifts(self) -> Vector:
        """The parts c^a(q) of the constraints omega^a v + c^a = 0 that hold no velocity."""
        return put(
            self._translated(self.problem.constraints), dict.fromkeys(self.symbols("v"), se.ZERO)
        )

    def values(self, formulas: Sequence[se.Formula], table: Mapping[str, float]) -> list[float]:
        """Those of formulas over q, v, the parameters and t; nan or infinite where there is
        none.
        """
        return [float(value) for value in self.rows(formulas, table)[0]] if len(formulas) else []

    def rows(self, formulas: Sequence[se.Formula], columns: Mapping[str, float | Array]) -> Array:
        """The same for columns of N numbers, (N, formulas)."""
        names = [
            *(str(name) for letter in "qvp" for name in self.symbols(letter)),
            *self.parameters,
            "a",
            str(MOMENT),
        ]
        names = [name for name in names if name in columns]
        with np.errstate(all="ignore"):
            table = np.stack(np.broadcast_arrays(*(columns[name] for name in names)), -1)
            found = se.closure(tuple(names), tuple(formulas))(table)
        return np.asarray(found, dtype=float).reshape(-1, len(formulas))

    def discretized(self, method: str) -> se.Formula:
        """The Lagrangian that a method discretizes."""
        return self.lagrangian if method == "nonholonomic" else self.free_lagrangian

    @property
    def on_constraints(self) -> dict[se.Formula, se.Formula]:
        """The dependent velocities with their formulas."""
        return {self.symbols("v")[k]: value for k, value in self.dependent.items()}

    def gradient(
        self, formula: se.Formula, letter: str, second: str = "v", moment: se.Formula = MOMENT
    ) -> Gradient:
        """The derivatives by the symbols of `letter` at the time `moment`, as a callable of (values
        of q, values of v or p, as `second` says).
        """
        slopes = np.array(
            [formula.diff(variable) for variable in self.symbols(letter)], dtype=object
        )
        return lambda q, other: put(slopes, self.point(moment, q=q, **{second: other}))

    def forms_at(self, place: Vector) -> Vector:
        return put(self.forms, self.point(MOMENT, q=place))

    def drifts_at(self, place: Vector) -> Vector:
        return put(self.drifts, self.point(MOMENT, q=place))

    @cached_property
    def dependent(self) -> dict[int, se.Formula]:
        """Velocities determined by the constraints as functions of q and the other velocities:
        {place: formula}.

        A velocity with a constant coefficient is taken where there is one, else the last of the
        constraint.
        """
        solved: dict[int, se.Formula] = {}
        velocities = self.symbols("v")
        for row, drift in zip(self.forms, self.drifts, strict=True):
            formula = (row @ velocities + drift).subs(
                {velocities[k]: value for k, value in solved.items()}
            )
            entries = [formula.diff(v) for v in velocities]
            present = [k for k, entry in enumerate(entries) if entry != se.ZERO]
            if not present:
                raise errors.InputError(
                    "The constraints are not independent: leave the redundant one out."
                )
            place = ([k for k in present if not entries[k].free_symbols] or present)[-1]
            rest = formula.subs({velocities[place]: se.ZERO})
            value = (-rest / entries[place]).expand()
            solved = {k: old.subs({velocities[place]: value}).expand() for k, old in solved.items()}
            solved[place] = value
        return solved

    @cached_property
    def denominators(self) -> list[Denominator]:
        """The walls of L~, parameters alone left out."""
        return self.walls_of([self.problem.free_lagrangian])

    @cached_property
    def singular_velocities(self) -> list[Denominator]:
        """Where det(d2L~/dv_i dv_j) vanishes at some velocities, for few coordinates; there the
        accelerations have a pole.
        """
        lagrangian, names = self.problem.free_lagrangian, self.problem.coordinates
        if lagrangian is None or len(names) > _MOST_EXPANDED:
            return []
        rows = euler_lagrange.hessian(lagrangian, names)
        if not any(ex.has(entry, ex.Velocity) for row in rows for entry in row):
            return []
        inverse = ex.power(collecting.determinant(rows), ex.MINUS_ONE)
        return [wall for wall in self.walls_of([inverse]) if wall.moves]

    @property
    def given_motion(self) -> tuple[ex.Expression, ...]:
        """The formulas whose walls end the motion: its accelerations, or what these follow from."""
        what = self.problem
        lagrangian = () if what.lagrangian is None else (what.lagrangian,)
        return what.accelerations or (*lagrangian, *what.constraints, *what.forces)

    def walls_of(self, trees: Sequence[ex.Expression | None]) -> list[Denominator]:
        """The walls whose signs must not change for the formulas to stay smooth, without
        repetition.
        """
        names = (
            *self.problem.coordinates,
            *(f"p_{name}" for name in self.problem.coordinates),
            ex.TIME.name,
        )
        found = dict.fromkeys(
            wall for tree in trees if tree is not None for wall in walls(tree, names)
        )
        return [self._denominator(wall) for wall in found]

    @cached_property
    def domain(self) -> list[Denominator]:
        """The formulas that are positive where L~ has the motion."""
        return [self._denominator(tree) for tree in self.problem.domain]

    @cached_property
    def momenta_may_fail(self) -> list[se.Formula]:
        """p - L~_v(q, H_p), where it is not seen to be 0: a Legendre map whose image is not the
        space of all momenta.

        An L~ quadratic in the velocities has one of all; empty there.
        """
        velocities, momenta = self.symbols("v"), self.symbols("p")
        slopes = [self.free_lagrangian.diff(v) for v in velocities]
        if not any(
            slope.diff(v).free_symbols & set(velocities) for slope in slopes for v in velocities
        ):
            return []
        inverted = dict(zip(velocities, map(self.hamiltonian.diff, momenta), strict=True))
        defects = (p - slope.subs(inverted) for p, slope in zip(momenta, slopes, strict=True))
        return [defect for defect in defects if defect.expand() != se.ZERO]

    def _denominator(self, base: ex.Expression) -> Denominator:
        moves = ex.has(base, ex.Velocity)
        return Denominator(se.translate(base, self.table), printing.to_text(base), moves)


@lru_cache(maxsize=8)
def formulas_of(problem: Problem) -> Formulas:
    """The formulas of a problem, which one run reuses from another."""
    return Formulas(problem)


def put(formulas: Vector, table: Mapping[se.Formula, se.Formula]) -> Vector:
    """The formulas, of any shape, with what the table has in the place of names."""
    return np.array([formula.subs(table) for formula in formulas.flat], dtype=object).reshape(
        formulas.shape
    )


def arrays_by_name(
    coordinates: tuple[str, ...], positions: Array, velocities: Array | None, values: Mapping[str, float | Array],
    times: Array | None = None,
) -> dict[ex.Expression, Any]:  # fmt: skip
    """Names to arrays: `positions` and `velocities` are (m, n), each column a coordinate;
    parameters numbers or (m,).

    `times` (m,) are values of t; left out, t is 0, as at the start.
    """
    table: dict[ex.Expression, Any] = {ex.TIME: 0.0 if times is None else times}
    table |= {ex.Symbol(name): value for name, value in values.items()}
    table |= {ex.Symbol(name): positions[:, k] for k, name in enumerate(coordinates)}
    if velocities is not None:
        table |= {ex.Velocity(name): velocities[:, k] for k, name in enumerate(coordinates)}
    return table
