"""Shorthand of numerical programs, rewritten as equations: tokens in, tokens out. The right-hand
sides themselves are in `right_sides`.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import compress
from typing import NamedTuple

from inverse_service.expressions.refusals import fault
from inverse_service.reading import entries as ar, labels, right_sides, slices, tokens as tk
from inverse_service.reading.names import FUNCTIONS, Names
from inverse_service.reading.tokens import Line, Token, Tokens, at

# D2x and Dx, ddx and dx, xdd and x_d.
_SHORT = (
    re.compile(r"(?P<mark>D[2-9]?)(?P<name>[A-Za-z]\w*)"),
    re.compile(r"(?P<mark>dd?)(?P<name>[A-Za-z]\w*)"),
    re.compile(r"(?P<name>[A-Za-z]\w*?)_?(?P<mark>dd?)"),
)
_DOTS = {"dot": 1, "ddot": 2}
_TAYLOR = "taylor_adaptive"
_SOLVERS = frozenset(
    (_TAYLOR, f"{_TAYLOR}_batch", "ode45", "ode23", "ode113", "ode15s", "ode23s", "ode78", "ode89")
)
_SECOND_ORDER = "second_order"
_STATIC_ARRAYS = ("SA", "SVector", "MVector")  # SA[dx, dv]
_LISTS = ("array", "asarray", "vstack", "hstack", "concatenate", "stack")


def as_equations(tokens: Tokens, names: Names) -> Tokens:
    """The same statements as equations; tokens that no rule fits are returned unchanged.

    Values beside the rates, as in g = 9.81; dydt = [y(2); -g*y(1)], remain beside the equations.
    """
    tokens = _with_second_rates(_with_plain_lists(_with_glued_rates(_with_sums(tokens))))
    tokens = _with_single_rates(_with_primed_entries(slices.without_slices(tokens)))
    tokens = _with_values_apart(labels.without_repeated(tokens))
    tokens = _without_named_sides(_without_arrays(tokens))
    tokens, entries = _with_entries(_with_time(tokens, names))
    found = _of_statements(tokens, names)
    if not entries:
        return found
    arrays = {name: ar.Array.of(name, tokens) for name, _ in entries.values()}
    given = {arrays[array].entry(k): name for (name, n), (array, k) in entries.items() if not n}
    for array in arrays.values():
        found = array.with_names(found)
    return _with_given_names(found, given)


def _with_sums(line: Line) -> Tokens:
    """(a + b) for Python's sum([a, b]), and hy.sum([a, b])."""
    found: Tokens = []
    for token in line:
        token = tk.within(token, _with_sums)
        whole = at(token.inside, 0)
        listed = token.is_bracket() and len(token.inside) == 1 and whole.is_bracket("[")
        if listed and at(found, len(found) - 1).text == "sum":
            plus = replace(whole, kind="operator", text="+", inside=())
            terms = [tk.bracket(term, whole) for term in tk.split_at(",", whole.inside)]
            found.pop()
            if at(found, len(found) - 1).is_operator("."):
                del found[-2:]
            token = replace(token, inside=tuple(one for term in terms for one in (plus, term))[1:])
        found.append(token)
    return found


def _with_glued_rates(tokens: Tokens) -> Tokens:
    """dtheta for the d\u03b8 of d\u03b8 = \u03c9 and d\u03b8 = u[2], and ddtheta and dtheta for those of Julia's
    function h!(dd\u03b8, d\u03b8, \u03b8, p, t).
    """
    starts = [part[:3] for part, _ in tk.split(tokens, lambda _, token: token.is_operator(";"))]
    glued = {
        start[1].text
        for start in starts
        if at(start, 0).text == "d" and at(start, 2).is_operator("=") and _touches(at(start, 1))
    }
    for start in starts:
        if at(start, 0).text == _SECOND_ORDER:
            listed = tk.split_at(",", at(start, 1).inside)
            glued |= {one[1].text for one in listed if len(one) == 2 and _touches(one[1])}

    def joined(line: Line) -> Tokens:
        found: Tokens = []
        for token in line:
            last = at(found, len(found) - 1)
            marked = last.text in ("d", "dd") and not last.order
            if marked and token.text in glued and _touches(token):
                found[-1] = replace(last, text=f"{last.text}{token.text}", order=token.order)
            else:
                found.append(tk.within(token, joined))
        return found

    return joined(tokens) if glued else tokens


