"""The Nonholonomic document, and the part of a result that answers it."""

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from api_schemas import base, result, system

MAX_FAMILIES = 20
Kind = Literal["first", "second", "third", "search", "any"]
Constraints = Annotated[
    Annotated[list[system.Text], Field(min_length=1, max_length=base.MAX_EQUATIONS), Tag("<list>")]
    | Annotated[system.Text, Tag("<text>")],
    Discriminator(system.shape),
]
Multiples = Annotated[dict[system.Name, system.Formula], Field(min_length=1, max_length=base.MAX_COORDINATES)]
Families = Annotated[
    Annotated[Multiples, Tag("<mapping>")]
    | Annotated[list[Multiples], Field(min_length=1, max_length=MAX_FAMILIES), Tag("<list>")],
    Discriminator(system.shape),
]


class NonholonomicDocument(system.QuestionDocument):
    """A Lagrangian with constraints linear in the velocities.

    `constraints`: formulas that are zero, or equations; a list, or one text with semicolons.
    `associated`: which associated system is decided; left out: first, second and third, and whether any is
    variational; "any" asks that alone.
    `multiples`: what is added to the accelerations of the associated system (the first, if none is named), for each
    coordinate a formula that vanishes on the constraints; a list of such objects is a list of systems, each decided.
    "search" and `search`, with which families of associated systems once were gone through, are accepted: since all
    of them are decided at once they ask what leaving `associated` out asks.
    """

    lagrangian: system.Text
    constraints: Constraints
    associated: Kind | None = None
    search: dict[str, Any] | None = None
    multiples: Families | None = None


class MotionDocument(system.QuestionDocument):
    """A motion on constraints as it is: `motion` gives the accelerations of the free coordinates on the constraints.

    The velocities of the other coordinates follow from the constraints, which may be affine and depend on t.
    """

    motion: Multiples
    constraints: Constraints
    associated: Literal["any"] | None = None


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
    first_order: dict[str, result.Formula]
    second_order: dict[str, result.Formula]
    accelerations: dict[str, result.Formula]
    multipliers: list[result.Formula]


class IntegrabilityPart(base.Document):
    """How many of the constraints are holonomic in disguise; `growth` are the ranks of the derived flag."""

    holonomic: bool
    integrable: int
    count: int
    growth: list[int]
    integrals: list[result.Formula]
    statement: str
    parts: list[str] = Field(default_factory=list)


class MeasurePart(base.Document):
    """The invariant measure: `density` N for dq dp, p the momenta of the free velocities; `in_velocities` for dq du."""

    status: Literal["found", "does_not_exist", "not_found"]
    density: result.Formula | None = None
    in_velocities: result.Formula | None = None
    statement: str
    parts: list[str] = Field(default_factory=list)


class ClassPart(base.Document):
    """Membership of the class s' = -A(r1) r2'; the roles of the coordinates, A, N and K if it is a member."""

    member: bool
    statement: str
    parts: list[str] = Field(default_factory=list)
    r1: str | None = None
    r2: str | None = None
    s: list[str] = Field(default_factory=list)
    A: dict[str, result.Formula] = Field(default_factory=dict)
    N: result.Formula | None = None
    K: result.Formula | None = None
    potential: bool = False


class AssociatedPart(base.Document):
    """One associated second-order system and its answer; `verdict` is null where the kind is not defined."""

    kind: str
    defined: bool
    explanation: str
    equations: dict[str, str] = Field(default_factory=dict)
    latex: dict[str, str] = Field(default_factory=dict)
    verdict: result.Verdict | None = None
    verdict_with_time: result.Verdict | None = None
    reason: str = ""
    checked: result.Checked | None = None
    lagrangian: result.LagrangianPart | None = None
    hamiltonian: result.HamiltonianPart | None = None
    certificate: dict[str, Any] | None = None
    domain: list[str] = Field(default_factory=list)
    steps: list[result.ExplanationStep] = Field(default_factory=list)


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
    lagrangian: result.Formula
    hamiltonian: result.HamiltonianPart | None
    constraints: list[result.Formula]
    checked: result.Checked
    statements: list[StatementPart]
    holds: bool
    trajectory: TrajectoryPart | None = None


class NonholonomicPart(base.Document):
    """Everything found out about a nonholonomic system; `main` names the associated system of the main fields."""

    lagrangian: result.Formula
    constraints: list[result.Formula]
    main: str
    equations_of_motion: MotionPart
    integrable: IntegrabilityPart
    measure_density: MeasurePart
    first_integrals: list[result.FirstIntegralPart]
    paper_class: ClassPart
    associated: list[AssociatedPart]
    hamiltonisation: list[HamiltonisationPart]


class MotionLagrangianPart(result.LagrangianPart):
    """L on the tangent bundle; along the constraints it is l, its transverse momenta are lambda_a, one a constraint."""

    on_constraints: result.Formula
    transverse_momenta: list[result.Formula]


class BelongsTo(base.Document):
    """The associated system that a Lagrangian belongs to; `equations` is empty where it is too long to be solved."""

    kind: str
    equations: dict[str, str] = Field(default_factory=dict)


class AnyAssociatedPart(base.Document):
    """Whether any associated system whatsoever has a regular Lagrangian, and so whether the motion has one.

    `certificate` proves `verdict`, and `verdict_with_time` too unless there is `certificate_with_time`; `image` are the
    constraints in phase space, `freedom` says on how many functions L depends along the constraints.
    """

    statement: str
    parts: list[str] = Field(default_factory=list)
    verdict: result.Verdict
    verdict_with_time: result.Verdict
    reason: str = ""
    checked: result.Checked | None = None
    lagrangian: MotionLagrangianPart | None = None
    associated: BelongsTo | None = None
    hamiltonian: result.HamiltonianPart | None = None
    image: list[result.Formula] = Field(default_factory=list)
    freedom: str = ""
    certificate: dict[str, Any] | None = None
    certificate_with_time: dict[str, Any] | None = None
    exceptions: list[str] = Field(default_factory=list)
    explanation: list[result.ExplanationStep] = Field(default_factory=list)


class ReducedPart(base.Document):
    """The equations of the free coordinates alone, where these do not contain the others, and their own answer.

    `reconstruction` gives the velocities of the others, as `statement` says; `with_clock` is the answer with
    dtau = N dt, N from the invariant measure (Chaplygin), `without_clock` why there is none.
    """

    coordinates: list[str]
    equations: dict[str, str]
    verdict: result.Verdict
    lagrangian: result.LagrangianPart | None = None
    hamiltonian: result.HamiltonianPart | None = None
    certificate: dict[str, Any] | None = None
    checked: result.Checked | None = None
    reason: str = ""
    domain: list[str] = Field(default_factory=list)
    reconstruction: dict[str, str]
    statement: str
    with_clock: result.ClockPart | None = None
    without_clock: str = ""


class NonholonomicBranch(result.BranchPart):
    """The answers about the associated system `nonholonomic.main` and about the motion on one of the branches."""

    any_associated: AnyAssociatedPart | None = None


class NonholonomicResult(result.ResultDocument):
    """The result of a Nonholonomic document: its main fields answer the associated system `nonholonomic.main`."""

    branches: list[NonholonomicBranch] = Field(default_factory=list)  # type: ignore[assignment]

    nonholonomic: NonholonomicPart | None = None
    any_associated: AnyAssociatedPart | None = None
    reduced: ReducedPart | None = None
