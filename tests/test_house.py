"""What docs/architecture.md says of the house holds: its files exist, and so do the calls of its table."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
SOURCES = [path for part in ("inverse_service", "api_schemas") for path in sorted((ROOT / part).rglob("*.py"))]
AGREEMENT = re.compile(r"^\| `([a-z_.]+)\.(\w+)(?:\(|`)", re.MULTILINE)


def test_every_agreement_of_the_architecture_page_names_something_that_exists() -> None:
    rows = AGREEMENT.findall(ARCHITECTURE)
    assert len(rows) > 15
    missing = [f"{module}.{name}" for module, name in rows if not exists(module, name)]
    assert missing == []


def exists(module: str, name: str) -> bool:
    return hasattr(importlib.import_module(f"inverse_service.{module}"), name)


@pytest.mark.parametrize("place", sorted(set(re.findall(r"`((?:\w+/)+\w+\.py)`", ARCHITECTURE))))
def test_every_file_that_the_architecture_page_names_exists(place: str) -> None:
    assert [path for path in SOURCES if path.match(place)] or (ROOT / place).is_file()
