"""Compiled kernels are stored and found again; damaged ones are rejected."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from inverse_service.kernels.codegen import compiled as compiling
from inverse_service.kernels.codegen.compiled import compiled, loaded_kernels
from inverse_service.kernels.codegen.program import Program
from inverse_service.kernels.codegen.symengine_trees import symbol
from inverse_service.kernels.machine_code import code_store
from tests.codegen.run_program import call, memory_for


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "cache"))
    loaded_kernels.clear()
    return tmp_path / "cache"


def make(increment: int = 1) -> Program:
    return Program(("s",), ("h",), (), (symbol("h") * increment,))


def result(identity: object, increment: int = 1) -> tuple[float, dict[str, float]]:
    kernel = compiled(identity, lambda: make(increment))
    memory = memory_for(kernel.card, [{"h": 2.0}])
    call(kernel.machine, kernel.card, memory, steps=3)
    return float(memory[kernel.card.layout.names.index("s"), 0]), kernel.seconds


def test_found_in_memory_then_on_disk(folder: Path) -> None:
    assert result("one")[0] == 6.0
    assert result("one") == (6.0, {})
    loaded_kernels.clear()
    value, seconds = result("one")
    assert value == 6.0
    assert set(seconds) == {"load"}
    assert result("two", 5)[0] == 30.0


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "foreign", "folder", "swapped"])
def test_damaged_entries_are_made_again(folder: Path, damage: str) -> None:
    assert result("one")[0] == 6.0
    assert result("two", 5)[0] == 30.0
    entries = sorted(folder.glob("*.kernel"))
    assert len(entries) == 2
    contents = [entry.read_bytes() for entry in entries]
    for entry, content, other in zip(entries, contents, reversed(contents), strict=True):
        if damage == "folder":
            entry.unlink()
            entry.mkdir()
            continue
        new = {
            "empty": b"", "cut": content[:-10], "flipped": content[:400] + bytes([content[400] ^ 1]) + content[401:],
            "foreign": b"#!/bin/sh\n", "swapped": other,
        }[damage]  # fmt: skip
        entry.write_bytes(new)
    loaded_kernels.clear()
    assert result("one")[0] == 6.0
    assert result("two", 5)[0] == 30.0


def test_a_folder_that_cannot_be_written_costs_time_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "file" / "below"))
    loaded_kernels.clear()
    assert result("one")[0] == 6.0


def test_others_code_is_not_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An entry that another user owns is ignored."""
    assert result("one")[0] == 6.0
    loaded_kernels.clear()
    monkeypatch.setattr(os, "getuid", lambda: os.stat(folder).st_uid + 1)
    assert set(result("one")[1]) > {"load"}


def test_changed_code_makes_new_kernels(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from inverse_service.kernels.codegen import compiled

    assert result("one")[0] == 6.0
    loaded_kernels.clear()
    monkeypatch.setattr(compiled, "code_digest", lambda: "another version")
    assert "compile" in result("one")[1]


def test_the_oldest_entries_go(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(code_store, "MOST_ENTRIES", 4)
    for k in range(6):
        result(k, k + 1)
        time.sleep(0.01)
    assert len(list(folder.glob("*.kernel"))) <= 5


def test_place_of_the_cache() -> None:
    assert code_store.cache_directory({"INVERSE_SERVICE_CACHE": "/a"}) == Path("/a")
    assert code_store.cache_directory({"XDG_CACHE_HOME": "/b"}, "linux") == Path(
        "/b/inverse-service"
    )
    assert code_store.cache_directory({}, "linux").parts[-2:] == (".cache", "inverse-service")
    assert code_store.cache_directory({}, "darwin").parts[-2:] == ("Caches", "inverse-service")
    assert code_store.cache_directory({"LOCALAPPDATA": "/c"}, "win32") == Path(
        "/c/inverse-service/Cache"
    )


def test_threads_compile_one_after_the_other(folder: Path) -> None:
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda k: result(k % 3, k % 3 + 1)[0], range(12)))
    assert found == [6.0 * (k % 3 + 1) for k in range(12)]


def test_memory_is_bounded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "MOST_IN_MEMORY", 2)
    for k in range(4):
        result(k, k + 1)
    assert len(compiling.loaded_kernels) == 2


@pytest.mark.slow
def test_kernels_serve_another_process(folder: Path) -> None:
    result("one")
    code = (
        "from inverse_service.kernels.codegen.compiled import compiled\n"
        "def never(): raise SystemExit('made again')\n"
        "assert set(compiled('one', never).seconds) == {'load'}\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env=os.environ.copy())
