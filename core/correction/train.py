"""Training: by seed the same weights each time, stopped by the validation sequences, and resumed exactly wherever it was killed.

run/
  checkpoint.pt     where it is: weights, optimizer, place in the epoch, random state, the best weights so far
  network.pt        the best weights, once it is finished
  tensorboard/      errors by epoch and loss by step
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from palpate.correction import checkpoint
from palpate.correction.networks.architectures import CorrectionNetwork, build
from palpate.correction.networks.chamfer import SurfaceLoss
from palpate.correction.networks.devices import device_of, reproducible
from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.sample_splits import Split
from palpate.correction.samples.sample_store import Samples
from palpate.correction.trained_network import FILE, TrainedNetwork
from palpate.correction.training_spec import TrainingSpec
from palpate.foundation.arrays import IntArray
from palpate.foundation.errors import CorrectionError, RunError
from palpate.foundation.progress import Report, silent

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

__all__ = ["body_for", "sample_errors", "train"]

CHECKPOINT, HISTORY = "checkpoint.pt", "history.json"
_CHUNK = 256
_LOG_EVERY = 50


def body_for(samples: Samples, kind: str) -> Body:
    """What a network of this kind corrects of the samples' body."""
    return samples.body.upper if kind == "unet2d" else samples.body


def train(
    samples: Samples, split: Split, spec: TrainingSpec, folder: Path, report: Report = silent
) -> TrainedNetwork:
    """Train a network, or go on with a training that was begun in `folder`; what is finished is
    returned as it is.

    The weights of the best validation error are kept. The same samples, split, spec and versions
    give the same weights bit for bit, however often the training was killed and begun again.
    `report` may raise Cancelled: what was reached stays in the folder.

    Raises:
        CorrectionError: another training is in the folder, or the loss is no longer finite.
    """
    device = device_of(spec.device)
    with reproducible(device, spec.seed, spec.threads):
        run = _Run(samples, split, spec, folder, device)
        if run.done and (folder / FILE).exists():
            return TrainedNetwork.load(folder, device)
        try:
            while not run.done:
                run.epoch(report)
        finally:
            run.close()
        trained = run.result()
        trained.save(folder)
        report(
            1.0,
            f"validation error {trained.about['error']:.3f} mm, {trained.about['raw_error']:.3f} mm without the network",
        )
        return trained


@torch.no_grad()
def sample_errors(
    network: CorrectionNetwork | None,
    loss: SurfaceLoss,
    body: Body,
    samples: Samples,
    rows: IntArray,
    device: torch.device | str = "cpu",
) -> Tensor:
    """Mean distance [mm] of each sample's measured points to the corrected surface (n,); of the
    simulated one without a network.

    Of a network over the top it is the distance of the points on the top to the top.
    """
    found = [torch.zeros(0)]
    for batch in samples.batches(rows, _CHUNK):
        here = batch.to(torch.device(device))
        vertices = here.positions[:, body.index]
        apart, valid = loss.distances(
            vertices if network is None else network(vertices, here.tool), here
        )
        found.append((torch.where(valid, apart, 0.0).sum(dim=1) / valid.sum(dim=1)).cpu() * 1e3)
    errors = torch.cat(found)
    return errors[torch.isfinite(errors)]


@dataclass
class _Place:
    """Where a training is; plain values."""

    epoch: int = 0
    step: int = 0
    total: int = 0
    loss: float = 0.0
    rate: float = 0.0
    best: float = float("inf")
    best_epoch: int = -1
    stale: int = 0
    raw_error: float = float("nan")
    history: list[list[float]] = field(default_factory=list)


