"""The observed quantities of a run: formulas for the kernel, and numbers and columns from the
recorded points.

energy        E = v L_v - L of the original system; max_energy_error = max |E_k/E_0 - 1|, E_0 that
of the initial
              data, at the recorded points with their velocities (those of the momenta), for every
              method alike; max_discrete_energy_error at the point and velocity of the discrete
              Lagrangian, over all steps
constraints   max_constraint = max |w((1-alpha) q_k + alpha q_(k+1)) (q_(k+1) - q_k)/h| over all
steps, and
              max_constraint_at_points = max |w(q_k) v_k| with v_k from the momenta of a variational
              method
action        the integral of L from the start, by cubics through the recorded points
momenta       the momenta that the method's Lagrangian conserves (cyclic coordinates): max |p_k -
p_0| phase         angle by which the chords of the path are ahead of those of the true path
(`circles`) error         max |q_k - q(t_k)| against the exact solution or the reference, coordinate
by coordinate

Velocities at the points come from the momenta of the method and are as accurate as it is: v =
dH~/dp(q_k, p_k) of the variational method; of the nonholonomic one v = g^-1 (p_k - b) with L_v = g
v + b, put on the constraints, as p_k still holds half a reaction. Methods of order 2 without
momenta have differences of the positions about each point.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from inverse_service.errors import InverseServiceError
from inverse_service.expressions import arrays, calculus, collecting, printing, tree as ex
from inverse_service.integrators import method_table
from inverse_service.integrators.trajectory import Array, Trajectory
from inverse_service.simulation import (
    accelerations as accelerating,
    circles,
    derivation,
    initial,
    numeric_formulas as nf,
    scene_data as data,
    scene_graph,
)
from inverse_service.simulation.sentences import say

ENERGY_START = "energy_of_the_start"
ROUND_OFF = 1e-14


def greatest(values: Array) -> float | None:
    """The greatest absolute value; None where one is not finite, or there is none."""
    largest = float(np.abs(values).max()) if len(values) else np.inf
    return largest if np.isfinite(largest) else None


def lagrangian_of_energy(scene: data.Scene) -> ex.Expression | None:
    """The Lagrangian of the scene; of a system given by its equations the one that was found."""
    return (
        scene.found.lagrangian
        if scene.lagrangian is None and scene.found is not None
        else scene.lagrangian
    )


def energies(scene: data.Scene, table: Mapping[ex.Expression, Any]) -> tuple[Array, Array]:
    """E and |v dL/dv|/2, the kinetic energy where L has masses, at the points of a table, (m,)
    each.
    """
    lagrangian, names = lagrangian_of_energy(scene), scene.coordinates
    assert lagrangian is not None
    graph, inputs, count = scene_graph.on_table(names, lagrangian, (), table)
    found, powers = graph.values([graph.energy, graph.power], inputs, count)
    return found, np.abs(powers) / 2


def start_energy(scene: data.Scene) -> float | None:
    """E_0 of the initial data; None for a system without a Lagrangian."""
    if lagrangian_of_energy(scene) is None:
        return None
    return float(without_noise(*energies(scene, initial.at_start(scene, scene.values)))[0])


def without_noise(energies: Array, kinetic: Array) -> Array:
    """The energies, 0 where they are what the round-off of their parts leaves, as for a parabolic
    orbit.
    """
    return np.where(np.abs(energies) <= ROUND_OFF * kinetic, 0.0, energies)


def observables(scene: data.Scene, choice: data.MethodChoice) -> data.Observation:
    """The formulas that the kernel of a method evaluates at every step: only those of the observed
    quantities.
    """
    found = []
    if (
        "energy" in scene.observe
        and scene.lagrangian is not None
        and has_discrete_energy(scene, choice)
    ):
        found.append(data.Observable("energy_error", -ex.Symbol(ENERGY_START), with_energy=True))
    if "constraints" in scene.observe:
        found += [data.Observable(f"constraint_{k}", w) for k, w in enumerate(scene.constraints, 1)]
    return tuple(found)


def observed_problem(
    scene: data.Scene, problem: data.Problem, choice: data.MethodChoice
) -> tuple[data.Problem, data.Observation]:  # fmt: skip
    """The problem with the parameters that the observed formulas need, and the recorded
    formulas.
    """
    observation = observables(scene, choice)
    formulas = [one.expression for one in observation]
    if any(one.with_energy for one in observation):
        problem = replace(problem, parameters=(*problem.parameters, ENERGY_START))
    return problem.with_used_parameters(formulas), observation


def has_discrete_energy(scene: data.Scene, choice: data.MethodChoice) -> bool:
    """Whether the energy of the discrete Lagrangian is one quantity: of methods of order 2 that
    have one.
    """
    return choice.method in method_table.GEOMETRIC and choice.order <= 2 and scene.found is None


class Beginning(NamedTuple):
    """The values of the parameters, and the start."""

    values: dict[str, float]
    start: data.Start


def beginning(
    scene: data.Scene, requested: data.Requested, free: data.FreeLagrangian | None
) -> Beginning:
    """Numbers of all parameters, the free constants of the method and the energy to compare with
    among them, and the start: momenta where L~ gives them itself (they may be 0/0 in the
    velocities).
    """
    values = dict(scene.values) | (dict(free.constants) if free else {}) | dict(requested.constants)
    if "energy" in scene.observe and scene.lagrangian is not None:
        values[ENERGY_START] = start_energy(scene) or 0.0
    momenta = None
    if free is not None and free.start_momenta is not None and requested.convention == "momenta":
        found = free.start_momenta(scene.positions, scene.velocities, values)
        momenta = found if np.isfinite(found).all() else None
    return Beginning(
        values, data.Start(scene.positions, scene.velocities, momenta, requested.convention)
    )


def why_energy_varies(scene: data.Scene) -> str | None:
    """A sentence if the energy of the scene is not a constant of the motion."""
    lagrangian = lagrangian_of_energy(scene)
    if lagrangian is not None and ex.holds(lagrangian, ex.TIME):
        return say("energy_with_time")
    if any(drift != ex.ZERO for drift in initial.drifts_of(scene)):
        return say("energy_with_drifts")
    if any(event.acts for event in scene.events):
        return say("energy_with_events")
    if scene.contacts:
        return say("energy_with_contacts")
    return say("energy_with_forces") if scene.forces else None


def factor_of_time(scene: data.Scene, times: Array) -> Array | None:
    """f(t)/f(t_0), (m,), of an L = f(t) L_0(q, q'), whose energy is f times T + V; None for any
    other L.
    """
    lagrangian = lagrangian_of_energy(scene)
    factors = lagrangian.factors if isinstance(lagrangian, ex.Product) else ()
    timed = [factor for factor in factors if ex.holds(factor, ex.TIME)]
    if not timed or any(ex.holds(factor, *nf.state_names(scene.coordinates)) for factor in timed):
        return None
    table: dict[ex.Expression, Any] = {
        ex.Symbol(name): value for name, value in scene.values.items()
    }
    table[ex.TIME] = np.concatenate([[scene.grid.begin], times])
    found = arrays.array_value(ex.multiply(*timed), table)
    return np.asarray(found[1:] / found[0])


def point_velocities(
    scene: data.Scene,
    problem: data.Problem,
    method: str,
    trajectory: Trajectory,
    values: Mapping[str, Any],
) -> Array | None:
    """(m, n) from the momenta, or None where the method has none or their velocities have no
    formula or no value.
    """
    momenta, names = trajectory.momenta, scene.coordinates
    if momenta is None:
        return None
    if method == "nonholonomic" or (
        method == "variational" and scene_graph.uses_own_lagrangian(problem)
    ):
        graph = scene_graph.graph_of(problem)
        return graph.velocities(trajectory.positions, momenta, values, trajectory.times)
    if method != "variational" or problem.free_hamiltonian is None:
        return None
    rest = np.zeros_like(trajectory.positions)
    table = nf.arrays_by_name(names, trajectory.positions, rest, values, trajectory.times)
    symbols = [ex.Symbol(f"p_{name}") for name in names]
    terms = dict[ex.Symbol, list[ex.Expression]]()
    for term in ex.summands(problem.free_hamiltonian):
        for p in set(symbols).intersection(ex.walk(term)):
            terms.setdefault(p, []).append(term)
    slopes = [calculus.differentiate(ex.add(*terms.get(p, ())), p) for p in symbols]
    return np.column_stack(
        arrays.array_values(slopes, table | dict(zip(symbols, momenta.T, strict=True)))
    )


@dataclass(frozen=True)
class Observed:
    """An observed run: `problem` is None for the exact solution, `values` hold the free constants
    too. A run `in_pieces` has the velocities of its points, and no momenta.
    """

    scene: data.Scene
    requested: data.Requested
    trajectory: Trajectory
    problem: data.Problem | None
    values: Mapping[str, Any]
    truth: data.Truth | str | None
    in_pieces: bool = False

    @cached_property
    def velocities(self) -> Array | None:
        """(m, n) at the recorded points: from the momenta, else differences of order 2; None where
        it has neither.
        """
        at, grid = self.trajectory, self.scene.grid
        if self.problem is None or self.requested.alpha is None or self.in_pieces:
            return at.velocities
        found = point_velocities(self.scene, self.problem, self.requested.method, at, self.values)
        if found is None and grid.record_every == 1 and len(at.times) > 2:
            found = np.gradient(at.positions, grid.step, axis=0, edge_order=2)
        return found

    @cached_property
    def table(self) -> dict[ex.Expression, Any]:
        """The names of all formulas with their values at the recorded points."""
        at = self.trajectory
        return nf.arrays_by_name(
            self.scene.coordinates, at.positions, self.velocities, self.values, at.times
        )

    def values_of(self, *formulas: ex.Expression) -> list[Array]:
        """The formulas at the recorded points, (m,) each."""
        return arrays.array_values(formulas, self.table)

    @cached_property
    def true(self) -> Array | None:
        """The true positions at the recorded points, (m, n)."""
        if not isinstance(self.truth, data.Truth):
            return None
        times = self.truth.times  # the same or more
        places = np.searchsorted(
            times, self.trajectory.times - 0.5 * np.diff(times).min(initial=np.inf)
        )
        found: Array = self.truth.positions[np.clip(places, 0, len(times) - 1)]
        return found


Observations = tuple[
    dict[str, Any], dict[str, Array]
]  # numbers, and columns at the recorded points


def observed_quantities(run: Observed, seconds: dict[str, float]) -> Observations:
    """Numbers and columns of every observed quantity, none of any other; `seconds` gets what each
    took.
    """
    numbers: dict[str, Any] = {}
    series: dict[str, Array] = {}
    wanted = {name: QUANTITIES[name] for name in run.scene.observe if name in QUANTITIES}
    for name, quantity in (wanted | ({"own observables": OWN} if run.scene.own else {})).items():
        with derivation.timed(seconds, name):
            found, columns = quantity.observe(run)
        if quantity is not OWN and (
            unnamed := [key for key in columns if not _is_of(quantity, key, run.scene)]
        ):
            raise AssertionError(f"QUANTITIES does not name the columns {unnamed} of {name}")
        numbers |= found
        series |= columns
    return numbers, series


def _own(run: Observed) -> Observations:
    """The observables given by formula, at the recorded points: first, last, least and greatest
    values.
    """
    numbers: dict[str, Any] = {}
    series: dict[str, Array] = {}
    for one in run.scene.own:
        try:
            (column,) = run.values_of(one.expression)
        except arrays.NoValue:
            numbers[one.name] = {"note": say("no_velocities")}
            continue
        series[one.name] = column
        numbers[one.name] = {"first": float(column[0]), "last": float(column[-1])}
        if note := _without_value(column, run.trajectory.times):
            numbers[one.name] |= {"note": note}
        else:
            numbers[one.name] |= {"least": float(column.min()), "greatest": float(column.max())}
    return {"observables": numbers}, series


def _without_value(values: Array, times: Array) -> str | None:
    """At how many points a formula has no value; None where it has one at all of them."""
    lost = ~np.isfinite(values)
    if not lost.any():
        return None
    return say("no_value_at_points", lost.sum(), len(values), times[lost.argmax()])


def _mean(values: Array, times: Array) -> float:
    """The mean over the time; of a single point its value."""
    if len(values) == 1:
        return float(values[0])
    return float(_integral(values, times)[-1] / (times[-1] - times[0]))


def _integral(values: Array, times: Array) -> Array:
    """The integral from the start, (m,), by the cubic through each point and its neighbors: order 4
    in the spacing.
    """
    steps = np.diff(times)
    parts = steps * (values[1:] + values[:-1]) / 2
    if len(values) > 2:
        parts -= steps**2 * np.diff(np.gradient(values, times, edge_order=2)) / 12
    return np.concatenate([[0.0], np.cumsum(parts)])


def _constraints(run: Observed) -> Observations:
    columns = {
        key: column
        for key, column in run.trajectory.series.items()
        if key.startswith("constraint_")
    }
    sizes = [size for key, size in run.trajectory.maxima.items() if key.startswith("constraint_")]
    if not sizes:
        return {"max_constraint": None, "constraints_note": say("no_constraints")}, columns
    numbers: dict[str, Any] = {"max_constraint": max(sizes)}
    if (
        run.requested.method == "variational"
        and run.scene.constraints
        and run.velocities is not None
    ):
        numbers["max_constraint_at_points"] = constraint_at_points(run)
    return numbers, columns


def constraint_at_points(run: Observed) -> float | None:
    """max |w(q_k) v_k| of all constraints over the recorded points."""
    return greatest(np.concatenate(run.values_of(*run.scene.constraints)))


def _momenta(run: Observed) -> Observations:
    """The drift of those of the cyclic coordinates of the method's Lagrangian, which are
    constant.
    """
    momenta, scene, problem = run.trajectory.momenta, run.scene, run.problem
    lagrangian = None if problem is None else problem.free_lagrangian or problem.lagrangian
    if problem is None or momenta is None or lagrangian is None:
        return {"max_momentum_drift": None, "momenta_note": say("no_momenta_of_method")}, {}
    constrained = problem.constraints if problem.free_lagrangian is None else ()
    kept = []
    for k, name in enumerate(scene.coordinates):
        slopes = [calculus.differentiate(lagrangian, ex.Symbol(name)), *scene.forces[k : k + 1]]
        slopes += [calculus.differentiate(w, ex.Velocity(name)) for w in constrained]
        if all(slope == ex.ZERO for slope in slopes):
            kept.append(float(np.abs(momenta[:, k] - momenta[0, k]).max()))
    columns = columns_of(scene, momenta, "p_")
    if not kept:
        return {"max_momentum_drift": None, "momenta_note": say("no_cyclic_coordinate")}, columns
    return {"max_momentum_drift": max(kept)}, columns


def _velocities(run: Observed) -> Observations:
    if run.velocities is None:
        return {"velocities_note": say("no_velocities")}, {}
    return {}, columns_of(run.scene, run.velocities, "v_")


def _action(run: Observed) -> Observations:
    """The action, the integral of the L of the scene along the recorded points."""
    scene = run.scene
    if scene.lagrangian is None:
        return {"action": None, "action_note": say("no_action")}, {}
    if scene.contacts or any(event.acts for event in scene.events):
        return {"action": None, "action_note": say("action_with_jumps")}, {}
    if run.velocities is None:
        return {"action": None, "action_note": say("no_velocities")}, {}
    (values,) = run.values_of(scene.lagrangian)
    column = _integral(values, run.trajectory.times)
    if note := _without_value(values, run.trajectory.times):
        return {"action": None, "action_note": note}, {"action": column}
    return {"action": float(column[-1])}, {"action": column}


def _energy_parts(run: Observed) -> Observations:
    """The energies v dP/dv - P of the terms P of L with and without masses, which add up to E, and
    their means over the time, those of the virial theorem.
    """
    scene, times = run.scene, run.trajectory.times
    if scene.lagrangian is None:
        return {"energy_parts": None, "energy_parts_note": say("no_energy_parts")}, {}
    if run.velocities is None:
        return {"energy_parts": None, "energy_parts_note": say("no_velocities")}, {}
    terms = derivation.lagrangian_parts(scene.lagrangian, scene.coordinates)
    masses, speeds = terms[derivation.KINETIC], [ex.Velocity(name) for name in scene.coordinates]
    powers = [v * calculus.differentiate(masses, v) for v in speeds]
    kinetic, potential = run.values_of(ex.add(*powers, -masses), -terms[derivation.POTENTIAL])
    columns = {"kinetic_part": kinetic, "potential_part": potential}
    if scene.contacts or any(event.acts for event in scene.events):
        why = say("energy_parts_with_jumps")
        return {"energy_parts": None, "energy_parts_note": why}, columns
    if note := _without_value(kinetic + potential, times):
        return {"energy_parts": None, "energy_parts_note": note}, columns
    means = {
        f"mean_{name.removesuffix('_part')}": _mean(column, times)
        for name, column in columns.items()
    }
    return {"energy_parts": means}, columns


def _matching_circle(run: Observed) -> Observations:
    scene, true = run.scene, run.true
    if scene.circle is None:
        return {"circle": None, "circle_note": say("no_circle")}, {}
    pair, every = list(scene.circle), scene.grid.record_every
    reach = float(np.hypot(*scene.velocities[pair])) * abs(scene.grid.step) * every
    exact = None if true is None else true[:, pair]
    return circles.circle_numbers(run.trajectory.positions[:, pair], exact, every, reach), {}


def _constraint_forces(run: Observed) -> Observations:
    """The multipliers lambda_a of the constraints and the forces w^T lambda that they exert, at the
    recorded points.
    """
    scene = run.scene

    def missing(note: str) -> Observations:
        return {"constraint_forces": None, "constraint_forces_note": note}, {}

    if run.velocities is None:
        return missing(say("no_velocities"))
    if scene.lagrangian is None or not scene.constraints:
        return missing(say("no_constraints"))
    problem = data.Problem(
        scene.coordinates,
        tuple(scene.values),
        scene.lagrangian,
        scene.constraints,
        forces=scene.forces,
    )
    graph, at = scene_graph.graph_of(problem), run.trajectory
    inputs = graph.inputs(at.positions, run.velocities, scene.values, at.times)
    multipliers = graph.solution(inputs, len(at.times))[:, graph.size :].T
    columns = {f"lambda_{a}": column for a, column in enumerate(multipliers, 1)}
    for name, row in zip(
        scene.coordinates, zip(*initial.forms_of(scene), strict=True), strict=True
    ):
        columns[f"force_{name}"] = np.sum(np.multiply(run.values_of(*row), multipliers), axis=0)
    formulas = {}
    with suppress(InverseServiceError):  # too long to be written
        found = accelerating.formulas_of(scene)[1]
        formulas = {f"lambda_{a}": printing.to_text(one) for a, one in enumerate(found, 1)}
    largest = {name: greatest(column) for name, column in columns.items()}
    return {"constraint_forces": {"formulas": formulas, "greatest": largest}}, columns


def _contact_forces(run: Observed) -> Observations:
    """The normal force and the friction of each contact at the recorded points, 0 where it does not
    press.
    """
    if not run.scene.contacts:
        return {"contact_forces": None, "contact_forces_note": say("no_contacts")}, {}
    names = [f"{kind}_{one.name}" for one in run.scene.contacts for kind in ("normal", "friction")]
    columns = {name: run.trajectory.series[name] for name in names if name in run.trajectory.series}
    return {
        "contact_forces": {"greatest": {name: greatest(column) for name, column in columns.items()}}
    }, columns


def _energy(run: Observed) -> Observations:
    """The energy at the recorded points for every method; that of the discrete Lagrangian, where
    there is one, under a separate name.
    """
    scene = run.scene
    start = start_energy(replace(scene, values=run.values))
    if start is None:
        return {"max_energy_error": None, "energy_note": say("no_energy")}, {}
    numbers, series = _discrete_energy(run, start)
    numbers |= {"energy_start": start, "max_energy_error": None}
    note = why_energy_varies(scene)
    if run.velocities is None:
        return numbers | {"energy_note": note or say("no_velocities")}, series
    points, _ = energies(scene, run.table)
    series["energy"] = points
    if not note and (wall := end_of_energy(run)):
        note = say("energy_ends", wall)
    if not note:
        numbers["max_energy_error"] = greatest(np.abs(points - start) / (abs(start) or 1.0))
        absolute = {"energy_error_is": "absolute, because the energy of the start is 0"}
        return numbers | ({} if start else absolute), series
    kept, drifts = _conserved(run)
    numbers["energy_note"] = (
        f"{note} " + say("see_conserved", scene.conserved[0].name) if kept else note
    )
    if (factor := factor_of_time(scene, run.trajectory.times)) is not None:
        series["mechanical_energy"] = points / factor
    if scene.forces:
        # What is at rest takes no power, whatever static friction is there: sign(0) has no value.
        pairs = zip(run.values_of(*scene.forces), run.velocities.T, strict=True)
        series["power"] = np.sum([np.where(v == 0, 0.0, force * v) for force, v in pairs], axis=0)
        series["work"] = work = _integral(series["power"], run.trajectory.times)
        numbers |= {"work": float(work[-1]), "max_balance_error": greatest(points - start - work)}
    return numbers | kept, series | drifts


def end_of_energy(run: Observed) -> str | None:
    """How the Lagrangian that was found stops being one of the motion at the points; None where it
    does not.

    It is divided by, or takes roots or logarithms of, what passes through 0, its domain ends, or
    its equations are others. The energy of the other side may differ from this one by anything.
    """
    scene = run.scene
    if scene.found is None:
        return None
    own = nf.walls(scene.found.lagrangian, scene.coordinates)
    for wall in dict.fromkeys((*own, *scene.found.domain)):
        (values,) = run.values_of(wall)
        if not (np.isfinite(values).all() and (values.min() > 0 or values.max() < 0)):
            return f"ends where {printing.to_text(wall)} = 0, and the motion passes there"
    given = scene.accelerations or ()
    apart = accelerating.distance_of_motion(
        scene.found.lagrangian, scene.coordinates, given, run.table
    )
    return (
        "does not give the motion of the equations everywhere"
        if (apart > accelerating.NOTICED).any()
        else None
    )


def _conserved(run: Observed) -> Observations:
    """The drift of each constant of the motion that was found, from the start of each part of the
    way on which its formula is one: where it passes a pole, as an arctangent of x'/x at x = 0, it
    begins again.
    """
    found: dict[str, Any] = {}
    series: dict[str, Array] = {}
    for k, one in enumerate(run.scene.conserved, 1):
        ends = nf.walls(one.expression, run.scene.coordinates)
        values, *walls = run.values_of(one.expression, *ends)
        turned = [np.diff(np.sign(wall)) != 0 for wall in walls]
        cuts = np.flatnonzero(np.any([*turned, np.zeros(len(values) - 1, dtype=bool)], axis=0)) + 1
        pieces = np.split(values, cuts)
        # Round-off is measured by the sizes of the terms: a momentum may be 0 all the time.
        terms = run.values_of(*ex.summands(collecting.collect(one.expression)))
        size = float(np.nanmax(np.abs(terms).sum(axis=0), initial=0.0)) or 1.0
        drift = np.concatenate([piece - piece[0] for piece in pieces]) / size
        text = printing.to_text(one.expression)
        found[one.name] = {"text": text, "max_error": greatest(drift), "parts": len(pieces)}
        series[f"conserved_{k}"] = drift
    return ({"conserved": found} if found else {}), series


def _discrete_energy(run: Observed, start: float) -> Observations:
    """E at the point and velocity of the discrete Lagrangian, the paper's: of methods of order 2
    that have one.
    """
    requested = run.requested
    if (
        not has_discrete_energy(run.scene, requested.choice)
        or "energy_error" not in run.trajectory.series
    ):
        return {}, {}
    series = {"discrete_energy": run.trajectory.series["energy_error"] + start}
    if why_energy_varies(run.scene):
        return {}, series
    return {
        "max_discrete_energy_error": run.trajectory.maxima["energy_error"] / (abs(start) or 1.0)
    }, series


def _error(run: Observed) -> Observations:
    """The greatest and the last distance from the true positions, with a bound of how far these are
    off themselves.

    Where the truth is lost before the run ends there is no greatest error of the run, and
    `error_until` holds that of the part before.
    """
    truth = run.truth
    if run.true is None or not isinstance(truth, data.Truth):
        return {"max_error": None, "error_note": truth or say("nothing_to_compare")}, {}
    differences = np.abs(run.trajectory.positions - run.true)
    distances: Array = differences.max(axis=1)
    known = int(np.isfinite(distances).sum())
    bound, before = float(truth.bounds[max(known - 1, 0)]), greatest(distances[:known])
    each = {name: greatest(column) for name, column in columns_of(run.scene, differences).items()}
    numbers = {
        "max_error": greatest(distances), "final_error": float(distances[-1]), "error_each": each,
        "error_against": truth.against, "error_uncertainty": bound,
    }  # fmt: skip
    if known and (before or 0.0) <= bound:
        numbers["error_note"] = f"Within the uncertainty of the true motion: at most {bound:.2g}."
    if known < len(distances):
        until = {"time": float(truth.times[known - 1]), "max_error": before}
        numbers |= {"error_note": truth.reason, "error_until": until, "error_uncertainty": None}
    return numbers, {"error": distances}


def _phase(run: Observed) -> Observations:
    if run.true is None:
        return {"max_phase_error": None, "phase_note": run.truth or say("nothing_to_compare")}, {}
    if run.scene.circle is None:
        return {"max_phase_error": None, "phase_note": say("no_circle")}, {}
    pair = list(run.scene.circle)
    angles = circles.phase_error(run.trajectory.positions[:, pair], run.true[:, pair])
    return {"max_phase_error": greatest(angles), "final_phase_error": float(angles[-1])}, {
        "phase_error": angles
    }


@dataclass(frozen=True, slots=True)
class Quantity:
    """What computes a quantity, the names of the columns that it may have (nothing else may have
    them), and the numbers of a run that a table shows: key, or outer.inner, to heading.
    """

    observe: Callable[[Observed], Observations]
    columns: tuple[str, ...] = ()
    numbers: Mapping[str, str] = field(default_factory=dict)


QUANTITIES: dict[str, Quantity] = {
    "energy": Quantity(
        _energy,
        ("energy", "mechanical_energy", "discrete_energy", "power", "work", "conserved_{number}"),
        {"max_energy_error": "energy error"},
    ),
    "constraints": Quantity(
        _constraints, ("constraint_{constraint}",), {"max_constraint": "constraint"}
    ),
    "action": Quantity(_action, ("action",), {"action": "action"}),
    "energy_parts": Quantity(
        _energy_parts,
        ("kinetic_part", "potential_part"),
        {
            "energy_parts.mean_kinetic": "mean kinetic energy",
            "energy_parts.mean_potential": "mean potential energy",
        },
    ),
    "momenta": Quantity(_momenta, ("p_{coordinate}",), {"max_momentum_drift": "momentum drift"}),
    "velocities": Quantity(_velocities, ("v_{coordinate}",)),
    "constraint_forces": Quantity(
        _constraint_forces, ("lambda_{constraint}", "force_{coordinate}")
    ),
    "contact_forces": Quantity(_contact_forces, ("normal_{contact}", "friction_{contact}")),
    "phase": Quantity(_phase, ("phase_error",), {"max_phase_error": "phase error"}),
    "error": Quantity(
        _error, ("error",), {"estimated_error": "estimated error", "max_error": "error"}
    ),
    "matching_circle": Quantity(
        _matching_circle,
        numbers={
            "circle.radius_first": "radius, first circle",
            "circle.radius_last": "radius, last circle",
            "circle.centre_drift": "drift of the center",
        },
    ),
}
OWN = Quantity(_own)  # under the names that the scene gives them


def names_of_columns(
    coordinates: Sequence[str],
    constraints: int,
    contacts: Sequence[str] = (),
    of: Iterable[Quantity] | None = None,
) -> re.Pattern[str]:
    """The names of the columns that quantities (None: all, and the time) may have in a scene of
    this size.
    """
    templates = [
        name for one in (QUANTITIES.values() if of is None else of) for name in one.columns
    ]
    numbers = "|".join(map(str, range(1, constraints + 1))) or "(?!)"
    places = {
        "coordinate": f"({'|'.join(map(re.escape, coordinates))})",
        "constraint": f"({numbers})",
    }
    places["contact"] = f"({'|'.join(map(re.escape, contacts)) or '(?!)'})"
    every = [template.format(**places, number="[1-9][0-9]*") for template in templates]
    return re.compile("|".join([*every, *(["t"] if of is None else [])]) or "(?!)")


def _is_of(quantity: Quantity, name: str, scene: data.Scene) -> bool:
    contacts = [one.name for one in scene.contacts]
    names = names_of_columns(scene.coordinates, len(scene.constraints), contacts, [quantity])
    return names.fullmatch(name) is not None


class LastPoint(NamedTuple):
    """From where another run can continue."""

    time: float
    position: Array
    velocity: Array | None


def last_point(run: Observed) -> LastPoint:
    """(t, q, v) at the end of the run, from which another can continue; v is None if the method has
    none.
    """
    at = run.trajectory
    velocities = replace(run, trajectory=at.part(slice(-3, None))).velocities
    return LastPoint(
        float(at.times[-1]), at.positions[-1], None if velocities is None else velocities[-1]
    )


def columns_of(scene: data.Scene, table: Array, prefix: str = "") -> dict[str, Any]:
    """The entries of a table (m, n), or of one row, by coordinate."""
    return {f"{prefix}{name}": table[..., k] for k, name in enumerate(scene.coordinates)}
