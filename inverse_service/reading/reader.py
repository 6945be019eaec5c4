r"""Parse formulas in plain text or LaTeX; a backslash or a brace means LaTeX.

Lists of equations are split, as tokens, into equations and their two sides.
"""

import itertools
import re
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial, wraps
from typing import Any, NamedTuple, NoReturn, TypeVar

from inverse_service import errors
from inverse_service.expressions import collecting, refusals, tree as ex
from inverse_service.expressions.refusals import fault, most_characters, shorten
from inverse_service.reading import (
    components,
    cuts as left,
    differential_operators,
    framing,
    indices,
    labels,
    latex,
    named_matrices,
    notations,
    operations as op,
    parser,
    programs,
    prose,
    sums,
    tokens as tk,
)
from inverse_service.reading.cuts import Cut, Cuts
from inverse_service.reading.names import (
    DERIVATIVE_NAMES,
    FUNCTIONS,
    GREEK_NAMES,
    MAY_BE_FUNCTIONS,
    OF_TWO,
    OWN_FUNCTIONS,
    Names,
    pattern,
    written_product,
)
from inverse_service.reading.tokens import Line, Meaning, Token, at
from inverse_service.reading.typed_text import Typed

# The line end of old programs, and blanks without width, unless they divide a name.
_RETURN, _NO_WIDTH = (
    re.compile(r"\r(?!\n)"),
    re.compile("(?<!\\w)[\u200b\u2060\ufeff]|[\u200b\u2060\ufeff](?!\\w)"),
)
# The \ at the end of a line that goes on
_GOES_ON = re.compile(r"(?<!\\)\\[ \t]*\n(?=[ \t]*[^\s\\])")
# What a forum writes around formulas: [tex] and [/tex], ```, a pair of `, and a mark of a list.
_FORUM = re.compile(
    r"(?P<frame>\[/?(?:i?tex|i?math|latex|code|imath)\]|(?m:^[ \t]*```[A-Za-z]*[ \t]*$))"
    r"|(?<![\w`])`(?P<quoted>[^`\n]{1,300})`(?![\w`])"
    r"|(?P<item>(?m:^)[ \t]*(?:[\u2022\u25aa\u25e6\u2023]|(?:\d{1,2}|[a-h]|[ivx]{1,4})\)(?=[ \t]))[ \t]*)"
)
_BRACES = re.compile(r"\\[{}]|[{}]")
_OPENS_ENVIRONMENT = re.compile(
    r"\{\s*(?:\\displaystyle\s*)?(?:\{\s*)?"
    r"\\begin\s*\{(?:aligned|align|gathered|split|cases|array)\}"
)
_MARKED = re.compile("[kKIJmMClcgBE](?:_?[0-9])?")  # of the constants K' and I_1'
_RAISED_ONE = re.compile(r"\u00b9|\^\s*\{?\s*1")  # of q^1
# The capital Sigma before a name with an index that is summed over, as in \u03a3 m_i and \u03a3_k.
_SUM = re.compile(
    r"\u03a3(?=_(?!\{\s*[a-z]\s*=\s*\d+\s*\}\s*\^)|[\u1d62\u2c7c\u2096\u2099]|\s*(?:[0-9/\u00bd]+\s*)?[A-Za-z]+_[ijkn](?!\w))"
)
_LOST = dict(zip("\a\b\f\n\r\t\v", "abfnrtv", strict=True))
_LOST_BACKSLASH = pattern("reader", "lost_backslash")
# The index in y''_{xx} = x y.
_BY_INDEX = re.compile(r"(?<='')_?(?:\{([xts])\1\}|([xts])\2(?!\w))")
_ACCELERATION = re.compile(r"(?<!')''(?!['(])")
_LETTER_OF_A_FORM = re.compile(rf"(?:[A-Za-z]|{'|'.join(sorted(GREEK_NAMES))})(?:_?[0-9]+)?")
_BACKSLASH = re.compile(r"\\(?!\[[A-Z][A-Za-z]+\])")  # not of Mathematica's \[Theta]
_IN_BRACES = re.compile(r"[\^_]\s*\{[^{}]*\}")
_NUMBERED_NAME = re.compile(r"(?<![\w\\])[A-Za-z]\d(?![\w.])")
_OF_PROGRAMS = re.compile(
    r"\bprime\s*\(|[A-Za-z']\[|==|(?<![\\A-Za-z])d(?:iff|solve)\s*\(|\w\$\d|:=\s*(?:\w+\s*\(\s*)?\{"
    r"|=\s*\{\s*\{[^{}\\]*\}\s*,"
)
# Names, numbers, and signs of our own notation; ( ) around one name may be a label.
_OWN_SIGNS = re.compile(r"(?:[A-Za-z]\w*+'*+|[0-9]++|\((?!\s*\w+\s*\))|[-+*/^=) ])++", re.ASCII)
OF_A_FORM = Fraction(1)  # marks a name with a prime that replaces a differential
LEFT_OUT, note, note_again, noted = tk.LEFT_OUT, tk.note, tk.note_again, tk.noted
CONDITION = "a condition that is not used"
_JOINS = dict.fromkeys(tk.JOINING, ("=", *tk.COMPARED)) | dict.fromkeys(tk.CONDITIONAL, tk.COMPARED)
_CONSTANT = ("const", "constant")
_BRANCHES = ("else", "then", "otherwise")
_LETTER = r"[^\W\d_\u00b2\u00b3]"  # \w includes raised digits
# Characters of a text that is one of many, or of a few dozen.
# Without d, D, partial, and other signs than those of ASCII, which may be one of these.
_WITHOUT_DERIVATIVES = re.compile(
    r"(?:\\(?:d{1,3}ot|[cl]?dots?|q?quad|end|mathrm)(?![A-Za-z])"
    r"|[\u03b1-\u03b3\u03b5-\u03c9\u00b2\u00b3\u00b7\u2019\u2032\u2033\u2212]"
    r"|(?!part|nabla)[\x00-CE-ce-\x7f])*+"
)
_SHORT, _MIDDLE = 1000, 4000
T = TypeVar("T")
_SPACING_DOTS = "\u00a8\u02d9"
_BEFORE_A_LETTER = re.compile(rf"([\u00a8\u02d9])({_LETTER})")
_BEGINS_WITH_DOTS = re.compile(rf"(?<!{_LETTER})[\u00a8\u02d9]{_LETTER}")
_ENDS_WITH_DOTS = re.compile(rf"{_LETTER}[\u00a8\u02d9](?!{_LETTER})")


