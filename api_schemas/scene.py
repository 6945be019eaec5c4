"""The Scene document: a system, its initial data, the methods to run and the quantities to observe."""

from decimal import Decimal
from math import isfinite
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, StringConstraints, Tag

from api_schemas import base
from api_schemas.system import TAGS, Name, SystemDocument, Value, number_as_text, shape

MAX_STEPS = 100_000_000
MAX_METHODS = 24
LongText = Annotated[
    str,
    StringConstraints(min_length=1, max_length=base.LONGER_IN_SCENES * base.MAX_FORMULA_CHARACTERS),
]
LongFormula = Annotated[
    LongText, BeforeValidator(number_as_text, json_schema_input_type=str | float)
]
LongEquations = Annotated[
    Annotated[dict[Name, LongFormula], Field(max_length=base.MAX_SIMULATED), Tag(TAGS[0])]
    | Annotated[list[LongText], Field(min_length=1, max_length=base.MAX_SIMULATED), Tag(TAGS[1])]
    | Annotated[LongText, Tag(TAGS[2])],
    Discriminator(shape),
]
MAX_EFFECTS = 32
MAX_STEP_SIZES = 40
MAX_EVENTS = 16
MAX_CONTACTS = 64
MAX_MEMBERS = 1_000_000

MethodName = Literal[
    "variational", "nonholonomic", "modified", "exact", "reference", "runge-kutta", "stormer-verlet", "adaptive",
    "stiff", "heyoka",
]  # fmt: skip
Observed = Literal[  # in the order of display
    "trajectory", "velocities", "energy", "constraints", "momenta", "matching_circle", "phase", "error", "cost",
    "lyapunov", "constraint_forces", "contact_forces", "period", "action", "energy_parts",
]  # fmt: skip
Beginning = Literal["momenta", "discrete_constraint"]
Numbers = Annotated[dict[Name, Value], Field(max_length=base.MAX_PARAMETERS)]
Observable = Annotated[
    Annotated[Observed, Tag("quantity")]
    | Annotated[dict[Name, LongFormula], Field(max_length=16), Tag("formulas")],
    Discriminator(lambda value: "formulas" if isinstance(value, dict) else "quantity"),
]
SYSTEM_TAGS = ("catalogue", "document", "result", "inline")


def _trajectory() -> list[Any]:
    return ["trajectory"]


def _method_name(value: Any) -> Any:
    return value.replace("_", "-") if isinstance(value, str) else value


def _method_entry(value: Any) -> Any:
    return {"method": value} if isinstance(value, str) else value


def _whole(value: Any) -> Any:
    """An integer written as text, as YAML gives it, or as 2000.0."""
    if isinstance(value, str) and value.isascii() and value.isdigit() and len(value) < 12:
        return int(value)
    whole = isinstance(value, float | Decimal) and isfinite(value) and value == int(value)
    return int(value) if whole else value


def _kind_of_system(value: Any) -> str:
    keys = value if isinstance(value, dict) else {}
    return next((tag for tag in SYSTEM_TAGS[:3] if tag in keys), "inline")


class CatalogueSystem(base.Document):
    """A system by its name in the catalogue."""

    catalogue: Annotated[str, StringConstraints(min_length=1, max_length=base.MAX_TITLE_CHARACTERS)]


class DocumentSystem(base.Document):
    """A system as a document: a nonholonomic system, a Lagrangian, or second-order equations."""

    document: dict[str, Any]


class ResultSystem(base.Document):
    """A system with the Lagrangian that `solve` found for it."""

    result: dict[str, Any]


SceneSystem = Annotated[
    Annotated[CatalogueSystem, Tag("catalogue")]
    | Annotated[DocumentSystem, Tag("document")]
    | Annotated[ResultSystem, Tag("result")]
    | Annotated[dict[str, Any], Tag("inline")],
    Discriminator(_kind_of_system),
]


