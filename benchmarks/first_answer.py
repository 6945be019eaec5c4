"""How soon a person sees the first answer of a warm service, in Chromium and in Firefox:
`python -m benchmarks.first_answer [--rounds N] [--browser chromium]`.

Ten systems with other numbers in each round, so that none is known, are asked in three ways:

- link: from the navigation to the start page with the equations in its address until the answer is
  painted next to the form;
- typed: from the last key in the box until the answer is painted next to the form, with the pause of
  0.35 s in which the page waits for another key;
- opened: from the button until the whole answer, with its proof and exports, is painted on its page.

All times are by the browser's own clock; the processor time is that of the service with its workers.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import time
import urllib.parse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from playwright.sync_api import Error, Page, sync_playwright

from benchmarks.ready import used
from tests.serving import serving
from tests.web.browser import firefox
from tests.web.browser.conftest import CHROMIUM, QUIET

PATIENCE = 60.0  # s
SYSTEMS = {
    "damped oscillator": "x'' = -{k}*x - 0.{k}*x'",
    "pendulum": "theta'' = -{k}*sin(theta)",
    "Van der Pol": "u'' = -u + {k}*(1 - u^2)*u'",
    "double well": "s'' = {k}*s - s^3",
    "Kepler, polar": "r'' = r*phi'^2 - {k}/r^2; phi'' = -2*r'*phi'/r",
    "charge": "x'' = (1 + {k}*x)*y'; y'' = -(1 + {k}*x)*x'",
    "two springs": "x'' = -{k}*x + a*y; y'' = a*x - b*y",
    "Hénon and Heiles": "x'' = -x - {k}*x*y; y'' = -y - {k}*x^2/2 + y^2",
    "chain of four": "x1''=x2-{k}*x1; x2''=x1-2*x2+x3; x3''=x2-2*x3+x4; x4''=x3-2*x4",
    "none": "x'' = -{k}*x - x'^2*y; y'' = -y + x'*y'",
}
WARMING = ("x'' = -x - x'/3", "x'' = -x + y; y'' = x - 3*y", "x'' = -x + y'; y'' = x*x'")

# Until an answer to what is in the box is painted: two frames after the page has it.
ANSWERED = """() => new Promise((found) => {
    const has = () => document.querySelector("#live:not(.old) #glance h2");
    const painted = () => requestAnimationFrame(() => requestAnimationFrame(() => found(performance.now())));
    const look = () => (has() ? painted() : setTimeout(look, 5));
    look();
})"""
TYPED = f"""async (text) => {{
    const box = document.getElementById("equations");
    const began = performance.now();
    box.value = text;
    box.dispatchEvent(new Event("input", {{ bubbles: true }}));
    return await ({ANSWERED})() - began;
}}"""
PRESSED = """(text) => {
    const box = document.getElementById("equations");
    box.value = text;
    sessionStorage.began = performance.timeOrigin + performance.now();
    document.querySelector("main form button.main, main form button").form.requestSubmit();
    return true;
}"""
OPENED = """() => {
    if (!document.querySelector("#verdict") || document.querySelector("[data-events]")) return null;
    const [entry] = performance.getEntriesByName("first-contentful-paint");
    return entry ? performance.timeOrigin + entry.startTime - Number(sessionStorage.began) : null;
}"""


class Window(Protocol):
    """A window of a browser."""

    def go(self, address: str) -> None:
        """Load a page."""

    def run(self, script: str, *arguments: Any) -> Any:
        """What a function of the page returns."""


class Chromium:
    """A window of Chromium."""

    def __init__(self, page: Page) -> None:
        self.page = page

    def go(self, address: str) -> None:
        """Load a page."""
        self.page.goto(address)

    def run(self, script: str, *arguments: Any) -> Any:
        """What a function of the page returns."""
        return self.page.evaluate(script, *arguments)


@contextlib.contextmanager
def chromium() -> Iterator[Window]:
    """A new Chromium."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(QUIET))
        yield Chromium(browser.new_page())
        browser.close()


BROWSERS: dict[str, Callable[[], contextlib.AbstractContextManager[Window]]] = {
    "chromium": chromium,
    "firefox": firefox.opened,
}


def spent(pid: int) -> float:
    """Processor seconds of a process and its living descendants."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return used(pid) + sum(spent(int(child)) for child in children)
    except (FileNotFoundError, ProcessLookupError):
        return 0.0


def link(window: Window, address: str, text: str) -> float:
    """From the navigation to the answer, in ms."""
    window.go(f"{address}/?{urllib.parse.urlencode({'equations': text})}")
    return float(window.run(ANSWERED))


def typed(window: Window, address: str, text: str) -> float:
    """From the last key to the answer, in ms."""
    window.go(address)
    window.run(ANSWERED)
    return float(window.run(TYPED, text))


def opened(window: Window, address: str, text: str) -> float:
    """From the button to the page of the answer, in ms."""
    window.go(address)
    window.run(ANSWERED)
    window.run(PRESSED, text)
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        with contextlib.suppress(Error, firefox.Failed):  # the page is just changing
            if found := window.run(OPENED):
                return float(found)
        time.sleep(0.05)
    raise TimeoutError(text)


WAYS = {"link": link, "typed": typed, "opened": opened}


def measured(name: str, rounds: int) -> list[str]:
    """Rows of a browser: a system, the median and the worst time of each way in s, and processor seconds."""
    rows = []
    with (
        serving(time_limit="60", log_level="warning") as (process, address),
        BROWSERS[name]() as window,
    ):
        for text in WARMING:
            opened(window, address, text)
        numbers = iter(range(2, 10 * len(WAYS) * rounds))
        taken: dict[str, dict[str, list[float]]] = {}
        costs: dict[str, list[float]] = {}
        for _ in range(rounds):
            for way, ask in WAYS.items():
                k = next(numbers)
                for system, text in SYSTEMS.items():
                    before = spent(process.pid)
                    found = ask(window, address, text.format(k=k)) / 1000
                    taken.setdefault(system, {}).setdefault(way, []).append(found)
                    costs.setdefault(system, []).append(spent(process.pid) - before)
        for system, ways in taken.items():
            cells = [f"{statistics.median(ways[w]):.2f}, {max(ways[w]):.2f}" for w in WAYS]
            rows.append(
                f"| {name} | {system} | {' | '.join(cells)} | {statistics.median(costs[system]):.2f} |"
            )
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.first_answer", description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--browser", choices=BROWSERS, action="append")
    chosen = parser.parse_args(arguments)
    print("| browser | system | " + " | ".join(WAYS) + " | processor |")
    print("| --- | --- |" + " ---: |" * (len(WAYS) + 1))
    for name in chosen.browser or BROWSERS:
        for row in measured(name, chosen.rounds):
            print(row, flush=True)
    print(
        f"\nmedian, worst of {chosen.rounds}, in s; load average at the end {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    main()
