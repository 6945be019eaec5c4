"""Inverse problem of the calculus of variations: verdict, Lagrangian, proof.

>>> from inverse_service import solve
>>> result = solve("x'' = -x")
>>> result.verdict, result["lagrangian"]["text"], result.check()["verdict"]
('variational', "x'^2/2 - x^2/2", 'valid')

Functions for use without the service; documents are those of the command line, results are mappings with
attributes. The engine is loaded by the first call, SymPy by the first attribute that is an expression.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inverse_service.client import Client
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.errors import InputError
    from inverse_service.sympy.objects import Result, Run

__all__ = [
    "Client", "InputError", "Result", "catalogue", "check", "nearest", "simulate", "solve"
]  # fmt: skip
__version__ = "0.2.0"
_ELSEWHERE = {
    "Client": "inverse_service.client",
    "InputError": "inverse_service.errors",
    "Result": "inverse_service.sympy.objects",
}


def __getattr__(name: str) -> Any:
    if name in _ELSEWHERE:
        return getattr(importlib.import_module(_ELSEWHERE[name]), name)
    if name == "data":
        return importlib.import_module("inverse_service.data")
    if name in ("catalogue", "errors", "sympy", "client"):
        return importlib.import_module(f"inverse_service.{name}")
    raise AttributeError(f"module 'inverse_service' has no attribute {name!r}")


def solve(
    document: Mapping[str, Any] | Sequence[str] | str | Any,
    *,
    time_limit: float = 60.0,
    seed: int = 1,
    progress: Callable[[str, Mapping[str, Any]], None] | None = None,
    **keys: Any,
) -> Result:
    """Solve a system and check the certificates of the result.

    `document` is a document, a string of equations, a list of them, accelerations by coordinate, a name from the
    catalogue, or SymPy objects (see `inverse_service.sympy`). `time_limit` in s of processor time is kept by the solver
    between its stages, in this process: a result after it is `undetermined` and says so in `reason`. `seed` fixes the
    random points and primes. In longer computations, `progress` is called after each part with the name of the part and
    the fields of the result that are then known. The key `options` of a document can set a shorter time and another
    seed. `keys` are additional keys of the document, such as time="x", or of `inverse_service.sympy.solve`. Raises
    InputError.
    """
    from inverse_service.sympy.objects import asked, from_result

    whole, names = asked(document, **keys)
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.kernels.machine_code.code_store import warm_first
    from inverse_service.service.compiling import warm_up
    from inverse_service.service.documents.documents import solve_document

    alone, options = _plain(whole), SolveOptions(seed=seed, time_limit=time_limit)
    if "options" in alone:
        alone, options = _with_its_options(alone, options)
    warm_first(logging.getLogger(__name__).warning, warm_up)
    if progress is None:
        return from_result(solve_document(alone, options), names)
    return from_result(
        _told_by_part(lambda tell: solve_document(alone, options, tell), progress), names
    )


def nearest(
    document: Mapping[str, Any] | Sequence[str] | str | Any,
    *,
    errors: Mapping[str, Any] | Sequence[Any] | float | None = None,
    weights: Mapping[str, Any] | Sequence[Any] | None = None,
    covariance: Any = None,
    coefficients: Sequence[str] = (),
    library: Mapping[str, Sequence[str]] | Sequence[str] = (),
    nice: bool = False,
    time_limit: float = 60.0,
    seed: int = 1,
    **keys: Any,
) -> Result:
    """The systems with a Lagrangian that are nearest to a fitted one, in `nearest` of the result.

    The coefficients are the parameters of the document that have values, or where there are none the numbers before
    the terms of its equations, named "x'': x*y". `errors` are standard errors, `weights` factors of squared changes,
    `covariance` a matrix in the order of `coefficients`; without these, changes are relative. `library` are terms
    that may be used besides. `nice` also offers simple fractions. Each member was solved, and the independent checker
    found its certificate valid. Other arguments as in `solve`. Raises InputError.

    >>> nearest("x'' = -1.02*x + 0.01*x'", errors=0.02).nearest[0]["kind"]
    'natural'
    """
    asked: dict[str, Any] = {
        key: value.tolist() if hasattr(value, "tolist") else value  # arrays of NumPy
        for key, value in (("errors", errors), ("weights", weights), ("covariance", covariance))
        if value is not None
    }
    if len(coefficients):
        asked["coefficients"] = list(coefficients)
    if len(library):
        asked["library"] = library if isinstance(library, Mapping | str) else list(library)
    if nice:
        asked["nice"] = True
    return solve(document, time_limit=time_limit, seed=seed, nearest=asked or True, **keys)


def check(
    result: Mapping[str, Any] | str, document: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Run the independent checker on a result or a certificate, given as a dictionary or as JSON text.

    `verdict` is `valid`, `invalid` or `incomplete`; `reasons` are sentences. The system of the certificate
    is compared with `document`, or by default with the document in `system.given` of the result.
    {"system": …, "lagrangian": …} asks whether your own Lagrangian yields the equations of a system: whatever `solve`
    takes, or a result or its `system`. The Lagrangian is a text, or an expression where the system has SymPy objects.
    """
    from inverse_service.service.documents.checking import check_document, check_plain
    from inverse_service.service.jobs.model import split_options

    given = None if document is None else split_options(_plain(document))[0]
    if isinstance(result, Mapping) and result.keys() == {"system", "lagrangian"}:
        from inverse_service.sympy.objects import asked

        system = dict(asked(result["system"], ansatz=[result["lagrangian"]])[0])
        result = {"lagrangian": system.pop("ansatz")[0], "system": system}
    text = result if isinstance(result, str) else _written(result)
    return check_document(text) if given is None else check_plain(_read(text), given)


