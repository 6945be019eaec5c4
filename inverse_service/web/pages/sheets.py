"""One answer as a page shows it: the verdict in a sentence, L and H, a table for a motion on constraints, the proofs.

The verdict of a result is formed here alone: a yes with t is a yes. Title, history, atlas and badges take it from here.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from markupsafe import Markup

from inverse_service import errors
from inverse_service.certificate.formulas import FORMAT
from inverse_service.expressions import printing
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import canonical, growing, text_page
from inverse_service.service.scenes import prices
from inverse_service.web.pages import WORDS, forms, typesetting

ARROW = "\u2192"
YES, NO, OPEN, DIFFERS = "yes", "no", "open", "differs"
VERDICTS = {"variational": YES, "not_variational": NO}
BADGES = {YES: "a Lagrangian", NO: "no Lagrangian", OPEN: "undetermined", DIFFERS: "differs by case"}
OF_MOTION = {YES: "has a Hamiltonian", NO: "has no Hamiltonian", OPEN: "undetermined", DIFFERS: "differs by case"}
LONGEST_TITLE = 60  # characters of its first line
MAX_STEPS = 200  # on a page; the whole is in the JSON
LONGEST_MATRICES = 6_000  # characters of all matrices on a page: typeset they weigh 25 times that
TENSORS = (("Phi", "<mi>Φ</mi>"), ("nabla_Phi", "<mi>∇</mi><mi>Φ</mi>"))
CHECKED = "An independent checker verified the proof."
DOUBTED = WORDS["doubted"]
QUESTIONS = frozenset(("existence", "existence_with_time"))
SOUGHT = (("L", "lagrangian"), ("H", "hamiltonian"))
MOST_SOUGHT = 3
INSTEAD = WORDS["instead"]
KIND_NAMES: dict[str, str] = WORDS["kinds"]
SEEKING = "Being decided"
STATED = {"holds": "Holds", "fails": "Fails", "not settled": "Undetermined"}
ANSWERS = {YES: "Yes", NO: "No", OPEN: "Undetermined"}
OF_OTHERS = ("Reduced", "Another clock")
HINTS: dict[str, str] = WORDS["hints"]
OWN: dict[str, tuple[str, str]] = WORDS["own"]


@dataclass(frozen=True, slots=True)
class Formula:
    """A formula after its symbol, the text to copy, and lines of small print below it."""

    letter: str
    math: Markup
    text: str
    latex: str = ""
    notes: tuple[Markup, ...] = ()


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table of a motion on constraints, or of "More": what it is about, a word, formulas, the proof."""

    name: str
    hint: Markup | str = ""
    verdict: str = ""
    word: str = ""
    formulas: tuple[Formula, ...] = ()
    steps: tuple[Markup, ...] = ()
    is_main: bool = False
    domain: Markup | str = ""  # of the formulas


@dataclass(frozen=True, slots=True)
class Case:
    """The answer on one domain."""

    verdict: str
    sentence: Markup
    notes: tuple[Markup, ...]
    formulas: tuple[Formula, ...]
    proofs: tuple[tuple[str, tuple[Markup, ...]], ...]
    more: tuple[Row, ...] = ()
    # What is in the place of L and H after a no: how its proof begins and ends.
    gist: tuple[tuple[str, Markup], ...] = ()


@dataclass(frozen=True, slots=True)
class Sheet:
    """All that a page says of a result."""

    title: str
    verdict: str
    badge: str
    sentence: Markup
    notes: tuple[Markup, ...]
    asked: tuple[Formula, ...]
    about: tuple[Markup, ...]
    cases: tuple[Case, ...]
    table: tuple[Row, ...] = ()
    more: tuple[Row, ...] = ()
    matrices: tuple[Markup, ...] = ()
    missing: tuple[str, ...] = ()
    sought: tuple[str, ...] = ()

    @property
    def first(self) -> Case | None:
        """The case that is shown large."""
        return self.cases[0] if self.cases else None

    @property
    def proofs(self) -> list[tuple[str, tuple[Markup, ...]]]:
        """Every proof with its heading."""
        return [proof for case in self.cases for proof in case.proofs]


# The rule.


def verdict_of(result: Mapping[str, Any]) -> str:
    """One of yes, no, open, differs. A yes with t is a yes; a motion on constraints is asked for a Hamiltonian."""
    found = {_verdict_of_branch(branch, result) for branch in text_page.branches_of(result)}
    found |= {OPEN} if result.get("not_answered") else set()
    return found.pop() if len(found) == 1 else DIFFERS


def is_constrained(result: Mapping[str, Any]) -> bool:
    """Whether the result is about a motion on constraints."""
    return bool(result.get("nonholonomic") or result.get("any_associated"))


