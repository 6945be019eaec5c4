"""Imported by the server process that forks the workers: loads the engine and solves once.

The first solve loads the compiled kernels, some 0.4 s. Workers forked afterwards have them.
"""

from __future__ import annotations

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service import tasks

SMALL = {"coordinates": ["x"], "equations": {"x": "-x"}}

tasks.guard(tasks.load_engine)
tasks.solve_task(SMALL, SolveOptions(time_limit=10.0))
