"""Error against work: orders are right, round-off ends a curve, failures keep their reason and are
not drawn.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.service.documents.plain_data import read_json
from inverse_service.service.scenes.drawing import precision_figure
from inverse_service.service.scenes.simulating import simulate
from inverse_service.service.scenes.views import price_sentences
from inverse_service.service.scenes.work_precision import target_errors, work_precision
from inverse_service.simulation.precision import (
    Precision,
    Setting,
    _tolerances,
    measured_order,
    price_of,
    with_floor,
)
from inverse_service.simulation.scene_data import MethodChoice, Requested
from inverse_service.web.pages.simulations import precision_result
from tests.values import present

SCENES = Path(__file__).parents[2] / "docs" / "scenes"
METHOD = Requested("variational-0.5", MethodChoice("variational"), "0.5")


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    scene = read_json((SCENES / "particle-work-precision.json").read_bytes())
    scene["repeats"] = 2
    scene["methods"] += [
        {"method": "modified", "alpha": 0, "constants": {"C_y": 10**6, "C_z": -(10**6)}}
    ]
    return work_precision(scene)


@pytest.mark.slow
def test_measured_orders_are_those_of_the_methods(found: dict[str, Any]) -> None:
    orders = {method["label"]: method["measured_order"] for method in found["methods"]}
    for kind in ("variational", "nonholonomic"):
        assert orders[f"{kind}-0.5"] == pytest.approx(2, abs=0.1)
        assert orders[f"{kind}-0.5-order4"] == pytest.approx(4, abs=0.1)
        assert orders[f"{kind}-0.5-order6"] == pytest.approx(6, abs=0.15)
    assert orders["runge-kutta-order4"] == pytest.approx(4, abs=0.1)


@pytest.mark.slow
def test_runs_go_from_coarse_to_fine_with_all_columns(found: dict[str, Any]) -> None:
    for method in found["methods"]:
        settings = [run for run in found["runs"] if run["method"] == method["label"]]
        fineness = [setting["steps"] or -setting["tolerance"] for setting in settings]
        assert fineness == sorted(set(fineness))
        for setting in settings:
            if setting["reason"]:
                assert setting["error"] is None
                assert setting["seconds"] is None
            else:
                assert setting["first_seconds"] >= setting["compile_seconds"] >= 0
                assert 0 < setting["seconds"] <= setting["median_seconds"]
                assert setting["evaluations"] > 0 or method["method"] == "heyoka"


def test_the_price_list_has_every_method_at_every_error(found: dict[str, Any]) -> None:
    labels = {method["label"] for method in found["methods"]}
    assert [target["error"] for target in found["targets"]] == [1e-3, 1e-6, 1e-9, 1e-12]
    runs = {
        label: [run for run in found["runs"] if run["method"] == label and run["error"]]
        for label in labels
    }
    for target in found["targets"]:
        assert {row["method"] for row in target["rows"]} == labels
        reached = [row for row in target["rows"] if row["seconds"] is not None]
        assert reached == target["rows"][: len(reached)]
        assert [row["ratio"] for row in reached] == sorted(
            row["seconds"] / reached[0]["seconds"] for row in reached
        )
        for row in target["rows"]:
            best = min((run["error"] for run in runs[row["method"]]), default=1.0)
            assert (row["seconds"] is not None) == (best <= target["error"])
            if row["at_most"]:
                assert runs[row["method"]][0]["error"] <= target["error"]


def test_a_long_run_shows_what_drifts() -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}
    scene = {
        "system": system,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.1,
        "time": 10,
    }
    methods = ["stormer-verlet", {"method": "runge-kutta", "order": 4}]
    found = work_precision(scene | {"methods": methods, "long": True, "repeats": 6})
    long = {run["method"]: run for run in found["long"]}
    assert (
        long["stormer-verlet"]["energy_drift"]
        < 1e-5
        < 1e-3
        < long["runge-kutta-order4"]["energy_drift"]
    )
    assert (
        long["stormer-verlet"]["shape_change"] < 2e-3 < long["runge-kutta-order4"]["shape_change"]
    )
    assert "Over 100 times the time" in found["sentences"][-1]


@pytest.mark.slow
def test_heyoka_is_measured_by_tolerance() -> None:
    pytest.importorskip("heyoka")
    scene = read_json((SCENES / "particle-work-precision.json").read_bytes())
    found = work_precision(
        scene | {"repeats": 1, "methods": ["heyoka", {"method": "runge-kutta", "order": 4}]}
    )
    settings = [run for run in found["runs"] if run["method"] == "heyoka"]
    tolerances = [setting["tolerance"] for setting in settings]
    assert len(tolerances) >= 6
    assert tolerances == sorted(tolerances, reverse=True)
    assert {setting["step"] for setting in settings} == {None}
    assert settings[0]["error"] > 1e-7 > 1e-12 > settings[-1]["error"]
    assert found["methods"][0]["measured_order"] is None
    assert found["methods"][1]["measured_order"] == pytest.approx(4, abs=0.1)
    assert all(
        run["tolerance"] is None
        for run in found["runs"]
        if run not in settings and "SciPy" not in run["method"]
    )


def test_each_tolerance_is_that_of_its_run() -> None:
    asked = Requested("adaptive", MethodChoice("adaptive"), "adaptive")
    settings = [*_tolerances(asked, 1.0)]
    assert len(settings) >= 6
    assert all(one.requested.choice.tolerance == one.tolerance for one in settings)


@pytest.mark.slow
def test_what_failed_is_listed_and_not_drawn(found: dict[str, Any]) -> None:
    assert any(run["reason"] for run in found["runs"] if run["method"] == "modified-0")
    figure, caption = precision_figure(found)
    labels = {str(line.get_label()): line for line in figure.axes[0].get_lines()}
    lines = {
        label: line for label, line in labels.items() if not label.startswith("_")
    }  # others lead to names
    for method in found["methods"]:
        own = [run for run in found["runs"] if run["method"] == method["label"]]
        drawn = [run for run in own if run["seconds"] and not run["at_floor"] and run["error"]]
        assert (
            len(lines[method["label"]].get_xdata()) == len(drawn)
            if drawn
            else method["label"] not in lines
        )
    names = {text.get_text() for text in figure.axes[0].texts}
    assert names == set(lines)
    assert found["sentences"][0] in caption
    assert len(precision_figure(found, evaluations=True)[0].axes) == 2


@pytest.mark.slow
def test_the_machine_and_the_reference_are_reported(found: dict[str, Any]) -> None:
    assert found["truth"]["against"] == "exact"
    assert found["truth"]["uncertainty"] < 1e-13
    assert {"processor", "cores", "python", "numpy"} <= set(found["machine"])


def setting(step: float, error: float | None, best: float = 1.0) -> Setting:
    return Setting(METHOD, step, round(1 / step), error, "" if error is not None else "failed", best_seconds=best,
                   force_evaluations=1)  # fmt: skip


def test_a_curve_ends_at_the_round_off_floor() -> None:
    errors = [1e-4, 1e-8, 1e-12, 3e-15, 2e-15, 4e-15, 1e-15]
    marked = with_floor([setting(2.0**-k, error) for k, error in enumerate(errors)], 1.0)
    assert [one.at_floor for one in marked] == [False] * 4 + [True] * 3


def test_a_curve_that_still_falls_is_drawn_whole() -> None:
    marked = with_floor([setting(2.0**-k, 2.0**-k) for k in range(9)], 1.0)
    assert not any(one.at_floor for one in marked)


def test_a_failed_setting_has_no_floor_and_no_order() -> None:
    marked = with_floor([setting(0.5, None), setting(0.25, None)], 1.0)
    assert not any(one.at_floor for one in marked)
    assert measured_order(marked, 1.0) is None
    assert measured_order([], 1.0) is None


def test_the_time_to_an_error_is_interpolated() -> None:
    curve = [setting(0.1, 1e-2, 1.0), setting(0.01, 1e-6, 100.0)]

    def seconds(settings: list[Setting], error: float) -> float | None:
        price = price_of(settings, curve[0], error)
        return None if price is None else price.seconds

    assert seconds(curve, 1e-4) == pytest.approx(10)
    assert seconds(curve, 1e-1) == 1.0
    assert seconds(curve, 1e-8) is None
    assert seconds([replace(curve[0], error=None)], 1e-1) is None
    assert seconds([], 1.0) is None
    price = price_of(curve, curve[0], 1e-4)
    assert price is not None
    assert price.step == pytest.approx(0.1**1.5)


def test_an_error_that_a_setting_has_costs_what_the_setting_does() -> None:
    curve = [setting(0.1, 1e-2, 1.0), setting(0.05, 1e-4, 8.0), setting(0.025, 1e-7, 20.0)]
    for one in curve[1:]:
        price = price_of(curve, curve[0], present(one.error))
        assert present(price).seconds == pytest.approx(present(one.best_seconds))
    between = present(price_of(curve, curve[0], 1e-5))
    assert between.seconds == pytest.approx(8.0 * 2.5 ** (1 / 3))


def test_an_order_is_the_slope() -> None:
    assert measured_order(
        [setting(2.0**-k, 1e-3 * 8.0**-k) for k in range(5)], 1.0
    ) == pytest.approx(3)


@pytest.mark.parametrize(("order", "stages"), [(2, 1), (4, 5), (6, 9), (8, 17)])
def test_every_substep_of_a_composition_evaluates_its_forces(order: int, stages: int) -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}
    start = {"positions": {"x": 1}, "velocities": {"x": 0}}
    methods = [{"method": "stormer-verlet", "order": order}]
    found = simulate(
        {"system": system, "initial": start, "step": 0.1, "steps": 100, "methods": methods}
    )
    assert found["methods"][0]["force_evaluations"] == 100 * stages


@pytest.mark.parametrize(("coarsest", "sure"), [(1e-4, False), (1e-1, True), (None, True)])
def test_none_is_the_fastest_where_a_method_might_be_faster_than_its_coarsest_setting(
    coarsest: float | None, sure: bool
) -> None:
    """The variational method reaches 1e-3 in at most 5 s, the other in 3 s: longer steps may make
    the first faster.
    """
    other = Requested("other", MethodChoice("runge_kutta"))
    own = [setting(0.5, coarsest, 5.0), setting(0.25, 1e-4, 5.0)]
    settings = [
        *own,
        *(replace(setting(2.0**-k, 10.0 ** (1 - 5 * k), 3.0), requested=other) for k in range(2)),
    ]
    measured = Precision(None, None, 1.0, tuple(settings))  # type: ignore[arg-type]
    (text, *_) = price_sentences(
        target_errors(measured, {"variational-0.5": METHOD, "other": other})
    )
    assert ("1e-3: other;" in text or "1e-3: other." in text or "1e-3, " in text) == sure, text
    assert ("1e-3: other or variational-0.5" in text) != sure


def test_a_difference_below_the_uncertainty_of_the_reference_is_not_an_error() -> None:
    marked = with_floor([setting(2.0**-k, 10.0**-k) for k in range(8)], 1.0, 2e-5)
    assert [one.at_floor for one in marked] == [False] * 6 + [True] * 2


@pytest.mark.slow
def test_a_motion_known_only_for_some_time_is_rejected_with_the_reason() -> None:
    """The reason must not be that the results of all methods are not finite."""
    duffing = {"coordinates": ["x"], "equations": ["x'' = x - x^3 - 0.3*x' + 0.5*cos(1.2*t)"]}
    scene = {
        "system": duffing,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.05,
        "time": 400,
    }
    with pytest.raises(InputError, match=r"known until t = .* only"):
        work_precision(scene | {"methods": ["reference"], "repeats": 1}, None, 20.0)


def test_the_page_marks_what_is_better_than_asked(found: dict[str, Any]) -> None:
    job = {"id": "1", "kind": "work-precision", "status": "successful", "result": found}
    html = bytes(precision_result(job, '{"system": {}}').body).decode()
    marked = sum(row["at_most"] is True for target in found["targets"] for row in target["rows"])
    assert marked > 0
    assert html.count("\u2264 ") == marked
