"""Run the steps of the Dockerfile in a bare Debian: the image starts, solves, draws, and has no
installer.
"""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

import pytest

from tests.deploy.bare import ROOT, SEARCHED, bare_debian, can_bootstrap, copy, run_in

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(not can_bootstrap(), reason="needs root and debootstrap"),
]
# The official image has Python under the name `python`, with a pip that is not Debian's.
LIKE_THE_BASE = """
apt-get update -qq
apt-get install -y -qq --no-install-recommends python3 python3-venv python-is-python3 >/dev/null
rm /usr/lib/python3*/EXTERNALLY-MANAGED
python3 -m venv /tmp/one
/tmp/one/bin/pip --python /usr/bin/python3 install --quiet pip setuptools wheel
rm -r /tmp/one
python -m pip --version
"""
# Sends requests to the service as a client in the container could.
ASK = """
import json, os, time, urllib.error, urllib.request
def ask(path, document=None):
    data = None if document is None else json.dumps(document).encode()
    headers = {"Content-Type": "application/json", "Prefer": "wait=60"}
    request = urllib.request.Request("http://127.0.0.1:8000" + path, data, headers)
    try:
        with urllib.request.urlopen(request, timeout=120) as answer:
            return answer.read(), answer.headers
    except urllib.error.HTTPError as error:
        print(error.read().decode())
        raise
for _ in range(240):
    try:
        ask("/readyz")
        break
    except urllib.error.HTTPError:
        time.sleep(0.5)
body, _ = ask("/v1/solve", {"coordinates": ["x"], "equations": {"x": "-x"}})
scene = {"system": {"coordinates": ["x"], "lagrangian": "x'^2/2-x^2/2"}, "step": 0.1, "steps": 20,
         "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "methods": ["variational"],
         "observe": ["trajectory"]}
run, headers = ask("/v1/simulate", scene)
place = headers["Location"].replace("/v1/jobs", "/results")
print(json.dumps({"verdict": json.loads(body)["verdict"], "outcome": json.loads(run)["methods"][0]["outcome"],
                  "figure": ask(place + "/figures/coordinates.svg")[0][:5].decode(),
                  "user": [os.getuid(), os.getgid()]}))
"""


@dataclass
class Stage:
    """The state of a stage of the Dockerfile."""

    root: Path
    arguments: dict[str, str] = field(default_factory=dict)
    environment: dict[str, str] = field(default_factory=lambda: {"PATH": SEARCHED})
    folder: str = "/"
    user: str = "0:0"
    said: dict[str, str] = field(default_factory=dict)


def instructions() -> list[tuple[str, str]]:
    text = re.sub(r"^#.*\n", "", (ROOT / "Dockerfile").read_text(), flags=re.MULTILINE)
    lines = text.replace("\\\n", " ").splitlines()
    return [
        (word, rest.strip()) for word, _, rest in (line.partition(" ") for line in lines if line)
    ]


def copied(stage: Stage, rest: str, stages: dict[str, Stage]) -> None:
    *sources, target = rest.split()
    start = (
        stages[sources.pop(0).removeprefix("--from=")].root
        if sources[0].startswith("--from")
        else None
    )
    for source in sources:
        for found in [start / source.lstrip("/")] if start else sorted(ROOT.glob(source)):
            assert start or not is_ignored(found), f"{found} is kept out by .dockerignore"
            there = stage.root / (
                target if target.startswith("/") else f"{stage.folder}/{target}"
            ).lstrip("/")
            if found.is_dir():
                ignored = None if start else shutil.ignore_patterns("__pycache__")
                shutil.copytree(found, there, symlinks=True, dirs_exist_ok=True, ignore=ignored)
            else:
                there.mkdir(parents=True, exist_ok=True)
                shutil.copy2(found, there)


def is_ignored(path: Path) -> bool:
    kept = [
        line[1:]
        for line in (ROOT / ".dockerignore").read_text().splitlines()
        if line.startswith("!")
    ]
    return not any(fnmatch(str(path.relative_to(ROOT)), pattern) for pattern in kept)


