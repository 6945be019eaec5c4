"""What is drawn of an observed quantity on a logarithmic axis."""

from __future__ import annotations

from inverse_service.web.pages.figures import series


def method(**columns: list[float | None]) -> dict[str, object]:
    return {"energy_start": 2.0, "points": {"columns": columns}}


def test_the_rounding_of_the_start_is_left_out_and_nothing_else() -> None:
    assert series("error", method(error=[0.0, 1e-16, 1e-16, 1e-3])) == [None, None, 1e-16, 1e-3]
    assert series("error", method(error=[1e-5, 1e-4])) == [1e-5, 1e-4]
    assert series("error", method(error=[])) == []


def test_the_energy_error_is_relative_to_the_start() -> None:
    assert series("energy", method(energy=[2.0, 2.5, None, 1.0])) == [None, 0.25, None, 0.5]


def test_the_worst_constraint_counts() -> None:
    found = series("constraints", method(constraint_1=[0.1, -0.3, None], constraint_2=[-0.2, 0.1, None]))
    assert found == [0.2, 0.3, None]
