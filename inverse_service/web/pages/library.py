"""What is read: six short screens, the manual, about, the calls for programs, and the atlas with its search."""

import itertools
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from html import unescape
from importlib import resources
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter
from markdown_it import MarkdownIt
from markupsafe import Markup, escape
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from inverse_service import __version__, catalogue, errors
from inverse_service.reading.names import Names
from inverse_service.service.documents import sheets, stated
from inverse_service.web import clients, problems, routes
from inverse_service.web.pages import WORDS, forms, kept, rendering, result_tasks, typesetting

router = APIRouter()
open_router = APIRouter()  # asks for no key
# Those of the systems in the lessons.
NAMES = Names(("x", "y", "phi", "theta"), ("R", "L"))
# (name in the address, title) of the pages in web/manual; the first page are the six screens.
PAGES = (
    ("mathematics", "The mathematics"),
    ("constraints", "Constraints"),
    ("calls", "Calls for programs"),
)
_FORMULA = re.compile(r"<p>\$(.+?)\$</p>|\$(.+?)\$")
FIRST_SHOWN, MOST_SHOWN = 20, 200
REFERENCE = re.compile(
    r"(?:arXiv:\s*|(?<=, ))(?P<arxiv>\d{4}\.\d{4,5})|doi:\s*(?P<doi>10\.\d{4,}/[^\s,;]+[^\s,;.])"
    r"|math\.stackexchange\.com/questions/(?P<stack>\d+)|(?:MathOverflow |mathoverflow\.net/questions/)(?P<flow>\d+)"
    r"|github\.com/(?P<github>[\w./-]+)",
    re.I,
)
REFERRED: dict[str, str] = WORDS["references"]
BODIES: list[tuple[str, str]] = WORDS["bodies"]
PICTURES: list[str] = WORDS["pictures"]
MOST_PICTURES = 20
LONGEST_LINE = 120  # characters of the equations in a list
AT_ONCE, PATIENCE = 1.0, 15.0  # s that a page, and the script on it, waits for an answer
MOST_NEAR, RARE = 12, 60
VARIATION = "variation of "  # before the source of a system that is ours
MOST_SUBJECTS = 24
SIZES = ("1", "2", "3", "4", "5")
_ANSWERS = kept.Kept(256)


@router.get("/learn")
async def learn() -> HTMLResponse:
    """The six screens."""
    return rendering.page(
        "learn.html",
        active="/learn",
        names=NAMES,
        manual=PAGES,
        can_simulate=rendering.can_simulate(),
    )


@open_router.get("/about")
async def about() -> HTMLResponse:
    """What this program does, whose method it extends, and how to cite both."""
    return rendering.page("about.html", active="", version=__version__)


@open_router.get("/learn/{name}")
async def manual(request: Request, name: str) -> HTMLResponse:
    """One page of the manual."""
    if name not in dict(PAGES):
        raise problems.Refusal(404, "not-found", "The manual has no such page; /learn lists them.")
    return _manual(request, name)


@open_router.get("/docs")
async def documentation(request: Request) -> HTMLResponse:
    """How programs ask, and all calls of the OpenAPI description: (method, path, what it does)."""
    paths: dict[str, Any] = request.app.openapi()["paths"]
    calls = [
        (method.upper(), path, about.get("description", "").partition("\n\n")[0].replace("\n", " "))
        for path, methods in paths.items()
        for method, about in methods.items()
    ]
    return _manual(request, "calls", calls)


def _manual(
    request: Request, name: str, calls: Sequence[tuple[str, str, str]] = ()
) -> HTMLResponse:
    body = _body(name, str(request.base_url).rstrip("/"))
    active = "/docs" if calls else "/learn"
    return rendering.page(
        "manual.html",
        active=active,
        title=dict(PAGES)[name],
        body=body,
        pages=PAGES,
        name=name,
        calls=calls,
    )


def _body(name: str, address: str) -> Markup:
    """The page as HTML; text between dollar signs is a formula."""
    text = (resources.files("inverse_service.web") / "manual" / f"{name}.md").read_text(
        encoding="utf-8"
    )
    text = text.replace("ADDRESS", address)
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    k = itertools.count(1)
    html = re.sub(
        "<pre>", lambda _: f'<pre tabindex="0" role="region" aria-label="Example {next(k)}">', html
    )
    return Markup(
        _FORMULA.sub(lambda found: _formula(unescape(found[1] or found[2]), bool(found[1])), html)
    )


