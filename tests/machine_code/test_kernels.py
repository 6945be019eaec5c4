"""Kernels agree with their Python source, from the store and from the compiler, and stored entries
are verified.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pytest

from inverse_service.kernels.machine_code import building
from inverse_service.kernels.machine_code.argument_kinds import kinds_of
from inverse_service.kernels.machine_code.kernels import Kernel, compiled
from inverse_service.kernels.machine_code.loading import Unstorable, kernel_digest

WEIGHT = 3


@compiled
def weighted(a: int) -> int:
    return WEIGHT * a


@compiled
def add_up(first: int, steps: Any, table: Any, factor: np.uint64, negative: bool) -> int:
    """Change the table and return a sum."""
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
    """The kernels that were compiled instead of found."""
    names: list[str] = []
    real = building.object_code

    def counted(compiler: Any, kinds: tuple[str, ...]) -> tuple[bytes, str]:
        names.append(compiler.__name__)
        return real(compiler, kinds)

    monkeypatch.setattr(building, "object_code", counted)
    return names


def again(kernel: Any) -> Kernel:
    """The kernel as in a new process, without machine code."""
    return Kernel(kernel.py_func)


def arguments(seed: int) -> tuple[Any, ...]:
    random = np.random.default_rng(seed)
    table = random.integers(0, 2**63, (2, 3)).astype(np.uint64)
    return (
        int(random.integers(-9, 9)),
        random.integers(-99, 99, 5),
        table,
        np.uint64(2**61 - 1),
        bool(seed % 2),
    )


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
    # An array from a pickle has its own element type object.
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
def test_damaged_code_is_compiled_again(folder: Path, compilations: list[str], damage: str) -> None:
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


def test_a_folder_that_cannot_be_written_costs_time_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("INVERSE_SERVICE_CACHE", str(tmp_path / "file" / "below"))
    assert again(is_positive)(1) is True
