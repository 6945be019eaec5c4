"""Every interface parses a prefix of a formula, or one with a missing character, or rejects it with
a sentence.
"""

from __future__ import annotations

import json
import random
import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from inverse_service.service.documents.documents import parse_document
from inverse_service.service.jobs.tasks import guard
from tests.doors import calls
from tests.doors.rows import rows

MOST_SECONDS = 5.0  # of processor time; the slowest of 27,000 took 0.7 s
FORMULAS = ("equations", "lagrangian", "constraints")


def whole() -> list[dict[str, Any]]:
    """Text that people paste, and documents of motions on constraints."""
    found = [{"equations": row["given"], "parameters": "guess"} for row in rows("spellings")]
    return found + [row["document"] for name in ("constrained", "readings") for row in rows(name)]


def damaged(seed: int, count: int) -> Iterator[dict[str, Any]]:
    """Documents with one formula truncated, or without one of its characters."""
    source, documents = random.Random(seed), whole()
    for _ in range(count):
        document = json.loads(json.dumps(source.choice(documents)))
        places = [(document, key) for key in FORMULAS if isinstance(document.get(key), str)]
        for key in FORMULAS:
            if isinstance(inner := document.get(key), dict | list):
                places += [
                    (inner, at) for at in (inner if isinstance(inner, dict) else range(len(inner)))
                ]
        holder, key = source.choice(places)
        if isinstance(text := holder[key], str) and text:
            place = source.randrange(len(text))
            holder[key] = text[:place] + (text[place + 1 :] if source.random() < 0.7 else "")
        yield document


def read(count: int, seed: int) -> None:
    for document in damaged(seed, count):
        start = time.process_time()
        outcome = guard(parse_document, document)
        assert outcome.status in ("done", "refused"), (outcome.detail, document)
        assert time.process_time() - start < MOST_SECONDS, document


@pytest.mark.slow
def test_a_damaged_document_is_read_or_refused() -> None:
    read(400, 1)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(100, 110))
def test_no_damaged_document_is_a_fault_of_the_program(seed: int) -> None:
    read(5_000, seed)


def ask(service: str, count: int, seed: int) -> None:
    """Send each document by HTTP, and each text through the page and the command line."""
    for document in damaged(seed, count):
        answer = httpx.post(
            f"{service}/v1/parse", content=json.dumps(document), headers=calls.JSON, timeout=60
        )
        assert answer.status_code in (200, 422), (answer.text, document)
        if not isinstance(text := document.get("equations"), str):
            continue
        page = httpx.post(
            f"{service}/understood", data={"equations": text}, timeout=60, follow_redirects=True
        )
        assert page.status_code in (200, 422), (page.text, text)
        if answer.status_code == 422 and "=" in text:
            code, out, err = calls.command("solve", "--time-limit", "5", "--", text)
            assert (code, out) == (2, ""), (text, err)
            assert "Traceback" not in err, text


def test_every_interface_rejects_a_damaged_text(service: str) -> None:
    ask(service, 6, 1)


@pytest.mark.nightly
def test_no_damaged_text_is_a_fault_at_any_door(service: str) -> None:
    ask(service, 1_000, 3)
