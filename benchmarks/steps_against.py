"""What a step costs here and at another revision: `python -m benchmarks.steps_against REVISION
[--rounds N] [--only WORD]`.

A process of each tree prepares the same motion by the same method, then both take some
milliseconds of its steps in turn; the least processor seconds of the compiled loop count.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.scene_families import pendulum
from benchmarks.simulation_peers import SCENES
from benchmarks.tables import table
from tests.golden.__main__ import ROOT, tree_of

Scene = dict[str, Any]
# Runs in either tree: a scene from standard input, then the seconds of a step for each line there.
_STEPS = """
import json, sys, time
from dataclasses import replace
sys.path.insert(0, sys.argv[1])
from inverse_service.service.scenes import scene_lagrangian, scene_reading
from inverse_service.simulation import derivation, execution, observing
schema = scene_reading.scene_schema(json.loads(sys.stdin.readline()))
scene, system = scene_reading.read_scene(schema)
derived = derivation.Derived(scene, scene_lagrangian.finder(schema, system))
(asked,) = scene.methods
problem = derivation.problem_of(asked, derived).with_used_parameters()
values, start = observing.beginning(scene, asked, derivation.free_of(asked, derived))
ready = execution.prepared(problem, asked.choice, start, scene.grid, values, ())

def seconds(steps):
    grid = replace(scene.grid, steps=steps, record_every=steps)
    begun = time.process_time()
    found = ready.go(grid)
    spent = time.process_time() - begun
    return spent if found.completed.all() else None

steps = 64
while (spent := seconds(2 * steps)) is not None and steps < 10**6:
    steps *= 2
    if spent > 0.006:
        break
least = min(seconds(1) for _ in range(20))
for _ in sys.stdin:
    print((seconds(steps) - least) / (steps - 1), flush=True)
"""


class Motion(NamedTuple):
    """A scene with one method, and what the table calls it."""

    name: str
    scene: Scene


def motions() -> Iterator[Motion]:
    """The scenes of the records, each with the methods that step with a kernel."""
    robot = {
        "system": {"catalogue": "mobile-robot-with-potential"},
        "parameters": {"m": 1, "I": 1, "J": 1, "R": 1},
        "initial": {"positions": {"theta": 0.3, "psi": 0.5, "x": 0, "y": 0}, "velocities": {"theta": 1, "psi": 0.3}},
        "step": 0.01, "steps": 2000,
    }  # fmt: skip
    particle = {
        "system": {"catalogue": "nonholonomic-particle"},
        "initial": {"positions": {"x": 1, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1}},
        "step": 0.01, "steps": 2000,
    }  # fmt: skip
    links = {f"{n} links": pendulum(n) | {"time": 20} for n in (2, 3)}
    scenes = {"disk": SCENES["disk"], "particle": particle, "robot": robot, "sleigh": SCENES["sleigh"],
              "Kepler": SCENES["Kepler, e = 0.9"], "Hénon-Heiles": SCENES["Hénon-Heiles"],
              "van der Pol": SCENES["van der Pol, mu = 1000"], **links}  # fmt: skip
    for name, scene in scenes.items():
        yield from (
            Motion(name, scene | {"methods": [one], "observe": []}) for one in _methods(scene)
        )


def _methods(scene: Scene) -> list[Scene]:
    """All that have a kernel and can run the scene."""
    plain: list[Scene] = [{"method": one} for one in ("adaptive", "reference", "stiff")]
    plain += [{"method": "runge-kutta", "order": order} for order in (4, 8)]
    system = scene["system"]
    if "equations" in system:
        return plain
    of_paper = "catalogue" in system
    found = [*plain, {"method": "nonholonomic", "alpha": 0.5}]
    if of_paper or "constraints" not in system:
        found += [
            {"method": "variational", "alpha": alpha}
            for alpha in ((0, 0.5) if of_paper else (0.5,))
        ]
    if scene is SCENES["Hénon-Heiles"]:
        found.append({"method": "stormer-verlet", "order": 8})
    return found


def least_seconds(trees: Sequence[Path], scene: Scene, rounds: int) -> list[float] | None:
    """The least processor seconds of a step in each tree; None where one has no steps of it."""
    running = [_process(tree) for tree in trees]
    least = [float("inf")] * len(running)
    try:
        for one in running:
            print(json.dumps(scene), file=one.stdin, flush=True)
        for _ in range(rounds):
            for place, one in enumerate(running):
                assert one.stdin is not None
                assert one.stdout is not None
                print(file=one.stdin, flush=True)
                least[place] = min(least[place], float(one.stdout.readline()))
    except (ValueError, BrokenPipeError):
        return None
    finally:
        for one in running:
            one.kill()
            one.wait()
    return least


def _process(tree: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _STEPS, str(tree)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree)},
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.steps_against", description=__doc__)
    parser.add_argument("revision")
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--only", default="", help="motions whose name or method has this word")
    options = parser.parse_args(arguments)
    trees, rows = (tree_of(options.revision), ROOT), list[list[str]]()
    for name, scene in motions():
        (method,) = scene["methods"]
        label = ", ".join(
            [
                name,
                *(
                    f"{word} {method[word]}" if word != "method" else method[word]
                    for word in method
                ),
            ]
        )
        if options.only not in label:
            continue
        found = least_seconds(trees, scene, options.rounds)
        if found is None:
            print(label, "has no steps in one of them", file=sys.stderr, flush=True)
            continue
        old, new = (1e9 * one for one in found)
        rows.append([label, f"{old:.3g}", f"{new:.3g}", f"{new / old:.2f}"])
        print(*rows[-1], file=sys.stderr, flush=True)
    head = ["motion, method", f"{options.revision}, ns", "here, ns", "here : there"]
    print(table(head, rows))


if __name__ == "__main__":
    main()
