"""The OpenAPI description is true: accepted requests and responses validate, and everything has a
description.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import jsonschema_rs
import pytest
from openapi_spec_validator import OpenAPIV31SpecValidator

from inverse_service import catalogue
from inverse_service.settings import read_settings
from inverse_service.web.application import create_application
from tests.docs.blocks import PAGES, blocks
from tests.values import slow

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def description() -> dict[str, Any]:
    found: dict[str, Any] = create_application(read_settings()).openapi()
    return json.loads(json.dumps(found))


def objects(value: Any) -> Any:
    if isinstance(value, dict):
        if isinstance(value.get("properties"), dict):
            yield value
        for part in value.values():
            yield from objects(part)
    elif isinstance(value, list):
        for part in value:
            yield from objects(part)


def part_of(description: dict[str, Any], paths: list[str]) -> dict[str, Any]:
    """The description of these paths, with the components that they need."""
    part = {**description, "paths": {path: description["paths"][path] for path in paths}}
    needed, found = set[str](), json.dumps(part["paths"])
    while new := {*re.findall(r"#/components/schemas/([\w.-]+)", found)} - needed:
        needed |= new
        found = json.dumps([description["components"]["schemas"][name] for name in new])
    schemas = {name: description["components"]["schemas"][name] for name in sorted(needed)}
    return {**part, "components": {**description["components"], "schemas": schemas}}


def validator(description: dict[str, Any], schema: dict[str, Any]) -> Any:
    return jsonschema_rs.Draft202012Validator({**schema, "components": description["components"]})


def body_schema(description: dict[str, Any], path: str) -> dict[str, Any]:
    found: dict[str, Any] = description["paths"][path]["post"]["requestBody"]["content"][
        "application/json"
    ]["schema"]
    return found


@pytest.mark.parametrize("paths", [["/v1/parse", "/v1/jobs/{id}"], slow(None)])
def test_the_description_is_valid_by_the_standard(
    description: dict[str, Any], paths: list[str] | None
) -> None:
    """By default that of two paths and all that they refer to."""
    if paths:
        description = part_of(description, paths)
    validator_of_the_standard = OpenAPIV31SpecValidator(description)
    assert [
        (list(e.absolute_path), e.message[:200]) for e in validator_of_the_standard.iter_errors()
    ] == []


def test_the_answer_to_solve_is_json_alone_and_a_format_says_which_result_a_job_has(
    description: dict[str, Any], service: str
) -> None:
    schemas = description["components"]["schemas"]
    content = description["paths"]["/v1/solve"]["post"]["responses"]["200"]["content"]
    assert list(content) == ["application/json"]
    assert content["application/json"]["schema"] == {"$ref": "#/components/schemas/SolveResult"}
    assert schemas["SolveResult"]["discriminator"]["propertyName"] == "format"
    mapping = schemas["JobResult"]["discriminator"]["mapping"]
    assert {option["$ref"] for option in schemas["JobResult"]["oneOf"]} == {*mapping.values()}
    for name, place in mapping.items():
        schema = schemas[place.rpartition("/")[2]]
        assert schema["properties"]["format"]["const"] == name
        assert "format" in schema["required"]
    body = {"system": {"equations": "x'' = -x"}, "lagrangian": "x'^2/2 - x^2/2"}
    assert (
        httpx.post(f"{service}/v1/check", json=body, timeout=60).json()["format"]
        == "inverse-service/check/1"
    )


def test_every_property_is_described(description: dict[str, Any]) -> None:
    bare = [
        name
        for part in objects(description)
        for name, each in part["properties"].items()
        if not each["description"]
    ]
    assert bare == []


def test_every_call_has_a_short_name_a_tag_and_a_summary(description: dict[str, Any]) -> None:
    calls = [call for methods in description["paths"].values() for call in methods.values()]
    names = [call["operationId"] for call in calls]
    assert len(set(names)) == len(names) > 15
    assert {"solve", "parse", "check", "simulate"} <= set(names)
    assert all(call["tags"] and call["summary"] and call["description"] for call in calls)


def test_every_call_says_in_its_summary_what_it_does(description: dict[str, Any]) -> None:
    """The summary is not a capitalized function name such as "List Jobs"."""
    calls = [call for methods in description["paths"].values() for call in methods.values()]
    assert all(call["description"].startswith(call["summary"]) for call in calls)
    assert all(len(call["summary"].split()) > 2 and not call["summary"].istitle() for call in calls)
    assert len({call["summary"] for call in calls}) == len(calls)


def test_errors_are_problem_documents_and_nothing_else(description: dict[str, Any]) -> None:
    for methods in description["paths"].values():
        for call in methods.values():
            for status, answer in call["responses"].items():
                if status[0] in "45":
                    assert list(answer["content"]) == ["application/problem+json"]
    assert "HTTPValidationError" not in description["components"]["schemas"]


def test_references_lead_somewhere(description: dict[str, Any]) -> None:
    text = json.dumps(description)
    named = {part.partition('"')[0] for part in text.split("#/components/schemas/")[1:]}
    assert named <= set(description["components"]["schemas"])


def documents() -> list[dict[str, Any]]:
    """The documents of the catalog, of the literature, and of every JSON block of the pages."""
    found = [catalogue.document(name) for name in catalogue.names()]
    lines = (ROOT / "tests" / "corpus" / "literature.ndjson").read_text().splitlines()
    found += [json.loads(line).get("document", {}) for line in lines if line.strip()]
    for page in PAGES:
        for block in blocks(page):
            if block.language.startswith("json") and block.text.lstrip().startswith("{"):
                value = json.loads(block.text)
                found += [value] if {"equations", "lagrangian"} & value.keys() else []
    return [document for document in found if document]


def test_every_document_of_the_project_validates(description: dict[str, Any]) -> None:
    check = validator(description, body_schema(description, "/v1/solve"))
    more: list[dict[str, Any]] = [
        {
            "equations": {"x": 0, "y": "-y"},
            "parameters": {"k": 2.5, "m": None},
            "id": 7,
            "options": {"time_limit": 5},
        },
        {
            "equations": "y'' = -x",
            "time": "x",
            "parameters": "guess",
            "_comment": "Airy",
            "where": {"r": "x^2"},
        },
        {"lagrangian": "x'^2/2"},
    ]
    for document in [*documents(), *more]:
        assert not list(check.iter_errors(document)), document
    assert list(check.iter_errors({"equations": "x'' = 0", "color": 1}))
    assert list(check.iter_errors({"equations": 3}))


ASKED: list[dict[str, Any]] = [
    {"equations": "x'' = -x - x'", "id": "a", "first_integrals": False},
    {"equations": ["x'' = x^2 + y^2", "y'' = 0"]},
    {"equations": "x'' = -k*abs(x)", "parameters": ["k"]},
    {"equations": "y'' = -y", "time": "x"},
    {"lagrangian": "x'^2/2 - x^2/2"},
    {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
        "constraints": ["z' + x*y'"],
        "first_integrals": False,
    },
]


def test_every_answer_validates(description: dict[str, Any], service: str) -> None:
    with httpx.Client(base_url=service) as client:
        for path in ("/v1/solve", "/v1/parse"):
            answers = description["paths"][path]["post"]["responses"]
            check = validator(description, answers["200"]["content"]["application/json"]["schema"])
            for document in ASKED:
                answer = client.post(path, json=document, headers={"Prefer": "wait=20"}, timeout=60)
                assert answer.status_code == 200, answer.text[:300]
                assert not [error.message[:200] for error in check.iter_errors(answer.json())], (
                    document
                )
        problem = validator(description, {"$ref": "#/components/schemas/ProblemDocument"})
        refused = client.post("/v1/parse", json={"equations": "x'' = -kx", "parameters": ["k"]})
        assert not list(problem.iter_errors(refused.json()))
        assert refused.json()["errors"][0]["instead"] == ["k*x"]


def test_the_body_of_a_check_is_described(description: dict[str, Any], service: str) -> None:
    """The body is a result, alone or with its document, a certificate, or a user's Lagrangian, but
    not any object.
    """
    check = validator(description, body_schema(description, "/v1/check"))
    document = {"equations": "x'' = -x"}
    with httpx.Client(base_url=service) as client:
        result = client.post(
            "/v1/solve", json=document, headers={"Prefer": "wait=20"}, timeout=60
        ).json()
        bodies = [result, {"document": document, "result": result}, result["certificate"],
                  {"system": document, "lagrangian": "x'^2/2 - x^2/2"}]  # fmt: skip
        for body in bodies:
            assert not list(check.iter_errors(body)), body
            assert client.post("/v1/check", json=body, timeout=60).json()["verdict"] == "valid", (
                body
            )
    assert list(check.iter_errors({"color": 1}))
    assert list(check.iter_errors({"system": document, "lagrangian": 3}))


DISK = {
    "system": {"catalogue": "vertically-rolling-disk"}, "parameters": {"M": 1, "R": 1, "I": "1/2", "J": "1/4"},
    "initial": {"positions": {"phi": 0.3, "theta": 0, "x": 0, "y": 0}, "velocities": {"phi": 1, "theta": 0.5}},
    "step": 0.1, "steps": 150, "methods": ["variational", "nonholonomic", "runge-kutta", "exact"],
    "observe": ["trajectory", "energy", "constraints", "momenta", "matching_circle", "phase", "error", "velocities",
                "cost", {"speed": "sqrt(x'^2 + y'^2)"}],
}  # fmt: skip
SPRING = {
    "system": {"coordinates": ["x"], "lagrangian": "x'^2/2 - x^2/2"}, "step": 0.1, "steps": 40,
    "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "methods": ["variational", "stormer-verlet"],
}  # fmt: skip
SCENES = [
    ("simulate", DISK),
    ("simulate", SPRING | {"events": [{"when": "x"}], "observe": ["trajectory", "energy", "lyapunov"]}),
    ("simulate", SPRING | {"ensemble": {"initial": {"positions": {"x": [1, 2]}}}}),
    ("simulate", SPRING | {"system": {"coordinates": ["x"], "equations": {"x": "9*x^3"}}, "methods": ["runge-kutta"]}),
    ("work-precision", SPRING),
]  # fmt: skip


def test_every_simulation_validates_and_what_is_amiss_does_not(
    description: dict[str, Any], service: str
) -> None:
    """Responses with observed quantities of all kinds, events, an ensemble, a stopped run, and a
    measurement.
    """
    with httpx.Client(base_url=service) as client:
        for call, scene in SCENES:
            asked = validator(description, body_schema(description, f"/v1/{call}"))
            assert not list(asked.iter_errors(scene))
            assert list(asked.iter_errors(scene | {"stepp": 1}))
            answers = description["paths"][f"/v1/{call}"]["post"]["responses"]
            check = validator(description, answers["200"]["content"]["application/json"]["schema"])
            answer = client.post(
                f"/v1/{call}", json=scene, headers={"Prefer": "wait=20"}, timeout=60
            )
            found = answer.json()
            assert answer.status_code == 200, answer.text[:300]
            assert not [error.message[:200] for error in check.iter_errors(found)], scene
            assert list(check.iter_errors({**found, "methods": "none"}))


CALLS = (Path(__file__).parent / "calls.ts").read_text(encoding="utf-8")


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("npm") is None, reason="no npm")
def test_a_typescript_client_is_generated_compiled_and_asks(
    description: dict[str, Any], tmp_path: Path, service: str
) -> None:
    (tmp_path / "openapi.json").write_text(json.dumps(description))
    (tmp_path / "calls.ts").write_text(CALLS.replace("ADDRESS", service))
    (tmp_path / "package.json").write_text('{"name": "calls", "private": true, "type": "module"}')
    packages = [
        "openapi-typescript@7",
        "openapi-fetch@0.13",
        "typescript@5",
        "@types/node@20",
        "@redocly/cli@2",
    ]
    run(["npm", "install", "--silent", *packages], tmp_path)
    run(["npx", "redocly", "lint", "openapi.json"], tmp_path)
    run(["npx", "openapi-typescript", "openapi.json", "-o", "schema.d.ts"], tmp_path)
    options = [
        "--strict",
        "--module",
        "es2022",
        "--moduleResolution",
        "bundler",
        "--target",
        "es2022",
    ]
    run(["npx", "tsc", *options, "--lib", "es2022,dom", "--skipLibCheck", "calls.ts"], tmp_path)
    run(["node", "calls.js"], tmp_path)


PYTHON_CALLS = """
from generated import Client
from generated.api.batches import batch, create, results
from generated.api.catalogue import catalogue_entry, list_catalogue
from generated.api.jobs import dismiss_jobs, job, list_jobs
from generated.api.operations import limits
from generated.api.simulations import simulate
from generated.api.systems import check, parse, solve
from generated.models import LagrangianDocument, ProblemDocument, ResultDocument, SceneDocument
from generated.models import Batch, CheckAnswer, SimulationResult, SystemDocument

