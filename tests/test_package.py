"""The three functions of the package take documents and return the same results as the command
line.
"""

from __future__ import annotations

import math
import re
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

import inverse_service
from inverse_service import check, simulate, solve
from inverse_service.errors import InputError

SPRING: dict[str, Any] = {"equations": "x'' = -x", "time_dependent_lagrangian": False}
SCENE: dict[str, Any] = {
    "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"},
    "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
    "step": 0.1, "steps": 10, "methods": ("runge-kutta",), "observe": ["energy"],
}  # fmt: skip


def test_a_document_is_solved_and_its_result_checked() -> None:
    result = solve(SPRING)
    assert result["verdict"] == "variational"
    assert check(result) == check(result.to_json())
    assert check(result)["verdict"] == "valid"


def test_a_forged_lagrangian_is_refused() -> None:
    result = solve(SPRING)
    result["lagrangian"]["text"] = result["certificate"]["lagrangian"] = "x'^2/2 + x^2/2"
    assert check(result)["verdict"] == "invalid"


def test_python_values_are_those_of_json() -> None:
    document = {"coordinates": ("x",), "equations": {"x": 0.1}, "time_dependent_lagrangian": False}
    assert solve(document)["system"]["equations"] == {"x": "1/10"}


def test_a_lagrangian_of_ones_own_is_checked_as_over_http() -> None:
    system = {"equations": "x'' = -x"}
    assert (
        inverse_service.check({"system": system, "lagrangian": "x'^2/2 - x^2/2"})["verdict"]
        == "valid"
    )
    wrong = inverse_service.check({"system": system, "lagrangian": "x'^2/2 - x"})
    assert (wrong["verdict"], wrong["residual"]["x"]["text"]) == ("invalid", "1 - x")
    with pytest.raises(InputError, match="as in JSON"):
        inverse_service.check({"verdict": {1, 2}})


def test_options_of_a_document_and_of_the_call_hold() -> None:
    assert solve(SPRING, seed=5)["provenance"]["seed"] == 5
    assert solve({**SPRING, "options": {"seed": 7}}, seed=5)["provenance"]["seed"] == 7
    with pytest.raises(InputError, match="time limit"):
        solve({**SPRING, "options": {"time_limit": 61}})


@pytest.mark.parametrize(
    "document",
    [3, None, [], {}, {"equations": "x'' = omega", "parameters": []}, {"equations": {"x": object()}},
     {"equations": {"x": math.nan}}, {"equations": {"x": Fraction(1, 2)}},
     {**SPRING, "options": 1}, {"equations": {"x": "\ud800"}}],
    ids=lambda document: type(document).__name__,
)  # fmt: skip
def test_an_object_that_is_not_a_document_is_rejected_with_a_sentence(document: Any) -> None:
    with pytest.raises(InputError) as refused:
        solve(document)
    assert 10 < len(str(refused.value)) < 400


@pytest.mark.parametrize("result", ["", "no JSON", "{}", "[]", {}], ids=repr)
def test_an_object_that_is_not_a_result_is_invalid(result: Any) -> None:
    assert check(result)["verdict"] == "invalid"


def test_a_scene_is_simulated() -> None:
    (method,) = simulate(SCENE)["methods"]
    assert method["outcome"] == "completed"
    assert 0 < method["max_energy_error"] < 1e-5


def test_a_bad_scene_is_refused() -> None:
    with pytest.raises(InputError):
        simulate({**SCENE, "steps": -1})


def test_importing_the_package_loads_no_engine() -> None:
    program = "import sys, inverse_service; print(sorted({'numpy', 'flint', 'pydantic'} & set(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


@pytest.mark.slow
def test_what_workers_load_for_pages_leaves_out_the_web_framework() -> None:
    program = (
        "import importlib, sys; from inverse_service.web.pages import TASKS; "
        "[importlib.import_module(name) for name in TASKS]; print(sorted({'fastapi', 'uvicorn'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


def test_every_public_name_is_there() -> None:
    assert {"check", "simulate", "solve"} <= set(inverse_service.__all__)
    assert all(getattr(inverse_service, name) is not None for name in inverse_service.__all__)


WITHOUT_EXTRAS = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in "llvmlite numba symengine matplotlib heyoka distributed psycopg".split():
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
import inverse_service.web.application
from inverse_service.cli.command_line import load_commands
load_commands()
from inverse_service.service.jobs import tasks
tasks.load_engine()
"""


def test_solver_server_and_command_line_load_without_any_extra() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-800:]


def test_every_phony_target_of_the_makefile_has_a_rule() -> None:
    """Without a rule, make prints "nothing to be done" and succeeds."""
    text = (Path(__file__).parents[1] / "Makefile").read_text(encoding="utf-8")
    targets = [
        name for line in re.findall(r"^\.PHONY: (.*)$", text, re.MULTILINE) for name in line.split()
    ]
    assert "installed" in targets
    assert [name for name in targets if not re.search(rf"^{name}:", text, re.MULTILINE)] == []
