"""Functions and methods of SymPy, MATLAB, Mathematica, Maple, Maxima, and Sage that programs of mechanics
call: one row for each name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

from inverse_service.expressions import printing, tree as ex
from inverse_service.reading import names as nm
from inverse_service.reading.scripts import frames, matlab_texts, nodes as nd, values as vs
from inverse_service.reading.scripts.machine import SOLUTION, Machine
from inverse_service.reading.scripts.nodes import Initial
from inverse_service.reading.scripts.values import Value

Given = Sequence[Value]
Rule = Callable[[Machine, Given], Value]
_MOST_ROWS = 8
_MOST_NAMES = 40  # of a row such as x1:4
# Calls that leave their argument as it is.
_SAME = frozenset((
    "simplify", "expand", "factor", "collect", "trigsimp", "trigexpand", "trigreduce", "ratsimp",
    "nsimplify", "together", "cancel", "Simplify", "FullSimplify", "Expand", "Factor",
    "TrigReduce", "Together", "Collect", "combine", "doit", "sym", "vpa", "Evaluate", "array",
    "asarray", "ImmutableMatrix", "evalf", "N", "float", "Float", "formula",
    "ExpandAll", "fullratsimp", "radcan", "trigrat", "as_mutable", "copy", "to_matrix", "list",
    "tuple", "Chop", "simplifyFraction", "simplify_full", "full_simplify", "simplify_rational",
    "expand_trig", "isolate", "expand_derivatives", "collect", "scalarize", "double", "real", "evalm", "Flatten", "Array",
))  # fmt: skip
_SOLVERS = frozenset((
    "solve", "Solve", "NSolve", "nonlinsolve", "linsolve", "solveset", "dsolve", "DSolve",
    "NDSolve", "NDSolveValue", "DSolveValue", "ParametricNDSolve", "desolve", "desolve_system",
    "ode2", "odeToVectorField", "vpasolve", "fsolve", "reduceDifferentialOrder",
    "linear_eq_to_matrix", "solve_lin", "solve_for", "symbolic_linear_solve", "ODESystem", "System", "contrib_ode",
))  # fmt: skip
_FORGETTING = frozenset(("Clear", "ClearAll", "Remove", "Unset", "kill", "remvalue", "unassign"))
# What a name stands for whose value its program does not give at this place.
_UNREAD = {"<define>": "a macro", "<scope>": "a name of a block"}
# What stands for the rates of x, and for the rates of these
MARKS = (
    ("{}d", "{}dd"), ("d{}", "dd{}"), ("D{}", "DD{}"), ("{}dot", "{}ddot"), ("{}_dot", "{}_ddot"),
    ("d_{}", "dd_{}"), ("{}_d", "{}_dd"), ("{}p", "{}pp"), ("{}_p", "{}_pp"), ("{}D", "{}DD"),
    ("v{}", "a{}"), ("v_{}", "a_{}"),
)  # fmt: skip
_HEYOKA = ("hy", "heyoka")
_MOST_TIMES = 24  # of a table
_NAMED = {"Abs": "abs", "fabs": "abs", "ln": "log"} | {
    f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")
}


def value(machine: Machine, one: nd.Node) -> Value:
    if isinstance(one, nd.Member):
        return _member(machine, one)
    assert isinstance(one, nd.Call)
    function = one.function
    if isinstance(function, nd.Name):
        return _of_name(machine, one, function)
    if isinstance(function, nd.Member):
        if function.name == "solve" and _last_word(function.base) in ("linalg", "la", "LA"):
            return _linear(machine, [*map(machine.value, one.arguments)])
        base = _base(machine, function)
        if base is None:  # of a module: np.sin
            return _of_name(machine, one, nd.Name(function.at, function.name))
        return _method(machine, one, function.name, base)
    return _applied(machine, machine.value(function), [*map(machine.value, one.arguments)])


def _last_word(one: nd.Node) -> str:
    """linalg of np.linalg."""
    return one.name if isinstance(one, nd.Member) else one.text if isinstance(one, nd.Name) else ""


def _base(machine: Machine, one: nd.Member) -> Value | None:
    """The value before a dot, None for the name of a module."""
    if isinstance(one.base, nd.Name) and one.base.text not in machine.names:
        return None
    if isinstance(one.base, nd.Member) and _base(machine, one.base) is None:
        return None  # np.linalg.norm
    return machine.value(one.base)


def _member(machine: Machine, one: nd.Member) -> Value:
    base = _base(machine, one)
    if base is None:
        is_time = one.name == "_t" or (one.name == "time" and _last_word(one.base) in _HEYOKA)
        return ex.TIME if is_time else machine.named(nd.Name(one.at, one.name))
    if one.name in ("T", "transpose") and isinstance(base, vs.Matrix):
        return base.transposed()
    if isinstance(base, vs.Equation) and one.name in ("lhs", "rhs"):
        return base.left if one.name == "lhs" else base.right
    if isinstance(base, vs.Matrix) and one.name in ("mag", "mag2", "hat"):
        return RULES[one.name](machine, [base])
    if isinstance(base, vs.Matrix) and base.is_vector() and one.name in ("x", "y", "z"):
        return base.entries["xyz".index(one.name)]
    if isinstance(base, vs.Struct) and one.name in base.parts:
        return base.parts[one.name]
    if isinstance(base, vs.Array) and not base.entries:  # p.k of a set of parameters
        symbol = machine.symbol(one.name, one.at)
        if not isinstance(symbol, ex.Symbol) or symbol == ex.TIME:
            raise nd.NotRead(f"the part .{one.name}", one.at)
        return symbol
    found = frames.member(base, one.name)
    if found is None:
        raise nd.NotRead(f"the part .{one.name}", one.at)
    return found


def _of_name(machine: Machine, one: nd.Call, function: nd.Name) -> Value:
    name = function.text
    held = machine.names.get(name)
    if held is not None:
        if isinstance(held, nd.NotRead):
            raise type(held)(held.what, held.at)
        machine.stated.read_names.add(name)
        if any(isinstance(part, nd.Slice) for part in one.arguments):  # y(1:2) of MATLAB
            return machine.entry(held, one.arguments)
        arguments = [*map(machine.value, one.arguments)]
        if isinstance(held, vs.Closure):
            machine.stated.calls.setdefault(name, []).append(one.arguments)
            keywords = [(key, machine.value(node)) for key, node in one.keywords]
            return machine.call(held, arguments, keywords)
        return _applied(machine, held, arguments)
    if name in _FORGETTING:
        return _forgotten(machine, one)
    if name == "Derivative" and machine.dialect.name == "Mathematica" and len(one.arguments) == 1:
        order = one.arguments[0]
        if isinstance(order, nd.Constant) and order.is_whole:
            return _Iterated(machine.place(order))
    if name in _SOLVERS:
        if machine.dialect.name == "Julia":
            if name in ("ODESystem", "System") and one.arguments:
                machine.stated.equations += vs.equations_in(machine.value(one.arguments[0]))
            raise nd.NotRead(SOLUTION, one.at)  # solve(problem, method)
        return _solved(machine, one)
    if name in _UNREAD:
        raise nd.Trap(_UNREAD[name], one.at)
    if name == "<mapped>" or (name == "map" and machine.dialect.name == "Maple"):
        return _mapped(machine, one)
    if name == "alias" and machine.dialect.name == "Maple":
        return _alias(machine, one)
    if name in ("Table", "map") and len(one.arguments) == 2:
        return _tabled(machine, one)
    if name == "Sum" and machine.dialect.name == "Mathematica" and len(one.arguments) == 2:
        return _sum(machine, [_tabled(machine, one)])
    if name in ("Manipulate", "Animate", "DynamicModule"):
        for part in one.arguments:
            if isinstance(part, nd.Assign):
                machine.statement(part)
        raise nd.NotRead(SOLUTION, one.at)
    if name == "block" and machine.dialect.name == "Maxima":
        return _of_block(machine, one)
    if name in ("desolve_odeint", "desolve_system_rk4") or (
        name in ("plotdf", "drawdf", "rk") and machine.dialect.name == "Maxima"
    ):
        return _integrated(machine, one)
    if name == "odeset" or "mass_matrix" in dict(one.keywords):
        return _with_mass(machine, one)
    if name in ("subs", "eval", "subst", "ReplaceAll", "rhs", "lhs"):
        return _substituted_by_name(machine, name, one)
    if name in frames.MADE:
        given = [*map(machine.value, one.arguments)]
        named = {key: machine.value(node) for key, node in one.keywords}
        return frames.MADE[name](machine, given, named)
    if name == "taylor_adaptive":
        return _paired(machine, one)
    if name in ("symbols", "Symbol", "var", "make_vars", "dynamicsymbols", "Function", "function"):
        return _declared(machine, name, one)
    if name.lower() in ("sin", "cos") and (found := _of_direction(machine, name, one)) is not None:
        return found
    arguments = [*map(machine.value, one.arguments)]
    if name in ("array", "asarray") and arguments:
        return vs.as_array(arguments[0])
    if name == "sincos" and len(arguments) == 1:  # of Julia
        return [nm.call(each, [vs.scalar(arguments[0])], one.at) for each in ("sin", "cos")]
    if name in ("SVector", "MVector") and len(arguments) > 1:
        return [*arguments]
    if name in _SAME and arguments:
        return arguments[0]
    if name in RULES:
        return RULES[name](machine, arguments)
    if name in ("block", "Module", "Block", "With") and arguments:
        return arguments[-1]
    return _of_function(machine, name, arguments, one)


def _of_function(machine: Machine, name: str, arguments: Given, one: nd.Call) -> Value:
    """sin(u), or x(t)."""
    plain = name.lower() if machine.dialect.name == "Mathematica" else name
    known = (
        _NAMED.get(plain, plain) if plain != name or name[:1].islower() or name in _NAMED else ""
    )
    if machine.dialect.name == "Mathematica" and name[:1].islower():
        known = ""
    if known in nm.OWN_FUNCTIONS and arguments:
        if len(arguments) == 1:
            return vs.each(arguments[0], lambda u: nm.call(known, [u], one.at))
        return nm.call(known, [*map(vs.scalar, arguments)], one.at)
    if machine.dialect.name == "Mathematica" and len(arguments) == 1 and _is_whole(arguments[0]):
        return vs.Moving(machine.clean(f"{name}_{arguments[0].value}", one.at), True)  # x[1][t]
    if machine.dialect.free_functions and len(arguments) == 1:
        return _at_time(machine, machine.clean(name, one.at), arguments[0], one.at)
    raise nd.NotRead(f"{name}(...)", one.at)


def _at_time(machine: Machine, name: str, argument: Value, at: int, order: int = 0) -> Value:
    """x(t), or its derivative."""
    if isinstance(argument, ex.Number):
        raise Initial(f"{name} at one time", at)
    if argument != ex.TIME:
        raise nd.NotRead(f"{name}(...) of something other than the time", at)
    return machine.in_time(machine.mover(name, at), order)


def _applied(machine: Machine, function: Value, arguments: Given) -> Value:
    match function:
        case vs.Closure():
            return machine.call(function, arguments)
        case _Iterated(times=times) if len(arguments) == 1:
            match arguments[0]:
                case vs.Derived(of=of, order=order):
                    return vs.Derived(of, order + times)
                case one:
                    return vs.Derived(one, times)
        case vs.Moving(name=name) if len(arguments) == 1:
            return _at_time(machine, name, arguments[0], 0)
        case ex.Symbol(name=name) if len(arguments) == 1:
            if arguments[0] == ex.TIME or isinstance(arguments[0], ex.Number):
                return _at_time(machine, name, arguments[0], 0)
        case vs.Derived(of=of, order=order) if len(arguments) == 1:
            return _derived(machine, of, order, arguments[0])
        case vs.Formula(value=value, names=names) if len(names) == len(arguments):
            table = dict(zip(names, map(vs.scalar, arguments), strict=True))
            return vs.each(value, lambda part: ex.substitute(part, table))
        case vs.Operator(by=by, times=times) if len(arguments) == 1:
            return _by(machine, arguments[0], by, times)
    if isinstance(function, ex.Velocity | ex.Acceleration):
        if arguments == [ex.TIME]:
            return function
        if len(arguments) == 1 and isinstance(arguments[0], ex.Number):
            raise Initial("a rate at one time")
    if (
        isinstance(function, vs.TREES)
        and arguments == [ex.TIME]
        and machine.dialect.name == "MATLAB"
    ):
        return function  # f(t) of a symbolic function f
    entries = vs.listed(function)
    if isinstance(function, vs.Array | vs.Filled | vs.Matrix) or entries is not None:
        numbers = [nd.Constant(0, number.value) for number in arguments if _is_whole(number)]
        if len(numbers) == len(arguments):
            return machine.entry(function, numbers)
    raise nd.NotRead("a call of something that is no function")


def _of_direction(machine: Machine, name: str, one: nd.Call) -> Value | None:
    """y/sqrt(x^2 + y^2) for sin(atan2(y, x)), x/sqrt(x^2 + y^2) for its cosine, which have no jump."""
    match one.arguments:
        case [nd.Call(arguments=[first, second]) as inner] if _last_word(inner.function) in (
            "atan2",
            "arctan2",
        ):
            y, x = (vs.scalar(machine.value(part)) for part in (first, second))
            chosen = y if name.lower() == "sin" else x
            return chosen / ex.square_root(x**2 + y**2)
    return None


def _is_whole(number: Value) -> bool:
    return isinstance(number, ex.Number) and number.value.denominator == 1


def _derived(machine: Machine, of: Value, order: int, argument: Value) -> Value:
    """f'(argument)."""
    if isinstance(of, vs.Moving | ex.Symbol):
        return _at_time(machine, of.name, argument, 0, order)
    if isinstance(of, vs.Closure):
        if argument == ex.TIME:
            return machine.in_time(machine.call(of, [argument]), order)
        variable = ex.Symbol("argument_")
        try:
            found = vs.scalar(machine.call(of, [variable]))
        except nd.NotRead:
            if isinstance(argument, ex.Number):  # r'[0] of r[t_] := {x[t], y[t]}
                raise Initial("a rate at one time") from None
            raise
        for _ in range(order):
            found = vs.partial(found, variable)
        return ex.substitute(found, {variable: vs.scalar(argument)})
    raise nd.NotRead("a derivative of something that is no function")


