from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
import torch
from learned_samples import write_samples
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from palpate.correction import (
    NetworkSpec,
    Samples,
    Split,
    SurfaceLoss,
    TrainedNetwork,
    TrainingSpec,
    sample_errors,
    train,
)
from palpate.correction.training_run import CHECKPOINT, TrainingRun
from palpate.foundation.errors import Cancelled, CorrectionError, RunError
from palpate.foundation.progress import silent

TINY = TrainingSpec(
    network=NetworkSpec(kind="unet3d", features=(4, 6)),
    rate=5e-3,
    batch=8,
    epochs=5,
    keep_every=2,
    device="cpu",
    threads=1,
)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Samples:
    return write_samples(tmp_path_factory.mktemp("training") / "samples")


def _weights(trained: TrainedNetwork) -> list[torch.Tensor]:
    return list(trained.network.state_dict().values())


def _same(one: TrainedNetwork, other: TrainedNetwork) -> bool:
    return all(torch.equal(a, b) for a, b in zip(_weights(one), _weights(other), strict=True))


def _stop_at(step: int):
    """A report that cancels at its nth call."""
    calls = iter(range(10**9))

    def report(fraction: float, text: str) -> None:
        assert 0 <= fraction <= 1
        if next(calls) == step:
            raise Cancelled

    return report


@pytest.mark.parametrize("kind", ["unet2d", "unet3d", "graph"])
def test_network_reduces_the_error_of_a_held_out_sequence(kind, bench, tmp_path):
    spec = TrainingSpec(
        network=NetworkSpec(kind=kind, features=(8, 16, 32)),
        rate=2e-3,
        batch=8,
        epochs=8,
        patience=8,
        device="cpu",
    )
    split = Split.of(bench.samples)
    trained = train(bench.samples, split, spec, tmp_path / "run")
    loss = SurfaceLoss(trained.body, bench.samples.seen[trained.body.index])
    rows = bench.samples.rows(split.test)
    raw, corrected = (
        sample_errors(network, loss, trained.body, bench.samples, rows).mean()
        for network in (None, trained.network)
    )
    assert corrected < 0.92 * raw
    assert trained.about["error"] < trained.about["raw_error"]


def test_hidden_points_stay_at_their_simulated_positions(bench, tmp_path):
    moved = []
    for hold in (0.0, 1.0):
        spec = TrainingSpec(
            network=NetworkSpec(kind="unet3d", features=(8, 16)),
            hold=hold,
            rate=2e-3,
            batch=8,
            epochs=3,
            device="cpu",
        )
        trained = train(bench.samples, Split.of(bench.samples), spec, tmp_path / str(hold))
        batch = bench.samples.batch(bench.samples.rows(["poke-top-03"]))
        with torch.no_grad():
            moved.append(
                (trained.network(batch.positions, batch.tool) - batch.positions)[
                    :, bench.samples.seen == 0
                ]
                .norm(dim=2)
                .mean()
            )
    assert moved[1] < 0.5 * moved[0]


def test_weights_are_reproducible_by_the_seed(samples, tmp_path):
    first, second = (
        train(samples, Split.of(samples), TINY, tmp_path / name) for name in ("first", "second")
    )
    other = train(samples, Split.of(samples), replace(TINY, seed=1), tmp_path / "other")
    assert _same(first, second)
    assert not _same(first, other)


@pytest.mark.parametrize("step", [1, 4, 5, 9])
def test_cancelled_training_resumes_exactly(samples, tmp_path, step):
    whole = train(samples, Split.of(samples), TINY, tmp_path / "whole")
    with pytest.raises(Cancelled):
        train(samples, Split.of(samples), TINY, tmp_path / "stopped", _stop_at(step))
    assert not (tmp_path / "stopped" / "network.pt").exists()
    again = train(samples, Split.of(samples), TINY, tmp_path / "stopped")
    assert _same(whole, again)
    assert again.about["history"] == whole.about["history"]


def test_training_killed_at_a_random_moment_ends_with_the_same_weights(samples, tmp_path):
    spec = replace(TINY, epochs=60, patience=60, keep_every=2)
    whole = train(samples, Split.of(samples), spec, tmp_path / "whole")
    code = (
        "import sys, json; from pathlib import Path\n"
        "from palpate.correction import *\n"
        "samples = open_samples(Path(sys.argv[1]))\n"
        "spec = TrainingSpec.from_json(json.loads(sys.argv[3]))\n"
        "train(samples, Split.of(samples), spec, Path(sys.argv[2]))\n"
    )
    killed = tmp_path / "killed"
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(samples.folder), str(killed), json.dumps(spec.to_json())]
    )
    while not (killed / CHECKPOINT).exists():
        assert process.poll() is None
        time.sleep(0.005)
    wait = random.uniform(0.0, 0.4)
    time.sleep(wait)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL, f"it ended by itself within {wait:.3f} s"
    assert not (killed / "network.pt").exists()
    again = train(samples, Split.of(samples), spec, killed)
    assert _same(whole, again), f"killed {wait:.3f} s after its first checkpoint"
    assert again.about["history"] == whole.about["history"]


def test_finished_training_is_returned_as_it_is(samples, tmp_path):
    first = train(samples, Split.of(samples), TINY, tmp_path)
    before = (tmp_path / "network.pt").stat().st_mtime_ns
    assert _same(first, train(samples, Split.of(samples), TINY, tmp_path))
    assert (tmp_path / "network.pt").stat().st_mtime_ns == before


