"""The experimenter's statements in an import: dataset.toml, surfaces, touches and traces."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset.contact_points import Touches, read_touches, read_traces
from palpate.dataset.files import read_toml
from palpate.dataset.folder import Dataset, stated
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError, RegistrationError
from palpate.importing.cutting.dwells import find_touches
from palpate.importing.cutting.pushes import LocatedPhantom
from palpate.importing.import_notes import ImportNotes
from palpate.importing.mapping_file import toml_text
from palpate.importing.output.written_dataset import DatasetWriter
from palpate.importing.rules import ImportMapping
from palpate.importing.timed_recording import TimedRecording
from palpate.registration.robot.robot_statements import robot_fits, touched_centres

__all__ = [
    "ESTIMATED_SIGMA",
    "SETUP_TABLES",
    "SURFACES",
    "check_setup",
    "copied_setup",
    "found_phantom",
    "write_setup",
]

SETUP_TABLES = ("phantom", "tool", "landmarks", "robot", "camera", "force", "motion", "splits")
"""Tables of dataset.toml that an import takes over."""
ESTIMATED_SIGMA = 2.0
"""Standard deviation of forces that are estimated from motor currents [N]; public work on the dVRK
finds about 2 N RMS."""
SURFACES = ("surface", "fixed_surface", "holder")
"""Keys of [phantom] that name files."""
_LIMIT = 2**20


def check_setup(mapping: ImportMapping) -> None:
    """Refuse a mapping that leaves out what no recording holds."""
    needed = ["phantom", "tool", *(["camera"] if mapping.streams.cloud else [])]
    if missing := [name for name in needed if name not in mapping.setup]:
        tables = ", ".join(f"[{name}]" for name in missing)
        raise DatasetError(
            f"{tables} {'is' if len(missing) == 1 else 'are'} not stated, and no recording holds "
            "this; expected a dataset.toml with these tables by --setup, or [setup.phantom] and so "
            "on in import.toml: write size, mass, tool radius and camera there",
            key=f"setup.{missing[0]}",
        )
    for name in mapping.setup:
        if name not in SETUP_TABLES:
            raise DatasetError(
                f"setup.{name} is no table of dataset.toml; expected {', '.join(SETUP_TABLES)}",
                key=f"setup.{name}",
            )


def copied_setup(dataset: Path, folder: Path) -> Path:
    """Copy what a dataset states, with its surfaces and without its splits; returns the new
    dataset.toml.

    Raises DatasetError where its dataset.toml cannot be read, or names a file that it lacks.
    """
    values = read_toml(dataset, "dataset.toml", _LIMIT)
    kept = {key: values[key] for key in SETUP_TABLES if key in values and key != "splits"}
    for key in SURFACES:
        named = kept.get("phantom", {}).get(key, [])
        for file in [named] if isinstance(named, str) else named:
            source, place = (dataset / file).resolve(), folder / file
            if not source.is_relative_to(dataset.resolve()) or not source.is_file():
                raise DatasetError(
                    f"dataset.toml: phantom.{key} = {file!r} is no file of the dataset "
                    f"{dataset.name}: take the setup of another one",
                    file="dataset.toml",
                    key=f"phantom.{key}",
                )
            place.parent.mkdir(parents=True, exist_ok=True)
            place.unlink(missing_ok=True)
            shutil.copyfile(source, place)
    written = folder / "dataset.toml"
    written.unlink(missing_ok=True)
    written.write_text(toml_text(kept), encoding="utf-8")
    return written


def write_setup(
    writer: DatasetWriter, mapping: ImportMapping, splits: dict[str, list[str]], base: Path
) -> None:
    """Write dataset.toml and copy the files that it names, touches and traces."""
    phantom = dict(mapping.setup["phantom"])
    # A preset names a surface among the recordings, whatever folder states the rest.
    homes = [base / mapping.setup_folder]
    homes += [(base / one.files[0]).parent for one in mapping.recordings]
    for key in SURFACES:
        if key in phantom:
            phantom[key] = _copied(writer, phantom[key], homes)
    values: dict[str, Any] = {"format": 1, "name": mapping.name, **mapping.setup}
    values |= {"phantom": phantom, "splits": splits}
    if mapping.wrench.estimated and mapping.streams.wrench:
        values["force"] = {"sigma": ESTIMATED_SIGMA, **mapping.setup.get("force", {})}
    if any(rules.rows == "depth-steps" for rules in mapping.tables.values()):
        values["motion"] = {"stamps": "synthetic", **mapping.setup.get("motion", {})}
    writer.text("dataset.toml", toml_text(values))
    for file, source in (("touches.csv", mapping.touches), ("traces.csv", mapping.traces)):
        if source:
            writer.copied(file, base / source)


def _copied(writer: DatasetWriter, named: Any, homes: list[Path]) -> Any:
    """Copy a file, or each of a list, into the dataset; return its name there."""
    if not isinstance(named, str):
        return [_copied(writer, file, homes) for file in named]
    places = [home / named for home in homes]
    source = next((one for one in places if one.is_file()), places[0])
    inside = not Path(named).is_absolute() and ".." not in Path(named).parts
    name = Path(named).name if inside else named
    writer.copied(name, source)
    return name


def found_phantom(
    writer: DatasetWriter, recordings: list[TimedRecording], notes: ImportNotes
) -> LocatedPhantom | None:
    """Relate the phantom to the robot by what was written, or by touches found as dwells.

    Found touches are written to touches.csv. None where nothing relates them, which is said.
    """
    root = writer.folder
    config, geometry = stated(root)
    none = Touches((), np.zeros((0, 3)))
    traces = read_traces(root)
    has_touches = (root / "touches.csv").exists()
    dataset = Dataset(root, config, none, False, (), geometry, traces)
    # Depth steps at rest would be taken for dwells at landmarks.
    dwells = not config.synthetic_stamps
    if dwells and not has_touches and not len(traces) and config.phantom_from_robot is None:
        _find_touches(writer, dataset, recordings, notes)
        has_touches = (root / "touches.csv").exists()
    touches = read_touches(root, config) if has_touches else none
    dataset = Dataset(root, config, touches, False, (), geometry, traces)
    try:
        fits = robot_fits(dataset)
    except RegistrationError as error:
        notes.warn(f"robot and phantom: {error.message}")
        return None
    if not fits:
        notes.warn(
            "nothing relates robot and phantom: no touches.csv, no traces, no phantom_from_robot, "
            "and no dwells at the landmarks were found; recordings are not cut into pushes"
        )
        return None
    notes.decide(f"robot and phantom: {fits[0].summary}" if fits[0].summary else "robot: stated")
    pose = fits[0].phantom_from_robot
    return LocatedPhantom(geometry, config.tool_radius, pose, touches.positions, touches.names)


def _find_touches(
    writer: DatasetWriter, dataset: Dataset, recordings: list[TimedRecording], notes: ImportNotes
) -> None:
    expected = touched_centres(dataset)
    places: FloatArray = np.array(list(expected.values())).reshape(-1, 3)
    found = find_touches(recordings, list(expected), places)
    if found is None:
        return
    text = f"dwells lie as the landmarks do, to {1e3 * found.rms:.2f} mm RMS"
    if not found.is_clear:
        notes.warn(
            f"{text}, the next choice to {1e3 * found.second:.2f} mm: not clear enough to take "
            "them as touches; write touches.csv, or dwell longer at each landmark in its order"
        )
        return
    at = ", ".join(f"{time:.1f}" for time in found.times)
    notes.decide(f"touches.csv: {text}, at t = {at} s, in the stated order of landmarks")
    rows = [
        f"{name},{x:.9f},{y:.9f},{z:.9f}"
        for name, (x, y, z) in zip(found.names, found.positions.tolist(), strict=True)
    ]
    writer.text("touches.csv", "\n".join(["landmark,x,y,z", *rows]) + "\n")
