"""Looks in the scenes of a page: clouds by the reason of each point, tool, path, surface."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_recording import BenchRecording
from scipy.spatial.transform import Rotation
from small_dataset import SIZE, write_valid_dataset

from palpate.app.drawing import colours
from palpate.app.drawing.figures import CloudFigure, LinesFigure, SurfaceFigure, ToolFigure
from palpate.app.http_errors import Missing
from palpate.app.scene.looks.look_scenes import LookScenes
from palpate.app.scene.looks.look_view import LookView
from palpate.app.scene.picture import Picture
from palpate.app.scene.viewer_scene import _turn_to
from palpate.app.scene.viewpoint import Viewpoint
from palpate.app.storage.look_store import LookStore
from palpate.first_look.first_look import take_look
from palpate.first_look.look_request import LookRequest

PAGE = "page-0001"


class DrawnScene:
    """Keeps the pictures and viewpoints that it is given."""

    def __init__(self) -> None:
        self.pictures: list[Picture] = []
        self.looked_from: list[Viewpoint] = []

    def draw(self, picture: Picture) -> None:
        self.pictures.append(picture)

    def look(self, viewpoint: Viewpoint) -> None:
        self.looked_from.append(viewpoint)

    def still(self, width: int, height: int) -> np.ndarray[Any, Any] | None:
        return None


def stored(runs: Path, name: str, files: tuple[Path, ...]) -> dict[str, Any]:
    folder = runs / "looks" / name
    look = take_look(LookRequest(files=files, name=name), folder)
    (folder / "source.json").write_text(json.dumps(look["source"]))
    return look


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> LookScenes:
    """Scenes of looks at a dataset, and at a recording of which nothing is stated."""
    folder = tmp_path_factory.mktemp("looks")
    stored(folder / "runs", "block", (write_valid_dataset(folder / "block"),))
    BenchRecording(rate=20.0).write(folder / "bench.bag")
    stored(folder / "runs", "bench", (folder / "bench.bag",))
    return LookScenes(LookStore(folder / "runs"))


def test_each_point_has_the_colour_of_its_reason_and_reasons_can_be_hidden(
    scenes: LookScenes,
) -> None:
    scene = DrawnScene()
    scenes.join(PAGE, scene)
    view = LookView(look="block", recording="poke-01", time=100.52)
    said = scenes.open(PAGE).show(view)
    assert said["cloud"] == 2 and said["cloud_time"] == pytest.approx(100.5)
    assert said["frame"] == "phantom" and said["cannot"] == {} and said["scenes"] == 1
    assert sum(said["counts"].values()) == said["points"] == 192
    cloud = scene.pictures[-1].of(CloudFigure)["cloud"]
    reasons = scenes.drawing("block").look["reasons"]
    for row in reasons:
        shade = [int(row["colour"][at : at + 2], 16) for at in (1, 3, 5)]
        count = int((cloud.colour == shade).all(axis=1).sum())
        assert count == said["counts"][row["name"]], row["name"]
    scenes.open(PAGE).show(view.model_copy(update={"hidden": ("table",)}))
    fewer = scene.pictures[-1].of(CloudFigure)["cloud"]
    assert len(fewer.points) == 192 - said["counts"]["table"]
    scenes.leave(PAGE, scene)


def test_tool_path_and_surface_stand_where_the_recording_puts_them(scenes: LookScenes) -> None:
    scene = DrawnScene()
    scenes.join(PAGE, scene)
    scenes.open(PAGE).show(
        LookView(look="block", recording="poke-01", time=100.5, layers=("tool", "path", "surface"))
    )
    picture = scene.pictures[-1]
    tool = picture.of(ToolFigure)["tool"]
    np.testing.assert_allclose(tool.centre, [0.0, 0.002, SIZE[2] + 0.002], atol=2e-4)
    assert tool.radius == 0.005
    surface = picture.of(SurfaceFigure)["surface"]
    np.testing.assert_allclose(np.ptp(surface.vertices, axis=0), SIZE, atol=1e-6)
    assert surface.opacity < 0.5 and not picture.of(CloudFigure)
    path = picture.of(LinesFigure)["path"]
    passed = (path.colour == colours.TOOL).all(axis=(1, 2))
    assert 0.45 < passed.mean() < 0.55 and passed[0] and not passed[-1]
    scenes.leave(PAGE, scene)


def test_the_camera_turns_once_for_each_look_and_on_request(scenes: LookScenes) -> None:
    scene, page = DrawnScene(), "page-0002"
    with pytest.raises(Missing, match="no look yet"):
        scenes.open(page).look("top")
    scenes.join(page, scene)
    for time in (100.1, 100.5):
        scenes.open(page).show(LookView(look="block", recording="poke-01", time=time))
    assert len(scene.looked_from) == 1
    scenes.open(page).look("top")
    middle = np.array([0.0, 0.0, SIZE[2] / 2])
    np.testing.assert_allclose(scene.looked_from[-1].target, middle, atol=0.003)
    late = DrawnScene()
    scenes.join(page, late)
    assert len(late.pictures) == len(late.looked_from) == 1


def test_what_cannot_be_drawn_of_a_recording_without_a_setup_is_said(scenes: LookScenes) -> None:
    scene, page = DrawnScene(), "page-0003"
    scenes.join(page, scene)
    said = scenes.open(page).show(LookView(look="bench", time=1_700_000_010.0))
    assert said["frame"] == "camera" and said["counts"] == {}
    assert set(said["cannot"]) == {"cleaned", "tool", "path", "surface"}
    assert "not cleaned" in said["cannot"]["cleaned"]
    cloud = scene.pictures[-1].of(CloudFigure)["cloud"]
    assert cloud.colour == colours.MEASURED and len(cloud.points) > 400
    assert set(scene.pictures[-1].figures) == {"cloud"}
    # The camera looks along its z; upright, that is y, and the lowest points lie on z = 0.
    assert np.ptp(cloud.points[:, 1]) < 0.02 < np.ptp(cloud.points[:, 2])
    said = scenes.open(page).show(LookView(look="bench", layers=("tool", "path", "surface")))
    assert said["frame"] == "robot" and set(scene.pictures[-1].figures) == {"tool", "path"}
    assert said["cannot"] == {"surface": "No phantom is stated."} and len(scene.looked_from) == 2
    lines = scene.pictures[-1].of(LinesFigure)["path"]
    assert lines.segments[..., 2].min() == pytest.approx(0, abs=1e-6)
    with pytest.raises(Missing, match="no recording none"):
        scenes.open(page).show(LookView(look="bench", recording="none"))
    with pytest.raises(Missing, match="no look gone"):
        scenes.open(page).show(LookView(look="gone"))


def test_the_shaft_is_turned_as_the_clouds_show_it() -> None:
    for axis in ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -0.6, 0.8], [0.0, 0.0, -1.0]):
        w, *xyz = _turn_to(np.array(axis))
        np.testing.assert_allclose(Rotation.from_quat([*xyz, w]).apply([0, 0, 1]), axis, atol=1e-9)
