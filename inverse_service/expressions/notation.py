"""The tensor notation of the theory as typed text: "g_ij R^j_kl", "Gamma(g) = g N + (g N)^T".

Only formulas composed by the program use it, never users' text. `Formula` joins such texts and
trees; `to_latex` and `to_mathml` convert them for display. `inequality` is the condition that a
tree is positive, such as x^2 + y^2 < 1.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

from inverse_service.expressions import collecting, printing, tree as ex

_TOKEN = re.compile(
    r"(?P<rate>d/dt)\b|(?P<name>[A-Za-z]+)(?P<marks>(?:[_^](?:\([^()]*\)|[A-Za-z0-9]+))*)(?P<primes>'*)(?P<power>\^\d)?|\)(?P<above>\^\w)|(?P<digits>\d+)|(?P<space>\s+)|(?P<sign>[!<>]=|.)"
)
_MARK = re.compile(r"[_^](?:\([^()]*\)|[A-Za-z0-9]+)")
_PARTIAL = re.compile(r"d([a-zA-Z]|Phi)")
_GREEK = {
    "alpha": "\u03b1",
    "Gamma": "Γ",
    "Phi": "Φ",
    "nabla": "∇",
    "lambda": "λ",
    "mu": "μ",
    "Omega": "Ω",
    "phi": "φ",
    "tau": "τ",
}
_WORDS = frozenset(("det", "for", "and"))
_SIGNS = {"-": "\u2212", "*": "\u2062", "!=": "≠", ">=": "≥", "<=": "≤"}
_LATEX_SIGNS = {"*": " ", "\u2026": r"\dots", "!=": r"\neq ", ">=": r"\geq ", "<=": r"\leq "}
# dL/dx' in a sentence: L, x, an index such as that of v^i, primes.
SLOPE = re.compile(r"(?<![A-Za-z])d([LHFDTf])/d([A-Za-z][A-Za-z0-9_]*)(?:\^(\w))?('{0,2})")
# Brackets around the name of a tensor with an index, as in (nabla Phi)_12 and (nabla^2 Phi)^1_1.
BRACKETED = re.compile(r"\(((?:nabla(?:\^\d+)? )?Phi)\)(?=[_^])")
# The symbol of the multiplier: g, unless the system uses that name.
MULTIPLIER: ContextVar[str] = ContextVar("multiplier", default="g")
# Between the sides of a proposition.
SIDES = r", | (?:!=|>=|<=|=|>|<) "
_LETTER_G = re.compile(r"(?<![A-Za-z])g(?![A-Za-z])|(?<=\bd)g(?=_)")


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula as text; `letters` are the names of the theory in it with their lower indices (R
    without indices).
    """

    text: str
    letters: tuple[str, ...] = ()


def split_outside(text: str, signs: str) -> Iterator[tuple[str, str]]:
    """(sign, part) for each part of a text, split at the pattern `signs` outside brackets; the
    first sign is "".
    """
    depth, start, sign = 0, 0, ""
    for match in re.finditer(rf"[()\[\]{{}}]|{signs}", text):
        found = match.group()
        depth += (found in "([{") - (found in ")]}")
        if depth == 0 and found not in ")]}":
            yield sign, text[start : match.start()]
            sign, start = found, match.end()
    yield sign, text[start:]


def row(*pieces: Formula | ex.Expression | str) -> Formula:
    """The concatenated pieces; texts are in the notation of the theory."""
    parts = [formula_of(piece) for piece in pieces]
    return Formula(
        "".join(part.text for part in parts),
        tuple(letter for part in parts for letter in part.letters),
    )


def formula_of(piece: Formula | ex.Expression | str) -> Formula:
    """Any piece as a formula."""
    if isinstance(piece, str):
        return theory(piece)
    return piece if isinstance(piece, Formula) else Formula(printing.to_text(piece))


def matrix(rows: Sequence[Sequence[Formula | ex.Expression]]) -> Formula:
    """A matrix with these entries."""
    return Formula(f"[{', '.join(f'[{with_commas(line).text}]' for line in rows)}]")


