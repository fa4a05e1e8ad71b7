"""Pushes recorded as depth steps at rest: one row a step, with a position and a force.

Such rows have no times that matter. A time line is made up for them: a slow way in from above the
surface, the steps at even intervals, and a way out to a height from which the next push is reached
clear of the body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.importing.clocks.track import Stamps
from palpate.importing.rules import ColumnRules
from palpate.importing.tables.table_columns import JUMP
from palpate.importing.tables.table_rotation import row_quaternions
from palpate.importing.tables.table_text import TextTable
from palpate.importing.tables.table_units import METRES, NEWTONS

__all__ = ["NORMALS", "DepthPush", "MadeUpTimes", "made_up_times", "read_pushes"]

NORMALS = ("nx", "ny", "nz")
STEP = 0.5
"""Time between two depth steps [s]."""
HOVER = 0.01
"""Height above a push from which it begins [m]."""
SPEED = 0.004
"""Speed of the ways in and out [m/s]."""


@dataclass(frozen=True, eq=False)
class DepthPush:
    """One push in steps of depth.

    Attributes:
        places: (n, 3) tool centres [m], robot frame, the shallowest first.
        quaternions: (n, 4) x, y, z, w.
        forces: (n, 3) as recorded [N].
        normal: (3,) outward normal of the surface, robot frame.
    """

    places: FloatArray
    quaternions: FloatArray
    forces: FloatArray
    normal: FloatArray

    @property
    def along(self) -> tuple[float, float]:
        """Sum of the force's changes along the normal, and of their lengths [N]."""
        change = self.forces - self.forces[0]
        return float((change @ self.normal).sum()), float(np.linalg.norm(change, axis=1).sum())


@dataclass(frozen=True, eq=False)
class MadeUpTimes:
    """Pushes on a time line that is made up.

    Attributes:
        pose_times: (n,) [ns].
        places: (n, 3) tool centres [m].
        quaternions: (n, 4) x, y, z, w.
        force_times: (k,) [ns].
        forces: (k, 3) [N].
        spans: first and last time [s] of each group of pushes.
    """

    pose_times: Stamps
    places: FloatArray
    quaternions: FloatArray
    force_times: Stamps
    forces: FloatArray
    spans: tuple[tuple[float, float], ...]


def read_pushes(table: TextTable, rules: ColumnRules) -> tuple[list[DepthPush], int]:
    """Read the pushes of a table of depth steps.

    Rows that were not reached, all zero or not finite, are left out.

    Returns:
        the pushes with two rows or more, and the number of rows left out.
    """
    columns = rules.columns
    places = METRES[rules.length_unit] * _stacked(table, [columns[axis] for axis in "xyz"])
    forces = NEWTONS[rules.force_unit] * _stacked(
        table, [columns[axis] for axis in ("fx", "fy", "fz")]
    )
    turns = row_quaternions(table, rules)
    numbers = np.concatenate([places, forces], axis=1)
    reached = np.isfinite(numbers).all(axis=1) & (numbers != 0).any(axis=1)
    reached &= (places != 0).any(axis=1)
    normals = None
    if all(axis in columns for axis in NORMALS):
        normals = _stacked(table, [columns[axis] for axis in NORMALS])
    found, used = [], 0
    for rows in _groups(table, rules, places, normals, reached):
        if len(rows) < 2:
            continue
        normal = places[rows[0]] - places[rows[-1]] if normals is None else normals[rows].mean(0)
        size = float(np.linalg.norm(normal))
        if not np.isfinite(size) or size == 0.0:
            continue
        normal = normal / size
        upwards = (places[rows[-1]] - places[rows[0]]) @ normal > 0  # from the deepest on
        own = rows[::-1] if upwards else rows
        found.append(DepthPush(places[own], turns[own], forces[own], normal))
        used += len(rows)
    return found, len(table) - used


def _stacked(table: TextTable, columns: list[str]) -> FloatArray:
    return np.stack([table.numbers(column) for column in columns], axis=-1)


def _groups(
    table: TextTable,
    rules: ColumnRules,
    places: FloatArray,
    normals: FloatArray | None,
    reached: BoolArray,
) -> list[IntArray]:
    """Rows of each push, by its number, by its normal, or by the jumps between pushes."""
    rows = np.flatnonzero(reached)
    if len(rows) < 2:
        return [rows]
    if "push" in rules.columns:
        texts = np.array(table.texts(rules.columns["push"]))[rows]
        other = texts[1:] != texts[:-1]
    elif normals is not None:
        other = (np.abs(np.diff(normals[rows], axis=0)) > 1e-9).any(axis=1)
    else:
        steps = np.linalg.norm(np.diff(places[rows], axis=0), axis=1)
        other = steps > JUMP * np.median(steps)
    return np.split(rows, np.flatnonzero(other) + 1)


def made_up_times(groups: Sequence[Sequence[DepthPush]]) -> MadeUpTimes:
    """Put groups of pushes on one time line, one push after the other."""
    pushes = [push for group in groups for push in group]
    mean = np.mean([push.normal for push in pushes], axis=0)
    up = mean / max(float(np.linalg.norm(mean)), 1e-9)
    top = max(float((push.places @ up).max()) for push in pushes) + 2 * HOVER
    times, places, turns, force_times = [0.0], [_lifted(pushes[0], up, top)], [], []
    turns.append(pushes[0].quaternions[0])
    spans = []

    def go(place: FloatArray, turn: FloatArray, seconds: float) -> None:
        times.append(times[-1] + seconds)
        places.append(place)
        turns.append(turn)

    for group in groups:
        start = times[-1]
        for push in group:
            above = push.places[0] + HOVER * push.normal
            for place in (_lifted(push, up, top), above, push.places[0]):
                way = float(np.linalg.norm(place - places[-1]))
                go(place, push.quaternions[0], max(way / SPEED, 0.1))
            force_times.append(times[-1])
            for place, turn in zip(push.places[1:], push.quaternions[1:], strict=True):
                go(place, turn, STEP)
                force_times.append(times[-1])
            for place in (above, _lifted(push, up, top)):
                go(place, push.quaternions[-1], float(np.linalg.norm(place - places[-1])) / SPEED)
        spans.append((start, times[-1]))
    return MadeUpTimes(
        _nanoseconds(times),
        np.array(places),
        np.array(turns),
        _nanoseconds(force_times),
        np.concatenate([push.forces for push in pushes]),
        tuple(spans),
    )


def _lifted(push: DepthPush, up: FloatArray, top: float) -> FloatArray:
    """The place above a push at the height `top` [m] along `up`."""
    above = push.places[0] + HOVER * push.normal
    return np.asarray(above + (top + HOVER - above @ up) * up)


def _nanoseconds(times: list[float]) -> Stamps:
    return np.round(1e9 * np.array(times)).astype(np.int64)
