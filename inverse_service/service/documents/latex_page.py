"""A result as a LaTeX document that compiles by itself, long formulas broken into the lines of an article."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from inverse_service import __version__, errors
from inverse_service.expressions import functions, notation, printing
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import text_page

SIGNS = {"!=": r" \neq ", ">=": r" \geq ", "<=": r" \leq "}
IN_A_SENTENCE = 150.0  # points of a formula in a line of text
_AFTER_A_DISPLAY = re.compile(r"((?: \\end\{aligned\})? \\\])([.,:;]+)")
SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
}  # fmt: skip
# A line of an article is 345 points wide, in a list 320, less a quad. Widths are in points, about.
LINE = 300.0
_WIDTHS = {"\\left": 0.0, "\\right": 0.0, "\\quad": 10.0, "\\qquad": 20.0, "\\,": 2.0, "\\mathsf": 0.0, "\\mathrm": 0.0}
_LETTER, _SIGN, _SCRIPT = 5.8, 12.8, 0.72
_LESS = 0.95  # a part wider than this share of the whole is not broken again
_SIGNS = ("+", "-", "=", "<", ">", "\\neq", "\\geq", "\\leq")
_ACCENTS = ("\\dot", "\\ddot", "\\tilde", "\\bar")
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)


def latex_page(result: dict[str, Any], explain: bool, address: str = "") -> str:
    """The whole document, ending with a newline; `address` is that of the result, if it has one."""
    lines = [r"\documentclass{article}", r"\usepackage{amsmath,amssymb,url}", r"\sloppy", r"\begin{document}"]
    names, part = text_page.names_of(result["system"]), result.get("nonholonomic")
    if part:
        found = [display(f"{one['latex']} = 0") for one in part["constraints"]]
        lines += ["The Lagrangian and the constraints are", display(f"L = {part['lagrangian']['latex']}"), *found]
    lines += [_line(line, names) for line in text_page.outline(result, explain)]
    # The comma after a displayed formula belongs in its last line.
    whole = "\n".join([*lines, _source(result, address), r"\end{document}"])
    return _AFTER_A_DISPLAY.sub(r"\2\1", whole) + "\n"


def _source(result: Mapping[str, Any], address: str) -> str:
    """Which program in which version found it, and where it can be read again."""
    made = result.get("provenance") or {}
    program = escaped(f"{made.get('program', 'inverse-service')} {made.get('version', __version__)}")
    place = rf": \url{{{address}}}" if address else ""
    return rf"\paragraph{{}} Found by {program}{place}."


def _line(line: text_page.Line, names: Names) -> str:
    """A paragraph of words and formulas, or a displayed formula, and where it holds."""
    found, parts = [], line.parts
    for place, part in enumerate(parts):
        if place % 2 == 0:
            assert isinstance(part, str)
            ended = part.rstrip(")")[-1:] in ".:;?"
            alone = part and len(parts) == 1
            found.append(escaped(part[:1].upper() + part[1:] + "." * (not ended) if alone else part))
        else:
            before = str(parts[place - 1]).rstrip()
            is_below = before[-1:] in (".", "") and place == len(parts) - 1
            found.append((display if is_below else _formula)(_equation(part, names)))
    paragraph = (r"\par " + rf"\hspace*{{{line.depth - 1}em}}" * (line.depth > 1)) if parts and parts[0] else ""
    where = f"where {', '.join(_formula(latex_of(one, names)) for one in line.conditions)}." if line.conditions else ""
    return "\n".join(filter(None, (paragraph + "".join(found), where)))


def _equation(formula: text_page.Formula, names: Names) -> str:
    sides = formula if isinstance(formula, tuple) else (formula,)
    return " = ".join(
        latex_of(side, names) if isinstance(side, str) else side.get("latex") or latex_of(side["whole"], names)
        for side in sides
    )


def sentence(parts: Sequence[str], names: Names) -> str:
    """Words and formulas alternately, the formulas between dollar signs, one after the end of the sentence apart."""
    found = [f"${latex_of(part, names)}$" if place % 2 else part for place, part in enumerate(parts)]
    return "".join(f" {part}" if place and found[place - 1].endswith(".") else part for place, part in enumerate(found))


def conditions_latex(conditions: Sequence[str], system: Mapping[str, Any] | None) -> str:
    """Conditions such as "x != 0" as formulas in a sentence."""
    names = text_page.names_of(system)
    return ", ".join(_formula(latex_of(condition, names)) for condition in conditions)


def escaped(text: str) -> str:
    """Plain text with the characters that LaTeX gives a meaning made harmless."""
    return "".join(SPECIAL.get(character, character) for character in text)


def display(formula: str) -> str:
    """A displayed formula; a long one is on several lines."""
    lines = lines_of_latex(formula)
    if len(lines) == 1:
        return f"\\[ {formula} \\]"
    broken = r" \\ & \quad ".join(lines)
    return f"\\[ \\begin{{aligned}} & {broken} \\end{{aligned}} \\]"


def latex_of(text: str, names: Names) -> str:
    """The LaTeX of a formula of a sentence: relations between formulas of the system and terms of the theory."""
    sides = notation.split_outside(text, notation.SIDES)
    return "".join(SIGNS.get(sign.strip(), sign) + _side(side, names) for sign, side in sides)


def _side(text: str, names: Names) -> str:
    if text.startswith("∫ "):
        integrand, _, variable = text[2:].rpartition(" d")
        return rf"\int {latex_of(integrand, names)} \, d{latex_of(variable, names)}"
    try:
        return printing.to_latex(reader.read_formula(text, names))
    except errors.InputError:
        return _theory(text).strip()


def _theory(text: str) -> str:
    """The notation of the theory; dL/dx' is a fraction."""
    found, place = "", 0
    for match in notation.SLOPE.finditer(text):
        above, name, index, primes = match.groups()
        below = printing.name_latex(name, ("", "dot", "ddot")[len(primes)]) + (f"^{{{index}}}" if index else "")
        found += notation.to_latex(text[place : match.start()]) + rf"\frac{{\partial {above}}}{{\partial {below}}}"
        place = match.end()
    return found + notation.to_latex(text[place:])


