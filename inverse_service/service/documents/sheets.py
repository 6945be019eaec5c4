"""One answer as a person reads it, for every printer: the verdict in a sentence, L and H, a table
for a motion on constraints, the proofs, and more.

A sentence is words, formulas, and words with a meaning; `printed_pages` prints it as text and as
LaTeX, and the pages as HTML. The verdict of a result is formed here alone: a yes with t is a yes.
Title, history, atlas, and badges take it from here.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from api_schemas.system import KINDS_OF_LAGRANGIANS
from inverse_service.certificate import checker
from inverse_service.expressions import notation, printing
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import (
    echo,
    growing,
    joined,
    readable_energies,
    stated,
)
from inverse_service.service.documents.stated import (
    Stated,
    asks_for_time,
    auxiliary_of,
    branches_of,
    conditions_of,
    is_constrained,
    names_of,
)
from inverse_service.statements.questions import About
from inverse_service.statements.reasons import Reason
from inverse_service.statements.stages import OF_LAGRANGIANS, Part

YES, NO, OPEN, DIFFERS = "yes", "no", "open", "differs"
VERDICTS = {"variational": YES, "not_variational": NO}
BADGES = {
    YES: "has a Lagrangian",
    NO: "no Lagrangian",
    OPEN: "undetermined",
    DIFFERS: "differs by case",
}
OF_MOTION = {
    YES: "has a Hamiltonian",
    NO: "has no Hamiltonian",
    OPEN: "undetermined",
    DIFFERS: "differs by case",
}
LONGEST_TITLE = 60  # characters of its first line
BY_MASS_MATRIX, BY_MASS_MATRIX_LATEX = "p^T M^(-1) p/2 + V", "\\tfrac{1}{2} p^{T} M^{-1} p + V"
MAX_STEPS = 200  # of a proof; the whole is in the JSON
LONGEST_CONDITION, MOST_CONDITIONS = (
    120,
    3,
)  # characters, and number, of the conditions on functions that are shown
MOST_MOVED = 8  # coefficients of a nearest system that are shown
NO_DISTANCE = 1e-5  # at which a fitted system is called one of a kind
LONGEST_MATRICES = 6_000  # characters of all matrices together: typeset they weigh 25 times that
TENSORS = (("Phi", "Phi"), ("nabla Phi", "nabla_Phi"))
CHECKED = "An independent checker verified that"
QUESTIONS = frozenset((Part.EXISTENCE, Part.EXISTENCE_WITH_TIME))
FORMULAS = (("L", "lagrangian"), ("H", "hamiltonian"))
MOST_SOUGHT = 3
MOST_CASES_SAID = 3
SEEKING = "Being decided"
STATED = {"holds": "Holds", "fails": "Fails", "not settled": "Undetermined"}
ANSWERS = {YES: "Yes", NO: "No", OPEN: "Undetermined"}
NEW_TIME = "a new time, d\u03c4 = N dt"
# What a proof proves, what is said of one that the checker did not call valid, and of associated
# systems.
_WORDS = json.loads((Path(__file__).parent / "sheets.json").read_text(encoding="utf-8"))
PROVEN: dict[str, str] = _WORDS["proven"]
DOUBTED: dict[str, str] = _WORDS["doubted"]
HINTS: dict[str, str] = _WORDS["hints"]


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula in these names, perhaps after its symbol and an equals sign, and lines of small
    print below it.

    `kind` is "step" for one of a proof, which may be in the notation of the theory, "display" for
    one that is shown below its sentence, "matrix" for a matrix, whose symbol is one of the theory.
    Without `latex` that of the text is meant.
    """

    text: str
    names: Names
    letter: str = ""
    latex: str = ""
    notes: tuple["Sentence", ...] = ()
    kind: str = ""

    @property
    def whole(self) -> str:
        """The formula as plain text, with its symbol."""
        return " = ".join(filter(None, (self.letter, self.text)))


@dataclass(frozen=True, slots=True)
class Word:
    """Words in the color of a verdict, or that lead to a part of the page (`#more`) or to a
    question: its document.
    """

    words: str
    verdict: str = ""
    target: str | Mapping[str, Any] = ""


Sentence = tuple[str | Formula | Word, ...]


