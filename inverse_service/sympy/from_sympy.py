"""Systems of SymPy objects to documents."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy
from sympy.core.function import AppliedUndef

from inverse_service.errors import InputError
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import Acceleration, Expression, Symbol, Velocity
from inverse_service.reading.sympy_trees import Leaves, from_sympy
from inverse_service.service.documents.accepting import to_schema, to_system
from inverse_service.service.documents.preparing import prepared
from inverse_service.sympy.symbol_names import Table, names_for


@dataclass(frozen=True)
class Reading:
    """The document that is asked, and the objects of its names."""

    document: dict[str, Any]
    names: Table


@dataclass(frozen=True)
class _Given:
    """Expressions that are zero, what moves in them, and how its velocity is written where not as a derivative.

    `pairs`: they are of first order, and of what moves a half, `preferred` where that is given, are the coordinates.
    """

    zeros: tuple[Any, ...]
    coordinates: tuple[Any, ...]
    velocities: Mapping[Any, Any]
    time: Any
    accelerations: Mapping[Any, Any] | None = None
    pairs: bool = False
    preferred: tuple[Any, ...] = ()


def read(
    system: Any,
    coordinates: Sequence[Any] | None,
    velocities: Mapping[Any, Any] | None,
    time: Any,
    questions: Mapping[str, Any],
) -> Reading:
    """The document of a system; InputError for what would have to be guessed."""
    if hasattr(system, "form_lagranges_equations"):
        system, coordinates = _of_lagrange(system)
    elif hasattr(system, "kanes_equations"):
        return _of_kane(system, questions)
    if isinstance(system, Mapping):
        system = {_moved(key): value for key, value in system.items()}
    elif (found := _lagrangian(system)) is not None:
        return _forward(found, coordinates, time, questions)
    given = _given(system, coordinates, velocities or {}, time)
    table, leaves = _names(given)
    equations: Any
    if given.accelerations is not None:
        equations = {table_name(table, x): to_text(_tree(f, given, leaves)) for x, f in given.accelerations.items()}
    else:
        equations = [f"{to_text(_tree(zero, given, leaves))} = 0" for zero in given.zeros]
    document = {**_declared(table), "equations": equations, **_asked(questions, given, leaves)}
    return _of_pairs(document, table, given) if given.pairs else Reading(document, table)


def _moved(key: Any) -> Any:
    """x(t), where the key of an acceleration is x(t).diff(t, 2)."""
    second = isinstance(key, sympy.Derivative) and isinstance(key.expr, AppliedUndef) and key.derivative_count == 2
    return key.expr if second else key


def _lagrangian(system: Any) -> Any:
    """A single expression with velocities and no accelerations, None for anything else."""
    if not isinstance(system, sympy.Expr):
        return None
    orders = {each.derivative_count for each in _expression(system).atoms(sympy.Derivative)
              if isinstance(each.expr, AppliedUndef) and each.variables[0] in each.expr.args}  # fmt: skip
    return system if orders == {1} else None


def _forward(lagrangian: Any, coordinates: Sequence[Any] | None, time: Any, questions: Mapping[str, Any]) -> Reading:
    """The document that asks for the equations of motion of a Lagrangian."""
    zeros = (_expression(lagrangian),)
    time = time or _found_time(zeros)
    given = _Given(zeros, tuple(coordinates or _moving(zeros, time, 1)), {}, time)
    table, leaves = _names(given)
    document = {**_declared(table), "lagrangian": to_text(_tree(zeros[0], given, leaves))}
    return Reading({**document, **_asked(questions, given, leaves)}, table)


def _of_pairs(document: Mapping[str, Any], table: Table, given: _Given) -> Reading:
    """The document of first-order equations x' = h, p' = F, and the objects of the x that its reader chooses."""
    named = [table_name(table, each) for each in given.preferred]
    whole = {key: value for key, value in document.items() if key != "coordinates"}
    whole |= {"coordinates": named} if named else {}
    ready = prepared(whole)
    try:
        chosen = to_system(to_schema(ready.document)).coordinates
    except InputError as error:
        raise ready.error(error) from None
    return Reading(whole, replace(table, coordinates={name: table.coordinates[name] for name in chosen}))


def read_constrained(
    lagrangian: Any, constraints: Sequence[Any], coordinates: Sequence[Any], questions: Mapping[str, Any]
) -> Reading:
    """The document of a Lagrangian with constraints; all of them may be expressions that are zero, or equations."""
    zeros = (_expression(lagrangian), *map(_zero, constraints))
    given = _Given(zeros, tuple(coordinates), {}, _time_of(coordinates))
    table, leaves = _names(given)
    texts = [to_text(_tree(zero, given, leaves)) for zero in zeros]
    document = {**_declared(table), "lagrangian": texts[0], "constraints": texts[1:]}
    return Reading({**document, **_asked(questions, given, leaves)}, table)


def table_name(table: Table, found: Any) -> str:
    """The name of a coordinate."""
    return next(name for name, each in table.coordinates.items() if each == found)


def _declared(table: Table) -> dict[str, Any]:
    found: dict[str, Any] = {"coordinates": list(table.coordinates)}
    if table.parameters:
        found["parameters"] = list(table.parameters)
    if table.functions:
        found["functions"] = {name: list(arguments) for name, arguments in table.arguments.items()}
    return found if table.time_name == "t" else {**found, "time": table.time_name}


def _asked(questions: Mapping[str, Any], given: _Given, leaves: Leaves) -> dict[str, Any]:
    """The questions as the document has them; terms of an ansatz may be expressions."""
    found = {key: value for key, value in questions.items() if value is not None}
    if "ansatz" in found:
        terms = found["ansatz"]
        found["ansatz"] = [term if isinstance(term, str) else to_text(_tree(term, given, leaves)) for term in terms]
    return found


def _of_lagrange(method: Any) -> tuple[list[Any], list[Any]]:
    """The equations and coordinates of a LagrangesMethod."""
    if getattr(method, "_hol_coneqs", None) or len(method.coneqs):
        raise InputError("This LagrangesMethod has constraints: give its Lagrangian and them to nonholonomic().")
    if method.eom is None or not len(method.eom):
        method.form_lagranges_equations()
    return list(method.eom), list(method.q)


def _of_kane(method: Any, questions: Mapping[str, Any]) -> Reading:
    """Kane's equations: q' = h(q, u), u' = F(q, u), as pairs that are solved for the speeds."""
    if len(method.u) != len(method.q):
        raise InputError("This KanesMethod has fewer speeds than coordinates: use nonholonomic(L, constraints, q).")
    time = _time_of(list(method.q))
    slopes, size = list(method.rhs()), len(method.q)
    unknown = {u: sympy.Dummy(f"u_{place}") for place, u in enumerate(method.u)}
    rates = [q.diff(time) - h.xreplace(unknown) for q, h in zip(method.q, slopes[:size], strict=True)]
    solved = sympy.solve(rates, list(unknown.values()), dict=True)
    if len(solved) != 1:
        raise InputError("The speeds of this KanesMethod do not follow from the velocities: choose others.")
    speeds = {u: solved[0][unknown[u]] for u in method.u}
    forces = {u.diff(time): f for u, f in zip(method.u, slopes[size:], strict=True)}
    found = {q: h.diff(time).xreplace(forces).subs(speeds) for q, h in zip(method.q, slopes[:size], strict=True)}
    return read(found, list(method.q), None, time, questions)


