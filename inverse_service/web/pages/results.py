"""A job's page under one permanent address, its files, and batches; asked of the engine as the
calls under /v1 ask it.

Forms that browsers send are taken from our own pages only, and read by workers where they may be
large.
"""

import json
import time
from collections.abc import Callable, Container, Mapping
from operator import itemgetter
from typing import Any, TypeVar, cast

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service.reading import declarations
from inverse_service.service.documents import answer_rows, sheets, stated
from inverse_service.service.jobs import model, tasks
from inverse_service.service.jobs.batch import answer_line
from inverse_service.service.scenes import views
from inverse_service.web import asking, clients, job_answers, problems, routes
from inverse_service.web.engine import LONG_DEADLINE, QUICK_DEADLINE, Engine
from inverse_service.web.pages import forms, result_tasks, simulations
from inverse_service.web.pages.rendering import POLICY, VISITOR, csv_of, framed, packed, page, sent

T = TypeVar("T")
router = APIRouter()
# A form of a key, a button or a color is small: it is read here, not in a worker.
SMALL_FORM = 10_000
# A short job's result comes with its first page; a longer one's page shows its progress.
PATIENCE = 1.5
# A verdict confirmed by then is shown while the search continues; what is known without one later.
SOON, LATER = 0.2, 0.8
ASKED = 20  # lines of a question
MOST_DIGITS = 5
RESULT = "result at this address."
Made = tuple[str, str, Callable[..., Any], tuple[str, ...]]
SHOWN_LINES = 300
LARGEST_SHOWN = 64 * 1024
EXAMPLE = """x'' = -x
x'' = -x - k*x'
x'' = -y'; y'' = -y
{"id": "disk", "equations": {"phi": "0", "theta": "0", "x": "-sin(phi)*phi'*theta'", "y": "cos(phi)*phi'*theta'"}}
x'' = kx
"""


async def ask(request: Request, kind: str, document: Any, fresh: bool = False) -> model.Job:
    """The stored job of a question; raises what the call under /v1 answers with a problem."""
    engine, body = routes.engine_of(request), json.dumps(document, default=str).encode()
    asking.refuse_longer(len(body), asking.FACTORS[kind] * engine.settings.max_body)
    terms = tasks.Terms(kind, engine.server_options, client=clients.client_of(request), fresh=fresh)
    job = await engine.ask(await engine.question(body, terms), clients.viewer_of(request))
    if job.status == "failed":  # before this answer
        raise await _refusal_of(job, engine)
    return job


async def _refusal_of(job: model.Job, engine: Engine) -> problems.Refusal:
    return forms.stored_refusal(json.loads(await job_answers.problem_of(job, engine)))


async def read_form(request: Request, limit: int | None = None) -> forms.Form:
    """The sent form; refuses one of another site (403), too large (413), not written by a browser (400)."""
    return await read_sent(request, forms.form_of, limit=limit)


async def read_sent(
    request: Request,
    task: Callable[[bytes, str], T],
    seconds: float = QUICK_DEADLINE,
    limit: int | None = None,
    **late: str,
) -> T:
    """What a task makes of the sent form, in a worker where it may be large; refuses as `read_form`
    does, and with `late` where it takes too long."""
    if not clients.is_of_own_page(request):
        raise problems.Refusal(
            403, "cross-site", "Forms are taken from the pages of this service only."
        )
    engine: Engine = request.app.state.engine
    limit, content_type = limit or engine.settings.max_body, request.headers.get("content-type", "")
    async with asking.body_of(request, limit, None) as body:
        if limit <= SMALL_FORM:
            return task(body, content_type)
        return await engine.read_body(
            clients.client_of(request), task, body, content_type, seconds=seconds, **late
        )


async def quick(
    request: Request, task: Callable[..., Any], *arguments: Any, seconds: float = LONG_DEADLINE
) -> tasks.Outcome:
    """The outcome of a task of the quick processes for who asks."""
    engine: Engine = request.app.state.engine
    return await engine.run_quick(clients.client_of(request), task, *arguments, seconds=seconds)


