r"""The derivative as an operator D, and orders in brackets: tokens in, tokens out.

D^2 x, Dx, (D^2 + 2 D + 1) x, and (D + 1)(D + 2) x in a text with no other derivative; x^{(2)} and
y^{(2)}(x) of LaTeX.
"""

import itertools
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import NamedTuple

from inverse_service.reading import labels, tokens as tk
from inverse_service.reading.names import FUNCTIONS, GREEK_NAMES, Names, looks_like_a_coordinate
from inverse_service.reading.tokens import Line, Token, Tokens, at

_LETTER, _LETTER_WITH_INDICES = "D", frozenset(("D_t", "D_tt"))
_OTHER_OPERANDS = GREEK_NAMES | {"u", "v", "w", "f"}  # D_tt m may be m times D''
_VARIABLES = ("t", "x", "s", "tau", "r", "z")
_MOST_TERMS = 64  # of a product of operators
_DOTS = frozenset(("dot", "ddot", "dddot", "dv", "odv", "od", "partial", "pdv", "overset", "diff"))


class _Term(NamedTuple):
    """A term of an operator: coefficient times D to the order."""

    sign: str
    coefficient: Tokens
    order: int


def with_operator_letter(tokens: Tokens, names: Names) -> Tokens:
    """x'' and x' for the D^2 x and D x, or Dx, of a text whose every D is that operator, and
    x'' + 2 x' + x for (D^2 + 2 D + 1) x.
    """
    tokens = _with_letter_apart(tokens)
    words = {token.text for token in tk.walk(tokens)}
    if not _LETTER_WITH_INDICES.isdisjoint(words) and _has_operands(tokens, names):
        return _without_indices(tokens)
    if _LETTER not in words or names.role(_LETTER):
        return tokens
    others = (
        tk.moves(tokens) or words & (labels.DERIVATIVES - {_LETTER}) or words & {"dt", tk.TOTAL}
    )
    given = any(at(part, 1).is_operator("=") for part in tk.split_at(";,", tokens))
    second = {*_operands(tokens)}
    if not second or others or given:  # F = D^2 x
        return tokens
    read = _with_orders(tokens, second)
    return tokens if any(token.text == _LETTER for token in tk.walk(read)) else read


def _has_operands(tokens: Line, names: Names) -> bool:
    """Whether each D_tt and D_t of a text has a coordinate behind it, and no D has another use."""
    found = [
        (line[place].text, at(line, place + 1))
        for line, place, _ in tk.places(tokens)
        if line[place].text in (_LETTER, *_LETTER_WITH_INDICES)
    ]
    return all(
        text != _LETTER
        and names.role(text) is None
        and after.kind == "name"
        and not after.order
        and (looks_like_a_coordinate(after.text) or after.text in _OTHER_OPERANDS)
        for text, after in found
    )


def _without_indices(line: Line) -> Tokens:
    """x'' for D_tt x and x' for D_t x, in each bracket."""
    found: Tokens = []
    operator: Token | None = None
    for token in line:
        if token.text in _LETTER_WITH_INDICES:
            operator = token
            continue
        if operator is not None:
            order, column = operator.text.count("t"), operator.column
            token = replace(token, order=order, column=column)
        found.append(tk.within(token, _without_indices))
        operator = None
    return found


def _with_letter_apart(line: Line) -> Tokens:
    """m D^2 + c D for m D^2 + cD written without blanks, in a bracket."""
    found: Tokens = []
    for token in line:
        glued = [one for one in token.inside if _is_glued(one)]
        squared = any(
            _is_glued(one) and _times(token.inside, place + 1) == 2
            for place, one in enumerate(token.inside)
        )
        if glued and squared:
            parts = [[*_apart(one)] if _is_glued(one) else [one] for one in token.inside]
            token = replace(token, inside=tuple(itertools.chain.from_iterable(parts)))
        found.append(tk.within(token, _with_letter_apart))
    return found


def _is_glued(token: Token) -> bool:
    """Whether this is the mD of (mD^2 + cD + k) x."""
    name = token.kind == "name" and not token.order
    return name and len(token.text) == 2 and token.text[0].isalpha() and token.text[1] == _LETTER


def _apart(token: Token) -> Iterator[Token]:
    yield replace(token, text=token.text[0])
    yield replace(token, text=_LETTER, column=token.column + 1, space_before=False)


