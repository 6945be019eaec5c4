"""What the program answers to each test, as one digest for each.

A test asserts what it is about. Here all that the functions of the package return to it, and all that
a service and a command answer, is compared with what it was: other numbers, texts, columns, reasons.
This asks nothing again, and costs little. `python -m tests.golden.answers [PATH ...]` writes the
digests of these files of tests, or of all that have some, again; with `--texts FOLDER` it also writes
what was answered there, a file for each test, for a comparison of two states of the code.

Numbers count by their first digits, and those that measure round-off do not count. A file of tests
has digests if all its answers are the same twice, in another order and with another hash seed. None
are for tests of a service, whose answers depend on its other work, or of kernels and long runs, whose
numbers depend on the processor. Answers are compared where Python, the libraries, and the kind of
processor are those of the digests.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from enum import Enum
from fractions import Fraction
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any
from unittest import mock

import httpx

STORED = Path(__file__).with_name("answers.json")
# The variable that names the folder where answers are written, and nothing is compared.
FOLDER, SHUFFLED = "ANSWERS_OF_TESTS", "ANSWERS_SHUFFLED"
ROOT = Path(__file__).parents[2]
PACKAGE = "inverse_service"
LIBRARIES = (
    "hypothesis", "llvmlite", "mpmath", "numba", "numpy", "pydantic", "pytest", "python-flint", "starlette", "sympy"
)  # fmt: skip
# Whose functions are tasks, which are compared and sent to other processes.
APART = f"{PACKAGE}.service.jobs"
# Of one test: as many answers, each with so many parts.
MOST, PARTS = 60, 3000
# A longer sequence of numbers counts by so many of them.
SOME = 8
CLOCKS = frozenset(
    {"seconds", "cost", "time_limit", "us_per_step", "time_per_step", "provenance", "engine", "version", "waited"}
)  # fmt: skip
# Names that are drawn or are digests of files, moments, folders and ports, addresses in memory, and numbers of many digits.
DRAWN = re.compile(
    r"\b[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}\b|\b[0-9a-f]{16,}\b|0x[0-9a-f]+|/tmp/[^\s\"'<>]*"
    r"|(?:localhost|127\.0\.0\.1):\d+|\d{4}-\d\d-\d\d[T ][\d:.]+(?:Z|\+\d\d:\d\d)?|\bnonce[-=]\"?[\w+/=-]+"
    r"|/static/[0-9a-f]+/|sha256-[^']+|\d+(?:\.\d+)? m?s\b|\d(?:\.\d+)?e-\d+|\d+\.\d{6,}(?:e[-+]?\d+)?"
)
Digests = dict[str, dict[str, str]]


class Heard:
    """What is answered to the test that runs."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.inside = 0
        self.listens = False

    def begin(self) -> None:
        self.said, self.inside, self.listens = [], 0, True

    def hears(self) -> bool:
        """Whether an answer counts: what other threads ask is not in the same order each time."""
        return self.listens and threading.current_thread() is threading.main_thread()

    def end(self) -> list[str]:
        """The different answers; their order may be that of threads."""
        self.listens = False
        return sorted({*self.said})

    def add(self, what: str, value: Any) -> None:
        if self.hears() and len(self.said) < MOST:
            parts = [what]
            for part in parts_of(value, "", set()):
                parts.append(part)
                if len(parts) > PARTS:
                    break
            self.said.append("\n".join(parts))


HEARD = Heard()


