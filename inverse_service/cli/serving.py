"""`inverse-service serve`, `mcp`, and `admin`: servers, and commands for their operators."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import ipaddress
import json
import logging
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from inverse_service import __version__, errors
from inverse_service.cli import command_line as cli
from inverse_service.settings import Settings, read_settings

if TYPE_CHECKING:
    from inverse_service.service.jobs.stores import JobStore

log = logging.getLogger(__name__)
# Of the web process itself, in MiB and in times MAX_BODY: no request can make it take the memory of
# the others.
WEB_MEMORY = 1024
SHARE_OF_BODIES = 128
# Streams and running work have ended by then, or they never will; what was acknowledged is stored
# in any case, s. The rest of the five seconds that are promised is for a machine on which a thread
# wakes up late.
LONGEST_END = 3.0
# Connections that wait to be accepted, and are in one turn of the loop: more than
# CLIENT_CONNECTIONS, or a client that opens all of its own at once makes others wait for a second
# until the system tries again.
BACKLOG = 512
# Descriptors that are no connections: the database, the pipes of the workers.
OWN_DESCRIPTORS = 192
LOOPBACK_ADDRESSES = ("127.0.0.1", "::1", "localhost")
LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
EXAMPLE = '{"coordinates": ["x"], "equations": {"x": "-x"}}'
admin = typer.Typer(
    help="For operators: inspect, drain and clear the store of a service.", no_args_is_help=True
)
Client = Annotated[str, typer.Argument(help="The name of a key, or an address if no keys are set.")]


@cli.command("serve --port 8000")
def serve(
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(help="Port to listen on.", **cli.integer("--port", 0, 65535))
    ] = 8000,
) -> cli.ExitCode:
    """Run the HTTP service and its web pages."""
    cli.refuse_without_pools("'serve'")
    settings = read_settings()
    # Documents of clients are in the database and in temporary folders: no other user of this
    # machine may read them.
    os.umask(0o077)
    if not settings.hosts and host in LOOPBACK_ADDRESSES:
        # Another name would be a page elsewhere that lets its own name point here.
        settings = dataclasses.replace(settings, hosts=LOOPBACK)
    listener = _listen(host, port)
    from inverse_service.kernels.machine_code import code_store
    from inverse_service.service.jobs import monitoring, workers
    from inverse_service.web import middleware, pages

    # The server that forks the workers loads the engine while this process loads the pages.
    for module in pages.TASKS:
        workers.preload(module)
    workers.start_server()
    from inverse_service.web.application import create_application
    from inverse_service.web.pages import forms, solve

    monitoring.begin(settings.log_level, middleware.StreamCut)
    bound, number = listener.getsockname()[:2]
    if not (
        settings.api_keys
        or settings.api_keys_file
        or ipaddress.ip_address(bound.partition("%")[0]).is_loopback
    ):
        log.warning(
            "no keys are set: anyone who can reach %s may use this service and see all its jobs",
            host,
        )
    if not code_store.is_warm():
        log.warning(code_store.SENTENCE)
    application = create_application(settings)
    # Opened here so that a database that cannot be used is one sentence, and before the address is
    # printed.
    application.state.engine.open()
    address = f"http://{f'[{host}]' if ':' in host else host}:{number}"
    workers.bound_data(WEB_MEMORY + SHARE_OF_BODIES * settings.max_body // 2**20)
    server = _server(application, settings)
    # The templates and examples of the start page, which its first visitor need not wait for.
    solve.solve_page(forms.fields_from({"equations": solve.START}))
    # uvicorn ends in order and then raises the signal once more, which is no fault; one that comes
    # before it begins is heard too.
    signal.signal(signal.SIGTERM, server.handle_exit)

    def announce() -> None:
        example = f"curl -s {address}/v1/solve -H 'Content-Type: application/json' -d '{EXAMPLE}'"
        print(f"{address}\n{example}", flush=True)
        said = {"version": __version__, "address": address, "workers": settings.workers}
        log.info("started", extra=said)

    _once_it_answers(server, announce)
    server.run(sockets=[listener])
    log.info("stopped")
    # Collecting what is left would take longer than all that stopped before, and nothing could end
    # it.
    gc.freeze()
    return cli.ExitCode.DONE


def _server(application: Any, settings: Settings) -> Any:
    """uvicorn with our limits on connections and on the time that it takes to stop."""
    import uvicorn

    from inverse_service.web.connections import KEEP_ALIVE, Connections

    connections = Connections(
        _most_connections(settings.connections), settings.client_connections, settings.proxies
    )
    application.state.engine.connections = connections
    server = uvicorn.Server(
        uvicorn.Config(
            application,
            http=cast(Any, connections.protocol),
            ws="none",
            backlog=BACKLOG,
            proxy_headers=bool(settings.proxies),
            forwarded_allow_ips=list(settings.proxies),
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
            timeout_keep_alive=int(KEEP_ALIVE),
        )
    )
    _end_streams_at_a_signal(server, application.state.engine.close_streams)
    return server


def _most_connections(wanted: int) -> int:
    """The number of connections that file descriptors allow; their limit is raised first if possible."""
    try:
        import resource
    except ImportError:
        return wanted
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    largest = min(hard if hard != resource.RLIM_INFINITY else 65_536, 65_536)
    if soft < largest:
        resource.setrlimit(resource.RLIMIT_NOFILE, (largest, hard))
    return max(10, min(wanted, max(soft, largest) - OWN_DESCRIPTORS))


def _end_streams_at_a_signal(server: Any, close_streams: Callable[[], None]) -> None:
    """End open streams at the first signal; uvicorn waits for them for a limited time."""
    handle = server.handle_exit

    def handle_exit(number: int, frame: Any) -> None:
        close_streams()
        last = threading.Timer(LONGEST_END, os._exit, (cli.ExitCode.DONE,))
        last.daemon = True
        last.start()
        handle(number, frame)

    server.handle_exit = handle_exit


def _once_it_answers(server: Any, announce: Callable[[], None]) -> None:
    """Call `announce` when the server answers: its own processes take 0.3 s to begin."""
    startup = server.startup

    async def started(sockets: list[socket.socket] | None = None) -> None:
        await startup(sockets)
        if server.started:
            announce()

    server.startup = started


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.create_server((host, port), family=family)
    except (OSError, UnicodeError) as error:
        code = getattr(error, "errno", None)
        reason = (
            os.strerror(code).lower()
            if code is not None and code > 0
            else "there is no such address"
        )
        detail = f"Port {port} of {host} cannot be listened on: {reason}; choose another --port or --host."
        raise errors.InputError(detail) from None
    # Connections inherit it. Without it each answer waits 40 ms for an acknowledgement (Nagle):
    # asyncio only sets it on sockets that were made with the protocol named.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener


@cli.command("mcp")
def mcp() -> cli.ExitCode:
    """Serve tools for other programs by the Model Context Protocol, on standard input and output (extra `mcp`)."""
    from inverse_service.cli.mcp_command import server

    server().run("stdio")
    return cli.ExitCode.DONE


cli.application.add_typer(admin, name="admin")


class Rank(StrEnum):
    """When jobs begin: before those of all other clients, by turns with them, or after them."""

    first = "first"
    normal = "normal"
    last = "last"


RANKS = {Rank.first: -1, Rank.normal: 0, Rank.last: 1}


@cli.command("admin status", of=admin)
def status() -> None:
    """Show the version and size of the store, its jobs by status, and whether it is drained."""
    from inverse_service.service.jobs.statements import VERSION

    with _store() as store:
        _say(
            {
                "version": VERSION,
                "bytes": store.size(),
                "jobs": store.counts(),
                "drained": store.is_drained(),
            }
        )


@cli.command("admin drain", of=admin)
def drain() -> None:
    """Stop starting jobs. Running jobs finish, new ones wait, and /readyz returns 503 until `resume`."""
    with _store() as store:
        store.drain(True)


@cli.command("admin resume", of=admin)
def resume() -> None:
    """Start jobs again after `drain`."""
    with _store() as store:
        store.drain(False)


@cli.command("admin clients", of=admin)
def clients() -> None:
    """List the clients: waiting, running and stored jobs, rank, runs and processor seconds of today (UTC)."""
    with _store() as store:
        for use in store.clients():
            _say(dataclasses.asdict(use))


@cli.command("admin priority alice last", of=admin)
def priority(
    name: Annotated[str, typer.Argument(help="A client or, with --batch, the id of a batch.")],
    rank: Annotated[
        Rank, typer.Argument(help="first, normal, or last.", **cli.one_of(Rank, "rank"))
    ],
    batch: Annotated[bool, typer.Option("--batch", help="NAME is a batch.")] = False,
) -> None:
    """Set the rank of a client's current and future jobs, or of the open jobs of a batch."""
    from inverse_service.service.jobs.model import BULK

    with _store() as store:
        if not batch:
            store.rank_client(name, RANKS[rank])
        elif store.batch(name) is None:
            raise errors.InputError("There is no batch of this id.")
        else:
            _say(
                {"jobs": store.prioritise_batch(name, {-1: -1, 0: BULK, 1: BULK + 1}[RANKS[rank]])}
            )


@cli.command("admin cancel alice", of=admin)
def cancel(client: Client) -> None:
    """Cancel all open jobs and batches of a client; work that other clients also wait for continues."""
    with _store() as store:
        _say({"jobs": len(store.dismiss_client(client))})


@cli.command("admin erase alice", of=admin)
def erase(client: Client) -> None:
    """Delete a client's jobs, answers and batches, except those that another client also requested."""
    with _store() as store:
        _say({"jobs": store.erase_client(client)})


@contextlib.contextmanager
def _store() -> Iterator[JobStore]:
    from inverse_service.service.jobs.opening import open_as_guest

    with contextlib.closing(open_as_guest(read_settings().database)) as store:
        yield store


def _say(value: object) -> None:
    cli.write(json.dumps(value, ensure_ascii=False) + "\n")
