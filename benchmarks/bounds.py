"""What each bound of the search is worth: L found, other forms of L and time with half of it and with twice as much.

python -m benchmarks bounds --generated 24 --systems FILE.ndjson … [--only NAME …]

Bounds are the integers with a name in capitals that a module of the search holds. Seconds are processor time of all
systems together. What neither half nor twice a bound changes is fixed by nothing that was measured.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import pkgutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from unittest import mock

from benchmarks.ablation import Given, Run, add_collections, given_systems, record
from benchmarks.tables import table
from inverse_service.inverse_problem import search


@dataclass(frozen=True, slots=True)
class Bound:
    """An integer of a module."""

    module: ModuleType
    name: str
    value: int

    @property
    def place(self) -> str:
        return f"{self.module.__name__.removeprefix(search.__name__ + '.')}.{self.name}"


def modules() -> list[ModuleType]:
    """Those of the search."""
    found = pkgutil.walk_packages(search.__path__, search.__name__ + ".")
    return [importlib.import_module(one.name) for one in found]


def bounds() -> Iterator[Bound]:
    """The integers above 1 that modules name in capitals where they are written."""
    for module in modules():
        assert module.__file__ is not None
        body = ast.parse(Path(module.__file__).read_text(encoding="utf-8")).body
        targets = [target for node in body if isinstance(node, ast.Assign) for target in node.targets]
        written = [part for target in targets for part in (target.elts if isinstance(target, ast.Tuple) else [target])]
        for name in (part.id for part in written if isinstance(part, ast.Name) and part.id.isupper()):
            value = getattr(module, name)
            if type(value) is int and value > 1 and name != "_PRIME":
                yield Bound(module, name, value)


@contextmanager
def changed(bound: Bound, value: int) -> Iterator[None]:
    """Within the block it has another value, also where it was imported."""
    with ExitStack() as stack:
        for module in modules():
            if getattr(module, bound.name, None) is getattr(bound.module, bound.name):
                stack.enter_context(mock.patch.object(module, bound.name, value))
        yield


def told(before: Sequence[Run], after: Sequence[Run]) -> str:
    """What is lost, found, written otherwise, and the time of all."""
    pairs = list(zip(before, after, strict=True))
    lost = [a.name for a, b in pairs if a.found and not b.found]
    found = [a.name for a, b in pairs if b.found and not a.found]
    other = sum(a.found and b.found and a.text != b.text for a, b in pairs)
    parts = [f"-{len(lost)}"] * bool(lost) + [f"+{len(found)}"] * bool(found) + [f"{other} otherwise"] * bool(other)
    seconds = sum(one.seconds for one in after) / sum(one.seconds for one in before)
    return f"{', '.join(parts) or 'same'}; {seconds:.2f}"


def main(arguments: Sequence[str] | None = None, report: Callable[[str], None] = print) -> None:
    """The table, a row for each bound."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks bounds", description=__doc__)
    add_collections(parser)
    parser.add_argument("--only", nargs="*", default=[], help="these bounds alone, module.NAME")
    parser.add_argument("--part", default="0/1", help="k/n: the k-th of n parts of the bounds, for several processes")
    chosen = parser.parse_args(arguments)
    systems: list[Given] = [given for _, given in given_systems(chosen)]
    for given in systems:
        record(given, chosen.limit)  # compiles and loads what it needs
    before = [record(given, chosen.limit) for given in systems]
    part, parts = map(int, chosen.part.split("/"))
    cells = []
    for k, bound in enumerate(bounds()):
        if k % parts != part or (chosen.only and bound.place not in chosen.only):
            continue
        row = [bound.place, f"{bound.value:,}"]
        for value in (bound.value // 2, 2 * bound.value):
            with changed(bound, value):
                row.append(told(before, [record(given, chosen.limit) for given in systems]))
        print(" | ".join(row), file=sys.stderr, flush=True)
        cells.append(row)
    report(f"{len(systems)} systems, {sum(one.seconds for one in before):.1f} s\n")
    report(table(["bound", "value", "half: L; time", "twice: L; time"], cells))