def _refuse_lost_backslashes(formula: str) -> None:
    r"""InputError for a form feed followed by rac, which JSON and Python make of \frac with a
    single backslash.
    """
    if lost := _LOST_BACKSLASH.search(formula):
        sign, rest = filter(None, lost.groups())
        column, meant = lost.end() - len(rest), f"\\{_LOST[sign]}{rest}"
        raise fault("lost backslash", column, (column, column + len(meant) - 1), command=meant)


def is_latex(formula: str) -> bool:
    """Whether the formula is parsed as LaTeX."""
    frames = _blanks_and_frames(formula)
    plain = left.text_between_cuts(formula, frames) if frames else formula
    braces = "{" in plain and not _OF_PROGRAMS.search(plain)
    braces = braces and not _has_braces_for_brackets(plain)
    return (
        _BACKSLASH.search(plain) is not None
        or braces
        or plain.lstrip().startswith("$")
        or bool(prose.formulas(formula, frames))
    )


def _has_braces_for_brackets(plain: str) -> bool:
    """Whether this is e^{2 t} x1, whose x1 is no name of LaTeX, with braces in powers and indices
    alone.
    """
    outside = " ".join(_IN_BRACES.split(plain))
    numbered = _NUMBERED_NAME.search(outside) is not None
    return numbered and "\\" not in plain and "{" not in outside


def read_formula(formula: str, names: Names) -> ex.Expression:
    """The formula as a tree; InputError or LimitError with the column."""
    return parser.parse_tokens(read_tokens(formula, names), len(formula) + 1, names)


@contextmanager
def placed_at(pointer: str) -> Iterator[None]:
    """Add this pointer to errors raised inside the context."""
    try:
        yield
    except errors.InputError as error:
        raise error.placed(pointer) from None


def without_accelerations(tree: ex.Expression, what: str, pointer: str) -> ex.Expression:
    """The tree; InputError if it contains an acceleration."""
    found = next((node for node in ex.walk(tree) if isinstance(node, ex.Acceleration)), None)
    if found is not None:
        raise fault("acceleration", pointer, what=what, name=found.coordinate)
    return tree


def read_condition(condition: str, names: Names) -> ex.Expression:
    """A - B for A > B and A != B, B - A for A < B: positive, or nonzero, where the condition of an
    answer is true.
    """
    left, sign, right = re.split(r" (!=|>|<) ", condition)
    sides = [
        read_formula(side, names) for side in ((right, left) if sign == "<" else (left, right))
    ]
    return sides[0] if sides[1] == ex.ZERO else sides[0] - sides[1]


def read_equations(formula: str, names: Names) -> list[tuple[ex.Expression, ex.Expression]]:
    """(left, right) of each equation; no = means = 0."""
    return [read_equation(group, names) for group in split_equations(formula, names)]


def read_tokens(formula: str, names: Names | None = None) -> list[Token]:
    """The tokens, before any name is looked up."""
    limits = most_characters(), refusals.LIMITS.tokens
    tokens, notes = _read(formula, replace(names or Names(), definitions={}), limits)
    tk.note_again(notes)
    return [*tokens]


def has_too_many_parts(formula: str) -> bool:
    """Whether a text is longer in parts than the limit: found by the first step of reading, before
    all others.
    """
    try:
        _scanned(formula, Names())
    except errors.InputError as error:
        return isinstance(error, errors.LimitError)
    return False


def _kept(read: Callable[..., T]) -> Callable[..., T]:
    """A function of a text that keeps its last results and refusals: 64 of long texts, more of
    shorter ones.

    A document is read many times, for its names, its time, and its Lagrangian; one of many
    coordinates has as many short texts.
    """

    def once(*given: Any) -> Callable[[], T]:
        try:
            value = read(*given)
        except errors.InputError as error:
            return partial(_refuse_again, error)
        return lambda: value

    of_long, of_middle, of_short = (lru_cache(maxsize=size)(once) for size in (64, 256, 1024))

    @wraps(read)
    def found(text: str, *more: Hashable) -> T:
        size = len(text)
        kept = of_short if size <= _SHORT else of_middle if size <= _MIDDLE else of_long
        return kept(text, *more)()

    return found


def _refuse_again(error: errors.InputError) -> NoReturn:
    raise error.with_traceback(None) from None


@_kept
def _read(
    formula: str, names: Names, _: tuple[int, int]
) -> tuple[tuple[Token, ...], dict[str, Meaning]]:
    """The tokens and the notes about them; the last argument, the limits of length, is only a cache
    key.
    """
    with noted() as notes:
        translated, is_tex, told = _in_our_notation(formula, _as_far_as_asked(formula, names), _)
        tk.note_again(told)
        tokens = [*translated]
        tk.refuse_decimal_commas(tokens, OF_TWO)
        _ask_about_primes(tokens, names.energy, is_tex)
        if names.forms:
            _ask_about_displacements(tokens, names)
            tokens = _with_forms(tokens, names, tk.moves(tokens))
        tokens = _without_remarks(tokens, formula, names)
        return tuple(_without_labels(tokens, names)), notes


def _as_far_as_asked(formula: str, names: Names) -> Names:
    """The names without what no notation of this text depends on, so that it is translated once: a
    document is read for its forms, for names to be guessed, and for its energies.

    Only derivatives like dy/dx depend on forms and guesses.
    """
    if not _RAISED_ONE.search(formula):
        names = replace(names, raised=frozenset())
    if not _WITHOUT_DERIVATIVES.fullmatch(formula):
        return names
    return replace(names, forms=False, guesses=False, energy=False)


