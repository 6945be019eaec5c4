"""Measure one decision in its own process: seconds cold and warm, peak memory.

python -m benchmarks.ours < system.json
"""

from __future__ import annotations

import json
import resource
import statistics
import sys
from typing import Any

from benchmarks.decision_benchmark import read
from inverse_service.decision.deciding import decide
from inverse_service.statements.questions import PLAIN

REPEATS = 3


def measured(document: dict[str, Any]) -> dict[str, Any]:
    """Verdict, order, dimensions, median seconds after a first run, peak memory in MB."""
    system = read(document)
    runs = [decide(system, PLAIN, seed=seed) for seed in range(1, REPEATS + 2)]
    last = runs[-1]
    return {
        "verdict": last.verdict,
        "order": last.order,
        "unknown_dimensions": list(last.history[-1]) if last.history else [],
        "seconds": statistics.median(run.seconds for run in runs[1:]),
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


if __name__ == "__main__":
    print(json.dumps(measured(json.load(sys.stdin))))
