r"""One entry for formulas in plain text and in LaTeX: a backslash or a brace means LaTeX.

Lists of equations are split as tokens: where one ends, and its two sides.
"""

import itertools
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, replace
from fractions import Fraction

from inverse_service import errors
from inverse_service.expressions import letters, tree as ex
from inverse_service.expressions.refusals import refusal, shorten
from inverse_service.reading import notations, parser
from inverse_service.reading.names import FUNCTIONS, GREEK_NAMES, MAY_BE_FUNCTIONS, Names, written_product
from inverse_service.reading.tokens import (
    COMPARED,
    TOTAL,
    Kind,
    Token,
    at,
    closing,
    opening,
    outside,
    refuse_decimal_commas,
    split,
    tokenize,
)

_GREEK_OF_MATHEMATICA = re.compile(r"\\\[(?:Curly)?(?:Capital)?([A-Z][a-z]+)\]")
SHORTEST_REMARK = 4  # letters of a word that no constant needs
_TO = r"subject\s+to|s\.\s?t\."
_WORDS = rf"(?:(?:{_TO}|with|under)\s+(?:the\s+)?constraints?|{_TO}|constraints?(?=\s*:))"
# The words between a Lagrangian and its constraints, in LaTeX in an upright font.
_SUBJECT_TO = re.compile(
    rf"\\(?:text|textrm|mathrm|mbox)\s*\{{\s*(?:and\s+)?{_WORDS}\s*:?\s*\}}\s*:?|(?:\.\s+)?\b{_WORDS}\s*:?", re.I
)
# Van der Pol: x'' = …, Eq. (3.2): x'' = …, and x'' = … (eq. 3.2)
_NUMBER = r"\(?[\d.]*\d[a-z]?\)?"
_NUMBERED = rf"[Ee]q(?:uation|n)?(?:\.\s*|\s+|\s*(?=\()){_NUMBER}"
_LABEL = re.compile(
    rf"(?:^|(?<=[;\n]))[ \t]*(?:[A-Z][\w -]{{2,40}}[\w]|{_NUMBERED})\s*:(?![=:])"
    rf"|[ \t](?:,?[ \t]*(?:\({_NUMBERED}\)|\[{_NUMBERED}\]|{_NUMBERED})|(?:\.{{3,}}|\u2026)[ \t]*{_NUMBER})"
    r"(?=[ \t]*(?:[.;\n]|$))"
)
# q''_1, \omega^2_0 and \u03c9\u00b2\u2080, whose order TeX does not show; \Gamma^x_{xx} is a tensor.
_RAISED_FIRST = re.compile(
    r"(?<=[^\W\d_]|\})((?:['\u2032\u2033\u2019]+|\^(?:[^\W_]|\{[^{}_^]*\}))(?=_\d|_\{\d|[\u2080-\u2089])"
    r"|[\u2070\u00b9\u00b2\u00b3\u2074-\u2079]+|\^(?:\d|\{-?\d+\}))"
    r"(_(?:\{\w+\}|[A-Za-z](?!\w)|\d+(?![\d_']))|[\u2080-\u2089]+)"
)
_ACCELERATION = re.compile(r"(?<!')''(?!['(])")
_LETTER_OF_A_FORM = re.compile(rf"(?:[A-Za-z]|{'|'.join(sorted(GREEK_NAMES))})(?:_?[0-9]+)?")
_OF_PROGRAMS = re.compile(r"[A-Za-z']\[|==|\.diff\(")


def is_latex(formula: str) -> bool:
    """Whether the formula is read as LaTeX."""
    braces = "{" in formula and not _OF_PROGRAMS.search(formula)
    return "\\" in formula or braces or formula.lstrip().startswith("$")


def read_formula(formula: str, names: Names) -> ex.Expression:
    """The formula as a tree; InputError or LimitError with the column."""
    return _side(read_tokens(formula, names), len(formula) + 1, names)


_NOTES: ContextVar[dict[str, str] | None] = ContextVar("notes", default=None)


@contextmanager
def noted() -> Iterator[dict[str, str]]:
    """Collect what is read differently from how it was typed: kx as k*x, and omitted lines."""
    notes: dict[str, str] = {}
    mark = _NOTES.set(notes)
    try:
        yield notes
    finally:
        _NOTES.reset(mark)


def note(text: str, meant: str) -> None:
    """Report to the caller of `noted` that a text was read as another."""
    if (notes := _NOTES.get()) is not None:
        notes[text] = meant