class _InOurNotation(NamedTuple):
    """The tokens in our notation, whether the text is LaTeX, and the notes about them."""

    tokens: tuple[Token, ...]
    is_tex: bool
    notes: dict[str, Meaning]


@_kept
def _in_our_notation(formula: str, names: Names, _: tuple[int, int]) -> _InOurNotation:
    """A text before its remarks are left out; the last argument is only a cache key."""
    with noted() as notes:
        if _is_our_own(formula, names.declared()):
            plain = _with_indices_below(tk.tokenize(formula, names.declared()), names)
            return _InOurNotation(tuple(_with_products(plain, names)), False, notes)
        tokens, is_tex = _translated(formula, names)
        return _InOurNotation(tuple(tokens), is_tex, notes)


def _is_our_own(formula: str, declared: Collection[str]) -> bool:
    """Whether a text has no words and no notation of others; d is no name here, because it may be a
    derivative.
    """
    if (
        not _OWN_SIGNS.fullmatch(formula)
        or "/*" in formula
        or any(side.count("(") != side.count(")") for side in formula.split("="))
    ):
        return False
    words = set(re.findall(r"[A-Za-z]\w*", formula)).difference(declared)
    return all((len(word) == 1 and word not in "dD") or word in OWN_FUNCTIONS for word in words)


def _translated(formula: str, names: Names) -> tuple[list[Token], bool]:
    """The tokens in our notation, and whether the text is LaTeX."""
    scanned, is_tex = _scanned(formula, names)
    if len(scanned) == 1 and any(token.is_operator("=") for token in scanned[0].inside):
        scanned = [*scanned[0].inside]  # (x'' + x = 0)
    if not is_tex:
        scanned = labels.without_commands(programs.with_dots(scanned, names))
        scanned = labels.without_labels(scanned, names)
    in_our_words = notations.with_derivatives if is_tex else notations.in_our_words
    scanned = differential_operators.with_operator_letter(scanned, names)
    scanned = programs.with_time_below(scanned, names)
    rows = components.by_components(named_matrices.with_matrices(scanned, names), is_tex, formula)
    tokens = in_our_words(_with_products(rows, names), names)
    tokens = labels.without_identities(notations.with_subscripts(tokens, names))
    return labels.with_named_derivatives(tokens, names), is_tex


def _scanned(formula: str, names: Names) -> tuple[list[Token], bool]:
    """The tokens as they are written, and whether the text is LaTeX."""
    _refuse_lost_backslashes(formula)
    if names.role("Sigma") is None and (sign := _SUM.search(formula)):
        raise fault("sum sign", sign.start() + 1)
    cuts, is_tex = cuts_of(formula, names.declared()), is_latex(formula)
    _refuse_dots_between_letters(formula, cuts)
    for cut in cuts:
        for words in cut.notes:
            note(words)
    cuts = left.merged([*cuts, *_of_indices(formula, cuts)])
    tokens = (
        latex.tokenize(formula, names, cuts)
        if is_tex
        else _with_indices_below(
            sums.with_each_index(
                sums.with_terms(_with_brackets(tk.tokenize(formula, names.declared(), cuts)))
            ),
            names,
        )
    )
    return _with_dots_after_letters(tokens, formula), is_tex


def _with_brackets(tokens: Line) -> list[Token]:
    """The tokens of plain text with e^(2 t) for e^{2 t} and q_1 for q_{1}."""
    found: list[Token] = []
    for token in tokens:
        before = at(found, len(found) - 1)
        inside = token.inside
        if not token.is_bracket("{"):
            found.append(tk.within(token, _with_brackets))
        elif before.is_operator("^"):
            found.append(replace(token, text="(", inside=tuple(_with_brackets(inside))))
        elif before.kind == "name" and before.text.endswith("_") and not token.space_before:
            index = "".join(one.text for one in inside)
            plain = all(one.kind in ("name", "number") and not one.order for one in inside)
            found[-1] = replace(
                before,
                text=before.text + index if plain and index.isalnum() else before.text,
                order=token.order,
                primed=token.primed,
            )
            if not (plain and index.isalnum()):
                found.append(token)
        else:
            found.append(tk.within(token, _with_brackets))
    return found


def _with_indices_below(tokens: Line, names: Names) -> list[Token]:
    """The tokens of plain text with q_1 for q^1 where 1 is an index."""
    above = indices.raised_letters([tokens]) if names.raised is None else names.raised
    return indices.with_indices_below(tokens, above) if above else [*tokens]


def letters_with_indices(formulas: Iterable[str]) -> frozenset[str]:
    """The letters of these formulas together whose raised digits are indices."""
    formulas = [*formulas]
    if not any(map(_RAISED_ONE.search, formulas)):
        return frozenset()
    lines, names = list[Line](), Names()
    for formula in formulas:
        with suppress(errors.InputError):  # reported when it is parsed
            cuts = cuts_of(formula)
            lines.append(
                latex.nested_tokens(formula, names, cuts)
                if is_latex(formula)
                else tk.tokenize(formula, (), cuts)
            )
    return indices.raised_letters(lines)


def cuts_of(formula: str, declared: Iterable[str] = ()) -> Cuts:
    """What is no formula in a text: blanks without width, statements of programs, and words."""
    return _left_out(formula, frozenset(declared))


@_kept
def _left_out(formula: str, declared: frozenset[str]) -> Cuts:
    cuts = _blanks_and_frames(formula)
    if _is_our_own(formula, declared):
        return cuts
    return prose.with_cut_words(formula, is_latex(formula), declared, cuts)


def _of_indices(formula: str, cuts: Cuts) -> Iterator[Cut]:
    """The indices of y''_{xx}, which say twice by what y is differentiated."""
    for start, stop, _ in left.kept_parts(formula, cuts):
        yield from (Cut(*found.span()) for found in _BY_INDEX.finditer(formula, start, stop))


