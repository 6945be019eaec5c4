"""What is read of all formulas, written down once, so that its atoms can be computed at other
points.

Formulas are read at as many points as they have atoms, to find relations among these and to show
that roots are independent. Most of what is read does not matter there: a sum of ten roots is read
with all its products, but the atoms are those of ten radicands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from itertools import repeat
from typing import TYPE_CHECKING, Any, NamedTuple

from .formulas import Order, read_formulas
from .numbers import Arithmetic, Atom, Balls, Series
from .series import Expansion

if TYPE_CHECKING:
    from .question import Question

Place = int  # of a step on the tape
SMALL = 64  # of exponents of numbers


class Step(NamedTuple):
    """How a value is computed from those of earlier steps, and whether that meets an atom or an
    argument of a function.
    """

    parts: tuple[Place, ...]
    work: Callable[[Expansion, list[Series]], Series]
    meets: bool
    like: tuple[str, Place] | None  # those that are alike meet the same atoms


class Tape:
    """A ring whose values are places of steps; arithmetic that was done before is not done again.

    `needed` are the places, in order, of the steps that meet something and of all that these need.
    """

    degree = 0

    def __init__(self, question: Question) -> None:
        self.question, self.ties = question, list[Place]()
        self.steps, self.table = list[Step](), dict[tuple[Any, ...], Place]()
        self.numbers = dict[Place, Fraction]()  # the constants
        self.multiples = dict[Place, tuple[Place, int]]()  # integer times a step
        self.met = set[str]()  # the names of elementary functions, and "integral"
        self.names = {name: self.named(name) for name in (*sorted(question.names), "pi")}
        self.forces = question.read_all(self)
        question.read(self)
        needed = set[Place]()
        for place in reversed(range(len(self.steps))):
            if self.steps[place].meets or place in needed:
                needed |= {place, *self.steps[place].parts}
        self.needed = sorted(needed)

    def put(
        self,
        parts: Iterable[Place],
        work: Callable[[Expansion, list[Series]], Series],
        *key: Any,
        like: tuple[str, Place] | None = None,
    ) -> Place:
        """The place of a step; without a key it meets something, and is one of its own."""
        step = Step((*parts,), work, not key, like)
        if not key:
            self.steps.append(step)
            return len(self.steps) - 1
        place = self.table.setdefault((*key, step.parts), len(self.steps))
        if place == len(self.steps):
            self.steps.append(step)
        return place

    def named(self, name: str) -> Place:
        return self.put((), lambda ring, _: ring.names[name], "name", name)

    def constant(self, value: Fraction) -> Place:
        place = self.put((), lambda ring, _: ring.constant(value), "constant", value)
        self.numbers[place] = value
        return place

    def add(self, terms: list[Place], weights: Iterable[int] = ()) -> Place:
        """Sums are the same whatever the order of their terms, and x - y is x + (-1) y."""
        pairs = zip(terms, weights or repeat(1), strict=False)
        multiples = [(self.multiples.get(term, (term, 1)), weight) for term, weight in pairs]
        found = sorted((place, times * weight) for (place, times), weight in multiples)
        by = tuple(weight for _, weight in found)
        parts = [place for place, _ in found]
        return self.put(parts, lambda ring, values: ring.add(values, by), "add", by)

    def multiply(self, left: Place, right: Place, degree: int = 0) -> Place:
        one, other = sorted((left, right))
        values = [self.numbers[place] for place in (one, other) if place in self.numbers]
        if len(values) == 2:
            return self.constant(values[0] * values[1])
        place = self.put(
            (one, other), lambda ring, values: ring.multiply(values[0], values[1], 0), "multiply"
        )
        if values and values[0].denominator == 1:
            u = other if one in self.numbers else one
            self.multiples[place] = u, values[0].numerator
        return place

    def power(self, u: Place, exponent: int) -> Place:
        if self.numbers.get(u) and abs(exponent) <= SMALL:
            return self.constant(self.numbers[u] ** exponent)
        return self.put(
            (u,), lambda ring, values: ring.power(values[0], exponent), "power", exponent
        )

    def elementary(self, name: str, u: Place) -> Place:
        self.met.add(name)
        return self.put((u,), lambda ring, values: ring.elementary(name, values[0]), like=(name, u))

    def function(self, name: str, orders: tuple[int, ...], arguments: list[Place]) -> Place:
        return self.put(arguments, lambda ring, values: ring.function(name, orders, values))

    def special(self, name: str, arguments: list[Place], order: Order) -> Place:
        return self.put(arguments, lambda ring, values: ring.special(name, values, order))

    def integral(self, name: str, orders: list[int], arguments: list[Place]) -> Place:
        """Its given derivatives are read like all else, as they may hold atoms that were met."""
        self.met.add("integral")
        known = self.question.integrals[name]
        read_formulas(self, known.slopes.values(), **known.bound(name, orders, arguments))
        return self.put(arguments, lambda ring, values: ring.integral(name, orders, values))


class Replay(Expansion):
    """The numbers of the needed steps of a tape at a point."""

    def __init__(self, arithmetic: Arithmetic, tape: Tape) -> None:
        self.tape = tape
        super().__init__(arithmetic, 0)

    def slope_of_integral(self, slope: tuple[str, ...], **bound: Series) -> Series:
        """Nothing: it is read by other steps, and the value of the function does not depend on it."""
        return {}

    def read(self) -> None:
        self.ties, self.forces, self.rates = list[Series](), list[Series](), list[Series]()
        known: dict[Place, Series] = {}
        met: dict[tuple[str, Place], tuple[Place, list[Atom]]] = {}
        trace = self.arithmetic.trace if isinstance(self.arithmetic, Balls) else None
        self.question.check_time(len(self.tape.needed))
        for place in self.tape.needed:
            step = self.tape.steps[place]
            if trace is not None and step.like in met:
                first, atoms = met[step.like]
                known[place] = known[first]
                trace += atoms
                continue
            begun = len(trace or ())
            known[place] = step.work(self, [known[part] for part in step.parts])
            if trace is not None and step.like:
                met[step.like] = place, trace[begun:]
