"""Kernels as LLVM IR, scalar or with SIMD lanes, and formulas as straight-line code: every
subexpression once, divisions gathered, powers by products.

sin and cos are the same for one number and for SIMD lanes. Reduction by multiples of pi/2 in three
parts with fused multiply-add (Cody and Waite), then the minimax polynomials of fdlibm on [-pi/4,
pi/4]; beyond |x| = 2^26 and where a lane is not finite, the C library's functions. Error below 1.5
units in the last place.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import symengine

from inverse_service import errors
from inverse_service.expressions import functions
from inverse_service.kernels.codegen.symengine_trees import ONE, Formula

_SINE = (
    1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
    -1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01,
)  # fmt: skip
_COSINE = (
    -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
    2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
)  # fmt: skip
# pi/2 as a sum of three doubles, each nearest to the remainder of the previous ones.
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
_TWO_OVER_PI = 0.6366197723675814
_LARGEST = 67108864.0
HARDLY_EVER = '!0 = !{!"branch_weights", i32 1000000, i32 1}'
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to an integer and shows its last bits

SIGNATURE = "ptr noalias %memory, ptr noalias %weights, ptr noalias %control, ptr noalias %record"
GROUPS = (Path(__file__).parent / "groups.ll").read_text(
    encoding="utf-8"
)  # runs kernel after kernel
# Of numbers, and of counters.
_OPERATIONS = {
    "+": ("fadd", "add nsw"),
    "-": ("fsub", "sub nsw"),
    "*": ("fmul", "mul nsw"),
    "/": ("fdiv", ""),
}
_COMPARISONS = {
    "<": ("fcmp olt", "icmp slt"), "<=": ("fcmp ole", ""), ">": ("fcmp ogt", "icmp sgt"), ">=": ("fcmp oge", ""),
    "==": ("fcmp oeq", "icmp eq"), "!=": ("fcmp une", "icmp ne"),
}  # fmt: skip
_INTRINSICS = frozenset(("sqrt", "exp", "log", "pow", "fabs", "fma"))
_LIBRARY = frozenset(name for name, row in functions.FUNCTION.items() if row.library)
_ROOTS = {symengine.Rational(1, 2): 1, symengine.Rational(3, 2): 3, symengine.Rational(5, 2): 5}
_LARGEST_PRODUCT = 64
_OPERAND, _IS_SLOW, _SLOW = re.compile(r"%t(\d+)"), re.compile("fdiv|call"), 8


def hexadecimal(value: float) -> str:
    """The number as LLVM writes it without loss."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


Kind = Literal["number", "counter"]  # a number or a truth of each lane; a whole number


@dataclass(frozen=True, slots=True, eq=False)
class Value:
    """A number or a truth of each lane, or a counter, in the text of a writer, where its arithmetic
    adds a line.
    """

    writer: LlvmWriter
    text: str
    kind: Kind = "number"

    @property
    def is_counter(self) -> bool:
        return self.kind == "counter"

    def __add__(self, other: Operand) -> Value:
        return self.writer.binary("+", self, other)

    __radd__ = __add__

    def __sub__(self, other: Operand) -> Value:
        return self.writer.binary("-", self, other)

    def __rsub__(self, other: float) -> Value:
        return self.writer.binary("-", other, self)

    def __mul__(self, other: Operand) -> Value:
        return self.writer.binary("*", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Operand) -> Value:
        return self.writer.binary("/", self, other)

    def __rtruediv__(self, other: float) -> Value:
        return self.writer.binary("/", other, self)

    def __lt__(self, other: Operand) -> Value:
        return self.writer.compare("<", self, other)

    def __le__(self, other: Operand) -> Value:
        return self.writer.compare("<=", self, other)

    def __gt__(self, other: Operand) -> Value:
        return self.writer.compare(">", self, other)

    def __ge__(self, other: Operand) -> Value:
        return self.writer.compare(">=", self, other)

    def equals(self, other: Operand) -> Value:
        return self.writer.compare("==", self, other)

    def differs(self, other: Operand) -> Value:
        return self.writer.compare("!=", self, other)

    def __neg__(self) -> Value:
        return self.writer.new(f"fneg {self.writer.type} {self.text}")

    def __abs__(self) -> Value:
        return self.writer.call("fabs", self)

    def __and__(self, other: Value) -> Value:
        return self.writer.new(f"and {self.writer.truth} {self.text}, {other.text}")

    def choose(self, yes: Operand, no: Operand) -> Value:
        """Where it is true `yes`, elsewhere `no`."""
        return self.writer.select(self.writer.truth, self, yes, no)


