"""Firefox as the system has it, by Marionette, its own protocol: "length:[0, id, command,
parameters]" over a socket.

The driver of the other tests brings a Firefox of its own, and asks the system's for commands that
it does not have.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PROGRAM = shutil.which("firefox-esr") or shutil.which("firefox")
PREFERENCES = {
    "marionette.port": 0, "browser.shell.checkDefaultBrowser": False, "datareporting.policy.dataSubmissionEnabled": False,
    "browser.startup.page": 0, "app.update.enabled": False, "toolkit.telemetry.enabled": False,
    "network.captive-portal-service.enabled": False, "network.connectivity-service.enabled": False,
    "browser.aboutwelcome.enabled": False, "layout.css.devPixelsPerPx": "1.0",
}  # fmt: skip
PATIENCE = 90.0  # s
PAUSE = 0.05
LEAST = 500  # CSS pixels of a window
_ELEMENT = "element-6066-11e4-a52e-4f735466cecf"  # the key of a reference in WebDriver


class Failed(Exception):
    """A command that Firefox refused, in its words."""


@dataclass
class Firefox:
    """A window of Firefox."""

    connection: socket.socket
    number: int = 0
    received: bytes = field(default=b"")

    def command(self, name: str, **parameters: Any) -> Any:
        """The value of a command of WebDriver; Failed for an error."""
        self.number += 1
        message = json.dumps([0, self.number, name, parameters]).encode()
        self.connection.sendall(b"%d:%s" % (len(message), message))
        _, _, error, value = self.message()
        if error:
            raise Failed(f"{name}: {error['error']}: {error['message']}")
        return value

    def message(self) -> Any:
        """The next message."""
        while b":" not in self.received:
            self._more()
        size, _, self.received = self.received.partition(b":")
        while len(self.received) < int(size):
            self._more()
        text, self.received = self.received[: int(size)], self.received[int(size) :]
        return json.loads(text)

    def _more(self) -> None:
        part = self.connection.recv(1 << 16)
        if not part:
            raise ConnectionError("Firefox has closed its connection.")
        self.received += part

    def go(self, address: str) -> None:
        """Load a page, to the end of its loading."""
        self.command("WebDriver:Navigate", url=address)

    def run(self, script: str, *arguments: Any) -> Any:
        """What a function, written as for Playwright, returns; a promise is awaited."""
        body = (
            "const [done, ...given] = [...arguments].reverse();"
            f" Promise.resolve(({script})(...given.reverse())).then(done)"
        )
        found = self.command(
            "WebDriver:ExecuteAsyncScript", script=body, args=[*arguments], sandbox=None
        )
        return found["value"]

    def until(self, script: str, *arguments: Any) -> Any:
        """The value of a function as soon as it is true."""
        end = time.monotonic() + PATIENCE
        while True:
            if found := self.run(script, *arguments):
                return found
            assert time.monotonic() < end, script
            time.sleep(PAUSE)

    def type(self, selector: str, text: str) -> None:
        """Put a text into a box by the keyboard."""
        found = self.command("WebDriver:FindElement", using="css selector", value=selector)
        element = found["value"][_ELEMENT]
        self.command("WebDriver:ElementClear", id=element)
        self.command("WebDriver:ElementSendKeys", id=element, text=text)

    def resize(self, width: int, height: int = 900) -> None:
        """Make the page this wide; a window is not narrower than LEAST, so a narrower page is magnified."""
        zoom = 1 if width >= LEAST else 2
        self.command("Marionette:SetContext", value="chrome")
        self.command(
            "WebDriver:ExecuteScript",
            args=[zoom],
            script="gBrowser.selectedBrowser.fullZoom = arguments[0]",
        )
        self.command("Marionette:SetContext", value="content")
        edge = self.run("() => [outerWidth - innerWidth, outerHeight - innerHeight]")
        self.command(
            "WebDriver:SetWindowRect",
            width=zoom * (width + edge[0]),
            height=zoom * (height + edge[1]),
        )
        self.until("(width) => innerWidth === width", width)

    def picture(self) -> bytes:
        """The first screen as a PNG."""
        return base64.b64decode(self.command("WebDriver:TakeScreenshot", full=False)["value"])


@contextmanager
def opened(arguments: Sequence[str] = ()) -> Iterator[Firefox]:
    """A new Firefox without a window on the screen, and with nothing kept; closed at the end."""
    assert PROGRAM is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in PREFERENCES.items()]
        (Path(folder) / "user.js").write_text("\n".join(lines), encoding="utf-8")
        command = [
            PROGRAM,
            "--headless",
            "--marionette",
            "-remote-allow-system-access",
            "--no-remote",
            "--profile",
            folder,
        ]
        with subprocess.Popen(
            [*command, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": folder, "MOZ_HEADLESS_WIDTH": "1280", "MOZ_HEADLESS_HEIGHT": "1000"},
        ) as process:  # fmt: skip
            try:
                with socket.create_connection(("127.0.0.1", _port(Path(folder))), 10) as connection:
                    connection.settimeout(PATIENCE)
                    firefox = Firefox(connection)
                    firefox.message()  # its greeting
                    # A form that was sent is sent again by a reload, if one says yes.
                    firefox.command("WebDriver:NewSession", unhandledPromptBehavior="accept")
                    firefox.command("WebDriver:SetTimeouts", script=60_000, pageLoad=60_000)
                    yield firefox
            finally:
                process.terminate()
                process.wait()


def _port(folder: Path) -> int:
    """The port that Firefox has written into its folder."""
    end = time.monotonic() + PATIENCE
    file = folder / "MarionetteActivePort"
    while not (file.exists() and file.read_text().strip()):
        assert time.monotonic() < end, "Firefox has not started."
        time.sleep(PAUSE)
    return int(file.read_text())