@_kept
def _blanks_and_frames(formula: str) -> Cuts:
    """The blanks without width, the line ends of old programs, and the statements of programs."""
    blanks = [Cut(*found.span()) for found in _NO_WIDTH.finditer(formula)]
    blanks += [Cut(*found.span()) for found in _GOES_ON.finditer(formula)]
    blanks += [*_around_environments(formula)]
    ends = [Cut(*found.span(), "\n") for found in _RETURN.finditer(formula)]
    return left.merged([*blanks, *ends, *_of_forums(formula), *framing.frames(formula)])


def _around_environments(formula: str) -> Iterator[Cut]:
    r"""The braces of {\displaystyle {\begin{aligned}...\end{aligned}}}, as encyclopedias write it."""
    first, opened = _OPENS_ENVIRONMENT.search(formula), list[tuple[int, bool]]()
    for found in _BRACES.finditer(formula, first.start()) if first else ():
        if found[0] == "{":
            opens = _OPENS_ENVIRONMENT.match(formula, found.start())
            opened.append((found.start(), opens is not None))
        elif found[0] == "}" and opened:
            start, is_around = opened.pop()
            if is_around and formula[: found.start()].rstrip()[-1:] == "}":
                yield from (Cut(start, start + 1), Cut(found.start(), found.end()))


def _of_forums(formula: str) -> Iterator[Cut]:
    """The [tex] and [/tex], ``` and `, and marks of lists of a text from a forum."""
    items = 0
    for found in _FORUM.finditer(formula):
        start, stop = found.span()
        before = formula[:start]
        if found["quoted"] is not None:
            if "=" in found["quoted"] or "'" in found["quoted"]:
                yield from (Cut(start, start + 1), Cut(stop - 1, stop))
        elif found["frame"] or before.count("(") == before.count(")") - items:
            items += (found["item"] or "").count(")")
            yield Cut(start, stop, "\n" * bool(before.strip()))


def _ask_about_primes(tokens: Line, energy: bool, latex: bool) -> None:
    """InputError for the I' of a Lagrangian that also has dots: the prime may be a mark or a
    derivative by a position.

    Also for theta' in an equation in which theta has two dots, and for K' in one with dots.
    """
    words = [
        (line[place], at(line, place + 1))
        for line, place, _ in tk.places(tokens)
        if line[place].kind == "name"
    ]
    dotted = {
        token.text
        for token, _ in words
        if token.primed == token.column and (energy or token.order > 1)
    }
    alone = {token.text for token, _ in words if not token.order}
    for token, after in words:
        again = token.text in dotted and token.order == 1
        marked = token.order == 1 and _MARKED.fullmatch(token.text) is not None
        marked &= token.text not in alone  # of a constant without a prime more is said
        factor = after.is_fraction() or (marked and tk.moves(after.inside))
        if (
            token.primed > token.column
            and (factor or not after.is_bracket())
            and (again or (dotted and (energy or marked)))
        ):
            name, span = token.text, (token.column, token.primed + token.order)
            meant = (f"{name}_1", *((f"{name}_{{dot}}" if latex else f"{name}_dot",) * again))
            raise fault("prime next to dots", token.column, span, meant, name=name)


def _with_forms(tokens: Line, names: Names, moves: bool) -> list[Token]:
    """The tokens with z' for dz and 1 for dt, x*1 for x dt: a Pfaffian form divided by dt."""
    found: list[Token] = []
    for place, length, factor, name in differentials(tokens, names, moves):
        token = tokens[place]
        if name == "t":
            found += factor
            times = at(found, len(found) - 1).kind in ("name", "number", "bracket")
            found += [Token("operator", "*", token.column)] * times
            found.append(Token("number", "1", token.column, True, Fraction(1)))
        elif names.role_meant(name) == "coordinate":
            found += [
                *factor,
                Token("name", name, token.column, True, OF_A_FORM, order=1, primed=token.column),
            ]
        else:
            whole = tk.within(token, lambda inside: _with_forms(inside, names, moves))
            found += [whole, *tokens[place + 1 : place + length]]
    return found


def differentials(
    tokens: Line, names: Names, moves: bool
) -> Iterator[tuple[int, int, list[Token], str]]:
    """(place, number of tokens, factor, name) of each dz, y dx, and ydx; each other token
    separately, without a name.

    The d is a constant in d theta', and in d x with a space if anything `moves`.
    """
    place = 0
    while place < len(tokens):
        token, following = tokens[place], at(tokens, place + 1)
        name, length, factor = "", 1, list[Token]()
        if (
            token.kind == "name"
            and "d" in token.text
            and not token.order
            and names.role(token.text) is None
        ):
            before, _, name = token.text.partition("d")
            known = names.role_meant(before) is not None or len(before) == 1
            factor = [replace(token, text=before)] * bool(before)
            name = name if known or not before else ""
        apart = following.order or (moves and following.space_before)
        alone = token.text == "d" and not token.order and names.role("d") is None
        if (alone and not (name or apart)) or token.is_operator(tk.TOTAL):
            name, length = (following.text, 2) if following.kind == "name" else ("", 1)
        yield place, length, factor, name
        place += length


def _letters_of_forms(tokens: Line, names: Names) -> list[str]:
    lines = [tokens, *(token.inside for token in tk.walk(tokens) if token.inside)]
    found = [name for line in lines for *_, name in differentials(line, names, tk.moves(tokens))]
    return [name for name in found if _LETTER_OF_A_FORM.fullmatch(name)]


def names_in_forms(text: str) -> set[str]:
    """The names z and x in dz - y dx."""
    return {*_letters_of_forms(tokens_if_any(text, Names()), Names())}


def moving_in_forms(tokens: Line, names: Names) -> list[str]:
    """The undeclared single-letter names z and x of dz - y dx = 0 and of dz = 0."""
    found: list[str] = []
    for line in tk.split_at(";,", tokens):
        each, alone = _letters_of_forms(line, names), tk.spelled(line[-2:]) == "=0"
        if (len(each) > 1 or (each and alone)) and not tk.moves(line):
            found += [name for name in each if name != "t" and names.role_meant(name) is None]
    return found


