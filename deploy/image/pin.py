"""Write the requirements of the image: exact versions with the hashes of their wheels, for each
processor.

    python deploy/image/pin.py

Versions are those of constraints.txt. An editable install cannot have hashes, so these files are
for the image only.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PYTHON = "3.11"
PROCESSORS = ("x86_64", "aarch64")
BUILD = "build"
# Those of every image, and those that its builder may choose. The image is without uPlot, which
# brings IPython along.
ALWAYS, EXTRAS = ("figures", "simulation"), ("dask", "postgres")
WITHOUT = "uplot-python"
Wheels = dict[str, set[str]]


def wheels(needed: list[str]) -> Wheels:
    """`name==version` and the hashes of the wheels that pip would install."""
    found: Wheels = {}
    for processor in PROCESSORS:
        places = [
            word
            for glibc in (17, 28, 34)
            for word in ("--platform", f"manylinux_2_{glibc}_{processor}")
        ]
        with tempfile.TemporaryDirectory() as folder:
            command = [
                sys.executable,
                "-m",
                "pip",
                "install",
                "--quiet",
                "--dry-run",
                "--report",
                "-",
            ]
            command += [
                "--target",
                folder,
                "--python-version",
                PYTHON,
                "--only-binary",
                ":all:",
                *places,
            ]
            command += ["-c", str(ROOT / "constraints.txt"), *needed]
            environment = os.environ | {"PIP_CONFIG_FILE": os.devnull, "PIP_FIND_LINKS": ""}
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, env=environment)
        for one in json.loads(done.stdout)["install"]:
            name = (
                f"{one['metadata']['name'].lower().replace('_', '-')}=={one['metadata']['version']}"
            )
            found.setdefault(name, set()).add(
                one["download_info"]["archive_info"]["hashes"]["sha256"]
            )
    return found


def write(name: str, found: Wheels, there: Wheels) -> None:
    """The requirements that another file has not."""
    lines = [
        " \\\n    ".join([requirement, *(f"--hash=sha256:{hash}" for hash in sorted(hashes))])
        + "\n"
        for requirement, hashes in sorted(found.items())
        if requirement not in there
    ]
    (HERE / f"requirements{name}.txt").write_text(
        "# Made by pin.py.\n" + "".join(lines), encoding="utf-8"
    )


def main() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = project["project"]["optional-dependencies"]
    needed = [
        *project["project"]["dependencies"],
        *(one for extra in ALWAYS for one in extras[extra] if not one.startswith(WITHOUT)),
    ]
    base = wheels(needed)
    write("", base, {})
    for extra in EXTRAS:
        write(f"-{extra}", wheels([*needed, *extras[extra]]), base)
    write(f"-{BUILD}", wheels(["pip", *project["build-system"]["requires"]]), {})


if __name__ == "__main__":
    main()
