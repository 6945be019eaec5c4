"""Systems of the literature: their verdicts hold by themselves, and the solver agrees.

The first half does not use the package at all: Lagrangians are put into the Euler-Lagrange equations by
SymPy, nonexistence follows from conditions that are formed and evaluated anew.
"""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service import check, solve
from tests.systems.prolonged import is_excluded
from tests.systems.reading import Known, formulas, known_systems
from tests.systems.second_opinion import algebraic_conditions, is_lagrangian

SYSTEMS = {known.id: known for known in known_systems()}
VERDICTS = ("variational", "not_variational")
PROOFS = {
    "variational": {"lagrangian", "one coordinate", "argument"},
    "not_variational": {"algebraic", "prolonged", "argument"},
}
SAMPLE = (
    *("lienard-isochronous", "poisson-boltzmann", "legendre", "child-langmuir", "cubic-drag-only", "catenary"),
    *("kepler-linear-drag", "angle-force-and-central", "suslov", "resonant-triad", "case-iia2-driven-by-x"),
    *("bateman-van-der-pol", "kuramoto-inertia-two", "drag-ratio-coupled-potential", "coupled-mathieu-unsymmetric"),
    *("monopole", "lie-a4-11-a1", "latitude-sphere-wrong", "unequal-drag-linear", "latex-coupled", "odd-chain-five"),
)
# Closed forms that a textbook knows, with a positive definite kinetic energy.
POSITIVE = ("kuramoto-inertia-two", "harmonic-chain-eight", "coupled-mathieu-symmetric", "kepler-cartesian")


def named(choice: Any) -> list[str]:
    return [known.id for known in SYSTEMS.values() if choice(known)]


def levels(known: Known) -> int:
    return {2: 3, 3: 2, 8: 3}.get(len(known.document["coordinates"]), 1)


def test_the_list_is_whole() -> None:
    assert len(SYSTEMS) == len(known_systems()) >= 250
    for known in SYSTEMS.values():
        assert known.source, known.id
        assert known.argument, known.id
        for verdict, proof in ((known.verdict, known.proof), (known.verdict_with_time, known.proof_with_time)):
            assert verdict in VERDICTS
            assert proof in PROOFS[verdict], known.id
        if known.verdict == "variational":
            assert known.verdict_with_time == "variational", known.id
    assert {len(known.document["coordinates"]) for known in SYSTEMS.values()} >= {1, 2, 3, 4, 5, 6, 7, 8}
    resting = named(lambda known: "argument" in (known.proof, known.proof_with_time))
    assert len(resting) <= 14, resting


def assert_proven(known: Known) -> None:
    """That the verdict holds, from SymPy alone."""
    given = known.formulas
    if "lagrangian" in (known.proof, known.proof_with_time):
        texts = [text for text in (known.lagrangian, known.lagrangian_with_time) if text]
        assert texts
        assert all(is_lagrangian(text, given) for text in texts)
    if known.proof == "algebraic":
        assert algebraic_conditions(given, levels(known))[1]
    if known.proof_with_time == "prolonged":
        assert is_excluded(given, 3, with_time=True)
    elif known.proof == "prolonged":
        assert is_excluded(given, 2) or is_excluded(given, 3)


def assert_solved(known: Known, time_limit: float) -> None:
    """That the solver agrees, its checker too, and that its Lagrangians are Lagrangians for SymPy."""
    result = solve(known.document, time_limit=time_limit)
    assert (result["verdict"], result["verdict_with_time"]) == (known.verdict, known.verdict_with_time)
    assert result["explanation"]
    given = formulas(known.document, known.plain or result["system"]["equations"])
    for answer in (result, result["with_time"]):
        if answer is not None:
            assert answer["checked"] == "valid"
            if answer["lagrangian"]:
                assert is_lagrangian(answer["lagrangian"]["text"], given, integrals=answer["integrals"])
    assert check(result)["verdict"] == "valid"


@pytest.mark.parametrize("name", SAMPLE)
def test_a_sample_is_solved_as_is_known(name: str) -> None:
    assert_solved(SYSTEMS[name], time_limit=30.0)


@pytest.mark.parametrize("name", [name for name in SAMPLE if name != "monopole"])
def test_what_is_known_of_the_sample_holds(name: str) -> None:
    assert_proven(SYSTEMS[name])


@pytest.mark.nightly
@pytest.mark.parametrize("name", [name for name in SYSTEMS if name not in SAMPLE])
def test_every_system_is_solved_as_is_known(name: str) -> None:
    assert_solved(SYSTEMS[name], time_limit=120.0)


@pytest.mark.nightly
@pytest.mark.parametrize("name", SYSTEMS)
def test_what_is_known_holds(name: str) -> None:
    assert_proven(SYSTEMS[name])


@pytest.mark.parametrize("name", POSITIVE)
def test_a_positive_kinetic_energy_is_found_where_there_is_one(name: str) -> None:
    known = SYSTEMS[name]
    found = solve(known.document, time_limit=30.0)["lagrangian"]["text"]
    for velocity in known.document["coordinates"]:
        assert f"{velocity}'^2/2" in found
        assert f"-{velocity}'^2" not in found.replace(" ", "")


def test_the_second_opinion_can_say_no() -> None:
    """The tests above could not fail otherwise."""
    kepler = SYSTEMS["kepler-cartesian"].formulas
    assert not is_lagrangian("x'^2/2 + y'^2/2 - m/sqrt(x^2+y^2)", kepler)
    assert not is_lagrangian("x'^2/2 - m/sqrt(x^2+y^2)", kepler)
    assert algebraic_conditions(kepler, 3) == (1, False)
    assert not is_excluded(kepler, 2)
    damped = SYSTEMS["kepler-linear-drag"].formulas
    assert is_excluded(damped, 2)
    assert not is_excluded(damped, 2, with_time=True)
    assert algebraic_conditions(damped, 3) == (1, False)
