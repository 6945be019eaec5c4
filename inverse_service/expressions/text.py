"""Formulas in plain text.

Accepted: decimal numbers, read exactly (0.1 is 1/10); + - * / ^ and ** (right associative);
products without sign where nobody can misread them (2x, 2 sin x, m g); functions of
`vocabulary.py`, sin x and sin^2(x); x', x_dot, xdot, diff(x, t), Derivative(x, t) and the same
with two; declared functions A(r1), A'(r1), diff(A(r1), r1), B[1,0](x, y); Greek letters, raised
digits and typographic signs. Everything else is refused with its column. See `grammar.py`.
"""

from __future__ import annotations

from inverse_service.expressions import equations
from inverse_service.expressions.names import Names
from inverse_service.expressions.tokenizer import tokenize
from inverse_service.expressions.tree import Expression


def parse(text: str, names: Names) -> Expression:
    """The formula as a tree; InputError or LimitError with the column."""
    return equations.read_formula(tokenize(text), len(text) + 1, names)


def parse_equations(text: str, names: Names) -> list[tuple[Expression, Expression]]:
    """(left, right) of each equation of a text such as "x'' = -y'; y'' + y = 0" (no = means = 0)."""
    groups = equations.split(tokenize(text), len(text) + 1)
    return [equations.read_equation(group, names) for group in groups]