def _formula(text: str, alone: bool) -> str:
    math = typesetting.of_theory(text)
    return f'<p class="formula">{math}</p>' if alone else str(math)


# The atlas.


def body_of(name: str) -> str:
    """The drawing of a system of this name; empty if the name mentions no body."""
    return next((body for words, body in BODIES if f"-{words}-" in f"-{name}-"), "")


@router.get("/atlas")
async def atlas_search(request: Request) -> HTMLResponse:
    """The search and its results; the pictures if nothing is searched."""
    query = request.query_params
    sent = {
        name: query.get(name, "").strip()
        for name in ("q", "tag", "equations", "verdict", "size", "kind")
    }
    most = MOST_SHOWN if query.get("all") else FIRST_SHOWN
    if re.search("''|=", sent["q"]) and not sent["equations"]:  # typed into the first box
        sent |= {"q": "", "equations": sent["q"]}
    problem, found = "", []
    try:
        found = await routes.found_by(request, sent["q"], sent["tag"], sent["equations"])
    except (problems.Refusal, errors.InputError) as error:
        problem = str(getattr(error, "detail", error))
    found = [
        one
        for one in found
        if sent["verdict"] in ("", one["verdict"])
        and _has_size(one, sent["size"])
        and is_of_kind(one, sent["kind"])
    ]
    return rendering.page(
        "atlas.html",
        active="/atlas",
        sent=sent,
        problem=problem,
        found=[_line(entry) for entry in found[:most]],
        count=len(found),
        more=f"/atlas?{urlencode({**sent, 'all': 'yes'})}#systems" if len(found) > most else "",
        whole=len(catalogue.atlas()),
        tags=subjects(),
        verdicts=[
            (key, sheets.BADGES[key] + " or Hamiltonian" * (key in (sheets.YES, sheets.NO)))
            for key in (sheets.YES, sheets.NO, sheets.DIFFERS, sheets.OPEN)
        ],
        sizes=SIZES,
        kinds=WORDS["kinds_of_entries"],
        pictures=() if any(sent.values()) else pictures(),
        license=routes.LICENSE,
    )


def subjects() -> list[tuple[str, str, int]]:
    """Each tag that is a subject, with its words and the number of its systems, the most frequent first."""
    words: dict[str, str] = WORDS["subjects"]
    found = (
        (tag, words.get(tag, tag), count)
        for tag, count in catalogue.atlas_tags().items()
        if not _is_general(tag)
    )
    return [one for one in found if one[1]][:MOST_SUBJECTS]


@lru_cache(maxsize=1)
def pictures() -> list[dict[str, Any]]:
    """Twenty systems whose body is drawn."""
    known = [catalogue.atlas()[name] for name in PICTURES if name in catalogue.atlas()]
    known += [
        entry
        for entry in catalogue.atlas().values()
        if body_of(entry["name"]) and entry not in known
    ]
    return [
        {**entry, "body": body_of(entry["name"]) or "portrait"} for entry in known[:MOST_PICTURES]
    ]


def is_of_kind(entry: Mapping[str, Any], kind: str) -> bool:
    """Whether an entry is of a kind of `kinds_of_entries`; any is where none is named."""
    tags, result = entry["tags"], entry["result"]
    has_functions = bool((result.get("system") or {}).get("functions"))
    match kind:
        case "family":
            return "family" in tags
        case "constraints":
            return "constraints" in tags
        case "functions":
            return has_functions
        case "time":
            verdicts = (result.get("verdict"), result.get("verdict_with_time"))
            return verdicts == ("not_variational", "variational")
        case "cases":
            return len(result.get("branches") or ()) > 1
        case "plain":
            return not ({"family", "constraints"} & {*tags} or has_functions)
    return True


def _has_size(entry: Mapping[str, Any], size: str) -> bool:
    """Whether an entry has this number of coordinates; the largest choice means more, too."""
    if size not in SIZES:
        return True
    count = next(
        (int(tag.split()[0]) for tag in entry["tags"] if tag.split()[-1].startswith("coordinate")),
        0,
    )
    return count == int(size) or (size == SIZES[-1] and count > int(size))


def _line(entry: dict[str, Any]) -> dict[str, Any]:
    defined = ((entry.get("result") or {}).get("system") or {}).get("definitions") or ()
    text = "; ".join((*entry["equations"], *(one["text"] for one in defined)))
    return {**entry, "text": text if len(text) <= LONGEST_LINE else f"{text[:LONGEST_LINE]}\u2026"}


