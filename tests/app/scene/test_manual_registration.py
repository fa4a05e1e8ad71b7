"""Which points a click means, and what is drawn of pairs, without a browser."""

from __future__ import annotations

from typing import Any

import httpx
import numpy as np
import pytest
from small_dataset import SIZE
from websockets.sync.client import connect

from palpate.app.scene.manual_registration import ManualRegistration
from palpate.app.scene.phantom import Phantom
from palpate.app.scene.registration_picture import PairPicture
from palpate.app.scene.registration_scene import Ray
from palpate.app.schemas import RegistrationView
from palpate.foundation.frames import Transform
from palpate.registration.pose import small_motion
from palpate.setup.box import Box

POSE = Transform.from_vector([0.01, -0.2, 0.3], [-2.3, 0.15, 0.1])
"""phantom_from_camera"""
X, Y, Z = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
DOWN = np.array([0.0, 0.0, -1.0])


class Noted:
    """A scene that remembers, seen from straight above."""

    def __init__(self) -> None:
        self.pictures: list[PairPicture] = []
        self.looks = 0

    def draw(self, picture: PairPicture) -> None:
        self.pictures.append(picture)

    def look(self, picture: PairPicture) -> None:
        self.looks += 1

    def eye(self) -> Any:
        return np.array([0.0, 0.0, 0.4]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def phantom() -> Phantom:
    x, y = np.meshgrid(np.linspace(-X, X, 70), np.linspace(-Y, Y, 40))
    top = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, Z)])
    return Phantom(POSE.inverse().apply(top), Box(size=SIZE), {"corner": (X, Y, Z)}, None)


@pytest.fixture
def clicking() -> ManualRegistration:
    found = ManualRegistration(lambda name: phantom())
    found.scene = Noted()  # type: ignore[attr-defined]
    found.join(found.scene)  # type: ignore[attr-defined]
    return found


def above(point: Any, mark: tuple[int, str] | None = None) -> Ray:
    return Ray(np.array(point) + np.array([0, 0, 0.3]), DOWN, 1e-3, mark)


def test_before_any_fit_the_cloud_lies_beside_the_phantom_whatever_its_pose(
    clicking: ManualRegistration,
) -> None:
    for start in ("levelled", "camera", "stated"):
        said = clicking.show(RegistrationView(dataset="a", start=start))
        cloud = clicking.scene.pictures[-1].cloud  # type: ignore[attr-defined]
        assert np.percentile(cloud[:, 0], 3) > X + 0.02 and said["points"] == 2800
    assert clicking.scene.looks == 3  # type: ignore[attr-defined]


def test_a_click_is_the_cloud_point_in_the_camera_frame_wherever_the_cloud_is_shown(
    clicking: ManualRegistration,
) -> None:
    moved = small_motion(np.array([0.02, 0, 0, 0, 0, 0.4]), np.zeros(3)) @ POSE
    clicking.show(RegistrationView(dataset="a", pose=moved.matrix.tolist(), over=True))
    aimed = phantom().cloud[1234]
    picked = clicking.pick(above(moved.apply(aimed)))["picked"]
    assert (
        np.allclose(picked["point"], aimed, atol=1e-9)
        and picked["side"] == "cloud"
        and picked["pair"] is None
    )
    assert "nothing of the cloud" in clicking.pick(above([0.3, 0, 0]))["problem"]


def test_a_click_on_the_phantom_meets_its_surface_and_near_a_landmark_the_landmark(
    clicking: ManualRegistration,
) -> None:
    clicking.show(RegistrationView(dataset="a", mode="mesh"))
    assert np.allclose(
        clicking.pick(above([0.01, 0.005, 0.0]))["picked"]["point"], [0.01, 0.005, Z]
    )
    near = clicking.pick(above([X + 0.0005, Y - 0.001, Z]))["picked"]
    assert near["landmark"] == "corner" and near["point"] == [X, Y, Z]
    far = clicking.pick(above([X - 0.008, Y - 0.008, Z]))["picked"]
    assert far["landmark"] is None