@contextmanager
def placed_at(pointer: str) -> Iterator[None]:
    """Give errors that are raised inside this place in the document."""
    try:
        yield
    except errors.InputError as error:
        raise error.placed(pointer) from None


def without_accelerations(tree: ex.Expression, what: str, pointer: str) -> ex.Expression:
    """The tree; InputError if it contains an acceleration."""
    found = next((node for node in ex.walk(tree) if isinstance(node, ex.Acceleration)), None)
    if found is not None:
        raise errors.InputError(
            f"{what} contains the acceleration {found.coordinate}'': use coordinates and velocities.", pointer
        )
    return tree


def read_condition(condition: str, names: Names) -> ex.Expression:
    """A - B for A > B and A != B, B - A for A < B; it is positive, or not 0, where the condition of an answer holds."""
    left, sign, right = re.split(r" (!=|>|<) ", condition)
    sides = [read_formula(side, names) for side in ((right, left) if sign == "<" else (left, right))]
    return sides[0] if sides[1] == ex.ZERO else ex.subtract(*sides)


def read_equations(formula: str, names: Names) -> list[tuple[ex.Expression, ex.Expression]]:
    """(left, right) of each equation; no = means = 0."""
    return [read_equation(group, names) for group in split_equations(formula, names)]


def read_tokens(formula: str, names: Names | None = None) -> list[Token]:
    """The tokens, before any name is looked up."""
    formula = _GREEK_OF_MATHEMATICA.sub(_greek, formula)
    formula = _SUBJECT_TO.sub(lambda words: ";".ljust(len(words[0])), formula)
    formula = _RAISED_FIRST.sub(r"\2\1", _with_dots_after_letters(_LABEL.sub(_without_label, formula)))
    names = names or Names()
    in_our_words = notations.with_derivatives if is_latex(formula) else notations.in_our_words
    tokens = in_our_words(_with_products(_scanned(formula, names), names), names)
    refuse_decimal_commas(tokens)
    tokens = _without_remarks(_with_forms(tokens, names) if names.forms else tokens, formula, names)
    return _without_names_of_forms(tokens, names) if names.forms else tokens


_OF_A_FORM = "d"  # the text of the prime that stands for a differential


def _with_forms(tokens: list[Token], names: Names) -> list[Token]:
    """The tokens with z' for dz and 1 for dt: a Pfaffian form divided by dt."""
    found: list[Token] = []
    place = 0
    _ask_about_displacements(tokens, names)
    for place, length, factor, name in differentials(tokens, names):
        token = tokens[place]
        before = found[-1] if found else token
        if name == "t" and found and (before.kind in ("name", "prime", "number") or before.is_operator(")")):
            pass  # x dt is x
        elif name == "t":
            found.append(Token("number", "1", token.column, True, Fraction(1)))
        elif names.role(names.spelling(name)) == "coordinate":
            prime = Token("prime", _OF_A_FORM, token.column, False, Fraction(1))
            found += [*factor, Token("name", name, token.column, True), prime]
        else:
            found += tokens[place : place + length]
    return found


def differentials(tokens: Sequence[Token], names: Names) -> Iterator[tuple[int, int, list[Token], str]]:
    """(place, number of tokens, factor, name) of each dz, y dx and ydx; the other tokens one by one without a name.

    In d theta' and, next to velocities, in d x with a space, d is a constant.
    """
    place = 0
    moves = any(token.kind == "prime" for token in tokens)
    while place < len(tokens):
        token, following = tokens[place], at(tokens, place + 1)
        name, length, factor = "", 1, list[Token]()
        if token.kind == "name" and "d" in token.text and names.role(token.text) is None:
            before, _, name = token.text.partition("d")
            known = names.role(names.spelling(before)) is not None or len(before) == 1
            factor = [replace(token, text=before)] * bool(before)
            name = name if known or not before else ""
        apart = at(tokens, place + 2).kind == "prime" or (moves and following.space_before)
        if (token.text == "d" and not name and names.role("d") is None and not apart) or token.is_operator(TOTAL):
            name, length = (following.text, 2) if following.kind == "name" else ("", 1)
        yield place, length, factor, name
        place += length


def names_in_forms(text: str) -> set[str]:
    """The letters z and x in dz - y dx."""
    found = differentials(tokens_if_any(text, Names()), Names())
    return {name for *_, name in found if _LETTER_OF_A_FORM.fullmatch(name)}


