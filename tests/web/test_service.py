"""The HTTP service returns results and problem documents, and no input causes a 5xx."""

from __future__ import annotations

import gzip
import json
import re
from typing import Any

import httpx
import pytest
from markupsafe import escape

from inverse_service.errors import InputError
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.web.pages.forms import sentence
from tests.doors import rows
from tests.serving import HARD, TIME_LIMIT

OSCILLATOR = {"coordinates": ["x"], "equations": {"x": "-x"}}
JSON = {"Content-Type": "application/json"}
PROBLEM_KEYS = {"type", "title", "status", "detail", "errors"}


def understood(client: httpx.Client, fields: dict[str, str]) -> httpx.Response:
    """The page that shows how a form is parsed, as it is without scripts."""
    return client.post("/understood", data=fields, follow_redirects=True)


def problem(response: httpx.Response, status: int) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    found: dict[str, Any] = response.json()
    assert set(found) == PROBLEM_KEYS
    assert found["status"] == status
    assert found["type"].startswith("urn:inverse-service:problem:")
    return found


def test_a_body_over_the_limit_is_413_declared_or_not(client: httpx.Client) -> None:
    problem(client.post("/v1/solve", content=b" " * 2_000_000, headers=JSON), 413)
    chunks = (b" " * 100_000 for _ in range(20))
    problem(client.post("/v1/solve", content=chunks, headers=JSON), 413)


def test_the_column_of_a_formula_is_reported(client: httpx.Client) -> None:
    document = {"coordinates": ["x"], "equations": {"x": "-x + omega"}}
    found = problem(client.post("/v1/parse", json=document), 422)
    place = {"pointer": "/equations/x", "column": 6, "detail": found["detail"], "instead": []}
    found["errors"][0].pop("plain")
    assert found["errors"] == [{**place, "declare": "parameters"}]


def test_every_error_of_the_shape_is_reported_at_once(client: httpx.Client) -> None:
    found = problem(client.post("/v1/solve", json={"coordinates": 1, "color": 2}), 422)
    assert {place["pointer"] for place in found["errors"]} == {"/coordinates", "/equations"}


def test_raw_input_is_never_echoed(client: httpx.Client) -> None:
    marker = "<script>alert(1)</script>" * 20
    for document in (
        marker,
        {"coordinates": marker},
        {**OSCILLATOR, "equations": {"x": marker}},
        {marker: 1},
    ):
        assert (
            "<script>alert(1)</script><script>" * 10
            not in client.post("/v1/solve", json=document).text
        )


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "application/xml", ""]
)
def test_another_content_type_is_415(client: httpx.Client, kind: str) -> None:
    problem(
        client.post("/v1/solve", content=json.dumps(OSCILLATOR), headers={"Content-Type": kind}),
        415,
    )


def test_an_extra_slash_redirects_for_any_host_name(client: httpx.Client) -> None:
    answer = client.get("/v1/jobs/?limit=1")
    assert (answer.status_code, answer.headers["location"]) == (307, "/v1/jobs?limit=1")


def test_a_compressed_body_is_415(client: httpx.Client) -> None:
    headers = {"Content-Type": "application/x-ndjson", "Content-Encoding": "gzip"}
    problem(client.post("/v1/batches", content=gzip.compress(b" " * 100_000), headers=headers), 415)


@pytest.mark.parametrize("path", ["/v1/jobs/%00", "/results/a%00b", "/v1/catalogue/%00"])
def test_an_address_with_a_nul_is_not_there(path: str, client: httpx.Client) -> None:
    problem(client.get(path), 404)


def test_a_query_is_refused_with_its_place_and_what_is_taken(client: httpx.Client) -> None:
    problem(client.post("/v1/solve?x=%00", json=OSCILLATOR), 422)
    found = client.get("/v1/jobs?limit=9999&status=asleep").json()
    assert [fault["pointer"] for fault in found["errors"]] == ["/status", "/limit"]
    assert "500" in found["errors"][1]["detail"]
    assert "asleep" not in json.dumps(found)


def test_an_unanswered_preflight_names_the_setting(client: httpx.Client) -> None:
    asked = {"Origin": "https://example.org", "Access-Control-Request-Method": "POST"}
    response = client.options("/v1/solve", headers=asked)
    problem(response, 405)
    assert "CORS_ORIGINS" in response.json()["detail"]


def test_a_json_content_type_with_a_charset_is_fine(client: httpx.Client) -> None:
    headers = {"Content-Type": "application/json; charset=utf-8"}
    assert (
        client.post("/v1/parse", content=json.dumps(OSCILLATOR), headers=headers).status_code == 200
    )