def _ask_about_displacements(tokens: Line, names: Names) -> None:
    """InputError for delta z in delta z = y delta x, usually a virtual displacement."""
    if names.role("delta") or tk.moves(tokens):
        return
    for delta, moving in itertools.pairwise(tk.walk(tokens)):
        if delta.text == "delta" and names.role_meant(moving.text) == "coordinate":
            raise fault(
                "virtual displacement",
                delta.column,
                (delta.column, moving.span[1]),
                name=moving.text,
            )


def _without_labels(tokens: list[Token], names: Names) -> list[Token]:
    """The tokens without the eq := of eq := x'' = -x; the omission is noted.

    The name of a form, as in mu = sin(theta) dx - cos(theta) dy or phi = z' - y x' = 0, is omitted
    too.
    """
    found: list[Token] = []
    for line, end in tk.split(tokens, lambda _, token: token.is_operator(";", ",")):
        line = _without_named_side(line, tokens, names)
        equal = 1 + (names.forms and at(line, 1).is_bracket())  # phi(q, q') = ... too
        rest = line[equal + 1 :]
        if (
            at(line, 0).kind == "name"
            and not line[0].order
            and rest
            and line[equal].is_operator("=")
        ):
            given = line[equal].value == tk.GIVEN and any(
                token.is_operator("=") for token in tk.walk(rest)
            )
            last = len(rest) > 2 and tk.spelled(rest[-2:]) == "=0"
            form = any(token.order and token.value == OF_A_FORM for token in tk.walk(rest))
            held = (
                names.forms
                and (last or form)
                and line[0].text not in "LTUVK"
                and names.role_meant(line[0].text) != "coordinate"
            )
            if given or held:
                note(f"{line[0].text} {':' * given}=", LEFT_OUT)
                line = (
                    rest if given or last else [Token("number", "0", line[0].column), *line[equal:]]
                )
        found += [*line, *([end] if end else [])]
    return found


def _without_named_side(line: list[Token], tokens: Line, names: Names) -> list[Token]:
    """m x'' = -k x for F = m x'' = -k x and m x'' = F = -k x, where F does not occur again."""
    sides = tk.split_at("=", line)
    if len(sides) != 3 or not any(token.order > 1 for token in tk.walk(line)):
        return line
    once = [
        k
        for k, side in enumerate(sides)
        if [token.kind for token in side] == ["name"]
        and not side[0].order
        and names.role_meant(side[0].text) is None
        and sum(token.text == side[0].text for token in tk.walk(tokens)) == 1
    ]
    if len(once) != 1:
        return line
    named = sides.pop(once[0])[0]
    note(named.text, "the name of a side")
    equal = next(token for token in line if token.is_operator("="))
    return [*sides[0], replace(equal, column=sides[1][0].column), *sides[1]]


def tokens_if_any(formula: str, names: Names) -> list[Token]:
    """The tokens; empty for a formula that cannot be tokenized, whose error is reported when it is
    parsed.
    """
    with suppress(errors.InputError):
        return read_tokens(formula, names)
    return []


def _without_remarks(tokens: list[Token], formula: str, names: Names) -> list[Token]:
    """The tokens without initial conditions, equation numbers, and conditions such as k > 0; each
    omission is noted.

    `where` and `with` between an equation and a definition are separators. Comparisons are omitted
    only next to equations.
    """
    marks = {token.text for token in tk.walk(tokens)}
    tokens = _with_definitions_apart(tokens) if "=" in marks else tokens
    if not (marks & {*tk.COMPARED, *_JOINS, *_CONSTANT, "="} or names.energy):
        return tokens

    joins = _joins(tokens, names)
    apart = [
        Token("operator", ";", token.column) if k in joins else token
        for k, token in enumerate(tokens)
    ]
    groups = tk.split(apart, lambda _, token: token.is_operator(";", ","))
    equations = any(_has(group, "=") and not _is_initial(group) for group, _ in groups)
    found: list[Token] = []
    for place, (group, end) in enumerate(groups):
        rest = itertools.dropwhile(
            lambda pair: len(pair[0]) == 1, groups[place + 1 :]
        )  # m, k, b > 0
        following = next(rest, ([], None))[0]
        group = _without_condition(group, formula)
        listed = (
            end is not None
            and end.is_operator(",")
            and len(group) == 1
            and _is_condition(following)
        )
        omitted = bool(group) and (_is_initial(group) or _is_number(group))
        if equations and (omitted or (group and (_is_condition(group) or listed))):
            stop = end.column - 1 if end is not None else len(formula)
            cuts = cuts_of(formula, names.declared())
            typed = left.text_between_cuts(formula, cuts, group[0].column - 1, stop).strip(
                " \t\n$.,;"
            )
            whole = all(
                typed.count(opening) == typed.count(closing)
                for opening, closing in tk.CLOSING.items()
            )
            note(typed if whole else tk.source(group), LEFT_OUT if omitted else CONDITION)
            group = []
        equal = group and (names.energy or _has(group, "="))
        found += _without_number(group, formula, names) if equal else group
        found += (
            [end] if end is not None and (group or not found) else []
        )  # a word that begins `rest` is a remark
    return found


def _with_definitions_apart(tokens: list[Token]) -> list[Token]:
    """The tokens with x'' = -w^2 x; w^2 = k/m for x'' = -w^2 x (w^2 = k/m)."""
    found: list[Token] = []
    for token in tokens:
        inside = token.inside if token.is_bracket() and token.space_before else ()
        if found and found[-1].is_operator("="):  # ics = (x(0) = 1, x'(0) = 0)
            inside = ()
        if inside and inside[0].kind == "name" and _has(inside, "="):
            found += [
                Token("operator", ";", token.column),
                *inside,
                Token("operator", ";", token.end),
            ]
        else:
            found.append(token)
    return found