def _given(system: Any, coordinates: Sequence[Any] | None, velocities: Mapping[Any, Any], time: Any) -> _Given:
    coordinates = [coordinates] if isinstance(coordinates, sympy.Basic) else coordinates
    for each in coordinates or ():
        if not isinstance(each, AppliedUndef | sympy.Symbol):
            raise InputError("a coordinate is no SymPy object: give those of the equations, as x(t).", "/coordinates")
        if isinstance(system, Mapping) and each not in system:
            raise InputError(f"{each} has no acceleration: give one for each of the coordinates.", "/coordinates")
    if isinstance(system, Mapping):
        moving = tuple(coordinates or system)
        _refuse_without_velocities(moving, velocities)
        found = {x: _expression(f) for x, f in system.items()}
        return _Given(tuple(found.values()), moving, velocities, time or _time_of(moving), found)
    zeros = tuple(_zero(each) for each in _listed(system))
    time = time or _found_time(zeros)
    fast, slow = _moving(zeros, time, 2), _moving(zeros, time, 1)
    if slow and not fast and not velocities and set(coordinates or ()) < set(slow):
        return _Given(zeros, tuple(slow), velocities, time, pairs=True, preferred=tuple(coordinates or ()))
    moving = tuple(coordinates or fast)
    only_first = [] if coordinates else [each for each in slow if each not in moving]
    if only_first:
        detail = f"{only_first[0]} has a first derivative only: name the coordinates, coordinates=[...]."
        raise InputError(detail, "/coordinates")
    if not moving:
        detail = "no function of the time has a second derivative here: name the coordinates, coordinates=[x, y]."
        raise InputError(detail, "/coordinates")
    return _Given(zeros, moving, velocities, time)


