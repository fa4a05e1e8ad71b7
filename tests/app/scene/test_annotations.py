"""Tubes of a report as they are drawn."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.app.drawing import colours
from palpate.app.drawing.figures import SurfaceFigure
from palpate.app.scene.annotations import annotations_of, swept

LINE = [[-0.03, 0.0, 0.02], [-0.01, 0.002, 0.022], [0.01, 0.002, 0.022], [0.03, 0.0, 0.02]]


def _interval(value: float, width: float, unit: str = "m") -> dict[str, Any]:
    return {"value": value, "unit": unit, "low": value - width, "high": value + width}


def _cause(**more: Any) -> dict[str, Any]:
    parameters = {"radius": _interval(3e-3, 5e-4), "aside": _interval(2e-3, 1e-3)}
    return {"effect": "stiff_tube", "parameters": parameters, **more}


def _annotations(causes: list[dict[str, Any]]) -> Any:
    return annotations_of(SimpleNamespace(model={}, report={"causes": causes}))  # type: ignore[arg-type]


class Still:
    """A layer of a run without an interior, in which nothing moves."""

    def moved(self, frame: int, places: np.ndarray) -> None:
        return None


def test_swept_circle_is_a_closed_surface_at_its_radius_from_the_axis():
    axis = np.array(LINE)
    points, faces = swept(axis, 3e-3)
    rings = points.reshape(len(axis) + 2, -1, 3)
    assert np.linalg.norm(rings[1:-1] - axis[:, None], axis=2) == pytest.approx(3e-3)
    assert rings[0] == pytest.approx(np.broadcast_to(axis[0], rings[0].shape))
    assert rings[-1] == pytest.approx(np.broadcast_to(axis[-1], rings[-1].shape))
    a, b, c = points[faces].transpose(1, 0, 2)
    volume = np.einsum("ti,ti->", a, np.cross(b, c)) / 6
    length = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
    assert volume == pytest.approx(np.pi * 9e-6 * length, rel=0.05)


def test_tube_of_a_report_is_drawn_inside_its_interval():
    found = _annotations([_cause(polyline=LINE)])
    assert found.inclusions == 1 and not found.lumps
    figures = found.lump_figures(Still(), 0, 1.0)
    tube, interval = figures["lump-0"], figures["lump-0-interval"]
    assert isinstance(tube, SurfaceFigure) and isinstance(interval, SurfaceFigure)
    assert interval.opacity < tube.opacity < 1
    assert np.ptp(tube.vertices[:, 2]) < np.ptp(interval.vertices[:, 2])
    assert tube.vertices[:, 0].min() == pytest.approx(-0.03, abs=1e-3)


@pytest.mark.parametrize("cause", [_cause(), _cause(polyline=[])], ids=["none", "empty"])
def test_cause_without_a_line_is_not_drawn(cause):
    assert _annotations([cause]).inclusions == 0


def test_offset_of_a_cast_is_drawn_as_beads_in_the_colours_of_its_sign():
    places = [[0.0, 0.0, 0.02], [0.01, 0.0, 0.02], [0.02, 0.0, 0.02]]
    field = {"places": places, "offset": [-3e-4, 0.0, 3e-4]}
    parameters = {"rms": _interval(2.4e-4, 5e-5)}
    cause = {"effect": "geometry_local", "parameters": parameters, "field": field}
    found = _annotations([cause])
    assert found.inclusions == 1
    figures = found.lump_figures(Still(), 0, 1.0)
    shades = [figure.colour for _, figure in sorted(figures.items())]
    assert shades == [colours.SIGNED[band] for band in (0, 7, 14)]
    middles = [figure.vertices.mean(axis=0) for _, figure in sorted(figures.items())]
    np.testing.assert_allclose(middles, places, atol=2e-4)
    assert _annotations([{**cause, "field": {"places": [], "offset": []}}]).inclusions == 0
