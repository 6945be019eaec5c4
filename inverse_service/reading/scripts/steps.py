"""The rates of a program that moves its state by itself: one step of its loop, as the step goes to 0.

Every method that converges gives x + x' dt + ...: Euler's, Verlet's, leapfrog, that of Runge and Kutta. A name that a
step takes over from the one before (`a` of the velocity Verlet method) has its value at the end of a step; x_n+1 =
2 x_n - x_n-1 + a dt^2 gives x'' = a. Values are cut at the order of dt that counts, so that stages stay short.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

from inverse_service.expressions import collecting, printing, tree as ex
from inverse_service.reading.scripts import nodes as nd, values as vs
from inverse_service.reading.scripts.machine import Machine, set_in
from inverse_service.reading.scripts.nodes import names_of, walk
from inverse_service.reading.scripts.values import Value

_MOST_ENTRIES = 6  # of a vector
_NEXT, _BEFORE = "+", "-"  # x[i+1] and x[i-1] where x[i] is the present
_MOST_ROUNDS = 4
_SPEED = re.compile(
    r"[vVw]|p[xyz\d]?(?:_\w+)?\Z|omega|.*(?:dot|rate|_v|_p|_vel\w*)(?:_\d+)?\Z|d[a-z]+\Z"
)


@dataclass(frozen=True, slots=True)
class Step:
    """What a loop repeats, or a function that moves names around it, with the names before it, and
    the name that counts.
    """

    body: tuple[nd.Node, ...]
    names: Mapping[str, Value]
    counter: str = ""
    is_plain: bool = False  # lines without a loop, which may be no step


def rates_of(machine: Machine, step: Step) -> dict[str, ex.Expression] | None:
    """The rate of each name that a step moves; None where it moves none, NotRead or Trap where what
    it does is not a step in time.
    """
    body = _without_wraps(_one_place(machine, step))
    known = {*machine.stated.steps} & {
        node.text for one in body for node in walk(one) if isinstance(node, nd.Name)
    }
    carried = _carried(body, step.names)
    if not carried:
        return None
    if not known:
        body = tuple(_with_step(one, carried) for one in body)
    seeds = {name: _seed(machine, name, step.names) for name in carried}
    rates = None
    for now, before in _kept(body, carried):
        rates = rates or _of_two_steps(machine, body, step, seeds, now, before)
    if rates is None:
        rates = _Found.of(machine, body, step, seeds, 1).rates()
    if not known and not {*rates.values()} & {*map(ex.Symbol, rates)}:
        return None  # x += v is a step of 1; of x += 0.01*v nobody knows
    order = sorted(rates, key=lambda name: bool(_SPEED.match(name)))  # x before v, however set
    return {name: _shortest(rates[name]) for name in order}


def _shortest(tree: ex.Expression) -> ex.Expression:
    plain = collecting.collect(tree)
    return min((tree, plain), key=lambda one: len(printing.to_text(one)))


@dataclass(slots=True)
class _Found:
    """The value of each symbol of the state after one step."""

    ends: dict[ex.Symbol, ex.Expression]
    unread: dict[ex.Symbol, nd.NotRead]

    @classmethod
    def of(
        cls,
        machine: Machine,
        body: Sequence[nd.Node],
        step: Step,
        seeds: Mapping[str, Value],
        order: int,
    ) -> _Found:
        given = {**step.names, **seeds, **dict.fromkeys(machine.stated.steps, vs.STEP)}
        constant = isinstance(step.names.get(machine.time), vs.TREES)
        if not constant or machine.time in {step.counter, *set_in(body)}:  # tau = 0.5 is no time
            given[machine.time] = ex.TIME
        if step.counter not in ("", machine.time):  # t = i*dt
            given[step.counter] = ex.TIME / vs.STEP
        found = cls({}, {})
        machine.order, kept = order, machine.order
        try:
            with machine.inside(given, {}):
                for one in body:
                    machine.statement(one)
                after = dict(machine.names)
        finally:
            machine.order = kept
        for name, seed in seeds.items():
            end = after.get(name)
            begins = vs.listed(seed) or [seed]
            ends = [end] * len(begins) if isinstance(end, nd.NotRead) else vs.listed(end) or [end]
            if len(begins) != len(ends):
                raise nd.NotRead("a state that changes its length")
            for begin, last in zip(begins, ends, strict=True):
                if not isinstance(begin, ex.Symbol) or begin == ex.TIME:
                    continue
                if isinstance(last, nd.NotRead):
                    found.unread[begin] = last
                else:
                    found.ends[begin] = vs.scalar(last)
        return found

    def rates(self) -> dict[str, ex.Expression]:
        limits = {name: _at_once(end) for name, end in self.ends.items()}
        still = {name for name, end in limits.items() if collecting.collect(end - name) == ex.ZERO}
        table: dict[ex.Expression, ex.Expression] = {
            name: end for name, end in limits.items() if name not in still
        }
        for _ in range(_MOST_ROUNDS):  # what a step takes over is a function of the state
            table = {name: ex.substitute(end, table) for name, end in table.items()}
        if not still and any(ex.holds(self.ends[name], name, vs.STEP) for name in limits):
            raise nd.Trap("a value of the step before")
        found = {name.name: _slope(self.ends[name], 1) for name in self.ends if name in still}
        found = {name: ex.substitute(rate, table) for name, rate in found.items()}
        found = {name: rate for name, rate in found.items() if rate != ex.ZERO}
        found = _with_clock(found)
        for rate in found.values():
            for name, reason in self.unread.items():
                if ex.holds(rate, name):
                    raise reason
            if any(ex.holds(rate, name) for name in table):
                raise nd.Trap("a value of the step before")
        return found


def _of_two_steps(
    machine: Machine,
    body: Sequence[nd.Node],
    step: Step,
    seeds: Mapping[str, Value],
    now: str,
    before: str,
) -> dict[str, ex.Expression] | None:
    """x' = v, v' = a of x_before = x; x = 2 x - x_before + a dt^2; None for another rule."""
    begins = vs.listed(seeds[now]) or [seeds[now]]
    if not all(isinstance(one, ex.Symbol) for one in begins):
        return None
    speeds = [ex.Symbol(one.name + "_rate") for one in begins]
    velocity: Value = speeds if isinstance(seeds[now], list) else speeds[0]
    if isinstance(seeds[now], vs.Matrix):
        velocity = vs.column(speeds)
    given = {**seeds, before: vs.added(seeds[now], vs.multiplied(vs.STEP, velocity), -1)}
    try:
        found = _Found.of(machine, body, step, given, 2)
        rates: dict[str, ex.Expression] = {}
        for one, speed in zip(begins, speeds, strict=True):
            end = found.ends[one]
            other = collecting.collect(_at_once(end) - one) != ex.ZERO
            if other or collecting.collect(_slope(end, 1) - speed) != ex.ZERO:
                return None
            rates |= {one.name: speed, speed.name: _slope(end, 2) / ex.number(2)}
    except (nd.NotRead, KeyError):
        return None
    known = {ex.Symbol(name) for name in rates}
    if any(ex.holds(rate, name) for rate in rates.values() for name in {*found.ends} - known):
        return None
    return rates


def _kept(body: Sequence[nd.Node], carried: Sequence[str]) -> Iterator[tuple[str, str]]:
    """x and x_before of x_before = x."""
    for one in body:
        match one:
            case nd.Assign(target=nd.Name(text=before), value=nd.Name(text=now), sign="") if {
                now,
                before,
            } <= {*carried}:
                yield now, before


def _with_clock(rates: dict[str, ex.Expression]) -> dict[str, ex.Expression]:
    """The rates with t for a name that grows by the step."""
    clocks: dict[ex.Expression, ex.Expression] = {
        ex.Symbol(name): ex.TIME for name, rate in rates.items() if rate == ex.ONE
    }
    return {
        name: ex.substitute(rate, clocks)
        for name, rate in rates.items()
        if ex.Symbol(name) not in clocks
    }


def _at_once(tree: ex.Expression) -> ex.Expression:
    return vs.cut(tree, 0)


def _slope(tree: ex.Expression, order: int) -> ex.Expression:
    for _ in range(order):
        tree = vs.partial(tree, vs.STEP)
    return vs.cut(tree, 0)


# -- the body of a step


def _carried(body: Sequence[nd.Node], names: Mapping[str, Value]) -> list[str]:
    """The names that a step reads before it sets them."""
    targets, done = {*set_in(body)}, set[str]()
    found: dict[str, None] = {}
    for one in body:
        if isinstance(one, nd.Function):
            done.add(one.name)
            continue
        if not isinstance(one, nd.Assign):
            used = [node.text for node in walk(one) if isinstance(node, nd.Name)]
            found |= dict.fromkeys(name for name in used if name in targets - done)
            continue
        used = [node.text for node in walk(one.value) if isinstance(node, nd.Name)]
        if one.sign:
            used += names_of(one.target)
        elif not isinstance(one.target, nd.Name | nd.Items):  # one entry is set, others stay
            used += [name for name in names_of(one.target) if name in names]
            done |= {name for name in names_of(one.target) if name not in names}
        found |= dict.fromkeys(name for name in used if name in targets - done)
        if isinstance(one.target, nd.Name | nd.Items):
            done |= {*names_of(one.target)}
    return [*found]


def _seed(machine: Machine, name: str, names: Mapping[str, Value]) -> Value:
    """The symbols of a name before the step: of a vector, as many as it has entries."""
    plain = name.removesuffix(_BEFORE)
    if plain == machine.time:
        return ex.TIME
    base = machine.clean(plain) + "_before" * (plain != name)
    held = names.get(plain)
    count = 0
    if isinstance(held, vs.Filled):
        for value in held.entries.values():
            count = max(count, len(vs.listed(value) or ()))
        sizes = [size for size in held.zeros or () if 1 < size <= _MOST_ENTRIES]
        is_table = held.zeros is not None and 1 not in held.zeros
        count = count or (sizes[-1] if sizes and is_table else 0)
    elif isinstance(held, list | vs.Matrix):
        entries = vs.listed(held) or []
        count = len(entries) if all(isinstance(one, vs.TREES) for one in entries) else 0
    if not 0 < count <= _MOST_ENTRIES * 4:
        return ex.Symbol(base)
    symbols: list[Any] = [ex.Symbol(f"{base}_{k + 1}") for k in range(count)]
    if isinstance(held, vs.Matrix):
        return vs.column(symbols) if len(held.rows) > 1 else vs.Matrix((tuple(symbols),))
    return symbols


def _without_wraps(body: Sequence[nd.Node]) -> tuple[nd.Node, ...]:
    """The statements without x = x % (2*pi), which changes no equation, and without what says that
    names are those around.
    """
    return tuple(one for one in body if not _wraps(one))


def _wraps(one: nd.Node) -> bool:
    match one:
        case nd.Stop(is_around=is_around):
            return is_around
        case nd.Assign(
            target=nd.Name(text=name),
            value=nd.Call(function=nd.Name(text="<Mod>"), arguments=[nd.Name(text=of), *_]),
        ):
            return name == of
    return False


def _with_step(one: nd.Node, carried: Collection[str]) -> nd.Node:
    """x += v*dt for the x += v of a program whose step is 1, where x is of the step before."""
    match one:
        case nd.Assign(target=nd.Name(text=name), sign="+" | "-", value=value) if name in carried:
            return replace(one, value=_times_step(value))
        case nd.Assign(
            target=nd.Name(text=name),
            sign="",
            value=nd.Binary(sign="+" | "-", left=nd.Name(text=same), right=right) as value,
        ) if name == same and name in carried:
            return replace(one, value=replace(value, right=_times_step(right)))
    return one


def _times_step(value: nd.Node) -> nd.Node:
    return nd.Binary(value.at, "*", nd.Name(value.at, "<step>"), value)


# -- arrays that are filled step by step


def _one_place(machine: Machine, step: Step) -> tuple[nd.Node, ...]:
    """The body with x for x[i], x+ for x[i+1], and x- for x[i-1], and what is passed on at its end."""
    counters = {step.counter} | {
        one.target.text
        for one in step.body
        if isinstance(one, nd.Assign) and isinstance(one.target, nd.Name) and one.sign == "+"
    }
    counters.discard("")
    reads: dict[str, set[int]] = {}
    sets: dict[str, set[int]] = {}
    for one in step.body:
        for node in walk(one):
            if (place := _place(node, counters)) is not None:
                reads.setdefault(place[0], set()).add(place[1])
            if isinstance(node, nd.Assign) and (inner := _innermost(node.target, counters)):
                sets.setdefault(inner[0], set()).add(inner[1])
    if not sets:
        return step.body
    last = max(max(offsets) for offsets in sets.values())
    fills = [name for name in sets if last in sets[name] and last - 1 in reads.get(name, set())]
    if not fills:  # the step only keeps what it finds
        last += 1

    def renamed(node: Any) -> Any:
        if isinstance(node, tuple):
            return tuple(map(renamed, node))
        if not isinstance(node, nd.Node):
            return node
        if (place := _place(node, counters)) is not None:
            name, offset, others = place
            if name == machine.time:
                return nd.Name(node.at, name)
            mark = {0: _NEXT, -1: "", -2: _BEFORE}.get(offset - last)
            if mark is None:
                raise nd.NotRead("a value of many steps before", node.at)
            base = nd.Name(node.at, name + mark)
            return nd.Index(node.at, base, renamed(others)) if others else base
        fields = {name: renamed(getattr(node, name)) for name in node.__dataclass_fields__}
        return type(node)(**fields)

    body: list[nd.Node] = [renamed(one) for one in step.body]
    at = step.body[-1].at
    for name in fills:
        if last - 2 in reads[name]:
            body.append(nd.Assign(at, nd.Name(at, name + _BEFORE), nd.Name(at, name)))
        body.append(nd.Assign(at, nd.Name(at, name), nd.Name(at, name + _NEXT)))
    return tuple(body)


def _innermost(target: nd.Node, counters: set[str]) -> tuple[str, int] | None:
    for node in walk(target):
        if (place := _place(node, counters)) is not None:
            return place[0], place[1]
    return None


class _Place(NamedTuple):
    """x, 1, and the other places of x[i+1] and x[i+1, 0]."""

    name: str
    offset: int
    others: tuple[nd.Node, ...]


def _place(node: nd.Node, counters: set[str]) -> _Place | None:
    match node:
        case nd.Index(base=nd.Name(text=name), places=places):
            pass
        case nd.Call(function=nd.Name(text=name), arguments=places, keywords=()):
            pass
        case _:
            return None
    offsets = [_offset(place, counters) for place in places]
    if sum(offset is not None for offset in offsets) != 1:
        return None
    others = [place for place, offset in zip(places, offsets, strict=True) if offset is None]
    whole = all(
        isinstance(one, nd.Slice) and one.first is None and one.last is None for one in others
    )
    offset = next(offset for offset in offsets if offset is not None)
    return _Place(name, offset, () if whole else tuple(others))


def _offset(place: nd.Node, counters: set[str]) -> int | None:
    match place:
        case nd.Name(text=name) if name in counters:
            return 0
        case nd.Binary(
            sign="+" | "-" as sign,
            left=nd.Name(text=name),
            right=nd.Constant(value=Fraction() as number),
        ) if name in counters and number.denominator == 1:
            return int(number) if sign == "+" else -int(number)
    return None


def steps_in(
    machine: Machine, functions: Sequence[nd.Function], body: Sequence[nd.Node]
) -> Iterator[Step]:
    """The loops of a program that was run, and the functions that move names around them; of lines
    without either, these lines.
    """
    seen: set[int] = set()
    if not machine.stated.loops and not functions:
        yield Step(tuple(body), {}, is_plain=True)
    for block, names in machine.stated.loops:
        if id(block) not in seen:
            seen.add(id(block))
            yield Step(block.body, names, block.counter)
    for one in functions:
        around = any(isinstance(node, nd.Stop) and node.is_around for node in one.body)
        if around or any(isinstance(node, nd.Assign) and node.sign for node in one.body):
            closure = machine.stated.closures.get(one)
            outer = closure.names if closure is not None else machine.names
            given = {name: vs.Array(name, machine.dialect.first) for name in one.parameters}
            yield Step(one.body, {**outer, **given})
