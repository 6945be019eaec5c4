"""Kernels give what their Python gives, from the store as from the compiler, and a store is never believed blindly."""

from __future__ import annotations

import importlib
import os
import pickle
import pkgutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

import inverse_service
from inverse_service.algebra import modular
from inverse_service.machine_code import building, code_store, kernels
from inverse_service.machine_code.kernels import Kept, Kernel, compiled, kinds_of
from inverse_service.machine_code.loading import Unstorable, kernel_digest

WEIGHT = 3


@compiled
def weighted(a: int) -> int:
    return WEIGHT * a


@compiled
def add_up(first: int, steps: Any, table: Any, factor: np.uint64, negative: bool) -> int:
    """Change the table and give a sum."""
    total = first
    for step in steps:
        total += weighted(step)
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            table[i, j] = table[i, j] * factor + np.uint64(j)
    return -total if negative else total


@compiled
def last(words: Any) -> np.uint64:
    return words[len(words) - 1]  # type: ignore[no-any-return]


@compiled
def is_positive(number: int) -> bool:
    return number > 0


@compiled
def clear(cube: Any, small: Any) -> None:
    for i in range(cube.shape[0]):
        for j in range(cube.shape[1]):
            for k in range(cube.shape[2]):
                cube[i, j, k] = small[k]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def compilations(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The kernels that were compiled and not found."""
    names: list[str] = []
    real = building.object_code

    def counted(compiler: Any, kinds: tuple[str, ...]) -> tuple[bytes, str]:
        names.append(compiler.__name__)
        return real(compiler, kinds)

    monkeypatch.setattr(building, "object_code", counted)
    return names


def again(kernel: Any) -> Kernel:
    """The kernel as another process has it, without machine code."""
    return Kernel(kernel.py_func)


def arguments(seed: int) -> tuple[Any, ...]:
    random = np.random.default_rng(seed)
    table = random.integers(0, 2**63, (2, 3)).astype(np.uint64)
    return int(random.integers(-9, 9)), random.integers(-99, 99, 5), table, np.uint64(2**61 - 1), bool(seed % 2)


def outcome(work: Callable[..., Any], given: tuple[Any, ...]) -> tuple[Any, list[Any]]:
    """(answer, the arrays afterwards)."""
    copies = [one.copy() if isinstance(one, np.ndarray) else one for one in given]
    with np.errstate(over="ignore"):
        return work(*copies), [one.tolist() for one in copies if isinstance(one, np.ndarray)]


@pytest.mark.slow
def test_compiled_stored_and_plain_agree(folder: Path, compilations: list[str]) -> None:
    plain = changed(add_up, weighted=lambda a: WEIGHT * a)
    fresh, stored = again(add_up), again(add_up)
    for seed in range(6):
        expected = outcome(plain, arguments(seed))
        assert outcome(fresh, arguments(seed)) == expected
        assert outcome(stored, arguments(seed)) == expected
    assert compilations == ["add_up"]
    assert len(list(folder.iterdir())) == 1


@pytest.mark.slow
def test_every_kind_of_answer(folder: Path) -> None:
    words = np.array([1, 2**64 - 1], np.uint64)
    for _ in range(2):
        word, truth = again(last)(words), again(is_positive)
        assert word == 2**64 - 1
        assert truth(1) is True
        assert truth(-1) is False
        cube = np.ones((2, 1, 3), np.int64)
        assert again(clear)(cube, np.array([5, 6, 7], np.int8)) is None
        assert cube.tolist() == [[[5, 6, 7]], [[5, 6, 7]]]


@pytest.mark.slow
def test_numbers_and_arrays_of_numpy_and_python_are_alike(folder: Path) -> None:
    first, steps, table, factor, negative = arguments(1)
    work = again(add_up)
    expected = outcome(work, (first, steps, table, factor, negative))
    steps.setflags(write=False)
    assert outcome(work, (np.int64(first), steps, table, factor, np.bool_(negative))) == expected
    # An array from a pickle has an element type of its own.
    there = pickle.loads(pickle.dumps(steps))
    assert there.dtype is not steps.dtype
    assert outcome(work, (first, there, table, factor, negative)) == expected
    assert outcome(work, (first, steps.view(np.longlong), table, factor, negative)) == expected
    changed = pickle.loads(pickle.dumps(table))
    work(first, steps, changed, factor, negative)
    assert changed.tolist() == expected[1][1]


@pytest.mark.slow
def test_arguments_of_other_kinds_go_through_numba(folder: Path) -> None:
    first, steps, table, factor, negative = arguments(2)
    work = again(add_up)
    expected = outcome(work, (first, steps, table, factor, negative))
    apart = np.repeat(steps, 2)[::2]
    assert kinds_of((apart,), []) is None
    assert outcome(work, (first, apart, table, factor, negative)) == expected
    assert again(is_positive)(0.5) is True
    assert kinds_of((0.5,), []) is None


def test_wrong_calls_are_refused(folder: Path) -> None:
    work = again(is_positive)
    assert work(1) is True
    with pytest.raises(TypeError):
        work()
    with pytest.raises(TypeError):
        work(1, 2)
    with pytest.raises(OverflowError):
        work(2**70)
    assert work(2**62) is True


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "foreign", "swapped"])
def test_damaged_code_is_compiled_anew(folder: Path, compilations: list[str], damage: str) -> None:
    assert again(is_positive)(1) is True
    assert again(weighted)(2) == 6
    entries = sorted(folder.glob("*.modular"))
    contents = [entry.read_bytes() for entry in entries]
    assert len(contents) == 2
    for entry, content, other in zip(entries, contents, reversed(contents), strict=True):
        new = {
            "empty": b"", "cut": content[:-10], "flipped": content[:-200] + bytes([content[-200] ^ 1]) + content[-199:],
            "foreign": b"#!/bin/sh\n", "swapped": other,
        }[damage]  # fmt: skip
        entry.write_bytes(new)
    assert again(is_positive)(1) is True
    assert again(weighted)(2) == 6
    assert compilations == ["is_positive", "weighted"] * 2
    assert [entry.read_bytes()[:25] for entry in entries] == [content[:25] for content in contents]


def changed(kernel: Any, **names: Any) -> Callable[..., Any]:
    """The kernel's function with other globals."""
    function = kernel.py_func
    return FunctionType(function.__code__, {**function.__globals__, **names}, function.__name__)


def test_the_digest_is_that_of_all_that_is_compiled() -> None:
    kinds = kinds_of(arguments(0), [])
    assert kinds == ("int64", "int64[1]", "uint64[2]", "uint64", "bool")
    source: Any = add_up
    known = kernel_digest(source.py_func, kinds)
    assert kernel_digest(changed(add_up), kinds) == known

    def otherwise(a: int) -> int:
        return WEIGHT - a

    others = {
        kernel_digest(changed(add_up, weighted=Kernel(otherwise)), kinds),
        kernel_digest(changed(add_up, weighted=Kernel(changed(weighted, WEIGHT=4))), kinds),
        kernel_digest(source.py_func, ("int64", "int32[1]", *kinds[2:])),
        kernel_digest(changed(is_positive), ("int64",)),
    }
    assert len(others | {known}) == 5
    with pytest.raises(Unstorable, match="weighted is a list"):
        kernel_digest(changed(add_up, weighted=[1]), kinds)


@pytest.mark.slow
def test_a_kernel_that_needs_more_than_itself_runs_but_is_not_stored(folder: Path) -> None:
    def doubled(numbers: Any) -> Any:
        return numbers + numbers

    def needs_memory(count: int) -> int:
        return len(np.zeros(count, np.int64))

    assert again(compiled(needs_memory))(3) == 3
    assert Kernel(doubled)(np.arange(3)).tolist() == [0, 2, 4]
    assert not folder.exists() or not list(folder.iterdir())


def test_a_folder_that_cannot_be_written_costs_time_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "file" / "below"))
    assert again(is_positive)(1) is True


