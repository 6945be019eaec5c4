"""Scenes with forces, observables, and events by formula, start times, restarts, and ensembles."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest

from api_schemas.scene import Observed
from inverse_service.errors import InputError
from inverse_service.service.scenes import scene_reading
from inverse_service.service.scenes.simulating import simulate, simulate_tables
from inverse_service.simulation import lyapunov

OSCILLATOR = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}
START = {"positions": {"x": 1}, "velocities": {"x": 0}}
EIGHTH = {"method": "variational", "order": 8}


def scene(system: dict[str, Any], methods: list[Any], **more: Any) -> dict[str, Any]:
    return {"system": system, "initial": START, "step": 0.05, "time": 20, "methods": methods} | more


def labelled(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {method["label"]: method for method in simulate(document)["methods"]}


@pytest.mark.slow
@pytest.mark.parametrize(
    "force", [{"forces": {"x": "-c*x'"}}, {"rayleigh": "c*x'^2/2"}], ids=["forces", "rayleigh"]
)
def test_friction_acts_in_every_method(force: dict[str, Any]) -> None:
    """x'' = -x - c x' has x = exp(-ct/2)(cos wt + c/2w sin wt)."""
    methods = [
        "variational", EIGHTH, {"method": "variational", "alpha": 0}, {"method": "variational", "form": "raw"},
        "nonholonomic", "adaptive", "reference",
    ]  # fmt: skip
    document = scene(
        OSCILLATOR, methods, parameters={"c": 0.1}, observe=["energy", "trajectory"], **force
    )
    bounds = {
        "variational-0": 3e-2,
        "variational-0.5-order8": 1e-12,
        "adaptive": 1e-10,
        "reference": 1e-12,
    }
    for label, method in labelled(document).items():
        columns = method["points"]["columns"]
        t, w = np.array(columns["t"]), np.sqrt(1 - 0.05**2)
        exact = np.exp(-0.05 * t) * (np.cos(w * t) + 0.05 / w * np.sin(w * t))
        assert np.abs(np.array(columns["x"]) - exact).max() < bounds.get(label, 2e-3), label
        assert method["max_energy_error"] is None
        assert method["work"] == pytest.approx(columns["energy"][-1] - 0.5, abs=0.02)
        assert method["max_balance_error"] < 0.02


def test_friction_acts_with_constraints() -> None:
    """A knife edge with friction: the speed decays as exp(-ct), and the angle turns uniformly."""
    system = {"coordinates": ["phi", "x", "y"], "lagrangian": "(x'^2+y'^2+phi'^2)/2",
              "constraints": ["sin(phi)*x' - cos(phi)*y'"], "parameters": ["c"]}  # fmt: skip
    start = {"positions": {"phi": 0, "x": 0, "y": 0}, "velocities": {"phi": 0.5, "x": 1}}
    methods = ["variational", {"method": "nonholonomic", "order": 4}, "modified"]
    document = scene(system, methods, initial=start, parameters={"c": 0.1}, rayleigh="c*(x'^2+y'^2)/2",
                     observe=["trajectory"])  # fmt: skip
    found = labelled(document)
    assert found["variational-0.5"]["outcome"] == found["modified-0.5"]["outcome"] == "unavailable"
    columns = found["nonholonomic-0.5-order4"]["points"]["columns"]
    path = (np.exp((-0.1 + 0.5j) * np.array(columns["t"])) - 1) / (-0.1 + 0.5j)
    assert np.abs(np.array(columns["x"]) + 1j * np.array(columns["y"]) - path).max() < 1e-6


@pytest.mark.slow
def test_a_force_that_is_not_named_does_not_act() -> None:
    document = scene(
        OSCILLATOR,
        ["variational"],
        parameters={"c": 0.1},
        forces={"x": "-c*x'"},
        observe=["energy"],
    )
    (free,) = labelled(document | {"effects": ["potential"]}).values()
    (held,) = labelled(document | {"effects": ["potential", "forces"]}).values()
    assert free["max_energy_error"] < 1e-14
    assert held["max_energy_error"] is None


