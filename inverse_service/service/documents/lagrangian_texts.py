"""A text that gives L, or T and V, or equations with multipliers, as the Lagrangian and constraints
of a document.

`with_lagrangian` finds them in the text and `on_positions` solves constraints on positions. Each
formula knows where it was typed (`reading.typed_text`).
"""

from __future__ import annotations

from collections.abc import Collection, Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from math import perm
from typing import Any, NamedTuple

from inverse_service import errors
from inverse_service.expressions import (
    calculus,
    collecting,
    letters,
    notation,
    printing,
    tree as ex,
)
from inverse_service.expressions.refusals import fault
from inverse_service.mechanics import euler_lagrange
from inverse_service.reading import (
    components,
    declarations,
    document_names,
    guessed_names,
    labels,
    names as nm,
    own_functions,
    reader,
    signs,
    time_derivatives,
)
from inverse_service.reading.rules import (
    actions,
    definitions,
    differential_forms,
    lagrange_equations,
    lagrangians,
    lengths,
    line_ends,
    metrics,
    motion,
    multiplier_names,
    sequences,
    vector_fields,
    vectors,
)
from inverse_service.reading.rules.definitions import DEFINED
from inverse_service.reading.rules.energies import ENERGIES, ENERGY
from inverse_service.reading.rules.sequences import Found
from inverse_service.reading.tokens import Meaning, Token, at, places, spelled, split_at, walk
from inverse_service.reading.typed_text import Change, Typed, columns_of
from inverse_service.service.documents import reactions

# A document, by the pointer of each of its formulas where it was typed, and the notes.
_Found = tuple[dict[str, Any], dict[str, Typed], dict[str, Meaning]]
# Equations of motion with multipliers as L and constraints: x'' = lambda sin(u), ..., x' sin(u) =
# y' cos(u). Without multipliers the lines are the Euler-Lagrange equations of a Lagrangian L, each
# times a factor. The force with each multiplier has to be a multiple of the form w_i v^i of one
# constraint (d'Alembert's principle): then the motion is that of L with the constraints.
_ENERGY_LETTERS = ("T", "K", "U", "V")
_ENERGY_NAMES = (*_ENERGY_LETTERS, "L", "H", "E", "KE", "PE")
_DISTANCES = frozenset(("r", "R", "rho", "s"))
# What may stand between an energy and another equation.
_BETWEEN = frozenset((
    "\\quad", "\\qquad", "\\text", "\\textrm", "\\mbox", "\\qq", ";", ":", signs.LINE_END, "where",
    "with", "and", "if", "for", "when", "provided",
))  # fmt: skip
_CHARGES = frozenset(("q", "e", "Q"))
_OF_CHARGES = frozenset(("phi", "Phi", "varphi"))  # potentials of q phi
_MOST_PRODUCTS = 10_000  # of entries of vector fields


@dataclass(frozen=True, slots=True)
class _Energy:
    """L = …, T = …, or V = … of a text: what is found up to the formula, and the formula; of L = T - V
    = … the letters T and V, which the formula already has in it.
    """

    named: Found
    whole: Typed
    formula: Typed
    written_out: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class _Written:
    """What texts give: energies by kind, and all other equations.

    `forces` are the Q of d/dt dL/dx' - dL/dx = Q, by x, and by x' those of d/dt dL/dx' = Q;
    `fields` span the directions that are allowed. `times` are the x of actions ∫ f dx.
    """

    energies: dict[str, _Energy] = field(default_factory=dict)
    others: list[Typed] = field(default_factory=list)
    notes: dict[str, Meaning] = field(default_factory=dict)
    forces: dict[str, str] = field(default_factory=dict)
    fields: list[Typed] = field(default_factory=list)
    times: list[str] = field(default_factory=list)

    def gives_lagrangian(self) -> bool:
        """Whether there is an L, or a T and something that moves, and no equation of second
        order.
        """
        formulas = [
            *(line.text for line in self.others),
            *(energy.formula.text for energy in self.energies.values()),
        ]
        kinetic = self.energies.get("kinetic")
        moves = kinetic and any(map(motion.moves, formulas))
        if kinetic and "potential" in self.energies and _has_speed(kinetic.formula):
            moves = True
        return ("whole" in self.energies or bool(moves)) and not any(
            map(motion.accelerates, formulas)
        )

    def lagrangian(self) -> Typed:
        """L, or T - V."""
        if "whole" in self.energies:
            named, formula = self.energies["whole"].named, self.energies["whole"].formula
            return _in_brackets("1/2*(", formula) if named["twice"] else formula
        parts = [
            _in_brackets(
                ("-" if energy.named["potential"] else "+")
                + ("1/2*(" if energy.named["twice"] else "("),
                energy.formula,
            )
            for energy in self.energies.values()
        ]
        return sum(parts[1:], parts[0])


def _in_brackets(opening: str, formula: Typed) -> Typed:
    if formula.text.count("(") != formula.text.count(")"):
        with formula.placed():
            reader.read_tokens(formula.text)  # refused at its own bracket
    return formula.in_brackets(opening)


