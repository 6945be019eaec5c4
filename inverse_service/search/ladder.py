"""Try the rungs, methods and rows of the ansatz, by increasing cost until one gives a regular
Lagrangian.

`RUNGS` is the whole ladder in its order. What a rung costs, which systems it accepts, and after
which one the search ends are data there; how many Lagrangians of a method are kept is in
`_first_verified`, and of a row of the ansatz in `ansatz.best_members`. A rung is skipped if it
costs more than the caller allows, if its method does not fit the system, or if all terms of its row
have been tried.
"""

import itertools
import math
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import mpmath

from inverse_service import bounds, errors
from inverse_service.deadline import OutOfTime, check, within
from inverse_service.decision import deciding
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, real_branch
from inverse_service.mechanics import euler_lagrange
from inverse_service.search import (
    ansatz,
    antiderivatives,
    families,
    homogeneous,
    invariant_curves,
    linear_systems,
    material as mt,
    moving_matrix,
    one_coordinate,
    one_matrix,
    plane_sprays,
    reductions,
    row_factors,
    tidy,
    two_symmetries,
    with_integrals,
)
from inverse_service.statements.questions import Question
from inverse_service.statements.stages import ANSATZ, METHOD, Progress, Stage

# The least and the greatest number of coordinates; kernels of matrices at points are cheap for a
# few.
ANY, ONE, SEVERAL, FEW = (1, math.inf), (1, 1), (2, math.inf), (2, 8)


@dataclass(frozen=True, slots=True)
class Method:
    """A method for the systems of some `sizes` that it accepts.

    `sizes` are the least and the greatest number of coordinates.

    `propose(material, seed)` yields regular Lagrangians, simplest first. The search verifies them
    unless the method is `exact`. `reason` explains in a sentence how such a Lagrangian is derived.
    A method `for_both` proposes the same for L(q, v) and L(t, q, v). If a method is `last`, no
    later rung can find more for the systems that it fits.
    """

    name: str
    cost: float
    sizes: tuple[float, float]
    propose: Callable[[mt.Material, int], Iterable[ex.Expression]]
    reason: str
    accepts: Callable[[mt.Material], bool] = lambda _: True
    exact: bool = False
    for_both: bool = False
    last: bool = False

    def fits(self, material: mt.Material) -> bool:
        least, most = self.sizes
        return least <= material.motion.size <= most and self.accepts(material)


Rung = Method | families.Family


def _lift_first(
    smaller_systems: Callable[[mt.Material, int], Iterator[reductions.Smaller]],
    material: mt.Material,
    seed: int,
) -> Sequence[ex.Expression]:
    """The Lagrangians lifted from those of the first smaller systems for which this succeeds."""
    for smaller in smaller_systems(material, seed):
        found = _of_smaller(smaller, seed)
        lifted = smaller.lift(found) if found else ()
        if lifted:
            return lifted
    return ()


def _of_parts(material: mt.Material, seed: int) -> list[ex.Expression]:
    """The first regular sum of the Lagrangians of the largest closed parts."""
    sums = _lift_first(reductions.over_common, material, seed)
    regular = (tree for tree in sums if holds_numerically(material.analysis, tree, seed))
    return list(itertools.islice(regular, 1))


def _of_smaller(smaller: reductions.Smaller, seed: int) -> list[tuple[ex.Expression, ...]]:
    """The Lagrangians of each system; none at all if one system has none."""
    found = []
    for system, question in zip(smaller.systems, smaller.questions, strict=True):
        with within(bounds.WORK):
            one = search(deciding.analyze(system), question, seed, lambda _: None).found
        if one is None:
            return []
        found.append(one.lagrangians)
    return found


