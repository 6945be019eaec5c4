"""Documents of motions on constraints: schema, system, what is understood, and the systems that
come from them.

Of a Lagrangian with constraints, and of a motion that is given as it is.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

from api_schemas import base, result as schemas
from api_schemas.system import MotionDocument, NonholonomicDocument
from inverse_service import errors
from inverse_service.constrained import nonholonomic_study, reduced
from inverse_service.constrained.lagrangian import first_system
from inverse_service.expressions import printing, tree as ex
from inverse_service.mechanics import constrained_motion, paper_class, second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import accepting, derived, echo, own_lagrangian, translate

# What looking at a document again may take for an associated system that is only shown, s.
SHOWN_AT_ONCE = 0.3


def to_nonholonomic_schema(document: Any) -> NonholonomicDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    if isinstance(document, dict) and "equations" in document:
        sentence = (
            "'equations' and a Lagrangian or constraints are both given: keep only one of the two."
        )
        raise errors.DocumentRefused((errors.Place(sentence, "/equations"),))
    return accepting.validated(document, NonholonomicDocument)


def nonholonomic_of(document: Any) -> constrained_motion.NonholonomicSystem:
    """The system of a prepared document; raises InputError."""
    return to_nonholonomic(to_nonholonomic_schema(document))


def to_nonholonomic(schema: NonholonomicDocument) -> constrained_motion.NonholonomicSystem:
    """The system that a document describes; raises InputError with pointer and column."""
    declared = accepting.declared(schema, constrained_motion.MOST_CONSTRAINED)
    found = constrained_motion.read_nonholonomic(
        declared, schema.lagrangian, schema.constraints, schema.name
    )
    names = nm.Names(found.coordinates, found.parameters, dict(found.functions))
    short = own_lagrangian.in_few_terms(
        found.lagrangian, names, (schema.lagrangian, *schema.where.values())
    )
    return dataclasses.replace(found, lagrangian=short)


def to_families(
    schema: NonholonomicDocument, system: constrained_motion.NonholonomicSystem
) -> list[tuple[ex.Expression, ...]]:
    """The families of multiples, each one tree for each coordinate; raises InputError."""
    given = [] if schema.multiples is None else schema.multiples
    families = (
        {"": given}
        if isinstance(given, dict)
        else {f"/{place}": one for place, one in enumerate(given)}
    )
    names = nm.Names(system.coordinates, system.parameters, dict(system.functions))
    found = []
    for at, family in families.items():
        multiples: dict[str, ex.Expression] = dict.fromkeys(system.coordinates, ex.ZERO)
        for key, text in family.items():
            name, place = names.spelling(key), f"/multiples{at}/{nm.escaped(key)}"
            if name not in multiples:
                listed = ", ".join(system.coordinates)
                detail = f"there is a multiple for a name that is not a coordinate: the coordinates are {listed}."
                raise errors.InputError(detail, place)
            tree = accepting.formula_about(text, names, schema, place)
            multiples[name] = reader.without_accelerations(tree, f"the multiple for {name}", place)
        found.append(tuple(multiples.values()))
    return found


def motion_of_document(document: Any) -> second_order_system.ConstrainedMotion:
    """The motion that a prepared document gives; raises InputError."""
    return read_given_motion(accepting.validated(document, MotionDocument))


def motion_of(plain: Any) -> second_order_system.ConstrainedMotion:
    """The motion on constraints of a prepared document of either kind; raises InputError."""
    if accepting.is_motion(plain):
        return motion_of_document(plain)
    return nonholonomic_study.motion_report(nonholonomic_of(plain)).motion


def with_put_in(
    plain: Any, member: SecondOrderSystem, put: Callable[[ex.Expression], ex.Expression]
) -> dict[str, Any]:
    """The prepared document with constants and functions put in; `member` has the names that it
    then holds. Raises InputError.
    """
    found: dict[str, Any] = {
        "parameters": list(member.parameters),
        "functions": {name: list(of) for name, of in member.functions},
    }
    if accepting.is_motion(plain):
        motion = motion_of_document(plain)
        rates = dict(zip(motion.free, motion.free_accelerations, strict=True))
        constraints = [ex.subtract(v, w) for v, w in motion.on_constraints.items()]
        found["motion"] = {name: printing.to_text(put(tree)) for name, tree in rates.items()}
        found["coordinates"] = list(motion.coordinates)
    else:
        system = nonholonomic_of(plain)
        constraints = list(system.constraints)
        found["lagrangian"] = printing.to_text(put(system.lagrangian))
        found["coordinates"] = list(system.coordinates)
    return found | {"constraints": [printing.to_text(put(one)) for one in constraints]}


def read_given_motion(schema: MotionDocument) -> second_order_system.ConstrainedMotion:
    """The motion that a document describes; raises InputError."""
    declared = accepting.declared(schema, constrained_motion.MOST_CONSTRAINED)
    return constrained_motion.read_motion(declared, schema.motion, schema.constraints)


def parse(schema: NonholonomicDocument) -> schemas.NonholonomicParseAnswer:
    """Lagrangian, constraints, and the accelerations that follow; raises InputError."""
    system = to_nonholonomic(schema)
    to_families(schema, system)
    forces = constrained_motion.accelerations(system)
    motion = SecondOrderSystem(
        system.coordinates, forces, system.parameters, system.functions, system.name
    )
    return schemas.NonholonomicParseAnswer(
        **dict(translate.to_parse_answer(motion, schema)),
        lagrangian=translate.parsed(echo.lagrangian_with_extremes(schema, system.lagrangian)),
        constraints=[translate.parsed(tree) for tree in system.constraints],
    )


def system_of(schema: NonholonomicDocument) -> SecondOrderSystem:
    """The first associated system; raises InputError."""
    first, *_ = nonholonomic_study.associated_systems(
        nonholonomic_study.motion_report(to_nonholonomic(schema)), "first"
    )
    assert first.system is not None
    return first.system


def parse_motion(schema: MotionDocument) -> base.ParseAnswer:
    """The interpretation of the document; raises InputError."""
    return translate.to_parse_answer(system_of_motion(schema), schema)


def system_of_motion(schema: MotionDocument) -> SecondOrderSystem:
    """The accelerations on the constraints, by the free velocities, as a system; raises
    InputError.
    """
    return first_system(read_given_motion(schema))


class ReducedSystems(NamedTuple):
    """The reduced system, and this in the clock of `with_clock`; None where there is none."""

    plain: SecondOrderSystem | None
    in_clock: SecondOrderSystem | None


def systems_of_reduced(document: Any, part: dict[str, Any]) -> ReducedSystems:
    """The reduced system of the document, and this in the clock of `with_clock`; None where there
    is none.
    """
    clock = part.get("with_clock")
    try:
        document = accepting.prepared(document).document
        if accepting.is_motion(document):
            system = reduced.reduced_system(motion_of_document(document))
        else:
            report = nonholonomic_study.motion_report(nonholonomic_of(document))
            system = reduced.reduced_system(report.motion) or reduced.closed_subsystem(
                report.exact, report.motion
            )
        if system is None or not isinstance(clock, dict):
            return ReducedSystems(system, None)
        factor = derived.read_clock(system, str(clock.get("factor")))
    except errors.InputError:
        return ReducedSystems(None, None)
    return ReducedSystems(system, derived.in_clock(clock, system, factor))


def asked_fields(document: Any) -> dict[str, Any] | None:
    """The fields of the system that a prepared document names: the associated one, or that of the
    motion alone.

    Without equations where it is not defined; None where the document names none. Raises
    InputError.
    """
    if accepting.is_motion(document):
        return translate.plain_fields(
            system_of_motion(accepting.validated(document, MotionDocument))
        )
    schema = to_nonholonomic_schema(document)
    if schema.associated == "any":
        return translate.plain_fields(system_of(schema))
    if schema.multiples is not None or schema.associated not in paper_class.KINDS:
        return None
    report = nonholonomic_study.motion_report(to_nonholonomic(schema), SHOWN_AT_ONCE)
    system = nonholonomic_study.associated_systems(report, schema.associated)[0].system
    return {"equations": {}} if system is None else translate.plain_fields(system)
