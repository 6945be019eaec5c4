"""Nonholonomic systems beyond the catalogue, with what is known about them."""

from __future__ import annotations

from typing import Any

EXAMPLES: dict[str, dict[str, Any]] = {
    "Chaplygin sleigh": {
        "coordinates": ["theta", "x", "y"],
        "lagrangian": "m/2*((x' - a*sin(theta)*theta')^2 + (y' + a*cos(theta)*theta')^2) + I/2*theta'^2",
        "constraints": ["y'*cos(theta) - x'*sin(theta)"],
        "parameters": ["m", "a", "I"],
    },
    "balanced sleigh": {
        "coordinates": ["theta", "x", "y"],
        "lagrangian": "m/2*(x'^2 + y'^2) + I/2*theta'^2",
        "constraints": ["y'*cos(theta) - x'*sin(theta)"],
        "parameters": ["m", "I"],
    },
    "snakeboard": {
        "coordinates": ["x", "y", "theta", "psi", "phi"],
        "lagrangian": "m/2*(x'^2 + y'^2) + m*l^2/2*theta'^2 + J_0/2*psi'^2 + J_0*psi'*theta' + J_1*phi'^2",
        "constraints": [
            "-sin(theta + phi)*x' + cos(theta + phi)*y' - l*cos(phi)*theta'",
            "-sin(theta - phi)*x' + cos(theta - phi)*y' + l*cos(phi)*theta'",
        ],
        "parameters": ["m", "l", "J_0", "J_1"],
    },
    "rolling ball": {
        "coordinates": ["x", "y", "theta", "phi", "psi"],
        "lagrangian": "m/2*(x'^2 + y'^2) + I/2*(theta'^2 + phi'^2 + psi'^2 + 2*phi'*psi'*cos(theta))",
        "constraints": [
            "x' - r*(theta'*sin(psi) - phi'*sin(theta)*cos(psi))",
            "y' + r*(theta'*cos(psi) + phi'*sin(theta)*sin(psi))",
        ],
        "parameters": ["m", "I", "r"],
    },
    "magnetic field": {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2 + B*(x*y' - y*x')/2",
        "constraints": ["z' - y*x'"],
        "parameters": ["B"],
    },
    "skate on a turning table": {
        "coordinates": ["x", "y", "phi"],
        "lagrangian": "(x'^2 + y'^2 + phi'^2)/2",
        "constraints": ["x'*sin(phi) - y'*cos(phi) = Omega*(x*cos(phi) + y*sin(phi))"],
        "parameters": ["Omega"],
    },
    "moving constraint": {
        "coordinates": ["x", "y"],
        "lagrangian": "(x'^2 + y'^2)/2 - x*y",
        "constraints": ["y' = t*x'"],
    },
    "eight coordinates": {
        "coordinates": ["x", "y", "a", "b", "c", "d", "f", "h"],
        "lagrangian": "(x'^2 + y'^2 + a'^2 + b'^2 + c'^2 + d'^2 + f'^2 + h'^2)/2 - x*f",
        "constraints": ["x'*sin(a) - y'*cos(a)", "b' - c*d'", "f' - b*h'"],
    },
    "massless dependent coordinate": {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2)/2",
        "constraints": ["z' - x*y'"],
    },
    "sphere in velocities": {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2 - g*z",
        "constraints": ["x*x' + y*y' + z*z'"],
        "parameters": ["g"],
    },
    "one wheel": {
        "coordinates": ["x", "y", "theta"],
        "lagrangian": "(x'^2 + y'^2 + theta'^2)/2",
        "constraints": ["x' = R*theta'"],
        "parameters": ["R"],
    },
    "half integrable": {
        "coordinates": ["x", "y", "z", "w"],
        "lagrangian": "(x'^2 + y'^2 + z'^2 + w'^2)/2",
        "constraints": ["z' + x*y'", "w' - 2*x'"],
    },
    "integrating factor": {
        "coordinates": ["x", "y", "z"],
        "lagrangian": "(x'^2 + y'^2 + z'^2)/2",
        "constraints": ["y*z*x' + x*z*y' + x*y*z'"],
    },
}
