"""Recordings of public projects, where they are at hand: PALPATE_RECORDINGS, or shared/recordings
beside the checkout.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from palpate.foundation.errors import DatasetError
from palpate.importing.import_notes import ImportNotes
from palpate.importing.sources.bag_source import BagSource
from palpate.importing.sources.opened_sources import open_source
from palpate.importing.stream import Source
from palpate.importing.survey import survey

HOME = Path(
    os.environ.get("PALPATE_RECORDINGS", Path(__file__).parents[4] / "shared" / "recordings")
)
pytestmark = pytest.mark.skipif(
    not (HOME / "ros1").is_dir(), reason=f"no recordings in {HOME}; set PALPATE_RECORDINGS"
)


Opener = Callable[[Path], Source]


@pytest.fixture
def opened() -> Iterator[Opener]:
    """Opens sources, and closes them after the test."""
    sources: list[Source] = []

    def opener(path: Path) -> Source:
        sources.append(open_source(path))
        return sources[-1]

    yield opener
    for source in sources:
        source.close()


@pytest.mark.parametrize("coding", ["bz2", "lz4"])
def test_compressed_chunks_are_read_and_nested_transforms_listed(
    opened: Opener, coding: str
) -> None:
    source = opened(HOME / "ros1" / f"example-{coding}.bag")
    streams = {one.name: one for one in source.streams()}
    turtle = streams["/tf#turtle1"]
    assert (turtle.kind, turtle.count, turtle.frames) == ("pose", 1344, ("world",))
    samples = list(source.samples({turtle.name}))
    assert len(samples) == 1344
    np.testing.assert_allclose(samples[0].value()[:3], [5.544445, 5.544445, 0], atol=1e-6)


def test_a_bag_without_the_pose_of_a_tool_is_refused_with_its_topics() -> None:
    found = survey([HOME / "ros1" / "example-bz2.bag"], None)
    with pytest.raises(DatasetError, match=r"pose of a tool; there are .*/turtle1/cmd_vel"):
        found.proposal("name", ImportNotes())
    found.close()


def test_chunks_out_of_order_are_read_in_the_order_of_time() -> None:
    source = BagSource(HOME / "ros1" / "example-unsorted-chunks.bag")
    received = [stamp for _, stamp, _ in source.messages({"foo"})]
    source.close()
    assert received == sorted(received)
    assert len(received) == 3


def test_an_empty_bag_is_one_clear_sentence() -> None:
    with pytest.raises(DatasetError, match=r"no-messages\.bag holds no messages"):
        open_source(HOME / "ros1" / "no-messages.bag")


def test_clouds_are_read_and_three_clocks_in_one_bag_are_told(opened: Opener) -> None:
    source = opened(HOME / "ros1" / "embark_test.bag")
    streams = {one.name: one for one in source.streams()}
    delays = [round(one.delay) for one in streams.values() if one.delay is not None]
    assert len(set(delays)) == 2 and all(abs(delay) > 1e6 for delay in delays)
    clouds = [one.value() for one in source.samples({"/luminar_pointcloud"})]
    assert [one.shape[1] for one in clouds] == [3] * 5
    seen = clouds[0][np.isfinite(clouds[0]).all(axis=1)]
    assert len(seen) > 30_000
    assert np.ptp(seen, axis=0).max() < 1000


def test_arrays_in_messages_are_listed(opened: Opener) -> None:
    source = opened(HOME / "ros1" / "embark_array_test.bag")
    assert [(one.name, one.count) for one in source.streams()] == [("/array_test", 20)]


@pytest.mark.parametrize(
    ("path", "total"),
    [
        ("mcap-split", 6074),
        ("mcap-split/wbag_0.mcap", 1246),
        ("mcap-cdr", 7),
        ("mcap-cdr/cdr_test_0.mcap", 7),
        ("sqlite3-talker", 20),
        ("sqlite3-talker/talker.db3", 20),
    ],
)
def test_folders_and_bare_files_of_ros_2_are_read(opened: Opener, path: str, total: int) -> None:
    source = opened(HOME / "ros2" / path)
    assert sum(one.count for one in source.streams()) == total


def test_an_unknown_serialisation_is_refused_by_name() -> None:
    with pytest.raises(DatasetError, match="wrong_format"):
        open_source(HOME / "ros2" / "sqlite3-unknown-format")
