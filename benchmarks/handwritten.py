"""Compare order-8 Stormer-Verlet steps with a hand-written C program and with heyoka, in one
run.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.problems import HENON_HEILES
from inverse_service.integrators.method_table import composition
from inverse_service.simulation.execution import run
from inverse_service.simulation.scene_data import Grid, MethodChoice, Start

START = Start((0.0, 0.1), (0.3, 0.1))
STEPS, STEP = 20_000, 0.05


@dataclass(frozen=True, slots=True)
class HandwrittenRow:
    """Nanoseconds per step: ours with and without monitoring, and C (None without gcc); `apart`
    compares their ends.
    """

    ours: float
    unwatched: float
    by_hand: float | None
    apart: float | None


def handwritten_row(rounds: int) -> HandwrittenRow:
    """Measure all alternately and take the best of `rounds`."""
    times: dict[str, list[float]] = {"ours": [], "unwatched": [], "by hand": []}
    by_hand, ends = _compiled(), {}
    bare = ()
    for _ in range(rounds):
        for name, guard in (("ours", True), ("unwatched", False)):
            choice = MethodChoice("variational", 0.0, True, 8, "verlet", guard)
            found = run(HENON_HEILES, choice, START, Grid(STEP, STEPS, STEPS), {}, bare)
            times[name].append(found.run_seconds)
            ends[name] = found.positions[-1]
        if by_hand is not None:
            state = np.array([0.0, 0.1, 0.3, 0.1])
            weights = np.array(composition(8))
            begin = time.perf_counter()
            by_hand(state.ctypes.data, weights.ctypes.data, len(weights), STEP, STEPS)
            times["by hand"].append(time.perf_counter() - begin)
            ends["by hand"] = state[:2]
    best = {name: 1e9 * min(values) / STEPS for name, values in times.items() if values}
    apart = float(np.abs(ends["ours"] - ends["by hand"]).max()) if "by hand" in ends else None
    return HandwrittenRow(best["ours"], best["unwatched"], best.get("by hand"), apart)


def _compiled() -> Callable[..., None] | None:
    compiler = shutil.which("gcc")
    if compiler is None:
        return None
    library = Path(tempfile.mkdtemp()) / "verlet.so"
    source = Path(__file__).with_name("verlet.c")
    subprocess.run(
        [compiler, "-O3", "-march=native", "-shared", "-fPIC", str(source), "-o", str(library)],
        check=True,
    )
    kind = ctypes.CFUNCTYPE(
        None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_double, ctypes.c_long
    )
    return kind(("steps", ctypes.CDLL(str(library))))
