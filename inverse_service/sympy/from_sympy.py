"""Between SymPy and the documents of this package: systems in, as texts for our reader, formulas of
results out.

A `Table` says which SymPy object each name of a document represents. `conditions_of` gives the
Helmholtz tensors as matrices and arrays; `verification` is a third opinion, by SymPy itself, on L
and H.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from typing import Any, Protocol

import sympy
from sympy.concrete.expr_with_limits import ExprWithLimits
from sympy.core.function import Application, AppliedUndef
from sympy.logic.boolalg import BooleanAtom
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from inverse_service.errors import InputError
from inverse_service.expressions import functions, printing, refusals, tree as ex
from inverse_service.field import tower
from inverse_service.mechanics.conditions import conditions
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, operations, reader
from inverse_service.service.documents import accepting, translate
from inverse_service.sympy.shown import Hamiltonian, Verification, aligned

# A Float of more digits is rounded: 1/3 has the fifteen that SymPy prints; 9.81 and 0.1 + 0.2 have
# a few.
_MOST_TYPED = 12
_GOOD = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
LONGER = 50  # times as long as what people type may be what programs print
_KNOWN = frozenset({*nm.FUNCTIONS, *nm.PIECEWISE, "Abs"})
_OF_SYMPY = {row.sympy: name for name, row in functions.FUNCTION.items() if row.sympy}
_WITHOUT_MEANING = (
    ((sympy.I,), "complex numbers occur", "write the equations of the real and imaginary parts"),
    (
        (sympy.oo, -sympy.oo, sympy.zoo, sympy.nan),
        "oo, zoo, or nan is not a number",
        "write finite numbers",
    ),
    (
        (ExprWithLimits,),
        "an integral or a sum occurs",
        "evaluate it, or declare a function of your own",
    ),
    (
        (sympy.Equality, sympy.Unequality, sympy.Xor),
        "a piece has a condition that is not an inequality",
        "write inequalities, joined by &, | and ~",
    ),
)
# What else SymPy has, such as GoldenRatio, O(x), or a unit, would be printed like a name of the
# document.
_ACCEPTED = (sympy.Add, sympy.Mul, sympy.Pow, Application, sympy.Derivative, sympy.Subs, sympy.UnevaluatedExpr,
             sympy.Symbol, sympy.Rational, sympy.Float, type(sympy.pi), type(sympy.E))  # fmt: skip
_RELATIONS = (
    (" >= ", sympy.Ge),
    (" <= ", sympy.Le),
    (" != ", sympy.Ne),
    (" > ", sympy.Gt),
    (" < ", sympy.Lt),
)


def to_sympy(tree: ex.Expression, leaf: Callable[[ex.Expression], Any]) -> Any:
    """The tree as a SymPy expression; `leaf` gives the objects of names and of arbitrary
    functions.
    """
    match tree:
        case ex.Number(value):
            return sympy.Rational(value.numerator, value.denominator)
        case _ if tree == ex.PI:
            return sympy.pi
        case ex.Sum(terms):
            return sympy.Add(*(to_sympy(term, leaf) for term in terms))
        case ex.Product(factors):
            return sympy.Mul(*(to_sympy(factor, leaf) for factor in factors))
        case ex.Power(base, exponent):
            return sympy.Pow(to_sympy(base, leaf), to_sympy(exponent, leaf))
        case ex.Apply(function) if function in functions.SPECIAL:
            inner = functions.arguments_of(tree)[::-1]  # the order first
            name = functions.FUNCTION[function].sympy or function
            return getattr(sympy, name)(*(to_sympy(part, leaf) for part in inner))
        case ex.Apply(function, argument):
            return getattr(sympy, function)(to_sympy(argument, leaf))
    return leaf(tree)


class _DocumentPrinter(StrPrinter):  # type: ignore[misc]
    """SymPy's own text with the names of a document, which our reader reads; InputError for what
    has no real meaning.

    `words`: what is written for coordinates, their derivatives, constants, and the classes of
    arbitrary functions.
    """

    def __init__(self, words: Mapping[Any, str]) -> None:
        super().__init__({"order": "none"})
        self._words = words

    def _print(self, expr: Any, **settings: Any) -> str:
        if expr in self._words:
            return self._words[expr]
        if isinstance(expr, sympy.Expr) and not isinstance(expr, _ACCEPTED):
            raise _refused(f"{type(expr).__name__} occurs", "write elementary functions")
        return str(super()._print(expr, **settings))

    def _print_Symbol(self, expr: Any) -> str:
        raise _refused(f"the symbol {expr} occurs with different assumptions", "use one symbol")

    def _print_Float(self, expr: Any) -> str:
        return str(_as_typed(expr))

    def _print_Exp1(self, expr: Any) -> str:
        return "exp(1)"

    def _print_Function(self, expr: Any) -> str:
        name = type(expr).__name__
        if name in _OF_SYMPY:
            inside = ", ".join(map(self._print, expr.args))
            return f"{_OF_SYMPY[name]}({inside})"
        if name not in _KNOWN:
            raise _refused(
                f"the function {name} occurs",
                "write elementary functions, or a function of your own",
            )
        return str(super()._print_Function(expr))

    def _print_Mul(self, expr: Any) -> str:
        return "*".join(
            self.parenthesize(factor, PRECEDENCE["Mul"]) for factor in expr.args
        )  # SymPy errs in quotients

    def _print_UnevaluatedExpr(self, expr: Any) -> str:
        return f"({self._print(expr.args[0])})"  # SymPy takes x - (y - z) for the text of x + UnevaluatedExpr(-y - z)

    def _print_Heaviside(self, expr: Any) -> str:
        return f"Heaviside({self._print(expr.args[0])})"  # whatever value it is given at 0

    def _print_AppliedUndef(self, expr: Any) -> str:
        return self._arbitrary(expr, [0] * len(expr.args), expr.args)

    def _print_Derivative(self, expr: Any) -> str:
        return self._slope(expr, expr, {})

    def _print_Subs(self, expr: Any) -> str:
        return self._slope(expr, expr.expr, dict(zip(expr.variables, expr.point, strict=True)))

    def _slope(self, whole: Any, inner: Any, replaced: Mapping[Any, Any]) -> str:
        """Derivative(A(x), x), and Subs of it at other arguments."""
        if not isinstance(inner, sympy.Derivative) or not isinstance(inner.expr, AppliedUndef):
            if (done := whole.doit()) == whole:
                raise _refused("an unevaluated derivative occurs", "call doit()")
            return f"({self._print(done)})"
        if inner.expr in self._words:
            raise _refused("a third derivative occurs", operations.OF_SECOND_ORDER)
        orders = [0] * len(inner.expr.args)
        for variable, count in inner.variable_count:
            places = [
                place for place, argument in enumerate(inner.expr.args) if argument == variable
            ]
            if len(places) != 1:
                raise _refused(
                    f"a derivative by {variable} occurs",
                    "differentiate by the arguments of the function",
                )
            orders[places[0]] += int(count)
        return self._arbitrary(
            inner.expr, orders, [argument.subs(replaced) for argument in inner.expr.args]
        )

    def _arbitrary(self, applied: Any, orders: list[int], arguments: Sequence[Any]) -> str:
        if applied.func not in self._words:
            raise _refused(
                f"the function {applied} occurs", "give the coordinates, and functions of them"
            )
        by = f"[{','.join(map(str, orders))}]" if any(orders) else ""
        return f"{self._words[applied.func]}{by}({', '.join(map(self._print, arguments))})"


def _written(expression: Any, words: Mapping[Any, str], names: nm.Names) -> str:
    """The expression in the notation of documents; InputError for a part without an exact real
    meaning.
    """
    for kinds, what, instead in _WITHOUT_MEANING:
        if expression.has(*kinds):
            raise _refused(what, instead)
    typed = frozenset(abs(Fraction(_as_typed(each))) for each in expression.atoms(sympy.Float))
    with refusals.longer_texts(LONGER), printing.with_decimals(typed):
        return printing.to_text(
            reader.read_formula(_DocumentPrinter(words).doprint(expression), names)
        )


def _as_typed(number: Any) -> Decimal:
    """The decimal number of a Float that somebody typed, 9.81; InputError for one that is rounded,
    1/3.
    """
    found = Decimal(str(number)).normalize()
    if len(found.as_tuple().digits) > _MOST_TYPED:
        raise _refused(
            f"{found} is a rounded number", "write the exact one, such as Rational(1, 3)"
        )
    return found


def _refused(what: str, instead: str) -> InputError:
    return InputError(f"{what}: {instead}.", "/equations")


@dataclass(frozen=True)
class Table:
    """SymPy objects by names: coordinates (x(t), or symbols), their velocities, parameters,
    function classes.
    """

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
        return {
            f"p_{name}": sympy.Symbol(f"p_{plain_name(found)}")
            for name, found in self.coordinates.items()
        }

    def symbol(self, name: str) -> Any:
        """The object of a name; a symbol of the same name for one that is not in the table."""
        for part in (self.coordinates, self.parameters, self.momenta):
            if name in part:
                return part[name]
        if name == self.time_name:
            return self.time
        return sympy.Symbol(name)

    def leaf(self, node: ex.Expression) -> Any:
        """The object that represents a name or an arbitrary function in a formula."""
        match node:
            case _ if (
                node == ex.TIME and "t" not in self.coordinates and "t" not in self.parameters
            ):
                return self.time
            case ex.Symbol(name):
                return self.symbol(name)
            case ex.Velocity(name):
                return self.velocity(name)
            case ex.Acceleration(name):
                return self.acceleration(name)
            case ex.Arbitrary():
                return self._applied(node)
        raise TypeError(f"{type(node).__name__} is not a leaf")

    def _applied(self, tree: ex.Arbitrary) -> Any:
        """A(u), its derivatives taken at dummies and then put at the arguments."""
        function = self.functions.get(tree.name, sympy.Function(tree.name))
        arguments = [to_sympy(argument, self.leaf) for argument in tree.arguments]
        if not any(tree.orders):
            return function(*arguments)
        plain = all(
            argument.is_Symbol or isinstance(argument, AppliedUndef) for argument in arguments
        )
        if plain and len(set(arguments)) == len(arguments):
            pairs = [(u, k) for u, k in zip(arguments, tree.orders, strict=True) if k]
            return sympy.Derivative(function(*arguments), *pairs)
        dummies = [sympy.Dummy(f"xi_{place}") for place in range(len(arguments))]
        pairs = [(u, k) for u, k in zip(dummies, tree.orders, strict=True) if k]
        return sympy.Subs(sympy.Derivative(function(*dummies), *pairs), dummies, arguments)

    def velocity(self, name: str) -> Any:
        """x'(t), or the symbol of the velocity."""
        return (
            self.velocities[name]
            if name in self.velocities
            else self.coordinates[name].diff(self.time)
        )

    def acceleration(self, name: str) -> Any:
        """x''(t), also where the velocity is a plain symbol."""
        found = self.coordinates[name]
        return (
            sympy.Symbol(f"{found}_ddot") if name in self.velocities else found.diff(self.time, 2)
        )

    def of_formulas(self) -> nm.Names:
        """The names as the reader of formulas wants them."""
        more = [self.time_name] if self.time_name != "t" else []
        taken = {*self.coordinates, *self.functions}
        words = (*self.parameters, *self.momenta, *more)
        return nm.Names(
            tuple(self.coordinates),
            tuple(word for word in dict.fromkeys(words) if word not in taken),
            self.arguments,
        )


