"""The answer to a Lagrangian alone, as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def is_forward_result(result: dict[str, Any]) -> bool:
    """Whether a result answers the forward problem."""
    return str(result.get("format", "")).startswith("inverse-service/forward")


def rows(result: dict[str, Any], form: str) -> Iterator[tuple[str, str]]:
    """(left side, right side) of every formula, `form` being text or latex."""
    yield "L", result["lagrangian"][form]
    for name, found in result["equations"].items():
        if form == "latex":
            left, _, right = result["system"]["latex"][name].partition(" = ")
            yield left, right
        else:
            yield f"{name}''", found["text"]
    for symbol, momentum in zip(result["hamiltonian"]["momenta"], result["momenta"].values(), strict=True):
        yield symbol if form == "text" else f"p_{{{symbol.partition('_')[2]}}}", momentum[form]
    yield "H", result["hamiltonian"][form]
    for found in result["conserved"]:
        yield found["name"] if form == "text" else rf"\text{{{found['name']}}}", found[form]


def forward_text(result: dict[str, Any]) -> str:
    """Equations, momenta, Hamiltonian, and what is conserved, one a line."""
    title = [result["system"]["name"]] if result["system"]["name"] else []
    guessed = [f"  not declared, taken as constants: {', '.join(result['guessed'])}"] if result["guessed"] else []
    return "\n".join([*title, *guessed, *(f"  {left} = {right}" for left, right in rows(result, "text"))]) + "\n"


def forward_latex(result: dict[str, Any]) -> Iterator[str]:
    """The same as displayed formulas."""
    yield from (f"\\[ {left} = {right} \\]" for left, right in rows(result, "latex"))
