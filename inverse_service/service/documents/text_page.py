"""A result as plain text for a person to read."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from inverse_service import errors
from inverse_service.expressions import tree as ex
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import canonical

LONG = 300
MOST_OF_CONDITIONS = 5_000
QUESTIONS = {False: "L(q, q')", True: "L(t, q, q')"}
SENTENCES = {
    "variational": "Variational{where}: a regular Lagrangian {question} exists.",
    "not_variational": "Not variational{where}: no regular Lagrangian {question} exists.",
    "undetermined": "Undetermined{where}: whether a regular Lagrangian {question} exists was not settled.",
}


def text_page(result: dict[str, Any], explain: bool) -> str:
    """The whole page, ending with a newline."""
    if is_forward_result(result):
        return forward_text(result)
    part = result.get("nonholonomic")
    parameters = (result["system"] or {}).get("parameters") or ()
    lines = [line for each in motions_of(result) for line in any_associated_lines(each, explain, parameters)]
    lines += [] if part is None else [*nonholonomic_lines(part), ""]
    lines += [f"  {words}" for words in guessed_words(result)]
    lines += [*_system(result["system"]), *_cases(result)]
    for place, branch in enumerate(() if asks_motion_alone(result) else branches_of(result)):
        lines += [""] * (place > 0) + list(_both_answers(branch, result, explain))
    if part is None and result.get("first_integrals"):
        lines += ["", *first_integral_lines(result["first_integrals"])]
    if result.get("special_cases") is not None:
        lines += ["", *special_cases_lines(result["special_cases"])]
    if result.get("instead"):
        told, part = instead_answered(result["instead"]), result["instead"]
        lines += ["", told, *_formulas(part, "  "), f"  independent check: {part['checked']}"] if told else [""]
    if result.get("reduced"):
        lines += ["", *reduced_lines(result["reduced"])]
        lines += _answer({"solution_space": None, "explanation": [], **result["reduced"]}, False, False)
    part = result.get("with_clock") or (result.get("reduced") or {}).get("with_clock")
    if part:
        lines += ["", f"With the clock dtau = ({part['factor']}) dt, x' being dx/dtau:"]
        lines += _answer({"solution_space": None, "explanation": [], **part}, False, False)
    if result.get("kinds"):
        lines += ["", "Lagrangians of a kind:"]
        lines += [line for told, part in kinds_answered(result) for line in (f"  {told}", *_formulas(part, "    "))]
    if explain:
        lines += ["", *_conditions(result["conditions"])]
    return "\n".join(lines) + "\n"


def asks_motion_alone(result: Mapping[str, Any]) -> bool:
    """Whether only the motion was asked about, so that the main fields leave open what nobody asked."""
    given = (result.get("system") or {}).get("given") or {}
    named = given if isinstance(given, dict) else {}
    return bool(result.get("any_associated")) and ("motion" in named or named.get("associated") == "any")


def branches_of(result: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The answers on each branch; the result itself where there is one."""
    return result.get("branches") or [result]


