"""The entry points of the independent checker of certificates.

FORMAT.md in this directory says what is checked, and why that is sufficient. The package imports
nothing of the project, draws its own points, primes, and directions, and never searches or repairs.
It is the only module that the rest of the project imports, and the names above its first function
are those that others use. Read the modules in this order: `checker` (here), `question` (the
checks), `formulas` (the grammar), `series` (Taylor series and elimination), `numbers` (residues
modulo a prime, which prove that a value is zero, and balls, which prove that it is not), `cell` and
`exceptions` (where a claim is valid), `tape` (what is read again at other points); `kinds` and
`constraints` are questions of other forms; `given` and `stated_claims` compare a claim with
equations as given and with what else a result states.
"""

import json
import re
from collections.abc import Callable
from functools import partial
from typing import Any

from . import conserved, family
from .cell import Cell as Cell, cells_of
from .conserved import FORMAT as FORMAT_OF_INTEGRALS, MAX_DEGREE as MAX_DEGREE
from .constraints import Along, Motion
from .exceptions import (
    Exceptions,
    Values,
    exceptions_of,
    in_general as in_general,
    not_found as not_found,
    read_exceptions as read_exceptions,
)
from .family import FORMAT as FORMAT_OF_FAMILIES, text_of as condition_text
from .formulas import (
    CERTIFICATE,
    FORMAT as FORMAT,
    MAX_MEMBERS as MAX_MEMBERS,
    MAX_POWER as MAX_POWER,
    MAX_TEXT as MAX_TEXT,
    OLD,
    OLD_FORMAT as OLD_FORMAT,
    RESULT_FORMAT as RESULT_FORMAT,
    TEXT as TEXT,
    Ended as Ended,
    Incomplete as Incomplete,
    OutOfTime,
    check_shape as check_shape,
    read_tokens as read_tokens,
    require as require,
)
from .given import (
    against_lines as against_lines,
    applied as applied,
    examined as examined,
    forces as forces,
    is_irrational as is_irrational,
    real_power as real_power,
    second_reading as second_reading,
)
from .judging import CheckResult as CheckResult, judged as judged
from .kinds import KINDS as KINDS, Definite, OfKind, named as kind_named
from .numbers import Undefined as Undefined, Unsettled
from .question import Question, Tools
from .stated_claims import (
    judge_hamiltonian as judge_hamiltonian,
    lacking_members as lacking_members,
    momenta_of as momenta_of,
    narrowed as narrowed,
)

__all__ = ["FORMAT_OF_FAMILIES", "FORMAT_OF_INTEGRALS", "condition_text", "kind_named"]

FORMULAS = (
    "lagrangian",
    "integrals",
    "factors",
    "conditions",
    "roots",
    "dissipation",
)  # the keys that hold formulas


def check_certificate(
    certificate: object, time_limit: float = 60.0, seed: int | None = None
) -> CheckResult:
    """The verdict on a certificate; never raises. `seed` makes the random choices repeatable."""
    proven = list[CheckResult]()

    def work(tools: Tools) -> tuple[str, ...]:
        proven.append(certified(certificate, tools))
        return proven[0].reasons

    found = judged(work, time_limit, seed)
    return proven[0] if found.verdict == "valid" else found


def check_text(text: str, time_limit: float = 60.0, seed: int | None = None) -> CheckResult:
    """The verdict on the JSON text of a certificate; never raises."""

    def members(pairs: list[tuple[str, object]]) -> dict[str, object]:
        if len(dict(pairs)) < len(pairs):
            raise ValueError
        return dict(pairs)

    try:  # int("NaN") is a ValueError
        document = json.loads(text, object_pairs_hook=members, parse_constant=int)
    except (ValueError, TypeError, RecursionError):
        reason = "The text is not a JSON document, repeats a key, or is nested too deeply."
        return CheckResult("invalid", (reason,))
    return check_certificate(document, time_limit, seed)


def certified(document: Any, tools: Tools) -> CheckResult:
    """The statement that a certificate proves, with the cell and exceptions of its claim, or Ended.

    On return, the document has the shape of FORMAT.md, its claim is the one that its kind proves,
    and the method of the question named after the kind has returned.
    """
    if isinstance(document, dict) and document.get("format") == conserved.FORMAT:
        return CheckResult("valid", (conserved.complete_integrals(document, tools),))
    if isinstance(document, dict) and document.get("format") == family.FORMAT:
        return CheckResult("valid", tuple(family.complete_family(document, tools.deadline)))
    asked, sentence = proven_question(document, tools)
    kind, among = document["kind"], document.get("among")
    one = len(asked.coordinates) == 1 and type(asked) is Question
    cell, formulas = cells_of(asked, one and not asked.unsolved)
    by_theorem = one and (kind == "existence" or cell != formulas)
    # A definite Hessian is proven at the point `near`, for its parameter values; a theorem has no
    # exceptions.
    generic = (
        None if (one and kind == "existence") or isinstance(asked, Definite) else asked.generic
    )
    exceptions = Exceptions(
        partial(exceptions_of, asked, generic, partial(fails_at, document, tools))
    )
    meant = f" Only Lagrangians of a kind are meant: {among}." if among is not None else ""
    return CheckResult("valid", (sentence + meant,), cell, formulas, exceptions, by_theorem)


