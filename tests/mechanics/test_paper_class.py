"""Which motions are of the class with constraints s' = -A(r1) r2', and which associated systems they
have.

The conditions are those of the definitions: constant masses without mixed terms, no terms linear in
the velocities, constraints without a velocity-free term, and A a function of r1 alone. In the second
system r2' becomes -s'/A, which is the same on the constraints only if s' has no other term.
"""

from __future__ import annotations

import pytest

from inverse_service.constrained import nonholonomic_study
from inverse_service.mechanics import paper_class
from inverse_service.mechanics.constrained_motion import read_nonholonomic
from inverse_service.reading import declarations
from inverse_service.service.documents import nonholonomic_documents

FREE = "(x'^2 + y'^2 + z'^2)/2"


def report(lagrangian: str, *constraints: str) -> nonholonomic_study.MotionReport:
    names = [name for name in "xyzuvw" if f"{name}'" in lagrangian]
    declared = declarations.Declared(names, (), {})
    return nonholonomic_study.motion_report(
        read_nonholonomic(declared, lagrangian, list(constraints), "")
    )


def defined(found: nonholonomic_study.MotionReport, kind: paper_class.Kind) -> bool:
    (only,) = nonholonomic_study.associated_systems(found, kind)
    return only.system is not None


def test_the_vertical_disk_is_of_the_class() -> None:
    assert report(FREE, "z' + x*y' = 0").member is not None


@pytest.mark.parametrize("term", ["y*x'", "x*y'", "y*z'", "sin(z)*x'"])
def test_a_term_linear_in_any_velocity_is_outside(term: str) -> None:
    found = report(f"{FREE} + {term}", "z' + x*y' = 0")
    assert found.member is None
    assert "linear" in found.reason


@pytest.mark.parametrize("slope", ["t", "t*x", "x*y", "y + z", "x*z"])
def test_slopes_of_the_constraints_depend_on_one_coordinate_alone(slope: str) -> None:
    assert report(FREE, f"z' + ({slope})*y' = 0").member is None


def test_a_constraint_with_a_drift_has_no_second_system() -> None:
    assert defined(report(FREE, "z' + x*y' = 0"), "second")
    assert not defined(report(FREE, "z' + x*y' = x"), "second")
    assert not defined(report(FREE, "z' + x*y' + x*x' = 0"), "second")


def test_three_velocities_turn_only_with_positive_masses() -> None:
    constraints = "z' + x*y' = 0", "u' + x^2*y' = 0"
    assert defined(report(f"{FREE} + u'^2/2", *constraints), "third")
    assert not defined(report(f"{FREE} - u'^2/2", *constraints), "third")
    assert not defined(report("(x'^2 - y'^2 + z'^2 + u'^2)/2", *constraints), "third")


def test_the_slope_of_a_constraint_of_the_class_is_shown() -> None:
    """z' = -A(x) y' with A = x, and N = 1/sqrt(1 + x^2)."""
    shown = nonholonomic_documents._class(report(FREE, "z' + x*y' = 0"))
    assert shown.A is not None
    assert {name: part.text for name, part in shown.A.items()} == {"z": "x"}
