"""Units and rotations of a table that its header leaves open, settled by what is stated beside it.

A reading is taken only where it alone agrees with the evidence; otherwise the question stays, with
the key that answers it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.table_source import TableSource
from palpate.importing.tables.table_evidence import TableEvidence
from palpate.importing.tables.table_rotation import ANGLES, ORDERED, row_quaternions
from palpate.importing.tables.table_units import METRES, NANOSECONDS

__all__ = ["agree_rules"]

FARTHEST, BEYOND = 0.75, 1.5
"""Distance of the touches from the tool's path over the phantom's extent [1]: up to which a unit
agrees, and from which it does not. Touches are made where the phantom is palpated."""
SHORTEST, LONGEST = 0.05, 6.0
"""Extent of the tool's path over the phantom's [1] within which a unit agrees."""
ALIKE = 3.0
"""Ratio of two durations that were recorded together, either way, within which a unit agrees [1];
units are a thousand apart."""
TOWARDS, APART = 0.7, 0.4
"""Mean cosine between the tool's z axis and the direction into the phantom from which a reading of
the rotation agrees, and least difference to all others [1]. A tool is held within 45 degrees of
the phantom's vertical, with z along it as flanges and DH frames have it; a wrong order turns it
away."""
STEADY, JUMP = 0.1, 0.5
"""Largest turn between two rows of a reading that is smooth, and least one of a reading that jumps
[rad]: at 20 Hz a hand turns a tool by less than 0.1 rad."""
SAME = 0.02
"""Largest difference between two readings of a rotation that does not matter [rad]."""
_TURNS = ("euler-xyz", "euler-XYZ", "rotation-vector")


def agree_rules(source: TableSource, evidence: TableEvidence, notes: ImportNotes) -> None:
    """Settle the rules of a table by the evidence; each that is settled is a decision.

    Doubts that stay are left in `source.doubts`.
    """
    if source.rules is None:
        return
    _agree_times(source, evidence, notes)
    if all(axis in source.rules.columns for axis in "xyz"):
        _agree_lengths(source, evidence, notes)
        _agree_rotation(source, evidence, notes)
        try:
            row_quaternions(source.table.head(1), source.rules)
        except DatasetError as error:
            source.doubts.setdefault(str(error.where["key"]).rpartition(".")[2], error.message)


def _settled(source: TableSource, notes: ImportNotes, text: str, **changed: str) -> None:
    assert source.rules is not None
    source.rules = source.rules.model_copy(update=changed)
    for key in changed:
        source.doubts.pop(key, None)
    notes.decide(f"{source.path.name}: {text}")


def _agree_times(source: TableSource, evidence: TableEvidence, notes: ImportNotes) -> None:
    """Choose the unit in which the table lasts as long as the streams beside it."""
    rules = source.rules
    assert rules is not None
    if "t" in source.stated or rules.time_unit == "s+ns" or not evidence.seconds:
        return
    column = rules.columns.get("t") or rules.columns.get("received")
    if column is None or rules.rows == "depth-steps":
        return
    times = source.table.numbers(column)
    if float(np.nanmin(times)) > 1e8:  # since 1970: its size tells the unit
        return
    span, other = float(np.ptp(times)), max(evidence.seconds)
    units = {unit: span * factor / 1e9 for unit, factor in NANOSECONDS.items()}
    fitting = [unit for unit, lasts in units.items() if other / ALIKE <= lasts <= ALIKE * other]
    if len(fitting) == 1 and (fitting[0] != rules.time_unit or "time_unit" in source.doubts):
        text = (
            f"times are in {fitting[0]}: it lasts {units[fitting[0]]:.3g} s then, the stream "
            f"beside it {other:.3g} s"
        )
        _settled(source, notes, text, time_unit=fitting[0])


def _agree_lengths(source: TableSource, evidence: TableEvidence, notes: ImportNotes) -> None:
    """Choose the unit in which the path is where the touches are, or of the phantom's extent."""
    rules = source.rules
    assert rules is not None
    if "x" in source.stated or evidence.size is None:
        return
    path = np.stack([source.table.numbers(rules.columns[axis]) for axis in "xyz"], axis=-1)
    path = path[np.isfinite(path).all(axis=1) & (path != 0).any(axis=1)]
    if len(path) < 2:
        return
    if len(evidence.touches):
        away = {
            unit: float(np.median(cKDTree(factor * path).query(evidence.touches)[0]))
            for unit, factor in METRES.items()
        }
        share = {unit: distance / evidence.size for unit, distance in away.items()}
        fitting = [unit for unit, one in share.items() if one < FARTHEST]
        clear = all(one > BEYOND or unit in fitting for unit, one in share.items())
        how = "the touches are {:.0f} mm from its path then"
    else:
        away = {unit: factor * float(np.ptp(path, axis=0).max()) for unit, factor in METRES.items()}
        share = {unit: span / evidence.size for unit, span in away.items()}
        fitting = [unit for unit, one in share.items() if SHORTEST < one < LONGEST]
        clear, how = True, "its path spans {:.0f} mm then"
    size = f"with a phantom of {1e3 * evidence.size:.0f} mm"
    if len(fitting) == 1 and clear:
        if fitting[0] != rules.length_unit or "length_unit" in source.doubts:
            text = f"positions are in {fitting[0]}: {how.format(1e3 * away[fitting[0]])}, {size}"
            _settled(source, notes, text, length_unit=fitting[0])
    elif len(fitting) > 1 and "length_unit" in source.doubts:
        source.doubts["length_unit"] = (
            f"{source.path.name}: its positions may be in {' or '.join(fitting)}, both agree "
            f'{size}; taken as {rules.length_unit}, state length_unit in [tables."'
            f'{source.path.name}"] of import.toml'
        )


