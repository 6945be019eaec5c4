"""Test an installation with ten questions: `python tests/installed.py WHEEL FOLDER` installs the
wheel there.

Run by `make installed`. The environment is empty, and the home directory is not writable, so that
an answer that needs a compiler or a compiled file of somebody else's fails.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from wheel import ROOT, empty, fresh

QUESTIONS = {
    "x'' = -x": "variational",
    "x'' = -x - c*x'": "variational",
    "m x'' + c x' + k x = 0": "variational",
    "x'' = -x - x'^2*y; y'' = -y + x'*y'": "not_variational",
    "x'' = y'; y'' = -x'": "variational",
    "x'' = -x*(x^2 + y^2); y'' = -y*(x^2 + y^2)": "variational",
    "theta'' = -sin(theta)": "variational",
    "x'' = x'^2*y; y'' = 2*y' + 2*x'^2*y'": "not_variational",
    "x'' = -x/(x^2 + y^2)^(3/2); y'' = -y/(x^2 + y^2)^(3/2)": "variational",
}
SCENE = {
    "system": {"equations": {"x": "-x"}},
    "initial": {"positions": {"x": 1}, "velocities": {"x": 0}},
    "step": 0.1,
    "steps": 10,
    "methods": [{"method": "reference"}],
}


def size(folder: Path) -> int:
    """Bytes of all files."""
    return sum(
        path.stat().st_size
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink()
    )


def main(wheel: Path, place: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        barrier = Path(folder) / "file"  # nobody can write below a file, not even root
        barrier.touch()
        python = fresh(place)
        install = [python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel]
        subprocess.run(install, env=empty(Path(folder)), check=True)
        command = place / "bin" / "inverse-service"
        environment = empty(barrier / "home", XDG_CACHE_HOME=f"{barrier}/cache")
        if wheel.name.endswith("-none-any.whl"):  # which compiles its kernels once
            environment["INVERSE_SERVICE_CACHE"] = f"{folder}/kernels"
        else:
            assert subprocess.run(
                [python, "-c", "import numba"], capture_output=True, check=False
            ).returncode

        def run(*words: str) -> subprocess.CompletedProcess[str]:
            return subprocess.run(
                [command, *words], capture_output=True, text=True, env=environment, check=False
            )

        began = time.monotonic()
        run("solve", "x'' = -x")
        seconds = time.monotonic() - began
        for equations, verdict in QUESTIONS.items():
            found = run("solve", equations, "--format", "json")
            assert found.returncode == 0, (equations, found.stderr[-800:])
            answer = json.loads(found.stdout)
            assert (answer["verdict_with_time"] or answer["verdict"]) == verdict, (equations, found)
            assert answer["checked"] == "valid" or answer["with_time"]["checked"] == "valid", (
                equations
            )
        scene = Path(folder) / "scene.json"
        scene.write_text(json.dumps(SCENE))
        refused = run("simulate", str(scene))
        assert refused.returncode == 2, refused
        assert "inverse-service[simulation]" in refused.stderr, refused.stderr
    print(
        f"{len(QUESTIONS) + 1} passed, 0 failed; {size(place) / 2**20:.0f} MB, first answer after {seconds:.1f} s"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
