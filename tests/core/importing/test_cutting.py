"""One long recording becomes named sequences, touches, a rest cloud and splits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from bench_recording import CORNERS, ROBOT_FROM_PHANTOM, BenchRecording, bench_setup

from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError
from palpate.importing.cutting.rest_average import averaged_cloud
from palpate.importing.cutting.split_proposal import proposed_splits
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import chosen_splits, import_recordings
from palpate.importing.mapping_file import read_mapping
from palpate.importing.rules import ImportMapping, SequenceWindow, WrenchRules
from palpate.importing.survey import survey


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    bench_setup(folder)
    return BenchRecording().write(folder / "bench.bag")


def proposal(bag: Path, **wrench: object) -> tuple[ImportMapping, ImportNotes]:
    notes = ImportNotes()
    found = survey([bag], bag.parent / "dataset.toml")
    mapping = found.proposal("bench", notes)
    found.close()
    rules = WrenchRules.model_validate({"frame": "tool", "zero": "fitted", **wrench})
    return mapping.model_copy(update={"wrench": rules}), notes


@pytest.fixture(scope="module")
def made(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ImportNotes]:
    mapping, notes = proposal(bag, weight="fitted")
    folder = tmp_path_factory.mktemp("made") / "bench"
    import_recordings(mapping, bag.parent, folder, notes)
    return folder, notes


def test_pushes_are_found_and_named_by_kind(made: tuple[Path, ImportNotes]) -> None:
    dataset = open_dataset(made[0])
    assert dataset.sequences == ("drag-01", "poke-side-01", "poke-top-01", "poke-top-02")
    windows = {one.name: one for one in read_mapping(made[0] / "import.toml").sequences}
    assert [windows[name].kind for name in dataset.sequences] == ["drag", "side", "top", "top"]
    for one in windows.values():
        assert 4 < one.end - one.start < 12
    assert not any(
        a.start < b.end and b.start < a.end
        for a in windows.values()
        for b in windows.values()
        if a is not b
    )


def test_touches_are_found_as_dwells_in_the_order_of_the_landmarks(
    made: tuple[Path, ImportNotes],
) -> None:
    touches = open_dataset(made[0]).touches
    assert touches.names == ("corner_0", "corner_1", "corner_2", "corner_3")
    rotation, shift = ROBOT_FROM_PHANTOM
    np.testing.assert_allclose(touches.positions, rotation.apply(CORNERS) + shift, atol=1e-5)
    assert any(one.startswith("touches.csv: dwells lie as") for one in made[1].decisions)


def test_the_rest_cloud_is_the_median_of_untouched_frames(made: tuple[Path, ImportNotes]) -> None:
    points = open_dataset(made[0]).rest_cloud()
    assert len(points) == 600
    # The median of 30 frames with 1 mm of noise and a tenth missing.
    assert np.std(points[:, 2] - 0.4) < 0.35e-3
    assert any("median of" in one for one in made[1].decisions)


def test_splits_are_proposed_by_kind(made: tuple[Path, ImportNotes]) -> None:
    config = open_dataset(made[0]).config
    assert set(config.train) == {"drag-01", "poke-side-01", "poke-top-01"}
    assert (config.validation, config.test) == ((), ("poke-top-02",))


@pytest.mark.parametrize(
    ("kinds", "train", "validation", "test"),
    [
        ("t", "t1", "", ""),
        ("tts", "t1 s1", "", "t2"),
        ("ttt", "t1", "t2", "t3"),
        ("ssstttttt", "s1 t1 t3 t5", "s2", "s3 t2 t4 t6"),
        ("tdd", "t1 d1", "", "d2"),
    ],
)
def test_pushes_of_each_kind_train_and_test_in_turn(
    kinds: str, train: str, validation: str, test: str
) -> None:
    names = {"t": "top", "s": "side", "d": "drag"}
    windows = [
        SequenceWindow.model_validate(
            {
                "name": f"{kind}{kinds[: at + 1].count(kind)}",
                "recording": "one",
                "start": at,
                "end": at + 1,
                "kind": names[kind],
            }
        )
        for at, kind in enumerate(kinds)
    ]
    assert proposed_splits(windows) == {
        "train": train.split(),
        "validation": validation.split(),
        "test": test.split(),
    }


def test_weight_and_zero_are_fitted_where_the_tool_turned(made: tuple[Path, ImportNotes]) -> None:
    bench = BenchRecording()
    stamps, _, _, _ = bench.motion()
    forces = open_dataset(made[0]).sequence("poke-top-01").forces
    assert forces is not None
    true = np.stack([np.interp(forces.time, stamps / 1e9, axis) for axis in bench.felt().T], -1)
    np.testing.assert_allclose(forces.force, true, atol=0.01)
    assert true.max() > 0.4
    (said,) = (one for one in made[1].decisions if "weight" in one)
    assert "zero of the forces 0.300, -0.200, 0.500 N" in said
    assert "-0.800 N in the robot frame" in said


def test_a_zero_alone_leaves_the_weight_that_turns(bag: Path, tmp_path: Path) -> None:
    mapping, notes = proposal(bag)
    import_recordings(mapping, bag.parent, tmp_path / "made", notes)
    forces = open_dataset(tmp_path / "made").sequence("poke-top-01").forces
    assert forces is not None
    before = forces.force[forces.time < forces.time[0] + 0.5]
    assert 0.01 < np.abs(before).max() < 1.0


def test_forces_of_an_unknown_frame_are_refused(bag: Path, tmp_path: Path) -> None:
    mapping, notes = proposal(bag, frame="")
    assert any("its frame 'ati_link' is not that of the poses" in one for one in notes.warnings)
    with pytest.raises(DatasetError, match="frame of the forces is not known"):
        import_recordings(mapping, bag.parent, tmp_path / "made", notes)


def test_cuts_in_import_toml_are_kept(bag: Path, tmp_path: Path) -> None:
    mapping, notes = proposal(bag)
    start = BenchRecording().motion()[0][0] / 1e9 + 26
    windows = (SequenceWindow(name="mine", recording="bench", start=start, end=start + 4),)
    import_recordings(
        mapping.model_copy(update={"sequences": windows}), bag.parent, tmp_path / "made", notes
    )
    dataset = open_dataset(tmp_path / "made")
    assert dataset.sequences == ("mine",)
    time = dataset.sequence("mine").kinematics.time
    np.testing.assert_allclose([time[0], time[-1]], [start, start + 4], atol=0.011)
    assert len(dataset.sequence("mine")) in (20, 21)


def test_cuts_outside_of_the_recording_are_refused(bag: Path, tmp_path: Path) -> None:
    mapping, notes = proposal(bag)
    windows = (SequenceWindow(name="mine", recording="bench", start=1.0, end=2.0),)
    with pytest.raises(DatasetError, match=r"mine: 0 poses lie from 1\.000 to 2\.000 s"):
        import_recordings(
            mapping.model_copy(update={"sequences": windows}), bag.parent, tmp_path / "made", notes
        )


@pytest.mark.parametrize(
    ("names", "recording", "said"),
    [
        (("a", "b"), "other", "is of recording 'other'; expected one of bench"),
        (("a", "a"), "bench", "two sequences are named a"),
    ],
)
def test_cuts_that_contradict_themselves_are_refused(
    bag: Path, tmp_path: Path, names: tuple[str, str], recording: str, said: str
) -> None:
    mapping, notes = proposal(bag)
    windows = tuple(
        SequenceWindow(name=name, recording=recording, start=1.0, end=2.0) for name in names
    )
    with pytest.raises(DatasetError, match=said):
        import_recordings(
            mapping.model_copy(update={"sequences": windows}), bag.parent, tmp_path / "made", notes
        )


def test_a_phantom_of_any_shape_is_copied_with_its_surface(bag: Path, tmp_path: Path) -> None:
    surface = trimesh.creation.box((0.0687, 0.0393, 0.0358))
    surface.apply_translation([0, 0, 0.0179])
    surface.export(bag.parent / "phantom.stl")
    mapping, notes = proposal(bag)
    phantom = {"geometry": "mesh", "surface": "phantom.stl", "mass": 0.104, "fixed": "base"}
    setup = {**mapping.setup, "phantom": phantom}
    import_recordings(
        mapping.model_copy(update={"setup": setup}), bag.parent, tmp_path / "made", notes
    )
    assert (tmp_path / "made" / "phantom.stl").is_file()
    assert "poke-top-02" in open_dataset(tmp_path / "made").sequences
    outside = {**setup, "phantom": {**phantom, "surface": "../phantom.stl"}}
    with pytest.raises(DatasetError, match="leads out of the dataset"):
        import_recordings(
            mapping.model_copy(update={"setup": outside}), bag.parent, tmp_path / "two", notes
        )


def test_a_tool_tip_moves_the_path_along_the_tools_axes(bag: Path, tmp_path: Path) -> None:
    mapping, notes = proposal(bag)
    pose = mapping.pose.model_copy(update={"tool_tip": (0.0, 0.0, 0.01)})
    cutting = mapping.cutting.model_copy(update={"cut": False, "trim": False})
    rotation, shift = ROBOT_FROM_PHANTOM
    touches = rotation.apply(CORNERS) + shift
    rows = [f"corner_{n},{x},{y},{z}" for n, (x, y, z) in enumerate(touches.tolist())]
    (tmp_path / "touches.csv").write_text("\n".join(["landmark,x,y,z", *rows]) + "\n")
    changed = {"pose": pose, "cutting": cutting, "touches": str(tmp_path / "touches.csv")}
    import_recordings(mapping.model_copy(update=changed), bag.parent, tmp_path / "made", notes)
    path = open_dataset(tmp_path / "made").sequence("bench").kinematics
    apart = path.position - BenchRecording().motion()[2]
    np.testing.assert_allclose(np.linalg.norm(apart, axis=1), 0.01, atol=1e-6)
    assert np.ptp(apart, axis=0).max() > 0.003


def test_large_images_are_averaged_as_a_whole_one_would_be() -> None:
    rng = np.random.default_rng(0)
    frames = rng.normal(0.4, 1e-3, (5, 70, 9, 3)).astype(np.float32)
    frames[rng.random(frames.shape[:3]) < 0.3] = np.nan
    points, how = averaged_cloud(list(frames))
    often = np.isfinite(frames).all(axis=-1).mean(axis=0) >= 0.5
    np.testing.assert_array_equal(points, np.nanmedian(frames[:, often], axis=0))
    assert how == "median of 5 frames, pixel by pixel"


def test_sequences_that_state_their_split_are_not_split_anew() -> None:
    names = {"a": "test", "b": "", "c": "train", "d": "none"}
    windows = [
        SequenceWindow.model_validate(
            {"name": name, "recording": "bench", "start": 0, "end": 1, "split": split}
        )
        for name, split in names.items()
    ]
    mapping = ImportMapping.model_validate(
        {"name": "x", "recordings": [{"name": "bench", "files": ["a.bag"]}]}
    )
    notes = ImportNotes()
    splits = chosen_splits(windows, mapping, notes)
    assert splits == {"train": ["c"], "validation": [], "test": ["a"]} and not notes.decisions
    proposed = chosen_splits(windows[1:2], mapping, notes)
    assert proposed["train"] == ["b"] and len(notes.decisions) == 1