def _touches(token: Token) -> bool:
    """Whether this is a name without a blank before it."""
    return token.kind == "name" and not token.space_before


def _with_single_rates(tokens: Tokens) -> Tokens:
    """du[1] = v; du[2] = -u[1] for du[1], du[2] = v, -u[1], and xd = v; vd = -x for
    [xd; vd] = [v; -x].
    """
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        sides = tk.split_at("=", part)
        zero = len(sides) == 2 and tk.spelled(sides[1]) == "0" and len(sides[0]) == 1
        if zero and len(each := ar.components(sides[0][0])) > 1:  # [u; v] == 0
            equal = next(token for token in part if token.is_operator("="))
            part = ar.joined([[*one, equal, *sides[1]] for one in each])
            found += [*part, *([end] if end else [])]
            continue
        listed = [side[0].inside if len(side) == 1 and side[0].inside else side for side in sides]
        halves = [tk.split_at(",;", side) for side in listed]
        entered = all(
            ar.index_of(left, 0) is not None if len(left) == 2 else len(left) == 1
            for left in halves[0]
        )
        lists = all(len(side) == 1 and side[0].is_bracket("[") for side in sides)
        plain = lists or any(len(left) == 2 for left in halves[0])
        if len(sides) == 2 and entered and plain and len(halves[0]) == len(halves[1]) > 1:
            equal = next(token for token in part if token.is_operator("="))
            part = ar.joined(
                [[*left, equal, *right] for left, right in zip(*halves, strict=True) if right]
            )
        found += [*part, *([end] if end else [])]
    return found


