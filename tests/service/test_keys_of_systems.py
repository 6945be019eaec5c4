"""No key of a document is left out that would change the motion."""

from __future__ import annotations

from typing import Any

import pytest

import inverse_service
from api_schemas.scene import SceneDocument
from inverse_service import errors
from inverse_service.service.documents import accepting

FREE = {"coordinates": ["y"], "lagrangian": "y'^2/2"}
HELD = {"coordinates": ["x", "y"], "lagrangian": "(x'^2 + y'^2)/2", "constraints": ["x' = y*y'"]}
BY_EQUATIONS = {"equations": "y'' = 0"}
MORE: dict[str, Any] = {"forces": {"y": "3"}, "rayleigh": "y'^2", "gravity": 9.81}


def _scene(system: dict[str, Any]) -> dict[str, Any]:
    zero = dict.fromkeys(system.get("coordinates", ["y"]), 0)
    return {
        "system": system,
        "initial": {"positions": zero, "velocities": zero},
        "step": 0.1,
        "time": 1,
    }


@pytest.mark.parametrize("more", MORE)
@pytest.mark.parametrize("system", [FREE, HELD, BY_EQUATIONS])
@pytest.mark.parametrize("is_wrapped", [False, True])
def test_a_scene_never_runs_without_a_key_of_its_system(
    system: dict[str, Any], more: str, is_wrapped: bool
) -> None:
    whole = {**system, more: MORE[more]}
    with pytest.raises(errors.InputError, match=f"'{more}'"):
        inverse_service.simulate(_scene({"document": whole} if is_wrapped else whole))


def test_a_force_in_the_system_is_asked_to_stand_beside_it() -> None:
    with pytest.raises(errors.InputError, match="'forces' stands beside 'system'") as refused:
        inverse_service.simulate(_scene({**FREE, "forces": {"y": "3"}}))
    assert refused.value.pointer == "/system/forces"


@pytest.mark.parametrize("more", sorted(accepting.OF_SCENES))
@pytest.mark.parametrize("document", [FREE, HELD, BY_EQUATIONS])
def test_no_motion_is_solved_without_what_moves_it(document: dict[str, Any], more: str) -> None:
    assert more in SceneDocument.model_fields
    with pytest.raises(errors.InputError, match=f"'{more}' belongs to a scene"):
        inverse_service.solve({**document, more: {}})
