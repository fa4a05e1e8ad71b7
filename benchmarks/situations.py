"""Robustness of replays in random situations.

    python -m benchmarks.situations [COUNT] [SEED] [--workers N] [--by-size SHARE]

Materials up to nu = 0.49, neo-Hooke and Gent, two effects at a time, pokes into the top and the
sides and over the rim by up to 40 % of the height, jumps of up to 5 mm between frames. No frame may
end with an exception, a NaN, a converged result with an inverted element, or a surface point inside
the tool. Frames without equilibrium are counted by their outcome.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

from palpate.effects import CATALOGUE, Effect, Slot
from palpate.fem.model import ToolSphere
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.graded_mesh import Grading
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import Equilibrium, Replay, replay
from palpate.setup.setup import Box, Material, Setup, Tool

__all__ = ["GRIDS", "Situation", "Trial", "attempt", "draw_situation", "faults"]

SIZE = (0.0687, 0.0393, 0.0358)
GRIDS = (
    GridSpec(nodes=(13, 5, 5)),
    GridSpec(nodes=(9, 7, 6), spacing=2e-3),
    GridSpec(nodes=(9, 7, 5), spacing=2e-3, order=2),
)
DEEPEST = 0.4 * SIZE[2]
LONGEST_JUMP = 5e-3
BY_SIZE, SIZED = 0.1, Grading(spacing=1.3e-3, along=0.8, inward=1.0, longest=0.35)
"""Share of situations on a graded mesh [1], and that mesh, slightly coarser than a diagnosis's."""
DRAWN = (
    "geometry_scale",
    "landmark_mismatch",
    "young_modulus",
    "mesh_resolution",
    "stiff_tube",
    "geometry_local",
)
"""Effects that a situation does not draw: those that change what it draws itself (stiffness, tool
position and mesh), one that would change what a seed draws, and one that no block can have."""
INSIDE = 5e-4
"""Depth [m] of a surface point inside the tool above which it is a fault."""


@dataclass(frozen=True, eq=False)
class Situation:
    """One random situation.

    Attributes:
        setup: the setup, with the effects.
        centres: (f, 3) stated tool centres [m], phantom frame.
        times: (f,) times of the frames [s].
        grid: the mesh protocol.
        effects: the effects.
    """

    setup: Setup
    centres: FloatArray
    times: FloatArray
    grid: Meshing
    effects: tuple[Effect, ...]


def _effect(random: np.random.Generator, kind: type[Effect], setup: Setup) -> Effect:
    """Return one of the effect's starts, or a random step away from neutral."""
    starts = kind.starts(setup)
    if starts and random.random() < 0.8:
        return starts[int(random.integers(len(starts)))]
    neutral = kind.neutral(setup)
    return neutral.at(
        [
            here + random.normal() * item.scale
            for item, here in zip(kind.numbers(), neutral.coordinates, strict=True)
        ]
    )


def _way(random: np.random.Generator, radius: float) -> FloatArray:
    """Return a random path: into the top or a side at a slant, then a jump along the surface."""
    half = np.array([SIZE[0] / 2, SIZE[1] / 2])
    axis, sign = int(random.integers(3)), 1.0 if random.random() < 0.5 else -1.0
    outward = np.zeros(3)
    outward[axis] = 1.0 if axis == 2 else sign
    place = np.array([*random.uniform(-half, half), random.uniform(0.012, SIZE[2])])
    place[axis] = SIZE[2] if axis == 2 else sign * half[axis]
    slant = random.normal(size=3) * 0.35
    inward = -outward + slant - outward * (slant @ outward)
    inward /= np.linalg.norm(inward)
    deepest = random.uniform(0.1, 1.0) * (DEEPEST if axis == 2 else min(DEEPEST, 0.6 * half[axis]))
    steps = [-1e-3]
    while steps[-1] < deepest:
        steps.append(min(steps[-1] + random.uniform(0.2, 1.0) * LONGEST_JUMP, deepest))
    way = [place + outward * radius + inward * step for step in steps]
    jump = random.normal(size=3)
    jump -= outward * (jump @ outward)
    way.append(way[-1] + jump / np.linalg.norm(jump) * random.uniform(0.2, 1.0) * LONGEST_JUMP)
    return np.array(way)


def draw_situation(seed: int, by_size: float = BY_SIZE) -> Situation:
    """Return the situation of a seed; a share `by_size` [1] of all has a graded mesh."""
    random = np.random.default_rng(seed)
    radius = float(random.uniform(3.5e-3, 8e-3))
    limit = float(random.uniform(3.0, 50.0)) if random.random() < 0.3 else None
    material = Material(
        young_modulus=float(10 ** random.uniform(1, 6)),
        poisson_ratio=float(random.uniform(0.0, 0.49)),
        stretch_limit=limit,
    )
    setup = Setup(geometry=Box(size=SIZE), tool=Tool(radius=radius), material=material, mass=0.104)
    kinds = [
        kind for kind in CATALOGUE if kind.enters is not Slot.SENSOR and kind.name not in DRAWN
    ]
    effects = []
    for index in random.choice(len(kinds), size=2, replace=False):
        effects.append(_effect(random, kinds[int(index)], setup))
        setup = effects[-1].apply(setup)
    way, grid = _way(random, radius), GRIDS[int(random.integers(len(GRIDS)))]
    times = np.cumsum(10 ** random.uniform(-2, 1, len(way)))
    sized = random.random() < by_size
    return Situation(setup, way, times, SIZED.for_tool(radius) if sized else grid, tuple(effects))


