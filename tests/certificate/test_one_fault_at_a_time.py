"""In documents with one error the checker finds and names it; correct documents at the bounds are
valid.
"""

from __future__ import annotations

import random
from typing import Any

import pytest

from inverse_service.certificate.checker import check_certificate
from inverse_service.certificate.numbers import Residues
from inverse_service.certificate.question import Question, Tools
from inverse_service.certificate.series import Elimination, Expansion, Symbol, symbol_of as sizes_of
from tests.certificate.documents import (
    Document,
    changed,
    check_result,
    existence,
    lagrangian,
    nonexistence,
    result,
)
from tests.certificate.test_nonexistence_certificates import BAD_ROWS

TIMED = "time_dependent"
PRIME = 2**61 - 1


def on(document: Document, equations: dict[str, str], **parts: Any) -> Document:
    """The document for another system."""
    system = {"coordinates": list(equations), "equations": equations, **parts}
    return {**document, "system": system}


def verdict(document: Any) -> str:
    return check_certificate(document, seed=1).verdict


def reason(document: Any) -> str:
    found = check_certificate(document, seed=1)
    assert found.verdict == "invalid"
    return found.reasons[0]


# Formulas


def with_function(text: str) -> Document:
    document = lagrangian("free", f"x'^2/2 + 0*({text})")
    document["system"]["functions"] = {"B": ["x", "y"]}
    return document


@pytest.mark.parametrize(
    "text",
    [
        "diff(B(x, x), x)", "diff(B(2, x), x)", "diff(B(x', x), x + x)", "diff(B(x', x), q)", "B[20,1](x', x)",
        "B[21,0](x', x)", "B[1](x', x)", "B[1,0,0](x', x)", "B(x)", "B(x, x, x)", "B'(x', x)", "sin(x', x)", "B[1,0]",
        "x'[1](x)",
    ],
)  # fmt: skip
def test_an_invalid_derivative_is_rejected_next_to_a_good_lagrangian(text: str) -> None:
    assert verdict(with_function("B(x', x)")) == "valid"
    assert verdict(with_function(text)) == "invalid"


@pytest.mark.parametrize(
    "text",
    [
        "B[20,0](x', x)",
        "B[7,13](x', x)",
        "diff(B(x', x), x', x)",
        f"diff(B(x', x), {', '.join(['x'] * 20)})",
    ],
)
def test_derivatives_of_order_twenty_are_read(text: str) -> None:
    assert verdict(with_function(text)) == "valid"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("before", "behind"),
    [("(", ")"), ("-(", ")"), ("sin(", ")"), ("B(x, ", ")"), ("B(", ", x)"), ("2^(x+", ")")],
)
def test_two_hundred_brackets_inside_each_other_are_the_most(before: str, behind: str) -> None:
    """The factor 0 has its own pair; an exponent counts twice, as power and as bracket."""
    most = 99 if before.startswith("2^") else 199
    assert verdict(with_function(before * most + "x" + behind * most)) in ("valid", "incomplete")
    found = check_certificate(
        with_function(before * (most + 2) + "x" + behind * (most + 2)), seed=1
    )
    assert found.verdict == "invalid"
    assert "nested" in found.reasons[0]


@pytest.mark.parametrize("text", ["(x-x)^0 - 1", "0^0 - 1", "(x-x)^2", "x^0 - 1", "(x-x)^(0) - 1"])
def test_the_power_zero_is_one_even_of_zero(text: str) -> None:
    assert verdict(lagrangian("free", f"x'^2/2 + ({text})*x^3")) == "valid"
    assert verdict(lagrangian("free", f"x'^2/2 + ({text})*exp(x)")) == "valid"


# Shapes


def test_an_object_of_a_thousand_members_is_the_largest() -> None:
    document = lagrangian("free", "x'^2")
    full = document | {f"note {k}": k for k in range(1000 - len(document))}
    assert verdict(full) == "valid"
    assert "moderate object" in reason(full | {"one more": 1})


