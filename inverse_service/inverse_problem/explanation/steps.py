"""Steps of an explanation, put together from words and formulas.

Letters of the theory that a system has for names of its own: said once, before anything is explained.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from inverse_service.expressions.notation import Formula, formula_of
from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.outcome import Answer, Part, Step
from inverse_service.mechanics.second_order_system import SecondOrderSystem

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


_MEANING = {
    "g": "the multiplier, the Hessian of L in the velocities",
    "L": "the Lagrangian",
    "H": "the Hamiltonian",
    "N": "the matrix -1/2 df/dv",
    "Phi": "the matrix of the first conditions",
    "R": "the curvature in the conditions",
    "Gamma": "the derivative along the motion",
    "f": "the right-hand sides",
    "p": "the momenta",
    "v": "the velocities",
    "u": "the exponent in g = e^u G",
    "G": "the matrix in g = e^u G",
    "T": "any of the matrices of the conditions",
    "L_0": "the Lagrangian without damping",
}


def with_shared_letters(answer: Answer, system: SecondOrderSystem) -> Answer:
    """The answer, its explanation begun with what each letter that has two meanings is in the sentences."""
    names = {*system.coordinates, *system.parameters, *(function.name for function in system.functions)}
    texts = " ".join(step.text for step in answer.explanation)
    shared = [name for name in _MEANING if name in names and _is_said(name, texts)]
    if not shared:
        return answer
    meanings = ", ".join(f"{name} is {_MEANING[name]}" for name in shared)
    also = "these names may also be those" if len(shared) > 1 else f"the name {shared[0]} may also be that"
    step = said(f"In the sentences below, {meanings}; inside their formulas {also} of the system.")
    return replace(answer, explanation=(step, *answer.explanation))


# R stands in many formulas as the radius of the system; as the curvature only in these words.
_CURVATURE = re.compile(r"\(R\)_|R\^[1-9j]|, R\)|the place of R\b|(?:nabla|components of|sums? of g) R\b|nabla\^\d R\b")


def _is_said(name: str, text: str) -> bool:
    if name == "R":
        return _CURVATURE.search(text) is not None
    return re.search(rf"(?<![\w']){re.escape(name)}(?![\w'])", text) is not None