def _row(word: str) -> list[str]:
    """x1, x2, x3 of SymPy's x1:4, and x0, x1 of x:2."""
    found = re.fullmatch(r"([A-Za-z_]+)(\d{0,2}):(\d{1,2})", word)
    if found is None:
        return [word]
    return [f"{found[1]}{k}" for k in range(int(found[2] or 0), int(found[3]))][:_MOST_NAMES]


def _declared(machine: Machine, name: str, one: nd.Call) -> Value:
    """symbols('m g'), dynamicsymbols('q', 1), Function('x')."""
    given = [machine.value(argument) for argument in one.arguments]
    keywords = dict(one.keywords)
    texts = [text for text in given if isinstance(text, str)]
    if not texts or (name not in ("var", "make_vars") and len(texts) != 1):
        raise nd.NotRead(f"{name}(...) without a text", one.at)
    words = [word for text in texts for word in text.replace(",", " ").split()]
    words = [each for word in words for each in _row(word)]
    if not words or any(":" in word or "(" in word for word in words):
        raise nd.NotRead("a row of names", one.at)
    kind = keywords.get("cls")
    is_function = isinstance(kind, nd.Name | nd.Member) and "Function" in str(kind)
    found: list[Value] = []
    for word in words:
        if name == "dynamicsymbols":
            order = machine.place(one.arguments[1]) if len(given) > 1 else 0
            found.append(machine.in_time(machine.mover(machine.clean(word), one.at), order))
        elif name in ("Function", "function") or is_function:
            moving = machine.clean(word, one.at)
            timed = len(given) > 1 and given[1] == ex.TIME
            found.append(machine.mover(moving, one.at) if timed else vs.Moving(moving))
        else:
            plain = machine.clean(word, one.at)  # also for E and I, which are letters here
            found.append(ex.TIME if plain == "t" else ex.Symbol(plain))
            machine.stated.declared.add(plain)
    if name == "var":
        machine.names |= dict(zip(words, found, strict=True))
    return found[0] if len(found) == 1 else found


