"""The documents that ask: q'' = f(t, q, q') in any form of the contract; Lagrangians with constraints, or without."""

import json
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, StringConstraints, Tag

from api_schemas import base

MAX_ANSATZ_TERMS = 50
MAX_KINDS = 12
MAX_FAMILIES = 20
MAX_COEFFICIENTS = 240  # of a fitted system
# Beyond this order the series of a multiplier fills pages.
MAX_SERIES_ORDER = 8
TAGS = ("<mapping>", "<list>", "<text>")


def shape(value: Any) -> str | None:
    """Which of the forms a value has; tells pydantic which one to complain about."""
    if isinstance(value, dict | base.Document):
        return "<mapping>"
    if isinstance(value, list | tuple):
        return "<list>"
    return "<text>" if isinstance(value, str) else None


def shape_of_numbers(value: Any) -> str | None:
    """Which of the forms numbers have; a single one is a text."""
    is_number = isinstance(value, int | Decimal | float) and not isinstance(value, bool)
    return "<text>" if is_number else shape(value)


def number_as_text(value: Any) -> Any:
    """A JSON number as the text it was written with; numbers stay exact that way."""
    is_number = isinstance(value, int | Decimal | float) and not isinstance(value, bool)
    return str(value) if is_number else value


Name = Annotated[str, StringConstraints(min_length=1, max_length=base.MAX_NAME_CHARACTERS)]
Formula = Annotated[
    str,
    StringConstraints(min_length=1, max_length=base.MAX_FORMULA_CHARACTERS),
    BeforeValidator(number_as_text, json_schema_input_type=str | float),
]
Text = Annotated[str, StringConstraints(min_length=1, max_length=base.MAX_FORMULA_CHARACTERS)]
Value = Annotated[
    str,
    StringConstraints(min_length=1, max_length=base.MAX_VALUE_CHARACTERS),
    BeforeValidator(number_as_text, json_schema_input_type=str | float),
]
Equations = Annotated[
    Annotated[dict[Name, Formula], Field(max_length=base.MAX_COORDINATES), Tag("<mapping>")]
    | Annotated[list[Text], Field(min_length=1, max_length=base.MAX_EQUATIONS), Tag("<list>")]
    | Annotated[Text, Tag("<text>")],
    Discriminator(shape),
]
Parameters = Annotated[
    Annotated[dict[Name, Value | None], Field(max_length=base.MAX_PARAMETERS), Tag("<mapping>")]
    | Annotated[list[Name], Field(max_length=base.MAX_PARAMETERS), Tag("<list>")]
    | Annotated[Literal["guess"], Tag("<text>")],
    Discriminator(shape),
]
Arguments = Annotated[list[Name], Field(min_length=1, max_length=base.MAX_FUNCTION_ARGUMENTS)]


class NamedDocument(base.Document):
    """What every document says of its names.

    `coordinates`: left out, they are the names with derivatives in the formulas, or the keys of `equations`.
    `parameters`: a list of names, or an object with values (null leaves one generic); "guess", or a name "..."
       in addition to the others, takes names that are not declared as constants and lists them in `guessed`.
    `functions`: arbitrary functions, each with the coordinates it depends on.
    `where`: names that stand for a formula, which is put in exactly: {"r": "sqrt(x^2 + y^2)"}.
    """

    name: Annotated[str, StringConstraints(max_length=base.MAX_TITLE_CHARACTERS)] = ""
    coordinates: (
        Annotated[list[Name], Field(min_length=1, max_length=base.MAX_COORDINATES)] | None
    ) = None
    parameters: Parameters = Field(default_factory=list)
    functions: Annotated[dict[Name, Arguments], Field(max_length=base.MAX_FUNCTIONS)] = Field(
        default_factory=dict
    )
    where: Annotated[dict[Name, Text], Field(max_length=base.MAX_PARAMETERS)] = Field(
        default_factory=dict
    )


