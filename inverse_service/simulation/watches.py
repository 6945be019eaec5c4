"""What is watched at every step, so that a run ends where its formulas end, with the sentence that says so."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.codegen.algebra import ONE, STEP, Formula, contains, number, symbol
from inverse_service.codegen.planning import determinant
from inverse_service.codegen.program import Watch
from inverse_service.integrators.variational import between
from inverse_service.simulation.formulas import MOMENT, Formulas

SMALLER_STEP = "take a smaller step"
GUARD_REMEDY = "take a smaller step or smaller free constants of the free Lagrangian"
OTHER_LAGRANGIAN = (
    "the free Lagrangian ends there: give another free_lagrangian, or use the method reference or runge-kutta"
)
RANK = "the rank of the constraints, det(w(q) w(q_next)^T)"
RANK_REMEDY = "divide the constraints by what vanishes there, begin elsewhere, or take a smaller step"
MAP_LIMIT = 1e-12
RESOLVE = f"{SMALLER_STEP}, or go on with guard = false, unchecked"
REGULAR_MOTION = "the equations of motion end there: use coordinates in which they are regular, or stop before"
RESOLUTION = "the error of a step beside its change of the velocity, squared"
# The ratio squared; that of a force which acts in the last stage alone is a tenth.
RESOLVED = 0.05
ROUND_OFF, SMALLEST = 1e-18, 1e-300


def moment_at(part: Formula) -> Formula:
    return MOMENT + part * STEP


def with_clock(
    f: Formulas, state: tuple[str, ...], changes: Sequence[Formula], observed: Sequence[tuple[str, Formula]]
) -> tuple[tuple[str, ...], Sequence[Formula]]:
    """With t as a state variable that grows by h, where the problem or what is observed depends on it."""
    if f.depends_on_time or any(contains(formula, MOMENT) for _, formula in observed):
        return (*state, str(MOMENT)), [*changes, STEP]
    return state, changes


def discrete_point(f: Formulas, q: Sequence[Formula], d: Sequence[Formula], alpha: Formula) -> dict[Formula, Formula]:
    """q, v and t of the discrete Lagrangian."""
    table = dict(zip(f.symbols("q"), between(q, d, alpha), strict=True))
    table[MOMENT] = moment_at(alpha)
    table.update({v: move / STEP for v, move in zip(f.symbols("v"), d, strict=True)})
    return table


def velocity_watches(f: Formulas, q: list[Formula], d: list[Formula], alpha: Formula) -> list[Watch]:
    """Velocities that L~ divides by must not pass 0; where L~ divides by positions only, H~ is smooth."""
    table = discrete_point(f, q, d, alpha)
    return [
        Watch("sign", denominator.formula.subs(table), denominator.text, OTHER_LAGRANGIAN)
        for denominator in f.denominators
        if denominator.moves
    ]


def domain_watches(f: Formulas, point: dict[Formula, Formula]) -> list[Watch]:
    """H~ must stay where it is the Hamiltonian of L~: poles and ends of its own, and p = dL~/dv(q, H_p)."""
    trees = [f.problem.free_hamiltonian]
    watches = [Watch("sign", wall.formula.subs(point), wall.text, OTHER_LAGRANGIAN) for wall in f.walls_of(trees)]
    if f.momenta_may_fail:
        size = sum((p**2 for p in f.symbols("p")), ONE)
        defect = sum((one**2 for one in f.momenta_may_fail), number(0)) / size
        text = "p - dL/dv at the velocities that the Hamiltonian gives"
        watches.append(Watch("map", defect.subs(point), text, OTHER_LAGRANGIAN, MAP_LIMIT))
    return watches


def rank_watches(f: Formulas, place: Sequence[Formula]) -> list[Watch]:
    """det(omega(q_k) omega(q_(k+1))^T) > 0: at a loss of rank in between the span of the constraints turns round."""
    if not f.forms:
        return []
    before, after = f.forms_at(f.symbols("q")), f.forms_at(place)
    entries = [[sum((a * b for a, b in zip(row, other, strict=True)), number(0)) for other in after] for row in before]
    if not determinant(entries).free_symbols:
        return []
    return [Watch("positive", determinant(entries), RANK, RANK_REMEDY)]


def root_guards(f: Formulas, point: dict[Formula, Formula]) -> list[Watch]:
    """h |d2H/dq_i dp_i| < 1 where it is not constant: for the class of the paper this is h |G'(r1)| < 1."""
    names = {*f.symbols("q"), *f.symbols("p")}
    watches = []
    for k, coordinate in enumerate(f.problem.coordinates):
        mixed = f.hamiltonian.diff(symbol(f"q{k}")).diff(symbol(f"p{k}"))
        if mixed.free_symbols & names:
            text = f"h*|d2H/d{coordinate} dp_{coordinate}|"
            watches.append(Watch("bound", STEP * mixed.subs(point), text, GUARD_REMEDY))
    return watches


def resolution_watches(
    f: Formulas, changes: Sequence[Formula], first: Sequence[Formula], last: Sequence[Formula]
) -> list[Watch]:
    """The increments of v against the rule of the two ends: far apart where a step jumps over what the force does.

    For an oscillation they differ by (h omega)^2/12 of themselves. Walls of the accelerations end the run too: behind
    one even a motion that is smooth has lost its accuracy, because small errors were divided by what vanished.
    """
    moved = changes[f.size :]
    difference = sum(((d - (a + b) / 2) ** 2 for d, a, b in zip(moved, first, last, strict=True)), number(0))
    size = sum((d**2 + a**2 + b**2 for d, a, b in zip(moved, first, last, strict=True)), number(0))
    used = {name for force in f.accelerations for name in force.free_symbols}
    steps = [*(x / STEP for x in f.symbols("q") if x in used), *(v for v in f.symbols("v") if v in used)]
    noise = number(ROUND_OFF) * sum((x**2 for x in steps), number(0))
    # Where the force passes 0 the velocity is what counts.
    size += sum((v**2 for v in f.symbols("v")), number(0)) / 100
    ratio = difference / (size + noise + number(SMALLEST))
    after = [x + d for x, d in zip((*f.symbols("q"), *f.symbols("v")), changes, strict=True)]
    point = dict(zip([*f.symbols("q"), *f.symbols("v"), MOMENT], [*after, moment_at(ONE)], strict=True))
    walls = [
        Watch("sign", wall.formula.subs(point), wall.text, REGULAR_MOTION)
        for wall in f.walls_of(f.problem.accelerations or ())
    ]
    return [*walls, Watch("resolution", ratio, RESOLUTION, RESOLVE, RESOLVED)]
