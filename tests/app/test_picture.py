from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_dataset import SIZE, small_cloud

from app.colours import BANDS, EXTENDED, RAW, SIGNED, band_of
from app.picture import MOST_TRIANGLES, Layer, Picture, Reel
from app.runs import Run

ALL: frozenset[Layer] = frozenset({"measured", "raw", "extended", "tool"})


@pytest.fixture
def reel(place: object, tmp_path: Path, run_name: str) -> Reel:
    return Reel(Run(tmp_path / "runs" / run_name).replay("poke-01"), lambda index: small_cloud() + 1e-6 * index)


def show(reel: Reel, **changes: object) -> Picture:
    wish: dict[str, object] = {"frame": 2, "layers": ALL, "colouring": "plain", "limit": None, "crop": False}
    return reel.picture(**{**wish, **changes})  # type: ignore[arg-type]


def test_plain_picture_has_the_extended_model_as_surface_and_the_raw_one_as_lines(reel: Reel) -> None:
    picture = show(reel)
    assert list(picture.meshes) == ["extended"]
    assert picture.meshes["extended"].colour == EXTENDED
    assert picture.wire is not None
    assert picture.wire[1] == RAW
    assert picture.limit is None


def test_coloured_picture_shares_all_triangles_among_the_bands(reel: Reel) -> None:
    picture = show(reel, colouring="raw", limit=2e-4)
    total = sum(len(mesh.faces) for mesh in picture.meshes.values())
    assert total == 8**2 * len(reel.replay["faces"])
    assert total <= MOST_TRIANGLES
    assert "band-unseen" in picture.meshes
    assert picture.limit == 2e-4
    for name, mesh in picture.meshes.items():
        assert mesh.faces.max() < len(mesh.vertices)
        if name != "band-unseen":
            assert mesh.colour == SIGNED[int(name.removeprefix("band-"))]


def test_colour_of_a_place_is_the_band_of_its_error(reel: Reel) -> None:
    picture = show(reel, colouring="raw", limit=5e-4, layers=frozenset({"raw"}))
    raw, errors = reel.replay["raw"][2], reel.replay["error_raw"][2]
    top = np.flatnonzero((reel.replay["rest"][:, 2] > SIZE[2] - 1e-9) & np.isfinite(errors))
    for name, mesh in picture.meshes.items():
        if name == "band-unseen":
            continue
        band = int(name.removeprefix("band-"))
        gaps = np.linalg.norm(mesh.vertices[:, None] - raw[None, top], axis=-1)
        at = top[np.unique(np.nonzero(gaps < 1e-7)[1])]
        assert np.all(np.abs(band_of(errors[at].astype(float), 5e-4) - band) <= 2)
    assert len(picture.meshes) > BANDS // 2


def test_hidden_layers_are_not_in_the_picture(reel: Reel) -> None:
    picture = show(reel, layers=frozenset())
    assert (picture.cloud, picture.points, picture.meshes, picture.wire, picture.tool) == (None, 0, {}, None, None)


def test_choosing_the_error_of_a_hidden_model_shows_the_other_one_plain(reel: Reel) -> None:
    picture = show(reel, colouring="raw", layers=frozenset({"extended"}))
    assert list(picture.meshes) == ["extended"]
    assert picture.limit is None


def test_cloud_is_moved_into_the_phantom_frame_and_cut_to_the_block(reel: Reel) -> None:
    whole, near = show(reel), show(reel, crop=True)
    assert whole.cloud is not None
    expected = reel.replay.camera("extended").apply(small_cloud() + 2e-6)
    np.testing.assert_allclose(whole.cloud[: whole.points], expected, atol=1e-7)
    assert whole.points == 192
    assert near.points < whole.points


def test_cloud_has_one_length_for_the_whole_sequence(reel: Reel) -> None:
    lengths = {len(picture.cloud) for frame in range(5) if (picture := show(reel, frame=frame)).cloud is not None}
    assert lengths == {1000}


def test_tool_has_the_radius_that_the_surface_model_believes(reel: Reel) -> None:
    assert [show(reel, colouring=colour).tool.radius for colour in ("raw", "extended")] == [0.005, 0.004]  # type: ignore[union-attr]


def test_checksum_tells_frames_and_layers_apart(reel: Reel) -> None:
    pictures = [show(reel), show(reel, frame=3), show(reel, layers=frozenset({"raw"})), show(reel, colouring="raw")]
    assert len({picture.checksum() for picture in pictures}) == 4
    assert show(reel).checksum() == show(reel).checksum()


def test_automatic_scale_is_one_for_the_whole_sequence(reel: Reel) -> None:
    limits = {show(reel, frame=frame, colouring=colour).limit for frame in range(5) for colour in ("raw", "extended")}
    assert limits == {reel.limit}