def _joins(tokens: Line, names: Names) -> set[int]:
    """The places of words such as "where" that join a definition or a condition to an equation."""
    words = {
        place: _JOINS[token.text]
        for place, token in enumerate(tokens)
        if token.kind == "name" and token.text in _JOINS and not names.role(token.text)
    }
    # Whether what ends the words from a place on is a sign that is wanted, from the last place to
    # the first.
    signed = {wanted: [False] * (len(tokens) + 2) for wanted in {*words.values()}}
    for wanted, ends in signed.items():
        for place in reversed(range(len(tokens))):
            token = tokens[place]
            is_end = token.is_operator(*wanted, ";", ",") or token.text in _BRANCHES
            ends[place] = token.is_operator(*wanted) if is_end else ends[place + 1]

    def behind(place: int) -> int:
        return place + 1 + at(tokens, place + 1).is_operator(";")  # on a separate line

    return {place for place, wanted in words.items() if signed[wanted][behind(place)]}


def _has(group: Line, *signs: str) -> bool:
    return any(token.is_operator(*signs) for token in group)


def _is_condition(group: Line) -> bool:
    """Whether it is k > 0 or 0 < k < 1."""
    return (
        _has(group, *tk.COMPARED)
        and not _has(group, "=")
        and not any(token.text in _BRANCHES for token in group)
    )


def _without_condition(group: list[Token], formula: str) -> list[Token]:
    """The equation without a following (k > 0) that contains no moving names."""
    last, before = at(group, len(group) - 1), at(group, len(group) - 2)
    apart = (
        len(group) > 1
        and last.is_bracket()
        and last.space_before
        and not before.is_operator(*"+-*/^=")
    )
    moving = {token.text for token in tk.walk(group) if token.order and token.kind == "name"}
    if not (apart and _is_condition(last.inside)) or moving & {
        token.text for token in tk.walk(last.inside)
    }:
        return group
    note(formula[last.column : last.end - 1], CONDITION)
    return group[:-1]


def _is_initial(group: Line) -> bool:
    """Whether it is x(0) = 1, x'(t_0) = v, x = x(t), or k = const."""
    start = 0
    while at(group, start + 1).is_operator("=") and at(group, start + 1).value == tk.GIVEN:
        start += 2  # ic := x(0) = 0
    if start and len(group) < start + 2 and not at(group, start).is_bracket():
        return False
    group = group[start:]
    if len(at(group, 0).inside) == 1 and at(group, 1).is_bracket():  # (x)(0) = 1 of Maple
        group = [*group[0].inside, *group[1:]]
    first, rest = at(group, 0), tk.spelled(group[1:])
    listed = at(group, len(group) - 1)  # ics := {x(0) = 1, x'(0) = 0}
    if listed.is_bracket() and (len(group) == 1 or tk.spelled(group[1:-1]) == "="):
        return all(_is_initial(part) for part in tk.split_at(",", listed.inside))
    said = rest.startswith("=") and rest.endswith(
        ("isconstant", "isaconstant")
    )  # h = r^2 phi' is constant
    itself = (f"={first.text}(t)", *["=y(x)"] * (first.text == "y"))  # not V = V(r)
    if not first.order and (said or rest in (*itself, *(f"={word}" for word in _CONSTANT))):
        return True
    if first.text in DERIVATIVE_NAMES and at(group, 1).is_bracket():  # diff(x(t), t)(0) = 1
        rest = tk.spelled(group[2:])
    timed = re.match(r"\((?:t_?[0-9]|-?[0-9.]*\*?pi(?:/[0-9]+)?|-?[0-9.]+(?:/[0-9]+)?)\)=", rest)
    return first.kind == "name" and timed is not None


def _without_number(group: list[Token], formula: str, names: Names) -> list[Token]:
    """The equation without its number: (1) or 1. before it, (1) after it."""
    first, second, number = at(group, 0), at(group, 1), at(group, len(group) - 1)
    named = second.kind == "name" or second.is_bracket()
    item = named and (_is_item(group) or (_is_number(group[:1]) and len(first.inside) == 1))
    if item or (first.kind == "number" and first.text.endswith(".") and second.space_before):
        note(tk.spelled(group[:1]), LEFT_OUT)
        return group[1:]
    if re.fullmatch(
        r"\d+\.\d+\s\s+", formula[first.column - 1 : second.column - 1]
    ):  # 6.3  y'' + y = 0
        raise fault(
            "number or factor", first.column, (first.column, second.column), number=first.text
        )
    if len(group) < 2 or not _is_number([number]):
        return group
    before, shown = group[-2], tk.spelled([number])
    known = FUNCTIONS if len(before.text) == 1 else FUNCTIONS | MAY_BE_FUNCTIONS  # mg (1)
    called = before.kind == "name" and (
        before.text in known or names.role_meant(before.text) == "function"
    )
    ends = formula[number.column - 1] == "(" and number.space_before
    if not ends or called or before.kind == "operator":
        return group
    if number.inside[-1].kind == "name":
        if "." not in shown or (names.role(number.inside[1].text) and not names.guesses):
            return group
        raise fault("equation number", number.column, shown=shown)
    note(shown, LEFT_OUT)
    return group[:-1]


def _is_item(group: Line) -> bool:
    """Whether it begins with (a) or (ii) and this text does not occur again."""
    letter = tk.spelled(group[0].inside)
    again = any(token.text == letter for token in tk.walk(group[1:]))
    return group[1].space_before and bool(prose.ITEM.fullmatch(tk.spelled(group[:1]))) and not again


def _is_number(group: Line) -> bool:
    """Whether it is (3.2) or (3.2a), as the number of an equation."""
    if len(group) != 1 or not group[0].is_bracket() or group[0].value or group[0].order:
        return False
    return re.fullmatch(r"\([0-9.]+[A-Za-z]?\)", tk.source(group)) is not None


def _is_letter(part: str, names: Names) -> bool:
    """Whether a factor is one letter of a constant."""
    return len(part) == 1 and part.isalpha() and part != "t" and part not in names.coordinates


def _may_be_constant(parts: Sequence[str], names: Names) -> bool:
    """Whether the parts of a run of letters could be one constant: mgl, GMm, and wt."""
    timed = len(parts) == 2 and parts[1] == "t"
    return (len(parts) > 2 or timed) and all(
        _is_letter(part, names) for part in (parts[:1] if timed else parts)
    )


