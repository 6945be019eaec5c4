"""Compile a kernel with numba to an object file that does not need numba.

Imported only if the store has no code: numba takes 0.3 s to import and about 0.5 s per kernel.
"""

from collections.abc import Callable
from itertools import count
from types import FunctionType
from typing import Any, NamedTuple, cast

import llvmlite.binding as llvm
import numba
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from inverse_service.kernels.machine_code import argument_kinds, loading

_NUMBERS = {"int64": types.int64, "uint64": types.uint64, "bool": types.boolean}
_ANSWERS = {types.none: "none", types.int64: "int64", types.uint64: "uint64", types.boolean: "bool"}


def for_numba(value: Any) -> Any:
    """A global of a kernel in numba's form: kernels and intrinsics are converted, other values are
    unchanged.
    """
    make = getattr(value, "made", None)
    return value if make is None else make()


def dispatcher(work: Callable[..., Any]) -> Any:
    """The numba function that compiles `work` for the arguments of a call."""
    function = cast(FunctionType, work)
    space = {
        **function.__globals__,
        **{name: for_numba(value) for name, value in loading.used(work).items()},
    }
    alike = FunctionType(function.__code__, space, function.__name__, function.__defaults__)
    alike.__module__, alike.__qualname__ = function.__module__, function.__qualname__
    # Modules are divided by primes only: no path for a division by zero.
    return numba.njit(error_model="numpy")(alike)


class ObjectCode(NamedTuple):
    """Machine code of a kernel, and the kind of its result."""

    code: bytes
    result: str


def object_code(compiler: Any, kinds: argument_kinds.Kinds) -> ObjectCode:
    """Object code of the kernel for these kinds, and the kind of its result.

    Raises Unstorable if it needs other code.
    """
    module, answer = module_of(compiler, kinds)
    machine = loading.target_machine(level=3)
    reduce(module, machine, loading.ENTRY)
    return ObjectCode(bytes(machine.emit_object(module)), answer)


def module_of(
    compiler: Any, kinds: argument_kinds.Kinds, name: str = loading.ENTRY
) -> tuple[Any, str]:
    """The kernel as an LLVM module whose entry is one function of this name, and the kind of its
    result.
    """
    signature = tuple(map(_type, kinds))
    compiler.compile(signature)  # rejects a kernel that writes to a read-only array
    answer = _ANSWERS.get(compiler.overloads[signature].signature.return_type)
    if answer is None:
        raise loading.Unstorable("the kernel gives neither nothing nor one number")
    function = _flat(compiler, kinds, answer)
    module = llvm.parse_assembly(function.inspect_llvm())
    module.get_function(function.native_name).name = name
    return module, answer


def _type(kind: argument_kinds.Kind) -> Any:
    if not isinstance(kind, str):
        return types.BaseTuple.from_types(tuple(map(_type, kind[1])), kind[0])  # type: ignore[no-untyped-call]
    array = argument_kinds.array_of(kind)
    if not array.dimensions:
        return _NUMBERS[kind]
    return types.Array(
        getattr(types, array.element), array.dimensions, "C", readonly=array.constant
    )


def _flat(compiler: Any, kinds: argument_kinds.Kinds, answer: str) -> Any:
    """The kernel as a C function of the address of its words."""
    space: dict[str, Any] = {
        "work": compiler,
        "array": carray,
        "constant": _constant(),
        "integer": types.int64,
    }
    space |= {name: _pointer_to(getattr(types, name)) for name in argument_kinds.ELEMENTS}
    places = count()

    def argument(kind: argument_kinds.Kind) -> str:
        if isinstance(kind, str):
            place = next(places)
            return _argument(
                kind,
                place,
                [
                    f"integer(words[{next(places)}])"
                    for _ in range(argument_kinds.array_of(kind).dimensions)
                ],
            )
        name = f"S{len(space)}"
        space[name] = kind[0]
        return f"{name}({', '.join(map(argument, kind[1]))})"

    call = f"work({', '.join(map(argument, kinds))})"
    body = (
        f"{call}; return 0"
        if answer == "none"
        else f"return {'int' if answer == 'bool' else ''}({call})"
    )
    exec(f"def flat(words): {body}", space)  # a text of numbered letters, not user input
    given = types.uint64 if answer == "uint64" else types.int64
    pointer: Any = types.CPointer
    return numba.cfunc(given(pointer(types.uint64)), error_model="numpy")(space["flat"])


def _argument(kind: str, place: int, lengths: list[str]) -> str:
    """Code that rebuilds the argument from its words."""
    word, array = f"words[{place}]", argument_kinds.array_of(kind)
    if lengths:
        made = f"array({array.element}({word}), ({', '.join(lengths)},))"
        return f"constant({made})" if array.constant else made
    return {"int64": f"integer({word})", "uint64": word, "bool": f"{word} != 0"}[kind]


def _constant() -> Any:
    """A read-only view of an array: for another kind the kernel would be compiled a second time."""

    def definition(context: Any, array: Any) -> Any:
        return array.copy(readonly=True)(array), lambda context, builder, signature, given: given[0]

    return intrinsic(definition)


def _pointer_to(element: Any) -> Any:
    """A pointer from an address."""
    make: Any = types.CPointer
    pointer = make(element)

    def definition(context: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            return builder.inttoptr(given[0], context.get_value_type(pointer))

        return pointer(types.uint64), code

    return intrinsic(definition)


def reduce(module: Any, machine: Any, name: str) -> None:
    """Optimize with this function as the only way in, so that numba's paths for exceptions go;
    raises Unstorable.
    """
    for function in module.functions:
        if not function.is_declaration and function.name != name:
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    builder.getModulePassManager().run(module, builder)
    needed = [*module.functions, *module.global_variables]
    missing = [
        one.name for one in needed if one.is_declaration and not one.name.startswith("llvm.")
    ]
    if missing:
        raise loading.Unstorable(f"the kernel needs {', '.join(missing)}")
