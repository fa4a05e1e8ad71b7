"""How stiff the body is from place to place: lumps, a skin on top, and a change through the height."""

from __future__ import annotations

import numpy as np

from core.fem.elements import Quadrature
from core.frames import FloatArray
from core.setup import Inclusion, Layer, Material

__all__ = ["layer_share", "log_stiffness", "lump_share"]

_EDGE = 2.3
"""So many edges from its surface a lump or skin holds less than a ten-thousandth of a point's volume."""


def _inside(depth: FloatArray, rule: Quadrature) -> FloatArray:
    """Share (e, q) of each point's volume on the inner side of a surface that lies `depth` (e, q) [m] outwards of the point.

    A point stands for the volume around it, which the surface cuts while it passes over about an edge's length; the share is
    smooth, and so is all that follows from it.
    """
    share = np.zeros(depth.shape)
    edges = depth / np.cbrt(rule.weights)
    near = edges > -_EDGE
    share[near] = 0.5 * (1 + np.tanh(2 * edges[near]))
    return share


def lump_share(lump: Inclusion, rule: Quadrature) -> FloatArray:
    """Share (e, q) of the volume of each quadrature point that the lump holds [1]."""
    return _inside(lump.radius - np.linalg.norm(rule.places - (lump.x, lump.y, lump.z), axis=2), rule)


def layer_share(layer: Layer, rule: Quadrature, height: float) -> FloatArray:
    """Share (e, q) of the volume of each quadrature point that the skin on top of a body of this height [m] holds [1]."""
    return _inside(rule.places[:, :, 2] - (height - layer.thickness), rule)


def log_stiffness(material: Material, rule: Quadrature, height: float) -> FloatArray:
    """Logarithm (e, q) of the stiffness at the quadrature points over the stated one [1]."""
    log_factor = material.log_ratio * (rule.places[:, :, 2] / height - 0.5)
    for lump in material.inclusions:
        log_factor += lump_share(lump, rule) * np.log(lump.stiffness_ratio)
    if material.layer is not None:
        log_factor += layer_share(material.layer, rule, height) * np.log(material.layer.stiffness_ratio)
    return np.asarray(log_factor)
