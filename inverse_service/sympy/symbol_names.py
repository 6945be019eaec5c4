"""Which SymPy object each name of a document stands for, and the formulas of results as SymPy objects."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import sympy
from sympy.core.function import AppliedUndef

from inverse_service.errors import InputError
from inverse_service.expressions.tree import TIME, Acceleration, Arbitrary, Expression, Symbol, Velocity
from inverse_service.reading.names import Names as FormulaNames
from inverse_service.reading.names import declared_name
from inverse_service.reading.reader import read_formula
from inverse_service.reading.sympy_trees import to_sympy

_GOOD = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")


@dataclass(frozen=True)
class Table:
    """SymPy objects by names: coordinates (x(t), or symbols), their velocities, parameters, function classes."""

    time: Any
    time_name: str = "t"
    coordinates: Mapping[str, Any] = field(default_factory=dict)
    velocities: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    functions: Mapping[str, Any] = field(default_factory=dict)
    arguments: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def momenta(self) -> dict[str, Any]:
        """The symbols p_x of the momenta."""
        return {f"p_{name}": sympy.Symbol(f"p_{_plain(found)}") for name, found in self.coordinates.items()}

    def symbol(self, name: str) -> Any:
        """The object of a name; a symbol of the same name for one that is not in the table."""
        for part in (self.coordinates, self.parameters, self.momenta):
            if name in part:
                return part[name]
        if name == self.time_name:
            return self.time
        return sympy.Symbol(name)

    def leaf(self, node: Expression) -> Any:
        """The object of a name as it stands in a formula, and of an arbitrary function."""
        match node:
            case _ if node == TIME and "t" not in self.coordinates and "t" not in self.parameters:
                return self.time
            case Symbol(name):
                return self.symbol(name)
            case Velocity(name):
                return self.velocity(name)
            case Acceleration(name):
                return self.acceleration(name)
            case Arbitrary():
                return self._applied(node)
        raise TypeError(f"{type(node).__name__} is no leaf")

    def _applied(self, tree: Arbitrary) -> Any:
        """A(u), its derivatives taken at dummies and then put at the arguments."""
        function = self.functions.get(tree.name, sympy.Function(tree.name))
        arguments = [to_sympy(argument, self.leaf) for argument in tree.arguments]
        if not any(tree.orders):
            return function(*arguments)
        plain = all(argument.is_Symbol or isinstance(argument, AppliedUndef) for argument in arguments)
        if plain and len(set(arguments)) == len(arguments):
            pairs = [(u, k) for u, k in zip(arguments, tree.orders, strict=True) if k]
            return sympy.Derivative(function(*arguments), *pairs)
        dummies = [sympy.Dummy(f"xi_{place}") for place in range(len(arguments))]
        pairs = [(u, k) for u, k in zip(dummies, tree.orders, strict=True) if k]
        return sympy.Subs(sympy.Derivative(function(*dummies), *pairs), dummies, arguments)

    def velocity(self, name: str) -> Any:
        """x'(t), or the symbol of the velocity."""
        return self.velocities[name] if name in self.velocities else self.coordinates[name].diff(self.time)

    def acceleration(self, name: str) -> Any:
        """x''(t), also where the velocity is a plain symbol."""
        found = self.coordinates[name]
        return sympy.Symbol(f"{found}_ddot") if name in self.velocities else found.diff(self.time, 2)

    def of_formulas(self) -> FormulaNames:
        """The names as the reader of formulas wants them."""
        more = [self.time_name] if self.time_name != "t" else []
        taken = {*self.coordinates, *self.functions}
        words = (*self.parameters, *self.momenta, *more)
        return FormulaNames(
            tuple(self.coordinates), tuple(word for word in dict.fromkeys(words) if word not in taken), self.arguments
        )


def _plain(found: Any) -> str:
    return str(found.func) if isinstance(found, AppliedUndef) else str(found)  # x(t), or the class f itself


def table_of_result(result: Mapping[str, Any], given: Mapping[str, Any] | None = None) -> Table:
    """The names of a result as new SymPy objects, or as those given for them."""
    system, given = result.get("system") or {}, given or {}
    time_name = system.get("time", "t")
    time = given.get(time_name, sympy.Symbol(time_name))
    functions = system.get("functions", {})
    return Table(
        time,
        time_name,
        {name: given.get(name, sympy.Function(name)(time)) for name in system.get("coordinates", ())},
        {},
        {name: given.get(name, sympy.Symbol(name)) for name in system.get("parameters", ())},
        {name: given.get(name, sympy.Function(name)) for name in functions},
        {name: tuple(arguments) for name, arguments in functions.items()},
    )


def declared_text(each: Any) -> str:
    """The name or value of an object in a declaration: k for Symbol("k"), V for Function("V"), 2 for 2."""
    return each if isinstance(each, str) else _plain(each)


def names_for(objects: Iterable[Any]) -> dict[Any, str]:
    """A name for each object: its own where a document can declare it, else one like it."""
    used, found = set[str](), {}
    for each in objects:
        wanted = _wanted(_plain(each))
        name = next(word for word in (wanted, *(f"{wanted}_{k}" for k in range(2, 99))) if word not in used)
        used.add(name)
        found[each] = name
    return found


def _wanted(word: str) -> str:
    """theta for \\theta, q_1 for q_{1}, var_diff for a word that stands for something else."""
    plain = re.sub(r"[^A-Za-z0-9_]", "", word).strip("_")
    plain = re.sub(r"_+", "_", plain)
    if not _GOOD.fullmatch(plain):
        return "s"
    try:
        return declared_name(plain, "") if plain not in ("e", "E", "I") else f"{plain}_0"
    except InputError:
        return f"var_{plain}"[:40]


_RELATIONS = ((" >= ", sympy.Ge), (" <= ", sympy.Le), (" != ", sympy.Ne), (" > ", sympy.Gt), (" < ", sympy.Lt))


def expression(text: str, table: Table) -> Any:
    """A formula of a result."""
    return to_sympy(read_formula(text, table.of_formulas()), table.leaf)


def with_integrals(table: Table, integrals: Mapping[str, Any]) -> Table:
    """The table with a function F(x) for each integral of an answer; SymPy differentiates it to what is known."""
    arguments = {name: tuple(part["arguments"]) for name, part in integrals.items()}
    functions = {name: _integral(name, part, arguments[name], table) for name, part in integrals.items()}
    return replace(table, functions={**table.functions, **functions}, arguments={**table.arguments, **arguments})


def _integral(name: str, part: Mapping[str, Any], arguments: tuple[str, ...], table: Table) -> Any:
    """The class of a function that is known by its derivatives."""

    def fdiff(self: Any, argindex: int = 1) -> Any:
        slope = part["derivatives"].get(arguments[argindex - 1])
        if slope is None:
            return sympy.Function.fdiff(self, argindex)
        formal = [table.symbol(argument) for argument in arguments]
        return expression(slope, table).subs(dict(zip(formal, self.args, strict=True)), simultaneous=True)

    return type(name, (sympy.Function,), {"fdiff": fdiff, "nargs": len(arguments)})


def relation(text: str, table: Table) -> Any:
    """A condition such as x' != 0; the whole text as a symbol where it is a sentence."""
    for sign, kind in _RELATIONS:
        left, found, right = text.partition(sign)
        if found:
            return kind(expression(left, table), expression(right, table))
    return sympy.Symbol(text)
