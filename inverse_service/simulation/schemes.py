"""Methods as programs: the discrete equations of integrators/ with the formulas of a problem in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from inverse_service.codegen.algebra import ALPHA, HALF, ONE, STEP, Formula, contains, number, symbol, translate
from inverse_service.codegen.planning import determinant, plan, used_only
from inverse_service.codegen.program import Assign, Iterate, Program, Statement, Watch
from inverse_service.errors import InputError
from inverse_service.integrators.gauss_legendre import collocation
from inverse_service.integrators.nonholonomic import lagrange_dalembert_step
from inverse_service.integrators.runge_kutta import TABLEAUX
from inverse_service.integrators.variational import (
    between,
    hamiltonian_step,
    raw_step,
    symmetrised_hamiltonian_step,
)
from inverse_service.simulation.choices import MethodChoice, Observable, Observation
from inverse_service.simulation.formulas import MOMENT, Formulas

SMALLER_STEP = "take a smaller step"
GUARD_REMEDY = "take a smaller step or smaller free constants of the free Lagrangian"
OTHER_LAGRANGIAN = (
    "the free Lagrangian ends there: give another free_lagrangian, or use the method reference or runge-kutta"
)
RANK = "the rank of the constraints, det(w(q) w(q_next)^T)"
RANK_REMEDY = "divide the constraints by what vanishes there, begin elsewhere, or take a smaller step"
MAP_LIMIT = 1e-12
REGULAR_MOTION = "the equations of motion end there: use coordinates in which they are regular, or stop before"
RESOLUTION = "the error of a step beside its change of the velocity, squared"
# Ratios squared: a wall is passed smoothly below a hundredth; a force that acts in the last stage alone has a tenth.
SMOOTH, RESOLVED = 1e-4, 0.05
ROUND_OFF, SMALLEST = 1e-18, 1e-300


def alpha_of(choice: MethodChoice) -> Formula:
    """alpha as a number where it changes the structure (0, 1/2, 1), else a name that gets its value at run time."""
    special = {0.0: number(0), 0.5: HALF, 1.0: ONE}
    return special.get(choice.alpha, ALPHA)


def parts_of(choice: MethodChoice) -> tuple[Formula, ...]:
    alpha = alpha_of(choice)
    return (alpha, 1 - alpha) if choice.symmetrised and alpha != HALF else (alpha,)


def program_of(formulas: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """The step of the method; only what is asked is in it."""
    builders: dict[str, Callable[[Formulas, MethodChoice, Observation], Program]] = {
        "variational": variational,
        "nonholonomic": nonholonomic,
        "modified": modified,
        "runge_kutta": runge_kutta,
        "reference": gauss_legendre,
    }
    return builders[choice.method](formulas, choice, observation)


def variational(formulas: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    return _raw(formulas, choice, observation) if choice.form == "raw" else _hamiltonian(formulas, choice, observation)


def _hamiltonian(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    q, p, d = f.symbols("q"), f.symbols("p"), f.symbols("d")
    alpha = alpha_of(choice)
    slope_q, slope_p = (f.gradient(f.hamiltonian, letter, "q", "p", _moment(alpha)) for letter in "qp")
    if len(parts_of(choice)) == 2:
        e = (f.symbols("e"), f.symbols("g"))
        equations, pushes = symmetrised_hamiltonian_step(q, p, d, e, STEP, alpha, slope_q, slope_p)
        unknowns, watched = [*d, *e[0], *e[1]], between(p, e[0], 1)
    else:
        equations, pushes = hamiltonian_step(q, p, d, f.symbols("e"), STEP, alpha, slope_q, slope_p)
        unknowns, watched = [*d, *f.symbols("e")], between(p, f.symbols("e"), 1 - alpha)
    point = dict(zip([*q, *p, MOMENT], [*between(q, d, alpha), *watched, _moment(alpha)], strict=True))
    guards = _guards(f, point) if choice.guard else []
    watches = [*_velocity_watches(f, q, d, alpha), *_domain_watches(f, point), *guards]
    scales = {f"{letter}{k}": f"{of}{k}" for k in range(f.size) for letter, of in (("d", "q"), ("e", "p"), ("g", "p"))}
    # The determinant of a mean of two places has zeros of its own, which the factors of L~ name better.
    guarded = choice.guard and len(parts_of(choice)) == 1
    statements = plan(equations, [str(name) for name in unknowns], scales, guarded)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def _velocity_watches(f: Formulas, q: list[Formula], d: list[Formula], alpha: Formula) -> list[Watch]:
    """Velocities that L~ divides by must not pass 0; where L~ divides by positions only, H~ is smooth."""
    table = _pair(f, q, d, alpha)
    return [
        Watch("sign", denominator.formula.subs(table), denominator.text, SMALLER_STEP)
        for denominator in f.denominators
        if denominator.moves
    ]


def _pair(f: Formulas, q: Sequence[Formula], d: Sequence[Formula], alpha: Formula) -> dict[Formula, Formula]:
    """q, v and t of the discrete Lagrangian."""
    table = dict(zip(f.symbols("q"), between(q, d, alpha), strict=True))
    table[MOMENT] = _moment(alpha)
    table.update({v: move / STEP for v, move in zip(f.symbols("v"), d, strict=True)})
    return table


def _moment(part: Formula) -> Formula:
    return MOMENT + part * STEP


def _domain_watches(f: Formulas, point: dict[Formula, Formula]) -> list[Watch]:
    """H~ must stay where it is the Hamiltonian of L~: poles and ends of its own, and p = dL~/dv(q, H_p)."""
    trees = [f.problem.free_hamiltonian]
    watches = [Watch("sign", wall.formula.subs(point), wall.text, OTHER_LAGRANGIAN) for wall in f.walls_of(trees)]
    if f.momenta_may_fail:
        size = sum((p**2 for p in f.symbols("p")), ONE)
        defect = sum((one**2 for one in f.momenta_may_fail), number(0)) / size
        text = "p - dL/dv at the velocities that the Hamiltonian gives"
        watches.append(Watch("map", defect.subs(point), text, OTHER_LAGRANGIAN, MAP_LIMIT))
    return watches


def _rank_watches(f: Formulas, place: Sequence[Formula]) -> list[Watch]:
    """det(omega(q_k) omega(q_(k+1))^T) > 0: at a loss of rank in between the span of the constraints turns round."""
    if not f.forms:
        return []
    before, after = f.forms_at(f.symbols("q")), f.forms_at(place)
    entries = [[sum((a * b for a, b in zip(row, other, strict=True)), number(0)) for other in after] for row in before]
    if not determinant(entries).free_symbols:
        return []
    return [Watch("positive", determinant(entries), RANK, RANK_REMEDY)]


def _guards(f: Formulas, point: dict[Formula, Formula]) -> list[Watch]:
    """h |d2H/dq_i dp_i| < 1 where it is not constant: for the class of the paper this is h |G'(r1)| < 1."""
    names = {*f.symbols("q"), *f.symbols("p")}
    watches = []
    for k, coordinate in enumerate(f.problem.coordinates):
        mixed = f.hamiltonian.diff(symbol(f"q{k}")).diff(symbol(f"p{k}"))
        if mixed.free_symbols & names:
            text = f"h*|d2H/d{coordinate} dp_{coordinate}|"
            watches.append(Watch("bound", STEP * mixed.subs(point), text, GUARD_REMEDY))
    return watches


