"""Jobs over HTTP are stored before any response, answered once, and can be watched and canceled."""

from __future__ import annotations

import itertools
import json
import re
import time
from typing import Any

import httpx
import pytest
from starlette.requests import Request

from inverse_service.web.asking import DEFAULT_WAIT, MAX_WAIT, Preference, preference_of
from tests.serving import HARD, TIME_LIMIT, until

ASYNC = {"Prefer": "respond-async"}
CANCELLED = 'inverse_service_jobs_total{kind="solve",outcome="cancelled"}'
_numbers = itertools.count()


def easy() -> dict[str, Any]:
    """A new, easy system."""
    return {"name": f"easy {next(_numbers)}", "coordinates": ["x"], "equations": {"x": "-x"}}


def hard() -> dict[str, Any]:
    """A new system that takes longer than the time limit."""
    return HARD | {"name": f"hard {next(_numbers)}"}


def finished(client: httpx.Client, place: str) -> httpx.Response:
    until(lambda: client.get(place).status_code != 202)
    return client.get(place)


def metrics(client: httpx.Client) -> dict[str, float]:
    response = client.get("/metrics")
    assert response.headers["content-type"].startswith("text/plain; version=0.0.4")
    samples = (line for line in response.text.splitlines() if not line.startswith("#"))
    return {name: float(value) for name, value in (line.rsplit(" ", 1) for line in samples)}


def events(
    client: httpx.Client, place: str, headers: dict[str, str] | None = None
) -> list[dict[str, Any]]:
    text = client.get(place + "/events", headers=headers).text
    parts = [part.split("\n") for part in text.split("\n\n") if "data: " in part]
    fields = [dict(line.split(": ", 1) for line in part) for part in parts]
    return [{**part, "data": json.loads(part["data"])} for part in fields]


def test_a_call_that_does_not_wait_gets_the_address_of_its_job(client: httpx.Client) -> None:
    document = easy()
    response = client.post("/v1/solve", json=document, headers=ASYNC)
    assert response.status_code == 202
    assert int(response.headers["retry-after"]) > 0
    place = response.headers["location"]
    assert place == f"/v1/jobs/{response.json()['id']}"
    job = finished(client, place)
    assert job.status_code == 200
    assert {"id", "kind", "status", "progress", "result"} <= set(job.json())
    assert (job.json()["kind"], job.json()["status"]) == ("solve", "successful")
    assert job.json()["result"] == client.post("/v1/solve", json=document).json()


def test_past_the_wait_a_call_gets_202_and_before_it_its_result(client: httpx.Client) -> None:
    begin = time.monotonic()
    response = client.post("/v1/solve?time_limit=8", json=hard(), headers={"Prefer": "wait=1"})
    assert response.status_code == 202
    assert time.monotonic() - begin > 0.9
    assert response.headers["preference-applied"] == "wait=1"
    client.delete(response.headers["location"])
    assert client.post("/v1/solve", json=easy(), headers={"Prefer": "wait=20"}).status_code == 200


def test_the_same_question_is_answered_from_the_store_and_no_cache_computes_again(
    client: httpx.Client,
) -> None:
    document = easy()
    patient = {"Prefer": "wait=20"}
    first, second = (client.post("/v1/solve", json=document, headers=patient) for _ in range(2))
    assert first.content == second.content
    assert first.headers["etag"] == second.headers["etag"]
    assert first.headers["cache-control"] == second.headers["cache-control"] == "private, no-cache"
    shuffled = dict(reversed(document.items()))
    assert client.post("/v1/solve", json=shuffled).headers["location"] == first.headers["location"]
    anew = client.post(
        "/v1/solve", json=document, headers={"Cache-Control": "no-cache", "Prefer": "wait=20"}
    )
    assert anew.headers["location"] == first.headers["location"]
    assert anew.headers["etag"] != first.headers["etag"]


def test_another_limit_is_another_question(client: httpx.Client) -> None:
    document = easy()
    places = [
        client.post("/v1/solve", json=document).headers["location"],
        client.post("/v1/solve?time_limit=5", json=document).headers["location"],
        client.post("/v1/solve", json=document | {"options": {"time_limit": 5}}).headers[
            "location"
        ],
        client.post("/v1/solve", json=document | {"options": {"seed": 7}}).headers["location"],
    ]
    assert places[1] == places[2]
    assert len(set(places)) == 3


