"""Pages, pictures and files of results, made inside worker processes, which read the result in the store themselves.

With them: what to try next where an answer stayed open, the tree of special cases, and the texts to take along.
"""

from __future__ import annotations

import gzip
import json
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from starlette.responses import HTMLResponse

from inverse_service.errors import InputError
from inverse_service.reading.reader import equation_line
from inverse_service.service.documents.latex_page import latex_page
from inverse_service.service.documents.text_page import branches_of, common_verdict, motions_of
from inverse_service.service.jobs.model import write_json
from inverse_service.service.jobs.opening import stored_answer
from inverse_service.service.jobs.tasks import check_task
from inverse_service.web.pages import figures, reading_back, shown_results, simulations, steps, typesetting
from inverse_service.web.pages.form_documents import lean_fields, question_address, right_side
from inverse_service.web.pages.glossary import TERMS
from inverse_service.web.pages.rendering import VISITOR, Visitor, can_simulate, page

T = TypeVar("T")
OFFER_TERMS = (
    "Offer terms that L may contain: \u201cChange the system\u201d, then \u201cTerms to try first in L\u201d under "
    "\u201cNames and questions\u201d, for example {}."
)
ONE_QUESTION = "Ask one question instead of two: under \u201cNames and questions\u201d, L(q, q\u2032) alone."
# Of a time limit; what comes after the search takes the rest.
MUCH_OF = 0.8
LONG_RUN = "inverse-service solve --time-limit 3600 system.json"


@dataclass(frozen=True, slots=True)
class Advice:
    """A sentence, the code line that belongs to it, and a button that asks again where `longer` seconds are given."""

    text: str
    code: str = ""
    longer: float | None = None


def advice_for(result: Mapping[str, Any], largest: float) -> list[Advice]:
    """What may settle it; `largest` is the time limit of this service in s. Empty where nothing is open."""
    if result["verdict"] == "undetermined":
        return [*_about_time(result, largest), *_about_size(result)]
    if result["verdict"] == "variational" and result["lagrangian"] is None:
        return [*_about_time(result, largest), Advice(OFFER_TERMS.format(_terms_of(result["system"])))]
    return []


def _terms_of(system: Mapping[str, Any] | None) -> str:
    """Terms in the velocities of this system."""
    first, *others = (system or {}).get("coordinates") or ("x",)
    return f"{others[0]}'^2/{first}'" if others else f"{first}*{first}'^2, {first}'*log({first}')"


def _about_time(result: Mapping[str, Any], largest: float) -> list[Advice]:
    limit = _limit_that_was_hit(result)
    if limit is None:
        return []
    if limit < MUCH_OF * largest:
        return [
            Advice(f"Ask again with more time: this answer had {limit:.2g} s, and the time ran out.", longer=largest)
        ]
    return [Advice("Time ran out. This service gives no more; a machine of your own can.", LONG_RUN)]


def _limit_that_was_hit(result: Mapping[str, Any]) -> float | None:
    """The seconds that the work had, where it used them up; None where it ended by itself."""
    provenance = result["provenance"]
    stopped = (provenance.get("options") or {}).get("time_limit")
    if isinstance(stopped, int | float):
        return stopped if "limit" in result["reason"] else None
    limit, used = provenance.get("time_limit"), (provenance.get("seconds") or {}).values()
    return limit if isinstance(limit, int | float) and sum(used) >= MUCH_OF * limit else None


def _about_size(result: Mapping[str, Any]) -> list[Advice]:
    system, found = result["system"] or {}, []
    if system.get("functions"):
        found.append(Advice("Put one function in the place of each arbitrary one."))
    if system.get("parameters"):
        found.append(Advice("Give values to parameters, such as k = 1/2: numbers are decided faster than letters."))
    if result["verdict_with_time"] is not None and result["question"] == "L(q, q')":
        found.append(Advice(ONE_QUESTION))
    return found or [Advice("Write the equations in other coordinates, or leave out what does not couple.")]


@dataclass(frozen=True, slots=True)
class Look:
    """What a page depends on besides its result: who looks, at which address, and what the service gives."""

    visitor: Visitor
    address: str
    time_limit: float