# In the order of their costs, which are also the scale of `highest` in `search`.
RUNGS: tuple[Rung, ...] = (
    Method(
        "one matrix",
        0.4,
        FEW,
        one_matrix.propose,
        "The algebraic conditions determine a matrix `G(t, q)` up to a factor `phi`. In "
        "`L = phi G_ij v^i v^j/2 + A_i v^i - V`, `G` then determines the derivatives of `phi`, `A` and `V`.",
        for_both=True,
    ),
    Method(
        "one matrix that depends on the velocities",
        0.5,
        FEW,
        moving_matrix.propose,
        "The algebraic conditions determine a matrix `G(t, q, v)` up to a factor `phi`, and `G` the derivatives of "
        "`phi`. Integrating `phi G` twice over the velocities, then `A` and `V`, gives `L`.",
        for_both=True,
    ),
    Method(
        "linear systems, a constant multiplier times exp(c*t)",
        1.5,
        SEVERAL,
        linear_systems.propose,
        "The system is linear. The equations times `exp(c*t)`, with the trace `n c` of the damping, have sums with "
        "constant factors that are self-adjoint; integration gives `L`.",
        accepts=linear_systems.is_linear,
    ),
    families.Family(
        "quadratic in the velocities, short factors", 2, families.quadratic, bounds.SMALL
    ),
    Method(
        "blocks in sums of the coordinates",
        2.05,
        FEW,
        partial(_lift_first, reductions.into_sums),
        "In sums of the coordinates with constant factors the system decouples, so the Lagrangian is the sum of the "
        "Lagrangians of its blocks.",
        accepts=reductions.has_sums,
    ),
    Method(
        "complex or dual coordinates",
        2.07,
        FEW,
        partial(_lift_first, reductions.over_numbers),
        "Constant matrices that commute with all derivatives of `f` make it a system of half as many complex or dual "
        "coordinates. Both parts of a Lagrangian of that system are Lagrangians.",
        accepts=reductions.has_sums,
    ),
    Method(
        "each equation times a function",
        2.1,
        ANY,
        row_factors.propose,
        "Multiplied by functions of `t` and the coordinates, the equations are self-adjoint. Their mass matrix is then "
        "the velocity Hessian of `L`, and integration gives `L`.",
        exact=True,
    ),
    Method(
        "decoupled blocks one by one",
        3.55,
        SEVERAL,
        partial(_lift_first, reductions.into_blocks),
        "The system decouples, so the Lagrangian is the sum of the Lagrangians of its blocks.",
        accepts=reductions.is_decoupled,
        exact=True,
        last=True,  # later rungs have been tried on each block, and pairs of blocks come before
    ),
    Method(
        "straight paths, powers of the common factor of f",
        3.58,
        SEVERAL,
        homogeneous.propose,
        "All equations have one factor `P` in common, `q'' = P q'`. Products of powers of `P`, its roots and the "
        "velocities of one degree in all scalings of `f` have a combination that is a Lagrangian.",
        accepts=homogeneous.has_common_factor,
    ),
    Method(
        "straight paths, sums of velocities and roots",
        3.59,
        SEVERAL,
        homogeneous.propose_sums,
        "All equations have one factor `P` in common, `q'' = P q'`. A sum `F` of velocities and roots over the "
        "denominators of `P` is constant along all motions and satisfies the Euler-Lagrange equations along them "
        "(Hamel), so `L = F^2/2` does, too.",
        accepts=homogeneous.has_common_factor,
    ),
    Method(
        "a coordinate as time",
        3.6,
        SEVERAL,
        partial(_lift_first, reductions.along_a_coordinate),
        "The equation of a coordinate `u` holds no other, and with `u` as time the paths are those of a Lagrangian "
        "`M(u, x, dx/du)`. `L = u' M(u, x, x'/u') + S(u, u')`, where `S` is a Lagrangian of `u`.",
        accepts=reductions.has_coordinate_as_time,
    ),
    families.Family(
        "functions of velocities, short factors", 4, families.functions_of_velocities, bounds.SMALL
    ),
    families.Family(
        "quadratic, roots of constant velocities", 4.1, families.roots_of_constants, bounds.SMALL
    ),
    Method(
        "constant sums of velocities",
        4.5,
        FEW,
        partial(_lift_first, reductions.with_constant_sums),
        "Some sums of the coordinates with constant factors have constant velocities. The Lagrangian is one of the "
        "system in these sums and in others.",
    ),
    Method(
        "parts with coordinates in common",
        4.55,
        SEVERAL,
        _of_parts,
        "Some parts of the system have equations of their own, with coordinates in common. Each part has a "
        "Lagrangian, and their sum is one of the system.",
        accepts=reductions.has_common_coordinates,
        exact=True,
    ),
    Method(
        "polar coordinates",
        4.6,
        (2, 3),
        partial(_lift_first, reductions.into_polar),
        "Rotations map motions to motions. In `r` and `phi` of a plane through the origin the equations do not hold "
        "`phi`, and with `r = |q|` and `phi' = |q x q'|/r^2` a Lagrangian that does not either is one of the system.",
        accepts=reductions.is_rotational,
    ),
    Method(
        "two coordinates, forces that are forms in the velocities",
        4.65,
        (2, 2),
        plane_sprays.propose,
        "The forces hold the velocities alone and have degree 2. `L = exp(k.q) psi(v)` of degree 2 is its own energy, "
        "so `psi` follows from `k` by one quadrature, and the other equation is linear in `k`.",
        accepts=plane_sprays.accepts,
        for_both=True,
    ),
    Method(
        "one coordinate, products of Darboux factors",
        6.5,
        ONE,
        one_coordinate.propose,
        "For one coordinate the only condition is `Gamma(g) + g df/dv = 0`. A product of Darboux factors (`Gamma(P)` "
        "is a multiple of `P`) solves it. Integrating `g` twice over `v` gives `L`.",
        accepts=one_coordinate.applies,
    ),
    Method(
        "one coordinate, a curve that the motion does not leave",
        6.6,
        ONE,
        invariant_curves.propose,
        "For `J = v - A(t, x)` with `Gamma(J) = K J`, `exp(int c dt) x^s J^p` solves `Gamma(g) + g df/dv = 0` if "
        "`p K + s v/x + c = -df/dv`. Integrating `g` twice over `v` gives `L`.",
        accepts=invariant_curves.applies,
        exact=True,
    ),
    Method(
        "one coordinate, two symmetries",
        6.7,
        ONE,
        two_symmetries.propose,
        "Two symmetries `X_1`, `X_2` of the equation give the solution `1/det(Gamma, X_1, X_2)` of "
        "`Gamma(g) + g df/dv = 0` (Lie). Integrating `g` twice over `v` gives `L`.",
        accepts=one_coordinate.applies,
    ),
    families.Family("products of up to four velocities", 7, families.polynomials, bounds.LARGE),
    families.Family(
        "logarithms and arctangents of two velocities", 9, families.complex_logarithms, bounds.SMALL
    ),
    Method(
        "a quadratic integral in denominators",
        9.2,
        (3, 8),
        with_integrals.propose,
        "Some coordinates have equations of their own with an integral `D` that is quadratic in the velocities. Products "
        "of velocities and coordinates over `D`, of one degree in all scalings of `f`, have a combination that is a "
        "Lagrangian.",
        accepts=with_integrals.applies,
    ),
    Method(
        "one coordinate, a function of the velocity",
        9.5,
        ONE,
        one_coordinate.propose_function_of_velocity,
        "`f = F(v) (G(t, x) - A(t) P - B(x) Q)` has the multiplier `phi/F`, where `P' = 1/F`, `Q' = v/F`, "
        "`phi_t = A phi` and `phi_x = B phi`. Nonelementary integrals are left unevaluated.",
        exact=True,
    ),
    Method(
        "one coordinate, homogeneous in x and v",
        9.6,
        ONE,
        two_symmetries.propose_homogeneous,
        "`f = x phi(v/x)`, or `f = x phi(t v/x)/t^2` with the time `log(t)`, has the symmetries `d/dt` and `x d/dx`. "
        "They give `L = W(v/x) + log(x)` with `W'' = 1/(phi(s) - s^2)`. Nonelementary integrals are left unevaluated.",
        accepts=two_symmetries.is_homogeneous,
        exact=True,
    ),
)
REASONS = {rung.name: rung.reason for rung in RUNGS if isinstance(rung, Method)}


