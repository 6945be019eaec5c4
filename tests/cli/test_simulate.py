"""`simulate` and `work-precision`: files that other programs read, exit codes, one sentence on
standard error.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCENES = Path(__file__).parents[2] / "docs" / "scenes"


@pytest.fixture(scope="module", autouse=True)
def engine() -> None:
    """Load the engine once, because all worker processes are forked from this one."""
    import inverse_service.service.scenes.work_precision  # noqa: F401


def short(name: str, **changes: Any) -> bytes:
    return json.dumps(json.loads((SCENES / f"{name}.json").read_text()) | changes).encode()


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.json"
    path.write_bytes(short("disk", steps=40))
    return path


@pytest.mark.slow
def test_a_directory_gets_tables_figures_and_a_summary(
    call: Any, scene_file: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "new" / "out"
    code, out, _ = call("simulate", str(scene_file), "--output", str(folder))
    assert code == 0
    assert "nonholonomic-0" in out
    summary = json.loads((folder / "summary.json").read_text())
    labels = ["variational-0", "nonholonomic-0", "modified-0", "exact", "reference"]
    assert [method["label"] for method in summary["methods"]] == labels
    for method in summary["methods"]:
        assert method["outcome"] == "completed"
        assert method["steps"] == 40
        assert set(method["circle"]) >= {"radius_first", "radius_last", "centre_drift"}
        assert method["max_energy_error"] >= 0
        assert method["max_constraint"] >= 0
        rows = list(csv.reader((folder / f"{method['label']}.csv").read_text().splitlines()))
        assert rows[0][:5] == ["t", "phi", "theta", "x", "y"]
        assert set(rows[0]) >= {"v_phi", "energy", "constraint_1", "error"}
        with np.load(folder / f"{method['label']}.npz") as archive:
            columns = dict(archive)
        assert np.array(rows[1:], dtype=float)[:, 3].tolist() == columns["x"].tolist()
        assert len(columns["t"]) == 41
        assert set(columns) >= {"energy", "constraint_1", "error"}
        assert json.loads(str(columns["metadata"]))["scene"]["steps"] == 40
    for figure in summary["figures"]:
        assert figure["caption"].endswith(".")
        for name in figure["files"]:
            first = (folder / name).read_bytes()[:300]
            assert (
                first.startswith(b"\x89PNG")
                if name.endswith("png")
                else b"<svg" in first or b"<?xml" in first
            )
    assert {name for figure in summary["figures"] for name in figure["files"]} == {
        f"{name}.{ending}"
        for name in ("path", "energy", "discrete_energy", "constraints", "error")
        for ending in ("svg", "png")
    }


def test_without_a_directory_the_summary_is_printed(call: Any) -> None:
    code, out, err = call("simulate", "-", given=short("disk", steps=5, methods=["exact"]))
    assert (code, err) == (0, "")
    assert "points" not in json.loads(out)["methods"][0]
    asked = ("simulate", "-", "--format")
    assert json.loads(
        call(*asked, "json", given=short("disk", steps=5, methods=["exact"])).out
    ).keys() >= {"methods"}
    assert call(*asked, "text", given=short("disk", steps=5, methods=["exact"])).out.startswith(
        "method "
    )


def test_yaml_scenes_are_read(call: Any, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(
        'system: {coordinates: [x], lagrangian: "x\'^2/2 - x^2/2"}\n'
        "initial: {positions: {x: 1}, velocities: {x: 0}}\nstep: 0.1\nsteps: 5\nmethods: [variational]\n"
    )
    code, out, _ = call("simulate", str(path))
    assert code == 0
    assert json.loads(out)["methods"][0]["steps"] == 5


def test_bad_scenes_end_with_two_and_a_sentence(call: Any, tmp_path: Path) -> None:
    code, out, err = call("simulate", "-", given=short("disk", steps=-1))
    assert (code, out) == (2, "")
    assert "/steps" in err
    assert "Traceback" not in err
    code, _, err = call("simulate", str(tmp_path / "none.json"))
    assert code == 2
    code, _, err = call("work-precision", "-", given=short("disk", step_sizes=[1, 2]))
    assert code == 2
    assert "at least 8" in err


def test_a_doubtful_run_is_reported_and_completed(call: Any, tmp_path: Path) -> None:
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
        "step": 0.5,
        "time": 20,
    }
    scene |= {
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "methods": ["stormer-verlet"],
    }
    code, out, _ = call(
        "simulate", "-", "--no-figures", "--output", str(tmp_path), given=json.dumps(scene).encode()
    )
    assert code == 0
    assert "estimated error" in out.splitlines()[0]
    assert "stormer-verlet: The energy" in out
    assert "doubt" in json.loads((tmp_path / "summary.json").read_text())["methods"][0]


def test_what_does_not_converge_has_no_value(call: Any, tmp_path: Path) -> None:
    """The stage iteration of a pendulum on a spring with h omega = 10 does not converge."""
    lagrangian = "(x'^2+y'^2)/2 - 10^6*(sqrt(x^2+y^2)-1)^2/2 - 9.81*y"
    scene = {
        "system": {"coordinates": ["x", "y"], "lagrangian": lagrangian},
        "step": 0.01,
        "steps": 9,
    }
    initial = {"positions": {"x": 1, "y": 0}, "velocities": {"x": 0, "y": 0}}
    scene |= {"initial": initial, "methods": ["reference"]}
    code, out, _ = call(
        "simulate", "-", "--no-figures", "--output", str(tmp_path), given=json.dumps(scene).encode()
    )
    assert code == 1
    assert "the stage equations, whose" in out


@pytest.mark.slow
def test_no_method_that_gets_through_is_exit_one(call: Any) -> None:
    scene = short(
        "disk",
        steps=5,
        terms={"spring": "-x^2"},
        effects=["constraints", "spring"],
        methods=["exact"],
    )
    code, out, _ = call("simulate", "-", given=scene)
    assert code == 1
    assert json.loads(out)["methods"][0]["outcome"] == "unavailable"


def test_an_ensemble_with_some_completed_members_is_exit_zero(call: Any) -> None:
    scene = json.dumps({
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 + log(m + x)"}, "parameters": {"m": 1}, "step": 0.1,
        "initial": {"positions": {"x": 0}, "velocities": {"x": 1}}, "steps": 5, "methods": ["adaptive"],
        "ensemble": {"parameters": {"m": [0, 1]}},
    }).encode()  # fmt: skip
    code, out, _ = call("simulate", "-", given=scene)
    assert json.loads(out)["methods"][0]["outcome"] == "partly"
    assert code == 0


@pytest.mark.slow
def test_work_precision_writes_table_json_and_figure(call: Any, tmp_path: Path) -> None:
    scene = short(
        "particle-work-precision",
        time=2,
        repeats=1,
        methods=["variational", "nonholonomic", "exact"],
    )
    code, out, _ = call("work-precision", "-", "--output", str(tmp_path), given=scene)
    assert code == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {f"work-precision.{ending}" for ending in ("json", "csv", "svg", "png")}
    found = json.loads((tmp_path / "work-precision.json").read_text())
    assert all(sentence in out for sentence in found["sentences"])
    assert out.splitlines()[0].split()[0] == "error"
    assert [method["label"] for method in found["methods"]][:2] == [
        "variational-0.5",
        "nonholonomic-0.5",
    ]
    rows = list(csv.reader((tmp_path / "work-precision.csv").read_text().splitlines()))
    assert len(rows) == 1 + len(found["runs"])
    assert rows[0][:5] == ["method", "order", "step", "tolerance", "error"]


ENSEMBLE = {"initial": {"positions": {"x": [1, 2, 3]}}, "parameters": {"k": [1, 4]}}


@pytest.mark.slow
@pytest.mark.parametrize("further", [{}, {"ensemble": ENSEMBLE}], ids=["run", "ensemble"])
def test_netcdf_files_hold_every_recorded_step_with_units(
    call: Any, tmp_path: Path, further: dict[str, Any]
) -> None:
    """h5py, a second reader, finds all columns of the NPZ, the units, and the scene with the
    version.
    """
    h5py = pytest.importorskip("h5py")
    scene = {
        "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - k*x^2/2", "parameters": ["k"]},
        "parameters": {"k": 1}, "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
        "step": 0.01, "steps": 3000, "methods": ["stormer-verlet"], "observe": ["trajectory", "energy"],
        "units": {"x": "m", "v_x": "m/s", "t": "s"}, **further,
    }  # fmt: skip
    code, _, _ = call(
        "simulate", "-", "--output", str(tmp_path), "--no-figures", given=json.dumps(scene).encode()
    )
    assert code == 0
    with (
        h5py.File(tmp_path / "stormer-verlet.nc") as file,
        np.load(tmp_path / "stormer-verlet.npz") as archive,
    ):
        names = set(archive.files) - {"metadata"}
        assert names >= {"t", "x", "v_x", "energy"}
        for name in names:
            assert np.array_equal(file[name][...], archive[name], equal_nan=True), name
        assert file["x"].shape == ((6, 3001) if further else (3001,))
        assert [file[name].attrs["units"] for name in ("x", "v_x", "t")] == ["m", "m/s", "s"]
        metadata = json.loads(file.attrs["metadata"])
    assert metadata["scene"] == scene | {"step": "0.01"}  # numbers with a point stay exact
    assert metadata["provenance"]["version"]
