"""The steps of a proof as a page shows them, and the matrices that they use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from markupsafe import Markup, escape

from inverse_service.reading.names import Names
from inverse_service.web.pages import typesetting
from inverse_service.web.pages.glossary import Term, terms_of

TENSORS = (("Phi", "Φ", "<mi>Φ</mi>"), ("nabla_Phi", "∇Φ", "<mi>∇</mi><mi>Φ</mi>"))
# Characters of all matrices on a page: typeset they weigh 25 times that.
LONGEST_MATRICES = 6_000
LONG = Markup('<p class="hint">{} has {:,} characters: it is in the JSON, under <code>conditions</code>.</p>')
# What no line can be broken in.
UNBREAKABLE = ("<mtable", "<mfrac", "<msqrt")


@dataclass(frozen=True, slots=True)
class Matrix:
    """A tensor by name, a curvature as one matrix for each upper index; shown once on the page, at `anchor`."""

    name: str
    math: Markup
    key: str

    @property
    def anchor(self) -> str:
        """Its place on the page."""
        return f"matrix-{self.name if self.key == 'R' else self.key}"


@dataclass(frozen=True, slots=True)
class Step:
    """A sentence, its formula where the sentence does not say it already, and the matrices that it uses."""

    text: Markup
    formula: Markup | None
    matrices: list[Matrix]
    is_wide: bool
    terms: tuple[Term, ...] = ()


def matrices_of(conditions: Mapping[str, Any] | None, names: Names) -> list[Matrix]:
    """Phi, nabla Phi, and each nonzero block of R; what would make the page too long is only named."""
    if conditions is None:
        return []
    wanted = [(symbol, left, key, conditions[key]) for key, symbol, left in TENSORS if conditions.get(key)]
    for index, block in enumerate(conditions.get("R") or [], start=1):
        if any(entry != "0" for row in block for entry in row):
            wanted.append((f"R{index}", f"<msup><mi>R</mi><mn>{index}</mn></msup>", "R", block))
    found, room = [], LONGEST_MATRICES
    for symbol, left, key, rows in wanted:
        length = sum(len(entry) for row in rows for entry in row)
        fits = length <= room
        room -= length * fits
        found.append(Matrix(symbol, _named_matrix(left, rows, names) if fits else LONG.format(symbol, length), key))
    return found


def _named_matrix(left: str, rows: Sequence[Sequence[str]], names: Names) -> Markup:
    inner = typesetting.matrix_inner(rows, names)
    if inner is None:
        return typesetting.matrix(rows, names)
    return typesetting.math(f"<mrow>{left}<mo>=</mo>{inner}</mrow>", display=True)


def step_of(step: Mapping[str, Any], names: Names, matrices: list[Matrix]) -> Step:
    """The sentence with its formulas set, and what is shown below it."""
    parts = step.get("parts", ())
    sentence = sentence_of(step["text"], parts, names)
    below = [_part(part, names) for part in parts if part["kind"] == "display"]
    shown = Markup(" ").join(Markup('<span class="part">{}</span>').format(part) for part in below)
    uses = [use for part in parts for use in part.get("uses", ())]
    used = [matrix for matrix in matrices if matrix.key in uses]
    return Step(sentence, shown or None, used, any(tag in sentence for tag in UNBREAKABLE), terms_of(uses))


def sentence_of(text: str, parts: Sequence[Mapping[str, Any]], names: Names) -> Markup:
    """A sentence with its formulas set; results of older versions have no parts, and show words only."""
    said = [part for part in parts if part["kind"] in ("text", "formula")] or [{"kind": "text", "text": text}]
    return Markup("").join(_part(part, names) for part in said)


def _part(part: Mapping[str, Any], names: Names) -> Markup:
    if part["kind"] == "text":
        return escape(part["text"])
    mathml = part.get("mathml")
    return typesetting.math(typesetting.spaced(mathml)) if mathml else typesetting.formula(part["text"], names)


def said_once(steps: Sequence[Step]) -> list[Step]:
    """Links to matrices and words occur at the first step that uses them."""
    seen: set[str] = set()
    found = []
    for step in steps:
        matrices = [matrix for matrix in step.matrices if matrix.anchor not in seen]
        terms = tuple(term for term in step.terms if term.key not in seen)
        seen |= {matrix.anchor for matrix in matrices} | {term.key for term in terms}
        found.append(replace(step, matrices=matrices, terms=terms))
    return found
