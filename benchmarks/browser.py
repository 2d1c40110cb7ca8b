"""A saved animation in a real browser without a window: frames per second, work per frame, network requests.

    python benchmarks/browser.py FILE.html [--seconds 3] [--screenshot FILE.png]

Needs Chromium or Chrome on the PATH. The browser is spoken to through a pipe, in its DevTools protocol; no
port is opened. Without a graphics card it paints in software, which is the slower case.
"""

from __future__ import annotations

import argparse
import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
TIMEOUT_S = 60.0
MEASURE = """
(async () => {
  await new Promise(r => setTimeout(r, 500));
  play(true);
  const frames = state.frames, work = state.work, began = performance.now();
  await new Promise(r => setTimeout(r, %f));
  const took = performance.now() - began, drawn = state.frames - frames;
  return {frames_per_s: 1000 * drawn / took, work_ms: (state.work - work) / drawn};
})()
"""


def find() -> str | None:
    """Path of a browser, if there is one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """A headless browser with one page. `requests` lists the addresses it asked for, `errors` what failed."""

    def __init__(self, program: str, size: tuple[int, int] = (1280, 900)) -> None:
        self._profile = tempfile.TemporaryDirectory(prefix="rungwise-browser-", ignore_cleanup_errors=True)
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()
        flags = [
            "--headless", "--remote-debugging-pipe", "--no-first-run", "--disable-gpu",
            "--disable-background-networking", "--disable-component-update", "--hide-scrollbars",
            f"--window-size={size[0]},{size[1]}", f"--user-data-dir={self._profile.name}",
        ]  # fmt: skip
        if hasattr(os, "getuid") and os.getuid() == 0:
            flags.append("--no-sandbox")
        # The protocol reads from descriptor 3 and writes to descriptor 4.
        shell = f'exec "$0" "$@" 3<&{to_browser} 4>&{from_browser}'
        self._process = subprocess.Popen(
            ["bash", "-c", shell, program, *flags, "about:blank"],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        self._pending, self._number, self._session = b"", 0, ""
        self.requests: list[str] = []
        self.errors: list[str] = []
        targets = self.call("Target.getTargets")["targetInfos"]
        target = next(t["targetId"] for t in targets if t["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._write)
        os.close(self._read)
        self._process.terminate()
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._profile.cleanup()

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol and its result. Raises RuntimeError when the browser refuses."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._write, data) :]
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return dict(answer["result"])
            self._note(answer)

    def _next(self) -> dict[str, Any]:
        until = time.monotonic() + TIMEOUT_S
        while b"\0" not in self._pending:
            left = until - time.monotonic()
            if left <= 0.0 or not select.select([self._read], [], [], left)[0]:
                raise RuntimeError("the browser does not answer")
            part = os.read(self._read, 1 << 16)
            if not part:
                raise RuntimeError("the browser has ended")
            self._pending += part
        text, _, self._pending = self._pending.partition(b"\0")
        return dict(json.loads(text))

    def _note(self, event: dict[str, Any]) -> None:
        parameters = event.get("params", {})
        if event.get("method") == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])
        elif event.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif event.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])

    def open(self, file: Path) -> None:
        """Load a file and wait until its script has run."""
        self.call("Log.enable")
        self.call("Page.navigate", url=file.resolve().as_uri())
        until = time.monotonic() + TIMEOUT_S
        while not self.evaluate("document.readyState === 'complete' && document.title !== ''"):
            if time.monotonic() > until:
                raise RuntimeError(f"{file} does not load")
            time.sleep(0.05)

    def evaluate(self, script: str) -> Any:
        """Value of a JavaScript expression, awaited. Raises RuntimeError when it throws."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def key(self, key: str, shift: bool = False) -> None:
        """Press and release a key, as a user would."""
        code = {" ": "Space"}.get(key, key)
        text = key if len(key) == 1 else ""
        held = 8 if shift else 0
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=code, text=text, modifiers=held)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=code, modifiers=held)

    def click(self, x: float, y: float, to: tuple[float, float] | None = None) -> None:
        """Press the left button at a place of the page and release it there, or elsewhere."""
        held: dict[str, Any] = {"button": "left", "clickCount": 1}
        end_x, end_y = (x, y) if to is None else to
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **held)
        if to is not None:
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=end_x, y=end_y, buttons=1, **held)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=end_x, y=end_y, **held)

    def dark(self, on: bool) -> None:
        """The colour scheme that the user prefers."""
        feature = {"name": "prefers-color-scheme", "value": "dark" if on else "light"}
        self.call("Emulation.setEmulatedMedia", features=[feature])

    def screenshot(self, file: Path) -> None:
        """The page as PNG."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the measurement as one JSON object."""
    parser = argparse.ArgumentParser(description="Frames per second and requests of a saved animation.")
    parser.add_argument("file", type=Path)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--screenshot", type=Path)
    options = parser.parse_args(arguments)
    program = find()
    if program is None:
        print(f"no browser: none of {', '.join(NAMES)} is on the PATH", file=sys.stderr)
        return 1
    with Browser(program) as browser:
        browser.open(options.file)
        measured = browser.evaluate(MEASURE % (1000.0 * options.seconds))
        if options.screenshot is not None:
            browser.screenshot(options.screenshot)
        own = options.file.resolve().as_uri()
        outside = [url for url in browser.requests if url != own and not url.startswith("data:")]
        size = options.file.stat().st_size
        print(json.dumps({**measured, "bytes": size, "requests": outside, "errors": browser.errors}))
        return 0 if not outside and not browser.errors else 1


if __name__ == "__main__":
    sys.exit(main())
