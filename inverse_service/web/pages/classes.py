"""A set of exercises for a class: each student has own numbers, and marks are counted from codes.

Nothing is stored. A set is the text that the teacher wrote; the numbers of a student follow from
the text and the name; a solved exercise gives a code (`exercises.code_of`), which only this service
can make and verify. So whoever has the set and the codes of a class has the marks.
"""

import asyncio
import csv
import hashlib
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple
from urllib.parse import parse_qsl, urlencode

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from inverse_service.web.pages import exercises, forms, rendering, results
from inverse_service.web.problems import Refusal

router = APIRouter()
MOST_EXERCISES, MOST_STUDENTS, LONGEST_SET, LONGEST_NAME = 40, 1_000, 4_000, 80
MOST_CODES = 2 * MOST_EXERCISES  # of a student, who may have solved some of them twice
# Bytes of a form with the codes of a large class.
LARGEST_FORM = 512 * 1024
EXAMPLE = """# Friction
x'' = -[2..9] x - [1..4] x'
# Two coupled oscillators
x'' = -[2..5] x + y; y'' = x - [2..5] y
# Is there any?
x'' = -x; y'' = -[2..9] y - x'"""
_NUMBER = r"(-?\d{1,6})"
_RANGE = re.compile(rf"\[\s*(?:([A-Za-z]\w*)\s*=\s*)?{_NUMBER}\s*\.\.\s*{_NUMBER}\s*\]")
_AGAIN = re.compile(r"\[\s*([A-Za-z]\w*)\s*\]")
_CODE = re.compile(r"\d{4}-\d\d-\d\d-[0-9a-f]{12}")
# What a table would take for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True, slots=True)
class Task:
    """One exercise of a set; its equations may have ranges [2..9] of whole numbers, and [k=2..9] that stands again as [k]."""

    title: str
    equations: str


@dataclass(frozen=True, slots=True)
class Marked:
    """A student with the exercises that were solved, in their order."""

    student: str
    solved: tuple[bool, ...]

    @property
    def number(self) -> int:
        """How many were solved."""
        return sum(self.solved)


def tasks_of(text: str) -> tuple[Task, ...]:
    """The exercises of a set: a line of equations each, under a line "# title" if it has one.

    Raises ValueError in words for a person: none, too many, a range without a number.
    """
    if len(text) > LONGEST_SET:
        raise ValueError(f"A set has at most {LONGEST_SET} characters; make two of it.")
    found, title = list[Task](), ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith("#"):
            title = line.lstrip("# ")
        elif line:
            found.append(Task(title or f"Exercise {len(found) + 1}", line))
            title = ""
    if not found:
        raise ValueError("Write at least one line of equations, such as x'' = -[2..9] x.")
    if len(found) > MOST_EXERCISES:
        raise ValueError(f"A set has at most {MOST_EXERCISES} exercises; make two of it.")
    for task in found:
        names = set[str]()
        for name, first, last in _RANGE.findall(task.equations):
            if int(first) > int(last):
                raise ValueError(f"[{first}..{last}] has no number; write [{last}..{first}].")
            if name in names:
                raise ValueError(
                    f"[{name}=...] stands twice in a line; write [{name}] after the first."
                )
            names |= {name} - {""}
    return tuple(found)


def drawn(text: str, student: str, index: int, equations: str) -> str:
    """The equations of a student: each range is one of its numbers, by a digest of set and name."""
    place, named = 0, dict[str, str]()

    def number(found: re.Match[str]) -> str:
        nonlocal place
        place += 1
        name, first, last = found[1], int(found[2]), int(found[3])
        about = f"{text}\n{student.casefold()}\n{index}\n{place}"
        value = first + int(hashlib.sha256(about.encode()).hexdigest(), 16) % (last - first + 1)
        written = str(value) if value >= 0 else f"({value})"
        if name:
            named[name] = written
        return written

    given = _RANGE.sub(number, equations)
    return _AGAIN.sub(lambda found: named.get(found[1], found[0]), given)


def questions_of(text: str, student: str, ask: str, hints: str) -> list[tuple[Task, str]]:
    """Each exercise of a student, with its address without a name."""
    asked = {"ask": ask, "hints": hints}
    return [
        (task, exercises.address_of({
            "equations": drawn(text, student, index, task.equations), "title": task.title, **asked,
        }))
        for index, task in enumerate(tasks_of(text))
    ]  # fmt: skip


def rows_of(text: str) -> list[tuple[str, frozenset[str]]]:
    """Each student of a list "name; codes", one a line or several for one name.

    Raises ValueError in words for a person: codes without a name, too many codes or students.
    """
    found = dict[str, set[str]]()
    for number, line in enumerate(text.splitlines(), 1):
        name, codes = _CODE.split(line)[0].strip(" \t;,:")[:LONGEST_NAME], _CODE.findall(line)
        if other := _CODE.sub(" ", line.partition(";")[2]).strip(" \t;,"):
            raise ValueError(
                f"Line {number}: {other[:40]!r} is no code; write a code as the exercise gave it, such as "
                "2026-11-28-0123456789ab."
            )
        if name:
            found.setdefault(name, set()).update(codes)
        elif codes:
            raise ValueError(f"Line {number} has codes and no name; write the name before them.")
    if len(found) > MOST_STUDENTS:
        raise ValueError(f"Marks are counted for {MOST_STUDENTS} students at once; send a part.")
    if many := next((name for name, codes in found.items() if len(codes) > MOST_CODES), None):
        raise ValueError(f"{many} has more than {MOST_CODES} codes; leave out those of other sets.")
    return [(name, frozenset(codes)) for name, codes in found.items()]


