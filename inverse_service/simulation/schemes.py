"""Methods as programs: the discrete equations of integrators/ with the formulas of a problem in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from inverse_service.codegen.planning import plan, used_only
from inverse_service.codegen.program import Assign, Program, Statement, Watch
from inverse_service.codegen.symengine_trees import ALPHA, HALF, STEP, Formula, contains, number, symbol, translate
from inverse_service.errors import InputError
from inverse_service.integrators.variational import (
    between,
    hamiltonian_step,
    lagrange_dalembert_step,
    raw_step,
    symmetrised_hamiltonian_step,
)
from inverse_service.simulation.callables import MOMENT, Formulas
from inverse_service.simulation.point_schemes import adaptive, gauss_legendre, runge_kutta, stiff
from inverse_service.simulation.scene_data import MethodChoice, Observable, Observation
from inverse_service.simulation.watches import (
    REGULAR_MOTION,
    SMALLER_STEP,
    discrete_point,
    domain_watches,
    moment_at,
    range_watches,
    rank_watches,
    root_guards,
    sign_watches,
    velocity_watches,
    with_clock,
)

NOT_SEPARABLE = (
    "Stormer and Verlet need H = T(p) + V(q): constant masses, no magnetic terms, no further forces; take variational."
)


def alpha_of(choice: MethodChoice) -> Formula:
    """alpha as a number where it changes the structure (0, 1/2, 1), else a name that gets its value at run time."""
    special = {0.0: number(0), 0.5: HALF, 1.0: number(1)}
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
        "adaptive": adaptive,
        "stiff": stiff,
    }
    return builders[choice.method](formulas, choice, observation)


def variational(formulas: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    forms = {"raw": _raw, "verlet": _verlet, "hamiltonian": _hamiltonian}
    return forms[choice.form](formulas, choice, observation)


def _verlet(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
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
    statements = [Assign(str(name), force) for name, force in zip(forces, found, strict=True)]
    statements += [Assign(str(name), move) for name, move in zip(f.symbols("d"), moves, strict=True)]
    point = dict(zip([*q, *p, MOMENT], [*half, *p, middle], strict=True))
    watches = [*domain_watches(f, point), *range_watches(f, HALF)]
    return _program(f, choice, observation, tuple(statements), [*f.symbols("d"), *kicked], watches)


def _hamiltonian(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
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
    # The determinant of a mean of two places has zeros of its own, which the factors of L~ name better.
    guarded = choice.guard and len(parts_of(choice)) == 1
    statements = _solved(f, equations, unknowns, guarded)
    return _program(f, choice, observation, statements, [*d, *pushes], watches)


def _raw(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
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


def nonholonomic(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
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


def modified(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """L~ for the base coordinates with the discrete constraints put in, so that factors A_alpha cancel."""
    if not f.forms:
        raise InputError("The modified method needs constraints.")
    if any(drift != number(0) for drift in f.drifts):
        raise InputError("The modified method is for constraints without a part that is free of velocities.")
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
    statements = _solved(f, [*(free[k] for k in base), *held], d)
    points = [discrete_point(f, q, d, part) for part in parts]
    watches = [one for at in points for one in sign_watches(f.denominators, at, SMALLER_STEP)]
    watches += range_watches(f, parts[0])
    return _program(f, choice, observation, statements, [*d, *(kicks[k] for k in base)], watches, base)


def _solved(
    f: Formulas, equations: Sequence[Formula], unknowns: Sequence[Formula], guarded: bool = False, poles: bool = False
) -> tuple[Statement, ...]:
    """The statements of an implicit step, d being increments of q, e and g of p."""
    scales = {f"{letter}{k}": f"{of}{k}" for k in range(f.size) for letter, of in (("d", "q"), ("e", "p"), ("g", "p"))}
    return plan(equations, [str(name) for name in unknowns], scales, guarded, poles)


def _on_constraints(f: Formulas, formula: Formula) -> Formula:
    velocities = f.symbols("v")
    return formula.subs({velocities[k]: value for k, value in f.dependent.items()})


def _momentum(f: Formulas, place: int) -> Formula:
    return _on_constraints(f, f.free_lagrangian.diff(symbol(f"v{place}")))


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
    watches = [*watches, *rank_watches(f, between(f.symbols("q"), f.symbols("d"), 1))]
    places = range(f.size) if momenta is None else momenta
    state = (*(f"q{k}" for k in range(f.size)), *(f"p{k}" for k in places))
    q, d = f.symbols("q"), f.symbols("d")
    observed = tuple(_observed(f, item, choice, q, d) for item in observation.observables)
    state, changes = with_clock(f, state, changes, observed)
    updates = tuple(None if number(0) in (change, known.get(change)) else change for change in changes)
    displacement = tuple(d) if observation.velocities else ()
    way = tuple(d) if choice.guard else ()
    needed = [*(u for u in updates if u is not None), *displacement, *way]
    needed += [*(watch.formula for watch in watches), *(formula for _, formula in observed)]
    return Program(
        state=state,
        arguments=("h", "a", *f.parameters),
        statements=used_only(statements, needed),
        updates=updates,
        watches=tuple(watches),
        displacement=displacement,
        way=way,
        observed=observed,
        forces=0 if any(not isinstance(statement, Assign) for statement in statements) else 1,
    )


def _assigned(statements: Sequence[Statement]) -> dict[Formula, Formula]:
    return {symbol(s.name): s.formula for s in statements if isinstance(s, Assign)}


def _observed(
    f: Formulas, item: Observable, choice: MethodChoice, q: list[Formula], d: list[Formula]
) -> tuple[str, Formula]:
    formula = translate(item.expression, f.table)
    parts = parts_of(choice)
    values = [formula.subs(discrete_point(f, q, d, part)) for part in parts]
    return item.name, sum(values[1:], values[0]) / len(values)
