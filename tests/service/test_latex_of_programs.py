r"""Equations as SymPy, Maple and Maxima print them in LaTeX, and forms near to them that have one meaning."""

from __future__ import annotations

from typing import Any

import pytest

from inverse_service.errors import InputError
from inverse_service.service.documents.documents import parse_document

MAPLE = r"{\frac {{\rm d}^{2}}{{\rm d}{t}^{2}}}"
READ = [
    (r"\ddot{x}{\left(t \right)} = - x{\left(t \right)}", {"x": "-x"}),
    (MAPLE + r"x \left( t \right) =-{\omega}^{2}x \left( t \right) ", {"x": "-omega^2*x"}),
    (r"{\frac {d^{2}}{d{t}^{2}}}x \left( t \right) =-{\frac {g\sin \left( x \left( t \right)  \right) }{l}}",
     {"x": "-g*sin(x)/l"}),
    (r"{\frac {\partial ^{2}}{\partial {t}^{2}}}x \left( t \right) =- \left( {\frac {d}{dt}}x \left( t \right) "
     r" \right) ^{2}", {"x": "-x'^2"}),
    (r"\frac{d^{2}}{d t^{2}}x \! \left(t \right) = -x \! \left(t \right)", {"x": "-x"}),
    (MAPLE + r"x_{{1}} \left( t \right) =-x_{{1}} \left( t \right) ", {"x_1": "-x_1"}),
    (r"{{d^2}\over{d\,t^2}}\,x\left(t\right)=-\omega^2\,x\left(t\right)", {"x": "-omega^2*x"}),
    (r"{{d^2\,x}\over{d\,t^2}}=-{{g\,x}\over{l}}", {"x": "-g*x/l"}),
    (r"{{d^2}\over{d\,t^2}}\,x\left(t\right)=-\left({{d}\over{d\,t}}\,x\left(t\right)\right)^2", {"x": "-x'^2"}),
    (r"\ddot x = -k_\mathrm{eff} x", {"x": "-k_eff*x"}),
    (r"\ddot x = -k_{\rm eff} x", {"x": "-k_eff*x"}),
    (r"\ddot x = -{\rm k} x", {"x": "-k*x"}),
    (r"\ddot x = -\frac{dV(x)}{dx}", {"x": "-V'(x)"}),
    (r"\ddot x = -\frac{\mathrm{d}^2 V(x)}{\mathrm{d}x^2}", {"x": "-V''(x)"}),
    (r"\ddot x = -\frac{\partial V(x,y)}{\partial x}; \ddot y = 0", {"x": "-diff(V(x, y), x)", "y": "0"}),
    (r"\ddot x = -\frac{d}{dx}V(x)", {"x": "-V'(x)"}),
    (r"\ddot x = -V{\left(x \right)}", {"x": "-V(x)"}),
    (r"\ddot x = - \omega^{2}{\left(t \right)} x - \omega{\left(t \right)}", {"x": "-omega(t)^2*x - omega(t)"}),
    ("x'' = -k^2(t)*x + k(t)", {"x": "-k(t)^2*x + k(t)"}),
    # What stood before and still means the same.
    (r"\ddot x = {\frac{d}{2}} \sin{\frac{d}{2}} + 2^{\frac{d}{2}}", {"x": "d*sin(d/2)/2 + 2^(d/2)"}),
    (r"\ddot x = {\frac{d}{dt} x} y; \ddot y = 0", {"x": "x'*y", "y": "0"}),
    (r"\ddot x = -{{k}}^{{2}} x", {"x": "-k^2*x"}),
]  # fmt: skip
ASKED = [
    ("x'' = -k^2(t)*x + k", "could be a function"),
    ("x'' = -k^2(t)*x + k(x)", "could be a function"),
    (r"\ddot x = -\frac{dV(y)}{dx}; \ddot y = 0", "a derivative by x"),
    (r"\ddot x = -\frac{dV(x) k}{dx}", "a derivative by x"),
    (r"\ddot x = \frac{d}{dt} x (y); \ddot y = 0", "where the derivative ends"),
    ("x'' = -x; y'' = -y; x = 0", "leave out the equation with x''"),
    ("x'' = -x; y = 0", '"where": {"y": "0"}'),
]


def parsed(equations: str, **more: Any) -> dict[str, Any]:
    return parse_document({"equations": equations, "parameters": "guess"} | more)


@pytest.mark.parametrize(("equations", "meant"), READ)
def test_what_has_one_meaning_is_read(equations: str, meant: dict[str, str]) -> None:
    found = parsed(equations)["equations"]
    wanted = parsed("; ".join(f"{name}'' = {text}" for name, text in meant.items()))["equations"]
    assert {name: one["text"] for name, one in found.items()} == {name: one["text"] for name, one in wanted.items()}


@pytest.mark.parametrize(("equations", "sentence"), ASKED)
def test_what_has_two_is_asked_back(equations: str, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        parsed(equations)
    assert sentence in str(refused.value)


def test_a_declared_constant_is_no_function() -> None:
    assert parsed(r"\ddot x = k{\left(x\right)}", parameters=["k"])["equations"]["x"]["text"] == "k*x"
    with pytest.raises(InputError):
        parsed(r"\ddot x = -\frac{dk(x)}{dx}", parameters=["k"])
    with pytest.raises(InputError):
        parsed(r"\ddot x = -\frac{dk(x)}{dx}", parameters=["k", "d"])
