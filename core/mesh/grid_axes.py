"""Node coordinates along one axis of a structured grid."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from palpate.foundation.arrays import FloatArray

__all__ = ["even_axis", "graded_axis", "sized_axis", "split_near"]


def even_axis(low: float, high: float, nodes: int) -> FloatArray:
    """Compute evenly spaced node coordinates [m]."""
    return np.linspace(low, high, nodes)


def graded_axis(low: float, high: float, nodes: int, focus: float, spacing: float) -> FloatArray:
    """Compute node coordinates [m] with a given spacing at the focus, growing away from it.

    The spacing at s is spacing + g |s - focus|, so node numbers are the logarithm of the distance.
    The rate g is chosen such that the given number of nodes fills the axis, and each side is
    stretched slightly to hold a whole number of elements.
    """
    left, right = max(focus - low, 0.0), max(high - focus, 0.0)
    elements = nodes - 1
    if (left + right) / elements <= spacing:
        return even_axis(low, high, nodes)

    def count(growth: float) -> float:
        return (
            float((np.log1p(growth * left / spacing) + np.log1p(growth * right / spacing)) / growth)
            - elements
        )

    growth = brentq(count, 1e-9, 1e3)
    on_left = round(float(np.log1p(growth * left / spacing) / growth))
    on_left = min(max(on_left, 1 if left > 0 else 0), elements - (1 if right > 0 else 0))

    def side(length: float, number: int) -> FloatArray:
        steps = np.expm1(growth * np.arange(number + 1))
        return np.asarray(length * steps / max(steps[-1], 1e-300))

    lower = focus - side(left, on_left)[::-1] if on_left else np.array([low])
    upper = focus + side(right, elements - on_left) if on_left < elements else np.array([high])
    return np.concatenate([lower, upper[1:]])


def sized_axis(
    low: float, high: float, focus: float, edge: float, growth: float, longest: float = np.inf
) -> FloatArray:
    """Compute element ends [m] from edge lengths.

    On each side, growth and longest edge are scaled by one factor, so that a whole number of
    elements fills it.

    Args:
        low: end of the axis [m].
        high: other end [m].
        focus: point of the finest mesh [m].
        edge: length there [m].
        growth: of the edges per distance [1].
        longest: edge [m].
    """
    below, above = (
        _side(focus - low, edge, growth, longest),
        _side(high - focus, edge, growth, longest),
    )
    return np.concatenate([focus - below[::-1], focus + above[1:]])


def split_near(ends: FloatArray, place: float, edge: float, growth: float) -> FloatArray:
    """Split elements near a point into equal parts.

    Args:
        ends: of the elements [m].
        place: the point [m].
        edge: longest edge there [m].
        growth: of the longest edge per distance from there [1].
    """
    apart = np.maximum(np.maximum(ends[:-1] - place, place - ends[1:]), 0.0)
    parts = np.ceil(np.diff(ends) / (edge + growth * apart) - 1e-9).astype(int)
    inner = [
        np.linspace(low, high, number, endpoint=False)
        for low, high, number in zip(ends[:-1], ends[1:], parts, strict=True)
    ]
    return np.append(np.concatenate(inner), ends[-1])


def _side(length: float, edge: float, growth: float, longest: float) -> FloatArray:
    """Distances of the element ends from the focus [m], from 0 to the length."""
    if length <= 0:
        return np.zeros(1)

    def reach(factor: float) -> float:
        """Distance at which the edges stop growing [m]."""
        return min(max((longest - edge / factor) / growth, 0.0), length)

    def count(factor: float) -> float:
        rate, grown = factor * growth, reach(factor)
        return float(np.log1p(rate * grown / edge) / rate) + (length - grown) / (factor * longest)

    number = max(1, round(count(1.0)))
    if number * edge >= length:
        return np.linspace(0, length, number + 1)
    factor = brentq(lambda value: count(value) - number, 1e-9 / growth, 1e3 / growth)
    rate, grown = factor * growth, reach(factor)
    steps, growing = np.arange(number + 1), float(np.log1p(rate * grown / edge) / rate)
    ends = np.where(
        steps < growing,
        np.expm1(rate * steps) * edge / rate,
        grown + (steps - growing) * min(factor * longest, length),
    )
    return np.append(ends[:-1], length)
