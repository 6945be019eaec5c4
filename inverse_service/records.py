"""Data classes like those of the standard library, declared in a fraction of the time.

`dataclasses.dataclass` compiles five or six functions for every class, some 0.5 ms, and a command loads three hundred
classes of which most never have an object. Here only `__init__` is compiled, and only for the first object; all other
methods need the names of the fields and no code of their own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from operator import attrgetter
from types import MethodType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(*, frozen: bool = False, slots: bool = False, eq: bool = True) -> Callable[[type], type]:
        """The decorator `dataclasses.dataclass`, with the options that are used here."""
        return lambda cls: _declared(cls, frozen, slots, eq)


def _declared(cls: type, frozen: bool, slots: bool, eq: bool) -> type:
    own = frozenset(vars(cls))
    hashed = "__hash__" in own and not (cls.__hash__ is None and "__eq__" in own)
    cls.__doc__ = cls.__doc__ or cls.__name__  # without one, the library works out a signature
    made: Any = dataclasses.dataclass(init=False, repr=False, eq=False, slots=slots)(cls)
    fields = dataclasses.fields(made)
    methods: dict[str, Any] = {"__init__": _FirstInit(made, frozen), "__repr__": _repr(fields)}
    if eq:
        methods |= _comparison(fields)
    for name, method in methods.items():
        if name not in own and not (name == "__hash__" and hashed):
            setattr(made, name, method if name != "__hash__" or frozen else None)
    if frozen:
        rules: dict[str, Any] = {"__setattr__": _refuse_to_set, "__delattr__": _refuse_to_delete}
        if slots:  # pickle would set the attributes one by one
            rules |= {"__getstate__": _state, "__setstate__": _set_state}
        for name, method in rules.items():
            setattr(made, name, method)
    result: type = made
    return result


def _comparison(fields: tuple[dataclasses.Field[Any], ...]) -> dict[str, Any]:
    """Equality and hash of the tuple of fields, for objects of one class."""
    names = [field.name for field in fields if field.compare]
    values: Callable[[Any], Any] = attrgetter(*names) if len(names) > 1 else _one_or_none(names)

    def equal(self: Any, other: Any) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    def hash_of(self: Any) -> int:
        return hash(values(self))

    return {"__eq__": equal, "__hash__": hash_of}


def _one_or_none(names: list[str]) -> Callable[[Any], Any]:
    return lambda record: tuple(getattr(record, name) for name in names)


def _repr(fields: tuple[dataclasses.Field[Any], ...]) -> Callable[[Any], str]:
    names = [field.name for field in fields if field.repr]
    return lambda self: f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"


class _FirstInit:
    """An `__init__` that puts the compiled one in its place and calls it."""

    def __init__(self, made: type, frozen: bool) -> None:
        self._made, self._frozen = made, frozen

    def __get__(self, record: Any, owner: type | None = None) -> Any:
        return self if record is None else MethodType(self, record)

    def __call__(self, record: Any, *arguments: Any, **named: Any) -> None:
        self._replaced()(record, *arguments, **named)

    @property
    def __signature__(self) -> Any:  # for help() and notebooks
        import inspect

        return inspect.signature(self._replaced())

    def _replaced(self) -> Callable[..., None]:
        init = _compiled_init(self._made, self._frozen)
        self._made.__init__ = init  # type: ignore[misc]
        return init


def _compiled_init(made: type, frozen: bool) -> Callable[..., None]:
    names: dict[str, Any] = {"_set": object.__setattr__, "_LEFT_OUT": dataclasses.MISSING}
    head, body = ["self"], []
    for field in dataclasses.fields(made):
        name, value = field.name, field.name
        if field.default is not dataclasses.MISSING:
            names[f"_of_{name}"], default, other = field.default, f"=_of_{name}", f"_of_{name}"
        elif field.default_factory is not dataclasses.MISSING:
            names[f"_of_{name}"], default, other = field.default_factory, "=_LEFT_OUT", f"_of_{name}()"
            value = f"{other} if {name} is _LEFT_OUT else {name}"
        else:
            default = other = ""
        if field.init:
            head.append(name + default)
        elif other:
            value = other
        else:
            continue
        body.append(f"_set(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(made, "__post_init__"):
        body.append("self.__post_init__()")
    source = f"def __init__({', '.join(head)}):\n " + "\n ".join(body or ["pass"])
    exec(source, names)  # the names of fields are those of our own classes
    init: Callable[..., None] = names["__init__"]
    init.__qualname__ = f"{made.__qualname__}.__init__"
    init.__annotations__ = {field.name: field.type for field in dataclasses.fields(made) if field.init}
    return init


def _refuse_to_set(self: Any, name: str, value: Any) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _set_state(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)