def with_lagrangian(plain: dict[str, Any], declared: Collection[str]) -> _Found:
    """A text that gives L, or T and V, as the document of that Lagrangian; its other lines define
    names or hold it.

    With it, by the pointer of each of these formulas, where it was typed; and what is read
    differently.
    """
    key = "lagrangian" if "lagrangian" in plain else "equations"
    given = plain.get(key)
    texts = {f"/{key}": given} if isinstance(given, str) else {}
    if isinstance(given, list) and all(isinstance(text, str) for text in given):
        texts = {f"/{key}/{place}": text for place, text in enumerate(given)}
    found = _written(texts, declared)
    if any(
        "L" in time_derivatives.moving_names(reader.tokens_if_any(line.text, nm.Names()), 1)
        for line in found.others
    ):
        return plain, {}, {}  # dL/dt = 0 is about a momentum L
    if found.forces and not (found.energies or any(line.text.strip() for line in found.others)):
        raise fault("dissipation not given", f"/{key}", name="L")  # d/dt dL/dx' - dL/dx = 0 alone
    if not found.gives_lagrangian():
        if key == "lagrangian" and isinstance(given, str):
            return _with_speed(plain, {}, {}, declared)
        if key == "lagrangian" or "constraints" in plain:
            return plain, {}, {}
        _ask_about_expression(found, texts)
        if any(multiplier_names.place_of_multiplier(text) is not None for text in texts.values()):
            return _with_multipliers(plain, texts)
        return (plain, {}, {}) if found.energies else _as_motion(plain, texts, found.others)
    _put_calls_in(found)
    _drop_named_difference(found)
    is_whole, lagrangian, others, notes = (
        "whole" in found.energies,
        found.lagrangian(),
        [*found.others],
        found.notes,
    )
    if is_whole:
        _refuse_missing_energy(found, declared)
        out = found.energies["whole"].written_out - {*signs.words(lagrangian)}
        for kind, given_energy in found.energies.items():
            if given_energy.named[kind] in out:
                notes[given_energy.whole.text.strip()] = Meaning(reader.LEFT_OUT)
            elif kind != "whole":
                others.append(given_energy.whole)
    velocities = time_derivatives.moving_names(reader.tokens_if_any(lagrangian.text, nm.Names()), 1)
    places = {"/lagrangian": lagrangian}
    held = plain.get("constraints") or []
    constraints = [held] if isinstance(held, str) else list(held)
    for fields in found.fields:
        with fields.placed():
            constraints += _held_by_fields(fields, velocities)
    definitions, where = _definitions(others, {*velocities}), dict[str, str]()
    forces = [*found.forces.values()]
    rates: list[Typed] = []
    for line in others:
        name, squared = _defined(line, {*velocities})
        if (
            name and definitions[name] is line and not (squared and name in velocities)
        ):  # y^2 = l^2 - x^2 has two roots
            right = signs.halves(line).right.or_blank()
            if name in velocities and time_derivatives.moving_names(
                reader.tokens_if_any(right.text, nm.Names()), 1
            ):
                raise fault("definition by velocities", line.pointer, name=name)
            if squared:
                power = "^{1/2}" if reader.is_latex(right.text) else "^(1/2)"
                right = _in_brackets("(", right) + right.made(power, -1)
            where[name] = right.text
            places[f"/where/{name}"] = right
        else:
            places[f"/constraints/{len(constraints)}"] = line
            constraints.append(line.text)
            rates.append(line)
    for place, line in enumerate(others):
        _ask_about_rate(line, lagrangian, {"t", *declared})
        if any(line is one for one in definitions.values()):
            energy = sequences.begin(ENERGY, line)
            rest = [other.text for k, other in enumerate(others) if k != place]
            whole = lagrangian if is_whole and energy and energy["potential"] else None
            if _is_unused(line, [lagrangian.text, *rest, *forces], {*velocities}, whole):
                notes[line.text.strip()] = Meaning(reader.LEFT_OUT)
    typed = (vectors.written_out(Typed.of(text, at)).text for at, text in texts.items())
    given = [f", {one}" for text in typed for one in vectors.given_in(text)]
    given_lagrangian, *constraints = (
        "".join([text, *(vector for vector in given if _has_vector(text, vector))])
        for text in (lagrangian.text, *constraints)
    )
    _ask_about_speed(rates, lagrangian, {*declared, *definitions})
    if key == "equations":
        _ask_about_potential(lagrangian, velocities, {*declared, *definitions})
    with lagrangian.placed():
        known = declared if is_whole else None
        reactions.refuse_other_multipliers(
            found.forces, given_lagrangian, constraints, known, definitions
        )
    made = {
        **({"time": found.times[0]} if found.times else {}),
        **{name: value for name, value in plain.items() if name != key},
        "lagrangian": given_lagrangian,
    }
    motions = _given_motions(found, given_lagrangian) if not plain.get("functions") else []
    if motions:
        made["functions"] = {name: ["t"] for name in motions}
        notes |= {
            f"{name}(t)": Meaning("a given motion", f"a coordinate {name}") for name in motions
        }
    if where:
        made["where"] = {**plain.get("where", {}), **where}
    if len(others) > len(where) or found.fields:
        made["constraints"] = constraints
    elif any(force.strip() != "0" or name[-1] == "'" for name, force in found.forces.items()):
        try:
            read = {
                line: Meaning("an equation of motion")
                if lagrange_equations.has_rate(line)
                else words
                for line, words in notes.items()
            }
            return _with_forces(made, found.forces), {}, read
        except errors.InputError as error:
            raise error.placed(lagrangian.pointer) from None
    return _with_speed(made, places, notes, declared)


