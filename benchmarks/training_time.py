"""Time of training a network on 15 872 samples, as many as in the paper.

    python -m benchmarks.training_time FOLDER

Twelve sequences at 30 frames a second: eight for training, two for validation, two for test. The
simulation is of the stated block. The measurements are of a block that sags, under a larger tool,
replayed by the same engine on another mesh: the virtual experiment, which uses another engine, is
too slow for 20 000 frames. FOLDER keeps the samples, and an interrupted training resumes.
`--device cuda` trains on a CUDA device.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.console import Console

from palpate.correction import (
    Body,
    NetworkSpec,
    Samples,
    Split,
    SurfaceLoss,
    TrainingSpec,
    open_samples,
    sample_errors,
    train,
)
from palpate.correction.samples.sample_arrays import SampleWriter
from palpate.correction.samples.sample_store import FORMAT
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import Replay
from palpate.setup.setup import Box, Load, Setup, Tool
from palpate.synthetic.bench.motion_plan import draw_motion

SIZE, NODES = (0.0687, 0.0393, 0.0358), (13, 5, 5)
BLOCK = Box(size=SIZE)
STATED = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
TRUE = replace(STATED, tool=Tool(radius=6.5e-3), load=Load(specific_weight_over_stiffness=2.0))
KINDS = ("poke-top", "poke-top", "drag", "poke-side")
TRAINING, HELD_OUT, RATE, POINTS, NOISE = 15_872, 600, 30.0, 1024, 7e-4
EYE = np.array([0.15, -0.18, 0.30])


def _names() -> dict[str, int]:
    """Return the number of frames by sequence.

    The first eight sequences have TRAINING frames together; two for validation and two for test
    have HELD_OUT each.
    """
    counts, names = dict.fromkeys(KINDS, 0), []
    for number in range(12):
        kind = KINDS[number % len(KINDS)] if number < 10 else KINDS[number % 2 * 2]
        counts[kind] += 1
        names.append(f"{kind}-{counts[kind]:02d}")
    return {name: TRAINING // 8 if number < 8 else HELD_OUT for number, name in enumerate(names)}


def _tool_path(name: str, frames: int) -> FloatArray:
    """Return tool centres (frames, 3) [m] of consecutive motions of the sequence's kind."""
    paths: list[FloatArray] = []
    for seed in range(1000):
        kind, _, number = name.rpartition("-")
        motion = draw_motion(
            name,
            int(number) - 1 + seed,
            SIZE,
            STATED.tool.radius,
            np.array([1.0, -1.0]),
            17 * int(number) + seed,
        )
        paths.append(motion.centre(np.arange(0.0, motion.duration, 1 / RATE)))
        if sum(map(len, paths)) >= frames:
            return np.concatenate(paths)[:frames]
    raise RuntimeError(f"no motion of kind {kind} is long enough")


def _cloud(frame: Equilibrium, rng: np.random.Generator) -> tuple[FloatArray, int]:
    """Return noisy points (p, 3) [m], those of the top first, and the number of these."""
    x, y, z = SIZE
    areas = np.array([x * y, y * z, x * z])
    upper, right, _ = rng.multinomial(POINTS, areas / areas.sum())
    rest = rng.uniform([-x / 2, -y / 2, 0.004], [x / 2, y / 2, z], (POINTS, 3))
    rest[:upper, 2], rest[upper : upper + right, 0], rest[upper + right :, 1] = z, x / 2, -y / 2
    points = frame.move(rest)
    rays = points - EYE
    return points + rng.normal(0, NOISE, (POINTS, 1)) * rays / np.linalg.norm(rays, axis=1)[
        :, None
    ], int(upper)


