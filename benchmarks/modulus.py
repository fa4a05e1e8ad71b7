"""The paper's search for Young's modulus, without and with its dynamics: why it could find nothing. Drawn to runs/modulus.png.

Wu, Kazanzides and Unberath (2020) compared replays with many moduli and found little between them. Their scene drives the tool by
position and has neither gravity nor a measured force. Its only scale of time comes from Rayleigh damping with 0.1 and 0.1, under
which springs and dampers are both proportional to the modulus, and from inertia. So the modulus cancels while the tool moves slowly
against the block's own waves, which take 0.05 s through it at 5 kPa and 1 s at 10 Pa. The error against the modulus is flat, and no
search over it can gain; only a soft block under a fast tool is another.

What is measured here: points of the top from a replay on another, finer mesh, with 2 mm of noise. The error is the paper's mean
distance; beside it stands by how much the block's shape differs from the one at 5 kPa. Friction, which their scene has, is left
out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from benchmarks.picture import picture
from benchmarks.reference import SETUP, top_points
from benchmarks.replay import RATE, motion
from benchmarks.stopwatch import timed
from core.dynamics import Damping, replay_in_time
from core.fem.newton import Outcome
from core.frames import FloatArray
from core.measurement import Surface
from core.mesh import GridSpec
from core.metrics import PAPER_GRID, paper_distance
from core.replay import Equilibrium, replay, require_converged
from core.setup import Setup

__all__ = ["run"]

PICTURE = Path("runs/modulus.png")
MODULI = (1e1, 3e1, 1e2, 3e2, 1e3, 2e3, 5e3, 1e4, 5e4, 1e6)
KNOWN = 5e3
PAPER = Damping(mass=0.1, stiffness=0.1)
STEPS = 4
FINE = GridSpec(nodes=(13, 9, 9), spacing=1.5e-3, order=2)
NOISE, FLAT = 2e-3, 1e-5
EVERY = 3
"""Frames from one that is compared to the next."""
Pieces = list[list[Equilibrium]]


def _ways() -> list[FloatArray]:
    """A poke by 8 mm and a drag, of 10 s each, at 30 Hz."""
    whole = motion()
    return [whole[600:900], whole[1500:1800]]


def _of(modulus: float) -> Setup:
    return replace(SETUP, material=replace(SETUP.material, young_modulus=modulus))


def _clouds(ways: list[FloatArray]) -> list[list[FloatArray]]:
    """What a camera would see: points of the top (m, 3) [m], frame by frame."""
    points, random, clouds = top_points(), np.random.default_rng(0), []
    for way in ways:
        frames = replay(SETUP, way[::EVERY], FINE)
        require_converged(frames)
        up = np.array([0.0, 0.0, 1.0])
        clouds.append([frame.move(points) + up * random.normal(0, NOISE, (len(points), 1)) for frame in frames])
    return clouds


def _still(modulus: float, ways: list[FloatArray]) -> Pieces:
    return [replay(_of(modulus), way[::EVERY], PAPER_GRID) for way in ways]


def _in_time(modulus: float, ways: list[FloatArray], haste: float = 1.0) -> Pieces:
    """With inertia, the tool moving so many times faster than it did."""
    times = np.arange(max(map(len, ways))) / RATE / haste
    parts = [
        replay_in_time(_of(modulus), way, times[: len(way)], PAPER_GRID, damping=PAPER, steps=STEPS, tolerance=1e-4) for way in ways
    ]
    return [part[::EVERY] for part in parts]


KINDS: dict[str, Callable[[float, list[FloatArray]], Pieces]] = {
    "quasi-static": _still,
    "paper's dynamics": _in_time,
    "tool 10 times faster": partial(_in_time, haste=10.0),
}


def _error(pieces: Pieces, clouds: list[list[FloatArray]]) -> float:
    """Mean distance [m] over the frames that have an equilibrium."""
    surface = Surface(SETUP.box)
    pairs = [pair for frames, seen in zip(pieces, clouds, strict=True) for pair in zip(frames, seen, strict=True)]
    return float(np.mean([paper_distance(cloud, frame, surface) for frame, cloud in pairs if frame.outcome is Outcome.CONVERGED]))


def _shapes(pieces: Pieces) -> FloatArray:
    """Displacements (f, n, 3) [m] in all frames; not a number where there is no equilibrium."""
    frames = [frame for part in pieces for frame in part]
    return np.stack([frame.displacement if frame.outcome is Outcome.CONVERGED else frame.displacement * np.nan for frame in frames])


def run() -> list[Table]:
    """Replay with each modulus, with and without dynamics; without, neither error nor shape may depend on it."""
    ways = _ways()
    clouds = _clouds(ways)
    table = Table("E, Pa", *KINDS, "frames failed", "CPU s", title="Mean distance, mm (shape against that at 5 kPa, RMS mm)")
    known = {name: _shapes(kind(KNOWN, ways)) for name, kind in KINDS.items()}
    errors: dict[str, list[float]] = {name: [] for name in KINDS}
    for modulus in MODULI:
        row, failed, spent = [], 0, 0.0
        for name, kind in KINDS.items():
            pieces, seconds = timed(lambda kind=kind, modulus=modulus: kind(modulus, ways))  # type: ignore[misc]
            miss = np.linalg.norm(_shapes(pieces) - known[name], axis=2)
            shift = float(np.sqrt(np.nanmean(miss**2)))
            errors[name].append(_error(pieces, clouds))
            row.append(f"{1e3 * errors[name][-1]:.3f} ({1e3 * shift:.3f})")
            failed, spent = failed + int(np.isnan(miss).any(axis=1).sum()), spent + seconds
            if kind is _still and np.nanmax(miss) > FLAT:
                raise RuntimeError(f"without inertia the shape at {modulus:g} Pa is another by {1e3 * np.nanmax(miss):.3f} mm")
        table.add_row(f"{modulus:g}", *row, str(failed), f"{spent:.0f}")
    _draw(errors)
    return [table]


def _draw(errors: dict[str, list[float]]) -> None:
    with picture(PICTURE, 1, (6, 4)) as (axes,):
        for (name, values), style in zip(errors.items(), ("o-", "s--", "^:"), strict=True):
            axes.semilogx(MODULI, 1e3 * np.array(values), style, label=name)
        axes.set(xlabel="Young's modulus, Pa", ylabel="mean distance, mm")
