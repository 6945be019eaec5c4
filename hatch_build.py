"""Makes platform wheels: the kernels of the solver are compiled when the wheel is made and shipped
in it.

On Linux a wheel without them is refused, since it would install another 200 MB and compile for half
a minute before its first answer. INVERSE_SERVICE_WHEEL=pure asks for it;
INVERSE_SERVICE_WHEEL=aarch64 makes the wheel of that machine on another one. Elsewhere the wheel is
pure. A pure wheel depends on numba, which compiles the kernels at their first use; so does an
editable installation.

Names and addresses of the package come from publication.toml, and the links of README.md are made
absolute, since an index shows that page without the files around it.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

COMPILER = ["llvmlite>=0.45", "numba>=0.62"]
FOLDER = "inverse_service/kernels/machine_code/compiled"
PURE = "pure"
MACHINE = os.environ.get("INVERSE_SERVICE_WHEEL") or (
    platform.machine() if sys.platform == "linux" else PURE
)
LINKER = shutil.which("ld" if platform.machine() == MACHINE else f"{MACHINE}-linux-gnu-ld")


class Kernels(BuildHookInterface):
    """Adds the libraries of `python -m inverse_service.service.compiling` to the wheel."""

    def dependencies(self) -> list[str]:
        """A linker for machines that have none."""
        return [] if MACHINE == PURE or LINKER else ["ziglang"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable" or MACHINE == PURE:
            build_data["dependencies"] += COMPILER
            return
        made = self.compiled()
        build_data["force_include"] |= {str(path): f"{FOLDER}/{path.name}" for path in made}
        build_data["pure_python"] = False
        # The libraries ask for nothing but memset, so any glibc will do.
        build_data["tag"] = f"py3-none-manylinux_2_17_{MACHINE}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """The last line of a build without kernels says so."""
        if version != "editable" and MACHINE != PURE:
            self.folder.cleanup()
        elif version != "editable":
            self.app.display_warning(
                f"{Path(artifact_path).name} has no kernels: it compiles them at the first question."
            )

    def compiled(self) -> list[Path]:
        """The index and the libraries; the build fails where they cannot be made."""
        self.folder = tempfile.TemporaryDirectory()
        command = [
            sys.executable,
            "-m",
            "inverse_service.service.compiling",
            self.folder.name,
            MACHINE,
        ]
        # The modules of the build environment are where this process finds them, however its tool
        # arranged that.
        paths = os.pathsep.join([self.root, *filter(None, sys.path)])
        environment = {**os.environ, "PYTHONPATH": paths, "SYMPY_GROUND_TYPES": "python"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            self.folder.cleanup()
            reason = done.stderr.strip().splitlines()[-1:] or ["no reason is known"]
            raise RuntimeError(
                f"The kernels could not be compiled: {reason[0]}. "
                "INVERSE_SERVICE_WHEEL=pure builds a wheel without kernels."
            )
        return sorted(Path(self.folder.name).iterdir())


class Publication(MetadataHookInterface):
    """Authors, addresses, and the page of the package."""

    def update(self, metadata: dict[str, Any]) -> None:
        about = tomllib.loads((Path(self.root) / "publication.toml").read_text(encoding="utf-8"))
        place = about["repository"].rstrip("/")
        metadata["authors"] = [{"name": one["name"]} for one in about["authors"]]
        metadata["urls"] = {
            "Repository": place, "Issues": f"{place}/issues", "Changelog": f"{place}/blob/main/CHANGELOG.md",
            "Documentation": f"{place}/blob/main/docs/index.md",
        }  # fmt: skip
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": with_absolute_links(text, place),
        }


def with_absolute_links(text: str, repository: str) -> str:
    """Markdown whose links to files of the repository are addresses there; those of pictures lead to the raw file."""

    def absolute(found: re.Match[str]) -> str:
        kind = "raw" if found["mark"] else "blob"
        return f"{found['mark']}[{found['text']}]({repository}/{kind}/main/{found['path']})"

    return re.sub(
        r"(?P<mark>!?)\[(?P<text>[^]]*)\]\((?P<path>(?!https?:|#|mailto:)[^)\s]+)\)", absolute, text
    )
