"""The knife edge on an inclined plane, which the paper leaves open, integrated with a Lagrangian of
its own.

m and J drop out of the motion: phi'' = 0, s' = G cos(phi), with s = x' cos(phi) + y' sin(phi) the
speed along the edge and G = g sin(alpha). On y' cos(phi) = x' sin(phi), with w = phi', it is the
motion of

    L = a w^2/2 + b (x y' - (s - G sin(phi)/(2 w))^2/(2 w) - G x/(2 w)) + c (x' sin(phi) - y' cos(phi))^2/2

for any constants a, b, c. docs/explanation/constrained-systems.md has this L with x'/cos(phi) in
the place of s, which is smooth in both velocities here. The square of the constraint makes L
regular: nothing is singular at cos(phi) = 0.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from inverse_service.service.scenes.drawing import shown
from paper import pictures
from paper.scenes import Run, run, scene
from paper.statement import Progress, Statement, Table, finding

CODE = "paper/inclined_edge.py"
G = "g*sin(alpha)"
LAGRANGIAN = (
    f"a*phi'^2/2 + b*(x*y' - (x'*cos(phi) + y'*sin(phi) - {G}*sin(phi)/(2*phi'))^2/(2*phi') - {G}*x/(2*phi'))"
    " + c*(x'*sin(phi) - y'*cos(phi))^2/2"
)
EDGE: dict[str, Any] = {
    "system": {
        "coordinates": ["phi", "x", "y"],
        "lagrangian": "m/2*(x'^2 + y'^2) + J/2*phi'^2 + m*g*sin(alpha)*x",
        "constraints": ["x'*sin(phi) - y'*cos(phi)"],
        "parameters": ["m", "J", "g", "alpha"],
    },
    "parameters": {"m": 1, "J": 1, "g": 1, "alpha": "pi/6"},
    "initial": {"positions": {"phi": 0.3, "x": 0, "y": 0}, "velocities": {"phi": 1, "x": 0.5}},
    "free_lagrangian": LAGRANGIAN,
    "constants": {"a": 1, "b": 1, "c": 1},
}
STEP, TIME = 0.05, 100
OBSERVED = ("trajectory", "energy", "constraints", "error")
ALPHAS = ("0", "1/2", "1")


def inclined_edge(folder: Path, progress: Progress) -> tuple[Statement, ...]:
    """The statement with its figures."""
    progress("knife edge on an inclined plane")
    kinds: list[dict[str, Any]] = [
        {"method": "variational", "form": "raw"},
        {"method": "nonholonomic"},
    ]
    methods = [{**kind, "alpha": alpha} for alpha in ALPHAS for kind in kinds]
    fourth = [{**kind, "order": 4} for kind in kinds]
    found = run(
        scene(EDGE, "Knife edge on an inclined plane", STEP, TIME, [*methods, *fourth], OBSERVED)
    )
    off = greatest_distance(found)
    rows = tuple(
        (
            m["label"],
            m["outcome"],
            *(shown(m[key]) for key in ("max_error", "max_energy_error", "max_constraint")),
        )
        for m in found.result["methods"]
    )
    outcomes = {m["outcome"] for m in found.result["methods"]}
    figures = (
        pictures.planes(
            [found.only("variational-0-raw", "nonholonomic-0")], [("y", "x")], folder, "inclined-edge-path",
            f"The knife edge on an inclined plane at alpha = 0, h = {STEP}, T = {TIME}: a cycloid across the slope.",
        ),
        pictures.series(
            found.only("variational-0.5-raw", "nonholonomic-0.5"), "energy", folder, "inclined-edge-energy",
            "Its energy T - V at alpha = 1/2, which L does not conserve: L has an energy of its own.",
        ),
        pictures.series(
            found.only("variational-0-raw", "variational-0.5-raw", "nonholonomic-0"), "constraints", folder,
            "inclined-edge-constraint",
            "The variational methods leave the constraint by an oscillation and a slow wave, the other one does not.",
        ),
        pictures.series(
            found.only("variational-0.5-raw", "nonholonomic-0.5"), "error", folder, "inclined-edge-differences",
            "Differences to the exact motion at alpha = 1/2.",
        ),
    )  # fmt: skip
    return (
        Statement(
            "inclined-edge", "section 5, the knife edge on an inclined plane",
            "Whether it can be given a Hamiltonian is left open.",
            finding(off < 1e-10 and outcomes == {"completed"}),
            "It can: the variational integrator of a Lagrangian whose motions on the constraint are those of the knife "
            "edge follows the nonholonomic motion through every cos(phi) = 0. At alpha = 0 and 1 it is closer to the "
            "exact motion than the nonholonomic method, whose energy grows or falls; it oscillates about the "
            "constraint. At alpha = 1/2 and at order 4 the nonholonomic method is better in all respects. "
            f"The reference solution agrees with the closed form to {shown(off)}.", CODE,
            (Table(("method", "outcome", "greatest error", "energy error", "constraint"), rows),), figures,
        ),
    )  # fmt: skip


def greatest_distance(found: Run) -> float:
    """How far the true motion of the scene is from the closed form, in x and y."""
    assert found.truth is not None
    phi = found.truth["phi"]
    start, slope = phi[0], 0.5  # G = g sin(pi/6)
    constant = 0.5 / np.cos(start) - slope * np.sin(
        start
    )  # s = G sin(phi) + constant, because w = 1
    x = slope * (np.sin(phi) ** 2 - np.sin(start) ** 2) / 2 + constant * (
        np.sin(phi) - np.sin(start)
    )
    turned = (phi - start) / 2 - (np.sin(2 * phi) - np.sin(2 * start)) / 4
    y = slope * turned - constant * (np.cos(phi) - np.cos(start))
    return float(max(np.abs(found.truth["x"] - x).max(), np.abs(found.truth["y"] - y).max()))