def test_training_stops_without_improvement_and_keeps_the_best_weights(samples, tmp_path):
    trained = train(
        samples, Split.of(samples), replace(TINY, rate=0.3, epochs=50, patience=3), tmp_path
    )
    errors = [row[1] for row in trained.about["history"]]
    assert len(errors) < 50
    assert trained.about["error"] == min([*errors, trained.about["raw_error"]])
    loss = SurfaceLoss(trained.body, samples.seen)
    error = (
        sample_errors(
            trained.network,
            loss,
            trained.body,
            samples,
            samples.rows(trained.about["split"]["validation"]),
        )
        .mean()
        .item()
    )
    assert error == pytest.approx(trained.about["error"], rel=1e-5)
    rates = [row[2] for row in trained.about["history"]]
    assert rates[-1] < rates[0]


def test_other_training_in_the_folder_is_not_overwritten(samples, tmp_path):
    train(samples, Split.of(samples), replace(TINY, epochs=1), tmp_path)
    with pytest.raises(CorrectionError, match="another training"):
        train(samples, Split.of(samples), replace(TINY, rate=1e-4), tmp_path)


def test_training_on_another_model_is_another_training(samples, tmp_path):
    train(samples, Split.of(samples), replace(TINY, epochs=1), tmp_path)
    extended = replace(samples, about={**samples.about, "setup": {"tool": {"radius": 6e-3}}})
    with pytest.raises(CorrectionError, match=r"samples\.setup"):
        train(extended, Split.of(extended), replace(TINY, epochs=1), tmp_path)


def test_finished_training_can_be_continued_for_more_epochs(samples, tmp_path):
    train(samples, Split.of(samples), replace(TINY, epochs=2), tmp_path / "more")
    more = train(samples, Split.of(samples), TINY, tmp_path / "more")
    assert _same(more, train(samples, Split.of(samples), TINY, tmp_path / "at-once"))


def test_damaged_checkpoint_is_named(samples, tmp_path):
    (tmp_path / CHECKPOINT).write_bytes(b"not a checkpoint")
    with pytest.raises(RunError, match=CHECKPOINT):
        train(samples, Split.of(samples), TINY, tmp_path)


def test_diverging_training_says_what_to_do(samples, tmp_path):
    run = TrainingRun(samples, Split.of(samples), TINY, tmp_path, torch.device("cpu"))
    with torch.no_grad():
        next(run.network.parameters()).fill_(float("nan"))
    with pytest.raises(CorrectionError, match="smaller rate"):
        run.epoch(silent)


def test_log_for_tensorboard_has_every_epoch(samples, tmp_path):
    trained = train(samples, Split.of(samples), TINY, tmp_path)
    log = EventAccumulator(str(tmp_path / "tensorboard"))
    log.Reload()
    assert [event.value for event in log.Scalars("validation")] == pytest.approx(
        [row[1] for row in trained.about["history"]], rel=1e-6
    )


def test_torchs_random_state_and_threads_are_restored(samples, tmp_path):
    torch.manual_seed(3)
    expected, threads = torch.rand(1), torch.get_num_threads()
    torch.manual_seed(3)
    train(samples, Split.of(samples), replace(TINY, epochs=1, threads=2), tmp_path)
    assert torch.equal(torch.rand(1), expected)
    assert torch.get_num_threads() == threads


def test_sequence_on_two_sides_is_refused(samples):
    with pytest.raises(CorrectionError, match="two sides"):
        Split.of(samples, test=("one",))


def test_split_without_validation_takes_the_last_of_several(tmp_path):
    samples = write_samples(tmp_path / "samples", rows=2, names=("a", "b", "c", "d"))
    samples.about["splits"]["validation"] = []
    split = Split.of(samples)
    assert (split.train, split.validation, split.test) == (("a",), ("b",), ("d",))
    with pytest.raises(CorrectionError, match="validation"):
        Split.of(samples, train=("a",))


def test_unknown_sequence_is_named_with_those_there_are(samples):
    with pytest.raises(CorrectionError, match="one, two, three"):
        Split.of(samples, train=("poke-99",))


_WRONG = [
    ("rate", 0.0),
    ("batch", 0),
    ("epochs", 0),
    ("hold", -1.0),
    ("threads", 0),
    ("distance", "l2"),
]


@pytest.mark.parametrize(("key", "value"), _WRONG)
def test_invalid_specification_is_refused(key, value):
    with pytest.raises(CorrectionError, match=key):
        TrainingSpec(**{key: value})


def test_missing_device_is_named(samples, tmp_path):
    with pytest.raises(CorrectionError, match="tpu"):
        train(samples, Split.of(samples), replace(TINY, device="tpu"), tmp_path)


def test_specification_survives_json():
    assert TrainingSpec.from_json(TINY.to_json()) == TINY
    assert TrainingSpec.from_json({"epochs": 3}) == TrainingSpec(epochs=3)


def test_trained_network_survives_its_file(samples, tmp_path):
    trained = train(samples, Split.of(samples), TINY, tmp_path)
    again = TrainedNetwork.load(tmp_path)
    batch = samples.batch(samples.rows(["three"])[:2])
    with torch.no_grad():
        assert torch.equal(
            again.network(batch.positions, batch.tool), trained.network(batch.positions, batch.tool)
        )
    assert again.about == trained.about


def test_missing_network_says_train_first(tmp_path):
    with pytest.raises(RunError, match="train first"):
        TrainedNetwork.load(tmp_path)
