"""Many systems: every line of a file answered exactly once, in parallel, also after a kill.

The input is a file, standard input or a .gz, one document a line. The output file is the truth of
what is done. It only grows: plain lines, or for .gz one compressed member after the other, so that
a run that was killed loses at most what it was writing. Each answer has the digest of its question;
on resuming it counts for a line with the same digest only. The jobs run on the same supervisor as
those of the service, over a store in the temporary folder that lives as long as the run
(`jobs/locks.py`).
"""

import contextlib
import gzip
import hashlib
import io
import itertools
import json
import stat
import sys
import threading
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any

from pydantic import ValidationError

from api_schemas.system import SystemDocument
from inverse_service.errors import InputError, LimitError
from inverse_service.service.documents import answers, plain_data
from inverse_service.service.jobs import locks, model, opening, statements, stores, tasks, workers
from inverse_service.service.jobs.supervisor import Supervisor

MAX_LINE_BYTES = 1_000_000
MOST_BLANK = 1_000_000  # in a row: a megabyte of .gz may hold a thousand times as many
STANDARD = "-"
Identifier = str | int
MAX_ANSWER_BYTES = 200_000_000
MEMBER_BYTES, MEMBER_SECONDS = 262_144, 5.0
CHUNK = 1 << 20
# The id of the batch that a file is.
BATCH = "file"
# Jobs that are open at the same time, for each worker: enough that none waits for a line to be
# read.
AHEAD = 8
# So many error lines at the beginning, and nothing else, are a file of another kind.
UNUSABLE = 10  # error lines, where there are no others
# What `again` names, as answers are counted.
AGAIN = {"errors": ("error", "fault"), "undetermined": ("undetermined",)}


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the input; `fault` says why it cannot be solved, else `document` is to be solved.

    `identifier` is its own `id`, or its line number where it has none; None where it is unreadable.
    `raw` are the bytes of a line that is no document.
    """

    number: int
    identifier: Identifier | None
    document: Any = None
    fault: InputError | None = None
    duplicate_of: int | None = None
    raw: bytes = b""

    @property
    def digest(self) -> str:
        """What the line asks, its options included, its id left out: an answer holds only for
        this.
        """
        return (
            hashlib.sha256(self.raw).hexdigest()
            if self.document is None
            else model.document_digest(self.document)
        )


def open_source(path: Path) -> contextlib.AbstractContextManager[IO[bytes]]:
    """The input, - for standard input, decompressed where its name ends so; raises InputError."""
    if str(path) == STANDARD:
        if sys.stdin is None:
            raise InputError("Standard input is closed; name a file of one system a line.")
        return contextlib.nullcontext(sys.stdin.buffer)
    if path == Path():  # of an empty name, too
        detail = "The input has no name; name a file of one system a line, or - for standard input."
        raise InputError(detail)
    try:
        return gzip.open(path) if path.suffix == ".gz" else path.open("rb")  # type: ignore[return-value]
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or "the name is not a file name").lower()
        raise InputError(
            f"The input {path} cannot be read: {reason}; name a file of one system a line."
        ) from None


def read_lines(stream: IO[bytes]) -> Iterator[Line]:
    """Every line that is not empty, in order; a bad line becomes one with a fault."""
    first_with: dict[Identifier, int] = {}
    for number, data in enumerate(_bounded_lines(stream), 1):
        if data is None:
            fault = InputError(
                f"The line is longer than {MAX_LINE_BYTES} bytes; give this system alone to 'solve'."
            )
            yield Line(number, None, fault=fault)
        elif data.strip():
            yield marked(_read_line(number, data), first_with)


def read_answers(stream: IO[bytes]) -> Iterator[tuple[Line, dict[str, Any]]]:
    """The lines of a batch's output with their answers, ids included, which may be null; InputError
    for others.
    """
    for line in read_lines(stream):
        answer = {**line.document, "id": line.identifier} if line.document is not None else None
        if line.fault and line.raw[:1] == b"{":
            answer = plain_data.read_json(line.raw)
        if not isinstance(answer, dict) or not {"format", "error"} & answer.keys():
            raise InputError(f"Line {line.number} is not an answer of a batch.")
        yield line, answer


def count_lines(path: Path) -> int | None:
    """How many lines there are, empty ones included; None for what can be read only once."""
    if not path.is_file():
        return None
    with open_source(path) as stream:
        return sum(1 for _ in _bounded_lines(stream))


def _read_line(number: int, data: bytes) -> Line:
    try:
        value = plain_data.read_json(data.rstrip())  # a fault at its end is on this line
    except InputError as error:
        return Line(number, None, fault=error, raw=data.strip())
    return replace(line_of(number, value), raw=data.strip())


def line_of(number: int, value: Any) -> Line:
    """A line from its JSON value: a document with an `id` of its own or not."""
    if not isinstance(value, dict):
        fault = InputError("The line must be a JSON object with coordinates and equations.")
        return Line(number, None, fault=fault)
    document = {key: part for key, part in value.items() if key != "id"}
    identifier = value.get("id", number)
    if (
        isinstance(identifier, bool)
        or not isinstance(identifier, str | int)
        or len(str(identifier)) > 200
    ):
        return Line(
            number,
            None,
            fault=InputError("The id must be a text or an integer of at most 200 characters."),
        )
    return Line(number, identifier, document)


def marked(line: Line, first_with: dict[Identifier, int]) -> Line:
    """The line, with a fault where its id was used before; `first_with` remembers the ids."""
    if line.identifier is None:
        return line
    first = first_with.setdefault(line.identifier, line.number)
    if first == line.number:
        return line
    fault = InputError(
        f"The id of this line was used on line {first} already; give each line its own.", "/id"
    )
    return replace(line, fault=fault, duplicate_of=first)


def _bounded_lines(stream: IO[bytes]) -> Iterator[bytes | None]:
    blank = 0
    try:
        while data := stream.readline(MAX_LINE_BYTES + 1):
            blank = 0 if data.strip() else blank + 1
            if blank > MOST_BLANK:
                raise InputError(
                    f"The input has more than {MOST_BLANK:,} blank lines in a row; leave them out."
                )
            if len(data) <= MAX_LINE_BYTES or data.endswith(b"\n"):
                yield data
                continue
            while data and not data.endswith(b"\n"):
                data = stream.readline(MAX_LINE_BYTES)
            yield None
    except (OSError, EOFError, zlib.error) as error:  # OSError: BadGzipFile too
        reason = (
            getattr(error, "strerror", None) or "the compressed data are damaged or end too early"
        )
        raise InputError(f"The input cannot be read to its end: {reason.lower()}.") from None


def lines_of_array(values: Any) -> Iterator[Line]:
    """Every element of a JSON array, numbered from 1. Raises InputError where it is no array."""
    if not isinstance(values, list):
        raise InputError(
            "The batch must be a JSON array of documents; one document alone goes to POST /v1/solve."
        )
    first_with: dict[str | int, int] = {}
    return (marked(line_of(number, value), first_with) for number, value in enumerate(values, 1))


def batch_task(body: bytes, is_array: bool, terms: tasks.Terms) -> list[model.BatchLine]:
    """A body with a batch to its lines; of too many lines none is read."""
    if is_array:
        lines = lines_of_array(values := tasks.read_body(body))
        _refuse_more(len(values), terms.most)
        return batch_lines(lines, terms)
    numbers_of(body, terms.most)
    return batch_lines(read_lines(io.BytesIO(body)), terms)


def numbers_of(body: bytes, most: int) -> list[int]:
    """The numbers of the lines that are not empty. Raises as `batch_lines` does for too many, or
    none.
    """
    found = list[int]()
    for number, data in enumerate(_bounded_lines(io.BytesIO(body)), 1):
        if data is None or data.strip():
            found.append(number)
            _refuse_more(len(found), most)
    _refuse_none(found)
    return found


def unread_line(number: int, detail: str, status: int, kind: str) -> model.BatchLine:
    """A line that was accepted and could not be read, for this reason."""
    problem = answers.as_bytes(answers.problem_document(status, kind, detail))
    return model.BatchLine(number, json.dumps(number), problem=problem)


def _refuse_more(count: int, most: int) -> None:
    if count > most:
        raise LimitError(f"The batch has more than {most} lines; send it in parts.")


def _refuse_none(found: Sequence[object]) -> None:
    if not found:
        raise InputError("The batch is empty; send one document a line.")


def batch_lines(lines: Iterable[Line], terms: tasks.Terms) -> list[model.BatchLine]:
    """The lines as the store takes them. Raises LimitError for too many, InputError for none."""
    found: list[model.BatchLine] = []
    for line in lines:
        _refuse_more(len(found) + 1, terms.most)
        found.append(batch_line(line, terms))
    _refuse_none(found)
    return found


def batch_line(line: Line, terms: tasks.Terms) -> model.BatchLine:
    """A line as its question, or as the problem document of one that is none."""
    identifier = json.dumps(line.identifier)
    try:
        if line.fault is not None:
            raise line.fault
        document, given = model.split_options(line.document)
        limit = (terms.time_limit if given is None else None) or terms.server.time_limit
        options = model.read_options(given, replace(terms.server, time_limit=limit))
        look = _plain_first if terms.kind == "solve" else None
        request = tasks.request_of(
            terms.kind, document, options, terms.client, model.BULK, terms.fresh, look
        )
    except InputError as error:
        return model.BatchLine(
            line.number, identifier, problem=answers.as_bytes(answers.of_input_error(error))
        )
    return model.BatchLine(line.number, identifier, request)


def _plain_first(document: Any) -> None:
    """Refuse what has not the shape of a document; one that has the form of the schema is not
    looked at further.
    """
    try:
        SystemDocument.model_validate(document)
    except ValidationError:
        tasks.KINDS["solve"].look(document)


def answer_line(
    answer: model.BatchAnswer, digest: str = "", duplicate_of: int | None = None
) -> bytes:
    """JSON with the `id` and the number of the line in front, and a line feed at the end.

    A problem document names its line; `error` holds it once more for who looks for that key.
    """
    if answer.status == "successful" and answer.body is not None:
        result = answer.body.strip()
        inside = result[1:-1].strip() if result[:1] == b"{" else b'"result": ' + result
        return line_head(answer, digest) + (b", " + inside if inside else b"") + b"}\n"
    problem = _problem(answer)
    told = problem | {"detail": f"Line {answer.number}: {problem['detail']}"}
    line: dict[str, Any] = {"id": json.loads(answer.identifier), "line": answer.number}
    more = {"digest": digest or None, "duplicate_of": duplicate_of}
    line |= {key: value for key, value in more.items() if value is not None}
    return answers.as_bytes(line | told | {"error": told}) + b"\n"


def line_head(answer: model.BatchAnswer, digest: str = "") -> bytes:
    """What stands before the result in its line: the result follows without its first bracket,
    after a comma.
    """
    shown = f', "digest": "{digest}"' if digest else ""
    return f'{{"id": {answer.identifier}, "line": {answer.number}{shown}'.encode()


def _problem(answer: model.BatchAnswer) -> dict[str, Any]:
    if answer.body is None:
        return answers.problem_document(410, "dismissed", "The job of this line was dismissed.")
    found: dict[str, Any] = json.loads(answer.body)
    return found


@dataclass(frozen=True, slots=True)
class Known:
    """An answer: to which question, what it is counted as (a verdict, "error", "fault"), and
    why.
    """

    digest: str
    label: str
    reason: str


class Output:
    """Answers by their keys, and a place to write more; `superseded`: some were replaced by later
    ones.
    """

    def __init__(self, stream: IO[bytes], compressed: bool = False) -> None:
        self._stream, self._compressed = stream, compressed
        self._kept, self._since = bytearray(), time.monotonic()
        self.known: dict[str, Known] = {}
        self.superseded = False

    def note(self, answer: dict[str, Any]) -> Known:
        """Remember an answer; one of the same key is superseded."""
        key = answer_key(answer)
        self.superseded |= key in self.known
        self.known[key] = Known(answer.get("digest", ""), _label(answer), _reason(answer))
        return self.known[key]

    def add(self, line: bytes) -> Known:
        """Write one answer. Raises InputError where the output takes no more."""
        self._kept += line
        is_late = time.monotonic() - self._since > MEMBER_SECONDS
        if not self._compressed or len(self._kept) > MEMBER_BYTES or is_late:
            self.flush()
        return self.note(json.loads(line))

    def flush(self) -> None:
        """Hand over what was kept back to be compressed together."""
        data = memoryview(
            gzip.compress(self._kept) if self._compressed and self._kept else bytes(self._kept)
        )
        self._kept, self._since = bytearray(), time.monotonic()
        try:
            while data:
                data = data[self._stream.write(data) :]
            self._stream.flush()
        except (OSError, ValueError) as error:
            if isinstance(error, BrokenPipeError):
                raise
            reason = (getattr(error, "strerror", None) or "it is closed").lower()
            raise InputError(f"The output cannot be written: {reason}.") from None


def answer_key(answer: dict[str, Any]) -> str:
    """By id; by line number for a line without a readable id or with the id of another line."""
    if answer.get("id") is None or answer.get("duplicate_of") is not None:
        return f"line {answer.get('line')}"
    return f"id {json.dumps(answer['id'])}"


def key_of(line: Line) -> str:
    """The key of the answer to a line."""
    return answer_key(
        {"id": line.identifier, "line": line.number, "duplicate_of": line.duplicate_of}
    )


@contextlib.contextmanager
def open_output(path: Path) -> Iterator[Output]:
    """The output, with the answers of earlier runs; for this process alone. Raises InputError.

    What was half written is cut off. At a regular end superseded answers are moved to
    `path`.replaced.
    """
    if str(path) == STANDARD:
        if sys.stdout is None:
            raise InputError("Standard output is closed; name a file with --output.")
        yield Output(sys.stdout.buffer)
        return
    with _locked(path) as stream:
        output = Output(stream, path.suffix == ".gz")
        stream.truncate(_note_earlier(path, output))
        try:
            yield output
        finally:
            output.flush()
        if output.superseded:
            _part_superseded(path)


def _note_earlier(path: Path, output: Output) -> int:
    """How many bytes of the file are whole."""
    whole = 0
    for number, (data, end) in enumerate(_whole_lines(path), 1):
        answer = None
        with contextlib.suppress(ValueError, RecursionError):
            answer = json.loads(data)
        if not isinstance(answer, dict) or "line" not in answer or "id" not in answer:
            raise InputError(
                f"Line {number} of the output file is not an answer of a batch; choose another file."
            )
        output.note(answer)
        whole = end
    return whole


def _whole_lines(path: Path) -> Iterator[tuple[bytes, int]]:
    """Each line that was written whole, and up to where the file is whole with it."""
    if path.suffix == ".gz":
        for lines, end in _members(path):
            yield from ((line, end) for line in lines)
        return
    end = 0
    with path.open("rb") as stream:
        while (line := stream.readline(MAX_ANSWER_BYTES)).endswith(b"\n"):
            end += len(line)
            yield line, end
    if len(line) >= MAX_ANSWER_BYTES:
        raise InputError(
            "The output file is not that of a batch: it has a line without an end; choose another file."
        )


def _members(path: Path) -> Iterator[tuple[list[bytes], int]]:
    """The lines of each whole member of a compressed file, and where it ends."""
    with path.open("rb") as stream:
        rest, end = stream.read(CHUNK), 0
        while rest:
            member, lines = zlib.decompressobj(31), bytearray()
            while rest and not member.eof:
                try:
                    lines += member.decompress(rest, MAX_ANSWER_BYTES)
                except zlib.error:
                    raise InputError(
                        "The output file is not, or not all, of gzip; choose another file."
                    ) from None
                if len(lines) >= MAX_ANSWER_BYTES:
                    raise InputError("The output file is not that of a batch; choose another file.")
                end += len(rest) - len(member.unused_data)
                rest = member.unused_data or stream.read(CHUNK)
            if member.eof:
                yield bytes(lines).splitlines(keepends=True), end


def _part_superseded(path: Path) -> None:
    """Keep the last answer of each key; append the others to a file next to it."""
    last = {
        answer_key(json.loads(line)): number for number, (line, _) in enumerate(_whole_lines(path))
    }
    fresh = path.with_name(f"{path.name}.fresh")
    opened = gzip.open if path.suffix == ".gz" else open
    # A folder that takes no new file: whoever reads by id still has the last answer of each line.
    with contextlib.suppress(PermissionError):
        with opened(fresh, "wb") as kept, opened(replaced_path(path), "ab") as replaced:
            for number, (line, _) in enumerate(_whole_lines(path)):
                (kept if last[answer_key(json.loads(line))] == number else replaced).write(line)
        fresh.chmod(stat.S_IMODE(path.stat().st_mode))
        fresh.replace(path.resolve())


def replaced_path(path: Path) -> Path:
    """Where answers go that later ones replaced."""
    return path.with_name(f"{path.name}.replaced")


def _label(answer: dict[str, Any]) -> str:
    if "error" not in answer:
        return tasks.label_of(answer)
    return "fault" if answer["error"]["status"] >= 500 else "error"


def _reason(answer: dict[str, Any]) -> str:
    return str(answer["error"]["detail"] if "error" in answer else answer.get("reason") or "")


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[IO[bytes]]:
    """The file, open for appending without a buffer, for this process alone; no device, pipe or
    folder.
    """
    try:
        if path == Path():  # of an empty name, too
            raise InputError("The output has no name; name a file, or - for standard output.")
        if path.exists() and not stat.S_ISREG(path.stat().st_mode):
            raise InputError(
                f"The output {path} is not a regular file; name a file, or - for standard output."
            )
        stream = path.open("ab", buffering=0)
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or "the name is not a file name").lower()
        raise InputError(f"The output file cannot be written: {reason}.") from None
    with stream:
        try:
            locks.lock(stream.fileno())
        except OSError:
            detail = (
                "Another batch is writing to the output file; wait for it or choose another file."
            )
            raise InputError(detail) from None
        yield stream


@dataclass(frozen=True, slots=True)
class BatchPlan:
    """What to do with each line of `source`, and where answers go; `cluster`: a Dask scheduler;
    `kind`: solve or check.

    `again`: which answers of an earlier run do not count, some of "errors" and "undetermined".
    """

    source: Path
    output: Path
    options: model.JobOptions
    workers: int
    cluster: str | None = None
    again: frozenset[str] = frozenset()
    kind: str = "solve"


@dataclass(slots=True)
class Summary:
    """Lines by what their answers are counted as, and the first reason of each kind; those of
    earlier runs included.
    """

    labels: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)
    earlier: int = 0
    duplicates: int = 0
    replaced: bool = False

    def count(self, answer: Known) -> None:
        """One more line is answered."""
        self.labels[answer.label] += 1
        if answer.reason:
            self.first.setdefault(answer.label, answer.reason)

    @property
    def new(self) -> int:
        """Lines that this run answered."""
        return self.labels.total() - self.earlier


def run_batch(
    plan: BatchPlan, summary: Summary, report: Callable[[Line], None] = lambda line: None
) -> None:
    """Answer every line of the source that the output does not answer yet, one line each.

    Answers come in the order in which they are done; `summary` counts them, `report` is called once
    a line. Raises InputError where the files cannot be used, or nothing but error lines begins the
    input.
    """
    if plan.output.exists() and plan.source.exists() and plan.output.samefile(plan.source):
        raise InputError("The output file is the input file; choose another one for --output.")
    with open_source(plan.source) as source, open_output(plan.output) as output:
        earlier, again = dict(output.known), {label for name in plan.again for label in AGAIN[name]}

        def count(line: Line, answer: Known) -> None:
            summary.count(answer)
            report(line)

        def open_lines() -> Iterator[Line]:
            """The lines without an answer that counts: of this very question, and not one to be
            asked again.
            """
            for place, line in enumerate(read_lines(source)):
                if place == 0:
                    _refuse_other_layouts(line)
                answer = earlier.get(key_of(line))
                if answer is None or answer.digest != line.digest or answer.label in again:
                    yield line
                else:
                    summary.earlier += 1
                    count(line, answer)

        lines = open_lines()
        first = next(lines, None)
        if first is not None:
            with _engine(plan) as (store, working):
                asked = itertools.chain((first,), lines)
                for line, answer in _answered(
                    store, working, asked, tasks.Terms(plan.kind, plan.options)
                ):
                    count(line, output.add(answer))
                summary.duplicates = store.repeated(BATCH)
        bad = summary.labels["error"]
        if bad >= UNUSABLE and bad == summary.labels.total():
            raise InputError(
                f"All {bad} lines are error lines; the first says: {summary.first['error']}"
            )
        summary.replaced = output.superseded


def _refuse_other_layouts(line: Line) -> None:
    if line.raw.startswith(b"["):
        raise InputError(
            "The input is a JSON array; write one document a line, as 'jq -c .[] FILE' does."
        )
    if line.raw == b"{":
        raise InputError(
            "A document takes several lines; write one document a line, as 'jq -c . FILE' does."
        )


def _answered(
    store: stores.SqliteStore, executor: workers.Executor, lines: Iterator[Line], terms: tasks.Terms
) -> Iterator[tuple[Line, bytes]]:
    """Each line with its answer, as they come: a batch of the store as those of the service, which
    grows meanwhile.
    """
    open_lines, after, ended = dict[int, Line](), 0, threading.Event()
    store.on_change(lambda change: ended.set() if change.what in model.FINAL else None)
    store.begin_batch(BATCH, terms.kind, "")
    while True:
        ended.clear()
        # Asked each time: a cluster grows and shrinks while it works.
        if some := [*itertools.islice(lines, max(0, AHEAD * executor.capacity - len(open_lines)))]:
            open_lines |= {line.number: line for line in some}
            store.add_lines(BATCH, [batch_line(line, terms) for line in some], statements.NO_BOUNDS)
        if not open_lines:
            return
        for answer in (found := store.batch_answers(BATCH, after)):
            line, after = open_lines.pop(answer.number), answer.order
            yield line, answer_line(answer, line.digest, line.duplicate_of)
        if not found:
            ended.wait()


@contextlib.contextmanager
def _engine(plan: BatchPlan) -> Iterator[tuple[stores.SqliteStore, workers.Executor]]:
    """A store, a supervisor and its processes for the time of one run."""
    with locks.temporary_folder() as folder:
        store = stores.SqliteStore(folder / locks.DATABASE, stores.Durability.LATER)
        working = opening.executor(plan.cluster, plan.workers, plan.options.memory_limit)
        try:
            working.start()
            supervisor = Supervisor(store, working)
            supervisor.start()
            try:
                yield store, working
            finally:
                supervisor.stop()
        finally:
            working.stop()
            store.close()
