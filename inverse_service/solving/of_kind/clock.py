"""A system with another clock: dtau = N(q) dt, q' = dq/dtau (Chaplygin 1911), given or looked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from inverse_service import bounds
from inverse_service.deadline import now
from inverse_service.decision.deciding import decide, variables_of
from inverse_service.expressions.derivative import differentiate
from inverse_service.expressions.tree import (
    ONE,
    TIME,
    Apply,
    Arbitrary,
    Expression,
    Number,
    Power,
    Symbol,
    Velocity,
    add,
    substitute,
    walk,
)
from inverse_service.expressions.tree import subtract as less
from inverse_service.field.exact_field import Budget, TooLarge, exact_ring
from inverse_service.field.real_point import find_real_point, requirements
from inverse_service.field.tower import to_kernels
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics.constrained_motion import (
    ORDERS,
    TERM_LIMIT,
    EliminatedMotion,
    Frame,
    Geometry,
    NonholonomicSystem,
)
from inverse_service.mechanics.nonholonomic_integrals import measure_density
from inverse_service.mechanics.second_order_system import Branch, SecondOrderSystem, branches_of
from inverse_service.search.terms import collected

# Of a factor of f, and of the density of an invariant measure for n coordinates, the powers that are tried.
_POWERS = tuple(Fraction(k, 2) for k in (-1, 1, -2, 2, -4, 4))
_ORDER = 4  # of the prolongations
_SEED = 1


def with_clock(system: SecondOrderSystem, factor: Expression) -> SecondOrderSystem | None:
    """q'' = f(q, N q')/N^2 - (q'^k dN/dq^k / N) q', for f without t, where N has real values other than 0.

    On the first case of the signs in f and N that has a real point; None where none has.
    """
    names, variables = system.coordinates, variables_of(system)
    for case in branches_of(replace(system, accelerations=(*system.given, factor), branch=None)):
        *forces, clock = case.accelerations
        table = find_real_point([*map(to_kernels, forces), 1 / clock], variables, _SEED, case.positive)
        if table is None:
            continue
        faster: dict[Expression, Expression] = {Velocity(name): clock * Velocity(name) for name in names}
        rate = add(*(Velocity(q) * differentiate(clock, Symbol(q)) for q in names)) / clock
        pushes = (substitute(f, faster) / clock**2 for f in forces)
        found = tuple(collected(less(f, rate * Velocity(name))) for f, name in zip(pushes, names, strict=True))
        positive = tuple(dict.fromkeys((*case.positive, *requirements([to_kernels(clock)], table))))
        return replace(system, accelerations=found, branch=Branch(found, positive), name="")
    return None


def find_clock(
    system: SecondOrderSystem, seed: int, deadline: float
) -> tuple[Expression | None, tuple[Expression, ...]]:
    """The first N with which the system has a Lagrangian, and those that were tried before it.

    Powers of the density rho(q) of an invariant measure dq dq' come first: if g = N^2 G with det G constant, N is
    rho^(1/(n - 1)), and if det g is constant, rho^(-1/(n + 1)). Then powers of factors of f.
    """
    tried: list[Expression] = []
    for factor in _clocks(system, deadline):
        if now() > deadline:
            break
        changed = system if factor == ONE else with_clock(system, factor)
        if changed is None:
            continue
        if decide(changed, False, seed, Limits(_ORDER, deadline)).verdict == "variational":
            return factor, tuple(tried)
        tried.append(factor)
    return None, tuple(tried)


def _clocks(system: SecondOrderSystem, deadline: float) -> Iterator[Expression]:
    n, seen = len(system.coordinates), set[Expression]({ONE})
    yield ONE
    density = _density(system, deadline)
    powers = (Fraction(1, n - 1) if n > 1 else Fraction(1), Fraction(-1, n + 1), *_POWERS)
    listed = [] if density is None else [density**k for k in powers]
    listed += [factor**k for factor in _factors(system)[: bounds.CANDIDATES] for k in _POWERS]
    for factor in listed:
        if factor not in seen and not isinstance(factor, Number) and TIME not in walk(factor):
            seen.add(factor)
            yield factor


def _factors(system: SecondOrderSystem) -> list[Expression]:
    """Denominators, radicands and functions in f that hold coordinates and no velocity."""
    own = {*map(Symbol, system.coordinates)}
    found: dict[Expression, None] = {}
    for node in (node for f in system.given for node in walk(f)):
        base = node.base if isinstance(node, Power) else node if isinstance(node, Apply | Arbitrary | Symbol) else None
        if base is not None and not isinstance(base, Number):
            held = set(walk(base))
            if not own.isdisjoint(held) and not any(isinstance(part, Velocity) for part in held):
                found[base] = None
    return list(found)


def _density(system: SecondOrderSystem, deadline: float) -> Expression | None:
    """rho(q) with rho dq dq' invariant: that of the motion with these accelerations and no constraint."""
    names, n = system.coordinates, len(system.coordinates)
    variables: list[Symbol | Velocity] = [TIME, *map(Symbol, names), *map(Velocity, names)]
    try:
        ring = exact_ring(list(system.given), variables, ORDERS, Budget(TERM_LIMIT, deadline))
        zero, one = ring.constant(0), ring.constant(1)
        unit = tuple(tuple(one if i == j else zero for j in range(n)) for i in range(n))
        free = NonholonomicSystem(names, ONE, (), system.parameters, system.functions)
        parts = Geometry(free, ring, unit, (zero,) * n, zero, (), ())
        frame = Frame(tuple(range(n)), (), unit, (zero,) * n)
        speeds = tuple(parts.velocity(k) for k in range(n))
        found = measure_density(EliminatedMotion(parts, frame, speeds, tuple(map(ring.value, system.given)), unit, ()))
    except (TooLarge, ZeroDivisionError):
        return None
    return None if found.velocities is None or TIME in walk(found.velocities) else found.velocities
