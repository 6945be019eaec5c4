"""An answer line by line; these lines as plain text and as LaTeX; rows of tables of runs.

The LaTeX document compiles by itself, with long formulas broken into the lines of an article.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from inverse_service import __version__, errors
from inverse_service.expressions import notation, printing
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import family_tables, joined, sheets, stated

# Characters of a formula of a text: of the answer itself, and of what there is besides.
LONGEST, LONG = 2_000, 300
WIDEST = 48  # of a column of a table in text
SIGNS = {"!=": r" \neq ", ">=": r" \geq ", "<=": r" \leq "}
_DERIVATIVE = re.compile(
    r"diff\((?P<plain>\w+)\([^()]*\), (?P<by>[\w, ]+)\)"
    r"|(?P<name>\w+)\[(?P<orders>[\d,]+)\]\((?P<of>[^()]*)\)"
)
_AFTER_A_DISPLAY = re.compile(r"((?: \\end\{aligned\})? \\\])([.,:;]+)")
SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    **{character: f"\\{character}" for character in "&%$#_{}"}, "\u2192": r"$\to$", "\u03c4": r"$\tau$",
}  # fmt: skip
# Letters of a formula on a line of an article, about and at least, and in a line of text.
LINE, SURELY_ON_A_LINE, IN_A_SENTENCE = 60, 40, 28
_LETTER = re.compile(
    r"\\(?!left|right|[dt]?frac|sqrt|d?dot\b|math|quad)[A-Za-z]+|(?<!\\)\b[A-Za-z]|[^\sA-Za-z\\{}^_,]"
)
_SIGN = r" (?:[-+=<>]|\\(?:neq|geq|leq)) "
_BRACKET = re.compile(r"\\left|\\right|[{}]")
# Shrinks a formula that is wider than the line.
_FIT = r"""\newsavebox{\wide}
\newcommand{\fit}[1]{\sbox{\wide}{$\displaystyle #1$}%
  \ifdim\wd\wide>0.94\linewidth\resizebox{0.94\linewidth}{!}{\usebox{\wide}}\else\usebox{\wide}\fi}"""


@dataclass(frozen=True, slots=True)
class Line:
    """A line of an answer: how far it is indented, what it says, and the most characters of a
    formula in a text; or the table of a family.
    """

    depth: int = 0
    said: sheets.Sentence = ()
    most: int = LONG
    family: sheets.FamilyTable | None = None


EMPTY = Line()


def text_page(result: Mapping[str, Any], explain: bool, address: str = "") -> str:
    """The whole page, ending with a newline; `address` is that of the result, if it has one."""
    lines = list[str]()
    for line in outline(result, explain):
        if line.family is not None:
            lines += _table_as_text(line.family)
        else:
            lines.append(f"{'  ' * line.depth}{plain_text(line.said, line.most)}")
    return "\n".join(lines) + "\n"


def family_lines(result: Mapping[str, Any]) -> list[str]:
    """The verdict on a family, and a line for each set of its members; [] without a family."""
    table = family_tables.table_of(result)
    if table is None:
        return []
    lines = [
        f"{plain_text(one.where)}: {one.word} {plain_text(one.lagrangian)}".rstrip()
        for one in table.members
    ]
    return [plain_text(table.sentence), *lines, *map(plain_text, table.notes)]


def _table_as_text(table: sheets.FamilyTable) -> list[str]:
    """Where, Lagrangian, L: in columns, if the conditions are short."""
    rows = [("where", "Lagrangian", "L")]
    for one in table.members:
        words = " ".join(filter(None, map(plain_text, (one.lagrangian, one.notes))))
        where = _DERIVATIVE.sub(_subscripted, plain_text(one.where))
        rows.append(("  " * one.depth + where, one.word, words))
    widths = [
        max((len(row[k]) for row in rows if len(row[k]) <= WIDEST), default=0) for k in range(2)
    ]
    return [
        f"  {where:<{widths[0]}}  {word:<{widths[1]}}  {words}".rstrip()
        for where, word, words in rows
    ]


def plain_text(said: sheets.Sentence, most: int = LONGEST) -> str:
    """A sentence as text; a formula with more characters is only measured."""
    found = ""
    for piece in said:
        is_apart = (
            isinstance(piece, sheets.Formula)
            and piece.kind == "display"
            and not found.endswith(" ")
        )
        found += f"{' ' * is_apart}{_plain(piece, most)}"
    return found


def _plain(piece: str | sheets.Formula | sheets.Word, most: int) -> str:
    if isinstance(piece, str):
        return piece
    if isinstance(piece, sheets.Word):
        return "" if isinstance(piece.target, Mapping) else piece.words
    if len(piece.text) <= most:
        return piece.whole
    return f"{piece.letter or 'a formula'}: {len(piece.text)} characters, in the JSON"


def further_questions(result: Mapping[str, Any]) -> list[str]:
    """What a page offers to ask next by a link to a filled form, which printed pages leave out."""
    pieces = (piece for line in outline(result, False) for piece in line.said)
    links = (one for one in pieces if isinstance(one, sheets.Word))
    return list(dict.fromkeys(one.words for one in links if isinstance(one.target, Mapping)))


def outline(result: Mapping[str, Any], explain: bool) -> Iterator[Line]:
    """All that is said of a result, line by line, which text and LaTeX print; `explain`: with
    proofs and conditions.
    """
    sheet = family_tables.sheet_with_family(result)
    system = result["system"] or {}
    if name := (system.get("given") or {}).get("name", "") if sheet.table else system.get("name"):
        yield Line(0, (sheets.capitalized(name),))
    yield from (Line(1, (formula,), LONGEST) for formula in sheet.asked)
    if about := [piece for one in sheet.about for piece in (", ", *one)][1:]:
        yield Line(1, tuple(about))
    yield from (EMPTY, Line(0, sheet.sentence), *(Line(1, note) for note in sheet.notes))
    if sheet.family is not None:
        if sheet.sentence is not sheet.family.sentence:
            yield Line(0, ("Family: ", *sheet.family.sentence))
            yield from (Line(1, note) for note in sheet.family.notes)
        yield from (EMPTY, Line(0, (), family=sheet.family))
        shown = any(case.formulas or (case.gist and not explain) for case in sheet.cases)
        if shown or sheet.joined or len(sheet.cases) > 1:
            yield from (EMPTY, Line(0, ("In general:",)))
    if sheet.joined:
        yield from (EMPTY, Line(0, (f"{sheet.joined_heading}:",)))
        yield from (line for formula in sheet.joined for line in _formula(formula, 1, LONGEST))
    for case in sheet.cases:
        if len(sheet.cases) > 1:
            here = ("Where ", *case.where, ": ") if case.where else ()
            yield from (
                EMPTY,
                Line(0, (*here, *case.sentence)),
                *(Line(1, note) for note in case.notes),
                *(Line(1, (formula,), LONGEST) for formula in case.equations),
            )
        yield from (line for formula in case.formulas for line in _formula(formula, 1, LONGEST))
        if case.motion:
            yield Line(1, ("Motion: ", *case.motion, "."))
        yield from (
            Line(1, (f"{heading}: ", *step)) for heading, step in (() if explain else case.gist)
        )
    if sheet.missing:
        yield Line(1, (f"Not reached within the time limit: {', '.join(sheet.missing)}.",))
    yield from [EMPTY] if sheet.table else []
    for row in sheet.table:
        hint = (" (", *row.hint, ")") if row.hint else ()
        yield Line(0, (row.name, *hint, f": {row.word}"))
        above = row.is_main and row.formulas == sheet.cases[0].formulas
        yield from _inside(replace(row, formulas=()) if above else row, explain)
    for place, (heading, steps) in enumerate(sheet.proofs if explain else ()):
        yield from (
            EMPTY,
            Line(0, (f"{heading or ('In the next case' if place else 'Why')}:",)),
            *_numbered(steps, 1),
        )
    if explain and sheet.matrices:
        yield from (
            EMPTY,
            Line(0, ("The conditions as derived:",)),
            *(Line(1, one) for one in sheet.matrices),
        )
    rows = [row for case in sheet.cases for row in case.more] + list(sheet.more)
    yield from [EMPTY] if rows else []
    for row in rows:
        words = (
            f": {row.word}. " if row.word and row.hint else f": {row.word}" if row.word else ": "
        )
        yield Line(0, (f"{row.name}{words}" if row.word or row.hint else f"{row.name}:", *row.hint))
        yield from _inside(row, explain)


def _inside(row: sheets.Row, explain: bool) -> Iterator[Line]:
    """The formulas of a row with where they hold, its proof, and its tree."""
    yield from (line for formula in row.formulas for line in _formula(formula, 1, LONG))
    if row.domain and row.formulas:
        yield Line(3, ("where ", *row.domain))
    yield from _numbered(row.steps, 2) if explain else ()
    waiting = [(1, case) for case in reversed(row.tree)]
    while waiting:
        depth, case = waiting.pop()
        yield Line(depth, case.said)
        waiting += [(depth + 1, one) for one in reversed(case.inner)]


def _formula(formula: sheets.Formula, depth: int, most: int) -> Iterator[Line]:
    yield Line(depth, (formula,), most)
    yield from (Line(depth + 2, note, most) for note in formula.notes)


def _numbered(steps: Iterable[sheets.Sentence], depth: int) -> Iterator[Line]:
    yield from (Line(depth, (f"{k}. ", *step), LONGEST) for k, step in enumerate(steps, 1))


# The same lines as LaTeX.


def latex_page(result: Mapping[str, Any], explain: bool, address: str = "") -> str:
    """The whole document, ending with a newline; `address` is that of the result, if it has one."""
    lines = [r"\documentclass{article}", r"\usepackage{amsmath,amssymb,graphicx,url}", r"\sloppy"]
    lines += [_FIT, r"\begin{document}"]
    lines += [
        _line(line) if line.family is None else _table_as_latex(line.family)
        for line in outline(result, explain)
    ]
    # The comma after a displayed formula belongs in its last line.
    whole = "\n".join([*lines, _source(result, address), r"\end{document}"])
    return _AFTER_A_DISPLAY.sub(r"\2\1", whole) + "\n"


@dataclass(frozen=True, slots=True)
class Printer:
    """A form in which people read a result: what writes it, with the steps of the proof if asked
    and the address of the result, and its media type.
    """

    write: Callable[[Mapping[str, Any], bool, str], str]
    media_type: str


# The forms that the command line and HTTP write; each prints the lines of `outline`.
PRINTERS = {
    "text": Printer(text_page, "text/plain"),
    "latex": Printer(latex_page, "application/x-latex"),
}


def _subscripted(found: re.Match[str]) -> str:
    """F_xy for diff(F(x, y), x, y), G_xy' for G[1,1](x, y')."""
    if found["plain"]:
        return f"{found['plain']}_{''.join(name.strip() for name in found['by'].split(','))}"
    pairs = zip(found["of"].split(", "), found["orders"].split(","), strict=True)
    return f"{found['name']}_{''.join(name * int(order) for name, order in pairs)}"


def _table_as_latex(table: sheets.FamilyTable) -> str:
    """The same table in LaTeX, in the width of a line."""
    columns = r"@{}p{0.36\linewidth}p{0.14\linewidth}p{0.44\linewidth}@{}"
    lines = [r"\par\medskip\noindent\begin{tabular}{" + columns + "}", r"where & Lagrangian & $L$ \\ \hline"]  # fmt: skip
    for one in table.members:
        formulas = [
            r"\fit{" + _whole(replace(piece, letter="")) + "}"
            if isinstance(piece, sheets.Formula)
            else escaped(str(piece))
            for piece in one.lagrangian
        ]
        notes = latex_sentence(one.notes, "inline")
        where = rf"\hspace*{{{one.depth}em}}" * bool(one.depth) + _in_cell(one.where)
        lines.append(f"{where} & {escaped(one.word)} & {' '.join([*formulas, notes]).strip()} \\\\")
    return "\n".join([*lines, r"\end{tabular}\par\medskip"])


def _in_cell(said: sheets.Sentence) -> str:
    """A sentence with formulas in a cell, where each may be shrunk."""
    found = []
    for piece in said:
        if isinstance(piece, sheets.Formula):
            whole = _whole(piece)
            found.append(f"${whole}$" if _length(whole) <= IN_A_SENTENCE else rf"\fit{{{whole}}}")
        else:
            found.append(escaped(piece if isinstance(piece, str) else piece.words))
    return "".join(found)


def _source(result: Mapping[str, Any], address: str) -> str:
    """Which program in which version found it, and where it can be read again."""
    made = result.get("provenance") or {}
    program = escaped(
        f"{made.get('program', 'inverse-service')} {made.get('version', __version__)}"
    )
    place = rf": \url{{{address}}}" if address else ""
    return rf"\paragraph{{}} Found by {program}{place}."


def _line(line: Line) -> str:
    """A paragraph of words and formulas, or a displayed formula."""
    if len(line.said) == 1 and isinstance(line.said[0], sheets.Formula):
        return display(_whole(line.said[0]))
    indent = rf"\hspace*{{{line.depth - 1}em}}" * (line.depth > 1)
    return rf"\par {indent}{latex_sentence(line.said)}" if line.said else ""


def latex_sentence(
    said: sheets.Sentence, formulas: Literal["displayed", "inline"] = "displayed"
) -> str:
    """Words and formulas, of which those that are long or apart may be displayed."""
    found: list[str] = []
    for piece in said:
        if isinstance(piece, sheets.Formula):
            whole = _whole(piece)
            is_apart = piece.kind == "display" or _length(whole) > IN_A_SENTENCE
            before = " " if found and found[-1].endswith(".") else ""
            found.append(
                display(whole) if is_apart and formulas == "displayed" else f"{before}${whole}$"
            )
        elif isinstance(piece, str):
            found.append(piece if formulas == "inline" else escaped(piece))
        elif not isinstance(piece.target, Mapping):
            found.append(escaped(piece.words))
    return "".join(found)


def _whole(formula: sheets.Formula) -> str:
    symbol = (
        _theory(formula.letter).strip()
        if formula.kind == "matrix"
        else latex_of(formula.letter, formula.names)
    )
    return " = ".join(
        filter(None, (symbol, formula.latex or latex_of(formula.text, formula.names)))
    )


def conditions_latex(conditions: Sequence[str], system: Mapping[str, Any] | None) -> str:
    """Conditions such as "x != 0" as formulas in a sentence."""
    names = stated.names_of(system)
    return ", ".join(f"${latex_of(one, names)}$" for one in joined.in_ranges(conditions))


def escaped(text: str) -> str:
    """Plain text with the characters that LaTeX gives a meaning made harmless."""
    return "".join(SPECIAL.get(character, character) for character in text)


def latex_of(text: str, names: nm.Names) -> str:
    """The LaTeX of a formula of a sentence: relations between formulas of the system and terms of
    the theory.
    """
    sides = notation.split_outside(text, notation.SIDES)
    return "".join(SIGNS.get(sign.strip(), sign) + _side(side, names) for sign, side in sides)


def _side(text: str, names: nm.Names) -> str:
    if text.startswith("[[") and text.endswith("]]"):
        rows = (row.strip()[1:-1] for _, row in notation.split_outside(text[1:-1], ","))
        entries = (
            (latex_of(entry.strip(), names) for _, entry in notation.split_outside(row, ","))
            for row in rows
        )
        body = r" \\ ".join(map(" & ".join, entries))
        return rf"{{\begin{{pmatrix}}{body}\end{{pmatrix}}}}"
    if text.startswith("∫ "):
        integrand, _, variable = text[2:].rpartition(" d")
        return rf"\int {latex_of(integrand, names)} \, d{latex_of(variable, names)}"
    try:
        with printing.in_given_order():
            return printing.to_latex(reader.read_formula(text, names))
    except errors.InputError:
        return _theory(text).strip()


def _theory(text: str) -> str:
    """The notation of the theory; dL/dx' is a fraction."""
    text, found, place = notation.BRACKETED.sub(r"\1", text), "", 0
    for match in notation.SLOPE.finditer(text):
        above, name, index, primes = match.groups()
        below = printing.name_latex(name, ("", "dot", "ddot")[len(primes)]) + (
            f"^{{{index}}}" if index else ""
        )
        found += (
            notation.to_latex(text[place : match.start()])
            + rf"\frac{{\partial {above}}}{{\partial {below}}}"
        )
        place = match.end()
    return found + notation.to_latex(text[place:])


