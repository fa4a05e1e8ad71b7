"""The scene of manual registration in one browser: draws pairs, reports clicks and
drags as rays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from palpate.app.drawing import colours
from palpate.app.scene.registration_picture import Arrow, Mark, PairPicture, pair_colour
from palpate.app.scene.viewpoint import FIELD_OF_VIEW
from palpate.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["PairScene", "Ray", "ViserPairScene"]

POINT_SIZES = (0.0003, 0.0007)
"""Least and largest size of a point of the cloud [m]."""
GAPLESS = 0.6
"""Size of a point over the typical distance of neighbours, at which their relief shows [1]."""
SAMPLED = 500
"""Points by which that distance is measured."""
SHADES = (0.35, 1.25)
"""Brightness of the lowest and of the highest points [1]."""
BALL, CHOSEN = 0.0011, 0.0016
"""Radius of a mark, and of the selected one [m]."""
BLOCK, EDGE, LANDMARK, WEAK = (176, 184, 196), (96, 106, 120), (110, 120, 134), (205, 60, 60)


@dataclass(frozen=True, eq=False)
class Ray:
    """A ray of a click, in the frame of the scene.

    Attributes:
        origin: (3,) [m].
        direction: (3,).
        pixel: angle of a pixel [rad].
        mark: the mark that was dragged there, as (number, side).
    """

    origin: FloatArray
    direction: FloatArray
    pixel: float
    mark: tuple[int, str] | None = None


class PairScene(Protocol):
    """Draws pictures of pairs."""

    def draw(self, picture: PairPicture) -> None:
        """Show this and nothing else."""

    def look(self, picture: PairPicture) -> None:
        """Turn the camera to all of it."""

    def eye(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position of the camera [m], and its directions to the right and upwards, (3,) each."""