class _Run:
    """A training in its folder."""

    def __init__(
        self, samples: Samples, split: Split, spec: TrainingSpec, folder: Path, device: torch.device
    ) -> None:
        self.samples, self.split, self.spec, self.folder, self.device = (
            samples,
            split,
            spec,
            folder,
            device,
        )
        self.rows, self.held_out = samples.rows(split.train), samples.rows(split.validation)
        self.body = body_for(samples, spec.network.kind)
        self.network = build(spec.network, self.body, spec.seed).to(device)
        self.loss = SurfaceLoss(
            self.body,
            samples.seen[self.body.index],
            distance=spec.distance,
            hold=spec.hold,
            device=device,
        )
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=spec.rate, fused=True)
        self.place, self.best = _Place(rate=spec.rate), dict[str, Tensor]()
        self._writer: SummaryWriter | None = None
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / CHECKPOINT).exists():
            self._resume()
        else:
            self._begin()

    @property
    def steps(self) -> int:
        """Of an epoch."""
        return -(-len(self.rows) // self.spec.batch)

    @property
    def done(self) -> bool:
        """Whether it is finished."""
        return self.place.epoch >= self.spec.epochs or self.place.stale >= self.spec.patience

    def epoch(self, report: Report) -> None:
        """What is left of the epoch under way, and its validation."""
        order = self._order(self.place.epoch)
        begun, first = time.monotonic(), self.place.step
        while self.place.step < self.steps:
            start = self.place.step * self.spec.batch
            rate = (self.place.step - first) * self.spec.batch / max(time.monotonic() - begun, 1e-9)
            report(self._fraction(), self._told(rate))
            self._step(self.rows[order[start : start + self.spec.batch]])
            if self.place.step % self.spec.keep_every == 0 and self.place.step < self.steps:
                self._keep()
        self._validate()
        self._keep()

    def close(self) -> None:
        """End the log."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def result(self) -> TrainedNetwork:
        """The best network."""
        self.network.load_state_dict(self.best)
        known = {
            key: self.samples.about[key] for key in ("dataset", "setup", "mesh", "force", "seen")
        }
        about = {
            **known,
            "split": {key: list(names) for key, names in asdict(self.split).items()},
            "training": self.spec.to_json(),
            "error": self.place.best,
            "raw_error": self.place.raw_error,
            "epoch": self.place.best_epoch + 1,
            "history": self.place.history,
        }
        return TrainedNetwork(self.network.eval(), self.body, about)

    # -- steps ------------------------------------------------------------------------------------------------------------------

    def _step(self, rows: IntArray) -> None:
        batch = self.samples.batch(rows).to(self.device)
        raw = batch.positions[:, self.body.index]
        self.network.train()
        with torch.autocast(
            self.device.type, torch.bfloat16, enabled=self.spec.mixed and self.device.type == "cuda"
        ):
            corrected = self.network(raw, batch.tool)
        loss = self.loss(corrected.float(), batch, raw)
        self.optimizer.zero_grad(set_to_none=True)
        loss.total.backward()
        self.optimizer.step()
        value = loss.total.item()
        if not value < float("inf"):
            raise CorrectionError(
                f"the loss is {value} in epoch {self.place.epoch + 1}, step {self.place.step + 1}; take a smaller rate than "
                f"{self.spec.rate:g}",
                key="rate",
                value=self.spec.rate,
            )
        self.place.loss += value
        self.place.step, self.place.total = self.place.step + 1, self.place.total + 1
        if self.place.total % _LOG_EVERY == 0:
            self._log(loss=value, distance=loss.distance.item(), hidden=loss.hidden.item())

    def _validate(self) -> None:
        place, self.network = self.place, self.network.eval()
        error = float(
            sample_errors(
                self.network, self.loss, self.body, self.samples, self.held_out, self.device
            ).mean()
        )
        loss = place.loss / self.steps
        place.history.append([loss, error, place.rate])
        self._log(
            validation=error, without_network=place.raw_error, rate=place.rate, epoch_loss=loss
        )
        if error < place.best:
            place.best, place.best_epoch, place.stale = error, place.epoch, 0
            self.best = {
                name: value.detach().clone() for name, value in self.network.state_dict().items()
            }
        else:
            place.stale += 1
            if place.stale % max(1, self.spec.patience // 2) == 0:
                place.rate /= 2
                self.optimizer.param_groups[0]["lr"] = place.rate
        place.epoch, place.step, place.loss = place.epoch + 1, 0, 0.0

    def _order(self, epoch: int) -> IntArray:
        """Of the samples in this epoch, whatever was drawn before."""
        generator = torch.Generator().manual_seed(self.spec.seed * 1_000_003 + epoch)
        return torch.randperm(len(self.rows), generator=generator).numpy()

    def _fraction(self) -> float:
        return min(1.0, (self.place.epoch + self.place.step / self.steps) / self.spec.epochs)

    def _told(self, rate: float) -> str:
        place = self.place
        best = (
            f", validation {place.best:.3f} mm (without {place.raw_error:.3f} mm)"
            if place.history
            else ""
        )
        speed = f", {rate:.0f} samples/s" if rate else ""
        return f"epoch {place.epoch + 1}, step {place.step + 1} of {self.steps}{best}{speed}"

    # -- what is kept -----------------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        self.network.set_input_scales(*_usual(self.samples, self.rows, self.body))
        raw = sample_errors(None, self.loss, self.body, self.samples, self.held_out, self.device)
        if not len(raw):
            names = ", ".join(self.split.validation)
            raise CorrectionError(
                f"no measured point in {names} to validate by; name other sequences",
                key="validation",
            )
        # What is worse than no network at all is not kept.
        self.place.raw_error = self.place.best = float(raw.mean())
        self.best = {
            name: value.detach().clone() for name, value in self.network.state_dict().items()
        }

    def _asked(self) -> dict[str, Any]:
        """What a checkpoint must agree with; more epochs, another device or interval may be asked
        of it.
        """
        free = ("device", "epochs", "keep_every")
        spec = {key: value for key, value in self.spec.to_json().items() if key not in free}
        names = ("dataset", "sequences", "points", "every", "seed", "mesh", "grid", "setup")
        about = {name: self.samples.about[name] for name in names}
        return {
            "spec": spec,
            "split": {key: list(names) for key, names in asdict(self.split).items()},
            "samples": about,
        }

    def _keep(self) -> None:
        checkpoint.save(
            self.folder / CHECKPOINT,
            {
                "asked": self._asked(),
                "place": asdict(self.place),
                "network": self.network.state_dict(),
                "best": self.best,
                "optimizer": self.optimizer.state_dict(),
                "random": checkpoint.random_state(),
            },
        )
        checkpoint.save_json(self.folder / HISTORY, self.place.history)

    def _resume(self) -> None:
        kept = checkpoint.load(self.folder / CHECKPOINT, self.device)
        try:
            asked, place = kept["asked"], _Place(**kept["place"])
            if asked != self._asked():
                differs = ", ".join(
                    key for key, value in self._asked().items() if asked.get(key) != value
                )
                raise CorrectionError(
                    f"{self.folder} holds another training ({differs} differ); name another folder",
                    key="folder",
                    value=str(self.folder),
                )
            self.network.load_state_dict(kept["network"])
            self.optimizer.load_state_dict(kept["optimizer"])
            checkpoint.restore_random_state(kept["random"])
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            path = self.folder / CHECKPOINT
            raise RunError(
                f"{path} does not fit ({type(error).__name__}: {error}); train in another folder",
                path=str(path),
            ) from None
        self.place, self.best = place, kept["best"]

    def _log(self, **values: float) -> None:
        if self._writer is None:
            from torch.utils.tensorboard import SummaryWriter

            # What was logged after the last checkpoint happens again.
            self._writer = SummaryWriter(
                str(self.folder / "tensorboard"), purge_step=self.place.total
            )
        for name, value in values.items():
            self._writer.add_scalar(name, value, self.place.total)


def _usual(samples: Samples, rows: IntArray, body: Body) -> tuple[float, float, float]:
    """RMS along an axis of the tool's velocity [m/s], its force [N] and of displacements [m], in
    one pass over the samples.
    """
    squares, counts, rest = (
        torch.zeros(3, dtype=torch.float64),
        torch.zeros(3, dtype=torch.float64),
        torch.as_tensor(body.rest),
    )
    for batch in samples.batches(rows, _CHUNK):
        parts = (
            batch.tool[:, 7:10].double(),
            batch.tool[:, 10:].double(),
            batch.positions[:, body.index].double() - rest,
        )
        squares += torch.stack([part.square().sum() for part in parts])
        counts += torch.tensor([part.numel() for part in parts])
    velocity, force, displacement = (squares / counts).sqrt().tolist()
    return velocity, force, displacement