def display(formula: str) -> str:
    """A displayed formula; a long one is on several lines, of which LaTeX shrinks those that are
    still too wide.
    """
    lines = [
        rf"\fit{{{line}}}" if _length(line) > SURELY_ON_A_LINE else line
        for line in lines_of_latex(formula)
    ]
    if len(lines) == 1:
        return f"\\[ {lines[0]} \\]"
    broken = r" \\ & \quad ".join(lines)
    return f"\\[ \\begin{{aligned}} & {broken} \\end{{aligned}} \\]"


def lines_of_latex(formula: str, room: int = LINE) -> list[str]:
    """The formula on lines of about `room` letters, broken before signs; a longer line in its
    widest bracket.
    """
    lines = [""]
    for sign, term in notation.split_outside(formula, _SIGN):
        longer = f"{lines[-1]}{sign}{term}"
        if (
            _length(lines[-1]) < room / 4 or _length(longer) <= room
        ):  # H = is kept with the formula after it
            lines[-1] = longer
        else:
            lines.append(f"{sign}{term}")
    return [
        part.strip()
        for line in lines
        for part in (_opened(line, room) if _length(line) > room else [line])
    ]


def _opened(line: str, room: int) -> list[str]:
    """A line broken in its widest bracket, closed on each line by an invisible one; a/b becomes 1/b
    times (a).
    """
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
            return lines_of_latex(
                f"{head}\\frac{{1}}{{{under}}} \\left({line[start:end]}\\right){tail}", room
            )
    return [line]


