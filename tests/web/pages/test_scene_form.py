"""What the advice of a run says can be set on the form of a simulation."""

from __future__ import annotations

import pytest

from inverse_service import catalogue, errors
from inverse_service.web.pages import forms, simulate

DISK = catalogue.document("vertically-rolling-disk")


def sent(**fields: str) -> forms.Form:
    return forms.Form(
        {
            "method": ("variational", "nonholonomic"),
            **{name: (text,) for name, text in fields.items()},
        }
    )


def test_free_constants_and_the_form_of_a_method_reach_the_scene_and_come_back() -> None:
    empty = simulate.form_for(DISK, "disk")
    form = simulate.with_sent(
        empty, sent(constants="C_x = 1/100, C_y = 2", form="raw", step="0.1", steps="5")
    )
    scene = simulate.scene_document(form, DISK)
    assert scene["constants"] == {"C_x": "1/100", "C_y": "2"}
    assert scene["methods"] == [
        {"method": "variational", "form": "raw"},
        {"method": "nonholonomic"},
    ]
    again = simulate.form_of_scene(empty, scene)
    assert (again.constants, again.form, again.methods) == (form.constants, "raw", form.methods)
    assert again.further == ()
    left = simulate.changed_scene(
        scene, simulate.scene_document(simulate.with_sent(empty, sent(steps="5")), DISK)
    )
    assert "constants" not in left  # what was emptied does not stay


def test_a_free_constant_without_a_value_is_told_next_to_its_field() -> None:
    form = simulate.with_sent(simulate.form_for(DISK, "disk"), sent(constants="C_x", steps="5"))
    with pytest.raises(errors.InputError) as refused:
        simulate.scene_document(form, DISK)
    assert simulate.field_of(refused.value.places[0].pointer) == "constants"
    assert "C_x = 1/100" in refused.value.detail