def _verdict_of_branch(branch: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    if not is_constrained(result):
        return _common(answer["verdict"] for answer in answers_of(branch, result))
    motion = branch.get("any_associated") or result.get("any_associated") or {}
    verdicts = [motion.get("verdict"), motion.get("verdict_with_time")]
    systems = (result.get("nonholonomic") or {}).get("associated", ())
    if any(one.get(key) == "variational" for one in systems for key in ("verdict", "verdict_with_time")):
        return YES
    return _common(verdicts)


def _common(verdicts: Iterable[str | None]) -> str:
    """Yes if one of them is yes, no if all are no, open otherwise."""
    found = [VERDICTS.get(one, OPEN) for one in verdicts if one is not None]
    return YES if YES in found else NO if found and set(found) == {NO} else OPEN


def answers_of(branch: Mapping[str, Any], result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The answers to both questions, those with a Lagrangian first, each with `timed`."""
    pairs = text_page.answers_of({"with_time": None, **branch}, result)
    found = [{**answer, "timed": timed} for answer, timed in pairs]
    verdict = branch.get("verdict_with_time")
    if len(found) == 1 and verdict is not None and not found[0]["timed"]:
        found.append({"verdict": verdict, "timed": True})  # the same proof answers both
    return sorted(found, key=lambda one: (one["verdict"] != "variational", not one.get("lagrangian")))


# Sentences.


def title_of(result: Mapping[str, Any], pending: Collection[str] = ()) -> str:
    """The title of this result in tabs, bookmarks and the history: its first line, and the verdict."""
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


def _colored(verdict: str, word: str) -> Markup:
    return Markup('<span class="{}">{}</span>').format(verdict, word)


def _sentence(
    verdict: str, answers: Sequence[Mapping[str, Any]], count: int, pending: Collection[str], brief: bool = False
) -> Markup:
    """The verdict about equations, or a `brief` answer; parts still `pending` are marked as being looked for."""
    these, come = ("this equation", "comes") if count == 1 else ("these equations", "come")
    if verdict == YES:
        shown = answers[0]
        is_sought = any(part.startswith(("existence", "lagrangian")) for part in pending)
        time = " that contains the time" if shown["timed"] and not shown["asked"] and not is_sought else ""
        if shown.get("lagrangian") is None and not is_sought:
            return Markup("{} a Lagrangian{} exists; none was found in closed form.").format(
                _colored(YES, "Yes,"), time
            )
        if brief:
            return Markup("{} {}.").format(
                _colored(YES, "Yes,"), "with the time in L" if time else "there is a Lagrangian"
            )
        return Markup("{} {} {} from a Lagrangian{}.").format(_colored(YES, "Yes,"), these, come, time)
    if verdict == NO:
        time = "" if len(answers) > 1 or answers[0]["timed"] else " without the time"
        if brief:
            return Markup("{} regular Lagrangian{}.").format(_colored(NO, "No"), time)
        do = _colored(NO, "does not" if count == 1 else "do not")
        return Markup("{} {} come from any regular Lagrangian{}.").format(these.capitalize(), do, time)
    none = any(one["verdict"] == "not_variational" for one in answers)
    return _open_sentence(f"{these} {come} from a Lagrangian", none and "Lagrangian", QUESTIONS.intersection(pending))


def _open_sentence(asked: str, none: str | bool, pending: Collection[str]) -> Markup:
    """That it is open, or sought, whether something holds; there may be `none` without the time."""
    state = _colored(OPEN, "being decided" if pending else "undetermined")
    if none:
        return Markup("No {} without the time exists; one with the time is {}.").format(none, state)
    return Markup("Whether {} is {}.").format(asked, state)


def _motion_sentence(verdict: str, motion: Mapping[str, Any], pending: Collection[str] = ()) -> Markup:
    """The verdict about a motion on constraints."""
    if verdict == YES:
        return Markup("{} this motion can be given a Hamiltonian.").format(_colored(YES, "Yes,"))
    if verdict == NO:
        return Markup("This motion {} be given a Hamiltonian, by any associated system.").format(_colored(NO, "cannot"))
    none = motion.get("verdict") == "not_variational" and "Hamiltonian"
    return _open_sentence("this motion can be given a Hamiltonian", none, pending)


def proof_of(part: Mapping[str, Any]) -> str | None:
    """The checker's verdict on a stored answer; "old" if its certificate has a format that proved too little."""
    certificate = part.get("certificate") or {}
    return "old" if certificate.get("format", FORMAT) != FORMAT else part.get("checked")


def _checked(parts: Sequence[Mapping[str, Any]]) -> list[Markup]:
    """One sentence about the proofs of several answers: the worst of them."""
    found = {proof for part in parts if (proof := proof_of(part))}
    worst = next((one for one in ("invalid", "old", "incomplete") if one in found), None)
    if worst:
        return [Markup(DOUBTED[worst])]
    return [Markup("An independent checker verified the proofs." if len(parts) > 1 else CHECKED)] if found else []


# The sheet.


def sheet_of(result: Mapping[str, Any], brief: bool = False, grows: bool = False) -> Sheet:
    """The page of a solved system, of a motion on constraints, or of a Lagrangian; `brief` leaves out proofs.

    Where the result still `grows`, its incomplete parts are being looked for.
    """
    system = result["system"] or {"coordinates": (), "equations": {}, "parameters": (), "functions": {}}
    names = text_page.names_of(system, result.get("integrals"))
    if "verdict" not in result:
        return _forward(result, names)
    verdict, branches = verdict_of(result), text_page.branches_of(result)
    pending = frozenset(one["part"] for one in result.get("incomplete") or ()) if grows else frozenset()
    if is_constrained(result):
        return _constrained(result, names, verdict, brief, pending)
    cases = tuple(_case(branch, result, names, brief, pending) for branch in branches)
    sentence, notes = cases[0].sentence, cases[0].notes
    if len(cases) > 1:
        unanswered = result.get("not_answered") or ()
        count = len(cases) + len(unanswered)
        word = "is not the same everywhere" if verdict == DIFFERS else "is the same, with its own formula in each"
        sentence = Markup("The answer {}: {} cases.").format(_colored(verdict, word), count)
        notes = tuple(
            Markup("Not answered where {}: {}").format(_listed(one["domain"], names), one["reason"])
            for one in unanswered
        )
    return Sheet(
        title_of(result, pending),
        verdict,
        badge_of(result, pending),
        sentence,
        notes,
        tuple(_typed(system, names)),
        _about(result),
        cases,
        more=() if brief else tuple(_more(result, names)),
        matrices=() if brief else tuple(_matrices(result.get("conditions"), names)),
        missing=_missing(result, grows),
        sought=tuple(letter for letter, part in SOUGHT if part in pending) if verdict == YES else (),
    )


def _case(
    branch: Mapping[str, Any], result: Mapping[str, Any], names: Names, brief: bool, pending: Collection[str]
) -> Case:
    answers = answers_of(branch, result)
    answers[0]["asked"] = answers[0]["timed"] == text_page.asks_for_time(result)
    verdict, (shown, *others) = _verdict_of_branch(branch, result), answers
    notes: list[Markup] = []
    domain, formula = shown.get("domain") or [], (shown.get("lagrangian") or {}).get("domain") or []
    if domain:
        notes.append(Markup("Where {}.").format(_listed(domain, names)))
    if not {*domain}.issuperset(formula):
        notes.append(Markup("This formula holds where {}.").format(_listed(formula, names)))
    if shown.get("reason") and verdict == OPEN and not pending:
        notes.append(Markup("{}.").format(typesetting.capitalized(shown["reason"]).rstrip(".")))
    if shown.get("exceptions") and result.get("system"):
        notes.append(_general(shown["exceptions"], result, names))
    notes += _checked([shown])
    notes += [_other_note(other) for other in others if verdict == YES and not QUESTIONS.intersection(pending)]
    more = [_other_row(other, result, names) for other in others if other.get("lagrangian")]
    if not brief:
        more += _answer_rows(shown, result, names)
    steps = () if brief else _steps(shown, names)
    start = next((step for step in steps if "Suppose" in step), steps[0] if steps else Markup(""))
    proofs = [] if brief else [("", steps)] + [
        ("Without the time" if not other["timed"] else "With the time", _steps(other, names)) for other in others
    ]  # fmt: skip
    return Case(
        verdict,
        _sentence(verdict, answers, len((result["system"] or {}).get("coordinates", ())), pending, brief),
        tuple(notes),
        tuple(_formulas(shown, result, names)),
        tuple(proof for proof in proofs if proof[1]),
        tuple(more),
        (("Assumption", start), ("Contradiction", steps[-1])) if verdict == NO and len(steps) > 1 else (),
    )


def _other_note(other: Mapping[str, Any]) -> Markup:
    """The sentence about the question that is not shown large."""
    kind = "containing" if other["timed"] else "without"
    if other["verdict"] == "variational":
        if other.get("lagrangian") is None:
            return Markup("")
        return Markup('<a href="#more">One {} the time</a> exists, too.').format(kind)
    if other["verdict"] == "not_variational":
        return Markup("None {} the time exists.").format(kind)
    return Markup("Whether one {} the time exists is undetermined.").format(kind)


def _other_row(other: Mapping[str, Any], result: Mapping[str, Any], names: Names) -> Row:
    name = "With the time" if other["timed"] else "Without the time"
    where = _listed((other.get("lagrangian") or {}).get("domain") or (), names)
    return Row(name, Markup("where {}").format(where) if where else "", formulas=tuple(_formulas(other, result, names)))


def _formulas(part: Mapping[str, Any], result: Mapping[str, Any], names: Names) -> list[Formula]:
    """L with its integrals, D, and H with its momenta and constraints."""
    integrals = part.get("integrals") or {}
    names = text_page.names_of(result["system"], integrals) if integrals else names
    found = []
    if lagrangian := part.get("lagrangian"):
        notes = [Markup("with {}").format(line) for line in typesetting.integrals(integrals, names)]
        found.append(formula_of("L", lagrangian, names, notes))
    if part.get("dissipation"):
        found.append(formula_of("D", part["dissipation"], names))
    if hamiltonian := part.get("hamiltonian"):
        momenta = [f"{name} = {text}" for name, text in hamiltonian["momenta"].items()]
        notes = [Markup("with {}").format(_listed(momenta, names))] if momenta else []
        if hamiltonian.get("implicit"):
            notes.append(
                Markup(hamiltonian.get("reason") and "{}").format(typesetting.capitalized(hamiltonian["reason"]))
            )
        if hamiltonian.get("constraints"):
            zero = _listed([f"{text} = 0" for text in hamiltonian["constraints"]], names)
            notes.append(Markup("on {}").format(zero))
        found.append(formula_of("H", hamiltonian, names, notes))
    return found


def formula_of(letter: str, part: Mapping[str, Any], names: Names, notes: Sequence[Markup] = ()) -> Formula:
    """A formula of a result after its symbol, or alone."""
    if not letter:
        return Formula("", typesetting.formula(part["text"], names), part["text"], notes=tuple(notes))
    math = typesetting.equation(letter, part["text"], names)
    return Formula(letter, math, f"{letter} = {part['text']}", f"{letter} = {part.get('latex', '')}", tuple(notes))


def _steps(part: Mapping[str, Any], names: Names) -> tuple[Markup, ...]:
    steps = [*(part.get("explanation") or ()), *(part.get("details") or ())]
    found = [typesetting.sentence(step, names) for step in steps[:MAX_STEPS]]
    left = len(steps) - MAX_STEPS
    return (*found, Markup("{} more steps are in the JSON.").format(left)) if left > 0 else tuple(found)


def _typed(system: Mapping[str, Any], names: Names) -> list[Formula]:
    """The equations as they were typed, in the reading of the service; solved ones where these cannot be shown."""
    given = (system.get("given") or {}).get("equations")
    if not isinstance(given, str) or len(given) > typesetting.MAX_CHARACTERS or "t" not in (system.get("time") or "t"):
        return _equations(system, names)
    try:
        pairs = reader.read_equations(given, names)
        lines = [f"{printing.to_text(left)} = {printing.to_text(right)}" for left, right in pairs]
    except errors.InputError:
        return _equations(system, names)
    return _lines(lines, names) or _equations(system, names)


def _equations(system: Mapping[str, Any], names: Names) -> list[Formula]:
    return _lines([reader.equation_line(*pair) for pair in system["equations"].items()], names)


def _lines(texts: Iterable[str], names: Names) -> list[Formula]:
    return [Formula("", typesetting.formula(text, names), text) for text in texts]


def _about(result: Mapping[str, Any]) -> tuple[Markup, ...]:
    """The meaning of the names, stated once."""
    read = (
        Markup("{} {} {}").format(one["text"], "is" if one["as"] == reader.LEFT_OUT else "read as", one["as"])
        for one in result.get("readings") or ()
    )
    return (*typesetting.meanings(result["system"] or {}), *read)


def _listed(texts: Iterable[str], names: Names) -> Markup:
    return Markup(", ").join(typesetting.formula(text, names) for text in texts)


def _missing(result: Mapping[str, Any], grows: bool) -> tuple[str, ...]:
    """Parts that are not there, in words: the next ones of a result that grows."""
    found = [str(one["part"]) for one in result.get("incomplete") or ()]
    if grows and is_constrained(result) and "any_associated" in found:
        found = [part for part in found if part in ("any_associated", "reduced")]
    verdict = verdict_of(result)
    if not grows and (verdict == OPEN or (verdict == YES and is_constrained(result))):  # the headline says it
        found = [part for part in found if part not in (*QUESTIONS, "any_associated")]
    named = (growing.PARTS.get(part, {}).get("words") or part.replace("_", " ") for part in found)
    words = list(dict.fromkeys(named))
    return (*words[:MOST_SOUGHT], *(["more"] if len(words) > MOST_SOUGHT else [])) if grows else tuple(words)


# More.


def _answer_rows(shown: Mapping[str, Any], result: Mapping[str, Any], names: Names) -> list[Row]:
    """Conserved quantities, other Lagrangians, the multiplier, how many there are."""
    rows = []
    # Those of a motion on constraints are among its own rows.
    for one in [] if result.get("nonholonomic") else shown.get("first_integrals") or ():
        rows.append(_conserved(one, names))
    for other in shown.get("other_lagrangians") or ():
        hint = other.get("reason") or ""
        rows.append(Row("Another Lagrangian", hint, formulas=(formula_of("L", other, names),)))
    if shown.get("multiplier"):
        rows.append(Row("Multiplier", "the Hessian of L in the velocities", formulas=(
            Formula("", typesetting.matrix(shown["multiplier"], names), str(shown["multiplier"])),)))  # fmt: skip
    if space := shown.get("solution_space"):
        rows.append(Row("How many", f"{typesetting.capitalized(space['statement'])}."))
    return rows


def _conserved(one: Mapping[str, Any], names: Names) -> Row:
    """A first integral with the symmetry behind it."""
    symmetry = one.get("symmetry") or ""
    hint = one["name"] + f", by the symmetry {symmetry.replace('->', ARROW)}" * bool(symmetry)
    return Row("Conserved", typesetting.capitalized(hint), formulas=(formula_of("", one, names),))


def _more(result: Mapping[str, Any], names: Names) -> Iterable[Row]:
    """What was asked besides, and what there is instead of a no."""
    part = result.get("instead")
    if part and part["kind"] != "time":  # the part with time is a separate answer
        conditions = [part["clock"]] if part.get("clock") else part.get("conditions") or ()
        hint = Markup("{} {}").format(INSTEAD[part["kind"]], _listed(conditions, names))
        yield Row("Instead", hint, formulas=tuple(_formulas(part, result, names)))
    for name, part in (result.get("kinds") or {}).items():
        verdict = VERDICTS.get(part["verdict"], OPEN)
        found = tuple(_formulas(part, result, names))
        told = Markup.escape(typesetting.capitalized(part.get("reason") or ""))
        if part.get("exceptions"):
            told += Markup(". " * bool(told)) + _general(part["exceptions"], result, names)
        yield Row(KIND_NAMES.get(name, typesetting.capitalized(name)), told, verdict, ANSWERS[verdict], found)
    if clock := result.get("with_clock"):
        yield _clock_row(clock, result, names)
    if cases := result.get("special_cases"):
        yield Row("Special cases", Markup("").join(_special(cases, names)))
    seconds = (result.get("provenance") or {}).get("seconds") or {}
    spent = seconds.get("all", sum(value for value in seconds.values() if isinstance(value, int | float)))
    if spent:
        yield Row("Time", f"Computed in {prices.duration(spent)}.")


def _clock_row(clock: Mapping[str, Any], result: Mapping[str, Any], names: Names) -> Row:
    factor = typesetting.formula(clock["factor"], names)
    became = Markup("With dτ = {} dt the equations become {}.").format(factor, _solved(clock, names))
    return _row("Another clock", Markup("dτ = {} dt").format(factor), clock, result, names, [became])


def _row(
    name: str, hint: Markup | str, part: Mapping[str, Any], result: Mapping[str, Any], names: Names,
    before: Sequence[Markup] = (), after: Sequence[Markup] = (), is_main: bool = False,
) -> Row:  # fmt: skip
    """The row of an answer: its verdict, its formulas, and its proof between other sentences."""
    found = _common((part.get("verdict"), part.get("verdict_with_time")))
    word = "Yes, with t" if found == YES and part.get("verdict") != "variational" else ANSWERS[found]
    reason = [Markup.escape(typesetting.capitalized(part["reason"]))] if part.get("reason") else []
    domain = _listed((part.get("lagrangian") or {}).get("domain") or (), names)
    where = [Markup("L is defined where {}.").format(domain)] if domain else []
    steps = (*before, *where, *_steps(part, names), *after, *reason, *_checked([part]))
    return Row(name, hint, found, word, tuple(_formulas(part, result, names)), steps, is_main, domain)


def _solved(part: Mapping[str, Any], names: Names) -> Markup:
    """The equations of a part, solved for the accelerations."""
    return Markup(", ").join(formula.math for formula in _equations(part, names))


def _general(exceptions: Sequence[str], result: Mapping[str, Any], names: Names) -> Markup:
    """For which parameters the answer was proven, with a link to a form that asks about the others."""
    system = result["system"]
    listed = Markup(", ").join(_listed([one], names) if "=" in one else Markup.escape(one) for one in exceptions)
    parameters = _listed(system["parameters"], names)
    if (result.get("special_cases") or {}).get("complete"):
        return Markup('For general {}; <a href="#more">special values</a> are decided, too.').format(parameters)
    given = system.get("given")
    address = forms.question_address({**given, "special_cases": True}) if isinstance(given, dict) else ""
    decide = Markup(' <a href="{}">Decide special values</a>.').format(address) if address else Markup("")
    left_out = Markup(" (not decided here: {})").format(listed) if canonical.are_found(exceptions) else ""
    return Markup("For general {}{}.{}").format(parameters, left_out, decide)


def _special(cases: Mapping[str, Any], names: Names) -> Iterable[Markup]:
    """The cases in which a Lagrangian exists, and the tree of the decisions."""

    def node(case: Mapping[str, Any]) -> Markup:
        texts = [one["text"] for one in case["conditions"]]
        verdict = VERDICTS.get(case["verdict"], OPEN)
        if case.get("verdict_with_time") == "variational":
            verdict = YES
        inner = Markup("").join(node(child) for child in case["children"])
        shown = case.get("lagrangian")  # of results that an older engine stored there is none
        found = Markup(", L = {}").format(typesetting.formula(shown["text"], names)) if shown else ""
        return Markup("<li>{}: {}{}{}</li>").format(
            _listed(texts, names) or "in general", _colored(verdict, BADGES[verdict]), found,
            Markup("<ul>{}</ul>").format(inner) if inner else "",
        )  # fmt: skip

    yield Markup("<ul>{}</ul>").format(node(cases["tree"]))
    told = (
        "The list is complete: no other parameter values change the verdict."
        if cases["complete"]
        else "Other parameter values may change the verdict."
    )
    yield Markup("{} case{} examined. {}").format(cases["examined"], "s" * (cases["examined"] != 1), told)


def _matrices(conditions: Mapping[str, Any] | None, names: Names) -> Iterable[Markup]:
    """Phi, nabla Phi, and each nonzero block of R; what would make the page too long is only named."""
    if conditions is None:
        return
    wanted = [(left, conditions[key]) for key, left in TENSORS if conditions.get(key)]
    for index, block in enumerate(conditions.get("R") or [], start=1):
        if any(entry != "0" for row in block for entry in row):
            wanted.append((f"<msup><mi>R</mi><mn>{index}</mn></msup>", block))
    room = LONGEST_MATRICES
    for left, rows in wanted:
        room -= (length := sum(len(entry) for row in rows for entry in row))
        inner = typesetting.matrix_inner(rows, names) if room >= 0 else None
        if inner is not None:
            yield typesetting.math(f"<mrow>{left}<mo>=</mo>{inner}</mrow>", display=True)
        else:
            room += length
            yield Markup("{} has {:,} characters: it is in the JSON.").format(typesetting.math(left), length)


# A motion on constraints.


def _constrained(result: Mapping[str, Any], names: Names, verdict: str, brief: bool, pending: Collection[str]) -> Sheet:
    part = result.get("nonholonomic") or {}
    motions = growing.motions_of(result) or [{}]
    table = tuple(_rows(result, part, motions[0], names, pending))
    main = next((row for row in table if row.is_main), None)
    asked = [formula_of("L", part["lagrangian"], names)] if part.get("lagrangian") else []
    asked += _lines([f"{one['text']} = 0" for one in part.get("constraints") or ()], names)
    if not asked:
        asked = _equations(result["system"] or {"equations": {}}, names)
    # Those of the reduced motion and of another clock are about other equations.
    systems = [row for row in table if row.formulas and row.verdict == YES and row.name not in OF_OTHERS]
    shown = main if main and main.formulas else systems[0] if systems and verdict == YES else None
    notes = _checked([one for one in (motions[0], *part.get("associated", ())) if one.get("checked")])
    if motions[0].get("exceptions"):
        notes.insert(0, _general(motions[0]["exceptions"], result, names))
    # What ended a question that was begun is the reason, not how far it was.
    ended = [one["reason"] for one in result.get("incomplete") or () if one["part"] == "any_associated"]
    reason = (ended or [motions[0].get("reason")])[0]
    if verdict == OPEN and reason and not pending:
        notes.insert(0, Markup("{}.").format(typesetting.capitalized(reason).rstrip(".")))
    if verdict == YES and not shown and not pending:
        notes.append(Markup("None was found in closed form."))
    if shown and shown.domain:
        notes.insert(0, Markup("These formulas hold where {}.").format(shown.domain))
    if shown and shown is not main:
        notes.append(Markup("L and H are those of the {} associated system.").format(shown.name.lower()))
    besides = [row.name for row in table if verdict == NO and row.verdict == YES]
    if besides:
        how = "The reduced motion can." if besides[0] == "Reduced" else "With another clock the reduced motion can."
        notes.append(Markup(how))
    sentence = _motion_sentence(verdict, motions[0], pending)
    steps = () if brief or verdict != NO else _steps(motions[0], names)
    gist = (("Conclusion", steps[-1]),) if steps else ()
    cases = (
        Case(verdict, sentence, tuple(notes), shown.formulas if shown else (), (), (), gist),
        *(
            Case(own := _verdict_of_branch({"any_associated": one}, result), _motion_sentence(own, one), (
                Markup("Where {}.").format(_listed(branch.get("domain") or (), names)),), (), (), ())
            for one, branch in zip(motions[1:], text_page.branches_of(result)[1:], strict=False)
        ),
    )  # fmt: skip
    if len(cases) > 1:
        sentence = Markup("The answer {}: {} cases.").format(_colored(verdict, "depends on the case"), len(cases))
    return Sheet(
        title_of(result, pending), verdict, badge_of(result, pending), sentence, tuple(notes), tuple(asked),
        _about(result), cases,
        table, () if brief else tuple(_motion_more(result, part, names)), (), _missing(result, bool(pending)),
    )  # fmt: skip


def rows_of(sheet: Sheet) -> list[tuple[str, ...]]:
    """The table of a motion on constraints as texts."""
    found = [(row, {one.letter: one.text.partition(" = ")[2] for one in row.formulas}) for row in sheet.table]
    lines = [(row.name, row.word, *(texts.get(letter, "") for letter in "LH")) for row, texts in found]
    return [("system", "Hamiltonian?", "L", "H"), *lines]


def _rows(
    result: Mapping[str, Any],
    part: Mapping[str, Any],
    motion: Mapping[str, Any],
    names: Names,
    pending: Collection[str],
) -> Iterable[Row]:
    """First, second, third, any, reduced, another clock."""
    for one in part.get("associated") or ():
        row = _associated_row(one, result, names)
        yield replace(row, word=SEEKING) if row.verdict == OPEN and "existence" in pending else row
    if motion:
        after = []
        if lagrangian := motion.get("lagrangian"):
            on = [formula_of("l", lagrangian["on_constraints"], names)]
            on += [formula_of(f"lambda_{k}", one, names) for k, one in enumerate(lagrangian["transverse_momenta"], 1)]
            after.append(Markup("On the constraints {}.").format(Markup(", ").join(one.math for one in on)))
        if motion.get("freedom"):
            after.append(Markup("L along the constraints depends on {}.").format(motion["freedom"]))
        row = _row("Any", "all associated systems at once", motion, result, names, after=after, is_main=True)
        if row.verdict == OPEN and _verdict_of_branch({}, result) == YES:  # one of those above is enough
            row = replace(row, verdict=YES, word=ANSWERS[YES], steps=())
        yield replace(row, word=SEEKING) if row.verdict == OPEN and "any_associated" in pending else row
    reduced = result.get("reduced")
    if not reduced:
        if "reduced" in pending:
            yield Row("Reduced", "", OPEN, SEEKING)
        return
    over = Markup("the equations of {} alone").format(_listed(reduced["coordinates"], names))
    before = [Markup("The equations {}.").format(_solved(reduced, names))]
    before += [Markup.escape(reduced["statement"])] if reduced.get("statement") else []
    row = _row("Reduced", over, reduced, result, names, before)
    yield row
    clock = result.get("with_clock") or reduced.get("with_clock")
    if clock:
        yield _clock_row(clock, result, names)
    elif row.verdict == YES:
        yield Row("Another clock", "a new time, dτ = N dt", "", "Not needed")
    else:
        why = reduced.get("without_clock")
        yield Row(
            "Another clock", "a new time, dτ = N dt", OPEN, "None found", (), (Markup.escape(why),) if why else ()
        )


def _associated_row(one: Mapping[str, Any], result: Mapping[str, Any], names: Names) -> Row:
    name, hint = typesetting.capitalized(one["kind"]), HINTS.get(one["kind"], "")
    if not one["defined"]:
        why = Markup(typesetting.sentence(one.get("explanation") or "", names))
        return Row(name, hint, "", "Not defined", (), (why,))
    where = _listed(one.get("domain") or (), names)
    is_asked = (result["system"].get("given") or {}).get("associated") != "any"
    system = Markup("The system {}{}.").format(_solved(one, names), Markup(" where {}").format(where) if where else "")
    if one["verdict"] == "undetermined" and not is_asked:
        return Row(name, hint, "", "Not asked", (), (system,))
    return _row(name, hint, {**one, "explanation": one.get("steps")}, result, names, [system])


def _motion_more(result: Mapping[str, Any], part: Mapping[str, Any], names: Names) -> Iterable[Row]:
    """The motion, what it conserves, the forces of the constraints, and what was asked besides."""
    if not part:
        return
    motion = part["equations_of_motion"]
    lines = [f"{name}'' = {f['text']}" for name, f in motion["second_order"].items()]
    lines += [f"{name}' = {f['text']}" for name, f in motion["first_order"].items()]
    yield Row("Motion", formulas=tuple(_lines(lines, names)))
    for k, one in enumerate(motion.get("multipliers") or (), 1):
        yield Row("Multiplier of the constraint", formulas=(formula_of(f"lambda_{k}", one, names),))
    yield from (_conserved(one, names) for one in part.get("first_integrals") or ())
    density = part["measure_density"].get("density")
    told = typesetting.sentence(part["measure_density"], names)
    yield Row("Invariant measure", told, formulas=(formula_of("N", density, names),) if density else ())
    for key, name in (("integrable", "Integrability"), ("paper_class", "Class")):
        if part[key].get("statement"):
            yield Row(name, typesetting.sentence(part[key], names))
    for entry in part.get("hamiltonisation") or ():
        stated = [
            Markup("{}: {}").format(STATED[one["verdict"]], typesetting.sentence(one, names))
            for one in entry["statements"]
        ]
        zero = _listed([f"{one['text']} = 0" for one in entry["constraints"]], names)
        word, label = "Confirmed" if entry["holds"] else "Not confirmed", typesetting.capitalized(entry["label"])
        yield Row(
            f"In phase space, {entry['associated']}", Markup("{} on {}").format(label, zero) if zero else label,
            YES if entry["holds"] else OPEN, word,
            (formula_of("H", entry["hamiltonian"], names),) if entry["hamiltonian"] else (), tuple(stated),
        )  # fmt: skip
    yield from _more(result, names)


# A Lagrangian alone.


def _forward(result: Mapping[str, Any], names: Names) -> Sheet:
    system = result["system"]
    momenta = Markup(", ").join(
        typesetting.equation(f"p_{name}", part["text"], names) for name, part in result["momenta"].items()
    )
    energy = formula_of("H", result["hamiltonian"], names, [Markup("with {}").format(momenta)])
    rows = [_conserved(part, names) for part in result["conserved"]]
    case = Case("", Markup("These are its equations of motion."), (), (*_equations(system, names), energy), (), ())
    return Sheet(
        title_of(result), "", "", case.sentence, (),
        (formula_of("L", result["lagrangian"], names),), _about(result), (case,), more=tuple(rows),
    )  # fmt: skip


# One's own Lagrangian.


@dataclass(frozen=True, slots=True)
class Judged:
    """The judgment of a visitor's own L: a word, a sentence, formulas, and reasons."""

    lagrangian: str
    verdict: str
    headline: str
    lines: list[Markup] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)


def judged_of(check: Mapping[str, Any], names: Names) -> Judged:
    """The verdict on a visitor's L, with the accelerations that it gives along the motion, and where it fails."""
    lines: list[Markup] = []
    names = _with_own_names(check["lagrangian"], names)
    for name, f in (check.get("equations") or {}).items():
        if check["verdict"] != "valid":
            lines.append(Markup("Your L gives {}").format(typesetting.formula(f"{name}'' = {f['text']}", names)))
    for cell in check.get("cells") or ():
        if cell["verdict"] != "valid" and cell["domain"]:
            lines.append(Markup("It fails where {}").format(_listed(cell["domain"], names)))
    verdict, headline = OWN[check["verdict"]]
    reasons = [] if verdict == YES else list(check.get("reasons") or ())  # of a yes the headline says them
    return Judged(check["lagrangian"], verdict, headline, lines, reasons)


def _with_own_names(lagrangian: str, names: Names) -> Names:
    """The names with the constants and functions that occur in a visitor's L alone."""
    from inverse_service.reading.document_names import GUESS, Declared, known_names
    from inverse_service.web.pages.forms import right_side

    try:
        declared = Declared(names.coordinates, GUESS, names.functions)
        found = known_names(declared, {"": right_side(lagrangian)}, order=1).names
    except errors.InputError:
        return names
    parameters = tuple(dict.fromkeys((*names.parameters, *found.parameters)))
    return replace(names, parameters=parameters, functions=found.functions)
