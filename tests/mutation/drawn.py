"""Changes drawn over the whole package, each line that can be changed with the same chance:
`python -m tests.mutation.drawn --seed TEXT --number N`.

The changes are those of `mutants` and a few more kinds: an operand, an entry or a keyword left out, a
text changed, `any` for `all`. What is drawn is printed, one JSON object for each change.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
from collections import defaultdict
from collections.abc import Iterator
from functools import partial

from tests.mutation.mutants import Site, expressions, put, sites
from tests.mutation.trial import ROOT

OTHERS = {"any": "all", "min": "max", "sorted": "list", "abs": "float"}
OTHERS |= {other: name for name, other in list(OTHERS.items())[:2]}


def all_sites(tree: ast.AST) -> list[Site]:
    """Every change of the source, those of `mutants` first."""
    return [*sites(tree), *_more(tree)]


def _more(tree: ast.AST) -> Iterator[Site]:
    for parent, name, index, node in expressions(tree):
        replaced = partial(partial, put, parent, name, index)
        match node:
            case ast.BinOp(left=left, right=right):
                yield node, "left operand only", replaced(left)
                yield node, "right operand only", replaced(right)
            case ast.BoolOp(values=[first, *rest]):
                yield node, "first operand only", replaced(first)
                yield node, "without the first operand", replaced(rest[-1])
            case ast.List(elts=entries) | ast.Set(elts=entries) if len(entries) > 1:
                yield node, "last entry left out", entries.pop
            case ast.Tuple(elts=entries) if len(entries) > 1 and all(
                isinstance(entry, ast.Constant | ast.Starred) for entry in entries
            ):
                yield node, "last entry left out", entries.pop
            case ast.Constant(value=str() as text) if text and " " not in text:
                yield node, "another text", replaced(ast.Constant(text[:-1]))
            case ast.Constant(value=float() as number):
                yield node, "twice", replaced(ast.Constant(2 * number))
            case ast.Call(func=ast.Name(id=called)) if called in OTHERS:
                yield node, OTHERS[called], partial(setattr, node.func, "id", OTHERS[called])
        if isinstance(node, ast.Call) and any(word.arg for word in node.keywords):
            yield node, "last keyword left out", node.keywords.pop


def drawn(seed: str, number: int) -> list[dict[str, object]]:
    """The changes: file, line, number of the site in the file, expression, rule."""
    places = list[tuple[str, int, list[tuple[int, str, str]]]]()
    for path in sorted((ROOT / "inverse_service").rglob("*.py")):
        lines = defaultdict[int, list[tuple[int, str, str]]](list)
        for k, (node, rule, _) in enumerate(all_sites(ast.parse(path.read_text(encoding="utf-8")))):
            lines[node.lineno].append((k, ast.unparse(node), rule))
        places += [
            (str(path.relative_to(ROOT)), line, each) for line, each in sorted(lines.items())
        ]
    draw = random.Random(seed)
    found = []
    for file, line, each in draw.sample(places, number):
        site, before, rule = draw.choice(each)
        found.append({"file": file, "line": line, "site": site, "before": before, "rule": rule})
    return found


def changed(source: str, site: int) -> str:
    """The source with the change."""
    tree = ast.parse(source)
    all_sites(tree)[site][2]()
    return ast.unparse(ast.fix_missing_locations(tree))


def main() -> None:
    """Print what is drawn."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation.drawn", description=__doc__)
    parser.add_argument("--seed", required=True)
    parser.add_argument("--number", type=int, default=60)
    asked = parser.parse_args()
    for each in drawn(asked.seed, asked.number):
        print(json.dumps(each))


if __name__ == "__main__":
    main()
