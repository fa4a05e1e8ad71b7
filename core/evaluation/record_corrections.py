"""The corrected model beside the others of a run: for each recorded frame its surface and its
error, for the page.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.evaluation.loaded_network import LoadedNetwork
from palpate.foundation.arrays import FloatArray
from palpate.foundation.progress import Report, silent
from palpate.measurement.camera_model import sight_of
from palpate.measurement.phantom_drift import as_it_stood, camera_of
from palpate.measurement.segmentation import cleaner_for, find_shaft_axis, tool_poses
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.recording.record_sequence import compare_with_clouds
from palpate.recording.saved_model import setup_of_model
from palpate.registration.registration import register, setup_from
from palpate.replay.replay import replay

__all__ = ["record_corrections"]

_TOLERANCE = 1e-3
"""Residual of a converged frame, over the push; that of the run's recordings."""


def record_corrections(
    dataset: Dataset,
    model: Mapping[str, Any],
    network: LoadedNetwork,
    frames: Mapping[str, FloatArray],
    out: Path,
    report: Report = silent,
) -> None:
    """Replay a run's recorded frames under its extended model, correct them, and write one file for
    each sequence to `out`.

    Args:
        model: model.json of the run.
        network: trained on it.
        frames: numbers of the recorded clouds by sequence.

    What was in `out` before is replaced once all is there.
    """
    dataset, registration = as_it_stood(dataset, register(dataset))
    stated = setup_from(dataset, registration)
    setup, grid = setup_of_model(stated, model), PAGE_GRID.for_tool(stated.tool.radius)
    cleaner, shaft = (
        cleaner_for(dataset, registration),
        find_shaft_axis(dataset, registration.mended),
    )
    robot, correct = (
        touch_correction(setup, grid) @ setup.phantom_from_robot,
        network.corrector(setup),
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        for number, (name, index) in enumerate(frames.items()):
            report(number / len(frames), f"correcting {name} for the page")
            sequence = dataset.sequence(name)
            stamps = np.asarray(sequence.cloud_times)[index]
            times = stamps - setup.sensor.time_offset
            solved = replay(
                setup,
                robot.apply(smooth_centres(sequence.kinematics, times)),
                grid,
                times=times,
                tolerance=_TOLERANCE,
            )
            tool = network.columns(sequence, stamps, setup, grid)
            poses = tool_poses(sequence.kinematics, stamps, stated.phantom_from_robot, shaft)
            raw = [sequence.cloud(int(one)) for one in index]
            clouds = [
                cloud[cleaner.clean(cloud, pose).indices]
                for cloud, pose in zip(raw, poses, strict=True)
            ]
            side = compare_with_clouds(
                setup,
                [correct(frame, one) for frame, one in zip(solved, tool, strict=True)],
                clouds,
            )
            np.savez_compressed(
                aside / f"{name}.npz",
                cloud_index=index,
                corrected=side.surface.astype(np.float32),
                tool_corrected=side.tool,
                tool_radius_corrected=np.array(setup.tool.radius),
                error_corrected=side.error.astype(np.float32),
                distance_corrected=side.distance,
                paper_corrected=side.paper,
                camera_corrected=camera_of(sequence, sight_of(setup).pose).matrix,
                **side.inside.arrays("corrected"),
            )
        aside.chmod(0o755)
        _replace(aside, out)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _replace(made: Path, out: Path) -> None:
    """Put a folder in the place of another."""
    if not out.exists():
        os.rename(made, out)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{out.name}-old-", dir=out.parent))
    os.rename(out, old / "old")
    os.rename(made, out)
    shutil.rmtree(old, ignore_errors=True)
