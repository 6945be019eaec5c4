"""Formulas as straight-line code: every subexpression once, divisions gathered, powers by products."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import symengine

from inverse_service.errors import InputError
from inverse_service.expressions.functions import RECIPROCALS
from inverse_service.kernels.codegen.llvm_writer import LlvmWriter
from inverse_service.kernels.codegen.symengine_trees import Formula

_LIBRARY = frozenset(("sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh", "atanh"))
_ROOTS = {symengine.Rational(1, 2): 1, symengine.Rational(3, 2): 3, symengine.Rational(5, 2): 5}
_LARGEST_PRODUCT = 64


class Emitter:
    """Values of formulas already written; `bind` says what a name stands for at this place of the code."""

    def __init__(self, writer: LlvmWriter) -> None:
        self.writer = writer
        self._values: dict[Formula, str] = {}
        self._pairs: dict[Formula, tuple[str, str]] = {}

    def bind(self, name: str, value: str) -> None:
        self._values[symengine.Symbol(name)] = value

    @contextmanager
    def inner(self) -> Iterator[None]:
        """Code of a loop: what is written inside is forgotten afterwards."""
        values, pairs = dict(self._values), dict(self._pairs)
        yield
        self._values, self._pairs = values, pairs

    def forget(self, names: Sequence[str]) -> None:
        """Drop all values that depend on the names, which are about to change."""
        gone = {symengine.Symbol(name) for name in names}
        self._values = {f: v for f, v in self._values.items() if not (f.free_symbols & gone)}
        self._pairs = {f: v for f, v in self._pairs.items() if not (f.free_symbols & gone)}

    def write(self, formulas: Sequence[Formula]) -> list[str]:
        """The values of the formulas, common parts found first."""
        replaced, reduced = symengine.cse(list(formulas))
        return self._write_reduced(replaced, reduced)

    def _write_reduced(self, replaced: Sequence[tuple[Formula, Formula]], reduced: Sequence[Formula]) -> list[str]:
        # Shared parts get their full meaning back as key, so that later calls find them again.
        meaning: dict[Formula, Formula] = {}
        for name, part in replaced:
            full = part.subs(meaning) if meaning else part
            value = self._values.get(full) or self._value(part)
            meaning[name] = full
            self._values[full] = value
            self._values[name] = value
        found = [self._value(formula) for formula in reduced]
        for name, _ in replaced:
            del self._values[name]
        self._forget_local([name for name, _ in replaced])
        return found

    def _forget_local(self, names: Sequence[Formula]) -> None:
        if names:
            self.forget([str(name) for name in names])

    def value(self, formula: Formula) -> str:
        return self.write([formula])[0]

    def _value(self, formula: Formula) -> str:
        known = self._values.get(formula)
        if known is None:
            known = self._values[formula] = self._written(formula)
        return known

    def _written(self, formula: Formula) -> str:
        if isinstance(formula, symengine.Add):
            return self._sum(formula.args)
        if isinstance(formula, symengine.Mul):
            return self._product(formula.args)
        if isinstance(formula, symengine.Pow):
            return self._power(*formula.args)
        if not formula.args:
            return self._leaf(formula)
        return self._function(type(formula).__name__.lower(), formula.args[0])

    def _leaf(self, formula: Formula) -> str:
        if isinstance(formula, symengine.Symbol):
            raise KeyError(f"no value is bound to {formula}")
        try:
            return self.writer.number(float(formula))
        except (RuntimeError, TypeError, ValueError) as error:
            raise InputError("A formula of the simulation has no real value (a root or logarithm below 0).") from error

    def _sum(self, terms: Sequence[Formula]) -> str:
        plus = [term for term in terms if not _is_negative(term)]
        minus = [-term for term in terms if _is_negative(term)]
        total = self._chain("+", plus) if plus else self.writer.negate(self._value(minus.pop(0)))
        for term in minus:
            total = self.writer.binary("-", total, self._value(term))
        return total

    def _product(self, factors: Sequence[Formula]) -> str:
        above = [f for f in factors if not _is_reciprocal(f)]
        below = [1 / f for f in factors if _is_reciprocal(f)]
        if above[:1] == [symengine.Integer(-1)]:
            rest = above[1:]
            value = self._chain("*", rest) if rest else self.writer.number(1.0)
            value = self.writer.negate(value)
        else:
            value = self._chain("*", above) if above else self.writer.number(1.0)
        return self.writer.binary("/", value, self._chain("*", below)) if below else value

    def _chain(self, operation: str, parts: Sequence[Formula]) -> str:
        value = self._value(parts[0])
        for part in parts[1:]:
            value = self.writer.binary(operation, value, self._value(part))
        return value

    def _power(self, base: Formula, exponent: Formula) -> str:
        if isinstance(exponent, symengine.Integer) and abs(int(exponent)) <= _LARGEST_PRODUCT:
            return self._integer_power(base, int(exponent))
        for root, count in _ROOTS.items():
            if exponent in (root, -root):
                value = self._times(self.writer.call("sqrt", self._value(base)), base, (count - 1) // 2)
                return value if exponent == root else self._reciprocal(value)
        if base == symengine.E:
            return self.writer.call("exp", self._value(exponent))
        return self.writer.call("pow", self._value(base), self._value(exponent))

    def _times(self, value: str, base: Formula, count: int) -> str:
        return self.writer.binary("*", value, self._integer_power(base, count)) if count else value

    def _reciprocal(self, value: str) -> str:
        return self.writer.binary("/", self.writer.number(1.0), value)

    def _integer_power(self, base: Formula, exponent: int) -> str:
        if exponent < 0:
            return self._reciprocal(self._value(base**-exponent))
        result, square = "", self._value(base)
        while exponent:
            if exponent & 1:
                result = self.writer.binary("*", result, square) if result else square
            exponent >>= 1
            if exponent:
                square = self.writer.binary("*", square, square)
        return result

    def _function(self, name: str, argument: Formula) -> str:
        special: Mapping[str, Callable[[], str]] = {
            "sin": lambda: self._sine_cosine(argument)[0],
            "cos": lambda: self._sine_cosine(argument)[1],
            "tan": lambda: self.writer.binary("/", *self._sine_cosine(argument)),
            "cot": lambda: self.writer.binary("/", self._sine_cosine(argument)[1], self._sine_cosine(argument)[0]),
            "log": lambda: self.writer.call("log", self._value(argument)),
            "abs": lambda: self.writer.absolute(self._value(argument)),
        }
        if name in special:
            return special[name]()
        if name in RECIPROCALS and name != "cot":
            return self._reciprocal(self._function(RECIPROCALS[name], argument))
        if name in _LIBRARY:
            return self.writer.call(name, self._value(argument))
        raise InputError(f"A simulation cannot compute the function {name}.")

    def _sine_cosine(self, argument: Formula) -> tuple[str, str]:
        known = self._pairs.get(argument)
        if known is None:
            known = self._pairs[argument] = self.writer.sine_cosine(self._value(argument))
        return known


def _is_negative(term: Formula) -> bool:
    """Whether the term carries a negative number in front."""
    head = term.args[0] if isinstance(term, symengine.Mul) else term
    return bool(isinstance(head, symengine.Number) and head.is_negative)


def _is_reciprocal(factor: Formula) -> bool:
    if not isinstance(factor, symengine.Pow):
        return False
    exponent = factor.args[1]
    return bool(isinstance(exponent, symengine.Number) and exponent.is_negative)
