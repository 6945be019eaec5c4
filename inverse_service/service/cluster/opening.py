"""The cluster at an address, as an Executor. Nothing of Dask is loaded before this is asked for."""

from __future__ import annotations

from importlib.util import find_spec

from inverse_service.errors import InputError
from inverse_service.service.jobs.workers import Executor

SCHEMES = ("tcp://", "tls://", "ucx://", "ws://", "wss://")


def open_cluster(address: str, memory_limit: int) -> Executor:
    """The executor, which connects when it is started; `memory_limit` is in MiB a process.

    Raises InputError: the address is none, or the extra `dask` is not installed.
    """
    if not address.startswith(SCHEMES):
        raise InputError("The address of a cluster must be that of a Dask scheduler, such as tcp://host:8786.")
    if find_spec("distributed") is None:
        raise InputError("A cluster needs the extra: pip install 'inverse-service[dask]'.")
    from inverse_service.service.cluster.front import Cluster

    return Cluster(address, memory_limit)
