"""Send one document through one interface and return the result in the form of the Python
interface.
"""

import contextlib
import io
import json
import sys
from dataclasses import dataclass
from typing import Any
from unittest import mock

import httpx

import inverse_service
from inverse_service.cli.command_line import run

JSON = {"Content-Type": "application/json"}


@dataclass(frozen=True)
class Refusal:
    """An error: what is wrong, where, and what to write instead."""

    detail: str
    pointer: str
    column: int | None
    instead: tuple[str, ...]


def solve(document: Any, door: str, service: str | None = None) -> Any:
    """Return the result as a dictionary, or a Refusal. A text document is passed unchanged."""
    if door == "python":
        return _by_python(document)
    body = document if isinstance(document, str) else json.dumps(document)
    return _by_command(body) if door == "command line" else _by_http(body, str(service))


def check(result: dict[str, Any], door: str, service: str | None = None) -> str:
    """The verdict of the independent checker through the same interface."""
    text = json.dumps(result)
    if door == "python":
        verdict: str = inverse_service.check(text)["verdict"]
    elif door == "http":
        verdict = httpx.post(f"{service}/v1/check", content=text, headers=JSON, timeout=120).json()[
            "verdict"
        ]
    else:
        code, out, err = command("check", "-", given=text)
        verdict = "valid" if code == 0 else f"{out} {err}"
    return verdict


def command(*arguments: str, given: str = "") -> tuple[int, str, str]:
    """Run the command in this process; return (exit code, standard output, standard error)."""
    out, err = io.StringIO(), io.StringIO()
    streams = (contextlib.redirect_stdout(out), contextlib.redirect_stderr(err))
    stdin = io.TextIOWrapper(io.BytesIO(given.encode("utf-8", "surrogatepass")))
    argv = mock.patch.object(sys, "argv", ["inverse-service", *arguments])
    with argv, mock.patch.object(sys, "stdin", stdin), streams[0], streams[1]:
        try:
            run()
            code = 0
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, out.getvalue(), err.getvalue()


def _by_python(document: Any) -> Any:
    try:
        return dict(inverse_service.solve(document, time_limit=120.0))
    except inverse_service.InputError as error:
        return Refusal(error.detail, error.pointer, error.column, error.instead)


def _by_command(body: str) -> Any:
    code, out, err = command("solve", "-", "--format", "json", "--time-limit", "120", given=body)
    if code == 2:
        assert out == ""
        assert "Traceback" not in err
        pointer = err.split(" ", 1)[0].rstrip(":") if err.startswith("/") else ""
        return Refusal(err.removesuffix("\n"), pointer, None, ())
    result = json.loads(out)
    is_open = "undetermined" in (result["verdict"], result["verdict_with_time"])
    assert code in (0, 1) if result.get("nonholonomic") else code == int(is_open), err
    return result


def _by_http(body: str, service: str) -> Any:
    answer = httpx.post(
        f"{service}/v1/solve",
        content=body.encode("utf-8", "surrogatepass"),
        headers={"Prefer": "wait=20", **JSON},
        timeout=60,
    )
    if answer.status_code == 200:
        return answer.json()
    return refusal(answer)


def refusal(answer: httpx.Response) -> Refusal:
    """The first error of a problem document."""
    assert 400 <= answer.status_code < 500, answer.text
    problem = answer.json()
    first = (problem.get("errors") or [{}])[0]
    detail = first.get("detail") or problem["detail"]
    return Refusal(
        detail, first.get("pointer", ""), first.get("column"), tuple(first.get("instead") or ())
    )
