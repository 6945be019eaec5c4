"""Random members of families, each decided alone and compared with the printed leaf that holds it.

`python -m benchmarks.random_members [--only KEY ...] [--count N] [--seed S] [--limit SECONDS]` draws N
members on each leaf, N at which an inequation of a leaf fails, and N others of each family of
`benchmarks.members_of_families`: small rational
numbers for constants, polynomials and exponentials for functions, which satisfy the leaf's
equations where these are solved in closed form, or happen to. The leaf of a member is the last one
whose equations vanish and whose inequations do not at random points of phase space. A member that
only open sets or no leaf can hold is counted as `not claimed`.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import inverse_service
from benchmarks.members_of_families import FAMILIES
from inverse_service import errors
from inverse_service.decision import deciding
from inverse_service.expressions import printing, tree as ex
from inverse_service.linear_pde import involution
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import names as nm, reader
from inverse_service.service.documents import accepting
from inverse_service.solving import closed_members, members
from inverse_service.solving.closed_members import Solved
from inverse_service.statements.questions import PLAIN, TIMED

Document = dict[str, Any]
NUMBERS = [Fraction(one) for one in ("0", "1", "-1", "2", "-2", "1/2", "3", "-1/3", "5/2")]
POINTS, TRIED, CLOSE = 4, 40, 1e-8
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


@dataclass
class Counts:
    """How many members agree, by the leaves that hold them, and those that do not."""

    on: dict[int, int] = field(default_factory=dict)
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
        for one in self.parts:
            if isinstance(one.left, ex.Symbol):
                system = second_order_system.with_values(system, {one.left: one.right})
            else:
                system = closed_members.with_function(system, one)
        return second_order_system.branches_of(system)[0]

    def __str__(self) -> str:
        return "; ".join(
            f"{printing.to_text(p.left)} = {printing.to_text(p.right)}" for p in self.parts
        )


def system_of(document: Document) -> SecondOrderSystem:
    schema = accepting.to_schema(accepting.prepared(document).document)
    return second_order_system.branches_of(accepting.to_system(schema))[0]


def compared(document: Document, family: Mapping[str, Any], count: int, seed: int = 1) -> Counts:
    """`count` members on each leaf and as many others, each decided alone."""
    # A document with constraints has no equations; its certificate is about the system it asks for.
    own = document if "equations" in document else family["certificate"]["system"]
    system, found, rng = system_of(own), Counts(), random.Random(seed)
    leaves, opened = family["leaves"], {one["inside"] for one in family["open"]}
    sets = {**family, "leaves": [*leaves, *_beside(leaves)]}
    for number in range(len(sets["leaves"])):
        for drawn in _members(system, sets, number, rng, count):
            held_by = holders(system, family, drawn, rng)
            held = max(held_by, default=None)
            if held in opened or held is None:
                found.not_claimed += 1
                continue
            leaf, actual = leaves[held], _verdicts(drawn.system(system), leaves[held])
            if actual is None:
                found.undecided += 1
            elif actual != (leaf["verdict"], leaf["verdict_with_time"]):
                found.wrong.append(f"leaf {held}, {drawn}: {actual}")
            else:
                found.on |= {k: found.on.get(k, 0) + 1 for k in held_by if k or not held}
    return found


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
    """The member's own verdicts on what the leaf answers; None if they are not known."""
    answers = list[Any]()
    for question, said in ((PLAIN, leaf["verdict"]), (TIMED, leaf["verdict_with_time"])):
        if said is None:
            answers.append(None)
            continue
        try:
            answers.append(deciding.decide(system, question, limits=involution.Limits()).verdict)
        except (errors.IrreducibleAtoms, ZeroDivisionError):
            return None
    return None if "undetermined" in answers else (answers[0], answers[1])


def _members(
    system: SecondOrderSystem,
    family: Mapping[str, Any],
    number: int,
    rng: random.Random,
    count: int,
) -> Iterator[Drawn]:
    """Members on a leaf if some are found, else any."""
    given = family["leaves"][number].get("solved") or ()
    usable, made = all(map(_is_usable, given)), 0
    for attempt in range(TRIED * count):
        parts = _solved(system, given, rng) if usable else []
        done = {printing.to_text(one.left).partition("(")[0] for one in parts}
        free = [name for name in family["letters"] if name not in done]
        parts += [Solved(ex.Symbol(name), ex.number(rng.choice(NUMBERS))) for name in free]
        parts += _functions(system, [name for name in family["functions"] if name not in done], rng)
        drawn = Drawn(tuple(parts))
        try:
            drawn.system(system)
            here = number == 0 or _holds(system, family["leaves"][number], drawn, rng)
        except (
            errors.InputError,
            errors.IrreducibleAtoms,
            ZeroDivisionError,
            ValueError,
            OverflowError,
        ):
            continue
        if here or attempt >= (TRIED - 1) * count:
            yield drawn
            made += 1
        if made == count:
            return