def built(base: Path, folder: Path, **arguments: str) -> Stage:
    """The last stage of the Dockerfile, its steps run in copies of the base."""
    stages: dict[str, Stage] = {}
    for word, rest in instructions():
        if word == "FROM":
            name = rest.partition(" AS ")[2] or "last"
            (folder / name).mkdir()
            copy(base, folder / name)
            stage = stages[name] = Stage(folder / name)
        elif word == "ARG":
            name, _, value = rest.partition("=")
            if stages:  # the environment of the base comes first
                stage.arguments[name] = arguments.get(name, value.strip('"'))
        elif word == "ENV":
            for name, value in re.findall(r"(\w+)=(\S+)", rest):
                stage.environment[name] = value.replace("$PATH", stage.environment["PATH"])
        elif word == "WORKDIR":
            stage.folder = rest
            (stage.root / rest.lstrip("/")).mkdir(parents=True, exist_ok=True)
        elif word == "COPY":
            copied(stage, rest, stages)
        elif word == "RUN":
            run_in(
                stage.root,
                f"cd {stage.folder}; set +u; {rest}",
                stage.environment | stage.arguments,
                stage.user,
            )
        elif word == "USER":
            stage.user = rest
        else:
            stage.said[word] = rest
    return stage


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    folder = tmp_path_factory.mktemp("image")
    (folder / "base").mkdir()
    base = bare_debian(folder / "base")
    run_in(base, LIKE_THE_BASE)
    return built(base, folder, EXTRAS="dask,postgres")


def test_what_is_built_runs_read_only_without_rights(image: Stage) -> None:
    command = json.loads(image.said["CMD"])
    health = json.loads(image.said["HEALTHCHECK"].partition(" CMD ")[2])
    (image.root / "ask.py").write_text(ASK)
    (image.root / "health.py").write_text(health[2])
    script = f"""
{" ".join(command)} >/tmp/out 2>/tmp/log & service=$!
for _ in $(seq 240); do python /health.py 2>/dev/null && break; sleep 0.5; done
python /ask.py || {{ cat /tmp/log; exit 1; }}
kill -TERM $service; wait $service
"""
    out = run_in(
        image.root, script, image.environment, image.user, True, True, [image.said["VOLUME"]]
    )
    found = json.loads(out.splitlines()[-1])
    assert found == {
        "verdict": "variational",
        "outcome": "completed",
        "figure": "<?xml",
        "user": [10001, 10001],
    }


def test_nothing_in_it_installs_and_it_is_owned_by_root(image: Stage) -> None:
    tried = 'for name in pip setuptools ensurepip; do python -c "import $name" 2>/dev/null && echo "$name"; done; true'
    for path in (image.environment["PATH"], SEARCHED):
        assert run_in(image.root, tried, {"PATH": path}, image.user) == ""
    assert (
        run_in(image.root, "find /opt/inverse-service -not -user root -o -perm -o+w -not -type l")
        == ""
    )
    assert run_in(image.root, "find / -xdev -name 'pip*' -path '*bin*' -not -path '/proc/*'") == ""


def test_the_image_of_the_cluster_has_its_commands(image: Stage) -> None:
    out = run_in(
        image.root,
        "dask scheduler --version; python -c 'import psycopg'",
        image.environment,
        image.user,
        True,
        True,
    )
    assert "version" in out


def test_without_extras_it_is_slim(image: Stage, tmp_path: Path) -> None:
    slim = built(image.root.parent / "base", tmp_path)
    tried = 'for module in dask psycopg; do python -c "import $module" 2>/dev/null && echo $module; done; true'
    assert run_in(slim.root, tried, slim.environment, slim.user) == ""
    sizes = {name: int(run_in(one.root, "du -sm /opt/inverse-service").split()[0]) for name, one in
             (("all", image), ("slim", slim))}  # fmt: skip
    print(sizes)
    assert sizes["slim"] < sizes["all"]
