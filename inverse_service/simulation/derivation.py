"""Derive what the methods and observables of a scene need: accelerations, exact motion, free Lagrangians.

The parts of a Lagrangian that a scene can leave out:

L = T(q, v) + b_i(q) v^i - V(q):   kinetic part, "magnetic" (linear in v), "potential" (free of v)
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from inverse_service.errors import InputError
from inverse_service.expressions import collecting, derivative
from inverse_service.expressions.tree import ZERO, Expression, Sum, Velocity, add, walk
from inverse_service.integrators.method_table import USES_ACCELERATIONS, USES_FREE
from inverse_service.mechanics import constrained_motion
from inverse_service.simulation import accelerations as accelerating, exact_motion, initial, numeric_formulas
from inverse_service.simulation.scene_data import EXACT, FreeLagrangian, Problem, Requested, Scene, Unavailable

KINETIC, POTENTIAL, MAGNETIC, CONSTRAINTS = "kinetic", "potential", "magnetic", "constraints"
BUILT_IN = (CONSTRAINTS, POTENTIAL, MAGNETIC, KINETIC)
COMPARED = frozenset({"error", "phase"})
USES_EXACT = COMPARED | {"matching_circle"}
_DEGENERATE = accelerating.DEGENERATE[:1].upper() + accelerating.DEGENERATE[1:]
Find = Callable[[Scene, str | None, exact_motion.ExactMotion | Unavailable], FreeLagrangian | Unavailable]


def lagrangian_parts(lagrangian: Expression, coordinates: Sequence[str]) -> dict[str, Expression]:
    """L = kinetic + magnetic + potential, each zero where L has no such terms ("potential" is -V); a term is kept as a
    whole and expanded only if it is of several kinds: the terms of (x - 10^6)^2 would lose 12 digits."""
    kinds: dict[str, list[Expression]] = {KINETIC: [], MAGNETIC: [], POTENTIAL: []}
    for term in _terms(lagrangian):
        parts = _terms(collecting.collect(term))
        found = [_kind(part, coordinates) for part in parts]
        for kind, part in zip(found, parts, strict=True) if len(set(found)) > 1 else ((found[0], term),):
            kinds[kind].append(part)
    return {kind: add(*terms) for kind, terms in kinds.items()}


def _terms(tree: Expression) -> tuple[Expression, ...]:
    return tree.terms if isinstance(tree, Sum) else (tree,)


def _kind(term: Expression, coordinates: Sequence[str]) -> str:
    rates = [Velocity(name) for name in coordinates if Velocity(name) in set(walk(term))]
    if not rates:
        return POTENTIAL
    slopes = [derivative.differentiate(term, rate) for rate in rates]
    linear = all(
        collecting.collect(derivative.differentiate(slope, rate)) == ZERO for slope in slopes for rate in rates
    )
    return MAGNETIC if linear else KINETIC


@dataclass(frozen=True, slots=True)
class Derived:
    """The formulas derived for a scene; None (or no entry) if not requested. `seconds` are the times they took.

    `degenerate`: the masses of the scene's Lagrangian do not determine the accelerations.
    """

    exact: exact_motion.ExactMotion | Unavailable | None
    accelerations: tuple[Expression, ...] | Unavailable | None
    free: Mapping[str | None, FreeLagrangian | Unavailable]
    seconds: Mapping[str, float]
    degenerate: bool = False


def derive(scene: Scene, find: Find) -> Derived:
    """Derive what is needed; `find` looks for the free Lagrangian of a name (None: that of the scene)."""
    seconds: dict[str, float] = {}
    degenerate = scene.lagrangian is not None and initial.is_degenerate(scene)
    used = {requested.method for requested in scene.methods}
    wanted = dict.fromkeys(requested.free for requested in scene.methods if requested.method in USES_FREE)
    if scene.accelerations is not None and "energy" in scene.observe:
        wanted[None] = None
    exact: exact_motion.ExactMotion | Unavailable | None = None
    if EXACT in used or USES_EXACT & set(scene.observe) or wanted:
        with timed(seconds, "exact motion"):
            exact = _exact(scene, degenerate)
    compares = bool(COMPARED & set(scene.observe)) and not isinstance(exact, exact_motion.ExactMotion)
    accelerations = None
    if (
        used & USES_ACCELERATIONS
        or compares
        or {"lyapunov", "period"} & set(scene.observe)
        or (scene.events and used & {EXACT, "modified"})
        or any(event.acts or event.most > 1 for event in scene.events)
        or numeric_formulas.switching_functions([scene.lagrangian, *scene.forces], scene.coordinates)
    ):
        with timed(seconds, "accelerations"):
            accelerations = accelerations_of(scene)
    free: dict[str | None, FreeLagrangian | Unavailable] = {}
    for name in wanted:
        with timed(seconds, "free Lagrangian"):
            free[name] = find(scene, name, exact or Unavailable("No exact motion is known."))
    return Derived(exact, accelerations, free, seconds, degenerate)


def derived_for_truth(scene: Scene, derived: Derived) -> Derived:
    """Add the accelerations if no part of the scene has required them."""
    return derived if derived.accelerations is not None else replace(derived, accelerations=accelerations_of(scene))


def with_energy(scene: Scene, derived: Derived) -> Scene:
    """The scene with the Lagrangian whose energy is observed, where it is given by equations and one is known."""
    free = derived.free.get(None)
    if scene.accelerations is None or not isinstance(free, FreeLagrangian):
        return scene
    return replace(scene, found=free, values=dict(free.constants) | dict(scene.values))


def problem_of(scene: Scene, requested: Requested, derived: Derived) -> Problem | Unavailable:
    """The problem with only the parts that one method uses, or the reason why the method cannot run."""
    method = requested.method
    if derived.degenerate:
        return Unavailable(_DEGENERATE)
    if method in USES_ACCELERATIONS:
        return with_accelerations(scene, derived)
    if scene.lagrangian is None and method in ("nonholonomic", "modified"):
        return Unavailable(f"The method {method} needs the Lagrangian of the system; the scene gives only equations.")
    if method == "modified" and scene.forces:
        return Unavailable("The modified method does not support additional forces: use nonholonomic.")
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


def free_of(requested: Requested, derived: Derived) -> FreeLagrangian | None:
    """The free Lagrangian that a method uses, where it uses one and there is one."""
    found = derived.free.get(requested.free) if requested.method in USES_FREE else None
    return found if isinstance(found, FreeLagrangian) else None


def with_accelerations(scene: Scene, derived: Derived) -> Problem | Unavailable:
    """The problem for methods that integrate q'' = f."""
    if derived.accelerations is None or isinstance(derived.accelerations, Unavailable):
        return derived.accelerations or Unavailable("The accelerations were not derived.")
    if initial.ended_at_start(scene) is not None:
        return Unavailable(initial.NO_VALUE)
    names, values = scene.coordinates, tuple(scene.values)
    return Problem(names, values, constraints=scene.constraints, accelerations=derived.accelerations)


def _exact(scene: Scene, degenerate: bool) -> exact_motion.ExactMotion | Unavailable:
    if scene.lagrangian is None:
        return Unavailable("The system is given by its equations.")
    if scene.forces or any(event.acts for event in scene.events):
        return Unavailable("Additional forces or events act on the motion.")
    if degenerate:
        return Unavailable(_DEGENERATE)
    return exact_motion.motion_by_quadrature(scene.coordinates, scene.lagrangian, scene.constraints, scene.values)


def accelerations_of(scene: Scene) -> tuple[Expression, ...] | Unavailable:
    if scene.accelerations is not None:
        return scene.accelerations
    if scene.lagrangian is None:
        return Unavailable("The scene has neither a Lagrangian nor equations of motion.")
    try:
        found = accelerating.regular_accelerations(scene.coordinates, scene.lagrangian, scene.constraints, scene.forces)
    except InputError as error:
        return Unavailable(error.detail[:1].upper() + error.detail[1:])
    if found is not None:
        return found
    if scene.forces:
        return Unavailable("The kinetic energy couples too many coordinates for forces to be added.")
    system = constrained_motion.NonholonomicSystem(
        scene.coordinates, scene.lagrangian, scene.constraints, tuple(scene.values)
    )
    return constrained_motion.accelerations(system)


@contextmanager
def timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    begun = time.perf_counter()
    yield
    seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - begun
