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
_UNCLEANED = "The clouds could not be related to the phantom, so they are not cleaned."
_RELATED = {
    "robot": "Nothing relates the robot to the camera",
    "phantom": "Nothing relates the phantom to the camera",
}


@dataclass(frozen=True, eq=False)
class DrawnLook:
    """A picture of a look.

    Attributes:
        picture: its figures, z upwards.
        cloud: number of the drawn cloud among the stored ones; None without.
        cloud_time: of it [s].
        frame: of the scene.
        counts: points of it by reason, before it was thinned.
        cannot: for each requested layer that is not drawn the reason.
    """

    picture: Picture
    cloud: int | None
    cloud_time: float | None
    frame: str
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
    _upright: dict[str, Transform] = field(default_factory=dict)

    def frame(self, view: LookView) -> str:
        """Frame of the scene: that of the clouds; of the tool where no cloud is asked for."""
        own: str = self.look["frame"]
        tool: str = self.look["recordings"][self._number(view.recording)]["tool"]["frame"]
        return own if own != "camera" or {"raw", "cleaned"} & set(view.layers) else tool

    def upright(self, frame: str) -> Transform:
        """From a frame of the arrays to the scene, in which z is upwards."""
        if frame not in self._upright:
            self._upright[frame] = self._turned(frame)
        return self._upright[frame]

    def _turned(self, frame: str) -> Transform:
        if frame == "camera" and (cloud := self._any_cloud()) is not None:
            return as_seen(cloud)
        path = next((one for n in range(self._count) if (one := self._path(n))), None)
        if frame == "phantom" or path is None or not len(path.places):
            return Transform()
        low, high = path.places.min(axis=0), path.places.max(axis=0)
        return Transform(np.eye(3), -np.array([*(low + high)[:2] / 2, low[2]]))

    def bounds(self, frame: str) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,) [m] of what the camera is turned to, in the scene: the
        stated surface, else most of a cloud, else the tool's path.
        """
        points = np.zeros((1, 3))
        if frame == "phantom" and self.surface is not None:
            points = self.surface.vertices
        elif frame == self.look["frame"] and (cloud := self._any_cloud()) is not None:
            points = self.upright(frame).apply(cloud)
        elif (path := self._path(0)) is not None:
            points = self.upright(frame).apply(path.places)
        low, high = np.percentile(points, [3, 97], axis=0)
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.01)
        return middle - half, middle + half

    def eye(self, frame: str) -> FloatArray:
        """Place (3,) [m] of the depth camera in the scene; in front where it is not known."""
        if self.look["eye"] is not None and frame == "phantom":
            return np.array(self.look["eye"], dtype=float)
        return np.array([0.0, -1.0, 0.0]) + self.upright(frame).translation

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
        low, high = self.bounds(self.look["frame"])
        return max(0.6 * size_of_points(cloud), 0.002 * float(np.linalg.norm(high - low)))

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
        frame = self.frame(view)
        figures |= self._tool(at, view, frame)
        if "surface" in view.layers and self.surface is not None and frame == "phantom":
            shape = self.surface
            figures["surface"] = SurfaceFigure(
                float32(shape.vertices), shape.faces.astype(np.int64), colours.RAW, SURFACE_OPACITY
            )
        for layer in view.layers:
            if why := self._cannot(layer, at, number, frame):
                cannot[layer] = why
        shown = Picture(number or 0, figures, points, None, None, ((0.0, 0.0, 0.0),))
        return DrawnLook(shown, number, time, frame, counts, cannot)

    def _cloud(self, cloud: ShownCloud, view: LookView) -> CloudFigure:
        places = float32(self.upright(self.look["frame"]).apply(cloud.points))
        if "cleaned" not in view.layers or not self.look["cleaned"]:
            return CloudFigure(places, colours.MEASURED, self.point_size)
        names = [row["name"] for row in self.look["reasons"]]
        shades = np.array([_rgb(row["colour"]) for row in self.look["reasons"]], dtype=np.uint8)
        kept = np.array([name not in view.hidden for name in names])[cloud.reason]
        return CloudFigure(places[kept], shades[cloud.reason[kept]], self.point_size)

    def _tool(self, at: int, view: LookView, frame: str) -> dict[str, Figure]:
        """The tool at the time of the view, and its path."""
        path = self._path(at)
        if path is None or self.look["recordings"][at]["tool"]["frame"] != frame:
            return {}
        figures: dict[str, Figure] = {}
        if "tool" in view.layers:
            radius = self.look["tool_radius"] or UNKNOWN_RADIUS
            axis = path.axis_at(view.time)
            figures["tool"] = ToolFigure(
                self.upright(frame).apply(path.at(view.time)),
                radius,
                axis=None if axis is None else self.upright(frame).rotate(axis),
            )
        if "path" in view.layers:
            every = 1 + (len(path.time) - 1) // MOST_SEGMENTS
            reached = int(np.searchsorted(path.time[::every], view.time))
            figures |= path_lines(self.upright(frame).apply(path.places[::every]), reached)
        return figures

    def _cannot(self, layer: LookLayer, at: int, number: int | None, frame: str) -> str:
        """The reason why a layer is not drawn; empty where it is."""
        tool = self.look["recordings"][at]["tool"]["frame"]
        apart = frame == "camera" and f"{_RELATED[tool]}: hide the clouds to see it."
        if layer in ("raw", "cleaned"):
            raw = _UNCLEANED if layer == "cleaned" and not self.look["cleaned"] else ""
            return "There are no clouds in this recording." if number is None else raw
        if layer == "surface":
            if self.surface is None:
                return "No phantom is stated."
            if tool == "phantom" and apart:
                return apart
            return "" if frame == "phantom" else "Nothing relates the phantom to the robot."
        if self._path(at) is None:
            return "There are no poses of the tool in this recording."
        return "" if tool == frame else apart or "Nothing relates the robot to the phantom."

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
