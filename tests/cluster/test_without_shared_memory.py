"""The tests of the cluster pass if /dev/shm is not writable, as in a chroot or a restricted
container.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ALONE = ["unshare", "--map-root-user", "--mount"]
READ_ONLY = 'mount -t tmpfs -o ro,size=1m tmpfs /dev/shm && exec "$@"'


def can_mount() -> bool:
    try:
        return (
            subprocess.run(
                [*ALONE, "sh", "-c", READ_ONLY, "sh", "true"], capture_output=True
            ).returncode
            == 0
        )
    except FileNotFoundError:
        return False


@pytest.mark.nightly
@pytest.mark.skipif(not can_mount(), reason="needs mounts of its own")
def test_the_cluster_needs_no_shared_memory() -> None:
    tests = [
        sys.executable,
        "-m",
        "pytest",
        "-n",
        "0",
        "-p",
        "no:cacheprovider",
        "tests/cluster/test_cluster.py",
    ]
    command = [*ALONE, "sh", "-c", READ_ONLY, "sh", *tests]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=600, cwd=Path(__file__).parents[2]
    )
    assert done.returncode == 0, done.stdout[-4000:]
    assert " passed" in done.stdout
