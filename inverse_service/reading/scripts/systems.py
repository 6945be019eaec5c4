"""The system that a program comes to, as a document: its Lagrangian, its equations, or the rates that one
of its functions returns.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple, TypeGuard

from inverse_service.expressions import collecting, printing, tree as ex
from inverse_service.reading import names as nm
from inverse_service.reading.scripts import (
    calls,
    frames,
    modelica,
    nodes as nd,
    steps,
    values as vs,
)
from inverse_service.reading.scripts.machine import STEPS, Dialect, Machine, set_in
from inverse_service.reading.scripts.nodes import walk
from inverse_service.reading.scripts.values import Value

_LAGRANGIANS = ("L", "Lag", "lag", "Lagr", "lagr", "La", "LL", "Lagrange", "lagrange", "lagrangian",
    "Lagrangian", "Lgr", "Lg", "ell", "L1", "\u2112", "Lagrangien", "lagrangien", "l")  # fmt: skip
_OF_PARAMETERS = ("p", "params", "par", "args", "pars", "parameters", "param", "c", "theta_params",
    "parms", "rpar", "RPAR", "ipar", "IPAR")  # fmt: skip
_TIMES = ("t", "tau", "\u03c4", "time")
_TORQUES = ("tau", "\u03c4")  # as often as times
_CLOCKS = ("T", "tau", "time", "x", "s", "\u03c4", "_t")
_MULTIPLIERS = ("lam", "mu", "\u03bb")
_SPEED = re.compile(r"v|v[xyz]|vel|velocity|speed|omega|\w+dot|x_?d|dx")
_MOVES = ex.Velocity | ex.Acceleration
_RATES = ("d{}", "D{}", "{}dot", "{}_dot", "d_{}", "{}_d")  # marks of a rate that nothing else has
_MOST_STATES = 24
_MOST_DIGITS = 12  # of a decimal number that is shown
_DRAWING = frozenset(("FuncAnimation", "animation", "requestAnimationFrame", "setInterval"))


class Run(NamedTuple):
    """The keys of a document, and whether the lines of the program alone do not say it: it calls
    functions of its own, passes other values than the default ones, or clears a name. `took` are
    the traps of `statements.toml` that the run takes into account.
    """

    document: dict[str, Any]
    is_more_than_lines: bool
    took: frozenset[str] = frozenset()
    time: str = "t"  # what the program calls the time, t in the document
    # The values, g = 9.81, that the program gives to letters which the document has as letters.
    aside: tuple[str, ...] = ()


def run_program(body: Sequence[nd.Node], dialect: Dialect) -> Run:
    """What a program comes to; NotRead where it has no system that is certain."""
    words = {node.text for node in _walk_all(body) if isinstance(node, nd.Name)}
    words |= {
        name
        for node in _walk_all(body)
        if isinstance(node, nd.Function)
        for name in node.parameters
    }
    texts = {node.value for node in _walk_all(body) if isinstance(node, nd.Constant)}
    known = (word for word in _TIMES if word in words or word in texts)
    times = [word for word in known if word not in _TORQUES or _is_time(word, body)]
    time = next(iter(times or _other_times(body)), "t")
    machine = Machine(dialect, time, calls.value)
    machine.stated.steps = _step_of(body)
    if dialect.functions_first:
        machine.run([one for one in body if isinstance(one, nd.Function) and one.name])
    machine.run(body)
    _run_methods(machine, body)
    _run_alone(machine, body)
    document = _system_of(machine, body)
    takes_mass = machine.stated.mass is not None and "lagrangian" not in document
    took = frozenset(("problem", "mass") if takes_mass else ("problem",))
    is_more = bool(machine.stated.calls) or machine.stated.overrides
    return Run(document, is_more, took, "t" if times else time, _set_aside(machine, document))


def _set_aside(machine: Machine, document: Mapping[str, Any]) -> tuple[str, ...]:
    """The values of the letters of a document, which the program gives beside its equations: by
    /. g -> 9.81, or to an argument of the same name, args=(g, l).
    """
    known = {name: value for name, value in machine.names.items() if isinstance(value, ex.Number)}
    known |= machine.stated.aside
    letters = [name for name in document.get("parameters", ()) if name in known]
    values = (known[name].value for name in letters)
    short = frozenset(value for value in values if 10**_MOST_DIGITS % value.denominator == 0)
    with printing.with_decimals(short):
        return tuple(f"{name} = {printing.to_text(known[name])}" for name in letters)


_METHODS = frozenset(("LagrangesMethod", "KanesMethod"))
_SOLVERS_OF_MATHEMATICA = frozenset((
    "NDSolve", "NDSolveValue", "DSolve", "DSolveValue", "ParametricNDSolve",
    "ParametricNDSolveValue",
))  # fmt: skip


def _run_methods(machine: Machine, body: Sequence[nd.Node]) -> None:
    """Run the functions that a program defines and does not call, if they give a system with its
    forces, def lmethod(): LagrangesMethod(L, [q], forcelist=...), or solve equations, f[a_] :=
    NDSolve[...].
    """
    of_mathematica = machine.dialect.name == "Mathematica"
    wanted = _SOLVERS_OF_MATHEMATICA if of_mathematica else _METHODS
    for function in (one for one in body if isinstance(one, nd.Function) and one.name):
        inside = _words_in(function.body) | {
            node.name for node in _walk_all(function.body) if isinstance(node, nd.Member)
        }
        if not inside & wanted or function.name in _called(body):
            continue
        if function.parameters and not of_mathematica:
            raise nd.NotRead("a function that is not called", function.at)
        given = {name: machine.symbol(name, function.at) for name in function.parameters}
        with machine.inside({**given}, machine.names):
            machine.run(function.body)
            unread = machine.names.get("<unread>")
        if unread is not None:
            machine.names["<unread>"] = unread


def _run_alone(machine: Machine, body: Sequence[nd.Node]) -> None:
    """Run the statements of the only function of a program that has nothing else, def derive(): with
    a Lagrangian in it.
    """
    match [*body]:
        case [nd.Function(parameters=(), body=inside)] if {*set_in(inside)} & {*_LAGRANGIANS}:
            machine.run([one for one in inside if not isinstance(one, nd.Return)])


def _called(body: Sequence[nd.Node]) -> set[str]:
    """The functions that statements call by their names."""
    return {
        node.function.text
        for node in _walk_all(body)
        if isinstance(node, nd.Call) and isinstance(node.function, nd.Name)
    }


def _is_time(word: str, body: Sequence[nd.Node]) -> bool:
    """Whether names are functions of this name, or derivatives by it, or a function's state is at
    it.
    """
    for node in _walk_all(body):
        if isinstance(node, nd.Function) and word in node.parameters:
            place = node.parameters.index(word)
            return place == 0 or (place, len(node.parameters)) in ((1, 2), (3, 4))
        if isinstance(node, nd.Call):
            names = [*map(_name_of, node.arguments)]
            function = node.function
            called = function.name if isinstance(function, nd.Member) else ""
            called = function.text if isinstance(function, nd.Name) else called
            by = called.lower().lstrip("'") in ("diff", "d", "derivative")
            if (names == [word] and called not in nm.FUNCTIONS) or (by and word in names):
                return True
    return False


def _other_times(body: Sequence[nd.Node]) -> list[str]:
    """The x of a program whose functions are differentiated by x alone: syms y(x) of MATLAB beside
    diff(y, x), and y(x) beside a second derivative by x.
    """
    functions: set[str] = set()
    by: set[str] = set()
    inside: set[str] = set()
    twice: set[str] = set()
    for node in _walk_all(body):
        match node:
            case nd.Assign(
                target=nd.Name(text=name),
                value=nd.Call(
                    function=nd.Name(text="Function"), arguments=[nd.Constant(value=word)]
                ),
            ) if name == word:
                functions.add(name)
            case nd.Call(
                function=nd.Name(text="diff"), arguments=[nd.Name(text=name), nd.Name(text=one), *_]
            ):
                by |= {one} if name in functions else set()
        if isinstance(node, nd.Call):
            inside |= {*_argument_of_function(node)}
            twice |= {*_variable_of_second(node)}
    if len(by) == 1 and not by & functions:
        return [*by]
    both = inside & twice
    return [*both] if len(both) == len(twice) == 1 and not both & functions else []


def _argument_of_function(call: nd.Call) -> list[str]:
    """x of y(x), where y is no known function, and of Function('y')(x)."""
    made = isinstance(call.function, nd.Call)
    named = isinstance(call.function, nd.Name) and call.function.text.lower() not in nm.FUNCTIONS
    primed = isinstance(call.function, nd.Primed)
    match call.arguments:
        case [nd.Name(text=text)] if made or named or primed:
            return [text]
    return []


def _variable_of_second(call: nd.Call) -> list[str]:
    """x of diff(y(x), x, x), y(x).diff(x, 2), D[y[x], {x, 2}], y''[x], (D@@2)(y)(x), and
    euler_equations(L, y(x), x).
    """
    function, given = call.function, [*call.arguments]
    operator = function.function if isinstance(function, nd.Call) else None
    iterated = isinstance(operator, nd.Call) and (
        _name_of(operator.function) == "<iterated>"
        or (_name_of(operator.function) == "Derivative" and _is_two(operator.arguments))
    )
    twice = isinstance(function, nd.Primed) and function.order == 2
    if (twice or iterated) and len(given) == 1:
        return [given[0].text] if isinstance(given[0], nd.Name) else []
    word = function.text if isinstance(function, nd.Name) else ""
    word = function.name if isinstance(function, nd.Member) else word
    if word in ("euler_equations", "EulerEquations") and len(given) == 3:
        return [given[2].text] if isinstance(given[2], nd.Name) else []
    if word.lstrip("'").lower() not in ("diff", "d", "derivative"):
        return []
    if isinstance(function, nd.Name) or _is_module(function):
        given = given[1:]
    match given:
        case [nd.Name(text=one), nd.Name(text=other)] if one == other:
            return [one]
        case [nd.Name(text=one), nd.Constant(value=Fraction() as times)] if times == 2:
            return [one]
        case [nd.Items(items=[nd.Name(text=one), nd.Constant(value=Fraction() as times)])]:
            return [one] if times == 2 else []
        case [nd.Binary(sign="$", left=nd.Name(text=one), right=nd.Constant(value=times))]:
            return [one] if times == 2 else []
    return []


def _is_two(given: Sequence[nd.Node]) -> bool:
    return len(given) == 1 and isinstance(given[0], nd.Constant) and given[0].value == 2


def _is_module(function: nd.Node) -> bool:
    """Whether this is the sp.diff of a module."""
    return isinstance(function, nd.Member) and _name_of(function.base) in (
        "sp",
        "sympy",
        "sym",
        "smp",
    )


def _name_of(node: nd.Node) -> str:
    """The name that this is, or that the Symbol('tau') of SymPy makes; "" for others."""
    match node:
        case nd.Name(text=text):
            return text
        case nd.Call(arguments=[nd.Constant(value=str(text))]):
            return text
        case _:
            return ""


def _system_of(machine: Machine, body: Sequence[nd.Node]) -> dict[str, Any]:
    unread = machine.names.get("<unread>")
    if isinstance(unread, nd.NotRead):
        raise unread
    if machine.dialect.name == "Modelica":
        return _of_equations(machine, _without_algebra(machine, _of_model(machine)))
    if machine.stated.lagrangians:
        return _of_lagrangian(machine, *machine.stated.lagrangians[-1])
    if machine.stated.solved:
        return _of_solved(machine, machine.stated.solved)
    found = _named_lagrangian(machine)
    if found is not None:
        return found
    if machine.stated.rates:
        return _of_pairs(machine.stated.rates)
    if machine.dialect.name == "Julia" and (zero := _of_toolkit(machine)):
        return _of_equations(machine, _without_defined(machine, zero))
    equations = _stated_equations(machine) or _named_residuals(machine)
    if equations:
        algebra = _algebraic_equations(machine)
        zero = [one.difference for one in (*equations, *algebra)]
        return _of_equations(machine, _without_defined(machine, zero) if algebra else equations)
    pairs = _named_pairs(machine, body)
    return _of_pairs(pairs) if pairs else _of_rates(machine, body)


def _walk_all(body: Iterable[nd.Node]) -> list[nd.Node]:
    return [node for one in body for node in walk(one)]


# -- a Lagrangian


def _with_later_values(machine: Machine, tree: ex.Expression) -> ex.Expression:
    """The names that Maple and Mathematica give a formula after they were used."""
    if machine.dialect.name not in ("Maple", "Mathematica"):
        return tree
    for _ in range(10):
        table: dict[ex.Expression, ex.Expression] = {}
        for node in ex.walk(tree):
            held = machine.names.get(node.name) if isinstance(node, ex.Symbol) else None
            if isinstance(held, nd.NotRead):
                raise held
            if isinstance(held, vs.TREES) and held != node:
                table[node] = held
        if not table:
            return tree
        tree = ex.substitute(tree, table)
    raise nd.NotRead("names that are defined by each other")


def _named_lagrangian(machine: Machine) -> dict[str, Any] | None:
    """The L of a program; Trap where it has forces that no method takes."""
    given = {
        name: value
        for name, value in machine.names.items()
        if name in _LAGRANGIANS or (name.startswith("L_") and isinstance(value, vs.TREES))
    }
    for name in given:
        if isinstance(given[name], nd.NotRead) and name != "l":
            raise given[name]
    trees = {name: value for name, value in given.items() if isinstance(value, vs.TREES)}
    moving = [tree for tree in trees.values() if ex.has(tree, ex.Velocity)]
    if not moving and (named := _placeholders(machine, [*trees.values()])):
        tree, names = named
        return _of_lagrangian(machine, tree, names, None)
    if len(set(moving)) != 1:
        return None
    if any(map(frames.holds_loads, machine.names.values())):
        raise nd.Trap("a force that no method takes")
    tree = moving[0]
    names = [name for name in machine.moving if _moves(name, tree)]
    if machine.dialect.name in ("Python", "Sage", "MATLAB"):  # u = dynamicsymbols('u') may be given
        names = [
            name
            for name in names
            if ex.holds(tree, ex.Velocity(name)) or name.startswith(_MULTIPLIERS)
        ]
    return _of_lagrangian(machine, tree, names, [ex.ZERO] * len(names))


def _of_solved(machine: Machine, zero: Mapping[str, ex.Expression]) -> dict[str, Any]:
    """The equations that a program solves for accelerations, or L if they are those of L."""
    _refuse_constraints(machine)
    for name in zero:
        machine.mover(name)
    given = [machine.names[name] for name in _LAGRANGIANS if name in machine.names]
    named = _placeholders(machine, [value for value in given if isinstance(value, vs.TREES)])
    if named is not None and {*named[1]} == {*zero}:
        residuals = [calls.equation_of(machine, named[0], name) for name in zero]
        if all(any(_is_multiple(tree, own) for own in residuals) for tree in zero.values()):
            text = printing.to_text(named[0])
            return {**_declared([named[0]], [*zero]), "lagrangian": text}
    return _of_equations(machine, [vs.Equation(tree, ex.ZERO) for tree in zero.values()], [*zero])


def _moves(name: str, tree: ex.Expression) -> bool:
    return ex.holds(tree, ex.Velocity(name), ex.Symbol(name))


def _placeholders(
    machine: Machine, trees: Sequence[ex.Expression]
) -> tuple[ex.Expression, list[str]] | None:
    """L with x' for the xd of a program that differentiates by it, or that has xdd, too."""
    for tree in trees:
        words = {node.name for node in ex.walk(tree) if isinstance(node, ex.Symbol)}
        known = words | machine.stated.declared | machine.stated.by
        rates: dict[str, str] = {}
        for mark, second in calls.MARKS:
            for base in sorted(known):
                word = mark.format(base)
                certain = word in machine.stated.by or second.format(base) in known
                certain |= mark in _RATES and _is_rate(machine, tree, base, word)
                if word in words and word != base and certain and base not in rates:
                    rates[base] = word
        taken = [*rates.values()]
        if not rates or len({*taken}) != len(taken) or {*taken} & {*rates}:
            continue
        table: dict[ex.Expression, ex.Expression] = {
            ex.Symbol(word): ex.Velocity(base) for base, word in rates.items()
        }
        order = [name for name in machine.names if name in rates]
        names = [*order, *(name for name in rates if name not in order)]
        return ex.substitute(tree, table), names
    return None


