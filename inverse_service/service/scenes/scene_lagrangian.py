"""The free Lagrangian of a scene: given, known, by the formula of its class, or found by the
solver.

The solver and the simulation exchange text: the answer of the solver is parsed and tested against
the motion.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from api_schemas.scene import SceneDocument
from inverse_service import catalogue
from inverse_service.errors import InputError, InverseServiceError
from inverse_service.expressions import arrays, calculus, collecting, printing, tree as ex
from inverse_service.field.exact_field import TooLarge
from inverse_service.mechanics.constrained_motion import (
    NonholonomicSystem,
    eliminate_multipliers,
    frames,
    geometry,
)
from inverse_service.mechanics.legendre import legendre
from inverse_service.mechanics.paper_class import KINDS, associated, recognized
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import plain_data
from inverse_service.service.scenes import scene_reading
from inverse_service.simulation import (
    accelerations as accelerating,
    derivation,
    exact_motion,
    initial,
)
from inverse_service.simulation.numeric_formulas import switching_functions, walls
from inverse_service.simulation.scene_data import FreeLagrangian, Observable, Scene, Unavailable
from inverse_service.simulation.sentences import say

SOLVE_SECONDS, CONSERVED_SECONDS = 15.0, 3.0  # of processor time
MOST_CONSERVED = 3  # coordinates, and constants of the motion


def finder(schema: SceneDocument, system: scene_reading.MechanicalSystem) -> derivation.Find:
    """The function that `derive` calls for the free Lagrangian of a method."""

    def find(scene: Scene, name: str | None, exact: derivation.Exact) -> FreeLagrangian:
        wanted = name if name is not None else schema.free_lagrangian
        pointers = {given: f"/constants/{plain_data.escape(given)}" for given in schema.constants}
        constants = {
            given: scene_reading.number_of(text, pointers[given])
            for given, text in schema.constants.items()
        }
        places = [k for k, method in enumerate(schema.methods) if method.free_lagrangian == name]
        pointer = f"/methods/{places[0]}/free_lagrangian" if places else "/free_lagrangian"
        found = _Search(scene, system, constants).found(wanted, exact, pointer)
        for given in schema.constants:
            if given not in found.constants:
                known = ", ".join(found.constants) or "none"
                raise InputError(
                    say("no_constant", plain_data.escape(given), known), pointers[given]
                )
        return found

    return find


@dataclass(frozen=True, slots=True)
class _Search:
    """For a scene of a system, with values of free constants."""

    scene: Scene
    system: scene_reading.MechanicalSystem
    constants: Mapping[str, float]

    def found(self, wanted: str | None, exact: derivation.Exact, pointer: str) -> FreeLagrangian:
        """L~ as `wanted`: a formula, or the name of an associated system; None for the best one
        known.
        """
        scene = self.scene
        if wanted is not None and wanted not in KINDS:
            return self.given(wanted, pointer, "given in the scene")
        if not scene.constraints and scene.lagrangian is not None:
            own = FreeLagrangian(scene.lagrangian, None, {}, "the Lagrangian of the scene")
            if any(one.choice.form == "verlet" for one in scene.methods):  # others need no H
                own = _with_hamiltonian(scene, own.lagrangian, {}, own.source)
            return replace(own, forced=bool(scene.forces))
        if scene.forces:
            raise Unavailable(say("forced_constraints"))
        if wanted is None and self.system.known:
            return self.first_fitting(self.system.known, self.system.source)
        motion = exact()
        known = None if motion is None else exact_motion.class_lagrangian(motion, self.constants)
        if known is not None and wanted in (None, "second"):
            return known
        kinds = [wanted] if wanted or scene.lagrangian is None else ["second", "first", "third"]
        return _first(partial(self.of_associated, which) for which in kinds)

    def first_fitting(
        self, known: Sequence[scene_reading.KnownLagrangian], source: str
    ) -> FreeLagrangian:
        """The first that has the motion and whose domain contains the start."""
        return _first(partial(self.given, one.text, "/system", source, one.domain) for one in known)

    def given(
        self, text: str, pointer: str, source: str, conditions: Sequence[str] = ()
    ) -> FreeLagrangian:
        """The L~ of a text, tested against the motion."""
        scene, names, constants = self.scene, self.system.names, self.constants
        extra = tuple(name for name in constants if name not in names.parameters)
        known = replace(
            self.system,
            names=nm.Names(names.coordinates, (*names.parameters, *extra), names.functions),
        )
        tree = scene_reading.read_expression(text, known, pointer)
        used = {node.name for node in ex.walk(tree) if isinstance(node, ex.Symbol)}
        own = {
            name: value
            for name, value in constants.items()
            if name in used and name not in scene.values
        }
        values = dict(scene.values) | own
        accelerations = derivation.accelerations_of(scene)
        domain = _domain(scene, self.system, conditions, values)
        if domain is None:
            raise Unavailable(say("begins_elsewhere", source, ", ".join(conditions)))
        if accelerating.keeps_motion(scene, tree, accelerations, values, domain) is False:
            if pointer == "/system":
                raise Unavailable(say("lagrangian_changed", source))
            raise InputError(say("lagrangian_of_another"), pointer)
        return replace(_with_hamiltonian(scene, tree, own, source), domain=domain)

    def of_associated(self, which: str | None) -> FreeLagrangian:
        """The L~ of an associated system, or of the system: that of the catalogue, or what the
        solver finds.
        """
        which = which or "second"
        with suppress(InputError):  # where it is not in the catalogue, and where it does not fit
            entry = catalogue.entry(f"{self.system.catalogue_name}-{which}")
            for text in entry.get("expected", {}).get("lagrangians", [])[:1]:
                return self.given(
                    text, "/system", f"the known Lagrangian of the {which} associated system"
                )
        result = _answer(json.dumps(_question(self.scene, which)), SOLVE_SECONDS)
        what = (
            f"the {which} associated system" if self.scene.lagrangian is not None else "the system"
        )
        if not isinstance(result, str):
            if known := scene_reading.lagrangians_of(result, self.system.names):
                return self.first_fitting(known, f"found by the solver for {what}")
            verdict = str(result.get("verdict", "undetermined")).replace("_", " ")
            result = (
                say("no_closed_form") if verdict == "variational" else f"the solver says {verdict}."
            )
        raise Unavailable(say("no_free_lagrangian", what, result))


def _first(ways: Iterable[Callable[[], FreeLagrangian]]) -> FreeLagrangian:
    """What the first of the ways finds; else why the first one fails."""
    reasons = []
    for way in ways:
        try:
            return way()
        except Unavailable as reason:
            reasons.append(reason)
    raise reasons[0]


def _domain(
    scene: Scene,
    system: scene_reading.MechanicalSystem,
    conditions: Sequence[str],
    values: Mapping[str, float],
) -> tuple[ex.Expression, ...] | None:
    """The formulas that are positive while L~ has the motion: its conditions, and the denominators
    and radicands of given accelerations; None if a condition does not hold at the start.
    """
    ends = [reader.read_condition(condition, system.names) for condition in conditions]
    ends = [calculus.define_functions(end, system.definitions) for end in ends]
    table = initial.at_start(scene, values)
    signs = [float(arrays.array_value(end, table)[0]) for end in ends]
    if any(
        not sign > 0 and " != " not in condition
        for sign, condition in zip(signs, conditions, strict=True)
    ):
        return None
    inner = [wall for tree in scene.accelerations or () for wall in walls(tree, scene.coordinates)]
    signs += [float(arrays.array_value(wall, table)[0]) for wall in inner]
    pairs = zip([*ends, *inner], signs, strict=True)
    return tuple(dict.fromkeys(end if sign > 0 else -end for end, sign in pairs if sign))


def _with_hamiltonian(
    scene: Scene, tree: ex.Expression, constants: Mapping[str, float], source: str
) -> FreeLagrangian:
    """L~, with its H~ if a closed form exists that reproduces the initial velocities."""
    known = dict(scene.values) | dict(constants)
    if (separate := _of_own_masses(tree, scene.coordinates, known)) is not None:
        return FreeLagrangian(tree, separate, dict(constants), source)
    try:
        found = legendre(tree, scene.coordinates)
    except InputError as error:
        raise Unavailable(f"The Lagrangian cannot be used: {error.detail}") from None
    standard = all(
        symbol.name == f"p_{name}"
        for symbol, name in zip(found.symbols, scene.coordinates, strict=True)
    )
    hamiltonian, lost = None, ""
    if not found.implicit and found.velocities is not None and standard:
        table = initial.at_start(scene, known)
        table |= {
            s: arrays.array_value(p, table)
            for s, p in zip(found.symbols, found.momenta, strict=True)
        }
        back = np.array([arrays.array_value(v, table)[0] for v in found.velocities])
        if np.allclose(back, scene.velocities, rtol=1e-8, atol=1e-10):
            hamiltonian = found.hamiltonian
        else:
            lost = say("no_inverse")
    return FreeLagrangian(tree, hamiltonian, dict(constants), source, lost=lost)


def _of_own_masses(
    lagrangian: ex.Expression, coordinates: Sequence[str], values: Mapping[str, float]
) -> ex.Expression | None:
    """H = sum p^2/(2 m) + V, where L is the sum of one m v^2/2 for each coordinate, m a constant
    that is not 0, and of terms without velocities; None for other L.
    """
    speeds = dict(zip(map(ex.Velocity, coordinates), coordinates, strict=True))
    momenta = [ex.Symbol(f"p_{name}") for name in coordinates]
    constants: dict[ex.Expression, float] = {ex.Symbol(name): values[name] for name in values}
    if ex.holds(lagrangian, *momenta):
        return None
    masses = dict[str, ex.Expression](dict.fromkeys(coordinates, ex.ZERO))
    potential = list[ex.Expression]()
    for whole in ex.summands(lagrangian):
        if not ex.has(whole, ex.Velocity):
            potential.append(ex.negate(whole))
            continue
        for term in ex.summands(collecting.collect(whole)):
            squares = [f for f in ex.factors_of(term) if ex.has(f, ex.Velocity)]
            match [pair for f in squares for pair in ex.powers_of(f)]:
                case [(ex.Velocity() as speed, 2)]:
                    mass = ex.multiply(
                        2 * ex.ONE, *(f for f in ex.factors_of(term) if f not in squares)
                    )
                    masses[speeds[speed]] = masses[speeds[speed]] + mass
                case _:
                    return None
    try:
        known = [arrays.array_value(mass, constants)[0] for mass in masses.values()]
    except arrays.NoValue:  # one that varies
        return None
    if not all(np.isfinite(known)) or 0.0 in known:
        return None
    pairs = zip(momenta, masses.values(), strict=True)
    return ex.add(*(p**2 / (2 * mass) for p, mass in pairs), *potential)


def _question(scene: Scene, which: str) -> dict[str, Any]:
    """The question to the solver: the equations of the scene, or those of an associated system with
    its effects.
    """
    accelerations = scene.accelerations
    if accelerations is None:
        try:
            assert scene.lagrangian is not None
            parts = geometry(
                NonholonomicSystem(
                    scene.coordinates, scene.lagrangian, scene.constraints, tuple(scene.values)
                )
            )
            member, reason = recognized(parts)
            motion = eliminate_multipliers(
                parts, member.frame if member is not None else frames(parts)[0]
            )
            found = associated(
                motion, member, reason, next(kind for kind in KINDS if kind == which)
            )
        except InputError as error:
            raise Unavailable(
                f"The {which} associated system is not defined: {error.detail}"
            ) from None
        except TooLarge as error:
            raise Unavailable(
                f"The {which} associated system is too large to be written out: {error}."
            ) from None
        if found.system is None:
            raise Unavailable(found.explanation)
        accelerations = found.system.accelerations
    if scene.accelerations is not None:  # an L(t, q, q') serves, too; `conserved` asks the same
        return _of_equations(scene, accelerations, None)
    # Of an associated system the form of the paper is wanted, and nothing besides.
    return _of_equations(scene, accelerations, False) | {"first_integrals": False}


def _of_equations(
    scene: Scene, accelerations: Sequence[ex.Expression], time_dependent: bool | None
) -> dict[str, Any]:
    texts = {
        name: printing.to_text(f) for name, f in zip(scene.coordinates, accelerations, strict=True)
    }
    used = {node.name for f in accelerations for node in ex.walk(f) if isinstance(node, ex.Symbol)}
    named = {
        "coordinates": list(scene.coordinates),
        "parameters": [name for name in scene.values if name in used],
    }
    return {**named, "equations": texts, "time_dependent_lagrangian": time_dependent}


@lru_cache(maxsize=16)
def _answer(question: str, seconds: float) -> dict[str, Any] | str:
    """The answer of the solver, or the reason why there is none; the solver is imported where it is
    asked only.
    """
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.service.documents import documents

    try:
        return documents.solve_system(json.loads(question), SolveOptions(time_limit=seconds))
    except InverseServiceError as error:
        return error.detail


def conserved(
    system: scene_reading.MechanicalSystem, derived: derivation.Derived
) -> tuple[Observable, ...]:
    """Constants of the motion if the energy is not one: found by the solver for the equations that
    are integrated.
    """
    scene = derived.scene
    if len(scene.coordinates) > MOST_CONSERVED:
        return ()
    try:
        accelerations = derived.accelerations()
    except Unavailable:
        return ()
    jumps = switching_functions(accelerations, scene.coordinates)
    if scene.constraints or scene.contacts or jumps or any(event.acts for event in scene.events):
        return ()
    given = scene.accelerations is not None
    question = _of_equations(scene, accelerations, None)
    result = _answer(json.dumps(question), SOLVE_SECONDS if given else CONSERVED_SECONDS)
    if isinstance(result, str) or result.get(
        "integrals"
    ):  # a scene knows no functions by their derivatives
        return ()
    found = []
    for one in (result.get("first_integrals") or [])[:MOST_CONSERVED]:
        name = "H" if one["name"] == "energy" else one["name"]
        found.append(Observable(name, scene_reading.formula(one["text"], system.names, "/system")))
    return tuple(found)
