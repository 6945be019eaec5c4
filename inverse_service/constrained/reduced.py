"""The reduced system of a motion on constraints, unchanged and with Chaplygin's time change dtau =
N(r) dt.

If neither the motion of the free coordinates r nor the constraints contain the other coordinates,
r'' = F(r, r') is an independent system. If its measure rho(r) dr dr' is invariant, N = (rho/det
G)^(1/(k - 1)), G the Hessian of the constrained Lagrangian l_c in the k free velocities. The
measure is unique, so no other time change gives a natural L with G. For k = 2, natural L, and
homogeneous constraints, l_c(r, N r') is a Lagrangian (Chaplygin 1911; for some systems with k > 2:
Fernandez, Mestdag, Bloch, arXiv:0909.4018; Garcia-Naranjo, Marrero, arXiv:1812.01422).

If Lagrangians are known in advance, `solution_with` decides without a search and lets the checker
confirm them.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from typing import NamedTuple

from flint import nmod_mat

from inverse_service import bounds, errors
from inverse_service.certificate import checker
from inverse_service.deadline import left, now
from inverse_service.decision import certify, deciding, solutions
from inverse_service.explanation import explaining
from inverse_service.expressions import notation, tree as ex
from inverse_service.field import exact_field, modular, real_branch, tower
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics import constrained_motion, second_order_system, writing
from inverse_service.mechanics.legendre import legendre
from inverse_service.mechanics.nonholonomic_integrals import MeasureDensity
from inverse_service.mechanics.paper_class import Proposal
from inverse_service.mechanics.second_order_system import SecondOrderSystem, system_of
from inverse_service.search import tidy
from inverse_service.solving import clock, solving
from inverse_service.statements import questions
from inverse_service.statements.questions import PLAIN

CONSTRAINED = "constrained Lagrangian"
# The seconds for the search for a time change among factors of f: each of about 26 candidates is
# decided.
LONGEST_FOR_CLOCK = 5.0

# The largest number of characters of a readable verification.
_LONGEST_STEPS = 12_000
_LONGEST_CHECK = 60.0  # seconds, for a Lagrangian that was confirmed before


@dataclass(frozen=True, slots=True)
class Decided:
    """A system, and the answer for L(q, q'), or for L(t, q, q') if t occurs."""

    system: SecondOrderSystem
    answer: solutions.Statement


@dataclass(frozen=True, slots=True)
class Reduced:
    """The reduced system, with the time change `factor`, N(r), if there is one, else `reason`."""

    plain: Decided
    others: tuple[tuple[str, ex.Expression], ...]
    factor: ex.Expression | None
    clocked: Decided | None
    reason: str = ""


def reduced_system(motion: second_order_system.ConstrainedMotion) -> SecondOrderSystem | None:
    """r'' = F(r, r') if F and the velocities of the other coordinates contain none of the other
    coordinates.
    """
    others = {ex.Symbol(name) for name in motion.dependent}
    trees = (*motion.free_accelerations, *motion.dependent_velocities)
    if any(ex.holds(tree, *others) for tree in trees):
        return None
    return system_of(motion.free, motion.free_accelerations, motion.parameters, motion.functions)


def decide_reduced(
    motion: second_order_system.ConstrainedMotion,
    lagrangian: ex.Expression | None,
    options: solutions.SolveOptions,
) -> Decided | None:
    """The answer for r'' = F(r, r'); None if the motion does not reduce. `lagrangian` is that of
    the system.
    """
    system = reduced_system(motion)
    if system is None:
        return None
    candidate = None if lagrangian is None else _on_constraints(motion, lagrangian)
    return _decided(system, candidate, replace(options, time_dependent=False, ansatz=(), given=()))


def closed_subsystem(
    exact: constrained_motion.EliminatedMotion, motion: constrained_motion.EquationsOfMotion
) -> SecondOrderSystem | None:
    """q_S'' = F(q_S, q_S') for a largest set S of coordinates whose accelerations contain no
    others, or None.

    S is closed if the differentials of its accelerations are combinations of those of q_S and q_S'
    at a point.
    """
    names, parts = motion.coordinates, exact.geometry
    velocities = [motion.on_constraints.get(ex.Velocity(name), ex.Velocity(name)) for name in names]
    variables: list[ex.Symbol | ex.Velocity] = [
        ex.TIME,
        *map(ex.Symbol, names),
        *map(ex.Velocity, motion.free),
    ]
    everything = [*variables, *map(ex.Symbol, motion.parameters)]
    slopes = slopes_at_a_point((*velocities, *motion.accelerations), variables, everything, 2)
    if slopes is None:
        return None
    rows = slopes.rows
    own = [[int(k == place) for k in range(len(variables))] for place in range(1 + len(names))]
    for size in range(len(motion.free), 0, -1):
        for chosen in combinations(range(len(names)), size):
            speeds = [rows[k] for k in chosen]
            known = [own[0], *(own[1 + k] for k in chosen), *speeds]
            closed = slopes.rank(known) == slopes.rank(
                known + [rows[len(names) + k] for k in chosen]
            )
            if closed and slopes.rank(speeds) == size:
                found = _with_free(parts, chosen)
                if found is not None:
                    return found
    return None


class Slopes(NamedTuple):
    """The derivatives of trees by some variables at a point modulo a prime, a row for each tree."""

    rows: list[list[int]]
    prime: int

    def rank(self, rows: Sequence[Sequence[int]]) -> int:
        entries = [entry for row in rows for entry in row]
        width = len(rows[0]) if rows else 0
        return int(nmod_mat(len(rows), width, entries, self.prime).rank())


def slopes_at_a_point(
    trees: Sequence[ex.Expression],
    by: Sequence[modular.Variable],
    names: Sequence[modular.Variable],
    seed: int,
) -> Slopes | None:
    """The slopes at a random point of all `names` at which the trees are real; None if none is
    found.
    """
    kernels = [tower.to_kernels(tree) for tree in trees]
    try:
        table = real_branch.find_real_point(kernels, names, seed)
        if table is None:
            return None
        point = tower.draw_point(real_branch.reduce_atoms(kernels, names, table), 1)
        return Slopes([modular.gradient(tree, by, point) for tree in kernels], point.prime)
    except (errors.IrreducibleAtoms, modular.SingularPoint, ValueError):
        return None


def _with_free(
    parts: constrained_motion.Geometry, chosen: Sequence[int]
) -> SecondOrderSystem | None:
    """The equations of these coordinates in a frame in which they are free; None if they contain
    others.
    """
    system, frame = (
        parts.system,
        next(
            (one for one in constrained_motion.frames(parts) if set(chosen) <= set(one.free)), None
        ),
    )
    if frame is None:
        return None
    try:
        whole = constrained_motion.eliminate_multipliers(parts, frame)
        accelerations = tuple(parts.tree(whole.accelerations[k]) for k in chosen)
    except (exact_field.TooLarge, errors.InputError):
        return None
    coordinates = tuple(system.coordinates[k] for k in chosen)
    others = [name for name in system.coordinates if name not in coordinates]
    held = any(
        ex.holds(tree, *map(ex.Symbol, others), *map(ex.Velocity, others)) for tree in accelerations
    )
    if held or accelerations == (ex.ZERO,):
        return None
    return system_of(coordinates, accelerations, system.parameters, system.functions)


def answer_closed(system: SecondOrderSystem, options: solutions.SolveOptions) -> Reduced:
    """The answer for a closed subsystem, without reconstruction by quadratures or a time change
    from a measure.
    """
    end, asked = (
        now() + options.time_limit,
        replace(options, time_dependent=False, ansatz=(), given=()),
    )
    alone = _decided(system, None, replace(asked, time_limit=options.time_limit / 2))
    return _searched(system, alone, (), "", asked, end)


def answer_reduced(
    motion: second_order_system.ConstrainedMotion,
    lagrangian: ex.Expression | None,
    density: MeasureDensity | None,
    options: solutions.SolveOptions,
    plain: Decided,
) -> Reduced:
    """The answer, also with a time change; `lagrangian` is the full system's, `density` its
    invariant measure.
    """
    system = plain.system
    end, asked = (
        now() + options.time_limit,
        replace(options, time_dependent=False, ansatz=(), given=()),
    )
    candidate = None if lagrangian is None else _on_constraints(motion, lagrangian)
    others = tuple(zip(motion.dependent, motion.dependent_velocities, strict=True))
    found = chaplygin_factor(system, density)
    if isinstance(found, str):
        return _searched(system, plain, others, found, asked, end)
    found, faster_system = clock.with_real_clock(system, found)
    faster = {ex.Velocity(r): found * ex.Velocity(r) for r in system.coordinates}
    known = None if candidate is None else writing.as_one_quotient(ex.substitute(candidate, faster))
    if faster_system is None:
        return _searched(
            system,
            plain,
            others,
            "The clock of the invariant measure has no real values.",
            asked,
            end,
        )
    changed = _decided(faster_system, known, replace(asked, time_limit=left(end)))
    if changed.answer.verdict == "not_variational" and plain.answer.verdict == "not_variational":
        other = _searched(system, plain, others, "", asked, end, (found,))
        return Reduced(plain, others, found, changed) if other.clocked is None else other
    return Reduced(plain, others, found, changed)


def _searched(
    system: SecondOrderSystem,
    plain: Decided,
    others: tuple[tuple[str, ex.Expression], ...],
    reason: str,
    asked: solutions.SolveOptions,
    end: float,
    refused: tuple[ex.Expression, ...] = (),
) -> Reduced:
    """The answer with the first time change from factors of f, if there is no Lagrangian without
    one; `refused` are clocks known to have none.
    """
    if (
        plain.answer.verdict != "not_variational"
        or len(system.coordinates) == 1
        or system.depends_on_time
    ):
        return Reduced(plain, others, None, None, reason)
    factor, _ = clock.find_clock(
        system,
        asked.seed,
        min((now() + end) / 2, now() + LONGEST_FOR_CLOCK),
        (ex.ONE, *refused),
    )
    clocked = None if factor is None else clock.with_clock(system, factor)
    if clocked is None:
        return Reduced(plain, others, None, None, reason)
    changed = _decided(clocked, None, replace(asked, time_limit=left(end)))
    return Reduced(plain, others, factor, changed)


def chaplygin_factor(
    system: SecondOrderSystem, density: MeasureDensity | None
) -> ex.Expression | str:
    """N, or the reason why there is none."""
    names = system.coordinates
    if len(names) == 1:
        return "One equation has a Lagrangian with any clock."
    if system.depends_on_time:
        return "The equations contain t, so no other clock can be put in its place."
    if density is None or density.momenta is None:
        return (
            "No invariant measure is known whose density is a function of these coordinates alone."
        )
    own = {*map(ex.Symbol, (*names, *system.parameters))}
    held = {node for node in ex.walk(density.momenta) if isinstance(node, ex.Symbol | ex.Velocity)}
    if not held <= own:
        return "The density of the invariant measure contains other coordinates."
    if held.isdisjoint(map(ex.Symbol, names)) and not ex.has(density.momenta, ex.Arbitrary):
        return "The measure of the momenta itself is invariant, which asks for no other clock."
    root = Fraction(1, len(names) - 1)
    # The density is positive, so the root of a power is a power.
    return ex.multiply(
        *(base ** (exponent * root) for base, exponent in ex.powers_of(density.momenta))
    )


def _on_constraints(
    motion: second_order_system.ConstrainedMotion, lagrangian: ex.Expression
) -> ex.Expression | None:
    """l_c(r, r'), or None if it contains another coordinate."""
    found = writing.as_one_quotient(ex.substitute(lagrangian, motion.on_constraints))
    return (
        None if any(ex.Symbol(name) in set(ex.walk(found)) for name in motion.dependent) else found
    )


def _decided(
    system: SecondOrderSystem, candidate: ex.Expression | None, options: solutions.SolveOptions
) -> Decided:
    """The answer from the candidate if the checker confirms it, else from the solver."""
    end = now() + options.time_limit
    without_time = (
        candidate is not None and not system.depends_on_time and not ex.holds(candidate, ex.TIME)
    )
    analysis = _analyzed(system) if without_time else None
    if candidate is not None and analysis is not None and _is_valid(analysis, candidate, end):
        known = Proposal(CONSTRAINED, legendre(candidate, system.coordinates), ())
        found = solution_with(system, [known], options, analysis)
        return Decided(found.system, found.main)
    solution = solve_once(system, replace(options, time_limit=left(end)))
    return Decided(solution.system, solution.main)


# The last complete solutions, which several questions about one motion need.
_recent: dict[tuple[SecondOrderSystem, solutions.SolveOptions], solutions.Solution] = {}


def solve_once(system: SecondOrderSystem, options: solutions.SolveOptions) -> solutions.Solution:
    """The solution without written conditions, from an earlier question about equal equations if
    that was not cut short.
    """
    asked = replace(options, conditions=False)
    key = in_sines(system, now() + options.time_limit), replace(asked, time_limit=0)
    if key not in _recent:
        found = solving.solve(system, asked)
        if found.cut:
            return found
        while len(_recent) >= bounds.FEW:
            del _recent[next(iter(_recent))]
        _recent[key] = found
    return _recent[key]


def in_sines(system: SecondOrderSystem, deadline: float) -> SecondOrderSystem:
    """The same accelerations in sines and cosines, simplified by all relations: 1/(1 + tan(x)^2) as
    cos(x)^2.
    """
    trees = [tower.to_kernels(f) for f in system.accelerations]
    budget = exact_field.Budget(bounds.TERMS, deadline)
    try:
        ring = exact_field.exact_ring(trees, system.variables, None, budget)
        return replace(
            system,
            accelerations=tuple(
                exact_field.quotient_tree(ring, ring.value(tree)) for tree in trees
            ),
        )
    except (exact_field.TooLarge, ZeroDivisionError):
        return system


def checker_accepts_each(
    system: SecondOrderSystem, proposals: Sequence[ex.Expression], deadline: float
) -> tuple[bool, ...]:
    """Whether the independent checker finds each proposal to be a regular Lagrangian of the
    system.
    """
    analysis = _analyzed(system)
    return tuple(analysis is not None and _is_valid(analysis, tree, deadline) for tree in proposals)


def _analyzed(system: SecondOrderSystem) -> deciding.Analysis | None:
    try:
        return deciding.analyze(system)
    except errors.IrreducibleAtoms:
        return None


def _is_valid(analysis: deciding.Analysis, lagrangian: ex.Expression, deadline: float) -> bool:
    """Whether the checker confirms the Lagrangian; the analysis keeps the proof."""
    certificate = certify.of_lagrangian(analysis, lagrangian, PLAIN)
    found = checker.check_certificate(certificate, time_limit=left(deadline, 1.0))
    if found.verdict == "valid":
        analysis.proofs[json.dumps(certificate)] = deciding.Proof(certificate, found)
    return found.verdict == "valid"


def solution_with(
    system: SecondOrderSystem,
    known: Sequence[Proposal],
    options: solutions.SolveOptions,
    analysis: deciding.Analysis | None = None,
) -> solutions.Solution:
    """The solution whose Lagrangian is the first of `known`; all of them must be confirmed, as by
    the `analysis` given.

    The decision is still made, because it determines the size of the space of multipliers.
    """
    began = now()
    found, left_out = explaining.printed_conditions(system) if options.conditions else (None, "")
    analysis = analysis or deciding.analyze(system)
    decision = deciding.decide(
        system, PLAIN, options.seed, Limits(deadline=began + options.time_limit), analysis=analysis
    )
    answer = _answer(analysis, decision, known)
    provenance = {
        "seed": options.seed,
        "time_limit": options.time_limit,
        "points": [dict(point) for point in decision.points],
        "seconds": {"decision": round(decision.seconds, 4), "all": round(now() - began, 4)},
        "conditions_left_out": left_out,
    }
    asked = questions.asked(options.time_dependent, system.depends_on_time)
    return solutions.Solution(system, asked, (answer,), found, provenance)


def _answer(
    analysis: deciding.Analysis, decision: deciding.Decision, known: Sequence[Proposal]
) -> solutions.Statement:
    chosen, *others = known
    tree = chosen.transform.lagrangian
    lagrangian = tidy.describe(analysis, tree, chosen.source)
    where = certify.where_proved(analysis, tree, _LONGEST_CHECK)
    claim = certify.of_lagrangian(analysis, tree, PLAIN)
    certificate, proof = certify.prove(analysis, claim, _LONGEST_CHECK)
    hamiltonian = solutions.Hamiltonian(chosen.transform, chosen.images)
    decided = (
        decision.verdict == "variational"
        and decision.space is not None
        and decision.symbol is not None
    )
    steps = (
        *(explaining.existence_steps(decision) if decided else ()),
        explaining.said(
            f"The {chosen.source} is a regular Lagrangian of the system: ",
            notation.row("L = ", tree),
            ".",
        ),
        *_short(explaining.verification_steps(analysis.system, lagrangian.multiplier)),
        *explaining.legendre_steps(hamiltonian),
    )
    return solutions.Statement(
        PLAIN,
        "variational",
        lagrangian=lagrangian,
        other_lagrangians=tuple(
            tidy.describe(analysis, one.transform.lagrangian, one.source) for one in others
        ),
        hamiltonian=hamiltonian,
        space=decision.space if decided else None,
        certificate=certificate,
        checked="valid",
        exceptions=proof.exceptions,
        explanation=steps,
        domain=where,
    )


def _short(steps: Sequence[solutions.Step]) -> tuple[solutions.Step, ...]:
    """The steps, or one sentence if they are too long; the checker has confirmed the same."""
    length = sum(len(step.text) for step in steps)
    if length <= _LONGEST_STEPS:
        return tuple(steps)
    return (
        explaining.said(
            "Worked out, its Helmholtz conditions fill pages; the independent checker has confirmed them."
        ),
    )
