"""The factors by which an algebraic elimination divides; where they vanish, its outcome may differ.

The conditions of the hierarchy are solved for the entries of g one after another, with the parameters as symbols. A
divisor is a polynomial in t, q, v, the functions, and the parameters. For given parameter values it vanishes
identically exactly when all its coefficients with respect to the other generators vanish. These coefficients generate
an ideal. Outside the zero sets of all these ideals, the elimination and its outcome remain valid. Jets of arbitrary
functions, and the coordinates on which these depend, count as parameters; `functional` says that they occur.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flint import fmpq, fmpq_mpoly

from inverse_service import bounds, errors
from inverse_service.decision.deciding import Analysis
from inverse_service.explanation import hierarchy
from inverse_service.expressions import calculus, collecting, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import euler_lagrange
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import reductions
from inverse_service.solving import strata


@dataclass(frozen=True)
class Ideal:
    """Elements that vanish together in a special case: polynomials in the parameters, or trees with functions."""

    polynomials: tuple[fmpq_mpoly, ...]
    functional: tuple[ex.Expression, ...] = ()


@dataclass(frozen=True)
class SideConditions:
    """A calculation's outcome is valid off their zeros; `doubtful`: functions may hide additional special values."""

    ideals: tuple[Ideal, ...]
    doubtful: bool


def of_conditions(
    analysis: Analysis,
    space: strata.ParameterSpace,
    names: Sequence[hierarchy.EquationName],
    budget: exact_field.Budget,
    seed: int = 1,
) -> SideConditions:
    """The side conditions of solving the named equations of the hierarchy; raises TooLarge, ZeroDivisionError."""
    rows = hierarchy.exact_rows(analysis, names, seed, budget)
    reader = Reader.of(rows.ring, space)
    solved = hierarchy.eliminate(rows.equations, rows.table).solved
    divisors = [part for step in solved for part in (step.content, step.divisor)]
    ideals = [*(ideal for part in divisors for ideal in reader.ideals(part)), *reader.inside_functions()]
    return SideConditions(tuple(ideals), any(map(reader.is_doubtful, divisors)))


def on_functions(analysis: Analysis, seed: int, end: float) -> list[tuple[ex.Expression, ...]]:
    """The sets of equations between functions at which the algebraic proof of a no may fail, shortest first.

    Empty where the algebraic conditions do not suffice, or the time `end` comes first.
    """
    budget = exact_field.Budget(bounds.TERMS, end)
    try:
        chosen = hierarchy.smallest_sufficient_set(analysis, seed)
        if chosen is None:
            return []
        space = strata.ParameterSpace(analysis.system.parameters)
        ideals = of_conditions(analysis, space, chosen.equations, budget, seed).ideals
    except (exact_field.TooLarge, ZeroDivisionError, errors.IrreducibleAtoms):
        return []
    found = dict.fromkeys(tuple(map(collecting.collect, one.functional)) for one in ideals if one.functional)
    return sorted(found, key=lambda trees: sum(map(ex.node_count, trees)))


