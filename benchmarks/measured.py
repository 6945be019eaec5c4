"""Write measurements into their places on the pages: between `<!-- NAME -->` and `<!-- end of NAME -->`."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path


def conditions() -> str:
    """The conditions of a measurement; the load shows how much of the machine other programs used."""
    load = f", load average {os.getloadavg()[1]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"Python {platform.python_version()}, {os.cpu_count()} cores{load}"


def put(page: Path, name: str, text: str) -> None:
    """Replace the text in the place. Raises ValueError if the page has no such place."""
    place = re.compile(rf"(?<=<!-- {name} -->\n).*?(?=<!-- end of {name} -->)", re.DOTALL)
    changed, count = place.subn(lambda _: text.rstrip() + "\n", page.read_text(encoding="utf-8"))
    if count != 1:
        raise ValueError(f"{page} has {count} places named {name}")
    page.write_text(changed, encoding="utf-8")
