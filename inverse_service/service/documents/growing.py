"""A result grows: each part is delivered when it is finished and checked, the most wanted first.

A `Growing` is informed which part of the work begins and which are finished. Out of it come stages
and parts, as {"parts": names, "value": fields of the result that are new, "seconds": by part}.
Merged in their order the values are a whole result document, whose `incomplete` lists what is still
to come; `cut_off` makes of it the result of a run that a limit, a crash or a cancellation ended.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from inverse_service import deadline
from inverse_service.service.documents import stated
from inverse_service.service.documents.older_keys import Told, result_of
from inverse_service.service.documents.stated import Stated
from inverse_service.statements import reasons
from inverse_service.statements.stages import OF_LAGRANGIANS, Part, Stage

Tell = Callable[[Any], None]
# The parts of a result in the order of wanting: its fields, where the first message brings all
# others; the stages whose time is its own, where one that is not named continues the part before;
# what more time would do; how a page names it.
PARTS: Final[dict[str, dict[str, Any]]] = json.loads(
    (Path(__file__).parent / "parts.json").read_text("utf-8")
)
FIELDS: Final[dict[str, list[str]]] = {part: row["fields"] for part, row in PARTS.items()}
_STAGES: Final = {stage: part for part, row in PARTS.items() for stage in row.get("stages", ())}
# What is finished sooner after a message waits for the next part to begin; a verdict, L, and H wait for
# a share of that after a first message, or where a long part begins: to make a result so far takes 4 to
# 8 ms, a fifth of a small answer; s of processor time, so that it costs a busy machine no larger share.
AT_ONCE, SHARE_OF_WANTED = 0.1, 0.3
# These may take seconds before anything of them is finished.
_LONG: Final = {Part.FIRST_INTEGRALS, Part.ANY_ASSOCIATED, Part.CLOCK, Part.FAMILY}
_MOST_WANTED: Final = OF_LAGRANGIANS | {Part.ANY_ASSOCIATED, Part.HAMILTONIAN}
_MORE_OF_OTHERS = "A longer time limit allows this."


class Growing:
    """One result while it is made. `tell` is called with what is new, `outward` puts it in the
    document's own words.
    """

    def __init__(
        self, tell: Tell | None, outward: Callable[[Told], dict[str, Any]] = result_of
    ) -> None:
        self._tell, self._outward = tell, outward
        self._since, self._told = time.monotonic(), deadline.now()
        self._waiting: Callable[[], Told | None] | None = None
        self._part, self._seconds = "understood", dict[str, float]()
        self._known: dict[str, Any] = {}
        self._untold: list[str] = []
        self.wanted: tuple[Part, ...] = ()
        self.finished: list[str] = []
        self.cut: dict[Part, reasons.Open] = {}

    def stage(self, stage: Stage) -> None:
        """A stage begins."""
        self.begin(_STAGES.get(stage.about) or _STAGES.get(stage.kind) or self._part)
        if self._tell is not None:
            self._tell(stage)

    def begin(self, part: str) -> None:
        """The time from now on is that of this part."""
        self._send_waiting(part)
        self._count_from_now(part)

    def _count_from_now(self, part: str) -> None:
        moment = time.monotonic()
        self._seconds[self._part] = self._seconds.get(self._part, 0.0) + moment - self._since
        self._part, self._since = part, moment

    def hand_over(self, parts: Sequence[str], make: Callable[[], Told | None]) -> None:
        """These parts are finished; `make` makes what is told so far, checked, which is asked for
        if somebody listens and the work takes longer. Where it makes nothing they wait for the next.
        """
        new = [part for part in parts if part not in self.finished]
        self.finished += new
        self._untold += new
        if self._tell is not None:
            self._waiting = make
            self._send_waiting()

    def _send_waiting(self, begun: str = "") -> None:
        share = SHARE_OF_WANTED if self._known or begun in _LONG else 1.0
        # All that is left is to check the whole, if the certificate begins.
        if begun == Part.CERTIFICATE or _MOST_WANTED.isdisjoint(self._untold):
            share = 1.0
        if self._waiting is None or deadline.now() - self._told < share * AT_ONCE:
            return
        make, self._waiting, part = self._waiting, None, self._part
        self._count_from_now("certificate")
        if (told := make()) is not None:
            self._send(told)
        self._count_from_now(part)
        self._told = deadline.now()

    def end(self, told: Told) -> Told:
        """All that is told: with the seconds of its parts, and those for which the time was
        over.
        """
        self._count_from_now(self._part)
        told = told.also(
            provenance=told.beside["provenance"] | {"seconds": self.seconds},
            incomplete=[entry(part, reason) for part, reason in self.cut.items()],
        )
        self._untold = [
            part for part in self.wanted if part not in (*self.cut, *self.finished)
        ] + self._untold
        if self._known:
            self._tell_new(self._outward(told))
        return told

    @property
    def seconds(self) -> dict[str, float]:
        """By part, up to the last change of part; together the time that was taken."""
        return {
            str(part): round(value, 4) for part, value in self._seconds.items() if value >= 5e-5
        }

    def _send(self, told: Told) -> None:
        missing = [
            part
            for part in self.wanted
            if part not in self.finished and not _is_ruled_out(part, told)
        ]
        incomplete = [entry(part, self.cut.get(part, reasons.TO_COME)) for part in missing]
        self._tell_new(self._outward(told.also(incomplete=incomplete)))

    def _tell_new(self, found: dict[str, Any]) -> None:
        new = {
            key: value
            for key, value in found.items()
            if key not in self._known or self._known[key] != value
        }
        self._known |= new
        names, self._untold = [*map(str, self._untold)], []
        if self._tell is not None and (names or new):
            self._tell({"parts": names, "value": new, "seconds": self.seconds})


def _is_ruled_out(part: str, told: Told) -> bool:
    """Whether a verdict says that there is no such part."""
    ruled: dict[str, Stated | None] = {
        Part.LAGRANGIAN: told.first,
        Part.HAMILTONIAN: told.first,
        Part.LAGRANGIAN_WITH_TIME: told.timed,
    }
    one = ruled.get(part)
    return one is not None and one.verdict == "not_variational"


def entry(part: str, reason: reasons.Open) -> dict[str, Any]:
    """The entry of `incomplete` for a part."""
    return {
        "part": str(part),
        "reason": reason.words,
        "reason_code": reason.reason.value,
        "more_time": PARTS.get(part, {}).get("more_time", _MORE_OF_OTHERS),
    }


def events(message: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A message as one {"part", "value"} for each part; together they have all that is new."""
    left, parts = (
        dict(message["value"]),
        [part for part in message["parts"] if part in FIELDS] or [Part.EXISTENCE],
    )
    found = [
        {"part": part, "value": {key: left.pop(key) for key in FIELDS[part] if key in left}}
        for part in parts
    ]
    found[-1]["value"] |= left
    return found


