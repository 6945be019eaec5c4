"""The system q'' = f(t, q, q') as data, and on each of the open sets where its roots of squares are single formulas."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import TypeVar

from inverse_service.expressions import collecting, tree as ex
from inverse_service.field import modular, real_point, reduction, tower
from inverse_service.reading.names import Names

# Arbitrary functions, each with the names of the coordinates that it depends on.
Functions = tuple[tuple[str, tuple[str, ...]], ...]
MOST_BRANCHES = 8
# Counted no further.
MOST_COUNTED = 64
_SEED = 1
_Name = TypeVar("_Name", bound=Hashable)


@dataclass(frozen=True, slots=True)
class Branch:
    """Where the accelerations of a system are those of other formulas, `given`: where all of `positive` are > 0.

    Where they are `unsolved`, `given` are the equations E(t, q, q', q'') = 0 that determine them.
    `roots` pairs each root of them with what it is there; one within another comes before it.
    """

    given: tuple[ex.Expression, ...]
    positive: tuple[ex.Expression, ...] = ()
    roots: tuple[tuple[ex.Expression, ex.Expression], ...] = ()
    unsolved: bool = False


@dataclass(frozen=True, slots=True)
class SecondOrderSystem:
    """n explicit equations, `accelerations[i]` being f^i for `coordinates[i]`.

    Parameters are generic constants (those with values were substituted); no Acceleration node
    is left in `accelerations`. `branch` is None where roots of squares were not looked for.
    None of `nonzero` is 0: the equations as given say the same as q'' = f only there.
    `others` gives formulas for the names other than coordinates that first-order equations contain.
    """

    coordinates: tuple[str, ...]
    accelerations: tuple[ex.Expression, ...]
    parameters: tuple[str, ...] = ()
    functions: Functions = ()
    name: str = ""
    branch: Branch | None = None
    others: tuple[tuple[str, ex.Expression], ...] = ()
    nonzero: tuple[ex.Expression, ...] = ()

    @property
    def names(self) -> Names:
        """What a formula about the system may contain."""
        return Names(self.coordinates, self.parameters, dict(self.functions))

    @property
    def variables(self) -> list[modular.Variable]:
        """t, the coordinates, and the velocities."""
        return [ex.TIME, *map(ex.Symbol, self.coordinates), *map(ex.Velocity, self.coordinates)]

    @property
    def depends_on_time(self) -> bool:
        """Whether t occurs in f, also where it only says which formula holds."""
        return ex.TIME in ex.distinct_nodes((*self.accelerations, *self.given))

    @property
    def letters(self) -> tuple[ex.Symbol, ...]:
        """The accelerations where they are symbols, as in a system that is too long to be solved for them."""
        return tuple(f for f in self.accelerations if isinstance(f, ex.Symbol)) if self.is_unsolved else ()

    @property
    def is_unsolved(self) -> bool:
        """Whether only the equations are known that determine the accelerations."""
        return self.branch is not None and self.branch.unsolved

    @property
    def positive(self) -> tuple[ex.Expression, ...]:
        """What is positive on the branch, squares of `nonzero` among them, of what names this system has."""
        names = {"t", "pi", *self.coordinates, *self.parameters}
        found = (*(() if self.branch is None else self.branch.positive), *(tree**2 for tree in self.nonzero))
        return tuple(tree for tree in found if all(_name(node) in names for node in ex.walk(tree) if _name(node)))

    @property
    def given(self) -> tuple[ex.Expression, ...]:
        """f as it was given, before its roots of squares were rewritten."""
        return self.accelerations if self.branch is None else self.branch.given


def unsolved_system(names: Names, equations: Sequence[ex.Expression], name: str = "") -> SecondOrderSystem:
    """The system of E(t, q, q', q'') = 0, with symbols named like x'' as its accelerations."""
    letters = tuple(ex.Symbol(f"{coordinate}''") for coordinate in names.coordinates)
    branch = Branch(tuple(equations), unsolved=True)
    return SecondOrderSystem(names.coordinates, letters, names.parameters, tuple(names.functions.items()), name, branch)


def _name(node: ex.Expression) -> str:
    if isinstance(node, ex.Velocity):
        return node.coordinate
    return node.name if isinstance(node, ex.Symbol) else ""


def system_of(
    coordinates: Sequence[str], accelerations: Sequence[ex.Expression], parameters: Sequence[str], functions: Functions
) -> SecondOrderSystem:
    """The system, with those of the functions that occur in it."""
    nodes = ex.distinct_nodes(accelerations)
    held = {node.name for node in nodes if isinstance(node, ex.Arbitrary)}
    kept = tuple(function for function in functions if function[0] in held)
    return SecondOrderSystem(tuple(coordinates), tuple(accelerations), tuple(parameters), kept)


def branches_of(system: SecondOrderSystem) -> tuple[SecondOrderSystem, ...]:
    """The system itself, where it has one formula everywhere, or one for each of the cases that have a real point.

    At most `MOST_COUNTED` are made.
    """
    if system.branch is not None:
        return (system,)
    found = tuple(one for one, reached in _cases(system) if reached)
    if not found or (len(found) > 1 and len({(one.accelerations, _squares(one)) for one in found}) == 1):
        formulas = found[0].accelerations if found else system.accelerations  # |u|^2 is u^2 on both sides
        return (replace(system, accelerations=formulas, branch=Branch(system.accelerations)),)
    return _default_first(system, found) if len(found) > 1 else found


def _squares(system: SecondOrderSystem) -> tuple[ex.Expression, ...]:
    return tuple(collecting.collect(tree**2) for tree in system.nonzero)


def _default_first(system: SecondOrderSystem, branches: tuple[SecondOrderSystem, ...]) -> tuple[SecondOrderSystem, ...]:
    """First comes the branch of a point with positive parameters, else of any, that one formula would be taken at."""
    kernels, parameters = tuple(map(tower.to_kernels, system.accelerations)), [*map(ex.Symbol, system.parameters)]
    table = real_point.first_real_point(kernels, _variables(system), (parameters, ()))
    return tuple(sorted(branches, key=lambda one: table is None or not real_point.are_positive(one.positive, table)))


def with_values(system: SecondOrderSystem, values: Mapping[ex.Expression, ex.Expression]) -> SecondOrderSystem:
    """The system with these values of its parameters, which may hold others."""
    forces = tuple(collecting.collect(ex.substitute(f, dict(values))) for f in system.given)
    left = tuple(name for name in system.parameters if ex.Symbol(name) not in values)
    return replace(system, accelerations=forces, parameters=left, branch=None)


def on_branch(tree: ex.Expression, system: SecondOrderSystem) -> ex.Expression:
    """The tree with the roots of the system replaced by their values on its branch."""
    for root, value in () if system.branch is None else system.branch.roots:
        tree = ex.substitute(tree, {root: value})
    return tree


def unreached(system: SecondOrderSystem) -> tuple[SecondOrderSystem, ...]:
    """The cases of signs that may have a real point, of which none was found."""
    return () if system.branch is not None else tuple(one for one, reached in _cases(system) if not reached)


@lru_cache(maxsize=16)
def _cases(system: SecondOrderSystem) -> tuple[tuple[SecondOrderSystem, bool], ...]:
    """The system on each case of signs, and whether a real point of it is known; without those seen to be empty.

    Where one of `nonzero` is 0 all over a case, the equations as given leave a motion open there: it is no case.
    """
    found, number = [], len(system.accelerations)
    for case in islice(reduction.sign_cases((*system.accelerations, *system.nonzero)), 4 * MOST_COUNTED):
        nonzero = tuple(map(collecting.collect, case.formulas[number:]))
        if ex.ZERO in nonzero:
            continue
        reached = not case.positive or _has_point(system, case)
        if reached or not reduction.is_empty([*case.positive, *real_point.own_requirements(case.formulas)]):
            branch = Branch(system.accelerations, case.positive, case.roots)
            solved = tuple(map(collecting.collect, case.formulas[:number])) if case.roots else system.accelerations
            found.append((replace(system, accelerations=solved, nonzero=nonzero, branch=branch), reached))
        if sum(reached for _, reached in found) == MOST_COUNTED:
            break
    return tuple(found)


def on_side(system: SecondOrderSystem, positive: Sequence[ex.Expression]) -> SecondOrderSystem | None:
    """A system where these trees are positive too; None where they are seen not to be so at once."""
    branch = system.branch or Branch(system.accelerations)
    whole = tuple(dict.fromkeys((*branch.positive, *positive)))
    if reduction.is_empty([*system.positive, *positive, *real_point.own_requirements(system.accelerations)]):
        return None
    return replace(system, branch=replace(branch, positive=whole))


def _has_point(system: SecondOrderSystem, case: reduction.Case) -> bool:
    kernels = tuple(map(tower.to_kernels, case.formulas))
    return real_point.find_real_point(kernels, _variables(system), _SEED, case.positive) is not None


def _variables(system: SecondOrderSystem) -> list[modular.Variable]:
    names = (*system.coordinates, *system.parameters)
    return [ex.TIME, *map(ex.Symbol, names), *map(ex.Velocity, system.coordinates)]


def connected(names: Sequence[_Name], links: Iterable[set[_Name]]) -> list[tuple[_Name, ...]]:
    """The names in groups so that each link lies in one of them, all in the order of `names`."""
    groups = [{name} for name in names]
    for link in links:
        joined = set().union(*(group for group in groups if group & link))
        groups = [*(group for group in groups if not group & link), joined]
    ordered = [tuple(name for name in names if name in group) for group in groups]
    return sorted(ordered, key=lambda group: names.index(group[0]))
