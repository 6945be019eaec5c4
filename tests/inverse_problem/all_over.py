"""Answers of result documents tested by numbers all over the sets on which they are said to hold.

Points are drawn over many powers of ten and both signs, not near any one point; derivatives are SymPy's.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import mpmath
import sympy

from benchmarks.sympy_form import velocity
from tests.catalogue.symbolic import Point, Reader, opaque_atoms, value

DIGITS = 70
TOLERANCE = mpmath.mpf(10) ** -40
POINTS = 8
_DRAWS = 1500
TIME = sympy.Symbol("t")
_RELATION = re.compile(r"(.*?)\s*(!=|>|<)\s*(.*)")


@dataclass(frozen=True)
class Region:
    """Points at which every inequality holds, each u > 0 or (`apart`) u != 0."""

    positive: tuple[sympy.Expr, ...]
    apart: tuple[sympy.Expr, ...]
    bounds: tuple[tuple[sympy.Expr, int, sympy.Expr], ...]

    def holds(self, point: Point) -> bool:
        try:
            numbers = [value(tree, point) for tree in self.positive]
            others = [value(tree, point) for tree in self.apart]
        except (ZeroDivisionError, ValueError, OverflowError):
            return False
        real = all(isinstance(number, mpmath.mpf) for number in (*numbers, *others))
        return real and all(number > 0 for number in numbers) and all(others)


def region(texts: list[str], read: Reader) -> Region:
    """What the inequalities of a document say."""
    positive, apart, bounds = [], [], []
    for text in texts:
        found = _RELATION.fullmatch(text)
        assert found is not None, text
        left, right = read(found[1]), read(found[3])
        if found[2] == "!=":
            apart.append(left - right)
            continue
        side = 1 if found[2] == ">" else -1
        positive.append(side * (left - right))
        if left.is_Symbol and not right.free_symbols:
            bounds.append((left, side, right))
    return Region(tuple(positive), tuple(apart), tuple(bounds))


def drawn(atoms: set[sympy.Expr], where: Region, seed: int) -> Iterator[Point]:
    """Random points of the region over four powers of ten; between two bounds of a variable anywhere."""
    rng = random.Random(seed)
    ordered = sorted(atoms, key=str)
    limits = [(name, side, value(bound, {sympy.pi: +mpmath.pi})) for name, side, bound in where.bounds]
    for _ in range(_DRAWS):
        point = {atom: _number(rng) for atom in ordered}
        for atom in ordered:
            lower = [bound for name, side, bound in limits if name == atom and side > 0]
            upper = [bound for name, side, bound in limits if name == atom and side < 0]
            if lower and upper:
                point[atom] = max(lower) + (min(upper) - max(lower)) * mpmath.mpf(rng.randint(1, 10**9)) / (10**9 + 1)
            elif lower or upper:
                point[atom] = max(lower) + abs(point[atom]) if lower else min(upper) - abs(point[atom])
        point[sympy.pi] = +mpmath.pi
        if where.holds(point):
            yield point


def _number(rng: random.Random) -> mpmath.mpf:
    size = mpmath.mpf(rng.randint(10**9, 10**10)) / 10**10 * mpmath.mpf(10) ** rng.randint(-2, 1)
    return size * rng.choice((1, -1))


def worst_defects(answer: Mapping[str, Any], system: Mapping[str, Any]) -> tuple[int, mpmath.mpf, int, mpmath.mpf]:
    """(points, largest Euler-Lagrange residual; points, largest defect of Hamilton's equations), relative to terms.

    `system` is that of the result; the answer is a result, one of its branches, or its `with_time`.
    """
    integrals = (answer["certificate"] or {}).get("integrals", {})
    system = {**system, "functions": {**system["functions"], **{k: v["arguments"] for k, v in integrals.items()}}}
    read = Reader(system)
    slopes = _slopes(integrals, read)
    names = [sympy.Symbol(name) for name in read.coordinates]
    speeds = [velocity(name) for name in read.coordinates]
    forces = [read(system["equations"][name]) for name in read.coordinates]
    tree = read(answer["lagrangian"]["text"])
    where = region([*answer["domain"], *answer["lagrangian"]["domain"]], read)
    momenta = [tree.diff(v).xreplace(slopes) for v in speeds]  # an integral over v is differentiated twice
    rows = []
    for p, q in zip(momenta, names, strict=True):
        along = [p.diff(a) * b for a, b in zip((*names, *speeds), (*speeds, *forces), strict=True)]
        rows.append([term.xreplace(slopes) for term in (p.diff(TIME), *along, -tree.diff(q))])
    test = _Hamilton(answer["hamiltonian"], system, tree, slopes) if _is_closed(answer["hamiltonian"]) else None
    counts, worst = [0, 0], [mpmath.mpf(0), mpmath.mpf(0)]
    with mpmath.workdps(DIGITS):
        atoms = opaque_atoms([tree, *forces, *(term for row in rows for term in row), *names, *speeds, *where.positive])
        for point in drawn(atoms, where, 7):
            try:
                found = max(_relative([value(term, point) for term in row]) for row in rows)
            except (ZeroDivisionError, ValueError, OverflowError):
                continue
            counts[0] += 1
            worst[0] = max(worst[0], found)
            defect = test.defect(point) if test is not None else None
            if defect is not None:
                counts[1] += 1
                worst[1] = max(worst[1], defect)
            if counts[0] >= POINTS and (test is None or counts[1] >= POINTS):
                break
    return counts[0], worst[0], counts[1], worst[1]


def _slopes(integrals: Mapping[str, Any], read: Reader) -> dict[sympy.Expr, sympy.Expr]:
    """What the derivatives of functions with an integral sign are."""
    return {
        sympy.Function(name)(*map(read, part["arguments"])).diff(read(by)): read(slope)
        for name, part in integrals.items()
        for by, slope in part["derivatives"].items()
    }


def _is_closed(part: Mapping[str, Any] | None) -> bool:
    return part is not None and not part["implicit"]


class _Hamilton:
    """dH/dp = v and dH/dq = -dL/dq at p = dL/dv."""

    def __init__(
        self,
        part: Mapping[str, Any],
        system: Mapping[str, Any],
        lagrangian: sympy.Expr,
        slopes: Mapping[sympy.Expr, sympy.Expr],
    ) -> None:
        momenta = list(part["momenta"])
        read = Reader({**system, "parameters": [*system["parameters"], *momenta]})
        tree, self.where = read(part["text"]), region(part["domain"], read)
        self.symbols = [sympy.Symbol(name) for name in momenta]
        names = [sympy.Symbol(name) for name in read.coordinates]
        self.speeds = [velocity(name) for name in read.coordinates]
        self.momenta = [lagrangian.diff(v) for v in self.speeds]
        self.by_p = [tree.diff(p) for p in self.symbols]
        self.by_q = [(tree.diff(q).xreplace(slopes), lagrangian.diff(q).xreplace(slopes)) for q in names]

    def defect(self, point: Point) -> mpmath.mpf | None:
        """The largest, None outside of the branch."""
        try:
            here = {**point, **{p: value(m, point) for p, m in zip(self.symbols, self.momenta, strict=True)}}
            if not self.where.holds(here):
                return None
            pairs = [(value(tree, here), -here[v]) for tree, v in zip(self.by_p, self.speeds, strict=True)]
            pairs += [(value(left, here), value(right, here)) for left, right in self.by_q]
        except (ZeroDivisionError, ValueError, OverflowError):
            return None
        return max(_relative(pair) for pair in pairs)


def _relative(numbers: Any) -> mpmath.mpf:
    return abs(mpmath.fsum(numbers)) / (1 + max(map(abs, numbers)))


def assert_holds_all_over(result: Mapping[str, Any]) -> int:
    """Every Lagrangian and Hamiltonian of a result, on every branch; how many points were tried in all."""
    tried = 0
    for answer in result["branches"] or [result]:
        for each in (answer, answer["with_time"]):
            if each is None or each["lagrangian"] is None:
                continue
            points, residual, phase, defect = worst_defects(each, result["system"])
            assert points, f"no point of {each['domain']} was found"
            assert residual < TOLERANCE, (each["lagrangian"], each["domain"], residual)
            assert defect < TOLERANCE, (each["hamiltonian"], defect)
            tried += points + phase
    return tried
