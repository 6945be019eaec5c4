"""What the work is at: a stage as a value, which is put into words only where a person reads it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Stage:
    """A stage that begins: its `step`, and of which of several things it is one.

    `name` is that of a method or of an ansatz, or says how far it is; `order` is that of a
    prolongation; `timed` says that the decision is about L(t, q, q'). `about` is the associated
    system of a motion on constraints, or "any".
    """

    step: str
    name: str = ""
    order: int | None = None
    timed: bool = False
    about: str = ""

    @property
    def kind(self) -> str:
        """The step of the question that it belongs to."""
        return f"{self.step} with time" if self.timed else self.step

    @property
    def text(self) -> str:
        """As people read it."""
        order = f" to order {self.order}" if self.order is not None else ""
        return "".join(
            (
                f"{self.about}: " * bool(self.about),
                self.kind,
                order,
                f": {self.name}" * bool(self.name),
            )
        )

    def of(self, about: str) -> "Stage":
        """The same stage of the question about an associated system."""
        return replace(self, about=about)


Progress: TypeAlias = Callable[[Stage], None]
DECISION, METHOD, ANSATZ, PROLONGATION = "decision", "method", "ansatz", "prolongation"
