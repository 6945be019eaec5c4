"""Methods as programs: the discrete equations of integrators/ with the formulas of a problem in them.

First the methods on (q, p), then those on (q, v): Runge-Kutta, Gauss-Legendre, and those that choose their steps. Last
the formulas watched at every step, so that a run ends where its formulas end.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from inverse_service.errors import InputError
from inverse_service.integrators.method_table import GAUSS_LEGENDRE, PAIRS, RODAS, TABLEAUX, Tableau
from inverse_service.integrators.trajectory import Array
from inverse_service.integrators.variational import (
    between,
    hamiltonian_step,
    lagrange_dalembert_step,
    raw_step,
    symmetrised_hamiltonian_step,
)
from inverse_service.kernels.codegen import program as programs
from inverse_service.kernels.codegen.symengine_trees import (
    ALPHA,
    HALF,
    ONE,
    STEP,
    WHOLE_STEP,
    Formula,
    contains,
    number,
    slope,
    symbol,
    translate,
)
from inverse_service.simulation.numeric_formulas import MOMENT, Denominator, Formulas
from inverse_service.simulation.scene_data import MethodChoice, Observable, Observation

NOT_SEPARABLE = (
    "Stormer-Verlet requires H = T(p) + V(q): constant masses and no magnetic or additional forces. Use variational."
)
SMALLEST_NORM = 1e-200  # its product with the fourth power of a tolerance does not underflow
LATER = 0.382  # of a step of the grid, no common multiple of a period
ROUND_OFF = 1e-15  # of the terms of a force
FAR_END = 1e-20  # of the whole; less than any unit of a coordinate differs from that of another
Stages = list[tuple[list[Formula], list[Formula]]]
SMALLER_STEP = "take a smaller step"
GUARD_REMEDY = "take a smaller step, or smaller free constants"
OTHER_LAGRANGIAN = "give another free_lagrangian, or use `adaptive`"
OTHER_MOTION = "use `adaptive`, or restart there with the free_lagrangian that is valid there"
RANK = "the rank of the constraints, det(w(q) w(q_next)^T)"
RANK_LOST, LOST = "the rank of the constraints, det(w(q) w(q)^T)", 1e-12
RANK_REMEDY = "begin elsewhere, or divide the constraints by the factor that vanishes"
MAP_LIMIT = 1e-12
REGULAR_MOTION = "take a smaller step or `adaptive`; where the forces have a pole, stop before"
SMALLEST = 1e-300


def alpha_of(choice: MethodChoice) -> Formula:
    """alpha as a number where it changes the structure (0, 1/2, 1), else a name that gets its value at run time."""
    special = {0.0: number(0), 0.5: HALF, 1.0: number(1)}
    return special.get(choice.alpha, ALPHA)


def parts_of(choice: MethodChoice) -> tuple[Formula, ...]:
    alpha = alpha_of(choice)
    return (alpha, 1 - alpha) if choice.symmetrised and alpha != HALF else (alpha,)


def program_of(formulas: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """The step of the method; it contains only the requested parts."""
    builders: dict[str, Callable[[Formulas, MethodChoice, Observation], programs.Program]] = {
        "variational": variational,
        "nonholonomic": nonholonomic,
        "modified": modified,
        "runge_kutta": runge_kutta,
        "reference": gauss_legendre,
        "adaptive": adaptive,
        "stiff": stiff,
    }
    return builders[choice.method](formulas, choice, observation)


def variational(formulas: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    forms = {"raw": _raw, "verlet": _verlet, "hamiltonian": _hamiltonian}
    return forms[choice.form](formulas, choice, observation)


def _verlet(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Stormer and Verlet: half a drift, a kick, half a drift; one evaluation of the force, nothing implicit."""
    q, p = f.symbols("q"), f.symbols("p")
    if f.forces or any(f.hamiltonian.diff(x).diff(y).expand() != number(0) for x in q for y in p):
        raise InputError(NOT_SEPARABLE)
    middle = MOMENT + STEP / 2
    slope_q, slope_p = (f.gradient(f.hamiltonian, letter, "q", "p", middle) for letter in "qp")
    before = slope_p(q, p)
    half = [x + STEP / 2 * rate for x, rate in zip(q, before, strict=True)]
    found = slope_q(half, p)
    forces = [symbol(f"g{k}") for k in range(f.size)]
    kicked = [number(0) if g == number(0) else -STEP * name for name, g in zip(forces, found, strict=True)]
    # Written as h T_p(p) + (h/2)(T_p(p') - T_p(p)): what does not need the force can be computed before it.
    gains = [(b - a).expand() for a, b in zip(before, slope_p(q, between(p, kicked, 1)), strict=True)]
    moves = [STEP * a + STEP / 2 * gain for a, gain in zip(before, gains, strict=True)]
    statements = [programs.Assign(str(name), force) for name, force in zip(forces, found, strict=True)]
    statements += [programs.Assign(str(name), move) for name, move in zip(f.symbols("d"), moves, strict=True)]
    point = dict(zip([*q, *p, MOMENT], [*half, *p, middle], strict=True))
    watches = [*domain_watches(f, point), *range_watches(f, HALF)]
    return _program(f, choice, observation, tuple(statements), [*f.symbols("d"), *kicked], watches)


