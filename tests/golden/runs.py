"""Short runs that together use every method, observable and kind of scene, with their results.

The results stand in runs.json; texts are compared as they are, numbers within 1e-6, because
processors round differently. `python -m tests.golden.runs` writes them again.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from inverse_service.service.scenes import drawing, simulating, views
from tests.golden.printed import ROUNDING

STORED = Path(__file__).with_name("runs.json")
ALL_METHODS = [
    "variational", {"method": "variational", "alpha": 0, "symmetrised": True, "label": "both ends"},
    {"method": "variational", "order": 4, "label": "composed"}, "stormer-verlet", "runge-kutta", "adaptive", "stiff",
    "reference",
]  # fmt: skip
EVERY = [
    "trajectory", "velocities", "energy", "momenta", "phase", "error", "cost", "lyapunov", "period",
    {"square": "x^2"},
]  # fmt: skip
BALL = {"coordinates": ["x"], "lagrangian": "x'^2/2-10*x"}
EDGE = {
    "coordinates": ["phi", "x", "y"],
    "lagrangian": "(x'^2+y'^2+phi'^2)/2",
    "constraints": ["x'*sin(phi)-y'*cos(phi)"],
}
SCENES: dict[str, dict[str, Any]] = {
    "pendulum by all methods": {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2+cos(x)"},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.1, "steps": 40, "methods": ALL_METHODS, "observe": EVERY,
        "events": [{"when": "x"}, {"when": "x'", "direction": -1}],
    },
    "knife edge": {
        "system": EDGE,
        "initial": {"positions": {"phi": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "x": 1, "y": 0}},
        "step": 0.1, "steps": 20, "record_every": 2, "circle": ["x", "y"],
        "methods": ["nonholonomic", "modified", "exact", "variational"],
        "observe": [
            "trajectory", "constraints", "constraint_forces", "matching_circle", "energy", "momenta", "lyapunov"
        ],
    },
    "bouncing ball": {
        "system": BALL, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "step": 0.05, "time": 2,
        "contacts": [{"name": "floor", "gap": "x", "restitution": "1/2"}], "methods": ["runge-kutta", "adaptive"],
        "observe": ["trajectory", "contact_forces", "energy"],
    },
    "block with friction": {
        "system": {"equations": {"x": "-x-mu*sign(x')"}, "coordinates": ["x"], "parameters": ["mu"]},
        "parameters": {"mu": "1/4"}, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.1, "time": 5, "methods": ["runge-kutta", "adaptive", "stiff"], "observe": ["trajectory"],
        "record_every": 10,
    },
    "a jump and a stop": {
        "system": {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2-y"}, "step": 0.1, "time": 4,
        "initial": {"positions": {"x": 0, "y": 1}, "momenta": {"x": 1, "y": 0}}, "methods": ["variational", "adaptive"],
        "events": [
            {"when": "y", "direction": -1, "do": {"set": {"y'": "-y'/2"}}, "count": 2},
            {"when": "x-2", "do": "stop"},
        ],
        "observe": ["trajectory", "momenta", "energy"],
    },
    "driven and damped": {
        "system": {"coordinates": ["x"], "lagrangian": "m*x'^2/2-k*x^2/2", "parameters": ["m", "k"]},
        "parameters": {"m": 2, "k": 3}, "forces": {"x": "cos(t)"}, "rayleigh": "x'^2/20", "step": 0.1, "steps": 30,
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "start_time": 1, "record_every": 5,
        "methods": ["variational", "reference"], "observe": ["trajectory", "energy", "error"],
    },
    "a blow-up": {
        "system": {"equations": {"x": "6*x^2"}, "coordinates": ["x"]}, "step": 0.1, "time": 3,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 2}}, "methods": ["runge-kutta", "adaptive", "reference"],
        "record_every": 5,
    },
    "an ensemble": {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2-k*x^4/4", "parameters": ["k"]},
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "parameters": {"k": 1}, "step": 0.1, "steps": 20,
        "ensemble": {"initial": {"positions": {"x": [1, "1/2", 2]}}, "parameters": {"k": [1, 2, 3]}},
        "methods": ["stormer-verlet"], "record_every": 10, "observe": ["trajectory", "energy"],
    },
}  # fmt: skip
LEFT_OUT = {"seconds", "cost", "engine", "version", "provenance", "us_per_step", "time_per_step"}


def found(name: str) -> dict[str, Any]:
    """The result of a run, the curves of its figures, and the figures as files, by pointers."""
    whole = simulating.simulate_tables(SCENES[name], time_limit=600)
    files = drawn(whole)
    whole["tables"] = {
        label: {key: np.ravel(column).tolist() for key, column in table.items()}
        for label, table in whole["tables"].items()
    }
    shown = {} if "ensemble" in SCENES[name] else {"figures": views.figures_of(whole["result"])}
    shown["files"] = files
    return dict(leaves({"result": whole["result"], "tables": whole["tables"], **shown}, ""))


def drawn(whole: dict[str, Any]) -> dict[str, Any]:
    """What the figures of a run show: their captions, and of each panel its texts, scales and curves."""
    panels = dict[str, Any]()

    def kept(figure: Figure, name: str, ending: str) -> bytes:
        panels.setdefault(name, [panel(axes) for axes in figure.axes if axes.get_visible()])
        return f"{name} {ending}".encode()

    with tempfile.TemporaryDirectory() as folder, mock.patch.object(drawing, "_encoded", kept):
        written = drawing.draw_simulation(
            Path(folder), whole["result"], whole["tables"], whole["truth"]
        )
    return {"written": written, "panels": panels}


def panel(axes: Axes) -> dict[str, Any]:
    curves = [
        {
            "label": line.get_label(), "color": line.get_color(), "dash": line.get_linestyle(),
            "width": line.get_linewidth(), "x": np.asarray(line.get_xdata(), dtype=float).tolist(),
            "y": np.asarray(line.get_ydata(), dtype=float).tolist(),
        }
        for line in axes.lines
    ]  # fmt: skip
    texts = [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), axes.get_yscale()]
    return {"texts": texts, "aspect": axes.get_aspect(), "x": axes.get_xlim(), "y": axes.get_ylim(),
            "curves": curves, "areas": len(axes.collections)}  # fmt: skip


def leaves(value: Any, at: str) -> Iterator[tuple[str, Any]]:
    """The values of a JSON document by their pointers; lists by four of them."""
    if isinstance(value, dict):
        for key in value:
            if key not in LEFT_OUT:
                yield from leaves(value[key], f"{at}/{key}")
    elif isinstance(value, list | tuple):
        yield f"{at}/length", len(value)
        for place in sorted({k * (len(value) - 1) // 3 for k in range(4)} if value else ()):
            yield from leaves(value[place], f"{at}/{place}")
    else:
        yield at, ROUNDING.sub("#", value) if isinstance(value, str) else value


def main() -> None:
    """Write the results of all runs."""
    every = {name: found(name) for name in SCENES}
    STORED.write_text(json.dumps(every, indent=0) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
