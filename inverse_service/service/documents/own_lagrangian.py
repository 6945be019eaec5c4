"""A Lagrangian of the user: on which cells it gives the equations of a document, and, alone, what
follows from it.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import mpmath

from api_schemas.base import CHECK_FORMAT, MAX_FORWARD
from api_schemas.result import ConservedQuantity, ForwardParseAnswer, ForwardResult
from api_schemas.system import LagrangianDocument
from inverse_service import deadline, errors
from inverse_service.decision import certify, deciding, solutions
from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.expressions.notation import inequality_text
from inverse_service.expressions.refusals import fault
from inverse_service.field import sign_cases, tower
from inverse_service.field.real_branch import RealTable, requirements
from inverse_service.mechanics import (
    constrained_motion,
    euler_lagrange,
    first_integrals,
    linear_equations,
    second_order_system,
    writing,
)
from inverse_service.mechanics.legendre import legendre
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, reader, time_derivatives
from inverse_service.reading.declarations import Declared
from inverse_service.reading.document_names import known_names
from inverse_service.reading.tokens import walk
from inverse_service.search import ladder
from inverse_service.service.documents import accepting, canonical, echo, growing, translate
from inverse_service.solving import solving
from inverse_service.statements.questions import narrowest

POINTER = "/lagrangian"
AS_WRITTEN = (
    "The accelerations are too long to be solved for, and L does not give the equations as they are written, "
    "up to their signs."
)
_SINGULAR = (
    "The Hessian of L in the velocities is singular: L does not determine the accelerations."
)
_LOOK = 2.0  # s, for a part of a cell where L is right, after it was found wrong on another
_DIGITS = 12  # of numbers that are shown
_UNREAD = (
    "L gives these equations at points near by, but its certificate was refused: this is undecided."
)
_ELSEWHERE = "Other parts of this set, which are not connected with this point, are undecided."


def document_given_in(found: Any) -> Any:
    """The document itself, that of a result or of its `system`, or of a text of equations."""
    if isinstance(found, str):
        return {"equations": found, "parameters": "guess"}
    system = found.get("system") if isinstance(found, Mapping) and "verdict" in found else found
    if not isinstance(system, Mapping) or (system is found and "latex" not in system):
        return found
    plain = {
        key: system[key]
        for key in ("coordinates", "equations", "parameters", "functions")
        if system.get(key)
    }
    return system.get("given") or plain


def check_lagrangian(document: Any, text: str, time_limit: float = 60.0) -> dict[str, Any]:
    """The answer of `check` about q'' = f of a document and an L: are these its equations?

    `cells` has a verdict for each, with a point and both accelerations where L fails; `residual`
    E_i = d/dt(dL/dq_i') - dL/dq_i along q'' = f for each coordinate, {text, latex}, all zero for a
    right L; `equations` the accelerations that L gives instead, where it is regular and wrong.
    Raises InputError.
    """
    end = deadline.now() + time_limit
    document = document_given_in(document)
    if isinstance(document, Mapping) and "constraints" in document:
        detail = "A Lagrangian of one's own is judged for equations without constraints: give those of the system meant."
        raise errors.InputError(detail, "/system/constraints")
    schema = accepting.to_schema(document)
    lagrangian, system = _read(schema, accepting.to_solvable(schema), text)
    own, is_singular = _equations_of(lagrangian, system)

    def answer(one: SecondOrderSystem, _: object) -> tuple[dict[str, Any], Sequence[ex.Expression]]:
        """On a cell of f and L, which is written last."""
        branch = one.branch and replace(one.branch, given=one.branch.given[:-1])
        cell = replace(one, accelerations=one.accelerations[:-1], branch=branch)
        return _judged(cell, one.accelerations[-1], lagrangian, own, end)

    if system.is_unsolved:
        found, left = [_judged(system, lagrangian, lagrangian, own, end)[0]], list[solutions.Left]()
    else:
        found, left = solving.cell_by_cell(
            replace(system, accelerations=(*system.accelerations, lagrangian)), answer
        )
    verdicts = {one["verdict"] for one in found} | ({"incomplete"} if left else set())
    wrong, right = verdicts & {"invalid", "differs"}, verdicts & {"valid", "differs"}
    verdict = verdicts.pop() if len(verdicts) == 1 else "differs" if wrong and right else (
        "invalid" if wrong else "incomplete")  # fmt: skip
    reasons = list(dict.fromkeys(reason for one in found for reason in one["reasons"]))
    reasons += [f"Undecided {_where(one)}: {one.open.words}." for one in left]
    if is_singular:
        verdict, reasons = "invalid", [_SINGULAR]
    elif (
        system.is_unsolved and verdict == "invalid"
    ):  # the checker compares E_i with the i-th equation alone
        verdict, reasons = "incomplete", [AS_WRITTEN]
    shown = [one for one in found if one["verdict"] == "valid"]
    return {
        "format": CHECK_FORMAT,
        "verdict": verdict,
        "statement": shown[0]["statement"] if shown and not is_singular else None,
        "cells": [
            {key: one[key] for key in one if key not in ("statement", "reasons")} for one in found
        ],
        "contradictions": [],
        "not_checked": [],
        "reasons": reasons,
        "residual": _formulas(system, _residual(lagrangian, system, verdict == "valid")),
        "equations": None if own is None or verdict == "valid" else _formulas(system, own),
    }


def _read(
    schema: Any, system: SecondOrderSystem, text: str
) -> tuple[ex.Expression, SecondOrderSystem]:
    """L, and the system with the constants and functions that occur in L alone, where the document
    asks to guess.
    """
    from inverse_service.mechanics.constrained_motion import read_lagrangian

    declared = Declared(system.coordinates, schema.parameters, system.names.functions, schema.where)
    known = known_names(declared, {POINTER: text}, order=1)
    found = known.put_in(read_lagrangian(text, known.names))
    used = {node.name for node in ex.walk(found) if isinstance(node, ex.Symbol | ex.Arbitrary)}
    more = [
        name for name in known.names.parameters if name in used and name not in system.parameters
    ]
    named = known.names.functions.items()
    functions = [
        function for function in named if function[0] in used and function not in system.functions
    ]
    wider = replace(
        system, parameters=(*system.parameters, *more), functions=(*system.functions, *functions)
    )
    return found, wider if more or functions else system


def _judged(
    system: SecondOrderSystem,
    lagrangian: ex.Expression,
    written: ex.Expression,
    own: Sequence[ex.Expression] | None,
    end: float,
) -> tuple[dict[str, Any], Sequence[ex.Expression]]:
    """What the checker finds about L on a cell, as about one that was searched for; the trees that
    are positive there.

    `written` is L before its roots of squares were put as they are on the cell, `own` the
    accelerations that it has.
    """
    sides: list[ex.Expression] = [*map(collecting.collect, system.positive)]
    limit = max(1.0, (end - deadline.now()) / 4)

    def cell(domain: list[str], near: Any, verdict: str, reasons: Sequence[str]) -> dict[str, Any]:
        where = " and ".join(map(inequality_text, map(collecting.collect, system.positive)))
        told = [f"Where {where}: {reason}" if where else reason for reason in reasons]
        return {"domain": domain, "near": near, "verdict": verdict, "reasons": told}

    try:
        analysis = deciding.analyze(system)
    except errors.IrreducibleAtoms as problem:
        return cell([*map(inequality_text, sides)], {}, "incomplete", (problem.detail,)), sides
    claim = certify.of_lagrangian(
        analysis, lagrangian, narrowest(system.depends_on_time or ex.holds(lagrangian, ex.TIME))
    )
    certificate, proof = certify.prove(analysis, claim, limit)
    near = certificate.get("near", {})
    if proof.verdict == "valid":
        claimed = (*certify.forces_of(system), lagrangian)
        where = certify.where_of(proof.formulas, system.names, claimed)
        # The question is where L has these equations, not where there is some L; what was proven is
        # L as it is written on this side, without a root or an inverse function.
        statement = canonical.of_certificate(
            certificate, replace(proof, cell=proof.formulas, by_theorem=False)
        )
        known = [*map(inequality_text, sides)] if lagrangian != written else []
        domain = [*dict.fromkeys([*known, *statement["domain"]])]
        found = cell(domain, near, "valid", proof.reasons) | {
            "statement": statement | {"domain": domain}
        }
        if where.connected:
            other = solving.other_part(analysis, claim, where.sides, end)
            if other is None or other.proof.verdict != "invalid":
                found |= {"verdict": "incomplete", "reasons": [_ELSEWHERE]}
            else:
                found |= {"verdict": "differs", "reasons": [other.proof.reasons[0]]} | _failing(
                    system, own, other.point
                )
        return found, where.sides
    table = certify.point_of(analysis, lagrangian)
    if table is not None:
        with suppress(errors.IrreducibleAtoms, calculus.NoRealValue):
            formulas = [*map(tower.to_kernels, (*system.given, written))]
            sides = list(
                dict.fromkeys(
                    [*sides, *sign_cases.signed_factors(requirements(formulas, table), table)]
                )
            )
    domain = certify.shortest(sides)
    if (
        proof.verdict == "invalid"
        and not system.is_unsolved
        and _is_right_near(analysis, lagrangian)
    ):
        return cell(domain, near, "incomplete", (_UNREAD,)), sides
    found = cell(domain, near, proof.verdict, proof.reasons)
    if proof.verdict == "invalid" and table is not None:
        found |= _failing(system, own, table)
        soon = min(end, deadline.now() + _LOOK)
        if not system.is_unsolved and solving.other_part(analysis, claim, sides, soon, ("valid",)):
            found |= {"verdict": "differs"}
    return found, sides


def _is_right_near(analysis: deciding.Analysis, lagrangian: ex.Expression) -> bool:
    """Whether L is right at points, so that a certificate that is refused says nothing about it."""
    with suppress(errors.IrreducibleAtoms, ZeroDivisionError):
        return ladder.holds_numerically(analysis, lagrangian, 1)
    return False


def _failing(
    system: SecondOrderSystem, own: Sequence[ex.Expression] | None, table: RealTable
) -> dict[str, Any]:
    """A point, and both accelerations there."""
    own_names = {
        *deciding.variables_of(system)
    }  # and not the angle of one radian, which a table may hold
    named = {translate.name_of(key): value for key, value in table.items() if key in own_names}
    shown = {"at": {name: mpmath.nstr(value, _DIGITS) for name, value in named.items()}}
    try:
        pairs = {"given": system.given, "lagrangian": own or ()}
        numbers: dict[str, dict[str, str]] = {}
        for key, trees in pairs.items():
            values = [
                mpmath.nstr(calculus.evaluate(tower.to_kernels(f), table), _DIGITS) for f in trees
            ]
            numbers[key] = dict(zip(system.coordinates, values, strict=False))
    except (calculus.NoRealValue, KeyError):
        return shown
    return shown | {"accelerations": numbers} if own else shown


def _where(left: solutions.Left) -> str:
    if left.domain.positive:
        return f"where {' and '.join(map(inequality_text, left.domain.positive))}"
    names = [(translate.name_of(key), value) for key, value in (left.near or {}).items()]
    return f"at {', '.join(f'{name} = {mpmath.nstr(value, 5)}' for name, value in names if name)}"


def _residual(
    lagrangian: ex.Expression, system: SecondOrderSystem, is_valid: bool
) -> tuple[ex.Expression, ...]:
    """E_i along the motion; of equations that are not solved for the accelerations, what E_i adds
    to the i-th.
    """
    if is_valid:
        return (ex.ZERO,) * len(system.coordinates)
    if not system.is_unsolved:
        return euler_lagrange.euler_lagrange_residual(
            lagrangian, system.coordinates, system.accelerations
        )
    sums = euler_lagrange.euler_lagrange_sums(
        lagrangian, system.coordinates, [ex.Acceleration(name) for name in system.coordinates]
    )
    return tuple(collecting.collect(e - given) for e, given in zip(sums, system.given, strict=True))


def _equations_of(
    lagrangian: ex.Expression, system: SecondOrderSystem
) -> tuple[tuple[ex.Expression, ...] | None, bool]:
    """The accelerations that L gives, None where they are not solved for; whether L is not
    regular.
    """
    if system.is_unsolved:
        return None, False
    try:
        return _solved(lagrangian, system.coordinates), False
    except errors.LimitError:
        return None, False
    except errors.InputError:
        return None, True


def _solved(lagrangian: ex.Expression, names: Sequence[str]) -> tuple[ex.Expression, ...]:
    """The accelerations by the Euler-Lagrange equations; InputError where L is not regular."""
    sums = euler_lagrange.euler_lagrange_sums(
        lagrangian, names, [ex.Acceleration(name) for name in names]
    )
    _refuse_linear(lagrangian, names)
    equations = [linear_equations.linear_equation(tree, POINTER) for tree in sums]
    return linear_equations.solve_accelerations(equations, names)


def _refuse_linear(lagrangian: ex.Expression, names: Sequence[str]) -> None:
    """InputError where L is of first degree in a velocity: then no equation determines this
    acceleration.
    """
    rows = zip(names, euler_lagrange.hessian(lagrangian, names), strict=True)
    linear = [
        name for name, row in rows if all(collecting.collect(entry) == ex.ZERO for entry in row)
    ]
    if linear:
        velocities, accelerations = (
            ", ".join(name + primes for name in linear) for primes in ("'", "''")
        )
        raise fault(
            "linear in the velocities", POINTER, velocities=velocities, accelerations=accelerations
        )


def _refuse_linear_text(schema: LagrangianDocument) -> None:
    """The same for an L with names that cannot be guessed, such as the x of x y': each reading of x
    is singular.
    """
    tokens = reader.tokens_if_any(schema.lagrangian, nm.Names(guesses=True))
    moving = tuple(dict.fromkeys(time_derivatives.moving_names(tokens, 1)))
    words = (token.text for token in walk(tokens) if token.kind == "name")
    others = tuple(dict.fromkeys(word for word in words if word not in (*moving, *nm.RESERVED)))
    if moving and not (schema.where or schema.functions):
        try:
            tree = reader.read_formula(schema.lagrangian, nm.Names(moving, others))
        except errors.InputError:
            return
        _refuse_linear(tree, moving)


def _formulas(
    system: SecondOrderSystem, trees: tuple[ex.Expression, ...]
) -> dict[str, dict[str, str]]:
    return {
        name: translate.formula_fields(tree)
        for name, tree in zip(system.coordinates, trees, strict=True)
    }


def solve_forward(
    document: Any, options: solutions.SolveOptions, grow: growing.Growing
) -> dict[str, Any]:
    """The forward result; raises InputError, also where the Hessian of L is singular."""
    schema = accepting.validated(document, LagrangianDocument)
    lagrangian, system = _motion(schema)
    names = system.coordinates
    constants = [*map(ex.Symbol, system.parameters)]
    transform = legendre(lagrangian, names, options.time_limit / 2)
    functions = dict(zip(names, transform.momenta, strict=True))
    result = ForwardResult(
        system=translate.to_understood(system, schema),
        lagrangian=translate.formula_document(lagrangian),
        equations=translate.formulas(names, system.accelerations),
        momenta=translate.formulas(names, functions.values()),
        hamiltonian=translate.hamiltonian_part(
            solutions.Hamiltonian(transform), parameters=system.parameters
        ),
        conserved=_conserved(lagrangian, functions, constants),
        guessed=translate.guessed_names(schema, system),
    )
    return result.model_dump(mode="json")


def parse(schema: LagrangianDocument) -> ForwardParseAnswer:
    """The interpretation of the document; raises InputError."""
    lagrangian, system = _motion(schema)
    answer = translate.to_parse_answer(system, schema)
    shown = echo.lagrangian_with_extremes(schema, lagrangian)
    return ForwardParseAnswer(**dict(answer), lagrangian=translate.parsed(shown))


def system_of(schema: LagrangianDocument) -> SecondOrderSystem:
    """q'' = f of the Euler-Lagrange equations; raises InputError."""
    return _motion(schema)[1]


def _motion(schema: LagrangianDocument) -> tuple[ex.Expression, SecondOrderSystem]:
    """L with the system q'' = f of its Euler-Lagrange equations."""
    declared = Declared(
        schema.coordinates, schema.parameters, schema.functions, schema.where, most=MAX_FORWARD
    )
    try:
        known = known_names(declared, {"/lagrangian": schema.lagrangian}, order=1)
    except errors.InputError as error:
        if error.declare:
            _refuse_linear_text(schema)
        raise
    lagrangian = known.put_in(constrained_motion.read_lagrangian(schema.lagrangian, known.names))
    names = known.remaining()
    lagrangian = in_few_terms(lagrangian, names, (schema.lagrangian, *schema.where.values()))
    solved = _solved(lagrangian, names.coordinates)
    accelerations = tuple(_written(tree, [*map(ex.Symbol, names.parameters)]) for tree in solved)
    functions = tuple(names.functions.items())
    return lagrangian, SecondOrderSystem(
        names.coordinates, accelerations, names.parameters, functions, schema.name
    )


def in_few_terms(lagrangian: ex.Expression, names: nm.Names, texts: Sequence[str]) -> ex.Expression:
    """L in few terms where velocities were put in, m l^2 theta'^2/2 for those of x = l cos(theta),
    y = l sin(theta).

    `texts` are those of L and of its definitions; L is as it is where only coordinates move in
    them.
    """
    from inverse_service.search import tidy  # a simulation needs no solver

    tokens = [reader.tokens_if_any(text, names) for text in texts]
    if {
        names.spelling(name) for line in tokens for name in time_derivatives.moving_names(line, 1)
    } <= {*names.coordinates}:
        return lagrangian
    system = second_order_system.unsolved_system(names, [lagrangian])
    short = tidy.shorten_lagrangian(
        collecting.collect(lagrangian), system
    )  # up to a constant factor and a function of t
    moving = [place(name) for name in system.coordinates for place in (ex.Symbol, ex.Velocity)]
    slopes = [
        euler_lagrange.gradient(tree, map(ex.Velocity, system.coordinates))
        for tree in (lagrangian, short)
    ]
    velocity = next((velocity for velocity in slopes[0] if velocity in slopes[1]), None)
    if velocity is None:
        return lagrangian
    factor = writing.exact_quotient(slopes[0][velocity] / slopes[1][velocity])
    terms = [factor * term for term in ex.summands(short)]
    rest = writing.exact_quotient(lagrangian - ex.add(*terms))
    if ex.holds(factor, ex.TIME, *moving) or ex.holds(rest, *moving):
        return lagrangian
    return writing.with_products_in_order(
        ex.add(*terms, rest), [*map(ex.Symbol, system.parameters)]
    )


def _written(tree: ex.Expression, constants: Sequence[ex.Symbol]) -> ex.Expression:
    """An acceleration as one quotient or multiplied out, whichever is shorter; with the relations
    among its roots.
    """
    forms = [collecting.collect(tree), writing.one_square(tree)]
    if any(
        isinstance(node, ex.Power) and node.exponent in (ex.HALF, ex.negate(ex.HALF))
        for node in ex.walk(tree)
    ):
        forms.append(writing.exact_quotient(tree))
    shorter = min(forms, key=ex.node_count)
    return writing.with_products_in_order(shorter, constants)


def _conserved(
    lagrangian: ex.Expression, functions: dict[str, ex.Expression], constants: Sequence[ex.Symbol]
) -> list[ConservedQuantity]:
    """The momenta of the coordinates that are not in L, and the energy where t is not (Noether)."""
    from inverse_service.search import tidy  # as above

    letters = {node for node in ex.walk(lagrangian) if isinstance(node, ex.Symbol)}
    found = {
        f"momentum of {name}": tree
        for name, tree in functions.items()
        if ex.Symbol(name) not in letters
    }
    if ex.TIME not in letters:
        velocities = [*map(ex.Velocity, functions)]
        energy = first_integrals.energy_of(lagrangian, velocities, writing.exact_quotient)
        found["energy"] = tidy.kinetic_first(writing.with_products_in_order(energy, constants))
    return [
        ConservedQuantity(name=name, **translate.formula_fields(tree))
        for name, tree in found.items()
    ]
