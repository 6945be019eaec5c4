"""A job's page: its progress, then its result, under one permanent address."""

from __future__ import annotations

import asyncio
import json
import re
import time
from typing import Any

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service.service.jobs.model import Job
from inverse_service.web.clients import viewer_of
from inverse_service.web.engine import Engine
from inverse_service.web.pages import answers, cases, constrained, exports, figures, simulations, typesetting
from inverse_service.web.pages.advice import advice_for
from inverse_service.web.pages.calls import Answer, call
from inverse_service.web.pages.documents import question_address
from inverse_service.web.pages.glossary import TERMS
from inverse_service.web.pages.receiving import SMALL_FORM, read_form
from inverse_service.web.pages.rendering import can_simulate, page

router = APIRouter()
IDENTIFIER = re.compile(r"[A-Za-z0-9_-]{1,128}")
# A short job's result comes with its first page; a longer one's page shows its progress.
PATIENCE = 1.0
LOOK_EVERY = 0.04
OPEN = frozenset(("accepted", "running"))


@router.get("/results/{identifier}")
async def result(request: Request, identifier: str) -> Response:
    """The result, or how far it is."""
    answer = await finished(request, identifier, PATIENCE)
    if answer is None:
        return missing()
    return await shown(request, answer.value)


@router.get("/results/{identifier}/result.json")
async def result_json(request: Request, identifier: str) -> Response:
    """The result document as a file."""
    answer = await finished(request, identifier, 0)
    if answer is None or answer.value["status"] != "successful":
        return missing()
    body = json.dumps(answer.value["result"], indent=1, ensure_ascii=False)
    headers = {"Content-Disposition": f'attachment; filename="result-{identifier[:12]}.json"'}
    return Response(body, headers=headers, media_type="application/json")


@router.post("/results/{identifier}/check")
async def check(request: Request, identifier: str) -> Response:
    """The checker run again, its verdict on the page."""
    await read_form(request, SMALL_FORM)
    answer = await finished(request, identifier, 0)
    if answer is None or answer.value["status"] != "successful":
        return missing()
    found = await call(request, "POST", "/v1/check", answer.value["result"])
    verdict = found.value if not found.is_problem else {"verdict": "incomplete", "reasons": [found.value["detail"]]}
    return await shown(request, answer.value, verdict)


@router.post("/results/{identifier}/again")
async def again(request: Request, identifier: str) -> Response:
    """The same question asked anew, for work that was cancelled or failed."""
    job = await _stored(request, identifier)
    if job is None:
        return missing()
    return await _asked_again(request, job, json.loads(job.options))


@router.post("/results/{identifier}/longer")
async def longer(request: Request, identifier: str) -> Response:
    """The same question asked with all the time that the service gives."""
    job = await _stored(request, identifier)
    return missing() if job is None else await _asked_again(request, job, {})


async def _asked_again(request: Request, job: Job, options: dict[str, Any]) -> Response:
    document = json.loads(job.document) | ({"options": options} if options else {})
    headers = {"Prefer": "respond-async"} | ({"Cache-Control": "no-cache"} if options else {})
    answer = await call(request, "POST", f"/v1/{job.kind}", document, headers)
    if answer.is_problem:
        return page("missing.html", answer.status, active="", title="Not asked again", detail=answer.value["detail"])
    return RedirectResponse(result_address(answer), 303)


@router.post("/results/{identifier}/cancel")
async def cancel(request: Request, identifier: str) -> Response:
    """Stop the work."""
    await read_form(request, SMALL_FORM)
    if IDENTIFIER.fullmatch(identifier):
        await call(request, "DELETE", f"/v1/jobs/{identifier}")
    return RedirectResponse(f"/results/{identifier}", 303)


@router.get("/results/{identifier}/figures.json")
async def figure_data(request: Request, identifier: str) -> Response:
    """The data of the figures of a simulation."""
    result = await simulated(request, identifier)
    return missing() if result is None else simulations.figures_json(result)


@router.get("/results/{identifier}/figures/{file}")
async def figure_file(request: Request, identifier: str, file: str) -> Response:
    """One figure as SVG or PNG."""
    result = await simulated(request, identifier)
    name, _, ending = file.rpartition(".")
    try:
        data = await figures.picture(identifier, result or {}, name, ending)
    except KeyError:
        return missing()
    return Response(data, media_type=simulations.PICTURES[ending], headers={"Cache-Control": "private, max-age=3600"})


