"""`inverse-service admin`: what an operator does to the store of a service, while it runs or not."""

from __future__ import annotations

import contextlib
import dataclasses
import json
from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from inverse_service import errors
from inverse_service.cli import exits

if TYPE_CHECKING:
    from inverse_service.service.jobs.store import JobStore

admin = typer.Typer(help="For operators: look at, drain and clear the store of a service.", no_args_is_help=True)
Client = Annotated[str, typer.Argument(help="The name of a key, or an address where no keys are set.")]


class Rank(StrEnum):
    """When jobs begin: before, in turn with, or after those of all others."""

    first = "first"
    normal = "normal"
    last = "last"


RANKS = {Rank.first: -1, Rank.normal: 0, Rank.last: 1}


@admin.command()
def status() -> None:
    """The version and size of the store, its jobs by status, whether it is drained."""
    from inverse_service.service.jobs.statements import VERSION

    with _store() as store:
        _say({"version": VERSION, "bytes": store.size(), "jobs": store.counts(), "drained": store.is_drained()})


@admin.command()
def drain() -> None:
    """Let no job begin; what runs ends, new questions wait, /readyz is 503. It holds until `resume`."""
    with _store() as store:
        store.drain(True)


@admin.command()
def resume() -> None:
    """Let jobs begin again."""
    with _store() as store:
        store.drain(False)


@admin.command()
def clients() -> None:
    """Each client: jobs that wait, run, are stored; rank; runs and processor seconds of today (UTC)."""
    with _store() as store:
        for use in store.clients():
            _say(dataclasses.asdict(use))


@admin.command()
def priority(
    name: Annotated[str, typer.Argument(help="A client, or with --batch the id of a batch.")],
    rank: Annotated[Rank, typer.Argument(help="Before, in turn with, or after all others.")],
    batch: Annotated[bool, typer.Option("--batch", help="NAME is a batch.")] = False,
) -> None:
    """When the jobs of a client, also those to come, or the open ones of a batch begin."""
    from inverse_service.service.jobs.model import BULK

    with _store() as store:
        if not batch:
            store.rank_client(name, RANKS[rank])
        elif store.batch(name) is None:
            raise errors.InputError("There is no batch of this id.")
        else:
            _say({"jobs": store.prioritise_batch(name, {-1: -1, 0: BULK, 1: BULK + 1}[RANKS[rank]])})


@admin.command()
def cancel(client: Client) -> None:
    """Cancel all open jobs and batches of a client; what others wait for too goes on."""
    with _store() as store:
        _say({"jobs": len(store.dismiss_client(client))})


@admin.command()
def erase(client: Client) -> None:
    """Forget all jobs, answers and batches of a client that no other one asked for."""
    with _store() as store:
        _say({"jobs": store.erase_client(client)})


@contextlib.contextmanager
def _store() -> Iterator[JobStore]:
    from inverse_service.service.jobs.opening import open_store
    from inverse_service.settings import read_settings

    with contextlib.closing(open_store(read_settings().database, guest=True)) as store:
        yield store


def _say(value: object) -> None:
    exits.write(json.dumps(value, ensure_ascii=False) + "\n")