def test_observables_by_formula() -> None:
    """The angular momentum of a Kepler orbit in Cartesian coordinates."""
    kepler = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2 + 1/sqrt(x^2+y^2)"}
    start = {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 0.8}}
    document = scene(
        kepler,
        ["variational", "adaptive"],
        initial=start,
        observe=[{"Lz": "x*y' - y*x'", "r": "sqrt(x^2+y^2)"}],
    )
    for method in labelled(document).values():
        assert method["observables"]["Lz"]["first"] == pytest.approx(0.8)
        assert (
            method["observables"]["Lz"]["greatest"] - method["observables"]["Lz"]["least"] < 1e-10
        )
        assert method["observables"]["r"]["least"] == pytest.approx(0.8**2 / (1 + 0.36), rel=2e-2)
        assert set(method["points"]["columns"]) == {"t", "Lz", "r"}


EVERYTHING = [
    name for name in get_args(Observed) if name not in ("lyapunov", "period", "cost")
]  # numbers alone
FOLLOWED = {
    "coordinates": ["x", "y"],
    "lagrangian": "exp(t/9)*(x'^2 + y'^2 - x^2)/2",
    "constraints": ["y' - x*x'"],
}
AT_REST = {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 0}}


def test_no_observable_replaces_a_column_that_a_run_has() -> None:
    """Each column of three runs that together observe everything is a name that an observable
    cannot have.
    """
    seen = ["energy", "momenta", "velocities"]
    driven = scene(
        OSCILLATOR, ["variational"], forces={"x": "sin(t) - x'/9"}, observe=seen, time=0.3
    )
    damped = scene({"equations": {"x": "-x - x'/5"}}, ["adaptive"], observe=seen, time=0.3)
    held = scene(
        FOLLOWED, ["adaptive", "nonholonomic"], initial=AT_REST, observe=EVERYTHING, time=0.3
    )
    met = set[str]()
    for document in (driven, damped, held):
        runs = simulate_tables(document)["tables"].values()
        own = {name for run in runs for name in run} - {"x", "y"}
        met |= own
        for name in own:
            with pytest.raises(InputError, match=f"has the name {name}: choose") as refused:
                scene_reading.read_scene(
                    scene_reading.scene_schema(document | {"observe": [{name: "7"}]})
                )
            assert refused.value.pointer == f"/observe/0/{name}"
    assert met >= {
        "t",
        "v_x",
        "p_x",
        "energy",
        "mechanical_energy",
        "power",
        "work",
        "conserved_1",
        "error",
        "phase_error",
    }
    assert met >= {"constraint_1", "lambda_1", "force_x", "force_y"}


def test_a_point_of_a_body_does_not_replace_a_column() -> None:
    held = scene(
        FOLLOWED,
        ["adaptive"],
        initial=AT_REST,
        observe=["constraint_forces"],
        points={"force": ["x", "y"]},
    )
    with pytest.raises(InputError, match="has the name force_x: choose"):
        simulate(held)


def test_a_parameter_of_an_ensemble_does_not_replace_a_column() -> None:
    system = {"equations": {"x": "-x_end*x"}, "parameters": ["x_end"]}
    document = scene(
        system, ["adaptive"], ensemble={"parameters": {"x_end": [1, 2]}}, parameters={"x_end": 1}
    )
    with pytest.raises(InputError, match="has the name x_end: choose"):
        simulate(document)


def test_a_name_that_only_looks_like_a_column_is_free() -> None:
    document = scene(
        OSCILLATOR,
        ["adaptive"],
        observe=["energy", {"force_y": "-x", "lambda_1": "x", "kinetic": "x'^2/2"}],
    )
    (method,) = labelled(document).values()
    assert set(method["observables"]) == {"force_y", "lambda_1", "kinetic"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", ["adaptive", "reference", "heyoka", EIGHTH, {"method": "nonholonomic", "order": 8}]
)
def test_events_are_located_to_round_off(method: Any) -> None:
    if method == "heyoka":
        pytest.importorskip("heyoka")
    events = [{"when": "x = 0", "direction": -1}, {"when": "x'"}]
    (found,) = labelled(scene(OSCILLATOR, [method], step=0.1, events=events)).values()
    down, turns = found["events"]
    assert np.abs(np.array(down["columns"]["t"]) - np.pi * np.array([0.5, 2.5, 4.5])).max() < 1e-10
    assert np.abs(np.array(down["columns"]["v_x"]) + 1).max() < 1e-10
    assert np.abs(np.array(turns["columns"]["t"]) - np.pi * np.arange(1, 7)).max() < 1e-10


