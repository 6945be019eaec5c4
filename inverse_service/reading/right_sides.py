"""Right-hand sides of numerical programs as equations: tokens in, tokens out.

MATLAB's @(t, q) [q(2); -sin(q(1))] is q_1' = q_2; q_2' = -sin(q_1), as are dydt(1) = y(2); dydt(2) =
-sin(y(1)), Julia's du[1] = u[2], and Python's [y[1], -sin(y[0])]. heyoka's [(x, v), (v, -sin(x))] is
x' = v; v' = -sin(x), and SymPy's (x.diff(t, 2) + x, y.diff(t, 2) + y) is x'' + x; y'' + y.
"""

import re
from collections import Counter
from collections.abc import Collection
from dataclasses import replace

from inverse_service.reading import entries as ar, labels, tokens as tk
from inverse_service.reading.names import DERIVATIVE_NAMES, FUNCTIONS, Names
from inverse_service.reading.tokens import Line, Token, Tokens, at

_SHORT_RATE = re.compile(r"d([A-Za-z]\w*?)")
_SINGLE = re.compile(r"d([A-Za-z]\w*?)_?dt")
_STEPPING = ("rk", "rkf45", "desolve_system_rk4", "desolve_odeint")
# ddu, the array of accelerations of u
_SECOND_RATES = re.compile(r"dd([A-Za-z]\w*)")


def by_rule(tokens: Tokens, names: Names) -> Tokens | None:
    rules = (
        _of_handle,
        _of_pairs,
        _of_second_rates,
        _of_rates,
        _of_single_rates,
        _of_short_rates,
        _of_lists,
        _of_list,
        _of_other_array,
        _of_first,
        _of_expressions,
    )
    return next((found for rule in rules if (found := rule(tokens, names)) is not None), None)


def named_rates(statements: Collection[Tokens]) -> set[str]:
    """The dxdt and dvdt of dxdt = v; dvdt = -x, and the dx and dv of dx = v; dv = -x, if there are
    several; not those of a list [dxdt, dvdt].
    """
    times = Counter(token.text for one in statements for token in tk.walk(one))
    for form in (_SINGLE, _SHORT_RATE):
        heads = [form.fullmatch(at(one, 0).text) for one in statements]
        rates = [rate for rate in heads if rate and times[rate[0]] == 1]
        found = {rate[0] for rate in rates if times[rate[1]] and rate[1] != "t"}
        if len(found) > 1:
            return found
    return set()


def _of_second_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """ddu[1] = -k*u[1], with du[1] for its rate."""
    statements = ar.statements(tokens)
    found: list[Tokens] = []
    for statement in statements:
        match = _SECOND_RATES.fullmatch(at(statement, 0).text)
        index = ar.index_of(statement, 0)
        if match is None or index is None or not at(statement, 2).is_operator("="):
            return None
        array = ar.Array.of(match[1], tokens)
        head = Token("name", array.entry(index), statement[0].column, True)
        head = replace(head, order=2, primed=head.column)
        body = _with_rates(array.with_names(statement[3:]), array, f"d{array.name}")
        found.append([head, statement[2], *body])
    return ar.joined(found) if found else None


def _with_rates(line: Line, array: ar.Array, rates: str) -> Tokens:
    """The tokens with u_1' for du[1], where du are the rates of u."""
    found: Tokens = []
    for place, token in enumerate(line):
        index = ar.index_of(line, place - 1)
        if index is not None and found and line[place - 1].text == rates:
            name = replace(line[place - 1], text=array.entry(index), order=1)
            found[-1] = replace(name, primed=name.column)
        else:
            found.append(tk.within(token, lambda inside: _with_rates(inside, array, rates)))
    return found


def _of_single_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """dxdt = v; dvdt = -x, a rate for each name."""
    statements = ar.statements(tokens)
    rates = [_SINGLE.fullmatch(at(one, 0).text) for one in statements]
    held = {token.text for token in tk.walk(tokens)}
    if len(statements) < 2 or not all(rate and rate[1] in held for rate in rates):
        return None
    if any(names.role(one[0].text) or not at(one, 1).is_operator("=") for one in statements):
        return None
    pairs = zip(statements, rates, strict=True)
    return ar.joined([[*ar.rate(one[0], rate[1]), *one[2:]] for one, rate in pairs if rate])


