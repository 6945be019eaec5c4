"""Kernels as LLVM IR, scalar or with SIMD lanes.

sin and cos as LLVM IR, the same for one number and for SIMD lanes.

Reduction by multiples of pi/2 in three parts with fused multiply-add (Cody and Waite), then the minimax polynomials
of fdlibm on [-pi/4, pi/4]; beyond |x| = 2^26 and where a lane is not finite, the C library's functions. Error below
1.5 units in the last place.
"""

from __future__ import annotations

import struct
from functools import lru_cache

_SINE = (
    1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
    -1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01,
)  # fmt: skip
_COSINE = (
    -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
    2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
)  # fmt: skip
# pi/2 as a sum of three doubles, each the nearest to what the ones before leave.
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
_TWO_OVER_PI = 0.6366197723675814
_LARGEST = 67108864.0
HARDLY_EVER = '!0 = !{!"branch_weights", i32 1000000, i32 1}'
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to an integer and shows its last bits


class _Lines:
    """The lines of a function over `lanes` doubles, written one after another."""

    def __init__(self, lanes: int) -> None:
        self.lanes, self.lines = lanes, list[str]()
        self.kind, self.whole, self.truth = (
            name if lanes == 1 else f"<{lanes} x {name}>" for name in ("double", "i64", "i1")
        )
        self.suffix = "f64" if lanes == 1 else f"v{lanes}f64"

    def real(self, value: float) -> str:
        text = f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"
        return text if self.lanes == 1 else f"splat (double {text})"

    def integer(self, value: int) -> str:
        return str(value) if self.lanes == 1 else f"splat (i64 {value})"

    def new(self, name: str, text: str) -> str:
        self.lines.append(f"  %{name} = {text}")
        return f"%{name}"

    def operation(self, name: str, operator: str, a: str, b: str) -> str:
        return self.new(name, f"{operator} {self.kind} {a}, {b}")

    def fma(self, name: str, a: str, b: str, c: str) -> str:
        return self.new(
            name, f"call {self.kind} @llvm.fma.{self.suffix}({self.kind} {a}, {self.kind} {b}, {self.kind} {c})"
        )

    def polynomial(self, name: str, coefficients: tuple[float, ...], variable: str) -> str:
        """Horner's scheme, the highest power first."""
        value = self.real(coefficients[0])
        for place, coefficient in enumerate(coefficients[1:]):
            value = self.fma(f"{name}{place}", value, variable, self.real(coefficient))
        return value


@lru_cache(maxsize=8)
def trigonometric_functions(lanes: int) -> tuple[str, dict[str, str]]:
    """(definitions of @sine_cosine, declarations that they need)."""
    body = _Lines(lanes)
    _branch(body)
    shifted, rest = _reduced(body)
    sine, cosine = _on_the_first_octant(body, rest)
    _turned_back(body, shifted, sine, cosine)
    pair = f"{{{body.kind}, {body.kind}}}"
    text = "\n".join([
        f"define internal {pair} @sine_cosine({body.kind} %x) alwaysinline nounwind memory(none) {{",
        *body.lines,
        f"  %p1 = insertvalue {pair} poison, {body.kind} %sin, 0",
        f"  %p2 = insertvalue {pair} %p1, {body.kind} %cos, 1",
        f"  ret {pair} %p2",
        "far:",
        f"  %slow = call {pair} @sine_cosine_far({body.kind} %x)",
        f"  ret {pair} %slow",
        "}",
    ])  # fmt: skip
    return "\n".join([text, _far(lanes, body.kind, pair)]), _declarations(body)


def _branch(body: _Lines) -> None:
    """To %near where all numbers are small enough for the reduction, else to %far."""
    size = body.new("size", f"call {body.kind} @llvm.fabs.{body.suffix}({body.kind} %x)")
    small = body.operation("small", "fcmp ole", size, body.real(_LARGEST))
    if body.lanes > 1:
        small = body.new("every", f"call i1 @llvm.vector.reduce.and.v{body.lanes}i1({body.truth} {small})")
    body.lines.append(f"  br i1 {small}, label %near, label %far, !prof !0")
    body.lines.append("near:")


def _reduced(body: _Lines) -> tuple[str, str]:
    """(number of quarter turns in its last bits, what they leave of x)."""
    shifted = body.fma("shifted", "%x", body.real(_TWO_OVER_PI), body.real(_ROUND))
    count = body.operation("count", "fsub", shifted, body.real(_ROUND))
    turns = body.new("turns", f"fneg {body.kind} {count}")
    rest = "%x"
    for place, part in enumerate(_HALF_PI, 1):
        rest = body.fma(f"r{place}", turns, body.real(part), rest)
    return shifted, rest


