"""A small dataset by another solver, in which the tool is larger than stated."""

from __future__ import annotations

from pathlib import Path

from made_datasets import copy_dataset

from palpate.synthetic import HiddenEffect, Scenario

__all__ = ["RADIUS", "large_tool_dataset"]

RADIUS = 6.5e-3
"""True radius of the tool [m]; 5 mm are stated."""
SCENARIO = Scenario(
    effects=(HiddenEffect("tool_radius", {"radius": RADIUS}),),
    sequences=("poke-top-01", "poke-top-02", "poke-side-01"),
    splits={"train": ("poke-top-01", "poke-side-01"), "validation": (), "test": ("poke-top-02",)},
    fine=4.5e-3,
    density=1500,
    rate=3.0,
    robot_rate=200.0,
    noise=0.3e-3,
)


def large_tool_dataset(folder: Path) -> Path:
    """Put the dataset at `folder`, with its truth beside it; returns the folder."""
    copy_dataset(folder, SCENARIO, 3)
    return folder