def _solved(machine: Machine, one: nd.Call) -> Value:
    """The equations of dsolve(eq, ...) are stated; its solution is not looked for."""
    places = [*one.arguments] if one.keywords or len(one.arguments) > 1 else [*one.arguments[:1]]
    machine.stated.solved = _solved_for_rates(machine, one) or machine.stated.solved
    for place, node in enumerate(places):
        for each in _stated(machine, node, place == 0):
            if each not in machine.stated.equations:
                machine.stated.equations.append(each)
    raise nd.NotRead(SOLUTION, one.at)


def _forgotten(machine: Machine, one: nd.Call) -> Value:
    """Clear[k] and kill(k), after which the name is a letter; kill(all) of all names."""
    for part in one.arguments:
        match part:
            case nd.Name(text="all") | nd.Constant(value=str()):
                machine.forget(machine.names)
            case nd.Name(text=name) | nd.Unary(operand=nd.Name(text=name)):
                machine.forget([name])
    return ex.ZERO


def _tabled(machine: Machine, one: nd.Call) -> Value:
    """Table[f, {q, {x, y}}]."""
    body, over = one.arguments
    match over:
        case nd.Items(items=[nd.Name(text=name), nd.Items(items=items)]):
            found = []
            for item in items:
                with machine.inside({name: machine.value(item)}):
                    found.append(machine.value(body))
            return found
        case nd.Items(items=[nd.Name(text=name), *ends]) if len(ends) in (1, 2):
            first, last = [
                machine.place(end) for end in [nd.Constant(one.at, Fraction(1)), *ends][-2:]
            ]
            if not 0 <= last - first < _MOST_TIMES:
                raise nd.NotRead("a table of so many entries", one.at)
            found = []
            for number in range(first, last + 1):
                with machine.inside({name: ex.number(number)}):
                    found.append(machine.value(body))
            return found
    raise nd.NotRead("a table without a list", one.at)


def _of_block(machine: Machine, one: nd.Call) -> Value:
    """block([a, b], a: 1, ..., value) of Maxima, whose names are its own."""
    first, *body = one.arguments
    if not isinstance(first, nd.Items) or not body:
        first, body = nd.Items(one.at, ()), [*one.arguments]
    own = {name for item in first.items for name in nd.names_of(item)}
    around = {name: value for name, value in machine.names.items() if name not in own}
    with machine.inside({}, around):
        for item in first.items:
            if isinstance(item, nd.Assign):
                machine.statement(item)
        for item in body[:-1]:
            machine.statement(item)
        return machine.value(body[-1])


