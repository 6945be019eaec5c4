"""Pages, pictures and files of results, made inside worker processes, which read the result in the
store themselves.

With them: what to try next where an answer stayed open, the texts to take along, and the answer
next to a form.
"""

import gzip
import json
import math
import pprint
import shlex
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, TypeVar
from urllib.parse import urlencode

from markupsafe import Markup
from starlette.responses import HTMLResponse

from inverse_service import deadline, errors
from inverse_service.decision.solutions import SolveOptions
from inverse_service.reading import declarations, document_names, names as nm
from inverse_service.service.documents import (
    family_maps,
    family_tables,
    plain_data,
    printed_pages,
    sheets,
    short_results,
    stated,
)
from inverse_service.service.jobs import model, opening, tasks
from inverse_service.service.scenes import views
from inverse_service.statements.reasons import Reason
from inverse_service.statements.stages import Stage
from inverse_service.web.pages import WORDS, forms, preview, rendering, simulations, typesetting

T = TypeVar("T")
OFFER_TERMS = "Offer terms that L may contain, in \u201cAsk in detail\u201d: for example {}."
ONE_QUESTION = "Ask one question instead of two, in \u201cAsk in detail\u201d: L(q, q\u2032) alone."
# Of a time limit; the remaining time is for the work after the search.
MUCH_OF = 0.8
LONG_RUN = (
    "Run the system on your own computer: `inverse-service solve --time-limit 3600 system.json`"
)
EXPORTS: dict[str, tuple[str, str]] = WORDS["exports"]
ENTRY = 6.0  # s of processor time for an entry of the atlas
# s of processor time; no one who is still typing waits longer for the answer, or for its verdict.
GLANCE, VERDICT_SOON = 3.0, 0.12


def advice_for(result: Mapping[str, Any], largest: float) -> list[str]:
    """What may settle it; `largest` is the time limit of this service in s. Empty where nothing is open."""
    verdict, limit = sheets.verdict_of(result), _limit_that_was_hit(result)
    run = [LONG_RUN] if limit is not None and longer_of(result, largest) is None else []
    if verdict == sheets.OPEN:
        return [*run, *_about_size(result)]
    shown = stated.main_statements(result)[0].part
    if verdict == sheets.YES and not stated.is_constrained(result) and not shown.get("lagrangian"):
        return [*run, OFFER_TERMS.format(_terms_of(result["system"]))]
    return []


def longer_of(result: Mapping[str, Any], largest: float) -> float | None:
    """The seconds with which the question is worth asking again; None where it had as many, or ended by itself."""
    limit = _limit_that_was_hit(result)
    return largest if limit is not None and limit < MUCH_OF * largest else None


def _terms_of(system: Mapping[str, Any] | None) -> str:
    """Terms in the velocities of this system."""
    first, *others = (system or {}).get("coordinates") or ("x",)
    return (
        f"`{others[0]}'^2/{first}'`"
        if others
        else f"`{first}*{first}'^2`, `{first}'*log({first}')`"
    )


def _limit_that_was_hit(result: Mapping[str, Any]) -> float | None:
    """The seconds that the work had, if it used them up; None if it ended by itself."""
    provenance = result["provenance"]
    stopped = (provenance.get("options") or {}).get("time_limit")
    if isinstance(stopped, int | float):
        codes = {one.get("reason_code") for one in (result, *(result.get("incomplete") or ()))}
        return stopped if codes & {Reason.TIME, Reason.SIZE} else None
    limit, used = provenance.get("time_limit"), (provenance.get("seconds") or {}).values()
    return limit if isinstance(limit, int | float) and sum(used) >= MUCH_OF * limit else None


def _about_size(result: Mapping[str, Any]) -> list[str]:
    system, found = result["system"] or {}, []
    if system.get("functions"):
        found.append("Replace each arbitrary function with a formula.")
    if system.get("parameters"):
        found.append(
            "Assign values to the parameters, such as k = 1/2. Numeric systems are faster."
        )
    both_are_open = (
        result["verdict"] == "undetermined" and result.get("verdict_with_time") is not None
    )
    if both_are_open and not stated.asks_for_time(result):
        found.append(ONE_QUESTION)
    return found or [
        "Write the equations in other coordinates, or solve uncoupled parts separately."
    ]


@dataclass(frozen=True, slots=True)
class Look:
    """What a page depends on besides its result: who looks, at which address, and what the service gives."""

    visitor: rendering.Visitor
    address: str
    time_limit: float


