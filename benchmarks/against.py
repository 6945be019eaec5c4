"""What an answer costs here and at another revision: `python -m benchmarks.against REVISION
[--every N] [--rounds N]`.

Takes each N-th of the documents of `tests.golden`. A process of each tree in turn answers the
document once, which loads what it needs, and then a number of times more; the least processor
seconds count.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.tables import table
from tests.golden.__main__ import ROOT, documents, tree_of

LIMIT = 60.0  # s of processor time for one answer
PARTS = ("first answer", "decision", "without integrals", "whole")
# Runs in either tree: a document from standard input, the seconds of its parts to standard output.
_ANSWER = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
from inverse_service.decision.deciding import decide
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents import accepting
from inverse_service.service.documents.documents import solve_document
try:
    from inverse_service.statements.questions import PLAIN
except ImportError:
    PLAIN = False
document, found, rounds, limit = json.load(sys.stdin), [], int(sys.argv[2]), float(sys.argv[3])

def seconds(function):
    start = time.process_time()
    function()
    return time.process_time() - start

def answer(**keys):
    told, start = [], time.process_time()
    tell = lambda message: told.append(time.process_time() - start)
    solve_document({**document, **keys}, SolveOptions(time_limit=limit), tell)
    told.append(time.process_time() - start)
    return told

for _ in range(1 + rounds):
    whole = answer()
    parts = {"first answer": whole[0], "whole": whole[-1]}
    parts["without integrals"] = answer(first_integrals=False)[-1]
    if "equations" in document and "constraints" not in document:
        schema = accepting.to_schema(document)
        system = accepting.to_solvable(schema, accepting.to_given(schema))
        parts["decision"] = seconds(lambda: decide(system, PLAIN))
    found.append(parts)
print(json.dumps({part: min(one[part] for one in found[1:]) for part in found[0]}))
"""


def seconds_of(tree: Path, document: Any, rounds: int) -> dict[str, float] | None:
    """The least processor seconds of each part; None where the tree has no answer."""
    done = subprocess.run(
        [sys.executable, "-c", _ANSWER, str(tree), str(rounds), str(LIMIT)],
        input=json.dumps(document),
        capture_output=True,
        text=True,
        check=False,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": "1"},
    )
    found: dict[str, float] | None = json.loads(done.stdout) if done.returncode == 0 else None
    return found


def row(part: str, pairs: Sequence[tuple[float, float]]) -> list[str]:
    """The sums of what was measured, and how the ratios of the documents are distributed."""
    old, new = (sum(each) for each in zip(*pairs, strict=True))
    ratios = sorted(here / there for there, here in pairs)
    middle, ends = statistics.median(ratios), f"{ratios[0]:.2f} to {ratios[-1]:.2f}"
    return [part, str(len(ratios)), f"{old:.3f}", f"{new:.3f}", f"{middle:.2f}", ends]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and the documents that take longest compared with the revision."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against", description=__doc__)
    parser.add_argument("revision")
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args(arguments)
    base, measured = tree_of(options.revision), dict[str, list[dict[str, float]]]()
    for name, document in list(documents().items())[:: options.every]:
        found = [seconds_of(tree, document, options.rounds) for tree in (base, ROOT)]
        known = [one for one in found if one is not None]
        if len(known) == len(found):
            measured[name] = known
        print(name, *known, file=sys.stderr, flush=True)
    pairs = {
        part: [(old[part], new[part]) for old, new in measured.values() if part in old]
        for part in PARTS
    }
    rows = [row(part, known) for part, known in pairs.items()]
    print(
        table(
            ["part", "documents", f"{options.revision}, s", "here, s", "median ratio", "ratios"],
            rows,
        )
    )


if __name__ == "__main__":
    main()
