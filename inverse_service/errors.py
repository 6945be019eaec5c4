"""The tree of errors: what is wrong, where, and what to do instead.

A mathematical dead end (undetermined, no closed form) is an outcome and never an exception.
"""

from __future__ import annotations

from dataclasses import dataclass

# Only packages that come with an extra of the project are listed.
EXTRA_OF = {
    "llvmlite": "simulation", "numba": "simulation", "symengine": "simulation", "matplotlib": "figures",
    "PIL": "figures",
    "heyoka": "heyoka", "distributed": "dask", "psycopg": "postgres", "h5netcdf": "files", "h5py": "files",
    "mcp": "mcp", "pysindy": "data",
}  # fmt: skip


class InverseServiceError(Exception):
    """Root of all errors; `code` is stable, `retry` says whether the same call can succeed later."""

    code = "error"
    retry = False

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def _render_traceback_(self) -> list[str]:
        """Show one line in a notebook: the sentence says what to do, the stack does not."""
        return [f"{type(self).__name__}: {self.detail}"]


@dataclass(frozen=True, slots=True)
class Place:
    """One fault of the input: pointer into the document, column from 1, a sentence, and what may
    have been meant.

    `plain` is the sentence without its column and without the member `declare` of the document, in
    which the name at the column could be declared; "" where `detail` says neither.
    """

    detail: str
    pointer: str = ""
    column: int | None = None
    code: str = "bad-input"
    instead: tuple[str, ...] = ()
    span: tuple[int, int] | None = None
    plain: str = ""
    declare: str = ""


class InputError(InverseServiceError):
    """The document cannot be accepted.

    `detail` is one clear sentence (what, where, what instead) that never echoes raw input at
    length; `pointer` is an RFC 6901 JSON pointer into the document; `column` counts characters,
    from 1 in the string that the pointer names. `instead` are texts that may have been meant there:
    for the name at the column, or for the text between the two columns of `span`. `plain` and
    `declare` are parts of the sentence for programs that show the column and fields separately.
    """

    code = "bad-input"

    def __init__(
        self,
        detail: str,
        pointer: str = "",
        column: int | None = None,
        instead: tuple[str, ...] = (),
        span: tuple[int, int] | None = None,
        plain: str = "",
        declare: str = "",
    ) -> None:
        super().__init__(detail)
        self.pointer = pointer
        self.column = column
        self.instead = instead
        self.span = span
        self.plain = plain
        self.declare = declare

    @property
    def places(self) -> tuple[Place, ...]:
        """Every fault that is reported."""
        parts = self.plain, self.declare
        return (
            Place(
                self.detail, self.pointer, self.column, self.code, self.instead, self.span, *parts
            ),
        )

    def at(self, pointer: str) -> InputError:
        """The same error at a place deeper in the document."""
        return self.placed(pointer + self.pointer)

    def placed(self, pointer: str) -> InputError:
        """The same error at this place."""
        return self.said(self.detail, self.plain, pointer, self.instead)

    def said(self, detail: str, plain: str, pointer: str, instead: tuple[str, ...]) -> InputError:
        """The same error at this place with another sentence, and other texts that may have been
        meant.
        """
        return type(self)(detail, pointer, self.column, instead, self.span, plain, self.declare)

    def moved(
        self, detail: str, pointer: str, column: int, span: tuple[int, int] | None
    ) -> InputError:
        """The same error at another column of another text, with nothing offered if there is no
        span for it.
        """
        offered = self.instead if span is not None or self.span is None else ()
        return type(self)(detail, pointer, column, offered, span, self.plain, self.declare)


class LimitError(InputError):
    """A documented limit (characters, tokens, depth, digits, exponent, coordinates) is exceeded."""

    code = "limit"


class DocumentRefused(InputError):
    """The document does not have the shape of a system; `places` lists every fault found."""

    def __init__(self, places: tuple[Place, ...]) -> None:
        super().__init__(places[0].detail, places[0].pointer, places[0].column)
        self._places = places
        self.code = places[0].code

    @property
    def places(self) -> tuple[Place, ...]:
        return self._places


class MissingExtra(InputError):
    """A part of the program that is not installed."""

    code = "missing-extra"


def missing_extra(error: ImportError) -> MissingExtra | None:
    """The extra to install if one of its packages is absent; None for any other failed import."""
    extra = EXTRA_OF.get((error.name or "").partition(".")[0])
    if extra is None:
        return None
    return MissingExtra(
        f"This needs the extra `{extra}`: run `pip install 'inverse-service[{extra}]'`."
    )


class IrreducibleAtoms(InverseServiceError):
    """Atoms of f whose algebraic relations cannot be determined; becomes `undetermined`."""

    code = "irreducible-atoms"


class CertificateRefused(InverseServiceError):
    """Our own checker rejected our own certificate: an internal error."""

    code = "certificate-refused"


class WorkerFailed(InverseServiceError):
    """A worker process ended without a result (deadline, memory, crash)."""

    code = "worker-failed"
    retry = True


class NoWorker(WorkerFailed):
    """No worker process could be started: the operating system refuses new ones at the moment."""
