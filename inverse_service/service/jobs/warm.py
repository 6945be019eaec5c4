"""Imported by the server process that forks the workers: loads the engines and solves once.

The first solve loads the compiled kernels. Workers forked afterwards have them.
"""

from __future__ import annotations

import gc
import importlib

from inverse_service.inverse_problem.options import SolveOptions
from inverse_service.service.jobs import tasks, warming

SMALL = {"coordinates": ["x"], "equations": {"x": "-x"}}

tasks.guard(tasks.load_engine)
# Kernels and formulas of simulation take a second to import.
tasks.guard(importlib.import_module, "inverse_service.service.scenes.simulating")
if not warming.is_warm():  # who starts the pool has said so
    warming.warm_up()
tasks.solve_task(SMALL, SolveOptions(time_limit=10.0))
# What is loaded stays: workers need not look through it for garbage, which takes a tenth of a small solve, nor copy it.
gc.collect()
gc.freeze()
