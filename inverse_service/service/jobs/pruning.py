"""Forgetting old answers a little at a time, so that nobody waits for it."""

from __future__ import annotations

from collections.abc import Callable

# Rows of a step, which takes some milliseconds.
STEP = 50
# How many jobs are looked at together to find the oldest.
OLDEST = 100


def pruned(
    forget: Callable[[float, int], tuple[int, int]],
    oldest_moment: Callable[[int], float | None],
    used_bytes: Callable[[], int],
    oldest: float,
    largest: int,
) -> int:
    """Forget what ended before `oldest`, then the oldest until at most `largest` bytes are used; how many jobs.

    Each call of `forget` (before, most rows) is a transaction of its own and says how many rows and jobs it forgot.
    """
    forgotten = 0
    while (step := forget(oldest, STEP))[0]:
        forgotten += step[1]
    while used_bytes() > largest:
        moment = oldest_moment(OLDEST)
        step = (0, 0) if moment is None else forget(moment, STEP)
        if not step[0]:
            break
        forgotten += step[1]
    return forgotten
