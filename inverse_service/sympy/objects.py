"""What is asked, as a document, and results as dictionaries with attributes in SymPy, as tables,
and as pictures.

SymPy is imported by the first attribute that is an expression.
"""

from __future__ import annotations

import base64
import html
import importlib.util
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inverse_service import catalogue, errors
from inverse_service.reading import reader
from inverse_service.service.documents import (
    accepting,
    answer_rows,
    plain_data,
    printed_pages,
    sheets,
    stated,
)
from inverse_service.service.documents.answers import of_input_error
from inverse_service.sympy.shown import (
    FirstIntegral,
    Hamiltonian,
    Listed,
    Motion,
    Step,
    Verification,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from sympy import Expr, ImmutableMatrix
    from sympy.logic.boolalg import Boolean

    from inverse_service.sympy.from_sympy import Conditions, Table


VARIATIONAL = {"variational": True, "not_variational": False}

STEPS = 1000
START = 0.6  # of the first position; each next one is a third larger, velocities are 0
LONGEST = 10.0  # s
_KEYS = frozenset(
    ("equations", "lagrangian", "constraints", "motion", "format", "options", "parameters")
)


def solve(
    system: Any,
    coordinates: Sequence[Any] | None = None,
    *,
    velocities: Mapping[Any, Any] | None = None,
    time: Any = None,
    time_limit: float = 60.0,
    seed: int = 1,
    **questions: Any,
) -> Result:
    """The result of a system of SymPy objects; its certificates are checked.

    `system`: an Eq, an expression that is 0, a list or Matrix of these, {x(t): acceleration},
    {x(t).diff(t, 2): acceleration}, {X: acceleration} for plain symbols with `velocities={X: vx}`,
    a Lagrangian (an expression with velocities and no acceleration: the forward problem), a
    LagrangesMethod, a KanesMethod, a System, or what `inverse_service.solve` takes. `questions` are
    keys of a document such as `ansatz`, `family`, `time_dependent_lagrangian`. Raises InputError.
    """
    from inverse_service import solve as solve_document

    keys = {"coordinates": coordinates, "velocities": velocities, "time": time, **questions}
    return solve_document(system, time_limit=time_limit, seed=seed, **keys)


def document(system: Any, coordinates: Sequence[Any] | None = None, **keys: Any) -> dict[str, Any]:
    """What `solve` would ask, as a document for a file, a batch or the service."""
    return asked(system, coordinates, **keys)[0]


def asked(
    system: Any,
    coordinates: Any = None,
    *,
    velocities: Any = None,
    time: Any = None,
    **questions: Any,
) -> tuple[dict[str, Any], Any]:
    """The document that is meant, and the SymPy objects of its names; None for a text, which has
    none.
    """
    if hasattr(system, "form_eoms"):  # a System of sympy.physics.mechanics
        if system.eom_method is None:
            system.form_eoms()
        system = system.eom_method
    questions = _with_names(questions)
    keys = {"coordinates": coordinates, "velocities": velocities, "time": time, **questions}
    given = {key: value for key, value in keys.items() if value is not None}
    if isinstance(system, str):
        plain = _of_text(system)
        guesses = plain.keys() == {"equations"} and "parameters" not in given
        return plain | given | ({"parameters": "guess"} if guesses else {}), None
    if isinstance(system, Mapping) and all(isinstance(key, str) for key in system):
        texts = all(
            isinstance(value, str | int) and not isinstance(value, bool)
            for value in system.values()
        )
        is_motion = (
            texts and system and not any(key in _KEYS or _is_misspelt(key) for key in system)
        )
        return ({"equations": system} if is_motion else _with_names(system)) | given, None
    if (
        isinstance(system, list | tuple)
        and system
        and all(isinstance(entry, str) for entry in system)
    ):
        return {"equations": list(system)} | given, None
    from inverse_service.sympy.from_sympy import read

    return read(system, coordinates, velocities, time, questions)


def _is_misspelt(key: str) -> bool:
    """Whether it is a long key of documents nearly, and so no coordinate."""
    long = ("equations", "lagrangian", "constraints")
    return (
        key.lower() in long
        or accepting.near_key(key.lower()) in long
        or key.lower().startswith("lagrang")
    )


def _with_names(keys: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _named(value) if key in ("parameters", "functions") else value
        for key, value in keys.items()
    }


def _named(declared: Any) -> Any:
    """Declarations with SymPy objects as names, such as {k: 2}, [k], {V: [x]}, as a document has
    them.
    """
    if isinstance(declared, Mapping):
        return {_name(key): _named(value) for key, value in declared.items()}
    return (
        [_named(each) for each in declared]
        if isinstance(declared, list | tuple)
        else _name(declared)
    )


def _name(each: Any) -> Any:
    if each is None or isinstance(each, bool | int | float | str):
        return each
    from inverse_service.sympy.from_sympy import plain_name

    return plain_name(each)


def _of_text(text: str) -> dict[str, Any]:
    """The document of a text: a name of the catalogue, JSON, or equations."""
    if text.strip().startswith("{") and '"' in text:
        return dict(plain_data.read_json(text))
    is_name = "=" not in text and catalogue.meant(text)
    return dict(catalogue.document(text)) if is_name else {"equations": text}


def nonholonomic(
    lagrangian: Any,
    constraints: Sequence[Any],
    coordinates: Sequence[Any] | None = None,
    *,
    time_limit: float = 60.0,
    seed: int = 1,
    **questions: Any,
) -> Result:
    """The result of a Lagrangian with constraints that are zero or equations; `questions` as in the
    document.

    `coordinates`: what has a velocity in them, where it is left out.
    """
    from inverse_service import solve as solve_document
    from inverse_service.sympy.from_sympy import read_lagrangian

    document, names = read_lagrangian(lagrangian, constraints, coordinates, None, questions)
    return from_result(solve_document(document, time_limit=time_limit, seed=seed), names)


def helmholtz(system: Any, coordinates: Sequence[Any] | None = None, **keys: Any) -> Conditions:
    """N, Phi, nabla Phi and R of a system, without a decision."""
    document, table = asked(system, coordinates, **keys)
    from inverse_service.sympy.from_sympy import helmholtz_conditions

    return helmholtz_conditions(document, table)


def solve_many(
    systems: Iterable[Any],
    workers: int = 2,
    output: str | Path | None = None,
    time_limit: float = 60.0,
) -> Answers:
    """The results of many systems in their order, computed in processes; a problem document for a
    refused one.

    `output` keeps the answers in a file, so that an interrupted run can resume.
    """
    return Answers(
        answers_to_many(systems, workers, None if output is None else Path(output), time_limit)
    )


def table(results: Iterable[Mapping[str, Any]]) -> Any:
    """One row a result: a pandas DataFrame where pandas is installed, else a list of
    dictionaries.
    """
    rows = list(map(answer_rows.first_row, results))
    return rows if importlib.util.find_spec("pandas") is None else _frame(rows)


def from_result(
    result: Mapping[str, Any], names: Mapping[str, Any] | Table | None = None
) -> Result:
    """A result that came from a file, a batch or the service; `names` are SymPy objects for its
    names, or a Table.
    """
    data = dict(result)
    if not isinstance(names, Mapping):
        return Result(data, names)
    return Result(data, _bridge().table_of_result(data, names))


def _bridge() -> Any:
    """The conversions to SymPy objects; SymPy takes 0.4 s to load."""
    from inverse_service.sympy import from_sympy

    return from_sympy


class Answer(dict[str, Any]):
    """One answer: the keys of the document, and its formulas as SymPy expressions."""

    def __init__(
        self,
        data: Mapping[str, Any],
        table: Table | None = None,
        system: Mapping[str, Any] | None = None,
    ):
        super().__init__(data)
        self._given = table
        self._of: Mapping[str, Any] | None = system

    @property
    def _system(self) -> Mapping[str, Any]:
        return self._of if self._of is not None else (self.get("system") or {})

    def __repr__(self) -> str:
        found, where = (
            self._shown.get("lagrangian"),
            f" where {', '.join(self._where)}" if self._where else "",
        )
        verdict, words = self.verdict or "equations of motion", []
        if found:
            words = [f", L = {found['text']}", *(f"with {one.whole}" for one in self._integrals())]
        return f"{type(self).__name__}({verdict}{' '.join(words)}{where})"

    def _integrals(self) -> Any:
        integrals = stated.auxiliary_of(self._shown)
        return sheets.integrals_of(integrals, stated.names_of(self._system, integrals))

    @cached_property
    def _where(self) -> tuple[str, ...]:
        """The conditions of the answer and of its L."""
        return stated.conditions_of(self._shown)

    @cached_property
    def _table(self) -> Table:
        table: Table = self._given or _bridge().table_of_result({"system": self._system})
        if integrals := stated.auxiliary_of(self._shown):
            table = _bridge().with_integrals(table, integrals)
        return table

    def _expression(self, text: str) -> Expr:
        return _bridge().expression(text, self._table)

    @property
    def _shown(self) -> Mapping[str, Any]:
        """The document of the answer whose formulas are shown."""
        return self

    @property
    def verdict(self) -> str:
        """ "variational", "not_variational" or "undetermined"; "" for the forward problem."""
        return str(self.get("verdict", ""))

    @property
    def is_variational(self) -> bool | None:
        """True, False, or None if undetermined."""
        return VARIATIONAL.get(self.verdict)

    @cached_property
    def lagrangian(self) -> Expr | None:
        """The Lagrangian as an expression, None where none was found."""
        found = self._shown.get("lagrangian")
        return None if found is None else self._expression(found["text"])

    @cached_property
    def lagrangians(self) -> Listed[Expr]:
        """All Lagrangians found, the simplest first."""
        others = self._shown.get("other_lagrangians", [])
        first = () if self.lagrangian is None else (self.lagrangian,)
        return Listed((*first, *(self._expression(other["text"]) for other in others)))

    @cached_property
    def domain(self) -> Listed[Boolean]:
        """The conditions under which the answer holds and L is one, as relations."""
        return Listed(_bridge().relation(text, self._table) for text in self._where)

    @cached_property
    def hamiltonian(self) -> Hamiltonian | None:
        """H with its momenta, None where there is none."""
        found = self._shown.get("hamiltonian")
        if found is None:
            return None
        momenta = {
            self._table.symbol(p): self._expression(text) for p, text in found["momenta"].items()
        }
        coordinates = tuple(self._table.coordinates.values())
        return Hamiltonian(
            self._expression(found["text"]),
            momenta,
            found["implicit"],
            coordinates,
            self._table.time,
        )

    @cached_property
    def first_integrals(self) -> Listed[FirstIntegral]:
        """The functions that are constant along the motion, the energy first."""
        found = list[FirstIntegral]()
        for each in self._shown.get("first_integrals") or self.get("first_integrals") or ():
            where = tuple(_bridge().relation(text, self._table) for text in each["domain"])
            table = _bridge().with_integrals(self._table, each.get("auxiliary") or {})
            formula = _bridge().expression(each["text"], table)
            found.append(FirstIntegral(each["name"], formula, each.get("symmetry") or "", where))
        return Listed(found)

    @cached_property
    def multiplier(self) -> ImmutableMatrix | None:
        """g_ij = d2L/dv_i dv_j as an ImmutableMatrix, None where there is no L."""
        import sympy

        found = self._shown.get("multiplier")
        return (
            None
            if found is None
            else sympy.ImmutableMatrix([[self._expression(e) for e in row] for row in found])
        )

    @property
    def proof(self) -> Listed[Step]:
        """The steps of the explanation."""
        names = stated.names_of(self._system or None)
        steps = self._shown.get("explanation", ())
        said = [(step["text"], sheets.sentence(step, names)) for step in steps]
        return Listed(
            Step(text, printed_pages.latex_sentence(pieces, "inline")) for text, pieces in said
        )

    @property
    def solution_space(self) -> Mapping[str, Any] | None:
        """The size of the solution space: order, dimensions, characters, statement."""
        return self.get("solution_space")

    @property
    def certificate(self) -> Mapping[str, Any] | None:
        """The certificate that the independent checker verifies."""
        return self.get("certificate")

    def lambdify(self, what: str = "lagrangian", modules: Any = None) -> Callable[..., Any]:
        """A numerical function of `what`: "lagrangian", "accelerations", "momenta", "hamiltonian"
        or "multiplier".

        Its arguments are t, the coordinates, the velocities (for H: the momenta), the parameters,
        each in the order of `result["system"]`, or by their names (x, x_dot, p_x, k).
        """
        from inverse_service.sympy import code

        return code.lambdified(self, what, modules)

    def verify(self) -> Verification:
        """SymPy's own Euler-Lagrange residuals of L along the motion, and H - (p v - L); ValueError
        without L.
        """
        found: Verification = _bridge().verification(self)
        return found

    @cached_property
    def equations(self) -> Motion:
        """q'' = f: the acceleration of each coordinate; Eq(E(t, q, q', q''), 0) where f is too long
        to be written.
        """
        import sympy

        table, found = (
            self._table,
            {name: self._expression(text) for name, text in self._texts.items()},
        )
        unsolved = self._is_unsolved
        return Motion(
            {
                table.acceleration(name): sympy.Eq(each, 0) if unsolved else each
                for name, each in found.items()
            }
        )

    @property
    def accelerations(self) -> tuple[Expr, ...]:
        """The f of q'' = f in the order of the coordinates; ValueError where they are too long to
        be written.
        """
        if self._is_unsolved:
            raise ValueError(
                "the accelerations are too long to be solved for: the equations are those that were given"
            )
        return tuple(self.equations.values())

    @property
    def _texts(self) -> Mapping[str, str]:
        return self._system.get("equations") or {}

    @property
    def _is_unsolved(self) -> bool:
        return any(map(reader.has_acceleration, self._texts.values()))

    @cached_property
    def branches(self) -> Listed[Answer]:
        """The answer on each connected set on which the equations are one formula; one where that
        is everywhere.
        """
        return Listed([self])

    def to_latex(self) -> str:
        """Equations, and L and H of each branch with their conditions, as aligned formulas."""
        return "\\begin{align*}\n" + " \\\\\n".join(self._rows()) + "\n\\end{align*}\n"

    def _rows(self) -> list[str]:
        rows = [row.replace(" = ", " &= ", 1) for row in self._system.get("latex", {}).values()]
        for branch in self.branches:
            formulas = [f"{letter} &= {found}" for letter, found in branch._formulas()]
            rows += formulas
            if formulas and branch._where:
                rows.append(
                    rf"&\text{{where {printed_pages.conditions_latex(branch._where, self._system)}}}"
                )
        return rows

    def _formulas(self) -> list[tuple[str, str]]:
        """L and H in LaTeX, where they were found."""
        return [
            (letter, self._shown[key]["latex"])
            for letter, key in sheets.FORMULAS
            if self._shown.get(key)
        ]

    def _latex(self, printer: Any) -> str:
        """What `sympy.latex` prints."""
        return "\\begin{aligned}" + " \\\\ ".join(self._rows()) + "\\end{aligned}"

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle{self._latex(None)}$"

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        """Text, LaTeX, and HTML with the formulas, a picture of a motion, and the proof."""
        return {
            "text/plain": repr(self),
            "text/latex": self._repr_latex_(),
            "text/html": self._repr_html_(),
        }

    def _repr_html_(self) -> str:
        parts = []
        for branch in self.branches:
            parts.append(
                f"<p><b>{html.escape(branch.verdict.replace('_', ' ') or 'equations of motion')}</b></p>"
            )
            parts += [
                f"<p>$\\displaystyle {a} = {html.escape(formula)}$</p>"
                for a, formula in branch._formulas()
            ]
            parts += (
                [f"<p>where {html.escape(', '.join(branch._where))}</p>"] if branch._where else []
            )
        parts += self._picture()
        parts += (
            [f"<details><summary>Proof</summary>{self.proof._repr_html_()}</details>"]
            if self.proof
            else []
        )
        return "".join(parts)

    def _picture(self) -> list[str]:
        """A motion as an image, nothing where none can be drawn."""
        return []


def _own_equations(answer: Mapping[str, Any]) -> Mapping[str, Any]:
    """The coordinates and equations of an answer that is not about those of the system."""
    found = answer.get("equations")
    return {"coordinates": [*found], "equations": found} if found else {}


class Result(Answer):
    """A whole result; `result["verdict"]` and all other keys of the document are available.

    `lagrangian`, `hamiltonian`, `domain`, `multiplier` and `proof` belong to the answer that is
    shown first at every door: that to L(q, q'), or that to L(t, q, q') where this has the simpler
    Lagrangian. `main` and `with_time` are the two answers. Where the equations are another formula
    on either side of a zero (`abs(x)`, `Heaviside(x)`) they are those of the first of the
    `branches`.
    """

    @property
    def _shown(self) -> Mapping[str, Any]:
        return stated.first_answer(self)

    @cached_property
    def answers(self) -> Listed[Answer]:
        """Every answer with its question (`about`, `with_time`, …), the one that is shown first."""
        listed = self.get("answers") or (stated.answers_of(self) if self.verdict else [])
        whole = (stated.with_shared(one, listed) for one in listed)
        return Listed(Answer(one, None, {**self._system, **_own_equations(one)}) for one in whole)

    @cached_property
    def main(self) -> Answer:
        """The answer to the question of `verdict`: L(q, q'), or L(t, q, q') where f contains t."""
        return Answer(self, self._table, self._system)

    @property
    def statement(self) -> Mapping[str, Any] | None:
        """The claims of this result that the independent checker proved, None if there are none."""
        found: Mapping[str, Any] | None = self.check().get("statement")
        return found

    def plot(
        self,
        start: Sequence[float] | None = None,
        parameters: Mapping[str, float] | None = None,
        time: float = 20.0,
        axes: Axes | None = None,
    ) -> Axes:
        """A motion as a picture: (x, x') for one coordinate, the path in the plane of the first two
        for more.

        `start` holds positions, then velocities (0.6, 0.8, … and 0 where left out); parameters are
        1 where left out. A motion that ends before says why in the title. Needs the extras
        `figures` and `simulation`.
        """

        return draw_motion(self, start, parameters or {}, time, axes)

    def __repr__(self) -> str:
        others, differ = (
            len(self.branches) - 1,
            len({branch.verdict for branch in self.branches}) > 1,
        )
        more = f"; {others} more in branches{', which differ' * differ})"
        return super().__repr__()[:-1] + (more if others else ")")

    @cached_property
    def branches(self) -> Listed[Answer]:
        """The answer on each connected set on which the equations are one formula; one where that
        is everywhere.
        """
        found = self.get("branches") or ()
        return Listed([Answer(part, self._table, self._system) for part in found] or [self])

    @property
    def is_variational(self) -> bool | None:
        """True or False if that holds on all branches, None if undetermined or if the branches
        differ.
        """
        verdicts = {VARIATIONAL.get(branch.verdict) for branch in self.branches}
        return verdicts.pop() if len(verdicts) == 1 else None

    @property
    def verdict_with_time(self) -> str | None:
        """The verdict for L(t, q, q')."""
        return self.get("verdict_with_time")

    @cached_property
    def with_time(self) -> Answer | None:
        """The answer to L(t, q, q') where it differs."""
        found = self.get("with_time")
        return None if found is None else Answer(found, self._table, self._system)

    @cached_property
    def associated(self) -> dict[str, Answer]:
        """The answers to the associated systems of a nonholonomic one, by kind."""
        parts = (self.get("nonholonomic") or {}).get("associated", ())
        return {
            part["kind"]: Answer(part, self._table, {**self._system, **part})
            for part in parts
            if part["defined"]
        }

    @cached_property
    def conditions(self) -> Conditions | None:
        """Phi, nabla Phi and R as SymPy arrays, None where they were left out."""
        found = self.get("conditions")
        return None if found is None else _bridge().conditions_of_texts(found, self._table)

    @property
    def family(self) -> Mapping[str, Any] | None:
        """Which members of the family have a Lagrangian, if the document asks."""
        return self.get("family")

    @property
    def nearest(self) -> Sequence[Mapping[str, Any]]:
        """The nearest systems with a Lagrangian; none where the document does not ask."""
        return self.get("nearest") or ()

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

    def to_code(self, language: str = "python") -> str:
        """The accelerations, L, H, momenta and multiplier as a program: "julia", "c", …, or
        "sympy".
        """
        from inverse_service.sympy.code import program

        return program(self, language)

    def to_python(self) -> str:
        """`to_code("python")`."""
        return self.to_code("python")

    def _picture(self) -> list[str]:
        found = as_image(self)
        return [] if found is None else [f'<img alt="a motion of the system" src="{found}">']


class Answers(Iterator[Result | dict[str, Any]]):
    """The answers in order of arrival, each once; `to_pandas` takes the remaining ones."""

    def __init__(self, answers: Iterator[Result | dict[str, Any]]) -> None:
        self._answers = answers

    def __next__(self) -> Result | dict[str, Any]:
        return next(self._answers)

    def to_pandas(self) -> Any:
        """A DataFrame with one row a result, see `answer_rows`; needs pandas."""
        return _frame([answer_rows.first_row(answer) for answer in self])


class Run(dict[str, Any]):
    """The summary of a scene."""

    def to_pandas(self) -> Any:
        """A DataFrame with one row a method: its outcome, and every observed number; needs
        pandas.
        """
        methods = self.get("methods") or []
        return _frame([dict(_numbers(one)) for one in methods if isinstance(one, Mapping)])


def _numbers(part: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Numbers and texts of nested objects, named by their path."""
    for key, value in part.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{prefix}{key}.")
        elif isinstance(value, int | float | str | None):
            yield prefix + key, value


def _frame(rows: list[dict[str, Any]]) -> Any:
    try:
        pandas = importlib.import_module("pandas")
    except ImportError:
        raise errors.InputError(
            "This needs pandas: run `pip install pandas`, or use `table(results)`."
        ) from None
    return pandas.DataFrame(rows)


def answers_to_many(
    systems: Iterable[Any], workers: int, output: Path | None, time_limit: float
) -> Iterator[Result | dict[str, Any]]:
    """The answers in the order of the systems."""
    readings = list[tuple[dict[str, Any], Any] | errors.InputError]()
    for system in systems:
        try:
            readings.append(asked(system))
        except errors.InputError as error:
            readings.append(error)
    documents = {
        k: one[0] for k, one in enumerate(readings) if not isinstance(one, errors.InputError)
    }
    lines = [
        json.dumps({**document, "id": place}, default=str) for place, document in documents.items()
    ]
    answers = {each["id"]: each for each in _answered(lines, workers, output, time_limit)}
    for place, reading in enumerate(readings):
        if isinstance(reading, errors.InputError):
            problem = of_input_error(reading)
            yield {"id": place, **problem, "error": problem}
        elif str(answers[place].get("format", "")).startswith("inverse-service/"):
            yield from_result(answers[place], reading[1])
        else:
            yield answers[place]


def _answered(
    lines: list[str], workers: int, output: Path | None, time_limit: float
) -> list[dict[str, Any]]:
    """The answers to the lines, from a separate batch, so that a script needs no `__main__`
    guard.
    """
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "systems.ndjson", output or Path(folder) / "results.ndjson"
        source.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "inverse_service",
            "batch",
            str(source),
            "--output",
            str(target),
        ]
        command += ["--workers", str(workers), "--time-limit", str(time_limit)]
        done = (
            subprocess.run(command, capture_output=True, text=True, check=False) if lines else None
        )
        found = (
            [json.loads(line) for line in target.read_text("utf-8").splitlines()]
            if target.exists()
            else []
        )
    if done is not None and len(found) < len(lines):
        raise errors.InputError(done.stderr.strip()[-500:] or "The systems could not be answered.")
    return found


def draw_motion(
    result: Result,
    start: Sequence[float] | None,
    parameters: Mapping[str, float],
    time: float,
    axes: Axes | None,
) -> Axes:
    """(x, x') for one coordinate, the path of the first two for more; InputError where the motion
    has no numbers.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise errors.missing_extra(error) or error from None
    columns, reason = motion(result, start, parameters, time)
    names = list(result._table.coordinates)
    across, up = columns[names[0]], columns[names[1] if names[1:] else f"v_{names[0]}"]
    if axes is None:
        axes = Figure(figsize=(4, 3), layout="constrained").subplots()
    axes.plot(across, up, linewidth=1)
    axes.plot(across[0], up[0], "o", markersize=4)
    axes.set(xlabel=names[0], ylabel=names[1] if names[1:] else f"{names[0]}'")
    if reason:
        axes.set_title(reason, fontsize="x-small", wrap=True)
    if names[1:]:
        axes.set_aspect("equal", adjustable="datalim")
    return axes


def motion(
    result: Result, start: Sequence[float] | None, parameters: Mapping[str, float], time: float
) -> tuple[Mapping[str, Any], str]:
    """The columns t, x, v_x, … of a motion by `adaptive`, and why it ends before `time` or is
    doubtful.
    """
    try:
        from inverse_service.service.scenes import simulating
    except ImportError as error:
        raise errors.missing_extra(error) or error from None
    names, known = list(result._table.coordinates), list(result._table.parameters)
    if unknown := [name for name in parameters if name not in known]:
        raise errors.InputError(
            f"{unknown[0]} is not a parameter of the system: it has {', '.join(known) or 'none'}."
        )
    if result._table.functions:
        raise errors.InputError(
            "A motion needs a formula for each arbitrary function: give it by 'where'."
        )
    n = len(names)
    values = list(
        map(
            float,
            [*(START * (1 + k / 3) for k in range(n)), *[0.0] * n] if start is None else start,
        )
    )
    if len(values) != 2 * n:
        raise errors.InputError(f"A start has {2 * n} numbers: the positions, then the velocities.")
    parts = {"positions": values[:n], "velocities": values[n:]}
    scene: dict[str, Any] = {
        "step": time / STEPS,
        "time": time,
        "methods": ["adaptive"],
        "observe": ["trajectory"],
    }
    scene["initial"] = {key: dict(zip(names, part, strict=True)) for key, part in parts.items()}
    scene |= {
        "system": {"result": dict(result)},
        "parameters": {x: float(parameters.get(x, 1)) for x in known},
    }
    found = simulating.simulate_tables(scene, time_limit=LONGEST)
    (method,), (columns,) = found["result"]["methods"], [*found["tables"].values()] or [None]
    reason = printed_pages.why(method)
    if columns is None:
        raise errors.InputError(f"The motion cannot be drawn: {reason}")
    return columns, reason


def as_image(result: Result) -> str | None:
    """A PNG as an address for HTML; None where matplotlib is absent or the motion cannot be
    drawn.
    """
    if (
        importlib.util.find_spec("matplotlib") is None
        or not result.get("verdict")
        or len(result.branches) > 1
    ):
        return None
    try:
        axes = draw_motion(result, None, {}, 20.0, None)
    except (errors.InputError, ValueError):
        return None
    stream = io.BytesIO()
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.savefig(stream, format="png", dpi=90)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