def _integrated(machine: Machine, one: nd.Call) -> Value:
    """Sage's desolve_odeint(rates, initial values, times, names), and desolve_system_rk4(rates, names),
    plotdf and rk of Maxima.
    """
    function = one.function.text if isinstance(one.function, nd.Name) else ""
    order = ("des", "ics", "times", "dvars") if function == "desolve_odeint" else ("des", "dvars")
    given = dict(zip(order, one.arguments, strict=False))
    if "vars" in dict(one.keywords):
        given["dvars"] = dict(one.keywords)["vars"]
    given |= dict(one.keywords)
    rates, names = (vs.listed(machine.value(given[key])) or [] for key in ("des", "dvars"))
    if len(rates) != len(names) or not all(isinstance(name, ex.Symbol) for name in names):
        raise nd.NotRead("rates without as many names", one.at)
    machine.stated.rates = {
        name.name: vs.scalar(rate) for name, rate in zip(names, rates, strict=True)
    }
    raise nd.NotRead(SOLUTION, one.at)


def _paired(machine: Machine, one: nd.Call) -> Value:
    """heyoka's taylor_adaptive([(x, v), (v, -sin(x))], ...), whose pairs are names and rates."""
    keywords = dict(one.keywords)
    node = keywords.get("sys") or next(iter(one.arguments), None)
    pairs = [vs.listed(pair) or [] for pair in vs.listed(machine.value(node)) or []] if node else []
    if not pairs or any(len(pair) != 2 or not isinstance(pair[0], ex.Symbol) for pair in pairs):
        raise nd.NotRead("rates without as many names", one.at)
    rates = {vs.scalar(name): vs.scalar(rate) for name, rate in pairs}
    machine.stated.rates = {printing.to_text(name): rate for name, rate in rates.items()}
    raise nd.NotRead(SOLUTION, one.at)


def _solved_for_rates(machine: Machine, one: nd.Call) -> dict[str, ex.Expression]:
    """What is zero in solve(m*ddq + k*q, ddq), in which dq and ddq stand for q' and q'', by q; none
    for other calls.
    """
    try:
        given = [machine.value(node) for node in one.arguments[:2]]
    except nd.NotRead:
        return {}
    sides, unknown = ([*(vs.listed(value) or [value])] for value in [*given, None, None][:2])
    trees = [one.difference if isinstance(one, vs.Equation) else one for one in sides]
    names = [node.name for node in unknown if isinstance(node, ex.Symbol)]
    kept = [tree for tree in trees if isinstance(tree, vs.TREES)]
    known = {node.name for tree in kept for node in ex.walk(tree) if isinstance(node, ex.Symbol)}
    known |= machine.stated.declared
    table: dict[ex.Expression, ex.Expression] = {}
    bases: list[str] = []
    for first, second in MARKS:
        for base in sorted(known):
            word, rate = second.format(base), first.format(base)
            if word in names and rate in known and base not in bases:
                bases.append(base)
                table |= {
                    ex.Symbol(word): ex.Acceleration(base),
                    ex.Symbol(rate): ex.Velocity(base),
                }
    if not names or len(bases) != len(unknown) or not len(kept) == len(sides) == len(names):
        return {}
    zero = [ex.substitute(tree, table) for tree in kept]
    return dict(zip(bases, zero, strict=True))


def _with_mass(machine: Machine, one: nd.Call) -> Value:
    """odeset('Mass', M), whose constant M stands before the rates."""
    places = {
        text.value: place
        for text, place in zip(one.arguments, one.arguments[1:], strict=False)
        if isinstance(text, nd.Constant)
    }
    node = places.get("Mass") or dict(one.keywords).get("mass_matrix")
    if node is not None:
        try:
            mass = machine.value(node)
        except nd.NotRead:
            mass = None
        if machine.stated.mass is not None or not isinstance(mass, vs.Matrix):
            raise nd.Trap("a mass matrix", one.at)
        machine.stated.mass, machine.stated.overrides = mass, True
    raise nd.NotRead(SOLUTION, one.at)


def _joins(node: nd.Call) -> list[nd.Node]:
    """The function of a call, if it joins lists."""
    name = node.function.text if isinstance(node.function, nd.Name) else ""
    return [node.function] if name in ("Join", "Flatten", "Union", "List") else []


def _stated(machine: Machine, node: nd.Node, first: bool) -> list[vs.Equation]:
    """The equations in an argument, initial conditions apart."""
    if isinstance(node, nd.Items):
        return [each for item in node.items for each in _stated(machine, item, first)]
    called = _last_word(node.function) if isinstance(node, nd.Call) else ""
    if (
        called in ("<replaced>", "eval")
        and isinstance(node, nd.Call)
        and len(node.arguments) == 2
        and isinstance(node.arguments[0], nd.Items)
    ):  # {...} /. a -> 1
        equations = _stated(machine, node.arguments[0], first)
        rules = machine.value(node.arguments[1])
        pairs = _rules(rules if isinstance(rules, list) else [rules])
        olds = [old.name for old, _ in pairs if isinstance(old, ex.Symbol)]
        if any(name in machine.moving for name in olds):
            raise nd.NotRead("a coordinate that is replaced", node.at)
        if all(isinstance(new, ex.Number) for _, new in pairs):  # the letter says more
            machine.stated.aside |= {
                old.name: new
                for old, new in pairs
                if isinstance(old, ex.Symbol) and isinstance(new, ex.Number)
            }
            return equations
        sides = [(replaced(machine, one.left, rules), one.right) for one in equations]
        return [
            vs.Equation(left, vs.scalar(replaced(machine, right, rules))) for left, right in sides
        ]
    if isinstance(node, nd.Call) and node.function in _joins(node):
        return [each for part in node.arguments for each in _stated(machine, part, first)]
    try:
        found = machine.value(node)
    except Initial:
        return []
    except nd.NotRead as error:
        if first:
            machine.names["<unread>"] = error
        return []
    moving = ex.Velocity | ex.Acceleration
    listed = found if isinstance(found, list) else [found]
    if all(isinstance(one, vs.Equation) for one in listed):  # a constraint, or a definition
        names = [ex.Symbol(name) for name in machine.moving]
        return [
            one
            for one in listed
            if ex.has(one.difference, moving) or ex.holds(one.difference, *names)
        ]
    return [
        each
        for each in vs.equations_in(found)
        if ex.has(each.difference, moving)
        and (isinstance(found, vs.Equation) or first)
        and (isinstance(found, vs.Equation | list | vs.Matrix) or not isinstance(found, moving))
    ]


