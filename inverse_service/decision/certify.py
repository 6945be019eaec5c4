"""Write certificates from decisions and Lagrangians (see certificate/FORMAT.md), without judging
them.

Their "roots" are roots that equal simple functions on the side of a real point, as {"root": …,
"is": …}: sqrt(sin(u)^2) is sin(u) where sin(u) > 0. The checker proves each and restricts its claim
to the side on which it is true.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import mpmath

from inverse_service import bounds, errors
from inverse_service.certificate import checker
from inverse_service.decision import deciding
from inverse_service.expressions import (
    calculus,
    collecting,
    functions,
    notation,
    printing,
    refusals,
    tree as ex,
)
from inverse_service.field import cells, exact_field, real_branch, sign_cases, tower
from inverse_service.mechanics import euler_lagrange, linear_equations, moves, square_forms
from inverse_service.reading import names as nm, reader
from inverse_service.statements.domains import EVERYWHERE, Domain
from inverse_service.statements.questions import Question, narrowest

if TYPE_CHECKING:
    from inverse_service.decision.helmholtz import LagrangianKind
    from inverse_service.linear_pde import involution
    from inverse_service.mechanics.second_order_system import SecondOrderSystem

FORMAT = "inverse-service/certificate/2"
_DIGITS = 20
_SEED = 3
# The largest number of coordinates for which series are written.
_MOST_COORDINATES = 4
_MOST_CONDITIONS = 100  # per certificate
_LONGER = 6  # times as long as what people type may be a condition of the checker
_CIRCULAR = functions.CIRCULAR + functions.HYPERBOLIC
Entry = dict[str, str]  # of the roots of a certificate


def of_lagrangian(
    analysis: deciding.Analysis,
    lagrangian: ex.Expression,
    question: Question,
    kind: LagrangianKind | None = None,
) -> dict[str, Any]:
    """The certificate whose proof is L itself, also for a kind of Lagrangian; the `proved` one if
    there is one.
    """
    head = _head(analysis, point_of(analysis, lagrangian), question, "variational", "lagrangian")
    found = (
        head
        | _among(kind)
        | {"lagrangian": printing.to_text(lagrangian)}
        | integrals_of(lagrangian)
    )
    if analysis.system.is_unsolved:
        found |= _factors_of_lines(analysis, lagrangian)
    return analysis.proofs.get(json.dumps(found), (found,))[0]


def _factors_of_lines(analysis: deciding.Analysis, lagrangian: ex.Expression) -> dict[str, Any]:
    """{"factors": c_i with d2L/dv_i dv_j = c_i dE_i/dq''_j} unless all c_i are 1."""
    system = analysis.system
    lines = [linear_equations.linear_equation(equation).coefficients for equation in system.given]
    quotients = []
    for line, row in zip(
        lines, euler_lagrange.hessian(lagrangian, system.coordinates), strict=True
    ):
        entry, below = next(
            (g, line[q]) for q, g in zip(system.coordinates, row, strict=True) if q in line
        )
        quotients.append(entry / below)
    with suppress(exact_field.TooLarge, ZeroDivisionError, KeyError):
        factors = exact_field.factored(quotients, system.variables, exact_field.Budget.long())
        return (
            {}
            if all(c == ex.ONE for c in factors)
            else {"factors": [printing.to_text(c) for c in factors]}
        )
    return {}


def _among(kind: LagrangianKind | None) -> dict[str, Any]:
    return {} if kind is None else {"among": kind.among}


def integrals_of(tree: ex.Expression) -> dict[str, Any]:
    """{"integrals": the functions in the tree known by their derivatives, inner ones first}."""
    found = {node.name: node for node in reversed(list(walk_integrals(tree)))}
    listed = {
        name: {
            "arguments": list(names),
            "derivatives": {
                argument: printing.to_text(slope)
                for argument, slope in zip(names, node.slopes, strict=True)
                if slope is not None
            },
        }
        for name, node in found.items()
        for names in [
            (node.letter,) if node.letter else tuple(map(printing.to_text, node.arguments))
        ]
    }
    return {"integrals": listed} if listed else {}


def walk_integrals(tree: ex.Expression) -> Iterator[ex.Integral]:
    """Every integral in a tree, followed by the integrals under its sign."""
    for node in ex.walk(tree):
        if isinstance(node, ex.Integral):
            yield node
            for slope in node.slopes:
                if slope is not None:
                    yield from walk_integrals(slope)


def names_of_certificate(
    system: Mapping[str, Any],
    certificate: Mapping[str, Any] | None = None,
    more: Iterable[str] = (),
) -> nm.Names:
    """The names that formulas about a system may contain, with the integrals of a certificate and
    momenta.
    """
    integrals = ((certificate or {}).get("integrals") or {}).items()
    functions = {
        **system.get("functions", {}),
        **{name: one["arguments"] for name, one in integrals},
    }
    moving = {"t", *system["coordinates"], *(f"{name}'" for name in system["coordinates"])}
    letters = (by for _, one in integrals for by in one["arguments"] if by not in moving)
    parameters = (*(system.get("parameters") or ()), *more, *letters)
    return nm.Names(
        tuple(system["coordinates"]),
        parameters,
        {name: tuple(of) for name, of in functions.items()},
    )


def where_of(
    cell: checker.Cell | None, names: nm.Names, formulas: Sequence[ex.Expression] = ()
) -> Domain:
    """The cell on which the checker proved a claim about the formulas, as trees; where these need
    more by `field.cells`, which knows nothing of the checker, the set is so much smaller.
    """
    if cell is None:
        return EVERYWHERE
    positive = tuple(_members(cell.domain, " > 0", names))
    nonzero = tuple(map(_unsigned, _members(cell.domain, " != 0", names)))
    for kind, tree in cells.needed_beyond(tuple(formulas), positive, nonzero):
        short = _with_squares(tree, tuple(map(ex.Symbol, (*names.coordinates, *names.parameters))))
        if kind == ">":
            positive = (*positive, short)
        else:
            nonzero = (*nonzero, _unsigned(short))
    return Domain(positive, nonzero, tuple(_members(cell.sides, " > 0", names)), cell.one_side)


def forces_of(system: SecondOrderSystem) -> tuple[ex.Expression, ...]:
    """f as certificates state it; none of a system that is not solved for the accelerations."""
    return () if system.is_unsolved else tuple(system.given)


class Conditions(NamedTuple):
    """The conditions of a set, as people read them."""

    texts: list[str]
    latex: list[str]


def domain_of(cell: checker.Cell | None, names: nm.Names) -> Conditions:
    """The conditions of a cell in readable form, as text and as LaTeX."""
    where = where_of(cell, names)
    trees = (*(tree**2 for tree in where.nonzero), *where.positive)
    texts, latex = notation.inequality_text, notation.inequality_latex
    return Conditions([*map(texts, trees)], [*map(latex, trees)])


def shortest(positive: Sequence[ex.Expression], nonzero: Sequence[ex.Expression] = ()) -> list[str]:
    """The inequalities that state that these trees are positive, or not 0, without those implied by
    the others.
    """
    return list(_shortest(tuple(dict.fromkeys(positive)), tuple(dict.fromkeys(nonzero))))


@lru_cache(
    maxsize=1024
)  # an answer, its Lagrangian and its Hamiltonian often share their conditions
def _shortest(
    positive: tuple[ex.Expression, ...], nonzero: tuple[ex.Expression, ...]
) -> Sequence[str]:
    trees = [*nonzero, *positive]
    if not trees:
        return ()
    kept = cells.shortest(positive, nonzero)
    if kept is None:
        kept = [*(("!=", tree) for tree in nonzero), *((">", tree) for tree in positive)]
    given = {*trees}
    return [*dict.fromkeys(_inequality(kind, tree, tree in given) for kind, tree in kept)]


def _inequality(kind: str, tree: ex.Expression, as_given: bool) -> str:
    """The condition as people write it, with sums of squares restored in a tree of our own."""
    if as_given:
        row = notation.row(tree, " != 0") if kind == "!=" else notation.inequality(tree)
        return row.text
    names = dict.fromkeys(node for node in ex.walk(tree) if isinstance(node, ex.Symbol))
    short = _with_squares(tree, tuple(names))
    return notation.inequality_text(short if kind == ">" else _unsigned(short) ** 2)


def _members(texts: Sequence[str], ending: str, names: nm.Names) -> list[ex.Expression]:
    """The conditions with this ending as trees, short ones first, with sums of squares restored."""
    found = [_member(text.removesuffix(ending), names) for text in texts if text.endswith(ending)]
    return sorted(
        found, key=lambda tree: (ex.node_count(tree), printing.natural(printing.to_text(tree)))
    )


@lru_cache(maxsize=1024)  # the same conditions hold where L, H and the answer do
def _member(text: str, names: nm.Names) -> ex.Expression:
    letters = tuple(map(ex.Symbol, (*names.coordinates, *names.parameters)))
    with refusals.longer_texts(_LONGER):
        tree = reader.read_formula(text, names)
    return _with_squares(tree, letters)


# The tree of an inequality, with the names that squares may hold.
DOMAINS: tuple[moves.Form[tuple[ex.Symbol, ...]], ...] = (
    moves.Form(
        "sums of squares of linear forms",
        moves.Holds.WHERE_DEFINED,
        lambda letters, tree: square_forms.sums_of_squares(tree, letters),
    ),
)


def _with_squares(tree: ex.Expression, letters: tuple[ex.Symbol, ...]) -> ex.Expression:
    return moves.cheapest(DOMAINS, letters, collecting.collect(tree))


def _unsigned(tree: ex.Expression) -> ex.Expression:
    """The tree or its negative, whichever has fewer minus signs."""
    return min(tree, collecting.collect(-tree), key=lambda one: printing.to_text(one).count("-"))


def prove(
    analysis: deciding.Analysis, certificate: dict[str, Any], time_limit: float
) -> deciding.Proof:
    """The certificate checked, cached; if the result is incomplete, it gets hints about roots.

    Each hint restricts the claim to one side; without hints a claim is valid on a larger cell.
    """
    key = json.dumps(certificate)
    if key not in analysis.proofs:
        proof = deciding.Proof(
            certificate, checker.check_certificate(certificate, time_limit=time_limit)
        )
        if proof.found.verdict == "incomplete":
            for hinted in _hinted(analysis, certificate):
                found = checker.check_certificate(hinted, time_limit=time_limit)
                if found.verdict != "incomplete":
                    proof = deciding.Proof(hinted, found)
                    break
        analysis.proofs[key] = proof
        analysis.proofs[json.dumps(proof.certificate)] = proof
    return analysis.proofs[key]


def _hinted(analysis: deciding.Analysis, certificate: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The certificate with the roots implied by functions, then with the signs of all radicands at
    P as well.
    """
    table, system = analysis.real_point, analysis.system
    formulas = [*system.given]
    if "lagrangian" in certificate:
        formulas.append(
            reader.read_formula(
                certificate["lagrangian"], names_of_certificate(certificate["system"], certificate)
            )
        )
    known = certificate.get("roots", [])
    first, signs = _roots_of_formulas(formulas, table), _roots_of_signs(analysis)
    for roots in (first, [*first, *signs]):
        if roots:
            yield certificate | {"roots": [*known, *roots]}
    if table is not None:
        with suppress(errors.IrreducibleAtoms, calculus.NoRealValue):
            positive = [
                *system.positive,
                *sign_cases.signed_factors(
                    real_branch.requirements([*map(tower.to_kernels, formulas)], table), table
                ),
            ]
            yield certificate | {
                "conditions": inequality_texts(positive),
                "roots": [*known, *signs],
            }


