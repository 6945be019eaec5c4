"""Of branches that hold at the same points the shortest is H."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from inverse_service.expressions import tree as ex
from inverse_service.mechanics import inverses, legendre

CUBE = ex.Velocity("x") ** 3 / 3


@pytest.mark.parametrize("longer_first", [True, False])
def test_the_shorter_of_two_equal_branches_is_taken(
    monkeypatch: pytest.MonkeyPatch, longer_first: bool
) -> None:
    """p = v^2 has H = 2 p^(3/2)/3 where v > 0; a term that is zero where p > -1 changes nothing."""
    short = legendre.legendre(CUBE, ["x"])
    p = short.symbols[0]
    whole = legendre.block_branches

    def both(block: inverses.Block, reach: legendre.Reach) -> Iterator[inverses.InverseBranch]:
        for branch in whole(block, reach):
            nothing = ex.square_root(p + 1) - ex.square_root((p + 1) ** 3) / (p + 1)
            longer = replace(branch, hamiltonian=branch.hamiltonian + nothing)
            yield from (longer, branch) if longer_first else (branch, longer)

    monkeypatch.setattr(legendre, "block_branches", both)
    assert legendre.legendre(CUBE, ["x"]).hamiltonian == short.hamiltonian


@pytest.mark.parametrize("taken", [("p_x",), ("p_x", "momentum_x"), ("p_x", "p_y", "momentum_y")])
def test_no_momentum_has_the_name_of_a_constant(taken: tuple[str, ...]) -> None:
    """H of L = (x'^2 + y'^2)/2 - p_x x - ... holds each of these constants as L does."""
    constants = [ex.Symbol(name) for name in taken]
    forces = (name * ex.Symbol("x") for name in constants)
    lagrangian = (ex.Velocity("x") ** 2 + ex.Velocity("y") ** 2) / 2 - ex.add(*forces)
    found = legendre.legendre(lagrangian, ["x", "y"])
    assert {*found.symbols}.isdisjoint(constants)
    assert len({*found.symbols}) == 2
    assert {*constants, *found.symbols} <= {*ex.walk(found.hamiltonian)}
