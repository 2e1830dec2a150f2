"""A headless Chromium, driven over its debugging pipe; only the requests that the tests need.

https://chromedevtools.github.io/devtools-protocol; messages are JSON closed by a zero byte.
"""

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from waiting import WAIT_S

#: Options, and words that stand in empty fields, that are not whole.
CUT_OFF = """[...document.querySelectorAll('select, input')].flatMap((e) => {
  if (!e.checkVisibility()) return [];
  const style = getComputedStyle(e);
  const pen = document.createElement('canvas').getContext('2d');
  pen.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
  const arrow = e.options ? 20 : 0;
  const room = e.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
  return (e.options ? [...e.options].map((o) => o.text) : [e.placeholder])
    .filter((text) => pen.measureText(text).width > room - arrow)
    .map((text) => `${e.id || e.name || e.getAttribute('aria-label')}: ${text}`);
})"""

#: Texts whose contrast with what is behind them is below 4.5 (WCAG 2.1, level AA).
PALE = """(() => {
  const parts = (colour) => {
    const found = colour.match(/[\\d.e-]+/g).map(Number);
    const scale = colour.startsWith('color(') ? 1 : 255;
    return [...found.slice(0, 3).map((v) => v / scale), found[3] ?? 1];
  };
  const over = (top, below) => [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3])).concat(1);
  const behind = (e) => {
    const here = parts(getComputedStyle(e).backgroundColor);
    return here[3] === 1 || !e.parentElement ? here : over(here, behind(e.parentElement));
  };
  const light = (c) => [0.2126, 0.7152, 0.0722].reduce((sum, weight, k) =>
    sum + weight * (c[k] <= 0.04045 ? c[k] / 12.92 : ((c[k] + 0.055) / 1.055) ** 2.4), 0);
  const pale = [];
  for (const e of document.querySelectorAll('body *')) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.checkVisibility() || e.closest(':disabled, option, script, .locked')) continue;
    const ground = behind(e);
    const [a, b] = [light(over(parts(getComputedStyle(e).color), ground)), light(ground)];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) pale.push(`${e.tagName} ${e.id} ${e.className} ${e.textContent.trim().slice(0, 30)}: ${contrast.toFixed(2)}`);
  }
  return [...new Set(pale)];
})()"""  # noqa: E501

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def program() -> str | None:
    return next((found for name in PROGRAMS if (found := shutil.which(name))), None)


