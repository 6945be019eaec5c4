"""A positive answer put into words: how the Lagrangian was found, what proves it, its Hamiltonian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from inverse_service import bounds
from inverse_service.decision import certify
from inverse_service.decision.solutions import Answer, Hamiltonian, Lagrangian, SolutionSpace, Step
from inverse_service.errors import InputError
from inverse_service.explanation.verification import euler_lagrange_steps, explain_positive
from inverse_service.explanation.wording import Piece, said, separated
from inverse_service.expressions.inequalities import inequality
from inverse_service.expressions.notation import Formula, listed, row
from inverse_service.expressions.tree import TIME, Expression, Symbol
from inverse_service.mechanics.legendre.transform import legendre
from inverse_service.search.protocol import SearchOutcome, describe

if TYPE_CHECKING:
    from inverse_service.decision.analysis import Analysis
    from inverse_service.decision.deciding import Decision
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

# The order of the series that is written out, and how many coefficients it may have.
_SERIES_ORDER = 2
_MOST_COEFFICIENTS = 60


def existence_steps(decision: Decision) -> tuple[Step, ...]:
    """The involution data as sentences."""
    assert decision.space is not None
    assert decision.symbol is not None
    order, degree = decision.order, decision.degree
    dimensions = ", ".join(map(str, decision.history[order][: degree + 1]))
    return (
        said(
            f"The Helmholtz conditions, prolonged to order {order}, leave a space of Taylor polynomials of the "
            f"multiplier of dimensions {dimensions} in degrees 0 to {degree}; it no longer shrinks.",
            about=("multiplier", "Helmholtz", "prolonged"),
        ),
        said(
            f"Its symbol in degree {degree} has dimension {decision.symbol.dimension} and passes Cartan's test "
            f"(characters {', '.join(map(str, decision.symbol.characters))}): the system is involutive.",
            about=("involutive",),
        ),
        said(
            f"A regular `g` is left at a generic point, so a regular Lagrangian exists; {decision.space.statement}.",
            about=("regular",),
        ),
    )


def not_found(space: SolutionSpace | None) -> Step:
    """What is known without a closed form, and what to try."""
    known = "" if space is None else f": {space.statement}"
    return said(
        f"There is a Lagrangian, and no closed form of one was found{known}. Give the search more time, or terms that "
        "you expect in it, as `ansatz`."
    )


def _written(formula: Formula, given: str) -> Piece:
    """The formula, or where it stands if it would fill the page."""
    return formula if len(formula.text) <= bounds.SHOWN else given


def series_steps(analysis: Analysis, decision: Decision, order: int | None) -> tuple[Step, ...]:
    """The beginning of the power series of one regular Lagrangian, where f is rational and it is short."""
    from inverse_service.decision.power_series import as_tree, count, rational_series

    n = len(analysis.system.coordinates)
    wanted = range(1, (order or _SERIES_ORDER) + 1)
    fitting = [k for k in wanted if count(n, decision.with_time, k) <= _MOST_COEFFICIENTS]
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
    """The answer that this Lagrangian proves, not yet checked: the plain proof, how L was found, what else there is."""
    others = existence_steps(decision) if decision is not None and decision.symbol is not None else ()
    return Answer(
        "variational",
        lagrangian=describe(analysis, tree, family),
        space=None if decision is None else decision.space,
        certificate=certify.of_lagrangian(analysis, tree, with_time),
        explanation=euler_lagrange_steps(analysis.system, tree),
        details=(*how, *others),
    )


def branch_steps(
    system: SecondOrderSystem, positive: Sequence[Expression], nonzero: Sequence[Expression] = ()
) -> tuple[Step, ...]:
    """What first-order equations leave out, on which set the answer holds, and what the rewritten roots are there."""
    if system.others:
        known = listed([row(Symbol(name), " = ", tree) for name, tree in system.others])
        first = said("The equations of first order give ", known, "; put in, these are equations of second order.")
        return (first, *branch_steps(replace(system, others=()), positive, nonzero))
    if not positive and not nonzero:
        return ()
    where = listed([*(row(tree, " != 0") for tree in nonzero), *map(inequality, positive)])
    roots = () if system.branch is None else system.branch.roots
    if not roots:
        return (said("All this holds where ", where, "."),)
    values = listed([row(root, " = ", value) for root, value in roots])
    return (said("Where ", where, ": ", _written(values, "the roots are those given here"), "."),)


def as_given_steps(tree: Expression) -> tuple[Step, ...]:
    """How L follows from equations that are Euler-Lagrange equations as written."""
    step = said(
        "The equations, each times a factor that is read off from the quotients of their coefficients, are "
        "self-adjoint: then the matrix of the accelerations is the Hessian of a Lagrangian, which follows by "
        "integration: ",
        _written(row("L = ", tree), "the `L` given above"), ".", about=("Helmholtz",),
    )  # fmt: skip
    return (step,)


def search_steps(outcome: SearchOutcome, tree: Expression) -> tuple[Step, ...]:
    """The family or the method that found L, and the constants it may have."""
    from inverse_service.search.rungs import REASONS

    assert outcome.found is not None
    name, _ = outcome.tried[-1]
    reason = (
        f"{REASONS[name]} This gives "
        if name in REASONS
        else (
            f"In the family '{name}' the Euler-Lagrange equations along the motion are linear in the coefficients; "
            "solved, they leave "
        )
    )
    first = said(reason, _written(row("L = ", tree), "the `L` given above"), ".")
    if len(outcome.found.parts) < 2:
        return (first,)
    parts = [row(f"C_{k}*(", part, ")") for k, part in enumerate(outcome.found.parts, start=1)]
    general = row("L = ", *separated(parts, " + "))
    short = len(general.text) <= bounds.SHOWN
    sentence: list[Piece] = [general, " is a Lagrangian"] if short else ["so is every sum of its parts `C_k L_k`"]
    return (
        first,
        said("More generally, ", *sentence, " for constants `C_k` that keep the Hessian regular.", about=("regular",)),
    )


def verification_steps(analysis: Analysis, lagrangian: Lagrangian) -> tuple[Step, ...]:
    """The Helmholtz conditions for its multiplier, worked out where they are short."""
    return () if analysis.system.is_unsolved else explain_positive(analysis.system, lagrangian.multiplier).steps


def hamiltonian_of(
    lagrangian: Expression, names: Sequence[str], positive: Sequence[Expression] = ()
) -> Hamiltonian | None:
    """The Legendre transform where all of `positive` are > 0; None where the Hessian is singular after all."""
    try:
        transform = legendre(lagrangian, names, positive=positive)
    except InputError:
        return None
    return Hamiltonian.of(transform)


def legendre_steps(hamiltonian: Hamiltonian | None) -> tuple[Step, ...]:
    """How H follows from the momenta."""
    if hamiltonian is None:
        return ()
    pairs = list(zip(hamiltonian.symbols, hamiltonian.momenta, strict=True))
    momenta = listed([row(symbol, " = ", p) for symbol, p in pairs])
    branch = hamiltonian.note.rstrip(".").replace("`", "")
    note = f" ({branch})" if branch else ""
    solved = f"{branch}: " if hamiltonian.implicit else f"They are solved for the velocities{note}; with them "
    result = row("H = p v - L = ", hamiltonian.expression)
    return (
        said("The momenta `p = dL/dv` are ", _written(momenta, "those given with `H`"), "."),
        said(solved, _written(result, "`H = p v - L` is the one given above"), "."),
    )
