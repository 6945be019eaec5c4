"""Names exchanged in formulas: the time tau as t, a coordinate t as another letter, and back.

Each name of a formula is found with its span, in plain text, LaTeX, and MathML, and what is read in
its place is put there; a text that a user typed knows afterwards where each character was typed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import groupby
from typing import Any, NamedTuple

from inverse_service.expressions import letters, printing
from inverse_service.reading import names as nm, reader, signs
from inverse_service.reading.signs import Line, Sign
from inverse_service.reading.typed_text import Change, Typed

# A name of several letters stands in \mathrm{...}; other letters side by side are one name each.
_UPRIGHT = ("\\mathrm", "\\mathit", "\\operatorname", "\\text")
_BEFORE_A_NAME = ("d2", "d3", "d4", "d5", "d6", "d7", "d8", "d9", "d")  # of d2x/dt2
_DOTS = ("dot", "_dot", "ddot", "_ddot", "dotdot", "_dotdot", "dot_dot", "_dot_dot")
_BEHIND_A_NAME: tuple[str, ...] = ("", *"23456789", *_DOTS)
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


class Name(NamedTuple):
    """A name of a plain text with its span."""

    text: str
    start: int
    stop: int


def plain_names(text: str) -> Iterator[Name]:
    """The names of a plain text, in which a Greek letter or another sign ends one."""
    for sign in signs.with_whole_names(text):
        if sign.is_name() and sign.text.isascii():
            yield Name(*sign[:3])
            continue
        for start, run in _runs(sign.text, _is_of_name):
            name = run.lstrip("0123456789_")  # t of 2t
            first = sign.start + start + len(run) - len(name)
            if name:
                yield Name(name, first, first + len(name))


def _runs(text: str, belongs: Callable[[str], bool]) -> Iterator[tuple[int, str]]:
    """Each longest run of characters that belong together, with its place."""
    place = 0
    for is_run, run in groupby(text, belongs):
        found = "".join(run)
        if is_run:
            yield place, found
        place += len(found)


def _is_of_name(character: str) -> bool:
    return (character.isascii() and (character.isalnum() or character == "_")) or (
        character in letters.SUBSCRIPTS and character.isdigit()
    )


def _in_plain(text: str, table: Mapping[str, str]) -> Iterator[Change]:
    for name in plain_names(text):
        if new := _exchanged(name.text, table):
            yield Change(name.start, name.stop, new)
    for place, character in enumerate(text):
        if (name_of := letters.GREEK.get(character, "")) in table:
            yield Change(place, place + 1, table[name_of])


def _exchanged(word: str, table: Mapping[str, str]) -> str:
    """x2 for t2, dx for dt, k_x for k_t, and x_ddot for t_ddot; no text for another name."""
    for name, new in table.items():
        for end in _BEHIND_A_NAME if name and name in word else ():
            before = word[: len(word) - len(name + end)]
            if word == before + name + end and _may_precede(before):
                return before + new + end
    return ""


def _may_precede(before: str) -> bool:
    return before in ("", *_BEFORE_A_NAME) or (before[:1].isalpha() and before.endswith("_"))


def _in_latex(text: str, table: Mapping[str, str]) -> Iterator[Change]:
    line = signs.of(text)
    place = 0
    while place < len(line):
        sign, upright = line[place], _upright_at(line, place)
        below = _is_index(line, place)
        if upright is not None:
            name, has_index = upright.text, not below and _has_index(line, place + 4)
            if name in table and not has_index:
                yield Change(sign.start, line[place + 3].stop, _spelled(table[name]))
            elif name[0] == "d" and name[1:] in table and not below:  # \mathrm{dt}
                yield Change(upright.start + 1, upright.stop, _spelled(table[name[1:]]))
            place += 4
            continue
        if sign.text[:1] == "\\":
            name = sign.text[1:]
            if name and name in table and (below or not _has_index(line, place + 1)):
                new = _spelled(table[name])
                apart = text[max(0, sign.start - 1) : sign.start].isalpha() and new[0].isalpha()
                yield Change(sign.start, sign.stop, f" {new}" if apart else new)  # \cos\phi
        else:
            yield from _in_run(line, place, below, table)
        place += 1


def _in_run(line: Line, place: int, below: bool, table: Mapping[str, str]) -> Iterator[Change]:
    """The names in a run of letters of LaTeX."""
    sign = line[place]
    for begun, word in _runs(sign.text, _is_of_word):
        start = sign.start + begun
        is_last = start + len(word) == sign.stop
        is_below = below and start == sign.start
        if is_below and word not in table:
            continue
        if word in nm.FUNCTIONS or (len(word) > 2 and word in letters.LETTER_COMMANDS):
            if word in table:
                yield Change(start, start + len(word), _spelled(table[word]))
            continue
        has_index = is_last and not is_below and _has_index(line, place + 1)
        for k, letter in enumerate(word):
            if letter in table and not (has_index and k == len(word) - 1):
                yield Change(start + k, start + k + 1, _spelled(table[letter]))


def _is_of_word(character: str) -> bool:
    return character.isascii() and character.isalpha()


def _upright_at(line: Line, place: int) -> Sign | None:
    r"""The name in the \mathrm{max} that is here, of two letters or more."""
    name = line.at(place + 2)
    is_word = name.text.isascii() and name.text.isalpha() and len(name.text) > 1
    is_upright = line[place].text in _UPRIGHT and is_word
    return name if is_upright and line.says(place + 1, "{", name.text, "}") else None


def _is_index(line: Line, place: int) -> bool:
    """Whether the sign here is, or begins, an index: behind _ or _{."""
    braced = line[place].glued and line.says(place - 1, "{")
    last = line.at(place - braced)
    return last.glued and line.says(place - braced - 1, "_")


def _has_index(line: Line, place: int) -> bool:
    """Whether an index begins here: t_{max} is another name than t, but t_{2} may be t2, in which
    the letter is exchanged (`_exchanged`).
    """
    after = place + 1 + (line.says(place + 1, "{") and line.at(place + 1).glued)
    number, end = line.at(after), line.at(after + 1)
    is_number = number.glued and number.text in [*"23456789"]
    glued = end.glued and end.text[:1].isascii() and end.text[:1].isalnum()
    return line.says(place, "_") and not (is_number and not glued)


def _spelled(name: str) -> str:
    """The name in LaTeX, kept apart from letters after a command."""
    found = printing.name_latex(name)
    return found + " " if found.startswith("\\") else found


def _in_mathml(text: str, table: Mapping[str, str]) -> str:
    """The names between <mi> and </mi>, but for those with an index that is no number of one
    digit.
    """
    names = {
        printing.displayed_name(name): printing.displayed_name(new)
        for name, new in table.items()
        if name
    }
    parts = text.split("<")  # each a tag, and the text behind it
    for place, part in enumerate(parts):
        tag, _, name = part.partition(">")
        after = [*parts[place + 1 : place + 7], ""]
        if tag != "mi" or name not in names or not after[0].startswith("/mi>"):
            continue
        number = after[2].removeprefix("mn>") if len(after) == 7 else ""
        numbered = ["/mi>", "mrow>", f"mn>{number}", "/mn>", "/mrow>"]
        is_short = number in [*"23456789"] and after[:5] == numbered
        is_short = is_short and after[5].startswith("/msub>")
        if parts[place - 1] != "msub>" or is_short:
            parts[place] = f"mi>{names[name]}"
    return "<".join(parts)


def _put(text: str, changed: Iterator[Change]) -> str:
    found, end = "", 0
    for start, stop, new in sorted(changed, key=lambda change: change.start):
        found, end = f"{found}{text[end:start]}{new}", stop
    return found + text[end:]
