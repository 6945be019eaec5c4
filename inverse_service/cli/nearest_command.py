"""`inverse-service nearest`: the systems with a Lagrangian that are nearest to a fitted one."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from inverse_service import errors
from inverse_service.cli import command_line as cli, solve_command
from inverse_service.decision.solutions import SolveOptions
from inverse_service.service.documents import printed_pages
from inverse_service.service.jobs import model
from inverse_service.settings import read_settings

Format = StrEnum("Format", "json text latex")


@cli.command(
    "nearest \"x'' = -1.02*x + 0.51*y; y'' = 0.48*x - 0.99*y\" --errors 0.02 --format text"
)
def nearest(
    file: Annotated[
        str,
        typer.Argument(
            help="A document with numbers that were fitted, - for standard input, or the equations themselves."
        ),
    ],
    form: Annotated[
        Format,
        typer.Option("--format", "-f", help=solve_command.FORM, **cli.one_of(Format, "format")),
    ] = Format.json,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help=solve_command.OUTPUT)
    ] = None,
    time_limit: Annotated[float | None, cli.time_limit("from the settings, 60")] = None,
    seed: Annotated[
        int, typer.Option(help="Seed of the starts.", **cli.integer("--seed", 0, 2**31))
    ] = 1,
    spread: Annotated[
        str | None,
        typer.Option(
            "--errors",
            help="Standard errors: one number for all, or a=0.02,b=0.01; without it, changes are relative.",
        ),
    ] = None,
    library: Annotated[
        str | None,
        typer.Option(help="Terms that may be used besides those of the equations: x^2,x*y."),
    ] = None,
    parameters: Annotated[str | None, typer.Option(help="Fitted constants: a=0.31,b=1.02.")] = None,
    coordinates: Annotated[str | None, typer.Option(help=solve_command.COORDINATES)] = None,
    nice: Annotated[
        bool, typer.Option("--nice", help="Also offer nearby systems with simple fractions.")
    ] = False,
) -> cli.ExitCode:
    """The nearest systems with a Lagrangian; the numbers of a document are taken as fitted.

    Exit 0 if one was found and checked, 1 if none was, 2 invalid input, 3 internal error.
    """
    named = {"parameters": parameters, "coordinates": coordinates}
    settings = read_settings()
    document, given = model.split_options(
        solve_command.with_declared(solve_command.given_document(file, None), named)
    )
    if not isinstance(document, dict):
        raise errors.InputError("A fitted system is a JSON object, or its equations.")
    question = document.get("nearest")
    asked = dict(question) if isinstance(question, dict) else {}
    if spread is not None:
        asked["errors"] = _errors(spread)
    if library is not None:
        asked["library"] = _terms(library)
    if nice:
        asked["nice"] = True
    document = {**document, "nearest": asked or True}
    options = model.read_options(
        given, model.JobOptions(time_limit or settings.time_limit, settings.memory_limit, seed)
    )
    solve_command.warm_alone(settings.memory_limit)
    result = solve_command.answered(
        document,
        SolveOptions(seed=options.seed, time_limit=options.time_limit),
        options.memory_limit,
        None,
    )
    if form == "json":
        cli.write(cli.in_json(result), output)
    else:
        cli.write(printed_pages.PRINTERS[form].write(result, False, ""), output)
    return cli.ExitCode.DONE if result.get("nearest") else cli.ExitCode.OPEN


def _terms(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _errors(text: str) -> dict[str, str] | str:
    """The standard errors by name; a single number stands for all coefficients."""
    if "=" not in text:
        return text.strip()
    found = dict[str, str]()
    for part in re.split(r",(?![^()]*\))", text):
        name, _, value = part.rpartition("=")
        if not name.strip() or not value.strip():
            raise errors.InputError(
                f"`{part.strip()[:40]}` is not an error; write them as a=0.02,b=0.01."
            )
        found[name.strip()] = value.strip()
    return found
