"""The steps of an explanation as LaTeX, from their parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}  # fmt: skip


def escaped(text: str) -> str:
    """Plain text with the characters that LaTeX gives a meaning made harmless."""
    return "".join(SPECIAL.get(character, character) for character in text)


def display(formula: str) -> str:
    """A formula on a line of its own."""
    return f"\\[ {formula} \\]"


def latex_proof(steps: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """The lines of an enumeration; formulas of the sentences are set as formulas."""
    if not steps:
        return
    yield r"\begin{enumerate}"
    for step in steps:
        parts = step.get("parts") or [{"kind": "text", "text": step["text"]}]
        sentence = "".join(_inline(part) for part in parts if part["kind"] in ("text", "formula"))
        below = [display(part["latex"]) for part in parts if part["kind"] == "display"]
        yield " ".join([f"\\item {sentence}", *below])
    yield r"\end{enumerate}"


def _inline(part: Mapping[str, Any]) -> str:
    return f"${part['latex'].strip()}$" if part["kind"] == "formula" else escaped(part["text"])
