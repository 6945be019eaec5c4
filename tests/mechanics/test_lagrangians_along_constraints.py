"""Lagrangians in closed form of motions on constraints, whose Euler-Lagrange expressions vanish along
the motions that mechanics books have.
"""

from __future__ import annotations

import pytest
import sympy

from inverse_service import bounds
from inverse_service.constrained import lagrangian as on_constraints
from inverse_service.deadline import now
from inverse_service.expressions import printing
from inverse_service.mechanics.constrained_motion import (
    EquationsOfMotion,
    equations_of_motion,
    read_nonholonomic,
)
from inverse_service.reading import declarations
from inverse_service.statements.questions import PLAIN
from tests.values import present, slow

T = sympy.Symbol("t")


def motion_of(
    names: list[str], parameters: tuple[str, ...], lagrangian: str, constraint: str
) -> EquationsOfMotion:
    declared = declarations.Declared(names, parameters, {})
    return equations_of_motion(read_nonholonomic(declared, lagrangian, [constraint], ""))


def found_for(motion: EquationsOfMotion) -> str | None:
    found = on_constraints.find_lagrangians(motion, PLAIN, 1, now() + 60)
    return printing.to_text(found[0].expression) if found else None


def holds_along(
    text: str,
    point: dict[str, sympy.Expr],
    velocities: dict[str, sympy.Expr],
    accelerations: dict[str, sympy.Expr],
) -> bool:
    """Whether d/dt(dL/dv) = dL/dq at a point, and L is regular there."""
    names = list(velocities)
    rates = {name: sympy.Symbol(f"{name}_v") for name in names}
    for name in names:
        text = text.replace(f"{name}'", f"{name}_v")
    lagrangian = sympy.sympify(text.replace("^", "**"))
    here = {sympy.Symbol(name): value for name, value in point.items()}
    here |= {rates[name]: velocities[name] for name in names}
    momenta = [lagrangian.diff(rates[name]) for name in names]
    left = [
        sum(
            momentum.diff(sympy.Symbol(a)) * velocities[a]
            + momentum.diff(rates[a]) * accelerations[a]
            for a in names
        )
        - lagrangian.diff(sympy.Symbol(name))
        for name, momentum in zip(names, momenta, strict=True)
    ]
    hessian = sympy.Matrix([[p.diff(rates[a]) for a in names] for p in momenta])
    small = [abs(sympy.N(each.subs(here), 60)) < sympy.Float(10) ** -40 for each in left]
    return all(small) and abs(sympy.N(hessian.subs(here).det(), 60)) > sympy.Float(10) ** -6


@pytest.mark.slow
def test_a_body_that_cannot_turn_about_its_first_axis() -> None:
    """Suslov's problem with omega_1 = 0: omega_2 and omega_3 are constant (Bloch 2003, 8.6).

    The equations divide by sines alone.
    """
    motion = motion_of(
        ["phi", "theta", "psi"],
        ("A", "B", "C"),
        "(A*(phi'*sin(theta)*sin(psi)+theta'*cos(psi))^2+B*(phi'*sin(theta)*cos(psi)"
        "-theta'*sin(psi))^2+C*(phi'*cos(theta)+psi')^2)/2",
        "phi'*sin(theta)*sin(psi)+theta'*cos(psi)",
    )
    theta, psi = (sympy.Function(name)(T) for name in ("theta", "psi"))
    omega = sympy.Matrix(
        [
            [sympy.sin(theta) * sympy.sin(psi), sympy.cos(psi), 0],
            [sympy.sin(theta) * sympy.cos(psi), -sympy.sin(psi), 0],
            [sympy.cos(theta), 0, 1],
        ]
    )
    place = {
        "phi": sympy.Rational(1, 3),
        "theta": sympy.Rational(4, 5),
        "psi": sympy.Rational(6, 5),
    }
    at = {theta: place["theta"], psi: place["psi"]}
    speeds = omega.subs(at).solve(sympy.Matrix([0, 2, sympy.Rational(3, 7)]))
    turning = omega.diff(T).subs({theta.diff(T): speeds[1], psi.diff(T): speeds[2]}).subs(at)
    bends = omega.subs(at).solve(-turning * speeds)
    text = present(found_for(motion))
    named = [dict(zip(("phi", "theta", "psi"), each, strict=True)) for each in (speeds, bends)]
    assert holds_along(text, place, *named)


def test_a_blade_on_a_slope_whose_force_is_along_a_dependent_coordinate() -> None:
    """th' = s cos(ph), z' = s sin(ph) with s' = -g sin(ph) and constant ph' (Neimark and Fufaev 1972).

    With th and ph as free coordinates the terms would divide by sin(ph), which f does not.
    """
    motion = motion_of(
        ["th", "z", "ph"], ("g",), "(th'^2+z'^2+ph'^2)/2-g*z", "sin(ph)*th'-cos(ph)*z'"
    )
    assert motion.dependent == ("z",)
    (other,) = on_constraints.with_forces_free(motion)
    assert other.dependent == ("th",)
    s, w, g, ph = (
        sympy.Rational(3, 2),
        sympy.Rational(5, 7),
        sympy.Rational(2),
        sympy.Rational(4, 5),
    )
    sine, cosine = sympy.sin(ph), sympy.cos(ph)
    place = {"th": sympy.Rational(1, 5), "z": sympy.Rational(2, 3), "ph": ph, "g": g}
    velocities = {"th": s * cosine, "z": s * sine, "ph": w}
    accelerations = {
        "th": -g * sine * cosine - s * w * sine,
        "z": -g * sine * sine + s * w * cosine,
        "ph": sympy.Integer(0),
    }
    assert holds_along(present(found_for(other)), place, velocities, accelerations)


def test_no_other_coordinates_are_tried_without_a_force_along_a_dependent_one() -> None:
    motion = motion_of(["x", "y", "z"], (), "(x'^2+y'^2+z'^2)/2-x", "z'-y*x'")
    assert list(on_constraints.with_forces_free(motion)) == []


@pytest.mark.parametrize("bound", [1, slow(3), 10])
def test_a_motion_that_is_too_long_to_expand_has_no_proposal(
    bound: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit of the search is no fault of the question."""
    motion = motion_of(["x", "y", "z"], (), "(x'^2 + y'^2 + z'^2)/2 - x - x^2 - x^3", "z' + x*y'")
    monkeypatch.setattr(bounds, "EXPANSION", bound)
    assert on_constraints.find_lagrangians(motion, PLAIN, 1, now() + 60) == []
