"""If any leaf of a result is changed, the check rejects it or lists the leaf as not checked."""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Iterator
from typing import Any

import pytest

from inverse_service import errors, solve
from inverse_service.certificate import checker
from inverse_service.service.documents import checking
from tests.doors import rows

DOCUMENTS, LEAVES, SECONDS = 100, 80, 10.0  # the number of documents, and the most leaves of each
VERDICTS = {"variational": "not_variational", "not_variational": "variational", "undetermined": "variational",
            "differs": "variational", "valid": "invalid"}  # fmt: skip

SMALL = {
    "yes": {"x": "-x"},
    "no": {"x": "-x - x'^2*y", "y": "-y + x'*y'"},
    "in a plane": {"r": "r*phi'^2 - k/r^2", "phi": "-2*r'*phi'/r"},
    "a root": {"x": "-x/(1 + x^2)^(3/2)"},
    "turning": {"x": "b*y' - x", "y": "-b*x' - y"},
    "with the time": {"x": "-x/t - x'/t"},
    "a function": {"x": "-V(x)*x'^2"},
}


def leaves(value: Any, at: str = "") -> Iterator[str]:
    """The JSON pointers of values that are not objects, lists, or null."""
    for key, part in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(part, dict | list):
            yield from leaves(part, f"{at}/{key}")
        elif part not in (None, ""):
            yield f"{at}/{key}"


def slips(text: str) -> Iterator[str]:
    """The text with one sign, number, function or comparison that is another."""
    for found in re.finditer(r"[-+]", text):
        yield f"{text[: found.start()]}{'-' if found[0] == '+' else '+'}{text[found.end() :]}"
    for found in re.finditer(r"\d+", text):
        yield f"{text[: found.start()]}{int(found[0]) + 1}{text[found.end() :]}"
    for one, another in (("sin", "cos"), ("cos", "sin"), ("<", ">"), (">", "<"), ("*", "/")):
        if one in text:
            yield text.replace(one, another, 1)


def other(value: Any, source: random.Random) -> Any:
    """A different value of the same type; of a formula, as often with a slip as with 1 more."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    if value in VERDICTS:
        return VERDICTS[value]
    if re.fullmatch(r"-?[\d./]+", value):
        return "17"
    made = [*slips(value)] if re.search(r"[-+*/^() ]", value) else []
    if made and (source.random() < 0.5 or re.search(r"[<>]", value)):
        return source.choice(made)
    return f"{value} + 1" if re.search(r"[-+*/^() ]", value) else f"{value}1"


def changed(result: dict[str, Any], pointer: str, source: random.Random) -> dict[str, Any]:
    found = copy.deepcopy(result)
    *path, last = [int(key) if key.isdigit() else key for key in pointer.split("/")[1:]]
    place: Any = found
    for key in path:
        place = place[key]
    # The rows of a certificate are of its order or below: a larger order is true too.
    place[last] = place[last] - 1 if last == "order" else other(place[last], source)
    return found


def chosen() -> Iterator[Any]:
    """Documents of every file of the corpus, the same ones each time, after small ones of the
    default suite.
    """
    for name, equations in SMALL.items():
        yield pytest.param({"id": name, "document": {"equations": equations}}, 10, id=name)
    listed = rows.systems()
    random.Random(5).shuffle(listed)
    for row in listed[:DOCUMENTS]:
        yield pytest.param(row, LEAVES, id=row["id"].replace(" ", "-"), marks=pytest.mark.nightly)


@pytest.mark.parametrize(("row", "most"), [*chosen()])
def test_a_changed_leaf_is_seen_or_listed(
    row: rows.Row, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    known: dict[str, checker.CheckResult] = {}
    plain = checker.check_certificate

    def remembered(certificate: Any, *times: float, **options: Any) -> checker.CheckResult:
        key = json.dumps(certificate, sort_keys=True)
        if key not in known:
            known[key] = plain(certificate, *times, **options)
        return known[key]

    monkeypatch.setattr(checking.checker, "check_certificate", remembered)
    try:
        result = json.loads(solve(row["document"], time_limit=SECONDS).to_json())
    except errors.InputError:
        pytest.skip("the document is refused")
    first = checking.check_plain(copy.deepcopy(result))
    if first["verdict"] != "valid":
        pytest.skip(f"the check says {first['verdict']}: {first['reasons'][:1]}")
    asked = [one for one in leaves(result) if not one.startswith(tuple(first["not_checked"]))]
    asked = random.Random(1).sample(asked, min(most, len(asked)))
    unseen, source = [], random.Random(2)
    for pointer in asked:
        found = checking.check_plain(changed(result, pointer, source))
        if re.search(r"/certificate\w*/(near/|rows/|order)", pointer):
            continue  # at another point, or with other rows, it is another proof of the same claim, so nothing is false
        if found["verdict"] == "valid" and not pointer.startswith(tuple(found["not_checked"])):
            unseen.append(pointer)
    print(f"{row['id']}: {len(asked)} leaves changed")
    assert not unseen, unseen
