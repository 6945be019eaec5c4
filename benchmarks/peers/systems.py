"""Rational systems that every peer can parse, n = 1 to 4, with their verdicts for L(q, q')."""

from __future__ import annotations

from benchmarks.families import Document, cubic_chain, oscillator_chain
from inverse_service import catalogue

Task = tuple[Document, str]

YES, NO = "variational", "not_variational"


def _document(name: str, equations: dict[str, str]) -> Document:
    return {"name": name, "coordinates": list(equations), "equations": equations}


def _geodesics_of_a_full_metric() -> Document:
    """Geodesics of (1 + y^2) dx^2 + dy^2 + dz^2 + 2 y dx dz: no coordinate is orthogonal to all
    others.

    g = [[1 + y^2, 0, y], [0, 1, 0], [y, 0, 1]], det g = 1: Christoffel symbols are polynomials.
    """
    return _document(
        "geodesics of a non-diagonal metric, n = 3",
        {"x": "-y*x'*y' - y'*z'", "y": "y*x'^2 + x'*z'", "z": "(y^2 - 1)*x'*y' + y*y'*z'"},
    )


def _potential_and_gyroscope() -> Document:
    """L = |q'|^2/2 + 3 (x1 x2' - x2 x1')/2 + (x3 x4' - x4 x3')/2 - V, V = x1^2 x3 + x2 x4 + x4^2
    x1.
    """
    return _document(
        "potential and gyroscopic force, n = 4",
        {
            "x1": "3*x2' - 2*x1*x3 - x4^2",
            "x2": "-3*x1' - x4",
            "x3": "x4' - x1^2",
            "x4": "-x3' - x2 - 2*x1*x4",
        },
    )


def peer_systems() -> list[Task]:
    """(document, verdict), by growing n."""
    own = [
        (_document("damped oscillator, n = 1", {"x": "-x - x'/2"}), YES),
        (_document("Henon-Heiles, n = 2", {"x": "-x - 2*x*y", "y": "-y - x^2 + y^2"}), YES),
        (_document("coupled, not symmetric, n = 2", {"x": "x*y'", "y": "-x*y"}), NO),
        (_document("cyclic chain, n = 3", {"x": "y", "y": "z", "z": "x"}), YES),
        (_geodesics_of_a_full_metric(), YES),
        (oscillator_chain(3), YES),
        (cubic_chain(3), YES),
        (oscillator_chain(4), YES),
        (_potential_and_gyroscope(), YES),
    ]
    named = ("iiia-differential-obstruction-3", "nonholonomic-particle-first")
    known = [
        (catalogue.document(name), catalogue.entry(name)["expected"]["verdict"]) for name in named
    ]
    return sorted(own + known, key=lambda task: len(task[0]["coordinates"]))