def moving_in_forms(tokens: Sequence[Token], names: Names) -> list[str]:
    """The undeclared names z and x of dz - y dx = 0 and of dz = 0, which are letters."""
    found: list[str] = []
    for line, _ in split(tokens, lambda _, token: token.is_operator(";", ",")):
        each = [name for _, _, _, name in differentials(line, names) if _LETTER_OF_A_FORM.fullmatch(name)]
        alone = [token.text for token in line[-2:]] == ["=", "0"]
        if (len(each) > 1 or (each and alone)) and not any(token.kind == "prime" for token in line):
            found += [name for name in each if name != "t" and names.role(names.spelling(name)) is None]
    return found


def _ask_about_displacements(tokens: Sequence[Token], names: Names) -> None:
    """InputError for the delta z of delta z = y delta x, which is usually a virtual displacement."""
    if names.role("delta") or any(token.kind == "prime" for token in tokens):
        return
    for delta, moving in itertools.pairwise(tokens):
        if delta.text == "delta" and names.role(names.spelling(moving.text)) == "coordinate":
            meant = (f"d{moving.text}", f"delta*{moving.text}")
            what, span = f"delta {moving.text} could be a virtual displacement", (delta.column, moving.column)
            instead = f"write {meant[0]} for it, as in dz - y dx = 0, or {meant[1]}"
            raise refusal(what, delta.column, instead, meant, (span[0], span[1] + len(moving.text)))


def _without_names_of_forms(tokens: list[Token], names: Names) -> list[Token]:
    """The tokens without the name in mu = sin(theta) dx - cos(theta) dy and phi = z' - y x' = 0, which is noted.

    A form is not a number, so a name that equals it can only be the name of the form.
    """
    found: list[Token] = []
    for line, end in split(tokens, lambda _, token: token.is_operator(";", ",")):
        named = len(line) > 2 and line[0].kind == "name" and line[1].is_operator("=")
        last = [token.text for token in line[-2:]] == ["=", "0"] and len(line) > 4
        form = any(token.kind == "prime" and token.text == _OF_A_FORM for token in line)
        if named and (last or form) and names.role(names.spelling(line[0].text)) != "coordinate":
            note(f"{line[0].text} =", LEFT_OUT)
            zero = [] if last else [Token("number", "0", line[0].column), line[1]]
            line = [*zero, *line[2:]]
        found += [*line, *([end] if end else [])]
    return found


def tokens_if_any(formula: str, names: Names) -> list[Token]:
    """The tokens; empty for a formula that cannot be read, whose error is reported where it is read."""
    with suppress(errors.InputError):
        return read_tokens(formula, names)
    return []


def _scanned(formula: str, names: Names) -> list[Token]:
    if not is_latex(formula):
        return tokenize(formula, names.declared())
    from inverse_service.reading import latex

    return latex.tokenize(formula, names)


LEFT_OUT, CONDITION = "left out", "a condition that is not used"
_JOINS = {
    **dict.fromkeys(("where", "with", "given", "and"), ("=", *COMPARED)),
    **dict.fromkeys(("for", "if", "when"), COMPARED),
}


def _without_remarks(tokens: list[Token], formula: str, names: Names) -> list[Token]:
    """The tokens without initial conditions, equation numbers and conditions such as k > 0, each of which is noted.

    `where` and `with` between an equation and a definition are separators. Comparisons are omitted only next to
    equations.
    """
    marks = {token.text for token in tokens}
    tokens = _with_definitions_apart(tokens) if "=" in marks else tokens
    if not (
        marks & {*COMPARED, *_JOINS, *_CONSTANT}
        or (("=" in marks or names.energy) and any(token.kind == "number" for token in tokens))
    ):
        return tokens

    def ends(place: int, token: Token) -> bool:
        joins = token.kind == "name" and _joins(tokens, place, names)
        return joins or token.is_operator(";", ",")

    groups = [
        (group, Token("operator", ";", end.column) if end is not None and end.kind == "name" else end)
        for group, end in split(tokens, ends)
    ]
    equations = any(_has(group, "=") and not _is_initial(group) for group, _ in groups)
    found: list[Token] = []
    for place, (group, end) in enumerate(groups):
        following = groups[place + 1][0] if place + 1 < len(groups) else []
        group = _without_condition(group, formula)
        listed = end is not None and end.is_operator(",") and len(group) == 1 and _is_condition(following)
        omitted = bool(group) and (_is_initial(group) or _is_number(group))
        if equations and (omitted or (group and (_is_condition(group) or listed))):
            stop = end.column - 1 if end is not None else len(formula)
            note(formula[group[0].column - 1 : stop].strip(" \t\n$.,;"), LEFT_OUT if omitted else CONDITION)
            group = []
        equal = group and (names.energy or _has(group, "="))
        found += _without_number(group, formula, names) if equal else group
        found += [end] if end is not None and group else []
    return found