def simulate(scene: Mapping[str, Any], *, time_limit: float = 600.0) -> Run:
    """Simulate a scene: the outcome and every observed quantity for each method. Raises InputError.

    Raises MissingExtra if the extra `simulation` is not installed.
    """
    from inverse_service.errors import missing_extra

    try:
        from inverse_service.service.scenes.simulating import simulate as run
    except ImportError as error:
        raise missing_extra(error) or error from None

    from inverse_service.sympy.objects import Run

    return Run(run(_plain(scene), time_limit=time_limit))


def _with_its_options(
    document: dict[str, Any], options: SolveOptions
) -> tuple[dict[str, Any], SolveOptions]:
    """The document without its key `options`, and what that key asks for."""
    from inverse_service.decision.solutions import SolveOptions
    from inverse_service.service.jobs.model import JobOptions, read_options, split_options

    alone, given = split_options(document)
    wanted = read_options(given, JobOptions(time_limit=options.time_limit, seed=options.seed))
    return alone, SolveOptions(seed=wanted.seed, time_limit=wanted.time_limit)


def _told_by_part(
    solved: Callable[[Callable[[Any], None]], dict[str, Any]],
    progress: Callable[[str, Mapping[str, Any]], None],
) -> dict[str, Any]:
    from inverse_service.service.documents import growing

    told = list[Any]()

    def tell(report: Any) -> None:
        if isinstance(report, dict):
            told.append(report)
            for event in growing.events(report):
                progress(event["part"], event["value"])

    result = solved(tell)
    if not told:
        tell(growing.at_once(result))
    return result


def _as_dictionary(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} is not accepted, write it as a string")


def _read(text: str) -> Any:
    """The value of a JSON text; None, which is not a result, if the text is not accepted."""
    from inverse_service.errors import InputError
    from inverse_service.service.documents.plain_data import read_json

    try:
        return read_json(text)
    except InputError:
        return None


def _plain(document: Mapping[str, Any]) -> Any:
    """The document as the command line would read it, so that tuples become lists and 0.1 is exact."""
    from inverse_service.service.documents.plain_data import read_json

    return read_json(_written(document))


def _written(document: Mapping[str, Any]) -> str:
    import json

    from inverse_service.errors import InputError

    try:
        return json.dumps(document, default=_as_dictionary)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(
            f"A document may hold strings, numbers, lists and objects, as in JSON: {error}."
        ) from None
