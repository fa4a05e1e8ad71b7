"""Streams that no robot and no camera give: jumps, poses that stand still, repeated clouds."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from palpate.consistency.contact_timeline import named
from palpate.dataset import Dataset, Kinematics, Sequence

__all__ = ["frozen_stretch", "longest_jump", "stream_doubts"]

FASTEST, FARTHEST = 1.0, 4e-3
"""Speed [m/s] and length [m] of a step of the robot from which it is a jump: teleoperated tools
move at up to half a metre a second, and noise of some hundredths of a millimetre at 1 kHz gives
less than a millimetre."""
LONGEST = 1.0
"""Longest time after which a jump returns [s]."""
FROZEN = 0.25
"""Time for which a stream repeats one pose exactly from which it stood still [s], where elsewhere
it hardly ever does."""
LIVE, NOISE = 0.05, 2e-6
"""Share of exact repeats up to which [1], and median second difference from which [m], a stream has
noise in every row."""
_TAIL = 4096
"""Bytes at the end of a cloud's file that are compared: depth noise changes every point."""


def stream_doubts(dataset: Dataset) -> tuple[str, ...]:
    """Sentences about impossible streams of all sequences."""
    names = dataset.sequences
    jumps = {n: jump for n in names if (jump := longest_jump(dataset.sequence(n).kinematics))}
    still = {n: stop for n in names if (stop := frozen_stretch(dataset.sequence(n).kinematics))}
    same = {n: again for n in names if (again := _repeats(dataset, dataset.sequence(n)))}
    return (
        *_told_jumps(jumps, len(names)),
        *_told_frozen(still, len(names)),
        *_told_repeats(same, dataset),
        *_left_out(dataset),
    )


def longest_jump(clock: Kinematics) -> tuple[int, float, float, int] | None:
    """Row before the longest jump out and back, its length [m] and speed [m/s], and the number of
    rows outside.

    A jump that does not return may lie between two recordings that were joined.
    """
    place = clock.position
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    speed = steps / np.diff(clock.time)
    bad = np.flatnonzero((speed > FASTEST) & (steps > FARTHEST))
    found: list[int] = []
    rows = 0
    for out, back in pairwise(bad):
        returned = np.linalg.norm(place[back + 1] - place[out])
        if clock.time[back] - clock.time[out] < LONGEST and returned < 0.5 * steps[out]:
            found.append(int(out))
            rows += int(back - out)
    zeros = np.flatnonzero((place == 0.0).all(axis=1))
    if not found and len(zeros) and len(bad):
        found, rows = [int(bad[0])], len(zeros)
    if not found:
        return None
    row = int(max(found, key=lambda at: steps[at]))
    return row, float(steps[row]), float(speed[row]), int(rows)


def _told_jumps(jumps: dict[str, tuple[int, float, float, int]], among: int) -> Iterator[str]:
    if not jumps:
        return
    name = max(jumps, key=lambda one: jumps[one][1])
    row, step, speed, count = jumps[name]
    yield (
        f"kinematics.csv of {named(list(jumps), among)} jumps away and back: in {name} {count} "
        f"rows are elsewhere, at most by {1e3 * step:.0f} mm from row {row + 2} to {row + 3}, at "
        f"{speed:.3g} m/s (under {FASTEST:g} m/s is expected): were rows without a measurement "
        "filled with zeros? Leave them out"
    )


def frozen_stretch(clock: Kinematics) -> tuple[float, float] | None:
    """Start [s] and length [s] of the longest stretch in which a noisy stream stands still."""
    same = (np.diff(clock.position, axis=0) == 0).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    if not len(edges):
        return None
    starts, ends = edges[::2], edges[1::2]
    length = clock.time[ends] - clock.time[starts]
    longest = int(length.argmax())
    elsewhere = np.ones(len(same), bool)
    for start, end in zip(starts[length > FROZEN], ends[length > FROZEN], strict=True):
        elsewhere[start:end] = False
    if length[longest] <= FROZEN or elsewhere.sum() < 20 or same[elsewhere].mean() > LIVE:
        return None
    rough = np.abs(np.diff(clock.position, n=2, axis=0)).max(axis=1)[elsewhere[1:]]
    if np.median(rough) < NOISE:  # a robot without noise stands still exactly
        return None
    return float(clock.time[starts[longest]]), float(length[longest])


def _told_frozen(still: dict[str, tuple[float, float]], among: int) -> Iterator[str]:
    if not still:
        return
    name = max(still, key=lambda one: still[one][1])
    start, length = still[name]
    yield (
        f"kinematics.csv of {named(list(still), among)} stands still: in {name} one pose is "
        f"repeated exactly for {length:.2f} s from t = {start:.2f} s (at most {FROZEN:g} s is "
        "expected, as no other rows repeat): the robot's stream stopped while the recording went "
        "on; cut this part out"
    )


def _repeats(dataset: Dataset, sequence: Sequence) -> tuple[int, str] | None:
    """Number of clouds that have the same bytes as one before, and the file of the first."""
    if len(sequence) < 2:
        return None
    seen: set[bytes] = set()
    count, first = 0, ""
    for file in sequence.cloud_files:
        mark = _mark(dataset, file)
        if mark in seen:
            count, first = count + 1, first or file
        seen.add(mark)
    return (count, first) if count else None


def _mark(dataset: Dataset, file: str) -> bytes:
    """Digest of size and end of a file."""
    path = dataset.path / file
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - _TAIL))
        return hashlib.blake2b(b"%d " % size + stream.read(), digest_size=16).digest()


def _left_out(dataset: Dataset) -> Iterator[str]:
    """Tell of points that were left out on reading, by the first cloud of each sequence."""
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        if len(sequence) and (far := sequence.count(0) - len(sequence.cloud(0))):
            yield (
                f"{far} of {sequence.count(0)} points of {sequence.cloud_files[0]} lie more than "
                "10 m away and are left out, as others may be: is 65.535 m the camera's mark of a "
                "pixel without depth? Leave such pixels out of the clouds"
            )
            return


def _told_repeats(same: dict[str, tuple[int, str]], dataset: Dataset) -> Iterator[str]:
    if not same:
        return
    total = sum(count for count, _ in same.values())
    whole = sum(len(dataset.sequence(name)) for name in same)
    with_clouds = sum(1 for name in dataset.sequences if len(dataset.sequence(name)))
    first = next(iter(same.values()))[1]
    yield (
        f"{total} of {whole} clouds of {named(list(same), with_clouds)} are byte for byte one "
        f"before them, the first is {first} (none is expected, a camera's noise changes every "
        "frame): the camera stood still or frames were written twice; leave the repeats out of "
        "clouds.csv"
    )
