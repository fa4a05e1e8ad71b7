"""Places of a report in the frame of the dataset's files, of a phantom that was turned upright."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["with_places_in_file"]


def with_places_in_file(report: dict[str, Any]) -> dict[str, Any]:
    """Add `in_file_frame` to the causes and next probes that state a place; a report without
    `phantom_from_file` has all places in that frame, and is returned as it is.

    A cause has there the `centre` of its x, y, z and its `polyline`, a probe `place` and
    `direction`, in metres.
    """
    if "phantom_from_file" not in report:
        return report
    back = Transform.from_matrix(np.array(report["phantom_from_file"])).inverse()
    return {
        **report,
        "causes": [_added(cause, _of_cause(cause, back)) for cause in report["causes"]],
        "next_probe": [
            _added(probe, _of_probe(probe, back)) for probe in report.get("next_probe", [])
        ],
    }


def _added(entry: dict[str, Any], places: dict[str, Any]) -> dict[str, Any]:
    return {**entry, "in_file_frame": places} if places else entry


def _of_cause(cause: dict[str, Any], back: Transform) -> dict[str, Any]:
    found: dict[str, Any] = {}
    parameters = cause.get("parameters", {})
    if {"x", "y", "z"} <= set(parameters):
        centre = np.array([float(parameters[axis]["value"]) for axis in "xyz"])
        found["centre"] = _plain(back.apply(centre))
    if cause.get("polyline"):
        found["polyline"] = _plain(back.apply(np.array(cause["polyline"], dtype=float)))
    return found


def _of_probe(probe: dict[str, Any], back: Transform) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if "place" in probe:
        found["place"] = _plain(back.apply(np.array(probe["place"], dtype=float)))
    if "direction" in probe:
        found["direction"] = _plain(back.rotate(np.array(probe["direction"], dtype=float)))
    return found


def _plain(values: FloatArray) -> Any:
    """Return values as lists, with five digits after the point."""
    return np.round(values, 5).tolist()
