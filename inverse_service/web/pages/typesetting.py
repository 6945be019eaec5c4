"""Texts of results as typeset HTML: formulas, conditions, matrices.

What cannot be read is shown as it is written; nothing is left out.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from markupsafe import Markup, escape

from inverse_service import errors
from inverse_service.expressions import notation, printing, tree as ex
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import sheets, stated

# Beyond this a formula is read as text, in a box that scrolls.
MAX_CHARACTERS = 4_000
UNBROKEN = 48
WIDE = 56  # characters, of names two at most, that a line of the page has room for
_DIVISOR = 36  # the same below a fraction line, next to the left side of an equation, on a phone
SIGNS = {"-": "\u2212", "!=": "≠", ">=": "≥", "<=": "≤"}
RELATIONS = ("!=", ">=", "<=", "=", ">", "<")
_SIGNS = " (?:[-+=<>]|!=|>=|<=) "  # the printer writes signs with spaces
_RELATION = re.compile(r" (!=|>=|<=|=|>|<) ")
_LONG_NAME = re.compile(r"(?<=[A-Za-z_]{2})[A-Za-z_]+")
_DECIMAL = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.])")
_FENCE = re.compile(r"<mo>[()]</mo>")
_TALL = re.compile(r"<(?:mfrac|msqrt|mtable)")
# The start of a letter that reaches as high as the dots of a derivative, and those dots.
_DOTTED = re.compile(
    r'<mover accent="true"(?=>(?:<m[a-z]+>)*<mi[^>]*>[bdfhkltA-Z\u03b2\u03b4\u03b6\u03b8\u03bb\u03be\u03d1])'
)
# An invisible product sign with a little room, so that R sin x does not read Rsin x.
_OPEN, _CLOSE = '<mo stretchy="false">(</mo>', '<mo stretchy="false">)</mo>'
THIN_TIMES = '<mo lspace="0.08em" rspace="0.08em">&#x2062;</mo>'


@contextmanager
def _as_typed(text: str) -> Iterator[None]:
    """Within, what is printed has the decimal numbers and the order of the text: 9.81 stays 9.81,
    not 981/100.
    """
    typed = frozenset(map(Fraction, _DECIMAL.findall(text)))
    with printing.with_decimals(typed), printing.in_given_order():
        yield


def inner_mathml(text: str, names: nm.Names) -> str | None:
    """The MathML of a formula without <math> around it; None if it cannot be parsed."""
    if len(text) > MAX_CHARACTERS:
        return None
    try:
        with _as_typed(text):
            found = printing.to_mathml(reader.read_formula(text, names))
    except errors.InputError:
        return None
    return spaced(found.partition(">")[2].removesuffix("</math>"))


def spaced(mathml: str) -> str:
    """With room between factors and between tall letters and the dots above them, and with low brackets."""
    return _DOTTED.sub(
        r'\g<0> class="tall"', low_fences(mathml).replace("<mo>&#x2062;</mo>", THIN_TIMES)
    )


def math(inner: str, display: bool = False) -> Markup:
    """A <math> element of our own MathML."""
    shown = ' display="block"' if display else ""
    return Markup(f"<math{shown}>{inner}</math>")


def formula(text: str, names: nm.Names) -> Markup:
    """A formula or a relation such as "x' != 0"; a long one may be broken between its terms."""
    found = _breakable(text, names)
    return found if found is not None else code(text)


def equation(letter: str, text: str, names: nm.Names) -> Markup:
    """A formula with "L =" in front."""
    found = _breakable(text, names)
    if found is None:
        return code(f"{letter} = {text}")
    left = inner_mathml(letter, names) or _theory(letter)
    return math(f"<mrow>{left}<mo>=</mo></mrow>") + found


def said(
    sentence: sheets.Sentence | sheets.Formula | sheets.Word, address_of: Callable[[Any], str] = str
) -> Markup:
    """A sentence of a sheet, or a piece of one; `address_of` gives the address of a question, empty for none."""
    if isinstance(sentence, tuple):
        return Markup("").join(
            escape(one) if isinstance(one, str) else said(one, address_of) for one in sentence
        )
    if isinstance(sentence, sheets.Word):
        if not sentence.verdict:
            return _link(sentence, address_of)
        return Markup('<span class="{}">{}</span>').format(sentence.verdict, sentence.words)
    text, names = sentence.text, sentence.names
    if sentence.kind == "matrix":
        left = (
            f"{spaced(_theory(sentence.letter))}<mo>=</mo>"
            if sentence.letter and text
            else _theory(sentence.letter)
        )
        return math(f"<mrow>{left}{_side_mathml(text, names)}</mrow>", display=bool(text))
    if sentence.kind:
        found = proposition(sentence.whole, names)
        return (
            Markup('<span class="display">{}</span>').format(found)
            if sentence.kind == "display"
            else found
        )
    return equation(sentence.letter, text, names) if sentence.letter else formula(text, names)


def _link(word: sheets.Word, address_of: Callable[[Any], str]) -> Markup:
    """Words that lead to a part of the page, or a sentence that leads to a question."""
    if isinstance(word.target, str):
        return (
            Markup('<a href="{}">{}</a>').format(word.target, word.words)
            if word.target
            else Markup("")
        )
    address = address_of(word.target)
    return Markup(' <a href="{}">{}</a>.').format(address, word.words) if address else Markup("")


def _breakable(text: str, names: nm.Names) -> Markup | None:
    """A short formula as one <math>; a long one with each term in its own, so that lines can end between them."""
    if len(text) <= UNBROKEN:
        found = _relation(text, names)
        return None if found is None else math(found)
    parts = _terms(text, names)
    return (
        None if parts is None else Markup(" ").join(math(f"<mrow>{part}</mrow>") for part in parts)
    )


def _terms(text: str, names: nm.Names) -> list[str] | None:
    """The MathML of each term with its sign; None if one cannot be parsed."""
    found: list[str] = []
    for sign, term in notation.split_outside(text, _SIGNS):
        pieces = _pieces(term, names)
        if pieces is None:
            return None
        sign = sign.strip()
        lead = f'<mo form="infix">{escape(SIGNS.get(sign, sign))}</mo>' if sign else ""
        left = (
            found.pop() if sign in RELATIONS and len(found) == 1 else ""
        )  # no line ends behind the left side
        found += [left + lead + pieces[0], *pieces[1:]]
    return found


def _pieces(term: str, names: nm.Names) -> list[str] | None:
    """The MathML of a term, in pieces between which a line may end where it is too wide for one.

    The longest sum among its factors is in brackets, term by term; a divisor that is too wide is in
    brackets behind a slash. None if the term cannot be parsed.
    """
    inner = inner_mathml(term, names) if term else ""
    if inner is None or _width(term) <= WIDE:
        return None if inner is None else [inner]
    with _as_typed(term):
        return _over_lines(printing.ratio(reader.read_formula(term, names)), names)


def _over_lines(parts: printing.Ratio, names: nm.Names) -> list[str]:
    """The MathML of a product that is too wide for a line."""
    sign = ex.MINUS_ONE if parts.negative else ex.ONE
    above = ex.multiply(sign, ex.number(parts.over), *parts.numerators)
    below = ex.multiply(ex.number(parts.under), *parts.denominators)
    if _width(printing.to_text(below)) <= _DIVISOR:
        return _bracketed(ex.multiply(above, below**-1), names)
    divisor = _bracketed(below, names)
    if isinstance(below, ex.Product):
        divisor = [_OPEN + divisor[0], *divisor[1:]]
        divisor[-1] += _CLOSE
    return [*_bracketed(above, names), "<mo>/</mo>" + divisor[0], *divisor[1:]]


def _bracketed(tree: ex.Expression, names: nm.Names) -> list[str]:
    """The MathML of a product, term by term the longest sum among its factors, or a power of one,
    where that is wide.
    """
    factors = ex.factors_of(tree)
    widest = max(factors, key=lambda factor: ex.node_count(_base(factor) or ex.ONE))
    base = _base(widest)
    if base is None or _width(written := printing.to_text(base)) <= WIDE // 2:
        return [inner_mathml(printing.to_text(tree), names) or ""]
    pieces = _terms(written, names) or [""]
    pieces[0] = _OPEN + pieces[0]
    exponent = "" if widest is base else str(ex.powers_of(widest)[0][1])
    pieces[-1] += f"<msup>{_CLOSE}<mn>{exponent}</mn></msup>" if exponent else _CLOSE
    if len(factors) == 1:
        return pieces
    outside = printing.to_text(ex.multiply(*(factor for factor in factors if factor is not widest)))
    before, first = inner_mathml(outside, names) or "", printing.to_text(base.terms[0])
    is_wide = _width(outside) + _width(first) > WIDE
    return [before, *pieces] if is_wide else [before + pieces[0], *pieces[1:]]


def _base(factor: ex.Expression) -> ex.Sum | None:
    """The sum that the factor is, or is an integer power of."""
    match factor:
        case ex.Sum():
            return factor
        case ex.Power(ex.Sum() as base, ex.Number(value)) if value.denominator == 1 and value > 1:
            return base
    return None


def _width(text: str) -> int:
    return len(_LONG_NAME.sub("", text))


def code(text: str) -> Markup:
    """A text that is not typeset."""
    return Markup("<code>{}</code>").format(text)


def _relation(text: str, names: nm.Names) -> str | None:
    sides = _RELATION.split(text)
    parts: list[str] = []
    for place, side in enumerate(sides):
        found = (
            f"<mo>{escape(SIGNS.get(side, side))}</mo>" if place % 2 else inner_mathml(side, names)
        )
        if found is None:
            return None
        parts.append(found)
    return f"<mrow>{''.join(parts)}</mrow>"


def of_theory(text: str) -> Markup:
    """A formula of the theory, in its own notation."""
    return math(spaced(_theory(text)))


def proposition(text: str, names: nm.Names) -> Markup:
    """A formula of a proof: relations between formulas of the system, matrices, and terms of the theory."""
    if len(text) > MAX_CHARACTERS:
        return code(text)
    pieces = []
    for sign, side in notation.split_outside(text, notation.SIDES):
        pieces += [f"<mo>{escape(SIGNS.get(sign.strip(), sign.strip()))}</mo>"] * bool(sign)
        pieces.append(_side_mathml(side.strip(), names))
    return math(f"<mrow>{''.join(pieces)}</mrow>")


def _side_mathml(side: str, names: nm.Names) -> str:
    if side.startswith("\u222b "):
        integrand, _, by = side[2:].rpartition(" d")
        inner = _side_mathml(integrand, names) + "<mi>d</mi>" + _side_mathml(by, names)
        return f"<mo>\u222b</mo>{inner}"
    if side.startswith("[[") and side.endswith("]]"):
        rows = [row.strip()[1:-1] for _, row in notation.split_outside(side[1:-1], ",")]
        found = matrix_inner(
            [[entry for _, entry in notation.split_outside(row, ",")] for row in rows], names
        )
        if found is not None:
            return found
    return (inner_mathml(side, names) or spaced(_theory(side))) if side else ""


def _theory(text: str) -> str:
    """The notation of the theory; dL/dx' is a fraction."""
    text = notation.BRACKETED.sub(r"\1", text)
    found: list[str] = []
    place = 0
    for match in notation.SLOPE.finditer(text):
        found.append(_between(found, text[place : match.start()]))
        dots = f"<mo>{('', '&#x02D9;', '&#x00A8;')[len(match[4])]}</mo>"
        below = f"<mi>{escape(printing.displayed_name(match[2]))}</mi>"
        below = f'<mover accent="true">{below}{dots}</mover>' if match[4] else below
        below = f"<msup>{below}<mi>{match[3]}</mi></msup>" if match[3] else below
        found.append(
            f"<mfrac><mrow><mi>∂</mi><mi>{match[1]}</mi></mrow><mrow><mi>∂</mi>{below}</mrow></mfrac>"
        )
        place = match.end()
    return f"<mrow>{''.join(found)}{_between(found, text[place:])}</mrow>"