def _formula(formula: str) -> str:
    """A formula in a sentence; one that is wider than a line is displayed."""
    return f"${formula}$" if len(lines_of_latex(formula, IN_A_SENTENCE)) == 1 else display(formula)


@dataclass(frozen=True, slots=True)
class _Piece:
    """An unbreakable piece of LaTeX: a token, or a command, bracket or script with its content."""

    text: str
    width: float
    head: str = ""
    inside: tuple[str, ...] = ()


def lines_of_latex(formula: str, room: float = LINE) -> list[str]:
    """The formula on lines not wider than `room`, broken before signs, also inside brackets and fractions.

    A bracket that spans lines is closed on each line by an invisible one; a fraction a/b becomes 1/b times (a).
    A part without a place to break is not broken.
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
            short = _width(lines[-1]) < room / 4  # H = is kept with the formula after it
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
    """A wide term on several lines, broken in its widest piece."""
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
    """A wide matrix: each entry on separate lines, after its indices."""
    for i, row in enumerate(matrix.split("\\\\"), start=1):
        for j, entry in enumerate(row.split("&"), start=1):
            first, *rest = lines_of_latex(entry.strip(), room - 6 * _LETTER)
            yield f"({i},{j})\\colon\\ {first}"
            yield from (f"\\quad {line}" for line in rest)


def _between_factors(term: Sequence[_Piece], room: float) -> list[str]:
    """A product on several lines, each except the first beginning with a dot."""
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
    """The place of the token that closes the one at `start`, or the end if there is none."""
    depth = 0
    for place in range(start, len(tokens)):
        depth += (tokens[place] == opening) - (tokens[place] == closing)
        if depth == 0:
            return place
    return len(tokens) - 2


def _argument(tokens: Sequence[str], start: int) -> tuple[str, int]:
    """The content of the braces there, or the single token, and the place after it."""
    while start < len(tokens) and not tokens[start].strip():
        start += 1
    if start >= len(tokens) or tokens[start] != "{":
        return "".join(tokens[start : start + 1]), start + 1
    end = _closing(tokens, start, "{", "}")
    return "".join(tokens[start + 1 : end]), end + 1
