"""Models that were fitted to data: from PySINDy, from tables of q(t), and from expressions of SymPy
such as those of PySR; and back, as constraints of PySINDy's optimizers.

>>> import sympy
>>> x, v = sympy.symbols("x v")
>>> model = from_expressions({x: -1.02 * x + 0.01 * v}, {x: v})
>>> nearest(model, errors=0.02).nearest[0]["kind"]
'natural'

Only `from_table` and `from_sindy` need PySINDy, the extra `data`. Its own methods differentiate and
fit.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import inverse_service
from inverse_service import errors

if TYPE_CHECKING:
    from inverse_service.sympy.objects import Result

Floats = NDArray[np.float64]
SLACK = 0.1  # by which the coefficients of q' = v may be off
WINDOW = 11  # points of the smoothing filter, an odd number
UNEVEN = 0.25  # by which the longest time step may exceed the shortest: times are rounded, too
MODELS = 20  # of an ensemble, whose spread are the errors
MOST_ROWS, MOST_COORDINATES, LONGEST_NAME = 20_000, 6, 24  # of a table as CSV
_GAP = re.compile(r"(?<=[\w)'])\s+(?=[\w(])")
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


class Table(dict[str, Floats]):
    """Columns of equal length by their names, the time first: what `from_table` takes of a table."""

    @property
    def columns(self) -> list[str]:
        """The names."""
        return list(self)


def read_table(text: bytes) -> Table:
    """The table of a CSV file: the time `t` in the first column, each other one a coordinate.

    The first line may have their names; without it they are t, x, y, z, or t, x1, x2, and so on.
    Values are separated by commas, semicolons or tabs. Raises InputError for what is no such table.
    """
    try:
        lines = text.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise errors.InputError("The file is not text: send a CSV file of numbers.") from None
    lines = [line for line in lines if line.strip()]
    if any("\0" in line for line in lines):
        raise errors.InputError("The file is not text: send a CSV file of numbers.")
    if len(lines) < 2:
        raise errors.InputError("The table is empty: each line is a time and the coordinates then.")
    if len(lines) > MOST_ROWS + 1:
        raise errors.InputError(f"The table has more than {MOST_ROWS:,} rows: send every tenth.")
    sign = max("\t;,", key=lines[0].count)
    try:
        rows = list(csv.reader(io.StringIO("\n".join(lines)), delimiter=sign))
    except csv.Error as error:
        raise errors.InputError(f"The table cannot be read as CSV: {error}.") from None
    width = len(rows[0])
    if not 1 < width <= MOST_COORDINATES + 1:
        raise errors.InputError(
            f"The first line has {width} value{'s' * (width != 1)}: a table has the time and 1 to "
            f"{MOST_COORDINATES} coordinates, separated by commas, semicolons, or tabs."
        )
    names = _column_names(rows[0])
    body = rows[names is not None :]
    for number, row in enumerate(body, 1 + (names is not None)):
        if len(row) != width:
            raise errors.InputError(
                f"Line {number} has {len(row)} value{'s' * (len(row) != 1)}, the first line {width}."
            )
    if names is None:
        letters = "xyz" if width <= 4 else [f"x{k}" for k in range(1, width)]
        names = ["t", *letters[: width - 1]]
    values = np.array(
        [
            [_value(one, number, name) for one, name in zip(row, names, strict=True)]
            for number, row in enumerate(body, 1 + len(rows) - len(body))
        ]
    )
    late = np.flatnonzero(np.diff(values[:, 0]) <= 0)
    if len(late):
        raise errors.InputError(
            f"The time does not grow from line {late[0] + 1 + len(rows) - len(body)} to the next: sort the rows by it."
        )
    return Table({name: values[:, k] for k, name in enumerate(names)})


def _column_names(row: Sequence[str]) -> list[str] | None:
    """The names in the first line; None where it has numbers."""
    if _is_number(row[0]):
        return None
    names = [one.strip() for one in row]
    for name in names:
        if not _NAME.fullmatch(name) or len(name) > LONGEST_NAME:
            raise errors.InputError(
                f"`{name[:LONGEST_NAME]}` is not a name of a column: use letters and digits, such as x or theta1."
            )
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise errors.InputError(f"Two columns are called `{twice}`: rename one.")
    return names


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return text.strip().lower() in ("nan", "")


def _value(text: str, line: int, name: str) -> float:
    """A finite number of a table."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        shown = text.strip()[:LONGEST_NAME]
        raise errors.InputError(
            f"Line {line}, column {name}: `{shown}` is not a number; leave out rows that are not complete."
        )
    return value


