"""From data: the form, tables that are refused, and the page of the nearest systems, without scripts."""

from __future__ import annotations

import re
import sys
from html import unescape
from typing import Any
from urllib.parse import parse_qsl

import httpx
import numpy as np
import pytest

from inverse_service import data, errors, solve
from inverse_service.web.pages import forms, nearest, nearest_tasks, rendering, result_tasks
from tests.serving import until

TWO = "x'' = -1.02*x + 0.4*y; y'' = 0.5*x - y"


def test_the_form_leads_to_the_nearest_systems_and_back(service: str) -> None:
    """Of two springs with one mass, the nearest with equal masses has the mean of both couplings:
    0.45, at the distance sqrt(2) 0.05 / 0.02.
    """
    with httpx.Client(base_url=service, timeout=300, follow_redirects=True) as client:
        sent = {"kind": "equations", "equations": TWO, "nearest": "0.02"}
        page = client.post("/nearest", data=sent)
        assert page.url.path.endswith("/nearest")
        until(lambda: 'data-events="' not in client.get(page.url).text)
        text = unescape(client.get(page.url).text)
        for words in ("Equal masses", "3.54 errors", "of this kind itself"):
            assert words in text
        narrow = text.index("Equal masses")
        member = text.rindex("?member=", 0, narrow)
        shown = unescape(client.get(f"{page.url.path}{text[member:].partition('#')[0]}").text)
        assert "x'': y" in shown
        assert "0.45" in shown
        change = text[text.index('<a href="/nearest?') + 9 :].partition('"')[0]
        again = unescape(client.get(change).text)
        assert TWO.split("; ")[0] in again
        assert 'value="0.02"' in again
        # The answer leads there, and a result without this question has no such page.
        assert "The nearest systems" in client.get(page.url.path.removesuffix("/nearest")).text
        other = client.post("/v1/solve", json={"equations": "x'' = -x"})
        place = (other.headers.get("location") or other.headers["content-location"]).split("/")[-1]
        assert client.get(f"/results/{place}/nearest").status_code == 404


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (b"\x00\x01\xff\xfe", "not text"),
        (b"t,x\n0,1\n1\x00,2\n", "not text"),
        (b"", "empty"),
        (b"t,x\n", "empty"),
        (b"t,x\n0,1\n1,2,3\n", "Line 3 has 3 values, the first line 2"),
        (b"t,x\n0,1\n1,nan\n", "Line 3, column x: `nan` is not a number"),
        (b"0,1\n1,1e999\n", "Line 2, column x: `1e999` is not a number"),
        (b"t,x\n0,1\n1,__import__('os')\n", "is not a number"),
        (b"t;x\n0;1\n1;2\n1;3\n", "does not grow from line 3"),
        (b"t,x y\n0,1\n", "not a name of a column"),
        (b"t,x,x\n0,1,1\n", "Two columns are called `x`"),
        (b"t\n0\n1\n", "has 1 value"),
        (b"0," * 9 + b"1\n" + b"1," * 9 + b"1\n", "has 10 values"),
        (b"0,1\n" * 30_000, "more than 20,000 rows"),
        (b't,"x\n0,1\n', "Two columns|no name|has 1|CSV|empty|is not"),
    ],
    ids=lambda one: one[:12].decode("ascii", "replace") if isinstance(one, bytes) else "",
)
def test_a_table_that_is_none_is_refused_in_one_sentence(table: bytes, said: str) -> None:
    with pytest.raises(errors.InputError, match=said) as refused:
        data.read_table(table)
    assert len(str(refused.value)) < 200


def test_names_and_signs_of_a_table_are_found() -> None:
    found = data.read_table(b"\xef\xbb\xbft;theta1\r\n0;0.5\r\n0.1;-1e-3\r\n")
    assert {name: list(one) for name, one in found.items()} == {
        "t": [0, 0.1],
        "theta1": [0.5, -1e-3],
    }
    lines = data.read_table(b"\n0,1\n \n1,2\n\n2,5\n  \n")  # empty ones are none
    assert {name: list(one) for name, one in lines.items()} == {"t": [0, 1, 2], "x": [1, 2, 5]}
    assert data.read_table(b"0\t1\t2\n1\t2\t3\n").columns == ["t", "x", "y"]
    assert data.read_table(b"0,1,2,3,4\n1,2,3,4,5\n").columns == ["t", "x1", "x2", "x3", "x4"]


def test_without_pysindy_a_table_gets_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysindy", None)
    rows = "\n".join(f"{k / 10},{k % 7}" for k in range(60))
    body = (
        '--b\r\nContent-Disposition: form-data; name="table"; filename="q.csv"\r\n\r\n'
        f"t,x\n{rows}\n\r\n--b--\r\n"
    )
    with pytest.raises(errors.InputError) as refused:
        nearest_tasks.fit_task(body.encode(), "multipart/form-data; boundary=b")
    assert refused.value.detail == nearest_tasks.NO_FITS