@dataclass(frozen=True, slots=True)
class SpecialCase:
    """A case of the parameters and the cases inside it."""

    said: Sentence
    inner: tuple["SpecialCase", ...] = ()


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table of a motion on constraints, or of "More": what it is about, a word,
    formulas, the proof.
    """

    name: str
    hint: Sentence = ()
    verdict: str = ""
    word: str = ""
    formulas: tuple[Formula, ...] = ()
    steps: tuple[Sentence, ...] = ()
    is_main: bool = False
    domain: Sentence = ()  # of the formulas
    tree: tuple[SpecialCase, ...] = ()


@dataclass(frozen=True, slots=True)
class Case:
    """The answer on one domain."""

    verdict: str
    sentence: Sentence
    notes: tuple[Sentence, ...]
    formulas: tuple[Formula, ...] = ()
    proofs: tuple[tuple[str, tuple[Sentence, ...]], ...] = ()
    more: tuple[Row, ...] = ()
    # What is in the place of L and H after a no: how its proof begins and ends.
    gist: tuple[tuple[str, Sentence], ...] = ()
    # Where there are several cases: their conditions, their own equations, and how it moves there.
    where: Sentence = ()
    equations: tuple[Formula, ...] = ()
    motion: Sentence = ()

    place: int = 0  # from left to right, where they are parts of a line


@dataclass(frozen=True, slots=True)
class Member:
    """A set of members: its place among the leaves, how deep it is in others, where it is, the
    verdict, in a word, and as a sentence about one of them, and L; `others` are conditions on
    which that is none, with their questions.
    """

    leaf: int
    depth: int
    where: Sentence
    verdict: str
    word: str
    statement: str
    lagrangian: Sentence = ()
    notes: Sentence = ()
    others: tuple[tuple[Sentence, Mapping[str, Any]], ...] = ()


@dataclass(frozen=True, slots=True)
class FamilyTable:
    """The verdict in one sentence, a line for each set, and what is proven and what is open."""

    sentence: Sentence
    members: tuple[Member, ...]
    notes: tuple[Sentence, ...]


@dataclass(frozen=True, slots=True)
class Sheet:
    """All that is said of a result."""

    title: str
    verdict: str
    badge: str
    sentence: Sentence
    notes: tuple[Sentence, ...]
    asked: tuple[Formula, ...]
    about: tuple[Sentence, ...]
    cases: tuple[Case, ...]
    table: tuple[Row, ...] = ()
    more: tuple[Row, ...] = ()
    matrices: tuple[Sentence, ...] = ()
    missing: tuple[str, ...] = ()
    sought: tuple[str, ...] = ()
    family: FamilyTable | None = None
    joined: tuple[Formula, ...] = ()  # L and H of all cases

    @property
    def first(self) -> Case | None:
        """The case that is shown large."""
        return self.cases[0] if self.cases else None

    @property
    def across(self) -> list[tuple[int, Case]]:
        """The cases with their numbers, from left to right where they are parts of a line."""
        return sorted(enumerate(self.cases), key=lambda one: one[1].place)

    @property
    def joined_heading(self) -> str:
        """What the formula of all cases is called."""
        count = "Both" if len(self.cases) == 2 else f"All {len(self.cases)}"
        return f"{count} cases in one formula"

    @property
    def proofs(self) -> list[tuple[str, tuple[Sentence, ...]]]:
        """Every proof with its heading."""
        return [proof for case in self.cases for proof in case.proofs]


Length = Literal["whole", "brief"]


@dataclass(frozen=True, slots=True)
class _Told:
    """A result that is told: the names of its formulas, whether without proofs, and the parts that
    are looked for.
    """

    result: Mapping[str, Any]
    names: Names
    length: Length = "whole"
    pending: frozenset[str] = frozenset()


# The rule.


def verdict_of(result: Mapping[str, Any]) -> str:
    """One of yes, no, open, differs. A yes with t is a yes; a motion on constraints is asked for a
    Hamiltonian.
    """
    found = {_verdict_on_cell(cell, result) for cell in range(len(branches_of(result)))}
    found |= {OPEN} if stated.open_cells_of(result) else set()
    return found.pop() if len(found) == 1 else DIFFERS


def _verdict_on_cell(cell: int, result: Mapping[str, Any]) -> str:
    branch = branches_of(result)[cell]
    if not is_constrained(result):
        return _common(stated.verdicts_of(branch))
    return _verdict_of_motion(
        branch.get("any_associated") or result.get("any_associated") or {}, result
    )


def _verdict_of_motion(motion: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    systems = (result.get("nonholonomic") or {}).get("associated", ())
    if any("variational" in stated.verdicts_of(one) for one in systems):
        return YES
    return _common(stated.verdicts_of(motion))


def _common(verdicts: Iterable[str | None]) -> str:
    """Yes if one of them is yes, no if all are no, open otherwise."""
    found = [VERDICTS.get(one, OPEN) for one in verdicts if one is not None]
    return YES if YES in found else NO if found and set(found) == {NO} else OPEN


# Sentences.


def title_of(result: Mapping[str, Any], pending: Collection[str] = ()) -> str:
    """The title of this result in tabs, bookmarks and the history: its first line, and the
    verdict.
    """
    system = result["system"] or {}
    lines = list((system.get("equations") or {}).items())
    first = reader.equation_line(*lines[0]) if lines else "A system"
    given = (system.get("given") or {}).get("lagrangian")
    named = system.get("name") or (first if len(lines) < 2 else f"{first}, \u2026")
    if given:
        named = f"L = {given}" + (" with constraints" if is_constrained(result) else "")
    shown = named if len(named) <= LONGEST_TITLE else f"{named[:LONGEST_TITLE]}\u2026"
    return f"{shown}: {badge_of(result, pending) if 'verdict' in result else 'equations of motion'}"


def badge_of(result: Mapping[str, Any], pending: Collection[str] = ()) -> str:
    """The verdict in two or three words."""
    verdict = verdict_of(result)
    if verdict == OPEN and pending:
        return SEEKING.lower()
    return (OF_MOTION if is_constrained(result) else BADGES)[verdict]


def capitalized(text: str) -> str:
    """A sentence, or a name as a title, with its first letter in upper case; a formula keeps its
    own.
    """
    return text if text[1:2] == "'" else text[:1].upper() + text[1:]


def _ended(text: str) -> Sentence:
    """The text as a whole sentence."""
    return (f"{capitalized(text).rstrip('.')}.",)


def sentence(step: Mapping[str, Any] | str, names: Names) -> Sentence:
    """A sentence of a result; what is to be shown below it comes last.

    `parts` of a step are texts, words and formulas alternately; older results have {kind, text} for
    each.
    """
    if isinstance(step, str):
        return (step,)
    parts = step.get("parts") or [step.get("text") or step.get("statement") or ""]
    pairs = [
        (("text", "step")[k % 2], part) if isinstance(part, str) else (part["kind"], part["text"])
        for k, part in enumerate(parts)
    ]
    found: list[str | Formula | Word] = []
    for kind, text in pairs:
        if text and kind == "text":
            found.append(text)
        elif text and kind in ("step", "formula", "display"):
            # A formula behind a full stop is no part of a sentence.
            is_apart = kind == "display" or bool(found and str(found[-1]).rstrip().endswith("."))
            found.append(Formula(text, names, kind="display" if is_apart else "step"))
    return tuple(found)


def listed(texts: Iterable[str], names: Names) -> Sentence:
    """Formulas with commas between them; x > a and x < b as a < x < b."""
    shown = joined.in_ranges(texts)
    return tuple(piece for text in shown for piece in (", ", Formula(text, names)))[1:]


def meanings(system: Mapping[str, Any]) -> list[Sentence]:
    """What the names of a system mean that are not its coordinates: constants and unknown
    functions.
    """
    parameters, functions = system.get("parameters") or (), (system.get("functions") or {}).items()
    names = names_of(system) if parameters or functions else Names()
    wanted = [stated.call_of(name, of, names) for name, of in functions]
    defined = [one["text"] for one in _echo_of(system)["definitions"]]
    groups = (
        (f"with constant{'s' * (len(parameters) > 1)} ", parameters),
        (f"with unknown function{'s' * (len(wanted) > 1)} ", wanted),
        ("with ", defined),
    )
    names = _with_defined(system, names)
    return [(words, *listed(texts, names)) for words, texts in groups if texts]


def _sentence(verdict: str, answers: Sequence[Stated], count: int, told: _Told) -> Sentence:
    """The verdict about so many equations, or a brief answer; parts still pending are marked as
    being looked for.
    """
    pending, is_brief = told.pending, told.length == "brief"
    these, come = _these(count), "comes" if count == 1 else "come"
    general = _in_general(answers[0].part.get("exceptions") or (), told)
    if verdict == YES:
        shown, yes = answers[0], Word("Yes,", YES)
        is_sought = not OF_LAGRANGIANS.isdisjoint(pending)
        is_asked = shown.question.timed is asks_for_time(told.result)
        is_timed = shown.question.timed and not is_asked
        time = " that contains the time" if is_timed and not is_sought else ""
        if shown.part.get("lagrangian") is None and not is_sought:
            first: Sentence = (*general, ", ", Word("yes:", YES)) if general else (yes,)
            return (*first, f" a Lagrangian{time} exists; none was found in closed form.")
        if is_brief:
            is_timed &= shown.part.get("lagrangian") is not None
            return (yes, f" {'with the time in L' if is_timed else 'there is a Lagrangian'}.")
        return (yes, f" {these} {come} from a Lagrangian{time}.")
    if verdict == NO:
        time = "" if any(one.question.timed for one in answers) else " without the time"
        if is_brief:
            first = (*general, ", ", Word("no", NO)) if general else (Word("No", NO),)
            return (*first, f" regular Lagrangian{time}.")
        if general:
            return (
                *general,
                ", ",
                Word("no:", NO),
                f" {these} {come} from no regular Lagrangian{time}.",
            )
        do = Word("does not" if count == 1 else "do not", NO)
        return (f"{capitalized(these)} ", do, f" come from any regular Lagrangian{time}.")
    none = any(one.verdict == "not_variational" for one in answers)
    return _open_sentence(
        f"{these} {come} from a Lagrangian", none and "Lagrangian", QUESTIONS.intersection(pending)
    )


def _open_sentence(asked: str, none: str | bool, pending: Collection[str]) -> Sentence:
    """That it is open, or sought, whether something holds; there may be `none` without the time."""
    state = Word("being decided" if pending else "undetermined", OPEN)
    if none:
        return (f"No {none} without the time exists; one with the time is ", state, ".")
    return (f"Whether {asked} is ", state, ".")


def _motion_sentence(
    verdict: str, motion: Mapping[str, Any], pending: Collection[str] = ()
) -> Sentence:
    """The verdict about a motion on constraints."""
    if verdict == YES:
        return (Word("Yes,", YES), " this motion can be given a Hamiltonian.")
    if verdict == NO:
        was_asked = stated.verdicts_of(motion).timed is not None
        by = ", by any associated system." if was_asked else " by any Lagrangian without the time."
        return ("This motion ", Word("cannot", NO), f" be given a Hamiltonian{by}")
    none = motion.get("verdict") == "not_variational" and "Hamiltonian"
    return _open_sentence("this motion can be given a Hamiltonian", none, pending)


def proof_of(part: Mapping[str, Any]) -> str | None:
    """The checker's verdict on a stored answer; "old" if its certificate has a format that proved
    too little.
    """
    certificate = part.get("certificate") or {}
    return (
        "old"
        if certificate.get("format", checker.FORMAT) != checker.FORMAT
        else part.get("checked")
    )


def _checked(parts: Sequence[Mapping[str, Any]], told: _Told) -> list[Sentence]:
    """One sentence about the proofs of several answers: the worst of them."""
    found = {proof for part in parts if (proof := proof_of(part))}
    worst = next((one for one in ("invalid", "old", "incomplete") if one in found), None)
    if worst:
        return [(DOUBTED[worst],)]
    if not found:
        return []
    if len(parts) > 1:
        return [("An independent checker verified the proof of each answer.",)]
    these = _these(len((told.result["system"] or {}).get("equations") or ()))
    proven = _proven(parts[0].get("certificate") or {}).format(these=these)
    return [(f"{CHECKED} {proven}.",)]


def _these(count: int) -> str:
    return "this equation" if count == 1 else "these equations"


def _proven(certificate: Mapping[str, Any]) -> str:
    """What the checker proved of a certificate."""
    word = PROVEN.get(certificate.get("kind", ""), PROVEN[""])
    if certificate.get("kind") == "lagrangian" and certificate.get("dissipation"):
        return f"{word} with the friction D"
    return word


# The sheet.


def sheet_of(result: Mapping[str, Any], length: Length = "whole", grows: bool = False) -> Sheet:
    """The sheet of a solved system, of a motion on constraints, or of a Lagrangian; a brief one
    has no proofs.

    Where the result still `grows`, its incomplete parts are being looked for.
    """
    system = result["system"] or {
        "coordinates": (),
        "equations": {},
        "parameters": (),
        "functions": {},
    }
    pending = (
        frozenset(one["part"] for one in result.get("incomplete") or ())
        if grows
        else frozenset[str]()
    )
    told = _Told(result, names_of(system, result.get("integrals")), length, pending)
    if "verdict" not in result:
        return _forward(told)
    verdict = verdict_of(result)
    if is_constrained(result):
        return _constrained(told, verdict)
    places = joined.places_of(branches_of(result), told.names)
    cases = tuple(replace(_case(cell, told), place=place) for cell, place in enumerate(places))
    sentence, notes = cases[0].sentence, cases[0].notes if len(cases) == 1 else ()
    notes += tuple(
        (
            *_left_open(one, result, told.names),
            f"{_why_not(one)}.",
        )
        for one in result.get("not_answered") or ()
    )
    both = None
    if len(cases) > 1:
        unanswered = [listed(one["domain"], told.names) for one in stated.open_cells_of(result)]
        sentence = _sentence_of_cases(cases, unanswered)
        if not grows:
            both = joined.joined_of(branches_of(result), told.names, system["equations"].values())
        if both is not None and both.of_every and verdict == YES:
            *start, end = cases[0].sentence
            every = Formula(both.of_every, told.names)
            sentence = (*start, f"{str(end).removesuffix('.')}, for every ", every, ".")
    return Sheet(
        title_of(result, pending),
        verdict,
        badge_of(result, pending),
        sentence,
        notes,
        tuple(_written(system, told.names)),
        _about(result),
        cases,
        more=() if length == "brief" else tuple(_more(told)),
        matrices=()
        if length == "brief"
        else tuple(_matrices(result.get("conditions"), told.names)),
        missing=_missing(result, grows),
        joined=() if both is None else _joined(both, told.names),
        sought=tuple(letter for letter, part in FORMULAS if part in pending)
        if verdict == YES
        else (),
    )


def _joined(both: joined.Joined, names: Names) -> tuple[Formula, ...]:
    """L and H of all cases in one formula each."""
    ends = [piece for one in both.where for piece in (" and ", Formula(one, names))][1:]
    notes = (("The cases join where ", *ends, "."),) if ends else ()
    momenta = tuple(f"p_{name}" for name in names.coordinates)
    energetic = replace(names, parameters=(*names.parameters, *momenta))
    found = [("L", both.lagrangian, names, () if both.hamiltonian else notes)]
    found += [("H", both.hamiltonian, energetic, notes)] if both.hamiltonian else []
    return tuple(
        Formula(text, own, letter, printing.to_latex(reader.read_formula(text, own)), beside)
        for letter, text, own, beside in found
    )


def _left_open(unanswered: Mapping[str, Any], result: Mapping[str, Any], names: Names) -> Sentence:
    """What is not answered, and where: all, or, where the L that is shown holds everywhere, the
    other question.
    """
    where = listed(unanswered["domain"], names)
    main = stated.main_statements(result)
    beyond = unanswered.get("reason_code") == Reason.OUTSIDE_DOMAIN.value
    if not (beyond and main and main[0].question.timed and main[0].part.get("domain") == []):
        return ("Not answered where ", *where)
    return ("Where ", *where, ", it is open whether an L without the time exists")


def _why_not(unanswered: Mapping[str, Any]) -> str:
    """The reason as the end of a sentence; that the same equations hold is no reason."""
    reason = str(unanswered["reason"]).rstrip(".")
    beyond = unanswered.get("reason_code") == Reason.OUTSIDE_DOMAIN.value
    return f", although {reason}" if beyond else f": {reason}"


def _sentence_of_cases(cases: Sequence[Case], unanswered: Sequence[Sentence]) -> Sentence:
    """The verdict of several cases: the one that all have, or each with where it holds."""
    parts = [(case.verdict, case.where) for case in cases] + [("", where) for where in unanswered]
    if len({verdict for verdict, _ in parts}) == 1 and all(
        case.sentence == cases[0].sentence for case in cases
    ):
        *start, end = cases[0].sentence
        each = "any" if cases[0].verdict == NO else "each"
        return (*start, f"{str(end).removesuffix('.')} in {each} of {len(cases)} cases.")
    if len({verdict for verdict, _ in parts}) == 1:
        return (
            Word(ANSWERS[cases[0].verdict], cases[0].verdict),
            f" in each of {len(cases)} cases.",
        )
    if len(parts) > MOST_CASES_SAID or not all(where for _, where in parts):
        return ("The answer ", Word("depends on the case", DIFFERS), f": {len(parts)} cases.")
    words = [Word(ANSWERS.get(verdict, "Not answered"), verdict or OPEN) for verdict, _ in parts]
    said = [
        piece
        for word, (_, where) in zip(words, parts, strict=True)
        for piece in (", ", word, " where ", *where)
    ][1:]
    return (
        *(
            replace(one, words=one.words.lower()) if k and isinstance(one, Word) else one
            for k, one in enumerate(said)
        ),
        ".",
    )


def _case(cell: int, told: _Told) -> Case:
    result, names = told.result, told.names
    answers = stated.main_statements(result, cell)
    verdict, shown = _verdict_on_cell(cell, result), answers[0].part
    # What follows from the same proof is not repeated.
    others = [
        one for one in answers[1:] if (one.at, one.verdict) != (answers[0].at, answers[0].verdict)
    ]
    notes: list[Sentence] = []
    domain, formula = shown.get("domain") or [], (shown.get("lagrangian") or {}).get("domain") or []
    own = branches_of(result)[cell] if len(branches_of(result)) > 1 else {}
    where = _conditions(domain, shown, names) if own else ()
    equations = tuple(_equations(own, names)) if own.get("equations") else ()
    motion = sentence({"parts": joined.motion_of(own, names)}, names) if own else ()
    if domain and not where:
        notes.append(("Where ", *_conditions(domain, shown, names), "."))
    if not {*domain}.issuperset(formula):
        notes.append(("This formula holds where ", *_conditions(formula, shown, names), "."))
    if shown.get("reason") and verdict == OPEN and not told.pending:
        notes.append(_ended(shown["reason"]))
    if shown.get("exceptions") and result.get("system") and not _has_family(result):
        is_said = verdict == NO or (verdict == YES and not shown.get("lagrangian"))
        notes.append(_general(shown["exceptions"], told, is_said))
    notes += _checked([shown], told)
    if verdict == YES and not shown.get("lagrangian") and not told.pending:
        notes += _without_formula({**branches_of(result)[cell], **shown}, told)
    if verdict == YES and not QUESTIONS.intersection(told.pending):
        notes += filter(None, map(_other_note, others))
    more = [_other_row(other, told) for other in others if other.part.get("lagrangian")]
    said = _sentence(verdict, answers, len((result["system"] or {}).get("coordinates", ())), told)
    formulas = tuple(_formulas(shown, told))
    case = Case(
        verdict, said, tuple(notes), formulas, more=tuple(more), where=where, equations=equations, motion=motion
    )  # fmt: skip
    if told.length == "brief":
        return case
    steps = _steps(shown, names)
    start = next((step for step in steps if "Suppose" in str(step[:1])), steps[0] if steps else ())
    headed = [
        ("With the time" if other.question.timed else "Without the time", other) for other in others
    ]
    here = f"Where {', '.join(domain)}" if cell else ""
    proofs = [(here, steps), *((heading, _steps(other.part, names)) for heading, other in headed)]
    gist = (
        (("Assumption", start), ("Contradiction", steps[-1]))
        if verdict == NO and len(steps) > 1
        else ()
    )
    more += _answer_rows({**branches_of(result)[cell], **shown}, told, where)
    return replace(
        case, proofs=tuple(proof for proof in proofs if proof[1]), more=tuple(more), gist=gist
    )


def _conditions(texts: Sequence[str], part: Mapping[str, Any], names: Names) -> Sentence:
    """The conditions, long ones that say that the multiplier is regular in words."""
    said = readable_energies.said_by_regularity(part.get("multiplier") or (), texts, names)
    others = listed((text for text in texts if text not in said), names)
    if not said:
        return others
    named = "M" if (part.get("hamiltonian") or {}).get("mass_matrix") else "the multiplier"
    return (*others, *([", "] if others else []), f"{named} is not singular")


def _has_family(result: Mapping[str, Any]) -> bool:
    """Whether the sets of members of a family say all that is said of special values."""
    return bool((result.get("family") or {}).get("leaves"))


def _other_note(other: Stated) -> Sentence:
    """The sentence about the question that is not shown large."""
    kind = "containing" if other.question.timed else "without"
    if other.verdict == "variational":
        return (
            (Word(f"One {kind} the time", target="#more"), " exists, too.")
            if other.part.get("lagrangian")
            else ()
        )
    if other.verdict == "not_variational":
        return (f"None {kind} the time exists.",)
    return (f"Whether one {kind} the time exists is undetermined.",)


def _other_row(other: Stated, told: _Told) -> Row:
    name, domain = (
        ("Without the time", "With the time")[other.question.timed],
        other.part["lagrangian"].get("domain"),
    )
    where: Sentence = ("where ", *listed(domain, told.names)) if domain else ()
    exceptions = () if _has_family(told.result) else other.part.get("exceptions") or ()
    general = _general_words(exceptions, told).said
    hint = (
        *where,
        *(("; ",) if where and general else ()),
        *(("for ", *general[1:]) if general else ()),
    )
    return Row(name, hint, formulas=tuple(_formulas(other.part, told)))


def _formulas(part: Mapping[str, Any], told: _Told) -> list[Formula]:
    """L with its integrals, D, and H with its momenta and constraints."""
    integrals = auxiliary_of(part)
    names = names_of(told.result["system"], integrals) if integrals else told.names
    found = []
    if lagrangian := part.get("lagrangian"):
        found.append(
            formula_of(
                "L", lagrangian, names, [("with ", each) for each in integrals_of(integrals, names)]
            )
        )
    if part.get("dissipation"):
        found.append(formula_of("D", part["dissipation"], names))
    if hamiltonian := part.get("hamiltonian"):
        known = conditions_of(part)
        further = [one for one in hamiltonian.get("domain") or () if one not in known]
        found.append(_energy(hamiltonian, names, further))
    return found


def _energy(hamiltonian: Mapping[str, Any], names: Names, further: Collection[str] = ()) -> Formula:
    """H, E where it is implicit, or H by its mass matrix and potential where these say it
    shorter; below it the momenta, where else it is one than L, and its constraints.
    """
    shown = readable_energies.readable(hamiltonian, names)
    rows, potential = hamiltonian.get("mass_matrix"), hamiltonian.get("potential")
    by_mass = bool(rows and potential)
    notes: list[Sentence] = []
    if rows and potential:
        matrix, energy = shown_matrix("M", rows, names), formula_of("V", potential, names)
        rates = Formula(", ".join(f"{name}'" for name in names.coordinates), names)
        notes.append(("with p = M v, v = (", rates, "), ", matrix, ", and ", energy))
    elif shown.momenta:
        notes.append(("with ", *listed((*shown.definitions, *shown.momenta), shown.names)))
    if hamiltonian.get("implicit") and hamiltonian.get("reason"):
        notes.append((capitalized(hamiltonian["reason"]),))
    if further:
        notes.append(("where ", *listed(map(shown.said, further), shown.names)))
    if constraints := hamiltonian.get("constraints"):
        zero = [f"{shown.said(text)} = 0" for text in constraints]
        notes.append(("on ", *listed(zero, shown.names)))
    if by_mass:
        return Formula(BY_MASS_MATRIX, names, "H", BY_MASS_MATRIX_LATEX, tuple(notes), kind="step")
    letter = "E" if hamiltonian.get("implicit") else "H"
    return Formula(shown.text, shown.names, letter, shown.latex, tuple(notes))


def integrals_of(integrals: Mapping[str, Any], names: Names) -> Iterator[Formula]:
    """F(x) = ∫ f(x) dx for each integral in a formula; its derivatives if there are several."""
    for name, known in integrals.items():
        whole, slopes = f"{name}({', '.join(known['arguments'])})", known["derivatives"]
        for by, slope in slopes.items():
            is_sum = " + " in slope or " - " in slope
            one = Formula(
                f"\u222b {f'({slope})' if is_sum else slope} d{by}", names, whole, kind="step"
            )
            yield one if len(slopes) == 1 else Formula(slope, names, f"d{whole}/d{by}", kind="step")


def formula_of(
    letter: str, part: Mapping[str, Any], names: Names, notes: Iterable[Sentence] = ()
) -> Formula:
    """A formula of a result after its symbol, or alone."""
    return Formula(part["text"], names, letter, part.get("latex") or "", tuple(notes))


def _steps(part: Mapping[str, Any], names: Names) -> tuple[Sentence, ...]:
    steps = [*(part.get("explanation") or ()), *(part.get("details") or ())]
    found = [sentence(step, names) for step in steps[:MAX_STEPS]]
    left = len(steps) - MAX_STEPS
    return (*found, (f"{left} more steps are in the JSON.",)) if left > 0 else tuple(found)


def _written(system: Mapping[str, Any], names: Names) -> list[Formula]:
    """What the document says, as its author wrote it; the equations solved where this is not
    known.
    """
    lines = [one["text"] for one in _echo_of(system)["written"]]
    return _lines(lines, _with_defined(system, names)) or _equations(system, names)


def _echo_of(system: Mapping[str, Any]) -> Mapping[str, Any]:
    """`written` and `definitions` of a system, those of an older result read again."""
    if "written" in system or not system:
        return {"written": (), "definitions": (), **system}
    older = echo.lines_of_stored(system)
    return {
        "written": [one.model_dump() for one in older.lines],
        "definitions": [one.model_dump() for one in older.definitions],
    }


def _with_defined(system: Mapping[str, Any], names: Names) -> Names:
    """The names with those that definitions of the document replace."""
    defined = (one["text"].partition(" = ")[0] for one in _echo_of(system)["definitions"])
    return replace(names, parameters=(*names.parameters, *defined))


def _equations(system: Mapping[str, Any], names: Names) -> list[Formula]:
    return _lines([reader.equation_line(*pair) for pair in system["equations"].items()], names)


def _lines(texts: Iterable[str], names: Names) -> list[Formula]:
    return [Formula(text, names) for text in texts]


def _about(result: Mapping[str, Any]) -> tuple[Sentence, ...]:
    """The meaning of the names, stated once, and what is read differently after a semicolon."""
    defined = {one["text"] for one in _echo_of(result["system"] or {})["definitions"]}
    read = [
        f"{one['text']} {'is' if one['as'] == reader.LEFT_OUT else 'read as'} {one['as']}"
        for one in result.get("readings") or ()
        if one["text"] not in defined
    ]
    names = [*meanings(result["system"] or {})]
    if read and names:
        return (*names[:-1], (*names[-1], f"; {'; '.join(read)}"))
    return (*names, ("; ".join(read),)) if read else tuple(names)


def _missing(result: Mapping[str, Any], grows: bool) -> tuple[str, ...]:
    """Parts that are not there, in words: the next ones of a result that grows."""
    found = [str(one["part"]) for one in result.get("incomplete") or ()]
    if grows and is_constrained(result) and "any_associated" in found:
        found = [part for part in found if part in ("any_associated", "reduced")]
    verdict = verdict_of(result)
    if not grows and (
        verdict == OPEN or (verdict == YES and is_constrained(result))
    ):  # the headline says it
        found = [part for part in found if part not in (*QUESTIONS, "any_associated")]
    named = (growing.PARTS.get(part, {}).get("words") or part.replace("_", " ") for part in found)
    words = list(dict.fromkeys(named))
    return (
        (*words[:MOST_SOUGHT], *(["more"] if len(words) > MOST_SOUGHT else []))
        if grows
        else tuple(words)
    )


# More.


def _answer_rows(shown: Mapping[str, Any], told: _Told, where: Sentence) -> list[Row]:
    """Conserved quantities, other Lagrangians, the multiplier, how many there are; `where`: in
    which of several cells.
    """
    names, here = told.names, ("Where ", *where, ": ") if where else ()
    stated_before = {
        *(shown.get("domain") or ()),
        *((shown.get("lagrangian") or {}).get("domain") or ()),
    }
    rows = list[Row]()
    for one in shown.get("first_integrals") or ():
        own = [text for text in one.get("domain") or () if text not in stated_before]
        on = (*where, *((", ",) if where and own else ()), *listed(own, names))
        rows.append(replace(_conserved(one, told, auxiliary_of(shown)), domain=on))
    if complete := shown.get("first_integrals_complete"):
        others = complete.get("others") or ()
        formulas = tuple(_integral_of_motion(one, told, auxiliary_of(shown)) for one in others)
        single = len(shown.get("first_integrals") or ()) == 1
        said = (*here, *_completeness(complete, told, single))
        rows.append(Row("All integrals", said, formulas=formulas))
    for other in shown.get("other_lagrangians") or ():
        hint = (other["reason"],) if other.get("reason") else ()
        formula = formula_of("L", other, names)
        rows.append(Row("Another Lagrangian", hint, formulas=(formula,), domain=where))
    if shown.get("multiplier"):
        hint = ("the Hessian of L in the velocities",)
        matrix = shown_matrix("", shown["multiplier"], names)
        rows.append(Row("Multiplier", hint, formulas=(matrix,), domain=where))
    if space := shown.get("solution_space"):
        system = told.result["system"] or {}
        # The condition Gamma(g) + g f_v = 0 on one coordinate has as many solutions for all
        # constants.
        is_alone = len(system.get("coordinates") or ()) == 1
        general = () if is_alone else _in_general(checker.in_general(system), told)
        rows.append(Row("How many", (*here, *_said_of(general, f"{space['statement']}."))))
    return rows


def _said_of(general: Sentence, words: str) -> Sentence:
    """The sentence with the constants and functions in front of it for which it was proven."""
    return (*general, f", {words}") if general else (capitalized(words),)


def _without_formula(shown: Mapping[str, Any], told: _Told) -> Iterator[Sentence]:
    """What is known of a Lagrangian without a formula: what would give one, and what its energy
    excludes.
    """
    if construction := shown.get("construction"):
        yield sentence(construction, told.names)
    if shown.get("question") != "L(q, q')":
        return
    complete = shown.get("first_integrals_complete")
    if complete and complete["number"] == 1 and complete["degree"] > 1:
        yield _said_of(
            _in_general(complete.get("exceptions") or (), told),
            f"no L is a polynomial of degree at most {complete['degree']} in the velocities: its energy would be a first "
            "integral of this degree, and there is none (checked).",
        )


def _completeness(complete: Mapping[str, Any], told: _Told, single: bool) -> Sentence:
    """Up to which degree there are no other first integrals than polynomials in those listed, or in
    the single one.
    """
    general = _in_general(complete.get("exceptions") or (), told)
    kind = (
        "linear"
        if complete["degree"] == 1
        else f"a polynomial of degree at most {complete['degree']}"
    )
    of_time = ", with coefficients that may depend on time," if complete["timed"] else ""
    still = "" if complete["timed"] else " without the time"
    if complete["number"] == 1:
        none = f"apart from constants, no first integral{still} is {kind} in the velocities"
        return _said_of(general, f"{none}{of_time.rstrip(',')}.")
    others = " and the following, which are functions of these" if complete.get("others") else ""
    which = f"each first integral{still} that is {kind} in the velocities{of_time}"
    these = "this one" if single and not others else "these"
    return _said_of(general, f"{which} is a polynomial in {these}{others}.")


def shown_matrix(letter: str, rows: Iterable[Iterable[str]], names: Names) -> Formula:
    """A matrix after its symbol, or alone."""
    return Formula(f"[[{'], ['.join(map(', '.join, rows))}]]", names, letter, kind="matrix")


def _conserved(one: Mapping[str, Any], told: _Told, defined: Mapping[str, Any]) -> Row:
    """A first integral with the symmetry behind it; the functions F that are `defined` already."""
    names = told.names
    hint: Sentence = (capitalized(one["name"]),)
    if symmetry := one.get("symmetry"):
        group = replace(names, parameters=(*names.parameters, "s"))
        moved = [part.partition(" -> ") for _, part in notation.split_outside(symmetry, ", ")]
        pieces = [
            (", ", Formula(name, group), " \u2192 ", Formula(to, group)) for name, _, to in moved
        ]
        hint += (", by the symmetry ", *[piece for pair in pieces for piece in pair][1:])
    return Row("Conserved", hint, formulas=(_integral_of_motion(one, told, defined),))


def _integral_of_motion(one: Mapping[str, Any], told: _Told, defined: Mapping[str, Any]) -> Formula:
    """Its formula with the functions F in it that the L above does not define."""
    known = one.get("auxiliary") or {}
    own = {name: integral for name, integral in known.items() if defined.get(name) != integral}
    names = names_of(told.result["system"], own) if own else told.names
    return formula_of("", one, names, [("with ", each) for each in integrals_of(own, names)])


def _more(told: _Told) -> Iterable[Row]:
    """What was asked besides, and what there is instead of a no."""
    result, names = told.result, told.names
    yield from (
        _row_of_left_out(one, told) for one in result.get("left_out") or () if one["decided"]
    )
    part = result.get("instead")
    if part and part["kind"] in ("rayleigh", "parameters"):  # others are among the answers
        conditions = part.get("conditions") or ()
        hint: Sentence = (
            ("Where ", *listed(conditions, names)) if conditions else ("With friction D",)
        )
        found = tuple(_formulas(part, told))
        yield Row("Instead", hint, formulas=found, domain=_where_defined(part, names))
    for name, part in (result.get("kinds") or {}).items():
        verdict = VERDICTS.get(part["verdict"], OPEN)
        notes: list[Sentence] = [_ended(part["reason"])] if part.get("reason") else []
        notes += [_general(part["exceptions"], told)] if part.get("exceptions") else []
        if name == "positive_definite" and part["near"]:
            notes.append(
                (
                    "At ",
                    *listed((f"{key} = {value}" for key, value in part["near"].items()), names),
                    ".",
                )
            )
        hint = tuple(piece for one in (*notes, *_checked([part], told)) for piece in (" ", *one))[
            1:
        ]
        found = tuple(_formulas(part, told))
        yield Row(
            KINDS_OF_LAGRANGIANS.get(name, capitalized(name)),
            hint,
            verdict,
            ANSWERS[verdict],
            found,
            domain=_where_defined(part, names),
        )
    if part := result.get("with_clock"):
        yield _clock_row(part, told)
    if (family := result.get("family")) and not family["leaves"]:
        why = "; ".join(one["reason"] for one in family["open"])
        yield Row("Family", (f"The sets of members were not found: {why}.",))
    if (result.get("nearest")) is not None:
        yield _row_of_nearest(result, told)


def _where_defined(part: Mapping[str, Any], names: Names) -> Sentence:
    """The conditions of a part and of its Lagrangian."""
    of_formula = (part.get("lagrangian") or {}).get("domain") or ()
    return listed(dict.fromkeys((*(part.get("domain") or ()), *of_formula)), names)


def _row_of_left_out(part: Mapping[str, Any], told: _Told) -> Row:
    """The answer at special values that the main answer does not cover."""
    verdict, domain = (
        VERDICTS.get(part["verdict"], OPEN),
        (part["lagrangian"] or {}).get("domain") or (),
    )
    notes: list[Sentence] = (
        [("L is defined where ", *listed(domain, told.names), ".")] if domain else []
    )
    hint = tuple(piece for one in (*notes, *_checked([part], told)) for piece in (" ", *one))[1:]
    return Row(
        f"If {part['where']['text']}", hint, verdict, ANSWERS[verdict], tuple(_formulas(part, told))
    )


def _row_of_nearest(result: Mapping[str, Any], told: _Told) -> Row:
    """The nearest systems with a Lagrangian, each with what moved and its L, and what was not
    reached.
    """
    found = result["nearest"]
    said = " ".join(distance_said(found[0] if found else None))
    lines = [
        SpecialCase(
            (f"{part['kind'].replace('_', ' ')}, {part['statement']}: {distance_of(part)}",),
            tuple(_about_nearest(part)),
        )
        for part in found
    ]
    lines += [
        SpecialCase((f"not reached, {part['kind'].replace('_', ' ')}: {part['reason']}",))
        for part in result.get("nearest_not_reached") or ()
    ]
    return Row("Nearest", (said,), tree=tuple(lines))


def distance_said(part: Mapping[str, Any] | None) -> tuple[str, ...]:
    """How far the nearest system with a Lagrangian is, and in a second sentence whether errors
    explain it.
    """
    if part is None:
        return ("No system with a Lagrangian was reached.",)
    distance = part["distance"]
    if distance < NO_DISTANCE:
        return ("The fitted system is of this kind itself, but for rounding.",)
    if part["chi2"] is None:
        return (f"The nearest system with a Lagrangian is {100 * distance:.3g} % away.",)
    lies = "lies within its errors" if part["within"] else "does not lie within its errors"
    often = often_said(part["chance"])
    return (
        f"The nearest system with a Lagrangian is {distance:.3g} errors away.",
        f"A distance this large, or larger, comes by chance in {often} fits of a system of this kind: "
        f"it {lies}.",
    )


def often_said(chance: float) -> str:
    """A chance in words."""
    if chance < 0.001:
        return "fewer than 1 of 1000"
    return f"{1000 * chance:.0f} of 1000" if chance < 0.01 else f"{100 * chance:.0f} of 100"


def distance_of(part: Mapping[str, Any]) -> str:
    """The distance in short, with its degrees of freedom."""
    count = f"{part['degrees']} equation{'s' * (part['degrees'] != 1)}"
    least = ", the least possible" if part["projection"] else ""
    if part["chi2"] is None:
        return f"{100 * part['distance']:.4g} % for {count}{least}"
    return (
        f"{part['distance']:.4g} errors{least}, chi-square {part['chi2']:.4g} for {count}, "
        f"{'within' if part['within'] else 'not within'} the errors"
    )


def _about_nearest(part: Mapping[str, Any]) -> Iterator[SpecialCase]:
    moved = sorted(part["moved"].items(), key=lambda one: -abs(one[1]["sigmas"]))
    if moved and part["distance"] >= NO_DISTANCE:
        unit = "errors" if part["chi2"] is not None else ""
        each = (
            f"{name} {short_number(one['from'])} -> {short_number(one['to'])}"
            + (f" ({one['sigmas']:+.2f} {unit})" if unit else f" ({100 * one['sigmas']:+.2f} %)")
            for name, one in moved[:MOST_MOVED]
        )
        more = f", and {len(moved) - MOST_MOVED} more" if len(moved) > MOST_MOVED else ""
        yield SpecialCase((f"moved: {', '.join(each)}{more}",))
    if not part["attained"]:
        yield SpecialCase(("nearer ones have an L that tends to a singular one: none is nearest",))
    result = part["result"]
    lagrangian = stated.first_answer(result).get("lagrangian")
    names = names_of(result["system"])
    for name, text in result["system"]["equations"].items():
        if len(text) <= LONGEST_CONDITION:
            yield SpecialCase((Formula(text, names, f"{name}''"),))
    if lagrangian and len(lagrangian["text"]) <= 3 * LONGEST_CONDITION:
        yield SpecialCase((formula_of("L", lagrangian, names),))
    if offered := part.get("nice"):
        far = offered["distance"] * (1 if part["chi2"] is not None else 100)
        unit = "errors" if part["chi2"] is not None else "%"
        yield SpecialCase(
            (
                f"in simple fractions, {far:.4g} {unit} away: ",
                *listed(
                    (f"{name}'' = {text}" for name, text in offered["equations"].items()), names
                ),
            )
        )


def short_number(text: str) -> str:
    """A number to five digits."""
    if len(text) <= 8:
        return text
    top, _, bottom = text.partition("/")
    return f"{float(top) / float(bottom or 1):.5g}"


def _clock_row(clock: Mapping[str, Any], told: _Told) -> Row:
    factor = Formula(clock["factor"], told.names)
    became = (
        "With d\u03c4 = ",
        factor,
        " dt the equations become ",
        *_solved(clock, told.names),
        ".",
    )
    return _row("Another clock", ("d\u03c4 = ", factor, " dt"), clock, told, [became])


def _row(
    name: str, hint: Sentence, part: Mapping[str, Any], told: _Told,
    before: Sequence[Sentence] = (), after: Sequence[Sentence] = (),
) -> Row:  # fmt: skip
    """The row of an answer: its verdict, its formulas, and its proof between other sentences."""
    found = _common(stated.verdicts_of(part))
    word = (
        "Yes, with t" if found == YES and part.get("verdict") != "variational" else ANSWERS[found]
    )
    reason: list[Sentence] = [(capitalized(part["reason"]),)] if part.get("reason") else []
    domain = listed((part.get("lagrangian") or {}).get("domain") or (), told.names)
    where: list[Sentence] = [("L is defined where ", *domain, ".")] if domain else []
    steps = (*before, *where, *_steps(part, told.names), *after, *reason, *_checked([part], told))
    return Row(name, hint, found, word, tuple(_formulas(part, told)), steps, domain=domain)


def _solved(part: Mapping[str, Any], names: Names) -> Sentence:
    """The equations of a part, solved for the accelerations."""
    return listed((reader.equation_line(*pair) for pair in part["equations"].items()), names)


def _in_general(exceptions: Sequence[str], told: _Told, constants: str = "general ") -> Sentence:
    """The constants and functions for which an answer was proven: "For general a, b and a general
    F(x)", or "For all a, b" before its exceptions; () for all.
    """
    system, names = told.result["system"] or {}, told.names
    functions = checker.read_exceptions(exceptions).functions
    of_functions: Sentence = ()
    if functions:
        wanted = [stated.call_of(name, of, names) for name, of in system["functions"].items()]
        of_functions = ("a general " if len(wanted) == 1 else "general ", *listed(wanted, names))
    of_constants: Sentence = ()
    if len(exceptions) > len(functions):
        of_constants = (constants, *listed(system["parameters"], names))
    parts = [part for part in (of_constants, of_functions) if part]
    return ("For ", *parts[0], *((" and ", *parts[1]) if len(parts) > 1 else ())) if parts else ()


def _joined_conditions(text: str, names: Names) -> Sentence:
    """Conditions that hold together, as formulas with words between them."""
    pieces = [piece for one in text.split(" and ") for piece in (" and ", Formula(one, names))]
    return tuple(pieces[1:])


def _general(exceptions: Sequence[str], told: _Told, is_said: bool = False) -> Sentence:
    """For which constants and functions the answer was proven, with a link to a form that asks
    about the others.

    `is_said`: the sentence of the answer says it already.
    """
    found = _general_words(exceptions, told, is_said)
    given = told.result["system"].get("given")
    asked = {**given, "family": True} if isinstance(given, dict) else ""
    link = () if found.all_decided else (Word("Decide all members", target=asked),)
    return (*found.said, *(".",) * bool(found.said), *link)


class _General(NamedTuple):
    """For which constants and functions an answer was proven, and whether the others have answers
    of their own.
    """

    said: Sentence
    all_decided: bool


def _general_words(exceptions: Sequence[str], told: _Told, is_said: bool = False) -> _General:
    names = told.names
    general = () if is_said else _in_general(exceptions, told, "all ")
    left, decided = [one for one in exceptions if "=" in one], list[str]()
    if exceptions in [one.part.get("exceptions") for one in stated.main_statements(told.result)]:
        parts = [
            (one["where"]["text"], one["decided"]) for one in told.result.get("left_out") or ()
        ]
        decided = [where for where, is_decided in parts if is_decided and where in left]
        of_functions = [
            where for where, is_decided in parts if not is_decided and where not in left
        ]
        left = [*(one for one in left if one not in decided), *of_functions[:MOST_CONDITIONS]]
    shown: list[Sentence] = [
        _joined_conditions(one, names) if len(one) <= LONGEST_CONDITION else ("a longer condition",)
        for one in left
    ]
    unknown = checker.read_exceptions(exceptions).not_found
    every = ", ".join((told.result["system"] or {}).get("parameters") or ())
    special: list[Sentence] = [
        (
            "special values ",
            *(
                ()
                if one == every and not is_said
                else ("of ", *listed(one.split(", "), names), " ")
            ),
            "that are not listed",
        )
        for one in unknown
    ]
    left_out = list(dict.fromkeys([*shown, *special]))
    if is_said:
        listed_ones = tuple(piece for one in left_out for piece in (", ", *one))[1:]
        open_ones: Sentence = ("Not decided here: ", *listed_ones) if left_out else ()
        return _General(open_ones, bool(decided) and not left_out)
    pieces = _enumerated(left_out)
    below = (" is" if len(decided) == 1 else " are", " answered below")
    if decided and not pieces:
        words: Sentence = (*general, ", except ", *_enumerated_texts(decided, names), ",")
        words = (*words, " which", *below)
    else:
        is_one = len(left_out) == 1 and not special
        open_still = (", which is not decided here" if is_one else ", which are not decided here",)
        words = (*general, *((", except ", *pieces, *open_still) if pieces else ()))
        words = (*words, *(("; ", *_enumerated_texts(decided, names), *below) if decided else ()))
    return _General(words, bool(decided) and not pieces)


def _enumerated_texts(texts: Sequence[str], names: Names) -> Sentence:
    """a = 0 or b = 0."""
    return _enumerated([_joined_conditions(one, names) for one in texts])


def _enumerated(parts: Sequence[Sentence]) -> Sentence:
    """a, b, or c."""
    last = " or " if len(parts) == 2 else ", or "
    signs = [", "] * (len(parts) - 2) + [last] * (len(parts) > 1)
    pairs = zip(["", *signs], parts, strict=False)
    return tuple(piece for sign, one in pairs for piece in (*((sign,) if sign else ()), *one))


def _matrices(conditions: Mapping[str, Any] | None, names: Names) -> Iterable[Sentence]:
    """Phi, nabla Phi, and each nonzero block of R; what would make the page too long is only
    named.
    """
    if conditions is None:
        return
    wanted = [(letter, conditions[key]) for letter, key in TENSORS if conditions.get(key)]
    for index, block in enumerate(conditions.get("R") or [], start=1):
        if any(entry != "0" for row in block for entry in row):
            wanted.append((f"R^{index}", block))
    room = LONGEST_MATRICES
    for letter, rows in wanted:
        length = sum(len(entry) for row in rows for entry in row)
        if length <= room:
            room -= length
            is_zero = all(entry == "0" for row in rows for entry in row)
            yield (
                Formula("0", names, letter, kind="matrix")
                if is_zero
                else shown_matrix(letter, rows, names),
            )
        else:
            yield (
                Formula("", names, letter, kind="matrix"),
                f" has {length:,} characters: it is in the JSON.",
            )


# A motion on constraints.


def _constrained(told: _Told, verdict: str) -> Sheet:
    result, names, pending = told.result, told.names, told.pending
    part = result.get("nonholonomic") or {}
    motions = growing.motions_of(result) or [{}]
    table = tuple(_rows(part, motions[0], told))
    asked = _written(result["system"] or {"equations": {}}, names)
    first = stated.statements_of(result)[0]
    shown = (
        first.part if first.part.get("lagrangian") and not first.question.is_about_others else {}
    )
    domain = listed((shown.get("lagrangian") or {}).get("domain") or (), names)
    notes = _checked(
        [one for one in (motions[0], *part.get("associated", ())) if one.get("checked")], told
    )
    if motions[0].get("exceptions"):
        notes.insert(0, _general(motions[0]["exceptions"], told))
    # What ended a question that was begun is the reason, not how far it was.
    ended = [
        one["reason"]
        for one in result.get("incomplete") or ()
        if one["part"] == Part.ANY_ASSOCIATED
    ]
    reason = (ended or [motions[0].get("reason")])[0]
    if verdict == OPEN and reason and not pending:
        notes.insert(0, _ended(reason))
    if verdict == YES and not shown and not pending:
        notes.append(("None was found in closed form.",))
        notes += _without_formula(motions[0], told)
    if domain:
        notes.insert(0, ("These formulas hold where ", *domain, "."))
    if shown and first.question.about is not About.ANY:
        notes.append((f"L and H are those of the {first.question.about} associated system.",))
    besides = [row.name for row in table if verdict == NO and row.verdict == YES]
    if besides:
        how = (
            "The reduced motion can."
            if besides[0] == "Reduced"
            else "With another clock the reduced motion can."
        )
        notes.append((how,))
    sentence = _motion_sentence(verdict, motions[0], pending)
    steps = () if told.length == "brief" or verdict != NO else _steps(motions[0], names)
    gist = (("Conclusion", steps[-1]),) if steps else ()
    cases = [Case(verdict, sentence, tuple(notes), tuple(_formulas(shown, told)), gist=gist)]
    if len(motions) > 1:
        cells = [listed(branch.get("domain") or (), names) for branch in branches_of(result)]
        own = _verdict_of_motion(motions[0], result)
        cases = [
            replace(
                cases[0], verdict=own, sentence=_motion_sentence(own, motions[0]), where=cells[0]
            )
        ]
        for one, where in zip(motions[1:], cells[1:], strict=False):
            own = _verdict_of_motion(one, result)
            cases.append(Case(own, _motion_sentence(own, one), (), where=where))
        sentence = _sentence_of_cases(cases, ())
    return Sheet(
        title_of(result, pending), verdict, badge_of(result, pending), sentence, tuple(notes), tuple(asked),
        _about(result), tuple(cases),
        table, () if told.length == "brief" else tuple(_motion_more(part, told)), (), _missing(result, bool(pending)),
    )  # fmt: skip


def rows_of(sheet: Sheet) -> list[tuple[str, ...]]:
    """The table of a motion on constraints as texts."""
    found = [(row, {one.letter: one.text for one in row.formulas}) for row in sheet.table]
    lines = [
        (row.name, row.word, *(texts.get(letter, "") for letter in "LH")) for row, texts in found
    ]
    return [("system", "Hamiltonian?", "L", "H"), *lines]


def _rows(part: Mapping[str, Any], motion: Mapping[str, Any], told: _Told) -> Iterable[Row]:
    """First, second, third, any, reduced, another clock."""
    result, names, pending = told.result, told.names, told.pending
    for one in part.get("associated") or ():
        row = _associated_row(one, told)
        yield replace(row, word=SEEKING) if row.verdict == OPEN and "existence" in pending else row
    if motion:
        after: list[Sentence] = []
        if lagrangian := motion.get("lagrangian"):
            on = [formula_of("l", lagrangian["on_constraints"], names)]
            on += [
                formula_of(f"lambda_{k}", one, names)
                for k, one in enumerate(lagrangian["transverse_momenta"], 1)
            ]
            after.append(
                ("On the constraints ", *[piece for one in on for piece in (", ", one)][1:], ".")
            )
        if motion.get("freedom"):
            after.append((f"L along the constraints depends on {motion['freedom']}.",))
        row = _row("Any", ("all associated systems at once",), motion, told, after=after)
        row = replace(row, is_main=True)
        if (
            row.verdict == OPEN and _verdict_on_cell(0, result) == YES
        ):  # one of those above is enough
            row = replace(row, verdict=YES, word=ANSWERS[YES], steps=())
        yield (
            replace(row, word=SEEKING)
            if row.verdict == OPEN and "any_associated" in pending
            else row
        )
    reduced = result.get("reduced")
    if not reduced:
        if "reduced" in pending:
            yield Row("Reduced", (), OPEN, SEEKING)
        return
    over = ("the equations of ", *listed(reduced["coordinates"], names), " alone")
    before: list[Sentence] = [("The equations ", *_solved(reduced, names), ".")]
    before += [(reduced["statement"],)] if reduced.get("statement") else []
    row = _row("Reduced", over, {**reduced, "explanation": reduced.get("steps")}, told, before)
    yield row
    clock = result.get("with_clock") or reduced.get("with_clock")
    if clock:
        yield _clock_row(clock, told)
    elif row.verdict == YES:
        yield Row("Another clock", (NEW_TIME,), "", "Not needed")
    else:
        why = reduced.get("without_clock")
        yield Row("Another clock", (NEW_TIME,), OPEN, "None found", (), ((why,),) if why else ())


def _associated_row(one: Mapping[str, Any], told: _Told) -> Row:
    name, names = capitalized(one["kind"]), told.names
    hint = (HINTS[one["kind"]],) if one["kind"] in HINTS else ()
    if not one["defined"]:
        return Row(
            name, hint, "", "Not defined", (), (sentence(one.get("explanation") or "", names),)
        )
    where = listed(one.get("domain") or (), names)
    is_asked = (told.result["system"].get("given") or {}).get("associated") != "any"
    system = ("The system ", *_solved(one, names), *((" where ", *where) if where else ()), ".")
    if one["verdict"] == "undetermined" and not is_asked:
        return Row(name, hint, "", "Not asked", (), (system,))
    is_main = one["kind"] == (told.result.get("nonholonomic") or {}).get("main")
    steps = told.result.get("explanation") if is_main else one.get("steps")
    return _row(name, hint, {**one, "explanation": steps}, told, [system])


def _motion_more(part: Mapping[str, Any], told: _Told) -> Iterable[Row]:
    """The motion, what it conserves, the forces of the constraints, and what was asked besides."""
    if not part:
        return
    motion, names = part["equations_of_motion"], told.names
    lines = [f"{name}'' = {f['text']}" for name, f in motion["second_order"].items()]
    lines += [f"{name}' = {f['text']}" for name, f in motion["first_order"].items()]
    yield Row("Motion", formulas=tuple(_lines(lines, names)))
    for k, one in enumerate(motion.get("multipliers") or (), 1):
        yield Row("Multiplier of the constraint", formulas=(formula_of(f"lambda_{k}", one, names),))
    yield from (_conserved(one, told, {}) for one in part.get("first_integrals") or ())
    density = part["measure_density"].get("density")
    measure = sentence(part["measure_density"], names)
    yield Row(
        "Invariant measure", measure, formulas=(formula_of("N", density, names),) if density else ()
    )
    for key, name in (("integrable", "Integrability"), ("paper_class", "Class")):
        if part[key].get("statement"):
            yield Row(name, sentence(part[key], names))
    for entry in part.get("hamiltonisation") or ():
        stated = [
            (f"{STATED[one['verdict']]}: ", *sentence(one, names)) for one in entry["statements"]
        ]
        zero = listed([f"{one['text']} = 0" for one in entry["constraints"]], names)
        word, label = (
            "Confirmed" if entry["holds"] else "Not confirmed",
            capitalized(entry["label"]),
        )
        yield Row(
            f"Hamilton's equations, {entry['associated']}", (f"{label} on ", *zero) if zero else (label,),
            YES if entry["holds"] else OPEN, word,
            (formula_of("H", entry["hamiltonian"], names),) if entry["hamiltonian"] else (), tuple(stated),
        )  # fmt: skip
    yield from _more(told)


# A Lagrangian alone.


def _forward(told: _Told) -> Sheet:
    result, names, system = told.result, told.names, told.result["system"]
    momenta = {f"p_{name}": part["text"] for name, part in result["momenta"].items()}
    energy = _energy({"momenta": momenta, **result["hamiltonian"]}, names)
    one = len(system["equations"]) == 1
    said = ("This is its equation of motion.",) if one else ("These are its equations of motion.",)
    return Sheet(
        title_of(result), "", "", said, (), tuple(_written(system, names)), _about(result),
        (Case("", said, (), (*_equations(system, names), energy)),),
        more=tuple(_conserved(part, told, {}) for part in result["conserved"]),
    )  # fmt: skip