@router.get("/results/{identifier}/data/{file}")
async def data_file(request: Request, identifier: str, file: str) -> Response:
    """The columns of one method as CSV or NPZ."""
    result = await simulated(request, identifier)
    label, _, ending = file.rpartition(".")
    method = next((m for m in (result or {}).get("methods", []) if m["label"] == label and m.get("points")), None)
    if method is None or ending not in ("csv", "npz"):
        return missing()
    if ending == "csv":
        return Response(simulations.csv_of(method), media_type="text/csv")
    data = await run_in_threadpool(simulations.npz_of, method)
    return Response(data, media_type="application/zip")


async def simulated(request: Request, identifier: str) -> dict[str, Any] | None:
    """The result of a simulation, None where there is none."""
    answer = await finished(request, identifier, 0)
    is_there = answer is not None and answer.value["status"] == "successful" and answer.value["kind"] != "solve"
    found: dict[str, Any] | None = answer.value["result"] if answer is not None and is_there else None
    return found


async def finished(request: Request, identifier: str, patience: float) -> Answer | None:
    """The job, waited for a moment; None where there is none."""
    if not IDENTIFIER.fullmatch(identifier):
        return None
    end = time.monotonic() + patience
    while True:
        answer = await call(request, "GET", f"/v1/jobs/{identifier}")
        if answer.is_problem:
            return None
        if answer.value["status"] not in OPEN or time.monotonic() >= end:
            return answer
        await asyncio.sleep(LOOK_EVERY)


async def _stored(request: Request, identifier: str) -> Job | None:
    """The job with its document; None where there is none. Only forms of our own pages come here."""
    await read_form(request, SMALL_FORM)
    return await stored_job(request, identifier)


async def stored_job(request: Request, identifier: str) -> Job | None:
    """The job with its document, without its answer; None where there is none."""
    engine: Engine = request.app.state.engine
    is_id = IDENTIFIER.fullmatch(identifier) is not None
    return await engine.job(identifier, viewer_of(request), with_body=False) if is_id else None


def result_address(answer: Answer) -> str:
    """The permanent link of a job's result."""
    location = answer.headers.get("location") or answer.headers.get("content-location") or ""
    identifier = location.rpartition("/")[2] or answer.value.get("id", "")
    return f"/results/{identifier}"


def missing() -> HTMLResponse:
    """There is no such job."""
    return page("missing.html", 404, active="", title="Nothing here", detail="There is no result at this address.")


async def shown(request: Request, job: dict[str, Any], check: dict[str, Any] | None = None) -> HTMLResponse:
    """The page of a job by its status."""
    if job["status"] in OPEN:
        return page("working.html", 200, active="", job=job)
    if job["status"] != "successful":
        return page("ended.html", 200, active="", job=job)
    if job["kind"] == "solve":
        return solve_result(request, job, check)
    if job["kind"] in ("simulate", "work-precision"):
        stored = await stored_job(request, job["id"])
        scene = simulations.pretty(stored.document if stored is not None else "null")
        make = simulations.simulation_result if job["kind"] == "simulate" else simulations.precision_result
        return make(request, job, scene)
    return other_result(request, job)


def solve_result(request: Request, job: dict[str, Any], check: dict[str, Any] | None) -> HTMLResponse:
    """The page of a solved system."""
    found = job["result"]
    address = str(request.base_url).rstrip("/")
    system = found["system"]
    with_time = found["with_time"]
    main = answers.answer_of(found, found["question"], found)
    return page(
        "result.html",
        active="",
        title=answers.title_of(found),
        question=question_address(system["given"]) if system else "",
        glossary=TERMS,
        address_of_result=f"{address}/results/{job['id']}",
        job=job,
        result=found,
        check=check,
        equations=[] if system is None else answers.equations_of(system),
        main=main,
        other=answers.answer_of(with_time, "L(t, q, q')", found) if with_time else None,
        branches=answers.branches_of(found),
        cases=cases.cases_of(found),
        constrained=constrained.constrained_of(found),
        search=constrained.search_of(found),
        also=answers.other_question(found),
        advice=advice_for(found, request.app.state.engine.settings.time_limit),
        matrices=answers.matrices_of(found["conditions"], typesetting.names_of(system)),
        exports=exports.exports(found, address),
        timing=answers.timing(found["provenance"]),
        can_simulate=can_simulate() and system is not None,
    )


def other_result(request: Request, job: dict[str, Any]) -> HTMLResponse:
    """A job whose result has no page of its own: its JSON."""
    text = json.dumps(job["result"], indent=1, ensure_ascii=False)
    return page("plain.html", active="", job=job, text=text)
