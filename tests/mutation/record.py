"""What became of each mutant, on disc: a broken run goes on where it was, a change loses only its own function."""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from tests.mutation.mutants import Mutant


class Record:
    """The answers on the mutants of one source, in a file of lines of JSON; of two answers the later one holds."""

    def __init__(self, path: Path, source: str, every: Sequence[Mutant]) -> None:
        self.path, self.keys = path, keys(source, every)
        lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
        known = {one["key"]: one["said"] for one in map(json.loads, lines)}
        self.said = {mutant: known[key] for mutant, key in self.keys.items() if key in known}

    def add(self, mutant: Mutant, said: str) -> None:
        self.said[mutant] = said
        self.path.parent.mkdir(parents=True, exist_ok=True)
        entry = {"key": self.keys[mutant], "line": mutant.line, "before": mutant.before, "rule": mutant.rule}
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps({**entry, "said": said}) + "\n")


def examined() -> dict[str, str]:
    """What kind of change was found harmless, by the key of its mutant: a survivor that is here was worked out by hand.

    The files, one for a module, have a line for each, with the reason: `same` (no document is treated otherwise),
    `stricter` (more is refused, nothing else accepted), `sound` (more is accepted, by rows that are true too),
    `chance` (random points, their number or size: the bounds of FORMAT.md hold), `effort` (limits of time and size),
    `words` (messages).
    """
    files = (Path(__file__).parent / "examined").glob("*.ndjson")
    lines = [line for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    return {one["key"]: one["kind"] for one in map(json.loads, lines)}


def keys(source: str, every: Sequence[Mutant]) -> dict[Mutant, str]:
    """A name for each mutant that does not change while its function, or outside of them its statement, stays."""
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
