"""Formulas in text, LaTeX and MathML together: trees, matrices, and the tensor notation of the theory.

The theory's notation is a small one of our own, written as people type it: "g_ij R^j_kl", "Gamma(g) = g N + (g N)^T",
"dg_ij/dv^k". It is used for formulas that this program composes, never for users' text.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from html import escape

from inverse_service.expressions import printing
from inverse_service.expressions.tree import Expression

_TOKEN = re.compile(
    r"(?P<rate>d/dt)\b|(?P<name>[A-Za-z]+)(?P<marks>(?:[_^](?:\([^()]*\)|[A-Za-z0-9]+))*)(?P<primes>'*)(?P<power>\^\d)?|\)(?P<above>\^\w)|(?P<digits>\d+)|(?P<space>\s+)|(?P<sign>[!<>]=|.)"
)
# Signs between trees that the reader of formulas knows.
_READS_BACK = re.compile(r" = (?:-?\d+(?:/\d+)?)?| [-+] |-?\d*\*?|\d+")
_MARK = re.compile(r"[_^](?:\([^()]*\)|[A-Za-z0-9]+)")
_PARTIAL = re.compile(r"d([a-zA-Z]|Phi)")
_GREEK = {"alpha": "\u03b1", "Gamma": "Γ", "Phi": "Φ", "nabla": "∇", "lambda": "λ", "mu": "μ", "phi": "φ", "tau": "τ"}
_WORDS = frozenset(("det", "for", "and"))
_SIGNS = {"-": "\u2212", "*": "\u2062", "!=": "≠", ">=": "≥", "<=": "≤"}
_LATEX_SIGNS = {"*": " ", "\u2026": r"\dots", "!=": r"\neq ", ">=": r"\geq ", "<=": r"\leq "}
# The subjects of formulas: the keys under which a result and the pages explain them.
_USES = {"Phi": "Phi", "Gamma": "Gamma", "N": "N", "R": "R"}


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula; `mathml` is the content of <math>, `uses` are the tensors that it names.

    `letters` are the names of the theory in it, with their lower indices. `reads_back` says that the reader of
    formulas understands its text.
    """

    text: str
    latex: str
    mathml: str
    uses: tuple[str, ...] = ()
    reads_back: bool = False
    letters: tuple[str, ...] = ()


def of_tree(tree: Expression) -> Formula:
    """The formula of an expression."""
    mathml = printing.to_mathml(tree).partition(">")[2].removesuffix("</math>")
    return Formula(printing.to_text(tree), printing.to_latex(tree), mathml, reads_back=True)


def row(*pieces: Formula | Expression | str) -> Formula:
    """The concatenated pieces; texts are in the notation of the theory."""
    parts = [formula_of(piece) for piece in pieces]
    uses = tuple(dict.fromkeys(use for part in parts for use in part.uses))
    return Formula(
        "".join(part.text for part in parts),
        "".join(part.latex for part in parts),
        f"<mrow>{''.join(part.mathml for part in parts)}</mrow>",
        uses,
        all(part.reads_back or _READS_BACK.fullmatch(part.text) for part in parts),
        tuple(letter for part in parts for letter in part.letters),
    )


def formula_of(piece: Formula | Expression | str) -> Formula:
    """Any piece as a formula."""
    if isinstance(piece, str):
        return theory(piece)
    return piece if isinstance(piece, Formula) else of_tree(piece)


def matrix(rows: Sequence[Sequence[Formula | Expression]]) -> Formula:
    """A matrix with its entries."""
    entries = [[formula_of(entry) for entry in line] for line in rows]
    text = ", ".join(f"[{', '.join(entry.text for entry in line)}]" for line in entries)
    latex = r" \\ ".join(" & ".join(entry.latex for entry in line) for line in entries)
    cells = "".join(f"<mtr>{''.join(f'<mtd>{entry.mathml}</mtd>' for entry in line)}</mtr>" for line in entries)
    return Formula(
        f"[{text}]",
        rf"\begin{{pmatrix}} {latex} \end{{pmatrix}}",
        f"<mrow><mo>(</mo><mtable>{cells}</mtable><mo>)</mo></mrow>",
    )


def listed(formulas: Sequence[Formula]) -> Formula:
    """Formulas with commas between them."""
    pieces: list[Formula | str] = []
    for formula in formulas:
        pieces += [", ", formula] if pieces else [formula]
    return row(*pieces)


# dL/dx' in a sentence: L, x, an index such as that of v^i, primes.
SLOPE = re.compile(r"(?<![A-Za-z])d([LHFDTf])/d([A-Za-z][A-Za-z0-9_]*)(?:\^(\w))?('{0,2})")


