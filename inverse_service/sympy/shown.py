"""What an answer has in SymPy and how a notebook shows it: a Hamiltonian, first integrals, the
steps of a proof.

SymPy is imported by what shows or compares an expression.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from sympy import Eq, Expr, Symbol

_Part = TypeVar("_Part")


@dataclass(frozen=True)
class Step:
    """One step of a proof: a sentence as text, and with its formulas in LaTeX between dollar
    signs.
    """

    text: str
    latex: str

    def _repr_html_(self) -> str:
        return html.escape(self.latex)


@dataclass(frozen=True)
class FirstIntegral:
    """A function of t, q, v that the motion keeps, its symmetry ("t -> t + s"), and where it is
    defined.
    """

    name: str
    expr: Expr
    symmetry: str
    domain: tuple[Any, ...]

    def _repr_latex_(self) -> str:
        import sympy

        return f"$\\displaystyle {sympy.latex(self.expr)}$"

    def _repr_html_(self) -> str:
        return html.escape(f"{self.name} {self._repr_latex_()}")


class Listed(tuple[_Part, ...]):
    """A tuple that a notebook shows as a numbered list, formulas in LaTeX."""

    def _repr_html_(self) -> str:
        return f"<ol>{''.join(f'<li>{_in_html(part)}</li>' for part in self)}</ol>"


def _in_html(part: Any) -> str:
    return str(
        part._repr_html_() if hasattr(part, "_repr_html_") else html.escape(part._repr_latex_())
    )


class Motion(dict[Any, Any]):
    """The acceleration of each coordinate; a notebook shows them one below the other."""

    def _repr_latex_(self) -> str:
        return aligned(self.items())


def aligned(rows: Iterable[tuple[Any, Any]]) -> str:
    """Left = right, LaTeX or expressions, one below the other, for a notebook."""
    import sympy

    sides = [[side if isinstance(side, str) else sympy.latex(side) for side in row] for row in rows]
    return (
        "$\\displaystyle\\begin{aligned}"
        + r" \\ ".join(f"{a} &= {b}" for a, b in sides)
        + "\\end{aligned}$"
    )


@dataclass(frozen=True)
class Hamiltonian:
    """H over (t, q, p), or over (t, q, v) where `implicit`; `momenta` are p_i(t, q, v) by their
    symbols.
    """

    expr: Expr
    momenta: Mapping[Symbol, Expr]
    implicit: bool
    coordinates: Sequence[Expr] = ()
    time: Any = None

    def _repr_latex_(self) -> str:
        return aligned([("H", self.expr), *self.momenta.items()])

    def equations(self) -> Listed[Eq]:
        """Hamilton's equations q' = dH/dp, p' = -dH/dq; ValueError where H is over the
        velocities.
        """
        import sympy

        if self.implicit:
            raise ValueError("this Hamiltonian is not written in the momenta")
        pairs = list(zip(self.coordinates, self.momenta, strict=True))
        functions = {p: sympy.Function(str(p))(self.time) for _, p in pairs}
        rates = [
            sympy.Eq(q.diff(self.time), self.expr.diff(p).xreplace(functions)) for q, p in pairs
        ]
        forces = [
            sympy.Eq(functions[p].diff(self.time), -self.expr.diff(q).xreplace(functions))
            for q, p in pairs
        ]
        return Listed(rates + forces)


@dataclass(frozen=True)
class Verification:
    """SymPy's opinion: the Euler-Lagrange residuals along the motion, and H - (p v - L); all are 0
    where they hold.
    """

    euler_lagrange: tuple[Expr, ...]
    hamiltonian: Expr | None = None

    def _repr_latex_(self) -> str:
        rows = [(f"E_{{{place}}}", each) for place, each in enumerate(self.euler_lagrange, 1)]
        return aligned(
            rows + ([] if self.hamiltonian is None else [("H - (p v - L)", self.hamiltonian)])
        )

    @property
    def holds(self) -> bool | None:
        """True where SymPy reduces all of them to 0, False where one differs from 0 in numbers,
        None where unsure.
        """
        verdicts = [
            is_zero(each) for each in (*self.euler_lagrange, self.hamiltonian) if each is not None
        ]
        return False if False in verdicts else (None if None in verdicts else True)


def is_zero(expression: Any) -> bool | None:
    """True, False, or None if SymPy cannot decide."""
    if expression == 0:
        return True
    found: bool | None = expression.equals(0)
    return found
