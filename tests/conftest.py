"""What tests of several rooms share: documents that must be refused, and a running service."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.durations import slow_tests


@dataclass(frozen=True)
class Hostile:
    """A body that must be refused; `words` must be in the sentence, `pointer` is where the fault is."""

    name: str
    body: bytes
    words: str = ""
    pointer: str | None = None


def system(**changes: Any) -> bytes:
    """A good system with changes; a change to None leaves the key out."""
    document: dict[str, Any] = {"coordinates": ["x", "y"], "equations": {"x": "-y'", "y": "x'"}}
    document.update(changes)
    return json.dumps({key: value for key, value in document.items() if value is not None}).encode()


def formula(text: str) -> bytes:
    """A system with this right-hand side for x."""
    return system(equations={"x": text, "y": "0"})


X = "/equations/x"
HOSTILE = (
    # what is not a document at all
    Hostile("empty", b"", "empty"),
    Hostile("blank", b" \n\t ", "empty"),
    Hostile("not-json", b"x: -x", "JSON"),
    Hostile("half-json", b'{"coordinates": ["x"', "JSON"),
    Hostile("two-documents", b"{} {}", "JSON"),
    Hostile("list", b"[]", "object", ""),
    Hostile("number", b"3", "object", ""),
    Hostile("null", b"null", "object", ""),
    Hostile("text", b'"x"', "object", ""),
    Hostile("nan", b'{"coordinates": ["x"], "equations": {"x": NaN}}', "NaN"),
    Hostile("infinity", b'{"coordinates": ["x"], "equations": {"x": -Infinity}}', "Infinity"),
    Hostile("huge-float", b'{"coordinates": ["x"], "equations": {"x": 1e999}}', "10^300"),
    Hostile("huge-integer", b'{"coordinates": ["x"], "equations": {"x": ' + b"9" * 5000 + b"}}", "characters"),
    Hostile("key-twice", b'{"coordinates": ["x"], "coordinates": ["y"], "equations": {"y": "0"}}', "twice"),
    Hostile("equation-twice", b'{"coordinates": ["x"], "equations": {"x": "0", "x": "1"}}', "twice"),
    Hostile("surrogate", b'{"coordinates": ["x"], "equations": {"x": "\\ud800"}}', "surrogate", X),
    Hostile("surrogate-key", b'{"\\udc00": 1}', "surrogate"),
    Hostile("not-utf-8", b'{"coordinates": ["\xff"]}', "UTF-8"),
    Hostile("control-character", b'{"equations": "x\'\'=\x00"}', "invalid control character at line 1, column 20"),
    Hostile("long-word", b'{"equations": "' + b"x" * 19_000 + b"''=-1\"}", "a name has too many characters"),
    Hostile("long-word-of-digits", b'{"equations": "' + b"d2" * 9_500 + b"''=-1\"}", "a name has too many characters"),
    Hostile("empty-lines", b'{"equations": "x\'\'=-x' + b"\\n" * 19_000 + b'"}', "too many parts"),
    Hostile("many-dots", b'{"equations": "x\'\'=-x' + "\u0307".encode() * 9_000 + b'"}', "a third derivative"),
    Hostile("deep-lists", b"[" * 100_000 + b"]" * 100_000, "deep"),
    Hostile("deep-objects", b'{"a":' * 3_000 + b"1" + b"}" * 3_000, "deep"),
    # documents of another shape
    Hostile("nothing", b"{}", "equations", "/equations"),
    Hostile("no-equations", system(equations=None), "missing", "/equations"),
    Hostile("unknown-key", system(hamiltonian="p^2"), "not known", "/hamiltonian"),
    Hostile("equations-number", system(equations=3), "wrong type", "/equations"),
    Hostile("equations-true", system(equations=True), "wrong type", "/equations"),
    Hostile("equation-list", system(equations={"x": ["0"], "y": "0"}), "text", X),
    Hostile("equation-null", system(equations={"x": None, "y": "0"}), "text", X),
    Hostile("equation-true", system(equations={"x": True, "y": "0"}), "text", X),
    Hostile("coordinates-number", system(coordinates=3), "list", "/coordinates"),
    Hostile("coordinates-empty", system(coordinates=[], equations={}), "empty", "/coordinates"),
    Hostile("coordinate-number", system(coordinates=["x", 2]), "name", "/coordinates/1"),
    Hostile("thirteen-coordinates", system(coordinates=list("abcdxyuvwmnpq")), "at most 12", "/coordinates"),
    Hostile("parameters-number", system(parameters=1), "wrong type", "/parameters"),
    Hostile("parameter-true", system(parameters={"k": True}), "number", "/parameters/k"),
    Hostile("functions-list", system(functions=["A"]), "object", "/functions"),
    Hostile("function-number", system(functions={"A": 3}), "list", "/functions/A"),
    Hostile("time-text", system(time_dependent_lagrangian="yes"), "true or false", "/time_dependent_lagrangian"),
    Hostile("near-list", system(near={"x": ["1"]}), "must be a number", "/near/x"),
    Hostile("order-nine", system(series_order=9), "value; it must be an integer from 1 to 8", "/series_order"),
    Hostile("name-number", system(name=7), "text", "/name"),
    # documents that mean nothing
    Hostile("coordinate-twice", system(coordinates=["x", "x"]), pointer="/coordinates/1"),
    Hostile("coordinate-no-name", system(coordinates=["x", "1y"]), pointer="/coordinates/1"),
    Hostile("coordinate-code", system(coordinates=["x", "__import__('os')"]), pointer="/coordinates/1"),
    Hostile("coordinate-function", system(coordinates=["x", "sin"], equations={"x": "0", "sin": "0"})),
    Hostile("coordinate-time", system(coordinates=["x", "t"], equations={"x": "0", "t": "0"})),
    Hostile("equation-missing", system(equations={"x": "0"}), "y"),
    Hostile("equation-of-nothing", system(equations={"x": "0", "y": "0", "z": "0"}), pointer="/equations/z"),
    Hostile("parameter-is-coordinate", system(parameters=["x"])),
    Hostile("parameter-twice", system(parameters=["k", "k"])),
    Hostile("parameter-value-code", system(parameters={"k": "exit()"})),
    Hostile("parameter-value-zero-division", system(parameters={"k": "1/0"})),
    Hostile("function-of-nothing", system(equations={"x": "A(x)", "y": "0"}, functions={"A": ["z"]})),
    # formulas
    Hostile("code", formula("__import__('os').system('true')"), pointer=X),
    Hostile("lambda", formula("(lambda: 0)()"), pointer=X),
    Hostile("attribute", formula("x.__class__"), pointer=X),
    Hostile("index", formula("x[0]"), pointer=X),
    Hostile("statement", formula("x; import os"), pointer=X),
    Hostile("string", formula("'x'"), pointer=X),
    Hostile("tower", formula("9^9^9"), pointer=X),
    Hostile("tower-text", formula("9**9**9**9"), pointer=X),
    Hostile("factorial", formula("100000!"), pointer=X),
    Hostile("million-characters", formula("x+" * 250_000 + "x"), "characters", X),
    Hostile("five-thousand-parentheses", formula("(" * 5_000 + "x" + ")" * 5_000), pointer=X),
    Hostile("open-parenthesis", formula("sin(x"), pointer=X),
    Hostile("closed-parenthesis", formula("x)"), pointer=X),
    Hostile("unknown-name", formula("omega^2*x"), "omega", X),
    Hostile("unknown-function", formula("foo(x)"), pointer=X),
    Hostile("unclosed-absolute-value", formula("|x"), pointer=X),
    Hostile("empty-formula", formula(""), "empty", X),
    Hostile("blank-formula", formula("  "), pointer=X),
    Hostile("operator-only", formula("+"), pointer=X),
    Hostile("division-by-zero", formula("x/0"), pointer=X),
    Hostile("third-derivative", formula("x'''"), pointer=X),
    Hostile("zero-byte", formula("x\x00"), pointer=X),
    Hostile("latex-input", formula("\\input{/etc/hosts}"), pointer=X),
    Hostile("homoglyph", formula("\u0445"), pointer=X),
    Hostile("right-to-left", formula("\u202ex"), pointer=X),
    Hostile("relation", formula("x < y"), pointer=X),
    # whole equations
    Hostile("singular-mass-matrix", system(equations="x'' + y'' = x; x'' + y'' = y"), "singular"),
    Hostile("one-equation-for-two", system(equations="x'' = 0")),
    Hostile("three-equations-for-two", system(equations=["x'' = 0", "y'' = 0", "x'' = y"])),
    Hostile("no-acceleration", system(equations=["x' = 0", "y'' = 0"])),
    Hostile("nonlinear-acceleration", system(equations=["x''^2 = 1", "y'' = 0"])),
    Hostile("acceleration-on-the-right", system(equations={"x": "y''^2", "y": "0"})),
    Hostile("two-equals-signs", system(equations=["x'' = y = 0", "y'' = 0"])),
    Hostile("empty-text", system(equations=""), "empty", "/equations"),
    Hostile("empty-list", system(equations=[]), "empty", "/equations"),
)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test with an argument `hostile` runs for each of HOSTILE."""
    if "hostile" in metafunc.fixturenames:
        metafunc.parametrize("hostile", HOSTILE, ids=[case.name for case in HOSTILE])


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a real service in a process of its own."""
    yield from running_service(tmp_path_factory.mktemp("service"))


@pytest.fixture(scope="session")
def patient(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A service with the time of a real one: the double pendulum takes 3 s of a processor that others use too."""
    yield from running_service(tmp_path_factory.mktemp("patient"), 60)


def running_service(folder: Path, time_limit: int = 10, frame_origins: str = "") -> Iterator[str]:
    """A service with its store in a folder; `time_limit` in s by the clock, so a busy machine needs more."""
    command = [sys.executable, "-m", "inverse_service", "serve", "--port", "0"]
    environment = {
        **os.environ,
        "INVERSE_SERVICE_TIME_LIMIT": str(time_limit),
        "INVERSE_SERVICE_WORKERS": "2",
        "INVERSE_SERVICE_DATABASE": str(folder / "jobs.sqlite"),
        "INVERSE_SERVICE_LOG_LEVEL": "warning",
        "INVERSE_SERVICE_FRAME_ORIGINS": frame_origins,
    }
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.terminate()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Those that tests/slow.txt names are slow.

    Browser tests come last: their driver keeps an event loop in the thread, and others start one of their own.
    """
    slow = slow_tests()
    for item in items:
        if item.nodeid in slow:
            item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: item.get_closest_marker("browser") is not None)
