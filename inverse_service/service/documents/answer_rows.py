"""Results as rows of a table: each row is one entry of `answers`, with all that its formulas
need.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from inverse_service import errors
from inverse_service.service.documents import stated

# H is empty where only the energy E in the velocities was found.
COLUMNS = (
    "id", "line", "about", "with_time", "clock", "kind", "conditions", "cell", "cells", "verdict", "domain",
    "L", "L_where", "H", "H_where", "E", "momenta", "image", "auxiliary", "exceptions", "checked", "open",
    "n", "order", "multipliers", "seconds",
)  # fmt: skip


def first_row(result: Mapping[str, Any]) -> dict[str, Any]:
    """The row of the answer that people are shown."""
    return next(iter(rows(result)))


def rows(result: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """A row for each answer, the first one first; one row for an error line or the answer to
    another question.
    """
    if not isinstance(result, Mapping):
        raise errors.InputError("A table needs results.")
    of_line = {key: result.get(key) for key in ("id", "line")}
    if error := result.get("error"):
        yield _row(of_line | {"verdict": "error", "open": error["detail"]})
        return
    seconds = (result.get("provenance") or {}).get("seconds") or {}
    of_line |= {"n": len((result.get("system") or {}).get("coordinates", ()))}
    of_line |= {"seconds": sum(seconds.values()) if seconds else None}
    if "verdict" not in result:  # L was given
        yield _row(of_line | _formulas(result))
        return
    cells = len(stated.branches_of(result)) + len(stated.open_cells_of(result))
    answers = result.get("answers") or stated.answers_of(result)
    for one in answers:
        whole = stated.with_shared(one, answers)
        space, missing = whole.get("solution_space") or {}, whole["open"] or {}
        yield _row(
            of_line
            | {
                key: whole.get(key)
                for key in ("about", "with_time", "clock", "kind", "cell", "verdict", "checked")
            }
            | {
                key: ", ".join(whole.get(key) or ())
                for key in ("conditions", "domain", "exceptions")
            }
            | {"cells": cells, "open": missing.get("words"), "order": space.get("order")}
            | {"multipliers": space.get("statement")}
            | _formulas(whole)
        )


def _row(cells: Mapping[str, Any]) -> dict[str, Any]:
    return {column: cells.get(column) for column in COLUMNS}


def _formulas(part: Mapping[str, Any]) -> dict[str, Any]:
    """L and H with the sets where they are these, momenta, constraints in phase space, and the
    functions in L.
    """
    lagrangian, energy = part.get("lagrangian") or {}, part.get("hamiltonian") or {}
    return {
        "L": lagrangian.get("text"),
        "L_where": ", ".join(lagrangian.get("domain") or ()),
        "E" if energy.get("implicit") else "H": energy.get("text"),
        "H_where": ", ".join(energy.get("domain") or ()),
        "momenta": _listed(
            f"{name} = {text}" for name, text in (energy.get("momenta") or {}).items()
        ),
        "image": _listed(f"{one['text']} = 0" for one in energy.get("image") or ()),
        "auxiliary": _listed(
            f"d{name}/d{by} = {slope}"
            for name, known in (lagrangian.get("auxiliary") or {}).items()
            for by, slope in known["derivatives"].items()
        ),
    }


def _listed(texts: Iterable[str]) -> str:
    return "; ".join(texts)