def plain_name(found: Any) -> str:
    """The name or value of an object in a declaration: k for Symbol("k"), x for x(t), V for
    Function("V"), 2 for 2.
    """
    return str(found.func) if isinstance(found, AppliedUndef) else str(found)


def table_of_result(result: Mapping[str, Any], given: Mapping[str, Any] | None = None) -> Table:
    """The names of a result as new SymPy objects, or as those given for them."""
    system, given = result.get("system") or {}, given or {}
    time_name = system.get("time", "t")
    time = given.get(time_name, sympy.Symbol(time_name))
    functions = system.get("functions", {})
    return Table(
        time,
        time_name,
        {
            name: given.get(name, sympy.Function(name)(time))
            for name in system.get("coordinates", ())
        },
        {},
        {name: given.get(name, sympy.Symbol(name)) for name in system.get("parameters", ())},
        {name: given.get(name, sympy.Function(name)) for name in functions},
        {name: tuple(arguments) for name, arguments in functions.items()},
    )


def names_for(objects: Iterable[Any]) -> dict[Any, str]:
    """A name for each object: its own where a document can declare it, else one like it."""
    used, found = set[str](), {}
    for each in objects:
        wanted = _wanted(plain_name(each))
        name = next(
            word for word in (wanted, *(f"{wanted}_{k}" for k in range(2, 99))) if word not in used
        )
        used.add(name)
        found[each] = name
    return found


