"""A free map of the stiffness as the report states it: its parts that are stiffer or softer, what
each push feels, and all places with their intervals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.report.stiffness.stiffness_map import MappedValues, StiffnessMap

__all__ = ["map_to_json", "unusual_parts"]

_NOISE = "a free map of the stiffness shows nothing beyond noise"


def map_to_json(made: StiffnessMap) -> dict[str, Any]:
    """Return `stiffness_map` of a report; without places where it shows nothing but noise."""
    field, shown = made.field, made.structured
    trusted = made.on_surface.trusted
    return {
        "structured": shown,
        **({} if shown else {"why_not": _NOISE}),
        "gain_nats": round(field.gain, 2),
        "bound_nats": round(field.bound, 2),
        "correlation_length": {"value": round(field.length, 5), "unit": "m"},
        "prior_deviation": {"value": round(field.deviation, 4), "unit": "1"},
        "cell": np.round(made.cells.edges, 5).tolist(),
        "trusted_share": round(float(trusted.mean()), 4) if len(trusted) else 0.0,
        "unfelt_ends": list(made.ends),
        "parts": unusual_parts(made) if shown else [],
        "pushes": _pushes(made) if shown else [],
        "points": _rows(made.inside) if shown else [],
        "surface": _rows(made.on_surface) if shown else [],
    }


def _rows(values: MappedValues) -> list[dict[str, Any]]:
    """Places with ratio, interval, and whether the data tell it."""
    return [
        {
            "at": place,
            "ratio": round(float(ratio), 4),
            "low": round(float(low), 4),
            "high": round(float(high), 4),
            "trusted": bool(known),
        }
        for place, ratio, low, high, known in zip(
            np.round(values.places, 5).tolist(), *values.ends, values.trusted, strict=True
        )
    ]


def _pushes(made: StiffnessMap) -> list[dict[str, Any]]:
    """State what each push feels, as `_rows` states it, with its number and sequence."""
    return [
        {"number": push.number, "sequence": push.sequence, **row}
        for push, row in zip(made.pushes, _rows(made.felt), strict=True)
    ]


def unusual_parts(made: StiffnessMap) -> list[dict[str, Any]]:
    """Connected parts that are surely stiffer or softer than usual, the surest first."""
    values = made.inside
    rows = np.flatnonzero(values.unusual)
    ratio, low, high = values.ends
    near = KDTree(made.cells.centres[rows]).query_pairs(
        CRITERIA.stiffness_map.joined * float(made.cells.edges.max()), output_type="ndarray"
    )
    same = np.sign(values.mean[rows[near[:, 0]]]) == np.sign(values.mean[rows[near[:, 1]]])
    one, other = near[same].T
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(rows), len(rows)))
    found = []
    for label in range(connected_components(graph, directed=False)[0] if len(rows) else 0):
        own = rows[connected_components(graph, directed=False)[1] == label]
        sure = np.abs(values.mean[own]) / values.deviation[own]
        peak = own[int(sure.argmax())]
        weights = np.zeros(len(made.cells.centres))
        weights[own] = np.abs(values.mean[own])
        corners = made.cells.centres[own]
        found.append(
            {
                "at": np.round(made.cells.centres[peak], 5).tolist(),
                "ratio": round(float(ratio[peak]), 4),
                "low": round(float(low[peak]), 4),
                "high": round(float(high[peak]), 4),
                "from": np.round(corners.min(axis=0) - made.cells.edges / 2, 5).tolist(),
                "to": np.round(corners.max(axis=0) + made.cells.edges / 2, 5).tolist(),
                "pushes": made.carriers(weights),
                "sure": float(sure.max()),
            }
        )
    found.sort(key=lambda spot: -float(spot.pop("sure")))
    return found[: CRITERIA.stiffness_map.most_spots]
