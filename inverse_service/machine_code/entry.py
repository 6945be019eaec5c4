"""The entry of a kernel, as LLVM IR: a C function that Python calls as one of its own built-in functions.

It takes arguments by the calls of Python's stable interface alone (PyObject_GetBuffer, PyNumber_Index, …) and never
looks into an object; the one structure that it reads is Py_buffer, which is part of the stable ABI. An array that the
kernel writes has to be writable. What is not of its kind goes on to a Python function (`OTHER`), which knows what to
do. All that belongs to one process it finds in a table, which is filled when the code is loaded (`loading.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from inverse_service.machine_code.signatures import Kinds, array_of

TABLE = (
    "int", "np.int64", "np.uint64", "True", "False", "None", "OTHER", "PyObject_Vectorcall", "PyObject_IsInstance",
    "PyObject_GetBuffer", "PyBuffer_Release", "PyNumber_Index", "PyLong_AsLongLong", "PyLong_AsUnsignedLongLong",
    "PyErr_Occurred", "PyErr_Clear", "PyLong_FromLongLong", "PyLong_FromUnsignedLongLong", "PyBool_FromLong",
    "Py_IncRef", "Py_DecRef",
)  # fmt: skip
_ANSWERS = {"int64": "PyLong_FromLongLong", "uint64": "PyLong_FromUnsignedLongLong", "bool": "PyBool_FromLong"}
# Py_buffer: its words, and where its fields are.
_WORDS, _DATA, _OWNER, _ITEM_SIZE, _DIMENSIONS, _FORMAT, _SHAPE = 10, 0, 8, 24, 36, 40, 48
# PyBUF_C_CONTIGUOUS | PyBUF_FORMAT, and PyBUF_WRITABLE.
_CONTIGUOUS, _WRITABLE = 0x3C, 1


@dataclass(slots=True)
class _Writer:
    """Lines of IR; values are numbered in the order in which they are made, `views` the buffers."""

    lines: list[str] = field(default_factory=list)
    count: int = 0
    views: list[str] = field(default_factory=list)

    def value(self, text: str) -> str:
        self.count += 1
        self.lines.append(f"  %x{self.count} = {text}")
        return f"%x{self.count}"

    def load(self, address: str, offset: int, kind: str = "i64") -> str:
        """The value of this kind `offset` bytes after the address, which is an i64."""
        place = self.value(f"add i64 {address}, {offset}") if offset else address
        pointer = self.value(f"inttoptr i64 {place} to ptr")
        return self.value(f"load {kind}, ptr {pointer}, align 1")

    def of_table(self, name: str) -> str:
        place = f"getelementptr ([{len(TABLE)} x i64], ptr @table, i64 0, i64 {TABLE.index(name)})"
        return self.value(f"load i64, ptr {place}, align 8")

    def call(self, kind: str, name: str, *arguments: str) -> str:
        """A call of Python's interface; the value that it gives, of this kind."""
        function = self.value(f"inttoptr i64 {self.of_table(name)} to ptr")
        text = f"call {kind} {function}({', '.join(arguments)})"
        if kind == "void":
            self.lines.append(f"  {text}")
            return ""
        return self.value(text)

    def same(self, left: str, right: str | int, kind: str = "i64") -> str:
        return self.value(f"icmp eq {kind} {left}, {right}")

    def demand(self, truth: str, label: str = "other") -> None:
        """Go on where it holds, else to the label."""
        self.count += 1
        self.lines += [f"  br i1 {truth}, label %on{self.count}, label %{label}", f"on{self.count}:"]

    def release(self) -> None:
        """Give the buffers back; those that were not taken have no owner, and nothing happens."""
        for view in self.views:
            self.call("void", "PyBuffer_Release", f"i64 {view}")


def entry_text(kernel: str, kinds: Kinds, answer: str) -> str:
    """IR of @entry for `kernel`, a C function of addresses, lengths and numbers that gives `answer` (or "none")."""
    w = _Writer()
    for kind in kinds:
        w.views += [_empty_view(w)] if array_of(kind).dimensions else []
    w.demand(w.same("%count", len(kinds)))
    views, passed = iter(w.views), []
    for k, kind in enumerate(kinds):
        argument = w.load("%arguments", 8 * k)
        passed += _array(w, argument, kind, next(views)) if array_of(kind).dimensions else [_number(w, argument, kind)]
    result = w.value(f'call i64 @"{kernel}"({", ".join(passed)})')
    w.release()
    _answer(w, result, answer)
    w.lines.append("failed:")
    w.release()
    w.lines += ["  ret i64 0", "other:"]
    w.release()
    w.call("void", "PyErr_Clear")
    handed = w.call("i64", "PyObject_Vectorcall", f"i64 {w.of_table('OTHER')}", "i64 %arguments", "i64 %count", "i64 0")
    types = ", ".join(text.split()[0] for text in passed)
    return "\n".join([
        f"@table = global [{len(TABLE)} x i64] zeroinitializer, align 8", f'declare i64 @"{kernel}"({types})',
        "define i64 @entry(i64 %self, i64 %arguments, i64 %count) {", *w.lines, f"  ret i64 {handed}", "}", "",
    ])  # fmt: skip


