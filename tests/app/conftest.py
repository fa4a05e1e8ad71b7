"""A small run in the format of a real one, and a server for it."""

from __future__ import annotations

import json
import signal
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from browsing import CHROMIUM, FLAGS, Page
from scipy.spatial.transform import Rotation
from small_dataset import SIZE, write_valid_dataset

from palpate.app.jobs.tasks import TARGETS
from palpate.app.main import create_app
from palpate.app.server.serve import Server
from palpate.app.settings import Settings
from palpate.foundation.frames import Transform
from palpate.mesh.box_mesh import GridSpec, box_mesh

RUN = "small-block-1"
FRAMES = 5
CAMERA = (
    Transform(Rotation.from_euler("xyz", [2.5, 0.1, 0.2]).as_matrix(), np.array([0.01, 0.02, 0.35]))
    .inverse()
    .matrix
)
"""phantom_from_camera of the small dataset"""
REPORT: dict[str, Any] = {
    "format": 1,
    "dataset": "small-block",
    "verdict": "found",
    "causes": [
        {
            "effect": "stiff_inclusion",
            "probability": 0.98,
            "parameters": {
                "x": {"value": 0.0101, "unit": "m", "low": 0.0088, "high": 0.0115},
                "y": {"value": 0.0, "unit": "m", "low": -0.001, "high": 0.001},
                "z": {"value": 0.0258, "unit": "m", "low": 0.025, "high": 0.027},
                "radius": {"value": 0.0075, "unit": "m", "low": 0.007, "high": 0.008},
                "stiffness_ratio": {"value": 6.0, "unit": "1", "low": 4.0, "high": 9.0},
            },
        }
    ],
    "ranking": [{"effect": "poisson_ratio", "probability": 0.01, "error_removed": 0.22}],
    "ambiguity_map": [
        {
            "effect": "tool_radius",
            "limits": [{"parameter": "radius", "unit": "m", "change": 1.2e-4}],
            "typical": {"parameter": "radius", "unit": "m", "change": 1.2e-4},
            "at": {},
            "alike": [
                {"effect": "tool_offset", "share": 0.83},
                {"effect": "gravity", "share": 0.1},
            ],
        },
        {
            "effect": "stiff_inclusion",
            "limits": [{"parameter": "stiffness_ratio", "unit": "1", "factor": 1.42}],
            "typical": {"parameter": "stiffness_ratio", "unit": "1", "factor": None},
            "at": {"x": {"value": 0.01, "unit": "m"}},
            "alike": [{"effect": "tool_radius", "share": 0.2}],
        },
        {
            "effect": "base_detachment",
            "limits": [{"share": 0.454}],
            "typical": {"share": 0.6},
            "at": {"edge": {"value": "-x", "unit": ""}, "extent": {"value": 0.014, "unit": "m"}},
            "alike": [],
        },
    ],
    "controls": [
        {
            "control": "clock shifted",
            "effect": "stiff_inclusion",
            "gain_nats": 1.2,
            "true_nats": 90.0,
            "kept": 0.0133,
            "alike": 0.01,
            "passed": True,
        },
        {
            "control": "geometry mirrored",
            "effect": "stiff_inclusion",
            "gain_nats": 63.0,
            "true_nats": 90.0,
            "kept": 0.7,
            "alike": 0.2,
            "passed": False,
        },
        {
            "control": "paths swapped",
            "effect": "stiff_inclusion",
            "gain_nats": 80.0,
            "true_nats": 90.0,
            "kept": 0.8889,
            "alike": 0.9,
            "passed": None,
            "why": "with these motions stiff_inclusion would look 90 % as it does with the true "
            "ones",
        },
    ],
    "next_probe": [
        {
            "kind": "top",
            "place": [0.012, -0.008, 0.0358],
            "direction": [0.0, 0.0, -1.0],
            "depth": 0.006,
            "separates": ["stiff_inclusion", "tool_radius"],
            "nats": 17.2,
            "probability": 0.94,
            "text": "press 6 mm deep on the top at (12, -8) mm",
        },
        {
            "kind": "measurement",
            "separates": ["gravity", "geometry_scale"],
            "text": "measure the block with a calliper",
        },
    ],
    "not_identifiable": [
        {
            "effect": "young_modulus",
            "why": "the shape does not depend on it",
            "measure_instead": "a force",
        }
    ],
    "unexplained": {"fraction": 0.04, "where": "nowhere", "when": "never"},
    "gain": {
        "split": "test",
        "unit": "mm",
        "baseline": 0.4,
        "extended": 0.21,
        "noise_floor": 0.19,
        "reducible_removed": {"value": 0.93, "low": 0.9, "high": 0.96},
        "paper_metric": {"baseline": 2.4, "extended": 1.3},
    },
}


@dataclass(frozen=True)
class Place:
    """Folders of one server: runs with one run in it, and datasets with one dataset."""

    runs: Path
    datasets: Path

    @property
    def settings(self) -> Settings:
        return Settings(runs=self.runs, datasets=self.datasets, preload=())


@pytest.fixture
def place(tmp_path: Path) -> Place:
    return make_place(tmp_path)


@pytest.fixture(scope="module")
def shared_place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    return make_place(tmp_path_factory.mktemp("place"))