@pytest.mark.parametrize(
    "options",
    [{"time_limit": TIME_LIMIT + 1}, {"time_limit": 0}, {"time_limit": True}, {"time_limit": "5"}, {"memory_limit": 10**6},
     {"memory_limit": 1}, {"seed": -1}, {"seed": 1.5}, {"color": 1}, [], "fast", 3],
)  # fmt: skip
def test_options_beyond_the_server_or_unknown_are_refused(
    client: httpx.Client, options: Any
) -> None:
    response = client.post("/v1/solve", json=easy() | {"options": options})
    assert response.status_code == 422
    assert response.json()["errors"][0]["pointer"].startswith("/options")


def test_the_order_of_equations_counts_where_it_names_the_coordinates(client: httpx.Client) -> None:
    places = [
        client.post("/v1/solve", json={"equations": equations}, headers=ASYNC).headers["location"]
        for equations in ({"x": "0", "y": "0"}, {"y": "0", "x": "0"})
    ]
    assert places[0] != places[1]


def test_a_refused_document_is_refused_again_from_the_store(client: httpx.Client) -> None:
    document = easy() | {"equations": {"x": "-x + omega"}}
    patient = {"Prefer": "wait=20"}
    first, second = (client.post("/v1/solve", json=document, headers=patient) for _ in range(2))
    assert (first.status_code, first.content) == (422, second.content)
    assert first.headers["content-type"] == "application/problem+json"
    job = client.get(first.headers["location"]).json()
    assert (job["status"], job["result"]) == ("failed", None)
    assert job["problem"] == first.json()
    assert client.post("/v1/solve", json=document, headers=ASYNC).status_code == 422


def test_an_invalid_formula_is_reported_at_once_even_without_waiting(client: httpx.Client) -> None:
    document = easy() | {"equations": {"x": "sin("}}
    assert client.post("/v1/solve", json=document, headers=ASYNC).status_code == 422


def test_a_job_has_an_etag_and_is_not_sent_twice(client: httpx.Client) -> None:
    place = client.post("/v1/solve", json=easy(), headers={"Prefer": "wait=20"}).headers["location"]
    tag = client.get(place).headers["etag"]
    again = client.get(place, headers={"If-None-Match": f'"other", W/{tag}'})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tag)
    assert client.get(place, headers={"If-None-Match": '"other"'}).status_code == 200


@pytest.mark.parametrize("method", ["GET", "DELETE"])
@pytest.mark.parametrize("place", ["/v1/jobs/0", "/v1/batches/0"])
def test_an_unknown_job_is_404(client: httpx.Client, method: str, place: str) -> None:
    response = client.request(method, place)
    assert (response.status_code, response.json()["type"]) == (
        404,
        "urn:inverse-service:problem:not-found",
    )


def test_events_tell_the_stages_and_can_be_resumed(client: httpx.Client) -> None:
    forces = {
        "x": "-x - (x^2 - 1)*x'",
        "y": "-4*y*y'^2 - (y^2 - 1)*y'",
        "z": "-z*z'^2 - (z^2 - 1)*z'",
    }
    searched = {"coordinates": [*forces], "equations": forces}
    for _ in range(5):  # a job that ends before the stream begins has no stages
        place = client.post("/v1/solve", json=easy() | searched, headers=ASYNC).headers["location"]
        found = events(client, place)
        if found[0]["data"] == {"status": "running"}:
            break
    assert found[0]["data"] == {"status": "running"}
    assert (found[-1]["event"], found[-1]["data"]) == ("status", {"status": "successful"})
    progress = [event["data"] for event in found if event["event"] == "progress"]
    stages = {part["stage"] for part in progress}
    assert stages >= {"decision", "prolongation", "check"}
    assert max(part.get("order", 0) for part in progress) >= 1
    numbers = [int(event["id"]) for event in found]
    assert numbers == sorted(set(numbers))
    assert events(client, place, {"Last-Event-ID": found[3]["id"]}) == found[4:]
    assert events(client, place, {"Last-Event-ID": found[-1]["id"]}) == []


