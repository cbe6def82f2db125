"""Headless Chromium by the WebDriver protocol (Debian's chromium-driver), with nothing but Python's own library.

https://www.w3.org/TR/webdriver2/
"""
import json
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.request

FLAGS = ["--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--force-device-scale-factor=1",
         # WebGL on the processor: test machines have no graphics card.
         "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


class Browser:
    """Use as `with Browser(width, height) as browser`."""

    def __init__(self, width=1400, height=900):
        self.size = (width, height)

    def __enter__(self):
        self.profile = tempfile.mkdtemp(prefix="cairn_browser_")
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.url = f"http://127.0.0.1:{port}"
        self.driver = subprocess.Popen(["chromedriver", f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            self._wait_until_ready()
            options = {"args": FLAGS + [f"--user-data-dir={self.profile}"]}
            capabilities = {"browserName": "chrome", "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
            self.session = ""
            self.session = "/session/" + self._call("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})["sessionId"]
            self.resize(*self.size)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        try:
            if getattr(self, "session", ""):
                self._call("DELETE", self.session)
        finally:
            self.driver.terminate()
            self.driver.wait()
            shutil.rmtree(self.profile, ignore_errors=True)

    def _wait_until_ready(self):
        for _ in range(300):
            try:
                if self._call("GET", "/status")["ready"]:
                    return
            except OSError:
                pass
            time.sleep(0.1)
        raise RuntimeError("chromedriver does not answer")

    def _call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=300) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"]) from None

    def resize(self, width, height):
        """The size of the page itself; real windows are not narrower than 500 pixels, so the device is emulated."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._call("POST", self.session + "/goog/cdp/execute", {"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics})

    def open(self, path):
        self._call("POST", self.session + "/url", {"url": f"file://{path}"})

    def run(self, script, *arguments):
        """The value that the script returns; it may be a promise."""
        return self._call("POST", self.session + "/execute/sync", {"script": script, "args": list(arguments)})

    def wait_for(self, script, seconds=60):
        end = time.monotonic() + seconds
        while not self.run(script):
            if time.monotonic() > end:
                raise AssertionError("waited in vain for: " + script)
            time.sleep(0.1)

    def click(self, selector):
        key = self._call("POST", self.session + "/element", {"using": "css selector", "value": selector})
        self._call("POST", self.session + f"/element/{list(key.values())[0]}/click", {})

    def click_at(self, selector, x, y):
        """A click with the mouse at a place in an element, pixels from its top left corner."""
        self.run("document.querySelector(arguments[0]).scrollIntoView({block: 'center', behavior: 'instant'})", selector)
        left, top = self.run("const r = document.querySelector(arguments[0]).getBoundingClientRect(); return [r.left, r.top]", selector)
        self.move_to(selector, x, y)
        buttons = [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self._pointer([{"type": "pointerMove", "duration": 0, "x": round(left + x), "y": round(top + y)}] + buttons)

    def move_to(self, selector, x, y):
        left, top = self.run("const r = document.querySelector(arguments[0]).getBoundingClientRect(); return [r.left, r.top]", selector)
        self._pointer([{"type": "pointerMove", "duration": 0, "x": round(left + x), "y": round(top + y)}])

    def _pointer(self, actions):
        pointer = {"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"}, "actions": actions}
        self._call("POST", self.session + "/actions", {"actions": [pointer]})

    def log(self):
        """Messages of the console since the last call."""
        return self._call("POST", self.session + "/se/log", {"type": "browser"})