def _empty_view(w: _Writer) -> str:
    """A Py_buffer without owner."""
    pointer = w.value(f"alloca [{_WORDS} x i64], align 8")
    owner = w.value(f"getelementptr i8, ptr {pointer}, i64 {_OWNER}")
    w.lines.append(f"  store i64 0, ptr {owner}, align 8")
    return w.value(f"ptrtoint ptr {pointer} to i64")


def _array(w: _Writer, argument: str, kind: str, view: str) -> list[str]:
    """Address and lengths of an array of this kind, contiguous and, where the kernel may write it, writable."""
    array = array_of(kind)
    flags = _CONTIGUOUS | (0 if array.constant else _WRITABLE)
    taken = w.call("i32", "PyObject_GetBuffer", f"i64 {argument}", f"i64 {view}", f"i32 {flags}")
    w.demand(w.same(taken, 0, "i32"))
    w.demand(w.same(w.load(view, _DIMENSIONS, "i32"), array.dimensions, "i32"))
    w.demand(w.same(w.load(view, _ITEM_SIZE), array.size))
    format_ = w.load(view, _FORMAT)
    w.demand(w.same(w.load(format_, 0, "i8"), ord(array.letter), "i8"))
    w.demand(w.same(w.load(format_, 1, "i8"), 0, "i8"))
    data, shape = w.load(view, _DATA), w.load(view, _SHAPE)
    pointer = w.value(f"inttoptr i64 {data} to ptr")
    return [f"ptr {pointer}", *(f"i64 {w.load(shape, 8 * axis)}" for axis in range(array.dimensions))]


def _number(w: _Writer, argument: str, kind: str) -> str:
    """The value of a number of this kind as an i64."""
    if kind == "bool":
        true, false = w.same(argument, w.of_table("True")), w.same(argument, w.of_table("False"))
        w.demand(w.value(f"or i1 {true}, {false}"))
        return f"i64 {w.value(f'zext i1 {true} to i64')}"
    _demand_instance(w, argument, ("np.uint64",) if kind == "uint64" else ("int", "np.int64"))
    if kind == "int64":
        return f"i64 {_read(w, 'PyLong_AsLongLong', argument)}"
    index = w.call("i64", "PyNumber_Index", f"i64 {argument}")
    w.demand(w.value(f"icmp ne i64 {index}, 0"), "failed")
    # An index made from a np.uint64 is never too large, so that nothing is left behind here.
    read = _read(w, "PyLong_AsUnsignedLongLong", index)
    w.call("void", "Py_DecRef", f"i64 {index}")
    return f"i64 {read}"


def _demand_instance(w: _Writer, argument: str, names: tuple[str, ...]) -> None:
    """Go on where the argument is an instance of one of the types, looked at in this order."""
    w.count += 1
    done = f"one{w.count}"
    for name in names:
        is_one = w.call("i32", "PyObject_IsInstance", f"i64 {argument}", f"i64 {w.of_table(name)}")
        holds, last = w.same(is_one, 1, "i32"), name == names[-1]
        following = "other" if last else f"{done}.{name}"
        w.lines.append(f'  br i1 {holds}, label %{done}, label %"{following}"')
        w.lines += [] if last else [f'"{following}":']
    w.lines.append(f"{done}:")


def _read(w: _Writer, call: str, number: str) -> str:
    """The value; -1 is also the answer where the number is too large and an exception is set, which then is ours."""
    read = w.call("i64", call, f"i64 {number}")
    w.count += 1
    doubt, sure = f"doubt{w.count}", f"sure{w.count}"
    w.lines += [f"  br i1 {w.same(read, -1)}, label %{doubt}, label %{sure}", f"{doubt}:"]
    fault = w.call("i64", "PyErr_Occurred")
    w.lines += [f"  br i1 {w.same(fault, 0)}, label %{sure}, label %failed", f"{sure}:"]
    return read


def _answer(w: _Writer, result: str, answer: str) -> None:
    if answer == "none":
        none = w.of_table("None")
        w.call("void", "Py_IncRef", f"i64 {none}")
        w.lines.append(f"  ret i64 {none}")
        return
    kind = "i32" if answer == "bool" else "i64"
    given = w.value(f"trunc i64 {result} to i32") if answer == "bool" else result
    w.lines.append(f"  ret i64 {w.call('i64', _ANSWERS[answer], f'{kind} {given}')}")
