"""Systems whose multiplier is known up to a factor, g = e^u G, but whose factor does not exist.

(H1) and (H2) give the derivatives of u:

    u_(v^k) = mu_k = -sum_i (G^-1)^(ji) (dG_ij/dv^k - dG_ik/dv^j)   for any j other than k
    Gamma(u) = a                   a G = G N + (G N)^T - Gamma(G)
    u_(q^k) = nu_k = da/dv^k - Gamma(mu_k) - (df^m/dv^k) mu_m
    u_t     = tau  = a - v^k nu_k - f^k mu_k

(the third from [d/dv^k, Gamma] = d/dq^k + (df^m/dv^k) d/dv^m). There is a multiplier only if all the
mixed derivatives agree, and tau = 0 where L may not contain t.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from inverse_service.expressions.notation import Formula, partial_derivative, row, theory
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.field.elementary import to_kernels
from inverse_service.field.exact_ring import ExactRing, sum_of
from inverse_service.field.point import Point, evaluate
from inverse_service.field.rational_functions import Quotient, TooLarge
from inverse_service.field.tower import draw_point
from inverse_service.field.truncated_series import SingularPoint
from inverse_service.mechanics.conditions import MotionInRing, Tensor11, connection
from inverse_service.mechanics.quotient_matrices import solve_square

if TYPE_CHECKING:
    from inverse_service.decision.analysis import Analysis
    from inverse_service.explanation.elimination import Elimination

Matrix = tuple[tuple[Quotient, ...], ...]


@dataclass(frozen=True, slots=True)
class Line:
    """A derivative of u, how it is found (with formulas of the theory between grave accents), and its value."""

    reason: str
    formula: Formula
    value: Quotient


@dataclass(frozen=True, slots=True)
class Contradiction:
    """The derivatives of u, and an expression in them that must be zero and is not; `note` says why it must."""

    lines: tuple[Line, ...]
    formula: Formula
    note: str
    difference: Quotient


def direction_matrix(result: Elimination, n: int, one: Quotient) -> Matrix:
    """G: the entries of g divided by the one that stayed free."""
    zero = one - one

    def entry(i: int, j: int) -> Quotient:
        row = result.entry((min(i, j), max(i, j)), one)
        return next(iter(row.values()), zero)

    return tuple(tuple(entry(i, j) for j in range(n)) for i in range(n))


def contradiction(
    analysis: Analysis, exact: MotionInRing, direction: Matrix, with_time: bool, seed: int
) -> Contradiction:
    """The first integrability condition of u that fails; TooLarge where none is found."""
    slopes = _slopes(exact, direction)
    point = draw_point(analysis.tower, seed)
    names = analysis.system.coordinates
    for formula, note, difference, held in _conditions(exact, slopes, with_time, names):
        if not difference.is_zero and _is_nonzero(exact.ring, difference, point):
            return Contradiction(_lines(slopes, with_time, held, names), formula, note, difference)
    raise TooLarge("no integrability condition of the factor fails")


@dataclass(frozen=True, slots=True)
class _Slopes:
    """mu, Gamma(u) = a, nu and tau, as in the module's formulas."""

    by_velocity: tuple[Quotient, ...]
    along: Quotient
    by_coordinate: tuple[Quotient, ...]
    by_time: Quotient


def _slopes(exact: MotionInRing, direction: Matrix) -> _Slopes:
    motion, span = exact.motion, range(exact.motion.size)
    mu = tuple(_velocity_slope(exact, direction, k) for k in span)
    a = _slope_along(exact, direction)
    nu = []
    for k in span:
        rest = [motion.by_velocity[k](f) * mu[m] for m, f in enumerate(motion.accelerations)]
        nu.append(motion.by_velocity[k](a) - motion.along(mu[k]) - sum_of(motion.zero, rest))
    speeds = [exact.ring.atoms[v] for v in exact.ring.variables[1 + motion.size :]]
    products = [speeds[k] * nu[k] for k in span] + [motion.accelerations[k] * mu[k] for k in span]
    return _Slopes(mu, a, tuple(nu), a - sum_of(motion.zero, products))


