"""The tasks that worker processes run, how they end, and the kinds of jobs.

Light to import: the engine is loaded inside the process. How a task ended is plain data that
crosses the boundary of the process; without slots, with which a frozen class takes several times as
long to pickle.
"""

from __future__ import annotations

import importlib
import json
import logging
import signal
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, Literal

from inverse_service import errors
from inverse_service.service.documents import plain_data
from inverse_service.service.jobs import model

if TYPE_CHECKING:
    from inverse_service.decision.solutions import SolveOptions

log = logging.getLogger(__name__)
Status = Literal[
    "done", "refused", "deadline", "memory", "killed", "crash", "fault", "cancelled", "unstarted"
]
LIMITS: Final[Mapping[str, str]] = {"deadline": "time", "memory": "memory"}
KILL = getattr(signal, "SIGKILL", None)
OVER_CPU = getattr(signal, "SIGXCPU", None)
# What a command loads only for the questions that need it, and a worker before its first.
ENGINE = (
    "service.documents.documents", "service.documents.nonholonomic_documents", "service.documents.checking",
    "solving.kind_answers", "service.documents.derived", "service.jobs.batch", "explanation.negative",
    "explanation.proofs", "search.ladder",
)  # fmt: skip
Report = Callable[[Any], None]
Work = Callable[[Any, model.JobOptions, Report], Any]
Look = Callable[[Any], Any]
# The code of a place in a body that cannot be read at all; HTTP answers it with 400 and all others
# with 422.
UNREADABLE = "unreadable"
NO_RESULT = "The body is not a result: send the JSON object that /v1/solve answered."


@dataclass(frozen=True)
class Usage:
    """What a task took: seconds of wall clock and of processor, peak memory in MiB."""

    wall: float = 0.0
    cpu: float = 0.0
    memory: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """`done` has a value, `refused` has places, the others a detail for the log.

    deadline: stopped at its time limit; memory: at its memory limit; killed: by a signal that was
    not ours, most often the kernel short of memory; crash: the process died of itself; fault: an
    error of this program; cancelled: stopped because nobody wants it any more; unstarted: there was
    no process to run it in, which says nothing of the task.
    """

    status: Status
    value: Any = None
    places: tuple[errors.Place, ...] = ()
    detail: str = ""
    spent: Usage = field(default=Usage(), compare=False)


@dataclass(frozen=True)
class Call:
    """What a worker is to do: `task(*arguments)` within `deadline` s and `memory_limit` MiB (None:
    the pool's).

    `reports`: the task takes a keyword `report` and calls it with what it is doing; "long": what
    one said that is done within a moment is not told. `client`: whose it is, so that nobody waits
    for the many of another. `priority`: the smaller one of a client goes first. `patience`: while
    others have the processor, the deadline may be later by so many seconds, or by its own length if
    that is more.
    """

    task: Callable[..., Any]
    arguments: tuple[Any, ...]
    deadline: float
    memory_limit: int | None = None
    reports: bool | Literal["long"] = False
    priority: int = 0
    client: str = ""
    patience: float = 0.0


def guard(task: Callable[..., Any], *arguments: Any, **named: Any) -> Outcome:
    """Run it and say as data how it ended; nothing but process death gets past."""
    try:
        found = task(*arguments, **named)
    except errors.InputError as error:
        return Outcome("refused", places=error.places)
    except MemoryError:
        return Outcome("memory")
    except OverflowError:
        detail = "A number of this document leaves the range that can be computed with; write smaller numbers."
        return Outcome("refused", places=(errors.Place(detail, code="limit"),))
    except ImportError as error:
        missing = errors.missing_extra(error)
        return _fault(error) if missing is None else Outcome("refused", places=missing.places)
    except (
        Exception
    ) as error:  # the boundary of the process: a fault of ours becomes data for the log
        return _fault(error)
    return found if isinstance(found, Outcome) else Outcome("done", found)


def _fault(error: Exception) -> Outcome:
    trace = "".join(traceback.format_exception(error))[-8000:]
    return Outcome("fault", value=f"{type(error).__name__}", detail=trace)


