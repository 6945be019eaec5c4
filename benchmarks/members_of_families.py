"""Sixty families: which of their members have a Lagrangian, at what cost, and what stays open.

`python -m benchmarks.members_of_families [--only KEY ...] [--limit SECONDS] [--no-search] [--output
FILE]` prints a row for each family: whether its leaves cover it, whether the checker proves what
holds outside open sets, the number of leaves and of open sets, and seconds of processor time. The
first 26 are classical (springs, damping, gains, charges, connections with constant coefficients,
free functions); 14 are of other kinds (constraints, driven lines, friction, torques), 14 are taken
from the literature, and six have functions of different variables, or two of the same.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from pathlib import Path
from typing import Any

Document = dict[str, Any]


def _family(
    equations: dict[str, str],
    letters: str = "",
    functions: dict[str, list[str]] | None = None,
    **more: Any,
) -> Document:
    found: Document = {"equations": equations, "parameters": [*letters], **more}
    if functions:
        found["functions"] = functions
    return found


def _plane(x: str, y: str, letters: str = "", **functions: str) -> Document:
    return _family({"x": x, "y": y}, letters, {name: [*of] for name, of in functions.items()})


def _velocities(document: Document, **functions: list[str]) -> Document:
    return document | {"functions": functions}


FAMILIES: dict[str, Document] = {
    "1 springs": _plane("-a*x + b*y", "c*x - d*y", "abcd"),
    "2 springs and damping": _plane("-a*x' + b*y", "c*x - d*y'", "abcd"),
    "2b damping matrix, two springs": _plane("-a*x' - b*y' - p*x", "-c*x' - d*y' - m*y", "abcdpm"),
    "3 forces F(x, y), G(x, y)": _plane("F(x, y)", "G(x, y)", F="xy", G="xy"),
    "4 force F(x, y), one spring": _plane("F(x, y)", "-y", F="xy"),
    "5 F(x, y) y', G(x, y) x'": _plane("F(x, y)*y'", "G(x, y)*x'", F="xy", G="xy"),
    "5s charge in B(x, y)": _plane("F(x, y)*y'", "-F(x, y)*x'", F="xy"),
    "6a V, B, C": _plane(
        "-diff(V(x, y), x) + B(x, y)*y'", "-diff(V(x, y), y) - C(x, y)*x'", V="xy", B="xy", C="xy"
    ),
    "6b B, C": _plane("B(x, y)*y'", "-C(x, y)*x'", B="xy", C="xy"),
    "6c springs, B, C": _plane("-x + B(x, y)*y'", "-y - C(x, y)*x'", B="xy", C="xy"),
    "6d V, constants a, b across": _plane(
        "-diff(V(x, y), x) + a*y'", "-diff(V(x, y), y) - b*x'", "ab", V="xy"
    ),
    "7 constant connections": _plane(
        "-a*x'^2 - b*x'*y' - c*y'^2", "-d*x'^2 - e*x'*y' - k*y'^2", "abcdek"
    ),
    "7b constant connections, 4": _plane("-a*x'^2 - b*x'*y' - c*y'^2", "-k*y'^2", "abck"),
    "8 gain matrix of two oscillators": _plane(
        "-2*x + y - a*x' - b*y'", "x - 3*y - c*x' - d*y'", "abcd"
    ),
    "9 F(x, x'), G(x, y, y')": _velocities(
        _plane("F(x, x')", "G(x, y, y')"), F=["x", "x'"], G=["x", "y", "y'"]
    ),
    "9b F(x, x'), G(x, y)": _velocities(_plane("F(x, x')", "G(x, y)"), F=["x", "x'"], G=["x", "y"]),
    "10 reduced particle, V(x, y)": _plane(
        "-diff(V(x, y), x)", "-(x*x'*y' + diff(V(x, y), y))/(1 + x^2)", V="xy"
    ),
    "10b reduced particle, V(x)": _plane("-V'(x)", "-x*x'*y'/(1 + x^2)", V="x"),
    "11 springs in space": _family(
        {"x": "-a*x - b*y - c*z", "y": "-d*x - e*y - k*z", "z": "-l*x - m*y - p*z"}, "abcdeklmp"
    ),
    "11b ring of three": _family(
        {"x": "-a*x' + b*y", "y": "-c*y' + d*z", "z": "-e*z' + k*x"}, "abcdek"
    ),
    "11c gyroscopic forces in space": _family(
        {"x": "a*y' - b*z'", "y": "c*z' - d*x'", "z": "e*x' - k*y'"}, "abcdek"
    ),
    "12 conformal factor": _plane(
        "-diff(F(x, y), x)*x'^2 - 2*diff(F(x, y), y)*x'*y' + diff(F(x, y), x)*y'^2",
        "diff(F(x, y), y)*x'^2 - 2*diff(F(x, y), x)*x'*y' - diff(F(x, y), y)*y'^2",
        F="xy",
    ),
    "12w Weyl connection": _plane(
        "-F(x, y)*x'^2 - 2*G(x, y)*x'*y' + F(x, y)*y'^2",
        "G(x, y)*x'^2 - 2*F(x, y)*x'*y' - G(x, y)*y'^2",
        F="xy",
        G="xy",
    ),
    "13 a(x) y', b(x) x'": _plane("a(x)*y'", "b(x)*x'", a="x", b="x"),
    "14 spring, A(x, y) y'": _plane("-x + A(x, y)*y'", "-y", A="xy"),
    "15 spring, A(x, y, y')": _velocities(_plane("-x + A(x, y, y')", "-y"), A=["x", "y", "y'"]),
    # Of other kinds.
    "16 damping matrix, springs 1, 2": _plane("-x - a*x' - b*y'", "-2*y - c*x' - d*y'", "abcd"),
    "17 gains k, l, m": _plane("-y + k*x + l*y'", "-x + m*x'", "klm"),
    "18 force k(r) across the velocity": _family(
        {"r": "r*phi'^2 + k(r)*r^2*phi'^2", "phi": "-(2/r + k(r))*r'*phi'"}, "", {"k": ["r"]}
    ),
    "19 Douglas, linear": _plane("a*y' + b*y", "c*x + d*x'", "abcd"),
    "20 two driven lines": _plane("-a*x - b*y + cos(t)", "-c*x - d*y - k*x' + sin(t)", "abcdk"),
    "21 central force, torque": _family(
        {"r": "r*phi'^2 - F(r)", "phi": "-2*r'*phi'/r + G(r)"}, "", {"F": ["r"], "G": ["r"]}
    ),
    "22 friction F(x')": _velocities(_plane("-x + F(x')", "-y + a*x", "a"), F=["x'"]),
    "23 charge with drag in B(x, y)": _plane(
        "B(x, y)*y' - a*x'", "-B(x, y)*x' - a*y'", "a", B="xy"
    ),
    "24 Lienard, coupled": _plane("-F(x)*x' - x", "-G(y)*y' - y + a*x", "a", F="x", G="y"),
    "25 V(x, y), one force a x": _plane(
        "-diff(V(x, y), x)", "-diff(V(x, y), y) - a*x", "a", V="xy"
    ),
    "26 cubic potentials": _plane("-x - 2*a*x*y", "-y - b*x^2 + c*y^2", "abc"),
    "27 van der Pol, coupled": _plane(
        "-x + e*(1 - x^2)*x' + a*y", "-y + e*(1 - y^2)*y' + b*x", "abe"
    ),
    "28 knife edge, V(x, y)": {
        "lagrangian": "x'^2/2 + y'^2/2 + phi'^2/2 - V(x, y)",
        "coordinates": ["phi", "x", "y"],
        "constraints": ["y' = tan(phi)*x'"],
        "functions": {"V": ["x", "y"]},
    },
    "29 nonholonomic particle, V(x, y)": {
        "lagrangian": "x'^2/2 + y'^2/2 + z'^2/2 - V(x, y)",
        "coordinates": ["x", "y", "z"],
        "constraints": ["z' = -x*y'"],
        "functions": {"V": ["x", "y"]},
    },
    # From Douglas 1941, Henon and Heiles 1964, Pais and Uhlenbeck 1950, and others.
    "30 Douglas, a x^2 + b y^2": _plane("a*x^2 + b*y^2", "c*x*y", "abc"),
    "31 gyroscopic forces, drag, springs": _plane(
        "-p*x - a*x' + g*y'", "-q*y - b*y' - g*x'", "abgpq"
    ),
    "32 Emden-Fowler, coupled": _plane("-a*x'/t - y^2", "-b*y'/t - c*x^2", "abc"),
    "33 f(x) x'^2, g(y) y'^2, coupled": _plane(
        "-f(x)*x'^2 - a*y", "-g(y)*y'^2 - b*x", "ab", f="x", g="y"
    ),
    "34 Henon-Heiles, five letters": _plane("-a*x - 2*b*x*y", "-c*y - d*x^2 + e*y^2", "abcde"),
    "35 spray f(x), g(x), h(x)": _plane(
        "-f(x)*x'*y'", "-g(x)*x'^2 - h(x)*y'^2", f="x", g="x", h="x"
    ),
    "36 connection, functions of x": _plane(
        "-a(x)*x'^2 - b(x)*y'^2", "-2*c(x)*x'*y'", a="x", b="x", c="x"
    ),
    "37 charge in B(r), C(r)": _family(
        {"r": "r*phi'^2 + B(r)*r*phi'", "phi": "-2*r'*phi'/r - C(r)*r'/r"},
        "",
        {"B": ["r"], "C": ["r"]},
    ),
    "38 two bodies with drag": _plane("-a*x' - k*(x - y)", "-b*y' - m*(y - x)", "abkm"),
    "39 Pais-Uhlenbeck, odd terms": _plane("y", "-a*y' - b*y - c*x' - d*x", "abcd"),
    "40 four gains on one channel": _plane("x - 2*y + k*x + l*y + m*x' + n*y'", "-x - y", "klmn"),
    "41 exponential forces": _plane("a*exp(y - x)", "b*exp(y - x) + c*exp(x - y)", "abc"),
    "42 F(x) y', G(x) x', springs": _plane("F(x)*y' - x", "G(x)*x' - y", F="x", G="x"),
    "43 damping a(t), c(t), coupled": _plane(
        "-a(t)*x' + b*y", "-c(t)*y' + d*x", "bd", a="t", c="t"
    ),
    # With functions of different variables, or two of the same.
    "44 F(y'), G(x)": _velocities(_plane("F(y')", "G(x)"), F=["y'"], G=["x"]),
    "45 F(x, y), G(x, y')": _velocities(_plane("F(x, y)", "G(x, y')"), F=["x", "y"], G=["x", "y'"]),
    "46 f(r), g(r) phi' across": _family(
        {"r": "r*phi'^2 - f(r)", "phi": "-2*r'*phi'/r - g(r)*phi'"}, "", {"f": ["r"], "g": ["r"]}
    ),
    "47 f(r), drag g(r)": _family(
        {"r": "r*phi'^2 - f(r) - g(r)*r'", "phi": "-2*r'*phi'/r - g(r)*phi'"},
        "",
        {"f": ["r"], "g": ["r"]},
    ),
    "48 f(x, y) x'^2, g(x, y) y'^2": _plane("-f(x, y)*x'^2", "-g(x, y)*y'^2", f="xy", g="xy"),
    "49 F(x) x', G(y) y', coupled": _plane("-F(x)*x' + y", "-G(y)*y' + x", F="x", G="y"),
}


def measured(key: str, limit: float) -> dict[str, Any]:
    """What `solve` says of the family of this key, with its seconds of processor time."""
    import inverse_service

    began = _seconds()
    document = FAMILIES[key] | {"family": True, "first_integrals": False}
    result = json.loads(inverse_service.solve(document, time_limit=limit).to_json())
    family = result.get("family")
    found = {"key": key, "seconds": round(_seconds() - began, 1)}
    if family is None:
        return found | {"covered": False, "leaves": 0, "open": 0, "reasons": ["no family"]}
    return found | {
        "covered": family["covered"],
        "checked": family["checked"] == "valid",
        "leaves": len(family["leaves"]),
        "open": len(family["open"]),
        "reasons": sorted({one["reason"] for one in family["open"]}),
        "family": family,
    }


def _seconds() -> float:
    own = os.times()
    return own.user + own.system + own.children_user + own.children_system


def _child(key: str, limit: float, pipe: Any) -> None:
    try:
        pipe.send(measured(key, limit))
    except Exception as problem:  # a family that cannot be asked is a row, too
        text = f"{type(problem).__name__}: {problem}"
        row = {"key": key, "seconds": 0.0, "covered": False, "leaves": 0, "open": 0}
        pipe.send(row | {"reasons": [text]})


def row(key: str, limit: float) -> dict[str, Any]:
    """The same in a process of its own, which is ended at twelve times the limit."""
    here, there = multiprocessing.Pipe()
    began = time.monotonic()
    child = multiprocessing.get_context("fork").Process(target=_child, args=(key, limit, there))
    child.start()
    found = here.recv() if here.poll(12 * limit) else None
    child.kill() if found is None else child.join()
    late = {"key": key, "seconds": time.monotonic() - began, "covered": False, "leaves": 0}
    return found or late | {"open": 0, "reasons": ["ended"]}


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as Markdown."""
    lines = [
        "| family | covered | checked | leaves | open | seconds | why open |",
        f"|{' --- |' * 7}",
    ]
    for one in rows:
        covered = "yes" if one["covered"] else "no"
        checked = "yes" if one.get("checked") else "no"
        why = "; ".join(reason[:90] for reason in one["reasons"])
        lines.append(
            f"| {one['key']} | {covered} | {checked} | {one['leaves']} | {one['open']} "
            f"| {one['seconds']:.1f} | {why} |"
        )
    covered = sum(one["covered"] for one in rows)
    quick = [sum(one["seconds"] <= most for one in rows) for most in (10, 60)]
    lines.append(
        f"\n{covered} of {len(rows)} are covered; {quick[0]} take at most 10 s of processor time, "
        f"{quick[1]} at most 60 s."
    )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], help="beginnings of keys")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for each family")
    parser.add_argument("--details", action="store_true", help="print the leaves and open sets")
    parser.add_argument("--no-search", action="store_true", help="leaves without a closed L")
    parser.add_argument("--output", type=Path, help="also write the table to this file")
    chosen = parser.parse_args()
    import inverse_service.service.documents.documents
    from inverse_service.solving import members

    assert inverse_service
    if chosen.no_search:
        members.SEARCH_SECONDS = 0.0
    rows = list[dict[str, Any]]()
    for key in FAMILIES:
        if chosen.only and key.split()[0] not in chosen.only:
            continue
        one = row(key, chosen.limit)
        rows.append(one)
        print(table([one]).splitlines()[2], file=sys.stderr, flush=True)
        if chosen.details and "family" in one:
            for leaf in one["family"]["leaves"]:
                said = ", ".join(part["text"] for part in leaf["equations"]) or "in general"
                but = f"  [not 0: {', '.join(leaf['nonzero'])}]" if leaf["nonzero"] else ""
                shown = (leaf["lagrangian"] or {}).get("text", "-")
                pair = leaf["verdict"], leaf["verdict_with_time"]
                print(
                    f"    {leaf['id']} in {leaf['inside']}: {said}{but}: {pair} L = {shown}"[:400]
                )
            for opened in one["family"]["open"]:
                said = ", ".join(part["text"] for part in opened["equations"])
                print(f"    open in {opened['inside']}: {said[:200]} -- {opened['reason']}")
    text = table(rows)
    if chosen.output:
        chosen.output.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
