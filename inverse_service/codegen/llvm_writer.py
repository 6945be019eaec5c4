"""Kernels as LLVM IR, scalar or with SIMD lanes."""

from __future__ import annotations

import struct

from inverse_service.codegen.circular_ir import circular_functions

SIGNATURE = "ptr noalias %memory, ptr noalias %weights, ptr noalias %control, ptr noalias %record"
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
        self._uses_circular = False

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

    def circular(self, argument: str) -> tuple[str, str]:
        """(sin, cos) of the argument by our own polynomials, in lanes."""
        self._uses_circular = True
        pair = self._new(f"call {{{self.type}, {self.type}}} @circular({self.type} {argument})")
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

    def branch(self, condition: str, yes: str, no: str) -> None:
        self._lines.append(f"  br i1 {condition}, label %{yes}, label %{no}")

    def open(self, name: str) -> None:
        self._lines.append(f"{name}:")

    def text(self) -> str:
        body = "\n".join(["entry:", *self._slots, *self._lines, "  ret void", "}"])
        declared = dict(self._declared)
        parts = [f"define void @kernel({SIGNATURE}) nounwind {{", body]
        if self._uses_circular:
            definitions, needs = circular_functions(self.lanes)
            declared.update(needs)
            parts.append(definitions)
        return "\n".join([*declared.values(), *parts]) + "\n"
