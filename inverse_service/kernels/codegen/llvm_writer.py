"""Kernels as LLVM IR, scalar or with SIMD lanes, and formulas as straight-line code: every subexpression once,
divisions gathered, powers by products.

sin and cos are the same for one number and for SIMD lanes. Reduction by multiples of pi/2 in three parts with fused
multiply-add (Cody and Waite), then the minimax polynomials of fdlibm on [-pi/4, pi/4]; beyond |x| = 2^26 and where a
lane is not finite, the C library's functions. Error below 1.5 units in the last place.
"""

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

import symengine

from inverse_service import errors
from inverse_service.expressions import derivative
from inverse_service.kernels.codegen.symengine_trees import Formula

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
GROUPS = (Path(__file__).parent / "groups.ll").read_text(encoding="utf-8")  # runs kernel after kernel
_OPERATIONS = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
_INTRINSICS = frozenset(("sqrt", "exp", "log", "pow"))
_LIBRARY = frozenset(("sinh", "cosh", "tanh", "asin", "acos", "atan", "asinh", "acosh", "atanh"))
_ROOTS = {symengine.Rational(1, 2): 1, symengine.Rational(3, 2): 3, symengine.Rational(5, 2): 5}
_LARGEST_PRODUCT = 64


def hexadecimal(value: float) -> str:
    """The number as LLVM writes it without loss."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class LlvmWriter:
    """Writes one function `kernel`; slots are stack variables that LLVM turns into registers."""

    def __init__(self, lanes: int = 1) -> None:
        self.lanes = lanes
        self.type, self.truth = self.wide("double"), self.wide("i1")
        self._slots: list[str] = []
        self.lines: list[str] = []
        self._count = 0
        self.declared: dict[str, str] = {}
        self._uses_sine_cosine = False

    def new(self, text: str) -> str:
        self._count += 1
        self.lines.append(f"  %t{self._count} = {text}")
        return f"%t{self._count}"

    def wide(self, kind: str) -> str:
        """The type of one number for each lane."""
        return kind if self.lanes == 1 else f"<{self.lanes} x {kind}>"

    def number(self, value: float) -> str:
        return hexadecimal(value) if self.lanes == 1 else f"splat (double {hexadecimal(value)})"

    def whole(self, value: int) -> str:
        return str(value) if self.lanes == 1 else f"splat (i64 {value})"

    def fma(self, a: str, b: str, c: str) -> str:
        """a b + c, rounded once."""
        return self._intrinsic("fma", a, b, c)

    def give(self, kind: str, value: str) -> None:
        self.lines.append(f"  ret {kind} {value}")

    def give_pair(self, first: str, second: str) -> None:
        pair = f"{{{self.type}, {self.type}}}"
        half = self.new(f"insertvalue {pair} poison, {self.type} {first}, 0")
        self.give(pair, self.new(f"insertvalue {pair} {half}, {self.type} {second}, 1"))

    def binary(self, operation: str, left: str, right: str, exact: bool = False) -> str:
        flag = "" if exact else "contract "
        return self.new(f"{_OPERATIONS[operation]} {flag}{self.type} {left}, {right}")

    def negate(self, value: str) -> str:
        return self.new(f"fneg {self.type} {value}")

    def absolute(self, value: str) -> str:
        return self._intrinsic("fabs", value)

    def _suffix(self) -> str:
        return "f64" if self.lanes == 1 else f"v{self.lanes}f64"

    def _intrinsic(self, function: str, *arguments: str) -> str:
        name = f"llvm.{function}.{self._suffix()}"
        self.declared[name] = f"declare {self.type} @{name}({', '.join([self.type] * len(arguments))})"
        return self.new(f"call {self.type} @{name}({', '.join(f'{self.type} {a}' for a in arguments)})")

    def call(self, function: str, *arguments: str) -> str:
        if function in _INTRINSICS:
            return self._intrinsic(function, *arguments)
        self.declared[function] = f"declare double @{function}(double) nounwind memory(none)"
        (argument,) = arguments
        if self.lanes == 1:
            return self.new(f"call double @{function}(double {argument})")
        result = "poison"
        for lane in range(self.lanes):
            part = self.new(f"extractelement {self.type} {argument}, i32 {lane}")
            value = self.new(f"call double @{function}(double {part})")
            result = self.new(f"insertelement {self.type} {result}, double {value}, i32 {lane}")
        return result

    def sine_cosine(self, argument: str) -> tuple[str, str]:
        """(sin, cos) of the argument by our own polynomials, in lanes."""
        self._uses_sine_cosine = True
        pair = self.new(f"call {{{self.type}, {self.type}}} @sine_cosine({self.type} {argument})")
        kind = f"{{{self.type}, {self.type}}}"
        return self.new(f"extractvalue {kind} {pair}, 0"), self.new(f"extractvalue {kind} {pair}, 1")

    def rough_root(self, value: str, order: int) -> str:
        """value^(-1/order) to half a percent: the bits of a double are nearly its logarithm."""
        whole, one = self.wide("i64"), 1023 << 52
        bits = self.new(f"bitcast {self.type} {value} to {whole}")
        part = self.new(f"udiv {whole} {bits}, {self.whole(order)}")
        found = self.new(f"sub {whole} {self.whole(one + one // order)}, {part}")
        return self.new(f"bitcast {whole} {found} to {self.type}")

    def compare(self, operation: str, left: str, right: str) -> str:
        name = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "==": "oeq", "!=": "une"}[operation]
        return self.new(f"fcmp {name} {self.type} {left}, {right}")

    def both(self, left: str, right: str) -> str:
        return self.new(f"and {self.truth} {left}, {right}")

    def select(self, condition: str, yes: str, no: str) -> str:
        return self.new(f"select {self.truth} {condition}, {self.type} {yes}, {self.type} {no}")

    def choose(self, condition: str, yes: str, no: str) -> str:
        """As `select`, by a condition on counters, which is one for all lanes."""
        return self.new(f"select i1 {condition}, {self.type} {yes}, {self.type} {no}")

    def slot(self, name: str) -> None:
        self._slots.append(f"  %s_{name} = alloca {self.type}, align 64")

    def read(self, name: str) -> str:
        return self.new(f"load {self.type}, ptr %s_{name}")

    def write(self, name: str, value: str) -> None:
        self.lines.append(f"  store {self.type} {value}, ptr %s_{name}")

    def counter(self, name: str) -> None:
        self._slots.append(f"  %n_{name} = alloca i64")

    def read_counter(self, name: str) -> str:
        return self.new(f"load i64, ptr %n_{name}")

    def write_counter(self, name: str, value: str) -> None:
        self.lines.append(f"  store i64 {value}, ptr %n_{name}")

    def add_counters(self, left: str, right: str) -> str:
        return self.new(f"add nsw i64 {left}, {right}")

    def multiply_counters(self, left: str, right: str) -> str:
        return self.new(f"mul nsw i64 {left}, {right}")

    def compare_counters(self, operation: str, left: str, right: str) -> str:
        name = {"<": "slt", ">=": "sge", "==": "eq", ">": "sgt"}[operation]
        return self.new(f"icmp {name} i64 {left}, {right}")

    def _address(self, array: str, place: int | str) -> str:
        return self.new(f"getelementptr {self.type}, ptr %{array}, i64 {place}")

    def load(self, array: str, place: int | str) -> str:
        address = self._address(array, place)
        return self.new(f"load {self.type}, ptr {address}, align 8")

    def load_shared(self, array: str, place: str) -> str:
        address = self.new(f"getelementptr double, ptr %{array}, i64 {place}")
        value = self.new(f"load double, ptr {address}, align 8")
        if self.lanes == 1:
            return value
        first = self.new(f"insertelement {self.type} poison, double {value}, i32 0")
        mask = f"<{self.lanes} x i32> zeroinitializer"
        return self.new(f"shufflevector {self.type} {first}, {self.type} poison, {mask}")

    def store(self, array: str, place: int | str, value: str) -> None:
        address = self._address(array, place)
        self.lines.append(f"  store {self.type} {value}, ptr {address}, align 8")

    def load_counter(self, array: str, place: int) -> str:
        address = self.new(f"getelementptr i64, ptr %{array}, i64 {place}")
        return self.new(f"load i64, ptr {address}, align 8")

    def store_counter(self, array: str, place: int, value: str) -> None:
        address = self.new(f"getelementptr i64, ptr %{array}, i64 {place}")
        self.lines.append(f"  store i64 {value}, ptr {address}, align 8")

    def everywhere(self, condition: str) -> str:
        if self.lanes == 1:
            return condition
        name = f"llvm.vector.reduce.and.v{self.lanes}i1"
        self.declared[name] = f"declare i1 @{name}({self.truth})"
        return self.new(f"call i1 @{name}({self.truth} {condition})")

    def label(self, name: str) -> None:
        self.lines += [f"  br label %{name}", f"{name}:"]

    def jump(self, name: str) -> None:
        self.lines.append(f"  br label %{name}")

    def branch(self, condition: str, yes: str, no: str, rare: bool = False) -> None:
        """To `yes` where the condition holds; `rare` says that it hardly ever does not."""
        self.lines.append(f"  br i1 {condition}, label %{yes}, label %{no}{', !prof !0' if rare else ''}")

    def open(self, name: str) -> None:
        self.lines.append(f"{name}:")

    def text(self) -> str:
        body = "\n".join(["entry:", *self._slots, *self.lines, "  ret void", "}"])
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
    kind, pair = near.type, f"{{{near.type}, {near.type}}}"
    small = near.compare("<=", near.absolute("%x"), near.number(_LARGEST))
    near.branch(near.everywhere(small), "near", "far", rare=True)
    near.open("near")
    shifted, rest = _reduced(near)
    near.give_pair(*_turned_back(near, shifted, *_on_the_first_octant(near, rest)))
    near.open("far")
    near.give(pair, near.new(f"call {pair} @sine_cosine_far({kind} %x)"))
    far.give_pair(far.call("sin", "%x"), far.call("cos", "%x"))  # the C library's, lane by lane
    heads = {
        f"define internal {pair} @sine_cosine({kind} %x) alwaysinline nounwind memory(none) {{": near,
        f"define internal {pair} @sine_cosine_far({kind} %x) noinline cold nounwind memory(none) {{": far,
    }
    text = "\n".join("\n".join([head, *writer.lines, "}"]) for head, writer in heads.items())
    return text, near.declared | far.declared


def _reduced(w: LlvmWriter) -> tuple[str, str]:
    """(number of quarter turns in its last bits, what they leave of x)."""
    shifted = w.fma("%x", w.number(_TWO_OVER_PI), w.number(_ROUND))
    turns, rest = w.negate(w.binary("-", shifted, w.number(_ROUND), exact=True)), "%x"
    for part in _HALF_PI:
        rest = w.fma(turns, w.number(part), rest)
    return shifted, rest


def _on_the_first_octant(w: LlvmWriter, rest: str) -> tuple[str, str]:
    """(sin, cos) of the remainder by the polynomials."""
    square = w.binary("*", rest, rest, exact=True)
    sine = w.fma(_polynomial(w, _SINE, square), w.binary("*", square, rest, exact=True), rest)
    # 1 - z/2 + z^2 C with the rounding of 1 - z/2 put back.
    half = w.binary("*", square, w.number(0.5), exact=True)
    head = w.binary("-", w.number(1.0), half, exact=True)
    lost = w.binary("-", w.binary("-", w.number(1.0), head, exact=True), half, exact=True)
    tail = w.fma(w.binary("*", square, square, exact=True), _polynomial(w, _COSINE, square), lost)
    return sine, w.binary("+", head, tail, exact=True)


def _polynomial(w: LlvmWriter, coefficients: tuple[float, ...], variable: str) -> str:
    """Horner's scheme, the highest power first."""
    value = w.number(coefficients[0])
    for coefficient in coefficients[1:]:
        value = w.fma(value, variable, w.number(coefficient))
    return value


