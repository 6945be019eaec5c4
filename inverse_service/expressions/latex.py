r"""Formulas in LaTeX, translated to the tokens of the plain-text grammar with their columns kept.

Accepted: \frac \tfrac \dfrac \sqrt[n]{} \dot \ddot x' x^{\prime}, \frac{dx}{dt} and
\frac{d^2 x}{dt^2}, functions such as \sin and \operatorname{asinh}, \cdot \times \div, \left and
\right, subscripts, Greek letters, \mathrm and the like, & and \\ and the usual environments. As
in LaTeX, letters without a command are names of one letter unless the word is declared.
"""

from __future__ import annotations

from inverse_service.expressions.latex_scanner import scan
from inverse_service.expressions.latex_translator import LatexTranslator
from inverse_service.expressions.limits import LIMITS, Limits
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokens import Token


def tokenize(text: str, names: Names | None = None, limits: Limits = LIMITS) -> list[Token]:
    """The tokens of a LaTeX formula; without `names` every letter is a name of its own."""
    return LatexTranslator(scan(text, limits), names or Names(), limits).all()
