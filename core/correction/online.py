"""Online learning: a network that keeps learning as frames arrive.

Each frame is predicted before it is learned from, so that its error is out of sample. A step mixes
the newest frame with earlier ones, which keeps what the network learned elsewhere. Only the last
`memory` frames are kept, so that the network adapts when the material changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from palpate.correction.networks.chamfer import Distance, SurfaceLoss
from palpate.correction.networks.devices import device_of
from palpate.correction.samples.sample_store import Batch, Samples
from palpate.correction.trained_network import TrainedNetwork
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import CorrectionError
from palpate.foundation.progress import Report, silent

__all__ = ["Learner", "OnlineErrors", "OnlineSpec", "learn_online"]


@dataclass(frozen=True, kw_only=True)
class OnlineSpec:
    """The settings of online learning.

    Attributes:
        rate: learning rate of Adam.
        batch: frames per step, including the newest.
        steps: steps after each frame.
        memory: number of frames that are kept.
        distance: distance of the loss, as in a training.
        hold: weight of the hidden points' correction [1/mm], as in a training.
        device: torch device, or "auto".
        seed: seed of the draw of earlier frames.
    """

    rate: float = 1e-3
    batch: int = 8
    steps: int = 2
    memory: int = 256
    distance: Distance = "chamfer"
    hold: float = 0.1
    device: str = "cpu"
    seed: int = 0

    def __post_init__(self) -> None:
        bounds = {
            "rate": (0.0, 1.0),
            "batch": (1, 4096),
            "steps": (0, 1000),
            "memory": (1, 100_000),
        }
        for key, (low, high) in bounds.items():
            value = getattr(self, key)
            if not low <= value <= high:
                raise CorrectionError(
                    f"{key} = {value:g}; expected {low:g} to {high:g}",
                    key=key,
                    value=value,
                    low=low,
                    high=high,
                )


class Learner:
    """A copy of a trained network that learns online; the original does not change.

    Args:
        trained: the network.
        spec: the settings.
    """

    def __init__(self, trained: TrainedNetwork, spec: OnlineSpec) -> None:
        self.spec, self.body, self._device = spec, trained.body, device_of(spec.device)
        self.network = deepcopy(trained.network).to(self._device)
        seen = np.asarray(trained.about["seen"], dtype=float)[self.body.nodes]
        self._loss = SurfaceLoss(
            self.body, seen, distance=spec.distance, hold=spec.hold, device=self._device
        )
        self._optimizer = torch.optim.Adam(self.network.parameters(), lr=spec.rate, fused=True)
        self._random = np.random.default_rng(spec.seed)
        self._stored: list[Batch] = []
        self._next = 0

    @torch.no_grad()
    def predict(self, batch: Batch) -> Tensor:
        """Return the corrected points (b, v, 3) [m] of the body."""
        here = batch.to(self._device)
        corrected: Tensor = self.network.eval()(here.positions[:, self.body.index], here.tool)
        return corrected

    @torch.no_grad()
    def error(self, vertices: Tensor, batch: Batch) -> float:
        """Return the mean distance [mm] of one frame's measured points to a surface.

        NaN where there are no points. The surface is given by vertices (1, v, 3) [m].
        """
        apart, valid = self._loss.distances(vertices, batch.to(self._device))
        return float((apart[valid].sum() / valid.sum()).cpu()) * 1e3

    def learn(self, frame: Batch) -> None:
        """Take the steps after a frame (a batch of one), mixed with stored frames."""
        newest = frame.to(self._device)
        self.network.train()
        for _ in range(self.spec.steps):
            others = min(self.spec.batch - 1, len(self._stored))
            batch = newest
            for number in (
                self._random.choice(len(self._stored), others, replace=False) if others else ()
            ):
                batch = batch.joined(self._stored[int(number)])
            raw = batch.positions[:, self.body.index]
            loss = self._loss(self.network(raw, batch.tool), batch, raw)
            self._optimizer.zero_grad(set_to_none=True)
            loss.total.backward()
            self._optimizer.step()
        if len(self._stored) < self.spec.memory:
            self._stored.append(newest)
        else:
            self._stored[self._next] = newest
            self._next = (self._next + 1) % self.spec.memory


@dataclass(frozen=True, eq=False)
class OnlineErrors:
    """Errors of frames in the order in which they came.

    Attributes:
        online: (f,) errors of the network that learns [mm].
        frozen: (f,) errors of the network as it was trained [mm].
        raw: (f,) errors without a network [mm].
    """

    online: FloatArray
    frozen: FloatArray
    raw: FloatArray


def learn_online(
    trained: TrainedNetwork,
    streams: Sequence[tuple[Samples, Sequence[str]]],
    spec: OnlineSpec,
    report: Report = silent,
) -> OnlineErrors:
    """Predict each frame, then learn from it; return the errors.

    Args:
        trained: the network at the beginning.
        streams: samples and names of their sequences, in the order in which they come. A second
            set of samples stands for a change of the material.
        spec: the settings.
        report: receives the progress.
    """
    learner, frozen = Learner(trained, spec), Learner(trained, spec)
    total, done, rows = sum(len(samples.rows(names)) for samples, names in streams), 0, []
    for samples, names in streams:
        for row in samples.rows(names):
            report(done / total, f"frame {done + 1} of {total}")
            frame = samples.batch(np.array([row]))
            raw = frame.to(device_of(spec.device)).positions[:, learner.body.index]
            rows.append(
                [
                    learner.error(learner.predict(frame), frame),
                    learner.error(frozen.predict(frame), frame),
                    learner.error(raw, frame),
                ]
            )
            learner.learn(frame)
            done += 1
    online, still, without = np.array(rows, dtype=float).reshape(-1, 3).T
    return OnlineErrors(online, still, without)