def _of_short_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """dx1 = x2; dx2 = -x1, and dx = [x2; -x1] of x1 and x2: rates without a dt."""
    statements = ar.statements(tokens)
    held = {token.text for token in tk.walk(tokens)}
    if names.forms or any(not at(one, 1).is_operator("=") for one in statements):
        return None
    if len(statements) == 1:
        statements = _of_numbered(statements[0], held)
    rates = [_SHORT_RATE.fullmatch(one[0].text) for one in statements]
    moving = [rate[1] for rate in rates if rate]
    inside = [token.text for one in statements for token in tk.walk(one[2:])]
    given = all(name in inside and f"d{name}" not in inside for name in moving)
    plain = not any(names.role(one[0].text) for one in statements) and not tk.moves(tokens)
    if len(statements) < 2 or len(moving) < len(statements) or not given or not plain:
        return None
    pairs = zip(statements, moving, strict=True)
    return ar.joined([[*ar.rate(one[0], name), *one[2:]] for one, name in pairs])


def _of_numbered(statement: Tokens, held: Collection[str]) -> list[Tokens]:
    """dx1 = x2; dx2 = -x1 for dx = [x2; -x1] and for xdot = [x2; -x1], where x1 and x2 occur."""
    name, equal, whole = statement[0], statement[1], at(statement, 2)
    rate = ar.RATES.fullmatch(name.text) if len(statement) == 3 and name.kind == "name" else None
    letter = next(filter(None, (rate[1], rate[3])), "") if rate else ""
    parts = ar.components(whole) if whole.is_bracket("[") else []
    for mark in ("", "_"):
        if parts and all(f"{letter}{mark}{k + 1}" in held for k in range(len(parts))):
            heads = [replace(name, text=f"d{letter}{mark}{k + 1}") for k in range(len(parts))]
            return [[head, equal, *part] for head, part in zip(heads, parts, strict=True)]
    return []


def _of_handle(tokens: Tokens, names: Names) -> Tokens | None:
    """@(t, y) [y(2); -y(1)], perhaps after f = ."""
    place = next((k for k, token in enumerate(tokens) if token.is_operator("@")), len(tokens))
    arguments, body = at(tokens, place + 1), at(tokens, place + 2)
    before = tk.spelled(tokens[:place])
    given = [token.text for token in arguments.inside if not token.is_operator(",")]
    after = tk.spelled(tokens[place + 3 :]).strip(";")
    words = {token.text for token in tk.walk([body])}
    entered = {name for name, _, _ in ar.entries(body.inside)}
    second = given[1:2]
    if second == ["t"] or ({*given[:1]} & entered and not {*second} & entered):
        given = [*given[1::-1], *given[2:]]  # the @(x, t) of Octave's lsode
    timed = len(given) > 1 and (given[0] == "t" or not {*given[:1], "t"} <= words)
    if not timed or not body.is_bracket("[") or after or not re.fullmatch(r"(\w+'*=)?", before):
        return None
    if given[0] != "t" and given[0] in words:
        tk.note(given[0], "the time t")
        body = tk.with_names([body], {given[0]: "t"})[0]
    components = ar.components(body)
    array = ar.Array.of(given[1], body.inside)
    if len(components) < 2:
        return None
    tk.note(tk.source(tokens[: place + 2]))
    return ar.rates_of(array, components)


def _of_pairs(tokens: Tokens, names: Names) -> Tokens | None:
    """[(x, v), (v, -sin(x))], perhaps after sys = or without the brackets around it."""
    labelled = at(tokens, 0).kind == "name" and at(tokens, 1).is_operator("=")
    listed: Line = tokens[2 * labelled :]
    if len(listed) == 1:
        around = listed[0].is_bracket("[") or listed[0].is_bracket()
        listed = listed[0].inside if around and not listed[0].order else ()
    parts = [part for part in tk.split_at(",", listed) if part]  # Python's comma at the end
    pairs = [part[0].inside for part in parts if len(part) == 1 and part[0].is_bracket()]
    halves = [tuple(half for half in tk.split_at(",", pair) if half) for pair in pairs]
    if len(halves) < 2 or len(halves) != len(parts) or any(len(half) != 2 for half in halves):
        return None
    if any(len(first) != 1 or first[0].kind != "name" or first[0].order for first, _ in halves):
        return None
    if not names.role("time"):
        halves = [(first, tk.with_names(rate, {"time": "t"})) for first, rate in halves]
    return ar.joined([[*ar.rate(first[0], first[0].text), *rate] for first, rate in halves])