def parts_of(value: Any, at: str, above: set[int]) -> Iterator[str]:
    """The parts of an answer, each as a line with its place."""
    match value:
        case None | bool() | int() | Fraction() | Enum():
            yield f"{at} {value}"
        case float():
            yield f"{at} {_rounded(value)}"
        case complex():
            yield f"{at} {_rounded(value.real)} {_rounded(value.imag)}"
        case str():
            yield f"{at} {DRAWN.sub('#', value)}"
        case bytes():
            yield f"{at} {len(value)} bytes"
        case _ if id(value) in above or len(above) > 60:
            yield f"{at} ..."
        case Mapping():
            yield f"{at} {len(value)} keys"
            for key in value:
                if key not in CLOCKS:
                    yield from parts_of(value[key], f"{at}/{_name(key)}", above | {id(value)})
        case list() | tuple():
            yield f"{at} {len(value)}"
            for place in _places(value):
                yield from parts_of(value[place], f"{at}/{place}", above | {id(value)})
        case set() | frozenset():
            inner = (
                "\n".join(parts_of(one, f"{at}/", above | {id(value)}))
                for one in [*value][: SOME**3]
            )
            yield from sorted(inner)
        case BaseException():
            yield f"{at} {type(value).__name__}"
            yield from parts_of(str(value), at, above)
        case _ if type(value).__module__ == "numpy" and hasattr(value, "ravel"):
            flat = value.ravel()
            yield f"{at} {value.shape}"
            for place in _places(flat):
                yield from parts_of(flat[place].item(), f"{at}/{place}", above | {id(value)})
        case _ if dataclasses.is_dataclass(value) and not isinstance(value, type):
            yield f"{at} {type(value).__name__}"
            for field in dataclasses.fields(value):
                if field.name not in CLOCKS and field.repr:
                    within = getattr(value, field.name, None)
                    yield from parts_of(within, f"{at}/{field.name}", above | {id(value)})
        case _ if str(type(value).__module__).startswith(("flint", "sympy")) or hasattr(
            value, "free_symbols"
        ):
            yield f"{at} {value}"
        case _:
            yield f"{at} {type(value).__name__}"


def _name(key: Any) -> str:
    return DRAWN.sub("#", key) if isinstance(key, str) else type(key).__name__