def _raw(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    q, p, d = f.symbols("q"), f.symbols("p"), f.symbols("d")
    parts = parts_of(choice)
    slope_q, slope_v = (f.gradient(f.free_lagrangian, letter, moment=_moment(parts[0])) for letter in "qv")
    equations, pushes = raw_step(q, p, d, STEP, parts, slope_q, slope_v)
    watches = [
        Watch("sign", denominator.formula.subs(_pair(f, q, d, part)), denominator.text, "use the Hamiltonian form")
        for part in parts
        for denominator in f.denominators
    ]
    scales = {f"d{k}": f"q{k}" for k in range(f.size)}
    # Near A_beta = 0 the determinant itself has no limit; there the watches above are the guard.
    guarded = choice.guard and all(one.moves for one in f.denominators)
    statements = plan(equations, [str(name) for name in d], scales, guarded)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def nonholonomic(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    q, p, d = f.symbols("q"), f.symbols("p"), f.symbols("d")
    m = [symbol(f"m{a}") for a in range(len(f.forms))]
    slope_q, slope_v = (f.gradient(f.lagrangian, letter, moment=_moment(parts_of(choice)[0])) for letter in "qv")
    equations, pushes = lagrange_dalembert_step(q, p, d, m, STEP, parts_of(choice), slope_q, slope_v, f.forms_at)
    scales = {f"d{k}": f"q{k}" for k in range(f.size)}
    statements = plan(equations, [str(name) for name in (*d, *m)], scales, guarded=choice.guard)
    return _program(f, choice, observation, statements, [*d, *pushes], [])


def modified(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """L~ for the base coordinates with the discrete constraints put in, so that factors A_alpha cancel."""
    if not f.forms:
        raise InputError("The modified method needs constraints.")
    q, d, alpha = f.symbols("q"), f.symbols("d"), alpha_of(choice)
    base = [k for k in range(f.size) if k not in f.dependent]
    if len(parts_of(choice)) == 2 or any(contains(value, q[k]) for value in f.dependent.values() for k in f.dependent):
        return _modified_in_full(f, choice, observation, base)
    pair = _pair(f, q, d, alpha)
    slopes = {k: (_on_constraints(f, f.free_lagrangian.diff(q[k])), _momentum(f, k)) for k in base}
    equations, pushes = [], []
    for k in base:
        force, impulse = (slope.subs(pair) for slope in slopes[k])
        equations.append(STEP * symbol(f"p{k}") - STEP * impulse + (1 - alpha) * STEP**2 * force)
        pushes.append(STEP * force)
    equations += [d[k] - STEP * value.subs(pair) for k, value in f.dependent.items()]
    scales = {f"d{k}": f"q{k}" for k in range(f.size)}
    statements = plan(equations, [str(name) for name in d], scales, poles=True)
    watches = _velocity_watches(f, q, d, alpha)
    return _program(f, choice, observation, statements, [*d, *pushes], watches, base)


def _modified_in_full(f: Formulas, choice: MethodChoice, observation: Observation, base: list[int]) -> Program:
    """Symmetrised: the constraints hold in the mean only, so nothing cancels."""
    q, p, d, parts = f.symbols("q"), f.symbols("p"), f.symbols("d"), parts_of(choice)
    slope_q, slope_v = (f.gradient(f.free_lagrangian, letter) for letter in "qv")
    free, kicks = raw_step(q, p, d, STEP, parts, slope_q, slope_v)
    rows = [f.forms_at(between(q, d, part)) for part in parts]
    held = [
        sum((row[a][k] * d[k] for row in rows for k in range(f.size)), number(0)) / len(parts)
        for a in range(len(f.forms))
    ]
    scales = {f"d{k}": f"q{k}" for k in range(f.size)}
    statements = plan([*(free[k] for k in base), *held], [str(name) for name in d], scales)
    watches = [
        Watch("sign", denominator.formula.subs(_pair(f, q, d, part)), denominator.text, SMALLER_STEP)
        for part in parts
        for denominator in f.denominators
    ]
    return _program(f, choice, observation, statements, [*d, *(kicks[k] for k in base)], watches, base)


def _on_constraints(f: Formulas, formula: Formula) -> Formula:
    velocities = f.symbols("v")
    return formula.subs({velocities[k]: value for k, value in f.dependent.items()})


def _momentum(f: Formulas, place: int) -> Formula:
    return _on_constraints(f, f.free_lagrangian.diff(symbol(f"v{place}")))


def runge_kutta(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    if choice.order not in TABLEAUX:
        raise InputError(f"Explicit Runge-Kutta methods have order 4, 5 or 8, not {choice.order}.")
    tableau = TABLEAUX[choice.order]
    q, v = f.symbols("q"), f.symbols("v")
    statements: list[Statement] = []
    stages: list[tuple[list[Formula], list[Formula]]] = []
    for stage, row in enumerate(tableau.rows):
        place, velocity = (_stage_point(start, stages, which, row) for which, start in enumerate((q, v)))
        place, velocity = _named(statements, place, f"x{stage}_"), _named(statements, velocity, f"y{stage}_")
        moment = _moment(number(float(sum(row))))
        table = dict(zip([*q, *v, MOMENT], [*place, *velocity, moment], strict=True))
        forces = _named(statements, [a.subs(table) for a in f.accelerations], f"f{stage}_")
        stages.append((velocity, forces))
    origin = [number(0)] * f.size
    changes = [change for which in (0, 1) for change in _stage_point(origin, stages, which, tableau.weights)]
    forces = [[STEP * force for force in stage[1]] for stage in (stages[0], stages[-1])]
    watches = _resolution_watches(f, changes, *forces) if choice.guard else []
    return _point_program(f, observation, tuple(statements), changes, watches, len(tableau.rows))


def _stage_point(
    start: list[Formula], stages: Sequence[tuple[list[Formula], list[Formula]]], which: int, row: Sequence[float]
) -> list[Formula]:
    return [
        x + STEP * sum((number(a) * stage[which][k] for a, stage in zip(row, stages, strict=True) if a), number(0))
        for k, x in enumerate(start)
    ]


def _named(statements: list[Statement], formulas: Sequence[Formula], prefix: str) -> list[Formula]:
    """Each formula computed once, under a name."""
    statements += [Assign(f"{prefix}{k}", formula) for k, formula in enumerate(formulas)]
    return [symbol(f"{prefix}{k}") for k in range(len(formulas))]


def gauss_legendre(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """Unknowns u = h q'' at the stages, by fixed-point iteration."""
    matrix, squared, weights, position_weights, nodes = collocation()
    q, v = f.symbols("q"), f.symbols("v")
    stages = range(len(nodes))
    u = [[symbol(f"u{j}_{k}") for k in range(f.size)] for j in stages]
    values: list[Formula] = []
    for j in stages:
        place = [
            q[k] + STEP * (number(nodes[j]) * v[k] + sum((number(squared[j][i]) * u[i][k] for i in stages), number(0)))
            for k in range(f.size)
        ]
        speed = [v[k] + sum((number(matrix[j][i]) * u[i][k] for i in stages), number(0)) for k in range(f.size)]
        table = dict(zip([*q, *v, MOMENT], [*place, *speed, _moment(number(nodes[j]))], strict=True))
        values += [STEP * a.subs(table) for a in f.accelerations]
    names = tuple(str(name) for row in u for name in row)
    block = Iterate(names, tuple(values), tuple(f"v{k}" for _ in stages for k in range(f.size)))
    changes = [
        STEP * (v[k] + sum((number(position_weights[i]) * u[i][k] for i in stages), number(0))) for k in range(f.size)
    ] + [sum((number(weights[i]) * u[i][k] for i in stages), number(0)) for k in range(f.size)]
    watches = _resolution_watches(f, changes, u[0], u[-1]) if choice.guard else []
    return _point_program(f, observation, (block,), changes, watches, 0)


def _resolution_watches(
    f: Formulas, changes: Sequence[Formula], first: Sequence[Formula], last: Sequence[Formula]
) -> list[Watch]:
    """The increments of v against the rule of the two ends: far apart where a step jumps over what the force does.

    For an oscillation they differ by (h omega)^2/12 of themselves. Walls of the accelerations may be passed where they
    differ by little: there the motion is smooth although its formula is not.
    """
    moved = changes[f.size :]
    difference = sum(((d - (a + b) / 2) ** 2 for d, a, b in zip(moved, first, last, strict=True)), number(0))
    size = sum((d**2 + a**2 + b**2 for d, a, b in zip(moved, first, last, strict=True)), number(0))
    used = {name for force in f.accelerations for name in force.free_symbols}
    steps = [*(x / STEP for x in f.symbols("q") if x in used), *(v for v in f.symbols("v") if v in used)]
    noise = number(ROUND_OFF) * sum((x**2 for x in steps), number(0))
    ratio = difference / (size + noise + number(SMALLEST))
    after = [x + d for x, d in zip((*f.symbols("q"), *f.symbols("v")), changes, strict=True)]
    point = dict(zip([*f.symbols("q"), *f.symbols("v"), MOMENT], [*after, _moment(ONE)], strict=True))
    walls = [
        Watch("sign", wall.formula.subs(point), wall.text, REGULAR_MOTION, SMOOTH, ratio)
        for wall in f.walls_of(f.problem.accelerations or ())
    ]
    return [*walls, Watch("bound", ratio, RESOLUTION, SMALLER_STEP, RESOLVED)]


def _point_program(
    f: Formulas, observation: Observation, statements: tuple[Statement, ...], changes: list[Formula],
    watches: Sequence[Watch], forces: int,
) -> Program:  # fmt: skip
    carried = tuple(str(name) for letter in "qv" for name in f.symbols(letter))
    watches = [*watches, *_rank_watches(f, [q + d for q, d in zip(f.symbols("q"), changes, strict=False)])]
    observed = tuple((item.name, translate(item.expression, f.table)) for item in observation.observables)
    state, updates = _with_clock(f, carried, changes, observed)
    needed = [*updates, *(one for watch in watches for one in watch.formulas), *(formula for _, formula in observed)]
    return Program(
        state=state, arguments=("h", "a", *f.parameters), statements=used_only(statements, needed),
        updates=tuple(updates), watches=tuple(watches), observed=observed, forces=forces,
    )  # fmt: skip


def _program(
    f: Formulas,
    choice: MethodChoice,
    observation: Observation,
    statements: tuple[Statement, ...],
    changes: Sequence[Formula],
    watches: Sequence[Watch],
    momenta: Sequence[int] | None = None,
) -> Program:
    """The program of a method on (q, p); `momenta` are the coordinates whose momentum is carried."""
    known = _assigned(statements)
    watches = [*watches, *_rank_watches(f, between(f.symbols("q"), f.symbols("d"), 1))]
    places = range(f.size) if momenta is None else momenta
    state = (*(f"q{k}" for k in range(f.size)), *(f"p{k}" for k in places))
    q, d = f.symbols("q"), f.symbols("d")
    observed = tuple(_observed(f, item, choice, q, d) for item in observation.observables)
    state, changes = _with_clock(f, state, changes, observed)
    updates = tuple(None if number(0) in (change, known.get(change)) else change for change in changes)
    displacement = tuple(d) if observation.velocities else ()
    needed = [*(u for u in updates if u is not None), *displacement]
    needed += [*(formula for watch in watches for formula in watch.formulas), *(formula for _, formula in observed)]
    return Program(
        state=state,
        arguments=("h", "a", *f.parameters),
        statements=used_only(statements, needed),
        updates=updates,
        watches=tuple(watches),
        displacement=displacement,
        observed=observed,
        forces=0 if any(not isinstance(statement, Assign) for statement in statements) else 1,
    )


def _with_clock(
    f: Formulas, state: tuple[str, ...], changes: Sequence[Formula], observed: Sequence[tuple[str, Formula]]
) -> tuple[tuple[str, ...], Sequence[Formula]]:
    """With t as a state variable that grows by h, where the problem or what is observed depends on it."""
    if f.depends_on_time or any(contains(formula, MOMENT) for _, formula in observed):
        return (*state, str(MOMENT)), [*changes, STEP]
    return state, changes


def _assigned(statements: Sequence[Statement]) -> dict[Formula, Formula]:
    return {symbol(s.name): s.formula for s in statements if isinstance(s, Assign)}


def _observed(
    f: Formulas, item: Observable, choice: MethodChoice, q: list[Formula], d: list[Formula]
) -> tuple[str, Formula]:
    formula = translate(item.expression, f.table)
    parts = parts_of(choice)
    values = [formula.subs(_pair(f, q, d, part)) for part in parts]
    return item.name, sum(values[1:], values[0]) / len(values)
