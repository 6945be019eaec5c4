"""The build hook: kernels or an error. `make installed` builds and asks the wheel itself."""

from __future__ import annotations

import importlib.util
import os
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from tests.deploy.bare import ROOT
from tests.publication import FILES, publication

INTERFACES = {
    "BuildHookInterface": "hatchling.builders.hooks.plugin.interface",
    "MetadataHookInterface": "hatchling.metadata.plugin.interface",
}


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module, with the part of hatchling that it uses."""
    monkeypatch.delenv("INVERSE_SERVICE_WHEEL", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    for name, place in INTERFACES.items():
        interface = ModuleType(place)
        interface.__dict__[name] = type(name, (), {"root": str(ROOT)})
        monkeypatch.setitem(sys.modules, place, interface)
    specification = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def interpreter(folder: Path, commands: str) -> str:
    """A program that the hook takes for Python; its third argument is the folder of the kernels."""
    program = folder / "python"
    program.write_text(f"#!/bin/sh\n{commands}\n")
    program.chmod(0o755)
    return str(program)


def built(hook: Any, version: str = "standard") -> tuple[Any, dict[str, Any]]:
    kernels, data = hook.Kernels(), {"dependencies": [], "force_include": {}}
    kernels.initialize(version, data)
    return kernels, data


def test_the_compiler_sees_the_modules_of_the_build_environment(
    hook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands = 'echo "$PYTHONPATH" > "$3/kernels.json"'
    monkeypatch.setattr(sys, "executable", interpreter(tmp_path, commands))
    monkeypatch.setattr(sys, "path", [*sys.path, "/overlay/of/pip"])
    kernels, data = built(hook)
    paths = (Path(kernels.folder.name) / "kernels.json").read_text().strip().split(os.pathsep)
    assert paths[0] == str(ROOT)
    assert "/overlay/of/pip" in paths
    assert data["tag"].startswith("py3-none-manylinux")
    assert not data["pure_python"]
    assert not data["dependencies"]
    kernels.finalize("standard", data, "/dist/name-py3-none-manylinux_2_17_x86_64.whl")
    assert not Path(kernels.folder.name).exists()


def test_a_build_that_cannot_compile_fails_with_its_reason(
    hook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        sys, "executable", interpreter(tmp_path, "echo no module named llvmlite >&2; exit 1")
    )
    with pytest.raises(RuntimeError, match=r"no module named llvmlite.*INVERSE_SERVICE_WHEEL=pure"):
        built(hook)


def test_a_wheel_without_kernels_is_asked_for_and_says_so(
    hook: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hook, "MACHINE", hook.PURE)
    kernels, data = built(hook)
    assert "pure_python" not in data
    assert data["dependencies"] == hook.COMPILER
    said = list[str]()
    monkeypatch.setattr(
        hook.Kernels, "app", SimpleNamespace(display_warning=said.append), raising=False
    )
    kernels.finalize("standard", data, "/dist/name-py3-none-any.whl")
    assert len(said) == 1
    assert "name-py3-none-any.whl has no kernels" in said[0]


def test_an_editable_installation_compiles_at_its_first_question(hook: Any) -> None:
    assert built(hook, "editable")[1]["dependencies"] == hook.COMPILER


def test_the_page_of_the_package_has_no_link_to_a_file_that_is_not_there(hook: Any) -> None:
    metadata = dict[str, Any]()
    hook.Publication().update(metadata)
    text, place = metadata["readme"]["text"], publication()["repository"]
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    assert len(links) > 20
    assert all(link.startswith(("https://", "#")) for link in links)
    for link in links:
        if link.startswith(place):
            kind, _, path = link.removeprefix(f"{place}/").partition("/main/")
            assert kind in ("blob", "raw")
            assert (ROOT / path.partition("#")[0]).exists(), link
    assert f"]({place}/raw/main/docs/answer.png)" in text
    assert {*metadata["urls"]} >= {"Repository", "Issues", "Documentation", "Changelog"}
    assert metadata["authors"] == [{"name": one["name"]} for one in publication()["authors"]]


@pytest.mark.parametrize("name", FILES)
def test_names_and_addresses_are_those_of_one_file(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    assert FILES[name](text, publication()) == text
    other = {"repository": "https://x.example/y", "authors": [
        {"name": "A B", "orcid": "0000-0000-0000-0001", "affiliation": "C"},
        {"name": "D E", "orcid": "0000-0000-0000-0002", "affiliation": "C"},
    ]}  # fmt: skip
    changed = FILES[name](text, other)
    assert "https://x.example/y" in changed
    assert "A B" in changed
    assert "D E" in changed
    assert publication()["repository"] not in changed
    assert FILES[name](changed, publication()) == text


def test_the_manuscript_is_short_and_has_its_parts() -> None:
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    body = text.split("---", 2)[2]
    assert len(body.split()) < 1_000
    assert {"# Summary", "# Statement of need", "# State of the field", "# References"} <= {
        *body.splitlines()
    }
    entries = {
        *re.findall(r"@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"))
    }
    assert {*re.findall(r"@(\w+)", body)} == entries