class ViserPairScene:
    """The scene of one browser."""

    def __init__(self, client: ClientHandle, clicked: Callable[[Ray], None]) -> None:
        self._client, self._clicked = client, clicked
        self._drawn: dict[str, tuple[str, Any]] = {}

        @client.scene.on_click()
        def _(event: Any) -> None:
            clicked(Ray(np.array(event.ray_origin), np.array(event.ray_direction), self._pixel()))

    def draw(self, picture: PairPicture) -> None:
        """Show this picture; unchanged nodes stay."""
        nodes = dict(self._nodes(picture))
        with self._client.atomic():
            for name in [
                name
                for name, (key, _) in self._drawn.items()
                if name not in nodes or nodes[name][0] != key
            ]:
                self._drawn.pop(name)[1].remove()
            for name, (key, make) in nodes.items():
                if name not in self._drawn:
                    self._drawn[name] = (key, make())

    def _nodes(self, picture: PairPicture) -> Iterator[tuple[str, tuple[str, Callable[[], Any]]]]:
        """Name, digest and maker of every node."""
        yield "/cloud", (_key(picture.cloud), partial(self._cloud, picture.cloud))
        yield "/block", (_key(picture.vertices), partial(self._block, picture))
        if len(picture.edges):
            yield "/edges", (_key(picture.edges), partial(self._edges, picture.edges))
        for label, place in zip(picture.names, picture.landmarks, strict=True):
            yield f"/landmarks/{label}", (_key(place), partial(self._landmark, label, place))
        for mark in picture.marks:
            name = f"/pairs/{mark.pair}/{mark.side}"
            yield name, (f"{_key(mark.place)} {mark.chosen}", partial(self._mark, name, mark))
        for start, end, number in picture.lines:
            points = np.array([[start, end]], dtype=np.float32)
            yield (
                f"/lines/{number}",
                (_key(points), partial(self._line, f"/lines/{number}", points, number)),
            )
        for number, arrow in enumerate(picture.arrows):
            key = _key(np.array([arrow.start, arrow.end])) + arrow.text
            yield f"/weak/{number}", (key, partial(self._arrow, f"/weak/{number}", arrow))

    def look(self, picture: PairPicture) -> None:
        """Turn the camera to cloud and phantom, from the front and above."""
        low, high = picture.bounds
        centre, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        direction = np.array([0.0, -np.cos(np.deg2rad(42)), np.sin(np.deg2rad(42))])
        camera = self._client.camera
        with self._client.atomic():
            camera.fov = FIELD_OF_VIEW
            camera.near = 0.001
            camera.up_direction = (0.0, 0.0, 1.0)
            camera.position = centre + direction * reach / np.sin(FIELD_OF_VIEW / 2) * 1.05 / min(
                1.0, camera.aspect
            )
            camera.look_at = centre

    def eye(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position of the camera, and its directions to the right and upwards."""
        camera = self._client.camera
        position, up = (
            np.array(camera.position, dtype=float),
            np.array(camera.up_direction, dtype=float),
        )
        forward = np.array(camera.look_at, dtype=float) - position
        right = np.cross(forward, up)
        right = right / max(float(np.linalg.norm(right)), 1e-12)
        above = np.cross(right, forward)
        return position, right, above / max(float(np.linalg.norm(above)), 1e-12)

    def _pixel(self) -> float:
        camera = self._client.camera
        return float(2 * np.tan(camera.fov / 2) / max(camera.image_height, 1))

    def _cloud(self, points: FloatArray) -> Any:
        return self._client.scene.add_point_cloud(
            "/cloud",
            points.astype(np.float32),
            by_height(points[:, 2]),
            point_size=size_of_points(points),
            point_shape="circle",
            precision="float32",
            point_shading="flat",
        )

    def _block(self, picture: PairPicture) -> Any:
        return self._client.scene.add_mesh_simple(
            "/block",
            picture.vertices.astype(np.float32),
            picture.faces.astype(np.uint32),
            color=BLOCK,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )

    def _edges(self, edges: FloatArray) -> Any:
        return self._client.scene.add_line_segments(
            "/edges", edges.astype(np.float32), EDGE, thickness=1.4, thickness_units="screen"
        )

    def _landmark(self, name: str, place: FloatArray) -> Any:
        scene, root = self._client.scene, f"/landmarks/{name}"
        node = scene.add_frame(root, show_axes=False, position=place)
        scene.add_icosphere(f"{root}/ball", 0.0007, LANDMARK, subdivisions=2, cast_shadow=False)
        scene.add_label(f"{root}/name", name, font_screen_scale=0.8, anchor="bottom-center")
        return node

    def _mark(self, name: str, mark: Mark) -> Any:
        scene = self._client.scene
        node = scene.add_frame(name, show_axes=False, position=mark.place)
        ball = scene.add_icosphere(
            f"{name}/ball",
            CHOSEN if mark.chosen else BALL,
            pair_colour(mark.pair),
            subdivisions=3,
            cast_shadow=False,
        )
        scene.add_label(
            f"{name}/number",
            str(mark.pair + 1),
            anchor="top-left" if mark.side == "cloud" else "top-right",
        )

        @ball.on_drag
        def _(event: Any) -> None:
            if event.phase != "start":
                place = np.array(event.end_position, dtype=float)
                if event.phase == "end":
                    origin = np.array(self._client.camera.position, dtype=float)
                    self._clicked(
                        Ray(origin, place - origin, self._pixel(), (mark.pair, mark.side))
                    )
                else:
                    node.position = place

        return node

    def _line(self, name: str, points: Any, number: int) -> Any:
        return self._client.scene.add_line_segments(
            name, points, pair_colour(number), thickness=1.6, thickness_units="screen"
        )

    def _arrow(self, name: str, arrow: Arrow) -> Any:
        scene = self._client.scene
        root = scene.add_frame(name, show_axes=False)
        middle = (arrow.start + arrow.end) / 2
        if arrow.turns:
            ring = _ring(middle, arrow.end - arrow.start)
            scene.add_line_segments(
                f"{name}/ring", ring, WEAK, thickness=2.5, thickness_units="screen"
            )
            axis = np.array([[arrow.start, arrow.end]], dtype=np.float32)
            scene.add_line_segments(
                f"{name}/axis", axis, WEAK, thickness=1.2, thickness_units="screen"
            )
        else:
            pair = np.array([[middle, arrow.end], [middle, arrow.start]], dtype=np.float32)
            scene.add_arrows(
                f"{name}/arrows",
                pair,
                WEAK,
                shaft_radius=0.0005,
                head_radius=0.0014,
                head_length=0.004,
            )
        scene.add_label(
            f"{name}/text",
            arrow.text,
            position=arrow.end,
            font_screen_scale=0.85,
            anchor="bottom-center",
        )
        return root


def by_height(heights: FloatArray) -> Any:
    """Colours (n, 3) of points by their heights (n,) [m], the lowest dark: on a smooth body nothing
    else shows in which place a point lies.
    """
    if not len(heights):
        return np.zeros((0, 3), dtype=np.uint8)
    low, high = (float(end) for end in np.percentile(heights, [2, 98]))
    share = np.clip((heights - low) / max(high - low, 1e-9), 0.0, 1.0)
    bright = np.asarray(SHADES[0] + share * (SHADES[1] - SHADES[0]))
    return np.clip(np.outer(bright, colours.MEASURED), 0, 255).astype(np.uint8)


def size_of_points(points: FloatArray) -> float:
    """Size [m] at which points (n, 3) [m] are drawn: the smaller, the denser they are."""
    sample = points[:: 1 + len(points) // SAMPLED]
    if len(points) < 2:
        return POINT_SIZES[1]
    apart = np.asarray(cKDTree(points).query(sample, k=2)[0])[:, 1]
    return float(np.clip(GAPLESS * np.median(apart), *POINT_SIZES))


def _key(array: Any) -> str:
    return str(hash(np.ascontiguousarray(array, dtype=np.float32).tobytes()))


def _ring(centre: FloatArray, axis: FloatArray) -> FloatArray:
    """(m, 2, 3) a circle around an axis."""
    along = axis / np.linalg.norm(axis)
    side = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    side = side / np.linalg.norm(side)
    other = np.cross(along, side)
    angles = np.linspace(0.0, 2 * np.pi, 49)
    radius = 0.45 * float(np.linalg.norm(axis))
    circle = centre + radius * (np.cos(angles)[:, None] * side + np.sin(angles)[:, None] * other)
    return np.stack([circle[:-1], circle[1:]], axis=1).astype(np.float32)
