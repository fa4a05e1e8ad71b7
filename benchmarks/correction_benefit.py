"""Benefit of correction networks on a virtual experiment.

Networks over the top layer and over the volume are compared, with and without feedback, and with
online learning. The block sags and the ball is larger than stated; the data come from another
solver on another mesh. Errors are in the paper's metric.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import torch
from rich.table import Table

from benchmarks.cpu_time import timed
from palpate.correction import (
    Corrector,
    NetworkSpec,
    OnlineSpec,
    Recorder,
    Samples,
    Split,
    SurfaceLoss,
    TrainedNetwork,
    TrainingSpec,
    body_for,
    learn_online,
    make_samples,
    recorder_for,
    replay_corrected,
    sample_errors,
    train,
)
from palpate.correction.corrected_replay import FEEDBACKS, CorrectedFrame
from palpate.correction.samples.tool_columns import tool_columns
from palpate.dataset import open_dataset
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.measurement.metrics import paper_distance
from palpate.mesh.box_mesh import GridSpec
from palpate.synthetic import HiddenEffect, Scenario, make_dataset

__all__ = ["run"]

SEQUENCES = ("poke-top-01", "poke-side-01", "drag-01", "poke-top-02", "poke-top-03")
TRAINED, STOPPING, TESTED = SEQUENCES[:3], SEQUENCES[3:4], SEQUENCES[4]
GRID = GridSpec(nodes=(13, 5, 5))
WEIGHT, LIGHTER = 2.4, 0.6
"""Specific weight over stiffness [1/m], and of a block four times as stiff."""
FEATURES, HOLDS = (16, 32, 64), (0.0, 0.1, 1.0)


def _samples(folder: Path, weight: float, sequences: tuple[str, ...]) -> tuple[Recorder, Samples]:
    effects = (
        HiddenEffect("tool_radius", {"radius": 6.5e-3}),
        HiddenEffect("gravity", {"specific_weight_over_stiffness": weight}),
    )
    scenario = Scenario(
        effects=effects, sequences=sequences, density=1500, rate=3.0, robot_rate=200.0, fine=4e-3
    )
    make_dataset(folder / "block", scenario, 7)
    recorder = recorder_for(open_dataset(folder / "block"), grid=GRID, points=600)
    return recorder, make_samples(folder / "samples", recorder)


def _trained(folder: Path, samples: Samples, kind: str, hold: float) -> TrainedNetwork:
    network = NetworkSpec(kind=kind, features=FEATURES)  # type: ignore[arg-type]
    spec = TrainingSpec(
        network=network, hold=hold, rate=1e-3, batch=16, epochs=15, patience=15, device="cpu"
    )
    split = Split.of(samples, train=TRAINED, validation=STOPPING, test=(TESTED,))
    return train(samples, split, spec, folder / f"{kind}-{hold:g}")


@torch.no_grad()
def _kinds(samples: Samples, networks: dict[tuple[str, float], TrainedNetwork]) -> Table:
    """Return errors on the top and on all points, and the correction of hidden points."""
    table = Table(
        "network",
        "hold, 1/mm",
        "top, mm",
        "all, mm",
        "hidden moved by, mm",
        title=f"top and volume, on {TESTED}",
    )
    top, rows = body_for(samples, "unet2d"), samples.rows([TESTED])
    batch, hidden = samples.batch(rows), samples.seen == 0
    losses = (SurfaceLoss(top, samples.seen[top.index]), SurfaceLoss(samples.body, samples.seen))

    def cells(vertices: torch.Tensor) -> list[str]:
        means = []
        for loss, index in zip(losses, (top.index, samples.body.index), strict=True):
            apart, valid = loss.distances(vertices[:, index], batch)
            means.append(f"{float(apart[valid].mean()) * 1e3:.3f}")
        return [
            *means,
            f"{float((vertices - batch.positions)[:, hidden].norm(dim=2).mean()) * 1e3:.3f}",
        ]

    table.add_row("none", "", *cells(batch.positions))
    for (kind, hold), trained in networks.items():
        vertices = batch.positions.clone()
        vertices[:, trained.body.index] = trained.network(
            batch.positions[:, trained.body.index], batch.tool
        )
        table.add_row(kind, f"{hold:g}", *cells(vertices))
    return table


def _feedbacks(
    recorder: Recorder, samples: Samples, networks: dict[tuple[str, float], TrainedNetwork]
) -> Table:
    table = Table(
        "network",
        "fed back",
        "error, mm",
        "iterations",
        "equilibrium changes by, mm",
        "ms a corrected frame",
        title="feedback",
    )
    for (kind, hold), trained in networks.items():
        plain: list[CorrectedFrame] = []
        for feedback in FEEDBACKS:
            corrector = Corrector(trained, recorder.setup, feedback=feedback)  # type: ignore[arg-type]
            tools, frames = _replayed(recorder, corrector)
            plain = plain or frames
            moved = max(
                float(np.abs(a.raw.displacement - b.raw.displacement).max())
                for a, b in zip(plain, frames, strict=True)
            )
            if not moved < 5e-5:
                raise RuntimeError(
                    f"{kind}, {feedback}: an equilibrium depends on where its solution starts, "
                    f"by {moved * 1e3:.2g} mm"
                )
            error = np.mean(_errors(recorder, samples, frames)) * 1e3
            steps = sum(frame.raw.iterations for frame in frames)
            spent = min(
                timed(partial(corrector.correct, frame.raw, tool))[1]
                for frame, tool in zip(frames, tools, strict=True)
            )
            table.add_row(
                f"{kind}, hold {hold:g}",
                feedback,
                f"{error:.3f}",
                str(steps),
                f"{moved * 1e3:.4f}",
                f"{spent * 1e3:.2f}",
            )
    return table


def _replayed(recorder: Recorder, corrector: Corrector) -> tuple[np.ndarray, list[CorrectedFrame]]:
    sequence, robot = recorder.dataset.sequence(TESTED), recorder.phantom_from_robot
    times = np.asarray(sequence.cloud_times)
    centres, tools = (
        robot.apply(smooth_centres(sequence.kinematics, times)),
        tool_columns(sequence, times, robot, False),
    )
    return tools, list(replay_corrected(corrector, recorder.setup, centres, tools, recorder.grid))


def _errors(recorder: Recorder, samples: Samples, frames: list[CorrectedFrame]) -> list[float]:
    surface, rows = recorder.setup.surface(), samples.rows([TESTED])
    batch, errors = samples.batch(rows), []
    for row, frame in enumerate(samples.column("frame", rows)):
        points = batch.points[row, : int(batch.count[row, 1])].numpy().astype(float)
        errors.append(paper_distance(points, frames[int(frame)].corrected, surface))
    return errors


def _online(
    samples: Samples, other: Samples, networks: dict[tuple[str, float], TrainedNetwork]
) -> Table:
    """Return errors on frames of the trained material, then of one four times as stiff."""
    first, second = len(samples.rows([TESTED])), (TESTED,)
    table = Table(
        "network",
        "while",
        "without, mm",
        "as trained",
        "learning",
        title="a material that changes half way",
    )
    for (kind, _), trained in networks.items():
        stream = learn_online(trained, [(samples, second), (other, second)], OnlineSpec())
        half = first + (len(stream.raw) - first) // 2
        for name, part in (
            ("as trained for", slice(first)),
            ("just changed", slice(first, half)),
            ("later", slice(half, None)),
        ):
            numbers = (
                f"{np.mean(values[part]):.3f}"
                for values in (stream.raw, stream.frozen, stream.online)
            )
            table.add_row(kind, name, *numbers)
    return table


def run() -> list[Table]:
    """Train and compare the networks; RuntimeError where one does not reduce the error."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recorder, samples = _samples(folder / "soft", WEIGHT, SEQUENCES)
        _, other = _samples(folder / "stiff", LIGHTER, (TESTED,))
        kinds = [("unet2d", 0.1), *(("unet3d", hold) for hold in HOLDS), ("graph", 0.1)]
        networks = {(kind, hold): _trained(folder, samples, kind, hold) for kind, hold in kinds}
        for (kind, _), trained in networks.items():
            loss = SurfaceLoss(trained.body, samples.seen[trained.body.index])
            raw, corrected = (
                float(
                    sample_errors(net, loss, trained.body, samples, samples.rows([TESTED])).mean()
                )
                for net in (None, trained.network)
            )
            if not corrected < raw:
                raise RuntimeError(f"{kind}: {corrected:.3f} mm with, {raw:.3f} mm without")
        usual = {key: networks[key] for key in (("unet2d", 0.1), ("unet3d", 0.1))}
        held = {key: networks[key] for key in (("unet2d", 0.1), ("unet3d", 0.1), ("graph", 0.1))}
        return [
            _kinds(samples, networks),
            _feedbacks(recorder, samples, usual),
            _online(samples, other, held),
        ]