def holds_numerically(analysis: deciding.Analysis, tree: ex.Expression, seed: int) -> bool:
    """Whether the Euler-Lagrange expressions vanish to 50 digits and g is regular at two points
    near a real one.
    """
    system, generator = analysis.system, random.Random(seed)
    residuals = euler_lagrange.euler_lagrange_sums(tree, system.coordinates, system.accelerations)
    form = euler_lagrange.hessian(tree, system.coordinates)
    nodes = ex.distinct_nodes((*residuals, *itertools.chain(*form)))
    functions = [node for node in nodes if isinstance(node, ex.Arbitrary)]
    other = real_branch.find_real_point(
        [*system.accelerations, tree], deciding.variables_of(system), seed
    )
    for table in filter(None, (analysis.real_point, other)):
        with mpmath.workdps(bounds.DIGITS), suppress(calculus.NoRealValue):
            for _ in range(2):
                # Near the given point, hence on the same branch of all roots; function values are
                # independent generators.
                near = {
                    name: value * (1 + _random_fraction(generator) / 10**5)
                    for name, value in table.items()
                }
                point = {node: _random_fraction(generator) for node in functions} | near
                entries = mpmath.matrix(
                    [[calculus.evaluate(entry, point) for entry in row] for row in form]
                )
                is_regular = sum(euler_lagrange.inertia(entries) or ()) == len(system.coordinates)
                if not (is_regular and all(real_branch.is_small(one, point) for one in residuals)):
                    return False
            return True
    return False