@dataclass(frozen=True, slots=True)
class FittedModel:
    """A second-order system with fitted numbers, as a document, and what its library was.

    `terms` are the features of the library as texts in coordinates and velocities (x'), in the
    order of its columns; `coefficients` (n, features) those of the accelerations. `covariance`
    belongs to the coefficients `names`, None where it is not known. `states` are the places
    (coordinate, velocity) of the equations of a model of first order, () if the model is none.
    """

    document: Mapping[str, Any]
    coordinates: tuple[str, ...]
    terms: tuple[str, ...] = ()
    coefficients: Floats | None = None
    names: tuple[str, ...] = ()
    covariance: Floats | None = None
    states: tuple[tuple[int, int], ...] = ()
    model: Any = None


def nearest(model: FittedModel, **keys: Any) -> Result:
    """The systems with a Lagrangian that are nearest to a fitted model, in its covariance if it has
    one.

    `keys` are those of `inverse_service.nearest`. Raises InputError.
    """
    own = {"errors", "weights", "covariance"} & keys.keys()
    return inverse_service.nearest(model.document, **({} if own else metric_of(model)), **keys)


def metric_of(model: FittedModel) -> dict[str, Any]:
    """The keys `covariance` and `coefficients` of a question for the nearest system; {} where no covariance is known."""
    if model.covariance is None:
        return {}
    rows = [[repr(float(value)) for value in row] for row in model.covariance]
    return {"covariance": rows, "coefficients": list(model.names)}


def from_expressions(
    accelerations: Mapping[Any, Any], velocities: Mapping[Any, Any], **keys: Any
) -> FittedModel:
    """The model q'' = f of SymPy expressions for each coordinate; `velocities` are their symbols.

    PySR: `from_expressions({x: regressor.sympy()}, {x: v})`. `keys` are keys of a document. Raises
    InputError.
    """
    import sympy

    table = {sympy.sympify(q): sympy.sympify(v) for q, v in velocities.items()}
    names = {sympy.sympify(q): sympy.sympify(f) for q, f in accelerations.items()}
    for q in names:
        if q not in table:
            raise errors.InputError(
                f"Say which symbol is the velocity of {q}: velocities={{{q}: ...}}."
            )
    shown = {v: sympy.Symbol(f"{q}'") for q, v in table.items()}
    known = {*names, *table.values(), sympy.Symbol("t")}
    for f in names.values():
        if unknown := sorted(map(str, f.free_symbols - known)):
            raise errors.InputError(
                f"`{unknown[0]}` is neither a coordinate nor a velocity: put its fitted number in."
            )
    equations = {str(q): _text(f.xreplace(shown)) for q, f in names.items()}
    document = {"coordinates": list(equations), "parameters": [], "equations": equations, **keys}
    return FittedModel(document, tuple(equations))


def _text(expression: Any) -> str:
    """An expression in the notation of documents, numbers in their shortest decimal form."""
    import sympy

    exact = expression.xreplace(
        {one: sympy.Rational(repr(float(one))) for one in expression.atoms(sympy.Float)}
    )
    return str(exact).replace("**", "^")


