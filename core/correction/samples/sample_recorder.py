"""The recorder of samples: model, settings, and the measured points of a frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.embedding_grid import seen_from_above
from palpate.dataset import Dataset
from palpate.experiment import Experiment
from palpate.foundation.arrays import BoolArray, FloatArray
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
        chart: those over the top, of a body with a grid; None for any other.
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
    chart: Body | None
    cleaner: Cleaner
    shaft: ToolShaft | None
    points: int
    measured: bool
    seed: int = 0

    @property
    def phantom_from_robot(self) -> Transform:
        """The robot registration under the setup, corrected for the sag at the touches."""
        return touch_correction(self.setup, self.grid) @ self.setup.phantom_from_robot

    @cached_property
    def rest(self) -> FloatArray:
        """Rest positions (r, 3) [m] of all points of both bodies, in the order of the samples."""
        bodies = [self.body] if self.chart is None else [self.body, self.chart]
        rest = np.zeros((1 + max(int(one.index.max()) for one in bodies), 3))
        for one in reversed(bodies):
            rest[one.index] = one.rest
        return rest

    @cached_property
    def upper(self) -> BoolArray:
        """Mark the vertices of the sampled surface that are seen from above (s,)."""
        return seen_from_above(self.setup.geometry, self.body.surface(self.body.rest))

    def seen(self, near: FloatArray) -> FloatArray:
        """Return the measured points near all points (r,) of those near the body's (v,)."""
        seen, count = np.zeros(len(self.rest)), self.body.count
        if self.chart is not None and len(self.chart.carriers):
            carried = near[self.chart.index[self.chart.count :]]
            nodes = np.concatenate([np.zeros(self.chart.count), carried])
            seen[self.chart.nodes] = self.chart.gather(nodes)
        seen[self.body.index] = np.concatenate([self.body.gather(near), near[count:]])
        return seen

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
    sampled = body or Body.of(setup.geometry, nodes)
    with_forces = [dataset.sequence(name).forces is not None for name in dataset.sequences]
    return Recorder(
        dataset,
        setup,
        grid or experiment.mesh(Use.PAGE, experiment.sequences),
        sampled,
        None if sampled.grid is None else sampled.over(setup.geometry),
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
    """Return the points of a sample, the number of those on the part of the surface that is seen
    from above, and points near each point of the body.

    Args:
        recorder: the settings.
        camera: places the points in the phantom frame.
        frame: the simulated frame, by which points are assigned to the surface.
        cloud: (n, 3) segmented points [m], camera frame.
        rng: draws the points that are kept.

    Returns points (p, 3) [m] in the phantom frame, those seen from above first; the number of
    these; and the number of points near each point of the body (v,).
    """
    if len(cloud) > recorder.points:
        cloud = cloud[np.sort(rng.choice(len(cloud), recorder.points, replace=False))]
    points, body = camera.place(cloud), recorder.body
    _, nearest = cKDTree(body.surface(frame.move(body.rest))).query(points)
    upper = recorder.upper[nearest]
    near = np.zeros(len(body.rest))
    np.add.at(near, body.corners[nearest], body.shares[nearest])
    return points[np.argsort(~upper, kind="stable")], int(upper.sum()), near
