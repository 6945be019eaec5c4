"""The steps of an explanation: how they are said, and those of a positive answer.

A positive answer says how the Lagrangian was found, what proves it, and what its Hamiltonian is.
`euler_lagrange_steps` is the proof that needs no theory: L put into the Euler-Lagrange equations
gives the equations of motion. `verification_steps` works out every Helmholtz condition of its
multiplier.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from inverse_service import bounds, deadline
from inverse_service.certificate import checker
from inverse_service.decision import certify
from inverse_service.decision.solutions import (
    Conditions,
    Hamiltonian,
    Part,
    Solution,
    SolutionSpace,
    Statement,
    Step,
)
from inverse_service.errors import InputError
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.expressions.notation import (
    Formula,
    formula_of,
    inequality,
    matrix,
    partial_derivative,
    row,
    theory,
    with_commas,
)
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import conditions, writing
from inverse_service.mechanics.legendre import legendre
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search.tidy import SearchOutcome, describe
from inverse_service.statements.questions import Question

if TYPE_CHECKING:
    from inverse_service.decision.deciding import Analysis, Decision

Piece = str | Formula | ex.Expression
Item = TypeVar("Item")
_MEANING = {
    "g": "the multiplier (the velocity Hessian of L)",
    "L": "the Lagrangian",
    "H": "the Hamiltonian",
    "N": "the matrix -1/2 df/dv",
    "Phi": "the matrix of the first conditions",
    "R": "the curvature in the conditions",
    "Gamma": "the derivative along the motion",
    "f": "the right-hand sides",
    "p": "the momenta",
    "v": "the velocities",
    "u": "the exponent in g = e^u G",
    "G": "the matrix in g = e^u G",
    "T": "any of the matrices of the conditions",
    "L_0": "the Lagrangian without damping",
}
TIME_LIMIT = 1.0
# The number of coordinates up to which conditions and equations are written out one by one.
MOST_COORDINATES = 8
# More terms than this fill pages, and to print them takes seconds.
MOST_TERMS_SHOWN = 600
Matrix = Sequence[Sequence[exact_field.Quotient]]

# The order of the series that is written out, and how many coefficients it may have.
_SERIES_ORDER = 2
_MOST_COEFFICIENTS = 60


def said(*pieces: Piece, shown: Sequence[Piece] = ()) -> Step:
    """A sentence of words and formulas, and the formulas that are `shown`: below it, unless they
    are in the sentence.

    In a text, grave accents enclose a formula in the notation of the theory.
    """
    sentence = [part for piece in pieces for part in _parts(piece)]
    texts = {part.text for part in sentence}
    below = [
        part for part in (_formula(piece, "display") for piece in shown) if part.text not in texts
    ]
    return Step("".join(part.text for part in sentence), (*sentence, *below))


def _parts(piece: Piece) -> list[Part]:
    if not isinstance(piece, str):
        return [_formula(piece)]
    return [
        _formula(text) if k % 2 else Part("text", text)
        for k, text in enumerate(piece.split("`"))
        if text
    ]


def _formula(piece: Piece, kind: str = "formula") -> Part:
    if isinstance(piece, ex.Expression):
        return Part(kind, printing.to_text(piece))
    formula = formula_of(piece)
    return Part(kind, formula.text, formula.letters)


def separated(formulas: Sequence[Item], between: str = ", ") -> list[Item | str]:
    """The formulas with the same words between them."""
    found: list[Item | str] = []
    for formula in formulas:
        found += [between, formula]
    return found[1:]


def enumerated(formulas: Sequence[Item]) -> list[Item | str]:
    """a, b and c."""
    return [*separated(formulas[:-1]), *([" and "] if formulas[1:] else []), *formulas[-1:]]


def with_shared_letters(answer: Statement, system: SecondOrderSystem) -> Statement:
    """The answer with a first sentence that defines each symbol that the theory and the system both
    use.
    """
    names = system.names.declared()
    parts = [part for step in (*answer.explanation, *answer.details) for part in step.parts]
    words = {word for part in parts for word in part.letters}
    shared = [name for name in _MEANING if name in names and name in words]
    if not shared:
        return answer
    meanings = ", ".join(f"{name} is {_MEANING[name]}" for name in shared)
    also = (
        "these names may also be those"
        if len(shared) > 1
        else f"the name {shared[0]} may also be that"
    )
    step = said(f"In the sentences below, {meanings}; inside their formulas {also} of the system.")
    return replace(answer, explanation=(step, *answer.explanation))


class PrintedConditions(NamedTuple):
    """The tensors, None without them, and the reason."""

    conditions: Conditions | None
    reason: str


def printed_conditions(system: SecondOrderSystem) -> PrintedConditions:
    """The conditions, or None with the reason for omitting them."""
    tensors = conditions.conditions(system)
    if tensors.Phi is None or tensors.nabla_Phi is None or tensors.R is None:
        return PrintedConditions(None, tensors.reason)

    def short(tree: ex.Expression) -> ex.Expression:
        has_angles = any(
            isinstance(node, ex.Apply) and node.function in ("sin", "cos") for node in ex.walk(tree)
        )
        return (
            writing.with_shortest_sums(tree)
            if has_angles or ex.node_count(tree) <= bounds.LARGE
            else tree
        )

    Phi, nabla = (
        tuple(tuple(map(short, row)) for row in each) for each in (tensors.Phi, tensors.nabla_Phi)
    )
    R = tuple(tuple(tuple(map(short, row)) for row in rows) for rows in tensors.R)
    return PrintedConditions(Conditions(Phi, nabla, R), tensors.reason)


def with_conditions(solution: Solution) -> Solution:
    """The solution of `solve` without conditions, with them."""
    found, reason = printed_conditions(solution.system)
    return replace(
        solution,
        conditions=found,
        provenance={**solution.provenance, "conditions_left_out": reason},
    )


def verification_steps(
    system: SecondOrderSystem, multiplier: Sequence[Sequence[ex.Expression]]
) -> tuple[Step, ...]:
    """The Helmholtz conditions for the multiplier g, shape (n, n), each worked out and seen to
    hold.

    Where an identity was not recognized (too large, or atoms whose relations are not known here),
    the steps only say what must be computed. () where the equations are not solved for the
    accelerations.
    """
    if system.is_unsolved:
        return ()
    budget = exact_field.Budget(bounds.TERMS, deadline.now() + TIME_LIMIT)
    try:
        if len(system.coordinates) > MOST_COORDINATES:
            raise exact_field.TooLarge("too many coordinates to write everything out")
        exact = conditions.motion_in_ring(
            system, 2, budget, trees=[entry for row in multiplier for entry in row]
        )
        g = tuple(tuple(exact.ring.value(entry) for entry in row) for row in multiplier)
        return _worked_out(exact, g)
    except (exact_field.TooLarge, ZeroDivisionError):
        return (
            said(
                "The matrix `g` is the velocity Hessian of `L`; `dg_ij/dv^k` is symmetric in `j` and `k`."
            ),
            said("With `N = -1/2 df/dv`, compare `Gamma(g)` with `g N + (g N)^T`."),
            said(
                "Check that `g Phi` is symmetric for the given `Phi` and that `det g` is not zero."
            ),
        )


def _worked_out(
    exact: conditions.MotionInRing, g: conditions.Tensor11[exact_field.Quotient]
) -> tuple[Step, ...]:
    """One step for each condition on g; TooLarge if one is not recognized as an identity, or is too
    long to print.

    g = g^T and dg_ij/dv^k - dg_ik/dv^j = 0, which is the `curvature` of g;
    Gamma(g) = g N + (g N)^T;   g Phi = (g Phi)^T;   det g != 0
    """
    motion, span = exact.motion, range(exact.motion.size)
    n = conditions.connection(motion)
    product = conditions.product(motion, g, n)
    along = [[motion.along(entry) for entry in row] for row in g]
    lowered = conditions.product(motion, g, conditions.jacobi_endomorphism(motion))
    determinant = matrices.determinant(g, exact.ring.constant(1))
    slopes = [
        entry for matrix in conditions.curvature(motion, g) for row in matrix for entry in row
    ]
    rates = [along[i][j] - product[i][j] - product[j][i] for i in span for j in span]
    if not all(
        difference.is_zero for difference in [*_asymmetry(g), *slopes, *_asymmetry(lowered), *rates]
    ):
        raise exact_field.TooLarge("an identity was not recognized")
    if determinant.is_zero:
        raise exact_field.TooLarge("the determinant was seen to vanish")
    shown = [entry for matrix in (g, along, n, lowered) for row in matrix for entry in row]
    if sum(len(entry.numerator) for entry in [*shown, determinant]) > MOST_TERMS_SHOWN:
        raise exact_field.TooLarge("the products fill pages")
    regular = exact_field.quotient_tree(exact.ring, determinant)
    if len(g) == 1:  # a matrix of one entry is symmetric
        step = said(
            "The velocity Hessian ", row("g = ", regular), " is not identically zero, and ",
            row("Gamma(g) = ", exact_field.quotient_tree(exact.ring, along[0][0])),
            " equals `-g df/dv`, so it is a multiplier.",
        )  # fmt: skip
        return (step,)
    return (
        said("The velocity Hessian of `L` is the multiplier `g`; `dg_ij/dv^k` is symmetric in `j` and `k`."),
        said(
            row("Gamma(g) = ", _matrix(exact, along)), ", and `g N + (g N)^T` with ", row("N = ", _matrix(exact, n)),
            " is the same.",
        ),
        said(row("g Phi = ", _matrix(exact, lowered)), " is symmetric."),
        said(row("det g = ", regular), " is not identically zero, so `g` is a multiplier."),
    )  # fmt: skip


def _asymmetry(matrix: Matrix) -> list[exact_field.Quotient]:
    return [matrix[i][j] - matrix[j][i] for i, j in itertools.combinations(range(len(matrix)), 2)]


def _matrix(exact: conditions.MotionInRing, entries: Matrix) -> Formula:
    if len(entries) > 1 and all(entry.is_zero for line in entries for entry in line):
        return theory("0")
    return matrix(
        [[exact_field.quotient_tree(exact.ring, entry) for entry in line] for line in entries]
    )


def euler_lagrange_steps(system: SecondOrderSystem, lagrangian: ex.Expression) -> tuple[Step, ...]:
    """One step for each coordinate: dL/dv, dL/dq, and the equation that they make.

    A single sentence where these formulas are long.
    """
    lines = _lines(lagrangian, system.coordinates)
    if lines is None:
        if system.is_unsolved:
            return (
                said("The Euler-Lagrange equations of the Lagrangian are the equations as given."),
            )
        return (said("The motion satisfies the Euler-Lagrange equations of the Lagrangian."),)
    sentences = [
        _sentence(name, *line) for name, line in zip(system.coordinates, lines, strict=True)
    ]
    concluded = [*sentences[-1], " ", *_conclusion(system, [line[2] for line in lines])]
    return tuple(said(*pieces) for pieces in (*sentences[:-1], concluded))


def _lines(
    lagrangian: ex.Expression, names: Sequence[str]
) -> list[tuple[ex.Expression, ...]] | None:
    """(dL/dv, dL/dq, d/dt dL/dv - dL/dq) for each coordinate; None if these are long, which the
    first that is decides.
    """
    found = list[tuple[ex.Expression, ...]]()
    if len(names) > MOST_COORDINATES:
        return None
    for name in names:
        momentum = collecting.collect(calculus.differentiate(lagrangian, ex.Velocity(name)))
        if ex.node_count(momentum) > bounds.SHOWN:
            return None
        force = collecting.collect(calculus.differentiate(lagrangian, ex.Symbol(name)))
        if ex.node_count(momentum) + ex.node_count(force) > bounds.SHOWN:
            return None
        moved = calculus.differentiate_in_time(momentum, names)
        found.append((momentum, force, collecting.collect(moved - force)))
        if sum(map(ex.node_count, found[-1])) > bounds.SHOWN:
            return None
    return found


def _sentence(
    name: str, momentum: ex.Expression, force: ex.Expression, equation: ex.Expression
) -> list[Piece]:
    lagrangian = theory("L")
    slope, pull = (
        partial_derivative(lagrangian, by) for by in (ex.Velocity(name), ex.Symbol(name))
    )
    return [
        row(slope, " = ", momentum), " and ", row(pull, " = ", force), ", so ",
        row("d/dt ", slope, " - ", pull, " = 0"), " reads ", row(equation, " = 0"), ".",
    ]  # fmt: skip


def _conclusion(system: SecondOrderSystem, equations: Sequence[ex.Expression]) -> list[Piece]:
    if system.is_unsolved:
        return ["These are the given equations."]
    pairs = list(zip(system.coordinates, system.accelerations, strict=True))
    motion: list[Formula] = [row(ex.Acceleration(name), " = ", f) for name, f in pairs]
    if len(pairs) > 1:
        return ["Solving for the accelerations gives ", *separated(motion), "."]
    factor = calculus.differentiate(equations[0], ex.Acceleration(system.coordinates[0]))
    what: list[Piece] = ["That is "] if factor == ex.ONE else ["Dividing by ", factor, " gives "]
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
            f"The symbol of this system in degree {degree} has dimension {decision.symbol.dimension} and passes "
            f"Cartan's test (characters {', '.join(map(str, decision.symbol.characters))}): the system is involutive."
        ),
        said(
            f"A regular `g` remains at a generic point, so a regular Lagrangian exists; {decision.space.statement}."
        ),
    )


def of_one_coordinate(name: str, question: Question) -> Step:
    """The theorem of N. Sonin (1886) and G. Darboux (1894, Lecons III, art. 604)."""
    return said(f"{_theorem(name, question)}.")


def by_quadrature(name: str, question: Question) -> Step:
    """The integral that gives L of one coordinate, where no formula for it is found."""
    return said(f"A Lagrangian is {_by_quadrature(name, question)}. {_NOT_KNOWN}")


_NOT_KNOWN = "No formula for such a function was found."


def _theorem(name: str, question: Question) -> str:
    return (
        f"Every equation of one coordinate has a regular Lagrangian {question.form} "
        f"{checker.near_points(name, question.timed)} "
        "(Sonin 1886, Darboux 1894)"
    )


def _by_quadrature(name: str, question: Question) -> str:
    # E(L) = Gamma(I)/v, and the energy v dL/dv - L is I; with time, E(L) has the v-derivative of
    # the equation of M.
    x = name if len(name) == 1 and name not in _OF_QUADRATURE else "q"
    v = "w" if name == "v" else "v"
    named = "with " if x == name else f"with `{x} = {name}`, "
    return (
        f"`L = int int M d{v} d{v}` plus a function of `t` and `{x}`, for any `M(t, {x}, {v})` that is not 0 and solves "
        f"`d/dt M + M df/d{v} = 0` along all motions, {named}`{v} = {name}'` and `{name}'' = f`"
        if question.timed
        else f"`L = {v} int I/{v}^2 d{v}`, whose energy is `I`, for any `I({x}, {v})` that is not constant and is conserved: "
        f"`{v} dI/d{x} + f dI/d{v} = 0`, {named}`{v} = {name}'`, not 0, and `{name}'' = f`"
    )


_OF_QUADRATURE = "vfIMLt"  # the other letters of these sentences


def of_single_equations(
    systems: Sequence[SecondOrderSystem],
    numbers: str,
    forms: Sequence[ex.Expression],
    question: Question,
) -> Step:
    """Why a system that is one equation of complex or dual numbers, or several equations that share
    nothing, has a Lagrangian without a formula.
    """
    if numbers:
        told: list[Piece] = [
            f"With {numbers} numbers the system is one equation of one coordinate, and both parts of its Lagrangian "
            "are Lagrangians of the system"
        ]
    else:
        names = [f"u_{k}" for k in range(1, len(systems) + 1)] if forms else []
        table: dict[ex.Expression, ex.Expression] = {}
        for name, system in zip(names, systems, strict=False):
            for kind in (ex.Symbol, ex.Velocity):
                table[kind(system.coordinates[0])] = kind(name)
        shown = names or [system.coordinates[0] for system in systems]
        sums = [row(f"{name} = ", form) for name, form in zip(names, forms, strict=False)]
        rows = [
            row(f"{name}'' = ", ex.substitute(system.accelerations[0], table))
            for name, system in zip(shown, systems, strict=True)
        ]
        told = [
            *(["With ", *enumerated(sums), " the system is "] if forms else ["The system is "]),
            *enumerated(rows),
            ", and the sum of a Lagrangian of each is one of the system",
        ]
    return said(
        *told,
        f". That of `q'' = f` is {_by_quadrature('q', question)} (Sonin 1886, Darboux 1894). {_NOT_KNOWN}",
    )


def of_roots(characteristic: ex.Expression, letter: ex.Symbol, coordinates: Sequence[str]) -> Step:
    """The Lagrangian of q'' = C q' for constant C with different eigenvalues, the roots of
    det(letter - C).
    """
    name, listed = letter.name, ", ".join(coordinates)
    return said(
        f"The equations are `q'' = C q'` with a constant matrix `C`. For each root `{name}` of ",
        row(f"det({name} - C) = ", characteristic),
        f", choose a row `w` with `w C = {name} w`. Then the sum `u = w q` of {listed} has `u'' = {name} u'`, and `u' "
        f"log u' + {name} u` is a Lagrangian of this equation. The sum of these over the roots, which are different, is "
        "one of the system; the two terms of a pair of complex roots are conjugate. It is not written out, because some of "
        "the roots are those of no factor of degree 1 or 2.",
    )


def not_found(system: SecondOrderSystem, space: SolutionSpace | None) -> Step:
    """What is known without a closed form, and what to try; the factor as an integral if one matrix
    remains.
    """
    known = "" if space is None else f": {space.statement}"
    found = conditions.one_matrix(system) if len(system.coordinates) > 1 else None
    factor: list[Piece] = []
    if found is not None:
        places = itertools.combinations_with_replacement(range(len(system.coordinates)), 2)
        entries = [
            row(f"G_{i + 1}{j + 1} = ", found[0][i][j])
            for i, j in places
            if found[0][i][j] != ex.ZERO
        ]
        integrand = separated(
            [row("(", slope, ") d", variable) for variable, slope in found[1]], " + "
        )
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
    """The beginning of the power series of one regular Lagrangian, where f is rational and it is
    short.
    """
    from inverse_service.decision.deciding import as_tree, count_coefficients, rational_series

    n = len(analysis.system.coordinates)
    wanted = range(1, (order or _SERIES_ORDER) + 1)
    fitting = [
        k for k in wanted if count_coefficients(n, decision.question, k) <= _MOST_COEFFICIENTS
    ]
    spare = decision.order - 1 - decision.degree
    found = rational_series(analysis, decision.question, fitting[-1], spare) if fitting else None
    if found is None:
        return ()
    named = [symbol for symbol in found.point if symbol != ex.TIME or ex.TIME in found.variables]
    place = separated([row(symbol, f" = {found.point[symbol]}") for symbol in named])
    series = row("L = ", as_tree(found), " + …")
    step = said(
        "Near ", *place, f" one regular Lagrangian begins, to total degree {found.order + 2} and up to terms of at "
        "most first degree in the velocities (which the equations of motion then fix), as ",
        _written(series, "the formula below"), ".", shown=[] if len(series.text) <= bounds.SHOWN else [series],
    )  # fmt: skip
    return (step,)


def of_lagrangian(
    analysis: Analysis,
    question: Question,
    tree: ex.Expression,
    family: str,
    how: Sequence[Step],
    decision: Decision | None,
) -> Statement:
    """The answer that this Lagrangian proves, not yet checked: the plain proof, and how L was
    found.
    """
    return Statement(
        question,
        "variational",
        lagrangian=describe(analysis, tree, family),
        space=None if decision is None else decision.space,
        certificate=certify.of_lagrangian(analysis, tree, question),
        explanation=euler_lagrange_steps(analysis.system, tree),
        details=tuple(how),
    )


def branch_steps(
    system: SecondOrderSystem,
    positive: Sequence[ex.Expression],
    nonzero: Sequence[ex.Expression] = (),
) -> tuple[Step, ...]:
    """The variables that first-order equations eliminate, the set where the answer holds, and the
    roots there.
    """
    steps = list[Step]()
    if system.others:
        known = with_commas([row(ex.Symbol(name), " = ", tree) for name, tree in system.others])
        steps.append(
            said(
                "The first-order equations give ",
                known,
                "; substituting these leaves second-order equations.",
            )
        )
    if positive or nonzero:
        where = with_commas([*(row(tree, " != 0") for tree in nonzero), *map(inequality, positive)])
        roots = () if system.branch is None else system.branch.roots
        values = with_commas([row(root, " = ", value) for root, value in roots])
        steps.append(
            said("Where ", where, ": ", _written(values, "the roots are those given here"), ".")
            if roots
            else said("These statements hold where ", where, ".")
        )
    return tuple(steps)


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
    end = " is a Lagrangian for all constants `C_k` that keep the Hessian regular."
    return (
        first,
        said(
            "More generally, ",
            general if short else "every sum of multiples `C_k L_k` of its parts",
            end,
        ),
    )


def hamiltonian_of(
    lagrangian: ex.Expression, names: Sequence[str], positive: Sequence[ex.Expression] = ()
) -> Hamiltonian | None:
    """The Legendre transform where all of `positive` are > 0; None where the Hessian is singular
    after all.
    """
    try:
        transform = legendre(lagrangian, names, positive=positive)
    except InputError:
        return None
    return Hamiltonian(transform)


def legendre_steps(hamiltonian: Hamiltonian | None) -> tuple[Step, ...]:
    """How H follows from the momenta, where there is more to say than that they are solved for the
    velocities.
    """
    note = "" if hamiltonian is None else hamiltonian.transform.note.rstrip(".").replace("`", "")
    if hamiltonian is None or not note:
        return ()
    implicit = hamiltonian.transform.implicit
    solved = (
        f"{note}:"
        if implicit
        else f"The momenta `p = dL/dv` are solved for the velocities ({note});"
    )
    return (said(f"{solved} `H = p v - L`."),)
