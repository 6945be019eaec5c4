"""Trees to LaTeX; the reader of `latex.py` takes it back, partial derivatives excepted. Long formulas are broken."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from inverse_service.expressions import functions, letters, printing_layout
from inverse_service.expressions import tree as ex

_WITHOUT_COMMAND = ("omicron", "Alpha", "Beta", "Epsilon", "Zeta", "Eta", "Iota", "Kappa", "Mu", "Nu", "Omicron")
_NO_COMMAND = frozenset((*_WITHOUT_COMMAND, "Rho", "Tau", "Chi"))


def to_latex(expression: ex.Expression, within: bool = False) -> str:
    """The formula in LaTeX, without delimiters."""
    return printing_layout.signed(expression, _ratio, within)


def _ratio(term: printing_layout.Ratio) -> str:
    number, divisor = term.numbers
    if divisor == "1" and not term.denominators:
        return _factors(number, term.numerators)
    return f"\\frac{{{_alone(number, term.numerators)}}}{{{_alone(divisor, term.denominators)}}}"


def _alone(coefficient: str, factors: Sequence[ex.Expression]) -> str:
    """Numerator or denominator: a single sum needs no brackets there."""
    if coefficient == "1" and len(factors) == 1:
        return to_latex(factors[0], within=True)
    return _factors(coefficient, factors)


def _factors(coefficient: str, factors: Sequence[ex.Expression]) -> str:
    pieces = [coefficient] if coefficient != "1" or not factors else []
    before: ex.Expression | None = None
    for factor in factors:
        piece = _factor(factor)
        if pieces and (piece[0].isdigit() or _looks_like_a_call(before, piece, factor)):
            piece = "\\cdot " + piece
        pieces.append(piece)
        before = factor
    return " ".join(pieces)


def _looks_like_a_call(before: ex.Expression | None, piece: str, factor: ex.Expression) -> bool:
    """Whether x (t + 1) would stand there, which could be x at another time."""
    return (
        piece.startswith("\\left(")
        and isinstance(before, ex.Symbol | ex.Velocity | ex.Acceleration)
        and ex.TIME in ex.walk(factor)
    )


def _factor(factor: ex.Expression) -> str:
    match factor:
        case ex.Power(ex.Apply(function, argument), ex.Number(value)) if (
            function != "exp" and value > 0 and value != ex.HALF.value
        ):
            return f"{_command(function)}^{{{to_latex(ex.Number(value))}}}{_brackets(argument)}"
        case ex.Power(base, exponent) if exponent != ex.HALF:
            return f"{_atom(base, raised=True)}^{{{to_latex(exponent, within=True)}}}"
        case _:
            return _atom(factor)


def _atom(expression: ex.Expression, raised: bool = False) -> str:
    match expression:
        case ex.Number(value) if value >= 0 and value.denominator == 1:
            return str(value)
        case ex.Symbol(name):
            return name_latex(name)
        case ex.Velocity(name):
            return name_latex(name, "dot")
        case ex.Acceleration(name):
            return name_latex(name, "ddot")
        case ex.Apply("exp", argument) if not raised and not isinstance(argument, ex.Number):
            return f"e^{{{to_latex(argument, within=True)}}}"
        case ex.Apply(function, argument) if function != "exp" or isinstance(argument, ex.Number):
            return f"{_command(function)}{_brackets(argument)}"
        case ex.Power(ex.Power(base, inner), exponent) if (inner, exponent) == (ex.TWO, ex.HALF):
            return f"\\left|{to_latex(base, within=True)}\\right|"
        case ex.Power(base, exponent) if exponent == ex.HALF:
            return f"\\sqrt{{{to_latex(base, within=True)}}}"
        case ex.Integral() if (known := expression.integrand) and not any(
            isinstance(n, ex.Apply) for n in ex.walk(known[1])
        ):
            slope, variable = known
            inside = to_latex(slope) if not isinstance(slope, ex.Sum) else _brackets(slope)
            return f"\\left(\\int {inside} \\, d{to_latex(variable)}\\right)"
        case ex.Arbitrary():
            return _arbitrary(expression)
        case _:
            return _brackets(expression)


def _brackets(expression: ex.Expression) -> str:
    return f"\\left({to_latex(expression, within=True)}\\right)"


def _command(function: str) -> str:
    row = functions.FUNCTION.get(function)
    return (row.command if row else "") or f"\\operatorname{{{function}}}"


def name_latex(name: str, accent: str = "") -> str:
    r"""r1 as r_{1}, phi as \phi, x_left as x_{\mathrm{left}}; `accent` goes over the body."""
    parts = letters.written(name)
    body = _word(parts.body)
    if accent:
        body = f"\\{accent}{{{body}}}"
    subscript = ",".join(_word(word) for word in parts.subscript)
    return f"{body}_{{{subscript}}}" if subscript else body


def _word(word: str) -> str:
    if letters.greek_letter(word) and word not in _NO_COMMAND:
        return f"\\{word}"
    return word if len(word) == 1 or word.isdigit() else f"\\mathrm{{{word}}}"


def _arbitrary(function: ex.Arbitrary) -> str:
    arguments = ", ".join(to_latex(argument, within=True) for argument in function.arguments)
    name, orders = name_latex(function.name), function.orders
    if not any(orders):
        return f"{name}\\left({arguments}\\right)"
    if len(orders) == 1:
        mark = "'" * orders[0] if orders[0] <= 3 else f"^{{({orders[0]})}}"
    elif printing_layout.has_plain_arguments(function):
        return f"{_partial(name, function)}\\left({arguments}\\right)"
    else:
        mark = f"^{{({','.join(map(str, orders))})}}"
    return f"{name}{mark}\\left({arguments}\\right)"


def _partial(name: str, function: ex.Arbitrary) -> str:
    counts = Counter(to_latex(variable) for variable in printing_layout.variables(function))
    total = sum(counts.values())
    order = f"^{{{total}}}" if total > 1 else ""
    below = " ".join(f"\\partial {u}" + (f"^{{{k}}}" if k > 1 else "") for u, k in counts.items())
    return f"\\frac{{\\partial{order} {name}}}{{{below}}}"


# A line of an article is 345 points wide, in a list 320, less a quad. Widths are in points, about.
LINE = 300.0
_WIDTHS = {"\\left": 0.0, "\\right": 0.0, "\\quad": 10.0, "\\qquad": 20.0, "\\,": 2.0, "\\mathsf": 0.0, "\\mathrm": 0.0}
_LETTER, _SIGN, _SCRIPT = 5.8, 12.8, 0.72
_LESS = 0.95  # a part that is not narrower than this share of the whole is not broken again
_SIGNS = ("+", "-", "=", "<", ">", "\\neq", "\\geq", "\\leq")
_ACCENTS = ("\\dot", "\\ddot", "\\tilde", "\\bar")
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)


@dataclass(frozen=True, slots=True)
class _Piece:
    """A stretch of LaTeX that stands together: a token, or a command, bracket or script with what is in it."""

    text: str
    width: float
    head: str = ""
    inside: tuple[str, ...] = ()


def lines_of_latex(formula: str, room: float = LINE) -> list[str]:
    """The formula on lines that are no wider than `room`, broken before signs, also inside brackets and fractions.

    Brackets that go over lines end each with an invisible one; the fraction a/b becomes 1/b times the bracket (a).
    What offers no place to break stays whole.
    """
    pieces = _pieces(formula)
    if _width(pieces) <= room:
        return [formula]
    lines: list[list[_Piece]] = [[]]
    for term in _terms(pieces):
        joined = [*lines[-1], *term]
        if _width(joined) <= room:
            lines[-1] = joined
        elif _width(term) <= room:
            lines.append(term)
        else:
            short = _width(lines[-1]) < room / 4  # H = stays with what follows
            lines = lines[:-1] if short else lines
            for line in map(_pieces, _opened(joined if short else term, room)):
                narrower = _width(line) < _LESS * _width(term)
                lines += map(_pieces, lines_of_latex(_text(line), room)) if narrower else [line]
    return [text for line in lines if (text := _text(line).strip())]


def _text(pieces: Iterable[_Piece]) -> str:
    return "".join(piece.text for piece in pieces)


def _width(pieces: Iterable[_Piece]) -> float:
    return sum(piece.width for piece in pieces)


def _terms(pieces: Sequence[_Piece]) -> Iterator[list[_Piece]]:
    """The pieces up to each sign that has something before it."""
    term: list[_Piece] = []
    for piece in pieces:
        if piece.text in _SIGNS and any(part.text.strip() and part.text not in _SIGNS for part in term):
            yield term
            term = []
        term.append(piece)
    yield term


def _opened(term: Sequence[_Piece], room: float) -> list[str]:
    """A term that is too wide on several lines, by way of its widest piece."""
    place = max(range(len(term)), key=lambda k: term[k].width)
    widest, before, after = term[place], _text(term[:place]), _text(term[place + 1 :])
    match widest.head:
        case "\\left":
            opening, inner, closing = widest.inside
            rows = lines_of_latex(inner, max(room / 2, room - _width(term[:place]) - 2 * _LETTER))
            if len(rows) > 1:
                body = " \\right.\n\\left. \\quad ".join(rows)
                return f"{before}\\left{opening}{body}\\right{closing}{after}".split("\n")
        case "\\frac":
            over, under = widest.inside
            above = "" if over == "1" else f"\\left({over}\\right)"
            quotient = f"\\frac{{1}}{{{under}}} {above}"
            if not above or _width(_pieces(under)) > room / 2:
                quotient = f"{above} \\left({under}\\right)^{{-1}}"
            return lines_of_latex(f"{before}{quotient}{after}", room)
        case "\\begin" if _SCRIPT * widest.width < room:
            small = f"\\left(\\begin{{smallmatrix}}{widest.inside[0]}\\end{{smallmatrix}}\\right)"
            return [f"{before}{small}{after}"]
        case "\\begin":
            return [before, *_entries(widest.inside[0], room), after]
        case "\\sqrt":
            return lines_of_latex(f"{before}\\left({widest.inside[0]}\\right)^{{1/2}}{after}", room)
        case "^" if before.rstrip().endswith("e") and widest.width > room / 2:
            return lines_of_latex(f"{before.rstrip()[:-1]}\\exp\\left({widest.inside[0]}\\right){after}", room)
    return _between_factors(term, room)


def _entries(matrix: str, room: float) -> Iterator[str]:
    """A matrix that is too wide: each entry on lines of its own, its place before it."""
    for i, row in enumerate(matrix.split("\\\\"), start=1):
        for j, entry in enumerate(row.split("&"), start=1):
            first, *rest = lines_of_latex(entry.strip(), room - 6 * _LETTER)
            yield f"({i},{j})\\colon\\ {first}"
            yield from (f"\\quad {line}" for line in rest)


def _between_factors(term: Sequence[_Piece], room: float) -> list[str]:
    """A product on several lines, each but the first begun with a dot."""
    lines: list[list[_Piece]] = [[]]
    for piece in term:
        stands = piece.text.strip() and piece.head not in ("^", "_") and piece.text not in (*_SIGNS, ",")
        if stands and any(part.head for part in lines[-1]) and _width(lines[-1]) + piece.width > room:
            lines.append([])
        lines[-1].append(piece)
    return [f"\\cdot {_text(line)}" if k else _text(line) for k, line in enumerate(lines)]


def _pieces(formula: str) -> list[_Piece]:
    tokens = _TOKEN.findall(formula)
    found, place = [], 0
    while place < len(tokens):
        piece, place = _piece(tokens, place)
        found.append(piece)
    return found


def _piece(tokens: Sequence[str], start: int) -> tuple[_Piece, int]:
    """The piece that begins at a token, and where the next begins."""
    token = tokens[start]
    match token:
        case "\\left":
            end = _closing(tokens, start, "\\left", "\\right")
            inner = "".join(tokens[start + 2 : end])
            text = "".join(tokens[start : end + 2])
            return _Piece(
                text, _width(_pieces(inner)) + 10, token, (tokens[start + 1], inner, tokens[end + 1])
            ), end + 2
        case "\\begin":
            end = _closing(tokens, start, "\\begin", "\\end")
            (name, first), (_, after) = _argument(tokens, start + 1), _argument(tokens, end + 1)
            inner = "".join(tokens[first:end])
            columns = zip_longest(*(row.split("&") for row in inner.split("\\\\")), fillvalue="")
            width = sum(max(_width(_pieces(entry)) for entry in column) + 10 for column in columns)
            width *= _SCRIPT if name == "smallmatrix" else 1
            return _Piece("".join(tokens[start:after]), width, token, (inner,)), after
        case "\\frac" | "\\tfrac":
            over, middle = _argument(tokens, start + 1)
            under, after = _argument(tokens, middle)
            width = max(_width(_pieces(over)), _width(_pieces(under))) * (1 if token == "\\frac" else _SCRIPT) + 2.4
            return _Piece("".join(tokens[start:after]), width, "\\frac", (over, under)), after
        case "^" | "_" | "\\sqrt" | "{":
            inner, after = _argument(tokens, start + (token != "{"))
            width = _width(_pieces(inner))
            width = width * _SCRIPT if token in ("^", "_") else width + 8 * (token == "\\sqrt")
            return _Piece("".join(tokens[start:after]), width, token, (inner,)), after
    return _Piece(token, _token_width(token)), start + 1


def _token_width(token: str) -> float:
    if token in _WIDTHS or not token.strip() or token in _ACCENTS:
        return _WIDTHS.get(token, 0.0)
    if token in _SIGNS or token == "\\cdot":
        return _SIGN
    row = next((row for row in functions.FUNCTION.values() if row.command == token), None)
    return _LETTER * (len(token) - 1) if row else _LETTER


def _closing(tokens: Sequence[str], start: int, opening: str, closing: str) -> int:
    """The place of the token that closes the one at `start`; the end where nothing does."""
    depth = 0
    for place in range(start, len(tokens)):
        depth += (tokens[place] == opening) - (tokens[place] == closing)
        if depth == 0:
            return place
    return len(tokens) - 2


def _argument(tokens: Sequence[str], start: int) -> tuple[str, int]:
    """What is in the braces there, or the one token, and where the next begins."""
    while start < len(tokens) and not tokens[start].strip():
        start += 1
    if start >= len(tokens) or tokens[start] != "{":
        return "".join(tokens[start : start + 1]), start + 1
    end = _closing(tokens, start, "{", "}")
    return "".join(tokens[start + 1 : end]), end + 1
