"""The kinds of jobs: what runs for each inside a worker, and what a limit means for it."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from inverse_service.errors import InputError
from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.jobs.options import JobOptions

Report = Callable[[Any], None]
Work = Callable[[Any, JobOptions, Report], Any]
Look = Callable[[Any], None]


@dataclass(frozen=True, slots=True)
class Kind:
    """`module` holds the use case, `work` calls it, `look` refuses what has not the shape of its documents.

    `limit_is_answer`: stopped at a limit it has an undetermined result.
    """

    name: str
    module: str
    work: Work
    look: Look
    limit_is_answer: bool = False

    @property
    def is_there(self) -> bool:
        """Whether this installation has the use case."""
        return importlib.util.find_spec(self.module) is not None


def _solve(document: Any, options: JobOptions, report: Report) -> Any:
    module = importlib.import_module(KINDS["solve"].module)
    return module.solve_document(document, solve_options(options), report)


def _check(document: Any, options: JobOptions, report: Report) -> Any:
    from inverse_service.service.jobs.identity import write_json

    return importlib.import_module(KINDS["check"].module).check_document(write_json(document))


def _simulate(document: Any, options: JobOptions, report: Report) -> Any:
    return importlib.import_module(KINDS["simulate"].module).simulate(document, report, options.time_limit)


def _work_precision(document: Any, options: JobOptions, report: Report) -> Any:
    return importlib.import_module(KINDS["work-precision"].module).work_precision(document, report, options.time_limit)


def _look_at_scene(document: Any) -> None:
    importlib.import_module("inverse_service.service.scenes.scene_refusals").scene_schema(document)


def _look_at_system(document: Any) -> None:
    importlib.import_module("inverse_service.service.documents.documents").look(document)


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
    "solve": Kind(
        "solve", "inverse_service.service.documents.documents", _solve, _look_at_system, limit_is_answer=True
    ),
    "check": Kind("check", "inverse_service.service.documents.documents", _check, _look_at_object),
    "simulate": Kind("simulate", "inverse_service.service.scenes.simulating", _simulate, _look_at_scene),
    "work-precision": Kind(
        "work-precision", "inverse_service.service.scenes.work_precision", _work_precision, _look_at_scene
    ),
}
