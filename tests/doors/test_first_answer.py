"""The first statement of a result is what every door shows, with the set on which it holds."""

from __future__ import annotations

import functools
import re
from typing import Any

import pytest
import sympy as sp

import inverse_service
from api_schemas import result as schemas
from inverse_service.client import Client
from inverse_service.expressions import tree as ex
from inverse_service.mechanics.first_integrals import FirstIntegral
from inverse_service.service.documents import sheets, stated, translate
from inverse_service.service.documents.printed_pages import text_page
from inverse_service.sympy import objects
from tests.doors import rows, shown
from tests.serving import serving
from tests.values import slow

Document = dict[str, Any]
KNIFE_EDGE = {
    "coordinates": ["x", "y", "phi"],
    "lagrangian": "(x'^2 + y'^2 + phi'^2)/2",
    "constraints": ["y'*cos(phi) - x'*sin(phi)"],
}
HENON_HEILES = {"equations": {"x": "-x - 2*x*y - x'", "y": "-y - x^2 + y^2 - y'"}}
EMDEN = {"equations": {"x": "-3*x*x' - x^3"}}
DRAG = {"equations": {"x": "-k(x)*x'^2 - g"}, "parameters": ["g"], "functions": {"k": ["x"]}}
# L without t is an arctangent, there is one with t alone, L has a quotient, an F, none is, cells,
# a formula in pieces, constraints.
CHEAP: list[Document] = [
    {"equations": {"x": "-x - c*x'"}, "parameters": ["c"]},
    HENON_HEILES,
    EMDEN,
    DRAG,
    {"equations": {"x": "y", "y": "-x*x'"}},
    {"equations": "x'' = -sqrt(x^2)"},
    {"equations": {"x": "-x*y'^2", "y": "-x'*y'"}, "clock": "exp(x)"},
    {"equations": {"x": "-2*x", "y": "-3*y"}, "kinds": ["natural", "finsler"]},
    {"equations": {"x": "Piecewise((-k*x, (x > 0) & (x' > 0)), (-x, True))"}, "parameters": ["k"]},
    KNIFE_EDGE,
    {"coordinates": ["x", "y", "z"], "motion": {"x": "0", "y": "0"}, "constraints": ["z' = y*x'"]},
]
CORPUS = [row["document"] for row in rows.systems() if row.get("verdict") == "variational"]
SAMPLE = CORPUS[:: max(1, len(CORPUS) // 300)]


@pytest.mark.parametrize(
    "document", [*({"first_integrals": False, **one} for one in CHEAP), *map(slow, SAMPLE)]
)
def test_every_door_shows_the_first_statement(document: Document) -> None:
    result = dict(inverse_service.solve(document, time_limit=60))
    shown.assert_every_door_shows(result)
    assert_each_is_whole(result)
    assert_older_keys_say_nothing_else(result)
    older = {key: value for key, value in result.items() if key != "answers"}
    assert stated.answers_of(older) == stated.answers_of(result) == result["answers"]


@pytest.mark.slow
def test_http_answers_with_the_first_statement() -> None:
    """What a client gets is what the same process shows, whose own order the doors have."""
    with serving() as (_, address), Client(address) as client:
        for document in [*CHEAP, *SAMPLE[::20]]:
            result = dict(client.solve(document, timeout=600))
            first = result["answers"][0]
            shown.assert_every_door_shows(result)
            here = dict(inverse_service.solve(document, time_limit=60))["answers"][0]
            assert [(first[key] or {}).get("text") for _, key in sheets.FORMULAS] == [
                (here[key] or {}).get("text") for _, key in sheets.FORMULAS
            ]


def at(result: Document, pointer: str) -> Any:
    """The part of a result to which a JSON pointer without escapes leads."""
    steps = (int(key) if key.isdigit() else key for key in pointer[1:].split("/"))
    return functools.reduce(lambda part, key: part[key], steps, result)


def assert_each_is_whole(result: Document) -> None:
    """No verdict without proof, no formula without its set, no H without momenta, no F without its
    derivatives.
    """
    for one in result["answers"]:
        schemas.AnswerPart.model_validate(one)
        whole = stated.with_shared(one, result["answers"])
        lagrangian, energy, certificate = (
            whole["lagrangian"],
            whole["hamiltonian"],
            whole.get("certificate", ""),
        )
        is_settled = one["verdict"] != "undetermined"
        assert is_settled is (one["checked"] == "valid") is bool(certificate)
        is_open = not is_settled or (one["verdict"] == "variational" and not lagrangian)
        assert is_open is (whole["open"] is not None)
        if lagrangian:
            named = set(re.findall(r"\b([A-Z]\w*)\(", lagrangian["text"])) - {
                *result["system"]["functions"]
            }
            assert named <= {*lagrangian["auxiliary"]}
        for integral in one.get("first_integrals") or ():
            used = set(re.findall(r"\b([A-Z]\w*)\(", integral["text"]))
            assert used <= {*integral.get("auxiliary", {}), *result["system"]["functions"]}
        if lagrangian:
            assert at(result, certificate)["lagrangian"] == lagrangian["text"]
        if energy:
            assert lagrangian
            assert energy["momenta"]
            assert energy["domain"] is not None


def test_a_conserved_quantity_defines_the_functions_in_it() -> None:
    """exp(x^2/2) x' - F(x), F' = exp(x^2/2), of x'' = -x x'^2 + x': the shown L has no F."""
    x = ex.Symbol("x")
    slope = ex.Apply("exp", x**2 / 2)
    energy = slope * ex.Velocity("x") - ex.Integral("F", (x,), (0,), (slope,))
    part = translate.integral_part(FirstIntegral("energy", energy))
    told = part.model_dump(mode="json")
    assert told["auxiliary"] == {"F": {"arguments": ["x"], "derivatives": {"x": "exp(x^2/2)"}}}
    plain = translate.integral_part(FirstIntegral("energy", slope))
    assert "auxiliary" not in plain.model_dump(mode="json")
    found = dict(inverse_service.solve("x'' = 0", time_limit=20))
    found["first_integrals"] = [told]
    result = objects.Result(stated.with_answers(found))
    page = text_page(result, explain=False)
    assert "  exp(x^2/2)*x' - F(x)\n      with F(x) = \u222b exp(x^2/2) dx\n" in page
    (kept,) = result.first_integrals
    place = sp.Function("x")(sp.Symbol("t"))
    v, f = place.diff(), place.diff() - place * place.diff() ** 2
    assert sp.simplify(kept.expr.diff(sp.Symbol("t")).subs(v.diff(), f)) == 0


def test_the_statement_about_special_values_has_its_equations() -> None:
    """x^-1 for n = -1, which the L for general n leaves out."""
    equations = {"y": "-2*y'/t - y^n"}
    document = {"equations": equations, "parameters": ["n"], "first_integrals": False}
    result = inverse_service.solve(document, time_limit=30)
    (special,) = (one for one in result["answers"] if one.get("conditions"))
    assert special["conditions"] == ["n = -1"]
    assert special["equations"] == result["left_out"][0]["equations"] == {"y": "-2*y'/t - 1/y"}


def assert_older_keys_say_nothing_else(result: Document) -> None:
    """Each L and H of the older keys is one of an answer; proofs and Hamiltonizations aside."""
    told = {
        (key, one[key]["text"])
        for one in result["answers"]
        for _, key in sheets.FORMULAS
        if one.get(key)
    }
    told |= {
        ("lagrangian", other["text"])
        for one in result["answers"]
        for other in one.get("other_lagrangians", ())
    }
    aside = {
        "answers",
        "system",
        "certificate",
        "certificate_with_time",
        "nonholonomic",
        "provenance",
    }
    waiting: list[Any] = [{key: part for key, part in result.items() if key not in aside}]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            waiting += [value for key, value in part.items() if key not in aside]
            for _, key in sheets.FORMULAS:
                if part.get(key):
                    assert (key, part[key]["text"]) in told
        elif isinstance(part, list):
            waiting += part
