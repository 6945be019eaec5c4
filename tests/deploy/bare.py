"""A bare Debian in a folder, and commands that run in it as on a machine of its own.

debootstrap makes it once, under build/; each test has a copy. Commands have their own mounts, processes and, where
asked for, a network with nothing but loopback.
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
# What a test may take where the machine does ten times its work besides, s.
PATIENCE = 1500
SEARCHED = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def can_bootstrap() -> bool:
    """Root, debootstrap, and the right to have mounts and networks of one's own."""
    if os.geteuid() != 0 or shutil.which("debootstrap") is None:
        return False
    return (
        subprocess.run(["unshare", "--mount", "--net", "--pid", "--fork", "true"], capture_output=True).returncode == 0
    )


def bare_debian(folder: Path) -> Path:
    """A copy of a Debian that has nothing but what debootstrap calls minimal, and authorities that pip believes."""
    if not (KEPT / "etc" / "debian_version").exists():
        shutil.rmtree(KEPT, ignore_errors=True)
        partly = KEPT.with_name(f"bare-debian-{os.getpid()}")
        KEPT.parent.mkdir(exist_ok=True)
        command = ["debootstrap", "--variant=minbase", "--include=ca-certificates", RELEASE, str(partly)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=PATIENCE)
        partly.rename(KEPT)
    copy(KEPT, folder)
    for file in (AUTHORITIES, Path("/etc/resolv.conf")):
        shutil.copyfile(file, folder / file.relative_to("/"))
    return folder


def copy(root: Path, folder: Path) -> None:
    """A root with its devices, owners and rights."""
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
    """What a script of bash prints on both streams; fails with it. `is_alone`: no network but loopback.

    `is_read_only`: all but /proc, /dev, the places that are `writable` and a /tmp of 64 MiB where nothing is executed.
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
    command = ["unshare", "--mount", "--pid", "--fork", "--kill-child", *alone, "bash", "-c", "\n".join(mounts)]
    whole = {"PATH": SEARCHED, "HOME": "/root", "LANG": "C.UTF-8", "PIP_CERT": str(AUTHORITIES), **(environment or {})}
    done = subprocess.run(
        command, env=whole, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        timeout=PATIENCE, cwd="/",
    )  # fmt: skip
    assert done.returncode == 0, f"{done.returncode}\n{done.stdout[-6000:]}"
    return done.stdout
