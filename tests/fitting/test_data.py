"""Models of PySINDy, tables and expressions to documents, and conditions back to constraints."""

from __future__ import annotations

import sys
import warnings
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy

from inverse_service import data, errors
from inverse_service.service.documents import documents


class Fitted:
    """What a fitted `pysindy.SINDy` offers."""

    def __init__(self, states: list[str], features: list[str], rows: list[list[float]]) -> None:
        self.feature_names = states
        self._features, self._rows = features, rows
        self.optimizer = SimpleNamespace()

    def coefficients(self) -> Any:
        return np.array(self._rows)

    def get_feature_names(self) -> list[str]:
        return self._features


class Table(dict[str, Any]):
    """What a table of pandas offers here."""

    columns = property(list)


SPRINGS = Fitted(
    ["a", "va", "b", "vb"],
    ["1", "a", "va", "b", "vb", "a^2", "a b", "sin(1 a)"],
    [
        [0, 0, 0.998, 0, 0, 0, 0, 0],
        [0, -2.01, 0, 1.02, 0, 0, 0, 0],
        [0, 0, 0, 0, 1.001, 0, 0, 0],
        [0, 0.97, 0, -1.99, 0, 0, 0.5, 0],
    ],
)


def test_coordinates_are_seen_from_q_prime_equals_v() -> None:
    found = data.from_sindy(SPRINGS)
    assert found.coordinates == ("a", "b")
    assert found.terms == ("1", "a", "a'", "b", "b'", "a^2", "a*b", "sin(1*a)")
    assert found.names == ("a'': a", "a'': b", "b'': a", "b'': b", "b'': a*b")
    equations = documents.parse_document(dict(found.document))["equations"]
    assert equations["a"]["text"] == "-2.01*a + 1.02*b"
    assert equations["b"]["text"] == "0.97*a - 1.99*b + a*b/2"


@pytest.mark.parametrize("rate", [1.5, -1, 0.5])
@pytest.mark.parametrize("other", [0, 0.3])
def test_a_model_of_first_order_is_refused_with_what_is_missing(rate: float, other: float) -> None:
    """y is a velocity of x only if x' = y: with x' = rate y the accelerations are others."""
    model = Fitted(["x", "y"], ["x", "y"], [[0, rate], [-1, other]])
    with pytest.raises(errors.InputError, match="are not coordinates and velocities"):
        data.from_sindy(model)


def test_the_covariance_of_an_ensemble_is_that_of_its_models() -> None:
    random = np.random.default_rng(1)
    model = Fitted(["x", "v"], ["x", "v"], [[0, 1], [-1, -0.2]])
    drawn = [np.array([[0, 1], [-1, -0.2]]) + random.normal(0, 0.1, (2, 2)) for _ in range(40)]
    model.optimizer = SimpleNamespace(coef_list=drawn)
    found = data.from_sindy(model)
    assert found.covariance is not None
    expected = np.cov(np.array([one[1] for one in drawn]).T)
    assert np.abs(found.covariance - expected).max() < 1e-8


def test_constraints_hold_for_the_member_and_not_for_the_fit() -> None:
    found = data.from_sindy(SPRINGS)
    member = {
        "constraints": {
            "coefficients": list(found.names),
            "matrix": [
                ["0", "1", "-1", "0", "0"],
                ["0", "0", "0", "0", "1"],
                ["1", "0", "0", "0", "0"],
            ],
            "values": ["0", "0", "-2"],
        }
    }
    left, right = data.constraints(found, member)
    rows = np.array(SPRINGS.coefficients())
    assert np.abs(left @ rows.ravel() - right).max() == pytest.approx(0.5)
    rows[0, 2] = rows[2, 4] = 1
    rows[1, 3] = rows[3, 1] = 1.0
    rows[1, 1] = -2
    rows[3, 6] = 0
    assert np.abs(left @ rows.ravel() - right).max() == 0
    assert np.linalg.matrix_rank(left) == len(left)


def test_expressions_of_symbols_become_a_document() -> None:
    x, y, u, w = sympy.symbols("x y u w")
    found = data.from_expressions({x: -1.5 * x + u * w / 3, y: sympy.sin(y) * 0.1}, {x: u, y: w})
    assert found.document["equations"] == {"x": "-3*x/2 + x'*y'/3", "y": "sin(y)/10"}


def test_a_letter_of_an_expression_is_asked_back() -> None:
    x, v, k = sympy.symbols("x v k")
    with pytest.raises(errors.InputError, match="`k` is neither"):
        data.from_expressions({x: -k * x}, {x: v})


