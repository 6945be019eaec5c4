"""SymPy objects in and out: equations, LagrangesMethod and KanesMethod to results whose parts are SymPy expressions.

>>> from sympy import Eq, Function, Symbol
>>> from inverse_service.sympy import solve
>>> t, w, x = Symbol("t"), Symbol("omega"), Function("x")(Symbol("t"))
>>> solve(Eq(x.diff(t, 2), -(w**2) * x)).lagrangian
-omega**2*x(t)**2/2 + Derivative(x(t), t)**2/2

SymPy is imported by the first call. Nothing is guessed: applied functions of the time with second derivatives are
coordinates, other functions of it and functions of coordinates are arbitrary, the other symbols are parameters. No
text is evaluated: trees are converted node by node. Installing python-flint, which this package needs, switches
SymPy's ground types; nothing here sets SYMPY_GROUND_TYPES, and the bridge works under all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inverse_service.sympy.result_objects import Result, result_of

if TYPE_CHECKING:
    from inverse_service.sympy.from_sympy import Conditions
    from inverse_service.sympy.result_objects import Answers

__all__ = ["Result", "document", "from_result", "helmholtz", "nonholonomic", "solve", "solve_many", "table"]
_KEYS = frozenset(("equations", "lagrangian", "constraints", "motion", "format", "options", "parameters"))


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

    `system`: an Eq, an expression that is 0, a list or Matrix of these, {x(t): acceleration}, {x(t).diff(t, 2):
    acceleration}, {X: acceleration} for plain symbols with `velocities={X: vx}`, a Lagrangian (an expression with
    velocities and no acceleration: the forward problem), a LagrangesMethod, a KanesMethod, a System, or what
    `inverse_service.solve` takes. `questions` are keys of a document such as `ansatz`, `special_cases`,
    `time_dependent_lagrangian`. Raises InputError.
    """
    from inverse_service import solve as solve_document

    keys = {"coordinates": coordinates, "velocities": velocities, "time": time, **questions}
    return solve_document(system, time_limit=time_limit, seed=seed, **keys)


def document(system: Any, coordinates: Sequence[Any] | None = None, **keys: Any) -> dict[str, Any]:
    """What `solve` would ask, as a document for a file, a batch or the service."""
    return asked(system, coordinates, **keys)[0]


def asked(
    system: Any, coordinates: Any = None, *, velocities: Any = None, time: Any = None, **questions: Any
) -> tuple[dict[str, Any], Any]:
    """The document that is meant, and the SymPy objects of its names; None for a text, which has none."""
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
        texts = all(isinstance(value, str | int) and not isinstance(value, bool) for value in system.values())
        is_motion = texts and system and not any(key in _KEYS or _is_misspelt(key) for key in system)
        return ({"equations": system} if is_motion else _with_names(system)) | given, None
    if isinstance(system, list | tuple) and system and all(isinstance(entry, str) for entry in system):
        return {"equations": list(system)} | given, None
    from inverse_service.sympy.from_sympy import read

    return read(system, coordinates, velocities, time, questions)


def _is_misspelt(key: str) -> bool:
    """Whether it is a long key of documents nearly, and so no coordinate."""
    from inverse_service.service.documents.accepting import near_key

    long = ("equations", "lagrangian", "constraints")
    return key.lower() in long or near_key(key.lower()) in long or key.lower().startswith("lagrang")


def _with_names(keys: Mapping[str, Any]) -> dict[str, Any]:
    return {key: _named(value) if key in ("parameters", "functions") else value for key, value in keys.items()}


def _named(declared: Any) -> Any:
    """Declarations with SymPy objects as names, such as {k: 2}, [k], {V: [x]}, as a document has them."""
    if isinstance(declared, Mapping):
        return {_name(key): _named(value) for key, value in declared.items()}
    return [_named(each) for each in declared] if isinstance(declared, list | tuple) else _name(declared)


def _name(each: Any) -> Any:
    if each is None or isinstance(each, bool | int | float | str):
        return each
    from inverse_service.sympy.from_sympy import plain_name

    return plain_name(each)


def _of_text(text: str) -> dict[str, Any]:
    """The document of a text: a name of the catalogue, JSON, or equations."""
    from inverse_service import catalogue
    from inverse_service.errors import InputError
    from inverse_service.service.documents.plain_data import read_json

    if text.strip().startswith("{") and '"' in text:
        try:
            found = read_json(text)
        except InputError:
            found = None
        return found if isinstance(found, dict) else {"equations": text}
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
    """The result of a Lagrangian with constraints that are zero or equations; `questions` as in the document.

    `coordinates`: what has a velocity in them, where it is left out.
    """
    from inverse_service import solve as solve_document
    from inverse_service.sympy.from_sympy import read_constrained

    document, names = read_constrained(lagrangian, constraints, coordinates, questions)
    return result_of(solve_document(document, time_limit=time_limit, seed=seed), names)


def helmholtz(system: Any, coordinates: Sequence[Any] | None = None, **keys: Any) -> Conditions:
    """N, Phi, nabla Phi and R of a system, without a decision."""
    from inverse_service.sympy.from_sympy import conditions_of

    return conditions_of(system, coordinates, keys)


def solve_many(
    systems: Iterable[Any], workers: int = 2, output: str | Path | None = None, time_limit: float = 60.0
) -> Answers:
    """The results of many systems in their order, computed in processes; a problem document for a refused one.

    `output` keeps the answers in a file, so that an interrupted run can resume.
    """
    from inverse_service.sympy.result_objects import Answers, answers_to_many

    return Answers(answers_to_many(systems, workers, None if output is None else Path(output), time_limit))


def table(results: Iterable[Mapping[str, Any]]) -> Any:
    """One row a result: a pandas DataFrame where pandas is installed, else a list of dictionaries."""
    from inverse_service.sympy.result_objects import table_of

    return table_of(results)


def from_result(result: Mapping[str, Any], names: Mapping[str, Any] | None = None) -> Result:
    """A result that came from a file, a batch or the service; `names` are SymPy objects for its names."""
    return result_of(result, names)