# -- rules


def _diff(machine: Machine, given: Given) -> Value:
    """diff(f, x), diff(f, t, 2), diff(x, 2), D[f, x], D[f, {t, 2}], D(x)."""
    value, *by = given
    named = isinstance(value, vs.Moving | vs.Closure) or (
        machine.dialect.name == "Maple" and isinstance(value, ex.Symbol)
    )
    if named and not by:
        return vs.Derived(value, 1)
    if isinstance(value, vs.Moving):
        value = machine.mover(value.name)
    if not by:
        moving = [ex.Symbol(name) for name in machine.moving]
        if isinstance(value, vs.TREES) and not ex.has(value, ex.Velocity):
            _refuse_still(value, moving)
        return machine.in_time(value)
    if len(by) == 1 and _is_whole(by[0]):  # MATLAB's diff(x, 2)
        return machine.in_time(value, int(by[0].value))
    flat: list[Value] = []
    for one in by:
        flat += one if isinstance(one, list) else [one]
    place = 0
    while place < len(flat):
        times = 1
        if place + 1 < len(flat) and _is_whole(flat[place + 1]):
            times = int(flat[place + 1].value)
        value = _by(machine, value, flat[place], times)
        place += 1 + (place + 1 < len(flat) and _is_whole(flat[place + 1]))
    return value


def _formula(machine: Machine, given: Given) -> Value:
    """unapply(f, x, y) of Maple."""
    value, *names = given
    if not names or not all(isinstance(one, ex.Symbol) for one in names):
        raise nd.NotRead("a function of something that is no name")
    return vs.Formula(value, tuple(names))


def _mapped(machine: Machine, one: nd.Call) -> Value:
    """f /@ list of Mathematica, and map(diff, list, t) of Maple."""
    function, over, *more = one.arguments
    entries = vs.listed(held := machine.value(over))
    if entries is None:
        raise nd.NotRead("a list is expected", one.at)
    rest = [*map(machine.value, more)]
    if isinstance(function, nd.Name) and function.text not in machine.names:
        name = function.text
        rule = RULES.get(name) if name == "diff" else None
        if rule is None and (name not in _SAME or rest):
            raise nd.NotRead(f"{name} of each entry", one.at)
        found = [rule(machine, [entry, *rest]) if rule else entry for entry in entries]
    else:
        value = machine.value(function)
        found = [_applied(machine, value, [entry, *rest]) for entry in entries]
    return vs.column(found) if isinstance(held, vs.Matrix) else found


def _alias(machine: Machine, one: nd.Call) -> Value:
    """alias(x = x(t)) of Maple."""
    for part in one.arguments:
        match part:
            case nd.Binary(sign="==", left=nd.Name(text=name), right=right):
                machine.names[name] = machine.value(right)
            case _:
                raise nd.NotRead("a name for something else", one.at)
    return ex.ZERO


def _subscript(machine: Machine, given: Given) -> Value:
    """Subscript[a, 1] of Mathematica, the name a_1."""
    base, *below = (_word(one) for one in given)
    return machine.named(nd.Name(0, "_".join([base, "".join(below)])))


def _word(one: Value) -> str:
    if isinstance(one, ex.Symbol):
        return one.name
    if isinstance(one, ex.Number) and one.value.denominator == 1 and one.value >= 0:
        return str(one.value)
    raise nd.NotRead("a name with an index that is a formula")


def _split(machine: Machine, given: Given) -> Value:
    """np.split(y, 2), the halves of a state of two entries."""
    value, count = given
    entries = vs.listed(value)
    if isinstance(value, vs.Array) and _is_whole(count) and 1 < count.value <= _MOST_ROWS:
        entries = [value.entry(value.first + k) for k in range(int(count.value))]
    if entries is None or not _is_whole(count) or len(entries) != count.value:
        raise nd.NotRead("parts of an array")
    return entries


def _stacked(machine: Machine, given: Given) -> Value:
    """torch.stack([v, a], dim=-1) of two numbers; vectors would lie side by side."""
    entries = vs.listed(given[0])
    if entries is None or any(vs.listed(one) is not None for one in entries):
        raise nd.NotRead("vectors side by side")
    return entries


def _squared(machine: Machine, given: Given) -> Value:
    """np.square(u)."""
    [value] = given
    return vs.each(value, lambda u: u**2)


def _in_radians(machine: Machine, given: Given) -> Value:
    """np.deg2rad(u), np.radians(u)."""
    [value] = given
    return vs.multiplied(value, ex.PI / ex.number(180))


def _operator(machine: Machine, given: Given) -> Value:
    """Differential(t) of Julia."""
    [by] = given
    return vs.Operator(by)


def _rate(machine: Machine, given: Given) -> Value:
    """der(x) of Modelica."""
    (value,) = given
    return machine.in_time(value)


def _refuse_still(value: ex.Expression, moving: Sequence[ex.Expression]) -> None:
    """NotRead for diff(x^2) where x does not move: it is by x."""
    if not ex.holds(value, *moving):
        raise nd.NotRead("a derivative by a name that is not given")


def _by(machine: Machine, value: Value, by: Value, times: int) -> Value:
    if not 0 <= times <= 4:
        raise nd.NotRead("a derivative of high order")
    if by == "t":
        by = ex.TIME
    variable = vs.scalar(by)
    if variable == ex.TIME:
        named = isinstance(value, ex.Symbol) and value.name not in machine.stated.declared
        if named and machine.dialect.name in ("Maxima", "Sage"):
            value = machine.mover(value.name)
        return machine.in_time(value, times)
    if isinstance(variable, ex.Symbol):
        machine.stated.by.add(variable.name)
    for _ in range(times):
        value = vs.each(value, lambda tree: vs.partial(tree, variable))
    return value


def _equation(machine: Machine, given: Given) -> Value:
    if len(given) == 1:
        return machine.equation(given[0], ex.ZERO)
    return machine.equation(given[0], given[1])