def motions_of(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The answers about a motion on constraints, one for each branch; none for another document."""
    parts = [one.get("any_associated") for one in result.get("branches") or ()]
    return [one for one in (parts if any(parts) else [result.get("any_associated")]) if one]


def notes_of_formulas(method: Mapping[str, Any]) -> list[str]:
    """What a run says about its events and the observables by formula, each after its formula or name."""
    parts = [(one["when"], one) for one in method.get("events") or ()]
    parts += (method.get("observables") or {}).items()
    return [f"{name}: {one['note']}" for name, one in parts if one.get("note")]


def common_verdict(answers: Iterable[Mapping[str, Any]], key: str = "verdict") -> Any:
    """The verdict where all of the answers have it, else "mixed"."""
    verdicts = {one.get(key) for one in answers}
    return verdicts.pop() if len(verdicts) == 1 else "mixed"


_YES_OR_NO = {"variational": "yes", "not_variational": "no", "undetermined": "undetermined"}


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
    """What there is instead; nothing where the Lagrangian stands on the page already."""
    if part["kind"] == "rayleigh":
        return "Instead: a Lagrangian with friction, d(dL/dx')/dt - dL/dx = dD/dx' for each coordinate x."
    if part["kind"] == "parameters":
        return f"Instead, where {', '.join(part['conditions'])}: a regular Lagrangian L(q, q')."
    return ""


def _formulas(part: Mapping[str, Any], indent: str) -> Iterator[str]:
    """L and D, and where L is one."""
    yield from (f"{indent}{sign} = {part[key]['text']}" for sign, key in FORMULAS if part[key])
    if part["lagrangian"]:
        yield from (f"{indent}    where {condition}" for condition in part["lagrangian"]["domain"])
        yield from (f"{indent}    {where}" for where in regular_where(part["lagrangian"]))


FORMULAS = (("L", "lagrangian"), ("D", "dissipation"))
DEFINITE = "positive_definite"


def _cases(result: dict[str, Any]) -> Iterator[str]:
    branches, left = branches_of(result), result.get("not_answered") or []
    if len(branches) > 1 or left:
        yield f"{len(branches)} cases{', which differ' * (common_verdict(branches) == 'mixed')}:"
        yield from (f"  {', '.join(each['domain'])}: {spaced(each['verdict'])}" for each in branches)
        yield from (f"  {place_of(each)}: not answered, {each['reason']}" for each in left)
        yield ""


def place_of(part: Mapping[str, Any]) -> str:
    """Where a cell is: its conditions, or a point of it."""
    return ", ".join(part["domain"]) or ", ".join(f"{name} = {value}" for name, value in part["near"].items())


def _both_answers(branch: Mapping[str, Any], result: dict[str, Any], explain: bool) -> Iterator[str]:
    for place, (answer, with_time) in enumerate(answers_of(branch, result)):
        yield from [""] * place
        yield from _answer(answer, with_time, explain, result["system"]["parameters"])
    if branch["with_time"] is None and branch["verdict_with_time"] is not None and not asks_for_time(result):
        yield ""
        yield verdict_sentence(branch["verdict_with_time"], True, branch.get("domain"))
        if branch["verdict"] == branch["verdict_with_time"] == "undetermined" and branch["reason"]:
            yield "  for the same reason"


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


def answers_of(branch: Mapping[str, Any], result: Mapping[str, Any]) -> list[tuple[Mapping[str, Any], bool]]:
    """The answers on a branch in a reader's order, each with whether it is on L(t, q, q').

    The question that was asked comes first, unless it has a Lagrangian that was not found in closed form, or the other
    one has a Lagrangian of a simpler kind.
    """
    main, other = (branch, asks_for_time(result)), branch["with_time"]
    if other is None:
        return [main]
    texts = [part["lagrangian"]["text"] for part in (branch, other) if part["lagrangian"]]
    kinds = [_complexity(text, result["system"]) for text in texts]
    exists_only = not branch["lagrangian"] and branch["verdict"] == "variational"
    is_better = kinds[1] < kinds[0] if len(kinds) == 2 else exists_only and bool(texts)
    return [(other, True), main] if is_better else [main, (other, True)]


def _complexity(lagrangian: str, system: Mapping[str, Any]) -> int:
    """0 for T + A q' - V, 1 for other polynomials in the velocities, 2 with the time; 3 for quotients; 4 else."""
    try:
        tree = reader.read_formula(lagrangian, names_in(system))
    except errors.InputError:
        return 4
    degree, is_rational = _degree(tree), _degree(tree, rational=True) is not None
    if degree is None:
        return 3 if is_rational else 4
    return 2 if ex.Symbol(system.get("time", "t")) in ex.walk(tree) else int(degree > 2)


def names_in(system: Mapping[str, Any], letters: Iterable[str] = ()) -> Names:
    """The names of the formulas of a result, its own name of the time among them; `letters` are further ones."""
    functions = {name: tuple(arguments) for name, arguments in system["functions"].items()}
    words = dict.fromkeys((*system["parameters"], *letters, system.get("time", "t")))
    return Names(tuple(system["coordinates"]), tuple(word for word in words if word != "t"), functions)


def _degree(tree: ex.Expression, rational: bool = False) -> int | None:
    """The degree in the velocities; None where it is no polynomial in them, or with `rational` no quotient of some."""
    match tree:
        case ex.Velocity():
            return 1
        case ex.Sum(parts) | ex.Product(parts):
            found = [_degree(part, rational) for part in parts]
            degrees = [degree for degree in found if degree is not None]
            return None if len(degrees) < len(found) else max(degrees) if isinstance(tree, ex.Sum) else sum(degrees)
        case ex.Power(base, ex.Number(exponent)) if exponent.denominator == 1 and (rational or exponent > 0):
            degree = _degree(base, rational)
            return None if degree is None else degree * abs(int(exponent))
    return None if any(isinstance(node, ex.Velocity) for node in ex.walk(tree)) else 0


def asks_for_time(result: Mapping[str, Any]) -> bool:
    """Whether the main fields answer L(t, q, q')."""
    return bool(result["question"] == QUESTIONS[True])


