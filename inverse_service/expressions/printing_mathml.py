"""Trees to presentation MathML, which today's browsers show without a script."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from inverse_service.expressions import functions, letters, printing_layout
from inverse_service.expressions import tree as ex

_NAMESPACE = "http://www.w3.org/1998/Math/MathML"
_TIMES = "<mo>&#x2062;</mo>"
# Of the font of the pages it is raised and small by itself: in a superscript it would be too small to be seen.
PRIME = '<mo lspace="0" rspace="0">&#x2032;</mo>'
_APPLY = "<mo>&#x2061;</mo>"
_DOTS = ("", "&#x02D9;", "&#x00A8;")


def to_mathml(expression: ex.Expression) -> str:
    """A complete <math> element; all text in it is escaped."""
    return f'<math xmlns="{_NAMESPACE}">{_row(expression, within=False)}</math>'


def _row(expression: ex.Expression, within: bool = True) -> str:
    pieces: list[str] = []
    for term in printing_layout.signed_terms(expression, within):
        if pieces or term.negative:
            pieces.append("<mo>&#x2212;</mo>" if term.negative else "<mo>+</mo>")
        pieces.append(_ratio(term))
    return f"<mrow>{''.join(pieces)}</mrow>"


def _ratio(term: printing_layout.Ratio) -> str:
    number, divisor = term.numbers
    if divisor == "1" and not term.denominators:
        return _factors(number, term.numerators)
    return f"<mfrac>{_alone(number, term.numerators)}{_alone(divisor, term.denominators)}</mfrac>"


def _alone(coefficient: str, factors: Sequence[ex.Expression]) -> str:
    if coefficient == "1" and len(factors) == 1:
        return _row(factors[0])
    return f"<mrow>{_factors(coefficient, factors)}</mrow>"


def _factors(coefficient: str, factors: Sequence[ex.Expression]) -> str:
    pieces = [f"<mn>{coefficient}</mn>"] if coefficient != "1" or not factors else []
    pieces += [_factor(factor) for factor in factors]
    joined = pieces[0]
    for piece in pieces[1:]:
        joined += ("<mo>&#x22C5;</mo>" if _begins_with_digit(piece) else _TIMES) + piece
    return joined


def _begins_with_digit(piece: str) -> bool:
    return piece.startswith(("<mn>", "<msup><mn>"))


def _factor(factor: ex.Expression) -> str:
    match factor:
        case ex.Power(base, exponent) if exponent != ex.HALF:
            inner = _brackets(base) if isinstance(base, ex.Apply) and base.function == "exp" else _atom(base)
            return _raised(inner, _exponent(exponent))
        case _:
            return _atom(factor)


def _raised(base: str, exponent: str) -> str:
    """An exponent stands above an index, and after a dotted letter as high as after one without dots."""
    low = base.replace("<mover ", '<mpadded height="1.2ex"><mover ', 1).replace("</mover>", "</mover></mpadded>", 1)
    if base.startswith("<msub>"):
        return f"<msubsup>{low.removeprefix('<msub>').removesuffix('</msub>')}{exponent}</msubsup>"
    return f"<msup>{low if base.startswith('<mover ') else base}{exponent}</msup>"


def _exponent(expression: ex.Expression) -> str:
    """t/10 stays on its line: a fraction above a letter is too small to be read."""
    term, *further = printing_layout.signed_terms(expression, within=True)
    simple = all(isinstance(part, ex.Symbol | ex.Velocity) for part in (*term.numerators, *term.denominators))
    number, divisor = term.numbers
    if further or not simple or (divisor != "1") + len(term.denominators) != 1:
        return _row(expression)
    sign = "<mo>&#x2212;</mo>" if term.negative else ""
    over, under = _factors(number, term.numerators), _factors(divisor, term.denominators)
    return f'<mrow>{sign}{over}<mo lspace="0" rspace="0">/</mo>{under}</mrow>'


def _atom(expression: ex.Expression) -> str:
    match expression:
        case ex.Number(value) if value >= 0 and value.denominator == 1:
            return f"<mn>{value}</mn>"
        case ex.Symbol(name):
            return _name(name, 0)
        case ex.Velocity(name):
            return _name(name, 1)
        case ex.Acceleration(name):
            return _name(name, 2)
        case ex.Apply("exp", argument):
            return f"<msup><mi>e</mi>{_exponent(argument)}</msup>"
        case ex.Apply(function, argument):
            row = functions.FUNCTION.get(function)
            name = escape((row.shown if row else "") or function)
            return f"<mrow><mi>{name}</mi>{_APPLY}{_brackets(argument)}</mrow>"
        case ex.Power(ex.Power(base, inner), exponent) if (inner, exponent) == (ex.TWO, ex.HALF):
            return f"<mrow><mo>|</mo>{_row(base)}<mo>|</mo></mrow>"
        case ex.Power(base, exponent) if exponent == ex.HALF:
            return f"<msqrt>{_row(base)}</msqrt>"
        case ex.Arbitrary():
            return _arbitrary(expression)
        case _:
            return _brackets(expression)


def _brackets(expression: ex.Expression) -> str:
    return f"<mrow><mo>(</mo>{_row(expression)}<mo>)</mo></mrow>"


def _name(name: str, order: int) -> str:
    parts = letters.written(name)
    body = f"<mi>{escape(letters.greek_letter(parts.body) or parts.body)}</mi>"
    if order:
        body = f'<mover accent="true">{body}<mo>{_DOTS[order]}</mo></mover>'
    if not parts.subscript:
        return body
    words = [f"<mn>{word}</mn>" if word.isdigit() else f"<mi>{_escaped(word)}</mi>" for word in parts.subscript]
    return f"<msub>{body}<mrow>{'<mo>,</mo>'.join(words)}</mrow></msub>"


def _escaped(word: str) -> str:
    return escape(letters.greek_letter(word) or word)


def _arbitrary(function: ex.Arbitrary) -> str:
    """The function with primes, or with the orders (1,0) above where it has several arguments."""
    name, orders = _name(function.name, 0), function.orders
    if any(orders):
        above = f"({','.join(map(str, orders))})"
        name = f"<mrow>{name}{PRIME * orders[0]}</mrow>" if len(orders) == 1 else f"<msup>{name}<mo>{above}</mo></msup>"
    arguments = "<mo>,</mo>".join(_row(argument) for argument in function.arguments)
    return f"<mrow>{name}{_APPLY}<mo>(</mo>{arguments}<mo>)</mo></mrow>"
