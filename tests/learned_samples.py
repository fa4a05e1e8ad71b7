"""Small synthetic samples: a block that is lower than simulated, most of all around the tool."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from palpate.correction import Body, Samples, open_samples
from palpate.correction.samples.sample_arrays import SampleWriter
from palpate.correction.samples.sample_store import FORMAT, save_bodies
from palpate.setup.box import Box

__all__ = ["NODES", "SIZE", "write_samples"]

SIZE, NODES = (0.06, 0.04, 0.03), (5, 4, 3)
BLOCK = Box(size=SIZE)


def write_samples(
    folder: Path, rows: int = 24, names: tuple[str, ...] = ("one", "two", "three"), seed: int = 0
) -> Samples:
    """Write `rows` frames of each sequence.

    The last two sequences are for validation and test, the others for training.
    """
    rng, body = np.random.default_rng(seed), Body.of(BLOCK, NODES)
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).mkdir()
        arrays = SampleWriter(folder / name, rows, len(body.rest), 60)
        for row in range(rows):
            place = np.append(rng.uniform(-0.015, 0.015, 2), 0.033)
            around = np.exp(-((body.rest[:, :2] - place[:2]) ** 2).sum(axis=1) / 0.01**2) * (
                body.rest[:, 2] / SIZE[2]
            )
            simulated = body.rest - 1e-3 * around[:, None] * np.array([0.0, 0.0, 1.0])
            true = simulated - (1e-3 * around + 0.5e-3 * body.rest[:, 2] / SIZE[2])[
                :, None
            ] * np.array([0.0, 0.0, 1.0])
            top = np.flatnonzero(body.surface(body.rest)[:, 2] > SIZE[2] * 0.999)
            points = body.surface(true)[rng.choice(top, 50, replace=False)] + 1e-4 * rng.normal(
                size=(50, 3)
            )
            tool = np.concatenate([place, [1.0, 0, 0, 0], rng.normal(0, 0.01, 3), [0.0, 0.0, 0.1]])
            arrays.put(
                row,
                points,
                positions=simulated,
                tool=tool,
                count=(50, 50),
                time=row / 30,
                frame=row,
                probe=1,
            )
        arrays.close(rows)
    seen = np.where(body.rest[:, 2] > SIZE[2] * 0.999, 3.0, 0.0)
    splits = {"train": names[:-2], "validation": names[-2:-1], "test": names[-1:]}
    about = {
        "format": FORMAT,
        "dataset": "by-hand",
        "sequences": dict.fromkeys(names, rows),
        "splits": splits,
        "grid": list(NODES),
        "points": 60,
        "every": 1,
        "force": "measured",
        "mesh": "",
        "seed": seed,
        "setup": {},
        "seen": seen.tolist(),
    }
    save_bodies(folder, body, body.over(BLOCK))
    (folder / "samples.json").write_text(json.dumps(about))
    return open_samples(folder)
