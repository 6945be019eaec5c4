"""A system after a time change dtau = N(q) dt, q' = dq/dtau (Chaplygin 1911), with N given or
searched for.
"""

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from inverse_service import bounds, errors
from inverse_service.deadline import now
from inverse_service.decision import deciding
from inverse_service.expressions import calculus, terms, tree as ex
from inverse_service.field import exact_field, real_branch, tower
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics import (
    constrained_motion,
    nonholonomic_integrals,
    second_order_system,
)
from inverse_service.statements.questions import PLAIN

# The powers tried for the density of an invariant measure and for factors of f.
_POWERS = tuple(Fraction(k, 2) for k in (-1, 1, -2, 2, -4, 4))
_ORDER = 4  # of prolongation
_SEED = 1


def with_clock(
    system: second_order_system.SecondOrderSystem,
    factor: ex.Expression,
    written: Callable[[ex.Expression], ex.Expression] = terms.collected,
) -> second_order_system.SecondOrderSystem | None:
    """q'' = f(q, N q')/N^2 - (q'^k dN/dq^k / N) q', for f without t, where N has real values other
    than 0.

    On the first combination of signs in f and N with a real point; None if there is none.
    """
    names, variables = system.coordinates, deciding.variables_of(system)
    for case in second_order_system.branches_of(
        replace(system, accelerations=(*system.given, factor), branch=None)
    ):
        *forces, clock = case.accelerations
        table = real_branch.find_real_point(
            [*map(tower.to_kernels, forces), 1 / clock], variables, _SEED, case.positive
        )
        if table is None:
            continue
        faster = {ex.Velocity(name): clock * ex.Velocity(name) for name in names}
        rate = (
            ex.add(*(ex.Velocity(q) * calculus.differentiate(clock, ex.Symbol(q)) for q in names))
            / clock
        )
        pushes = (ex.substitute(f, faster) / clock**2 for f in forces)
        found = tuple(
            written(ex.subtract(f, rate * ex.Velocity(name)))
            for f, name in zip(pushes, names, strict=True)
        )
        positive = tuple(
            dict.fromkeys(
                (*case.positive, *real_branch.requirements([tower.to_kernels(clock)], table))
            )
        )
        return replace(
            system, accelerations=found, branch=second_order_system.Branch(found, positive), name=""
        )
    return None


class RealClock(NamedTuple):
    """N in dtau = N dt, and the system with this clock; None where it has no real values."""

    factor: ex.Expression
    system: second_order_system.SecondOrderSystem | None


def with_real_clock(
    system: second_order_system.SecondOrderSystem,
    factor: ex.Expression,
    written: Callable[[ex.Expression], ex.Expression] = terms.collected,
) -> RealClock:
    """The system with this clock, with sqrt(-u) for sqrt(u) in N where only that has real values."""
    changed = with_clock(system, factor, written)
    if changed is None:
        powers = ex.powers_of(factor)
        trees = [
            tower.to_kernels(tree)
            for tree in (*system.accelerations, *(base**-1 for base, _ in powers))
        ]
        table = real_branch.find_real_point(
            trees, deciding.variables_of(system), _SEED, system.positive
        )
        if table is not None:
            even = {
                base
                for base, e in powers
                if e.denominator % 2 == 0 and real_branch.real_sign(base, table) < 0
            }
            factor = ex.multiply(
                *((ex.negated(base) if base in even else base) ** e for base, e in powers)
            )
            changed = with_clock(system, factor, written)
    return RealClock(factor, changed)


class FoundClock(NamedTuple):
    """A factor of time, None without one, and all that were tried."""

    factor: ex.Expression | None
    tried: tuple[ex.Expression, ...]


