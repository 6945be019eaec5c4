"""For which constants and functions a Lagrangian in closed form is singular or not defined."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from flint import fmpq_mpoly

from inverse_service import bounds
from inverse_service.decision import certify
from inverse_service.expressions import calculus, collecting, polynomials, tree as ex
from inverse_service.field import exact_field, matrices
from inverse_service.mechanics import euler_lagrange
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.search import reductions
from inverse_service.solving.closed_members import Solved
from inverse_service.solving.leaves import NotSplit, Unknowns


def where_it_fails(
    unknowns: Unknowns,
    system: SecondOrderSystem,
    lagrangian: ex.Expression,
    solved: Sequence[Solved],
    end: float,
) -> list[list[fmpq_mpoly]]:
    """Systems of equations of which one holds wherever L is no regular Lagrangian of its system.

    det g and the divisors of L vanish for all velocities and coordinates on which no unknown
    function depends. `solved` says what the new constants of the system are. Raises NotSplit where
    the factors of these hold functions of constants or of unknown functions that may be dependent;
    TooLarge or ZeroDivisionError as the ring does.
    """
    entries = euler_lagrange.hessian(lagrangian, system.coordinates)
    slopes = [
        slope
        for node in certify.walk_integrals(lagrangian)
        for slope in node.derivatives
        if slope is not None
    ]
    trees = [
        *(entry for row in entries for entry in row),
        *map(_without_integrals, [lagrangian, *slopes]),
    ]
    ring = exact_field.exact_ring(
        trees, system.variables, None, exact_field.Budget(20 * bounds.TERMS, end)
    )
    matrix = [[ring.value(entry) for entry in row] for row in entries]
    for tree in trees[-1 - len(slopes) :]:
        ring.value(tree)  # lists its denominators
    whole = matrices.determinant(matrix, ring.constant(1))
    reader = _Reader.of(unknowns, ring, solved)
    found = list[list[fmpq_mpoly]]()
    for divisor in (whole.numerator, *ring.field.denominators):
        for factor, _ in polynomials.factor_polynomial(divisor)[1]:
            parts = reader.parts(factor)
            if not any(not unknowns.unknowns_in(part) for part in parts):
                found.append(parts)
    return found


def _without_integrals(tree: ex.Expression) -> ex.Expression:
    """The tree with 1 in the place of functions known by their derivatives, which divide by what
    these divide by.
    """
    return ex.ONE if isinstance(tree, ex.Integral) else ex.rebuild(tree, _without_integrals)


@dataclass(frozen=True)
class _Reader:
    """The generators of a ring as those of the family: `moved` has those with a place there.

    `units` are functions of constants or of unknown functions, and vanish nowhere; `scales` are new
    constants, each 0 where a generator of the family is. Others with constants or coordinates of
    functions have no place.
    """

    unknowns: Unknowns
    ring: exact_field.ExactRing
    moved: dict[int, int]
    scales: dict[int, int]
    units: frozenset[int]
    strange: frozenset[int]
    fresh: frozenset[str]

    @classmethod
    def of(
        cls, unknowns: Unknowns, ring: exact_field.ExactRing, solved: Sequence[Solved]
    ) -> _Reader:
        letters = {name: index for index, name in unknowns.letters.items()}
        inner = {unknowns.ring.trees[index]: index for index in unknowns.inner}
        scaled = {one.scale[0]: one.scale[1] for one in solved if one.scale is not None}
        fresh = {name for one in solved for name in one.new_constants}
        moving = {one for of in unknowns.arguments.values() for one in of}
        moved, scales, units, strange = dict[int, int](), dict[int, int](), set[int](), set[int]()

        def place_of(tree: ex.Arbitrary) -> int | None:
            orders = dict(zip(tree.arguments, tree.orders, strict=True))
            whole = unknowns.arguments[tree.name]
            return unknowns.generators.get((tree.name, tuple(orders.get(one, 0) for one in whole)))

        for index, tree in ring.trees.items():
            names = {node.name for node in ex.walk(tree) if isinstance(node, ex.Symbol)}
            is_parametric = not moving.isdisjoint(ex.walk(tree)) or not names.isdisjoint(
                {*letters, *fresh}
            )
            place: int | None = None
            if isinstance(tree, ex.Symbol) and tree.name in letters:
                place = letters[tree.name]
            elif isinstance(tree, ex.Arbitrary) and tree.name in unknowns.arguments:
                place = place_of(tree)
            elif isinstance(tree, ex.Symbol) and tree.name in scaled:
                if (jet := place_of(scaled[tree.name])) is not None:
                    scales[index] = jet
                    continue
            else:
                place = inner.get(tree)
            if place is not None:
                moved[index] = place
            elif isinstance(tree, ex.Apply) and tree.function == "exp" and is_parametric:
                units.add(index)
            elif is_parametric:
                strange.add(index)
        return cls(
            unknowns, ring, moved, scales, frozenset(units), frozenset(strange), frozenset(fresh)
        )

    def is_unknown(self, index: int) -> bool:
        """Whether the generator holds a constant or function of the family."""
        names = {*self.unknowns.letters.values(), *self.fresh}
        nodes = ex.walk(self.ring.trees[index])
        return any(
            isinstance(node, ex.Arbitrary) or (isinstance(node, ex.Symbol) and node.name in names)
            for node in nodes
        )

    def parts(self, factor: fmpq_mpoly) -> list[fmpq_mpoly]:
        """The coefficients of an irreducible factor in the generators without a place, in the ring
        of the family.
        """
        used = [index for index, degree in enumerate(factor.degrees()) if degree]
        if len(factor) == 1 and used and used[0] in self.scales:
            return [self.unknowns.context.gen(self.scales[used[0]])]
        shapes = {tuple(int(exponents[k]) for k in self.units) for exponents, _ in factor.terms()}
        if len(shapes) > 1 and self.units.intersection(used):
            raise NotSplit("functions of constants in L may become dependent")
        if not any(k in self.scales or k in self.units or self.is_unknown(k) for k in used):
            return [self.unknowns.context.constant(1)]  # it holds no constant and no function
        if self.strange.intersection(used) or self.scales.keys() & {*used}:
            raise NotSplit("L holds what the conditions do not hold")
        outer = [index for index in self.ring.trees if index not in self.moved]
        found = exact_field.coefficients_of(factor, outer).values()
        return [_moved(self.unknowns, self.moved, part) for part in found]


def _moved(unknowns: Unknowns, moved: dict[int, int], polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """The polynomial in the ring of the family."""
    size, table = len(unknowns.context.gens()), dict[tuple[int, ...], object]()
    for exponents, value in polynomial.terms():
        key = [0] * size
        for index, exponent in enumerate(exponents):
            if exponent:
                key[moved[index]] = int(exponent)
        table[tuple(key)] = value
    found: fmpq_mpoly = unknowns.context.from_dict(table)
    return found


def has_one_everywhere(system: SecondOrderSystem) -> bool:
    """Whether a theorem gives an L(q, q') for all values of the parameters without exception.

    An equation for one coordinate has one. So does u'' = a u' + b u + c over any algebra R[M], with
    an L analytic in a, b, c, u, u': a nondegenerate linear form of it (R[M] has one) is a
    Lagrangian of the real system. Hence q'' = A q' + B q + c has one if A or B is a number times 1,
    so that both are polynomials in one real matrix, and for n = 2 if its algebraic conditions have
    a rank of at most one (docs/explanation/families.md).
    """
    blocks = () if system.depends_on_time else reductions.decoupled_blocks(system)
    return bool(blocks) and all(
        len(block.coordinates) == 1 or _is_over_an_algebra(block) for block in blocks
    )


def is_linear_pair(system: SecondOrderSystem) -> bool:
    """Whether this is q'' = A q' + B q + c for two coordinates with constant A, B, c."""
    return len(system.coordinates) == 2 and _constant_slopes(system) is not None


def _constant_slopes(system: SecondOrderSystem) -> Sequence[Sequence[ex.Expression]] | None:
    """df/dq and df/dq', side by side, if these are constants."""
    names: list[ex.Symbol | ex.Velocity] = [
        *map(ex.Symbol, system.coordinates),
        *map(ex.Velocity, system.coordinates),
    ]
    rows = [
        [collecting.collect(calculus.differentiate(f, name)) for name in names]
        for f in system.accelerations
    ]
    moving = any(
        node in names or node == ex.TIME or isinstance(node, ex.Arbitrary)
        for row in rows
        for entry in row
        for node in ex.walk(entry)
    )
    return None if moving or system.depends_on_time else rows


def _is_over_an_algebra(system: SecondOrderSystem) -> bool:
    rows, n = _constant_slopes(system), len(system.coordinates)
    if rows is None:
        return False
    stiffness, damping = [row[:n] for row in rows], [row[n:] for row in rows]
    if _is_scalar(damping) or _is_scalar(stiffness):
        return True
    if n != 2:
        return False
    # B + A^2/4 = -Phi, and its commutator with A, without multiples of 1.
    square, quarter = _product(damping, damping), ex.number(1) / ex.number(4)
    tensor = [[ex.add(stiffness[i][j], quarter * square[i][j]) for j in range(2)] for i in range(2)]
    left, right = _product(damping, tensor), _product(tensor, damping)
    turned = [[ex.subtract(left[i][j], right[i][j]) for j in range(2)] for i in range(2)]
    first, second = ((m[0][1], ex.subtract(m[0][0], m[1][1]), m[1][0]) for m in (tensor, turned))
    return all(
        collecting.collect(ex.subtract(first[i] * second[j], first[j] * second[i])) == ex.ZERO
        for i, j in itertools.combinations(range(3), 2)
    )


def _product(
    left: Sequence[Sequence[ex.Expression]], right: Sequence[Sequence[ex.Expression]]
) -> list[list[ex.Expression]]:
    span = range(len(left))
    return [[ex.add(*(left[i][k] * right[k][j] for k in span)) for j in span] for i in span]


def _is_scalar(matrix: Sequence[Sequence[ex.Expression]]) -> bool:
    """Whether the matrix is a number times the unit matrix."""
    entries = [(i, j, entry) for i, row in enumerate(matrix) for j, entry in enumerate(row)]
    return all((entry == matrix[0][0]) if i == j else entry == ex.ZERO for i, j, entry in entries)
