from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from learned_samples import write_samples

from palpate.correction import (
    Learner,
    NetworkSpec,
    OnlineSpec,
    Split,
    TrainingSpec,
    learn_online,
    train,
)
from palpate.foundation.errors import Cancelled, CorrectionError


def test_online_learning_adapts_to_a_change_of_the_material(bench, stiffer, tmp_path):
    network = NetworkSpec(kind="graph", features=(8, 16, 24))
    spec = TrainingSpec(network=network, rate=2e-3, batch=8, epochs=8, device="cpu")
    trained = train(bench.samples, Split.of(bench.samples), spec, tmp_path)
    before, after = bench.samples.rows(["poke-top-03"]), stiffer.samples.rows(["poke-top-01"])
    stream = learn_online(
        trained,
        [(bench.samples, ["poke-top-03"]), (stiffer.samples, ["poke-top-01"])],
        OnlineSpec(),
    )
    assert len(stream.online) == len(before) + len(after)
    first, second = slice(None, len(before)), slice(len(before), None)
    # On the trained material it is as good as before; on the other material the frozen network is
    # worse than none.
    assert (
        np.mean(stream.online[first])
        < 1.02 * np.mean(stream.frozen[first])
        < np.mean(stream.raw[first])
    )
    assert np.mean(stream.frozen[second]) > np.mean(stream.raw[second])
    late = slice(-len(after) // 2, None)
    assert np.mean(stream.online[late]) < 0.95 * np.mean(stream.frozen[late])


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    samples = write_samples(tmp_path_factory.mktemp("online") / "samples", rows=10)
    spec = TrainingSpec(
        network=NetworkSpec(kind="unet3d", features=(4, 6)), batch=8, epochs=1, device="cpu"
    )
    return samples, train(
        samples, Split.of(samples), spec, tmp_path_factory.mktemp("online") / "run"
    )


def test_each_frame_is_predicted_before_it_is_learned_from(known):
    samples, trained = known
    frame = samples.batch(samples.rows(["three"])[:1])
    learner = Learner(trained, OnlineSpec())
    with torch.no_grad():
        expected = trained.network(frame.positions, frame.tool)
    assert torch.equal(learner.predict(frame), expected)
    stream = learn_online(trained, [(samples, ["three"])], OnlineSpec())
    assert stream.online[0] == stream.frozen[0]
    assert stream.online[0] == pytest.approx(learner.error(expected, frame))


def test_original_network_does_not_change(known):
    samples, trained = known
    before = [value.clone() for value in trained.network.state_dict().values()]
    learn_online(trained, [(samples, ["two"])], OnlineSpec())
    assert all(
        torch.equal(a, b)
        for a, b in zip(before, trained.network.state_dict().values(), strict=True)
    )


def test_without_steps_nothing_is_learned(known):
    samples, trained = known
    stream = learn_online(trained, [(samples, ["two"])], OnlineSpec(steps=0))
    assert np.array_equal(stream.online, stream.frozen)


def test_same_seed_learns_the_same(known):
    samples, trained = known
    runs = [
        learn_online(trained, [(samples, ["two"])], OnlineSpec(seed=seed, memory=4)).online
        for seed in (0, 0, 1)
    ]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_stream_can_be_cancelled(known):
    samples, trained = known

    def stop(fraction: float, text: str) -> None:
        if "4 of" in text:
            raise Cancelled

    with pytest.raises(Cancelled):
        learn_online(trained, [(samples, ["two"])], OnlineSpec(), stop)


@pytest.mark.parametrize(
    ("key", "value"), [("rate", 2.0), ("batch", 0), ("steps", -1), ("memory", 0)]
)
def test_invalid_settings_are_refused(key, value):
    with pytest.raises(CorrectionError, match=key):
        replace(OnlineSpec(), **{key: value})