@dataclass(frozen=True)
class Reader:
    """Extract the coefficients of ring polynomials with respect to the generators that are not parameters.

    `kept` maps generators to parameters by index; `jets` are the generators of arbitrary functions and of the
    coordinates on which these depend.
    """

    ring: exact_field.ExactRing
    space: strata.ParameterSpace
    kept: Mapping[int, int]
    jets: frozenset[int]

    @classmethod
    def of(cls, ring: exact_field.ExactRing, space: strata.ParameterSpace) -> Reader:
        kept, jets = {}, set[int]()
        arguments: set[ex.Expression] = set()
        for index, tree in ring.trees.items():
            if isinstance(tree, ex.Symbol) and tree.name in space.names:
                kept[index] = space.names.index(tree.name)
            if isinstance(tree, ex.Arbitrary):
                jets.add(index)
                arguments |= {node for node in ex.walk(tree) if isinstance(node, ex.Symbol | ex.Velocity)}
        jets |= {index for index, tree in ring.trees.items() if tree in arguments} if jets else set()
        return cls(ring, space, kept, frozenset(jets - kept.keys()))

    @property
    def parametric(self) -> list[int]:
        """The generators that are functions, roots, or powers of an expression with a parameter."""
        names = {ex.Symbol(name) for name in self.space.names}
        return [
            index
            for index, tree in self.ring.trees.items()
            if isinstance(tree, ex.Apply | ex.Power) and names & set(ex.walk(tree))
        ]

    def inside_functions(self) -> list[Ideal]:
        """Where the argument of such a function becomes zero or constant, or an exponent becomes a small integer."""
        found: list[Ideal] = []
        for index in self.parametric:
            tree = self.ring.trees[index]
            for part in ex.children(tree):
                found += self._special_values(part, isinstance(tree, ex.Power) and part == ex.children(tree)[1])
        return found

    def _special_values(self, tree: ex.Expression, is_exponent: bool) -> list[Ideal]:
        if isinstance(tree, ex.Number):
            return []
        try:
            value = self.ring.value(tree)
        except (KeyError, ZeroDivisionError):
            return []
        if is_exponent:
            shifted = [value + self.ring.constant(k) for k in range(-3, 3)]
            return [ideal for each in shifted for ideal in self.ideals(each)]
        constant = [part for part in self._by_others(value.numerator) if any(part[0])]
        moving = Ideal(tuple(polynomial for _, polynomial in constant))
        return [*self.ideals(value), *([moving] if constant and not any(p.is_constant() for _, p in constant) else [])]

    def is_doubtful(self, quotient: exact_field.Quotient) -> bool:
        """Whether the element may vanish for parameters that make functions in it dependent.

        A single exp, log, sin, or cos of a moving argument is independent of rational functions for all parameters; two
        with different arguments, roots, and powers need not be.
        """
        involved = [k for k in self.parametric if quotient.numerator.degrees()[k]]
        shapes = {tuple(int(exponents[k]) for k in involved) for exponents, _ in quotient.numerator.terms()}
        if len(shapes) < 2:
            return False
        trees = [self.ring.trees[k] for k in involved]
        return any(isinstance(tree, ex.Power) for tree in trees) or len({ex.children(tree) for tree in trees}) > 1

    def ideals(self, quotient: exact_field.Quotient) -> list[Ideal]:
        """The ideals whose common zero set is where the numerator vanishes identically."""
        numerator = quotient.numerator
        if any(e and index in self.jets for index, e in enumerate(numerator.degrees())):
            return self._functional(numerator)
        parts = self.coefficients(numerator)
        return [] if any(part.is_constant() for part in parts) else [Ideal(tuple(parts))]

    def coefficients(self, polynomial: fmpq_mpoly) -> list[fmpq_mpoly]:
        """The coefficients in the generators that are not parameters, as polynomials in the parameters."""
        return [part for _, part in self._by_others(polynomial)]

    def _by_others(self, polynomial: fmpq_mpoly) -> list[tuple[tuple[int, ...], fmpq_mpoly]]:
        """(exponents of the generators that are not parameters, coefficient)."""
        tables: dict[tuple[int, ...], dict[tuple[int, ...], fmpq]] = {}
        for exponents, value in polynomial.terms():
            key = [0] * max(len(self.space.names), 1)
            rest = [int(e) for e in exponents]
            for index, place in self.kept.items():
                key[place], rest[index] = rest[index], 0
            tables.setdefault(tuple(rest), {})[tuple(key)] = value
        return [(rest, self.space.context.from_dict(table)) for rest, table in tables.items()]

    def _functional(self, polynomial: fmpq_mpoly) -> list[Ideal]:
        """One ideal for each common factor of the coefficients, and one for the remaining factors."""
        others = [k for k in range(len(polynomial.degrees())) if k not in self.jets and k not in self.kept]
        parts = list(exact_field.coefficients_of(polynomial, others).values())
        common = exact_field.common_divisor(parts)
        found = [
            self._of_parts([factor]) for factor in strata.factors(common) if not self._essential(factor).is_constant()
        ]
        left = [self._essential(part / common) for part in parts]
        return found if any(part.is_constant() for part in left) else [*found, self._of_parts(left)]

    def _essential(self, polynomial: fmpq_mpoly) -> fmpq_mpoly:
        """The product of the factors that hold functions or parameters: coordinates vanish nowhere."""
        arguments = [k for k in self.jets if not isinstance(self.ring.trees[k], ex.Arbitrary)]
        whole = polynomial.context().constant(1)
        for factor, _ in exact_field.factor_polynomial(polynomial)[1]:
            if any(e and k not in arguments for k, e in enumerate(factor.degrees())):
                whole *= factor
        return whole

    def _of_parts(self, parts: Sequence[fmpq_mpoly]) -> Ideal:
        if any(e and index in self.jets for part in parts for index, e in enumerate(part.degrees())):
            return Ideal((), tuple(exact_field.polynomial_tree(self.ring, part) for part in parts))
        return Ideal(tuple(self.coefficients(part)[0] for part in parts))


