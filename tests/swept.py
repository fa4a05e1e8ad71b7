"""A small virtual phantom with a larger tool than stated, for sweeps: fast to make and
to replay.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import httpx
from made_datasets import copy_dataset

from palpate.synthetic import HiddenEffect, Scenario

__all__ = ["first_points", "write_swept_phantom"]


def write_swept_phantom(folder: Path) -> Path:
    """Write a dataset of pushes from above by a tool of 6 mm that is stated as 5 mm; returns its
    folder.
    """
    hidden = HiddenEffect("tool_radius", {"radius": 6e-3})
    scenario = Scenario(
        effects=(hidden,),
        sequences=("poke-top-01",),
        fine=4e-3,
        density=3000,
        rate=5.0,
        robot_rate=200.0,
    )
    copy_dataset(folder, scenario, 3)
    return folder


def first_points(client: httpx.Client, identity: str) -> list[dict[str, Any]]:
    """The points of a sweep over REST as soon as it has any."""
    end = time.monotonic() + 120
    while not (points := client.get(f"/api/sweeps/{identity}/points").json()["points"]):
        assert time.monotonic() < end
        time.sleep(0.1)
    return list(points)
