"""No worker outlives the service, whether it is stopped or killed, even one that is busy."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc; the kernel's death signal is Linux")
NAMES = [f"x{k}" for k in range(8)]
TERMS = "+".join(f"{a}*{b}'^2*sin({a}*{b})" for a in NAMES for b in NAMES)
HARD = {"coordinates": NAMES, "equations": dict.fromkeys(NAMES, TERMS)}


def processes(session: int) -> list[int]:
    """Processes of a session that are not zombies."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(its_session) == session and state != "Z":
            found.append(int(folder.name))
    return found


@pytest.mark.parametrize(("ending", "busy"), [(signal.SIGKILL, True), (signal.SIGTERM, False)])
def test_no_worker_outlives_the_service(ending: signal.Signals, busy: bool) -> None:
    command = [sys.executable, "-m", "inverse_service.cli", "serve", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            assert httpx.get(f"{address}/readyz", timeout=30).status_code == 200
            if busy:
                with pytest.raises(httpx.ReadTimeout):
                    httpx.post(
                        f"{address}/v1/solve",
                        content=json.dumps(HARD),
                        timeout=0.3,
                        headers={"Content-Type": "application/json"},
                    )
            assert len(processes(process.pid)) > 2
        except BaseException:
            process.kill()  # leaving the block waits for the service, which nobody else would end
            raise
        process.send_signal(ending)
    end = time.monotonic() + 60
    while processes(process.pid) and time.monotonic() < end:
        time.sleep(0.05)
    assert processes(process.pid) == []