Operand = Value | float


class LlvmWriter:
    """Writes one function `kernel`; slots are stack variables that LLVM turns into registers."""

    def __init__(self, lanes: int = 1) -> None:
        self.lanes = lanes
        self.type, self.truth = self.wide("double"), self.wide("i1")
        self._slots: dict[str, Kind] = {}
        self.lines: list[str] = []
        self._count, self._depths = 0, [0]
        self.declared: dict[str, str] = {}
        self._contracts = True
        self._uses_sine_cosine = False

    def new(self, text: str, kind: Kind = "number") -> Value:
        self._count += 1
        self.lines.append(f"  %t{self._count} = {text}")
        before = max((self._depths[int(one)] for one in _OPERAND.findall(text)), default=0)
        self._depths.append(before + (_SLOW if _IS_SLOW.match(text) else 1))
        return Value(self, f"%t{self._count}", kind)

    def depth(self, value: Value) -> int:
        """How long the computation of a value takes, in sums and products, one after the other."""
        found = _OPERAND.fullmatch(value.text)
        return self._depths[int(found[1])] if found else 0

    def wide(self, kind: str) -> str:
        """The type of one number for each lane."""
        return kind if self.lanes == 1 else f"<{self.lanes} x {kind}>"

    def _type(self, kind: Kind) -> str:
        return "i64" if kind == "counter" else self.type

    def number(self, value: float) -> str:
        return hexadecimal(value) if self.lanes == 1 else f"splat (double {hexadecimal(value)})"

    def whole(self, value: int) -> str:
        return str(value) if self.lanes == 1 else f"splat (i64 {value})"

    def _text(self, operand: Operand, kind: Kind = "number") -> str:
        return (
            operand.text
            if isinstance(operand, Value)
            else str(operand)
            if kind == "counter"
            else self.number(operand)
        )

    @contextmanager
    def exact(self) -> Iterator[None]:
        """Sums of products that are written here are rounded twice."""
        self._contracts = False
        yield
        self._contracts = True

    def binary(self, operation: str, left: Operand, right: Operand) -> Value:
        counts = any(isinstance(one, Value) and one.is_counter for one in (left, right))
        kind: Kind = "counter" if counts else "number"
        flag = "" if counts else "contract " * self._contracts
        pair = f"{self._text(left, kind)}, {self._text(right, kind)}"
        return self.new(f"{_OPERATIONS[operation][counts]} {flag}{self._type(kind)} {pair}", kind)

    def compare(self, operation: str, left: Value, right: Operand) -> Value:
        name, kind = _COMPARISONS[operation][left.is_counter], self._type(left.kind)
        return self.new(f"{name} {kind} {left.text}, {self._text(right, left.kind)}")

    def select(self, truth: str, condition: Value, yes: Operand, no: Operand) -> Value:
        """`truth` is the type of the condition: "i1" where it is one for all lanes."""
        pair = f"{self.type} {self._text(yes)}, {self.type} {self._text(no)}"
        return self.new(f"select {truth} {condition.text}, {pair}")

    def give(self, kind: str, value: Value) -> None:
        self.lines.append(f"  ret {kind} {value.text}")

    def give_pair(self, first: Value, second: Value) -> None:
        pair = f"{{{self.type}, {self.type}}}"
        half = self.new(f"insertvalue {pair} poison, {self.type} {first.text}, 0").text
        self.give(pair, self.new(f"insertvalue {pair} {half}, {self.type} {second.text}, 1"))

    def call(self, function: str, *arguments: Operand) -> Value:
        """A function of LLVM, as fma(a, b, c) = a b + c rounded once, or of the C library, called
        lane by lane.
        """
        texts = [self._text(argument) for argument in arguments]
        if function in _INTRINSICS:
            name = f"llvm.{function}.{'f64' if self.lanes == 1 else f'v{self.lanes}f64'}"
            self.declared[name] = (
                f"declare {self.type} @{name}({', '.join([self.type] * len(texts))})"
            )
            return self.new(
                f"call {self.type} @{name}({', '.join(f'{self.type} {text}' for text in texts)})"
            )
        self.declared[function] = f"declare double @{function}(double) nounwind memory(none)"
        if self.lanes == 1:
            return self.new(f"call double @{function}(double {texts[0]})")
        result = Value(self, "poison")
        for lane in range(self.lanes):
            part = self.new(f"extractelement {self.type} {texts[0]}, i32 {lane}").text
            value = self.new(f"call double @{function}(double {part})").text
            result = self.new(
                f"insertelement {self.type} {result.text}, double {value}, i32 {lane}"
            )
        return result

    def sine_cosine(self, argument: Value) -> tuple[Value, Value]:
        """(sin, cos) of the argument by our own polynomials, in lanes."""
        self._uses_sine_cosine = True
        kind = f"{{{self.type}, {self.type}}}"
        pair = self.new(f"call {kind} @sine_cosine({self.type} {argument.text})").text
        return self.new(f"extractvalue {kind} {pair}, 0"), self.new(
            f"extractvalue {kind} {pair}, 1"
        )

    def rough_root(self, value: Value, order: int) -> Value:
        """value^(-1/order) to half a percent: the bits of a double are nearly its logarithm."""
        whole, one = self.wide("i64"), 1023 << 52
        bits = self.new(f"bitcast {self.type} {value.text} to {whole}").text
        part = self.new(f"udiv {whole} {bits}, {self.whole(order)}").text
        found = self.new(f"sub {whole} {self.whole(one + one // order)}, {part}").text
        return self.new(f"bitcast {whole} {found} to {self.type}")

    def slot(self, name: str, value: Operand | None = None, kind: Kind = "number") -> None:
        """A new variable, with its first value."""
        self._slots[name] = kind
        if value is not None:
            self[name] = value

    def __getitem__(self, name: str) -> Value:
        kind = self._slots[name]
        return self.new(f"load {self._type(kind)}, ptr %s_{name}", kind)

    def __setitem__(self, name: str, value: Operand) -> None:
        kind = self._slots[name]
        self.lines.append(f"  store {self._type(kind)} {self._text(value, kind)}, ptr %s_{name}")

    def _address(self, array: str, place: int | Value, kind: str) -> str:
        return self.new(
            f"getelementptr {kind}, ptr %{array}, i64 {self._text(place, 'counter')}"
        ).text

    def load(self, array: str, place: int | Value, kind: Kind = "number") -> Value:
        of = self._type(kind)
        return self.new(f"load {of}, ptr {self._address(array, place, of)}, align 8", kind)

    def load_shared(self, array: str, place: Value) -> Value:
        """A number that all lanes share."""
        value = self.new(f"load double, ptr {self._address(array, place, 'double')}, align 8")
        if self.lanes == 1:
            return value
        first = self.new(f"insertelement {self.type} poison, double {value.text}, i32 0").text
        mask = f"<{self.lanes} x i32> zeroinitializer"
        return self.new(f"shufflevector {self.type} {first}, {self.type} poison, {mask}")

    def store(self, array: str, place: int | Value, value: Operand) -> None:
        kind = self._type(value.kind if isinstance(value, Value) else "number")
        self.lines.append(
            f"  store {kind} {self._text(value)}, ptr {self._address(array, place, kind)}, align 8"
        )

    def everywhere(self, condition: Value) -> Value:
        if self.lanes == 1:
            return condition
        name = f"llvm.vector.reduce.and.v{self.lanes}i1"
        self.declared[name] = f"declare i1 @{name}({self.truth})"
        return self.new(f"call i1 @{name}({self.truth} {condition.text})")

    def label(self, name: str) -> None:
        self.jump(name)
        self.open(name)

    def jump(self, name: str) -> None:
        self.lines.append(f"  br label %{name}")

    def branch(
        self, condition: Value, yes: str, no: str, expected: Literal["either", "yes"] = "either"
    ) -> None:
        """To `yes` where the condition holds; `expected`: whether it nearly always does."""
        self.lines.append(
            f"  br i1 {condition.text}, label %{yes}, label %{no}{', !prof !0' if expected == 'yes' else ''}"
        )

    def open(self, name: str) -> None:
        self.lines.append(f"{name}:")

    def text(self) -> str:
        numbers = f"{self.type}, align 64"
        slots = [
            f"  %s_{name} = alloca {'i64' if kind == 'counter' else numbers}"
            for name, kind in self._slots.items()
        ]
        body = "\n".join(["entry:", *slots, *self.lines, "  ret void", "}"])
        declared = dict(self.declared)
        parts = [f"define void @kernel({SIGNATURE}) nounwind {{", body, GROUPS]
        if self._uses_sine_cosine:
            definitions, needs = trigonometric_functions(self.lanes)
            declared.update(needs)
            parts.append(definitions)
        return "\n".join([*declared.values(), *parts, HARDLY_EVER]) + "\n"


