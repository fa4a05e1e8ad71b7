"""Latency of scrubbing: from a position that a page sends to the arrival of that frame's arrays.

A server is started, and clients connect to its port with the protocols of page and viewer; they
draw nothing.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import websockets
from rich.table import Table
from websockets.typing import Subprotocol

from benchmarks.made_up_run import CAMERA, RUN, SEQUENCE, cloud, write_run

__all__ = ["run"]

POINTS, NODES, FRAMES = 45_000, (25, 9, 9), 48
POSITIONS, CLIENTS, EACH, THINKING = 150, 10, 25, 0.1
FEW, MANY, GROWN = 500, 5000, 1.05
"""Frames after which the server's memory is compared, and the largest ratio [1]."""
VIEWER = "viser-v1.1.1"
VIEW = {
    "run": RUN,
    "sequence": SEQUENCE,
    "layers": ["measured", "raw", "tool"],
    "colour": "raw",
    "crop": False,
}


def run() -> list[Table]:
    """Measure the latency of one client and of ten, and the server's memory.

    Raises RuntimeError where an array is not that of its frame, or memory grows.
    """
    with tempfile.TemporaryDirectory() as folder:
        write_run(Path(folder), FRAMES, POINTS, NODES)
        with _server(Path(folder)) as (address, process):
            one = asyncio.run(_one(address, POSITIONS))
            ten = asyncio.run(_together(address))
            asyncio.run(_one(address, FEW))
            before = _memory(process.pid)
            asyncio.run(_one(address, MANY - FEW, check=False))
            after = _memory(process.pid)
    table = Table(
        "",
        "positions",
        "median, ms",
        "95 %, ms",
        "most, ms",
        title=f"scrubbing: {POINTS} points and {'x'.join(map(str, NODES))} nodes, event to arrays",
    )
    for name, took in (("1 client", one), (f"{CLIENTS} clients at once", ten)):
        spans = [
            f"{1e3 * value:.0f}" for value in (np.median(took), np.quantile(took, 0.95), took.max())
        ]
        table.add_row(name, str(len(took)), *spans)
    memory = Table("frames", "memory of the server, MB", title="memory")
    memory.add_row(str(FEW), f"{before:.0f}")
    memory.add_row(str(MANY), f"{after:.0f}")
    if after > GROWN * before:
        raise RuntimeError(
            f"the server holds {after:.0f} MB after {MANY} frames, {before:.0f} after {FEW}"
        )
    return [table, memory]


@contextmanager
def _server(folder: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Start a server on a free port; yield its address and process."""
    folders = ["--runs", str(folder / "runs"), "--datasets", str(folder / "datasets")]
    process = subprocess.Popen(
        [sys.executable, "-m", "palpate.app.cli", "serve", "--port", "0", *folders],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "COLUMNS": "200"},
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        if "http://" not in line:
            raise RuntimeError(f"the server did not start: {line}")
        yield line.split("http://")[1].split("/")[0], process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=20)


class _Client:
    """The connections of a page and of its viewer."""

    def __init__(
        self, page: websockets.ClientConnection, viewer: websockets.ClientConnection
    ) -> None:
        self._page, self._viewer = page, viewer

    async def show(self, frame: int, check: bool = True) -> float:
        """Show a frame; return the time [s] from the event to the arrival of its points.

        With `check` all points of the cloud are compared, otherwise the first 30.
        """
        expected = _drawn(frame) if check else _drawn(frame)[:30]
        begin = time.perf_counter()
        await self._page.send(json.dumps({**VIEW, "frame": frame}))
        while True:
            payload = await asyncio.wait_for(self._viewer.recv(), 60)
            if isinstance(payload, bytes) and expected.tobytes() in payload:
                took = time.perf_counter() - begin
                break
        state = json.loads(await asyncio.wait_for(self._page.recv(), 60))
        if (
            "problem" in state
            or state["view"]["frame"] != frame
            or state["drawn"]["points"] != POINTS
        ):
            raise RuntimeError(f"frame {frame} was requested, the server shows {state}")
        return took


def _drawn(frame: int) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    """Return the points (n, 3) [m] that the viewer receives, phantom frame.

    The arithmetic is that of the server.
    """
    if frame not in _KNOWN:
        _KNOWN[frame] = (
            cloud(frame, POINTS).astype(float) @ CAMERA[:3, :3].T + CAMERA[:3, 3]
        ).astype(np.float32)
    return _KNOWN[frame]


_KNOWN: dict[int, np.ndarray[tuple[int, int], np.dtype[np.float32]]] = {}


@asynccontextmanager
async def _client(address: str, name: str) -> AsyncIterator[_Client]:
    import msgspec

    pose = {
        "wxyz": [1.0, 0, 0, 0],
        "position": [0.1, -0.1, 0.2],
        "look_at": [0, 0, 0],
        "up_direction": [0, 0, 1],
    }
    lens = {"fov": 0.6, "near": 0.001, "far": 100.0, "image_height": 555, "image_width": 784}
    options: dict[str, Any] = {"max_size": None, "compression": None, "proxy": None}
    viser, socket = f"ws://{address}/viser/{name}", f"ws://{address}/api/sessions/{name}/socket"
    async with (
        websockets.connect(viser, subprotocols=[Subprotocol(VIEWER)], **options) as viewer,
        websockets.connect(socket, **options) as page,
    ):
        await viewer.send(msgspec.msgpack.encode({"type": "ViewerCameraMessage", **pose, **lens}))
        await asyncio.sleep(0.5)
        yield _Client(page, viewer)


async def _one(
    address: str, positions: int, check: bool = True
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Show random frames one by one, never the same twice in a row; return the latencies [s]."""
    order = np.cumsum(np.random.default_rng(positions).integers(1, FRAMES, positions + 1)) % FRAMES
    async with _client(address, "page-alone") as client:
        await client.show(int(order[0]))
        return np.array([await client.show(int(frame), check) for frame in order[1:]])


async def _together(address: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the latencies [s] of ten clients, which pause 0.1 s after each frame."""

    async def person(number: int) -> list[float]:
        order = np.cumsum(np.random.default_rng(number).integers(1, FRAMES, EACH + 1)) % FRAMES
        async with _client(address, f"page-{number:04d}") as client:
            await client.show(int(order[0]))
            took = []
            for frame in order[1:]:
                took.append(await client.show(int(frame)))
                await asyncio.sleep(THINKING)
            return took

    return np.concatenate(await asyncio.gather(*(person(number) for number in range(CLIENTS))))


def _memory(process: int) -> float:
    """Return the resident memory [MB] of a process."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1e3