def _is_rate(machine: Machine, tree: ex.Expression, base: str, word: str) -> bool:
    """Whether x and dx, or x and xdot, are declared, and L is of second degree in the latter."""
    rate = ex.Symbol(word)
    slope = vs.partial(vs.partial(tree, rate), rate)
    free = not ex.holds(slope, rate) and collecting.collect(slope) != ex.ZERO
    return {base, word} <= machine.stated.declared and free


def _of_lagrangian(
    machine: Machine,
    lagrangian: ex.Expression,
    names: Sequence[str],
    forces: Sequence[ex.Expression] | None,
) -> dict[str, Any]:
    """L, or its equations where forces act; L has to give the equations that the program states.

    `forces` are None where placeholders stand for the rates, so that the equations do not move.
    """
    _refuse_constraints(machine)
    lagrangian = _with_later_values(machine, lagrangian)
    if not names or not ex.has(lagrangian, ex.Velocity):
        raise nd.NotRead("a Lagrangian without velocities")
    if ex.has(lagrangian, ex.Acceleration):
        raise nd.NotRead("a Lagrangian with accelerations")
    residuals = []
    if forces is not None:
        for name in names:
            machine.mover(name)
        residuals = [
            calls.equation_of(machine, lagrangian, name) - force
            for name, force in zip(names, forces, strict=True)
        ]
    if any(force != ex.ZERO for force in forces or ()):
        return _of_equations(machine, [vs.Equation(one, ex.ZERO) for one in residuals], names)
    told, others = _forced(machine, residuals, names) if forces is not None else _Forced(names, [])
    if others:
        return _of_equations(machine, others, told)
    if forces is not None:
        _refuse_unused_forces(machine)
    still = {
        node.name
        for node in ex.walk(lagrangian)
        if isinstance(node, ex.Symbol) and node.name in {*machine.moving} - {*names}
    }
    multiplied = _with_constraints(machine, lagrangian, names)
    if multiplied is not None:
        return multiplied
    lagrangian = ex.substitute(lagrangian, _given_motions(machine, still))
    functions = {"functions": {name: ["t"] for name in sorted(still)}} if still else {}
    made = {**_declared([lagrangian], names), **functions}
    return {**made, "lagrangian": printing.to_text(lagrangian)}


