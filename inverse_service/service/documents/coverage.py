"""What proves to the checker that the leaves of a family are right and hold all members: the
document of certificate/FAMILIES.md.

Its cells are all sets that the exploration decided. For each, the conditions are named by whose
minors it is parted, or the multiplier of its Lagrangian is given; the checker computes the rest.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from inverse_service.certificate import checker
from inverse_service.expressions import calculus, collecting, printing, terms as tm, tree as ex
from inverse_service.mechanics import euler_lagrange
from inverse_service.service.documents import translate
from inverse_service.solving import regularity

if TYPE_CHECKING:
    from api_schemas import result as schemas
    from inverse_service.constrained.motion_families import FamilyOfMotions
    from inverse_service.explanation.hierarchy import EquationName
    from inverse_service.mechanics.second_order_system import SecondOrderSystem
    from inverse_service.solving.leaves import Leaf
    from inverse_service.solving.members import Family, Found, Open

YES, NO = "variational", "not_variational"
LAST_BRACKET, HALF_TANGENTS = 9, ("0", "1/2")
ANGLE = re.compile(r"(?:sin|cos|tan)\(([A-Za-z]\w*)\)")
PLAIN, TIMED = "autonomous", "time_dependent"


def certificate_of(
    family: Family,
    system: SecondOrderSystem,
    letters: Sequence[str],
    functions: Sequence[str],
    leaves: Sequence[dict[str, Any]],
) -> dict[str, Any]:
    """The certificate of a family with these leaves, as plain data."""
    return {
        "format": checker.FORMAT_OF_FAMILIES,
        "system": translate.plain_fields(system),
        "letters": list(letters),
        "functions": list(functions),
        "cells": [_cell(family, system, one) for one in family.cells],
        "leaves": list(leaves),
        "open": [_open(family, one) for one in family.undecided],
    }


def of_motions(part: schemas.FamilyPart, family: FamilyOfMotions) -> dict[str, Any] | None:
    """The certificate that motions in none of the sets with a Lagrangian, or without an answer,
    have none; None where its rows would be too long.

    Determinants of brackets are short where a velocity is zero and an angle has a value. Few angles
    are enough, as the functions of a family do not depend on them.
    """
    root, last = part.leaves[0], family.last_bracket
    if last is None or last > LAST_BRACKET or root.proof is None:
        return None
    system = root.proof.certificate["system"]
    still = {name for of in part.functions.values() for name in of}
    free = [name for name in system["coordinates"] if name in system["equations"]]
    texts = " ".join((*system["equations"].values(), *system["velocities"].values()))
    angles = {*ANGLE.findall(texts)} & {*system["coordinates"]} - still
    moving = [name for name in free if name not in angles]
    if len(angles) != 1 or len(free) != 2 or not moving:
        return None
    tangent, stopped = f"tan({angles.pop()}/2)", moving[0] + "'"
    sets = [[one.text for one in leaf.equations] for leaf in part.leaves]
    opened = [
        *(texts for texts, leaf in zip(sets, part.leaves, strict=True) if is_with_lagrangian(leaf)),
        *([one.text for one in each.equations] for each in part.open if each.equations),
    ]
    verdicts = [{PLAIN: one.verdict, TIMED: one.verdict_with_time} for one in part.leaves]
    proof = {
        "kind": "brackets",
        "rows": [[str(j), "0", "1"] for j in range(1, last + 1)],
        "points": [{"values": {stopped: "0", tangent: value}} for value in HALF_TANGENTS],
    }
    return {
        "format": checker.FORMAT_OF_FAMILIES,
        "system": system,
        "letters": part.letters,
        "functions": list(part.functions),
        "cells": [{"equations": [], "nonzero": [], **verdicts[0], "proofs": [proof]}],
        "leaves": [
            {"equations": texts, "nonzero": leaf.nonzero, **own}
            for texts, leaf, own in zip(sets, part.leaves, verdicts, strict=True)
        ],
        "open": [{"equations": texts, "nonzero": []} for texts in opened],
    }


def is_with_lagrangian(leaf: schemas.FamilyLeaf) -> bool:
    """Whether its general member has an L, with or without the time."""
    return YES in (leaf.verdict, leaf.verdict_with_time)


def of_the_general_member(certificate: dict[str, Any]) -> dict[str, Any]:
    """What proves the verdict of the general member alone: of the members of all other cells
    nothing is claimed.
    """
    first, *others = certificate["cells"]
    sets = [{*one["equations"]} for one in (*others, *(certificate.get("open") or ()))]
    widest = [one for one in sets if one and not any(other < one for other in sets if other)]
    opened = [{"equations": sorted(one)} for k, one in enumerate(widest) if one not in widest[:k]]
    return certificate | {"cells": [first], "open": opened}


def verdicts_of(found: Found) -> dict[str, Any]:
    return {PLAIN: found.verdict, TIMED: found.timed}


def _cell(family: Family, system: SecondOrderSystem, found: Found) -> dict[str, Any]:
    return _set(found.leaf) | verdicts_of(found) | {"proofs": _proofs(family, system, found)}


def _open(family: Family, one: Open) -> dict[str, Any]:
    around = _set(family.cells[one.inside].leaf)
    return {
        **around,
        "equations": [*around["equations"], *map(printing.to_text, one.equations)],
    }


def _set(leaf: Leaf) -> dict[str, Any]:
    def text(polynomial: Any) -> str:
        return printing.to_text(collecting.collect(leaf.unknowns.tree(polynomial)))

    return {
        "equations": [text(one) for one in leaf.equations],
        "nonzero": [text(one) for one in leaf.nonzero],
    }


def _proofs(family: Family, system: SecondOrderSystem, found: Found) -> list[dict[str, Any]]:
    """A proof for each verdict, as few as cover them."""
    rows = [[_row(family.names[k]) for k in one] for one in dict.fromkeys(found.rows)]
    asked = {PLAIN: found.verdict, TIMED: found.timed}
    if NO in asked.values() and found.kernel == "singular":
        return [{"kind": "rank", "rows": rows}]
    proofs = list[dict[str, Any]]()
    refused = [about for about in (TIMED, PLAIN) if asked[about] == NO]
    if refused:
        kind = _completion(found, rows, refused[0], NO) if found.order else {
            "kind": "factor", "question": refused[0], "rows": rows}  # fmt: skip
        proofs.append(kind)
    given = [about for about in (PLAIN, TIMED) if asked[about] == YES]
    if given:
        proofs.append(_existence(family, system, found, rows, given[0]))
    return proofs


def _completion(
    found: Found, rows: list[list[list[str]]], about: str, claim: str
) -> dict[str, Any]:
    return {
        "kind": "completion", "question": about, "claim": claim,
        "rows": rows[0] if rows else [], "order": list(found.order),
    }  # fmt: skip


def _existence(
    family: Family,
    system: SecondOrderSystem,
    found: Found,
    rows: list[list[list[str]]],
    about: str,
) -> dict[str, Any]:
    n = len(system.coordinates)
    if n == 1:
        return {"kind": "one_coordinate"}
    if found.order:
        return _completion(found, rows, about, YES)
    if found.kernel and found.rows and len(found.rows[0]) == n * (n + 1) // 2 - 1:
        return {"kind": "direction", "question": about, "rows": rows[0]}
    linear = bool(found.rows) and len(found.rows[0]) < 2 and regularity.is_linear_pair(system)
    if linear or (found.system is not None and regularity.has_one_everywhere(found.system)):
        return {"kind": "algebra"}
    if n == 2 and about == TIMED and found.rows and not found.rows[0]:
        return {"kind": "isotropic"}  # also where the L of the general member is singular
    by_lagrangian = _multiplier(family, system, found, about)
    if by_lagrangian is not None and (about == TIMED or not _holds_time(by_lagrangian)):
        return by_lagrangian
    return {"kind": "isotropic"}


def _holds_time(proof: dict[str, Any]) -> bool:
    return any(
        "t" in term["slopes"]
        or any(re.search(r"\bt\b", one) for one in (*term["entries"], *term["slopes"].values()))
        for term in proof["terms"]
    )


def _row(name: EquationName) -> list[str]:
    condition = name.condition
    return [condition.kind.value, str(condition.power), *map(str, name.indices)]


def _multiplier(
    family: Family, system: SecondOrderSystem, found: Found, about: str
) -> dict[str, Any] | None:
    """g of the Lagrangian, up to a factor e^u, with the derivatives of u; None if these are not
    rational.
    """
    answer, member = found.answer, found.system
    if answer is None or answer.lagrangian is None or member is None:
        return None
    hessian = euler_lagrange.hessian(answer.lagrangian.expression, member.coordinates)
    n = len(hessian)
    constants, sums = _constants(found), _sums(found)
    fresh = {name for one in found.solved for name in one.new_constants}
    terms = dict[tm.Monomial, list[list[collecting.Term]]]()
    places = [(i, j) for i in range(n) for j in range(i, n)]
    for place, (i, j) in enumerate(places):
        for monomial, value in collecting.expand(ex.substitute(hessian[i][j], constants)):
            common, rest = _parted(monomial, fresh)
            terms.setdefault(common, [[] for _ in places])[place].append((rest, value))
    names: list[ex.Symbol | ex.Velocity] = [
        ex.TIME,
        *map(ex.Symbol, member.coordinates),
        *map(ex.Velocity, member.coordinates),
    ]
    written = list[dict[str, Any]]()
    for common, entries in terms.items():
        parts = (
            exponent * (base.argument if ex.is_exponential(base) else ex.Apply("log", base))
            for base, exponent in sorted(
                collecting.powers_in_order(common), key=lambda power: ex.is_exponential(power[0])
            )
        )
        u = ex.add(*parts)
        slopes = [collecting.collect(calculus.differentiate(u, name)) for name in names]
        trees = [
            _whole(family, one, sums) for one in (*map(collecting.terms_tree, entries), *slopes)
        ]
        own = (node for one in trees for node in ex.walk(one) if isinstance(node, ex.Arbitrary))
        known = all(node.name in family.unknowns.arguments for node in own)
        if not known or not all(map(_is_rational, trees)):
            return None
        texts = list(map(printing.to_text, trees))
        kept = zip(map(printing.to_text, names), texts[len(entries) :], strict=True)
        written.append(
            {
                "entries": texts[: len(entries)],
                "slopes": {name: text for name, text in kept if text != "0"},
            }
        )
    return {"kind": "multiplier", "question": about, "terms": written}


def _is_rational(tree: ex.Expression) -> bool:
    return not any(
        isinstance(node, ex.Integral)
        or (isinstance(node, ex.Apply) and node.function not in ("sin", "cos", "tan"))
        or (isinstance(node, ex.Power) and not _is_integer(node.exponent))
        for node in ex.walk(tree)
    )


def _is_integer(tree: ex.Expression) -> bool:
    return isinstance(tree, ex.Number) and tree.value.denominator == 1


def _parted(monomial: tm.Monomial, fresh: set[str]) -> tuple[tm.Monomial, tm.Monomial]:
    """(p, r) with the product p r: exponentials, roots and new constants, and the rational rest."""
    common, rest = list[tuple[ex.Expression, Fraction]](), list[tuple[ex.Expression, Fraction]]()
    for base, exponent in monomial:
        if ex.is_exponential(base) or (isinstance(base, ex.Symbol) and base.name in fresh):
            common.append((base, exponent))
            continue
        whole = exponent.numerator // exponent.denominator
        if exponent != whole:
            common.append((base, exponent - whole))
        if whole:
            rest.append((base, Fraction(whole)))
    return frozenset(common), frozenset(rest)


def _constants(found: Found) -> dict[ex.Expression, ex.Expression]:
    """New constants by derivatives of the function they are in, where one is a multiple of it: F''
    = c f(x).
    """
    values = dict[ex.Expression, ex.Expression]()
    for one in found.solved:
        if not isinstance(one.left, ex.Arbitrary) or len(one.left.arguments) != 1:
            continue
        (argument,) = one.left.arguments
        left, right = one.left, one.right
        for order in range(len(one.new_constants)):
            held = [name for name in one.new_constants if ex.holds(right, ex.Symbol(name))]
            if len(held) == 1:
                constant = ex.Symbol(held[0])
                slope = collecting.collect(right / constant)
                if not ex.holds(slope, constant):
                    values[constant] = left / slope
                    break
            right = collecting.collect(calculus.differentiate(right, argument))
            left = ex.Arbitrary(left.name, left.arguments, (order + 1,))
    return values


def _sums(found: Found) -> dict[str, ex.Arbitrary]:
    """F for F_0 and F_1, where F(x, y) = F_0(x) + F_1(y)."""
    return {
        name: one.left
        for one in found.solved
        if isinstance(one.left, ex.Arbitrary) and isinstance(one.right, ex.Sum)
        if all(isinstance(term, ex.Arbitrary) for term in one.right.terms)
        for name in one.new_functions
    }


def _whole(family: Family, tree: ex.Expression, sums: Mapping[str, ex.Arbitrary]) -> ex.Expression:
    """The tree with functions of all arguments that they have in the family; F_0'(x) is F_x where
    F(x, y) = F_0(x) + F_1(y).
    """
    if isinstance(tree, ex.Arbitrary):
        orders = dict(zip(tree.arguments, tree.orders, strict=True))
        name = sums[tree.name].name if tree.name in sums and any(tree.orders) else tree.name
        if name in family.unknowns.arguments:
            whole = family.unknowns.arguments[name]
            return ex.Arbitrary(name, whole, tuple(orders.get(one, 0) for one in whole))
    return ex.rebuild(tree, lambda part: _whole(family, part, sums))