def from_sindy(
    model: Any,
    velocities: Mapping[str, str] | None = None,
    covariance: Any = None,
    coordinates: Mapping[str, str] | None = None,
) -> FittedModel:
    """The second-order model of a fitted `pysindy.SINDy` with the state (q, v).

    Which states are velocities is seen from equations q' = v, or said: velocities={"x": "vx"}.
    `coordinates` renames states. If the optimizer is PySINDy's `EnsembleOptimizer`, the covariance
    is that of its models; `covariance` (of the coefficients of the accelerations that are not 0,
    equation by equation) goes before it. Raises InputError where the model is of another form.
    """
    if not hasattr(model, "get_feature_names"):
        raise errors.InputError("This is no model of PySINDy: give a `pysindy.SINDy` after `fit`.")
    if not hasattr(model, "feature_names"):
        raise errors.InputError("The model is not fitted: call its `fit` first.")
    rows = np.asarray(model.coefficients(), dtype=float)
    states = [str(name) for name in model.feature_names]
    features = [str(name) for name in model.get_feature_names()]
    if not np.all(np.isfinite(rows)):
        raise errors.InputError("The fit ended without finite coefficients: scale the columns.")
    if len(rows) != len(states):
        raise errors.InputError("A model with control inputs is not a system q'' = f(t, q, q').")
    pairs = _pairs(rows, states, features, velocities)
    renamed = coordinates or {}
    named = {q: renamed.get(q, q) for q, _ in pairs}
    own = {q: named[q] for q, _ in pairs} | {v: f"{named[q]}'" for q, v in pairs}
    terms = tuple(_term(feature, own) for feature in features)
    places = tuple((states.index(q), states.index(v)) for q, v in pairs)
    forces = rows[[v for _, v in places]]
    equations = {
        named[q]: " + ".join(
            f"({_decimal(value)})*({term})" for value, term in zip(row, terms, strict=True) if value
        )
        or "0"
        for (q, _), row in zip(pairs, forces, strict=True)
    }
    document = {"coordinates": list(equations), "parameters": [], "equations": equations}
    names = _names(equations, terms, forces)
    known = _covariance(model, places, forces) if covariance is None else np.asarray(covariance)
    return FittedModel(document, tuple(equations), terms, forces, names, known, places, model)


def _decimal(value: float) -> str:
    """The number in six digits, which its error does not reach, with no exponent."""
    return f"{Decimal(f'{value:.6g}'):f}"


def _pairs(
    rows: Floats,
    states: Sequence[str],
    features: Sequence[str],
    velocities: Mapping[str, str] | None,
) -> list[tuple[str, str]]:
    """(q, v) for each coordinate: q' = v is its equation."""
    if velocities is not None:
        for name in [*velocities, *velocities.values()]:
            if name not in states:
                raise errors.InputError(
                    f"`{name}` is not a state of the model: {', '.join(states)}."
                )
        found = list(velocities.items())
    else:
        found = list[tuple[str, str]]()
        for state, row in zip(states, rows, strict=True):
            large = [k for k, value in enumerate(row) if abs(value) > SLACK]
            if len(large) == 1 and abs(row[large[0]] - 1) <= SLACK:
                name = features[large[0]]
                if name in states and name != state:
                    found.append((state, name))
        taken = {q for q, _ in found}
        found = [(q, v) for q, v in found if v not in taken]
    if not found or {*states} != {name for pair in found for name in pair}:
        shown = ", ".join(f"{q}' = {v}" for q, v in found) or "none"
        raise errors.InputError(
            f"The states {', '.join(states)} are not coordinates and velocities with q' = v (found: {shown}): fit the "
            'state (q, v), or say velocities={"x": "vx"}.'
        )
    return found


def _term(feature: str, own: Mapping[str, str]) -> str:
    """A feature of a library in the notation of documents: "x0 x1^2" is x*y^2, "sin(1 x)" sin(x)."""
    text = _GAP.sub("*", feature.strip())
    names = "|".join(map(re.escape, sorted(own, key=len, reverse=True)))
    return re.sub(rf"(?<!\w)(?:{names})(?!\w)", lambda match: own[match[0]], text)


