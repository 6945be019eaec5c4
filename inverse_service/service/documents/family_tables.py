"""The table of a family: where a member has a Lagrangian, and which one. Text, LaTeX, and pages
print it.

The general member comes first, the most special last; what is not decided is in the notes. A set is
named by its equations, or by its shortest one, and by the functions that solve them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.expressions import printing, tree as ex, wronskians
from inverse_service.reading import reader
from inverse_service.reading.names import Names
from inverse_service.service.documents import growing, special_members, stated
from inverse_service.service.documents.sheets import (
    DIFFERS,
    LONGEST_CONDITION,
    NO,
    YES,
    FamilyTable,
    Formula,
    Length,
    Member,
    Sentence,
    Sheet,
    Word,
    formula_of,
    integrals_of,
    listed,
    sheet_of,
)
from inverse_service.service.documents.stated import auxiliary_of, call_of, names_of

MOST_OPEN = 2  # open sets whose equations are told
OTHERWISE = " (other reasons are in the JSON)"
NUMBERS = [
    "no",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
]
FOR_A_MEMBER = "found for a given member"
LONGEST_EQUATION = 300  # by which a set is named


def sheet_with_family(
    result: Mapping[str, Any], length: Length = "whole", grows: bool = False
) -> Sheet:
    """The sheet of a result with the table of its family, whose sentence is the answer then."""
    sheet = sheet_of(result, length, grows)
    table = table_of(result) if "verdict" in result else None
    if table is None:
        return sheet
    is_whole = len(sheet.cases) == 1 and not sheet.table
    sentence, notes = (table.sentence, table.notes) if is_whole else (sheet.sentence, sheet.notes)
    return replace(sheet, family=table, sentence=sentence, notes=notes)


def table_of(result: Mapping[str, Any]) -> FamilyTable | None:
    """The table of a result; None if it has no family, or no set of it was found."""
    family = result.get("family")
    if not family or not family["leaves"] or not result.get("system"):
        return None
    names = names_of(result["system"])
    depths = dict[int, int]()
    members = list[Member]()
    for leaf in family["leaves"]:
        around = leaf.get("inside")
        depths[leaf["id"]] = 0 if around is None else depths.get(around, 0) + 1
        members.append(_member(leaf, depths[leaf["id"]], result, names))
    notes = [*_about(result), *_notes(family, names)]
    return FamilyTable(_sentence(family, members, names), tuple(members), tuple(notes))


def _about(result: Mapping[str, Any]) -> list[Sentence]:
    """Of a system with constraints: which of its associated systems the family is of, if it is not
    of any.
    """
    if growing.asks_motion_alone(result["system"].get("given")):
        return [("About any associated system; each row is about its general member.",)]
    main = (result.get("nonholonomic") or {}).get("main")
    return [(f"About the {main} associated system alone: another one may have a Lagrangian.",)] if main else []  # fmt: skip


class Badge(NamedTuple):
    """A verdict in one word, and what it says."""

    verdict: str
    words: str


def badge_of(result: Mapping[str, Any]) -> Badge:
    """The verdict on a family in one word, and as a badge."""
    table = table_of(result)
    found = {one.verdict for one in table.members} if table is not None else {""}
    if found == {YES}:
        return Badge(YES, "all members have a Lagrangian")
    if found == {NO}:
        return Badge(NO, f"no member has a Lagrangian{_without_time(result['family'])}")
    return Badge(DIFFERS, "depends on the member")


def _without_time(family: Mapping[str, Any]) -> str:
    """What a no adds where nobody asked for L(t, q, q')."""
    timed = {leaf.get("verdict_with_time") for leaf in family["leaves"]}
    return " without the time" if timed == {None} else ""


def verdict_of_leaf(leaf: Mapping[str, Any]) -> str:
    """Yes if there is an L, with or without the time."""
    return YES if "variational" in (leaf["verdict"], leaf.get("verdict_with_time")) else NO


def _sentence(family: Mapping[str, Any], members: Sequence[Member], names: Names) -> Sentence:
    verdicts, covered = [one.verdict for one in members], family["covered"]
    with_one, without = verdicts.count(YES), verdicts.count(NO)
    functions = [call_of(name, of, names) for name, of in family["functions"].items()]
    general: Sentence = ("For ", "a general " if len(functions) == 1 else "general ", *listed(functions, names))  # fmt: skip
    time = _without_time(family)
    if not without:
        every = "every member" if covered else "every member that was decided"
        return (Word("Yes,", YES), f" {every} comes from a Lagrangian.")
    if not with_one:
        if covered:
            return (Word("No", NO), f" member comes from a regular Lagrangian{time}.")
        return (f"No member that was decided comes from a regular Lagrangian{time}.",)
    few = without if verdicts[0] == YES else with_one
    # No others, but of members in one of these sets some are not decided.
    most = verdicts[0] == NO and _is_open_within(family)
    count = number_in_words(few).capitalize()
    if not covered:
        count = f"{'Only' if most else 'At least'} {number_in_words(few)}"
    sets = f"{count} {'set' if few == 1 else 'sets'} of members"
    rest = ", and no others" if covered else ""
    if verdicts[0] == YES:
        has = "does" if few == 1 else "do"
        of_letters: Sentence = (Word("Almost all", YES), f" members come from a Lagrangian{time}.")
        first: Sentence = of_letters
        if functions:
            yes = (Word("yes,", YES), f"{time}.") if time else (Word("yes.", YES),)
            first = (*general, ", ", *yes)
        return (*first, f" {sets} {has} not{rest}.")
    if functions:
        kinds = "kind has" if few == 1 else "kinds have"
        exactly = f"Exactly {number_in_words(few)}" if covered else count
        return (*general, ", ", Word("no.", NO), f" {exactly} {kinds} a Lagrangian{time}.")
    does = "does" if few == 1 else "do"
    return (
        Word("Almost no", NO),
        f" member comes from a regular Lagrangian{time}. {sets} {does}{rest}.",
    )


def _is_open_within(family: Mapping[str, Any]) -> bool:
    """Whether the checker verified that members outside the listed sets with a Lagrangian have
    none.
    """

    def texts(part: Mapping[str, Any]) -> list[str]:
        return [one["text"] for one in part["equations"]]

    listed_ones = [one for one in family["leaves"] if not one["nonzero"]]
    sets = [texts(leaf) for leaf in listed_ones if verdict_of_leaf(leaf) == YES]
    return family.get("checked") == "valid" and all(texts(one) in sets for one in family["open"])


def number_in_words(count: int) -> str:
    """A small number as a word."""
    return NUMBERS[count] if count < len(NUMBERS) else str(count)


def _notes(family: Mapping[str, Any], names: Names) -> list[Sentence]:
    real = [f"all real {', '.join(family['letters'])}"] if family["letters"] else []
    analytic = ", ".join(call_of(name, of, names) for name, of in family["functions"].items())
    wanted = [*real, *([f"all analytic {analytic}"] if analytic else [])]
    found: list[Sentence] = []
    if family["covered"]:
        found.append((f"This holds for {' and '.join(wanted)}; nothing is left open.",))
    if family.get("checked") == "valid":
        said = "An independent checker verified the verdicts of all members"
        outside = "" if family["covered"] else " outside the sets that are not decided"
        found.append((f"{said}{outside}.",))
    opened = family["open"]
    if opened:
        found.append(_not_decided(opened, family["leaves"], names))
    if any(family["functions"]) and opened:
        found.append(("A member with a given function is decided where it is written out.",))
    return found


def _not_decided(
    opened: Sequence[Mapping[str, Any]], leaves: Sequence[Mapping[str, Any]], names: Names
) -> Sentence:
    """One line: where members are not decided, in how many more sets, and why."""
    places = list(dict.fromkeys(where_open(one, leaves, names) for one in opened))
    named = [one for one in places if any(isinstance(piece, Formula) for piece in one)]
    told = named[:MOST_OPEN] or places[:1]
    more = len(opened) - len(told)
    rest: Sentence = (
        f", and in {number_in_words(more)} more {'set' if more == 1 else 'sets'}",
    ) * bool(more)
    first, *others = dict.fromkeys(one["reason"] for one in opened)
    where = tuple(piece for one in told for piece in (";", *one))[1:]
    return ("Not decided", *where, *rest, f": {first}{OTHERWISE * bool(others)}.")


def _member(leaf: Mapping[str, Any], depth: int, result: Mapping[str, Any], names: Names) -> Member:
    verdict = verdict_of_leaf(leaf)
    without = _without_time(result["family"])
    word, statement = "none" + without, f"This member has no Lagrangian{without}."
    if verdict == YES and leaf["verdict"] == "variational":
        word, statement = "yes", "This member has a Lagrangian."
    elif verdict == YES:
        word, statement = "yes, with t", "This member has a Lagrangian with the time."
    lagrangian, said = lagrangian_of_leaf(leaf, result), list[str | Formula | Word]()
    notes: Sentence = ()
    special = special_members.special_members(leaf, result) if lagrangian else []
    own = own_names(leaf, result)
    others = tuple((listed([one.condition], own), one.document) for one in special)
    if lagrangian and len(lagrangian["text"]) <= LONGEST_CONDITION:
        integrals = auxiliary_of(leaf)
        said.append(formula_of("L", lagrangian, own))
        defined = [piece for one in integrals_of(integrals, own) for piece in (", ", one)][1:]
        notes = ("with ", *defined) if defined else ()
        if lagrangian.get("domain"):
            notes += (" " * bool(notes), "where ", *listed(lagrangian["domain"], own))
        if leaf.get("proof_without_time"):
            notes += (" " * bool(notes), "(there is one without t, too)")
        singular = special_members.singular_of(leaf, result)
        if singular and sum(map(len, singular)) <= LONGEST_CONDITION:
            notes += (" " * bool(notes), "(other ones where ", *listed(singular, own), ")")
    elif lagrangian:
        said.append(f"L: {len(lagrangian['text']):,} characters, in the JSON")
    elif verdict == YES:
        said.append(FOR_A_MEMBER)
    where = where_of(leaf, names)
    return Member(leaf["id"], depth, where, verdict, word, statement, tuple(said), notes, others)


def lagrangian_of_leaf(leaf: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any] | None:
    """The L of the general member of a leaf; that of all members is the one of the answer."""
    found: dict[str, Any] | None = leaf.get("lagrangian")
    if verdict_of_leaf(leaf) == YES and not leaf["equations"]:
        return stated.first_answer(result).get("lagrangian") or found
    return found


def own_names(leaf: Mapping[str, Any], result: Mapping[str, Any]) -> Names:
    """The names of a member: its functions of fewer arguments, and new constants."""
    whole = result["system"]
    functions = {**whole["functions"], **((leaf.get("proof") or {}).get("functions") or {})}
    own = names_of({**whole, "functions": functions}, auxiliary_of(leaf))
    return replace(own, parameters=(*own.parameters, *_new(leaf)))


def _new(leaf: Mapping[str, Any]) -> list[str]:
    return [name for part in leaf["solved"] for name in part["new_constants"]]


def _new_functions(leaf: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """F_0 and F_1 of F(x, y) = F_0(x) + F_1(y), with their arguments."""
    return {
        name: tuple(part["text"].partition(f"{name}(")[2].partition(")")[0].split(", "))
        for part in leaf["solved"]
        if len(part["new_functions"]) > 1
        for name in part["new_functions"]
    }


def where_of(leaf: Mapping[str, Any], names: Names) -> Sentence:
    """The equations and inequations of a leaf: short ones, or the shortest and how many more."""
    texts = [one["text"] for one in leaf["equations"]]
    if not texts:
        return ("in general",)
    # V(x, y) = V(x) says no more than V_y = 0 does.
    solved = [part["text"] for part in leaf["solved"] if len(part["new_functions"]) != 1]
    functions = [text for text in solved if "(" in text.partition(" = ")[0] and text not in texts]
    functions = [_of_all_arguments(text, names) for text in functions]
    is_whole = sum(map(len, functions)) <= LONGEST_CONDITION
    if not is_whole:
        functions = functions[:1]
    shown = texts if sum(map(len, texts)) <= LONGEST_CONDITION else [min(texts, key=len)]
    where = tuple(piece for text in shown for piece in (", ", *_equation(text, names)))[1:]
    own = {**names.functions, **_new_functions(leaf)}
    new = replace(names, parameters=(*names.parameters, *_new(leaf)), functions=own)
    if functions:
        where += (", so ", *listed(functions, new))
    elif len(shown) < len(texts):
        where += (f", and {number_in_words(len(texts) - len(shown))} more (in the JSON)",)
    written = _solved_inequations(leaf, names) if is_whole else leaf["nonzero"]
    apart = [text for text in written if len(text) <= LONGEST_CONDITION]
    if apart:
        where += (", ", *listed((f"{text} != 0" for text in apart), new))
    if more := len(written) - len(apart):
        where += (
            f", and {number_in_words(more)} longer {'inequation' if more == 1 else 'inequations'}",
        )
    return where


def _solved_inequations(leaf: Mapping[str, Any], names: Names) -> list[str]:
    """F_0 for F'(r) where F(r) = F_0 r: what the inequations say of the new constants."""
    fresh = {ex.Symbol(name) for name in _new(leaf)}
    solved = [_constant_in(one.tree, fresh) for one in special_members.inequations_of(leaf, names)]
    texts = leaf["nonzero"]
    told = (
        [text if one is None else one.name for text, one in zip(texts, solved, strict=True)]
        if solved
        else texts
    )
    return list(dict.fromkeys(told))


def _constant_in(tree: ex.Expression, fresh: Collection[ex.Symbol]) -> ex.Symbol | None:
    """The constant that is zero exactly if a product is, whose other factors hold coordinates alone."""
    parts = tree.factors if isinstance(tree, ex.Product) else (tree,)
    held = [
        one for one in parts if ex.has(one, ex.Arbitrary) or not set(ex.walk(one)).isdisjoint(fresh)
    ]
    bases = [one.base if isinstance(one, ex.Power) else one for one in held]
    is_alone = len(bases) == 1 and bases[0] in fresh
    return bases[0] if is_alone and isinstance(bases[0], ex.Symbol) else None


def _of_all_arguments(text: str, names: Names) -> str:
    """B(x, y) = B_0 for B(x) = B_0, the solution of B_x = 0 after B_y = 0."""
    left, _, right = text.partition(" = ")
    name = left.partition("(")[0]
    whole = call_of(name, names.functions.get(name, ()), names)
    return f"{whole} = {right}" if name in names.functions else text


def _equation(text: str, names: Names) -> Sentence:
    """An equation, or which three or more functions are linearly dependent."""
    left, _, right = text.partition(" = ")
    with suppress(errors.InputError):
        tree = reader.read_formula(f"{left} - ({right or 0})", names)
        functions = wronskians.dependent(tree)
        if len(functions) > 2:
            formulas = listed(map(printing.to_text, functions), names)
            return (*formulas, " linearly dependent (W = 0)")
    return (
        listed([text], names)
        if len(text) <= LONGEST_EQUATION
        else ("a longer equation (in the JSON)",)
    )


def where_open(
    one: Mapping[str, Any], leaves: Sequence[Mapping[str, Any]], names: Names
) -> Sentence:
    """Where an open set is: by its own equations, or else by those of the leaf around it."""
    around = leaves[one["inside"]]["equations"] if leaves else ()
    texts = [each["text"] for each in one["equations"] or around]
    if not texts:
        return (" for special members",)
    shown = [text for text in texts if len(text) <= LONGEST_CONDITION][:2]
    if not shown:
        return (" where a longer condition holds",)
    rest: Sentence = (", ...",) if len(shown) < len(texts) else ()
    return (" where ", *listed(shown, names), *rest)