def _on_the_first_octant(body: _Lines, rest: str) -> tuple[str, str]:
    """(sin, cos) of the rest by the polynomials."""
    square = body.operation("z", "fmul", rest, rest)
    sine = body.polynomial("s", _SINE, square)
    cube = body.operation("cube", "fmul", square, rest)
    sine = body.fma("sine", sine, cube, rest)
    cosine = body.polynomial("c", _COSINE, square)
    # 1 - z/2 + z^2 C with the rounding of 1 - z/2 put back.
    half = body.operation("half", "fmul", square, body.real(0.5))
    head = body.operation("head", "fsub", body.real(1.0), half)
    lost = body.operation("lost", "fsub", body.real(1.0), head)
    lost = body.operation("tail", "fsub", lost, half)
    fourth = body.operation("fourth", "fmul", square, square)
    tail = body.fma("tails", fourth, cosine, lost)
    return sine, body.operation("cosine", "fadd", head, tail)


def _turned_back(body: _Lines, shifted: str, sine: str, cosine: str) -> None:
    """%sin and %cos of x: exchanged and with signs by the number of quarter turns."""
    bits = body.new("bits", f"bitcast {body.kind} {shifted} to {body.whole}")
    odd = body.new("odd", f"trunc {body.whole} {bits} to {body.truth}")
    first = body.new("first", f"select {body.truth} {odd}, {body.kind} {cosine}, {body.kind} {sine}")
    second = body.new("second", f"select {body.truth} {odd}, {body.kind} {sine}, {body.kind} {cosine}")
    for name, value, shift in (("sin", first, 0), ("cos", second, 1)):
        quarter = body.new(f"{name}q", f"add {body.whole} {bits}, {body.integer(shift)}")
        high = body.new(f"{name}h", f"shl {body.whole} {quarter}, {body.integer(62)}")
        sign = body.new(f"{name}s", f"and {body.whole} {high}, {body.integer(-(2**63))}")
        raw = body.new(f"{name}r", f"bitcast {body.kind} {value} to {body.whole}")
        turned = body.new(f"{name}t", f"xor {body.whole} {raw}, {sign}")
        body.new(name, f"bitcast {body.whole} {turned} to {body.kind}")


def _declarations(body: _Lines) -> dict[str, str]:
    kind, suffix = body.kind, body.suffix
    needs = {
        "fma": f"declare {kind} @llvm.fma.{suffix}({kind}, {kind}, {kind})",
        f"llvm.fabs.{suffix}": f"declare {kind} @llvm.fabs.{suffix}({kind})",
        "sin": "declare double @sin(double) nounwind memory(none)",
        "cos": "declare double @cos(double) nounwind memory(none)",
    }
    if body.lanes > 1:
        needs[f"llvm.vector.reduce.and.v{body.lanes}i1"] = (
            f"declare i1 @llvm.vector.reduce.and.v{body.lanes}i1({body.truth})"
        )
    return needs


def _far(lanes: int, kind: str, pair: str) -> str:
    """The C library's sin and cos, lane by lane."""
    lines = [f"define internal {pair} @sine_cosine_far({kind} %x) noinline cold nounwind memory(none) {{"]
    if lanes == 1:
        lines += ["  %s0 = call double @sin(double %x)", "  %c0 = call double @cos(double %x)"]
        last = ("%s0", "%c0")
    else:
        last = ("poison", "poison")
        for lane in range(lanes):
            lines.append(f"  %x{lane} = extractelement {kind} %x, i32 {lane}")
            for name, function in (("s", "sin"), ("c", "cos")):
                lines.append(f"  %{name}{lane} = call double @{function}(double %x{lane})")
            lines.append(f"  %vs{lane} = insertelement {kind} {last[0]}, double %s{lane}, i32 {lane}")
            lines.append(f"  %vc{lane} = insertelement {kind} {last[1]}, double %c{lane}, i32 {lane}")
            last = (f"%vs{lane}", f"%vc{lane}")
    lines += [
        f"  %p1 = insertvalue {pair} poison, {kind} {last[0]}, 0",
        f"  %p2 = insertvalue {pair} %p1, {kind} {last[1]}, 1",
        f"  ret {pair} %p2",
        "}",
    ]
    return "\n".join(lines)


