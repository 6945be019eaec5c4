"""A decision uses new points after a singular one and for each seed, and goes up to the right order
at them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from inverse_service.decision.deciding import HelmholtzAt, analyze, decide
from inverse_service.field.echelon import Echelon
from inverse_service.field.modular import SingularPoint
from inverse_service.linear_pde import involution as settling
from inverse_service.linear_pde.equations import LocalEquations
from inverse_service.linear_pde.involution import Limits
from inverse_service.mechanics.second_order_system import read_system
from inverse_service.statements.questions import PLAIN
from inverse_service.statements.reasons import Reason
from inverse_service.statements.stages import Stage

OSCILLATORS = read_system(["x", "y"], {"x": "-x", "y": "-2*y"})


def run_of(seed: int) -> settling.Run:
    return settling.Run(HelmholtzAt(analyze(OSCILLATORS), PLAIN), seed, Limits(), lambda _: None)


def test_after_singular_points_others_are_taken_and_nothing_of_them_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seeds: list[int] = []
    plain = settling.prolong

    def singular(run: settling.Run, seed: int) -> settling.Finding:
        seeds.append(seed)
        run.history.append((99,))
        raise SingularPoint

    run = run_of(6)
    monkeypatch.setattr(settling, "prolong", singular)
    with pytest.raises(settling.IrreducibleAtoms, match="zero everywhere"):
        settling.settle_once(run)
    assert seeds[0] == 6
    assert len(set(seeds)) == len(seeds) == 4
    monkeypatch.setattr(settling, "prolong", plain)
    assert settling.settle_once(run).history == settling.settle_once(run_of(6)).history


def test_two_seeds_have_no_point_in_common(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, plain, used = list[int](), HelmholtzAt.at, list[int]()

    def at(card: HelmholtzAt, seed: int, order: int) -> LocalEquations:
        asked.append(seed)
        return plain(card, seed, order)

    monkeypatch.setattr(HelmholtzAt, "at", at)
    for seed in range(1, 5):
        asked.clear()
        found = decide(OSCILLATORS, PLAIN, seed=seed)
        assert {point["seed"] for point in found.points} == set(asked)
        assert len({point["prime"] for point in found.points}) == len(found.points) == 2
        used += list(set(asked))
    assert len(set(used)) == len(used) == 8


@pytest.mark.parametrize(
    "relation", ["exp(x)*(1+cos(exp(x)))-1+cos(exp(x))", "log(x)*(1+cos(log(x)))-sin(log(x))"]
)
def test_an_angle_is_drawn_apart_from_the_function_that_it_is(relation: str) -> None:
    """Where tan(u/2)^2 = u for u = e^x, or tan(u/2) = u for u = log x, the sixth power is 0 to
    order five.
    """
    system = read_system(["x", "y"], {"x": f"({relation})^6*x*y'", "y": "y*x'^2"})
    found = decide(system, PLAIN)
    assert (found.verdict, found.order) == ("not_variational", 2)


@pytest.mark.parametrize(("size", "highest"), [(16, 5), (15, 13), (17, 5)])
def test_no_order_is_begun_whose_monomials_have_no_keys(
    size: int, highest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An exponent has floor(63/size) bits, and an unknown of degree r in g has the total degree r +
    2.
    """
    monkeypatch.setattr(settling.pde, "count_of_degree", lambda *_: 0)
    unknowns = SimpleNamespace(most=2)
    prolongation: Any = SimpleNamespace(size=size, width=lambda _: 0, unknowns=unknowns)
    run = replace(run_of(2), limits=Limits(order=highest + 1))
    assert settling.limit_reached(run, prolongation, highest) is None
    limit = settling.limit_reached(run, prolongation, highest + 1)
    assert limit is not None
    assert limit.reason is Reason.SIZE


def test_a_limit_of_order_lets_that_order_be_done() -> None:
    for most in (1, 2, 3):
        told: list[Stage] = []
        found = decide(OSCILLATORS, PLAIN, limits=Limits(order=most), progress=told.append)
        assert [stage.order for stage in told[: most + 1]] == [*range(most + 1)]
        assert (found.verdict == "variational") == (most == 3)


@pytest.mark.parametrize(
    "equations",
    [{"x": "y'", "y": "x*y'"}, {"x": "x*y", "y": "x"}, {"x": "y^2+x'*y'", "y": "y*x'+x^2"}],
)
def test_of_three_consequences_that_leave_nothing_two_are_traced(
    equations: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the end all of g(p) is zero; two equations leave one g(p) of rank one, and that is
    enough.
    """
    traced: list[Mapping[int, int]] = []
    trace = Echelon.trace

    def noted(echelon: Echelon, weights: Mapping[int, int]) -> list[int]:
        traced.append(weights)
        return trace(echelon, weights)

    monkeypatch.setattr(Echelon, "trace", noted)
    found = decide(read_system(["x", "y"], equations), PLAIN)
    assert found.verdict == "not_variational"
    assert found.history[-1][0] == 0
    assert len(traced) == 2 * 2  # two at each point


def test_the_space_of_a_positive_verdict_is_that_of_an_involutive_system() -> None:
    found = decide(OSCILLATORS, PLAIN)
    assert found.space is not None
    assert found.symbol is not None
    assert found.space.involutive
    assert (found.space.order, found.space.dimensions) == (found.order, found.history[-1])
    assert found.space.characters == found.symbol.characters


@pytest.mark.parametrize(
    ("equations", "values"),
    [
        ({"x": "x^2+y^2", "y": "0"}, [2, 1]),
        ({"x": "x*y", "y": "x"}, [2, 1, 0]),
        ({"x": "-x-2*x*y-x'", "y": "-y-x^2+y^2-y'"}, [2, 1, 0]),
        # order 2 gives nothing new: the obstruction is differential
        ({"x": "2*x'/y'+2*x'", "y": "2*x'^2/y'+x'/y'"}, [2, 1, 1, 0]),
    ],
)
def test_no_multiplier_is_seen_at_the_first_order_that_leaves_none(
    equations: dict[str, str], values: list[int]
) -> None:
    """`values` are the dimensions of the remaining space of g(p), order by order, at both
    points.
    """
    found = decide(read_system(["x", "y"], equations), PLAIN)
    assert (found.verdict, found.order) == ("not_variational", len(values) - 1)
    assert [dimensions[0] for dimensions in found.history] == values


def test_a_system_without_a_point_is_undetermined_at_order_zero() -> None:
    found = decide(read_system(["x"], {"x": "sqrt(-1-x^2)"}), PLAIN)
    assert (found.verdict, found.order, found.history, found.points) == ("undetermined", 0, (), ())
    assert found.open