def test_a_table_without_its_columns_is_refused() -> None:
    with pytest.raises(errors.InputError, match="no column `t`"):
        data.from_table(Table({"time": np.arange(3.0), "x": np.arange(3.0)}))


TIMES = np.arange(100.0)


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"t": TIMES, "x": ["a"] * 100}, "`x` has values that are not numbers"),
        ({"t": TIMES, "x": np.where(TIMES == 7, np.nan, 1.0)}, "`x` has no finite number in row 7"),
        ({"t": TIMES.astype("datetime64[s]"), "x": TIMES}, "`t` has dates: give it in seconds"),
        ({"t": np.sort(TIMES**1.5), "x": TIMES}, "steps of `t` are from 1 to 14.9"),
        ({"t": np.where(TIMES == 5, 4.0, TIMES), "x": TIMES}, "does not grow from row 4"),
        ({"t": TIMES[:20], "x": TIMES[:20]}, "has 20 rows, and 44 at least"),
    ],
)
def test_a_table_that_cannot_be_fitted_is_refused_at_its_place(
    columns: dict[str, Any], said: str
) -> None:
    with pytest.raises(errors.InputError, match=said):
        data.from_table(Table(columns))


def test_what_is_no_table_or_no_fitted_model_is_refused() -> None:
    with pytest.raises(errors.InputError, match="DataFrame"):
        data.from_table(np.zeros((100, 2)))
    with pytest.raises(errors.InputError, match="no model of PySINDy"):
        data.from_sindy({"x": 1})
    with pytest.raises(errors.InputError, match="call its `fit` first"):
        data.from_sindy(SimpleNamespace(get_feature_names=list))


def test_without_pysindy_a_table_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pysindy", None)
    table = Table({"t": np.arange(100.0), "x": np.arange(100.0)})
    with pytest.raises(errors.MissingExtra, match=r"inverse-service\[data\]"):
        data.from_table(table)


@pytest.mark.slow
def test_a_noisy_double_spring_is_fitted_and_refitted_with_its_constraints() -> None:
    pysindy = pytest.importorskip("pysindy")
    pandas = pytest.importorskip("pandas")
    random = np.random.default_rng(3)
    times = np.linspace(0, 30, 3001)
    # x'' = -2 x + y, y'' = x - 2 y by its normal modes.
    slow, fast = 0.75 * np.cos(times), 0.25 * np.cos(np.sqrt(3) * times)
    table = pandas.DataFrame({"t": times, "x": slow + fast, "y": slow - fast})
    table[["x", "y"]] += 1e-3 * random.normal(size=(len(times), 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = data.from_table(table, window=31)
        result = data.nearest(model)
        first = result["nearest"][0]
        assert first["kind"] == "equal_masses"
        left, right = data.constraints(model, first)
        optimizer = pysindy.ConstrainedSR3(
            constraint_lhs=left, constraint_rhs=right, equality_constraints=True,
            reg_weight_lam=0, regularizer="l2", max_iter=2000, tol=1e-12,
        )  # fmt: skip
        again = data.from_table(table, window=31, optimizer=optimizer)
        refitted = data.nearest(again, errors=0.002)
    assert refitted["nearest"][0]["kind"] == "equal_masses"
    assert refitted["nearest"][0]["distance"] < 1e-3
    assert model.covariance is not None
    assert model.covariance.shape == (4, 4)


@pytest.mark.parametrize("count", [2, 3, 4, 6, 7, 20])
def test_the_covariance_of_an_ensemble_is_definite_and_no_smaller_than_what_was_drawn(
    count: int,
) -> None:
    """However few models there are, also where a coefficient is the same in all of them."""
    forces = np.array([[1.0, 0.0, -2.0], [0.5, 3.0, 0.0]])
    source = np.random.default_rng(count)
    drawn = [
        forces + 0.1 * source.normal(size=forces.shape) * [[1, 1, 0], [1, 1, 1]]
        for _ in range(count)
    ]
    model = SimpleNamespace(optimizer=SimpleNamespace(coef_list=drawn))
    found = data._covariance(model, [(0, 0), (1, 1)], forces)
    assert found is not None
    assert found.shape == (4, 4)
    assert np.linalg.eigvalsh(found)[0] > 0
    spread = np.var([one[forces != 0] for one in drawn], axis=0, ddof=1)
    assert (np.diag(found) >= spread * (1 - 1e-9)).all()
    assert (np.diag(found) <= spread + 1e-9).all()
