"""Layouts of public recordings are known by their look and read as their authors read them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat
from scipy.spatial.transform import Rotation
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.import_recording import import_recordings
from palpate.importing.mapping_file import mapping_text, read_mapping
from palpate.importing.survey import survey

START = 1_570_000_000_000
"""Begin of the recordings [ms] since 1970."""


def told(notes: ImportNotes, words: str) -> bool:
    return any(words in one for one in [*notes.decisions, *notes.warnings])


def network_layout(folder: Path) -> tuple[Path, Path]:
    """The small dataset as the scripts of simulator_network lay it out, a header stamp of 3 ms
    before the receipt of each pose."""
    original = write_valid_dataset(folder / "block")
    root = folder / "2019-10-09-GelPhantom1"
    (root / "dvrk").mkdir(parents=True)
    columns = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    columns += [f"field.pose.position.{axis}" for axis in "xyz"]
    columns += [f"field.pose.orientation.{axis}" for axis in "xyzw"]
    dataset = open_dataset(original)
    for number, name in enumerate(("poke-01", "drag-01")):
        sequence = dataset.sequence(name)
        clock = sequence.kinematics
        rows = []
        for at, time in enumerate(clock.time):
            received = START * 10**6 + round(1e9 * float(time))
            pose = [*clock.position[at], *clock.quaternion[at]]
            line = [received, at, received - 3_000_000, "PSM3", *(f"{v:.9f}" for v in pose)]
            rows.append(",".join(map(str, line)))
        file = root / "dvrk" / f"data{number}_robot_cartesian.csv"
        file.write_text("\n".join([",".join(columns), *rows]) + "\n")
        clouds = root / "camera" / f"data{number}"
        clouds.mkdir(parents=True)
        for at, time in enumerate(sequence.cloud_times):
            source = original / sequence.cloud_files[at]
            (clouds / f"{START + round(1e3 * float(time))}.ply").write_bytes(source.read_bytes())
    return root, original


def test_the_layout_of_the_network_s_scripts_is_read_by_times_of_receipt(tmp_path: Path) -> None:
    root, original = network_layout(tmp_path)
    notes = ImportNotes()
    paths = [root, original / "touches.csv", original / "rest.ply"]
    found = survey(paths, original / "dataset.toml")
    mapping = found.proposal("gel", notes)
    found.close()
    assert told(notes, "read as simulator-network")
    assert mapping.time.stamps == "receipt"
    (tmp_path / "import.toml").write_text(mapping_text(mapping))
    mapping = read_mapping(tmp_path / "import.toml")
    changed = {
        "cutting": mapping.cutting.model_copy(update={"trim": False}),
        "setup": {
            **mapping.setup,
            "splits": {"train": ["data0"], "validation": [], "test": ["data1"]},
        },
    }
    import_recordings(mapping.model_copy(update=changed), tmp_path, tmp_path / "made", notes)
    made, before = open_dataset(tmp_path / "made"), open_dataset(original)
    for name, old in (("data0", "poke-01"), ("data1", "drag-01")):
        one, other = made.sequence(name), before.sequence(old)
        np.testing.assert_allclose(one.kinematics.position, other.kinematics.position, atol=1e-8)
        shift = one.kinematics.time[0] - other.kinematics.time[0]
        np.testing.assert_allclose(one.cloud_times - shift, other.cloud_times, atol=6e-4)


def test_a_preset_is_chosen_by_name_and_refused_where_it_does_not_fit(tmp_path: Path) -> None:
    root, original = network_layout(tmp_path)
    survey([root], None, "simulator-network").close()
    with pytest.raises(DatasetError, match="is not laid out as pokeflex"):
        survey([root], None, "pokeflex")
    with pytest.raises(DatasetError, match="no preset 'wu'; expected simulator-network"):
        survey([root], None, "wu")
    plain = survey([original], None, "none")
    assert not plain.laid_out
    plain.close()


def pushes() -> list[dict[str, Any]]:
    """Pushes as structures of ProbingData, in millimetres; one was not carried out."""
    found = []
    for number in range(6):
        depth = np.linspace(0.0, 2.0, 10)
        place = np.stack([np.full(10, 5.0 * number), np.zeros(10), 39.0 - depth], axis=-1)
        force = np.stack([0 * depth, 0 * depth, 0.07 + 0.1 * depth**1.5], axis=-1)
        done = number != 3
        found.append(
            {
                "CurrentPos": place * done,
                "DeformedForce": force * done,
                "ContactSurfNorm": np.array([[0.0], [0.0], [1.0]]),
                "ContactPoint": np.array([[5.0 * number], [0.0], [36.0]]),
                "T_robot2TK": np.eye(4),
                "Fail": np.zeros((0, 0)),
            }
        )
    return found


def test_structures_of_probing_data_are_pushes_in_millimetres(tmp_path: Path) -> None:
    fields = list(pushes()[0])
    structs = np.zeros((6, 1), dtype=[(name, object) for name in fields])
    for at, push in enumerate(pushes()):
        structs[at, 0] = tuple(push[name] for name in fields)
    savemat(tmp_path / "kidney-plain.mat", {"s": structs})
    notes = ImportNotes()
    found = survey([tmp_path / "kidney-plain.mat"], None)
    mapping = found.proposal("kidney", notes)
    assert told(notes, "read as vanderbilt-probing") and told(notes, "5 pushes in steps of depth")
    assert mapping.wrench.frame == "robot" and mapping.setup["tool"]["radius"] == 3.16e-3
    (source,) = found.recordings[0].sources
    forces = [one.value()[2] for one in source.samples({"kidney-plain.mat#wrench"})]
    assert len(forces) == 50 and forces[9] == pytest.approx(0.07 + 0.1 * 2.0**1.5)
    heights = [one.value()[2] for one in source.samples({"kidney-plain.mat#pose"})]
    assert min(heights) == pytest.approx(0.037)
    found.close()


def test_logs_in_one_structure_are_a_stream_whose_quaternions_are_asked_about(
    tmp_path: Path,
) -> None:
    seconds = np.arange(50) * 0.015
    half = {
        "time": seconds[None], "position": np.stack([seconds, seconds, 130 + seconds]),
        "force": np.ones((3, 50)), "quat": np.tile([[0.9], [0.1], [0.3], [0.3]], 50),
    }  # fmt: skip
    logs = np.zeros((1, 2), dtype=[(name, object) for name in half])
    logs[0, 0] = tuple(half.values())
    logs[0, 1] = tuple({**half, "time": half["time"] + 0.75}.values())
    savemat(tmp_path / "palpation-plain.mat", {"s": {"logName": "x", "logs": logs}})
    notes = ImportNotes()
    found = survey([tmp_path / "palpation-plain.mat"], None)
    found.proposal("palpation", notes)
    (pose, wrench) = found.recordings[0].streams()
    assert (pose.count, wrench.kind) == (100, "wrench") and pose.seconds == pytest.approx(1.485)
    assert told(notes, 'state quaternion_order = "xyzw" or "wxyz"')
    found.close()


def poke_flex_take(root: Path) -> Path:
    """A take with three frames of a square plate in view."""
    (root / "meshes").mkdir(parents=True)
    corners = [(x, y, z) for x in (-30, 30) for y in (0, 40) for z in (-20, 20)]
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7)]
    faces += [(2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (root / "meshes" / "mesh-f00001.obj").write_text("\n".join(lines) + "\n")
    frames = []
    for number in (1, 2, 3):
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("y", 0.1 * number).as_matrix()
        pose[:3, 3] = [0.05, 0.02, 0.01 * number]
        frames.append(
            {"frame": f"{number:05d}", "T_WT": pose.tolist(), "forces": [0, 4.0 * number, 0, 1]}
        )
    (root / "robot_data.json").write_text(json.dumps(frames[::-1]))
    camera = root / "kinect" / "0"
    (camera / "depth").mkdir(parents=True)
    seen = np.diag([1.0, -1.0, -1.0, 1.0])
    seen[2, 3] = 0.8
    stated = {
        "depth_intrinsics": [[20.0, 0, 8], [0, 20.0, 6], [0, 0, 1]],
        "depth_dist_coeffs": [0.0] * 8, "depth_extrinsics": seen.tolist(),
    }  # fmt: skip
    (camera / "camera_parameters.json").write_text(json.dumps(stated))
    for number in (1, 2, 3):
        levels = np.full((12, 16), 780 + number, dtype=np.uint16)
        Image.fromarray(levels).save(camera / "depth" / f"{number:05d}.png")
    return root


def test_a_take_of_poke_flex_is_read_frame_by_frame(tmp_path: Path) -> None:
    root, notes = poke_flex_take(tmp_path / "take-1"), ImportNotes()
    found = survey([root], None)
    mapping = found.proposal("dice", notes)
    assert told(notes, "read as pokeflex")
    assert told(notes, "frame and sign of the forces are not published")
    recording = found.recordings[0]
    poses = [one.value() for one in recording.samples("robot_data.json#pose")]
    np.testing.assert_allclose([one[2] for one in poses], [0.01, 0.02, 0.03])
    forces = list(recording.samples("robot_data.json#wrench"))
    assert forces[2].value()[1] == 12.0 and forces[2].stamped == 100_000_000
    clouds = list(recording.samples(mapping.streams.cloud))
    assert clouds[0].stamped == poses_time(found) and clouds[2].value()[0, 0, 2] == 0.783
    world = np.array(mapping.setup["camera"]["to_phantom"])
    assert world @ [0, 0, 0, 1] == pytest.approx([0, 0, 0.8, 1])
    assert mapping.setup["phantom"]["unit"] == "mm" and mapping.setup["phantom"]["up"] == [0, 1, 0]
    assert (Path(mapping.setup_folder) / mapping.setup["phantom"]["surface"]).is_file()
    found.close()


def test_a_take_of_poke_flex_becomes_a_dataset_with_what_is_not_published(tmp_path: Path) -> None:
    root, notes = poke_flex_take(tmp_path / "take-1"), ImportNotes()
    stated = '[phantom]\nmass = 0.05\n[tool]\nshape = "sphere"\nradius = 0.005\n'
    (tmp_path / "dataset.toml").write_text(stated)
    found = survey([root], tmp_path / "dataset.toml")
    mapping = found.proposal("dice", notes)
    found.close()
    wrench = mapping.wrench.model_copy(update={"frame": "robot"})
    mapping = mapping.model_copy(update={"wrench": wrench})
    import_recordings(mapping, tmp_path, tmp_path / "made", notes)
    dataset = open_dataset(tmp_path / "made")
    assert dataset.config.size == pytest.approx((0.06, 0.04, 0.04))  # y of the file is up
    sequence = dataset.sequence(dataset.sequences[0])
    assert len(sequence) == 3 and sequence.forces is not None
    assert sequence.forces.force[:, 1].tolist() == [4.0, 8.0, 12.0]


def poses_time(found: Any) -> int:
    return int(next(iter(found.recordings[0].samples("robot_data.json#pose"))).stamped)


def test_robot_data_without_poses_is_refused_by_name(tmp_path: Path) -> None:
    root = poke_flex_take(tmp_path / "take-1")
    (root / "robot_data.json").write_text('[{"frame": 1, "forces": [0, 0, 0]}]')
    with pytest.raises(DatasetError, match=r"robot_data.json lacks or misstates 'T_WT'"):
        survey([root], None)
