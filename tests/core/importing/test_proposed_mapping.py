"""Streams are chosen by names and types; what cannot be known is asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from recorded_bags import WrittenBag, written_bag

from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.rules import ImportMapping
from palpate.importing.survey import survey
from palpate.importing.timed_recording import timed_recording

START = 10**18
POSE = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.6, 0.8])


def proposed(
    tmp_path: Path, fill: Callable[[WrittenBag, int], None], ros2: bool = False
) -> tuple[ImportMapping, ImportNotes, Path]:
    """A bag that is filled message by message at 50 Hz, and the mapping proposed for it."""
    path = tmp_path / ("bag" if ros2 else "one.bag")
    with written_bag(path, "mcap" if ros2 else "ros1") as bag:
        for at in range(20):
            fill(bag, START + at * 20_000_000)
    notes = ImportNotes()
    found = survey([path], None)
    try:
        return found.proposal("name", notes), notes, path
    finally:
        found.close()


@pytest.mark.parametrize(
    ("topics", "best"),
    [
        (["/P/setpoint_cp", "/P/measured_cp", "/P/local/measured_cp"], "/P/measured_cp"),
        (["/dvrk/P/position_cartesian_current", "/other"], "/dvrk/P/position_cartesian_current"),
        (["/P/setpoint_cp", "/P/local/measured_cp"], "/P/local/measured_cp"),
        (["/base", "/tool_pose"], "/tool_pose"),
    ],
)
def test_the_pose_is_chosen_by_the_names_of_the_field(
    tmp_path: Path, topics: list[str], best: str
) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        for topic in topics:
            bag.pose(topic, stamp, stamp, POSE, "ECM")

    mapping, notes, _ = proposed(tmp_path, fill)
    assert mapping.streams.pose == best
    assert mapping.pose.frame == "ECM"
    assert any("tool_tip is 0, 0, 0" in one for one in notes.decisions)
    assert any("leaves out the base frame" in one for one in notes.warnings) == ("local" in best)


def test_a_commanded_pose_is_taken_with_a_warning(tmp_path: Path) -> None:
    mapping, notes, _ = proposed(
        tmp_path, lambda bag, stamp: bag.pose("/PSM1/setpoint_cp", stamp, stamp, POSE, "ECM")
    )
    assert mapping.streams.pose == "/PSM1/setpoint_cp"
    assert "commanded pose" in notes.warnings[0]


def test_joint_states_alone_are_refused_clearly(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"only joint states are there \(/PSM1/measured_js\)"):
        proposed(tmp_path, lambda bag, stamp: bag.joints("/PSM1/measured_js", stamp))


def test_forces_from_motor_currents_are_said_to_be_estimates(tmp_path: Path) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        bag.pose("/PSM1/measured_cp", stamp, stamp, POSE, "ECM")
        bag.wrench("/PSM1/body/measured_cf", stamp, stamp, np.ones(3), "PSM1")

    mapping, notes, _ = proposed(tmp_path, fill)
    assert mapping.wrench.frame == "tool" and mapping.wrench.estimated
    assert any("estimate from motor currents, about 2 N off" in one for one in notes.warnings)


def test_forces_of_the_poses_frame_are_in_the_robot_frame(tmp_path: Path) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        bag.pose("/PSM1/measured_cp", stamp, stamp, POSE, "ECM")
        bag.wrench("/wrench", stamp, stamp, np.ones(3), "ECM")

    mapping, notes, _ = proposed(tmp_path, fill)
    assert mapping.wrench.frame == "robot" and not notes.warnings


@pytest.mark.parametrize("ros2", [False, True])
def test_frames_of_tf_are_read_out_of_nested_arrays(tmp_path: Path, ros2: bool) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        other = bag.transform(stamp, np.array([9, 9, 9, 0, 0, 0, 1.0]), "world", "table")
        bag.tf("/tf", [other, bag.transform(stamp, POSE, "base", "tool0")], stamp + 10**6)

    mapping, _, path = proposed(tmp_path, fill, ros2)
    assert mapping.streams.pose == "/tf#tool0"
    assert mapping.pose.frame == "base"
    found = survey([path], None)
    timed = timed_recording(found.recordings[0], mapping, ImportNotes())
    found.close()
    np.testing.assert_allclose(timed.positions, np.tile(POSE[:3], (20, 1)))
    np.testing.assert_allclose(timed.quaternions, np.tile(POSE[3:], (20, 1)))
    assert timed.pose_times[0] == START


def test_poses_without_header_and_transforms_are_read(tmp_path: Path) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        point = bag.make("geometry_msgs/msg/Point", x=0.1, y=0.2, z=0.3)
        turn = bag.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.6, w=0.8)
        pose = bag.make("geometry_msgs/msg/Pose", position=point, orientation=turn)
        bag.write("/tool_pose", pose, stamp)
        bag.write("/PSM1/measured_cp", bag.transform(stamp, POSE, "ECM", "tip"), stamp)

    mapping, _, path = proposed(tmp_path, fill)
    assert mapping.streams.pose == "/PSM1/measured_cp"
    found = survey([path], None)
    notes = ImportNotes()
    bare = mapping.model_copy(
        update={"streams": mapping.streams.model_copy(update={"pose": "/tool_pose"})}
    )
    for one in (mapping, bare):
        timed = timed_recording(found.recordings[0], one, notes)
        np.testing.assert_allclose(timed.positions[0], POSE[:3])
        np.testing.assert_allclose(timed.quaternions[0], POSE[3:])
    found.close()
    assert any("/tool_pose: has no header stamps" in one for one in notes.warnings)


def test_a_pose_whose_frame_changes_is_refused(tmp_path: Path) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        frame = "ECM" if stamp < START + 10**8 else "base"
        bag.pose("/PSM1/measured_cp", stamp, stamp, POSE, frame)

    mapping, notes, path = proposed(tmp_path, fill)
    found = survey([path], None)
    with pytest.raises(DatasetError, match="in the frames ECM, base; expected ECM throughout"):
        timed_recording(found.recordings[0], mapping, notes)
    found.close()


def test_poses_that_are_no_poses_are_dropped_and_counted(tmp_path: Path) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        broken = stamp == START + 100_000_000
        pose = np.zeros(7) if broken else POSE
        bag.pose("/PSM1/measured_cp", stamp, stamp, pose, "ECM")

    mapping, notes, path = proposed(tmp_path, fill)
    found = survey([path], None)
    timed = timed_recording(found.recordings[0], mapping, notes)
    found.close()
    assert len(timed.positions) == 19
    assert "1 of 20 poses are not finite or have no orientation" in notes.warnings[-1]


def test_depth_images_are_taken_with_the_camera_beside_them(tmp_path: Path) -> None:
    def fill(bag: WrittenBag, stamp: int) -> None:
        bag.pose("/PSM1/measured_cp", stamp, stamp, POSE, "ECM")
        for name in ("left", "depth"):
            bag.camera_info(
                f"/cam/{name}/camera_info", stamp, stamp, (4, 6), np.eye(3), np.zeros(5)
            )
        bag.image("/cam/depth/image", stamp, stamp, np.ones((4, 6), np.float32), "cam")

    mapping, notes, _ = proposed(tmp_path, fill)
    assert mapping.streams.cloud == "/cam/depth/image"
    assert mapping.streams.camera == "/cam/depth/camera_info"
    assert any("with /cam/depth/camera_info" in one for one in notes.decisions)


def test_tables_beside_two_recordings_are_asked_about(tmp_path: Path) -> None:
    header, row = "t,x,y,z,qx,qy,qz,qw\n", "0.1,0.2,0.3,0,0,0,1\n"
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(header + "0.0," + row + "0.1," + row)
    (tmp_path / "forces.csv").write_text("t,fx,fy,fz\n0.0,1,2,3\n0.1,1,2,3\n")
    with pytest.raises(DatasetError, match=r"forces.csv has no poses, and 2 recordings"):
        survey([tmp_path / name for name in ("a.csv", "b.csv", "forces.csv")], None)