class LagrangianDocument(base.Document):
    """A system by its Lagrangian, with or without constraints on the velocities."""

    name: Annotated[str, StringConstraints(max_length=base.MAX_TITLE_CHARACTERS)] = ""
    coordinates: Annotated[list[Name], Field(min_length=1, max_length=base.MAX_SIMULATED)]
    lagrangian: LongFormula
    constraints: (
        Annotated[list[LongFormula], Field(max_length=base.MAX_SIMULATED)] | LongFormula
    ) = Field(default_factory=list)
    parameters: (
        Annotated[dict[Name, Value | None], Field(max_length=base.MAX_PARAMETERS)]
        | Annotated[list[Name], Field(max_length=base.MAX_PARAMETERS)]
    ) = Field(default_factory=list)
    functions: Annotated[dict[Name, list[Name]], Field(max_length=base.MAX_FUNCTIONS)] = Field(
        default_factory=dict
    )
    where: Annotated[dict[Name, LongFormula], Field(max_length=base.MAX_PARAMETERS)] = Field(
        default_factory=dict
    )
    associated: Any = None
    time_dependent_lagrangian: bool | None = None


class EquationsDocument(SystemDocument):
    """A system by its equations of motion, of the size of scenes."""

    coordinates: (
        Annotated[list[Name], Field(min_length=1, max_length=base.MAX_SIMULATED)] | None
    ) = None
    equations: LongEquations
    where: Annotated[dict[Name, LongText], Field(max_length=base.MAX_PARAMETERS)] = Field(
        default_factory=dict
    )


class SettingAction(base.Document):
    """Values that positions and velocities get, by formulas of the state before: {"y'": "-0.8*y'"}."""

    set: Annotated[dict[str, LongFormula], Field(min_length=1, max_length=2 * base.MAX_SIMULATED)]


class SceneEvent(base.Document):
    """What is found along a motion: zeros of `when`, a formula or "formula = 0".

    `direction`: rising (1), falling (-1) or both (0); `do`: "record" keeps the point, "stop" ends the run there,
    {"set": {"y'": "-0.8*y'"}} changes the state. `count`: the run ends when it has happened so often.
    """

    when: LongFormula
    direction: Literal[-1, 0, 1] = 0
    do: Literal["record", "stop"] | SettingAction = "record"
    count: Annotated[int, Field(ge=1, le=100_000), BeforeValidator(_whole)] | None = None


class SceneContact(base.Document):
    """Bodies that touch but do not penetrate: `gap`(t, q) >= 0. `restitution` from 0 to 1: the velocity of the gap
    after an impact is -restitution times that before. With `friction`, `slides` is the sliding velocity, linear in the
    velocities. `name`: "contact_1" if left out.
    """

    name: Name | None = None
    gap: LongFormula
    restitution: Value | None = None
    friction: Value | None = None
    slides: LongFormula | None = None


class SceneInitial(base.Document):
    """Initial data. Velocities that the constraints determine may be left out.

    `project`: put velocities that violate the constraints on them (orthogonally in the kinetic energy).
    """

    positions: Annotated[dict[Name, Value], Field(max_length=base.MAX_SIMULATED)]
    velocities: Annotated[dict[Name, Value], Field(max_length=base.MAX_SIMULATED)] | None = None
    momenta: Annotated[dict[Name, Value], Field(max_length=base.MAX_SIMULATED)] | None = None
    project: bool = False


Column = Annotated[list[Value], Field(min_length=1, max_length=MAX_MEMBERS)]


class MemberColumns(base.Document):
    """Starts of an ensemble as columns of one length; what is left out is as in the scene."""

    positions: Annotated[dict[Name, Column], Field(max_length=base.MAX_SIMULATED)] = Field(
        default_factory=dict
    )
    velocities: Annotated[dict[Name, Column], Field(max_length=base.MAX_SIMULATED)] = Field(
        default_factory=dict
    )


Starts = Annotated[
    Annotated[MemberColumns, Tag("columns")]
    | Annotated[list[SceneInitial], Field(min_length=1, max_length=MAX_MEMBERS), Tag("list")],
    Discriminator(lambda value: "list" if isinstance(value, list) else "columns"),
]


class SceneEnsemble(base.Document):
    """Many runs at once: starts, and lists of values of parameters, of which all combinations are run."""

    initial: Starts | None = None
    parameters: Annotated[dict[Name, Column], Field(max_length=base.MAX_PARAMETERS)] = Field(
        default_factory=dict
    )


