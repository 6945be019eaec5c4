r"""LaTeX as our printers write it to presentation MathML.

The formulas of an explanation exist as LaTeX only. Accepted is what `expressions.printing_latex` and
`inverse_problem` write: letters, digits, operators, \frac, \sqrt, \dot, \ddot, \left and \right,
pmatrix, scripts, Greek letters, function names, spacing. Anything else raises UnknownLatex, and the
page shows the source instead.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from html import escape

TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\d+(?:\.\d+)?|\S", re.DOTALL)
MAX_DEPTH = 60
GREEK = {
    "alpha": "\u03b1", "beta": "\u03b2", "gamma": "\u03b3", "delta": "\u03b4", "epsilon": "\u03b5",
    "zeta": "\u03b6", "eta": "\u03b7", "theta": "\u03b8", "iota": "\u03b9", "kappa": "\u03ba",
    "lambda": "\u03bb", "mu": "\u03bc", "nu": "\u03bd", "xi": "\u03be", "pi": "\u03c0", "rho": "\u03c1",
    "sigma": "\u03c3", "tau": "\u03c4", "upsilon": "\u03c5", "phi": "\u03d5", "chi": "\u03c7", "psi": "\u03c8",
    "omega": "\u03c9", "varphi": "\u03c6", "varepsilon": "\u03b5", "vartheta": "\u03d1", "varrho": "\u03f1",
    "varsigma": "\u03c2", "Gamma": "\u0393", "Delta": "\u0394", "Theta": "\u0398", "Lambda": "\u039b",
    "Xi": "\u039e", "Pi": "\u03a0", "Sigma": "\u03a3", "Upsilon": "\u03a5", "Phi": "\u03a6", "Psi": "\u03a8",
    "Omega": "\u03a9", "ell": "\u2113",
}  # fmt: skip
FUNCTIONS = frozenset((
    "sin", "cos", "tan", "cot", "sec", "csc", "sinh", "cosh", "tanh", "coth", "ln", "log", "exp", "arcsin",
    "arccos", "arctan", "det", "dim", "rank", "max", "min",
))  # fmt: skip
OPERATORS = {
    "cdot": "⋅", "times": "\u00d7", "neq": "≠", "ne": "≠", "leq": "≤", "geq": "≥", "Longrightarrow": "⟹",
    "Rightarrow": "⇒", "to": "→", "partial": "∂", "nabla": "∇", "in": "∈", "pm": "±", "ldots": "…", "dots": "…",
    "cdots": "⋯", "equiv": "≡", "sum": "∑", "int": "∫", "mid": "|",
}  # fmt: skip
IDENTIFIERS = frozenset(("partial", "nabla"))
SPACES = {"quad": "1em", "qquad": "2em", ";": "0.28em", ",": "0.17em", ":": "0.22em", " ": "0.25em", "!": "0"}
WORDS = frozenset(("operatorname", "mathrm", "mathsf", "text", "mathbf", "mathit"))
PRIME = "\u2032"


OPERANDS = ("<mi", "<mn", "<msu", "<mov", "<mf", "<msq", "<mrow><mo>")


class UnknownLatex(ValueError):
    """A command, or a use of one, that our printers do not write."""


def latex_to_mathml(latex: str, display: bool = False) -> str:
    """A <math> element; raises UnknownLatex."""
    reader = _Reader(TOKEN.findall(latex))
    row = low_fences(reader.row(()))
    shown = ' display="block"' if display else ""
    return f"<math{shown}>{row}</math>"


def pieces(latex: str) -> list[str]:
    r"""The parts of a line that may stand on lines of their own: cut at \quad and before an arrow."""
    cut = re.sub(r"\\;?\s*\\Longrightarrow\s*\\;?", r"\\qquad \\Longrightarrow ", latex)
    return [part.strip() for part in re.split(r"\\q?quad(?![A-Za-z])", cut) if part.strip()]


class _Reader:
    """A position in the tokens; each method reads one construct and returns its MathML."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens, self.place, self.depth = tokens, 0, 0

    def ahead(self) -> str:
        return self.tokens[self.place] if self.place < len(self.tokens) else ""

    def take(self) -> str:
        token = self.ahead()
        self.place += 1
        return token

    def row(self, ends: tuple[str, ...]) -> str:
        """Everything up to one of the ends (not taken) or the end of the text, as one <mrow>."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise UnknownLatex("nested too deeply")
        found: list[str] = []
        while self.place < len(self.tokens) and self.ahead() not in ends:
            self._item(found)
        if ends and self.place >= len(self.tokens):
            raise UnknownLatex("something is not closed")
        self.depth -= 1
        return f"<mrow>{''.join(found)}</mrow>"

    def _item(self, found: list[str]) -> None:
        token = self.ahead()
        if token in ("^", "_"):
            found.append(self._scripts(found.pop() if found else "<mrow></mrow>"))
        elif token == "'":
            count = 0
            while self.ahead() == "'":
                self.take()
                count += 1
            base = found.pop() if found else "<mrow></mrow>"
            found.append(f"<msup>{base}<mo>{PRIME * count}</mo></msup>")
        else:
            atom = self.atom()
            if found and found[-1].startswith(OPERANDS) and atom.startswith(OPERANDS) and not _is_function(found[-1]):
                found.append(f'<mspace width="{"0.17em" if _is_function(atom) else "0.1em"}"></mspace>')
            found.append(atom)

    def _scripts(self, base: str) -> str:
        parts = {}
        while self.ahead() in ("^", "_") and self.ahead() not in parts:
            mark = self.take()
            parts[mark] = self.atom()
        if len(parts) == 2:
            return f"<msubsup>{base}{parts['_']}{parts['^']}</msubsup>"
        mark, script = next(iter(parts.items()))
        return f"<{'msup' if mark == '^' else 'msub'}>{base}{script}</{'msup' if mark == '^' else 'msub'}>"

    def atom(self) -> str:
        """One symbol, group or command."""
        token = self.take()
        if token == "{":
            inner = self.row(("}",))
            self.take()
            return inner
        if token.startswith("\\"):
            return self._command(token[1:])
        if token[:1].isdigit():
            return f"<mn>{token}</mn>"
        if token.isalpha():
            return f"<mi>{escape(token)}</mi>"
        if token in ("", "}", "&"):
            raise UnknownLatex(f"unexpected {token!r}")
        shown = {"-": "\u2212", "*": "⋅"}.get(token, escape(token))
        stretchy = ' stretchy="false"' if token in "()[]|" else ""
        return f"<mo{stretchy}>{shown}</mo>"

    def _command(self, name: str) -> str:
        if name in GREEK:
            return f"<mi>{GREEK[name]}</mi>"
        if name in FUNCTIONS:
            return f"<mi>{name}</mi>"
        if name in OPERATORS:
            return f"<mi>{OPERATORS[name]}</mi>" if name in IDENTIFIERS else f"<mo>{OPERATORS[name]}</mo>"
        if name in SPACES:
            return f'<mspace width="{SPACES[name]}"></mspace>'
        if name in WORDS:
            return self._word()
        special: dict[str, Callable[[], str]] = {
            "frac": lambda: f"<mfrac>{self.atom()}{self.atom()}</mfrac>",
            "sqrt": lambda: f"<msqrt>{self.atom()}</msqrt>",
            "dot": lambda: f'<mover accent="true">{self.atom()}<mo>˙</mo></mover>',
            "ddot": lambda: f'<mover accent="true">{self.atom()}<mo>¨</mo></mover>',
            "tilde": lambda: f'<mover accent="true">{self.atom()}<mo>~</mo></mover>',
            "bar": lambda: f'<mover accent="true">{self.atom()}<mo>¯</mo></mover>',
            "left": self._fence,
            "begin": self._matrix,
        }
        if name not in special:
            raise UnknownLatex(name)
        return special[name]()

    def _word(self) -> str:
        if self.ahead() != "{":
            return f'<mi mathvariant="normal">{escape(self.take())}</mi>'
        self.take()
        letters = []
        while self.ahead() not in ("}", ""):
            letters.append(self.take())
        self.take()
        word = "".join(letters)
        single = ' mathvariant="normal"' if len(word) == 1 else ""
        return f"<mi{single}>{escape(word)}</mi>"

    def _fence(self) -> str:
        opening = self.take()
        inner = self.row(("\\right",))
        self.take()
        closing = self.take()
        return f"<mrow><mo>{escape(opening)}</mo>{inner}<mo>{escape(closing)}</mo></mrow>"

    def _matrix(self) -> str:
        if self._environment() != "pmatrix":
            raise UnknownLatex("environment")
        rows: list[list[str]] = [[]]
        while True:
            rows[-1].append(self.row(("&", "\\\\", "\\end")))
            end = self.take()
            if end == "\\end":
                break
            if end == "\\\\":
                rows.append([])
        self._environment()
        return matrix_mathml(rows)

    def _environment(self) -> str:
        letters = []
        self.take()
        while self.ahead() not in ("}", ""):
            letters.append(self.take())
        self.take()
        return "".join(letters)


def _is_function(item: str) -> bool:
    return any(f"<mi>{name}</mi>" in item[:40] for name in FUNCTIONS)


_FENCE = re.compile(r"<mo>[()]</mo>")
_TALL = re.compile(r"<(?:mfrac|msqrt|mtable)")


def low_fences(mathml: str) -> str:
    """Brackets around nothing tall do not stretch: stretched ones are set with gaps around them."""
    found: list[tuple[int, int]] = []
    low: list[int] = []
    for match in _FENCE.finditer(mathml):
        if match.group() == "<mo>(</mo>":
            found.append((match.start(), match.end()))
        elif found:
            start, end = found.pop()
            if not _TALL.search(mathml, end, match.start()):
                low += [start, match.start()]
    for place in sorted(low, reverse=True):
        mathml = mathml[:place] + '<mo stretchy="false">' + mathml[place + 4 :]
    return mathml


def matrix_mathml(rows: list[list[str]]) -> str:
    """A matrix in round brackets, its entries being MathML."""
    body = "".join(f"<mtr>{''.join(f'<mtd>{entry}</mtd>' for entry in row)}</mtr>" for row in rows)
    return f"<mrow><mo>(</mo><mtable>{body}</mtable><mo>)</mo></mrow>"
