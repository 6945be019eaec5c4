"""The nonholonomic part of a result as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from inverse_service.service.documents import canonical

LONG = 300


def any_associated_lines(part: dict[str, Any], explain: bool, parameters: Sequence[str] = ()) -> list[str]:
    """The answer about the motion itself, line by line."""
    lines = [part["statement"]]
    if part.get("exceptions"):
        lines.append(f"  {canonical.in_general(parameters, part['exceptions'])}")
    lines += [f"  {part['reason']}"] if part["reason"] else []
    lines += [f"  independent check: {part['checked']}"] if part["checked"] else []
    found = part["lagrangian"]
    if found is not None:
        lines += [
            *_with_domain("L", found),
            f"  on the constraints l = {_short(found['on_constraints']['text'])}",
        ]
        lines += [f"  lambda_{k} = {_short(one['text'])}" for k, one in enumerate(found["transverse_momenta"], 1)]
    elif part["verdict_with_time"] == "variational":
        lines.append("  no Lagrangian in closed form was found" + "; --explain shows how one begins" * (not explain))
    if part["hamiltonian"] is not None:
        lines += _with_domain("H", part["hamiltonian"])
    lines += [f"  image {_short(one['text'])} = 0" for one in part["image"]]
    if part["freedom"]:
        lines.append(f"  up to total derivatives, L along the constraints depends on {part['freedom']}")
    if explain:
        lines += [f"  {k}. {step['text']}" for k, step in enumerate(part["explanation"], 1)]
    return [*lines, ""]


def nonholonomic_lines(part: dict[str, Any]) -> Iterator[str]:
    """The motion, what it keeps, the associated systems and the Hamiltonisations, line by line."""
    motion = part["equations_of_motion"]
    yield "Nonholonomic motion:"
    yield from (f"  {name}'' = {_short(found['text'])}" for name, found in motion["second_order"].items())
    yield from (f"  {name}' = {_short(found['text'])}" for name, found in motion["first_order"].items())
    yield from (f"  lambda_{k} = {_short(found['text'])}" for k, found in enumerate(motion["multipliers"], 1))
    yield from _kept(part)
    yield ""
    yield "Associated second-order systems:"
    for one in part["associated"]:
        yield f"  {one['kind']}: {_verdict(one)}"
        if not one["defined"]:
            yield f"    {one['explanation']}"
    yield from _hamiltonisations(part["hamiltonisation"])
    yield ""
    yield f"The rest is about the associated system '{part['main']}':"


def reduced_lines(part: dict[str, Any]) -> Iterator[str]:
    """The reduced system and how the other coordinates follow; its answer comes after it."""
    yield f"The reduced system in {', '.join(part['coordinates'])}:"
    yield from (f"  {name}'' = {_short(text)}" for name, text in part["equations"].items())
    yield f"  {part['statement']}"
    yield from (f"  {name}' = {_short(text)}" for name, text in part["reconstruction"].items())


def _kept(part: dict[str, Any]) -> Iterator[str]:
    yield ""
    yield part["paper_class"]["statement"]
    yield part["integrable"]["statement"]
    yield from (f"  constant: {found['text']}" for found in part["integrable"]["integrals"])
    measure = part["measure_density"]
    yield measure["statement"]
    if measure["density"] is not None:
        yield f"  N = {_short(measure['density']['text'])}"
    yield from first_integral_lines(part["first_integrals"])


def first_integral_lines(found: list[dict[str, Any]]) -> Iterator[str]:
    """What is constant along the motion, each with the symmetry behind it."""
    if found:
        yield "Constant along the motion:"
    for one in found:
        symmetry = f"   [{one['symmetry']}]" if one["symmetry"] else ""
        yield f"  {one['name']}: {_short(one['text'])}{symmetry}"


def _verdict(one: dict[str, Any]) -> str:
    checked = f" (independent check: {one['checked']})" if one["checked"] is not None else ""
    where = f" where {', '.join(one['domain'])}" if one.get("domain") else ""
    return (one["verdict"] or "not defined").replace("_", " ") + where + checked


def _hamiltonisations(reports: list[dict[str, Any]]) -> Iterator[str]:
    for one in reports:
        yield ""
        yield f"Hamiltonized by the {one['associated']} system, {one['label']}:"
        yield f"  L = {_short(one['lagrangian']['text'])}"
        if one["hamiltonian"] is not None:
            yield from _with_domain("H", one["hamiltonian"])
        yield from (f"  constraint {_short(found['text'])} = 0" for found in one["constraints"])
        yield from (f"  {each['verdict']}: {each['text']}" for each in one["statements"])
        flow = one["trajectory"]
        if flow is not None:
            yield (
                f"  both flows over t = {flow['time']:g} from one start: positions differ by at most "
                f"{flow['difference']:.1e}, constraints by {flow['constraint']:.1e}, H by {flow['energy']:.1e}"
            )


def _with_domain(letter: str, part: dict[str, Any]) -> list[str]:
    where = (f"      where {condition}" for condition in part.get("domain", ()))
    # H without momenta is the energy.
    name = "energy in the velocities" if part.get("implicit") else letter
    return [f"  {name} = {_short(part['text'])}", *where]


def _short(text: str) -> str:
    return text if len(text) <= LONG else f"({len(text)} characters; see --format json)"
