"""Answers about motions on constraints: use cases, and the parts of a result.

Of a Lagrangian with constraints, and of a motion that is given as it is; the key `reduced` of
either.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any

from api_schemas import result as schemas
from api_schemas.result import AdvicePart, HamiltonianPart
from api_schemas.system import MotionDocument, NonholonomicDocument
from inverse_service import errors
from inverse_service.constrained import (
    answering,
    hamiltonise,
    nonholonomic_study,
    reduced as deciding,
)
from inverse_service.constrained.lagrangian import first_system
from inverse_service.deadline import now, share
from inverse_service.decision import solutions
from inverse_service.explanation import explaining
from inverse_service.expressions import collecting, notation, printing, tree as ex
from inverse_service.mechanics import (
    constrained_motion,
    euler_lagrange,
    nonholonomic_integrals,
    paper_class,
)
from inverse_service.mechanics.first_integrals import FirstIntegral, first_integrals
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import (
    accepting,
    comparison,
    derived,
    motion_documents,
    stated,
    translate,
)
from inverse_service.service.documents.growing import Growing
from inverse_service.service.documents.older_keys import Told, result_of
from inverse_service.service.documents.stated import Stated
from inverse_service.statements import questions, reasons
from inverse_service.statements.domains import Domain
from inverse_service.statements.questions import TIMED, About, Question
from inverse_service.statements.stages import Part

_MEASURE = {
    "found": "N times the volume of phase space is invariant; its momenta are those of the free velocities.",
    "does_not_exist": "no density `N(q)` makes a volume invariant: the equations for log N contradict each other.",
    "not_found": "A density `N(q)` was not found in closed form; it is undecided whether one exists.",
}
# Of the time, what the equations of the free coordinates alone may take.
SHARE_OF_REDUCED = 0.25
MOST_FOR_INTEGRALS = 2.0  # s
QUADRATURE = "Along a solution of these equations the other coordinates follow by integrating the right sides over t."
CLOSED = "The equations of these coordinates contain no other coordinates; those follow from the equations of motion."
# Of the time for all, what finding the motion and what it keeps may take.
SHARE_OF_MOTION = 0.3
# Of what is left then, what the associated systems may take; of what is left then, the question
# about any one.
SHARE_OF_SYSTEMS = 0.45
SHARE_OF_ANY = 0.7
# What is said of the motion before it was asked.
OPEN = tuple(
    solutions.Statement(Question(About.ANY, timed), "undetermined", reasons.NOT_YET)
    for timed in (False, True)
)
# What first integrals may take, s and of the time.
FOR_INTEGRALS, SHARE_OF_INTEGRALS = 5.0, 0.1
# And what is left for checking all answers at the end.
SHARE_LEFT = 0.1


def to_nonholonomic_part(
    study: nonholonomic_study.Study, kept: Sequence[FirstIntegral]
) -> schemas.NonholonomicPart:
    """The key `nonholonomic` of a result."""
    return translate.part_of(
        schemas.NonholonomicPart,
        study.report.motion.system,
        main=study.answers[study.main].associated.kind,
        equations_of_motion=_motion(study.report.motion),
        integrable=_integrability(study.report),
        measure_density=_measure(study.report),
        paper_class=_class(study.report),
        first_integrals=[translate.integral_part(each) for each in kept],
        associated=[
            _associated(one, place == study.main) for place, one in enumerate(study.answers)
        ],
        hamiltonisation=[
            _hamiltonisation(report) for one in study.answers for report in one.reports
        ],
    )


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
        text = "It could not be decided whether constraints are integrable, because their brackets are too large."
        found = nonholonomic_integrals.Integrability(count, 0, (), ())
    elif found.integrable == 0:
        text = "no combination of the constraints is integrable."
    elif found.holonomic:
        text = "The constraints are integrable (Frobenius): they restrict positions, the system is holonomic in disguise."
    else:
        text = f"{found.integrable} of {count} constraints is integrable: a combination restricts positions."
    pieces: tuple[explaining.Piece, ...] = (text,)
    if report.integrability is not None and not found.holonomic:
        pieces = _in_general(report.motion.system, report.motion.system.constraints, text)
    return translate.part_of(schemas.IntegrabilityPart, found, **_stated(*pieces))


def _in_general(
    system: constrained_motion.NonholonomicSystem, trees: Iterable[ex.Expression], text: str
) -> tuple[explaining.Piece, ...]:
    """The sentence, which was proven for general values of the constants and functions in the
    trees, with these in front of it.
    """
    nodes = {node for tree in trees for node in ex.walk(tree)}
    names = [name for name in system.parameters if ex.Symbol(name) in nodes]
    used = {node.name for node in nodes if isinstance(node, ex.Arbitrary)}
    names += [f"{name}({', '.join(of)})" for name, of in system.functions if name in used]
    if not names:
        return (f"{text[0].upper()}{text[1:]}",)
    return (f"For general {', '.join(f'`{name}`' for name in names)}, {text}",)


def _stated(*pieces: explaining.Piece, key: str = "statement") -> dict[str, Any]:
    """A sentence (see `said`) as text and in parts."""
    step = translate.step_part(explaining.said(*pieces))
    return {key: step.text, "parts": step.parts}


def to_any_associated(answers: Sequence[solutions.Statement]) -> schemas.AnyAssociatedPart:
    """The key `any_associated` of a result, of the answer to each question that was asked."""
    each = [one for place, one in enumerate(answers) if one not in answers[:place]]
    certificates = [translate.as_plain_data(one.certificate) for one in each if one.certificate]
    found, report = _lagrangian(each), None
    if found is not None:
        report = found.report
    steps = [one.explanation for k, one in enumerate(each) if not k or one.verdict == "variational"]
    needed = next((one.construction for one in each if one.construction and found is None), None)
    timed = solutions.implied(Question(About.ANY, timed=True), answers)
    return schemas.AnyAssociatedPart(
        verdict=answers[0].verdict,
        verdict_with_time=None if timed is None else timed.verdict,
        **_stated(*_statement(answers)),
        **translate.reason_fields(next((one.open for one in each if one.open), None)),
        checked="valid" if certificates else None,
        exceptions=[*dict.fromkeys(text for one in each for text in one.exceptions)],
        freedom=next((one.freedom for one in each if one.freedom), ""),
        lagrangian=None
        if found is None
        else translate.part_of(
            schemas.MotionLagrangianPart,
            found.jet,
            **dict(translate.lagrangian_part(found)),
        ),
        associated=None if found is None else _belongs_to(found),
        hamiltonian=None if report is None else _hamiltonian(report),
        image=[] if report is None else translate.as_plain_data(_images(report)),
        certificate=certificates[0] if certificates else None,
        certificate_with_time=certificates[1] if len(certificates) > 1 else None,
        construction=None if needed is None else translate.step_part(needed),
        explanation=[translate.step_part(step) for listed in steps for step in listed],
    )


def _lagrangian(answers: Sequence[solutions.Statement]) -> answering.MotionLagrangian | None:
    """That of the last answer; without one, the first answer has none either."""
    found = answers[-1].lagrangian
    return found if isinstance(found, answering.MotionLagrangian) else None


def _statement(answers: Sequence[solutions.Statement]) -> list[explaining.Piece]:
    """The answer about the motion in one sentence, with the set that its proof speaks of."""
    verdicts = (answers[0].verdict, answers[-1].verdict)
    if "variational" in verdicts:
        kind = "" if (found := _lagrangian(answers)) is None else found.kind
        by = f"the {kind} associated system" if kind not in ("", "own") else "an associated system"
        time = ", by a Lagrangian that depends on time" if verdicts[0] != "variational" else ""
        return [f"This motion can be given a Hamiltonian, by {by}{time}", *_where(answers), "."]
    if verdicts[0] != "not_variational":
        return [comparison.OPEN_MOTION]
    no = "This motion cannot be given a Hamiltonian"
    if solutions.implied(Question(About.ANY, timed=True), answers) is None:  # it was not asked
        return [f"{no} by any `L(q, q')`", *_where(answers), "."]
    if verdicts[1] != "not_variational":
        return [f"{no} by any `L(q, q')`; with a Lagrangian that depends on time it is open."]
    return [f"{no}, by any associated system", *_where(answers), "."]


def _where(answers: Sequence[solutions.Statement]) -> Iterator[explaining.Piece]:
    """ ", where A > 0 and B > 0" with the conditions of the first certificate, in its names;
    nothing without one.
    """
    certificate = next((one.certificate for one in answers if one.certificate), {})
    for place, condition in enumerate(certificate.get("conditions") or ()):
        system = certificate["system"]
        names = nm.Names(
            tuple(system["coordinates"]), tuple(system["parameters"]), system["functions"]
        )
        yield " and " if place else ", where "
        yield notation.inequality(reader.read_condition(condition, names))


def _belongs_to(found: answering.MotionLagrangian) -> schemas.BelongsTo:
    system = found.system
    pairs = () if system is None else zip(system.coordinates, system.accelerations, strict=True)
    return schemas.BelongsTo(
        kind=found.kind, equations={name: printing.to_text(f) for name, f in pairs}
    )


def _measure(report: nonholonomic_study.MotionReport) -> schemas.MeasurePart:
    found = report.density
    density, in_velocities = map(translate.as_plain_data, (found.momenta, found.velocities))
    pieces: tuple[explaining.Piece, ...] = (_MEASURE[found.status],)
    if found.status == "does_not_exist":
        system = report.motion.system
        trees = (system.lagrangian, *system.constraints)
        pieces = _in_general(system, trees, _MEASURE[found.status])
    return schemas.MeasurePart(
        status=found.status,
        density=density,
        in_velocities=in_velocities,
        **_stated(*pieces),
    )


def _class(report: nonholonomic_study.MotionReport) -> schemas.ClassPart:
    member = report.member
    if member is None:
        system = report.motion.system
        text = f"the system is outside the class `s' = -A(r_1) r_2'`: {report.reason}."
        said = _in_general(system, (system.lagrangian, *system.constraints), text)
        return schemas.ClassPart(member=False, **_stated(*said))
    parts, names = member.geometry, member.geometry.system.coordinates
    dependent = [names[place] for place in member.frame.dependent]
    force = "" if member.force_fits else " that depends on more than `r_2`"
    known = nonholonomic_study.or_none
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
        A=known(lambda: translate.formulas(dependent, map(parts.tree, member.slopes))) or {},
        N=known(
            lambda: translate.formula_document(
                parts.tree(member.inverse_square_density) ** Fraction(-1, 2)
            )
        ),
        K=known(lambda: translate.formula_document(parts.tree(member.slope_of_density))),
        potential=member.has_force,
    )


def _associated(one: nonholonomic_study.AssociatedAnswer, is_main: bool) -> schemas.AssociatedPart:
    """The steps of the main one are the `explanation` of the result."""
    system, solution, answer = one.associated.system, one.solution, one.answer
    if system is None or solution is None or answer is None:
        return schemas.AssociatedPart(
            kind=one.associated.kind, defined=False, explanation=one.associated.explanation
        )
    timed = solution.answer_to(TIMED)
    fields = derived.answered(schemas.AssociatedPart, system, answer) | {
        "explanation": one.associated.explanation,
        "verdict_with_time": None if timed is None else timed.verdict,
        "steps": [] if is_main else [translate.short_part(step) for step in answer.explanation],
    }
    return schemas.AssociatedPart(kind=one.associated.kind, defined=True, **fields)


def _hamiltonisation(report: nonholonomic_study.Report) -> schemas.HamiltonisationPart:
    found = report.found
    return translate.part_of(
        schemas.HamiltonisationPart,
        report,
        associated=report.kind,
        lagrangian=translate.formula_document(found.lagrangian),
        hamiltonian=_hamiltonian(found),
        constraints=translate.as_plain_data(_images(found)),
        statements=[
            schemas.StatementPart(verdict=each.verdict, **_stated(each.text, key="text"))
            for each in found.statements
        ],
        holds=found.holds,
        trajectory=None
        if (seen := found.comparison) is None
        else translate.part_of(
            schemas.TrajectoryPart,
            seen,
            functions={name: printing.to_text(f) for name, f in seen.functions.items()},
        ),
    )


def _images(found: hamiltonise.Hamiltonisation) -> tuple[ex.Expression, ...]:
    """The constraints in phase space; none where the energy is given in the velocities."""
    return () if found.transform is not None and found.transform.implicit else found.images


def _hamiltonian(found: hamiltonise.Hamiltonisation) -> HamiltonianPart | None:
    if found.transform is None:
        return None
    return translate.hamiltonian_part(solutions.Hamiltonian(found.transform, _images(found)))


def solve_motion(document: Any, options: solutions.SolveOptions, grow: Growing) -> dict[str, Any]:
    """The result, all of it in `any_associated`; raises InputError."""
    schema = accepting.validated(document, MotionDocument)
    asks_family = bool(schema.family or schema.special_cases)
    last = now() + comparison.SHARE_OF_SOLVER * options.time_limit
    end = now() + (last - now()) / (2 if asks_family else 1)
    motion = motion_documents.read_given_motion(schema)
    question = schema.time_dependent_lagrangian
    grow.wanted = (Part.ANY_ASSOCIATED, Part.REDUCED, *[Part.FAMILY] * asks_family)
    grow.begin(Part.REDUCED)
    plain = deciding.decide_reduced(
        motion, None, _for_reduced(options, SHARE_OF_REDUCED * (end - now()))
    )
    own = None if plain is None else plain.answer
    grow.begin(Part.ANY_ASSOCIATED)
    answers = answering.answer_motion(
        motion, (), question, options.seed, end, grow.stage, reduced=own
    )
    main = questions.asked(question, motion.depends_on_time)[0]
    open_answer = solutions.Statement(main, "undetermined", reasons.ONLY_THE_MOTION)
    told = translate.to_told(
        solutions.Solution(first_system(motion), (main,), (open_answer,), None),
        schema,
        about=About.FIRST,
    )
    kept = (
        first_integrals(motion, None, options.seed, MOST_FOR_INTEGRALS)
        if schema.first_integrals
        else ()
    )
    told = _of_motion(told, [answers], kept)
    grow.hand_over((Part.ANY_ASSOCIATED,), lambda: comparison.checked_so_far(told, end - now()))
    grow.begin(Part.REDUCED)
    reduced: tuple[Stated, ...] = ()  # there is no measure that would give a clock
    if plain is not None:
        limits = _for_reduced(options, end - now())
        found = deciding.answer_reduced(motion, None, None, limits, plain)
        reduced = _about_reduced(found, main.timed)
    told = told.also(*reduced)
    if asks_family:
        from inverse_service.service.documents import family_parts

        asked = dataclasses.replace(options, time_dependent=question)
        told = family_parts.with_family_of_motion(told, motion, schema, asked, grow, last, answers)
    grow.begin(Part.CERTIFICATE)
    return result_of(grow.end(comparison.checked(told, end - now())))


def _of_motion(
    told: Told,
    answers: Sequence[Sequence[solutions.Statement]],
    kept: Sequence[FirstIntegral],
) -> Told:
    """With the answers about any associated system, by cell, and the first integrals of the
    motion.
    """
    integrals = [translate.as_plain_data(translate.integral_part(one)) for one in kept]
    first = None if told.has_cells else told.first
    known = (
        replace(one, part={**one.part, "first_integrals": integrals}) if one is first else one
        for one in told.statements
    )
    at = "/branches/{}/any_associated" if told.has_cells else "/any_associated"
    motions = (
        one
        for cell, each in enumerate(answers)
        for one in stated.both(
            About.ANY,
            translate.as_plain_data(to_any_associated(each)),
            at.format(cell),
            cell,
            told.first.question.timed,
            formula=each[-1].formula,
        )
    )
    whole = replace(told, statements=(*known, *motions), schema=schemas.NonholonomicResult)
    return whole.also(first_integrals=integrals)


def _for_reduced(options: solutions.SolveOptions, time_limit: float) -> solutions.SolveOptions:
    """What is asked about the reduced system."""
    return solutions.SolveOptions(
        seed=options.seed, time_limit=max(0.1, time_limit), conditions=False
    )


def _about_reduced(found: deciding.Reduced, asked: bool) -> tuple[Stated, ...]:
    """The answer for the equations of the free coordinates, and the one with Chaplygin's clock;
    whether L(t, q, q') was `asked` about.
    """
    system, answer = found.plain.system, found.plain.answer
    steps = [translate.short_part(step) for step in answer.explanation]
    fields = derived.answered(schemas.ReducedPart, system, answer) | {
        "coordinates": list(system.coordinates),
        "reconstruction": {name: printing.to_text(rate) for name, rate in found.others},
        "statement": QUADRATURE if found.others else CLOSED,
        "steps": translate.as_plain_data(steps),
        "without_clock": found.reason,
    }
    timed = stated.is_timed(fields, asked)
    plain = Stated(Question(About.REDUCED, timed), fields, "/reduced", formula=answer.formula)
    if found.clocked is None or found.factor is None:
        return (plain,)
    clocked = found.clocked
    return plain, derived.with_this_clock(
        About.REDUCED, found.factor, clocked.system, clocked.answer
    )


def solve_nonholonomic(
    document: Any, options: solutions.SolveOptions, grow: Growing | None = None
) -> dict[str, Any]:
    """The result document of a Nonholonomic document; the main fields answer one associated system.

    Raises InputError for a document that cannot be accepted, CertificateRefused where the checker
    finds our own certificate invalid.
    """
    grow, end = grow or Growing(None), now() + options.time_limit
    schema = motion_documents.to_nonholonomic_schema(document)
    system = motion_documents.to_nonholonomic(schema)
    families = motion_documents.to_families(schema, system)
    grow.begin(Part.MOTION)
    report = nonholonomic_study.motion_report(
        system, min(constrained_motion.TIME_LIMIT, SHARE_OF_MOTION * options.time_limit)
    )
    kind, last = schema.associated, end - SHARE_LEFT * options.time_limit
    made = _Made(schema, report, options, grow, last)
    if kind == "any":
        return _about_the_motion(made, end)
    systems = nonholonomic_study.associated_systems(
        report, None if kind == "search" else kind, families
    )
    defined = next((one for one in systems if one.system is not None), None)
    if defined is None or defined.system is None:
        raise errors.InputError(
            f'{systems[0].explanation} Ask for "any", which decides the motion alone.',
            "/associated",
        )
    questions = (
        Part.EXISTENCE,
        *[Part.EXISTENCE_WITH_TIME] * (schema.time_dependent_lagrangian is not False),
    )
    further = (
        Part.ANY_ASSOCIATED,
        Part.FIRST_INTEGRALS,
        Part.REDUCED,
        Part.LAGRANGIAN,
        Part.HAMILTONIAN,
        Part.EXPLANATION,
    )
    asks_family = bool(schema.family or schema.special_cases)
    grow.wanted = (Part.MOTION, *questions, *further, *[Part.FAMILY] * asks_family)
    unasked = _unasked(defined, _main_question(schema, report), reasons.NOT_YET)
    first = [nonholonomic_study.Study(report, (unasked,), 0)]
    made.tell((Part.MOTION,), first)
    asked = dataclasses.replace(
        options,
        time_dependent=schema.time_dependent_lagrangian,
        time_limit=SHARE_OF_SYSTEMS
        / (2 if schema.family or schema.special_cases else 1)
        * (end - now()),
        ansatz=accepting.to_ansatz(schema, defined.system),
        series_order=schema.series_order,
    )
    grow.begin(Part.EXISTENCE)
    decided = (*questions, Part.LAGRANGIAN, Part.HAMILTONIAN)
    studies = list(
        nonholonomic_study.study_branches(
            report, systems, asked, grow.stage, lambda study: made.tell(decided, [study])
        )
    )
    main = studies[0].answers[studies[0].main]
    if main.solution is not None:
        grow.cut |= main.solution.cut
    made.tell((*decided, Part.EXPLANATION), studies)
    made.ask_about_the_motion(studies, asked, SHARE_OF_ANY)
    told = made.whole(studies)
    if schema.family or schema.special_cases:
        from inverse_service.service.documents import family_parts

        assert main.associated.system is not None
        told = family_parts.with_family(told, main.associated.system, schema, asked, grow, end)
    if (
        told.first.verdict == "not_variational"
        and not told.has_cells
        and made.answers[0][0].verdict != "variational"
    ):
        told = replace(told, instead="reduced")
    grow.begin(Part.CERTIFICATE)
    return result_of(grow.end(comparison.checked(told, end - now())))


@dataclasses.dataclass(slots=True)
class _Made:
    """The known results about a motion: `answers` about any associated system by branch, the
    `reduced` system.
    """

    schema: NonholonomicDocument
    report: nonholonomic_study.MotionReport
    options: solutions.SolveOptions
    grow: Growing
    last: float
    answers: list[tuple[solutions.Statement, ...]] = dataclasses.field(default_factory=list)
    reduced: deciding.Reduced | None = None
    kept: tuple[FirstIntegral, ...] = ()
    found: tuple[FirstIntegral, ...] | None = None

    def integrals(self) -> tuple[FirstIntegral, ...]:
        """The first integrals of the motion, looked for once."""
        if self.found is None:
            limit = min(FOR_INTEGRALS, SHARE_OF_INTEGRALS * self.options.time_limit)
            self.found = nonholonomic_study.first_integrals(self.report, self.options.seed, limit)
        return self.found

    def tell(self, parts: Sequence[Part], studies: Sequence[nonholonomic_study.Study]) -> None:
        """Hand over these parts, and with them all that is known."""
        self.grow.hand_over(
            parts,
            lambda: comparison.checked_so_far(self.whole(studies), max(1.0, self.last - now())),
        )

    def ask_about_the_motion(
        self,
        studies: Sequence[nonholonomic_study.Study],
        asked: solutions.SolveOptions,
        part: float,
    ) -> None:
        """Any associated system, in this part of the time, first integrals, and the reduced system
        with its clocks.

        The answer for the reduced system as it is, which comes first, answers for the motion too
        where it is a yes.
        """
        motion, density = self.report.motion, self.report.density
        lagrangian = motion.system.lagrangian
        self.grow.begin(Part.REDUCED)
        limits = _for_reduced(self.options, SHARE_OF_REDUCED * (self.last - now()))
        plain = deciding.decide_reduced(motion, lagrangian, limits)
        for left, study in zip(range(len(studies), 0, -1), studies, strict=True):
            self.grow.begin(Part.ANY_ASSOCIATED)
            own = None if plain is None else plain.answer
            tell = partial(self.tell, (), studies) if len(studies) == 1 else lambda: None
            self._ask(study, asked, share(part / left, self.last), own, tell)
        self.tell((Part.ANY_ASSOCIATED,), studies)
        if self.schema.first_integrals:
            self.grow.begin(Part.FIRST_INTEGRALS)
            self.kept = self.integrals()
        self.tell((Part.FIRST_INTEGRALS,), studies)
        self.grow.begin(Part.REDUCED)
        limits = _for_reduced(self.options, self.last - now())
        if plain is not None:
            self.reduced = deciding.answer_reduced(motion, lagrangian, density, limits, plain)
        elif (closed := deciding.closed_subsystem(self.report.exact, motion)) is not None:
            self.reduced = deciding.answer_closed(closed, limits)

    def _ask(
        self,
        study: nonholonomic_study.Study,
        asked: solutions.SolveOptions,
        deadline: float,
        own: solutions.Statement | None,
        tell: Callable[[], None],
    ) -> None:
        """Whether any associated system has a Lagrangian; `tell` is called with a verdict before
        its Lagrangian.

        `own` is the answer for the reduced system.
        """
        place = len(self.answers)

        def told(answers: tuple[solutions.Statement, ...]) -> None:
            self.answers[place:] = [answers]
            tell()

        found = nonholonomic_study.answer_about(
            study,
            asked,
            deadline,
            self.grow.stage,
            own,
            told,
            lambda: [one.expression for one in self.integrals()],
        )
        self.answers[place:] = [found]
        why = next((one.open for one in found if one.open), None)
        if why is not None and (
            why.reason is reasons.Reason.TIME
            or (found[0].verdict == "undetermined" and now() >= deadline)
        ):
            self.grow.cut[Part.ANY_ASSOCIATED] = why

    def whole(self, studies: Sequence[nonholonomic_study.Study]) -> Told:
        """What is told of an associated system, and of the motion, which is what one simulates."""
        solutions = [_with_images(each.answers[each.main]) for each in studies]
        main = stated.about_of(studies[0].answers[studies[0].main].associated.kind)
        told = translate.to_told(solutions[0], self.schema, solutions[1:], about=main)
        system = self.report.motion.system
        taken = euler_lagrange.advice_for_constraints(
            system.lagrangian, system.constraints, system.coordinates
        )
        told = _of_motion(told, self.answers or [OPEN] * len(studies), self.kept)
        part = translate.as_plain_data(to_nonholonomic_part(studies[0], self.kept))
        asked = told.first.question.timed
        others = tuple(_associated_statements(part, studies[0].answers, asked))
        places = {one.at for one in others}
        part["associated"] = [
            _frame(one) if f"/nonholonomic/associated/{place}" in places else one
            for place, one in enumerate(part["associated"])
        ]
        told = told.also(advice=translate.as_plain_data(AdvicePart(**taken)), nonholonomic=part)
        reduced = () if self.reduced is None else _about_reduced(self.reduced, asked)
        return told.also(*others, *reduced)


def _associated_statements(
    part: Mapping[str, Any], answers: Sequence[nonholonomic_study.AssociatedAnswer], asked: bool
) -> Iterator[Stated]:
    """The answers about the associated systems that are not in the main fields."""
    for place, (one, found) in enumerate(zip(part["associated"], answers, strict=True)):
        if one["defined"] and one["kind"] != part["main"]:
            at, about = f"/nonholonomic/associated/{place}", stated.about_of(one["kind"])
            formula = None if found.answer is None else found.answer.formula
            yield from stated.both(about, one, at, 0, asked, formula=formula)


def _frame(one: Mapping[str, Any]) -> dict[str, Any]:
    """Of an associated system what is no statement about it."""
    return {key: one[key] for key in ("kind", "defined", "explanation")}


def _about_the_motion(made: _Made, end: float) -> dict[str, Any]:
    """The result where only the motion was asked about: the main fields leave open what was not
    asked.

    Each branch of the first associated system has its share of the time.
    """
    one = nonholonomic_study.associated_systems(made.report, "first")[0]
    if one.system is None:
        raise errors.InputError(one.explanation, "/associated")
    asks_family = bool(made.schema.family or made.schema.special_cases)
    made.grow.wanted = (
        Part.MOTION,
        Part.ANY_ASSOCIATED,
        Part.FIRST_INTEGRALS,
        Part.REDUCED,
        *[Part.FAMILY] * asks_family,
    )
    question = _main_question(made.schema, made.report)
    studies = [
        nonholonomic_study.Study(made.report, (_unasked(each, question),), 0)
        for each in nonholonomic_study.on_branches(one)
    ]
    made.tell((Part.MOTION,), studies)
    asked = dataclasses.replace(made.options, time_dependent=made.schema.time_dependent_lagrangian)
    # Other clocks of the reduced system, which come after, have a floor too.
    part = (1 - SHARE_OF_REDUCED) / (2 if asks_family else 1)
    made.ask_about_the_motion(studies, asked, part)
    told = made.whole(studies)
    if asks_family:
        from inverse_service.service.documents import family_parts

        motion, answers = made.report.motion, made.answers[0] if made.answers else ()
        told = family_parts.with_family_of_motion(
            told, motion, made.schema, asked, made.grow, end, answers
        )
    made.grow.begin(Part.CERTIFICATE)
    return result_of(made.grow.end(comparison.checked(told, end - now())))


def _main_question(
    schema: NonholonomicDocument, report: nonholonomic_study.MotionReport
) -> Question:
    """The question of the main fields."""
    return questions.asked(schema.time_dependent_lagrangian, report.motion.depends_on_time)[0]


def _unasked(
    one: paper_class.AssociatedSystem,
    question: Question,
    reason: reasons.Open = reasons.ONLY_THE_MOTION,
) -> nonholonomic_study.AssociatedAnswer:
    """The answer that leaves open whether a system has a Lagrangian."""
    assert one.system is not None
    answer = solutions.Statement(
        question,
        "undetermined",
        reason,
        domain=Domain(tuple(map(collecting.collect, one.system.positive))),
    )
    return nonholonomic_study.AssociatedAnswer(
        one, solutions.Solution(one.system, (question,), (answer,), None)
    )


def _with_images(main: nonholonomic_study.AssociatedAnswer) -> solutions.Solution:
    """The solution, its Hamiltonian with the constraints in phase space."""
    images = {each.found.lagrangian: each.found.images for each in reversed(main.reports)}

    def imaged(answer: solutions.Statement) -> solutions.Statement:
        if answer.lagrangian is None or answer.hamiltonian is None:
            return answer
        found = images.get(answer.lagrangian.expression)
        if (
            found is None or answer.hamiltonian.transform.implicit
        ):  # without momenta there is no image in phase space
            return answer
        return dataclasses.replace(
            answer, hamiltonian=dataclasses.replace(answer.hamiltonian, constraints=found)
        )

    solution = main.solution
    assert solution is not None
    return solution.changed(imaged)
