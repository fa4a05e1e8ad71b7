"""Candidate pushes: places on the top and the sides, straight in or along, of usual depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.dataset.tool_motion import ContactKind
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Setup

__all__ = ["Push", "depth_reached", "pushes", "speed_reached"]

_SIDES = {"top": (2, 1.0), "-x": (0, -1.0), "+x": (0, 1.0), "-y": (1, -1.0), "+y": (1, 1.0)}
_SURFACE = "surface"
"""Side of a push on a free form."""
_NAMED = {
    _SURFACE: "along the normal of the surface",
    "top": "on the top",
    "-x": "into the -x side",
    "+x": "into the +x side",
    "-y": "into the -y side",
    "+y": "into the +y side",
}

Touched = tuple[str, tuple[float, float, float], tuple[float, float, float]]
"""Side, place [m] and unit vector into the body."""


@dataclass(frozen=True, kw_only=True)
class Push:
    """One push, straight into a side from where the tool touches it.

    Attributes:
        kind: "top", "side" or "drag".
        side: that is touched; "surface" of a free form.
        into: unit vector into the body.
        place: (x, y, z) of the first touch [m], phantom frame.
        depth: of the ball in the block [m].
        along: way of a drag at that depth, (x, y, z) [m].
        speed: going in [m/s]; a cloud at half the depth is taken in passing.
        hold: rest at full depth and again after the release [s].
    """

    kind: ContactKind
    side: str
    into: tuple[float, float, float]
    place: tuple[float, float, float]
    depth: float
    along: tuple[float, float, float] = (0.0, 0.0, 0.0)
    speed: float = 0.0
    hold: float = 0.0

    @property
    def direction(self) -> FloatArray:
        """Unit vector into the body (3,)."""
        return np.array(self.into)

    def centres(self, radius: float, late: float = 0.0) -> FloatArray:
        """Return the tool's centre when clouds are taken (4, 3) [m].

        They are taken when it passes half the depth, at full depth, after a drag, and after the
        release.

        Args:
            radius: of the tool [m].
            late: time by which a cloud is taken earlier than stated [s].
        """
        touch, inward = np.array(self.place) - radius * self.direction, self.direction
        passing = touch + (0.5 * self.depth - late * self.speed) * inward
        deep = touch + self.depth * inward
        return np.array([passing, deep, deep + np.array(self.along), touch - 2 * radius * inward])

    def half(self) -> Push:
        """Return the push at half the depth."""
        return replace(self, depth=self.depth / 2)

    @property
    def times(self) -> FloatArray:
        """Return when these clouds are taken (4,) [s]; they matter for a material with history."""
        down = self.depth / max(self.speed, 1e-3)
        return (
            np.array([0.5 * down, down, down + self.hold + 0.5, down + 2 * self.hold + 1.5]) + 1.0
        )

    def text(self) -> str:
        """Return the instruction in words."""
        shown = ", ".join(
            f"{1e3 * value:.0f}" for value in self.place[: 2 if self.side == "top" else 3]
        )
        words = f"press {1e3 * self.depth:.2g} mm deep {_NAMED[self.side]} at ({shown}) mm"
        if self.kind == "drag":
            axis = int(np.abs(self.along).argmax())
            sign, length = "+" if self.along[axis] > 0 else "-", 1e3 * abs(self.along[axis])
            words += f" and drag {length:.0f} mm along {sign}{'xyz'[axis]}"
        if self.speed and not self.hold:
            words += f", going in at {1e3 * self.speed:.0f} mm/s"
        return (
            f"{words}, hold for {self.hold:.0f} s and look again {self.hold:.0f} s after the "
            "release"
            if self.hold
            else words
        )


def depth_reached(data: Sequence[Observations], setup: Setup) -> float:
    """Return the median depth of earlier pushes [m], at most a third of the phantom."""
    deepest = [-setup.geometry.gap(item.centres(setup), setup.tool.radius).min() for item in data]
    return float(np.clip(np.median(deepest), 1e-3, 0.3 * min(setup.geometry.size)))


def speed_reached(data: Sequence[Observations], setup: Setup) -> float:
    """Return a high quantile of the tool's speed near the block [m/s]."""
    found = []
    for item in data:
        path = setup.phantom_from_robot.apply(item.kinematics.position_at(item.times))
        near = setup.geometry.gap(path, setup.tool.radius) < 0
        speed = np.linalg.norm(np.gradient(path, axis=0), axis=1) / np.maximum(
            np.gradient(item.times), 1e-6
        )
        found.append(speed[near])
    fast = np.concatenate(found)
    return float(np.quantile(fast, 0.9)) if len(fast) else 0.0


