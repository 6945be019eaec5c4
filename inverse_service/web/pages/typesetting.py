"""Texts of results as typeset HTML: formulas, conditions, matrices, and the formulas inside sentences.

What cannot be read is shown as it is written; nothing is left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from inverse_service.errors import InputError
from inverse_service.expressions.names import Names
from inverse_service.expressions.printing_mathml import to_mathml
from inverse_service.expressions.reader import read_formula
from inverse_service.web.pages.latex_mathml import (
    UnknownLatex,
    latex_to_mathml,
    low_fences,
    matrix_mathml,
    pieces,
)

# Beyond this a formula is read as text, in a box that scrolls.
MAX_CHARACTERS = 4_000
# Symbols of an explanation; where a system has such a name of its own, that one is meant.
SYMBOLS = ("g", "T", "L", "H", "N", "p", "v", "Phi", "nablaPhi", "R")
ARTICLES = frozenset(("a", "A", "I"))
OPERATORS = frozenset(("+", "-", "="))
UNBROKEN = 48
SIGNS = {"-": "\u2212", "!=": "≠", ">=": "≥", "<=": "≤"}
RELATIONS = {"!=": "≠", ">": ">", "<": "<", ">=": "≥", "<=": "≤", "=": "="}
_RELATION = re.compile(r" (!=|>=|<=|=|>|<) ")
_MATRIX = re.compile(r"\[\[.*?\]\](?=\W|$)")
_CONDITION = re.compile(r"\((nabla(?:\^(\d))?)?(Phi|R)\)_(\d+)")
_NABLA = re.compile(r"\b(nabla(?:\^\d)?) (?=Phi|R)")
_POWER = re.compile(r"([(]*)nabla\^(\d)(Phi|R)([).,:;]*)")
_BARE = re.compile(r"([(]*)([A-Za-z0-9_']+)([).,:;]*)")
_COMPONENTS = re.compile(r"(The components of .+? that are not zero) \(row, column\): .*", re.DOTALL)
_MATHEMATICAL = re.compile(r"[*^/'=_\d()+]|^-")


def names_of(system: Mapping[str, Any] | None) -> Names:
    """The names of a result's system; momenta, entries of the multiplier and SYMBOLS read as parameters."""
    if system is None:
        return Names(parameters=SYMBOLS)
    coordinates = tuple(system["coordinates"])
    n = len(coordinates)
    entries = [f"{letter}_{i}{j}" for letter in "gh" for i in range(1, n + 1) for j in range(i, n + 1)]
    functions = {name: tuple(arguments) for name, arguments in system.get("functions", {}).items()}
    if "Gamma" not in coordinates and "Gamma" not in system["parameters"]:
        functions.setdefault("Gamma", ("g",))
    taken = {*coordinates, *functions}
    words = [*system["parameters"], *(f"p_{name}" for name in coordinates), *entries, *SYMBOLS]
    return Names(coordinates, tuple(dict.fromkeys(word for word in words if word not in taken)), functions)


def inner_mathml(text: str, names: Names) -> str | None:
    """The MathML of a formula without <math> around it, None where it cannot be read."""
    if len(text) > MAX_CHARACTERS:
        return None
    try:
        found = to_mathml(read_formula(text, names))
    except InputError:
        return None
    inner = found.partition(">")[2].removesuffix("</math>").replace("<mi>nablaPhi</mi>", "<mi>∇</mi><mi>Φ</mi>")
    return _spaced(inner)


def _spaced(mathml: str) -> str:
    return low_fences(mathml).replace("<mo>&#x2062;</mo>", THIN_TIMES)


# An invisible product sign with a little room, so that R sin x does not read Rsin x.
THIN_TIMES = '<mo lspace="0.08em" rspace="0.08em">&#x2062;</mo>'


def math(inner: str, display: bool = False) -> Markup:
    """A <math> element of our own MathML."""
    shown = ' display="block"' if display else ""
    return Markup(f"<math{shown}>{inner}</math>")