def test_an_installation_serves_all_its_users(
    folder: Path, compilations: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Code beside the program is put there by its owner, and found by all who run it."""
    program = tmp_path / "program"
    monkeypatch.setattr(code_store, "program_directory", lambda: program)
    monkeypatch.delenv("INVERSE_SERVICE_CACHE")
    assert again(is_positive)(1) is True
    (entry,) = program.iterdir()
    assert entry.stat().st_mode & 0o777 == 0o644
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(folder))
    monkeypatch.setattr(os, "getuid", lambda: entry.stat().st_uid + 1)
    assert again(is_positive)(1) is True
    assert compilations == ["is_positive"]
    assert not folder.exists()
    # What somebody else put there is not run.
    monkeypatch.setattr(code_store, "_owner_of_program", lambda: entry.stat().st_uid + 1)
    assert again(is_positive)(1) is True
    assert compilations == ["is_positive"] * 2


def test_where_the_program_cannot_be_written_the_cache_is_used(
    folder: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setattr(code_store, "program_directory", lambda: tmp_path / "file" / "below")
    monkeypatch.delenv("INVERSE_SERVICE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    assert again(is_positive)(1) is True
    assert [path.suffix for path in (folder / "inverse-service").iterdir()] == [".modular"]


def test_where_llvm_refuses_numba_does_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*given: Any) -> bytes:
        raise RuntimeError("LLVM IR parsing error")

    monkeypatch.setattr(building, "object_code", refused)
    assert again(is_positive)(1) is True
    assert not folder.exists()


def test_a_kernel_never_writes_what_is_to_be_read_only(folder: Path) -> None:
    kernel = Kernel(put)
    own = np.zeros(4, np.int64)
    kernel(own, 1, 7)
    assert own.tolist() == [0, 7, 0, 0]
    immutable = bytes(32)
    for array in (np.frombuffer(immutable, np.int64), frozen(own)):
        with pytest.raises(TypingError):
            kernel(array, 0, 7)
    assert immutable == bytes(32)
    assert own.tolist() == [0, 7, 0, 0]


@pytest.mark.slow
def test_a_kernel_that_only_reads_takes_both(folder: Path) -> None:
    kernel, own = Kernel(total), np.arange(4)
    assert [kernel(array) for array in (own, frozen(own), own)] == [6, 6, 6]


def frozen(array: Any) -> Any:
    copy = array.copy()
    copy.setflags(write=False)
    return copy


def put(array, k, value):  # type: ignore[no-untyped-def]
    array[k] = value


def total(array):  # type: ignore[no-untyped-def]
    found = 0
    for k in range(len(array)):
        found += array[k]
    return found


def test_no_argument_is_kept_and_none_is_lost(folder: Path) -> None:
    kernel, own = Kernel(total), np.arange(4)
    kernel(own)
    held = sys.getrefcount(own)
    for _ in range(100):
        kernel(own)
        kernel(own[::2])
    assert sys.getrefcount(own) == held
    own.resize(6, refcheck=False)
    assert kernel(own) == 6


class Growth(NamedTuple):
    """A table and what is added to it."""

    table: Any
    steps: Any


@compiled
def add_steps(pair: Any, factor: int) -> int:
    for k in range(len(pair.steps)):
        pair.table[k] += factor * pair.steps[k]
    return int(pair.table[0])


def test_what_is_kept_is_held_as_long_as_its_owner_lives_and_read_anew_at_each_call(folder: Path) -> None:
    kernel, kept = Kernel(add_steps.py_func), Kept(Growth(np.zeros(3, np.int64), np.arange(3) + 1))  # type: ignore[attr-defined]
    assert [kernel(kept.struct, factor) for factor in (1, -5)] == [1, -4]
    kept.struct.steps[0] = 100
    assert kernel(kept.struct, 1) == 96
    assert kept.struct.table.tolist() == [96, -6, -9]
    address, table = id(kept.struct), kept.struct.table
    assert kernels._held[address][0] is kept.struct
    held = sys.getrefcount(table)
    del kept
    assert address not in kernels._held
    assert sys.getrefcount(table) == held - 1


def test_a_kernel_is_compiled_once_whatever_its_arguments_are() -> None:
    """A struct of equal numbers and an array that is only read are typed as the compiler finds them."""
    taken: Any = (modular.field_of(modular.safe_prime(3)), frozen(np.arange(3)), True)
    dispatcher = building.dispatcher(chosen_word)
    building.object_code(dispatcher, kinds_of(taken, []))
    assert len(dispatcher.overloads) == 1


def chosen_word(field, places, first):  # type: ignore[no-untyped-def]
    return field.prime if first else field.one + np.uint64(places[0])


def test_small_tables_are_held_and_what_may_change_or_is_large_is_not(folder: Path) -> None:
    kernel, small, large = Kernel(total), frozen(np.arange(4)), frozen(np.arange(10_000))
    view, changing = large[:4], np.arange(4)
    assert [kernel(array) for array in (small, view, changing, small)] == [6] * 4
    assert kernel(large) == 10_000 * 9_999 // 2
    assert [id(array) in kernels._held for array in (small, large, view, changing)] == [True, False, False, False]
    for k in range(1000):
        assert kernel(frozen(np.array([k]))) == k
    assert len(kernels._held) <= kernels._MOST_HELD


def test_where_addresses_have_other_sizes_numba_does_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "POINTERS_OF_64_BITS", False)
    assert again(is_positive)(1) is True
    assert not folder.exists()


def test_every_kernel_says_what_it_is_made_from() -> None:
    """One that does not is compiled anew in every process, which nobody would notice but by the second it takes."""
    rooms = ((f"{inverse_service.__path__[0]}/{room}", f"inverse_service.{room}.") for room in WITH_KERNELS)
    names = [one.name for folder, prefix in rooms for one in pkgutil.walk_packages([folder], prefix)]
    modules = map(importlib.import_module, names)
    found = {value for module in modules for value in vars(module).values() if isinstance(value, Kernel)}
    assert len(found) > 50
    for kernel in found:
        kernel_digest(kernel.py_func, ("int64",))


WITH_KERNELS = ("algebra", "linear_pde", "inverse_problem")
SOLVE = """
import sys
from inverse_service import solve
result = solve({"equations": {equations!r}})
print(result["verdict"], "numba" in sys.modules)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("equations", "verdict"),
    [
        ("x'' = -x", "variational"),
        ("x'' = -y'; y'' = y", "not_variational"),
        ("x'' = -y; y'' = x*y'", "variational"),
        ("x'' = -x*x'^2 - 2*x'/t", "variational"),
        ("x'' = -x'^3; y'' = -y*x'", "not_variational"),
    ],
)
def test_numba_is_not_imported_where_the_kernels_are_stored(equations: str, verdict: str) -> None:
    command = [sys.executable, "-c", SOLVE.replace("{equations!r}", repr(equations))]
    first, second = (subprocess.run(command, capture_output=True, text=True, timeout=120) for _ in range(2))
    assert first.stdout.split()[0] == verdict, first.stderr
    assert second.stdout.split() == [verdict, "False"]


