"""A positive answer in words: how the Lagrangian was found, what proves it, and its Hamiltonian.

`explain_positive` works out every Helmholtz condition of a given multiplier; `euler_lagrange_steps` is the proof that
needs no theory: L put into the Euler-Lagrange equations gives the equations of motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from inverse_service import bounds, deadline
from inverse_service.certificate import checker
from inverse_service.decision import certify
from inverse_service.decision.solutions import Answer, Hamiltonian, Lagrangian, SolutionSpace, Step
from inverse_service.errors import InputError
from inverse_service.explanation.wording import Piece, said, separated
from inverse_service.expressions import collecting, derivative, inequalities
from inverse_service.expressions.notation import Formula, listed, matrix, partial_derivative, row, theory
from inverse_service.expressions.tree import ONE, TIME, ZERO, Acceleration, Expression, Symbol, Velocity, node_count
from inverse_service.field.exact_field import Budget, Quotient, TooLarge, quotient_tree
from inverse_service.field.matrices import determinant
from inverse_service.mechanics import conditions
from inverse_service.mechanics.legendre import legendre
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search.tidy import SearchOutcome, describe

if TYPE_CHECKING:
    from inverse_service.decision.deciding import Analysis, Decision


TIME_LIMIT = 1.0
LARGEST_N = 8
# More terms than this fill pages, and to print them takes seconds.
MOST_TERMS_SHOWN = 600
Matrix = Sequence[Sequence[Quotient]]
# Coordinates whose equations are written out one by one.
_MOST_LINES = 8

# The order of the series that is written out, and how many coefficients it may have.
_SERIES_ORDER = 2
_MOST_COEFFICIENTS = 60


def explain_positive(system: SecondOrderSystem, multiplier: Sequence[Sequence[Expression]]) -> tuple[Step, ...]:
    """The Helmholtz conditions for the multiplier g, shape (n, n), each worked out and seen to hold.

    Where an identity was not recognized (too large, or atoms whose relations are not known here), the steps only say
    what must be computed.
    """
    budget = Budget(bounds.TERMS, deadline.now() + TIME_LIMIT)
    try:
        if len(system.coordinates) > LARGEST_N:
            raise TooLarge("too many coordinates to write everything out")
        exact = conditions.motion_in_ring(system, 2, budget, trees=[entry for row in multiplier for entry in row])
        g = tuple(tuple(exact.ring.value(entry) for entry in row) for row in multiplier)
        return _worked_out(exact, g)
    except (TooLarge, ZeroDivisionError):
        return (
            said("The matrix `g` is the velocity Hessian of `L`; `dg_ij/dv^k` is symmetric in `j` and `k`."),
            said("With `N = -1/2 df/dv`, compare `Gamma(g)` with `g N + (g N)^T`."),
            said("Check that `g Phi` is symmetric for the given `Phi` and that `det g` is not zero."),
        )


def _worked_out(exact: conditions.MotionInRing, g: conditions.Tensor11[Quotient]) -> tuple[Step, ...]:
    motion, span = exact.motion, range(exact.motion.size)
    n = conditions.connection(motion)
    product = conditions.product(motion, g, n)
    forced = [[product[i][j] + product[j][i] for j in span] for i in span]
    moved = [[motion.along(entry) for entry in row] for row in g]
    lowered = conditions.product(motion, g, conditions.jacobi_endomorphism(motion))
    one = exact.ring.constant(1)
    size = determinant(g, one)
    slopes = [entry for matrix in conditions.curvature(motion, g) for row in matrix for entry in row]
    _require_zero([*_asymmetry(g), *slopes, *_asymmetry(lowered)])
    _require_zero([moved[i][j] - forced[i][j] for i in span for j in span])
    if size.is_zero:
        raise TooLarge("the determinant was seen to vanish")
    shown = [entry for matrix in (g, moved, n, lowered) for row in matrix for entry in row]
    if sum(len(entry.numerator) for entry in [*shown, size]) > MOST_TERMS_SHOWN:
        raise TooLarge("the products fill pages")
    if len(g) == 1:  # what concerns symmetry says nothing
        step = said(
            "The velocity Hessian ", row("g = ", quotient_tree(exact.ring, size)),
            " is not identically zero, and ", row("Gamma(g) = ", quotient_tree(exact.ring, moved[0][0])),
            " equals `-g df/dv`, so it is a multiplier.",
        )  # fmt: skip
        return (step,)
    along = row("Gamma(g) = ", _matrix(exact, moved))
    return (
        said("The velocity Hessian of `L` is the multiplier `g`; `dg_ij/dv^k` is symmetric in `j` and `k`."),
        said(along, ", and `g N + (g N)^T` with ", row("N = ", _matrix(exact, n)), " is the same."),
        said(row("g Phi = ", _matrix(exact, lowered)), " is symmetric."),
        said(row("det g = ", quotient_tree(exact.ring, size)), " is not identically zero, so `g` is a multiplier."),
    )


def _asymmetry(matrix: Matrix) -> list[Quotient]:
    return [matrix[i][j] - matrix[j][i] for i, j in itertools.combinations(range(len(matrix)), 2)]


def _require_zero(differences: Sequence[Quotient]) -> None:
    if not all(difference.is_zero for difference in differences):
        raise TooLarge("an identity was not recognized")


def _matrix(exact: conditions.MotionInRing, entries: Matrix) -> Formula:
    if len(entries) > 1 and all(entry.is_zero for line in entries for entry in line):
        return theory("0")
    return matrix([[quotient_tree(exact.ring, entry) for entry in line] for line in entries])


def euler_lagrange_steps(system: SecondOrderSystem, lagrangian: Expression) -> tuple[Step, ...]:
    """One step for each coordinate: dL/dv, dL/dq, and the equation that they make.

    A single sentence where these formulas are long.
    """
    short = len(system.coordinates) <= _MOST_LINES
    lines = [_line(lagrangian, name, system.coordinates) for name in system.coordinates if short]
    if not short or any(sum(map(node_count, line)) > bounds.SHOWN for line in lines):
        if system.is_unsolved:
            return (said("The Euler-Lagrange equations of the Lagrangian are the equations as given."),)
        return (said("The motion satisfies the Euler-Lagrange equations of the Lagrangian."),)
    sentences = [_sentence(name, *line) for name, line in zip(system.coordinates, lines, strict=True)]
    concluded = [*sentences[-1], " ", *_conclusion(system, [line[2] for line in lines])]
    return tuple(said(*pieces) for pieces in (*sentences[:-1], concluded))


def _line(lagrangian: Expression, name: str, names: Sequence[str]) -> tuple[Expression, ...]:
    """(dL/dv, dL/dq, d/dt dL/dv - dL/dq)."""
    momentum = collecting.collect(derivative.differentiate(lagrangian, Velocity(name)))
    force = collecting.collect(derivative.differentiate(lagrangian, Symbol(name)))
    return momentum, force, collecting.collect(derivative.differentiate_in_time(momentum, names) - force)


def _sentence(name: str, momentum: Expression, force: Expression, equation: Expression) -> list[Piece]:
    lagrangian = theory("L")
    slope, pull = (partial_derivative(lagrangian, by) for by in (Velocity(name), Symbol(name)))
    return [
        row(slope, " = ", momentum), " and ", row(pull, " = ", force), ", so ",
        row("d/dt ", slope, " - ", pull, " = 0"), " reads ", row(equation, " = 0"), ".",
    ]  # fmt: skip


def _conclusion(system: SecondOrderSystem, equations: Sequence[Expression]) -> list[Piece]:
    if system.is_unsolved:
        return ["These are the given equations."]
    pairs = list(zip(system.coordinates, system.accelerations, strict=True))
    motion: list[Formula] = [row(Acceleration(name), " = ", f) for name, f in pairs]
    if len(pairs) > 1:
        return ["Solving for the accelerations gives ", *separated(motion), "."]
    factor = derivative.differentiate(equations[0], Acceleration(system.coordinates[0]))
    what: list[Piece] = ["That is "] if factor == ONE else ["Dividing by ", factor, " gives "]
    return [*what, motion[0], "."]


def existence_steps(decision: Decision) -> tuple[Step, ...]:
    """The involution data as sentences."""
    assert decision.space is not None
    assert decision.symbol is not None
    order, degree = decision.order, decision.degree
    dimensions = ", ".join(map(str, decision.history[order][: degree + 1]))
    return (
        said(
            f"The Taylor polynomials of `g` that satisfy the Helmholtz conditions, prolonged to order {order}, form "
            f"spaces of dimensions {dimensions} in degrees 0 to {degree}; higher orders do not reduce them."
        ),
        said(
            f"Its symbol in degree {degree} has dimension {decision.symbol.dimension} and passes Cartan's test "
            f"(characters {', '.join(map(str, decision.symbol.characters))}): the system is involutive."
        ),
        said(f"A regular `g` remains at a generic point, so a regular Lagrangian exists; {decision.space.statement}."),
    )


def of_one_coordinate(name: str, with_time: bool, is_found: bool) -> Step:
    """The theorem of N. Sonin (1886) and G. Darboux (1894, Lecons III, art. 604)."""
    question = "L(t, q, q')" if with_time else "L(q, q')"
    form = "" if is_found else "; no closed form was found"
    return said(
        f"Every equation of one coordinate has a regular Lagrangian {question} {checker.near_points(name, with_time)} "
        f"(Sonin 1886, Darboux 1894){form}."
    )


def not_found(system: SecondOrderSystem, space: SolutionSpace | None) -> Step:
    """What is known without a closed form, and what to try; the factor as an integral if one matrix remains."""
    known = "" if space is None else f": {space.statement}"
    found = conditions.one_matrix(system) if len(system.coordinates) > 1 else None
    factor: list[Piece] = []
    if found is not None:
        places = itertools.combinations_with_replacement(range(len(system.coordinates)), 2)
        entries = [row(f"G_{i + 1}{j + 1} = ", found[0][i][j]) for i, j in places if found[0][i][j] != ZERO]
        integrand = separated([row("(", slope, ") d", variable) for variable, slope in found[1]], " + ")
        factor = [" The conditions leave `g = e^u G` with ", *separated(entries), ", where `u` is the integral of ",
                  *integrand, "; no elementary antiderivative was found."]  # fmt: skip
    return said(
        f"A Lagrangian exists, but no closed form was found{known}.", *factor, " Give the search more time, "
        "or list the terms that you expect in `L` as `ansatz`."
    )  # fmt: skip


def _written(formula: Formula, given: str) -> Piece:
    """The formula, or a reference to it if it is too long for the sentence."""
    return formula if len(formula.text) <= bounds.SHOWN else given


def series_steps(analysis: Analysis, decision: Decision, order: int | None) -> tuple[Step, ...]:
    """The beginning of the power series of one regular Lagrangian, where f is rational and it is short."""
    from inverse_service.decision.deciding import as_tree, count_coefficients, rational_series

    n = len(analysis.system.coordinates)
    wanted = range(1, (order or _SERIES_ORDER) + 1)
    fitting = [k for k in wanted if count_coefficients(n, decision.with_time, k) <= _MOST_COEFFICIENTS]
    spare = decision.order - 1 - decision.degree
    found = rational_series(analysis, decision.with_time, fitting[-1], spare) if fitting else None
    if found is None:
        return ()
    named = [symbol for symbol in found.point if symbol != TIME or TIME in found.variables]
    place = separated([row(symbol, f" = {found.point[symbol]}") for symbol in named])
    series = row("L = ", as_tree(found), " + …")
    step = said(
        "Near ", *place, f" one regular Lagrangian begins, to total degree {found.order + 2} and up to terms of at "
        "most first degree in the velocities (which the equations of motion then fix), as ",
        _written(series, "the formula below"), ".", shown=[] if len(series.text) <= bounds.SHOWN else [series],
    )  # fmt: skip
    return (step,)


def of_lagrangian(
    analysis: Analysis, with_time: bool, tree: Expression, family: str, how: Sequence[Step], decision: Decision | None
) -> Answer:
    """The answer that this Lagrangian proves, not yet checked: the plain proof, and how L was found."""
    return Answer(
        "variational",
        lagrangian=describe(analysis, tree, family),
        space=None if decision is None else decision.space,
        certificate=certify.of_lagrangian(analysis, tree, with_time),
        explanation=euler_lagrange_steps(analysis.system, tree),
        details=tuple(how),
    )


def branch_steps(
    system: SecondOrderSystem, positive: Sequence[Expression], nonzero: Sequence[Expression] = ()
) -> tuple[Step, ...]:
    """The variables that first-order equations eliminate, the set where the answer holds, and the roots there."""
    if system.others:
        known = listed([row(Symbol(name), " = ", tree) for name, tree in system.others])
        first = said("The first-order equations give ", known, "; substituting these leaves second-order equations.")
        return (first, *branch_steps(replace(system, others=()), positive, nonzero))
    if not positive and not nonzero:
        return ()
    where = listed([*(row(tree, " != 0") for tree in nonzero), *map(inequalities.inequality, positive)])
    roots = () if system.branch is None else system.branch.roots
    if not roots:
        return (said("These statements hold where ", where, "."),)
    values = listed([row(root, " = ", value) for root, value in roots])
    return (said("Where ", where, ": ", _written(values, "the roots are those given here"), "."),)


def as_given_steps() -> tuple[Step, ...]:
    """How L follows from equations that are Euler-Lagrange equations as written."""
    step = said(
        "Factors found from quotients of coefficients make the equations self-adjoint; the matrix of the "
        "accelerations is then the Hessian of a Lagrangian.",
    )  # fmt: skip
    return (step,)


def search_steps(outcome: SearchOutcome) -> tuple[Step, ...]:
    """The family or the method that found L, and the constants it may have."""
    from inverse_service.search.ladder import REASONS

    assert outcome.found is not None
    name, _ = outcome.tried[-1]
    of_family = (
        f"In the family '{name}' the Euler-Lagrange equations along the motion are linear in the coefficients; "
        "solving them gives `L`."
    )
    first = said(REASONS.get(name, of_family))
    if len(outcome.found.parts) < 2:
        return (first,)
    parts = [row(f"C_{k}*(", part, ")") for k, part in enumerate(outcome.found.parts, start=1)]
    general = row("L = ", *separated(parts, " + "))
    short = len(general.text) <= bounds.SHOWN
    sentence: list[Piece] = [general, " is a Lagrangian"] if short else ["so is every sum of its parts `C_k L_k`"]
    return (first, said("More generally, ", *sentence, " for constants `C_k` that keep the Hessian regular."))


def verification_steps(analysis: Analysis, lagrangian: Lagrangian) -> tuple[Step, ...]:
    """The Helmholtz conditions for its multiplier, worked out where they are short."""
    return () if analysis.system.is_unsolved else explain_positive(analysis.system, lagrangian.multiplier)


def hamiltonian_of(
    lagrangian: Expression, names: Sequence[str], positive: Sequence[Expression] = ()
) -> Hamiltonian | None:
    """The Legendre transform where all of `positive` are > 0; None where the Hessian is singular after all."""
    try:
        transform = legendre(lagrangian, names, positive=positive)
    except InputError:
        return None
    return Hamiltonian(transform)


def legendre_steps(hamiltonian: Hamiltonian | None) -> tuple[Step, ...]:
    """How H follows from the momenta, where there is more to say than that they are solved for the velocities."""
    note = "" if hamiltonian is None else hamiltonian.transform.note.rstrip(".").replace("`", "")
    if hamiltonian is None or not note:
        return ()
    implicit = hamiltonian.transform.implicit
    solved = f"{note}:" if implicit else f"The momenta `p = dL/dv` are solved for the velocities ({note});"
    return (said(f"{solved} `H = p v - L`."),)
