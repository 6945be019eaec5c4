"""The rows and matrices of claims about kinds agree with the mathematics: each false claim next to
a true one.
"""

from __future__ import annotations

import random
import time
from fractions import Fraction
from itertools import combinations, combinations_with_replacement, product
from typing import Any

import pytest
import sympy
from flint import arb, ctx

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.formulas import read_tokens, value_of
from inverse_service.certificate.kinds import OfKind, is_definite
from inverse_service.certificate.numbers import Balls, Unsettled
from inverse_service.certificate.question import Tools
from tests.certificate.documents import FORMAT, Document

GENERAL = "rayleigh_general"


def claim(kind: object, lagrangian: str = "", /, *forces: str, **more: object) -> Document:
    names = ["x", "y", "z"][: len(forces)]
    system = {
        "coordinates": names,
        "equations": dict(zip(names, forces, strict=True)),
        "parameters": ["a"],
    }
    head = {
        "format": FORMAT,
        "system": system,
        "question": "autonomous",
        "claim": "variational",
        "among": kind,
    }
    return head | ({"kind": "lagrangian", "lagrangian": lagrangian} if lagrangian else {}) | more


def rows_of(kinds: dict[str, int], variables: int, order: int) -> list[Any]:
    """All rows of two coordinates, by the order of each condition."""
    found = []
    for kind, (i, j) in product(kinds, ((0, 0), (0, 1), (1, 1))):
        if ((kind[:1] in "CD" or kind == "H3") and i == j) or (kind[0] == "S" and i < j):
            continue
        least = order - kinds[kind]
        alphas = (list(a) for a in product(range(least + 1), repeat=variables) if sum(a) <= least)
        found += [[kind, i, j, alpha] for alpha in alphas]
    return found


NATURAL = {"H2": 1, "H3": 0, "K0": 1, "K1": 1}
HOMOGENEOUS = NATURAL | {"K2": 1, "S2": 0}
FINSLER = {"H2": 1, "H3": 0, "K0": 1, "S0": 0}


def no(kind: object, rows: list[Any], /, *forces: str, **more: object) -> Document:
    more = {"claim": "not_variational", "kind": "nonexistence", "order": 2, "rows": rows} | more
    return claim(kind, "", *forces, **more)


TURN: Document = {"invariant": [{"x": "-y", "y": "x"}]}
PLACE = {"t": "1", "a": "1", "x": "1", "y": "1", "x'": "1", "y'": "1"}


def definite(lagrangian: str, /, *forces: str, **more: object) -> Document:
    return claim("positive_definite", lagrangian, *forces, **{"near": PLACE, **more})


# u'' = (1 - u^2) u' - u, w'' = -2 w for u = x + y, w = y: the remaining g is a du^2 + b dw^2.
COUPLED = ("(1 - (x + y)^2)*(x' + y') - (x + y) + 2*y", "-2*y")
LEFT = {"kind": "existence", "order": 2, "degree": 1, "dimensions": [2, 4],
        "symbol": {"dimension": 2, "prolonged": 2, "characters": [2, 0, 0, 0]}}  # fmt: skip
FLAT = {"kind": "existence", "order": 2, "degree": 1, "dimensions": [3, 8],
        "symbol": {"dimension": 5, "prolonged": 7, "characters": [3, 2]}}  # fmt: skip


def verdict(document: Document) -> str:
    return check_certificate(document, seed=1).verdict


def with_multiplier(forces: tuple[str, str], data: Document, multiplier: Any) -> str:
    return verdict(definite("", *forces, **data, multiplier=multiplier))


@pytest.mark.parametrize(
    "matrix", [[[1, 1], [1, 3]], [["2/3", "2/3"], ["2/3", "1"]], [[5, 5], [5, "5.001"]]]
)
def test_a_definite_matrix_that_is_left_proves_existence(matrix: Any) -> None:
    assert with_multiplier(COUPLED, LEFT, matrix) == "valid"


@pytest.mark.parametrize(
    "matrix",
    [
        [[1, 0], [0, 1]], [[1, "1/2"], ["1/2", 3]], [[2, 1], [1, 3]], [["1/2", 1], [1, 3]],  # excluded
        [[1, 1], [1, 1]], [[1, 1], [1, "1/2"]], [[-1, -1], [-1, -3]], [[0, 0], [0, 1]], [[0, 0], [0, 0]],  # indefinite
        [[1, 1], [0, 3]], [[1, 0], [1, 3]], [[1, 1]], [[1]], [],
    ],
)  # fmt: skip
def test_another_matrix_does_not(matrix: Any) -> None:
    assert with_multiplier(COUPLED, LEFT, matrix) == "invalid"


