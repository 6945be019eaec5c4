"""Nonholonomic motions from the literature, and motions given by their equations."""

from __future__ import annotations

from typing import Any

from inverse_service.constrained.existence import AnalyzedMotion, analyze_motion
from inverse_service.mechanics.constrained_motion import equations_of_motion
from inverse_service.mechanics.second_order_system import ConstrainedMotion, read_system
from inverse_service.service.documents.motion_documents import nonholonomic_of

SLEIGH = "((x'-a*sin(phi)*phi')^2+(y'+a*cos(phi)*phi')^2)/2"
BLADE = ["y'*cos(phi)-sin(phi)*x'"]
FREE = "(x'^2+y'^2+z'^2)/2"


def particle(potential: str) -> dict[str, Any]:
    return {
        "coordinates": ["x", "y", "z"],
        "lagrangian": f"{FREE}-({potential})",
        "constraints": ["z'+x*y'"],
    }


def heisenberg(potential: str) -> dict[str, Any]:
    return {
        "coordinates": ["x", "y", "z"],
        "lagrangian": f"{FREE}-({potential})",
        "constraints": ["z'-y*x'+x*y'"],
    }


def knife_edge(potential: str, **more: Any) -> dict[str, Any]:
    kinetic = "(x'^2+y'^2+phi'^2)/2"
    return {
        "coordinates": ["phi", "x", "y"],
        "lagrangian": f"{kinetic}-({potential})",
        "constraints": BLADE,
    } | more


def disk(potential: str, **more: Any) -> dict[str, Any]:
    return {
        "coordinates": ["phi", "psi", "x", "y"],
        "lagrangian": f"(x'^2+y'^2+phi'^2+psi'^2)/2-({potential})",
        "constraints": ["y'-sin(phi)*psi'", "x'-cos(phi)*psi'"],
    } | more


def motion_of(document: dict[str, Any]) -> ConstrainedMotion:
    return equations_of_motion(nonholonomic_of(document))


def analyzed(document: dict[str, Any]) -> AnalyzedMotion:
    return analyze_motion(motion_of(document))


def given(
    free: dict[str, str], dependent: dict[str, str], parameters: tuple[str, ...] = ()
) -> ConstrainedMotion:
    """A motion from texts: accelerations of the independent coordinates, velocities of the
    dependent ones.
    """
    names = [*free, *dependent]
    system = read_system(names, free | dependent, parameters)
    k = len(free)
    return ConstrainedMotion(
        tuple(names),
        tuple(free),
        tuple(dependent),
        system.accelerations[k:],
        system.accelerations[:k],
        parameters,
    )