def as_csv(tasks: Sequence[Task], marked: Sequence[Marked]) -> str:
    """The marks with a column for each exercise; no cell begins like a formula."""
    out = io.StringIO()
    table = csv.writer(out)
    table.writerow(["student", *(_cell(task.title) for task in tasks), "solved"])
    for one in marked:
        table.writerow([_cell(one.student), *map(int, one.solved), one.number])
    return out.getvalue()


def _cell(text: str) -> str:
    return f"'{text}" if text.startswith(_FORMULA) else text


class SentSet(NamedTuple):
    """A set of exercises as it was sent."""

    text: str
    ask: str
    hints: str


def _sent(fields: Mapping[str, str]) -> SentSet:
    """The text of a set, what is asked, and whether there are hints."""
    text = fields.get("set", "").replace("\r\n", "\n").strip()
    ask = fields.get("ask", "")
    return SentSet(
        text,
        ask if ask in exercises.ASKED else "lagrangian",
        "no" if fields.get("hints") == "no" else "yes",
    )


@router.get("/class/new")
async def make(request: Request) -> HTMLResponse:
    """The page of a teacher: the set, its link, and a student's exercises as an example."""
    query = request.query_params
    text, ask, hints = _sent(query)
    text = text or EXAMPLE
    problem, shown, read, link = "", list[tuple[Task, str]](), list[dict[str, Any]](), ""
    try:
        shown = questions_of(text, "An example", ask, hints)
        read = await _read(request, [_equations_of(question) for _, question in shown])
        refuse_unread([task for task, _ in shown], read)
        kept = urlencode({"set": text, "title": query.get("title", ""), "ask": ask, "hints": hints})
        link = f"{str(request.base_url).rstrip('/')}/class?{kept}"
    except ValueError as error:
        problem = str(error)
    return rendering.page(
        "class_new.html", active="/teach", text=text, title=query.get("title", ""), ask=ask, hints=hints,
        asked=exercises.ASKED, problem=problem, shown=list(zip(shown, read, strict=True)) if link else [], link=link,
    )  # fmt: skip


def _equations_of(question: str) -> str:
    return dict(parse_qsl(question))["equations"]


def readings_task(texts: Sequence[str]) -> list[dict[str, Any]]:
    """How each text of equations is understood, as below the form of the first page, without buttons."""
    found = [forms.echo_task(forms.fields_from({"equations": text})) for text in texts]
    for one in found:
        if read := one.get("understood"):
            told = [(text, meant, "", "") for text, meant, *_ in read.readings]
            one["understood"] = replace(read, readings=told)
    return found


async def _read(request: Request, texts: Sequence[str]) -> list[dict[str, Any]]:
    """The same from a worker; nothing of each where the service is busy."""
    try:
        outcome = await results.quick(request, readings_task, texts)
    except Refusal:
        return [{} for _ in texts]
    done: list[dict[str, Any]] = outcome.value if outcome.status == "done" else [{} for _ in texts]
    return done


def refuse_unread(tasks: Sequence[Task], read: Sequence[Mapping[str, Any]]) -> None:
    """Raises ValueError with the first exercise that no student could read."""
    for task, one in zip(tasks, read, strict=True):
        if problem := one.get("problem"):
            raise ValueError(f"{task.title}, {task.equations}: {problem[0].detail}")


@router.get("/class")
async def exercises_of_student(request: Request) -> Response:
    """The page of a student: a name first, then the exercises with own numbers."""
    query = request.query_params
    text, ask, hints = _sent(query)
    student = query.get("student", "").strip()[:LONGEST_NAME]
    problem, shown = "", list[tuple[Task, str]]()
    try:
        tasks_of(text)
        shown = questions_of(text, student, ask, hints) if student else []
    except ValueError as error:
        problem = str(error)
    page = rendering.page(
        "class.html", active="", text=text, title=query.get("title", "")[:120], ask=ask, hints=hints,
        student=student, name=urlencode({"student": student}), problem=problem, shown=shown,
    )  # fmt: skip
    return rendering.framed(page, request.app.state.engine.settings.frame_origins)


@router.get("/class/marks")
async def ask_marks(request: Request) -> HTMLResponse:
    """The form of a teacher for the codes of a class."""
    text, ask, hints = _sent(request.query_params)
    return _marks_page(text, ask, hints, "", (), (), "")


@router.post("/class/marks")
async def marks(request: Request) -> Response:
    """The marks, as a table or as CSV."""
    sent = await results.read_form(request, LARGEST_FORM)
    fields = {name: sent.text(name) for name in ("set", "ask", "hints", "codes", "format")}
    text, ask, hints = _sent(fields)
    try:
        tasks, rows = tasks_of(text), rows_of(fields["codes"])
    except ValueError as error:
        return _marks_page(text, ask, hints, fields["codes"], (), (), str(error))
    secret, found = await exercises.secret_of(request), list[Marked]()
    for student, codes in rows:
        solved = [
            any(exercises.is_genuine(secret, question, student, code) for code in codes)
            for _, question in questions_of(text, student, ask, hints)
        ]
        found.append(Marked(student, tuple(solved)))
        await asyncio.sleep(0)  # a large class does not hold up others
    if fields["format"] == "csv":
        headers = {"Content-Disposition": 'attachment; filename="marks.csv"'}
        return Response(as_csv(tasks, found), headers=headers, media_type="text/csv; charset=utf-8")
    return _marks_page(text, ask, hints, fields["codes"], tasks, found, "")


def _marks_page(
    text: str, ask: str, hints: str, codes: str, tasks: Sequence[Task], marked: Sequence[Marked], problem: str
) -> HTMLResponse:  # fmt: skip
    return rendering.page(
        "class_marks.html", active="/teach", text=text, ask=ask, hints=hints, asked=exercises.ASKED, codes=codes,
        tasks=tasks, marked=marked, problem=problem,
    )  # fmt: skip