@router.get("/atlas/{name}")
async def atlas_entry(request: Request, name: str) -> HTMLResponse:
    """One system with its answer, which is that of this program."""
    found = _entry(name)
    return rendering.page(
        "atlas_entry.html",
        active="/atlas",
        entry=found,
        equations=[
            typesetting.proposition(text, stated.names_of(found["document"]))
            for text in found["equations"]
        ],
        answer=await _answer_of(request, found, AT_ONCE),
        source=referenced(found["source"]),
        body=body_of(name),
        alike=[one for one in catalogue.search_atlas(form=found["form"]) if one["name"] != name][
            :MOST_NEAR
        ]
        if found["form"]
        else [],
        moved=moved(found),
        near=near(found),
        tags=[(tag, said) for tag in found["tags"] if (said := WORDS["subjects"].get(tag, tag))],
        question=forms.question_address(found["document"]),
    )


@router.get("/atlas/{name}/answer")
async def atlas_answer(request: Request, name: str) -> Response:
    """The part of an entry's page that shows its answer; 503 if it takes longer."""
    found = await _answer_of(request, _entry(name), PATIENCE)
    if found is None:
        raise problems.Refusal(503, "busy", "The answer is being computed; ask again.")
    return rendering.sent(found, "text/html", {"Content-Security-Policy": rendering.POLICY})


def _entry(name: str) -> dict[str, Any]:
    return problems.known(
        catalogue.atlas().get(name), "system of this name in the atlas; /atlas searches it."
    )


async def _answer_of(request: Request, entry: dict[str, Any], patience: float) -> Markup | None:
    engine, client = request.app.state.engine, clients.client_of(request)

    async def make() -> Markup | None:
        task, most = result_tasks.entry_task, 4 * result_tasks.ENTRY
        outcome = await engine.run_quick(client, task, entry, seconds=most, among_jobs=True)
        return outcome.value if outcome.status == "done" else None

    return await _ANSWERS.of(entry["name"], make, patience)


def moved(entry: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Systems with the same forces at rest and other ones in motion, such as friction."""
    found = catalogue.search_atlas(at_rest=entry["at_rest"])
    others = [one for one in found if one["name"] != entry["name"] and one["form"] != entry["form"]]
    return others[:MOST_NEAR]


def near(entry: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Systems of the same person or source, and those with the rarest of the subjects of an entry, of another form."""
    names, work = _persons(entry), entry["source"].removeprefix(VARIATION)
    akin = [
        one
        for one in catalogue.atlas().values()
        if (work and work in one["source"]) or not names.isdisjoint(_words(one["title"]))
    ]
    counts = catalogue.atlas_tags()
    subjects = [
        (counts[tag], tag)
        for tag in entry["tags"]
        if 1 < counts[tag] <= RARE and not _is_general(tag)
    ]
    found = [one for _, tag in sorted(subjects)[:1] for one in catalogue.search_atlas(tag=tag)]
    candidates = (*(akin if len(akin) <= RARE else ()), *found)
    others = [
        one
        for one in {one["name"]: one for one in candidates}.values()
        if one["name"] != entry["name"]
        and (not one["form"] or one["form"] != entry["form"])
        and (not one["at_rest"] or one["at_rest"] != entry["at_rest"])
    ]
    return others[:MOST_NEAR]


def _persons(entry: Mapping[str, Any]) -> set[str]:
    """The names that title and source share."""
    return {word for word in _words(entry["title"]) & _words(entry["source"]) if word[0].isupper()}


def _words(text: str) -> set[str]:
    return set(re.findall(r"[^\W\d_]{3,}", text))


def _is_general(tag: str) -> bool:
    """Whether a tag is a verdict or a number of coordinates, which have filters of their own."""
    return tag.endswith(("coordinate", "coordinates", "Lagrangian", "Hamiltonian"))


def referenced(source: str) -> Markup:
    """A source with a link for each arXiv number, DOI, and question that it names."""
    text = Markup("")
    place = 0
    for match in REFERENCE.finditer(source):
        address = next(
            REFERRED[kind].format(number) for kind, number in match.groupdict().items() if number
        )
        text += escape(source[place : match.start()]) + Markup('<a href="{}">{}</a>').format(
            address, match.group()
        )
        place = match.end()
    return text + escape(source[place:])


@router.get("/gallery")
async def gallery() -> Response:
    """The gallery is the atlas."""
    return RedirectResponse("/atlas", 301)
