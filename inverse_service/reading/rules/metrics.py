r"""Metrics: ds^2 = dr^2 + r^2 d\phi^2, whose geodesics are meant: 2 L = (ds/dt)^2."""

from __future__ import annotations

from inverse_service.expressions.refusals import fault
from inverse_service.reading.rules.sequences import (
    SQUARED,
    WORD,
    D,
    Found,
    ahead,
    braced,
    changed,
    either,
    first,
    is_command,
    is_name,
    maybe,
    one,
    part,
    rest_of,
    sign,
    then,
)
from inverse_service.reading.typed_text import Typed

METRIC = then(either(one("ds"), then(D, "s")), SQUARED, ahead(one("=")))
DIFFERENTIAL = then(
    either(
        rest_of("name", "d", is_name),
        then(D, part("name", sign(lambda text: is_name(text) or is_command(text)))),
    ),
    maybe("_", either(braced(WORD), WORD)),
)


def as_lagrangian(text: Typed) -> Typed:
    """2L = r'^2 + r^2 phi'^2 for ds^2 = dr^2 + r^2 dphi^2; InputError for dOmega, which is usually
    the metric of a sphere.
    """
    text = changed(text, METRIC, lambda _: "2L")

    def velocity(differential: Found) -> Typed:
        name = differential.parts["name"]
        if name.text in ("\\Omega", "Omega", "\u03a9"):
            raise fault("metric of a sphere", differential.span.start + 1)
        whole = text[name.span.start : differential.span.stop]
        return whole + whole.made("'", -1)

    with text.placed():
        return changed(text, DIFFERENTIAL, velocity)


def metric(text: Typed) -> str:
    """The ds^2 of a text; no text without it."""
    found = first(METRIC, text)
    return "" if found is None else found.text.strip()