@pytest.fixture(scope="module")
def client(shared_place: Place) -> Iterator[httpx.Client]:
    """A client of a real server on a free port, shared by the tests of a module."""
    with running(shared_place.settings) as found:
        yield found


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: Any, client: httpx.Client) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme="light")
    page = Page(context.new_page(), client)
    yield page
    context.close()
    assert page.trouble == []


@pytest.fixture(scope="session")
def serve() -> Any:
    """Start a server of one's own: `with serve(settings, targets) as client`."""
    return running


@contextmanager
def running(settings: Settings, targets: Mapping[str, str] = TARGETS) -> Iterator[httpx.Client]:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        server = Server(create_app(settings, targets))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        try:
            with httpx.Client(
                base_url=f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=60
            ) as client:
                wait_for(lambda: server.started or not thread.is_alive())
                yield client
        finally:
            server.handle_exit(signal.SIGINT, None)
            thread.join(timeout=20)
            assert not thread.is_alive()


def wait_for(true: Any, seconds: float = 30.0) -> None:
    """Poll until something holds."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def make_place(folder: Path) -> Place:
    write_valid_dataset(folder / "datasets" / "small")
    write_run(folder / "runs" / RUN, folder / "datasets" / "small")
    return Place(folder / "runs", folder / "datasets")


@pytest.fixture
def run_name() -> str:
    return RUN


@pytest.fixture
def report() -> dict[str, Any]:
    return json.loads(json.dumps(REPORT))


def write_run(folder: Path, dataset: Path) -> None:
    """A run folder by its contract: a block that is pressed in at the middle, and misses a bump
    beside it.
    """
    (folder / "replays").mkdir(parents=True)
    (folder / "pictures").mkdir()
    (folder / "pictures" / "patterns.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (folder / "report.json").write_text(json.dumps(REPORT))
    (folder / "model.json").write_text(json.dumps({"format": 1}))
    origin = {
        "dataset": str(dataset),
        "created": 1.0,
        "seconds": 60.0,
        "seed": 0,
        "splits": {"poke-01": "train", "drag-01": "test"},
    }
    (folder / "origin.json").write_text(json.dumps(origin))
    np.savez(folder / "replays" / "poke-01.npz", **replay_arrays())
    np.savez(folder / "replays" / "drag-01.npz", **replay_arrays(), **solver_arrays())
    centres = np.array(
        [
            [x, y, SIZE[2]]
            for x in np.linspace(-0.03, 0.03, 9)
            for y in np.linspace(-0.015, 0.015, 5)
        ]
    )
    measured = 5e-4 * np.exp(-((centres[:, 0] / 0.01) ** 2))
    measured[0] = np.nan
    normals = np.tile([0.0, 0.0, 1.0], (len(centres), 1))
    np.savez(
        folder / "patterns.npz",
        centres=centres,
        normals=normals,
        measured=measured,
        predicted=0.9 * measured,
    )


def solver_arrays() -> dict[str, Any]:
    """What newer recordings say of the solver: forces, iterations, and a frame in which the stated
    model found no equilibrium.
    """
    count = np.arange(FRAMES)
    forces = {"force_raw": 0.1 * count, "force_extended": 0.2 * count}
    failed = {
        "outcome_raw": (count == 3).astype(np.int8),
        "outcome_extended": np.zeros(FRAMES, np.int8),
    }
    return {**forces, **failed, "iterations_raw": 3 + count, "iterations_extended": 5 + count}


def replay_arrays() -> dict[str, Any]:
    """Five frames of a 13x5x5 block; the third is the deepest."""
    mesh = box_mesh(SIZE, GridSpec())
    used, inverse = np.unique(mesh.free_surface, return_inverse=True)
    quads = inverse.reshape(-1, 4)
    rest = mesh.nodes[used]
    depth = 0.003 * np.sin(np.pi * np.linspace(0.1, 0.9, FRAMES))
    near = np.exp(-((np.linalg.norm(rest[:, :2], axis=1) / 0.01) ** 2)) * rest[:, 2] / SIZE[2]
    raw = rest - np.array([0.0, 0.0, 1.0]) * (depth[:, None] * near)[..., None]
    extended = rest - np.array([0.0, 0.0, 1.0]) * (0.8 * depth[:, None] * near)[..., None]
    error = depth[:, None] * 0.2 * np.sin(100 * rest[:, 0])
    error[:, rest[:, 1] < -0.019] = np.nan
    tool = np.column_stack([np.zeros(FRAMES), np.zeros(FRAMES), SIZE[2] + 0.005 - depth])
    return {
        "time": 100.1 + 0.2 * np.arange(FRAMES),
        "cloud_index": np.arange(FRAMES),
        "rest": rest,
        "faces": np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32),
        "raw": raw.astype(np.float32),
        "extended": extended.astype(np.float32),
        "tool_raw": tool,
        "tool_extended": tool,
        "tool_radius_raw": 0.005,
        "tool_radius_extended": 0.004,
        "error_raw": error.astype(np.float32),
        "error_extended": (0.1 * error).astype(np.float32),
        "distance_raw": 0.2 * depth,
        "distance_extended": 0.02 * depth,
        "paper_raw": depth,
        "paper_extended": depth,
        "noise_floor": 1e-5,
        "camera_raw": CAMERA,
        "camera_extended": CAMERA,
        "outcome": np.zeros(FRAMES, np.int8),
    }
