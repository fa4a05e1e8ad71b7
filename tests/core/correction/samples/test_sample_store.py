from __future__ import annotations

import numpy as np
import pytest
from learned_samples import write_samples
from scipy.spatial.transform import Rotation

from palpate.correction import Body, body_for, make_samples, open_samples, recorder_for
from palpate.correction.samples.tool_columns import canonical_quaternions, tool_columns
from palpate.dataset import Kinematics, Sequence
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.foundation.errors import Cancelled, CorrectionError, RunError
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import camera_model_for
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay


def test_samples_hold_the_replay_and_the_clouds(bench):
    samples, recorder = bench.samples, bench.recorder
    sequence = bench.dataset.sequence("poke-top-02")
    rows, times = samples.rows(["poke-top-02"]), np.asarray(sequence.cloud_times)
    centres = recorder.phantom_from_robot.apply(smooth_centres(sequence.kinematics, times))
    frames = replay(recorder.setup, centres, recorder.grid, times=times, tolerance=1e-3)
    assert samples.column("frame", rows).tolist() == list(range(len(sequence)))
    for number in (0, 20, 30):
        batch = samples.batch(rows[number : number + 1])
        assert np.allclose(batch.positions[0], frames[number].move(samples.body.rest), atol=1e-7)
        assert np.allclose(batch.tool[0, :3], centres[number], atol=1e-6)
        assert np.allclose(batch.tool[0, 10:], frames[number].force, atol=1e-5)
        count = int(batch.count[0, 1])
        cloud = camera_model_for(recorder.setup).place(sequence.cloud(number)).astype(np.float32)
        stored = {tuple(point) for point in batch.points[0, :count].numpy().round(6)}
        assert stored <= {tuple(point) for point in cloud.round(6)}
        assert batch.points[0, count:].isnan().all()


def test_points_of_the_top_come_first(bench):
    batch = bench.samples.batch(bench.samples.rows(["poke-top-01"])[:5])
    for row in range(5):
        upper, count = batch.count[row].tolist()
        assert 0 < upper < count <= 400
        heights = batch.points[row, :count, 2]
        assert heights[:upper].median() > heights[upper:].max() - 4e-3


def test_points_inside_the_block_are_never_seen(bench):
    seen, rest = bench.samples.seen, bench.samples.body.rest
    assert (seen[np.isclose(rest[:, 2], rest[:, 2].max())] > 0).all()
    inside = np.all(
        np.abs(rest - (rest.max(axis=0) + rest.min(axis=0)) / 2) < 0.45 * np.ptp(rest, axis=0),
        axis=1,
    )
    assert (seen[inside] == 0).all()
    assert seen.sum() == pytest.approx(
        np.mean(bench.samples.column("count", np.arange(len(bench.samples)))[:, 1]), rel=1e-6
    )


def test_pushes_are_numbered_and_frames_clear_of_the_block_have_zero(bench):
    samples = bench.samples
    rows = samples.rows(["poke-top-01"])
    probe, tool = samples.column("probe", rows), samples.column("tool", rows)
    assert probe.max() >= 2
    touched = np.linalg.norm(tool[:, 10:], axis=1) > 0
    assert (probe[touched] > 0).all()


def test_splits_are_those_of_the_dataset(bench):
    config = bench.dataset.config
    assert bench.samples.about["splits"] == {
        "train": list(config.train),
        "validation": list(config.validation),
        "test": list(config.test),
    }


def test_two_processes_make_the_same_samples_as_one(bench, tmp_path):
    names = bench.samples.sequences[:2]
    alone = make_samples(tmp_path / "alone", bench.recorder, sequences=names, every=8)
    shared = make_samples(tmp_path / "shared", bench.recorder, sequences=names, every=8, workers=2)
    assert alone.about == shared.about
    for name in ("positions", "points", "tool", "frame"):
        rows = np.arange(len(alone))
        assert np.array_equal(alone.column(name, rows), shared.column(name, rows), equal_nan=True)
    assert set(np.diff(alone.column("frame", alone.rows(names[:1])))) == {8}


