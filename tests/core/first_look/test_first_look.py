"""Looks at recordings and datasets before any job."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_recording import BenchRecording, bench_setup
from recorded_bags import written_bag
from small_dataset import write_valid_dataset

from palpate.first_look.first_look import take_look
from palpate.first_look.look_files import LookFiles
from palpate.first_look.look_request import LookRequest
from palpate.foundation.errors import DatasetError

START = 1_700_000_000.0


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    bench_setup(folder)
    BenchRecording(rate=50.0).write(folder / "bench.bag")
    return folder


@pytest.fixture(scope="module")
def stated(bench: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The look at the bench's recording with its setup."""
    folder = tmp_path_factory.mktemp("looks") / "stated"
    request = LookRequest(
        files=(bench / "bench.bag",), setup=bench / "dataset.toml", base=bench, name="bench"
    )
    return folder, take_look(request, folder)


def test_a_look_has_streams_with_roles_pushes_touches_and_the_rest(
    stated: tuple[Path, dict[str, Any]],
) -> None:
    _, look = stated
    (one,) = look["recordings"]
    assert {row["name"]: row["role"] for row in one["streams"]} == {
        "/PSM1/measured_cp": "pose",
        "/ati": "wrench",
        "/camera/points": "cloud",
    }
    assert [row["samples"] for row in one["streams"]] == [2765, 2765, 277]
    assert [window["name"] for window in one["sequences"]] == [
        *("poke-top-01", "poke-top-02", "poke-side-01", "drag-01")
    ]
    assert [window["split"] for window in one["sequences"]] == [
        *("train", "test", "train", "train")
    ]
    assert [touch["landmark"] for touch in one["touches"]] == [f"corner_{n}" for n in range(4)]
    assert all(0.7 < touch["end"] - touch["start"] < 1.5 for touch in one["touches"])
    assert one["rest"] == pytest.approx([START, START + 3.6])
    assert look["setup_stated"] and look["error"] is None and look["length_unit"] == "m"
    assert 'files = ["bench.bag"]' in look["mapping"]


def test_the_tool_is_in_the_phantom_frame_with_its_depth(
    stated: tuple[Path, dict[str, Any]],
) -> None:
    folder, look = stated
    tool = look["recordings"][0]["tool"]
    assert tool["frame"] == "phantom" and len(tool["t"]) <= 2000
    assert max(tool["depth"]) == pytest.approx(0.006, abs=2e-4)
    assert min(tool["depth"]) < -0.02
    path = LookFiles(folder).path(0)
    assert path is not None
    stamps, phantom, _, _ = BenchRecording(rate=50.0).motion()
    for row in (100, 1000, 2000):
        np.testing.assert_allclose(path.at(stamps[row] / 1e9), phantom[row], atol=1e-5)


def test_clouds_of_the_deepest_pushes_are_among_those_that_are_kept(
    stated: tuple[Path, dict[str, Any]],
) -> None:
    folder, look = stated
    clouds = look["recordings"][0]["clouds"]
    assert len(clouds["t"]) == 277 and 150 < len(clouds["shown"]) <= 200
    tool = look["recordings"][0]["tool"]
    deepest = tool["t"][int(np.argmax(tool["depth"]))]
    nearest = int(np.abs(np.array(clouds["t"]) - deepest).argmin())
    shown = np.array(clouds["shown"])
    assert np.abs(shown - nearest).min() <= 1
    for number in clouds["shown"][::40]:
        cloud = LookFiles(folder).cloud(0, number)
        assert cloud.points.shape == (len(cloud.reason), 3)
        assert np.isfinite(cloud.points).all() and len(cloud.points) > 400


def test_a_recording_without_a_setup_is_neither_cut_nor_cleaned(
    bench: Path, tmp_path: Path
) -> None:
    look = take_look(LookRequest(files=(bench / "bench.bag",)), tmp_path / "look")
    (one,) = look["recordings"]
    assert not look["setup_stated"] and not look["cleaned"] and look["frame"] == "camera"
    assert [window["name"] for window in one["sequences"]] == ["bench"]
    assert one["tool"]["depth"] is None and one["tool"]["frame"] == "robot"
    assert one["touches"] == [] and LookFiles(tmp_path / "look").surface() is None


def test_a_recording_without_poses_shows_its_clouds_and_says_what_is_missing(
    tmp_path: Path,
) -> None:
    bench = BenchRecording()
    with written_bag(tmp_path / "clouds.bag", "ros1") as bag:
        for number in range(6):
            stamp = 10**9 * (100 + number)
            bag.cloud("/camera/points", stamp, stamp + 10**6, bench.image(number), "camera")
    look = take_look(LookRequest(files=(tmp_path / "clouds.bag",)), tmp_path / "look")
    (one,) = look["recordings"]
    assert "no stream is known as the pose" in look["error"]["message"]
    assert look["error"]["where"] == {"key": "streams.pose"}
    assert one["clouds"]["shown"] == [0, 1, 2, 3, 4, 5] and one["tool"]["t"] == []
    assert (one["start"], one["end"]) == (100.0, 105.0)
    assert one["sequences"] == [] and one["force"] is None


