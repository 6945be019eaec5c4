"""Whether stated domains have what a proof needs, and whether the cells of a result cover those of its document."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from itertools import pairwise
from time import thread_time
from typing import Any

from inverse_service import errors
from inverse_service.certificate import cell
from inverse_service.certificate.checker import CheckResult
from inverse_service.certificate.formulas import Ended
from inverse_service.certificate.question import Question, Tools
from inverse_service.decision import deciding
from inverse_service.expressions import tree as ex
from inverse_service.field import real_point, tower
from inverse_service.mechanics import second_order_system
from inverse_service.reading import reader
from inverse_service.reading.names import Names

_SEEDS = range(2, 10)  # of points all over, at which an answer has to be found


def lacking(
    certificate: Mapping[str, Any], stated: Sequence[str], proof: CheckResult, limit: float
) -> tuple[list[str], set[int]]:
    """The members of the proven cell that do not follow from a stated domain; stated ones that were not proven."""
    if proof.cell is None:
        return [], {*range(len(stated))}
    tools = Tools(random.Random(), thread_time() + max(1.0, limit))
    question = Question(tools, certificate["system"], True, dict(certificate))
    question.read_integrals(certificate.get("integrals") or {})
    try:
        missing, beyond = cell.lacking(question, stated, proof.cell)
    except Ended as end:
        return ([*end.args[1:]], set()) if end.args[0] == "invalid" else ([], {*range(len(stated))})
    return missing, {*beyond}


def trees_of(domain: Sequence[str], names: Names) -> list[ex.Expression]:
    """What a domain says is positive, as trees."""
    found = []
    for text in domain:
        for sign in "<>":
            sides = [reader.read_formula(side, names) for side in text.split(sign)] if sign in text else []
            pairs = pairwise(sides)
            found += [left - right if sign == ">" else right - left for left, right in pairs]
    return found


def gaps(
    system: second_order_system.SecondOrderSystem, result: Mapping[str, Any], sides: Sequence[Sequence[str]]
) -> str:
    """What is wrong where a point of the document lies in no cell: `sides` are those of the answers that are proven."""
    listed = [*sides, *(one.get("domain") or [] for one in result.get("not_answered") or [])]
    try:
        cells = [trees_of(domain, system.names) for domain in listed]
    except errors.InputError:
        return "A domain cannot be read."
    if any(isinstance(node, ex.Arbitrary) for cell in cells for tree in cell for node in ex.walk(tree)):
        return ""
    points = [_point(one, 1) for one in second_order_system.branches_of(system)] + [
        _point(system, seed) for seed in _SEEDS
    ]
    for point in filter(None, points):
        if not any(real_point.are_positive(cell, point) for cell in cells):
            place = ", ".join(f"{key} = {float(value):.4g}" for key, value in list(point.items())[:6])
            return f"No cell holds the point {place}."
    return ""


def _point(system: second_order_system.SecondOrderSystem, seed: int) -> real_point.RealTable | None:
    kernels = tuple(map(tower.to_kernels, system.accelerations))
    return real_point.find_real_point(kernels, deciding.variables_of(system), seed, system.positive)
