"""A result is written also where the time for exact expressions ended before it."""

from __future__ import annotations

import pytest

from inverse_service import catalogue
from inverse_service.algebra.rational_functions import TooLarge
from inverse_service.inverse_problem.hamiltonisation.nonholonomic_study import motion_report
from inverse_service.mechanics.nonholonomic.geometry import Geometry
from inverse_service.service.documents.translate_nonholonomic import _class, to_nonholonomic, to_nonholonomic_schema


def test_the_class_is_named_after_the_time_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    report = motion_report(to_nonholonomic(to_nonholonomic_schema(catalogue.document("generic-class-two"))))
    in_time = _class(report)

    def too_late(geometry: Geometry, element: object) -> None:
        raise TooLarge("the time for exact expressions is used up")

    monkeypatch.setattr(Geometry, "tree", too_late)
    late = _class(report)
    assert (late.member, late.r1, late.r2, late.s) == (True, in_time.r1, in_time.r2, in_time.s)
    assert in_time.N is not None
    assert (late.N, late.K, late.A) == (None, None, {})
