"""`inverse-service solve`, and `catalogue`, the documents that come with the package."""

from __future__ import annotations

import functools
import json
import re
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from inverse_service import catalogue, errors
from inverse_service.cli import exits
from inverse_service.decision.solutions import SolveOptions
from inverse_service.reading import document_names
from inverse_service.service.documents import plain_data
from inverse_service.service.jobs import model, tasks, warming, workers
from inverse_service.settings import read_settings

MAX_TIME_LIMIT = 86_400.0
STAGE_WIDTH, LINE_WIDTH = 78, 118
_CALLED = re.compile(r"[\s\[({]*(?:Eq|Equal|Equality|Derivative)\s*[\[(]")  # SymPy's and Mathematica's equations
PROOFS = ("coq", "identities")


def solve_file(
    name: str,
    form: str,
    time_limit: float | None,
    seed: int,
    explain: bool,
    special_cases: bool = False,
    guess: bool | None = None,
    kinds: Sequence[str] = (),
    clock: str | None = None,
    output: Path | None = None,
    progress: bool = False,
    named: Mapping[str, str | None] | None = None,
) -> exits.ExitCode:
    """Solve the document in a process of its own and print the result, or write it to a file.

    `progress`: a line on standard error for each part as it is finished. `named` declares names, as a document does.
    """
    settings = read_settings()
    limit = time_limit_or(settings.time_limit, time_limit)
    document, given = model.split_options(with_declared(given_document(name, guess), named or {}))
    asked = model.read_options(given, model.JobOptions(limit, settings.memory_limit, seed))
    if special_cases and isinstance(document, dict):
        document = {**document, "special_cases": True}
    if kinds and isinstance(document, dict):
        document = {**document, "kinds": [*document.get("kinds", ()), *map(kind_of_option, kinds)]}
    if clock is not None and isinstance(document, dict):
        document = {**document, "clock": clock}
    warm_alone(settings.memory_limit)
    options = SolveOptions(seed=asked.seed, time_limit=asked.time_limit)
    result = _solve(document, options, asked.memory_limit, progress)
    exits.write(_proof(result, form, asked) if form in PROOFS else _written(result, form, explain), output)
    if form == "json" and output is None and sys.stdout.isatty():
        print("This is JSON, for programs; -f text is shorter.", file=sys.stderr)
    if (result.get("guessed") or result.get("readings")) and form != "text":
        _say_what_was_guessed(result)
    return exits.ExitCode.OPEN if _is_open(result) else exits.ExitCode.DONE


def _say_what_was_guessed(result: dict[str, Any]) -> None:
    from inverse_service.service.documents.text_page import guessed_words

    for words in guessed_words(result):
        print(f"{words[:1].upper()}{words[1:]}.", file=sys.stderr)


def kind_of_option(text: str) -> str | dict[str, list[str]]:
    """natural as it is, invariant:x,y as the document has it."""
    name, _, coordinates = text.partition(":")
    return {name: [part.strip() for part in coordinates.split(",")]} if coordinates else text


def _is_open(result: dict[str, Any]) -> bool:
    """Whether a verdict is missing: about the motion where a nonholonomic document names no associated system.

    Or a cell has no answer.
    """
    given = (result.get("system") or {"given": {}})["given"]
    named = given.get("associated") not in (None, "any") or given.get("multiples")
    from inverse_service.service.documents.text_page import motions_of

    answers = ([] if named else motions_of(result)) or [result, *result.get("branches", ())]
    return bool(result.get("not_answered")) or any(answer.get("verdict") == "undetermined" for answer in answers)


def warm_alone(memory_limit: int) -> exits.ExitCode:
    """Compile what is missing in a process of its own, before any clock starts; said on standard error."""
    say = functools.partial(print, file=sys.stderr, flush=True)
    warming.warm_first(say, lambda: workers.run_alone(warming.warm_up, (), warming.PATIENCE, memory_limit))
    return exits.ExitCode.DONE


