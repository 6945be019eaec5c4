"""A job's page: its progress, then its result, under one permanent address."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from typing import Any, TypeVar, cast

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service.service.jobs.model import Job
from inverse_service.web.clients import client_of, viewer_of
from inverse_service.web.engine import LONG_DEADLINE, Engine
from inverse_service.web.job_answers import MINIMAL, REVALIDATE, is_known, stored_response
from inverse_service.web.pages import reading_back, result_tasks, simulations
from inverse_service.web.pages.own_calls import SMALL_FORM, Answer, call, read_form
from inverse_service.web.pages.rendering import POLICY, VISITOR, packed, page

T = TypeVar("T")
router = APIRouter()
IDENTIFIER = re.compile(r"[A-Za-z0-9_-]{1,128}")
# A short job's result comes with its first page; a longer one's page shows its progress.
PATIENCE = 1.5
# What is confirmed by then is shown while the rest is sought.
SOON = 0.2
ASKED = 20  # lines of a question
OPEN = frozenset(("accepted", "running"))


@router.get("/results/{identifier}")
async def result(request: Request, identifier: str) -> Response:
    """The result, or how far it is; with `lagrangian` a visitor's own L judged."""
    answer = await finished(request, identifier, PATIENCE)
    if answer is None:
        return missing()
    judged = None
    if answer.value["status"] == "successful" and answer.value["kind"] == "solve":
        judged = await _judged(request, identifier)
    return await shown(request, answer.value, judged)


async def _judged(request: Request, identifier: str) -> dict[str, Any] | None:
    own = request.query_params.get("lagrangian")
    return await made(request, identifier, result_tasks.own_lagrangian_task, own) if own else None


@router.get("/results/{identifier}/embed")
async def embedded(request: Request, identifier: str) -> Response:
    """Verdict, equations and L alone: what this service and INVERSE_SERVICE_FRAME_ORIGINS show in frames."""
    answer = await successful(request, identifier)
    if answer is None or answer.value["kind"] != "solve":
        return missing()
    found = await made(request, identifier, result_tasks.embed_task, VISITOR.get())
    origins = " ".join(("'self'", *request.app.state.engine.settings.frame_origins))
    found.headers["Content-Security-Policy"] = POLICY.replace("frame-ancestors 'none'", f"frame-ancestors {origins}")
    # The older header knows no list; whoever reads the policy does not read it.
    found.headers["X-Frame-Options"] = "SAMEORIGIN"
    return found


@router.get("/results/{identifier}/result.json")
async def result_json(request: Request, identifier: str) -> Response:
    """The result document as a file."""
    answer = await successful(request, identifier)
    if answer is None:
        return missing()
    headers = {"Content-Disposition": f'attachment; filename="result-{identifier[:12]}.json"'} | kept(answer)
    if is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    return await stored_response(request.app.state.engine, identifier, headers)


@router.post("/results/{identifier}/again")
async def again(request: Request, identifier: str) -> Response:
    """The same question asked again, for work that was cancelled or failed."""
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
    return await _file(request, identifier, "application/json", "figures", result_tasks.figure_data_task)


@router.get("/results/{identifier}/figures/{file}")
async def figure_file(request: Request, identifier: str, file: str) -> Response:
    """One figure as SVG or PNG."""
    name, _, ending = file.rpartition(".")
    if name not in simulations.NAMES or ending not in simulations.PICTURES:
        return missing()
    return await _file(request, identifier, simulations.PICTURES[ending], file, result_tasks.picture_task, name, ending)


@router.get("/results/{identifier}/prices.csv")
async def prices(request: Request, identifier: str) -> Response:
    """The prices of a work-precision measurement."""
    answer = await successful(request, identifier)
    if answer is None or answer.value["kind"] != "work-precision":
        return missing()
    return await _file(request, identifier, "text/csv", "prices", result_tasks.prices_task)


@router.get("/results/{identifier}/data/{file:path}")
async def data_file(request: Request, identifier: str, file: str) -> Response:
    """The columns of one method as CSV or NPZ."""
    label, _, ending = file.rpartition(".")
    if ending not in simulations.TABLES:
        return missing()
    return await _file(request, identifier, simulations.TABLES[ending], ending, result_tasks.file_task, label, ending)


@router.get("/results/{identifier}/picture.{ending}")
async def answer_picture(request: Request, identifier: str, ending: str) -> Response:
    """The motion of a solved system, for pages without scripts and for links that are shared."""
    if ending not in simulations.PICTURES:
        return missing()
    media_type, task = simulations.PICTURES[ending], result_tasks.answer_picture_task
    return await _file(request, identifier, media_type, f"picture-{ending}", task, ending, of_scene=False)


@router.get("/results/{identifier}/code/{language}")
async def code(request: Request, identifier: str, language: str) -> Response:
    """The accelerations, L, H, momenta and multiplier as a program."""
    answer = await successful(request, identifier)
    endings = {**result_tasks.LANGUAGES, "latex": "tex", "client": "py", "curl": "sh", "embed": "html"}
    if answer is None or answer.value["kind"] != "solve" or language not in endings:
        return missing()
    text = await made(request, identifier, result_tasks.code_task, language, str(request.base_url).rstrip("/"))
    headers = kept(answer, language) | {"Content-Disposition": f'inline; filename="system.{endings[language]}"'}
    return Response(text, headers=headers, media_type="text/plain")


