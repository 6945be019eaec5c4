"""The examples and numbers of the pages about simulation are true."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import get_args

import pytest

from api_schemas.scene import MethodName, Observed, SceneDocument
from inverse_service.integrators.method_table import METHODS
from inverse_service.service.documents.plain_data import read_json
from inverse_service.service.scenes.simulating import simulate

ROOT = Path(__file__).parents[2]
PAGE = "\n".join(
    (ROOT / "docs" / page).read_text(encoding="utf-8")
    for page in (
        "simulation.md",
        "how-to/simulate.md",
        "how-to/choose-a-method.md",
        "reference/documents.md",
    )
)
ROUND_OFF = 2e-12


@pytest.mark.slow
def test_the_example_runs() -> None:
    examples = re.findall(r"```json.*?\n(.*?)```", PAGE, re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        result = simulate(read_json(example))
        assert {method["outcome"] for method in result["methods"]} == {"completed"}


def test_the_first_example_is_the_scene_in_the_folder() -> None:
    (first, *_) = re.findall(r"```json.*?\n(.*?)```", PAGE, re.DOTALL)
    assert json.loads(first) == json.loads(
        (ROOT / "docs" / "scenes" / "double-pendulum.json").read_text()
    )


def test_the_table_of_methods_is_that_of_the_program() -> None:
    for name, method in METHODS.items():
        if not method.scipy:
            orders = method.listed_orders or (
                "varies" if method.order is None else str(method.order)
            )
            row = (
                name.replace("_", "-"),
                method.needs,
                orders,
                "yes" if method.implicit else "no",
                method.cost,
            )
            assert "| `{}` | {} | {} | {} | {} |".format(*row) in PAGE


@pytest.mark.slow
def test_the_table_of_the_disk_is_measured() -> None:
    rows = re.findall(r"^\| ((?:variational|nonholonomic)-[\d.]+) \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) == 6
    scene = json.loads((ROOT / "docs" / "scenes" / "disk-table.json").read_text())
    found = {method["label"]: method for method in simulate(scene)["methods"]}
    for label, cells in rows:
        method = found[label]
        circle = method["circle"]
        measured = (circle["max_radial_distance"], circle["radius_change"], method["max_discrete_energy_error"],
                    method["max_constraint"], method["max_phase_error"])  # fmt: skip
        for cell, value in zip(cells.split(" | "), measured, strict=True):
            if cell == "round-off":
                assert abs(value) < ROUND_OFF
            else:
                assert value == pytest.approx(float(cell), rel=0.03)


def test_every_name_is_documented() -> None:
    for name in (*get_args(MethodName), *get_args(Observed)):
        assert f"`{name}`" in PAGE
    untold = {"name", "step_sizes", "repeats", "system"}
    for key in set(SceneDocument.model_fields) - untold:
        assert f"`{key}" in PAGE


def test_every_named_scene_is_there() -> None:
    for path in re.findall(r"docs/scenes/[\w-]+\.json", PAGE):
        assert (ROOT / path).is_file()
