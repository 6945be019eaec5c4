"""Certificates of the corpus, each judged once in a process that asks several things of it."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

from inverse_service.certificate.checker import CheckResult, check_certificate


def judged(certificate: Any, seed: int) -> CheckResult:
    """What the checker says of it, which nobody changes. Exceptions are found at once: when they are
    asked for, other tests have used up the time of this check.
    """
    return _judged(json.dumps(certificate), seed)


@cache
def _judged(text: str, seed: int) -> CheckResult:
    found = check_certificate(json.loads(text), seed=seed)
    return replace(found, exceptions=[*found.exceptions])