def _with_constraints(
    machine: Machine, lagrangian: ex.Expression, names: Sequence[str]
) -> dict[str, Any] | None:
    """L and c = 0 for L + lambda*c, where lambda is a coordinate of the program whose rate L does not
    have; None without one, NotRead where c has rates or another multiplier.
    """
    still = [name for name in names if not ex.holds(lagrangian, ex.Velocity(name))]
    if not still:
        return None
    multipliers = [ex.Symbol(name) for name in still]
    slopes = [collecting.collect(vs.partial(lagrangian, one)) for one in multipliers]
    if any(ex.has(one, _MOVES) or ex.holds(one, *multipliers) or one == ex.ZERO for one in slopes):
        raise nd.Trap(f"{still[0]}, a coordinate whose velocity the Lagrangian does not have,")
    machine.stated.overrides = True
    plain = ex.substitute(lagrangian, dict.fromkeys(multipliers, ex.ZERO))
    made = _declared([plain, *slopes], [name for name in names if name not in still])
    constraints = [printing.to_text(one) for one in slopes]
    return {**made, "lagrangian": printing.to_text(plain), "constraints": constraints}


_FORCE = re.compile(r"(?:Q|F|tau|Diss|diss|force|Force|Rayleigh|rayleigh)_?\w{0,6}")


def _refuse_unused_forces(machine: Machine) -> None:
    """NotRead for a force beside L, Qx = F - b*x.diff(t), that no equation of the program has."""
    for name, value in machine.names.items():
        if name in machine.stated.read_names or not _FORCE.fullmatch(name):
            continue
        entries = vs.listed(value) if isinstance(value, list | vs.Matrix) else [value]
        trees = [one for one in entries or () if isinstance(one, vs.TREES)]
        if any(ex.has(tree, ex.Velocity) or isinstance(tree, ex.Sum) for tree in trees):
            raise nd.NotRead("a force that nothing uses")


def _refuse_constraints(machine: Machine) -> None:
    """NotRead for an equation beside L that holds coordinates and no acceleration."""
    held = [one for value in machine.names.values() for one in _equations_of(value)]
    for one in (*held, *machine.stated.equations):
        tree = one.difference
        if ex.has(tree, ex.Acceleration):
            continue
        if ex.has(tree, ex.Velocity) or any(ex.holds(tree, ex.Symbol(q)) for q in machine.moving):
            raise nd.NotRead("an equation beside the Lagrangian that may be a constraint")


class _Forced(NamedTuple):
    """The names that move by equations, and these; none where they are those of L."""

    names: Sequence[str]
    equations: list[vs.Equation]


