"""Forces on the tool in the robot frame: axes, zero and weight of the sensor."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.rules import WrenchRules
from palpate.importing.timed_recording import TimedRecording

__all__ = ["forces_in_robot"]

LEAST_TURN = 0.3
"""Spread of the tool's orientation from which weight and zero are told apart [rad]: the weight's
part in the sensor then changes by a third of it."""
FEWEST_CLEAR = 20
"""Fewest samples clear of the phantom from which a zero is fitted."""


def forces_in_robot(
    recording: TimedRecording, rules: WrenchRules, clear_until: float, notes: ImportNotes
) -> FloatArray:
    """Turn the forces of a recording into the robot frame (k, 3) [N], zero and weight removed.

    Args:
        recording: whose forces are turned.
        rules: of import.toml.
        clear_until: time of the first contact [s], up to which the tool is clear of everything.
        notes: take what was fitted.

    Raises DatasetError where the frame is not stated.
    """
    if not len(recording.forces):
        return recording.forces
    if not rules.frame:
        raise DatasetError(
            f"{recording.name}: the frame of the forces is not known; expected [wrench] frame = "
            '"robot" or "tool" in import.toml: state it',
            key="wrench.frame",
        )
    turned = recording.forces
    if rules.frame == "robot" and rules.zero == "none":
        return turned
    to_robot = _orientation(recording, rules)
    clear = recording.wrench_times / 1e9 < clear_until
    if rules.zero == "fitted" and clear.sum() < FEWEST_CLEAR:
        notes.warn(
            f"{recording.name}: {int(clear.sum())} forces before the first contact; expected "
            f"{FEWEST_CLEAR} or more to fit their zero by: it was left as it is"
        )
    elif rules.zero == "fitted":
        turned = _without_zero(recording, rules, to_robot, clear, notes)
    return to_robot.apply(turned)


def _orientation(recording: TimedRecording, rules: WrenchRules) -> Rotation:
    """Rotations (k,) from the sensor's axes to the robot's at the times of the forces."""
    if rules.frame == "robot":
        return Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (len(recording.forces), 1)))
    at = np.clip(recording.wrench_times, recording.pose_times[0], recording.pose_times[-1])
    start = recording.pose_times[0]
    path = Slerp((recording.pose_times - start) / 1e9, Rotation.from_quat(recording.quaternions))
    return path((at - start) / 1e9) * Rotation.from_quat(rules.turn)


def _without_zero(
    recording: TimedRecording,
    rules: WrenchRules,
    to_robot: Rotation,
    clear: BoolArray,
    notes: ImportNotes,
) -> FloatArray:
    """Forces in the sensor's axes without its zero and, where it is asked for, weight."""
    forces, turns = recording.forces, to_robot[np.flatnonzero(clear)]
    spread = float((turns.mean().inv() * turns).magnitude().max())
    if rules.weight == "none" or spread < LEAST_TURN:
        zero = np.median(forces[clear], axis=0)
        if rules.weight == "fitted":
            notes.warn(
                f"{recording.name}: the tool turns by {spread:.2f} rad before the first contact; "
                f"expected {LEAST_TURN} or more to tell weight and zero apart: both were taken as "
                "one zero"
            )
        notes.decide(f"{recording.name}: zero of the forces {_numbers(zero)} N")
        return np.asarray(forces - zero)
    matrices = turns.inv().as_matrix()
    rows = np.concatenate([np.tile(np.eye(3), (len(matrices), 1, 1)), matrices], axis=2)
    fit, *_ = np.linalg.lstsq(rows.reshape(-1, 6), forces[clear].ravel(), rcond=None)
    zero, weight = fit[:3], fit[3:]
    left = float(np.std(forces[clear].ravel() - rows.reshape(-1, 6) @ fit))
    notes.decide(
        f"{recording.name}: zero of the forces {_numbers(zero)} N, weight "
        f"{_numbers(weight)} N in the robot frame, {left:.3f} N left"
    )
    return np.asarray(forces - zero - to_robot.inv().apply(np.tile(weight, (len(forces), 1))))


def _numbers(values: FloatArray) -> str:
    return ", ".join(f"{value:.3f}" for value in values)