MANY = """
from inverse_service.machine_code.kernels import compiled

@compiled
def thrice(number):
    return 3 * number

print(thrice(7))
"""


@pytest.mark.slow
def test_processes_that_compile_at_once_leave_one_entry(folder: Path) -> None:
    environment = {**os.environ, "INVERSE_SERVICE_CACHE": str(folder)}
    command = [sys.executable, "-c", MANY]
    children = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    ended = [child.communicate(timeout=120) for child in children]
    assert [out for out, _ in ended] == ["21\n"] * 3, ended
    assert [path.suffix for path in folder.iterdir()] == [".modular"]


class Pair(NamedTuple):
    """Numbers with the factor that belongs to them."""

    numbers: Any
    factor: int


class Turned(NamedTuple):
    """The same in the other order."""

    factor: int
    numbers: Any


class Store(NamedTuple):
    """A struct that holds another one."""

    pair: Pair
    sums: Any


@compiled
def add_pairs(given: Store, place: int) -> int:
    for number in given.pair.numbers:
        given.sums[place] += number * given.pair.factor
    return given.sums[place] - given.pair.factor  # type: ignore[no-any-return]


def test_structs_are_read_by_their_names_from_the_store_as_from_the_compiler(
    folder: Path, compilations: list[str]
) -> None:
    for _ in range(2):
        given = Store(Pair(np.array([1, 2, 4]), 10), np.zeros(2, np.int64))
        assert again(add_pairs)(given, 1) == 60
        assert given.sums.tolist() == [0, 70]
    assert compilations == ["add_pairs"]
    assert len(list(folder.iterdir())) == 1


