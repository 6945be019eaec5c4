"""The flow of H on the image of the constraints is the motion, for both signs of each velocity;
false claims fail.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import mpmath
import numpy as np
import pytest

import inverse_service
from inverse_service import errors
from inverse_service.constrained import hamiltonise as hm, lagrangian as on_constraints
from inverse_service.deadline import now
from inverse_service.expressions import calculus, tree as ex
from inverse_service.mechanics.constrained_motion import (
    EquationsOfMotion,
    equations_of_motion,
    read_nonholonomic,
)
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import declarations, names as nm, reader

NEAR = mpmath.mpf(10) ** -15
Numbers = Sequence[mpmath.mpf]


@dataclass(frozen=True)
class Case:
    """A motion with a Lagrangian of it; `velocities` and `accelerations` are of d'Alembert's
    principle, by hand.
    """

    names: tuple[str, ...]
    given: str
    constraints: tuple[str, ...]
    lagrangian: str
    velocities: Callable[[Numbers, Numbers], list[mpmath.mpf]]
    accelerations: Callable[[Numbers, Numbers], list[mpmath.mpf]]


def particle(q: Numbers, u: Numbers) -> list[mpmath.mpf]:
    x, (a, b) = q[0], u
    y_tt = -x * a * b / (1 + x**2)
    return [mpmath.mpf(0), y_tt, -a * b - x * y_tt]


def disk(q: Numbers, u: Numbers) -> list[mpmath.mpf]:
    c, s, (turn, roll) = mpmath.cos(q[0]), mpmath.sin(q[0]), u
    return [mpmath.mpf(0), -s / 2, -s * turn * roll - c * s / 2, c * turn * roll - s**2 / 2]


CASES = [
    Case(
        ("x", "y", "z"),
        "(x'^2+y'^2+z'^2)/2",
        ("z'+x*y'",),
        "sqrt(1+x^2)*y'^2/(2*x')+x'^2/2+(z'+x*y')^2/2",
        lambda q, u: [u[0], u[1], -q[0] * u[1]],
        particle,
    ),
    Case(
        ("phi", "x", "y"),
        "(x'^2+y'^2+phi'^2)/2",
        ("x'*sin(phi)-y'*cos(phi)",),
        "phi'^2/2+x'*y'/(cos(phi)*phi')-sin(phi)*x'^2/(2*cos(phi)^2*phi')",
        lambda q, u: [u[0], u[1] * mpmath.cos(q[0]), u[1] * mpmath.sin(q[0])],
        lambda q, u: [
            mpmath.mpf(0),
            -u[0] * u[1] * mpmath.sin(q[0]),
            u[0] * u[1] * mpmath.cos(q[0]),
        ],
    ),
    Case(
        ("phi", "theta", "x", "y"),
        "(x'^2+y'^2+phi'^2+theta'^2)/2-y",
        ("x'-cos(phi)*theta'", "y'-sin(phi)*theta'"),
        "cos(phi)/2+phi'*theta'+(x'-cos(phi)*theta')^2/2+(y'-sin(phi)*theta')^2/2",
        lambda q, u: [u[0], u[1], u[1] * mpmath.cos(q[0]), u[1] * mpmath.sin(q[0])],
        disk,
    ),
]
EACH = pytest.mark.parametrize("case", CASES, ids=("particle", "knife edge", "disk on an incline"))


def motion_of(case: Case) -> EquationsOfMotion:
    declared = declarations.Declared(list(case.names), (), {})
    return equations_of_motion(read_nonholonomic(declared, case.given, list(case.constraints), ""))


def system_of(case: Case) -> SecondOrderSystem:
    """The equations of the Lagrangian of a case."""
    tree = reader.read_formula(case.lagrangian, nm.Names(case.names, (), {}))
    system = on_constraints.own_system(tree, motion_of(case), now() + 60)
    assert system is not None
    return system


def hamiltonised(
    case: Case, images: Sequence[ex.Expression] = ()
) -> tuple[EquationsOfMotion, hm.Hamiltonisation]:
    motion, tree = (
        motion_of(case),
        reader.read_formula(case.lagrangian, nm.Names(case.names, (), {})),
    )
    return motion, hm.hamiltonise(motion, system_of(case), tree, known_images=images)


@EACH
def test_the_flow_of_h_is_the_motion_for_both_signs_of_the_velocities(case: Case) -> None:
    motion, found = hamiltonised(case)
    transform, free = found.transform, len(motion.free)
    assert found.holds
    assert transform is not None
    symbols = [*map(ex.Symbol, case.names), *transform.symbols]

    def energy(state: Sequence[mpmath.mpf]) -> mpmath.mpf:
        return calculus.evaluate(transform.hamiltonian, dict(zip(symbols, state, strict=True)))

    def momenta(q: Numbers, v: Numbers) -> list[mpmath.mpf]:
        state = dict(
            zip([*map(ex.Symbol, case.names), *map(ex.Velocity, case.names)], [*q, *v], strict=True)
        )
        return [calculus.evaluate(p, state) for p in transform.momenta]

    q = [mpmath.mpf(k) / 7 for k in (3, 5, 2, 4)][: len(case.names)]
    with mpmath.workdps(40):
        for signs in product((1, -1), repeat=free):
            u = [sign * mpmath.mpf(k) / 5 for sign, k in zip(signs, (4, 7), strict=True)]
            v, a = case.velocities(q, u), case.accelerations(q, u)

            def along(k: int, h: mpmath.mpf, v: Numbers = v, a: Numbers = a) -> mpmath.mpf:
                ahead = (
                    [x + h * y for x, y in zip(left, right, strict=True)]
                    for left, right in ((q, v), (v, a))
                )
                return momenta(*ahead)[k]

            start, n = [*q, *momenta(q, v)], len(q)
            rates = [mpmath.diff(lambda h, k=k: along(k, h), 0) for k in range(n)]

            def slope(k: int, start: Numbers = start) -> mpmath.mpf:
                return mpmath.diff(lambda x: energy([*start[:k], x, *start[k + 1 :]]), start[k])

            for k in range(n):
                assert abs(slope(n + k) - v[k]) < NEAR  # q' = dH/dp
                assert abs(slope(k) + rates[k]) < NEAR  # p' = -dH/dq


@EACH
def test_both_flows_run_together_and_h_and_the_constraints_are_kept(case: Case) -> None:
    compared = hamiltonised(case)[1].comparison
    assert compared is not None
    assert max(compared.difference, compared.constraint, compared.energy) < 1e-7


def test_constraints_in_phase_space_that_depend_on_each_other_are_not_the_image() -> None:
    images = hamiltonised(CASES[2])[1].images
    assert len(images) == 2
    _, found = hamiltonised(CASES[2], (images[0], images[0] * ex.number(2)))
    assert [s.verdict for s in found.statements if "independent" in s.text] == ["fails"]


def test_a_constraint_that_the_flow_leaves_is_refused() -> None:
    _, found = hamiltonised(CASES[2], tuple(map(ex.Symbol, ("p_x", "p_phi"))))
    assert not found.holds


def test_equations_of_another_motion_are_refused() -> None:
    """x'' = y'' = z'' = 0 with half the squares: L and H belong together, but the particle moves
    otherwise.
    """
    case = CASES[0]
    motion, names = motion_of(case), nm.Names(case.names, (), {})
    free = replace(system_of(case), accelerations=(ex.ZERO,) * 3)
    found = hm.hamiltonise(motion, free, reader.read_formula(case.given, names))
    assert {s.verdict for s in found.statements if "accelerations of the motion" in s.text} == {
        "fails"
    }
    assert not found.holds


def test_the_difference_of_two_flows_is_the_largest_over_positions_and_time() -> None:
    """x = t and x = (1 + 1/4) t, y = 0 in both: 0 at the start, 1/4 at the end of one second, 0 for
    y at any time.
    """
    x, y, p, r = (ex.Symbol(name) for name in ("x", "y", "p_x", "p_y"))
    u, w = ex.Velocity("x"), ex.Velocity("y")
    zero, quarter = ex.ZERO, ex.number(1) / ex.number(4)
    first = hm.Flow((x, y, u, w), (ex.number(1), zero, zero, zero))
    second = hm.Flow((x, y, p, r), (ex.number(1) + quarter, zero, zero, zero))
    found = hm.compare(first, second, [u, w], [p, r + x], [])
    assert found is not None
    assert np.isclose(found.difference, hm.STEPS * hm.STEP / 4)
    assert np.isclose(found.energy, 0)
    assert (
        found.constraint >= 1 + hm.STEPS * hm.STEP / 4
    )  # r + x is not kept, and is not 0 at the start
    drifting = hm.compare(first, second, [u, w], [x], [])  # "H" = x changes by (1 + 1/4) t
    assert drifting is not None
    assert np.isclose(drifting.energy, hm.STEPS * hm.STEP * 5 / 4)


@pytest.mark.parametrize(
    ("factor", "words"),
    [("1", "does not vanish"), ("sqrt(2 + sin(atan(x)/3))", "could not be shown to vanish")],
)
def test_only_multiples_that_are_shown_to_vanish_are_added(factor: str, words: str) -> None:
    document = {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
        "constraints": ["z' + x*y'"],
        "associated": "first",
        "multiples": {"x": "0", "y": f"{factor}*x'", "z": "0"},
    }
    with pytest.raises(errors.InputError, match=words) as refused:
        inverse_service.solve(document)
    assert refused.value.pointer == "/multiples/y"


def test_what_is_not_settled_is_not_said_to_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = equations_of_motion(
        read_nonholonomic(
            declarations.Declared(["x", "y"], (), {}), "(x'^2+y'^2)/2", ["y'-x*x'"], ""
        )
    )
    tree = ex.Velocity("x") ** 2 / 2 + ex.Velocity("y") ** 2 / 2
    own = on_constraints.own_system(tree, motion, now() + 60)
    assert own is not None
    monkeypatch.setattr(hm.real_branch, "vanish", lambda *_: None)
    found = hm.hamiltonise(motion, own, tree)
    assert {one.verdict for one in found.statements} == {"not settled"}
    assert not found.holds