def where_proved(
    analysis: deciding.Analysis, lagrangian: ex.Expression, time_limit: float
) -> Domain:
    """The set on which the checker confirms a Lagrangian; if it does not, the set on which
    everything is defined.
    """
    question = narrowest(analysis.system.depends_on_time or ex.holds(lagrangian, ex.TIME))
    certificate, proof = prove(analysis, of_lagrangian(analysis, lagrangian, question), time_limit)
    if proof.verdict != "valid":
        positive = (*analysis.system.positive, *real_branch.own_requirements([lagrangian]))
        return Domain(positive, tuple(real_branch.poles([lagrangian])))
    formulas = (*forces_of(analysis.system), lagrangian)
    return where_of(
        proof.formulas, names_of_certificate(certificate["system"], certificate), formulas
    )


def point_of(
    analysis: deciding.Analysis, lagrangian: ex.Expression
) -> real_branch.RealTable | None:
    """A real point at which f, L, and the integrands are defined, by preference the point of f."""
    slopes = [
        slope
        for node in walk_integrals(lagrangian)
        for slope in node.derivatives
        if slope is not None
    ]
    formulas = [
        tower.to_kernels(tree) for tree in (*analysis.system.accelerations, lagrangian, *slopes)
    ]
    table = analysis.real_point
    if table is not None:
        integrals = {
            node: mpmath.mpf(1)
            for tree in formulas
            for node in ex.walk(tree)
            if isinstance(node, ex.Integral)
        }
        if real_branch.is_defined(formulas, integrals | table):
            return integrals | table
    variables, sides = deciding.variables_of(analysis.system), analysis.system.positive
    return real_branch.find_real_point(formulas, variables, _SEED, sides) or table


