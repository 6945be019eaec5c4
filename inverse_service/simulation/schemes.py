"""Methods as programs: the discrete equations of integrators/ with the formulas of a problem in
them.

First the methods on (q, p), then those on (q, v): Runge-Kutta, Gauss-Legendre, and those that
choose their steps. Last the formulas watched at every step, so that a run ends where its formulas
end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inverse_service.errors import InputError
from inverse_service.integrators import trajectory, variational as discrete
from inverse_service.integrators.method_table import (
    GAUSS_LEGENDRE,
    POINT_METHODS,
    RODAS,
    TABLEAUX,
    Tableau,
    order_of_pair,
)
from inverse_service.integrators.variational import Vector
from inverse_service.kernels.codegen import program as programs, symengine_trees as se
from inverse_service.kernels.codegen.symengine_trees import (
    HALF,
    ONE,
    STEP,
    ZERO,
    Formula,
    number,
    symbol,
)
from inverse_service.simulation import scene_graph
from inverse_service.simulation.numeric_formulas import MOMENT, Denominator, Formulas, put
from inverse_service.simulation.scene_data import MethodChoice, Observation
from inverse_service.simulation.sentences import say

SMALLEST_NORM = 1e-200  # its product with the fourth power of a tolerance does not underflow
AT_REST = 1e60  # (1e30)^2: a force so much smaller than its change in a step is none; beside a pole it is all that acts
# From one coordinate to the next: what is farther from the one that is driven moves by so high a
# power of a step that short ones are below FAR_END.
PASSED_ON = 2
LATER = 0.382  # of a step of the grid, no common multiple of a period
ROUND_OFF = 1e-15  # of the terms of a force
# Steps far above the round-off of t: of t, or, in a short step of the grid, of that; never less of
# t.
SHORT, SHORT_OF_GRID, SHORTEST = 1e-8, 1e-3, 1e-12
FAR_END = 1e-20  # of the whole; less than any unit of a coordinate differs from that of another
RANK_LOST, LOST = "the rank of the constraints, det(w(q) w(q)^T)", 1e-12
MAP_LIMIT = 1e-12
SMALLEST = 1e-300


def alpha_of(choice: MethodChoice) -> Formula:
    """alpha as a number where it changes the structure (0, 1/2, 1), else a name that gets its value
    at run time.
    """
    special = {0.0: number(0), 0.5: HALF, 1.0: number(1)}
    return special.get(choice.alpha, se.ALPHA)


def parts_of(choice: MethodChoice) -> tuple[Formula, ...]:
    alpha = alpha_of(choice)
    return (alpha, 1 - alpha) if choice.symmetrised and alpha != HALF else (alpha,)


def program_of(
    formulas: Formulas, choice: MethodChoice, observation: Observation
) -> programs.Program:
    """The step of the method; it contains only the requested parts."""
    builders: dict[str, Callable[[Formulas, MethodChoice, Observation], programs.Program]] = {
        "raw": _raw, "verlet": _verlet, "hamiltonian": _hamiltonian, "nonholonomic": nonholonomic, "modified": modified,
        "runge_kutta": runge_kutta, "reference": gauss_legendre, "adaptive": adaptive, "stiff": stiff,
    }  # fmt: skip
    name = choice.form if choice.method == "variational" else choice.method
    if name == "hamiltonian" and scene_graph.uses_own_lagrangian(formulas.problem):
        name = "raw"  # with weight alpha both forms are the same equations, and this one has half as many unknowns
    return builders[name](formulas, choice, observation)


def _verlet(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Stormer and Verlet: half a drift, a kick, half a drift; one evaluation of the force, nothing
    implicit.
    """
    q, p, d = map(f.symbols, "qpd")
    if len(f.forces) or not _is_separable(f.hamiltonian, q, p):
        raise InputError(say("not_separable"))
    middle = MOMENT + STEP / 2
    slope_q, slope_p = (f.gradient(f.hamiltonian, letter, "p", middle) for letter in "qp")
    before, statements = slope_p(q, p), list[programs.Statement]()
    half = q + before * (STEP / 2)
    found = slope_q(half, p)
    kicked = np.where(found == ZERO, ZERO, _named(statements, found, "g") * -STEP)
    # Written as h T_p(p) + (h/2)(T_p(p') - T_p(p)): what does not need the force can be computed
    # before it.
    gains = [gain.expand() for gain in slope_p(q, p + kicked) - before]
    _named(statements, before * STEP + np.array(gains) * (STEP / 2), "d")
    point = f.point(middle, q=half, p=p)
    watches = [*domain_watches(f, point), *range_watches(f, HALF)]
    return _program(f, choice, observation, statements, [*d, *kicked], watches)