def _turned_back(w: LlvmWriter, shifted: str, sine: str, cosine: str) -> tuple[str, str]:
    """(sin, cos) of x: exchanged and with signs by the number of quarter turns."""
    whole = w.wide("i64")
    bits = w.new(f"bitcast {w.type} {shifted} to {whole}")
    odd = w.new(f"trunc {whole} {bits} to {w.truth}")
    found = []
    for shift, even_one, odd_one in ((0, sine, cosine), (1, cosine, sine)):
        high = w.new(f"shl {whole} {w.new(f'add {whole} {bits}, {w.whole(shift)}')}, {w.whole(62)}")
        sign = w.new(f"and {whole} {high}, {w.whole(-(2**63))}")
        raw = w.new(f"bitcast {w.type} {w.select(odd, odd_one, even_one)} to {whole}")
        found.append(w.new(f"bitcast {whole} {w.new(f'xor {whole} {raw}, {sign}')} to {w.type}"))
    return found[0], found[1]


class Emitter:
    """Values of formulas already written; `bind` sets the meaning of a name at this place of the code."""

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
            raise errors.InputError(
                "A formula of the simulation has no real value (a root or logarithm below 0)."
            ) from error

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
        if name in derivative.RECIPROCALS and name != "cot":
            return self._reciprocal(self._function(derivative.RECIPROCALS[name], argument))
        if name in _LIBRARY:
            return self.writer.call(name, self._value(argument))
        raise errors.InputError(f"A simulation cannot compute the function {name}.")

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