def value_of(outcome: Outcome) -> Any:
    """The value of a task that is done; raises DocumentRefused or WorkerFailed for the others."""
    if outcome.status == "done":
        return outcome.value
    if outcome.status == "refused":
        raise errors.DocumentRefused(outcome.places)
    log.error("task ended with %s: %s", outcome.status, outcome.detail)
    if outcome.status in LIMITS:
        raise errors.WorkerFailed(f"The work was stopped at its {LIMITS[outcome.status]} limit.")
    if outcome.status == "unstarted":
        raise errors.NoWorker("No worker process can be started; try again in some seconds.")
    kind = f" ({outcome.value})" if outcome.value else ""
    raise errors.WorkerFailed(
        f"The program failed on this document{kind}; this is an error in the program."
    )


def outcome_of_exit(exitcode: int | None) -> Outcome:
    """What the exit code of a dead process says; negative codes are signals.

    SIGABRT counts as memory: FLINT and GMP abort when an allocation fails.
    """
    signal_number = -exitcode if exitcode is not None and exitcode < 0 else None
    if signal_number is None:
        return Outcome("crash", detail=f"worker process ended with exit code {exitcode}")
    if signal_number == signal.SIGABRT:
        return Outcome("memory")
    if signal_number == OVER_CPU:
        return Outcome("deadline", detail="processor time")
    if signal_number == KILL:
        return Outcome("killed", detail="worker process was killed by somebody else")
    return Outcome("crash", detail=f"worker process ended with signal {signal_number}")


def load_engine() -> None:
    """Import everything that a task needs."""
    for module in ENGINE:
        importlib.import_module(f"inverse_service.{module}")


@dataclass(frozen=True)
class Answer:
    """A result as it is stored and sent, what it is counted as, and the fault of ours that ended
    it, if one did.
    """

    body: bytes
    label: str
    fault: str = ""


def job_task(kind: str, document: str, options: str, report: Callable[[Any], None]) -> Answer:
    """A stored job to its Answer; JSON is read and written here, so that the web process is never
    blocked.
    """
    result = KINDS[kind].work(plain_data.read_json(document), model.stored_options(options), report)
    fault = result.get("provenance", {}).get("fault", "") if isinstance(result, dict) else ""
    return Answer(as_body(result), label_of(result), fault)