def _sequence(folder: Path, body: Body, named: tuple[str, int]) -> int:
    """Write one sequence; return the number of frames with an equilibrium in both blocks."""
    name, frames = named
    (folder / name).mkdir(parents=True)
    arrays, row, rng = (
        SampleWriter(folder / name, frames, len(body.rest), POINTS),
        0,
        np.random.default_rng([5, *name.encode()]),
    )
    blocks = [
        Replay(STATED, GridSpec(nodes=NODES), 1e-3),
        Replay(TRUE, GridSpec(nodes=(13, 7, 7), spacing=2.5e-3), 1e-3),
    ]
    before: list[Equilibrium | None] = [None, None]
    for number, centre in enumerate(_tool_path(name, frames)):
        now = [
            block.solve_from_any(centre, (last,))
            for block, last in zip(blocks, before, strict=True)
        ]
        before = [frame if frame.outcome is Outcome.CONVERGED else None for frame in now]
        if None in before:
            continue
        points, upper = _cloud(now[1], rng)
        tool = np.concatenate([centre, [1.0, *[0.0] * 6], now[0].force])
        arrays.put(
            row,
            points,
            positions=now[0].move(body.rest),
            tool=tool,
            count=(upper, POINTS),
            time=number / RATE,
            frame=number,
            probe=1,
        )
        row += 1
    arrays.close(row)
    return row


def _made(folder: Path, console: Console) -> Samples:
    """Return the samples in a folder, made if they are missing."""
    if (folder / "samples.json").exists():
        return open_samples(folder)
    body, frames_of = Body.of(BLOCK, NODES), _names()
    with ProcessPoolExecutor(
        min(len(frames_of), os.cpu_count() or 1), mp_context=get_context("spawn")
    ) as pool:
        made = dict(
            zip(
                frames_of,
                pool.map(partial(_sequence, folder, body), frames_of.items()),
                strict=True,
            )
        )
    for name, frames in frames_of.items():
        console.print(f"{name}: {made[name]} of {frames} frames")
    names = list(made)
    about = {
        "format": FORMAT,
        "dataset": "learning",
        "sequences": made,
        "grid": list(NODES),
        "points": POINTS,
        "every": 1,
        "splits": {"train": names[:8], "validation": names[8:10], "test": names[10:]},
        "force": "simulated",
        "mesh": str(NODES),
        "seed": 5,
        "setup": STATED.as_dict(),
        "seen": np.ones(len(body.rest)).tolist(),
    }
    np.savez(
        folder / "body.npz",
        **{key: value for key, value in body.to_arrays().items() if key not in ("grid", "flat")},
    )
    (folder / "samples.json").write_text(json.dumps(about))
    return open_samples(folder)


def main() -> None:
    """Make the samples, train, and print times and errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kind", default="unet2d", choices=["unet2d", "unet3d", "graph"])
    parser.add_argument("--epochs", type=int, default=40)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--device", default="cpu", help="torch device, such as cuda")
    options, console = parser.parse_args(), Console()
    samples = _made(options.folder / "samples", console)
    split = Split.of(samples)
    network = NetworkSpec(kind=options.kind)
    spec = TrainingSpec(
        network=network,
        hold=0.0,
        epochs=options.epochs,
        device=options.device,
        threads=options.threads,
    )
    wall, cpu, printed = time.monotonic(), time.process_time(), -1

    def report(fraction: float, text: str) -> None:
        nonlocal printed
        epoch = (
            int(text.split(",", maxsplit=1)[0].removeprefix("epoch "))
            if text.startswith("epoch ")
            else printed
        )
        if epoch != printed:
            printed = epoch
            console.print(
                f"{time.monotonic() - wall:6.0f} s, {time.process_time() - cpu:6.0f} CPU s: {text}"
            )

    trained = train(samples, split, spec, options.folder / options.kind, report)
    console.print(
        f"trained on {len(samples.rows(split.train))} samples in {time.monotonic() - wall:.0f} s, "
        f"{time.process_time() - cpu:.0f} CPU s; best after epoch {trained.about['epoch']}"
    )
    loss = SurfaceLoss(trained.body, samples.seen[trained.body.index], device=options.device)
    for name in split.test:
        rows = samples.rows([name])
        raw, corrected = (
            sample_errors(net, loss, trained.body, samples, rows, options.device).mean()
            for net in (None, trained.network)
        )
        console.print(f"{name}: {raw:.3f} mm without, {corrected:.3f} mm with the network")


if __name__ == "__main__":
    main()
