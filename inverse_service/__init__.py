"""Inverse problem of the calculus of variations: verdict, Lagrangian, proof.

    from inverse_service import check, solve
    result = solve({"equations": "x'' = -x"})
    result["verdict"], result["lagrangian"]["text"], check(result)["verdict"]

Three functions for use without the service; documents and results are those of the command line, as plain
dictionaries. The engine is loaded by the first call.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

__all__ = ["check", "simulate", "solve"]
__version__ = "0.1.0"


def solve(document: Mapping[str, Any], *, time_limit: float = 60.0, seed: int = 1) -> dict[str, Any]:
    """The result of a System or a Nonholonomic document, its certificates checked.

    `time_limit` in s is kept by the solver between its stages, in this process: a result past it is
    `undetermined` and says so in `reason`. `seed` fixes the random points and primes. The key `options`
    of a document asks for less time and another seed. Raises `inverse_service.errors.InputError`.
    """
    from inverse_service.inverse_problem.options import SolveOptions
    from inverse_service.service.documents.documents import solve_document
    from inverse_service.service.jobs.options import JobOptions, read_options, split_options
    from inverse_service.service.jobs.warming import warm_first, warm_up

    alone, given = split_options(_plain(document))
    asked = read_options(given, JobOptions(time_limit=time_limit, seed=seed))
    warm_first(logging.getLogger(__name__).warning, warm_up)
    return solve_document(alone, SolveOptions(seed=asked.seed, time_limit=asked.time_limit))


def check(result: Mapping[str, Any] | str, document: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The independent checker on a result or a certificate, given as a dictionary or as JSON text.

    `verdict` is `valid`, `invalid` or `incomplete`; `reasons` are sentences. The system of the certificate
    is compared with `document`, or else with the document that the result carries as `system.given`.
    """
    from inverse_service.service.documents.checking import check_document, check_plain
    from inverse_service.service.jobs.options import split_options

    given = None if document is None else split_options(_plain(document))[0]
    if not isinstance(result, str):
        return check_plain(result, given)
    return check_document(result) if given is None else check_plain(_read(result), given)


def simulate(scene: Mapping[str, Any], *, time_limit: float = 600.0) -> dict[str, Any]:
    """The summary of a scene: for each method its outcome and every observed quantity. Raises InputError."""
    from inverse_service.service.scenes.simulating import simulate as run

    return run(_plain(scene), time_limit=time_limit)


def _read(text: str) -> Any:
    """The value of a JSON text; None, which is no result, where it is not one that is read here."""
    from inverse_service.errors import InputError
    from inverse_service.service.documents.reading import read_json

    try:
        return read_json(text)
    except InputError:
        return None


def _plain(document: Mapping[str, Any]) -> Any:
    """The document as the command line would read it, so that tuples are lists and 0.1 is exact."""
    import json

    from inverse_service.errors import InputError
    from inverse_service.service.documents.reading import read_json

    try:
        text = json.dumps(document)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"A document holds texts, numbers, lists and objects, as JSON does: {error}.") from None
    return read_json(text)
