"""Exercises: a page for teachers that makes a link, a page for students that judges an answer, and
codes to verify.

An exercise is its address: equations, title, what is asked. Nothing is stored. A solved one gives a
code, which is a digest of the exercise, the student's name and the day, keyed by a secret of the
store: only services over this store make and verify it.
"""

import hashlib
import hmac
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from typing import Any
from urllib.parse import parse_qsl, urlencode

from fastapi import APIRouter
from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service import errors
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import collecting, tree as ex
from inverse_service.reading import reader
from inverse_service.service.documents import sheets, stated
from inverse_service.service.jobs import model, tasks
from inverse_service.web import clients
from inverse_service.web.engine import Engine
from inverse_service.web.pages import (
    WORDS,
    forms,
    preview,
    rendering,
    result_tasks,
    solve,
    typesetting,
)

router = APIRouter()
ASKED: dict[str, tuple[str, str, str]] = WORDS["exercises"]
FRICTION = "A Lagrangian with friction"  # the title of the example
LATE = "Judging this takes longer than a page may. Try a shorter formula."


@dataclass(frozen=True, slots=True)
class Exercise:
    """The page of a student: the equations, hints in steps, the motion, and the judgment of an
    answer with the equations that it does not give.
    """

    equations: list[Markup]
    constants: Markup | str
    hints: list[Markup] = field(default_factory=list)
    motion: preview.Shown | None = None
    judged: result_tasks.Judged | None = None
    wanted: list[Markup] = field(default_factory=list)
    problem: str = ""


def exercise_task(fields: Mapping[str, str], ask: str, answer: str, own: str) -> Exercise:
    """The exercise of a link with the judgment of an answer: "none", or "one" with a formula."""
    try:
        document = model.split_options(forms.document_of_fields(fields))[0]
        result = tasks.solve_task(document, SolveOptions(time_limit=result_tasks.GLANCE))
    except errors.InputError as error:
        return Exercise(
            [], "", problem=forms.sentence(error.places[0]) if error.places else str(error)
        )
    system, names = result["system"], stated.names_of(result["system"])
    sheet = sheets.sheet_of(result, length="brief")
    judged = None
    if answer in ("none", "exists"):
        judged = _judged_existence(sheets.verdict_of(result), answer)
    elif answer == "one" and own.strip():
        judged = judged_of(document, own, ask, names)
    wanted = [
        typesetting.formula(f"{name}'' = {text}", names)
        for name, text in system["equations"].items()
        if judged is None or not _is_same(judged.given.get(name), text, names)
    ]
    return Exercise(
        [typesetting.said(formula) for formula in sheet.asked],
        Markup(", ").join(map(typesetting.said, sheet.about)),
        hints_of(result, names),
        preview.motion_of_result(result, reveals=False),
        judged,
        wanted,
    )


def _is_same(given: str | None, text: str, names: Any) -> bool:
    """Whether two formulas are seen to be equal, as polynomials in their atoms."""
    if given is None:
        return False
    try:
        left, right = (reader.read_formula(one, names) for one in (given, text))
    except errors.InputError:  # names of the student's own
        return False
    return collecting.collect(ex.subtract(left, right)) == ex.ZERO


def _judged_existence(verdict: str, answer: str) -> result_tasks.Judged:
    """The judgment of "none" or "exists"."""
    if verdict not in (sheets.YES, sheets.NO):
        return result_tasks.Judged("", sheets.OPEN, WORDS["own"]["incomplete"][1])
    is_right = (verdict == sheets.YES) == (answer == "exists")
    said = f"{'Right' if is_right else 'Not yet'}. There is {'one' if verdict == sheets.YES else 'none'}."
    return result_tasks.Judged("", sheets.YES if is_right else sheets.NO, said)


def judged_of(document: Mapping[str, Any], own: str, ask: str, names: Any) -> result_tasks.Judged:
    """The checker's verdict on a student's L, or on the L that belongs to a student's H."""
    means = partial(lagrangian_of, names=names) if ask == "hamiltonian" else forms.right_side
    letter = "H" if ask == "hamiltonian" else "L"
    return replace(
        result_tasks.judged_of(result_tasks.check_of(document, own, means), names, letter),
        lagrangian=own,
    )


def lagrangian_of(hamiltonian: str, names: Any) -> str:
    """L(t, q, v) of an H(t, q, p_q): the Legendre transform of H in p, with v for its momenta.

    InputError where H cannot be read or has no transform in closed form.
    """
    from inverse_service.expressions.printing import to_text

    text = forms.right_side(hamiltonian.replace("H =", "L =").replace("H=", "L="))
    tree = reader.read_formula(text, names)
    momenta = {ex.Symbol(f"p_{name}"): ex.Velocity(name) for name in names.coordinates}
    if ex.has(tree, ex.Velocity):
        raise errors.InputError("A Hamiltonian has momenta such as p_x, and no velocities.")
    document = {
        "coordinates": list(names.coordinates),
        "parameters": [
            name
            for name in names.parameters
            if not name.startswith(("p_", "g_", "h_")) and name not in "LH"
        ],
        "lagrangian": to_text(ex.substitute(tree, momenta)),
    }
    found = tasks.solve_task(document, SolveOptions(time_limit=result_tasks.GLANCE))["hamiltonian"]
    if found.get("implicit"):
        raise errors.InputError(
            "The velocities of this H could not be solved for the momenta in closed form."
        )
    back = reader.read_formula(found["text"], names)
    return to_text(ex.substitute(back, momenta))


