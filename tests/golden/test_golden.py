"""The comparison of two states of the code sees each difference and nothing else."""

from __future__ import annotations

from tests.golden.__main__ import differences, documents


def test_the_documents_are_a_hundred_with_names_of_their_own() -> None:
    assert len(documents()) == 100
    kinds = {name.partition(":")[0] for name in documents()}
    assert {"motions", "kinds", "branches", "families"} <= kinds


def test_a_changed_a_new_and_a_missing_key_are_differences_and_a_clock_is_none() -> None:
    old = {
        "verdict": "variational",
        "answers": [{"L": "x"}],
        "gone": 1,
        "provenance": {"seconds": {"search": 1}},
    }
    new = {
        "verdict": "undetermined",
        "answers": [{"L": "y"}],
        "new": [2],
        "provenance": {"seconds": {"search": 2}},
    }
    assert list(differences(old, new, [])) == [
        '/answers/0/L: "x" -> "y"',
        "/gone: 1 -> null",
        "/new: null -> [2]",
        '/verdict: "variational" -> "undetermined"',
    ]
    assert list(differences(old, new, ["L", "gone", "new"])) == [
        '/verdict: "variational" -> "undetermined"'
    ]


def test_lists_of_other_lengths_differ() -> None:
    assert list(differences({"a": [1]}, {"a": [1, 2]}, [])) == ["/a: [1] -> [1, 2]"]
