r"""Letters that look or sound alike: \phi and \varphi, \theta and \vartheta, l and \ell.

A document that uses one of the two means the name that it declares; one that uses both means two
names and has to declare both.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from inverse_service.errors import InputError
from inverse_service.expressions.characters import ALIKE, GREEK, SCRIPT_L

_WORD = re.compile(r"\\?[A-Za-z]+|[^\x00-\x7f]")


def refuse_two_spellings(texts: Mapping[str, str], declared: tuple[str, ...] = ()) -> None:
    """InputError where the texts, given by their pointers, use two letters that would be read as one name."""
    seen: dict[str, str] = {}
    for pointer, text in texts.items():
        for found in _WORD.finditer(text):
            spelling = _spelling(found.group(), "\\" in text)
            name = ALIKE.get(spelling, spelling)
            both = {variant for variant, plain in ALIKE.items() if plain == name} & set(declared) and name in declared
            if name not in ALIKE.values() or both:
                continue
            if seen.setdefault(name, spelling) != spelling:
                first, second = sorted((seen[name], spelling), key=len)
                detail = f"{first} and {second} both occur and look alike: "
                instead = f"write the same letter, or declare both names, {first} and {second}."
                raise InputError(detail + instead, pointer, found.start() + 1)


def _spelling(word: str, latex: bool) -> str:
    """The command or letter as its name; in LaTeX a run of letters holds an l where one is in it."""
    if word == SCRIPT_L:
        return "ell"
    if latex and not word.startswith("\\"):
        return "l" if "l" in word else word
    return GREEK.get(word, word.removeprefix("\\"))
