"""Pictures of a replayed sequence."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from palpate.app.drawing import colours
from palpate.app.drawing.coloured_surface import banded_surface, light_surface
from palpate.app.drawing.cut_section import clipped, cut_face, depth_inside
from palpate.app.drawing.figures import (
    CloudFigure,
    Figure,
    LabelFigure,
    LinesFigure,
    PointArray,
    SurfaceFigure,
    ToolFigure,
    float32,
)
from palpate.app.drawing.free_surface import FreeSurface
from palpate.app.drawing.surface_bands import FineSurface, IntArray, grid_edges, refine
from palpate.app.drawing.view import Model, Quantity, Section, View
from palpate.app.scene.annotations import Annotations, path_lines
from palpate.app.scene.model_layer import FrameSolution, ModelLayer, end_of_scale, model_layers
from palpate.app.scene.picture import Picture
from palpate.app.storage.run_store import RecordedReplay
from palpate.foundation.arrays import FloatArray

__all__ = ["SequenceRenderer"]

NAMES = {"raw": "Raw model", "extended": "Extended model", "corrected": "Corrected model"}
MARGIN, APART = 0.008, 0.016
"""Margin around the body within which points are drawn, and gap between models [m]."""
MOST_POINTS = 50_000
"""Points of a cloud that a browser draws."""
MOST_TRIANGLES = 25_000
"""Approximate number of triangles of a coloured surface."""
WIRE = 1.2
"""Width of grid lines [pixel]."""


@dataclass(frozen=True, eq=False)
class _Cut:
    """The body at rest cut by a section: its surfaces by their parts, its edges, and the cut face
    as places (n, 3) [m] and triangles; None where the plane misses the body.
    """

    section: Section
    surfaces: dict[int, FineSurface]
    edges: IntArray
    face: tuple[FloatArray, IntArray] | None


class SequenceRenderer:
    """Makes the pictures of one replayed sequence.

    Args:
        replay: the sequence.
        clouds: gives the raw cloud of an index in the camera frame; None without clouds.
        annotations: of the run.
    """

    def __init__(
        self,
        replay: RecordedReplay,
        clouds: Callable[[int], FloatArray] | None,
        annotations: Annotations | None = None,
    ) -> None:
        self.replay, self._clouds = replay, clouds
        self.layers = model_layers(replay)
        self._annotations = annotations or Annotations(np.zeros((0, 3)), np.zeros((0, 3)))
        self._rest = np.asarray(replay["rest"], dtype=float)
        self._surfaces = {
            parts: refine(self._rest, replay["faces"], parts)
            for parts in (1, _parts(len(replay["faces"])))
        }
        self.body = FreeSurface.of(self._rest, replay["faces"])
        self._edges = grid_edges(self._rest, replay["faces"])
        self._cut: _Cut | None = None
        self._points = 0
        self._ends: dict[Quantity, float | None] = {}

    @cached_property
    def corners(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner of the body at rest (3,) [m]."""
        low, high = self._rest.min(axis=0), self._rest.max(axis=0)
        return np.array([low[0], low[1], 0.0]), high

    @property
    def limit(self) -> float:
        """Robust end of the scale of errors [m]."""
        return self.end("error") or 1e-3

    @property
    def lumps(self) -> int:
        """Number of lumps, tubes and offsets of the cast that can be shown."""
        return self._annotations.inclusions

    @property
    def mapped(self) -> bool:
        """Whether there is a free map of the stiffness."""
        return self._annotations.stiffness is not None

    @property
    def landmarks(self) -> int:
        """Number of touched landmarks that can be shown."""
        return len(self._annotations.landmarks)

    def end(self, quantity: Quantity) -> float | None:
        """Robust end of a scale; None where the run does not contain the quantity."""
        if quantity not in self._ends:
            self._ends[quantity] = end_of_scale(self.replay, quantity)
        return self._ends[quantity]

    def instead(
        self, frame: int, solution: FrameSolution, model: Model = "extended"
    ) -> SequenceRenderer:
        """The same renderer with another solution of one frame in place of a model's."""
        other = copy(self)
        other.layers = {
            **self.layers,
            model: replace(self.layers[model], instead=frame, solution=solution),
        }
        return other

    def picture(self, view: View, end: float | None = None) -> Picture:
        """The picture of a view; `end` is the end of the scale for a view without limit, instead of
        the robust one.
        """
        models = tuple(model for model in view.models() if model in self.layers)
        front = view.front(models)
        limit = view.limit or end or self.end(view.quantity)
        figures: dict[str, Figure] = {}
        columns = self._columns(view, models)
        points, coloured = 0, False
        for model, at in zip(models, columns, strict=False):
            drawn, shown = self._model(view, model, models, limit)
            coloured = coloured or shown
            alone = view.side_by_side and len(models) > 1
            if alone or model == front:
                around, points = self._around(
                    view, self.layers[model], f"-{model}" if alone else ""
                )
                drawn = {**drawn, **around}
            if alone:
                drawn[f"name-{model}"] = LabelFigure(NAMES[model], self._over_middle(0.03))
            figures.update({name: replace(figure, at=at) for name, figure in drawn.items()})
        if not models:
            figures, points = self._around(view, self.layers["raw"], "")
        quantity, limit = (view.quantity, limit) if coloured else (None, None)
        return Picture(view.frame, figures, points, quantity, limit, columns)

    def _over_middle(self, height: float) -> FloatArray:
        """Place (3,) [m] so far above the highest point of the body, over the middle of its
        bounds.
        """
        low, high = self.corners
        return np.array([*(low + high)[:2] / 2, high[2] + height])

    def _columns(
        self, view: View, models: tuple[Model, ...]
    ) -> tuple[tuple[float, float, float], ...]:
        """Offset of each model: side by side across the depth camera's line of sight, the raw one
        first.
        """
        if not view.side_by_side or len(models) < 2:
            return ((0.0, 0.0, 0.0),) * max(1, len(models))
        eye = self.layers["raw"].camera(-1).translation
        low, high = self.corners
        away = eye - (low + high) / 2
        around = np.arctan2(away[1], away[0])
        right = np.array([-np.sin(around), np.cos(around)])
        size = high - low
        apart = float(np.abs(right) @ size[:2]) + APART
        places = [apart * (len(models) - 1 - number) * right for number in range(len(models))]
        return tuple((float(x), float(y), 0.0) for x, y in places)

    def _model(
        self, view: View, model: Model, models: tuple[Model, ...], limit: float | None
    ) -> tuple[dict[str, Figure], bool]:
        """The figures of one model, and whether it shows the quantity."""
        layer, opacity, colour = (
            self.layers[model],
            view.opacity(model),
            getattr(colours, model.upper()),
        )
        if view.lines(model, models):
            lines = layer.surface(view.frame)[self._edges_left(view.section)]
            return {f"{model}-lines": LinesFigure(float32(lines), colour, WIRE)}, False
        values = (
            layer.values(view.quantity, view.frame)
            if view.coloured(model, models) and limit
            else None
        )
        surface = self._surface(view.section, fine=values is not None)
        vertices = surface.spread(layer.surface(view.frame))
        cap = self._cap(view, layer)
        if values is None or limit is None:
            plain: dict[str, Figure] = {
                model: SurfaceFigure(float32(vertices), surface.faces, colour, opacity)
            }
            if cap is not None:
                plain[f"{model}-cut"] = light_surface(cap[1], cap[2], colour, opacity)
            return plain, False
        name = f"{model}-{view.quantity}"
        drawn = banded_surface(
            name, vertices, surface.faces, surface.spread(values), view.quantity, limit, opacity
        )
        if cap is not None:
            places, moved, faces = cap
            inner = layer.within(view.quantity, view.frame, places)
            if inner is None:
                drawn[f"{model}-cut"] = light_surface(moved, faces, colour, opacity)
            else:
                drawn.update(
                    banded_surface(
                        f"{name}-cut", moved, faces, inner, view.quantity, limit, opacity
                    )
                )
        return drawn, True

    def _around(self, view: View, layer: ModelLayer, suffix: str) -> tuple[dict[str, Figure], int]:
        """Cloud, tool, path, base, landmarks and lumps next to a model."""
        figures: dict[str, Figure] = {}
        points = 0
        if "measured" in view.layers:
            cloud, points = self._cloud(view, layer)
            if cloud is not None:
                figures["cloud"] = CloudFigure(cloud, colours.MEASURED)
        if "tool" in view.layers:
            figures["tool"] = ToolFigure(*layer.tool(view.frame), view.opacity("tool"))
        if "path" in view.layers:
            figures.update(path_lines(layer.path, view.frame))
        if "landmarks" in view.layers:
            figures.update(self._annotations.landmark_figures())
        if "base" in view.layers:
            figures.update(self._annotations.base_figures(self.body, layer.model != "raw"))
        if "lump" in view.layers and not (suffix and layer.model == "raw"):
            figures.update(self._annotations.lump_figures(layer, view.frame, view.opacity("lump")))
            if (skin := self._annotations.stiffness) is not None:
                surface, moved = self._surface(view.section, fine=True), layer.surface(view.frame)
                opacity = view.opacity("lump")
                figures.update(skin.figures(surface, self._rest, moved, opacity))
        return {f"{name}{suffix}": figure for name, figure in figures.items()}, points

    def _surface(self, section: Section | None, *, fine: bool) -> FineSurface:
        parts = (max if fine else min)(self._surfaces)
        return self._surfaces[parts] if section is None else self._cut_by(section).surfaces[parts]

    def _edges_left(self, section: Section | None) -> IntArray:
        return self._edges if section is None else self._cut_by(section).edges

    def _cut_by(self, section: Section) -> _Cut:
        """The rest that a section leaves; the last result is cached."""
        cut = self._cut
        if cut is None or cut.section != section:
            surfaces = {
                parts: clipped(surface, self._rest, section)
                for parts, surface in self._surfaces.items()
            }
            edges = self._edges[
                np.all(depth_inside(section, self._rest)[self._edges] >= -1e-9, axis=1)
            ]
            face = cut_face(*self.body.closed, section)
            self._cut = cut = _Cut(section, surfaces, edges, face)
        return cut

    def _cap(self, view: View, layer: ModelLayer) -> tuple[FloatArray, FloatArray, IntArray] | None:
        """The cut face of a section: places at rest and current places (n, 3) [m], triangles; None
        without one.
        """
        if view.section is None:
            return None
        face = self._cut_by(view.section).face
        moved = None if face is None else layer.moved(view.frame, face[0])
        return None if face is None or moved is None else (face[0], moved, face[1])

    def _cloud(self, view: View, layer: ModelLayer) -> tuple[PointArray | None, int]:
        if self._clouds is None:
            return None, 0
        points = layer.camera(view.frame).apply(
            self._clouds(int(self.replay["cloud_index"][view.frame]))
        )
        if view.crop:
            points = points[_near_box(points, *self.corners)]
        if view.section is not None:
            points = points[depth_inside(view.section, points) >= 0]
        count = min(MOST_POINTS, int(np.ceil(len(points) * view.opacity("measured"))))
        points = (
            points[np.linspace(0, len(points) - 1, count).astype(int)]
            if 0 < count < len(points)
            else points
        )
        if not len(points):
            return None, 0
        self._points = max(self._points, 1000 * (len(points) // 800 + 1))
        padded = np.tile(points[:1], (self._points, 1)).astype(np.float32)
        padded[: len(points)] = points
        return padded, len(points)


def _parts(faces: int) -> int:
    """Number of parts of each triangle edge for smooth bands, within the triangles a browser can
    draw.
    """
    return int(np.clip(np.sqrt(MOST_TRIANGLES / faces), 1, 10))


def _near_box(points: FloatArray, low: FloatArray, high: FloatArray) -> Any:
    """Mask of the points within the body's bounds or near them, and above the table."""
    return np.all(
        (points > low - MARGIN * np.array([1.0, 1.0, -0.1])) & (points < high + MARGIN), axis=1
    )
