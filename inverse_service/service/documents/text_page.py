"""What a result says to a person, line by line, and these lines as plain text."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from inverse_service import errors
from inverse_service.expressions import tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import canonical, growing

LONG = 300
# Of the table of many results, as they are in each.
COLUMNS = ("id", "line", "verdict", "verdict_with_time", "checked", "question", "reason")
MOST_OF_CONDITIONS = 5_000
CONDITIONS = (
    "Conditions: g Phi and g nabla_Phi must be symmetric, and the cyclic sums of g R must vanish. Entries not 0:"
)
QUESTIONS = {False: "L(q, q')", True: "L(t, q, q')"}
SENTENCES = {
    "variational": "Variational{where}: a regular Lagrangian {question} exists.",
    "not_variational": "Not variational{where}: no regular Lagrangian {question} exists.",
    "undetermined": "Undetermined{where}: the program could not decide whether a regular Lagrangian {question} exists.",
}
# The numbers of a run, with their headings in a table.
QUANTITIES = (
    ("max_energy_error", "energy error"),
    ("max_constraint", "constraint"),
    ("max_momentum_drift", "momentum drift"),
    ("max_phase_error", "phase error"),
    ("estimated_error", "estimated error"),
    ("max_error", "error"),
    ("circle.radius_first", "radius, first circle"),
    ("circle.radius_last", "radius, last circle"),
    ("circle.centre_drift", "drift of the center"),
)
Side = str | Mapping[str, Any]  # a formula; or its "text", and its "latex" or what this is made of, the "whole"
Formula = Side | tuple[Side, Side]
_YES_OR_NO = {"variational": "yes", "not_variational": "no", "undetermined": "undetermined"}
FORMULAS = (("L", "lagrangian"), ("D", "dissipation"))
DEFINITE = "positive_definite"
# A Hamiltonian in the velocities longer than this is not printed: L and the momenta say the same.
LONGEST_IMPLICIT = 300


@dataclass(frozen=True, slots=True)
class Line:
    """One line of an answer: words and formulas alternately, an equation by its two sides, and where it holds.

    `text` is the same without what LaTeX shows on lines of its own.
    """

    depth: int = 0
    parts: tuple[Formula, ...] = ()
    conditions: tuple[str, ...] = ()
    text: str = ""


EMPTY = Line()


def text_page(result: dict[str, Any], explain: bool) -> str:
    """The whole page, ending with a newline."""
    lines = [written for line in outline(result, explain) for written in _written(line)]
    return "\n".join(lines) + "\n"


def _written(line: Line) -> Iterator[str]:
    if line.parts or not line.conditions:
        yield f"{'  ' * line.depth}{line.text or ''.join(map(_plain, line.parts))}"
    yield from (f"{'  ' * (line.depth + 2)}where {condition}" for condition in line.conditions)


def _plain(formula: Formula) -> str:
    sides = formula if isinstance(formula, tuple) else (formula,)
    return " = ".join(side if isinstance(side, str) else side["text"] for side in sides)


def _said(depth: int, words: str) -> Line:
    return Line(depth, (words,))


def _formula(depth: int, left: Side, right: Side, conditions: Iterable[str] = ()) -> Line:
    return Line(depth, ("", (left, right)), tuple(conditions))


def outline(result: dict[str, Any], explain: bool) -> Iterator[Line]:
    """All that a result says, line by line; text and LaTeX print these."""
    if is_forward_result(result):
        yield from _forward(result)
        return
    part, parameters = result.get("nonholonomic"), (result["system"] or {}).get("parameters") or ()
    for each in growing.motions_of(result):
        yield from _any_associated(each, explain, parameters)
    if part is not None:
        yield from (*_nonholonomic(part), EMPTY)
    yield from (_said(1, words) for words in guessed_words(result))
    yield from (*_system(result["system"]), *_cases(result))
    for place, branch in enumerate(() if asks_motion_alone(result) else branches_of(result)):
        yield from (*[EMPTY] * (place > 0), *_both_answers(branch, result, explain))
    for branch in branches_of(result) if part is None else ():
        if branch.get("first_integrals"):
            where = f" on {', '.join(branch['domain'])}" if branch is not result else ""
            yield from (EMPTY, *_first_integrals(branch["first_integrals"], where))
    if result.get("special_cases") is not None:
        yield from (EMPTY, *_special_cases(result["special_cases"]))
    if part := result.get("instead"):
        yield EMPTY
        if told := instead_answered(part):
            yield from (_said(0, told), *_formulas(part, 1), _said(1, f"independent check: {part['checked']}"))
    if result.get("reduced"):
        yield from (EMPTY, *_reduced(result["reduced"]))
        yield from _answer({"solution_space": None, "explanation": [], **result["reduced"]}, False, False)
    if part := result.get("with_clock") or (result.get("reduced") or {}).get("with_clock"):
        yield from (EMPTY, Line(0, ("With the clock dtau = (", part["factor"], ") dt, x' being dx/dtau:")))
        yield from _answer({"solution_space": None, "explanation": [], **part}, False, False)
    if result.get("kinds"):
        yield from (EMPTY, _said(0, "Lagrangians of a kind:"))
        for told, part in kinds_answered(result):
            yield from (_said(1, told), *_formulas(part, 2))
    if explain:
        yield from (EMPTY, *_conditions(result["conditions"]))


def asks_motion_alone(result: Mapping[str, Any]) -> bool:
    """Whether only the motion was asked about, so that the main fields decide nothing."""
    given = (result.get("system") or {}).get("given")
    return bool(result.get("any_associated")) and growing.asks_motion_alone(given)


def branches_of(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The answers on each branch; the result itself where there is one."""
    return result.get("branches") or [result]


