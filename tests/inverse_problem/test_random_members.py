"""Each member of a family, decided alone, has the verdicts of the leaf that holds it."""

from __future__ import annotations

import functools
import json
import re
from typing import Any

import pytest

import inverse_service
from benchmarks import random_members
from benchmarks.members_of_families import FAMILIES
from inverse_service.certificate import checker
from inverse_service.expressions import tree as ex
from inverse_service.reading import names as nm, reader
from inverse_service.solving import closed_members, members

QUICK = ["10b reduced particle, V(x)", "14 spring, A(x, y) y'"]
YES, NO = "variational", "not_variational"


@functools.cache
def text_of(key: str) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(members, "SEARCH_SECONDS", 0.0)
        asked = FAMILIES[key] | {"family": True, "first_integrals": False}
        return inverse_service.solve(asked).to_json()


def family_of(key: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(text_of(key))["family"]
    return found


def is_held(key: str, family: dict[str, Any], count: int) -> None:
    found = random_members.compared(FAMILIES[key], family, count)
    assert not found.wrong
    assert sum(found.on.values()) >= count
    assert set(found.on) & {*range(1, len(family["leaves"]))} or len(family["leaves"]) == 1


@pytest.mark.parametrize("key", QUICK)
def test_members_have_the_verdicts_of_their_leaf(key: str) -> None:
    family = family_of(key)
    assert family["covered"]
    is_held(key, family, 4)
    for _, false in false_claims(family):
        assert checker.check_certificate(false).verdict != "valid"


def test_a_wrong_leaf_is_found() -> None:
    """Leaves with the other verdict."""
    family = family_of(QUICK[0])
    for leaf in family["leaves"]:
        leaf["verdict"] = NO if leaf["verdict"] == YES else YES
    assert random_members.compared(FAMILIES[QUICK[0]], family, 3).wrong


def test_a_leaf_that_is_too_large_or_missing_is_found() -> None:
    """A_x = 0 is told of all A(x, y), or of none: members near it, or on no leaf, are wrong."""
    large, missing = (family_of(QUICK[1]) for _ in range(2))
    (of_one_variable,) = large["leaves"][1:]
    of_one_variable["equations"] = []
    found = random_members.compared(FAMILIES[QUICK[1]], large, 3)
    assert any("diff" not in one and "leaf 1" in one for one in found.wrong)
    del missing["leaves"][1]
    found = random_members.compared(FAMILIES[QUICK[1]], missing, 1, others=12)
    assert all(one.startswith("leaf 0") for one in found.wrong)
    assert found.wrong


def test_members_near_a_leaf_fail_one_condition_of_it() -> None:
    """On A_x = 0, and beside it; each member is decided once."""
    found = random_members.compared(FAMILIES[QUICK[1]], family_of(QUICK[1]), 5)
    assert found.on[1] >= 5 <= found.near[1]
    assert found.agree <= found.on[0] + found.on[1]
    assert not found.wrong


def test_a_solution_with_a_denominator_that_is_zero_is_no_member() -> None:
    """d = a c/b of x'' = a y' + b y, y'' = c x + d x', with b = 0."""
    system = random_members.system_of(FAMILIES["19 Douglas, linear"])
    values = {"b": "0", "a": "1", "c": "2", "d": "a*c/b"}
    parts = {
        name: reader.read_formula(value, nm.Names((), tuple("abcd"), {}))
        for name, value in values.items()
    }
    drawn = random_members.Drawn(
        tuple(closed_members.Solved(ex.Symbol(name), value) for name, value in parts.items())
    )
    with pytest.raises(ZeroDivisionError):
        drawn.put_in().system(system)


def test_a_changed_member_has_another_function_of_the_family() -> None:
    """V_0, of V = V_0 x, is none of them."""
    system = random_members.system_of(FAMILIES[QUICK[0]])
    names = nm.Names((*system.coordinates, "V_0"), (), dict(system.functions))
    whole, value, other = (reader.read_formula(text, names) for text in ("V(x)", "2*x", "V_0"))
    parts = (closed_members.Solved(other, ex.TWO), closed_members.Solved(whole, value))
    work = random_members._Work(
        system, {"letters": [], "functions": {"V": ["x"]}}, random_members.Numbers(1)
    )
    changed = [random_members._changed(work, random_members.Drawn(parts)) for _ in range(5)]
    assert all(one.parts[0] == parts[0] for one in changed)
    assert any(one.parts[1] != parts[1] for one in changed)


def test_a_small_part_of_a_large_sum_is_not_zero() -> None:
    """(10^7 x + 1)^2 - 10^14 x^2 - 2 10^7 x is 1, and 0 without it."""
    system = random_members.system_of(FAMILIES["1 springs"])
    drawn, texts = random_members.Drawn(()), ("", " - 1")
    for rest, failing in zip(texts, (1, 0), strict=True):
        text = f"(10^7*x + 1)^2 - 10^14*x^2 - 2*10^7*x{rest} = 0"
        conditions = random_members.conditions_of(
            system, {"equations": [{"text": text}], "nonzero": []}
        )
        work = random_members._Work(system, {}, random_members.Numbers(1))
        assert work.failing(drawn, conditions) == failing


def test_a_constant_is_fitted_to_an_equation_that_is_linear_in_it() -> None:
    """a d = b c + 1 with three of them at random."""
    system = random_members.system_of(FAMILIES["1 springs"])
    leaf = {"equations": [{"text": "a*d - b*c - 1 = 0"}], "nonzero": []}
    family = {"letters": [*"abcd"], "functions": {}, "leaves": [leaf], "open": []}
    work = random_members._Work(system, family, random_members.Numbers(1))
    drawn = list(random_members._members(work, leaf, 20))
    assert len(drawn) > 10
    for one in drawn:
        rights = [part.right for part in sorted(one.parts, key=str)]
        a, b, c, d = (right.value for right in rights if isinstance(right, ex.Number))
        assert a * d - b * c == 1


def false_claims(family: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The certificate with each leaf left out, without one of its equations, or with another
    verdict, and without a proof; all of these are false or not proven.
    """
    found, text = list[tuple[str, dict[str, Any]]](), json.dumps(family["certificate"])
    root = family["certificate"]["leaves"][0]

    def twin(name: str) -> dict[str, Any]:
        found.append((name, json.loads(text)))
        return found[-1][1]

    for number, leaf in enumerate(family["certificate"]["leaves"]):
        for key in ("autonomous", "time_dependent"):
            if leaf[key] is not None:
                one = twin(f"another verdict of leaf {number}")["leaves"][number]
                one[key] = NO if leaf[key] == YES else YES
        if not number or leaf["autonomous"] == root["autonomous"] or leaf["nonzero"]:
            continue
        if not family["leaves"][number]["exceptions"]:
            twin(f"no leaf {number}")["leaves"].pop(number)
        for place in range(len(leaf["equations"])):
            twin(f"leaf {number} too large")["leaves"][number]["equations"].pop(place)
    twin("no proof")["cells"][0]["proofs"] = []
    return found


def shifted_claims(family: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The certificate with leaves that are smaller, elsewhere, or added, with proofs of other cells,
    or about another system; all of these are false or not proven.
    """
    found, certificate = list[tuple[str, dict[str, Any]]](), family["certificate"]
    text, leaves = json.dumps(certificate), certificate["leaves"]
    root = leaves[0]

    def twin(name: str) -> dict[str, Any]:
        found.append((name, json.loads(text)))
        return found[-1][1]

    other = [k for k, one in enumerate(leaves) if one["autonomous"] != root["autonomous"]]
    letters, functions = certificate["letters"], certificate["system"]["functions"]
    names = letters or [f"{name}({', '.join(of)})" for name, of in functions.items()]
    flipped = NO if root["autonomous"] == YES else YES
    for name in names[:2]:
        added = twin(f"{name} = 7 has another answer")
        both = {"autonomous": flipped, "time_dependent": flipped}
        added["leaves"].append({"equations": [f"{name} - 7"], "nonzero": []} | both)
    for k in other:
        held = " ".join(leaves[k]["equations"])
        # Functions of a leaf may be in another one with its verdict, too.
        free = [name for name in letters if not re.search(rf"\b{name[0]}\b", held)]
        for name in free[:1]:
            twin(f"leaf {k} only where {name} = 7")["leaves"][k]["equations"].append(f"{name} - 7")
            twin(f"leaf {k} not where {name} = 7")["leaves"][k]["nonzero"].append(f"{name} - 7")
        for m in other[:k]:
            one = twin(f"leaf {k} is where leaf {m} is")["leaves"]
            one[k]["equations"], one[m]["equations"] = (
                leaves[m]["equations"],
                leaves[m]["equations"],
            )
    cells = certificate["cells"]
    for m, cell in enumerate(cells):  # other cells may hold the members of a special one, too
        if cell["autonomous"] != cells[0]["autonomous"]:
            twin(f"the first cell has the proofs of cell {m}")["cells"][0]["proofs"] = cell[
                "proofs"
            ]
    for name in certificate["system"]["equations"]:
        one = twin(f"another equation for {name}")["system"]["equations"]
        first = certificate["system"]["coordinates"][0]
        one[name] = f"{one[name]} + {first}^2*{first}'"
    twin("the first leaf says the opposite")["leaves"][0] |= {"autonomous": flipped, "time_dependent": flipped}  # fmt: skip
    twin("no cell holds the special members")["cells"][1:] = []
    return [one for one in found if one[1] != certificate]


@pytest.mark.slow
@pytest.mark.parametrize(
    "key",
    ["2 springs and damping", "13 a(x) y', b(x) x'", "17 gains k, l, m", "37 charge in B(r), C(r)",
     "38 two bodies with drag", "41 exponential forces"],
)  # fmt: skip
def test_shifted_claims_are_not_valid(key: str) -> None:
    family = family_of(key)
    assert family["covered"]
    claims = shifted_claims(family)
    assert len(claims) >= 7
    for name, false in claims:
        assert checker.check_certificate(false).verdict != "valid", name


@pytest.mark.slow
@pytest.mark.parametrize("key", list(FAMILIES))
def test_members_of_all_families(key: str) -> None:
    family = family_of(key)
    is_held(key, family, 8)
    for name, false in false_claims(family) if family["covered"] else ():
        assert checker.check_certificate(false).verdict != "valid", name