@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        ([[2, 1], [1, 3]], "valid"), ([[1, 2], [2, 1]], "invalid"), ([[1, 1], [1, 1]], "invalid"),
        ([[2, 1], [0, 2]], "invalid"), ([[1, -1], [-1, "1.000001"]], "valid"), ([[1, 0], [0, 0]], "invalid"),
    ],
)  # fmt: skip
def test_of_free_particles_every_definite_matrix_is_left(matrix: Any, expected: str) -> None:
    assert with_multiplier(("0", "0"), FLAT, matrix) == expected


@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        ([[1, 0], [0, 0]], "valid"),  # of x'' = y, y'' = 0 every multiplier has g_11 = 0
        ([[0, 0], [0, 1]], "invalid"), ([[1, 0], [0, 1]], "invalid"), ([[0, 0], [0, 0]], "invalid"),
    ],
)  # fmt: skip
def test_an_entry_that_must_be_zero_excludes_what_is_definite(matrix: Any, expected: str) -> None:
    rows = [["H3", 0, 1, [0, 0, 0, 0]]]
    asked = no("positive_definite", rows, "y", "0", near=PLACE, order=1, orthogonal=matrix)
    assert verdict(asked) == expected


def test_where_the_place_is_not_whole_nothing_definite_is_proven() -> None:
    for name in PLACE.keys() - {"t"}:
        less = {key: value for key, value in PLACE.items() if key != name}
        assert (
            verdict(definite("", *COUPLED, **LEFT, multiplier=[[1, 1], [1, 3]], near=less))
            == "invalid"
        )
    for more in (PLACE | {"t": "2"}, {key: value for key, value in PLACE.items() if key != "t"}):
        assert (
            verdict(definite("", *COUPLED, **LEFT, multiplier=[[1, 1], [1, 3]], near=more))
            == "valid"
        )


def test_what_holds_at_the_place_alone_proves_nothing() -> None:
    """At x = 1 these look like free particles to the twelfth order, but they have no Lagrangian."""
    special = ("(x - 1)^12*(x^2 + y^2)", "0")
    assert verdict(definite("", *special, **FLAT, multiplier=[[1, 0], [0, 1]])) == "incomplete"
    assert verdict(definite("x'^2/2 + y'^2/2", *special)) == "invalid"
    assert verdict(definite("x'^2/2 + y'^2/2 + (x - 1)^9", "0", "0")) == "invalid"
    assert verdict(definite("x'^2/2 + y'^2/2 + exp(x)", "exp(x)", "0")) == "valid"


def test_a_definite_l_may_have_a_negative_sign_only_as_a_whole() -> None:
    for text, expected in (("x'^2 + y'^2", "valid"), ("-x'^2 - y'^2", "valid"), ("x'^2 - y'^2", "invalid"),
                           ("-x'^2 + y'^2", "invalid"), ("x'*y'", "invalid"), ("x'^2 + x'*y'", "invalid"),
                           ("x'^2 + x'*y' + y'^2/3", "valid"), ("x'^2 + x'*y' + y'^2/5", "invalid")):  # fmt: skip
        assert verdict(definite(text, "0", "0")) == expected, text


@pytest.mark.slow
def test_definite_matrices_are_those_that_sympy_calls_definite() -> None:
    generator = random.Random(4)
    met = set()
    for size in (1, 2, 3, 4) * 30:
        root = [
            [generator.randint(-2, 2) for _ in range(size)]
            for _ in range(generator.randint(1, size))
        ]
        gram = sympy.Matrix(root).T * sympy.Matrix(root) + generator.randint(-1, 1) * sympy.eye(
            size
        )
        rows = [[Fraction(int(x)) for x in gram.row(k)] for k in range(size)]
        found = is_definite(rows), is_definite(rows, "with_their_rows")
        assert found == (gram.is_positive_definite, gram.is_positive_semidefinite), rows
        met.add((size, *found))
    assert len(met) == 12


