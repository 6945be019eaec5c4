"""The atlas: named systems with their computed answers, from atlas.ndjson, which `benchmarks.atlas` writes."""

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

FILE = Path(__file__).parent / "entries" / "atlas.ndjson"


@lru_cache(maxsize=1)
def entries() -> dict[str, dict[str, Any]]:
    """Every system by its name, in the order of the file; none where the atlas was not built."""
    if not FILE.exists():
        return {}
    return {found["name"]: found for found in map(json.loads, FILE.read_text(encoding="utf-8").splitlines())}


@lru_cache(maxsize=1)
def tags() -> dict[str, int]:
    """How many systems have each tag, the most frequent first."""
    found: dict[str, int] = {}
    for entry in entries().values():
        for tag in entry["tags"]:
            found[tag] = found.get(tag, 0) + 1
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def search(words: str = "", tag: str = "", form: str | None = None) -> list[dict[str, Any]]:
    """The systems with all of the words in name, title, source, tags or equations, with the tag, and of the form."""
    wanted = words.lower().split()
    return [
        entry
        for entry in entries().values()
        if (not tag or tag in entry["tags"])
        and (form is None or (form != "" and entry["form"] == form))
        and all(word in text_of(entry["name"]) for word in wanted)
    ]


@lru_cache(maxsize=4096)
def text_of(name: str) -> str:
    """What a search looks at, in small letters."""
    entry = entries()[name]
    parts = (name, entry["title"], entry["source"], *entry["tags"], *entry["equations"])
    return " ".join(map(str, parts)).lower()


def line_of(entry: Mapping[str, Any]) -> str:
    """A line of the NDJSON."""
    return json.dumps(entry, ensure_ascii=False) + "\n"


@lru_cache(maxsize=1)
def whole() -> tuple[bytes, str]:
    """All entries as NDJSON, and a digest of that."""
    data = "".join(map(line_of, entries().values())).encode()
    return data, hashlib.sha256(data).hexdigest()[:16]