def _names(equations: Mapping[str, str], terms: Sequence[str], forces: Floats) -> tuple[str, ...]:
    """The coefficients that are not 0, called as results call them."""
    from inverse_service.service.documents import documents

    shown = list[str]()
    for term in terms:
        document = {
            "coordinates": list(equations),
            "parameters": [],
            "equations": dict.fromkeys(equations, term),
        }
        parsed = documents.parse_document(document)["equations"]
        shown.append(parsed[next(iter(equations))]["text"])
    return tuple(
        f"{name}'': {text}"
        for name, row in zip(equations, forces, strict=True)
        for text, value in zip(shown, row, strict=True)
        if value
    )


def _covariance(model: Any, places: Sequence[tuple[int, int]], forces: Floats) -> Floats | None:
    """The covariance over the models of an ensemble, None for other optimizers.

    Where there are fewer models than coefficients it is singular; then only its diagonal is taken.
    """
    inner = getattr(model, "optimizer", None)
    each = getattr(inner, "coef_list", None)
    if each is None:
        each = getattr(getattr(inner, "optimizer", None), "coef_list", None)
    if not each:
        return None
    drawn = np.array([np.asarray(one, dtype=float)[[v for _, v in places]] for one in each])
    chosen = drawn[:, forces != 0]
    found = np.atleast_2d(np.cov(chosen.T))
    sizes = np.diag(found).copy()
    least = (1e-6 * np.abs(forces[forces != 0])) ** 2
    if len(each) <= 2 * found.shape[0]:
        return np.diag(np.maximum(sizes, least))
    return found + np.diag(np.maximum(least - sizes, 0) + 1e-9 * np.maximum(sizes, least))


def from_table(
    table: Any,
    time: str = "t",
    coordinates: Sequence[str] = (),
    *,
    degree: int = 1,
    library: Any = None,
    threshold: float = 0.05,
    window: int = WINDOW,
    optimizer: Any = None,
    seed: int = 1,
) -> FittedModel:
    """Fit q'' = f to a table of q(t), a pandas DataFrame or an xarray Dataset, by PySINDy.

    The velocities are PySINDy's `SmoothedFiniteDifference` of the columns, and so are the
    derivatives of the state (q, v). Without an `optimizer`, it is an ensemble of `STLSQ(threshold)`
    over random parts of the data; `library` is PySINDy's `PolynomialLibrary(degree)` if none is
    given. Raises InputError, MissingExtra without PySINDy.
    """
    frame = table.to_dataframe().reset_index() if hasattr(table, "to_dataframe") else table
    if not hasattr(frame, "columns"):
        raise errors.InputError(
            "The table is to be a DataFrame of pandas or a Dataset of xarray, with a column for the time: "
            'pandas.DataFrame({"t": t, "x": x}).'
        )
    columns = [str(name) for name in frame.columns]
    if time not in columns:
        raise errors.InputError(
            f"The table has no column `{time}` for the time: {', '.join(columns)}."
        )
    names = list(coordinates) or [name for name in columns if name != time]
    for name in names:
        if name not in columns:
            raise errors.InputError(f"The table has no column `{name}`: {', '.join(columns)}.")
    times, *rows = (_numbers(frame[name], name) for name in (time, *names))
    if len(times) < 4 * window:
        raise errors.InputError(
            f"The table has {len(times)} rows, and {4 * window} at least are fitted with a window of {window}."
        )
    _with_even_steps(times, time)
    positions = np.column_stack(rows)
    sindy = _pysindy()
    smooth = sindy.SmoothedFiniteDifference(smoother_kws={"window_length": window, "polyorder": 3})
    velocities = np.asarray(smooth(positions, times))
    positions = np.asarray(smooth.smoothed_x_)
    inside = slice(window, -window)  # the filter knows less at the ends
    state = np.hstack([positions, velocities])
    rates = np.hstack([velocities, np.asarray(smooth(velocities, times))])
    if optimizer is None:
        optimizer = sindy.EnsembleOptimizer(
            sindy.STLSQ(threshold=threshold), bagging=True, n_models=MODELS
        )
    if library is None:
        library = sindy.PolynomialLibrary(degree=degree)
    model = sindy.SINDy(optimizer=optimizer, feature_library=library)
    before = np.random.get_state()
    np.random.seed(seed)  # PySINDy draws the parts of its ensembles from NumPy's global generator
    try:
        states = [*names, *(f"v_{name}" for name in names)]
        model.fit(state[inside], t=times[inside], x_dot=rates[inside], feature_names=states)
    except (ValueError, np.linalg.LinAlgError) as problem:
        raise errors.InputError(f"PySINDy could not fit this table: {problem}.") from None
    finally:
        np.random.set_state(before)
    return from_sindy(model, {name: f"v_{name}" for name in names})


