"""What every request passes: counts, a line of the log, strict headers, HEAD as GET."""

import asyncio
import itertools
import logging
import os
import re
import time
from collections.abc import Container, Mapping, Sequence

from starlette.datastructures import MutableHeaders
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from inverse_service.service.documents import answers
from inverse_service.service.jobs import monitoring

log = logging.getLogger(__name__)
GIVEN = re.compile(r"[A-Za-z0-9._-]{1,64}")
# W3C trace context: the trace that a caller is part of.
TRACE = re.compile(r"[0-9a-f]{2}-([0-9a-f]{32})-[0-9a-f]{16}-[0-9a-f]{2}")
# What asks so often that its requests would be all of the log.
QUIET = frozenset({"/livez", "/readyz", "/metrics"})
# A label has few values; anyone can make up a method.
METHODS = frozenset({"DELETE", "GET", "HEAD", "OPTIONS", "POST"})
CLIENT_LEFT = 499  # as nginx writes it: nothing was answered, since the client had left
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; style-src 'self'; img-src 'self'; form-action 'self'; "
        "base-uri 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}
RAW_HEADERS = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]
STREAMS = ("/events", "/results")
LARGEST_HEADERS = 32_768
MOST_HEADERS = 500
TOO_LARGE = (
    f"The headers have more than {LARGEST_HEADERS} bytes or {MOST_HEADERS} lines; send less."
)
UNREADABLE = "This is not a request of HTTP/1.1: a line of its head, or the length of its body, cannot be read."
STOPS = "The service is stopping and has no answer yet; send the request again in some seconds."
TOO_MANY = "Too many connections are open, in all or of this address; close some, or come again in some seconds."


class Entrance:
    """Around the application `app`: what every request passes, whatever it asks; all that is no
    request passes by.

    Requests are distinguished by route (never by the path, which anyone can make up). Those of
    `questions` go to `ask`, before all routes and without what the framework does for them. HEADERS
    are added to every answer that does not set them itself. `hosts` are the host names that are
    answered to: a page elsewhere may let its own name point to this machine. No `hosts`: any is
    taken.

    The work on a request ends where its client closes the connection before the answer is out (see
    `connections`); what was stored for it by then, such as a job, stays.
    """

    def __init__(
        self, app: ASGIApp, hosts: Sequence[str], questions: Container[str], ask: ASGIApp
    ) -> None:
        self.app, self._questions, self._ask = app, questions, ask
        self._hosts = frozenset(host.lower() for host in hosts)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began = time.monotonic()
        scope.setdefault("state", {})
        status, seconds = CLIENT_LEFT, None  # what was answered, and after how long
        identifier = identifier_of(scope)
        token = monitoring.REQUEST.set(identifier)
        work = scope["work"] = asyncio.current_task()

        async def send_whole(message: Message) -> None:
            nonlocal status, seconds
            if message["type"] == "http.response.start":
                status, seconds = message["status"], time.monotonic() - began
                given = {name for name, _ in message["headers"]}
                ours = [pair for pair in RAW_HEADERS if pair[0] not in given]
                message["headers"] = [
                    *message["headers"],
                    *ours,
                    (b"x-request-id", identifier.encode()),
                ]
                if status == 307:  # by the framework, after a slash too many
                    headers = MutableHeaders(scope=message)
                    headers["location"] = "/" + headers["location"].split("/", 3)[3].lstrip("/")
            await send(message)

        try:
            is_question = scope["method"] == "POST" and scope["path"] in self._questions
            # Routes that are read with GET are read with HEAD too; the server leaves the body out.
            is_head = scope["method"] == "HEAD" and not scope["path"].endswith(STREAMS)
            answer = self._refusal(scope) or (self._ask if is_question else self.app)
            await answer({**scope, "method": "GET"} if is_head else scope, receive, send_whole)
        except asyncio.CancelledError:
            if scope.get("left"):
                if work is None or work.uncancel():
                    raise
            elif seconds is None:  # the server stops, and waits no longer for this answer
                await SERVICE_STOPS(scope, receive, send_whole)
            else:
                raise
        except Exception:
            if seconds is None:  # what is outside of this one answers with 500
                status = 500
            raise
        finally:
            route = getattr(scope.get("route"), "path", "none")
            method = scope["method"] if scope["method"] in METHODS else "other"
            monitoring.of(monitoring.REQUESTS, method, route, str(status)).inc()
            monitoring.of(monitoring.ANSWERED, method, route).observe(
                seconds or time.monotonic() - began
            )
            _note(scope, status, time.monotonic() - began)
            monitoring.REQUEST.reset(token)

    def _refusal(self, scope: Scope) -> Response | None:
        """Of too large headers (431), two lengths, of which a proxy may believe the other (400), a
        NUL, which databases do not take (404, in a query 422), and another host (421).
        """
        heads = scope["headers"]
        if len(heads) > MOST_HEADERS or sum(map(len, itertools.chain(*heads))) > LARGEST_HEADERS:
            return HEADERS_TOO_LARGE
        names = [name for name, _ in heads]
        codings = [value.lower() for name, value in heads if name == b"transfer-encoding"]
        if codings and (codings != [b"chunked"] or b"content-length" in names):
            detail = "A body has a Content-Length, or comes in chunks (Transfer-Encoding: chunked); send only one of them."
            return _refused(400, "unreadable", detail)
        if names.count(b"host") != 1 and (names.count(b"host") or scope["http_version"] != "1.0"):
            return _refused(400, "unreadable", "A request of HTTP/1.1 has one header 'Host'.")
        if b"%00" in scope["query_string"]:
            return _refused(
                422,
                "bad-input",
                "The query has a NUL character (%00), which no value has; leave it out.",
            )
        if "\x00" in scope["path"]:
            return _refused(
                404, "not-found", "There is nothing at an address that has a NUL character."
            )
        if self._hosts and not self._hosts & {host_of(scope), "*"}:
            detail = "This service does not answer to this host name; its operator lists them in INVERSE_SERVICE_HOSTS."
            return _refused(421, "host", detail)
        return None


