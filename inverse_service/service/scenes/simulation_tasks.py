"""The tasks of simulation that worker processes run. Light to import: the engine is loaded inside the process."""

from __future__ import annotations

import importlib
from typing import Any

from inverse_service.service.jobs.outcome import Outcome
from inverse_service.service.jobs.tasks import guard

MODULE = "inverse_service.service.scenes.simulating"
PRECISION = "inverse_service.service.scenes.work_precision"


def simulate_task(document: Any, time_limit: float) -> Outcome:
    """A scene to its result document and the tables of all recorded points."""
    return guard(lambda: importlib.import_module(MODULE).simulate_tables(document, None, time_limit))


def work_precision_task(document: Any, time_limit: float) -> Outcome:
    """A scene to its work-precision document."""
    return guard(lambda: importlib.import_module(PRECISION).work_precision(document, None, time_limit))
