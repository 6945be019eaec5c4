"""A key that a scene does not have is refused with those that stand there."""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from api_schemas import scene as schemas

BALL: dict[str, Any] = {
    "system": {"coordinates": ["x"], "lagrangian": "x'^2/2"},
    "initial": {"positions": {"x": 0}, "velocities": {"x": 1}},
    "step": 0.1,
    "steps": 3,
}


@pytest.mark.parametrize(
    ("more", "where", "model"),
    [
        ({"color": 1}, "'color'", schemas.SceneDocument),
        ({"initial": BALL["initial"] | {"speed": 1}}, "'initial/speed'", schemas.SceneInitial),
        ({"methods": [{"method": "exact", "color": 1}]}, "color'", schemas.SceneMethod),
        ({"events": [{"when": "x", "color": 1}]}, "'events/0/color'", schemas.SceneEvent),
        ({"contacts": [{"gap": "x", "color": 1}]}, "'contacts/0/color'", schemas.SceneContact),
        ({"ensemble": {"color": 1}}, "'ensemble/color'", schemas.SceneEnsemble),
    ],
)
def test_an_unknown_key_is_answered_by_the_known_ones(
    more: dict[str, Any], where: str, model: Any
) -> None:
    with pytest.raises(inverse_service.InputError) as refused:
        inverse_service.simulate(BALL | more)
    assert where in str(refused.value)
    assert f"the keys are {', '.join(model.model_fields)}." in str(refused.value)


@pytest.mark.parametrize(
    ("more", "pointer"),
    [
        ({"time": "-1", "steps": None}, "/time"),
        ({"step": "one"}, "/step"),
        ({"start_time": "now"}, "/start_time"),
        ({"initial": {"positions": {"x": "here"}, "velocities": {"x": 1}}}, "/initial/positions/x"),
        ({"methods": [{"method": "variational", "alpha": "2"}]}, "/methods/0/alpha"),
        ({"methods": [{"method": "adaptive", "tolerance": "1"}]}, "/methods/0/tolerance"),
        ({"contacts": [{"gap": "x", "friction": "-1"}]}, "/contacts/0/friction"),
        ({"contacts": [{"gap": "x", "restitution": "2"}]}, "/contacts/0/restitution"),
    ],
)
def test_a_number_that_cannot_be_is_refused_in_its_place(
    more: dict[str, Any], pointer: str
) -> None:
    with pytest.raises(inverse_service.InputError) as refused:
        inverse_service.simulate(BALL | more)
    assert refused.value.pointer == pointer


def test_an_unknown_key_of_a_system_is_answered_by_those_of_its_forms() -> None:
    system = {"catalogue": "kepler-polar", "color": 1}
    with pytest.raises(inverse_service.InputError, match="'system/color'") as refused:
        inverse_service.simulate(BALL | {"system": system})
    assert "the keys are catalogue, document, result, " in str(refused.value)


def test_units_of_a_scene_are_those_of_its_result() -> None:
    units = {"x": "m", "t": "s"}
    assert inverse_service.simulate(BALL | {"units": units})["units"] == units