def test_an_event_of_a_method_is_where_its_own_motion_is() -> None:
    """The midpoint rule turns too slowly: its crossings follow its own frequency 2 atan(h/2)/h."""
    (found,) = labelled(
        scene(OSCILLATOR, ["variational"], step=0.1, events=[{"when": "x", "direction": -1}])
    ).values()
    slow = 2 * np.arctan(0.05) / 0.1
    assert (
        np.abs(
            np.array(found["events"][0]["columns"]["t"]) * slow - np.pi * np.array([0.5, 2.5, 4.5])
        ).max()
        < 1e-3
    )


@pytest.mark.slow
def test_a_projectile_stops_at_the_ground() -> None:
    """Without drag it lands at t = 2 v/g; with quadratic drag earlier."""
    system = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2 - 10*y", "parameters": ["k"]}
    start = {"positions": {"x": 0, "y": 0}, "velocities": {"x": 30, "y": 30}}
    drag = {name: f"-k*{name}'*sqrt(x'^2+y'^2)" for name in "xy"}
    stop = [{"when": "y", "direction": -1, "do": "stop"}]
    document = scene(
        system,
        ["adaptive", "variational"],
        initial=start,
        forces=drag,
        events=stop,
        observe=["trajectory"],
    )
    for k, time in ((0, 6.0), (0.01, 4.6841)):
        for method in labelled(document | {"parameters": {"k": k}}).values():
            assert method["outcome"] == "completed"
            assert "ended by an event" in method["note"]
            assert method["events"][0]["columns"]["t"] == pytest.approx(
                [time], abs=2e-3 if k else 1e-9
            )
            assert min(method["points"]["columns"]["y"]) >= 0
            assert method["final"]["t"] == method["events"][0]["columns"]["t"][0]
            assert abs(method["final"]["positions"]["y"]) < 1e-12
            assert method["steps"] == len(method["points"]["columns"]["t"]) - 1


@pytest.mark.slow
def test_a_section_of_henon_and_heiles_keeps_its_energy() -> None:
    system = {
        "coordinates": ["x", "y"],
        "lagrangian": "(x'^2+y'^2)/2 - (x^2+y^2)/2 - x^2*y + y^3/3",
    }
    start = {"positions": {"x": 0, "y": 0.1}, "velocities": {"x": 0.3, "y": 0.1}}
    document = scene(
        system, [EIGHTH], initial=start, time=500, events=[{"when": "x", "direction": 1}]
    )
    (found,) = labelled(document).values()
    columns = {name: np.array(column) for name, column in found["events"][0]["columns"].items()}
    assert found["events"][0]["count"] > 70
    assert np.abs(columns["x"]).max() < 1e-14
    energy = (columns["v_x"] ** 2 + columns["v_y"] ** 2 + columns["y"] ** 2) / 2 - columns[
        "y"
    ] ** 3 / 3
    assert np.ptp(energy) < 1e-10


def test_events_need_every_step() -> None:
    with pytest.raises(InputError, match="events need every step"):
        simulate(scene(OSCILLATOR, ["adaptive"], record_every=10, events=[{"when": "x"}]))


