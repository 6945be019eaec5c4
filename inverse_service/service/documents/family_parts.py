"""The key `family`: which members of a family have a Lagrangian. First the part of a result, then
its check.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from flint import fmpq_mpoly

from api_schemas import result as schemas
from api_schemas.system import FamilyNames, QuestionDocument
from inverse_service import deadline, errors
from inverse_service.certificate import checker
from inverse_service.decision import certify
from inverse_service.decision.solutions import SolveOptions, Statement, Verdict
from inverse_service.expressions import calculus, collecting, polynomials, printing, tree as ex
from inverse_service.field import exact_field
from inverse_service.mechanics import second_order_system
from inverse_service.mechanics.second_order_system import ConstrainedMotion, SecondOrderSystem
from inverse_service.reading import declarations, names as nm, reader
from inverse_service.service.documents import (
    accepting,
    comparison,
    coverage,
    growing,
    stated,
    translate,
)
from inverse_service.service.documents.older_keys import Told

if TYPE_CHECKING:
    from inverse_service.constrained.motion_families import FamilyOfMotions, FoundMotions
    from inverse_service.solving.leaves import Rule, Unknowns
    from inverse_service.solving.members import Family, Found

CHECKING_SECONDS, LEAST_CHECKING_SECONDS, SHARE_OF_REDUCED = 20.0, 1.0, 0.3
SECONDS_WITHOUT_OPEN = 3.0  # to prove that sets that were not split are inside others
SECONDS_FOR_OTHERS = 10.0  # to prove that members of a family of motions have no Lagrangian
SPECIAL_MEMBERS = "the general member has a Lagrangian, its special members are not decided"
NOT_CONFIRMED = "the checker did not confirm that there are no others"
# By the verdicts on L(q, q') and on L(t, q, q'), None where not asked: a yes to the first is one to
# the second, and a no to the second is one to the first.
_SAYS: dict[tuple[Verdict | None, Verdict | None], str] = {
    ("variational", "variational"): "the general member has a Lagrangian L(q, q')",
    ("variational", None): "the general member has a Lagrangian L(q, q')",
    ("not_variational", "variational"): (
        "the general member has a Lagrangian L(t, q, q'), and none without t"
    ),
    (None, "variational"): "the general member has a Lagrangian L(t, q, q')",
    ("not_variational", None): "the general member has no regular Lagrangian L(q, q')",
    ("not_variational", "not_variational"): "the general member has no regular Lagrangian",
    (None, "not_variational"): "the general member has no regular Lagrangian",
}


class OfFamily(NamedTuple):
    """The constants of a family, and its functions with what they depend on."""

    letters: list[str]
    functions: dict[str, list[str]]


def names_of_family(schema: QuestionDocument, system: SecondOrderSystem) -> OfFamily:
    """The constants and functions of the family that a document asks about; InputError for names it
    does not declare.
    """
    own = {name: list(of) for name, of in system.functions}
    if not isinstance(schema.family, FamilyNames):
        return OfFamily(list(system.parameters), own)
    for kind, named, known in (
        ("letters", schema.family.letters, system.parameters), ("functions", schema.family.functions, own)
    ):  # fmt: skip
        for name in named:
            if name not in known:
                what = "constant" if kind == "letters" else "function"
                raise errors.InputError(
                    f"`{name}` is no {what} of the equations.", f"/family/{kind}"
                )
    for name, of in schema.family.functions.items():
        if [*declarations.declared_arguments(name, of)] != own[name]:
            called = stated.call_of(name, own[name], system.names)
            raise errors.InputError(
                f"`{name}` is declared as `{called}`.", f"/family/functions/{name}"
            )
    return OfFamily(
        list(schema.family.letters), {name: own[name] for name in schema.family.functions}
    )


def with_family(
    told: Told,
    system: SecondOrderSystem,
    schema: QuestionDocument,
    asked: SolveOptions,
    grow: growing.Growing,
    end: float,
) -> Told:
    """With the leaves of the family of its system."""
    from inverse_service.solving import leaves, members

    letters, functions = names_of_family(schema, system)
    answers: list[Statement | None] = []
    grow.begin("family")
    limit = deadline.now() + comparison.SHARE_OF_SOLVER * (end - deadline.now())
    try:
        found = members.explore(system, letters, list(functions), asked, limit, grow.stage)
        part = checked_part(found, system, letters, functions, end)
        answers = [one.answer for one in found.leaves]
    except leaves.NOT_COMPUTED as problem:
        opened = schemas.OpenSet(reason=f"the conditions could not be computed: {problem}")
        part = schemas.FamilyPart(
            letters=letters, functions=functions, leaves=[], open=[opened], covered=False
        )
    return _with_part(told, part, answers)


def _with_part(told: Told, part: schemas.FamilyPart, answers: Sequence[Statement | None]) -> Told:
    """With the key `family`, and the statements about its sets, one of the answers for each."""
    fields, asked = translate.as_plain_data(part), told.first.question.timed
    formulas = [None if one is None else one.formula for one in answers]
    members = tuple(stated.in_family(fields, told.main, asked, formulas))
    return replace(told.also(family=fields), members=members)


def with_family_of_motion(
    told: Told,
    motion: ConstrainedMotion,
    schema: QuestionDocument,
    asked: SolveOptions,
    grow: growing.Growing,
    end: float,
    answers: Sequence[Statement],
) -> Told:
    """With the sets of motions that have a Lagrangian of any associated system; `answers` are those
    about the general member.
    """
    from inverse_service.constrained import motion_families
    from inverse_service.solving import leaves

    letters, functions = names_of_family(schema, motion_families.as_system(motion))
    grow.begin("family")
    limit = deadline.now() + comparison.SHARE_OF_SOLVER * (end - deadline.now())
    try:
        known = _sets_of_reduced(motion, letters, list(functions), asked, limit)
        found = motion_families.explore(
            motion, letters, list(functions), asked, limit, known, answers, grow.stage
        )
        told_leaves = [_leaf_of_motions(found, number) for number in range(len(found.leaves))]
        shown = [_shown(one) for one in found.leaves]
        opened = [
            schemas.OpenSet(
                inside=inside,
                equations=list(map(_equation, trees)),
                reason="the general member is not decided",
            )
            for inside, trees in found.undecided
        ]
        opened.append(schemas.OpenSet(reason=found.reason_of_others))
        part = schemas.FamilyPart(
            letters=letters, functions=functions, leaves=told_leaves, open=opened, covered=False
        )
        part = _without_others(part, found, end)
    except leaves.NOT_COMPUTED as problem:
        shown = []
        opened = [schemas.OpenSet(reason=f"the conditions could not be computed: {problem}")]
        part = schemas.FamilyPart(
            letters=letters, functions=functions, leaves=[], open=opened, covered=False
        )
    return _with_part(told, part, shown)


def _without_others(
    part: schemas.FamilyPart, family: FamilyOfMotions, end: float
) -> schemas.FamilyPart:
    """With the proof that all members outside the sets with a Lagrangian have none, if the checker
    finds one: of the special members of these sets nothing is claimed.
    """
    certificate = coverage.of_motions(part, family)
    if certificate is None:
        return part
    left = min(SECONDS_FOR_OTHERS, deadline.left(end, LEAST_CHECKING_SECONDS))
    if checker.check_certificate(certificate, time_limit=left).verdict != "valid":
        return part
    special = [
        schemas.OpenSet(inside=leaf.id, equations=list(leaf.equations), reason=SPECIAL_MEMBERS)
        for leaf in part.leaves
        if coverage.is_with_lagrangian(leaf)
    ]
    opened = [*special, *(one for one in part.open if one.equations)]
    return part.model_copy(update={"certificate": certificate, "checked": "valid", "open": opened})


def _sets_of_reduced(
    motion: ConstrainedMotion,
    letters: Sequence[str],
    functions: Sequence[str],
    asked: SolveOptions,
    end: float,
) -> list[tuple[ex.Expression, ...]]:
    """The equations of the leaves of the reduced system's family, if there is such a system."""
    from inverse_service.constrained import reduced
    from inverse_service.solving import leaves, members

    system = reduced.reduced_system(motion)
    if system is None:
        return []
    limit = deadline.now() + SHARE_OF_REDUCED * (end - deadline.now())
    try:
        family = members.explore(system, letters, functions, asked, limit)
    except leaves.NOT_COMPUTED:
        return []
    return [
        tuple(map(family.unknowns.tree, one.leaf.equations))
        for one in family.leaves
        if one.leaf.rules
    ]