def at_once(result: Mapping[str, Any]) -> dict[str, Any]:
    """The message of a result that was finished before any part of it was told."""
    missing = {one["part"] for one in result.get("incomplete", ())}
    names = [
        part
        for part, fields in FIELDS.items()
        if part not in missing and any(map(result.get, fields))
    ]
    return {"parts": names, "value": result}


def grown(so_far: Mapping[str, Any], message: Mapping[str, Any]) -> dict[str, Any]:
    """{"so_far", "seconds"} of the messages up to this one; nothing before the first."""
    return {"so_far": so_far.get("so_far", {}) | message["value"], "seconds": message["seconds"]}


def cut_off(
    so_far: Mapping[str, Any], reason: reasons.Open, seconds: Mapping[str, float], wall: float
) -> dict[str, Any]:
    """The result of a run that was ended, with all that was finished; what was to come is named
    with the reason.
    """
    fields = {"reason": reason.words, "reason_code": reason.reason.value}
    left = [one | fields for one in so_far["incomplete"]]
    names = [one["part"] for one in left]
    taken = dict(seconds)
    if names:
        taken[names[0]] = round(taken.get(names[0], 0.0) + max(0.0, wall - sum(taken.values())), 4)
    found = dict(so_far) | {
        "incomplete": left,
        "provenance": so_far["provenance"] | {"seconds": taken},
    }
    fields["reason"] = f"{reason.words[:-1]} before a verdict could be proved."
    if found["verdict"] == "undetermined" and Part.EXISTENCE in names:
        found |= fields
    return stated.with_answers({key: _with_reason(value, fields) for key, value in found.items()})


def _with_reason(value: Any, fields: Mapping[str, str]) -> Any:
    """The same with this reason for each verdict that was still to come."""
    if isinstance(value, list):
        return [_with_reason(one, fields) for one in value]
    if not isinstance(value, dict):
        return value
    found = {key: _with_reason(one, fields) for key, one in value.items()}
    return {**found, **fields} if found.get("reason_code") == reasons.Reason.NOT_YET else found


def asks_motion_alone(document: Any) -> bool:
    """Whether a document asks about the motion on constraints and about no associated system."""
    return isinstance(document, dict) and (
        "motion" in document or document.get("associated") == "any"
    )


def motions_of(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The answers about a motion on constraints, one for each branch; none for another document."""
    parts = [one.get("any_associated") for one in result.get("branches") or ()]
    return [one for one in (parts if any(parts) else [result.get("any_associated")]) if one]
