"""Batches over HTTP: every line is answered once, equal lines are computed once, and bad lines give
problems.
"""

from __future__ import annotations

import json
from typing import Any

import httpx
import pytest

from tests.serving import HARD

NDJSON = {"Content-Type": "application/x-ndjson"}


def system(k: object, **more: Any) -> dict[str, Any]:
    return {"coordinates": ["x"], "equations": {"x": f"-{k}*x"}, **more}


def blockers(name: str) -> list[dict[str, Any]]:
    """Systems that take longer than the wait of any test."""
    return [HARD | {"name": f"{name} {k}"} for k in range(4)]


def results(client: httpx.Client, response: httpx.Response) -> list[dict[str, Any]]:
    assert response.status_code == 202, response.text
    stream = client.get(response.headers["location"] + "/results")
    assert stream.headers["content-type"].startswith("application/x-ndjson")
    return [json.loads(line) for line in stream.text.splitlines() if line]


def test_each_line_is_answered_once_with_its_id(client: httpx.Client) -> None:
    body = "\n".join(json.dumps(system(k, id=f"line {k}")) for k in range(1, 31))
    response = client.post("/v1/batches", content=body, headers=NDJSON)
    found = results(client, response)
    assert sorted(line["id"] for line in found) == sorted(f"line {k}" for k in range(1, 31))
    assert {line["verdict"] for line in found} == {"variational"}
    assert all(line["format"] == "inverse-service/result/1" for line in found)
    batch = client.get(response.headers["location"]).json()
    assert (batch["status"], batch["total"], batch["counts"]) == (
        "successful",
        30,
        {"successful": 30},
    )


def test_the_table_of_a_batch_says_where_a_lagrangian_is_one(client: httpx.Client) -> None:
    lines = [{"equations": "x'' = -Heaviside(x)", "id": "step"}, system(1, id="spring")]
    response = client.post("/v1/batches", json=lines)
    results(client, response)
    page = f"/batch/{response.headers['location'].rpartition('/')[2]}"
    rows = client.get(f"{page}/results.csv").text.splitlines()
    assert rows[0] == "line,name,verdict,lagrangian or reason,checked,where"
    assert rows[1].endswith(",x > 0; 1 more case")
    assert rows[2].endswith("valid,")
    assert "where x &gt; 0; 1 more case" in client.get(page).text


def test_bad_lines_are_problem_objects_and_the_others_continue(client: httpx.Client) -> None:
    lines = [
        '{"id": 7, "coordinates"',
        "[]",
        json.dumps(system("q", id="q")),
        "",
        json.dumps(system(2, id="ok")),
        json.dumps(system(3, id="ok")),
        json.dumps({"id": "k", "color": 1}),
        '{"id": "n", "equations": NaN}',
    ]
    response = client.post("/v1/batches", content="\n".join(lines), headers=NDJSON)
    found = {line["line"]: line for line in results(client, response)}
    assert sorted(found) == [1, 2, 3, 5, 6, 7, 8]
    assert found[5]["verdict"] == "variational"
    for number in (1, 2, 3, 6, 7, 8):
        assert found[number]["type"].startswith("urn:inverse-service:problem:")
        assert (found[number]["status"], found[number]["detail"][:8]) == (422, f"Line {number}: ")
    assert [found[k]["id"] for k in (1, 2, 3, 6, 7, 8)] == [None, None, "q", "ok", "k", None]
    assert (found[3]["errors"][0]["pointer"], found[3]["errors"][0]["column"]) == (
        "/equations/x",
        2,
    )


def test_equal_documents_are_computed_once(client: httpx.Client) -> None:
    def computed() -> float:
        lines = client.get("/metrics").text.splitlines()
        return sum(
            float(line.rsplit(" ", 1)[1])
            for line in lines
            if line.startswith("inverse_service_jobs_total")
        )

    before = computed()
    documents = [system(99, name="the same", id=k) for k in range(20)]
    found = results(client, client.post("/v1/batches", json=documents))
    assert sorted(line["id"] for line in found) == list(range(20))
    assert computed() - before == 1
    assert (
        len(
            {
                json.dumps({k: v for k, v in line.items() if k not in ("id", "line")})
                for line in found
            }
        )
        == 1
    )


def test_a_json_array_is_a_batch_and_its_places_are_ids(client: httpx.Client) -> None:
    found = results(client, client.post("/v1/batches", json=[system(4), 3, system(5)]))
    assert sorted((line["line"], line["id"]) for line in found if "verdict" in line) == [
        (1, 1),
        (3, 3),
    ]


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b"", "application/x-ndjson", 422), (b"\n\n", "application/x-ndjson", 422), (b"[]", "application/json", 422),
        (b"{}", "application/json", 422), (b"[", "application/json", 400), (b"{}", "text/plain", 415),
        (b"[1e999]", "application/json", 400),
        (b"{}\n" * 10_001, "application/x-ndjson", 413),
    ],
)  # fmt: skip
def test_a_body_that_is_not_a_batch_is_rejected(
    client: httpx.Client, content: bytes, kind: str, status: int
) -> None:
    response = client.post("/v1/batches", content=content, headers={"Content-Type": kind})
    assert (response.status_code, response.headers["content-type"]) == (
        status,
        "application/problem+json",
    )


