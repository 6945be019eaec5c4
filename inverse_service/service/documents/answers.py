"""Turn the outcome of a task into a document, an error, or a problem document (RFC 9457)."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from api_schemas import base
from inverse_service import __version__, errors
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents import growing, translate
from inverse_service.service.documents.older_keys import Told, result_of
from inverse_service.service.documents.stated import Stated
from inverse_service.service.jobs.tasks import Outcome, value_of
from inverse_service.statements import stages
from inverse_service.statements.questions import PLAIN, TIMED
from inverse_service.statements.reasons import Open, Reason

UNDERSTAND_DEADLINE = 2.0
PREFIX = "urn:inverse-service:problem:"
# The title of each status; how a task ended without a value, as status and kind of its problem,
# what happened, and what to do. All other ends are faults.
_WORDS = json.loads((Path(__file__).parent / "problems.json").read_text("utf-8"))
TITLES: dict[int, str] = {int(status): title for status, title in _WORDS["titles"].items()}
ENDS: dict[str, tuple[int, str, str, str]] = _WORDS["ends"]
FAULT = "this is an error in the program"
_REASONS = {"deadline": Reason.TIME, "memory": Reason.SIZE}  # by how a task ended


def with_understood(outcome: Outcome, understood: Outcome) -> Outcome:
    """The outcome of a run that a limit ended, with how the system was understood as its value.

    A document that cannot be read is refused, however short the time.
    """
    if understood.status == "refused":
        return dataclasses.replace(understood, spent=outcome.spent)
    return dataclasses.replace(
        outcome, value=understood.value if understood.status == "done" else None
    )


def result_document(
    outcome: Outcome,
    options: SolveOptions,
    memory_limit: int,
    so_far: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The result document of a solve task.

    One that was ended has what was finished: `so_far`, with the `seconds` of its parts, where that
    is known, else how the system was understood. Raises DocumentRefused with the places of the
    faults, WorkerFailed where the program is at fault (its details go to the log only).
    """
    happened = ENDS[outcome.status][2] if outcome.status in ENDS else ""
    words = f"{happened.format(time=options.time_limit, memory=memory_limit)}."
    reason = Open(_REASONS.get(outcome.status, Reason.STOPPED), words)
    if happened and so_far is not None:
        result = growing.cut_off(so_far["so_far"], reason, so_far["seconds"], outcome.spent.wall)
        result["provenance"] |= {
            "options": {"time_limit": options.time_limit, "seed": options.seed}
        }
        return result
    if outcome.status in ("deadline", "memory"):
        ended = Open(reason.reason, f"{words[:-1]} before a verdict could be proved.")
        return undetermined(outcome.value, ended, options)
    found: dict[str, Any] = value_of(outcome)
    return found


def check_document(outcome: Outcome) -> dict[str, Any]:
    """The answer of a check; one that a limit ended is incomplete. Raises as `result_document`
    does.
    """
    if outcome.status in ("deadline", "memory"):
        reasons = [f"The check was stopped at its {outcome.status} limit."]
        return base.CheckAnswer(verdict="incomplete", reasons=reasons).model_dump()
    found: dict[str, Any] = value_of(outcome)
    return found


def undetermined(understood: Any, reason: Open, options: SolveOptions) -> dict[str, Any]:
    """The result document of a run that a limit ended."""
    statements = [
        Stated(question, {"verdict": "undetermined", **translate.reason_fields(reason)})
        for question in (PLAIN, TIMED)
    ]
    beside = {
        "system": understood,
        "incomplete": [
            growing.entry(part, reason) for part in map(stages.existence, (PLAIN, TIMED))
        ],
        "provenance": {
            "program": "inverse-service",
            "version": __version__,
            "options": {"time_limit": options.time_limit, "seed": options.seed},
        },
    }
    return result_of(Told(tuple(statements), beside))


def problem_document(
    status: int, kind: str, detail: str, places: Sequence[errors.Place] = ()
) -> dict[str, Any]:
    """`kind` is the stable end of the type; the texts are ours, never the caller's."""
    return {
        "type": PREFIX + kind,
        "title": TITLES.get(status, "The request cannot be answered"),
        "status": status,
        "detail": detail,
        "errors": [
            {
                "pointer": p.pointer,
                "column": p.column,
                "detail": p.detail,
                "instead": list(p.instead),
            }
            | {name: value for name in ("span", "plain", "declare") if (value := getattr(p, name))}
            for p in places
        ],
    }


def as_bytes(document: dict[str, Any]) -> bytes:
    """JSON in ASCII, without NaN."""
    return json.dumps(document, ensure_ascii=True, allow_nan=False).encode("ascii")


def of_input_error(error: errors.InputError) -> dict[str, Any]:
    """The problem of a document that is refused."""
    return problem_document(422, error.places[0].code, error.detail, error.places)


def of_outcome(outcome: Outcome, time_limit: float, memory_limit: int) -> dict[str, Any]:
    """The problem of a task that ended without a value; its details stay in the log."""
    if outcome.status == "refused":
        return problem_document(
            422, outcome.places[0].code, outcome.places[0].detail, outcome.places
        )
    kind = f" ({outcome.value})" if isinstance(outcome.value, str) and outcome.value else ""
    fault = (500, "fault", f"The program failed on this document{kind}", FAULT)
    status, short, happened, cure = ENDS.get(outcome.status, fault)
    detail = "; ".join(filter(None, (happened.format(time=time_limit, memory=memory_limit), cure)))
    return problem_document(status, short, f"{detail}.")