def test_a_scene_starts_at_its_time_and_continues_a_result() -> None:
    driven = {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2 + x*cos(2*t)"}
    methods = [EIGHTH]
    whole = simulate(scene(driven, methods, start_time=3, observe=["error", "trajectory"]))
    first = simulate(scene(driven, methods, start_time=3, time=10))
    second = scene(driven, methods, time=10, restart=first, observe=["trajectory"])
    del second["initial"]
    columns = simulate(second)["methods"][0]["points"]["columns"]
    assert whole["methods"][0]["max_error"] < 1e-9
    assert whole["methods"][0]["points"]["columns"]["t"][0] == 3
    assert columns["t"][-1] == pytest.approx(23)
    assert columns["x"][-1] == pytest.approx(
        whole["methods"][0]["points"]["columns"]["x"][-1], abs=1e-12
    )
    with pytest.raises(InputError, match="begins where the result"):
        simulate(scene(driven, methods, restart=first))


def test_an_ensemble_of_starts_and_parameters() -> None:
    system = {"coordinates": ["x"], "lagrangian": "x'^2/2 - k*x^2/2", "parameters": {"k": 1}}
    ensemble = {"initial": {"positions": {"x": [1, 2, 3]}}, "parameters": {"k": [1, 4]}}
    document = scene(
        system,
        ["reference", "variational", "heyoka"],
        ensemble=ensemble,
        observe=["energy", {"a": "x^2"}],
    )
    found = labelled(document)
    assert found["heyoka"]["outcome"] == "unavailable"
    columns = found["reference"]["members_columns"]
    assert columns["k"] == [1, 4] * 3
    assert columns["x_start"] == [1, 1, 2, 2, 3, 3]
    expected = np.array(columns["x_start"]) * np.cos(np.sqrt(columns["k"]) * 20)
    assert np.abs(np.array(columns["x_end"]) - expected).max() < 1e-11
    assert np.allclose(columns["a_end"], expected**2)
    assert found["variational-0.5"]["max_energy_error"] < 1e-13
    tables = simulate_tables(document)["tables"]["reference"]
    assert tables["x"].shape == (6, len(tables["t"]))


def test_members_of_an_ensemble_end_by_themselves() -> None:
    kepler = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2 + 1/sqrt(x^2+y^2)"}
    start = {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 1}}
    ensemble = {"initial": {"velocities": {"y": [1, 0.9, 0]}}}
    (found,) = labelled(
        scene(kepler, ["adaptive"], initial=start, ensemble=ensemble, time=5)
    ).values()
    assert found["outcome"] == "partly"
    assert found["outcomes"] == {"completed": 2, "singular": 1}
    assert found["ended"][0]["member"] == 2
    none = {"initial": {"velocities": {"y": [0, 0]}}}
    (found,) = labelled(scene(kepler, ["adaptive"], initial=start, ensemble=none, time=5)).values()
    assert found["outcome"] == "singular"


@pytest.mark.slow
def test_members_are_put_on_the_constraints() -> None:
    disk = {"catalogue": "vertically-rolling-disk"}
    start = {
        "positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0},
        "velocities": {"phi": 1, "theta": 0.5},
    }
    document = {
        "system": disk, "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"}, "initial": start, "step": 0.05,
        "steps": 50, "methods": ["variational", "nonholonomic"],
        "ensemble": {"initial": {"velocities": {"theta": [0.5, 1]}}},
    }  # fmt: skip
    found = labelled(document)
    single = labelled(
        {key: value for key, value in document.items() if key != "ensemble"}
        | {"observe": ["trajectory"]}
    )
    for label, method in found.items():
        assert method["outcomes"] == {"completed": 2}
        alone = single[label]["points"]["columns"]["x"][-1]
        assert method["members_columns"]["x_end"][0] == pytest.approx(alone, abs=1e-12)


DISK: dict[str, Any] = {
    "system": {"catalogue": "vertically-rolling-disk"}, "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {"positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 0.5}},
    "step": 0.05, "steps": 50, "methods": ["variational", "nonholonomic", "reference"], "observe": [],
}  # fmt: skip


