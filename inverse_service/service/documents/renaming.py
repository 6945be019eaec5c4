"""Names exchanged in formulas: the time tau as t, a coordinate t as another letter, and back.

Each name of a formula is found with its span, in plain text, LaTeX, and MathML, and what is read in
its place is put there; a text that a user typed knows afterwards where each character was typed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from inverse_service.expressions import letters, printing
from inverse_service.reading import names as nm, reader
from inverse_service.reading.typed_text import Change, Typed

PLAIN_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_\u2080-\u2089]*")
# A name of several letters stands in \mathrm{...}; other letters side by side are one name each.
_LATEX_WORD = re.compile(
    r"(_\{?)?(\\(?:mathrm|mathit|operatorname|text)\s*\{\s*([A-Za-z]{2,})\s*\}|\\?[A-Za-z]+)"
)
# t_{max} is another name than t; t_{2} may be t2, in which the letter is exchanged (`_in_plain`).
_INDEX = re.compile(r"\s*_(?!\{?[2-9](?![0-9A-Za-z]))")
_MATHML_NAME = re.compile(
    r"((?<!<msub>)<mi>|<mi>(?=[^<]+</mi><mrow><mn>[2-9]</mn></mrow></msub>))([^<]+)(?=</mi>)"
)
# Not for people, or not ours to change.
KEPT = frozenset(
    ("certificate", "provenance", "given", "format", "question", "id", "kind", "time", "verdict")
)
_STRUCTURE = frozenset(("text", "latex"))


def with_names(value: Any, table: Mapping[str, str], latex: bool = False) -> Any:
    """The value with the names of the table exchanged in every text and key."""
    if isinstance(value, str):
        if value.startswith("<math"):
            return _in_mathml(value, table)
        return _put(value, changes(value, table, latex or reader.is_latex(value)))
    if isinstance(value, Mapping):
        return {
            key if key in _STRUCTURE else in_plain_text(key, table): part
            if key in KEPT
            else ""  # s is that of the symmetry x -> x + s
            if key == "symmetry" and "s" in table.values()
            else with_names(part, table, latex or key == "latex")
            for key, part in value.items()
        }
    if isinstance(value, list | tuple):
        return [with_names(part, table, latex) for part in value]
    return value


def typed_with_names(
    value: Any, pointer: str, table: Mapping[str, str], places: dict[str, Typed]
) -> Any:
    """The same for a part of a document; `places` says by the new pointers where each text was
    typed.
    """
    if isinstance(value, str):
        typed = places.get(pointer) or Typed.of(value, pointer)
        typed = typed if typed.text == value else Typed.of(value, pointer)
        places[pointer] = typed.put(changes(value, table, reader.is_latex(value)))
        return places[pointer].text
    if isinstance(value, Mapping):
        found = {}
        for key, part in value.items():
            name = in_plain_text(key, table)
            at, old = (f"{pointer}/{nm.escaped(one)}" for one in (name, key))
            if old in places and at != old:
                places[at] = places.pop(old)
            elif isinstance(part, str) and old not in places:
                places[at] = Typed.of(part, old)
            found[name] = typed_with_names(part, at, table, places)
        return found
    if isinstance(value, list | tuple):
        return [
            typed_with_names(part, f"{pointer}/{place}", table, places)
            for place, part in enumerate(value)
        ]
    return value


def in_plain_text(text: str, table: Mapping[str, str]) -> str:
    """A plain text, or a name, with the names of the table exchanged."""
    return _put(text, changes(text, table, latex=False))


def changes(text: str, table: Mapping[str, str], latex: bool) -> Iterator[Change]:
    """Each name of the table in a formula with its span, and what is read there."""
    return (_in_latex if latex else _in_plain)(text, table)


def _in_plain(text: str, table: Mapping[str, str]) -> Iterator[Change]:
    names = "|".join(re.escape(name) for name in table if name)
    forms = re.compile(rf"(d[2-9]?|[A-Za-z]\w*_)?({names})([2-9]|(?:_?dot){{1,2}}|_?ddot)?")
    for word in PLAIN_WORD.finditer(text):
        if form := forms.fullmatch(word[0]):
            new = f"{form[1] or ''}{table[form[2]]}{form[3] or ''}"
            yield Change(*word.span(), new)
    for place, character in enumerate(text):
        if (name := letters.GREEK.get(character, "")) in table:
            yield Change(place, place + 1, table[name])


def _in_latex(text: str, table: Mapping[str, str]) -> Iterator[Change]:
    for found in _LATEX_WORD.finditer(text):
        below, word = found[1] or "", found[2]
        start, stop = found.span(2)
        name = found[3] if found[3] is not None else word.lstrip("\\")
        has_index = not below and bool(_INDEX.match(text, stop))
        if below and name not in table:
            continue
        if found[3] is not None:
            if name in table and not has_index:
                yield Change(start, stop, _spelled(table[name]))
            elif name[0] == "d" and name[1:] in table:  # the differential \mathrm{dt}
                yield Change(found.start(3) + 1, found.end(3), _spelled(table[name[1:]]))
        elif word.startswith("\\"):
            if name in table and not has_index:
                new = _spelled(table[name])
                apart = text[max(0, start - 1) : start].isalpha() and new[0].isalpha()  # \cos\phi
                yield Change(start, stop, f" {new}" if apart else new)
        elif word in nm.FUNCTIONS or (len(word) > 2 and word in letters.LETTER_COMMANDS):
            if word in table:
                yield Change(start, stop, _spelled(table[word]))
        else:
            for place, letter in enumerate(word, start):
                if letter in table and not (has_index and place == stop - 1):
                    yield Change(place, place + 1, _spelled(table[letter]))


def _spelled(name: str) -> str:
    """The name in LaTeX, kept apart from letters after a command."""
    found = printing.name_latex(name)
    return found + " " if found.startswith("\\") else found


def _in_mathml(text: str, table: Mapping[str, str]) -> str:
    names = {
        printing.displayed_name(name): printing.displayed_name(new)
        for name, new in table.items()
        if name
    }
    return _MATHML_NAME.sub(lambda found: f"{found[1]}{names.get(found[2], found[2])}", text)


def _put(text: str, changed: Iterator[Change]) -> str:
    found, end = "", 0
    for start, stop, new in sorted(changed, key=lambda change: change.start):
        found, end = f"{found}{text[end:start]}{new}", stop
    return found + text[end:]
