"""The entries are well formed, the system reader accepts them, and callers get copies."""

from __future__ import annotations

import re

import pytest

from inverse_service import catalogue

VERDICTS = {"variational", "not_variational", None}


def all_names() -> tuple[str, ...]:
    return catalogue.names() + catalogue.names("nonholonomic")


def test_every_name_is_a_slug_and_occurs_once() -> None:
    assert all(re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name) for name in all_names())
    assert len(set(all_names())) == len(all_names()) == 165


def test_all_systems_of_the_literature_are_there() -> None:
    entries = [catalogue.entry(name) for name in catalogue.names()]
    identifiers = {entry["id"] for entry in entries if "id" in entry}
    assert len(identifiers) == 124
    assert {
        "sho",
        "painleve-I",
        "lie-A4,9-b=-3/4",
        "IIIa-differential-obstruction-3",
    } <= identifiers


@pytest.mark.parametrize(
    "system",
    [
        "nonholonomic-particle",
        "knife-edge",
        "vertically-rolling-disk",
        "mobile-robot",
        "two-wheeled-carriage",
    ]
    + [f"generic-class-{count}" for count in ("one", "two", "three")]
    + ["mobile-robot-with-potential", "inclined-knife-edge", "generic-class-with-potential"],
)
def test_every_system_of_the_paper_has_both_associated_systems(system: str) -> None:
    assert catalogue.entry(system)["kind"] == "nonholonomic"
    for form in ("first", "second"):
        assert catalogue.entry(f"{system}-{form}")["associated_with"] == system


def test_an_entry_has_all_its_fields() -> None:
    for name in all_names():
        entry = catalogue.entry(name)
        assert entry["name"] == name
        assert {"kind", "title", "group", "document", "expected", "source", "note"} <= set(entry)
        expected = entry["expected"]
        assert {expected["verdict"], expected["verdict_with_time"]} <= VERDICTS
        # an L(q, v) is an L(t, q, v) too
        assert (
            expected["verdict"] != "variational" or expected["verdict_with_time"] == "variational"
        )
        assert not (expected["lagrangians"] and expected["verdict_with_time"] == "not_variational")


def test_a_changed_document_does_not_change_the_catalogue() -> None:
    catalogue.document("hill-lunar")["equations"]["x"] = "0"
    assert catalogue.document("hill-lunar")["equations"]["x"] != "0"


@pytest.mark.parametrize(
    "name", ["", "no-such-system", "x" * 10_000, "../known.json", "Hill-Lunar"]
)
def test_an_unknown_name_is_a_key_error_that_says_so(name: str) -> None:
    with pytest.raises(KeyError, match="no system of this"):
        catalogue.document(name)


def test_a_misspelled_name_gets_suggestions() -> None:
    with pytest.raises(KeyError, match="near: knife-edge"):
        catalogue.document("knife-egde")