def formula(text: str, names: Names) -> Markup:
    """A formula or a relation such as "x' != 0"; a long one may be broken between its terms."""
    found = _breakable(text, names)
    return found if found is not None else code(text)


def equation(letter: str, text: str, names: Names) -> Markup:
    """A formula with "L =" in front."""
    found = _breakable(text, names)
    if found is None:
        return code(f"{letter} = {text}")
    return math(f"<mrow><mi>{letter}</mi><mo>=</mo></mrow>") + found


def _breakable(text: str, names: Names) -> Markup | None:
    """A short formula as one <math>; a long one with each term in its own, so that lines can end between them."""
    if len(text) <= UNBROKEN:
        found = _relation(text, names)
        return None if found is None else math(found)
    parts: list[Markup] = []
    for sign, term in _terms(text):
        inner = inner_mathml(term, names) if term else ""
        if inner is None:
            return None
        parts.append(math(f"<mrow>{_sign(sign)}{inner}</mrow>"))
    return Markup(" ").join(parts)


def _sign(sign: str) -> str:
    return f'<mo form="infix">{escape(sign)}</mo>' if sign else ""


def _terms(text: str) -> list[tuple[str, str]]:
    """(sign or relation, term) of a text as the printer writes it: signs with spaces, outside brackets."""
    found: list[tuple[str, str]] = []
    depth, start, sign = 0, 0, ""
    for match in re.finditer(r"[()]| (?:[-+=<>]|!=|>=|<=) ", text):
        token = match.group()
        depth += (token == "(") - (token == ")")
        if depth == 0 and len(token) > 1:
            found.append((sign, text[start : match.start()]))
            sign, start = SIGNS.get(token.strip(), token.strip()), match.end()
    return [*found, (sign, text[start:])]


def code(text: str) -> Markup:
    """A text that is not typeset."""
    return Markup("<code>{}</code>").format(text)


def _relation(text: str, names: Names) -> str | None:
    sides = _RELATION.split(text)
    parts: list[str] = []
    for place, side in enumerate(sides):
        found = f"<mo>{escape(RELATIONS[side])}</mo>" if place % 2 else inner_mathml(side, names)
        if found is None:
            return None
        parts.append(found)
    return f"<mrow>{''.join(parts)}</mrow>"


def parsed(mathml: str) -> Markup:
    """A formula that the service wrote as MathML."""
    return Markup(_spaced(mathml))


def latex(source: str) -> Markup:
    """A line of LaTeX, its parts free to stand on lines of their own; the source where it is unknown."""
    if len(source) > 4 * MAX_CHARACTERS:
        return code(source)
    try:
        parts = [latex_to_mathml(part) for part in pieces(source)]
    except UnknownLatex:
        return code(source)
    return Markup(" ".join(f'<span class="part">{part}</span>' for part in parts))


def matrix(rows: Sequence[Sequence[str]], names: Names) -> Markup:
    """A matrix of texts."""
    found = matrix_inner(rows, names)
    return math(found, display=True) if found is not None else code(str([list(row) for row in rows]))


def matrix_inner(rows: Sequence[Sequence[str]], names: Names) -> str | None:
    """The MathML of a matrix, None where an entry cannot be read."""
    entries = [[inner_mathml(entry, names) for entry in row] for row in rows]
    if any(entry is None for row in entries for entry in row):
        return None
    return matrix_mathml([[entry or "" for entry in row] for row in entries])


def sentence(text: str, names: Names) -> tuple[Markup, bool]:
    """A sentence with its formulas typeset, and whether an equation among them was.

    A run of words that reads as a formula is one; words that do not stay words.
    """
    text = _NABLA.sub(r"\1", text)
    # The list that follows is the step's formula, which has better indices.
    text = _COMPONENTS.sub(r"\1:", text)
    html: list[Markup | str] = []
    place, has_equation = 0, False
    for found in _MATRIX.finditer(text):
        inner = matrix_inner(_matrix_rows(found.group()), names)
        if inner is None:
            continue
        before, equation = _words(text[place : found.start()], names)
        html += [before, math(inner)]
        has_equation, place = True, found.end()
    rest, equation = _words(text[place:], names)
    return Markup("").join([*html, rest]), has_equation or equation


