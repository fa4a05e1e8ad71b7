"""A network that keeps learning as frames arrive: each is predicted first, then learned from, so
that its error is an honest one.

Steps are small and mix the newest frame with some of those before it, or the network would forget
what it knew of other places. Of these the last `memory` are kept: when the material changes, what
was true of the old one leaves with them.
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

__all__ = ["Learner", "OnlineSpec", "OnlineErrors", "learn_online"]


@dataclass(frozen=True, kw_only=True)
class OnlineSpec:
    """How a network learns on the way.

    Attributes:
        rate: of Adam.
        batch: frames in a step, the newest among them.
        steps: after each frame.
        memory: frames that are kept.
        distance, hold: as in a training.
        device: of torch, or "auto".
        seed: of which frames are drawn.
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
    """A copy of a trained network that learns; the one it was made from stays as it is.

    Args:
        trained: the network.
        spec: how it learns.
    """

    def __init__(self, trained: TrainedNetwork, spec: OnlineSpec) -> None:
        self.spec, self.body, self._device = spec, trained.body, device_of(spec.device)
        self.network = deepcopy(trained.network).to(self._device)
        seen = np.asarray(trained.about["seen"], dtype=float)[self.body.index]
        self._loss = SurfaceLoss(
            self.body, seen, distance=spec.distance, hold=spec.hold, device=self._device
        )
        self._optimizer = torch.optim.Adam(self.network.parameters(), lr=spec.rate, fused=True)
        self._random = np.random.default_rng(spec.seed)
        self._kept: list[Batch] = []
        self._next = 0

    @torch.no_grad()
    def predict(self, batch: Batch) -> Tensor:
        """Corrected points (b, v, 3) [m] of the body."""
        here = batch.to(self._device)
        corrected: Tensor = self.network.eval()(here.positions[:, self.body.index], here.tool)
        return corrected

    @torch.no_grad()
    def error(self, vertices: Tensor, batch: Batch) -> float:
        """Mean distance [mm] of one frame's measured points to the surface of vertices (1, v, 3)
        [m]; NaN where there are none.
        """
        apart, valid = self._loss.distances(vertices, batch.to(self._device))
        return float((apart[valid].sum() / valid.sum()).cpu()) * 1e3

    def learn(self, frame: Batch) -> None:
        """A few steps on this frame (a batch of one) and some that are remembered."""
        newest = frame.to(self._device)
        self.network.train()
        for _ in range(self.spec.steps):
            others = min(self.spec.batch - 1, len(self._kept))
            batch = newest
            for number in (
                self._random.choice(len(self._kept), others, replace=False) if others else ()
            ):
                batch = batch.joined(self._kept[int(number)])
            raw = batch.positions[:, self.body.index]
            loss = self._loss(self.network(raw, batch.tool), batch, raw)
            self._optimizer.zero_grad(set_to_none=True)
            loss.total.backward()
            self._optimizer.step()
        if len(self._kept) < self.spec.memory:
            self._kept.append(newest)
        else:
            self._kept[self._next] = newest
            self._next = (self._next + 1) % self.spec.memory


@dataclass(frozen=True, eq=False)
class OnlineErrors:
    """Errors [mm] of frames in the order in which they came (f,): learning, of the network as it
    was, and without one.
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
    """Predict each frame, then learn from it.

    Args:
        trained: the network at the beginning.
        streams: samples and names of their sequences, in the order in which they come; a second set
            of samples is how a change of the material half way is told.
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
