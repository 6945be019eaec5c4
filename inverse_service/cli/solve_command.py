"""`inverse-service solve`; `catalogue`, the documents that come with the package."""

import functools
import re
import sys
import time as clocks
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any
from unicodedata import normalize

import typer

from api_schemas.system import KINDS_OF_LAGRANGIANS
from inverse_service import catalogue as catalog, errors
from inverse_service.cli import command_line as cli
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import refusals
from inverse_service.kernels.machine_code import code_store
from inverse_service.reading import declarations, reader
from inverse_service.service import compiling
from inverse_service.service.documents import family_maps, growing, plain_data, stated
from inverse_service.service.jobs import model, tasks, workers
from inverse_service.settings import read_settings
from inverse_service.statements.stages import Stage

STAGE_WIDTH, LINE_WIDTH = 78, 118
LINES_AFTER = 1.0  # seconds
_CALLED = re.compile(
    r"[\s\[({]*(?:Eq|Equal|Equality|Derivative)\s*[\[(]"
)  # SymPy's and Mathematica's equations
# Signs of a formula, which the names of files seldom have, and the end of the name of a file.
_NO_FILE, _EXTENSION = re.compile(r"[\s()\[\]{}<>$\\'\"^*@%#]"), re.compile(r"\.\w{1,8}$")
_ACCELERATED = re.compile("''|\u2033|\\\\ddot|[^AOUaou]\u0308")  # no umlaut of a file's name
_MAY_BE_JSON = re.compile(r'\{|\s*[\[{"].*=', re.DOTALL)
PROOFS = ("coq", "identities")
_DECLARED_BY = {
    "parameters": "name it with --parameters",
    "coordinates": "name it with --coordinates",
    "functions": 'declare a function of your own, as in --functions "F(x)"',
}
# Options that `nearest` has, too.
FORM, OUTPUT = "How to write the result.", "A file for the result."
COORDINATES = "The coordinates, in their order: x,y."
# How `solve` writes its result.
Format = StrEnum(
    "Format",
    "json text latex sympy python jax julia modelingtoolkit matlab octave mathematica maple maxima c cpp fortran rust "
    "javascript coq identities",
)
CatalogueFormat = StrEnum("CatalogueFormat", "json text")


@cli.command("solve \"x'' = -x - c*x'\" --format text")
def solve(
    file: Annotated[
        str,
        typer.Argument(
            help="A document (JSON, .yaml, .toml), a file of equations, - for standard input, a name in the catalogue, "
            "or the equations themselves: \"x'' = -k*x\"."
        ),
    ],
    form: Annotated[
        Format,
        typer.Option("--format", "-f", help=FORM, **cli.one_of(Format, "format")),
    ] = Format.json,
    output: Annotated[Path | None, typer.Option("--output", "-o", help=OUTPUT)] = None,
    time_limit: Annotated[float | None, cli.time_limit("from the settings, 60")] = None,
    seed: Annotated[
        int,
        typer.Option(
            help="Seed of the random points and primes.", **cli.integer("--seed", 0, 2**31)
        ),
    ] = 1,
    explain: Annotated[
        bool, typer.Option("--explain", help="Print conditions and every step (text, latex).")
    ] = False,
    family: Annotated[
        bool,
        typer.Option("--family", help="Also find which values and functions leave a Lagrangian."),
    ] = False,
    letters: Annotated[
        str | None,
        typer.Option(help="The constants and functions of the family: a,b; the default is all."),
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option(help="A file for the map of the family by two constants: map.svg."),
    ] = None,
    special_cases: Annotated[bool, typer.Option("--special-cases", hidden=True)] = False,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            help=f"Also test for an L of this type: {', '.join(KINDS_OF_LAGRANGIANS)}, invariant:x,y. Repeatable.",
        ),
    ] = None,
    clock: Annotated[
        str | None,
        typer.Option(
            "--clock", help="Also test for an L with dtau = N dt: a formula N(q), or search."
        ),
    ] = None,
    guess: Annotated[
        bool | None,
        typer.Option(
            "--guess/--no-guess",
            help="Take undeclared names as constants, and say so; the default where no names are declared.",
        ),
    ] = None,
    parameters: Annotated[
        str | None, typer.Option(help="Names of constants: q,r or q=1/2,r.")
    ] = None,
    functions: Annotated[
        str | None, typer.Option(help='Arbitrary functions: "V(x,y), f(t)".')
    ] = None,
    coordinates: Annotated[str | None, typer.Option(help=COORDINATES)] = None,
    time: Annotated[
        str | None, typer.Option(help="The name of the independent variable, such as x.")
    ] = None,
    progress: Annotated[
        bool | None,
        typer.Option(
            help="A line for each part as it is finished; the default on a terminal, after a second."
        ),
    ] = None,
) -> cli.ExitCode:
    """Solve one system. Exit 0 definite verdict, 1 undetermined, 2 invalid input, 3 internal error."""
    named = {
        "parameters": parameters,
        "functions": functions,
        "coordinates": coordinates,
        "time": time,
    }
    asked_too = {
        "family": letters or family or special_cases or figure is not None or None,
        "kinds": kind or None,
        "clock": clock,
    }
    settings = read_settings()
    document, given = model.split_options(
        with_declared(given_document(file, guess), named | asked_too)
    )
    asked = model.read_options(
        given, model.JobOptions(time_limit or settings.time_limit, settings.memory_limit, seed)
    )
    warm_alone(settings.memory_limit)
    options = SolveOptions(seed=asked.seed, time_limit=asked.time_limit)
    try:
        result = answered(document, options, asked.memory_limit, progress)
    except errors.InputError as error:
        detail = error.detail if cli.is_file(file) else _by_options(error)
        raise errors.InputError(detail, error.pointer, error.column) from None
    if figure is not None:
        cli.write(_map_of(result), figure)
    cli.write(
        _proof(result, form, asked) if form in PROOFS else _written(result, form, explain), output
    )
    if output is None and sys.stdout.isatty():
        for hint in _hints(result, form):
            print(hint, file=sys.stderr)
    for words in _taken(result):
        print(f"{words[:1].upper()}{words[1:]}.", file=sys.stderr)
    return cli.ExitCode.OPEN if _is_open(result) else cli.ExitCode.DONE


