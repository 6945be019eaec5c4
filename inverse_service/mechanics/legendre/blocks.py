"""A function of velocities cut into parts, and one candidate for the inverse of the momentum map of a block.

The parts are free of velocities, linear, and independent blocks; a candidate is checked by the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from inverse_service.expressions.collecting import expand
from inverse_service.expressions.collecting_trees import Monomial, Term, monomial_tree, terms_tree
from inverse_service.expressions.tree import ZERO, Expression, Sum, Symbol, Velocity, add, substitute
from inverse_service.mechanics.legendre.short_forms import simplified, velocities_in
from inverse_service.mechanics.second_order_system import connected


@dataclass(frozen=True, slots=True)
class Block:
    """A function of the velocities of `names`, expanded, without linear terms; `momenta` names each p."""

    function: Expression
    names: tuple[str, ...]
    momenta: Mapping[str, Symbol]


@dataclass(frozen=True, slots=True)
class Parts:
    """function = free + sum of linear[name] v_name + sum of the blocks' functions."""

    free: Expression
    linear: Mapping[str, Expression]
    blocks: tuple[Block, ...]


def split(function: Expression, names: Sequence[str], momenta: Mapping[str, Symbol]) -> Parts:
    """The parts of a function of the velocities of `names`; each name is in exactly one block.

    Terms of a sum that hold no velocity are left as they are written.
    """
    terms = function.terms if isinstance(function, Sum) else (function,)
    plain = [term for term in terms if not velocities_in(term, names)]
    moving = expand(add(*(term for term in terms if velocities_in(term, names))))
    free: list[Term] = []
    linear: dict[str, list[Term]] = {}
    coupled: list[tuple[set[str], Term]] = []
    for monomial, value in moving:
        found = velocities_in(monomial_tree(monomial), names)
        only = next(iter(found)) if len(found) == 1 else ""
        if not found:
            free.append((monomial, value))
        elif (Velocity(only), Fraction(1)) in monomial and not _rest_moves(monomial, only):
            linear.setdefault(only, []).append((without(monomial, [only]), value))
        else:
            coupled.append((found, (monomial, value)))
    groups = connected(names, [found for found, _ in coupled])
    blocks = tuple(Block(terms_tree(t for found, t in coupled if found <= set(g)), g, momenta) for g in groups)
    return Parts(add(*plain, _short(free)), {name: _short(found) for name, found in linear.items()}, blocks)


def without(monomial: Monomial, names: Collection[str]) -> Monomial:
    """The monomial without its bare velocities of `names`."""
    return tuple(
        (base, exponent) for base, exponent in monomial if not (isinstance(base, Velocity) and base.coordinate in names)
    )


def degrees(monomial: Monomial, names: Collection[str]) -> dict[str, Fraction] | None:
    """The exponents of the velocities, None where one occurs inside another atom."""
    if velocities_in(monomial_tree(without(monomial, names)), names):
        return None
    bare = {base: exponent for base, exponent in monomial if isinstance(base, Velocity)}
    return {base.coordinate: exponent for base, exponent in bare.items() if base.coordinate in names}


def _rest_moves(monomial: Monomial, name: str) -> bool:
    return bool(velocities_in(monomial_tree(without(monomial, [name])), [name]))


def _short(terms: list[Term]) -> Expression:
    return simplified(terms_tree(terms)) if terms else ZERO


@dataclass(frozen=True, slots=True)
class Branch:
    """v(t, q, p) and H(t, q, p) of a block, where every tree of `conditions` (in t, q, v, p) is positive.

    A velocity may contain the Velocity of another name of the block whose own formula contains none;
    `resolved` puts that formula in.
    """

    velocities: tuple[Expression, ...]
    hamiltonian: Expression
    conditions: tuple[Expression, ...] = ()


Family = Callable[[Block], Iterator[Branch]]
Solver = Callable[[Expression, Sequence[str], Mapping[str, Symbol]], Iterator[Branch]]


def resolved(velocities: Sequence[Expression], names: Sequence[str]) -> tuple[Expression, ...]:
    """The velocities of a branch over (t, q, p) alone: no Velocity of `names` is left."""
    table: dict[Expression, Expression] = {Velocity(name): tree for name, tree in zip(names, velocities, strict=True)}
    return tuple(substitute(tree, table) for tree in velocities)
