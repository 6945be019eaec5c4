"""The search among associated systems as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def family_search_lines(part: dict[str, Any]) -> Iterator[str]:
    """A table of the families, then each variational system."""
    yield f"Associated systems searched for {part['question']} in {part['seconds']:.1f} s"
    yield f"  {'family':<10} {'members':>8} {'decided':>8} {'variational':>12} {'not':>8} {'undetermined':>13}"
    for row in part["families"]:
        yield (
            f"  {row['name']:<10} {row['members']:>8} {row['decided']:>8} {row['variational']:>12} "
            f"{row['not_variational']:>8} {row['undetermined']:>13}"
        )
    yield f"  {part['covered']}"
    for number, member in enumerate(part["variational"], 1):
        yield ""
        yield f"  {number}. variational ({', '.join(member['kinds'] or member['families'])})"
        yield from (f"     {name}'' = {text}" for name, text in member["equations"].items())
        yield from _found(member)


def _found(member: dict[str, Any]) -> Iterator[str]:
    if member["lagrangian"] is None:
        yield "     no Lagrangian in closed form was found in the time given"
    else:
        yield f"     L = {member['lagrangian']['text']}"
    if member["hamiltonian"] is not None:
        yield f"     H = {member['hamiltonian']['text']}"
    yield from (f"     constraint {image['text']} = 0" for image in member["constraints"])
    if member["holds"]:
        yield "     the flow of H on the constraints is the nonholonomic motion: confirmed"


def family_search_latex(part: dict[str, Any]) -> Iterator[str]:
    """The same as lines of LaTeX."""
    yield r"\paragraph{Associated systems}"
    yield r"\begin{tabular}{lrrrrr}"
    yield r"family & members & decided & variational & not & undetermined \\"
    for row in part["families"]:
        counts = [row[key] for key in ("members", "decided", "variational", "not_variational", "undetermined")]
        yield f"{row['name']} & " + " & ".join(map(str, counts)) + r" \\"
    yield r"\end{tabular}"
    for member in part["variational"]:
        yield r"\begin{gather*}"
        lines = list(member["latex"].values())
        lines += [f"L = {member['lagrangian']['latex']}"] if member["lagrangian"] else []
        lines += [f"H = {member['hamiltonian']['latex']}"] if member["hamiltonian"] else []
        lines += [f"{image['latex']} = 0" for image in member["constraints"]]
        yield " \\\\\n".join(lines)
        yield r"\end{gather*}"
