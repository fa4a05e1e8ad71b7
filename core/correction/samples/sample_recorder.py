"""The recorder of samples: model, settings, and the measured points of a frame."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from palpate.correction.samples.corrected_points import Body
from palpate.dataset import Dataset
from palpate.experiment import Experiment
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import CameraModel
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.tool_pose import ToolShaft
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.default_meshes import Use
from palpate.mesh.protocol import Meshing
from palpate.replay.equilibrium import Equilibrium
from palpate.setup.setup import Setup

__all__ = ["Recorder", "measured_points", "recorder_for"]


@dataclass(frozen=True, eq=False)
class Recorder:
    """The model and the settings by which samples of a dataset are recorded.

    Attributes:
        dataset: the dataset, with sequences as seen from the block where it stood.
        setup: the setup of the model.
        grid: its mesh protocol.
        body: the material points that are sampled.
        cleaner: segments the phantom out of the clouds.
        shaft: of the tool, in its frame; None if unknown.
        points: most points of a cloud.
        measured: whether forces are measured; otherwise they are simulated.
        seed: seed of the random draw of points.
    """

    dataset: Dataset
    setup: Setup
    grid: Meshing
    body: Body
    cleaner: Cleaner
    shaft: ToolShaft | None
    points: int
    measured: bool
    seed: int = 0

    @property
    def phantom_from_robot(self) -> Transform:
        """The robot registration under the setup, corrected for the sag at the touches."""
        return touch_correction(self.setup, self.grid) @ self.setup.phantom_from_robot

    def only(self, name: str) -> Recorder:
        """Return the recorder with one sequence only, to be sent to a process."""
        return replace(self, dataset=replace(self.dataset, loaded=(self.dataset.sequence(name),)))


def recorder_for(
    dataset: Dataset,
    *,
    setup: Setup | None = None,
    grid: Meshing | None = None,
    nodes: tuple[int, int, int] = (13, 5, 5),
    body: Body | None = None,
    points: int = 1024,
    seed: int = 0,
    experiment: Experiment | None = None,
) -> Recorder:
    """Return a recorder for a dataset.

    Args:
        dataset: the dataset.
        setup: setup of the model; the stated one with the registrations if None.
        grid: mesh protocol; that of the page if None.
        nodes: points of the sampled grid along x, y, z.
        body: material points to sample instead of a grid.
        points: most points of a cloud.
        seed: seed of the random draw of points.
        experiment: the registered dataset, if there is one already.
    """
    experiment = experiment or Experiment.of(dataset)
    dataset, setup = experiment.dataset, setup or experiment.stated
    with_forces = [dataset.sequence(name).forces is not None for name in dataset.sequences]
    return Recorder(
        dataset,
        setup,
        grid or experiment.mesh(Use.PAGE, experiment.sequences),
        body or Body.block(setup.box.size, nodes),
        experiment.cleaner.allowing(setup.tool.radius),
        experiment.shaft,
        points,
        all(with_forces),
        seed,
    )


def measured_points(
    recorder: Recorder,
    camera: CameraModel,
    frame: Equilibrium,
    cloud: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, int, FloatArray]:
    """Return the points of a sample, the number of those on the top, and points near each vertex.

    Args:
        recorder: the settings.
        camera: places the points in the phantom frame.
        frame: the simulated frame, by which points are assigned to the surface.
        cloud: (n, 3) segmented points [m], camera frame.
        rng: draws the points that are kept.

    Returns points (p, 3) [m] in the phantom frame, those of the top first; the number of points on
    the top; and the number of points near each material point (v,).
    """
    if len(cloud) > recorder.points:
        cloud = cloud[np.sort(rng.choice(len(cloud), recorder.points, replace=False))]
    points, body = camera.place(cloud), recorder.body
    _, nearest = cKDTree(body.surface(frame.move(body.rest))).query(points)
    height = body.rest[:, 2].max()
    upper = body.surface(body.rest)[nearest, 2] >= height * (1 - 1e-6)
    near = np.zeros(len(body.rest))
    np.add.at(near, body.corners[nearest], body.shares[nearest])
    return points[np.argsort(~upper, kind="stable")], int(upper.sum()), near
