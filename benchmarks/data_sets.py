"""From noisy trajectories to the nearest system with a Lagrangian: ten data sets through PySINDy,
end to end.

`python -m benchmarks.data_sets [--write]` prints a row for each: the table is simulated by SciPy,
noise is added, PySINDy differentiates and fits, and the nearest systems are asked for. `--write`
puts the table into docs/records/nearest.md.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from inverse_service import data

RECORD = Path(__file__).parents[1] / "docs" / "records" / "nearest.md"
START, END = "<!-- data sets -->\n", "<!-- end of data sets -->\n"
SAMPLES = 3_000
Force = Callable[[Any, Any, Any], Sequence[Any]]  # t, q, v


@dataclass(frozen=True, slots=True)
class DataSet:
    """A motion q'' = f(t, q, v) from one start, with the smallest kind of its L.

    `noise` is the standard deviation of each position in parts of the largest.
    """

    name: str
    kind: str
    force: Force
    positions: tuple[float, ...]
    velocities: tuple[float, ...]
    span: float
    degree: int = 1
    noise: float = 1e-3
    window: int = 31
    threshold: float = 0.05


SETS = (
    DataSet("spring", "natural", lambda t, q, v: (-2 * q[0],), (1,), (0,), 30),
    DataSet("damped spring", "damped", lambda t, q, v: (-2 * q[0] - 0.3 * v[0],), (1,), (0,), 15),
    DataSet("Duffing", "natural", lambda t, q, v: (-q[0] - q[0] ** 3,), (1.2,), (0,), 30, degree=3),
    DataSet("double spring", "equal_masses",
            lambda t, q, v: (-2 * q[0] + q[1], q[0] - 2 * q[1]), (1, 0.5), (0, 0), 30),
    DataSet("springs, masses 1:2", "natural",
            lambda t, q, v: (-2 * q[0] + q[1], 0.5 * q[0] - 1.5 * q[1]), (1, 0.2), (0, 0.5), 30),
    DataSet("charge in a field", "equal_masses",
            lambda t, q, v: (-q[0] + 0.7 * v[1], -q[1] - 0.7 * v[0]), (1, 0.3), (0, 0.5), 30),
    DataSet("damped springs", "damped",
            lambda t, q, v: (-2 * q[0] + q[1] - 0.2 * v[0], q[0] - 2.5 * q[1] - 0.2 * v[1]), (1, -0.5),
            (0, 0), 20),
    # z'' = -2 z - (0.2 + 0.7 i) z' with z = x + i y has L = Re e^((0.2 + 0.7 i) t) (z'^2/2 - z^2),
    # of no form by name.
    DataSet("damped charge", "leaf",
            lambda t, q, v: (-2 * q[0] + 0.7 * v[1] - 0.2 * v[0], -2 * q[1] - 0.7 * v[0] - 0.2 * v[1]),
            (1, 0.3), (0, 0.5), 20),
    DataSet("Henon and Heiles", "equal_masses",
            lambda t, q, v: (-q[0] - 2 * q[0] * q[1], -q[1] - q[0] ** 2 + q[1] ** 2), (0.3, 0.2),
            (0.1, 0.25), 60, degree=2),
    DataSet("chain of three", "equal_masses",
            lambda t, q, v: (-2 * q[0] + q[1], q[0] - 2 * q[1] + q[2], q[1] - 2 * q[2]), (1, 0.3, -0.4),
            (0, 0.5, 0), 40),
)  # fmt: skip


class Table(dict[str, Any]):
    """What a table of pandas offers to `from_table`."""

    columns = property(list)


def table_of(one: DataSet, seed: int) -> Table:
    """The noisy table of a data set."""
    n = len(one.positions)
    times = np.linspace(0, one.span, SAMPLES)

    def rate(t: float, y: Any) -> Any:
        return np.concatenate([y[n:], one.force(t, y[:n], y[n:])])

    found = solve_ivp(
        rate,
        (0, one.span),
        [*one.positions, *one.velocities],
        "DOP853",
        times,
        rtol=1e-11,
        atol=1e-12,
    )
    random = np.random.default_rng(seed)
    noisy = found.y[:n] + one.noise * np.abs(found.y[:n]).max() * random.normal(size=(n, SAMPLES))
    return Table(t=times, **dict(zip("xyz", noisy, strict=False)))


@dataclass(frozen=True, slots=True)
class Row:
    """What was found for a data set; `right` is the place of the true kind, 0 if it is not in the
    list.

    `seconds` of processor time.
    """

    name: str
    coefficients: int
    kind: str
    first: str
    right: int
    distance: float
    degrees: int
    noise: float
    seconds: float


def measured(one: DataSet, seed: int) -> Row:
    """The row of a data set."""
    table = table_of(one, seed)
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = data.from_table(
            table, degree=one.degree, window=one.window, threshold=one.threshold
        )
    found = data.nearest(model, time_limit=60.0).nearest
    seconds = time.process_time() - began
    kinds = [part["kind"] for part in found]
    first: Any = found[0] if found else {"kind": "none", "distance": np.inf, "degrees": 0}
    return Row(
        one.name, len(model.names), one.kind, first["kind"],
        1 + kinds.index(one.kind) if one.kind in kinds else 0,
        first["distance"], first["degrees"], one.noise, seconds,
    )  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    """The rows in Markdown."""
    head = (
        "| data set | noise | coefficients | kind | first found | place of the kind | errors / equations | s |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
    )
    return head + "".join(
        f"| {row.name} | {100 * row.noise:g} % | {row.coefficients} | {row.kind} | {row.first} | {row.right or 'none'} | "
        f"{row.distance:.2f} / {row.degrees} | {row.seconds:.1f} |\n"
        for row in rows
    )


def main() -> None:
    """Print the table, or write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    rows = list[Row]()
    options = parser.parse_args()
    for seed, one in enumerate(SETS):
        rows.append(measured(one, seed))
        print(table(rows[-1:]).splitlines()[-1], file=sys.stderr, flush=True)
    if not options.write:
        print(table(rows))
        return
    text = RECORD.read_text(encoding="utf-8")
    pattern = re.compile(f"{re.escape(START)}.*?{re.escape(END)}", re.DOTALL)
    RECORD.write_text(pattern.sub(lambda _: START + table(rows) + END, text), encoding="utf-8")


if __name__ == "__main__":
    main()
