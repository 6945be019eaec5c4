"""A kernel compiled by numba to an object file that needs nothing of numba.

Imported only where the store has no code: numba takes 0.3 s to import and some 0.5 s a kernel.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from types import FunctionType
from typing import Any, cast

import llvmlite.binding as llvm
import numba
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from inverse_service.machine_code.kernels import Kind, Kinds, array_of, leaves
from inverse_service.machine_code.loading import ENTRY, Unstorable, target_machine, used

_NUMBERS = {"int64": types.int64, "uint64": types.uint64, "bool": types.boolean}
_ANSWERS = {types.none: "none", types.int64: "int64", types.uint64: "uint64", types.boolean: "bool"}


def for_numba(value: Any) -> Any:
    """A global of a kernel as numba knows it: kernels and intrinsics made, all else as it is."""
    make = getattr(value, "made", None)
    return value if make is None else make()


def dispatcher(work: Callable[..., Any]) -> Any:
    """numba's function that compiles `work` for what it is called with."""
    function = cast(FunctionType, work)
    space = {**function.__globals__, **{name: for_numba(value) for name, value in used(work).items()}}
    alike = FunctionType(function.__code__, space, function.__name__, function.__defaults__)
    alike.__module__, alike.__qualname__ = function.__module__, function.__qualname__
    # Modules are divided by primes only: no path for a division by zero.
    return numba.njit(error_model="numpy")(alike)


def made_intrinsic(definition: Callable[..., Any]) -> Any:
    return intrinsic(definition)


def object_code(compiler: Any, kinds: Kinds) -> tuple[bytes, str]:
    """The kernel for these kinds and what it answers; raises Unstorable where it needs more than itself."""
    signature = tuple(map(_type, kinds))
    compiler.compile(signature)  # refuses a kernel that writes what is to be read only
    answer = _ANSWERS.get(compiler.overloads[signature].signature.return_type)
    if answer is None:
        raise Unstorable("the kernel gives neither nothing nor one number")
    function = _flat(compiler, kinds, answer)
    module = llvm.parse_assembly(function.inspect_llvm())
    module.get_function(function.native_name).name = ENTRY
    machine = target_machine(level=3)
    _reduce(module, machine)
    return bytes(machine.emit_object(module)), answer


def _type(kind: Kind) -> Any:
    if not isinstance(kind, str):
        return types.NamedTuple(tuple(map(_type, kind[1])), kind[0])  # type: ignore[no-untyped-call]
    array = array_of(kind)
    if not array.dimensions:
        return _NUMBERS[kind]
    return types.Array(getattr(types, array.element), array.dimensions, "C", readonly=array.constant)


def _flat(compiler: Any, kinds: Kinds, answer: str) -> Any:
    """The kernel as a C function of addresses, lengths and numbers."""
    space: dict[str, Any] = {"work": compiler, "carray": carray}
    parameters: list[str] = []
    numbers = count()

    def argument(kind: Kind) -> str:
        k = next(numbers)
        if isinstance(kind, str):
            taken, made = _parameters(k, kind)
            parameters.append(taken)
            return made
        space[f"S{k}"] = kind[0]
        return f"S{k}({', '.join(map(argument, kind[1]))})"

    call = f"work({', '.join(map(argument, kinds))})"
    body = f"{call}; return 0" if answer == "none" else f"return {'int' if answer == 'bool' else ''}({call})"
    exec(f"def flat({', '.join(parameters)}): {body}", space)  # a text of numbered letters, nobody's input
    given = types.uint64 if answer == "uint64" else types.int64
    signature = given(*(one for kind in leaves(kinds) for one in _types(kind)))
    return numba.cfunc(signature, error_model="numpy")(space["flat"])


def _parameters(k: int, kind: str) -> tuple[str, str]:
    """The names of what stands for argument k, and the argument made from them."""
    dimensions = array_of(kind).dimensions
    if not dimensions:
        return f"a{k}", f"a{k} != 0" if kind == "bool" else f"a{k}"
    lengths = ", ".join(f"n{k}_{axis}" for axis in range(dimensions))
    return f"a{k}, {lengths}", f"carray(a{k}, ({lengths},))"


def _types(kind: str) -> list[Any]:
    array = array_of(kind)
    if not array.dimensions:
        return [types.uint64 if kind == "uint64" else types.int64]
    address: Any = types.CPointer
    return [address(getattr(types, array.element)), *[types.int64] * array.dimensions]


def _reduce(module: Any, machine: Any) -> None:
    """Optimize with @entry as the only way in, so that numba's paths for exceptions go; raises Unstorable."""
    for function in module.functions:
        if not function.is_declaration and function.name != ENTRY:
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    builder.getModulePassManager().run(module, builder)
    needed = [*module.functions, *module.global_variables]
    missing = [one.name for one in needed if one.is_declaration and not one.name.startswith("llvm.")]
    if missing:
        raise Unstorable(f"the kernel needs {', '.join(missing)}")