def checked_part(
    family: Family,
    system: SecondOrderSystem,
    letters: Sequence[str],
    functions: Mapping[str, Sequence[str]],
    end: float,
) -> schemas.FamilyPart:
    """The leaves with the checker's verdict on their certificate; they cover the family only if it
    agrees.
    """
    part = family_part(family, letters, functions)
    if not family.leaves:
        return part
    leaves = [
        {
            "equations": [one.text for one in leaf.equations],
            "nonzero": leaf.nonzero,
            **coverage.verdicts_of(found),
        }
        for leaf, found in zip(part.leaves, family.leaves, strict=True)
    ]
    certificate = coverage.certificate_of(family, system, letters, list(functions), leaves)

    def reasons_against(
        claim: dict[str, Any], seconds: float = CHECKING_SECONDS, share: float = 1.0
    ) -> tuple[str, ...]:
        """() if the checker finds the claim valid."""
        left = min(seconds, share * deadline.left(end, LEAST_CHECKING_SECONDS))
        proof = checker.check_certificate(claim, time_limit=left)
        return () if proof.verdict == "valid" else (proof.verdict, *proof.reasons)

    if family.undecided:
        # The checker's cases may show that sets that were not split are inside others.
        whole = certificate | {"open": []}
        if not reasons_against(whole, SECONDS_WITHOUT_OPEN):
            return part.model_copy(
                update={"certificate": whole, "checked": "valid", "open": [], "covered": True}
            )
    # With open sets the rest is for the general member alone.
    against = reasons_against(certificate, share=0.5 if family.undecided else 1.0)
    if not against:
        return part.model_copy(update={"certificate": certificate, "checked": "valid"})
    verdict, reason = against[:2]
    opened = part.open or [schemas.OpenSet(reason=f"{NOT_CONFIRMED}: {reason.rstrip('.')}")]
    found: dict[str, Any] = {"open": opened, "covered": False, "checked": verdict}
    general = coverage.of_the_general_member(certificate)
    if general["open"] and not reasons_against(general):
        found |= {"certificate": general, "checked": "valid"}
    return part.model_copy(update=found)


