"""A program for JAX and diffrax: the motion as a vector field f(t, y, args); L, H, momenta of the same arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy.printing.numpy import JaxPrinter

from inverse_service.sympy import code

if TYPE_CHECKING:
    from inverse_service.sympy.result_objects import Answer

HEAD = """import jax
import jax.numpy as jnp

jax.config.update("jax_enable_x64", True)
"""
# y = (q, v), or (q, p) for H over the momenta; args are the parameters.
FUNCTION = "def {name}(t, y, args):\n{unpacked}    return {value}"


def written(answer: Answer) -> str:
    """With `diffrax.ODETerm(vector_field)` the motion of y = (q, v); args are the parameters in their order."""
    parts = [_function(answer, "vector_field", _field(answer))]
    for what in ("lagrangian", "momenta", "hamiltonian"):
        quantity = code.quantity_of(answer, what)
        if quantity is not None:
            lines = [f"# {what}: where {one}" for one in code.conditions_of(answer, what)]
            parts.append("\n".join([*lines, _function(answer, what, quantity)]))
    return HEAD + "\n\n" + "\n\n\n".join(parts) + "\n"


def _field(answer: Answer) -> list[Any]:
    table = answer._table
    return [*(table.velocity(name) for name in table.coordinates), *answer.accelerations]


def _function(answer: Answer, name: str, value: Any) -> str:
    what = "accelerations" if name == "vector_field" else name
    given = code.arguments_of(answer, what)
    plain = code.plain_symbols(given, answer, code.LANGUAGES["python"])
    values = list(value) if isinstance(value, list) else [value]
    shown = [code.with_plain(each, plain) for each in values]
    code.refuse_functions(shown, answer)
    texts = [str(JaxPrinter().doprint(each)).replace("jax.numpy.", "jnp.") for each in shown]
    size = 2 * len(answer._table.coordinates)
    names = [str(plain[each]) for each in given[1:]]
    state, parameters = names[:size], names[size:]
    unpacked = f"    {', '.join(state)} = y\n" + (f"    ({', '.join(parameters)},) = args\n" if parameters else "")
    whole = f"jnp.array([{', '.join(texts)}])" if isinstance(value, list) else texts[0]
    return FUNCTION.format(name=name, unpacked=unpacked, value=whole)