def _matrix_rows(text: str) -> list[list[str]]:
    rows = [row.strip("[] ") for row in text[1:-1].split("], [")]
    return [_split_entries(row) for row in rows]


def _split_entries(row: str) -> list[str]:
    entries, depth, start = [], 0, 0
    for place, character in enumerate(row):
        depth += (character == "(") - (character == ")")
        if character == "," and depth == 0:
            entries.append(row[start:place].strip())
            start = place + 1
    return [*entries, row[start:].strip()]


def _words(text: str, names: Names) -> tuple[Markup, bool]:
    """Prose with runs of mathematical words set as formulas."""
    html: list[Markup | str] = []
    run: list[str] = []
    has_equation = False

    def close_run() -> None:
        nonlocal has_equation
        if run:
            shown, equation = _run(run, names)
            html.append(shown)
            has_equation = has_equation or equation
            run.clear()

    for word in re.split(r"(?<=\S) ", text):
        if _is_mathematical(word, names) or _goes_on(run, word, names):
            run.append(word)
            if word.endswith((",", ".", ":", ";")):
                close_run()
        else:
            close_run()
            html.append(_single(word, names))
    close_run()
    return Markup(" ").join(html), has_equation


def _goes_on(run: list[str], word: str, names: Names) -> bool:
    """Whether a name that is also an article, such as a, stands behind an operator."""
    return bool(run) and run[-1] in OPERATORS and names.role(word.strip(".,:;()")) is not None


def _is_mathematical(word: str, names: Names) -> bool:
    bare = word.strip(".,:;()")
    return (names.role(bare) is not None and bare not in ARTICLES) or bool(_MATHEMATICAL.search(word))


def _run(words: list[str], names: Names) -> tuple[Markup, bool]:
    text = " ".join(words)
    stripped = text.rstrip(".,:;")
    if stripped.isdigit():
        return escape(text), False
    end = text[len(stripped) :]
    label = _CONDITION.fullmatch(stripped)
    if label:
        return Markup("{}{}").format(math(_condition(label)), end), False
    open_end = stripped.endswith(" =")
    found = _breakable(stripped.removesuffix(" ="), names)
    if found is None:
        return Markup(" ").join(_single(word, names) for word in words), False
    shown = found + math("<mo>=</mo>") if open_end else found
    # The mark after a formula stays with it.
    return Markup("{}{}").format(shown, end), " = " in stripped


def _single(word: str, names: Names) -> Markup:
    """A word by itself: a declared name is set as a symbol, brackets and marks around it stay."""
    tensor = _POWER.fullmatch(word)
    if tensor:
        return Markup("{}{}{}").format(tensor[1], math(_tensor("nabla", tensor[2], tensor[3])), tensor[4])
    match = _BARE.fullmatch(word)
    if match is None or names.role(match[2]) is None or match[2] in ARTICLES:
        return escape(word)
    return Markup("{}{}{}").format(match[1], math(inner_mathml(match[2], names) or ""), match[3])


def _condition(label: re.Match[str]) -> str:
    inner = low_fences(f"<mrow><mo>(</mo>{_tensor(label[1], label[2], label[3])}<mo>)</mo></mrow>")
    return f"<msub>{inner}<mn>{label[4]}</mn></msub>"


def _tensor(nabla: str | None, power: str | None, letter: str) -> str:
    symbol = "<mi>Φ</mi>" if letter == "Phi" else "<mi>R</mi>"
    if not nabla:
        return symbol
    before = f"<msup><mi>∇</mi><mn>{power}</mn></msup>" if power else "<mi>∇</mi>"
    return f"<mrow>{before}{symbol}</mrow>"


def latex_inner(source: str) -> str:
    """MathML of a short LaTeX text without <math> around it."""
    return latex_to_mathml(source).partition(">")[2].removesuffix("</math>")