def page_task(
    store: str, id: str, job: Mapping[str, Any], look: Look, check: Mapping[str, Any] | None
) -> HTMLResponse:
    """The page of a successful job, with the verdict of the checker, or that on a visitor's own L."""
    rendering.VISITOR.set(look.visitor)
    document, body = opening.stored_answer(store, id)
    whole = {**job, "result": json.loads(body)}
    if job["kind"] == "solve":
        return solve_result(look, whole, check)
    if job["kind"] == "simulate":
        return simulations.simulation_result(look.address, whole, simulations.pretty(document))
    if job["kind"] == "work-precision":
        return simulations.precision_result(whole, simulations.pretty(document))
    # A job whose result has no page: its JSON.
    return rendering.page("plain.html", active="", text=simulations.pretty(body))


def so_far_task(job: Mapping[str, Any], look: Look, waited: int) -> HTMLResponse:
    """The page of a job that has a confirmed answer while more is sought."""
    rendering.VISITOR.set(look.visitor)
    return solve_result(look, {**job, "result": job["progress"]["so_far"], "waited": waited}, None)


def map_task(store: str, id: str, look: Look, query: Mapping[str, str]) -> HTMLResponse | None:
    """The page of a family with the map of two of its constants; None if the result has no family."""
    rendering.VISITOR.set(look.visitor)
    found = _result(store, id)
    table, letters = family_tables.table_of(found), family_maps.letters_of(found)
    if table is None:
        return None
    shown, member, values = None, None, dict[str, float]()
    across, up = letters[0] if letters else "", ""
    if len(letters) >= family_maps.AXES:
        across, up = family_maps.plane_of(found)
        across, up = (query.get(key, name) for key, name in (("across", across), ("up", up)))
        if across == up or not {across, up} <= {*letters}:
            across, up = family_maps.plane_of(found)
        values = {name: _number_in(query.get(f"at.{name}")) for name in letters}
        shown = family_maps.map_of(found, across, up, values)
        wanted = _wanted(query.get("to", ""))
        there = wanted and family_maps.nearest_in(found, values, wanted)
        if there:
            values = there
            shown = family_maps.map_of(found, across, up, values)
        elif shown is not None and query.get("near"):
            point = family_maps.snapped(shown, (values[across], values[up]))
            values |= dict(zip((across, up), point, strict=True))
        member = family_maps.member_at(found, values)
    motion = preview.motion_of_result(found, (), reveals=False)
    if motion is not None:
        given = {"values": motion.data["values"] | values, "given": values}
        motion = replace(motion, data={**motion.data, **given}, caption=())
        motion = preview.with_conditions(found, motion)
    trees = [
        None if one is None else [[preview.listed(tree) for tree in trees] for trees in one]
        for one in family_maps.conditions_of(found)
    ]
    numbers = {name: f"{value:.4g}" for name, value in values.items()}
    asked = {"across": across, "up": up} | {f"at.{name}": text for name, text in numbers.items()}
    known = _numbers_beside(query.get("beside", ""), len(letters))
    asked |= {"beside": _beside(known)} if known else {}
    own = tuple(numbers.values())
    return rendering.page(
        "family_map.html",
        active="",
        id=id,
        asked=sheets.sheet_of(found, length="brief").asked,
        title=sheets.title_of(found),
        sheet=SimpleNamespace(family=table, sentence=table.sentence),
        letters=letters,
        across=across,
        up=up,
        values=numbers,
        go=f"?{urlencode(asked)}&",
        beside=_beside(known),
        keep=f"?{urlencode({**asked, 'beside': _beside([*known, own])})}#beside"
        if member is not None and own not in known and len(known) < MOST_BESIDE
        else "",
        kept=[_kept_member(found, known, k, motion, asked, letters) for k in range(len(known))],
        keys=[Markup(one) for one in family_maps.keys_of(found, table)],
        numbers=[] if member is None else family_maps.with_numbers(found, member, values),
        nearest=member is not None and member.verdict == sheets.NO and _has_nearest(found),
        svg=None
        if shown is None
        else Markup(family_maps.svg_of(shown, (values[across], values[up]), "of the page")),
        dotted=shown is not None and bool(shown.positive),
        member=member,
        motion=motion,
        leaves={
            "letters": letters,
            "leaves": trees,
            "said": [f"{printed_pages.plain_text(one.where)}: {one.word}" for one in table.members],
        },
    )