def _with_primed_entries(tokens: Tokens) -> Tokens:
    """x_1' for the x(1)' of x(1)' = x(2), an equation for the rate of an entry."""
    arrays = {
        part[0].text
        for part in tk.split_at(";,", tokens)
        if ar.index_of(part, 0) and at(part, 1).order == 1 and at(part, 2).is_operator("=")
    }
    if not arrays:
        return tokens

    def with_names(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            index, name = ar.index_of(line, place - 1), at(line, place - 1)
            if index is not None and name.text in arrays:
                entry = replace(name, text=f"{name.text}_{index}", order=token.order)
                found[-1] = replace(entry, primed=token.primed)
            else:
                found.append(tk.within(token, with_names))
        return found

    return with_names(tokens)


def _with_second_rates(tokens: Tokens) -> Tokens:
    """x'' = f for the a[1] = f of Julia's function h!(a, v, u, p, t) with x, y = u and dx, dy = v;
    without names for the entries, u_1'' = f.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    heads = [k for k, (part, _) in enumerate(parts) if at(part, 0).text == _SECOND_ORDER]
    if len(heads) != 1:
        return tokens
    second, first, array = (
        part[0].text for part in tk.split_at(",", parts.pop(heads[0])[0][1].inside)
    )
    names: dict[str, list[str]] = {}
    rest: list[tuple[Tokens, Token | None]] = []
    for part, end in parts:
        left, *right = tk.split_at("=", part)
        listed = [tk.spelled(name) for name in tk.split_at(",", left)]
        if len(right) == 1 and tk.spelled(right[0]) in (second, first, array):
            names[tk.spelled(right[0])] = listed
        else:
            rest.append((part, end))
    orders = {second: 2, first: 1, array: 0}
    moving = names.get(array, [])
    known = {name: (moving[k], 1) for k, name in enumerate(names.get(first, [])[: len(moving)])}

    def entry(k: int) -> str:
        return moving[k - 1] if 0 < k <= len(moving) else f"{array}_{k}"

    def with_entries(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            index, named = ar.index_of(line, place), at(line, place - 1)
            if token.kind == "name" and token.text in orders:
                name = token.text if index is None else entry(index)
                name = array if index is None else name
                found.append(_with_order(token, name, orders[token.text]))
            elif token.kind == "name" and token.text in known:
                found.append(_with_order(token, *known[token.text]))
            elif not (named.text in orders and ar.index_of(line, place - 1) is not None):
                found.append(tk.within(token, with_entries))
        return found

    kept = [token for part, end in rest for token in [*part, *([end] if end else [])]]
    return with_entries(kept)


def _with_order(token: Token, name: str, order: int) -> Token:
    return replace(token, text=name, order=order, primed=token.column * (order > 0))


def _with_plain_lists(line: Line) -> Tokens:
    """[dx, dv] for np.array([dx, dv]) and SVector([...])."""
    found: Tokens = []
    for token in line:
        token = tk.within(token, _with_plain_lists)
        first = tk.split_at(",", token.inside)[0]  # array([dx, dv], float)
        whole = first[0] if len(first) == 1 else token
        listed = whole.is_bracket("[") or (whole.is_bracket() and whole is not token)
        if token.is_bracket("[") and at(found, len(found) - 1).text in _STATIC_ARRAYS:
            found.pop()
        elif token.is_bracket() and listed and at(found, len(found) - 1).text in _LISTS:
            whole = replace(whole, text="[")
            found.pop()
            if at(found, len(found) - 1).is_operator("."):
                del found[-2:]
            token = whole
        found.append(token)
    return found


def _of_statements(tokens: Tokens, names: Names) -> Tokens:
    tokens = _without_solver(_with_operators(_with_curly_derivatives(tokens)))
    tokens = _with_first_differences(tokens, names)
    tokens = _without_arrays(labels.without_repeated(_with_primes(tokens, names)))
    while at(tokens, len(tokens) - 1).is_operator(";"):
        tokens = tokens[:-1]
    while at(tokens, 0).is_operator(";"):
        tokens = tokens[1:]
    if (found := right_sides.by_rule(tokens, names)) is not None:
        return found
    parts = [part for part in tk.split_at(";", tokens) if part]
    rates = right_sides.named_rates(parts)
    is_value = [_is_value(part) and part[0].text not in rates for part in parts]
    values = [*compress(parts, is_value)]
    others = [part for part, value in zip(parts, is_value, strict=True) if not value]
    if others and all(
        [one.kind for one in part] == ["name"] for part in tk.split_at(",", others[-1])
    ):
        whole = tk.bracket(others[-1], others[-1][0])  # return dx, dv
        others[-1] = [replace(whole, text="[")]
    others, values = _with_named_components(others, values)
    sides = ar.joined(others)
    found = right_sides.by_rule(sides, names) if len(others) < len(parts) and sides else None
    if found is None:
        return tokens
    entered = _are_entered(values)
    for name in dict.fromkeys(name for name, _, _ in ar.entries(sides)):
        array = ar.Array.of(name, tokens)
        values = [array.with_names(part) for part in values]
    for part in compress(values, entered):
        tk.note(tk.source(part), "a definition")
    for place, is_entered in enumerate(entered):
        if is_entered:  # r = sqrt(y(1)^2 + y(2)^2), whose text alone says nothing of y_1
            found = _with_value(found, values[place])
            values = [_with_value(part, values[place]) for part in values]
    values = [part for part, is_entered in zip(values, entered, strict=True) if not is_entered]
    before = [part for part in values if part[0].column < found[0].column]
    after = [part for part in values if part[0].column >= found[0].column]
    return ar.joined([*before, found, *after])


def _are_entered(values: Sequence[Tokens]) -> list[bool]:
    """Whether each value has an entry of an array, itself or in the values that it uses: in
    C = cos(y(1)); D = 1 - C^2 both have.
    """
    found: list[bool] = []
    names: set[str] = set()
    for part in values:
        used = any(token.text in names for token in tk.walk(part[2:]) if token.kind == "name")
        found.append(used or any(True for _ in ar.entries(part)))
        names |= {part[0].text} if found[-1] else set()
    return found


def _with_value(line: Line, value: Tokens) -> Tokens:
    """The tokens with (formula) for the name of a value, but for that before its =."""
    name, formula = value[0].text, value[2:]

    def with_value(line: Line) -> Tokens:
        return [
            tk.bracket([replace(one, column=token.column) for one in formula], token, space=True)
            if token.kind == "name" and token.text == name and not token.order
            else tk.within(token, with_value)
            for token in line
        ]

    given = at(line, 1).is_operator("=") and at(line, 0).text == name
    return [*line] if given else with_value(line)


def _without_named_sides(tokens: Tokens) -> Tokens:
    """du[1] = v for the du[1] = dx = v of Julia."""
    found: Tokens = []
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        sides = tk.split_at("=", part)
        entry = len(sides) == 3 and ar.index_of(part, 0) is not None and len(sides[0]) == 2
        if entry and [token.kind for token in sides[1]] == ["name"]:
            part = [*sides[0], next(one for one in part if one.is_operator("=")), *sides[2]]
        found += [*part, *([end] if end else [])]
    return found


def _without_arrays(tokens: Tokens) -> Tokens:
    """The tokens without x = u(1), xdot = u(3), and dudt = [xdot; xdotdot] where xdot and xdotdot,
    or xdot alone, have their own equations.
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    given = {
        (line[0].text, line[0].order)
        for line, _ in parts
        if at(line, 0).order and at(line, 1).is_operator("=")
    }

    def is_list(line: Line) -> bool:
        whole = at(line, len(line) - 1)
        called = at(line, len(line) - 2)
        plain = len(line) == 1 or called.is_operator("=") or called.text in ar.ARRAYS
        listed = ar.components(whole) if plain and whole.is_bracket("[") else []
        listed = listed or tk.split_at(",", line)  # return x_dot, v_dot
        return len(listed) > 1 and all(
            len(one) == 1 and {(one[0].text, one[0].order + k) for k in (0, one[0].order)} & given
            for one in listed
        )

    if not any(is_list(line) for line, _ in parts):
        return tokens
    found: Tokens = []
    for line, end in parts:
        name, sides = at(line, 0), tk.split_at("=", line)
        entry = len(sides) == 2 and len(sides[1]) == 2 and ar.index_of(sides[1], 0) is not None
        again = not name.order or (name.text, name.order + 1) in given
        unpacked = len(sides) == 2 and len(tk.split_at(",", sides[0])) > 1 and len(sides[1]) == 1
        if is_list(line) or unpacked or (entry and again and len(sides[0]) == 1):
            continue
        found += [*line, *([end] if end else [])]
    return found


def _with_values_apart(tokens: Tokens) -> Tokens:
    """a = 4; b = 1 for [a, b] = deal(4, 1) and a, b = 4, 1, values of names that do not move and
    have no other equation, and x = u[1]; xdot = u[2] for x, xdot = u[1], u[2].
    """
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    moving = {token.text for token in tk.walk(tokens) if token.order}
    sides = [tk.split_at("=", part) for part, _ in parts]
    lefts = [line[0] for line in sides if len(line) > 1]
    times = Counter(name for left in lefts for name in {token.text for token in tk.walk(left)})
    found: Tokens = []
    for part, end in parts:
        left, *right = tk.split_at("=", part)
        left = [*left[0].inside] if len(left) == 1 and left[0].is_bracket("[") else left
        if len(right) == 1 and at(right[0], 0).text == "deal" and len(right[0]) == 2:
            right = [[*right[0][1].inside]]
        names, values = tk.split_at(",", left), tk.split_at(",", right[0]) if right else []
        plain = all([token.kind for token in name] == ["name"] for name in names)
        fixed = not {token.text for token in left} & moving and not any(map(tk.moves, values))
        fixed = fixed and all(times[token.text] == 1 for token in left if token.kind == "name")
        entered = all(len(one) == 2 and ar.index_of(one, 0) is not None for one in values)
        if len(names) == len(values) > 1 and plain and (fixed or entered) and all(values):
            equal = next(token for token in part if token.is_operator("="))
            part = ar.joined(
                [
                    [
                        *(replace(one, column=value[0].column - 1) for one in (name[0], equal)),
                        *value,
                    ]
                    for name, value in zip(names, values, strict=True)
                ]
            )
        found += [*part, *([end] if end else [])]
    return found


def _is_value(statement: Tokens) -> bool:
    """Whether this is g = 9.81 or r = sqrt(x^2 + y^2), the value of a name."""
    name, equal, rest = at(statement, 0), at(statement, 1), statement[2:]
    named = name.kind == "name" and not name.order and equal.is_operator("=")
    listed = at(rest, 0).is_bracket("[") or at(rest, 0).is_bracket("{")
    calls = any(token.text in ar.ARRAYS or token.is_operator("@", "=") for token in tk.walk(rest))
    return named and bool(rest) and not (listed or calls or tk.moves(rest))


def _with_entries(tokens: Tokens) -> tuple[Tokens, dict[tuple[str, int], tuple[str, int]]]:
    """The tokens with u[1] and u[2] for the x and v of x, v = u, beside du[1] = ..., and of
    x = u[1]; v = u[2]; with them (u, 1) by (x, 0), and (u, 2) by (x, 1) for the xdot of xdot = u[2].
    """
    arrays = {match[1] for name, _, _ in ar.entries(tokens) if (match := ar.RATES.fullmatch(name))}
    parts = tk.split(tokens, lambda _, token: token.is_operator(";"))
    called = [_entry_called(part) for part, _ in parts]
    named = [entry.array for entry in called if entry is not None]
    rated = [ar.index_of(part, 0) for part, _ in parts]
    count = len([index for index in rated if index is not None])  # of out[0] = v; out[1] = -x
    entries: dict[tuple[str, int], tuple[str, int]] = {}
    found: Tokens = []
    for (part, end), entry in zip(parts, called, strict=True):
        left, *right = tk.split_at("=", part)
        names = tk.split_at(",", left)
        plain = len(names) > 1 and all([t.kind for t in name] == ["name"] for name in names)
        whole = len(right) == 1 and [one.kind for one in right[0]] == ["name"]
        if plain and whole and (right[0][0].text in arrays or len(names) == count):
            array = right[0][0].text
            entries |= {
                (name[0].text, name[0].order): (array, k)
                for k, name in enumerate(names, 0 if 0 in rated else 1)
            }
        elif entry is not None and entry.array in ar.PARAMETERS and entry.array not in arrays:
            continue  # d = p[1] names a parameter
        elif entry is not None and (
            named.count(entry.array) > 1 or entry.array in arrays or count > 1
        ):
            entries[entry.name] = entry.array, entry.place
        else:
            found += [*part, *([end] if end else [])]

    from_zero = {array for array, k in entries.values() if not k}
    if from_zero:  # dZ[0] = Z[2]
        from_zero |= {at(part, 0).text for part, _ in parts if ar.index_of(part, 0) == 0}
    entries = {  # Z[0] may have a name that nothing uses
        name: (array, k + (array in from_zero)) for name, (array, k) in entries.items()
    }

    def with_entries(line: Line) -> Tokens:
        changed: Tokens = []
        for place, token in enumerate(line):
            entry = ar.index_of(line, place - 1)
            if entry is not None and at(line, place - 1).text in from_zero:
                number = replace(token.inside[0], text=f"{entry + 1}", value=Fraction(entry + 1))
                changed.append(replace(token, inside=(number,)))
            elif token.kind == "name" and (token.text, token.order) in entries:
                array, k = entries[token.text, token.order]
                index = tk.nested(tk.tokens_in_place(f"[{k}]", token))
                changed += [replace(token, text=array, order=0, primed=0), *index]
            else:
                changed.append(tk.within(token, with_entries))
        return changed

    return with_entries(found) if len(found) < len(tokens) else tokens, entries


class NamedEntry(NamedTuple):
    """name = array[place], with the order of the name, 1 for xdot."""

    name: tuple[str, int]
    array: str
    place: int


def _entry_called(statement: Tokens) -> NamedEntry | None:
    """((x, 0), u, 1) for x = u[1]."""
    name, sign, array = (at(statement, place) for place in range(3))
    index = ar.index_of(statement, 2)
    plain = name.kind == array.kind == "name" and name.order < 2 and len(statement) == 4
    if not plain or index is None or not sign.is_operator("=") or array.text in FUNCTIONS:
        return None
    return NamedEntry((name.text, name.order), array.text, index)


def _with_given_names(tokens: Tokens, given: Mapping[str, str]) -> Tokens:
    """The equations with the writer's x for the entry u_1 of an array, if x has no other meaning."""
    if {*given.values()} & {token.text for token in tk.walk(tokens)}:
        return tokens
    return tk.with_names(tokens, given)


def _with_named_components(
    others: list[Tokens], values: list[Tokens]
) -> tuple[list[Tokens], list[Tokens]]:
    """[omega, -sin(theta)] for the [dtheta, domega] of dtheta = omega; domega = -sin(theta), and
    the values that no list has; a value that uses one of a list is put in, too.
    """
    given = {part[0].text: part[2:] for part in values}
    put = set[str]()

    def with_values(line: Line) -> Tokens:
        found: Tokens = []
        for part, end in tk.split(line, lambda _, token: token.is_operator(",", ";")):
            name = part[0].text if [token.kind for token in part] == ["name"] else ""
            put.update([name] * (name in given))
            found += [*given.get(name, part), *([end] if end else [])]
        return found

    found = []
    for part in others:
        whole = at(part, len(part) - 1)
        listed = whole.is_bracket("[") and len(part) in (1, 3)
        found.append([*part[:-1], tk.within(whole, with_values)] if listed else part)
    for value in values:  # dx1 = x(2); F = -c*dx1; dx2 = F - x(1); dx = [dx1; dx2]
        name, used = value[0].text, {token.text for token in tk.walk(value[2:])}
        if name not in put and used & put:
            put.add(name)
            tk.note(tk.source(value), "a definition")
    for value in reversed(values):
        if value[0].text in put:
            found = [_with_value(part, value) for part in found]
    return found, [part for part in values if part[0].text not in put]


def _with_time(tokens: Tokens, names: Names) -> Tokens:
    """The tokens with t for the time of Modelica."""
    words = {token.text for token in tk.walk(tokens)}
    if "der" not in words or "time" not in words or names.role("time"):
        return tokens
    return tk.with_names(tokens, {"time": "t"})


def _with_curly_derivatives(tokens: Tokens) -> Tokens:
    """D(D(x)) for the \u2202(\u2202(x)) and \u2202t(\u2202t(x)) of Julia, in a text in which each \u2202 has a bracket
    behind it.
    """
    places = [each for each in tk.places(tokens) if each[0][each[1]].is_operator(tk.PARTIAL)]
    if any(at(line, place + 1).is_operator("=") for line, place, _ in places):
        return tokens  # \u2202 = Differential(t)
    called = [_is_called(line, place) for line, place, _ in places]
    twice = any(
        token.is_bracket("(") and tk.spelled(token.inside[:1]) == tk.PARTIAL
        for token in tk.walk(tokens)
    )

    def with_names(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            if token.is_operator(tk.PARTIAL):
                found.append(replace(token, kind="name", text="D"))
            elif not (token.text == "t" and at(line, place - 1).is_operator(tk.PARTIAL)):
                found.append(tk.within(token, with_names))
        return found

    return with_names(tokens) if twice and called and all(called) else tokens


def _is_called(line: Line, place: int) -> bool:
    """Whether a bracket, or the = of its definition, is behind \u2202 or \u2202t."""
    after = place + 1 + (at(line, place + 1).text == "t")
    defined = at(line, after).is_operator("=") and at(line, after + 1).text == "Differential"
    return at(line, after).is_bracket("(") or defined


def _with_operators(tokens: Tokens) -> Tokens:
    """The tokens with Differential(s)(u) for the D(u) of a text with D = Differential(s), and with
    D2(u) for the DD(u) of DD = D^2 or D*D, where D is by the time.
    """
    kept: list[tuple[Tokens, Token | None]] = []
    operators: dict[str, Tokens] = {}
    for part, end in tk.split(tokens, lambda _, token: token.is_operator(";")):
        head, given = part[:1], part[2:] if at(part, 1).is_operator("=") else []
        by = at(given, 1)
        once = at(given, 0).text == "Differential" and by.is_bracket() and len(by.inside) == 1
        twice = tk.spelled(given) in ("D^2", "D*D") or (once and tk.spelled(given[2:]) == "^2")
        if once and len(given) == 2:
            operators[head[0].text] = given
        elif twice and [one.kind for one in head] == ["name"]:
            operators[head[0].text] = [replace(given[0], text="D2")]
        else:
            kept.append((part, end))
            continue
        tk.note(tk.source(part))
    if not operators:
        return tokens

    def with_operators(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            by = operators.get(token.text) if at(line, place + 1).is_bracket() else None
            if by is None or token.kind == "bracket":
                found.append(tk.within(token, with_operators))
            else:
                found += [replace(one, column=token.column, end=token.column) for one in by]
        return found

    line = [token for part, end in kept for token in [*part, *([end] if end else [])]]
    return with_operators(line)


def _without_solver(tokens: Tokens) -> Tokens:
    """The handle in [t, y] = ode45(@(t, y) [...], [0 10], [1; 0]), and the pairs in
    taylor_adaptive(sys, [...]). InputError for two handles that differ.
    """
    place = next((k for k, token in enumerate(tokens) if token.text in _SOLVERS), None)
    call = at(tokens, len(tokens) if place is None else place + 1)
    handle = at(call.inside, 0).is_operator("@") or at(tokens, place or 0).text == _TAYLOR
    if place is None or not call.is_bracket() or not handle:
        return tokens
    first, *more = tk.split_at(",", call.inside)
    for name, other in zip(tokens[place + 2 :], tokens[place + 3 :], strict=False):
        again = tk.split_at(",", other.inside)[0] if name.text in _SOLVERS else []
        if at(again, 0).is_operator("@") and tk.spelled(again) != tk.spelled(first):
            raise fault("two systems of rates", name.column, name.span)
    begins = max((k + 1 for k in range(place) if tokens[k].is_operator(";")), default=0)
    for part in (tokens[begins : place + 1], *more):
        tk.note(tk.source(part))
    return [*tokens[:begins], *first]  # mu = 1; stays


def _with_first_differences(tokens: Tokens, names: Names) -> Tokens:
    """x' for MATLAB's diff(x), where names are guessed or its diff(x, 2) occurs."""
    shapes = {
        (line[place].text, *(token.kind for token in at(line, place + 1).inside))
        for line, place, _ in tk.places(tokens)
        if not at(line, place - 1).is_operator(".")  # x.diff(t, 2)
    }
    alone = names.guesses and ("diff", "name") in shapes  # a declared A(r) has another variable
    if not alone and ("diff", "name", "operator", "number") not in shapes:
        return tokens

    def with_primes(line: Line) -> Tokens:
        found: Tokens = []
        for token in line:
            name = at(token.inside, 0)
            single = token.is_bracket() and len(token.inside) == 1 and name.kind == "name"
            if single and found and found[-1].text == "diff" and not token.order:
                found[-1] = replace(name, order=1, primed=name.column, space_before=True)
            else:
                found.append(tk.within(token, with_primes))
        return found

    return with_primes(tokens)


def with_primes_before_time(tokens: Line) -> Tokens:
    """x''(t) for x(t)'' and x[t]''."""
    found: Tokens = []
    for token in tokens:
        timed = token.kind == "bracket" and token.order and tk.spelled(token.inside) == "t"
        if timed and found and found[-1].kind == "name" and not found[-1].order:
            name = found.pop()
            found.append(replace(name, order=token.order, primed=token.primed))
            token = replace(token, order=0, primed=0)
        found.append(tk.within(token, with_primes_before_time))
    return found


def with_dots(tokens: Line, names: Names) -> Tokens:
    """x'' for AsciiMath's ddot x and for ddot(x)."""
    found: Tokens = []
    mark: Token | None = None
    for place, token in enumerate(tokens):
        following = at(tokens, place + 1)
        whole = following.inside[0] if len(following.inside) == 1 else following
        if (
            token.text in _DOTS
            and whole.kind == "name"
            and not (whole.order or names.role(token.text))
        ):
            mark = token
        elif mark is not None:
            name = token.inside[0] if token.inside else token
            order = _DOTS[mark.text]
            found.append(replace(name, order=order, primed=mark.column, space_before=True))
            mark = None
        else:
            found.append(tk.within(token, lambda inside: with_dots(inside, names)))
    return found


def with_time_below(tokens: Tokens, names: Names) -> Tokens:
    """u'' and u' for u_tt and u_t, where u_tt occurs and no u_xx of a partial equation."""
    words = {token.text for token in tk.walk(tokens) if token.kind == "name"}
    below = {
        word: word.rpartition("_") for word in words if "_" in word[1:] and not names.role(word)
    }
    moving = {head for head, _, by in below.values() if by == "tt"}
    others = {head for head, _, by in below.values() if len({*by}) == 1 < len(by) and by != "tt"}
    others |= {token.text for token in tk.walk(tokens) if token.order}
    if moving - others:
        _refuse_second_slopes(tokens, {word for word, cut in below.items() if cut[0] not in moving})
    orders = {
        word: (head, len(by))
        for word, (head, _, by) in below.items()
        if head in moving - others and {*by} == {"t"}
    }

    def with_orders(line: Line) -> Tokens:
        return [
            replace(
                token, text=orders[token.text][0], order=orders[token.text][1], primed=token.column
            )
            if token.kind == "name" and token.text in orders and not token.order
            else tk.within(token, with_orders)
            for token in line
        ]

    return with_orders(tokens) if orders and moving - others else tokens


def _refuse_second_slopes(tokens: Tokens, words: Collection[str]) -> None:
    """InputError for the u_xx of x_tt = u_xx, a second derivative in the notation of x_tt."""
    for token in tk.walk(tokens):
        by = token.text.rpartition("_")[2]
        if token.kind == "name" and token.text in words and len(by) == 2 and by[0] == by[1]:
            raise fault("second slope", token.column, token.span, shown=token.text, by=by[0])


def _with_primes(tokens: Tokens, names: Names) -> Tokens:
    """x'' for MATLAB's D2x and for the ddx, xdd, and x_dd of code, and in a text that has one of
    them x' for Dx, dx, xd, and x_d.
    """
    inside = [*tk.walk(tokens)]
    moves = any(token.order > 1 or token.text in labels.DERIVATIVES for token in inside)
    words = {token.text for token in inside if token.kind == "name"}
    rates = dict[str, tuple[str, int]]()
    arrays = {name for name, _, _ in ar.entries(tokens)}  # ddy = -y(1); dydt = [y(2); ddy]
    for shape in _SHORT[: 1 if moves else None]:
        read = _rates_of_shape(shape, words)
        rates |= {
            word: rate for word, rate in read.items() if not (names.role(word) or rate[0] in arrays)
        }

    def with_primes(line: Line) -> Tokens:
        found: Tokens = []
        for place, token in enumerate(line):
            name, order = rates.get(token.text, ("", 0)) if token.kind == "name" else ("", 0)
            if order and not token.order and ar.index_of(line, place) is None:
                found.append(replace(token, text=name, order=order, primed=token.column))
            else:
                found.append(tk.within(token, with_primes))
        return found

    return with_primes(tokens) if rates else tokens


def _rates_of_shape(shape: re.Pattern[str], words: Collection[str]) -> dict[str, tuple[str, int]]:
    """The name and the order of each word that denotes a derivative; none without a second one."""
    marked = {word: match for word in words if (match := shape.fullmatch(word))}
    orders = {
        word: (
            match["name"],
            int(match["mark"][1:]) if match["mark"][1:].isdigit() else len(match["mark"]),
        )
        for word, match in marked.items()
    }
    first = {name for name, order in orders.values() if order == 1}
    plain = shape is not _SHORT[0]  # ddx only next to x or dx
    second = {
        name
        for name, order in orders.values()
        if order > 1 and (not plain or name in first | {*words})
    }
    known = second | ({*words} if second else set())
    return {
        word: rate for word, rate in orders.items() if rate[0] in (second if rate[1] > 1 else known)
    }
