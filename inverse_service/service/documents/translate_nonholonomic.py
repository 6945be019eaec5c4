"""Between Nonholonomic documents and the engine's data; belongs to `translate`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, TypeVar

from api_schemas import nonholonomic as schemas
from api_schemas.result import HamiltonianPart
from inverse_service import errors
from inverse_service.constrained import nonholonomic_study
from inverse_service.constrained.answering import MotionAnswer, MotionLagrangian
from inverse_service.constrained.hamiltonise import Comparison, Hamiltonisation
from inverse_service.decision.solutions import Hamiltonian
from inverse_service.explanation import wording
from inverse_service.expressions import notation, printing
from inverse_service.expressions import tree as ex
from inverse_service.field.exact_field import TooLarge
from inverse_service.mechanics import constrained_motion
from inverse_service.mechanics.first_integrals import FirstIntegral
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import accepting, checking, translate

T = TypeVar("T")


def to_nonholonomic_schema(document: Any) -> schemas.NonholonomicDocument:
    """The document in its schema; raises DocumentRefused with every fault found."""
    if isinstance(document, dict) and "equations" in document:
        sentence = "'equations' and a Lagrangian or constraints are both given: keep the one or the other."
        raise errors.DocumentRefused((errors.Place(sentence, "/equations"),))
    return accepting.validated(document, schemas.NonholonomicDocument)


def to_nonholonomic(schema: schemas.NonholonomicDocument) -> constrained_motion.NonholonomicSystem:
    """The system that a document describes; raises InputError with pointer and column."""
    return constrained_motion.read_nonholonomic(
        schema.coordinates,
        schema.lagrangian,
        schema.constraints,
        schema.parameters,
        schema.functions,
        schema.name,
        where=schema.where,
    )


def to_families(
    schema: schemas.NonholonomicDocument, system: constrained_motion.NonholonomicSystem
) -> list[tuple[ex.Expression, ...]]:
    """The families of multiples, each one tree for each coordinate; raises InputError."""
    if schema.multiples is None:
        return []
    if isinstance(schema.multiples, dict):
        return [constrained_motion.read_multiples(schema.multiples, system, schema.parameters)]
    return [
        constrained_motion.read_multiples(family, system, schema.parameters, f"/multiples/{place}")
        for place, family in enumerate(schema.multiples)
    ]


def to_nonholonomic_parse_answer(
    system: constrained_motion.NonholonomicSystem,
    motion: constrained_motion.EquationsOfMotion,
    schema: schemas.NonholonomicDocument,
) -> schemas.NonholonomicParseAnswer:
    """What was understood: Lagrangian, constraints, and the accelerations that follow."""
    return translate.part_of(
        schemas.NonholonomicParseAnswer,
        system,
        functions=translate.function_fields(system),
        equations={name: translate.parsed(f) for name, f in zip(system.coordinates, motion.accelerations, strict=True)},
        depends_on_time=any(node == ex.TIME for f in motion.accelerations for node in ex.walk(f)),
        guessed=translate.guessed_names(schema, system),
        readings=[],
        lagrangian=translate.parsed(system.lagrangian),
        constraints=[translate.parsed(tree) for tree in system.constraints],
    )


def to_nonholonomic_part(study: nonholonomic_study.Study, kept: Sequence[FirstIntegral]) -> schemas.NonholonomicPart:
    """The key `nonholonomic` of a result."""
    system = study.report.motion.system
    return schemas.NonholonomicPart(
        lagrangian=translate.formula(system.lagrangian),
        constraints=[translate.formula(tree) for tree in system.constraints],
        main=study.answers[study.main].associated.kind,
        **_motion_fields(study.report),
        first_integrals=[translate.integral_part(each) for each in kept],
        associated=[_associated(one, place == study.main) for place, one in enumerate(study.answers)],
        hamiltonisation=[_hamiltonisation(report) for one in study.answers for report in one.reports],
    )


def _motion_fields(report: nonholonomic_study.MotionReport) -> dict[str, Any]:
    return {
        "equations_of_motion": _motion(report.motion),
        "integrable": _integrability(report),
        "measure_density": _measure(report),
        "paper_class": _class(report),
    }


def _motion(motion: constrained_motion.EquationsOfMotion) -> schemas.MotionPart:
    return translate.part_of(
        schemas.MotionPart,
        motion,
        first_order=translate.formulas(motion.dependent, motion.dependent_velocities),
        second_order=translate.formulas(motion.free, motion.free_accelerations),
        accelerations=translate.formulas(motion.system.coordinates, motion.accelerations),
    )


def _integrability(report: nonholonomic_study.MotionReport) -> schemas.IntegrabilityPart:
    found, count = report.integrability, len(report.motion.system.constraints)
    if found is None:
        text = "Whether constraints are integrable was not settled, their brackets are too large."
        nothing: dict[str, Any] = {"holonomic": False, "integrable": 0, "count": count, "growth": [], "integrals": []}
        return schemas.IntegrabilityPart(**nothing, **_stated(text))
    if found.integrable == 0:
        text = "No combination of the constraints is integrable."
    elif found.holonomic:
        text = (
            "The constraints are integrable (Frobenius): they restrict positions, the system is holonomic in disguise."
        )
    else:
        text = f"{found.integrable} of {count} constraints is integrable: a combination restricts positions."
    return translate.part_of(schemas.IntegrabilityPart, found, **_stated(text))


def _stated(*pieces: wording.Piece, key: str = "statement") -> dict[str, Any]:
    """A sentence (see `said`) as text and in parts."""
    step = translate.step_part(wording.said(*pieces))
    return {key: step.text, "parts": step.parts}


def to_any_associated(answer: MotionAnswer) -> schemas.AnyAssociatedPart:
    """The key `any_associated` of a result."""
    found, certificates = answer.lagrangian, [translate.plain(each) for each in answer.certificates]
    report = None if found is None else found.report
    return translate.part_of(
        schemas.AnyAssociatedPart,
        answer,
        **_stated(*_statement(answer)),
        checked="valid" if certificates else None,
        lagrangian=None if found is None else _motion_lagrangian(found),
        associated=None if found is None else _belongs_to(found),
        hamiltonian=None if report is None else _hamiltonian(report),
        image=[] if report is None else [translate.formula(tree) for tree in _images(report)],
        certificate=certificates[0] if certificates else None,
        certificate_with_time=certificates[1] if len(certificates) > 1 else None,
        explanation=[translate.step_part(step) for step in answer.explanation],
    )


def _statement(answer: MotionAnswer) -> list[wording.Piece]:
    """The answer about the motion in one sentence, with the set that its proof speaks of."""
    if "variational" in (answer.verdict, answer.verdict_with_time):
        kind = "" if answer.lagrangian is None else answer.lagrangian.kind
        by = f"the {kind} associated system" if kind not in ("", "own") else "an associated system"
        time = ", by a Lagrangian that depends on time" if answer.verdict != "variational" else ""
        return [f"This motion can be given a Hamiltonian, by {by}{time}", *_where(answer), "."]
    if answer.verdict == answer.verdict_with_time == "not_variational":
        return ["This motion cannot be given a Hamiltonian, by any associated system", *_where(answer), "."]
    if answer.verdict == "not_variational":
        no = "This motion cannot be given a Hamiltonian by any `L(q, q')`"
        return [f"{no}; with a Lagrangian that depends on time it is open."]
    return [checking.OPEN_MOTION]


def _where(answer: MotionAnswer) -> Iterator[wording.Piece]:
    """ ", where A > 0 and B > 0" with the conditions of the first certificate, in its names; nothing without one."""
    certificate = answer.certificates[0] if answer.certificates else {}
    for place, condition in enumerate(certificate.get("conditions") or ()):
        system = certificate["system"]
        names = Names(tuple(system["coordinates"]), tuple(system["parameters"]), system["functions"])
        left, sign, right = condition.partition(" > " if " > " in condition else " < ")
        yield " and " if place else ", where "
        yield notation.row(reader.read_formula(left, names), sign, reader.read_formula(right, names))


def _motion_lagrangian(found: MotionLagrangian) -> schemas.MotionLagrangianPart:
    return schemas.MotionLagrangianPart(
        **dict(translate.lagrangian_part(found.lagrangian)),
        on_constraints=translate.formula(found.jet.on_constraints),
        transverse_momenta=[translate.formula(tree) for tree in found.jet.transverse_momenta],
    )


def _belongs_to(found: MotionLagrangian) -> schemas.BelongsTo:
    system = found.system
    pairs = () if system is None else zip(system.coordinates, system.accelerations, strict=True)
    return schemas.BelongsTo(kind=found.kind, equations={name: printing.to_text(f) for name, f in pairs})


_MEASURE = {
    "found": "N times the volume of phase space is invariant; its momenta are those of the free velocities.",
    "does_not_exist": "No density `N(q)` makes a volume invariant: the equations for log N contradict each other.",
    "not_found": "A density `N(q)` was not found in closed form; whether there is one was not settled.",
}


def _measure(report: nonholonomic_study.MotionReport) -> schemas.MeasurePart:
    found = report.density
    return schemas.MeasurePart(
        status=found.status,
        density=None if found.momenta is None else translate.formula(found.momenta),
        in_velocities=None if found.velocities is None else translate.formula(found.velocities),
        **_stated(_MEASURE[found.status]),
    )


def _class(report: nonholonomic_study.MotionReport) -> schemas.ClassPart:
    member = report.member
    if member is None:
        return schemas.ClassPart(member=False, **_stated(f"The system is outside the paper's class: {report.reason}."))
    parts, names = member.geometry, member.geometry.system.coordinates
    dependent = [names[place] for place in member.frame.dependent]
    force = "" if member.force_fits else " that depends on more than `r_2`"
    N = _in_time(lambda: translate.formula(parts.tree(member.inverse_square_density) ** Fraction(-1, 2)))
    return schemas.ClassPart(
        member=True,
        **_stated(
            "The system is in the class `s' = -A(r_1) r_2'` with ",
            notation.row("r_1 = ", ex.Symbol(names[member.r1])),
            ", ",
            notation.row("r_2 = ", ex.Symbol(names[member.r2])),
            f", with a potential{force}." if member.has_force else ".",
        ),
        r1=names[member.r1],
        r2=names[member.r2],
        s=dependent,
        A=_in_time(lambda: translate.formulas(tuple(dependent), tuple(parts.tree(each) for each in member.slopes)))
        or {},
        N=N,
        K=_in_time(lambda: translate.formula(parts.tree(member.slope_of_density))),
        potential=member.has_force,
    )


def _in_time(work: Callable[[], T]) -> T | None:
    """What the work gives; None where the time for exact expressions was used up before it."""
    try:
        return work()
    except TooLarge:
        return None


_SHOWN = ("verdict", "reason", "checked", "lagrangian", "hamiltonian", "certificate", "domain")


def _associated(one: nonholonomic_study.AssociatedAnswer, is_main: bool) -> schemas.AssociatedPart:
    """The steps of the main one are the `explanation` of the result."""
    system, solution, answer = one.associated.system, one.solution, one.answer
    if system is None or solution is None or answer is None:
        return schemas.AssociatedPart(kind=one.associated.kind, defined=False, explanation=one.associated.explanation)
    fields = translate.answer_fields(answer, system)
    return schemas.AssociatedPart(
        kind=one.associated.kind,
        defined=True,
        explanation=one.associated.explanation,
        **translate.equation_fields(system),
        verdict_with_time=None if solution.with_time is None else solution.with_time.verdict,
        steps=[] if is_main else [translate.step_part(step, in_full=False) for step in answer.explanation],
        **{key: fields[key] for key in _SHOWN},
    )


def _hamiltonisation(report: nonholonomic_study.Report) -> schemas.HamiltonisationPart:
    found = report.found
    return schemas.HamiltonisationPart(
        associated=report.kind,
        label=report.label,
        lagrangian=translate.formula(found.lagrangian),
        hamiltonian=_hamiltonian(found),
        constraints=[translate.formula(tree) for tree in _images(found)],
        checked=report.checked,
        statements=[
            schemas.StatementPart(verdict=each.verdict, **_stated(each.text, key="text")) for each in found.statements
        ],
        holds=found.holds,
        trajectory=None if found.comparison is None else _trajectory(found.comparison),
    )


def _images(found: Hamiltonisation) -> tuple[ex.Expression, ...]:
    """The constraints in phase space; none where the energy is given in the velocities."""
    return () if found.transform is not None and found.transform.implicit else found.images


def _hamiltonian(found: Hamiltonisation) -> HamiltonianPart | None:
    return (
        None if found.transform is None else translate.hamiltonian_part(Hamiltonian.of(found.transform, _images(found)))
    )


def _trajectory(comparison: Comparison) -> schemas.TrajectoryPart:
    functions = {name: printing.to_text(body) for name, body in comparison.functions.items()}
    return translate.part_of(schemas.TrajectoryPart, comparison, functions=functions)