class SceneMethod(base.Document):
    """A method with its settings; those left out have the defaults of the method.

    `alpha` in [0, 1], default 1/2; `order` 2, or 4, 6, 8 by composition (runge-kutta: its own); `form` of the
    variational method; `start`: from momenta, or with q_1 on the discrete constraint; `guard`: false continues where
    the equations of a step may have other roots; `tolerance` of adaptive, stiff and heyoka.
    """

    method: Annotated[MethodName, BeforeValidator(_method_name)]
    alpha: Value | None = None
    symmetrised: bool = False
    order: Annotated[int, Field(ge=1, le=32), BeforeValidator(_whole)] | None = None
    form: Literal["hamiltonian", "raw"] = "hamiltonian"
    guard: bool = True
    tolerance: Value | None = None
    start: Beginning | None = None
    free_lagrangian: LongText | None = None
    constants: Numbers | None = None
    label: Annotated[str, StringConstraints(max_length=base.MAX_TITLE_CHARACTERS)] = ""


Methods = Annotated[
    list[
        Annotated[
            SceneMethod,
            BeforeValidator(_method_entry, json_schema_input_type=MethodName | SceneMethod),
        ]
    ],
    Field(min_length=1, max_length=MAX_METHODS),
]


class SceneDocument(base.Document):
    """What to simulate. What a scene does not name is neither derived, compiled nor computed.

    `effects`: the parts of the Lagrangian that act, of "constraints", "potential", "magnetic" and the names of
    `terms`; left out, all of them. `terms`: further terms of L by name; `as_lagrangian`: one of them may be called
    friction or drag. `functions`: formulas for the arbitrary functions of the system. `step` and `steps`, or `step` and
    `time` (the length of time). `free_lagrangian`: L~ as a formula, or "first", "second" or "third" for that associated
    system; `constants`: its free constants. `circle`: the two coordinates whose path is matched by circles.
    `points`: bodies and their places in a plane, {"bob": ["l*sin(a)", "-l*cos(a)"]}.
    `units`: of coordinates, velocities (v_x), momenta (p_x), the time and observables, for labels and files.
    `step_sizes`: those of `work-precision`; `long`: it measures a hundred times the time too.
    `forces`: further forces Q(t, q, q') by coordinate; `rayleigh`: a function R of which -dR/dq' is a force.
    `observe` takes formulas by name too. `restart`: the result of a scene that ends where this one begins.
    `methods` left out: adaptive; in `work-precision` those that suit the system.
    """

    name: Annotated[str, StringConstraints(max_length=base.MAX_TITLE_CHARACTERS)] = ""
    system: SceneSystem
    parameters: Numbers = Field(default_factory=dict)
    functions: Annotated[dict[Name, LongFormula], Field(max_length=base.MAX_FUNCTIONS)] = Field(
        default_factory=dict
    )
    effects: Annotated[list[Name], Field(max_length=MAX_EFFECTS)] | None = None
    terms: Annotated[dict[Name, LongFormula], Field(max_length=MAX_EFFECTS)] = Field(
        default_factory=dict
    )
    as_lagrangian: bool = False
    forces: Annotated[dict[Name, LongFormula], Field(max_length=base.MAX_SIMULATED)] = Field(
        default_factory=dict
    )
    rayleigh: LongFormula | None = None
    initial: SceneInitial | None = None
    restart: dict[str, Any] | None = None
    start_time: Value | None = None
    step: Value
    steps: Annotated[int, Field(ge=1, le=MAX_STEPS), BeforeValidator(_whole)] | None = None
    time: Value | None = None
    record_every: Annotated[int, Field(ge=1, le=MAX_STEPS), BeforeValidator(_whole)] | None = None
    methods: Methods = Field(default_factory=list)
    observe: Annotated[list[Observable], Field(max_length=32)] = Field(default_factory=_trajectory)
    events: Annotated[list[SceneEvent], Field(max_length=MAX_EVENTS)] = Field(default_factory=list)
    contacts: Annotated[list[SceneContact], Field(max_length=MAX_CONTACTS)] = Field(
        default_factory=list
    )
    ensemble: SceneEnsemble | None = None
    start: Beginning = "momenta"
    free_lagrangian: LongText | None = None
    constants: Numbers = Field(default_factory=dict)
    points: Annotated[
        dict[Name, Annotated[list[LongFormula], Field(min_length=2, max_length=2)]],
        Field(max_length=base.MAX_SIMULATED),
    ] = Field(default_factory=dict)
    circle: Annotated[list[Name], Field(min_length=2, max_length=2)] | None = None
    units: Annotated[dict[Name, Name], Field(max_length=64)] = Field(default_factory=dict)
    step_sizes: Annotated[list[Value], Field(min_length=1, max_length=MAX_STEP_SIZES)] | None = None
    repeats: Annotated[int, Field(ge=1, le=50), BeforeValidator(_whole)] = 5
    long: bool = False