def faults(situation: Situation, frames: list[Equilibrium]) -> list[str]:
    """Return descriptions of the faults in these frames."""
    faulty, block = [], Replay(situation.setup, situation.grid)
    for number, frame in enumerate(frames):
        if not (np.isfinite(frame.displacement).all() and np.isfinite(frame.force).all()):
            faulty.append(f"frame {number}: not a number")
        elif frame.outcome is Outcome.CONVERGED:
            model, positions = block.model(frame.mesh), frame.mesh.nodes + frame.displacement
            probe = ToolSphere(frame.tool.centre - np.append(frame.slip, 0.0), frame.tool.radius)
            if not np.isfinite(model.energy(positions, probe)):
                faulty.append(f"frame {number}: converged with an inverted element")
            points = np.einsum(
                "qa,fai->fqi", model.face.shapes, positions[model.topology.surface]
            ).reshape(-1, 3)
            depth = probe.radius - np.linalg.norm(points - probe.centre, axis=1).min()
            if depth > INSIDE or model.encloses(positions, probe):
                faulty.append(
                    f"frame {number}: converged with a surface point {1e3 * depth:.2f} mm inside "
                    "the tool"
                )
    return faulty


@dataclass(frozen=True)
class Trial:
    """The result of one situation.

    Attributes:
        seed: seed of the situation.
        label: its effects and mesh.
        outcomes: outcomes of its frames.
        faults: descriptions of the faults.
        cpu: CPU time [s].
    """

    seed: int
    label: str
    outcomes: tuple[Outcome, ...]
    faults: tuple[str, ...]
    cpu: float

    def __str__(self) -> str:
        unsolved = [
            f"{i} {outcome.name}"
            for i, outcome in enumerate(self.outcomes)
            if outcome is not Outcome.CONVERGED
        ]
        remarks = "; ".join([*self.faults, *unsolved]) or "fine"
        return f"seed {self.seed} ({self.label}, {self.cpu:.1f} CPU s): {remarks}"


def _name(grid: Meshing) -> str:
    return str(grid.nodes) if isinstance(grid, GridSpec) else "by size"


def attempt(seed: int, by_size: float = BY_SIZE) -> Trial:
    """Replay the situation of a seed; an exception counts as a fault."""
    begin, situation = time.process_time(), draw_situation(seed, by_size)
    label = f"{' and '.join(effect.name for effect in situation.effects)}, {_name(situation.grid)}"
    try:
        frames = replay(situation.setup, situation.centres, situation.grid, times=situation.times)
        remarks = faults(situation, frames)
    except Exception as error:
        frames, remarks = [], [f"{type(error).__name__}: {error}"]
    return Trial(
        seed,
        label,
        tuple(frame.outcome for frame in frames),
        tuple(remarks),
        time.process_time() - begin,
    )


def _attempts(seeds: range, workers: int, by_size: float) -> Iterator[Trial]:
    """Yield the trials in the order of their seeds."""
    trial = partial(attempt, by_size=by_size)
    if workers == 1:
        yield from map(trial, seeds)
        return
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(trial, seeds)


def main(count: int, seed: int, workers: int = 1, by_size: float = BY_SIZE) -> int:
    """Try `count` situations from `seed` on; return 1 where one of them has a fault."""
    console, outcomes, wrong, cpu = Console(), Counter[Outcome](), 0, 0.0
    for trial in _attempts(range(seed, seed + count), workers, by_size):
        if trial.faults or set(trial.outcomes) - {Outcome.CONVERGED}:
            console.print(str(trial), highlight=False, soft_wrap=True)
        outcomes.update(trial.outcomes)
        wrong, cpu = wrong + bool(trial.faults), cpu + trial.cpu
    table = Table(
        "outcome",
        "frames",
        title=f"{count} situations from seed {seed}, {cpu / count:.2f} CPU s each",
    )
    for outcome, frequency in outcomes.most_common():
        table.add_row(outcome.value, str(frequency))
    unsolved = outcomes.total() - outcomes[Outcome.CONVERGED]
    console.print(
        table,
        f"{wrong} with a fault; {1000 * unsolved / max(outcomes.total(), 1):.2f} of 1000 frames "
        "without equilibrium",
    )
    return int(wrong > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Random situations that a replay must survive.")
    parser.add_argument("count", nargs="?", type=int, default=100, help="number of situations")
    parser.add_argument("seed", nargs="?", type=int, default=0, help="seed of the first situation")
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    parser.add_argument(
        "--by-size", type=float, default=BY_SIZE, help="share of situations on a graded mesh"
    )
    sys.exit(main(**vars(parser.parse_args())))