class PossibleIntegrals:
    """How many first integrals a system leaves room for, whichever are known; proves nothing.

    Of the document of a claim about all integrals, only the system and its point are read, once.
    """

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = document
        self.question: conserved.Conserved | None = None

    def up_to(self, degree: int, order: int, time_limit: float) -> int | None:
        """Their number up to a degree in the velocities, from the equations of an order; None where
        it could not be computed.
        """
        found = list[int]()

        def work(tools: Tools) -> tuple[str, ...]:
            if self.question is None:
                self.question = conserved.Conserved(tools, self.document)
            self.question.deadline = tools.deadline
            found.append(self.question.possible(degree, order))
            return ()

        judged(work, time_limit, None)
        return found[0] if found else None


def proven_question(document: Any, tools: Tools) -> tuple[Question, str]:
    """The question whose claim is proven, and the sentence that says so, or Ended."""
    if isinstance(document, dict) and document.get("format") == OLD_FORMAT:
        raise Incomplete(OLD)
    check_shape(document, CERTIFICATE, "certificate")
    kind, among = document["kind"], document.get("among")
    proven = "not_variational" if kind == "nonexistence" else "variational"
    require(document["claim"] == proven, f"A certificate of kind {kind} has to claim {proven}.")
    about: type[Question] = Question
    if document["system"].get("velocities") is not None:
        require(
            among is None, "For a motion on constraints, the claim must be about all Lagrangians."
        )
        along = kind == "nonexistence" and document.get("along") is not None
        about = Along if along else Motion
    elif among is not None:
        about = Definite if among == "positive_definite" else OfKind
    asked = about(tools, document["system"], document["question"] == "time_dependent", document)
    plain = kind == "lagrangian" and about is Question
    alone = "Equations that are not solved for q'' are proven variational by an L alone."
    require(plain or not asked.unsolved, alone)
    checks = {
        "lagrangian": asked.lagrangian,
        "existence": asked.existence,
        "nonexistence": asked.nonexistence,
    }
    return asked, checks[kind](document)


def fails_at(document: dict[str, Any], tools: Tools, values: Values, most: float) -> bool:
    """Whether f is defined with these formulas in the place of parameters, and the claim is not
    proven there.

    Raises OutOfTime if that is not known after so much work, or the time is over.
    """
    special = with_values(document, values)
    here = tools._replace(most_work=most)

    def succeeds(work: Callable[[dict[str, Any]], object]) -> bool:
        nowhere: dict[str, str] = {}
        for near in (
            special["near"],
            nowhere,
        ):  # the other parameters may have to have other values
            try:
                work(special | {"near": near})
                return True
            except OutOfTime:
                raise
            except (Ended, Undefined, Unsettled, StopIteration, OverflowError):
                pass
        return False

    def read(one: dict[str, Any]) -> None:
        Question(here, one["system"], one["question"] == "time_dependent", one).prepare(
            lambda ring: None
        )

    if succeeds(lambda one: proven_question(one, here)):
        return False
    return document["system"].get("velocities") is not None or succeeds(read)


def with_values(document: dict[str, Any], values: Values) -> dict[str, Any]:
    """The certificate with formulas in the place of parameters, in all its formulas."""
    names = re.compile(rf"\b({'|'.join(map(re.escape, values))})\b")

    def put(part: Any) -> Any:
        if isinstance(part, dict):
            return {key: put(one) for key, one in part.items()}
        if isinstance(part, list):
            return [put(one) for one in part]
        return (
            names.sub(lambda found: f"({values[found[0]]})", part)
            if isinstance(part, str)
            else part
        )

    system = document["system"]
    left = {key: put(system[key]) for key in ("equations", "velocities") if system.get(key)}
    left |= {"parameters": [name for name in system["parameters"] if name not in values]}
    formulas = {key: put(document[key]) for key in FORMULAS if document.get(key)}
    near = {
        name: value for name, value in (document.get("near") or {}).items() if name not in values
    }
    return document | formulas | {"system": system | left, "near": near, "series": None}


def near_points(name: str, timed: bool) -> str:
    """Where an equation of one coordinate has a regular Lagrangian (Sonin 1886, Darboux 1894).

    Its Hessian g satisfies Gamma(g) + g df/dv = 0 with Gamma = v d/dx + f d/dv, plus d/dt if L may
    contain t. A linear equation along Gamma has a solution with g = 1 near each point at which
    Gamma is not 0, and g determines L.
    """
    moving = "" if timed else f" and {name}', {name}'' are not both 0"
    return f"near every point at which f is analytic{moving}"
