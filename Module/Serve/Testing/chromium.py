# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Chromium without a window, driven over its DevTools protocol by aiohttp."""

from __future__ import annotations

import asyncio
import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Optional

START_SECONDS = 60


def program() -> Optional[str]:
    return os.environ.get("BIGUS_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")


class Browser:
    """One page; `problems` are its errors, those of the console among them."""

    def __init__(self) -> None:
        self.problems: list[str] = []
        self._answers: dict[int, asyncio.Future] = {}
        self._count = 0
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)

    async def __aenter__(self) -> "Browser":
        import aiohttp

        # Rendered by the processor; the sandbox needs a user other than root. Nothing but the page under test is loaded.
        self._process = subprocess.Popen(
            [program(), "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
             "--disable-background-networking", "--disable-component-update", "--window-size=1400,900",
             "--remote-debugging-port=0", f"--user-data-dir={self._folder.name}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # fmt: skip
        tells = Path(self._folder.name, "DevToolsActivePort")
        for _ in range(START_SECONDS * 10):
            if tells.exists() and tells.read_text().count("\n"):
                break
            await asyncio.sleep(0.1)
        port = tells.read_text().split()[0]
        self._session = aiohttp.ClientSession()
        async with self._session.get(f"http://127.0.0.1:{port}/json") as answer:
            page = next(one for one in await answer.json() if one["type"] == "page")
        self._socket = await self._session.ws_connect(page["webSocketDebuggerUrl"], max_msg_size=0)
        self._reader = asyncio.ensure_future(self._read())
        for domain in ("Page", "Runtime", "Log", "Network"):
            await self.call(f"{domain}.enable")
        return self

    async def __aexit__(self, *_: Any) -> None:
        self._reader.cancel()
        await self._socket.close()
        await self._session.close()
        self._process.terminate()
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()

    async def _read(self) -> None:
        async for message in self._socket:
            told = json.loads(message.data)
            what, found = told.get("method"), told.get("params", {})
            if told.get("id") in self._answers:
                self._answers.pop(told["id"]).set_result(told)
            elif what == "Runtime.exceptionThrown":
                self.problems.append(json.dumps(found["exceptionDetails"])[:500])
            elif what == "Runtime.consoleAPICalled" and found["type"] in ("error", "warning", "assert"):
                self.problems.append(json.dumps(found["args"])[:500])
            elif what == "Log.entryAdded" and found["entry"]["level"] in ("error", "warning"):
                self.problems.append(found["entry"]["text"])

    async def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._count += 1
        answer = self._answers[self._count] = asyncio.get_running_loop().create_future()
        await self._socket.send_str(json.dumps({"id": self._count, "method": method, "params": parameters}))
        told = await asyncio.wait_for(answer, START_SECONDS)
        if "error" in told:
            raise RuntimeError(f"{method}: {told['error']}")
        return told["result"]

    async def evaluate(self, script: str) -> Any:
        told = await self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in told:
            raise RuntimeError(json.dumps(told["exceptionDetails"])[:500])
        return told["result"].get("value")

    async def until(self, script: str, seconds: float = 30) -> Any:
        """The script's value as soon as it is true."""
        for _ in range(int(seconds * 20)):
            value = await self.evaluate(script)
            if value:
                return value
            await asyncio.sleep(0.05)
        raise AssertionError(f"after {seconds} s still not: {script}")

    async def mouse(self, kind: str, x: float, y: float, pressed: bool = False, **more: Any) -> None:
        button = "left" if pressed or kind == "mouseReleased" else "none"
        await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=int(pressed),
                        clickCount=1 if kind != "mouseMoved" else 0, **more)  # fmt: skip

    async def screen(self, width: int, height: int, phone: bool = False) -> None:
        await self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        await self.call("Emulation.setTouchEmulationEnabled", enabled=phone, maxTouchPoints=5)

    async def fingers(self, *ways: list[tuple[float, float]]) -> None:
        """Each finger goes down at the first place of its way, along it, and up at its end; all have as many places."""
        for k, places in enumerate(zip(*ways)):
            points = [{"x": x, "y": y, "id": finger} for finger, (x, y) in enumerate(places)]
            await self.call("Input.dispatchTouchEvent", type="touchMove" if k else "touchStart", touchPoints=points)
        await self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    async def key(self, key: str, modifiers: int = 0) -> None:
        for kind in ("keyDown", "keyUp"):
            await self.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers)

    async def picture(self, path: str) -> None:
        told = await self.call("Page.captureScreenshot", format="png")
        Path(path).write_bytes(base64.b64decode(told["data"]))
