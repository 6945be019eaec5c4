"""Systems over the complex and the dual numbers: q'' = f is z'' = F(z, z') for numbers z = x + i y,
i^2 = -1 or 0.

They are those for which a constant matrix J with J^2 = -1 or 0 commutes with all f_q and f_v: F is
holomorphic. If L(z, z') is a Lagrangian of z'' = F, both parts of it are Lagrangians of the real
system, since the Euler-Lagrange expressions of Re L by x are those of L, and by y those of i L. If
F has constants with i, a parameter stands for i while L is found; L is an analytic function of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from inverse_service.expressions import calculus, collecting, functions, terms as tm, tree as ex
from inverse_service.field import matrices
from inverse_service.mechanics.second_order_system import SecondOrderSystem

# The two parts of a number.
Pair = tuple[ex.Expression, ex.Expression]
_HALF = ex.number(1) / ex.number(2)


class NoParts(ArithmeticError):
    """A function whose parts are not known."""


@dataclass(frozen=True, slots=True)
class Unit:
    """The number i with the square `square`, which is -1 or 0."""

    square: int

    def times(self, left: Pair, right: Pair) -> Pair:
        (a, b), (c, d) = left, right
        if left == right:
            return ex.add(a**2, self.square * b**2), 2 * a * b
        return ex.add(a * c, self.square * (b * d)), ex.add(a * d, b * c)

    def parts(self, tree: ex.Expression, known: dict[ex.Expression, Pair]) -> Pair:
        """The parts of a function of numbers, from those of its leaves; NoParts if they are not
        known.
        """
        if tree not in known:
            known[tree] = self._parts(tree, known)
        return known[tree]

    def _parts(self, tree: ex.Expression, known: dict[ex.Expression, Pair]) -> Pair:
        match tree:
            case ex.Sum(terms):
                pairs = [self.parts(term, known) for term in terms]
                return ex.add(*(a for a, _ in pairs)), ex.add(*(b for _, b in pairs))
            case ex.Product(factors):
                total: Pair = (ex.ONE, ex.ZERO)
                for factor in factors:
                    total = self.times(total, self.parts(factor, known))
                return total
            case ex.Power(base, ex.Number(exponent)):
                return self._power(self.parts(base, known), exponent)
            case ex.Power(base, exponent):
                return self.parts(ex.Apply("exp", exponent * ex.Apply("log", base)), known)
            case ex.Apply(function, argument) if function not in functions.SPECIAL:
                return self._function(function, self.parts(argument, known))
            case ex.Number() | ex.Symbol() | ex.Velocity():
                return tree, ex.ZERO
        raise NoParts

    def _power(self, base: Pair, exponent: Fraction) -> Pair:
        a, b = base

        def power(e: Fraction) -> ex.Expression:  # of a number without a root, as 4^(1/2)
            return tm.collected(a**e) if isinstance(a, ex.Number) else a**e

        if b == ex.ZERO:
            return power(exponent), ex.ZERO
        if self.square == 0:
            return power(exponent), exponent * power(exponent - 1) * b
        if exponent.denominator == 1 and abs(exponent) <= 4:
            total: Pair = (ex.ONE, ex.ZERO)
            for _ in range(abs(int(exponent))):
                total = self.times(total, base)
            if exponent < 0:
                size = (a**2 + b**2) ** exponent
                return total[0] * size, -total[1] * size
            return total
        size, angle = (a**2 + b**2) ** (exponent / 2), exponent * ex.Apply("atan", b / a)
        return size * ex.Apply("cos", angle), size * ex.Apply("sin", angle)

    def _function(self, function: str, argument: Pair) -> Pair:
        a, b = argument
        if b == ex.ZERO:
            return ex.Apply(function, a), ex.ZERO
        if self.square == 0:
            name = ex.Symbol("_")
            slope = calculus.differentiate(ex.Apply(function, name), name)
            return ex.Apply(function, a), ex.substitute(slope, {name: a}) * b
        sine, cosine, grown = ex.Apply("sin", a), ex.Apply("cos", a), ex.Apply("exp", a)
        match function:
            case "exp":
                return grown * ex.Apply("cos", b), grown * ex.Apply("sin", b)
            case "log":
                return _HALF * ex.Apply("log", a**2 + b**2), ex.Apply("atan", b / a)
            case "sin":
                return sine * ex.Apply("cosh", b), cosine * ex.Apply("sinh", b)
            case "cos":
                return cosine * ex.Apply("cosh", b), -sine * ex.Apply("sinh", b)
        raise NoParts


@dataclass(frozen=True, slots=True)
class Structure:
    """Coordinates of a system over the numbers with `unit`: q = sum of x_j w_j + y_j J w_j, z_j =
    x_j + `size` i y_j.

    `columns` are w_1, J w_1, w_2, …, as rows, and `rows` the inverse of the matrix with these
    columns.
    """

    unit: Unit
    size: ex.Expression
    columns: tuple[tuple[Fraction, ...], ...]
    rows: tuple[tuple[Fraction, ...], ...]


def structure_of(p: Sequence[Sequence[Fraction]]) -> Structure | None:
    """The numbers over which a system is defined with which the matrix commutes; None if its square
    is not constant.

    J is the matrix without its trace; J^2 = c < 0 makes complex numbers, J^2 = 0 dual ones if J has
    half the full rank.
    """
    n = len(p)
    if n % 2:
        return None
    trace = sum((p[k][k] for k in range(n)), Fraction(0)) / n
    j = [[p[i][k] - trace * (i == k) for k in range(n)] for i in range(n)]
    square = [
        [sum((j[i][m] * j[m][k] for m in range(n)), Fraction(0)) for k in range(n)]
        for i in range(n)
    ]
    c = square[0][0]
    if c > 0 or any(square[i][k] != c * (i == k) for i in range(n) for k in range(n)):
        return None
    columns: list[tuple[Fraction, ...]] = []
    for k in range(n):
        pair = [tuple(Fraction(i == k) for i in range(n)), tuple(row[k] for row in j)]
        if (
            len(matrices.echelon_of([list(row) for row in (*columns, *pair)], n))
            == len(columns) + 2
        ):
            columns += pair
    if len(columns) < n:
        return None
    beside = [
        [column[i] for column in columns] + [Fraction(i == k) for k in range(n)] for i in range(n)
    ]
    rows = tuple(tuple(line[n:]) for _, line in matrices.echelon_of(beside, 2 * n))
    size = tm.collected(ex.number(-c) ** Fraction(1, 2)) if c else ex.ONE
    return Structure(Unit(-1 if c else 0), size, tuple(columns), rows)


def system_over(
    structure: Structure, system: SecondOrderSystem
) -> tuple[SecondOrderSystem, ex.Symbol]:
    """z'' = F(z, z') in the coordinates of w_1, w_2, …, with their names, and the parameter that
    stands for i.

    F is known from its values for real z.
    """
    names, n = system.coordinates, len(system.coordinates)
    own = names[::2]
    taken = {*names, *system.parameters, *(name for name, _ in system.functions)}
    letter = next(name for k in range(n + len(taken) + 1) if (name := f"i_{k}") not in taken)
    table: dict[ex.Expression, ex.Expression] = {}
    for k, name in enumerate(names):
        for kind in (ex.Symbol, ex.Velocity):
            parts = zip(structure.columns[::2], own, strict=True)
            table[kind(name)] = ex.add(*(ex.number(column[k]) * kind(z) for column, z in parts))
    real = [ex.substitute(f, table) for f in system.accelerations]
    forces = [
        ex.add(*(ex.number(c) * f for c, f in zip(row, real, strict=True)))
        for row in structure.rows
    ]
    whole = []
    for x, y in zip(forces[::2], forces[1::2], strict=True):
        imaginary = tm.collected(collecting.collect(y))
        whole.append(
            tm.collected(collecting.collect(x)) + ex.Symbol(letter) * structure.size * imaginary
        )
    parameters = (*system.parameters, letter)
    held = any(ex.holds(f, ex.Symbol(letter)) for f in whole)
    made = replace(system, coordinates=own, accelerations=tuple(whole), branch=None, nonzero=())
    return replace(made, parameters=parameters if held else system.parameters), ex.Symbol(letter)


def parts_of(
    structure: Structure, system: SecondOrderSystem, letter: ex.Symbol, lagrangian: ex.Expression
) -> list[ex.Expression]:
    """The parts of a Lagrangian of `system_over` in the coordinates of the system, shorter ones
    first.

    For dual numbers only the part of i is regular. None if they are not known.
    """
    known: dict[ex.Expression, Pair] = {letter: (ex.ZERO, ex.ONE)}
    for j, z in enumerate(system.coordinates[::2]):
        for kind in (ex.Symbol, ex.Velocity):
            x, y = (
                ex.add(
                    *(
                        ex.number(c) * kind(name)
                        for c, name in zip(row, system.coordinates, strict=True)
                    )
                )
                for row in structure.rows[2 * j : 2 * j + 2]
            )
            known[kind(z)] = x, structure.size * y
    try:
        real, imaginary = structure.unit.parts(lagrangian, known)
    except NoParts:
        return []
    found = [imaginary] if structure.unit.square == 0 else [real, imaginary]
    return sorted(map(_collected, found), key=ex.node_count)


def _collected(tree: ex.Expression) -> ex.Expression:
    """The tree collected, unless powers of sums make that much longer."""
    whole = tm.collected(tree)
    return tree if 3 * ex.node_count(tree) < 2 * ex.node_count(whole) else whole
