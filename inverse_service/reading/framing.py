r"""The statements of a pasted program that give no equation, as cuts of its text.

A statement ends at a ; or a line end outside brackets. The rows of `statements.toml` say which are
left out, wholly or at their beginning or end, or what is read in their place; its rows `inside` say
the same of parts of statements. In a text with such a statement, the values that nothing uses
(`t_span = [0 30]`) and names alone (`result`) are left out, too.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from inverse_service.reading.cuts import Cut, Cuts, merged, text_between_cuts
from inverse_service.reading.rules import dependences
from inverse_service.reading.typed_text import Change, Typed

_TABLE = tomllib.loads(Path(__file__).with_name("statements.toml").read_text(encoding="utf-8"))
# A string, a remark, a bracket, and the end of a statement: ; and line ends, Maxima's $, Maple's :.
_PIECES = re.compile(
    r"(?P<string>(?!\"\"\")\"(?:[^\"\n\\]|\\.)*\"|(?<=[(,=\[{])[ \t]*'[^'\n]*'(?=[ \t]*[,)\]}]))"
    r"|(?P<remark>\(\*(?:[^*]|\*(?!\))){0,500}\*\)|/\*(?:[^*]|\*(?!/)){0,500}\*/"
    r"|(?<!\\)#(?!'*\[\w+\]\s*[\],)&^*/+-]|[\d ]*&)[^\n]*"  # not Mathematica's slot #[t]
    r"|\"\"\"(?:[^\"]|\"(?!\"\")){0,4000}\"\"\")|(?P<slashes>//[^\n]*)"
    r"|(?P<trailing>(?<=[\w)\]; \t])[ \t](?://|%)[ \t]+[A-Za-z]?[a-z]{2,}[^\n=]*(?=\n|\Z))"
    r"|(?P<opening>[(\[{])|(?P<closing>[)\]}])"
    r"|(?P<end>[;\n\r]|\$(?!\s*\d)|:(?![=-]|\w))"
)
# Maple without :=
_OF_MAPLE = re.compile(r"\brestart\b|\bwith[ \t]*\(\w+\)[ \t]*:")
_LIBRARY = re.compile(r"with[ \t]*\(\w+\)|restart")
_BLANK = re.compile(r"[ \t]*")
# Modelica and C++, in which // begins a remark anywhere, elsewhere only a line of it
_SLASHES = re.compile(r"\b(?:der|prime)\s*\(")
# "the angle" at the end of a statement of Modelica
_DESCRIPTION = re.compile(r"(?<=[\w)])[ \t]+(\"[A-Za-z][^\"\n=+*/^]*\")\Z")
_DESCRIPTION_OF_MODELICA = re.compile(r"(?<=[\w)])[ \t]+(\"[A-Za-z][^\"\n=]*\")\Z")
_VALUE = re.compile(r"(\w+)[ \t]*:?=(?!=)[ \t]*(.+)", re.DOTALL)
_NUMBERS = re.compile(r"[\[{(](?:[-+*/^.,;:\s\d()]|\b(?:pi|Pi|np\.pi|e)\b)*[\])}]")
_ENTRY = re.compile(r"(\w+)\(\d+\)")
_NUMBER = re.compile(r"-?[\d.]+")  # L = 1 is a length
_NO_VALUE = re.compile(r"['\u2032@~\[{]|==|\b(?:diff|Derivative|der|D|D2|Eq|prime|Differential)\b")
_MOVES = re.compile(
    r"''|\u2033|\b(?:diff|Derivative|Eq|der|D|D2|prime|Differential|return)\b|@|\w\[\d"
    r"|^\s*\w+\(\d\)\s*=(?!=)|^\s*d\w+\s*=\s*\[|\b(?:rk|rkf45)\s*\(\s*\["
)
_ENERGIES = frozenset(("L", "T", "V", "U", "K", "H", "Lag", "lag"))
_QUOTED = re.compile(r"'([^']*)'")
# eqn = 'D2x = -x' next to dsolve(eqn, 'x(0) = 1') of MATLAB
_NAMED_TEXT = re.compile(
    r"(?:^|(?<=;))[ \t]*\w{1,40}[ \t]*=[ \t]*'(?P<formula>[^'\n;]{1,300})'(?=[ \t]*(?:;|$))",
    re.MULTILINE,
)
_DSOLVE = re.compile(r"\bdsolve[ \t]*\(")
_INITIAL = re.compile(r"\s*\w+\s*\(\s*-?[\w.]+\s*\)\s*=")  # Dx(0) = 1
_MOST_SCOPES = 5  # each is searched for its end
_SCOPE = re.compile(r"\b(?:Module|With|Block)[ \t]*\[\s*\{(?P<given>[^{}\[\]]*)\}\s*,")
# The "StiffnessSwitching" of an option, and the colon of Maxima's m: 1
_OPTION = re.compile(r"(?:->|\bmethod[ \t]*=)[ \t]*\{?[ \t]*(\"[^\"\n]*\"|'[^'\n]*')")
_COLON = re.compile(
    r"(?:^|(?<=[;$\n]))[ \t]*[A-Za-z]\w*[ \t]*(?P<sign>:)[ \t]*-?\d[\d./]*[ \t]*(?P<end>[;$])"
)
_WORD = re.compile(r"\w+")
_REMARK = re.compile(r"[#%]|//|/\*|\(\*")
# Plot[Evaluate[x[t] /. before NDSolve[...]
_SHOWN_SOLUTION = re.compile(
    r"(?:\b\w+\[[ \t\n]*){1,5}(?:\w+(?:\[\w+\])?|\{[\w\[\], \t]*\})[ \t]*/\.[ \t]*"
    r"(?=(?:First\[)?(?:Parametric)?N?DSolve(?:Value)?\[)"
)
# The name of a module in import sympy as smp; that of heyoka has a time
_MODULE = re.compile(r"\bimport[ \t]+(?!heyoka)[\w.]+[ \t]+as[ \t]+(\w+)")
_GIVEN = re.compile(r"\b[A-Za-z]\w*[ \t]*=[ \t]*-?[\d.]+(?:[eE][-+]?\d+)?(?=[ \t]*[,)])")
# A text in quotation marks as a whole, and sympify('...').
_IN_QUOTES = re.compile(
    r"\s*(?:(?:\w+\s*=\s*)?(?:\w+\.)?(?:sympify|parse_expr|S|str2sym)\s*\(\s*)?"
    r"(?P<mark>[\"'])(?P<formula>[^\"'\n]+(?:'+[^\"'\n]+)*)(?P=mark)\s*\)?\s*;?\s*"
)
_CALL_OF_TEXTS = re.compile(
    r"\s*(?:(?:\w+|\[[\w\s,]*\])\s*=\s*)?(?:(?:simplify|expand|pretty|disp)\s*\(\s*)?"
    r"(dsolve|inline)\s*\(((?:\s*'[^']*'\s*,?)+)(?:\s*\w+\s*)?\)\s*\)?\s*;?\s*(?:%[^\n]*)?"
)


_PROMPT = re.compile(r"^[ \t]*(?:>>>|In ?\[\d*\]:(?!=))[ \t]?", re.MULTILINE)  # of Python
_TYPED = re.compile(r"[ \t]*(?:>>>|\.\.\.:?|In ?\[\d*\]:)[ \t]?")


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table: what a statement is like that is left out; one that `begins` or `ends` so
    is kept otherwise, as is the group `kept` of it, and with `values` each g=9.81 in it. What is
    `noted` is told to the reader.

    It holds only in a text that has `beside`. `until` ends a section that the statement begins.
    `becomes` is what is read in its place, {name} the words of a group.
    """

    form: re.Pattern[str]
    part: str
    beside: re.Pattern[str] | None
    until: re.Pattern[str] | None
    noted: bool
    values: bool
    becomes: str = ""


