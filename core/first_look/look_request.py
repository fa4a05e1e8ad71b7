"""Request of a first look: files, and what is stated about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.mapping_file import read_mapping
from palpate.importing.output.stated_setup import SURFACES
from palpate.importing.recording import Recording, opened_recording
from palpate.importing.rules import ImportMapping
from palpate.importing.survey import Survey, read_setup, survey

__all__ = ["LookRequest", "bound_mapping", "is_dataset", "named_files", "opened_sources"]

_BESIDE = (".stl", ".obj", ".ply", ".pcd", ".png", ".npy", ".npz", ".json", ".xyz")
"""Endings of files that are no recordings by themselves."""


@dataclass(frozen=True, kw_only=True)
class LookRequest:
    """Recordings or a dataset, and what is stated about them.

    Attributes:
        files: recordings, tables, folders, statements; or the one folder of a dataset.
        setup: a dataset.toml; None without.
        mapping: an import.toml; None to propose one. Its files are looked for among `files` by
            their names; without `files` they are taken as it names them.
        streams: names of streams by role (pose, cloud, camera, wrench); an empty name for none.
        name: of the look.
        base: folder from which files are named in the look's mapping; None for whole paths.
    """

    files: tuple[Path, ...]
    setup: Path | None = None
    mapping: Path | None = None
    streams: dict[str, str] = field(default_factory=dict)
    name: str = "look"
    base: Path | None = None


def is_dataset(files: Sequence[Path]) -> bool:
    """Whether the files are the one folder of a dataset."""
    return (
        len(files) == 1
        and (files[0] / "dataset.toml").is_file()
        and (files[0] / "sequences").is_dir()
    )


def opened_sources(
    request: LookRequest, notes: ImportNotes
) -> tuple[list[Recording], ImportMapping]:
    """Open the recordings of a request, and read or propose their mapping.

    Raises DatasetError where a file cannot be read, or the mapping names one that is not there.
    """
    if request.mapping is not None:
        mapping = read_mapping(request.mapping)
        home = request.mapping.resolve().parent
        mapping = bound_mapping(mapping, request.files, home)
        if request.setup is not None:
            stated = Survey()
            read_setup(stated, request.setup.resolve())
            mapping = mapping.model_copy(
                update={"setup": stated.setup, "setup_folder": stated.setup_folder}
            )
        recordings: list[Recording] = []
        try:
            for one in mapping.recordings:
                paths = tuple(Path(file) for file in one.files)
                recordings.append(opened_recording(one.name, paths, mapping.tables))
        except BaseException:
            for opened in recordings:
                opened.close()
            raise
        mapping = _with_surfaces(mapping, request.files)
        return recordings, _with_streams(mapping, request.streams)
    surveyed = survey(_recorded(request.files, notes), request.setup)
    try:
        named = {role: name for role, name in request.streams.items() if name and role != "camera"}
        surveyed.topics = {**surveyed.topics, **named}
        mapping = surveyed.proposal(request.name, notes, needs_pose=False)
    except BaseException:
        surveyed.close()
        raise
    mapping = _with_surfaces(mapping, request.files)
    return surveyed.recordings, _with_streams(mapping, request.streams)


def named_files(mapping: Path) -> tuple[ImportMapping, list[Path]]:
    """Read an import.toml that stands alone: with whole paths, and the files that it names."""
    home = mapping.resolve().parent
    found = bound_mapping(read_mapping(mapping), (), home)
    files = [file for one in found.recordings for file in one.files]
    files += [file for file in (found.touches, found.traces, found.rest.file) if file]
    surfaces = [Path(found.setup_folder) / name for name in _surfaces(found)]
    return found, [*map(Path, files), *(one for one in surfaces if one.is_file())]


def _surfaces(mapping: ImportMapping) -> list[str]:
    """Files that the phantom's statement names."""
    phantom = mapping.setup.get("phantom", {})
    named = [phantom.get(key, []) for key in SURFACES] if isinstance(phantom, dict) else []
    return [str(one) for some in named for one in ([some] if isinstance(some, str) else some)]


