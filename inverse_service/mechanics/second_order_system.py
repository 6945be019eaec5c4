"""The system q'' = f(t, q, q') as data."""

from __future__ import annotations

from dataclasses import dataclass

from inverse_service.expressions.names import Names
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk


@dataclass(frozen=True, slots=True)
class FunctionDeclaration:
    """An arbitrary function, with the names of the coordinates that it depends on."""

    name: str
    arguments: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Branch:
    """Where the accelerations of a system are those of other formulas, `given`: where all of `positive` are > 0.

    `roots` pairs each root of them with what it is there; one within another comes before it.
    """

    given: tuple[Expression, ...]
    positive: tuple[Expression, ...] = ()
    roots: tuple[tuple[Expression, Expression], ...] = ()


@dataclass(frozen=True, slots=True)
class SecondOrderSystem:
    """n explicit equations, `accelerations[i]` being f^i for `coordinates[i]`.

    Parameters are generic constants (those with values were substituted); no Acceleration node
    is left in `accelerations`. `branch` is None where roots of squares were not looked for.
    """

    coordinates: tuple[str, ...]
    accelerations: tuple[Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: tuple[FunctionDeclaration, ...] = ()
    name: str = ""
    branch: Branch | None = None

    @property
    def names(self) -> Names:
        """What a formula about the system may contain."""
        return Names(self.coordinates, self.parameters, {each.name: each.arguments for each in self.functions})

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in f, also where it only says which formula holds."""
        return any(node == TIME for f in (*self.accelerations, *self.given) for node in walk(f))

    @property
    def positive(self) -> tuple[Expression, ...]:
        """What is positive on the branch, of what names this system has."""
        names = {"t", "pi", *self.coordinates, *self.parameters}
        found = () if self.branch is None else self.branch.positive
        return tuple(tree for tree in found if all(_name(node) in names for node in walk(tree) if _name(node)))

    @property
    def given(self) -> tuple[Expression, ...]:
        """f as it was given, before its roots of squares were rewritten."""
        return self.accelerations if self.branch is None else self.branch.given


def _name(node: Expression) -> str:
    if isinstance(node, Velocity):
        return node.coordinate
    return node.name if isinstance(node, Symbol) else ""
