"""Random scenes: a system of the catalogue, a start, a step and a method, run at its step and at a
finer one.

A pair is wrong if both runs complete and the errors do not decrease with the order: the finer error
exceeds ten times the prediction from the coarser one, and the uncertainty of the reference. This
detects methods that are wrong at every step or lost their order, and a wrong reference.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from inverse_service import catalogue
from inverse_service.errors import InverseServiceError
from inverse_service.service.scenes.simulating import simulate

FUNCTIONS = ("sin({})", "{}^2/2", "1 + {}^2/4", "exp(-{}/2)")
TIME = 4.0
METHODS: tuple[tuple[dict[str, Any], int], ...] = (
    ({"method": "variational"}, 2), ({"method": "variational", "alpha": 0}, 1),
    ({"method": "variational", "alpha": "1/3"}, 1), ({"method": "variational", "order": 4}, 4),
    ({"method": "variational", "order": 8}, 8), ({"method": "variational", "form": "raw"}, 2),
    ({"method": "variational", "alpha": "1/4", "symmetrised": True}, 2), ({"method": "nonholonomic"}, 2),
    ({"method": "nonholonomic", "alpha": 1}, 1), ({"method": "nonholonomic", "order": 6}, 6),
    ({"method": "modified"}, 2), ({"method": "runge-kutta", "order": 4}, 4),
    ({"method": "runge-kutta", "order": 5}, 5), ({"method": "runge-kutta", "order": 8}, 8),
    ({"method": "stormer-verlet", "order": 2}, 2), ({"method": "stormer-verlet", "order": 8}, 8),
    ({"method": "reference"}, 12), ({"method": "adaptive"}, 8), ({"method": "stiff"}, 4),
)  # fmt: skip
OWN_STEPS = ("adaptive", "stiff")


@dataclass(frozen=True, slots=True)
class Verdict:
    """One method of one scene: `complaint` is empty if nothing is wrong; `pair` has the outcomes of
    both runs.
    """

    scene: dict[str, Any]
    label: str
    pair: tuple[str, str]
    errors: tuple[float | None, float | None]
    complaint: str


def random_scene(seed: int) -> dict[str, Any]:
    """A scene of the catalogue; a third of the starts are at zeros, where formulas are singular."""
    chance = random.Random(seed)
    name = chance.choice(list(catalogue.names()))
    document = catalogue.entry(name)["document"]
    coordinates = list(document.get("coordinates") or document.get("equations") or ())
    at_zero = chance.random() < 0.3
    positions = {
        q: 0.0 if at_zero and chance.random() < 0.5 else round(chance.uniform(-1, 1), 3)
        for q in coordinates
    }
    velocities = {
        q: 0.0 if at_zero and chance.random() < 0.3 else round(chance.uniform(-1, 1), 3)
        for q in coordinates
    }
    return {
        "system": {"catalogue": name},
        "parameters": {
            p: round(chance.uniform(0.5, 1.5), 3) for p in document.get("parameters", ())
        },
        "functions": {
            f: chance.choice(FUNCTIONS).format(a[0])
            for f, a in document.get("functions", {}).items()
        },
        "initial": {"positions": positions, "velocities": velocities, "project": True},
        "step": chance.choice((0.5, 0.2, 0.1, 0.05, 0.02)),
        "methods": [dict(chance.choice(METHODS)[0]) for _ in range(4)],
        "observe": ["error"],
    }


def order_of(method: dict[str, Any]) -> int:
    return next(order for known, order in METHODS if known == method)


def verdicts(seed: int) -> Iterator[Verdict]:
    """The verdict on every method of the scene with this seed; empty if the scene is rejected."""
    scene = random_scene(seed)
    for method in scene["methods"]:
        order = order_of(method)
        finer = 1 if method["method"] in OWN_STEPS else max(4, 2 ** -(-5 // order))
        steps = max(1, round(TIME / scene["step"]))
        pair = []
        for factor in (1, finer):
            small = {
                "step": scene["step"] / factor,
                "steps": steps * factor,
                "record_every": factor,
                "methods": [method],
            }
            try:
                pair.append(simulate(scene | small, None, 60.0)["methods"][0])
            except InverseServiceError:
                return
        ends = (pair[0]["outcome"], pair[1]["outcome"])
        errors = (pair[0].get("max_error"), pair[1].get("max_error"))
        yield Verdict(scene, pair[0]["label"], ends, errors, _complaint(pair, order, finer))


def _complaint(pair: list[dict[str, Any]], order: int, finer: int) -> str:
    coarse, fine = pair
    if "failed" in (coarse["outcome"], fine["outcome"]):
        return f"failed: {fine.get('reason')}"
    known = all(one["outcome"] == "completed" and one.get("max_error") is not None for one in pair)
    if not known:
        return ""
    size = max((abs(x) for x in coarse["final"]["positions"].values()), default=0.0) + 1
    floor = 10 * fine["error_uncertainty"] + 1e-11 * size
    if finer == 1:
        allowed = max(floor, 1e-4 * size)
    elif coarse["max_error"] > 0.01 * size:  # before the errors decrease with their order
        allowed = max(floor, 0.9 * coarse["max_error"])
    else:
        allowed = max(floor, 10 * coarse["max_error"] / finer**order)
    if np.isfinite(fine["max_error"]) and fine["max_error"] <= allowed:
        return ""
    return f"error {fine['max_error']:.3g}, allowed {allowed:.3g} (coarse {coarse['max_error']:.3g}, order {order})"