class FamilyNames(base.Document):
    """The constants and functions that are free in a family; what is left out is fixed, and general."""

    letters: Annotated[list[Name], Field(max_length=base.MAX_PARAMETERS)] = Field(
        default_factory=list
    )
    functions: Annotated[dict[Name, Arguments], Field(max_length=base.MAX_FUNCTIONS)] = Field(
        default_factory=dict
    )


class QuestionDocument(NamedDocument):
    """What can be asked about a system.

    `time_dependent_lagrangian`: false asks for L(q, q'), true for L(t, q, q'), left out: both.
    `ansatz`: terms such as "y'^2/x'" that a Lagrangian is first looked for in.
    `series_order`: the order of the power series given where no closed form is found.
    `family`: also find which members of a family have a Lagrangian: true for all constants and functions, or those
    named, as in {"letters": ["a", "b"], "functions": {"V": ["x", "y"]}}.
    `special_cases`: true means the same as "family": true.
    `first_integrals`: false leaves out what is constant along the motion.
    """

    time_dependent_lagrangian: bool | None = None
    ansatz: Annotated[list[Text], Field(max_length=MAX_ANSATZ_TERMS)] = Field(default_factory=list)
    series_order: Annotated[int, Field(ge=1, le=MAX_SERIES_ORDER, strict=True)] | None = None
    family: bool | FamilyNames = False
    special_cases: bool = False
    first_integrals: bool = True


# The kinds of Lagrangians that may be asked about, and what each is called where people read it.
KINDS_OF_LAGRANGIANS: dict[str, str] = json.loads(
    (Path(__file__).parent / "kinds.json").read_text(encoding="utf-8")
)
if TYPE_CHECKING:
    KindName = str
else:
    KindName = Literal[tuple(KINDS_OF_LAGRANGIANS)]


VectorField = Annotated[
    Annotated[
        dict[Name, Formula], Field(min_length=1, max_length=base.MAX_COORDINATES), Tag("<mapping>")
    ]
    | Annotated[Name, Tag("<text>")],
    Discriminator(shape),
]


class InvariantKind(base.Document):
    """Lagrangians that are invariant: under translations along coordinates ("x"), and along vector fields."""

    invariant: Annotated[list[VectorField], Field(min_length=1, max_length=MAX_KINDS)]


Kind = Annotated[
    Annotated[InvariantKind, Tag("<mapping>")] | Annotated[KindName, Tag("<text>")],
    Discriminator(shape),
]


Measure = Annotated[
    Annotated[dict[Name, Value], Field(max_length=MAX_COEFFICIENTS), Tag("<mapping>")]
    | Annotated[list[Value], Field(min_length=1, max_length=MAX_COEFFICIENTS), Tag("<list>")]
    | Annotated[Value, Tag("<text>")],
    Discriminator(shape_of_numbers),
]
Library = Annotated[
    Annotated[
        dict[Name, Annotated[list[Text], Field(max_length=MAX_COEFFICIENTS)]],
        Field(max_length=base.MAX_COORDINATES),
        Tag("<mapping>"),
    ]
    | Annotated[list[Text], Field(max_length=MAX_COEFFICIENTS), Tag("<list>")],
    Discriminator(shape),
]


class NearestQuestion(base.Document):
    """How the distance of a fitted system from those with a Lagrangian is measured, and what may be changed.

    The coefficients are the parameters with values, {"a": "0.31"}, or where there are none the numbers before the terms
    of the equations, which are called "x'': x*y" after the equation and the term.
    `errors`: the standard error of each coefficient, or one number for all; `weights`: the factors of the squares of
    the changes; `covariance`: a matrix, in the order of `coefficients`. Without any of these, changes are relative to
    the sizes of the coefficients. `library`: terms that may be used besides those of the equations, for all of them or
    by coordinate. `nice`: also offer members with simple fractions.
    """

    errors: Measure | None = None
    weights: Measure | None = None
    covariance: (
        Annotated[list[list[Value]], Field(min_length=1, max_length=MAX_COEFFICIENTS)] | None
    ) = None
    coefficients: Annotated[list[Text], Field(max_length=MAX_COEFFICIENTS)] = Field(
        default_factory=list
    )
    library: Library = Field(default_factory=list)
    nice: bool = False


