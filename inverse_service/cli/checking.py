"""`inverse-service check`."""

from __future__ import annotations

from inverse_service.cli.exits import ExitCode
from inverse_service.cli.files import read_bytes, write
from inverse_service.errors import InputError
from inverse_service.service.documents.reading import decode, read_document, read_json
from inverse_service.service.jobs import tasks
from inverse_service.service.jobs.alone import run_alone
from inverse_service.service.jobs.identity import write_json
from inverse_service.service.jobs.options import split_options
from inverse_service.settings import read_settings

MAX_RESULT_BYTES = 200_000_000


def check_file(name: str, document: str | None = None) -> ExitCode:
    """Run the checker in a process of its own; print its verdict and its reasons.

    `document` names the file of the system that was given; left out, it is the one that the result carries.
    """
    settings = read_settings()
    text = decode(read_bytes(name, MAX_RESULT_BYTES))
    result = read_json(text)
    if not isinstance(result, dict):
        raise InputError("The file is not a result: a JSON object with verdict, system and certificate is needed.")
    if document is not None:
        given, _ = split_options(read_document(read_bytes(document), document))
        text = write_json({"document": given, "result": result})
    outcome = run_alone(tasks.check_task, (text,), settings.time_limit, settings.memory_limit)
    if outcome.status in ("deadline", "memory"):
        write(f"incomplete\nThe check was stopped at its {outcome.status} limit.\n")
        return ExitCode.OPEN
    from inverse_service.service.documents.answers import value_of

    found = value_of(outcome)
    write("\n".join([found["verdict"], *found["reasons"]]) + "\n")
    return ExitCode.DONE if found["verdict"] == "valid" else ExitCode.OPEN