@pytest.mark.slow
def test_each_member_is_on_the_constraints_of_its_own_parameters() -> None:
    """The constraints contain R: with R = 2 the disk rolls twice as far."""
    single = labelled(DISK | {"parameters": DISK["parameters"] | {"R": 2}})
    starts = (
        {},
        {"initial": {"positions": {"theta": [0]}}},
        {"initial": [{"positions": {"theta": 0}}]},
    )
    for further in starts:
        for label, method in labelled(
            DISK | {"ensemble": {"parameters": {"R": [1, 2]}} | further}
        ).items():
            assert method["outcomes"] == {"completed": 2}
            assert method["members_columns"]["x_end"][1] == pytest.approx(
                single[label]["final"]["positions"]["x"]
            )


def test_each_member_has_the_momenta_that_were_given() -> None:
    """p = m v, so twice the mass has half the speed."""
    system = {"coordinates": ["x"], "lagrangian": "m*x'^2/2", "parameters": ["m"]}
    start = {"positions": {"x": 0}, "momenta": {"x": 1}}
    document = scene(
        system,
        ["reference"],
        initial=start,
        parameters={"m": 1},
        ensemble={"parameters": {"m": [1, 2]}},
    )
    (found,) = labelled(document).values()
    for place in ("start", "end"):
        assert found["members_columns"][f"v_x_{place}"] == pytest.approx([1, 0.5])
    with pytest.raises(InputError, match="columns of starts need"):
        simulate(document | {"ensemble": {"initial": {"positions": {"x": [0, 1]}}}})


def test_velocities_of_a_member_that_break_the_constraints_are_refused() -> None:
    with pytest.raises(
        InputError, match=r"member 1: the velocities violate constraint 1 by -0\.9"
    ) as refused:
        simulate(
            DISK | {"ensemble": {"initial": {"velocities": {"x": [0.5 * math.cos(0.3), -0.4223]}}}}
        )
    assert refused.value.pointer == "/ensemble/initial/velocities"
    assert '"project"' in refused.value.detail
    plain = refused.value.places[0].plain  # the value from a form, which has no such key
    assert "the nearest that fit are (" in plain
    assert '"' not in plain


@pytest.mark.slow
def test_many_starts_are_put_on_constraints_at_once() -> None:
    angles = np.linspace(0, 1, 10_000).tolist()
    (found,) = labelled(
        DISK
        | {
            "methods": ["nonholonomic"],
            "steps": 2,
            "ensemble": {"initial": {"positions": {"phi": angles}}},
        }
    ).values()
    assert found["outcomes"] == {"completed": 10_000}


@pytest.mark.slow
def test_lyapunov_exponents_come_from_the_variational_equations() -> None:
    """x'' = x has the exponent 1; an oscillator none; friction c divides by two."""
    for equation, expected in (("x'' = x", 1.0), ("x'' = -x", 0.0), ("x'' = -x - x'/5", -0.1)):
        system = {"coordinates": ["x"], "equations": [equation]}
        found = simulate(scene(system, ["adaptive"], time=200, step=1, observe=["lyapunov"]))[
            "lyapunov"
        ]
        assert found["largest"] == pytest.approx(expected, abs=0.02)
    pole = {"coordinates": ["x"], "equations": ["x'' = -1/x^2"]}
    found = simulate(scene(pole, ["adaptive"], time=5, observe=["lyapunov"]))["lyapunov"]
    assert found["largest"] is None
    assert "ends at t = 1.1" in found["note"]


def test_an_exponent_for_which_the_time_was_over_says_so() -> None:
    long = scene(
        {"coordinates": ["x"], "equations": ["x'' = -sin(x)"]},
        ["adaptive"],
        time=5,
        observe=["lyapunov"],
    )
    assert simulate(long, None, 0.001)["lyapunov"]["note"].startswith("The time limit was reached")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "start", "published"),
    [("-x'/20 - x^3 + 7.5*cos(t)", 2.5, 0.1034), ("-x'/4 + x - x^3 + 2*cos(t)/5", 0.2, 0.1572),
     ("-x^3 + sin(1.88*t)", 0, 0.0971)],
    ids=["Ueda", "Duffing, two wells", "simplest driven"],
)  # fmt: skip
def test_lyapunov_exponents_are_those_published(force: str, start: float, published: float) -> None:
    """J. C. Sprott, Chaos and Time-Series Analysis, Oxford 2003, appendix A.5 (driven dissipative
    and conservative).
    """
    system = {"coordinates": ["x"], "equations": [f"x'' = {force}"]}
    given = {"positions": {"x": start}, "velocities": {"x": 0}}
    document = scene(system, ["adaptive"], initial=given, step=1, time=10_000, observe=["lyapunov"])
    assert simulate(document, None, 300.0)["lyapunov"]["largest"] == pytest.approx(
        published, abs=0.005
    )


