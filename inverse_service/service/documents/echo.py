"""What a document says, as every door shows it: in the order, the names, and the numbers of its
author.

A line is an equation as written, or L and a constraint, read and printed again; beside them are the
definitions and values of the names that occur in them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from api_schemas import result as schemas
from api_schemas.system import (
    LagrangianDocument,
    MotionDocument,
    NonholonomicDocument,
    SystemDocument,
)
from inverse_service import errors
from inverse_service.expressions import printing, tree as ex
from inverse_service.mechanics import constrained_motion, second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, reader
from inverse_service.reading.declarations import TypedLines
from inverse_service.service.documents import accepting
from inverse_service.service.documents.accepting import Asking

LONGEST = 4_000  # characters of a document whose lines are shown as they were written
_Line = tuple[ex.Expression, ex.Expression]


class Written(NamedTuple):
    """The lines of a document, and what the names in them mean."""

    lines: list[schemas.Formula]
    definitions: list[schemas.Formula]


NOTHING = Written([], [])


def written_lines(schema: Asking | LagrangianDocument, solved: Mapping[str, str]) -> Written:
    """The lines of a document; none for first-order pairs, which are joined, for long documents,
    for what cannot be shown so, and for a list or an object of equations, which a program may have
    written, that say it in fewer characters once they are `solved`.
    """
    plain = schema.model_dump(mode="json", exclude_unset=True)
    if sum(map(len, accepting.typed_texts(plain))) > LONGEST:
        return NOTHING
    decimals = accepting.decimals_of_lines(plain)
    # Accelerations by coordinate are mostly written by programs, whose order nobody chose.
    chosen = not isinstance(plain.get("equations"), Mapping)
    with printing.with_decimals(decimals), printing.in_given_order(chosen):
        try:
            typed = _typed(schema)
        except errors.InputError:
            return NOTHING
        if typed is None:
            return NOTHING
        meanings = _meanings(typed)
        found = Written([_shown(*line) for line in typed.sides], [_shown(*one) for one in meanings])
    is_text = isinstance(plain.get("equations", ""), str)
    shortest = sum(len(reader.equation_line(*line)) for line in solved.items())
    if not (is_text or meanings) and sum(len(one.text) for one in found.lines) > shortest:
        return NOTHING
    return found


def lines_of_stored(system: Mapping[str, Any]) -> Written:
    """The same for the system of an older result, which does not say them."""
    given, solved = system.get("given") or {}, system.get("equations") or {}
    try:
        if "lagrangian" not in given:
            return written_lines(accepting.to_schema(given), solved)
        if "constraints" in given:
            return written_lines(accepting.validated(given, NonholonomicDocument), solved)
        return written_lines(accepting.validated(given, LagrangianDocument), solved)
    except errors.InputError:
        return NOTHING


def has_extremes(schema: Asking | LagrangianDocument) -> bool:
    """Whether max or min may occur in a document."""
    texts = accepting.typed_texts(schema.model_dump(mode="json", exclude_unset=True))
    return any(name in text.casefold() for text in texts for name in nm.EXTREMES)


def accelerations_with_extremes(
    schema: SystemDocument, system: SecondOrderSystem
) -> SecondOrderSystem:
    """The system as it is shown: with max(a, b), not (a + b + |a - b|)/2, where that was typed."""
    if system.is_unsolved or not has_extremes(schema):
        return system
    try:
        with printing.in_given_order():
            given = second_order_system.read_given(accepting.declared(schema), schema.equations)
        found = second_order_system.solved_system(given, schema.name)
    except errors.InputError:
        return system
    return replace(system, accelerations=found.accelerations)


def lagrangian_with_extremes(
    schema: NonholonomicDocument | LagrangianDocument, lagrangian: ex.Expression
) -> ex.Expression:
    """The same of a Lagrangian."""
    if not has_extremes(schema):
        return lagrangian
    try:
        with printing.in_given_order():
            typed = _typed(schema)
        return typed.known.put_in(typed.sides[0][1]) if typed else lagrangian
    except errors.InputError:
        return lagrangian


def _typed(schema: Asking | LagrangianDocument) -> TypedLines | None:
    declared = accepting.declared(schema)
    match schema:
        case SystemDocument(equations=equations):
            # What an answer has read (`accepting.to_given`) may be in another order of its terms.
            return second_order_system.read_given(declared, equations).typed
        case NonholonomicDocument(lagrangian=lagrangian, constraints=held):
            return constrained_motion.read_typed(lagrangian, held, declared)
        case LagrangianDocument(lagrangian=lagrangian):
            return constrained_motion.read_typed(lagrangian, [], declared)
        case MotionDocument():
            return None


def _meanings(typed: TypedLines) -> Sequence[_Line]:
    """The definitions and values of names that occur in the lines and in one another."""
    known, found, new = typed.known, list[_Line](), list(typed.sides)
    meanings = {
        name: tree for name, tree in known.definitions.items() if isinstance(name, ex.Symbol)
    } | {ex.Symbol(name): tree for name, tree in known.values.items()}
    while new:
        occurring = {node for line in new for side in line for node in ex.walk(side)}
        new = [(name, meanings.pop(name)) for name in [*meanings] if name in occurring]
        found += new
    return found


def _shown(left: ex.Expression, right: ex.Expression) -> schemas.Formula:
    text = f"{printing.to_text(left)} = {printing.to_text(right)}"
    return schemas.Formula(
        text=text, latex=f"{printing.to_latex(left)} = {printing.to_latex(right)}"
    )
