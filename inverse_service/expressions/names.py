"""The names that a formula may use, and which names can be declared at all."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from inverse_service.errors import InputError, LimitError
from inverse_service.expressions.characters import LETTER_COMMANDS, letter
from inverse_service.expressions.limits import LIMITS
from inverse_service.expressions.tokens import joined, refusal, shorten
from inverse_service.expressions.vocabulary import FUNCTIONS, RESERVED, reason_against

Role = Literal["coordinate", "parameter", "function"]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
_LATEX_NAME = re.compile(r"\\?([A-Za-z]+[0-9]*)(?:_\{?\\?([A-Za-z0-9]+)\}?)?")
# Endings that stand for time derivatives, longer ones first.
DOTTED = (
    ("_dot_dot", 2), ("_dotdot", 2), ("_ddot", 2), ("dotdot", 2), ("_dot", 1), ("ddot", 2), ("dot", 1),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Names:
    """Declared names; `functions` maps each arbitrary function to the names that it depends on.

    `time` says whether `t` may occur. `pi` is always there, `e` and `E` mean exp(1) unless declared.
    """

    coordinates: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    functions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    time: bool = True

    def role(self, name: str) -> Role | None:
        """What the name was declared as, None if it was not."""
        if name in self.coordinates:
            return "coordinate"
        if name in self.parameters:
            return "parameter"
        return "function" if name in self.functions else None

    def declared(self) -> tuple[str, ...]:
        return (*self.coordinates, *self.parameters, *self.functions)

    def spelling(self, name: str) -> str:
        """The declared name meant: `r_1` is r1, and phi is varphi, where only the other one is declared."""
        if self.role(name):
            return name
        plain = _plain(name)
        alike = [known for known in self.declared() if _plain(known) == plain]
        return alike[0] if len(alike) == 1 else name

    def derivative(self, name: str) -> tuple[str, int] | None:
        """(coordinate, order) for x_dot, xdot, x_ddot, x_dot_dot that are not declared themselves, else None."""
        for ending, order in DOTTED:
            stem = self.spelling(name[: -len(ending)]) if name.endswith(ending) else ""
            if stem in self.coordinates:
                return stem, order
        return None


def _plain(name: str) -> str:
    """The name without underscores, and as the command of this name is read."""
    return "".join(LETTER_COMMANDS.get(word, word) for word in name.split("_"))


def unknown_name(name: str, names: Names, column: int, follows: str = "") -> InputError:
    """The refusal of an undeclared name: how to declare it, what may have been meant.

    `follows` is the text of the token after it: "(" after a function, a prime after a coordinate.
    """
    known = reason_against(name, column)
    if known is not None:
        return known
    shown = f"the name '{shorten(name)}' is not declared; it stands"
    if name == "d":
        return refusal(shown, column, "write x' and x'' for dx/dt and d^2x/dt^2, diff(u, t) for other derivatives")
    if follows[:1] == "'":
        return refusal(shown, column, f"add its equation too; the coordinates are {joined(names.coordinates)}")
    if follows == "(":
        close = difflib.get_close_matches(name, sorted(FUNCTIONS | set(names.functions)), 1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        return refusal(
            shown,
            column,
            f'declare it in "functions" with its arguments, use a known function{hint}, or write * before the bracket',
        )
    hint = _meant(name, names)
    if hint:
        return refusal(shown, column, f'did you mean {hint}? else add it to "parameters"')
    return refusal(shown, column, f'add it to "parameters"; the coordinates are {joined(names.coordinates)}')


def _meant(name: str, names: Names) -> str:
    close = difflib.get_close_matches(name, [*names.declared(), *FUNCTIONS], 1, 0.7)
    parts = _product(name, names)
    return "*".join(parts) if parts else close[0] if close else ""


def _product(name: str, names: Names) -> list[str]:
    """The name cut into declared names (xy into x, y), longest first; empty if it cannot be cut so."""
    parts: list[str] = []
    known = sorted((*names.declared(), "t", "pi"), key=len, reverse=True)
    while name and len(parts) < 8:
        part = next((word for word in known if name.startswith(word)), None)
        if part is None:
            return []
        parts.append(part)
        name = name[len(part) :]
    return parts if len(parts) > 1 and not name else []


def declared_name(text: str, pointer: str, what: str = "name") -> str:
    r"""The name in ASCII (Greek letters and \theta, r_{1} as words); InputError if it cannot be declared."""
    name = _ascii(text)
    if len(text) > LIMITS.name_characters or len(name) > LIMITS.name_characters:
        raise LimitError(f"a {what} has more than {LIMITS.name_characters} characters: choose a shorter one.", pointer)
    if not _NAME.fullmatch(name):
        raise InputError(
            f"'{shorten(text)}' cannot be a {what}: write letters and digits, a letter first, as in r1 or x_left.",
            pointer,
        )
    if name in RESERVED:
        meaning = {"t": "the time", "pi": "the number pi"}.get(name, "a function")
        raise InputError(f"'{name}' cannot be a {what}, it stands for {meaning}: choose another name.", pointer)
    return name


def _ascii(text: str) -> str:
    text = text[: LIMITS.name_characters + 1].strip()
    pairs = [letter(character) for character in text]
    if pairs and all(pair is not None and pair[1] == 0 for pair in pairs):
        return "".join(pair[0] for pair in pairs if pair)
    match = _LATEX_NAME.fullmatch(text)
    if match is None:
        return text
    words = [LETTER_COMMANDS.get(word, word) for word in match.groups() if word]
    return "_".join(words)


def check_clashes(names: Names, keyed_parameters: bool = False) -> None:
    """InputError for a name declared twice, or one that the derivative or momentum of another has."""
    seen: dict[str, str] = {}
    for pointer, name in _places(names, keyed_parameters):
        if name in seen:
            raise InputError(f"'{name}' is declared twice: give one of the two another name.", pointer)
        seen[name] = pointer
    for coordinate in names.coordinates:
        for taken in (f"{coordinate}_dot", f"{coordinate}_ddot", f"p_{coordinate}"):
            if taken in seen:
                meaning = "momentum" if taken.startswith("p_") else "derivative"
                raise InputError(
                    f"'{taken}' is the {meaning} of the coordinate {coordinate}: choose another name.", seen[taken]
                )


def _places(names: Names, keyed_parameters: bool) -> list[tuple[str, str]]:
    """(pointer, name) of every declaration; parameters with values stand under their names."""
    coordinates = [(f"/coordinates/{place}", name) for place, name in enumerate(names.coordinates)]
    parameters = [
        (f"/parameters/{name if keyed_parameters else place}", name) for place, name in enumerate(names.parameters)
    ]
    return [*coordinates, *parameters, *((f"/functions/{name}", name) for name in names.functions)]
