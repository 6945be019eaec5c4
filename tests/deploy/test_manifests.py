"""The files in deploy/ match their schemas and request no privileges, as the page says."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

import inverse_service
from inverse_service.settings import read_settings
from tests.deploy.bare import ROOT

DEPLOY = ROOT / "deploy"
COMPOSE: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())
MANIFESTS: list[dict[str, Any]] = yaml.safe_load((DEPLOY / "kubernetes.yaml").read_text())["items"]
PODS = {
    one["metadata"]["name"]: one["spec"]["template"]["spec"]
    for one in MANIFESTS
    if one["kind"] == "Deployment"
}
OURS = [one for one in COMPOSE["services"].values() if one["image"] == "inverse-service"]


def test_the_compose_file_follows_its_schema() -> None:
    pytest.importorskip("check_jsonschema")
    command = [
        "-m",
        "check_jsonschema",
        "--builtin-schema",
        "vendor.compose-spec",
        str(DEPLOY / "compose.yaml"),
    ]
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    "manifest", MANIFESTS, ids=lambda one: f"{one['kind']} {one['metadata']['name']}"
)
def test_each_manifest_follows_its_schema(manifest: dict[str, Any]) -> None:
    validator = pytest.importorskip("kubernetes_validate")
    newest = validator.latest_version()
    assert newest.startswith(validator.validate(manifest, newest, strict=True))
    with pytest.raises(validator.ValidationError):
        validator.validate(manifest | {"metadate": {}}, newest, strict=True)


def test_the_conda_recipe_is_rendered_with_the_dependencies_of_the_package() -> None:
    builder = pytest.importorskip("rattler_build")
    (variant,) = builder.Stage0Recipe.from_file(str(DEPLOY / "conda" / "recipe.yaml")).render(
        builder.VariantConfig()
    )
    package = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    compiled = ["llvmlite>=0.45", "numba>=0.62"]  # nothing is compiled ahead of time
    wanted = {
        one.replace("-", "_")
        for one in [*package["dependencies"], *compiled, f"python{package['requires-python']}"]
    }
    assert {
        str(one).replace("-", "_").replace(" ", "") for one in variant.recipe.requirements.run
    } == wanted
    assert str(variant.recipe.package.version) == inverse_service.__version__


@pytest.mark.parametrize("name", PODS)
def test_a_pod_has_no_rights_and_bounds(name: str) -> None:
    pod = PODS[name]
    assert pod["enableServiceLinks"] is pod["automountServiceAccountToken"] is False
    assert pod["securityContext"]["runAsNonRoot"]
    assert pod["securityContext"]["runAsUser"] == pod["securityContext"]["runAsGroup"] == 10001
    (container,) = pod["containers"]
    assert container["securityContext"]["readOnlyRootFilesystem"]
    assert not container["securityContext"]["allowPrivilegeEscalation"]
    assert container["securityContext"]["capabilities"] == {"drop": ["ALL"]}
    assert container["resources"]["limits"]["memory"]
    assert "/tmp" in {mount["mountPath"] for mount in container["volumeMounts"]}


def test_the_front_ends_are_asked_whether_they_live_and_are_ready() -> None:
    (front,) = PODS["inverse-service"]["containers"]
    asked = {
        name: front[f"{name}Probe"]["httpGet"]["path"]
        for name in ("startup", "liveness", "readiness")
    }
    assert asked == {"startup": "/livez", "liveness": "/livez", "readiness": "/readyz"}


def test_the_settings_in_the_manifests_are_settings(tmp_path: Path) -> None:
    (front,) = PODS["inverse-service"]["containers"]
    kubernetes = {
        one["name"]: one.get("value", "postgresql://inverse@database/inverse")
        for one in front["env"]
    }
    compose = {
        name: value
        for name, value in COMPOSE["services"]["service"]["environment"].items()
        if name != "PGPASSFILE"
    }
    for environment in (kubernetes, compose):
        keys = tmp_path / "keys"
        keys.write_text(f"alice:{'0' * 64}\n")
        found = read_settings(environment | {"INVERSE_SERVICE_API_KEYS_FILE": str(keys)})
        assert found.cluster in {"tcp://scheduler:8786", "tcp://inverse-service-scheduler:8786"}
    for name, value in kubernetes.items():
        if name == "INVERSE_SERVICE_CLUSTER":
            services = {one["metadata"]["name"] for one in MANIFESTS if one["kind"] == "Service"}
            assert value.removeprefix("tcp://").partition(":")[0] in services


def test_every_service_and_policy_selects_pods() -> None:
    labels = [
        one["spec"]["template"]["metadata"]["labels"]
        for one in MANIFESTS
        if one["kind"] == "Deployment"
    ]
    for one in MANIFESTS:
        if one["kind"] == "Service":
            wanted = one["spec"]["selector"].items()
            assert sum(wanted <= found.items() for found in labels) == 1
        if one["kind"] == "NetworkPolicy":
            (rule,) = one["spec"]["podSelector"]["matchExpressions"]
            assert set(rule["values"]) <= {found["part"] for found in labels}


@pytest.mark.parametrize("service", OURS, ids=lambda one: str(one.get("command", "service")))
def test_a_container_of_compose_has_no_rights(service: dict[str, Any]) -> None:
    assert service["read_only"]
    assert service["init"]
    assert service["tmpfs"] == ["/tmp"]
    assert service["cap_drop"] == ["ALL"]


def test_the_image_has_the_versions_of_the_tests_and_all_that_is_needed() -> None:
    pin = re.compile(r"^([\w.-]+)==(\S+)", re.MULTILINE)
    tested = {
        name.lower().replace("_", "-"): version
        for name, version in pin.findall((ROOT / "constraints.txt").read_text())
    }
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for extra in ("", "dask", "postgres"):
        text = (DEPLOY / "image" / f"requirements{extra and '-' + extra}.txt").read_text()
        pinned = dict(pin.findall(text))
        assert pinned.items() <= tested.items(), "python deploy/image/pin.py writes them again"
        assert len(
            re.findall(
                r"--hash=sha256:[0-9a-f]{64}$|--hash=sha256:[0-9a-f]{64} ", text, re.MULTILINE
            )
        ) >= len(pinned)
        needed = project["optional-dependencies"][extra] if extra else project["dependencies"]
        assert {re.match(r"[\w.-]+", one)[0] for one in needed} <= pinned.keys()  # type: ignore[index]


def test_each_alert_says_what_to_do() -> None:
    (group,) = yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"]
    names = [rule["alert"] for rule in group["rules"]]
    assert len({*names}) == len(names) >= 10
    for rule in group["rules"]:
        assert rule["labels"]["severity"] in ("warning", "critical")
        assert all(rule["annotations"][key] for key in ("summary", "action"))
        assert re.fullmatch(r"\d+[mh]", rule["for"])


def test_each_panel_of_the_dashboard_has_its_own_place_and_its_queries() -> None:
    panels = json.loads((DEPLOY / "dashboard.json").read_text())["panels"]
    places = [(one["gridPos"]["x"], one["gridPos"]["y"]) for one in panels]
    assert len({*places}) == len({one["id"] for one in panels}) == len(panels)
    assert all(
        target["expr"] and target["legendFormat"] for one in panels for target in one["targets"]
    )


def test_the_unit_is_one_that_systemd_takes(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("needs systemd-analyze")
    unit = tmp_path / "inverse-service.service"
    text = (ROOT / "deploy" / "inverse-service.service").read_text()
    unit.write_text(
        text.replace("/opt/inverse-service/bin/inverse-service", shutil.which("true") or "")
    )
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