def _with_products(tokens: Line, names: Names) -> list[Token]:
    """The tokens with x'' for x_ddot and the runs of letters in `names.splits` split, with brackets
    after functions.
    """
    found: list[Token] = []
    for place, token in enumerate(tokens):
        dotted = names.derivative_of_any(token.text) if token.kind == "name" else None
        entry = [each.kind for each in at(tokens, place + 1).inside[:1]] == ["number"]
        if dotted and not entry:  # xdot(1) is an entry of the array of rates
            token = replace(
                token, text=dotted[0], order=token.order + dotted[1], primed=token.column
            )
        parts = names.splits.get(token.text, ()) if token.kind == "name" else ()
        if not parts:
            found.append(tk.within(token, lambda inside: _with_products(inside, names)))
            continue
        fixed = not token.order and _may_be_constant(parts, names)
        note(token.text, written_product(parts, names), constant=token.text * fixed)
        product = list[Token]()
        column = token.column + len(token.text)
        for part in reversed(parts):
            column -= len(part)
            kind: tk.Kind = "number" if part.isdigit() else "name"
            one = Token(
                kind, part, column, False, Fraction(part) if part.isdigit() else Fraction(0)
            )
            function = (
                part in FUNCTIONS
                and names.role(part) is None
                and not at(tokens, place + 1).is_operator("^")
            )
            if product and function and not token.order:
                product = [one, tk.bracket(product, product[0], space=False)]
            else:
                product = [one, *product]
        last = replace(product[-1], order=token.order, primed=token.primed)
        found += [*product[:-1], last]
        found[-len(product)] = replace(found[-len(product)], space_before=token.space_before)
    return found


def _refuse_dots_between_letters(formula: str, cuts: Cuts) -> None:
    """InputError for m\u00a8x alone, because the dots may belong to either letter."""
    if not any(sign in formula for sign in _SPACING_DOTS):
        return
    plain = left.text_between_cuts(formula, cuts)
    between = _BEFORE_A_LETTER.search(plain)
    if between is None or _BEGINS_WITH_DOTS.search(plain) or _ENDS_WITH_DOTS.search(plain):
        return
    place = formula.index(between[0])
    dots, letter = between.groups()
    primes = "''" if dots == "\u00a8" else "'"
    words = {"before": formula[place - 1], "after": letter, "primes": primes}
    raise fault("dots between letters", place + 1, (place, place + 3), **words)


def _with_dots_after_letters(tokens: Line, formula: str) -> list[Token]:
    """The tokens with the dots of \u00a8x at the x, for texts copied from a PDF, which have \u00a8x or
    x\u00a8 for x''.
    """
    if not _BEGINS_WITH_DOTS.search(formula):
        return [*tokens]
    found: list[Token] = []
    for token in tokens:
        token = tk.within(token, lambda inside: _with_dots_after_letters(inside, formula))
        dots = at(found, len(found) - 1)
        after_name = dots.order and dots.primed and formula[dots.primed - 1] in _SPACING_DOTS
        behind = token.column > 1 and formula[token.column - 2] in _SPACING_DOTS
        if token.kind != "name" or not behind:
            found.append(token)
            continue
        order = 0
        if dots.kind == "prime":
            order = int(found.pop().value)
        elif after_name:
            order = 2 if formula[token.column - 2] == "\u00a8" else 1
            left_over = dots.order - order
            found[-1] = replace(dots, order=left_over, primed=dots.primed * bool(left_over))
        first, rest = token.text[:1], token.text[1:]
        letters_apart = order and rest.isalpha()
        name = first if letters_apart else token.text
        found.append(replace(token, text=name, order=token.order + order, primed=token.column))
        if letters_apart:
            found.append(replace(token, text=rest, column=token.column + 1, space_before=False))
    return found


def parts(formula: str, declared: Iterable[str] = ()) -> Iterator[tuple[int, int]]:
    """(start, stop) of what is read of a text."""
    for start, stop, _ in left.kept_parts(formula, cuts_of(formula, declared)):
        yield start, stop


def kept_text(formula: str) -> str:
    """What is read of a text, to be looked at."""
    return left.text_between_cuts(formula, cuts_of(formula))


def kept_part(typed: Typed, start: int, stop: int) -> Typed:
    """What is read of a part of a text."""
    found = typed.made("")
    for begin, end, cut in left.kept_parts(typed.text, cuts_of(typed.text), start, stop):
        found += typed[begin:end] + typed.made(" " * (cut is not None), end)
    return found


def without_words(typed: Typed) -> Typed:
    """The text without what is no formula in it, which is noted, and with the separators that are
    read in its place.
    """
    found, start = typed.made(""), 0
    for cut in cuts_of(typed.text):
        for words in cut.notes:
            note(words)
        found += typed[start : cut.start] + typed.made(f"{cut.sign} ", cut.start)
        start = cut.stop
    return found + typed[start:]


@dataclass(frozen=True, slots=True)
class EquationTokens:
    """The tokens of one equation and the column just after it."""

    tokens: tuple[Token, ...]
    end_column: int


def split_equations(formula: str, names: Names) -> list[EquationTokens]:
    """One entry for each nonempty equation; ; or line ends or commas outside brackets separate
    equations.

    The entries are tokens, so that each equation can raise its own error. InputError if commas
    separate parts of which only some have an =.
    """
    tokens = read_tokens(formula, names)
    _refuse_bullets(tokens, formula)
    parts = tk.split(tokens, lambda _, token: token.is_operator(";", ","))
    commas = [end for _, end in parts if end is not None and end.is_operator(",")]
    groups = [
        EquationTokens(tuple(part), end.column if end else len(formula) + 1) for part, end in parts
    ]
    found = [group for group in groups if group.tokens]
    if (
        commas
        and len({any(token.is_operator("=") for token in group.tokens) for group in found}) > 1
    ):
        raise fault("comma in an equation", commas[0].column)
    return found


