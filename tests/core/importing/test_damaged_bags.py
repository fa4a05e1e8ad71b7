"""Of a recording that was cut off, what is whole is read, and that is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recorded_bags import BagKind, written_bag

from palpate.foundation.errors import DatasetError
from palpate.importing.sources.bag_source import BagSource

COUNT = 4000
START = 10**18


def long_bag(path: Path, kind: BagKind) -> Path:
    """A bag of poses along x; returns the file that holds them."""
    with written_bag(path, kind) as bag:
        for at in range(COUNT):
            stamp = START + at * 10**7
            pose = np.array([1e-4 * at, 0, 0, 0, 0, 0, 1])
            bag.pose("/PSM1/measured_cp", stamp, stamp, pose, "base")
    if kind in ("ros1", "bz2", "lz4"):
        return path
    (file,) = (one for one in path.iterdir() if one.suffix in (".db3", ".mcap"))
    return file


@pytest.mark.parametrize("kind", ["ros1", "lz4", "bz2", "mcap", "sqlite3"])
def test_whole_parts_of_a_bag_that_was_cut_off_are_read(tmp_path: Path, kind: BagKind) -> None:
    whole = long_bag(tmp_path / "whole.bag", kind)
    data = whole.read_bytes()
    share = 0.995 if kind in ("bz2", "lz4", "mcap") else 0.7
    cut = tmp_path / f"cut{whole.suffix}"
    cut.write_bytes(data[: int(share * len(data))])
    source = BagSource(cut)
    samples = list(source.samples({"/PSM1/measured_cp"}))
    (stream,) = source.streams()
    source.close()
    assert "cut off or damaged" in source.warnings[0]
    assert 0 < stream.count == len(samples) <= COUNT
    assert [one.stamped for one in samples] == [START + at * 10**7 for at in range(len(samples))]
    np.testing.assert_allclose(samples[-1].value()[0], 1e-4 * (len(samples) - 1))


def test_a_damaged_chunk_ends_the_reading_with_a_warning(tmp_path: Path) -> None:
    path = long_bag(tmp_path / "one.bag", "lz4")
    with written_bag(tmp_path / "two.bag", "ros1") as bag:
        for at in range(5):
            points = np.zeros((60_000, 3)) + at
            bag.cloud("/points", START + at * 10**8, START + at * 10**8, points, "camera")
    path = tmp_path / "two.bag"
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    at = data.find(b"op=", middle)
    data[at : at + 200] = b"\xff" * 200
    path.write_bytes(bytes(data))
    source = BagSource(path)
    samples = list(source.samples({"/points"}))
    source.close()
    assert 0 < len(samples) < 5
    assert any("damaged" in one for one in source.warnings)


@pytest.mark.parametrize("suffix", [".bag", ".mcap", ".db3"])
@pytest.mark.parametrize("content", [b"", b"nothing of this kind" * 100])
def test_a_file_that_is_no_recording_is_refused(
    tmp_path: Path, suffix: str, content: bytes
) -> None:
    path = tmp_path / f"one{suffix}"
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=f"one{suffix}"):
        BagSource(path)


def test_a_folder_without_its_metadata_is_read_file_by_file(tmp_path: Path) -> None:
    long_bag(tmp_path / "bag", "mcap")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    source = BagSource(tmp_path / "bag")
    assert sum(1 for _ in source.samples({"/PSM1/measured_cp"})) == COUNT
    source.close()
    assert "has no metadata.yaml" in source.warnings[0]


def test_a_folder_with_damaged_metadata_is_read_file_by_file(tmp_path: Path) -> None:
    long_bag(tmp_path / "bag", "sqlite3")
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information: {")
    source = BagSource(tmp_path / "bag")
    assert sum(1 for _ in source.samples({"/PSM1/measured_cp"})) == COUNT
    source.close()
    assert "metadata.yaml is damaged" in source.warnings[0]