def _between(before: Sequence[str], text: str) -> str:
    """What is between fractions: after one a minus is a difference, and before one d/dt has a little room."""
    if not text.strip():
        return ""
    found = notation.to_mathml(text)
    found = found.replace("<msup><mi>d</mi><mrow><mn>2", "<msup><mi>∂</mi><mrow><mn>2")
    found = found.replace("<mn>1</mn><mo>/</mo><mn>2</mn>", "<mfrac><mn>1</mn><mn>2</mn></mfrac>")
    found = (
        found.replace('<mo form="prefix">', "<mo>", 1)
        if before and found.startswith("<mo form")
        else found
    )
    return found + '<mspace width="0.17em"/>' if found.endswith("</mfrac>") else found


def matrix_inner(rows: Sequence[Sequence[str]], names: nm.Names) -> str | None:
    """The MathML of a matrix in round brackets; None if an entry cannot be parsed."""
    entries = [[inner_mathml(entry, names) for entry in row] for row in rows]
    if any(entry is None for row in entries for entry in row):
        return None
    body = "".join(
        f"<mtr>{''.join(f'<mtd>{entry}</mtd>' for entry in row)}</mtr>" for row in entries
    )
    return f"<mrow><mo>(</mo><mtable>{body}</mtable><mo>)</mo></mrow>"


def low_fences(mathml: str) -> str:
    """Brackets around nothing tall do not stretch: stretched ones are set with gaps around them."""
    found: list[tuple[int, int]] = []
    low: list[int] = []
    for match in _FENCE.finditer(mathml):
        if match.group() == "<mo>(</mo>":
            found.append((match.start(), match.end()))
        elif found:
            start, end = found.pop()
            if not _TALL.search(mathml, end, match.start()):
                low += [start, match.start()]
    for place in sorted(low, reverse=True):
        mathml = mathml[:place] + '<mo stretchy="false">' + mathml[place + 4 :]
    return mathml


def formulas_of(system: Mapping[str, Any]) -> tuple[Markup, ...]:
    """The definition of a system: L and the constraints, or its solved equations."""
    names = stated.names_of(system)
    found = [equation("L", system["lagrangian"], names)] if system.get("lagrangian") else []
    constraints, equations = system.get("constraints") or (), system.get("equations")
    lines = [
        f"{text} = 0" for text in ([constraints] if isinstance(constraints, str) else constraints)
    ]
    lines += (
        [f"{name}'' = {text}" for name, text in equations.items()]
        if isinstance(equations, dict)
        else []
    )
    return (*found, *(formula(line, names) for line in lines))