def pushes(
    setup: Setup, depth: float, *, drags: bool, speed: float = 0.0, holds: Sequence[float] = (0.0,)
) -> list[Push]:
    """Return candidates all over the reachable surface of the stated body.

    Args:
        setup: as stated.
        depth: of each [m].
        drags: whether drags over a block's flat top are candidates.
        speed: of all [m/s], where clocks or history matter.
        holds: rests that are tried [s].
    """
    geometry = setup.geometry
    touched = _on_block(setup) if geometry.is_block else _on_free_form(geometry)
    straight = [
        Push(
            kind="top" if -into[2] > CRITERIA.design.upright else "side",
            side=side,
            into=into,
            place=place,
            depth=depth,
            speed=speed,
            hold=hold,
        )
        for side, place, into in touched
        for hold in holds
    ]
    if not drags:
        return straight
    low, high = geometry.low[:2], geometry.high[:2]
    dragged = []
    for push in straight:
        for way in np.vstack([np.eye(3)[:2], -np.eye(3)[:2]]) * CRITERIA.design.drag_length:
            end = np.array(push.place)[:2] + way[:2]
            if (
                push.side == "top"
                and np.all(end > low + setup.tool.radius)
                and np.all(end < high - setup.tool.radius)
            ):
                x, y, z = way.tolist()
                dragged.append(replace(push, kind="drag", along=(x, y, z)))
    return straight + dragged[:: max(1, len(dragged) // 8)]


def _on_block(setup: Setup) -> list[Touched]:
    """Return places all over the sides of a block."""
    found = list[Touched]()
    for side, (axis, sign) in _SIDES.items():
        x, y, z = (-sign * np.eye(3)[axis]).tolist()
        found += [(side, place, (x, y, z)) for place in _places(setup, side)]
    return found


def _on_free_form(geometry: Geometry) -> list[Touched]:
    """Return places all over a free form where its surface looks upwards."""
    found, kept = list[Touched](), list[FloatArray]()
    places = geometry.surface_points()
    normals = geometry.facing(places)[1]
    for place, normal in zip(places, normals, strict=True):
        near = any(np.linalg.norm(place - other) < CRITERIA.design.spacing for other in kept)
        if normal[2] > CRITERIA.design.reached and not near:
            kept.append(place)
            (x, y, z), (u, v, w) = place.tolist(), (-normal).tolist()
            found.append((_SURFACE, (x, y, z), (u, v, w)))
    return found


def _places(setup: Setup, side: str) -> list[tuple[float, float, float]]:
    """Return the places of a side: a grid on the top, one line on the others."""
    size, margin = np.array(setup.geometry.size), CRITERIA.design.margin * setup.tool.radius

    def spread(axis: int) -> FloatArray:
        half = max(size[axis] / 2 - margin, 0.0)
        return np.linspace(
            -half, half, max(1, int(np.ceil(2 * half / CRITERIA.design.spacing)) + (half > 0))
        )

    axis, sign = _SIDES[side]
    if axis == 2:
        return [(float(x), float(y), float(size[2])) for x in spread(0) for y in spread(1)]
    end, height = float(sign * size[axis] / 2), float(CRITERIA.design.side_height * size[2])
    return [
        (end, float(v), height) if axis == 0 else (float(v), end, height) for v in spread(1 - axis)
    ]
