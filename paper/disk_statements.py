"""Section 3.2: the vertically rolling disk, figures 2 to 7 as they are numbered in print (figure 1 draws the disk)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inverse_service.service.scenes.drawing import shown
from paper import pictures
from paper.scenes import DISK, Run, both, run, scene
from paper.statement import Progress, Statement, Table, finding

CODE = "paper/disk_statements.py"
ALL = ("trajectory", "energy", "constraints", "matching_circle", "phase", "error")
MODIFIED = {"method": "modified", "alpha": "0"}
ALPHAS = ("0", "1/3", "1/2", "1")
STEP = 0.2


def disk_statements(folder: Path, progress: Progress) -> tuple[Statement, ...]:
    """All statements about the disk; their figures are written to the folder."""
    progress("disk, alpha = 0")
    short = run(scene(DISK, "Disk, alpha = 0", STEP, 25, [*both("0"), MODIFIED], ALL))
    progress("disk, all alphas")
    methods = [method for alpha in ALPHAS for method in both(alpha)]
    long = run(scene(DISK, "Disk, all alphas", STEP, 100, methods, ALL))
    progress("disk, modified method")
    modified = run(scene(DISK, "Disk, modified method", STEP, 100, [MODIFIED], ALL))
    return (
        _circles(short),
        _spiral(short, folder),
        _energy(short, folder),
        _modified(short, modified, folder),
        _constraints(short, folder),
        _alphas(long, folder),
        _unchanged(long),
    )


def _circles(found: Run) -> Statement:
    truth = found.truth
    assert truth is not None
    radius = 0.5
    phi, x, y = truth["phi"], truth["x"], truth["y"]
    off_x = np.max(np.abs(x - x[0] - radius * (np.sin(phi) - math.sin(phi[0]))))
    off_y = np.max(np.abs(y - y[0] + radius * (np.cos(phi) - math.cos(phi[0]))))
    off = float(max(off_x, off_y))
    return Statement(
        "disk-exact", "section 3.2, equation (12)",
        "The disk runs on circles of radius R u_theta/u_phi.",
        finding(off < 1e-12),
        f"The quadratures of the class give the formula to {shown(off)} over t = 25.", CODE,
    )  # fmt: skip


def _spiral(found: Run, folder: Path) -> Statement:
    variational, nonholonomic = found.circle("variational-0"), found.circle("nonholonomic-0")
    drift = abs(variational["radius_change"])
    good = drift < 0.01 and nonholonomic["radius_change"] < -0.5 and variational["misfit"] < 0.01
    caption = (
        f"Figures 2 and 3: disk, alpha = 0, h = {STEP}. The nonholonomic path spirals inward and has lost "
        f"{shown(-100 * nonholonomic['radius_change'])} % of its radius; the variational one keeps its own circle "
        f"(misfit {shown(variational['misfit'])}), which is not the exact one."
    )
    figures = (
        pictures.paths(found, folder, "figure-2-disk", caption),
        pictures.paths(
            found.only("variational-0"), folder, "figure-3-circle",
            "Figure 3: the variational path with its matching circle (dashed) beside the exact one (broad).",
        ),
    )  # fmt: skip
    rows = tuple(
        (
            label,
            shown(c["radius_first"]),
            shown(c["radius_last"]),
            shown(c["misfit"]),
            shown(c["max_radial_distance"]),
        )
        for label, c in (("variational-0", variational), ("nonholonomic-0", nonholonomic))
    )
    return Statement(
        "disk-spiral", "section 3.2, figures 2 and 3",
        "At alpha = 0 the nonholonomic integrator spirals, the variational one follows a circle through three of its "
        "points that differs from the exact one.",
        finding(good),
        "Both are confirmed. The paper gives no data; phi' = 1, theta' = 1/2, phi(0) = 0.3 were taken, q1 on the "
        "discrete "
        "constraint as in the paper.", CODE,
        (Table(("method", "first radius", "last radius", "misfit of its circle", "off the exact circle / R"), rows),),
        figures,
    )  # fmt: skip


def _energy(found: Run, folder: Path) -> Statement:
    errors = {
        label: found.method(label)["max_discrete_energy_error"]
        for label in ("variational-0", "nonholonomic-0")
    }
    good = errors["variational-0"] < errors["nonholonomic-0"] / 5
    caption = (
        f"Figure 4: the energy error of the disk at alpha = 0 stays below {shown(errors['variational-0'])} for the "
        f"variational method and grows to {shown(errors['nonholonomic-0'])} for the nonholonomic one."
    )
    return Statement(
        "disk-energy", "section 3.2, figure 4",
        "The variational integrator does better on the energy than the nonholonomic one.",
        finding(good),
        f"True at alpha = 0: {shown(errors['variational-0'])} against {shown(errors['nonholonomic-0'])}. At alpha = "
        "1/2 the reverse holds, see below.", CODE,
        (), (pictures.series(found, "discrete_energy", folder, "figure-4-energy", caption),),
    )  # fmt: skip


def _modified(short: Run, long: Run, folder: Path) -> Statement:
    change = abs(short.circle("modified-0")["radius_change"])
    spiral, circle = (
        abs(short.circle(label)["radius_change"]) for label in ("nonholonomic-0", "variational-0")
    )
    method = long.method("modified-0")
    defect, later = method["max_constraint"], abs(long.circle("modified-0")["radius_change"])
    stopped = method.get("stopped")
    if stopped is None:
        end = f"Over T = 100 its radius changes by {shown(100 * later)} %."
    else:
        end = (
            f"The run over T = 100 ends {method['outcome']} at t = {stopped['time']:.4g}, on its own singular set; "
            f"until then its radius has changed by {shown(100 * later)} %."
        )
    return Statement(
        "disk-modified", "section 3.2, figure 5",
        "The modified integrator has the circular behavior of the variational one and conserves the constraints.",
        finding(change > 10 * circle and change < spiral / 5 and defect < 1e-12, "correction"),
        f"It conserves the constraints ({shown(defect)}) but follows no circle: over the length of the figure its "
        "radius changes "
        f"by {shown(100 * change)} %, that of the variational one by {shown(100 * circle)} %, that of the "
        f"nonholonomic spiral by {shown(100 * spiral)} %; its path is a slow spiral."
        f" {end} For alpha other than 1/2 it is not symplectic, and it is singular where "
        "1 + (theta'^2/phi'^3)(cos phi + sin phi) = 0.", CODE,
        (), (pictures.paths(short.only("modified-0"), folder, "figure-5-modified",
                            "Figure 5: the modified method at alpha = 0 with its matching circle (dashed)."),),
    )  # fmt: skip


def _constraints(found: Run, folder: Path) -> Statement:
    defect = found.tables["variational-0"]["constraint_1"]
    largest, crossings = (
        float(np.max(np.abs(defect))),
        int(np.count_nonzero(np.diff(np.sign(defect)))),
    )
    halves = [float(np.max(np.abs(part))) for part in np.array_split(defect, 2)]
    others = max(
        found.method(label)["max_constraint"] for label in ("nonholonomic-0", "modified-0")
    )
    good = crossings >= 4 and halves[1] < 1.5 * halves[0] and largest > 1e-3 and others < 1e-12
    caption = (
        "Figure 6: the defect of the discrete constraints. Nonholonomic and modified methods keep them to "
        f"round-off; the variational method with this Lagrangian oscillates within {shown(largest)}."
    )
    return Statement(
        "disk-constraints", "section 3.2, figure 6",
        "The variational integrator does not conserve the constraint but oscillates about zero; the others conserve "
        "it.",
        finding(good),
        f"Largest defect {shown(largest)}, {crossings} changes of sign over T = 25, no growth. With L~1 instead of "
        "L~2 the variational method keeps the discrete constraint to round-off, because p_2 and p_s are momenta of "
        "symmetries.", CODE,
        (), (pictures.series(found, "constraints", folder, "figure-6-constraints", caption),),
    )  # fmt: skip


def _rows(found: Run) -> tuple[tuple[str, ...], ...]:
    rows = []
    for alpha in ("0", "0.333333", "0.5", "1"):
        for kind in ("variational", "nonholonomic"):
            method = next(m for m in found.result["methods"] if _is(m, kind, alpha))
            circle = method["circle"]
            numbers = (circle["max_radial_distance"], circle["radius_change"], method["max_discrete_energy_error"],
                       method["max_constraint"], method["max_phase_error"], circle["centre_drift"])  # fmt: skip
            rows.append((kind, method["alpha"], *map(shown, numbers)))
    return tuple(rows)


def _is(method: Mapping[str, Any], kind: str, alpha: str) -> bool:
    return method["method"] == kind and abs(_number(str(method["alpha"])) - float(alpha)) < 1e-3


def _number(text: str) -> float:
    top, _, bottom = text.partition("/")
    return float(top) / float(bottom or 1)


HEAD = (
    "method",
    "alpha",
    "off the circle / R",
    "R_last/R_first - 1",
    "energy",
    "constraint",
    "phase",
    "center drift",
)


def _alphas(found: Run, folder: Path) -> Statement:
    by = {(kind, alpha): m["circle"]["radius_change"] for kind, alpha, m in _labelled(found)}
    inward, middle, outward = (by["nonholonomic", alpha] for alpha in (1 / 3, 1 / 2, 1.0))
    good = inward < -0.1 and abs(middle) < 1e-9 and outward > 10
    caption = (
        f"Figures 2 and 7: the disk for alpha = 0, 1/3, 1/2, 1 at h = {STEP}, T = 100. The nonholonomic spiral turns "
        "from inward to outward at alpha = 1/2, where it is a circle to round-off."
    )
    return Statement(
        "disk-alpha", "section 3.2, figure 7",
        "With alpha the inward spiral of the nonholonomic integrator becomes an outward one, and at alpha = 1/2 the "
        "two integrators have the same accuracy.",
        finding(good),
        "The spirals are as stated. At alpha = 1/2 the distance from the exact circle is the same for both, but "
        "energy, constraint and phase are conserved to round-off by the nonholonomic method only.", CODE,
        (Table(HEAD, _rows(found)),), (pictures.paths(found, folder, "figure-7-alpha", caption),),
    )  # fmt: skip


def _labelled(found: Run) -> list[tuple[str, float, Mapping[str, Any]]]:
    with_alpha = [m for m in found.result["methods"] if m["alpha"] is not None]
    return [(m["method"], _nearest(_number(str(m["alpha"]))), m) for m in with_alpha]


def _nearest(alpha: float) -> float:
    return min((0.0, 1 / 3, 1 / 2, 1.0), key=lambda value: abs(value - alpha))


def _unchanged(found: Run) -> Statement:
    sizes = {
        alpha: m["circle"]["max_radial_distance"]
        for kind, alpha, m in _labelled(found)
        if kind == "variational"
    }
    ratio = max(sizes.values()) / min(sizes.values())
    return Statement(
        "disk-unchanged", "section 3.2",
        "The variational results remain accurate and more or less unchanged when alpha is changed.",
        finding(ratio > 5, "correction"),
        f"The radius holds for every alpha, but the distance from the exact circle changes by a factor of "
        f"{shown(ratio)} between the best and the worst alpha ({shown(min(sizes.values()))} to "
        f"{shown(max(sizes.values()))} R): alpha = 1/2 is of order 2, every other alpha of order 1.", CODE,
    )  # fmt: skip
