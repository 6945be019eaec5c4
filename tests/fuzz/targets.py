"""Fuzz targets: formulas, documents, and bytes are parsed or rejected with a sentence, without
internal errors. Every target is a Hypothesis test. Hypothesis runs it by itself, and atheris drives
it with bytes that reach new lines of the readers (`hypothesis.fuzz_one_input`).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, Final

from hypothesis import HealthCheck, given, settings, strategies as some

from inverse_service.certificate import checker
from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.printing import to_latex, to_mathml, to_text
from inverse_service.expressions.tree import Expression
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from inverse_service.service.documents.documents import parse_document
from inverse_service.service.documents.plain_data import read_json, read_toml, read_yaml
from inverse_service.service.jobs.tasks import guard

SETTINGS = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)
NAMES = Names(("x", "y", "r1"), ("k", "m"), {"A": ("x",), "B": ("x", "y")})
WORDS = r"""
x y x' y'' x_dot \dot{x} \ddot{y} diff(x,t) Derivative(x, t) r1 k m A A(x) A'(x) B(x,y) pi e i I lambda import __class__
\frac{1}{2} sin cos( tan sqrt( \sqrt[3]{ log exp( atan abs( \ \sin \left( \right) \cdot
( ) { } [ ] + - * / ^ ** , ; = < ! ' '' _ . .. 0 1 2 3 0.5 .5 1e3 1e999 3/2 9^9 -1 $ & # "
"""
PIECES = [
    *WORDS.split(),
    " ",
    "\n",
    "\u00b2",
    "\u2212",
    "\u03b1",
    "\u00e9",
    "\u221a",
    "\u200b",
    "\u0445",
]
FORMULAS = some.lists(some.sampled_from(PIECES), max_size=16).map("".join) | some.text(max_size=30)
SCALARS = some.none() | some.booleans() | some.integers() | some.floats() | FORMULAS
VALUES = some.recursive(
    SCALARS,
    lambda inner: (
        some.lists(inner, max_size=3) | some.dictionaries(some.text(max_size=4), inner, max_size=3)
    ),
    max_leaves=6,
)
COORDINATES = some.sampled_from(["x", "y", "z1", "phi"])
EQUATIONS = (
    some.dictionaries(COORDINATES, FORMULAS, max_size=3)
    | some.lists(FORMULAS, max_size=3)
    | FORMULAS
)
SHARED = {
    "coordinates": some.lists(COORDINATES | FORMULAS, max_size=3) | VALUES,
    "parameters": some.lists(some.sampled_from(["k", "m"]), max_size=2)
    | some.dictionaries(FORMULAS, SCALARS)
    | VALUES,
    "functions": some.just({"A": ["x"]}) | VALUES,
    "name": FORMULAS | VALUES,
}
SYSTEMS = some.fixed_dictionaries(
    {"equations": EQUATIONS | VALUES},
    optional={**SHARED, "time_dependent_lagrangian": VALUES, "ansatz": VALUES},
)
NONHOLONOMIC = some.fixed_dictionaries(
    {"lagrangian": FORMULAS | VALUES, "constraints": some.lists(FORMULAS, max_size=2) | VALUES},
    optional={
        **SHARED,
        "associated": some.sampled_from(["first", "second", "third", "search", "any"]) | VALUES,
    },
)


@SETTINGS
@given(FORMULAS)
def formulas(text: str) -> None:
    """A formula is rejected at a column or parsed; then its printed text parses back."""
    read = read_or_refused(text)
    if read is None:
        return
    assert to_latex(read)
    assert to_mathml(read).startswith("<")
    printed = to_text(read)
    try:
        again = to_text(read_formula(printed, NAMES))
        assert to_text(read_formula(again, NAMES)) == again
    except LimitError:
        assert len(printed) > len(text)


def read_or_refused(text: str) -> Expression | None:
    try:
        return read_formula(text, NAMES)
    except InputError as error:
        assert_told(error.detail, error.column, len(text) + 2)
        return None


def assert_told(sentence: str, column: int | None = None, last: int = 10**9) -> None:
    """Assert that an error message is present, short, and points into the text."""
    assert 0 < len(sentence) < 600
    assert column is None or 1 <= column <= last


@SETTINGS
@given(SYSTEMS | NONHOLONOMIC | VALUES)
def documents(document: Any) -> None:
    """A document is parsed or rejected with locations."""
    outcome = guard(parse_document, document)
    assert outcome.status in ("done", "refused"), outcome.detail
    assert (outcome.status == "refused") == bool(outcome.places)
    for place in outcome.places:
        assert_told(place.detail, place.column)


BYTES = some.binary(max_size=80) | VALUES.map(
    lambda value: json.dumps(value).encode("utf-8", "surrogatepass")
)


@SETTINGS
@given(BYTES | some.tuples(BYTES, BYTES).map(lambda pair: pair[0][: len(pair[0]) // 2] + pair[1]))
def files(data: bytes) -> None:
    """JSON, YAML, and TOML are parsed or rejected; the checker has a verdict on any text."""
    for read in (read_json, read_yaml, read_toml):
        try:
            read(data)
        except InputError as error:
            assert_told(error.detail)
    found = checker.check_text(data.decode("utf-8", "replace"), time_limit=5.0, seed=1)
    assert found.verdict in ("incomplete", "invalid")


TARGETS: Final[dict[str, Callable[[], None]]] = {
    "formulas": formulas,
    "documents": documents,
    "files": files,
}
