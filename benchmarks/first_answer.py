"""How soon a person sees the first answer of a warm service, in Chromium and in Firefox:
`python -m benchmarks.first_answer [--rounds N] [--browser chromium]`.

Thirty systems with other numbers in each round, so that none is known, are asked in three ways:

- link: from the navigation to the start page with the equations in its address until the answer is
  painted next to the form;
- typed: from the last key in the box until the answer is painted next to the form, with the pause of
  0.35 s in which the page waits for another key;
- by the button: `opened` is the time until a page with the verdict is painted, `whole` that until
  the whole answer, with its proof and exports, is painted there.

All times are by the browser's own clock; the processor time is that of the service with its
workers.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import statistics
import tempfile
import time
import urllib.parse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from playwright.sync_api import Error, Page, sync_playwright

from tests.serving import serving
from tests.web.browser import firefox
from tests.web.browser.conftest import CHROMIUM, QUIET

PATIENCE = 60.0  # s
SYSTEMS = {
    "damped oscillator": "x'' = -{k}*x - 0.{k}*x'",
    "damped, with letters": "x'' = -{k}*x - c*x'",
    "quadratic drag": "x'' = -{k}*x'^2",
    "fall with drag": "y'' = -g + {k}*y'^2",
    "pendulum": "theta'' = -{k}*sin(theta)",
    "double well": "s'' = {k}*s - s^3",
    "Van der Pol": "u'' = -u + {k}*(1 - u^2)*u'",
    "Rayleigh": "u'' = -u + {k}*(u' - u'^3/3)",
    "forced": "x'' = -x + cos({k}*t)",
    "Mathieu": "x'' = -({k} + cos(2*t)/5)*x",
    "Emden and Fowler": "u'' = -2*u'/t - u^{k}",
    "two halves": "x'' = -{k}*abs(x)",
    "a function": "x'' = {k}*F(x)*x'^2",
    "Kepler, polar": "r'' = r*phi'^2 - {k}/r^2; phi'' = -2*r'*phi'/r",
    "Kepler": "x'' = -{k}*x/(x^2 + y^2)^(3/2); y'' = -{k}*y/(x^2 + y^2)^(3/2)",
    "orbit with drag": "r'' = r*phi'^2 - {k}/r^2 - r'/9; phi'' = -2*r'*phi'/r - phi'/9",
    "charge": "x'' = (1 + {k}*x)*y'; y'' = -(1 + {k}*x)*x'",
    "charge, two fields": "x'' = {k}*y'; y'' = -{k}*x' + E",
    "charge in space": "x'' = {k}*y'; y'' = -{k}*x'; z'' = -1",
    "thrown": "x'' = -{k}*x'; y'' = -9.81 - {k}*y'",
    "two springs": "x'' = -{k}*x + a*y; y'' = a*x - b*y",
    "four letters": "x'' = -a*x + {k}*b*y; y'' = c*x - d*y",
    "gyroscope": "x'' = -x + {k}*y'; y'' = -y - {k}*x'",
    "Hénon and Heiles": "x'' = -x - {k}*x*y; y'' = -y - {k}*x^2/2 + y^2",
    "great circles": "a'' = {k}*sin(a)*cos(a)*b'^2; b'' = -2*cos(a)*a'*b'/sin(a)",
    "three angles": "a'' = {k}*(b - a); b'' = {k}*(a - 2*b + c); c'' = {k}*(b - c)",
    "chain of four": "x1''=x2-{k}*x1; x2''=x1-2*x2+x3; x3''=x2-2*x3+x4; x4''=x3-2*x4",
    "chain of five": "a''=b-{k}*a; b''=a-2*b+c; c''=b-2*c+d; d''=c-2*d+e; e''=d-{k}*e",
    "none": "x'' = -{k}*x - x'^2*y; y'' = -y + x'*y'",
    "none, products": "x'' = -{k}*y*x'^2; y'' = x'*y'",
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
# The times of the first verdict and of the whole answer, as far as they are known, by the page's
# clock; what came with the page was painted with it.
OPENED = """() => {
    const verdict = document.querySelector("#verdict");
    const [entry] = performance.getEntriesByName("first-contentful-paint");
    if (!verdict || !entry) return null;
    const is_decided = !verdict.innerText.includes("being decided");
    const is_whole = !document.querySelector("[data-events]");
    const began = performance.timeOrigin - Number(sessionStorage.began);
    return [is_decided, is_whole, began + entry.startTime, began + performance.now()];
}"""
PAUSE = 0.05  # s between two looks


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
    """Processor seconds of a process and its descendants, those that ended included."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        own = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
        return own + sum(spent(int(child)) for child in children)
    except (FileNotFoundError, ProcessLookupError):
        return 0.0