def given_document(name: str, guess: bool | None) -> Any:
    """The document of a file, of standard input (-), of equations given as they are, or of the catalogue.

    `guess`: whether undeclared names are constants; left out, they are where equations are given as they are.
    """
    if name == "-" or _is_file(name):
        document = plain_data.read_document(exits.read_bytes(name), name)
    elif "=" in name or "''" in name or name.startswith("{") or _CALLED.match(name):
        document = plain_data.read_document(name, "") if "=" in name or name.startswith("{") else {"equations": name}
        guess = guess if guess is not None else "equations" in document and "parameters" not in document
    elif name in catalogue.names():
        document = catalogue.document(name)
    else:
        document = plain_data.read_document(exits.read_bytes(name), name)
    return with_guess(document) if guess and isinstance(document, dict) else document


def with_declared(document: Any, named: Mapping[str, str | None]) -> Any:
    """The document with the names of the options --parameters, --functions, --coordinates and --time."""
    given = {key: text for key, text in named.items() if text is not None}
    if not given or not isinstance(document, dict):
        return document
    found = document | given
    if "functions" in given:
        calls = re.findall(r"([^\s(),;]+)\s*\(([^()]*)\)", given["functions"])
        found["functions"] = {**document.get("functions", {}), **dict(calls)}
    if "parameters" in given:
        words = [word for word in re.split(r"[,;\s]+", re.sub(r"\s*=\s*", "=", given["parameters"])) if word]
        values = {name: value or None for name, _, value in (word.partition("=") for word in words)}
        before = document.get("parameters") or ()
        earlier = (
            before
            if isinstance(before, dict)
            else dict.fromkeys([document_names.AND_GUESS] if before == document_names.GUESS else before)
        )
        found["parameters"] = {**values, **earlier}
    return found


def with_guess(document: dict[str, Any]) -> dict[str, Any]:
    """The same document, its undeclared names taken as constants."""
    named = document.get("parameters") or ()
    if isinstance(named, dict):
        return document | {"parameters": {**named, document_names.AND_GUESS: None}}
    return document | {
        "parameters": [*named, document_names.AND_GUESS] if isinstance(named, list) and named else document_names.GUESS
    }


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError):  # too long, or with a character that no name has
        return False


def time_limit_or(default: float, given: float | None) -> float:
    """The time limit that was given, or the default; raises InputError where it is no such time."""
    limit = default if given is None else given
    if not 0 < limit <= MAX_TIME_LIMIT:
        raise errors.InputError(f"--time-limit must be a number of seconds above 0 and at most {MAX_TIME_LIMIT:.0f}.")
    return limit


def _solve(document: Any, options: SolveOptions, memory_limit: int, progress: bool) -> dict[str, Any]:
    """The result, or what is finished of it where a limit ended the process."""
    shown = _Shown(progress, sys.stderr.isatty())
    outcome = workers.run_alone(tasks.solve_task, (document, options), options.time_limit, memory_limit, shown.report)
    shown.clear()
    if outcome.status == "done":  # the schemas of what follows take 0.06 s to load
        found: dict[str, Any] = outcome.value
        shown.rest(found)
        return found
    from inverse_service.service.documents.answers import UNDERSTAND_DEADLINE, result_document, with_understood

    if outcome.status in ("deadline", "memory") and shown.so_far is None:
        understood = workers.run_alone(tasks.understand_task, (document,), UNDERSTAND_DEADLINE, memory_limit)
        outcome = with_understood(outcome, understood)
    return result_document(outcome, options, memory_limit, shown.so_far)


class _Shown:
    """What is told of the work, on standard error: the stage on the last line of a terminal, a line for each part."""

    def __init__(self, parts: bool, stages: bool) -> None:
        self._parts, self._stages = parts, stages
        self._began, self._told = time.monotonic(), set[str]()
        self.so_far: dict[str, Any] | None = None

    def report(self, value: Any) -> None:
        """A stage, or parts that are finished."""
        if isinstance(value, str):
            if self._stages:
                show_stage(value)
            return
        before = {} if self.so_far is None else self.so_far["so_far"]
        self.so_far = {"so_far": before | value["value"], "seconds": value["seconds"]}
        self._say(value["parts"], self.so_far["so_far"])

    def rest(self, result: Mapping[str, Any]) -> None:
        """The parts that came with the end."""
        missing = {entry["part"] for entry in result.get("incomplete", ())}
        self._say([part for part in summaries(result) if part not in missing], result)

    def clear(self) -> None:
        """No stage is left on the terminal."""
        if self._stages:
            show_stage("")

    def _say(self, parts: Iterable[str], found: Mapping[str, Any]) -> None:
        for part in (part for part in parts if self._parts and part not in self._told):
            self._told.add(part)
            self.clear()
            text = summaries(found).get(part, "")
            line = f"{time.monotonic() - self._began:7.2f} s  {part.replace('_', ' ')}{': ' if text else ''}{text}"
            print(line if len(line) <= LINE_WIDTH else f"{line[: LINE_WIDTH - 3]}...", file=sys.stderr, flush=True)


