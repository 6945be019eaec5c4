"""The printed conditions of a result."""

import pytest

import inverse_service


def test_conditions_of_the_double_pendulum_keep_differences_of_angles() -> None:
    """In terms of sin a, cos a, sin b, and cos b they are three times as long."""
    lines = (
        "(m1+m2)*l1*a'' + m2*l2*b''*cos(a-b) + m2*l2*b'^2*sin(a-b) + (m1+m2)*g*sin(a) = 0; "
        "l2*b'' + l1*a''*cos(a-b) - l1*a'^2*sin(a-b) + g*sin(b) = 0"
    )
    names = ["m1", "m2", "l1", "l2", "g"]
    result = inverse_service.solve(
        {
            "coordinates": ["a", "b"],
            "equations": lines,
            "parameters": names,
            "first_integrals": False,
        }
    )
    text = str(result["conditions"])
    assert "cos(a - b)" in text
    assert len(text) < 5000


@pytest.mark.slow
def test_a_factor_that_is_not_elementary_is_given_by_its_slopes() -> None:
    """From L = e^u ((1 + y^2) x'^2/2 + y'^2/2 - 1) with du = e^(x y) (dx/x + dy/y): u is Ei(x
    y).
    """
    equations = {
        "x": "-(y^3 + y)*exp(x*y)*x'^2/(2*x*y*(y^2 + 1)) - (y*exp(x*y) + 2*y + exp(x*y)/y)*x'*y'/(y^2 + 1)"
        " + (y'^2 - 2)*exp(x*y)/(2*x*(y^2 + 1))",
        "y": "((y^2 + 1)*exp(x*y) + 2*y^2)*x'^2/(2*y) - exp(x*y)*x'*y'/x - (y'^2 + 2)*exp(x*y)/(2*y)",
    }
    result = inverse_service.solve({"coordinates": ["x", "y"], "equations": equations})
    (factor,) = result["integrals"].values()
    assert factor["derivatives"] == {"x": "exp(x*y)/x", "y": "exp(x*y)/y"}
    assert result.check()["verdict"] == "valid"


def test_an_angle_that_the_motion_does_not_hold_is_cyclic() -> None:
    lines = "r'' = r*phi'^2 + r*B(r)*phi'; phi'' = -2*r'*phi'/r - B(r)*r'/r"
    result = inverse_service.solve(
        {"coordinates": ["r", "phi"], "functions": {"B": ["r"]}, "equations": lines}
    )
    assert "F(r)*phi'" in result["lagrangian"]["text"]
