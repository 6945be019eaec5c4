"""An exercise judges answers as books do, gives nothing away, and its codes belong to one student."""

from __future__ import annotations

import asyncio
import html
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlencode

import pytest
from starlette.requests import Request

from inverse_service import errors
from inverse_service.expressions import collecting, tree as ex
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import sheets
from inverse_service.web.pages import exercises, forms

SPRING = "x'' = -x"
DAMPED = "x'' = -x - c*x'"
NO = "x'' = -y; y'' = -x + x'*y'"
SECRET = b"of the store"


def judged(equations: str, answer: str, own: str = "", ask: str = "lagrangian") -> Any:
    fields = forms.fields_from({"equations": equations})
    return exercises.exercise_task(fields, ask, answer, own)


@pytest.mark.parametrize(
    ("equations", "own", "ask", "verdict"),
    [
        (SPRING, "x'^2/2 - x^2/2", "lagrangian", sheets.YES),
        (SPRING, "L = 3*x'^2 - 3*x^2 + x*x'", "lagrangian", sheets.YES),  # a multiple, and d/dt
        (SPRING, "x'^2/2 + x^2/2", "lagrangian", sheets.NO),
        (SPRING, "p_x^2/2 + x^2/2", "hamiltonian", sheets.YES),
        (SPRING, "H = p_x^2/2 - x^2/2", "hamiltonian", sheets.NO),
        (DAMPED, "exp(c*t)*(x'^2 - x^2)/2", "lagrangian", sheets.YES),  # Caldirola, Kanai
        (DAMPED, "x'^2/2 - x^2/2", "lagrangian", sheets.NO),
        (DAMPED, "exp(-c*t)*p_x^2/2 + exp(c*t)*x^2/2", "hamiltonian", sheets.YES),
    ],
)
def test_an_answer_is_judged_as_in_books(equations: str, own: str, ask: str, verdict: str) -> None:
    found = judged(equations, "one", own, ask)
    assert found.judged.verdict == verdict
    assert found.judged.lagrangian == own


def test_of_a_wrong_answer_the_equations_that_it_does_not_give_are_shown() -> None:
    own = "(x'^2 + y'^2)/2 - x^2/2 + y^2/2"  # y'' = y
    found = judged("x'' = -x; y'' = -y", "one", own)
    assert found.judged.verdict == sheets.NO
    assert len(found.equations) == 2
    (left,) = found.wanted
    assert "<mi>y</mi>" in left
    assert "<mi>x</mi>" not in left


@pytest.mark.parametrize(
    ("equations", "answer", "verdict"),
    [
        (SPRING, "exists", sheets.YES), (SPRING, "none", sheets.NO),
        (NO, "none", sheets.YES), (NO, "exists", sheets.NO),
    ],
)  # fmt: skip
def test_whether_there_is_one_is_judged_by_the_verdict(
    equations: str, answer: str, verdict: str
) -> None:
    found = judged(equations, answer)
    assert found.judged.verdict == verdict
    is_one = equations == SPRING
    assert found.judged.headline.endswith(f"There is {'one' if is_one else 'none'}.")
    assert found.judged.headline.startswith("Right" if verdict == sheets.YES else "Not yet")


def test_what_is_open_is_judged_neither_right_nor_wrong() -> None:
    for answer in ("none", "exists"):
        assert exercises._judged_existence(sheets.OPEN, answer).verdict == sheets.OPEN


@pytest.mark.parametrize("equations", [SPRING, NO])
def test_without_an_answer_nothing_is_given_away(equations: str) -> None:
    found = judged(equations, "")
    assert found.judged is None
    assert len(found.hints) == 3
    assert len(found.wanted) == len(found.equations) == equations.count("''")
    said = " ".join(map(str, (*found.hints, found.constants)))
    assert not any(word in said for word in ("There is", "none", "Lagrangian exists"))
    assert judged(equations, "one", "  ").judged is None


def test_equations_that_cannot_be_read_are_a_problem() -> None:
    found = judged("x'' = ((", "none")
    assert found.problem
    assert (found.equations, found.judged, found.hints) == ([], None, [])


@pytest.mark.parametrize(
    ("hamiltonian", "lagrangian"),
    [
        ("p_x^2/(2*m) + k*x^2/2", "m*x'^2/2 - k*x^2/2"),
        ("H = sqrt(1 + p_x^2)", "-sqrt(1 - x'^2)"),  # a free relativistic particle
        ("(p_x - k*t)^2/2", "x'^2/2 + k*t*x'"),  # a gauge
        ("m*p_x^2/2 - x", "x'^2/(2*m) + x"),
    ],
)
def test_the_lagrangian_of_a_hamiltonian_is_its_legendre_transform(
    hamiltonian: str, lagrangian: str
) -> None:
    names = nm.Names(("x",), ("m", "k", "p_x"))
    found = reader.read_formula(exercises.lagrangian_of(hamiltonian, names), names)
    wanted = reader.read_formula(lagrangian, names)
    assert collecting.collect(ex.subtract(found, wanted)) == ex.ZERO


