"""Build the package as a stranger does: `python tests/wheel.py FOLDER` leaves a source archive and
a wheel there.

Everything starts from a fresh environment with the pip of its Python, and no variable but those
that lead pip to its index: nothing of a developer's `.venv` can help. The wheel is made from the
archive, so both are what was tested. It fails if the wheel has no kernels, or if a wheel from these
sources holds other files than that from the archive.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
# How a machine reaches its index is no part of the program.
REACHES = re.compile(r"PIP_.*|(https?|all|no)_proxy|SSL_CERT_(FILE|DIR)", re.IGNORECASE)
KERNELS = "inverse_service/kernels/machine_code/compiled/"


def empty(home: Path, **more: str) -> dict[str, str]:
    """An environment without anything of the caller's but the search path."""
    reaches = {name: value for name, value in os.environ.items() if REACHES.fullmatch(name)}
    path = os.pathsep.join(
        p for p in os.environ["PATH"].split(os.pathsep) if not p.startswith(str(ROOT))
    )
    return {
        "PATH": path,
        "HOME": str(home),
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        **reaches,
        **more,
    }


def fresh(folder: Path) -> Path:
    """The Python of a new virtual environment, which has pip and nothing else."""
    subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)
    return folder / "bin" / "python"


def files(wheel: Path) -> set[str]:
    """The files of a wheel, without kernels and what its name and tag change."""
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if not name.startswith(KERNELS)}


def main(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        python = fresh(home / "environment")

        def run(*words: object, **more: str) -> str:
            command = [python, "-m", *map(str, words)]
            done = subprocess.run(
                command,
                cwd=ROOT,
                env=empty(home, **more),
                text=True,
                capture_output=True,
                check=False,
            )
            if done.returncode:
                raise SystemExit(
                    f"{' '.join(map(str, words))} failed:\n{(done.stdout + done.stderr)[-4000:]}"
                )
            return done.stdout + done.stderr

        run("pip", "install", "--quiet", "hatchling")
        run("hatchling", "build", "-t", "sdist", "-d", folder)
        (archive,) = folder.glob("*.tar.gz")
        run("pip", "wheel", "--no-deps", "--wheel-dir", folder, archive)
        (wheel,) = folder.glob("*.whl")
        is_pure = wheel.name.endswith("-none-any.whl")
        assert is_pure == (sys.platform != "linux"), f"{wheel.name} has no kernels"
        said = run(
            "pip",
            "wheel",
            "-v",
            "--no-deps",
            "--wheel-dir",
            home,
            ROOT,
            INVERSE_SERVICE_WHEEL="pure",
        )
        (pure,) = home.glob("*.whl")
        assert pure.name.endswith("-none-any.whl"), pure.name
        assert "has no kernels" in said, "a wheel without kernels was built without a word"
        assert files(wheel) == files(pure), files(wheel) ^ files(pure)
    print(
        *(f"{path} ({path.stat().st_size / 2**20:.1f} MB)" for path in (archive, wheel)), sep="\n"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