def _agree_rotation(source: TableSource, evidence: TableEvidence, notes: ImportNotes) -> None:
    """Choose the reading of the rotation that is smooth and points the tool into the phantom."""
    rules = source.rules
    assert rules is not None
    readings = dict(_readings(source))
    if not readings:
        return
    turns = {words: turn for words, (_, turn) in readings.items()}
    first = next(iter(turns.values()))
    apart = max(float((one.inv() * first).magnitude().max()) for one in turns.values())
    if apart < SAME:
        words = next(iter(readings))
        text = f"the rotation is read {words}; all readings are within {apart:.3f} rad"
        _settled(source, notes, text, **readings[words][0])
        return
    steps = {words: _largest_step(turn) for words, turn in turns.items()}
    smooth = [words for words, step in steps.items() if step < STEADY]
    left = [words for words, step in steps.items() if not smooth or step < JUMP]
    if len(left) == 1:
        text = (
            f"the rotation is read {left[0]}: its largest step is {steps[left[0]]:.2f} rad then, "
            f"{min(step for words, step in steps.items() if words != left[0]):.2f} rad otherwise"
        )
        _settled(source, notes, text, **readings[left[0]][0])
    elif evidence.inward is not None:
        facing = {
            words: float((turns[words].apply([0.0, 0.0, 1.0]) @ evidence.inward).mean())
            for words in left
        }
        best, second = sorted(left, key=lambda words: -facing[words])[:2]
        if facing[best] > TOWARDS and facing[best] - facing[second] > APART:
            angles = [np.degrees(np.arccos(np.clip(facing[one], -1, 1))) for one in (best, second)]
            text = (
                f"the rotation is read {best}: the tool's z axis is {angles[0]:.0f} degrees from "
                f"the direction into the phantom then, {angles[1]:.0f} degrees if {second}"
            )
            _settled(source, notes, text, **readings[best][0])


def _readings(source: TableSource) -> Iterator[tuple[str, tuple[dict[str, Any], Rotation]]]:
    """Readings of a rotation that is open: words, keys of the rules, and rotations of the rows."""
    rules = source.rules
    assert rules is not None
    options: list[tuple[str, dict[str, Any]]] = []
    if all(part in rules.columns for part in ORDERED) and not rules.quaternion_order:
        options = [(f"as {order}", {"quaternion_order": order}) for order in ("xyzw", "wxyz")]
    elif all(part in rules.columns for part in ANGLES):
        kinds = (rules.rotation,) if rules.rotation else _TURNS
        doubtful = "angle_unit" in source.doubts and rules.angle_unit == "rad"
        units = ("rad", "deg") if doubtful else (rules.angle_unit,)
        options = [
            (f"as {kind} in {unit}", {"rotation": kind, "angle_unit": unit})
            for kind in kinds
            for unit in units
        ]
        options = options if len(options) > 1 else []
    for words, keys in options:
        quaternions = row_quaternions(source.table, _changed(rules, keys))
        whole = _whole(quaternions)
        if len(whole) > 1:
            yield words, (keys, Rotation.from_quat(whole))


def _changed(rules: ColumnRules, keys: dict[str, Any]) -> ColumnRules:
    return rules.model_copy(update=keys)


def _whole(quaternions: FloatArray) -> FloatArray:
    """Rows that are unit quaternions."""
    norms = np.linalg.norm(quaternions, axis=1)
    return np.asarray(quaternions[np.isfinite(norms) & (np.abs(norms - 1) < 0.1)])


def _largest_step(turns: Rotation) -> float:
    return float((turns[:-1].inv() * turns[1:]).magnitude().max())
