"""From what a task reports to what a person can read: stage, order, family, counts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

ORDER = re.compile(r"^prolongation to order (\d+)$")
FAMILY = re.compile(r"^(ansatz|method): (.+)$")
DECISION = {"decision": "L(q, q')", "decision with time": "L(t, q, q')"}


def described(report: Any, before: Mapping[str, Any]) -> dict[str, Any]:
    """The progress after a report; counts of prolongations and families go on from `before`."""
    if isinstance(report, Mapping):
        return {**before, **{str(key): value for key, value in report.items()}}
    text = str(report)
    kept = {key: before[key] for key in ("question", "counts") if key in before}
    if order := ORDER.match(text):
        return {**kept, "stage": "prolongation", "order": int(order[1]), "counts": _counted(before, "prolongations")}
    if family := FAMILY.match(text):
        return {**kept, "stage": family[1], "family": family[2], "counts": _counted(before, "families")}
    if text in DECISION:
        return {**kept, "stage": "decision", "question": DECISION[text]}
    return {**kept, "stage": text}


def _counted(before: Mapping[str, Any], name: str) -> dict[str, int]:
    counts = dict(before.get("counts", {}))
    counts[name] = counts.get(name, 0) + 1
    return counts
