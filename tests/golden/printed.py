"""All that is printed of small documents that together run most of the program, as digests.

`documents()` were chosen by what they run for their time. Each is solved once; every key of the
result, the pages, the rows of a table, programs, proofs, and the answer of the checker are forms,
whose digests stand in printed.json. What depends on the machine is left out: clocks, and numbers that
measure round-off. `python -m tests.golden.printed` writes the digests again, and
`python -m tests.golden` says what a change does to results.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import random
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import inverse_service
from inverse_service.certificate import judging, stated_claims
from inverse_service.explanation.proofs import proof_document
from inverse_service.service.documents import answer_rows, documents as documents_of, printed_pages
from inverse_service.sympy import from_result
from inverse_service.web.pages import rendering, result_tasks
from tests.doors.rows import systems

STORED = Path(__file__).with_name("printed.json")
# Rows of the corpus by id.
ROWS = (
    "arbitrary-potential", "family-a-magnetic-field-exponential-in-x-a=0-b=2-k=1", "motion-particle,-x^2",
    "arbitrary-potential-plane-damped", "motion-pendulum-by-the-rate-of-a-constraint", "liouville-type",
    "kind-riemannian-geodesic-sprays-are-homogeneous", "latex-coupled",
    "identity-atan(tan(4*pi/5))-==--pi/5-disturbed", "motion-without-forces-of-constraint",
    "one-a-root-of-a-velocity-and-a-force", "potential-without-a-closed-form",
    "definite-real-distinct-eigenvalues,-K-not-symmetric", "book-atwood-accelerations",
    "reduced-two-shape-variables-and-a-measure-particle-in-a-harmonic-potential", "clock,-none",
    "case-iia2-half-decoupled", "sides-sign(x)*x^2", "special-erf", "book-mass-that-depends-on-place-lines",
    "kind-invariant-a-translation-is-an-isometry", "force-1/(1-x^2)", "force-1/(x^2+3)",
)  # fmt: skip
OTHERS: dict[str, Any] = {
    "damping with a letter": "x'' = -x - c*x'",
    "a power with a letter": {"equations": {"x": "a*x'^n"}, "parameters": ["a", "n"]},
    "a family": {"equations": {"x": "-b*y-x'", "y": "-c*x-y"}, "family": True},
    "a general function": {"equations": {"x": "F(x,y)", "y": "-y"}, "functions": {"F": ["x", "y"]}},
    "a Lagrangian of one's own": {"lagrangian": "m*x'^2/2-k*x^2/2-g*x", "parameters": ["m", "k", "g"]},
    "a family with a function of t": {
        "equations": {"x": "-F(t)*x-a*y", "y": "-b*x-y"}, "functions": {"F": ["t"]}, "parameters": ["a", "b"],
        "family": True,
    },
    "all kinds, yes": {
        "equations": {"x": "-x-x'/5", "y": "-2*y-y'/5"},
        "kinds": ["natural", "positive_definite", "rayleigh", "riemannian", "finsler"],
    },
    "all kinds, no": {
        "equations": {"x": "-y", "y": "-x+x'*y'"},
        "kinds": ["natural", "positive_definite", "rayleigh", "riemannian", "finsler"],
    },
    "two moduli": {"equations": "x'' = -sign(x)*x^2"},
    "an exponent": {"equations": {"x": "-x^n"}, "parameters": ["n"]},
    "coupled with a sum": "x'' = -sin(x-y); y'' = sin(x-y)",
    "a central force": {"lagrangian": "(r'^2+r^2*phi'^2)/2-V(r)", "functions": {"V": ["r"]}},
    "with a clock": {"equations": {"x": "-x*x'^2", "y": "-x*x'*y'"}, "clock": "search"},
    "an ansatz": {"equations": {"x": "-x-x'"}, "ansatz": ["exp(t)*(x'^2-x^2)/2"]},
    "a nearest system": {"equations": {"x": "-1.02*x+0.01*x'"}, "nearest": {"errors": 0.02}},
    # Without any symmetry, so that no number can take the place of another one.
    "a path with two masses": {"lagrangian": "(2*x'^2+3*y'^2)/2-x^4-2*y^4-5*x*y"},
    "roots of numbers": "x'' = -sqrt(3)*x/6-5*x^3/sqrt(2)",
    "a field and two springs": "x'' = 2*y'-3*x; y'' = -2*x'-5*y",
    "a drag with a square": "x'' = -2*x'^2-5*x",
    "a slow mass": {"lagrangian": "-2*sqrt(3-x'^2)-5*x"},
    "one that has none": "x'' = -2*x-3*y; y'' = -5*x^2*y'",
    "three coordinates": {"lagrangian": "(2*x'^2+3*y'^2+5*z'^2)/2-x*y*z"},
    "two central forces": "r'' = r*phi'^2-2/r^2-3*r; phi'' = -2*r'*phi'/r",
    "a family of springs": {
        "equations": {"x": "-a*x-b*y", "y": "-c*x-2*y"}, "parameters": ["a", "b", "c"], "family": True
    },
}  # fmt: skip
PROGRAMS = ("damping with a letter", "force-1/(x^2+3)")
LANGUAGES = (
    "sympy", "python", "julia", "matlab", "mathematica", "maple", "maxima", "c", "fortran", "rust", "javascript"
)  # fmt: skip
PROOFS = (
    "damping with a letter",
    "definite-real-distinct-eigenvalues,-K-not-symmetric",
    "latex-coupled",
)
# Lagrangians of one's own, judged for a system.
JUDGED: dict[str, dict[str, str]] = {
    "the right one": {"system": "x'' = -x", "lagrangian": "x'^2/2-x^2/2"},
    "a multiple with a derivative": {"system": "x'' = -x", "lagrangian": "3*x'^2-3*x^2+x'*sin(x)"},
    "a wrong sign": {"system": "x'' = -x", "lagrangian": "x'^2/2+x^2/2"},
    "not regular": {"system": "x'' = -x; y'' = -y", "lagrangian": "x'*y-x^2"},
    "right on a part": {"system": "x'' = -x'^2/x", "lagrangian": "x^2*x'^2"},
    "another on the other side": {"system": "x'' = -x", "lagrangian": "x'^2/2-x*abs(x)/2"},
    "with the time": {"system": "x'' = -x-c*x'", "lagrangian": "exp(c*t)*(x'^2-x^2)/2"},
    "right on both sides": {"system": "x'' = -1/x", "lagrangian": "x'^2/2-log(abs(x))"},
    "right on one side": {"system": "x'' = -1/x", "lagrangian": "x'^2/2-log(x)"},
    "two in a product": {"system": "x'' = -x; y'' = -y", "lagrangian": "x'*y'-x*y"},
    "with a wrong letter": {"system": "x'' = -k*x", "lagrangian": "m*x'^2/2-k*x^2/2"},
    "with its own letter": {"system": "x'' = -k*x/m", "lagrangian": "m*x'^2/2-k*x^2/2"},
    "of a free motion": {"system": "x'' = 0", "lagrangian": "sqrt(1+x'^2)"},
    "with a root of the velocity": {"system": "x'' = -x'^2/x", "lagrangian": "log(x'/x)*x*x'"},
    "for one value only": {"system": "x'' = -a*x'", "lagrangian": "x'^2/2"},
    "one of two masses": {"system": "x'' = -3*y/2; y'' = -x", "lagrangian": "x'^2+3*y'^2/2-3*x*y"},
    "the masses exchanged": {
        "system": "x'' = -3*y/2; y'' = -x",
        "lagrangian": "3*x'^2/2+y'^2-3*x*y",
    },
    "a field in a gauge": {
        "system": "x'' = 2*y'-3*x; y'' = -2*x'-5*y",
        "lagrangian": "(x'^2+y'^2-3*x^2-5*y^2)/2-2*y*x'",
    },
    "a root of another degree": {"system": "x'' = -4^(1/4)*x", "lagrangian": "x'^2-sqrt(2)*x^2"},
    "positive on a part": {"system": "x'' = x'^2*tan(x)", "lagrangian": "cos(x)^2*x'^2"},
    "a function of an angle": {
        "system": "x'' = 0; y'' = 0",
        "lagrangian": "cos(2*atan(y))*x'^2+y'^2",
    },
}
CLOCKS = re.compile(
    r'"(?:seconds|time_limit|engine|version)": (?:[-\d.e]+|"[^"]*"|\{[^{}]*\}|null)'
)
ROUNDING = re.compile(
    r"\d(?:\.\d+)?e-\d+|\d\.\d{6,}"
)  # numbers that measure round-off, or are many


@cache
def documents() -> Mapping[str, Any]:
    """The documents by name."""
    listed = {row["id"].replace(" ", "-"): row["document"] for row in systems()}
    return {name: listed[name] for name in ROWS} | OTHERS


@contextmanager
def alike(name: str) -> Iterator[None]:
    """The checker draws its numbers by the name, and limits are far that a busy machine reaches."""

    def drawing(seed: int | None = None) -> random.Random:
        return random.Random(name if seed is None else seed)

    drawn = SimpleNamespace(Random=drawing)
    with (
        mock.patch.object(judging, "random", drawn),
        mock.patch.object(stated_claims, "random", drawn),
        mock.patch.object(documents_of, "QUICKLY", 60 * documents_of.QUICKLY),
    ):
        yield


def answered(name: str) -> dict[str, Any]:
    """The answer to a document."""
    with alike(name):
        return dict(inverse_service.solve(documents()[name], time_limit=600))


def forms(name: str, answer: Mapping[str, Any]) -> dict[str, str]:
    """Each form of the answer to a document."""
    with alike(name):
        result = dict(answer)
        found = {f"/{key}": _plain(value) for key, value in result.items()}
        found["check"] = _plain(inverse_service.check(result))
        found["text"] = printed_pages.text_page(result, explain=True)
        found["short text"] = printed_pages.text_page(result, explain=False)
        found["latex"] = printed_pages.latex_page(result, explain=True)
        # Tables and pages show the seconds that were needed.
        if "provenance" in result:
            result["provenance"] = {**result["provenance"], "seconds": {"understood": 1.0}}
        found["table"] = _table([*answer_rows.rows(result)])
        look = result_tasks.Look(rendering.Visitor(), "http://here", 60.0)
        job = {"id": "0" * 32, "status": "successful", "result": result, "waited": 0}
        page = bytes(result_tasks.solve_result(look, job, None).body).decode()
        found["page"] = page[page.index("<main") : page.index("</main>")]
        if name in PROGRAMS:
            found |= {form: from_result(result).to_code(form) for form in LANGUAGES}
        if name in PROOFS:
            found |= {form: proof_document(result, form, 1) for form in ("coq", "identities")}
            found["checked identities"] = _plain(inverse_service.check(found["identities"]))
    return without_machine(found)


def judged(name: str) -> dict[str, str]:
    """What the check says of a Lagrangian of one's own."""
    with alike(name):
        answer = inverse_service.check(JUDGED[name])
    return without_machine({key: _plain(value) for key, value in answer.items()})


def without_machine(found: Mapping[str, str]) -> dict[str, str]:
    return {form: ROUNDING.sub("#", CLOCKS.sub("", text)) for form, text in found.items()}


def digests(found: Mapping[str, str]) -> dict[str, str]:
    return {
        form: hashlib.sha256(text.encode()).hexdigest()[:12] for form, text in sorted(found.items())
    }


def _plain(value: Any) -> str:
    return json.dumps(value, sort_keys=True, indent=1, default=str)


def _table(rows: list[dict[str, Any]]) -> str:
    written = io.StringIO()
    table = csv.DictWriter(written, [*rows[0]])
    table.writeheader()
    table.writerows(rows)
    return written.getvalue()


def main() -> None:
    """Write the digests of all documents."""
    found = {name: digests(forms(name, answered(name))) for name in documents()}
    found |= {name: digests(judged(name)) for name in JUDGED}
    STORED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
