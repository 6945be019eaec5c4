r"""One entry for formulas in plain text and in LaTeX: a backslash or a brace means LaTeX."""

from __future__ import annotations

import re

from inverse_service.expressions import equations
from inverse_service.expressions.names import Names
from inverse_service.expressions.notations import in_our_words
from inverse_service.expressions.tokenizer import tokenize
from inverse_service.expressions.tokens import Token, refuse_decimal_commas
from inverse_service.expressions.tree import ZERO, Expression, subtract

_GREEK_OF_MATHEMATICA = re.compile(r"\\\[(?:Curly)?(?:Capital)?([A-Z][a-z]+)\]")
_MATHEMATICA = re.compile(r"[A-Za-z']\[|==")


def is_latex(formula: str) -> bool:
    """Whether the formula is read as LaTeX."""
    braces = "{" in formula and not _MATHEMATICA.search(formula)
    return "\\" in formula or braces or formula.lstrip().startswith("$")


def read_formula(formula: str, names: Names) -> Expression:
    """The formula as a tree; InputError or LimitError with the column."""
    return equations.read_formula(read_tokens(formula, names), len(formula) + 1, names)


def read_condition(condition: str, names: Names) -> Expression:
    """A - B of A > B and of A != B, B - A of A < B: positive, or not 0, where the condition of an answer holds."""
    left, sign, right = re.split(r" (!=|>|<) ", condition)
    sides = [read_formula(side, names) for side in ((right, left) if sign == "<" else (left, right))]
    return sides[0] if sides[1] == ZERO else subtract(*sides)


def read_equations(formula: str, names: Names) -> list[tuple[Expression, Expression]]:
    """(left, right) of each equation; no = means = 0."""
    return [equations.read_equation(group, names) for group in split_equations(formula, names)]


def read_tokens(formula: str, names: Names | None = None) -> list[Token]:
    """The tokens alone, before any name is looked up."""
    formula = _GREEK_OF_MATHEMATICA.sub(_greek, formula)
    names = names or Names()
    if is_latex(formula):
        from inverse_service.expressions import latex_translator

        tokens = latex_translator.tokenize(formula, names)
    else:
        tokens = in_our_words(tokenize(formula), names)
    refuse_decimal_commas(tokens)
    return tokens


def _greek(match: re.Match[str]) -> str:
    """Mathematica's \\[Theta] as a name of the same length, so that columns hold."""
    name = match[1] if "Capital" in match[0] else match[1].lower()
    return f"{'var' * ('Curly' in match[0])}{name}".ljust(len(match[0]))


def split_equations(formula: str, names: Names) -> list[equations.EquationTokens]:
    """The equations as tokens, so that each can be refused by itself."""
    return equations.split(read_tokens(formula, names), len(formula) + 1)
