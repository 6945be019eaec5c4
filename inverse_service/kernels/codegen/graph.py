"""Formulas as one graph of shared subexpressions: derivatives by sweeps, values in numpy. Nothing
is expanded.

A node is an integer, greater than those of its parts, so that a pass is a loop. Equal nodes are one
node. Sums and products are chains of two, which share their beginnings: n links need O(n) nodes for
L and O(n^2) for its Hessian.

`Graph.gradient` gives all first derivatives of one node in one sweep from it to the leaves;
`Graph.rate` a derivative along a direction in one sweep from the leaves, of several nodes at once.
Source: A. Griewank, A. Walther, Evaluating Derivatives, 2008, chapter 3.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from inverse_service.errors import InputError
from inverse_service.expressions import arrays, calculus, functions, tree as ex

CONSTANT, LEAF, SUM, PRODUCT, NEGATIVE, RECIPROCAL, ROOT, POWER, FUNCTION = range(9)
BINARY = (SUM, PRODUCT, POWER)
BY_SINE = {"tan": ("sin", "cos"), "cot": ("cos", "sin")}  # written so, as a factor cos u may cancel
FOUND_IN_C = frozenset({
    "sin", "cos", "exp", "log", "sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh", "atanh",
})  # fmt: skip
_ARCUS = frozenset({"asin", "acos", "atan", "asinh", "acosh", "atanh"})  # arcsin and so on in numpy
_LARGEST_PRODUCT, _LARGEST_ROOT = 64, 16
_ARGUMENT = ex.Symbol("u")
MOST_PLANS = 64
Key = tuple[int, Any, Any]
Plan = list[tuple[int, list[int]]]


class NotInGraph(InputError):
    """A formula has a name without a leaf, or a function that has no value in double precision."""


@dataclass(slots=True)
class Graph:
    """`keys[k]` is (operation, first part, second part) of node k: the parts of a leaf are its
    place among the inputs, of a constant its number, of a function the argument and the name.
    `masks[k]` has the bits of the leaves below.
    """

    keys: list[Key] = field(default_factory=list)
    masks: list[int] = field(default_factory=list)
    known: dict[Key, int] = field(default_factory=dict)
    read: dict[ex.Expression, int] = field(default_factory=dict)
    plans: dict[tuple[int, ...], Plan] = field(default_factory=dict)

    def _node(self, operation: int, first: Any, second: Any, mask: int) -> int:
        key = operation, first, second
        found = self.known.get(key)
        if found is None:
            found = self.known[key] = len(self.keys)
            self.keys.append(key)
            self.masks.append(mask)
        return found

    def constant(self, value: float) -> int:
        """The node of a number."""
        return self._node(CONSTANT, float(value), None, 0)

    def leaf(self, place: int, mask: int, name: ex.Expression | None = None) -> int:
        """The input at this place, which trees call by the name."""
        found = self._node(LEAF, place, None, mask)
        if name is not None:
            self.read[name] = found
        return found

    def number(self, node: int) -> float | None:
        """The number of a constant; None of another node."""
        operation, first, _ = self.keys[node]
        return first if operation == CONSTANT else None

    def is_zero(self, node: int) -> bool:
        """Whether the node is the constant 0."""
        return self.number(node) == 0.0

    def _split(self, node: int) -> tuple[float, int]:
        """(number, node) whose product it is."""
        operation, first, second = self.keys[node]
        if operation == PRODUCT and (value := self.number(first)) is not None:
            return value, second
        if operation == NEGATIVE:
            value, rest = self._split(first)
            return -value, rest
        return 1.0, node

    def add(self, x: int, y: int) -> int:
        """x + y."""
        a, b = self.number(x), self.number(y)
        if a is not None and b is not None:
            return self.constant(a + b)
        if a == 0.0:
            return y
        if b == 0.0:
            return x
        (m, u), (n, w) = self._split(x), self._split(y)
        if u == w:
            return self.multiply(self.constant(m + n), u)
        x, y = min(x, y), max(x, y)
        return self._node(SUM, x, y, self.masks[x] | self.masks[y])

    def negative(self, x: int) -> int:
        """-x."""
        operation, first, second = self.keys[x]
        if operation == CONSTANT:
            return self.constant(-first)
        if operation == NEGATIVE:
            return int(first)
        if operation == PRODUCT and (value := self.number(first)) is not None:
            return self.multiply(self.constant(-value), second)
        return self._node(NEGATIVE, x, None, self.masks[x])

    def subtract(self, x: int, y: int) -> int:
        """x - y."""
        return self.add(x, self.negative(y))

    def multiply(self, x: int, y: int) -> int:
        """x y; numbers and signs are in front."""
        if self.number(y) is not None:
            x, y = y, x
        if (a := self.number(x)) is not None:
            value, rest = self._split(y)
            b = self.number(rest)
            if b is not None:
                return self.constant(a * value * b)
            a *= value
            if a in (0.0, 1.0, -1.0):
                return self.constant(0.0) if a == 0.0 else rest if a == 1.0 else self.negative(rest)
            return self._node(PRODUCT, self.constant(a), rest, self.masks[rest])
        (m, u), (n, w) = self._split(x), self._split(y)
        if m != 1.0 or n != 1.0:
            return self.multiply(self.constant(m * n), self.multiply(u, w))
        x, y = min(x, y), max(x, y)
        return self._node(PRODUCT, x, y, self.masks[x] | self.masks[y])

    def reciprocal(self, x: int) -> int:
        """1/x."""
        value = self.number(x)
        if value is not None:
            if value == 0.0:
                raise NotInGraph(
                    "A formula of this system divides by 0 for all values of its variables."
                )
            return self.constant(1.0 / value)
        return self._node(RECIPROCAL, x, None, self.masks[x])

    def power(self, x: int, exponent: Fraction | int) -> int:
        """x^exponent: products of x and of its square root where these are few, else the function
        of the C library.
        """
        exponent = Fraction(exponent)
        if exponent.denominator == 1 and abs(exponent) <= _LARGEST_PRODUCT:
            return self._repeated(x, int(exponent))
        if exponent.denominator == 2 and abs(exponent) <= _LARGEST_ROOT:
            return self._repeated(self._root(x), exponent.numerator)
        return self.raised(x, self.constant(float(exponent)))

    def _root(self, x: int) -> int:
        value = self.number(x)
        if value is not None and value >= 0:
            return self.constant(math.sqrt(value))
        return self._node(ROOT, x, None, self.masks[x])

    def _repeated(self, x: int, count: int) -> int:
        if count < 0:
            return self.reciprocal(self._repeated(x, -count))
        found: int | None = None
        while count:
            if count & 1:
                found = x if found is None else self.multiply(found, x)
            count >>= 1
            x = self.multiply(x, x) if count else x
        return self.constant(1.0) if found is None else found

    def raised(self, x: int, exponent: int) -> int:
        """x^y, y a node."""
        return self._node(POWER, x, exponent, self.masks[x] | self.masks[exponent])

    def apply(self, name: str, x: int) -> int:
        """The function of this name of x."""
        if name in BY_SINE:
            above, below = BY_SINE[name]
            return self.multiply(self.apply(above, x), self.reciprocal(self.apply(below, x)))
        if name in functions.RECIPROCALS:
            return self.reciprocal(self.apply(functions.RECIPROCALS[name], x))
        value = self.number(x)
        if value is not None and math.isfinite(found := float(_numpy(name)(value))):
            return self.constant(found)
        return self._node(FUNCTION, x, name, self.masks[x])

    def node(self, tree: ex.Expression) -> int:
        """The node of a tree whose names have leaves; raises NotInGraph."""
        found = self.read.get(tree)
        if found is None:
            found = self.read[tree] = self._read(tree)
        return found

    def _read(self, tree: ex.Expression) -> int:
        match tree:
            case ex.Number(value):
                return self.constant(float(value))
            case ex.Sum(terms):
                return self.total(map(self.node, terms))
            case ex.Product(factors):
                found = self.constant(1.0)
                for factor in factors:
                    found = self.multiply(found, self.node(factor))
                return found
            case ex.Power(base, ex.Number(value)):
                return self.power(self.node(base), value)
            case ex.Power(base, exponent):
                return self.raised(self.node(base), self.node(exponent))
            case ex.Apply(function) if functions.has_no_machine_code(function):
                raise NotInGraph(f"A simulation cannot compute the function {function}.")
            case ex.Apply(function, argument):
                return self.apply(function, self.node(argument))
            case _ if tree == ex.PI:
                return self.constant(math.pi)
        raise NotInGraph(
            f"a formula has no value here: {getattr(tree, 'name', 'a name')} is not given."
        )

    def total(self, nodes: Iterable[int]) -> int:
        """Their sum."""
        found = self.constant(0.0)
        for node in nodes:
            found = self.add(found, node)
        return found

    def slopes(self, node: int) -> list[tuple[int, int]]:
        """(part, derivative of the node by it) of each part."""
        operation, first, second = self.keys[node]
        if operation == SUM:
            one = self.constant(1.0)
            return [(first, one), (second, one)]
        if operation == PRODUCT:
            return [(first, second), (second, first)]
        if operation == NEGATIVE:
            return [(first, self.constant(-1.0))]
        if operation == RECIPROCAL:
            return [(first, self.negative(self.multiply(node, node)))]
        if operation == ROOT:
            return [(first, self.multiply(self.constant(0.5), self.reciprocal(node)))]
        if operation == POWER:
            lower = self.raised(first, self.subtract(second, self.constant(1.0)))
            found = [(first, self.multiply(second, lower))]
            if self.number(second) is None:
                found.append((second, self.multiply(node, self.apply("log", first))))
            return found
        if operation == FUNCTION:
            return [(first, self._derivative(second, first))]
        return []

    def _derivative(self, name: str, argument: int) -> int:
        """f'(argument), from the tree of f'(u)."""
        outer = self.read
        self.read = {_ARGUMENT: argument}
        found = self.node(_derivative_of(name))
        self.read = outer
        return found

    def gradient(self, node: int, mask: int) -> dict[int, int]:
        """{place: derivative of the node} by the leaves with one of these bits, those that are 0
        left out.
        """
        sums, heap, found = {node: self.constant(1.0)}, [-node], dict[int, int]()
        while heap:
            k = -heapq.heappop(heap)
            outer = sums.pop(k)
            if self.is_zero(outer):
                continue
            if self.keys[k][0] == LEAF:
                if self.masks[k] & mask:
                    found[self.keys[k][1]] = outer
                continue
            for part, slope in self.slopes(k):
                if not self.masks[part] & mask:
                    continue
                more = self.multiply(slope, outer)
                if part in sums:
                    sums[part] = self.add(sums[part], more)
                else:
                    sums[part] = more
                    heapq.heappush(heap, -part)
        return found

    def rate(self, nodes: Sequence[int], along: Mapping[int, int]) -> list[int]:
        """The derivatives of the nodes along a direction, {place of a leaf: node}."""
        found: dict[int, int] = {}
        zero = self.constant(0.0)
        for k in self.below(nodes):
            if self.keys[k][0] == LEAF:
                found[k] = along.get(self.keys[k][1], zero)
            elif any(not self.is_zero(found[part]) for part in self.parts(k)):
                pairs = [
                    (part, slope) for part, slope in self.slopes(k) if not self.is_zero(found[part])
                ]
                found[k] = self.total(self.multiply(slope, found[part]) for part, slope in pairs)
            else:
                found[k] = zero
        return [found[node] for node in nodes]

    def moved(self, nodes: Sequence[int], places: Mapping[int, int]) -> list[int]:
        """The nodes with others in the place of leaves, {place: node}."""
        found: dict[int, int] = {}
        for k in self.below(nodes):
            operation, first, second = self.keys[k]
            if operation == LEAF:
                found[k] = places.get(first, k)
            elif operation == CONSTANT:
                found[k] = k
            elif operation == SUM:
                found[k] = self.add(found[first], found[second])
            elif operation == PRODUCT:
                found[k] = self.multiply(found[first], found[second])
            elif operation == POWER:
                found[k] = self.raised(found[first], found[second])
            else:
                found[k] = self._node(operation, found[first], second, self.masks[found[first]])
        return [found[node] for node in nodes]

    def summands(self, node: int) -> list[int]:
        """The terms of a chain of sums."""
        found, stack = list[int](), [node]
        while stack:
            k = stack.pop()
            if self.keys[k][0] == SUM:
                stack += self.parts(k)
            else:
                found.append(k)
        return found

    def parts(self, node: int) -> tuple[int, ...]:
        """The nodes that it is made of."""
        operation, first, second = self.keys[node]
        return (first, second) if operation in BINARY else (first,) if operation > LEAF else ()

    def below(self, nodes: Iterable[int]) -> list[int]:
        """The nodes that these need, themselves included, parts first."""
        seen, stack = set[int](), list(nodes)
        while stack:
            k = stack.pop()
            if k not in seen:
                seen.add(k)
                stack += self.parts(k)
        return sorted(seen)

    def operations(self, nodes: Iterable[int]) -> set[int]:
        """The nodes among those below whose values are computed."""
        return {k for k in self.below(nodes) if self.keys[k][0] > LEAF}

    def is_compilable(self, nodes: Iterable[int]) -> bool:
        """Whether all functions among the nodes below are in the C library."""
        keys = (self.keys[k] for k in self.below(nodes))
        return all(key[2] in FOUND_IN_C for key in keys if key[0] == FUNCTION)

    def values(self, nodes: Sequence[int], inputs: Mapping[int, Any]) -> list[Any]:
        """The values of nodes: of each leaf a number or an array, by its place."""
        found = dict[int, Any]()
        with np.errstate(all="ignore"):
            for k, gone in self._plan(tuple(nodes)):
                found[k] = self._value(k, found, inputs)
                for part in gone:
                    del found[part]
        return [found[node] for node in nodes]

    def _plan(self, nodes: tuple[int, ...]) -> Plan:
        """The nodes in the order in which they are computed, each with those not needed after it."""
        if nodes not in self.plans:
            order, kept = self.below(nodes), set(nodes)
            last = {part: k for k in order for part in self.parts(k)}
            if len(self.plans) >= MOST_PLANS:
                self.plans.clear()
            self.plans[nodes] = [
                (k, [one for one in {*self.parts(k)} if last[one] == k and one not in kept])
                for k in order
            ]
        return self.plans[nodes]

    def _value(self, node: int, found: Mapping[int, Any], inputs: Mapping[int, Any]) -> Any:
        operation, first, second = self.keys[node]
        if operation == CONSTANT:
            return first
        if operation == LEAF:
            return inputs[first]
        x = found[first]
        if operation == SUM:
            return x + found[second]
        if operation == PRODUCT:
            return x * found[second]
        if operation == NEGATIVE:
            return -x
        if operation == RECIPROCAL:
            return np.divide(1.0, x)
        if operation == ROOT:
            return np.sqrt(x)
        return np.power(x, found[second]) if operation == POWER else _numpy(second)(x)


def _numpy(name: str) -> Any:
    if name == functions.STEP:
        return lambda value: np.heaviside(value, np.nan)
    if name in functions.SPECIAL:
        return lambda value: arrays.special_values(name, value)
    return getattr(np, f"arc{name[1:]}" if name in _ARCUS else name)


@cache
def _derivative_of(name: str) -> ex.Expression:
    return calculus.differentiate(ex.Apply(name, _ARGUMENT), _ARGUMENT)


def ordering(size: int, pairs: Collection[tuple[int, int]]) -> list[int]:
    """The place of each row, so that entries at these (row, column) are near the diagonal.

    Source: E. Cuthill, J. McKee, Proc. 24th ACM Conf. (1969) 157, in reverse.
    """
    near: dict[int, set[int]] = {k: set() for k in range(size)}
    for i, j in pairs:
        if i != j:
            near[i].add(j)
            near[j].add(i)
    order, seen = list[int](), set[int]()
    for start in sorted(range(size), key=lambda k: len(near[k])):
        if start in seen:
            continue
        queue = [start]
        seen.add(start)
        for k in queue:
            more = sorted((j for j in near[k] if j not in seen), key=lambda j: len(near[j]))
            seen.update(more)
            queue += more
        order += queue
    places = [0] * size
    for place, k in enumerate(reversed(order)):
        places[k] = place
    return places
