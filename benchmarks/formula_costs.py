"""How formulas are written, next to textbooks: `python -m benchmarks costs [--answers]`.

tests/corpus/costs.ndjson has a hundred formulas of textbooks (`book`), each with an equal one that
this program printed (`ours`). The table says for each weight of a term in `mechanics.moves` how
many of them cost less in the book's form. `--answers` solves the systems of
tests/corpus/forms.ndjson and compares the lengths of L and H with those of the book.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import inverse_service
from inverse_service.expressions import tree as ex
from inverse_service.mechanics import moves
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula

LIMIT = 20.0  # s of processor time for one document
Pair = tuple[ex.Expression, ex.Expression]


def pairs() -> list[tuple[dict[str, Any], Pair]]:
    """Each row of the corpus with the trees of the book's formula and of ours."""
    from tests.doors.rows import rows

    found = []
    for row in rows("costs"):
        momenta = tuple(f"p_{name}" for name in row["coordinates"])
        names = Names(tuple(row["coordinates"]), (*row["parameters"], *momenta))
        found.append((row, (read_formula(row["book"], names), read_formula(row["ours"], names))))
    return found


def order(cost: Any, compared: Iterable[Pair]) -> Counter[str]:
    """How many pairs the cost orders as the book does, how many are equal, and how many not."""
    found = Counter[str]()
    for book, ours in compared:
        one, other = cost(book), cost(ours)
        found["book" if one < other else "equal" if one == other else "ours"] += 1
    return found


def weights_table(compared: Sequence[Pair]) -> str:
    """A Markdown table: what a term costs, and how many pairs are ordered as the book does."""
    lines = ["| a term | as the book | equal |", "| ---: | ---: | ---: |"]
    for term in range(7):
        costs = [
            [moves.size(one) + term * len(ex.summands(one)) for one in pair] for pair in compared
        ]
        fewer = sum(one < other for one, other in costs)
        equal = sum(one == other for one, other in costs)
        mark = " (chosen)" if term == moves.TERM else ""
        lines.append(f"| {term}{mark} | {fewer} | {equal} |")
    return "\n".join(lines)


def length(text: str) -> int:
    """The characters without blanks."""
    return len("".join(text.split()))


def lengths(row: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    """The lengths of L and of H, ours and the book's; H by its mass matrix where it is shown so."""
    found = {"L": (length(answer["lagrangian"]["text"]), length(row["lagrangian"]))}
    energy = answer.get("hamiltonian") or {}
    if "mass_matrix" in row:
        book = length(json.dumps(row["mass_matrix"])) + length(row["potential"])
    else:
        book = length(row["hamiltonian"])
    if energy.get("mass_matrix"):
        ours = length(json.dumps(energy["mass_matrix"])) + length(energy["potential"]["text"])
    else:
        ours = length(energy.get("text", ""))
    return {**found, "H": (ours, book)}


def forms() -> list[dict[str, Any]]:
    """The rows of forms.ndjson with the documents and the L of the book."""
    from tests.doors.rows import rows

    books = {row["id"]: row for row in rows("books")}
    found = []
    for row in rows("forms"):
        book = books[row["of"]]
        known = (book.get(key) for key in ("textbook", "lagrangian", "lagrangian_with_time"))
        lagrangian = next(filter(None, known))
        found.append({**row, "document": book["document"], "lagrangian": lagrangian})
    return found


def answers_table() -> str:
    lines = ["| system | L, ours | book | H, ours | book |", "| --- | ---: | ---: | ---: | ---: |"]
    worst = 0.0
    for row in forms():
        answer = inverse_service.solve(row["document"], time_limit=LIMIT)["answers"][0]
        found = lengths(row, answer)
        worst = max([worst, *(ours / book for ours, book in found.values())])
        cells = " | ".join(f"{ours} | {book}" for ours, book in found.values())
        lines.append(f"| {row['id']} | {cells} |")
    return "\n".join([*lines, f"\nThe longest is {worst:.2f} times the book's."])


def main(arguments: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks costs", description=__doc__)
    parser.add_argument("--answers", action="store_true", help="solve the systems and compare")
    if parser.parse_args(arguments).answers:
        print(answers_table())
        return
    rows = pairs()
    print(weights_table([pair for _, pair in rows]))
    for row, pair in rows:
        if order(moves.cost, [pair])["book"] == 0:
            print(f"\nnot as the book: {row['id']}\n  book {row['book']}\n  ours {row['ours']}")