def test_other_addresses_and_methods_are_problems(client: httpx.Client) -> None:
    problem(client.get("/nothing"), 404)
    problem(client.get("/v1/catalogue/nothing"), 404)
    response = client.get("/v1/solve")
    problem(response, 405)
    assert "POST" in response.headers["allow"]
    problem(client.delete("/v1/limits"), 405)


def test_an_oscillator_is_solved_and_its_result_checks(client: httpx.Client) -> None:
    response = client.post("/v1/solve", json=OSCILLATOR, headers={"Prefer": "wait=5"})
    assert response.status_code == 200, response.text
    result = response.json()
    assert (result["format"], result["verdict"], result["checked"]) == (
        "inverse-service/result/1",
        "variational",
        "valid",
    )
    assert client.post("/v1/check", json=result).json()["verdict"] == "valid"
    assert (
        client.post("/v1/check", json={**result, "verdict": "not_variational"}).json()["verdict"]
        == "invalid"
    )
    assert client.post("/v1/check", json=result["certificate"]).json()["verdict"] == "valid"
    for document, verdict in ((OSCILLATOR, "valid"), ({"equations": "x'' = x"}, "invalid")):
        shown = {"document": document, "result": result}
        assert client.post("/v1/check", json=shown).json()["verdict"] == verdict
    spoilt = {**result["certificate"], "lagrangian": "x'^2/2"}
    assert client.post("/v1/check", json=spoilt).json()["verdict"] == "invalid"


def test_an_object_that_is_not_a_result_is_reported(client: httpx.Client) -> None:
    problem(client.post("/v1/check", json=[]), 422)
    problem(client.post("/v1/check", content=b"{", headers=JSON), 400)
    assert client.post("/v1/check", json={}).json()["verdict"] != "valid"


def test_parse_says_what_was_understood(client: httpx.Client) -> None:
    document = {"coordinates": ["x"], "equations": "2x'' + k x = 0", "parameters": ["k"]}
    found = client.post("/v1/parse", json=document).json()
    assert (found["coordinates"], found["parameters"], found["depends_on_time"]) == (
        ["x"],
        ["k"],
        False,
    )
    assert set(found["equations"]["x"]) == {"text", "latex", "mathml"}
    assert found["equations"]["x"]["mathml"].startswith("<")


def test_a_deadline_gives_an_undetermined_result(client: httpx.Client) -> None:
    response = client.post("/v1/solve?time_limit=0.5", json=HARD, headers={"Prefer": "wait=20"})
    assert response.status_code == 200, response.text
    assert response.json()["verdict"] == "undetermined"
    assert "limit" in response.json()["reason"]


BAD_LIMITS = (
    "0",
    "-1",
    "nan",
    "inf",
    "1e9",
    "x",
    "9" * 100,
    "",
    "1_0",
    " 2",
    "\u0663",
    "0x2",
    "2.",
)


@pytest.mark.parametrize("limit", BAD_LIMITS)
def test_a_bad_time_limit_is_a_problem(client: httpx.Client, limit: str) -> None:
    found = problem(client.post(f"/v1/solve?time_limit={limit}", json=OSCILLATOR), 422)
    assert [place["pointer"] for place in found["errors"]] == ["/time_limit"]


@pytest.mark.parametrize("wait", ["respond-async, wait=21", "wait=999999999999"])
def test_of_a_longer_wait_twenty_seconds_are_applied(client: httpx.Client, wait: str) -> None:
    response = client.post("/v1/solve", json=OSCILLATOR, headers={"Prefer": wait})
    assert response.status_code == 200
    assert response.headers["preference-applied"].endswith("wait=20")


@pytest.mark.parametrize("path", ["/", "/livez", "/v1/catalogue", "/atlas", "/openapi.json"])
def test_head_is_get_without_the_body(client: httpx.Client, path: str) -> None:
    head, whole = client.head(path), client.get(path)
    assert head.status_code == whole.status_code == 200
    assert head.content == b""
    assert head.headers["content-type"] == whole.headers["content-type"]
    assert client.get("/livez").json() == {"status": "alive"}


def test_head_of_a_missing_page_or_a_stream_is_rejected(client: httpx.Client) -> None:
    assert client.head("/v1/jobs/none").status_code == 404
    assert client.head("/v1/jobs/none/events").status_code == 405
    assert client.head("/v1/solve").status_code == 405


def test_the_catalogue_is_listed_and_each_document_parses(client: httpx.Client) -> None:
    listed = client.get("/v1/catalogue").json()["systems"]
    assert len(listed) > 100
    entry = client.get(f"/v1/catalogue/{listed[0]['name']}").json()
    assert client.post("/v1/parse", json=entry["document"]).status_code == 200


