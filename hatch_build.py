"""Makes platform wheels: the kernels of the solver are compiled when the wheel is made and shipped in it.

Where that is not possible (no compiler numba, no linker, another system than Linux) the wheel is pure and depends on
numba, which compiles the kernels at the first use. So does an editable installation.
INVERSE_SERVICE_WHEEL=aarch64 makes the wheel of that machine on another one.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

COMPILER = ["llvmlite>=0.45", "numba>=0.62"]
FOLDER = "inverse_service/kernels/machine_code/compiled"
MACHINE = os.environ.get("INVERSE_SERVICE_WHEEL", platform.machine())


class Kernels(BuildHookInterface):
    """Adds the libraries of `python -m inverse_service.service.compiling` to the wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        made = [] if version == "editable" else self.compiled()
        if not made:
            build_data["dependencies"] += COMPILER
            return
        build_data["force_include"] |= {str(path): f"{FOLDER}/{path.name}" for path in made}
        build_data["pure_python"] = False
        # The libraries ask for nothing but memset, so any glibc will do.
        build_data["tag"] = f"py3-none-manylinux_2_17_{MACHINE}"

    def compiled(self) -> list[Path]:
        self.folder = tempfile.TemporaryDirectory()
        command = [sys.executable, "-m", "inverse_service.service.compiling", self.folder.name, MACHINE]
        environment = {**os.environ, "PYTHONPATH": self.root, "SYMPY_GROUND_TYPES": "python"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            reason = done.stderr.strip().splitlines()[-1:] or ["no reason is known"]
            self.app.display_warning(f"Kernels are not compiled ahead of time: {reason[0]}")
            return []
        return sorted(Path(self.folder.name).iterdir())
