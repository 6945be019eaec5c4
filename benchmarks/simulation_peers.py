"""Measure what an error costs with our methods, heyoka, and SciPy, as `work-precision` does, and the time to a first
result.

`python -m benchmarks peers` writes one table. All integrate the equations of the same scene in the same process; "cold"
is a new process with an empty store of machine code, from its start to the last point of the motion, processor time.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.tables import MISSING, table
from inverse_service import simulate
from inverse_service.service.scenes.prices import duration
from inverse_service.service.scenes.work_precision import machine, work_precision
from inverse_service.simulation import precision

REPEATS, SECONDS = 50, 0.5  # the limit for a method grows with both, so that SciPy reaches its finer tolerances
KEPLER = "(x'^2 + y'^2)/2 + 1/sqrt(x^2 + y^2)"
PENDULUM = "a'^2 + b'^2/2 + a'*b'*cos(a - b) + 2*cos(a) + cos(b)"
HENON_HEILES = "(x'^2 + y'^2 - x^2 - y^2)/2 - x^2*y + y^3/3"
SLEIGH = "(x'^2 + y'^2 + f'^2)/2 + f'*(y'*cos(f) - x'*sin(f))/2"
OSCILLATOR = "x'' = 1000*(1 - x^2)*x' - x"


def _scene(system: dict[str, Any], positions: dict[str, Any], velocities: dict[str, Any], step: float, time: float,
           further: Sequence[dict[str, Any]] = (), **others: Any) -> dict[str, Any]:  # fmt: skip
    start = {"positions": positions, "velocities": velocities}
    methods = [{"method": "adaptive"}, {"method": "reference"}, {"method": "runge-kutta", "order": 8}, *further]
    scene = {"system": system, "initial": start, "step": step, "time": time, "methods": methods, "repeats": REPEATS}
    return scene | others


VERLET = [{"method": "stormer-verlet", "order": 8}]
NONHOLONOMIC = [{"method": "nonholonomic", "order": 8}]
SCENES = {
    "Kepler, e = 0.9": _scene(
        {"coordinates": ["x", "y"], "lagrangian": KEPLER}, {"x": "1/10", "y": 0}, {"x": 0, "y": "sqrt(19)"}, 0.02, 62.8,
        VERLET,
    ),
    "double pendulum": _scene(
        {"coordinates": ["a", "b"], "lagrangian": PENDULUM}, {"a": 1, "b": 2}, {"a": 0, "b": 0}, 0.05, 20,
        [{"method": "variational", "order": 8}],
    ),
    "Hénon-Heiles": _scene(
        {"coordinates": ["x", "y"], "lagrangian": HENON_HEILES}, {"x": "1/10", "y": "1/5"}, {"x": 0.3, "y": 0.1}, 0.1,
        100, VERLET,
    ),
    "disk": _scene(
        {"catalogue": "vertically-rolling-disk"}, {"x": 0, "y": 0, "theta": 0, "phi": 0.3}, {"theta": 0.5, "phi": 1},
        0.1, 100, NONHOLONOMIC, parameters={"M": 1, "I": 1, "J": 2, "R": 1},
    ),
    "sleigh": _scene(
        {"coordinates": ["x", "y", "f"], "lagrangian": SLEIGH, "constraints": ["y'*cos(f) - x'*sin(f) = 0"]},
        {"x": 0, "y": 0, "f": 0}, {"x": 1, "f": 0.8}, 0.05, 50, NONHOLONOMIC,
    ),
    "van der Pol, mu = 1000": _scene(
        {"coordinates": ["x"], "equations": [OSCILLATOR]}, {"x": 2}, {"x": 0}, 2, 2000, [{"method": "stiff"}]
    ),
}  # fmt: skip
TARGETS, LIMIT = (1e-6, 1e-9, 1e-12), 60.0  # seconds of processor time for a scene
HOW = """Made by `python -m benchmarks peers`: `work-precision` of each scene, so the best of several alternating runs,
with errors at 8 common times, relative to the size of the motion. "By itself" is the method of a scene that names
none. heyoka and SciPy are called from the same program, heyoka with its steps no longer than the distance of two
such times, SciPy with a compiled right-hand side. A dash: not reached within the limits of time, or by what double
precision allows. Cold: processor time of a new process with an empty store. DifferentialEquations.jl is not measured:
neither Debian nor PyPI nor npm has Julia, and juliacall downloads it from elsewhere."""
COLD = "import json, sys, inverse_service; inverse_service.simulate(json.load(sys.stdin))"


def rows_of(name: str, scene: dict[str, Any]) -> list[list[str]]:
    """One row per error: our best and our default method, heyoka, SciPy's best, our time over the best peer's."""
    plain = {key: value for key, value in scene.items() if key != "methods"}
    found, cold = work_precision(scene, None, LIMIT), [_cold(plain), _cold(plain | {"methods": ["heyoka"]})]
    own, rows = simulate(plain)["methods"][0]["label"], []
    for target in found["targets"]:
        if target["error"] not in TARGETS:
            continue
        reached = [row for row in target["rows"] if row["seconds"] is not None]
        peers = [row for row in reached if row["method"] == "heyoka" or row["method"].startswith("SciPy")]
        ours, scipy = (
            [row for row in reached if row not in peers],
            [row for row in peers if row["method"] != "heyoka"],
        )
        heyoka, alone = ([row for row in reached if row["method"] == name] for name in ("heyoka", own))
        ratios = [f"{rows[0]['seconds'] / peers[0]['seconds']:.2g}" if rows and peers else MISSING
                  for rows in (ours, alone)]  # fmt: skip
        cells = [_cell(ours, True), _cell(alone, True), _cell(heyoka, False), _cell(scipy, True), *ratios, *cold]
        rows.append([name, f"{target['error']:.0e}".replace("e-0", "e-"), *cells])
    return rows


def _cell(rows: Sequence[dict[str, Any]], named: bool) -> str:
    if not rows:
        return MISSING
    best = ("\N{LESS-THAN OR EQUAL TO} " if rows[0]["at_most"] else "") + duration(rows[0]["seconds"])
    return f"{best}, {rows[0]['method'].removeprefix('SciPy ')}" if named else best


def _cold(scene: dict[str, Any]) -> str:
    """Processor time of a new process that runs the scene."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-c", COLD], input=json.dumps(scene), text=True,
            check=True, env=os.environ | {"INVERSE_SERVICE_CACHE": folder},
        )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return duration(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks peers", description=__doc__)
    parser.add_argument("--output", type=Path, help="a Markdown file to write")
    options = parser.parse_args(arguments)
    head = ["scene", "error", "ours", "by itself", "heyoka", "SciPy", "ours : best peer", "by itself : best peer",
            "cold, by itself", "cold, heyoka"]  # fmt: skip
    here = ", ".join(f"{key} {value}" for key, value in machine().items())
    precision.SECONDS = SECONDS
    rows: list[list[str]] = []
    for name, scene in SCENES.items():
        rows += rows_of(name, scene)
        text = "\n\n".join(["# Simulation: peers", HOW, here, table(head, rows)])
        if options.output is not None:
            options.output.write_text(text, encoding="utf-8")
    if options.output is None:
        print(text)