# A Hamiltonian in the velocities longer than this is not printed: L and the momenta say the same.
LONGEST_IMPLICIT = 300


def verdict_sentence(verdict: str, with_time: bool, domain: Sequence[str] | None = None) -> str:
    """The verdict as a sentence that says which question it answers, and on which set."""
    where = f" on {', '.join(domain)}, at generic points" if domain else ""
    return SENTENCES[verdict].format(question=QUESTIONS[with_time], where=where)


def _system(system: dict[str, Any] | None) -> Iterator[str]:
    if system is None:
        return
    if system["name"]:
        yield system["name"]
    yield from (f"  {reader.equation_line(*pair)}" for pair in system["equations"].items())
    yield ""


def _answer(answer: Mapping[str, Any], with_time: bool, explain: bool, parameters: Sequence[str] = ()) -> Iterator[str]:
    yield verdict_sentence(answer["verdict"], with_time, answer.get("domain"))
    if answer.get("exceptions"):
        yield f"  {canonical.in_general(parameters, answer['exceptions'])}"
    if answer["reason"]:
        yield f"  {answer['reason']}"
    if answer["checked"] is not None:
        yield f"  independent check: {answer['checked']}"
    if answer["lagrangian"] is not None:
        yield f"  L = {answer['lagrangian']['text']}"
        yield from (f"      with {line}" for line in _integrals(answer.get("integrals") or {}))
        yield from (f"      where {condition}" for condition in answer["lagrangian"]["domain"])
        yield from (f"      {where}" for where in regular_where(answer["lagrangian"]))
    elif answer["verdict"] == "variational":
        yield "  no Lagrangian in closed form was found" + ("" if explain else "; --explain says what was tried")
    if answer["hamiltonian"] is not None:
        yield from _hamiltonian(answer["hamiltonian"])
    if answer["solution_space"] is not None:
        yield f"  {answer['solution_space']['statement']}"
    if explain:
        yield from _steps(answer["explanation"])
        if answer.get("details"):
            yield "  (How it was found, and what else proves it: `details` of --format json.)"


def regular_where(lagrangian: Mapping[str, Any]) -> list[str]:
    """Where a Lagrangian is regular, if that is not everywhere or is not known."""
    told = lagrangian.get("regular", "")
    return [] if told in ("", "everywhere") else [f"regular {told}"]


def _integrals(integrals: dict[str, Any]) -> Iterator[str]:
    """F(t) = ∫ f(t) dt, or the derivatives where there are several."""
    for name, known in integrals.items():
        whole = f"{name}({', '.join(known['arguments'])})"
        if len(known["derivatives"]) == 1:
            ((variable, slope),) = known["derivatives"].items()
            yield f"{whole} = ∫ ({slope}) d{variable}" if " " in slope else f"{whole} = ∫ {slope} d{variable}"
        else:
            yield from (f"d{whole}/d{variable} = {slope}" for variable, slope in known["derivatives"].items())


def _hamiltonian(hamiltonian: dict[str, Any]) -> Iterator[str]:
    if hamiltonian["implicit"] and len(hamiltonian["text"]) > LONGEST_IMPLICIT:
        yield "  energy in the velocities: p v - L"
    else:
        name = "energy in the velocities" if hamiltonian["implicit"] else "H"
        yield f"  {name} = {hamiltonian['text']}"
        yield from (f"      where {condition}" for condition in hamiltonian.get("domain", ()))
    if hamiltonian.get("reason"):
        yield f"      {hamiltonian['reason']}"
    yield from (f"      {momentum} = {text}" for momentum, text in hamiltonian["momenta"].items())
    yield from (f"      constraint {text} = 0" for text in hamiltonian["constraints"])


def _steps(steps: list[dict[str, str]]) -> Iterator[str]:
    if not steps:
        return
    yield ""
    for k, step in enumerate(steps, 1):
        yield f"  {k}. {step['text']}"


def _conditions(conditions: dict[str, Any] | None) -> Iterator[str]:
    if conditions is None:
        return
    yield "Conditions: g Phi and g nabla_Phi must be symmetric, and the cyclic sums of g R must vanish. Entries not 0:"
    left = MOST_OF_CONDITIONS
    for name in ("Phi", "nabla_Phi", "R"):
        found = [(place, text) for place, text in _entries(conditions[name], ()) if text != "0"]
        size = sum(len(text) for _, text in found)
        if not found:
            yield f"  {name} = 0"
        elif size > left:
            yield f"  {name}: {size} characters, in `conditions` of --format json"
        else:
            left -= size
            yield from (f"  {name}[{', '.join(map(str, place))}] = {text}" for place, text in found)