@cache
def rows(table: str = "statement") -> tuple[Row, ...]:
    """The rows of a table: `statement`, or `inside` for parts of statements."""
    commands = {
        name: "|".join(words) for name, words in _TABLE["commands"].items()
    }  # <<solver>> in a row

    def form(text: str | None) -> re.Pattern[str] | None:
        if text is None:
            return None
        for name, words in commands.items():
            text = text.replace(f"<<{name}>>", words)
        return re.compile(text, re.DOTALL)

    found = []
    for row in _TABLE[table]:
        part = next((part for part in ("begins", "ends") if row.get(part)), "whole")
        is_form = form(row["is"])
        if is_form is not None:
            found.append(
                Row(
                    is_form,
                    part,
                    form(row.get("beside")),
                    form(row.get("until")),
                    row.get("noted", "<<" in row["is"]),
                    row.get("values", False),
                    row.get("becomes", ""),
                )
            )
    return tuple(found)


class Trap(NamedTuple):
    """What a program does besides its equations, its place from 0, and by which name a program that
    is run in symbols says that it takes it into account.
    """

    what: str
    at: int
    run: str


def traps(text: str) -> Iterator[Trap]:
    """What a program does that changes the motion and is no equation, outside remarks."""
    for row in _TABLE["trap"]:
        for found in re.finditer(row["is"], text, re.MULTILINE):
            line = text[text.rfind("\n", 0, found.start()) + 1 : found.start()]
            if not _REMARK.search(line):
                yield Trap(row["what"], found.start(), row.get("run", ""))
                break


