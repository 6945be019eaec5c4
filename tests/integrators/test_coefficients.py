"""Coefficients satisfy the conditions of their order; the formulas hold for plain numbers too."""

from __future__ import annotations

import functools
import itertools
import math
from typing import Any

import numpy as np
import pytest

from inverse_service.integrators import method_table, variational
from inverse_service.integrators.trajectory import Outcome, Trajectory


@pytest.mark.parametrize("order", method_table.ORDERS)
def test_compositions_are_symmetric_and_cancel_odd_powers(order: int) -> None:
    """Sum of w = 1, and of w^3, w^5, w^7 = 0 below the order."""
    weights = method_table.composition(order)
    assert weights == tuple(reversed(weights))
    assert len(weights) == {2: 1, 4: 5, 6: 9, 8: 17}[order]
    assert sum(weights) == pytest.approx(1, abs=1e-15)
    for power in range(3, order, 2):
        assert sum(w**power for w in weights) == pytest.approx(0, abs=1e-15)


def test_gauss_legendre_integrates_all_polynomials_of_its_order() -> None:
    one = method_table.GAUSS_LEGENDRE
    for power in range(2 * len(one.nodes)):
        assert one.weights @ one.nodes**power == pytest.approx(1 / (power + 1), rel=1e-14)
    assert np.allclose(one.rows @ one.rows, one.places, atol=1e-16)
    assert np.allclose(one.weights @ one.rows, one.ends, atol=1e-16)
    assert np.allclose(one.rows.sum(axis=1), one.nodes, atol=1e-16)


@pytest.mark.parametrize("order", method_table.TABLEAUX)
def test_stages_are_consistent(order: int) -> None:
    """A constant force is integrated exactly, at each node too, and has no estimate of an error."""
    one = method_table.TABLEAUX[order]
    assert one.weights.sum() == pytest.approx(1, abs=1e-13)
    assert one.ends.sum() == pytest.approx(1 / 2, abs=1e-13)
    if one.rows.any():
        assert np.allclose(one.rows.sum(axis=1), one.nodes, atol=1e-13)
    else:
        assert np.allclose(one.places.sum(axis=1), one.nodes**2 / 2, atol=1e-13)
    assert np.allclose(one.errors.sum(axis=-1), 0, atol=1e-13)
    assert np.allclose(one.end_errors.sum(axis=-1), 0, atol=1e-13)


Tree = tuple["Tree", ...]


@functools.cache
def trees(size: int) -> frozenset[Tree]:
    """The rooted trees with this number of nodes, each as the sorted tuple of the subtrees of its
    root.
    """
    grown: set[Tree] = {()} if size == 1 else set()
    for last in range(1, size):
        for rest, tree in itertools.product(trees(size - last), trees(last)):
            grown.add(tuple(sorted((*rest, tree))))
    return frozenset(grown)


def nodes_and_density(tree: Tree) -> tuple[int, int]:
    parts = [nodes_and_density(part) for part in tree]
    size = 1 + sum(count for count, _ in parts)
    return size, size * math.prod(density for _, density in parts)


@pytest.mark.parametrize("order", method_table.RUNGE_KUTTA)
def test_runge_kutta_methods_satisfy_the_condition_of_every_rooted_tree(order: int) -> None:
    """sum_i b_i Phi_i(t) = 1/gamma(t) for the trees of at most `order` nodes (Hairer, Norsett,
    Wanner II.2).
    """
    tableau = method_table.TABLEAUX[order]

    def stages(tree: Tree) -> Any:
        return np.prod(
            [np.ones(len(tableau.rows)), *(tableau.rows @ stages(part) for part in tree)], axis=0
        )

    for tree in itertools.chain.from_iterable(trees(size) for size in range(1, order + 1)):
        assert np.dot(tableau.weights, stages(tree)) == pytest.approx(
            1 / nodes_and_density(tree)[1], abs=1e-13
        )


@pytest.mark.parametrize("order", method_table.TABLEAUX)
def test_forces_without_velocities_need_the_conditions_of_nystrom(order: int) -> None:
    """A force along q = t^m, or along positions due to other such forces, is exact up to t^order
    (II.14).
    """
    one = method_table.TABLEAUX[order]
    assert not np.triu(one.places).any()
    grown = {
        0: [(np.ones(len(one.nodes)), 1.0)]
    }  # by power of t: values at the stages, and the factor
    for power in range(1, order):
        grown[power] = [(one.nodes * values, factor) for values, factor in grown[power - 1]]
        for last in range(power - 1):
            scale = 1 / ((last + 1) * (last + 2))
            for (values, factor), (inner, size) in itertools.product(
                grown[power - 2 - last], grown[last]
            ):
                grown[power].append((values * (one.places @ inner), factor * size * scale))
    for power, found in grown.items():
        for values, factor in found:
            assert one.weights @ values == pytest.approx(factor / (power + 1), abs=1e-13)
            if power + 2 <= order:
                assert one.ends @ values == pytest.approx(
                    factor / ((power + 1) * (power + 2)), abs=1e-13
                )


