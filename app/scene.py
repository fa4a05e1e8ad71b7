"""Where pictures are drawn: `Scene` is the vocabulary, ViserScene draws in one browser, NullScene keeps them for tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from app import colours
from app.picture import Ball, Mesh, Picture, PointArray
from core.frames import FloatArray

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["NullScene", "Scene", "ViserScene"]

POINT_SIZE = 0.00026
FIELD_OF_VIEW = 0.6
SHAFT = 0.022
NOWHERE = np.zeros((3, 3), dtype=np.float32)
NOTHING = np.zeros((0, 3), dtype=np.uint32)


class Scene(Protocol):
    """Draws pictures and looks at the phantom."""

    def draw(self, picture: Picture) -> None:
        """Show this picture and nothing else."""

    def frame(self, size: FloatArray, eye: FloatArray) -> None:
        """Look at a phantom of edge lengths (3,) [m] from the side where the depth camera stands, (3,) [m]."""


class NullScene:
    """Draws nothing and remembers all."""

    def __init__(self) -> None:
        self.pictures: list[Picture] = []
        self.looked_at: list[FloatArray] = []

    def draw(self, picture: Picture) -> None:
        """Keep the picture."""
        self.pictures.append(picture)

    def frame(self, size: FloatArray, eye: FloatArray) -> None:
        """Keep the size."""
        self.looked_at.append(size)


class ViserScene:
    """The scene of one browser; nodes are made once and then only given new arrays."""

    def __init__(self, client: ClientHandle) -> None:
        self._client = client
        self._nodes: dict[str, Any] = {}
        self._ball: tuple[float, Any] | None = None

    def draw(self, picture: Picture) -> None:
        """Show this picture: all changes reach the browser at once."""
        with self._client.atomic():
            self._cloud(picture.cloud)
            shown = {f"/mesh/{name}": mesh for name, mesh in picture.meshes.items()}
            for name, mesh in shown.items():
                self._mesh(name, mesh)
            for name, node in self._nodes.items():
                if name.startswith("/mesh/"):
                    node.visible = name in shown
            self._wire(picture.wire)
            self._tool(picture.tool)

    def frame(self, size: FloatArray, eye: FloatArray) -> None:
        """Turn the camera to the phantom, from the depth camera's side, raised to a comfortable height."""
        reach = float(np.linalg.norm(size)) / 2
        around = np.arctan2(eye[1], eye[0])
        up = np.deg2rad(36.0)
        direction = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
        centre = np.array([0.0, 0.0, 0.52 * size[2]])
        camera = self._client.camera
        with self._client.atomic():
            camera.fov = FIELD_OF_VIEW
            camera.near = 0.001
            camera.up_direction = (0.0, 0.0, 1.0)
            camera.position = centre + direction * reach / np.sin(FIELD_OF_VIEW / 2) * 1.2
            camera.look_at = centre

    def _cloud(self, points: PointArray | None) -> None:
        node = self._nodes.get("/cloud")
        if points is None:
            if node is not None:
                node.visible = False
            return
        if node is None or node.points.shape != points.shape:
            self._nodes["/cloud"] = self._client.scene.add_point_cloud(
                "/cloud",
                points,
                colours.MEASURED,
                point_size=POINT_SIZE,
                point_shape="circle",
                precision="float32",
                point_shading="flat",
            )
            return
        node.points = points
        node.visible = True

    def _mesh(self, name: str, mesh: Mesh) -> None:
        vertices, faces = mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32)
        node = self._nodes.get(name)
        if node is None:
            self._nodes[name] = self._client.scene.add_mesh_simple(
                name, vertices, faces, color=mesh.colour, side="double", cast_shadow=False, receive_shadow=False
            )
            return
        node.vertices, node.faces = vertices, faces

    def _wire(self, wire: tuple[FloatArray, tuple[int, int, int]] | None) -> None:
        for name, node in self._nodes.items():
            if name.startswith("/wire/"):
                node.visible = False
        if wire is None:
            return
        points, colour = wire
        name = f"/wire/{colour[0]}"
        node = self._nodes.get(name)
        if node is None or node.points.shape != points.shape:
            self._nodes[name] = self._client.scene.add_line_segments(
                name, points.astype(np.float32), colour, thickness=1.2, thickness_units="screen"
            )
            return
        node.points, node.visible = points.astype(np.float32), True

    def _tool(self, tool: Ball | None) -> None:
        if tool is None:
            if self._ball is not None:
                self._ball[1].visible = False
            return
        if self._ball is None or self._ball[0] != tool.radius:
            self._ball = (tool.radius, self._make_tool(tool.radius))
        self._ball[1].position = tool.centre
        self._ball[1].visible = True

    def _make_tool(self, radius: float) -> Any:
        scene = self._client.scene
        root = scene.add_frame("/tool", show_axes=False)
        scene.add_icosphere("/tool/ball", radius, colours.TOOL, subdivisions=4, cast_shadow=False)
        scene.add_cylinder(
            "/tool/shaft", 0.36 * radius, SHAFT, colours.TOOL, radial_segments=24, cast_shadow=False, position=(0.0, 0.0, SHAFT / 2)
        )
        return root
