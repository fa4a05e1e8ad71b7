"""Places at which the tool touched the untouched phantom: landmarks by name, and traces."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.dataset.csv_table import FIRST_ROW, check_coordinates, read_labelled
from palpate.dataset.files import problem
from palpate.dataset.schema import DatasetConfig
from palpate.dataset.statements.checked_keys import FILE, nearest
from palpate.foundation.arrays import FloatArray

__all__ = ["TOUCHES", "TRACES", "Touches", "Traces", "read_touches", "read_traces"]

TOUCHES, TRACES = "landmark,x,y,z", "stroke,t,x,y,z"
"""Headers of touches.csv and traces.csv."""
FEWEST_TOUCHES = 4
"""Least number of touches; three leave no residual."""
FEWEST_TRACED = 12
"""Least number of traced points: six determine a pose, and some are lifts."""
FARTHEST_REPEAT = 5e-3
"""Largest distance between repeated touches of one landmark [m]."""
LEAST_FREEDOM = 6
"""Fewest degrees of freedom from which repeats tell the deviation of a touch."""


@dataclass(frozen=True, eq=False)
class Touches:
    """Touches of landmarks.

    Attributes:
        names: (n) of the landmarks, each once.
        positions: (n, 3) tool centres at the touches [m], robot frame; the mean of a landmark that
            was touched more than once.
        deviation: standard deviation of one coordinate of a touch [m], as repeats show it; None
            where too few landmarks were touched again.
    """

    names: tuple[str, ...]
    positions: FloatArray
    deviation: float | None = None


@dataclass(frozen=True, eq=False)
class Traces:
    """Centres of the ball while it slides over, or dabs at, the untouched surface.

    Attributes:
        strokes: (n) name of each point's stroke.
        positions: (n, 3) tool centres [m], robot frame.
    """

    strokes: tuple[str, ...] = ()
    positions: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def __len__(self) -> int:
        return len(self.positions)


def read_touches(root: Path, config: DatasetConfig) -> Touches:
    """Read and check the touches of the landmarks; empty where there are none and another statement
    relates robot and phantom.
    """
    file = "touches.csv"
    if not (root / file).exists() and (
        (root / "traces.csv").exists() or config.phantom_from_robot or config.robot_from_camera
    ):
        return Touches((), np.zeros((0, 3)))
    names, positions = read_labelled(root, file, TOUCHES, label=0)
    for row, name in enumerate(names, FIRST_ROW):
        if name not in config.landmarks:
            raise problem(
                file,
                f"unknown landmark '{name}'; {nearest(name, config.landmarks)}",
                row=row,
                key="landmark",
                value=name,
            )
    check_coordinates(file, positions)
    _check_repeats(file, names, positions)
    names, positions, deviation = _averaged_repeats(names, positions)
    if len(names) < FEWEST_TOUCHES:
        text = (
            f"{len(names)} touches; expected at least {FEWEST_TOUCHES}: three determine a pose "
            "without any residual "
            "to judge it by, touch another landmark"
        )
        raise problem(file, text, row=FIRST_ROW + len(names), value=len(names))
    _check_touch_scale(file, positions, np.array([config.landmarks[name] for name in names]))
    return Touches(tuple(names), positions, deviation)


def _check_repeats(file: str, names: list[str], positions: FloatArray) -> None:
    """Refuse repeated touches of one landmark that are too far apart to be of the same place."""
    firsts: dict[str, int] = {}
    for row, name in enumerate(names):
        first = firsts.setdefault(name, row)
        apart = float(np.linalg.norm(positions[row] - positions[first]))
        if apart > FARTHEST_REPEAT:
            text = (
                f"landmark '{name}' was touched in row {first + FIRST_ROW} already, "
                f"{1e3 * apart:.1f} mm from here; expected repeats within "
                f"{1e3 * FARTHEST_REPEAT:.0f} mm: name the right landmark, or remove one of them"
            )
            raise problem(file, text, row=row + FIRST_ROW, key="landmark", value=name)


def _averaged_repeats(
    names: list[str], positions: FloatArray
) -> tuple[list[str], FloatArray, float | None]:
    """Average repeated touches; return names, positions and the deviation as of `Touches`."""
    unique = list(dict.fromkeys(names))
    if len(unique) == len(names):
        return unique, positions, None
    numbers = {name: number for number, name in enumerate(unique)}
    which = np.array([numbers[name] for name in names])
    counts = np.bincount(which)
    means = np.stack([np.bincount(which, axis) / counts for axis in positions.T], axis=1)
    means.flags.writeable = False
    freedom = 3 * (len(names) - len(unique))
    if freedom < LEAST_FREEDOM:
        return unique, means, None
    return unique, means, float(np.sqrt(((positions - means[which]) ** 2).sum() / freedom))


def _check_touch_scale(file: str, positions: FloatArray, landmarks: FloatArray) -> None:
    touched, stated = (
        float(np.linalg.norm(points - points.mean(0), axis=1).max())
        for points in (positions, landmarks)
    )
    if stated == 0:
        raise problem(
            FILE,
            "landmarks: all touched ones are the same point; expected distinct ones: correct them",
            key="landmarks",
        )
    if not 0.1 < touched / stated < 10:
        text = (
            f"the touches reach {touched:.3g} m from their centre, the landmarks {stated:.3g} "
            "m; expected the same unit, metres"
        )
        raise problem(file, text + ": convert one of them", row=FIRST_ROW, value=f"{touched:.3g}")


def read_traces(root: Path) -> Traces:
    """Read and check traces.csv; empty without this file."""
    file = "traces.csv"
    if not (root / file).exists():
        return Traces()
    strokes, numbers = read_labelled(root, file, TRACES, label=0)
    positions = numbers[:, 1:]
    check_coordinates(file, positions)
    if len(positions) < FEWEST_TRACED:
        text = (
            f"{len(positions)} points; expected at least {FEWEST_TRACED}, better 30 in three "
            "directions: trace more of the surface"
        )
        raise problem(file, text, row=FIRST_ROW + len(positions), value=len(positions))
    return Traces(tuple(strokes), positions)
