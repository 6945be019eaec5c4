"""What Coq is asked to compute in a proof of *no* is so over the rationals, and its rows are
Douglas's conditions: no Coq is needed to see that.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Any
from unittest import mock

import pytest

import inverse_service
from inverse_service.explanation import coq
from inverse_service.explanation.proofs import proof_document
from inverse_service.field import exact_field

# f = (-y, -x + x' y'): its Phi and two derivatives along the motion leave det g = 0.
SYSTEM = {"equations": {"x": "-y", "y": "-x+x'*y'"}, "first_integrals": False}
STEP = re.compile(
    r"(?:assert \((?P<name>\w+) : (?P<gives>[^{}]*?) = 0\)\.\s*\{ )?apply \(cancel \((?P<factor>[^{}]*?)\)\);"
    r" \[nonzero \|\]\.\s*transitivity \((?P<total>[^{}]*?)\); \[ring \| zero\]"
)
LETTERS = ("g_11", "g_12", "g_22", "v_y", "v_x", "y", "x")


def value(text: str, at: Mapping[str, Fraction]) -> Fraction:
    """A polynomial of Coq at a point."""
    assert re.fullmatch(r"[\w\s()+*^/-]+", text), text
    numbers = re.sub(r"(?<![\w^])(\d+)", r"Fraction(\1)", text)
    found: Fraction = eval(numbers.replace("^", "**"), {"Fraction": Fraction}, dict(at))
    return found


def points(seed: int = 1) -> Iterator[dict[str, Fraction]]:
    drawn = random.Random(seed)
    for _ in range(4):
        yield {
            name: Fraction(drawn.randrange(-30, 30) * 2 + 1, drawn.randrange(1, 9))
            for name in LETTERS
        }


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    found = inverse_service.solve(SYSTEM).to_dict()
    assert found["verdict"] == "not_variational"
    return found


@pytest.fixture(scope="module", params=["with f", "equations alone"])
def text(request: pytest.FixtureRequest, result: dict[str, Any]) -> str:
    """The file, and that for systems whose f is too long for Coq."""
    if request.param == "with f":
        return proof_document(result, "coq", 1)
    with mock.patch.object(coq, "System", side_effect=exact_field.TooLarge("too long")):
        found = proof_document(result, "coq", 1)
    assert "f is not defined in this file: too long." in found
    return found


def steps_of(text: str) -> list[dict[str, str]]:
    return [found.groupdict() for found in STEP.finditer(text[text.index("Theorem ") :])]


def test_each_step_is_an_identity_of_polynomials(text: str) -> None:
    """factor * gives = sum of cofactors times what is known; the end is det g."""
    steps = steps_of(text)
    assert len(steps) > 4
    (goal,) = re.findall(r"^  : (.+) = 0\.$", text, re.MULTILINE)
    for step in steps:
        for at in points():
            gives = value(step["gives"] or goal, at)
            assert value(step["factor"], at) * gives == value(step["total"], at), step["name"]
    for at in points(2):
        assert value(goal, at) == at["g_11"] * at["g_22"] - at["g_12"] ** 2


def test_a_step_uses_only_what_is_zero_before_it(text: str) -> None:
    known = {
        *re.findall(r"assert \(eq\d+ : (.+) = 0\)", text),
        *re.findall(r"^  \(\w+ : (.+) = 0\)", text, re.MULTILINE),
    }
    for step in steps_of(text):
        used = {one.rpartition(" * (")[2] for one in step["total"].split(") + (")}
        used = {one.removesuffix(")") for one in used}
        assert used <= known, step["name"]
        known.add(step["gives"])


def test_a_step_divides_only_by_what_is_not_zero(text: str) -> None:
    named = re.findall(r"\(nz\d+ : (.+) <> 0\)", text)
    assert named
    for step in steps_of(text):
        left = step["factor"]
        for one in named:
            left = re.sub(rf"\({re.escape(one)}\)(?:\^\d+)?", "1", left)
        assert re.fullmatch(r"[-\d\s*/()]+", left), left
        assert value(left, {}) != 0


def test_the_rows_are_the_symmetry_of_phi_and_of_its_derivative(text: str) -> None:
    """With J = df/dv: Phi = df/dq + J^2/4 - (dJ/dt)/2 up to its sign, nabla Phi = dPhi/dt + [Phi, J]/2
    (Douglas 1941; Crampin, Sarlet, Martínez, Byrnes, Prince 1994), and g times each is symmetric.
    """
    written = dict(re.findall(r"\((eq[12]) : (.+) = 0\)", text))
    for name, number in (("eq1", 0), ("eq2", 1)):
        ratios = set()
        for at in points(3):
            g = (at["g_11"], at["g_12"], at["g_22"])
            tensor = tensors(at)[number]
            row = g[0] * tensor[0][1] + g[1] * tensor[1][1]
            row -= g[1] * tensor[0][0] + g[2] * tensor[1][0]
            ratios.add(value(written[name], at) / row)
        assert len(ratios) == 1, name
        assert ratios != {0}


def tensors(at: Mapping[str, Fraction]) -> tuple[list[list[Fraction]], list[list[Fraction]]]:
    """Phi and nabla Phi of f = (-y, -x + u w), where u = x' and w = y', worked out by hand."""
    x, y, u, w = at["x"], at["y"], at["v_x"], at["v_y"]
    f, g = -y, -x + u * w
    # J = [[0, 0], [w, u]], J^2 = u J, dJ/dt = [[0, 0], [g, f]].
    phi = [[Fraction(0), Fraction(-1)], [-1 + u * w / 4 - g / 2, u * u / 4 - f / 2]]
    slope_of_g = -u + f * w + u * g
    slope = [
        [Fraction(0), Fraction(0)],
        [(f * w + u * g) / 4 - slope_of_g / 2, u * f / 2 + w / 2],
    ]
    j = [[Fraction(0), Fraction(0)], [w, u]]
    return phi, [
        [
            slope[a][b] + sum((phi[a][c] * j[c][b] - j[a][c] * phi[c][b]) / 2 for c in range(2))
            for b in range(2)
        ]
        for a in range(2)
    ]


def test_the_point_that_is_named_has_no_zero_denominator(result: dict[str, Any]) -> None:
    """A theorem about no numbers at all would prove nothing."""
    text = proof_document(result, "coq", 1)
    (names,) = re.findall(r"exists ([\w ]+) : R,", text)
    (given,) = re.findall(r"Proof\. exists (.+?);", text)
    numbers = [value(one, {}) for one in given.split(", ")]
    at = dict(zip(names.split(), numbers, strict=True))
    named = re.findall(r"\(nz\d+ : (.+) <> 0\)", text)
    assert all(value(one, at) != 0 for one in named)


def test_the_multiplier_is_symmetric_and_the_definition_of_f_is_that_of_the_system(
    result: dict[str, Any],
) -> None:
    text = proof_document(result, "coq", 1)
    entries = dict(re.findall(r"\| (\d%nat, \d%nat) => (_g_\d\d)", text))
    assert len(entries) == 4
    for place, name in entries.items():
        i, j = (int(one[0]) for one in place.split(", "))
        assert name == f"_g_{min(i, j) + 1}{max(i, j) + 1}"
    assert "(* The system: x'' = -y *)" in text
    assert "(* The system: y'' = -x + x'*y' *)" in text
