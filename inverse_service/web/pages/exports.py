"""Export formats of a result: LaTeX, Python call, curl, JSON; code in other languages is made on demand."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from inverse_service.service.documents.latex_page import latex_page

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


def exports(result: Mapping[str, Any], address: str) -> list[Export]:
    """Every form that this result has; the JSON is a link of its own, being long."""
    found = [Export("latex", "LaTeX", latex_page(dict(result), explain=True))]
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
