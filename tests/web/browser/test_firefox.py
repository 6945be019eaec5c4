"""The pages in Firefox, as far as its own command line shows them: the driver of the other tests
has no Firefox.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image

FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
ACCENT = (27, 79, 143)  # of what moves, and of the main button
PANEL = (
    760,
    90,
    1190,
    480,
)  # of a picture on a page 1280 pixels wide, without the buttons below it
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(FIREFOX is None, reason="Firefox is not installed"),
]


def accented(image: Image.Image, box: tuple[int, int, int, int]) -> int:
    """How many pixels of a part of the page have the accent's color."""
    pixels = np.asarray(image.convert("RGB").crop(box), dtype=int)
    return int((np.abs(pixels - ACCENT).sum(axis=2) < 40).sum())


def test_firefox_draws_the_picture_of_an_answer(service: str, tmp_path: Path) -> None:
    """The point, its path, and the ring of the start are drawn by the script; without it the panel
    is empty.
    """
    with httpx.Client(base_url=service, timeout=60, headers={"Prefer": "wait=30"}) as client:
        found = client.post("/v1/solve", json={"equations": "x'' = x - x^3"})
    place = (found.headers.get("location") or found.headers["content-location"]).rpartition("/")[2]
    seen = {}
    for name, address in (
        ("answer", f"{service}/results/{place}"),
        ("without", f"{service}/about"),
    ):
        file, profile = tmp_path / f"{name}.png", tmp_path / name
        profile.mkdir()
        command = [
            str(FIREFOX),
            "--headless",
            "--profile",
            str(profile),
            "--window-size",
            "1280,900",
        ]
        subprocess.run(
            [*command, "--screenshot", str(file), address],
            check=True, capture_output=True, timeout=120, env={**os.environ, "HOME": str(tmp_path)},
        )  # fmt: skip
        seen[name] = accented(Image.open(file), PANEL)
    assert seen["answer"] > 300
    assert seen["without"] < 50
