"""A bare Debian in a folder, and commands that run in it as on a separate machine.

debootstrap creates it once, under build/; each test gets a copy. Commands have their own mounts and
processes and, on request, a network with loopback only.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "build" / "bare-debian"
RELEASE = "bookworm"
AUTHORITIES = Path("/etc/ssl/certs/ca-certificates.crt")
# The time limit of a test on a machine with ten times its load, s.
PATIENCE = 1500
SEARCHED = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def can_bootstrap() -> bool:
    """Whether there are root, debootstrap, and permission to create mounts and networks."""
    if os.geteuid() != 0 or shutil.which("debootstrap") is None:
        return False
    return (
        subprocess.run(
            ["unshare", "--mount", "--net", "--pid", "--fork", "true"], capture_output=True
        ).returncode
        == 0
    )


def bare_debian(folder: Path) -> Path:
    """A copy of a minimal Debian from debootstrap, with certificate authorities for pip."""
    if not (KEPT / "etc" / "debian_version").exists():
        shutil.rmtree(KEPT, ignore_errors=True)
        partly = KEPT.with_name(f"bare-debian-{os.getpid()}")
        KEPT.parent.mkdir(exist_ok=True)
        command = [
            "debootstrap",
            "--variant=minbase",
            "--include=ca-certificates",
            RELEASE,
            str(partly),
        ]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=PATIENCE)
        partly.rename(KEPT)
    copy(KEPT, folder)
    for file in (AUTHORITIES, Path("/etc/resolv.conf")):
        shutil.copyfile(file, folder / file.relative_to("/"))
    return folder


def copy(root: Path, folder: Path) -> None:
    """Copy a root with its devices, owners, and permissions."""
    subprocess.run(["cp", "-a", "--reflink=auto", f"{root}/.", str(folder)], check=True)


def run_in(
    root: Path,
    script: str,
    environment: Mapping[str, str] | None = None,
    user: str = "0:0",
    is_alone: bool = False,
    is_read_only: bool = False,
    writable: Sequence[str] = (),
) -> str:
    """Run a bash script and return its output on both streams; fails with that output. `is_alone`:
    only a loopback network.

    `is_read_only`: everything except /proc, /dev, the paths in `writable`, and a /tmp of 64 MiB
    where nothing can be executed.
    """
    place = shlex.quote(str(root))
    mounts = [
        "set -e",
        f"mount --bind {place} {place}",
        f"mount -t proc proc {place}/proc",
        f"mount --rbind /dev {place}/dev",
    ]
    if is_alone:
        mounts.append("ip link set lo up")
    if is_read_only:
        mounts += [f"mount --bind {place}{path} {place}{path}" for path in writable]
        mounts += [
            f"mount -o remount,bind,ro {place}",
            f"mount -t tmpfs -o noexec,size=64m,mode=1777 tmpfs {place}/tmp",
        ]
    shell = shlex.join(["bash", "-euo", "pipefail", "-c", script])
    mounts.append(f"exec chroot --userspec={user} {place} {shell}")
    alone = ["--net"] if is_alone else []
    command = [
        "unshare",
        "--mount",
        "--pid",
        "--fork",
        "--kill-child",
        *alone,
        "bash",
        "-c",
        "\n".join(mounts),
    ]
    whole = {
        "PATH": SEARCHED,
        "HOME": "/root",
        "LANG": "C.UTF-8",
        "PIP_CERT": str(AUTHORITIES),
        **(environment or {}),
    }
    done = subprocess.run(
        command, env=whole, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        timeout=PATIENCE, cwd="/",
    )  # fmt: skip
    assert done.returncode == 0, f"{done.returncode}\n{done.stdout[-6000:]}"
    return done.stdout