def test_limits_and_probes(client: httpx.Client) -> None:
    limits = client.get("/v1/limits").json()
    assert limits["service"]["time_limit_seconds"] == TIME_LIMIT
    assert limits["document"]["max_coordinates"] == 64
    assert limits["formula"]["characters"] > 0
    assert client.get("/livez").json() == {"status": "alive"}
    assert client.get("/readyz").json() == {"status": "ready", "workers": "running"}


def test_openapi_resolves_within_itself(client: httpx.Client) -> None:
    text = client.get("/openapi.json").text
    description = json.loads(text)
    assert {"/v1/parse", "/v1/solve", "/v1/check", "/v1/catalogue", "/v1/limits", "/livez"} <= set(
        description["paths"]
    )
    references = {part.split('"')[0] for part in text.split("#/components/schemas/")[1:]}
    assert references <= set(description["components"]["schemas"])


@pytest.mark.parametrize("page", ["/", "/docs", "/atlas", "/learn", "/batch"])
def test_pages_load_nothing_from_elsewhere(client: httpx.Client, page: str) -> None:
    response = client.get(page)
    assert response.status_code == 200
    assert "default-src 'none'" in response.headers["content-security-policy"]
    loaded = re.sub(r'<a [^>]*href="https://[^"]*"', "", response.text)  # a link loads nothing
    for attribute in re.findall(r'(?:src|href|action)="([^"]*)"', loaded):
        assert attribute.startswith(("/", "#")), attribute


def test_the_form_answers_without_scripts_under_a_permanent_link(client: httpx.Client) -> None:
    response = client.post("/", data={"equations": "x'' = -x"}, follow_redirects=True)
    assert response.status_code == 200
    assert re.search(r"/results/[0-9a-f]{40}$", str(response.url))
    assert "this equation comes from a Lagrangian" in response.text
    again = client.get(str(response.url)).text
    assert re.findall("<h1.*</h1>", again) == re.findall("<h1.*</h1>", response.text)


def test_the_form_shows_faults_with_what_was_typed_escaped(client: httpx.Client) -> None:
    typed = {"coordinates": "x", "equations": "x'' = <b>\"", "parameters": ""}
    response = client.post("/", data=typed, follow_redirects=True)
    assert (response.status_code, response.request.method) == (200, "GET")
    assert "data-problem" in response.text
    assert "&lt;b&gt;" in response.text
    assert "<b>&#34;" not in response.text
    typed = {"equations": "x'' = -y\ny'' = 3*@ + x"}
    assert "3*<mark>@</mark> + x" in client.post("/", data=typed, follow_redirects=True).text
    problem(client.post("/", content=b"a=\xff\x00%"), 400)


def test_files_of_pages_are_kept_forever_under_the_hash_of_their_content(
    client: httpx.Client,
) -> None:
    script = re.search(r'src="(/static/[0-9a-f]+/page\.js)"', client.get("/").text)
    assert script is not None
    response = client.get(script[1])
    assert "immutable" in response.headers["cache-control"]
    assert (
        client.get(script[1], headers={"If-None-Match": response.headers["etag"]}).status_code
        == 304
    )
    assert client.get("/static/0/page.js").headers["cache-control"] == "no-cache"
    problem(client.get("/static/0/..%2F..%2Fsettings.py"), 404)
    problem(client.get("/static/0/secret"), 404)


def test_a_form_of_another_site_is_refused(client: httpx.Client) -> None:
    headers = {"Sec-Fetch-Site": "cross-site"}
    problem(client.post("/", data={"equations": "x'' = -x"}, headers=headers), 403)


def test_an_upload_that_is_not_a_form_is_rejected(client: httpx.Client) -> None:
    for content_type in ("multipart/form-data", "multipart/form-data; boundary=x"):
        for body in (
            b"",
            b"--x",
            b"--x\r\n\r\n--x--",
            b"\xff" * 100,
            b"--x\r\nno name\r\n\r\nv\r\n--x--\r\n",
        ):
            problem(client.post("/", content=body, headers={"Content-Type": content_type}), 400)


def test_a_lagrangian_alone_has_a_page_of_its_equations(client: httpx.Client) -> None:
    fields = {"kind": "nonholonomic", "lagrangian": "m*x'^2/2 - k*x^2/2", "constraints": ""}
    page = client.post("/", data=fields, follow_redirects=True)
    assert page.status_code == 200
    assert "equations of motion" in page.text
    assert "with constants" in page.text


