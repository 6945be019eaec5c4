"""A program run in symbols: names, assignments, the program's own functions, and what it states."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from inverse_service import errors
from inverse_service.expressions import calculus, tree as ex
from inverse_service.reading import names as nm
from inverse_service.reading.scripts import nodes as nd, values as vs
from inverse_service.reading.scripts.nodes import Initial, names_of, walk
from inverse_service.reading.scripts.values import Value

_MOST_STEPS = 20_000
_MOST_NODES = 6_000
_MOST_DEEP = 12
_MOST_POWER = 64
_MOST_BITS = 2_000
_MOST_WORK = 1_000_000  # nodes that are counted in all
SOLUTION = "a solution"  # which is not looked for; its equations are
# What programs call the step of time, which goes to 0.
STEPS = ("dt", "Dt", "DT", "dT", "del_t", "delt", "delta_t", "deltat", "deltaT", "delta_T", "Deltat", "timestep", "time_step",
    "tstep", "stepsize", "step_size", "tau_step", "h")  # fmt: skip
_CHANGING = frozenset(("append", "extend", "insert", "pop", "remove", "clear", "reverse", "sort",
    "update", "setdefault", "push", "push_back", "unshift", "shift", "splice", "fill"))  # fmt: skip
_BY_REFERENCE = (
    "Python",
    "Sage",
    "JavaScript",
    "C",
    "Julia",
    "Go",
)  # b = a gives a list a second name
_GLOBAL = ("JavaScript", "C", "Go", "Mathematica", "Maxima")  # a function sets names around it


_WITH_LAST = ("MATLAB", "Julia", "R", "Fortran")  # y(1:3) has three entries
# Letters that are numbers; in Maxima only those with % are, I may be a moment of inertia
_OF_E = {"Mathematica": ("E",), "Maxima": ("%e",), "Python": ("E",), "Sage": ("E",)}
_IMAGINARY = {"Maxima": ("%i",)} | dict.fromkeys(("Mathematica", "Maple", "Python", "Sage"), ("I",))


@dataclass(frozen=True, slots=True)
class Dialect:
    """What differs between languages where a program is run."""

    name: str
    first: int = 0  # the first place of an array
    whole_quotients: bool = False  # 1/2 is 0
    from_end: bool = False  # y[-1] is the last entry
    free_functions: bool = False  # x(t) moves without a declaration
    function_names: bool = False  # x alone is x(t) where x(t) is declared
    time_before: bool = False  # the argument before the state is the time, whatever its name is
    time_first: bool = False  # the first argument of a function of rates is the time
    functions_first: bool = False  # functions are known before the line in which they stand


@dataclass(slots=True)
class Stated:
    """What a program comes to: a Lagrangian with its coordinates, and forces beside it; equations;
    names that are differentiated by.
    """

    lagrangians: list[tuple[ex.Expression, list[str], list[ex.Expression]]] = field(
        default_factory=list
    )
    equations: list[vs.Equation] = field(default_factory=list)
    rates: dict[str, ex.Expression] = field(default_factory=dict)
    solved: dict[str, ex.Expression] = field(default_factory=dict)  # is zero, solved for q''
    by: set[str] = field(default_factory=set)
    calls: dict[str, list[tuple[Any, ...]]] = field(default_factory=dict)
    read_names: set[str] = field(default_factory=set)
    declared: set[str] = field(default_factory=set)
    steps: frozenset[str] = frozenset()  # the name of the step of time, where loops add
    # None for a function that is made in several scopes.
    closures: dict[nd.Function, vs.Closure | None] = field(default_factory=dict)
    # The program passes other values than the default ones, clears a name, or has a mass matrix.
    overrides: bool = False
    mass: Value = None  # M of M y' = f(t, y)
    # The numbers of rules beside equations that keep the letters: g of {...} /. g -> 9.81
    aside: dict[str, ex.Number] = field(default_factory=dict)
    # Each loop, with the names before it.
    loops: list[tuple[nd.Block, dict[str, Value]]] = field(default_factory=list)


# What a call, or a member of a value, comes to.
Evaluate = Callable[["Machine", nd.Node], Value]


class Machine:
    """A program in the course of being run."""

    def __init__(self, dialect: Dialect, time: str, evaluate: Evaluate) -> None:
        self.dialect, self.time, self.evaluate = dialect, time, evaluate
        self.names: dict[str, Value] = {}
        self.moving: dict[str, None] = {}
        self.raw: dict[str, str] = {}
        self.stated = Stated()
        self.order = 0  # of the step up to which values count, within a step of a loop
        self.steps = self.depth = self.work = 0

    # -- names

    def clean(self, text: str, at: int = 0) -> str:
        """The name as the answer writes it."""
        if text == self.time:
            return "t"
        plain = text.strip().strip("$").strip("\\").rstrip("_'").replace("{", "").replace("}", "")
        plain = _with_words_for_dots(plain)
        try:
            name = nm.declared_name(plain.lstrip("_"), "")
        except errors.InputError:
            raise nd.NotRead(f"the name {text[:20]}", at) from None
        if self.raw.setdefault(name, plain) != plain:
            raise nd.NotRead(f"two names that are both written {name}", at)
        return name

    def symbol(self, text: str, at: int = 0) -> ex.Expression:
        if text == "<step>":
            return vs.STEP
        if text in ("pi", "Pi", "PI", "%pi", "M_PI", "\u03c0"):
            return ex.PI
        if text in _OF_E.get(self.dialect.name, ()):
            return ex.Apply("exp", ex.ONE)
        if text in _IMAGINARY.get(self.dialect.name, ()):
            raise nd.NotRead("the imaginary unit", at)
        name = self.clean(text, at)
        return ex.TIME if name == "t" else ex.Symbol(name)

    def mover(self, name: str, at: int = 0) -> ex.Symbol:
        """The coordinate with this name, as `clean` gives it."""
        if name == "t":
            raise nd.NotRead("a time that moves", at)
        self.moving[name] = None
        return ex.Symbol(name)

    @contextmanager
    def inside(
        self, names: dict[str, Value], around: dict[str, Value] | None = None
    ) -> Iterator[None]:
        """Within a function the names around it (where it was written) are known, and its own are
        forgotten after it.
        """
        kept, self.names = self.names, {**(self.names if around is None else around), **names}
        self.depth += 1
        try:
            if self.depth > _MOST_DEEP:
                raise nd.NotRead("functions that call each other too deeply")
            yield
        finally:
            self.names, self.depth = kept, self.depth - 1

    # -- statements

    def run(self, body: Sequence[nd.Node]) -> Value | None:
        """Run statements until one returns; a statement that cannot be evaluated makes the names
        that it sets unknown.
        """
        for one in body:
            if isinstance(one, nd.Block) and _returns(one):
                raise nd.Trap("a function that returns under a condition", one.at)
            if isinstance(one, nd.Stop):
                raise nd.Trap(one.what, one.at)
            if isinstance(one, nd.Return):
                return None if one.value is None else self.value(one.value)
            self.statement(one)
        return None

    def statement(self, one: nd.Node) -> None:
        if isinstance(one, nd.Function):
            self.names[one.name] = self.closure(one)
        elif isinstance(one, nd.Assign):
            self.assign(one)
        elif isinstance(one, nd.Block):
            if one.is_loop and not self.order:
                self.stated.loops.append((one, dict(self.names)))
            for name in set_in(one.body):  # run neither once nor as often as the program does
                self.names[name] = nd.Trap("a name set in a loop or under a condition", one.at)
        else:
            try:
                if (name := _changed_by(one)) and isinstance(one, nd.Call):
                    self.change(name, one)
                    return
                found = self.value(one)
            except nd.NotRead as error:
                self.poison(one, error)
                return
            parts = found if isinstance(found, list) else [found]  # Thread[{u, v} == {a, b}]
            self.stated.equations += [each for each in parts if isinstance(each, vs.Equation)]

    def closure(self, function: nd.Function) -> vs.Closure:
        """A function with the names around it: of a handle of MATLAB, and of f[x_] = ..., with
        their values of this place.
        """
        keeps = function.keeps_values or (self.dialect.name == "MATLAB" and not function.name)
        found = vs.Closure(function, {**self.names} if keeps else self.names)
        known = self.stated.closures.setdefault(function, found)
        if known is None or known.names is not found.names:
            self.stated.closures[function] = None
        return found

    def change(self, name: str, one: nd.Call) -> None:
        """items.append(x), and the other methods that change a list in place."""
        held, method = self.names.get(name), one.function
        known = isinstance(method, nd.Member) and method.name in ("append", "push")
        if known and isinstance(held, list) and len(one.arguments) == 1:
            self.refuse_shared(name, held, one.at)
            self.names[name] = type(held)([*held, self.value(one.arguments[0])])
        elif held is not None:
            self.names[name] = nd.Trap("a list that is changed in place", one.at)

    def refuse_shared(self, name: str, held: Value, at: int) -> None:
        """Trap for a list that has another name, too, by which it changes as well."""
        if self.dialect.name not in _BY_REFERENCE:
            return
        others = [
            other
            for other, value in self.names.items()
            if other != name and any(part is held for part in (value, *(vs.listed(value) or ())))
        ]
        if others:
            error = nd.Trap("a list with two names that is changed in place", at)
            self.names |= dict.fromkeys((name, *others), error)
            raise error

    def poison(self, one: nd.Node, error: nd.NotRead) -> None:
        """A program with an equation that cannot be evaluated has no system."""
        if not isinstance(error, Initial) and error.what != SOLUTION and _states(one):
            self.names.setdefault("<unread>", error)

    def assign(self, one: nd.Assign) -> None:
        try:
            value = self.value(one.value)
            if one.sign:
                value = self.binary(one.sign, self.value(one.target), value, one.at)
        except nd.NotRead as error:
            for name in names_of(one.target):
                self.names[name] = vs.STEP if name in self.stated.steps else error
            self.poison(one.value, error)
            return
        try:
            self.set(one.target, value)
        except nd.NotRead as error:
            for name in names_of(one.target):
                self.names[name] = error

    def set(self, target: nd.Node, value: Value) -> None:
        match target:
            case nd.Name(text=name):
                if name in self.stated.steps and isinstance(value, vs.TREES):
                    value = vs.STEP
                if self.order and isinstance(value, (*vs.TREES, list, vs.Matrix)):
                    value = vs.each(value, lambda tree: vs.cut(tree, self.order))
                self.small(value, target.at)
                self.names[name] = value
                self.note_entry(name, value)
            case nd.Items(items=items):
                self.unpack(items, value)
            case nd.Index(base=base, places=[nd.Slice(first=None, last=None)]):
                self.set(base, value)
            case nd.Index(base=base, places=[place, nd.Slice(first=None, last=None)]):
                self.set(nd.Index(target.at, base, (place,)), value)
            case nd.Index(base=nd.Name(text=name), places=[nd.Slice() as cut]):
                self.set_part(name, cut, value, target.at)
            case nd.Index(base=nd.Name(text=name), places=places):
                self.set_entry(name, [self.place(place) for place in places], value, target.at)
            case nd.Member(base=nd.Name(text=owner), name=name) if self.dialect.name == "MATLAB":
                held = self.names.get(owner, vs.Struct({}))
                if not isinstance(held, vs.Struct):
                    raise nd.NotRead("a part of a value that is set", target.at)
                self.names[owner] = vs.Struct({**held.parts, name: value})
            case nd.Member(base=base, name=name):
                setter = getattr(self.value(base), "assign", None)
                if setter is None:
                    raise nd.NotRead("a part of a value that is set", target.at)
                setter(name, value)
            case nd.Call(function=nd.Name(text=name), arguments=[nd.Name(text=by)]) if (
                by == self.time
            ):
                self.set(nd.Name(target.at, name), value)  # f(t) = ... of MATLAB
            case nd.Call(
                function=nd.Name(text="Subscript"),
                arguments=[nd.Name(text=base), nd.Constant(value=below) | nd.Name(text=below)],
            ):
                self.set(nd.Name(target.at, f"{base}_{below}"), value)
            case nd.Call(function=nd.Name(text=name), arguments=arguments):
                self.set(nd.Index(target.at, nd.Name(target.at, name), arguments), value)
            case _:
                raise nd.Trap("a part of a value that is set", target.at)

    def set_entry(self, name: str, places: Sequence[int], value: Value, at: int) -> None:
        """name[place] = value, and name[row, column] = value."""
        held = self.names.get(name)
        if isinstance(held, nd.NotRead):
            return
        if isinstance(held, vs.Array):
            self.refuse_shared(name, held, at)
        if isinstance(held, vs.Array) or held is None:
            held = self.names[name] = vs.Filled()
        elif isinstance(held, vs.Filled) and self.dialect.name not in _BY_REFERENCE:
            held = self.names[name] = replace(held, entries={**held.entries})
        if isinstance(held, vs.Filled) and len(places) == 1:
            held.entries[places[0]] = value
            return
        numbers = [place - self.dialect.first for place in places]
        self.refuse_shared(name, held, at)
        if isinstance(held, vs.Matrix):
            rows, width = [list(row) for row in held.rows], len(held.rows[0])
            row, entry = numbers if len(numbers) == 2 else (numbers[0], 0)
            if len(numbers) == 1 and len(rows) == 1:
                row, entry = 0, numbers[0]
            vector = width == 1 or len(rows) == 1
            if (len(numbers) == 2 or vector) and row in range(len(rows)) and entry in range(width):
                rows[row][entry] = value
                self.names[name] = vs.Matrix(tuple(map(tuple, rows)))
                return
        elif isinstance(held, list) and len(numbers) == 1 and numbers[0] in range(len(held)):
            kept = [*held]
            kept[numbers[0]] = value
            self.names[name] = type(held)(kept)
            return
        self.names[name] = nd.Trap("an entry that is set", at)

    def set_part(self, name: str, cut: nd.Slice, value: Value, at: int) -> None:
        """name[first:last] = values, as many as there are places; Trap where this is not known."""
        first = self.dialect.first if cut.first is None else self.place(cut.first)
        entries, held = vs.listed(value), vs.listed(self.names.get(name))
        if cut.last is not None:
            stop = self.place(cut.last) + (self.dialect.name in _WITH_LAST)
        else:
            stop = self.dialect.first + len(held or ())
        if entries is None or first < self.dialect.first or stop - first != len(entries):
            raise nd.Trap("a part of a value that is set", at)
        for place, entry in enumerate(entries, first):
            self.set_entry(name, [place], entry, at)

    def forget(self, names: Iterable[str]) -> None:
        """From here on these names are letters."""
        for name in [*names]:
            self.stated.overrides |= self.names.pop(name, None) is not None

    def note_entry(self, name: str, value: Value) -> None:
        """x = y[0] gives the entry its name."""
        for held in self.names.values():
            if isinstance(held, vs.Array) and isinstance(value, ex.Symbol):
                for place, entry in held.entries.items():
                    if entry == value:
                        held.named.setdefault(place, name)

    def unpack(self, items: Sequence[nd.Node], value: Value) -> None:
        if isinstance(value, vs.Array):
            for place, item in enumerate(items, value.first):
                self.set(item, value.entry(place))
            return
        entries = vs.listed(value)
        if entries is None or len(entries) != len(items):
            raise nd.NotRead("a list of another length", items[0].at if items else 0)
        for item, entry in zip(items, entries, strict=True):
            self.set(item, entry)

    def small(self, value: Value, at: int) -> None:
        entries = vs.listed(value)
        if entries is not None:
            for entry in entries:
                self.small(entry, at)
        elif isinstance(value, vs.TREES):
            for count, _ in enumerate(ex.walk(value)):
                self.work += 1
                if count > _MOST_NODES or self.work > _MOST_WORK:
                    raise nd.NotRead("a formula that is too long", at)

    # -- expressions

    def value(self, one: nd.Node) -> Value:
        self.steps += 1
        if self.steps > _MOST_STEPS:
            raise nd.NotRead("a program that is too long", one.at)
        try:
            return self._value(one)
        except nd.NotRead as error:
            if not error.at:
                error.at = one.at
            raise
        except (errors.InputError, ValueError, ArithmeticError):
            raise nd.NotRead("a value that is not defined", one.at) from None
        except (IndexError, KeyError, TypeError, AttributeError):
            raise nd.NotRead("a call with other arguments than are known", one.at) from None

    def _value(self, one: nd.Node) -> Value:
        match one:
            case nd.Constant(value=str() as text):
                return text
            case nd.Constant(value=number):
                return ex.number(number)
            case nd.Name():
                return self.named(one)
            case nd.Binary(sign=sign, left=left, right=right):
                return self.binary_node(sign, left, right, one.at)
            case nd.Unary(sign="-", operand=operand):
                return vs.multiplied(ex.MINUS_ONE, self.value(operand))
            case nd.Unary(sign="'", operand=nd.Name(text=name)) if self.dialect.name == "Maple":
                self.forget([name])
                return self.symbol(name, one.at)
            case nd.Unary(sign="'", operand=operand):
                return self.value(operand)
            case nd.Items(items=items, is_matrix=is_matrix):
                found = self.items(items)
                if self.dialect.name in ("Python", "Sage", "JavaScript", "C"):
                    return vs.Plain(found)
                return _matrix(found) if is_matrix else found
            case nd.Function():
                return self.closure(one)
            case nd.Primed(operand=operand, order=order):
                return self.primed(self.value(operand), order)
            case nd.Index(
                base=nd.Member(base=nd.Name(text="hy" | "heyoka" as module), name="par"),
                places=[nd.Constant(value=number)],
            ) if module not in self.names:
                return self.symbol(f"par_{number}", one.at)
            case nd.Index(base=base, places=places):
                return self.entry(self.value(base), places)
            case nd.Member() | nd.Call():
                return self.evaluate(self, one)
        raise nd.NotRead("a statement within a formula", one.at)

    def items(self, items: Sequence[nd.Node]) -> list[Value]:
        """The values in a list; of a set of equations without those that are initial values."""
        found: list[Value] = []
        initial: Initial | None = None
        for item in items:
            try:
                found.append(self.value(item))
            except Initial as error:
                initial = error
        if initial and not (found and all(isinstance(one, vs.Equation) for one in found)):
            raise initial
        return found

    def named(self, one: nd.Name) -> Value:
        if one.text in self.names:
            held = self.names[one.text]
            self.stated.read_names.add(one.text)
            if isinstance(held, nd.NotRead):
                raise type(held)(held.what, held.at)
            if isinstance(held, vs.Moving) and self.dialect.function_names:
                return self.mover(held.name, one.at)
            return held
        return self.symbol(one.text, one.at)

    def primed(self, value: Value, order: int) -> Value:
        if isinstance(value, vs.Matrix):
            return value.transposed()
        if isinstance(value, ex.Symbol) and self.dialect.name == "MATLAB":
            return value
        return vs.Derived(value, order)

    def entry(self, value: Value, places: Sequence[nd.Node]) -> Value:
        """value[place], value[row, column], or value[first:last]."""
        if len(places) == 1 and isinstance(places[0], nd.Slice):
            return self.part(value, places[0])
        if len(places) == 1 and isinstance(places[0], nd.Constant):
            word = places[0].value
            if isinstance(word, str) and isinstance(value, vs.Array) and not value.entries:
                return self.symbol(word, places[0].at)  # params["m"]
        if isinstance(value, vs.Matrix) and any(isinstance(place, nd.Slice) for place in places):
            return self.block(value, places)
        if isinstance(value, vs.Array) and len(places) == 2:  # z(1, :), of states side by side
            kept = [place for place in places if place != nd.Slice(place.at, None, None)]
            if len(kept) == 1:
                return self.entry(value, kept)
        if isinstance(value, vs.Array) and len(places) == 1:
            number = self.place(places[0])
            if number < self.dialect.first:  # from the end of an array of unknown length
                raise nd.Trap("an entry that is counted from the end")
            return value.entry(number)
        if isinstance(value, vs.Filled) and len(places) == 1:
            found = value.entry(self.place(places[0]))
            if found is None:
                raise nd.NotRead("an entry that has no value")
            return found
        numbers = [self.place(place) - self.dialect.first for place in places]
        if isinstance(value, vs.TREES) and not isinstance(value, ex.Symbol) and not any(numbers):
            return value  # of a 1 by 1 matrix
        if isinstance(value, vs.Matrix) and len(numbers) == 2:
            row, entry = numbers
            if row in range(len(value.rows)) and entry in range(len(value.rows[0])):
                return value.rows[row][entry]
        if isinstance(value, vs.Matrix):
            value = value.entries
        for number in numbers:
            entries = vs.listed(value)
            from_end = self.dialect.from_end and entries is not None and number < 0
            number += len(entries or ()) if from_end else 0
            if entries is None or number not in range(len(entries)):
                raise nd.NotRead("an entry that is not there")
            value = entries[number]
        return value

    def block(self, value: vs.Matrix, places: Sequence[nd.Node]) -> Value:
        """M(:, 2), M(1:2, :) of MATLAB, and M[0, :]."""
        if len(places) != 2:
            raise nd.NotRead("a part of a matrix")
        chosen = []
        for place, count in zip(places, (len(value.rows), len(value.rows[0])), strict=True):
            every = [*range(count)]
            if isinstance(place, nd.Slice):
                chosen.append(self.part(every, place))
            else:
                chosen.append([every[self.place(place) - self.dialect.first]])
        rows, columns = chosen
        return vs.Matrix(tuple(tuple(value.rows[k][j] for j in columns) for k in rows))

    def part(self, value: Value, cut: nd.Slice) -> Value:
        """y[:2] and y[2:], halves of a state whose length is not given."""
        ends = [None if end is None else self.place(end) for end in (cut.first, cut.last)]
        start = (ends[0] or self.dialect.first) if ends[0] is not None else self.dialect.first
        stop = ends[1]
        if self.dialect.name in _WITH_LAST and stop is not None:
            stop += 1
        if isinstance(value, vs.Array):
            if stop is None:  # as many as before it
                stop = 2 * start - self.dialect.first
            if not 0 < stop - start <= 32:
                raise nd.NotRead("a part of an array")
            found = [value.entry(place) for place in range(start, stop)]
            return vs.column(found) if self.dialect.name == "MATLAB" else found
        entries = vs.listed(value)
        if entries is None:
            raise nd.NotRead("a part of something that is no list")
        first = self.dialect.first
        found = entries[start - first : None if stop is None else stop - first]
        return vs.column(found) if isinstance(value, vs.Matrix) else found

    def place(self, node: nd.Node) -> int:
        number = self.value(node)
        if not isinstance(number, ex.Number) or number.value.denominator != 1:
            raise nd.NotRead("an entry without a number", node.at)
        return int(number.value)

    def binary_node(self, sign: str, left: nd.Node, right: nd.Node, at: int) -> Value:
        if sign == "//":  # of two whole numbers, which C rounds
            found = self.binary("/", self.value(left), self.value(right), at)
            if self.dialect.whole_quotients and not _is_whole(found):
                raise nd.Trap(f"a quotient of whole numbers, which {self.dialect.name} rounds", at)
            return found
        if sign in ("->", "=>"):
            return vs.Rule(self.value(left), self.value(right))
        if sign == "$":
            return [self.value(left)] * self.place(right)
        return self.binary(sign, self.value(left), self.value(right), at)

    def binary(self, sign: str, left: Value, right: Value, at: int) -> Value:
        found = self.combined(sign, left, right, at)
        if isinstance(found, ex.Number) and found.value.numerator.bit_length() > _MOST_BITS:
            raise nd.NotRead("a number that is too large", at)
        if isinstance(found, vs.TREES):
            self.small(found, at)
        return found

    def combined(self, sign: str, left: Value, right: Value, at: int) -> Value:
        if sign in ("==", "=", "~"):
            return self.equation(left, right)
        if isinstance(left, vs.Equation) or isinstance(right, vs.Equation):
            raise nd.NotRead("arithmetic with an equation", at)
        if isinstance(left, vs.Operator):
            return _of_operator(sign, left, right, at)
        match sign:
            case "+":
                return vs.added(left, right)
            case "-":
                return vs.added(left, right, -1)
            case "*":
                return vs.multiplied(left, right)
            case "@":
                return vs.dot(left, right)
            case "/":
                return vs.multiplied(left, ex.power(vs.scalar(right), ex.MINUS_ONE))
            case "\\":
                return vs.solved(left, right)
            case ".":
                both = isinstance(left, vs.Matrix) and isinstance(right, vs.Matrix)
                return vs.multiplied(left, right) if both else vs.dot(left, right)
            case "**" | "^":
                return vs.each(left, lambda base: self.power(base, vs.scalar(right)))
            case ".*":
                return self.entrywise(left, right)
        raise nd.NotRead(f"the sign {sign}", at)

    def entrywise(self, left: Value, right: Value) -> Value:
        one, other = vs.listed(left), vs.listed(right)
        if one is None or other is None:
            return vs.multiplied(left, right)
        if len(one) != len(other):
            raise nd.NotRead("a product of lists of two lengths")
        found = [vs.multiplied(a, b) for a, b in zip(one, other, strict=True)]
        return vs.column(found) if isinstance(left, vs.Matrix) else found

    def power(self, base: ex.Expression, exponent: ex.Expression) -> ex.Expression:
        if isinstance(exponent, ex.Number) and abs(exponent.value) > _MOST_POWER:
            raise nd.NotRead("a power that is too high")
        if isinstance(base, ex.Number) and isinstance(exponent, ex.Number):
            bits = max(base.value.numerator.bit_length(), base.value.denominator.bit_length())
            if bits * abs(exponent.value) > _MOST_BITS:
                raise nd.NotRead("a number that is too large")
        return ex.power(base, exponent)

    def equation(self, left: Value, right: Value) -> Value:
        one, other = vs.listed(left), vs.listed(right)
        if one is not None:
            if other is not None and len(other) != len(one):
                raise nd.NotRead("an equation of lists of two lengths")
            if other is None and right != ex.ZERO and self.dialect.name != "MATLAB":
                raise nd.NotRead("an equation of a list and a number")
            pairs = zip(one, other if other is not None else [right] * len(one), strict=True)
            return [self.equation(a, b) for a, b in pairs]
        if isinstance(left, vs.Equation) and right == ex.ZERO:  # functionalDerivative(f, u) == 0
            return left
        if isinstance(right, vs.Equation):  # a[0] == b[0] == 0
            raise nd.NotRead("an equation of an equation")
        return vs.Equation(vs.scalar(left), vs.scalar(right))

    # -- functions

    def call(
        self,
        closure: vs.Closure,
        arguments: Sequence[Value],
        keywords: Sequence[tuple[str, Value]] = (),
    ) -> Value:
        """What a function of the program returns."""
        function = closure.function
        given = dict(zip(function.parameters, arguments, strict=False))
        for name, value in keywords:
            if name not in function.parameters or name in given:
                raise nd.NotRead(f"the argument {name}", function.at)
            given[name] = value
        last = function.parameters[len(function.parameters) - len(function.defaults) :]
        for name, node in zip(last, function.defaults, strict=True):
            if name not in given:
                given[name] = self.default(node)
        if len(arguments) > len(function.parameters) or {*given} != {*function.parameters}:
            raise nd.NotRead("a function with another number of arguments", function.at)
        self.note_changes(closure)
        with self.inside(given, closure.names):
            found = self.run(function.body)
            if found is None and len(function.results) == 1:
                found = self.named(nd.Name(function.at, function.results[0]))
        if found is None:
            raise nd.NotRead("a function that returns nothing", function.at)
        return found

    def default(self, node: nd.Node) -> Value:
        """The value of a parameter that is not given; a name may have had another value before."""
        if any(isinstance(one, nd.Name) for one in walk(node)):
            raise nd.Trap("a default value that is no number", node.at)
        return self.value(node)

    def note_changes(self, closure: vs.Closure) -> None:
        """A name around a function that it sets is not known after it."""
        if self.dialect.name not in _GLOBAL or closure.function.keeps_values:
            return
        body, own = closure.function.body, {*closure.function.parameters}
        sets = [each for node in body for each in walk(node) if isinstance(each, nd.Assign)]
        own |= {name for one in sets if one.declares for name in names_of(one.target)}
        for one in sets:
            for name in names_of(one.target):
                if name not in own and name in closure.names:
                    what = "a function that changes names around it"
                    closure.names[name] = nd.Trap(what, one.at)
                    if name in self.names:  # of the function that calls it
                        self.names[name] = nd.Trap(what, one.at)

    def in_time(self, value: Value, times: int = 1) -> Value:
        """The derivative by the time."""

        def once(tree: ex.Expression) -> ex.Expression:
            self.small(tree, 0)
            return calculus.differentiate_in_time(tree, self.moving)

        for _ in range(times):
            value = vs.each(value, once)
        return value


_DOTS = {"\u0307": "dot", "\u0308": "ddot"}


def _with_words_for_dots(name: str) -> str:
    """xdot for a name with a dot above it."""
    if name.isascii():
        return name
    parts = unicodedata.normalize("NFD", name)
    marks = [_DOTS[sign] for sign in parts if sign in _DOTS]
    if len(marks) != 1:
        return name
    return "".join(sign for sign in parts if sign not in _DOTS) + marks[0]


def _of_operator(sign: str, left: vs.Operator, right: Value, at: int) -> Value:
    """D^2 and D*D."""
    if sign in ("^", "**") and _is_whole(right):
        return replace(left, times=left.times * int(right.value))
    if sign == "*" and isinstance(right, vs.Operator) and right.by == left.by:
        return replace(left, times=left.times + right.times)
    raise nd.NotRead("arithmetic with an operator", at)


def _is_whole(value: Value) -> bool:
    return isinstance(value, ex.Number) and value.value.denominator == 1


def _states(one: nd.Node) -> bool:
    """Whether an equation is written in a statement, or a Lagrangian with forces is given."""
    for node in walk(one):
        function = node.function if isinstance(node, nd.Call) else None
        name = function.text if isinstance(function, nd.Name) else ""
        name = function.name if isinstance(function, nd.Member) else name
        if name in ("Eq", "Equal", "LagrangesMethod", "KanesMethod") or (
            isinstance(node, nd.Binary) and node.sign in ("==", "~")
        ):
            return True
    return False


def _returns(one: nd.Node) -> bool:
    """Whether a block returns from the function that it is in."""
    if isinstance(one, nd.Block):
        return any(map(_returns, one.body))
    return isinstance(one, nd.Return)


def set_in(body: Sequence[nd.Node]) -> list[str]:
    """The names that statements set, or change in place."""
    found: list[str] = []
    for inner in (inner for one in body for inner in walk(one)):
        if isinstance(inner, nd.Assign):
            found += names_of(inner.target)
        elif isinstance(inner, nd.Function):
            found.append(inner.name)
        elif name := _changed_by(inner):
            found.append(name)
    return found


def _changed_by(one: nd.Node) -> str:
    """items of items.append(x), which changes the list in place."""
    match one:
        case nd.Call(function=nd.Member(base=base, name=method)) if method in _CHANGING:
            return next(iter(names_of(base)), "")
        case nd.Call(function=nd.Name(text="AppendTo" | "PrependTo"), arguments=[base, _]):
            return next(iter(names_of(base)), "")
    return ""


def _block(part: Value) -> vs.Matrix:
    if isinstance(part, vs.Filled):
        part = part.as_matrix() or part
    return part if isinstance(part, vs.Matrix) else vs.Matrix(((part,),))


def _matrix(rows: list[Value]) -> vs.Matrix:
    """[a b; c d] of MATLAB, whose parts may be vectors."""
    whole: list[tuple[Value, ...]] = []
    for row in rows:
        blocks = [_block(part) for part in row]
        heights = {len(block.rows) for block in blocks}
        if len(heights) != 1:
            raise nd.NotRead("a matrix whose parts do not fit")
        whole += [
            tuple(entry for block in blocks for entry in block.rows[k])
            for k in range(heights.pop())
        ]
    if len({len(row) for row in whole}) > 1:
        raise nd.NotRead("a matrix whose rows have two lengths")
    return vs.Matrix(tuple(whole))
