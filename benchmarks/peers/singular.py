"""Singular's slimgb of the Helmholtz system as a left module over the Weyl algebra.

The order of derivation comes first in the ordering, so the elements of order zero in the basis
generate all consequences on the values of g; a random point shows whether they leave a nonsingular
matrix.

    apt-get install singular-ui
    python -m benchmarks.peers.singular < system.json
"""

from __future__ import annotations

import itertools
import json
import random
import re
import shutil
import subprocess
import sys
from fractions import Fraction
from typing import Any

import sympy

from benchmarks.decision_benchmark import read
from benchmarks.peers.helmholtz import UNDERIVED, LinearSystem, linear_system

# Milliseconds between two readings of its clock.
TICK = 10
_SCRIPT = """
LIB "nctools.lib";
ring r = 0,({variables},{derivations}),(a({weights}),dp,C);
def W = Weyl(); setring W;
module M = {rows};
system("--ticks-per-sec", 1000);
module G;
int runs, spent, k;
int began = timer;
while (spent < 300 and runs < 2000) {{ G = slimgb(M); runs++; spent = timer - began; }}
print("MILLISECONDS=" + string(spent) + "/" + string(runs));
for (k = 1; k <= ncols(G); k++) {{ print("ROW=" + string(G[k])); }}
exit;
"""


def measured(document: dict[str, Any]) -> dict[str, Any]:
    """Verdict and seconds of slimgb alone, the mean of enough runs: its clock ticks in 10 ms.

    {"missing": True} if Singular is not installed, {"stopped": True} past the limit.
    """
    if shutil.which("Singular") is None:
        return {"missing": True}
    problem = linear_system(read(document))
    done = subprocess.run(
        ["Singular", "-q", "--no-rc"], input=_script(problem), capture_output=True, text=True
    )
    if done.returncode < 0:  # stopped by the limit on processor time
        return {"stopped": True}
    spent = re.search(r"MILLISECONDS=(\d+)/(\d+)", done.stdout)
    if spent is None:
        raise RuntimeError(f"Singular said {done.stdout[-500:]}")
    rows = re.findall(r"ROW=(.*)", done.stdout)
    return {
        "verdict": _verdict(problem, rows),
        "seconds": max(int(spent[1]), TICK) / 1000 / int(spent[2]),
    }


def _pairs(problem: LinearSystem) -> list[tuple[int, int]]:
    return list(itertools.combinations_with_replacement(range(problem.size), 2))


def _script(problem: LinearSystem) -> str:
    column = {pair: k + 1 for k, pair in enumerate(_pairs(problem))}
    count = len(problem.variables)
    rows = []
    for equation in problem.equations:
        parts = []
        for (i, j, axis), coefficient in equation.items():
            derivation = "" if axis == UNDERIVED else f"*d{axis + 1}"
            parts.append(f"({str(coefficient).replace('**', '^')}){derivation}*gen({column[i, j]})")
        rows.append("+".join(parts))
    return _SCRIPT.format(
        variables=",".join(map(str, problem.variables)),
        derivations=",".join(f"d{k + 1}" for k in range(count)),
        weights=",".join(["0"] * count + ["1"] * count),
        rows=",\n".join(rows),
    )


def _verdict(problem: LinearSystem, rows: list[str]) -> str:
    """Whether the rows without derivations leave a nonsingular matrix at a random rational
    point.
    """
    source = random.Random("point")
    point = {
        name: Fraction(source.randint(2, 99), source.randint(2, 99)) for name in problem.variables
    }
    values = {
        name: sympy.Rational(value.numerator, value.denominator) for name, value in point.items()
    }
    pairs = _pairs(problem)
    matrix = [_row(row, len(pairs), values) for row in rows if not re.search(r"d\d", row)]
    basis = sympy.Matrix(matrix).nullspace() if matrix else sympy.eye(len(pairs)).columnspace()
    total = sum((source.randint(1, 10**6) * vector for vector in basis), sympy.zeros(len(pairs), 1))
    entry = dict(zip(pairs, total, strict=True))
    size = range(problem.size)
    g = sympy.Matrix([[entry[min(i, j), max(i, j)] for j in size] for i in size])
    return "variational" if g.det() != 0 else "not_variational"


def _row(text: str, width: int, values: dict[Any, Any]) -> list[Any]:
    """Singular's "x1*gen(2)-gen(1)" at the point; the output is Singular's own, made of our
    symbols.
    """
    row = [sympy.Integer(0)] * width
    for sign, term in re.findall(r"([+-]?)([^+-]+)", text):
        column, value = 0, sympy.Integer(-1 if sign == "-" else 1)
        for factor in term.split("*"):
            generator = re.fullmatch(r"gen\((\d+)\)", factor.strip())
            if generator:
                column = int(generator[1]) - 1
                continue
            base, _, exponent = factor.strip().partition("^")
            known = {str(name): number for name, number in values.items()}
            value *= (known[base] if base in known else sympy.Rational(base)) ** int(exponent or 1)
        row[column] += value
    return row


if __name__ == "__main__":
    print(json.dumps(measured(json.load(sys.stdin))))