def _operands(tokens: Line) -> Iterator[str]:
    """The x of D^2 x and of (D^2 + 1) x."""
    for line, place, _ in tk.places(tokens):
        applied = _operator(line, place)
        if applied is not None and max(term.order for term in applied[0]) > 1:
            yield _operand(line[applied[1]]).text


def _operand(token: Token) -> Token:
    """The x of D^2 x and of D^2 (x)."""
    single = token.is_bracket() and len(token.inside) == 1 and not token.order
    return token.inside[0] if single else token


def _with_orders(line: Line, operands: Collection[str]) -> Tokens:
    found: Tokens = []
    place = 0
    while place < len(line):
        token, applied = line[place], _operator(line, place)
        if applied is not None and _operand(line[applied[1]]).text in operands:
            terms, after = applied
            found += _applied(terms, token, _operand(line[after]))
            place = after + 1
            continue
        rate = token.kind == "name" and token.text[:1] == _LETTER and token.text[1:] in operands
        found.append(
            _derivative(token, token.text[1:], 1)
            if rate
            else tk.within(token, lambda inside: _with_orders(inside, operands))
        )
        place += 1
    return found


def _operator(line: Line, place: int) -> tuple[list[_Term], int] | None:
    """The terms of the product of operators here, and the place of the name that it acts on."""
    terms = [_Term("+", [], 0)]
    begun = place
    while (factor := _factor(at(line, place))) is not None:
        after = tk.after_power(line, place + 1)
        times = _times(line, place + 1)
        for _ in range(times):
            terms = [
                _Term(
                    "+" if one.sign == other.sign else "-",
                    _product(one.coefficient, other.coefficient),
                    one.order + other.order,
                )
                for one, other in itertools.product(terms, factor)
            ]
        if not times or len(terms) > _MOST_TERMS:
            return None
        place = after
    operand = _operand(at(line, place))
    named = operand.kind == "name" and operand.text not in FUNCTIONS and not operand.order
    many = place > begun + 1 and any(_moves(term.coefficient, operand) for term in terms)
    return (terms, place) if named and place > begun and not many else None


def _moves(coefficient: Line, operand: Token) -> bool:
    """Whether a coefficient has a name that D may act on, as in (x D + 1)(x D + 2) y."""
    return bool({token.text for token in tk.walk(coefficient)} & {*_VARIABLES, operand.text})


def _times(line: Line, place: int) -> int:
    """The k of ^k here, 1 without an exponent, 0 for any other exponent."""
    if not at(line, place).is_operator("^"):
        return 1
    digits = tk.spelled(line[place + 1 : place + 2]).strip("()")
    return int(digits) if digits in ("1", "2", "3", "4") else 0


def _factor(token: Token) -> list[_Term] | None:
    """The terms of D or of a bracket with D in it; None for anything else."""
    if token.kind == "name" and token.text == _LETTER and not token.order:
        return [_Term("+", [], 1)]
    inside = token.inside if token.is_bracket() and not token.order and not token.value else ()
    if not any(one.text == _LETTER for one in inside):
        return None
    parts = tk.split(inside, lambda _, one: one.is_operator("+", "-"))
    signs = ["+", *(end.text for _, end in parts if end is not None)]
    signed = [(sign, part) for (part, _), sign in zip(parts, signs, strict=True)]
    terms = [_term(*one) for one in (signed if signed[0][1] else signed[1:])]  # (-D^2 + 1)
    return None if None in terms else [term for term in terms if term is not None]


def _term(sign: str, part: Tokens) -> _Term | None:
    """c D^k, D^k/c, or c; None for a term that has another form."""
    marks = [place for place, token in enumerate(part) if token.text == _LETTER]
    hidden = sum(token.text == _LETTER for token in tk.walk(part)) > len(marks)
    if not part or len(marks) > 1 or hidden or any(one.is_operator(",", "=") for one in part):
        return None
    if not marks:
        return _Term(sign, part, 0)
    order = _times(part, marks[0] + 1)
    before, after = part[: marks[0]], part[tk.after_power(part, marks[0] + 1) :]
    if before and before[-1].is_operator("*"):
        before = before[:-1]
    elif before and before[-1].kind == "operator":  # a/D
        return None
    if _moves(after, part[marks[0]]):  # D t
        return None
    if after and not before and after[0].is_operator("*"):
        after = after[1:]
    elif after and not before and after[0].is_operator("/"):
        before = [_number(1, part[0].column)]
    return _Term(sign, [*before, *after], order) if order else None