def test_an_integer_has_the_bounds_of_its_text() -> None:
    document = existence("oscillator", 2, [1, 2], [1, 1, 1])
    for number, good in ((10**400 - 1, True), (-(10**400) + 1, True), (10**400, False)):
        series = {"order": 0, "point": {"x": number, "x'": "5"}, "terms": [[[0, 2], "1"]]}
        for point in (number, str(number)):
            series["point"] = {"x": point, "x'": "5"}
            assert (verdict({**document, "series": series}) == "valid") is good


def test_a_point_may_name_everything_and_nothing_else() -> None:
    document = lagrangian("van-der-pol", "x'^2", near={"t": "0", "x": "1", "x'": "2", "mu": "-1/3"})
    assert verdict(on(document, {"x": "0"}, parameters=["mu"])) == "valid"
    assert "near" in reason(changed(on(document, {"x": "0"}, parameters=["mu"]), "near.y", "1"))


def test_a_domain_of_a_thousandth_is_found_where_the_certificate_says() -> None:
    text = "sqrt(x' - 100) + log(100.002 - x')"
    for name, value in (("x'", "100.001"), ("x", "100.001")):
        document = lagrangian(
            "free", text.replace("x'", name) + ("" if name == "x'" else " + x'^2")
        )
        document["lagrangian"] = f"x'^2/2 + 0*({document['lagrangian']})"
        assert verdict(document) == "incomplete"
        assert verdict({**document, "near": {name: value}}) == "valid"


# The two questions


def test_t_in_a_lagrangian_is_not_a_constant() -> None:
    """If t were a constant, t x'^2 would be a Lagrangian of x'' = 0."""
    assert "contains t" in reason(lagrangian("free", "t*x'^2"))
    assert "does not hold" in reason(lagrangian("free", "t*x'^2", TIMED))


def test_t_in_f_is_not_a_parameter() -> None:
    document = existence("painleve-I", 2, [1, 2], [1, 1, 1])
    assert "question has to be" in reason(document)
    assert verdict(on(document, {"x": "6*x^2 + a"}, parameters=["a"])) == "valid"


def test_two_verdicts_on_one_question_are_refused() -> None:
    proof = lagrangian("painleve-I", "x'^2/2 + 2*x^3 + t*x", TIMED)
    timed = {
        "verdict": "variational",
        "certificate": proof,
        "lagrangian": {"text": proof["lagrangian"]},
    }
    for question in ({}, {"question": "L(t, q, q')"}):
        document = result(
            "painleve-I",
            "undetermined",
            None,
            verdict_with_time="variational",
            with_time=timed,
            **question,
        )
        found = check_result(document, seed=1)
        assert found.verdict == "invalid"
        assert "the same question differ" in found.reasons[0]


# Rows


@pytest.mark.parametrize(
    "row", [row for rows in BAD_ROWS[5:] if rows for row in rows[:1] if row not in ([], None)]
)
def test_one_bad_row_among_rows_that_suffice_is_refused(row: Any) -> None:
    document = nonexistence("douglas-IIIb", 2)
    if row in document["rows"]:
        row = list(row)
    found = check_certificate({**document, "rows": [*document["rows"], row]}, seed=1)
    assert found.verdict == "invalid"
    assert "regular" not in found.reasons[0]


def test_rows_of_order_twenty_are_read() -> None:
    document = nonexistence(
        "douglas-IIIb", 20, rows=[["H3", 0, 1, [20, 0, 0, 0]], ["H2", 0, 0, [0, 0, 0, 19]]]
    )
    assert "leave a regular multiplier" in reason(document)
    for row in (
        ["H2", 0, 0, [0, 0, 0, 20]],
        ["H3", 0, 1, [20, 1, 0, 0]],
        ["H3", 0, 1, [21, 0, 0, 0]],
    ):
        assert "regular" not in reason({**document, "rows": [row]})