def split_as_typed(formula: str) -> list[EquationTokens]:
    """The same before the components of vectors are put in, for a text in which each part has its
    =; nothing for other texts.
    """
    try:
        tokens, _ = _scanned(formula, Names(forms=True))
    except errors.InputError:
        return []
    parts = tk.split(tokens, lambda _, token: token.is_operator(";", ","))
    found = [
        EquationTokens(tuple(part), end.column if end else len(formula) + 1)
        for part, end in parts
        if part
    ]
    equal = all(any(token.is_operator("=") for token in group.tokens) for group in found)
    return found if equal else []


def _refuse_bullets(tokens: Line, formula: str) -> None:
    """InputError for lines that all begin with "- ", usually a bullet; -x'' = x in one line is
    accepted.
    """

    parts = tk.split(
        tokens, lambda _, token: token.is_operator(";") and formula[token.column - 1] == "\n"
    )
    full = [line for line, _ in parts if line]
    listed = (line[0].is_operator("-") and line[1:] and line[1].space_before for line in full)
    if (
        len(full) > 1
        and all(listed)
        and all(any(token.is_operator("=") for token in line) for line in full)
    ):
        raise fault("bullets", full[0][0].column)


def read_equation(equation: EquationTokens, names: Names) -> tuple[ex.Expression, ex.Expression]:
    """(left, right); right is 0 if there is no =."""
    parts = tk.split(equation.tokens, lambda _, token: token.is_operator("="))
    ends = [end.column for _, end in parts if end]
    columns = [*ends, equation.end_column]
    pairs = [(part, end) for (part, _), end in zip(parts, columns, strict=True)]
    if len(pairs) > 2:
        pairs = _without_equal_side(pairs, names)
    sides = [parser.parse_tokens(part, end, names) for part, end in pairs]
    return sides[0], sides[1] if ends else ex.ZERO


def _without_equal_side(
    sides: Sequence[tuple[list[Token], int]], names: Names
) -> list[tuple[list[Token], int]]:
    """The a = c of a = b = c where a and b, or b and c, are the same sum of products, as in
    (r^2 theta')' = r^2 theta'' + 2 r r' theta' = 0; InputError for others.
    """
    column, meant = sides[1][1], tuple[str, ...]()
    with suppress(errors.InputError):
        trees = [parser.parse_tokens(part, end, names) for part, end in sides]
        for place, (one, other) in enumerate(itertools.pairwise(trees)):
            difference = op.sum_of([one, op.product([ex.MINUS_ONE, other], column)], column)
            if len(sides) == 3 and collecting.collect(difference) == ex.ZERO:
                return [side for k, side in enumerate(sides) if k != 1 + place]
        first, *others = (tk.source(part) for part, _ in sides)
        meant = tuple(f"{first} = {text}" for text in others)
    raise fault("second =", column, None, meant)


def refuse_remark(line: Line, place: int, alone: Collection[str]) -> None:
    """InputError for a word next to a factor that is not meant as one, such as damping, unless it
    is in `alone`.

    Also for the drag of (drag -b x'), and for (spring) after an equation and (a) before one.
    """
    token, before, after = line[place], at(line, place - 1), at(line, place + 1)
    shown = shorten(token.text)
    unknown = token.kind == "name" and token.text not in alone
    if unknown and _is_signed_term(line, place) and prose.is_word(token.text):
        span = (token.column, at(line, place + 2).column)
        raise fault("word before a sign", token.column, span, name=token.text, sign=after.text)
    behind = before.text not in FUNCTIONS and before.kind in ("name", "number", "prime", "bracket")
    ahead = after.kind in ("name", "number") or (after.is_bracket() and after.space_before)
    if unknown and (behind or ahead) and prose.is_word(token.text):
        short = ["*".join(token.text)] * (len(token.text) <= prose.SHORTEST_WORD + 1)
        meant = (*(f"{'*' * behind}{name}{'*' * ahead}" for name in (token.text, *short)), " ")
        raise fault("word as a factor", token.column, token.span, meant, shown=shown)
    if (
        not token.is_bracket()
        or tk.moves(token.inside)
        or {each.kind for each in token.inside} != {"name"}
    ):
        return
    begins = _is_edge(before) and after.kind == "name"
    power = before.is_bracket() and at(line, place - 2).is_operator("^")
    raised = power and at(line, place - 3).text in FUNCTIONS  # sin^{2} (omega t)
    if begins or (token.space_before and behind and _is_edge(after) and not raised):
        shown = shorten(f"({' '.join(each.text for each in token.inside)})")
        raise fault("words in brackets", token.column, shown=shown)


def alone(lines: Iterable[Line]) -> set[str]:
    """The names that occur between signs, have primes, or occur twice, and are therefore not
    remarks.
    """
    found, once = set[str](), set[str]()
    for line, place, _ in (each for tokens in lines for each in tk.places(tokens)):
        name, beside = line[place], (at(line, place - 1), at(line, place + 1))
        signs = all(token.kind in ("end", "operator") for token in beside) and not _is_signed_term(
            line, place
        )
        if name.kind == "name" and (signs or name.order or name.text in once):
            found.add(name.text)
        once.add(name.text)
    return found


def _is_signed_term(line: Line, place: int) -> bool:
    """Whether a term with its own sign follows the name at the beginning of a bracket: the -b x' of
    (drag -b x').
    """
    sign, after = at(line, place + 1), at(line, place + 2)
    apart = (
        sign.is_operator("-", "+")
        and sign.space_before
        and after.kind != "end"
        and not after.space_before
    )
    return apart and place == 0 and line[place].kind == "name"


def _is_edge(token: Token) -> bool:
    """Whether an equation ends or begins at this token."""
    return token.kind == "end" or token.is_operator(";", ",")


def equation_line(name: str, text: str) -> str:
    """x'' = f, or E = 0 for an equation that is not solved for the accelerations."""
    return f"{text} = 0" if has_acceleration(text) else f"{name}'' = {text}"


def has_acceleration(text: str) -> bool:
    """Whether a printed formula contains an x''; A''(x) is the derivative of a function."""
    return _ACCELERATION.search(text) is not None
