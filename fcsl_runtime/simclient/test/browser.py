# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium, through its DevTools protocol over two pipes: no port, no driver."""

from __future__ import annotations

import base64
import contextlib
import fcntl
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
_PATIENCE_S = 60.0
_FLAGS = (
    "--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--no-first-run", "--disable-extensions", "--disable-background-networking", "--disable-component-update",
    "--hide-scrollbars", "--window-size=1400,1000",
)  # fmt: skip


class Page:
    """The one page of a browser."""

    def __init__(self, commands: int, answers: int):
        self._commands, self._answers = commands, answers
        self._held = b""
        self._count = 0
        self._session: dict[str, str] = {}
        #: What scripts threw, and what a policy of the page forbade.
        self.complaints: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = {"sessionId": self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]}
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A command of the DevTools protocol, and its result."""
        self._count += 1
        command = {"id": self._count, "method": method, "params": parameters, **self._session}
        os.write(self._commands, json.dumps(command).encode() + b"\0")
        while True:
            message = self._message()
            if message.get("id") == self._count:
                assert "error" not in message, message
                result: dict[str, Any] = message["result"]
                return result
            if message.get("method") == "Runtime.exceptionThrown":
                self.complaints.append(str(message["params"]["exceptionDetails"]))
            elif message.get("method") == "Log.entryAdded" and message["params"]["entry"]["source"] == "security":
                self.complaints.append(message["params"]["entry"]["text"])

    def open(self, url: str) -> None:
        self.call("Page.navigate", url=url)

    def run(self, expression: str) -> Any:
        """The value of JavaScript, after its promise."""
        found = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def text(self, selector: str) -> str:
        """What a person reads there; empty if it is not there."""
        return str(self.run(f"document.querySelector({json.dumps(selector)})?.innerText ?? ''"))

    def click(self, selector: str) -> None:
        self.wait(f"document.querySelector({json.dumps(selector)}) !== null")
        self.run(f"document.querySelector({json.dumps(selector)}).click()")

    def fill(self, selector: str, text: str) -> None:
        place = f"document.querySelector({json.dumps(selector)})"
        self.run(f"{place}.value = {json.dumps(text)}; {place}.dispatchEvent(new Event('input'))")

    def wait(self, condition: str) -> None:
        """Until the JavaScript is true."""
        deadline = time.monotonic() + _PATIENCE_S
        while not self.run(condition):
            assert time.monotonic() < deadline, f"{condition}: {self.text('body')}\n{self.complaints}"
            time.sleep(0.02)

    def picture(self, path: Path) -> None:
        """Writes a PNG of what is in the window."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._held:
            part = os.read(self._answers, 1 << 16)
            assert part, "the browser has ended"
            self._held += part
        text, _, self._held = self._held.partition(b"\0")
        found: dict[str, Any] = json.loads(text)
        return found


@contextlib.contextmanager
def browsing(folder: Path) -> Iterator[Page]:
    """A browser whose files are in `folder`."""
    assert CHROMIUM is not None
    commands_out, commands_in, answers_out, answers_in = (_above_stdio(end) for end in (*os.pipe(), *os.pipe()))
    redirect = f'exec "$@" 3<&{commands_out} 4>&{answers_in}'
    command = ["bash", "-c", redirect, "bash", CHROMIUM, *_FLAGS, f"--user-data-dir={folder}", "about:blank"]
    with open(folder / "output.txt", "w") as output:
        browser = subprocess.Popen(
            command,
            pass_fds=(commands_out, answers_in),
            stdout=output,
            stderr=output,
            env={**os.environ, "HOME": str(folder)},
        )
    for end in (commands_out, answers_in):
        os.close(end)
    try:
        yield Page(commands_in, answers_out)
    finally:
        os.close(commands_in)  # a browser without commands ends
        os.close(answers_out)
        try:
            browser.wait(10)
        except subprocess.TimeoutExpired:
            browser.kill()
            browser.wait()


def _above_stdio(descriptor: int) -> int:
    """The same file under a number that the shell's redirections do not overwrite."""
    found = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(descriptor)
    return found