def _with_speed(
    made: dict[str, Any],
    places: dict[str, Typed],
    notes: dict[str, Meaning],
    declared: Container[str],
) -> _Found:
    """The same with v = x' for an L = m v^2/2 - V(x) without velocities, and v^2 = x'^2 + y'^2 for
    one of x and y; InputError next to a distance, as v has more parts than r'.
    """
    where = made.get("where") or {}
    formula = places.get("/lagrangian", Typed.of(made["lagrangian"], "/lagrangian"))
    formulas = [formula, *(places.get(f"/where/{name}") for name in where)]
    given = [one for one in formulas if one is not None]
    if "v" in declared or "v" in where or not any(map(_has_speed, given)):
        return made, places, notes
    tokens = [token for one in given for token in reader.tokens_if_any(one.text, nm.Names())]
    words = {
        letter
        for token in walk(tokens)
        if token.kind == "name" and token.text not in nm.FUNCTIONS
        for letter in nm.letters_of_run(token.text) or (token.text,)
    }
    if time_derivatives.moving_names(tokens, 1):
        return made, places, notes
    if radii := sorted(words & _DISTANCES):
        raise fault("speed next to a distance", formula.pointer, name=radii[0])
    heights = ("h",) if {"g", "h"} <= words else ()
    moving = [name for name in ("x", "y", "z") if name in words] or [*heights]
    if not moving:
        return made, places, notes
    squares = " + ".join(f"{name}'^2" for name in moving)
    speed = f"{moving[0]}'" if len(moving) == 1 else f"sqrt({squares})"
    with_v = {**made, "where": {**where, "v": speed}}
    return with_v, places, {**notes, "v": Meaning(speed)}


def _has_speed(formula: Typed) -> bool:
    """Whether v occurs, always as the v^2 of m v^2/2 and mv^2/2."""
    tokens = reader.tokens_if_any(formula.text, nm.Names())
    squared = list[bool]()
    for line, place, _ in places(tokens):
        token, power = line[place], at(line, place + 2)
        parts = nm.letters_of_run(token.text) if token.kind == "name" else ()
        if "v" in (parts or (token.text,)):
            two = at(line, place + 1).is_operator("^") and spelled([power]).strip("()") == "2"
            squared.append((parts or (token.text,))[-1] == "v" and two and not token.order)
    return bool(squared) and all(squared)


def _put_calls_in(found: _Written) -> None:
    """L = T - U(r, z) for the L = T - U of a text with U = U(r, z), which is left out."""
    whole = found.energies.get("whole")
    for kind, energy in [*found.energies.items()]:
        name, call = energy.named[kind], signs.trimmed(energy.formula)
        words = signs.words(call)
        if whole is None or words[:2] != [name, "("] or words.index(")") + 1 != len(words):
            continue
        del found.energies[kind]
        found.notes[energy.whole.text.strip()] = Meaning(reader.LEFT_OUT)
        formula = whole.formula

        alone = sequences.then(words[0], sequences.unless(sequences.one("(")))
        places = [Change(*found.span, call) for found in sequences.find(alone, formula)]
        whole = replace(whole, formula=formula.put(places))
        found.energies["whole"] = whole


def _drop_named_difference(found: _Written) -> None:
    """Leave the L = T - V out whose T has a transpose, q'^T M q'/2, so that its T is no name."""
    kinetic, potential, whole = (
        found.energies.get(kind) for kind in ("kinetic", "potential", "whole")
    )
    if kinetic is None or potential is None or whole is None:
        return
    names = str(kinetic.named["kinetic"]), str(potential.named["potential"])
    is_difference = signs.words(signs.trimmed(whole.formula)) == [names[0], "-", names[1]]
    transposed = sequences.find(sequences.then("^", names[0]), kinetic.formula)
    if (
        is_difference
        and not (kinetic.named["twice"] or potential.named["twice"])
        and any(transposed)
    ):
        del found.energies["whole"]


def _given_motions(found: _Written, lagrangian: str) -> list[str]:
    """The y of L(theta, theta') = ... y'(t) ..., which moves and is no coordinate of this L: it is
    always written as a function of the time.

    Without these arguments a y'(t) that is not squared, where no other velocity is written so.
    """
    energy = found.energies.get("whole")
    named = reader.tokens_if_any((energy and energy.named["arguments"]) or "", nm.Names())
    listed = [token for token in walk(named) if token.kind == "name"]
    tokens = reader.tokens_if_any(lagrangian, nm.Names())
    moving = time_derivatives.moving_names(tokens, 1)
    called = [
        (line[place], spelled(at(line, place + 1).inside) == "t", at(line, place + 2))
        for line, place, _ in places(tokens)
        if line[place].kind == "name"
    ]
    plain = {name.text for name, timed, _ in called if not timed}
    if not listed:
        squared = {name.text for name, _, after in called if name.order and after.is_operator("^")}
        motions = {*moving} - plain
        return [*motions] if motions < {*moving} and not motions & squared else []
    if not {token.text for token in listed if token.order} & {*moving}:  # L(q, q')
        return []
    return [
        name
        for name in moving
        if name not in plain and name not in {token.text for token in listed}
    ]