def family_part(
    family: Family, letters: Sequence[str], functions: Mapping[str, Sequence[str]]
) -> schemas.FamilyPart:
    opened = [
        schemas.OpenSet(
            inside=one.inside,
            equations=[_equation(tree) for tree in one.equations],
            reason=one.reason,
        )
        for one in family.open
    ]
    return schemas.FamilyPart(
        letters=list(letters),
        functions={name: list(of) for name, of in functions.items()},
        leaves=[_leaf(family, number) for number in range(len(family.leaves))],
        open=opened,
        covered=family.covered,
    )


def _leaf(family: Family, number: int) -> schemas.FamilyLeaf:
    found, answer = family.leaves[number], family.leaves[number].answer
    fields = translate.answer_fields(answer) if answer is not None else {}
    kept = {
        key: fields[key]
        for key in ("lagrangian", "hamiltonian", "integrals", "near")
        if key in fields
    }
    return schemas.FamilyLeaf(
        **_set_fields(family, number),
        proof=_proof(found, answer),
        proof_without_time=_proof(found, found.without_time),
        **kept,
    )


def _set_fields(family: Family | FamilyOfMotions, number: int) -> dict[str, Any]:
    """What a leaf of systems or of motions says of its members, without a proof."""
    every: Sequence[Found | FoundMotions] = family.leaves
    found, unknowns = every[number], family.unknowns
    verdict = found.verdict or found.timed
    assert verdict is not None, "each leaf answers a question"
    return {
        "id": number,
        "inside": found.inside,
        "equations": [leaf_equation(unknowns, rule) for rule in found.leaf.shown],
        "nonzero": [
            printing.to_text(collecting.collect(unknowns.tree(one))) for one in found.leaf.nonzero
        ],
        "solved": [
            schemas.SolvedPart(
                text=f"{printing.to_text(one.left)} = {printing.to_text(one.right)}",
                latex=f"{printing.to_latex(one.left)} = {printing.to_latex(one.right)}",
                new_constants=list(one.new_constants),
                new_functions=list(one.new_functions),
            )
            for one in found.solved
        ],
        "verdict": verdict,
        "verdict_with_time": found.timed,
        "statement": _SAYS[found.verdict, found.timed],
        "exceptions": [k for k, one in enumerate(every) if one.inside == number],
    }