def frames(text: str) -> list[Cut]:
    """The cuts of the statements that give no equation, and of what is around the equations in
    dsolve('D2x = -x', 'x(0) = 1', 't').
    """
    quoted = _IN_QUOTES.fullmatch(text)
    if quoted and ("=" in quoted["formula"] or "(" in text[: quoted.start("mark")]):
        return [Cut(0, quoted.start("formula")), Cut(quoted.end("formula"), len(text))]
    if call := _CALL_OF_TEXTS.fullmatch(text):
        return _around_texts(text, call[1] == "dsolve")
    return _of_session(text) if _PROMPT.search(text) else _of_program(text)


def _of_program(text: str) -> list[Cut]:
    """The cuts of the statements of a program, which has no prompts."""
    maple = ":=" in text or _OF_MAPLE.search(text) is not None
    marks = [mark for mark in _PIECES.finditer(text) if maple or mark[0] != ":"]
    anywhere = _SLASHES.search(text)
    description = _DESCRIPTION_OF_MODELICA if anywhere else _DESCRIPTION
    found = [
        Cut(*mark.span())
        for mark in marks
        if mark.lastgroup == "remark"
        or (
            mark.lastgroup == "slashes"
            and (anywhere or text[: mark.start()].rstrip(" \t")[-1:] in ("", "\n", ";"))
        )
    ]
    found += [Cut(*mark.span(), ";") for mark in marks if mark[0] == ":"]
    found += [
        Cut(*mark.span(), "", (mark[0].strip(),)) for mark in marks if mark.lastgroup == "trailing"
    ]
    found += [Cut(*option.span(1), "0") for option in _OPTION.finditer(text)]
    if modules := {*_MODULE.findall(text)}:
        prefix = re.compile(rf"(?<![\w.])(?:{'|'.join(sorted(modules))})\.(?=[A-Za-z])")
        found += [Cut(*module.span()) for module in prefix.finditer(text)]
    for row in rows("inside"):
        if row.beside is None or row.beside.search(text):
            inside = [_replaced(row, part) for part in row.form.finditer(text)]
            found += inside
            if not row.becomes:  # the braces of a function of C and R hold its statements
                held = {place for cut in inside for place in range(cut.start, cut.stop)}
                marks = [mark for mark in marks if mark.start() not in held]
    if _DSOLVE.search(text):
        for named in _NAMED_TEXT.finditer(text):
            found += _around_named_text(named)
    for own in dependences.said(text):  # u = u(r) next to u''; V = V(r) gives V
        if own.is_whole and dependences.has_primes(text, own.name):
            found.append(Cut(*own.span, "", (text[slice(*own.span)],)))
    for scope in islice(_SCOPE.finditer(text), _MOST_SCOPES):
        cuts = [*_of_scope(text, scope)]
        found += cuts
        marks = _marks_in_scope(marks, scope, cuts[-1])
    for shown_solution in _SHOWN_SOLUTION.finditer(text):
        found += _around_solver(text, shown_solution)
    for colon in _COLON.finditer(text):
        found += [Cut(*colon.span("sign"), "="), Cut(*colon.span("end"), ";")]
    chosen = [row for row in rows() if row.beside is None or row.beside.search(text)]
    left: list[tuple[int, int]] = []
    gone, still, section = list[Cut](), list[Cut](), None
    moves = False
    breaks = {cut.start: cut.stop for cut in found if cut.sign == ";"}
    for start, stop in _statements(text, marks, breaks):
        first, last = _trimmed(text, start, stop, found)
        if section is not None and not section.fullmatch(text, first, last):
            gone.append(Cut(first, last))
            continue
        section = None
        size, moving = last - first, _MOVES.search(text, first, last) is not None
        library = _LIBRARY.fullmatch(text, first, last) is not None
        if described := description.search(text, first, last):
            gone.append(Cut(*described.span(1)))
            first, last = _trimmed(text, first, described.start(1), found)
        cuts, kept, first, last, section = _left_out(text, first, last, chosen)
        gone += cuts
        still += cuts if library else []
        left += kept
        moves |= moving and sum(cut.stop - cut.start for cut in cuts) < size
        if first < last:
            left.append((first, last))
        elif cuts and text[stop : stop + 1] == "$":
            gone.append(Cut(stop, stop + 1))
    given = any("=" in cut.sign for cut in gone)
    if not (given or moves or any("=" in text[start:stop] for start, stop in left)):
        return [cut for cut in (*found, *still) if cut.start < cut.stop]
    unused = _unused(text, left, merged(found)) if gone else []
    return [cut for cut in (*found, *gone, *unused) if cut.start < cut.stop]


