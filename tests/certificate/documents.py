"""Build certificates and results for the checker without the project's engine."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from itertools import combinations_with_replacement
from typing import Any

from inverse_service.certificate.checker import CheckResult
from inverse_service.service.documents.checking import check_plain
from tests.doors.rows import rows

Document = dict[str, Any]
FORMAT = "inverse-service/certificate/2"
CLAIMS = {row["id"]: row for row in rows("certificates")}

FORCES: dict[str, dict[str, str]] = {
    "free": {"x": "0"},
    "free-pair": {"x": "0", "y": "0"},
    "oscillator": {"x": "-x"},
    "van-der-pol": {"x": "mu*(1-x^2)*x' - x"},
    "henon-heiles": {"x": "-x-2*x*y", "y": "-y-x^2+y^2"},
    "damped-henon-heiles": {"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"},
    "douglas-IIIb": {"x": "x^2+y^2", "y": "0"},
    "differential-obstruction": {"x": "2*x'/y'+2*x'", "y": "2*x'^2/y'+x'/y'"},
    "poynting-robertson": {
        "x": "-x'/(x^2+y^2) - x/(x^2+y^2)^(3/2)",
        "y": "-y'/(x^2+y^2) - y/(x^2+y^2)^(3/2)",
    },
    "spherical-pendulum": {"u": "sin(2*u)/2*w'^2 - G*sin(u)", "w": "-2*cot(u)*u'*w'"},
    "central-sine": {"x": "y*sin(x*y)", "y": "x*sin(x*y)"},
    "knife-edge-first": {"p": "0", "x": "-p'*x'*tan(p)", "y": "p'*x'"},
    "generic-second": {"r": "0", "w": "-N(r)*r'*w'", "s": "(A'(r)/A(r) - N(r))*r'*s'"},
    "robot-second": {
        "p": "0",
        "a": "-cos(a)",
        "x": "-tan(p)*p'*x' - cos(p)*cos(a)",
        "y": "cot(p)*p'*y' - sin(p)*cos(a)",
    },
    "lie-A4,7": {
        "x": "-2*w'*x' - w'*y'*z + w'*z'*z - y'*z'",
        "y": "w'*(-y' - z')",
        "z": "-w'*z'",
        "w": "0",
    },
    "painleve-I": {"x": "6*x^2 + t"},
}
PARAMETERS = {"van-der-pol": ["mu"], "spherical-pendulum": ["G"]}
FUNCTIONS = {"generic-second": {"A": ["r"], "N": ["r"]}}


def system(name: str) -> Document:
    """The system document of a named example."""
    forces = FORCES[name]
    return {
        "coordinates": list(forces),
        "equations": dict(forces),
        "parameters": PARAMETERS.get(name, []),
        "functions": FUNCTIONS.get(name, {}),
    }


def multi_indices(variables: int, degree: int) -> Iterator[list[int]]:
    """All exponents of a total degree."""
    for chosen in combinations_with_replacement(range(variables), degree):
        yield [chosen.count(variable) for variable in range(variables)]


def all_rows(coordinates: int, variables: int, order: int) -> list[list[Any]]:
    """Every row of the order-r system: a valid certificate if one exists at that order."""
    rows: list[list[Any]] = []
    for i, j in combinations_with_replacement(range(coordinates), 2):
        for degree in range(order + 1):
            for alpha in multi_indices(variables, degree):
                if degree < order:
                    rows.append(["H2", i, j, alpha])
                if i < j:
                    rows.append(["H3", i, j, alpha])
    return rows


def certificate(name: str, kind: str, question: str = "autonomous", **content: Any) -> Document:
    """A certificate about a named system."""
    return {
        "format": FORMAT,
        "system": system(name),
        "question": question,
        "claim": "not_variational" if kind == "nonexistence" else "variational",
        "kind": kind,
        **content,
    }


def lagrangian(name: str, text: str, question: str = "autonomous", **content: Any) -> Document:
    return certificate(name, "lagrangian", question, lagrangian=text, **content)


def nonexistence(name: str, order: int, question: str = "autonomous", **content: Any) -> Document:
    """The certificate that names every row of an order."""
    coordinates = len(FORCES[name])
    rows = all_rows(coordinates, 2 * coordinates + (question == "time_dependent"), order)
    return certificate(name, "nonexistence", question, **{"order": order, "rows": rows, **content})


def existence(
    name: str,
    order: int,
    dimensions: list[int],
    symbol: list[int],
    question: str = "autonomous",
    **content: Any,
) -> Document:
    """`symbol` has the dimension, the prolonged dimension, and the characters."""
    parts = {"dimension": symbol[0], "prolonged": symbol[1], "characters": symbol[2:]}
    degree = len(dimensions) - 1
    return certificate(
        name,
        "existence",
        question,
        order=order,
        degree=degree,
        dimensions=dimensions,
        symbol=parts,
        **content,
    )


def result(name: str, verdict: str, proof: Document | None, **content: Any) -> Document:
    """A result document with a certificate for its main verdict."""
    text = proof.get("lagrangian") if proof else None
    return {
        "format": "inverse-service/result/1",
        "system": system(name),
        "verdict": verdict,
        "certificate": proof,
        "lagrangian": {"text": text, "latex": "", "domain": []} if text else None,
        **content,
    }


def motion(equations: dict[str, str], velocities: object, **more: object) -> Document:
    """A motion on constraints in the form of a certificate."""
    dependent = list(velocities) if isinstance(velocities, dict) else []
    return {
        "coordinates": [*equations, *dependent],
        "equations": equations,
        "velocities": velocities,
        **more,
    }


def claim(system: Document, lagrangian: str = "", **more: object) -> Document:
    """The claim that this system has this Lagrangian, with the changes in `more`."""
    head = {"format": FORMAT, "system": system, "question": "autonomous", "claim": "variational"}
    return head | ({"kind": "lagrangian", "lagrangian": lagrangian} if lagrangian else {}) | more


def known(name: str) -> Document:
    """A certificate of the corpus."""
    return copy.deepcopy(CLAIMS[name]["certificate"])


def changed(document: Document, path: str, value: Any) -> Document:
    """A copy with the member at a dotted path replaced; the value `...` deletes it."""
    twin = copy.deepcopy(document)
    *way, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    place: Any = twin
    for key in way:
        place = place[key]
    if value is ...:
        del place[last]
    else:
        place[last] = value
    return twin


def check_result(document: object, **_: Any) -> CheckResult:
    """Check a result."""
    found = check_plain(document)
    return CheckResult(found["verdict"], tuple(found["reasons"]))