def _length(formula: str) -> int:
    """How many letters and signs a formula has, both parts of a fraction counted."""
    return len(_LETTER.findall(formula))


# Rows of a run.


def quantities(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(key, heading) of the numbers that some method of a run has."""
    from inverse_service.simulation.observing import QUANTITIES

    methods = result["methods"]
    return [
        pair
        for one in QUANTITIES.values()
        for pair in one.numbers.items()
        if any(value_at(method, pair[0]) is not None for method in methods)
    ]


def value_at(method: Mapping[str, Any], key: str) -> Any:
    """The value of a method under a key, or under "outer.inner"."""
    outer, _, inner = key.partition(".")
    found = method.get(outer)
    return found.get(inner) if inner and isinstance(found, Mapping) else found


def why(method: Mapping[str, Any]) -> str:
    """Why a method stopped or did not begin, or where what it did is not the motion."""
    stopped = (method.get("stopped") or {}).get("sentence")
    return stopped or method.get("reason") or method.get("doubt") or ""


def notes_of_quantities(method: Mapping[str, Any]) -> list[str]:
    """Why a run has no number of an observed quantity, which the key `..._note` says."""
    return [str(note) for key, note in method.items() if key.endswith("_note") and note]


def notes_of_formulas(method: Mapping[str, Any]) -> list[str]:
    """What a run says about its events and the observables by formula, each after its formula or
    name, and what its contacts did.
    """
    parts = [(one["when"], one) for one in method.get("events") or ()]
    parts += (method.get("observables") or {}).items()
    noted = [f"{name}: {one['note']}" for name, one in parts if one.get("note")]
    return noted + [
        f"{one['name']}: {what_a_contact_did(one)}" for one in method.get("contacts") or ()
    ]


def what_a_contact_did(contact: Mapping[str, Any]) -> str:
    """Its impacts, when it pressed, and its greatest force."""
    impacts, rests = contact["impacts"], contact["rests"]
    said = "1 impact" if impacts == 1 else f"{impacts} impacts"
    if not rests:
        return f"{said}."
    first = f"pressed from t = {rests[0]['begin']:.6g} to {rests[0]['end']:.6g}"
    more = (
        f" and {len(rests) - 1} more times"
        if len(rests) > 2
        else " and once more"
        if len(rests) == 2
        else ""
    )
    return f"{said}, {first}{more}; greatest force {contact['greatest_force']:.6g}."
