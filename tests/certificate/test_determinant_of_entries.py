"""The determinant of g where equations have solved for some of its entries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from flint import Ordering, fmpq_mpoly_ctx

from inverse_service.certificate.passive import Passive


def test_the_determinant_is_that_of_the_entries_times_their_pivots() -> None:
    """a g_11 = b g_22: with the factor a, the entries are b g_22, a g_12, and a g_22, so det g is
    a b g_22^2 - a^2 g_12^2.
    """
    context = fmpq_mpoly_ctx.get(["a", "b"], Ordering.degrevlex)
    a, b = context.gens()
    whole: Any = SimpleNamespace(
        ring=SimpleNamespace(one=context.constant(1), none=context.constant(0), context=context),
        conditions=SimpleNamespace(n=2, places=[(0, 0), (0, 1), (1, 1)]),
        algebraic=[SimpleNamespace(leader=(0, ()), pivot=a, row={(0, ()): a, (2, ()): -b})],
        part=SimpleNamespace(vanishes=lambda values: not values[0]),
    )
    assert sorted(map(str, Passive.determinant(whole))) == sorted(map(str, (a * b, -(a**2))))
