"""What to try next where an answer stayed open, or where a Lagrangian exists and none was found in closed form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

TERMS = (
    "Offer terms that L may contain: \u201cChange the system\u201d, then \u201cTerms to try first in L\u201d under "
    "\u201cNames and questions\u201d, for example y'^2/x'."
)
ONE_QUESTION = "Ask one question instead of two: under \u201cNames and questions\u201d, L(q, q\u2032) alone."
# Of a time limit; what comes after the search takes the rest.
MUCH_OF = 0.8
LONG_RUN = "inverse-service solve --time-limit 3600 system.json"


@dataclass(frozen=True, slots=True)
class Advice:
    """A sentence, the code line that belongs to it, and a button that asks again where `longer` seconds are given."""

    text: str
    code: str = ""
    longer: float | None = None


def advice_for(result: Mapping[str, Any], largest: float) -> list[Advice]:
    """What may settle it; `largest` is the time limit of this service in s. Empty where nothing is open."""
    if result["verdict"] == "undetermined":
        return [*_about_time(result, largest), *_about_size(result)]
    if result["verdict"] == "variational" and result["lagrangian"] is None:
        return [Advice(TERMS), *_about_time(result, largest)]
    return []


def _about_time(result: Mapping[str, Any], largest: float) -> list[Advice]:
    limit = _limit_that_was_hit(result)
    if limit is None:
        return []
    if limit < MUCH_OF * largest:
        return [Advice(f"Ask again with more time: this answer had {limit:.2g} s, and they ran out.", longer=largest)]
    return [Advice("Time ran out. This service gives no more; a machine of your own can.", LONG_RUN)]


def _limit_that_was_hit(result: Mapping[str, Any]) -> float | None:
    """The seconds that the work had, where it used them up; None where it ended by itself."""
    provenance = result["provenance"]
    stopped = (provenance.get("options") or {}).get("time_limit")
    if isinstance(stopped, int | float):
        return stopped if "limit" in result["reason"] else None
    limit, used = provenance.get("time_limit"), (provenance.get("seconds") or {}).values()
    return limit if isinstance(limit, int | float) and sum(used) >= MUCH_OF * limit else None


def _about_size(result: Mapping[str, Any]) -> list[Advice]:
    system, found = result["system"] or {}, []
    if system.get("functions"):
        found.append(Advice("Put one function in the place of each arbitrary one."))
    if system.get("parameters"):
        found.append(Advice("Give values to parameters, such as k = 1/2: numbers are decided faster than letters."))
    if result["verdict_with_time"] is not None and result["question"] == "L(q, q')":
        found.append(Advice(ONE_QUESTION))
    return found or [Advice("Write the equations in other coordinates, or leave out what does not couple.")]
