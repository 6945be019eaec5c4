"""A result as a LaTeX document that compiles by itself, long formulas broken into the lines of an article."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from inverse_service import __version__, errors
from inverse_service.expressions import notation, printing
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import sheets, text_page

SIGNS = {"!=": r" \neq ", ">=": r" \geq ", "<=": r" \leq "}
_AFTER_A_DISPLAY = re.compile(r"((?: \\end\{aligned\})? \\\])([.,:;]+)")
SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"}, "\u2192": r"$\to$", "\u03c4": r"$\tau$",
}  # fmt: skip
# Letters of a formula on a line of an article, about and at least, and in a line of text.
LINE, SURELY_ON_A_LINE, IN_A_SENTENCE = 60, 40, 28
_LETTER = re.compile(r"\\(?!left|right|[dt]?frac|sqrt|d?dot\b|math|quad)[A-Za-z]+|(?<!\\)\b[A-Za-z]|[^\sA-Za-z\\{}^_,]")
_SIGN = r" (?:[-+=<>]|\\(?:neq|geq|leq)) "
_BRACKET = re.compile(r"\\left|\\right|[{}]")
# Shrinks a formula that is wider than the line.
_FIT = r"""\newsavebox{\wide}
\newcommand{\fit}[1]{\sbox{\wide}{$\displaystyle #1$}%
  \ifdim\wd\wide>0.94\linewidth\resizebox{0.94\linewidth}{!}{\usebox{\wide}}\else\usebox{\wide}\fi}"""


def latex_page(result: dict[str, Any], explain: bool, address: str = "") -> str:
    """The whole document, ending with a newline; `address` is that of the result, if it has one."""
    lines = [r"\documentclass{article}", r"\usepackage{amsmath,amssymb,graphicx,url}", r"\sloppy"]
    lines += [_FIT, r"\begin{document}"]
    lines += [_line(line) for line in text_page.outline(result, explain)]
    # The comma after a displayed formula belongs in its last line.
    whole = "\n".join([*lines, _source(result, address), r"\end{document}"])
    return _AFTER_A_DISPLAY.sub(r"\2\1", whole) + "\n"


def _source(result: Mapping[str, Any], address: str) -> str:
    """Which program in which version found it, and where it can be read again."""
    made = result.get("provenance") or {}
    program = escaped(f"{made.get('program', 'inverse-service')} {made.get('version', __version__)}")
    place = rf": \url{{{address}}}" if address else ""
    return rf"\paragraph{{}} Found by {program}{place}."


def _line(line: text_page.Line) -> str:
    """A paragraph of words and formulas, or a displayed formula."""
    if len(line.said) == 1 and isinstance(line.said[0], sheets.Formula):
        return display(_whole(line.said[0]))
    indent = rf"\hspace*{{{line.depth - 1}em}}" * (line.depth > 1)
    return rf"\par {indent}{sentence(line.said)}" if line.said else ""


def sentence(said: sheets.Sentence, inline: bool = False) -> str:
    """Words and formulas; those that are long or apart are displayed unless all are to be `inline`."""
    found: list[str] = []
    for piece in said:
        if isinstance(piece, sheets.Formula):
            is_apart = piece.kind == "display" or _length(_whole(piece)) > IN_A_SENTENCE
            before = " " if found and found[-1].endswith(".") else ""
            found.append(display(_whole(piece)) if is_apart and not inline else f"{before}${_whole(piece)}$")
        elif isinstance(piece, str):
            found.append(piece if inline else escaped(piece))
        elif not isinstance(piece.target, Mapping):
            found.append(escaped(piece.words))
    return "".join(found)


def _whole(formula: sheets.Formula) -> str:
    symbol = _theory(formula.letter).strip() if formula.kind == "matrix" else latex_of(formula.letter, formula.names)
    return " = ".join(filter(None, (symbol, formula.latex or latex_of(formula.text, formula.names))))


def conditions_latex(conditions: Sequence[str], system: Mapping[str, Any] | None) -> str:
    """Conditions such as "x != 0" as formulas in a sentence."""
    names = sheets.names_of(system)
    return ", ".join(f"${latex_of(condition, names)}$" for condition in conditions)


def escaped(text: str) -> str:
    """Plain text with the characters that LaTeX gives a meaning made harmless."""
    return "".join(SPECIAL.get(character, character) for character in text)


def latex_of(text: str, names: Names) -> str:
    """The LaTeX of a formula of a sentence: relations between formulas of the system and terms of the theory."""
    sides = notation.split_outside(text, notation.SIDES)
    return "".join(SIGNS.get(sign.strip(), sign) + _side(side, names) for sign, side in sides)


def _side(text: str, names: Names) -> str:
    if text.startswith("[[") and text.endswith("]]"):
        rows = (row.strip()[1:-1] for _, row in notation.split_outside(text[1:-1], ","))
        entries = ((latex_of(entry.strip(), names) for _, entry in notation.split_outside(row, ",")) for row in rows)
        body = r" \\ ".join(map(" & ".join, entries))
        return rf"{{\begin{{pmatrix}}{body}\end{{pmatrix}}}}"
    if text.startswith("∫ "):
        integrand, _, variable = text[2:].rpartition(" d")
        return rf"\int {latex_of(integrand, names)} \, d{latex_of(variable, names)}"
    try:
        return printing.to_latex(reader.read_formula(text, names))
    except errors.InputError:
        return _theory(text).strip()


def _theory(text: str) -> str:
    """The notation of the theory; dL/dx' is a fraction."""
    text, found, place = notation.BRACKETED.sub(r"\1", text), "", 0
    for match in notation.SLOPE.finditer(text):
        above, name, index, primes = match.groups()
        below = printing.name_latex(name, ("", "dot", "ddot")[len(primes)]) + (f"^{{{index}}}" if index else "")
        found += notation.to_latex(text[place : match.start()]) + rf"\frac{{\partial {above}}}{{\partial {below}}}"
        place = match.end()
    return found + notation.to_latex(text[place:])


def display(formula: str) -> str:
    """A displayed formula; a long one is on several lines, of which LaTeX shrinks those that are still too wide."""
    lines = [rf"\fit{{{line}}}" if _length(line) > SURELY_ON_A_LINE else line for line in lines_of_latex(formula)]
    if len(lines) == 1:
        return f"\\[ {lines[0]} \\]"
    broken = r" \\ & \quad ".join(lines)
    return f"\\[ \\begin{{aligned}} & {broken} \\end{{aligned}} \\]"


def lines_of_latex(formula: str, room: int = LINE) -> list[str]:
    """The formula on lines of about `room` letters, broken before signs; a longer line in its widest bracket."""
    lines = [""]
    for sign, term in notation.split_outside(formula, _SIGN):
        joined = f"{lines[-1]}{sign}{term}"
        if _length(lines[-1]) < room / 4 or _length(joined) <= room:  # H = is kept with the formula after it
            lines[-1] = joined
        else:
            lines.append(f"{sign}{term}")
    return [part.strip() for line in lines for part in (_opened(line, room) if _length(line) > room else [line])]


def _opened(line: str, room: int) -> list[str]:
    """A line broken in its widest bracket, closed on each line by an invisible one; a/b becomes 1/b times (a)."""
    groups, depth, start = list[tuple[int, int]](), 0, 0
    for match in _BRACKET.finditer(line):
        begins = match[0] in ("{", "\\left")
        start = match.end() + (match[0] == "\\left") if begins and depth == 0 else start
        depth += 1 if begins else -1
        if depth == 0:
            groups.append((start, match.start()))
    for place, (start, end) in enumerate(groups):
        if _length(line[start:end]) <= room / 2:
            continue
        if line[:start].endswith("\\left("):
            rows = lines_of_latex(line[start:end], max(room // 2, room - _length(line[:start])))
            return (line[:start] + " \\right.\n\\left. \\quad ".join(rows) + line[end:]).split("\n")
        if line[:start].endswith("\\frac{") and line[start:end] != "1":
            under = line[slice(*groups[place + 1])]
            head, tail = line[: start - len("\\frac{")], line[groups[place + 1][1] + 1 :]
            return lines_of_latex(f"{head}\\frac{{1}}{{{under}}} \\left({line[start:end]}\\right){tail}", room)
    return [line]


def _length(formula: str) -> int:
    """How many letters and signs a formula has, both parts of a fraction counted."""
    return len(_LETTER.findall(formula))