def _with_definitions_apart(tokens: list[Token]) -> list[Token]:
    """The tokens with x'' = -w^2 x; w^2 = k/m for x'' = -w^2 x (w^2 = k/m)."""
    found = list(tokens)
    for place, token in enumerate(tokens):
        end = closing(tokens, place) if token.is_operator("(") and token.space_before else place
        inside = tokens[place + 1 : end]
        if end < len(tokens) and inside and inside[0].kind == "name" and _has(inside, "="):
            found[place], found[end] = (replace(tokens[each], text=";") for each in (place, end))
    return found


def _joins(tokens: Sequence[Token], place: int, names: Names) -> bool:
    """Whether the token is a word that joins a definition or a condition to an equation."""
    wanted = _JOINS.get(tokens[place].text, ())
    if not wanted or names.role(tokens[place].text):
        return False
    after = place + 1 + at(tokens, place + 1).is_operator(";")  # a line of its own
    for _, token in outside(tokens[after:]):
        if token.is_operator(*wanted, ";", ",") or token.text in _BRANCHES:
            return token.is_operator(*wanted)
    return False


_CONSTANT = ("const", "constant")
_BRANCHES = ("else", "then", "otherwise")


def _has(group: Sequence[Token], *signs: str) -> bool:
    return any(token.is_operator(*signs) for _, token in outside(group))


def _is_condition(group: Sequence[Token]) -> bool:
    """Whether it is k > 0 or 0 < k < 1."""
    return _has(group, *COMPARED) and not _has(group, "=") and not any(token.text in _BRANCHES for token in group)


def _without_condition(group: list[Token], formula: str) -> list[Token]:
    """The equation without the (k > 0) after it, whose names do not move."""
    start = max((place for place, token in enumerate(group[:-1]) if token.is_operator("(")), default=0)
    inside = group[start + 1 : -1]
    apart = bool(start and group[-1].is_operator(")") and not group[start - 1].is_operator(*"+-*/^=("))
    moving = {group[place].text for place in range(len(group) - 1) if group[place + 1].kind == "prime"}
    if not (apart and group[start].space_before and _is_condition(inside)) or moving & {one.text for one in inside}:
        return group
    note(formula[group[start].column : group[-1].column - 1], CONDITION)
    return group[:start]


def _is_initial(group: Sequence[Token]) -> bool:
    """Whether it is x(0) = 1, x'(t_0) = v, x = x(t), or k = const."""
    texts = [token.text for token in group]
    if texts[1:] in (["=", texts[0], "(", "t", ")"], *(["=", word] for word in _CONSTANT)):
        return True
    primes = sum(1 for _ in itertools.takewhile(lambda token: token.kind == "prime", group[1:]))
    opening, instant, closes, equals = (*(token.text for token in group[1 + primes : 5 + primes]), "", "", "", "")[:4]
    timed = instant in ("t_0", "t0") or instant.replace(".", "").isdigit()
    return group[:1] != [] and group[0].kind == "name" and timed and (opening, closes, equals) == ("(", ")", "=")


def _without_number(group: list[Token], formula: str, names: Names) -> list[Token]:
    """The equation without the (1) or 1. before it and the (1) after it, which are usually its number."""
    begins = _is_number(group[:3]) and not group[0].value
    if begins and len(group) > 3 and (group[3].kind == "name" or group[3].is_operator("(")):
        note("".join(token.text for token in group[:3]), LEFT_OUT)
        return group[3:]
    if len(group) > 1 and group[0].kind == "number" and group[0].text.endswith(".") and group[1].space_before:
        note(group[0].text, LEFT_OUT)
        return group[1:]
    start = opening(group, len(group) - 1) if group and group[-1].is_operator(")") else 0
    if start < 1 or not _is_number(group[start:]) or group[start].value:
        return group
    bracket, before, number = group[start], group[start - 1], "".join(token.text for token in group[start:])
    called = before.kind == "name" and (
        before.text in FUNCTIONS | MAY_BE_FUNCTIONS or names.role(names.spelling(before.text)) == "function"
    )
    ends = formula[bracket.column - 1] == "(" and bracket.space_before
    if not ends or called or (before.kind == "operator" and not before.is_operator(")")):
        return group
    if len(group) - start == 4:
        if "." not in number or (names.role(group[-2].text) and not names.guesses):
            return group
        what = f"{number} could be an equation number"
        raise refusal(what, bracket.column, "leave it out, or write * before a factor")
    note(number, LEFT_OUT)
    return group[:start]