def _ask_about_expression(found: _Written, texts: Mapping[str, str]) -> None:
    """InputError for m x'^2/2 - k x^2/2 without L = before it."""
    if (
        found.energies
        or len(found.others) != 1
        or len(texts) != 1
        or "=" in next(iter(texts.values()))
    ):
        return
    line = found.others[0].strip()
    tokens = reader.tokens_if_any(line.text, nm.Names())
    if time_derivatives.moving_names(tokens, 1) and not time_derivatives.moving_names(tokens, 2):
        written = f"L = {line.text}"
        error = fault("expression alone", 1, None, (written,))
        raise _spanned(line.error(error), line, line)


def _refuse_missing_energy(found: _Written, declared: Container[str]) -> None:
    """InputError for L = T - V where T or V is not given."""
    formula = reader.tokens_if_any(found.energies["whole"].formula.text, nm.Names())
    letters_alone = all(
        token.text in _ENERGY_LETTERS or token.is_operator("+", "-") for token in formula
    )
    given = {energy.named[kind] for kind, energy in found.energies.items()}
    given |= {at(reader.tokens_if_any(line.text, nm.Names()), 0).text for line in found.others}
    missing = [token.text for token in formula if token.kind == "name" and token.text not in given]
    if letters_alone and len(formula) > 1 and missing and missing[0] not in declared:
        raise fault("energy not given", found.energies["whole"].formula.pointer, name=missing[0])


def _with_forces(plain: dict[str, Any], forces: Mapping[str, str]) -> dict[str, Any]:
    """The equations d/dt(dL/dq') - dL/dq = Q of L with generalized forces Q, by q; InputError where
    one is missing.
    """
    texts = {f"/forces/{name}": text for name, text in forces.items()}
    try:
        known = document_names.known_names(
            _declared_by(plain), {"/lagrangian": plain["lagrangian"], **texts}, 1
        )
        names = known.names
        lagrangian = known.put_in(
            reader.read_formula(plain["lagrangian"], replace(names, energy=True))
        )
        given = dict(_read_force(name, text, lagrangian, known) for name, text in forces.items())
    except (TypeError, AttributeError):  # the shapes of declarations are refused by the schemas
        return plain
    names = known.remaining()
    if missing := [name for name in names.coordinates if name not in given]:
        raise fault("equation of Lagrange missing", "", names=", ".join(missing))
    accelerations = [ex.Acceleration(name) for name in names.coordinates]
    sums = euler_lagrange.euler_lagrange_sums(lagrangian, names.coordinates, accelerations)
    sides = [
        (collecting.collect(tree), given[name])
        for name, tree in zip(names.coordinates, sums, strict=True)
    ]
    kept = {key: part for key, part in plain.items() if key not in ("lagrangian", "where")}
    equations = [f"{printing.to_text(left)} = {printing.to_text(right)}" for left, right in sides]
    return {**kept, "coordinates": list(names.coordinates), "equations": equations}


def _declared_by(plain: Mapping[str, Any]) -> declarations.Declared:
    """What a document declares; TypeError or AttributeError for other shapes, which the schemas
    refuse.
    """
    keys = ("coordinates", "parameters", "functions", "where")
    return declarations.Declared(**{key: plain[key] for key in keys if plain.get(key)})


def _read_force(
    name: str, text: str, lagrangian: ex.Expression, known: declarations.Known
) -> tuple[str, ex.Expression]:
    """(x, Q) of a force by x, and of one by x', to which dL/dx does not belong; with dF/dx' of a
    defined F.
    """
    names = known.names
    for line, place, _ in places(reader.read_tokens(text, names)):
        inside = at(line, place + 1).inside if line[place].text == "diff" else ()
        by_velocity = len(inside) == 3 and inside[2].order
        if by_velocity and ex.Symbol(names.spelling(inside[0].text)) not in known.definitions:
            raise fault("dissipation not given", "", name=inside[0].text)
    force = known.put_in(reader.read_formula(text, names))
    coordinate = names.spelling(name.rstrip("'"))
    literal = (
        calculus.differentiate(lagrangian, ex.Symbol(coordinate)) if name.endswith("'") else ex.ZERO
    )
    return coordinate, force - literal


def _plain_name(written: str) -> str:
    r"""q of \dot{q}, q', and q with a dot."""
    return at(reader.tokens_if_any(written, nm.Names()), 0).text