def _of_rates(tokens: Tokens, names: Names) -> Tokens | None:
    """dydt(1) = y(2); dydt(2) = ..., and dydt = [y(2); ...]."""
    statements = ar.statements(tokens)
    arrays = {name for name, _, _ in ar.entries(tokens)}
    found: list[Tokens] = []
    for statement in statements:
        match = ar.RATES.fullmatch(statement[0].text) if statement[0].kind == "name" else None
        name = next(filter(None, (match[1], match[3])), "") if match else ""
        by = match["by"] if match else None
        if by not in (None, "t") and by in {token.text for token in tk.walk(tokens)}:
            return None  # dydx(1) = x*y(2), where x is the time
        index = ar.index_of(statement, 0)
        sign, body = at(statement, 1 + (index is not None)), statement[2 + (index is not None) :]
        if at(body, 0).text in ar.ARRAYS[2:] and len(body) == 2:
            continue  # dydt = zeros(2, 1)
        if (
            name not in arrays
            or names.role(statement[0].text)
            or not sign.is_operator("=")
            or not body
        ):
            return None
        array = ar.Array.of(name, tokens)
        if index is not None:
            first = (
                array
                if any(other == name and k == 0 for other, k, _ in ar.entries(tokens))
                else ar.Array(name, 1)
            )
            rates = {k for other, k, _ in ar.entries(tokens) if other == statement[0].text}
            first = ar.Array(name, 0) if 0 in rates else first
            head = ar.rate(statement[0], first.entry(index))
            found.append([*head, *_with_rates(first.with_names(body), first, statement[0].text)])
        elif (
            len(body) == 1 and body[0].kind == "bracket" and (components := ar.components(body[0]))
        ):
            found.append(ar.rates_of(array, components))
        else:
            return None
    return ar.joined(found) if found else None


def _of_list(tokens: Tokens, names: Names) -> Tokens | None:
    """[y[1], -y[0]] alone, the rates of y; with x, v = y before it, those of x and v."""
    statements = [part for part in tk.split_at(";", tokens) if part]
    if len(statements) > 2:
        return None
    last, unpacked = statements[-1] if statements else [], list[tuple[str, int]]()
    if len(statements) == 2:
        left, *right = tk.split_at("=", statements[0])
        listed = left[0].inside if len(left) == 1 and left[0].is_bracket() else left
        parts = tk.split_at(",", listed)
        if (
            len(right) != 1
            or [token.kind for token in right[0]] != ["name"]
            or any(len(part) != 1 for part in parts)
        ):
            return None
        unpacked = [(part[0].text, part[0].order) for part in parts]
    whole = last[-1] if last else at(last, 0)
    if len(tk.split_at(",", last)) > 1 and not any(token.is_operator("=") for token in last):
        last = [tk.bracket(last, last[0])]  # return y[1], -y[0]
        whole = last[0]
    if (
        [token.text for token in last[:-1]][-1:] == ["array"]
        and whole.is_bracket()
        and len(whole.inside) == 1
    ):
        whole = whole.inside[0]  # np.array([...])
    elif [token.text for token in last[:-1]] == ["SVector"] and whole.is_bracket():
        pass
    elif len(last) != 1 and not (
        len(last) == 3 and last[0].kind == "name" and last[1].is_operator("=")
    ):
        return None
    components = ar.components(whole) if whole.kind == "bracket" else []
    if len(components) < 2 or any(
        token.is_operator("=") or (token.order and (token.text, token.order) not in unpacked)
        for token in tk.walk([whole])
    ):
        return None
    if unpacked:
        if len(unpacked) != len(components):
            return None
        pairs = zip(unpacked, components, strict=True)
        rates = [(name, part) for name, part in pairs if tk.spelled(part) != f"{name[0]}'"]
        return ar.joined([[*ar.rate(part[0], *name), *part] for name, part in rates]) or None
    entered = {name for name, _, _ in ar.entries(whole.inside)}
    if len(entered) > 1:
        entered -= {*ar.PARAMETERS}  # p[1] of f(u, p, t)
    arrays = {_array_of(name, whole, len(components)) for name in entered}
    sizes = {
        array: max(k for name, k, _ in ar.entries(whole.inside) if name == array.name)
        for array in arrays
    }
    fitting = [array for array in arrays if sizes[array] - array.first + 1 == len(components)] or [
        *arrays
    ]
    return ar.rates_of(fitting[0], components) if len(fitting) == 1 else None


def _array_of(name: str, whole: Token, count: int) -> ar.Array:
    """The array of this name in a list of `count` rates: the y of [y[1], -k*y[1]] begins with y[0],
    as the rate of a position is the velocity, the last entry.
    """
    array = ar.Array.of(name, whole.inside)
    last = max(k for other, k, _ in ar.entries(whole.inside) if other == name)
    square = any(
        line[place].text == name and at(line, place + 1).is_bracket("[")
        for line, place, _ in tk.places(whole.inside)
    )
    return replace(array, first=0) if square and last == count - 1 else array


