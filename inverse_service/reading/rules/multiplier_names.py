"""Names of multipliers of constraints: lambda, mu, and Lambda, with or without an index."""

from __future__ import annotations

from inverse_service.reading import signs

MULTIPLIERS = ("lambda", "mu", "Lambda")
_LAMBDAS = ("lambda", "Lambda", "\u03bb", "\u03bc", "\u039b")


def place_of_multiplier(text: str) -> int | None:
    """The place of the first lambda, Lambda, or mu of a text."""
    for sign in signs.with_whole_names(text):
        for name in _LAMBDAS:
            if name in sign.text:
                return sign.start + sign.text.index(name)
        if sign.text.lstrip("\\").startswith("mu"):
            return sign.start
    return None
