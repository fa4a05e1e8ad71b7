"""Camera against robot: the seen tool's place, clock and handedness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from palpate.consistency.contact_timeline import named
from palpate.consistency.seen_tool import SeenTool
from palpate.foundation.arrays import FloatArray

__all__ = ["camera_doubts"]

FARTHEST = 10e-3
"""Distance of the seen tool from where the kinematics put it from which it is told [m]: effects
explain 6 mm, and the end of a shaft is seen within 2."""
MIRRORED = 0.4
"""Misfit of the mirrored places over that of the others, below which they are mirrored [1]."""
LATE, UNEVEN, RATE = 0.4, 0.2, 0.005
"""Shift of the camera's clock [s], difference of shifts between sequences [s], and error of its
rate [1], from which they are told. A common shift of 0.25 s is a usual cause."""
GAINED, SHARPER = 0.5e-3, 0.6
"""Reduction [m] of the misfit by another clock that counts, and largest share that may be left
[1]."""
STUCK, SOUND = 6e-3, 3e-3
"""Misfit of a run of frames [m], and largest one of half of the others, by which a stream stood
still."""
STILL = 0.3
"""Way of the stream that stood still over that of the other, at most [1]."""
_SHIFTS = np.arange(-3.0, 3.01, 0.05)
"""Shifts of the clock that are tried [s]."""
_RATES = np.arange(-0.05, 0.0501, 0.0025)
"""Errors of the rate that are tried [1]."""
_CLIP = 8e-3
"""Misfit of one frame beyond which it counts no more [m]."""
_LIMIT = 30e-3
"""Distance of one frame beyond which it counts no more where places are turned [m]."""
_FEWEST = 6
"""Least frames with a seen tool that tell of its place or clock."""
_STEADY = np.radians(12.0)
"""Largest spread of the shaft's direction within a sequence for a comparison of clocks [rad]."""


@dataclass(frozen=True)
class _Clock:
    """A fitted clock: shift [s], error of the rate [1], misfit with it and as stamped [m]."""

    late: float
    rate: float
    left: float
    stated: float

    @property
    def sure(self) -> bool:
        return self.stated - self.left > GAINED and self.left < SHARPER * self.stated


def camera_doubts(seen: Sequence[SeenTool]) -> tuple[tuple[str, ...], bool]:
    """Look for a tool that the camera sees elsewhere, at another time, or not at all.

    Returns:
        sentences, and whether the robot's place is contradicted.
    """
    usable = [one for one in seen if len(one.time) >= _FEWEST and one.spread < _STEADY]
    if seen and not any(len(one.time) for one in seen):
        frames = sum(one.frames for one in seen)
        return (
            f"no tool is seen in {frames} clouds: neither the clocks nor touches.csv can be "
            "checked against the camera; record clouds with the tool in them, not masked out",
        ), False
    if doubt := _place_doubt(usable, {}):
        if doubt.settled:
            return (doubt.sentence,), True
    clocks = {one.name: _fitted(one) for one in usable}
    late = list(_clock_doubts(clocks, usable))
    doubt = _place_doubt(usable, clocks)
    places = [doubt.sentence] if doubt else []
    return tuple(places or late or _stuck(usable)), bool(places)


def _misfit(apart: FloatArray) -> float:
    """Mean distance [m] from their median, far ones limited."""
    known = apart[np.isfinite(apart).all(axis=1)]
    if len(known) < _FEWEST - 1:
        return np.inf
    return float(np.minimum(np.linalg.norm(known - np.median(known, axis=0), axis=1), _CLIP).mean())


