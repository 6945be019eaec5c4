r"""Vectors by unit vectors, as lists of components: \vec B = B \hat z is (0, 0, B), \vec r = x \hat x
+ y \hat y is (x, y), \vec A = \frac12 (-y, x) has the factor in each component; \hat r is r/|r|,
and \hat y in an equation a column.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from inverse_service.reading import components, signs
from inverse_service.reading.rules.sequences import (
    ENDS,
    FRACTION,
    WORD,
    Found,
    braced,
    changed,
    either,
    find,
    many,
    maybe,
    one,
    part,
    side_until,
    sign,
    then,
    without,
)
from inverse_service.reading.signs import Line
from inverse_service.reading.typed_text import Typed

_AXES = {
    **dict.fromkeys(("x", "i", "\\imath", "1"), 0),
    **dict.fromkeys(("y", "j", "\\jmath", "2"), 1),
    **dict.fromkeys(("z", "k", "3"), 2),
}
_BOLD = one(*(f"\\{command}" for command in components.BOLD), "\\mathrm")
_HAT = one("\\hat", "\\widehat")
_LETTER = part("letter", sign(lambda text: text in {*_AXES} or text.isalpha()))
_PLAIN = either(braced(_LETTER), _LETTER)
_OF_BASIS = then("_", _PLAIN)
_E = one("e")
UNIT = either(
    then(_HAT, either(braced(_BOLD, _PLAIN), braced(_E), _E), _OF_BASIS),
    then(_HAT, either(braced(_BOLD, _PLAIN), then(_BOLD, _PLAIN), _PLAIN)),
    then(_BOLD, braced(_HAT, _PLAIN)),
    then(_BOLD, either(braced(_E), _E, braced(_HAT, either(braced(_E), _E))), _OF_BASIS),
)
_NAMED = then(_BOLD, either(braced(WORD), WORD))
SUM = then(part("name", _NAMED), "=", part("sum", side_until(ENDS)))
_FACTOR = many(
    either(then(FRACTION, braced(WORD), braced(WORD)), then(FRACTION, WORD), WORD, one("/")),
    None,
    1,
)
_INNER = then("(", many(without("()=;\u00b6")), ")")
SCALED = then(
    part("name", _NAMED),
    "=",
    part("factor", _FACTOR),
    maybe("\\cdot"),
    "(",
    part("list", many(either(_INNER, without("()=;\u00b6")), None, 1)),
    ")",
)
_VECTOR = then(_BOLD, either(braced(part("name", WORD)), part("name", WORD)))
LIST = then(
    part("vector", _VECTOR), "=", "(", many(either(_INNER, without("()=;\u00b6,")), None, 1), ","
)


def by_components(text: Typed) -> Typed:
    """The text with the components of each vector that unit vectors or a factor give, and with
    r/|r| for the unit vector of a vector r.
    """
    if not signs.of(text.text).texts & {"\\hat", "\\widehat", "e"} and "(" not in text.text:
        return text
    sums = {found.span: _terms(found, text) for found in find(SUM, text)}
    axes = [axis for terms in sums.values() for axis in terms or ()]
    size = 3 if 2 in axes or _has_three(text) else 2

    def listed(found: Found) -> Typed | None:
        terms = sums[found.span]
        if terms is None:
            return None
        zero = text.made("0", found.span.start)
        entries = [terms.get(axis, zero) for axis in range(size)]
        whole = entries[0]
        for entry in entries[1:]:
            whole = whole + text.made(", ", found.span.start) + entry
        return found.cut(text, "name") + text.made(" = ", found.span.start) + whole.in_brackets()

    text = changed(text, SUM, listed)
    text = changed(text, SCALED, partial(_multiplied, text))
    return changed(text, UNIT, partial(_in_its_place, text, size))


def _multiplied(text: Typed, found: Found) -> Typed | None:
    """The list with the factor before it in each component."""
    factor, entries = found.cut(text, "factor"), _entries(found.cut(text, "list"))
    if len(entries) < 2:
        return None
    made = [factor + entry.in_brackets() for entry in entries]
    whole = made[0]
    for entry in made[1:]:
        whole = whole + entry.made(", ") + entry
    return found.cut(text, "name") + whole.made(" = ") + whole.in_brackets()


def _entries(listed: Typed) -> list[Typed]:
    """The parts of a list between its own commas."""
    found, start, depth = list[Typed](), 0, 0
    for each in signs.of(listed.text):
        if each.text == "," and not depth:
            found.append(listed[start : each.start])
            start = each.stop
        depth += (each.text in ("(", "[", "{")) - (each.text in (")", "]", "}"))
    return [*found, listed[start:]]


def _has_three(text: Typed) -> bool:
    """Whether a list in brackets has three parts."""
    line = signs.of(text.text)
    return any(_commas(line, place) == 2 for place, each in enumerate(line) if each.text == "(")


def _commas(line: Line, opening: int) -> int:
    """The commas of a bracket itself."""
    depth = commas = 0
    for each in line[opening:]:
        depth += (each.text in "([{") - (each.text in ")]}")
        commas += each.text == "," and depth == 1
        if not depth:
            break
    return commas


def _terms(found: Found, text: Typed) -> dict[int, Typed] | None:
    """The component by each axis of a sum of multiples of unit vectors; None for another formula."""
    whole, terms = found.cut(text, "sum"), dict[int, Typed]()
    for term in _added(whole):
        units = [*find(UNIT, term)]
        last = units[-1] if units else None
        axis = _AXES.get(str(last["letter"])) if last else None
        if last is None or len(units) > 1 or axis is None or axis in terms:
            return None
        if signs.of(term.text)[-1].stop != last.span.stop:
            return None
        factor = signs.trimmed(term[: last.span.start])
        factor = signs.trimmed(factor[1:]) if factor.text.startswith("+") else factor
        alone = factor.text in ("", "-", "\u2212")
        terms[axis] = factor + term.made("1", last.span.start) if alone else factor
    return terms or None


def _added(whole: Typed) -> Iterator[Typed]:
    """The terms of a sum, each with its sign."""
    depth, start = 0, 0
    for each in signs.of(whole.text):
        if (
            each.text in ("+", "-", "\u2212")
            and not depth
            and whole.text[start : each.start].strip()
        ):
            yield whole[start : each.start]
            start = each.start
        depth += (each.text in ("(", "[", "{")) - (each.text in (")", "]", "}"))
    yield whole[start:]


def _in_its_place(text: Typed, size: int, found: Found) -> str | None:
    r"""r/|r| for \hat r where \vec r occurs, and a column for \hat y where a vector has components;
    None elsewhere.
    """
    letter = str(found["letter"])
    given = {str(each["name"]): each.cut(text, "vector").text for each in find(LIST, text)}
    if letter in given:
        return f"\\frac{{{given[letter]}}}{{|{given[letter]}|}}"
    if letter not in _AXES or not given:
        return None
    column = " \\\\ ".join("01"[axis == _AXES[letter]] for axis in range(size))
    return f"\\begin{{pmatrix}}{column}\\end{{pmatrix}}"
