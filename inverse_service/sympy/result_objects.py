"""Results as dictionaries with attributes, and many of them as a table.

SymPy is imported by the first attribute that is an expression.
"""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inverse_service.reading.reader import has_acceleration

if TYPE_CHECKING:
    from inverse_service.sympy.symbol_names import Table

VARIATIONAL = {"variational": True, "not_variational": False}


@dataclass(frozen=True)
class Step:
    """One step of a proof: a sentence, its formula in LaTeX or nothing."""

    text: str
    latex: str = ""


@dataclass(frozen=True)
class Hamiltonian:
    """H over (t, q, p), or over (t, q, v) where `implicit`; `momenta` are p_i(t, q, v) by their symbols."""

    expr: Any
    momenta: Mapping[Any, Any]
    implicit: bool
    coordinates: Sequence[Any] = ()
    time: Any = None

    def equations(self) -> list[Any]:
        """Hamilton's equations q' = dH/dp, p' = -dH/dq; ValueError where H is over the velocities."""
        import sympy

        if self.implicit:
            raise ValueError("this Hamiltonian is not written in the momenta")
        pairs = list(zip(self.coordinates, self.momenta, strict=True))
        functions = {p: sympy.Function(str(p))(self.time) for _, p in pairs}
        rates = [sympy.Eq(q.diff(self.time), self.expr.diff(p).xreplace(functions)) for q, p in pairs]
        return rates + [
            sympy.Eq(functions[p].diff(self.time), -self.expr.diff(q).xreplace(functions)) for q, p in pairs
        ]


@dataclass(frozen=True)
class Verification:
    """SymPy's opinion: the Euler-Lagrange residuals along the motion, and H - (p v - L); all are 0 where they hold."""

    euler_lagrange: tuple[Any, ...]
    hamiltonian: Any = None

    @property
    def holds(self) -> bool | None:
        """True where SymPy reduces all of them to 0, False where one differs from 0 in numbers, None where unsure."""
        from inverse_service.sympy.sympy_tensors import is_zero

        verdicts = [is_zero(each) for each in (*self.euler_lagrange, self.hamiltonian) if each is not None]
        return False if False in verdicts else (None if None in verdicts else True)


