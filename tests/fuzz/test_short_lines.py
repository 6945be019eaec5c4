"""No short line, prefix of a formula, or formula with a missing character causes an internal
error.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from inverse_service.errors import InputError
from inverse_service.service.documents.documents import parse_document
from tests.doors import calls
from tests.doors.rows import rows
from tests.values import slow

ROOT = Path(__file__).parents[2]
WORDS = r"""d dx t e i x y k dt x' x'' d/dt dx/dt 2 1/2 0.5 sin cos sqrt ( ) ^ _ / * + - = , ' | [ ] { } [1] (t) (x) D
    diff Derivative V f d^2 dt^2 dt2 d( d)/dt x_ 1e I . & ; < > ~ @ $ % ! : # " ` D@@2 Eq Matrix der Symbol Float
    Integer( Rational( Piecewise[{ Log[ x.diff( Differential piecewise \frac \dot \ddot \omega \sqrt \left( \right)
    \partial \mathrm \cdot \over \rm \prime \left \right \\ \frac{d}{dt} \frac{d {dt} ^{ _{ \begin{cases}
    \end{cases} \mathbf \tag{ \text{if}"""
PIECES = [*WORDS.split(), *"\n\u2202\u221a\u03b8\u1e8b\u1e8d\u00b2\u00b7\u2212\u222b\u00bd\u03c9"]


def read(document: Any) -> None:
    try:
        parse_document(document)
    except InputError:
        pass
    except Exception as error:
        error.add_note(json.dumps(document))
        raise


def short_lines(seed: int, count: int) -> Iterator[str]:
    source = random.Random(seed)
    for _ in range(count):
        pieces = [source.choice(PIECES) for _ in range(source.randint(1, 6))]
        yield source.choice(["x'' = ", "x'' = -k x ", r"\ddot{x} = ", ""]) + source.choice(
            ["", " "]
        ).join(pieces)


@pytest.mark.parametrize(("seed", "count"), [(0, 100), *(slow(seed, 1000) for seed in range(4))])
def test_no_short_line_is_a_fault_of_the_program(seed: int, count: int) -> None:
    for line in short_lines(seed, count):
        read({"equations": line, "parameters": "guess"})
    for line in short_lines(seed + 100, count // 10):
        read({"lagrangian": line, "parameters": "guess"})
        read({"equations": {"x": line}, "parameters": ["k"]})


def formulas() -> list[str]:
    """The formulas in the catalog, in code of the documentation, and as printed in books."""
    found: dict[str, None] = {}
    for row in rows("readings"):
        if "as-printed" in row["id"]:
            found.update(dict.fromkeys(_texts(row["document"])))
    for path in sorted((ROOT / "inverse_service/catalogue").rglob("*.json")):
        found.update(dict.fromkeys(_texts(json.loads(path.read_text()))))
    for path in sorted((ROOT / "docs").glob("*.md")):
        found.update(dict.fromkeys(re.findall(r"`([^`\n]*['\\=][^`\n]*)`", path.read_text())))
    return [text for text in found if any(mark in text for mark in "'=\\^*") and len(text) < 200]


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _texts(part)


@pytest.mark.parametrize("every", [1201, slow(9)])
def test_no_beginning_of_a_formula_is_a_fault_of_the_program(every: int) -> None:
    for text in shortened()[::every]:
        read({"equations": text, "parameters": "guess"})


def shortened() -> list[str]:
    """Every prefix of the formulas, and the formulas without one of their characters."""
    texts = formulas()
    assert len(texts) > 300
    begun = [text[:length] for text in texts for length in range(1, len(text))]
    return begun + [
        text[:place] + text[place + 1 :] for text in texts for place in range(len(text))
    ]


@pytest.mark.nightly
def test_no_beginning_of_a_formula_is_a_fault_of_the_program_at_any_door(
    service: str, tmp_path: Path
) -> None:
    chosen = random.Random(0).sample(shortened(), 3000)
    documents = [
        {"id": str(place), "equations": text, "parameters": "guess"}
        for place, text in enumerate(chosen)
    ]
    with httpx.Client(base_url=service, timeout=60) as client:
        for document in documents:
            form = {"kind": "equations", "equations": document["equations"]}
            assert client.post("/v1/parse", json=document).status_code in (200, 422), document
            assert client.post("/understood?fragment=1", data=form).status_code == 200, document
    lines, answers = tmp_path / "lines.ndjson", tmp_path / "answers.ndjson"
    lines.write_text("".join(f"{json.dumps(document)}\n" for document in documents[:300]))
    code, _, err = calls.command("batch", str(lines), "-o", str(answers), "--time-limit", "1")
    assert code in (0, 1), err
    assert all(
        json.loads(line).get("status", 200) < 500 for line in answers.read_text().splitlines()
    )
