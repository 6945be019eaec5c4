"""Write docs/inverse-service.1, the page that `man inverse-service` shows: `make reference`."""

from __future__ import annotations

from typer.testing import CliRunner

from inverse_service import __version__
from inverse_service.cli import command_line
from tests.docs.blocks import ROOT

PAGE = ROOT / "docs" / "inverse-service.1"
WIDTH = "80"


def manual() -> str:
    """The page in the macros of man(7): the help of the program and of each command, as it is.

    The list of commands is left out: its order is that in which their modules were loaded.
    """
    command_line.load_commands()
    parts = [
        f'.TH INVERSE-SERVICE 1 "" "inverse-service {__version__}" "User commands"',
        *(
            ".SH NAME",
            r"inverse-service \- Lagrangians of second-order systems, decided and proven",
        ),
        *(".SH SYNOPSIS", r"\fBinverse-service\fR \fICOMMAND\fR [OPTIONS] [ARGUMENTS]"),
        *(".SH DESCRIPTION", ".nf", _help().partition("Commands:")[0].rstrip(), ".fi"),
        ".SH COMMANDS",
    ]
    for name in command_line.COMMANDS:
        parts += [f".SS {_plain(name)}", ".nf", _help(name), ".fi"]
    return (
        "\n".join([*parts, ".SH SEE ALSO", "docs/index.md of the sources; inverse\\-service serve"])
        + "\n"
    )


def _help(*words: str) -> str:
    found = CliRunner().invoke(
        command_line.application,
        [*words, "--help"],
        prog_name="inverse-service",
        env={"COLUMNS": WIDTH, "TERMINAL_WIDTH": WIDTH},
    )
    assert found.exit_code == 0, found.output
    lines = _plain(found.output).strip().splitlines()
    return "\n".join(rf"\&{line}" if line[:1] in ("'", ".") else line for line in lines)


def _plain(text: str) -> str:
    return text.replace("\\", "\\e").replace("-", "\\-")


def main() -> None:
    PAGE.write_text(manual(), encoding="utf-8")


if __name__ == "__main__":
    main()
