"""A real browser, for tests of pages, images and videos."""

import asyncio
import base64
import itertools
import shutil
import subprocess
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any, Self

import aiohttp
import pytest

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENCE_S = 60.0

_OPTIONS = (
    "--headless",
    "--no-sandbox",  # tests may run as root
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
    "--hide-scrollbars",
    "--remote-debugging-port=0",
)


class Chromium:
    """A browser without a window, with one page, driven over its DevTools protocol.

    https://chromedevtools.github.io/devtools-protocol. ``said``: errors of its console, what its policy refused too.
    """

    def __init__(self, folder: Path) -> None:
        self.said: list[str] = []
        self._folder = folder
        self._runner = asyncio.Runner()
        self._numbers = itertools.count(1)

    def __enter__(self) -> Self:
        assert PROGRAM
        self._process = subprocess.Popen(
            (PROGRAM, *_OPTIONS, f"--user-data-dir={self._folder}", "about:blank"),
            stderr=subprocess.PIPE,
            text=True,
        )
        assert self._process.stderr
        line = next(line for line in self._process.stderr if "DevTools listening on" in line)
        address = line.rpartition(" ")[2].strip().split("/")[2]
        self._run(self._connect(address))
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")
        return self

    def __exit__(self, *_: object) -> None:
        self._run(self._session.close())
        self._runner.close()
        self._process.terminate()
        self._process.communicate(timeout=PATIENCE_S)

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call one method of the protocol."""
        return self._run(self._send(method, parameters))

    def open(self, address: str) -> None:
        """Go to an address."""
        self.send("Page.navigate", url=address)
        self.wait_for("document.readyState === 'complete'")

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page; a promise is waited for."""
        answer = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, condition: str) -> Any:
        """Wait in the page, from one frame to the next, until an expression is true. Return its value."""
        return self.evaluate(
            f"""new Promise((resolve, reject) => {{
                const end = performance.now() + {1000 * PATIENCE_S};
                const look = () => {{
                    const value = {condition};
                    if (value) resolve(value);
                    else if (performance.now() > end) reject(new Error({condition!r} + document.body.innerText));
                    else setTimeout(look, 20);
                }};
                look();
            }})"""
        )

    def look_like(self, width: int, height: int, scheme: str = "light", scale: float = 1) -> None:
        """Be of that size (px), dark or light."""
        self.send(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=scale,
            mobile=width < 600,
        )
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def image(self, whole: bool = False) -> bytes:
        """A PNG of the page."""
        answer = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        return base64.b64decode(answer["data"])

    def _run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return self._runner.run(asyncio.wait_for(work, 2 * PATIENCE_S))

    async def _connect(self, address: str) -> None:
        self._session = aiohttp.ClientSession()
        async with self._session.get(f"http://{address}/json/list") as answer:
            pages = [target for target in await answer.json() if target["type"] == "page"]
        self._socket = await self._session.ws_connect(pages[0]["webSocketDebuggerUrl"], max_msg_size=0)

    async def _send(self, method: str, parameters: dict[str, Any]) -> dict[str, Any]:
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": parameters})
        while True:
            message = await self._socket.receive_json()
            if message.get("id") == number:
                assert "error" not in message, message
                return dict(message["result"])
            self._hear(message)

    def _hear(self, event: dict[str, Any]) -> None:
        if event["method"] == "Runtime.exceptionThrown":
            self.said.append(str(event["params"]["exceptionDetails"]))
        elif event["method"] == "Log.entryAdded" and event["params"]["entry"]["level"] == "error":
            self.said.append(event["params"]["entry"]["text"])


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    if PROGRAM is None:
        pytest.skip("no Chromium here (Debian: apt-get install chromium)")
    with Chromium(tmp_path_factory.mktemp("chromium")) as browser:
        yield browser


@pytest.fixture
def browser(chromium: Chromium) -> Iterator[Chromium]:
    """The browser; whatever a page complained about fails its test."""
    chromium.said.clear()
    chromium.look_like(1280, 800)
    yield chromium
    chromium.open("about:blank")
    assert chromium.said == []