def _map_of(result: Mapping[str, Any]) -> str:
    """The map of a family as SVG; InputError where it has fewer than two constants."""
    if len(family_maps.letters_of(result)) >= family_maps.AXES:
        shown = family_maps.map_of(result, *family_maps.plane_of(result), {})
        if shown is not None:
            return family_maps.svg_of(shown)
    raise errors.InputError(
        "A map needs a family in two constants: name them with --letters a,b.", "/family/letters"
    )


def _by_options(error: errors.InputError) -> str:
    """The sentence with the option that declares a name for the member of a document that does."""
    if not error.declare:
        return error.detail
    return error.detail.replace(refusals.DECLARING[error.declare], _DECLARED_BY[error.declare])


def _taken(result: Mapping[str, Any]) -> list[str]:
    """How names that the document did not declare were taken, in one line; none where all were declared."""
    functions = (result["system"] or {}).get("functions", {})
    names = result.get("guessed") or []
    taken = {
        "as constants": [name for name in names if name not in functions],
        "as arbitrary functions": [
            f"{name}({', '.join(functions[name])})" for name in names if name in functions
        ],
    }
    parts = [f"taken {how}: {', '.join(found)}" for how, found in taken.items() if found]
    read = [
        f"{note['text']} as {note['as']}"
        for note in result.get("readings") or []
        if note["as"] != reader.LEFT_OUT
    ]
    left = [note["text"] for note in result.get("readings") or [] if note["as"] == reader.LEFT_OUT]
    lines = [f"not declared, {'; '.join(parts)}"] * bool(parts) + [
        f"read {', '.join(read)}"
    ] * bool(read)
    return lines + [f"left out: {', '.join(left)}"] * bool(left)


def kind_of_option(text: str) -> str | dict[str, list[str]]:
    """natural as it is, invariant:x,y as the document has it."""
    name, _, coordinates = text.partition(":")
    return {name: [part.strip() for part in coordinates.split(",")]} if coordinates else text


def _is_open(result: dict[str, Any]) -> bool:
    """Whether a verdict is missing: about the motion where a nonholonomic document names no
    associated system.

    Or a cell has no answer.
    """
    given = (result.get("system") or {"given": {}})["given"]
    named = given.get("associated") not in (None, "any") or given.get("multiples")
    answers = ([] if named else growing.motions_of(result)) or [result, *result.get("branches", ())]
    return bool(stated.open_cells_of(result)) or any(
        answer.get("verdict") == "undetermined" for answer in answers
    )


def warm_alone(memory_limit: int) -> None:
    """Compile missing kernels in a separate process before any time limit starts; report it on standard error."""
    say = functools.partial(print, file=sys.stderr, flush=True)
    code_store.warm_first(
        say, lambda: workers.run_alone(compiling.warm_up, (), compiling.PATIENCE, memory_limit)
    )


