"""Systems, materials and terms for the tests of the search, from texts."""

from __future__ import annotations

from collections.abc import Sequence

from inverse_service.expressions.tree import Expression
from inverse_service.inverse_problem.decision.analysis import analyze
from inverse_service.inverse_problem.search.ladder import _sampler, _Search, attempt
from inverse_service.inverse_problem.search.linear_ansatz import LagrangianSpace, solve_ansatz
from inverse_service.inverse_problem.search.material import Material, gather
from inverse_service.inverse_problem.search.rungs import RUNGS
from inverse_service.inverse_problem.search.terms import Monomial, terms_of
from inverse_service.mechanics.reading import read_system
from inverse_service.reading.names import Names
from inverse_service.reading.reader import read_formula as parse

NAMES = Names(("w", "x", "y", "z"), ("a", "b", "c"), {"A": ("x",)})


def tree(text: str) -> Expression:
    return parse(text, NAMES)


def monomial_of(text: str) -> Monomial:
    """The only monomial of a formula, its coefficient left out."""
    (key,) = terms_of(tree(text))
    return key


def material(equations: dict[str, str], with_time: bool = False) -> Material:
    system = read_system(list(equations), equations, ["a", "b", "c"], {"A": ["x"]})
    return gather(analyze(system), with_time)


def lagrangians(equations: dict[str, str], candidates: Sequence[str], with_time: bool = False) -> LagrangianSpace:
    """All Lagrangians in the span of the candidates."""
    keys = [monomial_of(text) for text in candidates]
    return solve_ansatz(_sampler(material(equations, with_time), keys), keys, 3)


def proposed(given: Material, name: str) -> tuple[Expression, ...]:
    """The Lagrangians that the rung of this name finds."""
    (rung,) = [rung for rung in RUNGS if rung.name == name]
    found = attempt(_Search(given, 1, lambda _: None, []), rung)
    return found.lagrangians if found is not None else ()
