"""H as people write it: the momenta of x_A, q1, and q are p_A, p1, and p; and p is the length of
(p_x, p_y, p_z) where a root or a function holds it.

Results have p_x_A and the whole formula; this is for the doors where people read.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from inverse_service import errors
from inverse_service.expressions import printing, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.reading import reader
from inverse_service.reading.names import Names

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_INDEXED = re.compile(r"[A-Za-z]+(_?)([0-9]+|(?<=_)[A-Za-z0-9]+)")
_LENGTH = ex.Symbol("p")
# From so many momenta on their length gets a name although that may be longer.
_MANY = 3
# The condition det g != 0 of so many coordinates is said in words where it has so many characters.
_LONG = 60


@dataclass(frozen=True, slots=True)
class Readable:
    """H as a text and in LaTeX, the momenta as equations, what else it is written with, and the
    names of all; `renamed` has the momenta that are called otherwise in the result.
    """

    text: str
    latex: str
    momenta: tuple[str, ...]
    definitions: tuple[str, ...]
    names: Names
    renamed: Mapping[str, str] = field(default_factory=dict)

    def said(self, text: str) -> str:
        """A formula of the result with these names of the momenta."""
        return _NAME.sub(lambda match: self.renamed.get(match[0], match[0]), text)


def readable(energy: Mapping[str, Any], names: Names) -> Readable:
    """H of a result with its names; as it is where it cannot be parsed."""
    momenta: dict[str, str] = energy["momenta"]
    plain = Readable(
        energy["text"],
        energy.get("latex") or "",
        tuple(f"{name} = {text}" for name, text in momenta.items()),
        (),
        names,
    )
    renamed = short_names(momenta, names)
    try:
        tree = reader.read_formula(energy["text"], names)
    except errors.InputError:
        return plain
    shown: ex.Expression = ex.substitute(
        tree, {ex.Symbol(old): ex.Symbol(new) for old, new in renamed.items()}
    )
    symbols = [ex.Symbol(renamed.get(name, name)) for name in momenta]
    words = dict.fromkeys((*names.parameters, *(symbol.name for symbol in symbols)))
    length = _with_length(shown, symbols)
    definitions = tuple[str, ...]()
    if length is not None and _LENGTH.name not in (*words, *names.coordinates, *names.functions):
        root = printing.to_text(ex.square_root(ex.add(*(symbol**2 for symbol in symbols))))
        shown, definitions = length, (f"p = {root}",)
        words[_LENGTH.name] = None
    if shown == tree:
        return plain
    return Readable(
        printing.to_text(shown),
        printing.to_latex(shown),
        tuple(f"{renamed.get(name, name)} = {text}" for name, text in momenta.items()),
        definitions,
        Names(names.coordinates, tuple(words), names.functions),
        renamed,
    )


def short_names(momenta: Collection[str], names: Names) -> dict[str, str]:
    """{p_x_A: p_A, p_q1: p1, p_q: p} where only one coordinate has the index and the name is
    free.
    """
    found = dict[str, str]()
    for name in momenta:
        coordinate = name.removeprefix("p_")
        match = _INDEXED.fullmatch(coordinate)
        if not name.startswith("p_") or coordinate not in names.coordinates:
            continue
        if match:
            found[name] = f"p{match[1]}{match[2]}"
        elif coordinate == "q":
            found[name] = "p"
    taken = {*names.coordinates, *names.functions, *names.parameters, *momenta}
    counts = [*found.values()]
    return {old: new for old, new in found.items() if counts.count(new) == 1 and new not in taken}


def _with_length(tree: ex.Expression, momenta: Sequence[ex.Symbol]) -> ex.Expression | None:
    """The tree with p for sqrt(p_x^2 + p_y^2) where roots or functions hold the squares; None
    where none does, or where it says no more shortly.
    """
    squares = [symbol**2 for symbol in momenta]
    if len(squares) < 2:
        return None

    def changed(part: ex.Expression) -> ex.Expression:
        match part:
            case ex.Power(ex.Sum(terms), ex.Number(e)) if sorted(terms, key=repr) == sorted(
                squares, key=repr
            ):
                return _LENGTH ** (2 * e)
        part = ex.rebuild(part, changed)
        match part:
            case ex.Sum(terms) if all(square in terms for square in squares):
                place = min(terms.index(square) for square in squares)
                others = [
                    _LENGTH**2 if k == place else term
                    for k, term in enumerate(terms)
                    if k == place or term not in squares
                ]
                return ex.add(*others)
        return part

    found = changed(tree)
    left = ex.has(found, ex.Symbol) and any(ex.holds(found, symbol) for symbol in momenta)
    rooted = any(
        isinstance(node, ex.Apply)
        or (
            isinstance(node, ex.Power)
            and isinstance(node.exponent, ex.Number)
            and node.exponent.value.denominator > 1
        )
        for node in ex.walk(tree)
        if ex.holds(node, *momenta)
    )
    if found == tree or left or not rooted:
        return None
    definition = ex.square_root(ex.add(*squares))
    lengths = [len(printing.to_text(one)) for one in (found, definition, tree)]
    return found if len(squares) >= _MANY or lengths[0] + lengths[1] < lengths[2] else None


def said_by_regularity(
    multiplier: Sequence[Sequence[str]], conditions: Collection[str], names: Names
) -> frozenset[str]:
    """The long ones among the conditions X != 0 that hold wherever the multiplier is not singular:
    X divides its determinant, by exact division.
    """
    long = [one for one in conditions if one.endswith(" != 0") and len(one) > _LONG]
    if len(multiplier) < _MANY or not long:
        return frozenset()
    return _dividing(
        tuple(map(tuple, multiplier)), tuple(long), names.coordinates, names.parameters
    )


@lru_cache(maxsize=64)
def _dividing(
    multiplier: tuple[tuple[str, ...], ...],
    conditions: tuple[str, ...],
    coordinates: tuple[str, ...],
    parameters: tuple[str, ...],
) -> frozenset[str]:
    names = Names(coordinates, parameters)
    try:
        rows = [[reader.read_formula(entry, names) for entry in row] for row in multiplier]
        trees = {one: reader.read_formula(one.removesuffix(" != 0"), names) for one in conditions}
        symbols: list[ex.Symbol | ex.Velocity] = [*map(ex.Symbol, (*coordinates, *parameters))]
        symbols += map(ex.Velocity, coordinates)
        whole = [*(entry for row in rows for entry in row), *trees.values()]
        budget = exact_field.Budget.short()
        ring = exact_field.exact_ring(whole, symbols, None, budget, unused="kept")
        values = [[ring.value(entry) for entry in row] for row in rows]
        determinant = matrices.determinant(values, ring.value(ex.ONE))
        return frozenset(
            one
            for one, tree in trees.items()
            if (determinant / ring.value(tree)).exponents == determinant.exponents
        )
    except (errors.InputError, exact_field.TooLarge, ZeroDivisionError, KeyError):
        return frozenset()