def hints_of(result: Mapping[str, Any], names: Any) -> list[Markup]:
    """Three steps on the way; none says whether there is an answer, or which."""
    one = len(result["system"]["coordinates"]) == 1
    first = Markup("Write {} for an L of your own, and put in the equations.").format(
        typesetting.proposition("d/dt dL/dv - dL/dq", names)
    )
    second = Markup(
        "Look for {} first. It has to satisfy {}, where Γ is the derivative along the motion."
    ).format(
        typesetting.of_theory("g_ij = d^2 L/dv^i dv^j"),
        typesetting.of_theory(
            "Gamma(g) + g df/dv = 0" if one else "Gamma(g) = g N + (g N)^T, g Phi = (g Phi)^T"
        ),
    )
    conditions = result.get("conditions") or {}
    if one:
        text = next(iter(result["system"]["equations"].values()))
        third = Markup(
            "Here f = {}. Try a g that depends on the time alone before you try others."
        ).format(typesetting.formula(text, names))
    elif conditions.get("Phi"):
        third = Markup("Here Φ = {}. Which symmetric g make g Φ symmetric, too?").format(
            typesetting.said(sheets.shown_matrix("", conditions["Phi"], names))
        )
    else:
        third = Markup("Which symmetric g make g Φ symmetric, too?")
    return [first, second, third]


@router.get("/exercise")
async def exercise(request: Request) -> Response:
    """The page of a student, with the judgment of an answer in the address."""
    query = request.query_params
    fields = forms.fields_of_link(query)
    if fields is None:
        return RedirectResponse("/teach", 303)
    fields |= {"lagrangian": "", "constraints": "", "kind": "equations"}
    ask = query.get("ask", "lagrangian") if query.get("ask") in ASKED else "lagrangian"
    engine: Engine = request.app.state.engine
    answer, own = query.get("answer", ""), query.get("own", "")[:6_000]
    found = await engine.made(
        clients.client_of(request),
        exercise_task,
        fields,
        ask,
        answer,
        own,
        late=LATE,
        seconds=4 * result_tasks.GLANCE,
    )
    student = query.get("student", "").strip()[:80]
    code = ""
    if found.judged is not None and found.judged.verdict == sheets.YES and student:
        today = datetime.now(UTC).date().isoformat()
        code = code_of(await secret_of(request), address_of(query), student, today)
    shown = rendering.page(
        "exercise.html", active="", exercise=found, title=query.get("title", "")[:120],
        question=ASKED[ask][1], letter=ASKED[ask][2], answer=answer, own=own, student=student, code=code,
        hints=query.get("hints", "yes") != "no", kept=dict(parse_qsl(address_of(query))),
    )  # fmt: skip
    return rendering.framed(shown, engine.settings.frame_origins)


def address_of(query: Mapping[str, str]) -> str:
    """The address of the exercise without an answer, always in one order."""
    wanted = (*forms.LINKED, "title", "ask", "hints")
    return urlencode({name: query[name] for name in wanted if query.get(name)})


async def secret_of(request: Request) -> bytes:
    """What only services over this store know."""
    engine: Engine = request.app.state.engine
    return str(await engine.in_thread(engine.store.secret)).encode()


def code_of(secret: bytes, question: str, student: str, day: str) -> str:
    """The day and twelve characters that only this service can make for an exercise and a name."""
    digest = hmac.new(secret, f"{question}\n{student}\n{day}".encode(), hashlib.sha256).hexdigest()
    return f"{day}-{digest[:12]}"


def is_genuine(secret: bytes, question: str, student: str, code: str) -> bool:
    """Whether the code is that of this exercise and name, on the day that it names."""
    wanted = code_of(secret, question, student, code[: len("2026-01-01")])
    return hmac.compare_digest(code.encode(), wanted.encode())


@router.get("/exercise/new")
async def make(request: Request) -> HTMLResponse:
    """The page of a teacher: the question, the link, the code to embed."""
    query = request.query_params
    fields = (
        await solve.fields_of_job(request, query["job"])
        if query.get("job")
        else forms.fields_of_link(query)
    )
    fields = fields or forms.fields_from({"equations": "x'' = -x - c*x'"})
    chosen = {name: query.get(name, "") for name in ("title", "ask", "hints")}
    kept = {name: value for name, value in fields.items() if value and name in forms.LINKED}
    link = f"{str(request.base_url).rstrip('/')}/exercise?{address_of({**kept, **chosen})}"
    return rendering.page(
        "exercise_new.html", active="/teach", fields=kept, chosen=chosen, asked=ASKED, link=link,
        frame=rendering.frame_code(link, chosen["title"] or "Exercise", "100%", 720),
    )  # fmt: skip


@router.get("/teach")
async def teach(request: Request) -> HTMLResponse:
    """How exercises are made and embedded, and the check of a code."""
    query, verdict = request.query_params, ""
    link, student, code = (query.get(name, "").strip() for name in ("link", "student", "code"))
    if link and code:
        asked = address_of(dict(parse_qsl(link.partition("?")[2])))
        verdict = "yes" if is_genuine(await secret_of(request), asked, student, code) else "no"
    sent = {"link": link, "student": student, "code": code}
    example = urlencode({"equations": "x'' = -x - c*x'", "title": FRICTION})
    frame = rendering.frame_code(
        f"{str(request.base_url).rstrip('/')}/exercise?{example}", FRICTION, "100%", 720
    )
    return rendering.page("teach.html", active="/teach", sent=sent, verdict=verdict, frame=frame)
