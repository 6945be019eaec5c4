"""What all documents have in common: strictness, sizes, problem documents (RFC 9457), and small answers.

Formulas have further limits where they are read.
"""

from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

MAX_COORDINATES = 64
MAX_SIMULATED = 256  # coordinates of a scene
MAX_FORWARD = 256  # coordinates of a Lagrangian whose equations are asked for
MAX_PARAMETERS = 100
MAX_FUNCTIONS = 16
MAX_FUNCTION_ARGUMENTS = 6
MAX_NAME_CHARACTERS = 40
MAX_TITLE_CHARACTERS = 500
MAX_FORMULA_CHARACTERS = 20_000
LONGER_IN_SCENES = 10  # times as long: a Lagrangian of 60 bodies has 84,000 characters
MAX_EQUATIONS = 128
MAX_VALUE_CHARACTERS = 200

# Why something is open, for programs; "" if it is not, or if that is known in words only.
ReasonCode = Literal[
    "",
    "time",
    "size",
    "irreducible",
    "check",
    "search",
    "not_asked",
    "not_yet",
    "no_point",
    "many_cells",
    "unconnected",
    "beyond",
    "outside_domain",
    "unsolved",
    "stopped",
    "fault",
]

CHECK_FORMAT: Final = "inverse-service/check/1"


class Document(BaseModel):
    """Frozen, no unknown keys, no silent change of types."""

    # Built at the first use: a single call needs few of them, and all take 0.02 s.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)


class ProblemPlace(Document):
    """One fault: RFC 6901 pointer, column from 1 in the string there, and what to write instead.

    `instead` lists texts, each of which may have been meant in the place of the name at the column, or of
    the text from the first column of `span` up to the second. `plain` is the sentence without the column and
    without the way of declaring a name, which `declare` says: the member of the document that would hold it.
    """

    pointer: str
    column: int | None = None
    detail: str
    instead: list[str] = Field(default_factory=list)
    span: list[int] | None = None
    plain: str | None = None
    declare: str | None = None


class ProblemDocument(Document):
    """`type` is stable and names the kind of problem; raw input is never part of the text."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[ProblemPlace] = Field(default_factory=list)


class ParsedFormula(Document):
    """A formula in the three written forms."""

    text: str
    latex: str
    mathml: str


class ParseAnswer(Document):
    """What was understood: each acceleration, and the names by what they stand for; `guessed` were not declared.

    `readings`: {"text": "kx", "as": "k*x"} for what was read otherwise than typed.
    """

    name: str
    coordinates: list[str]
    parameters: list[str]
    functions: dict[str, list[str]]
    equations: dict[str, ParsedFormula]
    depends_on_time: bool
    guessed: list[str] = Field(default_factory=list)
    readings: list[dict[str, str]] = Field(default_factory=list)


class ProvenStatement(Document):
    """What the checker proved, in its own words; parts that were not proven are left out.

    `domain` and `near` say where: `near` is a point of the set. `lagrangian_domain` is where L is one, if that is less.
    With several cells the main fields are about the first.
    """

    system: dict[str, Any]
    question: str
    verdict: str
    domain: list[str] = Field(default_factory=list)
    near: dict[str, str] = Field(default_factory=dict)
    lagrangian: str | None = None
    lagrangian_domain: list[str] | None = None
    hamiltonian: str | None = None
    hamiltonian_domain: list[str] | None = None
    momenta: dict[str, str] | None = None
    exceptions: list[str] | None = None
    text: str
    latex: str


class CheckedCell(Document):
    """A set on which a claim was judged; `at` is a point where a Lagrangian fails, with both accelerations there."""

    domain: list[str]
    near: dict[str, str] = Field(default_factory=dict)
    verdict: str
    at: dict[str, str] | None = None
    accelerations: dict[str, dict[str, str]] | None = None


class Contradiction(Document):
    """A field of a result (a JSON pointer) that does not say what is proven."""

    field: str
    says: Any = None
    proven: str


class CheckAnswer(Document):
    """The independent checker's verdict on a result, or on a Lagrangian of the user for given equations.

    `statement` is what was proven. `not_checked` has JSON pointers of what a result says and nothing was compared with.
    Of one's own Lagrangian, `residual` has d/dt(dL/dq') - dL/dq along the equations for each coordinate, all zero where
    L is right, and `equations` the accelerations that L gives instead where it is regular and wrong; `differs`: it is
    right on some cells and wrong on others.
    """

    format: Literal["inverse-service/check/1"] = CHECK_FORMAT
    verdict: Literal["valid", "incomplete", "invalid", "differs"]
    statement: ProvenStatement | None = None
    cells: list[CheckedCell] = Field(default_factory=list)
    contradictions: list[Contradiction] = Field(default_factory=list)
    not_checked: list[str] = Field(default_factory=list)
    reasons: list[str]
    residual: dict[str, dict[str, str]] | None = None
    equations: dict[str, dict[str, str]] | None = None


class LimitsAnswer(Document):
    """Every limit that a refusal can name; seconds, MiB, bytes, counts."""

    document: dict[str, int]
    formula: dict[str, int]
    service: dict[str, float]


class CatalogueLine(Document):
    """One line of the list of named systems."""

    name: str
    title: str
    group: str = ""


class CatalogueEntry(CatalogueLine):
    """One named system with what is known about it."""

    source: str = ""
    document: dict[str, Any]
    expected: dict[str, Any] = Field(default_factory=dict)


class CatalogueList(Document):
    """All named systems."""

    systems: list[CatalogueLine]