def _shown(found: FoundMotions) -> Statement | None:
    """Its answer with a Lagrangian, if there is one."""
    return min(found.answers, key=lambda one: one.lagrangian is None, default=None)


def _leaf_of_motions(family: FamilyOfMotions, number: int) -> schemas.FamilyLeaf:
    """A set of motions; a Lagrangian of its general member is one of some associated system."""
    from inverse_service.constrained import motion_families

    found = family.leaves[number]
    shown, proof = _shown(found), None
    if shown is not None and found.motion is not None:
        sides = translate.plain_fields(motion_families.as_system(found.motion))
        proof = schemas.LeafProof(
            equations=sides["equations"],
            parameters=sides["parameters"],
            functions=sides["functions"],
            certificate=translate.as_plain_data(shown.certificate),
            checked="valid",
            exceptions=list(shown.exceptions),
        )
    lagrangian = None if shown is None else shown.lagrangian
    return schemas.FamilyLeaf(
        **_set_fields(family, number),
        proof=proof,
        lagrangian=None if lagrangian is None else translate.lagrangian_part(lagrangian),
    )


def _proof(found: Found, answer: Statement | None) -> schemas.LeafProof | None:
    system = found.system
    if answer is None or system is None or answer.certificate is None or answer.checked != "valid":
        return None
    fields = translate.plain_fields(second_order_system.branches_of(system)[0])
    return schemas.LeafProof(
        equations=fields["equations"],
        parameters=fields.get("parameters") or [],
        functions=fields.get("functions") or {},
        certificate=translate.as_plain_data(answer.certificate),
        checked="valid",
        domain=certify.shortest(answer.domain.positive, answer.domain.nonzero),
        exceptions=list(answer.exceptions),
    )


def leaf_equation(unknowns: Unknowns, rule: Rule) -> schemas.LeafEquation:
    """leader = value if that is short, else both sides with positive coefficients, else p = 0."""
    leader, degree = unknowns.ring.trees[rule.leader], rule.degree
    text = None
    if degree == 1 and not unknowns.unknowns_in(rule.initial) and rule.initial.is_constant():
        value = collecting.collect(
            unknowns.tree(
                -(rule.equation - rule.initial * rule.equation.context().gen(rule.leader))
                / rule.initial.leading_coefficient()
            )
        )
        text = leader, value
    elif (
        all(k in unknowns.letters for k in unknowns.unknowns_in(rule.equation))
        and not unknowns.inner
    ):
        text = _sides(unknowns, rule)
    left, right = (
        text
        if text is not None
        else (collecting.collect(unknowns.tree(_integral(rule.equation))), ex.ZERO)
    )
    return schemas.LeafEquation(
        text=f"{printing.to_text(left)} = {printing.to_text(right)}",
        latex=f"{printing.to_latex(left)} = {printing.to_latex(right)}",
        leader=printing.to_text(leader),
    )


def _integral(polynomial: fmpq_mpoly) -> fmpq_mpoly:
    """The multiple with integer coefficients without a common factor."""
    content = polynomials.factor_polynomial(polynomial)[0]
    denominators = [polynomials.as_fraction(value) for _, value in polynomial.terms()]
    scale = 1
    for value in denominators:
        scale = scale * value.denominator // _gcd(scale, value.denominator)
    return polynomial * scale if content else polynomial


def _gcd(a: int, b: int) -> int:
    return a if not b else _gcd(b, a % b)


def _sides(unknowns: Unknowns, rule: Rule) -> tuple[ex.Expression, ex.Expression]:
    whole = _integral(rule.equation)
    owner = whole.context()
    left = owner.from_dict({e: v for e, v in whole.terms() if v > 0})
    right = owner.from_dict({e: -v for e, v in whole.terms() if v < 0})
    if left.is_zero():
        left, right = right, left
    return unknowns.tree(left), unknowns.tree(right)


def _equation(tree: ex.Expression) -> schemas.Formula:
    return schemas.Formula(
        text=f"{printing.to_text(tree)} = 0", latex=f"{printing.to_latex(tree)} = 0"
    )


# What `check` makes again from the document: the system of the general member of a leaf.


