"""Solving in the worker pool: the two steps of one request."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service import tasks
from inverse_service.service.answers import UNDERSTAND_DEADLINE, with_understood
from inverse_service.service.outcome import Outcome
from inverse_service.service.workers import Workers


def submit_solve(workers: Workers, quick: Workers, document: Any, options: SolveOptions) -> Future[Outcome]:
    """Solve in `workers`; where a limit ends that, `quick` still says how the system was understood.

    The Outcome of a run that a limit ended has that `system` part (or None) as its value.
    """
    answer: Future[Outcome] = Future()
    answer.set_running_or_notify_cancel()  # from here on nobody cancels it, so it always gets its result

    def after_solving(done: Future[Outcome]) -> None:
        outcome = done.result()
        if outcome.status not in ("deadline", "memory"):
            answer.set_result(outcome)
            return
        understanding = quick.submit(tasks.understand_task, (document,), UNDERSTAND_DEADLINE)
        understanding.add_done_callback(lambda found: answer.set_result(with_understood(outcome, found.result())))

    workers.submit(tasks.solve_task, (document, options), options.time_limit).add_done_callback(after_solving)
    return answer
