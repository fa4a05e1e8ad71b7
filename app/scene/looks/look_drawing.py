"""Figures of one look: its clouds, tool, path and stated surface at a time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from palpate.app.drawing import colours
from palpate.app.drawing.figures import CloudFigure, Figure, SurfaceFigure, ToolFigure, float32
from palpate.app.http_errors import Missing
from palpate.app.scene.annotations import path_lines
from palpate.app.scene.looks.look_view import LookLayer, LookView
from palpate.app.scene.picture import Picture
from palpate.app.scene.registration_scene import size_of_points
from palpate.first_look.look_files import LookFiles, LookPath, LookSurface, ShownCloud
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.levelling import as_seen

__all__ = ["DrawnLook", "LookDrawing"]

SURFACE_OPACITY = 0.3
"""Opacity of the stated surface, through which the cloud is seen."""
UNKNOWN_RADIUS = 0.003
"""Radius at which a tool is drawn whose own is not stated [m]."""
MOST_SEGMENTS = 4000
"""Segments of the drawn path."""


@dataclass(frozen=True, eq=False)
class DrawnLook:
    """A picture of a look.

    Attributes:
        picture: its figures, z upwards.
        cloud: number of the drawn cloud among the stored ones; None without.
        cloud_time: of it [s].
        counts: points of it by reason, before it was thinned.
        cannot: for each requested layer that is not drawn the reason.
    """

    picture: Picture
    cloud: int | None
    cloud_time: float | None
    counts: dict[str, int]
    cannot: dict[str, str]


@dataclass(frozen=True, eq=False)
class LookDrawing:
    """One finished look, whose small files are read once.

    Attributes:
        files: of the look.
        look: content of look.json.
    """

    files: LookFiles
    look: dict[str, Any]
    _paths: dict[int, LookPath | None] = field(default_factory=dict)

    @cached_property
    def upright(self) -> Transform:
        """From the frame of the arrays to that of the scene, in which z is upwards."""
        if self.look["frame"] == "phantom":
            return Transform()
        if (cloud := self._any_cloud()) is not None and self.look["frame"] == "camera":
            return as_seen(cloud)
        path = next((one for n in range(self._count) if (one := self._path(n))), None)
        if path is None or not len(path.places):
            return Transform()
        low, high = path.places.min(axis=0), path.places.max(axis=0)
        return Transform(np.eye(3), -np.array([*(low + high)[:2] / 2, low[2]]))

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) [m] of what the camera is turned to, frame of the scene:
        the stated surface, else most of a cloud, else the tool's path.
        """
        points = np.zeros((1, 3))
        if self.look["frame"] == "phantom" and self.surface is not None:
            points = self.surface.vertices
        elif (cloud := self._any_cloud()) is not None:
            points = self.upright.apply(cloud)
        elif (path := self._path(0)) is not None:
            points = self.upright.apply(path.places)
        low, high = np.percentile(points, [3, 97], axis=0)
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.01)
        return middle - half, middle + half

    @cached_property
    def eye(self) -> FloatArray:
        """Place (3,) [m] of the depth camera, frame of the scene."""
        if self.look["eye"] is not None and self.look["frame"] == "phantom":
            return np.array(self.look["eye"], dtype=float)
        return np.array([0.0, -1.0, 0.0]) + self.upright.translation

    @cached_property
    def surface(self) -> LookSurface | None:
        """The stated surface, phantom frame; None without."""
        return self.files.surface()

    @cached_property
    def point_size(self) -> float:
        """Size of a drawn point [m]: by the distance of neighbours, and of the scene."""
        cloud = self._any_cloud()
        if cloud is None:
            return 0.0
        reach = float(np.linalg.norm(self.bounds[1] - self.bounds[0]))
        return float(max(size_of_points(cloud), 0.0025 * reach))

    def drawn(self, view: LookView) -> DrawnLook:
        """The picture of a view; Missing for a recording that the look does not have."""
        at = self._number(view.recording)
        recording = self.look["recordings"][at]
        cannot: dict[str, str] = {}
        figures: dict[str, Figure] = {}
        number, time, counts, points = None, None, dict[str, int](), 0
        if {"raw", "cleaned"} & set(view.layers):
            number = self._nearest(recording, view.time)
        if number is not None:
            key = recording["clouds"]["shown"][number]
            cloud, time = self.files.cloud(at, key), float(recording["clouds"]["t"][key])
            figures["cloud"], points = self._cloud(cloud, view), len(cloud.points)
            if recording["clouds"]["counts"]:
                names = [row["name"] for row in self.look["reasons"]]
                counts = dict(zip(names, recording["clouds"]["counts"][number], strict=True))
        figures |= self._tool(at, recording, view)
        if "surface" in view.layers and self.surface is not None and not self._off("surface"):
            shape = self.surface
            figures["surface"] = SurfaceFigure(
                float32(shape.vertices), shape.faces.astype(np.int64), colours.RAW, SURFACE_OPACITY
            )
        for layer in view.layers:
            if why := self._cannot(layer, at, number):
                cannot[layer] = why
        shown = Picture(number or 0, figures, points, None, None, ((0.0, 0.0, 0.0),))
        return DrawnLook(shown, number, time, counts, cannot)

    def _cloud(self, cloud: ShownCloud, view: LookView) -> CloudFigure:
        places = float32(self.upright.apply(cloud.points))
        if "cleaned" not in view.layers or not self.look["cleaned"]:
            return CloudFigure(places, colours.MEASURED, self.point_size)
        names = [row["name"] for row in self.look["reasons"]]
        shades = np.array([_rgb(row["colour"]) for row in self.look["reasons"]], dtype=np.uint8)
        kept = np.array([name not in view.hidden for name in names])[cloud.reason]
        return CloudFigure(places[kept], shades[cloud.reason[kept]], self.point_size)

    def _tool(self, at: int, recording: dict[str, Any], view: LookView) -> dict[str, Figure]:
        """The tool at the time of the view, and its path."""
        path = self._path(at)
        if path is None or self._off(recording["tool"]["frame"]):
            return {}
        figures: dict[str, Figure] = {}
        if "tool" in view.layers:
            radius = self.look["tool_radius"] or UNKNOWN_RADIUS
            figures["tool"] = ToolFigure(self.upright.apply(path.at(view.time)), radius)
        if "path" in view.layers:
            every = 1 + (len(path.time) - 1) // MOST_SEGMENTS
            reached = int(np.searchsorted(path.time[::every], view.time))
            figures |= path_lines(self.upright.apply(path.places[::every]), reached)
        return figures

    def _cannot(self, layer: LookLayer, at: int, number: int | None) -> str:
        """The reason why a layer is not drawn; empty where it is."""
        recording, frame = self.look["recordings"][at], self.look["frame"]
        if layer in ("raw", "cleaned"):
            if number is None:
                return "There are no clouds in this recording."
            raw = layer == "cleaned" and not self.look["cleaned"]
            return (
                "The clouds could not be related to the phantom, so they are not cleaned."
                if raw
                else ""
            )
        if layer == "surface":
            if self.surface is None:
                return "No phantom is stated."
            return (
                "" if frame == "phantom" else "Nothing relates the phantom to what is drawn here."
            )
        if self._path(at) is None:
            return "There are no poses of the tool in this recording."
        off = self._off(recording["tool"]["frame"])
        return "Nothing relates the robot to the camera." if off else ""

    def _off(self, frame: str) -> bool:
        """Whether things of a frame, or the surface, cannot be drawn in that of the scene."""
        own: str = self.look["frame"]
        return {"surface": "phantom"}.get(frame, frame) != own

    def _number(self, name: str | None) -> int:
        names = [one["name"] for one in self.look["recordings"]]
        if name is None and names:
            return 0
        if name not in names:
            raise Missing(
                f"this look has no recording {name}; it has {', '.join(names[:20])}", recording=name
            )
        return names.index(name)

    @staticmethod
    def _nearest(recording: dict[str, Any], time: float) -> int | None:
        """Number, among the stored ones, of the cloud next to a time [s]; None without."""
        shown = recording["clouds"]["shown"]
        if not shown:
            return None
        times = np.array(recording["clouds"]["t"])[shown]
        return int(np.abs(times - time).argmin())

    @property
    def _count(self) -> int:
        return len(self.look["recordings"])

    def _path(self, at: int) -> LookPath | None:
        if at not in self._paths:
            self._paths[at] = self.files.path(at)
        return self._paths[at]

    def _any_cloud(self) -> FloatArray | None:
        """Points of the first cloud that holds enough to turn a camera to."""
        for at, one in enumerate(self.look["recordings"]):
            for number in one["clouds"]["shown"][:5]:
                points = self.files.cloud(at, number).points
                if len(points) > 10:
                    return points
        return None


def _rgb(colour: str) -> tuple[int, int, int]:
    """A colour "#rrggbb" as numbers."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
