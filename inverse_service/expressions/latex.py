r"""Formulas in LaTeX, translated to the tokens of the plain-text grammar with their columns kept.

Accepted: \frac \tfrac \dfrac \sqrt[n]{} \dot \ddot x' x^{\prime}, \frac{dx}{dt} and
\frac{d^2 x}{dt^2}, functions such as \sin and \operatorname{asinh}, \cdot \times \div, \left and
\right, subscripts, Greek letters, \mathrm and the like, & and \\ and the usual environments. As
in LaTeX, letters without a command are names of one letter unless the word is declared.
"""

from __future__ import annotations

from inverse_service.expressions import equations
from inverse_service.expressions.latex_scanner import scan
from inverse_service.expressions.latex_translator import LatexTranslator
from inverse_service.expressions.limits import LIMITS, Limits
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokens import Token
from inverse_service.expressions.tree import Expression


def parse(text: str, names: Names) -> Expression:
    """The formula as a tree; InputError or LimitError with the column."""
    return equations.read_formula(tokenize(text, names), len(text) + 1, names)


def parse_equations(text: str, names: Names) -> list[tuple[Expression, Expression]]:
    r"""(left, right) of each equation; \\ and ; and commas separate."""
    groups = equations.split(tokenize(text, names), len(text) + 1)
    return [equations.read_equation(group, names) for group in groups]


def tokenize(text: str, names: Names | None = None, limits: Limits = LIMITS) -> list[Token]:
    """The tokens of a LaTeX formula; without `names` every letter is a name of its own."""
    return LatexTranslator(scan(text, limits), names or Names(), limits).all()
