r"""V = V(x, y) and \omega = \omega(t) beside equations of motion: what a name depends on wherever it
stands alone.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from inverse_service.expressions.refusals import fault
from inverse_service.reading import names as nm, reader, signs, time_derivatives
from inverse_service.reading.signs import Line
from inverse_service.reading.typed_text import Change, Typed

_JOINS = frozenset(("where", "with", "and", "for"))
_DIFFERENTIATES = frozenset(("diff", "D", "Derivative", "\\pdv", "\\dv", "\\pd", "\\odv", "\\od"))
_BEFORE_SLOPES = frozenset((
    "\\partial", "\u2202", "d", "\\nabla", "\u2207", "grad", "\\dot", "\\ddot",
))  # fmt: skip
_MOST_LETTERS = 4  # of a product without signs, mw^2


class _Name(NamedTuple):
    """A name, without braces and backslash, and the places of the signs from it to what follows."""

    text: str
    start: int
    stop: int


class _Statement(NamedTuple):
    """V = V(x, y): the name, (x, y), and the places of its signs."""

    name: str
    arguments: str
    start: int
    stop: int

    @property
    def called(self) -> str:
        return f"{self.name}{self.arguments}"

    @property
    def letters(self) -> frozenset[str]:
        return frozenset(map(_plain, self.arguments[1:-1].split(",")))


class Read(NamedTuple):
    """The texts, what each statement is read as, and the arguments of names with an index, which a
    bracket would multiply.
    """

    typed: list[Typed]
    meant: dict[str, str]
    functions: dict[str, list[str]]


def spelled_out(texts: Sequence[Typed], declared: Collection[str]) -> Read | None:
    """The texts with V(x, y) for V, and without V = V(x, y); None where nothing of the kind is said
    of a name that does not move and is not declared.

    InputError for a name that is written within a product, mw^2, or that depends on less than its
    slopes are taken by.
    """
    lines = [signs.with_whole_names(text.text) for text in texts]
    stated = [[*_statements(text.text, line)] for text, line in zip(texts, lines, strict=True)]
    if not any(stated):
        return None
    moving = {
        name
        for text, line, found in zip(texts, lines, stated, strict=True)
        for name in _moving(text.put(_cut(line, one) for one in found).text)
    }
    known = {
        each.name: each
        for found in stated
        for each in found
        if each.name not in {*moving, *declared}
    }
    if not known or not moving:
        return None
    typed = [
        text.put(_changes(text, line, [one for one in found if one.name in known], known, moving))
        for text, line, found in zip(texts, lines, stated, strict=True)
    ]
    meant = {f"{each.name} = {each.called}": each.called for each in known.values()}
    indexed = {
        name: [_plain(one) for one in each.arguments[1:-1].split(",")]
        for name, each in known.items()
        if "_" in name and each.letters <= {*moving, "t"}
    }
    return Read(typed, meant, indexed)


def _moving(text: str) -> list[str]:
    return time_derivatives.moving_names(reader.tokens_if_any(text, nm.Names(guesses=True)), 1)


def _cut(line: Line, one: _Statement) -> Change:
    return Change(line[one.start].start, line[one.stop - 1].stop, " ")


def _plain(name: str) -> str:
    return name.strip().lstrip("\\").replace("{", "").replace("}", "").replace(" ", "")


def _name_at(line: Line, place: int) -> _Name | None:
    r"""The name that begins here: V, \omega_0, or \omega_{0}."""
    text = line.at(place).text
    if not text.lstrip("\\")[:1].isalpha():
        return None
    if text.endswith("_") and line.says(place + 1, "{") and line.says(place + 3, "}"):
        return _Name(_plain(text + line.at(place + 2).text), place, place + 4)
    return _Name(_plain(text), place, place + 1)


def _statements(text: str, line: Line) -> Iterator[_Statement]:
    for place, sign in enumerate(line):
        if sign.text != "=":
            continue
        right = _name_at(line, place + 1)
        names = (_name_at(line, place - k) for k in (4, 1) if place >= k)
        left = next((name for name in names if name and name.stop == place), None)
        if left is None or right is None or left.text != right.text:
            continue
        opening = line.at(right.stop)
        end = next((k for k in range(right.stop, len(line)) if line[k].text == ")"), None)
        if opening.text != "(" or end is None:
            continue
        before, after = line.at(left.start - 1).text, line.at(end + 1).text
        start, stop = left.start - (before in _JOINS), end + 1
        if (before, after) == ("(", ")"):  # x'' = -w^2 x (w = w(t))
            start, stop = start - 1, stop + 1
        elif not (_begins(before) and _ends(after)):
            continue
        inside = text[opening.start : line[end].stop]
        yield _Statement(left.text, inside, start, stop)


def _begins(before: str) -> bool:
    return before in ("", *_JOINS) or before[-1] in ",;:.$\u00b6" or before.endswith("quad")


def _ends(after: str) -> bool:
    commands = ("\\quad", "\\qquad", "\\end", "\\\\")
    return after in ("", *_JOINS) or after[0] in ",;.$\u00b6" or after.startswith(commands)


def _changes(
    text: Typed,
    line: Line,
    stated: Sequence[_Statement],
    known: Mapping[str, _Statement],
    moving: Collection[str],
) -> Iterator[Change]:
    gone: set[int] = set()
    for one in stated:
        gone |= {*range(one.start, one.stop)}
        yield _cut(line, one)
    for place, sign in enumerate(line):
        name = None if place in gone else _name_at(line, place)
        word = sign.text.lstrip("0123456789")
        if place in gone or (name is None and word == sign.text):
            continue
        called = name.text if name else word
        stop = name.stop if name else place + 1
        if called not in known:
            if written := _product(text, sign, called, known, moving):
                first = sign.stop - len(called)
                yield Change(first, sign.stop, written)
            continue
        slope = _is_differentiated(line, place) or line.says(stop, "_")
        if slope and known[called].letters != {*moving}:
            raise text.error(fault("dependence of a slope", sign.start + 1, name=called))
        primes = line.at(stop).text
        stop += bool(primes) and not primes.strip("'\u2032")  # V' is V'(x)
        if not slope and not line.says(stop, "("):
            after = line[stop - 1].stop
            yield Change(after, after, known[called].arguments)


def _is_differentiated(line: Line, place: int) -> bool:
    before, outer = line.at(place - 1).text, line.at(place - 2).text
    called = before in ("(", "{", "[") and outer in _DIFFERENTIATES
    return called or before in _BEFORE_SLOPES


def _product(
    text: Typed,
    sign: signs.Sign,
    word: str,
    known: Mapping[str, _Statement],
    moving: Collection[str],
) -> str:
    """k(t) x for the kx next to k = k(t), no text for a word without such a name.

    InputError for the mw of mw^2 next to w = w(t), and for the V_x of a V of another argument.
    """
    head, _, below = word.partition("_")
    if below and head in known and {*below} <= {*moving} and known[head].letters != {*moving}:
        raise text.error(fault("dependence of a slope", sign.start + 1, name=head))
    other = word in nm.FUNCTIONS or word in nm.GREEK_NAMES or word in moving or word in _JOINS
    if other or sign.text[0] == "\\" or not word.isalpha() or not 1 < len(word) <= _MOST_LETTERS:
        return ""
    if word[0] == "d" and word[1:] in {*known, *moving, "t"}:  # dV/dx
        return ""
    inside = [name for name in known if name in word]
    if not inside:
        return ""
    if {*word} <= {*known, *moving}:
        return " ".join(known[one].called if one in known else one for one in word)
    raise text.error(fault("dependence in a product", sign.start + 1, name=inside[0], word=word))