def _rational(machine: Machine, given: Given) -> Value:
    if len(given) == 2:
        return vs.multiplied(given[0], vs.scalar(given[1]) ** ex.MINUS_ONE)
    return given[0]


def _matrix(machine: Machine, given: Given) -> Value:
    rows = given[-1] if isinstance(given[-1], list) else [*given]
    if rows and all(isinstance(row, list) for row in rows):
        return vs.Matrix(tuple(map(tuple, rows)))
    return vs.column(rows)


def _diagonal(machine: Machine, given: Given) -> Value:
    entries = vs.listed(given[0]) if len(given) == 1 else [*given]
    if not entries:
        raise nd.NotRead("a diagonal without entries")
    return vs.Matrix(
        tuple(
            tuple(entry if k == j else ex.ZERO for k in range(len(entries)))
            for j, entry in enumerate(entries)
        )
    )


def _jacobian(machine: Machine, given: Given) -> Value:
    of = vs.listed(given[0])
    by = vs.listed(given[1])
    rows = [given[0]] if of is None else of
    columns = [given[1]] if by is None else by
    return vs.Matrix(tuple(tuple(_by(machine, row, one, 1) for one in columns) for row in rows))


def _first(machine: Machine, given: Given) -> Value:
    entries = vs.listed(given[0])
    if not entries:
        raise nd.NotRead("the first entry of what is no list")
    return entries[0]


def _flat(machine: Machine, given: Given) -> Value:
    entries = vs.listed(given[0])
    if entries is None or len(given) > 1:
        raise nd.NotRead("a list in another shape")
    return [part for one in entries for part in (vs.listed(one) or [one])]


def _applied_to_entries(machine: Machine, given: Given) -> Value:
    """M.applyfunc(f)."""
    value, change = given
    if isinstance(change, vs.Closure):
        return vs.each(value, lambda part: machine.call(change, [part]))
    if isinstance(change, ex.Symbol) and change.name in _SAME:
        return value
    raise nd.NotRead("a function of each entry")


def _norm(machine: Machine, given: Given) -> Value:
    if given[1:] not in ([], [ex.number(2)]):
        raise nd.NotRead("another norm than that of the length")
    return ex.square_root(vs.scalar(vs.dot(given[0], given[0])))


def _unit(machine: Machine, given: Given) -> Value:
    return vs.multiplied(given[0], ex.power(_norm(machine, given), ex.MINUS_ONE))


def _square(machine: Machine, given: Given) -> Value:
    return vs.dot(given[0], given[0])


def _hypotenuse(machine: Machine, given: Given) -> Value:
    return _norm(machine, [[*given]])


def _dot(machine: Machine, given: Given) -> Value:
    return vs.dot(given[0], given[1])


def _crossed(machine: Machine, given: Given) -> Value:
    left, right = given
    return frames.cross(left, right)


def _filled(machine: Machine, given: Given) -> Value:
    """zeros(2, 1), zeros(2), np.zeros((2, 2)), with few entries; a list of Python has no columns."""
    sizes = [*given[0]] if given and isinstance(given[0], list) else [*given]
    if not 1 <= len(sizes) <= 2 or not all(map(_is_whole, sizes)):
        return vs.Filled(first=machine.dialect.first)
    rows, *columns = [int(size.value) for size in sizes]
    width = columns[0] if columns else rows if machine.dialect.name == "MATLAB" else 1
    return vs.Filled(zeros=(rows, width), first=machine.dialect.first)


def _empty(machine: Machine, given: Given) -> Value:
    return vs.Filled(first=machine.dialect.first)


def _identity(machine: Machine, given: Given) -> Value:
    if not given or not _is_whole(given[0]) or not 0 < given[0].value <= _MOST_ROWS:
        raise nd.NotRead("a matrix without a size")
    return _diagonal(machine, [ex.ONE] * int(given[0].value))


def _inverse(machine: Machine, given: Given) -> Value:
    value = given[0]
    if isinstance(value, list) and all(isinstance(row, list) for row in value):
        found = vs.inverted(_matrix(machine, [value]))
        return [[*row] for row in found.rows]  # an array of NumPy, whose product is entry by entry
    if isinstance(value, vs.Array | ex.Symbol):
        raise nd.Trap("the inverse of a letter that may be a matrix")
    return vs.solved(value, ex.ONE) if not isinstance(value, vs.Matrix) else vs.inverted(value)


def _linear(machine: Machine, given: Given) -> Value:
    """np.linalg.solve(M, b), LinearSolve[M, b], and M.LUsolve(b)."""
    matrix, right = given
    if isinstance(matrix, list) and all(isinstance(row, list) for row in matrix):
        matrix = _matrix(machine, [matrix])
    return vs.solved(matrix, right)


def _joined(machine: Machine, given: Given) -> Value:
    parts = given[0] if len(given) == 1 and isinstance(given[0], list) else [*given]
    found: list[Value] = []
    for part in parts:
        entries = vs.listed(part)
        found += [part] if entries is None else entries
    return found


def _of_lagrangian(machine: Machine, given: Given) -> Value:
    """The equations of EulerEquations[L, x[t], t] and its like; L and the coordinates are stated."""
    lagrangian = vs.scalar(given[0])
    parts = [one for one in given[1:] if one != ex.TIME and one != [ex.TIME]]
    entries = [one for part in parts for one in (vs.listed(part) or [part])]
    names = [
        one.name for one in entries if isinstance(one, ex.Symbol | vs.Moving) and one != ex.TIME
    ]
    if len(names) != len(entries):
        raise nd.NotRead("coordinates that are no names")
    moves = [name for name in machine.moving if ex.holds(lagrangian, ex.Velocity(name))]
    names = names or moves
    machine.stated.lagrangians.append((lagrangian, names, [ex.ZERO] * len(names)))
    for name in names:
        machine.mover(name)
    return [vs.Equation(equation_of(machine, lagrangian, name), ex.ZERO) for name in names]