def header_of(scope: Scope, name: bytes) -> str:
    """A header, of which more than one are one with commas (RFC 9110); empty where there is none."""
    if (found := scope.get("heads")) is None:
        found = scope["heads"] = {}
        for each, value in scope["headers"]:
            found[each] = found[each] + b", " + value if each in found else value
    text: str = found.get(name, b"").decode("latin-1")
    return text


def identifier_of(scope: Scope) -> str:
    """The caller's `X-Request-Id`, the trace that it is part of, or a new one."""
    given, trace = (
        header_of(scope, b"x-request-id"),
        TRACE.fullmatch(header_of(scope, b"traceparent")),
    )
    if GIVEN.fullmatch(given):
        return given
    return trace[1] if trace is not None else os.urandom(16).hex()


def _note(scope: Scope, status: int, seconds: float) -> None:
    """A line of the access log: who asked for what, and how it was answered; a refused key stands
    out.
    """
    if scope["path"] in QUIET:
        return
    client = scope.get("state", {}).get("client_name") or (scope.get("client") or ("",))[0]
    about = {
        "client": client,
        "method": scope["method"],
        "path": scope["path"][:200],
        "status": status,
    }
    level = logging.WARNING if status == 401 else logging.INFO
    monitoring.say(log, "request", {**about, "seconds": round(seconds, 4)}, level)


def host_of(scope: Scope) -> str:
    """The name in the Host header, in lower case and without its port."""
    return name_of(header_of(scope, b"host"))


def name_of(address: str) -> str:
    """A host name in lower case and without its port."""
    name, _, port = address.lower().rpartition(":")
    return (name if name and port.isdigit() else address.lower()).removesuffix(".")


def _refused(status: int, kind: str, detail: str, more: Mapping[str, str] = {}) -> Response:
    """Ends the connection too: what follows on it may be meant as a part of this request."""
    content = answers.as_bytes(answers.problem_document(status, kind, detail))
    headers = HEADERS | {"Connection": "close"} | dict(more)
    return Response(content, status, headers=headers, media_type="application/problem+json")


HEADERS_TOO_LARGE = _refused(431, "headers-too-large", TOO_LARGE)
# The answers to bytes that cannot be read as HTTP, and to a connection whose request is not read.
NOT_HTTP = _refused(400, "unreadable", UNREADABLE)
SERVICE_STOPS = _refused(503, "busy", STOPS, {"Retry-After": "5"})
TOO_MANY_CONNECTIONS = _refused(503, "busy", TOO_MANY, {"Retry-After": "5"})


class StreamCut(Exception):
    """A stream ends before its last answer; raised, as only a broken connection tells its reader
    so. It is no fault.
    """