def test_a_hamiltonian_with_velocities_is_refused() -> None:
    with pytest.raises(errors.InputError, match="no velocities"):
        exercises.lagrangian_of("x'^2/2 + x^2/2", nm.Names(("x",), ("p_x",)))


def test_equal_equations_are_seen_and_a_students_own_names_are_not() -> None:
    names = nm.Names(("x",), ("k",))
    assert exercises._is_same("-(k*x + k)", "-k*(x + 1)", names)
    assert not exercises._is_same("-k*x", "-k*x^2", names)
    assert not exercises._is_same("-omega*x", "-k*x", names)
    assert not exercises._is_same(None, "-k*x", names)


def test_a_code_belongs_to_one_exercise_one_student_one_day_and_one_store() -> None:
    asked = exercises.address_of({"equations": SPRING})
    code = exercises.code_of(SECRET, asked, "Ada", "2026-01-31")
    assert code.startswith("2026-01-31-")
    assert exercises.is_genuine(SECRET, asked, "Ada", code)
    others = (
        (b"of another", asked, "Ada", code),
        (SECRET, exercises.address_of({"equations": DAMPED}), "Ada", code),
        (SECRET, asked, "Bob", code),
        (SECRET, asked, "Ada", code.replace("-31-", "-30-")),
        (SECRET, asked, "Ada", code[:-1]),
        (SECRET, asked, "Ada", ""),
    )
    assert not any(exercises.is_genuine(*other) for other in others)


def test_the_address_of_an_exercise_has_one_order_and_no_answer() -> None:
    query = {"title": "Friction", "equations": DAMPED, "ask": "hamiltonian"}
    turned = {**dict(reversed(query.items())), "answer": "none", "own": "x", "student": "Ada"}
    assert exercises.address_of(query) == exercises.address_of(turned)
    assert exercises.address_of({**query, "hints": ""}) == exercises.address_of(query)


def asked(path: str, **query: str) -> Request:
    """A request of a service whose workers answer in this process."""

    async def made(_client: object, task: Any, *given: Any, **_limits: Any) -> Any:
        return task(*given)

    async def in_thread(call: Any, *given: Any) -> Any:
        return call(*given)

    engine = SimpleNamespace(
        made=made, in_thread=in_thread, store=SimpleNamespace(secret=SECRET.decode),
        settings=SimpleNamespace(frame_origins="", keys="", trusted_proxies=""),
    )  # fmt: skip
    return Request(
        {
            "type": "http", "method": "GET", "path": path, "scheme": "http", "headers": [(b"host", b"here")],
            "query_string": urlencode(query).encode(), "server": ("here", 80), "client": ("127.0.0.1", 1),
            "app": SimpleNamespace(state=SimpleNamespace(engine=engine)), "state": {},
        }
    )  # fmt: skip


def page(answer: Any) -> str:
    assert answer.status_code == 200
    return html.unescape(bytes(answer.body).decode())


def test_a_teacher_makes_a_link_whose_right_answer_gives_a_code_that_is_genuine() -> None:
    link = {"equations": SPRING, "title": "A spring", "ask": "lagrangian"}
    made = page(asyncio.run(exercises.make(asked("/exercise/new", **link))))
    address = f"http://here/exercise?{exercises.address_of(link)}"
    assert address in made
    sent = {**link, "answer": "one", "own": "x'^2/2 - x^2/2", "student": "Ada"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exercises.clients, "client_of", lambda _: "someone")
        right = page(asyncio.run(exercises.exercise(asked("/exercise", **sent))))
        wrong = page(asyncio.run(exercises.exercise(asked("/exercise", **{**sent, "own": "x'^2"}))))
        nobody = page(
            asyncio.run(exercises.exercise(asked("/exercise", **{**sent, "student": ""})))
        )
    assert "A spring" in right
    day = exercises.datetime.now(exercises.UTC).date().isoformat()
    code = exercises.code_of(SECRET, exercises.address_of(link), "Ada", day)
    assert code in right
    assert day not in wrong
    assert day not in nobody
    for student, verdict in (("Ada", True), ("Bob", False)):
        shown = {"link": address, "student": student, "code": code}
        checked = page(asyncio.run(exercises.teach(asked("/teach", **shown))))
        other = page(asyncio.run(exercises.teach(asked("/teach", **{**shown, "code": "x"}))))
        assert (checked != other.replace('value="x"', f'value="{code}"')) == verdict


def test_an_address_without_a_question_leads_to_the_page_for_teachers() -> None:
    answer = asyncio.run(exercises.exercise(asked("/exercise", title="nothing")))
    assert answer.status_code == 303
    assert answer.headers["location"] == "/teach"
