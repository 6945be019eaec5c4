"""X, N and Phi by compiled series: room for rows, singular points, and programs for higher
orders.
"""

from __future__ import annotations

import numpy as np
import pytest

from inverse_service.decision.deciding import Decision, HelmholtzAt, analyze, decide
from inverse_service.field.modular import safe_prime
from inverse_service.linear_pde import equations as emission, involution as settling
from inverse_service.linear_pde.equations import rows_of_degree
from inverse_service.mechanics.second_order_system import SecondOrderSystem, read_system
from inverse_service.statements.questions import PLAIN, TIMED, narrowest
from inverse_service.statements.reasons import Reason

PRIME = safe_prime(5)
SYSTEMS: list[tuple[dict[str, str], list[str], bool]] = [
    ({"x": "-x"}, [], False),
    ({"x": "0"}, [], True),
    ({"x": "-k*x*t-x'^2/x"}, ["k"], True),
    ({"x": "y*x'^2-x", "y": "x*y'+x^2"}, [], False),
    ({"x": "exp(y*x')*sin(x)", "y": "sqrt(x^2+y^2)*y'"}, [], True),
    ({"x": "A(x)*y'*z'", "y": "-x'*log(y)", "z": "atan(y)*z'^3/(1+x)"}, [], False),
    ({"x": "A(x)-y", "y": "-x-y"}, [], False),
    ({"x": "-2*x+y", "y": "x-2*y+z", "z": "y-2*z+w", "w": "z-2*w+x'*y'"}, [], False),
]


def system_of(equations_of: dict[str, str], parameters: list[str]) -> SecondOrderSystem:
    functions = {"A": ["x"]} if any("A(" in f for f in equations_of.values()) else None
    return read_system(
        list(equations_of),
        {q: f"{q}''={f}" for q, f in equations_of.items()},
        parameters,
        functions,
    )


@pytest.mark.parametrize("room", [0, 1, 2])
def test_rows_that_find_no_room_are_written_into_more(
    room: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = HelmholtzAt(analyze(system_of(*SYSTEMS[4][:2])), TIMED).at(3, 3).equations[0]
    wanted = [rows_of_degree(found.table, degree, PRIME).struct for degree in range(3)]
    monkeypatch.setattr(emission, "ENTRIES", room)
    for degree, rows in enumerate(wanted):
        again, count = rows_of_degree(found.table, degree, PRIME).struct, rows.starts[-1]
        assert count > room * len(rows.starts)
        assert again.starts.tolist() == rows.starts.tolist()
        assert again.columns[:count].tolist() == rows.columns[:count].tolist()
        assert again.values[:count].tolist() == rows.values[:count].tolist()


def told(found: Decision) -> tuple[object, ...]:
    return found.verdict, found.order, found.history, found.degree, found.space, found.open


def test_a_denominator_that_vanishes_everywhere_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    system = system_of({"x": "y/(k-x)", "y": "x"}, ["k"])
    real = settling.constants_at

    def zeros(program: object, point: object) -> np.typing.NDArray[np.uint64]:
        return np.zeros_like(real(program, point))  # type: ignore[arg-type]

    monkeypatch.setattr(settling, "constants_at", zeros)
    found = decide(system, PLAIN)
    assert found.verdict == "undetermined"
    assert found.open is not None
    assert found.open.reason is Reason.IRREDUCIBLE
    assert "denominator vanishes" in found.open.words


@pytest.mark.parametrize(("equations_of", "parameters", "with_time"), SYSTEMS)
def test_a_program_is_rewritten_for_a_higher_order(
    equations_of: dict[str, str],
    parameters: list[str],
    with_time: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Arbitrary functions are expanded only to the order of the program."""
    system = system_of(equations_of, parameters)
    expected = decide(system, narrowest(with_time))
    monkeypatch.setattr(settling, "SECOND_ORDER", 1)
    assert told(decide(system, narrowest(with_time))) == told(expected)


def test_one_of_these_systems_needs_more_than_the_first_order_of_an_arbitrary_function() -> None:
    found = [
        decide(system_of(f, p), narrowest(t))
        for f, p, t in SYSTEMS
        if any("A(" in one for one in f.values())
    ]
    assert any(decision.order > 1 for decision in found)
