"""What is answered to the documents of `system`: about a system of equations, about a motion on constraints, and to a
Lagrangian without constraints (the forward problem)."""

from __future__ import annotations

from typing import Any, Final, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from api_schemas import base

FORMAT: Final = "inverse-service/result/1"
Verdict = Literal["variational", "not_variational", "undetermined"]
MainVerdict = Literal["variational", "not_variational", "undetermined", "differs"]
Checked = Literal["valid", "incomplete", "invalid"]
TextMatrix = list[list[str]]


class Formula(base.Document):
    """A formula in plain text and in LaTeX."""

    text: str
    latex: str


class ExplanationStep(base.Document):
    """One step of the explanation: its sentence and, if it has formulas, its words and formulas alternately.

    Even places of `parts` are words, odd ones formulas; a formula after the end of the sentence is shown below it.
    In `details` and `steps` a sentence with formulas has `parts` alone.
    """

    text: str = ""
    parts: list[str] = Field(default_factory=list)

    @model_serializer(mode="wrap")
    def _without_empty(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What is empty is left out: an explanation has hundreds of sentences."""
        return {key: value for key, value in handler(self).items() if value}


class IntegralPart(base.Document):
    """A function in L that is known by its partial derivatives: {"arguments": ["t"], "derivatives": {"t": "f(t)"}}. A
    single argument that is not t, a coordinate, or a velocity is the variable of a function of one: u for G in G(x^2 +
    y^2).
    """

    arguments: list[str]
    derivatives: dict[str, str]


class LagrangianPart(Formula):
    """A Lagrangian, the set where it is defined, at which points of that it is regular, and where it comes from.

    `auxiliary` defines the functions F in it by their derivatives. `reason` says why one of `other_lagrangians` is
    shown: "shorter", "positive definite" or "of another kind".
    """

    domain: list[str] = Field(default_factory=list)
    family: str = ""
    regular: str = ""
    reason: str = ""
    auxiliary: dict[str, IntegralPart] = Field(default_factory=dict)


class HamiltonianPart(Formula):
    """H(q, p), or H(q, q') with the momenta where no closed inverse of p = dL/dq' was found (`implicit`).

    `domain`: on which branch of that inverse it is H, as strict inequalities for coordinates, velocities and momenta.
    `image`: the constraints of a motion in phase space, which are 0; `constraints` are their texts. `reason`: why it is
    implicit. `mass_matrix` and `potential`: M(t, q) and V(t, q) of H = p^T M^-1 p/2 + V, where these are much shorter.
    """

    momenta: dict[str, str]
    implicit: bool
    reason: str = ""
    constraints: list[str] = Field(default_factory=list)
    image: list[Formula] = Field(default_factory=list)
    domain: list[str] = Field(default_factory=list)
    mass_matrix: TextMatrix = Field(default_factory=list)
    potential: Formula | None = None


class ProvenPart(base.Document):
    """A verdict with what proves it: `checked` is the independent checker's verdict on the certificate.

    It is proven for general parameters: `exceptions` are special values that it does not cover.
    """

    verdict: Verdict
    reason: str = ""
    reason_code: base.ReasonCode = ""
    lagrangian: LagrangianPart | None = None
    certificate: dict[str, Any] | None = None
    checked: Checked | None = None
    exceptions: list[str] = Field(default_factory=list)


class FirstIntegralPart(Formula):
    """A function of (t, q, q') that is constant along the motion; `symmetry` is the one behind it (Noether's theorem).

    `domain` are conditions under which the formula has a value; `auxiliary`, left out if empty, defines the functions F
    in it by their derivatives.
    """

    name: str
    symmetry: str = ""
    domain: list[str] = Field(default_factory=list)
    auxiliary: dict[str, IntegralPart] = Field(default_factory=dict)

    @model_serializer(mode="wrap")
    def _without_empty(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Most contain no such function."""
        return {key: value for key, value in handler(self).items() if value or key != "auxiliary"}


class AllIntegralsPart(base.Document):
    """A proof that there are no other first integrals polynomial in the velocities up to a degree.

    They are combinations of `number` products of those in `first_integrals` and of `others` (1, H, H^2, …), with any
    coefficients that are analytic in the coordinates, and in t if `timed`. The `others` depend on `first_integrals`, but
    are no polynomials in them: A_y, where A_x^2 + A_y^2 = 1 + 2 H L^2. Proven for general parameters and functions, which
    `exceptions` says.
    """

    degree: int
    number: int
    timed: bool
    others: list[FirstIntegralPart] = Field(default_factory=list)
    exceptions: list[str] = Field(default_factory=list)
    certificate: dict[str, Any]
    checked: Literal["valid"]


class SolutionSpacePart(base.Document):
    """Size of the space of multipliers, for general parameters and functions."""

    order: int
    dimensions: list[int]
    characters: list[int]
    involutive: bool
    statement: str


class ConditionsPart(base.Document):
    """Phi and nabla_Phi as n x n texts, R as n x n x n texts."""

    Phi: TextMatrix
    nabla_Phi: TextMatrix
    R: list[TextMatrix]


class UnderstoodSystem(base.Document):
    """The system as understood: canonical equations, one text and one LaTeX line a coordinate.

    As a rule `equations` are the accelerations; a text with x'' in it is an equation E = 0, not solved for them.

    `written` are the equations, or L and the constraints, in the order, the names, and the numbers of their author, and
    `definitions` the definitions and values of names in them: what text and page show. Empty for first-order pairs,
    which are joined in `equations`, and for documents of more than 4,000 characters.
    `given` is the document as it was given; `time` is what it calls the time.
    """

    name: str = ""
    coordinates: list[str]
    equations: dict[str, str]
    latex: dict[str, str]
    written: list[Formula] = Field(default_factory=list)
    definitions: list[Formula] = Field(default_factory=list)
    parameters: list[str]
    functions: dict[str, list[str]]
    given: dict[str, Any]
    time: str = "t"


class CaseNode(ProvenPart):
    """The system where all conditions hold and none of those of its children.

    A condition is an equation between parameters, or what a function is. `dimension` counts the parameters that stay
    free, `statement` says how large the space of multipliers is. `verdict` answers the question of the result,
    `verdict_with_time` L(t, q, q'). A special case with a Lagrangian shows one, with its `equations` and its
    certificate, where one was found in time.
    """

    conditions: list[Formula]
    verdict_with_time: Verdict | None = None
    dimension: int
    statement: str = ""
    equations: dict[str, str] = Field(default_factory=dict)
    hamiltonian: HamiltonianPart | None = None
    children: list[CaseNode] = Field(default_factory=list)


class VariationalCase(base.Document):
    """A largest case with a Lagrangian; each of `exceptions` is a list of conditions inside it."""

    conditions: list[Formula]
    dimension: int
    exceptions: list[list[Formula]] = Field(default_factory=list)


class SpecialCasesPart(base.Document):
    """The tree of cases from the generic one down; those with the verdict of what contains them are left out.

    `variational_when` answers the question of the result, `variational_when_with_time` L(t, q, q').
    `complete`: no other case has another verdict; else `reasons` say where this is not known.
    `complete_with_time` is that for L(t, q, q') alone, where both questions are asked.
    """

    tree: CaseNode
    variational_when: list[VariationalCase]
    variational_when_with_time: list[VariationalCase] | None = None
    examined: int
    complete: bool
    complete_with_time: bool | None = None
    reasons: list[str] = Field(default_factory=list)


class LeftOutPart(ProvenPart):
    """A set of special members that the answer about general constants and functions does not cover.

    `where` is its equation. If it is `decided`, the part is the answer to the question of the result, or to L(t, q, q')
    alone, about the `equations` there; else nothing is said about it.
    """

    where: Formula
    decided: bool
    verdict: Verdict = "undetermined"
    equations: dict[str, str] = Field(default_factory=dict)
    domain: list[str] = Field(default_factory=list)
    hamiltonian: HamiltonianPart | None = None
    integrals: dict[str, IntegralPart] = Field(default_factory=dict)


class LeafEquation(Formula):
    """An equation of a leaf; `leader` is the constant or derivative that it determines."""

    leader: str


class SolvedPart(Formula):
    """A constant or function of a leaf in closed form, with the names that are new in it."""

    new_constants: list[str] = Field(default_factory=list)
    new_functions: list[str] = Field(default_factory=list)


class LeafProof(base.Document):
    """The system of the general member of a leaf, and the certificate about it."""

    equations: dict[str, str]
    parameters: list[str] = Field(default_factory=list)
    functions: dict[str, list[str]] = Field(default_factory=dict)
    certificate: dict[str, Any]
    checked: Checked
    domain: list[str] = Field(default_factory=list)
    exceptions: list[str] = Field(default_factory=list)


class FamilyLeaf(base.Document):
    """The members of a family with these `equations`, nothing of `nonzero` being 0, that are in no later leaf.

    `id` is its place in the list, `inside` the leaf around it. The verdicts are about its general
    member, `verdict` about the question of the result; `solved` is this member in closed form,
    where its equations are solved, and `proof` its certificate. `exceptions` are the leaves in it
    that have other verdicts.
    """

    id: int
    inside: int | None = None
    equations: list[LeafEquation] = Field(default_factory=list)
    nonzero: list[str] = Field(default_factory=list)
    solved: list[SolvedPart] = Field(default_factory=list)
    verdict: Verdict
    verdict_with_time: Verdict | None = None
    statement: str = ""
    lagrangian: LagrangianPart | None = None
    hamiltonian: HamiltonianPart | None = None
    integrals: dict[str, IntegralPart] = Field(default_factory=dict)
    proof: LeafProof | None = None
    proof_without_time: LeafProof | None = None
    exceptions: list[int] = Field(default_factory=list)
    near: dict[str, str] = Field(default_factory=dict)


class OpenSet(base.Document):
    """Members inside a leaf that are not decided: the equations they satisfy, if these are known, and why."""

    inside: int = 0
    equations: list[Formula] = Field(default_factory=list)
    reason: str


class FamilyPart(base.Document):
    """Which members of the family in these constants and functions have a Lagrangian.

    `leaves`: the general member first, the most special last; a member belongs to the last leaf whose equations and
    inequations it satisfies. `covered`: the leaves have all members, and none is open. `certificate` is what proves the
    verdicts of all members that are not open, and `checked` the verdict of the independent checker on it.
    """

    letters: list[str]
    functions: dict[str, list[str]]
    leaves: list[FamilyLeaf]
    open: list[OpenSet] = Field(default_factory=list)
    covered: bool
    certificate: dict[str, Any] | None = None
    checked: Checked | None = None


# {"from": "0.51", "to": "0.5", "sigmas": -0.5}: both numbers exact, and the change in standard errors.
Moved = dict[str, str | float]


class LinearConditions(base.Document):
    """The conditions `matrix` c = `values` on the `coefficients` c, independent; numbers as text."""

    coefficients: list[str]
    matrix: list[list[str]]
    values: list[str]


class NiceMember(base.Document):
    """A member of the same set whose free coefficients are simple fractions."""

    distance: float
    moved: dict[str, Moved] = Field(default_factory=dict)
    equations: dict[str, str]


class NearestMember(base.Document):
    """The nearest system of a kind that was found; its coefficients are exact, and `result` is the answer about it.

    `distance` is in standard errors, or relative to the sizes of the coefficients where no errors are known;
    `chi2` is its square if they are known, `degrees` the number of equations that the kind imposes, `chance` how
    often fits of a system of this kind are as far or farther; `within`: that is more than in 3 of 1000 cases.
    `least` is the distance at which the computation ended, before the coefficients were made short. If it is a
    `projection`, none of the kind is nearer. Otherwise it is the nearest of `starts` starts; the next best ended at
    `second`. `attained` is false where still nearer ones tend to a singular Lagrangian.
    `equations` are what the members of the kind satisfy: for kinds with a matrix G and rates, with those of this
    member; `constraints` are the same as a matrix where they are linear.
    """

    kind: Literal["leaf", "equal_masses", "natural", "damped", "exponential", "damped_exponential"]
    statement: str
    distance: float
    chi2: float | None = None
    degrees: int
    chance: float | None = None
    within: bool | None = None
    least: float
    projection: bool
    starts: int
    second: float | None = None
    attained: bool
    moved: dict[str, Moved] = Field(default_factory=dict)
    equations: list[Formula] = Field(default_factory=list)
    constraints: LinearConditions | None = None
    multiplier: TextMatrix | None = None
    nice: NiceMember | None = None
    result: dict[str, Any]


class NotReached(base.Document):
    """A kind of which no nearest member is given, or a set that is not decided, and why."""

    kind: str
    reason: str


class OtherAnswer(ProvenPart):
    """The answer to the other question, L(t, q, q'), where it differs from the main one; `domain` as in a result.

    `explanation` are the steps that convince, `details` those that say how it was found and what else proves it; those
    among the main `details` are not repeated.
    """

    other_lagrangians: list[LagrangianPart] = Field(default_factory=list)
    multiplier: TextMatrix | None = None
    hamiltonian: HamiltonianPart | None = None
    integrals: dict[str, IntegralPart] = Field(default_factory=dict)
    solution_space: SolutionSpacePart | None = None
    explanation: list[ExplanationStep] = Field(default_factory=list)
    details: list[ExplanationStep] = Field(default_factory=list)
    construction: ExplanationStep | None = None
    domain: list[str] = Field(default_factory=list)
    near: dict[str, str] = Field(default_factory=dict)


class BranchPart(OtherAnswer):
    """The answers on one of the open connected sets on which roots of squares and the like are single formulas."""

    equations: dict[str, str] = Field(default_factory=dict)
    verdict_with_time: Verdict | None = None
    with_time: OtherAnswer | None = None
    first_integrals: list[FirstIntegralPart] = Field(default_factory=list)
    first_integrals_complete: AllIntegralsPart | None = None


class NotAnsweredPart(base.Document):
    """A cell of the system without an answer: where it is, a point of it if one is known, and why."""

    domain: list[str] = Field(default_factory=list)
    near: dict[str, str] = Field(default_factory=dict)
    reason: str
    reason_code: base.ReasonCode = ""


class KindPart(ProvenPart):
    """Whether there is a regular Lagrangian of a kind; with friction, `dissipation` is D in E_i = dD/dv_i.

    `near` is the real point that the certificate speaks of.
    """

    dissipation: Formula | None = None
    near: dict[str, str] = Field(default_factory=dict)


class InsteadPart(base.Document):
    """What there is instead of L(q, q'): an L(t, q, q') ("time"), or a natural L with friction D ("rayleigh").

    Or the L(q, q') of other `equations`: with `conditions` on the parameters ("parameters"), of the reduced system of
    constraints ("reduced"), with dtau = `clock` dt where `clock` says so.
    """

    kind: Literal["time", "rayleigh", "parameters", "reduced"]
    conditions: list[str] = Field(default_factory=list)
    clock: str = ""
    equations: dict[str, str] = Field(default_factory=dict)
    domain: list[str] = Field(default_factory=list)
    lagrangian: LagrangianPart
    hamiltonian: HamiltonianPart | None = None
    dissipation: Formula | None = None
    certificate: dict[str, Any]
    checked: Checked
    exceptions: list[str] = Field(default_factory=list)


class ClockPart(ProvenPart):
    """The answer for L(q, q') with dtau = `factor` dt: the equations for d2q/dtau2, q' being dq/dtau."""

    factor: str
    equations: dict[str, str]
    hamiltonian: HamiltonianPart | None = None
    domain: list[str] = Field(default_factory=list)


class AdvicePart(base.Document):
    """The method of simulation that fits what was found, and why; `order` and `alpha` where the method has them."""

    method: str
    order: int | None
    alpha: str | None
    reason: str


class IncompletePart(base.Document):
    """A part of the result that is not there: why, and what a longer time limit would do."""

    part: str
    reason: str
    reason_code: base.ReasonCode = ""
    more_time: str = ""


class OpenPart(base.Document):
    """What an answer leaves open: which part of the result is missing, why, what a longer time limit would do."""

    part: str
    words: str = ""
    reason_code: base.ReasonCode = ""
    more_time: str = ""


class AnswerPart(base.Document):
    """One answer with all that it needs: what was asked, where the verdict holds, and L, H and their domains.

    It is about the system as given (`main`); of a motion on constraints about `any` associated system, one of the
    asker's `own`, the `first`, `second` or `third`, or the `reduced` equations; `equations` where these are not those
    of `system`. `with_time`: L may contain t. `clock`: N, if the time is tau with dtau = N dt. `kind`: of which kind L
    has to be. `conditions`: special values of the parameters. `cell` is the place in `branches`. `certificate` and
    `explanation` are JSON pointers to the proof. `first_integrals` stand in the first answer about a cell. One that
    `follows` from another answer, whose place this is, shares its formulas and its proof. What is empty is left out,
    but for `domain`, `lagrangian`, `hamiltonian`, `checked` and `open`.
    """

    about: Literal["main", "any", "own", "first", "second", "third", "reduced"]
    with_time: bool
    clock: str = ""
    kind: str = ""
    conditions: list[str] = Field(default_factory=list)
    cell: int = 0
    equations: dict[str, str] = Field(default_factory=dict)
    verdict: Verdict
    domain: list[str] = Field(default_factory=list)
    near: dict[str, str] = Field(default_factory=dict)
    lagrangian: LagrangianPart | None = None
    hamiltonian: HamiltonianPart | None = None
    dissipation: Formula | None = None
    other_lagrangians: list[LagrangianPart] = Field(default_factory=list)
    first_integrals: list[FirstIntegralPart] = Field(default_factory=list)
    multiplier: TextMatrix | None = None
    solution_space: SolutionSpacePart | None = None
    freedom: str = ""
    exceptions: list[str] = Field(default_factory=list)
    checked: Checked | None = None
    certificate: str = ""
    explanation: str = ""
    follows: int | None = None
    open: OpenPart | None = None


class ResultDocument(OtherAnswer):
    """Everything found out about one system: `answers`, of which the first is what people are shown.

    The fields after them are the older names of the same: the main fields answer `question`.

    They hold, generically, where the inequalities of `domain` hold, L where those of `lagrangian.domain` do; `near` is
    a point of both. One coordinate has a Lagrangian near every point at which f is analytic and, for L(q, q'), q' and
    q'' are not both 0. Where other relations hold elsewhere, `branches` has the answers for all cells, that of the main
    fields first, and `not_answered` the cells without one; `verdict` is `differs` where the cells have different
    verdicts. A statement about constants and functions is about general ones: `exceptions` are the special values and
    functions for which it is not proven, and `left_out` has the equation of each set of them that is known, with its
    answer if it is decided (of functions where no `family` says more).
    `guessed` are names that the document did not declare and asked to be taken as constants (or functions),
    `readings` ({"text": "kx", "as": "k*x"}) what was read otherwise than typed, `ignored` keys
    that are not of documents.
    `kinds` answers what the document asks about kinds of Lagrangians; `instead` is what a system without L(q, q') has.
    With constraints there are also `any_associated`, `reduced` and `nonholonomic`, and the main fields answer the
    associated system `nonholonomic.main`.
    """

    format: Literal["inverse-service/result/1"] = FORMAT
    system: UnderstoodSystem | None
    question: Literal["L(q, q')", "L(t, q, q')"] = "L(q, q')"
    verdict: MainVerdict  # type: ignore[assignment]
    verdict_with_time: MainVerdict | None = None
    answers: list[AnswerPart] = Field(default_factory=list)
    first_integrals: list[FirstIntegralPart] = Field(default_factory=list)
    first_integrals_complete: AllIntegralsPart | None = None
    conditions: ConditionsPart | None = None
    with_time: OtherAnswer | None = None
    branches: list[BranchPart] = Field(default_factory=list)
    not_answered: list[NotAnsweredPart] = Field(default_factory=list)
    left_out: list[LeftOutPart] = Field(default_factory=list)
    family: FamilyPart | None = None
    nearest: list[NearestMember] | None = None
    nearest_not_reached: list[NotReached] = Field(default_factory=list)
    special_cases: SpecialCasesPart | None = None
    kinds: dict[str, KindPart] | None = None
    instead: InsteadPart | None = None
    with_clock: ClockPart | None = None
    advice: AdvicePart | None = None
    guessed: list[str] = Field(default_factory=list)
    readings: list[dict[str, str]] = Field(default_factory=list)
    ignored: list[str] = Field(default_factory=list)
    incomplete: list[IncompletePart] = Field(default_factory=list)
    provenance: dict[str, Any] = Field(default_factory=dict)


class NonholonomicParseAnswer(base.ParseAnswer):
    """What was understood; `equations` are the accelerations of the motion, by the free velocities."""

    lagrangian: base.ParsedFormula
    constraints: list[base.ParsedFormula]


class MotionPart(base.Document):
    """The reduced equations: first order for `dependent` coordinates, second order for `free` ones.

    `accelerations` are those of all coordinates, `multipliers` the lambda_a of d/dt(dL/dv) - dL/dq =
    lambda_a w^a, one for each constraint; all contain the velocities of free coordinates only.
    """

    free: list[str]
    dependent: list[str]
    first_order: dict[str, Formula]
    second_order: dict[str, Formula]
    accelerations: dict[str, Formula]
    multipliers: list[Formula]


class StatedPart(base.Document):
    """What was found, in a sentence; `parts` has its words and formulas alternately."""

    statement: str
    parts: list[str] = Field(default_factory=list)


class IntegrabilityPart(StatedPart):
    """How many of the constraints are holonomic in disguise; `growth` are the ranks of the derived flag."""

    holonomic: bool
    integrable: int
    count: int
    growth: list[int]
    integrals: list[Formula]


class MeasurePart(StatedPart):
    """The invariant measure: `density` N for dq dp, p the momenta of the free velocities; `in_velocities` for dq du."""

    status: Literal["found", "does_not_exist", "not_found"]
    density: Formula | None = None
    in_velocities: Formula | None = None


class ClassPart(StatedPart):
    """Membership of the class s' = -A(r1) r2'; the roles of the coordinates, A, N and K if it is a member."""

    member: bool
    r1: str | None = None
    r2: str | None = None
    s: list[str] = Field(default_factory=list)
    A: dict[str, Formula] = Field(default_factory=dict)
    N: Formula | None = None
    K: Formula | None = None
    potential: bool = False


class AssociatedPart(ProvenPart):
    """One associated second-order system and its answer; `verdict` is null where the kind is not defined."""

    kind: str
    defined: bool
    explanation: str
    equations: dict[str, str] = Field(default_factory=dict)
    latex: dict[str, str] = Field(default_factory=dict)
    verdict: Verdict | None = None  # type: ignore[assignment]
    verdict_with_time: Verdict | None = None
    hamiltonian: HamiltonianPart | None = None
    domain: list[str] = Field(default_factory=list)
    steps: list[ExplanationStep] = Field(default_factory=list)


class StatementPart(base.Document):
    """One part of the claim that the flow of H holds the motion, and what its test said."""

    text: str
    verdict: Literal["holds", "fails", "not settled"]
    parts: list[str] = Field(default_factory=list)


class TrajectoryPart(base.Document):
    """Both flows in floats from one start: largest difference of positions, of the constraints and of H."""

    time: float
    step: float
    parameters: dict[str, float]
    functions: dict[str, str]
    start: dict[str, float]
    difference: float
    constraint: float
    energy: float


class HamiltonisationPart(base.Document):
    """L, H and the constraints in phase space of one Lagrangian of an associated system, with proof.

    `checked` is the independent checker's verdict on the Lagrangian, `holds` says that every statement
    was confirmed.
    """

    associated: str
    label: str
    lagrangian: Formula
    hamiltonian: HamiltonianPart | None
    constraints: list[Formula]
    checked: Checked
    statements: list[StatementPart]
    holds: bool
    trajectory: TrajectoryPart | None = None


class NonholonomicPart(base.Document):
    """Everything found out about a nonholonomic system; `main` names the associated system of the main fields."""

    lagrangian: Formula
    constraints: list[Formula]
    main: str
    equations_of_motion: MotionPart
    integrable: IntegrabilityPart
    measure_density: MeasurePart
    first_integrals: list[FirstIntegralPart]
    paper_class: ClassPart
    associated: list[AssociatedPart]
    hamiltonisation: list[HamiltonisationPart]


class MotionLagrangianPart(LagrangianPart):
    """L on the tangent bundle; along the constraints it is l, its transverse momenta are lambda_a, one a constraint."""

    on_constraints: Formula
    transverse_momenta: list[Formula]


class BelongsTo(base.Document):
    """The associated system that a Lagrangian belongs to; `equations` is empty where it is too long to be solved."""

    kind: str
    equations: dict[str, str] = Field(default_factory=dict)


class AnyAssociatedPart(ProvenPart, StatedPart):
    """Whether any associated system whatsoever has a regular Lagrangian, and so whether the motion has one.

    `certificate` proves `verdict`, and `verdict_with_time` too unless there is `certificate_with_time`; `image` are the
    constraints in phase space, `freedom` says on how many functions L depends along the constraints.
    """

    verdict_with_time: Verdict | None = None
    lagrangian: MotionLagrangianPart | None = None
    associated: BelongsTo | None = None
    hamiltonian: HamiltonianPart | None = None
    image: list[Formula] = Field(default_factory=list)
    freedom: str = ""
    certificate_with_time: dict[str, Any] | None = None
    construction: ExplanationStep | None = None
    explanation: list[ExplanationStep] = Field(default_factory=list)


class ReducedPart(ProvenPart):
    """The equations of the free coordinates alone, where these do not contain the others, and their own answer.

    `reconstruction` gives the velocities of the others, as `statement` says; `steps` prove the answer; `with_clock` is
    the answer with dtau = N dt, N from the invariant measure (Chaplygin), `without_clock` why there is none.
    """

    coordinates: list[str]
    equations: dict[str, str]
    hamiltonian: HamiltonianPart | None = None
    domain: list[str] = Field(default_factory=list)
    reconstruction: dict[str, str]
    statement: str
    steps: list[ExplanationStep] = Field(default_factory=list)
    with_clock: ClockPart | None = None
    without_clock: str = ""


class NonholonomicBranch(BranchPart):
    """The answers about the associated system `nonholonomic.main` and about the motion on one of the branches."""

    any_associated: AnyAssociatedPart | None = None


class NonholonomicResult(ResultDocument):
    """The result of a Nonholonomic document: its main fields answer the associated system `nonholonomic.main`."""

    branches: list[NonholonomicBranch] = Field(default_factory=list)  # type: ignore[assignment]

    nonholonomic: NonholonomicPart | None = None
    any_associated: AnyAssociatedPart | None = None
    reduced: ReducedPart | None = None


FORWARD_FORMAT: Final = "inverse-service/forward/1"


class ForwardParseAnswer(base.ParseAnswer):
    """What was understood; `equations` are the accelerations of the motion."""

    lagrangian: base.ParsedFormula


class ConservedQuantity(Formula):
    """A function that is constant along the motion."""

    name: str


class ForwardResult(base.Document):
    """The equations q'' = f of a Lagrangian, p_i = dL/dv_i, H, and the quantities that its symmetries conserve."""

    format: Literal["inverse-service/forward/1"] = FORWARD_FORMAT
    system: UnderstoodSystem
    lagrangian: Formula
    equations: dict[str, Formula]
    momenta: dict[str, Formula]
    hamiltonian: HamiltonianPart
    conserved: list[ConservedQuantity]
    guessed: list[str] = Field(default_factory=list)
    readings: list[dict[str, str]] = Field(default_factory=list)
    ignored: list[str] = Field(default_factory=list)