def _fitted(one: SeenTool) -> _Clock:
    """Fit shift and rate of the camera's clock to the tool's way."""
    stated = _misfit(one.apart())
    left, late = min((_misfit(one.apart(shift)), abs(shift), shift) for shift in _SHIFTS)[::2]
    close = late + np.arange(-0.3, 0.31, 0.1)
    rated = min((_misfit(one.apart(s, rate)), abs(rate), rate, s) for rate in _RATES for s in close)
    # A rate counts where it is clearly better than a shift alone.
    if rated[0] < 0.75 * left and left - rated[0] > 0.3 * GAINED:
        return _Clock(float(rated[3]), float(rated[2]), rated[0], stated)
    return _Clock(float(late), 0.0, left, stated)


def _clock_doubts(clocks: dict[str, _Clock], usable: Sequence[SeenTool]) -> Iterator[str]:
    sure = {name: clock for name, clock in clocks.items() if clock.sure}
    fast = {name: clock for name, clock in sure.items() if abs(clock.rate) > RATE}
    if fast:
        rate = float(np.median([clock.rate for clock in fast.values()]))
        name = max(fast, key=lambda one: fast[one].stated)
        yield (
            f"the camera's clock runs {abs(rate):.1%} {'fast' if rate > 0 else 'slow'} in "
            f"{named(list(fast), len(clocks))}: the seen tool is {1e3 * fast[name].left:.1f} mm "
            f"from the robot's way in {name} with that, {1e3 * fast[name].stated:.1f} mm as "
            f"stamped (a rate within {RATE:.1%} is expected): put both streams on one clock"
        )
        return
    shifts = {name: clock.late for name, clock in sure.items()}
    steady = {
        name: 0.0
        for name, clock in clocks.items()
        if not clock.sure and clock.stated < 1.5e-3 and _moves(usable, name)
    }
    every = {**steady, **shifts}
    if shifts and max(every.values()) - min(every.values()) > UNEVEN:
        shown = ", ".join(f"{name} {value:+.2f} s" for name, value in list(every.items())[:6])
        yield (
            f"the camera's stamps are shifted by another time in each sequence: {shown} (within "
            f"{UNEVEN:g} s of each other is expected, since one shift is fitted to all): put both "
            "streams on one clock"
        )
    elif shifts and abs(late := float(np.median(list(shifts.values())))) > LATE:
        name = max(sure, key=lambda one: sure[one].stated)
        yield (
            f"the camera's stamps are {abs(late):.2f} s {'late' if late > 0 else 'early'} in "
            f"{named(list(sure), len(clocks))}: the seen tool is {1e3 * sure[name].left:.1f} mm "
            f"from the robot's way in {name} then, {1e3 * sure[name].stated:.1f} mm as stamped "
            f"(within {LATE:g} s is expected): put both streams on one clock"
        )


def _moves(usable: Sequence[SeenTool], name: str) -> bool:
    """Whether another clock would show, since the expected tool moves enough."""
    (one,) = (item for item in usable if item.name == name)
    return _misfit(one.apart(UNEVEN)) - _misfit(one.apart()) > GAINED


def _stuck(usable: Sequence[SeenTool]) -> Iterator[str]:
    """Sentences about runs of frames in which one stream moves and the other does not."""
    for one in usable:
        apart = one.apart()
        away = np.linalg.norm(apart - np.nanmedian(apart, axis=0), axis=1)
        far = np.nan_to_num(away) > STUCK
        edges = np.flatnonzero(np.diff(np.concatenate([[0], far.astype(int), [0]])))
        runs = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 2]
        if not runs or not np.nanmedian(away) < SOUND:
            continue
        first, last = max(runs, key=lambda run: run[1] - run[0])
        seen = float(np.linalg.norm(np.ptp(one.end[first:last], axis=0)))
        put = float(np.linalg.norm(np.ptp((one.end - apart)[first:last], axis=0)))
        if not (min(put, seen) < STILL * max(put, seen) and max(put, seen) > STUCK):
            continue
        still, moves = ("the robot", "the camera") if put < seen else ("the camera", "the robot")
        yield (
            f"{one.name}: from t = {one.time[first]:.2f} to {one.time[last - 1]:.2f} s the camera "
            f"sees the tool up to {1e3 * away[first:last].max():.0f} mm from where the kinematics "
            f"put it (elsewhere within {1e3 * np.nanmedian(away):.1f} mm, under "
            f"{1e3 * STUCK:.0f} mm is expected): by {still} it moves {1e3 * min(put, seen):.1f} mm "
            f"there, by {moves} {1e3 * max(put, seen):.0f} mm; the stream of {still} stood still, "
            "cut this part out"
        )


