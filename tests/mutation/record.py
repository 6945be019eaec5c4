"""The answer for each mutant, on disk: an interrupted run resumes; a source change invalidates only
its function.
"""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from tests.mutation.mutants import Mutant


class Record:
    """The answers for the mutants of one source, in a file of JSON lines; the later of two answers
    counts.
    """

    def __init__(self, path: Path, source: str, every: Sequence[Mutant]) -> None:
        self.path, self.keys = path, keys(source, every)
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        known = {one["key"]: one["said"] for one in map(json.loads, lines)}
        self.said = {mutant: known[key] for mutant, key in self.keys.items() if key in known}

    def add(self, mutant: Mutant, said: str) -> None:
        self.said[mutant] = said
        self.path.parent.mkdir(parents=True, exist_ok=True)
        entry = {
            "key": self.keys[mutant],
            "line": mutant.line,
            "before": mutant.before,
            "rule": mutant.rule,
        }
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({**entry, "said": said}) + "\n")


def examined() -> dict[str, str]:
    """The type of each harmless change by the key of its mutant; these survivors were examined by
    hand.

    The files, one per module, have a line for each survivor with the reason: `same` (all documents
    are treated the same), `stricter` (it only rejects more), `sound` (it accepts more, by rows that
    are also true), `chance` (random points, their number or size: the bounds of FORMAT.md hold),
    `effort` (limits of time and size), `words` (messages).
    """
    files = (Path(__file__).parent / "examined").glob("*.ndjson")
    lines = [line for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    return {one["key"]: one["kind"] for one in map(json.loads, lines)}


def keys(source: str, every: Sequence[Mutant]) -> dict[Mutant, str]:
    """A name for each mutant that is stable while its function, or outside functions its statement,
    is unchanged.
    """
    texts, lines = dict(_functions(ast.parse(source))), source.splitlines()
    places: dict[str, int] = {}
    found = {}
    for mutant in every:
        first, last = mutant.lines
        own = texts.get(mutant.function) or "\n".join(lines[first - 1 : last])
        place = places[own] = places.get(own, -1) + 1
        found[mutant] = hashlib.sha256(f"{own}\n{place}".encode()).hexdigest()
    return found


def _functions(tree: ast.Module) -> list[tuple[str, str]]:
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    places = [("", tree.body), *((node.name + ".", node.body) for node in classes)]
    return [(prefix + node.name, prefix + ast.unparse(node))
            for prefix, body in places for node in body if isinstance(node, ast.FunctionDef)]  # fmt: skip
