"""A survey of what a user names: which recordings there are, and what is stated beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from palpate.dataset.files import read_toml
from palpate.dataset.sequence import CLOUDS, FORCES, KINEMATICS
from palpate.foundation.errors import DatasetError
from palpate.importing.cutting.probing_sequences import with_probing
from palpate.importing.import_notes import ImportNotes
from palpate.importing.output.stated_setup import SETUP_TABLES
from palpate.importing.presets.known_presets import preset_of
from palpate.importing.presets.preset import Preset
from palpate.importing.proposed_mapping import proposed_mapping, recording_name
from palpate.importing.recording import Recording
from palpate.importing.rules import ColumnRules, ImportMapping, RestRules
from palpate.importing.sources.agreed_rules import agree_rules
from palpate.importing.sources.opened_sources import is_source, open_source
from palpate.importing.sources.table_source import TableSource
from palpate.importing.stream import Source
from palpate.importing.tables.table_evidence import TableEvidence

__all__ = ["Survey", "read_setup", "survey"]

_SETUP = "dataset.toml"
_TABLES = {"kinematics.csv": KINEMATICS, "clouds.csv": CLOUDS, "forces.csv": FORCES}
"""Tables of a sequence, and their headers."""
_BAGS = (".bag", ".db3", ".mcap")
_LIMIT = 2**20


@dataclass
class Survey:
    """Recordings, and statements beside them.

    Attributes:
        recordings: opened.
        setup: tables of dataset.toml.
        setup_folder: of that file.
        name: of the dataset, as stated.
        topics: streams by role, as [topics] states them.
        touches: file of touches.
        traces: file of traces.
        rest: file of the rest cloud.
        preset: name of the layout; empty to go by the look of each path.
        laid_out: paths of which the layout is known.
    """

    recordings: list[Recording] = field(default_factory=list)
    setup: dict[str, Any] = field(default_factory=dict)
    setup_folder: str = ""
    name: str = ""
    topics: dict[str, str] = field(default_factory=dict)
    touches: str = ""
    traces: str = ""
    rest: str = ""
    preset: str = ""
    laid_out: list[tuple[Preset, Path]] = field(default_factory=list)

    def close(self) -> None:
        """Close all recordings."""
        for one in self.recordings:
            one.close()

    def proposal(self, name: str, notes: ImportNotes, needs_pose: bool = True) -> ImportMapping:
        """Propose a mapping; DatasetError where no stream is the pose of a tool, and one is
        needed.
        """
        tables: dict[str, ColumnRules] = {}
        self._agree(notes)
        for recording in self.recordings:
            for source in recording.sources:
                if source.rules is not None:
                    tables.setdefault(source.path.name, source.rules)
            for warning in recording.warnings():
                notes.warn(warning)
        mapping = proposed_mapping(
            self.recordings, self.name or name, self.setup, tables, self.topics, notes, needs_pose
        )
        for preset, path in self.laid_out:
            notes.decide(f"{path.name}: read as {preset.name}, {preset.summary}")
            mapping = preset.completed(mapping, path, notes)
        mapping = with_probing(mapping, self.recordings, notes)
        return mapping.model_copy(
            update={
                "touches": self.touches,
                "traces": self.traces,
                "rest": RestRules(file=self.rest),
                "setup_folder": self.setup_folder or mapping.setup_folder,
            }
        )

    def _agree(self, notes: ImportNotes) -> None:
        """Settle units and rotations of tables by what is stated beside them."""
        for recording in self.recordings:
            tables = [one for one in recording.sources if isinstance(one, TableSource)]
            for table in tables:
                evidence = TableEvidence.of(
                    self.setup, self.touches, recording.sure_seconds(without=table)
                )
                agree_rules(table, evidence, notes)


def survey(paths: Sequence[Path], setup: Path | None, preset: str = "") -> Survey:
    """Open recordings and read what is stated beside them.

    Args:
        paths: recordings, tables, folders of them, datasets, and files by their names in a
            dataset: touches.csv, traces.csv, rest.ply, dataset.toml.
        setup: a dataset.toml; None without.
        preset: name of the layout of the recordings; empty to go by their look.

    Raises DatasetError where one cannot be read, or where it is open which belong together.
    """
    found = Survey(preset=preset)
    loose: list[Source] = []
    try:
        for path in paths:
            _take(found, loose, path.resolve())
        if setup is not None:
            read_setup(found, setup.resolve())
        found.recordings.extend(_grouped(loose))
        if not found.recordings:
            raise DatasetError("no recording is among the files; expected at least one")
    except BaseException:
        found.close()
        for source in loose:
            source.close()
        raise
    return found


def _take(found: Survey, loose: list[Source], path: Path) -> None:
    """Take up one path by its name and content."""
    if not path.exists():
        raise DatasetError(f"{path} does not exist; expected a recording", file=str(path))
    if path.is_file() and _is_statement(found, path):
        return
    if (path / _SETUP).is_file() and (path / "sequences").is_dir():
        _take_dataset(found, path)
        return
    preset = preset_of(path, found.preset)
    if preset is not None:
        found.laid_out.append((preset, path))
        found.recordings.extend(preset.recordings(path))
        return
    if path.is_dir() and not is_source(path):
        children = sorted(one for one in path.iterdir() if not one.name.startswith((".", "@")))
        tables = [one for one in children if one.name in _TABLES]
        for child in tables or children:
            if tables or child.is_dir() or _is_file_of_interest(child):
                _take(found, loose, child)
        return
    loose.append(open_source(path))


def _is_statement(found: Survey, path: Path) -> bool:
    """Whether a file states something beside recordings, by its name; it is taken up then."""
    match path.name:
        case "dataset.toml":
            read_setup(found, path)
        case "touches.csv":
            found.touches = str(path)
        case "traces.csv":
            found.traces = str(path)
        case _ if path.stem == "rest" and path.suffix in (".ply", ".pcd", ".npy", ".npz", ".xyz"):
            found.rest = str(path)
        case _:
            return False
    return True


def _take_dataset(found: Survey, folder: Path) -> None:
    """Take up a dataset whose sequences are folders or bags."""
    read_setup(found, folder / _SETUP)
    for name in ("touches.csv", "traces.csv", "rest.ply"):
        if (folder / name).is_file():
            _is_statement(found, folder / name)
    for place in sorted((folder / "sequences").iterdir()):
        if place.name.startswith((".", "@")):
            continue
        if place.is_dir() and not is_source(place):
            tables = [place / name for name in _TABLES if (place / name).is_file()]
            if tables:
                sources = tuple(open_source(table, _format_columns(table)) for table in tables)
                found.recordings.append(Recording(recording_name(place), sources))
        elif place.is_dir() or place.suffix in _BAGS:
            found.recordings.append(Recording(recording_name(place), (open_source(place),)))


def _format_columns(table: Path) -> ColumnRules | None:
    """Columns and units of a table that has the header of the dataset format; None for others,
    whose columns are to be proposed.
    """
    header = _TABLES[table.name]
    with table.open("rb") as stream:
        first = stream.readline(4096).decode("utf-8-sig", "replace").strip()
    if first != header:
        return None
    return ColumnRules(columns={name: name for name in header.split(",")}, time_unit="s")


def read_setup(found: Survey, path: Path) -> None:
    """Take up a dataset.toml: its tables, its folder, the dataset's name and stated streams."""
    values = read_toml(path.parent, path.name, _LIMIT)
    found.setup = {key: values[key] for key in SETUP_TABLES if key in values}
    found.setup_folder = str(path.parent)
    found.name = str(values.get("name", ""))
    topics = values.get("topics", {})
    if unknown := set(topics) - {"pose", "cloud", "wrench"}:
        raise DatasetError(
            f"{path.name}: topics.{min(unknown)} is an unknown key; expected pose, cloud, wrench",
            file=path.name,
            key=f"topics.{min(unknown)}",
        )
    found.topics = {role: str(topic) for role, topic in topics.items()}


