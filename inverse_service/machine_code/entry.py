"""The entry of a kernel, as LLVM IR: a C function that Python calls as one of its own built-in functions.

It looks whether every argument is exactly of its kind, reads data and shape where NumPy keeps them, and calls
the kernel. What is not of its kind goes on to a Python function (`OTHER`), which knows what to do.
All that belongs to one process it finds in a table, which is filled when the code is loaded (`loading.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from inverse_service.machine_code import signatures as at
from inverse_service.machine_code.signatures import ELEMENTS, REGULAR, Kinds, element_of

TABLE = (
    "ndarray", "int", "np.int64", "np.uint64", "True", "False", "None", "OTHER", "PyObject_Vectorcall",
    "PyLong_AsLongLong", "PyErr_Occurred", "PyLong_FromLongLong", "PyLong_FromUnsignedLongLong", "PyBool_FromLong",
    "Py_IncRef", *ELEMENTS,
)  # fmt: skip
_ANSWERS = {"int64": "PyLong_FromLongLong", "uint64": "PyLong_FromUnsignedLongLong", "bool": "PyBool_FromLong"}


@dataclass(slots=True)
class _Writer:
    """Lines of IR; values are numbered in the order in which they are made."""

    lines: list[str] = field(default_factory=list)
    count: int = 0

    def value(self, text: str) -> str:
        self.count += 1
        self.lines.append(f"  %x{self.count} = {text}")
        return f"%x{self.count}"

    def at(self, address: str, offset: int, kind: str = "i64") -> str:
        """The value of this kind `offset` bytes after the address, which is an i64."""
        place = self.value(f"add i64 {address}, {offset}") if offset else address
        pointer = self.value(f"inttoptr i64 {place} to ptr")
        return self.value(f"load {kind}, ptr {pointer}, align {4 if kind == 'i32' else 8}")

    def of_table(self, name: str) -> str:
        place = f"getelementptr ([{len(TABLE)} x i64], ptr @table, i64 0, i64 {TABLE.index(name)})"
        return self.value(f"load i64, ptr {place}, align 8")

    def function(self, name: str) -> str:
        return self.value(f"inttoptr i64 {self.of_table(name)} to ptr")

    def same(self, left: str, right: str | int, kind: str = "i64") -> str:
        return self.value(f"icmp eq {kind} {left}, {right}")

    def either(self, left: str, right: str) -> str:
        return self.value(f"or i1 {left}, {right}")

    def demand(self, truths: list[str], label: str) -> None:
        """Go on at the label where all hold, else to the other function."""
        together = "true"
        for truth in truths:
            together = self.value(f"and i1 {together}, {truth}")
        self.lines += [f"  br i1 {together}, label %{label}, label %other", f"{label}:"]


def entry_text(kernel: str, kinds: Kinds, answer: str) -> str:
    """IR of @entry for `kernel`, a C function of addresses, lengths and numbers that gives `answer` (or "none")."""
    w = _Writer()
    w.demand([w.same("%count", len(kinds))], "counted")
    arguments = [w.at("%arguments", 8 * k) for k in range(len(kinds))]
    w.demand([_of_type(w, argument, kind) for argument, kind in zip(arguments, kinds, strict=True)], "typed")
    checks = [_regular(w, argument, kind) for argument, kind in zip(arguments, kinds, strict=True) if "[" in kind]
    w.demand([truth for truths in checks for truth in truths], "regular")
    passed = []
    for k, (argument, kind) in enumerate(zip(arguments, kinds, strict=True)):
        passed += _passed(w, k, argument, kind)
    result = w.value(f'call i64 @"{kernel}"({", ".join(passed)})')
    _answer(w, result, answer)
    w.lines.append("other:")
    _hand_on(w)
    types = ", ".join(text.split()[0] for text in passed)
    return "\n".join([
        f"@table = global [{len(TABLE)} x i64] zeroinitializer, align 8", f'declare i64 @"{kernel}"({types})',
        "define i64 @entry(i64 %self, i64 %arguments, i64 %count) {", *w.lines, "}", "",
    ])  # fmt: skip


def _of_type(w: _Writer, argument: str, kind: str) -> str:
    if kind == "bool":
        return w.either(w.same(argument, w.of_table("True")), w.same(argument, w.of_table("False")))
    found = w.at(argument, at.TYPE)
    if kind == "int64":
        return w.either(w.same(found, w.of_table("int")), w.same(found, w.of_table("np.int64")))
    return w.same(found, w.of_table("np.uint64" if kind == "uint64" else "ndarray"))


def _regular(w: _Writer, argument: str, kind: str) -> list[str]:
    """Element type, dimensions, contiguous and aligned."""
    name, dimensions = element_of(kind)
    flags = w.value(f"and i32 {w.at(argument, at.FLAGS, 'i32')}, {REGULAR}")
    return [
        w.same(w.at(argument, at.ELEMENT), w.of_table(name)),
        w.same(w.at(argument, at.DIMENSIONS, "i32"), dimensions, "i32"),
        w.same(flags, REGULAR, "i32"),
    ]


def _passed(w: _Writer, k: int, argument: str, kind: str) -> list[str]:
    """What the kernel gets for an argument: address and lengths, or the number."""
    _, dimensions = element_of(kind)
    if dimensions:
        data, shape = w.at(argument, at.DATA), w.at(argument, at.SHAPE)
        pointer = w.value(f"inttoptr i64 {data} to ptr")
        return [f"ptr {pointer}", *(f"i64 {w.at(shape, 8 * axis)}" for axis in range(dimensions))]
    if kind == "bool":
        true = w.same(argument, w.of_table("True"))
        return [f"i64 {w.value(f'zext i1 {true} to i64')}"]
    if kind == "uint64":
        return [f"i64 {w.at(argument, at.HEADER)}"]
    return [f"i64 {_integer(w, k, argument)}"]


def _integer(w: _Writer, k: int, argument: str) -> str:
    """The value of an int, which Python reads, or of a np.int64."""
    is_int = w.same(w.at(argument, at.TYPE), w.of_table("int"))
    w.lines += [f"  br i1 {is_int}, label %int{k}, label %word{k}", f"int{k}:"]
    read = w.value(f"call i64 {w.function('PyLong_AsLongLong')}(i64 {argument})")
    w.lines += [f"  br i1 {w.same(read, -1)}, label %doubt{k}, label %read{k}", f"doubt{k}:"]
    # -1 is also the answer where the number is too large and an exception is set, which then is ours.
    fault = w.value(f"call i64 {w.function('PyErr_Occurred')}()")
    w.lines += [f"  br i1 {w.same(fault, 0)}, label %read{k}, label %failed{k}", f"failed{k}:", "  ret i64 0"]
    w.lines.append(f"word{k}:")
    stored = w.at(argument, at.HEADER)
    w.lines += [f"  br label %read{k}", f"read{k}:"]
    return w.value(f"phi i64 [{read}, %int{k}], [{read}, %doubt{k}], [{stored}, %word{k}]")


def _answer(w: _Writer, result: str, answer: str) -> None:
    if answer == "none":
        none = w.of_table("None")
        w.lines += [f"  call void {w.function('Py_IncRef')}(i64 {none})", f"  ret i64 {none}"]
        return
    made = w.value(f"call i64 {w.function(_ANSWERS[answer])}(i64 {result})")
    w.lines.append(f"  ret i64 {made}")


def _hand_on(w: _Writer) -> None:
    call, other = w.function("PyObject_Vectorcall"), w.of_table("OTHER")
    w.lines.append(f"  ret i64 {w.value(f'call i64 {call}(i64 {other}, i64 %arguments, i64 %count, i64 0)')}")
