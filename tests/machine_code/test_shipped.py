"""Kernels in the library of a wheel are found by name and kinds, and only with the sources they
were built from.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import inverse_service
from inverse_service.kernels.machine_code import code_store
from inverse_service.kernels.machine_code.kernels import KERNELS

QUESTIONS = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("numba", "llvmlite", "symengine", "matplotlib"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
from pathlib import Path
from inverse_service.kernels.machine_code import code_store
code_store.FOLDER = Path(sys.argv[1])
code_store.digest = lambda name: ""
import inverse_service
for equations in ("x'' = -x - x'", "x'' = -x - x'^2*y; y'' = -y + x'*y'", "x'' = -x*sqrt(y); y'' = x"):
    print(inverse_service.check(inverse_service.solve(equations))["verdict"])
"""


@pytest.mark.slow
def test_the_shipped_kernels_answer_without_a_compiler(tmp_path: Path) -> None:
    made = [sys.executable, "-m", "inverse_service.service.compiling", str(tmp_path / "compiled")]
    subprocess.run(made, check=True, capture_output=True)
    index = tmp_path / "compiled" / "kernels.json"
    content = json.loads(index.read_text())
    index.write_text(json.dumps(content | {"sources": {}}))
    command = [sys.executable, "-c", QUESTIONS, str(tmp_path / "compiled")]
    environment = os.environ | {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    found = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    assert found.stdout.split() == ["valid"] * 3
    assert not (tmp_path / "cache").exists()


@pytest.mark.slow
@pytest.mark.skipif(
    not shutil.which("aarch64-linux-gnu-ld"), reason="no linker for aarch64 is installed"
)
def test_kernels_are_compiled_for_another_machine(tmp_path: Path) -> None:
    made = [sys.executable, "-m", "inverse_service.service.compiling", str(tmp_path), "aarch64"]
    subprocess.run(made, check=True, capture_output=True)
    library = (tmp_path / "kernels-generic.so").read_bytes()
    assert library[:5] == b"\x7fELF\x02"
    assert int.from_bytes(library[18:20], "little") == 183  # EM_AARCH64
    assert all(
        one["symbol"].encode() in library
        for one in json.loads((tmp_path / "kernels.json").read_text())["kernels"]
    )


def test_a_library_of_other_sources_is_not_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kernels.json").write_text(
        json.dumps({"kernels": [], "sources": {"kernels.py": "0" * 64}})
    )
    monkeypatch.setattr(code_store, "digest", lambda name: "1" * 64)
    assert code_store.library(tmp_path) == {}


def test_every_processor_has_a_library_that_it_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert all(targets[-1][1] == frozenset() for targets in code_store.TARGETS.values())
    monkeypatch.setattr(code_store, "CPUINFO", tmp_path / "not mounted")
    assert code_store.processor_flags() == frozenset()


@pytest.mark.slow
def test_no_kernel_of_the_solver_is_called_through_its_compiler() -> None:
    """Code that cannot be stored would be compiled in each process and be missing in a wheel."""
    inverse_service.solve({"equations": "m x'' + d x' + k x = 0", "parameters": "guess"})
    assert {kernel.name for kernel in KERNELS if any(True for _ in kernel.unstorable)} == set()
    assert {kernel.name for kernel in KERNELS if any(True for _ in kernel.entries)}