def _written(texts: Mapping[str, str], declared: Container[str]) -> _Written:
    """The parts of the texts; a metric ds^2 = … gives 2 L = … ."""
    found, derived = _Written(), set[tuple[str, int]]()
    for pointer, typed in texts.items():
        text = Typed.of(typed, pointer).put(own_functions.changes(typed))
        text = lagrangians.with_letter_l(text, motion.is_differentiated, _ENERGY_NAMES)
        text, time = actions.of_action(lagrangians.unframed(text))
        text = vectors.with_squares(vectors.written_out(vectors.without_matrices(text)))
        if time:
            found.notes[typed.partition("=")[0].strip(" $")] = Meaning(
                "the action; its integrand is L"
            )
        found.times.extend([time] * (time not in ("", "t")))
        if metric := metrics.metric(text):
            text = metrics.as_lagrangian(text)
            found.notes[metric] = Meaning("a metric, whose geodesics are meant")
        left, omitted = lagrange_equations.without_equations(text)
        found.notes.update((line.text, Meaning(reader.LEFT_OUT)) for line in omitted)
        with reader.placed_at(pointer):
            found.forces.update(force for line in omitted if (force := _force(line)) is not None)
        left, fields = vector_fields.without_fields(left)
        found.fields.extend([] if fields is None else [fields])
        with reader.noted() as noted:
            lines = _lines(left)
        found.notes.update(noted)
        for line in lines:
            if lengths.is_of_itself(line.text):
                continue  # S = ∫ L dt next to L = ...
            if labels.is_of_lagrangian(reader.tokens_if_any(line.text, nm.Names()), derived):
                found.notes[line.text.strip()] = Meaning(reader.LEFT_OUT)
                continue
            named = sequences.begin(ENERGY, line)
            kind = next(
                (kind for kind in ("whole", "kinetic", "potential") if named and named[kind]), ""
            )
            plain = kind == "whole" and _is_length(line, texts)
            if named is None or kind in found.energies or named[kind] in declared or plain:
                found.others.append(line)
            else:
                formula = line[named.span.stop :]
                summed = sequences.begin(ENERGIES, formula)
                summed_part = formula[: summed.span.stop] if summed else formula[:0]
                formula = formula[len(summed_part.text) :]
                formula, others = _most_explicit(formula, kind)
                if others:
                    found.notes[others] = Meaning(reader.LEFT_OUT)
                    line = line[: named.span.stop] + formula
                out = frozenset(signs.words(summed_part)) if summed else frozenset[str]()
                found.energies[kind] = _Energy(named, line, formula.or_blank(), out)
    return found


class _Explicit(NamedTuple):
    """The side of an energy that says most, and the other ones."""

    formula: Typed
    others: str


def _most_explicit(formula: Typed, kind: str) -> _Explicit:
    """The last side of T = m v^2/2 = m (x'^2 + y'^2)/2, and of V = m g y = -m g l cos(theta), that
    is neither a number nor a sum of energies, and in which something moves where it is no potential;
    the whole for other formulas.
    """
    sides = signs.sides(formula)
    open_ones = formula.text.count("(") != formula.text.count(")")
    apart = not _BETWEEN.isdisjoint(signs.words(formula))
    if len(sides) < 2 or open_ones or apart or motion.accelerates(formula.text):
        return _Explicit(formula, "")
    words = [{*signs.words(side)} for side in sides]
    if {"const", "constant", "0"} & words[-1] and len(words[-1]) == 1:
        return _Explicit(formula, "")
    chosen = [
        place
        for place, each in enumerate(words)
        if any(word not in _ENERGY_NAMES and sequences.is_name(word.lstrip("\\")) for word in each)
        and (kind == "potential" or motion.is_differentiated(sides[place].text))
    ]
    if not chosen:
        return _Explicit(formula, "")
    others = [side.text.strip() for place, side in enumerate(sides) if place != chosen[-1]]
    return _Explicit(sides[chosen[-1]], " = ".join(others))


def _is_length(line: Typed, texts: Mapping[str, str]) -> bool:
    """Whether L = ... is the value of a length: a number, or beside the rates of Modelica a formula
    in which nothing moves.
    """
    if lengths.is_value(line.text):
        return True
    energies = {*signs.words(line)[1:]} & {*_ENERGY_NAMES, "der"}
    still = not energies and not motion.is_differentiated(line.text)
    return still and any(map(motion.has_rates_of_modelica, texts.values()))


def _force(line: Typed) -> tuple[str, str] | None:
    """(x, Q) of d/dt dL/dx' - dL/dx = Q, or (x', Q) without dL/dx; None for a variation."""
    force = lagrange_equations.force(line)
    if force is None:
        return None
    return _plain_name(force.still) or f"{_plain_name(force.moving)}'", force.text


def _definitions(lines: Sequence[Typed], moving: Collection[str]) -> dict[str, Typed]:
    """The line that defines each name: of omega = psi' cos(theta) + phi', omega = 0 the second is a
    constraint.
    """
    found: dict[str, Typed] = {}
    for line in lines:
        name = _defined(line, moving)[0]
        if name and (name not in found or definitions.gives_number(found[name])):
            found[name] = line
    return found


def _held_by_fields(spanned: Typed, moving: Sequence[str]) -> list[str]:
    """The constraints of a distribution that vector fields span: det(v, X_1, …, X_r) = 0 in r + 1
    coordinates.
    """
    text = spanned.text
    written = vector_fields.with_velocities(spanned, reader.is_latex(text))
    fields = [field for _, field in notation.split_outside(written, ",")]
    tokens = [token for field in fields for token in walk(reader.read_tokens(field))]
    coordinates = tuple(dict.fromkeys([*moving, *time_derivatives.moving_names(tokens, 1)]))
    words = {token.text for token in tokens if token.kind == "name"}
    names = nm.Names(coordinates, tuple(sorted(words - nm.FUNCTIONS - {*coordinates})))
    parts = [
        euler_lagrange.linear_parts(reader.read_formula(field, names), ex.Velocity)
        for field in fields
    ]
    rows = [part[0] for part in parts if isinstance(part, tuple) and part[1] == ex.ZERO]
    columns = [(v, *(row.get(v, ex.ZERO) for row in rows)) for v in map(ex.Velocity, coordinates)]
    minors: dict[tuple[tuple[ex.Expression, ...], ...], ex.Expression] = {}
    if len(rows) == len(fields) and perm(len(columns), len(rows)) <= _MOST_PRODUCTS:
        choices = combinations(columns, len(rows))
        minors = {
            chosen: collecting.determinant([each[1:] for each in chosen]) for chosen in choices
        }
    chosen = min(
        (each for each in minors if minors[each] != ex.ZERO),
        key=lambda each: ex.node_count(minors[each]),
        default=None,
    )
    if chosen is None:
        raise fault("fields of a distribution", "")
    alike = {
        kind(plain): kind(variant)
        for variant, plain in letters.ALIKE.items()
        if f"\\{variant}" in text
        for kind in (ex.Symbol, ex.Velocity)
    }
    held = [collecting.determinant([*chosen, one]) for one in columns if one not in chosen]
    return [f"{printing.to_text(ex.substitute(tree, alike))} = 0" for tree in held]