def _of_lists(tokens: Tokens, names: Names) -> Tokens | None:
    """Maxima's rk([v, -x], [x, v], [1, 0], [t, 0, 10, 0.1]), and rk(f, [x, v], ...) with f = [v, -x]
    before it.
    """
    call = at(tokens, len(tokens) - 1)
    if at(tokens, len(tokens) - 2).text not in _STEPPING or not call.is_bracket():
        return None
    given = {
        part[0].text: part[2]
        for part in tk.split_at(";", tokens)
        if len(part) == 3 and part[1].is_operator("=") and part[2].is_bracket("[")
    }
    parts = [part[0] for part in tk.split_at(",", call.inside)[:2] if len(part) == 1]
    lists = [given.get(part.text, part).inside for part in parts]
    if len(lists) != 2:
        return None
    rates, unknowns = (tk.split_at(",", listed) for listed in lists)
    plain = all(len(name) == 1 and name[0].kind == "name" for name in unknowns)
    if not plain or len(rates) != len(unknowns):
        return None
    for part in tk.split_at(",", call.inside)[2:]:
        tk.note(tk.source(part))
    pairs = zip(unknowns, rates, strict=True)
    return ar.joined([[*ar.rate(name[0], name[0].text), *rate] for name, rate in pairs])


def _of_other_array(tokens: Tokens, names: Names) -> Tokens | None:
    """dydx(1) = x(2); dydx(2) = -x(1), the rates of the only other array."""
    statements = ar.statements(tokens)
    indices = [ar.index_of(statement, 0) for statement in statements]
    heads = {at(statement, 0).text for statement in statements}
    equal = all(at(statement, 2).is_operator("=") for statement in statements)
    others = [*dict.fromkeys(name for name, _, _ in ar.entries(tokens) if name not in heads)]
    others = [name for name in others if not _is_function(name, names)]
    if len(others) > 1:  # a = theta(3) is a parameter of the rates of x
        others = [name for name in others if _is_alone(name, statements)]
    if len(statements) < 2 or None in indices or len(heads) != 1 or not equal or len(others) != 1:
        return None
    inside = {name for statement in statements for name, _, _ in ar.entries(statement[3:])}
    used = [index for name, index, _ in ar.entries(tokens) if name == others[0]]
    counted = sorted(index for index in indices if index is not None)
    if heads & inside or counted != [*range(counted[0], counted[0] + len(counted))]:
        return None
    if max(used) > counted[-1] or min(used) < counted[0] or counted[0] > 1:
        return None
    array = ar.Array(others[0], counted[0])
    return ar.joined(
        [
            [*ar.rate(statement[0], array.entry(index)), *array.with_names(statement[3:])]
            for statement, index in zip(statements, indices, strict=True)
            if index is not None
        ]
    )


def _is_alone(array: str, statements: Collection[Tokens]) -> bool:
    """Whether an entry of an array is one of the rates, as in dx(1) = x(2)."""
    return any(
        len(one) == 5 and one[3].text == array and ar.index_of(one, 3) is not None
        for one in statements
    )


def _is_function(name: str, names: Names) -> bool:
    return name in FUNCTIONS or names.role(name) == "function"


def _of_first(tokens: Tokens, names: Names) -> Tokens | None:
    """The equations in {{prime(x) = v, prime(v) = -x}, {0.05, 0.025}}, beside numbers."""
    whole = at(tokens, 0)
    parts = tk.split_at(",", whole.inside) if len(tokens) == 1 and whole.is_bracket("{") else []
    if len(parts) < 2 or any(len(part) != 1 or not part[0].inside for part in parts):
        return None
    equal = [any(token.is_operator("=") for token in part[0].inside) for part in parts]
    if equal != [True] + [False] * (len(parts) - 1):
        return None
    for part in parts[1:]:
        tk.note(tk.source(part))
    return [*parts[0][0].inside]


def _of_expressions(tokens: Tokens, names: Names) -> Tokens | None:
    """(x'' + x, y'' + y) and [x'' + x, y'' + y], lists of expressions that are zero; initial values
    beside them are left out.
    """
    whole = at(tokens, 0)
    if len(tokens) != 1 or whole.kind != "bracket" or whole.order:
        return None
    every = tk.split_at(",", whole.inside)
    parts = [part for part in every if not labels.is_at_a_number(part)]
    second = [
        any(token.order > 1 or token.text in DERIVATIVE_NAMES for token in tk.walk(part))
        for part in parts
    ]
    equal = any(token.is_operator("=") for part in parts for token in tk.walk(part))
    if equal or len(every) < 2 or not (parts and all(second)):
        return None
    for part in every:
        if part not in parts:
            tk.note(tk.source(part))
    return ar.joined(parts)