def _of_session(text: str) -> list[Cut]:
    """The cuts that leave what was typed at the prompts of a session, without what was printed."""
    found, start = list[Cut](), 0
    for line in text.splitlines(keepends=True):
        stop, typed = start + len(line.rstrip("\n")), _TYPED.match(line)
        found.append(Cut(start, start + typed.end()) if typed else Cut(start, stop))
        start += len(line)
    found = [cut for cut in found if cut.start < cut.stop]
    kept = Typed.of(text, "").put(Change(cut.start, cut.stop, "") for cut in found)
    places = [column - 1 for _, column in kept.places]
    of_lines = [
        replace(cut, start=places[cut.start], stop=places[cut.stop - 1] + 1)
        for cut in _of_program(kept.text)
        if cut.start < cut.stop
    ]
    return [*found, *of_lines]


def _around_solver(text: str, shown_solution: re.Match[str]) -> Iterator[Cut]:
    """The cuts that leave NDSolve[...] of Plot[Evaluate[x[t] /. NDSolve[...]], {t, 0, 20}]."""
    opened = shown_solution[0].count("[") - shown_solution[0].count("]")
    depth, inner = opened, 0
    for place in range(shown_solution.end(), len(text)):
        depth += {"[": 1, "]": -1}.get(text[place], 0)
        if text[place] == "]" and depth == opened and not inner:
            inner = place + 1
        if not depth:
            yield Cut(*shown_solution.span())
            yield Cut(inner, place + 1)
            return


