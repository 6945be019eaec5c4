"""No worker, even a busy one, outlives the service, whether it is stopped or killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import httpx
import pytest

from inverse_service.service.jobs.locks import remove_abandoned
from tests.cluster.processes import processes
from tests.serving import COMMAND, HARD, until

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="reads /proc; the kernel's death signal is Linux"
)


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "busy"), [(signal.SIGKILL, True), (signal.SIGTERM, False)])
def test_no_worker_outlives_the_service(ending: signal.Signals, busy: bool, tmp_path: Path) -> None:
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        COMMAND, stdout=subprocess.PIPE, text=True, start_new_session=True, env=environment
    ) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            until(
                lambda: httpx.get(f"{address}/readyz", timeout=30).status_code == 200
            )  # its workers still start
            if busy:
                with pytest.raises(httpx.ReadTimeout):
                    httpx.post(f"{address}/v1/solve", json=HARD, timeout=0.3)
            assert len(processes(process.pid)) > 2
        except BaseException:
            process.kill()  # leaving the block waits for the service, so it must be killed here
            raise
        process.send_signal(ending)
    until(lambda: processes(process.pid) == [])
    for folder in tmp_path.iterdir():  # the next service removes the folder of a killed one
        assert ending == signal.SIGKILL
        os.utime(folder, (0, 0))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(tmp_path))
        remove_abandoned()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_signal_that_comes_before_the_service_serves_ends_it() -> None:
    with subprocess.Popen(COMMAND, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("http://")
            process.send_signal(signal.SIGTERM)
            assert process.wait(15) == 0
        finally:
            process.kill()