def test_events_bring_the_parts_of_the_result_as_they_are_finished(client: httpx.Client) -> None:
    searched = {
        "coordinates": ["x", "y"],
        "equations": {"x": "-x - x'/3 - y^3*x'", "y": "-4*y*y'^2 + x^2"},
    }
    place = client.post("/v1/solve", json=easy() | searched, headers=ASYNC).headers["location"]
    parts = [event["data"] for event in events(client, place) if event["event"] == "part"]
    assert {"conditions", "existence"} <= {part["part"] for part in parts}
    whole = {key: value for part in parts for key, value in part["value"].items()}
    assert whole == client.get(place).json()["result"]


def test_a_cancelled_job_stops_working(client: httpx.Client) -> None:
    place = client.post("/v1/solve", json=hard(), headers=ASYNC).headers["location"]
    until(lambda: client.get(place).json()["status"] == "running")
    assert client.get(place).json()["progress"] is not None
    before = metrics(client).get(CANCELLED, 0)
    response = client.delete(place)
    assert (response.status_code, response.json()["status"]) == (200, "dismissed")
    assert response.json()["problem"]["status"] == 410
    assert client.get(place).status_code == 200
    less = client.get(place, headers={"Prefer": "return=minimal"}).json()
    assert (less["status"], less["result"], less["problem"]) == ("dismissed", None, None)
    assert events(client, place)[-1]["data"] == {"status": "dismissed"}
    # Its run has ended by that, not by its time limit.
    until(lambda: metrics(client).get(CANCELLED, 0) > before)
    assert client.delete(place).json()["status"] == "dismissed"


def test_a_dismissed_question_can_be_asked_again(client: httpx.Client) -> None:
    document = hard()
    place = client.post("/v1/solve?time_limit=0.2", json=document, headers=ASYNC).headers[
        "location"
    ]
    client.delete(place)
    again = client.post("/v1/solve?time_limit=0.2", json=document, headers={"Prefer": "wait=20"})
    assert (again.status_code, again.headers["location"]) == (200, place)
    assert again.json()["verdict"] == "undetermined"


def test_jobs_are_listed_newest_first_in_pages(client: httpx.Client) -> None:
    places = [client.post("/v1/solve", json=easy()).headers["location"] for _ in range(3)]
    page = client.get("/v1/jobs?limit=2").json()
    assert [job["id"] for job in page["jobs"]] == [
        place.rpartition("/")[2] for place in (places[2], places[1])
    ]
    following = client.get(f"/v1/jobs?limit=1&cursor={page['next']}").json()
    assert following["jobs"][0]["id"] == places[0].rpartition("/")[2]
    assert re.fullmatch(
        r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", following["jobs"][0]["accepted_at"]
    )
    assert all(
        job["status"] == "failed" for job in client.get("/v1/jobs?status=failed").json()["jobs"]
    )
    for bad in ("cursor=x", "limit=0", "limit=x", "status=sleeping"):
        assert client.get(f"/v1/jobs?{bad}").status_code == 422


def test_metrics_count_jobs_and_requests(client: httpx.Client) -> None:
    client.post("/v1/solve", json=easy(), headers={"Prefer": "wait=20"})
    samples = metrics(client)
    assert samples['inverse_service_jobs_total{kind="solve",outcome="variational"}'] >= 1
    assert samples['inverse_service_jobs{status="successful"}'] >= 1
    assert samples["inverse_service_queue_length"] >= 0
    assert samples['inverse_service_job_cpu_seconds_total{kind="solve"}'] > 0
    assert samples['inverse_service_job_memory_peak_bytes{kind="solve"}'] > 10 * 2**20
    buckets = [
        k for k in samples if k.startswith('inverse_service_job_wall_seconds_bucket{kind="solve"')
    ]
    counts = [samples[k] for k in buckets]
    assert counts == sorted(counts)
    assert buckets[-1].endswith('le="+Inf"}')


@pytest.mark.parametrize(
    ("prefer", "preference"),
    [
        ("respond-async", Preference(0.0, "respond-async", is_async=True)),
        ("respond-async, wait=5", Preference(5.0, "respond-async, wait=5", is_async=True)),
        ("wait=5", Preference(5.0, "wait=5")),
        ("wait=500", Preference(MAX_WAIT, f"wait={MAX_WAIT:g}")),
        ("return=minimal", Preference(DEFAULT_WAIT, "")),
    ],
)
def test_what_a_client_prefers_is_read_as_in_rfc_7240(prefer: str, preference: Preference) -> None:
    request = Request({"type": "http", "headers": [(b"prefer", prefer.encode())]})
    assert preference_of(request) == preference
