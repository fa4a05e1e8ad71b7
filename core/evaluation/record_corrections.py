"""Surface and error of the corrected model in each recorded frame of a run, for the page."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import Dataset, Sequence
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.evaluation.loaded_network import LoadedNetwork
from palpate.experiment import Experiment
from palpate.foundation.arrays import FloatArray
from palpate.foundation.progress import Report, silent
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.phantom_drift import recorded_camera
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.tool_pose import ToolShaft, tool_poses
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.default_meshes import Use
from palpate.mesh.protocol import Meshing
from palpate.recording.record_sequence import compare_with_clouds
from palpate.recording.saved_model import setup_of_model
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import replay
from palpate.setup.setup import Setup

__all__ = ["record_corrections"]

_TOLERANCE = 1e-3
"""Residual over the push force at which a frame counts as converged [1]; as in recordings."""


def record_corrections(
    dataset: Dataset,
    model: Mapping[str, Any],
    network: LoadedNetwork,
    frames: Mapping[str, FloatArray],
    out: Path,
    report: Report = silent,
) -> None:
    """Correct a run's recorded frames and write one file for each sequence to `out`.

    The frames are replayed under the extended model of the run. The former content of `out` is
    replaced once all files are written.

    Args:
        dataset: the dataset of the run.
        model: model.json of the run.
        network: a network that was trained on this model.
        frames: numbers of the recorded clouds by sequence.
        out: folder of the result.
        report: receives the progress.
    """
    experiment = Experiment.of(dataset)
    stated = experiment.stated
    setup = setup_of_model(stated, model)
    corrected = _CorrectedModel(
        setup=setup,
        grid=experiment.mesh(Use.PAGE, frames),
        network=network,
        stated=stated,
        cleaner=experiment.cleaner.allowing(setup.tool.radius),
        shaft=experiment.shaft,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    try:
        for number, (name, index) in enumerate(frames.items()):
            report(number / len(frames), f"correcting {name} for the page")
            arrays = corrected.arrays(experiment.dataset.sequence(name), index)
            np.savez_compressed(aside / f"{name}.npz", **arrays)
        aside.chmod(0o755)
        _replace(aside, out)
    finally:
        shutil.rmtree(aside, ignore_errors=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class _CorrectedModel:
    """The model of a run with a network on top.

    Attributes:
        setup: the setup of the model.
        grid: its mesh protocol.
        network: the network.
        stated: the stated setup, whose registration places the tool in the clouds.
        cleaner: segments the phantom out of the clouds.
        shaft: of the tool, in its frame; None if unknown.
    """

    setup: Setup
    grid: Meshing
    network: LoadedNetwork
    stated: Setup
    cleaner: Cleaner
    shaft: ToolShaft | None

    def arrays(self, sequence: Sequence, index: FloatArray) -> dict[str, Any]:
        """Replay and correct these frames of a sequence; return the arrays for the page."""
        stamps = np.asarray(sequence.cloud_times)[index]
        frames = self._frames(sequence, stamps)
        side = compare_with_clouds(self.setup, frames, self._clouds(sequence, index, stamps))
        return {
            "cloud_index": index,
            "corrected": side.surface.astype(np.float32),
            "tool_corrected": side.tool,
            "tool_radius_corrected": np.array(self.setup.tool.radius),
            "error_corrected": side.error.astype(np.float32),
            "distance_corrected": side.distance,
            "paper_corrected": side.paper,
            "camera_corrected": recorded_camera(sequence, camera_model_for(self.setup).pose).matrix,
            **side.inside.arrays("corrected"),
        }

    def _frames(self, sequence: Sequence, stamps: FloatArray) -> list[Equilibrium]:
        """Return the corrected frames at cloud stamps (n,) [s]."""
        robot = touch_correction(self.setup, self.grid) @ self.setup.phantom_from_robot
        times = stamps - self.setup.sensor.time_offset
        solved = replay(
            self.setup,
            robot.apply(smooth_centres(sequence.kinematics, times)),
            self.grid,
            times=times,
            tolerance=_TOLERANCE,
        )
        tools = self.network.columns(sequence, stamps, self.setup, self.grid)
        correct = self.network.corrector(self.setup)
        return [correct(frame, tool) for frame, tool in zip(solved, tools, strict=True)]

    def _clouds(
        self, sequence: Sequence, index: FloatArray, stamps: FloatArray
    ) -> list[FloatArray]:
        """Return the segmented clouds (n, 3) [m] of these frames, camera frame."""
        robot = self.stated.phantom_from_robot
        poses = tool_poses(sequence.kinematics, stamps, robot, self.shaft)
        raw = [sequence.cloud(int(number)) for number in index]
        return [
            cloud[self.cleaner.clean(cloud, pose).indices]
            for cloud, pose in zip(raw, poses, strict=True)
        ]


def _replace(made: Path, out: Path) -> None:
    """Replace the folder `out` by another."""
    if not out.exists():
        os.rename(made, out)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{out.name}-old-", dir=out.parent))
    os.rename(out, old / "old")
    os.rename(made, out)
    shutil.rmtree(old, ignore_errors=True)
