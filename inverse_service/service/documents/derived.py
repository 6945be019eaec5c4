"""What a document asks beside its main question: kinds of Lagrangians, and systems that follow from
its own.

These are the system with another clock, the system with special values of its parameters (the keys
`instead` and `left_out`), and what else holds where there is no L(q, q'). The solver's part of each
comes first, then that of `check`, which makes the derived system again from the document.
Clocks, families, kinds, and friction are loaded when they are asked for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from api_schemas import base, result as schemas
from api_schemas.system import InvariantKind, SystemDocument
from inverse_service import deadline
from inverse_service.certificate import checker
from inverse_service.decision import certify, deciding
from inverse_service.decision.helmholtz import LagrangianKind, invariant, kind_named
from inverse_service.decision.solutions import Solution, SolveOptions, Statement
from inverse_service.errors import InputError
from inverse_service.explanation import explaining
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.field import real_branch
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import accepting, stated, translate
from inverse_service.service.documents.older_keys import (
    SHOWN_INSTEAD,
    Told,
    has_valid_lagrangian,
)
from inverse_service.service.documents.stated import Stated
from inverse_service.solving import solving
from inverse_service.statements import reasons
from inverse_service.statements.domains import Domain
from inverse_service.statements.questions import PLAIN, WITH_FRICTION, About, Question

SEARCH = "search"
_MOST_LEFT_OUT = 8  # special values with an answer of their own
OF_REDUCED = (*SHOWN_INSTEAD, "equations", "clock")  # what `instead` repeats of the reduced system
_RATIONAL = (ex.Number, ex.Power, ex.Product, ex.Sum, ex.Symbol)


def answered(
    part: type[base.Document], system: SecondOrderSystem, answer: Statement
) -> dict[str, Any]:
    """The equations and the answer as the fields that a place in a result has of them."""
    fields = translate.answer_fields(answer) | translate.equation_fields(system)
    return {key: fields[key] for key in part.model_fields if key in fields}


class _Solved(NamedTuple):
    """The first branch of a derived system, and the answer about it."""

    system: SecondOrderSystem
    answer: Statement


def _solved(system: SecondOrderSystem, question: Question, seed: int, end: float) -> _Solved:
    """The answer to one question about a derived system, which is that of its first branch."""
    options = SolveOptions(
        time_dependent=question.timed, seed=seed, time_limit=deadline.left(end), conditions=False
    )
    found = solving.solve(system, options)
    return _Solved(found.system, found.main)


# Another clock: dtau = N(q) dt.


def to_clock(schema: SystemDocument, system: SecondOrderSystem) -> ex.Expression | None:
    """N(q), None where it is looked for; InputError where it is not a function of coordinates, or f
    holds t.
    """
    if system.depends_on_time:
        raise InputError("the equations contain t, so the time cannot be changed.", "/clock")
    return None if schema.clock == SEARCH else read_clock(system, schema.clock or "", schema)


def read_clock(
    system: SecondOrderSystem, text: str, schema: SystemDocument | None = None
) -> ex.Expression:
    """N(q) of a text, parameters with values in the document put in; InputError as above."""
    from inverse_service.solving import clock

    factor = accepting.formula_about(text, system.names, schema, "/clock")
    if any(
        node == ex.TIME or isinstance(node, ex.Velocity | ex.Acceleration)
        for node in ex.walk(factor)
    ):
        raise InputError(
            "a clock N in dtau = N dt may contain coordinates and parameters only.", "/clock"
        )
    if clock.with_clock(system, factor) is None:
        raise InputError(
            "a clock N needs real values other than 0 where the equations have values.", "/clock"
        )
    return factor


def with_clock(
    told: Told,
    system: SecondOrderSystem,
    factor: ex.Expression | None,
    asked: SolveOptions,
    time_limit: float,
) -> Told:
    """The answer for L(q, q') of the system with the other clock, on its first branch; found where
    there is none.
    """
    from inverse_service.solving import clock

    end = deadline.now() + time_limit
    if factor is None:
        factor, tried = clock.find_clock(system, asked.seed, deadline.now() + time_limit / 2)
        if factor is None:
            listed = ", ".join(map(printing.to_text, tried))
            fields: dict[str, Any] = {"factor": "", "equations": {}, "verdict": "undetermined"}
            fields |= translate.reason_fields(reasons.no_clock(listed))
            return told.also(Stated(Question(clock=SEARCH), fields, "/with_clock"))
    changed = clock.with_clock(system, factor)
    assert changed is not None
    solved, answer = _solved(changed, PLAIN, asked.seed, end)
    return told.also(with_this_clock(About.MAIN, factor, solved, answer))


def with_this_clock(
    about: About, factor: ex.Expression, system: SecondOrderSystem, answer: Statement
) -> Stated:
    """An answer for a system with this clock."""
    text = printing.to_text(factor)
    at = "/with_clock" if about is About.MAIN else f"/{about}/with_clock"
    fields = {"factor": text, **answered(schemas.ClockPart, system, answer)}
    return Stated(Question(about, clock=text), fields, at, formula=answer.formula)


# Special values of the parameters.


def documents_of_exceptions(
    result: Mapping[str, Any],
) -> Iterator[tuple[str, dict[str, Any] | None]]:
    """Each exception with the document of the system there; None where it cannot be solved for a
    parameter.
    """
    other = result.get("with_time") or {}
    for text in dict.fromkeys(
        [*(result.get("exceptions") or ()), *(other.get("exceptions") or ())]
    ):
        yield text, _there(result["system"], text) if "=" in text else None


def _there(system: Mapping[str, Any], text: str) -> dict[str, Any] | None:
    keys = ("coordinates", "equations", "parameters", "functions")
    whole = second_order_system.read_system(**{key: system[key] for key in keys if system.get(key)})
    values = _values_there(whole, text)
    return (
        None
        if values is None
        else translate.plain_fields(second_order_system.with_values(whole, values))
    )


def _root(tree: ex.Expression, name: str) -> dict[ex.Expression, ex.Expression] | None:
    """The parameter's value where the tree is 0, if it is a number times the parameter and what
    does not hold it.
    """
    slope = collecting.collect(calculus.differentiate(tree, ex.Symbol(name)))
    if not isinstance(slope, ex.Number) or slope == ex.ZERO:
        return None
    return {
        ex.Symbol(name): collecting.collect(
            -ex.substitute(tree, {ex.Symbol(name): ex.ZERO}) / slope
        )
    }


# The key `left_out`: the special members that the main answer does not cover.


def with_left_out(
    told: Told, solution: Solution, asked: SolveOptions, end: float, has_family: bool = False
) -> Told:
    """With the sets that the exceptions name; for one coordinate with a Lagrangian, each has its
    answer.

    Conditions on functions are those of the algebraic proof that there is no Lagrangian; with a
    family its leaves say more.
    """
    main = told.about_equations()
    listed = dict.fromkeys(text for one in main for text in one.part["exceptions"])
    decides = any(one.part.get("lagrangian") for one in main)
    system, parts = solution.system, list[dict[str, Any]]()
    for text in listed:
        if "=" not in text:
            continue
        values = _values_there(system, text)
        sides = [reader.read_formula(side, system.names) for side in text.split(" = ")]
        where = schemas.Formula(text=text, latex=" = ".join(map(printing.to_latex, sides)))
        at = f"/left_out/{len(parts)}"
        parts.append({"where": translate.as_plain_data(where), "decided": False})
        if (
            values
            and decides
            and len(system.coordinates) == 1
            and len(parts) <= _MOST_LEFT_OUT
            and deadline.now() < end
        ):
            there, answer = _solved(
                second_order_system.with_values(system, values), solution.asked[0], asked.seed, end
            )
            if answer.checked == "valid":
                fields = {"decided": True, **answered(schemas.LeftOutPart, there, answer)}
                timed = stated.is_timed(fields, told.first.question.timed)
                question = Question(told.main, timed, case=(text,))
                told = told.also(Stated(question, fields, at, formula=answer.formula))
    special = checker.read_exceptions(listed).functions and not has_family
    if special and told.first.verdict == "not_variational":
        from inverse_service.solving import members

        for trees in members.first_equations(system, asked, end):
            texts = [
                [f"{write(tree)} = 0" for tree in trees]
                for write in (printing.to_text, printing.to_latex)
            ]
            where = schemas.Formula(text=" and ".join(texts[0]), latex=", \\; ".join(texts[1]))
            parts.append({"where": translate.as_plain_data(where), "decided": False})
    return told.also(left_out=parts)


def _values_there(
    system: SecondOrderSystem, text: str
) -> dict[ex.Expression, ex.Expression] | None:
    """The values of parameters at an exception; None where it cannot be solved for a parameter."""
    *sides, last = [reader.read_formula(side, system.names) for side in text.split("=")]
    values = dict[ex.Expression, ex.Expression]()
    for side in sides:
        roots = (_root(collecting.collect(side - last), name) for name in system.parameters)
        found = next(filter(None, roots), None)
        if found is None:
            return None
        values |= found
    return values


# The key `instead`: the first alternative that is quickly found where there is no L(q, q').


def with_instead(told: Told, solution: Solution, asked: SolveOptions, end: float) -> Told:
    """With an L(t, q, q'), T - V with friction, or parameter values that leave an L(q, q')."""
    plain = solution.answer_to(PLAIN)
    if plain is None or plain.verdict != "not_variational" or told.has_cells:
        return told
    if told.timed is not None and has_valid_lagrangian(told.timed):
        return dataclasses.replace(told, instead="time")
    found = _with_friction(solution, asked, plain.domain, end)
    found = found or _with_parameters(solution.system, asked.seed, end)
    return told if found is None else told.also(found)


def _with_friction(
    solution: Solution, asked: SolveOptions, where: Domain, end: float
) -> Stated | None:
    """L and D on the set `where` the verdict holds."""
    from inverse_service.solving.kind_answers import quick_rayleigh

    given = [second_order_system.on_branch(equation, solution.system) for equation in asked.given]
    found = quick_rayleigh(deciding.analyze(solution.system), given, end)
    if found is None or found.lagrangian is None:
        return None

    names, lagrangian = solution.system.coordinates, found.lagrangian
    # The set of the verdict, and what the proof of L and D divides by, such as a letter.
    whole = lagrangian.domain.within(where)
    hamiltonian = explaining.hamiltonian_of(
        lagrangian.expression, names, lagrangian.domain.positive
    )
    shown_hamiltonian = (
        None
        if hamiltonian is None
        else translate.hamiltonian_part(
            hamiltonian,
            dataclasses.replace(lagrangian, domain=whole),
            solution.system.parameters,
        )
    )
    fields = kind_fields(found)
    shown: dict[str, Any] = {
        key: fields[key] for key in ("dissipation", *SHOWN_INSTEAD) if key in fields
    }
    domain = certify.shortest(whole.positive, whole.nonzero)
    shown |= {"domain": domain, "hamiltonian": translate.as_plain_data(shown_hamiltonian)}
    shown = {"kind": WITH_FRICTION, **shown}
    return _stated_instead(Question(kind=WITH_FRICTION), shown, lagrangian.expression)


def _stated_instead(question: Question, fields: dict[str, Any], formula: ex.Expression) -> Stated:
    asked = dataclasses.replace(question, timed=stated.is_timed(fields))
    return Stated(asked, {**fields, "verdict": "variational"}, "/instead", formula=formula)


def _with_parameters(system: SecondOrderSystem, seed: int, end: float) -> Stated | None:
    """The first leaf of the family in the parameters, each parameter solved for, where a Lagrangian
    is found.
    """
    if not system.parameters or system.functions or deadline.now() > end:
        return None
    from inverse_service.solving import leaves, members

    try:
        asked = SolveOptions(time_dependent=False, seed=seed)
        found = members.explore(system, system.parameters, (), asked, end)
    except leaves.NOT_COMPUTED:
        return None
    for one in found.leaves:
        answer = one.answer
        if (
            one.inside is not None
            and answer is not None
            and answer.lagrangian is not None
            and one.system is not None
        ):
            texts = [
                f"{printing.to_text(each.left)} = {printing.to_text(each.right)}"
                for each in one.solved
            ]
            fields = answered(schemas.InsteadPart, one.system, answer)
            kept = {key: fields[key] for key in ("equations", *SHOWN_INSTEAD)}
            shown = {"kind": "parameters", "conditions": texts, **kept}
            question = Question(case=tuple(texts))
            return _stated_instead(question, shown, answer.lagrangian.expression)
    return None


# What `check` compares these with: the system, made again from the document; None where they are
# about no such system.


def system_with_clock(document: Any, part: Mapping[str, Any]) -> SecondOrderSystem | None:
    """That of the document, in the clock of `with_clock`, which is the one that the document names
    if it names one.
    """
    try:
        schema = accepting.to_schema(accepting.prepared(document).document)
        system = accepting.to_system(schema)
        factor = to_clock(schema, system) or read_clock(system, str(part.get("factor")), schema)
    except InputError:
        return None
    return in_clock(part, system, factor)


def in_clock(
    part: Mapping[str, Any], system: SecondOrderSystem, factor: ex.Expression
) -> SecondOrderSystem | None:
    from inverse_service.solving import clock

    return (
        clock.with_clock(system, factor) if part.get("factor") == printing.to_text(factor) else None
    )


def system_there(document: Any, conditions: Any) -> SecondOrderSystem | None:
    """That of the document for special values of the parameters, given as a list of texts "name =
    value".
    """
    if not isinstance(conditions, list):
        return None
    try:
        system = accepting.to_system(accepting.to_schema(accepting.prepared(document).document))
        names = nm.Names(
            parameters=system.parameters, time=False
        )  # constants: a = x is no condition
        pairs = [text.split(" = ") for text in conditions]
        values = {
            reader.read_formula(name, names): reader.read_formula(value, names)
            for name, value in pairs
        }
    except (InputError, KeyError, ValueError, AttributeError, TypeError):
        return None
    held = {node for tree in values.values() for node in ex.walk(tree)}
    known = {ex.Symbol(name) for name in system.parameters} - held
    good = values and len(values) == len(pairs) and {*values} <= known
    return second_order_system.with_values(system, values) if good else None


def system_at(document: Any, where: str) -> SecondOrderSystem | None:
    """The first branch of that of the document where a parameter has the value of an exception, "n
    = 1".
    """
    try:
        system = accepting.to_system(accepting.to_schema(accepting.prepared(document).document))
        system = second_order_system.branches_of(system)[0]
        values = _values_there(system, where)
    except InputError:
        return None
    return (
        None
        if values is None
        else second_order_system.branches_of(second_order_system.with_values(system, values))[0]
    )


def is_of_reduced(part: Mapping[str, Any], reduced: Mapping[str, Any]) -> bool:
    """Whether `instead` repeats the reduced system, or this with its clock."""
    known = [
        {**one, "clock": one.get("factor")} for one in (reduced, reduced.get("with_clock") or {})
    ]
    same = [
        all((one.get(key) or None) == (part.get(key) or None) for key in OF_REDUCED)
        for one in known
    ]
    return bool(part.get("lagrangian")) and any(same)


def questions_of(part: Mapping[str, Any], system: SecondOrderSystem) -> Sequence[str]:
    """Those that an answer may be about: a special case may have an L(t, q, q') alone, and says
    so.
    """
    timed = system.depends_on_time or (
        "dimension" in part and part.get("verdict_with_time") == "variational"
    )
    return (
        ("time_dependent",)
        if system.depends_on_time
        else ("autonomous", *["time_dependent"] * timed)
    )


def is_inside(system: SecondOrderSystem, near: Mapping[str, str]) -> bool:
    """Whether the point is one of the case of signs that the formulas of the system are for."""
    try:
        return real_branch.are_positive(system.positive, real_branch.table_at(near)) or any(
            isinstance(node, ex.Arbitrary) for tree in system.positive for node in ex.walk(tree)
        )
    except (KeyError, ValueError, TypeError, AttributeError):
        return False


def to_kinds(schema: SystemDocument, system: SecondOrderSystem) -> tuple[LagrangianKind, ...]:
    """The kinds of a document; raises InputError with the place of what cannot be read."""
    found = []
    if schema.near and to_near(schema, system) and "positive_definite" not in schema.kinds:
        raise InputError(
            "'near' is the point of the kind positive_definite, which is not asked about.", "/near"
        )
    for place, kind in enumerate(schema.kinds):
        pointer = f"/kinds/{place}"
        if isinstance(kind, InvariantKind):
            fields = [
                _field(field, schema, system, f"{pointer}/invariant/{k}")
                for k, field in enumerate(kind.invariant)
            ]
            found.append(invariant(fields, system.coordinates))
        else:
            found.append(kind_named(kind, system.coordinates))
    if len({kind.name for kind in found}) < len(found):
        raise InputError(
            "a kind is named twice: name each once, all vector fields in one 'invariant'.", "/kinds"
        )
    return tuple(found)


def _field(
    field: str | Mapping[str, str], schema: SystemDocument, system: SecondOrderSystem, pointer: str
) -> dict[str, tuple[str, ex.Expression]]:
    """{coordinate: (text, tree)}; a name is the translation along this coordinate."""
    texts = {field: "1"} if isinstance(field, str) else field
    names, found = nm.Names(system.coordinates, system.parameters), {}
    for name, text in texts.items():
        if name not in system.coordinates:
            raise InputError(
                f"a vector field has components along {', '.join(system.coordinates)}.", pointer
            )
        place = f"{pointer}/{name}"
        tree = accepting.formula_about(text, names, schema, place)
        if not all(_is_rational(node) for node in ex.walk(tree)):
            raise InputError(
                "a component is a rational formula in coordinates and parameters.", place
            )
        found[name] = (printing.to_text(tree), tree)
    return found


def _is_rational(node: ex.Expression) -> bool:
    known = isinstance(node, _RATIONAL) and node != ex.Symbol("t")
    power = not isinstance(node, ex.Power) or (
        isinstance(node.exponent, ex.Number) and node.exponent.value.denominator == 1
    )
    return known and power


def with_kinds(
    told: Told,
    solution: Solution,
    schema: SystemDocument,
    kinds: Sequence[LagrangianKind],
    asked: SolveOptions,
    end: float,
) -> Told:
    """With an answer for each kind, which share the time that is left."""
    from inverse_service.solving import kind_answers

    for place, kind in enumerate(kinds):
        until = deadline.now() + (end - deadline.now()) / (len(kinds) - place)
        near = to_near(schema, solution.system)
        found = kind_answers.answer_kind(solution, kind, near, asked, until)
        fields = kind_fields(found)
        timed = stated.is_timed(fields, told.first.question.timed)
        question = Question(told.main, timed, kind=kind.name)
        at = f"/kinds/{kind.name}"
        told = told.also(Stated(question, fields, at, formula=found.formula))
    return told


def to_near(
    schema: SystemDocument, system: SecondOrderSystem
) -> dict[ex.Symbol | ex.Velocity, Fraction]:
    """The point that a document names; InputError for a name that has no value there, or no
    number.
    """
    names: dict[str, ex.Symbol | ex.Velocity] = {
        name: ex.Symbol(name) for name in (*system.coordinates, *system.parameters, "t")
    }
    names |= {f"{name}'": ex.Velocity(name) for name in system.coordinates}
    if not {*schema.near} <= {*names}:
        raise InputError(f"a point has values of {', '.join(names)}.", "/near")
    try:
        return {names[name]: Fraction(text) for name, text in schema.near.items()}
    except (ValueError, ZeroDivisionError):
        raise InputError(
            'the values at a point must be rational numbers such as "1/2" or 0.3.', "/near"
        ) from None


def kind_fields(found: Statement) -> dict[str, Any]:
    """An answer about a kind of Lagrangian as the fields that its place in a result has of it."""
    fields = translate.answer_fields(found) | {
        "dissipation": translate.as_plain_data(found.dissipation)
    }
    fields |= {"reason": found.why} if found.why else {}
    return {key: fields[key] for key in schemas.KindPart.model_fields}
