r"""Names in LaTeX: words, subscripts, fonts, and the d x of \frac{dx}{dt}."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from inverse_service.expressions.latex_scanner import Raw
from inverse_service.expressions.names import Names, Role
from inverse_service.expressions.tokens import LETTER_COMMANDS, LIMITS, Token, refusal
from inverse_service.expressions.vocabulary import DERIVATIVE_NAMES, FUNCTIONS, REFUSED

_TIME_ARGUMENTS = (["{", "left", "(", "t", "right", ")", "}"], ["left", "(", "t", "right", ")"], ["(", "t", ")"])


def time_argument(pieces: Sequence[Raw]) -> int:
    r"""How many pieces {\left(t \right)}, \left(t\right) or (t) takes where it comes first, else 0."""
    texts = [piece.text for piece in pieces]
    return next((len(each) for each in _TIME_ARGUMENTS if texts[: len(each)] == each), 0)


def open_brackets(tokens: Sequence[Token]) -> int:
    """How many brackets are opened and not closed."""
    return sum(token.is_operator("(") - token.is_operator(")") for token in tokens)


def role_before(tokens: Sequence[Token], names: Names) -> Role | None:
    """What the name was declared as that came last, in x as in x' and x^{2}; None for anything else."""
    place = _before_power(tokens)
    while place >= 0 and tokens[place].kind == "prime":
        place -= 1
    return names.role(names.spelling(tokens[place].text)) if place >= 0 else None


def _before_power(tokens: Sequence[Token]) -> int:
    """The place of the token before ^( … ), where this came last."""
    last = len(tokens) - 1
    if last < 0 or not tokens[last].is_operator(")"):
        return last
    balances = itertools.accumulate(open_brackets([token]) for token in reversed(tokens))
    opening = next((last - back for back, balance in enumerate(balances) if balance == 0), 0)
    return opening - 2 if opening > 0 and tokens[opening - 1].is_operator("^") else -1


FONTS = ("mathrm", "operatorname", "operatorname*", "text", "mathit")
_COMPONENTS = "a vector is not accepted, write an equation for each component"
_OTHER_LETTER = "letters of this kind are names of their own, write another name such as B_1"
# A bold r is not the r of the next line, nor is a script L the l.
VECTORS = dict.fromkeys(
    ("mathbf", "boldsymbol", "bm", "pmb", "bf", "textbf", "vec", "overrightarrow", "underline"), _COMPONENTS
)
OTHER_LETTERS = dict.fromkeys(
    ("mathcal", "mathscr", "mathfrak", "mathbb", "mathsf", "mathtt", "hat", "widehat", "bar", "overline", "tilde"),
    _OTHER_LETTER,
)
MARKED = VECTORS | OTHER_LETTERS
_WORDS = FUNCTIONS | DERIVATIVE_NAMES | REFUSED.keys()