def special_task(store: str, id: str, leaf: int, k: int) -> Markup | None:
    """The answer for the members of a family for which the L of their set is none; None if there are no such ones."""
    found = _result(store, id)
    table = family_tables.table_of(found)
    for member in table.members if table is not None else ():
        if member.leaf == leaf and k < len(member.others):
            where, document = member.others[k]
            glance, address = glance_of(document), forms.question_address(document)
            return Markup(
                rendering.render("special.html", where=where, glance=glance, address=address)
            )
    return None


MOST_BESIDE = 4  # members side by side
Numbers = tuple[str, ...]  # the constants of a member, in the order of the letters


def _numbers_beside(text: str, count: int) -> list[Numbers]:
    """The members that an address has side by side, 1,0.5;2,0.5, without what is no member."""
    parts = [tuple(f"{_number_in(one):.4g}" for one in part.split(",")) for part in text.split(";")]
    return [part for part in dict.fromkeys(parts) if len(part) == count > 0 and text][:MOST_BESIDE]


def _beside(known: Sequence[Numbers]) -> str:
    return ";".join(map(",".join, known))


def _kept_member(
    found: Mapping[str, Any],
    known: Sequence[Numbers],
    k: int,
    motion: preview.Shown | None,
    asked: Mapping[str, str],
    letters: Sequence[str],
) -> dict[str, Any]:
    """A member among others: its constants, its set, L or its equations, its motion, and links that
    choose it or take it away.
    """
    texts = dict(zip(letters, known[k], strict=True))
    values = {name: float(text) for name, text in texts.items()}
    member = family_maps.member_at(found, values)
    if motion is not None:
        given = {"values": {**motion.data["values"], **values}, "given": values}
        motion = replace(motion, data={**motion.data, **given}, caption=())
    others = [*known[:k], *known[k + 1 :]]
    return {
        "texts": texts,
        "member": member,
        "formulas": [] if member is None else family_maps.with_numbers(found, member, values),
        "motion": motion,
        "choose": f"?{urlencode({**asked, **{f'at.{name}': text for name, text in texts.items()}})}",
        "remove": f"?{urlencode({**asked, 'beside': _beside(others)})}#beside",
    }


def _wanted(text: str) -> Callable[[sheets.Member], bool] | None:
    """The sets to which a reader wants to go: the number of one, or those with a Lagrangian."""
    if text == "yes":
        return lambda one: one.verdict == sheets.YES
    return (lambda one: one.leaf == int(text)) if text.isdecimal() else None


def _has_nearest(found: Mapping[str, Any]) -> bool:
    """Whether a set with a Lagrangian is given by equations between constants."""
    pairs = zip(family_maps.conditions_of(found), found["family"]["leaves"], strict=True)
    return any(
        conditions is not None and family_tables.verdict_of_leaf(leaf) == sheets.YES
        for conditions, leaf in pairs
    )


LARGEST_NUMBER = 100.0  # of a constant on a map


def _number_in(text: str | None) -> float:
    """A number of a form; 1 for what is none."""
    try:
        value = float(text or "1")
    except ValueError:
        return 1.0
    return value if abs(value) <= LARGEST_NUMBER else 1.0


def embed_task(store: str, id: str, visitor: rendering.Visitor) -> HTMLResponse:
    """The short page of a solved system that other pages show in a frame."""
    rendering.VISITOR.set(visitor)
    return rendering.page(
        "embed.html", active="", sheet=sheets.sheet_of(_result(store, id), length="brief"), id=id
    )


def own_lagrangian_task(store: str, id: str, text: str) -> dict[str, Any]:
    """The verdict on a visitor's Lagrangian for the equations of a stored result, with the `lagrangian` itself."""
    return {
        **check_of(_result(store, id)["system"]["given"], text, forms.right_side),
        "lagrangian": text,
    }


def check_of(document: Any, text: str, to_lagrangian: Callable[[str], str]) -> dict[str, Any]:
    """The checker's verdict on the L that a text means, with this `lagrangian`; "unread" where there is none."""
    try:
        lagrangian = to_lagrangian(text)
        found = tasks.check_task(
            plain_data.write_json({"system": document, "lagrangian": lagrangian})
        )
    except errors.InputError as error:
        return {
            "verdict": "unread",
            "reasons": [forms.sentence(place) for place in error.places],
            "lagrangian": text,
        }
    return {**found, "lagrangian": lagrangian}


