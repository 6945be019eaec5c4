"""What the generator promises, checked on the texts that it hands out, by the project's own reader."""

from __future__ import annotations

import dataclasses
import random
from collections import Counter
from functools import lru_cache

import mpmath
import pytest
import sympy

from inverse_service.expressions.evaluation import NoRealValue, evaluate
from inverse_service.expressions.tree import TIME, Expression, Symbol, Velocity, walk
from inverse_service.mechanics.reading import read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from tests.generator import GeneratedSystem, disguised, random_right_sides, random_system, random_systems
from tests.generator.euler_lagrange import accelerations, residual
from tests.generator.families import FAMILIES
from tests.generator.ingredients import space
from tests.generator.inverse import inverse

Point = dict[Expression, mpmath.mpf]
STEP = mpmath.mpf(10) ** -12
COUNT, SEED = 64, 3
X, Y = sympy.symbols("x y")
V, W = sympy.Symbol("x'"), sympy.Symbol("y'")


@lru_cache(maxsize=COUNT)
def made(index: int) -> GeneratedSystem:
    """Made when a test asks: at the collection of tests they would cost every process 10 s."""
    return random_system(index, SEED)


def every() -> list[GeneratedSystem]:
    return [made(index) for index in range(COUNT)]


def named(index: int) -> str:
    """Its family and number of coordinates, by which they are made in turn."""
    return f"{list(FAMILIES)[index % len(FAMILIES)]}-{index}"


def residual_of_texts(system: GeneratedSystem) -> mpmath.mpf:
    """The Euler-Lagrange residual by central differences of the texts alone, at the first real point."""
    for seed in range(200):
        try:
            return _residual_at(system, random.Random(seed))
        except NoRealValue:
            continue  # a logarithm or root of a negative number: a disguise may move the domain
    raise AssertionError(f"{system.id} is real nowhere")


def _residual_at(system: GeneratedSystem, rng: random.Random) -> mpmath.mpf:
    f = read_system(system.coordinates, system.equations, name=system.id).accelerations
    lagrangian = read_formula(system.lagrangian, Names(system.coordinates))
    atoms: list[Expression] = [TIME, *map(Symbol, system.coordinates), *map(Velocity, system.coordinates)]
    point = {atom: mpmath.mpf(rng.uniform(0.1, 0.4)) * rng.choice((1, 1, -1)) for atom in atoms}
    a = [evaluate(expression, point) for expression in f]
    return max(_defect(lagrangian, system.coordinates, name, point, a) for name in system.coordinates)


def _slope(expression: Expression, atom: Expression, point: Point) -> mpmath.mpf:
    up, down = ({**point, atom: point[atom] + sign * STEP} for sign in (1, -1))
    return (evaluate(expression, up) - evaluate(expression, down)) / (2 * STEP)


def _defect(lagrangian: Expression, names: tuple[str, ...], name: str, point: Point, a: list[mpmath.mpf]) -> mpmath.mpf:
    """|d/dt dL/dv - dL/dq| of one coordinate, relative to its terms."""
    after, before = (_slope(lagrangian, Velocity(name), _moved(names, point, a, sign)) for sign in (1, -1))
    along, force = (after - before) / (2 * STEP), _slope(lagrangian, Symbol(name), point)
    return abs(along - force) / (1 + abs(along) + abs(force))


def _moved(names: tuple[str, ...], point: Point, a: list[mpmath.mpf], sign: int) -> Point:
    """A step along the motion, forward or back."""
    shifted: Point = {TIME: point[TIME] + sign * STEP}
    for name, acceleration in zip(names, a, strict=True):
        q, v = point[Symbol(name)], point[Velocity(name)]
        shifted[Symbol(name)], shifted[Velocity(name)] = q + sign * STEP * v, v + sign * STEP * acceleration
    return shifted


