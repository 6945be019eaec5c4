"""The scenes of section 3: the paper's systems, with data where the paper gives none stated in the captions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inverse_service.service.scenes.simulating import simulate_tables

Array = NDArray[np.float64]
SECONDS = 120.0


@dataclass(frozen=True, slots=True)
class Run:
    """A simulated scene: its result document, the recorded columns of each method, and the true motion."""

    result: Mapping[str, Any]
    tables: Mapping[str, Mapping[str, Array]]
    truth: Mapping[str, Array] | None

    def method(self, label: str) -> Mapping[str, Any]:
        """The summary of one method."""
        found: Mapping[str, Any] = next(m for m in self.result["methods"] if m["label"] == label)
        return found

    def only(self, *labels: str) -> Run:
        """The run with these methods alone."""
        kept = [m for m in self.result["methods"] if m["label"] in labels]
        return Run(
            {**self.result, "methods": kept},
            {label: self.tables[label] for label in labels},
            self.truth,
        )

    def circle(self, label: str) -> Mapping[str, float]:
        """What is known of the circle that a method follows."""
        found: Mapping[str, float] = self.method(label)["circle"]
        return found


def run(scene: Mapping[str, Any]) -> Run:
    """The scene, simulated."""
    found = simulate_tables(dict(scene), time_limit=SECONDS)
    return Run(found["result"], found["tables"], found["truth"])


DISK: Mapping[str, Any] = {
    "system": {"catalogue": "vertically-rolling-disk"},
    "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {
        "positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0},
        "velocities": {"phi": 1, "theta": 0.5},
    },
    "start": "discrete_constraint",
}
KNIFE_EDGE: Mapping[str, Any] = {
    "system": {"catalogue": "knife-edge"},
    "parameters": {"m": 1, "J": 1},
    "initial": {"positions": {"phi": 0.3, "x": 0, "y": 0}, "velocities": {"phi": 1, "x": 0.5}},
    "start": "discrete_constraint",
}
PARTICLE: Mapping[str, Any] = {
    "system": {"catalogue": "nonholonomic-particle"},
    "initial": {"positions": {"x": 0.5, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1}},
}


def scene(
    base: Mapping[str, Any], name: str, step: float, time: float, methods: Sequence[Any], observe: Sequence[str],
    **further: Any,
) -> dict[str, Any]:  # fmt: skip
    """A scene document on one of the systems."""
    grid = {"name": name, "step": step, "time": time}
    return {**base, **grid, "methods": list(methods), "observe": list(observe), **further}


def both(alpha: str) -> list[dict[str, str]]:
    """The variational and the nonholonomic method with one alpha."""
    return [{"method": "variational", "alpha": alpha}, {"method": "nonholonomic", "alpha": alpha}]