def quantities(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(key, heading) of the numbers that some method of a run has."""
    methods = result["methods"]
    return [pair for pair in QUANTITIES if any(value_at(method, pair[0]) is not None for method in methods)]


def value_at(method: Mapping[str, Any], key: str) -> Any:
    """The value of a method under a key, or under "outer.inner"."""
    outer, _, inner = key.partition(".")
    found = method.get(outer)
    return found.get(inner) if inner and isinstance(found, Mapping) else found


def why(method: Mapping[str, Any]) -> str:
    """Why a method stopped or did not begin, or where what it did is not the motion."""
    stopped = (method.get("stopped") or {}).get("sentence")
    return stopped or method.get("reason") or method.get("doubt") or ""


def notes_of_formulas(method: Mapping[str, Any]) -> list[str]:
    """What a run says about its events and the observables by formula, each after its formula or name."""
    parts = [(one["when"], one) for one in method.get("events") or ()]
    parts += (method.get("observables") or {}).items()
    return [f"{name}: {one['note']}" for name, one in parts if one.get("note")]


def common_verdict(answers: Iterable[Mapping[str, Any]], key: str = "verdict") -> Any:
    """The verdict where all of the answers have it, else "differs"."""
    verdicts = {one.get(key) for one in answers}
    return verdicts.pop() if len(verdicts) == 1 else "differs"


def kinds_answered(result: dict[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """A sentence about each kind, on the first case, and its answer."""
    where = f" on {', '.join(result['domain'])}" if len(branches_of(result)) > 1 else ""
    for name, part in (result.get("kinds") or {}).items():
        question = (part["certificate"] or {}).get("question")
        of = f", {QUESTIONS[question == 'time_dependent']}" if question else ""
        near = ", ".join(f"{letter} = {value}" for letter, value in part["near"].items()) if name == DEFINITE else ""
        check = f" (independent check: {part['checked']})" if part["checked"] else ""
        exceptions = part.get("exceptions")
        general = canonical.in_general(result["system"]["parameters"], exceptions) if exceptions else ""
        verdict = ", ".join(filter(None, (_YES_OR_NO[part["verdict"]], part["reason"], general)))
        yield f"{name}{of}{where}{' at ' * bool(near)}{near}: {verdict}{check}", part


def instead_answered(part: Mapping[str, Any]) -> str:
    """What there is instead; nothing where the Lagrangian is already on the page."""
    if part["kind"] == "rayleigh":
        return "Instead: a Lagrangian with friction, d(dL/dx')/dt - dL/dx = dD/dx' for each coordinate x."
    if part["kind"] == "parameters":
        return f"Instead, where {', '.join(part['conditions'])}: a regular Lagrangian L(q, q')."
    return ""


def _formulas(part: Mapping[str, Any], depth: int) -> Iterator[Line]:
    """L and D, and where L is one."""
    found = [_formula(depth, sign, part[key]) for sign, key in FORMULAS if part[key]]
    if part["lagrangian"]:
        found[-1] = replace(found[-1], conditions=tuple(part["lagrangian"]["domain"]))
        found += [_said(depth + 2, where) for where in regular_where(part["lagrangian"])]
    yield from found


def _cases(result: dict[str, Any]) -> Iterator[Line]:
    branches, left = branches_of(result), result.get("not_answered") or []
    if len(branches) > 1 or left:
        yield _said(0, f"{len(branches)} cases{', which differ' * (common_verdict(branches) == 'differs')}:")
        for each in branches:
            yield Line(1, ("", ", ".join(each["domain"]), f": {_spaced(each['verdict'])}"))
        yield from (Line(1, ("", _place_of(each), f": not answered, {each['reason']}")) for each in left)
        yield EMPTY


def _place_of(part: Mapping[str, Any]) -> str:
    """Where a cell is: its conditions, or a point of it."""
    return ", ".join(part["domain"]) or ", ".join(f"{name} = {value}" for name, value in part["near"].items())


def _both_answers(branch: Mapping[str, Any], result: dict[str, Any], explain: bool) -> Iterator[Line]:
    is_decided = (result.get("special_cases") or {}).get("complete")  # for every value of the parameters, below
    for place, (answer, with_time) in enumerate(answers_of(branch, result)):
        yield from [EMPTY] * place
        shown = {**answer, "exceptions": ["see below"]} if is_decided and answer.get("exceptions") else answer
        yield from _answer(shown, with_time, explain, result["system"]["parameters"])
    if branch["with_time"] is None and branch["verdict_with_time"] is not None and not asks_for_time(result):
        yield from (EMPTY, _verdict_line(branch["verdict_with_time"], True, branch.get("domain")))
        if branch["verdict"] == branch["verdict_with_time"] == "undetermined" and branch["reason"]:
            yield _said(1, "for the same reason")


def guessed_words(result: Mapping[str, Any]) -> list[str]:
    """How names that the document did not declare were taken, in one line; none where all were declared."""
    functions = (result["system"] or {}).get("functions", {})
    names = result.get("guessed") or []
    taken = {
        "as constants": [name for name in names if name not in functions],
        "as any functions": [f"{name}({', '.join(functions[name])})" for name in names if name in functions],
    }
    parts = [f"taken {how}: {', '.join(found)}" for how, found in taken.items() if found]
    read = [f"{note['text']} as {note['as']}" for note in result.get("readings") or [] if note["as"] != reader.LEFT_OUT]
    left = [note["text"] for note in result.get("readings") or [] if note["as"] == reader.LEFT_OUT]
    lines = [f"not declared, {'; '.join(parts)}"] * bool(parts) + [f"read {', '.join(read)}"] * bool(read)
    return lines + [f"left out: {', '.join(left)}"] * bool(left)


def first_answer(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """The answer that a reader meets first; a result without a question is its own."""
    asked = result.get("verdict") and "question" in result
    return answers_of(result, result)[0][0] if asked else result


def conditions_of(answer: Mapping[str, Any]) -> tuple[str, ...]:
    """Where the answer holds and its L is one."""
    conditions = (*(answer.get("domain") or ()), *(answer.get("lagrangian") or {}).get("domain", ()))
    return tuple(dict.fromkeys(conditions))


def row_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """The columns that are compared first: verdicts, L, H, where they hold, how many multipliers, seconds, size.

    All of them are of the first of the `branches`, but the verdicts: "differs" where the branches differ.
    """
    if not isinstance(result, Mapping):
        raise errors.InputError("A table needs results.")
    row = {key: result.get(key) for key in COLUMNS}
    for key in ("verdict", "verdict_with_time"):
        row[key] = common_verdict(branches_of(result), key)
    if error := result.get("error"):
        row |= {"verdict": "error", "reason": error["detail"]}
    first = first_answer(result)
    for letter, key in (("L", "lagrangian"), ("H", "hamiltonian")):
        row[letter] = (first.get(key) or {}).get("text")
    space, system = result.get("solution_space") or {}, result.get("system") or {}
    seconds = (result.get("provenance") or {}).get("seconds") or {}
    row |= {"statement": space.get("statement"), "n": len(system.get("coordinates", ())), "order": space.get("order")}
    row |= {"seconds": sum(seconds.values()) if seconds else None}
    return row | {"where": ", ".join(conditions_of(first)), "branches": len(branches_of(result))}


def answers_of(branch: Mapping[str, Any], result: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], bool]]:
    """The answers on a branch in a reader's order, each with whether it is on L(t, q, q').

    The question that was asked comes first, unless it has a Lagrangian that was not found in closed form, or the other
    one has a Lagrangian of a simpler kind.
    """
    main, other = (branch, asks_for_time(result)), branch["with_time"]
    if other is None:
        return [main]
    texts = [part["lagrangian"]["text"] for part in (branch, other) if part["lagrangian"]]
    kinds = [_reading_class(text, result["system"]) for text in texts]
    exists_only = not branch["lagrangian"] and branch["verdict"] == "variational"
    is_better = kinds[1] < kinds[0] if len(kinds) == 2 else exists_only and bool(texts)
    return [(other, True), main] if is_better else [main, (other, True)]


def _reading_class(lagrangian: str, system: Mapping[str, Any]) -> int:
    try:
        return ex.reading_class(reader.read_formula(lagrangian, names_of(system)), ex.Symbol(system.get("time", "t")))
    except errors.InputError:
        return 3


def names_of(system: Mapping[str, Any] | None, integrals: Mapping[str, Any] | None = None) -> Names:
    """The names of a result's system or of a document; momenta, entries of the multiplier and L, H are parameters.

    `integrals` are functions that an answer has besides.
    """
    if system is None:
        return Names(parameters=("L", "H"))
    equations, given = system.get("equations"), system.get("parameters") or ()
    coordinates = tuple(system.get("coordinates") or (equations if isinstance(equations, Mapping) else ()))
    n = len(coordinates)
    entries = [f"{letter}_{i}{j}" for letter in "gh" for i in range(1, n + 1) for j in range(i, n + 1)]
    functions = {name: tuple(arguments) for name, arguments in (system.get("functions") or {}).items()}
    functions |= {name: tuple(known["arguments"]) for name, known in (integrals or {}).items()}
    parameters = () if isinstance(given, str) else given  # "guess"
    words = (system.get("time", "t"), *parameters, *(f"p_{name}" for name in coordinates), *entries, "L", "H")
    taken = {*coordinates, *functions, "t"}
    return Names(coordinates, tuple(dict.fromkeys(word for word in words if word not in taken)), functions)


def asks_for_time(result: Mapping[str, Any]) -> bool:
    """Whether the main fields answer L(t, q, q')."""
    return bool(result["question"] == QUESTIONS[True])


def _verdict_line(verdict: str, with_time: bool, domain: Sequence[str] | None = None) -> Line:
    """The verdict as a sentence that says which question it answers, and on which set."""
    begin, end = SENTENCES[verdict].format(question=QUESTIONS[with_time], where="\n").split("\n")
    return Line(0, (f"{begin} on ", ", ".join(domain), f", at generic points{end}") if domain else (begin + end,))


def _system(system: dict[str, Any] | None) -> Iterator[Line]:
    if system is None:
        return
    if system["name"]:
        yield _said(0, system["name"])
    for name, text in system["equations"].items():
        yield Line(1, ("", {"text": reader.equation_line(name, text), "latex": system["latex"][name]}))
    yield EMPTY


def _answer(
    answer: Mapping[str, Any], with_time: bool, explain: bool, parameters: Sequence[str] = ()
) -> Iterator[Line]:
    yield _verdict_line(answer["verdict"], with_time, answer.get("domain"))
    yield from _reason_and_check(answer, parameters)
    if answer["lagrangian"] is not None:
        yield _formula(1, "L", answer["lagrangian"])
        yield from _integrals(answer.get("integrals") or {})
        if domain := answer["lagrangian"]["domain"]:
            yield Line(1, conditions=tuple(domain))
        yield from (_said(3, where) for where in regular_where(answer["lagrangian"]))
    elif answer["verdict"] == "variational":
        yield _said(1, "no Lagrangian in closed form was found" + "; --explain says what is known" * (not explain))
    if answer["hamiltonian"] is not None:
        yield from _hamiltonian(answer["hamiltonian"])
    if answer["solution_space"] is not None:
        yield _said(1, answer["solution_space"]["statement"])
    if explain:
        yield from ([EMPTY] if answer["explanation"] else [])
        yield from _steps(answer["explanation"])
        if answer.get("details"):
            yield _said(1, "(How it was found, and what else proves it: `details` of --format json.)")


def _reason_and_check(part: Mapping[str, Any], parameters: Sequence[str]) -> Iterator[Line]:
    if part.get("exceptions"):
        yield _said(1, canonical.in_general(parameters, part["exceptions"]))
    if part["reason"]:
        yield _said(1, part["reason"])
    if part["checked"]:
        yield _said(1, f"independent check: {part['checked']}")


def regular_where(lagrangian: Mapping[str, Any]) -> list[str]:
    """Where a Lagrangian is regular, if that is not everywhere or is not known."""
    told = lagrangian.get("regular", "")
    return [] if told in ("", "everywhere") else [f"regular {told}"]


def _integrals(integrals: dict[str, Any]) -> Iterator[Line]:
    """F(t) = ∫ f(t) dt, or the derivatives where there are several."""
    for name, known in integrals.items():
        whole, slopes = f"{name}({', '.join(known['arguments'])})", known["derivatives"]
        for variable, slope in slopes.items():
            integrand = f"({slope})" if is_sum(slope) else slope
            sides = (whole, f"∫ {integrand} d{variable}") if len(slopes) == 1 else (f"d{whole}/d{variable}", slope)
            yield Line(3, ("with ", sides))


def is_sum(formula: str) -> bool:
    """Whether a formula needs brackets before dx; one with a sum inside has them too."""
    return " + " in formula or " - " in formula


def integral_words(integrals: dict[str, Any]) -> list[str]:
    """ "with F(x) = ∫ f(x) dx" for each integral in a formula."""
    return ["".join(map(_plain, line.parts)) for line in _integrals(integrals)]


def _hamiltonian(hamiltonian: dict[str, Any]) -> Iterator[Line]:
    if hamiltonian["implicit"] and len(hamiltonian["text"]) > LONGEST_IMPLICIT:
        yield Line(1, ("energy in the velocities: ", "p v - L"))
    else:
        yield _with_domain("H", hamiltonian, len(hamiltonian["text"]))
    if hamiltonian.get("reason"):
        yield _said(3, hamiltonian["reason"])
    yield from (_formula(3, momentum, text) for momentum, text in hamiltonian["momenta"].items())
    yield from (Line(3, ("constraint ", (text, "0"))) for text in hamiltonian["constraints"])


def _steps(steps: Iterable[Mapping[str, Any]]) -> Iterator[Line]:
    for k, step in enumerate(steps, 1):
        first, *rest = _parts(step, "text")
        yield Line(1, (f"{k}. {first}", *rest), text=f"{k}. {step['text']}")


def _parts(said: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Words and formulas of a sentence, alternately."""
    parts = said.get("parts") or [said[key]]
    return (said[key],) if isinstance(parts[0], Mapping) else tuple(parts)  # of an older version


def _conditions(conditions: dict[str, Any] | None) -> Iterator[Line]:
    if conditions is None:
        return
    yield _said(0, CONDITIONS)
    left = MOST_OF_CONDITIONS
    for name in ("Phi", "nabla_Phi", "R"):
        found = [(place, text) for place, text in _entries(conditions[name], ()) if text != "0"]
        size = sum(len(text) for _, text in found)
        if not found:
            yield _formula(1, {"text": name, "whole": name.replace("_", " ")}, "0")
        elif size > left:
            yield _said(1, f"{name}: {size} characters, in `conditions` of --format json")
        else:
            left -= size
            for place, text in found:
                entry = f"{name}[{', '.join(map(str, place))}]"
                yield _formula(1, {"text": entry, "whole": entry.replace("_", " ")}, text)


def _entries(part: Any, place: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], str]]:
    if isinstance(part, str):
        yield place, part
    else:
        for k, inner in enumerate(part, 1):
            yield from _entries(inner, (*place, k))


def _spaced(verdict: str) -> str:
    """not_variational as people write it."""
    return verdict.replace("_", " ")


def is_forward_result(result: dict[str, Any]) -> bool:
    """Whether a result answers the forward problem."""
    return str(result.get("format", "")).startswith("inverse-service/forward")


def _forward(result: dict[str, Any]) -> Iterator[Line]:
    """Equations, momenta, Hamiltonian, and what is conserved, one a line."""
    system, hamiltonian = result["system"], result["hamiltonian"]
    if system["name"]:
        yield _said(0, system["name"])
    yield from (_said(1, words) for words in guessed_words(result))
    yield _formula(1, "L", result["lagrangian"])
    for name, found in result["equations"].items():
        yield _formula(1, f"{name}''", {"text": found["text"], "latex": system["latex"][name].partition(" = ")[2]})
    for symbol, momentum in zip(hamiltonian["momenta"], result["momenta"].values(), strict=True):
        yield _formula(1, symbol, momentum)
    yield _formula(1, "H", hamiltonian, hamiltonian.get("domain", ()))
    yield from (Line(1, (f"{found['name']} = ", found)) for found in result["conserved"])


def _special_cases(part: dict[str, Any]) -> Iterator[Line]:
    """The answer first, then the tree, then what is not known."""
    yield _said(0, "For which parameters?")
    yield from _cases_answered(part["variational_when"], "A Lagrangian exists")
    if part["variational_when_with_time"] not in (None, part["variational_when"]):
        yield from _cases_answered(part["variational_when_with_time"], "A Lagrangian L(t, q, q') exists")
    yield _said(1, f"Tree of cases ({part['examined']} examined):")
    yield from _tree(part["tree"], 2)
    if part["complete"]:
        yield _said(1, "The tree is complete: no other case has another verdict.")
    else:
        only = " for L(q, q'); for L(t, q, q') it is" if part["complete_with_time"] else ""
        yield _said(1, f"The tree may not be complete{only}:")
        yield from (_said(2, reason) for reason in part["reasons"])


def _tree(node: dict[str, Any], depth: int) -> Iterator[Line]:
    verdict = _spaced(node["verdict"])
    if node["verdict_with_time"] not in (None, node["verdict"]):
        verdict += f" (with t: {_spaced(node['verdict_with_time'])})"
    found = node.get("lagrangian")
    end: tuple[Formula, ...] = (f": {verdict}, ", ("L", found)) if found else (f": {verdict}",)
    yield Line(depth, _joined("", node["conditions"], end))
    for child in node["children"]:
        yield from _tree(child, depth + 1)


def _cases_answered(cases: list[dict[str, Any]], opening: str) -> Iterator[Line]:
    if not cases:
        yield _said(1, f"{opening} in none of the cases found.")
    for case in cases:
        end: tuple[Formula, ...] = (".",)
        for place, conditions in reversed([*enumerate(case["exceptions"])]):
            end = _joined("; " if place else ", except ", conditions, end)
        yield Line(1, _joined(f"{opening} ", case["conditions"], end))


def _joined(words: str, conditions: Sequence[Mapping[str, str]], end: tuple[Formula, ...]) -> tuple[Formula, ...]:
    """The words, the conditions of a case, and what follows them, which begins with words."""
    if not conditions:
        return (f"{words}in general{end[0]}", *end[1:])
    listed = [part for each in conditions for part in (", ", each)][1:]
    return (f"{words}where ", *listed, *end)


def _any_associated(part: dict[str, Any], explain: bool, parameters: Sequence[str] = ()) -> Iterator[Line]:
    """The answer about the motion itself: L, its restriction and transverse momenta, H and the image."""
    yield _statement(part)
    yield from _reason_and_check(part, parameters)
    found = part["lagrangian"]
    if found is not None:
        yield _with_domain("L", found)
        yield Line(1, ("on the constraints ", ("l", _brief(found["on_constraints"]))))
        yield from _numbered("lambda_{}", found["transverse_momenta"])
    elif part["verdict_with_time"] == "variational":
        yield _said(1, "no Lagrangian in closed form was found" + "; --explain shows how one starts" * (not explain))
    if part["hamiltonian"] is not None:
        yield _with_domain("H", part["hamiltonian"])
    yield from (Line(1, ("image ", (_brief(one), "0"))) for one in part["image"])
    if part["freedom"]:
        yield _said(1, f"up to total derivatives, L along the constraints depends on {part['freedom']}")
    yield from _steps(part["explanation"] if explain else ())
    yield EMPTY


def _statement(part: Mapping[str, Any]) -> Line:
    return Line(0, _parts(part, "statement"), text=part["statement"])


def _numbered(left: str, found: Iterable[Mapping[str, Any]]) -> Iterator[Line]:
    yield from (_formula(1, left.format(k), _brief(one)) for k, one in enumerate(found, 1))


def _nonholonomic(part: dict[str, Any]) -> Iterator[Line]:
    """The motion, what it keeps, the associated systems and the Hamiltonisations, line by line."""
    motion, measure = part["equations_of_motion"], part["measure_density"]
    yield _said(0, "Nonholonomic motion:")
    yield from (_formula(1, f"{name}''", _brief(found)) for name, found in motion["second_order"].items())
    yield from (_formula(1, f"{name}'", _brief(found)) for name, found in motion["first_order"].items())
    yield from _numbered("lambda_{}", motion["multipliers"])
    yield from (EMPTY, _statement(part["paper_class"]), _statement(part["integrable"]))
    yield from (Line(1, ("constant: ", found)) for found in part["integrable"]["integrals"])
    yield _statement(measure)
    if measure["density"] is not None:
        yield _formula(1, "N", _brief(measure["density"]))
    yield from (*_first_integrals(part["first_integrals"]), EMPTY, _said(0, "Associated second-order systems:"))
    for one in part["associated"]:
        checked = f" (independent check: {one['checked']})" if one["checked"] is not None else ""
        verdict, domain = _spaced(one["verdict"] or "not defined"), ", ".join(one.get("domain") or ())
        where: tuple[Formula, ...] = (f"{one['kind']}: {verdict} where ", domain, checked)
        yield Line(1, where if domain else (f"{one['kind']}: {verdict}{checked}",))
        if not one["defined"]:
            yield _said(2, one["explanation"])
    for one in part["hamiltonisation"]:
        yield from (EMPTY, _said(0, f"Hamiltonized by the {one['associated']} system, {one['label']}:"))
        yield _formula(1, "L", _brief(one["lagrangian"]))
        if one["hamiltonian"] is not None:
            yield _with_domain("H", one["hamiltonian"])
        yield from (Line(1, ("constraint ", (_brief(found), "0"))) for found in one["constraints"])
        yield from (_said(1, f"{each['verdict']}: {each['text']}") for each in one["statements"])
        if (flow := one["trajectory"]) is not None:
            words = (
                f"both flows over t = {flow['time']:g} from one start: positions differ by at most "
                f"{flow['difference']:.1e}, constraints by {flow['constraint']:.1e}, H by {flow['energy']:.1e}"
            )
            yield _said(1, words)
    yield from (EMPTY, _said(0, f"The remaining lines are about the associated system '{part['main']}':"))


def _reduced(part: dict[str, Any]) -> Iterator[Line]:
    """The reduced system and how the other coordinates follow; its answer comes after it."""
    yield _said(0, f"The reduced system in {', '.join(part['coordinates'])}:")
    yield from (_formula(1, f"{name}''", _brief({"text": text})) for name, text in part["equations"].items())
    yield _said(1, part["statement"])
    yield from (_formula(1, f"{name}'", _brief({"text": text})) for name, text in part["reconstruction"].items())


def _first_integrals(found: Sequence[Mapping[str, Any]], where: str = "") -> Iterator[Line]:
    """What is constant along the motion, each with the symmetry behind it."""
    if found:
        yield _said(0, f"Constant along the motion{where}:")
    for one in found:
        symmetry = f"   [{one['symmetry']}]" if one["symmetry"] else ""
        yield Line(1, (f"{one['name']}: ", _brief(one), symmetry))


def _with_domain(letter: str, part: Mapping[str, Any], most: int = LONG) -> Line:
    # H without momenta is the energy.
    energy = {"text": "energy in the velocities", "latex": r"\text{energy in the velocities}"}
    return _formula(1, energy if part.get("implicit") else letter, _brief(part, most), part.get("domain", ()))


def _brief(part: Mapping[str, Any], most: int = LONG) -> Mapping[str, Any]:
    """The formula, of which a text names the length alone if it is long."""
    text = part["text"]
    short = text if len(text) <= most else f"({len(text)} characters; see --format json)"
    return {"text": short, "latex": part.get("latex"), "whole": text}