class SystemDocument(QuestionDocument):
    """A second-order system as users write it.

    `equations`: an object with each acceleration, a list or a text of whole equations; first-order pairs
    x' = h, p' = F, with h affine in p and solvable for it, are turned into second-order equations.
    `clock`: N(q) in dtau = N dt: is there a Lagrangian with this clock? "search" tries factors of f.
    `kinds`: which kinds of Lagrangians are asked about: "natural" (T + A v - V), "riemannian" (T alone), "finsler"
    (homogeneous of degree 2 in the velocities), "positive_definite" (a definite Hessian at a real point), "rayleigh"
    (natural, with friction D quadratic in the velocities), {"invariant": ["x", {"x": "-y", "y": "x"}]}.
    `near`: that point, {"x": "1", "x'": 0, "k": 2}; what it does not name is chosen.
    `nearest`: the systems with a Lagrangian that are nearest to this one, whose numbers were fitted: true, or with
    their errors, {"errors": {"a": "0.02"}}.
    """

    equations: Equations
    clock: Text | None = None
    kinds: Annotated[list[Kind], Field(max_length=MAX_KINDS)] = Field(default_factory=list)
    near: Annotated[dict[Name, Value], Field(max_length=base.MAX_PARAMETERS)] = Field(
        default_factory=dict
    )
    nearest: Annotated[
        Annotated[NearestQuestion, Tag("<mapping>")] | Annotated[bool, Tag("<text>")],
        Discriminator(lambda value: "<mapping>" if shape(value) == "<mapping>" else "<text>"),
    ] = False


Associated = Literal["first", "second", "third", "search", "any"]
Constraints = Annotated[
    Annotated[list[Text], Field(min_length=1, max_length=base.MAX_EQUATIONS), Tag("<list>")]
    | Annotated[Text, Tag("<text>")],
    Discriminator(shape),
]
Multiples = Annotated[dict[Name, Formula], Field(min_length=1, max_length=base.MAX_COORDINATES)]
Families = Annotated[
    Annotated[Multiples, Tag("<mapping>")]
    | Annotated[list[Multiples], Field(min_length=1, max_length=MAX_FAMILIES), Tag("<list>")],
    Discriminator(shape),
]


class NonholonomicDocument(QuestionDocument):
    """A Lagrangian with constraints linear in the velocities.

    `constraints`: formulas that are zero, or equations; a list, or one text with semicolons.
    `associated`: which associated system is decided; left out: first, second and third, and whether any is
    variational; "any" asks that alone.
    `multiples`: what is added to the accelerations of the associated system (the first, if none is named), for each
    coordinate a formula that vanishes on the constraints; a list of such objects is a list of systems, each decided.
    "search" and `search`, with which families of associated systems once were gone through, are accepted: since all
    of them are decided at once they ask what leaving `associated` out asks.
    """

    lagrangian: Text
    constraints: Constraints
    associated: Associated | None = None
    search: dict[str, Any] | None = None
    multiples: Families | None = None


class MotionDocument(QuestionDocument):
    """A motion on constraints as it is: `motion` gives the accelerations of the free coordinates on the constraints.

    The velocities of the other coordinates follow from the constraints, which may be affine and depend on t.
    """

    motion: Multiples
    constraints: Constraints
    associated: Literal["any"] | None = None


class LagrangianDocument(NamedDocument):
    """A Lagrangian L(t, q, q') alone: its equations of motion, momenta and Hamiltonian are asked for."""

    coordinates: Annotated[list[Name], Field(min_length=1, max_length=base.MAX_FORWARD)] | None = (
        None
    )
    lagrangian: Text
