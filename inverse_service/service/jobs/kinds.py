"""The kinds of jobs: what runs for each inside a worker, and what a limit means for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.jobs.identity import JobOptions, job_id, write_json
from inverse_service.service.jobs.model import INTERACTIVE, JobRequest
from inverse_service.service.jobs.tasks import check_task, solve_task, work_precision_task

Report = Callable[[Any], None]
Work = Callable[[Any, JobOptions, Report], Any]
Look = Callable[[Any], None]


@dataclass(frozen=True, slots=True)
class Kind:
    """`work` runs the use case, `look` refuses what has not the shape of its documents.

    `limit_is_answer`: stopped at a limit it has an undetermined result. Use cases are imported when they are called:
    the process that only stores jobs has no engine.
    """

    work: Work
    look: Look
    limit_is_answer: bool = False


def _solve(document: Any, options: JobOptions, report: Report) -> Any:
    return solve_task(document, solve_options(options), report)


def _check(document: Any, options: JobOptions, report: Report) -> Any:
    return check_task(write_json(document))


def _simulate(document: Any, options: JobOptions, report: Report) -> Any:
    from inverse_service.service.scenes.simulating import simulate

    return simulate(document, report, options.time_limit)


def _work_precision(document: Any, options: JobOptions, report: Report) -> Any:
    return work_precision_task(document, options.time_limit, report)


def _look_at_scene(document: Any) -> None:
    from inverse_service.service.scenes.scene_refusals import scene_schema

    scene_schema(document)


def _look_at_system(document: Any) -> None:
    from inverse_service.service.documents.documents import look

    look(document)


def _look_at_object(document: Any) -> None:
    if not isinstance(document, dict):
        raise InputError("The document must be a JSON object.")


def solve_options(options: JobOptions) -> SolveOptions:
    """The solver's view of the options of a job."""
    return SolveOptions(seed=options.seed, time_limit=options.time_limit)


def label_of(result: Any) -> str:
    """What a result is counted as: its verdict, or the outcome of a simulation."""
    verdict = result.get("verdict") if isinstance(result, dict) else None
    return verdict if isinstance(verdict, str) else "done"


KINDS: Final[dict[str, Kind]] = {
    "solve": Kind(_solve, _look_at_system, limit_is_answer=True),
    "check": Kind(_check, _look_at_object),
    "simulate": Kind(_simulate, _look_at_scene),
    "work-precision": Kind(_work_precision, _look_at_scene),
}


def request_of(
    kind: str, document: Any, options: JobOptions, client: str = "", priority: int = INTERACTIVE, fresh: bool = False
) -> JobRequest:
    """The request. Raises InputError where the document has not the shape that the kind asks for."""
    KINDS[kind].look(document)
    chosen = options.canonical()
    return JobRequest(job_id(kind, document, chosen), kind, write_json(document), chosen, client, priority, fresh)