def _defined(line: Typed, moving: Collection[str]) -> tuple[str, bool]:
    """The name, with its argument, that a line defines, and whether it gives its square; no name
    for a constraint.
    """
    found = sequences.begin(DEFINED, line)
    if found is None or len(signs.sides(line)) > 2:  # phi = z' - y x' = 0
        return "", False
    left, right = (half.text for half in signs.halves(line))
    displaced = differential_forms.begins_with_form(left) and differential_forms.has_form(right)
    displacements = reader.names_in_forms(left)
    form = displaced or displacements or {*moving} & reader.names_in_forms(right)
    rate = labels.derivative_called(reader.tokens_if_any(right, nm.Names()))  # dx = diff(x, t)
    is_rate = rate is not None and not displacements & ({*moving} - {rate[0]})
    name = found.cut(line, "name").text.removeprefix("\\")
    product = len(name.split()) > 1  # m g = 3
    other = product or name in nm.FUNCTIONS or nm.Names().derivative_of_any(name)
    if (form and not is_rate) or other:
        return "", False
    arguments = found.cut(line, "arguments").text if found["arguments"] else ""
    for sign in ("\\left", "\\right"):
        arguments = arguments.replace(sign, "")
    return name + arguments, found["square"] is not None


def _is_unused(
    line: Typed, others: Sequence[str], moving: Collection[str], whole: Typed | None
) -> bool:
    """Whether no other line uses a definition, which changes nothing, as omega = sqrt(k/m) and
    omega = theta'.

    InputError for F = -c x' or F = cos(t), and for V = … beside an L, perhaps meant without V.
    `whole` is that L.
    """
    tokens = reader.tokens_if_any(line.text, nm.Names())
    first, formula = at(tokens, 0), [token for token in walk(tokens[2:]) if token.kind == "name"]
    words = [
        token.text for text in others for token in walk(reader.tokens_if_any(text, nm.Names()))
    ]
    used = any(word == first.text or (first.text in word and word.isalpha()) for word in words)
    names = [token.text for token in formula if token.text not in nm.FUNCTIONS]
    moves = any(token.order for token in formula) or any(word[-1] == "t" for word in names)
    moves = moves or any(name in word for word in names for name in moving)
    rate = (len(tokens) == 3 and tokens[2].order) or labels.derivative_called(tokens[2:])
    if used or not moves or rate:
        return not used
    written = whole[: len(whole.text.rstrip(" \t\n.,;"))].strip() if whole is not None else None
    if written is None or not written.text:
        raise line.error(fault("unused definition", first.column, name=first.text))
    meant = f"{written.text} - {first.text}"
    found = line.error(fault("unused potential", first.column, None, (meant,), name=first.text))
    raise _spanned(found, written, written)


def _spanned(error: errors.InputError, first: Typed, last: Typed) -> errors.InputError:
    """The error whose span goes from one text to another one, if both were typed in its text."""
    (begun, start), (ended, stop) = first.places[0], last.places[-1]
    if begun != error.pointer or ended != error.pointer or error.column is None:
        return error
    return error.moved(error.detail, error.pointer, error.column, (start, stop))


def _has_vector(text: str, given: str) -> bool:
    """Whether the text contains the name that r = (x, y) gives, and a bold letter if that name is
    bold.
    """
    head, words = (
        [sign.text.lstrip("\\") for sign in signs.of(part)]
        for part in (given.partition("=")[0], text)
    )
    name = [word for word in head if sequences.is_word(word)][-1]
    line, is_tex = signs.of(text), reader.is_latex(text)
    for place, sign in enumerate(line):  # the K of q^TKq
        if sign.text.isalpha() and (is_tex or line.says(place - 1, "^")):
            words += [*sign.text]
    bold = components.holds_vector
    return any(name in (word, word.rstrip("0123456789")) for word in words) and (
        bold(text) or not bold(given)
    )


def _is_kinetic(tokens: Sequence[Token], velocities: Sequence[str]) -> bool:
    """Whether each velocity is that of one coordinate, and occurs squared or again."""
    every = [(line[place], at(line, place + 1)) for line, place, _ in places(tokens)]
    for name in velocities:
        found = [after for token, after in every if token.text == name and token.order]
        if name.endswith(("_i", "_j", "_k")) or not (
            len(found) > 1 or any(after.is_operator("^") for after in found)
        ):
            return False
    return True