def _places(value: Any) -> Iterable[int]:
    """All places of a sequence, or some where it is one of many numbers."""
    length = len(value)
    if length <= SOME or not isinstance(value[0], float | int):
        return range(length)
    return sorted({k * (length - 1) // (SOME - 1) for k in range(SOME)})


def _rounded(value: float) -> str:
    """The first digits. The factor is there so that decimals with few digits are not halfway."""
    if not math.isfinite(value):
        return str(value)
    return "small" if abs(value) < 1e-6 else f"{math.pi / 4 * value:.4g}"


def recorded(work: Callable[..., Any]) -> Callable[..., Any]:
    """The function, whose values and errors are added to what is heard where a test calls it."""
    name = f"{work.__module__}.{work.__qualname__}"

    @functools.wraps(work)
    def call(*arguments: Any, **named: Any) -> Any:
        if HEARD.inside or not HEARD.hears():
            return work(*arguments, **named)
        HEARD.inside += 1
        try:
            value = work(*arguments, **named)
        except Exception as error:
            HEARD.add(name, error)
            raise
        else:
            HEARD.add(name, value)
        finally:
            HEARD.inside -= 1
        return value

    return call


class Room(ModuleType):
    """A module of the package as a test has it: its functions are recorded, and what a test sets is
    set in the module.
    """

    def __init__(self, module: ModuleType) -> None:
        super().__init__(module.__name__)
        ModuleType.__setattr__(self, "_room", module)

    def __getattribute__(self, name: str) -> Any:
        if name == "__dict__":
            return ModuleType.__getattribute__(self, "_room").__dict__
        value = getattr(ModuleType.__getattribute__(self, "_room"), name)
        return recorded(value) if _is_ours(value) else value

    def __setattr__(self, name: str, value: Any) -> None:
        room = ModuleType.__getattribute__(self, "_room")
        setattr(room, name, getattr(value, "__wrapped__", value) if _was_ours(value) else value)

    def __delattr__(self, name: str) -> None:
        delattr(ModuleType.__getattribute__(self, "_room"), name)


def _is_ours(value: object) -> bool:
    module = getattr(value, "__module__", None) or ""
    return (
        isinstance(value, FunctionType)
        and module.startswith(PACKAGE)
        and not module.startswith(APART)
    )


def _was_ours(value: object) -> bool:
    return _is_ours(value) and _is_ours(getattr(value, "__wrapped__", None))


def listen(modules: Iterable[ModuleType]) -> None:
    """Record what the functions of the package return to these modules of tests."""
    for module in modules:
        for name, value in [*vars(module).items()]:
            if _is_ours(value):
                setattr(module, name, recorded(value))
            elif isinstance(value, ModuleType) and value.__name__.startswith(PACKAGE):
                setattr(module, name, Room(value))


@contextmanager
def hearing_services() -> Iterator[None]:
    """Within, what a service answers is heard, but for answers that are not yet there."""
    send = httpx.Client.send

    @functools.wraps(send)
    def sent(self: httpx.Client, request: httpx.Request, **named: Any) -> httpx.Response:
        response = send(self, request, **named)
        if response.is_closed and response.status_code not in (202, 503):
            HEARD.add(f"{request.method} {response.status_code}", _body(response))
        return response

    with mock.patch.object(httpx.Client, "send", sent):
        yield


def _body(response: httpx.Response) -> Any:
    return [response.headers.get("content-type", ""), read(response.text)]


def read(text: str) -> Any:
    """A text as the value of its JSON, whole or by lines, so that its clocks do not count; other
    lines as they are.
    """
    try:
        return json.loads(text)
    except ValueError:
        return [json.loads(line) if _is_object(line) else line for line in text.split("\n")]


def _is_object(line: str) -> bool:
    try:
        return isinstance(json.loads(line), dict)
    except ValueError:
        return False


def mark(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()[:8]


def digest(said: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(said).encode("utf-8", "surrogatepass")).hexdigest()[:8]


@functools.cache
def surroundings() -> dict[str, str]:
    """What answers may depend on besides the package."""
    versions = {name: importlib.metadata.version(name) for name in LIBRARIES}
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, "processor": platform.machine(), **versions}


@functools.cache
def stored() -> Digests:
    """The digests by file and mark of the test, empty elsewhere than where they were written."""
    whole: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8"))
    return whole["digests"] if whole["surroundings"] == surroundings() else {}


def is_compared(test: str) -> bool:
    """Whether what a test is answered is written or compared; else it is not listened to."""
    return is_writing() or test.partition("::")[0] in stored()


def fault(test: str, said: list[str]) -> str | None:
    """What is wrong with what a test was answered."""
    file, _, name = test.partition("::")
    known = stored().get(file, {}).get(mark(name))
    if known is None or known == digest(said):
        return None
    again = f"python -m tests.golden.answers {file}"
    shown = "\n\n".join(one[:600] for one in said[:10])
    return f"Not what was answered before; if it is meant, `{again}` writes it.\n{shown}"


def note(test: str, said: list[str]) -> None:
    """Write what was answered where the command wants it, each process in its file."""
    folder = Path(os.environ[FOLDER])
    texts = folder / "texts"
    with (folder / f"{os.getpid()}.jsonl").open("a", encoding="utf-8") as file:
        file.write(json.dumps([test, digest(said)]) + "\n")
    if texts.is_dir():
        path = texts / re.sub(r"[^\w.\[\]-]+", "_", test)[:200]
        path.write_text("\n\n".join(said), encoding="utf-8", errors="surrogatepass")


def is_writing() -> bool:
    return FOLDER in os.environ


def main() -> None:
    """Run tests twice and write the digests of what both were answered."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden.answers", description=__doc__)
    parser.add_argument("paths", nargs="*", help="files of tests; without any, those with digests")
    parser.add_argument("--texts", type=Path)
    parser.add_argument("--processes", default="logical")
    asked = parser.parse_args()
    known: Digests = json.loads(STORED.read_text(encoding="utf-8"))["digests"]
    asked.paths = asked.paths or [file for file in known if (ROOT / file).exists()]
    once, again = (_answered(asked, shuffled) for shuffled in (False, True))
    found, unsteady = Digests(), set[str]()
    for test, seen in sorted(once.items()):
        file, _, name = test.partition("::")
        found.setdefault(file, {})[mark(name)] = seen
        if again.get(test) != seen:
            unsteady.add(file)
            print(f"Answered otherwise the second time, so that its file has no digests: {test}")
    kept = {
        file: dict(sorted(tests.items()))
        for file, tests in sorted((known | found).items())
        if file not in unsteady and (ROOT / file).exists()
    }
    whole = {"surroundings": surroundings(), "digests": kept}
    STORED.write_text(json.dumps(whole, indent=0, ensure_ascii=True) + "\n", encoding="utf-8")


def _answered(asked: argparse.Namespace, shuffled: bool) -> dict[str, str]:
    """The digest of each test; the second time in another order."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if asked.texts and not shuffled:
            (folder / "texts").mkdir()
        environment = os.environ | {FOLDER: name, SHUFFLED: "yes" if shuffled else ""}
        workers = ("-n", asked.processes, "--dist", "loadfile")
        subprocess.run(
            [sys.executable, "-m", "pytest", *workers, *asked.paths],
            cwd=ROOT,
            env=environment,
            check=True,
        )
        if (folder / "texts").exists():
            shutil.copytree(folder / "texts", asked.texts, dirs_exist_ok=True)
        lines = [
            line
            for path in folder.glob("*.jsonl")
            for line in path.read_text(encoding="utf-8").splitlines()
        ]
        return dict(json.loads(line) for line in lines)


if __name__ == "__main__":
    main()