class Chromium:
    """One browser with a profile of its own in `folder`."""

    def __init__(self, folder: Path) -> None:
        for_browser, self._to = os.pipe()
        self._from, by_browser = os.pipe()
        flags = ["--headless=new", "--remote-debugging-pipe", f"--user-data-dir={folder}",
                 "--no-first-run", "--disable-gpu", "--disable-dev-shm-usage", "--mute-audio",
                 "--disable-background-networking", "--disable-component-update",
                 "--hide-scrollbars", "--force-color-profile=srgb"]  # fmt: skip
        if os.geteuid() == 0:
            flags.append("--no-sandbox")  # the sandbox needs a user that is not root
        # The browser needs the pipe as descriptors 3 and 4. sh can only redirect these from
        # descriptors with one digit.
        script = f'exec "$0" "$@" 3<&{for_browser} 4>&{by_browser}'
        self.process = subprocess.Popen(
            ["bash", "-c", script, program(), *flags, "about:blank"],
            pass_fds=(for_browser, by_browser),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(for_browser)
        os.close(by_browser)
        self._rest = b""
        self._id = 0
        self.events: list[dict] = []

    def __enter__(self) -> "Chromium":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            try:
                self.call("Browser.close")
                self.process.wait(10)
            except (OSError, TimeoutError, subprocess.TimeoutExpired):
                self.process.kill()
                self.process.wait()
        os.close(self._to)
        os.close(self._from)

    def _message(self, end: float) -> dict:
        while b"\0" not in self._rest:
            if not select.select([self._from], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError("the browser does not answer")
            raw = os.read(self._from, 1 << 16)
            if not raw:
                raise OSError("the browser has ended")
            self._rest += raw
        text, self._rest = self._rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method: str, session: str | None = None, **params: object) -> dict:
        self._id += 1
        request = {"id": self._id, "method": method, "params": params}
        if session:
            request["sessionId"] = session
        os.write(self._to, json.dumps(request).encode() + b"\0")
        end = time.monotonic() + WAIT_S
        while True:
            message = self._message(end)
            if message.get("id") != self._id:
                self.events.append(message)
            elif "error" in message:
                raise AssertionError(f"{method}: {message['error']}")
            else:
                return message["result"]

    @contextmanager
    def stopped(self, kinds: tuple[str, ...]) -> Iterator[None]:
        """Send SIGSTOP to this browser's processes of these kinds, and SIGCONT afterwards."""
        found = self.call("SystemInfo.getProcessInfo")["processInfo"]
        # The main process first: it would notice that the others do not run.
        found.sort(key=lambda one: one["type"] != "browser")
        stopped = [one["id"] for one in found if one["type"] in kinds]
        assert stopped
        try:
            for id in stopped:
                os.kill(id, signal.SIGSTOP)
            yield
        finally:
            for id in stopped:
                os.kill(id, signal.SIGCONT)

    def open(self, url: str, wide: int = 1400, high: int = 900) -> "Page":
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page(self, target, session)
        page.call("Runtime.enable")
        page.call("Log.enable")
        page.call("Network.enable")
        page.call("Page.enable")
        page.size(wide, high)
        page.call("Page.navigate", url=url)
        page.until("location.protocol != 'about:' && document.readyState == 'complete'")
        return page


class Page:
    def __init__(self, browser: Chromium, target: str, session: str) -> None:
        self.browser, self.target, self.session = browser, target, session
        self.closed = False

    def call(self, method: str, **params: object) -> dict:
        return self.browser.call(method, self.session, **params)

    def size(self, wide: int, high: int, mobile: bool = False) -> None:
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=wide, height=high, deviceScaleFactor=2 if mobile else 1, mobile=mobile,
        )  # fmt: skip

    def scheme(self, name: str) -> None:
        features = [{"name": "prefers-color-scheme", "value": name}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def js(self, expression: str) -> object:
        """The value of an expression; if that is a promise, the value that fulfils it."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in answer:
            raise AssertionError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def until(self, expression: str, seconds: float = WAIT_S) -> None:
        end = time.monotonic() + seconds
        while not self.js(f"!!({expression})"):
            if time.monotonic() > end:
                text = self.js("document.body.innerText.slice(0, 400)")
                raise AssertionError(f"not within {seconds:g} s: {expression}\n{text}")
            time.sleep(0.05)

    def click(self, selector: str) -> None:
        """Click with the mouse in the middle of the element's visible part."""
        x, y = self.js(
            f"(() => {{ const e = document.querySelector({selector!r});"
            "e.scrollIntoView({block: 'nearest'}); const r = e.getBoundingClientRect();"
            "return [r.x + r.width / 2, r.y + r.height / 2]; })()"
        )
        self.mouse(x, y, "mousePressed")
        self.mouse(x, y, "mouseReleased")

    def mouse(self, x: float, y: float, kind: str) -> None:
        pressed = kind != "mouseMoved"
        self.call(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y,
            button="left" if pressed else "none", clickCount=int(pressed),
        )  # fmt: skip

    def key(self, key: str, code: str, text: str = "") -> None:
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, code=code, text=text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, code=code)

    def type(self, selector: str, text: str) -> None:
        """Replace what is in a field, in one step: the page cannot write there in between."""
        typed = self.js(
            f"(() => {{ const e = document.querySelector({selector!r}); e.focus(); e.select(); "
            f"document.execCommand('insertText', false, {text!r}); "
            "return document.activeElement === e; })()"
        )
        assert typed, f"{selector} cannot have the focus: it is hidden or disabled"

    def choose(self, selector: str, value: str) -> None:
        self.js(f"(() => {{ const e = document.querySelector({selector!r}); e.value = {value!r};"
                "e.dispatchEvent(new Event('change', {bubbles: true})); })()")  # fmt: skip

    def picture(self, file: Path) -> None:
        data = self.call("Page.captureScreenshot", format="png")["data"]
        file.write_bytes(base64.b64decode(data))

    def complaints(self) -> list[str]:
        """Exceptions and errors in the console, including refused resources."""
        self.js("0")  # events that are under way arrive before this answer
        found = []
        for event in self.browser.events:
            if event.get("method") == "Runtime.exceptionThrown":
                details = event["params"]["exceptionDetails"]
                found.append(details.get("exception", {}).get("description", details["text"]))
            elif event.get("method") == "Log.entryAdded":
                entry = event["params"]["entry"]
                if entry["level"] == "error":
                    found.append(f"{entry['text']} {entry.get('url', '')}")
        return found

    def requests(self) -> list[str]:
        return [
            event["params"]["request"]["url"]
            for event in self.browser.events
            if event.get("method") == "Network.requestWillBeSent"
        ]

    def close(self) -> None:
        if self.closed:
            return
        self.closed = True
        self.browser.call("Target.closeTarget", targetId=self.target)


if __name__ == "__main__" and program() is None:
    raise SystemExit(f"{PROGRAMS[0]} not found: apt-get install {PROGRAMS[0]}")
