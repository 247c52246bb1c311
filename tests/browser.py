"""A headless Chromium, driven over its debugging pipe with the standard library only."""

from __future__ import annotations

import json
import re
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
OPTIONS = """--headless --no-sandbox --disable-gpu --disable-background-networking --disable-sync --no-first-run
--disable-component-update --disable-default-apps --remote-debugging-pipe""".split()
PATIENCE = 60.0  # s for an answer
REPLACED = ("Inspected target navigated or closed", "Execution context was destroyed.")  # another page took its place


class PageReplaced(Exception):
    """The page went to another address, as a redirection does, before it answered a script."""


class Browser:
    """One page that shows files, runs scripts and takes keys; ``requests`` are the addresses that it loads, and
    ``errors`` what its console and its scripts report."""

    def __enter__(self):
        self.home = tempfile.mkdtemp()
        redirected = 'exec "$0" "$@" 3<&0 4>&1 > /dev/null'  # the browser reads from 3 and writes to 4
        command = ["bash", "-c", redirected, str(CHROMIUM), *OPTIONS, f"--user-data-dir={self.home}", "about:blank"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0,
                                        stderr=subprocess.DEVNULL)
        self.pending = b""
        self.requests = []
        self.errors = []
        self.count = 0
        self.session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        return self

    def __exit__(self, *error):
        self.process.terminate()
        self.process.communicate(timeout=PATIENCE)
        shutil.rmtree(self.home, ignore_errors=True)

    def call(self, method: str, **parameters) -> dict:
        """Send one command of the protocol and return its result."""
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        message |= {"sessionId": self.session} if self.session else {}
        self.process.stdin.write(json.dumps(message).encode() + b"\0")
        while True:
            reply = self._next()
            if reply.get("id") == self.count:
                if reply.get("error", {}).get("message") in REPLACED:
                    raise PageReplaced
                assert "error" not in reply, reply
                return reply["result"]

    def _next(self) -> dict:
        """Return the next message; record the address of a request, and an error of the page."""
        end = time.monotonic() + PATIENCE
        while b"\0" not in self.pending:
            ready = select.select([self.process.stdout], [], [], max(0.0, end - time.monotonic()))[0]
            assert ready, "the browser is silent"
            self.pending += self.process.stdout.read(1 << 20)
        text, _, self.pending = self.pending.partition(b"\0")
        message = json.loads(text)
        match message:
            case {"method": "Network.requestWillBeSent", "params": {"request": {"url": address}}}:
                self.requests.append(address)
            case ({"method": "Runtime.exceptionThrown"} | {"params": {"entry": {"level": "error"}}}
                  | {"method": "Runtime.consoleAPICalled", "params": {"type": "error"}}):
                self.errors.append(message["params"])
        return message

    def show(self, path: Path, fragment: str = "", width: int = 1200, height: int = 900, dark: bool = False) -> None:
        """Open a file in a window of this size and wait until it is loaded."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                  mobile=width < 500)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url="about:blank")
        self.requests.clear()
        self.call("Page.navigate", url=path.resolve().as_uri() + fragment)
        end = time.monotonic() + PATIENCE
        while self.attempt("document.readyState === 'complete' && location.protocol === 'file:'") is not True:
            assert time.monotonic() < end, "the page does not load"
            time.sleep(0.05)

    def check_look(self, width: int, dark: bool) -> None:
        """Check that the page is no wider than a window of this width, and follows the dark mode of the system."""
        page = self.run("location.pathname")
        assert self.run("document.documentElement.scrollWidth") <= width, page
        colour = self.run("getComputedStyle(document.body).backgroundColor")
        assert (max(map(int, re.findall(r"\d+", colour)[:3])) < 128) == dark, page

    def attempt(self, script: str):
        """Return the value of a JavaScript expression, or None if another page replaces the page meanwhile."""
        try:
            return self.run(script)
        except PageReplaced:
            return None

    def run(self, script: str):
        """Return the value of a JavaScript expression in the page."""
        reply = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in reply, reply["exceptionDetails"]
        return reply["result"].get("value")

    def press(self, key: str) -> None:
        """Press and release a key, such as ArrowLeft."""
        codes = {"ArrowLeft": 37, "ArrowUp": 38, "Home": 36, "Tab": 9, "Enter": 13}
        text = {"text": "\r"} if key == "Enter" else {}
        for kind in ("keyDown" if text else "rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=codes[key], **text)
