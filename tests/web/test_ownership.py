"""With keys, a client reads, renews, and cancels only its own jobs: all routes, with two keys."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute

from inverse_service.settings import Settings, hash_of_key
from inverse_service.web.application import create_application
from tests import serving

SECRET = "of alice alone"
ALICE, BOB = {"Authorization": "Bearer alice-key"}, {"X-API-Key": "bob-key"}
WAIT, ASYNC = {"Prefer": "wait=20"}, {"Prefer": "respond-async"}
HARD = serving.HARD | {"name": SECRET}
EASY = {"name": SECRET, "coordinates": ["x"], "equations": {"x": "-x"}}
SCENE = {
    "name": SECRET,
    "system": {"catalogue": "nonholonomic-particle"},
    "initial": {"positions": {"x": 0, "y": 0, "z": 0}, "velocities": {"x": 1, "y": 1}},
    "step": 0.1,
    "steps": 20,
    "methods": [{"method": "nonholonomic", "label": "one"}],
    "observe": ["trajectory", "energy"],
}


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    database = str(tmp_path_factory.mktemp("owned") / "jobs.sqlite")
    keys = f"alice:{hash_of_key('alice-key')}, bob:{hash_of_key('bob-key')}"
    with (
        serving.serving(database=database, api_keys=keys, log_level="warning") as (_, address),
        httpx.Client(base_url=address, timeout=60) as client,
    ):
        yield client


@dataclass(frozen=True)
class Ids:
    """Alice's ids: a solved system, a simulation, a batch, and running work."""

    solved: str
    simulated: str
    batch: str
    open: str


def ask(client: httpx.Client, path: str, document: Any, who: dict[str, str], **more: str) -> str:
    headers = WAIT | who | more
    answer = client.post(path, json=document, headers=headers)
    assert answer.status_code in (200, 202), answer.text
    return answer.headers["location"].rpartition("/")[2]


@pytest.fixture(scope="module")
def ids(client: httpx.Client) -> Ids:
    found = Ids(
        ask(client, "/v1/solve", EASY, ALICE),
        ask(client, "/v1/simulate", SCENE, ALICE),
        ask(client, "/v1/batches", [{"id": SECRET, **EASY}], ALICE),
        ask(client, "/v1/solve", HARD, ALICE | ASYNC),
    )
    for place in (
        f"/v1/jobs/{found.solved}",
        f"/v1/jobs/{found.simulated}",
        f"/v1/batches/{found.batch}",
    ):
        serving.until(
            lambda place=place: client.get(place, headers=ALICE).json()["status"] == "successful"
        )
        assert client.get(place, headers=ALICE).json()["status"] == "successful"
    return found


def routes_of(part: Any) -> Iterator[APIRoute]:
    """All routes of an application, including those of nested routers."""
    for route in part.routes:
        if isinstance(route, APIRoute):
            yield route
        elif (inner := getattr(route, "original_router", None)) is not None:
            yield from routes_of(inner)


def addresses(ids: Ids) -> list[tuple[str, str]]:
    """Method and path of every route that names a job or a batch, with each of alice's."""
    found = []
    files = {"figures": "coordinates.svg", "data": "one.csv"}
    for route in routes_of(create_application(Settings())):
        if not re.search(r"\{(id|identifier)\}", route.path):
            continue
        of_batch = "batch" in route.path
        for id in [ids.batch] if of_batch else [ids.solved, ids.simulated, ids.open]:
            path = re.sub(r"\{(id|identifier)\}", id, route.path).replace("{number}", "1")
            path = re.sub(
                r"\{file(:path)?\}", files.get(route.path.split("/")[-2], ""), path
            ).replace("{name}", "one")
            path = path.replace("{language}", "sympy").replace("{ending}", "svg")
            found += [(method, path) for method in sorted(route.methods or ())]
    return found


