"""Proofs as identities between polynomials over the rationals, checked exactly: no point, no prime, no chance."""

from __future__ import annotations

import re
from typing import Any

from flint import fmpq_mpoly, fmpq_mpoly_ctx

from inverse_service.certificate.formulas import MAX_MEMBERS, Ended, check_shape, require

TEXT, WORD = r"(?s:.*)", r"[A-Za-z_][A-Za-z0-9_]*"
POWER = rf"(?:[0-9]+|{WORD}(?:\^[0-9]{{1,4}})?)"
MONOMIAL = re.compile(rf"\s*([+-]?)\s*({POWER}(?:\*{POWER})*)\s*")
STEP = {"name": WORD, "gives": TEXT, "factor": TEXT, "cofactors": {}}
THEOREM = {
    "theorem": WORD,
    "relations": {},
    "equations": {},
    "nonzero": [TEXT, MAX_MEMBERS],
    "steps": [STEP, MAX_MEMBERS],
}
MAX_PRODUCTS = 50_000_000  # of terms in an identity


def checked_identities(document: Any) -> list[str]:
    """One sentence for each theorem: relations and equations zero, its factors not, so the last `gives` is zero.

    Each step is factor * gives = sum of cofactor * (relation, equation or earlier step).
    """
    check_shape(document, {"theorems": [THEOREM, MAX_MEMBERS]}, "identities")
    if not document["theorems"]:
        raise Ended("incomplete", "There are no identities.")
    return [_checked(theorem) for theorem in document["theorems"]]


def _checked(theorem: dict[str, Any]) -> str:
    facts, steps = theorem["relations"] | theorem["equations"], theorem["steps"]
    texts = [*facts.values(), *theorem["nonzero"], *(step[key] for step in steps for key in ("gives", "factor"))]
    texts += [cofactor for step in steps for cofactor in step["cofactors"].values()]
    require(steps and all(isinstance(text, str) for text in texts), "A theorem has texts, and a step at least.")
    names = sorted({word for text in texts for word in re.findall(WORD, text)}) or ["x"]
    ring = fmpq_mpoly_ctx.get(names, "degrevlex")
    known = {name: _polynomial(text, ring) for name, text in facts.items()}
    nonzero = [_polynomial(text, ring) for text in theorem["nonzero"]]
    for step in steps:
        require({*step["cofactors"]} <= {*known}, f"Step {step['name']} uses what was not shown before.")
        pairs = [(_polynomial(text, ring), known[name]) for name, text in step["cofactors"].items()]
        gives, factor = (_polynomial(step[key], ring) for key in ("gives", "factor"))
        if sum(len(a) * len(b) for a, b in [*pairs, (gives, factor)]) > MAX_PRODUCTS:
            raise Ended("incomplete", f"Step {step['name']} is too long.")
        require(_splits(factor, nonzero), f"The factor of step {step['name']} may be zero.")
        rest = sum((a * b for a, b in pairs), gives * 0) - factor * gives
        require(rest.is_zero(), f"The identity of step {step['name']} does not hold.")
        require(step["name"] not in known, "A name is used twice.")
        known[step["name"]] = gives
    return f"{theorem['theorem']}: the identities hold over the rationals, so {steps[-1]['gives'][:200]} = 0."


def _splits(factor: fmpq_mpoly, nonzero: list[fmpq_mpoly]) -> bool:
    """Whether it is a number times powers of what is not zero."""
    for one in nonzero:
        while not one.is_constant() and not factor.is_zero() and (factor % one).is_zero():
            factor = factor / one
    return bool(factor.is_constant() and not factor.is_zero())


def _polynomial(text: str, ring: fmpq_mpoly_ctx) -> fmpq_mpoly:
    """3*x^2*y - 1: a sum of monomials with integer coefficients."""
    table, position, names = dict[tuple[int, ...], int](), 0, ring.names()
    while position < len(text) or not position:
        found = MONOMIAL.match(text, position)
        good = found and (found[1] or not position)
        require(good, f"What stands at column {position + 1} of {text[:40]}… is no monomial.")
        exponents, value = [0] * len(names), -1 if found and found[1] == "-" else 1
        for power in found[2].split("*") if found else ():
            name, _, exponent = power.partition("^")
            if name.isdigit():
                value *= int(name)
            else:
                exponents[names.index(name)] += int(exponent or 1)
        key, position = tuple(exponents), found.end() if found else len(text)
        table[key] = table.get(key, 0) + value
    return ring.from_dict({key: value for key, value in table.items() if value})
