"""Rotations of a table's rows: quaternions in either order, Euler angles, rotation vectors."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.tables.table_text import TextTable

__all__ = ["ANGLES", "NAMED", "ORDERED", "row_quaternions"]

NAMED = ("qx", "qy", "qz", "qw")
ORDERED = ("q1", "q2", "q3", "q4")
"""Components of a quaternion whose names do not tell which is the real one."""
ANGLES = ("a1", "a2", "a3")
_REAL_FIRST = [1, 2, 3, 0]


def row_quaternions(table: TextTable, rules: ColumnRules) -> FloatArray:
    """Quaternions x, y, z, w of the rows (n, 4), as they stand where they are quaternions.

    Rows without a finite angle have NaN. Without columns of a rotation all are the identity.

    Raises DatasetError where the order of a quaternion, or what three angles are, is not stated.
    """
    known = rules.columns
    if all(part in known for part in NAMED):
        return _stacked(table, rules, NAMED)
    if all(part in known for part in ORDERED):
        if not rules.quaternion_order:
            raise _open(table, "quaternion_order", '"xyzw" or "wxyz"', ORDERED, rules)
        found = _stacked(table, rules, ORDERED)
        return found[:, _REAL_FIRST] if rules.quaternion_order == "wxyz" else found
    if all(part in known for part in ANGLES):
        if not rules.rotation or rules.rotation == "quaternion":
            expected = '"euler-xyz", "euler-ZYX", … or "rotation-vector"'
            raise _open(table, "rotation", expected, ANGLES, rules)
        return _turned(_stacked(table, rules, ANGLES), rules)
    return np.tile([0.0, 0.0, 0.0, 1.0], (len(table), 1))


def _turned(angles: FloatArray, rules: ColumnRules) -> FloatArray:
    found = np.full((len(angles), 4), np.nan)
    good = np.isfinite(angles).all(axis=1)
    values = np.radians(angles[good]) if rules.angle_unit == "deg" else angles[good]
    if good.any():
        if rules.rotation == "rotation-vector":
            found[good] = Rotation.from_rotvec(values).as_quat()
        else:
            axes = rules.rotation.removeprefix("euler-")
            found[good] = Rotation.from_euler(axes, values).as_quat()
    return found


def _stacked(table: TextTable, rules: ColumnRules, parts: tuple[str, ...]) -> FloatArray:
    return np.stack([table.numbers(rules.columns[part]) for part in parts], axis=-1)


def _open(
    table: TextTable, key: str, expected: str, parts: tuple[str, ...], rules: ColumnRules
) -> DatasetError:
    names = ", ".join(rules.columns[part] for part in parts)
    return DatasetError(
        f"{table.file}: neither the names of {names} nor the other files tell how they are to be "
        f'read; state {key} = {expected} in [tables."{table.file}"] of import.toml',
        file=table.file,
        key=f"tables.{table.file}.{key}",
    )
