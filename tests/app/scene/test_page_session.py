from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from palpate.app.drawing.view import View
from palpate.app.http_errors import Missing
from palpate.app.scene.page_session import Sessions
from palpate.app.scene.picture import Picture
from palpate.app.scene.viewpoint import Viewpoint, viewpoint_for
from palpate.app.storage.run_store import RunStore


class RecordingScene:
    """Draws nothing and records all calls."""

    def __init__(self) -> None:
        self.pictures: list[Picture] = []
        self.looked_from: list[Viewpoint] = []

    def draw(self, picture: Picture) -> None:
        self.pictures.append(picture)

    def look(self, viewpoint: Viewpoint) -> None:
        self.looked_from.append(viewpoint)

    def still(self, width: int, height: int) -> np.ndarray[Any, Any] | None:
        return np.zeros((height, width, 4), dtype=np.uint8)


@pytest.fixture
def sessions(place: Any) -> Sessions:
    return Sessions(RunStore(place.runs))


def view(run: str, **changes: Any) -> View:
    return View(run=run, sequence="poke-01", **changes)


def test_every_scene_of_a_page_gets_the_picture(sessions: Sessions, run_name: str) -> None:
    scenes = [RecordingScene(), RecordingScene()]
    for scene in scenes:
        sessions.join("page-one", scene)
    state = sessions.open("page-one").show(view(run_name, frame=1))
    assert [scene.pictures[-1].checksum() for scene in scenes] == [state["drawn"]["checksum"]] * 2
    assert state["scenes"] == 2


def test_a_scene_that_joins_late_sees_what_the_page_shows(
    sessions: Sessions, run_name: str
) -> None:
    sessions.open("page-one").show(view(run_name, frame=3))
    scene = RecordingScene()
    sessions.join("page-one", scene)
    assert scene.pictures[0].frame == 3
    assert len(scene.looked_from) == 1


def test_camera_is_turned_to_the_phantom_once_per_run_and_on_request(
    sessions: Sessions, run_name: str
) -> None:
    scene = RecordingScene()
    sessions.join("page-one", scene)
    session = sessions.open("page-one")
    for frame in range(3):
        session.show(view(run_name, frame=frame))
    assert len(scene.looked_from) == 1
    session.look()
    assert len(scene.looked_from) == 2


def test_a_place_of_ones_own_is_looked_from_in_scenes_that_open_later(
    sessions: Sessions, run_name: str
) -> None:
    session = sessions.open("page-one")
    own = Viewpoint(
        np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, 0.02]), np.array([0.0, 0.0, 1.0])
    )
    session.look_from(run_name, own)
    session.show(view(run_name))
    scene = RecordingScene()
    sessions.join("page-one", scene)
    assert scene.looked_from == [own]
    session.look("top")
    assert scene.looked_from[-1].position[2] > 0.1
    session.show(view(run_name, side_by_side=True))
    assert scene.looked_from[-1] is not own


@pytest.mark.parametrize(
    ("where", "axis", "sign"), [("top", 2, 1), ("front", 1, -1), ("side", 0, 1)]
)
def test_standard_views_look_along_an_axis(where: Any, axis: int, sign: int) -> None:
    found = viewpoint_for(
        np.array([-0.01, -0.02, 0.0]),
        np.array([0.06, 0.02, 0.036]),
        np.array([0.2, -0.1, 0.2]),
        ((0.0, 0.0, 0.0),),
        where,
    )
    assert found.target == pytest.approx([0.025, 0.0, 0.018], abs=1e-3)
    away = found.position - found.target
    assert sign * away[axis] > 0.99 * np.linalg.norm(away)


def test_a_scene_that_left_gets_nothing_more(sessions: Sessions, run_name: str) -> None:
    scene = RecordingScene()
    sessions.join("page-one", scene)
    sessions.leave("page-one", scene)
    sessions.open("page-one").show(view(run_name))
    assert scene.pictures == []


def test_frame_beyond_the_end_shows_the_last_one(sessions: Sessions, run_name: str) -> None:
    state = sessions.open("page-one").show(view(run_name, frame=99))
    assert state["view"]["frame"] == 4


def test_measured_cloud_comes_from_the_dataset_of_the_run(
    sessions: Sessions, run_name: str
) -> None:
    assert sessions.open("page-one").show(view(run_name, crop=False))["drawn"]["points"] == 192


def test_run_without_its_dataset_is_shown_without_the_cloud(
    sessions: Sessions, place: Any, run_name: str
) -> None:
    place.datasets.joinpath("small").rename(place.datasets / "elsewhere")
    state = sessions.open("page-one").show(view(run_name))
    assert state["drawn"]["points"] == 0
    assert state["drawn"]["triangles"]


def test_what_a_training_adds_to_a_run_is_shown_without_a_new_start(
    sessions: Sessions, place: Any, run_name: str
) -> None:
    wish = view(run_name, layers=("raw", "corrected"), colour="corrected")
    assert "raw" in sessions.open("page-one").show(wish)["drawn"]["figures"]
    arrays = RunStore(place.runs).get(run_name).replay("poke-01").arrays
    made = {
        f"{key}corrected": arrays[f"{key}extended"]
        for key in ("", "error_", "distance_", "paper_", "tool_", "tool_radius_")
    }
    folder = place.runs / "corrections" / run_name
    folder.mkdir(parents=True)
    np.savez(
        folder / "poke-01.npz",
        **made,
        camera_corrected=arrays["camera_extended"],
        cloud_index=arrays["cloud_index"],
    )
    figures = sessions.open("page-one").show(wish)["drawn"]["figures"]
    assert "raw-lines" in figures and any(name.startswith("corrected-error-") for name in figures)


def test_unknown_sequence_is_named_with_those_there_are(sessions: Sessions, run_name: str) -> None:
    with pytest.raises(Missing, match="no sequence poke-99; it has drag-01, poke-01"):
        sessions.open("page-one").show(View(run=run_name, sequence="poke-99"))


def test_only_a_few_dozen_pages_are_remembered(sessions: Sessions) -> None:
    for number in range(40):
        sessions.open(f"page-{number}")
    with pytest.raises(Missing):
        sessions.get("page-0")
    assert sessions.get("page-39").view is None