def of_decision(
    analysis: deciding.Analysis,
    decision: deciding.Decision,
    series_order: int | None = None,
    seed: int = 1,
    kind: LagrangianKind | None = None,
) -> dict[str, Any]:
    """The certificate of a decision: the rows used for a negative verdict, the involution data of a
    positive one.

    For rational f, the latter include a power series of a regular solution to `series_order`
    (default: the order of the data), unless the question is about a kind of Lagrangian.
    """
    if decision.verdict == "not_variational":
        rows = [[kind, i, j, list(alpha)] for kind, i, j, alpha in decision.rows]
        head = _head(
            analysis, analysis.real_point, decision.question, "not_variational", "nonexistence"
        )
        return head | _among(kind) | {"order": decision.order, "rows": rows}
    if decision.verdict != "variational" or decision.symbol is None:
        raise ValueError("only a definite decision has a certificate")
    head = _head(analysis, analysis.real_point, decision.question, "variational", "existence")
    data = involution_data(decision, decision.symbol)
    if kind is not None:
        return head | _among(kind) | data
    return head | data | _series(analysis, decision, series_order or data["order"], seed)


def involution_data(
    found: deciding.Decision | involution.Finding, symbol: involution.Symbol
) -> dict[str, Any]:
    """The proof of a yes without L; the dimension stopped falling between order - 1 and order."""
    return {
        "order": found.order - 1,
        "degree": found.degree,
        "dimensions": list(found.history[found.order - 1][: found.degree + 1]),
        "symbol": {
            "dimension": symbol.dimension,
            "prolonged": symbol.prolonged,
            "characters": list(symbol.characters),
        },
    }


