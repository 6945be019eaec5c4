"""X, N and Phi by compiled series give the very equations that sparse series give."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from inverse_service.decision import deciding
from inverse_service.decision.deciding import Decision, analyze, decide, equations, local_system
from inverse_service.decision.kinds import helmholtz
from inverse_service.expressions.tree import TIME, Symbol, Velocity
from inverse_service.field.exact_field import TooLarge
from inverse_service.field.modular import safe_prime
from inverse_service.field.point import Variable
from inverse_service.field.tower import draw_point
from inverse_service.linear_pde import equations as emission, involution as settling
from inverse_service.linear_pde.equations import Equations, rows_of_degree
from inverse_service.linear_pde.involution import Coefficients
from inverse_service.mechanics.reading import read_system
from inverse_service.mechanics.second_order_system import SecondOrderSystem

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
    return read_system(list(equations_of), {q: f"{q}''={f}" for q, f in equations_of.items()}, parameters, functions)


def both(system: SecondOrderSystem, with_time: bool, order: int) -> tuple[tuple[Equations, ...], ...]:
    """The equations by compiled and by sparse series, at the same point."""
    analysis = analyze(system)
    point = draw_point(analysis.tower, 3)
    velocities = [Velocity(name) for name in system.coordinates]
    variables: list[Variable] = [*[TIME] * with_time, *(Symbol(name) for name in system.coordinates), *velocities]
    forms = Coefficients(
        lambda most: helmholtz.written(variables, velocities, analysis.accelerations, most + 1), lambda _: point
    )
    prime, registers = forms.at(3, order)
    compiled = helmholtz.compiled_equations(len(velocities), len(variables), prime, order, registers)
    sparse = local_system(*analysis.series(point, with_time, order + 2))
    return compiled.equations, equations(sparse).equations


@pytest.mark.parametrize("room", [0, 1, 2])
def test_rows_that_find_no_room_are_written_into_more(room: int, monkeypatch: pytest.MonkeyPatch) -> None:
    found = both(system_of(*SYSTEMS[4][:2]), True, 3)[0][0]
    wanted = [rows_of_degree(found.table, degree, PRIME).struct for degree in range(3)]
    monkeypatch.setattr(emission, "_ENTRIES", room)
    for degree, rows in enumerate(wanted):
        again, count = rows_of_degree(found.table, degree, PRIME).struct, rows.starts[-1]
        assert count > room * len(rows.starts)
        assert again.starts.tolist() == rows.starts.tolist()
        assert again.columns[:count].tolist() == rows.columns[:count].tolist()
        assert again.values[:count].tolist() == rows.values[:count].tolist()


def entries(found: Equations, degree: int, prime: int, factor: int) -> list[dict[int, int]]:
    """The rows of one degree as {column: value}, each value times the factor."""
    rows = rows_of_degree(found.table, degree, prime).struct
    table = []
    for a, b in itertools.pairwise(rows.starts.tolist()):
        row: dict[int, int] = {}
        for c, x in zip(rows.columns[a:b].tolist(), rows.values[a:b].tolist(), strict=True):
            row[c] = (row.get(c, 0) + x * factor) % prime
        table.append({c: x for c, x in row.items() if x})
    return table


@pytest.mark.parametrize(("equations_of", "parameters", "with_time"), SYSTEMS)
def test_the_rows_are_those_of_sparse_series(
    equations_of: dict[str, str], parameters: list[str], with_time: bool
) -> None:
    system = system_of(equations_of, parameters)
    order, prime = 2, draw_point(analyze(system).tower, 3).prime
    for compiled, sparse in zip(*both(system, with_time, order), strict=True):
        assert (compiled.kind, compiled.indices) == (sparse.kind, sparse.indices)
        for degree in range(order + (compiled.kind == "H3")):
            found = entries(compiled, degree, prime, pow(1 << 64, -1, prime))
            assert found == entries(sparse, degree, prime, 1)
    assert any(len(found.table.series.struct.values) for found in both(system, with_time, order)[0])


def told(found: Decision) -> tuple[object, ...]:
    return found.verdict, found.order, found.history, found.degree, found.space, found.reason


@pytest.mark.parametrize(("equations_of", "parameters", "with_time"), SYSTEMS)
def test_decisions_do_not_depend_on_how_series_are_kept(
    equations_of: dict[str, str], parameters: list[str], with_time: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = system_of(equations_of, parameters)
    compiled = decide(system, with_time)

    def too_large(*_: object) -> None:
        raise TooLarge

    monkeypatch.setattr(deciding.helmholtz, "written", too_large)
    assert told(decide(system, with_time)) == told(compiled)
    assert compiled.verdict != "undetermined"


def test_a_denominator_that_vanishes_everywhere_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    system = system_of({"x": "y/(k-x)", "y": "x"}, ["k"])
    real = settling.constants_at

    def zeros(program: object, point: object) -> np.typing.NDArray[np.uint64]:
        return np.zeros_like(real(program, point))  # type: ignore[arg-type]

    monkeypatch.setattr(settling, "constants_at", zeros)
    found = decide(system, False)
    assert found.verdict == "undetermined"
    assert "denominator vanishes" in found.reason


@pytest.mark.parametrize(("equations_of", "parameters", "with_time"), SYSTEMS)
def test_a_program_is_written_anew_for_a_higher_order(
    equations_of: dict[str, str], parameters: list[str], with_time: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arbitrary functions are expanded to the order a program is written for, and no further."""
    system = system_of(equations_of, parameters)
    expected = decide(system, with_time)
    monkeypatch.setattr(settling, "SECOND_ORDER", 1)
    assert told(decide(system, with_time)) == told(expected)


def test_one_of_these_systems_needs_more_than_the_first_order_of_an_arbitrary_function() -> None:
    found = [decide(system_of(f, p), t) for f, p, t in SYSTEMS if any("A(" in one for one in f.values())]
    assert any(decision.order > 1 for decision in found)
