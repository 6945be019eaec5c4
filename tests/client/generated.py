"""Make the clients of `clients/` and let each run its example: `python -m tests.client.generated
build/clients`.

The Python one is made by openapi-python-client in an environment of its own, the TypeScript one by
openapi-typescript (npm); both from the description that a service of this tree gives. Fails where
one does not compile, or where a call of its example does not say what `WORDS` has.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

from tests.serving import serving

ROOT = Path(__file__).parents[2]
GENERATOR = "openapi-python-client==0.29.1"
WORDS = ("solve variational", "check valid", "job variational", "simulate completed", "batch")


def run(*words: str | Path, folder: Path) -> str:
    """What a command prints; raises CalledProcessError."""
    path = f"{folder / 'environment' / 'bin'}{os.pathsep}{os.environ['PATH']}"  # the generator calls ruff
    done = subprocess.run(
        words,
        cwd=folder,
        env=os.environ | {"PATH": path},
        check=True,
        text=True,
        stdout=subprocess.PIPE,
    )
    return done.stdout


def python_client(description: Path, folder: Path, address: str) -> str:
    """Generate and install it, and run its example."""
    run(sys.executable, "-m", "venv", "--clear", folder / "environment", folder=folder)
    python = folder / "environment" / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", GENERATOR, "ruff", folder=folder)
    command = [python, "-c", "from openapi_python_client.cli import app; app()", "generate"]
    asked = ["--path", description, "--config", ROOT / "clients/python/config.yaml"]
    package = folder / "package"
    run(*command, *asked, "--meta", "setup", "--output-path", package, folder=folder)
    run(python, "-m", "pip", "install", "--quiet", package, folder=folder)
    return run(python, ROOT / "clients/python/example.py", address, folder=folder)


def typescript_client(description: Path, folder: Path, address: str) -> str:
    """Generate and compile it, and run its example."""
    shutil.copytree(ROOT / "clients/typescript", folder, dirs_exist_ok=True)
    shutil.copy(description, folder / "openapi.json")
    run("npm", "install", "--no-package-lock", "--silent", folder=folder)
    run("npm", "run", "--silent", "build", folder=folder)
    return run("node", "dist/example.js", address, folder=folder)


def main(folder: Path) -> None:
    """Both, under `folder`."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    description = folder / "openapi.json"
    with (
        (folder / "service.log").open("wb") as log,
        serving(stderr=log, database=str(folder / "store.db")) as (_, address),
    ):
        with urllib.request.urlopen(f"{address}/openapi.json") as answer:
            description.write_text(json.dumps(json.load(answer)))
        for name, make in (("python", python_client), ("typescript", typescript_client)):
            (folder / name).mkdir()
            said = make(description, folder / name, address)
            print(name, said, sep="\n")
            if [line for line in WORDS if line not in said]:
                raise SystemExit(f"The {name} client does not say what it should.")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