class LatexWords:
    """A place in the raw tokens, and what names can be read from there."""

    __slots__ = ("_names", "_place", "_raw")

    def __init__(self, raw: list[Raw], names: Names) -> None:
        self._raw = raw
        self._names = names
        self._place = 0

    @property
    def _ahead(self) -> Raw:
        return self._raw[self._place]

    def _take(self) -> Raw:
        raw = self._ahead
        if raw.kind != "end":
            self._place += 1
        return raw

    def _run(self, start: Raw) -> list[Raw]:
        """Pieces of one character that touch each other: a word or a number."""
        pieces = [start]
        for raw in self._raw[self._place + 1 : self._place + 1 + LIMITS.digits * 4]:
            plain = raw.kind in ("letter", "digit") or raw.is_character(".", "-", "+")
            if not plain or raw.space_before or raw.column != pieces[-1].column + 1:
                break
            pieces.append(raw)
        return pieces

    def _word(self) -> str:
        """A letter, or the whole word where it is declared or a function; the pieces are taken."""
        pieces = self._run(self._ahead)[: LIMITS.name_characters]
        length = next((k for k, piece in enumerate(pieces) if piece.kind == "character"), len(pieces))
        word = "".join(piece.text for piece in pieces[:length])
        for size in range(length, 1, -1):
            known = word[:size] in _WORDS and size == length
            if known or self._names.role(word[:size]) or self._names.derivative(word[:size]):
                self._place += size
                return word[:size]
        self._place += 1
        return word[0]

    def _with_subscript(self, name: str) -> str:
        if not self._ahead.is_character("_"):
            return name
        underscore = self._take()
        comma = self._raw[self._place + 1].is_character(",")
        subscript = self._name_part()
        if not subscript:
            derivative = f"write diff({name}(x), x) for a derivative"
            instead = derivative if comma else "write letters and digits, as in r_{1}"
            raise refusal("a subscript is not a word", underscore.column, instead)
        return f"{name}_{subscript}"

    def _name_part(self) -> str:
        """The letters, digits and Greek names of the next group or piece, '' if it holds anything else."""
        if not self._ahead.is_character("{"):
            raw = self._ahead
            if raw.kind == "digit":
                return self._digits()
            is_font = self._take().is_command(*FONTS) and self._ahead.is_character("{")
            return self._name_part() if is_font else self._plain_piece(raw)
        self._take()
        parts: list[str] = []
        while not self._ahead.is_character("}"):
            raw = self._take()
            part = self._name_part() if raw.is_command(*FONTS) and not parts else self._plain_piece(raw)
            if not part:
                return ""
            parts.append(part)
        self._take()
        return "".join(parts)

    def _digits(self) -> str:
        digits = ""
        while self._ahead.kind == "digit" and (not digits or not self._ahead.space_before):
            digits += self._take().text
        return digits

    def _plain_piece(self, raw: Raw) -> str:
        if raw.is_command(*MARKED):
            raise refusal(f"\\{raw.text} occurs", raw.column, MARKED[raw.text])
        if raw.kind == "command":
            return raw.text if self._names.role(raw.text) else LETTER_COMMANDS.get(raw.text, "")
        return raw.text if raw.kind in ("letter", "digit") else ""

    def _after_group(self, place: int) -> int:
        """The place after the { … } that begins at a place; the place itself where none begins."""
        depth = 0
        for end in range(place, len(self._raw)):
            depth += self._raw[end].is_character("{") - self._raw[end].is_character("}")
            if depth == 0:
                return end + (end > place)
        return place

    def _named_arguments(self, place: int) -> list[str]:
        r"""x, y of (x, y), \left(x, y\right) or this in braces at a place; [] where anything else stands there."""
        place += self._raw[place].is_character("{")
        left = self._raw[place].is_command("left")
        found: list[str] = []
        if not self._raw[place + left].is_character("("):
            return []
        for opening, raw in enumerate(self._raw[place + left + 1 : place + 2 * LIMITS.coordinates], place + left):
            if raw.is_character(")") or raw.is_command("right"):
                return found
            if self._raw[opening].is_character("(", ","):
                found.append(self._plain_piece(raw))
            elif not raw.is_character(","):
                return []
        return []

    def _derivative_part(self) -> tuple[str, int, int]:
        """(name, order, dots) of {d^k name}, {d name^k}, {d \\dot name}, ('', 0, 0) if it is not one."""
        if not self._take().is_character("{") or not self._differential():
            return "", 0, 0
        first = self._small_power()
        raw = self._take()
        dots = {"dot": 1, "ddot": 2}.get(raw.text, 0) if raw.kind == "command" else 0
        braces = dots and self._ahead.is_character("{")
        if dots:
            self._place += bool(braces)
            raw = self._take()
        if raw.kind == "letter":
            self._place -= 1
            name = self._with_subscript(self._word())
        else:
            plain = self._plain_piece(raw)
            name = self._with_subscript(plain) if plain else ""
        if braces and not self._take().is_character("}"):
            return "", 0, 0
        after = self._small_power()
        if after > 1 and not dots:
            instead = f"write \\frac{{d^2 {name}}}{{dt^2}} or \\left(\\frac{{d{name}}}{{dt}}\\right)^2"
            raise refusal("what is raised in a derivative is not clear", raw.column, instead)
        order = first * after
        if [piece.text for piece in self._raw[self._place : self._place + 3]] == ["(", "t", ")"]:
            self._place += 3
        return (name, order, dots) if self._take().is_character("}") else ("", 0, 0)

    def _variables_part(self) -> list[str]:
        """x, x for {dx^2} and {d x{\\left(t \\right)}^{2}}, y, x for {\\partial y \\partial x}; [] if it is none."""
        if not self._take().is_character("{"):
            return []
        found: list[str] = []
        while not self._ahead.is_character("}"):
            if not self._differential():
                return []
            braces = self._ahead.is_character("{")
            self._place += braces
            raw = self._take()
            self._place -= raw.kind == "letter"
            name = self._word() if raw.kind == "letter" else self._plain_piece(raw)
            if not name or (braces and not self._take().is_character("}")):
                return []
            name = self._with_subscript(name)
            self._place += time_argument(self._raw[self._place : self._place + 7])
            found += [name] * self._small_power()
        self._take()
        return found

    def _operator_part(self) -> int:
        """The k of {d^k}, 0 if it is not one."""
        if not self._take().is_character("{") or not self._differential():
            return 0
        order = self._small_power()
        return order if self._take().is_character("}") else 0

    def _differential(self) -> bool:
        raw = self._take()
        if raw.is_command("partial"):
            return True
        if raw.is_command(*FONTS):
            return self._name_part() == "d"
        return raw.kind == "letter" and raw.text == "d"

    def _small_power(self) -> int:
        if not self._ahead.is_character("^"):
            return 1
        self._take()
        digits = self._name_part()
        return int(digits) if digits.isdigit() and len(digits) == 1 else 0
