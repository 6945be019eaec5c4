"""The commands and their options; the work of each is in a module of its own, loaded when called."""

from __future__ import annotations

import gc
import logging
import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from inverse_service import __version__
from inverse_service.cli import administering, exits

application = typer.Typer(
    name="inverse-service",
    help="Does q'' = f(t, q, q') come from a Lagrangian? A verdict with a proof that a second program checks.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
    rich_markup_mode=None,
)
application.add_typer(administering.admin, name="admin")


# How `solve` writes its result.
Format = StrEnum(
    "Format",
    "json text latex sympy python jax julia modelingtoolkit matlab octave mathematica maple maxima c cpp fortran rust "
    "javascript coq identities",
)


class CatalogueFormat(StrEnum):
    """How `catalogue` writes."""

    json = "json"
    text = "text"


def _version(wanted: bool) -> None:
    if wanted:
        print(f"inverse-service {__version__}")
        raise typer.Exit


@application.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", "-V", help="Show the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Does q'' = f(t, q, q') come from a Lagrangian? A verdict with a proof that a second program checks."""


def _names(incomplete: str) -> list[str]:
    """The names of the catalogue that begin so, for the shell."""
    from inverse_service import catalogue

    return [name for name in catalogue.names() if name.startswith(incomplete)]


Seconds = Annotated[float | None, typer.Option("--time-limit", help="Seconds; default from the settings, 60.")]


def run() -> None:
    """Run the command of this process's arguments and exit."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(encoding="utf-8", errors="replace")
    # What is imported stays: to look through it for garbage again and again takes 0.05 s.
    gc.set_threshold(100_000, 10, 10)
    # Nothing here multiplies large matrices of floats, and threads for it take NumPy 0.05 s to start.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if sys.argv[1:2] != ["serve"]:
        # To look for plugins of pydantic reads the metadata of every installed package, 0.01 s.
        os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if sys.argv[1:] in (["help"], ["version"]):
        sys.argv[1] = f"--{sys.argv[1]}"
    # What goes wrong is said in one sentence; the log with its tracebacks belongs to the service.
    logging.getLogger("inverse_service").addHandler(logging.NullHandler())
    with exits.exit_codes():
        application()


@application.command()
def solve(
    file: Annotated[
        str,
        typer.Argument(
            help="A document (JSON, .yaml, .toml), a file of equations, - for standard input, a name of the catalogue, "
            "or the equations themselves: \"x'' = -k*x\"."
        ),
    ],
    format: Annotated[Format, typer.Option("--format", "-f", help="How to write the result.")] = Format.json,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="A file for the result.")] = None,
    time_limit: Seconds = None,
    seed: Annotated[int, typer.Option(help="Seed of the random points and primes.", min=0, max=2**31)] = 1,
    explain: Annotated[bool, typer.Option("--explain", help="With text and latex: conditions and every step.")] = False,
    special_cases: Annotated[
        bool, typer.Option("--special-cases", help="Also: for which parameters is the verdict another?")
    ] = False,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            help="Also: is there an L of this kind? natural, riemannian, finsler, positive_definite, rayleigh, "
            "invariant:x,y. Repeatable.",
        ),
    ] = None,
    clock: Annotated[
        str | None, typer.Option("--clock", help="Also: is there an L with dtau = N dt? A formula N(q), or search.")
    ] = None,
    guess: Annotated[
        bool | None,
        typer.Option(
            "--guess/--no-guess",
            help="Take undeclared names as constants, and say so; the default for equations on the command line only.",
        ),
    ] = None,
    parameters: Annotated[str | None, typer.Option(help="Names of constants: q,r or q=1/2,r.")] = None,
    functions: Annotated[str | None, typer.Option(help='Arbitrary functions: "V(x,y), f(t)".')] = None,
    coordinates: Annotated[str | None, typer.Option(help="The coordinates, in their order: x,y.")] = None,
    time: Annotated[str | None, typer.Option(help="The name of the independent variable, such as x.")] = None,
    progress: Annotated[bool, typer.Option("--progress", help="A line for each part as it is finished.")] = False,
) -> None:
    """One system to its result. Exit 0 definite verdict, 1 undetermined, 2 bad input, 3 our fault."""
    from inverse_service.cli.solve_command import solve_file

    form = format.value
    named = {"parameters": parameters, "functions": functions, "coordinates": coordinates, "time": time}
    sys.exit(
        solve_file(
            file, form, time_limit, seed, explain, special_cases, guess, kind or (), clock, output, progress, named
        )
    )


@application.command()
def check(
    file: Annotated[
        str, typer.Argument(help="A result or a certificate, as JSON; - is standard input; an .ndjson of a batch.")
    ],
    document: Annotated[
        str | None, typer.Option("--document", help="The system that was given; default the one in the result.")
    ] = None,
    lagrangian: Annotated[
        str | None, typer.Option("--lagrangian", help="A Lagrangian of yours for the system in FILE: is it one?")
    ] = None,
    form: Annotated[
        Literal["text", "json"] | None, typer.Option("--format", help="Default: text on a terminal, else json.")
    ] = None,
    exceptions: Annotated[
        bool, typer.Option("--exceptions", help="Decide the values of parameters that the result leaves out.")
    ] = False,
) -> None:
    """What the independent checker proves of a result, or of a Lagrangian. Exit 0 valid, 1 else, 2 unreadable."""
    from inverse_service.cli.check_command import check_batch, check_exceptions, check_file, check_own, is_batch

    if exceptions:
        sys.exit(check_exceptions(file, form))

    if is_batch(file) and lagrangian is None and document is None:
        sys.exit(check_batch(file))
    sys.exit(check_file(file, document, form) if lagrangian is None else check_own(file, lagrangian, form))


@application.command()
def batch(
    file: Annotated[Path, typer.Argument(help="NDJSON or .gz of it: one System a line, each with its own id; - too.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="NDJSON of results, or .gz of it, that a run goes on; - too.")
    ],
    workers: Annotated[int | None, typer.Option(help="Processes; default one a core.", min=1, max=256)] = None,
    time_limit: Seconds = None,
    cluster: Annotated[str | None, typer.Option(help="Address of a Dask scheduler, such as tcp://host:8786.")] = None,
    again: Annotated[str, typer.Option(help="Also ask again: errors,undetermined of an earlier run.")] = "",
    expect: Annotated[
        Path | None, typer.Option("--expect", help="NDJSON of ids and what their answers should say, such as verdict.")
    ] = None,
    junit: Annotated[
        Path | None, typer.Option("--junit", help="A report in JUnit's XML, one test case a line.")
    ] = None,
) -> None:
    """Many systems, one a line; started again it goes on where it was.

    Exit 0 all answered (and as expected), 1 some error lines or other answers than expected, 2 bad files or nothing
    but errors, 3 our fault, 130 interrupted.
    """
    from inverse_service.cli.batching import batch_file

    sys.exit(batch_file(file, output, workers, time_limit, cluster, again, expect, junit))


@application.command()
def mcp() -> None:
    """Tools for other programs by the Model Context Protocol, on standard input and output (extra `mcp`)."""
    from inverse_service.cli.mcp_command import serve_assistants

    sys.exit(serve_assistants())


@application.command()
def table(
    file: Annotated[Path, typer.Argument(help="The output of a batch: NDJSON or .gz of it; - is standard input.")],
) -> None:
    """The results of a batch as CSV: one row a line, with verdicts, L, H, reason and seconds."""
    from inverse_service.cli.batching import write_table

    sys.exit(write_table(file))


@application.command()
def simulate(
    scene: Annotated[str, typer.Argument(help="A Scene document: JSON, YAML (.yaml) or TOML (.toml); - is JSON.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Directory for CSV, NPZ, figures and summary.json.")
    ] = None,
    time_limit: Annotated[float | None, typer.Option("--time-limit", help="Seconds; default 600.")] = None,
    figures: Annotated[bool, typer.Option(help="Draw figures into the directory.")] = True,
    moving: Annotated[
        Path | None, typer.Option("--animate", help="A moving picture of the first method: FILE.gif or FILE.mp4.")
    ] = None,
) -> None:
    """Integrate a scene by its methods. Exit 1 only if every method failed; `doubt` says where a run is no motion."""
    from inverse_service.cli.simulate_command import simulate_file

    sys.exit(simulate_file(scene, output, time_limit, figures, moving))


@application.command("work-precision")
def work_precision(
    scene: Annotated[str, typer.Argument(help="A Scene document; its methods are run at many steps.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Directory for CSV, JSON and picture.")] = None,
    long: Annotated[bool, typer.Option("--long", help="Also: a hundred times the time, what drifts.")] = False,
    evaluations: Annotated[bool, typer.Option("--evaluations", help="A second panel: force evaluations.")] = False,
    time_limit: Annotated[float | None, typer.Option("--time-limit", help="Seconds; default 300.")] = None,
) -> None:
    """What each error costs by each method of a scene: a table, a picture, all runs."""
    from inverse_service.cli.simulate_command import measure_file

    sys.exit(measure_file(scene, output, time_limit, long, evaluations))


@application.command()
def catalogue(
    name: Annotated[
        str | None, typer.Argument(help="One system; without it, all names.", autocompletion=_names)
    ] = None,
    format: Annotated[CatalogueFormat | None, typer.Option(help="Default: text for the list, json for one.")] = None,
) -> None:
    """The named systems.

    With a NAME, that system as a document that `solve` takes.
    """
    from inverse_service.cli.solve_command import list_catalogue

    sys.exit(list_catalogue(name, None if format is None else format.value))


@application.command()
def warm() -> None:
    """Compile what this machine needs, once, after an installation, so that no question waits for it."""
    from inverse_service.cli.solve_command import warm_alone
    from inverse_service.settings import read_settings

    sys.exit(warm_alone(read_settings().memory_limit))


@application.command()
def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port to listen on.", min=0, max=65535)] = 8000,
) -> None:
    """The HTTP service and its page."""
    from inverse_service.cli.serving import serve_http

    sys.exit(serve_http(host, port))
