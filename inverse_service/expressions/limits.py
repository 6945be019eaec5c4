"""Bounds on what a formula may be; each is named in the refusal when it is passed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest accepted sizes; all are counts.

    `depth` bounds the nesting of the text and of the tree (so that recursion over a tree is safe);
    `digits` those of one number, whether written or computed on reading (one bound for both, so that
    what was accepted and printed is accepted again); `exponent` a literal number power, above and
    below; `decimal_exponent` the k of 1e-k and 1ek; `derivative_nodes` the size of a formula that
    `diff` is carried out on.
    """

    characters: int = 20_000
    tokens: int = 5_000
    depth: int = 100
    digits: int = 200
    exponent: int = 4_096
    decimal_exponent: int = 150
    name_characters: int = 40
    derivative_order: int = 20
    derivative_nodes: int = 1_000
    coordinates: int = 8
    function_arguments: int = 6
    names: int = 200


LIMITS = Limits()