def _is_separable(hamiltonian: Formula, q: Vector, p: Vector) -> bool:
    """Whether H = T(p) + V(q)."""
    slopes = (hamiltonian.diff(x) for x in q)
    mixed = ((slope, slope.free_symbols.intersection(p)) for slope in slopes)
    return all(slope.diff(y).expand() == ZERO for slope, names in mixed for y in names)


def _hamiltonian(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    q, p, d, e = map(f.symbols, "qpde")
    alpha = alpha_of(choice)
    slope_q, slope_p = (f.gradient(f.hamiltonian, letter, "p", moment_at(alpha)) for letter in "qp")
    slope_q = f.held(slope_q, slope_p, moment_at(alpha))
    if len(parts_of(choice)) == 2:
        both = (e, f.symbols("g"))
        equations, pushes = discrete.symmetrised_hamiltonian_step(
            q, p, d, both, STEP, alpha, slope_q, slope_p
        )
        unknowns, watched = [*d, *e, *both[1]], p + e
    else:
        equations, pushes = discrete.hamiltonian_step(q, p, d, e, STEP, alpha, slope_q, slope_p)
        unknowns, watched = [*d, *e], p + e * (1 - alpha)
    point = f.point(moment_at(alpha), q=q + d * alpha, p=watched)
    guards = root_guards(f, point) if choice.guard else []
    watches = [
        *force_walls(f, choice),
        *velocity_watches(f, alpha),
        *domain_watches(f, point),
        *range_watches(f, alpha),
        *guards,
    ]
    # The determinant of a mean over two points has additional zeros, which the factors of L~
    # describe better.
    guarded = choice.guard and len(parts_of(choice)) == 1
    return _program(
        f, choice, observation, _solved(f, equations, unknowns, guarded), [*d, *pushes], watches
    )


def _raw(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    q, p, d = map(f.symbols, "qpd")
    parts = parts_of(choice)
    slope_q, slope_v = (
        f.gradient(f.free_lagrangian, letter, moment=moment_at(parts[0])) for letter in "qv"
    )
    slope_q = f.pushed(slope_q, moment_at(parts[0]))
    equations, pushes = discrete.raw_step(q, p, d, STEP, parts, slope_q, slope_v)
    points, is_own = (
        [discrete_point(f, part) for part in parts],
        scene_graph.uses_own_lagrangian(f.problem),
    )
    remedy = where_it_ends(f) if is_own else "use the Hamiltonian form"
    walls = [*f.denominators, *(f.singular_velocities if is_own and choice.guard else ())]
    watches = [one for at in points for one in sign_watches(walls, at, remedy)]
    watches += [*force_walls(f, choice), *range_watches(f, parts[0])]
    # Near A_beta = 0 the determinant itself has no limit; there the watches above are the guard.
    guarded = choice.guard and (is_own or all(one.moves for one in f.denominators))
    return _program(
        f, choice, observation, _solved(f, equations, d, guarded), [*d, *pushes], watches
    )


def nonholonomic(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    q, p, d = map(f.symbols, "qpd")
    m, parts = np.array([symbol(f"m{a}") for a in range(len(f.forms))]), parts_of(choice)
    slope_q, slope_v = (
        f.gradient(f.lagrangian, letter, moment=moment_at(parts[0])) for letter in "qv"
    )
    slope_q = f.pushed(slope_q, moment_at(parts[0]))
    slopes, forms = (slope_q, slope_v), (f.forms_at, f.drifts_at)
    equations, pushes = discrete.lagrange_dalembert_step(q, p, d, m, STEP, parts, *slopes, *forms)
    walls = f.walls_of([f.problem.lagrangian]) if choice.guard else []
    watches = sign_watches(walls, discrete_point(f, parts[0]), say("regular_motion"))
    watches += force_walls(f, choice)
    statements = _solved(f, equations, [*d, *m], choice.guard)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def modified(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """L~ for the base coordinates with the discrete constraints put in, so that factors A_alpha
    cancel. Symmetrised, the constraints hold only in the mean, so no factors cancel.
    """
    if any(drift != ZERO for drift in f.drifts):
        raise InputError(
            "The modified method requires constraints that are homogeneous in the velocities."
        )
    q, p, d, alpha, parts = *map(f.symbols, "qpd"), alpha_of(choice), parts_of(choice)
    base = [k for k in range(f.size) if k not in f.dependent]
    watches = range_watches(f, alpha)
    if len(parts) == 2 or any(
        se.contains(value, q[k]) for value in f.dependent.values() for k in f.dependent
    ):
        slope_q, slope_v = (f.gradient(f.free_lagrangian, letter) for letter in "qv")
        free, kicks = discrete.raw_step(q, p, d, STEP, parts, slope_q, slope_v)
        held = sum(f.forms_at(q + part * d) @ d for part in parts) / len(parts)
        statements, pushes = _solved(f, [*free[base], *held], d), kicks[base]
        watches += [
            one
            for part in parts
            for one in sign_watches(f.denominators, discrete_point(f, part), say("smaller_step"))
        ]
    else:
        pair = discrete_point(f, alpha)
        by_q, by_v = (
            np.array(
                [
                    f.free_lagrangian.diff(x).subs(f.on_constraints).subs(pair)
                    for x in f.symbols(letter)[base]
                ]
            )
            for letter in "qv"
        )
        equations = [*(p[base] * STEP - by_v * STEP + by_q * ((1 - alpha) * STEP**2))]
        equations += [d[k] - STEP * value.subs(pair) for k, value in f.dependent.items()]
        statements, pushes = _solved(f, equations, d, poles=True), by_q * STEP
        watches += velocity_watches(f, alpha)
    return _program(f, choice, observation, statements, [*d, *pushes], watches, base)


def _solved(
    f: Formulas,
    equations: Sequence[Formula],
    unknowns: Sequence[Formula],
    guarded: bool = False,
    poles: bool = False,
) -> Sequence[programs.Statement]:
    """The statements of an implicit step, d being increments of q, e and g of p."""
    scales = {
        f"{letter}{k}": f"{of}{k}"
        for k in range(f.size)
        for letter, of in (("d", "q"), ("e", "p"), ("g", "p"))
    }
    return programs.plan(equations, [str(name) for name in unknowns], scales, guarded, poles)


def _program(
    f: Formulas, choice: MethodChoice, observation: Observation, statements: Sequence[programs.Statement],
    changes: Sequence[Formula] | Vector, watches: Sequence[programs.Watch], momenta: Sequence[int] | None = None,
    forces: int | None = None, error: Formula | None = None, order: int = 0, instant: Formula | None = None,
) -> programs.Program:  # fmt: skip
    """The program of a method, with a clock where t matters, and without what nothing needs.

    Methods on (q, p) observe at discrete points; `momenta` are the coordinates whose momentum is a
    state variable.
    """
    n, by_points = f.size, choice.method in POINT_METHODS
    watches = [
        *watches,
        *rank_watches(f, f.symbols("q") + np.array(changes[:n]), divides=by_points),
    ]
    places = range(n) if momenta is None else momenta
    carried = [*(f"q{k}" for k in range(n)), *(f"{'v' if by_points else 'p'}{k}" for k in places)]
    points = [{}] if by_points else [discrete_point(f, part) for part in parts_of(choice)]
    observed = []
    for item in observation:
        formula = se.translate(item.expression, f.table) + (f.energy if item.with_energy else ZERO)
        observed.append(
            (item.name, sum((formula.subs(point) for point in points), ZERO) / len(points))
        )
    if f.problem.depends_on_time or any(se.contains(formula, MOMENT) for _, formula in observed):
        carried, changes = [*carried, str(MOMENT)], [*changes, STEP]
    known = {symbol(s.name): s.formula for s in statements if isinstance(s, programs.Assign)}
    updates = tuple(None if known.get(change, change) == ZERO else change for change in changes)
    needed = [formula for formula in (*updates, error, instant) if formula is not None]
    needed += [entry for watch in watches for entry in watch.entries]
    needed += [formula for _, formula in observed]
    if forces is None:
        forces = int(all(isinstance(statement, programs.Assign) for statement in statements))
    return programs.Program(
        state=tuple(carried), arguments=("h", "a", *f.parameters), statements=programs.used_only(statements, needed),
        updates=updates, watches=tuple(watches), observed=tuple(observed), forces=forces, error=error, order=order,
        instant=instant,
    )  # fmt: skip


def runge_kutta(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Explicit steps of one length."""
    tableau = TABLEAUX[choice.order]
    statements, forces, changes, _ = _explicit(f, tableau, choice.guard)
    # Stages on both sides of a jump of the force can cancel, so that no step ever ends beyond it.
    names = [symbol(f"x{len(forces) - 1}_{k}") for k in range(2 * f.size)]
    last = f.point(
        moment_at(number(round(float(tableau.nodes[-1]), 12))), q=names[: f.size], v=names[f.size :]
    )
    watches = (
        [*motion_walls(f, point_after(f, changes)), *motion_walls(f, last)] if choice.guard else []
    )
    return _program(f, choice, observation, statements, changes, watches, forces=len(forces))


def adaptive(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Steps as long as the estimate of their error allows; the tolerance is the argument `a`."""
    tableau = TABLEAUX[order_of_pair(choice.order)]
    statements, forces, changes, errors = _explicit(f, tableau)
    first = np.concatenate([f.symbols("v"), forces[0]]) * STEP
    error, *coarse = (_squared_norm(f, changes, first, one, 0) for one in errors)
    if coarse:
        error = error**2 / (error + coarse[0] / 100 + number(SMALLEST_NORM))
    count = len(forces)
    return _program(
        f,
        choice,
        observation,
        statements,
        changes,
        [],
        None,
        count,
        error,
        tableau.falls,
        _squared_instant(f, forces[0], errors[0]),
    )


def _squared_norm(
    f: Formulas, changes: Vector, first: Vector, errors: Vector, stage: int | str,
    driven: Driven | None = None,
) -> Formula:  # fmt: skip
    """The mean of (error/scale)^2, each variable measured by its size and its change in a step: no
    unit enters.

    Where all of these vanish at once, a thousandth of what the other of q and v makes of it in a
    step of the grid, or what forces that t drives give it in one if there are none at its start.
    The influence of one end of a chain on the other within a step is of higher order than the
    error, so that no step is short enough for it: 1e-20 of the whole counts as well. Where terms of
    a force cancel at rest, the round-off that they leave changes with t: a step's share of it is no
    error.
    """
    q, v = map(f.symbols, "qv")
    others = np.concatenate([(v * se.WHOLE_STEP) ** 2, (q / se.WHOLE_STEP) ** 2])
    if driven is not None:
        gained = _gained_from_rest(driven)
        others = others + np.concatenate([gained * se.WHOLE_STEP**2, gained])
    sizes = np.concatenate([q, v]) ** 2 + changes**2 + first**2 + others / 1_000_000
    terms = _sizes_of_terms(f, first[f.size :] / STEP, stage)
    if f.problem.depends_on_time or (terms != ZERO).any():
        noise = terms * (number(ROUND_OFF) * STEP / se.ALPHA) ** 2
        if f.problem.depends_on_time:
            # What one coordinate does not know, those that it drives from rest do not know either.
            gains = changes[f.size :] ** 2
            noise = noise + gains * noise.sum() / (gains.sum() + number(SMALLEST))
        sizes = sizes + np.concatenate([noise * STEP**2, noise])
    wholes = np.repeat([sizes[: f.size].sum(), sizes[f.size :].sum()], f.size)
    shares = errors**2 / (sizes + wholes * number(FAR_END**2) + number(SMALLEST))
    return shares.sum() / (2 * f.size * se.ALPHA**2)


class Driven(NamedTuple):
    """What t makes of accelerations in a step of the grid: those at its start and later, at the
    same q and v, and their derivatives (n, 2 n) by these.
    """

    first: Vector
    later: Vector
    by_state: Vector


def _gained_from_rest(driven: Driven) -> Vector:
    """The squares of the velocities that a step of the grid gives what has no acceleration at its
    start, (n,): by forces that t drives, and by what these move.
    """
    now, whole = driven.first**2, se.WHOLE_STEP**2
    by_places, by_velocities = np.split(driven.by_state**2, 2, axis=1)
    for slopes in (by_places, by_velocities):
        np.fill_diagonal(slopes, ZERO)  # none drives itself
    gained, found, at_rest = (driven.later - driven.first) ** 2 * whole, now * ZERO, AT_REST
    for _ in range(1 + PASSED_ON):
        scale = gained + now * whole * number(at_rest) + number(SMALLEST)
        found = found + gained**2 / scale
        # Beside a pole the slopes are as large as the force, each time that one drives another.
        gained, at_rest = (
            (by_places @ (gained * whole) + by_velocities @ gained) * whole,
            at_rest * AT_REST,
        )
    return found


def _squared_instant(f: Formulas, accelerations: Vector, errors: Vector) -> Formula:
    """The square of a step that is refused at a pole: all of its stages are at one place and time
    to round-off, but its force changes the velocity, and is not known. Shorter ones would be
    accepted, and pass the pole.

        INSTANT^2 (t^2 + |q|^2/|v|^2)

    with for |v| at least CREEPING of |q| in a step of the grid. It is as much less as |h a| is less
    than FELT of the velocity, as at the jump of a bounded force, and as the errors, (2 n,), are
    less than UNKNOWN of |h a|, as where a late time has round-off.
    """
    q2, v2, a2, e2 = (
        sum((x**2 for x in part), ZERO)
        for part in (f.symbols("q"), f.symbols("v"), accelerations, errors[f.size :])
    )
    slow = q2 * number(programs.CREEPING**2) / se.WHOLE_STEP**2
    span = q2 / (v2 + slow + number(SMALLEST))
    if f.problem.depends_on_time:
        span = span + MOMENT**2
    gained = STEP**2 * a2
    felt = gained / (gained + number(programs.FELT**2) * (v2 + slow) + number(SMALLEST))
    unknown = e2 / (e2 + number(programs.UNKNOWN**2) * gained + number(SMALLEST))
    return number(programs.INSTANT**2) * span * felt * unknown


def _sizes_of_terms(f: Formulas, accelerations: Vector, stage: int | str) -> Vector:
    """The sum of the squares of the terms of each acceleration, 0 where it is one term or does not
    change with t: those of a given formula at the end of a step, those of the linear equation
    M_kk a_k = b_k - sum_j M_kj a_j by its solution at the start, multipliers among the a_j. A row
    w a = 0 of numbers carries those of each a_j to the others. With t, also (t b_t)^2 at the start.
    """
    masses, coupled = np.full(f.size, ONE), np.full(f.size, ZERO)
    rows: Vector = np.empty((0, f.size), dtype=object)
    if f.problem.accelerations is not None:
        forces = f.accelerations
    else:
        matrix, right = f.linear_motion
        forces, masses = right[: f.size], np.diagonal(matrix)[: f.size]
        others = [symbol(f"m{stage}_{k}") for k in range(len(right) - f.size)]
        square, rows = matrix[: f.size].copy(), matrix[f.size :, : f.size]
        np.fill_diagonal(square, ZERO)
        solution = np.concatenate([accelerations, others])
        coupled = np.array([sum((row * solution) ** 2, ZERO) for row in square])
    if f.problem.depends_on_time:
        ends, masses = (put(part, {MOMENT: moment_at(ONE)}) for part in (forces, masses))
        coupled = coupled + [_squared_terms(end) if _is_sum(end) else ZERO for end in ends]
        # t is known to its own round-off, and so is a force that passes 0 there. Steps that are
        # near that round-off themselves lead to a pole in t, where it excuses nothing.
        late, near = (number(SHORT) * MOMENT) ** 2, (number(SHORT_OF_GRID) * se.WHOLE_STEP) ** 2
        short = late * near / (late + near + number(SMALLEST)) + (number(SHORTEST) * MOMENT) ** 2
        share = STEP**2 / (STEP**2 + short)
        coupled = coupled + [share * (MOMENT * se.slope(force, MOMENT)) ** 2 for force in forces]
    pairs = zip(coupled, masses, strict=True)
    terms = np.array([part / mass**2 if mass != ZERO else ZERO for part, mass in pairs])
    for row in rows:
        known = [k for k, entry in enumerate(row) if entry != ZERO and not entry.free_symbols]
        whole = sum((row[k] ** 2 * terms[k] for k in known), ZERO)
        for k in known:
            terms[k] = whole / row[k] ** 2
    return terms


def _is_sum(formula: Formula) -> bool:
    """Whether it is a sum, or a product with one among its factors."""
    return formula.is_Add or (formula.is_Mul and any(map(_is_sum, formula.args)))


def _squared_terms(formula: Formula) -> Formula:
    """The sum of the squares of the terms, multiplied out."""
    if formula.is_Add:
        return sum(map(_squared_terms, formula.args), ZERO)
    return math.prod(map(_squared_terms, formula.args), start=ONE) if formula.is_Mul else formula**2


def stiff(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """RODAS: six linear systems with one matrix in each step, n by n once the velocities are
    eliminated.

    u/gamma - h J u - h f - sum c_ij u_j - h^2 d_i f_t for u = (g, w), the increments of q and of v
    in a stage.
    """
    n, (q, v) = f.size, map(f.symbols, "qv")
    state, statements = np.concatenate([q, v]), list[programs.Statement]()
    first, slopes, drift = _slopes(f, statements)
    names = np.array([[symbol(f"j{k}_{x}") for x in state] for k in range(n)])
    statements += [
        programs.Assign(str(a), b)
        for a, b in zip(names.flat, slopes.flat, strict=True)
        if b != ZERO
    ]
    jacobian = np.where(slopes == ZERO, ZERO, names)
    stages: list[Vector] = []
    is_linear = f.problem.accelerations is None
    for k, node in enumerate(RODAS.nodes):
        u = np.concatenate([[symbol(f"{letter}{k}_{i}") for i in range(n)] for letter in "gw"])
        place, mixed = (
            state + _combined(RODAS.rows[k], stages, 2 * n),
            _combined(RODAS.mixed[k], stages, 2 * n),
        )
        at = f.point(moment_at(number(node)), q=place[:n], v=place[n:])
        force = _accelerations(f, statements, at, k) if is_linear else put(f.accelerations, at)
        rates = np.concatenate([u[n:] + place[n:], jacobian @ u + force]) * STEP
        rates[n:] = rates[n:] + drift * (STEP**2 * number(RODAS.slopes[k]))
        blocks = programs.plan(
            u / number(RODAS.gamma) - rates - mixed, [str(name) for name in u], {}
        )
        statements += [
            replace(one, tested=False) if isinstance(one, programs.Solve) else one for one in blocks
        ]
        stages.append(u)
    changes = _combined(RODAS.rows[-1], stages, 2 * n) + stages[-1]
    # A force that begins as t^2 from rest has an error of the size of its change in a step of any
    # length.
    then, later = {MOMENT: MOMENT + LATER * se.WHOLE_STEP}, None
    if f.problem.depends_on_time:
        later = _accelerations(f, statements, then, "l") if is_linear else put(first, then)
    whole = np.concatenate([v, first]) * STEP
    driven = None if later is None else Driven(first, later, jacobian)
    error = _squared_norm(f, changes, whole, stages[-1], "s", driven)
    return _program(
        f,
        choice,
        observation,
        statements,
        changes,
        [],
        None,
        len(stages),
        error,
        RODAS.order,
        _squared_instant(f, first, stages[-1]),
    )


class ExplicitStep(NamedTuple):
    """A step of an explicit method."""

    statements: list[programs.Statement]
    forces: list[Vector]
    increments: Vector
    errors: list[Vector]


def _explicit(f: Formulas, tableau: Tableau, watched: bool = False) -> ExplicitStep:
    """Statements, the forces of each stage, the increments of q and v, and estimates of their
    errors.

    Where forces do not depend on velocities, those of the stages are left out. `watched`: the
    determinant of the linear equations for the accelerations must keep its sign.
    """
    n, (q, v) = f.size, map(f.symbols, "qv")
    statements: list[programs.Statement] = []
    speeds: list[Vector] = []
    forces: list[Vector] = []

    def moved(drift: float, weights: trajectory.Array, places: trajectory.Array) -> Vector:
        moves = _combined(weights, speeds, n)
        if not f.depends_on_velocities:
            moves = v * number(drift) + _combined(places, forces, n) * STEP
        return np.concatenate([moves, _combined(weights, forces, n)]) * STEP

    stages = zip(tableau.nodes.tolist(), tableau.rows, tableau.places, strict=True)
    for stage, (node, row, places) in enumerate(stages):
        point = _named(statements, np.concatenate([q, v]) + moved(node, row, places), f"x{stage}_")
        speeds.append(point[n:])
        at = f.point(moment_at(number(node)), q=point[:n], v=point[n:])
        forces.append(_accelerations(f, statements, at, stage, watched and stage == 0))
    errors = [
        moved(0.0, row, places)
        for row, places in zip(tableau.errors, tableau.end_errors, strict=True)
    ]
    return ExplicitStep(statements, forces, moved(1.0, tableau.weights, tableau.ends), errors)


def _accelerations(
    f: Formulas,
    statements: list[programs.Statement],
    at: dict[Formula, Formula],
    stage: int | str,
    tested: bool = False,
) -> Vector:
    """Those at a stage: of given formulas, or the solution of linear equations together with the
    multipliers.
    """
    if f.problem.accelerations is not None:
        return _named(statements, put(f.accelerations, at), f"f{stage}_")
    matrix, right = (put(part, at) for part in f.linear_motion)
    found = _solution(statements, matrix, right, f.size, stage, tested)
    return found[: f.size]


def _solution(
    statements: list[programs.Statement],
    matrix: Vector,
    right: Vector,
    size: int,
    stage: int | str,
    tested: bool = False,
) -> Vector:
    """The names of `size` accelerations and of multipliers that solve linear equations, (n + m,), 0
    for those that are.
    """
    names = [
        *(f"f{stage}_{k}" for k in range(size)),
        *(f"m{stage}_{k}" for k in range(len(right) - size)),
    ]
    found = [*programs.linear_blocks(matrix, right, names, tested)]
    statements += found
    zero = {one.name for one in found if isinstance(one, programs.Assign) and one.formula == ZERO}
    return np.array([ZERO if name in zero else symbol(name) for name in names])


class Slopes(NamedTuple):
    """q'' and its derivatives."""

    accelerations: Vector
    by_state: Vector
    by_time: Vector


def _slopes(f: Formulas, statements: list[programs.Statement]) -> Slopes:
    """(q'', its derivatives by q and v, (n, 2 n), and by t) at the start of a step: those of A x =
    b have the same matrix, A x_s = b_s - A_s x.
    """
    n, state = f.size, (*f.symbols("q"), *f.symbols("v"), MOMENT)
    if f.problem.accelerations is not None:
        found = np.array([[se.slope(force, x) for x in state] for force in f.accelerations])
        return Slopes(f.accelerations, found[:, : 2 * n], found[:, 2 * n])
    matrix, right = f.linear_motion
    own = _solution(statements, matrix, right, n, "s")
    columns = []
    for k, x in enumerate(state):
        rates = np.array([[se.slope(entry, x) for entry in row] for row in matrix])
        left = np.array([se.slope(entry, x) for entry in right]) - rates @ own
        is_zero = all(entry == ZERO for entry in left)
        columns.append(
            np.full(n, ZERO) if is_zero else _solution(statements, matrix, left, n, f"s{k}")[:n]
        )
    found = np.array(columns).T
    return Slopes(own[:n], found[:, : 2 * n], found[:, 2 * n])


def _combined(weights: Iterable[float], stages: Iterable[Vector], size: int) -> Vector:
    """The sum of what the stages so far have, with their weights."""
    pairs = zip(weights, stages, strict=False)
    return sum(
        (one * number(float(weight)) for weight, one in pairs if weight), np.full(size, ZERO)
    )


def _named(
    statements: list[programs.Statement], formulas: Sequence[Formula], prefix: str
) -> Vector:
    """Each formula computed once, under a name."""
    statements += [programs.Assign(f"{prefix}{k}", formula) for k, formula in enumerate(formulas)]
    return np.array([symbol(f"{prefix}{k}") for k in range(len(formulas))])


def gauss_legendre(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Unknowns u = h q'' at the stages, by fixed-point iteration."""
    tableau, n, (q, v) = GAUSS_LEGENDRE, f.size, map(f.symbols, "qv")
    u = np.array([[symbol(f"u{j}_{k}") for k in range(n)] for j in range(len(tableau.nodes))])
    residuals, inner = list[Formula](), list[programs.Solve]()
    for stage, (own, node, row, places) in enumerate(
        zip(u, tableau.nodes.tolist(), tableau.rows, tableau.places, strict=True)
    ):
        moved = v * number(node) + _combined(places, u, n)
        at = f.point(moment_at(number(node)), q=q + moved * STEP, v=v + _combined(row, u, n))
        if f.problem.accelerations is not None:
            force = put(f.accelerations, at)
        else:
            solved = list[programs.Statement]()
            force = _accelerations(f, solved, at, stage)
            inner += (one for one in solved if isinstance(one, programs.Solve))
            # What has a formula is put in, so that products with h are written in one piece.
            known = dict[Formula, Formula]()
            for one in solved:
                if isinstance(one, programs.Assign):
                    known[symbol(one.name)] = one.formula.subs(known)
            force = put(force, known)
        residuals += [*(own - force * STEP)]
    scales = tuple(f"v{k}" for _ in u for k in range(n))
    guesses = [_combined(row, u, n) for row in _continued(tableau.nodes)]
    block = programs.Solve(
        tuple(map(str, u.flat)), tuple(residuals), (), False, scales,
        inner=tuple(inner), guesses=tuple(np.concatenate(guesses)),
    )  # fmt: skip
    moves = v + _combined(tableau.ends, u, n)
    changes = np.concatenate([moves * STEP, _combined(tableau.weights, u, n)])
    watches = motion_walls(f, point_after(f, changes)) if choice.guard else []
    return _program(f, choice, observation, (block,), changes, watches)


def _continued(nodes: trajectory.Array) -> trajectory.Array:
    """The values in the next step of the polynomial through those at the nodes of one, (s, s)."""
    to, others = 1 + nodes[:, None], ~np.eye(len(nodes), dtype=bool)
    return np.array(
        [((to - nodes[own]) / (nodes[k] - nodes[own])).prod(axis=1) for k, own in enumerate(others)]
    ).T


def where_it_ends(f: Formulas) -> str:
    """The remedy where L~ ends: the motion ends too if L~ is the Lagrangian of the scene itself."""
    return (
        say("regular_motion")
        if f.problem.free_lagrangian == f.problem.lagrangian
        else say("other_lagrangian")
    )


def moment_at(part: Formula) -> Formula:
    return MOMENT + part * STEP


def discrete_point(f: Formulas, alpha: Formula) -> dict[Formula, Formula]:
    """q, v and t of the discrete Lagrangian."""
    return f.point(
        moment_at(alpha), q=f.symbols("q") + f.symbols("d") * alpha, v=f.symbols("d") / STEP
    )


def sign_watches(
    walls: Iterable[Denominator], point: Mapping[Formula, Formula], remedy: str
) -> list[programs.Watch]:
    """The walls at a point of every step: none may pass 0."""
    return [
        programs.Watch("sign", wall.formula.subs(point), wall.text, remedy, begin=wall.formula)
        for wall in walls
    ]


def force_walls(f: Formulas, choice: MethodChoice) -> list[programs.Watch]:
    """Poles, ends and kinks of additional forces, watched at the point where they act."""
    walls = f.walls_of(f.problem.forces) if choice.guard else []
    points = [discrete_point(f, part) for part in parts_of(choice)]
    return [one for at in points for one in sign_watches(walls, at, say("regular_motion"))]


def velocity_watches(f: Formulas, alpha: Formula) -> list[programs.Watch]:
    """Velocities in a denominator of L~ must not pass 0; if only positions occur there, H~ is
    smooth.
    """
    moving = (denominator for denominator in f.denominators if denominator.moves)
    return sign_watches(moving, discrete_point(f, alpha), where_it_ends(f))


def domain_watches(f: Formulas, point: dict[Formula, Formula]) -> list[programs.Watch]:
    """H~ must stay in the domain where it is the Hamiltonian of L~: its poles and ends, and p =
    dL~/dv(q, H_p).
    """
    watches = sign_watches(f.walls_of([f.problem.free_hamiltonian]), point, where_it_ends(f))
    if f.momenta_may_fail:
        size = sum((p**2 for p in f.symbols("p")), ONE)
        defect = sum((one**2 for one in f.momenta_may_fail), number(0)) / size
        text = "p - dL/dv at the velocities that the Hamiltonian gives"
        watches.append(
            programs.Watch("map", defect.subs(point), text, say("other_lagrangian"), MAP_LIMIT)
        )
    return watches


def range_watches(f: Formulas, alpha: Formula) -> list[programs.Watch]:
    """L~ must stay where it has the motion: at the end of the step, and at its discrete point if
    velocities matter.
    """
    points = [discrete_point(f, alpha if end.moves else ONE) for end in f.domain]
    pairs = zip(f.domain, points, strict=True)
    return [
        programs.Watch("domain", end.formula.subs(point), end.text, say("other_motion"))
        for end, point in pairs
    ]


def rank_watches(
    f: Formulas, place: Sequence[Formula], divides: bool = False
) -> list[programs.Watch]:
    """det(w w_next^T) > 0, w = omega(q_k): at a loss of rank in between the span of the constraints
    turns round. Methods that integrate accelerations, which divide by det(w w^T), also end where
    that sinks to LOST of its first size. No pivot of a step shows it where a step begins on one
    side and ends on the other: both are regular, and what lies between is no motion.
    """
    if not len(f.forms):
        return []
    after = f.forms_at(place).T
    turned, size = (tuple(map(tuple, rows @ after)) for rows in (f.forms, after.T))
    if not any(entry.free_symbols for row in turned for entry in row):
        return []
    found = [programs.Watch("positive", turned, say("rank_between_steps"), say("rank_remedy"))]
    return (
        [*found, programs.Watch("rank", size, RANK_LOST, say("rank_remedy"), LOST)]
        if divides
        else found
    )


def root_guards(f: Formulas, point: dict[Formula, Formula]) -> list[programs.Watch]:
    """h |d2H/dq_i dp_i| < 1 where it is not constant: for the class of the paper this is h |G'(r1)|
    < 1.
    """
    names = {*f.symbols("q"), *f.symbols("p")}
    watches = []
    for k, coordinate in enumerate(f.problem.coordinates):
        mixed = f.hamiltonian.diff(symbol(f"q{k}")).diff(symbol(f"p{k}"))
        if mixed.free_symbols & names:
            text = f"h*|d2H/d{coordinate} dp_{coordinate}|"
            watches.append(
                programs.Watch("bound", STEP * mixed.subs(point), text, say("smaller_or_constants"))
            )
    return watches


def point_after(f: Formulas, changes: Vector) -> dict[Formula, Formula]:
    """q, v and t at the end of a step."""
    return f.point(
        moment_at(ONE), q=f.symbols("q") + changes[: f.size], v=f.symbols("v") + changes[f.size :]
    )


def motion_walls(f: Formulas, point: dict[Formula, Formula]) -> list[programs.Watch]:
    """Poles, ends and kinks of the accelerations, watched at a point of q, v and t.

    Beyond one, even a smooth motion has lost its accuracy, because small errors were divided by a
    vanishing factor.
    """
    return sign_watches(f.walls_of(f.given_motion), point, say("regular_motion"))