def test_formulas_hold_for_plain_numbers() -> None:
    """The harmonic oscillator's midpoint step by hand: d = h (p - h q/2)/(1 + h^2/4)."""
    q, p, h = np.array([0.4]), np.array([0.7]), 0.1
    d = h * (p - h * q / 2) / (1 + h * h / 4)
    e = -h * (q + d / 2)
    residuals, pushes = variational.hamiltonian_step(
        q, p, d, e, h, 0.5, lambda x, y: x, lambda x, y: y
    )
    assert np.abs(residuals).max() < 1e-16
    assert pushes == e
    residuals, pushes = variational.raw_step(q, p, d, h, (0.5,), lambda x, v: -x, lambda x, v: v)
    assert abs(residuals[0]) < 1e-16
    assert pushes[0] == pytest.approx(e[0], rel=1e-15)
    both, _ = variational.symmetrised_hamiltonian_step(
        q, p, d, (d / h - p, d / h - p), h, 0.5, lambda x, y: x, lambda x, y: y
    )
    assert np.abs(both).max() < 1e-16


def test_a_constraint_force_keeps_the_constraint() -> None:
    """A particle held to the line v1 = v2: momentum (1, 0) becomes (1/2, 1/2)."""
    q, p, d, m = np.zeros(2), np.array([1.0, 0.0]), np.full(2, 0.05), np.array([0.05])
    residuals, changes = variational.lagrange_dalembert_step(
        q,
        p,
        d,
        m,
        0.1,
        (0.5,),
        lambda x, v: 0 * x,
        lambda x, v: v,
        lambda x: np.array([[1.0, -1.0]]),
        lambda x: np.zeros(1),
    )
    assert np.abs(residuals).max() < 1e-16
    assert changes == pytest.approx([-0.5, 0.5])
    assert math.hypot(*changes) > 0


@pytest.mark.parametrize("parts", [(0.5,), (0.25,), (0.3, 0.7)])
@pytest.mark.parametrize("h", [0.1, 0.02])
def test_a_step_along_a_moving_constraint_satisfies_it(parts: tuple[float, ...], h: float) -> None:
    """Increments d = h v with w(q) v + c(q) = 0 at the places of the step, whatever its length."""
    q, v = np.array([0.4, -0.3]), np.array([1.5, 0.0])

    def forms(at: Any) -> Any:
        return np.array([[np.sin(at[0]), 1.0]])

    def drifts(at: Any) -> Any:
        return np.array([at[0] ** 2 + 0.5])

    for _ in range(60):  # v_2 from the constraint at the places
        places = [q + part * h * v for part in parts]
        v[1] = -np.mean([np.sin(at[0]) * v[0] + drifts(at)[0] for at in places])
    rest = np.zeros(2)
    residuals, _ = variational.lagrange_dalembert_step(
        q, v, h * v, np.zeros(1), h, parts, lambda at, speed: rest, lambda at, speed: speed,
        forms, drifts,
    )  # fmt: skip
    assert np.abs(residuals).max() < 1e-15


@pytest.mark.parametrize("alpha", [0.0, 0.25, 0.7, 1.0])
def test_a_step_off_the_middle_is_that_of_the_discrete_lagrangian(alpha: float) -> None:
    """The oscillator by hand: d = h p - (1 - alpha) h^2 (q + alpha d), of the mean of both forms d
    = h p - h^2 (q/2 + alpha (1 - alpha) d).
    """
    q, p, h = np.array([0.4]), np.array([0.7]), 0.3
    bent = 1 + alpha * (1 - alpha) * h * h
    one, mean = h * (p - (1 - alpha) * h * q) / bent, h * (p - h * q / 2) / bent
    for d, parts in ((one, (alpha,)), (mean, (alpha, 1 - alpha))):
        residuals, _ = variational.raw_step(q, p, d, h, parts, lambda x, v: -x, lambda x, v: v)
        assert np.abs(residuals).max() < 1e-15
    change = mean / h - p
    residuals, _ = variational.symmetrised_hamiltonian_step(
        q, p, mean, (change, change), h, alpha, lambda x, y: x, lambda x, y: y
    )
    assert np.abs(residuals).max() < 1e-15


@pytest.mark.parametrize("steps", [6, 7, 8])
def test_a_run_of_fewer_points_ends_where_the_whole_one_ends(steps: int) -> None:
    times = np.arange(steps + 1) / 10
    places = np.column_stack([times**2])
    whole = Trajectory(times, places, None, None, Outcome("completed"))
    found = whole.thinned(steps, 3)
    assert found.times[-1] == times[-1]
    assert found.positions[-1] == places[-1]
    assert found.times[:3].tolist() == times[[0, 3, 6]].tolist()
    assert whole.thinned(steps + 5, 3).times[-1] == times[steps - steps % 3]  # it stopped
