"""From a document to the request of a job: shape looked at, identity computed."""

from __future__ import annotations

from typing import Any

from inverse_service.service.jobs.identity import job_id, write_json
from inverse_service.service.jobs.kinds import KINDS
from inverse_service.service.jobs.model import INTERACTIVE, JobRequest
from inverse_service.service.jobs.options import JobOptions


def request_of(
    kind: str, document: Any, options: JobOptions, client: str = "", priority: int = INTERACTIVE, fresh: bool = False
) -> JobRequest:
    """The request. Raises InputError where the document has not the shape that the kind asks for."""
    KINDS[kind].look(document)
    chosen = options.canonical()
    return JobRequest(job_id(kind, document, chosen), kind, write_json(document), chosen, client, priority, fresh)