def _random_fraction(generator: random.Random) -> mpmath.mpf:
    """A random multiple of 1/1000 between 0 and 1."""
    return mpmath.mpf(generator.randrange(1, 1000)) / 1000


@dataclass(slots=True)
class _Search:
    """The state of a search: its material, the rungs tried, and the terms of the ansatz without a
    Lagrangian.
    """

    material: mt.Material
    seed: int
    progress: Progress
    tried: list[tuple[str, int]]
    terms_tried: set[tm.Monomial] = field(default_factory=set)
    factors: families.Factors | None = None


def search(
    analysis: deciding.Analysis,
    question: Question,
    seed: int,
    progress: Progress,
    own_terms: Sequence[ex.Expression] = (),
    holds: Callable[[ex.Expression], bool] = lambda _: True,
    highest: float = math.inf,
) -> tidy.SearchOutcome:
    """The result of the first rung that gives a regular Lagrangian, or the rungs tried; the
    caller's terms come first.

    Rungs that cost more than `highest` are skipped. Lagrangians before the first one that `holds`
    are dropped.
    """
    tried: list[tuple[str, int]] = []
    with suppress(OutOfTime, tm.TooManyTerms):
        if "material" not in analysis.proposals:
            analysis.proposals["material"] = mt.gather_material(
                tidy.with_plain_forces(analysis), question
            )
        material = mt.for_question(analysis.proposals["material"], question)
        analysis, state = material.analysis, _Search(material, seed, progress, tried)
        own = families.own_family(own_terms)
        for rung in (*([own] if own else []), *(rung for rung in RUNGS if rung.cost <= highest)):
            check()
            found = attempt(state, rung)
            if (
                found is not None
                and (kept := _first_that_holds(found, analysis, holds)) is not None
            ):
                return tidy.SearchOutcome(kept, tuple(tried))
            if isinstance(rung, Method) and rung.last and rung.fits(material):
                break
    return tidy.SearchOutcome(None, tuple(tried))


