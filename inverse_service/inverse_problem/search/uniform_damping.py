"""e^(int c dt) L_0 for f = f_0 - c(t) q' where f_0 has a Lagrangian L_0.

Along q'' = f_0 - c v the Euler-Lagrange expressions of e^(int c dt) L_0 are e^(int c dt) c (p - g v), with
p = dL_0/dv and g its Hessian: they vanish where p = g v, as for a kinetic energy that is quadratic in v
without linear terms (Bateman 1931 for one coordinate).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.tree import TIME, Apply, Expression, Velocity, add, children, multiply, walk
from inverse_service.inverse_problem.decision.analysis import analyse
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.inverse_problem.search.deadline import end
from inverse_service.inverse_problem.search.divergence import divergence_factor
from inverse_service.inverse_problem.search.found import Ladder
from inverse_service.inverse_problem.search.integrating import integrating_factor
from inverse_service.inverse_problem.search.material import Material, coefficient
from inverse_service.inverse_problem.search.numerical_verification import holds_numerically
from inverse_service.inverse_problem.search.terms import Terms, TooManyTerms, monomial, monomial_tree, terms_of, tree_of
from inverse_service.linear_pde.deciding import Limits
from inverse_service.mechanics.second_order_system import SecondOrderSystem

_WORK = 600_000


def is_damped(material: Material) -> bool:
    """Whether L may depend on t and every f_i holds its own velocity."""
    pairs = zip(material.motion.velocities, material.analysis.system.accelerations, strict=True)
    return material.motion.with_time and all(any(node == v for node in walk(f)) for v, f in pairs)


def damped_lagrangians(material: Material, seed: int, ladder: Ladder) -> Sequence[Expression]:
    """e^(int c dt) L_0, verified to 40 digits; none where no c gives a system with such an L_0."""
    table = material.analysis.real_point
    for rate, factor in _rates(material, seed) if table is not None else ():
        analysis = analyse(_undamped(material, rate))
        with_time, limits = analysis.system.depends_on_time, Limits(deadline=end())
        if decide(analysis.system, with_time, seed, limits, _ignore, analysis=analysis).verdict != "variational":
            continue
        undamped = ladder(analysis, with_time, seed, _WORK)
        trees = undamped.lagrangians if undamped is not None else ()
        damped = [multiply(factor, tree) for tree in trees]
        found = [tree for tree in damped if table and holds_numerically(material.analysis.system, tree, table, seed)]
        if found:
            return tuple(found)
    return ()


def _ignore(_: str) -> None:
    return


def _rates(material: Material, seed: int) -> Iterator[tuple[Expression, Expression]]:
    """(c, e^(int c dt)): the coefficient common to all -v_i in f_i, or what the divergence asks for."""
    common = _common_coefficient(material)
    factor = integrating_factor(material, common, TIME, seed) if common else None
    if common and factor:
        yield tree_of({key: -value for key, value in common.items()}), monomial_tree(factor)
        return
    whole = divergence_factor(material, seed)
    if whole:
        ((exponential, e),) = whole
        (argument,) = children(exponential)
        rate = tree_of({key - {(TIME, Fraction(1))}: value * e for key, value in terms_of(argument).items()})
        yield rate, Apply("exp", multiply(rate, TIME))


def _common_coefficient(material: Material) -> Terms | None:
    """The terms c with c v_i in every f_i as it is written, c without coordinates."""
    motion = material.motion
    shared: Terms | None = None
    for v, f in zip(motion.velocities, material.analysis.system.accelerations, strict=True):
        try:
            own = coefficient(terms_of(f), monomial(v))
        except TooManyTerms:
            return None
        plain = {k: c for k, c in own.items() if not any(_varies(letter, material) for letter, _ in k)}
        shared = plain if shared is None else {k: c for k, c in shared.items() if plain.get(k) == c}
    return shared


def _varies(letter: Expression, material: Material) -> bool:
    """Whether a letter depends on coordinates; the time may stand in it."""
    return any(node in material.motion.coordinates for node in walk(letter))


def _undamped(material: Material, rate: Expression) -> SecondOrderSystem:
    """q'' = f + c v."""
    system = material.analysis.system
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    without = tuple(collect(add(f, multiply(rate, Velocity(name)))) for name, f in pairs)
    return replace(system, accelerations=without)