@dataclass(frozen=True, slots=True)
class Judged:
    """The judgment of a visitor's own L: a word, a sentence, what L gives and where it fails, and
    reasons.

    `given` are the accelerations that it gives, as texts by coordinate.
    """

    lagrangian: str
    verdict: str
    headline: str
    lines: tuple[Markup, ...] = ()
    reasons: tuple[str, ...] = ()
    given: Mapping[str, str] = field(default_factory=dict)


def judged_of(check: Mapping[str, Any], names: nm.Names, letter: str = "L") -> Judged:
    """The verdict on a visitor's L, with the accelerations that it gives along the motion, and where it fails."""
    names = _with_own_names(check["lagrangian"], names)
    lines: list[sheets.Sentence] = [
        (f"Your {letter} gives ", sheets.Formula(f"{name}'' = {f['text']}", names))
        for name, f in (check.get("equations") or {}).items()
    ]
    lines += [
        ("It fails where ", *sheets.listed(cell["domain"], names))
        for cell in check.get("cells") or ()
        if cell["verdict"] != "valid" and cell["domain"]
    ]
    verdict, headline = WORDS["own"][check["verdict"]]
    reasons = (
        () if verdict == sheets.YES else tuple(check.get("reasons") or ())
    )  # of a yes the headline says them
    return Judged(
        check["lagrangian"],
        verdict,
        headline.replace("this L", f"this {letter}"),
        tuple(map(typesetting.said, lines)),
        reasons,
        {name: f["text"] for name, f in (check.get("equations") or {}).items()},
    )


def _with_own_names(lagrangian: str, names: nm.Names) -> nm.Names:
    """The names with the constants and functions that occur in a visitor's L alone."""
    try:
        declared = declarations.Declared(names.coordinates, declarations.GUESS, names.functions)
        found = document_names.known_names(
            declared, {"": forms.right_side(lagrangian)}, order=1
        ).names
    except errors.InputError:
        return names
    parameters = tuple(dict.fromkeys((*names.parameters, *found.parameters)))
    return replace(names, parameters=parameters, functions=found.functions)


def figure_data_task(store: str, id: str) -> bytes:
    """The data of all figures of a simulation, as JSON, which shrinks to a fifth."""
    data = json.dumps(views.figures_of(_result(store, id)), allow_nan=False)
    return gzip.compress(data.encode(), 5, mtime=0)


def picture_task(store: str, id: str, name: str, ending: str) -> bytes | None:
    """A figure as a file; None if the result does not have it."""
    from inverse_service.service.scenes.drawing import picture

    return picture(_result(store, id), name, ending)


def table_task(store: str, id: str) -> bytes | None:
    """The table of a result's page as CSV; None if it has none."""
    found = _result(store, id)
    rows = (
        simulations.table_of(found)
        if "methods" in found
        else sheets.rows_of(sheets.sheet_of(found, length="brief"))
    )
    return rendering.csv_of(rows).encode() if len(rows) > 1 else None


def answer_picture_task(store: str, id: str, ending: str) -> bytes | None:
    """The picture of a solved system as a file; None if nothing can be drawn."""
    try:
        from inverse_service.web.pages.starts import picture_of
    except ModuleNotFoundError:  # the extras "simulation" and "figures" are not installed
        return None
    found = _result(store, id)
    words = printed_pages.plain_text(sheets.sheet_of(found, length="brief").sentence)
    return picture_of(found, ending, "\n".join(textwrap.wrap(words, 28)))


def file_task(store: str, id: str, label: str, ending: str) -> bytes | None:
    """Every recorded point of a method as a file; None if there are none."""
    from inverse_service.service.scenes.simulating import csv_bytes, every_point, npz_bytes

    text, body = opening.stored_answer(store, id)
    document, found = json.loads(text), json.loads(body)
    columns = every_point(document, found, label)
    if columns is None:
        return None
    return (
        csv_bytes(columns)
        if ending == "csv"
        else npz_bytes(columns, document, label, found["provenance"])[0]
    )


def code_task(store: str, id: str, language: str, address: str) -> str:
    """A result as a text; SymPy is imported by the first program in a worker, never in the web process."""
    found = _result(store, id)
    if language == "latex":
        return printed_pages.latex_page(dict(found), True, f"{address}/results/{id}")
    if language == "embed":
        return rendering.frame_code(
            f"{address}/results/{id}/embed", sheets.title_of(found), "640", 320
        )
    if language in ("client", "curl"):
        return (python_call if language == "client" else curl_of)(found["system"]["given"], address)
    from inverse_service.sympy import from_result

    return from_result(found).to_code(language)