def _series(
    analysis: deciding.Analysis, decision: deciding.Decision, order: int, seed: int
) -> dict[str, Any]:
    """{"series": …} to the order, or to the largest lower order with an acceptable length; {} if
    there is none.
    """
    n = len(analysis.system.coordinates)
    fitting = [
        k
        for k in range(1, order + 1)
        if deciding.count_coefficients(n, decision.question, k) <= bounds.TERMS
    ]
    if n > _MOST_COORDINATES or not fitting or not deciding.is_rational(analysis):
        return {}
    # The data of order R - 1 are complete in degree d, so those of order s + R - 1 - d are in
    # degree s >= d.
    spare = decision.order - 1 - decision.degree
    try:
        return {
            "series": deciding.regular_series(analysis, decision.question, fitting[-1], seed, spare)
        }
    except (ValueError, errors.IrreducibleAtoms, exact_field.TooLarge):
        return {}


def head_of(
    system: dict[str, Any],
    question: Question,
    claim: str,
    kind: str,
    near: dict[str, str],
    positive: Sequence[ex.Expression],
    roots: Sequence[dict[str, str]] = (),
) -> dict[str, Any]:
    """The fields of every certificate; `near` is a point of the domain, on which the trees of
    `positive` are > 0.
    """
    parts = {"near": near, "conditions": inequality_texts(positive), "roots": [*roots]}
    head = {
        "format": FORMAT,
        "system": system,
        "question": question.certified,
        "claim": claim,
        "kind": kind,
    }
    return head | {key: part for key, part in parts.items() if part}


def inequality_texts(positive: Iterable[ex.Expression]) -> list[str]:
    """The inequalities of a certificate that state that these trees are positive."""
    texts = (
        f"{printing.to_text(tree)} > 0"
        if isinstance(tree, ex.Power)
        else notation.inequality_text(tree)
        for tree in positive
    )
    return [*dict.fromkeys(texts)][:_MOST_CONDITIONS]


def moved_to(near: Mapping[str, str], table: real_branch.RealTable) -> dict[str, str]:
    """The values of the same names at another point, in digits."""
    named = {
        printing.to_text(key): mpmath.nstr(value, _DIGITS)
        for key, value in table.items()
        if not isinstance(key, ex.Integral)
    }
    return {name: named.get(name, value) for name, value in near.items()}