def _grouped(sources: Sequence[Source]) -> list[Recording]:
    """Recordings of sources: each with poses is one; others join the one beside them."""
    leading = [one for one in sources if any(s.kind == "pose" for s in one.streams())] or list(
        sources[:1]
    )
    others = [one for one in sources if one not in leading]
    groups: list[list[Source]] = [[one] for one in leading]
    for other in others:
        beside = [
            group
            for group in groups
            if len(groups) == 1 or group[0].path.parent == other.path.parent
        ]
        if len(beside) != 1:
            raise DatasetError(
                f"{other.path.name} has no poses, and {len(beside)} recordings with poses stand "
                "beside it; expected one: put each recording into a folder of its own, or group "
                "them in import.toml",
                file=other.path.name,
            )
        beside[0].append(other)
    names = [recording_name(group[0].path) for group in groups]
    if len(set(names)) < len(names):
        names = [recording_name(group[0].path.parent) for group in groups]
    if len(set(names)) < len(names):
        names = [f"{name}-{number:02d}" for number, name in enumerate(names, 1)]
    return [Recording(name, tuple(group)) for name, group in zip(names, groups, strict=True)]


def _is_file_of_interest(path: Path) -> bool:
    return (
        path.suffix.lower() in (*_BAGS, ".csv", ".tsv", ".mat")
        or path.name == _SETUP
        or (path.stem == "rest")
    )