@pytest.mark.parametrize(
    ("address", "typed", "said"),
    [
        ("/", {"equations": "x'' = -kxy"}, "data-problem"),
        ("/", {"equations": '{"equations": 1'}, "data-problem"),
        ("/", {"equations": "x'' = -x", "time_limit": "soon"}, "data-problem"),
        (
            "/understood",
            {"equations": "x'' = -k*x\r\n", "coordinates": "x", "kinds": ["natural"]},
            "<math",
        ),
        ("/understood", {"equations": "x'' = -kx"}, "parameters:0:0:kx"),
        (
            "/understood",
            {"lagrangian": "x'^2 - x^2", "constraints": "y'' = 0", "associated": "first"},
            "data-problem",
        ),
    ],
)
def test_a_returned_form_is_at_its_link_so_a_reload_sends_nothing(
    client: httpx.Client, address: str, typed: dict[str, Any], said: str
) -> None:
    answer = client.post(address, data=typed)
    assert answer.status_code == 303
    page = client.get(answer.headers["location"]).text
    echo = page.partition('id="understood"')[2].partition("</aside>")[0]
    assert said in echo
    assert all(
        escape(typed[name].strip()) in page for name in ("equations", "lagrangian") if name in typed
    )


@pytest.mark.parametrize(
    "typed",
    [
        {"equations": ""},
        {"equations": "x'' = -x" + " " * 8000 + ")"},
    ],
)
def test_a_form_that_no_link_says_whole_comes_back_as_it_was_sent(
    client: httpx.Client, typed: dict[str, str]
) -> None:
    answer = client.post("/", data=typed)
    assert answer.status_code == 422
    assert "data-problem" in answer.text
    assert f">\n{escape(typed['equations'])}</textarea>" in answer.text


def test_what_may_have_been_meant_is_a_button(client: httpx.Client) -> None:
    fields = {"kind": "equations", "equations": "x'' = -kxy"}
    for _ in range(2):  # the second time its job has ended
        page = client.post("/", data=fields, follow_redirects=True)
        assert 'value="equations:1:8:k*x*y"' in page.text
    chosen = understood(client, {**fields, "instead": "equations:1:8:k*x*y"})
    assert "x&#39;&#39; = -k*x*y</textarea>" in chosen.text
    declared = understood(client, {**fields, "instead": "parameters:0:0:kxy"})
    assert 'name="parameters" value="kxy"' in declared.text


@pytest.mark.parametrize("row", rows.rows("corrections"), ids=str)
def test_each_reading_is_a_button_that_leaves_the_rest(client: httpx.Client, row: rows.Row) -> None:
    fields = {"kind": "equations", "equations": row["typed"]}
    choice = f"equations:1:{row['at']}:{row['meant']}"
    assert f'value="{escape(choice)}"' in understood(client, fields).text
    chosen = understood(client, {**fields, "instead": choice})
    assert f"{escape(row['left'])}</textarea>" in chosen.text
    assert "data-problem" not in chosen.text


def test_a_constant_is_offered_only_where_it_can_be_one(client: httpx.Client) -> None:
    """kx' is a velocity, not a constant; each interpretation is shown as the resulting line."""
    page = understood(client, {"kind": "equations", "equations": "x'' = 1 - kx'"}).text
    assert escape("x'' = 1 - k*x'") in page
    assert "a constant" not in page


def test_two_subscripts_are_reported_with_their_place(client: httpx.Client) -> None:
    refused = understood(client, {"kind": "equations", "equations": "u_xx = -u"})
    assert "u_xx is read as a name" in refused.text.lower()
    assert "u&#39;&#39;(x)" in refused.text


def test_a_refusal_names_the_fields_that_the_form_has(client: httpx.Client) -> None:
    page = understood(client, {"kind": "equations", "equations": "x'' = -kxy"}).text
    assert "\u201cParameters\u201d, in" in page


@pytest.mark.slow
def test_a_refusal_of_a_form_that_declares_nothing_asks_for_no_declaration() -> None:
    with pytest.raises(InputError) as refused:
        read_formula("x + w(x)", Names(("x",)))
    without = "The name 'w' is not declared: use a known function or write * before the bracket."
    assert sentence(refused.value.places[0], is_marked=True) == without
    with pytest.raises(InputError) as asked:
        read_formula("-kx", Names(("x",), ("k",)))
    assert (
        sentence(asked.value.places[0])
        == "At column 2: the name 'kx' is not declared: did you mean k*x?"
    )


def test_a_problem_document_has_the_sentence_without_its_column_and_its_keys(
    client: httpx.Client,
) -> None:
    (place,) = client.post("/v1/solve", json={"equations": {"x": "-k*x"}, "parameters": []}).json()[
        "errors"
    ]
    what = "the name 'k' is not declared, and the coordinates are x"
    assert place["detail"] == f'{what}; it occurs at column 2: add it to "parameters".'
    assert (place["plain"], place["declare"]) == (f"{what}.", "parameters")