def near_of(
    table: real_branch.RealTable | None, names: Sequence[ex.Symbol | ex.Velocity]
) -> dict[str, str]:
    """The values of these names at a real point, in digits."""
    return (
        {printing.to_text(key): mpmath.nstr(table[key], _DIGITS) for key in names if key in table}
        if table
        else {}
    )


def _head(
    analysis: deciding.Analysis,
    table: real_branch.RealTable | None,
    question: Question,
    claim: str,
    kind: str,
) -> dict[str, Any]:
    system = analysis.system
    places: list[ex.Symbol | ex.Velocity] = [
        *map(ex.Symbol, system.coordinates),
        ex.TIME,
        *map(ex.Velocity, system.coordinates),
    ]
    near = near_of(table, [*places, *map(ex.Symbol, system.parameters), *system.letters])
    return head_of(
        _system(system), question, claim, kind, near, system.positive, _roots_of_system(analysis)
    )


def _system(system: SecondOrderSystem) -> dict[str, Any]:
    pairs = zip(system.coordinates, system.given, strict=True)
    return {
        "coordinates": list(system.coordinates),
        "equations": {name: printing.to_text(f) for name, f in pairs},
        "parameters": list(system.parameters),
        "functions": {name: list(arguments) for name, arguments in system.functions},
    }


# Roots that equal simple functions on the side of a real point.


def _roots_of_system(analysis: deciding.Analysis) -> list[Entry]:
    """The hints for every claim about the system: from its branch, halves of arctangents, and roots
    of numbers.
    """
    return [*_of_branch(analysis.system), *_halved(analysis), *_of_numbers(analysis)]


def _roots_of_formulas(
    formulas: Sequence[ex.Expression], table: real_branch.RealTable | None
) -> list[Entry]:
    """The roots in the formulas, or implied by their inverse functions, that equal functions or
    sums of roots.
    """
    hidden = _hidden_radicands(formulas)
    with_hidden = [*formulas, *map(ex.square_root, hidden)]
    return [
        *_circular(with_hidden, table),
        *_of_squares(hidden, table),
        *_with_roots_inside(formulas, table),
    ]


def _roots_of_signs(analysis: deciding.Analysis) -> list[Entry]:
    """The signs of functions under roots, as sqrt(u^2) = u: sqrt(1 + tan(x)^2) is 1/cos(x) where
    cos(x) > 0.
    """
    signed = (factor if sign > 0 else -factor for factor, sign in analysis.tower.signs)
    return [_of_square(u) for u in signed if ex.has(u, ex.Apply)]


def _hidden_radicands(formulas: Sequence[ex.Expression]) -> list[ex.Expression]:
    """The radicands implied by inverse functions: 1 - u^2 for asin u and acos u."""
    found = list[ex.Expression]()
    for node in ex.distinct_nodes(formulas):
        match node:
            case ex.Apply(function, u) if (slope := functions.slope(function)) and slope[
                3
            ].denominator == 2:
                found.append(slope[1] + slope[2] * u**2)
    return found


def _of_squares(
    radicands: Sequence[ex.Expression], table: real_branch.RealTable | None
) -> list[Entry]:
    """The roots of the radicands that are squares, valid on the side of the point."""
    found = list[Entry]()
    for under in radicands if table is not None else ():
        with suppress(errors.IrreducibleAtoms, calculus.NoRealValue):
            if (value := _root_here(under, table or {})) is not None:
                found.append(_entry(ex.square_root(collecting.collect(under)), value))
    return found


def _with_roots_inside(
    formulas: Sequence[ex.Expression], table: real_branch.RealTable | None
) -> list[Entry]:
    """sqrt(a + b r) = sqrt((a + d)/2) +- sqrt((a - d)/2) for r = sqrt(v), d^2 = a^2 - b^2 v, on the
    side of the point.

    If b = 0 after replacing r^2 by v, it is the root of the square a.
    """
    found = list[Entry]()
    for node in ex.distinct_nodes(formulas) if table is not None else ():
        nested = _nested_root(node)
        if nested is None:
            continue
        a, b, v = nested
        value: ex.Expression | None
        with suppress(errors.IrreducibleAtoms, calculus.NoRealValue):
            value = _root_here(a if b == ex.ZERO else a**2 - b**2 * v, table or {})
            if value is not None and b != ex.ZERO:
                first, second = (
                    ex.square_root(collecting.collect((a + d) / 2)) for d in (value, -value)
                )
                value = (
                    first + second if real_branch.are_positive([b], table or {}) else first - second
                )
            if value is not None:
                found.append(_entry(node, collecting.collect(value)))
    return found


