"""From the engine's data to result documents."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

import mpmath

from api_schemas import base, result as schemas
from api_schemas.system import (
    LagrangianDocument,
    MotionDocument,
    NonholonomicDocument,
    SystemDocument,
)
from inverse_service import __version__
from inverse_service.certificate import checker
from inverse_service.decision import certify, solutions
from inverse_service.expressions import printing, tree as ex
from inverse_service.field import real_branch, tower
from inverse_service.mechanics import euler_lagrange, legendre, second_order_system
from inverse_service.reading import declarations, names as nm
from inverse_service.service.documents import echo, stated
from inverse_service.service.documents.older_keys import Told
from inverse_service.service.documents.stated import Stated
from inverse_service.statements.domains import EVERYWHERE
from inverse_service.statements.questions import TIMED, About
from inverse_service.statements.reasons import Open

if TYPE_CHECKING:
    from inverse_service.mechanics.constrained_motion import NonholonomicSystem
    from inverse_service.mechanics.first_integrals import FirstIntegral
    from inverse_service.service.documents.accepting import Asking

# H = p^T M^-1 p/2 + V is shown for so many coordinates, where H has so many characters and M and V
# so many times fewer.
LEAST_COORDINATES, LONG_HAMILTONIAN, MUCH_SHORTER = 3, 200, 2
AnyDocument = SystemDocument | NonholonomicDocument | MotionDocument | LagrangianDocument
Understood = Callable[[second_order_system.SecondOrderSystem], dict[str, Any]]

Part = TypeVar("Part", bound=base.Document)


def to_parse_answer(
    system: second_order_system.SecondOrderSystem, schema: AnyDocument
) -> base.ParseAnswer:
    """What was understood, for a reader to compare with what was meant."""
    shown = system.given if system.is_unsolved else system.accelerations
    equations = {name: parsed(f) for name, f in zip(system.coordinates, shown, strict=True)}
    names = {
        "functions": function_fields(system),
        "guessed": guessed_names(schema, system),
        "readings": [],
    }
    return part_of(base.ParseAnswer, system, equations=equations, **names)


def guessed_names(
    schema: AnyDocument, system: second_order_system.SecondOrderSystem | NonholonomicSystem
) -> list[str]:
    """The names that the document did not declare, where it asks to guess: constants, then
    functions.
    """
    declared = declarations.Declared(schema.coordinates, schema.parameters, schema.functions)
    if not declared.guesses:
        return []
    known = {
        nm.declared_name(name, "") for name in (*declared.named_parameters(), *schema.functions)
    }
    names = (*system.parameters, *dict(system.functions))
    return [name for name in names if name not in known]


def to_understood(
    system: second_order_system.SecondOrderSystem, schema: AnyDocument
) -> schemas.UnderstoodSystem:
    """The `system` part of a result: canonical equations along with the document as given."""
    given = schema.model_dump(mode="json", exclude_unset=True)
    fields = equation_fields(system) | {
        "functions": function_fields(system),
        "given": given,
        "time": "t",
    }
    fields["written"], fields["definitions"] = echo.written_lines(schema, fields["equations"])
    return part_of(schemas.UnderstoodSystem, system, **fields)


def understanding(schema: AnyDocument) -> Understood:
    """`to_understood` of the document in JSON, made once for a system."""
    return cache(lambda system: to_understood(system, schema).model_dump(mode="json"))


def equation_fields(system: second_order_system.SecondOrderSystem) -> dict[str, Any]:
    """The equations as given, in text and in LaTeX."""
    pairs = list(zip(system.coordinates, system.given, strict=True))
    latex = {name: f"{printing.to_latex(f)} = 0" for name, f in pairs}
    if not system.is_unsolved:
        latex = {
            name: f"{printing.name_latex(name, 'ddot')} = {printing.to_latex(f)}"
            for name, f in pairs
        }
    return {"equations": {name: printing.to_text(f) for name, f in pairs}, "latex": latex}


def plain_fields(system: second_order_system.SecondOrderSystem) -> dict[str, Any]:
    """What says the same in a document, a result, and a certificate."""
    return {
        "coordinates": list(system.coordinates),
        "equations": equation_fields(system)["equations"],
        "parameters": list(system.parameters),
        "functions": function_fields(system),
    }


def function_fields(
    system: second_order_system.SecondOrderSystem | NonholonomicSystem,
) -> dict[str, list[str]]:
    """The arbitrary functions with what they depend on."""
    return {name: list(arguments) for name, arguments in system.functions}


def to_told(
    solution: solutions.Solution,
    schema: Asking,
    others: Sequence[solutions.Solution] = (),
    left: Sequence[solutions.Left] = (),
    about: About = About.MAIN,
    understood: Understood | None = None,
) -> Told:
    """What a result says of a system, which the equations of its main fields are `about`.

    `others` are the solutions on further cells of the same system, `left` the cells without one;
    `understood` is `understanding` of the document where more than one result is told.
    """
    found = {key: value for key, value in as_plain_data(solution.provenance).items() if value != ""}
    cells = [solution, *others]
    beside: dict[str, Any] = {
        "system": (understood or understanding(schema))(solution.system),
        "conditions": _conditions(solution.conditions),
        "branches": [{"equations": _equations_there(each.system)} for each in cells]
        if others
        else [],
        "not_answered": [_not_answered(one) for one in left],
        "advice": _advice(solution),
        "guessed": guessed_names(schema, solution.system),
        "provenance": {"program": "inverse-service", "version": __version__, **found},
    }
    statements = tuple(
        one
        for cell, each in enumerate(cells)
        for one in _statements(each, about, cell, bool(others), bool(left))
    )
    return Told(statements, as_plain_data(beside), about)


def _equations_there(system: second_order_system.SecondOrderSystem) -> dict[str, str]:
    """The accelerations on a cell as texts by coordinate, with |u| and roots as they are there."""
    pairs = zip(system.coordinates, system.accelerations, strict=True)
    return {} if system.is_unsolved else {name: printing.to_text(f) for name, f in pairs}


def _not_answered(left: solutions.Left) -> schemas.NotAnsweredPart:
    named = {
        name_of(key): mpmath.nstr(value, 12)
        for key, value in (left.near or {}).items()
        if key != tower.RADIAN
    }
    near = {name: value for name, value in named.items() if name}
    return schemas.NotAnsweredPart(
        domain=certify.shortest(left.domain.positive), near=near, **reason_fields(left.open)
    )


def _advice(solution: solutions.Solution) -> schemas.AdvicePart:
    """What to simulate the system with, by the Lagrangian that ends at the fewest places."""
    known = [
        one.lagrangian
        for one in (solution.main, solution.other)
        if one is not None and one.lagrangian
    ]
    if not known:
        return schemas.AdvicePart(
            **euler_lagrange.advice("adaptive", None, euler_lagrange.NOTHING_KEPT)
        )
    best = min(known, key=lambda one: len(one.domain.trees))
    walls = best.domain.trees
    return schemas.AdvicePart(
        **euler_lagrange.advice_for_lagrangian(best.expression, solution.system.coordinates, walls)
    )


def _statements(
    solution: solutions.Solution, about: About, cell: int, has_others: bool, has_left: bool
) -> Iterator[Stated]:
    """The statements about one cell of the system: there may be others, and cells without an
    answer.
    """
    main, other, timed = solution.main, solution.other, solution.answer_to(TIMED)
    at = f"/branches/{cell}" if has_others else ""
    question = dataclasses.replace(solution.asked[0], about=about)
    # Where there is no L(t, q, q') there is no L(q, q'): that proof covers both verdicts.
    covers = timed is not None and timed.answers(solution.asked[0]) and timed.certificate
    proven = timed if covers and timed is not None and timed.verdict != "variational" else main
    cell_of = main.domain.positive if has_others or has_left else ()
    shown = answer_fields(main) | {
        "certificate": None if proven.certificate is None else as_plain_data(proven.certificate),
        "exceptions": list(proven.exceptions),
        "first_integrals": [
            as_plain_data(integral_part(one, cell_of)) for one in solution.first_integrals
        ],
        "first_integrals_complete": as_plain_data(_all_integrals(solution.all_integrals)),
    }
    yield Stated(question, shown, at, cell, main.formula)
    with_time = dataclasses.replace(question, timed=True)
    if other is not None:
        second = answer_fields(other)
        second["details"] = [step for step in second["details"] if step not in shown["details"]]
        yield Stated(with_time, second, f"{at}/with_time", cell, other.formula)
    elif timed is not None and not question.timed:
        second = stated.following(shown, timed.verdict)
        yield Stated(with_time, second, at, cell, main.formula)


def _all_integrals(found: solutions.AllIntegrals | None) -> schemas.AllIntegralsPart | None:
    if found is None:
        return None
    certificate = as_plain_data(found.certificate)
    return schemas.AllIntegralsPart(
        degree=found.degree,
        number=found.number,
        timed=found.timed,
        others=[integral_part(one) for one in found.others],
        exceptions=list(checker.in_general(certificate["system"])),
        certificate=certificate,
        checked="valid",
    )


def integral_part(
    found: FirstIntegral, cell: Sequence[ex.Expression] = ()
) -> schemas.FirstIntegralPart:
    """A first integral with the conditions under which its formula has a value, on a cell where
    these are positive.
    """
    positive, nonzero = (
        rule([found.expression]) for rule in (real_branch.own_requirements, real_branch.poles)
    )
    domain = certify.shortest([*cell, *positive], nonzero)
    return schemas.FirstIntegralPart(
        name=found.name,
        symmetry=found.symmetry,
        domain=domain,
        auxiliary=certify.integrals_of(found.expression).get("integrals", {}),
        **formula_fields(found.expression),
    )


def answer_fields(answer: solutions.Statement) -> dict[str, Any]:
    """One answer as the fields of a result, in JSON."""
    lagrangian, space = answer.lagrangian, answer.space
    parameters = (
        () if answer.certificate is None else answer.certificate["system"].get("parameters") or ()
    )
    energy = (
        None
        if answer.hamiltonian is None
        else hamiltonian_part(answer.hamiltonian, lagrangian, parameters)
    )
    fields = {
        "verdict": answer.verdict,
        "lagrangian": None if lagrangian is None else lagrangian_part(lagrangian),
        "other_lagrangians": [lagrangian_part(other) for other in answer.other_lagrangians],
        "multiplier": None if lagrangian is None else texts_of(lagrangian.multiplier),
        "integrals": {}
        if lagrangian is None
        else certify.integrals_of(lagrangian.expression).get("integrals", {}),
        "hamiltonian": energy,
        "solution_space": None if space is None else part_of(schemas.SolutionSpacePart, space),
        "certificate": None if answer.certificate is None else as_plain_data(answer.certificate),
        "explanation": [step_part(step) for step in answer.explanation],
        "details": [short_part(step) for step in answer.details],
        "construction": None if answer.construction is None else step_part(answer.construction),
        "checked": answer.checked,
        "exceptions": list(answer.exceptions),
        **reason_fields(answer.open),
        "domain": certify.shortest(answer.domain.positive, answer.domain.nonzero),
        "near": {} if answer.certificate is None else dict(answer.certificate.get("near", {})),
    }
    return {key: as_plain_data(value) for key, value in fields.items()}


def reason_fields(why: Open | None) -> dict[str, Any]:
    """Why something is open, in words and as a code; both empty if it is not."""
    return {
        "reason": "" if why is None else why.words,
        "reason_code": "" if why is None else why.reason.value,
    }


def short_part(step: solutions.Step) -> schemas.ExplanationStep:
    """The sentence in one form only: as parts where it has formulas."""
    part = step_part(step)
    return part.model_copy(update={"text": ""}) if part.parts else part


def step_part(step: solutions.Step) -> schemas.ExplanationStep:
    """The sentence, and its words and formulas alternately; what is shown below it comes last."""
    parts = [""]
    for part in (part for part in step.parts if part.kind in ("text", "formula", "display")):
        words = len(parts) % 2 == 1  # the last one is
        if part.kind == "text" and words:
            parts[-1] += part.text
        else:
            parts += [part.text] if words or part.kind == "text" else ["", part.text]
    has_formulas = len(parts) > 1
    return schemas.ExplanationStep(text=step.text, parts=parts if has_formulas else [])


def lagrangian_part(lagrangian: solutions.Lagrangian) -> schemas.LagrangianPart:
    domain = certify.shortest(lagrangian.domain.positive, lagrangian.domain.nonzero)
    regular = (
        "everywhere"
        if _is_regular_everywhere(lagrangian)
        else "at generic points, where the Hessian of L in the velocities is not singular"
    )
    written = formula_fields(lagrangian.expression)
    auxiliary = certify.integrals_of(lagrangian.expression).get("integrals", {})
    return part_of(
        schemas.LagrangianPart,
        lagrangian,
        **written,
        domain=domain,
        regular=regular,
        auxiliary=auxiliary,
    )


def _is_regular_everywhere(lagrangian: solutions.Lagrangian) -> bool:
    """Whether the form of g shows det g != 0 wherever L is defined: constant, or diagonal without a
    zero.
    """
    entries = [
        (i == j, entry)
        for i, row in enumerate(lagrangian.multiplier)
        for j, entry in enumerate(row)
    ]
    if all(
        isinstance(node, ex.Number | ex.Sum | ex.Product)
        for _, entry in entries
        for node in ex.walk(entry)
    ):
        return True
    known = (lagrangian.domain.nonzero, lagrangian.domain.positive)
    return all(
        real_branch.is_nonzero(entry, *known) if on else entry == ex.ZERO for on, entry in entries
    )


def hamiltonian_part(
    hamiltonian: solutions.Hamiltonian,
    lagrangian: solutions.Lagrangian | None = None,
    parameters: Sequence[str] = (),
) -> schemas.HamiltonianPart:
    """With the conditions under which the Lagrangian is one: H holds only where L does. Those on
    velocities are conditions of an H that is written in velocities.

    Divisors of H and of the momenta that hold `parameters` alone are conditions, too.
    """
    domain = EVERYWHERE if lagrangian is None else lagrangian.domain
    transform = hamiltonian.transform
    nonzero, positive = (
        [tree for tree in trees if transform.implicit or not ex.has(tree, ex.Velocity)]
        for trees in (domain.nonzero, domain.positive)
    )
    divisors = real_branch.poles([transform.hamiltonian, *transform.momenta])
    nonzero += [tree for tree in divisors if _is_constant(tree, parameters)]
    pairs = zip(transform.symbols, transform.momenta, strict=True)
    return schemas.HamiltonianPart(
        **formula_fields(transform.hamiltonian),
        **({} if hamiltonian.constraints else _by_mass_matrix(transform)),
        momenta={symbol.name: printing.to_text(p) for symbol, p in pairs},
        implicit=transform.implicit,
        reason=transform.note if transform.implicit else "",
        constraints=[printing.to_text(constraint) for constraint in hamiltonian.constraints],
        image=[formula_document(constraint) for constraint in hamiltonian.constraints],
        domain=certify.shortest([*positive, *transform.positive], nonzero),
    )


def _by_mass_matrix(transform: legendre.LegendreTransform) -> dict[str, Any]:
    """The fields `mass_matrix` and `potential` of an H of three coordinates or more that they say
    much shorter.
    """
    length = len(printing.to_text(transform.hamiltonian))
    if len(transform.symbols) < LEAST_COORDINATES or length < LONG_HAMILTONIAN:
        return {}
    found = legendre.by_mass_matrix(transform)
    if found is None:
        return {}
    rows, potential = (
        [[printing.to_text(entry) for entry in row] for row in found[0]],
        formula_document(found[1]),
    )
    if (
        MUCH_SHORTER * (sum(len(entry) for row in rows for entry in row) + len(potential.text))
        > length
    ):
        return {}
    return {"mass_matrix": rows, "potential": potential}


def _is_constant(tree: ex.Expression, parameters: Sequence[str]) -> bool:
    """Whether the tree holds parameters and no other names."""
    names = [node for node in ex.walk(tree) if isinstance(node, ex.Symbol) and node != ex.PI]
    moving = ex.Velocity | ex.Arbitrary | ex.Integral
    return all(node.name in parameters for node in names) and not ex.has(tree, moving)


def name_of(key: ex.Expression) -> str:
    """x, x' or a for a coordinate, a velocity or a parameter at a point; nothing for what else a
    point holds.
    """
    return (
        printing.to_text(key) if isinstance(key, ex.Symbol | ex.Velocity) and key != ex.PI else ""
    )


def _conditions(conditions: solutions.Conditions | None) -> schemas.ConditionsPart | None:
    if conditions is None:
        return None
    tensors = {"Phi": conditions.Phi, "nabla_Phi": conditions.nabla_Phi, "R": conditions.R}
    return schemas.ConditionsPart(**texts_of(tensors))


def formula_fields(tree: ex.Expression) -> dict[str, Any]:
    return {"text": printing.to_text(tree), "latex": printing.to_latex(tree)}


def formula_document(tree: ex.Expression) -> schemas.Formula:
    return schemas.Formula(**formula_fields(tree))


def formulas(names: Iterable[str], trees: Iterable[ex.Expression]) -> dict[str, schemas.Formula]:
    return {name: formula_document(tree) for name, tree in zip(names, trees, strict=True)}


def parsed(tree: ex.Expression) -> base.ParsedFormula:
    return base.ParsedFormula(**formula_fields(tree), mathml=printing.to_mathml(tree))


def texts_of(part: Any) -> Any:
    """Formulas as texts, in lists and under the keys that they are in; what is None stays so."""
    if isinstance(part, Mapping):
        return {key: texts_of(one) for key, one in part.items()}
    if isinstance(part, tuple | list):
        return list(map(texts_of, part))
    return None if part is None else printing.to_text(part)


def part_of(schema: type[Part], found: object, **other: Any) -> Part:
    """The part of a document whose fields, beyond the `other` ones, are the attributes of the same
    names.
    """
    named = {
        name: as_plain_data(getattr(found, name))
        for name in schema.model_fields
        if name not in other
    }
    return schema(**named, **other)


def as_plain_data(value: Any) -> Any:
    """Mappings and sequences as dict and list, formulas in text and LaTeX, decimals as texts, as
    JSON can hold them.
    """
    if value is None or isinstance(value, str | int | float):  # most parts, and quickly known
        return value
    if isinstance(value, Mapping):
        return {str(key): as_plain_data(part) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [as_plain_data(part) for part in value]
    if isinstance(value, Decimal):
        return str(value)
    found = formula_document(value) if isinstance(value, ex.Expression) else value
    return found.model_dump(mode="json") if isinstance(found, base.Document) else found
