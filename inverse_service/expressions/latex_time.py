r"""The {\left(t \right)} that computer algebra writes after everything that depends on time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from inverse_service.expressions.latex_scanner import Raw
from inverse_service.expressions.names import Names, Role
from inverse_service.expressions.tokens import Token

_TIME_ARGUMENT = ["{", "left", "(", "t", "right", ")", "}"]


def time_argument(pieces: Sequence[Raw]) -> int:
    r"""How many pieces {\left(t \right)} takes where it comes first, else 0."""
    length = len(_TIME_ARGUMENT)
    return length if [piece.text for piece in pieces[:length]] == _TIME_ARGUMENT else 0


def open_brackets(tokens: Sequence[Token]) -> int:
    """How many brackets are opened and not closed."""
    return sum(token.is_operator("(") - token.is_operator(")") for token in tokens)


def role_before(tokens: Sequence[Token], names: Names) -> Role | None:
    """What the name was declared as that came last, in x as in x' and x^{2}; None for anything else."""
    place = _before_power(tokens)
    while place >= 0 and tokens[place].kind == "prime":
        place -= 1
    return names.role(names.spelling(tokens[place].text)) if place >= 0 else None


def _before_power(tokens: Sequence[Token]) -> int:
    """The place of the token before ^( … ), where this came last."""
    last = len(tokens) - 1
    if last < 0 or not tokens[last].is_operator(")"):
        return last
    balances = itertools.accumulate(open_brackets([token]) for token in reversed(tokens))
    opening = next((last - back for back, balance in enumerate(balances) if balance == 0), 0)
    return opening - 2 if opening > 0 and tokens[opening - 1].is_operator("^") else -1