def certificate_task(store: str, id: str) -> str:
    """The certificates of a result alone, as JSON."""
    found = _result(store, id)
    parts = {
        "certificate": found,
        "with_time": found.get("with_time"),
        "any_associated": found.get("any_associated"),
    }
    kept = {
        name: part["certificate"]
        for name, part in parts.items()
        if part and part.get("certificate")
    }
    return json.dumps(kept, ensure_ascii=False, indent=1)


def fields_task(store: str, id: str) -> dict[str, str] | None:
    """The solve form filled with the document of a result; None if it has none."""
    given = (_result(store, id).get("system") or {}).get("given")
    return forms.lean_fields(given) if isinstance(given, dict) else None


def part_task(store: str, id: str, choose: Callable[[Any], T]) -> T:
    """The value of a function for a result."""
    return choose(_result(store, id))


def _result(store: str, id: str) -> Any:
    return json.loads(opening.stored_answer(store, id)[1])


def solve_result(
    look: Look, job: Mapping[str, Any], check: Mapping[str, Any] | None
) -> HTMLResponse:
    """The page of a solved system, or of one that is confirmed in part while more is looked for (`open`)."""
    found, system = job["result"], job["result"]["system"]
    is_open = job["status"] != "successful"
    sheet = family_tables.sheet_with_family(found, grows=is_open)
    judged = judged_of(check, stated.names_of(system)) if check and "lagrangian" in check else None
    advice = advice_for(found, look.time_limit) if "verdict" in found and not is_open else []
    return rendering.page(
        "sheet.html",
        active="",
        sheet=sheet,
        has_map=not is_open and len(family_maps.letters_of(found)) >= family_maps.AXES,
        nearest=found.get("nearest") is not None and not is_open,
        job=job,
        open=is_open,
        waited=int(job.get("waited", 0)),
        question=forms.question_address(system["given"]) if system and not is_open else "",
        address_of_result=f"{look.address}/results/{job['id']}",
        motion=preview.motion_of_result(found, _conditions_shown(found)),
        own=judged,
        specials=bool(found.get("special_cases")),
        can_judge=bool(system)
        and "verdict" in found
        and not stated.is_constrained(found)
        and not is_open,
        advice=advice,
        seconds=_seconds_of(found),
        longer=longer_of(found, look.time_limit) if advice else None,
        more_words=_words_of_more(sheet),
        exports=exported(found),
        certified=bool(
            found.get("certificate") or (found.get("any_associated") or {}).get("certificate")
        ),
        can_simulate=rendering.can_simulate() and system is not None,
    )


def entry_task(entry: Mapping[str, Any]) -> Markup:
    """The answer of an entry of the atlas as a part of its page; with its proof, if making that again is quick."""
    is_long = entry["seconds"] > ENTRY / 2
    if is_long:
        found = short_results.unfolded(entry["result"], entry["document"])
    else:
        found = tasks.solve_task(entry["document"], SolveOptions(time_limit=ENTRY))
    sheet = family_tables.sheet_with_family(found, length="brief" if is_long else "whole")
    if is_long:  # a row without its proof has nothing to open
        sheet = replace(sheet, table=tuple(replace(row, steps=()) for row in sheet.table))
    html = rendering.render(
        "atlas_answer.html",
        name=entry["name"],
        is_long=is_long,
        sheet=sheet,
        motion=preview.motion_of_result(found, _conditions_shown(found)),
        more_words=_words_of_more(sheet)
        if sheet.more or any(case.more for case in sheet.cases)
        else "",
        question=forms.question_address(entry["document"]),
    )
    return Markup(html)


def _conditions_shown(result: Mapping[str, Any]) -> tuple[str, ...]:
    """The domain of the displayed formulas; the picture begins there."""
    if "verdict" not in result or stated.is_constrained(result):
        return ()
    return stated.conditions_of(stated.main_statements(result)[0].part)


def _seconds_of(result: Mapping[str, Any]) -> float:
    seconds = (result.get("provenance") or {}).get("seconds") or {}
    return float(
        seconds.get(
            "all", sum(value for value in seconds.values() if isinstance(value, int | float))
        )
    )