def _is_number(group: Sequence[Token]) -> bool:
    """Whether it is (3.2) or (3.2a), as the number of an equation."""
    if len(group) not in (3, 4) or not (group[0].is_operator("(") and group[-1].is_operator(")")):
        return False
    letters = [token for token in group[2:-1] if token.kind != "name" or len(token.text) > 1 or token.space_before]
    return group[1].kind == "number" and not letters


def _with_products(tokens: list[Token], names: Names) -> list[Token]:
    """The tokens with each run of letters in `names.splits` split; the parts after a function are in brackets."""
    if not names.splits:
        return tokens
    found: list[Token] = []
    for place, token in enumerate(tokens):
        parts = names.splits.get(token.text, ()) if token.kind == "name" else ()
        if not parts:
            found.append(token)
            continue
        following = at(tokens, place + 1)
        goes_on = following.kind == "prime" or following.is_operator("^")
        column, opened = token.column, 0
        note(token.text, written_product(parts, names))
        for number, part in enumerate(parts):
            kind: Kind = "number" if part.isdigit() else "name"
            value = Fraction(part) if part.isdigit() else Fraction(0)
            found.append(Token(kind, part, column, token.space_before and not number, value))
            column += len(part)
            if part in FUNCTIONS and names.role(part) is None and not goes_on and number + 1 < len(parts):
                found.append(Token("operator", "(", column))
                opened += 1
        found += [Token("operator", ")", column)] * opened
    return found


_LETTER = r"[^\W\d_\u00b2\u00b3]"  # raised digits count as letters of words
_BEFORE_A_LETTER = re.compile(rf"([\u00a8\u02d9])({_LETTER})")
_BEGINS_WITH_DOTS = re.compile(rf"(?<!{_LETTER})[\u00a8\u02d9]{_LETTER}")
_ENDS_WITH_DOTS = re.compile(rf"{_LETTER}[\u00a8\u02d9](?!{_LETTER})")
_DOTS_APART = re.compile(r"(?<=\w)( +)([\u0307\u0308]+)")


def _with_dots_after_letters(formula: str) -> str:
    """The formula with the dots of each letter after it: texts copied from a PDF have \u00a8x or x\u00a8 for x''.

    InputError for m\u00a8x alone, where the dots may be those of either letter.
    """
    formula = _DOTS_APART.sub(r"\2\1", formula)
    between = _BEFORE_A_LETTER.search(formula)
    if between is None:
        return formula
    if _BEGINS_WITH_DOTS.search(formula):
        return _BEFORE_A_LETTER.sub(r"\2\1", formula)
    if _ENDS_WITH_DOTS.search(formula):
        return formula
    place, (dots, letter) = between.start(), between.groups()
    primes = "''" if dots == "\u00a8" else "'"
    meant = (f"{formula[place - 1]} {letter}{primes}", f"{formula[place - 1]}{primes} {letter}")
    what, span = "the dots may belong to the letter before or after them", (place, place + 3)
    raise refusal(what, place + 1, f"write {' or '.join(meant)}", meant, span)


def _without_label(match: re.Match[str]) -> str:
    note(match[0].strip(), LEFT_OUT)
    return " " * len(match[0])


def _greek(match: re.Match[str]) -> str:
    """Mathematica's \\[Theta] as a name of the same length, so that columns remain correct."""
    name = match[1] if "Capital" in match[0] else match[1].lower()
    return f"{'var' * ('Curly' in match[0])}{name}".ljust(len(match[0]))


@dataclass(frozen=True, slots=True)
class EquationTokens:
    """The tokens of one equation and the column just after it."""

    tokens: tuple[Token, ...]
    end_column: int


def split_equations(formula: str, names: Names) -> list[EquationTokens]:
    """One entry for each equation, separated by ; or line ends or commas outside brackets; empty ones are dropped.

    They are tokens, so that each can be refused by itself. A comma separates equations only: where one of the parts has
    an = and the other none, it is refused.
    """
    tokens = read_tokens(formula, names)
    _refuse_bullets(tokens, formula)
    parts = split(tokens, lambda _, token: token.is_operator(";", ","))
    commas = [end for _, end in parts if end is not None and end.is_operator(",")]
    groups = [EquationTokens(tuple(part), end.column if end else len(formula) + 1) for part, end in parts]
    found = [group for group in groups if group.tokens]
    if commas and len({any(token.is_operator("=") for token in group.tokens) for group in found}) > 1:
        raise refusal("a comma splits an equation", commas[0].column, "write a decimal point, or ; between equations")
    return found