@dataclass(frozen=True)
class _Place:
    """A sentence about the tool's place, and whether a mirror or a turn explains it."""

    sentence: str
    settled: bool = False


def _place_doubt(usable: Sequence[SeenTool], clocks: dict[str, _Clock]) -> _Place | None:
    """Tell where camera and kinematics put the tool in different places, by fitted clocks."""
    pairs = [np.zeros((2, 0, 3))]
    aways: dict[str, float] = {}
    for one in usable:
        clock = clocks.get(one.name)
        late, rate = (clock.late, clock.rate) if clock and clock.sure else (0.0, 0.0)
        apart = one.apart(late, rate)
        known = np.isfinite(apart).all(axis=1)
        if known.any():
            pairs.append(np.stack([one.end[known], (one.end - apart)[known]]))
            aways[one.name] = float(np.median(np.linalg.norm(apart[known], axis=1)))
    ends, expected = np.concatenate(pairs, axis=1)
    far = [name for name, distance in aways.items() if distance > FARTHEST]
    if len(ends) < _FEWEST or not far:
        return None
    away = max(aways.values())
    turn, turned = _turned(expected, ends)
    _, mirrored = _turned(expected * np.array([-1.0, 1.0, 1.0]), ends)
    told = (
        f"the camera sees the tool {1e3 * away:.0f} mm from where the kinematics put it in "
        f"{named(far, len(usable))} (under {1e3 * FARTHEST:.0f} mm is "
        "expected)"
    )
    if mirrored < MIRRORED * turned and mirrored < FARTHEST / 2:
        return _Place(
            f"{told}, and {1e3 * mirrored:.1f} mm if one of both is mirrored (without, "
            f"{1e3 * turned:.1f} mm at best): one frame is left-handed; turn the sign of one axis "
            "of the clouds, or of the robot's poses and touches",
            True,
        )
    if turned < min(away / 2, FARTHEST / 2) and np.degrees(abs(turn)) > 8.0:
        return _Place(
            f"{told}, and {1e3 * turned:.1f} mm with the phantom turned by "
            f"{np.degrees(turn):.0f} degrees about z: the rest cloud was registered in a wrong "
            "heading, or landmarks and [phantom] size are of another one; check rest.ply, size "
            "and landmarks, or give [camera] to_phantom",
            True,
        )
    offset = np.median(ends - expected, axis=0)
    shown = ", ".join(f"{1e3 * value:+.0f}" for value in offset)
    return _Place(
        f"{told}, by ({shown}) mm along x, y, z: check that touches.csv was taken at the stated "
        "landmarks, that rest.ply shows the phantom where the sequences do, [phantom] size, and "
        "[camera] to_phantom"
    )


def _turned(places: FloatArray, targets: FloatArray) -> tuple[float, float]:
    """Turn about z [rad] that moves places (n, 3) nearest to targets (n, 3), and the mean
    distance left [m], far ones limited, with a free shift.
    """
    a, b = places - np.median(places, axis=0), targets - np.median(targets, axis=0)
    best, found = np.inf, 0.0
    for angle in np.radians(np.arange(-180.0, 180.0, 3.0)):
        c, s = np.cos(angle), np.sin(angle)
        off = a @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) - b
        away = np.linalg.norm(off - np.median(off, axis=0), axis=1)
        left = float(np.minimum(away, _LIMIT).mean())
        if left < best - 1e-6 or (left < best + 1e-6 and abs(angle) < abs(found)):
            best, found = left, float(angle)
    return found, best
