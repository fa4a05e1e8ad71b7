"""The paper's three tables: interpretation of the modulus search, and a run on a small phantom."""

from __future__ import annotations

from pathlib import Path

import pytest

from palpate.dataset import open_dataset
from palpate.evaluation.paper_tables import PaperRequest, interpret_search, run_paper
from palpate.evaluation.train_network import TrainingPlan
from palpate.synthetic import HiddenEffect, Scenario, make_dataset


def _search(change: float, flat: bool) -> dict[str, object]:
    return {"directions": [{"change": change, "flat": flat}]}


def test_flat_search_is_explained_by_the_cancelling_modulus():
    text = interpret_search(_search(2e-9, True), _search(4e-9, True))
    assert (
        "Both searches are flat" in text
        and "less than 0.001 mm" in text
        and "the modulus cancels" in text
    )


def test_search_with_a_change_is_not_called_flat():
    assert "changes by up to 0.31 mm" in interpret_search(
        _search(3.1e-4, False), _search(1e-5, True)
    )


@pytest.mark.slow
def test_tables_on_a_small_phantom(tmp_path: Path):
    splits = {"train": ("poke-top-01",), "validation": ("poke-top-02",), "test": ("poke-top-03",)}
    scenario = Scenario(
        effects=(HiddenEffect("tool_radius", {"radius": 7e-3}),),
        sequences=("poke-top-01", "poke-top-02", "poke-top-03"),
        splits=splits,
        fine=6e-3,
        density=900,
        rate=2.0,
        robot_rate=200.0,
    )
    make_dataset(tmp_path / "block", scenario, 3)
    training = TrainingPlan(
        spec={"network": {"features": [8, 16]}, "epochs": 4, "batch": 8, "rate": 3e-3}
    )
    request = PaperRequest(frames=3, training=training, moduli=(5e3, 1e1))
    dataset, store, samples = (
        open_dataset(tmp_path / "block"),
        tmp_path / "store",
        tmp_path / "samples",
    )
    found = run_paper(dataset, tmp_path / "paper", store=store, samples=samples, request=request)
    for table, moduli in (("coarse", 5), ("fine", 7)):
        distances = [row["mean_distance"] for row in found[table]]
        assert len(distances) == moduli and max(distances) - min(distances) < 2e-3
    assert "the modulus cancels" in found["what_the_search_shows"]
    stiff, soft = found["correction"]
    assert (stiff["young_modulus"], soft["young_modulus"]) == (5e3, 1e1)
    for one, other in zip(stiff["parts"], soft["parts"], strict=True):
        assert one["simulation"]["error"] == pytest.approx(other["simulation"]["error"], abs=2e-3)
        assert {"unet2d", "unet3d"} <= one.keys()
