"""The named systems, as data: documents, expected verdicts, known Lagrangians, sources.

Tests, benchmarks, the command line and the web form draw from it; the solver never does. An entry
is a JSON object: `name` (a slug), `kind` ("system" or "nonholonomic"), `title`, `group`, `document`
(what a user would send), `expected` (`verdict`, `verdict_with_time`, `sure`, `lagrangians`),
`source`, `note`; an associated system names its nonholonomic system in `associated_with`, a system
of the literature keeps its original `id`.
"""

import copy
import json
import unicodedata
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from inverse_service import errors

Kind = Literal["system", "nonholonomic"]

FILES = ("paper.json", "nonholonomic.json", "known.json")
ATLAS = Path(__file__).parent / "entries" / "atlas.ndjson"


class UnknownSystem(errors.InputError, KeyError):
    """The catalogue has no system of this name; a KeyError too."""

    __str__ = errors.InputError.__str__


def names(kind: Kind = "system") -> tuple[str, ...]:
    """The slugs of all entries of one kind, the systems of the paper first."""
    return tuple(name for name, found in _entries().items() if found["kind"] == kind)


def entry(name: str) -> dict[str, Any]:
    """A copy of the whole entry; UnknownSystem, with the names that look alike, if there is
    none.
    """
    entries = _entries()
    if name not in entries:
        sentence = f"There is no system of this name in the catalogue{_suggestion(name)}"
        raise UnknownSystem(f"{sentence}; 'inverse-service catalogue' lists all names.")
    return copy.deepcopy(entries[name])


def document(name: str) -> dict[str, Any]:
    """A copy of the document of an entry, as a user would send it; UnknownSystem if there is
    none.
    """
    found: dict[str, Any] = entry(name)["document"]
    return found


@lru_cache(maxsize=1)
def _entries() -> dict[str, dict[str, Any]]:
    folder = Path(__file__).parent / "entries"  # importlib.resources takes 0.02 s to load
    texts = [(folder / file).read_text(encoding="utf-8") for file in FILES]
    return {found["name"]: found for text in texts for found in json.loads(text)}


def meant(text: str) -> bool:
    """Whether a text is the name of an entry, or a word like one, for which `document` says the
    names that are near.
    """
    return text in _entries() or (text.replace("-", "").isalnum() and _suggestion(text) != "")


def _suggestion(name: str) -> str:
    # difflib only where it is needed: it costs 3 ms of every start of the command line
    import difflib

    near = difflib.get_close_matches(name[:80].lower(), list(_entries()), n=3)
    return f"; near: {', '.join(near)}" if near else ""


# The atlas: named systems with their computed answers, from atlas.ndjson, which `benchmarks.atlas`
# writes.


@lru_cache(maxsize=1)
def atlas() -> dict[str, dict[str, Any]]:
    """Every system by its name, in the order of the file; none where the atlas was not built."""
    if not ATLAS.exists():
        return {}
    return {
        found["name"]: found
        for found in map(json.loads, ATLAS.read_text(encoding="utf-8").splitlines())
    }


@lru_cache(maxsize=1)
def atlas_tags() -> dict[str, int]:
    """How many systems have each tag, the most frequent first."""
    found: dict[str, int] = {}
    for entry in atlas().values():
        for tag in entry["tags"]:
            found[tag] = found.get(tag, 0) + 1
    return dict(sorted(found.items(), key=lambda pair: -pair[1]))


def search_atlas(
    words: str = "", tag: str = "", form: str | None = None, at_rest: str | None = None
) -> list[dict[str, Any]]:
    """The systems with all of the words in name, title, source, tags or equations, with the tag,
    and of the form.
    """
    wanted = _plain(words).split()
    return [
        entry
        for entry in atlas().values()
        if (not tag or tag in entry["tags"])
        and (form is None or (form != "" and entry["form"] == form))
        and (at_rest is None or (at_rest != "" and entry["at_rest"] == at_rest))
        and all(word in _text_of(entry["name"]) for word in wanted)
    ]


@lru_cache(maxsize=4096)
def _text_of(name: str) -> str:
    """What a search looks at, in small letters."""
    entry = atlas()[name]
    parts = (name, entry["title"], entry["source"], *entry["tags"], *entry["equations"])
    return _plain(" ".join(map(str, parts)))


def _plain(text: str) -> str:
    """A text in small letters without accents."""
    apart = unicodedata.normalize("NFKD", text)
    return "".join(sign for sign in apart if not unicodedata.combining(sign)).lower()