def _entries(part: Any, place: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], str]]:
    if isinstance(part, str):
        yield place, part
    else:
        for k, inner in enumerate(part, 1):
            yield from _entries(inner, (*place, k))


def spaced(verdict: str) -> str:
    """not_variational as people write it."""
    return verdict.replace("_", " ")


def is_forward_result(result: dict[str, Any]) -> bool:
    """Whether a result answers the forward problem."""
    return str(result.get("format", "")).startswith("inverse-service/forward")


def forward_rows(result: dict[str, Any], form: str) -> Iterator[tuple[str, str]]:
    """(left side, right side) of every formula, `form` being text or latex."""
    yield "L", result["lagrangian"][form]
    for name, found in result["equations"].items():
        if form == "latex":
            left, _, right = result["system"]["latex"][name].partition(" = ")
            yield left, right
        else:
            yield f"{name}''", found["text"]
    for symbol, momentum in zip(result["hamiltonian"]["momenta"], result["momenta"].values(), strict=True):
        yield symbol if form == "text" else f"p_{{{symbol.partition('_')[2]}}}", momentum[form]
    yield "H", result["hamiltonian"][form]
    for found in result["conserved"]:
        yield found["name"] if form == "text" else rf"\text{{{found['name']}}}", found[form]


def forward_text(result: dict[str, Any]) -> str:
    """Equations, momenta, Hamiltonian, and what is conserved, one a line."""
    title = [result["system"]["name"]] if result["system"]["name"] else []
    guessed = [f"  {words}" for words in guessed_words(result)]
    where = [f"      where {condition}" for condition in result["hamiltonian"].get("domain", ())]
    lines = ([f"  {left} = {right}", *(where if left == "H" else ())] for left, right in forward_rows(result, "text"))
    return "\n".join([*title, *guessed, *itertools.chain(*lines)]) + "\n"


def special_cases_lines(part: dict[str, Any]) -> Iterator[str]:
    """The answer first, then the tree, then what is not known."""
    yield "For which parameters?"
    yield from cases_answered(part["variational_when"], "  A Lagrangian exists", "text")
    if part["variational_when_with_time"] not in (None, part["variational_when"]):
        yield from cases_answered(part["variational_when_with_time"], "  A Lagrangian L(t, q, q') exists", "text")
    yield f"  Tree of cases ({part['examined']} examined):"
    yield from _tree(part["tree"], "    ")
    if part["complete"]:
        yield "  The tree is complete: no other case has another verdict."
    else:
        only = " for L(q, q'); for L(t, q, q') it is" if part["complete_with_time"] else ""
        yield f"  The tree may not be complete{only}:"
        yield from (f"    {reason}" for reason in part["reasons"])


def _tree(node: dict[str, Any], indent: str) -> Iterator[str]:
    verdict = spaced(node["verdict"])
    if node["verdict_with_time"] not in (None, node["verdict"]):
        verdict += f" (with t: {spaced(node['verdict_with_time'])})"
    found = f", L = {node['lagrangian']['text']}" if node.get("lagrangian") else ""
    yield f"{indent}{where(node['conditions'], 'text')}: {verdict}{found}"
    for child in node["children"]:
        yield from _tree(child, indent + "  ")


def cases_answered(cases: list[dict[str, Any]], opening: str, form: str) -> Iterator[str]:
    ending = r" \\" if form == "latex" else ""
    if not cases:
        yield f"{opening} in none of the cases found.{ending}"
    for case in cases:
        line = f"{opening} {where(case['conditions'], form)}"
        if case["exceptions"]:
            line += ", except " + "; ".join(where(conditions, form) for conditions in case["exceptions"])
        yield f"{line}.{ending}"


def where(conditions: list[dict[str, str]], form: str) -> str:
    if not conditions:
        return "in general"
    texts = [f"${c['latex']}$" if form == "latex" else c["text"] for c in conditions]
    return "where " + ", ".join(texts)


