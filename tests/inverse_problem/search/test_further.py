"""What else there is beside an L that is known: functions of energies, other constant matrices."""

from __future__ import annotations

import pytest

from inverse_service.expressions.collecting import collect
from inverse_service.expressions.printing import to_text
from inverse_service.expressions.tree import ZERO, subtract
from inverse_service.inverse_problem.confirming import OF_ENERGIES
from inverse_service.inverse_problem.search.further import with_squared_energies
from inverse_service.inverse_problem.solutions import SolveOptions
from inverse_service.inverse_problem.solving import AS_GIVEN, solve
from inverse_service.mechanics.reading import read_given, read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

# Currie and Saletan, J. Math. Phys. 7 (1966); Hojman and Harleston, J. Math. Phys. 22 (1981).
SQUARED = [
    (["x"], "m*x'^2/2 - V(x)", "m^2*x'^4/12 + m*V(x)*x'^2 - V(x)^2"),
    (["x"], "A(x)*x'^2/2", "A(x)^2*x'^4/12"),
    (["x", "y"], "x'^2/2 - x^2/2 + y'^2/2", "x'^4/12 + x^2*x'^2/2 - x^4/4 + y'^4/12"),
    (["x", "y", "z"], "x'^2/2 + z*y' + z'^2/2 - y^2", "x'^4/12 + z*y' + z'^2/2 - y^2"),
]


@pytest.mark.parametrize(("names", "known", "wanted"), SQUARED, ids=[known for _, known, _ in SQUARED])
def test_the_square_of_an_energy_is_the_energy_of_another_lagrangian(names: list[str], known: str, wanted: str) -> None:
    declared = Names(tuple(names), ("m",), {"V": ("x",), "A": ("x",)})
    found = with_squared_energies(parse(known, declared), names)
    assert found is not None
    assert collect(subtract(found, parse(wanted, declared))) == ZERO, to_text(found)


@pytest.mark.parametrize("known", ["exp(t)*(x'^2 - x^2)/2", "x'*y' - x*y", "log(x')*x' - x"])
def test_no_energy_is_squared_where_there_is_none_or_its_integral_is_a_logarithm(known: str) -> None:
    assert with_squared_energies(parse(known, Names(("x", "y"), (), {})), ["x", "y"]) is None


def _others(equations: list[str], parameters: list[str]) -> tuple[str, list[str], str]:
    system, given = read_system(None, equations, parameters), read_given(None, equations, parameters)
    answer = solve(system, SolveOptions(given=given.residuals)).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    how = " ".join(step.text for step in answer.explanation)
    return (
        to_text(answer.lagrangian.expression),
        [to_text(one.expression) for one in answer.other_lagrangians],
        how,
    )


def test_an_answer_as_given_shows_how_free_it_is() -> None:
    own, others, how = _others(["m*x'' = -k*x"], ["m", "k"])
    assert own == "m*x'^2/2 - k*x^2/2"
    assert others == ["m^2*x'^4/12 + k*m*x^2*x'^2/2 - k^2*x^4/4"]
    assert "with every function" in how


def test_coupled_oscillators_have_another_constant_multiplier() -> None:
    own, others, how = _others(["x'' = -2*x + y", "y'' = x - 2*y"], [])
    assert own == "x'^2/2 + y'^2/2 - x^2 - y^2 + x*y"
    assert others == ["x'*y' + x^2/2 + y^2/2 - 2*x*y"]
    assert "with every function" not in how


def test_a_rigid_multiplier_has_nothing_beside_it() -> None:
    _, others, _ = _others(["x'' = -x/(x^2+y^2)^(3/2)", "y'' = -y/(x^2+y^2)^(3/2)"], [])
    assert others == []


def test_multiples_of_what_is_shown_are_not_shown_again() -> None:
    equations = ["x'' = -exp(y^2)*sin(x)/(3*y'^2)", "y'' = (3*x'*y'^3*y + 2*exp(y^2)*sin(x))/(3*x'*y')"]
    _, others, _ = _others(equations, [])
    assert others == []


def test_each_of_the_other_lagrangians_says_where_it_comes_from() -> None:
    system = read_system(["x", "y"], {"x": "-x", "y": "-4*y"})
    answer = solve(system, SolveOptions()).autonomous
    assert answer is not None
    assert answer.lagrangian is not None
    assert answer.lagrangian.family == AS_GIVEN
    assert answer.other_lagrangians
    assert AS_GIVEN not in {other.family for other in answer.other_lagrangians}
    assert answer.other_lagrangians[-1].family == OF_ENERGIES