def all_conditions(analysis: Analysis, depth: int, seed: int = 1) -> list[hierarchy.EquationName]:
    """The names of the equations of the hierarchy to `depth` that are not zero at a generic point."""
    table = hierarchy.equations_at(analysis, seed, depth)
    return [name for name, row in table.rows.items() if any(row)]


def regularity(
    system: SecondOrderSystem, lagrangian: ex.Expression, space: strata.ParameterSpace, budget: exact_field.Budget
) -> SideConditions:
    """Where a Lagrangian of the system may fail or be singular; raises TooLarge or ZeroDivisionError."""
    entries = euler_lagrange.hessian(lagrangian, system.coordinates)
    trees = [*(entry for row in entries for entry in row), lagrangian]
    ring = exact_field.exact_ring(trees, system.variables, 0, budget)
    matrix = [[ring.value(entry) for entry in row] for row in entries]
    # The value of L itself lists its denominators.
    ring.value(lagrangian)
    reader = Reader.of(ring, space)
    whole = matrices.determinant(matrix, ring.constant(1))
    divisors = [whole, *(exact_field.Quotient(ring.field, denominator, ()) for denominator in ring.field.denominators)]
    ideals = [*(ideal for each in divisors for ideal in reader.ideals(each)), *reader.inside_functions()]
    return SideConditions(tuple(ideals), reader.is_doubtful(whole))


def has_one_everywhere(system: SecondOrderSystem) -> bool:
    """Whether a theorem gives an L(q, q') for all values of the parameters without exception.

    An equation for one coordinate has one. So does u'' = a u' + b u + c over any algebra R[M], with an L analytic in a,
    b, c, u, u': a nondegenerate linear form of it (R[M] has one) is a Lagrangian of the real system. Hence q'' = A q' +
    B q + c has one if A and B are polynomials in one real matrix: one of them is a number times 1, or n = 2 and A B = B
    A.
    """
    blocks = () if system.depends_on_time else reductions.decoupled_blocks(system)
    return bool(blocks) and all(len(block.coordinates) == 1 or _is_over_an_algebra(block) for block in blocks)


def _is_over_an_algebra(system: SecondOrderSystem) -> bool:
    names: list[ex.Symbol | ex.Velocity] = [*map(ex.Symbol, system.coordinates), *map(ex.Velocity, system.coordinates)]
    rows = [[collecting.collect(calculus.differentiate(f, name)) for name in names] for f in system.accelerations]
    if any(node in names or isinstance(node, ex.Arbitrary) for row in rows for entry in row for node in ex.walk(entry)):
        return False
    n = len(system.coordinates)
    stiffness, damping = [row[:n] for row in rows], [row[n:] for row in rows]
    if _is_scalar(damping) or _is_scalar(stiffness):
        return True
    return n == 2 and all(
        collecting.collect(ex.add(*(damping[i][k] * stiffness[k][j] for k in range(2)),
                    *(-(stiffness[i][k] * damping[k][j]) for k in range(2)))) == ex.ZERO
        for i in range(2) for j in range(2)
    )  # fmt: skip


def _is_scalar(matrix: Sequence[Sequence[ex.Expression]]) -> bool:
    """Whether the matrix is a number times the unit matrix."""
    entries = [(i, j, entry) for i, row in enumerate(matrix) for j, entry in enumerate(row)]
    return all((entry == matrix[0][0]) if i == j else entry == ex.ZERO for i, j, entry in entries)