def test_what_is_left_is_seen_to_be_singular_in_slanted_coordinates() -> None:
    """With x = u, y = u + w the multiplier that Douglas's system leaves is G ((1, 1), (1, 1))."""
    force = "u^2+(u+w)^2"
    document = on(nonexistence("douglas-IIIb", 2), {"u": force, "w": f"-({force})"})
    assert verdict(document) == "valid"
    assert (
        verdict(on(nonexistence("douglas-IIIb", 2), {"u": force, "w": f"-2*({force})"})) == "valid"
    )
    assert "regular" in reason(on(document, {"u": "u+w", "w": "u-w"}))


# Existence


def test_a_degree_above_the_order_is_refused_as_such() -> None:
    document = existence("henon-heiles", 2, [1, 1, 1, 1], [0, 0])
    assert "degree has to be" in reason(document)


@pytest.mark.parametrize(("order", "degree"), [(20, 20), (20, 1), (21, 1), (20, 21)])
def test_order_and_degree_are_twenty_at_most(order: int, degree: int) -> None:
    """One free particle has D_k = k + 1 at every order."""
    found = verdict(existence("free", order, list(range(1, degree + 2)), [1, 1, 1]))
    assert found == ("valid" if max(order, degree) == 20 else "invalid")


@pytest.mark.parametrize(
    ("equations", "dimensions", "symbol", "question"),
    [
        ({"x": "y", "y": "x"}, [2, 4], [2, 2, 2], "autonomous"),
        ({"x": "y", "y": "x"}, [2, 6], [4, 6, 2, 2], TIMED),
        ({"x": "x'^2", "y": "x'*y'"}, [2, 5], [3, 4, 2, 1], "autonomous"),
    ],
)
def test_symbols_whose_equations_have_several_terms_are_right(
    equations: dict[str, str], dimensions: list[int], symbol: list[int], question: str
) -> None:
    document = on(existence("free-pair", 2, dimensions, symbol, question), equations)
    assert verdict(document) == "valid"
    assert "dimensions" in reason(changed(document, "symbol.prolonged", symbol[1] + 1))
    characters = [*symbol[2:-1], symbol[-1] - 1, 1]
    assert "dimensions" in reason(changed(document, "symbol.characters", characters))


def symbol_of(*kept: list[int]) -> Symbol:
    """Dimension, prolonged dimension, and characters of the symbol of degree 2 with just these
    monomials of L.
    """
    system = existence("free-pair", 2, [], [0, 0])["system"]
    question = Question(Tools(random.Random(1), float("inf")), system, timed=False)
    question.prepare(lambda ring: None)
    ring = Expansion(Residues(question, PRIME, 1, {}), 5)
    elimination = Elimination(ring.arithmetic, ring.shift)
    left = {question.multi_index(exponents, 4) for exponents in kept}
    for key in ring.unknowns(2):
        if key not in left:
            elimination.insert({key: 1})
    directions = [
        [random.Random(9 * a + b).randrange(1, 1 << 20) for a in range(4)] for b in range(4)
    ]
    return sizes_of(elimination, ring, 2, directions)[0]


@pytest.mark.parametrize(
    ("kept", "sizes"),
    [
        ([[2, 0, 2, 0]], Symbol(1, 1, (1, 0, 0, 0))),
        ([[2, 0, 2, 0], [1, 1, 2, 0]], Symbol(2, 2, (2, 0, 0, 0))),
        ([[2, 0, 2, 0], [1, 1, 2, 0], [0, 2, 2, 0]], Symbol(3, 4, (2, 1, 0, 0))),
        ([], Symbol(0, 0, (0, 0, 0, 0))),
    ],
)
def test_symbols_have_their_dimensions(kept: list[list[int]], sizes: Symbol) -> None:
    """The spans of x^2, of x^2 and x y, and of all squares, times x'^2, are involutive."""
    assert symbol_of(*kept) == sizes


def test_a_symbol_that_is_not_involutive_has_too_small_a_prolongation() -> None:
    """x y x'^2 alone: no cubic has all its derivatives in the span, but one derivative does not
    annihilate it.
    """
    assert symbol_of([1, 1, 2, 0]) == Symbol(1, 0, (1, 0, 0, 0))


