r"""Rules over the signs of a text: a sign, one after another, one of several, perhaps one.

A rule takes the line of signs and a place, and returns the place after what it finds there, or NO.
What comes first is tried first and nothing is tried twice, so that a rule takes time that grows
with what it looks at.

    METRIC = then(either(one("ds"), then(UPRIGHT_D, one("s"))), SQUARED, ahead(one("=")))
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from inverse_service.reading import signs
from inverse_service.reading.signs import Line, Span
from inverse_service.reading.typed_text import Change, Typed

NO = -1


class Part(NamedTuple):
    """A part of what a rule finds: its name, its span in the text, and its signs without blanks."""

    name: str
    span: Span
    text: str


Parts = list[Part]
_Match = Callable[[Line, int, Parts], int]


@dataclass(frozen=True, slots=True)
class Rule:
    """`match` finds the place after it; `begins` are the signs with which it may begin, if only
    some of them are such.
    """

    match: _Match
    begins: frozenset[str] | None = None
    is_empty: bool = False  # it may find nothing, and then goes on with what follows


@dataclass(frozen=True, slots=True)
class Found:
    """What a rule found in a text: its span, and its parts by their names."""

    source: str
    span: Span
    parts: dict[str, Part] = field(default_factory=dict)

    def __getitem__(self, name: str) -> str | None:
        """The signs of a part without blanks; None if it is not there."""
        return self.parts[name].text if name in self.parts else None

    @property
    def text(self) -> str:
        """What was typed there."""
        return self.source[self.span.start : self.span.stop]

    def cut(self, text: Typed, name: str) -> Typed:
        """A part of the text in which it was found."""
        start, stop = self.parts[name].span
        return text[start:stop]


def one(*texts: str) -> Rule:
    """A sign with one of these texts."""
    wanted = frozenset(texts)
    return Rule(lambda line, k, _: k + 1 if line.at(k).text in wanted else NO, wanted)


def sign(is_so: Callable[[str], bool]) -> Rule:
    """A sign whose text is so."""
    return Rule(lambda line, k, _: k + 1 if k < len(line) and is_so(line[k].text) else NO)


def without(characters: str) -> Rule:
    """A sign with none of these characters."""
    return sign(lambda text: not any(character in characters for character in text))


def then(*rules: Rule | str) -> Rule:
    """One after another; a text is its sign."""
    each = [one(rule) if isinstance(rule, str) else rule for rule in rules]
    matches = [rule.match for rule in each]

    def match(line: Line, place: int, parts: Parts) -> int:
        mark = len(parts)
        for one_of in matches:
            place = one_of(line, place, parts)
            if place == NO:
                del parts[mark:]
                return NO
        return place

    begins: frozenset[str] | None = frozenset()
    for rule in each:
        begins = None if begins is None or rule.begins is None else begins | rule.begins
        if not rule.is_empty:
            break
    return Rule(match, begins, all(rule.is_empty for rule in each))


def either(*rules: Rule) -> Rule:
    """The first of them that holds."""
    known = [rule.begins for rule in rules if rule.begins is not None]
    begins = frozenset().union(*known) if len(known) == len(rules) else None
    asked = [(None if rule.is_empty else rule.begins, rule.match) for rule in rules]

    def match(line: Line, place: int, parts: Parts) -> int:
        text = line.at(place).text
        for begins, one_of in asked:
            may_begin = begins is None or text in begins
            if may_begin and (stop := one_of(line, place, parts)) != NO:
                return stop
        return NO

    return Rule(match, begins, any(rule.is_empty for rule in rules))


def maybe(*rules: Rule | str) -> Rule:
    """These one after another, or nothing."""
    rule = then(*rules)

    def match(line: Line, place: int, parts: Parts) -> int:
        stop = rule.match(line, place, parts)
        return place if stop == NO else stop

    return Rule(match, rule.begins, True)


def many(rule: Rule, most: int | None = None, least: int = 0) -> Rule:
    """As often as it holds."""

    def match(line: Line, place: int, parts: Parts) -> int:
        count = 0
        while count != most and (stop := rule.match(line, place, parts)) not in (NO, place):
            place, count = stop, count + 1
        return place if count >= least else NO

    return Rule(match, rule.begins, not least)


def until(rule: Rule, end: Rule, most: int, least: int = 0) -> Rule:
    """As often as it has to hold before `end`, and that."""

    def match(line: Line, place: int, parts: Parts) -> int:
        for count in range(most + 1):
            if count >= least and (stop := end.match(line, place, parts)) != NO:
                return stop
            place = rule.match(line, place, parts)
            if place == NO:
                break
        return NO

    known = rule.begins, frozenset[str]() if least else end.begins
    return Rule(match, None if None in known else frozenset().union(*filter(None, known)))


def part(name: str, rule: Rule) -> Rule:
    """The same, as a part of what is found."""

    def match(line: Line, place: int, parts: Parts) -> int:
        stop = rule.match(line, place, parts)
        if stop != NO:
            found = line[place:stop]
            span = (
                Span(found[0].start, found[-1].stop) if found else Span(*[line.at(place).start] * 2)
            )
            parts.append(Part(name, span, "".join(each.text for each in found)))
        return stop

    return Rule(match, rule.begins, rule.is_empty)


def rest_of(name: str, before: str, is_so: Callable[[str], bool], *after: Rule) -> Rule:
    """A sign that begins so, whose rest is a part, with what is after it: the x' of dx'."""
    rule = then(*after)

    def match(line: Line, place: int, parts: Parts) -> int:
        rest = line.at(place).text[len(before) :]
        if not rest or not line[place].text.startswith(before) or not is_so(rest):
            return NO
        stop = rule.match(line, place + 1, parts)
        if stop != NO:
            span = Span(line[place].start + len(before), line[stop - 1].stop)
            text = rest + "".join(each.text for each in line[place + 1 : stop])
            parts.append(Part(name, span, text))
        return stop

    return Rule(match)


def ahead(rule: Rule) -> Rule:
    """What has to follow, which is no part of what is found."""
    return Rule(lambda line, k, _: k if rule.match(line, k, []) != NO else NO, frozenset(), True)


def unless(rule: Rule) -> Rule:
    """What must not follow."""
    return Rule(lambda line, k, _: k if rule.match(line, k, []) == NO else NO, frozenset(), True)


def behind(is_so: Callable[[str], bool]) -> Rule:
    """Where the sign before is so; it has no text at the beginning."""
    return Rule(lambda line, k, _: k if is_so(line.at(k - 1).text) else NO, frozenset(), True)


def follows(is_so: Callable[[str], bool]) -> Rule:
    """Where the sign after is so; it has no text at the end."""
    return Rule(lambda line, k, _: k if is_so(line.at(k).text) else NO, frozenset(), True)


def find(rule: Rule, text: Typed | str) -> Iterator[Found]:
    """Each place of a text where a rule holds."""
    source = text if isinstance(text, str) else text.text
    line, place = signs.of(source), 0
    if rule.begins is not None and line.texts.isdisjoint(rule.begins):
        return
    while place < len(line):
        parts: Parts = []
        is_begun = rule.begins is None or line[place].text in rule.begins
        stop = rule.match(line, place, parts) if is_begun else NO
        if stop > place:
            yield _found(source, line, place, stop, parts)
            place = stop
        else:
            place += 1


def _found(source: str, line: Line, place: int, stop: int, parts: Parts) -> Found:
    span = Span(line[place].start, line[stop - 1].stop)
    return Found(source, span, {each.name: each for each in parts})


def first(rule: Rule, text: Typed | str) -> Found | None:
    """The first place where a rule holds."""
    return next(find(rule, text), None)


def begin(rule: Rule, text: Typed | str) -> Found | None:
    """What a rule finds at the beginning of a text."""
    source = text if isinstance(text, str) else text.text
    line, parts = signs.of(source), Parts()
    stop = rule.match(line, 0, parts)
    return _found(source, line, 0, stop, parts) if stop > 0 else None


def changed(text: Typed, rule: Rule, by: Callable[[Found], Typed | str | None]) -> Typed:
    """The text with what is read in the place of each span that a rule finds; None leaves it."""
    changes = [
        Change(*found.span, new) for found in find(rule, text) if (new := by(found)) is not None
    ]
    return text.put(changes) if changes else text


# Signs of many rules.
def is_word(text: str) -> bool:
    """Whether a sign is made of letters, digits, and _."""
    return bool(text) and text.replace("_", "a").isalnum()


def is_name(text: str) -> bool:
    """Whether a sign is a word that begins with a letter, or with the \u00bd of \u00bdm."""
    return is_word(text) and not text[0].isdecimal() and text[0] not in "_\u00b2\u00b3"


def is_command(text: str) -> bool:
    """Whether a sign is a command of LaTeX, a backslash and letters."""
    return text[:1] == "\\" and text[1:].isascii() and text[1:].isalpha()


def is_word_or_command(text: str) -> bool:
    return is_word(text) or is_command(text)


def braced(*rules: Rule | str) -> Rule:
    return then("{", *rules, "}")


def group(opening: Rule, inside: str, closing: Rule, most: int | None = None) -> Rule:
    """A bracket, the signs without the characters `inside`, and its end."""
    return then(opening, many(without(inside), most), closing)


WORD = sign(is_word)
NAME = sign(is_name)
PLUS_OR_MINUS = one("+", "-", "\u2212")
SQUARED = either(then("^", "2"), then("^", braced("2")), one("\u00b2"))
FRACTION = one("\\frac", "\\dfrac", "\\tfrac")
PRIMES = sign(lambda text: text != "" and not text.strip("'\u2032"))
D = either(
    one("d"),
    then(one("\\mathrm", "\\text"), braced("d")),
    then(one("\\rm", "\\mathrm"), "d"),
    braced("\\rm", "d"),
)
DT = either(one("dt"), then(D, "t"))
PARTIAL = one("\u2202", "\\partial")


def _ends(text: str) -> bool:
    words = ("with", "where", "and", "for", "\\\\", "\\]")
    return (
        text in ("", *words)
        or text[0] in ";,.\u00b6$"
        or text.startswith(("\\end", "\\quad", "\\qquad"))
    )


def _begins(text: str) -> bool:
    return text in ("", "\\\\", "\\]") or text[-1] in ";,\u00b6$" or text.endswith("quad")


_WHERE = then(one("\\text", "\\textrm", "\\qq"), braced(one("with", "where", "and")))
ENDS, BEGINS = either(follows(_ends), ahead(_WHERE)), behind(_begins)
PART = without(";,\u00b6= ")
_MOST_PARTS = 60  # of one side of an equation


def side_until(end: Rule) -> Rule:
    """One side of an equation, and what has to follow it."""
    return until(PART, end, _MOST_PARTS + 1, 1)