def with_commas(formulas: Sequence[Formula | ex.Expression]) -> Formula:
    """The formulas, separated by commas."""
    return row(*[piece for formula in formulas for piece in (", ", formula)][1:])


def partial_derivative(of: Formula, by: ex.Expression) -> Formula:
    """dL/dx."""
    return Formula(f"d{of.text}/d{printing.to_text(by)}", of.letters)


@contextmanager
def multiplier_beside(names: Collection[str]) -> Iterator[None]:
    """Within the block, use a symbol for the multiplier that differs from these names."""
    letter = next(
        (one for one in ("g", "h", "m") if not any(n.partition("_")[0] == one for n in names)), "g"
    )
    token = MULTIPLIER.set(letter)
    try:
        yield
    finally:
        MULTIPLIER.reset(token)


def theory(text: str) -> Formula:
    """The formula of the theory with this text."""
    if MULTIPLIER.get() != "g":
        text = _LETTER_G.sub(MULTIPLIER.get(), text)
    letters: list[str] = []
    for match in filter(lambda match: match["name"], _TOKEN.finditer(text)):
        below = "".join(mark for mark in _MARK.findall(match["marks"]) if mark[0] == "_")
        letters += [match["name"] + match["primes"] + below, *["R"] * (match["name"] == "R")]
    return Formula(text, tuple(letters))


def to_latex(text: str) -> str:
    """The LaTeX of a text in the notation of the theory."""
    return "".join(latex for latex, _ in _written(text))


def to_mathml(text: str) -> str:
    """The same as the content of <math>."""
    return "".join(mathml for _, mathml in _written(text))


def _written(text: str) -> Iterator[tuple[str, str]]:
    """The LaTeX and the MathML of each token."""
    for match in _TOKEN.finditer(text):
        if match["rate"]:
            yield r"\frac{d}{dt}", "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"
        elif name := match["name"]:
            marks, primes = _MARK.findall(match["marks"] + (match["power"] or "")), match["primes"]
            if _is_differential(text, match):
                latex, mathml = _marked(name[1:], marks, primes)
                yield rf"\, d{latex}", f"<mi>d</mi>{mathml}"
            else:
                yield _marked(name, marks, primes)
        elif above := match["above"]:
            yield f"){_mark_latex(above)}", f"<msup><mo>)</mo><mrow>{_mark(above)}</mrow></msup>"
        elif digits := match["digits"]:
            yield digits, f"<mn>{digits}</mn>"
        elif match["space"]:
            yield " ", ""
        else:
            sign = match["sign"]
            is_first = text[: match.start()].rstrip()[-1:] in ("=", "(", ",", "")
            form = ' form="prefix"' if sign == "-" and is_first else ""
            yield _LATEX_SIGNS.get(sign, sign), f"<mo{form}>{escape(_SIGNS.get(sign, sign))}</mo>"


def _is_differential(text: str, match: re.Match[str]) -> bool:
    """Whether a name is the dv of an integral, not of a partial derivative such as dI/dv."""
    before, after = text[: match.start()], text[match.end() :]
    is_partial = before.endswith("/") or after.lstrip().startswith("/")
    return bool(_PARTIAL.fullmatch(match["name"])) and "int " in before and not is_partial


def _body(name: str) -> tuple[str, str]:
    """(LaTeX, MathML) of a name without its marks; dg is the partial derivative sign before g."""
    partial = _PARTIAL.fullmatch(name)
    if partial and name != "dt":
        latex, mathml = _body(partial[1])
        return rf"\partial {latex}", f"<mi>∂</mi>{mathml}"
    if name in _GREEK:
        return rf"\{name}", f"<mi>{_GREEK[name]}</mi>"
    if name == "int":
        return r"\int ", "<mo>∫</mo>"
    if name in _WORDS:
        return (r"\det " if name == "det" else rf"\text{{ {name} }}"), f"<mo>{name}</mo>"
    return (
        (name, f"<mi>{name}</mi>")
        if len(name) == 1 or name == "dt"
        else (rf"\mathrm{{{name}}}", f"<mi>{name}</mi>")
    )


