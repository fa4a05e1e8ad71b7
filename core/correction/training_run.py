"""One training under way: steps, validation, checkpoints and the log.

The checkpoint holds weights, optimiser, progress, random state and the best weights so far, so that
an interrupted training continues as if it had not been interrupted.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from palpate.correction import checkpoint_file as checkpoint
from palpate.correction.networks.architectures import build
from palpate.correction.networks.chamfer import SurfaceLoss
from palpate.correction.sample_errors import sample_errors
from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.sample_splits import Split
from palpate.correction.samples.sample_store import Samples, body_for
from palpate.correction.trained_network import TrainedNetwork
from palpate.correction.training_spec import TrainingSpec
from palpate.dataset.provenance import software_of
from palpate.foundation.arrays import IntArray
from palpate.foundation.errors import CorrectionError, RunError
from palpate.foundation.progress import Report
from palpate.foundation.rounding import rounded

if TYPE_CHECKING:
    from torch.utils.tensorboard import SummaryWriter

__all__ = ["CHECKPOINT", "HISTORY", "TrainingRun"]

CHECKPOINT, HISTORY = "checkpoint.pt", "history.json"
_CHUNK = 256
"""Samples that are read at a time."""
_LOG_EVERY = 50
"""Steps between entries of the log."""


@dataclass
class _Progress:
    """State of a training as plain values, which a checkpoint holds under these names.

    Attributes:
        epoch: number of finished epochs.
        step: number of finished steps of the current epoch.
        total: number of finished steps of all epochs.
        loss: sum of the losses of the current epoch's steps [mm].
        rate: learning rate.
        best: lowest validation error so far [mm].
        best_epoch: epoch of the lowest validation error; -1 for the untrained network.
        stale: number of epochs since then.
        raw_error: validation error without a network [mm].
        history: [loss, validation error [mm], rate] of each epoch.
    """

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


class TrainingRun:
    """A training in its folder: it resumes from the folder's checkpoint if there is one.

    Args:
        samples: the samples.
        split: sequences for training and validation.
        spec: the training.
        folder: folder of the training.
        device: where the network is trained.
    """

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
            samples.seen[self.body.nodes],
            distance=spec.distance,
            hold=spec.hold,
            device=device,
        )
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=spec.rate, fused=True)
        self.progress, self.best = _Progress(rate=spec.rate), dict[str, Tensor]()
        self._writer: SummaryWriter | None = None
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / CHECKPOINT).exists():
            self._resume()
        else:
            self._begin()

    @property
    def steps(self) -> int:
        """Number of steps in an epoch."""
        return -(-len(self.rows) // self.spec.batch)

    @property
    def done(self) -> bool:
        """Whether the training is finished."""
        return self.progress.epoch >= self.spec.epochs or self.progress.stale >= self.spec.patience

    def epoch(self, report: Report) -> None:
        """Finish the current epoch and validate."""
        order = self._order(self.progress.epoch)
        begun, first = time.monotonic(), self.progress.step
        while self.progress.step < self.steps:
            start = self.progress.step * self.spec.batch
            rate = (
                (self.progress.step - first) * self.spec.batch / max(time.monotonic() - begun, 1e-9)
            )
            report(self._fraction(), self._text(rate))
            self._step(self.rows[order[start : start + self.spec.batch]])
            if self.progress.step % self.spec.keep_every == 0 and self.progress.step < self.steps:
                self._save_checkpoint()
        self._validate()
        self._save_checkpoint()

    def close(self) -> None:
        """Close the log."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def result(self) -> TrainedNetwork:
        """Return the best network."""
        self.network.load_state_dict(self.best)
        known = {
            key: self.samples.about[key] for key in ("dataset", "setup", "mesh", "force", "seen")
        }
        about = {
            **known,
            "made_from": _made_from(self.samples, self.spec),
            "split": {key: list(names) for key, names in asdict(self.split).items()},
            "training": self.spec.to_json(),
            "error": self.progress.best,
            "raw_error": self.progress.raw_error,
            "epoch": self.progress.best_epoch + 1,
            "history": self.progress.history,
        }
        return TrainedNetwork(self.network.eval(), self.body, about)

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
                f"the loss is {value} in epoch {self.progress.epoch + 1}, step "
                f"{self.progress.step + 1}; take a smaller rate than {self.spec.rate:g}",
                key="rate",
                value=self.spec.rate,
            )
        self.progress.loss += value
        self.progress.step, self.progress.total = self.progress.step + 1, self.progress.total + 1
        if self.progress.total % _LOG_EVERY == 0:
            self._log(loss=value, distance=loss.distance.item(), hidden=loss.hidden.item())

    def _validate(self) -> None:
        progress, self.network = self.progress, self.network.eval()
        error = float(
            sample_errors(
                self.network, self.loss, self.body, self.samples, self.held_out, self.device
            ).mean()
        )
        loss = progress.loss / self.steps
        progress.history.append([loss, error, progress.rate])
        self._log(
            validation=error,
            without_network=progress.raw_error,
            rate=progress.rate,
            epoch_loss=loss,
        )
        if error < progress.best:
            progress.best, progress.best_epoch, progress.stale = error, progress.epoch, 0
            self.best = {
                name: value.detach().clone() for name, value in self.network.state_dict().items()
            }
        else:
            progress.stale += 1
            if progress.stale % max(1, self.spec.patience // 2) == 0:
                progress.rate /= 2
                self.optimizer.param_groups[0]["lr"] = progress.rate
        progress.epoch, progress.step, progress.loss = progress.epoch + 1, 0, 0.0

    def _order(self, epoch: int) -> IntArray:
        """Return the order of the samples in an epoch, which depends on seed and epoch only."""
        generator = torch.Generator().manual_seed(self.spec.seed * 1_000_003 + epoch)
        return torch.randperm(len(self.rows), generator=generator).numpy()

    def _fraction(self) -> float:
        return min(1.0, (self.progress.epoch + self.progress.step / self.steps) / self.spec.epochs)

    def _text(self, rate: float) -> str:
        progress = self.progress
        best = (
            f", validation {progress.best:.3f} mm (without {progress.raw_error:.3f} mm)"
            if progress.history
            else ""
        )
        speed = f", {rate:.0f} samples/s" if rate else ""
        return f"epoch {progress.epoch + 1}, step {progress.step + 1} of {self.steps}{best}{speed}"

    def _begin(self) -> None:
        self.network.set_input_scales(*_input_scales(self.samples, self.rows, self.body))
        raw = sample_errors(None, self.loss, self.body, self.samples, self.held_out, self.device)
        if not len(raw):
            names = ", ".join(self.split.validation)
            raise CorrectionError(
                f"no measured point in {names} to validate by; name other sequences",
                key="validation",
            )
        # A network that is worse than none is not saved.
        self.progress.raw_error = self.progress.best = float(raw.mean())
        self.best = {
            name: value.detach().clone() for name, value in self.network.state_dict().items()
        }

    def _identity(self) -> dict[str, Any]:
        """Return the inputs that a checkpoint must agree with.

        Device, number of epochs and checkpoint interval may change when a training resumes.
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

    def _save_checkpoint(self) -> None:
        checkpoint.save(
            self.folder / CHECKPOINT,
            {
                "asked": self._identity(),
                "place": asdict(self.progress),
                "network": self.network.state_dict(),
                "best": self.best,
                "optimizer": self.optimizer.state_dict(),
                "random": checkpoint.random_state(),
            },
        )
        checkpoint.save_json(self.folder / HISTORY, self.progress.history)

    def _resume(self) -> None:
        state = checkpoint.load(self.folder / CHECKPOINT, self.device)
        try:
            identity, progress = state["asked"], _Progress(**state["place"])
            expected = rounded(self._identity())
            if (stored := rounded(identity)) != expected:
                differs = ", ".join(checkpoint.differing(stored, expected))
                raise CorrectionError(
                    f"{self.folder} holds another training (different {differs}): "
                    "start a new one in another folder",
                    key="folder",
                    value=str(self.folder),
                )
            self.network.load_state_dict(state["network"])
            self.optimizer.load_state_dict(state["optimizer"])
            checkpoint.restore_random_state(state["random"])
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            path = self.folder / CHECKPOINT
            raise RunError(
                f"{path} does not fit ({type(error).__name__}: {error}); train in another folder",
                path=str(path),
            ) from None
        self.progress, self.best = progress, state["best"]

    def _log(self, **values: float) -> None:
        if self._writer is None:
            from torch.utils.tensorboard import SummaryWriter

            # Steps after the last checkpoint are logged again.
            self._writer = SummaryWriter(
                str(self.folder / "tensorboard"), purge_step=self.progress.total
            )
        for name, value in values.items():
            self._writer.add_scalar(name, value, self.progress.total)


def _input_scales(samples: Samples, rows: IntArray, body: Body) -> tuple[float, float, float]:
    """Return the RMS along an axis of tool velocity [m/s], force [N] and displacement [m]."""
    squares, counts, rest = (
        torch.zeros(3, dtype=torch.float64),
        torch.zeros(3, dtype=torch.float64),
        torch.as_tensor(body.rest[: body.count]),
    )
    for batch in samples.batches(rows, _CHUNK):
        parts = (
            batch.tool[:, 7:10].double(),
            batch.tool[:, 10:].double(),
            batch.positions[:, body.nodes].double() - rest,
        )
        squares += torch.stack([part.square().sum() for part in parts])
        counts += torch.tensor([part.numel() for part in parts])
    velocity, force, displacement = (squares / counts).sqrt().tolist()
    return velocity, force, displacement


def _made_from(samples: Samples, spec: TrainingSpec) -> dict[str, Any]:
    """The data and code of the samples, and the code and seed of this training."""
    made = samples.about.get("made_from", {})
    return {**software_of(), "data": made.get("data"), "seed": spec.seed, "samples": made}
