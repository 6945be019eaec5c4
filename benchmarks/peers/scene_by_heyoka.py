"""One scene (standard input) by heyoka: its Taylor method with the equations that it derives from
the Lagrangian.
"""

import json
import sys
import time
from typing import Any

import heyoka

from inverse_service.expressions import refusals, tree as ex
from inverse_service.reading import names as nm, reader


def translated(tree: ex.Expression, table: dict[ex.Expression, Any]) -> Any:
    """The tree in heyoka's expressions."""
    if tree in table:
        return table[tree]
    match tree:
        case ex.Number(value):
            return heyoka.expression(float(value))
        case ex.Sum(terms):
            return heyoka.sum([translated(term, table) for term in terms])
        case ex.Product(factors):
            return heyoka.prod([translated(factor, table) for factor in factors])
        case ex.Power(base, ex.Number(value)):
            return translated(base, table) ** float(value)
        case ex.Apply(name, argument):
            return getattr(heyoka, name)(translated(argument, table))
    raise ValueError(tree)


if __name__ == "__main__":
    document = json.load(sys.stdin)
    names, start = document["system"]["coordinates"], document["initial"]
    spelled = nm.Names(tuple(names), tuple(document["parameters"]))
    with refusals.longer_texts(10):
        lagrangian = reader.read_formula(document["system"]["lagrangian"], spelled)
    q, v = (heyoka.make_vars(*(f"{letter}{k}" for k in range(len(names)))) for letter in "qv")
    q, v = ([one] if len(names) == 1 else list(one) for one in (q, v))
    table: dict[ex.Expression, Any] = dict(zip(map(ex.Symbol, names), q, strict=True))
    table |= zip(map(ex.Velocity, names), v, strict=True)
    table |= {
        ex.Symbol(key): heyoka.expression(float(value))
        for key, value in document["parameters"].items()
    }
    equations = heyoka.lagrangian(translated(lagrangian, table), q, v)
    begin = [float(start[part][name]) for part in ("positions", "velocities") for name in names]
    system = heyoka.taylor_adaptive(equations, begin, compact_mode=True)
    begun = time.process_time()
    system.propagate_until(float(document["time"]))
    run, end = time.process_time() - begun, system.state[: len(names)].tolist()
    print(json.dumps({"seconds": time.process_time(), "run": run, "end": end}))