SIGNATURE = "ptr noalias %memory, ptr noalias %weights, ptr noalias %control, ptr noalias %record"
# Kernel after kernel: to call each from Python costs 20 to 40 microseconds, as threads wait for Python's lock.
GROUPS = f"""define void @groups({SIGNATURE}, i64 %count, ptr %strides) nounwind {{
entry:
  %has = icmp sgt i64 %count, 0
  %at1 = getelementptr i64, ptr %strides, i64 1
  %at2 = getelementptr i64, ptr %strides, i64 2
  %by0 = load i64, ptr %strides, align 8
  %by1 = load i64, ptr %at1, align 8
  %by2 = load i64, ptr %at2, align 8
  br i1 %has, label %again, label %end
again:
  %group = phi i64 [ 0, %entry ], [ %next, %again ]
  %off0 = mul i64 %group, %by0
  %off1 = mul i64 %group, %by1
  %off2 = mul i64 %group, %by2
  %m = getelementptr i8, ptr %memory, i64 %off0
  %c = getelementptr i8, ptr %control, i64 %off1
  %r = getelementptr i8, ptr %record, i64 %off2
  call void @kernel(ptr %m, ptr %weights, ptr %c, ptr %r) noinline
  %next = add i64 %group, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %again, label %end
end:
  ret void
}}"""
_OPERATIONS = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
_INTRINSICS = frozenset(("sqrt", "exp", "log", "pow"))