def _of_scope(text: str, scope: re.Match[str]) -> Iterator[Cut]:
    """The cuts that leave a = 1; b = 2; body of With[{a = 1, b = 2}, body]."""
    depth, stop = 1, scope.end()
    while stop < len(text) and depth:
        depth += {"[": 1, "]": -1}.get(text[stop], 0)
        stop += 1
    yield Cut(scope.start(), scope.start("given"))
    for comma in re.finditer(",", scope["given"]):
        yield Cut(scope.start("given") + comma.start(), scope.start("given") + comma.end(), ";")
    yield Cut(scope.end("given"), scope.end(), ";")
    if not depth:
        yield Cut(stop - 1, stop)


def _marks_in_scope(
    marks: Sequence[re.Match[str]], scope: re.Match[str], closing: Cut
) -> list[re.Match[str]]:
    """The marks without the brackets of a scope, whose body has statements of its own."""
    return [
        mark
        for mark in marks
        if not (
            scope.start() <= mark.start() < scope.end()
            or (mark.start() == closing.start and closing.stop == mark.end())
        )
    ]


def _around_texts(text: str, equations: bool) -> list[Cut]:
    """The cuts around the equations among the quoted texts, the first of which may be an
    expression, or around the first alone.
    """
    found, start = list[Cut](), 0
    for count, quoted in enumerate(_QUOTED.finditer(text)):
        if not count or (equations and "=" in quoted[1] and not _INITIAL.match(quoted[1])):
            found.append(Cut(start, quoted.start(1), ";" * bool(found)))
            start = quoted.end(1)
        elif equations:
            found.append(Cut(quoted.start(1), quoted.end(1), "", (quoted[1],)))
    return [*found, Cut(start, len(text))]


def _around_named_text(named: re.Match[str]) -> Iterator[Cut]:
    """The cuts that leave D2x = -x of eqn = 'D2x = -x', and nothing of initial values."""
    formula = named["formula"]
    if "=" not in formula:
        return
    if _INITIAL.match(formula):
        yield Cut(*named.span(), ";", (formula,))
        return
    yield Cut(named.start(), named.start("formula"), ";")
    yield Cut(named.end("formula"), named.end(), ";")


def _statements(
    text: str, marks: Sequence[re.Match[str]], breaks: Mapping[int, int]
) -> Iterator[tuple[int, int]]:
    """(start, stop) of each statement; in a text with unmatched brackets, of each line. `breaks`
    are the ends of other statements, each with the start of the next one.
    """
    ends, depth = [*breaks], 0
    for mark in marks:
        depth = max(0, depth + (mark.lastgroup == "opening") - (mark.lastgroup == "closing"))
        if mark.lastgroup == "end" and not depth:
            ends.append(mark.start())
    if depth:
        ends = [*breaks, *(mark.start() for mark in marks if mark.lastgroup == "end")]
    start = 0
    for end in sorted({*ends}):
        yield start, end
        start = breaks.get(end, end + 1)
    yield start, len(text)


def _trimmed(text: str, start: int, stop: int, remarks: Sequence[Cut]) -> tuple[int, int]:
    """A part without the blanks and remarks around it."""
    begins = {cut.start: cut.stop for cut in remarks if not cut.sign}
    ends = {stop: start for start, stop in begins.items()}
    while start < stop and (text[start] in " \t\n\r" or start in begins):
        start = begins.get(start, start + 1)
    while start < stop and (text[stop - 1] in " \t\n\r" or stop in ends):
        stop = ends.get(stop, stop - 1)
    return start, max(start, stop)


class LeftOut(NamedTuple):
    """What a statement leaves out: cuts, kept values, what is left of it, and the end of its
    section.
    """

    cuts: list[Cut]
    kept: list[tuple[int, int]]
    start: int
    stop: int
    until: re.Pattern[str] | None


