"""Data classes of `records` do what those of the standard library do."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
from dataclasses import field
from functools import cached_property

import pytest

from inverse_service.records import dataclass


@dataclass(frozen=True, slots=True)
class Point:
    x: int
    y: int = 2
    seen: list[int] = field(default_factory=list, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Named(Point):
    """A subclass has the fields of its base first."""

    name: str = ""

    def __hash__(self) -> int:
        return 7


@dataclass(frozen=True)
class Cached:
    values: tuple[int, ...]
    sum: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sum", sum(self.values))

    @cached_property
    def largest(self) -> int:
        """The work of a property is done once."""
        return max(self.values)


@dataclass(slots=True)
class Counter:
    left: int
    log: dict[str, int] = field(init=False, default_factory=dict)


@dataclass(slots=True, eq=False)
class Same:
    x: int


@dataclass(frozen=True, slots=True)
class Nothing:
    """No fields at all."""


def test_equal_fields_of_one_class_are_equal_and_hash_alike() -> None:
    assert Point(1) == Point(1, 2, [9]) != Point(1, 3)
    assert Point(1) != Named(1)
    assert hash(Point(1)) == hash(Point(1, 2)) == hash((1, 2))
    assert hash(Cached((1,))) == hash(((1,), 1))
    assert (Nothing(), hash(Nothing())) == (Nothing(), hash(()))
    assert hash(Named(1)) == 7
    assert Counter(1) == Counter(1)
    assert Same(1) != Same(1)
    with pytest.raises(TypeError, match="unhashable"):
        hash(Counter(1))


def test_frozen_objects_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError, match="'x'"):
        Point(1).x = 2  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError, match="'x'"):
        del Point(1).x
    counter = Counter(1)
    counter.left -= 1
    assert counter.left == 0


def test_each_object_has_defaults_of_its_own() -> None:
    assert Point(1).seen is not Point(1).seen
    assert Counter(1).log is not Counter(1).log
    assert (Cached((1, 5)).sum, Cached((1, 5)).largest) == (6, 5)


def test_objects_survive_pickle_and_replace_and_match() -> None:
    point = Named(1, 4, [5], "p")
    again = pickle.loads(pickle.dumps(point))
    assert (again, again.seen) == (point, [5])
    assert pickle.loads(pickle.dumps(Counter(3))) == Counter(3)
    assert dataclasses.replace(point, y=0) == Named(1, 0, [5], "p")
    assert dataclasses.asdict(Point(1)) == {"x": 1, "y": 2, "seen": []}
    assert repr(point) == "Named(x=1, y=4, name='p')"
    match point:
        case Named(x, y):
            assert (x, y) == (1, 4)


@pytest.mark.parametrize(("arguments", "named"), [((), {}), ((1, 2, [], 4), {}), ((1,), {"z": 2}), ((1,), {"x": 2})])
def test_arguments_that_do_not_fit_are_refused_at_each_call(arguments: tuple[int], named: dict[str, int]) -> None:
    for _ in range(2):
        with pytest.raises(TypeError, match=r"__init__\(\)"):
            Point(*arguments, **named)


def test_the_signature_is_known_before_there_is_an_object() -> None:
    @dataclass(frozen=True, slots=True)
    class Late:
        x: int
        y: int = 2

    assert str(inspect.signature(Late)) == "(x: 'int', y: 'int' = 2)"
    assert str(inspect.signature(Point)).startswith("(x: 'int', y: 'int' = 2, seen: 'list[int]' =")