def _first_that_holds(
    found: tidy.Found, analysis: deciding.Analysis, holds: Callable[[ex.Expression], bool]
) -> tidy.Found | None:
    """The Lagrangians from the first one that holds on; each is shortened unless the short form
    does not hold.
    """
    table = analysis.real_point or {}
    for k, tree in enumerate(found.lagrangians):
        forms = (tidy.shorten_lagrangian(tree, analysis.system), tree)
        for form in dict.fromkeys(
            antiderivatives.real_form(one, table) if table else one for one in forms
        ):
            if holds(form):
                others = (
                    tidy.shorten_lagrangian(other, analysis.system)
                    for other in found.lagrangians[k + 1 :]
                )
                trees = tuple(dict.fromkeys((form, *others)))
                return replace(found, lagrangians=trees, parts=() if k else found.parts)
    return None


def attempt(state: _Search, rung: Rung) -> tidy.Found | None:
    """The Lagrangians that one rung finds, or None."""
    if isinstance(rung, families.Family):
        return _by_ansatz(state, rung)
    if not rung.fits(state.material):
        return None
    state.progress(Stage(METHOD, rung.name))
    known = state.material.analysis.proposals if rung.for_both else {}
    try:
        if rung.name not in known:
            trees = rung.propose(state.material, state.seed)
            known[rung.name] = tuple(trees) if rung.for_both else trees
        asked = (
            tree
            for tree in known[rung.name]
            if state.material.motion.question.timed or not ex.holds(tree, ex.TIME)
        )
        proposed = tuple(asked if rung.exact else _first_verified(state, asked))
    except (*ansatz.NO_POINTS, errors.InputError, ArithmeticError, KeyError):
        known.setdefault(rung.name, ())  # it fails for both questions
        proposed = ()
    state.tried.append((rung.name, len(proposed)))
    return tidy.Found(proposed, rung.name, proposed[:1]) if proposed else None


def _first_verified(state: _Search, trees: Iterable[ex.Expression]) -> list[ex.Expression]:
    """The first few trees that are Lagrangians; no more are computed."""
    found: list[ex.Expression] = []
    for tree in trees:
        if tree not in found and holds_numerically(state.material.analysis, tree, state.seed):
            found.append(tree)
        if len(found) == bounds.FEW:
            break
    return found


def _by_ansatz(state: _Search, family: families.Family) -> tidy.Found | None:
    state.progress(Stage(ANSATZ, family.name))
    if state.factors is None and not family.given:
        state.factors = families.find_factors(state.material)
    for terms in families.kinetic_terms(
        state.material, family, state.factors or families.NO_FACTORS, state.seed
    ):
        if terms and set(terms) <= state.terms_tried:
            continue
        state.terms_tried.update(terms)
        state.tried.append((family.name, len(terms)))
        found = _solve_ansatz(state.material, family, terms, state.seed)
        if found is not None:
            return found
    return None


def _solve_ansatz(
    material: mt.Material, family: families.Family, terms: Sequence[tm.Monomial], seed: int
) -> tidy.Found | None:
    """Compute the multipliers in the span of the terms, then Lagrangians for the simplest regular
    ones.
    """
    if not terms:
        return None
    try:
        sampler = ansatz.sampler_of(material.analysis, terms)
        if material.analysis.system.parameters:
            space = ansatz.solve_multiplier_over_parameters(
                sampler, ansatz.occurring_terms(sampler, terms, seed)
            )
        else:
            space = ansatz.solve_multiplier(sampler, terms, seed)
        best = ansatz.best_members(space, seed, partial(families.with_potential, material))
        parts = [
            families.with_potential(material, part) for member in best[:1] for part in member.parts
        ]
    except (*ansatz.NO_POINTS, exact_field.TooLarge, tm.TooManyTerms):
        return None
    if not best:
        return None
    trees = dict.fromkeys(tm.tree_of(member.terms) for member in best)
    kinetic = [key for member in best for part in member.parts for key in part]
    return tidy.Found(tuple(trees), families.label(family, kinetic), tuple(map(tm.tree_of, parts)))
