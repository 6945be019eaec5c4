"""Only what a scene's methods and observables need is derived: accelerations, exact motion, free Lagrangians.

The parts of a Lagrangian that can be left out of a scene:

L = T(q, v) + b_i(q) v^i - V(q):   kinetic part, "magnetic" (linear in v), "potential" (free of v)

Accelerations of a constrained motion in a form that is regular wherever the constraints are independent.

With g = L_vv, F = L_q - L_vq v - L_vt + Q and constraints w v = 0:

    a = g^-1 (F + w^T lambda),   lambda = -(w g^-1 w^T)^-1 (w' v + w g^-1 F)

Unlike the equations in independent velocities they have no singular points such as cos(phi) = 0.
Source: A. M. Bloch, Nonholonomic Mechanics and Control, 2003, chapter 5; adjugates by Laplace expansion.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from inverse_service.errors import InputError
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.graphs import components
from inverse_service.expressions.tree import ONE, TIME, ZERO, Expression, Sum, Symbol, Velocity, add, dot, walk
from inverse_service.integrators.method_table import USES_ACCELERATIONS, USES_FREE
from inverse_service.mechanics.euler_lagrange import euler_lagrange_sums, hessian
from inverse_service.mechanics.nonholonomic.geometry import NonholonomicSystem
from inverse_service.mechanics.nonholonomic.motion import equations_of_motion
from inverse_service.simulation.callables import switching_functions
from inverse_service.simulation.exact_motion import ExactMotion, NoExactMotion, motion_by_quadrature
from inverse_service.simulation.initial import NO_VALUE, ended_at_start, is_degenerate
from inverse_service.simulation.scene_data import EXACT, FreeLagrangian, Problem, Requested, Scene, Unavailable

KINETIC, POTENTIAL, MAGNETIC, CONSTRAINTS = "kinetic", "potential", "magnetic", "constraints"
BUILT_IN = (CONSTRAINTS, POTENTIAL, MAGNETIC, KINETIC)


@dataclass(frozen=True, slots=True)
class LagrangianParts:
    """L = kinetic + magnetic + potential, each zero where L has no such terms (`potential` is -V)."""

    kinetic: Expression
    magnetic: Expression
    potential: Expression


def lagrangian_parts(lagrangian: Expression, coordinates: Sequence[str]) -> LagrangianParts:
    """The terms of L by their kind; a term is taken as a whole, and multiplied out only where it is of several kinds:
    the terms of (x - 10^6)^2 would lose 12 digits."""
    kinds: dict[str, list[Expression]] = {KINETIC: [], MAGNETIC: [], POTENTIAL: []}
    for term in _terms(lagrangian):
        parts = _terms(collect(term))
        found = [_kind(part, coordinates) for part in parts]
        for kind, part in zip(found, parts, strict=True) if len(set(found)) > 1 else ((found[0], term),):
            kinds[kind].append(part)
    return LagrangianParts(*(add(*kinds[kind]) for kind in (KINETIC, MAGNETIC, POTENTIAL)))


def _terms(tree: Expression) -> tuple[Expression, ...]:
    return tree.terms if isinstance(tree, Sum) else (tree,)


def _kind(term: Expression, coordinates: Sequence[str]) -> str:
    rates = [Velocity(name) for name in coordinates if Velocity(name) in set(walk(term))]
    if not rates:
        return POTENTIAL
    slopes = [differentiate(term, rate) for rate in rates]
    linear = all(collect(differentiate(slope, rate)) == ZERO for slope in slopes for rate in rates)
    return MAGNETIC if linear else KINETIC


def with_effects(parts: LagrangianParts, terms: Mapping[str, Expression], named: Sequence[str]) -> Expression:
    """The Lagrangian of a scene: the kinetic part and what `named` lists; all else is not there at all."""
    chosen = [parts.kinetic]
    if MAGNETIC in named:
        chosen.append(parts.magnetic)
    if POTENTIAL in named:
        chosen.append(parts.potential)
    return add(*chosen, *(tree for name, tree in terms.items() if name in named))


COMPARED = frozenset({"error", "phase"})
USES_EXACT = COMPARED | {"matching_circle"}

DEGENERATE = (
    "the matrix of the velocities is singular (d2L/dv_i dv_j, or constraints that depend on one another), so no "
    "accelerations follow: give every coordinate its kinetic energy, with other parameters or effects of the scene."
)
_DEGENERATE = DEGENERATE[:1].upper() + DEGENERATE[1:]

Find = Callable[[Scene, str | None, ExactMotion | NoExactMotion], FreeLagrangian | Unavailable]


@dataclass(frozen=True, slots=True)
class Derived:
    """What was derived for a scene; None (or no entry) is what nothing asked for. `seconds` says what each took."""

    exact: ExactMotion | NoExactMotion | None
    accelerations: tuple[Expression, ...] | Unavailable | None
    free: Mapping[str | None, FreeLagrangian | Unavailable]
    seconds: Mapping[str, float]


def derive(scene: Scene, find: Find) -> Derived:
    """Derive by need; `find` looks for the free Lagrangian of a name (None: the scene's own)."""
    seconds: dict[str, float] = {}
    used = {requested.method for requested in scene.methods}
    wanted = dict.fromkeys(requested.free for requested in scene.methods if requested.method in USES_FREE)
    if scene.accelerations is not None and "energy" in scene.observe:
        wanted[None] = None
    exact: ExactMotion | NoExactMotion | None = None
    if EXACT in used or USES_EXACT & set(scene.observe) or wanted:
        with timed(seconds, "exact motion"):
            exact = _exact(scene)
    compares = bool(COMPARED & set(scene.observe)) and not isinstance(exact, ExactMotion)
    accelerations = None
    if (
        used & USES_ACCELERATIONS
        or compares
        or "lyapunov" in scene.observe
        or (scene.events and used & {EXACT, "modified"})
        or any(event.acts or event.most > 1 for event in scene.events)
        or switching_functions([scene.lagrangian, *scene.forces], scene.coordinates)
    ):
        with timed(seconds, "accelerations"):
            accelerations = _accelerations(scene)
    free: dict[str | None, FreeLagrangian | Unavailable] = {}
    for name in wanted:
        with timed(seconds, "free Lagrangian"):
            free[name] = find(scene, name, exact or NoExactMotion("No exact motion is known."))
    return Derived(exact, accelerations, free, seconds)


def derived_for_truth(scene: Scene, derived: Derived) -> Derived:
    """With the accelerations, where nothing that the scene asks for needed them."""
    return derived if derived.accelerations is not None else replace(derived, accelerations=_accelerations(scene))


def with_energy(scene: Scene, derived: Derived) -> Scene:
    """The scene with the Lagrangian whose energy is observed, where it is given by equations and one is known."""
    free = derived.free.get(None)
    if scene.accelerations is None or not isinstance(free, FreeLagrangian):
        return scene
    return replace(scene, found=free, values=dict(free.constants) | dict(scene.values))


def problem_of(scene: Scene, requested: Requested, derived: Derived) -> Problem | Unavailable:
    """The problem as one method needs it, with nothing that it does not use; or the reason why it cannot run."""
    method = requested.method
    if scene.lagrangian is not None and is_degenerate(scene):
        return Unavailable(_DEGENERATE)
    if method in USES_ACCELERATIONS:
        return with_accelerations(scene, derived)
    if scene.lagrangian is None and method in ("nonholonomic", "modified"):
        return Unavailable(f"The method {method} needs the Lagrangian of the system; the scene gives only equations.")
    if method == "modified" and scene.forces:
        return Unavailable("The modified method is for motions without further forces: use nonholonomic.")
    if method == "modified" and not scene.constraints:
        return Unavailable("The modified method needs constraints; this scene has none.")
    if method == "nonholonomic":
        names, values = scene.coordinates, tuple(scene.values)
        return Problem(names, values, lagrangian=scene.lagrangian, constraints=scene.constraints, forces=scene.forces)
    free = derived.free[requested.free]
    if isinstance(free, Unavailable):
        return free
    if free.lost and method == "variational" and requested.choice is not None and requested.choice.form != "raw":
        return Unavailable(free.lost)
    return Problem(
        scene.coordinates,
        (*scene.values, *(name for name in free.constants if name not in scene.values)),
        lagrangian=scene.lagrangian,
        constraints=scene.constraints,
        free_lagrangian=free.lagrangian,
        free_hamiltonian=free.hamiltonian,
        free_constants=tuple(free.constants),
        forces=scene.forces if free.forced else (),
        domain=free.domain,
    )


def with_accelerations(scene: Scene, derived: Derived) -> Problem | Unavailable:
    """The problem for methods that integrate q'' = f."""
    if derived.accelerations is None or isinstance(derived.accelerations, Unavailable):
        return derived.accelerations or Unavailable("The accelerations were not derived.")
    if ended_at_start(scene) is not None:
        return Unavailable(NO_VALUE)
    names, values = scene.coordinates, tuple(scene.values)
    return Problem(names, values, constraints=scene.constraints, accelerations=derived.accelerations)


def _exact(scene: Scene) -> ExactMotion | NoExactMotion:
    if scene.lagrangian is None:
        return NoExactMotion("The system is given by its equations.")
    if scene.forces or any(event.acts for event in scene.events):
        return NoExactMotion("Further forces, or events, act.")
    if is_degenerate(scene):
        return NoExactMotion(_DEGENERATE)
    return motion_by_quadrature(scene.coordinates, scene.lagrangian, scene.constraints, scene.values)


def _accelerations(scene: Scene) -> tuple[Expression, ...] | Unavailable:
    if scene.accelerations is not None:
        return scene.accelerations
    if scene.lagrangian is None:
        return Unavailable("The scene has neither a Lagrangian nor equations of motion.")
    try:
        found = regular_accelerations(scene.coordinates, scene.lagrangian, scene.constraints, scene.forces)
    except InputError as error:
        return Unavailable(error.detail[:1].upper() + error.detail[1:])
    if found is not None:
        return found
    if scene.forces:
        return Unavailable("The kinetic energy couples too many coordinates for forces to be added.")
    system = NonholonomicSystem(scene.coordinates, scene.lagrangian, scene.constraints, tuple(scene.values))
    return equations_of_motion(system).accelerations


@contextmanager
def timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    begun = time.perf_counter()
    yield
    seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - begun


Matrix = tuple[tuple[Expression, ...], ...]
# Beyond this size the expansion of a full determinant would fill pages.
MOST_FULL_ROWS = 5


def regular_accelerations(
    coordinates: Sequence[str],
    lagrangian: Expression,
    constraints: Sequence[Expression],
    forces: Sequence[Expression] = (),
) -> tuple[Expression, ...] | None:
    """All n accelerations over (q, v), with further forces Q; None where the matrices are too large to be inverted."""
    found = accelerations_and_multipliers(coordinates, lagrangian, constraints, forces)
    return None if found is None else found[0]


def accelerations_and_multipliers(
    coordinates: Sequence[str],
    lagrangian: Expression,
    constraints: Sequence[Expression],
    forces: Sequence[Expression] = (),
) -> tuple[tuple[Expression, ...], tuple[Expression, ...]] | None:
    """a and lambda; the constraints exert the forces w^T lambda."""
    names = tuple(coordinates)
    inertia = inverse(hessian(lagrangian, names))
    if inertia is None:
        return None
    own = tuple(-e for e in euler_lagrange_sums(lagrangian, names, [ZERO] * len(names)))
    free = _applied(inertia, tuple(map(add, own, forces)) if forces else own)
    if not constraints:
        return free, ()
    rows = tuple(tuple(collect(differentiate(w, Velocity(name))) for name in names) for w in constraints)
    lifted = tuple(_applied(inertia, row) for row in rows)
    gram = inverse(tuple(tuple(dot(row, lift) for lift in lifted) for row in rows))
    if gram is None:
        return None
    defects = [_rate(w, names) + dot(row, free) for w, row in zip(constraints, rows, strict=True)]
    multipliers = tuple(-dot(line, defects) for line in gram)
    moved = (free[i] + dot([lift[i] for lift in lifted], multipliers) for i in range(len(names)))
    return tuple(moved), multipliers


def inverse(matrix: Matrix) -> Matrix | None:
    """The inverse of a symmetric matrix, block by block; None where a block is larger than MOST_FULL_ROWS.

    InputError where it is singular everywhere.
    """
    span = range(len(matrix))
    found: list[list[Expression]] = [[ZERO for _ in span] for _ in span]
    for block in components({i: [j for j in span if matrix[i][j] != ZERO] for i in span}):
        if len(block) > MOST_FULL_ROWS:
            return None
        inner = tuple(tuple(matrix[i][j] for j in block) for i in block)
        whole = determinant(inner)
        if whole == ZERO:
            raise InputError(DEGENERATE)
        for a, i in enumerate(block):
            for b, j in enumerate(block):
                found[i][j] = _cofactor(inner, b, a) / whole
    return tuple(map(tuple, found))


def determinant(matrix: Matrix) -> Expression:
    """The determinant by expansion along the first row; 1 for a matrix without rows."""
    if not matrix:
        return ONE
    terms = [entry * _cofactor(matrix, 0, j) for j, entry in enumerate(matrix[0]) if entry != ZERO]
    return collect(add(*terms))


def _cofactor(matrix: Matrix, row: int, column: int) -> Expression:
    minor = tuple(
        tuple(entry for j, entry in enumerate(line) if j != column) for i, line in enumerate(matrix) if i != row
    )
    value = determinant(minor)
    return -value if (row + column) % 2 else value


def _rate(expression: Expression, names: tuple[str, ...]) -> Expression:
    """The part of the derivative in time that holds no acceleration."""
    along = (differentiate(expression, Symbol(name)) * Velocity(name) for name in names)
    return collect(add(*along, differentiate(expression, TIME)))


def _applied(matrix: Matrix, vector: Sequence[Expression]) -> tuple[Expression, ...]:
    return tuple(dot(row, vector) for row in matrix)