def _words_of_more(sheet: sheets.Sheet) -> str:
    """The contents of "More" in one line."""
    told = list(
        dict.fromkeys(
            row.name for row in [*(row for case in sheet.cases for row in case.more), *sheet.more]
        )
    )
    return (
        ", ".join(name.lower() if k else name for k, name in enumerate(told[:5]))
        or "Check your own L"
    )


def exported(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Key and label of the texts that a result has; functions without formulas are symbols of SymPy alone."""
    system, kept = result["system"], tuple(EXPORTS)
    if system is None:
        kept = ("latex", "embed")
    elif system["functions"]:
        kept = ("sympy", "latex", "client", "curl", "embed")
    return [(key, EXPORTS[key][0]) for key in kept]


def python_call(document: Mapping[str, Any], address: str) -> str:
    """The call with the client of this package."""
    return (
        "from inverse_service.client import Client\n\n"
        f"document = {pprint.pformat(dict(document), sort_dicts=False)}\n"
        f"with Client({address!r}) as client:\n"
        "    result = client.solve(document)\n"
        "print(result.verdict, result.lagrangian)\n"
    )


def curl_of(document: Mapping[str, Any], address: str) -> str:
    """The call from a shell."""
    body = json.dumps(document, ensure_ascii=False, indent=1)
    return f"curl -s {shlex.quote(address + '/v1/solve')} -H 'Content-Type: application/json' -d {shlex.quote(body)}\n"


# The answer next to a form.


def glance_task(body: bytes, content_type: str) -> Markup:
    """A short answer to the solve form as HTML, which is not stored; a hint if it takes longer than a glance."""
    return _glance_of_form(body, content_type, VERDICT_SOON)


def rest_task(body: bytes, content_type: str) -> Markup:
    """The same with its formulas, where `glance_task` gave the verdict alone."""
    return _glance_of_form(body, content_type, math.inf)


def _glance_of_form(body: bytes, content_type: str, patience: float) -> Markup:
    sent = forms.sent_task(body, content_type)
    found = None if sent.document is None else glance_of(sent.document, patience)
    return _in_html(found, sent.fields)


def _in_html(glance: Mapping[str, Any] | None, fields: forms.Fields) -> Markup:
    """The glance with the question that it answers, which the page compares with its form."""
    question = [(name, text.strip()) for name, text in fields.items() if text]
    return Markup(rendering.render("glance.html", glance=glance, question=question))


def glance_of_fields(fields: forms.Fields) -> Markup | None:
    """The same for the fields of a link; also None if they cannot be read."""
    try:
        found = glance_of(forms.document_of_fields(fields), VERDICT_SOON)
    except errors.InputError:
        return None
    return None if found is None else _in_html(found, fields)


def has_border(so_far: Mapping[str, Any]) -> bool:
    """Whether what is known of a result holds on one side of a border, beyond which other cases may be to come."""
    return any(" != " not in one for one in so_far.get("domain") or ())


class _Enough(Exception):
    """The results so far suffice for a glance."""


def glance_of(document: Mapping[str, Any], patience: float = math.inf) -> dict[str, Any] | None:
    """The sheet of a document without its proofs, and its motion; None if nothing was decided.

    The work ends with the first L and H that the checker has confirmed, or after `patience` (s of
    processor time) with the verdict, `cut` short of its formulas.
    """
    so_far: dict[str, Any] = {}
    began, known = deadline.now(), set[str]()

    def has_formulas() -> bool:
        return "L" in known and bool(known & {"H", "E"})

    def look(report: Any) -> None:
        if not isinstance(report, Stage):
            so_far.update(report["value"])
            known.clear()
            if not (has_border(so_far) or stated.is_constrained(so_far)):
                sheet = sheets.sheet_of(so_far, length="brief")
                if len(sheet.cases) == 1 and sheet.verdict in (sheets.YES, sheets.NO):
                    known.update("V", *(formula.letter for formula in sheet.cases[0].formulas))
        if has_formulas():
            raise _Enough
        if known and deadline.now() - began > patience:
            raise _Enough

    cut = False
    try:
        found = tasks.solve_task(
            model.split_options(document)[0], SolveOptions(time_limit=GLANCE), look
        )
    except _Enough:
        found, cut = so_far, not has_formulas()
    # What the rest would have told is not called undetermined, or not found.
    sheet = sheets.sheet_of(found, length="brief", grows=found is so_far)
    if sheet.verdict == sheets.OPEN:
        return None
    return {"sheet": sheet, "motion": preview.motion_of_result(found), "cut": cut}
