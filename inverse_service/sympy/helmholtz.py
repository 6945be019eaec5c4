"""The Helmholtz tensors of a system as SymPy matrices and arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy

from inverse_service.mechanics.conditions import conditions
from inverse_service.mechanics.reading import read_system
from inverse_service.sympy.names import Table
from inverse_service.sympy.reading import read
from inverse_service.sympy.texts import expression
from inverse_service.sympy.trees import to_sympy


@dataclass(frozen=True)
class Conditions:
    """N, Phi and nabla Phi as n x n matrices, R as an n x n x n array (R[j, k, l] = R^j_kl).

    g is a multiplier only if g Phi and g nabla Phi are symmetric and the cyclic sums of g R vanish. `reason` says
    why one of them is None.
    """

    Phi: Any
    nabla_Phi: Any
    R: Any
    N: Any = None
    reason: str = ""


def conditions_of(system: Any, coordinates: Sequence[Any] | None, keys: Mapping[str, Any]) -> Conditions:
    """The tensors of a system of SymPy objects."""
    keys = dict(keys)
    found = read(system, coordinates, keys.pop("velocities", None), keys.pop("time", None), keys)
    parts = found.document
    motion = read_system(
        parts["coordinates"], parts["equations"], parts.get("parameters", ()), parts.get("functions", {})
    )
    tensors = conditions(motion)

    def plain(part: Any) -> Any:
        return [plain(each) for each in part] if isinstance(part, tuple) else to_sympy(part, found.names)

    def matrix(rows: Any) -> Any:
        return None if rows is None else sympy.ImmutableMatrix(plain(rows))

    blocks = None if tensors.R is None else sympy.ImmutableDenseNDimArray(plain(tensors.R))
    return Conditions(matrix(tensors.Phi), matrix(tensors.nabla_Phi), blocks, matrix(tensors.N), tensors.reason)


def conditions_of_texts(parts: Mapping[str, Any], table: Table) -> Conditions:
    """The key `conditions` of a result."""

    def matrix(rows: Any) -> Any:
        return sympy.ImmutableMatrix([[expression(text, table) for text in row] for row in rows])

    blocks = [[[expression(text, table) for text in row] for row in block] for block in parts["R"]]
    return Conditions(matrix(parts["Phi"]), matrix(parts["nabla_Phi"]), sympy.ImmutableDenseNDimArray(blocks))