def page_task(store: str, id: str, job: Mapping[str, Any], look: Look, check: Mapping[str, Any] | None) -> HTMLResponse:
    """The page of a successful job, with the verdict of the checker, or that on a visitor's own L."""
    VISITOR.set(look.visitor)
    document, body = stored_answer(store, id)
    whole = {**job, "result": json.loads(body)}
    if job["kind"] == "solve":
        return solve_result(look, whole, check)
    if job["kind"] == "simulate":
        return simulations.simulation_result(look.address, whole, simulations.pretty(document))
    if job["kind"] == "work-precision":
        return simulations.precision_result(whole, simulations.pretty(document))
    # A job whose result has no page of its own: its JSON.
    return page("plain.html", active="", job=whole, text=simulations.pretty(body))


def so_far_task(job: Mapping[str, Any], visitor: Visitor, waited: int) -> HTMLResponse:
    """The page of a job that has a confirmed answer while more is sought."""
    VISITOR.set(visitor)
    found = job["progress"]["so_far"]
    lines, (answer, _) = shown_results.equations_of(found["system"]), shown_results.shown_of(found, found)
    return page("working.html", active="", job=job, asked=[], waited=waited, equations=lines, main=answer)


def embed_task(store: str, id: str, visitor: Visitor) -> HTMLResponse:
    """The short page of a solved system that other pages show in a frame."""
    VISITOR.set(visitor)
    found = _result(store, id)
    lines = shown_results.equations_of(found["system"]) if found.get("system") else []
    title = shown_results.title_of(found) if "verdict" in found else "Equations of motion"
    return page("embed.html", active="", equations=lines, glance=shown_results.glance_of(found), title=title, id=id)


def own_lagrangian_task(store: str, id: str, text: str) -> dict[str, Any]:
    """The verdict on a visitor's Lagrangian for the equations of a stored result, with the `lagrangian` itself."""
    given = _result(store, id)["system"]["given"]
    try:
        found = check_task(write_json({"system": given, "lagrangian": right_side(text)}))
    except InputError as error:
        reasons = [reading_back.sentence(place) for place in error.places]
        found = {"verdict": "unread", "reasons": reasons, "residual": None, "equations": None}
    return {**found, "lagrangian": text}


def figure_data_task(store: str, id: str) -> bytes:
    """The data of all figures of a simulation, as JSON, which shrinks to a fifth."""
    data = json.dumps(figures.figure_data(_result(store, id)), allow_nan=False)
    return gzip.compress(data.encode(), 5, mtime=0)


def picture_task(store: str, id: str, name: str, ending: str) -> bytes | None:
    """A figure as a file; None where the result does not have it."""
    return figures.picture(_result(store, id), name, ending)


def small_picture_task(store: str, id: str, name: str, pair: Sequence[str], equal: bool) -> str | None:
    """A picture of the gallery; None where there are no points."""
    return figures.small_picture(_result(store, id), name, pair, equal)


def sketch_task(name: str) -> str | None:
    """The sketch of a system of the catalogue; None where there is none."""
    from inverse_service.web.pages.starts import sketch

    return sketch(name)


def file_task(store: str, id: str, label: str, ending: str) -> bytes | None:
    """Every recorded point of a method as a file; None where there are none."""
    from inverse_service.service.scenes.simulating import csv_bytes, every_point, npz_bytes

    text, body = stored_answer(store, id)
    document, found = json.loads(text), json.loads(body)
    columns = every_point(document, found, label)
    if columns is None:
        return None
    return csv_bytes(columns) if ending == "csv" else npz_bytes(columns, document, label, found["provenance"])[0]


def code_task(store: str, id: str, language: str) -> str:
    """A result as a program; SymPy is imported by the first one in a worker, never in the web process."""
    from inverse_service.sympy import from_result

    return from_result(_result(store, id)).to_code(language)


def check_stored_task(store: str, id: str) -> dict[str, Any]:
    """The checker's verdict on a stored result."""
    return check_task(stored_answer(store, id)[1].decode())


