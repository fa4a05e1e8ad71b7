"""Nuisances that act together."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import ImageSource, Nuisance, StatedMotion

__all__ = [
    "described",
    "formed",
    "robot_rate",
    "seen_through",
    "shaped_tool",
    "stamped_frames",
    "stated_centres",
]


def seen_through(
    nuisances: Sequence[Nuisance], source: ImageSource, rng: np.random.Generator
) -> ImageSource:
    """The source of images with all nuisances, from one without any."""
    for one in nuisances:
        source = partial(_image, one, source, rng)
    return source


def _image(one: Nuisance, source: ImageSource, rng: np.random.Generator, instant: float) -> Any:
    return one.image(source, instant, rng)


def formed(
    nuisances: Sequence[Nuisance], surface: FloatArray, size: tuple[float, float, float]
) -> FloatArray:
    """The true form of points (s, 3) [m] of a block's surface at rest."""
    for one in nuisances:
        surface = one.form(surface, size)
    return surface


def shaped_tool(
    nuisances: Sequence[Nuisance], parts: list[tuple[FloatArray, Any]], radius: float
) -> list[tuple[FloatArray, Any]]:
    """The true meshes of a tool; see `Nuisance.tool`."""
    for one in nuisances:
        parts = one.tool(parts, radius)
    return parts


def stated_centres(nuisances: Sequence[Nuisance], motion: StatedMotion) -> FloatArray:
    """Tool centres (n, 3) [m] that the robot states for a true motion."""
    for one in nuisances:
        centres = one.stated(motion)
        motion = StatedMotion(motion.times, centres, motion.velocities, motion.forces)
    return motion.centres


def robot_rate(nuisances: Sequence[Nuisance], stated: float) -> float:
    """Poses of the tool per second [1/s]; `stated` where no nuisance sets it."""
    rates = [one.robot_rate for one in nuisances if one.robot_rate is not None]
    return rates[-1] if rates else stated


def stamped_frames(
    nuisances: Sequence[Nuisance], instants: FloatArray, rng: np.random.Generator
) -> tuple[Any, FloatArray]:
    """Indices (m,) of the stored clouds and their time stamps (m,) [s]."""
    index, stamps = np.arange(len(instants)), instants
    for one in nuisances:
        chosen, stamps = one.stamped(stamps, rng)
        index = index[chosen]
    return index, stamps


def described(nuisances: Sequence[Nuisance]) -> list[dict[str, Any]]:
    """Name and parameters of each, in SI units."""
    return [{"name": type(one).__name__, "parameters": one.parameters} for one in nuisances]