def find_clock(
    system: second_order_system.SecondOrderSystem,
    seed: int,
    deadline: float,
    refused: Collection[ex.Expression] = (),
) -> FoundClock:
    """The first N for which the system has a Lagrangian, and those tried before it; without those
    for which it is known to have none.

    Powers of the density rho(q) of an invariant measure dq dq' come first: if g = N^2 G with det G
    constant, N is rho^(1/(n - 1)), and if det g is constant, rho^(-1/(n + 1)). Then powers of
    factors of f.
    """
    tried: list[ex.Expression] = []
    for factor in _clocks(system, deadline):
        if factor in refused:
            continue
        if now() > deadline:
            break
        changed: second_order_system.SecondOrderSystem | None = system
        if factor != ex.ONE:
            factor, changed = with_real_clock(system, factor, lambda tree: tree)  # for a decision
        if changed is None:
            continue
        if _has_lagrangian(changed, seed, Limits(_ORDER, deadline)):
            return FoundClock(factor, tuple(tried))
        tried.append(factor)
    return FoundClock(None, tuple(tried))


def _has_lagrangian(
    system: second_order_system.SecondOrderSystem, seed: int, limits: Limits
) -> bool:
    """Whether a Lagrangian is known to exist; most candidates are refused at the first point."""
    try:
        analysis = deciding.analyze(system)
    except errors.IrreducibleAtoms:
        return False
    if deciding.is_refused_at_a_point(analysis, PLAIN, seed, limits):
        return False
    decision = deciding.decide(system, PLAIN, seed, limits, analysis=analysis)
    return decision.verdict == "variational"


def _clocks(
    system: second_order_system.SecondOrderSystem, deadline: float
) -> Iterator[ex.Expression]:
    n, seen = len(system.coordinates), set[ex.Expression]({ex.ONE})
    yield ex.ONE
    density = _density(system, deadline)
    powers = (Fraction(1, n - 1) if n > 1 else Fraction(1), Fraction(-1, n + 1), *_POWERS)
    listed = [] if density is None else [density**k for k in powers]
    listed += [factor**k for factor in _factors(system)[: bounds.CANDIDATES] for k in _POWERS]
    for factor in listed:
        if (
            factor not in seen
            and not isinstance(factor, ex.Number)
            and ex.TIME not in ex.walk(factor)
        ):
            seen.add(factor)
            yield factor


def _factors(system: second_order_system.SecondOrderSystem) -> list[ex.Expression]:
    """The denominators, radicands, and functions in f that contain coordinates but no
    velocities.
    """
    own = {*map(ex.Symbol, system.coordinates)}
    found: dict[ex.Expression, None] = {}
    for node in (node for f in system.given for node in ex.walk(f)):
        base = node.base if isinstance(node, ex.Power) else node
        if isinstance(node, ex.Power | ex.Apply | ex.Arbitrary | ex.Symbol) and not isinstance(
            base, ex.Number
        ):
            held = set(ex.walk(base))
            if not own.isdisjoint(held) and not any(isinstance(part, ex.Velocity) for part in held):
                found[base] = None
    return list(found)


def _density(
    system: second_order_system.SecondOrderSystem, deadline: float
) -> ex.Expression | None:
    """rho(q) with rho dq dq' invariant under the motion with these accelerations and no
    constraints.
    """
    names, n = system.coordinates, len(system.coordinates)
    try:
        budget = exact_field.Budget(constrained_motion.TERM_LIMIT, deadline)
        ring = exact_field.exact_ring(
            list(system.given), system.variables, constrained_motion.ORDERS, budget
        )
        zero, one = ring.constant(0), ring.constant(1)
        unit = tuple(tuple(one if i == j else zero for j in range(n)) for i in range(n))
        free = constrained_motion.NonholonomicSystem(
            names, ex.ONE, (), system.parameters, system.functions
        )
        parts = constrained_motion.Geometry(free, ring, unit, (zero,) * n, zero, (), ())
        frame = constrained_motion.Frame(tuple(range(n)), (), unit, (zero,) * n)
        speeds = tuple(parts.velocity(k) for k in range(n))
        found = nonholonomic_integrals.measure_density(
            constrained_motion.EliminatedMotion(
                parts, frame, speeds, tuple(map(ring.value, system.given)), unit, ()
            )
        )
    except (exact_field.TooLarge, ZeroDivisionError):
        return None
    return (
        None
        if found.velocities is None or ex.TIME in ex.walk(found.velocities)
        else found.velocities
    )
