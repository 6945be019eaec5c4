"""The same kernels as C, to be compared with and to be read; nothing here is needed to run a simulation."""

from __future__ import annotations

_INCLUDES = "#include <math.h>\n#include <stdint.h>\n"
_SIGNATURE = (
    "double *restrict memory, const double *restrict weights, int64_t *restrict control, double *restrict record"
)


class CWriter:
    """Writes one function `kernel` with the arguments of the LLVM one."""

    def __init__(self) -> None:
        self.lanes = 1
        self._slots: list[str] = []
        self._lines: list[str] = []
        self._count = 0

    def _new(self, kind: str, text: str) -> str:
        self._count += 1
        self._lines.append(f"  {kind} t{self._count} = {text};")
        return f"t{self._count}"

    def number(self, value: float) -> str:
        return f"({value!r})"

    def binary(self, operation: str, left: str, right: str, exact: bool = False) -> str:
        return self._new("double", f"{left} {operation} {right}")

    def negate(self, value: str) -> str:
        return self._new("double", f"-{value}")

    def absolute(self, value: str) -> str:
        return self.call("fabs", value)

    def call(self, function: str, *arguments: str) -> str:
        return self._new("double", f"{function}({', '.join(arguments)})")

    def circular(self, argument: str) -> tuple[str, str]:
        return self.call("sin", argument), self.call("cos", argument)

    def compare(self, operation: str, left: str, right: str) -> str:
        return self._new("int", f"{left} {operation} {right}")

    def both(self, left: str, right: str) -> str:
        return self._new("int", f"{left} & {right}")

    def select(self, condition: str, yes: str, no: str) -> str:
        return self._new("double", f"{condition} ? {yes} : {no}")

    def slot(self, name: str) -> None:
        self._slots.append(f"  double s_{name} = 0;")

    def read(self, name: str) -> str:
        return self._new("double", f"s_{name}")

    def write(self, name: str, value: str) -> None:
        self._lines.append(f"  s_{name} = {value};")

    def counter(self, name: str) -> None:
        self._slots.append(f"  int64_t n_{name} = 0;")

    def read_counter(self, name: str) -> str:
        return self._new("int64_t", f"n_{name}")

    def write_counter(self, name: str, value: str) -> None:
        self._lines.append(f"  n_{name} = {value};")

    def add_counters(self, left: str, right: str) -> str:
        return self._new("int64_t", f"{left} + {right}")

    def multiply_counters(self, left: str, right: str) -> str:
        return self._new("int64_t", f"{left} * {right}")

    def compare_counters(self, operation: str, left: str, right: str) -> str:
        return self._new("int", f"{left} {operation} {right}")

    def load(self, array: str, place: int | str) -> str:
        return self._new("double", f"{array}[{place}]")

    def load_shared(self, array: str, place: str) -> str:
        return self.load(array, place)

    def store(self, array: str, place: int | str, value: str) -> None:
        self._lines.append(f"  {array}[{place}] = {value};")

    def load_counter(self, array: str, place: int) -> str:
        return self._new("int64_t", f"{array}[{place}]")

    def store_counter(self, array: str, place: int, value: str) -> None:
        self._lines.append(f"  {array}[{place}] = {value};")

    def everywhere(self, condition: str) -> str:
        return condition

    def label(self, name: str) -> None:
        self._lines.append(f"{name}:;")

    def jump(self, name: str) -> None:
        self._lines.append(f"  goto {name};")

    def branch(self, condition: str, yes: str, no: str) -> None:
        self._lines.append(f"  if ({condition}) goto {yes}; else goto {no};")

    def open(self, name: str) -> None:
        self._lines.append(f"{name}:;")

    def text(self) -> str:
        return "\n".join([_INCLUDES, f"void kernel({_SIGNATURE}) {{", *self._slots, *self._lines, "}"]) + "\n"
