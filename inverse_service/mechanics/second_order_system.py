"""The system q'' = f(t, q, q') as data."""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.expressions.tree import TIME, Expression, walk


@dataclass(frozen=True, slots=True)
class FunctionDeclaration:
    """An arbitrary function, with the names of the coordinates that it depends on."""

    name: str
    arguments: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SecondOrderSystem:
    """n explicit equations, `accelerations[i]` being f^i for `coordinates[i]`.

    Parameters are generic constants (those with values were substituted); no Acceleration node
    is left in `accelerations`.
    """

    coordinates: tuple[str, ...]
    accelerations: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: tuple[FunctionDeclaration, ...] = ()
    name: str = ""

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in f."""
        return any(node == TIME for f in self.accelerations for node in walk(f))