def given_document(name: str, guess: bool | None) -> Any:
    """The document of a file, of standard input (-), of equations given on the command line, or of
    the catalogue.

    `guess`: whether undeclared names are constants; if None, they are for equations on the command
    line, and in any document that declares no names (see `accepting.prepared`).
    """
    if not name.strip():
        detail = "No system is given: write its equations, the name of a file or of a system of the catalogue, or -."
        raise errors.InputError(detail)
    if name == "-" or cli.is_file(name):
        document = cli.read_document(name)
    elif (
        "=" in name
        or name.startswith("{")
        or _CALLED.match(name)
        or _ACCELERATED.search(normalize("NFD", name))
        or (_NO_FILE.search(name) and not _EXTENSION.search(name))
    ):
        document = (
            plain_data.read_document(name, "") if _MAY_BE_JSON.match(name) else {"equations": name}
        )
        if guess is None and "equations" in document and "parameters" not in document:
            guess = True
    elif catalog.meant(name):
        document = catalog.document(name)
    else:
        document = cli.read_document(name)
    if not isinstance(document, dict):
        return document
    if guess is False and not document.keys() & {*declarations.DECLARING}:
        return {**document, "parameters": []}  # a document that declares nothing would be guessed
    return declarations.with_guess(document) if guess else document


def with_declared(document: Any, named: Mapping[str, Any]) -> Any:
    """The document with what the options declare and ask; None where one was not given."""
    given = {key: text for key, text in named.items() if text is not None}
    if not given or not isinstance(document, dict):
        return document
    found = document | given
    if "kinds" in given:
        found["kinds"] = [*document.get("kinds", ()), *map(kind_of_option, given["kinds"])]
    if "functions" in given:
        found["functions"] = {
            **document.get("functions", {}),
            **declarations.functions_of(given["functions"]),
        }
    if "parameters" in given:
        before = document.get("parameters") or ()
        before = [declarations.AND_GUESS] if before == declarations.GUESS else before
        earlier = before if isinstance(before, dict) else dict.fromkeys(before)
        found["parameters"] = {**declarations.parameters_of(given["parameters"]), **earlier}
    if isinstance(given.get("family"), str):
        names = [name.strip() for name in given["family"].split(",")]
        known = found.get("functions") or {}
        functions = {name: known[name] for name in names if name in known}
        found["family"] = {
            "letters": [name for name in names if name not in known],
            "functions": functions,
        }
    return found


def answered(
    document: Any, options: SolveOptions, memory_limit: int, progress: bool | None
) -> dict[str, Any]:
    """The result, or what is finished of it where a limit ended the process."""
    shown = _Shown(progress, sys.stderr.isatty())
    outcome = workers.run_alone(
        tasks.solve_task, (document, options), options.time_limit, memory_limit, shown.report
    )
    shown.clear()
    if outcome.status == "done":  # the schemas of what follows take 0.06 s to load
        found: dict[str, Any] = outcome.value
        shown.rest(found)
        return found
    from inverse_service.service.documents.answers import (
        UNDERSTAND_DEADLINE,
        result_document,
        with_understood,
    )

    if outcome.status in ("deadline", "memory") and shown.so_far is None:
        understood = workers.run_alone(
            tasks.understand_task, (document,), UNDERSTAND_DEADLINE, memory_limit
        )
        outcome = with_understood(outcome, understood)
    return result_document(outcome, options, memory_limit, shown.so_far)


class _Shown:
    """Report progress on standard error: the stage on the last line of a terminal, a line for each
    part.

    On a terminal (`stages`) the lines begin after LINES_AFTER seconds, unless `parts` says
    otherwise: a quick answer stands alone.
    """

    def __init__(self, parts: bool | None, stages: bool) -> None:
        self._parts, self._stages = stages if parts is None else parts, stages
        self._from = LINES_AFTER if parts is None else 0.0
        self._began = clocks.monotonic()
        self._finished, self._told = dict[str, None](), set[str]()
        self.so_far: dict[str, Any] | None = None

    def report(self, value: Any) -> None:
        """A stage, or parts that are finished."""
        if isinstance(value, Stage):
            if self._stages:
                show_stage(value.text)
            self._say()
            return
        self.so_far = growing.grown(self.so_far or {}, value)
        self._finished |= dict.fromkeys(value["parts"])
        self._say()

    def rest(self, result: Mapping[str, Any]) -> None:
        """The parts that came with the end."""
        missing = {entry["part"] for entry in result.get("incomplete", ())}
        self.so_far = {"so_far": result}
        self._finished |= dict.fromkeys(part for part in summaries(result) if part not in missing)
        if self._told or not self._from:
            self._say()

    def clear(self) -> None:
        """No stage is left on the terminal."""
        if self._stages:
            show_stage("")

    def _say(self) -> None:
        taken = clocks.monotonic() - self._began
        if not self._parts or taken < self._from or self.so_far is None:
            return
        texts = summaries(self.so_far["so_far"])
        for part in (part for part in self._finished if part in texts and part not in self._told):
            self._told.add(part)
            self.clear()
            line = f"{taken:7.2f} s  {part.replace('_', ' ')}: {texts[part]}"
            print(
                line if len(line) <= LINE_WIDTH else f"{line[: LINE_WIDTH - 3]}...",
                file=sys.stderr,
                flush=True,
            )


