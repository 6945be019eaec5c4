"""Many systems at once: upload, progress, and the answers as a table."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service.reading import document_names
from inverse_service.service.documents import text_page
from inverse_service.service.jobs.batch import answer_line
from inverse_service.service.jobs.statements import BatchAnswer
from inverse_service.web import asking, clients, routes_jobs
from inverse_service.web.pages import own_calls, rendering, result_pages, sheets

router = APIRouter()
SHOWN_LINES = 300
LARGEST_SHOWN = 64 * 1024
EXAMPLE = """x'' = -x
x'' = -x - k*x'
x'' = -y'; y'' = -y
{"id": "disk", "equations": {"phi": "0", "theta": "0", "x": "-sin(phi)*phi'*theta'", "y": "cos(phi)*phi'*theta'"}}
x'' = kx
"""


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table; `verdict` is that of the result, or "failed"; without `lagrangian` there is a `reason`.

    The page shows `word`, in the color of `shade`.
    """

    number: int
    name: str
    verdict: str
    word: str
    shade: str
    lagrangian: str = ""
    reason: str = ""
    checked: str = ""
    where: str = ""


@router.get("/batch")
async def form() -> HTMLResponse:
    """The form with four lines in it."""
    return rendering.page("batch.html", active="/batch", typed=EXAMPLE, problem=None)


@router.post("/batch")
async def submit(request: Request) -> Response:
    """Store the batch; on to its page."""
    sent = await own_calls.read_form(request, asking.FACTORS["batch"] * request.app.state.engine.settings.max_body)
    upload = sent.files.get("file")
    body = upload.data if upload is not None else as_documents(sent.text("lines")).encode()
    is_array = body.lstrip()[:1] == b"["
    kind = "application/json" if is_array else "application/x-ndjson"
    answer = await own_calls.call(request, "POST", "/v1/batches", body, {"Content-Type": kind})
    if answer.is_problem:
        typed = sent.text("lines") or EXAMPLE
        return rendering.page("batch.html", answer.status, active="/batch", typed=typed, problem=answer.value["detail"])
    return RedirectResponse(f"/batch/{answer.value['id']}", 303)


def as_documents(text: str) -> str:
    """Lines of equations as documents, names that are not declared taken as constants; documents stay as they are."""
    if text.lstrip()[:1] in ("[", ""):
        return text
    lines = [line.strip() for line in text.split("\n") if line.strip()]
    plain = {"parameters": document_names.GUESS}
    documents = [line if line[0] == "{" else json.dumps({"id": line[:80], "equations": line} | plain) for line in lines]
    return "\n".join(documents)


@router.get("/batch/{identifier}/results.csv")
async def as_table(request: Request, identifier: str) -> Response:
    """What is answered as CSV: line, name, verdict, L or the reason, and what the checker said."""
    answers = await _answers(request, identifier, routes_jobs.engine_of(request).settings.max_lines)
    if answers is None:
        return result_pages.missing()
    return Response(await routes_jobs.engine_of(request).in_thread(_csv, answers), media_type="text/csv")


def _csv(answers: list[BatchAnswer]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(("line", "name", "verdict", "lagrangian or reason", "checked", "where"))
    for row in sorted(map(row_of, answers), key=lambda row: row.number):
        # A leading sign makes a formula of a cell in a spreadsheet.
        cells = (row.name, row.verdict, row.lagrangian or row.reason, row.checked, row.where)
        writer.writerow((row.number, *(f"'{cell}" if cell[:1] in ("=", "+", "-", "@") else cell for cell in cells)))
    return text.getvalue()


@router.get("/batch/{identifier}")
async def batch(request: Request, identifier: str) -> HTMLResponse:
    """The batch, as far as it is."""
    values = await _values(request, identifier)
    return result_pages.missing() if values is None else rendering.page("batch_result.html", active="/batch", **values)


@router.get("/batch/{identifier}/table")
async def table(request: Request, identifier: str) -> HTMLResponse:
    """Progress and table alone, for the script."""
    values = await _values(request, identifier)
    return result_pages.missing() if values is None else rendering.page("batch_table.html", **values)


@router.post("/batch/{identifier}/cancel")
async def cancel(request: Request, identifier: str) -> Response:
    """Stop what is still open."""
    await own_calls.read_form(request, own_calls.SMALL_FORM)
    if result_pages.IDENTIFIER.fullmatch(identifier):
        await own_calls.call(request, "DELETE", f"/v1/batches/{identifier}")
    return RedirectResponse(f"/batch/{identifier}", 303)


@router.get("/batch/{identifier}/lines/{number}")
async def line(request: Request, identifier: str, number: int) -> Response:
    """The page of one line's result."""
    for answer in await _answers(request, identifier) or []:
        if answer.number == number and answer.status == "successful":
            return RedirectResponse(f"/results/{answer.job}", 303)
    return result_pages.missing()


async def _values(request: Request, identifier: str) -> dict[str, Any] | None:
    if not result_pages.IDENTIFIER.fullmatch(identifier):
        return None
    found = await own_calls.call(request, "GET", f"/v1/batches/{identifier}")
    if found.is_problem:
        return None
    counts = found.value["counts"]
    answers = await _answers(request, identifier) or []
    rows = await routes_jobs.engine_of(request).read(lambda: sorted(map(row_of, answers), key=lambda row: row.number))
    is_open = bool(counts.get("accepted", 0) + counts.get("running", 0))
    done = found.value["total"] - counts.get("accepted", 0) - counts.get("running", 0)
    return {"batch": found.value, "rows": rows[:SHOWN_LINES], "is_open": is_open, "done": done, "all_rows": len(rows)}


async def _answers(request: Request, identifier: str, most: int = SHOWN_LINES + 1) -> list[BatchAnswer] | None:
    """The answers that are there now; the call under /v1 would wait for all. None where there is no such batch."""
    engine = routes_jobs.engine_of(request)
    if (
        not result_pages.IDENTIFIER.fullmatch(identifier)
        or await engine.batch(identifier, clients.viewer_of(request)) is None
    ):
        return None
    return await engine.in_thread(engine.store.batch_answers, identifier, 0, most, LARGEST_SHOWN)


def row_of(answer: BatchAnswer) -> Row:
    """An answer as a line of the table; a large one is not read for it."""
    if answer.status == "successful" and answer.body is None:
        return Row(answer.number, str(json.loads(answer.identifier)), "done", "done", "")
    found = json.loads(answer_line(answer))
    name = "\u2013" if found["id"] is None else str(found["id"])
    if "error" in found:
        return Row(answer.number, name, "failed", "failed", sheets.NO, reason=found["detail"])
    first = text_page.first_answer(found)
    lagrangian = (first.get("lagrangian") or {}).get("text", "")
    where = ", ".join(text_page.conditions_of(first))
    others = len(found.get("branches") or ()) - 1
    where += f"; {others} more {'case' if others == 1 else 'cases'}" if others > 0 else ""
    verdict = text_page.common_verdict(text_page.branches_of(found)) or "done"  # results of other kinds have none
    word, shade = (sheets.badge_of(found), sheets.verdict_of(found)) if "verdict" in found else ("done", "")
    checked = sheets.proof_of(first) or ""
    return Row(answer.number, name, verdict, word, shade, lagrangian, found.get("reason", ""), checked, where)
