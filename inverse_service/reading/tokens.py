"""Tokens, token streams, and the conversion of plain text to tokens.

Every character is either accepted by a rule below or refused with its column.

Accepted: decimal numbers, read exactly (0.1 is 1/10); + - * / ^ and ** (right associative);
implicit products that cannot be misread (2x, 2 sin x, m g); functions of
`names.py`, sin x and sin^2(x); x', x_dot, xdot, diff(x, t), Derivative(x, t) and the same
with two; declared functions A(r1), A'(r1), diff(A(r1), r1), B[1,0](x, y); Greek letters, raised
digits and typographic signs. See `parser.py`.
"""

import itertools
import re
import unicodedata
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from inverse_service.errors import InputError
from inverse_service.expressions import letters, refusals
from inverse_service.reading import cuts as left
from inverse_service.reading.cuts import Cut
from inverse_service.reading.names import Reason, letter, meanings, pattern, reasons

Kind = Literal[
    "number",
    "name",
    "prime",
    "operator",
    "bracket",
    "newline",
    "end",
    "vector",
    "command",
    "fault",
    "index",
]
FACTOR, FRACTION, MATRIX, CASES = map(Fraction, range(1, 5))
DOT, CROSS = Fraction(1), Fraction(2)
GIVEN, EQUALITY = Fraction(1), Fraction(2)
_EQUALS = {":=": GIVEN, "==": EQUALITY, "~": EQUALITY}
PARTIAL, TOTAL, NABLA = "\u2202", "\u2146", "\u2207"  # TOTAL: the upright d of a derivative
CLOSING = {"(": ")", "[": "]", "{": "}"}
_OPENING = {closing: opening for opening, closing in CLOSING.items()}
_EXPECTS_MORE = ("+", "-", "*", "/", "^", "_", "=", ",", "&")
_GOES_ON = ("+", "*", "/", "^", "_", "=", ",", "&")
# Words that join an equation, or a condition, to the text before it.
SUM = "\u2211"
JOINING, CONDITIONAL = (
    ("where", "with", "given", "and", "so", "thus", "hence", "therefore", "but"),
    ("for", "if", "when"),
)
END = "an operator or the end"
NUMBER = re.compile(r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GROUPED = re.compile(
    r"[0-9]+(?:_[0-9]+)+|[0-9]{1,3}(?:['\u2019][0-9]{3})+(?![0-9])"
)  # 1_000, 1'000
_THOUSANDS = re.compile(r"[0-9]{1,3}(?:\.[0-9]{3})+")
_OTHER_BASE = re.compile(r"0[xX][0-9A-Fa-f]+\b|0[bB][01]+\b|0[oO][0-7]+\b")
_ASCII_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SUPERSCRIPTS = letters.SUPERSCRIPTS | {letters.SUPERSCRIPT_MINUS: "-", "\u207f": "n"}
_RAISED = re.compile(rf"\u207f|{letters.SUPERSCRIPT_MINUS}?[{''.join(letters.SUPERSCRIPTS)}]+")
# The index behind primes or a power: q''_1, \u03c9\u00b2_0, x^2_1.
_RAISED_BEFORE = re.compile(
    rf"(?:[{''.join(letters.PRIMES)}{''.join(letters.SUPERSCRIPTS)}]|\^\d)\Z"
)
_INDEX = re.compile(
    rf"_(?:(?<=[^{''.join(letters.PRIMES)}]_)[A-Za-z](?!\w)|\d+(?![\d_']))"
    rf"|[{''.join(letters.SUBSCRIPTS)}]+"
)
# Mathematica's letters, \[Theta] and \[CurlyPhi], with the digits behind them.
OF_MATHEMATICA = re.compile(
    r"\\\[(?:Script(?P<script>[A-Z])|(?P<curly>Curly)?(?P<capital>Capital)?(?P<name>[A-Z][a-z]+))\]"
    r"(?P<digits>\d*)"
)
# The " of x" = -x; that of 1.0u"kg" and of "x" is a quotation mark.
_TWO_PRIMES = re.compile(r"(?<=[^\W\d])\"(?![\w\"])|(?<=[^\W\d]\d)\"(?![\w\"])")
# Mathematica and Julia, in which a run of letters is one name.
WHOLE_NAMES = re.compile(r"[^\W\d]'*\[t\]|[\w)]\s*~|\bdu\[\d\]\s*=")
_ROOTS = {"\u221a": "sqrt", "\u221b": "cbrt"}
COMPARED = ("<", ">", "\u2260")
_IN_A_FORMULA, _AFTER_A_FORMULA = reasons("signs in a formula"), reasons("signs after a formula")
_SIGNS = {sign: sign for sign in "+-*/^()[]{},=;|!<>\u2260" + PARTIAL + TOTAL + NABLA} | meanings(
    "signs"
)
# The signs that join conditions in a piecewise formula. Answers hold on open sets, so <= is parsed
# as <.
_PIECEWISE = re.compile(r"\b[Pp]iecewise\s*[(\[]")
_CONDITION = re.compile(
    r"<=|>=|&&|\|\|(?=\s)|[<>&~\u2264\u2265]|\b(?:and|or|not|true|True|otherwise)\b", re.ASCII
)
_EQUALITY = re.compile(r"!?={1,2}|\u2260")
_CONDITION_SIGNS = meanings("conditions")
_REASONS, _REFUSED_SIGNS = reasons("characters"), reasons("signs")
_OTHER_PROGRAMS = pattern("tokens", "other_programs", greek="|".join(letters.GREEK.values()))
_OTHER_SIGNS = {
    "times": ",",
    "end": ";",
    "nothing": "",
    "dot": ".",
    "power": "@",
    "handle": "@",
    "to": ":",
    "prefix": "@",
    None: "",
}
_OTHERWISE = Reason("", "use letters, digits, + - * / ^ ( ) , = and '")
LEFT_OUT = "left out"


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a text was taken to mean; `other` is a formula that it could mean, too, `function` a
    name that could be a function, or `constant` one that could be a constant.
    """

    text: str
    other: str = ""
    function: str = ""
    constant: str = ""

    @property
    def said(self) -> str:
        other = f"a function {self.function}" if self.function else self.other
        other = f"a constant {self.constant}" if self.constant else other
        return f"{self.text}, not {other}" if other else self.text

    def document(self, text: str) -> dict[str, str]:
        """The entry of `readings` for a text."""
        parts = {
            "meaning": self.text,
            "not": self.other,
            "function": self.function,
            "constant": self.constant,
        }
        known = {key: part for key, part in parts.items() if part} if self.said != self.text else {}
        return {"text": text, "as": self.said, **known}


_NOTES: ContextVar[dict[str, Meaning] | None] = ContextVar("notes", default=None)


@contextmanager
def noted() -> Iterator[dict[str, Meaning]]:
    """Collect texts that are interpreted differently from how they were typed (kx as k*x), and
    omitted lines.
    """
    notes: dict[str, Meaning] = {}
    mark = _NOTES.set(notes)
    try:
        yield notes
    finally:
        _NOTES.reset(mark)


def note(
    text: str, meant: str = LEFT_OUT, other: str = "", function: str = "", constant: str = ""
) -> None:
    """Record for the caller of `noted` that a text was interpreted as another."""
    if (notes := _NOTES.get()) is not None:
        notes[text] = Meaning(meant, other, function, constant)


def note_again(noted_before: Mapping[str, Meaning]) -> None:
    """Record what was collected before, when the same text was read."""
    if (notes := _NOTES.get()) is not None:
        notes.update(noted_before)


@dataclass(frozen=True, slots=True)
class Token:
    """One token; `column` counts from 1 in the original text.

    A bracket is one token that contains the tokens `inside`; `end` is the column of its closing
    sign. `order` counts the primes after a name or a bracket, and `primed` is the column of the
    first prime. `value` is the value of a number; for a prime, the order of the derivative; for a
    bracket, FACTOR if it cannot contain arguments and FRACTION for ((above)/(below)) of LaTeX; for
    *, DOT or CROSS if LaTeX has \\cdot or \\times; for =, GIVEN if the text has := and EQUALITY if
    it has ==. The operators are + - * / ^ , = ; |, and also < > & ~ true in conditions of pieces.
    """

    kind: Kind
    text: str
    column: int
    space_before: bool = False
    value: Fraction = Fraction(0)
    inside: tuple["Token", ...] = ()
    end: int = 0
    order: int = 0
    primed: int = 0

    @property
    def span(self) -> tuple[int, int]:
        """The columns of its first character and after its last one."""
        return self.column, self.column + len(self.text)

    def is_operator(self, *texts: str) -> bool:
        return self.kind == "operator" and self.text in texts

    def is_bracket(self, text: str = "(") -> bool:
        return self.kind == "bracket" and self.text == text

    def is_fraction(self) -> bool:
        return self.kind == "bracket" and self.value == FRACTION


Tokens = list[Token]
Line = Sequence[Token]


_BEYOND = Token("end", "", 0)


def at(tokens: Line, place: int) -> Token:
    """The token at this place, or an end mark beyond either end, so that callers need no bounds
    check.
    """
    return tokens[place] if 0 <= place < len(tokens) else _BEYOND


def bracket(inside: Line, at: Token, value: Fraction = Fraction(0), space: bool = True) -> Token:
    """A bracket at the column of the token `at`."""
    return Token("bracket", "(", at.column, space, value, tuple(inside), at.column)


def nested(tokens: Line, primes: bool = True) -> Tokens:
    """The tokens with each pair of brackets joined into one token and, with `primes`, primes joined
    to the token they follow.

    InputError for an unmatched bracket, LimitError for brackets nested too deeply. No equation ends
    in brackets, so line ends inside them are dropped. Maxima's quote in 'diff(x, t) is not a prime.
    """
    outer: list[tuple[Token, Tokens]] = []
    line: Tokens = []
    for place, token in enumerate(tokens):
        if token.is_operator(*CLOSING):
            refusals.at_most(
                len(outer) + 1,
                refusals.LIMITS.depth,
                "the formula is nested too deeply",
                token.column,
            )
            outer.append((token, line))
            line = []
        elif token.is_operator(*CLOSING.values()):
            if not outer:
                raise unexpected(token, END)
            opening, before = outer.pop()
            if CLOSING[opening.text] != token.text:
                closes = any(CLOSING[other.text] == token.text for other, _ in outer)
                raise (
                    never_closed(opening)
                    if closes
                    else unexpected(token, f"'{CLOSING[opening.text]}'")
                )
            listed = opening.text == "[" and not opening.value
            inside = tuple(_rows(line) if listed else (t for t in line if t.kind != "newline"))
            line = [*before, replace(opening, kind="bracket", inside=inside, end=token.column)]
        elif token.kind == "prime" and at(tokens, place + 1).text == "diff":
            continue
        elif token.kind == "prime" and primes:
            add_prime(line, token)
        else:
            line.append(token)
    if outer:
        raise never_closed(outer[-1][0])
    return line


def _rows(inside: Line) -> Tokens:
    """The tokens in a bracket without line ends, with ; for those of Julia's [u'' ~ -u
    v'' ~ -v].
    """
    if not any(token.kind == "newline" for token in inside):
        return [*inside]
    parts = split(inside, lambda _, token: token.kind == "newline")
    rows = [(line, end) for line, end in parts if line]
    equal = all(sum(token.is_operator("=") for token in line) == 1 for line, _ in rows)
    ends = any(
        line[-1].is_operator(*_EXPECTS_MORE) or line[0].is_operator(*_GOES_ON) for line, _ in rows
    )
    found: Tokens = []
    for line, end in rows:
        found += line
        if len(rows) > 1 and equal and not ends and end is not None and line is not rows[-1][0]:
            found.append(replace(end, kind="operator", text=";"))
    return found


def add_prime(line: Tokens, prime: Token) -> None:
    """Join the prime to the name or bracket before it; if there is none, append it as a token."""
    last = at(line, len(line) - 1)
    if last.kind in ("name", "bracket", "vector"):
        line[-1] = replace(
            last, order=last.order + int(prime.value), primed=last.primed or prime.column
        )
    else:
        line.append(prime)


def places(line: Line, outer: Token = _BEYOND) -> Iterator[tuple[Line, int, Token]]:
    """Every token as its line, its place there, and the token before the bracket around the
    line.
    """
    for place, token in enumerate(line):
        yield line, place, outer
        if token.inside:
            yield from places(token.inside, at(line, place - 1))


def walk(tokens: Iterable[Token]) -> Iterator[Token]:
    """Every token; the tokens in a bracket follow it."""
    for token in tokens:
        yield token
        if token.inside:
            yield from walk(token.inside)


def within(token: Token, change: Callable[[Line], Tokens]) -> Token:
    """The token with `change` applied to its inside."""
    if not token.inside:
        return token
    inside = tuple(change(token.inside))
    return token if inside == token.inside else replace(token, inside=inside)


def with_names(line: Line, table: Mapping[str, str]) -> Tokens:
    """The tokens with the names of a table exchanged."""
    return [
        replace(token, text=table[token.text])
        if token.kind == "name" and token.text in table
        else within(token, lambda inside: with_names(inside, table))
        for token in line
    ]


def moves(tokens: Iterable[Token]) -> bool:
    """Whether a name or a bracket has primes."""
    return any(token.order for token in walk(tokens))


def flat(tokens: Iterable[Token]) -> Iterator[Token]:
    """The tokens with brackets and primes expanded into separate tokens."""
    for token in tokens:
        primes = "'" * token.order
        if token.kind != "bracket":
            yield replace(token, text=token.text + primes) if primes else token
            continue
        yield replace(token, kind="operator")
        yield from flat(token.inside)
        yield Token("operator", CLOSING[token.text] + primes, token.end)


def spelled(tokens: Iterable[Token]) -> str:
    """The tokens as a text without spaces."""
    return "".join(map(_spelled, tokens))


def _spelled(token: Token) -> str:
    primes = "'" * token.order
    if token.kind != "bracket":
        return token.text + primes
    return f"{token.text}{spelled(token.inside)}{CLOSING[token.text]}{primes}"


def source(tokens: Iterable[Token]) -> str:
    """The tokens as a text that can be parsed."""
    found = ""
    for token in flat(tokens):
        glued = (
            found[-1:].isalnum() and token.kind in ("name", "number") and not found[-1:].isdigit()
        )
        found += f"{' ' * (token.space_before or glued)}{token.text}"
    return found.strip()


def after_power(tokens: Line, place: int) -> int:
    """The place after the ^k or ^( ... ) that begins here; the same place if there is no power."""
    return place + 2 * at(tokens, place).is_operator("^")


def is_frequency(bracket: Token) -> bool:
    """Whether the bracket of cos(2 omega + epsilon) t contains a frequency rather than the time or
    a moving angle.
    """
    words = {token.text.partition("_")[0] for token in walk([bracket]) if token.kind == "name"}
    return bool(words & {"omega", "Omega", "nu"}) and "t" not in words


def split(tokens: Line, ends: Callable[[int, Token], bool]) -> list[tuple[Tokens, Token | None]]:
    """The parts between separators, each with the separator that ends it."""
    found: list[tuple[Tokens, Token | None]] = []
    start = 0
    for place, token in enumerate(tokens):
        if ends(place, token):
            found.append((list(tokens[start:place]), token))
            start = place + 1
    return [*found, (list(tokens[start:]), None)]


def split_at(signs: str, tokens: Line) -> list[Tokens]:
    """The parts between these signs."""
    ends = [k for k, token in enumerate(tokens) if token.is_operator(*signs)]
    starts = [0, *(place + 1 for place in ends)]
    return [
        list(tokens[start:end]) for start, end in zip(starts, [*ends, len(tokens)], strict=True)
    ]


def with_line_ends(tokens: Line, latex: bool = False) -> Tokens:
    """The tokens with a ; for each line end between two equations, without the other line ends.

    No equation ends next to an operator that lacks an operand. In LaTeX, a formula may be broken
    anywhere and a wide gap counts as a line end, so each side must also contain an =.
    """
    found: Tokens = []
    equals = False
    for place, token in enumerate(tokens):
        if token.kind != "newline":
            found.append(token)
            equals = not token.is_operator(";") and (equals or token.is_operator("="))
            continue
        begins = at(tokens, place - 1).kind != "newline" and (equals or not latex)
        if begins and _is_between(found, tokens[place:], latex):
            found.append(replace(token, kind="operator", text=";"))
            equals = False
    return found


def _is_between(before: Line, after: Line, latex: bool) -> bool:
    """Whether the equation before a line end is complete and the next line begins another one."""
    text = itertools.dropwhile(lambda token: token.kind == "newline", after)
    line = list(
        itertools.takewhile(
            lambda token: token.kind != "newline" and not token.is_operator(";"), text
        )
    )
    if (
        not before
        or not line
        or before[-1].is_operator(*_EXPECTS_MORE)
        or line[0].is_operator(*_GOES_ON)
    ):
        return False
    equals = any(token.is_operator("=") for token in line)
    if latex:
        return equals and before[-1].text not in JOINING + CONDITIONAL
    return not before[-1].is_operator(";") and (equals or not line[0].is_operator("-"))


def refuse_decimal_commas(
    tokens: Line, of_two: Collection[str] = (), separates: bool = False
) -> None:
    """InputError for 1,5, which may be a decimal comma or two numbers; the orders in B[1,0] are
    accepted, and a comma between the arguments of a function `of_two`, which `separates` them.
    """
    for place, token in enumerate(tokens):
        if token.inside and token.text != "[":
            commas = sum(part.is_operator(",") for part in token.inside)
            called = place > 0 and tokens[place - 1].text in of_two
            refuse_decimal_commas(token.inside, of_two, called and commas == 1)
    if separates:
        return
    for before, comma, after in zip(tokens, tokens[1:], tokens[2:], strict=False):
        numbers = before.kind == after.kind == "number"
        if comma.is_operator(",") and numbers and not after.space_before:
            marks = (".", "")[: 1 + (len(after.text) == 3)] if "." not in before.text else ()
            meant = tuple(f"{before.text}{mark}{after.text}" for mark in marks)
            if _THOUSANDS.fullmatch(before.text):  # 1.000,5
                meant = (f"{before.text.replace('.', '')}.{after.text}",)
            raise refusals.fault(
                "decimal comma", comma.column, (before.column, after.span[1]), meant
            )


def never_closed(opening: Token) -> InputError:
    """The error for a bracket that is never closed."""
    if opening.value == MATRIX:
        return refusals.fault("open matrix", opening.column)
    return refusals.fault(
        "open bracket",
        opening.column,
        sign=opening.text,
        closing=CLOSING.get(opening.text, opening.text),
    )


class TokenStream:
    """A position in a line of tokens; the `end` mark of a bracket has the text of its closing
    sign.
    """

    __slots__ = ("_tokens", "position")

    def __init__(self, tokens: Line, end: Token) -> None:
        self._tokens = [*tokens, end]
        self.position = 0

    @property
    def ahead(self) -> Token:
        return self._tokens[self.position]

    def look(self, distance: int) -> Token:
        """The token `distance` places ahead (or back), or the end token beyond either end."""
        place = self.position + distance
        return self._tokens[place] if 0 <= place < len(self._tokens) else self._tokens[-1]

    def part(self, start: int, end: int | None = None) -> Tokens:
        """The tokens from one position to another, by default the current one."""
        return self._tokens[start : self.position if end is None else end]

    def source(self, start: int, end: int | None = None) -> str:
        """The same as a text that can be parsed."""
        return source(self.part(start, end))

    def take(self) -> Token:
        token = self.ahead
        if token.kind != "end":
            self.position += 1
        return token

    def take_operator(self, *texts: str) -> Token | None:
        """Take and return the next token if it is one of these operators; otherwise return None."""
        return self.take() if self.ahead.is_operator(*texts) else None


def unexpected(token: Token, wanted: str) -> InputError:
    """The error for a token that cannot follow here."""
    if token.kind == "end" and not token.text:
        return refusals.fault("end of the formula", token.column, wanted=wanted)
    known = _IN_A_FORMULA.get(token.text) or (
        _AFTER_A_FORMULA.get(token.text) if wanted == END else None
    )
    if known and token.kind != "name":
        return refusals.refusal(known.problem, token.column, known.instead)
    if wanted == END and (opening := _OPENING.get(token.text)):
        return refusals.fault("closing bracket", token.column, sign=token.text, opening=opening)
    shown = "a prime (')" if token.kind == "prime" else f"'{refusals.shorten(token.text)}'"
    return refusals.fault("unexpected", token.column, shown=shown, wanted=wanted)


def check_length(text: str, cuts: Sequence[Cut] = ()) -> None:
    """LimitError for too many characters, InputError where no formula is left."""
    most = refusals.most_characters()
    refusals.at_most(len(text), most, "the formula has too many characters", most + 1)
    if not left.text_between_cuts(text, cuts).strip() and not any(cut.sign for cut in cuts):
        raise refusals.fault("empty formula", len(text) + 1)


def _with_whole_names(line: Line) -> Tokens:
    """omega_n for the \u03c9n of x''[t] == -\u03c9n^2 x[t], which is one name there; \u03c9x[t] is a product."""
    found: Tokens = []
    for place, token in enumerate(line):
        last, after = at(found, len(found) - 1), at(line, place + 1)
        greek = last.kind == "name" and last.text in letters.GREEK.values() and not last.order
        glued = token.kind == "name" and token.text.isalpha() and not token.space_before
        plain = not (token.order or after.is_bracket("[") or token.text in letters.GREEK.values())
        if greek and glued and plain and token.column == last.column + 1:
            found[-1] = replace(last, text=f"{last.text}_{token.text}")
        else:
            found.append(within(token, _with_whole_names))
    return found


def tokenize(text: str, known: Container[str] = (), cuts: Sequence[Cut] = ()) -> Tokens:
    """The tokens of a plain-text formula; InputError or LimitError with the column of the first
    fault.
    """
    check_length(text, cuts)
    plain = text.rstrip()
    stop = len(text)
    if plain.endswith(".") and not plain[-2:-1].isdecimal() and plain != ".":
        stop = len(plain) - 1  # the period of a sentence, not the point of a number (2.)
    conditions = _PIECEWISE.search(text) is not None

    def step(text: str, place: int, space: bool) -> tuple[Tokens, int]:
        if text[place] in letters.SPACES:
            return [], place + 1
        if text[place] == "#":
            end = text.find("\n", place)
            return [], len(text) if end < 0 else end
        if (
            conditions
            and _EQUALITY.match(text, place)
            and text.count("(", 0, place) > text.count(")", 0, place)
        ):
            raise refusals.fault("equation in a condition", place + 1)
        if conditions and (sign := _CONDITION.match(text, place)):
            return [
                Token("operator", _CONDITION_SIGNS.get(sign[0], sign[0]), place + 1, space)
            ], sign.end()
        if (
            text[place] == "_" and place and _RAISED_BEFORE.search(text, max(0, place - 2), place)
        ) or (text[place] in letters.SUBSCRIPTS):
            index = _INDEX.match(text, place)
            if index is not None:
                return [Token("index", index[0], place + 1, space)], index.end()
        return next_tokens(text, place, space, known)

    found = nested(scan(text[:stop], 0, stop, step, cuts))
    if WHOLE_NAMES.search(text):
        found = _with_whole_names(found)
    return with_line_ends(with_indices_first(found))


def with_indices_first(line: Line) -> Tokens:
    """q_1'' for the q''_1, and omega_0^2 for the omega^2_0, of plain text, which TeX sets alike."""
    found: Tokens = []
    for token in line:
        if token.kind != "index":
            found.append(within(token, with_indices_first))
            continue
        power = len(found) > 2 and found[-2].is_operator("^")
        place = len(found) - 1 - 2 * power
        name = at(found, place)
        if name.kind != "name" or token.space_before:
            raise refused_character(token.text[0], token.column)
        index = "".join(letters.SUBSCRIPTS.get(sign, sign) for sign in token.text)
        found[place] = replace(name, text=name.text + index)
    return found


def tokens_in_place(text: str, at: Token) -> Tokens:
    """The tokens of a text that replaces the token `at`, all at its column, with brackets not
    joined.
    """
    found = scan(text, 0, len(text), lambda text, place, space: next_tokens(text, place, space))
    return [replace(token, column=at.column) for token in found]


def scan(
    text: str,
    place: int,
    stop: int,
    step: Callable[[str, int, bool], tuple[Tokens, int]],
    cuts: Sequence[Cut] = (),
) -> Tokens:
    """Apply `step` repeatedly from `place` to `stop`, except where something is cut out. It takes a
    place and whether a space precedes it.

    It returns the tokens there (none for a space) and the place after them.
    """
    tokens: Tokens = []
    space, most = False, refusals.most_tokens(text.count("="))
    for start, end, cut in left.kept_parts(text, cuts, place, stop):
        part = text[:end] if end < len(text) else text  # no token goes on behind a cut
        place = start
        while place < end:
            found, place = step(part, place, space)
            tokens += found
            space = not found or found[-1].kind == "newline"
            column = tokens[-1].column if tokens else 1
            refusals.at_most(len(tokens), most, "the formula has too many parts", column)
        if cut is not None:
            tokens += (
                tokens_in_place(cut.sign, Token("operator", "", cut.start + 1)) if cut.sign else []
            )
            space = True
    return tokens


def next_tokens(
    text: str, place: int, space: bool, known: Container[str] = ()
) -> tuple[Tokens, int]:
    """The tokens that begin at `place`, which is not a space, and the place after them."""
    character = text[place]
    above, slash, below = unicodedata.normalize("NFKC", character).partition("\u2044")
    if slash and below:  # \u00bd is 1\u20442
        return [
            Token("number", character, place + 1, space, Fraction(int(above), int(below)))
        ], place + 1
    if character == "\n":
        return [Token("newline", character, place + 1, space)], place + 1
    if character == "\\" and (greek := OF_MATHEMATICA.match(text, place)):
        return [Token("name", _of_mathematica(greek), place + 1, space)], greek.end()
    if character in letters.DOTS:  # x \u0308, whose dots a blank parts from it
        order = Fraction(letters.DOTS[character])
        return [Token("prime", character, place + 1, space, order)], place + 1
    if based := _OTHER_BASE.match(text, place):
        raise refusals.fault("other base", place + 1, number=based[0])
    if grouped := _GROUPED.match(text, place):
        digits = re.sub(r"\D", "", grouped[0])
        raise refusals.fault(
            "grouped digits", place + 1, (place + 1, grouped.end() + 1), digits=digits
        )
    number = NUMBER.match(text, place)
    if number:
        return [number_token(number.group(), place + 1, space)], number.end()
    if character == '"' and _TWO_PRIMES.match(text, place):
        return [Token("prime", character, place + 1, space, Fraction(2))], place + 1
    if character in letters.PRIMES:
        return [
            Token("prime", character, place + 1, space, Fraction(letters.PRIMES[character]))
        ], place + 1
    if character in _SUPERSCRIPTS:
        raised = _RAISED.match(text, place)
        if raised is None:
            raise refusals.fault("raised minus", place + 1)
        digits = "".join(map(_SUPERSCRIPTS.__getitem__, raised[0]))
        return tokens_in_place(
            f"^({digits})", Token("name", "", place + 1)
        ), raised.end()  # x^(2) for x\u00b2
    if character == SUM and text[place + 1 : place + 2] == "_":  # \u2211_{i=1}^{3}
        return [Token("name", "sum_", place + 1, space)], place + 2
    if character in _ROOTS:
        return [Token("name", _ROOTS[character], place + 1, space)], place + 1
    found = letter(character)
    if found and found[0].isalpha():
        return _name(text, place, space, known)
    return _operator(text, place, space)


def number_token(text: str, column: int, space: bool) -> Token:
    """An exact decimal (0.1 is 1/10); LimitError for too many digits or too large a power of
    ten.
    """
    mantissa, _, exponent = text.lower().partition("e")
    digits, most = sum(map(str.isdigit, mantissa)), refusals.LIMITS.decimal_exponent
    refusals.at_most(digits, refusals.LIMITS.digits, "a number has too many digits", column)
    if len(exponent.lstrip("+-0")) > 6 or abs(int(exponent or 0)) > most:
        raise refusals.limit_passed("the power of ten of a number is too large", column, most)
    value = Fraction(mantissa) * Fraction(10) ** int(exponent or 0)
    return Token("number", text, column, space, value)


def _name(text: str, place: int, space: bool, known: Container[str]) -> tuple[Tokens, int]:
    """The names in a run of letters, each followed by a prime for the dots over it.

    In such a run, a Greek letter, the script l, and a letter with dots are separate names unless
    the whole run is declared, because alpha x may be written without a space. An ASCII run is one
    name.
    """
    ascii_name = _ASCII_NAME.match(text, place)
    end = ascii_name.end() if ascii_name else place
    if ascii_name and (end == len(text) or text[end].isascii()):
        runs = [(ascii_name.group(), 0, place)]
    else:
        runs, end = _long_name(text, place, known)
    found: Tokens = []
    for name, order, start in runs:
        refusals.at_most(
            len(name), refusals.LIMITS.name_characters, "a name has too many characters", start + 1
        )
        primed = (start + 1) * (order > 0)
        found.append(
            Token("name", name, start + 1, space and start == place, order=order, primed=primed)
        )
    return found, end


def _long_name(
    text: str, place: int, known: Container[str]
) -> tuple[list[tuple[str, int, int]], int]:
    """(name, order, place) of each name in a run with non-ASCII signs, and the end of the run."""
    signs: list[tuple[str, int, int]] = []
    end = place
    while end < len(text) and (found := letter(text[end])):
        name, order, at = (*found, end) if found[0] else signs.pop()
        if name == "varphi" and name not in known:  # the straight phi of TeX
            name = "phi"
        signs.append((name, order + (at < end) * found[1], at))
        end += 1
    whole = "".join(name for name, _, _ in signs)
    if whole in known or len(signs) > refusals.LIMITS.name_characters:
        return [(whole, sum(order for _, order, _ in signs), place)], end
    runs: list[tuple[str, int, int]] = []
    for name, order, at in signs:
        before, times, start = runs[-1] if runs else ("_", 0, at)
        below = "_" in before or name[0] == "_"
        greek = len(name) > 1 or len((letter(text[start]) or ("", 0))[0]) > 1 or times
        if not runs or (
            not name.isdigit() and not before.endswith("_") and (order or (greek and not below))
        ):
            runs.append((name, order, at))
        else:
            runs[-1] = (
                before + (name[1:] if "_" in before and name[0] == "_" else name),
                times + order,
                start,
            )
    return runs, end


def _operator(text: str, place: int, space: bool) -> tuple[Tokens, int]:
    column = place + 1
    for refused, known in _REFUSED_SIGNS.items():
        if text.startswith(refused, place):
            raise refusals.refusal(f"{refused.strip()} occurs", column, known.instead)
    for size in (2, 1):
        if sign := _SIGNS.get(text[place : place + size]):
            value = _EQUALS.get(text[place : place + size], Fraction(0))
            return [Token("operator", sign, column, space, value)], place + size
    if other := _OTHER_PROGRAMS.match(text, place):
        return [
            Token("operator", each, column, space) for each in _OTHER_SIGNS[other.lastgroup]
        ], other.end()
    raise refused_character(text[place], column)


def refused_character(character: str, column: int) -> InputError:
    """The error for a character that no rule accepts."""
    what = f"the character {_described(character)} is not accepted"
    reason = _REASONS.get(character, _OTHERWISE)
    return refusals.refusal(
        what, column, reason.instead, tuple(reason.offers), (column, column + 1)
    )


def _of_mathematica(found: re.Match[str]) -> str:
    r"""theta for \[Theta], theta1 for \[Theta]1, ell for \[ScriptL]."""
    if found["script"]:
        return ("ell" if found["script"] == "L" else found["script"]) + found["digits"]
    name = found["name"] if found["capital"] else found["name"].lower()
    return f"{'var' * bool(found['curly'])}{name}{found['digits']}"


def _described(character: str) -> str:
    """The character for a message: itself if printable ASCII, else its code point."""
    return f"'{character}'" if " " < character <= "~" else f"U+{ord(character):04X}"
