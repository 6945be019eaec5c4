"""The canonical statement of a check: written from the certificates that were found valid, and from
nothing else.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from inverse_service.certificate import checker
from inverse_service.decision import certify
from inverse_service.expressions import printing
from inverse_service.reading import reader

QUESTIONS: Final = {"autonomous": "L(q, q')", "time_dependent": "L(t, q, q')"}
_SAYS: Final = {
    "variational": "there is a regular Lagrangian {}",
    "not_variational": "there is no regular Lagrangian {}",
}


def cell(
    system: Mapping[str, Any],
    verdict: str,
    certificate: Mapping[str, Any],
    proof: checker.CheckResult,
    hamiltonian: Mapping[str, Any] | None = None,
    everywhere: bool = True,
) -> dict[str, Any]:
    """The proven statement on one cell; `everywhere`: H holds on all of its stated domain there."""
    names, proven = certify.names_of_certificate(system, certificate), proof.cell
    texts, latex = certify.domain_of(proven, names)
    lagrangian = certificate.get("lagrangian") if certificate["kind"] == "lagrangian" else None
    return {
        "question": QUESTIONS[certificate["question"]],
        "verdict": verdict,
        "domain": texts,
        "domain_latex": latex,
        "lagrangian_domain": certify.domain_of(proof.formulas, names).texts
        if lagrangian and proof.by_theorem
        else None,
        "by_theorem": proof.by_theorem,
        "timed": certificate["question"] == "time_dependent",
        "one_side": bool(proven and proven.one_side),
        "sides": [] if proven is None else list(proven.sides),
        "near": dict(certificate.get("near") or {}),
        "among": certificate.get("among"),
        "exceptions": list(proof.exceptions) or None,
        "lagrangian": lagrangian,
        "hamiltonian": None if hamiltonian is None else hamiltonian["text"],
        "momenta": None if hamiltonian is None else dict(hamiltonian["momenta"]),
        "hamiltonian_domain": list(hamiltonian.get("domain") or [])
        if hamiltonian and everywhere
        else None,
    }


def of_certificate(certificate: Mapping[str, Any], proof: checker.CheckResult) -> dict[str, Any]:
    """The statement that one certificate proves."""
    system = certificate["system"]
    return _statement(system, cell(system, certificate["claim"], certificate, proof))


def cell_of(statement: Mapping[str, Any]) -> dict[str, Any]:
    return {key: statement[key] for key in ("domain", "near", "verdict")}


def of_cells(
    system: Mapping[str, Any], cells: Sequence[Mapping[str, Any]]
) -> dict[str, Any] | None:
    """The statement of a result: of its main fields, with the other cells in words."""
    if not cells:
        return None
    found = _statement(system, cells[0])
    if len(cells) > 1:
        verdicts = {one["verdict"] for one in cells}
        found["text"] = "\n".join(_words(system, one) for one in cells)
        found["latex"] = " \\\\ ".join(_latex(system, one) for one in cells)
        found["verdict"] = verdicts.pop() if len(verdicts) == 1 else "differs"
    return found


def first_with_words(statements: Sequence[dict[str, Any] | None]) -> dict[str, Any] | None:
    """The first of them, with the words of those after it, as of a motion on constraints; None if
    there are none.
    """
    found = [one for one in statements if one is not None]
    if len(found) < 2:
        return found[0] if found else None
    texts = {
        "text": "\n".join(one["text"] for one in found),
        "latex": " \\\\ ".join(one["latex"] for one in found),
    }
    return found[0] | texts


def _statement(system: Mapping[str, Any], one: Mapping[str, Any]) -> dict[str, Any]:
    shown = {
        key: system.get(key) or []
        for key in ("coordinates", "equations", "parameters", "functions")
    }
    keys = ("question", "verdict", "domain", "near", "lagrangian", "lagrangian_domain", "hamiltonian", "momenta",
            "hamiltonian_domain", "exceptions")  # fmt: skip
    kept = {key: one[key] for key in keys}
    found = {"system": shown} | kept | {"text": _words(system, one), "latex": _latex(system, one)}
    return {key: value for key, value in found.items() if value is not None}


def _words(system: Mapping[str, Any], one: Mapping[str, Any]) -> str:
    equations = ", ".join(f"{name}'' = {text}" for name, text in system["equations"].items())
    rates = ", ".join(
        f"{name}' = {text}" for name, text in (system.get("velocities") or {}).items()
    )
    kind = f" of the kind {one['among']}" if one["among"] is not None else ""
    says = (
        _SAYS[one["verdict"]].format(one["question"]) + kind + " that has this motion" * bool(rates)
    )
    general = f" {in_general(system, one['exceptions'])}" if one["exceptions"] else ""
    near = checker.near_points(system["coordinates"][0], one["timed"]) if one["by_theorem"] else ""
    near = f"{',' * bool(one['domain'])} {near}" if near else ""
    parts = [
        f"For {', '.join(filter(None, (equations, rates)))} {says}{where(one)}{near}{general}."
    ]
    there = f" where {', '.join(one['lagrangian_domain'])}" if one["lagrangian_domain"] else ""
    parts += [f"L = {one['lagrangian']}{there}."] if one["lagrangian"] else []
    if one["hamiltonian"]:
        momenta = ", ".join(f"{name} = {text}" for name, text in one["momenta"].items())
        where_h = (
            f" where {', '.join(one['hamiltonian_domain'])}" if one["hamiltonian_domain"] else ""
        )
        where_h = (
            ", at least on an open part of this set"
            if one["hamiltonian_domain"] is None
            else where_h
        )
        parts.append(f"H = {one['hamiltonian']}{where_h}, with {momenta}.")
    return " ".join(parts)


def in_general(system: Mapping[str, Any], exceptions: Sequence[str]) -> str:
    """For which constants and functions a verdict was proven.

    "for all c1, c2, k, except c1 = c2, k = 0 (not decided here)"; "for general g" alone if the
    exceptions could not be found: the checker says "single values of g" then, next to those found.
    With "special functions F(x)" also "and for a general F(x)".
    """
    excepted = checker.read_exceptions(exceptions)
    functions, values = excepted.functions, excepted.values
    known = "all" if values else "general"
    constants = (
        [", ".join(system.get("parameters") or ())] if len(exceptions) > len(functions) else []
    )
    a = "a " if len(system.get("functions") or ()) == 1 else ""
    general = " and ".join(
        [
            *(f"for {known} {one}" for one in constants),
            *(f"for {a}general {one}" for one in functions),
        ]
    )
    unknown = [f"special values of {names} that are not listed" for names in excepted.not_found]
    left_out = f", except {', '.join([*values, *unknown])} (not decided here)" if values else ""
    return f"{general}{left_out}"


def where(one: Mapping[str, Any]) -> str:
    """Where a cell lies, in words: " where x*y > 0, on the side of x = 1, y = 1"; nothing for all
    that is defined.
    """
    words = "".join(
        c if c.isalnum() or c in "_'" else " " for text in one["domain"] for c in f"{text} "
    ).split()
    point = ", ".join(f"{name} = {value}" for name, value in one["near"].items() if name in words)
    side = f", on the side of {point}" if one["one_side"] and point else ""
    return f" where {', '.join(one['domain'])}{side}" if one["domain"] else ""


def _latex(system: Mapping[str, Any], one: Mapping[str, Any]) -> str:
    names = certify.names_of_certificate(system)
    unsolved = any("''" in text for text in system["equations"].values())
    equations = [
        f"{written} = 0" if unsolved else f"{printing.name_latex(name, 'ddot')} = {written}"
        for name, text in system["equations"].items()
        for written in [printing.to_latex(reader.read_formula(text, names))]
    ]
    return ", \\; ".join([*equations, *one["domain_latex"]])