def _listed(system: Any) -> list[Any]:
    if not isinstance(system, sympy.Basic | sympy.MatrixBase | str) and isinstance(system, Iterable):
        system = list(system)  # a set, a generator, an array
    if isinstance(system, sympy.Equality) and isinstance(system.lhs, sympy.MatrixBase):
        system = system.lhs - system.rhs
    if isinstance(system, sympy.MatrixBase):
        return list(system)
    return list(system) if isinstance(system, Sequence) else [system]


def _zero(equation: Any) -> Any:
    """The expression that an equation says is zero."""
    if equation in (sympy.true, sympy.false, True, False):
        raise InputError("an equation became True or False: give Eq(a, b, evaluate=False).", "/equations")
    if isinstance(equation, sympy.core.relational.Relational) and not isinstance(equation, sympy.Equality):
        raise InputError("a comparison occurs: write an equation, Eq(a, b).", "/equations")
    return _expression(equation.lhs - equation.rhs if isinstance(equation, sympy.Equality) else equation)


def _expression(value: Any) -> Any:
    """A SymPy expression, derivatives of products and sums carried out; texts are refused and not evaluated."""
    try:
        found = sympy.sympify(value, strict=True)
    except sympy.SympifyError:
        found = None
    if not isinstance(found, sympy.Expr | sympy.MatrixBase):
        detail = "this is no SymPy expression: give expressions, or the whole system as text, or what its file holds."
        raise InputError(detail, "/equations")
    for derivative in found.atoms(sympy.Derivative):
        if not all(count.is_Integer for _, count in derivative.variable_count):
            raise InputError(f"the order of {derivative} is not a number: write second derivatives.", "/equations")
    return found.replace(
        lambda part: isinstance(part, sympy.Derivative) and not isinstance(part.expr, AppliedUndef),
        lambda part: part.doit(deep=False) if part.expr.has(AppliedUndef) else part,
    )


def _refuse_without_velocities(moving: Iterable[Any], velocities: Mapping[Any, Any]) -> None:
    for each in moving:
        if not isinstance(each, AppliedUndef) and each not in velocities:
            detail = f"{each} is a plain symbol: say which symbol is its velocity, velocities={{{each}: ...}}."
            raise InputError(detail, "/coordinates")


def _time_of(moving: Sequence[Any]) -> Any:
    found = {each.args[0] for each in moving if isinstance(each, AppliedUndef) and len(each.args) == 1}
    if len(found) > 1:
        raise InputError("the coordinates depend on different variables: write all of them as functions of one time.")
    return found.pop() if found else sympy.Symbol("t")


def _found_time(zeros: Sequence[Any]) -> Any:
    """The variable of the second derivatives of functions of one variable."""
    orders: dict[Any, int] = {}
    for derivative in (each for zero in zeros for each in zero.atoms(sympy.Derivative)):
        by = derivative.variables[0]
        if isinstance(derivative.expr, AppliedUndef) and derivative.expr.args == (by,) and by.is_Symbol:
            orders[by] = max(orders.get(by, 0), len(derivative.variables))
    found = {by for by, order in orders.items() if order >= 2} or set(orders)
    if len(found) != 1:
        raise InputError("the derivatives do not show which variable is the time: pass time=t.", "/time")
    return found.pop()


def _moving(zeros: Sequence[Any], time: Any, order: int) -> list[Any]:
    """The functions of the time with a derivative of at least this order, in the order of the equations."""
    first: dict[Any, int] = {}
    for place, zero in enumerate(zeros):
        for derivative in zero.atoms(sympy.Derivative):
            moving = isinstance(derivative.expr, AppliedUndef) and derivative.expr.args == (time,)
            if moving and derivative.derivative_count >= order:
                first.setdefault(derivative.expr, place)
    return sorted(first, key=lambda each: (first[each], sympy.default_sort_key(each)))


