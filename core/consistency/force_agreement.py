"""Forces against pushes: clock, coverage, direction and size of what the sensor felt."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from palpate.consistency.contact_timeline import named
from palpate.consistency.felt_motion import FeltMotion, Reading, readings
from palpate.dataset import Dataset, Forces
from palpate.foundation.frames import Transform

__all__ = ["force_doubts", "sensor_doubts"]

LONGEST = 20.0
"""Ratio of the forces' duration to the motion's, either way, from which the unit of the stamps is
in doubt [1]."""
SATURATED = 0.03
"""Share of samples at exactly the largest value from which a sensor is taken to be at its limit
[1]; noise repeats its largest value once."""
COVERED, LEAST_COVERED = 0.6, 0.5
"""Least share of the time in contact with known force [1], and least one by which the forces are
judged."""
LATE, LATER = 0.25, 0.1
"""Shift of the clock [s], and share of variance [1] that it adds, from which it is told. Soft
materials relax over seconds, which moves the best shift by less."""
FOLLOWS = 0.4
"""Least share of the forces' variance that pushes explain in any frame and unit [1]; measured: 0.9
and more on bench and shared data."""
ALONG, CLEARLY = 0.8, 0.1
"""Least share of the force along the outward normal [1], where another reading of the columns has
so much more; friction of 0.5 on every push leaves 0.89."""
LEAST_ALONG = 0.5
"""Least share of the force along the outward normal [1], whatever the reading."""
MODULUS = 8.0
"""Ratio of Hertz' modulus of the forces to the stated one, either way, from which the unit of the
forces is in doubt [1]: a phantom is seldom stated by more than a factor of five, and a thin one
resists two to three times as much."""
LEAST_PUSH = 1e-3
"""Depth of a push from which its force is judged [m]."""
_UNITS = {
    "grams": 9.80665e-3,
    "millinewtons": 1e-3,
    "kilograms": 9.80665,
    "pounds": 4.448,
    "kilonewtons": 1e3,
}
"""Units of force that are met in place of the newton [N]."""
_NEAR = 4.0
"""Ratio to the stated modulus within which a unit explains the forces [1]."""


def sensor_doubts(dataset: Dataset) -> tuple[str, ...]:
    """Sentences about forces that no sensor gives, whatever the tool does."""
    streams = _streams(dataset)
    return (
        *_dead(streams),
        *_saturated(streams),
        *(
            _spans(name, ratio, stream.time[-1] - stream.time[0])
            for name, stream in streams.items()
            if not 1 / LONGEST < (ratio := _duration(dataset, name)) < LONGEST
        ),
    )


def force_doubts(dataset: Dataset, phantom_from_robot: Transform) -> tuple[str, ...]:
    """Sentences about forces that do not belong to the pushes as recorded."""
    felt = []
    for name, stream in _streams(dataset).items():
        spread = float(
            np.sqrt(((stream.force - stream.force.mean(axis=0)) ** 2).sum(axis=1).mean())
        )
        if stream.sigma > spread:  # the stated deviation explains whatever they disagree in
            continue
        if _constant(stream).all() or not 1 / LONGEST < _duration(dataset, name) < LONGEST:
            continue
        one = FeltMotion.of(dataset, dataset.sequence(name), phantom_from_robot)
        felt += [one] if one is not None and one.timeline.depth.max() > LEAST_PUSH else []
    moved, sound = _clocks(felt)
    return (*_uncovered(felt), *moved, *_directions(sound), *_sizes(dataset, sound))


def _streams(dataset: Dataset) -> dict[str, Forces]:
    """Forces of the sequences that have some."""
    sequences = (dataset.sequence(name) for name in dataset.sequences)
    return {one.name: one.forces for one in sequences if one.forces is not None}


def _constant(stream: Forces) -> np.ndarray:
    return np.asarray(np.ptp(stream.force, axis=0) == 0.0)


def _dead(streams: dict[str, Forces]) -> list[str]:
    dead = [name for name, stream in streams.items() if _constant(stream).all()]
    lone = {
        name: "fxfyfz"[2 * int(np.flatnonzero(~_constant(stream))[0]) :][:2]
        for name, stream in streams.items()
        if _constant(stream).sum() == 2
    }
    doubts = []
    if dead:
        value = np.array2string(streams[dead[0]].force[0], precision=4, separator=", ")
        doubts.append(
            f"forces.csv of {named(dead, len(streams))} holds one value throughout, {value} N: a "
            "sensor's noise changes every sample; the sensor was not read, record these again or "
            "leave the files out"
        )
    if lone:
        column = next(iter(lone.values()))
        doubts.append(
            f"forces.csv of {named(list(lone), len(streams))} changes in {column} alone, the other "
            "two columns never change: is it the norm, or a sensor of one axis? Expected are "
            "fx, fy, fz in the robot frame: export all three"
        )
    return doubts


def _saturated(streams: dict[str, Forces]) -> list[str]:
    for name, stream in streams.items():
        for axis, column in enumerate(stream.force.T):
            if np.ptp(column) == 0.0 or (np.diff(column) == 0).mean() > 0.3:
                continue
            for limit in (column.max(), column.min()):
                share = float((column == limit).mean())
                if share > SATURATED and (column == limit).sum() > 20:
                    return [
                        f"{name}: f{'xyz'[axis]} stands at exactly {limit:g} N in {share:.0%} of "
                        f"the samples (under {SATURATED:.0%} is expected): the sensor was at its "
                        "limit, press less deep or choose a larger range"
                    ]
    return []


def _duration(dataset: Dataset, name: str) -> float:
    """Duration of the forces over that of the kinematics [1]."""
    sequence = dataset.sequence(name)
    assert sequence.forces is not None
    clock, time = sequence.kinematics.time, sequence.forces.time
    return float(time[-1] - time[0]) / max(float(clock[-1] - clock[0]), 1e-9)


def _spans(name: str, ratio: float, seconds: float) -> str:
    """A sentence about forces that last far longer or shorter than the motion."""
    unit = (
        "milliseconds" if 300 < ratio < 3000 else "microseconds" if ratio > 1e5 else "another unit"
    )
    return (
        f"{name}: forces.csv spans {seconds:.4g} s, {ratio:.3g} times the kinematics "
        f"(1/{LONGEST:g} to {LONGEST:g} is expected): are its stamps in {unit}? Convert them to "
        "seconds on the robot's clock"
    )


def _uncovered(felt: Sequence[FeltMotion]) -> list[str]:
    short = {one.name: one.covered for one in felt if one.covered < COVERED}
    if not short:
        return []
    worst = min(short, key=lambda name: short[name])
    return [
        f"forces.csv of {named(list(short), len(felt))} covers {short[worst]:.0%} of the time in "
        f"contact (over {COVERED:.0%} is expected; {worst} the least): the recording was cut off, "
        "or its stamps are on another clock; export it again"
    ]


def _clocks(felt: Sequence[FeltMotion]) -> tuple[list[str], list[FeltMotion]]:
    """Sentences about forces that come at another time, or do not follow the pushes at all, and
    the sequences whose forces come when the tool presses.
    """
    late: dict[str, tuple[float, float, float]] = {}
    strange: dict[str, float] = {}
    sound = []
    for one in felt:
        if one.covered < LEAST_COVERED:
            continue
        now, best, shift = one.follows()
        if best < FOLLOWS:
            strange[one.name] = best
        elif abs(shift) > LATE and best > now + LATER:
            late[one.name] = shift, now, best
        else:
            sound.append(one)
    doubts = []
    if late:
        shifts = [shift for shift, _, _ in late.values()]
        name = next(iter(late))
        shift, now, best = late[name]
        way = "late" if shift > 0 else "early"
        among = f" ({min(shifts):.2f} to {max(shifts):.2f} s)" if np.ptp(shifts) > 0.1 else ""
        doubts.append(
            f"forces.csv of {named(list(late), len(felt))} is {abs(shift):.2f} s {way}{among}: "
            f"the pushes of {name} explain {best:.0%} of the forces' variance then, {now:.0%} as "
            f"stamped (within {LATE:g} s is expected): put both streams on one clock"
        )
    if strange:
        worst = min(strange, key=lambda name: strange[name])
        doubts.append(
            f"forces.csv of {named(list(strange), len(felt))} does not follow the pushes: they "
            f"explain {strange[worst]:.0%} of its variance in {worst}, in whatever frame, unit or "
            f"shift of the clock (over {FOLLOWS:.0%} is expected): is it of this sequence, and was "
            "the sensor on?"
        )
    return doubts, sound


def _directions(felt: Sequence[FeltMotion]) -> Iterator[str]:
    """Sentences about forces that do not push the tool out of the phantom."""
    pressed = [one for one in felt if len(one.pressed) > 4]
    shares = {one.name: _share(one) for one in pressed}
    if not shares:
        return
    worst = min(shares, key=lambda name: shares[name])
    stated = shares[worst]
    best, read = stated, ""
    for reading in readings() if stated < ALONG else ():
        share = min(_share(one, reading) for one in pressed)
        if share > best + 0.02:
            best, read = share, reading.words
    if best > stated + CLEARLY and best > ALONG:
        yield (
            f"forces.csv: {stated:.0%} of the force in contact is along the surface's outward "
            f"normal in {worst} (over {ALONG:.0%} is expected of the force on the tool), in all "
            f"sequences {best:.0%} or more if the columns are read {read}: the force on the tool "
            "in the robot frame is expected, convert it"
        )
    elif shares[worst] < LEAST_ALONG:
        bad = [name for name, share in shares.items() if share < LEAST_ALONG]
        yield (
            f"forces.csv of {named(bad, len(felt))}: {shares[worst]:.0%} of the force in contact "
            f"is along the surface's outward normal in {worst} (over {LEAST_ALONG:.0%} is "
            "expected of the force on the tool in the robot frame): check its frame, signs and "
            "the order of its columns"
        )


def _share(felt: FeltMotion, reading: Reading | None = None) -> float:
    """Share of the force along the outward normal, weighted by its squared length [1]."""
    along, whole = felt.along_normal(reading)
    return along / max(whole, 1e-30)


def _sizes(dataset: Dataset, felt: Sequence[FeltMotion]) -> Iterator[str]:
    """A sentence where the forces are of another order than the stated stiffness."""
    config = dataset.config
    stated = config.young_modulus
    moduli = {
        one.name: one.hertz(config.tool_radius, config.poisson_ratio)
        for one in felt
        if len(one.pressed) > 4
    }
    odd = {
        name: value for name, value in moduli.items() if not 1 / MODULUS < value / stated < MODULUS
    }
    if not odd:
        return
    value = float(np.median(list(odd.values())))
    fits = [
        unit for unit, newtons in _UNITS.items() if 1 / _NEAR < value * newtons / stated < _NEAR
    ]
    hint = f"are they in {' or '.join(fits)}?" if fits else "are they in newtons?"
    yield (
        f"forces.csv of {named(list(odd), len(moduli))} has the size of a Young's modulus of "
        f"{value:.2g} Pa by Hertz' law, {value / stated:.2g} times the stated {stated:g} Pa "
        f"(1/{MODULUS:g} to {MODULUS:g} times is expected): {hint} Convert them, or state "
        "[phantom] young_modulus if they are right"
    )