@pytest.mark.slow
@pytest.mark.parametrize("index", range(COUNT), ids=named)
def test_texts_satisfy_the_euler_lagrange_equations(index: int) -> None:
    with mpmath.workdps(60):
        assert residual_of_texts(made(index)) < 1e-15


def test_a_wrong_right_side_does_not_satisfy_them() -> None:
    system = made(8)
    name = system.coordinates[0]
    wrong = {**system.equations, name: f"{system.equations[name]} + {name}'"}
    altered = dataclasses.replace(system, equations=wrong)
    with mpmath.workdps(60):
        assert residual_of_texts(altered) > 1e-3


@pytest.mark.slow
def test_every_family_comes_with_every_dimension() -> None:
    seen = Counter((system.family, system.n) for system in every())
    assert set(seen) == {(family, n) for family in FAMILIES for n in (1, 2, 3, 4)}
    assert len({system.id for system in every()}) == COUNT


@pytest.mark.slow
def test_some_but_not_most_lagrangians_contain_time() -> None:
    timed = [system for system in every() if system.time_dependent]
    assert 0 < len(timed) < COUNT // 2
    assert all(TIME in _symbols(system) for system in timed)


def _symbols(system: GeneratedSystem) -> set[Expression]:
    return set(walk(read_formula(system.lagrangian, Names(system.coordinates))))


def test_same_seed_gives_the_same_systems() -> None:
    again = random_systems(8, SEED)
    assert [system.equations for system in again] == [made(index).equations for index in range(8)]
    assert [system.equations for system in random_systems(8, SEED + 1)] != [s.equations for s in again]


@pytest.mark.slow
@pytest.mark.parametrize("index", range(8, 24), ids=named)
def test_a_disguise_keeps_the_lagrangian(index: int) -> None:
    with mpmath.workdps(60):
        assert residual_of_texts(disguised(made(index), 2)) < 1e-15


@pytest.mark.slow
def test_random_right_sides_are_read_and_repeatable() -> None:
    systems = random_right_sides(45, seed=1)
    assert {(system.kind, system.n) for system in systems} == {
        (kind, n) for kind in ("polynomial", "rational", "trigonometric") for n in (2, 3, 4)
    }
    for system in systems:
        read_system(system.coordinates, system.equations)
    assert systems == random_right_sides(45, seed=1)


def test_a_singular_lagrangian_is_refused() -> None:
    with pytest.raises(ValueError, match="singular"):
        accelerations((V + W) ** 2 / 2 - X * Y, space("xy"))
    with pytest.raises(ValueError, match="singular"):
        accelerations(V * Y, space("xy"))


def test_residual_sees_a_wrong_acceleration() -> None:
    lagrangian = V**2 / 2 - X**2 / 2
    good, _ = residual(lagrangian, [-X], space("x"), 1)
    wrong, determinant = residual(lagrangian, [-X + sympy.Rational(1, 10**20)], space("x"), 1)
    assert good == 0
    assert 1e-22 < wrong < 1e-19
    assert determinant == 1


def test_inverse_where_the_characteristic_polynomial_has_gaps() -> None:
    matrix = sympy.exp(-X) * sympy.Matrix([[-1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 2]])
    assert (matrix * inverse(matrix)).applyfunc(sympy.expand) == sympy.eye(4)
    assert inverse(sympy.Matrix([[X]])) == sympy.Matrix([[1 / X]])


def test_inverse_with_roots_and_exponentials_is_exact() -> None:
    root = sympy.sqrt(1 - V**2 - W**2)
    matrix = sympy.Matrix(
        [[sympy.exp(X) / root, V * W / root**3], [V * W / root**3, sympy.exp(-X / 2) + W**2 / root**3]]
    )
    product = matrix * inverse(matrix) - sympy.eye(2)
    point = {X: sympy.Rational(1, 3), V: sympy.Rational(1, 5), W: sympy.Rational(2, 7)}
    assert max(abs(entry.subs(point).evalf(50)) for entry in product) < 1e-40
