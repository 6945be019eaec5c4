r"""V = V(x, y) and \omega = \omega(t) beside equations of motion: what a name depends on wherever it
stands alone.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from inverse_service.expressions.refusals import fault
from inverse_service.reading import names as nm, reader, signs, time_derivatives
from inverse_service.reading.rules import dependences
from inverse_service.reading.rules.dependences import Dependence
from inverse_service.reading.signs import Line
from inverse_service.reading.typed_text import Change, Typed

_DIFFERENTIATES = frozenset(("diff", "D", "Derivative", "\\pdv", "\\dv", "\\pd", "\\odv", "\\od"))
_BEFORE_SLOPES = frozenset((
    "\\partial", "\u2202", "d", "\\nabla", "\u2207", "grad", "\\dot", "\\ddot",
))  # fmt: skip
_MOST_LETTERS = 4  # of a product without signs, mw^2


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
    stated = [[one for one in dependences.statements(text.text) if one.is_whole] for text in texts]
    if not any(stated):
        return None
    moving = {
        name
        for text, found in zip(texts, stated, strict=True)
        for name in _moving(text.put(Change(*one.span, " ") for one in found).text)
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
        name: each.letters
        for name, each in known.items()
        if "_" in name and {*each.letters} <= {*moving, "t"}
    }
    return Read(typed, meant, indexed)


def _moving(text: str) -> list[str]:
    return time_derivatives.moving_names(reader.tokens_if_any(text, nm.Names(guesses=True)), 1)


def _changes(
    text: Typed,
    line: Line,
    stated: Sequence[Dependence],
    known: Mapping[str, Dependence],
    moving: Collection[str],
) -> Iterator[Change]:
    gone: set[int] = set()
    for one in stated:
        gone |= {*one.places}
        yield Change(*one.span, " ")
    for place, sign in enumerate(line):
        name = None if place in gone else dependences.name_at(line, place)
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
        if slope and {*known[called].letters} != {*moving}:
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
    known: Mapping[str, Dependence],
    moving: Collection[str],
) -> str:
    """k(t) x for the kx next to k = k(t), no text for a word without such a name.

    InputError for the mw of mw^2 next to w = w(t), and for the V_x of a V of another argument.
    """
    head, _, below = word.partition("_")
    if below and head in known and {*below} <= {*moving} and {*known[head].letters} != {*moving}:
        raise text.error(fault("dependence of a slope", sign.start + 1, name=head))
    other = (
        word in nm.FUNCTIONS
        or word in nm.GREEK_NAMES
        or word in moving
        or word in dependences.JOINS
    )
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
