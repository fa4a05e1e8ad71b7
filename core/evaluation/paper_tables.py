"""The three tables of Wu, Kazanzides and Unberath (2020).

They are a coarse and a fine search for Young's modulus, and the errors that networks remove.

The paper searches for the modulus on its training data and finds errors that differ between moduli.
In a converged quasi-static replay they do not: the tool is driven by position, and the shape of a
homogeneous block then does not depend on its stiffness. The search is done nevertheless, and the
result says what it shows.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from palpate.dataset import Dataset
from palpate.evaluation.loaded_network import LoadedNetwork
from palpate.evaluation.run_evaluation import EvaluationData, LadderStep
from palpate.evaluation.train_network import TrainingPlan, train_network
from palpate.foundation.progress import Report, part, silent
from palpate.setup.setup import Setup
from palpate.sweep import Axis, ParameterSpace, SweepSpec
from palpate.sweep.run_sweep import run_sweep

__all__ = ["MODULI", "PaperRequest", "interpret_search", "run_paper"]

MODULI = (5e3, 1e4, 1e1)
"""Young's moduli at which the paper corrects the simulation [Pa]."""
KINDS = ("unet2d", "unet3d")
COARSE, DECADES = (1e1, 1e5), 5
"""Range [Pa] of the coarse search, and its number of moduli."""
FINE_STEPS = 7
"""Number of moduli of the fine search."""
_NAME = "young_modulus.E"


@dataclass(frozen=True, kw_only=True)
class PaperRequest:
    """The effort that the tables are made with.

    Attributes:
        frames: most clouds of each sequence that a search compares with.
        training: the training of each network.
        moduli: Young's moduli at which networks are trained [Pa].
    """

    frames: int = 8
    training: TrainingPlan = field(default_factory=TrainingPlan)
    moduli: tuple[float, ...] = MODULI


def run_paper(
    dataset: Dataset,
    folder: Path,
    *,
    store: Path,
    samples: Path,
    request: PaperRequest = PaperRequest(),
    workers: int = 2,
    seed: int = 0,
    report: Report = silent,
) -> dict[str, Any]:
    """Make the three tables, or resume; return plain values, and write them to paper.json.

    Args:
        dataset: the dataset.
        folder: folder of searches, trainings and the result.
        store: folder of the replay cache.
        samples: folder of samples for all trainings.
        request: the effort.
        workers: number of processes.
        seed: seed of the resampling.
        report: receives the progress.
    """
    folder.mkdir(parents=True, exist_ok=True)
    search = _ModulusSearch(dataset, request.frames, store, workers)
    coarse = search.run(folder / "coarse", COARSE, DECADES, part(report, 0.0, 0.08))
    fine = search.run(
        folder / "fine", _fine_range(dataset, coarse), FINE_STEPS, part(report, 0.08, 0.18)
    )
    data = EvaluationData.read(dataset, report=part(report, 0.18, 0.2))
    corrections = _Corrections(data, folder, samples, request.training, workers, seed)
    rows = []
    for number, modulus in enumerate(request.moduli):
        low, width = 0.2 + 0.8 * number / len(request.moduli), 0.8 / len(request.moduli)
        rows.append(corrections.row(modulus, part(report, low, low + width)))
    result = {
        "format": 1,
        "dataset": dataset.name,
        "unit": "mm",
        "coarse": _table(coarse),
        "fine": _table(fine),
        "what_the_search_shows": interpret_search(coarse, fine),
        "correction": rows,
    }
    aside = folder / ".paper.json.part"
    aside.write_text(json.dumps(result, indent=1) + "\n")
    os.replace(aside, folder / "paper.json")
    report(1.0, "done")
    return result


def _fine_range(dataset: Dataset, coarse: Mapping[str, Any]) -> tuple[float, float]:
    """Return the range [Pa] of the fine search: half a decade to both sides of the best modulus.

    In a flat search every modulus is the best; the stated one is taken.
    """
    flat = all(one["flat"] for one in coarse["directions"])
    best = dataset.config.young_modulus if flat else coarse["best"]["values"][_NAME]
    return max(COARSE[0], best / 10**0.5), best * 10**0.5