def _ask_about_potential(
    lagrangian: Typed, velocities: Sequence[str], known: Collection[str]
) -> None:
    """InputError for the V of L = m x'^2/2 - V and the phi of - q phi, which no line gives: a
    potential is meant, and no constant.
    """
    tokens = reader.tokens_if_any(lagrangian.text, nm.Names())
    if not _is_kinetic(tokens, velocities):
        return  # another fault is said of this L
    for term in split_at("+-", tokens):
        names = [token for token in walk(term) if token.kind == "name"]
        words = {token.text for token in names}
        called = any(token.is_bracket() for token in term)
        charged = words & _CHARGES and words & _OF_CHARGES
        if (
            not (words & {"V", "U"} or charged)
            or called
            or words & {*velocities, *known}
            or any(token.order for token in names)
        ):
            continue
        if words <= {"V", "U", *_CHARGES} or words <= {*_OF_CHARGES, *_CHARGES}:
            [name] = [one for one in names if one.text not in _CHARGES][:1]
            of = ", ".join(dict.fromkeys(velocities))
            typed = lagrangian.text[name.column - 1 :]
            slash = "\\" * typed.startswith("\\")  # of \phi
            letters = len(slash + name.text) if slash or typed[:1].isascii() else 1
            span, written = (name.column, name.column + letters), slash + name.text
            raise lagrangian.error(
                fault("potential without arguments", name.column, span, name=written, of=of)
            )


def _ask_about_rate(line: Typed, lagrangian: Typed, known: Collection[str]) -> None:
    """InputError for phi' = omega where L has omega and no phi': it defines omega, or holds phi'
    constant.

    Names that are known, or move in L, have one meaning.
    """
    try:
        line_tokens = reader.read_tokens(line.text)
        inside = reader.read_tokens(lagrangian.text)
    except errors.InputError:
        return  # reported where it is read
    if [(token.kind, token.order) for token in line_tokens] != [
        ("name", 1),
        ("operator", 0),
        ("name", 0),
    ]:
        return
    moving, rate = line_tokens[0].text, line_tokens[2].text
    occurs = rate in {token.text for token in walk(inside)} - {*known}
    if occurs and not {moving, rate} & {*time_derivatives.moving_names(inside, 1)}:
        left, right = (half.text.strip() for half in signs.halves(line))
        meant = (f"{right} = {left}", f"{left} - {right} = 0")
        words = {"moving": moving, "rate": rate}
        span = columns_of(line.text)
        raise line.error(
            fault("definition or constant", line_tokens[0].column, span, meant, **words)
        )


def _ask_about_speed(lines: Sequence[Typed], lagrangian: Typed, known: Collection[str]) -> None:
    """InputError for the v of x' = v cos(theta), y' = v sin(theta) if L has none: any speed, or a
    constant.
    """
    for name in sorted({*guessed_names.ANY_SPEED} - {*known}):
        held = [(line, found) for line in lines if (found := _sign_of(name, line.text))]
        if len(held) != 2 or _sign_of(name, lagrangian.text):
            continue
        (first, found), (last, _) = held
        declared = declarations.Declared(parameters=[name, declarations.AND_GUESS])
        try:
            given = {"/lagrangian": lagrangian.text, "/1": first.text, "/2": last.text}
            names = document_names.known_names(declared, given, 1).names
            pairs = [
                pair for line in (first, last) for pair in reader.read_equations(line.text, names)
            ]
        except errors.InputError:
            return  # reported where it is read
        trees = [left - right for left, right in pairs]
        slopes = [calculus.differentiate(tree, ex.Symbol(name)) for tree in trees]
        free = printing.to_text(collecting.collect(trees[0] * slopes[1] - trees[1] * slopes[0]))
        error = fault("speed or constant", found.start + 1, None, (f"{free} = 0",), name=name)
        raise _spanned(first.error(error), first.strip(), last.strip())


def _sign_of(name: str, text: str) -> signs.Sign | None:
    """The first place of a text that is this name."""
    return next((sign for sign in signs.with_whole_names(text) if sign.text == name), None)


def _with_multipliers(plain: dict[str, Any], texts: Mapping[str, str]) -> _Found:
    """The same for m x'' = lambda sin(theta), … with x' sin(theta) = y' cos(theta) or sin(theta) dx
    = cos(theta) dy.
    """
    named: dict[str, str] = {}
    for text in texts.values():
        named |= definitions.named_zeros(text)
    lines = [
        line
        for pointer, text in texts.items()
        for line in _lines(definitions.without_names(Typed.of(text, pointer)))
    ]
    # dz = y dx, without a derivative dx/dt
    are_forms = [
        differential_forms.has_form(line.text) and not differential_forms.has_time(line.text)
        for line in lines
    ]
    pointers = [
        f"/{'constraints' if is_form else 'equations'}/{k}" for k, is_form in enumerate(are_forms)
    ]
    origins = dict(zip(pointers, lines, strict=True))
    texts = {pointer: line.text for pointer, line in origins.items()}
    try:
        found = reactions.constrained(
            texts, _declared_by({**plain, "where": {**plain.get("where", {}), **named}})
        )
    except (TypeError, AttributeError):  # the shapes of declarations are refused by the schemas
        found = None
    if found is None:
        return plain, {}, {}
    made, held, multipliers = found
    kept = {key: part for key, part in plain.items() if key != "equations"}
    places = {f"/constraints/{k}": origins[pointer] for k, pointer in enumerate(held)}
    notes = dict.fromkeys(multipliers, Meaning("a multiplier of the constraints"))
    return {**kept, **made}, places, notes