def test_a_batch_that_is_sent_again_is_the_same_one(client: httpx.Client) -> None:
    lines = [system(k, name="again", id=f"again {k}") for k in range(3)]

    def place(lines: list[dict[str, Any]], **headers: str) -> str:
        response = client.post("/v1/batches", json=lines, headers=headers)
        assert response.status_code == 202, response.text
        return str(response.headers["location"])

    first = place(lines)
    assert len(results(client, client.post("/v1/batches", json=lines))) == 3
    assert place(lines) == first
    assert client.get(first).json()["total"] == 3
    anew = {"Cache-Control": "no-cache"}
    keyed = [place(lines, **anew, **{"Idempotency-Key": key}) for key in ("a", "a", "b")]
    assert keyed[0] == keyed[1]
    others = [
        lines[:2],
        lines[::-1],
        [*lines, {}],
        [{**line, "id": 10 + k} for k, line in enumerate(lines)],
    ]
    places = [first, *keyed[1:], place(lines, **anew), place(lines, **anew), *map(place, others)]
    assert len(set(places)) == len(places)
    assert (
        client.post("/v1/batches", json=lines, headers={"Idempotency-Key": "k" * 256}).status_code
        == 422
    )
    other = client.post("/v1/batches", json=lines[:2], headers={"Idempotency-Key": "a"})
    ask = {"url": "/v1/solve", "json": {"equations": "x'' = -x"}}
    single = client.post(**ask, headers={"Idempotency-Key": "a"})
    for refused in (other, single):
        assert (refused.status_code, refused.json()["type"].rpartition(":")[2]) == (
            422,
            "idempotency-key",
        )
    for _ in range(3):  # computed, from the store, from memory
        assert client.post(**ask, headers={"Idempotency-Key": "of one question"}).status_code == 200


def test_results_come_as_an_array_where_that_is_asked_for(client: httpx.Client) -> None:
    system = {"name": "array", "coordinates": ["x"], "equations": {"x": "-x"}}
    lines = [{"id": "a", **system}, {"id": "b"}, {"id": "c", **system}]
    place = client.post("/v1/batches", json=lines).headers["location"]
    found = client.get(f"{place}/results", headers={"Accept": "application/json"})
    assert found.headers["content-type"] == "application/json"
    assert {line["id"] for line in found.json()} == {"a", "b", "c"}
    anything = {"Accept": "application/json, text/plain, */*"}
    plain = [
        json.loads(line)
        for line in client.get(f"{place}/results", headers=anything).text.splitlines()
        if line
    ]
    assert sorted(map(json.dumps, plain)) == sorted(map(json.dumps, found.json()))


def test_a_cancelled_batch_that_is_sent_again_is_computed(client: httpx.Client) -> None:
    lines = [
        *blockers("cancelled and sent again"),
        system(7, name="after the slow ones", id="last"),
    ]
    first = client.post("/v1/batches", json=lines).headers["location"]
    assert client.delete(first).json()["counts"]["dismissed"] > 0
    second = client.post("/v1/batches", json=lines).headers["location"]
    assert second != first
    assert client.post("/v1/batches", json=lines).headers["location"] == second
    counts = client.get(second).json()["counts"]
    assert counts.get("accepted", 0) + counts.get("running", 0) > 0
    assert client.delete(second).json()["counts"] == {"dismissed": 5}


def test_an_unknown_kind_is_refused(client: httpx.Client) -> None:
    assert client.post("/v1/batches?kind=cook", json=[system(1)]).status_code == 422


def test_results_come_before_the_last_one_is_there_and_the_rest_can_be_cancelled(
    client: httpx.Client,
) -> None:
    place = client.post("/v1/batches", json=[system(6, name="quick"), *blockers("slow")]).headers[
        "location"
    ]
    with client.stream("GET", place + "/results") as stream:
        lines = stream.iter_lines()
        assert json.loads(next(lines))["line"] == 1
        counts = client.delete(place).json()["counts"]
        assert counts == {"successful": 1, "dismissed": 4}
        assert [json.loads(line)["status"] for line in lines] == [410] * 4


def test_a_batch_is_taken_as_it_came_and_read_afterwards(client: httpx.Client) -> None:
    lines = [json.dumps(system(k, name="sent", id=f"sent {k}")) for k in range(8)]
    lines += ["", json.dumps(system("q", id="q")), "[]", json.dumps(system(3, id="sent 3"))]
    later, body = NDJSON | {"Prefer": "respond-async"}, "\n".join(lines)
    response = client.post("/v1/batches", content=body, headers=later)
    assert response.headers["preference-applied"] == "respond-async"
    assert (response.json()["total"], response.json()["status"]) == (11, "accepted")
    found = {line["line"]: line for line in results(client, response)}
    assert sorted(found) == [*range(1, 9), 10, 11, 12]
    assert {found[k]["verdict"] for k in range(1, 9)} == {"variational"}
    assert {found[k]["status"] for k in (10, 11, 12)} == {422}
    assert [found[k]["id"] for k in (10, 11, 12)] == ["q", None, "sent 3"]
    again = client.post("/v1/batches", content=body, headers=later)
    assert again.headers["location"] == response.headers["location"]
    batch = client.get(again.headers["location"]).json()
    assert (batch["status"], batch["counts"]) == ("successful", {"successful": 8, "failed": 3})


@pytest.mark.parametrize(("content", "status"), [(b"\n\n", 422), (b"{}\n" * 10_001, 413)])
def test_what_is_no_batch_is_refused_before_it_is_stored(
    client: httpx.Client, content: bytes, status: int
) -> None:
    later = NDJSON | {"Prefer": "respond-async"}
    assert client.post("/v1/batches", content=content, headers=later).status_code == status
