"""The command line: exit codes, one sentence on standard error, never a traceback."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from inverse_service import __version__
from inverse_service.cli.solve_command import _is_open, given_document, kind_of_option
from inverse_service.service.documents.documents import parse_document
from inverse_service.service.jobs import tasks
from tests.serving import HARD

OSCILLATOR = {"coordinates": ["x"], "equations": {"x": "-x"}}
DISK = {
    "name": "disk & wheel_1",
    "coordinates": ["phi", "theta", "x", "y"],
    "equations": {
        "phi": "0",
        "theta": "0",
        "x": "-R*sin(phi)*phi'*theta'",
        "y": "R*cos(phi)*phi'*theta'",
    },
    "parameters": ["R"],
}


@pytest.fixture(scope="module", autouse=True)
def engine() -> None:
    """Load the engine once, because all worker processes are forked from this one."""
    tasks.load_engine()


def written(tmp_path: Path, document: Any, name: str = "system.json") -> str:
    path = tmp_path / name
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return str(path)


def test_an_oscillator_is_variational(call: Any, tmp_path: Path) -> None:
    found = call("solve", written(tmp_path, OSCILLATOR))
    assert found.code == 0, found.err
    result = json.loads(found.out)
    assert (result["verdict"], result["checked"], result["format"]) == (
        "variational",
        "valid",
        "inverse-service/result/1",
    )


def test_yaml_and_toml_mean_the_same_as_json(call: Any, tmp_path: Path) -> None:
    yaml = written(tmp_path, "coordinates: [x]\nequations:\n  x: -x\n", "s.yaml")
    toml = written(tmp_path, 'coordinates = ["x"]\n[equations]\nx = "-x"\n', "s.toml")
    systems = [json.loads(call("solve", file).out)["system"] for file in (yaml, toml)]
    assert systems[0] == systems[1]


@pytest.mark.slow
def test_the_verdict_is_checked_by_the_check_command(call: Any, tmp_path: Path) -> None:
    result = json.loads(call("solve", written(tmp_path, DISK)).out)
    assert result["verdict"] == "not_variational"
    assert call("check", written(tmp_path, result, "r.json")).code == 0
    result["verdict"] = "variational"
    flipped = call("check", written(tmp_path, result, "r.json"))
    assert (flipped.code, json.loads(flipped.out)["verdict"]) == (1, "invalid")


@pytest.mark.slow
def test_a_result_is_compared_with_the_document_in_a_file(call: Any, tmp_path: Path) -> None:
    result = written(
        tmp_path, call("solve", written(tmp_path, {"equations": "x'' + x = 0"})).out, "r.json"
    )
    same, other = (
        written(tmp_path, f"equations: x'' {sign} x = 0\n", f"{sign}.yaml") for sign in "+-"
    )
    assert call("check", result, "--document", same).code == 0
    found = call("check", result, "--document", other, "--format", "text")
    assert (found.code, found.out.split("\n")[0]) == (1, "invalid")


@pytest.mark.slow
def test_a_result_in_yaml_is_checked(call: Any, tmp_path: Path) -> None:
    result = json.loads(call("solve", "x'' = -x").out)
    assert call("check", written(tmp_path, yaml.safe_dump(result), "r.yaml")).code == 0
    forged = yaml.safe_dump(result | {"verdict": "not_variational"})
    assert call("check", written(tmp_path, forged, "f.yaml")).code == 1


@pytest.mark.parametrize("content", ["", "{", "[1]", "NaN", '{"a": 1, "a": 1}'])
def test_check_of_an_object_that_is_not_a_result_is_exit_2(
    call: Any, tmp_path: Path, content: str
) -> None:
    found = call("check", written(tmp_path, content))
    assert (found.code, found.err.count("\n")) == (2, 1)


def test_check_of_an_object_without_a_verdict_is_exit_1(call: Any, tmp_path: Path) -> None:
    assert call("check", written(tmp_path, "{}")).code == 1


@pytest.mark.slow
def test_text_is_readable(call: Any, tmp_path: Path) -> None:
    found = call("solve", written(tmp_path, DISK), "--format", "text", "--explain")
    assert found.code == 0
    assert "do not come from any regular Lagrangian." in found.out
    assert "phi'' = 0" in found.out
    assert "Phi = [[" in found.out


@pytest.mark.slow
def test_a_terminal_names_the_command_for_what_a_page_links(
    call: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = ["solve", "x'' = -a*x' + y; y'' = -b*y' + x", "--format", "text"]
    piped = call(*asked)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    shown = call(*asked)
    hint = "Decide all members: the same command with --family."
    assert shown.out == piped.out
    assert (hint in piped.err, hint in shown.err) == (False, True)


def test_a_result_goes_to_the_file_that_is_named(call: Any, tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    ended = call("solve", "sho", "-o", str(target))
    assert (ended.code, ended.out, json.loads(target.read_text())["verdict"]) == (
        0,
        "",
        "variational",
    )
    assert call("check", str(target)).code == 0
    assert call("solve", "sho", "-o", str(tmp_path / "none" / "result.json")).code == 2


@pytest.mark.slow
def test_latex_is_a_document_with_its_texts_escaped(call: Any, tmp_path: Path) -> None:
    out = call("solve", written(tmp_path, DISK), "--format", "latex", "--explain").out
    assert out.startswith("\\documentclass")
    assert "Disk \\& wheel\\_1" in out
    assert "\\ddot{" in out
    assert "(indices: 1 for $\\phi$, 2 for $\\theta$, 3 for $x$" in out


def test_latex_names_the_conditions_that_vanish(call: Any) -> None:
    out = call("solve", "x'' = -x - 2*x'", "--format", "latex", "--explain").out
    assert "\\[ \\nabla  \\Phi = 0 \\]" in out


@pytest.mark.slow
def test_a_time_limit_ends_the_run_as_undetermined(call: Any, tmp_path: Path) -> None:
    found = call("solve", written(tmp_path, HARD), "--time-limit", "0.5")
    assert found.code == 1, found.err
    result = json.loads(found.out)
    assert result["verdict"] == "undetermined"
    assert "limit" in result["reason"]


@pytest.mark.parametrize("limit", ["0", "-1", "nan", "inf", "1e9", "soon"])
def test_a_bad_time_limit_is_exit_2(call: Any, tmp_path: Path, limit: str) -> None:
    assert call("solve", written(tmp_path, OSCILLATOR), "--time-limit", limit).code == 2


@pytest.mark.parametrize("name", ["no-such-file.json", ".", "a\x00b"])
def test_a_file_that_cannot_be_read_is_exit_2(call: Any, name: str) -> None:
    found = call("solve", name)
    assert (found.code, found.err.count("\n")) == (2, 1)


def test_a_bad_setting_is_exit_2(
    call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("INVERSE_SERVICE_MEMORY_LIMIT", "lots")
    found = call("solve", written(tmp_path, OSCILLATOR))
    assert found.code == 2
    assert "INVERSE_SERVICE_MEMORY_LIMIT" in found.err


def test_a_fault_of_the_program_is_exit_3_and_no_traceback(
    call: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from inverse_service.solving import solving

    monkeypatch.setattr(solving, "solve_branches", lambda *arguments: 1 // 0)
    found = call("solve", written(tmp_path, OSCILLATOR))
    assert (found.code, found.err.count("\n")) == (3, 1)
    assert "error in the program" in found.err


@pytest.mark.slow
def test_the_catalogue_lists_names_and_gives_documents_that_solve_takes(
    call: Any, tmp_path: Path
) -> None:
    name = call("catalogue").out.split()[0]
    document = json.loads(call("catalogue", name).out)
    assert call("solve", written(tmp_path, document)).code == 0
    assert json.loads(call("catalogue", "--format", "json").out)["systems"][0]["name"] == name
    assert "source" in call("catalogue", name, "--format", "text").out


def test_an_unknown_name_of_the_catalogue_is_exit_2(call: Any) -> None:
    found = call("catalogue", "no such system")
    assert (found.code, found.err.count("\n")) == (2, 1)


def test_a_port_that_is_taken_is_exit_2(call: Any) -> None:
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert call("serve", "--port", str(taken.getsockname()[1])).code == 2


def test_options_of_a_document_hold_on_the_command_line_too(call: Any, tmp_path: Path) -> None:
    good = call("solve", written(tmp_path, OSCILLATOR | {"options": {"seed": 3}}))
    assert good.code == 0, good.err
    assert json.loads(good.out)["provenance"]["seed"] == 3
    bad = call("solve", written(tmp_path, OSCILLATOR | {"options": {"time_limit": 1e9}}))
    assert (bad.code, bad.out) == (2, "")
    assert "/options/time_limit" in bad.err


def test_the_version_is_printed(call: Any) -> None:
    found = call("--version")
    assert (found.code, found.out) == (0, f"inverse-service {__version__}\n")


@pytest.mark.slow
def test_equations_are_an_argument_and_what_was_guessed_is_said(call: Any) -> None:
    found = call("solve", "m*x'' = -k*x")
    assert (found.code, json.loads(found.out)["guessed"]) == (0, ["m", "k"])
    assert found.err == "Not declared, taken as constants: m, k.\n"
    assert "with constant k" in call("solve", "x'' = -k*x", "--format", "text").out


def test_a_suspect_name_is_asked_back_on_the_command_line(call: Any) -> None:
    found = call("solve", "x'' = -xm")
    assert (found.code, found.out) == (2, "")
    assert "did you mean x*m?" in found.err


def test_a_run_of_letters_with_one_meaning_is_parsed_and_noted(call: Any) -> None:
    found = call("solve", "mx'' = -kx")
    assert json.loads(found.out)["readings"] == [
        {"text": "mx", "as": "m*x"},
        {"text": "kx", "as": "k*x"},
    ]
    assert "kx as k*x" in found.err
    assert call("solve", "x'' = -kx", "--no-guess").code == 2


@pytest.mark.slow
def test_options_declare_names_for_a_text(call: Any) -> None:
    found = json.loads(
        call(
            "solve", "x'' = -q*B(y) + w; y'' = -y", "--parameters", "q=2,w", "--functions", "B(y)"
        ).out
    )
    assert found["system"]["equations"]["x"] == "-2*B(y) + w"
    assert (found["system"]["parameters"], found["guessed"]) == (["w"], [])
    assert '--functions "sn(u, k)"' in call("solve", "x'' = -sn(x, k)").err
    found = json.loads(call("solve", "y'' = -k*y/s", "--time", "s", "--coordinates", "y").out)
    assert (found["system"]["time"], found["guessed"]) == ("s", ["k"])


@pytest.mark.slow
def test_names_of_files_are_not_guessed_unless_asked(call: Any, tmp_path: Path) -> None:
    name = written(tmp_path, "x'' = -k*x\n", "spring.txt")
    assert call("solve", name).code == 2
    assert json.loads(call("solve", name, "--guess").out)["guessed"] == ["k"]
    assert call("solve", "x'' = -k*x", "--no-guess").code == 2
    assert json.loads(call("solve", "-", given=b"x'' = -x").out)["guessed"] == []


@pytest.mark.slow
def test_a_name_of_the_catalogue_is_an_argument(call: Any) -> None:
    assert json.loads(call("solve", "sho").out)["system"]["equations"] == {"x": "-x"}
    assert "in the dependent velocities" in call("solve", "knife-edge", "--format", "text").out
    assert "double-pendulum" in call("solve", "pendulum").err


@pytest.mark.slow
def test_kinds_and_a_clock_are_options(call: Any) -> None:
    options = (
        "--kind",
        "natural",
        "--kind",
        "rayleigh",
        "--kind",
        "invariant:y",
        "--clock",
        "1 + y^2",
    )
    done = call("solve", "x'' = -x'^3; y'' = 0", *options, "--format", "json")
    result = json.loads(done.out)
    found = {kind: part["verdict"] for kind, part in result["kinds"].items()}
    assert found == {
        "natural": "not_variational",
        "rayleigh": "not_variational",
        "invariant": "variational",
    }
    assert result["with_clock"]["factor"] in ("1 + y^2", "y^2 + 1")
    refused = call("solve", "x'' = -x", "--kind", "convex")
    assert (refused.code, "rayleigh" in refused.err) == (2, True)
    refused = call("solve", "x'' = -x", "--clock", "x'")
    assert (refused.code, "coordinates and parameters" in refused.err) == (2, True)


def test_a_lagrangian_alone_is_answered(call: Any, tmp_path: Path) -> None:
    name = written(tmp_path, {"lagrangian": "x'^2/2 - k*x^2/2", "parameters": ["k"]})
    found = call("solve", name, "--format", "text")
    assert (found.code, "  x'' = -k*x\n" in found.out, "with p_x = x'\n" in found.out) == (
        0,
        True,
        True,
    )
    assert "\\[ H = " in call("solve", name, "--format", "latex").out


@pytest.mark.parametrize(
    "text",
    [
        "Eq(Derivative(x(t), (t, 2)), -x(t))",
        "[Eq(Derivative(x(t), (t, 2)), -x(t))]",
        "{x''[t] == -x[t]}",
        "Equal[Derivative[2][x][t], Times[-1, x[t]]]",
    ],
)
def test_equations_of_other_programs_are_read_as_they_are_typed(text: str) -> None:
    assert parse_document(given_document(text, None))["equations"]["x"]["text"] == "-x"


def test_a_document_without_an_equals_sign_may_be_the_argument() -> None:
    assert given_document('{"lagrangian": "x^2"}', None) == {"lagrangian": "x^2"}


@pytest.mark.parametrize("text", ["invariant:x,y", "invariant: x , y"])
def test_blanks_in_a_kind_are_no_names(text: str) -> None:
    assert kind_of_option(text) == {"invariant": ["x", "y"]}
    assert kind_of_option("natural") == "natural"


@pytest.mark.parametrize(("verdict", "open_one"), [("variational", False), ("undetermined", True)])
def test_a_branch_without_a_verdict_is_open(verdict: str, open_one: bool) -> None:
    whole = {
        "system": {"given": {}}, "verdict": "variational", "branches": [{"verdict": verdict}],
    }  # fmt: skip
    assert _is_open(whole) is open_one
    assert _is_open({**whole, "verdict": "undetermined", "branches": []})