def _marked(name: str, marks: Sequence[str], primes: str) -> tuple[str, str]:
    """(LaTeX, MathML) of a name with its marks."""
    latex, body = _body(name)
    command = latex.startswith("\\") and not latex.endswith(("}", " "))
    latex += "'" * len(primes) + "".join(map(_mark_latex, marks)) + " " * (command and not marks)
    sub, sup = ("".join(_mark(mark) for mark in marks if mark[0] == sign) for sign in "_^")
    base = body.removeprefix("<mi>∂</mi>")
    head = body.removesuffix(base)
    if sub and sup and not primes:
        return latex, f"{head}<msubsup>{base}<mrow>{sub}</mrow><mrow>{sup}</mrow></msubsup>"
    base = f"<msub>{base}<mrow>{sub}</mrow></msub>" if sub else base
    base = f"<mrow>{base}{printing.PRIME * len(primes)}</mrow>" if primes else base
    return latex, f"{head}<msup>{base}<mrow>{sup}</mrow></msup>" if sup else f"{head}{base}"


def _mark_latex(mark: str) -> str:
    inner = mark[1:].strip("()")
    shown = r"\mathsf T" if mark == "^T" else inner
    return f"{mark[0]}{{{shown}}}"


def _mark(mark: str) -> str:
    return "".join(
        f"<mn>{letter}</mn>" if letter.isdigit() else f"<mi>{escape(letter)}</mi>"
        for letter in mark[1:].strip("()")
    )


def inequality(tree: ex.Expression) -> Formula:
    """The condition that the tree is positive, with like terms collected if that is shorter."""
    return row(*_relation(tree))


def inequality_latex(tree: ex.Expression) -> str:
    """The same in LaTeX."""
    left, sign, right = _relation(tree)
    return f"{printing.to_latex(left)}{to_latex(sign)}{printing.to_latex(right)}"


def inequality_text(tree: ex.Expression) -> str:
    """The same in plain text."""
    return inequality(tree).text


class Relation(NamedTuple):
    """An inequality as it is written."""

    left: ex.Expression
    sign: str
    right: ex.Expression


def _relation(tree: ex.Expression) -> Relation:
    if (
        isinstance(tree, ex.Power)
        and isinstance(tree.exponent, ex.Number)
        and tree.exponent.value % 2 == 0
    ):
        return Relation(tree.base, " != ", ex.ZERO)
    left, right, is_greater = _sides(min(collecting.collect(tree), tree, key=ex.node_count))
    return Relation(left, " > " if is_greater else " < ", right)


class Sides(NamedTuple):
    """left > right, or left < right."""

    left: ex.Expression
    right: ex.Expression
    is_greater: bool


def _sides(tree: ex.Expression) -> Sides:
    """(a, b, True) for a > b, (a, b, False) for a < b; one side is a single term, and a number is
    on the right.
    """
    terms = ex.summands(tree)
    varying = [term for term in terms if not _is_number(term)]
    if len(varying) == 1:
        return _bound(varying[0], ex.add(*(term for term in terms if _is_number(term))))
    above = [term for term in terms if ex.coefficient(term) > 0]
    below = [-term for term in terms if ex.coefficient(term) < 0]
    if not above or all(map(_is_number, above)):
        return Sides(ex.add(*below), ex.add(*above), False)
    return (
        Sides(ex.add(*above), ex.add(*below), True)
        if min(len(above), len(below)) < 2
        else Sides(tree, ex.ZERO, True)
    )


def _bound(term: ex.Expression, rest: ex.Expression) -> Sides:
    """c u + rest > 0 solved for u."""
    coefficient = ex.coefficient(term)
    bound = ex.add(*(-1 / coefficient * part for part in ex.summands(rest)))
    return Sides(1 / coefficient * term, bound, coefficient > 0)


def _is_number(term: ex.Expression) -> bool:
    """Whether the term contains no coordinate, velocity, parameter, or function."""
    return not any(
        isinstance(node, ex.Symbol | ex.Velocity | ex.Arbitrary) and node != ex.PI
        for node in ex.walk(term)
    )