client = Client(base_url="ADDRESS")
solved = solve.sync(client=client, body=SystemDocument.from_dict({"equations": "x'' = -x", "id": 1}), prefer="wait=20")
assert isinstance(solved, ResultDocument), solved
print(solved.verdict)
refused = parse.sync(client=client, body=SystemDocument.from_dict({"equations": "x'' = -kx"}))
assert isinstance(refused, ProblemDocument), refused
print(refused.detail)
parse.sync(client=client, body=LagrangianDocument.from_dict({"lagrangian": "x'^2/2"}))
checked = check.sync(client=client, body=solved)
assert isinstance(checked, CheckAnswer) and checked.verdict == "valid", checked
scene = {"system": {"catalogue": "sho"}, "step": 0.1, "steps": 10, "methods": ["runge-kutta"],
         "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}}
run = simulate.sync(client=client, body=SceneDocument.from_dict(scene), prefer="wait=20")
assert isinstance(run, SimulationResult), run
assert run.methods[0].outcome == "completed"
jobs = list_jobs.sync(client=client)
print(jobs)
print(job.sync_detailed("a", client=client).status_code)
print(dismiss_jobs.sync_detailed("a", client=client).status_code)
print(list_catalogue.sync_detailed(client=client).status_code)
print(catalogue_entry.sync_detailed("sho", client=client).status_code, limits.sync_detailed(client=client).status_code)
stored = create.sync(client=client, body=[{"equations": "x'' = -x", "id": "a"}, {"equations": "x'' = 0"}, 3])
assert isinstance(stored, Batch) and stored.total == 3, stored
lines = results.sync(stored.id, client=client.with_headers({"Accept": "application/json"}))
assert isinstance(lines, list) and len(lines) == 3, lines
print(batch.sync_detailed(stored.id, client=client).status_code)
"""


@pytest.mark.nightly
def test_a_python_client_is_generated_type_checked_and_asks(
    description: dict[str, Any], tmp_path: Path, service: str
) -> None:
    run([sys.executable, "-m", "venv", "venv"], tmp_path)
    run(["venv/bin/pip", "install", "--quiet", "openapi-python-client", "mypy", "ruff"], tmp_path)
    (tmp_path / "openapi.json").write_text(json.dumps(description))
    generate = [
        "venv/bin/openapi-python-client",
        "generate",
        "--path",
        "openapi.json",
        "--meta",
        "none",
    ]
    run([*generate, "--output-path", "generated"], tmp_path)
    (tmp_path / "calls.py").write_text(PYTHON_CALLS.replace("ADDRESS", service))
    run(["venv/bin/mypy", "calls.py"], tmp_path)
    run(["venv/bin/python", "calls.py"], tmp_path)


def run(command: list[str], folder: Path) -> None:
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, (done.stdout + done.stderr)[-3000:]


def test_every_field_of_a_result_is_on_its_page(description: dict[str, Any]) -> None:
    page = (ROOT / "docs" / "reference" / "results.md").read_text()
    schemas = description["components"]["schemas"]
    shared, *rest = re.split(r"^\| \*\*(?=\w+\*\*)", page, flags=re.MULTILINE)
    sections = {section.partition("**")[0]: section for section in rest}
    assert len(sections) > 40
    types = " ".join(line.split("|")[-2] for line in page.splitlines() if line.startswith("| `"))
    assert {name for name in re.findall(r"[A-Z]\w+", types) if name in schemas} <= {*sections}
    for model, section in sections.items():
        missing = [
            name for name in schemas[model]["properties"] if f"| `{name}` |" not in shared + section
        ]
        assert missing == [], model
