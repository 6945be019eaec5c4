"""Write certificates from decisions and Lagrangians (see certificate/FORMAT.md), without judging them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import mpmath

from inverse_service import bounds, errors
from inverse_service.certificate import cell as cells, checker, formulas
from inverse_service.decision import deciding, root_hints
from inverse_service.expressions import collecting, evaluation, inequalities, notation, printing, tree as ex
from inverse_service.field import exact_field, real_point, reduction, tower
from inverse_service.mechanics import euler_lagrange, implicit_equations, short_forms
from inverse_service.reading import names as nm, reader

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


def of_lagrangian(
    analysis: deciding.Analysis, lagrangian: ex.Expression, with_time: bool, kind: LagrangianKind | None = None
) -> dict[str, Any]:
    """The certificate whose proof is L itself, also for a kind of Lagrangian; the `proved` one if there is one."""
    head = _head(analysis, point_of(analysis, lagrangian), with_time, "variational", "lagrangian")
    found = head | _among(kind) | {"lagrangian": printing.to_text(lagrangian)} | integrals_of(lagrangian)
    if analysis.system.is_unsolved:
        found |= _factors_of_lines(analysis, lagrangian)
    return analysis.proofs.get(json.dumps(found), (found,))[0]


def _factors_of_lines(analysis: deciding.Analysis, lagrangian: ex.Expression) -> dict[str, Any]:
    """{"factors": c_i with d2L/dv_i dv_j = c_i dE_i/dq''_j} unless all c_i are 1."""
    system = analysis.system
    lines = [implicit_equations.linear_equation(equation).coefficients for equation in system.given]
    quotients = []
    for line, row in zip(lines, euler_lagrange.hessian(lagrangian, system.coordinates), strict=True):
        entry, below = next((g, line[q]) for q, g in zip(system.coordinates, row, strict=True) if q in line)
        quotients.append(entry / below)
    with suppress(exact_field.TooLarge, ZeroDivisionError, KeyError):
        factors = exact_field.factored(quotients, system.variables, exact_field.Budget.long())
        return {} if all(c == ex.ONE for c in factors) else {"factors": [printing.to_text(c) for c in factors]}
    return {}


def _among(kind: LagrangianKind | None) -> dict[str, Any]:
    return {} if kind is None else {"among": kind.among}


def integrals_of(tree: ex.Expression) -> dict[str, Any]:
    """{"integrals": the functions in the tree known by their derivatives, inner ones first}."""
    found = {node.name: node for node in reversed(list(walk_integrals(tree)))}
    listed = {
        name: {
            "arguments": [printing.to_text(argument) for argument in node.arguments],
            "derivatives": {
                printing.to_text(argument): printing.to_text(slope)
                for argument, slope in zip(node.arguments, node.slopes, strict=True)
                if slope is not None
            },
        }
        for name, node in found.items()
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


@dataclass(frozen=True, slots=True)
class Where:
    """The set on which an answer is valid: trees that are positive, trees that are not 0, and sides that its proof
    needs.

    `one_side`: only the connected component of the proof's point.
    """

    positive: tuple[ex.Expression, ...] = ()
    nonzero: tuple[ex.Expression, ...] = ()
    sides: tuple[ex.Expression, ...] = ()
    one_side: bool = False


def names_of(
    system: Mapping[str, Any], certificate: Mapping[str, Any] | None = None, more: Iterable[str] = ()
) -> nm.Names:
    """The names that formulas about a system may contain, with the integrals of a certificate and momenta."""
    integrals = ((certificate or {}).get("integrals") or {}).items()
    functions = {**system.get("functions", {}), **{name: one["arguments"] for name, one in integrals}}
    parameters = (*(system.get("parameters") or ()), *more)
    return nm.Names(tuple(system["coordinates"]), parameters, {name: tuple(of) for name, of in functions.items()})


def where_of(cell: cells.Cell | None, names: nm.Names) -> Where:
    """The cell on which the checker proved a claim, as trees."""
    if cell is None:
        return Where()
    positive = tuple(_members(cell.domain, " > 0", names))
    nonzero = tuple(map(_unsigned, _members(cell.domain, " != 0", names)))
    return Where(positive, nonzero, tuple(_members(cell.sides, " > 0", names)), cell.one_side)


def domain_of(cell: cells.Cell | None, names: nm.Names) -> tuple[list[str], list[str]]:
    """The conditions of a cell in readable form, as text and as LaTeX."""
    where = where_of(cell, names)
    trees = (*(tree**2 for tree in where.nonzero), *where.positive)
    return [*map(inequalities.inequality_text, trees)], [*map(inequalities.inequality_latex, trees)]


def shortest(positive: Sequence[ex.Expression], nonzero: Sequence[ex.Expression] = ()) -> list[str]:
    """The inequalities that state that these trees are positive, or not 0, without those implied by the others."""
    return list(_shortest(tuple(positive), tuple(nonzero)))


@lru_cache(maxsize=1024)  # an answer, its Lagrangian and its Hamiltonian often share their conditions
def _shortest(positive: tuple[ex.Expression, ...], nonzero: tuple[ex.Expression, ...]) -> Sequence[str]:
    trees = [*nonzero, *positive]
    if not trees:
        return ()
    written = [*(notation.row(tree, " != 0") for tree in nonzero), *map(inequalities.inequality, positive)]
    stated = [*inequalities.texts(nonzero, " != 0"), *inequalities.texts(positive, " > 0")]
    shown = dict(zip(stated, (one.text for one in written), strict=True))
    try:
        asked = inequalities.question_about(trees)
        found = cells.shortest(asked, stated).domain
    except formulas.Ended:
        return [*dict.fromkeys(shown.values())]
    functions = {name: tuple(of) for name, of in asked.functions.items()}
    names = nm.Names(tuple(asked.coordinates), tuple(asked.parameters), functions)
    return [shown.get(text) or domain_of(cells.Cell((text,)), names)[0][0] for text in found]


def _members(texts: Sequence[str], ending: str, names: nm.Names) -> list[ex.Expression]:
    """The conditions with this ending as trees, short ones first, with sums of squares restored."""
    letters = list(map(ex.Symbol, (*names.coordinates, *names.parameters)))
    found = []
    for text in texts:
        if text.endswith(ending):
            tree = collecting.collect(reader.read_formula(text.removesuffix(ending), names))
            found.append(min([tree, *short_forms.sums_of_squares(tree, tuple(letters))], key=ex.node_count))
    return sorted(found, key=lambda tree: (ex.node_count(tree), collecting.natural(printing.to_text(tree))))


def _unsigned(tree: ex.Expression) -> ex.Expression:
    """The tree or its negative, whichever has fewer minus signs."""
    return min(tree, collecting.collect(-tree), key=lambda one: printing.to_text(one).count("-"))


def proved(
    analysis: deciding.Analysis, certificate: dict[str, Any], time_limit: float
) -> tuple[dict[str, Any], checker.CheckResult]:
    """(certificate, the checker's result), cached; if the result is incomplete, the certificate gets hints about roots.

    Each hint restricts the claim to one side; without hints a claim is valid on a larger cell.
    """
    key = json.dumps(certificate)
    if key not in analysis.proofs:
        found = certificate, checker.check_certificate(certificate, time_limit=time_limit)
        if found[1].verdict == "incomplete":
            for hinted in _hinted(analysis, certificate):
                proof = checker.check_certificate(hinted, time_limit=time_limit)
                if proof.verdict != "incomplete":
                    found = hinted, proof
                    break
        analysis.proofs[key] = found
        analysis.proofs[json.dumps(found[0])] = found
    return analysis.proofs[key]


def _hinted(analysis: deciding.Analysis, certificate: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The certificate with the roots implied by functions, then with the signs of all radicands at P as well."""
    table, system = analysis.real_point, analysis.system
    formulas = [*system.given]
    if "lagrangian" in certificate:
        formulas.append(reader.read_formula(certificate["lagrangian"], names_of(certificate["system"], certificate)))
    known = certificate.get("roots", [])
    first, signs = root_hints.of_formulas(formulas, table), root_hints.of_signs(analysis)
    for roots in (first, [*first, *signs]):
        if roots:
            yield certificate | {"roots": [*known, *roots]}
    if table is not None:
        with suppress(errors.IrreducibleAtoms, evaluation.NoRealValue):
            positive = [
                *system.positive,
                *reduction.signed_factors(real_point.requirements([*map(tower.to_kernels, formulas)], table), table),
            ]
            yield certificate | {"conditions": conditions_of(positive), "roots": [*known, *signs]}


def where_proved(analysis: deciding.Analysis, lagrangian: ex.Expression, time_limit: float) -> Where:
    """The set on which the checker confirms a Lagrangian; if it does not, the set on which everything is defined."""
    with_time = analysis.system.depends_on_time or ex.TIME in ex.walk(lagrangian)
    certificate, proof = proved(analysis, of_lagrangian(analysis, lagrangian, with_time), time_limit)
    if proof.verdict != "valid":
        positive = (*analysis.system.positive, *real_point.own_requirements([lagrangian]))
        return Where(positive, tuple(real_point.poles([lagrangian])))
    return where_of(proof.formulas, names_of(certificate["system"], certificate))


def point_of(analysis: deciding.Analysis, lagrangian: ex.Expression) -> real_point.RealTable | None:
    """A real point at which f, L, and the integrands are defined, by preference the point of f."""
    slopes = [slope for node in walk_integrals(lagrangian) for slope in node.slopes if slope is not None]
    formulas = [tower.to_kernels(tree) for tree in (*analysis.system.accelerations, lagrangian, *slopes)]
    table = analysis.real_point
    if table is not None:
        integrals = {
            node: mpmath.mpf(1) for tree in formulas for node in ex.walk(tree) if isinstance(node, ex.Integral)
        }
        if real_point.is_defined(formulas, integrals | table):
            return integrals | table
    variables, sides = deciding.variables_of(analysis.system), analysis.system.positive
    return real_point.find_real_point(formulas, variables, _SEED, sides) or table


def of_decision(
    analysis: deciding.Analysis,
    decision: deciding.Decision,
    series_order: int | None = None,
    seed: int = 1,
    kind: LagrangianKind | None = None,
) -> dict[str, Any]:
    """The certificate of a decision: the rows used for a negative verdict, the involution data of a positive one.

    For rational f, the latter include a power series of a regular solution to `series_order` (default: the order of the
    data), unless the question is about a kind of Lagrangian.
    """
    if decision.verdict == "not_variational":
        rows = [[kind, i, j, list(alpha)] for kind, i, j, alpha in decision.rows]
        head = _head(analysis, analysis.real_point, decision.with_time, "not_variational", "nonexistence")
        return head | _among(kind) | {"order": decision.order, "rows": rows}
    if decision.verdict != "variational" or decision.symbol is None:
        raise ValueError("only a definite decision has a certificate")
    head = _head(analysis, analysis.real_point, decision.with_time, "variational", "existence")
    data = involution_data(decision, decision.symbol)
    if kind is not None:
        return head | _among(kind) | data
    return head | data | _series(analysis, decision, series_order or data["order"], seed)


def involution_data(found: deciding.Decision | involution.Finding, symbol: involution.Symbol) -> dict[str, Any]:
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


def _series(analysis: deciding.Analysis, decision: deciding.Decision, order: int, seed: int) -> dict[str, Any]:
    """{"series": …} to the order, or to the largest lower order with an acceptable length; {} if there is none."""
    n = len(analysis.system.coordinates)
    fitting = [k for k in range(1, order + 1) if deciding.count_coefficients(n, decision.with_time, k) <= bounds.TERMS]
    if n > _MOST_COORDINATES or not fitting or not deciding.is_rational(analysis):
        return {}
    # The data of order R - 1 are complete in degree d, so those of order s + R - 1 - d are in degree s >= d.
    spare = decision.order - 1 - decision.degree
    try:
        return {"series": deciding.regular_series(analysis, decision.with_time, fitting[-1], seed, spare)}
    except (ValueError, errors.IrreducibleAtoms, exact_field.TooLarge):
        return {}


def head_of(
    system: dict[str, Any],
    with_time: bool,
    claim: str,
    kind: str,
    near: dict[str, str],
    positive: Sequence[ex.Expression],
    roots: Sequence[dict[str, str]] = (),
) -> dict[str, Any]:
    """The fields of every certificate; `near` is a point of the domain, on which the trees of `positive` are > 0."""
    question = "time_dependent" if with_time else "autonomous"
    parts = {"near": near, "conditions": conditions_of(positive), "roots": [*roots]}
    head = {"format": FORMAT, "system": system, "question": question, "claim": claim, "kind": kind}
    return head | {key: part for key, part in parts.items() if part}


def conditions_of(positive: Iterable[ex.Expression]) -> list[str]:
    """The inequalities of a certificate that state that these trees are positive."""
    texts = (
        f"{printing.to_text(tree)} > 0" if isinstance(tree, ex.Power) else inequalities.inequality_text(tree)
        for tree in positive
    )
    return [*dict.fromkeys(texts)][:_MOST_CONDITIONS]


def moved_to(near: Mapping[str, str], table: real_point.RealTable) -> dict[str, str]:
    """The values of the same names at another point, in digits."""
    named = {
        printing.to_text(key): mpmath.nstr(value, _DIGITS)
        for key, value in table.items()
        if not isinstance(key, ex.Integral)
    }
    return {name: named.get(name, value) for name, value in near.items()}


def near_of(table: real_point.RealTable | None, names: Sequence[ex.Symbol | ex.Velocity]) -> dict[str, str]:
    """The values of these names at a real point, in digits."""
    return {printing.to_text(key): mpmath.nstr(table[key], _DIGITS) for key in names if key in table} if table else {}


def _head(
    analysis: deciding.Analysis, table: real_point.RealTable | None, with_time: bool, claim: str, kind: str
) -> dict[str, Any]:
    system = analysis.system
    places: list[ex.Symbol | ex.Velocity] = [
        *map(ex.Symbol, system.coordinates),
        ex.TIME,
        *map(ex.Velocity, system.coordinates),
    ]
    near = near_of(table, [*places, *map(ex.Symbol, system.parameters), *system.letters])
    return head_of(_system(system), with_time, claim, kind, near, system.positive, root_hints.of_system(analysis))


def _system(system: SecondOrderSystem) -> dict[str, Any]:
    pairs = zip(system.coordinates, system.given, strict=True)
    return {
        "coordinates": list(system.coordinates),
        "equations": {name: printing.to_text(f) for name, f in pairs},
        "parameters": list(system.parameters),
        "functions": {name: list(arguments) for name, arguments in system.functions},
    }