def system_of_leaf(document: Any, leaf: Mapping[str, Any]) -> SecondOrderSystem | None:
    """The document's system with the solved constants and functions of a leaf put in; None if they
    cannot be read.
    """
    try:
        system = second_order_system.branches_of(_system_of(document))[0]
        for part in leaf.get("solved") or ():
            system = _put_in(system, part)
    except (errors.InputError, KeyError, ValueError, TypeError, AttributeError, ZeroDivisionError):
        return None
    return second_order_system.branches_of(system)[0]


def _system_of(document: Any) -> SecondOrderSystem:
    """The system of a document, or the right sides of its motion on constraints; InputError."""
    plain = accepting.prepared(document).document
    if not (accepting.is_nonholonomic(plain) or accepting.is_motion(plain)):
        return accepting.to_system(accepting.to_schema(plain))
    from inverse_service.constrained import motion_families
    from inverse_service.service.documents import motion_documents

    return motion_families.as_system(motion_documents.motion_of(plain))


def document_of_leaf(document: Any, leaf: Mapping[str, Any]) -> dict[str, Any] | None:
    """The document with constraints whose motion is the general member of a leaf; None if the leaf
    cannot be read.
    """
    from inverse_service.service.documents import motion_documents

    plain = accepting.prepared(document).document
    moving = system_of_leaf(document, leaf)
    if moving is None:
        return None
    solved, system = list[Any](), _system_of(document)
    for part in leaf.get("solved") or ():
        solved.append(_read_solved(system, part))
        system = _put_in(system, part)
    return motion_documents.with_put_in(plain, moving, lambda tree: _with_all(tree, solved))


def _put_in(system: SecondOrderSystem, part: Mapping[str, Any]) -> SecondOrderSystem:
    from inverse_service.solving import closed_members

    solved = _read_solved(system, part)
    if isinstance(solved.left, ex.Symbol):
        return second_order_system.with_values(system, {solved.left: solved.right})
    return closed_members.with_function(system, solved)


def _read_solved(system: SecondOrderSystem, part: Mapping[str, Any]) -> Any:
    """One line of `solved` as trees: a = ..., or F(x, y) = ..."""
    from inverse_service.solving.closed_members import Solved

    left, right = part["text"].split(" = ")
    fresh, functions = tuple(part.get("new_constants") or ()), dict(system.functions)
    names = nm.Names(system.coordinates, (*system.parameters, *fresh), functions)
    whole = reader.read_formula(left, names)
    if isinstance(whole, ex.Symbol):
        if whole.name not in system.parameters:
            raise ValueError
        return Solved(whole, reader.read_formula(right, names))
    if not isinstance(whole, ex.Arbitrary) or any(whole.orders):
        raise ValueError
    if whole != reader.read_formula(f"{whole.name}({', '.join(functions[whole.name])})", names):
        raise ValueError  # x_dot is x' in formulas
    new = tuple(part.get("new_functions") or ())
    if new:  # F(x, y) = F(x), or F_0(x) + F_1(y)
        value = next(
            (one for one in _general_solutions(whole, new) if printing.to_text(one) == right), None
        )
        taken = {*functions, *system.parameters, *system.coordinates, "t"}
        are_fresh = len({*new}) == len(new) and taken.isdisjoint(new)
        if value is None or not (new == (whole.name,) or are_fresh):
            raise ValueError
        return Solved(whole, value, fresh, new)
    return Solved(whole, reader.read_formula(right, names), fresh)


def _general_solutions(whole: ex.Arbitrary, names: Sequence[str]) -> Iterator[ex.Expression]:
    """What a function may be whose derivative of as many orders as there are names is 0."""
    from inverse_service.solving import closed_members

    for orders in itertools.product(range(len(names) + 1), repeat=len(whole.arguments)):
        found = closed_members.general_solution(whole, orders, names)
        if found is not None:
            yield found


