"""A formula with another name for the time is the formula in which the time has that name."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.service.documents.documents import parse_document

NAMES = (
    "gravity", "latitude", "theta", "at", "t_max", "t_0", "t2", "k_t", "m_t2", "x_tau", "phi_s", "T",
    "rate_of_time",
)  # fmt: skip


def formula(name: str, time: str) -> dict[str, Any]:
    document = {"equations": f"diff(x({time}), {time}, 2) = -{name}*x({time})*cos({time})^2"}
    found: dict[str, Any] = parse_document(document)["equations"]["x"]
    return found


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("time", ["tau", "time", "s"])
def test_no_letter_inside_another_name_is_taken_for_the_time(name: str, time: str) -> None:
    """In text, LaTeX, and MathML, a constant is written as it is beside a time t."""
    found, usual = formula(name, time), formula(name, "t")
    in_latex = {"tau": "\\tau", "time": "\\mathrm{time}"}.get(time, time)
    in_mathml = "τ" if time == "tau" else time
    arguments = {
        "text": ("cos(t)", f"cos({time})"),
        "latex": ("\\left(t\\right)", f"\\left({in_latex}\\right)"),
        "mathml": ("(</mo><mrow><mi>t<", f"(</mo><mrow><mi>{in_mathml}<"),
    }
    for key, (plain, own) in arguments.items():
        assert found[key].replace(" ", "").replace(own, plain) == usual[key].replace(" ", ""), key
