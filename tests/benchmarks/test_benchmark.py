"""What the benchmark measures is what it says; nothing is timed here."""

from __future__ import annotations

import pytest
import sympy

from benchmarks import families, tables
from benchmarks.decision_benchmark import Comparison, medians, read
from benchmarks.growth import against_order
from benchmarks.isolated import measure
from benchmarks.plain import SIMPLIFICATIONS, endomorphism, field_of, plain_verdict
from benchmarks.sympy_form import to_sympy
from inverse_service import catalogue
from inverse_service.expressions.tree import Acceleration
from inverse_service.inverse_problem.decision.deciding import decide
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula


def comparison(n: int, seconds: float, plain: float | None, verdict: str | None = "variational") -> Comparison:
    return Comparison("x", n, "variational", "variational", 2, seconds, {"cancel": plain}, {"cancel": verdict})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["isotropic-oscillator-2d", "henon-heiles", "douglas-iiib", "knife-edge-first"])
def test_the_plain_pipeline_is_right_on_small_systems(name: str) -> None:
    system = read(catalogue.document(name))
    assert plain_verdict(system, sympy.cancel) == catalogue.entry(name)["expected"]["verdict"]


@pytest.mark.slow
def test_the_plain_pipeline_stops_at_the_algebraic_conditions() -> None:
    system = read(catalogue.document("iiia-differential-obstruction-3"))
    assert plain_verdict(system, sympy.cancel) == "variational"
    assert catalogue.entry("iiia-differential-obstruction-3")["expected"]["verdict"] == "not_variational"


def test_the_plain_endomorphism_of_an_oscillator_is_twice_its_stiffness() -> None:
    field = field_of(read({"coordinates": ["x", "y"], "equations": {"x": "-x", "y": "-4*y"}}), sympy.cancel)
    N, Phi = endomorphism(field)
    assert sympy.zeros(2, 2) == N
    assert sympy.diag(2, 8) == Phi


@pytest.mark.slow
def test_a_measurement_past_its_limit_is_none() -> None:
    slow = catalogue.document("generic-class-two-first")
    assert measure("benchmarks.plain", ["cancel"], slow, 1) is None


@pytest.mark.slow
def test_an_isolated_run_tells_verdict_and_memory() -> None:
    found = measure("benchmarks.plain", ["cancel"], families.oscillator_chain(2), 60)
    assert found is not None
    assert found["verdict"] == "variational"
    assert found["megabytes"] > 1


@pytest.mark.parametrize("make", list(families.GROWING.values()))
@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_family_has_the_size_and_verdict_that_it_says(make: object, n: int) -> None:
    assert callable(make)
    document = make(n)
    system = read(document)
    assert len(system.coordinates) == n
    expected = "not_variational" if make is families.random_quadratic and n > 1 else "variational"
    assert decide(system, False).verdict == expected


def test_random_natural_systems_are_variational() -> None:
    for seed in range(3):
        assert decide(read(families.random_natural(2, seed)), False).verdict == "variational"


def test_unknowns_grow_with_the_order() -> None:
    rows = against_order(families.cubic_chain(2), 2, 60.0, lambda _: None)
    assert [row.order for row in rows] == [0, 1, 2]
    # coefficients of L of degree d + 2 in (q, v) and of v-degree >= 2, n = 2: 3, 10, 22 for d = 0, 1, 2
    assert [row.unknowns for row in rows] == [3, 13, 35]


def test_a_ratio_counts_only_right_plain_verdicts() -> None:
    assert comparison(2, 0.5, 5.0).ratio("cancel") == 10
    assert comparison(2, 0.5, 5.0, "not_variational").ratio("cancel") is None
    assert comparison(2, 0.5, None, None).ratio("cancel") is None


def test_medians_count_how_plain_runs_ended() -> None:
    ends = [comparison(2, 0.5, 5.0), comparison(2, 1.0, None, None), comparison(2, 1.5, 1.0, "not_variational")]
    (row,) = medians(ends)
    assert (row.systems, row.seconds, row.slowest) == (3, 1.0, 1.5)
    assert (row.right, row.wrong, row.stopped) == ({"cancel": 1}, {"cancel": 1}, {"cancel": 1})
    assert row.ratios == {"cancel": 10}


def test_tables_show_a_wrong_verdict() -> None:
    wrong = Comparison(
        "x", 1, "variational", "not_variational", 2, 0.1, dict.fromkeys(SIMPLIFICATIONS), dict.fromkeys(SIMPLIFICATIONS)
    )
    assert "WRONG" in tables.comparison_table([wrong])
    assert tables.table(["a", "b"], [["1", "2"]]).splitlines()[1] == "| --- | ---: |"


def test_all_forms_of_formula_reach_sympy() -> None:
    names = Names(("x", "y"), ("k",), {"A": ("x",), "B": ("x", "y")})
    formula = read_formula("k*sqrt(x)*x'/3 + atan(y)^2 - pi*A'(x) + B[1,2](x, y)", names)
    x, y, k, A, B = sympy.Symbol("x"), sympy.Symbol("y"), sympy.Symbol("k"), sympy.Function("A"), sympy.Function("B")
    expected = k * sympy.sqrt(x) * sympy.Symbol("x'") / 3 + sympy.atan(y) ** 2 - sympy.pi * A(x).diff(x)
    assert to_sympy(formula) - expected - B(x, y).diff(x, y, y) == 0
    with pytest.raises(KeyError):
        to_sympy(Acceleration("x"))