def _wanted(word: str) -> str:
    """theta for \\theta, q_1 for q_{1}, var_diff for a word that has another meaning."""
    plain = re.sub(r"[^A-Za-z0-9_]", "", word).strip("_")
    plain = re.sub(r"_+", "_", plain)
    if not _GOOD.fullmatch(plain):
        return "s"
    try:
        return nm.declared_name(plain, "") if plain not in ("e", "E", "I") else f"{plain}_0"
    except InputError:
        return f"var_{plain}"[:40]


def expression(text: str, table: Table) -> Any:
    """A formula of a result."""
    with refusals.longer_texts(LONGER):
        return to_sympy(reader.read_formula(text, table.of_formulas()), table.leaf)


def with_integrals(table: Table, integrals: Mapping[str, Any]) -> Table:
    """The table with a function F(x) for each integral of an answer; SymPy differentiates it to
    what is known.
    """
    arguments = {name: tuple(part["arguments"]) for name, part in integrals.items()}
    inside = with_letters(table, integrals)
    functions = {
        name: _integral(name, part, arguments[name], inside) for name, part in integrals.items()
    }
    return replace(
        table,
        functions={**table.functions, **functions},
        arguments={**table.arguments, **arguments},
    )


def with_letters(table: Table, integrals: Mapping[str, Any]) -> Table:
    """The table with the variables of functions of one, such as u for G(u), for their
    derivatives.
    """
    moving = {table.time_name, *(name + end for name in table.coordinates for end in ("", "'"))}
    named = {one: sympy.Symbol(one) for part in integrals.values() for one in part["arguments"]}
    letters = {name: symbol for name, symbol in named.items() if name not in moving}
    return replace(table, parameters={**letters, **table.parameters})