def test_gaps_and_stamps_that_repeat_are_told_with_their_time(tmp_path: Path) -> None:
    pose = np.array([0.1, 0.2, 0.3, 0, 0, 0, 1.0])
    stamps = [100.0 + 0.02 * n for n in range(100)] + [104.0 + 0.02 * n for n in range(100)]
    with written_bag(tmp_path / "gappy.bag", "ros1") as bag:
        for number, stamp in enumerate(stamps):
            seen = stamps[number - 1] if number in (50, 51) else stamp
            seen = stamps[49] if number == 51 else seen
            place = pose + np.array([1e-5 * np.sin(number), *np.zeros(6)])
            bag.pose("/tool", round(seen * 1e9), round(stamp * 1e9), place, "base")
    look = take_look(LookRequest(files=(tmp_path / "gappy.bag",)), tmp_path / "look")
    (row,) = look["recordings"][0]["streams"]
    assert row["gaps"] == [pytest.approx([101.98, 104.0])]
    (fault,) = row["faults"]
    assert fault["t"] == pytest.approx(100.98) and "2 stamps are" in fault["text"]


def test_a_dataset_is_shown_by_its_sequences_with_the_reason_of_each_point(tmp_path: Path) -> None:
    dataset = write_valid_dataset(tmp_path / "block")
    look = take_look(LookRequest(files=(dataset,), name="block"), tmp_path / "look")
    assert look["source"]["kind"] == "dataset" and look["mapping"] is None
    assert look["frame"] == "phantom" and look["cleaned"]
    reasons = [row["name"] for row in look["reasons"]]
    by_name = {one["name"]: one for one in look["recordings"]}
    assert list(by_name) == ["drag-01", "poke-01"]
    poke = by_name["poke-01"]
    assert [one["split"] for one in poke["sequences"]] == ["train"]
    assert poke["force"] is not None and poke["force"]["frame"] == "robot"
    assert poke["clouds"]["shown"] == [0, 1, 2, 3, 4]
    counts = dict(zip(reasons, poke["clouds"]["counts"][0], strict=True))
    cloud = LookFiles(tmp_path / "look").cloud(1, 0)
    stored = np.bincount(cloud.reason, minlength=len(reasons))
    assert stored.tolist() == poke["clouds"]["counts"][0]
    assert counts["table"] > 50 and sum(counts.values()) == 192
    table = cloud.points[cloud.reason == reasons.index("table")]
    assert np.abs(table[:, 2]).max() < 1e-3


def test_times_of_a_dataset_are_seconds_however_rare_its_clouds(tmp_path: Path) -> None:
    dataset = write_valid_dataset(tmp_path / "block")
    table = dataset / "sequences" / "poke-01" / "kinematics.csv"
    head, *rows = table.read_text().splitlines()
    slow = [f"{100 + 10 * (float(row[:9]) - 100):.5f}{row[row.index(',') :]}" for row in rows]
    table.write_text("\n".join([head, *slow]) + "\n")
    clouds = [f"{100 + 2.1 * n:.3f},clouds/{n:06d}.ply" for n in range(5)]
    table.with_name("clouds.csv").write_text("\n".join(["t,file", *clouds]) + "\n")
    look = take_look(LookRequest(files=(dataset,)), tmp_path / "look")
    poke = look["recordings"][1]
    assert poke["clouds"]["t"] == pytest.approx([100.0, 102.1, 104.2, 106.3, 108.4])
    assert not any("taken as" in one for one in look["warnings"])


def test_roles_may_be_chosen_and_an_empty_name_takes_none(bench: Path, tmp_path: Path) -> None:
    request = LookRequest(files=(bench / "bench.bag",), streams={"wrench": ""})
    (one,) = take_look(request, tmp_path / "look")["recordings"]
    assert one["force"] is None
    assert {row["name"]: row["role"] for row in one["streams"]}["/ati"] is None


def test_a_file_of_the_mapping_that_was_not_brought_is_named(bench: Path, tmp_path: Path) -> None:
    (tmp_path / "import.toml").write_text(
        'format = 1\nname = "x"\n[[recordings]]\nname = "a"\nfiles = ["/etc/passwd"]\n'
    )
    request = LookRequest(files=(bench / "bench.bag",), mapping=tmp_path / "import.toml")
    with pytest.raises(DatasetError, match="passwd, which is not among the files"):
        take_look(request, tmp_path / "look")


def test_the_mapping_of_a_look_gives_the_same_look_again(
    stated: tuple[Path, dict[str, Any]], bench: Path, tmp_path: Path
) -> None:
    _, first = stated
    (tmp_path / "import.toml").write_text(first["mapping"])
    request = LookRequest(
        files=(bench / "bench.bag",), mapping=tmp_path / "import.toml", base=bench
    )
    second = take_look(request, tmp_path / "look")
    assert second["recordings"] == first["recordings"]
    assert second["mapping"] == first["mapping"]
