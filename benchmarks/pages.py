"""How fast the pages are, in Chromium: `python -m benchmarks.pages [--rounds N]`.

Each round starts a service, waits until its workers run, and opens its start page in a browser with
an empty cache: the time from the navigation to the first paint, and from the button to the first
paint that shows a verdict. The other rows ask one service that is warm: the first paint again, the
echo of what is typed (with the pause of 60 ms that waits for the next key), and a moving picture of
ten coordinates, in processor time of the page's thread with its painting, and in frames a second of
a browser that is slowed four times. All other times are by the browser's own clock.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx
from playwright.sync_api import Browser, Page, sync_playwright

from benchmarks.tables import table
from tests.serving import serving, until
from tests.web.browser.conftest import CHROMIUM, QUIET, WIDE

SYSTEMS = ("x'' = -sin(x)", "x'' = -x - 0.1*x'", "x'' = -x + y'; y'' = -y - x'")
FIRST_PAINT = """() => new Promise(resolve => new PerformanceObserver((list, observer) => {
    observer.disconnect(); resolve(list.getEntries()[0].startTime);
}).observe({type: 'paint', buffered: true}))"""
# The time of the first painted page with a verdict; later pages may add other parts.
SEEN = """new PerformanceObserver((list, observer) => {
    observer.disconnect();
    const at = performance.timeOrigin + list.getEntries()[0].startTime;
    const look = () => { if (document.querySelector('#verdict')) sessionStorage.seen ??= at; };
    document.readyState === 'loading' ? addEventListener('DOMContentLoaded', look) : look();
}).observe({type: 'paint', buffered: true})"""
# The time of that paint, which may be after the verdict arrives.
PAINTED = """() => new Promise(resolve => {
    const look = () => sessionStorage.seen ? resolve(sessionStorage.seen) : setTimeout(look, 10);
    look();
})"""
ECHO = """text => new Promise(resolve => {
    const box = document.getElementById('equations');
    box.value = text;
    const began = performance.now();
    new MutationObserver((_, observer) => { observer.disconnect(); resolve(performance.now() - began); })
        .observe(document.getElementById('understood'), {childList: true});
    box.dispatchEvent(new Event('input', {bubbles: true}));
})"""
PLAY = """() => new Promise((done) => {
    document.querySelector("[data-motion]").motion.play(true);
    const times = [];
    const next = (now) => {
        times.push(now);
        if (now - times[0] < 5000) requestAnimationFrame(next); else done(times);
    };
    requestAnimationFrame(next);
})"""
NAMES = [f"x{k}" for k in range(1, 11)]
TEN = "+".join(f"{name}'^2/2-{name}^2-{name}^4/20" for name in NAMES)


@contextlib.contextmanager
def opened(browser: Browser) -> Iterator[tuple[str, Page]]:
    """The address of a new service whose workers run, and an empty page of a browser without cache."""
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(log_level="warning", database=str(Path(folder, "jobs.sqlite"))) as (_, address),
    ):
        until(lambda: httpx.get(f"{address}/readyz").json().get("workers") == "running", pause=0.1)
        context = browser.new_context(base_url=address, viewport=WIDE)
        yield address, context.new_page()
        context.close()


def fresh(browser: Browser, equations: str) -> tuple[float, float]:
    """The first paint of a new service, and its first verdict from the button on, in ms."""
    with opened(browser) as (_, page):
        page.add_init_script(SEEN)
        page.goto("/")
        paint = float(page.evaluate(FIRST_PAINT))
        page.get_by_label("Equations", exact=True).fill(equations)
        began = float(page.evaluate("Date.now()"))
        page.get_by_role("button", name="Open the answer").click()
        page.locator("#verdict").wait_for()
        return paint, float(page.evaluate(PAINTED)) - began


def first_paints(page: Page, count: int) -> list[float]:
    """From the navigation to the start page to its first paint, in ms."""
    found = []
    for _ in range(count):
        page.goto("/")
        found.append(float(page.evaluate(FIRST_PAINT)))
    return found


def echoes(page: Page, count: int) -> list[float]:
    """From a change of the text to the formula beside it, in ms."""
    page.goto("/")
    page.locator("#understood .formula").first.wait_for()
    texts = [f"x'' = -{k}*x + y'\ny'' = -{k}*y - x'" for k in range(2, 2 + count)]
    return [float(page.evaluate(ECHO, text)) for text in texts]


def frames(page: Page, address: str) -> tuple[float, float]:
    """Processor time of a frame of ten coordinates in ms, and frames a second of a browser that is
    slowed four times.
    """
    document = {"lagrangian": TEN, "coordinates": NAMES}
    answer = httpx.post(f"{address}/v1/solve", json=document, timeout=600)
    while answer.status_code == 202:  # a job
        time.sleep(0.2)
        answer = httpx.get(address + answer.headers["location"], timeout=600)
    place = answer.headers.get("location") or answer.headers["content-location"]
    page.goto("/results/" + place.rpartition("/")[2])
    picture = page.locator(".motion svg:not(.blank)").first
    picture.wait_for()
    picture.scroll_into_view_if_needed()
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def used() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return 1000 * float(next(one["value"] for one in metrics if one["name"] == "TaskDuration"))

    before = used()
    count = len(page.evaluate(PLAY))
    cost = (used() - before) / count
    session.send("Emulation.setCPUThrottlingRate", {"rate": 4})
    slowed = page.evaluate(PLAY)
    session.send("Emulation.setCPUThrottlingRate", {"rate": 1})
    return cost, 1000 * (len(slowed) - 1) / (slowed[-1] - slowed[0])


def row(name: str, found: Sequence[float], unit: str = "ms") -> list[str]:
    """A row of the table; what is worst depends on the unit."""
    worst = max(found) if unit == "ms" else min(found)
    digits = 1 if worst < 100 else 0
    return [name, f"{statistics.median(found):.{digits}f} {unit}", f"{worst:.{digits}f} {unit}"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pages", description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    rounds = parser.parse_args(arguments).rounds
    rows = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        paints = []
        for text in SYSTEMS:
            found = [fresh(browser, text) for _ in range(rounds)]
            paints += [paint for paint, _ in found]
            rows.append(row(f"a new service, `{text}`", [verdict for _, verdict in found]))
        rows.insert(0, row("a new service, first paint", paints))
        with opened(browser) as (address, page):
            first_paints(page, 1)
            rows.append(row("first paint", first_paints(page, rounds)))
            rows.append(row("echo of what is typed", echoes(page, rounds)))
            costs, rates = zip(*(frames(page, address) for _ in range(rounds)), strict=True)
            rows.append(row("a frame of ten coordinates, processor time", costs))
            rows.append(row("the same at a quarter of the speed", [4 * cost for cost in costs]))
            rows.append(row("ten coordinates, slowed four times", rates, "frames/s"))
    print(table(["what is shown", "median", "worst"], rows))
    print(f"median, worst of {rounds}; load average at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
