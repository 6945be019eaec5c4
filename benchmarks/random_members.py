"""Random members of families, each decided alone and compared with the printed leaf that holds it.

`python -m benchmarks.random_members [--only KEY ...] [--count N] [--others M] [--seed S] [--limit
SECONDS]` draws N different members on each leaf and N near it, where just one of its equations or
inequations fails, of each family of `benchmarks.members_of_families`: small rational numbers for
constants, polynomials, exponentials, sines, and logarithms for functions, which satisfy the leaf's
equations where these are solved in closed form or are linear in a constant, or happen to. Near it
are those with one constant or function drawn anew, and those where an inequation of it fails. M
others are of any leaf, with few numbers, so that many are special. The leaf of a member is the last
one whose equations vanish and whose inequations do not at random points of phase space. A member
that an open set may hold is counted as `not claimed`. Leaves with fewer than N members are listed
with their number.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import random
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import mpmath

import inverse_service
from benchmarks.members_of_families import FAMILIES
from inverse_service import errors
from inverse_service.decision import deciding
from inverse_service.expressions import calculus, collecting, printing, tree as ex
from inverse_service.linear_pde import involution
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import accepting
from inverse_service.solving import closed_members, members
from inverse_service.solving.closed_members import Solved
from inverse_service.statements.questions import PLAIN, TIMED, Question

Document = dict[str, Any]
NUMBERS = [Fraction(one) for one in ("0", "1", "-1", "2", "-2", "1/2", "3", "-1/3", "5/2")]
FEW = [Fraction(one) for one in (0, 0, 1, 1, -1, 2)]
POINTS, TRIED, CLOSE, DIGITS = 4, 40, 1e-6, 60
CHANGED = 3  # members near one on a leaf
NOTHING: dict[str, Any] = {"equations": [], "nonzero": []}
MOST_WRONG = 8  # after which no others are drawn on a leaf
# Where a member is not defined, or its conditions have no value.
NO_VALUE = (
    errors.InputError,
    errors.IrreducibleAtoms,
    ZeroDivisionError,
    ValueError,
    OverflowError,
    calculus.NoRealValue,
)
ONE = (
    "0",
    "{a}",
    "{a}*{x}",
    "{a}*{x}^2",
    "{a}*{x}^3 + {b}*{x}",
    "{a}/{x}",
    "{a}*exp({x})",
    "{a}/{x}^2 + {b}*{x}",
    "{a}*sin({x})",
    "{a}*log({x}) + {b}",
)
TWO = (
    "0", "{a}", "{a}*{x} + {b}*{y}", "({x} + {a}*{y})^2", "({a}*{x} + {b}*{y})^3", "{a}*{x}*{y}",
    "{x}^2 + {y}^2", "{a}*{x}^2 + {b}*{y}^2 + {c}*{x}*{y}", "{x}^3 - 3*{x}*{y}^2", "{a}*{x}^3 + {b}*{y}^2",
    "exp({x} + {a}*{y})", "{x}^2 - {y}^2", "{x}^3 + {x}*{y}^2", "{a}*{x}", "{a}*{y}^2", "{a}*{y}^3",
    "sin({x} + {a}*{y})", "{x}*cos({y})",
)  # fmt: skip

# Solutions of leaves that are not solved in closed form, found by hand, with P, a random function
# of x and y; a member drawn from them counts where it satisfies the leaf's equations.
KNOWN: dict[str, list[dict[str, str]]] = {
    # C = k B, B_x^2 + k B_y^2 = 0.
    "6c": [
        {"B": "{b}*({s}*x + y)^3 + {c}", "C": "-{s}^2*({b}*({s}*x + y)^3 + {c})"},
        {"B": "{b}*exp({s}*x + y)", "C": "-{s}^2*{b}*exp({s}*x + y)"},
    ],
    # F_x + G_y = 0, and F_y - G_x = a (F_x + G_y).
    "12w": [
        {"F": "diff({P}, y)", "G": "-diff({P}, x)"},
        {"F": "diff({P}, x) + {a}*diff({P}, y)", "G": "diff({P}, y) - {a}*diff({P}, x)"},
    ],
    # x'' = -V_x, y'' = -V_y - a x: V_xx - V_yy = k V_xy + m, in general and for m^2 = a k m + a^2.
    "25": [
        {"V": "{b}*({s}*x + y)^3 + {c}*({s}*y - x)^4 + a*{s}*x^2/2"},
        {"V": "{b}*exp({s}*x + y) + {c}*({s}*y - x)^3 + a*{s}*x^2/2"},
        {"V": "{s}*x^3 + {b}*(y^3 + 3*x^2*y) + {p}*x^2 + {q}*x*y + {r}*y^2"},
        {
            "V": "{s}*x^3/2 + {s}*(y^3 + 3*x^2*y)/3 + ({r} + (4*a + 3*{s}*{q})/(2*{s}))*x^2/2 "
            "+ {q}*x*y + {r}*y^2/2"
        },
    ],
    # u = r k: r u' = u (u + 1) (u + 2).
    "18": [{"k": "(1/sqrt(1 + {a}*r^2) - 1)/r"}, {"k": "(-1/sqrt(1 + {a}*r^2) - 1)/r"}],
}


@dataclass
class Counts:
    """How many distinct members agree, by the leaves that hold them (`on`) and by those of which
    one equation or inequation alone fails (`near`), and those that do not.
    """

    on: dict[int, int] = field(default_factory=dict)
    near: dict[int, int] = field(default_factory=dict)
    agree: int = 0
    not_claimed: int = 0
    undecided: int = 0
    wrong: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Drawn:
    """A member: what is put in for the constants and functions."""

    parts: tuple[Solved, ...]

    def of(self, tree: ex.Expression) -> ex.Expression:
        for one in self.parts:
            if isinstance(one.left, ex.Symbol):
                tree = ex.substitute(tree, {one.left: one.right})
            else:
                tree = closed_members.put_function(tree, one)
        return tree

    def system(self, system: SecondOrderSystem) -> SecondOrderSystem:
        """The member; ZeroDivisionError where it is none, as d = a c/b with b = 0."""
        for one in self.parts:
            if isinstance(one.left, ex.Symbol):
                system = second_order_system.with_values(system, {one.left: one.right})
            else:
                system = closed_members.with_function(system, one)
        for node in ex.distinct_nodes(system.accelerations):
            if isinstance(node, ex.Power) and node.base == ex.ZERO:
                raise ZeroDivisionError
        return second_order_system.branches_of(system)[0]

    def put_in(self) -> Drawn:
        """The same member, no part of which needs another."""
        return Drawn(tuple(Solved(one.left, self.of(one.right)) for one in self.parts))

    def __str__(self) -> str:
        return "; ".join(
            f"{printing.to_text(p.left)} = {printing.to_text(p.right)}" for p in self.parts
        )


class Numbers(random.Random):
    """Random small numbers, one in two of the smallest; with `few`, of those at which many members
    are special.
    """

    few = False

    def number(self) -> Fraction:
        if self.few:
            return self.choice(FEW)
        if self.random() < 0.5:
            return self.choice(NUMBERS)
        return Fraction(self.randint(-9, 9), self.randint(1, 5))


class Conditions(NamedTuple):
    """The equations of a set, as what vanishes, and what must not."""

    zero: tuple[ex.Expression, ...]
    nonzero: tuple[ex.Expression, ...]


def system_of(document: Document) -> SecondOrderSystem:
    schema = accepting.to_schema(accepting.prepared(document).document)
    return second_order_system.branches_of(accepting.to_system(schema))[0]


def compared(
    document: Document,
    family: Mapping[str, Any],
    count: int,
    seed: int = 1,
    known: Sequence[Mapping[str, str]] = (),
    others: int = 0,
) -> Counts:
    """`count` members on each leaf and as many near it, and `others` of any leaf, each decided
    alone.
    """
    # A document with constraints has no equations; its certificate is about the system it asks for.
    own = document if "equations" in document else family["certificate"]["system"]
    work = _Work(system_of(own), family, Numbers(seed), known)
    for number, leaf in enumerate(family["leaves"]):
        for drawn in _members(work, leaf, TRIED * count):
            on, near = (count - one.get(number, 0) for one in (work.found.on, work.found.near))
            done = on <= 0 and (near <= 0 or not number)
            if done or len(work.found.wrong) >= MOST_WRONG:
                break
            if on > 0:
                work.judge(drawn)
            changed = (_changed(work, drawn) for _ in range(CHANGED if near > 0 else 0))
            for one in changed:
                if work.is_near(one, number):
                    work.judge(one)
    for beside in _beside(family["leaves"]):
        for drawn in itertools.islice(_members(work, beside, TRIED * count), count):
            work.judge(drawn)
    work.rng.few = True
    for drawn in itertools.islice(_members(work, NOTHING, TRIED * others), others):
        work.judge(drawn)
    return work.found


@dataclass
class _Work:
    """A family, and what was found of its members so far."""

    system: SecondOrderSystem
    family: Mapping[str, Any]
    rng: Numbers
    known: Sequence[Mapping[str, str]] = ()
    found: Counts = field(default_factory=Counts)
    met: set[str] = field(default_factory=set)

    @cached_property
    def conditions(self) -> list[Conditions]:
        """Those of each leaf."""
        return [conditions_of(self.system, leaf) for leaf in self.family["leaves"]]

    @cached_property
    def opened(self) -> list[tuple[int, Conditions]]:
        """The leaf around each open set, and the equations by which it is named."""
        return [
            (one["inside"], conditions_of(self.system, {**one, "nonzero": []}))
            for one in self.family["open"]
        ]

    def failing(self, drawn: Drawn, conditions: Conditions) -> int:
        """How many of the conditions fail."""
        vanish = [_is_zero(drawn.of(t), self.system.coordinates, self.rng) for t in conditions.zero]
        must_not = (
            _is_zero(drawn.of(t), self.system.coordinates, self.rng) for t in conditions.nonzero
        )
        return vanish.count(False) + sum(must_not)

    def is_near(self, drawn: Drawn, number: int) -> bool:
        """Whether one condition of the leaf fails, and no other."""
        with suppress(*NO_VALUE):
            drawn.system(self.system)
            return self.failing(drawn, self.conditions[number]) == 1
        return False

    def judge(self, drawn: Drawn) -> None:
        """Decide a member, once, and compare it with the last leaf that holds it."""
        if str(drawn) in self.met:
            return
        try:
            failing = [self.failing(drawn, one) for one in self.conditions]
            held = max((k for k, times in enumerate(failing) if not times), default=None)
            is_open = held is None or any(
                inside == held and not self.failing(drawn, conditions)
                for inside, conditions in self.opened
            )
        except NO_VALUE:
            return
        self.met.add(str(drawn))
        if held is None or is_open:
            self.found.not_claimed += 1
            return
        leaf = self.family["leaves"][held]
        actual = _verdicts(drawn.system(self.system), leaf)
        if actual is None:
            self.found.undecided += 1
        elif actual != (leaf["verdict"], leaf["verdict_with_time"]):
            self.found.wrong.append(f"leaf {held}, {drawn}: {actual}")
        else:
            self.found.agree += 1
            for number, times in enumerate(failing):
                if times == 0 and (number or not held):
                    self.found.on[number] = self.found.on.get(number, 0) + 1
                elif times == 1:
                    self.found.near[number] = self.found.near.get(number, 0) + 1


def conditions_of(system: SecondOrderSystem, leaf: Mapping[str, Any]) -> Conditions:
    names = nm.Names(system.coordinates, system.parameters, dict(system.functions))

    def tree(text: str) -> ex.Expression:
        left, _, right = text.partition(" = ")
        return reader.read_formula(f"{left} - ({right or 0})", names)

    return Conditions(
        tuple(tree(one["text"]) for one in leaf["equations"]), tuple(map(tree, leaf["nonzero"]))
    )


def _beside(leaves: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """The members at which an inequation of a leaf fails; they belong to others."""
    for leaf in leaves:
        for text in leaf["nonzero"]:
            zero = {"text": f"{text} = 0"}
            known = [one for one in leaf.get("solved") or () if "/" not in one["text"]]  # no 0/0
            solved = [zero] if re.fullmatch(r"[A-Za-z]\w*(\([^()]*\))?", text) else []
            yield {
                **leaf,
                "equations": [*leaf["equations"], zero],
                "nonzero": [one for one in leaf["nonzero"] if one != text],
                "solved": [*known, *solved],
            }


def _verdicts(system: SecondOrderSystem, leaf: Mapping[str, Any]) -> tuple[Any, Any] | None:
    """The member's own verdicts on what the leaf answers; None if they are not known.

    Without an L(t, q, q') there is no L(q, q').
    """
    plain, timed = leaf["verdict"], leaf["verdict_with_time"]
    try:
        analysis = deciding.analyze(system)
        if timed is not None:
            timed = _decided(analysis, TIMED)
        if plain is not None:
            plain = timed if timed == "not_variational" else _decided(analysis, PLAIN)
    except (errors.IrreducibleAtoms, ZeroDivisionError):
        return None
    return None if "undetermined" in (plain, timed) else (plain, timed)


def _decided(analysis: deciding.Analysis, question: Question) -> str:
    limits = involution.Limits()
    return deciding.decide(analysis.system, question, limits=limits, analysis=analysis).verdict


def _members(work: _Work, leaf: Mapping[str, Any], attempts: int) -> Iterator[Drawn]:
    """Different members of a set, by so many attempts."""
    given, own = leaf.get("solved") or (), conditions_of(work.system, leaf)
    usable, made = all(map(_is_usable, given)), set[str]()
    for _ in range(attempts):
        with suppress(*NO_VALUE):
            parts = _solved(work.system, given, work.rng) if usable else []
            if work.known and not given and work.rng.random() < 0.5:
                parts = _by_hand(work.system, work.rng.choice(work.known), work.rng)
            drawn = _fitted(Drawn(_whole_member(work, parts)).put_in(), own.zero, work)
            drawn.system(work.system)
            if str(drawn) not in made and not work.failing(drawn, own):
                made.add(str(drawn))
                yield drawn


def _whole_member(work: _Work, parts: list[Solved]) -> tuple[Solved, ...]:
    """The parts, and the other constants and functions at random."""
    done = {printing.to_text(one.left).partition("(")[0] for one in parts}
    free = [name for name in work.family["letters"] if name not in done]
    letters = [Solved(ex.Symbol(name), ex.number(work.rng.number())) for name in free]
    names = [name for name in work.family["functions"] if name not in done]
    return (*parts, *letters, *_functions(work.system, names, work.rng))


def _fitted(drawn: Drawn, equations: Sequence[ex.Expression], work: _Work) -> Drawn:
    """The member with constants that solve equations that are linear in one."""
    for equation in equations:
        letters = [k for k, one in enumerate(drawn.parts) if isinstance(one.left, ex.Symbol)]
        work.rng.shuffle(letters)
        if collecting.collect(drawn.of(equation)) == ex.ZERO:
            continue
        for k in letters:
            values = [collecting.collect(_with(drawn, k, n).of(equation)) for n in range(3)]
            numbers = [one.value for one in values if isinstance(one, ex.Number)]
            if len(numbers) < 3 or numbers[0] == numbers[1]:
                continue
            if numbers[2] - numbers[1] == numbers[1] - numbers[0]:
                drawn = _with(drawn, k, numbers[0] / (numbers[0] - numbers[1]))
                break
    return drawn


def _with(drawn: Drawn, place: int, value: Fraction | int) -> Drawn:
    parts = list(drawn.parts)
    parts[place] = Solved(parts[place].left, ex.number(value))
    return Drawn(tuple(parts))


def _changed(work: _Work, drawn: Drawn) -> Drawn:
    """The member with another value for one of its constants, or another function."""
    parts = list(drawn.parts)
    names = [printing.to_text(one.left).partition("(")[0] for one in parts]
    own = {*work.family["letters"], *work.family["functions"]}  # not F_0 of F = F_0(x) + F_1(y)
    place = work.rng.choice([k for k, name in enumerate(names) if name in own])
    name = names[place]
    if name in work.family["letters"]:
        return _with(drawn, place, work.rng.number())
    (parts[place],) = _functions(work.system, [name], work.rng)
    return Drawn(tuple(parts))


def _is_usable(part: Mapping[str, Any]) -> bool:
    return " = " in part["text"] and "int" not in part["text"]


def _solved(
    system: SecondOrderSystem, given: Sequence[Mapping[str, Any]], rng: Numbers
) -> list[Solved]:
    """Solved lines with random numbers for their new constants, and functions for functions of
    fewer arguments.
    """
    functions, found, narrow = dict(system.functions), dict[str, Solved](), dict[str, list[str]]()
    fresh = [name for part in given for name in part.get("new_constants") or ()]
    values = {ex.Symbol(name): ex.number(rng.number()) for name in fresh}
    for part in given:
        left, right = part["text"].split(" = ", 1)
        name = left.partition("(")[0]
        if part.get("new_functions") == [name]:
            kept = right.partition("(")[2].rstrip(")").split(", ")
            narrow[name], functions[name] = kept, tuple(kept)
            continue
        for new in part.get("new_functions") or ():  # F(x, y) = F_0(x) + F_1(y)
            kept = right.partition(f"{new}(")[2].partition(")")[0].split(", ")
            functions[new] = tuple(kept)
            right = right.replace(f"{new}({', '.join(kept)})", f"({_text(kept, rng)})")
        names = nm.Names(system.coordinates, (*system.parameters, *fresh), functions)
        value = ex.substitute(reader.read_formula(right, names), values)
        found[name] = Solved(_whole(system, name), value)
    drawn = [
        one
        for name, kept in narrow.items()
        if name not in found
        for one in _functions(system, [name], rng, kept)
    ]
    return [*found.values(), *drawn]


def _by_hand(system: SecondOrderSystem, texts: Mapping[str, str], rng: Numbers) -> list[Solved]:
    """Functions that are solutions, with random numbers and a random function."""
    numbers = {key: f"({rng.number()})" for key in "abcpqrs"} | {"P": _text(["x", "y"], rng)}
    names = nm.Names(system.coordinates, system.parameters, {})
    return [
        Solved(_whole(system, name), reader.read_formula(text.format(**numbers), names))
        for name, text in texts.items()
    ]


def _whole(system: SecondOrderSystem, name: str) -> ex.Expression:
    """The constant of this name, or the function of all its arguments."""
    functions = dict(system.functions)
    if name not in functions:
        return ex.Symbol(name)
    names = nm.Names(system.coordinates, (), {name: functions[name]})
    return reader.read_formula(f"{name}({', '.join(functions[name])})", names)


def _functions(
    system: SecondOrderSystem,
    wanted: Sequence[str],
    rng: Numbers,
    kept: Sequence[str] = (),
) -> list[Solved]:
    """Random functions, some of them multiples of each other."""
    found, before = list[Solved](), dict[tuple[str, ...], ex.Expression]()
    functions = dict(system.functions)
    for name in wanted:
        of = functions[name]
        names = nm.Names(system.coordinates, (), {name: of})
        if of in before and rng.random() < 0.4:
            value = ex.number(rng.number()) * before[of]
        else:
            value = reader.read_formula(_text(list(kept or of), rng), names)
        before[of] = value
        found.append(Solved(_whole(system, name), value))
    return found


def _text(names: list[str], rng: Numbers) -> str:
    numbers = {key: f"({rng.number()})" for key in "abc"}
    rng.shuffle(names)
    if len(names) == 1 or rng.random() < 0.3:
        return rng.choice(ONE).format(x=names[0], **numbers)
    return rng.choice(TWO).format(x=names[0], y=names[1], **numbers)


def holders(system: SecondOrderSystem, family: Mapping[str, Any], drawn: Drawn) -> list[int]:
    """The leaves that hold a member, which has the verdicts of the last one."""
    work = _Work(system, family, Numbers(1))
    return [k for k, one in enumerate(work.conditions) if not work.failing(drawn, one)]


def _is_zero(tree: ex.Expression, coordinates: Sequence[str], rng: Numbers) -> bool:
    """Whether it is zero at random points, to 60 digits where it is small."""
    for _ in range(POINTS):
        values: dict[ex.Expression, float] = {ex.TIME: rng.uniform(0.3, 1.7), ex.PI: math.pi}
        for name in coordinates:
            values[ex.Symbol(name)], values[ex.Velocity(name)] = (
                rng.uniform(0.3, 1.7),
                rng.uniform(0.3, 1.7),
            )
        value, scale = _value(tree, values)
        if abs(value) > CLOSE * scale:
            return False
        with mpmath.workdps(DIGITS):
            exact = {leaf: mpmath.mpf(number) for leaf, number in values.items()}
            exact[ex.PI] = +mpmath.pi
            if abs(calculus.evaluate(tree, exact)) > mpmath.mpf(10) ** (10 - DIGITS) * scale:
                return False
    return True


def _value(tree: ex.Expression, values: Mapping[ex.Expression, float]) -> tuple[float, float]:
    """The value, and the size of what was added."""
    if isinstance(tree, ex.Number):
        return float(tree.value), abs(float(tree.value))
    if tree in values:
        return values[tree], abs(values[tree])
    if isinstance(tree, ex.Sum):
        found = [_value(one, values) for one in tree.terms]
        return math.fsum(one for one, _ in found), sum(size for _, size in found)
    if isinstance(tree, ex.Product):
        found = [_value(one, values) for one in tree.factors]
        return math.prod(one for one, _ in found), math.prod(size for _, size in found)
    if isinstance(tree, ex.Power):
        base, size = _value(tree.base, values)
        exponent = _value(tree.exponent, values)[0]
        if base < 0 and not exponent.is_integer():
            raise ValueError("a root of a negative number")
        return base**exponent, size**exponent if exponent > 0 else abs(base) ** exponent
    if isinstance(tree, ex.Apply):
        value = getattr(math, tree.function)(_value(tree.argument, values)[0])
        return value, abs(value) + 1.0
    raise ValueError(printing.to_text(tree))


def row(key: str, count: int, others: int, seed: int, limit: float) -> str:
    document = FAMILIES[key]
    began = time.process_time()
    asked = document | {"family": True, "first_integrals": False}
    result = json.loads(inverse_service.solve(asked, time_limit=limit).to_json())
    family = result["family"]
    found = compared(document, family, count, seed, KNOWN.get(key.split()[0], ()), others)
    places = range(len(family["leaves"]))
    on, near = (
        ", ".join(f"{k}: {table.get(k, 0)}" for k in among if table.get(k, 0) < count)
        for table, among in ((found.on, places), (found.near, places[1:]))
    )
    covered, seconds = "yes" if family["covered"] else "no", time.process_time() - began
    line = (f"| {key} | {covered} | {len(places)} | {found.agree} | {on} | {near} | {found.not_claimed} "
            f"| {found.undecided} | {len(found.wrong)} | {seconds:.0f} |")  # fmt: skip
    return "\n".join([line, *(f"  WRONG {one}" for one in found.wrong)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="beginnings of keys")
    parser.add_argument("--count", type=int, default=30, help="members on each leaf, and near it")
    parser.add_argument("--others", type=int, default=0, help="members of any leaf")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for each family")
    chosen = parser.parse_args()
    members.SEARCH_SECONDS = 0.0
    count = chosen.count
    print(
        f"| family | covered | leaves | agree | fewer than {count} on | fewer than {count} near "
        "| not claimed | undecided | wrong | seconds |"
    )
    print(f"|{' --- |' * 10}")
    for key in FAMILIES:
        if not chosen.only or key.split()[0] in chosen.only:
            print(row(key, count, chosen.others, chosen.seed, chosen.limit), flush=True)


if __name__ == "__main__":
    main()
