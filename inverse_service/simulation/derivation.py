"""Derive what the methods and observables of a scene need: accelerations, exact motion, free
Lagrangians.

The parts of a Lagrangian that a scene can leave out:

L = T(q, v) + b_i(q) v^i - V(q):   kinetic part, "magnetic" (linear in v), "potential" (free of v)
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions import collecting, tree as ex
from inverse_service.integrators.method_table import EXPLICIT, USES_ACCELERATIONS, USES_FREE
from inverse_service.mechanics import euler_lagrange
from inverse_service.simulation import (
    accelerations as accelerating,
    exact_motion,
    initial,
)
from inverse_service.simulation.scene_data import (
    FreeLagrangian,
    Problem,
    Requested,
    Scene,
    Stop,
    Unavailable,
)
from inverse_service.simulation.sentences import say

KINETIC, POTENTIAL, MAGNETIC, CONSTRAINTS = "kinetic", "potential", "magnetic", "constraints"
BUILT_IN = (CONSTRAINTS, POTENTIAL, MAGNETIC, KINETIC)
COMPARED = frozenset({"error", "phase"})
USES_EXACT = COMPARED | {"matching_circle"}
_DEGENERATE = say("degenerate")[:1].upper() + say("degenerate")[1:]
Part = TypeVar("Part")
Exact = Callable[[], exact_motion.ExactMotion | None]
Find = Callable[[Scene, str | None, Exact], FreeLagrangian]


def lagrangian_parts(
    lagrangian: ex.Expression, coordinates: Sequence[str]
) -> dict[str, ex.Expression]:
    """L = kinetic + magnetic + potential, each zero where L has no such terms ("potential" is -V);
    a term is kept as a whole and expanded only if it is of several kinds: the terms of (x - 10^6)^2
    would lose 12 digits.
    """
    kinds: dict[str, list[ex.Expression]] = {KINETIC: [], MAGNETIC: [], POTENTIAL: []}
    known: dict[ex.Expression, tuple[int, int] | None] = {}
    for term in ex.summands(lagrangian):
        degrees = degrees_of(term, known)
        if degrees is not None and degrees[0] == degrees[1]:
            kinds[(POTENTIAL, MAGNETIC, KINETIC)[min(degrees[0], 2)]].append(term)
            continue
        parts, found = ex.summands(collecting.collect(term)), []
        for part in parts:
            moves = ex.has(part, ex.Velocity)
            has_mass = moves and any(
                {*row} != {ex.ZERO} for row in euler_lagrange.hessian(part, coordinates)
            )
            found.append(KINETIC if has_mass else MAGNETIC if moves else POTENTIAL)
        for kind, part in (
            zip(found, parts, strict=True) if len(set(found)) > 1 else ((found[0], term),)
        ):
            kinds[kind].append(part)
    return {kind: ex.add(*terms) for kind, terms in kinds.items()}


def degrees_of(
    tree: ex.Expression, known: dict[ex.Expression, tuple[int, int] | None]
) -> tuple[int, int] | None:
    """The lowest and the highest degree in the velocities of the terms of a polynomial in them;
    None of another.
    """
    if tree in known:
        return known[tree]
    found: tuple[int, int] | None = (0, 0)
    match tree:
        case ex.Velocity():
            found = 1, 1
        case ex.Sum(terms):
            parts = [degrees_of(term, known) for term in terms]
            pairs = [pair for pair in parts if pair is not None]
            found = (
                (min(a for a, _ in pairs), max(b for _, b in pairs))
                if len(pairs) == len(parts)
                else None
            )
        case ex.Product(factors):
            parts = [degrees_of(factor, known) for factor in factors]
            pairs = [pair for pair in parts if pair is not None]
            found = (
                (sum(a for a, _ in pairs), sum(b for _, b in pairs))
                if len(pairs) == len(parts)
                else None
            )
        case ex.Power(base, ex.Number(value)) if value > 0 and value.denominator == 1:
            inner = degrees_of(base, known)
            found = None if inner is None else (int(value) * inner[0], int(value) * inner[1])
        case _ if ex.has(tree, ex.Velocity):
            found = None
    known[tree] = found
    return found


@dataclass(frozen=True)
class Derived:
    """A scene with what is derived for it, each part when it is first needed; `seconds` are the
    times they took.

    `find` looks for the free Lagrangian of a name (None: that of the scene). `stop` says when the
    time is over.
    """

    scene: Scene
    find: Find
    stop: Stop | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    known: dict[str, Any] = field(default_factory=dict)

    def _part(self, key: str, name: str, make: Callable[[], Part]) -> Part:
        if key not in self.known:
            with timed(self.seconds, name):
                try:
                    self.known[key] = make()
                except Unavailable as reason:
                    self.known[key] = reason
        found: Part | Unavailable = self.known[key]
        if isinstance(found, Unavailable):
            raise found
        return found

    def but(self, **changes: Any) -> Derived:
        """What is derived is that of the scene with the changes too, such as another grid."""
        return replace(self, scene=replace(self.scene, **changes))

    @property
    def is_over(self) -> bool:
        """Whether the time is over."""
        return self.stop is not None and self.stop()

    @property
    def degenerate(self) -> bool:
        """Whether the masses of the scene's Lagrangian do not determine the accelerations."""
        if "degenerate" not in self.known:
            self.known["degenerate"] = self.scene.lagrangian is not None and initial.is_degenerate(
                self.scene
            )
        return bool(self.known["degenerate"])

    def exact(self) -> exact_motion.ExactMotion:
        """The exact motion."""
        scene = self.scene

        def make() -> exact_motion.ExactMotion:
            if scene.forces or scene.contacts or any(event.acts for event in scene.events):
                raise Unavailable("Additional forces, contacts, or events act on the motion.")
            if self.degenerate:
                raise Unavailable(_DEGENERATE)
            return exact_motion.motion_by_quadrature(scene, scene.values)

        return self._part("exact", "exact motion", make)

    def exact_or_none(self) -> exact_motion.ExactMotion | None:
        """The exact motion, if one is known."""
        with suppress(Unavailable):
            return self.exact()
        return None

    def accelerations(self) -> tuple[ex.Expression, ...]:
        """The formulas of those of all coordinates."""
        return self._part("accelerations", "accelerations", partial(accelerations_of, self.scene))

    def free(self, name: str | None) -> FreeLagrangian:
        """The free Lagrangian of a name."""
        return self._part(
            f"free {name}",
            "free Lagrangian",
            lambda: self.find(self.scene, name, self.exact_or_none),
        )

    def motion(self) -> Problem:
        """The problem for methods that integrate q'' = f: with given accelerations, or with those
        of a Lagrangian, which are unknowns of linear equations.
        """
        scene = self.scene
        if initial.ended_at_start(scene) is not None:
            raise Unavailable(say("no_lagrangian_at_start"))
        names, values = scene.coordinates, tuple(scene.values)
        if scene.lagrangian is None:
            return Problem(
                names, values, constraints=scene.constraints, accelerations=scene.accelerations
            )
        if initial.is_singular_at_start(scene):
            raise Unavailable(say("singular_at_start"))
        return Problem(names, values, scene.lagrangian, scene.constraints, forces=scene.forces)