def any_associated_lines(part: dict[str, Any], explain: bool, parameters: Sequence[str] = ()) -> list[str]:
    """The answer about the motion itself, line by line."""
    lines = [part["statement"]]
    if part.get("exceptions"):
        lines.append(f"  {canonical.in_general(parameters, part['exceptions'])}")
    lines += [f"  {part['reason']}"] if part["reason"] else []
    lines += [f"  independent check: {part['checked']}"] if part["checked"] else []
    found = part["lagrangian"]
    if found is not None:
        lines += [
            *_with_domain("L", found),
            f"  on the constraints l = {_short(found['on_constraints']['text'])}",
        ]
        lines += [f"  lambda_{k} = {_short(one['text'])}" for k, one in enumerate(found["transverse_momenta"], 1)]
    elif part["verdict_with_time"] == "variational":
        lines.append("  no Lagrangian in closed form was found" + "; --explain shows how one begins" * (not explain))
    if part["hamiltonian"] is not None:
        lines += _with_domain("H", part["hamiltonian"])
    lines += [f"  image {_short(one['text'])} = 0" for one in part["image"]]
    if part["freedom"]:
        lines.append(f"  up to total derivatives, L along the constraints depends on {part['freedom']}")
    if explain:
        lines += [f"  {k}. {step['text']}" for k, step in enumerate(part["explanation"], 1)]
    return [*lines, ""]


def nonholonomic_lines(part: dict[str, Any]) -> Iterator[str]:
    """The motion, what it keeps, the associated systems and the Hamiltonisations, line by line."""
    motion = part["equations_of_motion"]
    yield "Nonholonomic motion:"
    yield from (f"  {name}'' = {_short(found['text'])}" for name, found in motion["second_order"].items())
    yield from (f"  {name}' = {_short(found['text'])}" for name, found in motion["first_order"].items())
    yield from (f"  lambda_{k} = {_short(found['text'])}" for k, found in enumerate(motion["multipliers"], 1))
    yield from _kept(part)
    yield ""
    yield "Associated second-order systems:"
    for one in part["associated"]:
        yield f"  {one['kind']}: {_verdict(one)}"
        if not one["defined"]:
            yield f"    {one['explanation']}"
    yield from _hamiltonisations(part["hamiltonisation"])
    yield ""
    yield f"The rest is about the associated system '{part['main']}':"


def reduced_lines(part: dict[str, Any]) -> Iterator[str]:
    """The reduced system and how the other coordinates follow; its answer comes after it."""
    yield f"The reduced system in {', '.join(part['coordinates'])}:"
    yield from (f"  {name}'' = {_short(text)}" for name, text in part["equations"].items())
    yield f"  {part['statement']}"
    yield from (f"  {name}' = {_short(text)}" for name, text in part["reconstruction"].items())


def _kept(part: dict[str, Any]) -> Iterator[str]:
    yield ""
    yield part["paper_class"]["statement"]
    yield part["integrable"]["statement"]
    yield from (f"  constant: {found['text']}" for found in part["integrable"]["integrals"])
    measure = part["measure_density"]
    yield measure["statement"]
    if measure["density"] is not None:
        yield f"  N = {_short(measure['density']['text'])}"
    yield from first_integral_lines(part["first_integrals"])


def first_integral_lines(found: list[dict[str, Any]]) -> Iterator[str]:
    """What is constant along the motion, each with the symmetry behind it."""
    if found:
        yield "Constant along the motion:"
    for one in found:
        symmetry = f"   [{one['symmetry']}]" if one["symmetry"] else ""
        yield f"  {one['name']}: {_short(one['text'])}{symmetry}"


def _verdict(one: dict[str, Any]) -> str:
    checked = f" (independent check: {one['checked']})" if one["checked"] is not None else ""
    where = f" where {', '.join(one['domain'])}" if one.get("domain") else ""
    return (one["verdict"] or "not defined").replace("_", " ") + where + checked


def _hamiltonisations(reports: list[dict[str, Any]]) -> Iterator[str]:
    for one in reports:
        yield ""
        yield f"Hamiltonized by the {one['associated']} system, {one['label']}:"
        yield f"  L = {_short(one['lagrangian']['text'])}"
        if one["hamiltonian"] is not None:
            yield from _with_domain("H", one["hamiltonian"])
        yield from (f"  constraint {_short(found['text'])} = 0" for found in one["constraints"])
        yield from (f"  {each['verdict']}: {each['text']}" for each in one["statements"])
        flow = one["trajectory"]
        if flow is not None:
            yield (
                f"  both flows over t = {flow['time']:g} from one start: positions differ by at most "
                f"{flow['difference']:.1e}, constraints by {flow['constraint']:.1e}, H by {flow['energy']:.1e}"
            )


def _with_domain(letter: str, part: dict[str, Any]) -> list[str]:
    where = (f"      where {condition}" for condition in part.get("domain", ()))
    # H without momenta is the energy.
    name = "energy in the velocities" if part.get("implicit") else letter
    return [f"  {name} = {_short(part['text'])}", *where]


def _short(text: str) -> str:
    return text if len(text) <= LONG else f"({len(text)} characters; see --format json)"