def _is_usable(part: Mapping[str, Any]) -> bool:
    return " = " in part["text"] and "int" not in part["text"]


def _solved(
    system: SecondOrderSystem, given: Sequence[Mapping[str, Any]], rng: random.Random
) -> list[Solved]:
    """Solved lines with random numbers for their new constants, and functions for functions of
    fewer arguments.
    """
    functions, found, narrow = dict(system.functions), dict[str, Solved](), dict[str, list[str]]()
    fresh = [name for part in given for name in part.get("new_constants") or ()]
    values = {ex.Symbol(name): ex.number(rng.choice(NUMBERS)) for name in fresh}
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
    rng: random.Random,
    kept: Sequence[str] = (),
) -> list[Solved]:
    """Random functions, some of them multiples of each other."""
    found, before = list[Solved](), dict[tuple[str, ...], ex.Expression]()
    functions = dict(system.functions)
    for name in wanted:
        of = functions[name]
        names = nm.Names(system.coordinates, (), {name: of})
        if of in before and rng.random() < 0.4:
            value = ex.number(rng.choice(NUMBERS)) * before[of]
        else:
            value = reader.read_formula(_text(list(kept or of), rng), names)
        before[of] = value
        found.append(Solved(_whole(system, name), value))
    return found


def _text(names: list[str], rng: random.Random) -> str:
    numbers = {key: f"({rng.choice(NUMBERS)})" for key in "abc"}
    rng.shuffle(names)
    if len(names) == 1 or rng.random() < 0.3:
        return rng.choice(ONE).format(x=names[0], **numbers)
    return rng.choice(TWO).format(x=names[0], y=names[1], **numbers)


def holders(
    system: SecondOrderSystem, family: Mapping[str, Any], drawn: Drawn, rng: random.Random
) -> list[int]:
    """The leaves that hold a member, which has the verdicts of the last one."""
    leaves = family["leaves"]
    return [k for k, leaf in enumerate(leaves) if _holds(system, leaf, drawn, rng)]


def _holds(
    system: SecondOrderSystem, leaf: Mapping[str, Any], drawn: Drawn, rng: random.Random
) -> bool:
    names = nm.Names(system.coordinates, system.parameters, dict(system.functions))

    def vanishes(text: str) -> bool:
        left, _, right = text.partition(" = ")
        tree = reader.read_formula(f"{left} - ({right or 0})", names)
        return _is_zero(drawn.of(tree), system.coordinates, rng)

    return all(vanishes(one["text"]) for one in leaf["equations"]) and not any(
        map(vanishes, leaf["nonzero"])
    )


def _is_zero(tree: ex.Expression, coordinates: Sequence[str], rng: random.Random) -> bool:
    """Whether it is zero at random points, up to round-off."""
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


def row(key: str, document: Document, count: int, seed: int, limit: float) -> str:
    asked = document | {"family": True, "first_integrals": False}
    result = json.loads(inverse_service.solve(asked, time_limit=limit).to_json())
    family = result["family"]
    found = compared(document, family, count, seed)
    held = ", ".join(f"{number}: {times}" for number, times in sorted(found.on.items()))
    without = [k for k in range(len(family["leaves"])) if k not in found.on]
    lines = [f"| {key} | {'yes' if family['covered'] else 'no'} | {held} | {without or ''} "
             f"| {found.not_claimed} | {found.undecided} | {len(found.wrong)} |"]  # fmt: skip
    return "\n".join([*lines, *(f"  WRONG {one}" for one in found.wrong)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="beginnings of keys")
    parser.add_argument("--count", type=int, default=30, help="members on each leaf")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for each family")
    chosen = parser.parse_args()
    members.SEARCH_SECONDS = 0.0
    print(
        "| family | covered | agree, by leaf | leaves without members | not claimed | undecided | wrong |"
    )
    print(f"|{' --- |' * 7}")
    for key, document in FAMILIES.items():
        if not chosen.only or key.split()[0] in chosen.only:
            print(row(key, document, chosen.count, chosen.seed, chosen.limit), flush=True)


if __name__ == "__main__":
    main()
