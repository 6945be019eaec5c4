"""What the atlas answers: a search, and one system."""

from typing import Any

from pydantic import BaseModel, Field


def told(words: str) -> Any:
    """A field with its description."""
    return Field(description=words)


class AtlasLine(BaseModel):
    """A system of the atlas in a list."""

    name: str = told("the name in addresses")
    title: str = told("its title")
    source: str = told("its source as a citation; empty if the system is from this project")
    tags: list[str] = told("keywords for searches")
    equations: list[str] = told("the equations, or L and the constraints, as parsed")
    verdict: str = told("yes, no, open or differs, for both questions together")
    badge: str = told("the verdict in words")


class AtlasList(BaseModel):
    """The results of a search: at most a hundred systems, and the total number."""

    count: int = told("how many systems were found")
    systems: list[AtlasLine] = told("the first hundred of them")
    license: str = told("the license of the atlas")
    cite: str = told("how to cite the atlas")


class AtlasEntry(AtlasLine):
    """One system with its document and its computed answers to both questions."""

    document: dict[str, Any] = told("the document that was solved")
    without_time: str | None = told("the verdict for L(q, q')")
    with_time: str | None = told("the verdict for L(t, q, q')")
    lagrangian: str | None = told("a Lagrangian; null where there is none or it is too long for a list")
    hamiltonian: str | None = told("its Hamiltonian")
    domain: list[str] = told("the conditions under which the formulas hold")
    checked: str | None = told("the verdict of the independent checker on the proof")
    form: str = told("a key that systems of the same form share")
    version: str = told("the version of the program that computed the answers")
