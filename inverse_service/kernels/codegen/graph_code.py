"""A graph of formulas as machine code: `evaluate(x, y)` writes the values of the outputs at the
inputs x to y.

Functions of PART nodes, one after another, with the values that several of them need in an array:
LLVM takes a multiple of the time for one long function.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from inverse_service.kernels.codegen import graph as graphs, llvm_writer
from inverse_service.kernels.codegen.llvm_writer import LlvmWriter, Value

PART = 100
_BY_PAIRS = ("sin", "cos")
_FLAGS = "ptr noalias %x, ptr noalias %y, ptr noalias %shared"


def evaluator_text(graph: graphs.Graph, functions: Mapping[str, Sequence[int]]) -> str:
    """The LLVM IR of functions by name, each with its outputs: `name(inputs, outputs)`."""
    texts: list[str] = []
    declared: dict[str, str] = {}
    uses_sine = False
    for name, outputs in functions.items():
        writer = _Evaluator(graph, name, outputs)
        texts += writer.text()
        declared |= writer.declared
        uses_sine |= writer.uses_sine
    if uses_sine:
        definitions, needs = llvm_writer.trigonometric_functions(1)
        declared |= needs
        texts += [definitions, llvm_writer.HARDLY_EVER]
    return "\n".join([*declared.values(), *texts]) + "\n"


class _Evaluator:
    """Writes one function."""

    def __init__(self, graph: graphs.Graph, name: str, outputs: Sequence[int]) -> None:
        self.graph, self.name, self.outputs = graph, name, outputs
        self.declared: dict[str, str] = {}
        self.uses_sine = False
        order = graph.below(outputs)
        uses = Counter(part for k in order for part in graph.parts(k))
        user = {part: k for k in reversed(order) for part in graph.parts(k)}
        self._places: dict[int, list[int]] = defaultdict(list)
        for place, k in enumerate(outputs):
            self._places[k].append(place)
        # What one sum subtracts, or one product divides by, is no operation of its own.
        joins = {graphs.NEGATIVE: graphs.SUM, graphs.RECIPROCAL: graphs.PRODUCT}
        self._joined: set[int] = set()
        for k in order:
            operation = graph.keys[k][0]
            if operation in joins and uses[k] == 1 and k not in self._places:
                above = user[k]
                whole, first, second = graph.keys[above]
                other = second if first == k else first
                if whole == joins[operation] and other not in self._joined:
                    self._joined.add(k)
        self._pairs: dict[int, list[int]] = defaultdict(list)
        self._split_into_parts(
            [k for k in order if graph.keys[k][0] > graphs.LEAF and k not in self._joined]
        )
        self._shared: dict[int, int] = {}
        for k in self._part_of:
            for part in self._needed(k):
                if self._part_of.get(part, self._part_of[k]) != self._part_of[k]:
                    self._shared.setdefault(part, len(self._shared))

    def _split_into_parts(self, nodes: list[int]) -> None:
        keys = self.graph.keys
        for k in nodes:
            if keys[k][0] == graphs.FUNCTION and keys[k][2] in _BY_PAIRS:
                self._pairs[keys[k][1]].append(k)
        self._parts: list[list[int]] = [[]]
        self._part_of: dict[int, int] = {}
        for k in nodes:
            if k in self._part_of:
                continue
            if len(self._parts[-1]) >= PART:
                self._parts.append([])
            together = (
                self._pairs[keys[k][1]]
                if keys[k][0] == graphs.FUNCTION and keys[k][2] in _BY_PAIRS
                else [k]
            )
            self._part_of |= dict.fromkeys(together, len(self._parts) - 1)
            self._parts[-1].append(k)

    def _needed(self, node: int) -> list[int]:
        """The parts of a node, those of joined ones in their place."""
        found: list[int] = []
        for part in self.graph.parts(node):
            found += self._needed(part) if part in self._joined else [part]
        return found

    def text(self) -> list[str]:
        """The functions of the parts, and the one that calls them."""
        texts, calls = [], []
        for number, nodes in enumerate(self._parts):
            part = f"{self.name}_{number}"
            texts.append(
                self._function(
                    f"define internal void @{part}({_FLAGS}) noinline nounwind {{", nodes
                )
            )
            calls.append(f"  call void @{part}(ptr %x, ptr %y, ptr %shared)")
        head = f"define void @{self.name}(ptr noalias %x, ptr noalias %y) nounwind {{"
        array = f"  %shared = alloca [{max(1, len(self._shared))} x double], align 64"
        rest = self._function("", [k for k in self._places if self.graph.keys[k][0] <= graphs.LEAF])
        return [*texts, "\n".join([head, array, *calls, rest.lstrip("\n")])]

    def _function(self, head: str, nodes: Sequence[int]) -> str:
        w, known = LlvmWriter(), dict[int, Value]()
        for k in nodes:
            self._write(w, known, k)
        self.declared |= w.declared
        return "\n".join([head, *w.lines, "  ret void", "}"])

    def _value(self, w: LlvmWriter, known: dict[int, Value], node: int) -> Value:
        found = known.get(node)
        if found is None:
            operation, first, _ = self.graph.keys[node]
            if operation == graphs.CONSTANT:
                return Value(w, w.number(first))
            found = (
                w.load("x", first)
                if operation == graphs.LEAF
                else w.load("shared", self._shared[node])
            )
            known[node] = found
        return found

    def _keep(self, w: LlvmWriter, known: dict[int, Value], node: int, value: Value) -> None:
        known[node] = value
        if node in self._shared:
            w.store("shared", self._shared[node], value)
        for place in self._places.get(node, ()):
            w.store("y", place, value)

    def _write(self, w: LlvmWriter, known: dict[int, Value], node: int) -> None:
        operation, first, second = self.graph.keys[node]
        if operation <= graphs.LEAF:
            self._keep(w, known, node, self._value(w, known, node))
            return
        if operation == graphs.FUNCTION and second in _BY_PAIRS:
            self.uses_sine = True
            pair = w.sine_cosine(self._value(w, known, first))
            for one in self._pairs[first]:
                self._keep(w, known, one, pair[self.graph.keys[one][2] == "cos"])
            return
        if operation in (graphs.SUM, graphs.PRODUCT):
            if first in self._joined:
                first, second = second, first
            left = self._value(w, known, first)
            if second in self._joined:
                right = self._value(w, known, self.graph.keys[second][1])
                value = left - right if operation == graphs.SUM else left / right
            else:
                right = self._value(w, known, second)
                value = left + right if operation == graphs.SUM else left * right
        elif operation == graphs.POWER:
            value = w.call("pow", self._value(w, known, first), self._value(w, known, second))
        else:
            x = self._value(w, known, first)
            if operation == graphs.NEGATIVE:
                value = -x
            elif operation == graphs.RECIPROCAL:
                value = 1.0 / x
            else:
                value = w.call("sqrt" if operation == graphs.ROOT else second, x)
        self._keep(w, known, node, value)
