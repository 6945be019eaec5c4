"""Methods on positions and velocities as programs: Runge-Kutta, Gauss-Legendre, and those that choose their steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from inverse_service.codegen.planning import plan, used_only
from inverse_service.codegen.program import Assign, Iterate, Program, Solve, Statement, Watch
from inverse_service.codegen.symengine_trees import ALPHA, STEP, WHOLE_STEP, Formula, number, slope, symbol, translate
from inverse_service.errors import InputError
from inverse_service.integrators.tableaux import RODAS, TABLEAUX, collocation
from inverse_service.simulation.callables import MOMENT, Formulas
from inverse_service.simulation.scene_data import MethodChoice, Observation
from inverse_service.simulation.watches import (
    SMALLEST,
    moment_at,
    motion_walls,
    rank_watches,
    resolution_watches,
    with_clock,
)

SMALLEST_NORM = 1e-200  # times the fourth power of a tolerance it is a number still
FAR_END = 1e-20  # of the whole; less than any unit of a coordinate differs from that of another

Stages = list[tuple[list[Formula], list[Formula]]]


def runge_kutta(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """Explicit steps of one length."""
    if choice.order not in TABLEAUX:
        known = ", ".join(map(str, TABLEAUX))
        raise InputError(f"Explicit Runge-Kutta methods have order {known}, not {choice.order}.")
    statements, stages, changes = _explicit(f, choice.order)
    ends = ([STEP * force for force in stage[1]] for stage in (stages[0], stages[-1]))
    # Stages on both sides of a jump of the force can cancel, so that no step ever ends beyond it.
    names = [symbol(f"{letter}{len(stages) - 1}_{k}") for letter in "xy" for k in range(f.size)]
    last = dict(zip([*f.symbols("q"), *f.symbols("v"), MOMENT], [*names, moment_at(number(1.0))], strict=True))
    watches = [*resolution_watches(f, changes, *ends), *motion_walls(f, last)] if choice.guard else []
    return _point_program(f, observation, statements, changes, watches, len(stages))


def adaptive(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """DOP853 with the lengths of its steps chosen by its estimate of the error; the tolerance is the argument `a`."""
    statements, stages, changes = _explicit(f, 8)
    origin = [number(0)] * f.size
    rough, rougher = (
        [change for which in (0, 1) for change in _stage_point(origin, stages, which, weights)]
        for weights in TABLEAUX[8].errors
    )
    first = [STEP * slope for slope in (*f.symbols("v"), *stages[0][1])]
    fine, coarse = (_squared_norm(f, changes, first, error) for error in (rough, rougher))
    error = fine**2 / (fine + coarse / 100 + number(SMALLEST_NORM))
    program = _point_program(f, observation, statements, changes, [], len(stages), [error])
    return replace(program, error=error, order=8)


def _squared_norm(f: Formulas, changes: list[Formula], first: list[Formula], errors: list[Formula]) -> Formula:
    """The mean of (error/scale)^2, each variable measured by its size and its change in a step: no unit enters.

    Where all of these vanish at once, a thousandth of what the other of q and v makes of it in a step of the grid.
    What the far end of a chain has felt of its other end after a step is of a higher order than the error, so that no
    step is short enough for it: 1e-20 of the whole counts as well.
    """
    q, v = f.symbols("q"), f.symbols("v")
    others = [*((rate * WHOLE_STEP) ** 2 for rate in v), *((place / WHOLE_STEP) ** 2 for place in q)]
    sizes = [value**2 + change**2 + slope**2 + other / 1_000_000
             for value, change, slope, other in zip((*q, *v), changes, first, others, strict=True)]  # fmt: skip
    wholes = [sum(part, number(0)) for part in (sizes[: f.size], sizes[f.size :])]
    total = number(0)
    for k, (size, error) in enumerate(zip(sizes, errors, strict=True)):
        total += error**2 / (size + wholes[k // f.size] * number(FAR_END**2) + number(SMALLEST))
    return total / (2 * f.size * ALPHA**2)


def stiff(f: Formulas, choice: MethodChoice, observation: Observation) -> Program:
    """RODAS: six linear systems with one matrix in each step, n by n once the velocities are eliminated."""
    q, v = f.symbols("q"), f.symbols("v")
    statements: list[Statement] = []
    slopes = {(k, x): slope(f.accelerations[k], x) for k in range(f.size) for x in (*q, *v)}
    jacobian = {place: _named(statements, [entry], f"j{place[0]}_{place[1]}_")[0]
                for place, entry in slopes.items() if entry != number(0)}  # fmt: skip
    done: Stages = []
    for stage in range(len(RODAS.nodes)):
        names = [[symbol(f"{letter}{stage}_{k}") for k in range(f.size)] for letter in "gw"]
        equations = _linear_stage(f, stage, (names[0], names[1]), done, jacobian)
        blocks = plan(equations, [str(name) for part in names for name in part], {})
        statements += [replace(one, tested=False) if isinstance(one, Solve) else one for one in blocks]
        done.append((names[0], names[1]))
    last = len(done) - 1
    ends = [[sum((number(a) * done[j][which][k] for j, a in enumerate(RODAS.rows[last])), done[last][which][k])
             for k in range(f.size)] for which in (0, 1)]  # fmt: skip
    changes = [*ends[0], *ends[1]]
    first = [STEP * slope for slope in (*v, *f.accelerations)]
    error = _squared_norm(f, changes, first, [*done[last][0], *done[last][1]])
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


def _explicit(f: Formulas, order: int) -> tuple[tuple[Statement, ...], Stages, list[Formula]]:
    """Statements, (velocity, force) of each stage, and the increments of q and v."""
    tableau = TABLEAUX[order]
    q, v = f.symbols("q"), f.symbols("v")
    statements: list[Statement] = []
    stages: Stages = []
    for stage, row in enumerate(tableau.rows):
        place, velocity = (_stage_point(start, stages, which, row) for which, start in enumerate((q, v)))
        place, velocity = _named(statements, place, f"x{stage}_"), _named(statements, velocity, f"y{stage}_")
        moment = moment_at(number(float(sum(row))))
        table = dict(zip([*q, *v, MOMENT], [*place, *velocity, moment], strict=True))
        forces = _named(statements, [a.subs(table) for a in f.accelerations], f"f{stage}_")
        stages.append((velocity, forces))
    origin = [number(0)] * f.size
    changes = [change for which in (0, 1) for change in _stage_point(origin, stages, which, tableau.weights)]
    return tuple(statements), stages, changes


def _stage_point(start: list[Formula], stages: Stages, which: int, row: Sequence[float]) -> list[Formula]:
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
        table = dict(zip([*q, *v, MOMENT], [*place, *speed, moment_at(number(nodes[j]))], strict=True))
        values += [STEP * a.subs(table) for a in f.accelerations]
    names = tuple(str(name) for row in u for name in row)
    block = Iterate(names, tuple(values), tuple(f"v{k}" for _ in stages for k in range(f.size)))
    changes = [
        STEP * (v[k] + sum((number(position_weights[i]) * u[i][k] for i in stages), number(0))) for k in range(f.size)
    ] + [sum((number(weights[i]) * u[i][k] for i in stages), number(0)) for k in range(f.size)]
    watches = resolution_watches(f, changes, u[0], u[-1]) if choice.guard else []
    return _point_program(f, observation, (block,), changes, watches, 0)


def _point_program(
    f: Formulas, observation: Observation, statements: tuple[Statement, ...], changes: list[Formula],
    watches: Sequence[Watch], forces: int, further: Sequence[Formula] = (),
) -> Program:  # fmt: skip
    carried = tuple(str(name) for letter in "qv" for name in f.symbols(letter))
    watches = [*watches, *rank_watches(f, [q + d for q, d in zip(f.symbols("q"), changes, strict=False)])]
    observed = tuple((item.name, translate(item.expression, f.table)) for item in observation.observables)
    state, updates = with_clock(f, carried, changes, observed)
    needed = [
        *updates,
        *further,
        *(watch.formula for watch in watches),
        *(formula for _, formula in observed),
    ]
    return Program(
        state=state, arguments=("h", "a", *f.parameters), statements=used_only(statements, needed),
        updates=tuple(updates), watches=tuple(watches), observed=observed, forces=forces,
    )  # fmt: skip
