"""Bags made of a dataset become that dataset again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_bags import BAG_KINDS, BagKind, write_sequence_bag
from small_dataset import write_valid_dataset

import palpate
from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import import_recordings
from palpate.importing.mapping_file import mapping_text, read_mapping
from palpate.importing.opened_bags import CACHE
from palpate.importing.survey import survey

SEQUENCES = ("poke-01", "drag-01")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_valid_dataset(tmp_path_factory.mktemp("original") / "block")


def bags(original: Path, folder: Path, kind: BagKind) -> list[Path]:
    """One bag for each sequence."""
    folder.mkdir(exist_ok=True)
    suffix = "" if kind in ("sqlite3", "mcap") else ".bag"
    paths = [folder / f"{name}{suffix}" for name in SEQUENCES]
    for name, path in zip(SEQUENCES, paths, strict=True):
        write_sequence_bag(original, name, path, kind)
    return paths


def imported(original: Path, paths: list[Path], folder: Path) -> tuple[Path, ImportNotes]:
    notes = ImportNotes()
    found = survey(
        [*paths, original / "touches.csv", original / "rest.ply"], original / "dataset.toml"
    )
    mapping = found.proposal("again", notes)
    found.close()
    mapping = mapping.model_copy(
        update={"cutting": mapping.cutting.model_copy(update={"trim": False})}
    )
    import_recordings(mapping, Path.cwd(), folder, notes)
    return folder, notes


def assert_same(one: Path, other: Path) -> None:
    first, second = open_dataset(one), open_dataset(other)
    assert first.sequences == second.sequences
    for name in first.sequences:
        a, b = first.sequence(name), second.sequence(name)
        np.testing.assert_allclose(a.kinematics.time, b.kinematics.time, atol=1e-7)
        np.testing.assert_allclose(a.kinematics.position, b.kinematics.position, atol=1e-6)
        np.testing.assert_allclose(a.kinematics.quaternion, b.kinematics.quaternion, atol=1e-6)
        np.testing.assert_allclose(a.cloud_times, b.cloud_times, atol=1e-7)
        assert (a.forces is None) == (b.forces is None)
        if a.forces is not None and b.forces is not None:
            np.testing.assert_allclose(a.forces.force, b.forces.force, atol=1e-6)
        for at in range(len(a)):
            np.testing.assert_allclose(a.cloud(at), b.cloud(at), atol=1e-6)
    np.testing.assert_allclose(first.rest_cloud(), second.rest_cloud(), atol=1e-6)
    np.testing.assert_allclose(first.touches.positions, second.touches.positions, atol=1e-6)


@pytest.mark.parametrize("kind", BAG_KINDS)
def test_bags_of_each_kind_give_the_dataset_that_was_recorded(
    original: Path, tmp_path: Path, kind: BagKind
) -> None:
    made, notes = imported(original, bags(original, tmp_path / "bags", kind), tmp_path / "made")
    assert_same(original, made)
    assert any("/PSM1/measured_cp, frame 'PSM1_base'" in one for one in notes.decisions)
    assert not notes.warnings


def test_a_dataset_of_tables_and_clouds_is_imported_unchanged(
    original: Path, tmp_path: Path
) -> None:
    made, _ = imported(original, [original], tmp_path / "made")
    assert_same(original, made)


def test_bare_storage_files_of_ros_2_are_read_without_their_folder(
    original: Path, tmp_path: Path
) -> None:
    folders = bags(original, tmp_path / "bags", "mcap")
    files = [folder / f"{folder.name}.mcap" for folder in folders]
    made, _ = imported(original, files, tmp_path / "made")
    assert_same(original, made)


def test_import_toml_is_read_back_as_it_was_written(original: Path, tmp_path: Path) -> None:
    made, _ = imported(original, bags(original, tmp_path / "bags", "ros1"), tmp_path / "made")
    mapping = read_mapping(made / "import.toml")
    (tmp_path / "import.toml").write_text(mapping_text(mapping))
    assert read_mapping(tmp_path / "import.toml") == mapping
    assert sorted(one.name for one in mapping.sequences) == sorted(SEQUENCES)


def test_a_second_import_takes_over_what_did_not_change(original: Path, tmp_path: Path) -> None:
    made, _ = imported(original, bags(original, tmp_path / "bags", "ros1"), tmp_path / "made")
    mapping = read_mapping(made / "import.toml")
    first, second = mapping.sequences
    shorter = second.model_copy(update={"end": second.end - 0.2})
    changed = mapping.model_copy(update={"sequences": (first, shorter)})
    before = (made / "sequences" / first.name / "clouds" / "000000.ply").stat().st_ino
    done = import_recordings(changed, tmp_path, made, ImportNotes(), again=True)
    assert done.reused == (first.name,)
    assert (made / "sequences" / first.name / "clouds" / "000000.ply").stat().st_ino == before
    kept = open_dataset(made).sequence(second.name)
    assert kept.kinematics.time[-1] <= shorter.end
    assert len(kept) == 4


def test_a_folder_that_no_import_made_is_never_replaced(original: Path, tmp_path: Path) -> None:
    paths = bags(original, tmp_path / "bags", "ros1")
    found = survey(paths, original / "dataset.toml")
    mapping = found.proposal("again", ImportNotes())
    found.close()
    with pytest.raises(DatasetError, match="was not made by an import"):
        import_recordings(mapping, tmp_path, original, ImportNotes(), again=True)
    assert (original / "touches.csv").exists()


def test_a_failed_import_leaves_nothing_behind(original: Path, tmp_path: Path) -> None:
    paths = bags(original, tmp_path / "bags", "ros1")
    found = survey(paths, None)
    mapping = found.proposal("again", ImportNotes())
    found.close()
    with pytest.raises(DatasetError, match=r"\[phantom\], \[tool\], \[camera\] are not stated"):
        import_recordings(mapping, tmp_path, tmp_path / "made", ImportNotes())
    broken = mapping.model_copy(update={"setup": {"phantom": {}, "tool": {}, "camera": {}}})
    with pytest.raises(DatasetError, match="geometry"):
        import_recordings(broken, tmp_path, tmp_path / "made", ImportNotes())
    assert [one.name for one in tmp_path.iterdir()] == ["bags"]


@pytest.fixture
def with_bags(original: Path, tmp_path: Path) -> Path:
    """The dataset with a bag for each sequence, named by [topics]."""
    folder = tmp_path / "with-bags"
    (folder / "sequences").mkdir(parents=True)
    for file in ("touches.csv", "rest.ply"):
        (folder / file).write_bytes((original / file).read_bytes())
    topics = '[topics]\npose = "/PSM1/measured_cp"\ncloud = "/camera/points"\nwrench = "/wrench"\n'
    (folder / "dataset.toml").write_text((original / "dataset.toml").read_text() + topics)
    for name in SEQUENCES:
        write_sequence_bag(original, name, folder / "sequences" / f"{name}.bag", "ros1")
    return folder


def test_topics_of_a_dataset_with_bags_name_the_streams(with_bags: Path, tmp_path: Path) -> None:
    found = survey([with_bags], None)
    mapping = found.proposal("again", ImportNotes())
    found.close()
    import_recordings(mapping, tmp_path, tmp_path / "made", ImportNotes())
    assert open_dataset(tmp_path / "made").sequence("poke-01").forces is not None


def test_a_dataset_with_bags_opens_directly_and_the_second_time_at_once(
    original: Path, with_bags: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE, str(tmp_path / "cache"))
    opened = palpate.open_dataset(with_bags)
    assert_same(original, opened.path)
    changed = (opened.path / "dataset.toml").stat().st_mtime_ns
    assert palpate.open_dataset(with_bags).path == opened.path
    assert (opened.path / "dataset.toml").stat().st_mtime_ns == changed
    (with_bags / "touches.csv").touch()
    assert palpate.open_dataset(with_bags).path != opened.path
    assert palpate.open_dataset(original).path == original


def test_estimated_forces_state_their_deviation_in_the_dataset(
    original: Path, tmp_path: Path
) -> None:
    paths = bags(original, tmp_path / "bags", "ros1")
    found = survey(
        [*paths, original / "touches.csv", original / "rest.ply"], original / "dataset.toml"
    )
    mapping = found.proposal("again", ImportNotes())
    found.close()
    estimated = mapping.wrench.model_copy(update={"estimated": True})
    mapping = mapping.model_copy(update={"wrench": estimated})
    import_recordings(mapping, Path.cwd(), tmp_path / "made", ImportNotes())
    assert open_dataset(tmp_path / "made").config.force_sigma == 2.0
    better = mapping.model_copy(update={"setup": {**mapping.setup, "force": {"sigma": 0.3}}})
    import_recordings(better, Path.cwd(), tmp_path / "better", ImportNotes())
    assert open_dataset(tmp_path / "better").config.force_sigma == 0.3