def follows(document: Any, leaf: Mapping[str, Any]) -> bool | None:
    """Whether the solved members of a leaf are just those with its equations; None if this is not
    decided.

    Every equation is zero with the solved constants and functions put in. Conversely there is one
    equation for each of them, which determines it: linear in a constant or function, or F_y = 0 for
    F(x, y) = F(x).
    """
    from inverse_service.solving import closed_members

    system = _system_of(document)
    names = system.names
    trees = [
        reader.read_formula("-".join(f"({side})" for side in one["text"].split(" = ")), names)
        for one in leaf["equations"]
    ]
    solved, moving = list[Any](), system
    for part in leaf["solved"]:
        solved.append(_read_solved(moving, part))
        last = solved[-1]
        moving = (
            second_order_system.with_values(moving, {last.left: last.right})
            if isinstance(last.left, ex.Symbol)
            else closed_members.with_function(moving, last)
        )
    for tree in trees:
        left = _with_all(tree, solved)
        is_zero = left == ex.ZERO or _is_zero(left)
        if not is_zero:
            return None if _has_roots(left) else is_zero
    if len(trees) != len(solved):
        return False
    determined = 0
    for place, one in enumerate(solved):
        # V(x) = ... is about V(x, y) = V(x), which has to be determined without it.
        others = [
            other
            for k, other in enumerate(solved)
            if k < place or (k > place and not _is_same(other, one))
        ]
        determined += any(_determines(_with_all(tree, others), one) for tree in trees)
    return True if determined == len(solved) else None


def is_written_otherwise(system: SecondOrderSystem, equations: object) -> bool | None:
    """Whether equations are those of the system, however they are written; None if roots in them
    may hide that they are.
    """
    if not isinstance(equations, Mapping) or sorted(equations) != sorted(system.coordinates):
        return False
    for name, force in zip(system.coordinates, system.accelerations, strict=True):
        try:
            left = reader.read_formula(equations[name], system.names)
        except (errors.InputError, TypeError):
            return False
        difference = collecting.collect(left - force)
        if difference != ex.ZERO and not _is_zero(difference):
            return None if _has_roots(difference) else False
    return True


def _has_roots(tree: ex.Expression) -> bool:
    """Whether it holds roots, which may depend on each other, so that it may be zero all the same."""
    return any(
        isinstance(node, ex.Power)
        and not (isinstance(node.exponent, ex.Number) and node.exponent.value.denominator == 1)
        for node in ex.walk(tree)
    )


def _is_same(one: Any, other: Any) -> bool:
    """Whether two solved parts are about the same function."""
    names = [part.left.name for part in (one, other) if isinstance(part.left, ex.Arbitrary)]
    return len(names) == 2 and names[0] == names[1]


def _with_all(tree: ex.Expression, solved: Sequence[Any]) -> ex.Expression:
    from inverse_service.solving import closed_members

    for one in solved:
        if isinstance(one.left, ex.Symbol):
            tree = ex.substitute(tree, {one.left: one.right})
        else:
            tree = closed_members.put_function(tree, one)
    return collecting.collect(tree)


def _is_zero(tree: ex.Expression) -> bool | None:
    """Whether the tree is zero as a rational function of its atoms; None if that is not decided."""
    try:
        names = [
            node
            for node in ex.walk(tree)
            if isinstance(node, ex.Symbol | ex.Velocity) and node != ex.PI
        ]
        ring = exact_field.exact_ring(
            [tree], list(dict.fromkeys(names)), None, exact_field.Budget.long()
        )
        return bool(ring.value(tree).is_zero)
    except (exact_field.TooLarge, ZeroDivisionError, KeyError):
        return None


def _determines(tree: ex.Expression, solved: Any) -> bool:
    """Whether an equation determines this constant or function, the others being put in."""
    from inverse_service.solving import closed_members

    left = solved.left
    if isinstance(left, ex.Symbol):
        slope = collecting.collect(calculus.differentiate(tree, left))
        return slope != ex.ZERO and not ex.holds(slope, left)
    nodes = {
        node for node in ex.walk(tree) if isinstance(node, ex.Arbitrary) and node.name == left.name
    }
    if solved.new_functions:
        (node,) = nodes if len(nodes) == 1 else (None,)
        return (
            node is not None
            and tree in (node, -node)
            and solved.right
            == closed_members.general_solution(left, node.orders, solved.new_functions)
        )
    orders = max((sum(node.orders) for node in nodes), default=0)
    tops = [node for node in nodes if sum(node.orders) == orders]
    if (
        len(tops) != 1
        or len(solved.new_constants) != orders
        or (orders and len(left.arguments) > 1)
    ):
        return False
    letter = ex.Symbol("the_leader")
    slope = collecting.collect(
        calculus.differentiate(ex.substitute(tree, {tops[0]: letter}), letter)
    )
    return slope != ex.ZERO and not ex.holds(slope, letter)