def _names(given: _Given) -> tuple[Table, Leaves]:
    """Names for all objects in the formulas, and what each of them is as a tree."""
    velocities = set(given.velocities.values())
    applied = {each for zero in given.zeros for each in zero.atoms(AppliedUndef)} - set(given.coordinates)
    free = {each for zero in given.zeros for each in zero.free_symbols}
    constants = free - velocities - {given.time} - set(given.coordinates) - _dummies(given.zeros)
    symbols = sorted(constants, key=sympy.default_sort_key)
    classes = sorted({each.func for each in applied}, key=str)
    _refuse_other_motions(given, applied, symbols)
    _refuse_two_of_a_name([*symbols, *([given.time] if given.time in free else []), *classes])
    names = names_for((*given.coordinates, *symbols, *classes))
    time_name = _time_name(given.time, names)
    functions = {names[each]: each for each in classes}
    arguments = {names[each]: _formal(each, applied, given, {**names, given.time: time_name}) for each in classes}
    table = Table(
        given.time,
        time_name,
        {names[each]: each for each in given.coordinates},
        {names[each]: given.velocities[each] for each in given.coordinates if each in given.velocities},
        {names[each]: each for each in symbols},
        functions,
        arguments,
    )
    return table, _leaves(given, {**names, given.time: time_name}, classes)


def _leaves(given: _Given, names: Mapping[Any, str], classes: Sequence[Any]) -> Leaves:
    trees: dict[Any, Expression] = {}
    for each, name in names.items():
        if each in given.coordinates:
            trees[each] = Symbol(name)
            speed = given.velocities.get(each) if each in given.velocities else each.diff(given.time)
            trees[speed] = Velocity(name)
            if isinstance(each, AppliedUndef):
                trees[each.diff(given.time, 2)] = Acceleration(name)
        elif each not in classes:
            trees[each] = Symbol(name)
    return Leaves(trees, {each: names[each] for each in classes})


def _dummies(zeros: Sequence[Any]) -> set[Any]:
    """The bound variables of Subs."""
    return {variable for zero in zeros for each in zero.atoms(sympy.Subs) for variable in each.variables}


def _refuse_other_motions(given: _Given, applied: set[Any], symbols: Sequence[Any]) -> None:
    """InputError for x(t - 1), for a second function x with other assumptions, and for a symbol x besides x(t)."""
    moving = {str(each.func): each for each in given.coordinates if isinstance(each, AppliedUndef)}
    for each in sorted(applied, key=str):
        known = moving.get(str(each.func))
        if known is not None and each.func == known.func:
            raise InputError(
                f"{each} occurs together with {known}: only {known} itself is accepted, without a delay.", "/equations"
            )
        if known is not None:
            detail = f"two functions are called {known.func} and have other assumptions: use one of them."
            raise InputError(detail, "/coordinates")
    for each in symbols:
        if str(each) in moving:
            detail = (
                f"the symbol {each} occurs together with {moving[str(each)]}: write the function, or rename the symbol."
            )
            raise InputError(detail, "/parameters")


def _refuse_two_of_a_name(symbols: Sequence[Any]) -> None:
    """InputError for two objects of one name, and for a symbol that is not real."""
    seen: dict[str, Any] = {}
    for each in symbols:
        if seen.setdefault(str(each), each) != each:
            detail = f"two symbols are called {each} and have other assumptions: use one of them."
            raise InputError(detail, "/parameters")
        if getattr(each, "is_real", None) is False or each.is_commutative is False:
            raise InputError(f"the symbol {each} is not real: write real equations.", "/parameters")


def _time_name(time: Any, names: Mapping[Any, str]) -> str:
    taken = set(names.values())
    wanted = names_for([time]).get(time, "t") if str(time) != "t" else "t"
    if wanted in taken or (wanted == "t" and "t" in taken):
        raise InputError(f"{time} is the time and another symbol has its name: rename one of the two.", "/time")
    return wanted


def _formal(function: Any, applied: set[Any], given: _Given, names: Mapping[Any, str]) -> tuple[str, ...]:
    """The names of the arguments of an arbitrary function: the coordinates, and t, that it is applied to."""
    calls = [each.args for each in applied if each.func == function]
    size = len(calls[0])
    if any(len(call) != size for call in calls):
        raise InputError(f"the function {function} has different numbers of arguments: give it one.", "/functions")
    moving = (*given.coordinates, given.time)
    plain = next((call for call in calls if set(call) <= set(moving) and len(set(call)) == size), None)
    chosen = plain or moving[:size]
    if len(chosen) < size:
        detail = f"the function {function} has more arguments than there are coordinates, and the time."
        raise InputError(detail, "/functions")
    return tuple(names[each] for each in chosen)


def _tree(expression: Any, given: _Given, leaves: Leaves) -> Expression:
    return from_sympy(_expression(expression), leaves)