def test_a_struct_with_other_names_or_another_order_is_other_code(folder: Path, compilations: list[str]) -> None:
    """The same numbers and arrays in a row, and a kernel of the same text."""
    Turned.__qualname__ = Pair.__qualname__
    pairs: list[Any] = [Pair(np.array([3]), 2), Turned(2, np.array([3]))]
    for pair in pairs:
        assert again(add_pairs)(Store(pair, np.zeros(1, np.int64)), 0) == 4
    assert compilations == ["add_pairs", "add_pairs"]


def test_arrays_in_a_struct_that_are_read_only_are_not_written(folder: Path) -> None:
    sums = np.zeros(1, np.int64)
    sums.setflags(write=False)
    with pytest.raises(TypingError):
        again(add_pairs)(Store(Pair(np.array([1]), 1), sums), 0)
    assert sums.tolist() == [0]


def test_a_tuple_without_names_is_left_to_numba() -> None:
    assert kinds_of(((1, 2), 3), []) is None
    assert kinds_of((Pair(np.array([1.5]), 1),), []) is None


def test_what_is_kept_of_a_struct_is_that_of_the_same_struct_only(folder: Path) -> None:
    """Those of read-only arrays are known by their identity; others, and later ones at that place, are looked at."""
    work, sums = again(add_pairs), np.zeros(1, np.int64)
    for factor in range(600):
        numbers = np.array([factor, 1])
        numbers.setflags(write=factor % 2 == 0)
        pair = Pair(numbers, factor)
        for _ in range(2):
            sums[0] = 0
            assert work(Store(pair, sums), 0) == factor * (factor + 1) - factor
        del pair, numbers
