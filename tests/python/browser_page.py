"""A page in a browser that a test talks to, over the pipe of Chromium's debugging protocol."""

import base64
import fcntl
import json
import os
import select
import subprocess
import time
from pathlib import Path
from typing import Self

import browser


class BrowserPage:
    """An open page: `value` of JavaScript in it, `picture` of it, `drag` with the mouse."""

    def __init__(self, address: str, folder: Path, size: tuple[int, int] = (1280, 720)):
        """Open an address in a window of `size` pixels; the profile lies in `folder`."""
        down, self.to = os.pipe()
        self.back, up = os.pipe()
        words = [browser.BROWSER, *browser.FLAGS, f"--user-data-dir={folder / 'profile'}",
                 "--remote-debugging-pipe", "about:blank"]  # fmt: skip

        def join() -> None:  # the browser reads descriptor 3 and writes 4
            ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 10) for end in (down, up)]
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        self.process = subprocess.Popen(
            words, preexec_fn=join, close_fds=False,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(down)
        os.close(up)
        self.rest, self.count, self.session = b"", 0, ""
        try:
            self.open(address, size)
        except BaseException:
            self.process.kill()
            raise

    def open(self, address: str, size: tuple[int, int]) -> None:
        """Go to an address in the first page of the browser; return when it is read."""
        targets = self.ask("Target.getTargets")["targetInfos"]
        page = next(one for one in targets if one["type"] == "page")
        opened = self.ask("Target.attachToTarget", targetId=page["targetId"], flatten=True)
        self.session = opened["sessionId"]
        self.ask("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1],
                 deviceScaleFactor=1, mobile=False)  # fmt: skip
        self.ask("Page.navigate", url=address)
        self.wait("location.href !== 'about:blank' && document.readyState === 'complete'")

    def __enter__(self) -> Self:
        """Return the page."""
        return self

    def __exit__(self, *fault: object) -> None:
        """Close the browser."""
        try:
            self.ask("Browser.close")
            self.process.wait(30.0)
        except (OSError, RuntimeError, subprocess.TimeoutExpired):
            self.process.kill()
        finally:
            os.close(self.to)
            os.close(self.back)

    def ask(self, method: str, **parameters: object) -> dict:
        """Return what the browser answers to a command of its protocol."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.count:
                if "error" in answer:
                    raise RuntimeError(answer["error"]["message"])
                return answer["result"]

    def message(self) -> dict:
        """Return the next message of the browser."""
        while b"\0" not in self.rest:
            if not select.select([self.back], [], [], browser.LIMIT)[0]:
                raise RuntimeError("the browser does not answer")
            more = os.read(self.back, 1 << 20)
            if not more:
                raise RuntimeError("the browser has ended")
            self.rest += more
        first, _, self.rest = self.rest.partition(b"\0")
        return json.loads(first)

    def value(self, words: str) -> object:
        """Return the value of JavaScript in the page, of a promise when it is kept."""
        done = self.ask("Runtime.evaluate", expression=words, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in done:
            raise RuntimeError(done["result"].get("description", "exception"))
        return done["result"].get("value")

    def wait(self, words: str) -> None:
        """Wait until JavaScript is true in the page."""
        last = time.monotonic() + browser.LIMIT
        while not self.value(words):
            if time.monotonic() > last:
                raise RuntimeError(f"not within {browser.LIMIT} s: {words}")
            time.sleep(0.05)

    def picture(self) -> bytes:
        """Return the page as it is seen, as PNG."""
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"])

    def drag(self, start: tuple[int, int], steps: list[tuple[int, int]], pause: float) -> None:
        """Press at a pixel and go by steps with a pause [s] after each; the button stays down."""
        x, y = start
        self.mouse("mousePressed", x, y)
        for dx, dy in steps:
            x, y = x + dx, y + dy
            self.mouse("mouseMoved", x, y)
            time.sleep(pause)

    def mouse(self, kind: str, x: int, y: int) -> None:
        """Send an event of the left button."""
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1,
                 clickCount=1)  # fmt: skip
