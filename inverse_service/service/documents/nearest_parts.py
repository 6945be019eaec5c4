"""The key `nearest`: the systems with a Lagrangian that are nearest to a fitted one, as parts of a
result. Each is solved as a document of its own, and left out unless the checker agrees.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from flint import fmpq_mat

from api_schemas import result as schemas
from api_schemas.system import NearestQuestion, SystemDocument
from inverse_service import deadline, errors
from inverse_service.decision.solutions import SolveOptions
from inverse_service.expressions import collecting, printing, tree as ex
from inverse_service.fitting import exact_members, fitted as ft, nearest_members
from inverse_service.fitting.fitted import FittedSystem, Metric
from inverse_service.mechanics.second_order_system import SecondOrderSystem
from inverse_service.reading import declarations, names as nm, reader
from inverse_service.service.documents import accepting, growing, translate
from inverse_service.service.documents.older_keys import Told

Answer = Callable[[dict[str, Any], SolveOptions], dict[str, Any]]
SHARE_OF_SEARCH = 0.5  # of the time, the rest is for the answers about the members
LEAST_SECONDS = 2.0  # for each of these answers
LEAST_SQUARE = Fraction(1, 10**200)  # of an error
DIGITS = 40  # of a number that is shown as a decimal number
_STATEMENTS = {
    "equal_masses": "L = |q'|^2/2 + A(q) q' - V(q)",
    "natural": "L = q' G q'/2 + A(q) q' - V(q)",
    "damped": "L = e^(g0 t) (q' G q'/2 + A(q) q' - V(q))",
    "exponential": "L = e^(g q) (q' G q'/2 + A(q) q' - V(q))",
    "damped_exponential": "L = e^(g0 t + g q) (q' G q'/2 + A(q) q' - V(q))",
}
_ANY = "any Lagrangian: all values of the coefficients"
_LEAF = "a set of the family with a Lagrangian"


def fitted_system(schema: SystemDocument) -> FittedSystem:
    """The fitted system of a document, in its metric; InputError for names it does not have."""
    question = schema.nearest if isinstance(schema.nearest, NearestQuestion) else NearestQuestion()
    values = _letters(schema)
    if values:
        names = schema.model_copy(
            update={"parameters": dict.fromkeys(document_names_of(schema), None)}
        )
        system = accepting.to_system(names)
        held = {node.name for f in system.accelerations for node in ex.walk(f)
                if isinstance(node, ex.Symbol)}  # fmt: skip
        values = {name: value for name, value in values.items() if name in held}
        if question.library:
            raise errors.InputError(
                "A library is for equations whose numbers are the coefficients: write the values of "
                "the parameters into the equations.",
                "/nearest/library",
            )
    else:
        system = accepting.to_system(schema)
    if generic := [name for name in system.parameters if name not in values]:
        raise errors.InputError(
            f"The nearest system is looked for from numbers: give `{generic[0]}` a value in "
            '"parameters".',
            "/parameters",
        )
    if system.functions:
        raise errors.InputError(
            f"The nearest system is looked for from numbers: write a formula for `{system.functions[0][0]}`.",
            "/functions",
        )
    found = (
        ft.of_letters(system, values) if values else ft.of_terms(system, _library(question, system))
    )
    if not found.names:
        raise errors.InputError(
            "The equations have no coefficient that could move: name terms that may be used in "
            '"library".',
            "/equations",
        )
    return replace(found, metric=_measurable(_metric(question, found), found))


def _measurable(metric: Metric, found: FittedSystem) -> Metric:
    """The metric; InputError where floating-point numbers do not hold its distances."""
    for name, row, place in zip(
        found.names, metric.covariance, range(len(found.names)), strict=True
    ):
        if not LEAST_SQUARE < row[place] < 1 / LEAST_SQUARE:
            raise errors.InputError(
                f"The error of `{name}`, or its size where none is given, is to be between 10^-100 "
                "and 10^100: choose other units.",
                "/nearest",
            )
    try:
        _ = metric.root
    except np.linalg.LinAlgError:
        raise errors.InputError(
            "The covariance is singular but for rounding: some combination of the coefficients has "
            "almost no error; give errors in its place.",
            "/nearest/covariance",
        ) from None
    return metric


def document_names_of(schema: SystemDocument) -> list[str]:
    return [*schema.parameters] if not isinstance(schema.parameters, str) else []


def _letters(schema: SystemDocument) -> dict[str, Fraction]:
    """The parameters with values."""
    if not isinstance(schema.parameters, Mapping):
        return {}
    found = dict[str, Fraction]()
    for name, tree in declarations.parameter_values(schema.parameters).items():
        if not isinstance(tree, ex.Number):
            raise errors.InputError(
                f"`{name}` is to be a rational number such as 0.31 or 1/3: a fitted value is changed.",
                f"/parameters/{nm.escaped(name)}",
            )
        found[name] = tree.value
    return found


def _library(
    question: NearestQuestion, system: SecondOrderSystem
) -> dict[str, tuple[ex.Expression, ...]]:
    if isinstance(question.library, Mapping):
        for name in question.library:
            if name not in system.coordinates:
                raise errors.InputError(
                    f"`{name}` is not a coordinate: {', '.join(system.coordinates)}.",
                    f"/nearest/library/{nm.escaped(name)}",
                )
        texts = {name: list(each) for name, each in question.library.items()}
    else:
        texts = {name: list(question.library) for name in system.coordinates}
    found = dict[str, tuple[ex.Expression, ...]]()
    for name, each in texts.items():
        with reader.placed_at("/nearest/library"):
            trees = [reader.read_formula(text, system.names) for text in each]
        for tree in trees:
            reader.without_accelerations(tree, "a term of the library", "/nearest/library")
        found[name] = tuple(trees)
    return found


def _metric(question: NearestQuestion, found: FittedSystem) -> Metric:
    given = [
        key for key in ("errors", "weights", "covariance") if getattr(question, key) is not None
    ]
    if len(given) > 1:
        raise errors.InputError(
            f"Give one of {' and '.join(given)}: each says how distances are measured.", "/nearest"
        )
    if question.covariance is not None:
        return _covariance(question, found)
    measure = question.errors if question.errors is not None else question.weights
    if measure is None:
        return found.metric
    key = given[0]
    texts = _by_name(measure, question, found, f"/nearest/{key}")
    spread = list[Fraction]()
    for place, text in enumerate(texts):
        if text is None:
            raise errors.InputError(
                f"The {key[:-1]} of `{found.names[place]}` is missing: name each coefficient, or give "
                "one number for all.",
                f"/nearest/{key}",
            )
        value = _number(text, f"/nearest/{key}")
        if value <= 0:
            raise errors.InputError(
                f"The {key} are positive numbers, and that of `{found.names[place]}` is {text}.",
                f"/nearest/{key}",
            )
        spread.append(value if key == "errors" else _root(1 / value))
    return ft.diagonal(spread, key == "errors")


def _root(value: Fraction) -> Fraction:
    """The square root, exact for squares, else to 15 digits."""
    exact = Fraction(math.isqrt(value.numerator), math.isqrt(value.denominator))
    if exact**2 == value:
        return exact
    return Fraction(float(value) ** 0.5).limit_denominator(10**15)


def _by_name(
    measure: Mapping[str, str] | Sequence[str] | str,
    question: NearestQuestion,
    found: FittedSystem,
    pointer: str,
) -> list[str | None]:
    """The numbers in the order of the coefficients of the system."""
    if isinstance(measure, str):
        return [measure] * len(found.names)
    if isinstance(measure, Mapping):
        table = {_plain_name(name): text for name, text in measure.items()}
        known = {_plain_name(name): name for name in found.names}
        for name in measure:
            if _plain_name(name) not in known:
                shown = ", ".join(f"`{one}`" for one in found.names[:6])
                raise errors.InputError(
                    f"`{name}` is not a coefficient of the system; these are {shown}.",
                    f"{pointer}/{nm.escaped(name)}",
                )
        return [table.get(_plain_name(name)) for name in found.names]
    order = _order(question, found)
    if len(measure) != len(order):
        raise errors.InputError(
            f"There are {len(order)} coefficients, and {len(measure)} numbers here.", pointer
        )
    texts: list[str | None] = [None] * len(order)
    for place, text in zip(order, measure, strict=True):
        texts[place] = text
    return texts


def _plain_name(name: str) -> str:
    return re.sub(r"\s+", "", name)


def _order(question: NearestQuestion, found: FittedSystem) -> list[int]:
    """Where the coefficients that the document lists are among those of the system."""
    if not question.coefficients:
        if found.names == found.letters:
            return [*range(len(found.names))]
        raise errors.InputError(
            'Name the order: add "coefficients": '
            f"[{', '.join(chr(34) + name + chr(34) for name in found.names[:4])}, ...].",
            "/nearest",
        )
    known = {_plain_name(name): place for place, name in enumerate(found.names)}
    places = [known.get(_plain_name(name)) for name in question.coefficients]
    if sorted(place for place in places if place is not None) != [*range(len(found.names))]:
        missing = [name for k, name in enumerate(found.names) if k not in places]
        unknown = [name for name, k in zip(question.coefficients, places, strict=True) if k is None]
        which = f"`{unknown[0]}` is none" if unknown else f"`{(missing or ['one'])[0]}` is missing"
        raise errors.InputError(
            f"List each coefficient of the system once: {which}.", "/nearest/coefficients"
        )
    return [place for place in places if place is not None]


def _covariance(question: NearestQuestion, found: FittedSystem) -> Metric:
    order = _order(question, found)
    rows = question.covariance or []
    size = len(found.names)
    if len(rows) != size or any(len(row) != size for row in rows):
        raise errors.InputError(
            f"The covariance is to have {size} rows of {size} numbers, in the order of the "
            "coefficients.",
            "/nearest/covariance",
        )
    table = [[Fraction(0)] * size for _ in range(size)]
    for i, row in zip(order, rows, strict=True):
        for j, text in zip(order, row, strict=True):
            table[i][j] = _number(text, "/nearest/covariance")
    # Of sums of floating-point numbers, both halves agree but for rounding.
    for i in range(size):
        for j in range(i):
            scale = (abs(table[i][i]) * abs(table[j][j])) or Fraction(1)
            if (table[i][j] - table[j][i]) ** 2 > scale / 10**16:
                raise errors.InputError(
                    f"The covariance is to be symmetric, and those of `{found.names[j]}` and "
                    f"`{found.names[i]}` differ.",
                    "/nearest/covariance",
                )
            table[i][j] = table[j][i]
    if not _is_positive(ft.rational_matrix(table)):
        raise errors.InputError(
            "The covariance is to be positive definite: leave out coefficients that are known "
            "exactly, or give errors.",
            "/nearest/covariance",
        )
    return Metric(tuple(map(tuple, table)), True)


def _is_positive(matrix: fmpq_mat) -> bool:
    """Whether all leading minors are positive, by elimination."""
    size = matrix.nrows()
    table = [[ft.fraction_of(matrix[i, j]) for j in range(size)] for i in range(size)]
    for k in range(size):
        if table[k][k] <= 0:
            return False
        for i in range(k + 1, size):
            factor = table[i][k] / table[k][k]
            if factor:
                for j in range(k, size):
                    table[i][j] -= factor * table[k][j]
    return True


def _number(text: str, pointer: str) -> Fraction:
    try:
        return Fraction(text)
    except (ValueError, ZeroDivisionError):
        raise errors.InputError(
            f"`{text[:40]}` is not a number; write one such as 0.02 or 1/50.", pointer
        ) from None


# The parts of the result.


def with_nearest(
    told: Told,
    schema: SystemDocument,
    fitted: FittedSystem,
    asked: SolveOptions,
    grow: growing.Growing,
    end: float,
    answer: Answer,
) -> Told:
    """With the nearest members of each kind, those that the checker confirmed."""
    grow.begin("nearest")
    question = schema.nearest
    nice = isinstance(question, NearestQuestion) and question.nice
    until = deadline.now() + SHARE_OF_SEARCH * (end - deadline.now())
    found = nearest_members.nearest(fitted, asked, until, nice, grow.stage)
    parts = list[schemas.NearestMember]()
    missing = [schemas.NotReached(kind=one.kind, reason=one.reason) for one in found.unreached]
    for place, member in enumerate(found.members):
        left = end - deadline.now()
        limit = max(LEAST_SECONDS, left / (len(found.members) - place))
        part = _member_part(member, fitted, schema, replace(asked, time_limit=limit), answer)
        if part is None:
            reason = (
                f"a member at the distance {member.distance:.4g} was not confirmed by the solver "
                "and the checker in time"
            )
            missing.append(schemas.NotReached(kind=member.kind, reason=reason))
        else:
            parts.append(part)
    return told.also(
        nearest=translate.as_plain_data(parts), nearest_not_reached=translate.as_plain_data(missing)
    )


def _member_part(
    member: nearest_members.Member,
    fitted: FittedSystem,
    schema: SystemDocument,
    options: SolveOptions,
    answer: Answer,
) -> schemas.NearestMember | None:
    with printing.with_decimals(decimals(member.coefficients)):
        equations = _equations(fitted, member.coefficients)
        document: dict[str, Any] = {
            "coordinates": list(fitted.system.coordinates),
            "parameters": [],
            "equations": equations,
            "first_integrals": False,
        }
        if member.timed or schema.time_dependent_lagrangian is not None:
            # Of a kind with the time the L is that of the kind, also where there is a longer one
            # without the time.
            document["time_dependent_lagrangian"] = member.timed or schema.time_dependent_lagrangian
        result = answer(document, options)
    if not has_valid_proof(result):
        return None
    is_known = fitted.metric.are_errors
    chance = nearest_members.chance(member.distance, member.degrees) if is_known else None
    offered = None
    if member.nice is not None:
        with printing.with_decimals(decimals(member.nice)):
            offered = schemas.NiceMember(
                distance=fitted.distance(member.nice),
                moved=_moved(fitted, member.nice),
                equations=_equations(fitted, member.nice),
            )
    statement = _STATEMENTS.get(member.kind, _LEAF if member.degrees else _ANY)
    return schemas.NearestMember(
        kind=member.kind,  # type: ignore[arg-type]
        statement=statement,
        distance=member.distance,
        chi2=member.distance**2 if is_known else None,
        degrees=member.degrees,
        chance=chance,
        within=None if chance is None else chance > nearest_members.UNLIKELY,
        least=member.least,
        projection=member.is_projection,
        starts=member.starts,
        second=member.second,
        attained=member.attained,
        moved=_moved(fitted, member.coefficients),
        equations=_shown_equations(member, fitted),
        constraints=_constraints(member, fitted),
        multiplier=_multiplier(member, fitted),
        nice=offered,
        result=result,
    )


def has_valid_proof(result: Mapping[str, Any]) -> bool:
    """Whether the checker found a proof valid that the system of a result has a Lagrangian."""
    timed = result.get("with_time") or result
    return any(
        one.get("verdict") == "variational" and one.get("checked") == "valid"
        for one in (result, timed)
    )


def decimals(numbers: Sequence[Fraction]) -> frozenset[Fraction]:
    """Those, with the sizes of the negative ones, that are shown as decimal numbers."""
    found = {abs(one) for one in numbers}
    return frozenset(one for one in found if one.denominator > 1 and is_decimal(one))


def is_decimal(value: Fraction) -> bool:
    """Whether it has a finite decimal form of moderate length."""
    return bool(10**DIGITS % value.denominator == 0)


def number_text(value: Fraction) -> str:
    """A decimal number where it is one, else a fraction."""
    with printing.with_decimals(decimals([value])):
        return printing.to_text(ex.number(value))


def _equations(fitted: FittedSystem, coefficients: Sequence[Fraction]) -> dict[str, str]:
    member = fitted.member(tuple(coefficients))
    return {
        name: printing.to_text(f)
        for name, f in zip(member.coordinates, member.accelerations, strict=True)
    }


def _moved(fitted: FittedSystem, coefficients: Sequence[Fraction]) -> dict[str, schemas.Moved]:
    """The coefficients that differ, with their change in standard errors."""
    spread = fitted.metric.spread
    return {
        name: {
            "from": number_text(old),
            "to": number_text(new),
            "sigmas": float(new - old) / float(width),
        }
        for name, old, new, width in zip(
            fitted.names, fitted.values, coefficients, spread, strict=True
        )
        if new != old
    }


def with_moved(fitted: FittedSystem, moved: Mapping[str, Any]) -> tuple[Fraction, ...]:
    """The coefficients of a member by what moved; ValueError, KeyError for another form."""
    if unknown := [name for name in moved if name not in fitted.names]:
        raise KeyError(unknown[0])
    return tuple(
        Fraction(moved[name]["to"]) if name in moved else value
        for name, value in zip(fitted.names, fitted.values, strict=True)
    )


def _shown_equations(member: nearest_members.Member, fitted: FittedSystem) -> list[schemas.Formula]:
    rows = nearest_members.independent_rows(member.equations)
    letters = [ex.Symbol(name) for name in fitted.letters]
    pairs = list[tuple[ex.Expression, ex.Expression]]()
    for constant, *row in rows:
        lead = next(k for k, value in enumerate(row) if value)
        right = ex.add(
            ex.number(-constant),
            *(ex.number(-value) * letters[k] for k, value in enumerate(row) if value and k != lead),
        )
        pairs.append((letters[lead], collecting.collect(right)))
    for one in member.polynomials:
        terms = (
            ex.multiply(
                ex.number(factor),
                *(letters[k] ** power for k, power in enumerate(exponents) if power),
            )
            for exponents, factor in zip(one.exponents, one.factors, strict=True)
        )
        pairs.append((collecting.collect(ex.add(*terms)), ex.ZERO))
    return [
        schemas.Formula(
            text=_in_names(f"{printing.to_text(a)} = {printing.to_text(b)}", fitted, "text"),
            latex=_in_names(f"{printing.to_latex(a)} = {printing.to_latex(b)}", fitted, "latex"),
        )
        for a, b in pairs
    ]


def _in_names(text: str, fitted: FittedSystem, form: Literal["text", "latex"]) -> str:
    """The formula with the names of the coefficients in the place of our letters."""
    if fitted.names == fitted.letters:
        return text
    write = printing.to_latex if form == "latex" else printing.to_text
    table = {
        write(ex.Symbol(letter)): f"[{name}]"
        if form == "text"
        else rf"\left[\text{{{name}}}\right]"
        for letter, name in zip(fitted.letters, fitted.names, strict=True)
    }
    known = sorted(table, key=len, reverse=True)
    pattern = "|".join(rf"(?<![\w.]){re.escape(one)}(?![\w])" for one in known)
    return re.sub(pattern, lambda match: table[match[0]], text)


def _constraints(
    member: nearest_members.Member, fitted: FittedSystem
) -> schemas.LinearConditions | None:
    rows = nearest_members.independent_rows(_linear_rows(member))
    if not rows:
        return None
    return schemas.LinearConditions(
        coefficients=list(fitted.names),
        matrix=[[str(value) for value in row[1:]] for row in rows],
        values=[str(-row[0]) for row in rows],
    )


def _linear_rows(member: nearest_members.Member) -> Sequence[exact_members.Numbers]:
    if member.polynomials and all(one.degree <= 1 for one in member.polynomials):
        found = list[exact_members.Numbers]()
        for one in member.polynomials:
            row = [Fraction(0)] * (1 + len(member.coefficients))
            for exponents, factor in zip(one.exponents, one.factors, strict=True):
                row[1 + exponents.index(1) if any(exponents) else 0] += factor
            found.append(tuple(row))
        return found
    return member.equations


def _multiplier(member: nearest_members.Member, fitted: FittedSystem) -> list[list[str]] | None:
    """e^s G as text, as the results show multipliers."""
    if member.multiplier is None:
        return None
    names = [ex.TIME, *map(ex.Symbol, fitted.system.coordinates)]
    exponent = ex.add(
        *(ex.number(rate) * name for rate, name in zip(member.multiplier.rates, names, strict=True))
    )
    factor = ex.ONE if exponent == ex.ZERO else ex.Apply("exp", exponent)
    numbers = [*member.multiplier.rates, *(v for row in member.multiplier.matrix for v in row)]
    with printing.with_decimals(decimals(numbers)):
        return [
            [printing.to_text(ex.multiply(ex.number(value), factor)) for value in row]
            for row in member.multiplier.matrix
        ]