def _integral(name: str, part: Mapping[str, Any], arguments: tuple[str, ...], table: Table) -> Any:
    """The class of a function that is known by its derivatives."""

    def fdiff(self: Any, argindex: int = 1) -> Any:
        slope = part["derivatives"].get(arguments[argindex - 1])
        if slope is None:
            return sympy.Function.fdiff(self, argindex)
        formal = [table.symbol(argument) for argument in arguments]
        return expression(slope, table).subs(
            dict(zip(formal, self.args, strict=True)), simultaneous=True
        )

    return type(name, (sympy.Function,), {"fdiff": fdiff, "nargs": len(arguments)})


def relation(text: str, table: Table) -> Any:
    """A condition such as x' != 0; the whole text as a symbol where it is a sentence."""
    for sign, kind in _RELATIONS:
        left, found, right = text.partition(sign)
        if found:
            return kind(expression(left, table), expression(right, table))
    return sympy.Symbol(text)


# The document that is asked, and the objects of its names.
Meant = tuple[dict[str, Any], Table]


@dataclass(frozen=True)
class _Given:
    """Expressions that are zero, what moves in them, and how its velocity is written where not as a
    derivative.

    `pairs`: they are of first order, and of what moves a half, `preferred` where that is given, are
    the coordinates.
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
) -> Meant:
    """The document of a system; InputError if it is ambiguous."""
    if hasattr(system, "form_lagranges_equations"):
        if len(system.coneqs) and system.forcelist:
            raise InputError(
                "This LagrangesMethod has forces and constraints: give its motion, see nonholonomic()."
            )
        if len(system.coneqs):
            return read_lagrangian(
                system._L[0], list(system.coneqs), list(system.q), None, questions
            )
        if system.eom is None or not len(system.eom):
            system.form_lagranges_equations()
        system, coordinates = list(system.eom), list(system.q)
    elif hasattr(system, "kanes_equations"):
        return _of_kane(system, questions)
    elif hasattr(system, "compute_explicit_form"):
        system = _of_states(system)
    if isinstance(system, Mapping):
        system = {_moved(key): value for key, value in system.items()}
    elif (found := _lagrangian(system)) is not None:
        return read_lagrangian(found, (), coordinates, time, questions)
    given = _given(system, coordinates, velocities or {}, time)

    def equations(table: Table, texts: Sequence[str]) -> dict[str, Any]:
        if given.accelerations is None:
            return {"equations": [f"{text} = 0" for text in texts]}
        return {
            "equations": dict(
                zip((table_name(table, x) for x in given.accelerations), texts, strict=True)
            )
        }

    found = _reading(given, equations, questions)
    return _of_pairs(*found, given) if given.pairs else found


def _reading(
    given: _Given,
    keys: Callable[[Table, Sequence[str]], dict[str, Any]],
    questions: Mapping[str, Any],
) -> Meant:
    """The document with these keys of the texts of what is given; terms of an ansatz may be
    expressions.
    """
    table, words = _names(given)
    names = table.of_formulas()

    def text(each: Any) -> str:
        return each if isinstance(each, str) else _written(_expression(each), words, names)

    found: dict[str, Any] = {"coordinates": list(table.coordinates)}
    if table.parameters:
        found["parameters"] = list(table.parameters)
    if table.functions:
        found["functions"] = {name: list(arguments) for name, arguments in table.arguments.items()}
    if table.time_name != "t":
        found["time"] = table.time_name
    found |= keys(table, list(map(text, given.zeros)))
    found |= {key: value for key, value in questions.items() if value is not None}
    if "ansatz" in found:
        found["ansatz"] = list(map(text, found["ansatz"]))
    return found, table


def _moved(key: Any) -> Any:
    """x(t), where the key of an acceleration is x(t).diff(t, 2)."""
    second = (
        isinstance(key, sympy.Derivative)
        and isinstance(key.expr, AppliedUndef)
        and key.derivative_count == 2
    )
    return key.expr if second else key


def _lagrangian(system: Any) -> Any:
    """A single expression with velocities and no accelerations, None for anything else."""
    if not isinstance(system, sympy.Expr):
        return None
    orders = {each.derivative_count for each in _expression(system).atoms(sympy.Derivative)
              if isinstance(each.expr, AppliedUndef) and each.variables[0] in each.expr.args}  # fmt: skip
    return system if orders == {1} else None


def _of_pairs(document: Mapping[str, Any], table: Table, given: _Given) -> Meant:
    """The document of first-order equations x' = h, p' = F, and the objects of the x that its
    reader chooses.
    """
    named = [table_name(table, each) for each in given.preferred]
    whole = {key: value for key, value in document.items() if key != "coordinates"}
    whole |= {"coordinates": named} if named else {}
    chosen = _system_of(whole)[1].coordinates
    return whole, replace(table, coordinates={name: table.coordinates[name] for name in chosen})


def _system_of(document: Mapping[str, Any]) -> tuple[accepting.Prepared, SecondOrderSystem]:
    """The document prepared for its schema, and its system; InputError in the words of the
    document.
    """
    ready = accepting.prepared(document)
    try:
        return ready, accepting.to_system(accepting.to_schema(ready.document))
    except InputError as error:
        raise ready.error(error) from None


def read_lagrangian(
    lagrangian: Any,
    constraints: Sequence[Any],
    coordinates: Sequence[Any] | None,
    time: Any,
    questions: Mapping[str, Any],
) -> Meant:
    """The document of a Lagrangian, with constraints perhaps, which are expressions that are zero,
    or equations.
    """
    zeros = (_expression(lagrangian), *map(_zero, constraints))
    time = time or (_time_of(coordinates) if coordinates else _found_time(zeros))
    given = _Given(zeros, tuple(coordinates or _moving(zeros, time, 1)), {}, time)

    def keys(_: Table, texts: Sequence[str]) -> dict[str, Any]:
        return {"lagrangian": texts[0]} | ({"constraints": texts[1:]} if constraints else {})

    return _reading(given, keys, questions)


def table_name(table: Table, found: Any) -> str:
    """The name of a coordinate."""
    return next(name for name, each in table.coordinates.items() if each == found)


def _of_kane(method: Any, questions: Mapping[str, Any]) -> Meant:
    """Kane's equations M(q, u) u' = F(q, u), with the speeds u(q, q') that follow from q' = h(q,
    u).
    """
    if len(method.u) != len(method.q):
        raise InputError(
            "This KanesMethod has fewer speeds than coordinates: use nonholonomic(L, constraints, q)."
        )
    time, slopes = _time_of(list(method.q)), method.kindiffdict()
    unknown = {u: sympy.Dummy(f"u_{place}") for place, u in enumerate(method.u)}
    rates = [q.diff(time) - slopes[q.diff(time)].xreplace(unknown) for q in method.q]
    solved = sympy.solve(rates, list(unknown.values()), dict=True)
    if len(solved) != 1:
        raise InputError(
            "The speeds of this KanesMethod do not follow from the velocities: choose others."
        )
    speeds = {u: solved[0][unknown[u]] for u in method.u}
    changes = sympy.Matrix([speeds[u].diff(time) for u in method.u])
    zeros = method.mass_matrix.xreplace(speeds) * changes - method.forcing.xreplace(speeds)
    return read(zeros, list(method.q), None, time, questions)


def _of_states(system: Any) -> list[Any]:
    """The equations of first order of a SymbolicSystem, x' = f(x), where need be solved for x'."""
    if system.alg_con:
        raise InputError("This SymbolicSystem has constraints: give L, see nonholonomic().")
    try:
        rates = system.comb_explicit_rhs
    except AttributeError:
        system.compute_explicit_form()
        rates = system.comb_explicit_rhs
    time = _time_of(list(system.states))
    return [sympy.Eq(x.diff(time), rate) for x, rate in zip(system.states, rates, strict=True)]


def _given(
    system: Any, coordinates: Sequence[Any] | None, velocities: Mapping[Any, Any], time: Any
) -> _Given:
    coordinates = [coordinates] if isinstance(coordinates, sympy.Basic) else coordinates
    for each in coordinates or ():
        if not isinstance(each, AppliedUndef | sympy.Symbol):
            raise InputError(
                "a coordinate is not a SymPy object: use the x(t) of the equations.", "/coordinates"
            )
        if isinstance(system, Mapping) and each not in system:
            raise InputError(
                f"{each} has no acceleration: give one for each of the coordinates.", "/coordinates"
            )
    if isinstance(system, Mapping):
        moving = tuple(coordinates or system)
        for each in moving:
            if not isinstance(each, AppliedUndef) and each not in velocities:
                detail = f"{each} is a plain symbol: say which symbol is its velocity, velocities={{{each}: ...}}."
                raise InputError(detail, "/coordinates")
        found = {x: _expression(f) for x, f in system.items()}
        return _Given(tuple(found.values()), moving, velocities, time or _time_of(moving), found)
    zeros = tuple(_zero(each) for each in _listed(system))
    time = time or _found_time(zeros)
    fast, slow = _moving(zeros, time, 2), _moving(zeros, time, 1)
    if slow and not fast and not velocities and set(coordinates or ()) < set(slow):
        return _Given(
            zeros, tuple(slow), velocities, time, pairs=True, preferred=tuple(coordinates or ())
        )
    moving = tuple(coordinates or fast)
    only_first = [] if coordinates else [each for each in slow if each not in moving]
    if only_first:
        detail = (
            f"{only_first[0]} has a first derivative only: name the coordinates, coordinates=[...]."
        )
        raise InputError(detail, "/coordinates")
    if not moving:
        detail = "no function of the time has a second derivative here: name the coordinates, coordinates=[x, y]."
        raise InputError(detail, "/coordinates")
    return _Given(zeros, moving, velocities, time)


def _listed(system: Any) -> list[Any]:
    if not isinstance(system, sympy.Basic | sympy.MatrixBase | str) and isinstance(
        system, Iterable
    ):
        system = list(system)  # a set, a generator, an array
    if isinstance(system, sympy.Equality) and isinstance(system.lhs, sympy.MatrixBase):
        system = system.lhs - system.rhs
    if isinstance(system, sympy.MatrixBase):
        return list(system)
    return list(system) if isinstance(system, Sequence) else [system]


def _zero(equation: Any) -> Any:
    """The expression that an equation says is zero."""
    if isinstance(equation, str):
        detail = "A text occurs among SymPy objects: write all equations as expressions, or all of them as texts."
        raise InputError(detail, "/equations")
    if isinstance(equation, bool | BooleanAtom):
        raise InputError(
            "an equation became True or False: give Eq(a, b, evaluate=False).", "/equations"
        )
    if isinstance(equation, sympy.core.relational.Relational) and not isinstance(
        equation, sympy.Equality
    ):
        raise InputError("a comparison occurs: write an equation, Eq(a, b).", "/equations")
    return _expression(
        equation.lhs - equation.rhs if isinstance(equation, sympy.Equality) else equation
    )


def _expression(value: Any) -> Any:
    """A SymPy expression, derivatives of products and sums carried out; texts are refused and not
    evaluated.
    """
    try:
        found = sympy.sympify(value, strict=True)
    except sympy.SympifyError:
        found = None
    if not isinstance(found, sympy.Expr | sympy.MatrixBase):
        detail = "this is not a SymPy expression: give expressions, or the system as a text or the content of its file."
        raise InputError(detail, "/equations")
    for derivative in found.atoms(sympy.Derivative):
        if not all(count.is_Integer for _, count in derivative.variable_count):
            raise InputError(
                f"the order of {derivative} is not a number: write second derivatives.",
                "/equations",
            )
    return found.replace(
        lambda part: isinstance(part, sympy.Derivative) and not isinstance(part.expr, AppliedUndef),
        lambda part: part.doit(deep=False) if part.expr.has(AppliedUndef) else part,
    )


def _time_of(moving: Sequence[Any]) -> Any:
    found = {
        each.args[0] for each in moving if isinstance(each, AppliedUndef) and len(each.args) == 1
    }
    if len(found) > 1:
        raise InputError(
            "the coordinates depend on different variables: write all of them as functions of one time."
        )
    return found.pop() if found else sympy.Symbol("t")


def _found_time(zeros: Sequence[Any]) -> Any:
    """The variable of the second derivatives of functions of one variable."""
    orders: dict[Any, int] = {}
    for derivative in (each for zero in zeros for each in zero.atoms(sympy.Derivative)):
        by = derivative.variables[0]
        if (
            isinstance(derivative.expr, AppliedUndef)
            and derivative.expr.args == (by,)
            and by.is_Symbol
        ):
            orders[by] = max(orders.get(by, 0), len(derivative.variables))
    found = {by for by, order in orders.items() if order >= 2} or set(orders)
    if not found:
        raise InputError(
            "there is no second derivative: write equations such as Eq(x(t).diff(t, 2), -x(t))."
        )
    if len(found) != 1:
        raise InputError(
            "the derivatives do not show which variable is the time: pass time=t.", "/time"
        )
    return found.pop()


def _moving(zeros: Sequence[Any], time: Any, order: int) -> list[Any]:
    """The functions of the time with a derivative of at least this order, in the order of the
    equations.
    """
    first: dict[Any, int] = {}
    for place, zero in enumerate(zeros):
        for derivative in zero.atoms(sympy.Derivative):
            moving = isinstance(derivative.expr, AppliedUndef) and derivative.expr.args == (time,)
            if moving and derivative.derivative_count >= order:
                first.setdefault(derivative.expr, place)
    return sorted(first, key=lambda each: (first[each], sympy.default_sort_key(each)))


def _names(given: _Given) -> tuple[Table, dict[Any, str]]:
    """Names for all objects in the formulas, and what is written for each of them."""
    velocities = set(given.velocities.values())
    applied = {each for zero in given.zeros for each in zero.atoms(AppliedUndef)} - set(
        given.coordinates
    )
    free = {each for zero in given.zeros for each in zero.free_symbols}
    constants = free - velocities - {given.time} - set(given.coordinates) - _dummies(given.zeros)
    symbols = sorted(constants, key=sympy.default_sort_key)
    classes = sorted({each.func for each in applied}, key=str)
    _refuse_other_motions(given, applied, symbols)
    _refuse_two_of_a_name([*symbols, *([given.time] if given.time in free else []), *classes])
    names = names_for((*given.coordinates, *symbols, *classes))
    time_name = _time_name(given.time, names)
    functions = {names[each]: each for each in classes}
    arguments = {
        names[each]: _formal(each, applied, given, {**names, given.time: time_name})
        for each in classes
    }
    table = Table(
        given.time,
        time_name,
        {names[each]: each for each in given.coordinates},
        {
            names[each]: given.velocities[each]
            for each in given.coordinates
            if each in given.velocities
        },
        {names[each]: each for each in symbols},
        functions,
        arguments,
    )
    words = {**names, given.time: time_name}
    for each in given.coordinates:
        words[table.velocity(names[each])] = f"{names[each]}'"
        if isinstance(each, AppliedUndef):
            words[each.diff(given.time, 2)] = f"{names[each]}''"
    return table, words


def _dummies(zeros: Sequence[Any]) -> set[Any]:
    """The bound variables of Subs."""
    return {
        variable for zero in zeros for each in zero.atoms(sympy.Subs) for variable in each.variables
    }


def _refuse_other_motions(given: _Given, applied: set[Any], symbols: Sequence[Any]) -> None:
    """InputError for x(t - 1), for a second function x with other assumptions, and for a symbol x
    besides x(t).
    """
    moving = {str(each.func): each for each in given.coordinates if isinstance(each, AppliedUndef)}
    for each in sorted(applied, key=str):
        known = moving.get(str(each.func))
        if known is not None and each.func == known.func:
            raise InputError(
                f"{each} occurs together with {known}: only {known} itself is accepted, without a delay.",
                "/equations",
            )
        if known is not None:
            detail = f"two functions are called {known.func} and have other assumptions: use one of them."
            raise InputError(detail, "/coordinates")
    for each in symbols:
        if str(each) in moving:
            detail = f"the symbol {each} occurs together with {moving[str(each)]}: write the function, or rename the symbol."
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
        raise InputError(
            f"{time} is the time and another symbol has its name: rename one of the two.", "/time"
        )
    return wanted


def _formal(
    function: Any, applied: set[Any], given: _Given, names: Mapping[Any, str]
) -> tuple[str, ...]:
    """The names of the arguments of an arbitrary function: the coordinates, and t, that it is
    applied to.
    """
    calls = sorted((each.args for each in applied if each.func == function), key=str)
    size = len(calls[0])
    if any(len(call) != size for call in calls):
        raise InputError(
            f"the function {function} has different numbers of arguments: give it one.",
            "/functions",
        )
    moving = (*given.coordinates, given.time)
    plain = next(
        (call for call in calls if set(call) <= set(moving) and len(set(call)) == size), None
    )
    chosen = plain or moving[:size]
    if len(chosen) < size:
        detail = (
            f"the function {function} has more arguments than there are coordinates, and the time."
        )
        raise InputError(detail, "/functions")
    return tuple(names[each] for each in chosen)


@dataclass(frozen=True)
class Conditions:
    """N, Phi and nabla Phi as n x n matrices, R as an n x n x n array (R[j, k, l] = R^j_kl).

    g is a multiplier only if g Phi and g nabla Phi are symmetric and the cyclic sums of g R vanish.
    `reason` says why one of them is None.
    """

    Phi: Any
    nabla_Phi: Any
    R: Any
    N: Any = None
    reason: str = ""

    def _repr_latex_(self) -> str:
        named = (("N", self.N), (r"\Phi", self.Phi), (r"\nabla\Phi", self.nabla_Phi), ("R", self.R))
        return aligned((name, part) for name, part in named if part is not None)


def helmholtz_conditions(document: Mapping[str, Any], table: Table | None) -> Conditions:
    """The tensors of the system of a document, in the SymPy objects of its names."""
    ready, motion = _system_of(document)
    nodes = ex.distinct_nodes(motion.accelerations)
    steps = [
        node for node in nodes if isinstance(node, ex.Apply) and node.function == functions.STEP
    ]
    with_signs = {
        step: tower.to_kernels(step) for step in steps
    }  # a step has no derivatives, its sign has
    found = conditions(
        replace(
            motion, accelerations=tuple(ex.substitute(f, with_signs) for f in motion.accelerations)
        )
    )
    tensors = {"Phi": found.Phi, "nabla_Phi": found.nabla_Phi, "R": found.R, "N": found.N}
    said = ready.outward(
        {"system": translate.plain_fields(motion), "conditions": translate.texts_of(tensors)}
    )
    return conditions_of_texts(said["conditions"], table or table_of_result(said), found.reason)


def conditions_of_texts(parts: Mapping[str, Any], table: Table, reason: str = "") -> Conditions:
    """The key `conditions` of a result as matrices and arrays; what is None stays so."""

    def converted(part: Any) -> Any:
        return expression(part, table) if isinstance(part, str) else list(map(converted, part))

    Phi, nabla_Phi, N = (
        None if parts.get(key) is None else sympy.ImmutableMatrix(converted(parts[key]))
        for key in ("Phi", "nabla_Phi", "N")
    )
    R = None if parts["R"] is None else sympy.ImmutableDenseNDimArray(converted(parts["R"]))
    return Conditions(Phi, nabla_Phi, R, N, reason)


class Solved(Protocol):
    """An answer whose formulas are SymPy expressions, with the objects of its names and its
    document.
    """

    @property
    def equations(self) -> Mapping[Any, Any]: ...
    @property
    def accelerations(self) -> tuple[Any, ...]: ...
    @property
    def lagrangian(self) -> Any: ...
    @property
    def hamiltonian(self) -> Hamiltonian | None: ...
    @property
    def multiplier(self) -> Any: ...
    @property
    def _table(self) -> Table: ...
    @property
    def _shown(self) -> Mapping[str, Any]: ...
    @property
    def _where(self) -> tuple[str, ...]: ...


def verification(answer: Solved) -> Verification:
    """The residuals of an answer, simplified; ValueError where it has no Lagrangian."""
    lagrangian = answer.lagrangian
    if lagrangian is None:
        raise ValueError("there is no Lagrangian to verify")
    table = answer._table
    pairs = [(table.coordinates[name], table.velocity(name)) for name in table.coordinates]
    plain = {
        each: sympy.Dummy(f"a{place}", real=True)
        for place, pair in enumerate(pairs)
        for each in pair
    }
    back = {dummy: each for each, dummy in plain.items()}
    written, slopes = (
        with_symbols(lagrangian, plain),
        [with_symbols(f, plain) for f in answer.accelerations],
    )

    def residual(q: Any, v: Any) -> Any:
        """d/dt dL/dv - dL/dq along q'' = f, every name held apart from the time."""
        momentum = written.diff(plain[v])
        total = momentum.diff(table.time) - written.diff(plain[q])
        for (name, speed), slope in zip(pairs, slopes, strict=True):
            total += momentum.diff(plain[name]) * plain[speed] + momentum.diff(plain[speed]) * slope
        return sympy.simplify(total.doit()).subs(back)

    return Verification(
        tuple(residual(q, v) for q, v in pairs), _of_hamiltonian(answer, [v for _, v in pairs])
    )


def with_symbols(expression: Any, plain: Mapping[Any, Any]) -> Any:
    """The expression with these symbols, first for derivatives, so that none is left of a
    function.
    """

    def rank(found: Any) -> int:
        return (
            0
            if isinstance(found, sympy.Derivative)
            else 1
            if isinstance(found, AppliedUndef)
            else 2
        )

    for each in sorted(plain, key=rank):
        expression = expression.subs(each, plain[each])
    return expression


def _of_hamiltonian(answer: Solved, velocities: list[Any]) -> Any:
    found = answer.hamiltonian
    if found is None or answer.lagrangian is None:
        return None
    energy = sum(
        (p * v for p, v in zip(found.momenta.values(), velocities, strict=True)), -answer.lagrangian
    )
    written = found.expr if found.implicit else found.expr.subs(dict(found.momenta))
    return sympy.simplify(written - energy)