def _forced(machine: Machine, residuals: Sequence[ex.Expression], names: Sequence[str]) -> _Forced:
    """The equations of the program where they are not all those of L.

    Where they are those of L with forces for some of its names alone, the others have given
    motions: l(t) of a crane.
    """
    stated = [*_stated_equations(machine)]
    for name, value in machine.names.items():
        if name in machine.stated.read_names or not isinstance(value, vs.TREES):
            continue
        if ex.has(value, ex.Acceleration) and not isinstance(value, ex.Acceleration):
            stated.append(vs.Equation(value, ex.ZERO))
    left: list[vs.Equation] = []
    told: set[int] = set()
    for one in stated:
        tree = one.difference
        same = [k for k, own in enumerate(residuals) if _is_multiple(tree, own)]
        told |= {*same}
        if same or _is_part(tree):
            continue
        left.append(one)
    if not left:
        return _Forced(names, [])
    kept = left + [vs.Equation(residuals[k], ex.ZERO) for k in told if len(left) < len(names)]
    if len(kept) == len(names):
        return _Forced(names, kept)
    of_left = [[k for k, own in enumerate(residuals) if _is_pushed(one, own)] for one in left]
    moved = {k for each in of_left for k in each}
    if any(len(each) != 1 for each in of_left) or len(moved | told) != len(kept):
        raise nd.NotRead("equations that are not those of the Lagrangian")
    return _Forced([names[k] for k in sorted(moved | told)], kept)


def _is_pushed(one: vs.Equation, own: ex.Expression) -> bool:
    """Whether an equation is that of L beside a force without accelerations, up to a sign."""
    differences = (collecting.collect(one.difference - own * ex.number(sign)) for sign in (1, -1))
    return any(not ex.has(tree, ex.Acceleration) for tree in differences)


def _is_multiple(tree: ex.Expression, own: ex.Expression) -> bool:
    """Whether an equation is that of L, up to a sign."""
    return any(collecting.collect(tree - own * ex.number(sign)) == ex.ZERO for sign in (1, -1))


def _is_part(tree: ex.Expression) -> bool:
    """Whether this is no equation of motion."""
    return not ex.has(tree, ex.Acceleration)


# -- equations


def _stated_equations(machine: Machine) -> list[vs.Equation]:
    """The equations with accelerations, or those of first order, that the names of a program hold."""
    found: list[vs.Equation] = []
    for value in machine.names.values():
        found += [one for one in _equations_of(value) if ex.has(one.difference, _MOVES)]
        left = value.left if isinstance(value, vs.Equation) else ex.ZERO
        if isinstance(left, ex.Symbol) and left.name not in machine.moving:
            raise nd.NotRead("a name that = gives an equation")
    found = [one for one in machine.stated.equations if ex.has(one.difference, _MOVES)] or found
    kept: list[vs.Equation] = []
    later = partial(_with_later_values, machine)
    for one in (vs.Equation(later(each.left), later(each.right)) for each in found):
        if not any(_is_multiple(one.difference, other.difference) for other in kept):
            kept.append(one)
    return kept


def _algebraic_equations(machine: Machine) -> list[vs.Equation]:
    """The equations beside those of motion that hold a name that moves, and no rate of it."""
    held = [one for value in machine.names.values() for one in _equations_of(value)]
    stated = [one for one in machine.stated.equations if ex.has(one.difference, _MOVES)]
    moving = [ex.Symbol(name) for name in machine.moving]
    return [
        one
        for one in (machine.stated.equations if stated else held)
        if not ex.has(one.difference, _MOVES) and ex.holds(one.difference, *moving)
    ]


_RESIDUAL = re.compile(r"(?:eqn?|eom|ode|de)(?:_?\d)?")


def _named_residuals(machine: Machine) -> list[vs.Equation]:
    """The equations f = 0 of a program whose eom = x.diff(t, 2) + x is an expression, or a column
    of them.
    """
    found: list[vs.Equation] = []
    for name, value in machine.names.items():
        entries = vs.listed(value) if isinstance(value, list | vs.Matrix) else [value]
        trees = [one for one in entries or () if isinstance(one, ex.Sum)]
        second = all(ex.has(one, ex.Acceleration) for one in trees)
        if _RESIDUAL.fullmatch(name) and second and len(trees) == len(entries or ()):
            found += [vs.Equation(one, ex.ZERO) for one in trees]
    return found


def _named_pairs(machine: Machine, body: Sequence[nd.Node]) -> dict[str, ex.Expression]:
    """The rates of heyoka's [(x, v), (v, -x)], if a program with its variables has one such list."""
    if not any(isinstance(one, nd.Call) and _is_of_heyoka(one) for one in _walk_all(body)):
        return {}
    found: list[dict[str, ex.Expression]] = []
    for value in machine.names.values():
        pairs = [vs.listed(one) or [] for one in vs.listed(value) or []]
        names = [
            pair[0].name for pair in pairs if len(pair) == 2 and isinstance(pair[0], ex.Symbol)
        ]
        trees = [pair[1] for pair in pairs if len(pair) == 2 and isinstance(pair[1], vs.TREES)]
        values = all(isinstance(tree, ex.Number) for tree in trees)
        if len(pairs) > 1 and len({*names}) == len(trees) == len(pairs) and not values:
            found.append(dict(zip(names, trees, strict=True)))
    return found[0] if len(found) == 1 else {} if found else _named_rates(machine)


def _named_rates(machine: Machine) -> dict[str, ex.Expression]:
    """The rates that are called dxdt, or dx, for each variable x of heyoka's make_vars."""
    states = [
        value.name
        for name, value in machine.names.items()
        if isinstance(value, ex.Symbol) and machine.clean(name) == value.name
    ]
    for mark in ("d{}dt", "d{}_dt", "{}dot", "{}_dot", "d{}"):
        held = {name: machine.names.get(mark.format(name)) for name in states}
        rates = {name: one for name, one in held.items() if isinstance(one, vs.TREES)}
        used = {
            one.name
            for tree in rates.values()
            for one in ex.walk(tree)
            if isinstance(one, ex.Symbol)
        }
        if len(rates) > 1 and not used & {*states} - {*rates}:
            return rates
    return {}


def _is_of_heyoka(one: nd.Call) -> bool:
    called = one.function
    return "make_vars" in (
        called.name if isinstance(called, nd.Member) else "",
        called.text if isinstance(called, nd.Name) else "",
    )


def _equations_of(value: Value) -> list[vs.Equation]:
    if isinstance(value, vs.Equation):
        return [value]
    if isinstance(value, (*vs.TREES, vs.Array)):
        return []
    return [one for each in vs.listed(value) or [] for one in _equations_of(each)]


def _of_model(machine: Machine) -> list[ex.Expression]:
    """What is zero by the equations of a model of Modelica."""
    trees: list[ex.Expression] = []
    for name, value in machine.names.items():
        if name.startswith(modelica.EQUATION):
            if isinstance(value, nd.NotRead):
                raise value
            trees += [one.difference for one in _equations_of(value)]
    return trees


def _of_toolkit(machine: Machine) -> list[ex.Expression]:
    """What is zero by the equations of a program of ModelingToolkit, algebraic ones too."""
    held = [one for value in machine.names.values() for one in _equations_of(value)]
    stated = machine.stated.equations or held
    return [*dict.fromkeys(one.difference for one in stated)]


