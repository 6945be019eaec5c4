"""Imported by the server process that forks the workers, and by nothing else: it dies with the
service, and is warm.

A killed service (SIGKILL) cannot tell its workers. The kernel does: the service's death kills the
forking server, and that one's death kills each worker (`die_with_parent`), even one that spins in C
code. The first solve loads the compiled kernels, which workers forked afterwards have. The import
is the act because multiprocessing lets the server only import modules.
"""

import gc
import importlib

from inverse_service.decision.solutions import SolveOptions
from inverse_service.kernels.machine_code import code_store
from inverse_service.service import compiling
from inverse_service.service.jobs import tasks, workers

SMALL = {"coordinates": ["x"], "equations": {"x": "-x"}}

workers.die_with_parent()
tasks.guard(tasks.load_engine)
# Kernels and formulas of simulation take a second to import.
tasks.guard(importlib.import_module, "inverse_service.service.scenes.simulating")
if not code_store.is_warm():  # who starts the pool has said so
    compiling.warm_up()
tasks.guard(tasks.solve_task, SMALL, SolveOptions(time_limit=10.0))
# What is loaded stays: workers need not look through it for garbage, which takes a tenth of a small
# solve, nor copy it.
gc.collect()
gc.freeze()
