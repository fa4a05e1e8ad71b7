"""Recordings of Wu, Kazanzides and Unberath (2020): JieYingWu/simulator_network.

Its scripts lay a dataset out as dvrk/dataN_robot_cartesian.csv, from `rostopic echo -b -p` of
/dvrk/PSM3/position_cartesian_current, beside camera/dataN/ with clouds that are named by whole
milliseconds since 1970: RealSense's time of arrival at the computer. They compare the first column
of the table, the time of receipt, with these names. Verified in its scripts; the recordings
themselves are not public, so that no file of them was read. The touches of the phantom's corners
stand as numbers in processing/register_robot.py and are to be written to touches.csv.
"""

from __future__ import annotations

import re
from pathlib import Path

from palpate.importing.import_notes import ImportNotes
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping
from palpate.importing.sources.opened_sources import open_source
from palpate.importing.stream import Source

__all__ = ["WuNetwork"]

_POSES = "*_robot_cartesian.csv"


class WuNetwork:
    """A folder with dvrk/ and camera/."""

    name = "simulator-network"
    summary = "layout of JieYingWu/simulator_network: dvrk/ by rostopic, camera/ with clouds"

    def fits(self, path: Path) -> bool:
        """Whether both folders are there, with tables of poses in the first."""
        return (path / "camera").is_dir() and any((path / "dvrk").glob(_POSES))

    def recordings(self, path: Path) -> list[Recording]:
        """Open each table of poses with the clouds of its name."""
        found = []
        for table in sorted((path / "dvrk").glob(_POSES), key=_number):
            name = table.name.removesuffix(_POSES[1:])
            sources: list[Source] = [open_source(table)]
            if (path / "camera" / name).is_dir():
                sources.append(open_source(path / "camera" / name))
            found.append(Recording(name, tuple(sources)))
        return found

    def completed(self, mapping: ImportMapping, path: Path, notes: ImportNotes) -> ImportMapping:
        """Compare times of receipt, as the scripts do."""
        notes.decide(
            "times of receipt count: the clouds are named by their arrival at the computer, which "
            "the scripts compare with the times of receipt of the poses"
        )
        if not mapping.touches:
            notes.warn(
                f"{path.name}: the touches of this layout stand as numbers in "
                "processing/register_robot.py; write them to touches.csv, in metres"
            )
        times = mapping.time.model_copy(update={"stamps": "receipt"})
        return mapping.model_copy(update={"time": times})


def _number(path: Path) -> tuple[int, str]:
    match = re.search(r"\d+", path.name)
    return int(match.group()) if match else 0, path.name
