"""A page shows what holds instead of a no, with its proof checked."""

from __future__ import annotations

import re
from urllib.parse import parse_qsl

import httpx
import pytest

from inverse_service.reading.reader import equation_line, has_acceleration
from inverse_service.web.pages.form_documents import (
    document_of_fields,
    fields_from,
    fields_of,
    fields_of_link,
    question_address,
    right_side,
)
from inverse_service.web.pages.form_tasks import echo_task
from inverse_service.web.pages.forms import Form
from inverse_service.web.pages.reading_back import understood

DAMPED = {
    "equations": "x'' = -2*x + y - 2*x' + y'; y'' = x - 2*y + x' - 3*y'",
    "kinds": ["natural"],
}


def test_a_damped_chain_leaves_with_l_and_d(service: str) -> None:
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/solve", json=DAMPED, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        result = found.json()
        assert result["verdict"] == "not_variational"
        assert result["instead"]["kind"] == "rayleigh"
        page = client.get(f"/results/{address}").text
    assert "<dt>Instead</dt>" in page
    assert "<mi>D</mi>" in page
    assert 'potential energy: <span class="no">No</span>' in page


def test_a_lagrangian_with_time_has_its_section_and_no_second_card(service: str) -> None:
    document = {"equations": "x'' = -x/(x^2 + y^2)^(3/2) - x'; y'' = -y/(x^2 + y^2)^(3/2) - y'"}
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/solve", json=document, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        assert found.json()["instead"]["kind"] == "time"
        page = client.get(f"/results/{address}").text
    assert "<dt>Instead" not in page
    assert "contains the time" in page
    assert "Hamiltonian" in page


def test_a_page_says_what_is_constant(service: str) -> None:
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/solve", json={"equations": "x'' = -x; y'' = -4*y"}, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        page = client.get(f"/results/{address}").text
    assert page.count("quadratic in the momenta") == 2
    assert "energy" in page


def test_the_form_asks_for_kinds_and_another_clock() -> None:
    form = Form({"kind": ("equations",), "equations": ("x'' = -x",), "kinds": ("natural", "rayleigh"), "clock": ("x",)})
    document = document_of_fields(fields_of(form))
    assert (document["kinds"], document["clock"]) == (["natural", "rayleigh"], "x")
    assert document_of_fields(fields_from(document)) == document
    assert "kinds=natural+rayleigh" in question_address(document)


def test_a_link_with_kinds_fills_the_boxes(service: str) -> None:
    page = httpx.get(f"{service}/?equations=x''=-x&kinds=finsler&clock=x").text
    assert 'name="kinds" value="finsler"' in page
    assert 'name="clock" value="x"' in page
    assert "does not exist" not in page
    page = httpx.get(f"{service}/ask?kind=equations&equations=x''=-x&kinds=finsler&clock=x").text
    assert 'value="finsler" checked' in page
    assert 'id="clock" name="clock" value="x"' in page


def test_the_link_to_a_question_says_all_that_the_form_can_ask() -> None:
    asked = {"equations": "x'' = -a*x'", "parameters": ["a"], "special_cases": True, "ansatz": ["x'^2", "x^2"]}
    asked |= {"time_dependent_lagrangian": True, "kinds": ["natural"], "clock": "x", "options": {"time_limit": 5.0}}
    fields = fields_of_link(dict(parse_qsl(question_address(asked).partition("?")[2])))
    assert fields is not None
    assert {name: value for name, value in document_of_fields(fields).items() if name in asked} == asked | {
        "parameters": "guess"
    }


def test_a_link_that_asks_for_what_does_not_exist_says_so_and_asks_the_rest(service: str) -> None:
    page = httpx.get(f"{service}/?equations=x''=-x&kinds=finsler+finnish&time=maybe").text
    assert "This link asks for kinds=finnish, which does not exist and is left out; there is natural," in page
    assert "This link asks for time=maybe" in page
    assert 'name="kinds" value="finsler"' in page
    assert "Please change this" not in page


def test_a_lagrangian_may_begin_with_its_letter_and_places_stay() -> None:
    for left in ("L = ", "\\mathcal{L}=", "\\mathcal L ="):
        assert right_side(left + "x'^2/2 - L*x") == " " * len(left) + "x'^2/2 - L*x"
    for other in ("L*x'^2/2", "L_0 = x'^2", "L == x'^2", "x'^2/2 = L"):
        assert right_side(other) == other
    empty = dict.fromkeys(fields_of(Form({}, {})), "")
    fields = empty | {"kind": "nonholonomic", "lagrangian": "L = x'^2/2 - m*(x"}
    echo = echo_task(fields)
    assert [(place.column, place.marked) for place in echo["problem"].places] == [(16, "(")]


