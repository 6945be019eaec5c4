"""docs/records/kinds.md lists the systems of the tests: `python -m tests.docs.test_known_kinds` writes it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.doors.rows import rows

PAGE = Path(__file__).parents[2] / "docs" / "records" / "kinds.md"
HEAD = """# Systems with known answers, by kind of Lagrangian

Written by `python -m tests.docs.test_known_kinds` from the rows of `tests/corpus/kinds.ndjson` and
`constrained.ndjson`, each of which is a test: each *yes* with a Lagrangian is verified by numbers without the package,
each certificate by the checker. The source has the system and its answer, or the theorem from which the answer follows;
rows without one are our own examples. Types: [how to ask](../how-to/lagrangian-types.md#types-of-lagrangians).

| system | source | q'' | question | answer |
| --- | --- | --- | --- | --- |
"""
COSTS = "\n## What a kind costs\n"
SOURCES = {
    "Antonelli, Ingarden, Matsumoto 1993": "The Theory of Sprays and Finsler Spaces with Applications in Physics and "
    "Biology, Kluwer",
    "Bateman 1931": "On dissipative systems and related variational principles, Phys. Rev. 38",
    "Bloch 2003": "Nonholonomic Mechanics and Control, Springer",
    "Bloch, Krishnaprasad, Marsden, Murray 1996": "Nonholonomic mechanical systems with symmetry, Arch. Rational Mech. "
    "Anal. 136",
    "Bolonek, Kosinski 2005": "Hamiltonian structures for Pais-Uhlenbeck oscillator, Acta Phys. Polon. B 36",
    "Calogero 1971": "Solution of the one-dimensional N-body problems with quadratic and/or inversely quadratic pair "
    "potentials, J. Math. Phys. 12",
    "Chaplygin 1911": "On the theory of motion of nonholonomic systems. The theorem on the reducing multiplier, Mat. "
    "Sbornik 28",
    "Darboux 1894": "Lecons sur la theorie generale des surfaces III, Gauthier-Villars",
    "Den Hartog 1956": "Mechanical Vibrations, 4th edition, McGraw-Hill",
    "do Carmo 1976": "Differential Geometry of Curves and Surfaces, Prentice-Hall",
    "do Carmo 1992": "Riemannian Geometry, Birkhauser",
    "Douglas 1941": "Solution of the inverse problem of the calculus of variations, Trans. Amer. Math. Soc. 50",
    "Fernandez, Mestdag, Bloch 2009": "A generalization of Chaplygin's reducibility theorem, Regul. Chaotic Dyn. 14, "
    "arXiv:0909.4018",
    "Goldstein 1980": "Classical Mechanics, 2nd edition, Addison-Wesley",
    "Hamel 1903": "Ueber die Geometrieen, in denen die Geraden die Kuerzesten sind, Math. Ann. 57",
    "Henon, Heiles 1964": "The applicability of the third integral of motion: some numerical experiments, Astron. "
    "J. 69",
    "Hill 1878": "Researches in the lunar theory, Amer. J. Math. 1",
    "Kobayashi, Nomizu 1963": "Foundations of Differential Geometry I, Interscience",
    "Landau, Lifshitz 1976": "Mechanics, 3rd edition, Pergamon",
    "Merkin 1997": "Introduction to the Theory of Stability, Springer",
    "Milnor 1976": "Curvatures of left invariant metrics on Lie groups, Adv. Math. 21",
    "Minguzzi 2015": "Rayleigh's dissipation function at work, Eur. J. Phys. 36",
    "Muzsnay 2006": "The Euler-Lagrange PDE and Finsler metrizability, Houston J. Math. 32",
    "Neimark, Fufaev 1972": "Dynamics of Nonholonomic Systems, Amer. Math. Soc.",
    "Olver 1986": "Applications of Lie Groups to Differential Equations, Springer",
    "O'Neill 1983": "Semi-Riemannian Geometry, Academic Press",
    "Rayleigh 1877": "The Theory of Sound I, Macmillan",
    "Rayleigh 1883": "On maintained vibrations, Phil. Mag. 15",
    "Rosenberg 1977": "Analytical Dynamics of Discrete Systems, Plenum",
    "Schwarzschild 1916": "Ueber das Gravitationsfeld eines Massenpunktes nach der Einsteinschen Theorie, Sitzungsber. "
    "Preuss. Akad. Wiss.",
    "Shen 2001": "Lectures on Finsler Geometry, World Scientific",
    "Strogatz 1994": "Nonlinear Dynamics and Chaos, Addison-Wesley",
    "Suslov 1902": "Theoretical Mechanics 2, Kiev (in Russian)",
    "Taussky 1972": "The role of symmetric matrices in the study of general matrices, Linear Algebra Appl. 5",
    "Taylor 2005": "Classical Mechanics, University Science Books",
    "Thompson 2003": "Variational connections on Lie groups, Differential Geom. Appl. 18",
    "Thomson, Tait 1879": "Treatise on Natural Philosophy I.1, Cambridge",
    "Toda 1967": "Vibration of a chain with nonlinear interaction, J. Phys. Soc. Japan 22",
    "van der Pol 1926": "On relaxation-oscillations, Phil. Mag. 2",
    "Veselov, Veselova 1986": "Flows on Lie groups with a nonholonomic constraint and integrable non-Hamiltonian "
    "systems, Funct. Anal. Appl. 20",
    "Vitt, Gorelik 1933": "Oscillations of an elastic pendulum as an example of the oscillations of two parametrically "
    "coupled linear systems, J. Tech. Phys. USSR 3",
    "Ziegler 1952": "Die Stabilitaetskriterien der Elastomechanik, Ing.-Arch. 20",
}
CITED = re.compile(r"(.*) \(((.*?\d{4})[^()]*)\)")
SAID = {"variational": "yes", "not_variational": "no", "undetermined": "open", None: "no other clock"}


def listed() -> Iterator[tuple[str, str, str, str]]:
    """(source, system, question, answer)."""
    for row in rows("kinds"):
        document = row["document"]
        ((_, verdict),) = row["kinds"].items()
        kind = document["kinds"][0]
        point = ", ".join(f"{name} = {value}" for name, value in document.get("near", {}).items())
        question = kind if isinstance(kind, str) else json.dumps(kind)
        yield row["source"], written(document["equations"]), question + (f" at {point}" if point else ""), SAID[verdict]
    for row in rows("constrained"):
        document = row["document"]
        if "reduced" in row:
            system = f"{document['lagrangian']}; {', '.join(document['constraints'])}"
            answer = f"{SAID[row['reduced']['verdict']]}; {SAID[row['reduced']['with_clock']]}"
            yield row["source"], system, "reduced; with another clock", answer
        elif "factor" in row.get("clock", {}):
            yield row["source"], written(document["equations"]), "a clock", f"N = {row['clock']['factor']}"


def written(equations: Any) -> str:
    return "; ".join(f"{name}'' = {force}" for name, force in equations.items())


def cited(named: str) -> tuple[str, str, str]:
    """What a row is called, its citation, and the name of the source, both empty for our own."""
    found = CITED.fullmatch(named)
    return (found[1], found[2], found[3]) if found else (named, "", "")


def page(costs: str) -> str:
    lines = [
        f"| {cited(name)[0]} | {cited(name)[1]} | `{system}` | {question} | {answer} |\n"
        for name, system, question, answer in listed()
    ]
    sources = [f"- {name}. {title}.\n" for name, title in SOURCES.items()]
    return "".join([HEAD, *lines, "\n## Sources\n\n", *sources, COSTS, costs])


def test_the_page_lists_the_systems_of_the_tests() -> None:
    text = PAGE.read_text()
    assert text == page(text.split(COSTS)[1])


def test_sixty_systems_have_a_source() -> None:
    found = [(system, cited(name)[2]) for name, system, _, _ in listed()]
    assert {source for _, source in found if source} == {*SOURCES}
    assert len({system for system, source in found if source}) >= 60


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text().partition(COSTS)[2]))
