"""Fourteen pages at two widths as small pictures: `python -m tests.web.browser.screens` renews
docs/records/screens.
"""

from __future__ import annotations

import argparse
import io
import json
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from tests.serving import serving
from tests.web.browser.conftest import CHROMIUM, QUIET

FOLDER = Path(__file__).parents[3] / "docs" / "records" / "screens"
SIZES = {1280: 900, 390: 844}  # CSS pixels
SCALE, COLORS = 0.5, 64  # of a file: pixels for each CSS pixel, and shades
SETTLED = 2_000  # ms after which a motion has a path behind it
PATIENCE = 180_000  # ms
CART = (
    "m0/2*x'^2 + m1/2*(x'^2 + 2*l1*cos(alpha)*x'*alpha' + l1^2*alpha'^2) + m2/2*(x'^2 + l1^2*alpha'^2 + l2^2*beta'^2"
    " + 2*l1*cos(alpha)*x'*alpha' + 2*l2*cos(beta)*x'*beta' + 2*l1*l2*cos(alpha - beta)*alpha'*beta')"
    " + (m1 + m2)*g*l1*cos(alpha) + m2*g*l2*cos(beta)"
)
# A path, or a document with the page of its answer.
PAGES: dict[str, str | dict[str, Any] | tuple[dict[str, Any], str]] = {
    "home": "/",
    "spring": {"equations": "x'' = -x - c*x'", "parameters": "guess"},
    "well": {"equations": "x'' = x - x^3"},
    "cases": {"equations": "x'' = -abs(x)"},
    "none": {"equations": "x'' = -x - x'^2*y; y'' = -y + x'*y'"},
    "charge": {"equations": "x'' = (1 + x/2)*y'; y'' = -(1 + x/2)*x'"},
    "central": {"equations": "r'' = r*phi'^2 - 1/r^2; phi'' = -2*r'*phi'/r"},
    "blade": {"lagrangian": "(x'^2 + y'^2 + p'^2)/2", "constraints": ["x'*sin(p) - y'*cos(p)"]},
    "long": {"lagrangian": CART, "parameters": "guess"},
    "nearest": (
        {
            "equations": "x'' = -1.02*x + 0.51*y; y'' = 0.248*x - 0.99*y - 0.01*y'",
            "nearest": {"errors": "0.02"},
        },
        "/nearest",
    ),
    "family": (
        {"equations": "x'' = -a*x' + b*y; y'' = c*x - d*y'", "family": True},
        "/family?at.a=2&at.b=0.5&at.c=0.5&at.d=2",
    ),
    "atlas": "/atlas",
    "entry": "/atlas/pendulum-on-viscous-cart",
    "simulate": "/simulate",
}


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=FOLDER)
    folder: Path = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    with (
        serving(time_limit="60", log_level="warning") as (_, address),
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        for width in SIZES:
            for name, page in PAGES.items():
                (folder / f"{name}-{width}.png").write_bytes(screen(browser, address, page, width))
        browser.close()


def screen(
    browser: Browser,
    address: str,
    what: str | dict[str, Any] | tuple[dict[str, Any], str],
    width: int,
) -> bytes:
    """The first screen of a page, or of the answer to a document, as a PNG with few colors."""
    page = browser.new_page(
        viewport={"width": width, "height": SIZES[width]}, device_scale_factor=SCALE
    )
    page.set_default_timeout(PATIENCE)
    document, suffix = what if isinstance(what, tuple) else (what, "")
    path = document
    if not isinstance(path, str):
        sent = page.request.post(f"{address}/v1/solve", data=json.dumps(document), headers={
            "Content-Type": "application/json", "Prefer": "wait=60",
        })  # fmt: skip
        place = sent.headers.get("location") or sent.headers["content-location"]
        path = f"/results/{place.rpartition('/')[2]}{suffix}"
    page.goto(address + path)
    page.wait_for_function(
        "() => !document.querySelector('[data-later], [data-events], #glance > .hint')"
    )
    page.wait_for_timeout(SETTLED)
    found = page.screenshot()
    page.close()
    stream = io.BytesIO()
    image = Image.open(io.BytesIO(found)).convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
    image.save(stream, "PNG", optimize=True)
    return stream.getvalue()


if __name__ == "__main__":
    main()
