"""Test an installation with ten questions: `python tests/installed.py COMMAND`, with the `inverse-service` of an
environment.

Run by `make installed` against the wheel in an empty environment, with a home directory that is not writable.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

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


def main(command: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        barrier = Path(folder) / "file"  # nobody can write below a file, not even root
        barrier.touch()
        environment = os.environ | {"HOME": f"{barrier}/home", "XDG_CACHE_HOME": f"{barrier}/cache"}

        def run(*words: str) -> subprocess.CompletedProcess[str]:
            return subprocess.run([command, *words], capture_output=True, text=True, env=environment, check=False)

        for equations, verdict in QUESTIONS.items():
            found = run("solve", equations, "--format", "json")
            assert found.returncode == 0, (equations, found.stderr[-800:])
            answer = json.loads(found.stdout)
            assert (answer["verdict_with_time"] or answer["verdict"]) == verdict, (equations, found)
            assert answer["checked"] == "valid" or answer["with_time"]["checked"] == "valid", equations
        scene = Path(folder) / "scene.json"
        scene.write_text(json.dumps(SCENE))
        refused = run("simulate", str(scene))
        assert refused.returncode == 2, refused
        assert "inverse-service[simulation]" in refused.stderr, refused.stderr
    print(f"{len(QUESTIONS) + 1} passed, 0 failed")


if __name__ == "__main__":
    main(sys.argv[1])