def _as_motion(plain: dict[str, Any], texts: Mapping[str, str], lines: Sequence[Typed]) -> _Found:
    """The same for x'' = 0, y'' = -x*x'*y'/(1 + x^2), z' = -x*y': the line of first order is a
    constraint.
    """
    motion: dict[str, str] = {}
    held: dict[str, Meaning] = {}
    places: dict[str, Typed] = {}
    moving: dict[str, None] = {}
    accelerated: set[str] = set()
    for line in lines:
        tokens = reader.tokens_if_any(line.text, nm.Names())
        velocities = dict.fromkeys(time_derivatives.moving_names(tokens, 1))
        accelerations = time_derivatives.moving_names(tokens, 2)
        moving |= velocities
        accelerated.update(accelerations)
        if not accelerations and len(velocities) > 1:
            places[f"/constraints/{len(held)}"] = line
            held[line.text] = Meaning("a constraint")
        elif accelerations == [at(tokens, 0).text] and at(tokens, 1).is_operator("="):
            force = signs.halves(line).right.or_blank()
            places[f"/motion/{tokens[0].text}"] = force
            motion[tokens[0].text] = force.text
    if held and len(accelerated) == len(moving) == len(lines) - len(held):
        return _with_multipliers(plain, texts)
    if not motion or not held or not len(motion) + len(held) == len(moving) == len(lines):
        return plain, {}, {}
    kept = {"coordinates": list(moving)} | {
        key: part for key, part in plain.items() if key != "equations"
    }
    notes = {line.strip(): words for line, words in held.items()}
    return {**kept, "motion": motion, "constraints": list(held)}, places, notes


def read_lagrangian(plain: Mapping[str, Any]) -> ex.Expression:
    """The Lagrangian of a document; InputError where it is not read."""
    texts = {"/lagrangian": plain["lagrangian"]}
    known = document_names.known_names(_declared_by({**plain}), texts, 1)
    lagrangian = known.put_in(
        reader.read_formula(plain["lagrangian"], replace(known.names, energy=True))
    )
    if not ex.has(lagrangian, ex.Velocity):
        raise fault("no velocity", "/lagrangian")
    return lagrangian


def on_positions(plain: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Meaning]]:
    """L with constraints on positions as L in coordinates that fulfil them; what was put in for
    each constraint.

    The document as it is if there are none, or if one of them has no usual coordinates.
    """
    held = plain.get("constraints")
    texts = [held] if isinstance(held, str) else held
    if not isinstance(plain.get("lagrangian"), str) or not isinstance(texts, list):
        return plain, {}
    try:
        by_pointer = {f"/constraints/{place}": text for place, text in enumerate(texts)}
        known = document_names.known_names(
            _declared_by(plain), {"/lagrangian": plain["lagrangian"], **by_pointer}, 1
        )
        pairs = [
            (text, reader.read_equations(text, replace(known.names, forms=True))) for text in texts
        ]
        lagrangian = known.put_in(
            reader.read_formula(plain["lagrangian"], replace(known.names, energy=True))
        )
    except (TypeError, AttributeError, errors.InputError):
        return plain, {}  # refused where it is read
    trees = {text: known.put_in(left - right) for text, ((left, right), *more) in pairs if not more}
    still = [text for text in trees if not ex.has(trees[text], ex.Velocity | ex.Acceleration)]
    names = known.remaining()
    from inverse_service.mechanics import position_constraints

    found = position_constraints.definitions_on(
        [trees[text] for text in still], lagrangian, names.coordinates, {*known.names.declared()}
    )
    if not still or found is None:
        return plain, {}
    where = [
        {name: printing.to_text(formula) for name, formula in each.items()} for each in found[0]
    ]
    made = {
        **plain,
        "coordinates": list(found[1]),
        "constraints": [text for text in texts if text not in still],
    }
    made["where"] = dict(chain(plain.get("where", {}).items(), *(each.items() for each in where)))
    if not made["constraints"]:
        del made["constraints"]
    shown = [
        Meaning(", ".join(f"{name} = {formula}" for name, formula in each.items()))
        for each in where
    ]
    return made, dict(zip((text.strip() for text in still), shown, strict=True))


def _lines(text: Typed) -> list[Typed]:
    """The equations of a text."""
    text = reader.without_words(text)
    try:
        groups = reader.split_equations(text.text, nm.Names(forms=True))
    except errors.InputError:  # of a vector whose components stand elsewhere
        groups = reader.split_as_typed(text.text)
        if not groups:
            return [text]
    begins = [0, *(group.end_column for group in groups)]
    places = [
        (
            signs.beginning(text, begin, group.tokens[0].column - 1, group.end_column - 1),
            _end(text, group),
        )
        for group, begin in zip(groups, begins, strict=False)
    ]
    lines = [vectors.without_vectors(text[start:end]) for start, end in places]
    shown = map(line_ends.without_closing, lines)
    return [line for line in shown if line.text.strip()]


def _end(text: Typed, group: reader.EquationTokens) -> int:
    """The place where an equation ends, before the words that are left out, as in (kinetic
    energy).
    """
    last, end = group.tokens[-1], group.end_column - 1
    start = min(max(last.column, last.end), end)
    remark = line_ends.remark_at_end(text[start:end])
    place = end if remark is None else start + remark
    return place if signs.ends_apart(text, place) else end  # not of a call, diff(theta)