def _numbers(column: Any, name: str) -> Floats:
    """A column as finite numbers; InputError says where it has another value."""
    values = np.asarray(column)
    if values.dtype.kind in "mM":
        raise errors.InputError(f"The column `{name}` has dates: give it in seconds.")
    try:
        found = values.astype(float)
    except (TypeError, ValueError):
        raise errors.InputError(f"The column `{name}` has values that are not numbers.") from None
    if len(gaps := np.flatnonzero(~np.isfinite(found))):
        raise errors.InputError(
            f"The column `{name}` has no finite number in row {gaps[0]}: leave out rows that are not complete, or "
            "interpolate."
        )
    return found


def _with_even_steps(times: Floats, name: str) -> None:
    """InputError where the times are not in order, or not evenly spaced, which the smoothing filter supposes."""
    steps = np.diff(times)
    if not np.all(steps > 0):
        place = int(np.flatnonzero(steps <= 0)[0])
        raise errors.InputError(
            f"The time `{name}` does not grow from row {place} to the next: sort the rows by it."
        )
    if steps.max() > (1 + UNEVEN) * steps.min():
        raise errors.InputError(
            f"The steps of `{name}` are from {steps.min():.3g} to {steps.max():.3g}, and PySINDy's smoothing filter needs "
            "equal ones: interpolate the columns."
        )


def constraints(model: FittedModel, member: Mapping[str, Any]) -> tuple[Floats, Floats]:
    """(C, d) of C w = d for PySINDy's `ConstrainedSR3(constraint_lhs=C, constraint_rhs=d)`.

    `w` are the coefficients of all equations of the model, equation by equation. The conditions are
    q' = v, those of a member of `nearest`, and that terms stay 0 which the member does not have; so
    what is fitted has a Lagrangian.
    """
    part = member["constraints"]
    if not model.states:
        raise errors.InputError("Constraints are for a model of PySINDy.")
    width = len(model.terms)
    total = width * 2 * len(model.states)
    rows, values = list[Floats](), list[float]()

    def add(place: int, feature: int, value: float) -> None:
        row = np.zeros(total)
        row[place * width + feature] = 1.0
        rows.append(row)
        values.append(value)

    assert model.coefficients is not None
    for (q, v), name, force in zip(
        model.states, model.coordinates, model.coefficients, strict=True
    ):
        for feature, term in enumerate(model.terms):
            add(q, feature, float(term == f"{name}'"))
            if not force[feature]:
                add(v, feature, 0.0)
    columns = _columns(model)
    for line, value in zip(
        () if part is None else part["matrix"], () if part is None else part["values"], strict=True
    ):
        row = np.zeros(total)
        for name, number in zip(part["coefficients"], line, strict=True):
            row[columns[name]] += float(Fraction(number))
        rows.append(row)
        values.append(float(Fraction(value)))
    return np.array(rows), np.array(values)


def _columns(model: FittedModel) -> dict[str, int]:
    """The place of each coefficient of the accelerations in the vector of all."""
    assert model.coefficients is not None
    places = [
        v * len(model.terms) + feature
        for (_, v), force in zip(model.states, model.coefficients, strict=True)
        for feature, value in enumerate(force)
        if value
    ]
    return dict(zip(model.names, places, strict=True))


def _pysindy() -> Any:
    """PySINDy; MissingExtra says how to install it."""
    try:
        import pysindy
    except ImportError as error:
        raise errors.missing_extra(error) or error from None
    return pysindy
