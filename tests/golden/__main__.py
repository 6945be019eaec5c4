"""What a change does to a hundred results: `python -m tests.golden --base REVISION [--but KEY
...]`.

Each document is solved in a process of its own, by the working tree and by the revision, which is
checked out below build/golden. The results are compared as JSON, key by key. `documents()` draws
systems of the corpus that are not slow, motions of docs/questions, kinds and systems with cells,
evenly from each file. Two limits that a busy machine reaches are ten times as long in both trees,
and the keys of `CLOCKS` are left out: the rest of a result depends on the document alone. The two
trees run with different hash seeds, so that an order which comes from a set of texts is a
difference. Exit 1 and one line for each difference.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.doors import choosing
from tests.doors.rows import rows

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build" / "golden"
LIMIT = 15.0  # s of processor time for one document
CLOCKS = (
    "/provenance/seconds",
    "/provenance/time_limit",
    "/provenance/engine",
    "/provenance/version",
)
# Files of the corpus and the number of documents from each.
DRAWN = {
    "textbook": 15,
    "literature": 15,
    "kamke": 8,
    "generated": 6,
    "tables": 12,
    "search": 6,
    "identities": 4,
    "families": 8,
    "kinds": 6,
    "branches": 10,
}
# Runs in either tree: a document from standard input, its result to standard output.
SOLVE = """
import json, sys
sys.path.insert(0, sys.argv[1])
import inverse_service
from inverse_service.service.documents import documents
documents.QUICKLY *= 10
result = inverse_service.solve(json.load(sys.stdin), time_limit=float(sys.argv[2]))
json.dump(dict(result), sys.stdout, sort_keys=True)
"""


def documents() -> dict[str, Any]:
    """The documents by name; the same ones in every run."""
    chosen: dict[str, Any] = {}
    for name, number in DRAWN.items():
        quick = [row for row in rows(name) if "document" in row and choosing.is_candidate(row)]
        step = max(1, len(quick) // number)
        chosen |= {f"{name}: {row['id']}": row["document"] for row in quick[::step][:number]}
    lines = (
        (ROOT / "docs" / "questions" / "motions.ndjson").read_text(encoding="utf-8").splitlines()
    )
    for line in lines[:: len(lines) // 10][:10]:
        motion = json.loads(line)
        chosen[f"motions: {motion.pop('name')}"] = motion
    return chosen


def answers(tree: Path, processes: int, seed: int) -> dict[str, Any]:
    """The results of all documents by the code in `tree`, with that hash seed; a text where there
    is none.
    """

    def answer(document: Any) -> Any:
        run = subprocess.run(
            [sys.executable, "-c", SOLVE, str(tree), str(LIMIT)],
            input=json.dumps(document),
            capture_output=True,
            text=True,
            check=False,
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": str(seed)},
        )
        lines = run.stderr.strip().splitlines()
        return (
            json.loads(run.stdout)
            if run.returncode == 0
            else f"no result: {lines[-1] if lines else run.returncode}"
        )

    asked = documents()
    with ThreadPoolExecutor(processes) as pool:
        return dict(zip(asked, pool.map(answer, asked.values()), strict=True))


def differences(old: Any, new: Any, but: Sequence[str], at: str = "") -> Iterator[str]:
    """JSON pointers with what was and what is; pointers that end with a part in `but` and clocks
    are left out.
    """
    if old == new or at.startswith(CLOCKS) or (at and at.rpartition("/")[2] in but):
        return
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in sorted({*old, *new}):
            yield from differences(old.get(key), new.get(key), but, f"{at}/{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, but, f"{at}/{number}")
    else:
        yield f"{at}: {_short(old)} -> {_short(new)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 160 else f"{text[:157]}..."


def tree_of(revision: str) -> Path:
    """A checkout of the revision below build/golden."""
    command = ["git", "rev-parse", "--verify", f"{revision}^{{commit}}"]
    commit = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout.strip()
    tree = FOLDER / commit
    if not tree.exists():
        subprocess.run(
            ["git", "worktree", "add", "--force", "--quiet", "--detach", str(tree), commit],
            check=True,
            cwd=ROOT,
        )
    return tree


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the differences; 0 without any."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument(
        "--base", default="HEAD", help="the revision to compare with (default HEAD)"
    )
    parser.add_argument("--but", nargs="*", default=[], help="keys that are meant to change")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args(arguments)
    base = tree_of(options.base)
    stored = base.with_suffix(".json")
    if not stored.exists():
        stored.write_text(json.dumps(answers(base, options.processes, 1)), encoding="utf-8")
    before, after = (
        json.loads(stored.read_text(encoding="utf-8")),
        answers(ROOT, options.processes, 2),
    )
    found = [
        f"{name} {each}"
        for name in after
        for each in differences(before.get(name), after[name], options.but)
    ]
    print(*found, f"{len(after)} documents, {len(found)} differences", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