@pytest.mark.slow
def test_a_table_is_fitted_through_http(service: str) -> None:
    """x = e^(-t/8) cos(w t), w^2 = 2 - 1/64, is a motion of x'' = -2 x - x'/4, of which L = e^(t/4)(x'^2/2 - x^2)."""
    pytest.importorskip("pysindy")
    times = np.linspace(0, 20, 2001)
    x = np.exp(-times / 8) * np.cos(np.sqrt(2 - 1 / 64) * times)
    x += 1e-4 * np.random.default_rng(2).normal(size=times.size)
    table = "t,x\n" + "\n".join(f"{t:.3f},{value:.6f}" for t, value in zip(times, x, strict=True))
    with httpx.Client(base_url=service, timeout=120, follow_redirects=True) as client:
        page = client.post(
            "/nearest/table",
            data={"degree": "1", "window": "31"},
            files={"table": ("q.csv", table, "text/csv")},
        )
        assert page.url.path.endswith("/nearest"), unescape(page.text)
        until(lambda: 'data-events="' not in client.get(page.url).text)
        found = client.get(page.url.path.removesuffix("/nearest").replace("/results/", "/v1/jobs/"))
        text = unescape(client.get(page.url).text)
    assert "Damped" in text
    first = found.json()["result"]["nearest"][0]
    assert first["kind"] == "damped"
    assert first["result"]["lagrangian"]["text"].startswith("exp(")
    numbers = re.findall(r"(\d+\.\d+)\*x", first["result"]["system"]["given"]["equations"]["x"])
    assert [*map(float, numbers)] == [pytest.approx(2, abs=0.02), pytest.approx(0.25, abs=0.01)]


def test_equations_between_coefficients_are_shown_as_words() -> None:
    text = "-4*[x'': x] + [y'': y']^2 = 0"
    assert nearest_tasks.readable(text) == "\u22124 (x in x'') + (y' in y'')\u00b2 = 0"


def page_of(found: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> str | None:
    monkeypatch.setattr(result_tasks, "part_task", lambda store, id, part: part(found))
    look = result_tasks.Look(rendering.Visitor(), "", 60.0)
    page = nearest_tasks.page_task("", "id", look, {})
    return None if page is None else unescape(bytes(page.body).decode())


def test_a_job_that_ended_before_its_nearest_systems_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = dict(solve("x'' = -1.02*x", first_integrals=False))
    assert page_of(found, monkeypatch) is None
    found["system"]["given"]["nearest"] = True
    text = page_of(found, monkeypatch)
    assert text is not None
    assert nearest_tasks.LATE in text


def test_what_moved_is_shown_with_its_error() -> None:
    moved = {
        "c": {"from": "0.003", "to": "0", "sigmas": -0.012},
        "k": {"from": "1.02", "to": "1.07", "sigmas": 2.5},
    }
    first, second = nearest_tasks._bars({"moved": moved, "chi2": 6.25})
    assert (first.name, first.before, first.change, first.length) == (
        "k",
        "1.02 ± 0.02",
        "+2.50",
        45,
    )
    assert (second.before, second.after, second.change) == ("0.003 ± 0.25", "0", "-0.01")
    relative = nearest_tasks._bars({"moved": moved, "chi2": None})
    assert (relative[0].before, relative[1].change) == ("1.02", "-1.20")


def test_the_cut_has_its_circles_and_its_line_to_one_scale() -> None:
    """A set of one equation for two coefficients is a line there; one of two equations is a point."""
    linear = {"coefficients": ["a", "b"], "matrix": [["1", "-1"]], "values": ["0"]}
    part = {"chi2": 25.0, "distance": 5.0, "constraints": linear}
    found = nearest_tasks._cut(part)
    assert found is not None
    assert found.is_set
    assert found.far == pytest.approx(5 * found.unit, abs=0.3)
    point = nearest_tasks._cut(
        part | {"constraints": linear | {"matrix": [["1", "0"], ["0", "1"]]}}
    )
    assert point is not None
    assert not point.is_set
    assert nearest_tasks._cut(part | {"chi2": None}) is None


def test_a_link_asks_what_the_form_asked() -> None:
    fields = dict.fromkeys(forms.FIELDS, "") | {
        "kind": "equations",
        "equations": TWO,
        "nearest": "0.02",
    }
    for more in ({"library": "", "nice": ""}, {"library": "x^2, x*y", "nice": "yes"}):
        document = nearest.document_of(fields, more)
        link = dict(parse_qsl(nearest_tasks.address_of(document).partition("?")[2]))
        again = nearest.document_of(
            fields | {"equations": link["equations"], "nearest": link["nearest"]},
            {name: link.get(name, "") for name in nearest.OWN},
        )
        assert again == document
    relative = nearest.document_of(fields | {"nearest": ""}, {"library": "", "nice": ""})
    assert relative["nearest"] is True
    with_matrix = {**document, "nearest": {"covariance": [["1"]], "coefficients": ["x'': x"]}}
    assert nearest_tasks.address_of(with_matrix) == ""


def test_how_far_a_nice_member_is_is_said_in_errors_where_they_are_known() -> None:
    part = {
        "nice": {"distance": 0.0346, "equations": {"x": "-x"}},
        "result": dict(solve("x'' = -1.02*x")),
    }
    known, relative = (nearest_tasks._nice(part | {"chi2": chi2}) for chi2 in (1.2, None))
    assert known is not None
    assert relative is not None
    assert (known.distance, relative.distance) == ("0.0346 errors", "3.46 %")