def _without_algebra(machine: Machine, trees: list[ex.Expression]) -> list[vs.Equation]:
    """The equations of a model without the variables that it does not differentiate."""
    return _eliminated(machine, trees, _still(machine, trees))


def _without_defined(machine: Machine, trees: list[ex.Expression]) -> list[vs.Equation]:
    """The same for a program that may leave inputs open, u(t): as many variables are eliminated as
    there are more equations than rates, those first that are alone on a side of theirs.
    """
    names = _still(machine, trees)
    more = len(trees) - (len(machine.moving) - len(names))
    held = [one for value in machine.names.values() for one in _equations_of(value)]
    alone = {
        side.name
        for one in (*machine.stated.equations, *held)
        for side in (one.left, one.right)
        if isinstance(side, ex.Symbol)
    }
    order = sorted(names, key=lambda name: name not in alone)
    if not 0 <= more <= len(names) or (more < len(names) and not {*order[:more]} <= alone):
        raise nd.NotRead("as many equations as names that move are expected")
    return _eliminated(machine, trees, order[:more])


def _still(machine: Machine, trees: Sequence[ex.Expression]) -> list[str]:
    """The names that move and are not differentiated in these equations."""

    def moves(name: str) -> bool:
        rates = ex.Velocity(name), ex.Acceleration(name)
        return any(ex.holds(tree, *rates) for tree in trees)

    return [name for name in machine.moving if not moves(name)]


def _eliminated(
    machine: Machine, trees: list[ex.Expression], names: Sequence[str]
) -> list[vs.Equation]:
    """The equations without these names, each of which one of them is solved for."""
    for name in names:
        symbol = ex.Symbol(name)
        held = [tree for tree in trees if ex.holds(tree, symbol)]
        slopes = [vs.partial(tree, symbol) for tree in held]
        moving = [ex.Symbol(other) for other in machine.moving]
        plain = [
            k
            for k, slope in enumerate(slopes)
            if not ex.has(slope, _MOVES) and not ex.holds(slope, *moving, ex.TIME)
        ]
        if not held:
            continue
        if not plain:
            raise nd.NotRead("an algebraic equation that is not solved")
        chosen = held[plain[0]]
        value = -ex.substitute(chosen, {symbol: ex.ZERO}) / slopes[plain[0]]
        trees = [ex.substitute(tree, {symbol: value}) for tree in trees if tree is not chosen]
    return [vs.Equation(tree, ex.ZERO) for tree in trees]


def _of_equations(
    machine: Machine, equations: Sequence[vs.Equation], names: Sequence[str] = ()
) -> dict[str, Any]:
    trees = [one.difference for one in equations]
    moving = [
        name
        for name in machine.moving
        if any(ex.holds(tree, ex.Velocity(name), ex.Acceleration(name)) for tree in trees)
    ]
    second = [name for name in moving if any(ex.holds(t, ex.Acceleration(name)) for t in trees)]
    told = [*names] or second
    if machine.dialect.name != "Modelica" and len(told) == len(trees) < len(moving):
        moving = [name for name in moving if name in told]  # the others have given motions
        second = [name for name in second if name in told]
    others = {name: (ex.Symbol(name), ex.Velocity(name)) for name in {*machine.moving} - {*moving}}
    still = {name for name, each in others.items() if any(ex.holds(tree, *each) for tree in trees)}
    if still and machine.dialect.name == "Modelica":
        raise nd.NotRead(f"{min(still)}(t), a function of the time that is not given")
    if second and len(trees) == len(second) == len(moving):
        given = _given_motions(machine, still)
        trees = [ex.substitute(tree, given) for tree in trees]
        sides = [
            [printing.to_text(ex.substitute(side, given)) for side in (one.left, one.right)]
            for one in equations
        ]
        made = _declared(trees, [name for name in names if name in moving] or moving)
        functions = {"functions": {name: ["t"] for name in sorted(still)}} if still else {}
        return {**made, **functions, "equations": [" = ".join(each) for each in sides]}
    if not second and len(trees) == len(moving):
        given = _given_motions(machine, still)
        rates = _solved_rates([ex.substitute(tree, given) for tree in trees], moving)
        made = _of_pairs(rates)
        return {**made, "functions": {name: ["t"] for name in sorted(still)}} if still else made
    raise nd.NotRead("as many equations as coordinates are expected")


def _given_motions(machine: Machine, names: Collection[str]) -> dict[ex.Expression, ex.Expression]:
    """u(t) for the u = dynamicsymbols('u') of a program that gives it no equation: the lines would make
    a constant of it.
    """
    machine.stated.overrides |= bool(names)
    made: dict[ex.Expression, ex.Expression] = {}
    for name in names:
        rates: list[ex.Expression] = [ex.Symbol(name), ex.Velocity(name), ex.Acceleration(name)]
        made |= {one: ex.Arbitrary(name, (ex.TIME,), (k,)) for k, one in enumerate(rates)}
    return made


def _solved_rates(
    trees: Sequence[ex.Expression], moving: Sequence[str]
) -> dict[str, ex.Expression]:
    """x' of each equation that is linear in one velocity alone, or in one beside those of others."""
    rates: dict[str, ex.Expression] = {}
    left = [*trees]
    while left:
        table: dict[ex.Expression, ex.Expression] = {
            ex.Velocity(name): rate for name, rate in rates.items()
        }
        left = [ex.substitute(tree, table) for tree in left]
        named = [[name for name in moving if ex.holds(tree, ex.Velocity(name))] for tree in left]
        place = next((k for k, names in enumerate(named) if len(names) == 1), None)
        if place is None:
            raise nd.NotRead("equations of first order that are not solved")
        tree, velocity = left.pop(place), ex.Velocity(named[place][0])
        slope = vs.partial(tree, velocity)
        if ex.holds(slope, velocity) or collecting.collect(slope) == ex.ZERO:
            raise nd.NotRead("equations of first order that are not solved")
        rates[velocity.coordinate] = -ex.substitute(tree, {velocity: ex.ZERO}) / slope
    return {name: rates[name] for name in moving if name in rates}


def _declared(trees: Sequence[ex.Expression], names: Sequence[str]) -> dict[str, Any]:
    symbols = dict.fromkeys(
        node.name for tree in trees for node in ex.walk(tree) if isinstance(node, ex.Symbol)
    )
    parameters = [
        name for name in symbols if name not in names and ex.Symbol(name) not in (ex.TIME, ex.PI)
    ]
    return {"coordinates": [*names], "parameters": parameters}


# -- rates