def _hamiltonian(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    q, p, d = f.symbols("q"), f.symbols("p"), f.symbols("d")
    alpha = alpha_of(choice)
    slope_q, slope_p = (f.gradient(f.hamiltonian, letter, "q", "p", moment_at(alpha)) for letter in "qp")
    slope_q = f.held(slope_q, slope_p, moment_at(alpha))
    if len(parts_of(choice)) == 2:
        e = (f.symbols("e"), f.symbols("g"))
        equations, pushes = symmetrised_hamiltonian_step(q, p, d, e, STEP, alpha, slope_q, slope_p)
        unknowns, watched = [*d, *e[0], *e[1]], between(p, e[0], 1)
    else:
        equations, pushes = hamiltonian_step(q, p, d, f.symbols("e"), STEP, alpha, slope_q, slope_p)
        unknowns, watched = [*d, *f.symbols("e")], between(p, f.symbols("e"), 1 - alpha)
    point = dict(zip([*q, *p, MOMENT], [*between(q, d, alpha), *watched, moment_at(alpha)], strict=True))
    guards = root_guards(f, point) if choice.guard else []
    watches = [*velocity_watches(f, q, d, alpha), *domain_watches(f, point), *range_watches(f, alpha), *guards]
    # The determinant of a mean over two points has additional zeros, which the factors of L~ describe better.
    guarded = choice.guard and len(parts_of(choice)) == 1
    statements = _solved(f, equations, unknowns, guarded)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def _raw(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    q, p, d = f.symbols("q"), f.symbols("p"), f.symbols("d")
    parts = parts_of(choice)
    slope_q, slope_v = (f.gradient(f.free_lagrangian, letter, moment=moment_at(parts[0])) for letter in "qv")
    slope_q = f.pushed(slope_q, moment_at(parts[0]))
    equations, pushes = raw_step(q, p, d, STEP, parts, slope_q, slope_v)
    points = [discrete_point(f, q, d, part) for part in parts]
    watches = [one for at in points for one in sign_watches(f.denominators, at, "use the Hamiltonian form")]
    watches += range_watches(f, parts[0])
    # Near A_beta = 0 the determinant itself has no limit; there the watches above are the guard.
    guarded = choice.guard and all(one.moves for one in f.denominators)
    statements = _solved(f, equations, d, guarded)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def nonholonomic(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    q, p, d = f.symbols("q"), f.symbols("p"), f.symbols("d")
    m = [symbol(f"m{a}") for a in range(len(f.forms))]
    slope_q, slope_v = (f.gradient(f.lagrangian, letter, moment=moment_at(parts_of(choice)[0])) for letter in "qv")
    slope_q = f.pushed(slope_q, moment_at(parts_of(choice)[0]))
    equations, pushes = lagrange_dalembert_step(
        q, p, d, m, STEP, parts_of(choice), slope_q, slope_v, f.forms_at, f.drifts_at
    )
    statements = _solved(f, equations, [*d, *m], choice.guard)
    walls = f.walls_of([f.problem.lagrangian]) if choice.guard else []
    watches = sign_watches(walls, discrete_point(f, q, d, alpha_of(choice)), REGULAR_MOTION)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def modified(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """L~ for the base coordinates with the discrete constraints put in, so that factors A_alpha cancel."""
    if any(drift != number(0) for drift in f.drifts):
        raise InputError("The modified method requires constraints that are homogeneous in the velocities.")
    q, d, alpha = f.symbols("q"), f.symbols("d"), alpha_of(choice)
    base = [k for k in range(f.size) if k not in f.dependent]
    if len(parts_of(choice)) == 2 or any(contains(value, q[k]) for value in f.dependent.values() for k in f.dependent):
        return _modified_in_full(f, choice, observation, base)
    pair = discrete_point(f, q, d, alpha)
    slopes = {k: (_on_constraints(f, f.free_lagrangian.diff(q[k])), _momentum(f, k)) for k in base}
    equations, pushes = [], []
    for k in base:
        force, impulse = (slope.subs(pair) for slope in slopes[k])
        equations.append(STEP * symbol(f"p{k}") - STEP * impulse + (1 - alpha) * STEP**2 * force)
        pushes.append(STEP * force)
    equations += [d[k] - STEP * value.subs(pair) for k, value in f.dependent.items()]
    statements = _solved(f, equations, d, poles=True)
    watches = [*velocity_watches(f, q, d, alpha), *range_watches(f, alpha)]
    return _program(f, choice, observation, statements, [*d, *pushes], watches, base)


def _modified_in_full(f: Formulas, choice: MethodChoice, observation: Observation, base: list[int]) -> programs.Program:
    """Symmetrised: the constraints hold only in the mean, so no factors cancel."""
    q, p, d, parts = f.symbols("q"), f.symbols("p"), f.symbols("d"), parts_of(choice)
    slope_q, slope_v = (f.gradient(f.free_lagrangian, letter) for letter in "qv")
    free, kicks = raw_step(q, p, d, STEP, parts, slope_q, slope_v)
    rows = [f.forms_at(between(q, d, part)) for part in parts]
    held = [
        sum((row[a][k] * d[k] for row in rows for k in range(f.size)), number(0)) / len(parts)
        for a in range(len(f.forms))
    ]
    statements = _solved(f, [*(free[k] for k in base), *held], d)
    points = [discrete_point(f, q, d, part) for part in parts]
    watches = [one for at in points for one in sign_watches(f.denominators, at, SMALLER_STEP)]
    watches += range_watches(f, parts[0])
    return _program(f, choice, observation, statements, [*d, *(kicks[k] for k in base)], watches, base)


def _solved(
    f: Formulas, equations: Sequence[Formula], unknowns: Sequence[Formula], guarded: bool = False, poles: bool = False
) -> tuple[programs.Statement, ...]:
    """The statements of an implicit step, d being increments of q, e and g of p."""
    scales = {f"{letter}{k}": f"{of}{k}" for k in range(f.size) for letter, of in (("d", "q"), ("e", "p"), ("g", "p"))}
    return programs.plan(equations, [str(name) for name in unknowns], scales, guarded, poles)


def _on_constraints(f: Formulas, formula: Formula) -> Formula:
    return formula.subs(f.on_constraints)


def _momentum(f: Formulas, place: int) -> Formula:
    return _on_constraints(f, f.free_lagrangian.diff(symbol(f"v{place}")))


def _program(
    f: Formulas,
    choice: MethodChoice,
    observation: Observation,
    statements: tuple[programs.Statement, ...],
    changes: Sequence[Formula],
    watches: Sequence[programs.Watch],
    momenta: Sequence[int] | None = None,
) -> programs.Program:
    """The program of a method on (q, p); `momenta` are the coordinates whose momentum is a state variable."""
    watches = [*watches, *rank_watches(f, between(f.symbols("q"), f.symbols("d"), 1))]
    places = range(f.size) if momenta is None else momenta
    carried = (*(f"q{k}" for k in range(f.size)), *(f"p{k}" for k in places))
    q, d = f.symbols("q"), f.symbols("d")
    observed = tuple(_observed(f, item, choice, q, d) for item in observation)
    forces = 0 if any(not isinstance(statement, programs.Assign) for statement in statements) else 1
    return _finished(f, carried, statements, changes, watches, observed, forces)


def _finished(
    f: Formulas, carried: tuple[str, ...], statements: tuple[programs.Statement, ...], changes: Sequence[Formula],
    watches: Sequence[programs.Watch], observed: tuple[tuple[str, Formula], ...], forces: int,
    further: Sequence[Formula] = (),
) -> programs.Program:  # fmt: skip
    """The program with a clock where t matters, and without what nothing needs."""
    state, changes = with_clock(f, carried, changes, observed)
    known = _assigned(statements)
    updates = tuple(None if known.get(change, change) == number(0) else change for change in changes)
    needed = [change for change in updates if change is not None]
    needed += [*further, *(watch.formula for watch in watches), *(formula for _, formula in observed)]
    return programs.Program(
        state=state, arguments=("h", "a", *f.parameters), statements=programs.used_only(statements, needed),
        updates=updates, watches=tuple(watches), observed=observed, forces=forces,
    )  # fmt: skip


def _assigned(statements: Sequence[programs.Statement]) -> dict[Formula, Formula]:
    return {symbol(s.name): s.formula for s in statements if isinstance(s, programs.Assign)}


def _observed(
    f: Formulas, item: Observable, choice: MethodChoice, q: list[Formula], d: list[Formula]
) -> tuple[str, Formula]:
    formula = translate(item.expression, f.table)
    parts = parts_of(choice)
    values = [formula.subs(discrete_point(f, q, d, part)) for part in parts]
    return item.name, sum(values[1:], values[0]) / len(values)


def runge_kutta(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Explicit steps of one length."""
    tableau = TABLEAUX[choice.order]
    statements, forces, changes, _ = _explicit(f, tableau)
    # Stages on both sides of a jump of the force can cancel, so that no step ever ends beyond it.
    names = [symbol(f"x{len(forces) - 1}_{k}") for k in range(2 * f.size)]
    moment = moment_at(number(round(float(tableau.nodes[-1]), 12)))
    last = dict(zip([*f.symbols("q"), *f.symbols("v"), MOMENT], [*names, moment], strict=True))
    watches = [*motion_walls(f, point_after(f, changes)), *motion_walls(f, last)] if choice.guard else []
    return _point_program(f, observation, statements, changes, watches, len(forces))


def adaptive(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Steps as long as the estimate of their error allows; the tolerance is the argument `a`."""
    tableau = TABLEAUX[choice.order if choice.order in PAIRS else PAIRS[0]]
    statements, forces, changes, errors = _explicit(f, tableau)
    first = [STEP * slope for slope in (*f.symbols("v"), *forces[0])]
    error, *coarse = (_squared_norm(f, changes, first, error) for error in errors)
    if coarse:
        error = error**2 / (error + coarse[0] / 100 + number(SMALLEST_NORM))
    program = _point_program(f, observation, statements, changes, [], len(forces), [error])
    return replace(program, error=error, order=tableau.falls)


def _squared_norm(
    f: Formulas, changes: list[Formula], first: list[Formula], errors: list[Formula], later: Sequence[Formula] = ()
) -> Formula:
    """The mean of (error/scale)^2, each variable measured by its size and its change in a step: no unit enters.

    Where all of these vanish at once, a thousandth of what the other of q and v makes of it in a step of the grid, or
    what the accelerations `later` in that step do.
    The influence of one end of a chain on the other within a step is of higher order than the error, so that no step is
    short enough for it: 1e-20 of the whole counts as well. Where terms of a force cancel at rest, the round-off that
    they leave changes with t: a step's share of it is no error.
    """
    q, v = f.symbols("q"), f.symbols("v")
    others = [*((rate * WHOLE_STEP) ** 2 for rate in v), *((place / WHOLE_STEP) ** 2 for place in q)]
    if later:
        gained = [(WHOLE_STEP * force) ** 2 for force in later]
        others = [a + b for a, b in zip(others, [*(WHOLE_STEP**2 * gain for gain in gained), *gained], strict=True)]
    sizes = [value**2 + change**2 + slope**2 + other / 1_000_000
             for value, change, slope, other in zip((*q, *v), changes, first, others, strict=True)]  # fmt: skip
    if f.depends_on_time:
        lost = (number(ROUND_OFF) * STEP / ALPHA) ** 2
        ends = [force.subs({MOMENT: moment_at(number(1.0))}) for force in f.accelerations]
        noise = [lost * _squared_terms(end) if _is_sum(end) else number(0) for end in ends]
        sizes = [a + b for a, b in zip(sizes, [*(STEP**2 * one for one in noise), *noise], strict=True)]
    wholes = [sum(part, number(0)) for part in (sizes[: f.size], sizes[f.size :])]
    total = number(0)
    for k, (size, error) in enumerate(zip(sizes, errors, strict=True)):
        total += error**2 / (size + wholes[k // f.size] * number(FAR_END**2) + number(SMALLEST))
    return total / (2 * f.size * ALPHA**2)


def _is_sum(formula: Formula) -> bool:
    """Whether it is a sum, or a product with one among its factors."""
    return formula.is_Add or (formula.is_Mul and any(map(_is_sum, formula.args)))


def _squared_terms(formula: Formula) -> Formula:
    """The sum of the squares of the terms, multiplied out."""
    if formula.is_Add:
        return sum(map(_squared_terms, formula.args), number(0))
    return math.prod(map(_squared_terms, formula.args), start=ONE) if formula.is_Mul else formula**2


def stiff(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """RODAS: six linear systems with one matrix in each step, n by n once the velocities are eliminated."""
    q, v = f.symbols("q"), f.symbols("v")
    statements: list[programs.Statement] = []
    slopes = {(k, x): slope(f.accelerations[k], x) for k in range(f.size) for x in (*q, *v)}
    jacobian = {place: _named(statements, [entry], f"j{place[0]}_{place[1]}_")[0]
                for place, entry in slopes.items() if entry != number(0)}  # fmt: skip
    done: Stages = []
    for stage in range(len(RODAS.nodes)):
        names = [[symbol(f"{letter}{stage}_{k}") for k in range(f.size)] for letter in "gw"]
        equations = _linear_stage(f, stage, (names[0], names[1]), done, jacobian)
        blocks = programs.plan(equations, [str(name) for part in names for name in part], {})
        statements += [replace(one, tested=False) if isinstance(one, programs.Solve) else one for one in blocks]
        done.append((names[0], names[1]))
    last = len(done) - 1
    ends = [[sum((number(a) * done[j][which][k] for j, a in enumerate(RODAS.rows[last])), done[last][which][k])
             for k in range(f.size)] for which in (0, 1)]  # fmt: skip
    changes = [*ends[0], *ends[1]]
    first = [STEP * slope for slope in (*v, *f.accelerations)]
    # A force that begins as t^2 from rest has an error of the size of its change in a step of any length.
    later = [force.subs({MOMENT: MOMENT + LATER * WHOLE_STEP}) for force in f.accelerations if f.depends_on_time]
    error = _squared_norm(f, changes, first, [*done[last][0], *done[last][1]], later)
    program = _point_program(f, observation, tuple(statements), changes, [], len(done), [error])
    return replace(program, error=error, order=RODAS.order)


def _linear_stage(
    f: Formulas, stage: int, names: tuple[list[Formula], list[Formula]], done: Stages,
    jacobian: dict[tuple[int, Formula], Formula],
) -> list[Formula]:  # fmt: skip
    """u/gamma - h J u - h f - sum c_ij u_j - h^2 d_i f_t for u = (g, w), the increments of q and of v."""
    q, v, moved, turned = f.symbols("q"), f.symbols("v"), *names
    places, speeds = (
        [x + sum((number(a) * done[j][which][k] for j, a in enumerate(RODAS.rows[stage])), number(0))
         for k, x in enumerate(start)]
        for which, start in enumerate((q, v))
    )  # fmt: skip
    table = dict(zip([*q, *v, MOMENT], [*places, *speeds, moment_at(number(RODAS.nodes[stage]))], strict=True))
    equations = []
    for k in range(f.size):
        mixed = [sum((number(c) * done[j][which][k] for j, c in enumerate(RODAS.mixed[stage])), number(0))
                 for which in (0, 1)]  # fmt: skip
        equations.append(moved[k] / number(RODAS.gamma) - STEP * (turned[k] + speeds[k]) - mixed[0])
        pull = sum((slope * (*moved, *turned)[[*q, *v].index(x)] for (row, x), slope in jacobian.items() if row == k),
                   number(0))  # fmt: skip
        drift = STEP**2 * number(RODAS.slopes[stage]) * f.accelerations[k].diff(MOMENT)
        force = STEP * (pull + f.accelerations[k].subs(table))
        equations.append(turned[k] / number(RODAS.gamma) - force - mixed[1] - drift)
    return equations


def _explicit(
    f: Formulas, tableau: Tableau
) -> tuple[tuple[programs.Statement, ...], list[list[Formula]], list[Formula], list[list[Formula]]]:
    """Statements, the forces of each stage, the increments of q and v, and estimates of their errors.

    Where forces do not depend on velocities, those of the stages are left out.
    """
    q, v = f.symbols("q"), f.symbols("v")
    statements: list[programs.Statement] = []
    speeds: list[list[Formula]] = []
    forces: list[list[Formula]] = []

    def moved(drift: float, weights: Array, places: Array) -> list[Formula]:
        moves = _combined(weights, speeds, f.size)
        if not f.depends_on_velocities:
            pulls = _combined(places, forces, f.size)
            moves = [number(drift) * x + STEP * pull for x, pull in zip(v, pulls, strict=True)]
        return [STEP * change for change in (*moves, *_combined(weights, forces, f.size))]

    stages = zip(tableau.nodes.tolist(), tableau.rows, tableau.places, strict=True)
    for stage, (node, row, places) in enumerate(stages):
        point = _named(statements, between([*q, *v], moved(node, row, places), 1), f"x{stage}_")
        table = dict(zip([*q, *v, MOMENT], [*point, moment_at(number(node))], strict=True))
        speeds.append(point[f.size :])
        forces.append(_named(statements, [a.subs(table) for a in f.accelerations], f"f{stage}_"))
    changes = moved(1.0, tableau.weights, tableau.ends)
    errors = [moved(0.0, row, places) for row, places in zip(tableau.errors, tableau.end_errors, strict=True)]
    return tuple(statements), forces, changes, errors


def _combined(weights: Array, stages: Sequence[Sequence[Formula]], size: int) -> list[Formula]:
    """The sums of what the stages so far have, with their weights."""
    pairs = [(number(a), one) for a, one in zip(weights.tolist(), stages, strict=False) if a]
    return [sum((a * one[k] for a, one in pairs), number(0)) for k in range(size)]


def _named(statements: list[programs.Statement], formulas: Sequence[Formula], prefix: str) -> list[Formula]:
    """Each formula computed once, under a name."""
    statements += [programs.Assign(f"{prefix}{k}", formula) for k, formula in enumerate(formulas)]
    return [symbol(f"{prefix}{k}") for k in range(len(formulas))]


def gauss_legendre(f: Formulas, choice: MethodChoice, observation: Observation) -> programs.Program:
    """Unknowns u = h q'' at the stages, by fixed-point iteration."""
    tableau, q, v = GAUSS_LEGENDRE, f.symbols("q"), f.symbols("v")
    stages = range(len(tableau.nodes))
    u = [[symbol(f"u{j}_{k}") for k in range(f.size)] for j in stages]
    values: list[Formula] = []
    for node, row, places in zip(tableau.nodes.tolist(), tableau.rows, tableau.places, strict=True):
        moved = [number(node) * x + pull for x, pull in zip(v, _combined(places, u, f.size), strict=True)]
        point = [*between(q, moved, STEP), *between(v, _combined(row, u, f.size), 1)]
        table = dict(zip([*q, *v, MOMENT], [*point, moment_at(number(node))], strict=True))
        values += [STEP * a.subs(table) for a in f.accelerations]
    names = tuple(str(name) for row in u for name in row)
    block = programs.Iterate(names, tuple(values), tuple(f"v{k}" for _ in stages for k in range(f.size)))
    moves = between(v, _combined(tableau.ends, u, f.size), 1)
    changes = [*(STEP * move for move in moves), *_combined(tableau.weights, u, f.size)]
    watches = motion_walls(f, point_after(f, changes)) if choice.guard else []
    return _point_program(f, observation, (block,), changes, watches, 0)


def _point_program(
    f: Formulas, observation: Observation, statements: tuple[programs.Statement, ...], changes: list[Formula],
    watches: Sequence[programs.Watch], forces: int, further: Sequence[Formula] = (),
) -> programs.Program:  # fmt: skip
    carried = tuple(str(name) for letter in "qv" for name in f.symbols(letter))
    ends = [q + d for q, d in zip(f.symbols("q"), changes, strict=False)]
    watches = [*watches, *rank_watches(f, ends, divides=True)]
    observed = tuple((item.name, translate(item.expression, f.table)) for item in observation)
    return _finished(f, carried, statements, changes, watches, observed, forces, further)


def where_it_ends(f: Formulas) -> str:
    """The remedy where L~ ends: the motion ends too if L~ is the Lagrangian of the scene itself."""
    return REGULAR_MOTION if f.problem.free_lagrangian == f.problem.lagrangian else OTHER_LAGRANGIAN


def moment_at(part: Formula) -> Formula:
    return MOMENT + part * STEP


def with_clock(
    f: Formulas, state: tuple[str, ...], changes: Sequence[Formula], observed: Sequence[tuple[str, Formula]]
) -> tuple[tuple[str, ...], Sequence[Formula]]:
    """Add t as a state variable that grows by h, if the problem or an observed formula depends on it."""
    if f.depends_on_time or any(contains(formula, MOMENT) for _, formula in observed):
        return (*state, str(MOMENT)), [*changes, STEP]
    return state, changes


def discrete_point(f: Formulas, q: Sequence[Formula], d: Sequence[Formula], alpha: Formula) -> dict[Formula, Formula]:
    """q, v and t of the discrete Lagrangian."""
    table = dict(zip(f.symbols("q"), between(q, d, alpha), strict=True))
    table[MOMENT] = moment_at(alpha)
    table.update({v: move / STEP for v, move in zip(f.symbols("v"), d, strict=True)})
    return table


def sign_watches(walls: Iterable[Denominator], point: Mapping[Formula, Formula], remedy: str) -> list[programs.Watch]:
    """The walls at a point of every step: none may pass 0."""
    return [programs.Watch("sign", wall.formula.subs(point), wall.text, remedy, begin=wall.formula) for wall in walls]


def velocity_watches(f: Formulas, q: list[Formula], d: list[Formula], alpha: Formula) -> list[programs.Watch]:
    """Velocities in a denominator of L~ must not pass 0; if only positions occur there, H~ is smooth."""
    moving = (denominator for denominator in f.denominators if denominator.moves)
    return sign_watches(moving, discrete_point(f, q, d, alpha), where_it_ends(f))


def domain_watches(f: Formulas, point: dict[Formula, Formula]) -> list[programs.Watch]:
    """H~ must stay in the domain where it is the Hamiltonian of L~: its poles and ends, and p = dL~/dv(q, H_p)."""
    watches = sign_watches(f.walls_of([f.problem.free_hamiltonian]), point, where_it_ends(f))
    if f.momenta_may_fail:
        size = sum((p**2 for p in f.symbols("p")), ONE)
        defect = sum((one**2 for one in f.momenta_may_fail), number(0)) / size
        text = "p - dL/dv at the velocities that the Hamiltonian gives"
        watches.append(programs.Watch("map", defect.subs(point), text, OTHER_LAGRANGIAN, MAP_LIMIT))
    return watches


def range_watches(f: Formulas, alpha: Formula) -> list[programs.Watch]:
    """L~ must stay where it has the motion: at the end of the step, and at its discrete point if velocities matter."""
    q, d = f.symbols("q"), f.symbols("d")
    return [
        programs.Watch(
            "domain", end.formula.subs(discrete_point(f, q, d, alpha if end.moves else ONE)), end.text, OTHER_MOTION
        )
        for end in f.domain
    ]


def rank_watches(f: Formulas, place: Sequence[Formula], divides: bool = False) -> list[programs.Watch]:
    """det(w w_next^T) > 0, w = omega(q_k): at a loss of rank in between the span of the constraints turns round.
    Methods that integrate accelerations, which divide by det(w w^T), also end where that sinks to LOST of its first
    size."""
    if not f.forms:
        return []
    before, after = f.forms_at(f.symbols("q")), f.forms_at(place)
    turned, size = (
        programs.determinant([[sum((a * b for a, b in zip(row, other, strict=True)), number(0)) for other in after]
                              for row in rows])
        for rows in (before, after)
    )  # fmt: skip
    if not turned.free_symbols:
        return []
    found = [programs.Watch("positive", turned, RANK, RANK_REMEDY)]
    return [*found, programs.Watch("rank", size, RANK_LOST, RANK_REMEDY, LOST)] if divides else found


def root_guards(f: Formulas, point: dict[Formula, Formula]) -> list[programs.Watch]:
    """h |d2H/dq_i dp_i| < 1 where it is not constant: for the class of the paper this is h |G'(r1)| < 1."""
    names = {*f.symbols("q"), *f.symbols("p")}
    watches = []
    for k, coordinate in enumerate(f.problem.coordinates):
        mixed = f.hamiltonian.diff(symbol(f"q{k}")).diff(symbol(f"p{k}"))
        if mixed.free_symbols & names:
            text = f"h*|d2H/d{coordinate} dp_{coordinate}|"
            watches.append(programs.Watch("bound", STEP * mixed.subs(point), text, GUARD_REMEDY))
    return watches


def point_after(f: Formulas, changes: Sequence[Formula]) -> dict[Formula, Formula]:
    """q, v and t at the end of a step."""
    names = [*f.symbols("q"), *f.symbols("v")]
    after = [x + change for x, change in zip(names, changes, strict=True)]
    return dict(zip([*names, MOMENT], [*after, moment_at(ONE)], strict=True))


def motion_walls(f: Formulas, point: dict[Formula, Formula]) -> list[programs.Watch]:
    """Poles, ends and kinks of the accelerations, watched at a point of q, v and t.

    Beyond one, even a smooth motion has lost its accuracy, because small errors were divided by a vanishing factor.
    """
    return sign_watches(f.walls_of(f.problem.accelerations or ()), point, REGULAR_MOTION)
