"""The help of each command opens with a call that the command takes; wrong words are refused in our
own.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Callable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import Any

import pytest
import typer

from inverse_service import solve
from inverse_service.cli import check_command, command_line as cli, simulate_command, solve_command
from inverse_service.errors import InputError
from inverse_service.service.jobs import batch

cli.load_commands()


def commands(group: Any, *before: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    """(words, command) of all commands, those of `admin` included."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, *before, name)
        else:
            yield (*before, name), command


COMMANDS = dict(commands(typer.main.get_command(cli.application)))


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_the_help_of_a_command_opens_with_a_call_that_it_takes(words: tuple[str, ...]) -> None:
    command = COMMANDS[words]
    first, _, rest = command.help.removeprefix("\b\n").partition("\n")
    called = shlex.split(first.removeprefix("Example: "))
    assert called[: 1 + len(words)] == ["inverse-service", *words]
    assert rest.strip()
    with command.make_context(words[-1], called[1 + len(words) :]):
        pass
    assert command.short_help.endswith(".")
    assert "\n" not in command.short_help


NUMBERS = {
    "--port": "--port must be an integer from 0 to 65535.",
    "--workers": "--workers must be an integer from 1 to 256.",
    "--seed": "--seed must be an integer from 0 to 2147483648.",
    "--time-limit": "--time-limit must be a number of seconds above 0 and at most 86400.",
}


@pytest.mark.parametrize("value", ["", "two", "-1", "1e400", "nan"])
def test_a_number_that_an_option_does_not_take_is_refused_in_our_words(value: str) -> None:
    found = set[str]()
    for words, command in COMMANDS.items():
        called = shlex.split(command.help.splitlines()[1].removeprefix("Example: "))
        for option in {*NUMBERS} & {name for one in command.params for name in one.opts}:
            with pytest.raises(InputError) as refused:
                command.make_context(words[-1], [*called[1 + len(words) :], option, value])
            assert refused.value.detail == NUMBERS[option]
            found.add(option)
    assert found == {*NUMBERS}


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_a_call_that_a_command_does_not_take_is_refused_in_one_sentence(
    words: tuple[str, ...], call: Any
) -> None:
    command = COMMANDS[words]
    right = shlex.split(command.help.splitlines()[1].removeprefix("Example: "))[1:]
    wrong = [[*right, "--colour"], [*right, *"abc"]]
    if any(one.required for one in command.params):
        wrong.append([*words])
    for arguments in wrong:
        code, out, err = call(*arguments)
        assert (code, out, err.count("\n")) == (cli.ExitCode.BAD_INPUT, "", 1)
        assert not {"Usage", "Error", "Try", "Got", "Missing"} & {*err.split()}
        assert err.startswith(f"'{' '.join(words)}' ")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["batch", "systems.ndjson"], "'batch' lacks --output. Example: inverse-service batch "),
        (["admin", "priority", "alice"], "'admin priority' lacks its argument {rank}. Example: "),
        (["batch", "a", "--outptu", "b"], "Did you mean --output?"),
        (["serve", "--port"], "--port needs a value after it"),
        (["admin", "priority", "a", "--batch=yes"], "--batch takes no value"),
        (["solv", "x"], "There is no command 'solv'. Did you mean 'solve'?"),
        (["admin", "statsu"], "Did you mean 'status'?"),
        (["x'' = -x"], "Equations come after 'solve'."),
    ],
)
def test_what_is_wrong_in_a_call_is_named(arguments: list[str], said: str, call: Any) -> None:
    code, out, err = call(*arguments)
    assert (code, out) == (cli.ExitCode.BAD_INPUT, "")
    assert said in err
    assert err.count("\n") == 1


def test_a_group_without_a_command_prints_its_help(call: Any) -> None:
    for arguments, name in ([], "solve"), (["admin"], "drain"):
        code, out, err = call(*arguments)
        assert (code, out) == (cli.ExitCode.BAD_INPUT, "")
        assert f"\n  {name} " in err


def test_all_commands_have_a_help() -> None:
    assert {words[0] for words in COMMANDS} == {*cli.COMMANDS}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: solve_command.given_document("", None), "No system is given: write its equations"),
        (
            lambda: solve_command.given_document("  ", None),
            "No system is given: write its equations",
        ),
        (lambda: batch.open_source(Path("")), "The input has no name"),
        (lambda: cli.read_bytes(""), "The name of the file is empty"),
        (lambda: simulate_command.scene_document(""), "The name of the file is empty"),
        (
            lambda: simulate_command.scene_document("x''=-x"),
            "These are equations, and a scene is a file",
        ),
        (
            lambda: cli.one_of(solve_command.Format, "format")["parser"]("pdf"),
            "There is no format 'pdf': choose one",
        ),
        (
            lambda: cli.one_of(solve_command.Format, "format")["parser"]("latx"),
            "Did you mean 'latex'?",
        ),
    ],
)
def test_a_wrong_call_gets_a_sentence(call: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError) as refused:
        call()
    assert words in refused.value.detail


@pytest.mark.parametrize("formats", [solve_command.Format, simulate_command.SummaryFormat])
def test_each_format_is_taken_by_its_name(formats: type[StrEnum]) -> None:
    assert [cli.one_of(formats, "format")["parser"](name.upper()) for name in formats] == [*formats]


def test_a_batch_without_lines_says_so() -> None:
    assert check_command.summary_sentences(batch.Summary(), 1.0) == [
        "The input has no lines, so there is nothing to answer."
    ]


@pytest.mark.parametrize(("count", "words"), [(1, "1 line in 2.0 s"), (3, "3 lines in 2.0 s")])
def test_one_line_of_a_batch_is_no_lines(count: int, words: str) -> None:
    said = check_command.summary_sentences(batch.Summary(Counter(variational=count)), 2.0)
    assert [sentence for sentence in said if sentence.startswith(words)]


def test_a_terminal_says_the_command_where_a_page_has_a_link() -> None:
    """JSON says that it is for programs; other formats are written to files and say nothing."""
    family = {"equations": "x'' = F(x,y); y'' = -y", "functions": {"F": ["x", "y"]}}
    one, many = solve({"equations": "x'' = -x"}), solve({**family, "first_integrals": False})
    hints = {form: solve_command._hints(dict(many), form) for form in ("text", "json", "latex")}
    assert hints["text"] == ["Decide all members: the same command with --family."]
    assert hints["json"] == ["This is JSON, for programs; -f text is shorter."]
    assert hints["latex"] == solve_command._hints(dict(one), "text") == []


def test_equations_in_a_file_are_not_taken_for_text(tmp_path: Path) -> None:
    named = tmp_path / "x''=-x.json"
    named.write_text('{"steps": 3}')
    assert simulate_command.scene_document(str(named)) == {"steps": 3}