def _refuse_bullets(tokens: Sequence[Token], formula: str) -> None:
    """InputError for lines that all begin with "- ", usually a bullet; -x'' = x in one line is accepted."""

    def ends(_: int, token: Token) -> bool:
        return token.is_operator(";") and formula[token.column - 1] == "\n"

    full = [line for line, _ in split(tokens, ends) if line]
    listed = (line[0].is_operator("-") and line[1:] and line[1].space_before for line in full)
    if len(full) > 1 and all(listed) and all(any(token.is_operator("=") for token in line) for line in full):
        raise refusal(
            "every line begins with a - that may be a bullet", full[0][0].column, "leave it out, or write -1*"
        )


def read_equation(equation: EquationTokens, names: Names) -> tuple[ex.Expression, ex.Expression]:
    """(left, right); right is 0 if there is no =."""
    places = [place for place, token in enumerate(equation.tokens) if token.is_operator("=")]
    if len(places) > 1:
        column = equation.tokens[places[1]].column
        raise refusal("a second = occurs", column, "separate equations by ;")
    if not places:
        return _side(list(equation.tokens), equation.end_column, names), ex.ZERO
    left, right = list(equation.tokens[: places[0]]), list(equation.tokens[places[0] + 1 :])
    return _side(left, equation.tokens[places[0]].column, names), _side(right, equation.end_column, names)


def remark(line: Sequence[Token], place: int) -> errors.InputError | None:
    """The refusal of names not meant as factors: a word after an equation, (spring) there, and (a) before one."""
    if _is_word_at_the_end(line, place):
        shown = shorten(line[place].text)
        return refusal(f"{shown} could be a remark", line[place].column, "leave it out, or write * before a factor")
    start = end = place
    while start and line[start - 1].kind == "name":
        start -= 1
    while at(line, end).kind == "name":
        end += 1
    if not start or end == len(line) or not (line[start - 1].is_operator("(") and line[end].is_operator(")")):
        return None
    before, after = at(line, start - 2), at(line, end + 1)
    begins = _is_edge(before) and after.kind == "name"
    follows = (
        line[start - 1].space_before and _ends_factor(before) and _is_edge(after) and not _is_power(line, start - 1)
    )
    if not begins and not follows:
        return None
    shown = shorten(f"({' '.join(token.text for token in line[start:end])})")
    return refusal(f"{shown} could be a remark", line[start - 1].column, "leave it out, or write * next to a factor")


def _is_word_at_the_end(line: Sequence[Token], place: int) -> bool:
    """Whether a word such as damping, and no letter such as omega, comes after a gap and ends the equation."""
    word = line[place]
    return (
        len(word.text) >= SHORTEST_REMARK
        and sum(token.text == word.text for token in line) == 1
        and word.text.isalpha()
        and word.text.islower()
        and word.text not in letters.LETTER_COMMANDS
        and word.space_before
        and _ends_factor(at(line, place - 1))
        and at(line, place - 1).kind != "number"
        and _is_edge(at(line, place + 1))
    )


def _is_power(line: Sequence[Token], end: int) -> bool:
    """Whether the power of a function ends there, as in sin^{2} (omega t), so that its argument follows."""
    start = opening(line, end - 1)
    return start > 1 and line[start - 1].is_operator("^") and line[start - 2].text in FUNCTIONS


def _is_edge(token: Token) -> bool:
    """Whether an equation ends or begins there."""
    return token.kind == "end" or token.is_operator(";", ",")


def _ends_factor(token: Token) -> bool:
    if token.text in FUNCTIONS:
        return False
    return token.kind in ("name", "number", "prime") or token.is_operator(")")


def _side(tokens: list[Token], end_column: int, names: Names) -> ex.Expression:
    return parser.check_depth(
        parser.parse_tokens(tokens, end_column, names), tokens[0].column if tokens else end_column
    )


def equation_line(name: str, text: str) -> str:
    """x'' = f, or E = 0 for an equation that is not solved for the accelerations."""
    return f"{text} = 0" if has_acceleration(text) else f"{name}'' = {text}"


def has_acceleration(text: str) -> bool:
    """Whether a printed formula contains an x''; A''(x) is the derivative of a function."""
    return _ACCELERATION.search(text) is not None