@lru_cache(maxsize=8)
def trigonometric_functions(lanes: int) -> tuple[str, dict[str, str]]:
    """(definitions of @sine_cosine, declarations that they need)."""
    near, far = LlvmWriter(lanes), LlvmWriter(lanes)
    kind, pair, x = near.type, f"{{{near.type}, {near.type}}}", Value(near, "%x")
    near.branch(near.everywhere(abs(x) <= _LARGEST), "near", "far", expected="yes")
    near.open("near")
    with near.exact():
        shifted = near.call(
            "fma", x, _TWO_OVER_PI, _ROUND
        )  # the number of quarter turns in its last bits
        turns, rest = -(shifted - _ROUND), x
        for part in _HALF_PI:
            rest = near.call("fma", turns, part, rest)
        square = rest * rest
        sine = near.call("fma", _polynomial(near, _SINE, square), square * rest, rest)
        # 1 - z/2 + z^2 C with the rounding of 1 - z/2 put back.
        half = square * 0.5
        head = 1.0 - half
        lost = (1.0 - head) - half
        cosine = head + near.call("fma", square * square, _polynomial(near, _COSINE, square), lost)
        near.give_pair(*_turned_back(near, shifted, sine, cosine))
    near.open("far")
    near.give(pair, near.new(f"call {pair} @sine_cosine_far({kind} %x)"))
    # The C library's, lane by lane.
    far.give_pair(far.call("sin", Value(far, "%x")), far.call("cos", Value(far, "%x")))
    heads = {
        f"define internal {pair} @sine_cosine({kind} %x) alwaysinline nounwind memory(none) {{": near,
        f"define internal {pair} @sine_cosine_far({kind} %x) noinline cold nounwind memory(none) {{": far,
    }
    text = "\n".join("\n".join([head, *writer.lines, "}"]) for head, writer in heads.items())
    return text, near.declared | far.declared