class Answer(dict[str, Any]):
    """One answer: the keys of the document, and its formulas as SymPy expressions."""

    def __init__(self, data: Mapping[str, Any], table: Table | None = None, system: Mapping[str, Any] | None = None):
        super().__init__(data)
        self._given = table
        self._of: Mapping[str, Any] | None = system

    @property
    def _system(self) -> Mapping[str, Any]:
        return self._of if self._of is not None else (self.get("system") or {})

    def __bool__(self) -> bool:
        raise TypeError("an answer is yes, no or open, so it is no truth value: use is_variational or verdict")

    def __repr__(self) -> str:
        found, where = self.get("lagrangian"), f" where {', '.join(self._where)}" if self._where else ""
        return f"{type(self).__name__}({self.verdict}{', L = ' + found['text'] if found else ''}{where})"

    @cached_property
    def _where(self) -> tuple[str, ...]:
        """The conditions of the answer and of its L."""
        from inverse_service.service.documents.text_page import conditions_of

        return conditions_of(self)

    @cached_property
    def _table(self) -> Table:
        from inverse_service.sympy.symbol_names import table_of_result

        table = self._given or table_of_result({"system": self._system})
        if not self.get("integrals"):
            return table
        from inverse_service.sympy.symbol_names import with_integrals

        return with_integrals(table, self["integrals"])

    def _expression(self, text: str) -> Any:
        from inverse_service.sympy.symbol_names import expression

        return expression(text, self._table)

    @property
    def verdict(self) -> str:
        """ "variational", "not_variational" or "undetermined"; "" for the forward problem."""
        return str(self.get("verdict", ""))

    @property
    def is_variational(self) -> bool | None:
        """True, False, or None where it was not settled."""
        return VARIATIONAL.get(self.verdict)

    @cached_property
    def lagrangian(self) -> Any:
        """The Lagrangian as an expression, None where none was found."""
        found = self.get("lagrangian")
        return None if found is None else self._expression(found["text"])

    @cached_property
    def lagrangians(self) -> tuple[Any, ...]:
        """All Lagrangians found, the simplest first."""
        others = self.get("other_lagrangians", [])
        return tuple([self.lagrangian] if self.lagrangian is not None else []) + tuple(
            self._expression(other["text"]) for other in others
        )

    @cached_property
    def domain(self) -> tuple[Any, ...]:
        """The conditions under which the answer holds and L is one, as relations."""
        from inverse_service.sympy.symbol_names import relation

        return tuple(relation(text, self._table) for text in self._where)

    @cached_property
    def hamiltonian(self) -> Hamiltonian | None:
        """H with its momenta, None where there is none."""
        found = self.get("hamiltonian")
        if found is None:
            return None
        momenta = {self._table.symbol(p): self._expression(text) for p, text in found["momenta"].items()}
        coordinates = tuple(self._table.coordinates.values())
        return Hamiltonian(self._expression(found["text"]), momenta, found["implicit"], coordinates, self._table.time)

    @cached_property
    def multiplier(self) -> Any:
        """g_ij = d2L/dv_i dv_j as an ImmutableMatrix, None where there is no L."""
        import sympy

        found = self.get("multiplier")
        return None if found is None else sympy.ImmutableMatrix([[self._expression(e) for e in row] for row in found])

    @property
    def proof(self) -> tuple[Step, ...]:
        """The steps of the explanation."""
        return tuple(Step(step["text"], step.get("latex", "")) for step in self.get("explanation", ()))

    @property
    def solution_space(self) -> Mapping[str, Any] | None:
        """How many multipliers there are: order, dimensions, characters, statement."""
        found: Mapping[str, Any] | None = self.get("solution_space")
        return found

    @property
    def certificate(self) -> Mapping[str, Any] | None:
        """What the independent checker needs."""
        found: Mapping[str, Any] | None = self.get("certificate")
        return found

    def lambdify(self, what: str = "lagrangian", modules: Any = None) -> Callable[..., Any]:
        """A numerical function of t, coordinates, velocities (momenta for H) and parameters; see `code.QUANTITIES`."""
        from inverse_service.sympy import code

        return code.lambdified(code.quantity_of(self, what), code.arguments_of(self, what), modules)

    def verify(self) -> Verification:
        """SymPy's own Euler-Lagrange residuals of L along the motion, and H - (p v - L); ValueError without L."""
        from inverse_service.sympy.sympy_tensors import verification

        return verification(self)

    @cached_property
    def equations(self) -> dict[Any, Any]:
        """q'' = f: the acceleration of each coordinate; Eq(E(t, q, q', q''), 0) where f is too long to be written."""
        import sympy

        table, found = self._table, {name: self._expression(text) for name, text in self._texts.items()}
        unsolved = self._is_unsolved
        return {table.acceleration(name): sympy.Eq(each, 0) if unsolved else each for name, each in found.items()}

    @property
    def accelerations(self) -> tuple[Any, ...]:
        """The f of q'' = f in the order of the coordinates; ValueError where they are too long to be written."""
        if self._is_unsolved:
            raise ValueError("the accelerations are too long to be solved for: the equations are those that were given")
        return tuple(self.equations.values())

    @property
    def _texts(self) -> Mapping[str, str]:
        return self._system.get("equations") or {}

    @property
    def _is_unsolved(self) -> bool:
        return any(map(has_acceleration, self._texts.values()))


