"""Lagrangians for one coordinate x from two symmetries that are affine in t and x.

X = xi d/dt + eta d/dx with xi = a + b t + c x, eta alike, is a symmetry of x'' = f(t, x, v) if the
second prolongation vanishes on it:

    eta_tt + ... + (eta_x - 2 xi_t - 3 xi_x v) f - xi f_t - eta f_x - eta' f_v = 0,
    eta' = eta_t + (eta_x - xi_t) v - xi_x v^2,

which is linear in the six constants. Two of them give the last multiplier 1/det(Gamma, X1, X2)
without a quadrature. Source: S. Lie, Vorlesungen ueber Differentialgleichungen mit bekannten
infinitesimalen Transformationen, 1891, chapter 15.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import combinations

from inverse_service import bounds, errors
from inverse_service.expressions import calculus, terms as tm, tree as ex
from inverse_service.field import exact_field, matrices, real_branch
from inverse_service.mechanics import writing
from inverse_service.search import antiderivatives, material as mt, one_coordinate


@dataclass(frozen=True, slots=True)
class Symmetry:
    """xi, eta and the component eta' along v."""

    xi: ex.Expression
    eta: ex.Expression
    along: ex.Expression


def propose(material: mt.Material, seed: int) -> Sequence[ex.Expression]:
    """The Lagrangians of the multipliers of all pairs, unverified."""
    found = []
    with suppress(tm.TooManyTerms, exact_field.TooLarge, ZeroDivisionError):
        for multiplier in _multipliers(material):
            lagrangian = one_coordinate.lagrangian_of_multiplier(material, multiplier)
            if lagrangian is not None:
                found.append(lagrangian)
    return sorted(found, key=antiderivatives.reading_weight)


@dataclass(frozen=True, slots=True)
class _Scaled:
    """d2x/dtau2 = x psi(s), s = (dx/dtau)/x, in the time tau with dt = rate dtau; x^2 (psi - s^2)."""

    rate: ex.Expression
    below: ex.Expression


def is_homogeneous(material: mt.Material) -> bool:
    """Whether f = x phi(v/x) or f = x phi(t v/x)/t^2."""
    return _scaled(material) is not None


def _scaled(material: mt.Material) -> _Scaled | None:
    """The equation in the time t or log t, in which it holds v/x alone but for a factor x."""
    x, v, t = material.motion.coordinates[0], material.motion.velocities[0], ex.TIME
    (f,) = material.analysis.system.accelerations
    if not one_coordinate.applies(material):
        return None
    along = v * calculus.differentiate(f, v)
    residuals = [x * calculus.differentiate(f, x) + along - f]
    rate: ex.Expression = ex.ONE
    if ex.holds(f, t):
        rate = t
        residuals.append(t * calculus.differentiate(f, t) - along + 2 * f)
    with suppress(errors.InputError, exact_field.TooLarge, ZeroDivisionError, tm.TooManyTerms):
        if all(map(real_branch.vanishes, residuals)):
            force = x * f * rate**2 + (t * x * v if rate == t else ex.ZERO)
            below = writing.quotient(force - (rate * v) ** 2, exact_field.Budget.short())
            return None if below == ex.ZERO else _Scaled(rate, below)
    return None


def propose_homogeneous(material: mt.Material, seed: int) -> list[ex.Expression]:
    """L = (s P(s) - Q(s) + log x)/r, s = r v/x, P' = m, Q' = s m, for dx/dtau = r v, r = 1 or t,
    d2x/dtau2 = x psi(s) and m = 1/(psi - s^2).

    P and Q are named as functions of x, v and t. The symmetries are r d/dt and x d/dx.
    """
    x, v, t = material.motion.coordinates[0], material.motion.velocities[0], ex.TIME
    system, point = material.analysis.system, material.analysis.real_point
    scaled = _scaled(material)
    if scaled is None:
        return []
    rate, names = scaled.rate, antiderivatives.Integrator(system, point, integral_signs=True).names
    s = rate * v / x
    # Times x^2, the derivatives of s by x and v are -r v and r x, and that by t is x v for r = t.
    variables: dict[ex.Expression, ex.Expression] = {x: ex.negated(rate * v), v: rate * x}
    if rate == t:
        variables = {t: x * v} | variables
    P, Q = (
        ex.Integral(
            next(names),
            tuple(variables),
            (0,) * len(variables),
            tuple(slope * factor / scaled.below for slope in variables.values()),
        )
        for factor in (ex.ONE, s)
    )
    return [(s * P - Q + ex.Apply("log", mt.positive_form(x, point))) / rate]