def state(client: httpx.Client, ids: Ids) -> list[Any]:
    """Everything that alice sees, except for parts that change by themselves."""
    places = [f"/v1/jobs/{id}" for id in (ids.solved, ids.simulated)] + [f"/v1/batches/{ids.batch}"]
    open_one = client.get(f"/v1/jobs/{ids.open}", headers=ALICE).json()
    listed = [job["id"] for job in client.get("/v1/jobs", headers=ALICE).json()["jobs"]]
    return [client.get(p, headers=ALICE).json() for p in places] + [
        open_one["status"],
        open_one["created"],
        listed,
    ]


def read(client: httpx.Client, method: str, path: str, who: dict[str, str]) -> tuple[int, str]:
    """The status and the beginning of the text, because streams of pending jobs do not end."""
    with client.stream(method, path, headers=who) as answer:
        if answer.status_code == 200 and path.endswith(("/events", "/results")):
            return answer.status_code, next(answer.iter_text(), "")
        answer.read()
        return answer.status_code, answer.text


def test_another_client_gets_the_same_as_for_what_is_not_there_on_all_routes(
    client: httpx.Client, ids: Ids
) -> None:
    before, tried = state(client, ids), addresses(ids)
    assert len(tried) > 30
    for method, path in tried:
        status, text = read(client, method, path, BOB)
        form = method == "POST" and path.endswith("/cancel")
        assert status == 404 or (form and status == 303), (method, path, status)
        assert SECRET not in text, (method, path)
    assert state(client, ids) == before
    seen = [read(client, method, path, ALICE)[0] for method, path in tried if method == "GET"]
    assert seen.count(404) <= 6 * 3, (
        "the paths of this test are wrong"
    )  # missing figures, data, code ...


@pytest.mark.slow
def test_the_lists_of_another_client_are_empty(client: httpx.Client, ids: Ids) -> None:
    for query in ("", "?status=successful", "?kind=solve"):
        assert client.get(f"/v1/jobs{query}", headers=BOB).json() == {"jobs": [], "next": None}
    newest = client.get("/v1/jobs?limit=1", headers=ALICE).json()["next"]
    assert client.get(f"/v1/jobs?cursor={newest}", headers=BOB).status_code == 422


@pytest.mark.slow
def test_the_same_question_of_another_client_tells_nothing_and_changes_nothing(
    client: httpx.Client, ids: Ids
) -> None:
    before, began = state(client, ids), time.time()
    for more in ({}, {"Cache-Control": "no-cache"}):
        id = ask(client, "/v1/solve", EASY, BOB, **more)
        assert id != ids.solved
        job = client.get(f"/v1/jobs/{id}", headers=BOB).json()
        assert min(job["created"], job["started"], job["finished"]) >= began - 1.0
        assert client.delete(f"/v1/jobs/{id}", headers=BOB).status_code == 200
    ask(client, "/v1/batches", [{"id": SECRET, **EASY}, HARD], BOB)
    batch = ask(client, "/v1/batches", [{"id": SECRET, **EASY}, HARD], BOB)
    assert batch != ids.batch
    assert (
        client.delete(f"/v1/batches/{batch}", headers=BOB).json()["counts"].get("accepted", 0) == 0
    )
    assert state(client, ids) == before


@pytest.mark.slow
def test_an_answer_in_memory_is_given_only_to_its_client(client: httpx.Client) -> None:
    places = [
        client.post("/v1/solve", json=EASY, headers=WAIT | ALICE).headers["location"]
        for _ in range(3)
    ]
    assert len(set(places)) == 1
    assert client.post("/v1/solve", json=EASY, headers=WAIT | BOB).headers["location"] != places[0]
    for wrong in ({}, {"Authorization": "Bearer of-nobody"}):
        assert client.post("/v1/solve", json=EASY, headers=WAIT | wrong).status_code == 401


def test_alice_cancels_her_work_and_bob_keeps_his(client: httpx.Client, ids: Ids) -> None:
    bobs = ask(client, "/v1/solve", HARD, BOB | ASYNC)
    assert client.delete(f"/v1/jobs/{ids.open}", headers=ALICE).json()["status"] == "dismissed"
    assert client.get(f"/v1/jobs/{bobs}", headers=BOB).json()["status"] in ("accepted", "running")
    assert client.delete(f"/v1/jobs/{bobs}", headers=BOB).json()["status"] == "dismissed"