def _product(left: Tokens, right: Tokens) -> Tokens:
    if not left or not right:
        return left or right
    times = Token("operator", "*", right[0].column)
    return [tk.bracket(left, left[0]), times, tk.bracket(right, right[0])]


def _applied(terms: list[_Term], at_sign: Token, operand: Token) -> Tokens:
    """The sum of the terms, each with a derivative of the operand, as a bracket."""
    if [(term.sign, term.coefficient) for term in terms] == [("+", [])]:
        name = replace(operand, column=at_sign.column, space_before=at_sign.space_before)
        return [_derivative(name, operand.text, terms[0].order)]
    inside: Tokens = []
    for order in sorted({term.order for term in terms}, reverse=True):
        factors = _distinct([term for term in terms if term.order == order], at_sign)
        sign = factors[0].sign if len(factors) == 1 else "+"
        if inside or sign == "-":
            inside.append(Token("operator", sign, at_sign.column, True))
        inside += [*_coefficient(factors, at_sign), _derivative(operand, operand.text, order)]
    whole = tk.bracket(inside, at_sign, space=at_sign.space_before)
    return [replace(whole, end=operand.column)]


def _distinct(terms: Sequence[_Term], at_sign: Token) -> list[_Term]:
    """The terms of one order, with 2 a for a + a."""
    found: list[_Term] = []
    for (sign, shown), count in Counter((t.sign, tk.spelled(t.coefficient)) for t in terms).items():
        term = next(
            one for one in terms if (one.sign, tk.spelled(one.coefficient)) == (sign, shown)
        )
        number = [_number(count, at_sign.column)] * (count > 1)
        found.append(term._replace(coefficient=_product(number, term.coefficient)))
    return found


def _coefficient(terms: Sequence[_Term], at_sign: Token) -> Tokens:
    """The sum of the coefficients and a sign of multiplication; nothing for the one coefficient
    1.
    """
    if len(terms) == 1 and not terms[0].coefficient:
        return []
    found: Tokens = []
    for place, term in enumerate(terms):
        if place or (term.sign == "-" and len(terms) > 1):
            found.append(Token("operator", term.sign, at_sign.column, True))
        found += term.coefficient or [_number(1, at_sign.column)]
    return [tk.bracket(found, found[0]), Token("operator", "*", at_sign.column)]


def _number(value: int, column: int) -> Token:
    return Token("number", str(value), column, True, Fraction(value))


def _derivative(token: Token, name: str, order: int) -> Token:
    return replace(token, text=name, order=order, primed=token.column * (order > 0))


def with_raised_orders(line: Line) -> Tokens:
    r"""The tokens of LaTeX, before its commands are read, with primes for the ^{(2)} of x^{(2)}.

    It is the order of a derivative if the text has no dots, and no primes but beside y^{(2)}(x).
    """
    inside = [*tk.walk(line)]
    if any(token.text in _DOTS or token.text == "d" for token in inside):
        return [*line]
    return _with_primes(line, beside_primes=any(token.kind == "prime" for token in inside))


def _with_primes(line: Line, *, beside_primes: bool) -> Tokens:
    found: Tokens = []
    place = 0
    while place < len(line):
        order, base = _raised_order(line, place), at(found, len(found) - 1)
        called = at(line, place + 2).is_bracket("(")
        indexed = at(found, len(found) - 2).is_operator("_")
        named = base.kind in ("name", "command") or base.is_bracket("{") or indexed
        own = named and base.text not in FUNCTIONS | {"e", "E"}
        if order and own and (called or not beside_primes):
            sign = line[place]
            found.append(Token("prime", "'" * order, sign.column, value=Fraction(order)))
            place += 2
            continue
        inner = partial(_with_primes, beside_primes=beside_primes)
        found.append(tk.within(line[place], inner))
        place += 1
    return found


def _raised_order(line: Line, place: int) -> int:
    """The 2 of ^{(2)} here; 0 for anything else."""
    braces = at(line, place + 1)
    raised = at(line, place).is_operator("^") and braces.is_bracket("{") and len(braces.inside) == 1
    whole = braces.inside[0] if raised else braces
    one = whole.inside[0] if raised and whole.is_bracket("(") and len(whole.inside) == 1 else whole
    return int(one.text) if one is not whole and one.text in ("1", "2") else 0
