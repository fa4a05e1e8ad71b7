"""The three tables of Wu, Kazanzides and Unberath (2020): a coarse and a fine search for the
modulus, and what networks correct.

The paper searches for Young's modulus on its training data and finds errors that differ from
modulus to modulus. In a replay that converges they do not: the tool is driven by position, and a
homogeneous block that is pushed slowly takes one shape whatever its stiffness. The search is done
all the same, and what it shows is said beside it.
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

__all__ = ["MODULI", "PaperRequest", "run_paper", "interpret_search"]

MODULI = (5e3, 1e4, 1e1)
"""Young's moduli at which the paper corrects the simulation [Pa]."""
KINDS = ("unet2d", "unet3d")
COARSE, DECADES = (1e1, 1e5), 5
FINE_STEPS = 7
_NAME = "young_modulus.E"


@dataclass(frozen=True, kw_only=True)
class PaperRequest:
    """How thoroughly the tables are made.

    Attributes:
        frames: clouds of each sequence that a search compares with.
        training: of each network, see `palpate.evaluation.train_network`.
        moduli: at which networks are trained [Pa].
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
    """The three tables, as plain values; written to `folder`/paper.json at the end. What was begun
    there goes on.

    Args:
        store: folder of replays that are known.
        samples: folder of samples for all trainings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    coarse = _search(
        dataset,
        folder / "coarse",
        COARSE,
        DECADES,
        request.frames,
        store,
        workers,
        part(report, 0.0, 0.08),
    )
    flat = all(one["flat"] for one in coarse["directions"])
    best = (
        dataset.config.young_modulus if flat else coarse["best"]["values"][_NAME]
    )  # of a flat search any modulus is the best
    near = (max(COARSE[0], best / 10**0.5), best * 10**0.5)
    fine = _search(
        dataset,
        folder / "fine",
        near,
        FINE_STEPS,
        request.frames,
        store,
        workers,
        part(report, 0.08, 0.18),
    )
    bench = EvaluationData.read(dataset, report=part(report, 0.18, 0.2))
    rows = []
    for number, modulus in enumerate(request.moduli):
        low, width = 0.2 + 0.8 * number / len(request.moduli), 0.8 / len(request.moduli)
        rows.append(
            _corrected(
                bench,
                modulus,
                folder,
                samples,
                request.training,
                workers,
                seed,
                part(report, low, low + width),
            )
        )
    found = {
        "format": 1,
        "dataset": dataset.name,
        "unit": "mm",
        "coarse": _table(coarse),
        "fine": _table(fine),
        "what_the_search_shows": interpret_search(coarse, fine),
        "correction": rows,
    }
    aside = folder / ".paper.json.part"
    aside.write_text(json.dumps(found, indent=1) + "\n")
    os.replace(aside, folder / "paper.json")
    report(1.0, "done")
    return found


def _search(
    dataset: Dataset,
    folder: Path,
    span: tuple[float, float],
    steps: int,
    frames: int,
    store: Path,
    workers: int,
    report: Report,
) -> dict[str, Any]:
    """A search over the modulus on the sequences that validate, by the paper's metric; with all of
    its points.
    """
    names = tuple(name for name in dataset.config.validation if len(dataset.sequence(name)))
    space = ParameterSpace((Axis(_NAME, *span),))
    request = SweepSpec(space=space, steps=steps, sequences=names, frames=frames, measure="paper")
    found = run_sweep(dataset, request, folder, store=store, workers=workers, report=report)
    rows = [json.loads(line) for line in (folder / "points.jsonl").read_text().splitlines()]
    last = {row["number"]: row for row in rows}
    return {**found, "rows": [row for row in last.values() if row["kind"] != "stated"]}


def _table(search: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Modulus [Pa] and mean distance [mm], None where a point failed."""
    rows = sorted(search["rows"], key=lambda row: float(row["values"][_NAME]))
    return [
        {
            "young_modulus": row["values"][_NAME],
            "mean_distance": None if row["paper"] is None else round(1e3 * row["paper"], 5),
        }
        for row in rows
    ]


def interpret_search(coarse: Mapping[str, Any], fine: Mapping[str, Any]) -> str:
    """What the two searches mean."""
    changes = [one["change"] * 1e3 for search in (coarse, fine) for one in search["directions"]]
    most = max(changes, default=0.0)
    if not all(one["flat"] for search in (coarse, fine) for one in search["directions"]):
        return f"The mean distance changes by up to {most:.3g} mm with Young's modulus: something has a force scale of its own."
    change = "less than 0.001 mm" if most < 1e-3 else f"no more than {most:.1g} mm"
    return (
        f"Both searches are flat: from {COARSE[0]:.0f} to {COARSE[1]:.0f} Pa the mean distance changes by {change}. "
        "Driven by position and slowly, a homogeneous block takes one shape whatever its stiffness: the modulus cancels, and "
        "clouds cannot tell it. Where a search like this finds a best modulus, the replay had not converged."
    )


def _corrected(
    bench: EvaluationData,
    modulus: float,
    folder: Path,
    samples: Path,
    training: TrainingPlan,
    workers: int,
    seed: int,
    report: Report,
) -> dict[str, Any]:
    """Train both networks on the stated model with this modulus, and compare on the test
    sequences."""
    setup = _with_modulus(bench.stated, modulus)
    networks = {}
    for number, kind in enumerate(KINDS):
        spec = {
            **training.spec,
            "network": {**dict(training.spec.get("network", {})), "kind": kind},
        }
        place = folder / f"E-{modulus:.0e}-{kind}"
        told = part(report, 0.45 * number, 0.45 * (number + 1))
        train_network(
            bench.dataset,
            replace(training, spec=spec),
            place,
            store=samples,
            setup=setup,
            workers=workers,
            report=told,
        )
        networks[kind] = LoadedNetwork.load(place)
    climbed = bench.compute_ladder(
        [LadderStep("simulation", "simulation", setup, networks)],
        workers=workers,
        seed=seed,
        report=part(report, 0.9, 1.0),
    )
    return {"young_modulus": modulus, "parts": [_row(one) for one in _of(climbed["parts"])]}


def _of(parts: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return [one for one in parts if one["part"] in ("all", "kind")]


def _row(one: Mapping[str, Any]) -> dict[str, Any]:
    """Of one part: the paper's metric of the simulation and of both networks, and how much nearer
    the 3D one is than the 2D one.
    """
    errors = one["errors"]
    return {
        "name": one["name"],
        "probes": one["probes"],
        **{name: errors[name]["paper"] for name in ("simulation", *KINDS)},
        "unet3d_beyond_unet2d": one["beyond_second"]["unet3d"]["paper"],
    }


def _with_modulus(setup: Setup, modulus: float) -> Setup:
    return replace(setup, material=replace(setup.material, young_modulus=modulus))
