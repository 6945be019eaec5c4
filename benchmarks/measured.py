"""Write measurements into their places on the pages: between `<!-- NAME -->` and `<!-- end of NAME
-->`.

Each names the conditions under which it was measured and the commit that was measured.
"""

from __future__ import annotations

import os
import platform
import re
import subprocess
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]


def commit() -> str:
    """The commit of the program that is measured, "commit 1a2b3c4"; with changes, if files of it
    differ.
    """
    command = ["git", "describe", "--always", "--exclude=*", "--abbrev=8", "--dirty= with changes"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return f"commit {done.stdout.strip()}" if done.returncode == 0 else "no commit"


def conditions(*packages: str) -> str:
    """The conditions of a measurement, with the versions of those of the packages that are
    installed; the load shows how much of the machine other programs used.
    """
    load = f", load average {os.getloadavg()[1]:.1f}" if hasattr(os, "getloadavg") else ""
    versions = "".join(f", {name} {found}" for name in packages if (found := _version(name)))
    python = platform.python_version()
    return f"{commit()}, Python {python}{versions}, {os.cpu_count()} cores{load}"


def _version(package: str) -> str:
    """ "" where it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def put(page: Path, name: str, text: str) -> None:
    """Replace the text in the place. Raises ValueError if the page has no such place."""
    place = re.compile(rf"(?<=<!-- {name} -->\n).*?(?=<!-- end of {name} -->)", re.DOTALL)
    changed, count = place.subn(lambda _: text.rstrip() + "\n", page.read_text(encoding="utf-8"))
    if count != 1:
        raise ValueError(f"{page} has {count} places named {name}")
    page.write_text(changed, encoding="utf-8")