@router.get("/results/{identifier}/certificate.json")
async def certificate(request: Request, identifier: str) -> Response:
    """The certificates alone, as a file."""
    answer = await successful(request, identifier)
    if answer is None or answer.value["kind"] != "solve":
        return missing()
    text = await made(request, identifier, result_tasks.certificate_task)
    headers = {"Content-Disposition": f'attachment; filename="certificate-{identifier[:12]}.json"'}
    return Response(text, headers=headers | kept(answer, "certificate"), media_type="application/json")


async def _file(
    request: Request, identifier: str, media_type: str, what: str, task: Callable[..., bytes | None], *arguments: str,
    of_scene: bool = True,
) -> Response:  # fmt: skip
    """A file that a worker makes of a result; nothing is made for who has it already."""
    answer = await successful(request, identifier)
    if answer is None or (answer.value["kind"] == "solve") == of_scene:
        return missing()
    headers = kept(answer, what)
    if is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    data = await made(request, identifier, task, *arguments)
    if data is None:
        return missing()
    respond = packed if task is result_tasks.figure_data_task else Response
    return respond(data, headers=headers, media_type=media_type)


def kept(answer: Answer, what: str = "result") -> dict[str, str]:
    """Headers of what is made of a finished job: the browser keeps it and asks whether it is still that."""
    tag = answer.headers["etag"].strip('"')
    return {"ETag": f'"{tag}-{what}"', "Cache-Control": REVALIDATE}


async def made(request: Request, identifier: str, task: Callable[..., T], *arguments: Any) -> T:
    """What a worker makes of a stored result; raises Refusal where that takes too long."""
    engine: Engine = request.app.state.engine
    return await engine.made(client_of(request), task, engine.store.address, identifier, *arguments)


async def successful(request: Request, identifier: str) -> Answer | None:
    """The job without its result, where it has one."""
    answer = await finished(request, identifier, 0)
    return answer if answer is not None and answer.value["status"] == "successful" else None


async def finished(request: Request, identifier: str, patience: float) -> Answer | None:
    """The job without its result, waited for a moment; None where there is none."""
    if not IDENTIFIER.fullmatch(identifier):
        return None
    answer = await call(request, "GET", f"/v1/jobs/{identifier}", None, {"Prefer": MINIMAL})
    if answer.is_problem:
        return None
    if answer.value["status"] not in OPEN or not patience:
        return answer
    engine, viewer = request.app.state.engine, viewer_of(request)
    job, end = await engine.job(identifier, viewer), time.monotonic() + patience
    while job is not None and job.is_open and (left := end - time.monotonic()) > 0:
        if "so_far" in (engine.supervisor.events.latest(identifier) or {}) and time.time() - job.created > SOON:
            break
        job = await engine.wait(job, viewer, min(left, SOON / 2))
    return await finished(request, identifier, 0)


async def _stored(request: Request, identifier: str) -> Job | None:
    """The job with its document; None where there is none. Only forms of our own pages come here."""
    await read_form(request, SMALL_FORM)
    return await stored_job(request, identifier)


async def stored_job(request: Request, identifier: str) -> Job | None:
    """The job with its document, without its answer; None where there is none."""
    engine: Engine = request.app.state.engine
    is_id = IDENTIFIER.fullmatch(identifier) is not None
    return await engine.job(identifier, viewer_of(request)) if is_id else None


def result_address(answer: Answer) -> str:
    """The permanent link of a job's result."""
    location = answer.headers.get("location") or answer.headers.get("content-location") or ""
    identifier = location.rpartition("/")[2] or answer.value.get("id", "")
    return f"/results/{identifier}"


def missing() -> HTMLResponse:
    """There is no such job."""
    return page("missing.html", 404, active="", title="Nothing here", detail="There is no result at this address.")


def asked_of(document: Any) -> list[str]:
    """The formulas of a document, as they were sent, for who waits for the answer."""
    found: list[str] = []
    inner = [document] + [document.get(key) for key in ("system", "document")] if isinstance(document, dict) else []
    for part in (part for part in inner if isinstance(part, dict)):
        for key in ("name", "catalogue", "equations", "lagrangian", "constraints"):
            given = part.get(key)
            if isinstance(given, dict):
                found += [f"{name}'' = {text}" for name, text in given.items()]
            else:
                found += [str(line) for line in (given if isinstance(given, list) else [given]) if line]
    return found[:ASKED]


async def shown(request: Request, job: dict[str, Any], check: dict[str, Any] | None = None) -> HTMLResponse:
    """The page of a job by its status."""
    if job["status"] in OPEN and "so_far" in (job["progress"] or {}):
        engine: Engine = request.app.state.engine
        about = (job, _look(request), int(time.time() - job["created"]))
        told = await engine.run_quick(client_of(request), result_tasks.so_far_task, *about, seconds=LONG_DEADLINE)
        if told.status == "done":
            return cast(HTMLResponse, told.value)
    if job["status"] in OPEN:
        stored = await stored_job(request, job["id"])
        asked = asked_of(json.loads(stored.document)) if stored is not None else []
        return page("working.html", 200, active="", job=job, asked=asked, waited=int(time.time() - job["created"]))
    if job["status"] != "successful":
        problem = reading_back.problem_of(job["problem"], {}) if job["problem"] else None
        return page("ended.html", 200, active="", job=job, problem=problem)
    return await made(request, job["id"], result_tasks.page_task, job, _look(request), check)


def _look(request: Request) -> result_tasks.Look:
    settings = request.app.state.engine.settings
    return result_tasks.Look(VISITOR.get(), str(request.base_url).rstrip("/"), settings.time_limit)