def with_energy(derived: Derived) -> Derived:
    """Of a system given by its equations: with the Lagrangian that is found for its energy or its
    methods.
    """
    scene = derived.scene
    uses = "energy" in scene.observe or any(
        one.method in USES_FREE and one.free is None for one in scene.methods
    )
    if scene.accelerations is None or not uses:
        return derived
    with suppress(Unavailable):
        free = derived.free(None)
        scene = replace(scene, found=free, values=dict(free.constants) | dict(scene.values))
    return replace(derived, scene=scene)


def problem_of(requested: Requested, derived: Derived) -> Problem:
    """The problem with only the parts that one method uses; Unavailable where the method cannot
    run.
    """
    scene, method = derived.scene, requested.method
    if derived.degenerate:
        raise Unavailable(_DEGENERATE)
    if method in EXPLICIT | USES_ACCELERATIONS:
        return derived.motion()
    if scene.lagrangian is None and method in ("nonholonomic", "modified"):
        raise Unavailable(
            f"The method {method} needs the Lagrangian of the system; the scene gives only equations."
        )
    if method == "modified" and scene.forces:
        raise Unavailable(
            "The modified method does not support additional forces: use nonholonomic."
        )
    if method == "modified" and not scene.constraints:
        raise Unavailable("The modified method needs constraints; this scene has none.")
    found = Problem(
        scene.coordinates,
        tuple(scene.values),
        scene.lagrangian,
        scene.constraints,
        forces=scene.forces,
    )
    if method == "nonholonomic":
        return found
    free = derived.free(requested.free)
    if (
        free.lagrangian == scene.lagrangian
        and free.hamiltonian is None
        and initial.is_singular_at_start(scene)
    ):
        raise Unavailable(say("singular_at_start"))
    if free.lost and method == "variational" and requested.choice.form != "raw":
        raise Unavailable(free.lost)
    return replace(
        found, parameters=(*scene.values, *(name for name in free.constants if name not in scene.values)),
        free_lagrangian=free.lagrangian, free_hamiltonian=free.hamiltonian, free_constants=tuple(free.constants),
        forces=scene.forces if free.forced else (), domain=free.domain,
    )  # fmt: skip


def free_of(requested: Requested, derived: Derived) -> FreeLagrangian | None:
    """The free Lagrangian that a method uses, where it uses one and there is one."""
    with suppress(Unavailable):
        return derived.free(requested.free) if requested.method in USES_FREE else None
    return None


def accelerations_of(scene: Scene) -> tuple[ex.Expression, ...]:
    """Those given, or derived from the Lagrangian, the constraints and the forces."""
    if scene.accelerations is not None:
        return scene.accelerations
    try:
        return accelerating.formulas_of(scene)[0]
    except InputError as error:
        raise Unavailable(error.detail[:1].upper() + error.detail[1:]) from None
    except LimitError:
        raise Unavailable(say("too_long_accelerations")) from None


@contextmanager
def timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    begun = time.perf_counter()
    yield
    seconds[name] = seconds.get(name, 0.0) + time.perf_counter() - begun
