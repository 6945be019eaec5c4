"""The Python client of the service: submit, wait, stream, batch; blocking and asynchronous.

    with Client("http://127.0.0.1:8000") as client:
        result = client.solve({"coordinates": ["x"], "equations": {"x": "-x"}})

`Client` and `AsyncClient` have the same methods. docs/how-to/http.md shows each of them at work.
"""

from inverse_service.client.decoding import (
    BatchAnswer,
    ClientError,
    Event,
    JobDismissed,
    JobFailed,
    RequestRefused,
    ServiceBusy,
    ServiceUnreachable,
    UnexpectedAnswer,
    WaitedTooLong,
)
from inverse_service.client.sync_and_async import AsyncClient, Client

__all__ = [
    "AsyncClient",
    "BatchAnswer",
    "Client",
    "ClientError",
    "Event",
    "JobDismissed",
    "JobFailed",
    "RequestRefused",
    "ServiceBusy",
    "ServiceUnreachable",
    "UnexpectedAnswer",
    "WaitedTooLong",
]