def _variation(machine: Machine, given: Given) -> Value:
    """MATLAB's functionalDerivative(L, x) = dL/dx - d/dt dL/dx', a column for several x."""
    lagrangian, by = vs.scalar(given[0]), given[1]
    listed = vs.listed(by)
    names = [one for one in (listed or [by]) if isinstance(one, ex.Symbol | vs.Moving)]
    if len(names) != len(listed or [by]) or len(given) != 2:
        raise nd.NotRead("coordinates that are no names")
    for one in names:
        machine.mover(one.name)
    found = [
        vs.partial(lagrangian, ex.Symbol(one.name))
        - vs.scalar(machine.in_time(vs.partial(lagrangian, ex.Velocity(one.name))))
        for one in names
    ]
    return found[0] if listed is None else vs.column(found)


def _of_hamiltonian(machine: Machine, given: Given) -> Value:
    """The pairs q' = dH/dp, p' = -dH/dq of heyoka's hamiltonian(H, [q], [p]), which are stated."""
    energy, *sides = given
    places, momenta = (vs.listed(side) for side in sides)
    if not places or momenta is None or len(places) != len(momenta):
        raise nd.NotRead("as many momenta as coordinates are expected")
    names = [one for one in (*places, *momenta) if isinstance(one, ex.Symbol)]
    if len({*names}) != 2 * len(places):
        raise nd.NotRead("coordinates that are no names")
    q, p = names[: len(places)], names[len(places) :]
    tree = vs.scalar(energy)
    slopes = [vs.partial(tree, one) for one in p] + [-vs.partial(tree, one) for one in q]
    machine.stated.rates = {one.name: slope for one, slope in zip(names, slopes, strict=True)}
    machine.stated.overrides = True
    return vs.Plain(vs.Plain(pair) for pair in zip(names, slopes, strict=True))


def _struct(machine: Machine, given: Given) -> Value:
    """MATLAB's struct('w', 2, 'c', 0.1)."""
    names, values = [*given[::2]], [*given[1::2]]
    texts = [name for name in names if isinstance(name, str)]
    if len(texts) != len(values) or len(texts) != len(names):
        raise nd.NotRead("a struct without as many values as names")
    return vs.Struct(dict(zip(texts, values, strict=True)))


def _threaded(machine: Machine, given: Given) -> Value:
    """Thread[{u, v} == {a, b}] of Mathematica, which an equation of vectors is here, too."""
    [value] = given
    if not isinstance(value, list) or not all(isinstance(one, vs.Equation) for one in value):
        raise nd.NotRead("Thread of something that is no equation of vectors")
    return value


def equation_of(machine: Machine, lagrangian: ex.Expression, name: str) -> ex.Expression:
    """d/dt dL/dx' - dL/dx."""
    momentum = vs.partial(lagrangian, ex.Velocity(name))
    return vs.scalar(machine.in_time(momentum)) - vs.partial(lagrangian, ex.Symbol(name))


def _power(machine: Machine, given: Given) -> Value:
    return machine.power(vs.scalar(given[0]), vs.scalar(given[1]))


def _depends(machine: Machine, given: Given) -> Value:
    names, by = given[0], given[1]
    if by != ex.TIME:
        raise nd.NotRead("depends(...) on something other than the time")
    for one in names if isinstance(names, list) else [names]:
        if isinstance(one, ex.Symbol):
            machine.names[one.name] = machine.mover(one.name)
    return ex.ZERO


def _gradef(machine: Machine, given: Given) -> Value:
    """gradef(x, t, xd): xd is the rate of x."""
    moving, by, rate = given
    if by != ex.TIME or not isinstance(rate, ex.Symbol):
        raise nd.NotRead("gradef(...) by something other than the time")
    if isinstance(moving, ex.Symbol):
        moving = machine.names[moving.name] = machine.mover(moving.name)
    machine.names[rate.name] = machine.in_time(moving)
    return ex.ZERO


def _sum(machine: Machine, given: Given) -> Value:
    entries = vs.listed(given[0])
    if entries is None:
        raise nd.NotRead("a sum of what is no list")
    found: Value = ex.ZERO
    for entry in entries:
        found = vs.added(found, entry)
    return found


def _iterated(machine: Machine, given: Given) -> Value:
    """(D@@2)(x) of Maple."""
    times = given[1]
    if not isinstance(times, ex.Number) or times.value.denominator != 1:
        raise nd.NotRead("an operator without a number of times")
    return _Iterated(int(times.value))


@dataclass(frozen=True, slots=True)
class _Iterated:
    times: int


def _replaced(machine: Machine, given: Given) -> Value:
    return replaced(machine, given[0], given[1])


def _repeated(machine: Machine, given: Given) -> Value:
    """value //. rules of Mathematica: until nothing changes."""
    value, rules = given
    for _ in range(10):
        before, value = value, replaced(machine, value, rules)
        if value == before:
            return value
    raise nd.NotRead("a rule that is applied without end")


def _own_letter(machine: Machine, given: Given) -> Value:
    """A letter of a text of MATLAB: with a number of the program where it has one."""
    [name] = given
    held = machine.names.get(str(name))
    return held if isinstance(held, ex.Number) else machine.symbol(str(name))


def _more_than_lines(machine: Machine, given: Given) -> Value:
    machine.stated.overrides = True
    return given[0]


RULES: dict[str, Rule] = {
    nd.MORE: _more_than_lines,
    matlab_texts.OWN: _own_letter,
    "<iterated>": _iterated, "<replaced>": _replaced, "<repeated>": _repeated,
    **dict.fromkeys(("diff", "D", "Derivative", "derivative", "Diff", "Dt"), _diff),
    "der": _rate,
    **dict.fromkeys(("Eq", "Equal"), _equation),
    **dict.fromkeys(("Rational", "S", "Integer", "sympify"), _rational),
    **dict.fromkeys(("Matrix", "MutableDenseMatrix", "matrix", "vector", "vec", "Vector"), _matrix),
    **dict.fromkeys(("jacobian", "Jacobian"), _jacobian),
    **dict.fromkeys(("norm", "Norm", "mag"), _norm), "hat": _unit, "mag2": _square,
    **dict.fromkeys(("dot", "Dot", "DotProduct", "inner", "matmul"), _dot),
    "hypot": _hypotenuse, **dict.fromkeys(("cross", "Cross"), _crossed),
    "zeros": _filled, **dict.fromkeys(("empty", "zeros_like", "empty_like"), _empty),
    **dict.fromkeys(("eye", "IdentityMatrix"), _identity),
    **dict.fromkeys(("inv", "Inverse", "invert", "inverse"), _inverse),
    **dict.fromkeys(("LinearSolve", "LUsolve", "mldivide"), _linear),
    **dict.fromkeys(("concatenate", "hstack", "append", "vstack"), _joined),
    **dict.fromkeys(
        ("EulerEquations", "euler_equations", "EulerLagrange"),
        _of_lagrangian,
    ),
    "functionalDerivative": _variation,
    **dict.fromkeys(("pow", "Power", "Pow"), _power),
    **dict.fromkeys(("First", "first"), _first), **dict.fromkeys(("flatten", "ravel"), _flat),
    "unapply": _formula, "Subscript": _subscript, "square": _squared, "split": _split, "stack": _stacked,
    **dict.fromkeys(("deg2rad", "radians"), _in_radians), **dict.fromkeys(("power", "float_power"), _power),
    "Differential": _operator, "applyfunc": _applied_to_entries, "diag": _diagonal, "depends": _depends, "gradef": _gradef,
    "sum": _sum, "Total": _sum, "Thread": _threaded, "struct": _struct, "hamiltonian": _of_hamiltonian,
}  # fmt: skip