def _multipliers(material: mt.Material) -> Iterator[one_coordinate.LastMultiplier]:
    x, v = material.motion.coordinates[0], material.motion.velocities[0]
    (force,) = material.analysis.system.accelerations
    for one, other in combinations(symmetries(force, x, v), 2):
        minors = (
            one.eta * other.along - one.along * other.eta,
            one.xi * other.along - one.along * other.xi,
            one.xi * other.eta - one.eta * other.xi,
        )
        determinant = minors[0] - v * minors[1] + force * minors[2]
        factored = antiderivatives.factored_tree(determinant, [x, v])
        moving = [(b, e) for b, e in ex.powers_of(factored) if ex.holds(b, v)]
        largest = max((ex.node_count(base) for base, _ in moving), default=0)
        if factored == ex.ZERO or largest > bounds.NODES:
            continue
        still = ex.multiply(
            *(
                base**e
                for base, e in ex.powers_of(factored)
                if ex.holds(base, x, ex.TIME) and not ex.holds(base, v)
            )
        )
        yield one_coordinate.LastMultiplier(
            antiderivatives.monomial_of(1 / still),
            tuple((base, ex.number(-e)) for base, e in moving),
        )


def symmetries(force: ex.Expression, x: ex.Symbol, v: ex.Velocity) -> list[Symmetry]:
    """A basis of the symmetries that are affine in t and x, whose constants may hold parameters."""
    t, affine = ex.TIME, (ex.ONE, ex.TIME, x)
    fields: list[tuple[ex.Expression, ex.Expression]] = [(one, ex.ZERO) for one in affine]
    fields += [(ex.ZERO, one) for one in affine]
    slopes = [calculus.differentiate(force, q) for q in (t, x, v)]
    columns = []
    for xi, eta in fields:
        (xi_t, xi_x), (eta_t, eta_x) = (
            [calculus.differentiate(one, q) for q in (t, x)] for one in (xi, eta)
        )
        along = eta_t + (eta_x - xi_t) * v - xi_x * v**2
        rate = (eta_x - 2 * xi_t - 3 * xi_x * v) * force
        columns.append(rate - xi * slopes[0] - eta * slopes[1] - along * slopes[2])
    found = []
    for vector in _relations(columns, x, v):
        xi, eta = (
            ex.add(*(c * one[k] for c, one in zip(vector, fields, strict=True))) for k in (0, 1)
        )
        (xi_t, xi_x), (eta_t, eta_x) = (
            [calculus.differentiate(one, q) for q in (t, x)] for one in (xi, eta)
        )
        found.append(Symmetry(xi, eta, eta_t + (eta_x - xi_t) * v - xi_x * v**2))
    return found


def _relations(
    columns: Sequence[ex.Expression], x: ex.Symbol, v: ex.Velocity
) -> list[list[ex.Expression]]:
    """A basis of the constants c, which may hold parameters, with sum c_k columns[k] = 0."""
    budget = exact_field.Budget.short()
    ring = exact_field.exact_ring(columns, [ex.TIME, x, v], None, budget)
    vectors = matrices.null_vectors(ring, [[ring.value(one)] for one in columns])
    return [[exact_field.quotient_tree(ring, c) for c in vector] for vector in vectors]