# A job.


@router.get("/results/{identifier}")
async def result(request: Request, identifier: str) -> Response:
    """The result, or how far it is; with `lagrangian` a visitor's own L judged."""
    job, own, judged = (
        await finished(request, identifier, PATIENCE),
        request.query_params.get("lagrangian"),
        None,
    )
    if own and job.status == "successful" and job.kind == "solve":
        judged = await made(request, identifier, result_tasks.own_lagrangian_task, own)
    return await shown(request, job, judged)


@router.get("/results/{identifier}/embed")
async def embedded(request: Request, identifier: str) -> Response:
    """Verdict, equations and L alone: what this service and INVERSE_SERVICE_FRAME_ORIGINS show in frames."""
    await successful(request, identifier, ("solve",))
    found = await made(request, identifier, result_tasks.embed_task, VISITOR.get())
    return framed(found, request.app.state.engine.settings.frame_origins)


@router.get("/results/{identifier}/family")
async def family(request: Request, identifier: str) -> Response:
    """Which members of a family have a Lagrangian, with a map of two constants, or how far it is."""
    job = await finished(request, identifier, PATIENCE)
    if job.status != "successful":
        return await shown(request, job)
    await successful(request, identifier, ("solve",))
    look, query = look_of(request), dict(request.query_params)
    return problems.known(
        await made(request, identifier, result_tasks.map_task, look, query), RESULT
    )


@router.get("/results/{identifier}/where")
async def where(request: Request, identifier: str) -> Response:
    """A part of a page: the answer where the L of a set of members is none."""
    await successful(request, identifier, ("solve",))
    place = [request.query_params.get(name, "") for name in ("leaf", "k")]
    known = all(one.isdecimal() and len(one) < MOST_DIGITS for one in place)
    task, numbers = result_tasks.special_task, [int(one) for one in place if known]
    found = problems.known(
        await made(request, identifier, task, *numbers) if known else None, RESULT
    )
    return sent(found, "text/html", {"Content-Security-Policy": POLICY})


@router.get("/results/{identifier}/result.json")
async def result_json(request: Request, identifier: str) -> Response:
    """The result document as a file."""
    attached = f'attachment; filename="result-{identifier[:12]}.json"'
    headers = {"Content-Disposition": attached} | kept(await successful(request, identifier))
    if job_answers.is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    return await job_answers.stored_response(request.app.state.engine, identifier, headers)


@router.post("/results/{identifier}/again")
@router.post("/results/{identifier}/longer")
@router.post("/results/{identifier}/members")
async def again(request: Request, identifier: str) -> Response:
    """The same question asked again: of work that was cancelled or failed, with all the time the
    service gives, or for all members of its family."""
    await read_form(request, SMALL_FORM)
    job, what = await finished(request, identifier), request.url.path.rpartition("/")[2]
    document, options = json.loads(job.document), json.loads(job.options) if what == "again" else {}
    document |= {"options": options} if options else {}
    document |= {"family": True} if what == "members" else {}
    try:
        asked = await ask(request, job.kind, document, fresh=bool(options))
    except problems.REFUSED as error:
        refusal = problems.refusal_of(request, error)
        return page(
            "missing.html",
            refusal.status,
            active="",
            title="Not asked again",
            detail=refusal.detail,
        )
    return RedirectResponse(f"/results/{asked.id}", 303)


@router.post("/results/{identifier}/cancel")
async def cancel(request: Request, identifier: str) -> Response:
    """Stop the work."""
    await read_form(request, SMALL_FORM)
    await routes.engine_of(request).dismiss(identifier, clients.viewer_of(request))
    return RedirectResponse(f"/results/{identifier}", 303)


