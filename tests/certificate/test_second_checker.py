"""Two programs without common code check the same certificates: `certificate/` and
tests/second_checker.py.
"""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Iterator
from typing import Any

import pytest

import inverse_service
from inverse_service import catalogue
from inverse_service.certificate.checker import check_certificate
from tests import second_checker
from tests.doors.rows import rows

Certificate = dict[str, Any]


def without_lagrangian() -> list[tuple[str, dict[str, Any]]]:
    """Documents from the literature and the catalog without L(q, q') or without L(t, q, q')."""
    found = [(row["id"], row["document"]) for row in rows("literature")
             if "not_variational" in (row["verdict"], row["verdict_with_time"])]  # fmt: skip
    for one in map(catalogue.entry, catalogue.names()):
        if "not_variational" in (one["expected"]["verdict"], one["expected"]["verdict_with_time"]):
            found.append((one["name"], one["document"]))
    return found


def certificates(document: dict[str, Any]) -> Iterator[Certificate]:
    """The nonexistence certificates that the solver writes for a document."""
    result = inverse_service.solve(document, time_limit=60)
    for certificate in (
        result.get("certificate"),
        (result.get("with_time") or {}).get("certificate"),
    ):
        if certificate and certificate["kind"] == "nonexistence":
            yield certificate


def mutant(certificate: Certificate, generator: random.Random) -> Certificate:
    """The certificate with one small change, which may or may not invalidate it."""
    changed = copy.deepcopy(certificate)
    rows, equations = changed["rows"], changed["system"]["equations"]
    name = generator.choice(sorted(equations))
    match generator.randrange(8):
        case 0:
            rows.pop(generator.randrange(len(rows)))
        case 1:
            kind = generator.choice(["H2", "H3"])
            rows[:] = [row for row in rows if row[0] == kind]
        case 2:
            row = generator.choice(rows)
            row[3][generator.randrange(len(row[3]))] += 1
        case 3:
            rows.append(copy.deepcopy(generator.choice(rows)))
        case 4:
            equations[name] = "0"
        case 5:
            equations[name] = f"-({equations[name]})"
        case 6:
            equations[name] += f" + {generator.choice(sorted(equations))}"
        case _:
            changed["order"] = max(0, changed["order"] - 1)
    return changed


CASES = [
    pytest.param(*one, marks=[] if k % 72 == 0 else pytest.mark.slow, id=one[0])
    for k, one in enumerate(without_lagrangian())
]


@pytest.mark.parametrize(("name", "document"), CASES)
def test_both_judge_a_certificate_and_its_mutants_alike(
    name: str, document: dict[str, Any]
) -> None:
    generator = random.Random(name)
    for certificate in certificates(document):
        verdict, sentence = second_checker.check(certificate)
        if verdict == "incomplete":  # it contains more than rational operations
            continue
        assert (verdict, check_certificate(certificate).verdict) == ("valid", "valid"), sentence
        for _ in range(4):
            changed = mutant(certificate, generator)
            assert second_checker.check(changed)[0] == check_certificate(changed).verdict, (
                json.dumps(changed)
            )


def test_the_second_checker_tells_true_from_false() -> None:
    """A checker that answered `incomplete` to everything would pass the test above."""
    (plain,) = certificates({"equations": {"x": "-x - x'^2*y", "y": "-y + x'*y'"}})
    assert second_checker.check(plain)[0] == "valid"
    assert second_checker.check(plain | {"rows": plain["rows"][:-1]})[0] == "invalid"
    assert second_checker.check(plain | {"claim": "variational"})[0] == "invalid"


@pytest.mark.parametrize(
    "certificate", [None, [], {}, {"format": second_checker.FORMAT}, "x"], ids=repr
)
def test_an_object_that_is_not_a_certificate_is_not_valid(certificate: object) -> None:
    assert second_checker.check(certificate)[0] != "valid"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-2^2", -4),
        ("2-3-4", -5),
        ("12/3/2", 2),
        ("2*-3", -6),
        ("2^-1", 0.5),
        ("-(1+2)^2*2", -18),
        ("2^(-2)*8", 2),
    ],
)
def test_formulas_are_read_with_the_usual_precedence(text: str, value: float) -> None:
    assert second_checker.read(text, {}, lambda number: number) == value


@pytest.mark.parametrize("text", ["2^3^2", "2^x", "sin(x)", "pi", "x^0.5", "x^(1/2)"])
def test_what_is_not_rational_is_left_to_the_first_checker(text: str) -> None:
    with pytest.raises(second_checker.Ended) as end:
        second_checker.read(text, {"x": 1, "sin": 1}, lambda number: number)
    assert end.value.args[0] == "incomplete"