def test_an_own_lagrangian_may_begin_with_its_letter(service: str) -> None:
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post(
            "/v1/solve", json={"equations": "x'' = -x", "parameters": "guess"}, headers={"Prefer": "wait=20"}
        )
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        for left in ("", "L = "):
            page = client.get(f"/results/{address}", params={"lagrangian": f"{left}m*(x'^2 - x^2)/2"}).text
            assert "Yes. The Euler-Lagrange equations" in page
        page = client.get(f"/results/{address}", params={"lagrangian": "L = x'^2/2 - x^2"}).text
    assert "Not yet." in page


def test_each_side_of_a_kink_has_its_box(service: str) -> None:
    """Of equations without constraints, too: y'' sees a force of friction on one side of x = 0 alone."""
    document = {"equations": "x'' = 0; y'' = -y + (x + abs(x))*z; z'' = -z"}
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/solve", json=document, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        assert [one["verdict"] for one in found.json()["branches"]] == ["not_variational", "variational"]
        page = client.get(f"/results/{address}")
    assert page.status_code == 200
    assert re.findall(r'<h[12][^>]*>[^<]*<span class="(\w+)">', page.text)[:3] == ["differs", "no", "yes"]


def test_the_proof_of_the_first_branch_stands_before_that_of_the_second(service: str) -> None:
    document = {"equations": "x'' = 0; y'' = -y + (x + abs(x))*z; z'' = -z"}
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/solve", json=document, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        page = client.get(f"/results/{address}").text
    why = page[page.index('id="why"') :].partition("</details>")[0]
    assert re.findall(r"<h3>([^<]*)</h3>", why)[0] == "In the next case"


@pytest.mark.parametrize(
    ("document", "shown"),
    [
        ({"coordinates": ["x"], "equations": "x'' = -sqrt(tau - x)"}, r"where $\tau > x$"),
        ({"coordinates": ["x"], "equations": "x'' = -tau*x - x'"}, r"-\tau  x"),
        ({"lagrangian": "(x'^2 + y'^2 + z'^2)/2 - sqrt(y - tau)", "constraints": ["z' - y*x'"]}, r"where $y > \tau$"),
    ],
)
def test_a_time_of_another_name_is_shown(service: str, document: dict[str, object], shown: str) -> None:
    with httpx.Client(base_url=service, timeout=120, headers={"Prefer": "wait=20"}) as client:
        found = client.post("/v1/solve", json={**document, "time": "tau"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        page = client.get(f"/results/{address}")
        latex = client.post("/v1/solve", json={**document, "time": "tau"}, headers={"Accept": "application/x-latex"})
    assert (page.status_code, latex.status_code) == (200, 200)
    assert shown in latex.text


def test_a_second_derivative_of_a_function_is_no_acceleration(service: str) -> None:
    """Text and pages wrote A''(x) = 0 for an equation that is solved for x''."""
    document = {"equations": "x'' = -A'(x) + A''(x)", "functions": {"A": ["x"]}}
    with httpx.Client(base_url=service, timeout=120, headers={"Prefer": "wait=20"}) as client:
        text = client.post("/v1/solve", json=document, headers={"Accept": "text/plain"}).text
        answer = client.post("/v1/parse", json=document).json()
    assert text.startswith("  x'' = -A'(x) + A''(x)\n")
    ((_, (line,)),) = understood(answer).groups
    assert line.label == "x'' = -A'(x) + A''(x)"
    assert "<mo>=</mo><mn>0</mn>" not in line.math


@pytest.mark.parametrize(
    ("text", "has"),
    [("A''(x)", False), ("A'''(x) - x'", False), ("x'' + A''(x)", True), ("x''^2 - 1", True), ("2*x'' - y''", True)],
)
def test_what_has_an_acceleration(text: str, has: bool) -> None:
    assert has_acceleration(text) is has
    assert equation_line("x", text) == (f"{text} = 0" if has else f"x'' = {text}")


def test_the_form_of_a_scene_from_a_job_that_solved_nothing_is_not_found(service: str) -> None:
    scene = {
        "system": {"lagrangian": "x'^2/2 - x^2/2", "coordinates": ["x"]}, "step": 0.1, "steps": 5,
        "initial": {"positions": {"x": 1}, "velocities": {"x": 0}}, "methods": ["adaptive"],
    }  # fmt: skip
    with httpx.Client(base_url=service, timeout=120) as client:
        found = client.post("/v1/simulate", json=scene, headers={"Prefer": "wait=20"})
        address = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
        page = client.get("/simulate", params={"job": address})
    assert page.status_code == 404
    assert "There is no result with a system at this address." in page.text
