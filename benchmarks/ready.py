"""How long after `kill -9` the service accepts questions again: `python -m benchmarks.ready
[--kills N] [--load N] [--weight W]`.

Prints for each kill the seconds until `/readyz` is 200, and the processor seconds of the web
process and of the server that forks its workers until then. `--load` starts so many programs that
only compute. `--weight` puts the service into a control group of that weight, as systemd does for
`CPUWeight=` (shares of 1024 W / 100 in version 1 of control groups); this needs root. The others
keep the weight 100.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx

from tests.web.test_kill import free_port

GROUPS = Path("/sys/fs/cgroup")
BUSY = [sys.executable, "-c", "while True: pass"]


@contextlib.contextmanager
def group(weight: int | None) -> Iterator[Path | None]:
    """The file that takes the processes of a control group of this weight."""
    if weight is None:
        yield None
        return
    is_first = (GROUPS / "cpu").exists()
    folder = GROUPS / ("cpu" if is_first else "") / f"inverse-service-{os.getpid()}"
    folder.mkdir()
    try:
        name, value = ("cpu.shares", 1024 * weight // 100) if is_first else ("cpu.weight", weight)
        (folder / name).write_text(str(value))
        yield folder / "cgroup.procs"
    finally:
        time.sleep(0.5)  # the killed ones are gone by then, and only an empty group can go
        folder.rmdir()


def used(pid: int) -> float:
    """Processor seconds of a process, without its children."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def ready(database: Path, port: int, members: Path | None) -> str:
    """Start the service, wait for /readyz, kill it; a row of the table."""
    settings = {"INVERSE_SERVICE_DATABASE": str(database), "INVERSE_SERVICE_LOG_LEVEL": "error"}
    command = [sys.executable, "-m", "inverse_service", "serve", "--port", str(port)]
    if members is not None:  # the shell enters the group and becomes the service
        command = ["sh", "-c", f'echo $$ > {members}; exec "$@"', "sh", *command]
    began = time.monotonic()
    with (
        subprocess.Popen(command, env=os.environ | settings, stdout=subprocess.DEVNULL) as process,
        httpx.Client(trust_env=False) as client,
    ):
        while True:
            with contextlib.suppress(httpx.TransportError):
                if client.get(f"http://127.0.0.1:{port}/readyz", timeout=60).status_code == 200:
                    break
            time.sleep(0.02)
        taken = time.monotonic() - began
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        spent = sum(used(int(child)) for child in children)
        row = f"| {taken:.1f} | {used(process.pid):.2f} | {spent:.2f} | {os.getloadavg()[0]:.0f} |"
        process.kill()
    return row


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row for each kill."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ready", description=__doc__)
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--load", type=int, default=0)
    parser.add_argument("--weight", type=int)
    chosen = parser.parse_args(arguments)
    print("| ready after, s | web process, s | forking server, s | load average |")
    print("| ---: | ---: | ---: | ---: |")
    with contextlib.ExitStack() as opened:
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        members = opened.enter_context(group(chosen.weight))
        for _ in range(chosen.load):
            opened.callback(opened.enter_context(subprocess.Popen(BUSY)).kill)
        for _ in range(chosen.kills):
            print(ready(folder / "jobs.sqlite", free_port(), members), flush=True)


if __name__ == "__main__":
    main()