def _of_pairs(rates: dict[str, ex.Expression]) -> dict[str, Any]:
    """x'' = f of pairs x' = h(v), v' = f with h linear in v."""
    left = dict(rates)
    pairs: dict[str, str] = {}
    for name, rate in rates.items():
        others = [
            other
            for other in rates
            if other != name
            and ex.holds(rate, ex.Symbol(other))
            and _is_free(vs.partial(rate, ex.Symbol(other)), rates, name)
        ]
        taken = {*pairs, *pairs.values()}
        if (
            name not in taken
            and len(others) == 1
            and others[0] not in taken
            and _is_speed(rates, name, others[0])
        ):
            pairs[name] = others[0]
    if 2 * len(pairs) != len(rates) or {*pairs} & {*pairs.values()}:
        raise nd.NotRead("rates that are no pairs x' = v, v' = f")
    table: dict[ex.Expression, ex.Expression] = {}
    for name, speed in pairs.items():
        slope = vs.partial(rates[name], ex.Symbol(speed))
        rest = ex.substitute(rates[name], {ex.Symbol(speed): ex.ZERO})
        table[ex.Symbol(speed)] = (ex.Velocity(name) - rest) / slope
    speeds = {*pairs.values()}
    for name in pairs:
        parts = {node.name for node in ex.walk(rates[name]) if isinstance(node, ex.Symbol)}
        if parts & speeds != {pairs[name]}:
            raise nd.NotRead("rates that are no pairs x' = v, v' = f")
    equations, trees = [], []
    for name in pairs:
        force = vs.partial(rates[name], ex.TIME)
        for other, rate in left.items():
            force = force + vs.partial(rates[name], ex.Symbol(other)) * rate
        force = ex.substitute(force, table)
        trees.append(force)
        equations.append(f"{name}'' = {printing.to_text(force)}")
    return {**_declared(trees, [*pairs]), "equations": equations}


def _is_free(slope: ex.Expression, rates: dict[str, ex.Expression], name: str) -> bool:
    return slope != ex.ZERO and not any(ex.holds(slope, ex.Symbol(other)) for other in rates)


def _is_speed(rates: dict[str, ex.Expression], name: str, speed: str) -> bool:
    """Whether x' = v, and not v' = -x of the same pair, is the one to take: v is not x' elsewhere."""
    plain = rates[name] == ex.Symbol(speed)
    return plain or rates.get(speed) != ex.Symbol(name)


def _of_rates(machine: Machine, body: Sequence[nd.Node]) -> dict[str, Any]:
    """The rates that one function of the program returns, or that a loop adds."""
    functions = [node for node in _walk_all(body) if isinstance(node, nd.Function)]
    posed = _posed(machine, body, functions)
    if posed is not None:
        return _of_pairs(posed)
    passed = _integrated(body)
    called = {
        node.value: node.target.text
        for node in _walk_all(body)
        if isinstance(node, nd.Assign)
        and isinstance(node.target, nd.Name)
        and isinstance(node.value, nd.Function)
    }  # f = lambda t, y: g(t, y, 5)
    chosen = [one for one in functions if called.get(one, one.name) in passed] or functions
    given_more = _given_more(body)
    found: list[dict[str, ex.Expression]] = []
    reason: nd.NotRead | None = None
    for function in chosen:
        try:
            rates = _rates_of_function(machine, function, given_more)
        except nd.NotRead as error:
            reason = error if reason is None and _gives_a_list(function) else reason
            continue
        steps_on = rates and any(ex.holds(rate, vs.STEP) for rate in rates.values())
        if rates and rates not in found and not steps_on:
            found.append(rates)
    moved, trap = _moved(machine, functions, body)
    if reason is not None and (found or len(moved) != 1):
        raise reason  # the other one may be what is meant
    if not found:
        found = moved or _accelerations(machine, functions)
        if trap is not None and not found:
            raise trap
    elif len(found) == len(moved) == 1 and not _is_same(found[0], moved[0]):
        if not {one.name for one in chosen} & _called_in_loops(machine, functions):
            raise nd.NotRead("a function and a loop with other rates")
        found = moved  # what is run, and not what a function of the same shape returns
    apart = all(one.name and one.name not in _called(body) for one in chosen)
    if len(found) > 1 and apart:  # its lines, read together, would be those of the last one
        raise nd.Trap("the choice between functions with other rates", chosen[-1].at)
    if len(found) != 1:
        raise nd.NotRead("a Lagrangian, equations of motion, or the rates of one function")
    return _of_pairs(found[0])


def _posed(
    machine: Machine, body: Sequence[nd.Node], functions: Sequence[nd.Function]
) -> dict[str, ex.Expression] | None:
    """The rates of SecondOrderODEProblem(f, v0, x0, ...) and of HamiltonianProblem(H, p0, q0, ...) of
    Julia; NotRead for two of them.
    """
    found: list[dict[str, ex.Expression]] = []
    for node in _walk_all(body):
        called = node.function if isinstance(node, nd.Call) and node.arguments else None
        name = called.name if isinstance(called, nd.Member) else ""
        name = called.text if isinstance(called, nd.Name) else name
        if name not in ("SecondOrderODEProblem", "HamiltonianProblem"):
            continue
        assert isinstance(node, nd.Call)
        first, *others = node.arguments
        word = first.text if isinstance(first, nd.Name) else ""
        posed = [one for one in functions if one is first or (word and one.name == word)]
        if len(posed) != 1:
            raise nd.NotRead("a problem of a function that is not given", node.at)
        rates = (
            _of_second_order(machine, posed[0], others)
            if name == "SecondOrderODEProblem"
            else _of_hamiltonian(machine, posed[0])
        )
        if rates not in found:
            found.append(rates)
    if len(found) > 1:
        raise nd.NotRead("two problems")
    return found[0] if found else None


def _of_second_order(
    machine: Machine, function: nd.Function, initial: Sequence[nd.Node]
) -> dict[str, ex.Expression]:
    """x' = v, v' = f(v, x, p, t), of f!(dv, v, x, p, t), or f(v, x, p, t)."""
    names = function.parameters
    if len(names) not in (4, 5):
        raise nd.NotRead("a function with another number of arguments", function.at)
    set_one = names[0] if len(names) == 5 else ""
    speed, place = names[-4], names[-3]
    arrays = {name: vs.Array(machine.clean(name), machine.dialect.first) for name in names[-4:]}
    given: dict[str, Value] = {**arrays}
    count = _length(machine, initial[1:2]) or _length(machine, initial[:1])
    for name in (speed, place) if count else ():
        array = arrays[name]
        given[f"<{name}>"] = array
        given[name] = [array.entry(array.first + k) for k in range(count)]
    if set_one:
        given[set_one] = vs.Filled(first=machine.dialect.first)
    with machine.inside(given, machine.names):
        found = machine.run(function.body)
        if set_one:
            found = machine.named(nd.Name(function.at, set_one))
    entries = vs.listed(found)
    if isinstance(found, vs.Filled) and found.places() != [*range(1, len(found.places()) + 1)]:
        raise nd.NotRead("rates with a gap between them", function.at)
    if entries == []:
        raise nd.NotRead("rates that are not set", function.at)
    machine.stated.overrides = True
    table: dict[ex.Expression, ex.Expression] = {}
    if entries is None or (len(entries) == 1 and not arrays[place].entries):
        pairs = [(ex.Symbol(arrays[place].name), ex.Symbol(arrays[speed].name))]
        trees = [vs.scalar(found if entries is None else entries[0])]
    else:
        first = machine.dialect.first
        if arrays[place].is_number or arrays[speed].is_number:
            raise nd.NotRead("a vector whose length is not given", function.at)
        places = range(first, first + len(entries))
        pairs = [(arrays[place].entry(k), arrays[speed].entry(k)) for k in places]
        if max((*arrays[place].entries, *arrays[speed].entries)) > places[-1]:
            raise nd.NotRead("rates of a part of the state", function.at)
        trees = [vs.scalar(one) for one in entries]
    for array in arrays.values():
        for k, word in array.named.items():
            called = ex.Symbol(machine.clean(word))
            if called not in table.values():
                table[array.entry(k)] = called
    rates: dict[str, ex.Expression] = {}
    for (where, how), tree in zip(pairs, trees, strict=True):
        q, v = (ex.substitute(one, table) for one in (where, how))
        rates |= {printing.to_text(q): v, printing.to_text(v): ex.substitute(tree, table)}
    if len(rates) != 2 * len(pairs):
        raise nd.NotRead("names that are used twice", function.at)
    return rates


