"""The tree of special cases as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

WORDS = {"variational": "variational", "not_variational": "not variational", "undetermined": "undetermined"}


def special_cases_lines(part: dict[str, Any]) -> Iterator[str]:
    """The answer first, then the tree, then what is not known."""
    yield "For which parameters?"
    yield from _answers(part["variational_when"], "  A Lagrangian exists", "text")
    if part["variational_when_with_time"] not in (None, part["variational_when"]):
        yield from _answers(part["variational_when_with_time"], "  A Lagrangian L(t, q, q') exists", "text")
    yield f"  Tree of cases ({part['examined']} examined):"
    yield from _tree(part["tree"], "    ")
    if part["complete"]:
        yield "  The tree is complete: no other case has another verdict."
    else:
        only = " for L(q, q'); for L(t, q, q') it is" if part["complete_with_time"] else ""
        yield f"  The tree may not be complete{only}:"
        yield from (f"    {reason}" for reason in part["reasons"])


def special_cases_latex(part: dict[str, Any]) -> Iterator[str]:
    """The same as lines of LaTeX; conditions are formulas."""
    yield r"\paragraph{For which parameters?}"
    yield from _answers(part["variational_when"], "A Lagrangian exists", "latex")
    if part["variational_when_with_time"] not in (None, part["variational_when"]):
        yield from _answers(part["variational_when_with_time"], "A Lagrangian $L(t, q, q')$ exists", "latex")
    yield f"Cases examined: {part['examined']}. " + (
        "The tree is complete." if part["complete"] else "The tree may not be complete."
    )
    yield from _items(part["tree"])


def _answers(cases: list[dict[str, Any]], opening: str, form: str) -> Iterator[str]:
    ending = r" \\" if form == "latex" else ""
    if not cases:
        yield f"{opening} in none of the cases found.{ending}"
    for case in cases:
        line = f"{opening} {_where(case['conditions'], form)}"
        if case["exceptions"]:
            line += ", except " + "; ".join(_where(conditions, form) for conditions in case["exceptions"])
        yield f"{line}.{ending}"


def _where(conditions: list[dict[str, str]], form: str) -> str:
    if not conditions:
        return "in general"
    texts = [f"${c['latex']}$" if form == "latex" else c["text"] for c in conditions]
    return "where " + ", ".join(texts)


def _tree(node: dict[str, Any], indent: str) -> Iterator[str]:
    verdict = WORDS[node["verdict"]]
    if node["verdict_with_time"] not in (None, node["verdict"]):
        verdict += f" (with t: {WORDS[node['verdict_with_time']]})"
    yield f"{indent}{_where(node['conditions'], 'text')}: {verdict}"
    for child in node["children"]:
        yield from _tree(child, indent + "  ")


def _items(node: dict[str, Any]) -> Iterator[str]:
    yield r"\begin{itemize}"
    yield f"\\item {_where(node['conditions'], 'latex')}: {WORDS[node['verdict']]}"
    for child in node["children"]:
        yield from _items(child)
    yield r"\end{itemize}"
