"""LaTeX source to raw tokens: commands, characters, numbers; wrappers and spacing dropped."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

from inverse_service.errors import InputError
from inverse_service.expressions.tokenizer import check_length
from inverse_service.expressions.tokens import (
    GREEK,
    LIMITS,
    OPERATORS,
    PRIMES,
    SCRIPT_L,
    SPACES,
    at_most,
    describe,
    refusal,
)

RawKind = Literal["command", "letter", "digit", "character", "condition", "end"]
_ROW_SPACE = re.compile(r"\s*\[\s*-?[0-9.]+\s*(pt|pc|em|ex|mm|cm|in|jot|\\jot)\s*\]")
_MARKS = re.compile(r"\\(?:nonumber|notag)(?![A-Za-z])|\\(?:label|tag\*?)\s*\{[^{}]*\}")
_COMMAND = re.compile(r"\\(operatorname\*|[A-Za-z]+|.)", re.DOTALL)
_ENVIRONMENT = re.compile(r"\{\s*([a-z]+)\*?\s*\}(\s*\{[lcr| ]*\})?")
_ENVIRONMENTS = frozenset(
    ("align", "aligned", "alignat", "array", "cases", "dcases", "equation", "gather", "gathered", "split", "eqnarray")
)
_SPACING = frozenset([",", ";", ":", "!", " ", "quad", "qquad", "displaystyle", "textstyle", "limits", "\n"])
_SIZES = frozenset(size + side for size in ("big", "Big", "bigg", "Bigg") for side in ("", "l", "r"))
_WRAPPERS = (("$$", "$$"), ("$", "$"), (r"\[", r"\]"), (r"\(", r"\)"))
_PLAIN = frozenset("+-*/^_(){}[]=,;&|.")
_LOOKED_AHEAD = 8  # end marks, so that no reader looks past the last


@dataclass(frozen=True, slots=True)
class Raw:
    """One piece of LaTeX; `text` of a command is its name without the backslash, of a condition that in our grammar."""

    kind: RawKind
    text: str
    column: int
    space_before: bool = False

    def is_character(self, *texts: str) -> bool:
        return self.kind == "character" and self.text in texts

    def is_command(self, *texts: str) -> bool:
        return self.kind == "command" and self.text in texts


def scan(text: str) -> list[Raw]:
    """The raw tokens, ended by those of kind "end"; InputError for a character that has no meaning."""
    check_length(text)
    place, stop = _inside_wrappers(text)
    pieces: list[Raw] = []
    space = False
    piece: Raw | None
    ends, pieces_of_cases = line_ends(text, place, stop), _conditions(text)
    while place < stop:
        if place in pieces_of_cases:
            piece, place = pieces_of_cases[place]
        elif place in ends:
            piece, place = Raw("command", "\\", place + 1), place + 1
        else:
            piece, place = _piece(text, place, space)
        space = piece is None
        if piece:
            pieces.append(piece)
            at_most(len(pieces), LIMITS.tokens, "the formula has too many parts", pieces[-1].column)
    end = Raw("end", "", stop + 1)
    return [*_with_single_braces(_with_fractions(pieces)), *[end] * _LOOKED_AHEAD]


def _with_fractions(pieces: list[Raw]) -> list[Raw]:
    """{a \\over b} as \\frac{a}{b}."""
    openings: list[int] = []
    found: list[Raw] = []
    for piece in pieces:
        if piece.is_command("over") and openings and not found[openings[-1] - 1].is_command("frac", "over"):
            start = openings[-1]
            found.insert(start, replace(found[start], kind="command", text="frac"))
            openings[-1] += 1
            found += [replace(piece, kind="character", text="}"), replace(piece, kind="character", text="{")]
            continue
        if piece.is_character("{"):
            openings.append(len(found))
        elif piece.is_character("}") and openings:
            openings.pop()
        found.append(piece)
    return found


def _with_single_braces(pieces: list[Raw]) -> list[Raw]:
    r"""{\rm d} as \mathrm{d}, _{{1}} as _{1}, \frac{{a}}{{b}} as \frac{a}{b}: what Maple and Maxima print."""
    closing: dict[int, int] = {}
    opened: list[int] = []
    for place, piece in enumerate(pieces):
        if piece.is_character("{"):
            opened.append(place)
        elif piece.is_character("}") and opened:
            closing[opened.pop()] = place
    found: dict[int, Raw] = dict(enumerate(pieces))
    for place, end in closing.items():
        argument = place and (pieces[place - 1].is_character("_", "}") or pieces[place - 1].is_command("frac"))
        if argument and closing.get(place + 1) == end - 1 and not pieces[place + 2].is_command("rm"):
            del found[place + 1], found[end - 1]
        if pieces[place + 1].is_command("rm"):
            found[place], found[place + 1] = replace(pieces[place + 1], text="mathrm"), pieces[place]
            found[place + 2] = replace(pieces[place + 2], space_before=False)
    return [found[place] for place in sorted(found)]


def _inside_wrappers(text: str) -> tuple[int, int]:
    """(start, stop) of the formula inside $ $ or \\[ \\]."""
    start, stop = 0, len(text)
    for opening, closing in _WRAPPERS:
        inner = text[start:stop]
        lead, tail = len(inner) - len(inner.lstrip()), len(inner) - len(inner.rstrip())
        inner = inner.strip()
        if inner.startswith(opening) and inner.endswith(closing) and len(inner) >= len(opening + closing):
            return start + lead + len(opening), stop - tail - len(closing)
    return start, stop


def _piece(text: str, place: int, space: bool) -> tuple[Raw | None, int]:
    """The piece that begins at `place`, None for spacing, and the place after it."""
    character, column = text[place], place + 1
    if character == "\\":
        return _command(text, place, space)
    if character in SPACES or character in "\n~&":
        return None, place + 1
    if character in GREEK:
        return Raw("command", GREEK[character], column, space), place + 1
    if character == SCRIPT_L:
        return Raw("command", "ell", column, space), place + 1
    if character in PRIMES:
        return Raw("character", "'" * PRIMES[character], column, space), place + 1
    if character.isascii() and character.isalpha():
        return Raw("letter", character, column, space), place + 1
    if character.isascii() and character.isdigit():
        return Raw("digit", character, column, space), place + 1
    character = OPERATORS.get(character, character)
    if character in _PLAIN:
        return Raw("character", character, column, space), place + 1
    raise _not_accepted(text[place], column)


def _not_accepted(character: str, column: int) -> InputError:
    reasons = {
        "!": "factorials are not accepted, write the number",
        "<": "comparisons are not accepted, write an equation with =",
        ">": "comparisons are not accepted, write an equation with =",
        "$": "write $ only around the whole formula",
    }
    instead = reasons.get(character, "use letters, digits, + - * / ^ ( ) , = ' and LaTeX commands")
    return refusal(f"the character {describe(character)} is not accepted", column, instead)


def _command(text: str, place: int, space: bool) -> tuple[Raw | None, int]:
    if mark := _MARKS.match(text, place):
        return None, mark.end()
    match = _COMMAND.match(text, place)
    if match is None:
        raise refusal("a backslash stands by itself", place + 1, "write a command such as \\dot{x}")
    name, end = match.group(1), match.end()
    if name in _SPACING or name in _SIZES:
        return None, end
    if name in ("begin", "end"):
        return None, _environment(text, place, end)
    if name == "\\" and (height := _ROW_SPACE.match(text, end)):
        end = height.end()
    return Raw("command", name, place + 1, space), end


def _environment(text: str, place: int, end: int) -> int:
    match = _ENVIRONMENT.match(text, end)
    if match is None or match.group(1) not in _ENVIRONMENTS:
        raise refusal("this environment is not accepted", place + 1, "write aligned or cases, or the equations alone")
    return match.end()


# \begin{cases} -x & x > 0 \\ x & \text{otherwise} \end{cases} is one formula where no equation is in it.
_COLUMNS = r"(?:\s*\{[lcr@{}| ]*\})?"
_CASES = re.compile(rf"\\begin\s*\{{(d?cases|array)\}}{_COLUMNS}((?:(?!\\begin).)*?)\\end\s*\{{\1\}}", re.DOTALL)
_EQUATION = re.compile(r"(?<![<>!=])=(?!=)")
_WORD_IN_CASES = r"\\(?:text|textrm|mathrm|mbox)\s*\{\s*"
_CONDITIONS = {
    "piecewise": r"\\begin\s*\{\w+\}" + _COLUMNS,
    ")": r"[,.;]?\s*(?:\\\\\s*)?\\end\s*\{\w+\}",
    ";": r"[,.;]?\s*\\\\(?:\s*\[[^]]*\])?",
    ",": r",?\s*&",
    "": _WORD_IN_CASES + r"(?:if|for|when|where)?\s*\}",
    "true": _WORD_IN_CASES + r"(?:otherwise|else)\s*\}",
    "and": rf"\\(?:land|wedge)(?![a-z])|{_WORD_IN_CASES}and\s*\}}",
    "or": rf"\\(?:lor|vee)(?![a-z])|{_WORD_IN_CASES}or\s*\}}",
    "<": r"<=?|\\(?:leqslant|leq|le|lt)(?![a-z])|\u2264",
    ">": r">=?|\\(?:geqslant|geq|ge|gt)(?![a-z])|\u2265",
}
_CONDITION = re.compile("|".join(f"({pattern})" for pattern in _CONDITIONS.values()))


def _conditions(text: str) -> dict[int, tuple[Raw | None, int]]:
    """By their places the marks of piecewise formulas in the words of the plain grammar, and the places after them."""
    found: dict[int, tuple[Raw | None, int]] = {}
    for cases in _CASES.finditer(text):
        marks = [(mark, [*_CONDITIONS][(mark.lastindex or 1) - 1])
                 for mark in _CONDITION.finditer(text, cases.start(), cases.end())]  # fmt: skip
        compares = {"<", ">"} & {word for _, word in marks}
        for mark, word in marks if compares and not _EQUATION.search(cases[2]) else ():
            found[mark.start()] = Raw("condition", word, mark.start() + 1, True) if word else None, mark.end()
    return found


_SEPARATOR = re.compile(r"\\\\|;")
_ESCAPED = re.compile(r"\\[{}]")
_EXPECTS_MORE = ("+", "-", "*", "/", "^", "_", "=", ",", "&", "(", "[", "{")
_GOES_ON = ("+", "*", "/", "^", "_", "=", ",", "&", ")", "]", "}")


def line_ends(text: str, start: int, stop: int) -> frozenset[int]:
    """The places of the line ends between two equations: an = on either side, no bracket open, no sign in the air."""
    ends: list[int] = []
    equals, open_now, last, place = False, (0, 0, 0), "", start - 1
    for line in text[start:stop].split("\n"):
        first = _SEPARATOR.split(line, maxsplit=1)[0].strip()
        complete = equals and open_now == (0, 0, 0) and not last.endswith(_EXPECTS_MORE)
        if complete and "=" in first and not first.startswith(_GOES_ON):
            ends.append(place)
            equals, open_now, last = False, (0, 0, 0), ""
        *earlier, rest = _SEPARATOR.split(line)
        if earlier:
            equals, open_now, last = False, (0, 0, 0), ""
        equals = equals or "=" in rest
        open_now = _opened(rest, open_now)
        last = rest.strip() or last
        place += len(line) + 1
    return frozenset(ends)


def _opened(part: str, before: tuple[int, int, int]) -> tuple[int, int, int]:
    """How many { ( [ are open after the part."""
    plain = _ESCAPED.sub("", part)
    braces, round_ones, square = (plain.count(a) - plain.count(b) for a, b in ("{}", "()", "[]"))
    return before[0] + braces, before[1] + round_ones, before[2] + square