def summaries(result: Mapping[str, Any]) -> dict[str, str]:
    """What one line says of each part that a result has, in the order of wanting."""
    timed, about, reduced = (
        result.get(key) or {} for key in ("with_time", "any_associated", "reduced")
    )
    clock, formulas = result.get("with_clock") or {}, ("lagrangian", "hamiltonian")
    steps = len(result.get("explanation") or ())
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
        "kinds": ", ".join(
            f"{name} {part['verdict']}" for name, part in (result.get("kinds") or {}).items()
        )
        or None,
        "first_integrals": ", ".join(one["name"] for one in result.get("first_integrals") or ())
        or None,
        "explanation": f"{steps} step{'s' * (steps > 1)}" if steps else None,
    }
    return {
        part: text.replace("not_variational", "not variational")
        for part, text in texts.items()
        if text
    }


def show_stage(text: str) -> None:
    """The stage on the last line of the terminal, in the place of the one before."""
    sys.stderr.write(f"\r\x1b[K{text[:STAGE_WIDTH]}")
    sys.stderr.flush()


def _proof(result: dict[str, Any], form: str, asked: model.JobOptions) -> str:
    """The verdict for another prover, also computed in a separate process."""
    outcome = workers.run_alone(
        tasks.proof_task, (result, form, asked.seed), asked.time_limit, asked.memory_limit
    )
    if outcome.status in ("deadline", "memory"):
        raise errors.InputError("No proof was written within the limits of time and memory.")
    if outcome.status != "done":
        raise RuntimeError(outcome.detail or outcome.status)
    return str(outcome.value)


def _written(result: dict[str, Any], form: str, explain: bool) -> str:
    if form == "json":
        return cli.in_json(result)
    from inverse_service.service.documents.printed_pages import PRINTERS

    if form in PRINTERS:
        return PRINTERS[form].write(result, explain, "")
    from inverse_service.sympy import from_result

    return from_result(result).to_code(form)


def _hints(result: dict[str, Any], form: str) -> list[str]:
    """What a terminal says besides: where the links of a page are commands."""
    if form == "json":
        return ["This is JSON, for programs; -f text is shorter."]
    if form != "text":
        return []
    from inverse_service.service.documents.printed_pages import further_questions

    return [f"{words}: the same command with --family." for words in further_questions(result)]


def _names(incomplete: str) -> list[str]:
    """The names of the catalogue that begin so, for the shell."""
    return [name for name in catalog.names() if name.startswith(incomplete)]


@cli.command("catalogue sho")
def catalogue(
    name: Annotated[
        str | None, typer.Argument(help="One system; without it, all names.", autocompletion=_names)
    ] = None,
    form: Annotated[
        CatalogueFormat | None,
        typer.Option(
            "--format",
            help="Default: text for the list, json for one.",
            **cli.one_of(CatalogueFormat, "format"),
        ),
    ] = None,
) -> cli.ExitCode:
    """The named systems.

    With a NAME, that system as a document that `solve` takes.
    """
    if name is None:
        entries = [catalog.entry(each) for each in catalog.names()]
        width = max((len(entry["name"]) for entry in entries), default=0)
        lines = [f"{entry['name']:<{width}}  {entry.get('title', '')}" for entry in entries]
        plain = {
            "systems": [
                {key: entry.get(key, "") for key in ("name", "title", "group")} for entry in entries
            ]
        }
        text = cli.in_json(plain) if form == "json" else "\n".join(lines) + "\n"
    else:
        entry = catalog.entry(name)
        expected = [
            (key, value)
            for key, value in entry.get("expected", {}).items()
            if isinstance(value, str)
        ]
        lines = [entry.get("title", name), f"source: {entry.get('source', '')}"]
        lines += [f"expected: {key} = {value}" for key, value in expected]
        text = "\n".join([*(lines if form == "text" else ()), cli.in_json(entry["document"])])
    cli.write(text)
    return cli.ExitCode.DONE
