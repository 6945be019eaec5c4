"""Steps of an explanation, put together from words and formulas."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.notation import Formula, formula_of
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.outcome import Part, Step

Piece = str | Formula | Expression


def said(*pieces: Piece, shown: Sequence[Piece] = (), about: Sequence[str] = ()) -> Step:
    """A sentence of words and formulas, and the formulas that are `shown` below it.

    In a text, what stands between grave accents is a formula in the notation of the theory. `about` names the words
    of the theory that the step relies on.
    """
    sentence = [part for piece in pieces for part in _parts(piece)]
    below = [_formula(formula_of(piece), "display") for piece in shown]
    if about:
        below.append(Part("about", "", uses=tuple(about)))
    relations = [part.latex for part in sentence if part.kind == "formula" and "=" in part.text]
    latex = [part.latex for part in below if part.latex] or relations[-1:]
    return Step("".join(part.text for part in sentence), r",\quad ".join(latex), (*sentence, *below))


def _parts(piece: Piece) -> list[Part]:
    if not isinstance(piece, str):
        return [_formula(formula_of(piece), "formula")]
    pieces = piece.split("`")
    return [
        _formula(formula_of(text), "formula") if k % 2 else Part("text", text) for k, text in enumerate(pieces) if text
    ]


def _formula(formula: Formula, kind: str) -> Part:
    return Part(kind, formula.text, formula.latex, "" if formula.reads_back else formula.mathml, formula.uses)


def enumerated(formulas: Sequence[Piece]) -> list[Piece]:
    """a, b and c."""
    found: list[Piece] = []
    for k, formula in enumerate(formulas):
        found += [" and " if k == len(formulas) - 1 else ", ", formula] if k else [formula]
    return found


def separated(formulas: Sequence[Piece], between: str = ", ") -> list[Piece]:
    """The formulas with the same words between them."""
    return [piece for k, formula in enumerate(formulas) for piece in ([between, formula] if k else [formula])]