def _velocity_slope(exact: MotionInRing, direction: Matrix, k: int) -> Quotient:
    motion, span = exact.motion, range(exact.motion.size)
    j = 0 if k else 1
    inverse = solve_square(direction, [exact.ring.constant(int(i == j)) for i in span])
    if inverse is None:
        raise ZeroDivisionError("the matrix is singular")
    by = motion.by_velocity
    terms = [inverse[i] * (by[k](direction[i][j]) - by[j](direction[i][k])) for i in span]
    return -sum_of(motion.zero, terms)


def _slope_along(exact: MotionInRing, direction: Matrix) -> Quotient:
    motion, span = exact.motion, range(exact.motion.size)
    n: Tensor11[Quotient] = connection(motion)
    i, j = next((i, j) for i in span for j in span if not direction[i][j].is_zero)
    terms = [direction[i][m] * n[m][j] + direction[j][m] * n[m][i] for m in span]
    return (sum_of(motion.zero, terms) - motion.along(direction[i][j])) / direction[i][j]


def _conditions(
    exact: MotionInRing, slopes: _Slopes, with_time: bool, names: tuple[str, ...]
) -> Iterator[tuple[Formula, str, Quotient, frozenset[Symbol | Velocity]]]:
    """Everything that vanishes if u exists, the reason and the variables of the slopes in it, the simplest first."""
    motion = exact.motion
    if not with_time:
        yield _slope(TIME), ", as L is not to contain t,", slopes.by_time, frozenset({TIME})
    first: list[tuple[Symbol | Velocity, Any, Quotient]] = [
        (Velocity(x), motion.by_velocity[k], slopes.by_velocity[k]) for k, x in enumerate(names)
    ]
    first += [(Symbol(x), motion.by_coordinate[k], slopes.by_coordinate[k]) for k, x in enumerate(names)]
    if with_time:
        first.append((TIME, exact.ring.partial(0), slopes.by_time))
    for left in range(len(first)):
        for right in range(left):
            x, by_x, u_x = first[left]
            y, by_y, u_y = first[right]
            yield row(_mixed(y, x), " - ", _mixed(x, y)), "", by_x(u_y) - by_y(u_x), frozenset({x, y})


def _slope(variable: Symbol | Velocity) -> Formula:
    return partial_derivative(theory("u"), variable)


def _mixed(inner: Symbol | Velocity, outer: Symbol | Velocity) -> Formula:
    return partial_derivative(row("(", _slope(inner), ")"), outer)


def _lines(
    slopes: _Slopes, with_time: bool, held: frozenset[Symbol | Velocity], names: tuple[str, ...]
) -> tuple[Line, ...]:
    """The derivatives of u that are held, in the order in which they are found, and those that these are made of."""
    of_velocities = all(isinstance(variable, Velocity) for variable in held)
    lines = [
        Line("As `dg_ij/dv^k` is symmetric in `j` and `k`", _slope(Velocity(x)), slopes.by_velocity[k])
        for k, x in enumerate(names)
        if Velocity(x) in held or not of_velocities
    ]
    if of_velocities:
        return tuple(lines)
    lines.append(Line("By `Gamma(g) = g N + (g N)^T`", theory("Gamma(u)"), slopes.along))
    lines += [
        Line(f"`Gamma(u)` differentiated by `{x}'`", _slope(Symbol(x)), slopes.by_coordinate[k])
        for k, x in enumerate(names)
        if Symbol(x) in held or TIME in held
    ]
    if with_time and TIME in held:
        lines.append(Line("The rest of `Gamma(u)`", _slope(TIME), slopes.by_time))
    return tuple(lines)


def _is_nonzero(ring: ExactRing, element: Quotient, point: Point) -> bool:
    """Whether the value at the random point is not zero; TooLarge where it cannot be formed."""
    try:
        values = {index: evaluate(to_kernels(tree), point) for index, tree in ring.trees.items()}
    except (KeyError, TypeError, ValueError, SingularPoint) as error:
        raise TooLarge("an expression could not be evaluated modulo a prime") from error
    total = 0
    for exponents, coefficient in element.numerator.terms():
        term = int(coefficient.p) * pow(int(coefficient.q), -1, point.prime)
        for index, exponent in enumerate(exponents):
            if exponent:
                term = term * pow(values[index], int(exponent), point.prime) % point.prime
        total += term
    return total % point.prime != 0
