"""The system q'' = f(t, q, q') as data."""

from __future__ import annotations

from collections.abc import Sequence
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

    Where they are `unsolved`, `given` are the equations E(t, q, q', q'') = 0 that determine them.
    `roots` pairs each root of them with what it is there; one within another comes before it.
    """

    given: tuple[Expression, ...]
    positive: tuple[Expression, ...] = ()
    roots: tuple[tuple[Expression, Expression], ...] = ()
    unsolved: bool = False


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
    def letters(self) -> tuple[Symbol, ...]:
        """The accelerations where they are letters, as in a system that is too long to be solved for them."""
        return tuple(f for f in self.accelerations if isinstance(f, Symbol)) if self.is_unsolved else ()

    @property
    def is_unsolved(self) -> bool:
        """Whether only the equations are known that determine the accelerations."""
        return self.branch is not None and self.branch.unsolved

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


def unsolved_system(names: Names, equations: Sequence[Expression], name: str = "") -> SecondOrderSystem:
    """The system of E(t, q, q', q'') = 0, its accelerations letters that are named like x''."""
    letters = tuple(Symbol(f"{coordinate}''") for coordinate in names.coordinates)
    functions = tuple(FunctionDeclaration(function, arguments) for function, arguments in names.functions.items())
    branch = Branch(tuple(equations), unsolved=True)
    return SecondOrderSystem(names.coordinates, letters, names.parameters, functions, name, branch)


def _name(node: Expression) -> str:
    if isinstance(node, Velocity):
        return node.coordinate
    return node.name if isinstance(node, Symbol) else ""
