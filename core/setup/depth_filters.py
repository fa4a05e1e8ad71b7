"""Filters on depth images that a dataset can declare, and what they do to a comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["DEPTH_FILTERS", "DepthFilter"]


@dataclass(frozen=True)
class DepthFilter:
    """One filter of a camera's driver.

    Attributes:
        edge: width of the band along the phantom's edges that it rounds [m].
        caution: what the filter does to a diagnosis, as a sentence's end.
    """

    edge: float
    caution: str


DEPTH_FILTERS: Mapping[str, DepthFilter] = {
    "decimation": DepthFilter(2e-3, "each point is the median of several pixels"),
    "spatial": DepthFilter(3e-3, "edges are rounded, and neighbouring points share their noise"),
    "hole-filling": DepthFilter(
        3e-3, "points beside the tool and beside edges are copies of their neighbours"
    ),
    "temporal": DepthFilter(
        0.0, "what moves is seen late: the clouds' clock can seem late by 0.1 s, and dents shallow"
    ),
}
"""Filters by the names that librealsense's documentation uses. The widths are those of its default
settings at 0.3 to 0.4 m, where a pixel is about 0.5 mm; chosen, not derived."""