def _polynomial(w: LlvmWriter, coefficients: tuple[float, ...], variable: Value) -> Operand:
    """Horner's scheme, the highest power first."""
    value: Operand = coefficients[0]
    for coefficient in coefficients[1:]:
        value = w.call("fma", value, variable, coefficient)
    return value


def _turned_back(w: LlvmWriter, shifted: Value, sine: Value, cosine: Value) -> tuple[Value, Value]:
    """(sin, cos) of x: exchanged and with signs by the number of quarter turns."""
    whole = w.wide("i64")
    bits = w.new(f"bitcast {w.type} {shifted.text} to {whole}").text
    odd = w.new(f"trunc {whole} {bits} to {w.truth}")
    found = []
    for shift, even_one, odd_one in ((0, sine, cosine), (1, cosine, sine)):
        high = w.new(
            f"shl {whole} {w.new(f'add {whole} {bits}, {w.whole(shift)}').text}, {w.whole(62)}"
        ).text
        sign = w.new(f"and {whole} {high}, {w.whole(-(2**63))}").text
        raw = w.new(f"bitcast {w.type} {odd.choose(odd_one, even_one).text} to {whole}").text
        found.append(
            w.new(f"bitcast {whole} {w.new(f'xor {whole} {raw}, {sign}').text} to {w.type}")
        )
    return found[0], found[1]


Fraction = tuple[list[Formula], list[Formula]]  # factors, and those of the divisor


