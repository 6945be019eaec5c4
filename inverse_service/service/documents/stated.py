"""The statements of a result: their order, their form in the key `answers`, and their reader.

`entries` writes statements as `answers`. The older keys have a place for each question too (the
main fields, `with_time`, `branches`, `any_associated`, `nonholonomic.associated`, `reduced`,
`with_clock`, `kinds`, `instead`, `left_out`): `older_keys` writes them, and `statements_of` reads
statements back from them, which stored results of older programs have alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.expressions import refusals, tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.statements import stages
from inverse_service.statements.order import Standing, in_order
from inverse_service.statements.questions import About, Question
from inverse_service.statements.reasons import Reason
from inverse_service.statements.stages import Part

QUESTION_WITH_TIME = "L(t, q, q')"
NOT_FOUND = "No Lagrangian was found in closed form."
LONGER = 6  # times as long as what people type may be what we printed
_UNREADABLE = 3  # the form of an L that cannot be read again
_FORMULAS = ("lagrangian", "hamiltonian", "dissipation")
_DECLARED = ("parameters", "functions")
# The verdicts of a place: that of its question, and that on L(t, q, q').
VERDICTS = ("verdict", "verdict_with_time")
# What belongs to the Lagrangian of an answer, not to its verdict.
_OF_LAGRANGIAN = (*_FORMULAS, "other_lagrangians", "multiplier", "integrals", "image", "freedom")
# What an answer that follows from another one does not repeat.
_ONCE = (
    "other_lagrangians",
    "multiplier",
    "solution_space",
    "first_integrals",
    "explanation",
    "details",
    "construction",
)
_REPEATED = ("time", "reduced")  # kinds of `instead` that repeat other fields
# Of an entry of `answers`: what is there even if it is empty, and what one says that follows from
# another entry.
_ALWAYS = frozenset(("domain", "lagrangian", "hamiltonian", "checked", "open", "with_time", "cell"))
_OF_FOLLOWING = frozenset(
    (
        "about",
        "with_time",
        "conditions",
        "cell",
        "verdict",
        "domain",
        "exceptions",
        "checked",
        "follows",
    )
)
_EMPTY: tuple[Any, ...] = ("", None, [], {})
_ALONG_CONSTRAINTS = ("on_constraints", "transverse_momenta")  # of the L of a motion
_PARTS = {About.ANY: Part.ANY_ASSOCIATED, About.REDUCED: Part.REDUCED}


@dataclass(frozen=True, slots=True)
class Stated:
    """An answer: its question, the fields that give it, where they are (a JSON pointer), on which
    cell it holds, and its L, which only a stored result has as a text alone.
    """

    question: Question
    part: Mapping[str, Any]
    at: str = ""
    cell: int = 0
    formula: ex.Expression | None = None

    @property
    def verdict(self) -> str:
        return str(self.part["verdict"])


class Verdicts(NamedTuple):
    """The verdict on the question of a place, and that on L(t, q, q'); None where it has none."""

    asked: Any
    timed: Any


def verdicts_of(part: Mapping[str, Any]) -> Verdicts:
    """The two verdicts of a place in a result."""
    return Verdicts(*map(part.get, VERDICTS))


def branches_of(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The answers on each branch; the result itself where there is one."""
    return result.get("branches") or [result]


def open_cells_of(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The cells without an answer; not the sets that only the domain of an answer leaves out."""
    return [
        one
        for one in result.get("not_answered") or ()
        if one.get("reason_code") != Reason.OUTSIDE_DOMAIN
    ]


def asks_for_time(result: Mapping[str, Any]) -> bool:
    """Whether the main fields answer L(t, q, q')."""
    return bool(result.get("question") == QUESTION_WITH_TIME)


def is_constrained(result: Mapping[str, Any]) -> bool:
    """Whether the result is about a motion on constraints."""
    return bool(result.get("nonholonomic") or result.get("any_associated"))


def call_of(name: str, arguments: Sequence[str], names: Names) -> str:
    """A function as it stands in formulas: F(x, x') for one that is declared with x and x_dot."""
    speeds = {f"{one}_dot": f"{one}'" for one in names.coordinates}
    return f"{name}({', '.join(speeds.get(one, one) for one in arguments)})"


def names_of(system: Mapping[str, Any] | None, integrals: Mapping[str, Any] | None = None) -> Names:
    """The names of a result's system or of a document; momenta, entries of the multiplier and L, H
    are parameters.

    `integrals` are functions that an answer has besides.
    """
    if system is None:
        return Names(parameters=("L", "H"))
    equations, given = system.get("equations"), system.get("parameters") or ()
    coordinates = tuple(
        system.get("coordinates") or (equations if isinstance(equations, Mapping) else ())
    )
    n = len(coordinates)
    entries = [
        f"{letter}_{i}{j}" for letter in "gh" for i in range(1, n + 1) for j in range(i, n + 1)
    ]
    functions = {
        name: tuple(arguments) for name, arguments in (system.get("functions") or {}).items()
    }
    functions |= {name: tuple(known["arguments"]) for name, known in (integrals or {}).items()}
    parameters = () if isinstance(given, str) else given  # "guess"
    words = (
        system.get("time", "t"),
        *parameters,
        *(f"p_{name}" for name in coordinates),
        *entries,
        *(name for known in (integrals or {}).values() for name in known["arguments"]),
        "L",
        "H",
    )
    taken = {*coordinates, *(f"{name}'" for name in coordinates), *functions, "t"}
    return Names(
        coordinates, tuple(dict.fromkeys(word for word in words if word not in taken)), functions
    )


# The reader.


def statements_of(result: Mapping[str, Any]) -> list[Stated]:
    """All statements of a result, beginning with the one that a person is shown.

    They are in the order of its `answers` if it has them; results that an older program stored have
    none.
    """
    found = list(_found(result))
    if listed := result.get("answers"):
        places = {(question_of(one), one.get("cell", 0)): place for place, one in enumerate(listed)}
        return sorted(found, key=lambda one: places.get((one.question, one.cell), len(places)))
    if len({*map(_text_of_lagrangian, found)} - {""}) > 1:  # of one L the form decides nothing
        found = [_with_formula(one, result.get("system")) for one in found]
    return in_reading_order(found, result)


def in_reading_order(found: Sequence[Stated], result: Mapping[str, Any]) -> list[Stated]:
    """The statements of a result, beginning with the one that a person is shown."""

    def standing(one: Stated) -> Standing:
        form = _UNREADABLE if _shows_lagrangian(one) else None
        if form is not None and one.formula is not None:
            form = ex.reading_class(one.formula, ex.TIME)
        return Standing(one.question, one.verdict, one.cell, form)

    return in_order(found, asks_for_time(result), standing)


def _shows_lagrangian(one: Stated) -> bool:
    return bool(_text_of_lagrangian(one))


def _text_of_lagrangian(one: Stated) -> str:
    return str((one.part.get("lagrangian") or {}).get("text") or "")


def main_statements(result: Mapping[str, Any], cell: int = 0) -> list[Stated]:
    """The statements about the equations themselves on a cell: on L(q, q') and on L(t, q, q')."""
    about = about_main(result)
    found = [
        one for one in statements_of(result) if one.cell == cell and one.question.about is about
    ]
    return [one for one in found if not one.question.is_about_others]


def first_answer(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """The fields of the answer that a reader meets first; a result without a question is its
    own.
    """
    asked = result.get("verdict") and "question" in result
    return statements_of(result)[0].part if asked else result


def about_main(result: Mapping[str, Any]) -> About:
    return (
        about_of((result.get("nonholonomic") or {}).get("main", "first"))
        if is_constrained(result)
        else About.MAIN
    )


def about_of(kind: str) -> About:
    """The associated system of this name; one with a family of multiples is the asker's own."""
    return About(kind) if kind in (About.FIRST, About.SECOND, About.THIRD) else About.OWN


def _found(result: Mapping[str, Any]) -> Iterator[Stated]:
    held, asked, about = (
        result.get("nonholonomic") or {},
        asks_for_time(result),
        about_main(result),
    )
    for cell, branch in enumerate(branches_of(result)):
        at = f"/branches/{cell}" if result.get("branches") else ""
        yield Stated(Question(about, asked), branch, at, cell)
        later, other = branch.get("verdict_with_time"), branch.get("with_time")
        if other:
            yield Stated(Question(about, timed=True), other, f"{at}/with_time", cell)
        elif later is not None and not asked:  # the same proof
            yield Stated(Question(about, timed=True), following(branch, later), at, cell)
        if motion := branch.get("any_associated"):
            yield from both(About.ANY, motion, f"{at}/any_associated", cell, asked)
    for place, one in enumerate(held.get("associated") or ()):
        if one["defined"] and one["kind"] != held.get("main"):
            yield from both(
                about_of(one["kind"]), one, f"/nonholonomic/associated/{place}", 0, asked
            )
    motion, branches = result.get("any_associated"), result.get("branches") or ()
    if motion and branches and not any(branch.get("any_associated") for branch in branches):
        yield from both(About.ANY, motion, "/any_associated", 0, asked)
    reduced = result.get("reduced") or {}
    if reduced:
        yield Stated(Question(About.REDUCED, is_timed(reduced, asked)), reduced, "/reduced")
    for of, clock, at in (
        (About.MAIN, result.get("with_clock"), "/with_clock"),
        (About.REDUCED, reduced.get("with_clock"), "/reduced/with_clock"),
    ):
        if clock:
            yield Stated(Question(of, clock=clock["factor"] or "search"), clock, at)
    yield from _asked_besides(result, asked)
    yield from in_family(result.get("family"), about, asked)


def _asked_besides(result: Mapping[str, Any], asked: bool) -> Iterator[Stated]:
    """The answers about kinds of Lagrangians and about special values of the parameters."""
    about, kinds, instead = (
        about_main(result),
        result.get("kinds") or {},
        result.get("instead") or {},
    )
    for name, part in kinds.items():
        yield Stated(Question(about, is_timed(part, asked), kind=name), part, f"/kinds/{name}")
    if instead and instead["kind"] not in (*_REPEATED, *kinds):
        kind, case = (
            ("", instead["conditions"]) if instead.get("conditions") else (instead["kind"], ())
        )
        question = Question(about, is_timed(instead), kind=kind, case=tuple(case))
        yield Stated(question, {**instead, "verdict": "variational"}, "/instead")
    for place, part in enumerate(result.get("left_out") or ()):
        if part["decided"]:
            question = Question(about, is_timed(part, asked), case=(part["where"]["text"],))
            yield Stated(question, part, f"/left_out/{place}")


def in_family(
    family: Mapping[str, Any] | None,
    about: About,
    asked: bool,
    formulas: Sequence[ex.Expression | None] = (),
) -> Iterator[Stated]:
    """The answers about the sets of a family, which has its own key; the L of each set, if known."""
    leaves = (family or {}).get("leaves") or ()
    for place, (leaf, formula) in enumerate(zip_longest(leaves, formulas)):
        if leaf["inside"] is not None:
            at, later = f"/family/leaves/{place}", leaf.get("verdict_with_time")
            part = leaf | _of_proof(leaf.get("proof"))
            where = (
                *(one["text"] for one in leaf["equations"]),
                *solutions_in(leaf),
                *(f"{one} != 0" for one in leaf["nonzero"]),
            )
            if asked or later is None or leaf["verdict"] != "variational" or not is_timed(part):
                yield from both(about, part, f"{at}/proof", 0, asked, where, formula)
                continue
            # Its L contains t; that there is one without has a proof of its own.
            plain = {key: value for key, value in _without_formulas(leaf).items() if key != "near"}
            plain |= _of_proof(leaf.get("proof_without_time"))
            yield Stated(Question(about, case=where), plain, f"{at}/proof_without_time")
            timed = Question(about, timed=True, case=where)
            yield Stated(timed, part | {"verdict": later}, f"{at}/proof", 0, formula)


def _of_proof(proof: Mapping[str, Any] | None) -> dict[str, Any]:
    """What an answer about a set of a family has of its proof."""
    kept = ("certificate", "checked", "domain", "exceptions")
    return {key: proof[key] for key in kept if key in proof} if proof else {"exceptions": []}


def solutions_in(leaf: Mapping[str, Any]) -> list[str]:
    """What is put in for constants and functions, where its L is written with that: V(x, y) =
    V_0(x) + V_1(y) for V_xy = 0, and which root is taken.
    """
    equations = {one["text"] for one in leaf["equations"]}
    return [
        part["text"]
        for part in leaf["solved"]
        if part["text"] not in equations
        and (part["new_constants"] or part["new_functions"] or leaf.get("lagrangian"))
    ]


def both(
    about: About,
    part: Mapping[str, Any],
    at: str,
    cell: int,
    asked: bool,
    case: tuple[str, ...] = (),
    formula: ex.Expression | None = None,
) -> Iterator[Stated]:
    """The answers to both questions, where one place has them; its L, the `formula`, belongs to the
    first that is a yes.
    """
    verdict, later = verdicts_of(part)
    if verdict is None:
        return
    has_plain = asked or verdict == "variational" or later != "variational"
    plain = part if has_plain else _without_formulas(part)
    yield Stated(Question(about, asked, case=case), plain, at, cell, formula)
    if later is not None and not asked:
        timed = {**part, "verdict": later} if not has_plain else following(part, later)
        yield Stated(Question(about, timed=True, case=case), timed, at, cell, formula)


def following(part: Mapping[str, Any], verdict: str) -> dict[str, Any]:
    """The answer on L(t, q, q') by the proof of the one on L(q, q'): an L without t is an L,
    too.
    """
    kept = {key: value for key, value in part.items() if key not in _ONCE}
    same = verdict == part["verdict"]
    return (kept if same else _without_formulas(kept)) | {"verdict": verdict}


def _without_formulas(part: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in part.items() if key not in _OF_LAGRANGIAN}


def is_timed(part: Mapping[str, Any], asked: bool = False) -> bool:
    """Whether an answer is one about L(t, q, q'), where that is the question of the result, or what
    its certificate proves: a yes without t is one with t, a no with t one without.
    """
    proven = (part.get("certificate") or {}).get("question") == "time_dependent"
    if part.get("verdict") == "not_variational":
        return asked and proven
    return asked or proven


def _with_formula(one: Stated, system: Mapping[str, Any] | None) -> Stated:
    """The statement with its L as a tree, which a result that an older program stored without
    `answers` has as a text alone.
    """
    if not _shows_lagrangian(one):
        return one
    try:
        with refusals.longer_texts(LONGER):  # as everywhere, whatever limit holds outside
            own = one.part.get("proof") or {}  # of a set of a family, with new constants
            whole = system and {**system, **{key: own[key] for key in _DECLARED if key in own}}
            names = names_of(whole, auxiliary_of(one.part))
            tree = reader.read_formula(one.part["lagrangian"]["text"], names)
    except errors.InputError:
        return one
    time = ex.Symbol((system or {}).get("time", "t"))
    return replace(one, formula=ex.substitute(tree, {time: ex.TIME}))


def auxiliary_of(part: Mapping[str, Any]) -> Mapping[str, Any]:
    """The functions F in the Lagrangian of an answer that are known by their derivatives."""
    found = (part.get("lagrangian") or {}).get("auxiliary")
    if found is None:  # of an older program
        found = part.get("integrals") or (part.get("certificate") or {}).get("integrals")
    return found or {}


def conditions_of(part: Mapping[str, Any]) -> tuple[str, ...]:
    """Where the answer holds and its L is one."""
    conditions = (*(part.get("domain") or ()), *(part.get("lagrangian") or {}).get("domain", ()))
    return tuple(dict.fromkeys(conditions))


# The writer.


def with_answers(result: dict[str, Any]) -> dict[str, Any]:
    """A stored result with its statements as the key `answers`."""
    plain = {key: value for key, value in result.items() if key != "answers"}
    return result | {"answers": answers_of(plain)}


def question_of(answer: Mapping[str, Any]) -> Question:
    """The question of an entry of `answers`."""
    texts = (answer.get("clock", ""), answer.get("kind", ""))
    return Question(
        About(answer["about"]), answer["with_time"], *texts, tuple(answer.get("conditions", ()))
    )


def answers_of(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The statements that are read from a result as the documents of `answers`."""
    return entries(statements_of(result), result)


def entries(statements: Sequence[Stated], result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Statements in their order as the documents of `answers` of a result."""
    found, places, cells = list[dict[str, Any]](), dict[tuple[str, str], int](), set[int]()
    for one in statements:
        fields = _answer_fields(one, result)
        # What follows from the same proof shares its formulas.
        first = places.setdefault((one.at, one.verdict), len(found))
        if first < len(found):
            fields = {key: value if key in _OF_FOLLOWING else None for key, value in fields.items()}
            fields["follows"] = first
        elif one.cell not in cells and not one.question.is_about_others:
            cells.add(one.cell)
            fields["first_integrals"] = list(
                branches_of(result)[one.cell].get("first_integrals") or ()
            )
        found.append(
            {key: value for key, value in fields.items() if key in _ALWAYS or value not in _EMPTY}
        )
    return found


def with_shared(
    answer: Mapping[str, Any], answers: Sequence[Mapping[str, Any]]
) -> Mapping[str, Any]:
    """An entry of `answers` with the formulas and the proof of the one that it follows from."""
    place = answer.get("follows")
    return answer if place is None else {**answers[place], "with_time": answer["with_time"]}


def _answer_fields(one: Stated, result: Mapping[str, Any]) -> dict[str, Any]:
    question, part = one.question, one.part
    certificate, key = part.get("certificate") or {}, "certificate"
    if question.timed and part.get("certificate_with_time"):
        certificate, key = part["certificate_with_time"], "certificate_with_time"
    steps = next(
        (
            name
            for name in ("explanation", "steps")
            if isinstance(part.get(name), list) and part[name]
        ),
        "",
    )
    has_own = question.about not in (About.MAIN, about_main(result)) or question.is_about_others
    equations = (part.get("associated") or part).get("equations") if has_own else None
    return {
        "about": question.about.value,
        "with_time": question.timed,
        "clock": question.clock,
        "kind": question.kind,
        "conditions": list(question.case),
        "cell": one.cell,
        # Those of a set of a family are a list, its conditions.
        "equations": equations if isinstance(equations, Mapping) else {},
        "verdict": one.verdict,
        "domain": _domain_of(part, certificate, result),
        "near": part.get("near") or certificate.get("near") or {},
        "lagrangian": _lagrangian_of(part),
        "hamiltonian": _hamiltonian_of(part),
        "dissipation": part.get("dissipation"),
        "other_lagrangians": part.get("other_lagrangians") or [],
        "multiplier": part.get("multiplier"),
        "solution_space": part.get("solution_space"),
        "freedom": part.get("freedom") or "",
        # A set of a family has the numbers of other sets as exceptions.
        "exceptions": [one for one in part.get("exceptions") or () if isinstance(one, str)],
        "checked": part.get("checked"),
        "certificate": f"{one.at}/{key}" if certificate else "",
        "explanation": f"{one.at}/{steps}" if steps else "",
        "follows": None,
        "open": _open_part(one, result),
    }


def _domain_of(
    part: Mapping[str, Any], certificate: Mapping[str, Any], result: Mapping[str, Any]
) -> list[str]:
    """The set on which the verdict holds; of a kind of Lagrangian that of the system, else that of
    the proof.
    """
    if (stated := part.get("domain")) is not None:
        return list(stated)
    return list(
        result.get("domain") or ()
        if certificate.get("among")
        else certificate.get("conditions") or ()
    )


def _lagrangian_of(part: Mapping[str, Any]) -> dict[str, Any] | None:
    """L with the definitions of the functions in it."""
    found = part.get("lagrangian")
    if found is None:
        return None
    known = {key: value for key, value in found.items() if key not in _ALONG_CONSTRAINTS}
    return known | {"auxiliary": auxiliary_of(part)}


def _hamiltonian_of(part: Mapping[str, Any]) -> dict[str, Any] | None:
    """H with the constraints in phase space."""
    found = part.get("hamiltonian")
    if found is None or found.get("image"):
        return found
    texts = found.get("constraints") or ()
    return {**found, "image": part.get("image") or [{"text": text, "latex": ""} for text in texts]}


def _open_part(one: Stated, result: Mapping[str, Any]) -> dict[str, str] | None:
    """What is missing of a verdict, or of a yes without L."""
    question = one.question
    if one.verdict == "undetermined":
        part: str = _PARTS.get(question.about, stages.existence(question))
        part = (
            Part.CLOCK
            if question.clock
            else Part.KINDS
            if question.kind
            else "cases"
            if question.case
            else part
        )
        words, code = (str(one.part.get(key) or "") for key in ("reason", "reason_code"))
    elif one.verdict == "variational" and not one.part.get("lagrangian"):
        part, words = stages.lagrangian(question), NOT_FOUND
        code = Reason.SEARCH.value
    else:
        return None
    known = next((entry for entry in result.get("incomplete") or () if entry["part"] == part), None)
    said = known or {}
    return {
        "part": part,
        "words": words or said.get("reason", ""),
        "reason_code": code or said.get("reason_code", ""),
        "more_time": said.get("more_time", ""),
    }
