"""What is watched at every step, so that a run ends where its formulas end, and whether a step has one root only.

One equation F(d) = 0 whose derivative has one sign for all real values has at most one root: so for a convex potential
at any step, 1 + h^2 V''/4 > 0. Signs are read off the formula: even powers, exponentials and hyperbolic cosines,
parameters by their values; what cannot be read off is not claimed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import symengine

from inverse_service.integrators.variational import between
from inverse_service.kernels.codegen.planning import determinant
from inverse_service.kernels.codegen.program import Iterate, Program, Watch
from inverse_service.kernels.codegen.symengine_trees import ONE, STEP, Formula, contains, free_names, number, symbol
from inverse_service.simulation.callables import MOMENT, Denominator, Formulas

SMALLER_STEP = "take a smaller step"
GUARD_REMEDY = "take a smaller step, or smaller free constants"
OTHER_LAGRANGIAN = "give another free_lagrangian, or use `adaptive`"
OTHER_MOTION = "use `adaptive`, or begin there again with the free_lagrangian that holds there"
RANK = "the rank of the constraints, det(w(q) w(q_next)^T)"
RANK_REMEDY = "begin elsewhere, or divide the constraints by what vanishes"
MAP_LIMIT = 1e-12
RESOLVE = f"{SMALLER_STEP} or `adaptive`; guard = false continues unchecked"
REGULAR_MOTION = "take a smaller step or `adaptive`; where the forces have a pole, stop before"
RESOLUTION = "the error of a step compared with its change of the velocity, squared"
# The ratio squared; that of a force which acts in the last stage alone is a tenth.
RESOLVED = 0.05
ROUND_OFF, SMALLEST = 1e-18, 1e-300


def where_it_ends(f: Formulas) -> str:
    """What to do where L~ ends: the motion ends too where L~ is the Lagrangian of the scene itself."""
    return REGULAR_MOTION if f.problem.free_lagrangian == f.problem.lagrangian else OTHER_LAGRANGIAN


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


def sign_watches(walls: Iterable[Denominator], point: Mapping[Formula, Formula], remedy: str) -> list[Watch]:
    """The walls at a point of every step: none may pass 0."""
    return [Watch("sign", wall.formula.subs(point), wall.text, remedy) for wall in walls]


def velocity_watches(f: Formulas, q: list[Formula], d: list[Formula], alpha: Formula) -> list[Watch]:
    """Velocities that L~ divides by must not pass 0; where L~ divides by positions only, H~ is smooth."""
    moving = (denominator for denominator in f.denominators if denominator.moves)
    return sign_watches(moving, discrete_point(f, q, d, alpha), where_it_ends(f))


def domain_watches(f: Formulas, point: dict[Formula, Formula]) -> list[Watch]:
    """H~ must stay where it is the Hamiltonian of L~: poles and ends of its own, and p = dL~/dv(q, H_p)."""
    watches = sign_watches(f.walls_of([f.problem.free_hamiltonian]), point, where_it_ends(f))
    if f.momenta_may_fail:
        size = sum((p**2 for p in f.symbols("p")), ONE)
        defect = sum((one**2 for one in f.momenta_may_fail), number(0)) / size
        text = "p - dL/dv at the velocities that the Hamiltonian gives"
        watches.append(Watch("map", defect.subs(point), text, OTHER_LAGRANGIAN, MAP_LIMIT))
    return watches


def range_watches(f: Formulas, alpha: Formula) -> list[Watch]:
    """L~ must stay where it has the motion: at the end of the step, and at its own place where velocities count."""
    q, d = f.symbols("q"), f.symbols("d")
    return [
        Watch("domain", end.formula.subs(discrete_point(f, q, d, alpha if end.moves else ONE)), end.text, OTHER_MOTION)
        for end in f.domain
    ]


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
    return [*motion_walls(f, point), Watch("resolution", ratio, RESOLUTION, RESOLVE, RESOLVED)]


def motion_walls(f: Formulas, point: dict[Formula, Formula]) -> list[Watch]:
    """Poles, ends and kinks of the accelerations, watched at a point of q, v and t."""
    return sign_watches(f.walls_of(f.problem.accelerations or ()), point, REGULAR_MOTION)


_POSITIVE = ("exp", "cosh")


class Sign(NamedTuple):
    """value * formula >= 0 for all real values of its names; > 0 where `strict`."""

    value: int
    strict: bool


def has_unique_roots(program: Program, known: Mapping[str, float]) -> bool:
    """True where every implicit block is one monotone equation or linear; `known` gives h, a and the parameters.

    Names of `known` that are missing count as of any sign.
    """
    if any(watch.kind == "bound" for watch in program.watches):
        return False
    for block in program.blocks:
        if isinstance(block, Iterate):
            return False
        if block.affine:
            continue
        sign = sign_of(block.jacobian[0][0], known) if len(block.unknowns) == 1 else None
        if sign is None or not sign.strict:
            return False
    return True


def sign_of(formula: Formula, known: Mapping[str, float]) -> Sign | None:
    """The sign that the formula has for all real values of the names that are not known; None where none is seen."""
    names = free_names(formula)
    if names <= known.keys():
        return _of_number(float(formula.subs({symbol(name): number(float(known[name])) for name in names})))
    if formula.is_Symbol:
        return None
    if isinstance(formula, symengine.Pow):
        base, exponent = formula.args
        return _of_power(base, exponent, known)
    parts = [sign_of(part, known) for part in formula.args]
    if isinstance(formula, symengine.Add):
        return _of_sum(parts)
    if isinstance(formula, symengine.Mul):
        return _of_product(parts)
    return Sign(1, True) if type(formula).__name__.lower() in _POSITIVE else None


def _of_number(value: float) -> Sign | None:
    return Sign(1 if value >= 0 else -1, value != 0) if value == value else None


def _of_sum(parts: list[Sign | None]) -> Sign | None:
    signs = [part for part in parts if part is not None]
    if len(signs) < len(parts) or len({sign.value for sign in signs}) != 1:
        return None
    return Sign(signs[0].value, any(sign.strict for sign in signs))


def _of_product(parts: list[Sign | None]) -> Sign | None:
    value, strict = 1, True
    for part in parts:
        if part is None:
            return None
        value, strict = value * part.value, strict and part.strict
    return Sign(value, strict)


def _of_power(base: Formula, exponent: Formula, known: Mapping[str, float]) -> Sign | None:
    if base == symengine.E:
        return Sign(1, True)
    inner = sign_of(base, known)
    strict = inner is not None and inner.strict
    if exponent.free_symbols or (float(exponent) < 0 and not strict):
        return None
    if isinstance(exponent, symengine.Integer):
        if int(exponent) % 2 == 0:
            return Sign(1, strict)
        return None if inner is None else Sign(inner.value, strict)
    return Sign(1, strict) if inner is not None and inner.value > 0 else None
