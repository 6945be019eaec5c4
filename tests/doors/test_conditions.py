"""The conditions of a result as they are printed."""

import inverse_service


def test_conditions_of_the_double_pendulum_keep_differences_of_angles() -> None:
    """Written in sin a, cos a, sin b and cos b they have three times the characters."""
    lines = (
        "(m1+m2)*l1*a'' + m2*l2*b''*cos(a-b) + m2*l2*b'^2*sin(a-b) + (m1+m2)*g*sin(a) = 0; "
        "l2*b'' + l1*a''*cos(a-b) - l1*a'^2*sin(a-b) + g*sin(b) = 0"
    )
    names = ["m1", "m2", "l1", "l2", "g"]
    result = inverse_service.solve({"coordinates": ["a", "b"], "equations": lines, "parameters": names})
    text = str(result["conditions"])
    assert "cos(a - b)" in text
    assert len(text) < 5000