class Emitter:
    """Values of formulas already written; `bind` sets the meaning of a name at this place of the
    code.

    Sums and products are written from left to right: first what the loop around them does not
    change, then what most of the formulas share. So those that have parts in common begin alike,
    and what two of them begin with is written once: steps of two links take a tenth more time
    otherwise.
    """

    def __init__(self, writer: LlvmWriter) -> None:
        self.writer = writer
        self._values: dict[Formula, Value] = {}
        self._pairs: dict[tuple[str, str, str], Value] = {}
        self._fixed: frozenset[Formula] = frozenset()  # names that the loop around does not change
        self._counts: Counter[Formula] | None = None  # of the formulas of that loop
        self._shared: Counter[Formula] = Counter()

    def bind(self, name: str, value: Value) -> None:
        self._values[symengine.Symbol(name)] = value

    @contextmanager
    def inner(self) -> Iterator[None]:
        """Code of a loop: what is written inside is forgotten afterwards."""
        kept = dict(self._values), dict(self._pairs), self._fixed, self._counts
        yield
        self._values, self._pairs, self._fixed, self._counts = kept

    def prepare(self, formulas: Sequence[Formula], changing: Iterable[str]) -> None:
        """Write those parts of the formulas of a loop that hold no `changing` names, before it."""
        self.fix(changing)
        self._shared = self._counts = _counted(formulas)
        waiting, known = [*formulas], set[Formula]()
        while waiting:
            formula = waiting.pop()
            if formula in known or not formula.args:
                continue
            known.add(formula)
            if self._stays(formula):
                self._value(formula)
                continue
            parts = [part for part in formula.args if not self._stays(part)]
            if isinstance(formula, symengine.Add):
                signed = self._terms(formula)
                self._total([one for one in signed if self._stays(one[1])])
                parts = [term for _, term in signed if not self._stays(term)]
            elif isinstance(formula, symengine.Mul):
                _, fixed, moving = self._factors(formula)
                self._quotient(*fixed)
                parts = [*moving[0], *moving[1]]
            waiting += parts

    def fix(self, changing: Iterable[str] = ()) -> None:
        """The loop that begins here changes none of the names known so far, but these."""
        names = {formula for formula in self._values if isinstance(formula, symengine.Symbol)}
        self._fixed = frozenset(names.difference(map(symengine.Symbol, changing)))

    def write(self, formulas: Sequence[Formula]) -> list[Value]:
        """The values of the formulas, each part that they share once."""
        self._shared = _counted(formulas) if self._counts is None else self._counts
        return [self._value(formula) for formula in formulas]

    def value(self, formula: Formula) -> Value:
        return self.write([formula])[0]

    def _value(self, formula: Formula) -> Value:
        known = self._values.get(formula)
        if known is None:
            known = self._values[formula] = self._written(formula)
        return known

    def _stays(self, formula: Formula) -> bool:
        """Whether the loop around does not change it."""
        return bool(formula.free_symbols <= self._fixed)

    def _written(self, formula: Formula) -> Value:
        if isinstance(formula, symengine.Add):
            found = self._total(self._terms(formula))
            assert found is not None
            return found
        if isinstance(formula, symengine.Mul):
            turned, fixed, moving = self._factors(formula)
            value = self._quotient(*moving, self._quotient(*fixed))
            assert value is not None
            return -value if turned else value
        if isinstance(formula, symengine.Pow):
            return self._power(*formula.args)
        if not formula.args:
            return self._leaf(formula)
        return self._function(type(formula).__name__.lower(), formula.args[0])

    def _terms(self, formula: Formula) -> list[tuple[bool, Formula]]:
        """The terms of a sum, those that are subtracted with True and without their sign."""
        return [(True, -one) if _is_negative(one) else (False, one) for one in formula.args]

    def _factors(self, formula: Formula) -> tuple[bool, Fraction, Fraction]:
        """Whether a product has the sign -1, its constants in the loop around, and what changes.

        A number, such as 1/sqrt(2), goes with the constants or, without one, to the end; a
        reciprocal that several formulas share is a factor.
        """
        numbers = [one for one in formula.args if not one.free_symbols]
        turned = numbers[:1] == [symengine.Integer(-1)]
        named = [one for one in formula.args if one.free_symbols]
        below = [one for one in named if _is_reciprocal(one) and self._shared[one] < 2]
        parts = [one for one in named if one not in below], [1 / one for one in below]

        def chosen(stays: bool) -> Fraction:
            above, below = ([one for one in part if self._stays(one) == stays] for part in parts)
            return above, below

        fixed, moving = chosen(True), chosen(False)
        (fixed if any(fixed) else moving)[0].extend(numbers[turned:])
        return turned, fixed, moving

    def _total(self, signed: Sequence[tuple[bool, Formula]]) -> Value | None:
        """The sum of these terms: first the constants of the loop around, then what is known first."""
        total: Value | None = None
        values = [(is_negative, term, self._value(term)) for is_negative, term in signed]
        for is_negative, _, value in sorted(
            values, key=lambda one: (not self._stays(one[1]), self._place(*one[1:]), one[0])
        ):
            if total is None:
                total = -value if is_negative else value
            else:
                total = self._pair("-" if is_negative else "+", total, value)
        return total

    def _quotient(
        self, above: Sequence[Formula], below: Sequence[Formula], value: Value | None = None
    ) -> Value | None:
        """The product of the value, where there is one, and of those above, over that of those
        below; in each what is known first comes first.
        """
        divisor: Value | None = None
        for own in self._known_first(above):
            value = own if value is None else self._pair("*", value, own)
        for own in self._known_first(below):
            divisor = own if divisor is None else self._pair("*", divisor, own)
        if divisor is None:
            return value
        return self._pair("/", self._leaf(ONE) if value is None else value, divisor)

    def _known_first(self, factors: Sequence[Formula]) -> list[Value]:
        values = [(factor, self._value(factor)) for factor in factors]
        return [value for _, value in sorted(values, key=lambda one: self._place(*one))]

    def _place(self, formula: Formula, value: Value) -> tuple[int, int]:
        return self.writer.depth(value), -self._shared[formula]

    def _pair(self, operation: str, left: Value, right: Value) -> Value:
        key = operation, left.text, right.text
        if key not in self._pairs:
            self._pairs[key] = self.writer.binary(operation, left, right)
        return self._pairs[key]

    def _leaf(self, formula: Formula) -> Value:
        if isinstance(formula, symengine.Symbol):
            raise KeyError(f"no value is bound to {formula}")
        try:
            return Value(self.writer, self.writer.number(float(formula)))
        except (RuntimeError, TypeError, ValueError) as error:
            detail = "A formula of the simulation has no real value (a root or logarithm below 0)."
            raise errors.InputError(detail) from error

    def _power(self, base: Formula, exponent: Formula) -> Value:
        if isinstance(exponent, symengine.Integer) and abs(int(exponent)) <= _LARGEST_PRODUCT:
            return self._integer_power(base, int(exponent))
        for root, count in _ROOTS.items():
            if exponent in (root, -root):
                value = self.writer.call("sqrt", self._value(base))
                value = value * self._integer_power(base, (count - 1) // 2) if count > 1 else value
                return value if exponent == root else 1.0 / value
        if base == symengine.E:
            return self.writer.call("exp", self._value(exponent))
        return self.writer.call("pow", self._value(base), self._value(exponent))

    def _integer_power(self, base: Formula, exponent: int) -> Value:
        if exponent < 0:
            return 1.0 / self._value(base**-exponent)
        result, square = None, self._value(base)
        while exponent:
            if exponent & 1:
                result = square if result is None else result * square
            exponent >>= 1
            if exponent:
                square = square * square
        return self._leaf(ONE) if result is None else result

    def _function(self, name: str, argument: Formula) -> Value:
        if name in ("sin", "cos"):  # all that is made of them was translated so
            pair = self.writer.sine_cosine(self._value(argument))
            self._values |= zip(
                (symengine.sin(argument), symengine.cos(argument)), pair, strict=True
            )
            return pair[name == "cos"]
        if name in functions.RECIPROCALS:
            return 1.0 / self._function(functions.RECIPROCALS[name], argument)
        if name in _LIBRARY or name == "log":
            return self.writer.call(name, self._value(argument))
        raise errors.InputError(f"A simulation cannot compute the function {name}.")


def _counted(formulas: Sequence[Formula]) -> Counter[Formula]:
    """In how many sums and products of the formulas each term and factor is."""
    found, waiting, known = Counter[Formula](), [*formulas], set[Formula]()
    while waiting:
        formula = waiting.pop()
        if formula in known or not formula.args:
            continue
        known.add(formula)
        parts = formula.args
        if isinstance(formula, symengine.Add):
            parts = [-part if _is_negative(part) else part for part in parts]
        found.update(parts)
        waiting += parts
    return found


def _is_negative(term: Formula) -> bool:
    """Whether the term carries a negative number in front."""
    head = term.args[0] if isinstance(term, symengine.Mul) else term
    return bool(isinstance(head, symengine.Number) and head.is_negative)


def _is_reciprocal(factor: Formula) -> bool:
    if not isinstance(factor, symengine.Pow):
        return False
    exponent = factor.args[1]
    return bool(isinstance(exponent, symengine.Number) and exponent.is_negative)