def _left_out(text: str, start: int, stop: int, chosen: Sequence[Row]) -> LeftOut:
    """The cuts of a statement, the values kept in them, what is left of it, and what ends the
    section that it begins.
    """
    cuts: list[Cut] = []
    kept: list[tuple[int, int]] = []
    goes_on = True
    while goes_on and start < stop:
        goes_on = False
        for row in chosen:
            match row.part:
                case "whole":
                    found = row.form.fullmatch(text, start, stop)
                case "begins":
                    found = row.form.match(text, start, stop)
                case _:
                    found = row.form.search(text, start, stop)
            if found is None:
                continue
            values = [value.span() for value in _GIVEN.finditer(found[0])] if row.values else []
            values = [(found.start() + first, found.start() + last) for first, last in values]
            kept += values
            if row.becomes:
                cuts.append(_replaced(row, found))
            else:
                cuts += _between(found, values) if values else _around(found, row.noted)
            if row.part == "whole":
                return LeftOut(cuts, kept, stop, stop, row.until)
            if row.part == "ends":
                stop = start + len(text[start : found.start()].rstrip())
            else:
                begun = found.start("kept") if found.groupdict().get("kept") else found.end()
                blank = _BLANK.match(text, begun)
                start = blank.end() if blank else begun
            goes_on = not row.becomes
            break
    return LeftOut(cuts, kept, start, stop, None)


def _replaced(row: Row, found: re.Match[str]) -> Cut:
    """The cut of a match with what is read in its place; {a} = {b}' is read once for each of the
    words of its groups `a` and `b`, which are lists of one length.
    """
    words = {name: _WORD.findall(part) for name, part in found.groupdict().items()}
    if len({len(listed) for listed in words.values()}) > 1:
        return Cut(found.start(), found.start())  # nothing is left out
    each = [dict(zip(words, one, strict=True)) for one in zip(*words.values(), strict=True)]
    read = ";".join(row.becomes.format(**one) for one in each) if words else row.becomes
    return Cut(*found.span(), read, (found[0].strip(),) * row.noted)


def _between(found: re.Match[str], values: Sequence[tuple[int, int]]) -> list[Cut]:
    """The cuts around the values in a match, which are equations of their own."""
    starts = [found.start(), *(last for _, last in values)]
    stops = [*(first for first, _ in values), found.end()]
    return [Cut(start, stop, ";") for start, stop in zip(starts, stops, strict=True)]


def _around(found: re.Match[str], noted: bool) -> list[Cut]:
    """The cut of a match, except of its group `kept`; a remark is noted too."""
    if found.groupdict().get("kept") is not None:
        return [Cut(found.start(), found.start("kept")), Cut(found.end("kept"), found.end())]
    noted |= found[0].lstrip().startswith("%")
    return [Cut(*found.span(), "", (found[0].strip(),) * noted)]


def _unused(text: str, left: Sequence[tuple[int, int]], cuts: Cuts) -> list[Cut]:
    """The cuts of values that nothing uses, and of names alone, beside what moves; what the `cuts`
    leave out uses nothing.
    """
    parts = [text[start:stop] for start, stop in left]
    if not any(map(_MOVES.search, parts)):
        return []
    found: list[Cut] = []
    kept = (text_between_cuts(text, cuts, start, stop) for start, stop in left)
    times = Counter(word for part in kept for word in _WORD.findall(part))
    named = [
        value[1] for part in parts if _MOVES.search(part) and (value := _VALUE.fullmatch(part))
    ]
    for part, (start, stop) in zip(parts, left, strict=True):
        value = _VALUE.fullmatch(part)
        if part.removesuffix("(t)").isidentifier() and part not in ("end", "equation"):
            found.append(Cut(start, stop))
        elif value and (value[1] not in _ENERGIES or _NUMBER.fullmatch(value[2])):
            used = times[value[1]] > _WORD.findall(part).count(value[1])
            plain = _NUMBERS.fullmatch(value[2]) or not _NO_VALUE.search(part)
            plain = plain and not {*named} & {*_WORD.findall(value[2])}  # xdd = diff(x, t, 2)
            entry = _ENTRY.fullmatch(value[2])  # x = y(1), a name of a coordinate
            plain = plain and not (entry and times[entry[1]] > 1)
            if plain and not used:
                found.append(Cut(start, stop, "", (text_between_cuts(text, (), start, stop),)))
    return found
