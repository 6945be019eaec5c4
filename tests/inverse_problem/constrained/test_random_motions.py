"""Motions that a regular Lagrangian is known to have are found hamiltonisable; random ones are decided as well."""

from __future__ import annotations

import random

import pytest

from inverse_service.algebra.tower import draw_point
from inverse_service.certificate.checker import check_certificate
from inverse_service.expressions.tree import Expression, Symbol, Velocity, add, multiply, substitute
from inverse_service.inverse_problem.constrained import motion_certificate
from inverse_service.inverse_problem.constrained.existence import analyze_motion, decide_motion, last_bracket
from inverse_service.inverse_problem.constrained.lagrangian import own_system
from inverse_service.linear_pde.involutive_form import Finding
from inverse_service.mechanics.nonholonomic.motion import ConstrainedMotion
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula
from tests.inverse_problem.constrained.motions import given

NAMES = ("x", "y", "z")


def decided(motion: ConstrainedMotion, with_time: bool = False) -> Finding:
    return decide_motion(analyze_motion(motion), with_time, 1, float("inf"), lambda _: None)


def tree(text: str) -> Expression:
    return read_formula(text, Names(NAMES, (), {}))


def of_a_lagrangian(seed: int) -> ConstrainedMotion:
    """z' = (c - b u)/h, the level of a momentum p_z = b u + h z' of a random regular L, in other coordinates.

    The new coordinates z + a x y, y + e x^2 in L hide that z is cyclic. The Lagrangian is then forgotten.
    """
    generator = random.Random(seed)
    a, b, c, d, e, f = (generator.randint(1, 5) for _ in range(6))
    level, force = generator.choice([0, 1, 3]), generator.choice(["0", "x", "y", "x*y", "x^2+y^3"])
    plain = tree(f"x'^2/2+{a}*y'^2+{b}*x*x'*z'+{c}*y*y'*z'+(1+{d}*x^2)*z'^2/2-{force}")
    # z = z + e x y, y = y + f x^2
    inner = {"z": f"z+{e}*x*y", "y": f"y+{f}*x^2"}
    rates = {"z": f"z'+{e}*x'*y+{e}*x*y'", "y": f"y'+2*{f}*x*x'"}
    table: dict[Expression, Expression] = {Symbol(n): tree(text) for n, text in inner.items()}
    table |= {Velocity(n): tree(text) for n, text in rates.items()}
    lagrangian = substitute(plain, table)
    system = own_system(lagrangian, ConstrainedMotion(NAMES, NAMES, (), (), ()), float("inf"))
    assert system is not None
    # p_z = level, solved for z' in the first coordinates, and z' = rate - e (x y)' in the new ones
    old = f"({level}-{b}*x*x'-{c}*(y+{f}*x^2)*(y'+2*{f}*x*x'))/(1+{d}*x^2)"
    w = add(tree(old), multiply(tree(f"-{e}"), tree("x'*y+x*y'")))
    on = {Velocity("z"): w}
    forces = tuple(substitute(acceleration, on) for acceleration in system.accelerations[:2])
    return ConstrainedMotion(NAMES, ("x", "y"), ("z",), (w,), forces)


def random_motion(seed: int, names: tuple[str, ...] = NAMES) -> ConstrainedMotion:
    """Two free velocities, the others linear in them, forces quadratic."""
    generator = random.Random(seed)

    def polynomial(degree: int) -> str:
        terms = []
        for _ in range(generator.randint(1, 3)):
            velocities = generator.choices(["x'", "y'"], k=degree)
            terms.append("*".join([str(generator.randint(-4, 4) or 1), generator.choice([*names, "1"]), *velocities]))
        return "+".join(terms).replace("+-", "-")

    free = {"x": polynomial(2), "y": polynomial(generator.choice([0, 2]))}
    return given(free, {name: polynomial(1) for name in names[2:]})


MANY = pytest.param(range(10, 200), marks=pytest.mark.nightly)


@pytest.mark.parametrize("seeds", [range(10), MANY])
def test_a_motion_on_a_level_of_a_momentum_of_a_regular_lagrangian_is_hamiltonisable(seeds: range) -> None:
    for seed in seeds:
        assert decided(of_a_lagrangian(seed)).exists, seed


@pytest.mark.parametrize("seeds", [range(10), MANY])
def test_random_motions_with_five_coordinates_are_never_left_open(seeds: range) -> None:
    found = [decided(random_motion(seed)) for seed in seeds]
    assert all(one.exists is not None for one in found)
    assert sum(one.exists is False for one in found) >= len(found) // 4


@pytest.mark.parametrize("seeds", [range(6), pytest.param(range(6, 200), marks=pytest.mark.nightly)])
def test_random_motions_with_six_coordinates_are_never_left_open(seeds: range) -> None:
    refused = 0
    for seed in seeds:
        analyzed = analyze_motion(random_motion(seed, (*NAMES, "w")))
        found = decide_motion(analyzed, False, 1, float("inf"), lambda _: None)
        assert found.exists is not None, seed
        if found.exists is False:
            refused += 1
            assert (
                check_certificate(motion_certificate.of_finding(analyzed, found, False), seed=1).verdict == "valid"
            ), seed
    assert refused > len(seeds) // 3


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 200), marks=pytest.mark.nightly)])
def test_each_no_of_a_random_motion_is_confirmed_by_the_checker(seeds: range) -> None:
    for seed in seeds:
        analyzed = analyze_motion(random_motion(seed))
        found = decide_motion(analyzed, False, 1, float("inf"), lambda _: None)
        if found.exists is False:
            assert (
                check_certificate(motion_certificate.of_finding(analyzed, found, False), seed=1).verdict == "valid"
            ), seed


@pytest.mark.parametrize("seeds", [range(10), MANY])
def test_brackets_along_one_solution_refuse_only_what_prolongation_refuses(seeds: range) -> None:
    """And a good part of that: with five coordinates prolongation is as fast, and is not asked to wait for them."""
    refused = []
    for seed in seeds:
        analyzed = analyze_motion(random_motion(seed))
        by_brackets = last_bracket(analyzed, draw_point(analyzed.tower, seed), float("inf")) is not None
        assert not (by_brackets and decided(random_motion(seed)).exists), seed
        refused.append(by_brackets)
    assert any(refused)


def test_no_motion_on_a_level_of_a_momentum_is_refused_by_brackets() -> None:
    for seed in range(5):
        analyzed = analyze_motion(of_a_lagrangian(seed))
        assert last_bracket(analyzed, draw_point(analyzed.tower, seed), float("inf")) is None, seed