def fields_task(store: str, id: str) -> dict[str, str] | None:
    """The solve form filled with the document of a result; None where it has none."""
    given = (_result(store, id).get("system") or {}).get("given")
    return lean_fields(given) if isinstance(given, dict) else None


def part_task(store: str, id: str, choose: Callable[[Any], T]) -> T:
    """What a function finds in a result."""
    return choose(_result(store, id))


def _result(store: str, id: str) -> Any:
    return json.loads(stored_answer(store, id)[1])


def solve_result(look: Look, job: Mapping[str, Any], check: Mapping[str, Any] | None) -> HTMLResponse:
    """The page of a solved system."""
    found, address = job["result"], look.address
    system, names = found["system"], typesetting.names_of(found["system"])
    if "verdict" not in found:
        lines = shown_results.equations_of(system)
        return page("forward.html", active="", job=job, result=found, names=names, equations=lines)
    motions = motions_of(found)
    main, other = shown_results.shown_of(found, found)
    return page(
        "result.html",
        active="",
        title=shown_results.title_of(found),
        question=question_address(system["given"]) if system else "",
        glossary=TERMS,
        address_of_result=f"{address}/results/{job['id']}",
        job=job,
        result=found,
        check=check,
        own=shown_results.own_of(check, names) if check and "lagrangian" in check else None,
        equations=[] if system is None else shown_results.equations_of(system),
        texts=[equation_line(*pair) for pair in (system or {"equations": {}})["equations"].items()],
        main=main,
        other=other,
        branches=[shown_results.shown_of(branch, found) for branch in found.get("branches", ())[1:]],
        further=shown_results.further_of(found),
        names=names,
        cases=found.get("special_cases"),
        motion=motions[0] if motions else None,
        motions=motions,
        motion_steps=[[steps.step_of(step, names, []) for step in one["explanation"]] for one in motions],
        differ=common_verdict(motions or branches_of(found)) == "mixed",
        constrained=found.get("nonholonomic"),
        also=shown_results.other_question(found, main),
        advice=advice_for(found, look.time_limit),
        matrices=steps.matrices_of(found["conditions"], names),
        languages=["sympy"] if system and system["functions"] else LANGUAGES,
        exports=exports(found, address, job["id"]),
        timing=shown_results.timing(found["provenance"]),
        can_simulate=can_simulate() and system is not None,
    )


# Languages of inverse_service.sympy.code, and the endings of their files.
LANGUAGES = {
    "sympy": "py", "python": "py", "julia": "jl", "matlab": "m", "octave": "m", "mathematica": "wl", "maple": "mpl",
    "maxima": "mac", "c": "c", "cpp": "cpp", "fortran": "f90", "rust": "rs", "javascript": "js",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Export:
    """A text to copy; `key` names it in addresses."""

    key: str
    label: str
    text: str


def exports(result: Mapping[str, Any], address: str, identifier: str) -> list[Export]:
    """Every form that this result has; the JSON is a link of its own, being long. `address`: of this service."""
    found = [Export("latex", "LaTeX", latex_page(dict(result), True, f"{address}/results/{identifier}"))]
    if result["system"] is not None:
        given = result["system"]["given"]
        found.append(Export("python", "Python", python_call(given, address)))
        found.append(Export("curl", "curl", curl_of(given, address)))
    return found


def python_call(document: Mapping[str, Any], address: str) -> str:
    """The call with the client of this package."""
    return (
        "from inverse_service.client import Client\n\n"
        f"with Client({address!r}) as client:\n"
        f"    result = client.solve({_python(document)})\n"
        "print(result.verdict, result.lagrangian)\n"
    )


def _python(document: Mapping[str, Any]) -> str:
    lines = [f"        {key!r}: {value!r},\n" for key, value in document.items()]
    return "{\n" + "".join(lines) + "    }"


def curl_of(document: Mapping[str, Any], address: str) -> str:
    """The call from a shell."""
    body = json.dumps(document, ensure_ascii=False, indent=1)
    return f"curl -s {shlex.quote(address + '/v1/solve')} -H 'Content-Type: application/json' -d {shlex.quote(body)}\n"