def test_the_potential_of_a_high_power_is_not_multiplied_out() -> None:
    """(1 + x^2 y^2)^-5 at q + d/2 has tens of thousands of terms: expanding it would take minutes
    and gigabytes.
    """
    system = {"coordinates": ["x", "y"], "lagrangian": "(x'^2+y'^2)/2-50/(1+x^2*y^2)^4"}
    given = {"positions": {"x": 2.0, "y": 0.3}, "velocities": {"x": -1.0, "y": 0.2}}
    (method,) = simulate(
        scene(system, ["variational"], initial=given, step=0.001, time=1, observe=["energy"])
    )["methods"]
    assert method["outcome"] == "completed"
    assert method["max_energy_error"] < 1e-4


@pytest.mark.parametrize("method", [
    "variational", {"method": "variational", "form": "raw"}, {"method": "variational", "alpha": 0},
    {"method": "stormer-verlet", "order": 8}, "nonholonomic", "reference", "adaptive",
], ids=str)  # fmt: skip
def test_the_velocities_of_a_row_are_those_of_its_time(method: Any) -> None:
    """They are not those of the step that ends there, which at order 8 are off by half a step."""
    found = simulate({
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}, "step": 0.01, "time": 3,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "methods": [method],
        "observe": ["trajectory", "velocities"],
    })["methods"][0]  # fmt: skip
    columns = found["points"]["columns"]
    assert columns["v_x"][-1] == found["final"]["velocities"]["x"]
    assert np.array(columns["v_x"]) == pytest.approx(
        -np.sin(columns["t"]), abs=1e-4 if method != {"method": "variational", "alpha": 0} else 6e-3
    )


@pytest.mark.parametrize(
    ("system", "exponent"),
    [
        ({"coordinates": ["x", "y"], "equations": ["x'' = x", "y'' = 0"]}, 1.0),
        # x is constant on the constraint; beside it x' grows as exp(t).
        ({"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2", "constraints": ["exp(-y)*x'"]}, 0.0),
    ],
)  # fmt: skip
def test_half_of_a_run_has_the_exponent_of_the_whole_one(
    monkeypatch: pytest.MonkeyPatch, system: dict[str, Any], exponent: float
) -> None:
    monkeypatch.setattr(lyapunov, "PARTS", 10)
    given = {"positions": {"x": 0, "y": 0}, "velocities": {"x": 0, "y": 1}}
    document = {"system": system, "initial": given, "step": 1, "time": 20, "methods": ["adaptive"]}
    found = simulate(document | {"observe": ["lyapunov"]})["lyapunov"]
    assert found["largest"] == pytest.approx(exponent, abs=0.2)
    assert found["half"] == pytest.approx(exponent, abs=0.2)


@pytest.mark.slow
def test_motions_that_break_the_constraints_have_no_exponent() -> None:
    """x is constant and y' = 1: nothing diverges. If exp(-y) x' is another constant, x' grows as
    exp(t).
    """
    system = {
        "coordinates": ["x", "y"],
        "lagrangian": "(x'^2 + y'^2)/2",
        "constraints": ["exp(-y)*x'"],
    }
    found = simulate({
        "system": system, "initial": {"positions": {"x": 0, "y": 0}, "velocities": {"x": 0, "y": 1}}, "step": 0.1,
        "time": 20, "methods": ["adaptive"], "observe": ["lyapunov"],
    })  # fmt: skip
    assert found["lyapunov"]["largest"] == pytest.approx(0, abs=0.2)