class Result(Answer):
    """A whole result; `result["verdict"]` and all other keys of the document go on.

    Where the equations are another formula on either side of a zero (|x|, Heaviside(x), sqrt(x^2)) the attributes of
    an answer are those of the first of the `branches`.
    """

    def __repr__(self) -> str:
        others, differ = len(self.branches) - 1, len({branch.verdict for branch in self.branches}) > 1
        more = f"; {others} more in branches{', which differ' * differ})"
        return super().__repr__()[:-1] + (more if others else ")")

    @cached_property
    def branches(self) -> tuple[Answer, ...]:
        """The answer on each connected set on which the equations are one formula; one where that is everywhere."""
        found = self.get("branches") or ()
        return tuple(Answer(part, self._table, self._system) for part in found) or (self,)

    @property
    def is_variational(self) -> bool | None:
        """True or False where that holds on all branches, None where it was not settled or they differ."""
        verdicts = {VARIATIONAL.get(branch.verdict) for branch in self.branches}
        return verdicts.pop() if len(verdicts) == 1 else None

    @property
    def verdict_with_time(self) -> str | None:
        """The verdict for L(t, q, q')."""
        found: str | None = self.get("verdict_with_time")
        return found

    @cached_property
    def with_time(self) -> Answer | None:
        """The answer to L(t, q, q') where it differs."""
        found = self.get("with_time")
        return None if found is None else Answer(found, self._table, self._system)

    @cached_property
    def associated(self) -> dict[str, Answer]:
        """The answers to the associated systems of a nonholonomic one, by kind."""
        parts = (self.get("nonholonomic") or {}).get("associated", ())
        return {part["kind"]: Answer(part, self._table, {**self._system, **part}) for part in parts if part["defined"]}

    @cached_property
    def conditions(self) -> Any:
        """Phi, nabla Phi and R as SymPy arrays, None where they were left out."""
        from inverse_service.sympy.sympy_tensors import conditions_of_texts

        found = self.get("conditions")
        return None if found is None else conditions_of_texts(found, self._table)

    @property
    def special_cases(self) -> Mapping[str, Any] | None:
        """The tree of special cases."""
        found: Mapping[str, Any] | None = self.get("special_cases")
        return found

    def check(self, document: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """The independent checker's verdict and reasons."""
        from inverse_service import check

        return check(self, document)

    def to_dict(self) -> dict[str, Any]:
        """The result document."""
        return dict(self)

    def to_json(self, path: str | Path | None = None) -> str:
        """The result document as JSON, also written to a file where one is named."""
        text = json.dumps(dict(self), ensure_ascii=False, indent=1) + "\n"
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
        return text

    def to_latex(self) -> str:
        """Equations, and L and H of each branch with their conditions, as aligned formulas."""
        return "\\begin{align*}\n" + " \\\\\n".join(self._rows()) + "\n\\end{align*}\n"

    def _rows(self) -> list[str]:
        from inverse_service.service.documents.latex_page import conditions_latex

        rows = [row.replace(" = ", " &= ", 1) for row in self._system.get("latex", {}).values()]
        for branch in self.branches:
            formulas = [f"{letter} &= {branch[key]['latex']}" for letter, key in _LETTERS if branch.get(key)]
            where = [rf"&\text{{where {conditions_latex(branch._where, self._system)}}}"] if branch._where else []
            rows += [*formulas, *(where if formulas else [])]
        return rows

    def to_code(self, language: str = "python") -> str:
        """The accelerations, L, H, momenta and multiplier as a program: "julia", "c", …, or "sympy"."""
        from inverse_service.sympy.code import program

        return program(self, language)

    def to_python(self) -> str:
        """`to_code("python")`."""
        return self.to_code("python")

    def _repr_latex_(self) -> str:
        return "$\\displaystyle\\begin{aligned}" + " \\\\ ".join(self._rows()) + "\\end{aligned}$"

    def _repr_html_(self) -> str:
        parts = []
        for branch in self.branches:
            parts.append(f"<p><b>{html.escape(branch.verdict.replace('_', ' ') or 'equations of motion')}</b></p>")
            for letter, key in _LETTERS:
                if found := branch.get(key):
                    parts.append(f"<p>$\\displaystyle {letter} = {html.escape(found['latex'])}$</p>")
            parts += [f"<p>where {html.escape(', '.join(branch._where))}</p>"] if branch._where else []
        steps = "".join(f"<li>{html.escape(step.text)}</li>" for step in self.proof)
        parts += [f"<details><summary>Proof</summary><ol>{steps}</ol></details>"] if steps else []
        return "".join(parts)


_LETTERS = (("L", "lagrangian"), ("H", "hamiltonian"))


def result_of(data: Mapping[str, Any], names: Any = None) -> Result:
    """The result with these objects for its names: a Table, or SymPy objects by name."""
    data = dict(data)
    if not isinstance(names, Mapping):
        return Result(data, names)
    from inverse_service.sympy.symbol_names import table_of_result

    return Result(data, table_of_result(data, names))