@router.get("/results/{identifier}/{file:path}")
async def made_file(request: Request, identifier: str, file: str) -> Response:
    """A file that a worker makes of a result; nothing is made if the browser has it already."""
    job = await successful(request, identifier)
    found = problems.known(_file_of(job.kind, file, identifier, _address(request)), RESULT)
    media_type, disposition, task, arguments = found
    headers = kept(job, file.rpartition(".")[2].rpartition("/")[2])
    if job_answers.is_known(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    data = problems.known(await made(request, identifier, task, *arguments), RESULT)
    headers |= {"Content-Disposition": disposition} if disposition else {}
    respond = packed if task is result_tasks.figure_data_task else Response
    return respond(data, headers=headers, media_type=media_type)


def _file_of(kind: str, file: str, identifier: str, address: str) -> Made | None:
    """Media type, disposition, task and its arguments of a file; None if a job of this kind has no such file."""
    path, _, ending = file.rpartition(".")
    match kind == "solve", *(path or file).split("/"):
        case _, "table" if ending == "csv":
            return "text/csv", "", result_tasks.table_task, ()
        case True, "certificate" if ending == "json":
            attached = f'attachment; filename="certificate-{identifier[:12]}.json"'
            return "application/json", attached, result_tasks.certificate_task, ()
        case True, "picture" if ending in simulations.PICTURES:
            return simulations.PICTURES[ending], "", result_tasks.answer_picture_task, (ending,)
        case True, "code", language if not path and language in result_tasks.EXPORTS:
            inline = f'inline; filename="system.{result_tasks.EXPORTS[language][1]}"'
            return "text/plain", inline, result_tasks.code_task, (language, address)
        case False, "figures" if ending == "json":
            return "application/json", "", result_tasks.figure_data_task, ()
        case False, "figures", name if name in views.NAMES and ending in simulations.PICTURES:
            return simulations.PICTURES[ending], "", result_tasks.picture_task, (name, ending)
        case False, "data", *label if label and ending in simulations.TABLES:
            return (
                simulations.TABLES[ending],
                "",
                result_tasks.file_task,
                ("/".join(map(str, label)), ending),
            )
    return None


def kept(job: model.Job, what: str = "result") -> dict[str, str]:
    """Headers of what is made of a finished job: the browser keeps it and asks whether it is still that."""
    return {
        "ETag": f'{job_answers.etag(job)[:-1]}-{what}"',
        "Cache-Control": job_answers.REVALIDATE,
    }


async def made(request: Request, identifier: str, task: Callable[..., T], *arguments: Any) -> T:
    """What a worker makes of a stored result; raises Refusal where that takes too long."""
    engine: Engine = request.app.state.engine
    return await engine.made(
        clients.client_of(request), task, engine.store.address, identifier, *arguments
    )


async def successful(
    request: Request, identifier: str, kinds: Container[str] = tasks.KINDS
) -> model.Job:
    """The job; refused with 404 unless it is successful, and of one of the kinds."""
    job = await finished(request, identifier)
    return problems.known(job if job.status == "successful" and job.kind in kinds else None, RESULT)


async def finished(request: Request, identifier: str, patience: float = 0.0) -> model.Job:
    """The job with its document, after a short wait; refused with 404 if there is no such job."""
    engine, viewer, end = (
        routes.engine_of(request),
        clients.viewer_of(request),
        time.monotonic() + patience,
    )
    job = problems.known(await engine.job(identifier, viewer), RESULT)
    while job.is_open and (left := end - time.monotonic()) > 0:
        so_far = (engine.supervisor.events.latest(identifier) or {}).get("so_far")
        waited = time.time() - job.created
        if so_far and waited > (SOON if _is_decided(so_far) else LATER):
            break
        job = await engine.wait(job, viewer, min(left, SOON / 2))
    return job


def _is_decided(so_far: Mapping[str, Any]) -> bool:
    """Whether a part of a result says yes or no, for all that was asked."""
    if result_tasks.has_border(so_far):
        return False
    parts = (so_far, so_far.get("any_associated") or {})
    verdicts = (one.get(key) for one in parts for key in ("verdict", "verdict_with_time"))
    return any(one in ("variational", "not_variational") for one in verdicts)


def asked_of(document: Any) -> list[str]:
    """The formulas of a document as sent, to show while the answer is computed."""
    found: list[str] = []
    inner = (
        [document] + [document.get(key) for key in ("system", "document")]
        if isinstance(document, dict)
        else []
    )
    for part in (part for part in inner if isinstance(part, dict)):
        texts = [
            part.get(key) or ""
            for key in ("name", "catalogue", "equations", "lagrangian", "constraints")
        ]
        if (
            str(texts[1]).replace("-", " ") in found
        ):  # a scene is named after its entry of the catalogue
            texts[1] = ""
        found += [line for text in texts for line in forms.equations_text(text).split("\n") if line]
    return found[:ASKED]


async def shown(
    request: Request, job: model.Job, check: dict[str, Any] | None = None
) -> HTMLResponse:
    """The page of a job by its status."""
    engine = routes.engine_of(request)
    fields, waited = (
        await engine.read(job_answers.job_fields, job, engine),
        int(time.time() - job.created),
    )
    if job.is_open and "so_far" in (fields["progress"] or {}):
        told = await quick(request, result_tasks.so_far_task, fields, look_of(request), waited)
        if told.status == "done":
            return cast(HTMLResponse, told.value)
    if job.is_open:
        asked = asked_of(json.loads(job.document))
        return page("working.html", 200, active="", job=fields, asked=asked, waited=waited)
    if job.status != "successful":
        problem = (
            forms.problem_of(await _refusal_of(job, engine), {}) if job.status == "failed" else None
        )
        return page("ended.html", 200, active="", job=fields, problem=problem)
    return await made(request, job.id, result_tasks.page_task, fields, look_of(request), check)


def look_of(request: Request) -> result_tasks.Look:
    """What the pages of results depend on besides them."""
    return result_tasks.Look(
        VISITOR.get(), _address(request), request.app.state.engine.settings.time_limit
    )


def _address(request: Request) -> str:
    return str(request.base_url).rstrip("/")


# Many systems at once: upload, progress, and the answers as a table.


@router.get("/batch")
async def form() -> HTMLResponse:
    """The form with four lines in it."""
    return page("batch.html", active="/batch", typed=EXAMPLE, problem=None)


@router.post("/batch")
async def submit(request: Request) -> Response:
    """Store the batch; on to its page."""
    sent = await read_form(
        request, asking.FACTORS["batch"] * request.app.state.engine.settings.max_body
    )
    upload = sent.files.get("file")
    body = upload.data if upload is not None else as_documents(sent.text("lines")).encode()
    engine, client = routes.engine_of(request), clients.client_of(request)
    terms = tasks.Terms(
        "solve", engine.server_options, client=client, most=engine.settings.max_lines
    )
    try:
        stored = await engine.ask_batch(
            body, body.lstrip()[:1] == b"[", terms, clients.viewer_of(request)
        )
    except problems.REFUSED as error:
        refusal, typed = problems.refusal_of(request, error), sent.text("lines") or EXAMPLE
        return page(
            "batch.html", refusal.status, active="/batch", typed=typed, problem=refusal.detail
        )
    return RedirectResponse(f"/batch/{stored.id}", 303)


def as_documents(text: str) -> str:
    """Lines of equations as documents, with undeclared names as constants; documents stay unchanged."""
    if text.lstrip()[:1] in ("[", ""):
        return text
    lines = [line.strip() for line in text.split("\n") if line.strip()]
    plain = {"parameters": declarations.GUESS}
    documents = [
        line if line[0] == "{" else json.dumps({"id": line[:80], "equations": line} | plain)
        for line in lines
    ]
    return "\n".join(documents)


@router.get("/batch/{identifier}/results.csv")
async def as_table(request: Request, identifier: str) -> Response:
    """What is answered as CSV: line, name, verdict, L or the reason, and what the checker said."""
    answers = await _answers(request, identifier, routes.engine_of(request).settings.max_lines)
    return Response(await routes.engine_of(request).in_thread(_csv, answers), media_type="text/csv")


def _csv(answers: list[model.BatchAnswer]) -> str:
    heads = ("line", "name", "verdict", "lagrangian or reason", "checked", "where")
    rows = [
        row | {"line": row["number"], heads[3]: row["lagrangian"] or row["reason"]}
        for row in _rows(answers)
    ]
    return csv_of([heads, *([row[head] for head in heads] for row in rows)])


def _rows(answers: list[model.BatchAnswer]) -> list[dict[str, Any]]:
    return sorted(map(row_of, answers), key=itemgetter("number"))


@router.get("/batch/{identifier}")
async def batch(request: Request, identifier: str) -> HTMLResponse:
    """The page of a batch with the answers so far."""
    engine = routes.engine_of(request)
    rows = await engine.read(_rows, await _answers(request, identifier))
    told = problems.known(await engine.batch(identifier, clients.viewer_of(request)), RESULT)
    still = told.counts.get("accepted", 0) + told.counts.get("running", 0)
    return page(
        "batch_result.html", active="/batch", batch=told, rows=rows[:SHOWN_LINES], all_rows=len(rows),
        is_open=still > 0, done=told.total - still,
    )  # fmt: skip


@router.post("/batch/{identifier}/cancel")
async def cancel_batch(request: Request, identifier: str) -> Response:
    """Cancel the open lines."""
    await read_form(request, SMALL_FORM)
    await routes.engine_of(request).dismiss_batch(identifier, clients.viewer_of(request))
    return RedirectResponse(f"/batch/{identifier}", 303)


@router.get("/batch/{identifier}/lines/{number}")
async def line(request: Request, identifier: str, number: int) -> Response:
    """The page of one line's result."""
    lines = {
        one.number: one for one in await _answers(request, identifier) if one.status == "successful"
    }
    return RedirectResponse(f"/results/{problems.known(lines.get(number), RESULT).job}", 303)


async def _answers(
    request: Request, identifier: str, most: int = SHOWN_LINES + 1
) -> list[model.BatchAnswer]:
    """The answers that are there now; the call under /v1 would wait for all."""
    engine, viewer = routes.engine_of(request), clients.viewer_of(request)
    problems.known(await engine.batch(identifier, viewer), RESULT)
    return await engine.in_thread(engine.store.batch_answers, identifier, 0, most, LARGEST_SHOWN)


def row_of(answer: model.BatchAnswer) -> dict[str, Any]:
    """An answer as a line of the table: a `word` in the color of `shade`, and L or a `reason`.

    `verdict` is that of the result, or "failed"; a large answer is not read for it.
    """
    row: dict[str, Any] = dict.fromkeys(("lagrangian", "reason", "checked", "where", "shade"), "")
    row |= {"number": answer.number, "name": "\u2013", "verdict": "done", "word": "done"}
    if answer.status == "successful" and answer.body is None:
        return row | {"name": str(json.loads(answer.identifier))}
    found = json.loads(answer_line(answer))
    row |= {} if found["id"] is None else {"name": str(found["id"])}
    if "error" in found:
        return row | {
            "verdict": "failed",
            "word": "failed",
            "shade": sheets.NO,
            "reason": found["detail"],
        }
    known = answer_rows.first_row(found)
    others, sets = (known["cells"] or 1) - 1, [known["domain"], known["L_where"]]
    where = ", ".join(dict.fromkeys(filter(None, sets)))
    where += f"; {others} more {'case' if others == 1 else 'cases'}" if others > 0 else ""
    if "verdict" in found:  # results of other kinds have none
        row |= {
            "word": sheets.badge_of(found),
            "shade": sheets.verdict_of(found),
            "verdict": known["verdict"] or "done",
        }
    row |= {"lagrangian": known["L"] or "", "reason": known["open"] or "", "where": where}
    return row | {"checked": sheets.proof_of(stated.first_answer(found)) or ""}
