r"""Vectors and matrices by their components, and squares of vectors: \mathbf{r} = (x, y, z), M =
[[2, 0], [0, 1]], \dot{\mathbf r}^2 = \dot r^2 + r^2 \dot\theta^2.
"""

from __future__ import annotations

from inverse_service.reading import components, signs
from inverse_service.reading.rules import rates_of_vectors, unit_vectors
from inverse_service.reading.rules.sequences import (
    BEGINS,
    ENDS,
    FRACTION,
    SQUARED,
    WORD,
    Found,
    behind,
    braced,
    changed,
    either,
    find,
    first,
    is_word_or_command,
    many,
    maybe,
    one,
    part,
    side_until,
    sign,
    then,
    until,
    without,
)
from inverse_service.reading.typed_text import Typed

_BOLD = one(*(f"\\{command}" for command in components.BOLD))
_NAME = sign(is_word_or_command)
_INDEX = then("_", part("index", either(braced(WORD), WORD)))
_NAMED = either(
    then(_BOLD, either(braced(_NAME, maybe(_INDEX)), _NAME), maybe(_INDEX)),
    then(behind(lambda text: text[-1:] not in (")", "'")), WORD),
)
_INNER = then("(", many(without("()[]=, ")), ")")
_LISTED = either(
    then(many(without("()=, "), None, 1), ",", many(without("()= ")), ")"),
    then(
        many(either(_INNER, without("()[]=, ")), None, 1),
        ",",
        many(either(_INNER, without("()[]= "))),
        ")",
    ),
)
VECTOR = then(_NAMED, "=", "(", _LISTED)
_ROW = then("[", many(without("[]= "), None, 1), "]", maybe(","))
_MATRIX = one("matrix", "pmatrix", "bmatrix")
# The k/2 of K = k/2 [[2, -1], [-1, 2]]
_FACTOR = many(
    either(then(FRACTION, braced(WORD), braced(WORD)), WORD, one("*", "/", "^", "\\cdot"))
)
_DIAGONAL = either(one("diag"), then(one("\\operatorname", "\\mathrm", "\\text"), braced("diag")))
MATRIX = then(
    _NAMED,
    "=",
    _FACTOR,
    either(
        then(_DIAGONAL, "(", many(without("()= "), None, 1), ")"),
        then("[", many(_ROW, None, 1), "]"),
        then(
            "\\begin",
            braced(_MATRIX),
            until(without("= "), then("\\end", braced(_MATRIX)), 10_000),
        ),
    ),
)
GIVEN = then(maybe(one("for", "with", "where", "and")), VECTOR)
_ARROW = either(
    then("\\dot", braced(_BOLD, either(braced(WORD), WORD))),
    then(maybe("\\dot"), _BOLD, either(braced(maybe("\\dot"), WORD), WORD)),
)
_NUMBER = sign(str.isdecimal)
_NUMBERED = then(
    _BOLD,
    either(then("{", WORD), WORD),
    many(one("}"), 2),
    "_",
    part("number", either(braced(_NUMBER), _NUMBER)),
)
SQUARE = then(BEGINS, part("vector", _ARROW), SQUARED, "=", part("formula", side_until(ENDS)))
OF_VECTOR = then(part("vector", _ARROW), SQUARED)


def without_matrices(text: Typed) -> Typed:
    """The text without M = [[2, 0], [0, 1]], which is put beside L again."""
    return changed(text, MATRIX, lambda _: " ")


def without_vectors(text: Typed) -> Typed:
    """The text without r = (x, y, z), which is put beside L again."""
    return changed(text, GIVEN, lambda _: " ")


def given_in(text: str) -> list[str]:
    """The vectors, then the matrices, whose components a text gives."""
    return [found.text for rule in (VECTOR, MATRIX) for found in find(rule, text)]


def written_out(text: Typed) -> Typed:
    """The text with lists of components for what gives them in other ways, and with dots for the
    vectors v and a.
    """
    return rates_of_vectors.with_dots(_with_numbers(unit_vectors.by_components(text)))


def _with_numbers(text: Typed) -> Typed:
    r"""The text with \mathbf r_1 = (x_1, y_1), \mathbf r_2 = (x_2, y_2) for \mathbf r_i = (x_i, y_i),
    for each number that bold letters have as an index.
    """
    numbers = sorted({str(each["number"]).strip("{}") for each in find(_NUMBERED, text)})

    def each_of(found: Found) -> str | None:
        index, line = str(found["index"] or "").strip("{}"), signs.of(found.text)
        places = [
            sign.start
            for k, sign in enumerate(line)
            if sign.text == index and (line.says(k - 1, "_") or line.says(k - 2, "_", "{"))
        ]
        # of the vector, and of each of its components
        if not (numbers and len(index) == 1 and index.isalpha()) or len(places) != (
            found.text.count(",") + 2
        ):
            return None
        written = [[*found.text] for _ in numbers]
        for letters, number in zip(written, numbers, strict=True):
            for place in places:
                letters[place] = number
        return ", ".join(map("".join, written))

    return changed(text, VECTOR, each_of)


def with_squares(text: Typed) -> Typed:
    r"""The text with (\dot r^2 + r^2 \dot\theta^2) for each \dot{\mathbf r}^2 where this is given."""
    given = first(SQUARE, text)
    if given is None:
        return text
    formula, vector = given.cut(text, "formula"), given["vector"]
    start, stop = given.span
    text = text[:start] + text.made(" ", start) + text[stop:]

    def square(found: Found) -> Typed | None:
        return formula.in_brackets() if found["vector"] == vector else None

    return changed(text, OF_VECTOR, square)
