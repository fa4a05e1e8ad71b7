"""Summaries and warnings of `palpate check`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from shape_run import liver
from shapes import write_felt_shape
from small_dataset import ply_bytes, small_cloud, write_valid_dataset

from palpate.dataset import open_dataset
from palpate.dataset.check import DatasetSummary, check_dataset
from palpate.dataset.check.coverage_figure import coverage_picture
from palpate.foundation.errors import DatasetError
from palpate.foundation.frames import Transform

POKE = "sequences/poke-01"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_valid_dataset(tmp_path / "block")


def registration(folder: Path) -> Transform:
    """Closed form from the touches, whose error is zero here."""
    dataset = open_dataset(folder)
    landmarks = np.array([dataset.config.landmarks[name] for name in dataset.touches.names])
    touches = dataset.touches.positions
    rotation, _ = Rotation.align_vectors(landmarks - landmarks.mean(0), touches - touches.mean(0))
    return Transform(rotation.as_matrix(), landmarks.mean(0) - rotation.apply(touches.mean(0)))


def check(folder: Path) -> DatasetSummary:
    return check_dataset(open_dataset(folder), registration(folder))


def test_rates_counts_and_motions_of_a_whole_dataset(folder: Path) -> None:
    summary = check(folder)
    drag, poke = summary.sequences
    assert (poke.name, poke.split, drag.split) == ("poke-01", "train", "test")
    assert poke.points == (192, 192, 192)
    assert summary.rest_points == 192
    np.testing.assert_allclose(
        [poke.kinematics.rate, poke.clouds.rate, poke.duration], [200, 5, 0.995], rtol=1e-6
    )
    assert poke.kinematics.jitter < 1e-5
    assert poke.kinematics.dropouts == poke.clouds.dropouts == poke.clouds_outside == 0
    assert poke.motion is not None
    assert drag.motion is not None
    assert [contact.kind for contact in poke.motion.contacts] == ["top"]
    np.testing.assert_allclose(poke.motion.nearest, -0.003, atol=2e-4)
    assert summary.warnings == ()


def test_the_summary_is_plain_json(folder: Path) -> None:
    plain = json.loads(json.dumps(check(folder).as_dict(), allow_nan=False))
    assert plain["sequences"][1]["motion"]["contacts"][0]["kind"] == "top"


def test_without_a_registration_no_motion_is_guessed(folder: Path) -> None:
    summary = check_dataset(open_dataset(folder))
    assert all(sequence.motion is None for sequence in summary.sequences)
    assert all("poke" not in lack.sentence for lack in summary.lacks)


def test_missing_kinds_of_motion_are_listed_with_their_effects(folder: Path) -> None:
    found = {lack.sentence.partition(":")[0]: lack.effects for lack in check(folder).lacks}
    assert found["no push from the side"] == ("base_slip", "base_detachment")
    assert "no drag along the surface" in found
    assert any("untouched clouds before" in sentence for sentence in found)
    assert any("longest rest" in sentence for sentence in found)
    assert all("young_modulus" not in effects for effects in found.values())


def test_without_forces_the_modulus_is_listed_as_missing(folder: Path) -> None:
    (folder / POKE / "forces.csv").unlink()
    assert [lack.effects for lack in check(folder).lacks if "forces" in lack.sentence] == [
        ("young_modulus",)
    ]


def test_lost_clouds_and_a_pause_of_the_robot_are_counted(folder: Path) -> None:
    for file, rows in (("clouds.csv", slice(3, 4)), ("kinematics.csv", slice(60, 90))):
        path = folder / POKE / file
        lines = path.read_text().splitlines()
        del lines[rows]
        path.write_text("\n".join(lines) + "\n")
    summary = check(folder)
    poke = summary.sequences[1]
    assert (poke.clouds.dropouts, poke.kinematics.dropouts) == (1, 1)
    np.testing.assert_allclose(
        [poke.clouds.longest, poke.kinematics.longest], [0.4, 0.155], atol=1e-6
    )
    text = "\n".join(summary.warnings)
    assert "poke-01: the clouds pause once, at most 0.40 s" in text
    assert "poke-01: the kinematics pause once, at most 0.15 s" in text or "at most 0.16 s" in text
    assert "1 clouds lie in clouds folders without a row" in text


def test_clouds_stamped_beyond_the_motion_are_counted(folder: Path) -> None:
    path = folder / POKE / "clouds.csv"
    path.write_text(path.read_text().replace("100.90000", "101.90000"))
    summary = check(folder)
    assert summary.sequences[1].clouds_outside == 1
    assert any(
        "1 of 5 clouds are stamped outside the kinematics" in text for text in summary.warnings
    )


def test_a_blocked_view_is_noticed(folder: Path) -> None:
    (folder / POKE / "clouds/000002.ply").write_bytes(ply_bytes(small_cloud()[:40]))
    assert any(
        "the smallest cloud has 40 points, the median one 192" in text
        for text in check(folder).warnings
    )


def test_declared_filters_and_the_edge_they_cost_are_told(folder: Path) -> None:
    path = folder / "dataset.toml"
    stated = path.read_text()
    path.write_text(
        stated.replace("depth_sigma", 'filters = ["spatial", "temporal"]\ndepth_sigma', 1)
    )
    text = "\n".join(check(folder).warnings)
    assert "camera.filters names temporal: what moves is seen late" in text
    assert "points within 3.0 mm of the phantom's edges are left out" in text
    assert open_dataset(folder).config.edge == 3e-3
    path.write_text(stated.replace("depth_sigma", "edge = 0.004\ndepth_sigma", 1))
    assert "points within 4.0 mm" in "\n".join(check(folder).warnings)


def test_sequences_outside_the_splits_and_an_empty_test_give_warnings(folder: Path) -> None:
    path = folder / "dataset.toml"
    path.write_text(path.read_text().replace('test = ["drag-01"]', "test = []"))
    text = "\n".join(check(folder).warnings)
    assert "no sequence is kept for the test" in text
    assert "drag-01: is in no split" in text


def test_a_tool_that_never_touches_gives_a_warning_with_its_distance(folder: Path) -> None:
    raised = Transform(translation=np.array([0, 0, 0.02])) @ registration(folder)
    summary = check_dataset(open_dataset(folder), raised)
    assert any(
        "poke-01: the tool never touches the phantom, it stays 17." in text
        for text in summary.warnings
    )


@pytest.mark.parametrize(("unit", "per_metre"), [("decimetres", 10.0), ("centimetres", 100.0)])
def test_kinematics_in_another_unit_are_named_where_the_tool_touches_in_it_alone(
    folder: Path, unit: str, per_metre: float
) -> None:
    here = registration(folder)
    beside = Transform(here.rotation, np.array([0.06, 0.05, 0.07]))
    for path in sorted(folder.glob("sequences/*/kinematics.csv")):
        header, *rows = path.read_text().splitlines()
        table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
        table[:, 1:4] = per_metre * beside.inverse().apply(here.apply(table[:, 1:4]))
        lines = [",".join(f"{value:.9g}" for value in row) for row in table]
        path.write_text("\n".join([header, *lines]) + "\n")
    summary = check_dataset(open_dataset(folder), beside)
    told = [text for text in summary.warnings if text.startswith("poke-01: the tool never touches")]
    assert told and f"did you write {unit} in kinematics.csv?" in told[0]


def test_a_tool_that_hardly_moves_gives_a_warning_with_its_path(folder: Path) -> None:
    path = folder / POKE / "kinematics.csv"
    header, *rows = path.read_text().splitlines()
    path.write_text(
        "\n".join(
            [header, *(f"{row.partition(',')[0]},{rows[0].partition(',')[2]}" for row in rows)]
        )
        + "\n"
    )
    assert any(
        "poke-01: the tool moves by 0.000 mm only" in text for text in check(folder).warnings
    )


def test_a_broken_cloud_is_found_by_the_check(folder: Path) -> None:
    points = small_cloud()
    points[5] = np.nan
    (folder / POKE / "clouds/000004.ply").write_bytes(ply_bytes(points))
    with pytest.raises(DatasetError, match="row 6"):
        check(folder)


def test_the_coverage_picture_is_a_picture_and_the_only_new_file(
    folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    coverage_picture(open_dataset(folder), registration(folder), out / "coverage.png")
    assert [path.name for path in out.iterdir()] == ["coverage.png"]
    data = (out / "coverage.png").read_bytes()
    assert data.startswith(b"\x89PNG")
    width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
    assert 1000 < width < 3000
    assert 700 < height < 3000


def test_a_picture_of_paths_that_never_touch_can_be_drawn(folder: Path, tmp_path: Path) -> None:
    shutil.rmtree(folder / "sequences/drag-01")
    path = folder / "dataset.toml"
    path.write_text(path.read_text().replace('"drag-01"', ""))
    raised = Transform(translation=np.array([0, 0, 0.02])) @ registration(folder)
    coverage_picture(open_dataset(folder), raised, tmp_path / "coverage.png")
    assert (tmp_path / "coverage.png").stat().st_size > 10_000


def test_the_coverage_picture_of_a_shape_has_its_outline(tmp_path: Path) -> None:
    folder = tmp_path / "liver"
    folder.mkdir()
    write_felt_shape(folder, liver().vertices, liver().triangles)
    coverage_picture(open_dataset(folder), Transform(), tmp_path / "coverage.png")
    picture = np.array(Image.open(tmp_path / "coverage.png").convert("RGB")).astype(int)
    above = picture[: picture.shape[0] // 2, : picture.shape[1] // 2]
    body = np.abs(above - [0xEE, 0xF0, 0xF2]).max(axis=2) < 3
    # Smoothed edges of letters have some pixels of this colour.
    rows, columns = (np.flatnonzero(body.sum(axis=axis) > 20) for axis in (1, 0))
    filled = body[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    x, y, _ = liver().size
    assert np.ptp(columns) / np.ptp(rows) == pytest.approx(x / y, rel=0.03)
    assert 0.5 < filled.mean() < 0.9
