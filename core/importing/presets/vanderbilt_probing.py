"""Palpation of organs and phantoms by Vanderbilt University: vu-arma-dev/robot-palpation-data.

Structures of its class ProbingData hold a push in ten steps of depth: CurrentPos (10, 3) of the
ball's centre and DeformedForce (10, 3), ContactSurfNorm (3). Those of its class dvrk_logger hold
time, position (3, n), force (3, n) and quat (4, n). Lengths are millimetres. Verified on its files:
in probingRAL2018_T1 96 % of the forces' changes lie along the normals, so that both are in the
robot frame, and contact point and centre are 3.16 mm apart. Not verified: the order of quat, and
the frame of the logger's forces.
"""

from __future__ import annotations

from pathlib import Path

from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.presets.preset import with_setup
from palpate.importing.proposed_mapping import recording_name
from palpate.importing.recording import Recording
from palpate.importing.rules import ColumnRules, ImportMapping
from palpate.importing.sources.probing_source import ProbingSource
from palpate.importing.sources.table_source import TableSource
from palpate.importing.tables.matlab_table import STRUCT, read_matlab

__all__ = ["VanderbiltProbing"]

RADIUS = 3.16e-3
"""Radius of the ball [m]: median distance of ContactBallCenter and ContactPoint in 728 pushes."""
_PUSHES = {
    **{axis: f"CurrentPos.{axis}" for axis in "xyz"},
    **{f"n{axis}": f"ContactSurfNorm.{axis}" for axis in "xyz"},
    **{f"f{axis}": f"DeformedForce.{axis}" for axis in "xyz"},
    "push": STRUCT,
}
_LOG = {
    "t": "time",
    **{axis: f"position.{axis}" for axis in "xyz"},
    **{f"f{axis}": f"force.{axis}" for axis in "xyz"},
    **{f"q{number}": f"quat.{number}" for number in (1, 2, 3, 4)},
}


class VanderbiltProbing:
    """A .mat file with structures of ProbingData or dvrk_logger."""

    name = "vanderbilt-probing"
    summary = "structures of vu-arma-dev/robot-palpation-data, in millimetres"

    def fits(self, path: Path) -> bool:
        """Whether the file holds the fields of one of both classes."""
        return path.suffix.lower() == ".mat" and self._rules(path) is not None

    def recordings(self, path: Path) -> list[Recording]:
        """Open one recording."""
        rules = self._rules(path)
        table = TableSource(path, rules)
        at_rest = rules is not None and rules.rows == "depth-steps"
        return [Recording(recording_name(path), (ProbingSource.of(table) if at_rest else table,))]

    def completed(self, mapping: ImportMapping, path: Path, notes: ImportNotes) -> ImportMapping:
        """State the ball of the tool."""
        notes.decide(
            f"tool: a ball of {1e3 * RADIUS:g} mm radius, the distance of ball centre and contact "
            "point in the published pushes; state [tool] radius if yours is another"
        )
        ball: dict[str, object] = {"shape": "sphere", "radius": RADIUS}
        return with_setup(mapping, {"tool": ball}, path.parent)

    def _rules(self, path: Path) -> ColumnRules | None:
        try:
            columns = read_matlab(path).columns
        except (DatasetError, OSError):
            return None
        if set(_PUSHES.values()) - {STRUCT} <= set(columns):
            known = {key: name for key, name in _PUSHES.items() if name in columns}
            return ColumnRules(columns=known, length_unit="mm", rows="depth-steps")
        if set(_LOG.values()) <= set(columns):
            return ColumnRules(columns=_LOG, length_unit="mm")
        return None