def test_a_ball_that_holds_zero_settles_nothing() -> None:
    one, wide = arb(1), arb(0, 1e-30)
    for rows in ([[wide]], [[arb(1, 1)]], [[one, one], [one, one + wide]]):
        with pytest.raises(Unsettled):
            is_definite(rows)
    assert is_definite([[one, wide], [wide, one]])


# L = ((1 + y^2 z) x'^2 + (1 + z^2) y'^2 + z'^2)/2 with D = x' y' y/2 + z'^2 x/2 + x' z'.
DISSIPATIVE = (
    "(y'*y/2 + z' - (2*y*z*y' + y^2*z')*x')/(1 + y^2*z)",
    "(x'^2*y*z - 2*z*z'*y' + x'*y/2)/(1 + z^2)",
    "z*y'^2 + y^2*x'^2/2 + z'*x + x'",
)
POINT = {"x": "0.3", "y": "0.7", "z": "-0.4", "x'": "1.1", "y'": "0.6", "z'": "-0.9", "a": "1"}
NATURAL_L, FRICTION = "((1 + y^2*z)*x'^2 + (1 + z^2)*y'^2 + z'^2)/2", "x'*y'*y/2 + z'^2*x/2 + x'*z'"


def test_the_rows_of_friction_vanish_on_an_l_with_friction() -> None:
    """Each of C, D, and K is 0 on the derivatives of L at a point, and most are nonzero on those of
    another L.
    """
    assert verdict(claim("rayleigh", NATURAL_L, *DISSIPATIVE, dissipation=FRICTION)) == "valid"
    given = claim("rayleigh", "", *DISSIPATIVE, kind="existence", near=POINT)
    asked = OfKind(Tools(random.Random(1), time.thread_time() + 60), given["system"], False, given)
    asked.prepare(lambda ring: None)
    rows = [(f"C{k}", pair) for k in range(3) for pair in combinations(range(3), 2)] + [
        ("D2", (0, 1))
    ]
    rows += [
        (f"K{k}", pair) for k in range(3) for pair in combinations_with_replacement(range(3), 2)
    ]
    with ctx.workprec(192):
        ring = asked.expansion(Balls(asked, asked.place, None), 3)
        right, wrong = (
            value_of(ring, read_tokens(text, "L"))
            for text in (NATURAL_L, f"{NATURAL_L} + x*x'^3*y'")
        )
        terms = [ring.terms(kind, *place) for kind, place in rows]
        at = [[float(ring.value(some, one).get(0, 0)) for some in terms] for one in (right, wrong)]
    assert max(map(abs, at[0])) < 1e-20
    assert sum(abs(value) > 1e-3 for value in at[1]) >= 10


def test_friction_of_one_coordinate_leaves_every_l() -> None:
    symbol = {"dimension": 2, "prolonged": 3, "characters": [1, 1]}
    data = {"kind": "existence", "order": 1, "degree": 1, "dimensions": [1, 3], "symbol": symbol}
    assert verdict(claim(GENERAL, "", "-x - x'^3", **data)) == "valid"


# L = exp(x y) x'^4/y'^2 of degree 2 in the velocities; the trace of the curvature is not symmetric.
ONLY_FINSLER = ("-y*x'^2/4", "x*y'^2/2")


def test_a_finsler_metric_that_is_not_riemannian_is_refused_by_no_rows() -> None:
    assert verdict(claim("finsler", "exp(x*y)*x'^4/y'^2", *ONLY_FINSLER)) == "valid"
    for order in (1, 2, 3):
        assert (
            verdict(no("finsler", rows_of(FINSLER, 4, order), *ONLY_FINSLER, order=order))
            == "invalid"
        )
    assert verdict(no("riemannian", rows_of(HOMOGENEOUS, 4, 2), *ONLY_FINSLER)) == "valid"


@pytest.mark.parametrize("order", [2, 3])
def test_the_only_invariant_l_is_refused_by_no_rows(order: int) -> None:
    forces = ("-x*(x^2 + y^2)", "-y*(x^2 + y^2)")
    assert verdict(claim(TURN, "x'^2/2 + y'^2/2 - (x^2 + y^2)^2/4", *forces)) == "valid"
    assert verdict(no(TURN, rows_of(FINSLER, 4, order), *forces, order=order)) == "invalid"


def test_a_field_with_a_root_of_a_number_is_refused() -> None:
    field = {"invariant": [{"x": "2^(1/2)"}]}
    assert verdict(claim(field, "x'^2/2", "0")) == "invalid"