def test_a_click_on_an_end_chooses_it_and_a_dragged_end_keeps_its_side(
    clicking: ManualRegistration,
) -> None:
    pairs = [{"cloud": None, "mesh": [0.01, 0.0, Z]}]
    clicking.show(
        RegistrationView.model_validate(
            {"dataset": "a", "mode": "mesh", "pairs": pairs, "chosen": [0, "mesh"]}
        )
    )
    assert clicking.pick(above([0.0105, 0.0, Z])) == {"chosen": {"pair": 0, "side": "mesh"}}
    clicking.show(
        RegistrationView.model_validate({"dataset": "a", "mode": "cloud", "pairs": pairs})
    )
    dragged = clicking.pick(above([0.02, 0.0, Z], mark=(0, "mesh")))["picked"]
    assert (
        dragged["side"] == "mesh"
        and dragged["pair"] == 0
        and np.allclose(dragged["point"], [0.02, 0.0, Z])
    )


def test_arrow_keys_move_a_point_on_its_surface_as_the_person_sees_it(
    clicking: ManualRegistration,
) -> None:
    clicking.show(RegistrationView(dataset="a", pose=POSE.matrix.tolist(), over=True))
    assert np.allclose(
        clicking.nudge("mesh", [0.01, 0.0, Z], 2e-4, -1e-4), [0.0102, -1e-4, Z], atol=1e-6
    )
    start = phantom().cloud[1234]
    moved = POSE.apply(np.array(clicking.nudge("cloud", start.tolist(), 2e-4, 0.0)))
    assert np.allclose(moved - POSE.apply(start), [2e-4, 0, 0], atol=1e-6)
    assert clicking.nudge("mesh", [X, 0.0, Z], 0.01, 0.0) == [X, 0.0, Z]


def test_pairs_lines_and_weak_directions_are_drawn(clicking: ManualRegistration) -> None:
    cloud = phantom().cloud
    asked = {
        "dataset": "a",
        "over": True,
        "pose": POSE.matrix.tolist(),
        "chosen": [1, "cloud"],
        "pairs": [{"cloud": cloud[0].tolist(), "mesh": [X, Y, Z]}, {"cloud": cloud[9].tolist()}],
        "weak": [
            {"translation": [1, 0, 0], "rotation": [0, 0, 0.1], "text": "x"},
            {"translation": [0, 0, 0], "rotation": [0, 0, 1], "text": "r"},
        ],
    }
    said = clicking.show(RegistrationView.model_validate(asked))
    picture = clicking.scene.pictures[-1]  # type: ignore[attr-defined]
    assert (said["marks"], said["arrows"]) == (3, 2)
    assert [mark.chosen for mark in picture.marks] == [False, False, True]
    assert np.allclose(picture.marks[0].place, POSE.apply(cloud[0]))
    assert len(picture.lines) == 1 and [arrow.turns for arrow in picture.arrows] == [False, True]


def test_over_rest_a_ray_gives_the_point_and_clicks_reach_the_page(
    client: httpx.Client, shared_place: Any
) -> None:
    url = "/api/sessions/registering-page/registering"
    assert client.post(f"{url}/look").status_code == 404
    said = client.post(url, json={"dataset": "small", "mode": "mesh", "start": "camera"}).json()
    assert said["points"] == 192 and len(said["landmarks"]) == 4 and said["stated"] is False
    aim = {"origin": [0.005, 0.0, 0.3], "direction": [0.0, 0.0, -1.0]}
    assert np.allclose(
        client.post(f"{url}/pick", json=aim).json()["picked"]["point"], [0.005, 0.0, Z]
    )
    assert client.post(f"{url}/nudge", json={"side": "mesh", "point": [0, 0, Z]}).status_code == 404
    assert client.post(url, json={"dataset": "nothing"}).status_code == 404
    with connect(f"ws://{client.base_url.host}:{client.base_url.port}{url}/clicks") as socket:
        socket.send("hello")
        socket.close()