def _length(machine: Machine, given: Sequence[nd.Node]) -> int:
    """How many entries an initial value has; 0 where it is not known."""
    try:
        entries = vs.listed(machine.value(given[0])) if given else None
    except nd.NotRead:
        return 0
    return len(entries) if entries is not None and len(entries) <= _MOST_STATES else 0


def _of_hamiltonian(machine: Machine, function: nd.Function) -> dict[str, ex.Expression]:
    """q' = dH/dp, p' = -dH/dq of H(p, q, parameters)."""
    if not 2 <= len(function.parameters) <= 4:
        raise nd.NotRead("a function with another number of arguments", function.at)
    arrays = {
        name: vs.Array(machine.clean(name), machine.dialect.first) for name in function.parameters
    }
    with machine.inside({**arrays}, machine.names):
        energy = vs.scalar(machine.run(function.body))
    machine.stated.overrides = True
    p, q = (arrays[name] for name in function.parameters[:2])
    if p.is_number != q.is_number and (p.entries or q.entries):
        raise nd.NotRead("a vector whose length is not given", function.at)
    places = sorted({*p.entries} | {*q.entries})
    pairs = [(p.entry(k), q.entry(k)) for k in places] or [(ex.Symbol(p.name), ex.Symbol(q.name))]
    rates: dict[str, ex.Expression] = {}
    for momentum, place in pairs:
        rates[printing.to_text(place)] = vs.partial(energy, momentum)
        rates[printing.to_text(momentum)] = -vs.partial(energy, place)
    return rates


def _moved(
    machine: Machine, functions: Sequence[nd.Function], body: Sequence[nd.Node]
) -> tuple[list[dict[str, ex.Expression]], nd.NotRead | None]:
    """What the loops of the program, or functions that move names, give as rates."""
    found: list[dict[str, ex.Expression]] = []
    trap: nd.NotRead | None = None
    for step in [*steps.steps_in(machine, functions, body)]:
        try:
            rates = steps.rates_of(machine, step)
            rates = _without_totals(rates) if rates else None
        except nd.NotRead as error:
            trap = error if isinstance(error, nd.Trap) and not step.is_plain else trap
            continue
        if rates and rates not in found:
            found.append(rates)
    return found, trap


_ACCELERATION = re.compile(
    r"(?:get|compute|calc(?:ulate)?)?_?acc?(?:el(?:eration)?)?|a|d_?v(?:_?d_?t)?|d_?2_?x_?d_?t_?2"
    r"|(?:x|theta|th|phi)_?d_?dot|dd_?(?:x|theta|th|phi)|v_?dot",
    re.IGNORECASE,
)
# A function of these names is an acceleration only where it is given t, x, and v.
_OF_ALL = ("f", "F", "g", "func", "fun", "rhs", "deriv", "force_per_mass")


def _accelerations(
    machine: Machine, functions: Sequence[nd.Function]
) -> list[dict[str, ex.Expression]]:
    """x' = v, v' = f of a single function acceleration(x, v, t) or f(t, x, v) that returns a number,
    also beside one of the same arguments that returns v.
    """
    others = [[name for name in one.parameters if name not in _TIMES] for one in functions]
    if len(functions) not in (1, 2) or any(len({*one}) != 2 for one in others):
        return []
    if len({frozenset(one) for one in others}) != 1 or any(one.defaults for one in functions):
        return []
    numbers: list[ex.Expression] = []
    for function in functions:
        given: dict[str, Value] = {
            name: machine.symbol(name, function.at) for name in function.parameters
        }
        with machine.inside(given, machine.names):
            found = machine.run(function.body)
            if found is None and len(function.results) == 1:
                found = machine.named(nd.Name(function.at, function.results[0]))
        numbers.append(vs.scalar(found))
    symbols = {name: machine.symbol(name, functions[0].at) for name in others[0]}
    if len(functions) == 1:
        name, timed = functions[0].name, len(functions[0].parameters) > 2
        known = _ACCELERATION.fullmatch(name) or (timed and name in _OF_ALL)
        speeds = [one for one in others[0] if known and _SPEED.fullmatch(one)]
    else:  # one of them returns v
        speeds = [one for one in others[0] if symbols[one] in numbers]
    if len(speeds) != 1:
        return []
    speed = symbols[speeds[0]]
    place = next(symbols[one] for one in others[0] if one != speeds[0])
    rates = [number for number in numbers if len(functions) == 1 or number != speed]
    if len(rates) != 1:
        return []
    return [{printing.to_text(place): speed, printing.to_text(speed): rates[0]}]


def _called_in_loops(machine: Machine, functions: Sequence[nd.Function]) -> set[str]:
    bodies = {one.name: one.body for one in functions}
    found = {word for block, _ in machine.stated.loops for word in _words_in(block.body)}
    for name in [*found & {*bodies}]:
        found |= _words_in(bodies[name])
    return found


def _words_in(body: Sequence[nd.Node]) -> set[str]:
    return {word for one in body for word in _words(one)}


def _without_totals(rates: dict[str, ex.Expression]) -> dict[str, ex.Expression]:
    """The rates of pairs, without those of what a loop only adds up; NotRead for no pairs."""
    try:
        _of_pairs(rates)
    except nd.NotRead:
        states = {*map(ex.Symbol, rates)}
        kept = {
            name: rate
            for name, rate in rates.items()
            if rate in states
            or any(ex.holds(one, ex.Symbol(name)) for of, one in rates.items() if of != name)
        }
        _of_pairs(kept)
        return kept
    return rates


def _is_same(one: dict[str, ex.Expression], other: dict[str, ex.Expression]) -> bool:
    """Whether rates are the same but for the names of the state."""
    if len(one) != len(other):
        return False
    table: dict[ex.Expression, ex.Expression] = {
        ex.Symbol(new): ex.Symbol(name) for new, name in zip(other, one, strict=True)
    }
    pairs = zip(one.values(), other.values(), strict=True)
    return all(
        collecting.collect(rate - ex.substitute(moved, table)) == ex.ZERO for rate, moved in pairs
    )


def _integrated(body: Sequence[nd.Node]) -> set[str]:
    """The functions that the program passes to others, but for those that draw."""
    found: set[str] = set()
    for node in _walk_all(body):
        if isinstance(node, nd.Call) and not _words(node.function) & _DRAWING:
            given = [*node.arguments, *(part for _, part in node.keywords)]
            found |= {str(one.value) for one in given if _is_text(one)}  # lsode("f", ...)
            found |= {one.text for one in given if isinstance(one, nd.Name)}
            found |= {
                call.function.text
                for one in given
                if isinstance(one, nd.Function)
                for call in walk(one)
                if isinstance(call, nd.Call) and isinstance(call.function, nd.Name)
            }
    return found


