"""Phi, nabla Phi and R of a solution, written out for people."""

from __future__ import annotations

from dataclasses import replace

from inverse_service.inverse_problem.outcome import Conditions, Solution
from inverse_service.mechanics.conditions import conditions
from inverse_service.mechanics.second_order_system import SecondOrderSystem


def printed_conditions(system: SecondOrderSystem) -> tuple[Conditions | None, str]:
    """The conditions, or None and why they are left out."""
    tensors = conditions(system)
    if tensors.Phi is None or tensors.nabla_Phi is None or tensors.R is None:
        return None, tensors.reason
    return Conditions(tensors.Phi, tensors.nabla_Phi, tensors.R), tensors.reason


def with_conditions(solution: Solution) -> Solution:
    """The solution of `solve` without conditions, with them."""
    found, reason = printed_conditions(solution.system)
    return replace(solution, conditions=found, provenance={**solution.provenance, "conditions_left_out": reason})