def test_cancelled_samples_leave_nothing_behind(bench, tmp_path):
    def stop(fraction: float, text: str) -> None:
        if fraction > 0.2:
            raise Cancelled

    with pytest.raises(Cancelled):
        make_samples(
            tmp_path / "samples", bench.recorder, sequences=["poke-top-01"], every=4, report=stop
        )
    assert not list(tmp_path.iterdir())


def test_samples_made_by_another_process_meanwhile_are_kept(bench, tmp_path):
    folder = tmp_path / "samples"

    def other(done, text):
        folder.mkdir(exist_ok=True)
        (folder / "samples.json").touch()

    with pytest.raises(RunError, match="made by another"):
        make_samples(folder, bench.recorder, sequences=["poke-top-01"], every=10, report=other)
    assert [path.name for path in tmp_path.iterdir()] == ["samples"]


def test_samples_of_an_arbitrary_mesh_are_its_nodes(bench, tmp_path):
    setup = bench.recorder.setup
    body = Body.of_mesh(GridSpec(nodes=(5, 4, 3)).mesh(setup, np.zeros(3)))
    recorder = recorder_for(bench.dataset, grid=GridSpec(nodes=(5, 4, 3)), body=body, points=200)
    samples = make_samples(tmp_path / "samples", recorder, sequences=["poke-top-01"], every=10)
    assert samples.body.grid is None
    assert samples.batch(np.arange(2)).positions.shape == (2, 60, 3)
    with pytest.raises(CorrectionError, match="take kind graph"):
        body_for(samples, "unet2d")


def test_batches_are_read_in_the_requested_order(tmp_path):
    samples = write_samples(tmp_path / "samples", rows=5)
    rows = np.array([14, 0, 7])
    batch = samples.batch(rows)
    assert isinstance(samples.array("one", "points"), np.memmap)
    for place, (name, row) in enumerate([("three", 4), ("one", 0), ("two", 2)]):
        assert np.array_equal(batch.positions[place], samples.array(name, "positions")[row])
    assert [len(part) for part in samples.batches(np.arange(15), 6)] == [6, 6, 3]


def test_missing_and_incomplete_samples_are_named(tmp_path):
    with pytest.raises(RunError, match="no samples"):
        open_samples(tmp_path)
    samples = write_samples(tmp_path / "samples", rows=2)
    (tmp_path / "samples" / "two" / "tool.npy").write_bytes(b"")
    with pytest.raises(RunError, match=r"tool\.npy"):
        samples.batch(np.arange(4))


def test_existing_samples_are_not_overwritten(bench, tmp_path):
    with pytest.raises(RunError, match="exists already"):
        make_samples(tmp_path, bench.recorder)
    with pytest.raises(CorrectionError, match="every"):
        make_samples(tmp_path / "new", bench.recorder, every=0)


def test_opposite_quaternions_have_one_canonical_form():
    turned = Rotation.random(20, rng=np.random.default_rng(0)).as_quat()
    assert np.allclose(canonical_quaternions(turned), canonical_quaternions(-turned))
    assert np.allclose(
        Rotation.from_quat(canonical_quaternions(turned)).as_matrix(),
        Rotation.from_quat(turned).as_matrix(),
    )


def test_tool_columns_are_in_the_phantom_frame(tmp_path):
    time = np.arange(0.0, 1.0, 0.01)
    path = np.array([0.1, 0.0, 0.0]) * time[:, None]
    sequence = Sequence(
        tmp_path,
        "s",
        Kinematics(time, path, np.tile([0.0, 0, 0, 1], (len(time), 1))),
        np.empty(0),
        (),
        None,
    )
    quarter = Rotation.from_euler("z", 90, degrees=True)
    robot = Transform(quarter.as_matrix(), np.array([0.0, 0.0, 0.05]))
    tool = tool_columns(sequence, np.array([0.5]), robot, measured=False)[0]
    assert np.allclose(tool[:3], [0.0, 0.05, 0.05])
    assert np.allclose(Rotation.from_quat(tool[3:7]).as_matrix(), quarter.as_matrix())
    assert np.allclose(tool[7:10], [0.0, 0.1, 0.0], atol=1e-6)
    assert np.allclose(tool[10:], 0.0)