def _is_text(node: nd.Node) -> TypeGuard[nd.Constant]:
    return isinstance(node, nd.Constant) and isinstance(node.value, str)


def _gives_a_list(function: nd.Function) -> bool:
    """Whether a function returns several entries, or sets those of an array."""
    return any(
        (isinstance(node, nd.Return) and (isinstance(node.value, nd.Items | nd.Call)))
        or (isinstance(node, nd.Assign) and isinstance(node.target, nd.Index | nd.Call))
        for node in walk(function)
    )


def _step_of(body: Sequence[nd.Node]) -> frozenset[str]:
    """The name of the step of time, which goes to 0: of a program with a loop, or with a function
    that moves names.
    """
    nodes = _walk_all(body)
    functions = [node for node in nodes if isinstance(node, nd.Function)]
    moves = any(isinstance(node, nd.Block) and node.is_loop for node in nodes)
    lines = [node for one in functions for node in one.body] if functions else body
    moves = moves or any(isinstance(node, nd.Assign) and node.sign for node in lines)
    set_ones = {*set_in(body)}
    given = {name for one in functions for name in one.parameters}
    words = {node.text for node in nodes if isinstance(node, nd.Name)} | given
    names = sorted((n for n in STEPS if n in words), key=lambda n: (n not in set_ones, n in given))
    return frozenset(names[:1] if moves else ())


def _given_more(body: Sequence[nd.Node]) -> set[str]:
    """The functions that a program passes with further arguments: args=(5,), or in
    lambda t, y: f(t, y, 5).
    """
    found: set[str] = set()
    for node in _walk_all(body):
        if isinstance(node, nd.Call):
            named = {name for name, _ in node.keywords}
            found |= {*_words(node.function)}
            if {"args", "fargs", "f_params", "**"} & named or len(node.arguments) > 3:
                found |= {one.text for one in node.arguments if isinstance(one, nd.Name)}
    return found


def _rates_of_function(
    machine: Machine, function: nd.Function, given_more: set[str]
) -> dict[str, ex.Expression] | None:
    last = function.parameters[len(function.parameters) - len(function.defaults) :]
    fixed: dict[str, Value] = {}
    if function.name in given_more:
        machine.stated.overrides |= bool(last)
    else:
        nodes = zip(last, function.defaults, strict=True)
        fixed = {name: machine.default(node) for name, node in nodes}
    # M of f(t, y, M) is the matrix M of the program: a letter would be taken for a number.
    fixed |= {
        name: value
        for name in function.parameters[2:]
        if name not in fixed and isinstance(value := machine.names.get(name), vs.Matrix)
    }
    arrays = {
        name: vs.Array(machine.clean(name, function.at), machine.dialect.first)
        for name in function.parameters
        if name not in fixed
    }
    closure = machine.stated.closures.get(function, vs.Closure(function, machine.names))
    if closure is None:
        raise nd.Trap("a function that is made more than once", function.at)
    with machine.inside({**arrays, **fixed}, closure.names):
        found = machine.run(function.body)
        filled = [
            value
            for name in (*function.parameters, *function.results)
            if isinstance(value := machine.names.get(name), vs.Filled | vs.Matrix | list)
            and value is not fixed.get(name)
        ]
        if machine.dialect.name in ("C", "Go") and isinstance(found, vs.TREES) and filled:
            found = None  # return 0, which says that all went well
        if found is None and len(filled) == 1:
            found = filled[0]
        results = (
            function.results if found is not None else (*function.results, *function.parameters)
        )
        for value in (machine.names.get(name) for name in results):
            if isinstance(value, nd.NotRead):
                raise value
        named = {name: {**array.named} for name, array in arrays.items()}
    if isinstance(found, vs.Filled):
        first = min(found.places(), default=0)
        if found.places() != [*range(first, first + len(found.places()))]:
            raise nd.NotRead("rates with a gap between them", function.at)
    entries = vs.listed(found) if found is not None else None
    if entries is None or len(entries) < 2 or len(entries) > _MOST_STATES:
        return None
    entries = [part for one in entries for part in (vs.listed(one) or [one])]
    if machine.stated.mass is not None:
        entries = vs.listed(vs.solved(machine.stated.mass, entries)) or entries
    return _with_state(machine, arrays, named, entries)


def _with_state(
    machine: Machine,
    arrays: dict[str, vs.Array],
    named: dict[str, dict[int, str]],
    entries: Sequence[Value],
) -> dict[str, ex.Expression] | None:
    """The rates by the names of the entries of the state."""
    count, first = len(entries), machine.dialect.first
    used = {name: array for name, array in arrays.items() if array.entries}
    fits = [
        name for name, array in used.items() if {*array.entries} <= {*range(first, first + count)}
    ]
    if len(fits) > 1:
        fits = [name for name in fits if arrays[name].name not in _OF_PARAMETERS]
    if len(fits) != 1:
        return None
    state, names = arrays[fits[0]], named[fits[0]]
    clock = _clock(machine, arrays, fits[0])
    symbols = [state.entry(place) for place in range(first, first + count)]
    written = [names.get(place, "") for place in range(first, first + count)]
    trees = [vs.scalar(one) for one in entries]
    others = {
        node.name for tree in trees for node in ex.walk(tree) if isinstance(node, ex.Symbol)
    } - {symbol.name for symbol in symbols}
    table: dict[ex.Expression, ex.Expression] = {clock: ex.TIME} if clock else {}
    for symbol, word in zip(symbols, written, strict=True):
        name = machine.clean(word) if word else symbol.name
        if name == "t" or name in others or ex.Symbol(name) in table.values():
            name = symbol.name
        table[symbol] = ex.Symbol(name)
    for name, array in used.items():
        if name != fits[0]:
            for place, symbol in array.entries.items():
                called = named[name].get(place)
                table[symbol] = ex.Symbol(machine.clean(called)) if called else symbol
    return {
        printing.to_text(table[symbol]): ex.substitute(tree, table)
        for symbol, tree in zip(symbols, trees, strict=True)
    }


def _clock(machine: Machine, arrays: dict[str, vs.Array], state: str) -> ex.Expression | None:
    """The argument beside the state that is the time, whatever its name is: f(x, y) of y' = f(x, y);
    NotRead where it may be a parameter.
    """
    order = [*arrays]
    if machine.dialect.time_before:
        before = arrays[order[max(order.index(state) - 1, 0)]]
        return ex.Symbol(before.name) if before.is_number and before.name != "t" else None
    first, *others = [name for name in order[:2] if name != state] or [""]
    array = arrays.get(first)
    if others or array is None or not array.is_number or array.name == "t":
        return None
    if "t" in arrays or (first not in _CLOCKS and not machine.dialect.time_first):
        return None
    return ex.Symbol(array.name)


def _words(node: nd.Node) -> set[str]:
    return {one.text for one in walk(node) if isinstance(one, nd.Name)}
