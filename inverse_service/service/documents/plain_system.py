"""Documents as programs write them, seen in microseconds to be readable.

Whoever asks without waiting for the answer is told at once of a document that cannot be read; to
read it takes two milliseconds of a process. For these documents nothing has to be told. All others
are read as before, so this file only has to be right where it says yes.
"""

import json
import re
from collections.abc import Collection
from typing import Any, Final

LONGEST: Final = 600
DEEPEST: Final = 20
KEYS: Final = frozenset({"coordinates", "equations", "parameters", "id", "name"})
# A letter, perhaps with a number, that has no other meaning: t is the time, e and i are numbers, d
# and D differentiate.
_NAME: Final = r"[abcf-hj-su-z](?:_?[0-9]{1,2})?"
# Where nothing is declared, these letters are read as parameters beside any coordinates.
_PARAMETERS: Final = frozenset("abcgkmw")
_IS_NAME: Final = re.compile(rf"{_NAME}\Z")
_TOKEN: Final = re.compile(
    rf"\s*(?:(?P<number>[0-9]{{1,15}}(?:\.[0-9]{{1,15}})?)|(?P<function>sin|cos|exp)\("
    rf"|(?P<name>{_NAME})(?![\w(])(?P<prime>'?)(?!')|(?P<power>\^\s*[2-9])(?![0-9.])|(?P<sign>[-+*/()]))"
)
_LINE: Final = re.compile(rf"\s*({_NAME})''\s*=([^=]*)\Z")


def is_readable(text: str) -> bool:
    """Whether the text of a document is surely a system of accelerations q'' = f(q, q')."""
    if len(text) > LONGEST:
        return False
    document: Any = json.loads(text)
    if not isinstance(document, dict) or not document.keys() <= KEYS:
        return False
    equations, declared = document.get("equations"), document.get("coordinates")
    parameters = document.get("parameters", [])
    if isinstance(equations, str) and declared is None and "parameters" not in document:
        lines = [_LINE.match(line) for line in equations.split(";")]
        read = [(line[1], line[2]) for line in lines if line is not None]
        names = {name for name, _ in read}
        return len(names) == len(lines) and _are_formulas(dict(read), names | _PARAMETERS)
    if not (
        isinstance(equations, dict) and isinstance(declared, list) and isinstance(parameters, list)
    ):
        return False
    known = [*declared, *parameters]
    if not all(isinstance(name, str) for name in known):
        return False
    is_plain = len({*known}) == len(known) and all(_IS_NAME.match(name) for name in known)
    return is_plain and {*declared} == equations.keys() and _are_formulas(equations, known)


def _are_formulas(equations: dict[str, Any], known: Collection[str]) -> bool:
    """Of these coordinates, in these names."""
    return bool(equations) and all(
        isinstance(formula, str) and _is_formula(formula, equations, known)
        for formula in equations.values()
    )


def _is_formula(text: str, coordinates: Collection[str], known: Collection[str]) -> bool:
    """Operands and signs by turns, brackets in pairs, divisors that are names or numbers but 0."""
    place, depth, wants, last = 0, 0, True, ""
    text = text.rstrip()
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            return False
        place, kind = found.end(), found.lastgroup
        if kind == "power":
            if wants or last == "number":
                return False
            last = "number"
        elif kind in ("number", "name", "prime"):
            name = found["name"]
            if not wants or (name is None and last == "/" and not float(found["number"])):
                return False
            if found["prime"] and name not in coordinates:
                return False
            if name is not None and name not in known:
                return False
            wants, last = False, "number" if name is None else "name"
        elif kind == "function" or found["sign"] == "(":
            if not wants or last == "/" or depth > DEEPEST:
                return False
            depth, last = depth + 1, "("
        elif found["sign"] == ")":
            if wants or not depth:
                return False
            depth, last = depth - 1, ")"
        elif wants:
            if found["sign"] != "-" or last not in ("", "("):
                return False
            last = "-"
        else:
            wants, last = True, found["sign"]
    return not wants and depth == 0
