"""Scenes in which pictures are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from palpate.app.drawing import colours
from palpate.app.drawing.figures import (
    CloudFigure,
    Figure,
    LabelFigure,
    LinesFigure,
    SurfaceFigure,
    ToolFigure,
)
from palpate.app.scene.picture import Picture
from palpate.app.scene.viewpoint import FIELD_OF_VIEW, Viewpoint
from palpate.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["PageScene", "ViserScene"]

POINT_SIZE = 0.00026
"""Size of a point of the cloud [m]."""
SHAFT = 0.022
"""Length of the drawn part of the tool's shaft [m]."""
PLACES = {
    CloudFigure: "/{}",
    SurfaceFigure: "/mesh/{}",
    LinesFigure: "/lines/{}",
    ToolFigure: "/{}",
    LabelFigure: "/names/{}",
}


class PageScene(Protocol):
    """Draws pictures and turns the camera."""

    def draw(self, picture: Picture) -> None:
        """Show this picture and nothing else."""

    def look(self, viewpoint: Viewpoint) -> None:
        """Turn the camera."""

    def still(self, width: int, height: int) -> np.ndarray[Any, Any] | None:
        """The current image (height, width, 4) with a transparent background; None where no browser
        answers.
        """


class ViserScene:
    """The scene of one browser; nodes are made once and then get new arrays."""

    def __init__(self, client: ClientHandle) -> None:
        self._client = client
        self._nodes: dict[str, Any] = {}
        self._made: dict[str, tuple[Any, ...]] = {}

    def draw(self, picture: Picture) -> None:
        """Show this picture; all changes reach the browser together."""
        shown = {
            PLACES[type(figure)].format(name): figure for name, figure in picture.figures.items()
        }
        with self._client.atomic():
            for name, figure in shown.items():
                self._put(name, figure)
            for name, node in self._nodes.items():
                node.visible = name in shown

    def look(self, viewpoint: Viewpoint) -> None:
        """Turn the camera."""
        camera = self._client.camera
        with self._client.atomic():
            camera.fov = FIELD_OF_VIEW
            camera.near = 0.001
            camera.up_direction = viewpoint.up
            camera.position = viewpoint.position
            camera.look_at = viewpoint.target

    def still(self, width: int, height: int) -> np.ndarray[Any, Any] | None:
        """Image rendered by the browser; None where it does not answer in time."""
        try:
            return np.asarray(
                self._client.get_render(height, width, transport_format="png", timeout=20.0)
            )
        except TimeoutError:
            return None

    def _put(self, name: str, figure: Figure) -> None:
        """Update a node, or make it; a different kind or size of arrays needs a new one."""
        made = _node_key(figure)
        if self._made.get(name) != made:
            self._nodes[name] = self._make(name, figure)
            self._made[name] = made
        node = self._nodes[name]
        if isinstance(figure, ToolFigure):
            node.position = figure.centre + figure.at
            if figure.axis is not None:
                node.wxyz = _turn_to(figure.axis)
            return
        node.position = figure.place + figure.at if isinstance(figure, LabelFigure) else figure.at
        if isinstance(figure, CloudFigure):
            node.points = figure.points
            if isinstance(figure.colour, np.ndarray):
                node.colors = figure.colour
        elif isinstance(figure, SurfaceFigure):
            node.vertices, node.faces = figure.vertices, figure.faces.astype(np.uint32)
        elif isinstance(figure, LinesFigure):
            node.points = figure.segments
            if isinstance(figure.colour, np.ndarray):
                node.colors = figure.colour

    def _make(self, name: str, figure: Figure) -> Any:
        scene = self._client.scene
        if isinstance(figure, CloudFigure):
            return scene.add_point_cloud(
                name,
                figure.points,
                figure.colour,
                point_size=figure.size or POINT_SIZE,
                point_shape="circle",
                precision="float32",
                point_shading="flat",
            )
        if isinstance(figure, SurfaceFigure):
            return scene.add_mesh_simple(
                name,
                figure.vertices,
                figure.faces.astype(np.uint32),
                color=figure.colour,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
                opacity=None if figure.opacity >= 1 else figure.opacity,
            )
        if isinstance(figure, LinesFigure):
            return scene.add_line_segments(
                name,
                figure.segments,
                figure.colour,
                thickness=figure.width,
                thickness_units="screen",
            )
        if isinstance(figure, LabelFigure):
            return scene.add_label(name, figure.text, anchor="bottom-center", font_screen_scale=0.9)
        return self._make_tool(name, figure)

    def _make_tool(self, name: str, tool: ToolFigure) -> Any:
        scene, opacity = self._client.scene, None if tool.opacity >= 1 else tool.opacity
        root = scene.add_frame(name, show_axes=False)
        scene.add_icosphere(
            f"{name}/ball",
            tool.radius,
            colours.TOOL,
            subdivisions=4,
            cast_shadow=False,
            opacity=opacity,
        )
        scene.add_cylinder(
            f"{name}/shaft",
            0.36 * tool.radius,
            SHAFT,
            colours.TOOL,
            radial_segments=24,
            cast_shadow=False,
            opacity=opacity,
            position=(0.0, 0.0, SHAFT / 2),
        )
        return root


def _turn_to(axis: FloatArray) -> FloatArray:
    """Quaternion w, x, y, z of the shortest turn from z to a unit vector (3,)."""
    half = np.array([1.0 + axis[2], -axis[1], axis[0], 0.0])
    length = float(np.linalg.norm(half))
    return half / length if length > 1e-6 else np.array([0.0, 1.0, 0.0, 0.0])


def _node_key(figure: Figure) -> tuple[Any, ...]:
    """Properties that cannot be changed in an existing node."""
    if isinstance(figure, CloudFigure):
        colour = figure.colour if isinstance(figure.colour, tuple) else None
        return (CloudFigure, figure.points.shape, colour, figure.size)
    if isinstance(figure, SurfaceFigure):
        return (SurfaceFigure, figure.colour, figure.opacity)
    if isinstance(figure, LinesFigure):
        return (
            LinesFigure,
            figure.segments.shape,
            figure.width,
            figure.colour if isinstance(figure.colour, tuple) else None,
        )
    if isinstance(figure, LabelFigure):
        return (LabelFigure, figure.text)
    return (ToolFigure, figure.radius, figure.opacity, figure.axis is None)