def hexadecimal(value: float) -> str:
    """The number as LLVM writes it without loss."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class LlvmWriter:
    """Writes one function `kernel`; slots are stack variables that LLVM turns into registers."""

    def __init__(self, lanes: int = 1) -> None:
        self.lanes = lanes
        self.type = "double" if lanes == 1 else f"<{lanes} x double>"
        self.truth = "i1" if lanes == 1 else f"<{lanes} x i1>"
        self._slots: list[str] = []
        self._lines: list[str] = []
        self._count = 0
        self._declared: dict[str, str] = {}
        self._uses_sine_cosine = False

    def _new(self, text: str) -> str:
        self._count += 1
        self._lines.append(f"  %t{self._count} = {text}")
        return f"%t{self._count}"

    def number(self, value: float) -> str:
        return hexadecimal(value) if self.lanes == 1 else f"splat (double {hexadecimal(value)})"

    def binary(self, operation: str, left: str, right: str, exact: bool = False) -> str:
        flag = "" if exact else "contract "
        return self._new(f"{_OPERATIONS[operation]} {flag}{self.type} {left}, {right}")

    def negate(self, value: str) -> str:
        return self._new(f"fneg {self.type} {value}")

    def absolute(self, value: str) -> str:
        return self._intrinsic("fabs", value)

    def _suffix(self) -> str:
        return "f64" if self.lanes == 1 else f"v{self.lanes}f64"

    def _intrinsic(self, function: str, *arguments: str) -> str:
        name = f"llvm.{function}.{self._suffix()}"
        self._declared[name] = f"declare {self.type} @{name}({', '.join([self.type] * len(arguments))})"
        return self._new(f"call {self.type} @{name}({', '.join(f'{self.type} {a}' for a in arguments)})")

    def call(self, function: str, *arguments: str) -> str:
        if function in _INTRINSICS:
            return self._intrinsic(function, *arguments)
        self._declared[function] = f"declare double @{function}(double) nounwind memory(none)"
        (argument,) = arguments
        if self.lanes == 1:
            return self._new(f"call double @{function}(double {argument})")
        result = "poison"
        for lane in range(self.lanes):
            part = self._new(f"extractelement {self.type} {argument}, i32 {lane}")
            value = self._new(f"call double @{function}(double {part})")
            result = self._new(f"insertelement {self.type} {result}, double {value}, i32 {lane}")
        return result

    def sine_cosine(self, argument: str) -> tuple[str, str]:
        """(sin, cos) of the argument by our own polynomials, in lanes."""
        self._uses_sine_cosine = True
        pair = self._new(f"call {{{self.type}, {self.type}}} @sine_cosine({self.type} {argument})")
        kind = f"{{{self.type}, {self.type}}}"
        return self._new(f"extractvalue {kind} {pair}, 0"), self._new(f"extractvalue {kind} {pair}, 1")

    def compare(self, operation: str, left: str, right: str) -> str:
        name = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "==": "oeq", "!=": "une"}[operation]
        return self._new(f"fcmp {name} {self.type} {left}, {right}")

    def both(self, left: str, right: str) -> str:
        return self._new(f"and {self.truth} {left}, {right}")

    def select(self, condition: str, yes: str, no: str) -> str:
        return self._new(f"select {self.truth} {condition}, {self.type} {yes}, {self.type} {no}")

    def choose(self, condition: str, yes: str, no: str) -> str:
        """As `select`, by a condition on counters, which is one for all lanes."""
        return self._new(f"select i1 {condition}, {self.type} {yes}, {self.type} {no}")

    def slot(self, name: str) -> None:
        self._slots.append(f"  %s_{name} = alloca {self.type}, align 64")

    def read(self, name: str) -> str:
        return self._new(f"load {self.type}, ptr %s_{name}")

    def write(self, name: str, value: str) -> None:
        self._lines.append(f"  store {self.type} {value}, ptr %s_{name}")

    def counter(self, name: str) -> None:
        self._slots.append(f"  %n_{name} = alloca i64")

    def read_counter(self, name: str) -> str:
        return self._new(f"load i64, ptr %n_{name}")

    def write_counter(self, name: str, value: str) -> None:
        self._lines.append(f"  store i64 {value}, ptr %n_{name}")

    def add_counters(self, left: str, right: str) -> str:
        return self._new(f"add nsw i64 {left}, {right}")

    def multiply_counters(self, left: str, right: str) -> str:
        return self._new(f"mul nsw i64 {left}, {right}")

    def compare_counters(self, operation: str, left: str, right: str) -> str:
        name = {"<": "slt", ">=": "sge", "==": "eq", ">": "sgt"}[operation]
        return self._new(f"icmp {name} i64 {left}, {right}")

    def _address(self, array: str, place: int | str) -> str:
        return self._new(f"getelementptr {self.type}, ptr %{array}, i64 {place}")

    def load(self, array: str, place: int | str) -> str:
        address = self._address(array, place)
        return self._new(f"load {self.type}, ptr {address}, align 8")

    def load_shared(self, array: str, place: str) -> str:
        address = self._new(f"getelementptr double, ptr %{array}, i64 {place}")
        value = self._new(f"load double, ptr {address}, align 8")
        if self.lanes == 1:
            return value
        first = self._new(f"insertelement {self.type} poison, double {value}, i32 0")
        mask = f"<{self.lanes} x i32> zeroinitializer"
        return self._new(f"shufflevector {self.type} {first}, {self.type} poison, {mask}")

    def store(self, array: str, place: int | str, value: str) -> None:
        address = self._address(array, place)
        self._lines.append(f"  store {self.type} {value}, ptr {address}, align 8")

    def load_counter(self, array: str, place: int) -> str:
        address = self._new(f"getelementptr i64, ptr %{array}, i64 {place}")
        return self._new(f"load i64, ptr {address}, align 8")

    def store_counter(self, array: str, place: int, value: str) -> None:
        address = self._new(f"getelementptr i64, ptr %{array}, i64 {place}")
        self._lines.append(f"  store i64 {value}, ptr {address}, align 8")

    def everywhere(self, condition: str) -> str:
        if self.lanes == 1:
            return condition
        name = f"llvm.vector.reduce.and.v{self.lanes}i1"
        self._declared[name] = f"declare i1 @{name}({self.truth})"
        return self._new(f"call i1 @{name}({self.truth} {condition})")

    def label(self, name: str) -> None:
        self._lines += [f"  br label %{name}", f"{name}:"]

    def jump(self, name: str) -> None:
        self._lines.append(f"  br label %{name}")

    def branch(self, condition: str, yes: str, no: str, rare: bool = False) -> None:
        """To `yes` where the condition holds; `rare` says that it hardly ever does not."""
        self._lines.append(f"  br i1 {condition}, label %{yes}, label %{no}{', !prof !0' if rare else ''}")

    def open(self, name: str) -> None:
        self._lines.append(f"{name}:")

    def text(self) -> str:
        body = "\n".join(["entry:", *self._slots, *self._lines, "  ret void", "}"])
        declared = dict(self._declared)
        parts = [f"define void @kernel({SIGNATURE}) nounwind {{", body, *([GROUPS] if self.lanes > 1 else [])]
        if self._uses_sine_cosine:
            definitions, needs = trigonometric_functions(self.lanes)
            declared.update(needs)
            parts.append(definitions)
        return "\n".join([*declared.values(), *parts, HARDLY_EVER]) + "\n"
