r"""Remove the words around the formulas of a text: sentences, titles, equation numbers, and
statements about sets.

    text    = clause {separator clause}        ; , line ends, \quad, : ? and the period of a
    sentence separate clause  = {piece}                          a word; a remark, \text{words} or
    (words); a sign, = + '; or a name, m, 2 run     = word {name} word ...             words of a
    clause with nothing but names between them

A run is a sentence if it has a word such as "is" or "the", and a title if it has several words at
an end of its clause. Both are removed, a sentence together with the names next to it, as is a
clause without = that contains a word or ends with a colon. Everything else remains: a single word
may be a name, and the parser asks about it if it would be a factor. What is removed is a cut of
the text, in whose place a separator is read, and is noted for the reader of the answer.
"""

import re
from collections.abc import Collection, Container, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

from inverse_service.expressions import letters
from inverse_service.expressions.refusals import LIMITS
from inverse_service.reading import names as nm
from inverse_service.reading.cuts import Cut, Cuts, kept_parts, merged, text_between_cuts
from inverse_service.reading.rules import distributions
from inverse_service.reading.tokens import OF_MATHEMATICA

_WORDS = {kind: frozenset(words) for kind, words in nm.WORDS["sentences"].items()}
# Words that make a sentence, that can begin a clause alone, and that a formula may follow.
_OF_SENTENCES, BEGINNINGS, _OPENERS = (
    _WORDS[kind] for kind in ("sentences", "beginnings", "openers")
)
DOTS = ("...", "\u2026")  # as if something followed
SHORTEST_WORD = 4  # letters from which on a word is unlikely to be a product of constants
_BINDING = nm.pattern("prose", "binding")
_CONSTANT = re.compile(r"\b(?:is|are)\s+(?:an?\s+)?const(?:ant)?s?$")  # h = r^2 phi' is constant
_PIECES = nm.pattern("prose", "pieces")
_ENDED = nm.pattern("prose", "ended")
_OF_RUNS = ("word", "remark", "numbered", "wrapped", "short")
_CLOSING = {"(": ")", "[": "]", "{": "}", "\\{": "\\}", "\\(": "\\)", "\\[": "\\]"}
_OF_LETTERS = sorted((*letters.LETTER_COMMANDS, *nm.FUNCTIONS), key=len, reverse=True)
_PRODUCT = re.compile(
    "[A-Za-z]{0,3}(?:%s)(?:[A-Za-z]{0,2}|%s)"
    % (("|".join(w for w in _OF_LETTERS if len(w) > 2),) * 2)
)
_COMMENT = re.compile(r"(?<!\\)%[^\n]*")
_WRAPPER = re.compile(r"\\text\w*\s*\{|\\mbox\s*\{|[{}$]")
_WRAPPED = nm.pattern("prose", "wrapped")
_OF_LAGRANGIAN = re.compile(r"(?i)\blagrang(?:ian|e function)\b[^.;]*(?:\bis\b|:)[^.;]*\Z")
_COMPARES = re.compile(r"[=<>\u2264\u2265]|\\(?:le|ge|ne|equiv)")
# The $ and \\( of $x'' = -x$, next to words or other formulas; not Maple's t$2, nor \\[Theta].
_DELIMITERS = re.compile(r"\$\$?|(?<!\\)(?<!\\!)\\(?:[()\]]|\[(?![A-Z][A-Za-z]+\]))")
_JOINED = re.compile(r"\b(?:and|with|where)(?=[\s$]+\\[^;,.]*=)")
ITEM = re.compile(r"\((?:[a-h]|[ivx]+)\)")  # (a), (ii)
_FIRST_ITEM, _ITEM_INSIDE = (
    re.compile(r"\s*\([ai]\)\s"),
    re.compile(r"\s\((?:[b-h]|i[iv]i?)\)(?=\s)"),
)
_SETS = nm.pattern("prose", "sets")
_SHORT_WORD = nm.pattern("prose", "short_word")
_WITH_DIGITS = re.compile(r"[A-Za-z]\d{1,3}\Z")  # ode45


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of a text: its kind (a group of `_PIECES` or "remark"), its place, and the pieces
    inside it.
    """

    kind: str
    start: int
    end: int
    text: str
    inside: tuple["Piece", ...] = field(default=())
    marked: bool = False


def with_cut_words(text: str, latex: bool, declared: Container[str], cuts: Cuts) -> Cuts:
    """The cuts of a text and those of its words."""

    def with_cuts(found: Sequence[Cut]) -> Cuts:
        return merged([*cuts, *found])

    if latex:
        cuts = with_cuts([_said(text, comment) for comment in _found(_COMMENT, text, cuts)])
    if _FIRST_ITEM.match(text):
        cuts = with_cuts([Cut(*one.span(), ";") for one in _found(_ITEM_INSIDE, text, cuts)])
    cuts = with_cuts(_around_formulas(text, cuts))
    cuts = with_cuts([*_around_the_allowed(text, cuts)])
    cuts = with_cuts([*_of_numbered_forms(text, cuts)])
    cuts = with_cuts([_said(text, each, ";") for each in _found(_SETS, text, cuts)])
    words = []
    for start, end, said in _left_out(text, declared, cuts):
        notes = " ".join(_WRAPPER.split(text_between_cuts(text, cuts, start, end))).split()
        words.append(Cut(start, end, ";", (" ".join(notes).strip(" ,;"),) * said))
    return with_cuts(words)


def _found(pattern: re.Pattern[str], text: str, cuts: Cuts) -> Iterator[re.Match[str]]:
    """The matches in what is kept of a text."""
    for start, stop, _ in kept_parts(text, cuts):
        yield from pattern.finditer(text, start, stop)


def _said(text: str, found: re.Match[str], sign: str = "") -> Cut:
    return Cut(*found.span(), sign, (found[0].strip(),))


def _around_the_allowed(text: str, cuts: Cuts) -> Iterator[Cut]:
    """The cuts around the equations of a distribution, or around the form that is 0 on it."""
    for start, stop, _ in kept_parts(text, cuts):
        for whole, inside, is_form in distributions.allowed(text[start:stop]):
            yield Cut(start + whole.start, start + inside.start, "0=" if is_form else ";")
            yield Cut(start + inside.stop, start + whole.stop, ";")


def _of_numbered_forms(text: str, cuts: Cuts) -> Iterator[Cut]:
    """The cuts of the indices of forms."""
    for start, stop, _ in kept_parts(text, cuts):
        for index in distributions.indices(text[start:stop]):
            yield Cut(start + index.start, start + index.stop)


def formulas(text: str, cuts: Cuts = ()) -> list[tuple[int, int, int, int]]:
    r"""(start, start inside, end inside, end) of each formula between $ $, \( \), or \[ \]."""
    marks = [] if "\\!" in text else [*_found(_DELIMITERS, text, cuts)]  # boxes of Mathematica
    found: list[tuple[int, int, int, int]] = []
    place = 0
    while place + 1 < len(marks):
        first, last = marks[place], marks[place + 1]
        before, after = text[max(0, first.start() - 1) : first.start()], text[last.end() :][:1]
        if first[0][0] == "$":
            opens = not (before.isalnum() or before in tuple("_)\\"))
            pair = opens and last[0] == first[0] and not (after.isalnum() or after == "_")
        else:
            pair = first[0] in ("\\(", "\\[") and last[0] in ("\\)", "\\]")
        if pair and last.start() > first.end():
            found.append((first.start(), first.end(), last.start(), last.end()))
        place += 1 + pair
    return found


def _around_formulas(text: str, cuts: Cuts) -> list[Cut]:
    """The cuts around the formulas between dollar signs; of several, or of one next to words, only
    equations and comparisons are kept.
    """
    parts = formulas(text, cuts)
    if not parts:
        return []
    edges = [0, *(edge for part in parts for edge in (part[0], part[3])), len(text)]
    between = (
        text_between_cuts(text, cuts, start, end)
        for start, end in zip(edges[::2], edges[1::2], strict=True)
    )
    around = " ".join(" ".join(between).split()).strip(".,; ")
    alone = len(parts) == 1 and not around
    if re.search(r"=\s*[^\s;$]", around) and "$" not in around:
        said = [one.span() for one in _found(_WRAPPED, text, cuts)]
        signs = [
            one.span()
            for one in _found(re.compile(r"\$+|\\[()\[\]]"), text, cuts)
            if not any(start < one.start() < end for start, end in said)
        ]
        joined = [Cut(*word.span(), ";") for word in _found(_JOINED, text, cuts)]
        return [*(Cut(*sign) for sign in signs), *joined]
    inside = [
        part[1:3]
        for part in parts
        if alone or _COMPARES.search(text_between_cuts(text, cuts, *part[1:3]))
    ]
    if not inside and len(parts) == 1 and _OF_LAGRANGIAN.search(around):
        [(_, opens, closes, _)] = parts  # my Lagrangian is as follows: $m\dot x^2/2$
        return [Cut(0, opens, "L ="), Cut(closes, len(text), "", (around,))]
    if not inside or "$" in around:
        return []
    found, start = list[Cut](), 0
    for begin, end in inside:
        written = text[begin:end].rstrip()
        written = written if written.endswith("\\right.") else written.removesuffix(".")
        found.append(Cut(start, begin, ";" * (bool(found) and not alone)))
        start = begin + len(written)
    last = Cut(start, len(text), ";" * (not alone), (around,) * bool(around))
    return [*found, last]


def _scanned(text: str, cuts: Cuts) -> list[Piece]:
    """The pieces one by one, without spaces; for a cut, the pieces of the signs in its place."""
    found: list[Piece] = []
    for start, stop, cut in kept_parts(text, cuts):
        found += _pieces(text, start, stop)
        signs = _pieces(cut.sign, 0, len(cut.sign)) if cut else []
        found += [replace(sign, start=cut.start, end=cut.stop) for sign in signs if cut]
    return found


def _pieces(text: str, place: int, stop: int) -> list[Piece]:
    found: list[Piece] = []
    while place < stop and (match := _PIECES.match(text, place, stop)):
        kind, part = "wrapped" if match.lastgroup == "said" else str(match.lastgroup), match[0]
        if kind in ("opening", "name") and (letter := OF_MATHEMATICA.match(text, place, stop)):
            kind, part = "name", letter[0]
        if kind == "word" and not is_word(part):
            part = re.split("[-\u2010\u2013'\u2019]", part)[0]
        if kind != "space":
            marked = kind == "mark" or _is_dotted(part)
            found.append(Piece(kind, place, place + len(part), part, (), marked))
        place += len(part)
    return found


def _nested(pieces: Sequence[Piece], text: str) -> list[Piece]:
    """The pieces, where a bracket and its content are one piece; not those so deep inside others
    that the formula is refused, whose texts together would fill the memory.
    """
    outer: list[tuple[Piece, list[Piece]]] = []
    line: list[Piece] = []
    for piece in pieces:
        if piece.kind == "opening" and len(outer) <= LIMITS.depth:
            outer.append((piece, line))
            line = []
        elif piece.kind == "closing" and outer and _CLOSING[outer[-1][0].text] == piece.text:
            opening, before = outer.pop()
            marked = any(each.marked for each in line)
            whole = Piece(
                "opening",
                opening.start,
                piece.end,
                text[opening.start : piece.end],
                tuple(line),
                marked,
            )
            before.append(whole)
            line = before
        else:
            line.append(piece)
    for opening, before in reversed(outer):
        line = [*before, opening, *line]
    return line


@lru_cache(maxsize=4096)
def is_word(text: str) -> bool:
    """Whether the text is a word of a language, not a name, a function, or a product such as mgl or
    sintheta.
    """
    if _SHORT_WORD.fullmatch(text):
        return True
    plain = text.removesuffix("'s").removesuffix("\u2019s")
    parts = re.split("[-\u2010\u2013]", plain)
    if len(parts) > 1:
        return all(is_word(part) or part.lower() in _WORDS["prefixes"] for part in parts)
    if plain.lower() in _OF_SENTENCES | BEGINNINGS or (plain != text and len(plain) > 2):
        return True
    known = (
        plain
        in nm.FUNCTIONS | nm.DERIVATIVE_NAMES | nm.REFUSED.keys() | letters.LETTER_COMMANDS.keys()
    )
    if not plain.isascii():  # Painlevé, but not Greek letters
        symbols = any(letter in letters.GREEK for letter in plain) or all(map(nm.letter, plain))
        return len(plain) > 2 and not symbols
    if (
        known
        or len(plain) < SHORTEST_WORD
        or not plain.isalpha()
        or not (plain.islower() or plain.istitle())
    ):
        return False
    product = (
        _PRODUCT.fullmatch(plain) or plain.endswith("dot") or re.search("[xyz]{2}|[wxyz]{3}", plain)
    )
    return not product and re.search("[aeiouy]", plain.lower()) is not None


def _left_out(text: str, declared: Container[str], cuts: Cuts) -> Iterator[tuple[int, int, bool]]:
    """(start, end, whether to note it) of each part that is removed."""
    pieces = _scanned(text, cuts)
    named = _names_among(pieces, text, declared)
    clauses: list[tuple[list[Piece], Piece | None]] = [([], None)]
    for piece in _nested(pieces, text):
        if piece.kind in ("separator", "frame"):
            clauses[-1] = clauses[-1][0], piece
            clauses.append(([], None))
        else:
            clauses[-1][0].append(_as_remark(piece, clauses[-1][0], named, text))
    holds = any(piece.kind == "relation" for clause, _ in clauses for piece in clause)
    gone = [_is_gone(clause, end, holds, text) for clause, end in clauses]
    commas = [end is not None and end.text == "," for _, end in clauses]
    alone = [
        holds and len(clause) == 1 and clause[0].kind in ("word", "name") for clause, _ in clauses
    ]
    for place in reversed(range(len(clauses) - 1)):
        gone[place] |= alone[place] and commas[place] and gone[place + 1]
    for place, (clause, end) in enumerate(clauses):
        gone[place] |= place > 0 and alone[place] and commas[place - 1] and gone[place - 1]
        if clause and gone[place]:
            yield clause[0].start, end.end if end and end.text == ":" else clause[-1].end, True
        else:
            yield from _listed(clause) if commas[place] and gone[place + 1] else ()
            yield from _runs(clause, text)
        sign = end.text.strip()[:1] if end else ""
        goes_on = gone[place] or (
            place + 1 < len(clauses) and _has(clauses[place + 1][0], "relation")
        )
        starts = _ENDED.match(text, end.start) if end and end.kind == "frame" else None
        if starts:
            yield starts.start(), starts.end(), False
        if end and (
            (sign and sign in ".\u2026" and (end.text != "." or text[end.end :].strip()))
            or (sign == ":" and goes_on)
            or (sign == "?" and (gone[place] or not text[end.end :].strip(" $\n")))
        ):
            yield end.start, end.end, end.text.strip() in DOTS


def _names_among(pieces: Sequence[Piece], text: str, declared: Container[str]) -> set[str]:
    """The words that occur as factors or terms, or are declared."""
    found: set[str] = set()
    for place, piece in enumerate(pieces):
        if piece.kind != "word":
            continue
        before, after = (
            pieces[place - 1] if place else None,
            pieces[place + 1] if place + 1 < len(pieces) else None,
        )
        apart = (
            after and after.text in ("-", "+", "\u2212") and text[after.end : after.end + 1].strip()
        )  # is -sin(x)
        glued = after if after and after.start == piece.end else None
        touches = glued and (glued.kind in ("mark", "opening", "number") or glued.text == "_")
        signed = any(
            beside and beside.kind in ("sign", "relation")
            for beside in (before, None if apart else after)
        )
        behind = (
            before
            and before.end == piece.start
            and (before.kind in ("number", "mark") or before.text == "_")
        )
        if touches or signed or behind or piece.text in declared:
            found.add(piece.text)
    return found


def _as_remark(piece: Piece, before: Sequence[Piece], named: Collection[str], text: str) -> Piece:
    """The piece, with kind "word" only if it is a word, and "remark" for words in brackets."""
    if piece.kind == "word" and (piece.text in named or not is_word(piece.text)):
        return replace(piece, kind="name")
    last = before[-1] if before else None
    called = _WITH_DIGITS.search(text[max(0, piece.start - 4) : piece.start]) is not None
    argument = (
        last
        and last.end == piece.start
        and (called or last.kind in ("name", "word", "opening", "sign", "mark"))
    )
    if piece.kind == "opening" and not argument:
        kinds = {
            each.kind if each.inside else _as_remark(each, (), named, text).kind
            for each in piece.inside
        }
        if kinds & {"word", "numbered"} and not kinds & {"relation", "sign", "mark"}:
            return replace(piece, kind="remark", inside=())
    return piece


def _has(clause: Sequence[Piece], *kinds: str) -> bool:
    return any(piece.kind in kinds or ("mark" in kinds and piece.marked) for piece in clause)


def _is_dotted(word: str) -> bool:
    """Whether one of its letters has dots, such as \u1e8b."""
    return not word.isascii() and any((nm.letter(sign) or ("", 0))[1] for sign in word)


def _is_gone(clause: Sequence[Piece], end: Piece | None, holds: bool, text: str) -> bool:
    """Whether the whole clause is removed: a label, a clause of words without =, or a number after
    dots.
    """
    said = text[clause[0].start : clause[-1].end] if clause else ""
    meaning = (
        clause[2:]
        if len(clause) > 3 and clause[1].kind == "relation" and not clause[0].marked
        else ()
    )
    if meaning and all(piece.kind in ("word", "name") and is_word(piece.text) for piece in meaning):
        return True  # I = moment of inertia
    if not clause or _has(clause, "relation", "mark"):
        found = _CONSTANT.search(said)
        before = said[: found.start()] if found else ""
        return "=" in before and not re.search(r"\b(?:where|with)\b", before)
    if end and end.text == ":":
        return holds
    words = [piece for piece in clause if piece.kind in _OF_RUNS[: 3 + (len(clause) > 1)]]
    kept = clause[0].text[:1] != "(" or _has(clause[0].inside, "relation", "sign", "mark")
    only = len(clause) == 1 and holds and (clause[0].kind in ("remark", "numbered") or not kept)
    signed = _has(clause, "sign") and not _is_sentence(clause)
    return (only and not _BINDING.search(said)) or bool(
        holds and words and not signed and not _BINDING.search(said)
    )


def _is_sentence(run: Sequence[Piece]) -> bool:
    texts = (piece.text.lower() for piece in run if piece.kind in ("word", "wrapped"))
    return any(not _OF_SENTENCES.isdisjoint(re.findall(r"\w+", text)) for text in texts)


def _runs(clause: Sequence[Piece], text: str) -> Iterator[tuple[int, int, bool]]:
    """The places of the sentences, titles, and remarks in a clause that contains a formula."""
    place = 0
    while place < len(clause):
        first = place
        if clause[place].kind not in _OF_RUNS:
            place += 1
            continue
        last = place
        while (
            place < len(clause)
            and clause[place].kind in (*_OF_RUNS, "name", "number")
            and not clause[place].marked
        ):
            defined = clause[place + 2].kind == "relation" if place + 2 < len(clause) else False
            article = (
                clause[place].text in ("a", "A") and last == place - 1 and defined
            )  # Find a L = ...
            last = place if article or clause[place].kind not in ("name", "number") else last
            place += 1
        place = last + 1
        follows = place < len(clause) and clause[place].kind != "relation"
        if follows and place - first > 1 and clause[place - 1].kind == "word":
            place -= (
                clause[place - 2].text.lower() in _OPENERS
                and clause[place - 1].text.lower() not in _OF_SENTENCES
            )
        before, run, after = clause[:first], clause[first:place], clause[place:]
        if not _is_left_out(before, run, after, text):
            continue
        sentence = _is_sentence(run)
        start, end = run[0].start, run[-1].end
        if (
            before
            and not _has(before, "relation", "sign", "mark")
            and (sentence or before[-1].text in ("a", "A"))
        ):
            start = before[0].start
        if after and not _has(after, "relation", "sign", "mark") and sentence:
            end = after[-1].end
        yield start, end, run[0].kind != "short"


def _listed(clause: Sequence[Piece]) -> Iterator[tuple[int, int, bool]]:
    """The place of the "with a" that begins a list, as in x'' = -a x + b y with a, b real
    constants.
    """
    if (
        len(clause) > 2
        and clause[-2].text in ("with", "where", "and")
        and clause[-1].kind == "name"
    ):
        yield clause[-2].start, clause[-1].end, True


def _is_left_out(
    before: Sequence[Piece], run: Sequence[Piece], after: Sequence[Piece], text: str
) -> bool:
    """Whether a run is a sentence, a title at an end of its clause, or a remark."""
    words = [piece for piece in run if piece.kind == "word"]
    said = text[run[0].start : run[-1].end]
    if _BINDING.search(
        said if before else said.removesuffix(" for")
    ):  # the equation of motion for L = ...
        return False
    if not words:
        wrapped = [
            piece.text.partition("{")[2].removesuffix("}").strip()
            for piece in run
            if piece.kind == "wrapped"
        ]
        long = any(
            " " in each or each.endswith((":", ".", ")")) or ITEM.fullmatch(each)
            for each in wrapped
        )
        return (
            long or run[0].kind == "short" or (len(wrapped) < len(run) and not (before and after))
        )
    speaker = bool(before) and before[0].text == "I" and _is_sentence(run)  # I get T = ...
    article = not before or (len(before) == 1 and (before[0].text in ("a", "A") or speaker))
    if len(words) > 1:
        return _is_sentence(run) or article or not after
    names = list(after[:2])
    plain = len(names) > 1 and names[0].kind == "name" and names[1].kind in ("relation", "opening")
    defines = plain and any(piece.kind == "relation" for piece in after[1:3])
    begins = words[0].text.lower() in BEGINNINGS or _SHORT_WORD.fullmatch(words[0].text)
    speaks = speaker and any(piece.kind == "relation" for piece in after)
    return article and bool(after) and bool(begins or defines or speaks)
