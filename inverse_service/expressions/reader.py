r"""One entry for formulas in plain text and in LaTeX: a backslash or a brace means LaTeX."""

from __future__ import annotations

from inverse_service.expressions import equations, latex, text
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokenizer import tokenize
from inverse_service.expressions.tokens import Token
from inverse_service.expressions.tree import Expression


def is_latex(formula: str) -> bool:
    """Whether the formula is read as LaTeX."""
    return "\\" in formula or "{" in formula or "$" in formula


def read_formula(formula: str, names: Names) -> Expression:
    """The formula as a tree; InputError or LimitError with the column."""
    return latex.parse(formula, names) if is_latex(formula) else text.parse(formula, names)


def read_equations(formula: str, names: Names) -> list[tuple[Expression, Expression]]:
    """(left, right) of each equation; no = means = 0."""
    if is_latex(formula):
        return latex.parse_equations(formula, names)
    return text.parse_equations(formula, names)


def read_tokens(formula: str, names: Names | None = None) -> list[Token]:
    """The tokens alone, before any name is looked up."""
    return latex.tokenize(formula, names) if is_latex(formula) else tokenize(formula)


def split_equations(formula: str, names: Names) -> list[equations.EquationTokens]:
    """The equations as tokens, so that each can be refused by itself."""
    return equations.split(read_tokens(formula, names), len(formula) + 1)
