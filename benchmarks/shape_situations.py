"""Robustness of replays on bodies of any shape in random situations.

    python -m benchmarks.shape_situations [--count N] [--seed FIRST] [--store FILE] [--minutes M]

Ten bodies of six families, balls of 2.5 to 8 mm, pushes anywhere on the free surface at a slant
by up to 40 % of the tissue below, half of them followed by a drag, materials from 10 Pa to 1 MPa
with nu up to 0.49, with and without friction and weight, jumps of up to 5 mm between frames. No
frame may end with an exception, a NaN, a converged result with an inverted element, a surface point
inside the tool, or a tool that is pulled; at most 2 of 1000 frames may have no equilibrium. Each
situation is appended to FILE at once, and those in FILE are not repeated.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.situations import LONGEST_JUMP, Situation, Trial, faults
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.mesh.default_meshes import Use, motion_mesh
from palpate.replay.jump_check import pulls
from palpate.replay.replay import replay
from palpate.setup.setup import Load, Material, Setup, Shape, Tool
from palpate.synthetic.bodies.shape_families import FAMILIES, draw_shape

__all__ = ["BODIES", "attempt_on_shape", "draw_on_shape", "main"]

BODIES = (*((family, 0) for family in FAMILIES), *((family, 1) for family in list(FAMILIES)[:4]))
"""Family and seed of the proportions of the ten bodies."""
RADII = (2.5e-3, 8e-3)
DEEPEST, SHARE = 10e-3, 0.4
"""Largest depth of a push [m], and over the tissue below [1]."""
ABOVE_BASE = 1e-3
"""Least height of the ball over the held base [m]."""
STORE = Path("runs/shape_situations.jsonl")
MOST_UNSOLVED = 2e-3
"""Largest share of frames without equilibrium [1]."""


@cache
def _body(number: int) -> Shape:
    return draw_shape(*BODIES[number])


def _tissue(shape: Shape, place: FloatArray, inward: FloatArray) -> float:
    """Return the length of the tissue below a place (3,) along a direction (3,) [m]."""
    ways = np.arange(1, 120) * 5e-4
    left = np.flatnonzero(shape.outside(place + ways[:, None] * inward) > 0)
    return float(ways[left[0]]) if len(left) else float(ways[-1])


def _path(random: np.random.Generator, shape: Shape, radius: float) -> FloatArray:
    """Return tool centres (f, 3) [m] of a push, and perhaps a drag, that stay above the base."""
    places = shape.surface_points()
    while True:
        place = places[int(random.integers(len(places)))]
        outward = shape.facing_free(place[None])[1][0]
        slant = 0.3 * random.normal(size=3)
        inward = -outward + slant - outward * (slant @ outward)
        inward /= np.linalg.norm(inward)
        deepest = random.uniform(0.1, 1.0) * min(DEEPEST, SHARE * _tissue(shape, place, inward))
        steps = [-1e-3]
        while steps[-1] < deepest:
            steps.append(min(steps[-1] + random.uniform(0.2, 1.0) * LONGEST_JUMP, deepest))
        way = [place + outward * radius + inward * step for step in steps]
        along = np.cross(outward, random.normal(size=3))
        for _ in range(int(random.integers(1, 4)) if random.random() < 0.5 else 0):
            step = random.uniform(0.1, 0.8) * LONGEST_JUMP
            way.append(way[-1] + step * along / np.linalg.norm(along))
        if min(centre[2] for centre in way) > radius + ABOVE_BASE:
            return np.array(way)


def draw_on_shape(seed: int) -> tuple[Situation, str]:
    """Return the situation of a seed, and the name of its body."""
    random = np.random.default_rng([seed, 7])
    number = seed % len(BODIES)
    shape, radius = _body(number), float(random.uniform(*RADII))
    setup = Setup(
        geometry=shape,
        tool=Tool(radius=radius),
        mass=0.05,
        material=Material(
            young_modulus=float(10 ** random.uniform(1, 6)),
            poisson_ratio=float(random.uniform(0.0, 0.49)),
            stretch_limit=float(random.uniform(3.0, 50.0)) if random.random() < 0.3 else None,
        ),
    )
    if random.random() < 0.3:
        friction = float(random.uniform(0.05, 0.6))
        setup = replace(setup, tool=replace(setup.tool, friction_coefficient=friction))
    if random.random() < 0.3:
        weight = float(random.uniform(0.1, 3.0))
        setup = replace(setup, load=Load(specific_weight_over_stiffness=weight))
    centres = _path(random, shape, radius)
    grid = motion_mesh(Use.SCREEN, shape, radius, centres)
    times = np.arange(len(centres)) / 30.0
    return Situation(setup, centres, times, grid, ()), "{} {}".format(*BODIES[number])


def attempt_on_shape(seed: int) -> Trial:
    """Replay the situation of a seed; an exception counts as a fault."""
    begin, outcomes = time.process_time(), tuple[Outcome, ...]()
    situation, label = draw_on_shape(seed)
    try:
        frames = replay(situation.setup, situation.centres, situation.grid, times=situation.times)
        outcomes = tuple(frame.outcome for frame in frames)
        remarks = faults(situation, frames)
        if not situation.setup.tool.friction_coefficient:
            remarks += [
                f"frame {number}: converged with a force that pulls the tool"
                for number, frame in enumerate(frames)
                if frame.outcome is Outcome.CONVERGED and pulls(frame)
            ]
    except Exception as error:
        remarks = [f"{type(error).__name__}: {error}"]
    return Trial(seed, label, outcomes, tuple(remarks), time.process_time() - begin)


def _stored(store: Path) -> dict[int, Trial]:
    """Return the trials in a file by their seeds; a line cut off by an interruption is left out."""
    known: dict[int, Trial] = {}
    for line in store.read_text().splitlines() if store.exists() else ():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        entry["outcomes"] = tuple(Outcome[name] for name in entry["outcomes"])
        known[entry["seed"]] = Trial(**{**entry, "faults": tuple(entry["faults"])})
    return known


def _append(store: Path, trial: Trial) -> None:
    entry = {**asdict(trial), "outcomes": [outcome.name for outcome in trial.outcomes]}
    store.parent.mkdir(parents=True, exist_ok=True)
    cut_off = store.exists() and not store.read_bytes().endswith(b"\n")
    with store.open("a") as file:
        file.write("\n" * cut_off + json.dumps(entry) + "\n")


def _table(trials: Iterable[Trial]) -> tuple[Table, bool]:
    """Return the table of trials by body, and whether they keep the bounds."""
    table = Table(
        "body", "situations", "frames", "without equilibrium", "with a fault", "ms a frame"
    )
    groups: dict[str, list[Trial]] = {"all": list(trials)}
    for trial in groups["all"]:
        groups.setdefault(trial.label, []).append(trial)
    for label, group in sorted(groups.items(), key=lambda item: (item[0] == "all", item[0])):
        outcomes = Counter(outcome for trial in group for outcome in trial.outcomes)
        unsolved = outcomes.total() - outcomes[Outcome.CONVERGED]
        wrong = sum(bool(trial.faults) for trial in group)
        spent = 1e3 * sum(trial.cpu for trial in group) / max(outcomes.total(), 1)
        values = (len(group), outcomes.total(), unsolved, wrong)
        table.add_row(label, *map(str, values), f"{spent:.0f}")
    return table, wrong == 0 and unsolved <= MOST_UNSOLVED * outcomes.total()


def main(count: int, seed: int, store: Path, minutes: float) -> int:
    """Try `count` situations from `seed` on, for at most so many CPU minutes.

    Returns 1 where one has a fault, or too many frames have no equilibrium.
    """
    console, known, begin = Console(), _stored(store), time.process_time()
    for number in range(seed, seed + count):
        if number in known:
            continue
        if time.process_time() - begin > 60 * minutes:
            console.print(f"stopped before seed {number}; the same command goes on from there")
            break
        known[number] = attempt_on_shape(number)
        _append(store, known[number])
    trials = [known[number] for number in sorted(known) if seed <= number < seed + count]
    for trial in trials:
        if trial.faults or set(trial.outcomes) - {Outcome.CONVERGED}:
            console.print(str(trial), highlight=False, soft_wrap=True)
    table, sound = _table(trials)
    console.print(table)
    return int(not sound)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Random situations on bodies of any shape.")
    parser.add_argument("--count", type=int, default=100, help="number of situations")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first situation")
    parser.add_argument("--store", type=Path, default=STORE, help="file of the results")
    parser.add_argument("--minutes", type=float, default=25.0, help="CPU minutes at most")
    sys.exit(main(**vars(parser.parse_args())))