def link(window: Window, address: str, text: str) -> list[float]:
    """From the navigation to the answer, in ms."""
    window.go(f"{address}/?{urllib.parse.urlencode({'equations': text})}")
    return [float(window.run(ANSWERED))]


def typed(window: Window, address: str, text: str) -> list[float]:
    """From the last key to the answer, in ms."""
    window.go(address)
    window.run(ANSWERED)
    return [float(window.run(TYPED, text))]


def opened(window: Window, address: str, text: str) -> list[float]:
    """From the button to the verdict and to the whole answer, in ms."""
    window.go(address)
    window.run(ANSWERED)
    window.run(PRESSED, text)
    end, came, is_first = time.monotonic() + PATIENCE, dict[int, float](), True
    while time.monotonic() < end:
        with contextlib.suppress(Error, firefox.Failed):  # the page is just changing
            if found := window.run(OPENED):
                *are_there, painted, moment = found
                for place, is_there in enumerate(are_there):
                    if is_there:
                        came.setdefault(place, painted if is_first else moment)
                if len(came) == len(are_there):
                    return [came[place] for place in range(len(are_there))]
                is_first = False
        time.sleep(PAUSE)
    raise TimeoutError(text)


WAYS = {("link",): link, ("typed",): typed, ("opened", "whole"): opened}
COLUMNS = [name for names in WAYS for name in names]


def measured(name: str, rounds: int) -> list[str]:
    """Rows of a browser: a system, the median and the worst time of each way in s, and processor seconds."""
    rows = []
    with (
        # Of its own: the user's file knows the answers of earlier runs.
        tempfile.TemporaryDirectory() as folder,
        serving(
            time_limit="60", log_level="warning", database=str(Path(folder, "jobs.sqlite"))
        ) as (process, address),
        BROWSERS[name]() as window,
    ):
        for text in WARMING:
            opened(window, address, text)
        numbers = iter(range(2, 10 * len(WAYS) * rounds))
        taken: dict[str, dict[str, list[float]]] = {}
        costs: dict[str, list[float]] = {}
        for _ in range(rounds):
            for names, ask in WAYS.items():
                k = next(numbers)
                for system, text in SYSTEMS.items():
                    before = spent(process.pid)
                    found = ask(window, address, text.format(k=k))
                    for column, value in zip(names, found, strict=True):
                        taken.setdefault(system, {}).setdefault(column, []).append(value / 1000)
                    costs.setdefault(system, []).append(spent(process.pid) - before)
        for system, ways in taken.items():
            cells = [f"{statistics.median(ways[w]):.2f}, {max(ways[w]):.2f}" for w in COLUMNS]
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
    print("| browser | system | " + " | ".join(COLUMNS) + " | processor |")
    print("| --- | --- |" + " ---: |" * (len(COLUMNS) + 1))
    for name in chosen.browser or BROWSERS:
        for row in measured(name, chosen.rounds):
            print(row, flush=True)
    print(
        f"\nmedian, worst of {chosen.rounds}, in s; load average at the end {os.getloadavg()[0]:.1f}"
    )


if __name__ == "__main__":
    main()