class NestedRoot(NamedTuple):
    """sqrt(rest + factor sqrt(inside))."""

    rest: ex.Expression
    factor: ex.Expression
    inside: ex.Expression


def _nested_root(node: ex.Expression) -> NestedRoot | None:
    """(a, b, v) of sqrt(a + b sqrt(v)), in which a and b contain no other even root; None if it has
    another form.
    """
    if not (isinstance(node, ex.Power) and node.exponent == ex.HALF):
        return None
    inner = [
        one
        for one in ex.distinct_nodes([node.base])
        if isinstance(one, ex.Power) and tower.is_even_root(one)
    ]
    if len(inner) != 1 or inner[0].exponent != ex.HALF:
        return None
    letter, v = ex.Symbol("_r"), inner[0].base
    parts = list[ex.Expression]([ex.ZERO, ex.ZERO])
    for monomial, coefficient in collecting.expand(ex.substitute(node.base, {inner[0]: letter})):
        power = dict(monomial).get(letter, Fraction(0))
        if power.denominator > 1 or power < 0:
            return None
        rest = [atom ** ex.number(exponent) for atom, exponent in monomial if atom != letter]
        parts[int(power % 2)] += ex.multiply(
            ex.number(coefficient), v ** ex.number(power // 2), *rest
        )
    a, b = map(collecting.collect, parts)
    return None if ex.holds(a, letter) or ex.holds(b, letter) else NestedRoot(a, b, v)


def _root_here(square: ex.Expression, table: real_branch.RealTable) -> ex.Expression | None:
    """The positive root of a square without a root sign, on the side of the point; None if it is
    not a square.
    """
    root = ex.square_root(collecting.collect(square))
    if isinstance(root, ex.Number):
        return root
    return next(
        (
            value
            for side, value in sign_cases.root_ways(root)
            if real_branch.are_positive(side, table)
        ),
        None,
    )


def _circular(
    formulas: Sequence[ex.Expression], table: real_branch.RealTable | None
) -> list[Entry]:
    """sqrt(1 - sin(u)^2) = +-cos u, sqrt(sinh(u)^2 + 1) = cosh u, and similar roots, on the side of
    the point.

    Also roots of a number times the square of a function in the formulas: sqrt((1 - x)/2) =
    sin(acos(x)/2).
    """
    found = list[Entry]()
    others = [
        node
        for node in ex.distinct_nodes(formulas)
        if isinstance(node, ex.Apply) and real_branch.varies(node)
    ]
    for node in ex.distinct_nodes(formulas) if table is not None else ():
        if not isinstance(node, ex.Power) or not tower.is_even_root(node):
            continue
        angles = dict.fromkeys(
            angle for one in ex.walk(node.base) if (angle := _angle(one)) is not None
        )
        parts = [part for u in angles for part in (u, u / 2, u / 2 + ex.PI / 4)]
        for value in [*(ex.Apply(name, part) for part in parts for name in _CIRCULAR), *others]:
            factor = _ratio(node.base, value**2, table or {})
            if factor is not None:
                sign = 1 if real_branch.are_positive([value], table or {}) else -1
                found.append(
                    _entry(
                        ex.square_root(node.base), sign * ex.square_root(ex.number(factor)) * value
                    )
                )
                break
    return found


def _angle(node: ex.Expression) -> ex.Expression | None:
    match node:
        case ex.Apply(name, u) if name in _CIRCULAR and real_branch.varies(u):
            return u
    return None


def _ratio(
    base: ex.Expression, square: ex.Expression, table: real_branch.RealTable
) -> Fraction | None:
    """A rational number that the quotient apparently equals; the checker proves it."""
    ratios = []
    for shift in (mpmath.mpf(0), mpmath.mpf(1) / 7, mpmath.mpf(-2) / 9):
        with suppress(calculus.NoRealValue, ZeroDivisionError):
            # Each variable gets a separate factor, because a quotient may be homogeneous of degree
            # 0.
            moved = {
                key: value * (1 + shift / (k + 1)) for k, (key, value) in enumerate(table.items())
            }
            ratios.append(calculus.evaluate(base, moved) / calculus.evaluate(square, moved))
    if len(ratios) < 3 or ratios[0] <= 0:
        return None
    factor = Fraction(mpmath.nstr(ratios[0], 15)).limit_denominator(1000)
    number = mpmath.mpf(factor.numerator) / factor.denominator
    return (
        factor
        if all(abs(ratio - number) < mpmath.mpf(10) ** -12 * ratio for ratio in ratios)
        else None
    )


def _of_branch(system: SecondOrderSystem) -> list[Entry]:
    found = () if system.branch is None else system.branch.roots
    return [_entry(*pair) for root in found if (pair := _on_branch(*root)) is not None]


def _on_branch(
    node: ex.Expression, value: ex.Expression
) -> tuple[ex.Expression, ex.Expression] | None:
    """A root with a positive exponent; for asin(sin u), sqrt(1 - sin(u)^2) = cos u or -cos u;
    acos(cos u) likewise.
    """
    match node:
        case ex.Power(base, ex.Number(exponent)) if exponent < 0:
            return base**-exponent, value**-1
        case ex.Power():
            return node, value
        case ex.Apply("asin" | "acos" as function, ex.Apply(inner, u)):
            other = ex.Apply("cos" if function == "asin" else "sin", u)
            root = ex.square_root(1 - ex.Apply(inner, u) ** 2)
            return root, other if value == u else -other
        case ex.Apply("Heaviside", u):
            return ex.square_root(u**2), -u if value == ex.ZERO else u
        case _:
            return None


def _halved(analysis: deciding.Analysis) -> list[Entry]:
    """cos(atan(w)/2) > 0 if f has roots, because nested roots may be products of it and others."""
    if not any(
        tower.is_even_root(node) and real_branch.varies(node)
        for node in ex.distinct_nodes(analysis.system.given)
    ):
        return []
    rules = [
        rule
        for rule in analysis.tower.rules
        if isinstance(rule, tower.AngleRule) and not rule.turns
    ]
    halved = (atom for rule in rules for atom, a in rule.arctangents if a.denominator % 2 == 0)
    return [_of_square(ex.Apply("cos", atom / 2)) for atom in dict.fromkeys(halved)]


def _of_numbers(analysis: deciding.Analysis) -> Iterator[Entry]:
    """Nested roots of numbers expressed by the roots in f: (2 + sqrt(5))^(1/3) = (1 + sqrt(5))/2
    (by PSLQ).
    """
    nodes = (
        node
        for node in ex.distinct_nodes(analysis.accelerations)
        if isinstance(node, ex.Power) and not real_branch.varies(node)
    )
    roots = [
        node
        for node in nodes
        if isinstance(node.exponent, ex.Number) and deciding.is_irrational(node)
    ]
    for node in roots:
        others = [one for one in roots if node not in ex.walk(one)]
        if {*others}.isdisjoint(ex.walk(node.base)) or not isinstance(node.exponent, ex.Number):
            continue
        whole = node.base ** Fraction(1, node.exponent.value.denominator)
        known: list[ex.Expression] = [ex.number(1), *others]
        try:
            with mpmath.workdps(bounds.DIGITS):
                values = [calculus.evaluate(one, {}) for one in (whole, *known)]
                found = mpmath.pslq(values, maxcoeff=bounds.RATIO, maxsteps=bounds.RATIO)
        except calculus.NoRealValue:
            continue
        if found and found[0]:
            terms = (Fraction(-a, found[0]) * b for a, b in zip(found[1:], known, strict=True))
            yield _entry(whole, ex.add(*terms))


def _of_square(u: ex.Expression) -> Entry:
    return {"root": f"sqrt(({printing.to_text(u)})^2)", "is": printing.to_text(u)}


def _entry(root: ex.Expression, value: ex.Expression) -> Entry:
    match root:  # is printed as abs(u), which is no root to the checker
        case ex.Power(ex.Power(u, ex.TWO), ex.HALF):
            return {"root": f"sqrt(({printing.to_text(u)})^2)", "is": printing.to_text(value)}
        case ex.Power(base, ex.Number(e)) if e != Fraction(1, 2):  # 4^(1/4) needs the brackets
            return {"root": f"({printing.to_text(base)})^({e})", "is": printing.to_text(value)}
    return {"root": printing.to_text(root), "is": printing.to_text(value)}