# -- methods


def _method(machine: Machine, one: nd.Call, name: str, base: Value) -> Value:
    if name == "subs" or name == "xreplace":
        return _substituted(machine, base, one)
    if name in _SOLVERS:
        raise nd.NotRead(SOLUTION, one.at)
    arguments = [*map(machine.value, one.arguments)]
    if (found := frames.method(machine, base, name, arguments)) is not None:
        return found
    if name in _SAME:
        return base
    if name in ("transpose",) and isinstance(base, vs.Matrix):
        return base.transposed()
    if name in RULES:
        return RULES[name](machine, [base, *arguments])
    raise nd.NotRead(f".{name}(...)", one.at)


def _substituted(machine: Machine, base: Value, one: nd.Call) -> Value:
    """f.subs(x, 1), f.subs({x: 1}), f.subs([(x, 1)]), f.subs(x=1)."""
    rules = [*_rules([machine.value(argument) for argument in one.arguments])]
    for name, node in one.keywords:
        held = machine.names.get(name)
        old = held if isinstance(held, vs.TREES) else machine.symbol(name)
        rules.append((old, machine.value(node)))
    return _put(base, rules)


def _substituted_by_name(machine: Machine, name: str, one: nd.Call) -> Value:
    """subs(f, x, 1) of MATLAB, subs(x = 1, f) and eval(f, {x = 1}) of Maple, subst(1, x, f)."""
    if (timed := _at_the_time(machine, name, one)) is not None:
        return timed
    given = [*map(machine.value, one.arguments)]
    if name in ("rhs", "lhs"):
        if not isinstance(given[0], vs.Equation):
            raise nd.NotRead(f"{name}(...)", one.at)
        return given[0].left if name == "lhs" else given[0].right
    if name == "subst" and len(given) == 3:
        return _put(given[2], [(given[1], given[0])])
    puts = all(isinstance(one, vs.Equation | vs.Rule | list) for one in given[:-1])
    is_last = (puts and isinstance(given[0], vs.Equation | vs.Rule)) or (
        name == "subst" or (isinstance(given[0], list) and name == "subs")
    )
    if is_last and len(given) > 1:
        return _put(given[-1], [*_rules(given[:-1])])
    return _put(given[0], [*_rules(given[1:])])


def _at_the_time(machine: Machine, name: str, one: nd.Call) -> Value | None:
    """Maple's eval(diff(y(x), x), x = t), a function of the time by another name of its argument."""
    match one.arguments:
        case [tree, nd.Binary(sign="==", left=nd.Name(text=old), right=nd.Name(text=new))] if (
            name == "eval" and new == machine.time and old not in machine.names
        ):
            with machine.inside({old: ex.TIME}):
                return machine.value(tree)
    return None


def _rules(given: Given) -> list[tuple[Value, Value]]:
    found: list[tuple[Value, Value]] = []
    if len(given) == 2 and not any(isinstance(one, vs.Rule | vs.Equation) for one in given):
        olds, news = vs.listed(given[0]), vs.listed(given[1])
        if olds is None:
            return [(given[0], given[1])]
        if news is not None and len(olds) == len(news):
            return [*zip(olds, news, strict=True)]
    for one in given:
        if isinstance(one, vs.Rule):
            found.append((one.old, one.new))
        elif isinstance(one, vs.Equation):
            found.append((one.left, one.right))
        elif isinstance(one, list) and len(one) == 2 and isinstance(one[0], vs.TREES):
            found.append((one[0], one[1]))
        elif isinstance(one, list):
            for each in one:
                found += _rules([each])
        else:
            raise nd.NotRead("a substitution")
    return found


def _put(value: Value, rules: Sequence[tuple[Value, Value]]) -> Value:
    """The value after one substitution after another, in any order."""
    news = [vs.scalar(new) for _, new in rules]
    for k, (old, _) in enumerate(rules):
        if any(ex.holds(new, vs.scalar(old)) for j, new in enumerate(news) if j != k):
            raise nd.NotRead("a substitution into another one")
    for old, new in rules:
        leaf, tree = vs.scalar(old), vs.scalar(new)
        if isinstance(leaf, ex.Number) or ex.children(leaf):
            raise nd.NotRead("a substitution for a formula")
        value = vs.each(value, partial(_put_one, leaf=leaf, tree=tree))
    return value


def _put_one(part: ex.Expression, leaf: ex.Expression, tree: ex.Expression) -> ex.Expression:
    rates = (
        (ex.Velocity(leaf.name), ex.Acceleration(leaf.name)) if isinstance(leaf, ex.Symbol) else ()
    )
    if isinstance(tree, ex.Number) and ex.holds(part, *rates):
        raise nd.NotRead("a coordinate that is put in as a number")
    return ex.substitute(part, {leaf: tree})


def replaced(machine: Machine, value: Value, rules: Value) -> Value:
    """value /. rules of Mathematica: all at once."""
    if isinstance(rules, list) and rules and isinstance(rules[0], list):
        raise nd.NotRead("several lists of rules")
    pairs = _rules(rules if isinstance(rules, list) else [rules])
    table = {vs.scalar(old): vs.scalar(new) for old, new in pairs}
    for leaf, tree in table.items():
        _put_one(ex.ZERO, leaf, tree)
    return vs.each(value, lambda part: ex.substitute(part, table))