def summaries(result: Mapping[str, Any]) -> dict[str, str]:
    """What one line says of each part that a result has, in the order of wanting."""
    timed, about, reduced = (result.get(key) or {} for key in ("with_time", "any_associated", "reduced"))
    clock, formulas = result.get("with_clock") or {}, ("lagrangian", "hamiltonian")
    texts = {
        "motion": "found" if result.get("nonholonomic") else None,
        "conditions": "written out" if result.get("conditions") else None,
        "existence": result.get("verdict"),
        "existence_with_time": result.get("verdict_with_time"),
        "certificate": result.get("checked"),
        **{part: (result.get(part) or {}).get("text") for part in formulas},
        "lagrangian_with_time": (timed.get("lagrangian") or {}).get("text"),
        "any_associated": about.get("verdict"),
        "reduced": reduced.get("verdict"),
        "clock": clock.get("verdict"),
        "kinds": ", ".join(f"{name} {part['verdict']}" for name, part in (result.get("kinds") or {}).items()) or None,
        "explanation": f"{len(result['explanation'])} steps" if result.get("explanation") else None,
    }
    return {part: text.replace("_", " ") for part, text in texts.items() if text}


def show_stage(text: str) -> None:
    """The stage on the last line of the terminal, in the place of the one before."""
    sys.stderr.write(f"\r\x1b[K{text[:STAGE_WIDTH]}")
    sys.stderr.flush()


def _proof(result: dict[str, Any], form: str, asked: model.JobOptions) -> str:
    """The verdict for another prover, worked out in a process of its own too."""
    outcome = workers.run_alone(tasks.proof_task, (result, form, asked.seed), asked.time_limit, asked.memory_limit)
    if outcome.status in ("deadline", "memory"):
        raise errors.InputError("No proof was written within the limits of time and memory.")
    if outcome.status != "done":
        raise RuntimeError(outcome.detail or outcome.status)
    return str(outcome.value)


def _written(result: dict[str, Any], form: str, explain: bool) -> str:
    if form == "json":
        return json.dumps(result, ensure_ascii=False, indent=2) + "\n"
    if form not in ("text", "latex"):
        from inverse_service.sympy import from_result

        return from_result(result).to_code(form)
    if form == "latex":
        from inverse_service.service.documents.latex_page import latex_page

        return latex_page(result, explain)
    from inverse_service.service.documents.text_page import text_page

    return text_page(result, explain)


def list_catalogue(name: str | None, form: str | None) -> exits.ExitCode:
    """Print the list of names, or one system; raises InputError for a name that is not there."""
    exits.write((_all(form or "text") if name is None else _one(name, form or "json")) + "\n")
    return exits.ExitCode.DONE


def _all(form: str) -> str:
    entries = [catalogue.entry(name) for name in catalogue.names()]
    if form == "json":
        lines = [{key: entry.get(key, "") for key in ("name", "title", "group")} for entry in entries]
        return json.dumps({"systems": lines}, ensure_ascii=False, indent=2)
    width = max((len(entry["name"]) for entry in entries), default=0)
    return "\n".join(f"{entry['name']:<{width}}  {entry.get('title', '')}" for entry in entries)


def _one(name: str, form: str) -> str:
    entry = catalogue.entry(name)
    document = entry["document"]
    if form == "json":
        return json.dumps(document, ensure_ascii=False, indent=2)
    lines = [entry.get("title", name), f"source: {entry.get('source', '')}"]
    lines += [
        f"expected: {key} = {value}" for key, value in entry.get("expected", {}).items() if isinstance(value, str)
    ]
    return "\n".join([*lines, json.dumps(document, ensure_ascii=False, indent=2)])
