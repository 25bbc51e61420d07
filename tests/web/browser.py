"""A headless Chromium that is driven over the DevTools protocol: pages are opened, evaluated, and looked at."""

import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
import time
from contextlib import contextmanager, suppress
from pathlib import Path

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # there is no network but for this machine
)
NODES = "(({state, world}) => [...state.agents.values()].map(({row}) => world.nodeIds[row]))(gamms.views[0].replay)"
"""What gives the nodes of all agents that are shown."""
_SECONDS = 60.0
_LEFT = re.compile("navigated or closed|context was destroyed|Cannot find context")
_FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
_IS_READ = "document.querySelector('.failure') || document.getElementById('viewer')?.dataset.isRead"


class PageLeftError(AssertionError):
    """The page was left for another one before it could answer."""


class Page:
    """A page in the browser."""

    def __init__(self, socket, address):
        self._socket, self._number, self._address = socket, 0, address
        self.messages = []  # that the console and the engine have written
        self.frames = []  # of WebSockets, received: texts and bytes

    def call(self, method, **params):
        """Call a method of the protocol, and return its result."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while True:
            found = json.loads(self._socket.recv(timeout=_SECONDS))
            if found.get("id") == self._number:
                if _LEFT.search(found.get("error", {}).get("message", "")):
                    raise PageLeftError(found)
                assert "error" not in found, found
                return found["result"]
            self._note(found)

    def _note(self, event):
        params = event.get("params", {})
        if event.get("method") == "Runtime.consoleAPICalled":
            self.messages.append(" ".join(str(one.get("value")) for one in params["args"]))
        elif event.get("method") == "Runtime.exceptionThrown":
            self.messages.append(json.dumps(params["exceptionDetails"].get("exception", params["exceptionDetails"])))
        elif event.get("method") == "Log.entryAdded":
            self.messages.append(params["entry"]["text"])
        elif event.get("method") == "Network.webSocketFrameReceived":
            data = params["response"]["payloadData"]
            self.frames.append(data if params["response"]["opcode"] == 1 else base64.b64decode(data))

    def open(self, path, width=1280, height=720, *, touch=False, scale=1, dark=False, until=_IS_READ):
        """Open a file or an address in a window of some size, and wait until the viewer has read it, or else."""
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=touch
        )
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=features)
        self.call("Page.navigate", url="about:blank")  # for another token alone would not load a page again
        self.messages.clear()  # of the last page, which may have lost its server since
        self.frames.clear()
        is_address = str(path).startswith("http")
        self.call("Page.navigate", url=str(path) if is_address else Path(path).absolute().as_uri())
        self.wait(until)
        with suppress(PageLeftError):
            self.wait_for_frame()  # observers of sizes, which move the map, are called before the first frame
        return self

    def reload(self, until="document.readyState === 'complete'"):
        """Load the page again, and wait until a condition holds in the new one: at first the old one still answers."""
        self.value("window.isLeft = true")
        self.call("Page.reload")
        self.wait(f"!window.isLeft && ({until})")

    @contextmanager
    def another(self, *, is_other_browser=False):
        """Open another page in a window of its own; as another browser would, without the cookies of this one."""
        with _connected(_described(self._address, "version")["webSocketDebuggerUrl"]) as socket:
            whole = Page(socket, self._address)
            profile = whole.call("Target.createBrowserContext") if is_other_browser else {}
            target = whole.call("Target.createTarget", url="about:blank", newWindow=True, **profile)["targetId"]
            with _connected(f"ws://{self._address}/devtools/page/{target}") as own:
                yield Page(own, self._address)
            whole.call("Target.closeTarget", targetId=target)

    def value(self, expression):
        """Return the value of an expression in the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait(self, expression):
        """Wait until an expression is true."""
        end = time.monotonic() + _SECONDS
        while not self._is_true(expression):
            assert time.monotonic() < end, f"{expression} did not become true; {self.messages}"
            time.sleep(0.02)

    def _is_true(self, expression):
        try:
            return self.value(f"Boolean({expression})")
        except PageLeftError:
            return False

    def wait_for_frame(self):
        """Wait until the next frame is painted."""
        self.value(_FRAMES)

    def settle(self):
        """Wait until the map rests and is painted sharply."""
        self.value(f"new Promise((done) => setTimeout(done, 200)).then(() => {_FRAMES})")

    def picture(self, path=None):
        """Return a screenshot as PNG, and write it to a file."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if path is not None:
            Path(path).write_bytes(data)
        return data

    def mouse(self, kind, x, y, **more):
        """Send an event of the mouse."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, x, y):
        """Click with the left button."""
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y, button="left", clickCount=1)

    def drag(self, start, end):
        """Drag with the left button."""
        self.mouse("mousePressed", *start, button="left", clickCount=1)
        middle = [(a + b) / 2 for a, b in zip(start, end, strict=True)]
        for place in (middle, end):
            self.mouse("mouseMoved", *place, button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)

    def touch(self, kind, *points):
        """Send an event of fingers."""
        found = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=found)

    def key(self, key, **more):
        """Press a key."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text, **more)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, **more)


@contextmanager
def browser():
    """Start a browser; yield a page, which is used again for each test.

    Raises:
        FileNotFoundError: there is no Chromium.
    """
    if CHROMIUM is None:
        raise FileNotFoundError("There is no command chromium, chromium-browser or google-chrome: install Chromium.")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        environment = {**os.environ, "HOME": folder}
        process = subprocess.Popen(
            [CHROMIUM, *_FLAGS, f"--user-data-dir={folder}/profile", "about:blank"],
            stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            text=True,
            env=environment,
        )
        try:
            for line in process.stderr:
                if found := re.search(r"DevTools listening on ws://([^/]+)/", line):
                    break
            with _connected(f"ws://{found[1]}{_target(found[1])}") as socket:
                yield Page(socket, found[1])
        finally:
            process.terminate()
            process.wait(60)
            process.stderr.close()


def _connected(address):
    from websockets.sync.client import connect

    # Pings would draw from the global `random` while other tests run.
    return connect(address, max_size=None, proxy=None, ping_interval=None)


def _target(address):
    """Return the path of the socket of the first page."""
    pages = [one for one in _described(address, "list") if one["type"] == "page"]
    return "/" + pages[0]["webSocketDebuggerUrl"].split("/", 3)[3]


def _described(address, what):
    """Return what the browser says of itself, or of its pages."""
    from urllib.request import ProxyHandler, build_opener

    with build_opener(ProxyHandler({})).open(f"http://{address}/json/{what}") as answer:
        return json.load(answer)
