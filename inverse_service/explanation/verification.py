"""How to verify by hand that a given matrix is a multiplier, with every product worked out.

The proof that needs no theory: L put into the Euler-Lagrange equations gives the equations of motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from inverse_service import bounds
from inverse_service.deadline import now
from inverse_service.decision.solutions import Step
from inverse_service.explanation.wording import Explanation, Piece, said, separated
from inverse_service.expressions.collecting import collect
from inverse_service.expressions.derivative import differentiate, differentiate_in_time
from inverse_service.expressions.notation import Formula, matrix, partial_derivative, row, theory
from inverse_service.expressions.tree import ONE, Acceleration, Expression, Symbol, Velocity, node_count
from inverse_service.field.exact_ring import quotient_tree, sum_of
from inverse_service.field.rational_functions import Budget, Quotient, TooLarge
from inverse_service.mechanics.conditions import MotionInRing, connection, jacobi_endomorphism, motion_in_ring
from inverse_service.mechanics.quotient_matrices import determinant
from inverse_service.mechanics.second_order_system import SecondOrderSystem

TIME_LIMIT = 1.0
LARGEST_N = 8
# More terms than this fill pages, and to print them takes seconds.
MOST_TERMS_SHOWN = 600
Matrix = Sequence[Sequence[Quotient]]


def explain_positive(system: SecondOrderSystem, multiplier: Sequence[Sequence[Expression]]) -> Explanation:
    """The Helmholtz conditions for the multiplier g, shape (n, n), each worked out and seen to hold.

    `complete` is False where an identity was not recognized (too large, or atoms whose relations are
    not known here): then the steps say what is to be computed only.
    """
    budget = Budget(bounds.TERMS, now() + TIME_LIMIT)
    try:
        if len(system.coordinates) > LARGEST_N:
            raise TooLarge("too many coordinates to write everything out")
        exact = motion_in_ring(system, 2, budget, trees=[entry for row in multiplier for entry in row])
        g = tuple(tuple(exact.ring.value(entry) for entry in row) for row in multiplier)
        return _worked_out(exact, g)
    except (TooLarge, ZeroDivisionError):
        return Explanation(_plan(), complete=False)


def _plan() -> tuple[Step, ...]:
    """What has to be computed."""
    return (
        said(
            "The matrix `g` is the Hessian of `L` in the velocities; `dg_ij/dv^k` is symmetric in `j` and `k`.",
            about=("multiplier",),
        ),
        said("With `N = -1/2 df/dv`, compare `Gamma(g)` with `g N + (g N)^T`."),
        said("With `Phi` as given, see that `g Phi` is symmetric; `det g` is not zero."),
    )


def _worked_out(exact: MotionInRing, g: Matrix) -> Explanation:
    motion, span = exact.motion, range(exact.motion.size)
    n = connection(motion)
    product = _product(exact, g, n)
    forced = [[product[i][j] + product[j][i] for j in span] for i in span]
    moved = [[motion.along(entry) for entry in row] for row in g]
    lowered = _product(exact, g, jacobi_endomorphism(motion))
    one = exact.ring.constant(1)
    size = determinant(g, one)
    _require_zero([*_asymmetry(g), *_curl(exact, g), *_asymmetry(lowered)])
    _require_zero([moved[i][j] - forced[i][j] for i in span for j in span])
    if size.is_zero:
        raise TooLarge("the determinant was seen to vanish")
    shown = [entry for matrix in (g, moved, n, lowered) for row in matrix for entry in row]
    if sum(len(entry.numerator) for entry in [*shown, size]) > MOST_TERMS_SHOWN:
        raise TooLarge("the products fill pages")
    steps = (
        said("The Hessian of `L` in the velocities is ", row("g = ", _matrix(exact, g)), ".", about=("multiplier",)),
        said("Its derivatives `dg_ij/dv^k` are symmetric in `j` and `k`."),
        said(
            row("Gamma(g) = ", _matrix(exact, moved)),
            ", and `g N + (g N)^T` with ",
            row("N = ", _matrix(exact, n)),
            " is the same.",
        ),
        said(row("g Phi = ", _matrix(exact, lowered)), " is symmetric."),
        said(row("det g = ", quotient_tree(exact.ring, size)), " is not zero identically: `g` is a multiplier."),
    )
    return Explanation(steps)


def _product(exact: MotionInRing, left: Matrix, right: Matrix) -> list[list[Quotient]]:
    span = range(exact.motion.size)
    return [[sum_of(exact.motion.zero, [left[i][m] * right[m][j] for m in span]) for j in span] for i in span]


def _asymmetry(matrix: Matrix) -> list[Quotient]:
    return [matrix[i][j] - matrix[j][i] for i, j in itertools.combinations(range(len(matrix)), 2)]


def _curl(exact: MotionInRing, g: Matrix) -> list[Quotient]:
    """dg_ij/dv^k - dg_ik/dv^j."""
    by, span = exact.motion.by_velocity, range(exact.motion.size)
    return [by[k](g[i][j]) - by[j](g[i][k]) for i in span for j, k in itertools.combinations(span, 2)]


def _require_zero(differences: Sequence[Quotient]) -> None:
    if not all(difference.is_zero for difference in differences):
        raise TooLarge("an identity was not recognized")


def _matrix(exact: MotionInRing, entries: Matrix) -> Formula:
    if len(entries) > 1 and all(entry.is_zero for line in entries for entry in line):
        return theory("0")
    return matrix([[quotient_tree(exact.ring, entry) for entry in line] for line in entries])


# Coordinates whose equations are written out one by one.
_MOST_LINES = 8


def euler_lagrange_steps(system: SecondOrderSystem, lagrangian: Expression) -> tuple[Step, ...]:
    """One step for each coordinate: dL/dv, its derivative along the motion, dL/dq, and the equation that they make.

    A single sentence where these formulas are long.
    """
    short = len(system.coordinates) <= _MOST_LINES
    lines = [_line(lagrangian, name, system.coordinates) for name in system.coordinates if short]
    if not short or any(sum(map(node_count, line)) > bounds.SHOWN for line in lines):
        those = (
            "the equations as they are written" if system.is_unsolved else "equations that `f` satisfies identically"
        )
        return (said(f"Put into `d/dt(dL/dq') - dL/dq = 0`, `L` gives {those}."),)
    sentences = [_sentence(name, *line) for name, line in zip(system.coordinates, lines, strict=True)]
    concluded = [*sentences[-1], " ", *_conclusion(system, [line[3] for line in lines])]
    return tuple(said(*pieces) for pieces in (*sentences[:-1], concluded))


def _line(lagrangian: Expression, name: str, names: Sequence[str]) -> tuple[Expression, ...]:
    """(dL/dv, its derivative along the motion, dL/dq, the difference of these)."""
    momentum = collect(differentiate(lagrangian, Velocity(name)))
    rate = collect(differentiate_in_time(momentum, names))
    force = collect(differentiate(lagrangian, Symbol(name)))
    return momentum, rate, force, collect(rate - force)


def _sentence(
    name: str, momentum: Expression, rate: Expression, force: Expression, equation: Expression
) -> list[Piece]:
    lagrangian = theory("L")
    slope, pull = (partial_derivative(lagrangian, by) for by in (Velocity(name), Symbol(name)))
    rated = row("d/dt ", slope)
    return [
        row(slope, " = ", momentum), ", ", row(rated, " = ", rate), " and ", row(pull, " = ", force),
        ", so the Euler-Lagrange equation ", row(rated, " - ", pull, " = 0"), " reads ", row(equation, " = 0"), ".",
    ]  # fmt: skip


def _conclusion(system: SecondOrderSystem, equations: Sequence[Expression]) -> list[Piece]:
    if system.is_unsolved:
        return ["These are the equations as they are written."]
    pairs = list(zip(system.coordinates, system.accelerations, strict=True))
    motion: list[Formula] = [row(Acceleration(name), " = ", f) for name, f in pairs]
    if len(pairs) > 1:
        return ["Solved for the accelerations, these equations are ", *separated(motion), "."]
    factor = differentiate(equations[0], Acceleration(system.coordinates[0]))
    what: list[Piece] = ["That is "] if factor == ONE else ["Divided by ", factor, ", that is "]
    return [*what, motion[0], "."]
