"""Registration of the camera to bodies of any shape, from one partial view of each.

    python -m benchmarks.shape_registration [COUNT] [SEED] [--workers N]

Ten bodies of the virtual bench's families, at random: camera, part of the body that is in view, 0.5
to 2 mm of depth noise, and a table in every second view. A pose is right where the body's middle is
within 0.5 mm and the turn within 0.7 degrees of the true one, or within three of its own standard
deviations. Where several poses fit alike, the registration says so; it is right if one of them is.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from rich.console import Console
from rich.table import Table

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.shape.shape_fit import fit_shape_camera
from palpate.synthetic.bodies.shape_families import FAMILIES, draw_shape

__all__ = ["Seen", "Trial", "attempt", "look"]

BODIES = (
    *((family, 11) for family in FAMILIES),
    *((family, 12) for family in ("liver", "kidney", "breast", "grooved")),
)
"""Family and seed of the ten bodies."""
RAYS, MARGIN = 60_000, 2.2
"""Rays of a view, and how much wider it is than the body [1]."""
CLOSE, TURNED, SIGMAS = 0.5e-3, np.radians(0.7), 3.0
"""A pose within these of the true one [m], [rad], [standard deviations] is right."""


@dataclass(frozen=True, eq=False)
class Seen:
    """A view of a body.

    Attributes:
        cloud: (n, 3) [m], camera frame.
        pose: phantom_from_camera.
        noise: of depth [m].
        table: whether there is one.
        share: of the rays to the body that are in view [1].
    """

    cloud: FloatArray
    pose: Transform
    noise: float
    table: bool
    share: float


def look(body: SeenBody, seed: int, *, table: bool) -> Seen:
    """Look at a body from a random side, with a random part of the image cut off."""
    random = np.random.default_rng(seed)
    up, around, away = (
        random.uniform(low, high) for low, high in ((0.44, 1.3), (0.0, 6.28), (0.25, 0.5))
    )
    way = np.array([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.sin(up)])
    eye, across = body.middle + away * way, np.cross(-way, random.normal(size=3))
    across /= np.linalg.norm(across)
    rotation = np.stack([across, np.cross(-way, across), -way], axis=1)
    half = MARGIN * body.reach / away
    u, v = random.uniform(-half, half, (2, RAYS))
    rays = np.stack([u, v, np.ones_like(u)], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    ways = rays @ rotation.T
    own = body.cast(eye, ways).distance
    down = ways[:, 2] < -1e-6
    floor = np.where(down, -eye[2] / np.where(down, ways[:, 2], -1.0), np.inf)
    depth = np.minimum(own, floor) if table else own
    cut, side = random.uniform(-0.25, 0.1) * half, random.normal(size=2)
    side /= np.linalg.norm(side)
    shown = u * side[0] + v * side[1] > cut
    kept = np.isfinite(depth) & shown
    noise = float(random.uniform(0.5e-3, 2e-3))
    measured = depth[kept] + random.normal(0.0, noise, int(kept.sum()))
    hit = np.isfinite(own)
    share = float((hit & shown).sum() / hit.sum())
    return Seen(rays[kept] * measured[:, None], Transform(rotation, eye), noise, table, share)


@dataclass(frozen=True)
class Trial:
    """The registration of one view.

    Attributes:
        family: of the body.
        table: whether there is one.
        share: of the body in view [1].
        error: distance of the body's middle [m]; infinite without a registration.
        turn: of the best pose [rad].
        right: whether the best pose is right.
        alike: number of poses that fit alike, and whether one of them is right.
        weak: whether a direction is called weak.
        seconds: duration [s].
        message: of an error.
    """

    family: str
    table: bool
    share: float
    error: float
    turn: float
    right: bool
    alike: tuple[int, bool]
    weak: bool
    seconds: float
    message: str = ""

    @property
    def verdict(self) -> str:
        """In one word."""
        if self.message:
            return "refused"
        if self.alike[0] > 1:
            return "ambiguous" if self.alike[1] else "wrong"
        return "right" if self.right else "wrong"


def _off(fit: CameraFit, true: Transform, body: SeenBody) -> tuple[float, float, bool]:
    """Distance [m] and turn [rad] of a fit from the truth, and whether it is right."""
    motion = fit.phantom_from_camera @ true.inverse()
    shift = motion.apply(body.middle[None])[0] - body.middle
    turn = motion.rotation_vector
    apart = np.concatenate([shift, turn])
    far = np.sqrt(apart @ np.linalg.solve(fit.covariance, apart) / len(apart))
    near = np.linalg.norm(shift) < CLOSE and np.linalg.norm(turn) < TURNED
    return float(np.linalg.norm(shift)), float(np.linalg.norm(turn)), bool(near or far < SIGMAS)


def attempt(number: int, seed: int = 0) -> Trial:
    """Register one view."""
    family, proportions = BODIES[number % len(BODIES)]
    shape = draw_shape(family, proportions)
    body, table = SeenBody(shape), number // len(BODIES) % 2 == 0
    seen, began = look(body, 1000 * seed + number, table=table), time.perf_counter()
    try:
        fit = fit_shape_camera(seen.cloud, shape, seen.noise)
    except RegistrationError as error:
        return Trial(
            family, table, seen.share, np.inf, np.inf, False, (0, False), False, 0.0, str(error)
        )
    seconds = time.perf_counter() - began
    apart, turn, right = _off(fit, seen.pose, body)
    any_right = right or any(_off(other, seen.pose, body)[2] for other in fit.alternatives)
    alike = (1 + len(fit.alternatives), any_right)
    weak = bool(fit.weak_directions)
    return Trial(family, table, seen.share, apart, turn, right, alike, weak, seconds)


def main(count: int, seed: int, workers: int) -> int:
    """Print a table of all views; return 1 where more than 3 % are wrong."""
    console, begin = Console(), time.perf_counter()
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        trials = list(pool.map(partial(attempt, seed=seed), range(count)))
    table = Table("body", "table", "views", "right", "ambiguous", "wrong", "refused", "median [mm]")
    for family in FAMILIES:
        for flat in (True, False):
            own = [one for one in trials if one.family == family and one.table == flat]
            verdicts = [one.verdict for one in own]
            settled = [1e3 * one.error for one in own if one.verdict == "right"]
            median = f"{np.median(settled):.2f}" if settled else ""
            counts = [
                str(verdicts.count(word)) for word in ("right", "ambiguous", "wrong", "refused")
            ]
            table.add_row(family, "yes" if flat else "none", str(len(own)), *counts, median)
    wrong = [n for n, one in enumerate(trials) if one.verdict == "wrong"]
    right = [one for one in trials if one.verdict == "right"]
    firm = [one for one in right if not one.weak]
    console.print(table)
    for name, group in (("right", right), ("right, no direction weak", firm)):
        if group:
            error = 1e3 * np.array([one.error for one in group])
            turn = np.degrees([one.turn for one in group])
            console.print(
                f"{len(group)} {name}: median {np.median(error):.2f} mm, "
                f"{np.median(turn):.2f} degrees; 95 % within {np.percentile(error, 95):.2f} mm, "
                f"{np.percentile(turn, 95):.2f} degrees"
            )
    shares = [one.share for one in trials]
    console.print(
        f"{count - len(wrong)} of {count} right or called ambiguous; wrong: {wrong}; "
        f"{min(shares):.0%} to {max(shares):.0%} of each body in view; "
        f"{np.median([one.seconds for one in trials]):.1f} s a view (median), "
        f"{time.perf_counter() - begin:.0f} s in all"
    )
    for number, one in enumerate(trials):
        if one.message:
            console.print(f"view {number}: {one.message}", highlight=False)
    return int(len(wrong) > 0.03 * count)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Camera to bodies of any shape.")
    parser.add_argument("count", nargs="?", type=int, default=40, help="number of views")
    parser.add_argument("seed", nargs="?", type=int, default=0, help="of the views")
    parser.add_argument("--workers", type=int, default=1, help="number of processes")
    sys.exit(main(**vars(parser.parse_args())))