def partial_derivative(of: Formula, by: Expression) -> Formula:
    """dL/dx as a fraction."""
    under = of_tree(by)
    return Formula(
        f"d{of.text}/d{under.text}",
        rf"\frac{{\partial {of.latex}}}{{\partial {under.latex}}}",
        f"<mfrac><mrow><mi>∂</mi>{of.mathml}</mrow><mrow><mi>∂</mi>{under.mathml}</mrow></mfrac>",
        of.uses,
        letters=of.letters,
    )


# The symbol of the multiplier: g, unless the system uses that name.
MULTIPLIER: ContextVar[str] = ContextVar("multiplier", default="g")
_LETTER_G = re.compile(r"(?<![A-Za-z])g(?![A-Za-z])|(?<=\bd)g(?=_)")


@contextmanager
def multiplier_beside(names: Collection[str]) -> Iterator[None]:
    """Within the block, the symbol of the multiplier differs from these names."""
    letter = next((one for one in ("g", "h", "m") if not any(n.partition("_")[0] == one for n in names)), "g")
    token = MULTIPLIER.set(letter)
    try:
        yield
    finally:
        MULTIPLIER.reset(token)


def theory(text: str) -> Formula:
    """A formula of the theory from its text."""
    if MULTIPLIER.get() != "g":
        text = _LETTER_G.sub(MULTIPLIER.get(), text)
    latex, mathml, uses, letters = [], [], [], []
    for match in _TOKEN.finditer(text):
        if match["rate"]:
            latex.append(r"\frac{d}{dt}")
            mathml.append("<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>")
        elif match["name"]:
            name, primes = match["name"], match["primes"]
            marks = _MARK.findall(match["marks"] + (match["power"] or ""))
            latex.append(_with_marks_latex(name, marks, primes))
            mathml.append(_with_marks_mathml(name, marks, primes))
            letters.append(name + primes + "".join(mark for mark in marks if mark[0] == "_"))
            if name in _USES:
                uses.append("nabla_Phi" if name == "Phi" and _is_after_nabla(text, match.start()) else _USES[name])
        elif match["above"]:
            latex.append(f"){_mark_latex(match['above'])}")
            mathml.append(f"<msup><mo>)</mo><mrow>{_mark(match['above'])}</mrow></msup>")
        elif match["digits"]:
            latex.append(match["digits"])
            mathml.append(f"<mn>{match['digits']}</mn>")
        elif match["space"]:
            latex.append(" ")
        else:
            latex.append(_LATEX_SIGNS.get(match["sign"], match["sign"]))
            is_first = text[: match.start()].rstrip()[-1:] in ("=", "(", ",", "")
            form = ' form="prefix"' if match["sign"] == "-" and is_first else ""
            mathml.append(f"<mo{form}>{escape(_SIGNS.get(match['sign'], match['sign']))}</mo>")
    return Formula(
        text, "".join(latex), f"<mrow>{''.join(mathml)}</mrow>", tuple(dict.fromkeys(uses)), letters=tuple(letters)
    )


def _is_after_nabla(text: str, place: int) -> bool:
    return re.search(r"nabla(?:\^\d)?\s*$", text[:place]) is not None


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
    return (name, f"<mi>{name}</mi>") if len(name) == 1 or name == "dt" else (rf"\mathrm{{{name}}}", f"<mi>{name}</mi>")


def _with_marks_latex(name: str, marks: Sequence[str], primes: str) -> str:
    body = _body(name)[0]
    command = body.startswith("\\") and not body.endswith(("}", " "))
    found = body + "'" * len(primes)
    found += "".join(map(_mark_latex, marks))
    return found + (" " if command and not marks else "")


def _with_marks_mathml(name: str, marks: Sequence[str], primes: str) -> str:
    body = _body(name)[1]
    sub = "".join(_mark(mark) for mark in marks if mark[0] == "_")
    sup = "".join(_mark(mark) for mark in marks if mark[0] == "^")
    head, base = ("<mi>∂</mi>", body[len("<mi>∂</mi>") :]) if body.startswith("<mi>∂") else ("", body)
    if sub and sup and not primes:
        return f"{head}<msubsup>{base}<mrow>{sub}</mrow><mrow>{sup}</mrow></msubsup>"
    base = f"<msub>{base}<mrow>{sub}</mrow></msub>" if sub else base
    base = f"<mrow>{base}{printing.PRIME * len(primes)}</mrow>" if primes else base
    return f"{head}<msup>{base}<mrow>{sup}</mrow></msup>" if sup else f"{head}{base}"


def _mark_latex(mark: str) -> str:
    inner = mark[1:].strip("()")
    shown = r"\mathsf T" if mark == "^T" else inner
    return f"{mark[0]}{{{shown}}}"


def _mark(mark: str) -> str:
    return "".join(
        f"<mn>{letter}</mn>" if letter.isdigit() else f"<mi>{escape(letter)}</mi>" for letter in mark[1:].strip("()")
    )
