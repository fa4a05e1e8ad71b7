"""Training of a correction network in a folder.

A training is reproducible by its seed, stops by the error on the validation sequences, and resumes
exactly after an interruption.

run/
  checkpoint.pt     state of the training, see `palpate.correction.training_run`
  network.pt        the best network, once finished
  tensorboard/      errors by epoch and loss by step
"""

from __future__ import annotations

from pathlib import Path

from palpate.correction.networks.devices import device_of, reproducible
from palpate.correction.samples.sample_splits import Split
from palpate.correction.samples.sample_store import Samples
from palpate.correction.trained_network import FILE, TrainedNetwork
from palpate.correction.training_run import TrainingRun
from palpate.correction.training_spec import TrainingSpec
from palpate.foundation.progress import Report, silent

__all__ = ["train"]


def train(
    samples: Samples, split: Split, spec: TrainingSpec, folder: Path, report: Report = silent
) -> TrainedNetwork:
    """Train a network, or resume the training in `folder`; a finished one is only loaded.

    The weights with the lowest validation error are saved. The same samples, split, spec and
    versions of the libraries give the same weights bit for bit, however often the training is
    interrupted.

    Args:
        samples: the samples.
        split: sequences for training and validation.
        spec: the training.
        folder: folder of the training.
        report: receives the progress. It may raise Cancelled; the state stays in the folder.

    Raises:
        CorrectionError: the folder holds another training, or the loss is no longer finite.
    """
    device = device_of(spec.device)
    with reproducible(device, spec.seed, spec.threads):
        run = TrainingRun(samples, split, spec, folder, device)
        if run.done and (folder / FILE).exists():
            return TrainedNetwork.load(folder, device)
        try:
            while not run.done:
                run.epoch(report)
        finally:
            run.close()
        trained = run.result()
        trained.save(folder)
        error, without = trained.about["error"], trained.about["raw_error"]
        report(1.0, f"validation error {error:.3f} mm, {without:.3f} mm without the network")
        return trained