EXPONENTIAL = {"x": "-pi*x'^2/2"}  # g = exp(pi x): L = exp(pi x) x'^2/2 solves the rows


def exponential_series(prime: int) -> Document:
    """L = (1 + k x + k^2 x^2/2) w^2/2 about x = 0, x' = 1 + w, with k = 5 instead of pi."""
    point = {"x": "0", "x'": "1", "pi": "5"}
    terms = [[[0, 2], "1/2"], [[1, 2], "5/2"], [[2, 2], "25/4"]]
    series = {"order": 2, "point": point, "terms": terms, "prime": prime}
    return on(existence("oscillator", 2, [1, 2], [1, 1, 1], series=series), EXPONENTIAL)


@pytest.mark.parametrize("prime", [PRIME, 2**30 + 3])
def test_a_series_is_compared_term_by_term(prime: int | None) -> None:
    document = exponential_series(prime=prime)
    found = check_certificate(document, seed=1)
    assert found.verdict == "valid", found.reasons
    for place in (1, 2):
        assert "does not solve" in reason(changed(document, f"series.terms.{place}.1", "1/2"))
        assert "does not solve" in reason(
            changed(document, f"series.terms.{place}", [[0, 4], "1/2"])
        )
    shifted = changed(document, "system.equations.x", "-pi*x'^2/2 + x'/7")
    assert "does not solve" in reason(shifted)
    less = {**document["series"], "terms": document["series"]["terms"][:2]}
    assert "does not solve" in reason({**document, "series": less})
    assert verdict({**document, "series": {**less, "order": 1}}) == "valid"


def test_a_series_with_pi_is_not_compared_over_the_rationals() -> None:
    document = changed(exponential_series(prime=PRIME), "series.prime", None)
    assert "not compared" in check_certificate(document, seed=1).reasons[0]


def test_a_series_modulo_a_prime_names_a_value_of_pi() -> None:
    document = exponential_series(prime=PRIME)
    assert "pi" in reason(changed(document, "series.point.pi", ...))
    assert verdict(changed(document, "series.point.pi", "4")) == "invalid"
    without = existence(
        "oscillator", 2, [1, 2], [1, 1, 1], series={**document["series"], "terms": [[[0, 2], "1"]]}
    )
    assert verdict(changed(without, "series.point.pi", ...)) == "valid"


def test_the_primes_of_a_series_lie_above_two_to_the_thirty() -> None:
    assert "2^30" in reason(exponential_series(prime=1073741789))
    assert "2^30" in reason(exponential_series(prime=2**31 - 3))


def test_a_series_has_no_term_beyond_its_order() -> None:
    document = exponential_series(prime=PRIME)
    longer = [*document["series"]["terms"], [[3, 2], "0"]]
    assert "multi-index" in reason(changed(document, "series.terms", longer))


@pytest.mark.parametrize("order", [20, 21])
def test_a_series_of_order_twenty_is_the_longest(order: int) -> None:
    terms = [[[0, 2], "1/2"], [[0, 22], "0"], [[20, 2], "0"]]
    series = {"order": order, "point": {"x": "3", "x'": "5"}, "terms": terms}
    found = check_certificate(existence("oscillator", 2, [1, 2], [1, 1, 1], series=series), seed=1)
    assert found.verdict == ("valid" if order == 20 else "invalid")


def test_a_series_is_not_compared_where_functions_are_arbitrary() -> None:
    series = {"order": 2, "point": {"x": "3", "x'": "5"}, "terms": [[[0, 2], "1/2"]]}
    document = existence("oscillator", 2, [1, 2], [1, 1, 1], series=series)
    found = check_certificate(on(document, {"x": "A(x)*x'^2"}, functions={"A": ["x"]}), seed=1)
    assert found.verdict == "valid"
    assert "not compared" in found.reasons[0]