def _recorded(files: Sequence[Path], notes: ImportNotes) -> list[Path]:
    """The files without those that are no recordings by themselves, such as a surface that the
    setup names.
    """
    beside = [
        one
        for one in files
        if one.is_file() and one.suffix.lower() in _BESIDE and one.stem != "rest"
    ]
    if beside and len(beside) < len(files):
        names = ", ".join(one.name for one in beside)
        notes.decide(f"no recordings by themselves, used where setup or tables name them: {names}")
        return [one for one in files if one not in beside]
    return list(files)


def _alike(file: str, places: Sequence[Path]) -> list[Path]:
    """The places of this file's name whose folders agree with it the farthest."""
    parts = Path(file.replace("\\", "/")).parts[::-1]

    def agreeing(place: Path) -> int:
        pairs = zip(parts, place.parts[::-1], strict=False)
        return next((at for at, (one, other) in enumerate(pairs) if one != other), len(parts))

    named = {place: agreeing(place) for place in places if place.name == parts[0]}
    most = max(named.values(), default=0)
    return [place for place, alike in named.items() if alike == most]


def _with_surfaces(mapping: ImportMapping, files: Sequence[Path]) -> ImportMapping:
    """The mapping with the folder in which the surfaces that the setup names lie: beside the setup,
    else beside a recording.
    """
    names = _surfaces(mapping)
    homes = [Path(mapping.setup_folder), *(file.resolve().parent for file in files)]
    for home in homes if names else ():
        if all((home / name).is_file() for name in names):
            return mapping.model_copy(update={"setup_folder": str(home)})
    return mapping


def bound_mapping(mapping: ImportMapping, files: Sequence[Path], home: Path) -> ImportMapping:
    """The mapping with the whole paths of its files.

    Args:
        mapping: as read.
        files: among which the mapping's are looked for by their names; empty to take the mapping's
            as they are.
        home: folder from which the mapping names them.

    Raises DatasetError for a file that is not among the given ones.
    """
    sources = [path.resolve() for path in files]
    places = _spread(sources)

    def bound(file: str, key: str) -> str:
        if not file:
            return ""
        found = (home / file).resolve()
        if not files or any(found.is_relative_to(one) for one in sources):
            return str(found)
        fitting = _alike(file, places)
        if len(fitting) != 1:
            names = ", ".join(sorted({path.name for path in places})[:20])
            many = "is not" if not fitting else f"is {len(fitting)} times"
            raise DatasetError(
                f"{key} names {Path(file).name}, which {many} among the files; expected it once, "
                f"there are {names}: bring it, or correct {key}",
                key=key,
                value=Path(file).name,
            )
        return str(fitting[0])

    recordings = tuple(
        one.model_copy(update={"files": tuple(bound(file, "recordings") for file in one.files)})
        for one in mapping.recordings
    )
    folder = (home / mapping.setup_folder).resolve()
    if files and not any(one.parent == folder or folder.is_relative_to(one) for one in sources):
        stated = (path.parent for path in places if path.name == "dataset.toml")
        folder = next(stated, sources[0].parent)
    return mapping.model_copy(
        update={
            "recordings": recordings,
            "touches": bound(mapping.touches, "touches"),
            "traces": bound(mapping.traces, "traces"),
            "rest": mapping.rest.model_copy(update={"file": bound(mapping.rest.file, "rest.file")}),
            "setup_folder": str(folder),
        }
    )


def _spread(files: Sequence[Path]) -> list[Path]:
    """The files, and what lies in folders among them to two levels."""
    found: list[Path] = []
    for path in files:
        found.append(path)
        if path.is_dir():
            found += [one for depth in ("*", "*/*") for one in sorted(path.glob(depth))]
    return found


def _with_streams(mapping: ImportMapping, streams: dict[str, str]) -> ImportMapping:
    known = {
        role: name for role, name in streams.items() if role in type(mapping.streams).model_fields
    }
    return mapping.model_copy(update={"streams": mapping.streams.model_copy(update=known)})