@dataclass(frozen=True, eq=False)
class _ModulusSearch:
    """A search for Young's modulus on the validation sequences, by the paper's metric.

    Attributes:
        dataset: the dataset.
        frames: most clouds of each sequence.
        store: folder of the replay cache.
        workers: number of processes.
    """

    dataset: Dataset
    frames: int
    store: Path
    workers: int

    def run(
        self, folder: Path, span: tuple[float, float], steps: int, report: Report
    ) -> dict[str, Any]:
        """Search the range `span` [Pa]; return the summary of the sweep with all its rows."""
        config = self.dataset.config
        names = tuple(name for name in config.validation if len(self.dataset.sequence(name)))
        spec = SweepSpec(
            space=ParameterSpace((Axis(_NAME, *span),)),
            steps=steps,
            sequences=names,
            frames=self.frames,
            measure="paper",
        )
        summary = run_sweep(
            self.dataset, spec, folder, store=self.store, workers=self.workers, report=report
        )
        rows = [json.loads(line) for line in (folder / "points.jsonl").read_text().splitlines()]
        last = {row["number"]: row for row in rows}
        return {**summary, "rows": [row for row in last.values() if row["kind"] != "stated"]}


def _table(search: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return modulus [Pa] and mean distance [mm] of each point; None where it failed."""
    rows = sorted(search["rows"], key=lambda row: float(row["values"][_NAME]))
    return [
        {
            "young_modulus": row["values"][_NAME],
            "mean_distance": None if row["paper"] is None else round(1e3 * row["paper"], 5),
        }
        for row in rows
    ]


def interpret_search(coarse: Mapping[str, Any], fine: Mapping[str, Any]) -> str:
    """Return a text that says what the two searches mean."""
    changes = [one["change"] * 1e3 for search in (coarse, fine) for one in search["directions"]]
    most = max(changes, default=0.0)
    if not all(one["flat"] for search in (coarse, fine) for one in search["directions"]):
        return (
            f"The mean distance changes by up to {most:.3g} mm with Young's modulus: something has "
            "a force scale of its own."
        )
    change = "less than 0.001 mm" if most < 1e-3 else f"no more than {most:.1g} mm"
    return (
        f"Both searches are flat: from {COARSE[0]:.0f} to {COARSE[1]:.0f} Pa the mean distance "
        f"changes by {change}. Driven by position and slowly, a homogeneous phantom takes the same "
        "shape whatever its stiffness: the modulus cancels, and clouds cannot determine it. Where "
        "a search like this finds a best modulus, the replay had not converged."
    )


@dataclass(frozen=True, eq=False)
class _Corrections:
    """Networks that are trained on the stated model with another modulus.

    Attributes:
        data: the test sequences.
        folder: folder of the trainings.
        samples: folder of samples for all trainings.
        training: the training of each network.
        workers: number of processes.
        seed: seed of the resampling.
    """

    data: EvaluationData
    folder: Path
    samples: Path
    training: TrainingPlan
    workers: int
    seed: int

    def row(self, modulus: float, report: Report) -> dict[str, Any]:
        """Train both networks at a modulus [Pa] and compare them on the test sequences."""
        setup = _with_modulus(self.data.stated, modulus)
        networks = {}
        for number, kind in enumerate(KINDS):
            folder = self.folder / f"E-{modulus:.0e}-{kind}"
            train_network(
                self.data.dataset,
                self._plan(kind),
                folder,
                store=self.samples,
                setup=setup,
                workers=self.workers,
                report=part(report, 0.45 * number, 0.45 * (number + 1)),
            )
            networks[kind] = LoadedNetwork.load(folder)
        ladder = self.data.compute_ladder(
            [LadderStep("simulation", "simulation", setup, networks)],
            workers=self.workers,
            seed=self.seed,
            report=part(report, 0.9, 1.0),
        )
        return {
            "young_modulus": modulus,
            "parts": [_row(one) for one in _reported(ladder["parts"])],
        }

    def _plan(self, kind: str) -> TrainingPlan:
        network = {**dict(self.training.spec.get("network", {})), "kind": kind}
        return replace(self.training, spec={**self.training.spec, "network": network})


def _reported(parts: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return [one for one in parts if one["part"] in ("all", "kind")]


def _row(one: Mapping[str, Any]) -> dict[str, Any]:
    """Return the paper's metric of simulation and networks, and of 3D beyond 2D, for one part."""
    errors = one["errors"]
    return {
        "name": one["name"],
        "probes": one["probes"],
        **{name: errors[name]["paper"] for name in ("simulation", *KINDS)},
        "unet3d_beyond_unet2d": one["beyond_second"]["unet3d"]["paper"],
    }


def _with_modulus(setup: Setup, modulus: float) -> Setup:
    return replace(setup, material=replace(setup.material, young_modulus=modulus))