def as_body(result: dict[str, Any]) -> bytes:
    """A result as the store has it."""
    return json.dumps(result, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()


def understand_job_task(document: str) -> Any:
    """The document of a stored solve job to the `system` part of a result."""
    return understand_task(plain_data.read_json(document))


@dataclass(frozen=True)
class Late:
    """A function of the engine, which is imported where it is called: who only stores jobs has no
    engine.
    """

    module: str
    name: str

    def __call__(self, *given: Any, report: Any = None) -> Any:
        function = getattr(importlib.import_module(self.module), self.name)
        return function(*given) if report is None else function(*given, report)


# A document to its result, or to the `system` part of one; a result as theorems for another prover;
# the text of a result to the checker's verdict; a scene to its result, also with the tables
# of all points or a moving picture, or to what it costs.
solve_task = Late("inverse_service.service.documents.documents", "solve_document")
understand_task = Late("inverse_service.service.documents.documents", "understand_document")
proof_task = Late("inverse_service.explanation.proofs", "proof_document")
check_task = Late("inverse_service.service.documents.checking", "check_document")
simulate_task = Late("inverse_service.service.scenes.simulating", "simulate")
tables_task = Late("inverse_service.service.scenes.simulating", "simulate_tables")
animate_task = Late("inverse_service.service.scenes.moving_pictures", "simulate_moving")
work_precision_task = Late("inverse_service.service.scenes.work_precision", "work_precision")


@dataclass(frozen=True, slots=True)
class Terms:
    """What a call says besides its documents: the kind, the server's options, a time limit of its
    own, who asks.

    `most`: how many lines a batch may have.
    """

    kind: str
    server: model.JobOptions
    time_limit: float | None = None
    client: str = ""
    fresh: bool = False
    most: int = model.NO_BOUND


def ask_task(body: bytes, terms: Terms, look: Look | None = None) -> model.JobRequest:
    """A question to its JobRequest; the time limit of the call goes before that of the document."""
    document, given = model.split_options(read_body(body))
    options = model.read_options(given, terms.server)
    if terms.time_limit:
        options = replace(options, time_limit=terms.time_limit)
    return request_of(terms.kind, document, options, terms.client, fresh=terms.fresh, look=look)


def parse_task(body: bytes) -> bytes:
    """A System document to the JSON of what was understood."""
    understood = Late("inverse_service.service.documents.documents", "parse_document")(
        model.split_options(read_body(body))[0]
    )
    return json.dumps(understood, ensure_ascii=False, allow_nan=False).encode()


def refuse_task(body: bytes) -> None:
    """Raises InputError where a System document cannot be solved as it is written."""
    document, _ = model.split_options(read_body(body))
    Late("inverse_service.service.documents.documents", "refuse_unreadable")(document)


def check_body_task(body: bytes) -> Any:
    """A result or a certificate to the checker's verdict."""
    if not isinstance(read_body(body), dict):
        raise errors.InputError(NO_RESULT)
    return check_task(plain_data.decode(body))


def read_body(body: bytes) -> Any:
    """The value of a body of JSON; raises DocumentRefused."""
    try:
        return plain_data.read_json(body)
    except errors.InputError as error:
        place = errors.Place(error.detail, error.pointer, error.column, UNREADABLE)
        raise errors.DocumentRefused((place,)) from None


@dataclass(frozen=True, slots=True)
class Kind:
    """`work` runs the use case, `look` refuses what has not the shape of its documents.

    `limit_is_answer`: stopped at a limit it has an undetermined result.
    """

    work: Work
    look: Look
    limit_is_answer: bool = False


def solve_options(options: model.JobOptions) -> SolveOptions:
    """The solver's view of the options of a job."""
    from inverse_service.decision.solutions import SolveOptions  # not for a scene

    return SolveOptions(seed=options.seed, time_limit=options.time_limit)


def label_of(result: Any) -> str:
    """What a result is counted as: the verdict of the answer that people are shown first, "differs"
    where it differs by case, "done" for what has none.
    """
    if not isinstance(result, dict):
        return "done"
    verdict = result.get("verdict")
    if verdict != "differs" and (answers := result.get("answers")):
        verdict = answers[0]["verdict"]
    return verdict if isinstance(verdict, str) else "done"


_look_at_scene: Look = Late("inverse_service.service.scenes.scene_reading", "scene_schema")


def _looked_at(value: Any) -> None:
    if not isinstance(value, dict):
        raise errors.InputError("The document must be a JSON object.")


KINDS: Final[dict[str, Kind]] = {
    "solve": Kind(
        lambda d, o, report: solve_task(d, solve_options(o), report),
        Late("inverse_service.service.documents.documents", "look"),
        True,
    ),
    "check": Kind(lambda d, o, report: check_task(plain_data.write_json(d)), _looked_at),
    "simulate": Kind(lambda d, o, report: simulate_task(d, report, o.time_limit), _look_at_scene),
    "work-precision": Kind(
        lambda d, o, report: work_precision_task(d, report, o.time_limit), _look_at_scene
    ),
}


def request_of(
    kind: str,
    document: Any,
    options: model.JobOptions,
    client: str = "",
    priority: int = model.INTERACTIVE,
    fresh: bool = False,
    look: Look | None = None,
) -> model.JobRequest:
    """The request. Raises InputError, or what `look` raises, where the document has not the shape
    of its kind.
    """
    (look or KINDS[kind].look)(document)
    chosen = options.canonical()
    return model.JobRequest(
        model.job_id(kind, document, chosen),
        kind,
        plain_data.write_json(document),
        chosen,
        client,
        priority,
        fresh,
    )
