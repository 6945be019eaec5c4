"""Strongly connected parts are those of scipy, each node in one of them."""

from __future__ import annotations

import random

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from inverse_service.expressions import graphs


@pytest.mark.parametrize("seed", range(20))
def test_parts_are_those_of_scipy(seed: int) -> None:
    draw = random.Random(seed)
    size = draw.randrange(9)
    graph = {a: [b for b in range(size) if draw.random() < 0.25] for a in range(size)}
    found = graphs.components(graph)
    assert sorted(node for part in found for node in part) == [*range(size)]
    if not size:
        return
    table = np.array([[b in graph[a] for b in range(size)] for a in range(size)])
    _, labels = connected_components(table, directed=True, connection="strong")
    assert {*map(frozenset, found)} == {
        frozenset(np.flatnonzero(labels == label).tolist()) for label in labels
    }
    place = {node: k for k, part in enumerate(found) for node in part}
    assert all(place[b] <= place[a] for a in graph for b in graph[a])  # what it needs is before
